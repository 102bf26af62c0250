"""Walls of bodies that fluid slides along, or under a free surface, give back the work they take (theory: delta#d6)."""

from pathlib import Path

import pytest

import warpsph
from tests.scenes import SOUND
from warpsph.running.model import Model

ROOT = Path(__file__).resolve().parents[2]
RING = ROOT / "cases" / "turning_ring.yaml"
SQUARE, VENTURI = (ROOT / "scripts" / "foreign" / name for name in ("buoy_sq.yaml", "venturi.yaml"))
FULL = [  # no free surface: a core at rest within the ring
    "fluids.0.shape.where.condition=x**2 + y**2 < 0.5**2 and x**2 + y**2 > 0.2**2",
    "bodies.core={shape: {sphere: {center: [0, 0], radius: 0.2}}}",
]


@pytest.mark.parametrize("integrator", ["leapfrog", "rk4"])
def test_water_at_rest_around_a_turned_square_comes_to_rest(integrator: str) -> None:
    """The first waves, of particles that settle at the square, die out; they fed a jet from its corner that grew."""
    changes = ["numerics.scheme=delta_plus", f"numerics.integrator={integrator}", "particle_spacing=0.04", "end_time=4"]
    case = warpsph.load_case(SQUARE, [*changes, "output.particles=none"])
    simulation = warpsph.Simulation(case, threads=1)
    simulation.run()
    energy = simulation.gauge("energy")
    early = energy["kinetic"][(energy["time"] > 0.5) & (energy["time"] <= 1.0)].mean()
    late = energy["kinetic"][energy["time"] > 3.5].mean()
    assert late < 0.25 * early


def turned(spacing: float, scheme: str, full: bool) -> tuple[float, float]:
    """Kinetic energy and angular momentum of the ring after half a turn, over those at the start, less 1."""
    changes = [f"particle_spacing={spacing}", f"numerics.scheme={scheme}", "end_time=0.5"]
    changes += ["output.particles=none", "reference={}"]
    changes += FULL if full else []
    case = warpsph.load_case(RING, changes)
    simulation = warpsph.Simulation(case, threads=1)
    simulation.run()
    energy, turning = simulation.gauge("energy")["kinetic"], simulation.gauge("momentum")["angular_z"]
    return energy[-1] / energy[0] - 1.0, turning[-1] / turning[0] - 1.0


@pytest.mark.parametrize(("scheme", "full"), [("delta_plus", False), ("delta_plus", True), ("riemann", True)])
def test_water_that_slides_along_a_round_wall_gains_nothing(scheme: str, full: bool) -> None:
    """A ring that turns in a still drum: no force along the wall. It drove the ring, at half the spacing as much.

    What unevenness beside the wall takes falls with the spacing, and no energy comes from the wall.
    """
    (energy, turning), (fine_energy, fine_turning) = (turned(spacing, scheme, full) for spacing in (0.02, 0.01))
    assert energy < 1.0e-3 and fine_energy < 1.0e-3
    assert abs(fine_energy) < 0.5 * abs(energy)  # of the first order at least
    assert abs(turning) < 0.01 and abs(fine_turning) < 0.01  # allowed by the case


@pytest.mark.parametrize("scheme", ["delta_plus", "riemann"])
def test_what_enters_a_venturi_leaves_it(scheme: str) -> None:
    """Between free-slip walls with a throat of half the height: the fluid thinned along them, 6 % more left than entered.

    Means over 2.5 s scatter by 0.1 %; each wall places its surface to a tenth of a spacing of the ten in the throat, 2 %.
    """
    changes = [f"numerics.scheme={scheme}", "end_time=10", "output.particles=none"]
    simulation = warpsph.Simulation(warpsph.load_case(VENTURI, changes), threads=1)
    simulation.run()
    flow = simulation.gauge("flow")
    name = next(key for key in flow if key.startswith("flow") and "x_upper" in key)
    assert -flow[name][flow["time"] > 7.5].mean() == pytest.approx(1000.0, rel=0.02)


def test_sound_between_walls_without_friction_stays() -> None:
    """Half a wave to and fro, 20 spacings, five passages: without its share the rate took two thirds of the energy."""
    case = warpsph.load_case({**SOUND, "numerics": {"scheme": "delta_plus", "acoustic_damping": 0}})
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    energies = []
    for time in (0.001, 1.0):
        model.stepper.run(time, 10**7)
        fluid = slice(model.particles.fluid_count)
        speeds, excess = model.particles.get("velocity")[fluid], model.particles.get("density_excess")[fluid]
        energies.append(float((speeds**2).sum() + 100.0 * (excess**2).sum()))
    assert energies[1] == pytest.approx(energies[0], rel=0.1)
