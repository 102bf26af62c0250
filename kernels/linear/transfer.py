"""From a grid of the multigrid preconditioner to the next coarser one, and back: linear interpolation and its transpose."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.spec import types

from .decorators import make_sweep
from .levels import COLLAPSE, HALVE, Level, coordinates, make_layout


@wp.func
def axis_node(i: int, nodes: int, wrap: int):
    # node number along an axis, or -1 outside
    j = i
    if wrap == 1:
        if j >= nodes:
            j -= nodes
        if j < 0:
            j += nodes
    else:
        if j >= nodes:
            j = -1
    return j


@wp.func
def coarse_begin(way: int, node: int):
    if way == HALVE:
        return 2 * node - 1
    elif way == COLLAPSE:
        return 0
    return node


@wp.func
def coarse_end(way: int, node: int, nodes: int):
    if way == HALVE:
        return 2 * node + 2
    elif way == COLLAPSE:
        return nodes
    return node + 1


@wp.func
def axis_parents(way: int, node: int, nodes: int, wrap: int):
    # the nodes of the next level that a node lies between, each with half the weight
    low = int(node)
    high = int(node)
    if way == HALVE:
        low = node / 2
        high = (node + 1) / 2
        if wrap == 1 and high >= nodes:
            high = 0
    elif way == COLLAPSE:
        low = 0
        high = 0
    return low, high


@functools.cache
def make_transfer(dimension: int, precision: str) -> tuple[Any, Any]:
    """Return the `wp.func`s restrict_of(fine, coarse, node, ...) and prolong_of(fine, coarse, node, ...) of one node."""
    real = types(dimension, precision).real
    three = dimension > 2

    @wp.func
    def coarse_weight(way: int, fine_node: int, node: int):
        w = real(1.0)
        if way == HALVE:
            if fine_node != 2 * node:
                w = real(0.5)
        return w

    @wp.func
    def restrict_of(
        fine: Level,
        coarse: Level,
        node: int,
        node_inverse: wp.array(dtype=real),
        node_work: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
    ):
        total = real(0.0)
        if node_inverse[coarse.node_base + node] > real(0.0):
            at = coordinates(node, coarse.nodes)
            z0 = int(0)
            z1 = int(1)
            if wp.static(three):
                z0 = coarse_begin(fine.way[2], at[2])
                z1 = coarse_end(fine.way[2], at[2], fine.nodes[2])
            y0 = coarse_begin(fine.way[1], at[1])
            y1 = coarse_end(fine.way[1], at[1], fine.nodes[1])
            x0 = coarse_begin(fine.way[0], at[0])
            x1 = coarse_end(fine.way[0], at[0], fine.nodes[0])
            z = int(z0)
            while z < z1:
                jz = int(0)
                wz = real(1.0)
                if wp.static(three):
                    jz = axis_node(z, fine.nodes[2], fine.wrap[2])
                    wz = coarse_weight(fine.way[2], z, at[2])
                if jz >= 0:
                    y = int(y0)
                    while y < y1:
                        jy = axis_node(y, fine.nodes[1], fine.wrap[1])
                        if jy >= 0:
                            wy = wz * coarse_weight(fine.way[1], y, at[1])
                            x = int(x0)
                            while x < x1:
                                jx = axis_node(x, fine.nodes[0], fine.wrap[0])
                                if jx >= 0:
                                    w = wy * coarse_weight(fine.way[0], x, at[0])
                                    total += w * node_work[fine.node_base + (jz * fine.nodes[1] + jy) * fine.nodes[0] + jx]
                                x += 1
                        y += 1
                z += 1
        node_rhs[coarse.node_base + node] = total

    @wp.func
    def prolong_of(
        fine: Level,
        coarse: Level,
        node: int,
        node_inverse: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
    ):
        at = fine.node_base + node
        if node_inverse[at] > real(0.0):
            c = coordinates(node, fine.nodes)
            x0, x1 = axis_parents(fine.way[0], c[0], coarse.nodes[0], coarse.wrap[0])
            y0, y1 = axis_parents(fine.way[1], c[1], coarse.nodes[1], coarse.wrap[1])
            row0 = coarse.node_base + y0 * coarse.nodes[0]
            row1 = coarse.node_base + y1 * coarse.nodes[0]
            if wp.static(three):
                z0, z1 = axis_parents(fine.way[2], c[2], coarse.nodes[2], coarse.wrap[2])
                plane0 = z0 * coarse.nodes[0] * coarse.nodes[1]
                plane1 = z1 * coarse.nodes[0] * coarse.nodes[1]
                total = node_x[row0 + plane0 + x0] + node_x[row0 + plane0 + x1]
                total += node_x[row1 + plane0 + x0] + node_x[row1 + plane0 + x1]
                total += node_x[row0 + plane1 + x0] + node_x[row0 + plane1 + x1]
                total += node_x[row1 + plane1 + x0] + node_x[row1 + plane1 + x1]
                node_x[at] = node_x[at] + real(0.125) * total
            else:
                total = node_x[row0 + x0] + node_x[row0 + x1] + node_x[row1 + x0] + node_x[row1 + x1]
                node_x[at] = node_x[at] + real(0.25) * total

    return restrict_of, prolong_of


@functools.cache
def make_transfer_sweeps(dimension: int, precision: str, row_list: bool) -> tuple[Any, Any]:
    """Return the kernels grid_restrict and grid_prolong of one level."""
    real = types(dimension, precision).real
    listed = make_layout(dimension, row_list).listed
    restrict_of, prolong_of = make_transfer(dimension, precision)
    sweep = make_sweep(row_list)

    @sweep
    def grid_restrict(
        first: int,
        active_nodes: wp.array(dtype=int),
        fine: Level,
        coarse: Level,
        node_inverse: wp.array(dtype=real),
        node_work: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
    ):
        node = listed(wp.tid() + first, coarse.node_base, active_nodes)
        restrict_of(fine, coarse, node, node_inverse, node_work, node_rhs)

    @sweep
    def grid_prolong(
        first: int,
        active_nodes: wp.array(dtype=int),
        fine: Level,
        coarse: Level,
        node_inverse: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
    ):
        node = listed(wp.tid() + first, fine.node_base, active_nodes)
        prolong_of(fine, coarse, node, node_inverse, node_x)

    return grid_restrict, grid_prolong
