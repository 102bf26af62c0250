"""Smoothing kernels as functions of q = r/h, without their normalisation (theory: common#kernels).

`shape(q)` is w(q) with W = alpha/h^d w(q); `slope(q)` is w'(q)/q, so that grad_i W_ij = alpha/h^(d+2) slope(q) x_ij.
Both are zero outside the support without a branch, which lets the neighbour sums run over list entries
inside the skin without testing the distance.
"""

import dataclasses
import functools
import itertools
import math
from typing import Any

import warp as wp

from .spec import types


@dataclasses.dataclass(frozen=True)
class SmoothingKernel:
    """Constants of a kernel: support radius over h; for one, two and three dimensions alpha and the variance of W along an
    axis over h^2, the integral of W x^2.
    """

    support: float
    alpha: tuple[float, float, float]
    variance: tuple[float, float, float]


def _gaussian_alpha() -> tuple[float, float, float]:
    """Norms of exp(-q^2) - exp(-9), cut at q = 3, from the exact integrals."""
    e9, cut = math.exp(-9.0), 3.0
    erf = math.erf(cut)
    one = math.sqrt(math.pi) * erf - 2 * cut * e9
    two = math.pi * (1 - e9) - math.pi * cut**2 * e9
    three = math.pi**1.5 * erf - 2 * math.pi * cut * e9 - 4 / 3 * math.pi * cut**3 * e9
    return 1 / one, 1 / two, 1 / three


def _gaussian_variance() -> tuple[float, float, float]:
    """Variances of exp(-q^2) - exp(-9), cut at q = 3, along an axis, from the integrals of q^n times it."""
    e9 = math.exp(-9.0)
    moments = [math.sqrt(math.pi) / 2 * math.erf(3.0), (1 - e9) / 2]
    for n in range(2, 5):
        moments.append(((n - 1) * moments[n - 2] - 3.0 ** (n - 1) * e9) / 2)
    cut = [moment - e9 * 3.0 ** (n + 1) / (n + 1) for n, moment in enumerate(moments)]
    return cut[2] / cut[0], cut[3] / cut[1] / 2, cut[4] / cut[2] / 3


PI = math.pi
KERNELS: dict[str, SmoothingKernel] = {
    # (2-q)^4 (1+2q)
    "wendland_c2": SmoothingKernel(2.0, (3 / 64, 7 / (64 * PI), 21 / (256 * PI)), (2 / 7, 5 / 18, 4 / 15)),
    # (1-s)^6 (1 + 6s + 35/3 s^2), s = q/2
    "wendland_c4": SmoothingKernel(2.0, (27 / 32, 9 / (4 * PI), 495 / (256 * PI)), (12 / 55, 7 / 33, 8 / 39)),
    # (1-s)^8 (1 + 8s + 25s^2 + 32s^3), s = q/2
    "wendland_c6": SmoothingKernel(2.0, (15 / 16, 78 / (28 * PI), 1365 / (512 * PI)), (16 / 91, 6 / 35, 1 / 6)),
    "cubic": SmoothingKernel(2.0, (2 / 3, 10 / (7 * PI), 1 / PI), (1 / 3, 31 / 98, 3 / 10)),
    # 1/(120 pi) in 3-D; the often reprinted 3/(359 pi) is 0.28 % too large
    "quintic": SmoothingKernel(3.0, (1 / 120, 7 / (478 * PI), 1 / (120 * PI)), (1 / 2, 2771 / 5736, 7 / 15)),
    # cut at 3h and shifted to be continuous there
    "gaussian": SmoothingKernel(3.0, _gaussian_alpha(), _gaussian_variance()),
}


def window_integral(dimension: int, radius: float, power: int = 2) -> float:
    """Return the integral of (1 - r^2/R^2)^power, power 2 or 4, over the ball of radius R [m] in 1 to 3 dimensions [m^d]."""
    unit = {2: (16 / 15, PI / 3, 32 * PI / 105), 4: (256 / 315, PI / 5, 512 * PI / 3465)}[power]
    return unit[dimension - 1] * radius**dimension


def lattice_slope(kernel: str, ratio: float, dimension: int) -> float:
    """Return h times the sum of |grad W| V over an even lattice with h = ratio spacings, in 1 to 3 dimensions [-]."""
    slope = make_smoothing(kernel, "float64")[1]
    reach = math.ceil(KERNELS[kernel].support * ratio)
    steps = [k / ratio for k in range(-reach, reach + 1)]
    far = [math.hypot(*q) for q in itertools.product(steps, repeat=dimension)]
    total = math.fsum(-float(slope(wp.float64(q))) * q for q in far)
    return KERNELS[kernel].alpha[dimension - 1] / ratio**dimension * total


@functools.cache
def make_smoothing(name: str, precision: str) -> tuple[Any, Any]:
    """Return the pair of `wp.func`s (shape, slope) of a kernel; raises KeyError for an unknown name."""
    real = types(2, precision).real
    if name == "wendland_c2":

        @wp.func
        def shape(q: real):
            u = wp.max(real(2.0) - q, real(0.0))
            return u * u * u * u * (real(1.0) + real(2.0) * q)

        @wp.func
        def slope(q: real):
            u = wp.max(real(2.0) - q, real(0.0))
            return real(-10.0) * u * u * u

    elif name == "wendland_c4":

        @wp.func
        def shape(q: real):
            s = real(0.5) * q
            u = wp.max(real(1.0) - s, real(0.0))
            u2 = u * u
            return u2 * u2 * u2 * (real(1.0) + real(6.0) * s + real(35.0) / real(3.0) * s * s)

        @wp.func
        def slope(q: real):
            s = real(0.5) * q
            u = wp.max(real(1.0) - s, real(0.0))
            u2 = u * u
            return real(-14.0) / real(3.0) * u2 * u2 * u * (real(1.0) + real(5.0) * s)

    elif name == "wendland_c6":

        @wp.func
        def shape(q: real):
            s = real(0.5) * q
            u = wp.max(real(1.0) - s, real(0.0))
            u4 = u * u * u * u
            return u4 * u4 * (real(1.0) + s * (real(8.0) + s * (real(25.0) + s * real(32.0))))

        @wp.func
        def slope(q: real):
            s = real(0.5) * q
            u = wp.max(real(1.0) - s, real(0.0))
            u2 = u * u
            return real(-5.5) * u2 * u2 * u2 * u * (real(1.0) + s * (real(7.0) + s * real(16.0)))

    elif name == "cubic":

        @wp.func
        def shape(q: real):
            a = wp.max(real(2.0) - q, real(0.0))
            b = wp.max(real(1.0) - q, real(0.0))
            return real(0.25) * a * a * a - b * b * b

        @wp.func
        def slope(q: real):
            a = wp.max(real(2.0) - q, real(0.0))
            result = real(-0.75) * a * a / wp.max(q, real(1.0))
            if q < real(1.0):
                result = real(-3.0) + real(2.25) * q
            return result

    elif name == "quintic":

        @wp.func
        def shape(q: real):
            a = wp.max(real(3.0) - q, real(0.0))
            b = wp.max(real(2.0) - q, real(0.0))
            c = wp.max(real(1.0) - q, real(0.0))
            a2 = a * a
            b2 = b * b
            c2 = c * c
            return a2 * a2 * a - real(6.0) * b2 * b2 * b + real(15.0) * c2 * c2 * c

        @wp.func
        def slope(q: real):
            a = wp.max(real(3.0) - q, real(0.0))
            b = wp.max(real(2.0) - q, real(0.0))
            a2 = a * a
            b2 = b * b
            result = real(-5.0) * (a2 * a2 - real(6.0) * b2 * b2) / wp.max(q, real(1.0))
            if q < real(1.0):
                # the three terms cancel as q -> 0: expanded, divided by q
                result = real(-120.0) + q * q * (real(120.0) - real(50.0) * q)
            return result

    elif name == "gaussian":
        @wp.func
        def shape(q: real):
            return wp.max(wp.exp(-q * q) - wp.exp(real(-9.0)), real(0.0))

        @wp.func
        def slope(q: real):
            result = real(0.0)
            if q < real(3.0):
                result = real(-2.0) * wp.exp(-q * q)
            return result

    else:
        raise KeyError(name)
    return shape, slope


@functools.cache
def make_inner_slope(name: str, dimension: int, precision: str) -> Any:
    """Return the `wp.func` inner_slope(norm, r, h) = |W'(r, h)| [1/m^(d+1)] for particles with their own h; norm: alpha."""
    real = types(dimension, precision).real
    _, slope = make_smoothing(name, precision)

    @wp.func
    def inner_slope(norm: real, r: real, h: real):
        inverse = real(1.0) / h
        result = -norm * slope(r * inverse) * r * inverse * inverse
        for _axis in range(wp.static(dimension)):
            result = result * inverse
        return result

    return inner_slope
