"""What stops a particle that comes near the surface of a body (theory: delta#d6).

Spray has no neighbours whose density would rise before a wall. A particle that has lost half of the place of its row takes
no acceleration into the surface, and what speed it has towards it is braked within a step.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.spec import Spec, types_of

TOUCH, STOP = 0.25, 0.1  # gaps [spacings] at which a particle begins to touch a surface, and at which it is stopped


@functools.cache
def make_contact_of(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s touch_of(gap, spacing) in 0..1 and braked(a, approach, normal, share, rate, dt).

    braked: acceleration a [m/s^2] with the contact. approach: speed towards the surface [m/s]; normal: into the fluid;
    rate: at which a pair with the wall takes up speed [1/s].
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

    return touch_of, braked
