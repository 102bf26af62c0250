"""The pressure by which compression and expansion damp sound (theory: riemann#damping)."""

import functools
from typing import Any

import warp as wp

from .params import make_params, make_phase
from .spec import Spec, types_of

LOUDEST = 0.01  # of rho c^2, the pressure of compression that sound speeds are made for: damping goes up to it


@functools.cache
def make_damping(spec: Spec) -> Any:
    """Return the `wp.func` damping(rate of the density excess, params, phase): the pressure that damps sound [Pa]."""
    real = types_of(spec).real
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)

    @wp.func
    def damping(rate: real, params: Params, own: Phase):
        if wp.static(not spec.acoustic_damping):
            return real(0.0)
        loudest = real(LOUDEST) * own.impedance * own.sound_speed
        return wp.clamp(params.damping * params.h * own.impedance * rate, -loudest, loudest)

    return damping
