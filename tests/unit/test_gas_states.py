"""Star states of a pair of gas particles and limited reconstruction (theory: compressible#c2, compressible#c2-exact)."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.core.spec import types
from warpsph.kernels.gas.limiters import make_limiters
from warpsph.kernels.gas.riemann_states import make_acoustic_states, make_exact_states

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "exact_gas.py"
MAKERS = {"acoustic": make_acoustic_states, "exact": make_exact_states}
EPS = {"float32": 6e-8, "float64": 1.2e-16}


@pytest.fixture(scope="module")
def exact_gas():
    """scripts/exact_gas.py, whose solver brackets the pressure."""
    spec = importlib.util.spec_from_file_location("exact_gas", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["exact_gas"] = module
    spec.loader.exec_module(module)
    return module


def star(name, precision, rows, gamma=1.4, device="cpu"):
    """p* and u* (n,) of rows (rho_l, u_l, p_l, rho_r, u_r, p_r), the speeds of sound from gamma."""
    real = types(2, precision).real
    states = MAKERS[name](precision)

    @wp.kernel(module="unique", enable_backward=False)
    def apply(table: wp.array2d(dtype=real), gamma: real, out: wp.array2d(dtype=real)):
        i = wp.tid()
        t = table[i]
        p, u = states(t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7], gamma)
        out[i, 0] = p
        out[i, 1] = u

    rho_l, u_l, p_l, rho_r, u_r, p_r = np.asarray(rows, float).T
    columns = [rho_l, u_l, p_l, np.sqrt(gamma * p_l / rho_l), rho_r, u_r, p_r, np.sqrt(gamma * p_r / rho_r)]
    table = wp.array(np.stack(columns, axis=1), dtype=real, device=device)
    out = wp.zeros((len(rho_l), 2), dtype=real, device=device)
    wp.launch(apply, dim=len(rho_l), inputs=[table, real(gamma), out], device=device)
    return out.numpy().astype(float).T


def random_rows(count, ratio, mach, gamma, seed=3):
    """States whose densities and pressures are within `ratio` of each other, closing or parting at up to `mach`."""
    rng = np.random.default_rng(seed)
    rho_l, rho_r, p_l, p_r = np.exp(rng.uniform(-0.5, 0.5, (4, count)) * np.log(ratio))
    c = np.where(rng.random(count) < 0.5, np.sqrt(gamma * p_l / rho_l), np.sqrt(gamma * p_r / rho_r))
    jump = c * np.exp(rng.uniform(np.log(1e-3), np.log(mach), count)) * rng.choice([-1.0, 1.0], count)
    mean = c * rng.uniform(-1, 1, count)
    return np.stack([rho_l, mean - 0.5 * jump, p_l, rho_r, mean + 0.5 * jump, p_r], axis=1)


def bracketed(exact_gas, rows, gamma):
    """p*, u* of the solver that brackets, and by how much p* moves with u_r - u_l: -1/(1/Z_l + 1/Z_r) between the waves."""
    found = [exact_gas.Riemann(exact_gas.Gas(*r[:3]), exact_gas.Gas(*r[3:]), gamma).star for r in rows]
    p, u, left, right = np.array([[s.pressure, s.velocity, s.left, s.right] for s in found]).T
    return p, u, np.sqrt(gamma * p * np.minimum(left, right))


def sounds(rows, gamma):
    """The larger speed of sound of each pair: (n,)."""
    return np.sqrt(gamma * np.maximum(rows[:, 2] / rows[:, 0], rows[:, 5] / rows[:, 3]))


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("gamma", [1.1, 1.4, 5 / 3, 3.0])
def test_exact_states_of_random_pairs(exact_gas, device, precision, gamma):
    """Ratios up to 1e6 in density and pressure, speeds up to a thousand times that of sound."""
    rows = random_rows(600, 1e6, 1e3, gamma)
    p, u = star("exact", precision, rows, gamma, device)
    p_exact, u_exact, stiffness = bracketed(exact_gas, rows, gamma)
    error = np.abs([p - p_exact, u - u_exact])
    # Both are found from a sum of velocities of this size; some twenty operations round it
    scale = np.abs(rows[:, 1]) + np.abs(rows[:, 4]) + 2 * sounds(rows, gamma) / (gamma - 1) + np.abs(u_exact)
    tiny = p_exact < 1e-30
    assert np.max((error[1] / scale)[~tiny]) < 20 * EPS[precision]
    assert np.max(error[0, ~tiny] / (p_exact + stiffness * scale)[~tiny]) < 20 * EPS[precision]
    # Next to a vacuum p* is nothing and u* anything between the gases
    assert (p[tiny] < 2e-30).all() and np.isfinite(u).all() and tiny.sum() < 200


# Toro (2009), tables 4.1 to 4.3, gamma = 1.4: states, p* and u* as printed there
TORO = {
    "sod": ((1, 0, 1, 0.125, 0, 0.1), 0.30313, 0.92745),
    "123": ((1, -2, 0.4, 1, 2, 0.4), 0.00189, 0.0),
    "left blast": ((1, 0, 1000, 1, 0, 0.01), 460.894, 19.5975),
    "right blast": ((1, 0, 0.01, 1, 0, 100), 46.0950, -6.19633),
    "collision": ((5.99924, 19.5975, 460.894, 5.99242, -6.19633, 46.0950), 1691.64, 8.68975),
}


@pytest.mark.parametrize("name", TORO)
def test_published_star_states(device, name):
    """To the digits that are printed, of the states and of what they give: six at most, some cut off and not rounded."""
    row, pressure, velocity = TORO[name]
    for precision in ("float32", "float64"):
        p, u = star("exact", precision, [row], device=device)
        assert p[0] == pytest.approx(pressure, rel=1e-5, abs=1e-5)
        assert u[0] == pytest.approx(velocity, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("name", MAKERS)
def test_uniform_states_and_mirror_images(device, name, precision):
    """Equal sides give themselves; swapped sides with turned velocities give the same pressure and the opposite velocity."""
    rows = random_rows(400, 1e4, 10.0, 1.4)
    same = np.concatenate([rows[:, :3], rows[:, :3]], axis=1)
    p, u = star(name, precision, same, device=device)
    np.testing.assert_allclose(p, rows[:, 2], rtol=8 * EPS[precision])
    # velocities are found from pressures, to a rounding of (p/rho c)
    assert np.max(np.abs(u - rows[:, 1]) / (sounds(same, 1.4) + np.abs(rows[:, 1]))) < 8 * EPS[precision]
    turned = rows[:, [3, 4, 5, 0, 1, 2]] * [1, -1, 1, 1, -1, 1]
    forth, back = star(name, precision, rows, device=device), star(name, precision, turned, device=device)
    np.testing.assert_allclose(back[0], forth[0], rtol=200 * EPS[precision], atol=1e-30)
    assert np.max(np.abs(back[1] + forth[1]) / (sounds(rows, 1.4) + np.abs(forth[1]))) < 200 * EPS[precision]


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("name", MAKERS)
def test_edges_stay_finite_and_never_pull(device, name, precision):
    """No pressure on one or both sides, at rest, closing and parting; vacuum between; 0 <= p*."""
    pressures = [0.0, 1e-12, 1.0, 1e6]
    rows = [
        (rho_l, 0.0, p_l, rho_r, du, p_r)
        for rho_l in (1e-6, 1.0) for rho_r in (1e-6, 1e3)
        for p_l in pressures for p_r in pressures
        for du in (-1e3, -1.0, 0.0, 1.0, 1e3, 1e6)
    ]  # fmt: skip
    p, u = star(name, precision, rows, device=device)
    assert np.isfinite(p).all() and np.isfinite(u).all()
    assert (p >= 0.0).all()


def test_cold_gases_that_collide(device):
    """Two jets without pressure: rho_l (u_l - u*)^2 = rho_r (u* - u_r)^2, and p* = (gamma+1)/2 of that."""
    row = (4.0, 3.0, 0.0, 1.0, 0.0, 0.0)
    p, u = star("exact", "float64", [row], 5 / 3, device)
    assert u[0] == pytest.approx(2.0, rel=1e-12)
    assert p[0] == pytest.approx(4 / 3 * 4.0, rel=1e-12)
    assert star("exact", "float64", [(4.0, 0.0, 0.0, 1.0, 3.0, 0.0)], 5 / 3, device)[0][0] == 0.0


def test_acoustic_states_lie_on_both_characteristics(device):
    """p* - p_l = Z_l (u_l - u*) and p* - p_r = Z_r (u* - u_r), unless p* would be below zero."""
    rows = random_rows(400, 1e4, 3.0, 1.4)
    rho_l, u_l, p_l, rho_r, u_r, p_r = rows.T
    z_l, z_r = np.sqrt(1.4 * p_l * rho_l), np.sqrt(1.4 * p_r * rho_r)
    p, u = star("acoustic", "float64", rows, device=device)
    pushed = p > 0
    assert 200 < pushed.sum() < 400
    scale = (p_l + p_r + (z_l + z_r) * (np.abs(u_l) + np.abs(u_r)))[pushed]
    assert np.max(np.abs(p - p_l - z_l * (u_l - u))[pushed] / scale) < 10 * EPS["float64"]
    assert np.max(np.abs(p - p_r - z_r * (u - u_r))[pushed] / scale) < 10 * EPS["float64"]


def test_acoustic_states_of_weak_waves(device):
    """The error falls with the square of the strength of the waves: by four when the jumps are halved."""
    errors = []
    for jump in (0.04, 0.02, 0.01):
        row = (1.0, jump, 1.0 + jump, 1.0 + 2 * jump, -jump, 1.0 - jump)
        found, exact = (star(name, "float64", [row], device=device) for name in MAKERS)
        errors.append(np.abs(found - exact).max())
    assert errors[0] / errors[1] > 3.5 and errors[1] / errors[2] > 3.5


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_limiters(device, precision):
    real = types(2, precision).real
    limiters = make_limiters(precision)
    limited_step, ordered_step, shock_switch = limiters.limited_step, limiters.ordered_step, limiters.shock_switch
    even_share = limiters.even_share

    @wp.kernel(module="unique", enable_backward=False)
    def apply(a: wp.array(dtype=real), b: wp.array(dtype=real), out: wp.array2d(dtype=real)):
        i = wp.tid()
        out[i, 0] = limited_step(a[i], b[i])
        out[i, 1] = shock_switch(a[i], real(0.0), b[i], real(2.0))
        out[i, 2] = ordered_step(a[i], b[i])
        out[i, 3] = even_share(a[i], b[i])

    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 500)).astype(real)
    a[:3], b[:3] = (1.0, 1.0, 0.0), (1.0, 0.0, 1.0)
    out = wp.zeros((500, 4), dtype=real, device=device)
    wp.launch(apply, dim=500, inputs=[wp.array(v, dtype=real, device=device) for v in (a, b)] + [out], device=device)
    step, switch, ordered, share = out.numpy().T
    # a straight line keeps its slope, an extremum loses it
    assert step[0] == 1.0 and step[1] == 0.0 and step[2] == 0.0
    far = 2 * b - a
    smooth = (far * a > 0) & (np.abs(far) < 3 * np.abs(a)) & (np.abs(a) < 3 * np.abs(far))
    assert smooth.sum() > 50
    # the mean of both differences while neither is more than three times the other: that is the rise of the gradient
    np.testing.assert_allclose(step[smooth], b[smooth], rtol=8 * EPS[precision])
    assert (step * a >= 0).all() and (np.abs(step) <= 2 * np.abs(a)).all() and (np.abs(step) <= 2 * np.abs(far)).all()
    assert ((step == 0) == (far * a <= 0)).all()
    np.testing.assert_array_equal(ordered, np.sign(step) * np.minimum(np.abs(step), np.abs(a)))
    # 1 for two equal gradients, 0 for opposite ones, second order in their relative difference
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = ((a - b) / (a + b)).astype(float)
    np.testing.assert_allclose(share, np.where(a * b > 0, 1 - apart**2, 0.0), atol=16 * EPS[precision])
    np.testing.assert_array_equal(switch, (a <= np.minimum(b, 2)).astype(float))
