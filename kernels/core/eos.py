"""Equation of state in terms of the density excess s = rho/rho0 - 1 (theory: riemann#a1, seed 000 eq 5)."""

import functools
from typing import Any

import warp as wp

from .spec import types


@functools.cache
def make_eos(precision: str) -> Any:
    """Return the `wp.func` pressure(s, stiffness, gamma) = B [(1+s)^gamma - 1] in Pa, without background pressure."""
    real = types(2, precision).real

    @wp.func
    def pressure(s: real, stiffness: real, gamma: real):
        # Subtracting 1 from (1+s)^gamma loses every digit of a small s; the binomial series does not.
        # Six terms: below 1e-7 relative for |s| < 0.1 and gamma up to 7, exact for gamma = 1.
        g = gamma
        series = s * (
            g
            + s
            * (g * (g - real(1.0)) / real(2.0))
            * (
                real(1.0)
                + s
                * ((g - real(2.0)) / real(3.0))
                * (
                    real(1.0)
                    + s
                    * ((g - real(3.0)) / real(4.0))
                    * (
                        real(1.0)
                        + s
                        * ((g - real(4.0)) / real(5.0))
                        * (
                            real(1.0)
                            + s
                            * ((g - real(5.0)) / real(6.0))
                            * (real(1.0) + s * ((g - real(6.0)) / real(7.0)))
                        )
                    )
                )
            )
        )
        result = stiffness * series
        if wp.abs(s) > real(0.1):
            result = stiffness * (wp.pow(wp.max(real(1.0) + s, real(0.0)), gamma) - real(1.0))
        return result

    return pressure
