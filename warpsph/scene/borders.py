"""Where the fluids of a scene meet: points and normals on the interfaces, the exact volume of each region.

A region is known as a rule that says for any point which entry of `fluids` holds it; nothing else is asked of a shape, so
boxes, spheres, polygons, conditions and `rest` are all treated alike, in two and three dimensions.

*Interface points*: on a grid finer than the lattice, each edge whose ends lie in different phases is bisected to where
the phase changes. *Normals*: the interface is met again at a small distance to both sides along its tangents, and the
central difference of these heights is its slope (one-sided where the interface ends at a wall).
*Volumes*: the lattice cells that a border cuts are sampled with a low-discrepancy sequence, all others count as a whole.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.scene.lattice import Lattice

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Interface", "Regions", "Volumes", "find_interface", "fluid_pairs_off_lattice", "spread", "volumes"]

VOID = -1

_FINER = {2: 4, 3: 3}
"""Grid points in a lattice cell along each axis, by dimension."""

_BISECTIONS = 18
"""Halvings of an edge: the place is known to 1e-6 of the spacing, what a border is worth anyway."""

_TANGENT = 0.3
"""Distance, in spacings, at which the interface is met again for its slope."""

_OFF = 0.02
"""An interface nearer than this to the faces of lattice cells, in spacings, counts as represented by them."""

_SAMPLES = (64, 1 << 14)
"""Least and most samples of a cell that a border cuts; between them as many as make one batch of all such cells. The errors
of many cells cancel."""

_BATCH = 1 << 20
"""Points tested at a time."""

_BINS = 16
"""Bins of a cell in the profiles of volumes: the mean over a bin is known to 1e-4 of its share."""


@dataclass(eq=False)
class Regions:
    """What fills the domain; E entries in `fluids`, d dimensions.

    lattice: the cells
    periodic: of each axis
    entry: which entry holds the middle of each cell, VOID where none does; shape `lattice.count`
    phase_of_entry: (E + 1,) phase of each entry; the last one, VOID, is what VOID finds
    entry_at: the entry that holds each of the points (n, d), VOID for none and in bodies
    covered: cells whose middle is in a body, of the same shape as `entry`, or None; `entry` is VOID there
    boundary: (m, d), boundary particles of the bodies, m
    """

    lattice: Lattice
    periodic: tuple[bool, ...]
    entry: NDArray[np.int32]
    phase_of_entry: NDArray[np.int32]
    entry_at: Callable[[NDArray[np.float64]], NDArray[np.int32]]
    covered: NDArray[np.bool_] | None = None
    boundary: NDArray[np.float64] | None = None

    @property
    def unit(self) -> float:
        """Mean particle spacing, m."""
        return float(self.lattice.cell_volume ** (1.0 / self.lattice.dimension))

    def entries(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        """Entry at any points (..., d); beyond a side that is not periodic, that of the nearest point of the domain."""
        flat = points.reshape(-1, points.shape[-1]).copy()
        for k, wraps in enumerate(self.periodic):
            low, high = self.lattice.lower[k], self.lattice.upper[k]
            if wraps:
                flat[:, k] = low + np.mod(flat[:, k] - low, high - low)
            else:
                # Just inside: a box that ends with the domain does not hold its own upper face.
                edge = 1e-4 * self.lattice.spacing[k]
                np.clip(flat[:, k], low + edge, high - edge, out=flat[:, k])
        found = [self.entry_at(flat[start : start + _BATCH]) for start in range(0, len(flat), _BATCH)]
        result = np.concatenate(found) if found else np.empty(0, dtype=np.int32)
        return result.reshape(points.shape[:-1])

    def phases(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        """Phase at any points (..., d), VOID where there is none; beyond the domain as `entries`."""
        return self.phase_of_entry[self.entries(points)]

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which points (..., d) are in the domain; a periodic axis has no end."""
        inside = np.ones(points.shape[:-1], dtype=np.bool_)
        for k, wraps in enumerate(self.periodic):
            if not wraps:
                inside &= (points[..., k] > self.lattice.lower[k]) & (points[..., k] < self.lattice.upper[k])
        return inside


# ------------------------------------------------------------------------------------------------------------
# lattice cells at a border


def spread(
    values: NDArray[Any], periodic: tuple[bool, ...], combine: Callable[..., NDArray[Any]], times: int = 1
) -> NDArray[Any]:
    """Combine each cell with its neighbours, diagonal ones too, `times` times: np.maximum, np.minimum, np.logical_or."""
    for _ in range(times):
        for axis, wraps in enumerate(periodic):
            n = values.shape[axis]
            before = [slice(None)] * values.ndim
            after = list(before)
            before[axis], after[axis] = slice(0, n - 1), slice(1, n)
            result = values.copy()
            result[tuple(after)] = combine(result[tuple(after)], values[tuple(before)])
            result[tuple(before)] = combine(result[tuple(before)], values[tuple(after)])
            if wraps:
                first, last = list(before), list(before)
                first[axis], last[axis] = slice(0, 1), slice(n - 1, n)
                result[tuple(first)] = combine(result[tuple(first)], values[tuple(last)])
                result[tuple(last)] = combine(result[tuple(last)], values[tuple(first)])
            values = result
    return values


def _at_border(regions: Regions, ids: NDArray[np.int32], void: bool) -> NDArray[np.bool_]:
    """Cells that have two different ids among themselves and their neighbours.

    void: whether empty cells count as an id of their own.
    """
    left_out = np.zeros(ids.shape, dtype=np.bool_) if void else ids == VOID
    largest = spread(np.where(left_out, VOID - 1, ids), regions.periodic, np.maximum)
    smallest = spread(np.where(left_out, np.iinfo(np.int32).max, ids), regions.periodic, np.minimum)
    return (largest > smallest) & ~left_out


def _grid(offsets: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
    """All combinations (k, d) of the offsets along each axis."""
    return np.array(list(itertools.product(offsets, repeat=dimension)))


def _batches(cells: NDArray[np.intp], samples: int) -> Iterator[NDArray[np.intp]]:
    """The rows of `cells`, so many at a time that `samples` points of each make a batch."""
    size = max(1, _BATCH // samples)
    for start in range(0, len(cells), size):
        yield cells[start : start + size]


def _points(regions: Regions, cells: NDArray[np.intp], offsets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (c, k, d) at offsets (k, d) or (c, k, d) from the lower corners of cells (c, d), in cells."""
    lattice = regions.lattice
    return np.array(lattice.lower) + (cells[:, None, :] + offsets) * np.array(lattice.spacing)


def fluid_pairs_off_lattice(regions: Regions) -> set[tuple[int, int]]:
    """Pairs of phases with an interface that does not lie between lattice cells (by more than 2 % of the spacing).

    Returns (lower, higher) phase indices.
    """
    phase = regions.phase_of_entry[regions.entry]
    cells = np.argwhere(_at_border(regions, phase, void=False))
    offsets = _grid(np.array([_OFF, 0.5, 1.0 - _OFF]), phase.ndim)
    found: set[tuple[int, int]] = set()
    for part in _batches(cells, len(offsets)):
        ids = regions.phases(_points(regions, part, offsets))
        own = np.broadcast_to(phase[tuple(part.T)][:, None], ids.shape)
        other = (ids != own) & (ids != VOID)
        pairs = np.unique(np.sort(np.stack([own[other], ids[other]], axis=1), axis=1), axis=0)
        found |= {(int(a), int(b)) for a, b in pairs}
    return found


# ------------------------------------------------------------------------------------------------------------
# interfaces


@dataclass(eq=False)
class Interface:
    """Points on the interfaces between phases, and on the borders of the fluid to empty space; m points.

    point: (m, d), m
    normal: (m, d), unit vectors out of the phase `below`
    below, above: (m,) int32, the phases on both sides, VOID for empty space
    """

    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    below: NDArray[np.int32]
    above: NDArray[np.int32]


def find_interface(regions: Regions) -> Interface:
    """Points on all interfaces, about four a spacing, to 1e-6 of the spacing; see the head of this file.

    Interfaces of a film so thin that no lattice cell has its middle in it are not found; a thicker one may be missed
    where it is thinner than a grid step, a quarter (3-D: a third) of the spacing.
    """
    d = regions.lattice.dimension
    finer = _FINER[d]
    phase = regions.phase_of_entry[regions.entry]
    near = spread(_at_border(regions, phase, void=True), regions.periodic, np.logical_or)
    steps = (np.arange(finer + 1) + 0.5) / finer
    offsets = _grid(steps, d)
    low_ends, high_ends = [], []
    for part in _batches(np.argwhere(near), len(offsets)):
        points = _points(regions, part, offsets)
        shape = (len(part), *(finer + 1,) * d)
        ids = regions.phases(points).reshape(shape)
        points = points.reshape(*shape, d)
        for axis in range(1, d + 1):
            first = [slice(None), *(slice(0, finer),) * d]
            second = list(first)
            second[axis] = slice(1, finer + 1)
            a, b = tuple(first), tuple(second)
            crossed = ids[a] != ids[b]
            low_ends.append(points[a][crossed])
            high_ends.append(points[b][crossed])
    low = np.concatenate(low_ends) if low_ends else np.empty((0, d))
    high = np.concatenate(high_ends) if high_ends else np.empty((0, d))
    below = regions.phases(low)
    point, above = _bisect(regions, low, high, below)
    return Interface(point, _normals(regions, point, below), below, above)


def _bisect(
    regions: Regions, low: NDArray[np.float64], high: NDArray[np.float64], below: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Where each edge from `low` (in phase `below`) to `high` (in another) leaves that phase, and the phase after it."""
    low, high = low.copy(), high.copy()
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        same = (regions.phases(middle) == below)[:, None]
        np.copyto(low, middle, where=same)
        np.copyto(high, middle, where=~same)
    return 0.5 * (low + high), regions.phases(high)


def _normals(regions: Regions, point: NDArray[np.float64], below: NDArray[np.int32]) -> NDArray[np.float64]:
    """Unit normals (m, d) out of the phase `below`, of an interface through `point` (m, d)."""
    d = point.shape[1]
    reach = _TANGENT * regions.unit
    if d == 2:
        angle = (np.arange(16) + 0.5) * (2.0 * math.pi / 16)
        around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        around = _grid(np.array([-1.0, 0.0, 1.0]), d)
        around = around[np.any(around != 0, axis=1)]
        around /= np.linalg.norm(around, axis=1)[:, None]
    # first guess: away from those points of a circle around that lie in the same phase
    same = np.empty((len(point), len(around)), dtype=np.bool_)
    for start in range(0, len(point), _BATCH // len(around)):
        part = slice(start, start + _BATCH // len(around))
        same[part] = regions.phases(point[part, None, :] + reach * around) == below[part, None]
    guess = -(same.astype(np.float64) @ around)
    length = np.linalg.norm(guess, axis=1)
    lost = length < 1e-6  # as many to all sides: a film; any direction is as good
    guess[lost], length[lost] = np.eye(d)[0], 1.0
    guess /= length[:, None]

    normal = guess.copy()
    for tangent in _tangents(guess):
        heights, met = [], []
        for side in (-1.0, 1.0):
            foot = point + side * reach * tangent
            low, high = foot - reach * guess, foot + reach * guess
            good = (regions.phases(low) == below) & (regions.phases(high) != below)
            good &= regions.holds(low) & regions.holds(high)
            place, _ = _bisect(regions, low, high, below)
            heights.append(np.where(good, side * np.einsum("ij,ij->i", place - foot, guess), 0.0))
            met.append(good)
        slope = (heights[0] + heights[1]) / (np.maximum(met[0].astype(int) + met[1], 1) * reach)
        normal -= slope[:, None] * tangent
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def _tangents(normal: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """One (2-D) or two (3-D) unit vectors (m, d) at right angles to each normal."""
    if normal.shape[1] == 2:
        return [np.stack([-normal[:, 1], normal[:, 0]], axis=1)]
    helper = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    one = np.cross(normal, helper)
    one /= np.linalg.norm(one, axis=1)[:, None]
    return [one, np.cross(normal, one)]


# ------------------------------------------------------------------------------------------------------------
# volumes


@dataclass(eq=False)
class Volumes:
    """How much of the domain each entry of `fluids` fills; entries of one phase that touch count as one region.

    factor: (E,) volume of each entry over that of the lattice cells whose middle it holds, the same for a whole region
    region: (E,) the region of each entry: the first of its entries
    profiles: for each axis (E, bins) the volume of each region along it, in cells; bins of equal width
    """

    factor: NDArray[np.float64]
    region: NDArray[np.intp]
    profiles: list[NDArray[np.float64]]


def volumes(regions: Regions) -> Volumes:
    """The volume of each region of the domain, to about 1e-4, and where it is along each axis.

    The sum over all cells of a filled domain is its volume.
    """
    entries = len(regions.phase_of_entry) - 1
    entry, d = regions.entry, regions.entry.ndim
    cells = _cut_cells(regions)
    whole = np.ones(entry.shape, dtype=np.bool_)
    whole[tuple(cells.T)] = False
    # VOID has the first row
    profiles = [np.zeros((entries + 1, n * _BINS)) for n in entry.shape]
    for axis, amounts in enumerate(profiles):
        rows = np.moveaxis(np.where(whole, entry + 1, -1), axis, 0).reshape(entry.shape[axis], -1)
        for place, row in enumerate(rows):
            found = np.bincount(row[row >= 0], minlength=entries + 1)
            amounts[:, place * _BINS : (place + 1) * _BINS] = found[:, None] / _BINS
    # R-sequence: multiples of the powers of 1/g modulo 1, g^(d+1) = g + 1, shifted at random in each cell, so that no border
    # meets the samples of all cells in the same way
    g = {2: 1.32471795724474602596, 3: 1.22074408460575947536}[d]
    samples = min(max(_SAMPLES[0], _BATCH // max(len(cells), 1)), _SAMPLES[1])
    sequence = np.arange(samples)[:, None] * g ** -np.arange(1.0, d + 1)
    random = np.random.default_rng(0)
    for part in _batches(cells, samples):
        offsets = np.mod(sequence + random.uniform(size=(len(part), 1, d)), 1.0)
        ids = regions.entries(_points(regions, part, offsets)) + 1
        for axis, amounts in enumerate(profiles):
            bins = np.minimum((part[:, None, axis] + offsets[..., axis]) * _BINS, amounts.shape[1] - 1).astype(np.intp)
            key = ids * amounts.shape[1] + bins
            amounts += np.bincount(key.ravel(), minlength=amounts.size).reshape(amounts.shape) / samples
    volume = profiles[0].sum(axis=1)[1:]
    count = np.bincount(entry.ravel() + 1, minlength=entries + 1).astype(np.float64)
    region = _touching(regions)
    volume_of = np.bincount(region, weights=volume, minlength=entries)
    count_of = np.bincount(region, weights=count[1:], minlength=entries)
    gathered = []
    for amounts in profiles:
        total = np.zeros((entries, amounts.shape[1]))
        np.add.at(total, region, amounts[1:])
        gathered.append(total)
    return Volumes((volume_of / np.maximum(count_of, 1.0))[region], region, gathered)


def _cut_cells(regions: Regions) -> NDArray[np.intp]:
    """The cells (c, d) that the border of an entry runs through."""
    d = regions.entry.ndim
    cells = np.argwhere(_at_border(regions, regions.entry, void=True))
    corners = _grid(np.array([1e-4, 0.5, 1.0 - 1e-4]), d)
    cut = [np.empty((0, d), dtype=np.intp)]
    for part in _batches(cells, len(corners)):
        ids = regions.entries(_points(regions, part, corners))
        cut.append(part[np.any(ids != ids[:, :1], axis=1)])
    return np.concatenate(cut)


def _touching(regions: Regions) -> NDArray[np.intp]:
    """For each entry the first of those of its phase that it touches, directly or through others."""
    entry, phase = regions.entry, regions.phase_of_entry
    group = np.arange(len(phase) - 1)
    neighbours = set()
    for axis, wraps in enumerate(regions.periodic):
        rows = np.moveaxis(entry, axis, 0)
        pairs = [(rows[:-1], rows[1:])] + ([(rows[-1:], rows[:1])] if wraps else [])
        for one, other in pairs:
            differ = one != other
            neighbours |= {(int(a), int(b)) for a, b in np.unique(np.stack([one[differ], other[differ]], axis=1), axis=0)}
    for a, b in neighbours:
        if a != VOID and b != VOID and phase[a] == phase[b]:
            group[group == max(group[a], group[b])] = min(group[a], group[b])
    return group
