"""Least eigenvalue of a symmetric matrix, in closed form (theory: common#moment)."""

import functools
from typing import Any

import warp as wp

from .spec import types

# Least eigenvalue of the moment of a neighbourhood, up to which its particle is one of a free surface (Sun et al. 2017).
WHOLE = 0.75


@functools.cache
def make_least_eigenvalue(dimension: int, precision: str) -> Any:
    """Return the `wp.func` least_eigenvalue(m) of a symmetric matrix of dimension 1, 2 or 3.

    In three dimensions with the angle of the characteristic cubic (Smith 1961): m = mean I + spread B, det B = 2 cos 3 phi.
    """
    real, _, mat, _ = types(dimension, precision)

    if dimension == 1:

        @wp.func
        def least_eigenvalue(m: mat):
            return m[0, 0]

    elif dimension == 2:

        @wp.func
        def least_eigenvalue(m: mat):
            mean = real(0.5) * (m[0, 0] + m[1, 1])
            half = real(0.5) * (m[0, 0] - m[1, 1])
            across = real(0.5) * (m[0, 1] + m[1, 0])  # rounding may give the two of them opposite signs
            return mean - wp.sqrt(half * half + across * across)

    else:
        third = 2.0943951023931953  # 2 pi / 3

        @wp.func
        def least_eigenvalue(m: mat):
            mean = wp.trace(m) / real(3.0)
            rest = m - mean * wp.identity(n=3, dtype=real)
            spread = wp.sqrt(wp.ddot(rest, rest) / real(6.0))
            result = mean
            if spread > real(0.0):
                cosine = wp.determinant(rest / spread) * real(0.5)
                angle = wp.acos(wp.clamp(cosine, real(-1.0), real(1.0))) / real(3.0)
                result = mean + real(2.0) * spread * wp.cos(angle + real(third))
            return result

    return least_eigenvalue
