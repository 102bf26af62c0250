"""Where a body that moves is at a time: its pose, and what follows for its points (theory: common#motion).

    x = pivot + s(t) + R(a(t)) (X - pivot),    R' = a' K R,    R'' = (a'' K + a'^2 K K) R

X is where a point is at time 0, s the translation, a the angle and K the cross product with the axis. All of it is float64.
"""

import functools
from typing import Any

import warp as wp

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
