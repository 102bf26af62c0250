"""Where a body is thinner than the smoothing kernel needs, so that fluid on one side sees that on the other.

The thickness at a point of the surface is the length of the inward normal up to where it leaves the body again, through a
face that looks the other way; so corners of boxes are not thin.

Rule: outside the tails of plane bodies (`tails.py`), which have boundary particles for each side, a body thinner than one
spacing over more than a spacing of its surface is refused: there are no boundary particles to speak of. Thinner than four
spacings, it is warned of: at most two layers belong to each side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.sheets import beside_sheets
from warpsph.scene.surfaces import Outline, Surface
from warpsph.scene.tails import find_tails

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["REFUSED", "WARNED", "ThinPlaces", "thin_places"]

REFUSED, WARNED = 1.0, 4.0
"""Thickness in spacings below which a body is refused and warned of."""

_OPPOSITE = -0.5
"""Cosine of the angle between the normals of two faces below which they are the two sides of something thin."""

_TOUCH = 1e-3
"""Distance from the surface, in spacings, at which the inward normal has arrived there."""


@dataclass(frozen=True)
class ThinPlaces:
    """Where a body is thin.

    thickness: the least one, m; infinite if none is below `WARNED` spacings
    place: (d,), there, m
    refused, warned: length (2-D) or area (3-D) of surface where the body is thinner than so many spacings, m^(d-1)
    """

    thickness: float
    place: NDArray[np.float64]
    refused: float
    warned: float


def thin_places(surface: Surface, spacing: float, layers: int) -> ThinPlaces:
    """Where a body is thinner than four spacings; the tails of plane bodies, sampled in so many layers, do not count.

    A hollow body is thick everywhere.
    """
    point, normal, size = surface.patches(0.5 * spacing)
    if surface.hollow:
        point, normal, size = point[:0], normal[:0], size[:0]
    if isinstance(surface, Outline):
        tails = find_tails(surface, spacing, layers * spacing)
        kept = ~beside_sheets(tails, point, spacing)
        point, normal, size = point[kept], normal[kept], size[kept]
    thickness = _thickness(surface, point, normal, spacing)
    if not (thickness < WARNED * spacing).any():
        return ThinPlaces(np.inf, surface.bounds.mean(axis=0), 0.0, 0.0)
    least = int(thickness.argmin())
    below = [float(size[thickness < limit * spacing * (1.0 - 1e-6)].sum()) for limit in (REFUSED, WARNED)]
    return ThinPlaces(float(thickness[least]), point[least], below[0], below[1])


def _thickness(
    surface: Surface, point: NDArray[np.float64], normal: NDArray[np.float64], spacing: float
) -> NDArray[np.float64]:
    """Thickness at points of the surface (n,), m; infinite where it is above `WARNED` spacings, or nothing is opposite.

    The way along the normal is gone in steps of the distance from the surface, which cannot cross it.
    """
    way = np.full(len(point), 2.0 * _TOUCH * spacing)
    result = np.full(len(point), np.inf)
    active = np.arange(len(point))
    for _ in range(200):
        if len(active) == 0:
            break
        free = -surface.signed_distance(point[active] - way[active, None] * normal[active])
        # Near its start the way is near the surface that it comes from.
        arrived = (free < _TOUCH * spacing) & (way[active] > 4.0 * _TOUCH * spacing)
        ends = active[arrived]
        if len(ends):
            _, other = surface.closest(point[ends] - way[ends, None] * normal[ends])
            opposite = np.einsum("ij,ij->i", other, normal[ends]) < _OPPOSITE
            result[ends[opposite]] = way[ends[opposite]]
        way[active] += np.maximum(free, _TOUCH * spacing)
        active = active[~arrived & (way[active] < WARNED * spacing * (1.0 + 1e-9))]
    return result
