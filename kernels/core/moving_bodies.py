"""Bodies that move as they are told: pose of each, and from it place, velocity, normal, acceleration of their particles.

    x = pivot + s(t) + R(a(t)) (X - pivot),    R' = a' K R,    R'' = (a'' K + a'^2 K K) R

X is where the particle stood at time 0 (`home`), s the translation, a the angle and K the cross product with the axis
(theory: common#motion). All of it is float64 until it is stored. A particle of a wall that moves has, like one of the fluid,
the anchor of the last list build and a way since, which the list watches.
"""

import functools
from typing import Any

import warp as wp

from .clock import MAXIMA
from .params import make_params
from .spec import Spec, types_of

MIDDLE, NEXT = 0, 1  # levels of time of a pose: within the step that begins, at its end


@functools.cache
def make_pose() -> Any:
    """Return the `Pose` struct of a body at a time."""

    @wp.struct
    class Pose:
        pivot: wp.vec3d  # at time 0 [m]
        place: wp.vec3d  # where the pivot is [m]
        velocity: wp.vec3d  # of the pivot [m/s]
        acceleration: wp.vec3d  # of the pivot [m/s^2]
        turn: wp.mat33d  # R [-]
        turn_rate: wp.mat33d  # R' [1/s]
        turn_push: wp.mat33d  # R'' [1/s^2]
        spin: wp.vec3d  # angular velocity [rad/s]

    return Pose


@functools.cache
def make_pose_of() -> Any:
    """Return the `wp.func` pose_of(pivot, axis, way, speed, push, angle).

    way, speed, push: translation and its derivatives; angle: (integral, angle, first and second derivative) about the axis.
    """
    Pose = make_pose()

    @wp.func
    def pose_of(pivot: wp.vec3d, axis: wp.vec3d, way: wp.vec3d, speed: wp.vec3d, push: wp.vec3d, angle: wp.vec4d):
        k = wp.skew(axis)
        kk = k * k
        one = wp.identity(n=3, dtype=wp.float64)
        turn = one + wp.sin(angle[1]) * k + (wp.float64(1.0) - wp.cos(angle[1])) * kk
        pose = Pose()
        pose.pivot = pivot
        pose.place = pivot + way
        pose.velocity = speed
        pose.acceleration = push
        pose.turn = turn
        pose.turn_rate = angle[2] * k * turn
        pose.turn_push = (angle[3] * k + angle[2] * angle[2] * kk) * turn
        pose.spin = angle[2] * axis
        return pose

    return pose_of


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


@functools.cache
def make_velocity_at(spec: Spec) -> Any:
    """Return the `wp.func` velocity_at(v, arm, body, body_motion, poses): velocity of a body at `arm` from a point with v.

    body: number of the wall body. That of a body that does not turn is v everywhere.
    """
    real, vec, _, _ = types_of(spec)
    Pose = make_pose()
    dimension = spec.dimension

    @wp.func
    def velocity_at(v: vec, arm: vec, body: int, body_motion: wp.array(dtype=int), poses: wp.array(dtype=Pose)):
        result = v + vec()
        k = body_motion[body]
        if k >= 0:
            wide = wp.vec3d()
            for axis in range(wp.static(dimension)):
                wide[axis] = wp.float64(arm[axis])
            more = wp.cross(poses[MIDDLE * (poses.shape[0] / 2) + k].spin, wide)
            for axis in range(wp.static(dimension)):
                result[axis] = v[axis] + real(more[axis])
        return result

    return velocity_at
