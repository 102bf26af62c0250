"""Smoothing kernels: norms, derivatives, support and the sums they give on a lattice (theory: common#kernels)."""

import functools
import itertools
import math

import numpy as np
import pytest

from tests.helpers import evaluate
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing

NAMES = list(KERNELS)
GAUSSIAN_STEP = 2 * math.exp(-9.0)  # slope of the Gaussian where it is cut


@functools.cache
def table(name, precision="float64"):
    """Return (q, w, w'/q) on a fine grid of (0, support + 1)."""
    q = np.linspace(0.0, KERNELS[name].support + 1.0, 40001)[1:]
    shape, slope = make_smoothing(name, precision)
    return q, evaluate(shape, precision, q), evaluate(slope, precision, q)


def at(name, q):
    shape, slope = make_smoothing(name, "float64")
    q = np.asarray(q, dtype=float)
    return evaluate(shape, "float64", q), evaluate(slope, "float64", q)


@pytest.mark.parametrize("name", NAMES)
def test_norm_and_variance_in_one_two_and_three_dimensions(name):
    nodes, weights = np.polynomial.legendre.leggauss(24)
    q = np.concatenate([k + 0.5 + 0.5 * nodes for k in range(3)])
    weights = np.tile(0.5 * weights, 3)
    w = at(name, q)[0]
    shells = (np.full_like(q, 2.0), 2 * math.pi * q, 4 * math.pi * q**2)
    for alpha, shell in zip(KERNELS[name].alpha, shells, strict=True):
        assert alpha * np.sum(weights * shell * w) == pytest.approx(1.0, abs=1e-8)
    for d, (shell, variance) in enumerate(zip(shells, KERNELS[name].variance, strict=True), start=1):
        along_an_axis = KERNELS[name].alpha[d - 1] * np.sum(weights * shell * w * q**2) / d
        assert along_an_axis == pytest.approx(variance, abs=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_slope_is_the_derivative_over_q(name):
    q, w, s = table(name)
    step = q[1] - q[0]
    inner = slice(1, -1)
    derivative = (w[2:] - w[:-2]) / (2 * step)
    away = np.abs(q[inner] - KERNELS[name].support) > 2 * step  # the Gaussian has a kink where it is cut
    error = np.abs(derivative - q[inner] * s[inner])[away]
    assert error.max() < 1e-6 * np.abs(q * s).max()
    assert (s <= 0).all()


@pytest.mark.parametrize("name", NAMES)
def test_nothing_at_and_beyond_the_support(name):
    edge = KERNELS[name].support
    w, s = at(name, [edge, edge * (1 + 1e-15), edge + 0.1, 2 * edge, 1e3])
    assert (w == 0).all() and (s == 0).all()
    w, s = at(name, [edge * (1 - 1e-6)])
    assert 0 <= w[0] < 1e-6
    assert abs(edge * s[0]) < (1.001 * GAUSSIAN_STEP * edge if name == "gaussian" else 1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_single_precision(name):
    q, w64, s64 = table(name)
    _, w32, s32 = table(name, "float32")
    assert np.abs(w32 - w64).max() < 2e-6 * w64.max()
    assert np.abs(s32 - s64).max() < 3e-6 * np.abs(s64).max()


# methods, table 0.2: dimension, kernel, h/dx, neighbours, S-1 and half a unit of its last digit, L
LATTICE = [
    (2, "wendland_c2", 1.25, 20, 1.4e-2, 5e-4, 0.9665),
    (2, "wendland_c2", 1.5, 24, 5.1e-3, 5e-5, 0.9974),
    (2, "wendland_c2", 2.0, 44, 1.2e-3, 5e-5, 0.9992),
    (2, "wendland_c4", 2.0, 44, 4e-4, 5e-5, 0.9987),
    (2, "quintic", 1.0, 24, 6e-5, 5e-6, 1.0008),
    (2, "quintic", 1.25, 44, -8e-5, 5e-6, 1.0000),
    (3, "wendland_c2", 1.25, 80, 1.3e-2, 5e-4, 0.979),
    (3, "wendland_c2", 2.0, 250, 5e-4, 5e-5, 0.9994),
    (3, "quintic", 1.0, 92, -2e-5, 5e-6, 1.0010),
]


@pytest.mark.parametrize("d, name, ratio, neighbours, s_error, s_digit, moment", LATTICE)
def test_sums_on_a_lattice(d, name, ratio, neighbours, s_error, s_digit, moment):
    sites = np.array(list(itertools.product(range(-5, 6), repeat=d)), dtype=float)
    r = np.linalg.norm(sites, axis=1)
    w, s = at(name, r / ratio)
    alpha = KERNELS[name].alpha[d - 1]
    assert int(((r > 0) & (r < KERNELS[name].support * ratio)).sum()) == neighbours
    assert alpha * w.sum() / ratio**d - 1 == pytest.approx(s_error, abs=1.001 * s_digit)
    # L = -sum V x^2 W'/r, W'/r = alpha/h^(d+2) w'/q
    digit = 5e-4 if moment == 0.979 else 5e-5
    assert -alpha * (sites[:, 0] ** 2 * s).sum() / ratio ** (d + 2) == pytest.approx(moment, abs=1.001 * digit)


def test_unknown_kernel():
    with pytest.raises(KeyError):
        make_smoothing("none_such", "float32")
