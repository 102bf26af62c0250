"""Time, step length, the decision to rebuild the neighbour list, and faults: all on the device (theory: riemann#a9).

One float64 array `clock` and one int32 array `counters` hold them, indexed by the constants
below; a restart goes on from what is `kept`.
"""

import dataclasses
import functools
from typing import Any

import warp as wp

from .spec import types


@dataclasses.dataclass(frozen=True)
class Slot:
    """An entry of the clock or the counters: its place, unit, meaning, and whether a restart goes on from it."""

    index: int
    size: int
    unit: str
    meaning: str
    kept: bool


class Slots:
    """Entries of an array, declared one after the other; each constant below is the place of its entry."""

    def __init__(self) -> None:
        self.entries: list[Slot] = []
        self.size = 0

    def slot(self, unit: str, meaning: str, size: int = 1, kept: bool = False) -> int:
        """Declare an entry of so many numbers and return its place; `kept`: part of the state of a run."""
        self.entries.append(Slot(self.size, size, unit, meaning, kept))
        self.size += size
        return self.entries[-1].index

    @property
    def kept(self) -> list[int]:
        """The places that a restart goes on from."""
        return [entry.index + k for entry in self.entries if entry.kept for k in range(entry.size)]


CLOCK = Slots()  # float64
TIME = CLOCK.slot("s", "simulated time", kept=True)
STEP = CLOCK.slot("s", "length of the coming step", kept=True)
LAST_STEP = CLOCK.slot("s", "length of the step before", kept=True)
TARGET = CLOCK.slot("s", "time at which to hand back to the host")
STEP_CAP = CLOCK.slot("s", "constant limits: viscosity, tension, gravity, maximum_step")
COURANT = CLOCK.slot("m", "Courant number times h")
SOUND = CLOCK.slot("m/s", "largest sound speed")
FORCE = CLOCK.slot("m^0.5", "0.25 sqrt(h), limit of the acceleration")
SKIN = CLOCK.slot("m", "relative displacement that uses up the list")
FARTHEST = CLOCK.slot("m", "displacement that always asks for a rebuild")
EXCESS_PRESSURE = CLOCK.slot("Pa", "pressure the volume constraint adds in the coming step", kept=True)
BOX_VOLUME = CLOCK.slot("m^d", "volume of the fluid at the start", kept=True)
RUNAWAY = CLOCK.slot("m/s", "speed above which the run stops")
SPEED = CLOCK.slot("m/s", "largest speed seen in the last step", kept=True)
ACCELERATION = CLOCK.slot("m/s^2", "largest acceleration seen", kept=True)
OFFSET = CLOCK.slot("m", "longest way since the list was built", kept=True)
SHIFT = CLOCK.slot("m", "longest shift that the coming step applies", kept=True)
CHECKED = CLOCK.slot("m", "relative displacement that the last check of the list allows for", kept=True)
CHECK_TIME = CLOCK.slot("s", "time of that check", kept=True)
CHECK_LASTS = CLOCK.slot("s", "how long it holds", kept=True)
DRIFT_SPEED = CLOCK.slot("m/s", "bound on how far any velocity has changed since that check", kept=True)
DRIFT = CLOCK.slot("m", "bound on how far any particle is from where that check predicted it", kept=True)
MOMENTUM = CLOCK.slot("m/s", "mean velocity of a periodic box at time 0", size=3, kept=True)
DRIFT_VELOCITY = CLOCK.slot("m/s", "velocity that the next kick adds to every particle", size=3, kept=True)
SINCE_RARE = CLOCK.slot("s", "time since the rare stages ran", kept=True)
RARE_WAY = CLOCK.slot("m", "way that the fastest particle may have gone since then", kept=True)
RARE_LIMIT = CLOCK.slot("m", "way after which they run again")
RARE_CAP = CLOCK.slot("s", "time after which they run again")
VISCOUS_STEP = CLOCK.slot("s", "longest step of explicit viscosity, always allowed where it is implicit")
CHANGE = CLOCK.slot("-", "change of the velocity in a step over the largest speed beyond it; 0 where it is explicit")
AT_REST = CLOCK.slot("m/s", "speed below which that change is over this speed")
SIGNAL_RATE = CLOCK.slot("1/s", "largest signal speed over smoothing length, where each particle has its own", kept=True)
SIGNAL_COURANT = CLOCK.slot("-", "Courant number of that rate")
RELAXATION = CLOCK.slot("-", "stiffness of the part of the pressure that fades, over that of the rest")
CLOCK_SIZE = CLOCK.size

COUNTERS = Slots()  # int32
STEPS = COUNTERS.slot("-", "steps done", kept=True)
RUNNING = COUNTERS.slot("-", "the step loop goes on")
REBUILD = COUNTERS.slot("-", "the list is used up")
FAULT = COUNTERS.slot("-", "0 none, 1 runaway or not finite, 2 list too narrow, 3 no room for births")
FAULT_PARTICLE = COUNTERS.slot("-", "row of the particle that a fault was found at")
STEP_LIMIT = COUNTERS.slot("-", "hand back to the host after this step")
BAND_COUNT = COUNTERS.slot("-", "particles in the interface band")
REBUILDS = COUNTERS.slot("-", "builds of the neighbour list", kept=True)
LIST_PEAK = COUNTERS.slot("-", "longest list so far")
STEPS_SINCE_RARE = COUNTERS.slot("-", "steps since the rare stages ran", kept=True)
RARE_STEPS = COUNTERS.slot("-", "steps after which the rare stages run again")
CHECK = COUNTERS.slot("-", "the list has to be checked, see `slack`")
CHECKS = COUNTERS.slot("-", "checks of the list", kept=True)
CARE = COUNTERS.slot("-", "the list has to be checked or rebuilt")
STRAIGHT = COUNTERS.slot("-", "when the list gets doubtful, rebuild it without a check", kept=True)
USELESS = COUNTERS.slot("-", "checks in a row that found nothing right after a rebuild", kept=True)
RARE = COUNTERS.slot("-", "the rare stages run in the coming step")
LIVE = COUNTERS.slot("-", "fluid particles that there are, where their number changes", kept=True)
WANTED = COUNTERS.slot("-", "fluid particles that births found no room for, all of them counted")
GROWING = COUNTERS.slot("-", "number of the level that births found full")
NEXT_ID = COUNTERS.slot("-", "id of the next particle that is born", kept=True)
ROOM = COUNTERS.slot("-", "what is left of the step may run: no node found that there is no room")
COUNTERS_SIZE = COUNTERS.size
RETRY = 8  # rebuilds after which a useless check is tried again

MAXIMA = 4  # per thread: speed^2, acceleration^2, displacement^2, shift^2
SEED = 0.9
HORIZON = 32.0  # steps that a check of the list looks ahead
GROWTH = 1.5  # of the step where viscosity is implicit: BDF2 needs less than 2.4
ROUNDING = 1.0e-9  # of a number of steps: what is left after n steps of a length is a whole number of them
SHORTEST = 3.0  # steps that a check must last to be better than a rebuild

FAULT_STATE = 1
FAULT_LIST = 2
FAULT_CAPACITY = 3
NO_PARTICLE = 2147483647
RARE_INTERVAL = 5  # steps from one run of the rare stages to the next, at most


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
        if clock[SIGNAL_RATE] > wp.float64(0.0):
            dt = wp.min(dt, clock[SIGNAL_COURANT] / clock[SIGNAL_RATE])
        if clock[CHANGE] > wp.float64(0.0):
            # Implicit viscosity is stable at any step. How fast the flow changes says how long one may be: a start from rest
            # then takes steps in proportion to its age.
            accurate = clock[VISCOUS_STEP]
            if acceleration > wp.float64(0.0):
                accurate = wp.max(accurate, clock[CHANGE] * wp.max(speed, clock[AT_REST]) / acceleration)
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
        elif dt > wp.float64(0.0):
            # Steps of one length up to the target: no sliver of a last one, nor a jump, which pressures of ISPH feel.
            count = wp.ceil(left / dt * (wp.float64(1.0) - wp.float64(ROUNDING)))
            dt = left / wp.max(count, wp.float64(1.0))  # one step where nothing limits it
        clock[STEP] = dt
        # Constraints and interface geometry follow the flow, which is slower than sound: they need no new look until a
        # particle has gone a part of h, or capillary waves have had time to move.
        counters[RARE] = 0
        if counters[STEPS_SINCE_RARE] + 1 >= counters[RARE_STEPS]:
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


def steps_ahead(shift_ahead: bool) -> float:
    """Return how many steps a check of the list looks ahead.

    shift_ahead: the check has the shift of the coming step, see `slack`.
    """
    return 1.0 if shift_ahead else HORIZON


@functools.cache
def make_judge(precision: str, shift_ahead: bool) -> Any:
    """Return the one-thread kernel that judges what a check of the list has found.

    shift_ahead: the check has the shift of the coming step, and looks no further, see `slack`.
    """
    real = types(2, precision).real
    ahead = steps_ahead(shift_ahead)
    shortest, unknown = (1.0, 0.0) if shift_ahead else (SHORTEST, 2.0)
    seed = SEED if shift_ahead else 0.0

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
        # Ways grow as long as a list lasts. The next maxima start a little below these, or all cells would write at once.
        for slot in range(slack_maxima.shape[0] / 2):
            slack_maxima[slot * 2] = real(seed) * n2
            slack_maxima[slot * 2 + 1] = real(seed) * t2
        now = wp.sqrt(wp.float64(n2))
        then = wp.sqrt(wp.float64(t2))
        # the longest time for which the mix of both bounds and a constant largest acceleration stay within the skin
        share = wp.float64(1.0)
        horizon = clock[STEP] * wp.float64(ahead)
        found = bool(False)
        while not found and share * wp.float64(ahead) >= wp.float64(shortest):
            time = share * horizon
            allowed = wp.max(now, now + share * (then - now))
            steps = share * wp.float64(ahead)
            extra = clock[ACCELERATION] * time * (time + clock[STEP]) + wp.float64(unknown) * steps * clock[SHIFT]
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

    return judge_list
