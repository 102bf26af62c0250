"""Sensors in a wall: which way they look, and the places over which their reading is averaged.

A pressure gauge in a wall has a face, and reads the mean over it. In 3-D the face is a disc, in 2-D what a plane cuts out of
one: a length along the wall. It is divided into equal parts no wider than half a particle spacing, and the field is
interpolated (`warpsph.measure.probes`) in the middle of each: the mean of a linear field is exact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

__all__ = ["NoPlane", "face_radius", "face_spots", "wall_normal"]

Plane = tuple[float, np.ndarray]  # distance of a point from a surface [m], normal of the surface there (dimension,)

_SAME = 1.0e-6  # share of a particle spacing within which two surfaces are equally near to a point


class NoPlane(ValueError):
    """There is no single wall at a point; the text says why, as the end of the sentence `sensor_3.points.0 ...`."""


def face_radius(area: float, dimension: int) -> float:
    """How far a face reaches from its middle [m]; `area` is its area [m^2], in 2-D its length [m]."""
    return math.sqrt(area / math.pi) if dimension == 3 else 0.5 * area


def face_spots(area: float, normal: Sequence[float] | np.ndarray, spacing: float) -> np.ndarray:
    """Middles of the equal parts of a face, seen from its middle: (parts, dimension) [m].

    area: of the face [m^2], in 2-D its length [m]
    normal: of the wall, of any length, (dimension,)
    spacing: of the particles [m]; the parts are no wider than half of it, and there are two or more across the face
    """
    across = np.asarray(normal, np.float64)
    across = across / np.linalg.norm(across)
    dimension = len(across)
    radius = face_radius(area, dimension)
    # The slack keeps the rounding of 2 r/(dx/2) from adding a part to a face of a whole number of them.
    count = max(2, math.ceil(2.0 * radius / (0.5 * spacing) * (1.0 - 1.0e-9)))
    row = radius * ((2.0 * np.arange(count) + 1.0) / count - 1.0)
    if dimension == 2:
        return row[:, None] * np.array([-across[1], across[0]])
    # The axis that the normal is least along is far from parallel to it.
    first = np.cross(across, np.eye(3)[int(np.argmin(np.abs(across)))])
    first /= np.linalg.norm(first)
    second = np.cross(across, first)
    a, b = (grid.ravel() for grid in np.meshgrid(row, row, indexing="ij"))
    on_disc = a * a + b * b <= radius * radius * (1.0 + 1.0e-9)
    return a[on_disc, None] * first + b[on_disc, None] * second


def wall_normal(case: Any, point: Sequence[float]) -> np.ndarray:
    """Unit normal (dimension,) of the wall at a point [m]: of the nearest wall of the domain or surface of a body.

    Raises NoPlane if none is within a particle spacing, or two that are not parallel are equally near, as in a corner.
    """
    place = np.asarray(point, np.float64)
    near = [plane for plane in _planes(case, place) if plane[0] <= case.particle_spacing * (1.0 + _SAME)]
    if not near:
        raise NoPlane("has no wall within a particle_spacing whose plane its area could lie in")
    least = min(distance for distance, _ in near)
    normals = [normal for distance, normal in near if distance <= least + _SAME * case.particle_spacing]
    if any(abs(abs(normals[0] @ other) - 1.0) > _SAME for other in normals):
        raise NoPlane("is as near to one wall as to another: its area could lie in the plane of either")
    return normals[0]


def _planes(case: Any, place: np.ndarray) -> Iterator[Plane]:
    """The walls of the domain and the nearest planes of bodies; a `where`, an airfoil and a mesh have none that is known."""
    size = len(place)
    for axis, sides in enumerate(_sides(case)):
        normal = np.eye(size)[axis]
        if sides.lower.kind == "wall":
            yield abs(place[axis] - case.domain.lower[axis]), normal
        if sides.upper.kind == "wall":
            yield abs(place[axis] - case.domain.upper[axis]), normal
    for body in case.bodies.values():
        shape = body.shape
        # A shape of another dimension is reported elsewhere; it has no planes here.
        if shape.box is not None and len(shape.box.lower) == len(shape.box.upper) == size:
            yield from _box_planes(place, np.asarray(shape.box.lower), np.asarray(shape.box.upper))
        elif shape.sphere is not None and len(shape.sphere.center) == size:
            way = place - np.asarray(shape.sphere.center)
            distance = float(np.linalg.norm(way))
            if distance > 0.0:
                yield abs(distance - shape.sphere.radius), way / distance
        elif shape.polygon is not None and all(len(corner) == size == 2 for corner in shape.polygon.points):
            yield from _edge_planes(place, np.asarray(shape.polygon.points, np.float64))


def _sides(case: Any) -> list[Any]:
    """The sides of the domain, one entry an axis; also of a case of which a part alone could be read."""
    return [getattr(case.domain.boundary, axis) for axis in "xyz"[: case.dimension]]


def _box_planes(place: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Iterator[Plane]:
    """The faces of a box, each at its distance from a point."""
    for axis in range(len(place)):
        for level in (lower[axis], upper[axis]):
            foot = np.clip(place, lower, upper)
            foot[axis] = level
            yield float(np.linalg.norm(place - foot)), np.eye(len(place))[axis]


def _edge_planes(place: np.ndarray, corners: np.ndarray) -> Iterator[Plane]:
    """The edges of a polygon, each at its distance from a point."""
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        way = end - start
        length = float(np.linalg.norm(way))
        if length > 0.0:
            share = float(np.clip((place - start) @ way / length**2, 0.0, 1.0))
            distance = float(np.linalg.norm(place - start - share * way))
            yield distance, np.array([-way[1], way[0]]) / length
