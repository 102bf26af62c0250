"""The small levels of the multigrid preconditioner, all of them by one block (one thread on a CPU).

A launch or a barrier costs more than they do. The operator of the coarsest one is inverted.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.spec import types

from .decorators import make_sweep
from .elements import make_coarse_element, make_node_stencil
from .levels import Level, coordinates, make_layout
from .reductions import barrier
from .smoothers import make_smoothers
from .transfer import make_transfer


@functools.cache
def make_inverse(dimension: int, precision: str, row_list: bool) -> Any:
    """Return the `wp.func` invert_coarsest(t, lanes, level, stencil, node_inverse, work, inverse)."""
    real = types(dimension, precision).real
    stencil_at = make_layout(dimension, row_list).stencil_at
    size = 3**dimension
    centre = size // 2
    three = dimension > 2
    regular = 1.0 + {"float32": 1.0e-5, "float64": 1.0e-9}[precision]

    @wp.func
    def invert_coarsest(
        t: int,
        lanes: int,
        level: Level,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        work: wp.array(dtype=wp.float64),
        inverse: wp.array(dtype=real),
    ):
        """Inverse of the dense operator by the sweep operator, 0 for nodes without particles near.

        A part of the diagonal is added: a null vector then costs a pivot that stands out from rounding. What it makes of the
        rest is no more than that part over the smallest eigenvalue, a hundredth.
        """
        m = level.node_count
        item = int(t)
        while item < m * m:
            work[item] = wp.float64(0.0)
            item += lanes
        barrier()
        node = int(t)
        while node < m:
            if node_inverse[level.node_base + node] > real(0.0):
                at = coordinates(node, level.nodes)
                diagonal = wp.float64(0.0)
                for slot in range(wp.static(size)):
                    value = wp.float64(stencil[stencil_at(level, node, slot)])
                    if slot == wp.static(centre):
                        diagonal += value
                    elif value != wp.float64(0.0):
                        diagonal -= value
                        jx = (at[0] + slot % 3 - 1 + level.nodes[0]) % level.nodes[0]
                        jy = (at[1] + (slot / 3) % 3 - 1 + level.nodes[1]) % level.nodes[1]
                        other = jy * level.nodes[0] + jx
                        if wp.static(three):
                            jz = (at[2] + slot / 9 - 1 + level.nodes[2]) % level.nodes[2]
                            other += jz * level.nodes[0] * level.nodes[1]
                        work[node * m + other] = work[node * m + other] + value
                work[node * m + node] = work[node * m + node] + diagonal * wp.float64(wp.static(regular))
            node += lanes
        barrier()
        k = int(0)
        while k < m:
            pivot = work[k * m + k]
            if node_inverse[level.node_base + k] > real(0.0) and pivot > wp.float64(0.0):
                if wp.static(row_list):
                    for i in range(m):
                        factor = work[i * m + k] / pivot
                        if i != k and factor != wp.float64(0.0):
                            for j in range(m):
                                if j != k:
                                    work[i * m + j] = work[i * m + j] - factor * work[k * m + j]
                else:
                    item = int(t)
                    while item < m * m:
                        i = item / m
                        j = item - i * m
                        if i != k and j != k:
                            work[item] = work[item] - work[i * m + k] * work[k * m + j] / pivot
                        item += lanes
                barrier()
                item = int(t)
                while item < m:
                    if item == k:
                        work[k * m + k] = wp.float64(-1.0) / pivot
                    else:
                        work[k * m + item] = work[k * m + item] / pivot
                        work[item * m + k] = work[item * m + k] / pivot
                    item += lanes
            else:
                barrier()
                item = int(t)
                while item < m:
                    work[k * m + item] = wp.float64(0.0)
                    work[item * m + k] = wp.float64(0.0)
                    item += lanes
            barrier()
            k += 1
        item = int(t)
        while item < m * m:
            inverse[item] = real(-work[item])
            item += lanes

    return invert_coarsest


@functools.cache
def make_small_setup(dimension: int, precision: str, row_list: bool) -> Any:
    """Return the kernel grid_small_setup: operators of the small levels and the inverse of the coarsest."""
    real = types(dimension, precision).real
    layout = make_layout(dimension, row_list)
    listed, listed_count = layout.listed, layout.listed_count
    coarse_element_row = make_coarse_element(dimension, precision, row_list)
    node_stencil = make_node_stencil(dimension, precision, row_list)
    invert_coarsest = make_inverse(dimension, precision, row_list)
    corners = 2**dimension
    sweep = make_sweep(row_list)

    @sweep
    def grid_small_setup(
        lanes: int,
        first_small: int,
        level_count: int,
        levels: wp.array(dtype=Level),
        active_counts: wp.array(dtype=int),
        active_cells: wp.array(dtype=int),
        active_nodes: wp.array(dtype=int),
        element: wp.array(dtype=real),
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        coarsest_work: wp.array(dtype=wp.float64),
        coarsest_inverse: wp.array(dtype=real),
    ):
        """Elements and stencils of the levels from first_small on, and the inverse of the last; the elements of the level
        before are there."""
        t = wp.tid()
        k = int(first_small)
        while k < level_count:
            level = levels[k]
            if k > 0:
                finer = levels[k - 1]
                count = listed_count(k, 0, level.cell_count, active_counts) * wp.static(corners)
                item = int(t)
                while item < count:
                    entry = item / wp.static(corners)
                    cell = listed(entry, level.cell_base, active_cells)
                    coarse_element_row(finer, level, cell, item - entry * wp.static(corners), element)
                    item += lanes
                barrier()
            count = listed_count(k, 1, level.node_count, active_counts)
            item = int(t)
            while item < count:
                node_stencil(level, listed(item, level.node_base, active_nodes), element, stencil, node_inverse)
                item += lanes
            k += 1
        barrier()
        invert_coarsest(t, lanes, levels[level_count - 1], stencil, node_inverse, coarsest_work, coarsest_inverse)

    return grid_small_setup


@functools.cache
def make_two_sweeps(dimension: int, precision: str, row_list: bool) -> Any:
    """Return the `wp.func` two_sweeps of one block: a pair of Jacobi sweeps, from `node_x` to `node_work` and back."""
    real = types(dimension, precision).real
    listed = make_layout(dimension, row_list).listed
    sweep_of = make_smoothers(dimension, precision, row_list).sweep

    @wp.func
    def two_sweeps(
        t: int,
        lanes: int,
        count: int,
        level: Level,
        active_nodes: wp.array(dtype=int),
        v: real,
        w: real,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
        node_work: wp.array(dtype=real),
    ):
        item = int(t)
        while item < count:
            node = listed(item, level.node_base, active_nodes)
            sweep_of(level, node, v, stencil, node_inverse, node_rhs, node_x, node_work)
            item += lanes
        barrier()
        item = int(t)
        while item < count:
            node = listed(item, level.node_base, active_nodes)
            sweep_of(level, node, w, stencil, node_inverse, node_rhs, node_work, node_x)
            item += lanes
        barrier()

    return two_sweeps


@functools.cache
def make_small_cycle(dimension: int, precision: str, row_list: bool) -> Any:
    """Return the kernel grid_small_cycle: the part of a cycle on the small levels."""
    real = types(dimension, precision).real
    layout = make_layout(dimension, row_list)
    listed, listed_count = layout.listed, layout.listed_count
    first_sweeps_of, _, residual_of = make_smoothers(dimension, precision, row_list)
    restrict_of, prolong_of = make_transfer(dimension, precision)
    two_sweeps = make_two_sweeps(dimension, precision, row_list)
    sweep = make_sweep(row_list)

    @sweep
    def grid_small_cycle(
        lanes: int,
        first_small: int,
        level_count: int,
        levels: wp.array(dtype=Level),
        active_counts: wp.array(dtype=int),
        active_nodes: wp.array(dtype=int),
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
        node_work: wp.array(dtype=real),
        coarsest_inverse: wp.array(dtype=real),
    ):
        """Cycle over the levels from first_small on, whose right-hand side is there, by one block."""
        t = wp.tid()
        k = int(first_small)
        while k + 1 < level_count:
            level = levels[k]
            coarse = levels[k + 1]
            count = listed_count(k, 1, level.node_count, active_counts)
            item = int(t)
            while item < count:
                node = listed(item, level.node_base, active_nodes)
                first_sweeps_of(level, node, stencil, node_inverse, node_rhs, node_x)
                item += lanes
            barrier()
            for pair in range(1, level.pairs):
                v = real(level.weights[2 * pair])
                w = real(level.weights[2 * pair + 1])
                two_sweeps(t, lanes, count, level, active_nodes, v, w, stencil, node_inverse, node_rhs, node_x, node_work)
            item = int(t)
            while item < count:
                node = listed(item, level.node_base, active_nodes)
                residual_of(level, node, stencil, node_inverse, node_rhs, node_x, node_work)
                item += lanes
            barrier()
            coarse_count = listed_count(k + 1, 1, coarse.node_count, active_counts)
            item = int(t)
            while item < coarse_count:
                node = listed(item, coarse.node_base, active_nodes)
                restrict_of(level, coarse, node, node_inverse, node_work, node_rhs)
                item += lanes
            barrier()
            k += 1
        k = level_count - 1
        level = levels[k]
        m = level.node_count
        node = int(t)
        while node < m:
            total = real(0.0)
            for other in range(m):
                total += coarsest_inverse[other * m + node] * node_rhs[level.node_base + other]
            node_x[level.node_base + node] = total
            node += lanes
        barrier()
        k -= 1
        while k >= first_small:
            level = levels[k]
            coarse = levels[k + 1]
            count = listed_count(k, 1, level.node_count, active_counts)
            item = int(t)
            while item < count:
                prolong_of(level, coarse, listed(item, level.node_base, active_nodes), node_inverse, node_x)
                item += lanes
            barrier()
            for pair in range(level.pairs):
                v = real(level.weights[2 * (level.pairs - pair) - 1])
                w = real(level.weights[2 * (level.pairs - pair) - 2])
                two_sweeps(t, lanes, count, level, active_nodes, v, w, stencil, node_inverse, node_rhs, node_x, node_work)
            k -= 1

    return grid_small_cycle
