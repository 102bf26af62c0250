"""Warnings of what a case can be run with and can hardly mean; none where it may be meant."""

import copy

import pytest

from tests.scenes import case_of
from warpsph import Simulation
from warpsph.running.preview import describe, estimate

# Water in the lower half of a tank that is open at the top, and a ball in it.
TANK = {
    "dimension": 2,
    "particle_spacing": 0.05,
    "end_time": 0.1,
    "domain": {"lower": [0, 0], "upper": [1, 0.8], "boundary": {"x": "free_slip", "y": {"lower": "wall", "upper": "open"}}},
    "gravity": [0, -9.81],
    "phases": {"water": {"density": 1000}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}}],
    "output": {"particles": "none", "checkpoint": "none"},
}
BALL = {"sphere": {"center": [0.5, 0.25], "radius": 0.12}}


def told(**changes):
    return estimate(case_of(copy.deepcopy(TANK), **changes))["warnings"]


def gauge(**keys):
    return {"gauges": {"q": {"interval": 0.05, **keys} if "times" not in keys else keys}}


def ball(*way, shape=BALL):
    return {"bodies": {"ball": {"shape": shape, "motion": {"translation": list(way)}}}}


POINTS = {"type": "points", "fields": ["pressure"]}
LINE = {"type": "line", "count": 5, "fields": ["velocity"]}
DOUBTFUL = {
    "place of an elevation": (gauge(type="elevation", places=[[0.5], [5]]), "gauges.q.places.1: [5] is outside"),
    "point": (gauge(**POINTS, points=[[0.5, -0.2]]), "points.0: [0.5, -0.2] is outside of the domain, y from 0 to 0.8"),
    "line": (gauge(**LINE, **{"from": [-1, 0], "to": [1, 0]}), "gauges.q.from: [-1, 0] is outside"),
    "time": (gauge(type="energy", times=[0.05, 3]), "q.times: nothing is measured or written at 3 s, after end_time 0.1"),
    "frame": ({"output__particles": {"times": [0.05, 3]}}, "output.particles.times: nothing"),
    "window": (
        {"output": {"particles": {"interval": 0.05}, "lyapunov": {"window": 5.0}}}, "output.lyapunov.window: 5 s are longer"
    ),
    "body into a wall": (ball("20*t", 0), "bodies.ball.motion: takes the body through the wall at x = 1 m"),
    "body into the floor": (ball(0, "-10*t"), "through the wall at y = 0 m"),
}  # fmt: skip
FINE = {
    "places at walls": gauge(type="elevation", places=[[0], [1]]),
    "beyond an open side": gauge(**POINTS, points=[[0.5, 0.9]]),
    "across a periodic side": {
        **gauge(**POINTS, points=[[1.2, 0.2]]),
        "domain__boundary": {"x": "periodic", "y": {"lower": "wall", "upper": "open"}},
    },
    "time at the end": gauge(type="energy", times=[0, 0.1]),
    "times of a longer run of the file": {
        **gauge(type="energy", times=[0.05, 3]),
        "validation": {"seed": [{"name": "long", "changes": {"end_time": "6/2"}}]},
    },
    "a whole window": {"output": {"particles": {"interval": 0.05}, "lyapunov": {"window": 0.1}}},
    "up and out": ball(0, "20*t"),
    "to and fro": ball("0.05*sin(60*t)", 0),
    # a gate over the water's whole depth, lifted out through a roof that it is clear of
    "a gate through a roof": {
        **ball(0, "10*t", shape={"box": {"lower": [0.4, -0.2], "upper": [0.6, 0.6]}}),
        "domain__boundary": {"x": "wall", "y": "wall"},
    },
    # a piston that begins in the wall
    "a piston": ball("0.02*sin(60*t)", 0, shape={"box": {"lower": [-0.4, -0.2], "upper": [0.1, 1]}}),
}


@pytest.mark.parametrize("name", DOUBTFUL)
def test_what_is_hardly_meant_is_told(name):
    changes, text = DOUBTFUL[name]
    found = [line for line in told(**changes) if text in line]
    assert len(found) == 1, told(**changes)


@pytest.mark.parametrize("name", FINE)
def test_what_may_be_meant_is_not(name):
    assert not [line for line in told(**FINE[name]) if line.startswith(("gauges", "output", "bodies"))]


def test_check_show_and_run_tell_it():
    case = case_of(copy.deepcopy(TANK), **DOUBTFUL["time"][0])
    for found in (estimate(case)["warnings"], describe(case)["warnings"], Simulation(case, threads=1).warnings):
        assert any("gauges.q.times" in line for line in found)
