"""Layers of boundary particles in a body of any shape, in 3-D: shells at the depths (m + 1/2) spacings.

A sphere gets spirals of even density, a box the cells of a lattice, any other body particles that are moved apart on the
surfaces at equal distance from its own until they are even (`relaxed_shells`; it works in 2-D as well).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.rings import NEAREST, Rows, merged
from warpsph.scene.surfaces import Ball, Brick, Surface, fibonacci

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ball_shells", "brick_shells", "relaxed_shells"]

_ROUNDS = 60
"""Moves of the particles of a shell: after 40 the spread of the distances to the nearest no longer falls."""

_STEP = 0.25
"""Longest move along a shell in one round, in spacings."""

_FINE = {2: 12, 3: 4}
"""Points a spacing along each axis of the grid on which volumes of shells are counted, by dimension."""


def ball_shells(ball: Ball, spacing: float, layers: int, outwards: bool) -> Rows:
    """Shells about the centre of a sphere; `outwards` for a body around it."""
    parts = []
    for m in range(layers):
        depth = (m + 0.5) * spacing
        radius = ball.radius + depth if outwards else ball.radius - depth
        if radius < -0.5 * spacing:
            break
        outer, inner = radius + 0.5 * spacing, max(radius - 0.5 * spacing, 0.0)
        volume = 4.0 / 3.0 * math.pi * (outer**3 - inner**3)
        n = max(1, round(volume / spacing**3))
        if radius < 0.5 * spacing:
            n = 1
        points = radius * fibonacci(n) if n > 1 else np.zeros((1, 3))
        parts.append(Rows(ball.center + points, np.full(n, volume / n), np.full(n, m, dtype=np.intp)))
    return merged(Rows.joined(parts, 3), spacing)


def brick_shells(brick: Brick, spacing: float, layers: int, outwards: bool) -> Rows:
    """The outermost cells of a box divided into cells about a spacing wide; `outwards` for the cells around it."""
    lower, upper = brick.bounds
    count = np.maximum(1, np.rint((upper - lower) / spacing)).astype(np.intp)
    width = (upper - lower) / count
    first = -layers if outwards else 0
    index = np.indices(count + (2 * layers if outwards else 0)).reshape(3, -1).T + first
    beyond = np.maximum(-index, index - count + 1)  # layers outside, 0 or less within
    layer = beyond.max(axis=1) - 1 if outwards else -beyond.max(axis=1)
    index, layer = index[(layer >= 0) & (layer < layers)], layer[(layer >= 0) & (layer < layers)]
    position = lower + (index + 0.5) * width
    return Rows(position, np.full(len(index), float(width.prod())), layer.astype(np.intp))


def relaxed_shells(surface: Surface, spacing: float, layers: int) -> Rows:
    """Shells of a body of any shape, hollow or not.

    Sites of a lattice within half a spacing of a shell are drawn onto it along the normal, which gives about the right
    number; then they repel each other along the shell. What is left in the middle of the body beyond the last shell is
    given to it.
    """
    d = surface.dimension
    reach = layers * spacing if surface.hollow else 0.0
    sites, distance = _near_sites(surface, spacing, reach, layers)
    parts = []
    for m in range(layers):
        depth = (m + 0.5) * spacing
        band = sites[np.abs(distance + depth) <= 0.5 * spacing]
        if len(band) == 0:
            continue
        points = _relax(surface, _onto(surface, band, depth), depth, spacing)
        parts.append(Rows(points, np.zeros(len(points)), np.full(len(points), m, dtype=np.intp)))
    rows = merged(Rows.joined(parts, d), spacing)
    return Rows(rows.position, _counted_volumes(surface, rows, spacing, reach, layers), rows.layer)


def _near_sites(
    surface: Surface, spacing: float, reach: float, layers: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The sites of a lattice in the layers of a body (n, d) and their signed distances (n,)."""
    low, high = surface.bounds[0] - reach, surface.bounds[1] + reach
    axes = [np.arange(a + 0.5 * spacing, b + 0.5 * spacing, spacing) for a, b in zip(low, high, strict=True)]
    sites = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, surface.dimension)
    distance = surface.signed_distance(sites)
    kept = (distance <= 0.0) & (distance >= -layers * spacing)
    return sites[kept], distance[kept]


def _onto(surface: Surface, points: NDArray[np.float64], depth: float) -> NDArray[np.float64]:
    """Points moved along the normal to a depth; those that it does not bring there, in the middle of a body, are left
    out."""
    for _ in range(4):
        foot, normal = surface.closest(points)
        points = foot - depth * normal
    kept = np.abs(surface.signed_distance(points) + depth) < 0.02 * depth
    return points[kept]


def _relax(surface: Surface, points: NDArray[np.float64], depth: float, spacing: float) -> NDArray[np.float64]:
    """Points of a shell moved apart along it; those nearer than `NEAREST` spacings to another in the end go."""
    from scipy.spatial import cKDTree

    for k in range(_ROUNDS):
        pairs = cKDTree(points).query_pairs(1.6 * spacing, output_type="ndarray")
        if len(pairs) == 0:
            break
        apart = points[pairs[:, 0]] - points[pairs[:, 1]]
        length = np.maximum(np.linalg.norm(apart, axis=1), 1e-3 * spacing)
        push = apart * ((1.0 - length / (1.6 * spacing)) ** 2 / length)[:, None] * spacing
        way = np.zeros_like(points)
        for side, sign in ((0, 1.0), (1, -1.0)):
            for axis in range(points.shape[1]):
                way[:, axis] += sign * np.bincount(pairs[:, side], push[:, axis], minlength=len(points))
        norm = np.linalg.norm(way, axis=1)
        way *= np.minimum(1.0, _STEP * spacing / np.maximum(norm, 1e-300))[:, None] * (1.0 - 0.7 * k / _ROUNDS)
        foot, normal = surface.closest(points + way)
        moved = foot - depth * normal
        if k == _ROUNDS // 2:
            moved = _without_close(moved, spacing)
        points = moved
    return _without_close(_onto(surface, points, depth), spacing)


def _without_close(points: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Points without one of each pair nearer than `NEAREST` spacings."""
    from scipy.spatial import cKDTree

    gone = np.zeros(len(points), dtype=np.bool_)
    for i, j in cKDTree(points).query_pairs(NEAREST * spacing):
        if not gone[i] and not gone[j]:
            gone[j] = True
    return points[~gone]


def _counted_volumes(
    surface: Surface, rows: Rows, spacing: float, reach: float, layers: int
) -> NDArray[np.float64]:
    """Volume of each particle: the part of its layer that is nearest to it, counted on a fine grid; m^d.

    A body that its layers fill gets its exact volume.
    """
    from scipy.spatial import cKDTree

    d, fine = surface.dimension, spacing / _FINE[surface.dimension]
    low, high = surface.bounds[0] - reach, surface.bounds[1] + reach
    axes = [np.arange(a + 0.5 * fine, b + 0.5 * fine, fine) for a, b in zip(low, high, strict=True)]
    volume = np.zeros(len(rows.position))
    tree = cKDTree(rows.position)
    deepest = 0.0
    for x in axes[0]:  # slice by slice, so that the grid needs no memory
        plane = np.stack(np.meshgrid([x], *axes[1:], indexing="ij"), axis=-1).reshape(-1, d)
        near = tree.query(plane, distance_upper_bound=2.0 * spacing)
        plane, owner = plane[np.isfinite(near[0])], near[1][np.isfinite(near[0])]
        distance = surface.signed_distance(plane)
        deepest = min(deepest, float(distance.min(initial=0.0)))
        held = (distance < 0.0) & (distance >= -layers * spacing)
        volume += np.bincount(owner[held], minlength=len(volume)) * fine**d
    full = not surface.hollow and deepest > -layers * spacing
    return volume * (surface.measure / volume.sum()) if full and volume.sum() > 0.0 else volume
