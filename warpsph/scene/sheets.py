"""Boundary particles of the sheets of thin tails, see `warpsph/scene/tails.py`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.rings import Rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.scene.tails import Sheet, Tail

__all__ = ["Frames", "SheetRows", "beside_sheets", "frames_of", "sheet_rows"]

_STRAIGHT = 1.5
"""Distance from an edge, in reaches of the kernel, within which lines of sight may pass it; farther away a frame of its
own says which side of the body is which."""

_FAR = 4.0
"""How far beyond a particle the edge of such a frame is, in reaches of the kernel: no line of sight gets there."""


@dataclass(frozen=True)
class Frames:
    """Frames of lines of sight at tails, f of them in d dimensions; lengths in m.

    point: (f, d), along the middle of the tails, about a spacing apart: who is nearest to one is judged by it
    edge, along: (f, d), see `warpsph/scene/tails.py`; far from the edge one that no line of sight passes
    extent: (f,), how far behind the edge the body ends with a nose or a corner; infinite where it does not
    """

    point: NDArray[np.float64]
    edge: NDArray[np.float64]
    along: NDArray[np.float64]
    extent: NDArray[np.float64]

    @property
    def count(self) -> int:
        """Number of frames."""
        return len(self.point)

    @classmethod
    def joined(cls, parts: list[Frames], dimension: int) -> Frames:
        """Several as one."""
        none = np.empty((0, dimension))
        point, edge, along = (
            np.concatenate([none, *(getattr(part, name) for part in parts)]) for name in ("point", "edge", "along")
        )
        return cls(point, edge, along, np.concatenate([np.empty(0), *(part.extent for part in parts)]))


@dataclass(frozen=True)
class SheetRows:
    """The n particles of one sheet; lengths in m.

    position, foot, normal: (n, 2)
    volume, layer: (n,)
    real: (n,), whether the foot is on the surface; past the edge it is on its continuation
    """

    position: NDArray[np.float64]
    foot: NDArray[np.float64]
    normal: NDArray[np.float64]
    volume: NDArray[np.float64]
    layer: NDArray[np.intp]
    real: NDArray[np.bool_]


def beside_sheets(tails: list[Tail], foot: NDArray[np.float64], spacing: float) -> NDArray[np.bool_]:
    """Which feet (n, 2) of particles in the layers of a body are on a tail, so that sheets stand for these particles."""
    import shapely

    found = np.zeros(len(foot), dtype=np.bool_)
    points = shapely.points(foot)
    for tail in tails:
        lines = [sheet.point for sheet in tail.sheets]
        if np.any(tail.base[0] != tail.base[1]):
            lines.append(tail.base)
        for line in lines:
            found |= shapely.distance(points, shapely.LineString(line)) < 0.02 * spacing
    return found


def sheet_rows(tail: Tail, sheet: Sheet, others: Rows, spacing: float, layers: int) -> SheetRows:
    """The particles of a sheet: rows parallel to its side, from where the layers of the body end to past the edge.

    others: the particles of the layers of the body, without those in tails
    """
    parts = []
    for m in range(layers):
        depth = (m + 0.5) * spacing
        line = sheet.point - depth * sheet.normal
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        at, step = _places(float(arc[-1]), _gap(line[-1], others, m, spacing), spacing)
        inner = [np.stack([np.interp(at, arc, column[:, k]) for k in range(2)], axis=1) for column in (line, sheet.normal)]
        inner[1] /= np.linalg.norm(inner[1], axis=1)[:, None]
        outer = _past_edge(tail, sheet, line[0], depth, spacing, layers)
        position = np.concatenate([inner[0], outer])
        normal = np.concatenate([inner[1], np.broadcast_to(sheet.normal[0], outer.shape)])
        volume = np.concatenate([np.full(len(at), step), np.full(len(outer), spacing)]) * spacing
        real = np.arange(len(position)) < len(at)
        parts.append((position, position + depth * normal, normal, volume, np.full(len(position), m), real))
    return SheetRows(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _gap(end: NDArray[np.float64], others: Rows, layer: int, spacing: float) -> float:
    """Distance from the end of a row to the nearest particle of the same layer of the body; 0 if none is near."""
    own = others.position[others.layer == layer]
    distance = float(np.linalg.norm(own - end, axis=1).min(initial=np.inf))
    return distance if distance < 1.5 * spacing else 0.0


def _places(length: float, gap: float, spacing: float) -> tuple[NDArray[np.float64], float]:
    """Places along a row from the edge, and their distance, m: evenly up to its end, or to the particle behind the gap."""
    if gap == 0.0:
        n = max(1, round(length / spacing))
        step = length / n
    else:
        # The last one is a step from the particle behind the gap, or at the end of the row if that is farther.
        behind = min(gap, spacing)
        n = max(1, round((length + behind) / spacing - 0.5))
        step = (length + behind) / (n + 0.5)
    return np.asarray((np.arange(n) + 0.5) * step, dtype=np.float64), step


def _past_edge(
    tail: Tail, sheet: Sheet, start: NDArray[np.float64], depth: float, spacing: float, layers: int
) -> NDArray[np.float64]:
    """The particles of a row past the edge, as far as the kernel reaches, where the body hides what is there."""
    way = sheet.point[0] - sheet.point[1]
    way = way / np.linalg.norm(way)
    points = start + (np.arange(layers) + 0.5)[:, None] * spacing * way
    across = np.array([-tail.along[1], tail.along[0]])
    return points[sheet.side * ((points - tail.edge) @ across) < 0.0]


def frames_of(tail: Tail, spacing: float, reach: float) -> Frames:
    """The frames of a tail: that of its edge as far as lines of sight may pass it, then ones along the middle of the body.

    reach: of the smoothing kernel, m
    """
    from scipy.spatial import cKDTree

    one, other = sorted(tail.sheets, key=lambda sheet: -sheet.arc[-1])
    near = np.arange(0.0, min(_STRAIGHT * reach, one.arc[-1]) + 1e-9, spacing)
    points = tail.edge - near[:, None] * tail.along
    at = np.arange(_STRAIGHT * reach, one.arc[-1], spacing)
    foot = np.stack([np.interp(at, one.arc, one.point[:, k]) for k in range(2)], axis=1)
    opposite = other.point[cKDTree(other.point).query(foot)[1]] if len(at) else foot
    across = one.side * (foot - opposite)
    across = across / np.maximum(np.linalg.norm(across, axis=1), 1e-300)[:, None]
    along = np.stack([across[:, 1], -across[:, 0]], axis=1)
    middle = 0.5 * (foot + opposite)
    edges = np.concatenate([np.tile(tail.edge, (len(points), 1)), middle + _FAR * reach * along])
    ways = np.concatenate([np.tile(tail.along, (len(points), 1)), along])
    extent = np.full(len(edges), np.inf)
    if not one.goes_on and not other.goes_on:
        extent = np.einsum("ij,ij->i", edges - 0.5 * (one.point[-1] + other.point[-1]), ways)
    return Frames(np.concatenate([points, middle]), edges, ways, extent)
