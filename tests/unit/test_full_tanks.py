"""`scripts/full_tanks.py`: tanks that tore do not any more, its scenes are scenes, and it judges."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from warpsph.running.model import Model

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "full_tanks.py"


@pytest.fixture(scope="module")
def tanks():
    spec = importlib.util.spec_from_file_location("full_tanks", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("seed", "scheme", "before"),
    [(3, "delta_plus", "numerics.tension_control=false"), (30, "isph", "numerics.courant=0.4"), (3, "riemann", None)],
)
def test_tanks_that_tore_hold(tanks, seed, scheme, before):
    """Behind the corners of a box; with what it was before a hole of more than two particles opens."""
    row = tanks.run((seed, scheme, []))
    assert not tanks.missed(row), row
    assert row["diverged"] is None and row["hole"] < tanks.HOLE and row["inside"] == 0
    if before is not None:
        row = tanks.run((seed, scheme, [before]))
        assert row["hole"] > 1.5 and tanks.missed(row)


def test_steps_are_half_as_long_where_bodies_move(tanks):
    case, _, _ = tanks.scene(30, "isph", [])
    assert Model(case, threads=1).physics.choices["courant"] == 0.2
    still = case.replace({"bodies.body.motion": None})
    assert Model(still, threads=1).physics.choices["courant"] == 0.4


@pytest.mark.parametrize("seed", range(12))
def test_the_body_is_where_its_case_has_it(tanks, seed):
    """Boundary particles of the case, wherever the motion has taken them, are at most one support within the body."""
    case, places, speed = tanks.scene(seed, "riemann", [])
    model, body = Model(case, threads=1), tanks.Body(case, places)
    model.stepper.prepare(fresh=True)
    model.stepper.run(0.1 * case.end_time, 10**6)
    count, dx = model.particles.fluid_count, case.spacing
    walls = model.particles.get("position")[count:, : case.dimension].astype(float)
    size = np.array(case.domain.upper, dtype=float)
    own = walls[((walls > 0.5 * dx) & (walls < size - 0.5 * dx)).all(axis=1)]
    depth = -body.distance(own, model.time) / dx
    assert len(own) > 10 and depth.min() > -0.05
    assert depth.max() < 4.0
    assert body.distance(model.particles.get("position")[:count, : case.dimension], model.time).min() > -0.5 * dx
    first, later = (np.array([places[key](t) for key in ("x", "y")]) for t in (0.0, 1e-3 * case.end_time))
    assert np.abs(first).max() == 0.0
    assert np.linalg.norm(later) < 2.0 * speed * 1e-3 * case.end_time + 1e-12


def test_what_is_missed(tanks):
    row = {"diverged": None, "hole": 1.0, "inside": 0, "particles": 100}
    assert not tanks.missed(row)
    for wrong in ({"diverged": 0.1}, {"hole": 1.2}, {"inside": 2}):
        assert tanks.missed({**row, **wrong})
    assert math.isclose(tanks.HOLE, math.hypot(0.5, 1.0), abs_tol=2e-3)
