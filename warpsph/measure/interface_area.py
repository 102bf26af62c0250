"""Lengths (3-D: areas) of the interfaces between phases, from the places of the particles.

The volume of each phase is spread over the nodes of a grid, one in the middle of each cell of a particle spacing: to the
2^d nodes around a particle in proportion to how near they are, then twice with the weights 1/4, 1/2, 1/4 along each axis.
That is all but a Gaussian of 1.1 spacings. The share c_a of a phase at a node is its volume there over that of all fluid,
and

    L_ab = integral of |c_a grad c_b - c_b grad c_a|

is the length of the interface between a and b. Where there are but two phases the integrand is |grad c|, whose integral is
the mean length of all lines c = const: no line is special, so the measure changes smoothly while particles move. Circles of
10 to 25 spacings radius come out within 1.3 % whatever the arrangement, within 0.1 % of the length of the line of the gauge
`contour` and ten times as fast; a sphere of 5 spacings within 5 %, one of 10 within 1.5 %. The sum of the particles' own
|grad C| V, for comparison, drifts by 3 to 6 % as they leave their lattice.

Near walls c is a share of the fluid that is there, and the line goes on straight to the wall; nodes of which less than half
the surroundings is fluid, in bodies or beyond a free surface, do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product

import numpy as np

_PASSES = 2
"""How often the grid is smoothed."""

_FILLED = 0.5
"""Least part of a node's surroundings that is fluid where it counts."""


def interface_areas(
    position: np.ndarray,
    volume: np.ndarray,
    phase: np.ndarray,
    count: int,
    lower: Sequence[float] | np.ndarray,
    upper: Sequence[float] | np.ndarray,
    periodic: Sequence[bool],
    spacing: float,
) -> dict[tuple[int, int], float]:
    """Length (3-D: area) of the interface of each pair of phases, m (m^2); nan if a place is not finite.

    position: (n, d) of all particles, m
    volume: (n,) their volumes, m^d
    phase: (n,) int, index of the phase, -1 for walls, which take no part
    count: number of phases
    lower, upper, periodic: of the domain, an entry an axis, m
    spacing: particle spacing, m
    """
    pairs = list(combinations(range(count), 2))
    fluid = phase >= 0
    position, volume, phase = position[fluid], volume[fluid], phase[fluid]
    if not (np.isfinite(position).all() and np.isfinite(volume).all()):
        return dict.fromkeys(pairs, np.nan)
    low, extent = np.asarray(lower, np.float64), np.subtract(upper, lower)
    cells = np.maximum(np.rint(extent / spacing).astype(np.int64), 1)
    step = extent / cells
    shares = _spread(position, volume, phase, count, low, step, cells, periodic)
    total = shares.sum(axis=0)
    filled = total >= _FILLED
    shares = np.divide(shares, total, out=np.zeros_like(shares), where=total > 0.0)
    slopes = [_slope(shares, axis + 1, periodic[axis]) / step[axis] for axis in range(len(cells))]
    areas = {}
    for a, b in pairs:
        square = sum((shares[a] * slope[b] - shares[b] * slope[a]) ** 2 for slope in slopes)
        areas[a, b] = float(np.sqrt(square)[filled].sum() * step.prod())
    return areas


def _spread(
    position: np.ndarray,
    volume: np.ndarray,
    phase: np.ndarray,
    count: int,
    low: np.ndarray,
    step: np.ndarray,
    cells: np.ndarray,
    periodic: Sequence[bool],
) -> np.ndarray:
    """Part of each node's cell that each phase fills, smoothed, (count, *cells)."""
    place = (position - low) / step - 0.5
    base = np.floor(place).astype(np.int64)
    beyond = place - base
    size = count * int(cells.prod())
    found = np.zeros(size)
    for corner in product((0, 1), repeat=len(cells)):
        node = base + corner
        # A particle beside a wall gives all of its volume to the last nodes.
        node = np.where(periodic, node % cells, np.clip(node, 0, cells - 1))
        weight = volume * np.where(corner, beyond, 1.0 - beyond).prod(axis=1)
        flat = phase * int(cells.prod()) + np.ravel_multi_index(tuple(node.T), tuple(cells))
        found += np.bincount(flat, weight, minlength=size)
    shares = found.reshape(count, *cells) / step.prod()
    for axis, wraps in enumerate(periodic):
        for _ in range(_PASSES):
            before, after = _neighbours(shares, axis + 1, wraps, edge=0.0)
            shares = 0.5 * shares + 0.25 * (before + after)
    return np.asarray(shares)


def _slope(values: np.ndarray, axis: int, wraps: bool) -> np.ndarray:
    """Central differences along an axis, one-sided at its ends if it does not wrap; per node."""
    if wraps:
        before, after = _neighbours(values, axis, wraps)
        return np.asarray(0.5 * (after - before))
    return np.asarray(np.gradient(values, axis=axis)) if values.shape[axis] > 1 else np.zeros_like(values)


def _neighbours(values: np.ndarray, axis: int, wraps: bool, edge: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """The values of the nodes before and after along an axis; `edge` beyond an end that does not wrap."""
    before, after = np.roll(values, 1, axis=axis), np.roll(values, -1, axis=axis)
    if not wraps:
        np.moveaxis(before, axis, 0)[0] = edge
        np.moveaxis(after, axis, 0)[-1] = edge
    return before, after
