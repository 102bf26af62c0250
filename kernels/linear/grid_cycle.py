"""Multigrid preconditioner for systems of particles: background grids, their operators, and the cycle.

The unknowns are particles a with an ELL matrix of weights w_ab = -a_ab >= 0 and couplings d_a = A_aa - sum_b w_ab to what
is not in the system (pressure 0 at a free surface), so that
    x.A x = 1/2 sum_ab w_ab (x_a - x_b)^2 + sum_a d_a x_a^2.
Grid functions phi_I are (bi/tri)linear on a background grid; with x_a - x_b ~ grad phi . x_ab the operator of the finest
grid is
    A_IJ = sum_a ( grad phi_I(x_a) . M_a grad phi_J(x_a) + d_a phi_I(x_a) phi_J(x_a) ),   M_a = 1/2 sum_b w_ab x_ab (x) x_ab,
nine or 27 points wide where the Galerkin product over the particles would have 49 or 343. Coarser operators are exact
Galerkin products: the bilinear functions of a grid are functions of the next finer one.

Operators are summed up cell by cell: `element` holds for each cell the couplings of its corners, off the diagonal, and on
it the row sum c_K = sum_a d_a phi_K(x_a). `stencil` holds the couplings of a node, at its centre the row sum. Products are
taken in differences, (A x)_I = c_I x_I + sum_J A_IJ (x_J - x_I): the constant stays an exact null vector of a closed
system in any precision.

A cell or node is numbered along x first. All levels lie one after the other in the same arrays; `Level` says where. Node
arrays have room before and after each level, so that a neighbour outside the grid, whose coupling is 0, can be read. Nodes
without particles near have inverse 0 and value 0.

Where a free surface passes through the middle of cells, the couplings d_a hold the sum of the nodes on both sides, not
their difference, which is the slope there. Jacobi sweeps take that out slowly, the slower the wider the cells: d_a counts
H/dx times as much as the gradient. So levels of wide cells get more pairs of sweeps, and the coarsest is solved exactly.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.pair import make_entry
from warpsph.kernels.core.spec import SWEEP_OPTIONS, types

from .krylov import RESIDUAL_MEAN, barrier, make_product, make_sums

# what an axis does from a level to the next coarser one
STAY = 0
HALVE = 1
COLLAPSE = 2  # to one node: constant along the axis


MOST_SWEEPS = 8  # before and as many after the coarser levels
sweep_weights = wp.types.vector(length=MOST_SWEEPS, dtype=float)


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
    weights: sweep_weights


@functools.cache
def make_frame(dimension: int, precision: str) -> Any:
    """Return the struct `Frame`: lower corner of the finest grid [m] and 1 / cell width [1/m]."""
    vec = types(dimension, precision).vec

    @wp.struct
    class Frame:
        origin: vec
        inv_cell: vec

    return Frame


STENCIL = """
const int mx = {level}.nodes[0], my = {level}.nodes[1], mz = {level}.nodes[2];
const int ix = node % mx, iy = (node / mx) % my, iz = node / (mx * my);
const int lx = {level}.wrap[0] && ix == 0 ? mx - 1 : -1;
const int hx = {level}.wrap[0] && ix == mx - 1 ? 1 - mx : 1;
const int ly = ({level}.wrap[1] && iy == 0 ? my - 1 : -1) * mx;
const int hy = ({level}.wrap[1] && iy == my - 1 ? 1 - my : 1) * mx;
const int lz = ({level}.wrap[2] && iz == 0 ? mz - 1 : -1) * mx * my;
const int hz = ({level}.wrap[2] && iz == mz - 1 ? 1 - mz : 1) * mx * my;
const int at = {level}.node_base + node;
const auto *entry = stencil.data + {begin};
const size_t step = {step};
const auto *vector = x.data + at;
{more}
const auto own = {value_own};
auto total = entry[{centre} * step] * own;
{terms}
return total;
"""


def _stencil_code(dimension: int, row_list: bool, scaled: bool) -> str:
    """Return the C++ of (A x)_I of a node, or of (A D^-1 x)_I."""
    size = 3**dimension
    terms = []
    for slot in range(size):
        if slot == size // 2:
            continue
        parts = []
        for axis, name in enumerate("xyz"[:dimension]):
            side = slot // 3**axis % 3
            if side != 1:
                parts.append(("l" if side == 0 else "h") + name)
        place = " + ".join(parts)
        value = f"inv[{place}] * vector[{place}]" if scaled else f"vector[{place}]"
        terms.append(f"total += entry[{slot} * step] * ({value} - own);")
    return STENCIL.format(
        level="level",
        begin=f"(size_t)at * {size}" if row_list else f"(size_t)level.node_base * {size} + node",
        step="1" if row_list else "level.node_count",
        more="const auto *inv = node_inverse.data + at;" if scaled else "",
        value_own="inv[0] * vector[0]" if scaled else "vector[0]",
        centre=size // 2,
        terms="\n".join(terms),
    )


class Kernels(NamedTuple):
    """Kernels of the preconditioner, see `make_kernels`."""

    keys: Any
    ranges: Any
    elements: Any
    coarse_elements: Any
    stencils: Any
    small_setup: Any
    residual: Any
    collect: Any
    gather: Any
    spread: Any
    smooth: Any
    first_sweeps: Any
    grid_residual: Any
    restrict_residual: Any
    prolong: Any
    sweep: Any
    small_cycle: Any


@functools.cache
def make_kernels(dimension: int, precision: str, row_list: bool, count_type: Any, wide: bool = False) -> Kernels:
    """Return the kernels for a dimension (2 or 3), a precision, the layout of the matrix and the integer type of its counts.

    Set-up: keys and ranges (cell index of the particles, around a radix sort), elements, coarse_elements and stencils (one
    level a launch), small_setup (all small levels by one block). Cycle: residual, collect and gather (to the grid),
    first_sweeps, grid_residual, restrict_residual, prolong, sweep (one level a launch), small_cycle (all small levels),
    spread (to the particles), smooth.
    """
    real, vec, mat, _ = types(dimension, precision)
    Frame = make_frame(dimension, precision)
    store_sums, _ = make_sums(row_list)
    row_product, _, _ = make_product(precision, row_list, count_type, wide)
    Columns, Values = make_entry(row_list, wide).array, make_entry(row_list, wide, real).array
    corners = 2**dimension
    size = 3**dimension
    centre = size // 2
    three = dimension > 2
    regular = 1.0 + {"float32": 1.0e-5, "float64": 1.0e-9}[precision]
    row_vec = wp.types.vector(length=corners, dtype=real)
    stencil_vec = wp.types.vector(length=size, dtype=real)
    level_wide = corners * corners

    def kernel(function: Any) -> Any:
        return wp.kernel(function, module="unique", enable_backward=False)

    def sweep_kernel(function: Any) -> Any:
        options = dict(SWEEP_OPTIONS) if row_list else {}
        return wp.kernel(function, module="unique", enable_backward=False, module_options=options or None)

    # where things are ------------------------------------------------------------------------------------------------

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
    def coordinates(index: int, counts: wp.vec3i):
        return wp.vec3i(index % counts[0], (index / counts[0]) % counts[1], index / (counts[0] * counts[1]))

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

    # set-up ----------------------------------------------------------------------------------------------------------

    @kernel
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

    @kernel
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

    @sweep_kernel
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

    @sweep_kernel
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

    @sweep_kernel
    def grid_stencils(
        first: int,
        level: Level,
        active_nodes: wp.array(dtype=int),
        element: wp.array(dtype=real),
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
    ):
        node_stencil(level, listed(wp.tid() + first, level.node_base, active_nodes), element, stencil, node_inverse)

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

    @sweep_kernel
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

    # between particles and the finest grid ---------------------------------------------------------------------------

    @sweep_kernel
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

        A residual of a singular system sums to zero but for rounding. The grids would multiply what is left with the
        number of
        particles: it is taken out.
        """
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        mean = real(solve_state[RESIDUAL_MEAN])
        while i < end:
            rest = source[i] - row_product(i, n, width, counts, columns, values, excess, result)
            particle_work[i] = rest - mean
            i += 1

    @wp.func
    def corner_at(level: Level, cell: int, corner: int):
        if wp.static(row_list):
            return cell * wp.static(corners) + corner
        else:
            return corner * level.cell_count + cell

    @sweep_kernel
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

    @sweep_kernel
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

    @sweep_kernel
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

    @sweep_kernel
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
        """Result = work + weight / diagonal (source - A work), and the sum source . result."""
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        rz = wp.float64(0.0)
        while i < end:
            r = source[i]
            rest = r - row_product(i, n, width, counts, columns, values, excess, particle_work)
            z = particle_work[i] + weight * inverse[i] * rest
            result[i] = z
            rz += wp.float64(r) * wp.float64(z)
            i += 1
        store_sums(t, wp.float64(0.0), rz, wp.float64(0.0), sums)

    # on the grids ----------------------------------------------------------------------------------------------------

    @wp.func_native(_stencil_code(dimension, row_list, False))
    def stencil_product(level: Level, node: int, stencil: wp.array(dtype=real), x: wp.array(dtype=real)) -> real: ...

    @wp.func_native(_stencil_code(dimension, row_list, True))
    def scaled_product(
        level: Level,
        node: int,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        x: wp.array(dtype=real),
    ) -> real: ...

    @wp.func
    def first_sweeps_of(
        level: Level,
        node: int,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
    ):
        # two weighted Jacobi sweeps from zero: x = D^-1 ((v + w) b - v w A D^-1 b)
        at = level.node_base + node
        value = real(0.0)
        inverse = node_inverse[at]
        if inverse > real(0.0):
            image = scaled_product(level, node, stencil, node_inverse, node_rhs)
            v = real(level.weights[0])
            w = real(level.weights[1])
            value = inverse * ((v + w) * node_rhs[at] - v * w * image)
        node_x[at] = value

    @wp.func
    def sweep_of(
        level: Level,
        node: int,
        weight: real,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        source: wp.array(dtype=real),
        target: wp.array(dtype=real),
    ):
        at = level.node_base + node
        value = real(0.0)
        inverse = node_inverse[at]
        if inverse > real(0.0):
            rest = node_rhs[at] - stencil_product(level, node, stencil, source)
            value = source[at] + weight * inverse * rest
        target[at] = value

    @wp.func
    def residual_of(
        level: Level,
        node: int,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
        node_work: wp.array(dtype=real),
    ):
        at = level.node_base + node
        value = real(0.0)
        if node_inverse[at] > real(0.0):
            value = node_rhs[at] - stencil_product(level, node, stencil, node_x)
        node_work[at] = value

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

    @sweep_kernel
    def grid_first_sweeps(
        first: int,
        active_nodes: wp.array(dtype=int),
        level: Level,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
    ):
        node = listed(wp.tid() + first, level.node_base, active_nodes)
        first_sweeps_of(level, node, stencil, node_inverse, node_rhs, node_x)

    @sweep_kernel
    def grid_residual(
        first: int,
        active_nodes: wp.array(dtype=int),
        level: Level,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
        node_work: wp.array(dtype=real),
    ):
        node = listed(wp.tid() + first, level.node_base, active_nodes)
        residual_of(level, node, stencil, node_inverse, node_rhs, node_x, node_work)

    @sweep_kernel
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

    @sweep_kernel
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

    @sweep_kernel
    def grid_sweep(
        first: int,
        active_nodes: wp.array(dtype=int),
        level: Level,
        sweep_weight: real,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        source: wp.array(dtype=real),
        target: wp.array(dtype=real),
    ):
        node = listed(wp.tid() + first, level.node_base, active_nodes)
        sweep_of(level, node, sweep_weight, stencil, node_inverse, node_rhs, source, target)

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

    @sweep_kernel
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

    return Kernels(
        grid_keys, grid_ranges, grid_elements, grid_coarse_elements, grid_stencils, grid_small_setup,
        particle_residual, grid_collect, grid_gather, particle_spread, particle_smooth,
        grid_first_sweeps, grid_residual, grid_restrict, grid_prolong, grid_sweep, grid_small_cycle,
    )  # fmt: skip
