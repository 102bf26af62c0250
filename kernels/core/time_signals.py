"""Signals on the device: what depends on time, evaluated by one thread in each step (theory: common#signals).

A signal is a piecewise polynomial in float64 (`warpsph/scene/signal_tables.py`). All signals of a run stand one behind the
other, in this order: the components of gravity, of the body force, of the velocity of each side of the domain, then of each
body that moves the components of its translation, and its angle.
The stage `signals` opens a step from t to t + dt and writes

    forcing         gravity at t, gravity and body force at t + dt, the body force where no wall bears it (`held`)
    impulse         integral of gravity and body force from time 0 to the middle of the step
    side_velocity   of each side of the domain at t + share dt
    poses           where each body is at t + share dt, and then where each is at t + dt (`poses`)

Whatever a scheme does at which time reads the entry of that time: in the leapfrog the pressures that the continuity sweep
compares are those of t, the forces of the momentum sweep those of t + dt, and walls move, like the fluid beside them, with
their velocity in the middle of the step; the projection takes all at t + dt. So the order in time is that of the scheme.
"""

import functools
from typing import Any

import warp as wp

from .params import make_params
from .spec import Spec, types_of

TERMS = 6  # coefficients of a piece; its integral from time 0 to its begin follows them
GRAVITY_NOW, GRAVITY_NEXT, BODY_NEXT = 0, 1, 2  # entries of `forcing`
FORCING_SIZE = 3
ARRAYS = frozenset({"forcing", "impulse", "side_velocity", "poses", "body_pivot", "body_axis", "body_motion"})
"""arrays that are there where something depends on time"""


def depends_on_time(spec: Spec) -> bool:
    """Whether a run has signals."""
    return spec.varying_force or spec.varying_sides or spec.moving


@functools.cache
def make_signal_at() -> Any:
    """Return the `wp.func` signal_at(k, t, signal_first, signal_begin, signal_terms) of the k-th signal at time t [s].

    The result: (integral from time 0, value, first and second derivative).
    """

    @wp.func
    def signal_at(
        k: int,
        time: wp.float64,
        signal_first: wp.array(dtype=int),
        signal_begin: wp.array(dtype=wp.float64),
        signal_terms: wp.array2d(dtype=wp.float64),
    ):
        low = signal_first[k]
        high = signal_first[k + 1] - 1
        while low < high:
            middle = (low + high + 1) / 2
            if signal_begin[middle] <= time:
                low = middle
            else:
                high = middle - 1
        s = time - signal_begin[low]
        total = wp.float64(0.0)
        value = wp.float64(0.0)
        rate = wp.float64(0.0)
        second = wp.float64(0.0)
        for n in range(TERMS):
            m = TERMS - 1 - n
            c = signal_terms[low, m]
            second = second * s + wp.float64(2.0) * rate
            rate = rate * s + value
            value = value * s + c
            total = (total + c / wp.float64(m + 1)) * s
        return wp.vec4d(signal_terms[low, TERMS] + total, value, rate, second)

    return signal_at


@functools.cache
def make_forcing(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s gravity_of(params, forcing, when) and body_force_of(params, forcing) [m/s^2].

    when: GRAVITY_NOW or GRAVITY_NEXT. Without `varying_force` they are those of `params`.
    """
    vec = types_of(spec).vec
    Params = make_params(spec.dimension, spec.precision)

    @wp.func
    def gravity_of(params: Params, forcing: wp.array(dtype=vec), when: int):
        if wp.static(spec.varying_force):
            return forcing[when]
        else:
            return params.gravity

    @wp.func
    def body_force_of(params: Params, forcing: wp.array(dtype=vec)):
        if wp.static(spec.varying_force):
            return forcing[BODY_NEXT]
        else:
            return params.body_force

    return gravity_of, body_force_of
