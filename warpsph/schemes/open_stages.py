"""Stages of inlets and outlets that every scheme of fluid flow has: buffers filled at the start, births and crossings."""

from __future__ import annotations

import warp as wp

from warpsph.engine.program import Stage
from warpsph.kernels.core.crossing import BLOCKS, make_births, make_crossing, make_fill
from warpsph.kernels.core.spec import Spec


def fill(spec: Spec) -> list[Stage]:
    """Return the stages that fill the buffers of inlets and outlets."""
    if spec.open_axis < 0:
        return []
    write, count = make_fill(spec)
    return [
        Stage("fill_buffers", write, "fill_zone", "particles beyond inlets and outlets"),
        Stage("count_buffers", count, "one", "counts them in"),
    ]


def crossing(spec: Spec, clock_follows: bool = False) -> list[Stage]:
    """Return the stages that let particles in and out, before a list is made.

    clock_follows: the list is made in the middle of a step, before the clock goes on to the time of the positions.
    """
    if spec.open_axis < 0:
        return []
    count, place, write = make_births(spec)
    cross, count_in = make_crossing(spec)
    blocks = BLOCKS[spec.row_list]
    return [
        Stage("births", count, blocks, "rows of the inlets that go on"),
        Stage("births_place", place, "one", "is there room for them"),
        Stage("births_write", write, blocks, "new particles of these rows", {"step_share": wp.float64(clock_follows)}),
        Stage("crossing", cross, blocks, "fluid that comes in and goes out"),
        Stage("crossing_count", count_in, "one", "counts particles and mass"),
    ]
