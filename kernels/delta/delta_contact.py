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
        braked: braked(a, v, gap, speed, normal, spacing, rate, dt), an acceleration with the contact of all surfaces.
        held: held(dx, gap, normal, spacing), a shift that does not go into surfaces that are touched.
        ahead: ahead(gap, foot2, nearest2, body2, spacing), the gaps of surfaces with feet at the distances sqrt(foot2), a
            spacing for those that are neither ahead nor the nearest of all, at sqrt(nearest2), nor of bodies alone, at
            sqrt(body2): beside a convex edge the plane of its other face is none that the particle is about to touch.
    """

    braked: Any
    held: Any
    ahead: Any


@functools.cache
def make_contact_of(spec: Spec) -> Contact:
    """Return the `wp.func`s of contact.

    A particle may touch as many surfaces of bodies at once as there are axes, and as many sides of the domain: the floor,
    whose foot may stay the nearest, and the body that it runs into. A slope may lie nearest to the axis of the floor.

    Arguments of the functions:
        a: acceleration [m/s^2]; v: velocity [m/s]; dx: a shift [m]; dt: time step [s]
        gap, speed: of each surface, its distance [m] and its speed along its normal [m/s]
        normal: in each row that of a surface, into the fluid; 0 where there is none
        rate: at which pairs with the wall take up speed [1/s]
    """
    real, vec, mat, _ = types_of(spec)

    @wp.func
    def touch_of(gap: real, spacing: real):
        return wp.clamp((real(TOUCH) - gap / spacing) / real(wp.static(TOUCH - STOP)), real(0.0), real(1.0))

    @wp.func
    def braked(a: vec, v: vec, gap: vec, speed: vec, normal: mat, spacing: real, rate: real, dt: real):
        result = a
        for axis in range(wp.static(spec.dimension)):
            n_w = normal[axis]
            drive = wp.max(-wp.dot(result, n_w), real(0.0))
            approach = wp.max(speed[axis] - wp.dot(v, n_w), real(0.0))
            brake = approach * rate / (real(1.0) + rate * dt)  # backward Euler: it is not thrown back
            result += (touch_of(gap[axis], spacing) * (drive + brake)) * n_w
        return result

    @wp.func
    def held(dx: vec, gap: vec, normal: mat, spacing: real):
        result = dx
        for axis in range(wp.static(spec.dimension)):
            n_w = normal[axis]
            result -= (touch_of(gap[axis], spacing) * wp.min(wp.dot(result, n_w), real(0.0))) * n_w
        return result

    @wp.func
    def ahead(gap: vec, foot2: vec, nearest2: real, body2: real, spacing: real):
        result = gap
        for axis in range(wp.static(spec.dimension)):
            across2 = foot2[axis] - gap[axis] * gap[axis]  # of the way to the foot, along the surface
            # farther than half a cell along each of its axes
            beside = across2 > real(wp.static(0.25 * (spec.dimension - 1))) * spacing * spacing
            first = foot2[axis] == nearest2 or foot2[axis] == body2
            if not first and (beside or gap[axis] < real(-TOUCH) * spacing):
                result[axis] = spacing
        return result

    return Contact(braked, held, ahead)
