"""Star states of a pair of gas particles: pressure and velocity where two states of an ideal gas meet.

Left is i, right is j, u [m/s] is positive from left to right, p [Pa] is absolute, c = sqrt(gamma p/rho) [m/s]. Both solvers
have the arguments (rho_l, u_l, p_l, c_l, rho_r, u_r, p_r, c_r, gamma) and return (p*, u*); 0 <= p*, and swapping the sides
together with the signs of the velocities turns the sign of u*.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.spec import types

# Newton steps of the exact solver that bring p* to rounding for every pair of states whose pressures and densities are
# within a factor 1e6 of each other (table of theory: compressible#c2-exact). Nearly equal states stop after one or two.
STEPS = 5
# A step is the last one when it moves sqrt(p*) by less than this part: the next would move it by about the square.
LAST_STEP = {"float32": 3.0e-4, "float64": 1.0e-7}
# Keeps divisions by a vanishing pressure or density finite; far below any state, above the smallest float32.
TINY = 1.0e-30


@functools.cache
def make_acoustic_states(precision: str) -> Any:
    """Return the `wp.func` of the linearised Riemann problem, Z = rho c (theory: compressible#c2; Parshikov 1999)."""
    real = types(2, precision).real

    @wp.func
    def acoustic_states(
        rho_l: real, u_l: real, p_l: real, c_l: real, rho_r: real, u_r: real, p_r: real, c_r: real, gamma: real
    ):
        z_l = rho_l * c_l
        z_r = rho_r * c_r
        total = wp.max(z_l + z_r, real(TINY))
        pressure = (z_r * p_l + z_l * p_r + z_l * z_r * (u_l - u_r)) / total
        velocity = (z_l * u_l + z_r * u_r + p_l - p_r) / total
        return wp.max(pressure, real(0.0)), velocity

    return acoustic_states


@functools.cache
def make_exact_states(precision: str) -> Any:
    """Return the `wp.func` of the exact Riemann problem of an ideal gas, gamma > 1 (theory: compressible#c2-exact).

    Two rarefactions and the vacuum between gases that part are solved in closed form, everything else by at most `STEPS`
    of Newton for sqrt(p*), in which a shock is nearly a straight line. In a vacuum u* is the mean of its two edges. States
    without pressure are allowed.
    """
    real = types(2, precision).real
    last_step = LAST_STEP[precision]

    @wp.func
    def wave(root: real, rho: real, p: real, c: real, gamma: real):
        """The change of velocity [m/s] across the wave that takes a side to the pressure root^2, and its derivative."""
        star = root * root
        behind = wp.max(star + (gamma - real(1.0)) / (gamma + real(1.0)) * p, real(TINY))
        inverse_flux = wp.sqrt(real(2.0) / ((gamma + real(1.0)) * wp.max(rho, real(TINY)) * behind))
        change = (star - p) * inverse_flux
        slope = real(2.0) * root * inverse_flux * (real(1.0) - real(0.5) * (star - p) / behind)
        if star < p:
            power = wp.pow(star / p, (gamma - real(1.0)) / (real(2.0) * gamma))
            change = real(2.0) * c / (gamma - real(1.0)) * (power - real(1.0))
            slope = real(2.0) * c / gamma * power / wp.max(root, real(TINY))
        return change, slope

    @wp.func
    def rarefied(p_l: real, c_l: real, p_r: real, c_r: real, parting: real, gamma: real):
        """The pressure between two rarefactions; above p* where a wave is a shock (parting: u_r - u_l)."""
        exponent = (gamma - real(1.0)) / (real(2.0) * gamma)
        high = wp.max(p_l, p_r)
        c_high = c_l
        c_low = c_r
        if p_r > p_l:
            c_high = c_r
            c_low = c_l
        ratio = wp.pow(wp.min(p_l, p_r) / wp.max(high, real(TINY)), exponent)
        left = wp.max(c_l + c_r - real(0.5) * (gamma - real(1.0)) * parting, real(0.0))
        return high * wp.pow(left / wp.max(c_high + c_low / wp.max(ratio, real(TINY)), real(TINY)), real(1.0) / exponent)

    @wp.func
    def exact_states(
        rho_l: real, u_l: real, p_l: real, c_l: real, rho_r: real, u_r: real, p_r: real, c_r: real, gamma: real
    ):
        parting = u_r - u_l
        # A shock changes the velocity by at least sqrt(2/((gamma+1) rho)) (sqrt(p*) - sqrt(p)): not above p* either
        give = wp.sqrt(real(2.0) / ((gamma + real(1.0)) * wp.max(rho_l, real(TINY))))
        give += wp.sqrt(real(2.0) / ((gamma + real(1.0)) * wp.max(rho_r, real(TINY))))
        root = wp.sqrt(wp.max(p_l, p_r)) + wp.max(-parting, real(0.0)) / give
        searching = bool(True)
        if wp.max(p_l, p_r) > real(0.0):
            between = rarefied(p_l, c_l, p_r, c_r, parting, gamma)
            root = wp.min(root, wp.sqrt(between))
            searching = between > wp.min(p_l, p_r)
        elif parting >= real(0.0):
            searching = False
        step = int(0)
        while searching and step < wp.static(STEPS):
            left, left_slope = wave(root, rho_l, p_l, c_l, gamma)
            right, right_slope = wave(root, rho_r, p_r, c_r, gamma)
            change = (left + right + parting) / (left_slope + right_slope)
            # next to nothing the tangent may lead below zero
            better = wp.max(root - change, real(0.1) * root)
            searching = wp.abs(better - root) > real(last_step) * root
            root = better
            step += 1
        left, _ = wave(root, rho_l, p_l, c_l, gamma)
        right, _ = wave(root, rho_r, p_r, c_r, gamma)
        return root * root, real(0.5) * (u_l + u_r + right - left)

    return exact_states
