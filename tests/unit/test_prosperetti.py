"""scripts/prosperetti.py against limits known otherwise, and against its own normal modes."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"


def script(name):
    loaded = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(loaded)
    loaded.loader.exec_module(module)
    return module


amplitude = script("prosperetti").amplitude
K = 2 * np.pi


@pytest.mark.parametrize("density", [(1.0, 1.0), (1000.0, 1.0), (3.0, 1.0)])
def test_without_friction_it_swings_as_potential_flow_does(density):
    omega = np.sqrt(K**3 / sum(density))
    t = np.linspace(0, 20 / omega, 200)
    np.testing.assert_allclose(amplitude(t, density, 1e-12, 1.0, 1.0), np.cos(omega * t), atol=1e-3)


def test_it_starts_at_rest_from_one():
    for density in ((1.0, 1.0), (1000.0, 1.0)):
        t = np.array([0.0, 1e-6, 2e-6])
        a = amplitude(t, density, 0.01, 1.0, 1.0)
        assert a[0] == pytest.approx(1.0, abs=1e-12)
        assert abs((a[1] - a[0]) / 1e-6) < 1e-3 * np.sqrt(K**3 / sum(density))


def test_one_fluid_alone_is_damped_at_twice_nu_k_squared():
    """Lamb 1932: to first order in nu k^2/omega."""
    nu, omega = 1e-4, np.sqrt(K**3 / (1 + 1e-9))
    t = np.linspace(0, 40 / omega, 4000)
    a = amplitude(t, (1.0, 1e-9), nu, 1.0, 1.0)
    inner = a[1:-1]
    peaks = np.flatnonzero((inner > a[:-2]) & (inner > a[2:])) + 1
    rate = -np.polyfit(t[peaks], np.log(a[peaks]), 1)[0]
    assert rate == pytest.approx(2 * nu * K**2, rel=0.03)


@pytest.mark.parametrize("density", [(1.0, 1.0), (10.0, 1.0)])
def test_late_it_is_the_normal_mode(density):
    """The dispersion relation of scripts/dispersion.py, found from four boundary conditions instead."""
    nu = 0.01826
    s = script("dispersion").exact_rate(K, density, tuple(nu * rho for rho in density), 1.0)
    t = np.linspace(1.0, 1.3, 31) * 2 * np.pi / s.imag
    a = amplitude(t, density, nu, 1.0, 1.0)
    modes = np.column_stack([np.exp(s.real * t) * np.cos(s.imag * t), np.exp(s.real * t) * np.sin(s.imag * t)])
    fitted = modes @ np.linalg.lstsq(modes, a, rcond=None)[0]
    assert np.abs(a - fitted).max() < 0.01 * np.abs(a).max()


@pytest.mark.parametrize("reynolds", [25.0, 250.0])
def test_a_gravity_wave_is_late_its_normal_mode(reynolds):
    """Lamb 1932, art. 349: (s + 2n)^2 + omega^2 = 4 n^(3/2) sqrt(s + n), n = nu k^2."""
    depth, gravity, k = 1.0, 9.81, np.pi
    nu = depth * np.sqrt(gravity * depth) / reynolds
    n, omega = nu * k * k, np.sqrt(gravity * k * np.tanh(k * depth))
    mode = -2 * n + 1j * omega
    for _ in range(200):
        mode = -2 * n + 1j * np.sqrt(omega**2 - 4 * n**1.5 * np.sqrt(mode + n))
    t = np.linspace(8 / omega, 14 / omega, 400)
    fitted = np.column_stack([np.exp(mode * t).real, np.exp(mode * t).imag])
    a = script("prosperetti").gravity_wave(t, nu, 2.0, depth, gravity)
    rest = a - fitted @ np.linalg.lstsq(fitted, a, rcond=None)[0]
    assert np.abs(rest).max() < 0.02 * np.abs(a).max()
