"""Loops over pairs that look a neighbour ahead, registers of sweeps, and sums over blocks of particles."""

import dataclasses

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.core.block_sums import FOLDS, LANES, make_block_sums
from warpsph.kernels.core.pair import look_ahead, make_entry, make_look_ahead
from warpsph.kernels.core.spec import Spec, few_particles, pair_sweep

SEVERAL = Spec(dimension=2, precision="float32", multiphase=True, row_list=False)
COUNTS = [0, 1, 3, 5, 0, 2]  # neighbours of six particles; the list has room for five each


def visited(row_list: bool, wide: bool, ahead: bool, device: str) -> list[list[int]]:
    """Return the entries that the loop sees, particle by particle: entry n of particle i is 10 i + n."""
    rows, width = len(COUNTS), max(COUNTS)
    access = make_entry(row_list, wide)
    list_begin, list_step, List = access.begin, access.step, access.array
    look, taken, onward = make_look_ahead(row_list, wide, ahead)

    @wp.kernel(module="unique", enable_backward=False)
    def collect(entries: List, counts: wp.array(dtype=int), width: int, found: wp.array2d(dtype=int)):
        i = wp.tid()
        step = list_step(counts.shape[0])
        k = list_begin(i, width)
        end = k + counts[i] * step
        ahead = look(entries, i, k, end)
        n = int(0)
        while k < end:
            j = taken(ahead, entries, i, k)
            k, ahead = onward(entries, i, k, step, end)
            found[i, n] = j
            n += 1

    table = 10 * np.arange(rows)[:, None] + np.arange(width)
    entries = table if row_list else table.T
    if not wide:
        entries = entries.ravel()
    found = wp.full((rows, width), -1, dtype=int, device=device)
    values = [wp.array(np.ascontiguousarray(entries), dtype=int, device=device), wp.array(COUNTS, dtype=int, device=device)]
    wp.launch(collect, dim=rows, inputs=[*values, width, found], device=device)
    return [[int(j) for j in row if j >= 0] for row in found.numpy()]


@pytest.mark.parametrize("ahead", [False, True], ids=["as needed", "ahead"])
@pytest.mark.parametrize("wide", [False, True], ids=["", "wide"])
@pytest.mark.parametrize("row_list", [False, True], ids=["columns", "rows"])
def test_every_neighbour_is_seen_once_and_in_order(row_list, wide, ahead, device):
    assert visited(row_list, wide, ahead, device) == [[10 * i + n for n in range(count)] for i, count in enumerate(COUNTS)]


def test_who_looks_ahead():
    """Sweeps over several phases on a GPU; with one phase, and on a CPU, entries are read when they are needed."""
    assert look_ahead(SEVERAL) is make_look_ahead(False, False, True)
    assert look_ahead(dataclasses.replace(SEVERAL, multiphase=False)) is make_look_ahead(False, False, False)
    assert look_ahead(dataclasses.replace(SEVERAL, row_list=True)) is make_look_ahead(True, False, False)


def test_registers_are_limited_where_particles_wait_for_them():
    """132 multiprocessors with four blocks of 256 each have 135 168 threads."""
    assert few_particles(SEVERAL, 135_168, 132) and not few_particles(SEVERAL, 135_169, 132)
    double = dataclasses.replace(SEVERAL, precision="float64")
    assert few_particles(double, 67_584, 132) and not few_particles(double, 67_585, 132)
    assert "launch_bounds" in pair_sweep(SEVERAL)
    assert "launch_bounds" not in pair_sweep(dataclasses.replace(SEVERAL, few=True))
    assert "launch_bounds" not in pair_sweep(dataclasses.replace(SEVERAL, multiphase=False))


@pytest.mark.parametrize("count", [1, 255, 256, 257, 5000])
@pytest.mark.parametrize("row_list", [False, True], ids=["columns", "rows"])
def test_sums_over_blocks(row_list, count, device):
    """Of integers a float64 sum is exact in any order. A CPU has blocks of stretches, or of one particle (columns)."""
    if row_list and device != "cpu":
        pytest.skip("the layout of a CPU")
    store_block, total_of_blocks = make_block_sums(wp.vec2d, row_list)
    lanes = 1 if device == "cpu" else LANES
    block_count = FOLDS + 7 if row_list else -(-count // lanes)

    @wp.kernel(module="unique", enable_backward=False)
    def add(count: int, block_count: int, rows: wp.array(dtype=wp.vec2d), sums: wp.array(dtype=wp.vec2d)):
        t = wp.tid()
        begin = t
        end = wp.min(t + 1, count)
        if wp.static(row_list):
            chunk = (count + block_count - 1) / block_count
            begin = t * chunk
            end = wp.min(begin + chunk, count)
        own = wp.vec2d()
        for k in range(begin, end):
            own += rows[k]
        store_block(t, own, sums)

    @wp.kernel(module="unique", enable_backward=False)
    def close(block_count: int, sums: wp.array(dtype=wp.vec2d), total: wp.array(dtype=wp.vec2d)):
        t = wp.tid()
        found = total_of_blocks(t, block_count, sums)
        if t == 0:
            total[0] = found

    values = np.stack([np.arange(count), np.arange(count)[::-1] ** 2], axis=1).astype(float)
    rows = wp.array(values, dtype=wp.vec2d, device=device)
    sums, total = wp.zeros(block_count, dtype=wp.vec2d, device=device), wp.zeros(1, dtype=wp.vec2d, device=device)
    wp.launch(add, dim=block_count * lanes, inputs=[count, block_count, rows, sums], device=device)
    wp.launch(close, dim=lanes, inputs=[block_count, sums, total], device=device)
    np.testing.assert_array_equal(total.numpy()[0], values.sum(axis=0))
