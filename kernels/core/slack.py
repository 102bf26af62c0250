"""Is the neighbour list still good? The relative motion of neighbouring cells, now and predicted.

A list with skin stays complete until two particles that were further apart than support + skin have come nearer than
the support, which takes a *relative* displacement of one skin. Half a skin of absolute displacement is a safe sign
but a poor one: neighbours move together. So when that sign appears, the extremes of the displacements in each cell
and in the cells within three of it are compared, for the displacements now and for those some steps ahead
if every particle kept its velocity. In between both bounds mix linearly; what accelerations and shifts add later is
summed up by the clock (`advance`). Cells further apart than three cannot matter before a particle has moved a quarter
of the list radius, which always asks for a rebuild.

Where the coming step shifts particles by what is known already (`spec.shift_ahead`), a look at many steps is of little
use: the longest shift of all, counted twice in each, uses up the skin in a few, while neighbours are shifted alike. So
the check looks one step ahead there, with the shift of each particle, and is made anew in each step.
"""

import functools
from typing import Any

import warp as wp

from .cells import make_grid
from .clock import STEP, steps_ahead
from .pair import make_at
from .spec import Spec, types, types_of

WINDOW = 3


@functools.cache
def make_extremes(dimension: int, precision: str) -> tuple[Any, Any]:
    """Return the `wp.func`s (lower(a, b), higher(a, b)) of each axis; `wp.min` takes twice as long on a CPU, as it cares for
    what is no number.
    """
    vec = types(dimension, precision).vec

    @wp.func
    def lower(a: vec, b: vec):
        result = vec()
        for axis in range(dimension):
            result[axis] = wp.where(a[axis] < b[axis], a[axis], b[axis])
        return result

    @wp.func
    def higher(a: vec, b: vec):
        result = vec()
        for axis in range(dimension):
            result[axis] = wp.where(a[axis] > b[axis], a[axis], b[axis])
        return result

    return lower, higher


@functools.cache
def make_slack(spec: Spec) -> tuple[Any, Any, Any]:
    """Return the kernels (extremes per cell, extremes over a window along one axis, largest relative displacement)."""
    real, vec, _, _ = types_of(spec)
    Grid = make_grid(spec.dimension, spec.precision)
    px, py, pz = ([*spec.periodic, False, False])[:3]
    (lower, higher), at = make_extremes(spec.dimension, spec.precision), make_at(vec)
    huge, ahead = 1.0e30, steps_ahead(spec.shift_ahead)

    @wp.kernel(module="unique", enable_backward=False)
    def cell_extremes(
        first: int,
        grid: Grid,
        clock: wp.array(dtype=wp.float64),
        cell_start: wp.array(dtype=int),
        offset: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        low_now: wp.array(dtype=vec),
        high_now: wp.array(dtype=vec),
        low_then: wp.array(dtype=vec),
        high_then: wp.array(dtype=vec),
    ):
        c = wp.tid() + first
        zero = vec()
        ln = zero + vec(real(huge))
        hn = zero - vec(real(huge))
        lt = zero + vec(real(huge))
        ht = zero - vec(real(huge))
        tau = real(clock[STEP] * wp.float64(ahead))
        i = cell_start[c]
        end = cell_start[c + 1]
        while i < end:
            d = offset[i]
            e = d + velocity[i] * tau
            if wp.static(spec.shift_ahead):
                e += shift[i]
            ln = wp.min(ln, d)
            hn = wp.max(hn, d)
            lt = wp.min(lt, e)
            ht = wp.max(ht, e)
            i += 1
        if wp.static(spec.moving):
            i = cell_start[c + grid.cell_count]
            end = cell_start[c + grid.cell_count + 1]
            while i < end:
                d = position[i] - anchor[i]
                e = d + velocity[i] * tau
                ln = wp.min(ln, d)
                hn = wp.max(hn, d)
                lt = wp.min(lt, e)
                ht = wp.max(ht, e)
                i += 1
        elif wp.static(spec.walls):
            if cell_start[c + grid.cell_count + 1] > cell_start[c + grid.cell_count]:
                ln = wp.min(ln, zero)
                hn = wp.max(hn, zero)
                lt = wp.min(lt, zero)
                ht = wp.max(ht, zero)
        low_now[c] = ln
        high_now[c] = hn
        low_then[c] = lt
        high_then[c] = ht

    @wp.kernel(module="unique", enable_backward=False)
    def window_extremes(
        first: int,
        grid: Grid,
        axis: int,
        low_now: wp.array(dtype=vec),
        high_now: wp.array(dtype=vec),
        low_then: wp.array(dtype=vec),
        high_then: wp.array(dtype=vec),
        low_now_out: wp.array(dtype=vec),
        high_now_out: wp.array(dtype=vec),
        low_then_out: wp.array(dtype=vec),
        high_then_out: wp.array(dtype=vec),
    ):
        c = wp.tid() + first
        count = grid.nx
        stride = int(1)
        place = c % grid.nx
        wraps = bool(px)
        if axis == 1:
            count = grid.ny
            stride = grid.nx
            place = (c / grid.nx) % grid.ny
            wraps = bool(py)
        if axis == 2:
            count = grid.nz
            stride = grid.nx * grid.ny
            place = c / (grid.nx * grid.ny)
            wraps = bool(pz)
        ln = low_now[c]
        hn = high_now[c]
        lt = low_then[c]
        ht = high_then[c]
        step = int(-WINDOW)
        while step <= WINDOW:
            other = place + step
            if wraps:
                other = (other + WINDOW * count) % count
            if other >= 0 and other < count:
                k = c + (other - place) * stride
                ln = lower(ln, at(low_now, k))
                hn = higher(hn, at(high_now, k))
                lt = lower(lt, at(low_then, k))
                ht = higher(ht, at(high_then, k))
            step += 1
        low_now_out[c] = ln
        high_now_out[c] = hn
        low_then_out[c] = lt
        high_then_out[c] = ht

    @wp.kernel(module="unique", enable_backward=False)
    def relative_displacement(
        first: int,
        slot: int,
        low_now: wp.array(dtype=vec),
        high_now: wp.array(dtype=vec),
        low_then: wp.array(dtype=vec),
        high_then: wp.array(dtype=vec),
        low_now_out: wp.array(dtype=vec),
        high_now_out: wp.array(dtype=vec),
        low_then_out: wp.array(dtype=vec),
        high_then_out: wp.array(dtype=vec),
        slack_maxima: wp.array(dtype=real),
    ):
        c = wp.tid() + first
        if low_now[c][0] > high_now[c][0]:
            return  # an empty cell
        now = wp.max(high_now_out[c] - low_now[c], high_now[c] - low_now_out[c])
        then = wp.max(high_then_out[c] - low_then[c], high_then[c] - low_then_out[c])
        n2 = wp.dot(now, now)
        t2 = wp.dot(then, then)
        if n2 > slack_maxima[slot * 2]:
            wp.atomic_max(slack_maxima, slot * 2, n2)
        if t2 > slack_maxima[slot * 2 + 1]:
            wp.atomic_max(slack_maxima, slot * 2 + 1, t2)

    return cell_extremes, window_extremes, relative_displacement
