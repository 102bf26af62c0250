"""Where the stations of a plane body are along its outline (theory: bodies#arc).

The outline runs anticlockwise, round holes clockwise, from its point that is farthest along +x, of several the lowest: of
a circle the angle 0, of an airfoil at small angles the trailing edge. What is not in the domain counts nothing, and a line
that is cut begins where it comes in. Each closed line goes on with the length of those before it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from warpsph.scene.surfaces import Surface

PIECES = 16
"""Pieces of the outline a spacing; a station is put on the tangent of its piece."""
CLOSED = 1e-4
"""Spacings before the end of a closed line from which on a station is at its beginning."""
SIDE = 0.25
"""Spacings by which two sides of an edge without thickness are told apart, along their normals."""


def arc_lengths(
    surface: Surface,
    foot: NDArray[np.float64],
    normal: NDArray[np.float64],
    spacing: float,
    lower: Sequence[float],
    upper: Sequence[float],
) -> NDArray[np.float64]:
    """Return how far along the outline of a plane body each of some points of it is (n,), m.

    Args:
        surface: of the body.
        foot, normal: (n, 2), the points, m, and the unit normals into the fluid there.
        spacing: particle spacing, m.
        lower, upper: corners of the domain, m.
    """
    from scipy.spatial import cKDTree

    middle, outward, size = surface.patches(spacing / PIECES)
    held = np.all((middle >= lower) & (middle <= upper), axis=1)
    begin = middle - 0.5 * size[:, None] * tangents(outward, surface.hollow)
    along, end, round_trip = np.zeros((3, len(middle)))
    begun = 0.0
    for line in _lines(middle, size):
        line = np.roll(line, -_first(begin[line], size[line], held[line]))
        counted = np.where(held[line], size[line], 0.0)
        along[line] = begun + np.cumsum(counted) - 0.5 * counted
        begun += counted.sum()
        end[line], round_trip[line] = begun, counted.sum() if held[line].all() else 0.0
    middle, outward, along, end, round_trip = (column[held] for column in (middle, outward, along, end, round_trip))
    reach = SIDE * spacing
    piece = cKDTree(np.hstack([middle, reach * outward])).query(np.hstack([foot, reach * normal]))[1]
    way = np.einsum("ij,ij->i", foot - middle[piece], tangents(outward[piece], surface.hollow))
    arc = along[piece] + way
    # the end of a closed line is its beginning
    return np.where(arc > end[piece] - CLOSED * spacing, arc - round_trip[piece], arc)


def tangents(normal: NDArray[np.float64], hollow: bool) -> NDArray[np.float64]:
    """Return the unit tangents (n, 2) in the sense of the outline, from the normals (n, 2) into the fluid."""
    turned = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    return -turned if hollow else turned


def _lines(middle: NDArray[np.float64], size: NDArray[np.float64]) -> list[NDArray[np.intp]]:
    """Return the pieces of each closed line, in order: pieces that do not touch the one before begin another."""
    gap = np.linalg.norm(middle[1:] - middle[:-1], axis=1) > 0.501 * (size[1:] + size[:-1])
    return np.split(np.arange(len(middle)), np.flatnonzero(gap) + 1)


def _first(begin: NDArray[np.float64], size: NDArray[np.float64], held: NDArray[np.bool_]) -> int:
    """Return which piece of a closed line is its first: after a part that does not count, or from the farthest point on."""
    if held.all():
        farthest = np.flatnonzero(begin[:, 0] > begin[:, 0].max() - 1e-6 * size.max())
        return int(farthest[np.argmin(begin[farthest, 1])])
    comes_in = held & ~np.roll(held, 1)
    return int(np.argmax(comes_in)) if comes_in.any() else 0
