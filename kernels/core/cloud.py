"""A fitted start: particles are moved to an even arrangement with rows along the interfaces between phases.

Lengths are in particle spacings. One iteration moves a particle by

    x += -A h^2 sum_j grad_i W V_j

over all neighbours, at most `CAP`, and then, near an interface, along its normal: to half a spacing from it on its own
side if it is nearer than that or beyond, and a part of the way (`towards_row`) to that row if it is between there and
`ROW_ENDS`, so that no particle stays between the first row and the second.

Interfaces are clouds of points with normals, ordered by the cells of the lattice. Near its nearest point an interface is
taken as flat.
"""

import functools
from typing import Any

import warp as wp

from .pair import WRAPPED, list_access, separation_of
from .params import make_params
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types, types_of

ROW = 0.5  # distance of the first row from the interface
ROW_ENDS = 0.9  # a particle nearer than this belongs to the first row
FARTHEST_PUSHED = 0.75  # from the nearest interface point: a particle off the end of an interface is left alone
FARTHEST_DRAWN = 1.0
ASIDE = 0.32  # a particle farther than this from the normal of an interface point is not above that part of an interface
SAME_FACE = 0.5  # cosine of the angle between normals above which two interface points count as one constraint
OPPOSITE = -0.5  # and below which they are the two sides of a film
CAP = 0.1  # longest way of one iteration, but for the push from an interface


@functools.cache
def make_cloud(dimension: int, precision: str) -> Any:
    """Return the `Cloud` struct: the lattice cells by which interface points are ordered; in 2-D one cell deep."""
    _, vec, _, _ = types_of(Spec(dimension=dimension, precision=precision))

    @wp.struct
    class Cloud:
        inv_cell: vec  # 1 / cell width; the cells start at the origin
        low: vec  # where particles may be
        high: vec
        nx: int
        ny: int
        nz: int

    return Cloud


@functools.cache
def make_cell_along(precision: str) -> Any:
    """Return the `wp.func` cell_along(x, inv_cell, n): the cell of a coordinate along one axis of n cells."""
    real = types(2, precision).real

    @wp.func
    def cell_along(x: real, inv_cell: real, n: int):
        return wp.clamp(int(wp.floor(x * inv_cell)), 0, n - 1)

    return cell_along


@functools.cache
def make_cloud_search(spec: Spec) -> Any:
    """Return the `wp.func` search(x, own, first, ...): index of an interface point near x, or -1.

    first < 0: the nearest point of an interface of the phase `own`; else the point of another face than that of `first`, on
    which x comes down, that asks for the longest push.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Cloud = make_cloud(spec.dimension, spec.precision)
    separation = separation_of(spec)
    cell_along = make_cell_along(spec.precision)
    dim = spec.dimension
    px, py, pz = ([*spec.periodic, False, False])[:3]
    any_periodic = any(spec.periodic)
    row = ROW
    pushed2 = FARTHEST_PUSHED**2
    drawn2 = FARTHEST_DRAWN**2
    aside2 = ASIDE**2
    same_face = SAME_FACE

    @wp.func
    def turned(c: int, n: int):
        result = c
        if c < 0:
            result = c + n
        elif c >= n:
            result = c - n
        return result

    @wp.func
    def search(
        x: vec,
        own: int,
        first: int,
        params: Params,
        cloud: Cloud,
        cloud_start: wp.array(dtype=int),
        cloud_point: wp.array(dtype=vec),
        cloud_normal: wp.array(dtype=vec),
        cloud_below: wp.array(dtype=wp.int8),
        cloud_above: wp.array(dtype=wp.int8),
    ):
        best = int(-1)
        least = real(drawn2)
        most = real(0.0)
        facing = vec()
        if first >= 0:
            facing = cloud_normal[first]
            if int(cloud_below[first]) == own:
                facing = -facing
        cx = cell_along(x[0], cloud.inv_cell[0], cloud.nx)
        cy = cell_along(x[1], cloud.inv_cell[1], cloud.ny)
        cz = int(0)
        reach_z = int(0)
        if wp.static(dim > 2):
            cz = cell_along(x[2], cloud.inv_cell[2], cloud.nz)
            reach_z = 1
        for iz in range(cz - reach_z, cz + reach_z + 1):
            z = int(iz)
            if wp.static(pz):
                z = turned(iz, cloud.nz)
            if z < 0 or z >= cloud.nz:
                continue
            for iy in range(cy - 1, cy + 2):
                y = int(iy)
                if wp.static(py):
                    y = turned(iy, cloud.ny)
                if y < 0 or y >= cloud.ny:
                    continue
                for ix in range(cx - 1, cx + 2):
                    cell = int(ix)
                    if wp.static(px):
                        cell = turned(ix, cloud.nx)
                    if cell < 0 or cell >= cloud.nx:
                        continue
                    cell += (z * cloud.ny + y) * cloud.nx
                    for k in range(cloud_start[cell], cloud_start[cell + 1]):
                        below = int(cloud_below[k])
                        if below != own and int(cloud_above[k]) != own:
                            continue
                        d = separation(x, cloud_point[k], wp.static(any_periodic), params)
                        r2 = wp.dot(d, d)
                        if first < 0:
                            if r2 < least:
                                least = r2
                                best = k
                        elif r2 < real(pushed2):
                            n = cloud_normal[k]
                            if below == own:
                                n = -n
                            away = wp.dot(d, n)
                            need = real(row) - away
                            if need > most and wp.dot(n, facing) < real(same_face) and r2 - away * away < real(aside2):
                                most = need
                                best = k
        return best

    return search


@functools.cache
def make_packing(spec: Spec) -> tuple[Any, Any]:
    """Return the kernels of one iteration: `arrange` writes the way of each particle, `go` moves them all.

    spec: multiphase, two or three dimensions; of the smoothing kernel, `row_list`, walls and periods alone count.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Cloud = make_cloud(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    cell_along = make_cell_along(spec.precision)
    search = make_cloud_search(spec)
    dim = spec.dimension
    any_periodic = any(spec.periodic)
    row = ROW
    row_ends = ROW_ENDS
    pushed2 = FARTHEST_PUSHED**2
    aside2 = ASIDE**2
    opposite = OPPOSITE
    longest = CAP

    @wp.func
    def inside(x: vec, cloud: Cloud):
        result = x + vec()
        for axis in range(wp.static(dim)):
            result[axis] = wp.clamp(x[axis], cloud.low[axis], cloud.high[axis])
        return result

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def arrange(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        cloud: Cloud,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        towards_row: wp.array(dtype=real),
        cloud_near: wp.array(dtype=wp.uint8),
        cloud_start: wp.array(dtype=int),
        cloud_point: wp.array(dtype=vec),
        cloud_normal: wp.array(dtype=vec),
        cloud_below: wp.array(dtype=wp.int8),
        cloud_above: wp.array(dtype=wp.int8),
        way: wp.array(dtype=vec),
        uneven: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        old = position[i]
        wrapped = (int(flags[i]) & WRAPPED) != 0
        even = vec()
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(old, position[j], wrapped, params)
            even += (slope(wp.length(d) * params.inv_h) * rest_volume[j]) * d
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(old, position[j], wrapped, params)
                even += slope(wp.length(d) * params.inv_h) * d
        even = even * params.g_norm
        uneven[i] = even
        move = even * (-params.shifting * params.h * params.h)
        length = wp.length(move)
        if length > real(longest):
            move = move * (real(longest) / length)
        x = old + move

        cell = cell_along(x[0], cloud.inv_cell[0], cloud.nx)
        cell += cell_along(x[1], cloud.inv_cell[1], cloud.ny) * cloud.nx
        if wp.static(dim > 2):
            cell += cell_along(x[2], cloud.inv_cell[2], cloud.nz) * cloud.nx * cloud.ny
        if cloud_near[cell] != wp.uint8(0):
            own = int(phase[i])
            one = search(x, own, -1, params, cloud, cloud_start, cloud_point, cloud_normal, cloud_below, cloud_above)
            if one >= 0:
                n = cloud_normal[one]
                if int(cloud_below[one]) == own:
                    n = -n
                d = separation(x, cloud_point[one], wp.static(any_periodic), params)
                away = wp.dot(d, n)
                need = real(row) - away
                if need > real(0.0):
                    if wp.dot(d, d) < real(pushed2):
                        other = search(
                            x, own, one, params, cloud, cloud_start, cloud_point, cloud_normal, cloud_below, cloud_above
                        )
                        push = need * n
                        if other >= 0:
                            m = cloud_normal[other]
                            if int(cloud_below[other]) == own:
                                m = -m
                            need2 = real(row) - wp.dot(separation(x, cloud_point[other], wp.static(any_periodic), params), m)
                            c = wp.dot(n, m)
                            if c < real(opposite):
                                push = real(0.5) * (push + need2 * m)  # to the middle of a film that is too thin
                            else:
                                # the shortest way that takes x to the row of both faces
                                along = (need2 - c * need) / (real(1.0) - c * c)
                                if along > real(0.0):
                                    push = ((need - c * need2) / (real(1.0) - c * c)) * n + along * m
                        x += push
                        back = inside(x, cloud) - x
                        if wp.dot(back, back) > real(0.0):
                            # a side of the domain is in the way: make good along it what is lost
                            x += back
                            along_side = n + vec()
                            for axis in range(wp.static(dim)):
                                if back[axis] != real(0.0):
                                    along_side[axis] = real(0.0)
                            share = wp.dot(along_side, n)
                            if share > real(0.2):
                                x -= (wp.min(wp.dot(back, n), real(0.0)) / share) * along_side
                elif away < real(row_ends) and wp.dot(d, d) - away * away < real(aside2):
                    x += (towards_row[0] * need) * n
        way[i] = inside(x, cloud) - old

    @wp.kernel(module="unique", enable_backward=False)
    def go(
        first: int,
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        way: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        offset[i] = offset[i] + way[i]
        position[i] = anchor[i] + offset[i]

    return arrange, go
