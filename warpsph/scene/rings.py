"""Layers of boundary particles in a plane body: lines parallel to its outline, cut into equal pieces.

Layer m is the band of the body between the depths m and m + 1 spacings; its particles stand on the line at the depth m +
1/2. That line keeps the corners of the outline, and a corner has a particle of its own: so a box whose sides are
multiples of the spacing gets the cells of the lattice. What a band has beyond a spacing of its line, a narrow rest in the
middle of a body, is filled with particles about evenly (`_fill`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.scene.surfaces import Ball, Outline

__all__ = ["Rows", "ball_rings", "outline_rings"]

CORNER = math.radians(30.0)
"""Turn of a line at a point above which the point is a corner and gets a particle."""

MITRE = 1.5
"""Farthest point of a parallel line from a corner, in depths: 1.41 keeps right angles, sharper ones are cut off."""

NEAREST = 0.6
"""Spacings below which two particles of a body become one."""

SMALLEST = 0.3
"""Volume, in cells, below which a rest is given to its neighbours instead of a particle of its own."""

DIGITS = 2.0**-32
"""Spacings that corners are rounded to, well below what is the same place (`SAME` of `body_surfaces`)."""


@dataclass(frozen=True)
class Rows:
    """Particles of layers: position (n, d), m; volume (n,), m^d; layer (n,), 0 at the surface."""

    position: NDArray[np.float64]
    volume: NDArray[np.float64]
    layer: NDArray[np.intp]

    @classmethod
    def joined(cls, parts: list[Rows], dimension: int) -> Rows:
        """Several as one."""
        parts = [cls(np.empty((0, dimension)), np.empty(0), np.empty(0, dtype=np.intp)), *parts]
        return cls(
            np.concatenate([part.position for part in parts]),
            np.concatenate([part.volume for part in parts]),
            np.concatenate([part.layer for part in parts]),
        )


def ball_rings(ball: Ball, spacing: float, layers: int, outwards: bool) -> Rows:
    """Rings about the centre of a circle; `outwards` for a body around it."""
    parts = []
    for m in range(layers):
        depth = (m + 0.5) * spacing
        radius = ball.radius + depth if outwards else ball.radius - depth
        if radius < -0.5 * spacing:
            break
        outer, inner = radius + 0.5 * spacing, max(radius - 0.5 * spacing, 0.0)
        area = math.pi * (outer**2 - inner**2)
        # The innermost disc of less than a spacing across: one particle in the centre.
        n = round(2.0 * math.pi * radius / spacing) if radius > 0.25 * spacing else 1
        if n < 3:
            n = 1
        angle = 2.0 * math.pi * (np.arange(n) + 0.5 * (m % 2)) / n
        ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) if n > 1 else np.zeros((1, 2))
        parts.append(Rows(ball.center + ring, np.full(n, area / n), np.full(n, m, dtype=np.intp)))
    return merged(Rows.joined(parts, 2), spacing)


def outline_rings(outline: Outline, spacing: float, layers: int, outwards: bool) -> Rows:
    """Lines parallel to an outline; `outwards` for a body around it.

    They are drawn from its lower corner, in `DIGITS`, so that rounding does not choose other places for the same body
    elsewhere.
    """
    import shapely

    origin, digit = outline.bounds[0], DIGITS * spacing
    region = shapely.transform(outline.region, lambda corners: np.rint((corners - origin) / digit) * digit)
    parts: list[Rows] = []
    lost = []
    sign = 1.0 if outwards else -1.0
    near = region
    for m in range(layers):
        far = _parallel(region, sign * (m + 1) * spacing)
        band = far.difference(near) if outwards else near.difference(far)
        line = _parallel(region, sign * (m + 0.5) * spacing)
        rows = _band(band, line, spacing, m)
        if len(rows.position) == 0 and parts:
            lost.append(band)
        else:
            parts.append(rows)
        near = far
        if near.is_empty:
            break
    rows = merged(Rows.joined(parts, 2), spacing)
    for band in lost:
        rows.volume[:] += _shares(band, rows.position, spacing)
    return replace(rows, position=rows.position + origin)


def _parallel(region: Any, distance: float) -> Any:
    """The region whose border is that of `region` moved out by `distance`, m, with its corners."""
    return region.buffer(distance, join_style="mitre", mitre_limit=MITRE)


def _band(band: Any, line: Any, spacing: float, layer: int) -> Rows:
    """The particles of one band: those on its line, and those of what the line does not reach.

    None if the band is too small for one, unless it is the first: its volume then goes to those around it.
    """
    import shapely

    found = [_along(np.asarray(shapely.get_coordinates(ring)), spacing) for ring in _border(line)]
    length = sum(float(part[1].sum()) for part in found)
    if abs(length * spacing - band.area) < 1e-9 * band.area:
        position, share = (np.concatenate(column) for column in zip(*found, strict=True))
        return Rows(position, share * (band.area / length), np.full(len(position), layer, dtype=np.intp))
    # The line has lost a side: where the body is narrow the band is more or less than a spacing of its line.
    places = [part[0] for part in found]
    shares = [part[1] * spacing for part in found]
    reached = line.boundary.buffer(0.5 * spacing, join_style="mitre", mitre_limit=2.0) if found else shapely.Polygon()
    for piece in shapely.get_parts(band.difference(reached.buffer(0.01 * spacing))):
        if piece.area > SMALLEST * spacing**2:
            places.append(_fill(piece, max(round(piece.area / spacing**2), 1), spacing))
            shares.append(np.zeros(len(places[-1])))
    if not places and layer == 0:
        places.append(np.array([shapely.get_coordinates(band.representative_point())[0]]))
        shares.append(np.zeros(1))
    if not places:
        return Rows(np.empty((0, 2)), np.empty(0), np.empty(0, dtype=np.intp))
    position, share = np.concatenate(places), np.concatenate(shares)
    odd = [part for part in shapely.get_parts(band.symmetric_difference(reached)) if part.area > 1e-4 * spacing**2]
    near = shapely.distance(shapely.points(position), shapely.union_all(odd)) < 1.5 * spacing if odd else share == 0.0
    near |= share == 0.0
    volume = np.where(near, 0.0, share)
    if near.any():
        counted = _shares(band, position, spacing, near)
        left = band.area - volume.sum()
        if left > 0.0:
            volume += counted * (left / counted.sum())
        else:  # what the pieces of the line stand for overlaps: all of them share
            volume = _shares(band, position, spacing)
            volume *= band.area / volume.sum()
    else:
        volume *= band.area / volume.sum()
    return Rows(position, volume, np.full(len(position), layer, dtype=np.intp))


def _shares(
    region: Any, position: NDArray[np.float64], spacing: float, near: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """The part of a region that is nearest to each of `position` (n, 2), counted on a fine grid, m^2.

    Only of those that are `near` (n,), and then within 1.5 spacings of them; without it of all, and the whole region.
    """
    import shapely
    from scipy.spatial import cKDTree

    if len(position) == 0:
        return np.empty(0)
    step = spacing / 16.0
    if near is None:
        grid = _grid_in(region, step)
    else:
        around = np.stack(np.meshgrid(*[np.arange(-24, 25)] * 2), axis=-1).reshape(-1, 2)
        sites = np.unique((np.rint(position[near] / step).astype(np.int64)[:, None] + around).reshape(-1, 2), axis=0)
        grid = (sites + 0.5) * step
        shapely.prepare(region)
        grid = grid[shapely.contains_xy(region, grid[:, 0], grid[:, 1])]
    count = np.bincount(cKDTree(position).query(grid)[1], minlength=len(position))
    if near is None:
        return np.asarray(count * (region.area / len(grid)))
    return np.where(near, count * step**2, 0.0)


def _grid_in(region: Any, step: float) -> NDArray[np.float64]:
    """Points of a square grid in a region (n, 2), at least one."""
    import shapely

    low, high = np.array(region.bounds).reshape(2, 2)
    x, y = (
        grid.ravel()
        for grid in np.meshgrid(*(np.arange(a + 0.5 * step, b, step) for a, b in zip(low, high, strict=True)), indexing="ij")
    )
    shapely.prepare(region)
    held = shapely.contains_xy(region, x, y)
    if not held.any():
        return np.array([shapely.get_coordinates(region.representative_point())[0]])
    return np.stack([x[held], y[held]], axis=1)


def _border(region: Any) -> list[Any]:
    """All closed lines of the border of a region."""
    import shapely

    return [ring for part in shapely.get_parts(region) if not part.is_empty
            for ring in (part.exterior, *part.interiors)]


def _along(ring: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points on a closed line (k, 2) about a spacing apart, one at each corner, and the length each stands for."""
    points = ring[:-1]
    way = np.roll(points, -1, axis=0) - points
    length = np.linalg.norm(way, axis=1)
    keep = length > 1e-9 * length.sum()
    points, way, length = points[keep], way[keep], length[keep]
    if length.sum() < spacing:
        return points.mean(axis=0)[None], np.array([length.sum()])
    corners = _corners(way, length, spacing)
    if len(corners) == 0:
        corners = np.array([0])
    points, length = np.roll(points, -corners[0], axis=0), np.roll(length, -corners[0])
    corners = corners - corners[0]
    arc = np.concatenate([[0.0], np.cumsum(length)])
    closed = np.concatenate([points, points[:1]])
    ends = np.append(arc[corners], arc[-1])
    places, share = [], []
    for a, b in zip(ends[:-1], ends[1:], strict=True):
        n = max(1, round((b - a) / spacing))
        places.append(a + (b - a) / n * np.arange(n))
        share.append(np.full(n, (b - a) / n))
    at, step = np.concatenate(places), np.concatenate(share)
    # A particle stands for half of the pieces on its two sides.
    return _interpolated(arc, closed, at), 0.5 * (step + np.roll(step, 1))


def _corners(way: NDArray[np.float64], length: NDArray[np.float64], spacing: float) -> NDArray[np.intp]:
    """Points of a closed line at which it turns by more than `CORNER`, at least half a spacing from each other."""
    angle = np.arctan2(way[:, 1], way[:, 0])
    turn = np.abs((angle - np.roll(angle, 1) + np.pi) % (2.0 * np.pi) - np.pi)
    chosen: list[int] = []
    arc = np.cumsum(length) - length
    for k in np.flatnonzero(turn > CORNER):
        if not chosen or arc[k] - arc[chosen[-1]] > NEAREST * spacing:
            chosen.append(int(k))
    if len(chosen) > 1 and arc[-1] + length[-1] - arc[chosen[-1]] + arc[chosen[0]] < NEAREST * spacing:
        chosen.pop()
    return np.array(chosen, dtype=np.intp)


def _interpolated(
    arc: NDArray[np.float64], points: NDArray[np.float64], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points of a line (k, 2), whose lengths from its start are `arc`, at the lengths `at`."""
    return np.stack([np.interp(at, arc, points[:, k]) for k in range(2)], axis=1)


def _fill(piece: Any, count: int, spacing: float) -> NDArray[np.float64]:
    """`count` points evenly in a region: the centres of its parts nearest to each (Lloyd's iteration on a fine grid)."""
    import shapely
    from scipy.spatial import cKDTree

    if count == 1:
        return np.array([shapely.get_coordinates(piece.centroid)[0]])
    grid = _grid_in(piece, spacing / 8.0)
    if len(grid) < count:
        return grid[:1]
    low, high = np.array(piece.bounds).reshape(2, 2)
    # Begin with points evenly along the longer side of the piece.
    order = np.argsort(grid[:, int((high - low).argmax())], kind="stable")
    centre = grid[order[((np.arange(count) + 0.5) * len(grid) / count).astype(np.intp)]]
    for _ in range(30):
        owner = cKDTree(centre).query(grid)[1]
        weight = np.bincount(owner, minlength=count)
        sums = np.stack([np.bincount(owner, grid[:, k], minlength=count) for k in range(2)], axis=1)
        centre = np.where(weight[:, None] > 0, sums / np.maximum(weight, 1)[:, None], centre)
    return centre


def merged(rows: Rows, spacing: float) -> Rows:
    """Rows in which no two particles are nearer than `NEAREST` spacings: such pairs become one in their middle.

    The one has the volume of both and the layer nearer to the surface. The nearest pair is the first.
    """
    from scipy.spatial import cKDTree

    position, volume, layer = rows.position.copy(), rows.volume.copy(), rows.layer.copy()
    while len(position) > 1:
        pairs = cKDTree(position).query_pairs(NEAREST * spacing * (1.0 - 1e-9), output_type="ndarray")
        if len(pairs) == 0:
            break
        distance = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1)
        gone = np.zeros(len(position), dtype=np.bool_)
        touched = np.zeros(len(position), dtype=np.bool_)
        for i, j in pairs[np.lexsort((pairs[:, 1], pairs[:, 0], distance))]:
            if touched[i] or touched[j]:
                continue
            touched[[i, j]] = True
            both = volume[i] + volume[j]
            share = volume[i] / both if both > 0.0 else 0.5
            position[i] = share * position[i] + (1.0 - share) * position[j]
            volume[i], layer[i] = both, min(layer[i], layer[j])
            gone[j] = True
        position, volume, layer = position[~gone], volume[~gone], layer[~gone]
    return Rows(position, volume, layer)
