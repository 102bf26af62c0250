"""Kick and drift of the delta-plus leapfrog, and the density that closes a step (theory: delta#d5).

    v_{n+1/2} = v_{n-1/2} + (dt_n + dt_{n-1})/2 a_n ;   x_{n+1} = x_n + dt_n v_{n+1/2} + dr_n

`velocity` holds v_{n-1/2} between steps; dr is the shift that the last momentum sweep found.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import EXCESS_PRESSURE, LAST_STEP, MAXIMA, RELAXATION, RUNAWAY, STEP
from warpsph.kernels.core.eos import make_eos
from warpsph.kernels.core.fields import FLUID, NOBODY
from warpsph.kernels.core.params import LEAST_DENSITY, make_params, make_phase
from warpsph.kernels.core.relaxation import make_late
from warpsph.kernels.core.sound_damping import make_damping
from warpsph.kernels.core.spec import Spec, types_of


@functools.cache
def make_delta_drift(spec: Spec) -> Any:
    """Return the kernel that moves the fluid particles and watches speed, way and faults."""
    real, vec, _, _ = types_of(spec)
    Phase = make_phase(spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def delta_drift(
        first: int,
        slot: int,
        clock: wp.array(dtype=wp.float64),
        phases: wp.array(dtype=Phase),
        acceleration: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        density_excess: wp.array(dtype=real),
        velocity: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        midway: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
        faults: wp.array(dtype=int),
        zone: wp.array(dtype=wp.int8),
        row_speed: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) == NOBODY:
                return
        v = velocity[i] + acceleration[i] * real(wp.float64(0.5) * (clock[STEP] + clock[LAST_STEP]))
        go = v * real(clock[STEP])
        if wp.static(spec.shifting):
            go += shift[i]
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                # a buffer moves across its side alone, so that its rows stay whole
                go = vec()
                go[wp.static(max(spec.open_axis, 0))] = row_speed[i] * real(clock[STEP])
        way = offset[i] + go
        x = anchor[i] + way
        velocity[i] = v
        offset[i] = way
        position[i] = x
        midway[i] = anchor[i] + (way - real(0.5) * go)
        if wp.static(spec.volume_constraint):
            s = density_excess[i]
            density_excess[i] = s + (real(1.0) + s) * real(clock[EXCESS_PRESSURE]) * phases[0].compressibility
        v2 = wp.dot(v, v)
        o2 = wp.dot(way, way)
        if v2 > maxima[slot * MAXIMA]:
            wp.atomic_max(maxima, slot * MAXIMA, v2)
        if o2 > maxima[slot * MAXIMA + 2]:
            wp.atomic_max(maxima, slot * MAXIMA + 2, o2)
        limit = real(clock[RUNAWAY])
        # NaN fails every comparison; a lost position would leave its particle without neighbours, and unseen
        dense = density_excess[i] < phases[0].most_excess and density_excess[i] > real(wp.static(-LEAST_DENSITY))
        if not (v2 < limit * limit and dense and wp.dot(x, x) < real(1.0e30)):
            wp.atomic_min(faults, slot, i)

    return delta_drift


@functools.cache
def make_delta_state(spec: Spec) -> Any:
    """Return the kernel that advances density by its rate, velocity by what the shift carries, and evaluates the state.

    closing: 1 at the end of a step, for all but buffers, which have what inlets and outlets give; 0 for the state of what is
    there, whose pressure counts as settled.
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    eos = make_eos(spec.precision)
    damping = make_damping(spec)
    late = make_late(spec.precision)
    carries = spec.shift_form == "consistent"

    @wp.kernel(module="unique", enable_backward=False)
    def delta_state(
        first: int,
        closing: int,
        params: Params,
        clock: wp.array(dtype=wp.float64),
        phases: wp.array(dtype=Phase),
        density_rate: wp.array(dtype=real),
        flow_rate: wp.array(dtype=real),
        carried: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        wholeness: wp.array(dtype=real),
        density_excess: wp.array(dtype=real),
        settled: wp.array(dtype=real),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        wholeness_old: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if closing == 1 and int(zone[i]) != FLUID:
                return
        s = density_excess[i]
        if closing == 1:
            s += real(clock[STEP]) * density_rate[i]
            density_excess[i] = s
            if wp.static(carries):
                velocity[i] = velocity[i] + carried[i]
        if wp.static(spec.free_surface):
            wholeness_old[i] = wholeness[i]
        own = phases[0]
        p = eos(s, own.stiffness, own.gamma) + own.background
        if wp.static(spec.relaxation):
            # A shift does not carry what has settled: in the time of relaxation it is too short to be felt
            # (docs/records/sound.md#bodies).
            slow = p
            if closing == 1:
                slow = late(p, settled[i], real(clock[STEP]), params.relaxation_time)
            settled[i] = slow
            p += real(clock[RELAXATION]) * (p - slow)
        if wp.static(spec.acoustic_damping):
            p += damping(flow_rate[i], params, own)
        state[i] = pair(p, rest_volume[i] / (real(1.0) + s))

    return delta_state


@functools.cache
def make_delta_shift(spec: Spec) -> Any:
    """Return the kernel that applies shift and volume constraint after the stages of Runge and Kutta."""
    real, vec, _, _ = types_of(spec)
    Phase = make_phase(spec.precision)
    carries = spec.shift_form == "consistent"

    @wp.kernel(module="unique", enable_backward=False)
    def delta_shift(
        first: int,
        clock: wp.array(dtype=wp.float64),
        phases: wp.array(dtype=Phase),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        density_excess: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        if wp.static(spec.shifting):
            way = offset[i] + shift[i]
            offset[i] = way
            position[i] = anchor[i] + way
        if wp.static(carries):
            velocity[i] = velocity[i] + carried[i]
        if wp.static(spec.volume_constraint):
            s = density_excess[i]
            density_excess[i] = s + (real(1.0) + s) * real(clock[EXCESS_PRESSURE]) * phases[0].compressibility

    return delta_shift
