"""Bodies in the Riemann scheme: forces, torques and flows against exact ones."""

import math

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.running.model import Model

WATER = {"w": {"density": 1.0, "viscosity": 1.0}}
ARRAY_FORCE = 24.83
"""F/(mu U) of a square array of cylinders that take a tenth of it (Sangani & Acrivos 1982)."""


def made(**sections):
    """Return the model of a 2-D case of one fluid that fills what is left of the domain, ready to run."""
    base = {"dimension": 2, "end_time": 10, "phases": WATER, "fluids": [{"phase": "w", "shape": "rest"}]}
    model = Model(Case.from_dict({**base, **sections}), threads=1)
    model.stepper.prepare(True)
    return model


def circle(center, radius, **keys):
    return {"shape": {"sphere": {"center": list(center), "radius": radius}}, **keys}


def array_error(n, noise=0.0):
    """Return the relative error of the drag of the array with n spacings a box, and the force on the body over the drive."""
    drag = 0.01 * ARRAY_FORCE
    model = made(
        particle_spacing=1.0 / n,
        domain={"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
        body_force=[drag, 0],
        bodies={"c": circle([0.5, 0.5], math.sqrt(0.1 / math.pi))},
        start={"noise": noise},
    )
    model.stepper.run(0.5, 10**6)
    volume = model.geometry.volume[: model.geometry.fluid_count]
    mean = float(np.array(model.snapshot().fluid.velocity)[:, 0].astype(float) @ volume)
    return drag / mean / ARRAY_FORCE - 1.0, model.wall_forces()["wall_force_x c"] / (drag * volume.sum())


def test_drag_of_an_array_of_cylinders_converges_with_second_order():
    coarse, _ = array_error(16)
    fine, push = array_error(32)
    assert abs(fine) < 0.02
    assert abs(fine) < 0.25 * abs(coarse)
    # the push on the body is that on the fluid: 6.7 % more of it at 16, 2.7 at 24, 0.1 at 32, 1.0 less at 48
    # (4.4 at 32 where the velocity across the surface does not follow from that along it)
    assert push == pytest.approx(1.0, abs=0.02)


def test_drag_does_not_depend_on_the_arrangement():
    assert array_error(24, noise=0.25)[0] == pytest.approx(array_error(24)[0], abs=0.01)


def test_fluid_at_rest_carries_a_body_with_its_weight():
    model = made(
        particle_spacing=0.025,
        domain={"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        gravity=[0.0, -9.81],
        phases={"w": {"density": 1000.0, "viscosity": 20.0}},
        bodies={"c": circle([0.52, 0.43], 0.15)},
        start={"pressure": "hydrostatic"},
    )
    model.stepper.run(0.4, 10**6)
    force = model.wall_forces()
    weight = 9810.0 * math.pi * 0.15**2
    assert force["wall_force_y c"] == pytest.approx(weight, rel=0.01)
    assert abs(force["wall_force_x c"]) < 0.01 * weight
    assert np.abs(model.snapshot().fluid.velocity).max() < 2e-3


class Annulus:
    """Fluid between two cylinders at rest, and the exact flow if the inner one turns at a rate of 1/10."""

    inner, outer, rate, viscosity = 0.5, 1.0, 0.1, 0.5

    def __init__(self, gap):
        size = self.outer + 0.1
        self.model = made(
            particle_spacing=(self.outer - self.inner) / gap,
            domain={"lower": [-size, -size], "upper": [size, size], "boundary": {"x": "open", "y": "open"}},
            phases={"w": {"density": 1.0, "viscosity": self.viscosity}},
            bodies={
                "in": {**circle([0, 0], self.inner), "motion": {"rotation": f"{self.rate}*t"}},
                "out": circle([0, 0], self.outer, hollow=True),
            },
            scales={"velocity": 2.0 * self.rate * self.inner},
        )
        square_in, square_out = self.inner**2, self.outer**2
        self.vortex = self.rate * square_in * square_out / (square_out - square_in)
        self.torque = 4.0 * math.pi * self.viscosity * self.vortex

    def speed(self, r):
        return self.vortex / r - self.vortex / self.outer**2 * r


def test_flow_between_cylinders_and_the_torque_on_both():
    scene = Annulus(10)
    scene.model.stepper.run(1.0, 10**6)
    fluid = scene.model.snapshot().fluid
    x, v = np.array(fluid.position, float), np.array(fluid.velocity, float)
    r = np.hypot(*x.T)
    around = (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]) / r
    assert np.abs(around - scene.speed(r)).max() < 0.01 * scene.rate * scene.inner
    force = scene.model.wall_forces()
    # of second order: with v.n along the surface in the stress, which is known to be 0, the first is 1.5 % too small
    assert force["wall_torque_z in"] == pytest.approx(-scene.torque, rel=0.01)
    assert force["wall_torque_z out"] == pytest.approx(scene.torque, rel=0.01)


def test_two_fluids_stay_at_rest_around_a_body():
    model = made(
        particle_spacing=0.0625,
        domain={"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        gravity=[0.0, -9.81],
        phases={"gas": {"density": 1.0, "viscosity": 0.1}, "water": {"density": 1000.0, "viscosity": 1.0}},
        fluids=[
            {"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}},
            {"phase": "gas", "shape": "rest"},
        ],
        bodies={"c": circle([0.5, 0.5], 0.2)},
        start={"pressure": "hydrostatic"},
    )
    model.stepper.run(0.15, 10**6)
    # a fit that is blind for the fluids makes 1.4 m/s of it
    assert np.abs(model.snapshot().fluid.velocity).max() < 0.2
    half = 9810.0 * math.pi * 0.2**2 / 2
    assert model.wall_forces()["wall_force_y c"] == pytest.approx(half, rel=0.03)
