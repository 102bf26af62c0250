"""Places that are narrower than the smoothing kernel reaches: gaps between fluids, and layers of one fluid among others.

A *gap* is empty space that no one means to be a free surface: somewhere in it, fluid on one side sees fluid on the other.
Rule: pieces of connected empty cells in which no cube of so many rows as the kernel reaches has room, and of whose cells
half or more have fluid at both ends of an empty run that is shorter than that. The space above a tank, around a drop, or
below a roof is none.

A *thin layer* is a piece of connected cells of one phase, beside another phase, in which no such cube has room.

An interface *without an angle* lies between two phases with a tension beside a wall or a body, where no pair has one.

A *low drop* is a piece of one phase that lies against a side of the domain which it meets at a given angle, fewer rows high
than the angle takes to act: it is drawn out to a film (docs/limits.md). What covers the side is a layer; a drop that lies
across a periodic side counts as one too, and is not told.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from warpsph.case.domain import AXES
from warpsph.scene.borders import spread
from warpsph.scene.lattice import Lattice, cell_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case

    Mask = NDArray[np.bool_]

SHARE = 0.5  # of the cells of a gap that lie between fluids; its corners and ends do not
LOW = 6  # rows that a drop on a wall is high at least: with 4 and 5 it becomes a film, with 6 it is 2 % off


def narrow_places(
    case: Case, lattice: Lattice, region: NDArray[np.int32], phases: NDArray[np.int32], solid: Mask | None, support: float
) -> list[str]:
    """Return a line for all gaps, and one for each entry of `fluids` that is thin somewhere.

    region: of each cell of the domain, -1 where it is empty
    phases: of each region, and -1 at the end
    solid: cells of bodies, None without any
    support: reach of the smoothing kernel, m
    """
    rows = math.ceil(support / case.spacing - 1e-9)
    empty = region < 0
    if solid is not None:
        empty &= ~solid
    lines = list(_gaps(case, lattice, region, empty, rows))
    if len(case.phases) > 1:
        lines += _thin_layers(case, lattice, region, phases[region], rows)
        lines += _low_drops(case, lattice, region, phases[region], rows)
    return lines


# gaps -------------------------------------------------------------------------------------------------------


def _gaps(case: Case, lattice: Lattice, region: NDArray[np.int32], empty: Mask, rows: int) -> Iterator[str]:
    """Say how many cells are in gaps, and where the first of them is."""
    between = np.zeros_like(empty)
    for axis in range(empty.ndim) if empty.any() else ():
        between |= _between(region >= 0, empty, axis, rows - 1, case.periodic[axis])
    if not between.any():
        return
    piece = pieces(empty, case.periodic)
    size, inside = np.bincount(piece.ravel()), np.bincount(piece[between], minlength=piece.max() + 1)
    gap = inside >= SHARE * size
    gap[np.unique(piece[roomy(empty, rows, case.periodic)])] = False
    gap[0] = False
    cells = gap[piece]
    if cells.any():
        first = np.argwhere(cells & between)[0]
        yield (
            f"fluids: no region fills {np.count_nonzero(cells)} cells between the fluids, the first at "
            f"{cell_text(lattice.axes(domain_only=True), first)}; such a gap, narrower than the {rows} spacings that the "
            "smoothing kernel reaches, has free surfaces and makes a full domain one with empty space: let the regions "
            "meet, or give the last one the shape rest"
        )


def _between(fluid: Mask, empty: Mask, axis: int, most: int, wraps: bool) -> Mask:
    """Return the cells in runs of at most `most` empty ones along an axis that have fluid at both ends."""
    filled, free = np.moveaxis(fluid, axis, 0), np.moveaxis(empty, axis, 0)
    if not wraps:  # a layer that is neither keeps the ends apart
        neither = np.zeros((1, *filled.shape[1:]), np.bool_)
        filled, free = np.concatenate([filled, neither]), np.concatenate([free, neither])
    found, run = np.zeros_like(free), np.roll(filled, 1, 0)
    for length in range(1, most + 1):
        run = run & np.roll(free, 1 - length, 0)
        ended = run & np.roll(filled, -length, 0)
        for k in range(length):
            found |= np.roll(ended, k, 0)
    return np.moveaxis(found if wraps else found[:-1], 0, axis)


# layers -----------------------------------------------------------------------------------------------------


def _thin_layers(
    case: Case, lattice: Lattice, region: NDArray[np.int32], phase: NDArray[np.int32], rows: int
) -> Iterator[str]:
    """Say which entries of `fluids` have fewer rows than the kernel reaches; a channel of a single fluid may."""
    told: set[int] = set()
    for k, name in enumerate(case.phase_names):
        for cells in _thin_pieces(phase, k, rows, case.periodic):
            first = np.argwhere(cells)[0]
            entry = int(region[tuple(first)])
            if entry in told:
                continue
            told.add(entry)
            most = next(n for n in range(rows - 1, 0, -1) if n == 1 or roomy(cells, n, case.periodic).any())
            yield (
                f"fluids.{entry}.shape: {name} is nowhere more than {most} {'row' if most == 1 else 'rows'} of particles "
                f"thick in the piece at {cell_text(lattice.axes(domain_only=True), first)} ({np.count_nonzero(cells)} "
                f"particles), fewer than the {rows} that the smoothing kernel reaches, so that its two sides are not told "
                f"apart; lower particle_spacing to {case.spacing * most / rows:.2g}, or make it thicker"
            )


def _low_drops(
    case: Case, lattice: Lattice, region: NDArray[np.int32], phase: NDArray[np.int32], rows: int
) -> Iterator[str]:
    """Say which entries of `fluids` lie on a wall at an angle and are too low for it; thin layers are told already."""
    from scipy.ndimage import find_objects

    pairs = [pair.between for pair in case.surface_tension if pair.coefficient > 0 and pair.contact_angle is not None]
    told: set[int] = set()
    for k, name in enumerate(case.phase_names):
        if not any(name in pair for pair in pairs):
            continue
        piece = pieces(phase == k, case.periodic)
        for number, box in enumerate(find_objects(piece), start=1):
            height = LOW if box is None else _height_on_wall(case, box, phase.shape)
            if not rows <= height < LOW:
                continue
            first = np.argwhere(piece[box] == number)[0] + [part.start for part in box]
            entry = int(region[tuple(first)])
            if entry in told:
                continue
            told.add(entry)
            yield (
                f"fluids.{entry}.shape: {name} lies {height} rows of particles high on a wall that it meets at a "
                f"contact_angle, at {cell_text(lattice.axes(domain_only=True), first)}; drops of fewer than {LOW} rows "
                f"are drawn out to films: lower particle_spacing to {case.spacing * height / LOW:.2g}, or make it higher"
            )


def _height_on_wall(case: Case, box: tuple[slice, ...], shape: tuple[int, ...]) -> int:
    """Return the rows that the box of a piece of cells is high on the wall that it touches, LOW where that is no matter.

    Where it reaches from one side of the domain to the other along the wall it is a layer and no drop.
    """
    at_lower = [part.start == 0 for part in box]
    at_upper = [part.stop == cells for part, cells in zip(box, shape, strict=True)]
    height = LOW
    for axis, part in enumerate(box):
        sides = getattr(case.domain.boundary, AXES[axis])
        touched = (at_lower[axis] and sides.lower.kind == "wall") or (at_upper[axis] and sides.upper.kind == "wall")
        covers = any(at_lower[other] and at_upper[other] for other in range(len(box)) if other != axis)
        if touched and not covers:
            height = min(height, part.stop - part.start)
    return height


def _thin_pieces(phase: NDArray[np.int32], k: int, rows: int, periodic: tuple[bool, ...]) -> Iterator[Mask]:
    """Yield the cells of each piece of phase k that is thin and has another phase beside it."""
    own = phase == k
    piece = pieces(own, periodic)
    thin = np.ones(piece.max() + 1, np.bool_)
    thin[np.unique(piece[roomy(own, rows, periodic)])] = False
    thin[0] = False
    if not thin.any():
        return
    beside = thin[piece] & _beside((phase >= 0) & ~own, periodic)
    for number in np.unique(piece[beside]):
        yield piece == number


def _beside(mask: Mask, periodic: tuple[bool, ...]) -> Mask:
    """Return the cells that have one of the mask next to them along an axis."""
    found = np.zeros_like(mask)
    for axis, wraps in enumerate(periodic):
        cells, result = np.moveaxis(mask, axis, 0), np.moveaxis(found, axis, 0)
        result[1:] |= cells[:-1]
        result[:-1] |= cells[1:]
        if wraps:
            result[0] |= cells[-1]
            result[-1] |= cells[0]
    return found


def beside_solid(case: Case, solid: Mask | None, shape: tuple[int, ...]) -> Mask:
    """Return the cells of a domain of that shape next to a body (solid: cells of bodies) or to a wall of the domain."""
    beside = np.zeros(shape, np.bool_) if solid is None else spread(solid, case.periodic, np.logical_or)
    for axis, sides in enumerate(case.sides):
        for side, end in ((sides.lower, 0), (sides.upper, -1)):
            if side.kind == "wall":
                np.moveaxis(beside, axis, 0)[end] = True
    return beside


# pieces -----------------------------------------------------------------------------------------------------


def roomy(mask: Mask, rows: int, periodic: tuple[bool, ...]) -> Mask:
    """Return some cell of each cube of so many rows that lies in the mask as a whole."""
    from scipy.ndimage import minimum_filter

    modes = ["wrap" if wraps else "constant" for wraps in periodic]
    return np.asarray(minimum_filter(mask.view(np.uint8), rows, mode=modes, cval=0)).view(np.bool_)


def pieces(mask: Mask, periodic: tuple[bool, ...]) -> NDArray[np.int32]:
    """Return the number of the piece that each cell belongs to, 0 outside of the mask; corners connect."""
    from scipy.ndimage import generate_binary_structure, label
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    piece, count = label(mask, generate_binary_structure(mask.ndim, mask.ndim))
    ends = [np.moveaxis(piece, axis, 0)[[0, -1]].reshape(2, -1) for axis, wraps in enumerate(periodic) if wraps]
    if not ends:
        return np.asarray(piece, np.int32)
    pairs = np.concatenate(ends, axis=1)
    pairs = np.unique(pairs[:, (pairs > 0).all(axis=0)], axis=1)
    links = coo_matrix((np.ones(pairs.shape[1]), tuple(pairs)), shape=(count + 1, count + 1))
    return np.asarray(connected_components(links, directed=False)[1], np.int32)[piece]
