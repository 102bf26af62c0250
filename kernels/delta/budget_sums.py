"""The budget of momentum and energy: sums over the particles in every step, added up over time (theory: delta#budget).

A part of the acceleration a_c has, at one moment, the force sum m a_c, the power sum m a_c.v and sum m a_c.a. The leapfrog
kicks by half a step before and half a step behind that moment, by which the kinetic energy changes by

    dt/2 sum m a_c.v -+ dt^2/8 sum m a_c.a,    - of the kick that ends at that moment, + of the one that begins there,

exactly, so that what is added up differs from what kinetic energy and momentum do by rounding alone.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.block_sums import FOLDS
from warpsph.kernels.core.clock import STEP
from warpsph.kernels.core.params import make_phase
from warpsph.kernels.core.spec import Spec, types_of

# names of the terms, rows of the arrays, in the order of `warpsph.case.budget_terms`
KICKS = (
    "pressure",
    "tension_control",
    "viscosity",
    "artificial_viscosity",
    "wall_pressure",
    "wall_friction",
    "contact",
    "gravity",
    "body_force",
)
CHANGES = ("exact_divergence", "density_diffusion", "shift", "volume_constraint", "room", "spray", "lift")
TERMS = (*KICKS, *CHANGES)
EXACT, DIFFUSION, SHIFT, VOLUME, ROOM, SPRAY, LIFT = (TERMS.index(name) for name in CHANGES)
PRESSURE, WALL_PRESSURE = TERMS.index("pressure"), TERMS.index("wall_pressure")
BLOCKS = {True: 256, False: 16384}  # partial sums, on a CPU and on a GPU

Sum = wp.types.vector(length=5, dtype=wp.float64)  # momentum (3), energy, and the square of the kick


@functools.cache
def make_budget_sums(spec: Spec) -> tuple[Any, Any, Any]:
    """Return the kernels (sum_budget over blocks, fold_budget over FOLDS, close_budget on one thread).

    Float64 sums in a fixed order: the result does not depend on how many threads work on it. Arrays of one row a term:
    `budget_force` force and power of the last step, `budget_work` impulse and work since the start, `budget_kick` what the
    next half kick starts from, `budget_change` the same of what is not a kick.
    """
    real, vec, _, _ = types_of(spec)
    Phase = make_phase(spec.precision)
    terms = len(TERMS)
    dimension = spec.dimension
    carries = spec.shift_form == "consistent"

    @wp.func
    def kick_of(part: vec, v: wp.vec3d, a: wp.vec3d, mass: wp.float64):
        f = wp.vec3d()
        for axis in range(wp.static(dimension)):
            f[axis] = mass * wp.float64(part[axis])
        return Sum(f[0], f[1], f[2], wp.dot(f, v), wp.dot(f, a))

    @wp.func
    def gain_of(energy: real):
        zero = wp.float64(0.0)
        return Sum(zero, zero, zero, wp.float64(energy), zero)

    @wp.kernel(module="unique", enable_backward=False)
    def sum_budget(
        first: int,
        closing: int,
        fluid_count: int,
        clock: wp.array(dtype=wp.float64),
        phases: wp.array(dtype=Phase),
        velocity: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        budget_pressure: wp.array(dtype=vec),
        budget_tension: wp.array(dtype=vec),
        budget_viscous: wp.array(dtype=vec),
        budget_artificial: wp.array(dtype=vec),
        budget_wall: wp.array(dtype=vec),
        budget_friction: wp.array(dtype=vec),
        budget_contact: wp.array(dtype=vec),
        budget_gravity: wp.array(dtype=vec),
        budget_body: wp.array(dtype=vec),
        budget_flow: wp.array(dtype=real),
        budget_wall_flow: wp.array(dtype=real),
        budget_exact: wp.array(dtype=real),
        budget_diffusion: wp.array(dtype=real),
        budget_shift: wp.array(dtype=real),
        budget_volume: wp.array(dtype=real),
        budget_room: wp.array(dtype=real),
        budget_spray: wp.array(dtype=real),
        budget_lift: wp.array(dtype=real),
        budget_sums: wp.array2d(dtype=Sum),
        budget_changes: wp.array2d(dtype=Sum),
    ):
        block = wp.tid() + first
        for term in range(terms):
            budget_sums[block, term] = Sum()
            budget_changes[block, term] = Sum()
        k = block
        step = budget_sums.shape[0]
        end = fluid_count
        if wp.static(spec.row_list):
            chunk = (fluid_count + step - 1) / step
            k = block * chunk
            end = wp.min(k + chunk, fluid_count)
            step = 1
        # the velocity is half a step behind: at a start by none
        ahead = wp.float64(0.5) * clock[STEP] * wp.float64(closing)
        while k < end:
            mass = wp.float64(phases[0].density) * wp.float64(rest_volume[k])
            v = wp.vec3d()
            a = wp.vec3d()
            c = wp.vec3d()
            for axis in range(wp.static(dimension)):
                a[axis] = wp.float64(acceleration[k][axis])
                v[axis] = wp.float64(velocity[k][axis]) + ahead * a[axis]
                if wp.static(carries):
                    c[axis] = mass * wp.float64(carried[k][axis])
            budget_sums[block, 0] += kick_of(budget_pressure[k], v, a, mass)
            budget_sums[block, 1] += kick_of(budget_tension[k], v, a, mass)
            budget_sums[block, 2] += kick_of(budget_viscous[k], v, a, mass)
            budget_sums[block, 3] += kick_of(budget_artificial[k], v, a, mass)
            budget_sums[block, 4] += kick_of(budget_wall[k], v, a, mass)
            budget_sums[block, 5] += kick_of(budget_friction[k], v, a, mass)
            budget_sums[block, 6] += kick_of(budget_contact[k], v, a, mass)
            budget_sums[block, 7] += kick_of(budget_gravity[k], v, a, mass)
            budget_sums[block, 8] += kick_of(budget_body[k], v, a, mass)
            if closing == 1:
                budget_changes[block, PRESSURE] += gain_of(budget_flow[k])
                budget_changes[block, WALL_PRESSURE] += gain_of(budget_wall_flow[k])
                budget_changes[block, EXACT] += gain_of(budget_exact[k])
                budget_changes[block, DIFFUSION] += gain_of(budget_diffusion[k])
                budget_changes[block, SHIFT] += Sum(c[0], c[1], c[2], wp.float64(budget_shift[k]), wp.float64(0.0))
                budget_changes[block, VOLUME] += gain_of(budget_volume[k])
                budget_changes[block, ROOM] += gain_of(budget_room[k])
                budget_changes[block, SPRAY] += gain_of(budget_spray[k])
                budget_changes[block, LIFT] += gain_of(budget_lift[k])
            k += step

    @wp.kernel(module="unique", enable_backward=False)
    def fold_budget(
        first: int,
        budget_sums: wp.array2d(dtype=Sum),
        budget_changes: wp.array2d(dtype=Sum),
        budget_folds: wp.array2d(dtype=Sum),
    ):
        fold = wp.tid() + first
        for term in range(terms):
            total = Sum()
            change = Sum()
            k = fold
            while k < budget_sums.shape[0]:
                total += budget_sums[k, term]
                change += budget_changes[k, term]
                k += FOLDS
            budget_folds[fold, term] = total
            budget_folds[fold, terms + term] = change

    @wp.kernel(module="unique", enable_backward=False)
    def close_budget(
        closing: int,
        clock: wp.array(dtype=wp.float64),
        budget_folds: wp.array2d(dtype=Sum),
        budget_kick: wp.array(dtype=Sum),
        budget_work: wp.array(dtype=Sum),
        budget_force: wp.array(dtype=Sum),
    ):
        half = wp.float64(0.5) * clock[STEP]
        square = wp.float64(0.5) * half * half
        for term in range(terms):
            new = Sum()
            change = Sum()
            for fold in range(FOLDS):
                new += budget_folds[fold, term]
                change += budget_folds[fold, terms + term]
            if closing == 1:
                old = budget_kick[term]
                work = budget_work[term] + change + half * (old + new)
                work[3] = work[3] + square * (old[4] - new[4])
                budget_work[term] = work
                budget_force[term] = new + change / clock[STEP]
            else:
                budget_force[term] = new
            budget_kick[term] = new

    return sum_budget, fold_budget, close_budget
