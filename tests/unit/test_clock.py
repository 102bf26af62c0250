"""The device's clock: step limits, target times, faults, and when to care for the neighbour list."""

import dataclasses
import math

import numpy as np
import pytest
import warp as wp

from tests.helpers import Fluid, Setup, lattice
from warpsph.engine.neighbours import brute_force_pairs
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.clock import make_advance
from warpsph.kernels.core.spec import Spec

H, SOUND, COURANT, SKIN = 0.01, 20.0, 0.5, 1e-3
ACOUSTIC = COURANT * H / SOUND  # 2.5e-4 s


class Clock:
    """The end of a step alone, with what the sweeps would have found."""

    def __init__(self, precision="float64", **entries):
        self.kernel = make_advance(precision)
        self.real = {"float32": wp.float32, "float64": wp.float64}[precision]
        values = np.zeros(ck.CLOCK_SIZE)
        values[ck.COURANT] = COURANT * H
        values[ck.SOUND] = SOUND
        values[ck.FORCE] = 0.25 * math.sqrt(H)
        values[ck.STEP_CAP] = math.inf
        values[ck.TARGET] = 1e3
        values[ck.SKIN] = SKIN
        values[ck.FARTHEST] = 5 * SKIN
        values[ck.CHECK_LASTS] = -1.0
        for name, value in entries.items():
            values[getattr(ck, name)] = value
        self.values = values
        self.counters = np.zeros(ck.COUNTERS_SIZE, dtype=np.int32)
        self.counters[ck.RARE_STEPS] = ck.RARE_INTERVAL
        self.counters[ck.STEP_LIMIT] = 10**9
        self.counters[ck.FAULT_PARTICLE] = ck.NO_PARTICLE

    def advance(self, advancing=1, speed=0.0, acceleration=0.0, way=0.0, shift=0.0, faults=(ck.NO_PARTICLE,)):
        """End a step in which these maxima were seen; several threads if they are sequences."""
        slots = len(faults)
        seen = np.zeros((slots, ck.MAXIMA))
        for column, value in enumerate((speed, acceleration, way, shift)):
            seen[:, column] = np.square(value)
        maxima = wp.array(seen.ravel(), dtype=self.real, device="cpu")
        clock = wp.array(self.values, dtype=wp.float64, device="cpu")
        counters = wp.array(self.counters, dtype=int, device="cpu")
        inputs = [advancing, maxima, wp.array(faults, dtype=int, device="cpu"), clock, counters]
        wp.launch(self.kernel, dim=1, inputs=inputs, device="cpu")
        self.values, self.counters = clock.numpy().copy(), counters.numpy().copy()
        if advancing:  # ready for the next step: every slot starts a little below what was seen
            left = maxima.numpy().reshape(slots, ck.MAXIMA)
            np.testing.assert_allclose(left, np.tile(ck.SEED * seen.max(axis=0), (slots, 1)), rtol=1e-6)
        return self

    def __getattr__(self, name):
        index = getattr(ck, name)
        return self.counters[index] if name in COUNTERS else self.values[index]


COUNTERS = {"STEPS", "RUNNING", "REBUILD", "FAULT", "FAULT_PARTICLE", "CHECK", "RARE", "STEPS_SINCE_RARE"}


def test_acoustic_limit():
    """Courant number times h over sound speed plus the largest speed."""
    assert Clock().advance().STEP == pytest.approx(ACOUSTIC)
    assert Clock(SKIN=1.0).advance(speed=5.0).STEP == pytest.approx(COURANT * H / (SOUND + 5.0))


def test_force_limit():
    """0.25 sqrt(h / a)."""
    assert Clock(SKIN=1.0).advance(acceleration=400.0).STEP == pytest.approx(ACOUSTIC)
    a = 4e6
    assert Clock(SKIN=1.0).advance(acceleration=a).STEP == pytest.approx(0.25 * math.sqrt(H / a))


def test_constant_limit():
    assert Clock(STEP_CAP=1e-5).advance().STEP == pytest.approx(1e-5)
    assert Clock(STEP_CAP=1.0).advance().STEP == pytest.approx(ACOUSTIC)


def test_no_step_goes_further_than_the_list_bears():
    """Half a skin from a fresh list, kicks and shift included."""
    for speed, acceleration, shift in ((100.0, 0.0, 0.0), (3.0, 2e5, 0.0), (50.0, 1e4, 1e-4)):
        clock = Clock(OFFSET=0.0).advance(speed=speed, acceleration=acceleration, shift=shift)
        kick = 0.5 * acceleration * (clock.STEP + clock.LAST_STEP)
        assert 0 < clock.STEP and (speed + kick) * clock.STEP + shift <= 0.5 * SKIN
        assert clock.REBUILD == 0 and clock.CHECK == 0


def test_largest_of_all_threads():
    clock = Clock(SKIN=1.0).advance(speed=[1.0, 3.0, 2.0], acceleration=[9.0, 4.0, 1.0], faults=[ck.NO_PARTICLE] * 3)
    assert clock.SPEED == pytest.approx(3.0)
    assert clock.ACCELERATION == pytest.approx(9.0)


def test_time_adds_up():
    clock = Clock(STEP=1e-4, TIME=2.0).advance()
    assert clock.TIME == 2.0 + 1e-4
    assert clock.LAST_STEP == 1e-4
    assert clock.STEPS == 1
    before = clock.TIME
    clock.advance(advancing=0)
    assert clock.TIME == before and clock.STEPS == 1 and clock.LAST_STEP == 1e-4


@pytest.mark.parametrize("target", [1e-3, 0.01, 0.3333, 0.9 * ACOUSTIC, 1.0000001 * ACOUSTIC, 4.01 * ACOUSTIC])
def test_target_is_met_by_even_steps(target):
    """As many steps as have to be, of one length; time ends on the target and the loop stops."""
    clock = Clock(TARGET=target).advance(advancing=0)
    steps = []
    while clock.RUNNING:
        steps.append(clock.STEP)
        clock.advance()
        assert len(steps) < 10**4
    assert clock.TIME == pytest.approx(target, rel=1e-12)
    assert sum(steps) == pytest.approx(target, rel=1e-10)
    assert max(steps) <= ACOUSTIC * (1 + 1e-9)
    assert max(steps) <= min(steps) * (1 + 1e-6)
    assert (len(steps) - 1) * ACOUSTIC < target
    # already there: nothing is left to do
    assert clock.advance(advancing=0).RUNNING == 0


@pytest.mark.parametrize("cap", [1e30, np.inf])
def test_what_nothing_limits_takes_one_step(cap):
    """Fluid at rest without sound, gravity and friction: a step as long as what is left."""
    free = {"STEP_CAP": cap, "COURANT": cap, "SOUND": 1e-30, "FORCE": cap, "SKIN": 1e30, "FARTHEST": 1e30}
    assert Clock(TARGET=2.0, **free).advance(advancing=0).STEP == 2.0


def test_late_targets_do_not_stall():
    """Long after the start a step is still taken and ends on the target."""
    clock = Clock(TIME=1e6, TARGET=1e6 + 3 * ACOUSTIC).advance(advancing=0)
    count = 0
    while clock.RUNNING and count < 20:
        clock.advance()
        count += 1
    assert 3 <= count <= 5
    assert clock.TIME == pytest.approx(1e6 + 3 * ACOUSTIC, abs=2e-6)


def test_step_limit_hands_back():
    clock = Clock()
    clock.counters[ck.STEP_LIMIT] = 2
    assert clock.advance().RUNNING == 1
    assert clock.advance().RUNNING == 0


def test_faults_stop_the_loop():
    clock = Clock().advance(faults=[ck.NO_PARTICLE, 17, 5], way=SKIN)
    assert clock.FAULT == ck.FAULT_STATE
    assert clock.FAULT_PARTICLE == 5
    assert clock.RUNNING == 0 and clock.REBUILD == 0 and clock.CHECK == 0


def test_list_is_looked_after_once_half_the_skin_is_used():
    assert Clock().advance(way=0.3 * SKIN, speed=0.1).CHECK == 0
    clock = Clock().advance(way=0.499 * SKIN, speed=0.1)
    assert clock.CHECK == 1 or clock.REBUILD == 1
    # far from where the list was built: no check can help
    assert Clock().advance(way=6 * SKIN, speed=0.1).REBUILD == 1


def test_a_check_holds_until_it_is_outlived_or_outrun():
    """What a check foresaw is trusted for as long as it lasts, less what came on top since, twice."""
    good = dict(CHECKED=0.5 * SKIN, CHECK_TIME=1.0, CHECK_LASTS=0.5, TIME=1.2, STEP=0.0)
    seen = dict(way=0.8 * SKIN, speed=0.01)
    assert Clock(**good).advance(**seen).CHECK == 0
    assert Clock(**good | {"TIME": 1.4999}).advance(**seen).CHECK == 1
    assert Clock(**good | {"DRIFT": 0.2 * SKIN}).advance(**seen).CHECK == 0
    assert Clock(**good | {"DRIFT": 0.26 * SKIN}).advance(**seen).CHECK == 1
    assert Clock(**good).advance(**seen, shift=0.26 * SKIN).CHECK == 1
    assert Clock(**good | {"CHECKED": 1.01 * SKIN}).advance(**seen).CHECK == 1


def test_unforeseen_motion_adds_up():
    """The drift bounds what a constant largest acceleration, and shifts, do after a check."""
    a, shift = 3.0, 1e-7
    clock = Clock(STEP_CAP=1e-4).advance(advancing=0)
    clock.values[ck.DRIFT] = clock.values[ck.DRIFT_SPEED] = 0.0
    begin = clock.advance(acceleration=a, shift=shift).TIME
    clock.values[ck.DRIFT] = clock.values[ck.DRIFT_SPEED] = 0.0
    for _ in range(50):
        clock.advance(acceleration=a, shift=shift)
    t = clock.TIME - begin
    assert 0.5 * a * t**2 + 49 * shift <= clock.DRIFT <= 0.55 * a * t**2 + 51 * shift
    assert clock.DRIFT_SPEED >= a * t * (1 - 1e-12)


@pytest.mark.parametrize(
    "limits, speed, period",
    [
        ({}, 0.1, ck.RARE_INTERVAL),
        ({"RARE_CAP": 3.5 * 2e-4}, 0.1, 4),
        ({"RARE_LIMIT": 2.5 * 2e-4 * 5.0}, 5.0, 3),
        ({"RARE_LIMIT": 0.5 * 2e-4 * 5.0}, 5.0, 1),
    ],
    ids=["steps", "time", "way", "every step"],
)
def test_rare_stages_run_again_in_time(limits, speed, period):
    """After some steps, or in the step in which a particle would go too far or capillary waves would move."""
    values = {"RARE_LIMIT": math.inf, "RARE_CAP": math.inf, "SKIN": 1.0, "FARTHEST": 5.0, "STEP_CAP": 2e-4, **limits}
    clock = Clock(SPEED=speed, **values).advance(advancing=0)
    found = []
    for _ in range(12):
        found.append(int(clock.RARE))
        clock.advance(speed=speed)
    expected = [int(step % period == period - 1) for step in range(12)]
    assert found == expected


def test_shift_and_kick_count_as_way():
    values = {"RARE_LIMIT": 4e-4, "RARE_CAP": math.inf, "SKIN": 1.0, "FARTHEST": 5.0}
    assert Clock(**values).advance(speed=1.0).RARE == 0
    assert Clock(**values).advance(speed=1.0, shift=1e-4).RARE == 1
    assert Clock(**values).advance(speed=1.0, acceleration=1.3e4).RARE == 1


def test_what_a_constraint_asks_for_is_done_once():
    """Excess pressure and drift hold for the step after the one that found them."""
    asked = {"EXCESS_PRESSURE": 3.0, "DRIFT_VELOCITY": 0.5}
    for rare, left in (1, asked), (0, dict.fromkeys(asked, 0.0)):
        clock = Clock(RARE_LIMIT=math.inf, RARE_CAP=math.inf, **asked)
        clock.values[ck.DRIFT_VELOCITY + 1 : ck.DRIFT_VELOCITY + 3] = 0.25
        clock.counters[ck.RARE] = rare
        clock.advance()
        assert {name: getattr(clock, name) for name in asked} == left
        assert (clock.values[ck.DRIFT_VELOCITY + 1 : ck.DRIFT_VELOCITY + 3] == (0.25 if rare else 0.0)).all()
        # preparing a portion of the run takes nothing away
        asked_again = clock.advance(advancing=0).EXCESS_PRESSURE
        assert asked_again == left["EXCESS_PRESSURE"]


def test_start_is_limited_like_any_step():
    """Without advancing, speed and acceleration are those the stepper put in."""
    clock = Clock(SPEED=5.0, ACCELERATION=4e6, SKIN=1.0).advance(advancing=0)
    assert clock.STEP == pytest.approx(0.25 * math.sqrt(H / 4e6))
    assert clock.TIME == 0.0


# the whole loop ---------------------------------------------------------------------------------------------

SPACING = 0.1
LEAN = Spec(dimension=2, precision="float64", periodic=(True, True))


def start(spec=LEAN, counts=(16, 14), velocity=None, device="cpu", **options):
    """Return (setup, stepper) of a periodic box of fluid, prepared."""
    x = lattice(counts, SPACING, 0.1, centre=False)
    size = np.array(counts) * SPACING
    if velocity is None:
        velocity = np.zeros_like(x)
    setup = Setup(spec, x, spacing=SPACING, lower=0.0, upper=size, velocity=velocity, device=device, **options)
    stepper = setup.stepper()
    stepper.prepare(fresh=True)
    return setup, stepper


def swirl(counts, speed, drift=(0.0, 0.0)):
    x = lattice(counts, SPACING, 0.1, centre=False)
    u, v = 2 * np.pi * x.T / (np.array(counts) * SPACING)[:, None]
    return speed * np.stack([np.sin(u) * np.cos(v), -np.cos(u) * np.sin(v)], axis=1) + drift


def test_run_ends_on_its_targets(device):
    _, stepper = start(velocity=swirl((16, 14), 0.5), device=device)
    for target in (0.05, 0.0513, 0.1):
        stepper.run(target, 10**6)
        clock, counters = stepper.read()
        assert clock[ck.TIME] == pytest.approx(target, rel=1e-12)
        assert counters[ck.FAULT] == 0
    done = counters[ck.STEPS]
    stepper.run(0.1, 10**6)
    assert stepper.read()[1][ck.STEPS] == done


def test_not_a_number_stops_the_run(device):
    """The run says which particle, and neither hangs nor goes on."""
    setup, stepper = start(device=device)
    velocity = setup.particles.get("velocity")
    velocity[7, 1] = np.nan
    setup.particles.put("velocity", velocity)
    stepper.run(1.0, 10**4)
    clock, counters = stepper.read()
    assert counters[ck.FAULT] == ck.FAULT_STATE
    assert counters[ck.FAULT_PARTICLE] == 7
    assert counters[ck.STEPS] <= 2 and counters[ck.RUNNING] == 0


def test_a_runaway_stops_the_run(device):
    setup, stepper = start(device=device)
    velocity = setup.particles.get("velocity")
    velocity[3] = [0.0, 11.0 * setup.clock[ck.SOUND]]
    setup.particles.put("velocity", velocity)
    stepper.run(1.0, 10**4)
    _, counters = stepper.read()
    assert counters[ck.FAULT] == ck.FAULT_STATE and counters[ck.FAULT_PARTICLE] == 3


def pairs_of(setup, stepper):
    """Return the pairs of the list as rows of the arrays."""
    n, width = setup.particles.count, stepper.list.width
    table = stepper.list.neighbours.numpy()
    table = table.reshape(n, width) if stepper.spec.row_list else table.reshape(width, n).T
    count = setup.particles.get("fluid_neighbours").astype(int)
    if "wall_neighbours" in setup.particles.arrays:
        count[: setup.particles.fluid_count] += setup.particles.get("wall_neighbours")
    return {(i, int(j)) for i in range(n) for j in table[i, : count[i]]}


@pytest.mark.parametrize("drift", [(0.0, 0.0), (3.0, -2.0)])
def test_list_stays_complete_between_rebuilds(drift, device):
    """After every step each pair within the support is listed; a common motion costs no more rebuilds."""
    counts = (16, 14)
    setup, stepper = start(velocity=swirl(counts, 1.0, drift), device=device)
    most = 80
    for step in range(most):
        stepper.run(1e3, 1)
        position = setup.particles.get("position")
        assert brute_force_pairs(position, setup.box, setup.support * (1 - 1e-9)) <= pairs_of(setup, stepper), step
        clock, counters = stepper.read()
        assert counters[ck.FAULT] == 0
    assert counters[ck.STEPS] == most
    way = clock[ck.TIME] * (1.0 + math.hypot(*drift))
    assert counters[ck.REBUILDS] > 1
    # a quarter of the list radius is the longest way between two rebuilds
    assert counters[ck.REBUILDS] >= 0.5 * way / clock[ck.FARTHEST]


def test_list_stays_complete_beside_walls(device):
    """Fluid that moves along, towards and away from particles that do not."""
    every = lattice((14, 14), SPACING, centre=False) - 0.3
    solid = ((every < 0) | (every > 0.8)).any(axis=1)
    fluid = every[~solid]
    spec = dataclasses.replace(LEAN, periodic=(False, False), walls=True)
    u, v = np.pi * fluid.T / 0.8
    velocity = 2.0 * np.stack([np.sin(u) * np.cos(v), -np.cos(u) * np.sin(v)], axis=1)
    setup = Setup(spec, fluid, walls=every[solid], spacing=SPACING, velocity=velocity, device=device)
    stepper = setup.stepper()
    stepper.prepare(fresh=True)
    nf = len(fluid)
    for step in range(60):
        stepper.run(1e3, 1)
        position = setup.particles.get("position")
        near = brute_force_pairs(position, setup.box, setup.support * (1 - 1e-9))
        assert {(i, j) for i, j in near if i < nf or j < nf} <= pairs_of(setup, stepper), step
    assert stepper.read()[1][ck.REBUILDS] > 1


def check(setup, stepper, offset, velocity, step):
    """Run the check of the list for given displacements and velocities of the fluid."""
    nf = setup.particles.fluid_count
    setup.particles.put("offset", offset)
    every = setup.particles.get("velocity")
    every[:nf] = velocity
    setup.particles.put("velocity", every)
    stepper.write(clock={ck.STEP: step, ck.ACCELERATION: 0.0, ck.SHIFT: 0.0}, counters={ck.REBUILD: 0})
    for task in stepper.list.check_tasks:
        task.run()
    clock, counters = stepper.read()
    return clock.copy(), bool(counters[ck.REBUILD])


def farthest_apart(setup, offset, velocity, lasts):
    """Return the largest relative displacement, until `lasts`, of particles that could come within the support."""
    anchor = setup.particles.get("anchor")
    every, speed = np.zeros_like(anchor), np.zeros_like(anchor)
    every[: len(offset)], speed[: len(offset)] = offset, velocity
    reach = 1.5 * setup.support * 1.12
    pairs = np.array(sorted(brute_force_pairs(anchor, setup.box, reach)))
    i, j = pairs[pairs[:, 0] < len(offset)].T
    moments = ((every[i] - every[j]) + t * (speed[i] - speed[j]) for t in np.linspace(0, lasts, 9))
    return max(np.linalg.norm(relative, axis=1).max() for relative in moments)


@pytest.mark.parametrize("walls", [False, True])
def test_check_sees_the_relative_motion(walls, device):
    """A list that passes bears the motion of all pairs near enough, now and for as long as the check lasts."""
    if walls:
        every = lattice((22, 22), SPACING, centre=False) - 0.3
        solid = ((every < 0) | (every > 1.6)).any(axis=1)
        spec = dataclasses.replace(LEAN, periodic=(False, False), walls=True)
        setup = Setup(spec, every[~solid], walls=every[solid], spacing=SPACING, device=device)
        stepper = setup.stepper()
        stepper.prepare(fresh=True)
    else:
        setup, stepper = start(counts=(26, 22), device=device)
    nf, skin, step = setup.particles.fluid_count, setup.clock[ck.SKIN], 1e-3
    x = setup.particles.get("anchor")[:nf]
    rng = np.random.default_rng(6)
    passed = refused = 0
    for _ in range(40):
        wave, phase = rng.integers(0, 3, (2, 2)), rng.uniform(0, 7, 2)
        shape = np.sin(2 * np.pi * (x / np.ptp(x, axis=0)) @ wave.T + phase)
        offset = skin * rng.uniform(0, 1.2) * shape + rng.normal(size=2) * skin * (0 if walls else 2)
        velocity = skin / (40 * step) * rng.normal(size=2) * np.roll(shape, 1, axis=1)
        clock, rebuild = check(setup, stepper, offset, velocity, step)
        if rebuild:
            refused += 1
            continue
        passed += 1
        assert clock[ck.CHECK_LASTS] >= 3 * step * (1 - 1e-9)
        largest = farthest_apart(setup, offset, velocity, clock[ck.CHECK_LASTS])
        assert largest <= clock[ck.CHECKED] + 1e-12 and clock[ck.CHECKED] <= skin
    assert passed >= 3 and refused >= 3


@pytest.mark.parametrize("part, rebuild", [(0.6, False), (1.05, True)])
def test_check_compares_neighbouring_cells(part, rebuild, device):
    """Two bodies, each rigid and in cells of its own, that have come nearer by `part` of the skin."""
    setup, stepper = start(counts=(26, 22), device=device)
    count, width = stepper.list.cells_per_axis[0], 2.6
    anchor = setup.particles.get("anchor")
    edge = (count // 2) * width / count
    right = (anchor[:, 0] > edge) & (anchor[:, 0] < width - 3 * width / count)
    offset = np.where(right, -part * setup.clock[ck.SKIN], 0.0)[:, None] * [1.0, 0.0]
    _, refused = check(setup, stepper, offset, np.zeros_like(offset), 1e-3)
    assert refused == rebuild


@pytest.mark.parametrize("part, rebuild", [(0.6, False), (1.3, True)])
def test_check_looks_across_a_periodic_boundary(part, rebuild, device):
    """A stretch that is gentle everywhere but where the box closes."""
    setup, stepper = start(counts=(26, 22), device=device)
    for axis, width in enumerate((2.6, 2.2)):
        anchor = setup.particles.get("anchor")
        offset = part * setup.clock[ck.SKIN] * anchor[:, axis : axis + 1] / width * np.eye(2)[axis]
        assert check(setup, stepper, offset, np.zeros_like(offset), 1e-3)[1] == rebuild


def test_check_compares_fluid_with_walls(device):
    """A body that slides along a wall as a whole."""
    every = lattice((14, 11), SPACING, centre=False) - 0.3
    solid = (every[:, 1] < 0) | (every[:, 0] < 0) | (every[:, 0] > 0.8)
    spec = dataclasses.replace(LEAN, periodic=(False, False), walls=True)
    setup = Setup(spec, every[~solid], walls=every[solid], spacing=SPACING, device=device)
    stepper = setup.stepper()
    stepper.prepare(fresh=True)
    for part, rebuild in ((0.6, False), (1.05, True)):
        offset = np.zeros((setup.particles.fluid_count, 2)) + [part * setup.clock[ck.SKIN], 0.0]
        assert check(setup, stepper, offset, np.zeros_like(offset), 1e-3)[1] == rebuild


def test_common_motion_needs_few_rebuilds(device):
    """A fluid that moves as a whole keeps its list until it has gone a quarter of the list radius."""
    setup, stepper = start(velocity=np.array([3.0, -2.0]), device=device)
    stepper.run(1.0, 10**6)
    clock, counters = stepper.read()
    assert counters[ck.FAULT] == 0
    assert counters[ck.REBUILDS] <= 2 + 1.2 * math.hypot(3.0, 2.0) / clock[ck.FARTHEST]
    assert clock[ck.FARTHEST] > 2 * setup.half_skin


def test_shear_asks_for_rebuilds(device):
    """A list is not kept for longer than its pairs hold."""
    counts = (16, 14)
    x = lattice(counts, SPACING, 0.1, centre=False)
    velocity = np.stack([4.0 * np.sin(2 * np.pi * x[:, 1] / 1.4), 0 * x[:, 0]], axis=1)
    setup, stepper = start(velocity=velocity, device=device, fluids=(Fluid(sound_speed=40.0),))
    stepper.run(0.1, 10**4)
    clock, counters = stepper.read()
    assert counters[ck.FAULT] == 0
    # neighbouring rows part at the rate of the shear times the support: about one skin each 0.12 / 18 s
    assert counters[ck.REBUILDS] >= 0.1 / (0.12 / 18) / 4
