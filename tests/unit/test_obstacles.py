"""`scripts/obstacles.py`: its scenes are scenes, water that got under them or burst does not any more, and it judges."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from warpsph.kernels.isph.projection import CLOSEST
from warpsph.running.model import Model

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "obstacles.py"


@pytest.fixture(scope="module")
def obstacles():
    spec = importlib.util.spec_from_file_location("obstacles", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("seed", "scheme"),
    [(37, "delta_plus"), (37, "riemann"), (20, "riemann"), (38, "isph"), (8, "riemann"), (11, "delta_plus")],
)
def test_scenes_that_were_lost_hold(obstacles, seed, scheme):
    """A slope that water ran under, hills, boxes on each other: all diverged or let more than 1 % of the water in."""
    row = obstacles.run((seed, scheme, 2))
    assert row["diverged"] is None
    assert row["inside"] + row["below"] <= obstacles.LET_IN * row["particles"]
    assert not obstacles.missed(row)


@pytest.mark.parametrize("seed", [4, 55])
def test_hollow_edges_between_bodies_hold(obstacles, seed):
    """In the edge between the top of one box and the face of the next water went into the lower one; 55 burst there."""
    row = obstacles.run((seed, "isph", 3))
    assert row["obstacle"] == "pair" and row["diverged"] is None
    assert row["inside"] == row["below"] == 0
    assert row["gained"] < 0.01


def test_shifts_go_no_farther_than_where_a_particle_stops(obstacles):
    """What a shift carries changes on the way that it goes: to 0.4 spacings from each plane of a hollow edge."""
    case = obstacles.scene(55, "isph", 3)
    model = Model(case, device="cpu", threads=1)
    model.stepper.prepare(fresh=True)
    count, least, seen = model.particles.fluid_count, 0.0, 0
    for step in range(1, 41):
        model.stepper.run((0.3 + 5e-3 * step) * case.end_time, 10**9)
        shift, normal, gap = (model.particles.get(name)[:count] for name in ("shift", "beside_2", "wall_gap_2"))
        there = (normal**2).sum(axis=1) > 0
        seen += int(there.sum())
        left = gap[there] + (shift * normal).sum(axis=1)[there] - np.minimum(gap[there], CLOSEST * case.spacing)
        least = min(least, float(left.min(initial=0.0)) / case.spacing)
    assert seen > 20 and least > -1e-5


def test_scenes_in_space(obstacles):
    titles = {obstacles.scene(seed, "isph", 3).title.split(",")[0] for seed in range(1, 41)}
    assert titles == set(obstacles.KINDS_IN_SPACE)
    assert obstacles.scene(3, "isph", 3).dimension == 3


def test_every_kind_is_drawn_and_seeds_are_scenes(obstacles):
    titles = {obstacles.scene(seed, "isph").title.split(",")[0] for seed in range(1, 41)}
    assert titles == set(obstacles.KINDS)
    assert obstacles.scene(3, "isph").to_dict() == obstacles.scene(3, "isph").to_dict()


def test_depths_are_those_of_the_deepest_obstacle(obstacles):
    case = next(case for seed in range(1, 41) if (case := obstacles.scene(seed, "isph")).title.startswith("step"))
    lower, upper = case.bodies["body_0"].shape.box.lower, case.bodies["body_0"].shape.box.upper
    height = upper[1]
    points = np.array([[0.5 * (lower[0] + upper[0]), 0.9 * height], [0.5 * lower[0], 0.5 * height]])
    assert obstacles.Depths(case).deepest(points) == pytest.approx([0.1 * height, -0.5 * lower[0]])


def test_what_is_missed(obstacles):
    row = {"diverged": None, "inside": 3, "below": 2, "particles": 500}
    assert not obstacles.missed(row)
    assert obstacles.missed(row | {"below": 3})
    assert obstacles.missed(row | {"diverged": 0.1})
