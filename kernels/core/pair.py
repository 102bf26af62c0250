"""What every neighbour sum needs of a pair: its separation across periodic images and its place in the list."""

import functools
from typing import Any, NamedTuple

import warp as wp

from .params import make_params
from .spec import Spec, types, types_of

# bits of the field `flags`
WRAPPED = 1  # the list of this particle reaches across a periodic boundary
NEAR = 2  # a particle of another phase is in the list (first ring of the interface)
BAND = 4  # the list holds a first-ring particle (second ring, or the first itself)


LARGEST = 0x7FFFFFFF


@wp.func
def natural(number: int):
    """A number that is not negative, said so that the compiler knows: no index of an array that it is has to be tested.

    Warp counts a negative index from the end of the array, which takes three instructions for each array that a pair reads.
    """
    return number & LARGEST


@functools.cache
def make_at(dtype: Any) -> Any:
    """Return the `wp.func` at(values, j): entry j >= 0 of a field of a type, which has no gaps.

    Warp reads an array with the stride that it has and counts a negative index from its end: a multiplication and three
    instructions for each array that a pair reads. Here neither is done. Warp's debug mode checks what it reads itself.
    """
    if wp.config.mode == "debug":

        @wp.func
        def at(values: wp.array(dtype=dtype), j: int):
            return values[j]

        return at

    @wp.func_native("return values.data[j];")
    def at_once(values: wp.array(dtype=dtype), j: int) -> dtype: ...

    return at_once


@functools.cache
def make_part(dtype: Any) -> Any:
    """Return the `wp.func` part(values, j, axis): a number of entry j >= 0 of a field of vectors.

    A function that gives back a vector keeps the compiler from working on several neighbours at once on a CPU: loops that
    are to be quick there read, add and multiply numbers (docs/records/pair_loops.md#vectors).
    """
    real = dtype._wp_scalar_type_
    if wp.config.mode == "debug":

        @wp.func
        def part(values: wp.array(dtype=dtype), j: int, axis: int):
            return values[j][axis]

        return part

    @wp.func_native("return values.data[j].c[axis];")
    def part_at_once(values: wp.array(dtype=dtype), j: int, axis: int) -> real: ...

    return part_at_once


@functools.cache
def make_element(dtype: Any) -> Any:
    """Return the `wp.func` element(values, j, row, column): a number of entry j >= 0 of a field of matrices."""
    real = dtype._wp_scalar_type_
    if wp.config.mode == "debug":

        @wp.func
        def element(values: wp.array(dtype=dtype), j: int, row: int, column: int):
            return values[j][row, column]

        return element

    @wp.func_native("return values.data[j].data[row][column];")
    def element_at_once(values: wp.array(dtype=dtype), j: int, row: int, column: int) -> real: ...

    return element_at_once


@functools.cache
def make_nearest(precision: str) -> Any:
    """Return the `wp.func` nearest(d, period, half): a distance along a periodic axis, to the nearest image."""
    real = types(2, precision).real

    @wp.func
    def nearest(d: real, period: real, half: real):
        result = d
        if d > half:
            result = d - period
        elif d < -half:
            result = d + period
        return result

    return nearest


@functools.cache
def make_separation(dimension: int, precision: str, periodic: tuple[bool, ...]) -> Any:
    """Return the `wp.func` separation(x_i, x_j, wrapped, params) = x_i - x_j of the nearest images [m]."""
    spec = Spec(dimension=dimension, precision=precision, periodic=periodic)
    real, vec, _, _ = types_of(spec)
    Params = make_params(dimension, precision)
    axes = [axis for axis in range(dimension) if periodic[axis]]
    has_x, has_y, has_z = (axis in axes for axis in range(3))
    any_axis = bool(axes)

    nearest = make_nearest(precision)

    @wp.func
    def separation(xi: vec, xj: vec, wrapped: bool, params: Params):
        d = xi - xj
        if wp.static(any_axis):
            if wrapped:
                if wp.static(has_x):
                    d[0] = nearest(d[0], params.box[0], params.half_box[0])
                if wp.static(has_y):
                    d[1] = nearest(d[1], params.box[1], params.half_box[1])
                if wp.static(has_z):
                    d[2] = nearest(d[2], params.box[2], params.half_box[2])
        return d

    return separation


@functools.cache
def make_way(dimension: int, precision: str, periodic: tuple[bool, ...]) -> Any:
    """Return the `wp.func` way(x_i, x_j, axis, wrapped, params): one component of `separation` [m], of numbers."""
    real, Params = types(dimension, precision).real, make_params(dimension, precision)
    axes = [axis for axis in range(dimension) if periodic[axis]]
    has_x, has_y, has_z = (axis in axes for axis in range(3))

    @wp.func
    def nearest_if(wrapped: bool, d: real, period: real, half: real):
        beyond = wp.where(wrapped, half, real(1.0e30))  # no branch: a loop with one has no vectors
        result = wp.where(d > beyond, d - period, d)
        return wp.where(d < -beyond, d + period, result)

    @wp.func
    def way(x: real, other: real, axis: int, wrapped: bool, params: Params):
        d = x - other
        if wp.static(has_x):
            if axis == 0:
                d = nearest_if(wrapped, d, params.box[0], params.half_box[0])
        if wp.static(has_y):
            if axis == 1:
                d = nearest_if(wrapped, d, params.box[1], params.half_box[1])
        if wp.static(has_z):
            if axis == 2:
                d = nearest_if(wrapped, d, params.box[2], params.half_box[2])
        return d

    return way


def separation_of(spec: Spec) -> Any:
    """Return the separation function of a `Spec`."""
    return make_separation(spec.dimension, spec.precision, spec.periodic)


def way_of(spec: Spec) -> Any:
    """Return the function of one component of a separation of a `Spec`."""
    return make_way(spec.dimension, spec.precision, spec.periodic)


class Access(NamedTuple):
    """How kernels reach the entries of a list in one layout.

    Attributes:
        begin: `wp.func` begin(i, width), place of the first entry of row i.
        step: `wp.func` step(rows), from one place to the next of the same row.
        read: `wp.func` read(list, i, place), the entry of row i at a place.
        array: type of a list as kernel argument.
        write: `wp.func` write(list, i, place, value).
    """

    begin: Any
    step: Any
    read: Any
    array: Any
    write: Any


@functools.cache
def make_entry(row_list: bool, wide: bool = False, dtype: Any = int) -> Access:
    """Return the access to a list of one layout.

    Row: the neighbours of a particle are contiguous (best for a CPU core, measured 5-10 % faster there).
    Column: the k-th neighbours of consecutive particles are contiguous (coalesced reads on a GPU).

    A narrow list is one-dimensional and a place is the index of an entry, which takes 31 bits. A wide list holds more
    entries than that; it has the same order in memory, but two dimensions, and a place counts the entries of its own row:
    Warp indexes each dimension with 32 bits and adds the strides up with 64.
    """
    List = wp.array(dtype=dtype, ndim=2 if wide else 1)
    at = make_at(dtype)

    if wide:

        @wp.func
        def begin(i: int, width: int):
            return 0

        @wp.func
        def step(rows: int):
            return 1

    elif row_list:

        @wp.func
        def begin(i: int, width: int):
            return i * width

        @wp.func
        def step(rows: int):
            return 1

    else:

        @wp.func
        def begin(i: int, width: int):
            return i

        @wp.func
        def step(rows: int):
            return rows

    @wp.func
    def read(entries: List, i: int, place: int):
        if wp.static(not wide):
            return at(entries, place)
        elif wp.static(row_list):
            return entries[i, place]
        else:
            return entries[place, i]

    @wp.func
    def write(entries: List, i: int, place: int, value: dtype):
        if wp.static(not wide):
            entries[place] = value
        elif wp.static(row_list):
            entries[i, place] = value
        else:
            entries[place, i] = value

    return Access(begin, step, read, List, write)


def list_access(spec: Spec) -> tuple[Any, Any, Any, Any]:
    """Return (list_begin, list_step, neighbour, type of `neighbours`) of the neighbour list of a `Spec`."""
    return make_entry(spec.row_list, spec.wide_list)[:4]


@functools.cache
def make_look_ahead(row_list: bool, wide: bool, ahead: bool) -> tuple[Any, Any, Any]:
    """Return the `wp.func`s (look, taken, onward) of a loop over the pairs of a particle.

        ahead = look(neighbours, i, k, end)
        while k < end:
            j = taken(ahead, neighbours, i, k)
            k, ahead = onward(neighbours, i, k, step, end)

    On a GPU the entry of the next pair is read while the present one is worked on, so that a thread waits for one access to
    memory a pair instead of two. Otherwise `ahead` is 0 and each entry is read when it is needed.
    """
    access = make_entry(row_list, wide)
    read, List = access.read, access.array

    @wp.func
    def look(entries: List, i: int, place: int, end: int):
        found = int(0)
        if wp.static(ahead):
            if place < end:
                found = read(entries, i, place)
        return found

    @wp.func
    def taken(found: int, entries: List, i: int, place: int):
        if wp.static(ahead):
            return found
        else:
            return read(entries, i, place)

    @wp.func
    def onward(entries: List, i: int, place: int, step: int, end: int):
        following = place + step
        return following, look(entries, i, following, end)

    return look, taken, onward


def look_ahead(spec: Spec) -> tuple[Any, Any, Any]:
    """Return the loop functions of a `Spec`: they look ahead on a GPU, with several phases.

    With one phase a sweep has few instructions a pair, which other threads cover: there it costs 2 to 9 %
    (docs/speed.md#ahead).
    """
    return make_look_ahead(spec.row_list, spec.wide_list, spec.multiphase and not spec.row_list)
