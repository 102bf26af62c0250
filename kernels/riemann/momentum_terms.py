"""Formulas of the momentum sweep: what single pairs contribute, and what follows from their sums, see `momentum`."""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.spec import Spec, types, types_of

from .star import make_star

# Share of the acoustic impact pressure Z_i Z_j/(Z_i + Z_j) (u_i - u_j): all of it is stable up to dt = 1.05 h/c alone
# (theory: riemann#a9), and the light particle of a pair takes it twice over.
IMPACT_SHARE = 0.25


@functools.cache
def make_interface_pressure(dimension: int, precision: str, paper_star: bool) -> Any:
    """Return the `wp.func` interface_pressure(p_i, p_j, own, other, jump, opposed, v, d, r2, tiny) = p* of two phases [Pa].

    Arguments of the function:
        jump: Laplace jump between the two [Pa]
        opposed: scalar product of the directions in which the two see the interface; without meaning for `paper_star`
        v, d, r2: v_i - v_j [m/s], x_i - x_j [m] and its square
    """
    real, vec, _, _ = types(dimension, precision)
    Phase = make_phase(precision)
    _, star_pressure = make_star(precision, paper_star)

    @wp.func
    def interface_pressure(
        p_i: real,
        p_j: real,
        own: Phase,
        other: Phase,
        jump: real,
        opposed: real,
        v: vec,
        d: vec,
        r2: real,
        tiny: real,
    ):
        p_star = star_pressure(p_i, p_j, own.density, other.density, jump)
        if wp.static(not paper_star):
            # Directions that do not oppose: no common interface, one of the two is a splinter of a few particles in the
            # other phase, or a film of one row. Its own phase does not hold it, and the weighted p* is all but its own
            # pressure: without the impact term of the Riemann problem it would fly through the other phase like a bullet.
            alone = wp.clamp(real(1.0) + real(2.0) * opposed, real(0.0), real(2.0))
            z = own.impedance * other.impedance / (own.impedance + other.impedance)
            impact = wp.dot(v, d) / wp.sqrt(r2 + tiny)
            p_star -= (real(IMPACT_SHARE) * alone) * z * impact
        return p_star

    return interface_pressure


class WallTerms(NamedTuple):
    """`wp.func`s of a particle next to a wall, see `make_wall_terms`."""

    pressure: Any
    impedance: Any
    driven: Any


@functools.cache
def make_wall_terms(spec: Spec) -> WallTerms:
    """Return the formulas of a particle next to a wall.

    wall_pressure(p_i, p_wall, rho_i, d, params): pressure of a wall particle as this particle sees it [Pa]
    pressed_impedance(own, rho_i): rho c of a gas at the density that it has [kg/(m^2 s)]
    driven(a, side, speed, into_wall, sound, g_norm, dt): along one axis, what drives the particle into a wall [m/s^2], its
        speed taken up by backward Euler
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)

    @wp.func
    def wall_pressure(p_i: real, p_wall: real, rho_i: real, d: vec, params: Params):
        result = p_wall
        if wp.static(spec.multiphase):
            # the one-sided state of this particle's own fluid: extrapolated from several fluids at a contact
            # line, the wall would pull the light one with the weight of the heavy one
            result = p_i
            if wp.static(spec.gravity):
                result -= rho_i * wp.dot(params.gravity, d)
        return result

    @wp.func
    def pressed_impedance(own: Phase, rho_i: real):
        return own.impedance * wp.pow(rho_i / own.density, real(0.5) * (own.gamma + real(1.0)))

    @wp.func
    def driven(a: real, side: real, speed: real, into_wall: real, sound: real, g_norm: real, dt: real):
        drive = wp.max(a * side, real(0.0))
        ahead = wp.max(speed * side, real(0.0))
        damping = real(2.0) * sound * wp.abs(into_wall) * g_norm
        return drive + ahead * damping / (real(1.0) + damping * dt)

    return WallTerms(wall_pressure, pressed_impedance, driven)


@functools.cache
def make_anisotropy(dimension: int, precision: str) -> Any:
    """Return the `wp.func` anisotropy(strain, moment) [1/s].

    The continuity sweep has tr(G M) instead of tr(G). A strain G draws the arrangement out along itself, so that the moment
    M is not isotropic in just the directions that count: the error, the anisotropy, has one sign.
    """
    real, _, mat, _ = types(dimension, precision)
    axes = float(dimension)

    @wp.func
    def anisotropy(strain: mat, moment: mat):
        return wp.ddot(strain, moment) - wp.trace(strain) * wp.trace(moment) / real(axes)

    return anisotropy
