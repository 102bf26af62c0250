"""Particles set as pixels: which particle a pixel belongs to, and what no particle covers."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np


def nearest_particles(
    position: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    shape: tuple[int, int],
    radius: float,
    depth: np.ndarray | None = None,
) -> np.ndarray:
    """(rows, columns) index of the particle nearest to the centre of each pixel, -1 where none is within `radius`.

    position: (n, 2) [m]; those that are not finite are nowhere
    lower, upper: corners of the picture [m]; row 0 is at the bottom
    radius: of a particle [m]; it owns at least the pixel that it is in, unless another is nearer
    depth: (n,) distance of the particles from the plane of the picture [m]; without it they lie in it
    """
    rows, columns = shape
    # in pixels, centres at whole numbers
    place = (position - lower) / (upper - lower) * (columns, rows) - 0.5
    per_metre = max(columns / (upper[0] - lower[0]), rows / (upper[1] - lower[1]))
    reach = max(radius * per_metre, math.sqrt(0.5))
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero(((place > -1 - reach) & (place < np.array([columns, rows]) + reach)).all(axis=1))
    place = place[near]
    beyond = np.zeros(len(near)) if depth is None else (depth[near] * per_metre) ** 2
    home = np.rint(place).astype(np.int64)
    best = np.full(rows * columns, np.inf, np.float32)
    owner = np.full(rows * columns, -1, np.int64)
    limit = np.float32(reach * reach * (1 + 1e-5))

    def candidates() -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Particles, pixels and the squares of their distances, for one offset from the home pixel at a time."""
        width = math.ceil(reach)
        for up in range(-width, width + 1):
            for right in range(-width, width + 1):
                column, row = home[:, 0] + right, home[:, 1] + up
                distance = ((column - place[:, 0]) ** 2 + (row - place[:, 1]) ** 2 + beyond).astype(np.float32)
                inside = (distance <= limit) & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
                yield np.flatnonzero(inside), (row * columns + column)[inside], distance[inside]

    for _, pixel, distance in candidates():
        np.minimum.at(best, pixel, distance)
    for particle, pixel, distance in candidates():
        wins = distance == best[pixel]
        owner[pixel[wins]] = near[particle[wins]]
    return owner.reshape(rows, columns)


def owners(
    position: np.ndarray,
    depth: np.ndarray | None,
    lower: np.ndarray,
    upper: np.ndarray,
    shape: tuple[int, int],
    spacing: float,
    reach: float,
) -> np.ndarray:
    """(rows, columns) index of the particle that covers each pixel, the nearest one; -1 where none does.

    Holes into which a disc (with depths a ball) of `reach` spacings radius does not fit are closed; a surface is half a
    spacing outside of the outermost particles.

    position: (n, 2), m
    depth: (n,) distance of the particles from the plane of the picture, m; without it they lie in it
    lower, upper: (2,) corners of the picture, m; row 0 is at the bottom
    shape: rows and columns
    spacing: of the particles, m
    """
    # So far beyond the picture that what is empty around it is seen.
    size = (upper - lower) / (shape[1], shape[0])
    rim = math.ceil(reach * spacing / size.min()) + 1
    lower, upper = lower - rim * size, upper + rim * size
    wide = shape[0] + 2 * rim, shape[1] + 2 * rim
    owner = nearest_particles(position, lower, upper, wide, reach * spacing, depth)
    # Reaching so far closes holes, and pushes surfaces out by the same length: the latter is taken back from what is empty.
    full = np.pad(owner >= 0, 1)
    shore = ~full[1:-1, 1:-1] & (full[2:, 1:-1] | full[:-2, 1:-1] | full[1:-1, 2:] | full[1:-1, :-2])
    row, column = np.nonzero(shore)
    empty = lower + (np.column_stack([column, row]) + 0.5) * size
    owner[nearest_particles(empty, lower, upper, wide, (reach - 0.5) * spacing) >= 0] = -1
    return owner[rim : rim + shape[0], rim : rim + shape[1]]
