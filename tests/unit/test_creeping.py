"""ISPH in flows that creep: the divergence that is left over goes, and a particle that a side stops sets no time step."""

from pathlib import Path

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.running.model import Model
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


def test_what_rounding_leaves_of_a_fluid_at_rest_sets_no_step():
    """Syrup that fills a box: its speeds are rounding, 1e-8 m/s, and change in every step: 6 160 steps in 2 s."""
    model = Model(
        Case.from_dict(
            {
                "dimension": 2,
                "particle_spacing": 1 / 24,
                "end_time": 2.0,
                "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
                "gravity": [0, -9.81],
                "phases": {"syrup": {"density": 1000, "viscosity": 1000}},
                "fluids": [{"phase": "syrup", "shape": "rest"}],
                "start": {"noise": 0.1},
                "numerics": {"scheme": "isph"},
            }
        )
    )
    model.stepper.prepare(True)
    model.stepper.run(2.0, 10**6)
    assert model.steps < 400
    assert abs(model.snapshot().fluid.velocity).max() < 1e-5
