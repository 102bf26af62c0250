"""Between the particles and the finest grid of the multigrid preconditioner."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import make_entry
from warpsph.kernels.core.spec import types

from .decorators import make_sweep
from .levels import Level, coordinates, make_corners, make_frame, make_layout
from .products import make_product
from .reductions import make_sums
from .solve_state import RESIDUAL_MEAN


@functools.cache
def make_particle_sweeps(precision: str, row_list: bool, count_type: Any, wide: bool) -> tuple[Any, Any]:
    """Return the kernels particle_residual and particle_smooth, before and after the grids."""
    real = types(2, precision).real
    store_sums, _ = make_sums(row_list)
    row_product, _, _ = make_product(precision, row_list, count_type, wide)
    Columns, Values = make_entry(row_list, wide).array, make_entry(row_list, wide, real).array
    sweep = make_sweep(row_list)

    @sweep
    def particle_residual(
        first: int,
        n: int,
        chunk: int,
        width: int,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        source: wp.array(dtype=real),
        result: wp.array(dtype=real),
        particle_work: wp.array(dtype=real),
        solve_state: wp.array(dtype=wp.float64),
    ):
        """Work = source - A result.

        A residual of a singular system sums to zero but for rounding. The grids would multiply what is left with the number
        of particles: it is taken out.
        """
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        mean = real(solve_state[RESIDUAL_MEAN])
        while i < end:
            rest = source[i] - row_product(i, n, width, counts, columns, values, excess, result)
            particle_work[i] = rest - mean
            i += 1

    @sweep
    def particle_smooth(
        first: int,
        n: int,
        chunk: int,
        width: int,
        weight: real,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        inverse: wp.array(dtype=real),
        source: wp.array(dtype=real),
        particle_work: wp.array(dtype=real),
        result: wp.array(dtype=real),
        sums: wp.array(dtype=wp.vec3d),
    ):
        """Result = work + weight / diagonal (source - A work); sums of source, source . result, and result over rows."""
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        rz = wp.float64(0.0)
        total_r = wp.float64(0.0)
        total_z = wp.float64(0.0)
        while i < end:
            r = source[i]
            rest = r - row_product(i, n, width, counts, columns, values, excess, particle_work)
            z = particle_work[i] + weight * inverse[i] * rest
            result[i] = z
            rz += wp.float64(r) * wp.float64(z)
            if int(counts[i]) > 0:
                total_r += wp.float64(r)
                total_z += wp.float64(z)
            i += 1
        store_sums(t, total_r, rz, total_z, sums)

    return particle_residual, particle_smooth


@functools.cache
def make_gather(dimension: int, precision: str, row_list: bool) -> tuple[Any, Any]:
    """Return the kernels grid_collect and grid_gather: from the particles to the cells, from the cells to the nodes."""
    real, vec, _, _ = types(dimension, precision)
    layout = make_layout(dimension, row_list)
    listed, corner_at = layout.listed, layout.corner_at
    corner_weight = make_corners(dimension, precision).weight
    corners = 2**dimension
    three = dimension > 2
    row_vec = wp.types.vector(length=corners, dtype=real)
    sweep = make_sweep(row_list)

    @sweep
    def grid_collect(
        first: int,
        level: Level,
        grid_order: wp.array(dtype=int),
        grid_fraction: wp.array(dtype=vec),
        range_begin: wp.array(dtype=int),
        range_end: wp.array(dtype=int),
        active_cells: wp.array(dtype=int),
        particle_work: wp.array(dtype=real),
        corner_sums: wp.array(dtype=real),
    ):
        """What the particles of a cell leave at its corners."""
        cell = listed(wp.tid() + first, level.cell_base, active_cells)
        total = row_vec()
        t = range_begin[cell]
        end = range_end[cell]
        while t < end:
            f = grid_fraction[t]
            work = particle_work[grid_order[t]]
            for a in range(wp.static(corners)):
                total[a] += corner_weight(a, f) * work
            t += 1
        for a in range(wp.static(corners)):
            corner_sums[corner_at(level, cell, a)] = total[a]

    @sweep
    def grid_gather(
        first: int,
        level: Level,
        active_nodes: wp.array(dtype=int),
        corner_sums: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
    ):
        """Right-hand side of a node of the finest grid: what the cells around it leave."""
        node = listed(wp.tid() + first, level.node_base, active_nodes)
        total = real(0.0)
        at = coordinates(node, level.nodes)
        for a in range(wp.static(corners)):
            cx = at[0] - (a & 1)
            cy = at[1] - ((a >> 1) & 1)
            cz = int(0)
            if level.wrap[0] == 1 and cx < 0:
                cx += level.cells[0]
            if level.wrap[1] == 1 and cy < 0:
                cy += level.cells[1]
            inside = cx >= 0 and cx < level.cells[0] and cy >= 0 and cy < level.cells[1]
            if wp.static(three):
                cz = at[2] - ((a >> 2) & 1)
                if level.wrap[2] == 1 and cz < 0:
                    cz += level.cells[2]
                inside = inside and cz >= 0 and cz < level.cells[2]
            if inside:
                cell = (cz * level.cells[1] + cy) * level.cells[0] + cx
                total += corner_sums[corner_at(level, cell, a)]
        node_rhs[level.node_base + node] = total

    return grid_collect, grid_gather


@functools.cache
def make_spread(dimension: int, precision: str, row_list: bool, count_type: Any) -> Any:
    """Return the kernel particle_spread: the correction at the particles."""
    real, vec, _, _ = types(dimension, precision)
    Frame = make_frame(dimension, precision)
    place, corner_weight, _, corner_node = make_corners(dimension, precision)
    corners = 2**dimension
    sweep = make_sweep(row_list)

    @sweep
    def particle_spread(
        first: int,
        n: int,
        chunk: int,
        over: real,
        frame: Frame,
        level: Level,
        counts: wp.array(dtype=count_type),
        position: wp.array(dtype=vec),
        node_x: wp.array(dtype=real),
        result: wp.array(dtype=real),
        particle_work: wp.array(dtype=real),
    ):
        """Work = result + over times the interpolated correction."""
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        while i < end:
            value = result[i]
            if int(counts[i]) > 0:
                c, f = place(position[i], frame, level)
                correction = real(0.0)
                for a in range(wp.static(corners)):
                    correction += corner_weight(a, f) * node_x[level.node_base + corner_node(c, a, level)]
                value += over * correction
            particle_work[i] = value
            i += 1

    return particle_spread
