"""Bodies that stand on walls of the domain or on each other, gone on into them (theory: bodies#roots).

The face that a body has on a wall or on another body is no surface: no fluid is before it. Left in its place, what slips
under the edge of the body is held by nothing between the two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.scene.surfaces import Ball, Brick, Outline, ShapeError, Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Footing", "gap_of", "joined", "moved", "rooted"]

ON_LINE = 1e-9
"""Share of the size of a body by which a corner may be off the line between its neighbours and be none."""

TOUCH = 1e-6
"""Share of the size of a body by which bodies that touch may be apart."""

ROUND = 64
"""Pieces of a quarter of a circle that another body touches."""


@dataclass(frozen=True)
class Footing:
    """A wall that a body may stand on.

    axis: at right angles to it
    way: -1 where the domain ends downwards there, 1 upwards
    plane: coordinate of the wall, m
    near: a face nearer to it than this, m, or beyond it stands on it
    reach: how far beyond the wall a body on it goes on, m
    """

    axis: int
    way: int
    plane: float
    near: float
    reach: float

    @property
    def end(self) -> float:
        """Coordinate at which a body that stands on the wall ends, m."""
        return self.plane + self.way * self.reach

    def holds(self, coordinate: Any) -> Any:
        """Whether coordinates along the axis, m, are those of faces that stand on the wall or are beyond it."""
        return self.way * (coordinate - self.plane) > -self.near

    def ends(self, coordinate: Any) -> Any:
        """Where faces that stand on the wall come to be, m."""
        return np.maximum(coordinate, self.end) if self.way > 0 else np.minimum(coordinate, self.end)


def gap_of(surface: Surface, footing: Footing) -> float:
    """How far the faces of a body that stand on a wall are from it, m; 0 if they touch it, or if there are none."""
    heights = footing.way * (footing.plane - _levels(surface, footing))
    return max(0.0, float(heights.max(initial=0.0)))


def rooted(surface: Surface, footing: Footing) -> Surface:
    """The body, gone on into a wall from each of its faces that stand on it.

    A ball has no such face, a body all around the fluid is in the wall already: they stay as they are.
    """
    if isinstance(surface, Brick):
        return _longer(surface, footing)
    if isinstance(surface, Outline):
        return _with_legs(surface, footing)
    from warpsph.scene.meshes import Mesh

    return _with_skirt(surface, footing) if isinstance(surface, Mesh) else surface


def joined(surface: Surface, others: Sequence[Surface], reach: float) -> Surface:
    """A body with those that it touches: of the surface of both that of one is left, for those particles that are its own.

    In 2-D outlines are joined with outlines and circles. In 3-D a box goes on into one on whose face its own lies whole;
    shapes that only overlap keep their surfaces.

    reach: how far a box goes on, m.
    """
    if isinstance(surface, Outline):
        return _union(surface, others)
    if isinstance(surface, Brick):
        for other in others:
            if isinstance(other, Brick):
                surface = _on_brick(surface, other, reach)
    return surface


def moved(surface: Surface, way: NDArray[np.float64]) -> Surface | None:
    """A surface elsewhere, by a `way` (d,), m.

    None for kinds that are not joined, and where rounding makes it cross itself.
    """
    if isinstance(surface, Outline):
        import shapely

        region = shapely.transform(surface.region, lambda corners: corners + way)
        return Outline(region) if region.is_valid else None
    if isinstance(surface, Ball):
        return Ball((surface.center + way).tolist(), surface.radius)
    if isinstance(surface, Brick):
        return Brick((surface.bounds[0] + way).tolist(), (surface.bounds[1] + way).tolist())
    return None


def _union(surface: Outline, others: Sequence[Surface]) -> Outline:
    """An outline and all that hangs together with it, the same for all of them to the last bit, so that their rows meet."""
    import shapely

    left = [other.region if isinstance(other, Outline) else _disc(other) for other in others
            if isinstance(other, (Outline, Ball))]  # fmt: skip
    found = [surface.region]
    k = 0
    while k < len(found):
        near = [found[k].distance(region) < TOUCH * surface.size for region in left]
        found += [region for region, touches in zip(left, near, strict=True) if touches]
        left = [region for region, touches in zip(left, near, strict=True) if not touches]
        k += 1
    if len(found) == 1:
        return surface
    size = float(np.ptp(shapely.total_bounds(found).reshape(2, 2), axis=0).max())
    region = shapely.simplify(shapely.union_all(shapely.normalize(found), grid_size=TOUCH * size), ON_LINE * size)
    return Outline(shapely.normalize(region)) if region.is_valid else surface


def _disc(ball: Ball) -> Any:
    import shapely

    return shapely.Point(ball.center).buffer(ball.radius, quad_segs=ROUND)


def _on_brick(surface: Brick, other: Brick, reach: float) -> Brick:
    bounds, tiny = surface.bounds.copy(), TOUCH * surface.size
    for axis in range(3):
        across = [k for k in range(3) if k != axis]
        whole = (other.bounds[0] - tiny <= surface.bounds[0]) & (surface.bounds[1] <= other.bounds[1] + tiny)
        for side, way in ((0, -1.0), (1, 1.0)):
            beside = abs(surface.bounds[side, axis] - other.bounds[1 - side, axis]) < tiny
            if beside and whole[across].all():
                thick = other.bounds[1, axis] - other.bounds[0, axis]
                bounds[side, axis] += way * min(reach, thick)
    return surface if (bounds == surface.bounds).all() else Brick(*bounds)


def _levels(surface: Surface, footing: Footing) -> NDArray[np.float64]:
    """Coordinates along the axis of the faces of a body that stand on a wall (n,), m, those of both ends of an edge."""
    axis = footing.axis
    if isinstance(surface, Brick):
        level = surface.bounds[(footing.way + 1) // 2, axis]
        return np.array([level]) if footing.holds(level) else np.empty(0)
    if isinstance(surface, Outline):
        start, end = surface.edges()
        return np.concatenate([start, end])[np.tile(_standing_edges(surface, footing), 2), axis]
    from warpsph.scene.meshes import Mesh

    if isinstance(surface, Mesh):
        return surface.corners[surface.triangles[_standing_triangles(surface, footing)].ravel(), axis]
    return np.empty(0)


def _longer(surface: Brick, footing: Footing) -> Brick:
    lower, upper = surface.bounds.copy()
    face = upper if footing.way > 0 else lower
    if not footing.holds(face[footing.axis]):
        return surface
    face[footing.axis] = footing.ends(face[footing.axis])
    return Brick(lower, upper)


def _standing_edges(surface: Outline, footing: Footing) -> NDArray[np.bool_]:
    """Which edges of an outline stand on a wall: both their ends do, and they face it."""
    start, end = surface.edges()
    k = footing.axis
    outwards = footing.way * (1 - 2 * k) * (end - start)[:, 1 - k]  # of the normal, a quarter of a turn to the right
    return np.asarray(footing.holds(start[:, k]) & footing.holds(end[:, k]) & (outwards > 0.0))


def _with_legs(surface: Outline, footing: Footing) -> Outline:
    """An outline and what is between its edges that stand on a wall and where they come to be."""
    import shapely

    standing = _standing_edges(surface, footing)
    if not standing.any():
        return surface
    start, end = (points[standing] for points in surface.edges())
    below_end, below_start = end.copy(), start.copy()
    for below in (below_end, below_start):
        below[:, footing.axis] = footing.ends(below[:, footing.axis])
    legs = shapely.polygons(np.stack([start, end, below_end, below_start], axis=1))
    legs = legs[shapely.area(legs) > 0.0]
    region = shapely.union_all([surface.region, *legs])
    return Outline(shapely.simplify(region, ON_LINE * surface.size))


def _standing_triangles(surface: Any, footing: Footing) -> NDArray[np.bool_]:
    """Which triangles of a mesh stand on a wall: all their corners do, and they face it."""
    on = footing.holds(surface.corners[:, footing.axis])
    return np.asarray(on[surface.triangles].all(axis=1) & (footing.way * surface.normal[:, footing.axis] > 0.0))


def _with_skirt(surface: Any, footing: Footing) -> Surface:
    """A mesh whose triangles that stand on a wall are moved to where they come to be, with sides down to them.

    A mesh of which this makes no closed surface stays as it is.
    """
    import pyvista as pv

    from warpsph.scene.meshes import Mesh

    standing = _standing_triangles(surface, footing)
    if not standing.any():
        return surface
    sole = surface.triangles[standing]
    corner = np.unique(sole)
    moved = surface.corners[corner].copy()
    moved[:, footing.axis] = footing.ends(moved[:, footing.axis])
    number = np.full(len(surface.corners), -1, dtype=np.intp)
    number[corner] = len(surface.corners) + np.arange(len(corner))
    edges = np.concatenate([sole[:, [0, 1]], sole[:, [1, 2]], sole[:, [2, 0]]])
    _, place, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    a, b = edges[place[count == 1]].T
    sides = np.concatenate([np.stack([a, b, number[b]], axis=1), np.stack([a, number[b], number[a]], axis=1)])
    triangles = np.concatenate([surface.triangles[~standing], number[sole], sides])
    faces = np.insert(triangles, 0, 3, axis=1).ravel()
    try:
        return Mesh(pv.PolyData(np.concatenate([surface.corners, moved]), faces))
    except ShapeError:  # two soles that meet in a point would be one along an edge
        return surface
