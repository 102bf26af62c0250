"""Walls of bodies give back the work they take, under a free surface: nothing at rest begins to run (theory: delta#d6)."""

from pathlib import Path

import numpy as np
import pytest

import warpsph

SHIPPED = Path(__file__).resolve().parents[2] / "cases" / "turning_ring.yaml"
SUNK = "y < 0.8 and abs((x + 0.4) + 0.5*(y - 0.4)) + abs(0.5*(x + 0.4) - (y - 0.4)) > 0.25"
TANK = {
    "title": "still water around a sunk square, turned by 27 degrees",
    "dimension": 2,
    "particle_spacing": 0.04,
    "end_time": 4.0,
    "domain": {"lower": [-1, 0], "upper": [1, 1.2], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
    "gravity": [0, -9.81],
    "phases": {"water": {"density": 1000, "viscosity": 0.001}},
    "fluids": [{"phase": "water", "shape": {"where": {"condition": SUNK}}}],
    "bodies": {"square": {"shape": {"polygon": {"points": [[-0.2, 0.5], [-0.5, 0.6], [-0.6, 0.3], [-0.3, 0.2]]}}}},
    "numerics": {"scheme": "delta_plus"},
    "start": {"pressure": "hydrostatic"},
    "output": {"particles": "none", "checkpoint": "none"},
    "gauges": {"energy": {"type": "energy", "interval": 0.02}},
}


def test_water_at_rest_around_a_turned_square_comes_to_rest() -> None:
    """The first waves, of particles that settle at the square, die out; they fed a jet from its corner that grew."""
    simulation = warpsph.Simulation(warpsph.load_case(TANK), threads=1)
    simulation.run()
    energy = simulation.gauge("energy")
    early = energy["kinetic"][(energy["time"] > 0.5) & (energy["time"] <= 1.0)].mean()
    late = energy["kinetic"][energy["time"] > 3.5].mean()
    assert late < 0.25 * early


@pytest.mark.parametrize("spacing", [0.04, 0.02])
def test_water_that_slides_along_a_round_wall_gains_nothing(spacing: float) -> None:
    """A ring that turns in a still drum: no force along the wall, and none that drives it; both grew, at any spacing.

    What the velocities of the particles beside the wall lose to the density diffusion and to its unevenness is of the second
    order in the spacing: 0.5 % of the energy a turn with 25 spacings a radius.
    """
    case = warpsph.load_case(SHIPPED, [f"particle_spacing={spacing}", "end_time=1", "output.particles=none", "reference={}"])
    simulation = warpsph.Simulation(case, threads=1)
    simulation.run()
    energy, turning = simulation.gauge("energy")["kinetic"], simulation.gauge("momentum")["angular_z"]
    share = (spacing / 0.02) ** 2
    assert -0.01 * share < energy[-1] / energy[0] - 1.0 < 1.0e-3
    assert abs(turning[-1] / turning[0] - 1.0) < 0.003 * share
    assert np.all(np.diff(energy[10:]) < 0.005 * energy[0])
