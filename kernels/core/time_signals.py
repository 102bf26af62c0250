"""Signals on the device: what depends on time, evaluated by one thread in each step (theory: common#signals).

A signal is a piecewise polynomial in float64 (`warpsph/scene/signal_tables.py`). All signals of a run stand one behind the
other, in this order: the components of gravity, of the body force, of the velocity of each side of the domain, then of each
body that moves the components of its translation, and its angle.
The stage `signals` opens a step from t to t + dt and writes

    forcing         gravity at t, gravity and body force at t + dt, the body force where no wall bears it (`held`)
    impulse         integral of gravity and body force from time 0 to the middle of the step
    side_velocity   of each side of the domain at t + share dt
    poses           where each body is at t + share dt, and then where each is at t + dt (`moving_bodies`)

Whatever a scheme does at which time reads the entry of that time: in the leapfrog the pressures that the continuity sweep
compares are those of t, the forces of the momentum sweep those of t + dt, and walls move, like the fluid beside them, with
their velocity in the middle of the step; the projection takes all at t + dt. So the order in time is that of the scheme.
"""

import functools
from typing import Any

import warp as wp

from .clock import STEP, TIME
from .moving_bodies import MIDDLE, make_pose, make_pose_of
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
def make_signals(spec: Spec) -> Any:
    """Return the one-thread kernel that evaluates all signals for the step that begins.

    share: at which part of the step walls have the velocity that is wanted.
    held: 1 on axes along which walls bear a body force, so that it counts as gravity; else 0.
    """
    real, vec, _, _ = types_of(spec)
    dimension = spec.dimension
    signal_at = make_signal_at()
    Pose = make_pose()
    pose_of = make_pose_of()

    @wp.kernel(module="unique", enable_backward=False)
    def signals(
        share: wp.float64,
        held: vec,
        clock: wp.array(dtype=wp.float64),
        signal_first: wp.array(dtype=int),
        signal_begin: wp.array(dtype=wp.float64),
        signal_terms: wp.array2d(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        impulse: wp.array(dtype=wp.float64),
        side_velocity: wp.array(dtype=vec),
        body_pivot: wp.array(dtype=wp.vec3d),
        body_axis: wp.array(dtype=wp.vec3d),
        poses: wp.array(dtype=Pose),
    ):
        now = clock[TIME]
        step = clock[STEP]
        if wp.static(spec.varying_force):
            before = vec()
            after = vec()
            body = vec()
            middle = now + wp.float64(0.5) * step
            for axis in range(wp.static(dimension)):
                other = wp.static(dimension) + axis
                borne = wp.float64(held[axis])
                force = signal_at(other, now + step, signal_first, signal_begin, signal_terms)[1]
                force_now = signal_at(other, now, signal_first, signal_begin, signal_terms)[1]
                g = signal_at(axis, now + step, signal_first, signal_begin, signal_terms)[1]
                g_now = signal_at(axis, now, signal_first, signal_begin, signal_terms)[1]
                before[axis] = real(g_now + borne * force_now)
                after[axis] = real(g + borne * force)
                body[axis] = real((wp.float64(1.0) - borne) * force)
                impulse[axis] = (
                    signal_at(axis, middle, signal_first, signal_begin, signal_terms)[0]
                    + signal_at(other, middle, signal_first, signal_begin, signal_terms)[0]
                )
            forcing[GRAVITY_NOW] = before
            forcing[GRAVITY_NEXT] = after
            forcing[BODY_NEXT] = body
        if wp.static(spec.varying_sides):
            moment = now + share * step
            for side in range(wp.static(2 * dimension)):
                v = vec()
                for axis in range(wp.static(dimension)):
                    k = wp.static(2 * dimension) + side * wp.static(dimension) + axis
                    v[axis] = real(signal_at(k, moment, signal_first, signal_begin, signal_terms)[1])
                side_velocity[side] = v
        if wp.static(spec.moving):
            count = body_pivot.shape[0]
            for body in range(count):
                base = wp.static(2 * dimension * (1 + dimension)) + body * wp.static(dimension + 1)
                for level in range(2):
                    moment = now + step
                    if level == MIDDLE:
                        moment = now + share * step
                    way = wp.vec3d()
                    speed = wp.vec3d()
                    push = wp.vec3d()
                    for axis in range(wp.static(dimension)):
                        found = signal_at(base + axis, moment, signal_first, signal_begin, signal_terms)
                        way[axis] = found[1]
                        speed[axis] = found[2]
                        push[axis] = found[3]
                    angle = signal_at(base + wp.static(dimension), moment, signal_first, signal_begin, signal_terms)
                    poses[level * count + body] = pose_of(body_pivot[body], body_axis[body], way, speed, push, angle)

    return signals


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


@functools.cache
def make_move_sides(spec: Spec) -> Any:
    """Return the kernel over wall particles behind sides that gives them the velocity of those sides.

    Along each axis that is the mean of the sides that can have one, those whose normal is another axis. Which sides a
    particle is behind are the bits of `wall_sides`, 2 axis for the lower and 2 axis + 1 for the upper one.
    """
    real, vec, _, _ = types_of(spec)
    dimension = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def move_sides(
        first: int,
        fluid_count: int,
        wall_sides: wp.array(dtype=wp.uint8),
        side_velocity: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        sides = int(wall_sides[w])
        if sides == 0:
            return
        v = vec()
        for axis in range(wp.static(dimension)):
            total = real(0.0)
            count = real(0.0)
            for side in range(wp.static(2 * dimension)):
                if side / 2 != axis and ((sides >> side) & 1) == 1:
                    total += side_velocity[side][axis]
                    count += real(1.0)
            v[axis] = total / wp.max(count, real(1.0))
        velocity[w + fluid_count] = v

    return move_sides
