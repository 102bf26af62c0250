"""Volumes and places of the particles that stand beside a body."""

import math

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.scene.geometry import build

N = 24


def geometry(fluid, **bodies):
    case = {
        "dimension": 2,
        "particle_spacing": 1 / N,
        "end_time": 1,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "open"}},
        "phases": {"water": {"density": 1.0}},
        "fluids": [{"phase": "water", "shape": fluid}],
        "start": {"arrangement": "lattice"},
        "bodies": {name: {"shape": {"sphere": shape}} for name, shape in bodies.items()},
    }
    return build(Case.from_dict(case), 3 / N)


def test_the_particles_share_the_room_that_bodies_leave():
    made = geometry("rest", disc={"center": [0.45, 0.52], "radius": 0.21})
    fluid = made.kind == 0
    assert made.volume[fluid].sum() == pytest.approx(1.0 - math.pi * 0.21**2, rel=2e-4)
    gap = np.hypot(*(made.position[fluid] - [0.45, 0.52]).T) - 0.21
    assert gap.min() > 0.3 / N
    # away from the body they are those of the lattice
    far = gap > 2.0 / N
    np.testing.assert_allclose(made.volume[fluid][far], N**-2.0)
    np.testing.assert_allclose(made.position[fluid][far] * N % 1.0, 0.5, atol=1e-9)


def test_fluid_that_does_not_touch_a_body_knows_nothing_of_it():
    drop = {"sphere": {"center": [0.5, 0.8], "radius": 0.15}}
    made = geometry(drop, disc={"center": [0.5, 0.3], "radius": 0.2})
    fluid = made.kind == 0
    np.testing.assert_allclose(made.volume[fluid], N**-2.0)
    np.testing.assert_allclose(made.position[fluid] * N % 1.0, 0.5, atol=1e-9)
