"""Viscous pair terms (theory: riemann#a4). Each returns the factor-free vector that is summed with F V_j, F = W'/r <= 0.

The acceleration is (1/rho_i) sum_j mu_ij term(v_ij, x_ij) F_ij V_j, mu_ij the mean of both viscosities in series.
"""

import functools
import math
from typing import Any, NamedTuple

import warp as wp

from .smoothing import KERNELS, make_smoothing
from .spec import types


@functools.cache
def make_viscosity(form: str, dimension: int, precision: str) -> Any:
    """Return the `wp.func` viscous_term(v_ij, x_ij, r2, inv_h) for "morris", "radial", "isotropic" or "paper".

    morris: 2 v_ij (Morris 1997), isotropic on a lattice; conserves linear momentum.
    radial: 2(d+2) (v_ij.x_ij)/r^2 x_ij (Monaghan-Gingold), conserves angular momentum too, right at stress-free surfaces.
    isotropic: the same, with other weights in place of F (`make_friction_slope`).
    paper: seed 000 eq (16), K/h in place of 2(d+2)/r, K = 2.5(d+2): about 1.2 times the nominal viscosity.
    """
    real, vec, _, _ = types(dimension, precision)
    if form == "morris":

        @wp.func
        def viscous_term(v: vec, d: vec, r2: real, inv_h: real):
            return real(2.0) * v

    elif form in ("radial", "isotropic"):
        factor = 2.0 * (dimension + 2)

        @wp.func
        def viscous_term(v: vec, d: vec, r2: real, inv_h: real):
            return (real(factor) * wp.dot(v, d) / r2) * d

    elif form == "paper":
        factor = 2.5 * (dimension + 2)

        @wp.func
        def viscous_term(v: vec, d: vec, r2: real, inv_h: real):
            return (real(factor) * inv_h * wp.dot(v, d) / wp.sqrt(r2)) * d

    else:
        raise KeyError(form)
    return viscous_term


@functools.cache
def make_viscous_parts(form: str, dimension: int, precision: str) -> tuple[Any, Any]:
    """Return the term of `make_viscosity` as A v_ij + B x_ij: the number A, the `wp.func` B(v_ij.x_ij, r2, inv_h)."""
    real = types(dimension, precision).real
    along = 0.0 if form == "morris" else 2.5 * (dimension + 2) if form == "paper" else 2.0 * (dimension + 2)

    @wp.func
    def with_way(closing: real, r2: real, inv_h: real):
        if wp.static(form == "morris"):
            return real(0.0)
        elif wp.static(form == "paper"):
            return real(along) * inv_h * closing / wp.sqrt(r2)
        else:
            return real(along) * closing / r2

    return 2.0 if form == "morris" else 0.0, with_way


# Factors a_k of the powers of r/R in the weights of "isotropic" friction, by dimension: `scripts/friction_weights.py --fit`
# finds them (theory: riemann#isotropic). In 1-D there is one direction.
FRICTION_SHAPE = {
    1: (1.0, 0.0, 0.0, 0.0, 0.0),
    2: (1.0, -12.549, 70.594, -108.498, 50.431),
    3: (1.0, -13.640, 67.057, -98.019, 44.107),
}


def friction_scale(kernel: str, dimension: int) -> float:
    """Return K [-], so that weights -K (1 - s)^1.5 sum a_k s^k have the second moment of the slope w'(q)/q of a kernel."""
    chosen = KERNELS[kernel]
    sphere = 2 * math.pi ** (dimension / 2) / math.gamma(dimension / 2)
    b = 1.5 + 1
    moment = 0.0
    for power, factor in enumerate(FRICTION_SHAPE[dimension]):
        a = dimension + 2 + power
        moment += factor * math.gamma(a) * math.gamma(b) / math.gamma(a + b)
    return dimension / (chosen.alpha[dimension - 1] * sphere * chosen.support ** (dimension + 2) * moment)


@functools.cache
def make_friction_slope(form: str, kernel: str, dimension: int, precision: str) -> Any:
    """Return the `wp.func` friction_slope(q), the weights of pairs in the viscous sum, in the place of the slope w'(q)/q.

    They are that slope but for "isotropic". Radial friction takes the fourth moments of the weights over its neighbours for
    their integrals: with those of Wendland's C2 and h = 1.5 spacings shear along rows of a lattice has 0.89 of the
    viscosity, stretching 1.03, and shear of a fluid that slides row over row 0.92. -K (1 - s)^1.5 sum a_k s^k, s = r/R, R
    the support, has each of them within 0.005 (`FRICTION_SHAPE`; theory: riemann#isotropic).
    """
    _, slope = make_smoothing(kernel, precision)
    if form != "isotropic":
        return slope
    real = types(dimension, precision).real
    scale, inverse_support = friction_scale(kernel, dimension), 1.0 / KERNELS[kernel].support
    a0, a1, a2, a3, a4 = (-scale * factor for factor in FRICTION_SHAPE[dimension])

    @wp.func
    def friction_slope(q: real):
        s = real(inverse_support) * q
        u = wp.max(real(1.0) - s, real(0.0))
        return u * wp.sqrt(u) * (real(a0) + s * (real(a1) + s * (real(a2) + s * (real(a3) + s * real(a4)))))

    return friction_slope


@functools.cache
def make_series_mean(precision: str) -> Any:
    """Return the `wp.func` series_mean(mu_i, mu_j, a_i, a_j, least) = (a_i + a_j)/(a_i/mu_i + a_j/mu_j) [Pa s].

    a_i, a_j: depths of both particles below their interface, in one unit, `least` at least: what is nearer than half a
    spacing would be stiff (theory: riemann#a4). With equal ones it is the harmonic mean; with theirs the stress is right for
    a velocity that is linear on each side.
    """
    real = types(2, precision).real

    @wp.func
    def series_mean(mu_i: real, mu_j: real, a_i: real, a_j: real, least: real):
        b_i, b_j = wp.max(a_i, least), wp.max(a_j, least)
        return (b_i + b_j) * mu_i * mu_j / wp.max(b_i * mu_j + b_j * mu_i, real(1.0e-30))

    return series_mean


class InterfaceStress(NamedTuple):
    """`wp.func`s of what the friction of pairs lacks between two fluids: a traction along, a jump of the pressure across."""

    traction: Any
    pressure: Any


@functools.cache
def make_interface_stress(dimension: int, precision: str) -> InterfaceStress:
    """Return traction(mu_i, mu_ij, G, n, fd) and pressure(mu_i, mu_j, G, n) (theory: riemann#a4).

    The pairs of the Morris form have the stress mu grad v alone. The rest, mu grad v^T, has no divergence within a fluid,
    but pulls at an interface with (mu_j - mu_i) grad(v.n), which is the same vector on both sides.

    Along the interface pairs across it have mu_ij dv/dn, which with the true traction T = mu (dv/dn + grad(v.n)) of both
    sides is T - mu_ij grad(v.n); in its own fluid a particle has T - mu_i grad(v.n). So its side lacks mu_ij - mu_i of it.
    Across, the pressures differ by 2 (mu_i - mu_j) n.grad(v.n), as they do by a Laplace jump: it goes into p* and is no
    sound. What pairs have across must then end in each fluid as it began there, mu_i - mu_ij.

    G is the velocity gradient [1/s] at the interface of the more viscous side; n a unit normal of either
    sign, 0 where there is none: for the traction that of i, for the pressure that of the more viscous
    side, but that of j in sums along the interface. fd is F V_j x_ij.
    """
    real, vec, mat, _ = types(dimension, precision)

    @wp.func
    def traction(mu_i: real, mean: real, gradient: mat, n: vec, fd: vec):
        pull = wp.transpose(gradient) * fd
        return (real(2.0) * (mean - mu_i)) * (pull - (real(2.0) * wp.dot(n, pull)) * n)

    @wp.func
    def pressure(mu_i: real, mu_j: real, gradient: mat, n: vec):
        return real(2.0) * (mu_i - mu_j) * wp.dot(n, gradient * n)

    return InterfaceStress(traction, pressure)
