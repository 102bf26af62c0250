"""Levels of the multigrid preconditioner: where they lie, and where things are on them.

A cell or node is numbered along x first. All levels lie one after the other in the same arrays; `Level` says where. Node
arrays have room before and after each level, so that a neighbour outside the grid, whose coupling is 0, can be read. Nodes
without particles near have inverse 0 and value 0.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.spec import types

# what an axis does from a level to the next coarser one
STAY = 0
HALVE = 1
COLLAPSE = 2  # to one node: constant along the axis


MOST_SWEEPS = 8  # before and as many after the coarser levels
SweepWeights = wp.types.vector(length=MOST_SWEEPS, dtype=float)


@wp.struct
class Level:
    """Where a level lies. Cells and nodes per axis; wrap: periodic; way: STAY, HALVE or COLLAPSE to the next level.

    pairs: pairs of sweeps before and after the next level; weights: of their sweeps, in this order before, reversed after.
    """

    cells: wp.vec3i
    nodes: wp.vec3i
    wrap: wp.vec3i
    way: wp.vec3i
    cell_base: int
    cell_count: int
    node_base: int
    node_count: int
    pairs: int
    weights: SweepWeights


@functools.cache
def make_frame(dimension: int, precision: str) -> Any:
    """Return the struct `Frame`: lower corner of the finest grid [m] and 1 / cell width [1/m]."""
    vec = types(dimension, precision).vec

    @wp.struct
    class Frame:
        origin: vec
        inv_cell: vec

    return Frame


@wp.func
def coordinates(index: int, counts: wp.vec3i):
    return wp.vec3i(index % counts[0], (index / counts[0]) % counts[1], index / (counts[0] * counts[1]))


class Layout(NamedTuple):
    """`wp.func`s of one layout: listed cells and nodes, how many, places of entries, see `make_layout`."""

    listed: Any
    listed_count: Any
    element_at: Any
    stencil_at: Any
    corner_at: Any


@functools.cache
def make_layout(dimension: int, row_list: bool) -> Layout:
    """Return how the arrays of the levels are laid out: cell by cell and node by node on a CPU (`row_list`), or else entry
    by entry."""
    corners = 2**dimension
    size = 3**dimension
    level_wide = corners * corners

    @wp.func
    def listed(item: int, base: int, active: wp.array(dtype=int)):
        # a CPU works through lists of the cells and nodes with particles near; a GPU passes over the others faster than it
        # could list them
        if wp.static(row_list):
            return active[base + item]
        else:
            return item

    @wp.func
    def listed_count(k: int, kind: int, count: int, active_counts: wp.array(dtype=int)):
        # cells (kind 0) or nodes (kind 1) of level k to visit
        if wp.static(row_list):
            return active_counts[2 * k + kind]
        else:
            return count

    @wp.func
    def element_at(level: Level, cell: int, entry: int):
        if wp.static(row_list):
            return (level.cell_base + cell) * wp.static(level_wide) + entry
        else:
            return level.cell_base * wp.static(level_wide) + entry * level.cell_count + cell

    @wp.func
    def stencil_at(level: Level, node: int, slot: int):
        if wp.static(row_list):
            return (level.node_base + node) * wp.static(size) + slot
        else:
            return level.node_base * wp.static(size) + slot * level.node_count + node

    @wp.func
    def corner_at(level: Level, cell: int, corner: int):
        if wp.static(row_list):
            return cell * wp.static(corners) + corner
        else:
            return corner * level.cell_count + cell

    return Layout(listed, listed_count, element_at, stencil_at, corner_at)


class Corners(NamedTuple):
    """`wp.func`s of a point in a cell and of the corners of the cell, see `make_corners`."""

    place: Any
    weight: Any
    gradient: Any
    node: Any


@functools.cache
def make_corners(dimension: int, precision: str) -> Corners:
    """Return place(x, frame, level) -> (cell, place in it), and the functions of a corner: value, gradient, its node."""
    real, vec, _, _ = types(dimension, precision)
    Frame = make_frame(dimension, precision)
    three = dimension > 2

    @wp.func
    def axis_place(s: real, cells: int, wrap: int):
        # cell and place within it; positions outside an axis that is not periodic are moved to its rim
        c = int(s)
        if s < real(0.0):
            c -= 1
        if wrap == 0:
            c = wp.clamp(c, 0, cells - 1)
        f = wp.clamp(s - real(c), real(0.0), real(1.0))
        if wrap == 1:
            c = c % cells
            if c < 0:
                c += cells
        return c, f

    @wp.func
    def place(x: vec, frame: Frame, level: Level):
        c = wp.vec3i(0, 0, 0)
        f = vec()
        for axis in range(wp.static(dimension)):
            s = wp.clamp((x[axis] - frame.origin[axis]) * frame.inv_cell[axis], real(-1.0e9), real(1.0e9))
            cell, rest = axis_place(s, level.cells[axis], level.wrap[axis])
            c[axis] = cell
            f[axis] = rest
        return c, f

    @wp.func
    def corner_weight(corner: int, f: vec):
        w = real(1.0)
        for axis in range(wp.static(dimension)):
            if ((corner >> axis) & 1) == 1:
                w *= f[axis]
            else:
                w *= real(1.0) - f[axis]
        return w

    @wp.func
    def corner_gradient(corner: int, f: vec, frame: Frame):
        g = vec()
        for axis in range(wp.static(dimension)):
            d = frame.inv_cell[axis]
            if ((corner >> axis) & 1) == 0:
                d = -d
            for other in range(wp.static(dimension)):
                if other != axis:
                    if ((corner >> other) & 1) == 1:
                        d *= f[other]
                    else:
                        d *= real(1.0) - f[other]
            g[axis] = d
        return g

    @wp.func
    def corner_node(cell: wp.vec3i, corner: int, level: Level):
        ix = cell[0] + (corner & 1)
        iy = cell[1] + ((corner >> 1) & 1)
        iz = int(0)
        if level.wrap[0] == 1 and ix >= level.nodes[0]:
            ix = 0
        if level.wrap[1] == 1 and iy >= level.nodes[1]:
            iy = 0
        if wp.static(three):
            iz = cell[2] + ((corner >> 2) & 1)
            if level.wrap[2] == 1 and iz >= level.nodes[2]:
                iz = 0
        return (iz * level.nodes[1] + iy) * level.nodes[0] + ix

    return Corners(place, corner_weight, corner_gradient, corner_node)
