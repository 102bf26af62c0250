"""Which cells or points lie in a shape.

Cells are tested as axes, not as points: a shape gets one coordinate array an axis and returns the mask of the
whole lattice, so that a box costs next to nothing and ten million sites need no ten million temporary points.

A site exactly on the border of a region belongs to the region on its upper side, so regions that share a
border never share a site. Shapes are not repeated across periodic axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.domain import AXES
from warpsph.scene.lattice import Lattice, open_grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.expressions import Expression
    from warpsph.case.shapes import Shape


_ON_BORDER = 1e-6
"""Distance, in spacings, within which a site counts as lying on a border."""

_BORDER_SHIFT = (1.0, 0.618, 0.414)
"""Direction in which sites are moved by `_ON_BORDER` before a test. Along no simple line, so that the sites
on a sloping border are decided in the same way all along it."""


def inside(shape: Shape, axes: Sequence[NDArray[np.float64]], spacing: float) -> NDArray[np.bool_]:
    """Which sites of a lattice lie in a shape other than `rest`.

    axes: ascending coordinates along each axis, m.
    spacing: particle spacing, m; what is nearer to a border than 1e-6 of it lies on the border.

    Returns one bool a site; its shape is the lengths of the axes. Raises ExpressionError if a condition
    cannot be evaluated.
    """
    size = tuple(len(axis) for axis in axes)
    tiny = _ON_BORDER * spacing
    shifted = [axis + tiny * _BORDER_SHIFT[k] for k, axis in enumerate(axes)]
    if shape.box is not None:
        mask: Any = True
        for x, low, high in zip(open_grid(shifted), shape.box.lower, shape.box.upper, strict=True):
            mask = mask & ((low <= x) & (x < high))
        return np.array(np.broadcast_to(mask, size))
    if shape.sphere is not None:
        grid = open_grid(axes)
        square = sum((x - c) ** 2 for x, c in zip(grid, shape.sphere.center, strict=True))
        return np.asarray(square < max(shape.sphere.radius - tiny, 0.0) ** 2)
    if shape.polygon is not None:
        flat = _inside_polygon(shifted[0], shifted[1], np.array(shape.polygon.points, dtype=np.float64))
        return np.array(np.broadcast_to(flat.reshape(flat.shape + (1,) * (len(axes) - 2)), size))
    if shape.where is not None:
        return values_at(shape.where.condition, open_grid(shifted), size) != 0
    raise ValueError("`rest` is no shape of its own")


def contains(shape: Shape, points: NDArray[np.float64], spacing: float) -> NDArray[np.bool_]:
    """Which points (n, d), m, lie in a shape other than `rest`; what lies on a border is decided as by `inside`.

    spacing: particle spacing, m; what is nearer to a border than 1e-6 of it lies on the border.

    Raises ExpressionError if a condition cannot be evaluated.
    """
    tiny = _ON_BORDER * spacing
    shifted = points + tiny * np.array(_BORDER_SHIFT[: points.shape[1]])
    if shape.box is not None:
        return np.all((shape.box.lower <= shifted) & (shifted < np.array(shape.box.upper)), axis=1)
    if shape.sphere is not None:
        square = ((points - np.array(shape.sphere.center)) ** 2).sum(axis=1)
        return np.asarray(square < max(shape.sphere.radius - tiny, 0.0) ** 2)
    if shape.polygon is not None:
        x, y = shifted[:, 0], shifted[:, 1]
        corners = np.array(shape.polygon.points, dtype=np.float64)
        odd = np.zeros(len(points), dtype=np.bool_)
        for (x1, y1), (x2, y2) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if y1 > y2:  # the same edge gives the same numbers from both of its sides
                x1, y1, x2, y2 = x2, y2, x1, y1
            if y1 < y2:
                odd ^= (y1 <= y) & (y < y2) & (x < x1 + (y - y1) * ((x2 - x1) / (y2 - y1)))
        return odd
    if shape.where is not None:
        return values_at(shape.where.condition, list(shifted.T), (len(points),)) != 0
    raise ValueError("`rest` is no shape of its own")


def _inside_polygon(
    x: NDArray[np.float64], y: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Even-odd test of all sites (x[i], y[j]) in a closed polygon with the corners `points` (k, 2)."""
    # An edge crosses the rows y[j] of its own height once and changes the side of all sites left of the
    # crossing. Marking where they end and summing the marks from the right, modulo 2, costs one visit per
    # edge and row.
    marks = np.zeros((len(x) + 1, len(y)), dtype=np.bool_)
    for (x1, y1), (x2, y2) in zip(points, np.roll(points, -1, axis=0), strict=True):
        if y1 > y2:  # the same edge gives the same numbers from both of its sides
            x1, y1, x2, y2 = x2, y2, x1, y1
        first, last = np.searchsorted(y, [y1, y2])
        if first < last:
            rows = np.arange(first, last)
            crossing = x1 + (y[rows] - y1) * ((x2 - x1) / (y2 - y1))
            marks[np.searchsorted(x, crossing), rows] ^= True
    return np.logical_xor.accumulate(marks[::-1], axis=0)[-2::-1]


def values_at(expression: Expression, coordinates: Sequence[Any], size: tuple[int, ...]) -> NDArray[Any]:
    """Value of an expression at the given coordinates, one array an axis that broadcast to `size`.

    Only the coordinates that occur are handed over: a function of y alone is evaluated once a row.
    Raises ExpressionError.
    """
    named = dict(zip(AXES, coordinates, strict=False))
    if "r" not in expression.names:
        named = {name: value for name, value in named.items() if name in expression.names}
    return np.broadcast_to(expression.evaluate(**named), size)


def on_sites(shape: Shape, lattice: Lattice) -> list[str]:
    """Names of the axes along which a face of a box runs through the middle of cells of the domain."""
    if shape.box is None:
        return []
    found = []
    for k in range(lattice.dimension):
        for face in (shape.box.lower[k], shape.box.upper[k]):
            place = (face - lattice.lower[k]) / lattice.spacing[k] - 0.5
            if -0.25 < place < lattice.count[k] - 0.75 and abs(place - round(place)) < _ON_BORDER:
                found.append(AXES[k])
    return sorted(set(found))
