"""Time, step length, the decision to rebuild the neighbour list, and faults: all on the device (theory: riemann#a9).

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
SKIN = 8  # relative displacement that uses up the list [m]
FARTHEST = 9  # displacement that always asks for a rebuild [m]
EXCESS_PRESSURE = 10  # pressure the volume constraint adds in the coming step [Pa]
BOX_VOLUME = 11  # volume of the fluid at the start [m^d]
RUNAWAY = 12  # speed above which the run stops [m/s]
SPEED = 13  # largest speed seen in the last step [m/s]
ACCELERATION = 14  # largest acceleration seen [m/s^2]
OFFSET = 15  # longest way since the list was built [m]
SHIFT = 16  # longest shift that the coming step applies [m]
CHECKED = 17  # relative displacement that the last check of the list allows for [m]
CHECK_TIME = 18  # time of that check [s]
CHECK_LASTS = 19  # how long it holds [s]
DRIFT_SPEED = 20  # bound on how far any velocity has changed since that check [m/s]
DRIFT = 21  # bound on how far any particle is from where that check predicted it [m]
MOMENTUM = 22  # 3 entries: mean velocity of a periodic box at time 0 [m/s]
DRIFT_VELOCITY = 25  # 3 entries: velocity that the next kick adds to every particle [m/s]
SINCE_RARE = 28  # time since the rare stages ran [s]
RARE_WAY = 29  # way that the fastest particle may have gone since then [m]
RARE_LIMIT = 30  # way after which they run again [m]
RARE_CAP = 31  # time after which they run again [s]
VISCOUS_STEP = 32  # longest step of explicit viscosity, always allowed where it is implicit [s]
CHANGE = 33  # change of the velocity in a step over the largest speed beyond it [-]; 0 where it is explicit
CLOCK_SIZE = 34

# counters: int32
STEPS = 0
RUNNING = 1  # the step loop goes on
REBUILD = 2  # the list is used up
FAULT = 3  # 0 none, 1 runaway or not finite, 2 list too narrow, 3 no room for births
FAULT_PARTICLE = 4
STEP_LIMIT = 5  # hand back to the host after this step
BAND_COUNT = 6  # particles in the interface band
REBUILDS = 7
LIST_PEAK = 8  # longest list so far
STEPS_SINCE_RARE = 9  # steps since the rare stages ran
CHECK = 10  # the list has to be checked, see `slack`
CHECKS = 11
CARE = 12  # the list has to be checked or rebuilt
STRAIGHT = 13  # when the list gets doubtful, rebuild it without a check
USELESS = 14  # checks in a row that found nothing right after a rebuild
RARE = 15  # the rare stages run in the coming step
LIVE = 16  # fluid particles that there are, where their number changes
WANTED = 17  # fluid particles that births found no room for, all of them counted
GROWING = 18  # number of the level that births found full
NEXT_ID = 19  # id of the next particle that is born
ROOM = 20  # what is left of the step may run: no node found that there is no room
COUNTERS_SIZE = 21
RETRY = 8  # rebuilds after which a useless check is tried again

MAXIMA = 4  # per thread: speed^2, acceleration^2, displacement^2, shift^2
SEED = 0.9
HORIZON = 32.0  # steps that a check of the list looks ahead
GROWTH = 1.5  # of the step where viscosity is implicit: BDF2 needs less than 2.4
SHORTEST = 3.0  # steps that a check must last to be better than a rebuild

FAULT_STATE = 1
FAULT_LIST = 2
FAULT_CAPACITY = 3
NO_PARTICLE = 2147483647
RARE_INTERVAL = 5  # steps from one run of the rare stages to the next, at most
FOLDS = 64  # groups of partial volume sums


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
            s2 = real(0.0)
            for slot in range(faults.shape[0]):
                v2 = wp.max(v2, maxima[slot * MAXIMA])
                a2 = wp.max(a2, maxima[slot * MAXIMA + 1])
                o2 = wp.max(o2, maxima[slot * MAXIMA + 2])
                s2 = wp.max(s2, maxima[slot * MAXIMA + 3])
                if faults[slot] != NO_PARTICLE:
                    counters[FAULT] = FAULT_STATE
                    counters[FAULT_PARTICLE] = wp.min(counters[FAULT_PARTICLE], faults[slot])
            # The next maxima start a little below these: hardly any thread then has to write, where from zero all would at
            # once (a third of the step at 10 000 particles on a GPU). Where a maximum falls faster it is overestimated.
            for slot in range(faults.shape[0]):
                maxima[slot * MAXIMA] = real(SEED) * v2
                maxima[slot * MAXIMA + 1] = real(SEED) * a2
                maxima[slot * MAXIMA + 2] = real(SEED) * o2
                maxima[slot * MAXIMA + 3] = real(SEED) * s2
            # what the step just done added to the motion that the last check of the list could not foresee
            clock[DRIFT_SPEED] = (
                clock[DRIFT_SPEED] + clock[ACCELERATION] * wp.float64(0.5) * (clock[STEP] + clock[LAST_STEP])
            )
            clock[DRIFT] = clock[DRIFT] + clock[DRIFT_SPEED] * clock[STEP] + clock[SHIFT]
            clock[SPEED] = wp.sqrt(wp.float64(v2))
            clock[ACCELERATION] = wp.sqrt(wp.float64(a2))
            clock[OFFSET] = wp.sqrt(wp.float64(o2))
            clock[SHIFT] = wp.sqrt(wp.float64(s2))
            clock[TIME] = clock[TIME] + clock[STEP]
            clock[LAST_STEP] = clock[STEP]
            counters[STEPS] = counters[STEPS] + 1
            counters[STEPS_SINCE_RARE] = counters[STEPS_SINCE_RARE] + 1
            clock[SINCE_RARE] = clock[SINCE_RARE] + clock[STEP]
            clock[RARE_WAY] = clock[RARE_WAY] + clock[SPEED] * clock[STEP] + clock[SHIFT]
            if counters[RARE] == 1:
                counters[STEPS_SINCE_RARE] = 0
                clock[SINCE_RARE] = wp.float64(0.0)
                clock[RARE_WAY] = wp.float64(0.0)
            else:
                # what the constraints asked for has been done once
                clock[EXCESS_PRESSURE] = wp.float64(0.0)
                for axis in range(3):
                    clock[DRIFT_VELOCITY + axis] = wp.float64(0.0)
        speed = clock[SPEED]
        acceleration = clock[ACCELERATION]
        dt = wp.min(clock[STEP_CAP], clock[COURANT] / (clock[SOUND] + speed))
        if acceleration > wp.float64(0.0):
            dt = wp.min(dt, clock[FORCE] / wp.sqrt(acceleration))
        if clock[CHANGE] > wp.float64(0.0):
            # Implicit viscosity is stable at any step. How fast the flow changes says how long one may be: a start from rest
            # then takes steps in proportion to its age.
            accurate = clock[VISCOUS_STEP]
            if acceleration > wp.float64(0.0):
                accurate = wp.max(accurate, clock[CHANGE] * speed / acceleration)
            dt = wp.min(dt, accurate)
            if clock[LAST_STEP] > wp.float64(0.0):
                dt = wp.min(dt, wp.float64(GROWTH) * clock[LAST_STEP])
        # speed after the coming half kicks, and the way it may carry a particle: never more than the list can bear at once
        kick = acceleration * wp.float64(0.5) * (dt + clock[LAST_STEP])
        room = wp.float64(0.45) * clock[SKIN] - clock[SHIFT]
        if (speed + kick) * dt > room:
            dt = room / (speed + kick)
        left = clock[TARGET] - clock[TIME]
        running = int(1)
        if left <= wp.float64(1.0e-12) * wp.abs(clock[TARGET]):
            running = 0
        elif left <= dt:
            dt = left
        elif left < wp.float64(2.0) * dt:
            dt = wp.float64(0.5) * left  # no sliver of a last step
        clock[STEP] = dt
        # Constraints and interface geometry follow the flow, which is slower than sound: they need no new look until a
        # particle has gone a part of h, or capillary waves have had time to move.
        counters[RARE] = 0
        if counters[STEPS_SINCE_RARE] + 1 >= RARE_INTERVAL:
            counters[RARE] = 1
        if clock[RARE_WAY] + (speed + kick) * dt + clock[SHIFT] > clock[RARE_LIMIT]:
            counters[RARE] = 1
        if clock[SINCE_RARE] + dt > clock[RARE_CAP]:
            counters[RARE] = 1
        # Half a skin of absolute displacement, or what the last check allows for: one of both must outlast the step.
        way = clock[OFFSET] + (speed + kick) * dt + clock[SHIFT]
        drift = clock[DRIFT] + (clock[DRIFT_SPEED] + kick) * dt + clock[SHIFT]
        lasts = clock[CHECK_TIME] + clock[CHECK_LASTS] >= clock[TIME] + dt
        counters[REBUILD] = 0
        counters[CHECK] = 0
        if way > wp.float64(0.5) * clock[SKIN]:
            if way > clock[FARTHEST]:
                counters[REBUILD] = 1
            elif not (lasts and clock[CHECKED] + wp.float64(2.0) * drift <= clock[SKIN]):
                if counters[STRAIGHT] == 1:
                    counters[REBUILD] = 1
                else:
                    counters[CHECK] = 1
        if counters[STEPS] >= counters[STEP_LIMIT]:
            running = 0
        if counters[FAULT] != 0:
            running = 0
            counters[REBUILD] = 0
            counters[CHECK] = 0
        counters[CARE] = wp.max(counters[CHECK], counters[REBUILD])
        counters[RUNNING] = running

    return advance


@functools.cache
def make_judge(precision: str) -> tuple[Any, Any]:
    """Return the one-thread kernels around a check of the list: (set the horizon, judge what was found)."""
    real = types(2, precision).real

    @wp.kernel(module="unique", enable_backward=False)
    def set_horizon(clock: wp.array(dtype=wp.float64), horizon: wp.array(dtype=real)):
        horizon[0] = real(clock[STEP] * wp.float64(HORIZON))

    @wp.kernel(module="unique", enable_backward=False)
    def judge_list(
        slack_maxima: wp.array(dtype=real),
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=int),
    ):
        n2 = real(0.0)
        t2 = real(0.0)
        for slot in range(slack_maxima.shape[0] / 2):
            n2 = wp.max(n2, slack_maxima[slot * 2])
            t2 = wp.max(t2, slack_maxima[slot * 2 + 1])
            slack_maxima[slot * 2] = real(0.0)
            slack_maxima[slot * 2 + 1] = real(0.0)
        now = wp.sqrt(wp.float64(n2))
        then = wp.sqrt(wp.float64(t2))
        # the longest time for which the mix of both bounds and a constant largest acceleration stay within the skin
        share = wp.float64(1.0)
        horizon = clock[STEP] * wp.float64(HORIZON)
        found = bool(False)
        while not found and share * wp.float64(HORIZON) >= wp.float64(SHORTEST):
            time = share * horizon
            allowed = wp.max(now, now + share * (then - now))
            steps = share * wp.float64(HORIZON)
            extra = clock[ACCELERATION] * time * (time + clock[STEP]) + wp.float64(2.0) * steps * clock[SHIFT]
            if allowed + extra <= wp.float64(0.999) * clock[SKIN]:
                found = True
                clock[CHECKED] = allowed
                clock[CHECK_TIME] = clock[TIME]
                clock[CHECK_LASTS] = time
                clock[DRIFT] = wp.float64(0.0)
                clock[DRIFT_SPEED] = wp.float64(0.0)
            else:
                share = share * wp.float64(0.7)
        counters[CHECK] = 0
        counters[CHECKS] = counters[CHECKS] + 1
        if found:
            # what was not good for the whole horizon has used up the skin by its end
            counters[USELESS] = 0
            if share < wp.float64(1.0):
                counters[STRAIGHT] = 1
        else:
            counters[REBUILD] = 1
            if clock[CHECK_LASTS] < wp.float64(0.0):
                counters[USELESS] = counters[USELESS] + 1

    return set_horizon, judge_list
