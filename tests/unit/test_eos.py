"""Equation of state: level, sound speed, and accuracy in single precision (theory: riemann#a1)."""

import numpy as np
import pytest

from tests.helpers import Bench, Fluid, evaluate
from warpsph.kernels.core.eos import make_eos
from warpsph.kernels.core.spec import Spec
from warpsph.schemes import riemann_program as riemann

GAMMAS = [1.0, 1.4, 4.0, 7.0]


def pressure(s, gamma, precision="float64", stiffness=1.0):
    s = np.atleast_1d(np.asarray(s, dtype=float))
    return evaluate(make_eos(precision), precision, s, np.full_like(s, stiffness), np.full_like(s, gamma))


def exact(s, gamma):
    return np.expm1(gamma * np.log1p(s))


@pytest.mark.parametrize("gamma", GAMMAS)
def test_no_pressure_at_the_reference_density(gamma):
    assert pressure([0.0], gamma)[0] == 0.0
    assert pressure([0.0], gamma, "float32")[0] == 0.0


@pytest.mark.parametrize("gamma", GAMMAS)
def test_slope_is_the_square_of_the_sound_speed(gamma):
    rho0, c = 800.0, 12.0
    s = 1e-5
    low, high = pressure([-s, s], gamma, stiffness=rho0 * c * c / gamma)
    assert (high - low) / (2 * s * rho0) == pytest.approx(c * c, rel=1e-8)


@pytest.mark.parametrize("gamma", GAMMAS)
def test_double_precision_matches_the_power_law(gamma):
    s = np.concatenate([np.geomspace(1e-12, 0.5, 400), [0.0999999, 0.1, 0.1000001, 1.0]])
    s = np.concatenate([s, -s[s < 0.95]])
    # the series is cut after seven terms: the eighth binomial coefficient, at |s| = 0.1
    assert np.max(np.abs(pressure(s, gamma) / exact(s, gamma) - 1)) < 2e-8


@pytest.mark.parametrize("gamma", GAMMAS)
def test_single_precision_keeps_small_pressures(gamma):
    s = np.geomspace(1e-7, 0.5, 400).astype(np.float32).astype(float)
    s = np.concatenate([s, -s])
    error = np.abs(pressure(s, np.float32(gamma), "float32") / exact(s, float(np.float32(gamma))) - 1)
    assert error[np.abs(s) < 0.09].max() < 1e-6  # (1+s)^gamma - 1 alone would lose every digit of s = 1e-7
    assert error.max() < 5e-6


@pytest.mark.parametrize("gamma", GAMMAS)
def test_pressure_grows_with_density(gamma):
    s = np.linspace(-0.8, 0.8, 3001)
    assert (np.diff(pressure(s, gamma)) > 0).all()
    assert np.isfinite(pressure([-1.0, -1.5], gamma)).all()


def test_state_adds_background_and_volume(device):
    """Each phase has its own background pressure; the volume follows from the density."""
    s = np.array([0.0, 0.0, 0.01, -0.02])
    fluids = (
        Fluid(density=1.0, gamma=1.4, background=5.0),
        Fluid(density=1000.0, gamma=7.0, background=-3.0),
    )
    spec = Spec(dimension=2, precision="float64", multiphase=True)
    bench = Bench(
        spec,
        np.eye(4, 2) * 9,
        spacing=1.0,
        phase=[0, 1, 0, 1],
        fluids=fluids,
        excess=s,
        volume=2.0,
        device=device,
    )
    bench.run(riemann.state(spec))
    state = bench.get("state")
    background = np.array([5.0, -3.0, 5.0, -3.0])
    stiffness = np.array([f.density * f.sound_speed**2 / f.gamma for f in fluids])[[0, 1, 0, 1]]
    np.testing.assert_array_equal(state[:2, 0], [5.0, -3.0])
    gamma = np.array([1.4, 7.0, 1.4, 7.0])
    np.testing.assert_allclose(state[:, 0] - background, stiffness * exact(s, gamma), rtol=1e-9)
    np.testing.assert_allclose(state[:, 1], bench.get("rest_volume") / (1 + s), rtol=1e-14)
    np.testing.assert_allclose(state[:, 1], 2.0, rtol=1e-14)
