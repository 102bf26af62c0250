"""What inlets and outlets need whatever the scheme: signals, a fit of the fluid before a site, and sites around a point.

A site is the middle of a lattice cell of an open side (`crossing`). The fit takes the fluid alone, not the buffers.
"""

import functools
from typing import Any

import warp as wp

from .cells import make_cell_of, make_grid, make_window
from .crossing import make_open_side
from .fields import FLUID
from .lanes import WARP, make_added, make_lanes
from .pair import separation_of
from .params import make_params
from .smoothing import make_smoothing
from .spec import Spec, types_of

RANGE = 3  # cells around a site that are searched: particles move up to 0.28 of the support between two lists
LEAST_WEIGHT = 0.1  # of the sites next to a particle that have fluid before them
LEAST_PIVOT = 0.04  # of the moments of a fit in powers of the spacing: half of what even particles have
TINY = 1.0e-12  # of a pivot that is rounding


@functools.cache
def make_signal() -> Any:
    """Return the `wp.func` signal_at(time, begin, count, step, signals): a factor sampled every `step` [s]."""

    @wp.func
    def signal_at(time: wp.float64, begin: int, count: int, step: wp.float64, signals: wp.array(dtype=wp.float64)):
        place = wp.clamp(time / step, wp.float64(0.0), wp.float64(count - 1))
        k = wp.min(int(place), wp.max(count - 2, 0))
        share = place - wp.float64(k)
        after = wp.min(k + 1, count - 1)
        return signals[begin + k] * (wp.float64(1.0) - share) + signals[begin + after] * share

    return signal_at


def basis_size(dimension: int) -> int:
    """Return how many terms the fit at a side has: 1, slopes and what is quadratic along the side, the slope across it."""
    across = dimension - 1
    return 1 + dimension + across * (across + 1) // 2


@functools.cache
def make_solve(size: int) -> Any:
    """Return the `wp.func` solve(m, b) of a symmetric matrix of moments by elimination, with pivots of LEAST_PIVOT at least.

    A pivot is the mean square of what a term has that those before it have not. Where the places of the fluid do not tell
    them apart, as the slope across a side where a single column of particles is seen, the share of the term falls to 0
    with its pivot; divided by it, the scatter of a column would become a slope without bound (theory: riemann#open).
    """
    row = wp.types.vector(length=size, dtype=wp.float64)
    square = wp.types.matrix(shape=(size, size), dtype=wp.float64)

    @wp.func
    def solve(m: square, b: row):
        u = m + square()
        x = b + row()
        for k in range(size):
            for i in range(k + 1, size):
                share = u[i, k] / wp.max(u[k, k], wp.float64(TINY))
                for j in range(k, size):
                    u[i, j] = u[i, j] - share * u[k, j]
                x[i] = x[i] - share * x[k]
        for back in range(size):
            k = size - 1 - back
            total = x[k] / wp.max(u[k, k], wp.float64(LEAST_PIVOT))
            for j in range(k + 1, size):
                total -= u[k, j] / wp.max(u[k, k], wp.float64(TINY)) * x[j]
            x[k] = total
        return x

    return solve


def site_lanes(spec: Spec) -> int:
    """Return how many threads work on a site: on a GPU a warp, as sites are few and look at a hundred particles each."""
    return 1 if spec.row_list else WARP


def sites_of(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s (site_of(t), lane_of(t)) of a thread of a kernel over sites."""
    return make_lanes(site_lanes(spec))[:2]


@functools.cache
def make_fit(spec: Spec) -> Any:
    """Return the `wp.func` fit(x, lane, ...) of the fluid around a site: pressure, velocity, slopes across, validity.

    Each of the `site_lanes` of a site looks into some of the cells, and all have the result.

    Least squares with the weights kernel times volume, linear across the side and quadratic along it: a linear fit would
    take the curvature of a velocity profile for a velocity, and Z times that for a pressure. Terms that the places of the
    fluid do not tell apart are left out by degrees, see `make_solve`; without any fluid there is no value.
    """
    real, vec, _, pair = types_of(spec)
    d, axis = spec.dimension, spec.open_axis
    size = basis_size(d)
    row = wp.types.vector(length=size, dtype=wp.float64)
    square = wp.types.matrix(shape=(size, size), dtype=wp.float64)
    values_of = wp.types.vector(length=d + 1, dtype=wp.float64)
    table = wp.types.matrix(shape=(d + 1, size), dtype=wp.float64)
    first_across, second_across = ([k for k in range(d) if k != axis] * 2)[:2]
    Params = make_params(d, spec.precision)
    Grid = make_grid(d, spec.precision)
    cell_of = make_cell_of(d, spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    solve, window = make_solve(size), make_window(RANGE)
    lanes = site_lanes(spec)
    added_square, added_table = make_added(lanes, square), make_added(lanes, table)
    px, py, pz = ([*spec.periodic, False, False])[:3]

    @wp.struct
    class Fitted:
        valid: int
        pressure: wp.float64
        slope: wp.float64
        stretch: wp.float64
        velocity: vec

    @wp.func
    def terms(off: vec):
        result = row()
        result[0] = wp.float64(1.0)
        a = wp.float64(off[first_across])
        result[1] = a
        if wp.static(d == 2):
            result[2] = a * a
        else:
            b = wp.float64(off[second_across])
            result[2] = b
            result[3] = a * a
            result[4] = b * b
            result[5] = a * b
        result[wp.static(size - 1)] = wp.float64(off[axis])
        return result

    @wp.func
    def fit(
        x: vec,
        lane: int,
        params: Params,
        grid: Grid,
        cell_start: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        zone: wp.array(dtype=wp.int8),
    ):
        c = cell_of(x, grid)
        x0, x1 = window(c[0], grid.nx, px)
        y0, y1 = window(c[1], grid.ny, py)
        z0, z1 = window(c[2], grid.nz, pz)
        spacings = real(1.0) / (params.inv_h * params.spacing)
        moment = square()
        right = table()  # a row for each of pressure and velocity, a column for each term
        turn = int(0)  # the lane that looks into the next cell
        for cz in range(z0, z1):
            for cy in range(y0, y1):
                for cx in range(x0, x1):
                    if wp.static(lanes > 1):
                        mine = turn == lane
                        turn = (turn + 1) % lanes
                        if not mine:
                            continue
                    line = ((cz + grid.nz) % grid.nz) * grid.ny + (cy + grid.ny) % grid.ny
                    cell = line * grid.nx + (cx + grid.nx) % grid.nx
                    for j in range(cell_start[cell], cell_start[cell + 1]):
                        if int(zone[j]) == FLUID:
                            off = separation(position[j], x, True, params) * params.inv_h
                            weight = wp.float64(shape(wp.length(off)) * state[j][1])
                            if weight > wp.float64(0.0):
                                basis = terms(off * spacings)
                                found = values_of()
                                found[0] = wp.float64(state[j][0])
                                for a in range(wp.static(d)):
                                    found[a + 1] = wp.float64(velocity[j][a])
                                moment += weight * wp.outer(basis, basis)
                                right += weight * wp.outer(found, basis)
        if wp.static(lanes > 1):
            moment, right = added_square(moment), added_table(right)
        result = Fitted()
        total = moment[0, 0]
        result.valid = 0
        if total > wp.float64(0.0):
            result.valid = 1
            unit = row()
            unit[0] = wp.float64(1.0)
            first = solve(moment / total, unit)
            unit[0] = wp.float64(0.0)
            unit[wp.static(size - 1)] = wp.float64(1.0)
            second = solve(moment / total, unit) / wp.float64(params.spacing)
            result.slope = wp.dot(right[0], second) / total
            result.stretch = wp.dot(right[1 + axis], second) / total
            result.pressure = wp.dot(right[0], first) / total
            for a in range(wp.static(d)):
                result.velocity[a] = real(wp.dot(right[a + 1], first) / total)
        return result

    return fit


@functools.cache
def make_site_at(spec: Spec) -> Any:
    """Return the `wp.func` site_at(x, side, corner) -> (site, weight) of the linear interpolation between sites of a side.

    corner: 0 to 3, of the cell of sites around the point. Half a spacing beyond the last site the line is continued.
    """
    real, vec, _, _ = types_of(spec)
    OpenSide = make_open_side(spec.precision)

    @wp.func
    def along(place: real, count: int, wraps: int, end: int):
        before = int(wp.floor(place))
        if wraps == 0:
            before = wp.clamp(before, 0, wp.max(count - 2, 0))
        share = wp.clamp(place - real(before), real(-0.5), real(1.5))
        if count == 1:
            share = real(0.0)
        if end == 0:
            share = real(1.0) - share
        return (before + end + count) % count, share

    @wp.func
    def site_at(x: vec, side: OpenSide, corner: int):
        a = (x[side.first_axis] - side.first_origin) / side.first_spacing
        b = (x[side.second_axis] - side.second_origin) / side.second_spacing
        m, first_share = along(a, side.first_count, side.first_wraps, corner & 1)
        n, second_share = along(b, side.second_count, side.second_wraps, corner >> 1)
        return side.first_site + n * side.first_count + m, first_share * second_share

    return site_at


@functools.cache
def make_between(spec: Spec) -> tuple[Any, Any]:
    """Return the `wp.func`s (corners_of(x, side, site_open), between(values, corners)) that interpolate between sites.

    corners_of finds the sites around a point, their weights, none for those that no fluid is before, and the sum of these;
    where that is small, the sum of the values is not divided by it. between takes values at sites of any type.
    """
    real, vec, _, _ = types_of(spec)
    OpenSide = make_open_side(spec.precision)
    site_at = make_site_at(spec)
    weights = wp.types.vector(length=4, dtype=real)

    @wp.struct
    class Corners:
        site: wp.vec4i
        weight: weights
        total: real

    @wp.func
    def corners_of(x: vec, side: OpenSide, site_open: wp.array(dtype=wp.uint8)):
        corners = Corners()
        total = real(0.0)
        for corner in range(4):
            k, weight = site_at(x, side, corner)
            corners.site[corner] = k
            if site_open[k] == wp.uint8(1):
                corners.weight[corner] = weight
                total += weight
        corners.total = real(1.0)
        if wp.abs(total) > real(LEAST_WEIGHT):
            corners.total = total
        return corners

    @wp.func
    def between(values: wp.array(dtype=Any), corners: Corners):
        result = values.dtype(real(0.0))
        for corner in range(4):
            result += corners.weight[corner] * values[corners.site[corner]]
        return result / corners.total

    return corners_of, between
