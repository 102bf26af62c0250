"""Viscous pair terms (theory: riemann#a4). Each returns the factor-free vector that is summed with F V_j, F = W'/r <= 0.

The acceleration is (1/rho_i) sum_j mu_ij term(v_ij, x_ij) F_ij V_j, mu_ij the harmonic mean 2 mu_i mu_j/(mu_i+mu_j).
"""

import functools
from typing import Any

import warp as wp

from .spec import types


@functools.cache
def make_viscosity(form: str, dimension: int, precision: str) -> Any:
    """Return the `wp.func` viscous_term(v_ij, x_ij, r2, inv_h) for "morris", "radial" or "paper".

    morris: 2 v_ij (Morris 1997), isotropic on a lattice; conserves linear momentum.
    radial: 2(d+2) (v_ij.x_ij)/r^2 x_ij (Monaghan-Gingold), conserves angular momentum too, right at stress-free surfaces.
    paper: seed 000 eq (16), K/h in place of 2(d+2)/r, K = 2.5(d+2): about 1.2 times the nominal viscosity.
    """
    real, vec, _, _ = types(dimension, precision)
    if form == "morris":

        @wp.func
        def viscous_term(v: vec, d: vec, r2: real, inv_h: real):
            return real(2.0) * v

    elif form == "radial":
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
def make_jump_traction(dimension: int, precision: str) -> Any:
    """Return the `wp.func` jump_traction(rho_i, rho_j, mu_i, mu_j, G, fd): what mu grad v^T adds between two fluids.

    The pairs of the Morris form have the stress mu grad v alone. The rest, mu grad v^T, has no divergence within a fluid,
    but pulls at an interface with (mu_j - mu_i) G^T n, where G^T n = grad(v.n) is the same on both sides. It is shared
    like the pressure p*: particle i has 2 rho_i/(rho_i + rho_j) of it.

    G is the velocity gradient [1/s] of the more viscous side, the smaller one along the interface; fd is F V_j x_ij.
    """
    real, vec, mat, _ = types(dimension, precision)

    @wp.func
    def jump_traction(rho_i: real, rho_j: real, mu_i: real, mu_j: real, gradient: mat, fd: vec):
        share = real(2.0) * rho_i / (rho_i + rho_j)
        return (share * (mu_j - mu_i)) * (wp.transpose(gradient) * fd)

    return jump_traction
