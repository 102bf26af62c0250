"""Limited second-order reconstruction between two particles (theory: compressible#c2).

A quantity q is carried from a particle to the middle of a pair with half of a limited difference. `step` is q_j - q_i,
`rise` is (x_j - x_i).grad q, what the gradient at the particle makes of the same way; the difference on the particle's far
side is then 2 rise - step. What is reconstructed lies between q_i and q_j, so that density and energy stay positive.

Pairs of SPH are up to two supports apart and overlap. With a step as large as twice the difference, which a grid bears,
their sides change places, and the Riemann problem drives the gas where it should brake it. `ordered_step` is at most the
difference itself: the sides meet at most.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.spec import types


class Limiters(NamedTuple):
    """`wp.func`s of a pair, see `make_limiters`."""

    minmod: Any
    monotonised_central: Any
    limited_step: Any
    ordered_step: Any
    even_share: Any
    shock_switch: Any


@functools.cache
def make_limiters(precision: str) -> Limiters:
    """Return the limiters of one precision.

    minmod(a, b): the smaller of two differences, 0 where their signs differ.
    monotonised_central(a, b): their mean, but at most twice the smaller (van Leer 1977).
    limited_step(step, rise): the difference of q of which half goes on q at the particle:
        q_i + limited_step(q_j - q_i, rise_i)/2 on the left, q_j - limited_step(q_j - q_i, rise_j)/2 on the right, both
        rises along x_j - x_i.
    ordered_step(step, rise): the same, but at most the difference itself: the sides do not change places.
    even_share(a, b): 4ab/(a + b)^2, 0 where the signs differ (van Leer 1974; Frontiere et al. 2017): the share that is taken
        of the differences a, b which the gradients of both particles make of their way. Gradients are means over many
        neighbours, so that it is near 1 in a smooth flow however the difference of a pair scatters.
    shock_switch(u_l, u_r, c_l, c_r): 0 where the sides close in faster than the smaller speed of sound, else 1.
    """
    real = types(2, precision).real

    @wp.func
    def minmod(a: real, b: real):
        result = real(0.0)
        if a * b > real(0.0):
            result = a
            if wp.abs(b) < wp.abs(a):
                result = b
        return result

    @wp.func
    def monotonised_central(a: real, b: real):
        return minmod(real(0.5) * (a + b), real(2.0) * minmod(a, b))

    @wp.func
    def limited_step(step: real, rise: real):
        return monotonised_central(step, real(2.0) * rise - step)

    @wp.func
    def ordered_step(step: real, rise: real):
        return minmod(step, limited_step(step, rise))

    @wp.func
    def even_share(a: real, b: real):
        result = real(0.0)
        if a * b > real(0.0):
            result = real(4.0) * a * b / ((a + b) * (a + b))
        return result

    @wp.func
    def shock_switch(u_l: real, u_r: real, c_l: real, c_r: real):
        result = real(1.0)
        if u_l - u_r > wp.min(c_l, c_r):
            result = real(0.0)
        return result

    return Limiters(minmod, monotonised_central, limited_step, ordered_step, even_share, shock_switch)
