"""Several levels under one clock: each runs the same kernels with its own particles, list and parameters."""

import numpy as np
import pytest
import warp as wp

from tests.helpers import Fluid, Setup, lattice
from warpsph.engine.device_clock import DeviceClock
from warpsph.engine.launch import Launcher
from warpsph.engine.level import Level
from warpsph.engine.program import Births, BuildList, ForEachLevel, KeepList, Program, Rarely, Stage, Substeps, lines
from warpsph.engine.stepper import Stepper
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.spec import Spec
from warpsph.schemes import registry

SPEC = Spec(dimension=2, precision="float64", periodic=(True, True))
STEP = 1.0e-3


def scene(device, spacing, seed):
    """Waves of velocity in a periodic unit box."""
    count = round(1 / spacing)
    x = lattice((count, count), spacing, 0.1, seed, centre=False)
    velocity = np.stack([np.sin(2 * np.pi * x[:, 1]), np.cos(2 * np.pi * x[:, 0])], axis=1)
    fluids = [Fluid(sound_speed=10.0)]
    made = Setup(SPEC, x, spacing=spacing, lower=(0, 0), upper=(1, 1), velocity=velocity, fluids=fluids, device=device)
    made.clock[ck.STEP_CAP] = STEP
    return made


def stepper_of(scenes):
    """One step loop over scenes, a level each."""
    first = scenes[0]
    launcher, scheme = Launcher(first.device, 1), registry.find("riemann")
    clock = DeviceClock(first.spec, launcher, first.clock, first.counters)
    levels = [Level(s.particles, launcher, clock, s.values, s.list_keywords, None, scheme.work) for s in scenes]
    return Stepper(scheme, levels, clock)


def end(stepper, level=0):
    """Positions at t = 20 steps, in the order of the ids."""
    stepper.prepare(fresh=True)
    stepper.run(20 * STEP, 100)
    particles = stepper.levels[level].particles
    position = particles.get("anchor")
    position += particles.get("offset")
    return position[np.argsort(particles.get("particle_id"))] % 1.0


def test_levels_run_side_by_side(device):
    """Two resolutions in one loop end where each ends alone, but for the rounding of other list builds."""
    spacings = (1 / 16, 1 / 24)
    alone = [end(stepper_of([scene(device, spacing, 1)])) for spacing in spacings]
    both = stepper_of([scene(device, spacing, 1) for spacing in spacings])
    found = [end(both), None]
    particles = both.levels[1].particles
    found[1] = (particles.get("anchor") + particles.get("offset"))[np.argsort(particles.get("particle_id"))] % 1.0
    assert both.read()[1][ck.STEPS] == 20
    for one, other in zip(alone, found, strict=True):
        distance = np.abs(one - other)
        assert np.minimum(distance, 1 - distance).max() < 1e-12


def nothing(name="stage"):
    return Stage(name, None, "fluid", "")


@pytest.mark.parametrize("group", [Rarely([BuildList()]), Substeps(2, [KeepList()], ""), ForEachLevel([BuildList()])])
def test_a_list_within_a_group_is_refused(group):
    with pytest.raises(ValueError, match="list: may not stand in"):
        Program(step=[group], start=[], advance=nothing())


def test_births_without_a_list_are_refused():
    with pytest.raises(ValueError, match="births: needs a list right after it"):
        Program(step=[Births([nothing()]), nothing()], start=[], advance=nothing())


def test_a_tree_is_told_with_its_depth():
    tree = [nothing("a"), Substeps(3, [nothing("b"), Rarely([nothing("c")])], "why")]
    assert [(depth, name) for depth, name, _ in lines(tree)] == [
        (0, "a"), (0, "substeps (3 times)"), (1, "b"), (1, "rarely"), (2, "c"),
    ]  # fmt: skip


def test_substeps_and_levels_run_in_order(device):
    """A counter kernel shows how often and on which level nodes ran."""
    made = scene(device, 1 / 16, 1)

    @wp.kernel(module="unique", enable_backward=False)
    def count(first: int, tally: wp.array(dtype=int)):
        tally[0] = tally[0] + 1

    class Counting:
        def program(self, spec, choices):
            stage = Stage("count", count, "one", "")
            advance = registry.find("riemann").program(spec, {}).advance
            return Program([Substeps(3, [stage], ""), ForEachLevel([stage]), advance, KeepList()], [BuildList()], advance)

    made.values["tally"] = wp.zeros(1, dtype=int, device=made.device)
    launcher = Launcher(made.device, 1)
    clock = DeviceClock(made.spec, launcher, made.clock, made.counters)
    stepper = Stepper(Counting(), [Level(made.particles, launcher, clock, made.values, made.list_keywords)], clock)
    stepper.prepare(fresh=True)
    stepper.run(1.0, 5)
    assert made.values["tally"].numpy()[0] == 5 * (3 + 1)
