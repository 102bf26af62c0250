"""Time, step length, the decision to rebuild the neighbour list, and faults: all on the device (methods A9).

One float64 array `clock` and one int32 array `counters` hold them, indexed by the constants below.
"""

import functools
from typing import Any

import warp as wp

from .spec import types

# clock: float64
TIME = 0  # simulated time [s]
STEP = 1  # length of the coming step [s]
LAST_STEP = 2  # length of the step before [s]
TARGET = 3  # time at which to hand back to the host [s]
STEP_CAP = 4  # constant limits: viscosity, tension, gravity, maximum_step [s]
COURANT = 5  # Courant number times h [m]
SOUND = 6  # largest sound speed [m/s]
FORCE = 7  # 0.25 sqrt(h) [m^0.5], limit of the acceleration
HALF_SKIN = 8  # way a particle may go before the list is used up [m]
SHIFT_REACH = 9  # longest shift of a step [m]
EXCESS_PRESSURE = 10  # pressure the volume constraint adds in the coming step [Pa]
BOX_VOLUME = 11  # volume of the fluid at the start [m^d]
RUNAWAY = 12  # speed above which the run stops [m/s]
SPEED = 13  # largest speed seen in the last step [m/s]
ACCELERATION = 14  # largest acceleration seen [m/s^2]
OFFSET = 15  # longest way since the list was built [m]
CLOCK_SIZE = 16

# counters: int32
STEPS = 0
RUNNING = 1  # the step loop goes on
REBUILD = 2  # the list is used up
FAULT = 3  # 0 none, 1 runaway or not finite, 2 list too narrow
FAULT_PARTICLE = 4
STEP_LIMIT = 5  # hand back to the host after this step
BAND_COUNT = 6  # particles in the interface band
REBUILDS = 7
LIST_PEAK = 8  # longest list so far
SINCE_CONSTRAINT = 9  # steps since the volume was last checked
COUNTERS_SIZE = 10

FAULT_STATE = 1
FAULT_LIST = 2
NO_PARTICLE = 2147483647
CONSTRAINT_INTERVAL = 5


@functools.cache
def make_advance(precision: str) -> Any:
    """Return the one-thread kernel that ends a step: time, next step length, rebuild, fault."""
    real = types(2, precision).real

    @wp.kernel(module="unique", enable_backward=False)
    def advance(
        advancing: int,
        maxima: wp.array(dtype=real),
        faults: wp.array(dtype=int),
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=int),
    ):
        if advancing == 1:
            # one slot a CPU thread; the maximum does not depend on their order
            v2 = real(0.0)
            a2 = real(0.0)
            o2 = real(0.0)
            for slot in range(faults.shape[0]):
                v2 = wp.max(v2, maxima[slot * 3])
                a2 = wp.max(a2, maxima[slot * 3 + 1])
                o2 = wp.max(o2, maxima[slot * 3 + 2])
                maxima[slot * 3] = real(0.0)
                maxima[slot * 3 + 1] = real(0.0)
                maxima[slot * 3 + 2] = real(0.0)
                if faults[slot] != NO_PARTICLE:
                    counters[FAULT] = FAULT_STATE
                    counters[FAULT_PARTICLE] = wp.min(counters[FAULT_PARTICLE], faults[slot])
            clock[SPEED] = wp.sqrt(wp.float64(v2))
            clock[ACCELERATION] = wp.sqrt(wp.float64(a2))
            clock[OFFSET] = wp.sqrt(wp.float64(o2))
            clock[TIME] = clock[TIME] + clock[STEP]
            clock[LAST_STEP] = clock[STEP]
            counters[STEPS] = counters[STEPS] + 1
        speed = clock[SPEED]
        acceleration = clock[ACCELERATION]
        dt = wp.min(clock[STEP_CAP], clock[COURANT] / (clock[SOUND] + speed))
        if acceleration > wp.float64(0.0):
            dt = wp.min(dt, clock[FORCE] / wp.sqrt(acceleration))
        # speed after the coming half kicks, and the way it may carry a particle
        bound = speed + acceleration * wp.float64(0.5) * (dt + clock[LAST_STEP])
        room = wp.float64(0.9) * (clock[HALF_SKIN] - clock[SHIFT_REACH])
        if bound * dt > room:
            dt = room / bound
        left = clock[TARGET] - clock[TIME]
        running = int(1)
        if left <= wp.float64(1.0e-12) * wp.abs(clock[TARGET]):
            running = 0
        elif left <= dt:
            dt = left
        elif left < wp.float64(2.0) * dt:
            dt = wp.float64(0.5) * left  # no sliver of a last step
        clock[STEP] = dt
        counters[REBUILD] = 0
        if clock[OFFSET] + bound * dt + clock[SHIFT_REACH] > clock[HALF_SKIN]:
            counters[REBUILD] = 1
        if counters[STEPS] >= counters[STEP_LIMIT]:
            running = 0
        if counters[FAULT] != 0:
            running = 0
            counters[REBUILD] = 0
        counters[RUNNING] = running

    return advance
