"""Stages that evaluate what depends on time: one thread for all signals, then walls that slide (theory: common#signals)."""

import functools
from typing import Any

import warp as wp

from .clock import STEP, TIME
from .poses import MIDDLE, make_pose, make_pose_of
from .spec import Spec, types_of
from .time_signals import BODY_NEXT, GRAVITY_NEXT, GRAVITY_NOW, make_signal_at


@functools.cache
def make_signals(spec: Spec) -> Any:
    """Return the one-thread kernel that evaluates all signals for the step that begins.

    share: at which part of the step walls have the velocity that is wanted.
    ahead: 1 for that step; 0 leaves it out, so that all is that of the present time, the end of the step before.
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
        ahead: wp.float64,
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
        step = ahead * clock[STEP]
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
