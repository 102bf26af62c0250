"""What stops a particle that comes near a wall (theory: delta#d6).

Spray has no neighbours whose density would rise before a wall. A particle that has lost half of the place of its row takes
no acceleration into the surface, and what speed it has towards it is braked within a step.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.spec import Spec, types_of

TOUCH, STOP = 0.25, 0.1  # gaps [spacings] at which a particle begins to touch a surface, and at which it is stopped


class Contact(NamedTuple):
    """`wp.func`s of contact.

    Attributes:
        touch_of: touch_of(gap, spacing), 0 away from the surface, 1 where a particle is stopped.
        braked: braked(a, approach, normal, share, rate, dt), the acceleration with the contact of a surface.
        braked_by_cells: braked_by_cells(a, v, gap, side, speed, spacing, rate, dt), that with cells of walls.
        held_by_cells: held_by_cells(dx, gap, side, spacing), a shift that does not go into cells that are touched.
    """

    touch_of: Any
    braked: Any
    braked_by_cells: Any
    held_by_cells: Any


@functools.cache
def make_contact_of(spec: Spec) -> Contact:
    """Return the `wp.func`s of contact.

    Arguments of the functions:
        a: acceleration [m/s^2]; dx: a shift [m]; dt: time step [s]
        approach: speed towards the surface [m/s]; normal: into the fluid
        rate: at which pairs with the wall take up speed [1/s]
        gap, side, speed: by axis, clearance to the cell straight ahead [m], 1 if that is below and -1 if it is above, and
            its speed along the axis [m/s]
    """
    real, vec, _, _ = types_of(spec)

    @wp.func
    def touch_of(gap: real, spacing: real):
        return wp.clamp((real(TOUCH) - gap / spacing) / real(wp.static(TOUCH - STOP)), real(0.0), real(1.0))

    @wp.func
    def braked(a: vec, approach: real, normal: vec, share: real, rate: real, dt: real):
        drive = wp.max(-wp.dot(a, normal), real(0.0))
        brake = wp.max(approach, real(0.0)) * rate / (real(1.0) + rate * dt)  # backward Euler: it is not thrown back
        return a + (share * (drive + brake)) * normal

    @wp.func
    def braked_by_cells(a: vec, v: vec, gap: vec, side: vec, speed: vec, spacing: real, rate: real, dt: real):
        result = a
        for axis in range(wp.static(spec.dimension)):
            share = touch_of(gap[axis], spacing)
            if share > real(0.0):
                normal = vec()
                normal[axis] = side[axis]
                result = braked(result, (speed[axis] - v[axis]) * side[axis], normal, share, rate, dt)
        return result

    @wp.func
    def held_by_cells(dx: vec, gap: vec, side: vec, spacing: real):
        result = dx
        for axis in range(wp.static(spec.dimension)):
            if dx[axis] * side[axis] < real(0.0):
                result[axis] -= touch_of(gap[axis], spacing) * dx[axis]
        return result

    return Contact(touch_of, braked, braked_by_cells, held_by_cells)
