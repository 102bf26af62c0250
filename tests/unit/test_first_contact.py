"""Bodies that start in the air: sound speeds know what they do while fluid may be at them (theory: riemann#a1)."""

import itertools
import math

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.scene.first_contact import FINEST, Spread, first_contact
from warpsph.scene.forcing import forcing_of
from warpsph.scene.geometry import build
from warpsph.scene.physics import derive, support_radius

SPEED, PAUSE = 2.0, 0.004
JERK = f"-{SPEED}*(t - {PAUSE}*(1 - exp(-t/{PAUSE})))"  # starts at 500 m/s^2
DEPTH, WIDTH, SPACING = 0.2, 0.4, 0.01


def plunging(height, motion=JERK, **more):
    """A block `height` m above a pool, driven down."""
    boundary = {"x": "wall", "y": {"lower": "wall", "upper": "open"}}
    case = {
        "dimension": 2,
        "particle_spacing": SPACING,
        "end_time": 0.1,
        "domain": {"lower": [-WIDTH / 2, -DEPTH], "upper": [WIDTH / 2, 0.5], "boundary": boundary},
        "gravity": [0, -9.81],
        "phases": {"water": {"density": 1000}},
        "fluids": [{"phase": "water", "shape": {"box": {"lower": [-WIDTH / 2, -DEPTH], "upper": [WIDTH / 2, 0.0]}}}],
        "bodies": {
            "block": {
                "shape": {"box": {"lower": [-0.05, height], "upper": [0.05, height + 0.1]}},
                "motion": {"translation": [0, motion]},
            }
        },
    }
    return Case.from_dict({**case, **more})


def pressure_seen(case):
    return derive(case, build(case, support_radius(case))).scales["pressure"]


def contact(case, spread, height):
    """First contact of the block, its box as it is."""
    (track,) = forcing_of(case).tracks
    corners = np.array(list(itertools.product((-0.05, 0.05), (height, height + 0.1))))
    return first_contact(track, corners, spread, track.largest(case.end_time, 1, 0.2), case.end_time)


def pool(first=0.0, fastest=0.0, pull=0.0):
    return Spread(np.array([-WIDTH / 2, -DEPTH]), np.array([WIDTH / 2, 0.0]), first, fastest, pull)


def test_time_of_contact():
    """It is not later than the contact itself, and as near to it as it is looked for."""
    case = plunging(0.1, motion="-10*t**2")  # 0.1 s down to the water, to within what end_time leaves
    found = contact(case, pool(), 0.1)
    assert 0.1 - 0.02 < found <= 0.1
    case = plunging(0.05, motion="-10*t**2")
    exact = math.sqrt(0.05 / 10)
    speed = 2 * 10 * case.end_time
    assert exact - 10 * FINEST * case.end_time * speed / (2 * 10 * exact) < contact(case, pool(), 0.05) <= exact


def test_fluid_comes_to_meet_a_body():
    case = plunging(0.05, motion="-10*t**2")
    alone = contact(case, pool(), 0.05)
    rising = contact(case, pool(first=1.0, fastest=1.0), 0.05)
    assert rising == pytest.approx((-1 + math.sqrt(1 + 4 * 10 * 0.05)) / 20, abs=1e-3)
    # what falls starts at rest: 10 t^2 + 10 t^2 = 0.05
    falling = contact(case, pool(fastest=3.0, pull=10.0), 0.05)
    assert falling == pytest.approx(math.sqrt(0.05 / 20), abs=1e-3)
    assert rising < falling < alone


def test_a_body_in_the_fluid_and_one_that_never_comes_to_it():
    assert contact(plunging(-0.02), pool(), -0.02) == 0.0
    case = plunging(0.3)
    assert contact(case, pool(), 0.3) == case.end_time
    case = plunging(0.3, motion="0*t", gravity=[0, 0])  # nothing moves
    assert contact(case, pool(), 0.3) == case.end_time
    assert pressure_seen(case) == 0.0


def test_a_jerk_in_the_air_makes_no_pressure():
    weight = 1000 * 9.81 * DEPTH
    assert pressure_seen(plunging(-0.02)) > 1000 * 0.9 * SPEED / PAUSE * DEPTH  # in the water it does
    assert pressure_seen(plunging(0.5 * SPACING)) > 1000 * 0.9 * SPEED / PAUSE * DEPTH
    assert pressure_seen(plunging(0.15)) == pytest.approx(weight, rel=0.1)


def test_fluid_that_others_push_has_its_speed_at_once():
    """A second body may throw water at the first."""
    case = plunging(0.06)
    bodies = {**case.to_dict()["bodies"]}
    way = {"translation": ["0.01*t**2", 0]}
    bodies["other"] = {"shape": {"box": {"lower": [0.1, -0.1], "upper": [0.15, -0.05]}}, "motion": way}
    both = plunging(0.06, bodies=bodies)
    assert pressure_seen(both) > 2 * pressure_seen(case)


def test_fluids_that_fill_the_domain_are_at_bodies_all_the_time():
    fluids = [{"phase": "water", "shape": "rest"}]
    domain = {"lower": [-0.2, -0.2], "upper": [0.2, 0.5], "boundary": {"x": "wall", "y": "wall"}}
    filled = plunging(0.15, fluids=fluids, domain=domain)
    assert pressure_seen(filled) > 1000 * 0.9 * SPEED / PAUSE * 0.4
