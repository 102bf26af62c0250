"""The surface of all points that fulfil a condition: found on a grid, then drawn to where the condition changes.

A grid finer than the particles tells inside from outside. Between an inner and an outer neighbour of the grid the surface
is found by bisection; its points are joined to polygons (2-D) or triangles (3-D). Parts smaller than a grid cell are not
seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.masks import values_at
from warpsph.scene.surfaces import Outline, ShapeError, Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.expressions import Expression
    from warpsph.scene.meshes import Mesh

    Inside = Callable[[NDArray[np.float64]], NDArray[np.bool_]]

__all__ = ["trace", "trace_expression"]

_CELLS = {2: 4, 3: 2}
"""Grid cells to a particle spacing, by dimension."""

_HALVINGS = 24
"""Bisections of a grid edge: the surface is known to a millionth of a cell, 6e-8."""

_KINK = np.radians(8.0)
"""Turn between two pieces of a traced line above which they belong to different sides of a corner: eight cells or more to
the radius of a curve turn less."""


def trace_expression(
    condition: Expression,
    lower: Sequence[float],
    upper: Sequence[float],
    spacing: float,
    beyond: NDArray[np.float64] | None = None,
) -> Surface:
    """The surface of a condition of a case within a box, see `trace`.

    beyond: (2, d), how far the body goes on beyond the lower and upper faces of the box with its section there, m.

    Raises:
        ShapeError: no point or every point fulfils it.
        ExpressionError: it cannot be evaluated.
    """
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    more = np.zeros((2, len(low))) if beyond is None else beyond

    def inside(points: NDArray[np.float64]) -> NDArray[np.bool_]:
        return values_at(condition, list(np.clip(points, low, high).T), (len(points),)) != 0

    return trace(inside, low - more[0], high + more[1], spacing)


def trace(inside: Inside, lower: Sequence[float], upper: Sequence[float], spacing: float) -> Surface:
    """The surface of the points of a box that fulfil a condition; faces of the box are surface where the body reaches them.

    Args:
        inside: tells which of the points (n, d), m, fulfil it.
        lower, upper: corners of the box, m.
        spacing: particle spacing, m; the grid has four cells to one in 2-D and two in 3-D.

    Raises:
        ShapeError: no point of the grid fulfils it.
    """
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    d = len(low)
    step = spacing / _CELLS[d]
    count = np.maximum(1, np.ceil((high - low) / step - 1e-9)).astype(np.intp)
    cell = (high - low) / count
    origin = low - 0.5 * cell  # the first nodes are outside, so that every surface is closed

    def within(points: NDArray[np.float64]) -> NDArray[np.bool_]:
        found = np.all((points >= low) & (points <= high), axis=1)
        found[found] = inside(points[found])
        return found

    shape = tuple(count + 2)
    nodes = np.stack(np.meshgrid(*(origin[k] + cell[k] * np.arange(shape[k]) for k in range(d)), indexing="ij"), axis=-1)
    mask = within(nodes.reshape(-1, d)).reshape(shape)
    if not mask.any():
        raise ShapeError("holds no point of the domain", f"check the formula; parts below {step:g} m are not seen")
    if d == 2:
        return _traced_outline(mask, origin, cell, within)
    return _traced_mesh(mask, origin, cell, within)


def _bisect(points: NDArray[np.float64], mask: NDArray[np.bool_], within: Inside, origin: NDArray[np.float64],
            cell: NDArray[np.float64]) -> NDArray[np.float64]:  # fmt: skip
    """Move points in the middle of grid edges to where the condition changes.

    points: (n, d) in cells from the first node; one coordinate of each is half way between two nodes.
    Returns their places (n, d), m.
    """
    axis = np.abs(points - np.floor(points) - 0.5).argmin(axis=1)
    rows = np.arange(len(points))
    first, last = np.rint(points).astype(np.intp), np.rint(points).astype(np.intp)
    first[rows, axis] = np.floor(points[rows, axis]).astype(np.intp)
    last[rows, axis] = first[rows, axis] + 1
    swap = mask[tuple(last.T)]
    a, b = np.where(swap[:, None], last, first), np.where(swap[:, None], first, last)
    inner, outer = origin + cell * a, origin + cell * b
    for _ in range(_HALVINGS):
        middle = 0.5 * (inner + outer)
        held = within(middle)[:, None]
        inner, outer = np.where(held, middle, inner), np.where(held, outer, middle)
    return 0.5 * (inner + outer)


def _traced_outline(
    mask: NDArray[np.bool_], origin: NDArray[np.float64], cell: NDArray[np.float64], within: Inside
) -> Outline:
    import contourpy
    import shapely

    lines = contourpy.contour_generator(z=mask.T.astype(np.float64)).lines(0.5)
    tiny = 1e-6 * float(cell.min())
    rings = []
    for line in lines:
        places = _bisect(np.asarray(line)[:-1], mask, within, origin, cell)
        ring = shapely.LinearRing(_with_corners(_thinned(places, tiny), float(cell.max())))
        if shapely.Polygon(ring).area > tiny**2:
            rings.append(ring)
    region = shapely.build_area(shapely.MultiLineString(rings))
    return Outline(region if region.is_valid else region.buffer(0.0))


def _thinned(places: NDArray[np.float64], tiny: float) -> NDArray[np.float64]:
    """A closed line without the points that lie within `tiny` of the line between others."""
    import shapely

    kept = shapely.get_coordinates(shapely.Polygon(places).simplify(tiny).exterior)[:-1]
    return kept if len(kept) >= 3 else places


def _with_corners(points: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """A closed line (n, 2) with the corners that the grid has cut off put back.

    A corner within a grid cell shows as a short piece between two longer ones: these are drawn out until they meet, if
    they do so within two cells.
    """
    n = len(points)
    if n < 5:
        return points
    way = np.roll(points, -1, axis=0) - points  # piece k goes from point k to k + 1
    length = np.linalg.norm(way, axis=1)
    angle = np.arctan2(way[:, 1], way[:, 0])
    turn = (angle - np.roll(angle, 1) + np.pi) % (2.0 * np.pi) - np.pi  # at point k
    gone = np.zeros(n, dtype=np.bool_)
    result = points.copy()
    for k in np.flatnonzero((np.abs(turn) > _KINK) & (np.abs(np.roll(turn, -1)) > _KINK) & (length < 1.5 * cell)):
        before, after = (k - 1) % n, (k + 1) % n
        same_way = turn[k] * turn[after] > 0.0
        straight = abs(turn[before]) < _KINK / 2 and abs(turn[(k + 2) % n]) < _KINK / 2
        if gone[k] or gone[after] or not same_way or not (straight or min(length[before], length[after]) > 2.0 * cell):
            continue
        matrix = np.stack([way[before], -way[after]], axis=1)
        if abs(np.linalg.det(matrix)) < 1e-9 * length[before] * length[after]:
            continue
        s, t = np.linalg.solve(matrix, points[after] - points[k])
        corner = points[k] + s * way[before]
        if s > 0.0 and t < 0.0 and np.linalg.norm(corner - 0.5 * (points[k] + points[after])) < 2.0 * cell:
            result[k], gone[after] = corner, True
    return result[~gone]


def _traced_mesh(
    mask: NDArray[np.bool_], origin: NDArray[np.float64], cell: NDArray[np.float64], within: Inside
) -> Mesh:
    import pyvista as pv

    from warpsph.scene.meshes import Mesh

    grid = pv.ImageData(dimensions=mask.shape)
    grid["inside"] = mask.ravel(order="F").astype(np.float64)
    poly = grid.contour([0.5], scalars="inside", method="flying_edges")
    poly.clear_data()
    points = np.asarray(poly.points, dtype=np.float64)
    result = pv.PolyData(_bisect(points, mask, within, origin, cell), poly.faces)
    return Mesh(result)
