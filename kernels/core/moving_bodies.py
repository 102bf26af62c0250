"""Stage that brings the wall particles of moving bodies to where these are (theory: common#motion).

A particle of a body that moves has, like one of the fluid, the anchor of the last list build and a way since, which the list
watches. Its place is computed from that at time 0 (`home`), in float64, not summed up.
"""

import functools
from typing import Any

import warp as wp

from .clock import MAXIMA
from .params import make_params
from .poses import make_pose
from .spec import Spec, types_of


@functools.cache
def make_move_bodies(spec: Spec) -> Any:
    """Return the kernel over wall particles that brings those of moving bodies to where they are at a level of time.

    level: MIDDLE or NEXT.
    speed: 1 writes the velocity too.
    closing: 1 writes normal and acceleration, and reports speed, acceleration and way to the clock.
    body_motion: by number of a wall body, which of the poses it has, -1 for one that does not move.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Pose = make_pose()
    dimension = spec.dimension
    periodic = any(spec.periodic)

    @wp.func
    def wide(x: vec):
        result = wp.vec3d()
        for axis in range(wp.static(dimension)):
            result[axis] = wp.float64(x[axis])
        return result

    @wp.func
    def narrow(x: wp.vec3d):
        result = vec()
        for axis in range(wp.static(dimension)):
            result[axis] = real(x[axis])
        return result

    @wp.kernel(module="unique", enable_backward=False)
    def move_bodies(
        first: int,
        slot: int,
        level: int,
        speed: int,
        closing: int,
        fluid_count: int,
        params: Params,
        body_motion: wp.array(dtype=int),
        poses: wp.array(dtype=Pose),
        wall_body: wp.array(dtype=int),
        home: wp.array(dtype=vec),
        home_normal: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        wall_normal: wp.array(dtype=vec),
        wall_acceleration: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
    ):
        w = wp.tid() + first
        body = body_motion[wall_body[w]]
        if body < 0:
            return
        i = w + fluid_count
        pose = poses[level * (poses.shape[0] / 2) + body]
        arm = wide(home[w]) - pose.pivot
        x = narrow(pose.place + pose.turn * arm)
        if wp.static(periodic):
            # the image that is next to where the list found it
            for axis in range(wp.static(dimension)):
                period = params.box[axis]
                if period > real(0.0):
                    x[axis] = x[axis] + period * wp.floor((anchor[i][axis] - x[axis]) / period + real(0.5))
        position[i] = x
        v = narrow(pose.velocity + pose.turn_rate * arm)
        if speed == 1:
            velocity[i] = v
        if closing == 1:
            a = narrow(pose.acceleration + pose.turn_push * arm)
            wall_acceleration[w] = a
            wall_normal[w] = narrow(pose.turn * wide(home_normal[w]))
            way = x - anchor[i]
            v2 = wp.dot(v, v)
            a2 = wp.dot(a, a)
            o2 = wp.dot(way, way)
            if v2 > maxima[slot * MAXIMA]:
                wp.atomic_max(maxima, slot * MAXIMA, v2)
            if a2 > maxima[slot * MAXIMA + 1]:
                wp.atomic_max(maxima, slot * MAXIMA + 1, a2)
            if o2 > maxima[slot * MAXIMA + 2]:
                wp.atomic_max(maxima, slot * MAXIMA + 2, o2)

    return move_bodies
