"""The velocity that friction on a wall sees, of a particle over the mirror of a wall that it sticks to or slides along.

    sticks: v_i - v~                        slides: n n.(v_i - v~) + (S n)_t (n.x_iw)

Along a wall without friction each particle sees its own velocity, and not that of a fit: a straight line through a velocity
that bends before the wall ends beyond it, and would pull the fluid on (theory: riemann#slide). (S n)_t is what the velocity
along a curved wall changes by across it where it bears no shear stress, v_t/R; at a plane it is next to nothing.
"""

import functools
from typing import Any

import warp as wp

from .spec import Spec, types_of


@functools.cache
def make_curving(spec: Spec) -> Any:
    """Return the `wp.func` curving(w, slip, slip_slope): (S n)_t of a wall without friction [1/s], 0 where fluid sticks."""
    _, vec, _, _ = types_of(spec)

    @wp.func
    def curving(w: int, slip: wp.array(dtype=wp.uint8), slip_slope: wp.array(dtype=vec)):
        if wp.static(spec.wall_no_slip):
            if slip[w] == wp.uint8(0):
                return vec()
        return slip_slope[w]

    return curving


@functools.cache
def make_curved_slide(spec: Spec) -> Any:
    """Return the `wp.func` curved_slide(w, x_iw, slip, wall_normal, slip_slope): along curved walls that it slides on."""
    _, vec, _, _ = types_of(spec)
    curving = make_curving(spec)

    @wp.func
    def curved_slide(
        w: int,
        d: vec,
        slip: wp.array(dtype=wp.uint8),
        wall_normal: wp.array(dtype=vec),
        slip_slope: wp.array(dtype=vec),
    ):
        return wp.dot(wall_normal[w], d) * curving(w, slip, slip_slope)

    return curved_slide


@functools.cache
def make_friction_slide(spec: Spec) -> Any:
    """Return the `wp.func` friction_slide(w, v_i, v~, x_iw, slip, wall_normal, slip_slope): the difference [m/s]."""
    real, vec, _, _ = types_of(spec)
    fitted = spec.bodies and not spec.multiphase
    curved_slide = make_curved_slide(spec)

    @wp.func
    def friction_slide(
        w: int,
        vi: vec,
        mirror: vec,
        d: vec,
        slip: wp.array(dtype=wp.uint8),
        wall_normal: wp.array(dtype=vec),
        slip_slope: wp.array(dtype=vec),
    ):
        slide = vi - mirror
        if wp.static(fitted):
            slips = bool(True)
            if wp.static(spec.wall_no_slip):
                slips = slip[w] != wp.uint8(0)
            if slips:
                n = wall_normal[w]
                slide = wp.dot(slide, n) * n + curved_slide(w, d, slip, wall_normal, slip_slope)
        return slide

    return friction_slide
