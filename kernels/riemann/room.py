"""Weight of the sums that say how much room particles take (theory: riemann#room, riemann#splashed)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.spec import types


@functools.cache
def make_window(precision: str) -> Any:
    """Return the `wp.func` window(r2, inv_window) = (1 - r^2/R^2)^4 of r^2 [m^2], with 1/R^2 [1/m^2], 0 from R on."""
    real = types(1, precision).real

    @wp.func
    def window(r2: real, inv_window: real):
        inside = wp.max(real(1.0) - r2 * inv_window, real(0.0))
        square = inside * inside
        return square * square

    return window
