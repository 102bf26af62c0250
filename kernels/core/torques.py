"""Torque of the force on each wall particle (theory: riemann#bodies)."""

import functools
from typing import Any

import warp as wp

from .params import make_params
from .spec import types


@functools.cache
def make_couple(dimension: int, precision: str) -> Any:
    """Return the `wp.func` couple_of(arm, force), the torque [N m]; in 2-D, per metre of depth, its first component."""
    _, vec, _, _ = types(dimension, precision)

    @wp.func
    def couple_of(arm: vec, force: vec):
        turned = vec()
        if wp.static(dimension == 3):
            turned = wp.cross(arm, force)
        else:
            turned[0] = arm[0] * force[1] - arm[1] * force[0]
        return turned

    return couple_of


@functools.cache
def make_load_torque(dimension: int, precision: str) -> Any:
    """Return the kernel over wall particles that writes the torque of the force on each about the pivot of its body [N m].

    In 2-D, per metre of depth, it is the first component, the other is 0. `couple` is what the torque has beyond that of the
    force at the foot; `twist` has a torque, but is no part of the force.
    """
    real, vec, _, _ = types(dimension, precision)
    Params = make_params(dimension, precision)
    couple_of = make_couple(dimension, precision)

    @wp.kernel(module="unique", enable_backward=False)
    def load_torque(
        first: int,
        fluid_count: int,
        params: Params,
        position: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_body: wp.array(dtype=int),
        pivots: wp.array(dtype=vec),
        load: wp.array(dtype=vec),
        twist: wp.array(dtype=vec),
        couple: wp.array(dtype=vec),
        torque: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        arm = position[w + fluid_count] + wall_normal[w] * wall_depth[w] - pivots[wall_body[w] - 1]
        for axis in range(wp.static(dimension)):
            # lists take what is beyond a periodic side to the other one
            period = params.box[axis]
            if period > real(0.0):
                arm[axis] = arm[axis] - period * wp.floor(arm[axis] / period + real(0.5))
        torque[w] = couple_of(arm, load[w] + twist[w]) + couple[w]

    return load_torque
