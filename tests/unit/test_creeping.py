"""ISPH in flows that creep: the divergence that is left over goes, and a particle that a side stops sets no time step."""

from pathlib import Path

from warpsph.case.case_file import load_case
from warpsph.simulation import Simulation

CASES = Path(__file__).resolve().parents[2] / "cases"


def test_a_cavity_without_inertia():
    """Without the rate of friction u and v were 6.7 and 39 % off with 16 spacings, without the last pressure v 11 %."""
    case = load_case(CASES / "creeping_cavity.yaml").replace(
        {"particle_spacing": 1 / 16, "numerics.scheme": "isph", "output.particles": "none"}
    )
    simulation = Simulation(case)
    simulation.run()
    errors = simulation.summary["errors"]
    assert errors["u"]["error"] < 0.02
    assert errors["v"]["error"] < 0.08
    # steps of explicit friction would be 8 000; those of a particle in a corner, which a side stops each time, were 6 276
    assert simulation.summary["steps"] < 800
