"""Lines of sight at thin tails of bodies: what a particle sees past an edge, and what the body hides (theory: bodies#tails).

Near its edge a tail counts as the half plane from the edge into the body, in the middle between its two sides, up to where
the body ends if it is thin all the way. A line of
sight from x_i to x_j either crosses it, and then enters the body on the side of x_i, or does not, and then what is at x_j is
on its own side. Each boundary particle of a tail belongs to the sheet of one side, and is seen through that side alone.

What a particle does not see is taken out of its neighbour list when this is built, so that no sweep over pairs knows of
tails. The frames of lines of sight are a table of places along the middle of each tail, with the edge and its
directions there (`warpsph/scene/sheets.py`); a pair is judged by the frames nearest to both.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from .mirror import code_shift
from .pair import WRAPPED, make_entry, separation_of
from .params import make_params
from .spec import Spec, types, types_of


class Sight(NamedTuple):
    """`wp.func`s of lines of sight at an edge.

    side_entered(x_i, x_j, edge, along, across, extent): 1 or -1, the side from which x_i looks at x_j: +1 that of `across`.
    hidden(x_i, x_j, edge, along, across, extent): whether the tail is between the two points.
    """

    side_entered: Any
    hidden: Any


@functools.cache
def make_sight(dimension: int, precision: str) -> Sight:
    """Return the functions for a dimension and precision; `along` and `across` are unit vectors at right angles."""
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def hidden(xi: vec, xj: vec, edge: vec, along: vec, across: vec, extent: real):
        hi = wp.dot(xi - edge, across)
        hj = wp.dot(xj - edge, across)
        # The crossing is at ((x_i - edge).along |h_j| + (x_j - edge).along |h_i|) / (|h_i| + |h_j|) past the edge.
        past = wp.dot(xi - edge, along) * wp.abs(hj) + wp.dot(xj - edge, along) * wp.abs(hi)
        return hi * hj < real(0.0) and past < real(0.0) and past > -extent * (wp.abs(hi) + wp.abs(hj))

    @wp.func
    def side_entered(xi: vec, xj: vec, edge: vec, along: vec, across: vec, extent: real):
        h = wp.dot(xj - edge, across)
        if hidden(xi, xj, edge, along, across, extent):
            h = -h
        side = int(1)
        if h < real(0.0):
            side = -1
        return side

    return Sight(side_entered, hidden)


@functools.cache
def make_frame_box(dimension: int, precision: str) -> Any:
    """Return the kernel of one thread that finds the box around all frames, wherever the bodies have moved."""
    _, vec, _, _ = types(dimension, precision)

    @wp.kernel(module="unique", enable_backward=False)
    def frame_box(frame_point: wp.array(dtype=vec), frame_corners: wp.array(dtype=vec)):
        low = frame_point[0]
        high = frame_point[0]
        for k in range(1, frame_point.shape[0]):
            low = wp.min(low, frame_point[k])
            high = wp.max(high, frame_point[k])
        frame_corners[0] = low
        frame_corners[1] = high

    return frame_box


@functools.cache
def make_nearest_frame(spec: Spec) -> Any:
    """Return the kernel over the fluid that finds the frame nearest to each particle within `frame_reach`."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    dim = spec.dimension

    @wp.kernel(module="unique", enable_backward=False)
    def nearest_frame(
        first: int,
        params: Params,
        frame_reach: real,
        anchor: wp.array(dtype=vec),
        flags: wp.array(dtype=wp.uint8),
        frame_point: wp.array(dtype=vec),
        frame_corners: wp.array(dtype=vec),
        frame_near: wp.array(dtype=wp.int16),
    ):
        i = wp.tid() + first
        x = anchor[i]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        found = int(-1)
        close = bool(True)
        if not wrapped:
            for axis in range(wp.static(dim)):
                if x[axis] < frame_corners[0][axis] - frame_reach or x[axis] > frame_corners[1][axis] + frame_reach:
                    close = False
        if close:
            least = frame_reach * frame_reach
            for k in range(frame_point.shape[0]):
                d = separation(x, frame_point[k], wrapped, params)
                if wp.dot(d, d) < least:
                    least = wp.dot(d, d)
                    found = k
        frame_near[i] = wp.int16(found)

    return nearest_frame


@functools.cache
def make_unsee(spec: Spec) -> Any:
    """Return the kernel over all particles that takes out of their lists what they do not see.

    A wall particle of a sheet keeps the fluid that sees it. Mirror images are kept: they are behind a side of the domain.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    begin, stride, read, Listed, write = make_entry(spec.row_list, spec.wide_list)
    side_entered, hidden = make_sight(spec.dimension, spec.precision)
    image_bit = code_shift(spec.dimension)

    @wp.func
    def blocked(
        xi: vec,
        d: vec,
        frame: int,
        wrapped: bool,
        params: Params,
        frame_edge: wp.array(dtype=vec),
        frame_along: wp.array(dtype=vec),
        frame_across: wp.array(dtype=vec),
        frame_extent: wp.array(dtype=real),
    ):
        result = bool(False)
        if frame >= 0:
            a = separation(xi, frame_edge[frame], wrapped, params)
            result = hidden(a, a - d, vec(), frame_along[frame], frame_across[frame], frame_extent[frame])
        return result

    @wp.func
    def enters(
        xi: vec,
        d: vec,
        frame: int,
        side: int,
        wrapped: bool,
        params: Params,
        frame_edge: wp.array(dtype=vec),
        frame_along: wp.array(dtype=vec),
        frame_across: wp.array(dtype=vec),
        frame_extent: wp.array(dtype=real),
    ):
        result = bool(True)
        if side != 0:
            a = separation(xi, frame_edge[frame], wrapped, params)
            result = side_entered(a, a - d, vec(), frame_along[frame], frame_across[frame], frame_extent[frame]) == side
        return result

    @wp.kernel(module="unique", enable_backward=False)
    def unsee(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        anchor: wp.array(dtype=vec),
        flags: wp.array(dtype=wp.uint8),
        sheet: wp.array(dtype=wp.int8),
        frame: wp.array(dtype=wp.int16),
        frame_near: wp.array(dtype=wp.int16),
        frame_edge: wp.array(dtype=vec),
        frame_along: wp.array(dtype=vec),
        frame_across: wp.array(dtype=vec),
        frame_extent: wp.array(dtype=real),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
    ):
        i = wp.tid() + first
        walls_begin = particle_count - sheet.shape[0]
        is_wall = i >= walls_begin
        if not is_wall and i >= fluid_count:
            return
        own = int(-1)
        own_side = int(0)
        if is_wall:
            own = int(frame[i - walls_begin])
            own_side = int(sheet[i - walls_begin])
            if own_side == 0:
                return
        else:
            own = int(frame_near[i])
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        xi = anchor[i]
        place = begin(i, list_width)
        step = stride(particle_count)
        target = int(place)
        kept = int(0)
        for _k in range(int(fluid_neighbours[i])):
            entry = read(neighbours, i, place)
            place += step
            seen = bool(True)
            if entry < wp.static(1 << image_bit) or wp.static(not spec.mirror):
                d = separation(xi, anchor[entry], wrapped, params)
                if is_wall:
                    seen = enters(
                        xi - d, -d, own, own_side, wrapped, params, frame_edge, frame_along, frame_across,
                        frame_extent,
                    )  # fmt: skip
                else:
                    other = int(frame_near[entry])
                    if own >= 0 or other >= 0:
                        seen = not (
                            blocked(xi, d, own, wrapped, params, frame_edge, frame_along, frame_across, frame_extent)
                            or blocked(xi, d, other, wrapped, params, frame_edge, frame_along, frame_across, frame_extent)
                        )  # fmt: skip
            if seen:
                write(neighbours, i, target, entry)
                target += step
                kept += 1
        if is_wall:
            fluid_neighbours[i] = wp.int16(kept)
            return
        kept_walls = int(0)
        for _k in range(int(wall_neighbours[i])):
            entry = read(neighbours, i, place)
            place += step
            w = entry - walls_begin
            d = separation(xi, anchor[entry], wrapped, params)
            seen = enters(
                xi, d, int(frame[w]), int(sheet[w]), wrapped, params, frame_edge, frame_along, frame_across, frame_extent
            )  # fmt: skip
            if seen:
                write(neighbours, i, target, entry)
                target += step
                kept_walls += 1
        fluid_neighbours[i] = wp.int16(kept)
        wall_neighbours[i] = wp.int16(kept_walls)

    return unsee
