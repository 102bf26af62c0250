"""Steps of the gas in time: kick, drift, prediction, watch, and how long the next one is (theory: compressible#c1-time)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import MAXIMA, SEED, SIGNAL_RATE, STEP
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.core.varying_list import GROWTH

from .gas_fields import GOING
from .gas_forces import SLOTS

STEP_GROWTH = 0.45 * GROWTH  # of a smoothing length in one step, as a step may carry a particle by 0.45 of the skin


@functools.cache
def make_gas_predict(spec: Spec) -> Any:
    """Return the kernel that drifts with the velocity of the middle of the step and predicts v and e."""
    real, vec, _, _ = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def gas_predict(
        first: int,
        clock: wp.array(dtype=wp.float64),
        anchor: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        power: wp.array(dtype=real),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        energy: wp.array(dtype=real),
        velocity_half: wp.array(dtype=vec),
        energy_start: wp.array(dtype=real),
        energy_rest: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        half = real(wp.float64(0.5) * clock[STEP])
        middle = velocity[i] + half * acceleration[i]
        velocity_half[i] = middle
        energy_start[i] = energy[i]
        gain = half * power[i]
        energy_rest[i] = energy_rest[i] + gain
        kick = half * acceleration[i]
        velocity[i] = middle + kick
        # E grows by the step times power + v.a, and the kinetic energy by v.(2 kick) + |2 kick|^2/2
        energy[i] = energy[i] + (real(2.0) * gain - real(2.0) * wp.dot(kick, kick))
        offset[i] = offset[i] + real(clock[STEP]) * middle
        position[i] = anchor[i] + offset[i]

    return gas_predict


@functools.cache
def make_gas_correct(spec: Spec) -> Any:
    """Return the kernel that ends the step with the rates of its end.

    The sum of energy and kinetic energy grows by half a step of its rates at both ends (theory: compressible#c1-time). What
    a sum of the energy rounds off goes into the next: gains of one sign that are below its last digit add up.
    """
    real, vec, _, pair = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def gas_correct(
        first: int,
        heats: real,
        clock: wp.array(dtype=wp.float64),
        acceleration: wp.array(dtype=vec),
        power: wp.array(dtype=real),
        velocity_half: wp.array(dtype=vec),
        energy_start: wp.array(dtype=real),
        energy_rest: wp.array(dtype=real),
        velocity: wp.array(dtype=vec),
        density: wp.array(dtype=real),
        energy: wp.array(dtype=real),
        state: wp.array(dtype=pair),
    ):
        i = wp.tid() + first
        half = real(wp.float64(0.5) * clock[STEP])
        v = velocity_half[i] + half * acceleration[i]
        missed = v - velocity[i]  # by the prediction
        velocity[i] = v
        gain = energy_rest[i] + half * power[i] - real(0.5) * wp.dot(missed, missed)
        e = energy_start[i] + gain
        energy_rest[i] = gain - (e - energy_start[i])
        energy[i] = e
        power[i] = power[i] - wp.dot(acceleration[i], missed)  # seen by a particle with the velocity of the end
        state[i] = pair(heats * density[i] * wp.max(e, real(0.0)), state[i][1])

    return gas_correct


@functools.cache
def make_gas_watch(spec: Spec) -> Any:
    """Return the kernel that reports speeds and ways to the clock, and what is not finite or has no energy left.

    A smoothing length that a step like the last would make grow by more than the list allows for uses it up, as half a skin
    of way does. One whose support is longer than what has one image at most, `longest_smoothing`, is a fault. A particle
    that is GOING moves from the next step on.
    """
    real, vec, _, _ = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def gas_watch(
        first: int,
        slot: int,
        skin_length: real,
        longest_smoothing: real,
        clock: wp.array(dtype=wp.float64),
        velocity: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        energy: wp.array(dtype=real),
        density: wp.array(dtype=real),
        smoothing: wp.array(dtype=real),
        listed_smoothing: wp.array(dtype=real),
        swelling: wp.array(dtype=real),
        held: wp.array(dtype=wp.uint8),
        maxima: wp.array(dtype=real),
        faults: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        v2 = wp.dot(velocity[i], velocity[i])
        a2 = wp.dot(acceleration[i], acceleration[i])
        way = wp.length(offset[i])
        if wp.static(not spec.constant_h):
            coming = real(1.0) + real(clock[STEP]) * wp.max(swelling[i], real(0.0))
            if smoothing[i] * coming >= real(wp.static(1.0 + GROWTH)) * listed_smoothing[i]:
                way = wp.max(way, skin_length)
        if v2 > maxima[slot * MAXIMA]:
            wp.atomic_max(maxima, slot * MAXIMA, v2)
        if a2 > maxima[slot * MAXIMA + 1]:
            wp.atomic_max(maxima, slot * MAXIMA + 1, a2)
        if way * way > maxima[slot * MAXIMA + 2]:
            wp.atomic_max(maxima, slot * MAXIMA + 2, way * way)
        # NaN fails every comparison
        sound = v2 < real(1.0e30) and wp.dot(position[i], position[i]) < real(1.0e30) and a2 < real(1.0e36)
        if not (sound and energy[i] > real(0.0) and density[i] > real(0.0) and smoothing[i] <= longest_smoothing):
            wp.atomic_min(faults, slot, i)
        if wp.static(spec.held):
            if held[i] == wp.uint8(GOING):
                held[i] = wp.uint8(0)

    return gas_watch


@functools.cache
def make_gas_signal(spec: Spec) -> Any:
    """Return the one-thread kernel that hands the largest signal rate to the clock."""
    real = types_of(spec).real

    @wp.kernel(module="unique", enable_backward=False)
    def gas_signal(signal_rates: wp.array(dtype=real), clock: wp.array(dtype=wp.float64)):
        largest = real(0.0)
        for slot in range(wp.static(SLOTS)):
            largest = wp.max(largest, signal_rates[slot])
        # the next maxima start a little below, as those of the clock do: hardly any thread then has to write
        for slot in range(wp.static(SLOTS)):
            signal_rates[slot] = real(SEED) * largest
        clock[SIGNAL_RATE] = wp.float64(largest)

    return gas_signal
