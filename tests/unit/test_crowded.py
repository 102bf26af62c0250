"""Fluid pressed together without its densities knowing it: pressure differences are evened no faster than in a lattice."""

import numpy as np
import pytest
import warp as wp

from warpsph.case.case import Case
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.smoothing import KERNELS, lattice_slope, make_smoothing
from warpsph.running.model import Model

NOISE = 0.01  # m/s


def square(dimension, share):
    """A square or cube of 12 particles across in the open, all distances `share` of those at rest, with a little noise."""
    axes = "xyz"[:dimension]
    case = Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": 0.05,
            "end_time": 1e9,
            "domain": {"lower": [-1] * dimension, "upper": [1] * dimension, "boundary": dict.fromkeys(axes, "open")},
            "phases": {"water": {"density": 1000, "sound_speed": 20}},
            "fluids": [{"phase": "water", "shape": {"box": {"lower": [-0.3] * dimension, "upper": [0.3] * dimension}}}],
            "numerics": {"unlock": 0},
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )
    model = Model(case, threads=1)
    particles = model.particles
    for name in ("anchor", "position"):
        particles.put(name, particles.get(name) * share)
    velocity = particles.get("velocity")
    particles.put("velocity", velocity + np.random.default_rng(1).normal(0, NOISE, velocity.shape))
    return model


def after(model, steps):
    """Largest density excess and speed, or infinity twice if the run has diverged."""
    model.stepper.rebuild(moving=False)
    model.stepper.prepare(fresh=True)
    model.stepper.run(1e9, steps)
    if model.stepper.read()[1][ck.FAULT]:
        return np.inf, np.inf
    speed = np.linalg.norm(model.particles.get("velocity"), axis=1).max()
    return float(np.abs(model.particles.get("density_excess")).max()), float(speed)


@pytest.mark.parametrize(("dimension", "share", "grown"), [(2, 0.7, 50), (3, 0.9, 400), (3, 0.8, 400)])
def test_noise_of_crowded_fluid_dies(dimension, share, grown):
    """Two particles in the place of one, in 3-D 1.4 and 2: without it 1 cm/s becomes 1 m/s in so many steps, or it diverges.

    Later the friction of disorder may have taken what was left of it.
    """
    excess, speed = after(square(dimension, share), 400)
    assert excess < 1e-3
    assert speed < 5 * NOISE
    model = square(dimension, share)
    model.stepper.bindings["params"].even_slope = 1e9
    excess, speed = after(model, grown)
    assert excess > 0.01 or speed > 50 * NOISE


@pytest.mark.parametrize("kernel", KERNELS)
def test_slope_of_a_fine_lattice_is_the_integral(kernel):
    """In 1-D the integral of |W'| is 2 W(0)."""
    peak = KERNELS[kernel].alpha[0] * float(make_smoothing(kernel, "float64")[0](wp.float64(0.0)))
    assert lattice_slope(kernel, 50.0, 1) == pytest.approx(2.0 * peak, rel=2e-3)


def test_slope_of_the_lattice_in_two_and_three_dimensions():
    """Wendland C2: 7/3 and 3 over h."""
    assert lattice_slope("wendland_c2", 10.0, 2) == pytest.approx(7 / 3, rel=5e-3)
    assert lattice_slope("wendland_c2", 6.0, 3) == pytest.approx(3.0, rel=5e-3)
