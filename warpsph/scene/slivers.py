"""Slivers: empty cells that no one means, which rounding leaves between a fluid and the bodies or walls beside it.

Two shapes that meet in a curve are seen by the middles of cells, and a middle that lies on the curve, or between two shapes
that nearly meet, is in neither. Without a particle such a cell makes a free surface in a domain that is full, with another
gradient, another friction and no shift (docs/limits.md). They are given to the fluid beside them.

Rule: a piece of connected empty cells beside a body or a wall is a sliver if it is shorter along every axis than the
smoothing kernel reaches, so that no surface could be told in it, or if empty space takes less than half of its cells, so
that no particle had room in it. What reaches across the domain is none by its size: a tank that is full but for one row
has a free surface.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.borders import VOID
from warpsph.scene.lattice import Lattice, cell_text, points_of
from warpsph.scene.narrow import beside_solid, pieces, roomy

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.scene.fluid_regions import EntryAt

    Mask = NDArray[np.bool_]
    Entries = NDArray[np.int32]
    EntryOfPoints = Callable[[NDArray[np.float64]], Entries]

SHARE = 0.5  # of the cells of a piece that is empty space, below which no particle had room in it
_PARTS = {1: 64, 2: 8, 3: 4}  # points along each axis of a cell at which it is asked what is there, by dimension


class Slivers:
    """The slivers of a scene.

    cells: which cells of the domain they are
    region: of each cell of the domain, with those of the slivers
    owner: region that a point of each cell belongs to which is in no region and no body, VOID for empty space
    """

    def __init__(self, case: Case, cells: Mask, region: Entries, solid: Mask | None) -> None:
        self.case = case
        self.cells = cells
        self.region = region
        self.owner = np.full_like(region, VOID)
        if not cells.any():
            return
        beside = _nearest_entry(region)
        self.region = np.where(cells, beside, region)
        full = not ((self.region == VOID) & (~solid if solid is not None else True)).any()
        self.owner = beside if full else np.where(cells, beside, VOID)

    def lines(self, lattice: Lattice) -> list[str]:
        """Return what to tell the user."""
        count = np.count_nonzero(self.cells)
        if not count:
            return []
        first = np.argwhere(self.cells)[0]
        number = int(self.region[tuple(first)])
        cells = "1 cell" if count == 1 else f"{count} cells"
        return [
            f"fluids.{number}.shape: {cells} beside bodies or walls, the first at "
            f"{cell_text(lattice.axes(domain_only=True), first)}, {'is' if count == 1 else 'are'} in no region but too "
            "small for a free surface, and filled with the fluid beside; let the region go on into the body, or give it the "
            "shape rest"
        ]

    def filled(self, entry_at: EntryAt, lattice: Lattice) -> EntryOfPoints:
        """Return the rule that says which entry holds points, with what the slivers are given."""
        if not self.cells.any():
            return entry_at

        def found(points: NDArray[np.float64]) -> Entries:
            entry = entry_at(points)
            loose = np.flatnonzero(entry == VOID)
            cell = np.floor((points[loose] - lattice.lower) / lattice.spacing).astype(np.int64)
            owner = self.owner[tuple(np.clip(cell, 0, np.array(lattice.count) - 1).T)]
            entry[loose] = np.where(entry_at.in_bodies(points[loose]), VOID, owner)
            return entry

        return found


def find_slivers(
    case: Case, lattice: Lattice, region: Entries, solid: Mask | None, support: float, entry_at: EntryAt
) -> Slivers:
    """Return the slivers of a scene.

    Args:
        case: validated case.
        lattice: the cells.
        region: of each cell of the domain, VOID where it is empty.
        solid: cells of bodies, None without any.
        support: reach of the smoothing kernel, m.
        entry_at: which region holds points (n, d), VOID for none and in bodies.
    """
    empty = (region == VOID) & (~solid if solid is not None else True)
    cells = np.zeros_like(empty)
    if empty.any() and not empty.all():
        from scipy.ndimage import find_objects

        piece = pieces(empty, case.periodic)
        boxes, wide = find_objects(piece), _wide(piece, empty, case.periodic)
        rows = math.ceil(support / case.spacing - 1e-9)
        for number in np.unique(piece[beside_solid(case, solid, empty.shape) & empty]):
            if wide[number]:
                continue
            box = boxes[number - 1]
            own = np.argwhere(piece[box] == number) + [part.start for part in box]
            if _is_short(own, rows, empty.shape) or _empty_share(lattice, own, entry_at) < SHARE:
                cells[tuple(own.T)] = True
    return Slivers(case, cells, region, solid)


def _wide(piece: NDArray[np.int32], empty: Mask, periodic: tuple[bool, ...]) -> Mask:
    """Return which pieces hold a cube of three rows: they are no slivers, and need no closer look; and 0, which is none."""
    wide = np.zeros(piece.max() + 1, np.bool_)
    wide[np.unique(piece[roomy(empty, 3, periodic)])] = True
    wide[0] = True
    return wide


def _is_short(own: NDArray[np.intp], rows: int, count: tuple[int, ...]) -> bool:
    """Return whether cells (n, d) reach less far along every axis than the kernel, and not from side to side of the domain.

    count: cells of the domain along each axis; on a line every row reaches from side to side.
    """
    lengths = np.ptp(own, axis=0) + 1
    return len(count) > 1 and bool((lengths < rows).all() and (lengths < count).all())


def _empty_share(lattice: Lattice, own: NDArray[np.intp], entry_at: EntryAt) -> float:
    """Return how much of some cells (n, d) is empty space, neither in a region nor in a body."""
    d = lattice.dimension
    middle = points_of(lattice.axes(domain_only=True), tuple(own.T))
    parts, empty = _PARTS[d], 0.0
    for offset in itertools.product(*[(np.arange(parts) + 0.5) / parts - 0.5] * d):
        points = middle + np.array(offset) * lattice.spacing
        empty += float(np.count_nonzero((entry_at(points) == VOID) & ~entry_at.in_bodies(points)))
    return empty / (len(middle) * parts**d)


def _nearest_entry(region: Entries) -> Entries:
    """Return the region of the nearest cell that has one, of each cell of the domain."""
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(region == VOID, return_distances=False, return_indices=True)
    return np.asarray(region[tuple(nearest)])
