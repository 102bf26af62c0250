"""`scripts/random_streams.py`: its scenes are scenes, its bodies are where the case has them, and it judges."""

import numpy as np
import pytest

from tests.scripts import load_script
from warpsph.running.model import Model


@pytest.fixture(scope="module")
def streams():
    return load_script("random_streams")


@pytest.mark.parametrize("seed", [1, 4, 8, 10, 13, 19])
def test_the_bodies_are_where_the_case_has_them(streams, seed):
    """The first rows of boundary particles are half a spacing deep at a later time too."""
    case, motion, _ = streams.scene(seed, "isph", [])
    model, bodies = Model(case, threads=1), streams.Bodies(case, motion)
    assert model.physics.spec.bodies
    model.stepper.prepare(fresh=True)
    model.stepper.run(0.05 * case.end_time, 10**6)
    count = model.particles.fluid_count
    walls = model.particles.get("position")[count:].astype(float)
    inside = ((walls > 0) & (walls < np.array(case.domain.upper, dtype=float))).all(axis=1)
    depth = -bodies.distance(walls[inside], model.time) / case.spacing
    assert len(depth) > 10 and depth.min() == pytest.approx(0.5, abs=0.06)
    assert (motion is None) == ("motion" not in case.bodies["first"].model_dump(exclude_none=True))


def test_some_bodies_move_and_some_are_two(streams):
    cases = [streams.scene(seed, "riemann", []) for seed in range(24)]
    assert {motion is None for _, motion, _ in cases} == {True, False}
    assert any(motion and motion.turn for _, motion, _ in cases) and any(motion and motion.sway for _, motion, _ in cases)
    assert {len(case.bodies) for case, _, _ in cases} == {1, 2}
    assert {case.title.split(",")[0] for case, _, _ in cases} == {"ball", "box", "diamond", "step"}


def test_a_stream_is_judged(streams):
    """A run is sound; what misses each limit is missed."""
    row = streams.run((1, "isph", []))
    assert not streams.missed(row), row
    assert 0.7 < row["hole"] < streams.HOLE and row["fastest"] > 1.0
    for change in ({"diverged": 1.0}, {"hole": 1.2}, {"inside": row["particles"]}, {"volume": -0.04}):
        assert streams.missed(row | change)
