"""The neighbour list where each particle has a smoothing length of its own: pairs nearer than the larger support of both.

The cells are as wide as those of one smoothing length. A particle whose support reaches farther than two cells writes how
far into all cells that it reaches; the search about a particle looks as far as its own cell was told. Where all lengths are
alike nothing is written and the search is the usual one of five cells an axis.

A pair is listed where it is nearer than (1 + GROWTH) times the larger support plus the skin. It does not come within reach
unseen before one of its particles has gone half of the skin, or its smoothing length has grown by the share GROWTH. A
smoothing length does not grow beyond that before the list is made anew.
"""

import functools
from typing import Any

import warp as wp

from .cells import make_cell_of, make_grid
from .mirror import NO_WALL, code_shift, make_images, make_sides
from .pair import WRAPPED, make_entry, make_nearest
from .spec import Spec, types_of

USUAL = 2  # cells to either side that every search looks at
GROWTH = 0.1  # share by which a smoothing length may grow before the list is used up
CELL_MARGIN = 1.2  # list radius, over that of the spacing, up to which the usual search is enough


@functools.cache
def make_note_lengths(spec: Spec) -> Any:
    """Return the kernel that notes the smoothing lengths that the list is made for."""
    real = types_of(spec).real

    @wp.kernel(module="unique", enable_backward=False)
    def note_lengths(first: int, smoothing: wp.array(dtype=real), listed_smoothing: wp.array(dtype=real)):
        i = wp.tid() + first
        listed_smoothing[i] = smoothing[i]

    return note_lengths


@functools.cache
def make_clear_reach() -> Any:
    """Return the kernel over cells that sets the usual reach."""

    @wp.kernel(module="unique", enable_backward=False)
    def clear_reach(first: int, cell_reach: wp.array(dtype=int)):
        cell_reach[wp.tid() + first] = wp.static(USUAL)

    return clear_reach


@functools.cache
def make_cell_step() -> Any:
    """Return the `wp.func` cell_step(c, n, periodic): cell of an axis by a number that may be outside, -1 for none."""

    @wp.func
    def cell_step(c: int, n: int, wraps: bool):
        result = c
        if c < 0 or c >= n:
            result = -1
            if wraps:
                result = ((c % n) + n) % n
        return result

    return cell_step


@functools.cache
def make_spread_reach(spec: Spec) -> Any:
    """Return the kernel in which far-reaching particles tell the cells around them how far they reach."""
    real, vec, _, _ = types_of(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    cell_of = make_cell_of(spec.dimension, spec.precision)
    cell_step = make_cell_step()
    px, py, pz = ([*spec.periodic, False, False])[:3]
    dim = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def spread_reach(
        first: int,
        reach: real,
        skin_length: real,
        grid: Grid,
        sides: Sides,
        anchor: wp.array(dtype=vec),
        listed_smoothing: wp.array(dtype=real),
        cell_reach: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        radius = real(1.0 + GROWTH) * reach * listed_smoothing[i] + skin_length
        far = int(USUAL)
        for axis in range(wp.static(dim)):
            far = wp.max(far, int(wp.ceil(radius * grid.inv_cell[axis])))
        if far <= wp.static(USUAL):
            return
        c = cell_of(anchor[i], grid)
        # an axis is gone round at most once
        wx = wp.min(far, grid.nx)
        wy = wp.min(far, grid.ny)
        wz = wp.min(far, grid.nz)
        if wp.static(dim < 2):
            wy = 0
        if wp.static(dim < 3):
            wz = 0
        for z in range(c[2] - wz, c[2] + wz + 1):
            zz = cell_step(z, grid.nz, wp.static(pz))
            if zz < 0:
                continue
            for y in range(c[1] - wy, c[1] + wy + 1):
                yy = cell_step(y, grid.ny, wp.static(py))
                if yy < 0:
                    continue
                for x in range(c[0] - wx, c[0] + wx + 1):
                    xx = cell_step(x, grid.nx, wp.static(px))
                    if xx >= 0:
                        cell = (zz * grid.ny + yy) * grid.nx + xx
                        if far > cell_reach[cell]:
                            wp.atomic_max(cell_reach, cell, far)

    return spread_reach


@functools.cache
def make_varying_scan(spec: Spec) -> Any:
    """Return the `wp.func` scan(i, x, mark, ...): lists the neighbours of x in the cells around it, see the module."""
    real, vec, _, _ = types_of(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    cell_of = make_cell_of(spec.dimension, spec.precision)
    cell_step = make_cell_step()
    px, py, pz = ([*spec.periodic, False, False])[:3]
    dim = spec.dimension
    list_begin, list_step, _, Listed, store = make_entry(spec.row_list, spec.wide_list)

    nearest = make_nearest(spec.precision)

    @wp.func
    def offer(
        i: int, j: int, xi: vec, radius: real, mark: int, state: wp.vec2i, rows: int, list_width: int, reach: real,
        skin_length: real, grid: Grid, anchor: wp.array(dtype=vec), listed_smoothing: wp.array(dtype=real),
        neighbours: Listed,
    ):  # fmt: skip
        raw = xi - anchor[j]
        d = raw + vec()
        if wp.static(px):
            d[0] = nearest(d[0], grid.box[0], real(0.5) * grid.box[0])
        if wp.static(py):
            d[1] = nearest(d[1], grid.box[1], real(0.5) * grid.box[1])
        if wp.static(pz):
            d[2] = nearest(d[2], grid.box[2], real(0.5) * grid.box[2])
        near = wp.max(radius, real(1.0 + GROWTH) * reach * listed_smoothing[j] + skin_length)
        count = state[0]
        flag = state[1]
        if wp.dot(d, d) < near * near and (j != i or mark != 0):
            if count < list_width:
                store(neighbours, i, list_begin(i, list_width) + count * list_step(rows), j + mark)
            count += 1
            for axis in range(wp.static(dim)):
                if d[axis] != raw[axis]:
                    flag = flag | WRAPPED
        return wp.vec2i(count, flag)

    @wp.func
    def scan(
        i: int, xi: vec, mark: int, state: wp.vec2i, rows: int, list_width: int, reach: real, skin_length: real,
        grid: Grid, cell_start: wp.array(dtype=int), cell_reach: wp.array(dtype=int), anchor: wp.array(dtype=vec),
        listed_smoothing: wp.array(dtype=real), neighbours: Listed,
    ):  # fmt: skip
        s = state
        c = cell_of(xi, grid)
        far = cell_reach[(c[2] * grid.ny + c[1]) * grid.nx + c[0]]
        radius = real(1.0 + GROWTH) * reach * listed_smoothing[i] + skin_length
        low = wp.vec3i(c[0] - far, c[1], c[2])
        high = wp.vec3i(c[0] + far, c[1], c[2])
        if wp.static(dim > 1):
            low[1] = c[1] - far
            high[1] = c[1] + far
        if wp.static(dim > 2):
            low[2] = c[2] - far
            high[2] = c[2] + far
        # a periodic axis that is shorter than the search is gone through once
        if wp.static(px):
            if high[0] - low[0] >= grid.nx:
                low[0] = 0
                high[0] = grid.nx - 1
        if wp.static(py):
            if high[1] - low[1] >= grid.ny:
                low[1] = 0
                high[1] = grid.ny - 1
        if wp.static(pz):
            if high[2] - low[2] >= grid.nz:
                low[2] = 0
                high[2] = grid.nz - 1
        for z in range(low[2], high[2] + 1):
            zz = cell_step(z, grid.nz, wp.static(pz))
            if zz < 0:
                continue
            for y in range(low[1], high[1] + 1):
                yy = cell_step(y, grid.ny, wp.static(py))
                if yy < 0:
                    continue
                for x in range(low[0], high[0] + 1):
                    xx = cell_step(x, grid.nx, wp.static(px))
                    if xx < 0:
                        continue
                    cell = (zz * grid.ny + yy) * grid.nx + xx
                    for j in range(cell_start[cell], cell_start[cell + 1]):
                        s = offer(
                            i, j, xi, radius, mark, s, rows, list_width, reach, skin_length, grid, anchor,
                            listed_smoothing, neighbours,
                        )  # fmt: skip
        return s

    return scan


@functools.cache
def make_varying_list(spec: Spec) -> Any:
    """Return the kernel that fills the list of every particle; entries beyond `list_width` are counted, not stored.

    Mirror images follow the particles themselves, as in `cells.make_list`.
    """
    real, vec, _, _ = types_of(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    reflect = make_images(spec).reflect
    scan = make_varying_scan(spec)
    codes = 4**spec.dimension
    image_bit = code_shift(spec.dimension)
    Listed = make_entry(spec.row_list, spec.wide_list).array
    cell_of = make_cell_of(spec.dimension, spec.precision)
    dim = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def build_varying_list(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        reach: real,
        skin_length: real,
        grid: Grid,
        sides: Sides,
        cell_start: wp.array(dtype=int),
        cell_reach: wp.array(dtype=int),
        anchor: wp.array(dtype=vec),
        listed_smoothing: wp.array(dtype=real),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        list_peak: wp.array(dtype=int),
    ):
        i = wp.tid() + first
        xi = anchor[i]
        s = scan(
            i, xi, 0, wp.vec2i(0, 0), particle_count, list_width, reach, skin_length, grid, cell_start, cell_reach,
            anchor, listed_smoothing, neighbours,
        )  # fmt: skip
        if wp.static(spec.mirror):
            # a mirror may show what reaches here from as far as the cell was told
            c = cell_of(xi, grid)
            far = real(cell_reach[(c[2] * grid.ny + c[1]) * grid.nx + c[0]])
            near = int(0)
            for axis in range(wp.static(dim)):
                radius = far / grid.inv_cell[axis]
                if sides.kind[2 * axis] != NO_WALL and xi[axis] - sides.lower[axis] < radius:
                    near = near | (1 << (2 * axis))
                if sides.kind[2 * axis + 1] != NO_WALL and sides.upper[axis] - xi[axis] < radius:
                    near = near | (2 << (2 * axis))
            if near != 0:
                for code in range(1, wp.static(codes)):
                    both = (code & (code >> 1)) & wp.static(codes // 3)  # an axis has one mirror at a time
                    if (code & near) == code and both == 0:
                        s = scan(
                            i, reflect(xi, code, sides), code << image_bit, s, particle_count, list_width, reach,
                            skin_length, grid, cell_start, cell_reach, anchor, listed_smoothing, neighbours,
                        )  # fmt: skip
        fluid_neighbours[i] = wp.int16(wp.min(s[0], list_width))
        if wp.static(any(spec.periodic)):
            flags[i] = wp.uint8(s[1])
        if s[0] + 1 > list_peak[slot]:
            wp.atomic_max(list_peak, slot, s[0] + 1)

    return build_varying_list
