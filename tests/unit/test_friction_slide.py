"""Friction beside walls without friction (theory: riemann#slide): planes of symmetry, and curved ones in rigid rotation."""

import numpy as np
import pytest

import warpsph
from warpsph.running.model import Model

NU = 0.5
QUIET = {"particles": "none", "checkpoint": "none"}


def model(rows, device="cpu", **keys):
    base = {
        "title": "slip",
        "dimension": 2,
        "particle_spacing": 1 / rows,
        "end_time": 10,
        "scales": {"velocity": 1, "length": 1},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "output": QUIET,
    }
    made = Model(warpsph.load_case({**base, **keys}), device=device, threads=1)
    made.stepper.prepare(fresh=True)
    return made


def half_channel(scheme, rows):
    """Return the mean velocity, over the exact one, of a stream between a floor and a plane of symmetry, after 1 s.

    It starts with the exact u = (f/nu) (y - y^2/2), and forgets that at the rate nu pi^2/4 = 1.2/s. In the Riemann scheme
    the floor is a body, so that walls have a surface of their own.
    """
    body = scheme == "riemann"
    keys = {
        "domain": {
            "lower": [0, -0.5 if body else 0],
            "upper": [0.8, 1],
            "boundary": {"x": "periodic", "y": {"lower": "wall", "upper": "free_slip"}},
        },
        "phases": {"water": {"density": 1, "viscosity": NU, "gamma": 1}},
        "body_force": [1.0, 0],
        "start": {"velocity": [f"(y - y**2/2)/{NU}", 0]},
        "numerics": {"scheme": scheme},
    }
    if body:
        keys["bodies"] = {"floor": {"shape": {"box": {"lower": [-1, -1], "upper": [2, 0]}}}}
    made = model(rows, **keys)
    made.stepper.run(1.0, 10**9)
    fluid = made.snapshot().fluid
    return (fluid.velocity[:, 0] * fluid.volume).sum() / fluid.volume.sum() * 3 * NU


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus", "isph"])
def test_a_plane_of_symmetry_does_not_pull(scheme):
    # of second order: a parabola between 16 rows
    assert half_channel(scheme, 16) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus", "isph"])
def test_nothing_rubs_a_fluid_that_turns_rigidly_round_a_cylinder_without_friction(scheme, device):
    rows, nu, end = 20, 0.1, 0.05
    made = model(
        rows,
        device,
        domain={"lower": [-1.5, -1.5], "upper": [1.5, 1.5], "boundary": {"x": "wall", "y": "wall"}},
        phases={"water": {"density": 1, "viscosity": nu, "gamma": 1}},
        scales={"velocity": 2, "length": 1},
        bodies={"cylinder": {"shape": {"sphere": {"center": [0, 0], "radius": 0.5}}, "wall": "free_slip"}},
        start={"velocity": ["-y", "x"], "pressure": "0.5*(x**2 + y**2)"},
        numerics={"scheme": scheme},
    )
    made.stepper.run(end, 10**9)
    fluid = made.snapshot().fluid
    x, v = fluid.position[:, :2], fluid.velocity[:, :2]
    distance = np.hypot(x[:, 0], x[:, 1])
    turning = (v[:, 1] * x[:, 0] - v[:, 0] * x[:, 1]) / distance**2
    row = distance < 0.5 + 1 / rows
    assert row.sum() > 0.8 * 2 * np.pi * 0.5 * rows
    # A wall that saw the velocity of each particle itself would hold a slope of 0 there instead of 1/s: the layer of that,
    # sqrt(nu t) = 1.4 spacings thick, turns by sqrt(nu t)/R = 14 % more or less.
    assert turning[row].mean() == pytest.approx(1, abs=0.02)
