"""Spatial ordering and the neighbour list: cell keys, sorted order, cell ranges, list with skin, interface flags.

Cells are half the list radius wide, so a search visits five cells an axis (3.9 list squares in 2-D, where
full-size cells would visit 9/pi of the disc), and the five cells of a row are one contiguous range of particles.
Fluid particles are ordered before wall particles: key = cell + (wall ? cell_count : 0).
"""

import functools
from typing import Any

import warp as wp

from .clock import (
    BAND_COUNT,
    CHECK_LASTS,
    FAULT,
    FAULT_LIST,
    LIST_PEAK,
    LIVE,
    MAXIMA,
    OFFSET,
    REBUILD,
    REBUILDS,
    RETRY,
    ROOM,
    RUNNING,
    STRAIGHT,
    USELESS,
)
from .mirror import NO_WALL, code_shift, make_images, make_sides
from .pair import BAND, NEAR, WRAPPED, list_access, make_entry, make_nearest, natural
from .spec import Spec, curvature_type, phase_types_of, types, types_of


@functools.cache
def make_grid(dimension: int, precision: str) -> Any:
    """Return the `Grid` struct: where the cells are. Axes beyond the dimension have one cell."""
    real, vec, _, _ = types_of(Spec(dimension=dimension, precision=precision))

    @wp.struct
    class Grid:
        origin: vec  # lower corner [m]
        inv_cell: vec  # 1 / cell width [1/m]
        box: vec  # period of each periodic axis [m]
        nx: int
        ny: int
        nz: int
        cell_count: int
        list_radius2: real  # (support + skin)^2 [m^2]

    return Grid


@functools.cache
def make_cell_of(dimension: int, precision: str) -> Any:
    """Return the `wp.func` cell_of(x, grid) -> vec3i; positions outside the grid go to its rim cells."""
    real, vec, _, _ = types_of(Spec(dimension=dimension, precision=precision))
    Grid = make_grid(dimension, precision)

    @wp.func
    def axis_cell(x: real, origin: real, inv_cell: real, n: int):
        c = wp.clamp((x - origin) * inv_cell, real(0.0), real(1.0e9))
        return wp.min(int(c), n - 1)

    @wp.func
    def cell_of(x: vec, grid: Grid):
        c = wp.vec3i(axis_cell(x[0], grid.origin[0], grid.inv_cell[0], grid.nx), 0, 0)
        if wp.static(dimension > 1):
            c[1] = axis_cell(x[1], grid.origin[1], grid.inv_cell[1], grid.ny)
        if wp.static(dimension > 2):
            c[2] = axis_cell(x[2], grid.origin[2], grid.inv_cell[2], grid.nz)
        return c

    return cell_of


@functools.cache
def make_window(reach: int) -> Any:
    """Return the `wp.func` window(c, n, wraps) -> (first, end) of the cells up to `reach` beside c, of n along an axis.

    Where the axis wraps, numbers may be below 0 and n or more; one that is shorter than the window is gone through once.
    """

    @wp.func
    def window(c: int, n: int, wraps: bool):
        low, high = c - reach, c + reach
        if wraps:
            if n <= wp.static(2 * reach + 1):
                low, high = 0, n - 1
        else:
            low, high = wp.max(low, 0), wp.min(high, n - 1)
        return low, high + 1

    return window


@functools.cache
def make_keys(spec: Spec) -> Any:
    """Return the kernel that takes up the way since the last build into the anchor, wraps it and writes sort keys."""
    real, vec, _, _ = types_of(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    cell_of = make_cell_of(spec.dimension, spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def cell_keys(
        first: int,
        fluid_count: int,
        moving: int,
        grid: Grid,
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        alive: wp.array(dtype=wp.uint8),
        sort_keys: wp.array(dtype=int),
        sort_order: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        if wp.static(spec.changing):
            if i < fluid_count:
                if alive[i] == wp.uint8(0):
                    sort_keys[i] = grid.cell_count - 1
                    sort_order[i] = i
                    return
        takes_up = moving == 1
        if wp.static(spec.moving):
            takes_up = moving == 1 and i < fluid_count
            if moving == 1 and i >= fluid_count:
                # of a body, where its motion has brought it; other walls stay where they are
                place = position[i]
                for axis in range(wp.static(spec.dimension)):
                    if wp.static(any(spec.periodic)):
                        period = grid.box[axis]
                        if period > real(0.0):
                            place[axis] = place[axis] - period * wp.floor((place[axis] - grid.origin[axis]) / period)
                anchor[i] = place
                position[i] = place
        if takes_up:
            old = anchor[i]
            way = offset[i]
            new = old + way
            rest = (old - new) + way  # what the sum rounded off
            for axis in range(wp.static(spec.dimension)):
                if wp.static(any(spec.periodic)):
                    period = grid.box[axis]
                    if period > real(0.0):
                        x = new[axis]
                        if x < grid.origin[axis]:
                            moved = x + period
                            rest[axis] = rest[axis] + (x - (moved - period))
                            new[axis] = moved
                        elif x >= grid.origin[axis] + period:
                            moved = x - period
                            rest[axis] = rest[axis] + (x - (moved + period))
                            new[axis] = moved
            anchor[i] = new
            offset[i] = rest
            position[i] = new + rest
        c = cell_of(anchor[i], grid)
        key = (c[2] * grid.ny + c[1]) * grid.nx + c[0]
        if i >= fluid_count:
            key += grid.cell_count
        sort_keys[i] = key
        sort_order[i] = i

    return cell_keys


@functools.cache
def make_ranges(by_cells: bool) -> Any:
    """Return the kernel cell_start[c] = first particle whose key is at least c.

    by_cells: a thread for each cell, by binary search, so that no thread has more to do than others (best for a GPU). Else
    one for each particle and one behind the last, which writes the cells from the key before it to its own: a pass over
    keys and cells in their order (best for a CPU, five to eight times as fast there).
    """

    @wp.kernel(module="unique", enable_backward=False)
    def ranges_by_cells(
        first: int,
        particle_count: int,
        sort_keys: wp.array(dtype=int),
        cell_start: wp.array(dtype=int),
    ):
        c = wp.tid() + first
        low = int(0)
        high = int(particle_count)
        while low < high:
            middle = (low + high) / 2
            if sort_keys[middle] < c:
                low = middle + 1
            else:
                high = middle
        cell_start[c] = low

    @wp.kernel(module="unique", enable_backward=False)
    def ranges_by_particles(
        first: int,
        particle_count: int,
        sort_keys: wp.array(dtype=int),
        cell_start: wp.array(dtype=int),
    ):
        t = wp.tid() + first
        c = int(0)
        if t > 0:
            c = sort_keys[t - 1] + 1
        last = cell_start.shape[0] - 1
        if t < particle_count:
            last = sort_keys[t]
        while c <= last:
            cell_start[c] = t
            c += 1

    return ranges_by_cells if by_cells else ranges_by_particles


@functools.cache
def make_live() -> Any:
    """Return the one-thread kernel that counts the fluid particles that live: all before the cell of those that died."""

    @wp.kernel(module="unique", enable_backward=False)
    def count_live(dead_cell: int, cell_start: wp.array(dtype=int), counters: wp.array(dtype=int)):
        counters[LIVE] = cell_start[dead_cell]

    return count_live


@functools.cache
def make_edge(dimension: int, precision: str, periodic: tuple[bool, ...]) -> Any:
    """Return the `wp.func` at_edge(c, grid): whether a cell is within two cells of a periodic side.

    Only a particle there can have a neighbour across it.
    """
    Grid = make_grid(dimension, precision)
    px, py, pz = ([*periodic, False, False])[:3]

    @wp.func
    def at_edge(c: wp.vec3i, grid: Grid):
        edge = bool(False)
        if wp.static(px):
            edge = edge or c[0] < 2 or c[0] >= grid.nx - 2
        if wp.static(py):
            edge = edge or c[1] < 2 or c[1] >= grid.ny - 2
        if wp.static(pz):
            edge = edge or c[2] < 2 or c[2] >= grid.nz - 2
        return edge

    return at_edge


@functools.cache
def make_scan(spec: Spec) -> Any:
    """Return the `wp.func` scan: lists the neighbours of x_i among the particles begin to end, which follow each other.

    mark is added to their indices: the code of a mirror image. state and the result: (entries so far, bits of `flags`).
    own is the phase to compare with, or -1.
    """
    real, vec, _, _ = types_of(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    px, py, pz = ([*spec.periodic, False, False])[:3]
    any_periodic = any(spec.periodic)
    list_begin, list_step, _, Listed, store = make_entry(spec.row_list, spec.wide_list)

    nearest = make_nearest(spec.precision)

    @wp.func
    def scan(
        i: int,
        xi: vec,
        mark: int,
        begin: int,
        end: int,
        state: wp.vec2i,
        own: int,
        edge: bool,
        particle_count: int,
        list_width: int,
        grid: Grid,
        phase: wp.array(dtype=wp.int8),
        anchor: wp.array(dtype=vec),
        neighbours: Listed,
    ):
        count = state[0]
        flag = state[1]
        base = list_begin(i, list_width)
        step = list_step(particle_count)
        last = list_width - 1
        j = natural(begin)
        while j < end:
            d = xi - anchor[j]
            if wp.static(any_periodic):
                if edge:
                    raw = d + vec()
                    far = bool(False)
                    if wp.static(px):
                        d[0] = nearest(d[0], grid.box[0], real(0.5) * grid.box[0])
                    if wp.static(py):
                        d[1] = nearest(d[1], grid.box[1], real(0.5) * grid.box[1])
                    if wp.static(pz):
                        d[2] = nearest(d[2], grid.box[2], real(0.5) * grid.box[2])
                    if wp.static(px):
                        far = far or d[0] != raw[0]
                    if wp.static(py):
                        far = far or d[1] != raw[1]
                    if wp.static(pz):
                        far = far or d[2] != raw[2]
                    if far and wp.dot(d, d) < grid.list_radius2:
                        flag = flag | WRAPPED
            if wp.static(spec.row_list):
                # about half of the candidates are neighbours: storing all and counting those spares the branch,
                # which a CPU would guess wrong every other time
                store(neighbours, i, base + wp.min(count, last), j + mark)
                hit = int(wp.dot(d, d) < grid.list_radius2) * int(j != i or mark != 0)
                count += hit
                if wp.static(spec.multiphase):
                    if own >= 0:
                        flag = flag | (hit * int(int(phase[j]) != own) * NEAR)
            else:
                if wp.dot(d, d) < grid.list_radius2 and (j != i or mark != 0):
                    if count < list_width:
                        store(neighbours, i, base + count * step, j + mark)
                    count += 1
                    if wp.static(spec.multiphase):
                        if own >= 0:
                            if int(phase[j]) != own:
                                flag = flag | NEAR
            j += 1
        return wp.vec2i(count, flag)

    return scan


@functools.cache
def make_search(spec: Spec) -> Any:
    """Return the `wp.func` search: lists the neighbours of x_i in the cells around c; arguments as of `make_scan`.

    kind_base is 0 for fluid and the number of cells for walls.
    """
    _, vec, _, _ = types_of(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    px, py, pz = ([*spec.periodic, False, False])[:3]
    dim = spec.dimension
    Listed = make_entry(spec.row_list, spec.wide_list).array
    scan = make_scan(spec)

    @wp.func
    def row(
        i: int,
        xi: vec,
        mark: int,
        base: int,
        cx: int,
        state: wp.vec2i,
        own: int,
        edge: bool,
        particle_count: int,
        list_width: int,
        grid: Grid,
        cell_start: wp.array(dtype=int),
        phase: wp.array(dtype=wp.int8),
        anchor: wp.array(dtype=vec),
        neighbours: Listed,
    ):
        low = cx - 2
        high = cx + 2
        if wp.static(px):
            if grid.nx < 5:
                low = 0
                high = grid.nx - 1
        s = scan(
            i, xi, mark, cell_start[base + wp.max(low, 0)], cell_start[base + wp.min(high, grid.nx - 1) + 1],
            state, own, edge, particle_count, list_width, grid, phase, anchor, neighbours,
        )  # fmt: skip
        if wp.static(px):
            if low < 0:
                s = scan(
                    i, xi, mark, cell_start[base + low + grid.nx], cell_start[base + grid.nx],
                    s, own, edge, particle_count, list_width, grid, phase, anchor, neighbours,
                )  # fmt: skip
            if high >= grid.nx:
                s = scan(
                    i, xi, mark, cell_start[base], cell_start[base + high - grid.nx + 1],
                    s, own, edge, particle_count, list_width, grid, phase, anchor, neighbours,
                )  # fmt: skip
        return s

    @wp.func
    def search(
        i: int,
        xi: vec,
        mark: int,
        kind_base: int,
        c: wp.vec3i,
        state: wp.vec2i,
        own: int,
        edge: bool,
        particle_count: int,
        list_width: int,
        grid: Grid,
        cell_start: wp.array(dtype=int),
        phase: wp.array(dtype=wp.int8),
        anchor: wp.array(dtype=vec),
        neighbours: Listed,
    ):
        s = state
        y0 = int(0)
        y1 = int(0)
        z0 = int(0)
        z1 = int(0)
        if wp.static(dim > 1):
            y0 = c[1] - 2
            y1 = c[1] + 2
            if wp.static(py):
                if grid.ny < 5:
                    y0 = 0
                    y1 = grid.ny - 1
            else:
                y0 = wp.max(y0, 0)
                y1 = wp.min(y1, grid.ny - 1)
        if wp.static(dim > 2):
            z0 = c[2] - 2
            z1 = c[2] + 2
            if wp.static(pz):
                if grid.nz < 5:
                    z0 = 0
                    z1 = grid.nz - 1
            else:
                z0 = wp.max(z0, 0)
                z1 = wp.min(z1, grid.nz - 1)
        z = int(z0)
        while z <= z1:
            zz = int(z)
            if wp.static(pz):
                if zz < 0:
                    zz += grid.nz
                if zz >= grid.nz:
                    zz -= grid.nz
            y = int(y0)
            while y <= y1:
                yy = int(y)
                if wp.static(py):
                    if yy < 0:
                        yy += grid.ny
                    if yy >= grid.ny:
                        yy -= grid.ny
                base = kind_base + (zz * grid.ny + yy) * grid.nx
                s = row(
                    i, xi, mark, base, c[0], s, own, edge, particle_count, list_width, grid, cell_start, phase, anchor,
                    neighbours,
                )  # fmt: skip
                y += 1
            z += 1
        return s

    return search


@functools.cache
def make_list(spec: Spec) -> Any:
    """Return the kernel that fills the neighbour list of every particle: fluid first, then walls.

    Wall particles list fluid only. Mirror images of the fluid follow the fluid itself and count as fluid (`mirror`).
    Entries beyond `list_width` are counted, not stored.
    """
    _, vec, _, _ = types_of(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    reflect = make_images(spec).reflect
    codes = 4**spec.dimension
    image_bit = code_shift(spec.dimension)
    cell_of = make_cell_of(spec.dimension, spec.precision)
    at_edge = make_edge(spec.dimension, spec.precision, spec.periodic)
    search = make_search(spec)
    Listed = make_entry(spec.row_list, spec.wide_list).array
    dim = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def build_list(
        first: int,
        slot: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        grid: Grid,
        cell_start: wp.array(dtype=int),
        phase: wp.array(dtype=wp.int8),
        anchor: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        list_peak: wp.array(dtype=int),
        sides: Sides,
        alive: wp.array(dtype=wp.uint8),
    ):
        i = wp.tid() + first
        if wp.static(spec.changing):
            if i < fluid_count:
                if alive[i] == wp.uint8(0):
                    # what goes through the rows later must find nothing here: entries of one who died name others by now
                    fluid_neighbours[i] = wp.int16(0)
                    if wp.static(spec.walls):
                        wall_neighbours[i] = wp.int16(0)
                    return
        xi = anchor[i]
        c = cell_of(xi, grid)
        own = int(-1)
        if i < fluid_count:
            own = 0
            if wp.static(spec.multiphase):
                own = int(phase[i])
        edge = at_edge(c, grid)
        s = search(
            i, xi, 0, 0, c, wp.vec2i(0, 0), own, edge, particle_count, list_width, grid, cell_start, phase, anchor,
            neighbours,
        )  # fmt: skip
        if wp.static(spec.mirror):
            if i < fluid_count:
                radius = wp.sqrt(grid.list_radius2)
                # code of the sides that are near enough for images, both bits of an axis
                near = int(0)
                for axis in range(wp.static(dim)):
                    if sides.kind[2 * axis] != NO_WALL and xi[axis] - sides.lower[axis] < radius:
                        near = near | (1 << (2 * axis))
                    if sides.kind[2 * axis + 1] != NO_WALL and sides.upper[axis] - xi[axis] < radius:
                        near = near | (2 << (2 * axis))
                if near != 0:
                    for code in range(1, wp.static(codes)):
                        both = (code & (code >> 1)) & wp.static(codes // 3)  # an axis has one mirror at a time
                        if (code & near) == code and both == 0:
                            x = reflect(xi, code, sides)
                            cell = cell_of(x, grid)
                            s = search(
                                i, x, code << image_bit, 0, cell, s, own, at_edge(cell, grid), particle_count, list_width,
                                grid, cell_start, phase, anchor, neighbours,
                            )  # fmt: skip
        fluid = s[0]
        fluid_neighbours[i] = wp.int16(wp.min(fluid, list_width))
        if wp.static(spec.walls):
            if i < fluid_count:
                s = search(
                    i, xi, 0, grid.cell_count, c, s, -1, edge, particle_count, list_width, grid, cell_start, phase,
                    anchor, neighbours,
                )  # fmt: skip
                wall_neighbours[i] = wp.int16(wp.min(s[0], list_width) - wp.min(fluid, list_width))
        if wp.static(any(spec.periodic) or spec.multiphase):
            flags[i] = wp.uint8(s[1])
        # the last entry is a spare that a CPU search writes over
        if s[0] + 1 > list_peak[slot]:
            wp.atomic_max(list_peak, slot, s[0] + 1)

    return build_list


@functools.cache
def make_finish(precision: str) -> Any:
    """Return the one-thread kernel that closes a rebuild and stops the loop if the list is too narrow."""
    real = types(2, precision).real

    @wp.kernel(module="unique", enable_backward=False)
    def finish_rebuild(
        list_width: int,
        list_peak: wp.array(dtype=int),
        maxima: wp.array(dtype=real),
        slack_maxima: wp.array(dtype=real),
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=int),
    ):
        for k in range(slack_maxima.shape[0]):
            slack_maxima[k] = real(0.0)
        peak = int(0)
        for slot in range(list_peak.shape[0]):
            peak = wp.max(peak, list_peak[slot])
            list_peak[slot] = 0
            maxima[slot * MAXIMA + 2] = real(0.0)
        counters[LIST_PEAK] = wp.max(counters[LIST_PEAK], peak)
        counters[REBUILDS] = counters[REBUILDS] + 1
        counters[REBUILD] = 0
        counters[STRAIGHT] = 0
        if counters[USELESS] > 0 and counters[REBUILDS] % RETRY != 0:
            counters[STRAIGHT] = 1
        clock[OFFSET] = wp.float64(0.0)
        clock[CHECK_LASTS] = wp.float64(-1.0)
        if peak > list_width:
            counters[FAULT] = FAULT_LIST
            counters[RUNNING] = 0
            counters[ROOM] = 0

    return finish_rebuild


@functools.cache
def make_band(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels that mark the interface band (two rings) and gather it into a compact list.

    The compact list is for CPU devices; on a GPU a thread outside the band costs less than gathering.
    """
    real, vec, _, _ = types_of(spec)
    has_curvature = spec.curved
    curved = curvature_type(spec)
    phased, _ = phase_types_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def mark_band(
        first: int,
        particle_count: int,
        list_width: int,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        band_mark: wp.array(dtype=int),
        fraction: wp.array(dtype=real),
        normal: wp.array(dtype=vec),
        interface_weight: wp.array(dtype=curved),
        curvature: wp.array(dtype=curved),
        phase: wp.array(dtype=wp.int8),
        share: wp.array(dtype=phased),
    ):
        i = wp.tid() + first
        mark = int(0)
        if (int(flags[i]) & NEAR) != 0:
            mark = 1
        else:
            k = list_begin(i, list_width)
            step = list_step(particle_count)
            end = k + int(fluid_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                if (int(flags[j]) & NEAR) != 0:
                    mark = 1
                    break
        if wp.static(spec.row_list):
            band_mark[i] = mark
        # others read the NEAR bit of this byte meanwhile, which stays as it is
        flags[i] = wp.uint8(int(flags[i]) | (mark * BAND))
        if mark == 0:
            fraction[i] = real(1.0)
            normal[i] = vec()
            interface_weight[i] = curved(real(0.0))
            if wp.static(has_curvature):
                curvature[i] = curved(real(0.0))
            if wp.static(spec.triple):
                alone = phased()
                alone[int(phase[i])] = real(1.0)
                share[i] = alone

    @wp.kernel(module="unique", enable_backward=False)
    def gather_band(
        first: int,
        band_sum: wp.array(dtype=int),
        band_mark: wp.array(dtype=int),
        band: wp.array(dtype=int),
        counters: wp.array(dtype=int),
    ):
        # band_sum is the inclusive sum of band_mark
        i = wp.tid() + first
        if band_mark[i] == 1:
            band[band_sum[i] - 1] = i
        if i == band_sum.shape[0] - 1:
            counters[BAND_COUNT] = band_sum[i]

    return mark_band, gather_band
