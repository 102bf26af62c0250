"""Star states and the Laplace jump of a pair (theory: riemann#a3)."""

import numpy as np
import pytest

from tests.helpers import evaluate
from warpsph.kernels.riemann.star import make_jump, make_star

N = 200


@pytest.fixture(scope="module")
def pairs():
    """Random pairs of states, densities over three decades."""
    rng = np.random.default_rng(3)
    keys = ("u_i", "u_j", "p_i", "p_j", "jump")
    state = {key: rng.uniform(-1, 1, N) for key in keys}
    for key in ("rho_i", "rho_j"):
        state[key] = 10 ** rng.uniform(0, 3, N)
    for key in "ij":
        state["z_" + key] = state["rho_" + key] * 10 ** rng.uniform(0, 1, N)
    return state


def velocity(arithmetic, u_i, u_j, rho_i, rho_j, z_i, z_j, dp):
    star = make_star("float64", arithmetic).velocity
    return evaluate(star, "float64", u_i, u_j, rho_i, rho_j, z_i, z_j, dp)


def pressure(arithmetic, p_i, p_j, rho_i, rho_j, jump):
    return evaluate(make_star("float64", arithmetic).pressure, "float64", p_i, p_j, rho_i, rho_j, jump)


@pytest.mark.parametrize("arithmetic", [False, True])
def test_both_particles_see_one_star_state(pairs, arithmetic):
    p = pairs
    zero = np.zeros(N)
    args = (p["rho_i"], p["rho_j"])
    back = (p["rho_j"], p["rho_i"])
    np.testing.assert_allclose(
        pressure(arithmetic, p["p_i"], p["p_j"], *args, zero),
        pressure(arithmetic, p["p_j"], p["p_i"], *back, zero),
    )
    # with a jump the pressures differ by just that: the difference is the tension
    seen_from_i = pressure(arithmetic, p["p_i"], p["p_j"], *args, p["jump"])
    seen_from_j = pressure(arithmetic, p["p_j"], p["p_i"], *back, -p["jump"])
    np.testing.assert_allclose(seen_from_i - seen_from_j, p["jump"], atol=1e-14)
    # e points the other way for j: u changes sign and so does the star velocity
    dp = p["p_i"] - p["p_j"]
    forward = velocity(arithmetic, p["u_i"], p["u_j"], *args, p["z_i"], p["z_j"], dp)
    backward = velocity(arithmetic, -p["u_j"], -p["u_i"], *back, p["z_j"], p["z_i"], -dp)
    np.testing.assert_allclose(backward, -forward, atol=1e-14)


@pytest.mark.parametrize("arithmetic", [False, True])
def test_weights_do_no_net_work(pairs, arithmetic):
    """p* (u_i - u_j) = p_i (u_i - u*) + p_j (u* - u_j) for any state; the pressure term takes energy away."""
    p = pairs
    args = (p["rho_i"], p["rho_j"])
    p_star = pressure(arithmetic, p["p_i"], p["p_j"], *args, np.zeros(N))

    def excess(dp):
        u = velocity(arithmetic, p["u_i"], p["u_j"], *args, p["z_i"], p["z_j"], dp)
        return p_star * (p["u_i"] - p["u_j"]) - p["p_i"] * (p["u_i"] - u) - p["p_j"] * (u - p["u_j"])

    np.testing.assert_allclose(excess(np.zeros(N)), 0.0, atol=1e-13)
    assert (excess(p["p_i"] - p["p_j"]) >= 0).all()


@pytest.mark.parametrize("arithmetic", [False, True])
def test_equal_media_are_the_acoustic_solution(arithmetic):
    """u* = (u_i + u_j)/2 + dp/(2 Z), p* the mean."""
    one = np.ones(4)
    u_i, u_j, dp = (
        np.array([1.0, 0.0, -2.0, 0.3]),
        np.array([1.0, 2.0, 1.0, 0.0]),
        np.array([0.0, 3.0, -1.0, 5.0]),
    )
    star = velocity(arithmetic, u_i, u_j, 4 * one, 4 * one, 20 * one, 20 * one, dp)
    np.testing.assert_allclose(star, 0.5 * (u_i + u_j) + dp / 40, rtol=1e-14)
    np.testing.assert_allclose(pressure(arithmetic, u_i, u_j, 4 * one, 4 * one, 0 * one), 0.5 * (u_i + u_j), rtol=1e-14)


def test_impedance_of_two_media(pairs):
    """Two media at one velocity: the contact moves with dp / (Z_i + Z_j) from high to low pressure."""
    p = pairs
    dp = p["p_i"] - p["p_j"]
    star = velocity(False, p["u_i"], p["u_i"], p["rho_i"], p["rho_j"], p["z_i"], p["z_j"], dp) - p["u_i"]
    np.testing.assert_allclose(star, dp / (p["z_i"] + p["z_j"]), atol=1e-14)
    assert (np.sign(star) == np.sign(dp)).all()


def test_arithmetic_form_is_the_printed_one(pairs):
    """Seed 000 eq (11): mean velocity, dp / (2 rho_mean c_mean)."""
    p = pairs
    mean = 0.5 * (p["rho_i"] + p["rho_j"]) * 0.5 * (p["z_i"] / p["rho_i"] + p["z_j"] / p["rho_j"])
    star = velocity(True, p["u_i"], p["u_j"], p["rho_i"], p["rho_j"], p["z_i"], p["z_j"], p["jump"])
    np.testing.assert_allclose(star, 0.5 * (p["u_i"] + p["u_j"]) + 0.5 * p["jump"] / mean, rtol=1e-12)


def test_heavier_particle_sets_the_velocity():
    args = [np.array([x]) for x in (2.0, -1.0, 1000.0, 1.0, 1e4, 10.0, 0.0)]
    assert velocity(False, *args)[0] == pytest.approx(2.0, abs=4e-3)


def test_hydrostatic_interface(pairs):
    """An interface midway between i and j at rest: the star pressure is that of the interface (A3.1)."""
    g, s, p_interface = 9.81, 0.01, 3.0
    rho_i, rho_j = pairs["rho_i"], pairs["rho_j"]
    p_i, p_j = p_interface + rho_i * g * s / 2, p_interface - rho_j * g * s / 2
    np.testing.assert_allclose(pressure(False, p_i, p_j, rho_i, rho_j, 0 * rho_i), p_interface, rtol=1e-11)
    # the arithmetic mean misses by a quarter of the weight difference
    miss = pressure(True, p_i, p_j, rho_i, rho_j, 0 * rho_i) - p_interface
    np.testing.assert_allclose(miss, (rho_i - rho_j) * g * s / 4, rtol=1e-9)


@pytest.mark.parametrize("arithmetic", [False, True])
def test_laplace_jump_in_balance(pairs, arithmetic):
    """p_i - p_j = J: each particle sees its own pressure, so nothing accelerates."""
    p = pairs
    star = pressure(arithmetic, p["p_j"] + p["jump"], p["p_j"], p["rho_i"], p["rho_j"], p["jump"])
    np.testing.assert_allclose(star, p["p_j"] + p["jump"], atol=1e-13)


def jump(sigma, kappa_i, kappa_j, w_i, w_j):
    columns = np.broadcast_arrays(*np.atleast_1d(sigma, kappa_i, kappa_j, w_i, w_j))
    return evaluate(make_jump("float64"), "float64", *columns)


def test_jump_is_antisymmetric():
    rng = np.random.default_rng(5)
    sigma, k_i, k_j, w_i, w_j = rng.uniform(0.1, 2.0, (5, N))
    k_i *= rng.choice([-1, 1], N)
    np.testing.assert_allclose(jump(sigma, k_i, k_j, w_i, w_j), -jump(sigma, k_j, k_i, w_j, w_i), rtol=1e-14)


def test_jump_weighs_curvature():
    # a convex particle (drop) against the concave one outside: both say kappa = 4
    assert jump(0.5, 4.0, -4.0, 0.3, 0.7)[0] == pytest.approx(2.0)
    assert jump(0.5, 4.0, 99.0, 0.3, 0.0)[0] == pytest.approx(2.0)
    assert jump(1.0, 4.0, -1.0, 1.0, 3.0)[0] == pytest.approx((4.0 + 3.0) / 4)
    assert jump(0.5, 4.0, -4.0, 0.0, 0.0)[0] == 0.0
