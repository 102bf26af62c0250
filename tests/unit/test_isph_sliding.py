"""Projection ISPH beside bodies that fluid slides along (theory: isph#bodies, isph#b6)."""

from pathlib import Path

import numpy as np
import pytest

import warpsph
from warpsph.case.case import Case
from warpsph.running.model import Model

RING = Path(__file__).resolve().parents[2] / "cases" / "turning_ring.yaml"
RATE = 2 * np.pi  # of the ring [1/s]


def ring(spacings: int, *changes: str) -> Model:
    """Return the ring at its start, in ISPH, without output."""
    given = [f"particle_spacing=0.5/{spacings}", "numerics.scheme=isph", "reference={}", "output.particles=none", *changes]
    model = Model(warpsph.load_case(RING, given), threads=1)
    model.stepper.prepare(fresh=True)
    return model


def tank(wall: str) -> Model:
    """Return water at rest on a lattice above a floor, a side of the domain or a body, no surface near by."""
    case = {
        "dimension": 2,
        "particle_spacing": 0.1,
        "end_time": 0.1,
        "domain": {"lower": [0, 0], "upper": [1.6, 2], "boundary": {"x": "periodic", "y": "free_slip"}},
        "phases": {"water": {"density": 1000}},
        "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1.6, 2]}}}],
        "numerics": {"scheme": "isph"},
        "output": {"particles": "none", "checkpoint": "none"},
    }
    if wall == "body":
        case["bodies"] = {"floor": {"shape": {"box": {"lower": [0, 0], "upper": [1.6, 0.6]}}, "wall": "free_slip"}}
        case["fluids"] = [{"phase": "water", "shape": {"box": {"lower": [0, 0.6], "upper": [1.6, 2]}}}]
    model = Model(Case.from_dict(case), threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(0.1, 1)
    return model


@pytest.mark.parametrize("wall", ["side", "body"])
def test_an_even_arrangement_stays_even_beside_a_wall(wall: str) -> None:
    """Particles of bodies count against pairs as fluid does: without them the first row is pressed on the wall."""
    model = tank(wall)
    crowding = model.particles.get("crowding")[: len(model.snapshot().fluid.position)]
    assert np.abs(crowding).max() < 1e-4 / 0.1  # a pair at one spacing has some 1/dx


def test_fluid_that_turns_as_a_whole_is_not_shifted() -> None:
    """Its particles keep their distances; away from the surface and the wall nothing has to be evened out."""
    model = ring(25, "fluids.0.shape.where.condition=x**2 + y**2 < 0.5**2")
    model.stepper.run(1.0, 3)
    fluid = model.snapshot().fluid
    count = len(fluid.position)
    shift, crowding = (np.linalg.norm(model.particles.get(name)[:count], axis=1) for name in ("shift", "crowding"))
    radius = np.linalg.norm(model.particles.get("position")[:count], axis=1)
    inner = radius < 0.4
    whole = (0.5 * (1.5 * 0.02) ** 2) * crowding  # the longest shift, which |grad u| asks for with these steps
    assert crowding[inner].max() > 0.01 / 0.02
    assert shift[inner].max() < 0.05 * whole[inner].max()
    assert shift[~inner].max() > 0.05 * whole[~inner].max()


def test_the_normal_beside_a_round_wall_is_that_at_the_particle() -> None:
    """Not that of the foot of one boundary particle, which is up to half a spacing away along the wall: 1/50 of 1 here."""
    model = ring(25)
    model.stepper.run(1.0, 1)
    count = len(model.snapshot().fluid.position)
    x, n = model.particles.get("position")[:count], model.particles.get("beside")[:count]
    radius = np.linalg.norm(x, axis=1)
    first = radius > 0.5 - 0.7 * 0.02
    assert first.sum() > 100
    along = np.abs(x[first, 0] * n[first, 1] - x[first, 1] * n[first, 0]) / radius[first]
    assert along.max() < 0.002


def test_the_speed_of_a_wall_is_that_along_the_normal_at_the_particle() -> None:
    """A cylinder that moves: with that of one boundary particle it would push its first row about by U dx/(2 R)."""
    case = {
        "dimension": 2,
        "particle_spacing": 1.0 / 16,
        "end_time": 1.0,
        "domain": {"lower": [-1.5, -1.5], "upper": [1.5, 1.5], "boundary": {"x": "periodic", "y": "periodic"}},
        "phases": {"water": {"density": 1.0, "viscosity": 0.005}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "bodies": {
            "cylinder": {"shape": {"sphere": {"center": [0, 0], "radius": 0.5}}, "motion": {"translation": ["t", 0]}},
        },
        "numerics": {"scheme": "isph"},
        "output": {"particles": "none", "checkpoint": "none"},
    }
    model = Model(Case.from_dict(case), threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(1.0, 3)
    count = model.geometry.fluid_count
    normal, pace = model.particles.get("beside")[:count], model.particles.get("wall_pace")[:count]
    near = (normal * normal).sum(axis=1) > 0.0
    assert near.sum() > 100
    np.testing.assert_allclose(pace[near], normal[near, 0], atol=1e-6)


@pytest.mark.parametrize("courant", [0.4, 0.1])
def test_the_row_at_a_round_wall_turns_with_the_rest(courant: float) -> None:
    """What stops at the wall keeps its turn: without it each stop took a share, 7 % of the row's speed in a turn.

    Short steps stop the row as often as long ones: with 50 spacings it went 24 % faster after two turns.
    """
    model = ring(25, f"numerics.courant={courant}")
    model.stepper.run(1.0, 10**6)
    fluid = model.snapshot().fluid
    x, u = fluid.position, fluid.velocity
    radius = np.hypot(x[:, 0], x[:, 1])
    rate = (x[:, 0] * u[:, 1] - x[:, 1] * u[:, 0]) / radius**2
    assert abs(rate[radius > 0.475].mean() / RATE - 1.0) < 0.03
    assert abs(rate.mean() / RATE - 1.0) < 0.01
    energy = (u**2).sum() / (RATE**2 * radius**2).sum()
    assert abs(energy - 1.0) < 0.02  # allowed by the case
