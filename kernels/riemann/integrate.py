"""Kick-drift of the leapfrog (theory: riemann#a10): the closing half kick of one step and the opening one of the next.

    v_{n+1/2} = v_{n-1/2} + (dt_n + dt_{n-1})/2 a_n ;   x_{n+1} = x_n + dt_n v_{n+1/2} + shift

`velocity` holds v_{n-1/2} between steps; the velocity at the time of the positions is v + dt_{n-1}/2 a.
A position is kept as the anchor of the last list build plus the way since: increments far below the rounding of an
absolute float32 coordinate are not lost.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import DRIFT_VELOCITY, EXCESS_PRESSURE, LAST_STEP, MAXIMA, RUNAWAY, STEP
from warpsph.kernels.core.fields import FLUID, NOBODY
from warpsph.kernels.core.params import LEAST_DENSITY, make_params, make_phase
from warpsph.kernels.core.spec import Spec, types_of

from .inertia import make_inertia


@functools.cache
def make_kick_drift(spec: Spec) -> Any:
    """Return the kernel that moves the fluid particles and watches speed, way and faults."""
    real, vec, _, pair = types_of(spec)
    Params, Phase = make_params(spec.dimension, spec.precision), make_phase(spec.precision)
    later_inertia = make_inertia(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def kick_drift(
        first: int,
        slot: int,
        clock: wp.array(dtype=wp.float64),
        params: Params,
        phases: wp.array(dtype=Phase),
        forcing: wp.array(dtype=vec),
        phase: wp.array(dtype=wp.int8),
        acceleration: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        density_excess: wp.array(dtype=real),
        velocity: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        midway: wp.array(dtype=vec),
        state_old: wp.array(dtype=pair),
        maxima: wp.array(dtype=real),
        faults: wp.array(dtype=int),
        zone: wp.array(dtype=wp.int8),
        row_speed: wp.array(dtype=real),
        inertia: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) == NOBODY:
                return
        v = velocity[i] + acceleration[i] * real(wp.float64(0.5) * (clock[STEP] + clock[LAST_STEP]))
        if wp.static(spec.momentum_constraint):
            for axis in range(wp.static(spec.dimension)):
                v[axis] += real(clock[DRIFT_VELOCITY + axis])
        if wp.static(spec.inertia):
            inertia[i] = later_inertia(inertia[i], acceleration[i], position[i], params, phases[0], forcing, clock)
        v_step = v
        drift = v
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                # a buffer moves across its side alone, so that its rows stay whole
                drift = vec()
                drift[wp.static(max(spec.open_axis, 0))] = row_speed[i]
                if wp.static(spec.inertia):
                    inertia[i] = vec()  # what stood in its row before is another's
        way = offset[i] + drift * real(clock[STEP])
        if wp.static(spec.shifting):
            way += shift[i]
            v += carried[i]
        velocity[i] = v
        offset[i] = way
        x = anchor[i] + way
        position[i] = x
        # density follows from the velocity in the middle of the step at the positions in the middle of the step: taken at
        # its end, the sweep would see a source of (dt/2) grad v : grad v
        midway[i] = anchor[i] + (way - v_step * real(wp.float64(0.5) * clock[STEP]))
        state_old[i] = state[i]
        if wp.static(spec.volume_constraint):
            own = int(0)
            if wp.static(spec.multiphase):
                own = int(phase[i])
            s = density_excess[i]
            density_excess[i] = s + (real(1.0) + s) * real(clock[EXCESS_PRESSURE]) * phases[own].compressibility
        v2 = wp.dot(v, v)
        o2 = wp.dot(way, way)
        if v2 > maxima[slot * MAXIMA]:
            wp.atomic_max(maxima, slot * MAXIMA, v2)
        if o2 > maxima[slot * MAXIMA + 2]:
            wp.atomic_max(maxima, slot * MAXIMA + 2, o2)
        limit = real(clock[RUNAWAY])
        # NaN fails every comparison; a lost position would leave its particle without neighbours, and unseen
        material = int(0)
        if wp.static(spec.multiphase):
            material = int(phase[i])
        dense = density_excess[i] < phases[material].most_excess and density_excess[i] > real(wp.static(-LEAST_DENSITY))
        if not (v2 < limit * limit and dense and wp.dot(x, x) < real(1.0e30)):
            wp.atomic_min(faults, slot, i)

    return kick_drift
