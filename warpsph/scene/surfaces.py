"""Surfaces of bodies: signed distance, nearest point and normal, for points anywhere.

The distance is exact and negative inside the body; the normal is the gradient of the distance, a unit vector that points
out of the body into the fluid. `Ball` is a circle or a sphere, `Brick` an axis-parallel box in 3-D, `Outline` the border
of a plane region of polygons (a box, a polygon, an airfoil, a traced condition), `Hollow` turns any of them inside out:
the fluid is within the shape and the body all around it. Meshes of triangles are in `warpsph/scene/meshes.py`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Ball", "Brick", "Hollow", "Outline", "ShapeError", "Surface", "box_surface"]

_ON_SURFACE = 1e-9
"""Distance over the size of a body below which a point lies on its surface: the normal is then that of the face."""

_TIES = np.array([1.0 - 2e-6, 1.0 - 1e-6, 1.0])
"""Shares of the distances along each axis by which the nearest face is chosen: of two that are as near, as on the bisector
of a corner, rounding would choose, another one here than in the mirror image or elsewhere. It is that of the first axis."""

_UPWARDS = 1e-10
"""The same for what lies midway between two faces, as the middle row of a plate: how far upwards along all axes a point
counts as lying, over the size of the body."""

NOT_THERE = "paths are relative to the folder of the case file"
"""Remedy for the name of a file that is missing."""


class ShapeError(ValueError):
    """A shape that has no surface to sample.

    Args:
        rule: what the shape has to fulfil, in words that follow its value
        remedy: what to write instead; may be empty
    """

    def __init__(self, rule: str, remedy: str = "") -> None:
        super().__init__(f"{rule}; {remedy}" if remedy else rule)
        self.rule = rule
        self.remedy = remedy


class Surface(ABC):
    """The surface of a body in d dimensions.

    bounds: (2, d), lower and upper corner of the box around the surface, m
    measure: area (2-D) or volume (3-D) within the surface, m^d
    extent: length (2-D) or area (3-D) of the surface, m^(d-1)
    """

    bounds: NDArray[np.float64]
    measure: float
    extent: float

    @property
    def dimension(self) -> int:
        """Number of dimensions."""
        return int(self.bounds.shape[1])

    @property
    def size(self) -> float:
        """Diagonal of the box around the surface, m."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def hollow(self) -> bool:
        """Whether the body is all around the shape, not within it."""
        return False

    @abstractmethod
    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of points (n, d), m, from the surface (n,), m; negative in the body."""

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of the points (n, d), m, are in the body."""
        return self.signed_distance(points) < 0.0

    @abstractmethod
    def closest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The point of the surface nearest to each of `points` (n, d), m, and the unit normal there, into the fluid.

        Off the surface the normal is the direction of the way to the foot, so that at an edge it turns with the point; on
        the surface that of a face.
        """

    @abstractmethod
    def patches(self, size: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """The surface cut in patches of about `size`, m, across.

        Returns the middle of each patch (n, d), m, its unit normal (n, d) and its length (2-D) or area (3-D) (n,).
        """


class Ball(Surface):
    """A circle in 2-D, a sphere in 3-D."""

    def __init__(self, center: Sequence[float], radius: float) -> None:
        self.center = np.array(center, dtype=np.float64)
        self.radius = float(radius)
        self.bounds = np.stack([self.center - radius, self.center + radius])
        d = len(self.center)
        self.measure = math.pi * radius**2 if d == 2 else 4.0 / 3.0 * math.pi * radius**3
        self.extent = 2.0 * math.pi * radius if d == 2 else 4.0 * math.pi * radius**2

    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Surface.signed_distance`."""
        return np.linalg.norm(points - self.center, axis=1) - self.radius

    def closest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.closest`; for the centre any point is nearest, and it is one along the first axis."""
        way = points - self.center
        length = np.linalg.norm(way, axis=1)
        at_centre = length == 0.0
        normal = way / np.where(at_centre, 1.0, length)[:, None]
        normal[at_centre, 0] = 1.0
        return self.center + self.radius * normal, normal

    def patches(self, size: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.patches`."""
        if self.dimension == 2:
            n = max(8, math.ceil(self.extent / size))
            angle = (np.arange(n) + 0.5) * (2.0 * math.pi / n)
            normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        else:
            n = max(32, math.ceil(self.extent / size**2))
            normal = fibonacci(n)
        return self.center + self.radius * normal, normal, np.full(n, self.extent / n)


def fibonacci(n: int) -> NDArray[np.float64]:
    """Unit vectors (n, 3) that lie evenly on the unit sphere, along a spiral of turns of the golden angle."""
    k = np.arange(n) + 0.5
    z = 1.0 - 2.0 * k / n
    angle = math.pi * (3.0 - math.sqrt(5.0)) * k
    ring = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1)


class Brick(Surface):
    """An axis-parallel box in 3-D."""

    def __init__(self, lower: Sequence[float], upper: Sequence[float]) -> None:
        self.bounds = np.array([lower, upper], dtype=np.float64)
        edges = self.bounds[1] - self.bounds[0]
        self.measure = float(edges.prod())
        self.extent = float(2.0 * sum(edges[k] * edges[k - 1] for k in range(3)))

    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Surface.signed_distance`."""
        beyond = np.maximum(self.bounds[0] - points, points - self.bounds[1])
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)

    def closest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.closest`."""
        lower, upper = self.bounds
        foot = np.clip(points, lower, upper)
        beyond = np.maximum(lower - points, points - upper)
        axis = (beyond * _TIES).argmax(axis=1)
        rows = np.arange(len(points))
        above = (points - lower)[rows, axis] > (upper - points)[rows, axis] - 2.0 * _UPWARDS * self.size
        within = (beyond <= 0.0).all(axis=1)
        foot[rows[within], axis[within]] = np.where(above, upper[axis], lower[axis])[within]
        normal = np.zeros_like(foot)
        normal[rows, axis] = np.where(above, 1.0, -1.0)
        way = points - foot
        length = np.linalg.norm(way, axis=1)
        off = ~within & (length > _ON_SURFACE * self.size)
        normal[off] = way[off] / length[off, None]
        return foot, normal

    def patches(self, size: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.patches`."""
        lower, upper = self.bounds
        found = []
        for axis in range(3):
            others = [k for k in range(3) if k != axis]
            count = [max(1, math.ceil((upper[k] - lower[k]) / size - 1e-9)) for k in others]
            step = [(upper[k] - lower[k]) / n for k, n in zip(others, count, strict=True)]
            u, v = np.meshgrid(*((np.arange(n) + 0.5) * s for n, s in zip(count, step, strict=True)), indexing="ij")
            for level, sign in ((lower[axis], -1.0), (upper[axis], 1.0)):
                middle, normal = np.empty((u.size, 3)), np.zeros((u.size, 3))
                middle[:, axis], normal[:, axis] = level, sign
                middle[:, others[0]], middle[:, others[1]] = lower[others[0]] + u.ravel(), lower[others[1]] + v.ravel()
                found.append((middle, normal, np.full(u.size, step[0] * step[1])))
        points, normals, areas = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return points, normals, areas


class Outline(Surface):
    """The border of a plane region bounded by polygons; it may be in several parts and have holes.

    Args:
        region: a shapely Polygon or MultiPolygon, m; what `Outline.of_corners` makes of corners.

    Raises:
        ShapeError: the region is empty or crosses itself.
    """

    def __init__(self, region: Any) -> None:
        import shapely

        if region.is_empty or region.convex_hull.area == 0.0:
            raise ShapeError("encloses no area", "give at least three corners that are not on one line")
        if not region.is_valid:
            raise ShapeError(f"crosses or touches itself ({shapely.is_valid_reason(region)})", "give the corners in order")
        # Borders counter-clockwise, holes clockwise: the fluid is on the right.
        self.region = shapely.orient_polygons(region)
        rings = [shapely.get_coordinates(ring) for part in shapely.get_parts(self.region) for ring in _rings_of(part)]
        self._start = np.concatenate([ring[:-1] for ring in rings])
        self._end = np.concatenate([ring[1:] for ring in rings])
        way = self._end - self._start
        self._length = np.linalg.norm(way, axis=1)
        self._tangent = way / self._length[:, None]
        self._normal = np.stack([self._tangent[:, 1], -self._tangent[:, 0]], axis=1)
        self._tree = shapely.STRtree(shapely.linestrings(np.stack([self._start, self._end], axis=1) * _TIES[:2]))
        shapely.prepare(self.region)
        self.bounds = np.array(self.region.bounds, dtype=np.float64).reshape(2, 2)
        self.measure = float(self.region.area)
        self.extent = float(self._length.sum())

    @classmethod
    def of_corners(cls, corners: Any) -> Outline:
        """The outline with the corners (k, 2), m, in either sense of rotation; a corner given twice in a row counts once.

        Raises:
            ShapeError: it encloses no area or crosses itself.
        """
        import shapely

        points = np.array(corners, dtype=np.float64).reshape(-1, 2)
        points = points[np.any(points != np.roll(points, 1, axis=0), axis=1)]
        if len(points) < 3:
            raise ShapeError("has fewer than three different corners", "give at least three")
        return cls(shapely.Polygon(points))

    def edges(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the edges start and end, both (n, 2), m; the body is on the left of the way."""
        return self._start, self._end

    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Surface.signed_distance`."""
        foot, _ = self._feet(points)
        return self._sign(points) * np.linalg.norm(points - foot, axis=1)

    def closest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.closest`."""
        foot, edge = self._feet(points)
        normal = self._normal[edge].copy()
        # At the end of an edge the way to the foot is not along its normal.
        way = points - foot
        length = np.linalg.norm(way, axis=1)
        at_corner = np.abs(np.einsum("ij,ij->i", way, self._tangent[edge])) > _ON_SURFACE * self.size
        sign = self._sign(points)[at_corner]
        normal[at_corner] = way[at_corner] * (sign / length[at_corner])[:, None]
        return foot, normal

    def patches(self, size: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.patches`."""
        pieces = np.maximum(1, np.ceil(self._length / size - 1e-9)).astype(np.intp)
        edge = np.repeat(np.arange(len(pieces)), pieces)
        place = np.arange(len(edge)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 0.5
        length = self._length[edge] / pieces[edge]
        return self._start[edge] + (place * length)[:, None] * self._tangent[edge], self._normal[edge], length

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """See `Surface.inside`."""
        import shapely

        return np.asarray(shapely.contains_xy(self.region, points[:, 0], points[:, 1]))

    def _sign(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(self.inside(points), -1.0, 1.0)

    def _feet(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """The nearest point of the border (n, 2) and the edge that it is on (n,)."""
        import shapely

        if len(points) == 0:
            return np.empty((0, 2)), np.empty(0, dtype=np.intp)
        edge = self._tree.nearest(shapely.points((points + _UPWARDS * self.size) * _TIES[:2]))
        along = np.einsum("ij,ij->i", points - self._start[edge], self._tangent[edge])
        along = np.clip(along, 0.0, self._length[edge])
        return self._start[edge] + along[:, None] * self._tangent[edge], edge


def _rings_of(polygon: Any) -> list[Any]:
    """The closed lines of a shapely polygon, the outer one first."""
    return [polygon.exterior, *polygon.interiors]


class Hollow(Surface):
    """A shape turned inside out: the body is all around it, the fluid within."""

    def __init__(self, shape: Surface) -> None:
        self.shape = shape
        self.bounds = shape.bounds
        self.measure = shape.measure
        self.extent = shape.extent

    @property
    def hollow(self) -> bool:
        """Whether the body is all around the shape, not within it."""
        return True

    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Surface.signed_distance`."""
        return -self.shape.signed_distance(points)

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """See `Surface.inside`."""
        return ~self.shape.inside(points)

    def closest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.closest`."""
        foot, normal = self.shape.closest(points)
        return foot, -normal

    def patches(self, size: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.patches`."""
        middle, normal, extent = self.shape.patches(size)
        return middle, -normal, extent


class Repeated(Surface):
    """A body that periodic sides repeat: with it those of its images that reach into the domain.

    shape: the body
    shifts: (m, d), where its images are, m; the first is the body itself, 0
    """

    def __init__(self, shape: Surface, shifts: NDArray[np.float64]) -> None:
        self.shape, self.shifts = shape, shifts
        self.bounds = np.stack([shape.bounds[0] + shifts.min(axis=0), shape.bounds[1] + shifts.max(axis=0)])
        self.measure = shape.measure
        self.extent = shape.extent

    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Surface.signed_distance`."""
        return np.min([self.shape.signed_distance(points - shift) for shift in self.shifts], axis=0)

    def closest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.closest`."""
        nearest = np.argmin([np.abs(self.shape.signed_distance(points - shift)) for shift in self.shifts], axis=0)
        shift = self.shifts[nearest]
        foot, normal = self.shape.closest(points - shift)
        return foot + shift, normal

    def patches(self, size: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.patches`: those of the body itself."""
        return self.shape.patches(size)


def box_surface(lower: Sequence[float], upper: Sequence[float]) -> Surface:
    """The surface of an axis-parallel box in 2-D or 3-D.

    Raises:
        ShapeError: a length of the box is not positive.
    """
    if not all(a < b for a, b in zip(lower, upper, strict=True)):
        raise ShapeError("has no volume: a lower coordinate is not below the upper one", "exchange them")
    if len(lower) == 3:
        return Brick(lower, upper)
    (x0, y0), (x1, y1) = lower, upper
    return Outline.of_corners([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
