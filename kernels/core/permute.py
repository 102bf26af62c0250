"""All kept fields put in the order of the cells by two launches, whatever their number and their types.

The fields are columns of a table, known by address and size. A small scene would spend more time on launching a kernel for
each field than on moving its few kilobytes. A thread takes a run of particles through one column after the other: a run is
a single particle on a GPU, where neighbours in a column are moved by neighbouring threads.
"""

import functools
from collections.abc import Sequence
from typing import Any

import warp as wp

RUN = {True: 64, False: 1}  # particles of a run, on a CPU and on a GPU
BUFFER = 2**25  # bytes of copies that are made at once; more fields than fit are sorted in several rounds
ALIGNED = 16  # bytes that the start of each copy is a multiple of


@wp.struct
class Column:
    """A field that is moved.

    Attributes:
        field, sorted: addresses of its array, and of the copy in the new order.
        size: bytes of an element, 1, 2 or a multiple of 4.
        base: first row of its particles among all particles: 0, or the room for fluid where the field is one of walls.
        rows: elements.
    """

    field: wp.uint64
    sorted: wp.uint64
    size: int
    base: int
    rows: int


def column(array: Any, place: int, base: int) -> Any:
    """Return the row of the table for an array of a field, whose sorted copy is at the address `place`.

    Raises:
        ValueError: elements of a size that the kernel does not move.
    """
    row = Column()
    row.field, row.sorted = array.ptr, place
    row.size = wp.types.type_size_in_bytes(array.dtype)
    if row.size not in (1, 2) and row.size % 4:
        raise ValueError(f"elements of {row.size} bytes, {array.dtype}, are not sorted: needs 1, 2 or a multiple of 4")
    row.base, row.rows = base, array.shape[0]
    return row


@functools.cache
def make_move(dtype: Any, gathers: bool) -> Any:
    """Return the `wp.func` that moves the elements begin to end of a column, as elements of a type of the same size.

    gathers: sorted[t] = field[order[base + t] - base]; else field[t] = sorted[t].
    """

    @wp.func
    def move(column: Column, begin: int, end: int, sort_order: wp.array(dtype=int)):
        field = wp.array(ptr=column.field, shape=(column.rows,), dtype=dtype)
        copy = wp.array(ptr=column.sorted, shape=(column.rows,), dtype=dtype)
        t = int(begin)
        while t < end:
            if wp.static(gathers):
                copy[t] = field[sort_order[column.base + t] - column.base]
            else:
                field[t] = copy[t]
            t += 1

    return move


@functools.cache
def make_move_words(gathers: bool) -> Any:
    """Return the same `wp.func` for elements of any multiple of 4 bytes, word by word."""

    @wp.func
    def move_words(column: Column, begin: int, end: int, sort_order: wp.array(dtype=int)):
        size, words = wp.uint64(column.size), column.size / 4
        t = int(begin)
        while t < end:
            row = int(t)
            if wp.static(gathers):
                row = sort_order[column.base + t] - column.base
            field = wp.array(ptr=column.field + wp.uint64(row) * size, shape=(words,), dtype=int)
            copy = wp.array(ptr=column.sorted + wp.uint64(t) * size, shape=(words,), dtype=int)
            for k in range(words):
                if wp.static(gathers):
                    copy[k] = field[k]
                else:
                    field[k] = copy[k]
            t += 1

    return move_words


@functools.cache
def make_permute(gathers: bool) -> Any:
    """Return the kernel over runs of `run` particles that sorts all columns (`gathers`) or puts the sorted copies back."""
    words = [wp.types.vector(length=length, dtype=int) for length in (2, 3, 4)]
    types = (wp.uint8, wp.int16, int, *words)
    move1, move2, move4, move8, move12, move16 = (make_move(dtype, gathers) for dtype in types)
    move_words = make_move_words(gathers)

    @wp.kernel(module="unique", enable_backward=False)
    def permute(first: int, run: int, columns: wp.array(dtype=Column), sort_order: wp.array(dtype=int)):
        begin = (wp.tid() + first) * run
        for k in range(columns.shape[0]):
            column = columns[k]
            end = wp.min(begin + run, column.rows)
            if column.size == 4:
                move4(column, begin, end, sort_order)
            elif column.size == 8:
                move8(column, begin, end, sort_order)
            elif column.size == 1:
                move1(column, begin, end, sort_order)
            elif column.size == 2:
                move2(column, begin, end, sort_order)
            elif column.size == 12:
                move12(column, begin, end, sort_order)
            elif column.size == 16:
                move16(column, begin, end, sort_order)
            else:
                move_words(column, begin, end, sort_order)

    return permute


def rounds(sizes: Sequence[int], most: int = BUFFER) -> list[list[int]]:
    """Return the numbers of the fields that are sorted at once, round by round, for copies of so many bytes.

    Args:
        sizes: of the copies [B], each with what is left up to the next multiple of `ALIGNED`.
        most: bytes of a round; a larger field has one of its own.
    """
    result: list[list[int]] = []
    filled = 0
    for number, size in enumerate(sizes):
        if not result or filled + size > most:
            result.append([])
            filled = 0
        result[-1].append(number)
        filled += size
    return result


def aligned(size: int) -> int:
    """Return the next multiple of `ALIGNED` bytes."""
    return (size + ALIGNED - 1) // ALIGNED * ALIGNED


def room(sizes: Sequence[int]) -> int:
    """Return the bytes that the copies of the largest round take."""
    return max((sum(sizes[k] for k in numbers) for numbers in rounds(sizes)), default=0)
