"""The exact dispersion relation of scripts/dispersion.py against its limits, and that of the program beside it."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

PATH = Path(__file__).parents[2] / "scripts" / "dispersion.py"
loaded = importlib.util.spec_from_file_location("dispersion", PATH)
dispersion = importlib.util.module_from_spec(loaded)
loaded.loader.exec_module(dispersion)
K = 2 * np.pi


@pytest.mark.parametrize("ratio", [1.0, 10.0, 1000.0])
def test_without_friction_the_frequency_is_that_of_potential_flow(ratio):
    s = dispersion.exact_rate(K, (ratio, 1.0), (1e-9 * ratio, 1e-9), 1.0)
    assert s.imag == pytest.approx(np.sqrt(K**3 / (ratio + 1)), rel=1e-3)
    assert -1e-3 * s.imag < s.real < 0


def test_one_fluid_alone_is_damped_at_twice_nu_k_squared():
    """Lamb 1932, to first order in nu k^2/omega: the light fluid weighs and rubs next to nothing."""
    nu = 1e-5
    s = dispersion.exact_rate(K, (1.0, 1e-9), (nu, 1e-14), 1.0)
    assert s.real == pytest.approx(-2 * nu * K**2, rel=0.02)


def test_equal_fluids_are_damped_by_their_layers():
    """The conditions solved by hand for equal fluids: s^2 q/(q - k) = -w0^2."""
    nu = 0.01
    s = dispersion.exact_rate(K, (1.0, 1.0), (nu, nu), 1.0)
    q = np.sqrt(K * K + s / nu)
    assert s * s * q / (q - K) == pytest.approx(-(K**3) / 2, rel=1e-8)


def test_what_does_not_swing_is_refused():
    with pytest.raises(ValueError, match="does not swing"):
        dispersion.exact_rate(K, (1.0, 1.0), (50.0, 50.0), 1.0)


# With little friction waves of equal fluids grew, by 9 % in a period, while velocities of both sides were carried.
GROWTH = [(1.0, 0.1265, 0.05), (1.0, 0.0126, 0.05), (10.0, 0.0126, 0.05), (1000.0, 0.0126, 0.02)]


@pytest.mark.parametrize(("ratio", "viscosity", "step"), GROWTH)
def test_no_wave_of_a_flat_interface_grows(ratio, viscosity, step):
    """Of all modes of all lengths none gains 1 % in a period of the wave; 24 % before curvatures were the same across."""
    linear = dispersion.LinearStep(ratio, viscosity, columns=40, rows=24, step=step)
    for waves in range(1, 20):
        k = 2 * np.pi * waves / 40
        period = 2 * np.pi / np.sqrt(k**3 / (1 + ratio))
        assert linear.rates(waves).real.max() * period < 0.01


def test_the_frequency_is_that_of_the_exact_wave():
    """Lengths 20, 13, 10: what fraction, normal and divergence smooth, 0.2 (kh)^2 of the frequency, is back."""
    linear = dispersion.LinearStep(1.0, 0.01265, columns=40, rows=40)
    errors = []
    for waves in (2, 3, 4):
        k = 2 * np.pi * waves / 40
        exact = dispersion.exact_rate(k, (1.0, 1.0), (0.01265, 0.01265), 1.0)
        rates = linear.rates(waves)
        errors.append(abs(rates[np.argmin(abs(rates - exact))].imag / exact.imag - 1) / (1.5 * k) ** 2)
    assert max(errors) < 0.2


def test_with_gravity_the_frequency_is_that_of_internal_waves():
    g, density = 9.81, (1.2, 1.0)
    s = dispersion.exact_rate(K, density, (1.2e-9, 1e-9), dispersion.stiffness(K, density, 0.0, g))
    assert s.imag == pytest.approx(np.sqrt(g * K * 0.2 / 2.2), rel=1e-3)


@pytest.mark.parametrize(("ratio", "pull", "step"), [(1.0, {}, 0.05), (3.0, {"tension": 1e-6, "gravity": 0.05}, 0.02)])
def test_inside_the_fluids_the_sweeps_have_the_exact_wave(ratio, pull, step):
    """Three spacings and more off the interface gradients err by less than (kh)^2/12, with weight and without.

    A particle has the pressure of the exact wave at its new place, less what it has at rest.
    """
    linear = dispersion.LinearStep(ratio, 0.003, columns=32, rows=24, step=step, **pull)
    fields = linear.fields(1)
    height, along, across, divergence = fields[(abs(fields[:, 0]) > 3) & (abs(fields[:, 0]) < 8)].T
    error = (1.5 * 2 * np.pi / 32) ** 2 / 12
    assert len(height) == 10
    for values, exact in ((along, 1), (across, 1), (divergence, 0)):
        np.testing.assert_allclose(values, exact, atol=error)
