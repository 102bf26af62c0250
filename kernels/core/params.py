"""Run-time numbers of a run, one struct; changing any of them recompiles nothing."""

import functools
from typing import Any

import warp as wp

from .spec import types

LEAST_DENSITY = 0.9  # rarefaction 1 - rho/rho0 beyond which a run has diverged: its particle stands for ten times its room


@functools.cache
def make_params(dimension: int, precision: str) -> Any:
    """Return the `Params` struct for a dimension and precision (SI units throughout)."""
    real, vec, _, _ = types(dimension, precision)

    @wp.struct
    class Params:
        h: real  # smoothing length [m]
        inv_h: real  # 1/h [1/m]
        g_norm: real  # alpha/h^(d+2), times slope(q) gives W'/r [1/m^(d+2)]
        spacing: real  # particle spacing [m]
        wall_volume: real  # volume of a wall particle [m^d]
        box: vec  # period of each periodic axis [m]
        half_box: vec  # half of it [m]
        gravity: vec  # hydrostatic acceleration [m/s^2]
        body_force: vec  # other uniform acceleration [m/s^2]
        center: vec  # of the central force [m]
        pull: real  # B^2 of the central acceleration -B^2 (x - center) [1/s^2]
        dissipation: real  # factor theta on the pressure difference in the star velocity [-]
        even_slope: real  # sum of |grad W| V over an even lattice [1/m]
        damping: real  # of sound, its bulk viscosity over rho c h [-]
        relaxation_time: real  # in which a part of the pressure fades [s]
        shifting: real  # shifting coefficient A [-]
        shift_cap: real  # longest shift of a step as share of h [-]
        room: real  # rate at which the density follows the room that the particles take, over |grad v| [-]
        inv_window: real  # 1/R^2 of the window that the room is measured with, a power of 1 - r^2/R^2 [1/m^2]
        window_norm: real  # 1 over its integral; power 4 in the Riemann scheme, else 2 [1/m^d]
        feedback: real  # share of an excess of the density that is let go in the time h/u_max [-]
        filter: real  # rate at which the velocity is smoothed, over |grad u| [-]
        disorder: real  # friction of disorder over |grad v| h [-]
        zeta: real  # interface force coefficient [-]
        tiny: real  # (1e-6 h)^2, keeps divisions by r^2 finite [m^2]

    return Params


@functools.cache
def make_phase(precision: str) -> Any:
    """Return the `Phase` struct (properties of one fluid phase) for a precision."""
    real, _, _, _ = types(2, precision)

    @wp.struct
    class Phase:
        density: real  # reference density rho0 [kg/m^3]
        sound_speed: real  # c [m/s]
        gamma: real  # exponent of the equation of state [-]
        stiffness: real  # B = rho0 c^2 / gamma [Pa]
        background: real  # background pressure p0 [Pa]
        viscosity: real  # dynamic viscosity mu [Pa s]
        impedance: real  # Z = rho0 c [kg/(m^2 s)]
        resistance: real  # Z + 2 mu/dx, pressure that a speed meets between two particles [kg/(m^2 s)]
        compressibility: real  # 1/(rho0 c^2) [1/Pa]
        mobility: real  # theta over the resistance, star velocity for a pressure difference [m/(s Pa)]
        most_excess: real  # density excess beyond which a run has diverged [-]

    return Phase
