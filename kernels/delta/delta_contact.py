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
    """

    braked: Any
    held: Any


@functools.cache
def make_contact_of(spec: Spec) -> Contact:
    """Return the `wp.func`s of contact.

    A particle may touch as many surfaces at once as there are axes: the floor, and the body that it runs into.

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

    return Contact(braked, held)
