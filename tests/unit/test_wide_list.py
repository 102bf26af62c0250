"""Lists of more entries than 31 bits number: the same entries, the same results, and the last entry at its place."""

import mmap
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from tests.helpers import Bench
from tests.isph_scenes import COUETTE, TANK
from tests.scenes import FULL, PERIODIC, case_of
from warpsph import Simulation
from warpsph.engine import neighbours
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.pair import make_entry
from warpsph.kernels.core.spec import Spec
from warpsph.solvers import linear_solver

ROOT = Path(__file__).resolve().parents[2]
NOTHING = {"output__particles": "none", "output__checkpoint": "none"}
DEEP = 4
"""Entries a row beyond which a list counts as wide in tests of whole runs: any has more."""


def narrow_up_to(monkeypatch, entries):
    """Make every list of more entries a wide one."""
    monkeypatch.setattr(neighbours, "LARGEST_NARROW", entries)
    monkeypatch.setattr(linear_solver, "LARGEST_NARROW", entries)


@pytest.mark.parametrize("row_list", [True, False])
def test_the_last_of_more_than_2_to_the_31_entries(row_list):
    """Its address is that of entry n width - 1, on a mapping of 9 GB of which two pages are touched."""
    if sys.platform != "linux":
        pytest.skip("needs memory that is not there until it is touched")
    n, width = 32_000_000, 70
    assert n * width > 2**31
    flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | 0x4000  # MAP_NORESERVE
    memory = mmap.mmap(-1, 4 * n * width, flags=flags)
    entries = np.frombuffer(memory, dtype=np.int32)
    shape = (n, width) if row_list else (width, n)
    table = wp.array(ptr=entries.ctypes.data, dtype=int, shape=shape, device="cpu")
    begin, step, read, List, write = make_entry(row_list, True)

    @wp.kernel(module="unique", enable_backward=False)
    def put_last(n: int, width: int, table: List, seen: wp.array(dtype=int)):
        i = n - 1
        k = begin(i, width) + (width - 1) * step(n)
        write(table, i, k, 7)
        seen[0] = read(table, i, k)
        seen[1] = read(table, i, k - step(n))

    seen = wp.zeros(2, dtype=int, device="cpu")
    before = n * width - 2 if row_list else n * (width - 1) - 1
    entries[before] = 5
    wp.launch(put_last, 1, [n, width, table, seen], device="cpu")
    assert entries[n * width - 1] == 7
    assert seen.numpy().tolist() == [7, 5]
    del table, entries


@pytest.mark.parametrize("row_list", [True, False])
@pytest.mark.parametrize("periodic", [(False, True), (True, False, True)])
def test_a_wide_list_holds_the_entries_of_a_narrow_one(row_list, periodic, device, monkeypatch):
    if row_list and device != "cpu":
        pytest.skip("the layout of a CPU")
    size = np.array([1.3, 1.2, 0.9][: len(periodic)])
    x = np.random.default_rng(1).uniform(0, 1, (400, len(size))) * size
    spec = Spec(dimension=len(size), precision="float64", periodic=periodic, row_list=row_list)
    options = {"spacing": 0.1, "ratio": 1.0, "lower": 0.0, "upper": size, "width": 200, "device": device}
    narrow = Bench(spec, x, **options)
    narrow_up_to(monkeypatch, 400 * 200 - 1)
    wide = Bench(spec, x, **options)
    assert (narrow.list.spec.wide_list, wide.list.spec.wide_list) == (False, True)
    assert wide.list.neighbours.shape == ((400, 200) if row_list else (200, 400))
    assert wide.list.memory() == narrow.list.memory()
    assert wide.neighbours() == narrow.neighbours()


COMPARE = """
import sys
import numpy as np
from warpsph.kernels.core.spec import SWEEP_OPTIONS
SWEEP_OPTIONS.update(fast_math=False, cpu_compiler_flags="")
from tests.unit.test_wide_list import *
{call}
"""


def in_order(call):
    """Run a function of this module in a process that adds up in the order of the list: a CPU may else take another one
    for another layout, and the flags of a compiled kernel stay as they are."""
    done = subprocess.run(
        [sys.executable, "-c", COMPARE.format(call=call)], cwd=ROOT, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr


SCENES = {
    "two phases, tension, walls": (FULL, {"end_time": 0.05, **NOTHING}),
    "periodic": (PERIODIC, {"end_time": 0.05, **NOTHING}),
    "isph with a free surface": (TANK, {}),
    "isph with implicit viscosity": (COUETTE, {"end_time": 0.3, "numerics__implicit_viscosity": True}),
}


def compare_layouts(name, device):
    """Run a scene with a narrow and with a wide list; every kept field, the clock and the counters are the same."""
    scene, changes = SCENES[name]
    case = case_of(scene, **changes)
    states = []
    for entries in (2**31 - 1, DEEP):
        neighbours.LARGEST_NARROW = linear_solver.LARGEST_NARROW = entries
        run = Simulation(case, device=device, threads=1).run()
        states.append(run.model.save_state())
        states[-1]["counters"][ck.STEP_LIMIT] = 0  # follows from how fast this machine is
        assert run.model.stepper.spec.wide_list == (entries == DEEP)
        assert run.model.steps > 3
        if scene in (TANK, COUETTE):
            assert run.model.stepper.systems.matrix.wide == (entries == DEEP)
    for key in states[0]:
        np.testing.assert_array_equal(states[0][key], states[1][key], err_msg=key)


@pytest.mark.parametrize("name", SCENES)
def test_a_run_with_a_wide_list_is_the_same_bit_by_bit(name, device):
    in_order(f"compare_layouts({name!r}, {device!r})")


def compare_grown(scene, device):
    """Run with a list that begins narrow, proves too narrow and is wide after it has grown; and with room from the start."""
    case = case_of(scene, end_time=0.1, **({} if scene is TANK else NOTHING))
    straight = Simulation(case, device=device, threads=1).run()
    assert not straight.model.stepper.spec.wide_list
    neighbours.LARGEST_NARROW = linear_solver.LARGEST_NARROW = 4 * straight.model.particles.count
    run = Simulation(case.replace({"numerics.neighbour_capacity": 4}), device=device, threads=1)
    run.run()
    assert run.model.stepper.spec.wide_list
    np.testing.assert_array_equal(run.state.position, straight.state.position)


@pytest.mark.parametrize("scene", ["PERIODIC", "TANK"])
def test_a_list_that_grows_wide_in_a_run(scene, device):
    in_order(f"compare_grown({scene}, {device!r})")


def compare_real():
    """Three steps with room for more than 2^31 neighbours and with room for as many as there are."""
    case = case_of(PERIODIC, particle_spacing=1 / 257, end_time=1.0, **NOTHING)
    positions = []
    for capacity in ("auto", 32764):
        run = Simulation(case.replace({"numerics.neighbour_capacity": capacity}), threads=2)
        run.model.stepper.run(1.0, 3)
        positions.append(run.state.position)
        entries = run.model.stepper.list.neighbours.size
        assert (entries > 2**31) == (capacity != "auto") == run.model.stepper.spec.wide_list
    np.testing.assert_array_equal(*positions)


def test_a_run_with_more_than_2_to_the_31_entries():
    """Real ones, of which most are never touched."""
    if sys.platform != "linux":
        pytest.skip("needs memory that is not there until it is touched")
    in_order("compare_real()")
