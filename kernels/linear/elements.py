"""Operators of the grids of the multigrid preconditioner, summed up cell by cell.

With x_a - x_b ~ grad phi . x_ab the operator of the finest grid is
    A_IJ = sum_a ( grad phi_I(x_a) . M_a grad phi_J(x_a) + d_a phi_I(x_a) phi_J(x_a) ),   M_a = 1/2 sum_b w_ab x_ab (x) x_ab,
nine or 27 points wide where the Galerkin product over the particles would have 49 or 343. Coarser operators are exact
Galerkin products: the bilinear functions of a grid are functions of the next finer one.

`element` holds for each cell the couplings of its corners, off the diagonal, and on it the row sum
c_K = sum_a d_a phi_K(x_a). `stencil` holds the couplings of a node, at its centre the row sum.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.spec import types

from .decorators import exact_kernel, make_sweep
from .levels import COLLAPSE, HALVE, STAY, Level, coordinates, make_corners, make_frame, make_layout


@functools.cache
def make_grid_keys(dimension: int, precision: str, count_type: Any) -> tuple[Any, Any]:
    """Return the kernels grid_keys and grid_ranges: cell of each particle, and the particles of each cell once sorted."""
    vec = types(dimension, precision).vec
    Frame = make_frame(dimension, precision)
    place = make_corners(dimension, precision).place

    @exact_kernel
    def grid_keys(
        first: int,
        frame: Frame,
        level: Level,
        counts: wp.array(dtype=count_type),
        position: wp.array(dtype=vec),
        grid_sort_keys: wp.array(dtype=int),
        grid_order: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        key = int(level.cell_count)
        # rows out of the system lie behind all cells
        if int(counts[i]) > 0:
            c, _f = place(position[i], frame, level)
            key = (c[2] * level.cells[1] + c[1]) * level.cells[0] + c[0]
        grid_sort_keys[i] = key
        grid_order[i] = i

    @exact_kernel
    def grid_ranges(
        first: int,
        n: int,
        level: Level,
        frame: Frame,
        position: wp.array(dtype=vec),
        grid_sort_keys: wp.array(dtype=int),
        grid_order: wp.array(dtype=int),
        grid_fraction: wp.array(dtype=vec),
        range_begin: wp.array(dtype=int),
        range_end: wp.array(dtype=int),
    ):
        t = wp.tid() + first
        _c, f = place(position[grid_order[t]], frame, level)
        grid_fraction[t] = f
        key = grid_sort_keys[t]
        if key < level.cell_count:
            if t == 0:
                range_begin[key] = 0
            elif grid_sort_keys[t - 1] != key:
                range_begin[key] = t
            if t == n - 1:
                range_end[key] = n
            elif grid_sort_keys[t + 1] != key:
                range_end[key] = t + 1

    return grid_keys, grid_ranges


@functools.cache
def make_elements(dimension: int, precision: str, row_list: bool) -> Any:
    """Return the kernel grid_elements: what the particles of each cell of the finest grid couple."""
    real, vec, mat, _ = types(dimension, precision)
    Frame = make_frame(dimension, precision)
    layout = make_layout(dimension, row_list)
    listed, element_at = layout.listed, layout.element_at
    _, corner_weight, corner_gradient, _ = make_corners(dimension, precision)
    corners = 2**dimension
    row_vec = wp.types.vector(length=corners, dtype=real)
    sweep = make_sweep(row_list)

    @sweep
    def grid_elements(
        first: int,
        frame: Frame,
        level: Level,
        moment: wp.array(dtype=mat),
        excess: wp.array(dtype=real),
        grid_order: wp.array(dtype=int),
        grid_fraction: wp.array(dtype=vec),
        range_begin: wp.array(dtype=int),
        range_end: wp.array(dtype=int),
        active_cells: wp.array(dtype=int),
        element: wp.array(dtype=real),
    ):
        """Row of one corner of one cell."""
        item = wp.tid() + first
        cell = int(item)
        corner = int(0)
        if wp.static(row_list):
            entry = item / wp.static(corners)
            corner = item - entry * wp.static(corners)
            cell = listed(entry, level.cell_base, active_cells)
        else:
            corner = item / level.cell_count
            cell = item - corner * level.cell_count
        row = row_vec()
        own = real(0.0)
        t = range_begin[cell]
        end = range_end[cell]
        while t < end:
            i = grid_order[t]
            f = grid_fraction[t]
            d = wp.max(excess[i], real(0.0))
            pull = moment[i] * corner_gradient(corner, f, frame)
            weight = d * corner_weight(corner, f)
            for other in range(wp.static(corners)):
                row[other] += wp.dot(pull, corner_gradient(other, f, frame)) + weight * corner_weight(other, f)
            own += weight
            t += 1
        for other in range(wp.static(corners)):
            value = row[other]
            if other == corner:
                value = own
            element[element_at(level, cell, corner * wp.static(corners) + other)] = value

    return grid_elements


@wp.func
def children_begin(way: int, coarse: int):
    if way == HALVE:
        return 2 * coarse
    elif way == COLLAPSE:
        return 0
    return coarse


@wp.func
def children_end(way: int, coarse: int, cells: int):
    if way == HALVE:
        return wp.min(2 * coarse + 2, cells)
    elif way == COLLAPSE:
        return cells
    return coarse + 1


@functools.cache
def make_child_corners(dimension: int, precision: str) -> tuple[Any, Any]:
    """Return corner_on_axis(way, child, bit, coarse_bit) and to_coarse_corners(values, way, child), `wp.func`s of a child
    cell in its coarse cell."""
    real = types(dimension, precision).real
    corners = 2**dimension
    row_vec = wp.types.vector(length=corners, dtype=real)

    @wp.func
    def corner_on_coarse(way: int, child: int, bit: int):
        # where a corner of a child cell lies in the coarse cell along one axis, 0 to 1
        s = real(0.0)
        if way == HALVE:
            s = real(0.5) * real(child + bit)
        elif way == STAY:
            s = real(bit)
        return s

    @wp.func
    def corner_on_axis(way: int, child: int, bit: int, coarse_bit: int):
        # value there of the linear function of a corner of the coarse cell
        s = corner_on_coarse(way, child, bit)
        w = s
        if coarse_bit == 0:
            w = real(1.0) - s
        return w

    @wp.func
    def to_coarse_corners(values: row_vec, way: wp.vec3i, child: wp.vec3i):
        # sum over the corners of a child cell of value times coarse function, one axis after the other
        now = values
        for axis in range(wp.static(dimension)):
            s0 = corner_on_coarse(way[axis], child[axis], 0)
            s1 = corner_on_coarse(way[axis], child[axis], 1)
            then = row_vec()
            for low in range(wp.static(corners)):
                if ((low >> axis) & 1) == 0:
                    high = low + (1 << axis)
                    then[low] = (real(1.0) - s0) * now[low] + (real(1.0) - s1) * now[high]
                    then[high] = s0 * now[low] + s1 * now[high]
            now = then
        return now

    return corner_on_axis, to_coarse_corners


@functools.cache
def make_coarse_element(dimension: int, precision: str, row_list: bool) -> Any:
    """Return the `wp.func` coarse_element_row(fine, coarse, cell, corner, element): Galerkin product, one row of a cell."""
    real = types(dimension, precision).real
    element_at = make_layout(dimension, row_list).element_at
    corner_on_axis, to_coarse_corners = make_child_corners(dimension, precision)
    corners = 2**dimension
    three = dimension > 2
    row_vec = wp.types.vector(length=corners, dtype=real)

    @wp.func
    def coarse_element_row(fine: Level, coarse: Level, cell: int, corner: int, element: wp.array(dtype=real)):
        place_ = coordinates(cell, coarse.cells)
        row = row_vec()
        own = real(0.0)
        x0 = children_begin(fine.way[0], place_[0])
        x1 = children_end(fine.way[0], place_[0], fine.cells[0])
        y0 = children_begin(fine.way[1], place_[1])
        y1 = children_end(fine.way[1], place_[1], fine.cells[1])
        z0 = int(0)
        z1 = int(1)
        if wp.static(three):
            z0 = children_begin(fine.way[2], place_[2])
            z1 = children_end(fine.way[2], place_[2], fine.cells[2])
        z = int(z0)
        while z < z1:
            y = int(y0)
            while y < y1:
                x = int(x0)
                while x < x1:
                    child = wp.vec3i(x - x0, y - y0, z - z0)
                    fine_cell = (z * fine.cells[1] + y) * fine.cells[0] + x
                    a = int(0)
                    while a < wp.static(corners):
                        w = corner_on_axis(fine.way[0], child[0], a & 1, corner & 1)
                        w *= corner_on_axis(fine.way[1], child[1], (a >> 1) & 1, (corner >> 1) & 1)
                        if wp.static(three):
                            w *= corner_on_axis(fine.way[2], child[2], (a >> 2) & 1, (corner >> 2) & 1)
                        if w != real(0.0):
                            values = row_vec()
                            c = real(0.0)
                            rest = real(0.0)
                            for b in range(wp.static(corners)):
                                value = element[element_at(fine, fine_cell, a * wp.static(corners) + b)]
                                if b == a:
                                    c = value
                                else:
                                    rest += value
                                values[b] = value
                            values[a] = c - rest
                            own += w * c
                            row += w * to_coarse_corners(values, fine.way, child)
                        a += 1
                    x += 1
                y += 1
            z += 1
        for k in range(wp.static(corners)):
            value = row[k]
            if k == corner:
                value = own
            element[element_at(coarse, cell, corner * wp.static(corners) + k)] = value

    return coarse_element_row


@functools.cache
def make_node_stencil(dimension: int, precision: str, row_list: bool) -> Any:
    """Return the `wp.func` node_stencil(level, node, element, stencil, node_inverse): the row of a node from its cells."""
    real = types(dimension, precision).real
    layout = make_layout(dimension, row_list)
    element_at, stencil_at = layout.element_at, layout.stencil_at
    corners = 2**dimension
    size = 3**dimension
    centre = size // 2
    three = dimension > 2
    stencil_vec = wp.types.vector(length=size, dtype=real)

    @wp.func
    def node_stencil(
        level: Level,
        node: int,
        element: wp.array(dtype=real),
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
    ):
        at = coordinates(node, level.nodes)
        entries = stencil_vec()
        a = int(0)
        while a < wp.static(corners):
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
                for b in range(wp.static(corners)):
                    slot = (1 + (b & 1) - (a & 1)) + 3 * (1 + ((b >> 1) & 1) - ((a >> 1) & 1))
                    if wp.static(three):
                        slot += 9 * (1 + ((b >> 2) & 1) - ((a >> 2) & 1))
                    entries[slot] += element[element_at(level, cell, a * wp.static(corners) + b)]
            a += 1
        diagonal = real(0.0)
        others = real(0.0)
        for slot in range(wp.static(size)):
            value = entries[slot]
            stencil[stencil_at(level, node, slot)] = value
            if slot == wp.static(centre):
                diagonal += value
            else:
                diagonal -= value
                others += wp.abs(value)
        inverse = real(0.0)
        # A node that no particle depends on has only rounding here. Positive couplings, from cells with few particles,
        # could let a Jacobi sweep diverge: with half the sum of absolute values the eigenvalues of D^-1 A are at most 2.
        if diagonal > real(1.0e-4) * others:
            inverse = real(1.0) / wp.max(diagonal, real(0.5) * (diagonal + others))
        node_inverse[level.node_base + node] = inverse

    return node_stencil


@functools.cache
def make_operators(dimension: int, precision: str, row_list: bool) -> tuple[Any, Any]:
    """Return the kernels grid_coarse_elements and grid_stencils of one level."""
    real = types(dimension, precision).real
    listed = make_layout(dimension, row_list).listed
    coarse_element_row = make_coarse_element(dimension, precision, row_list)
    node_stencil = make_node_stencil(dimension, precision, row_list)
    corners = 2**dimension
    sweep = make_sweep(row_list)

    @sweep
    def grid_coarse_elements(
        first: int,
        fine: Level,
        coarse: Level,
        active_cells: wp.array(dtype=int),
        element: wp.array(dtype=real),
    ):
        item = wp.tid() + first
        if wp.static(row_list):
            entry = item / wp.static(corners)
            cell = listed(entry, coarse.cell_base, active_cells)
            coarse_element_row(fine, coarse, cell, item - entry * wp.static(corners), element)
        else:
            corner = item / coarse.cell_count
            coarse_element_row(fine, coarse, item - corner * coarse.cell_count, corner, element)

    @sweep
    def grid_stencils(
        first: int,
        level: Level,
        active_nodes: wp.array(dtype=int),
        element: wp.array(dtype=real),
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
    ):
        node_stencil(level, listed(wp.tid() + first, level.node_base, active_nodes), element, stencil, node_inverse)

    return grid_coarse_elements, grid_stencils
