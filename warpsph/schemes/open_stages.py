"""Stages of inlets and outlets that schemes of fluid flow share.

Buffers filled at the start, births and crossings are those of all of them; those with sound share what arrives at the sides,
what holds there, and sponges, too.
"""

from __future__ import annotations

import warp as wp

from warpsph.engine.program import Absent, Stage
from warpsph.kernels.core.buffer_gradient import make_buffer_gradient
from warpsph.kernels.core.crossing import BLOCKS, make_births, make_crossing, make_fill
from warpsph.kernels.core.open_flow import make_arrival, make_buffer, make_face, make_side, make_site_sums, make_sponge
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


def open_flow(spec: Spec, beginning: int = 0) -> list[Stage]:
    """Return the stages with which inlets, outlets and their buffers get pressure and velocity, of schemes with sound."""
    if spec.open_axis < 0:
        return []
    start = {"beginning": beginning}
    return [
        Stage("open_arrival", make_arrival(spec), "site_side", "what arrives at inlets and outlets", start),
        Stage("open_sums", make_site_sums(spec), "site_sums", "the means of these over each side"),
        Stage("open_side", make_side(spec), "open_sides", "sound that leaves", start),
        Stage("open_face", make_face(spec), "site_side", "pressure and velocity of inlets and outlets"),
        Stage("open_buffer", make_buffer(spec), "fluid", "the flow beyond inlets and outlets"),
    ]


def buffer_gradient(spec: Spec, needed: bool) -> list[Stage]:
    """Return the stage of the pressure gradient beyond inlets and outlets, for terms with those of both of a pair."""
    if spec.open_axis < 0 or not needed:
        return []
    return [Stage("buffer_gradient", make_buffer_gradient(spec), "fluid", "pressure gradient beyond inlets and outlets")]


def sponge(spec: Spec) -> list[Stage]:
    """Return the stage of the damping layers inside of inlets and outlets."""
    if not spec.sponge:
        return []
    return [Stage("sponge", make_sponge(spec), "fluid", "layers that draw the flow to what inlets and outlets give")]


def closed_sides(spec: Spec) -> list[Absent]:
    """Return what a step leaves out where no side is an inlet or an outlet, and why."""
    if spec.open_axis >= 0:
        return []
    names = "open_arrival, open_sums, open_side, open_face, open_buffer, crossing"
    return [Absent(names, "no side of the domain is an inlet or an outlet")]
