"""Volumes of the fluid particles beside a body, whose surface cuts the cells of the lattice.

A particle stands for the free part of its own cell, and for that part of the cells without a particle that is nearer to it
than to another, and is in the middle of both together. So the particles share exactly the room that the bodies leave, each
has that of its surroundings, and the sums over them find no gap before the surface.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.lattice import Lattice, points_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Distance", "cut_places", "nearest_body"]

Distance = Callable[["NDArray[np.float64]"], "NDArray[np.float64]"]
"""From points (n, d) to the distance of each from the surface of a body (n,), negative inside it, m."""

_PARTS = {1: 64, 2: 16, 3: 5}
"""Points along each axis of a cell at which it is asked whether it is free, by dimension."""


_FAR = 1.5
"""Spacings from a particle beyond which room beside a body is not its own but empty, as around a body in the air."""


def nearest_body(distances: Sequence[Distance], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance (n,) of points (n, d) from the nearest of several bodies, m."""
    nearest = np.full(len(points), np.inf)
    for distance in distances:
        np.minimum(nearest, distance(points), out=nearest)
    return nearest


def cut_places(
    lattice: Lattice,
    periodic: Sequence[bool],
    fluid: NDArray[np.bool_],
    solid: NDArray[np.bool_],
    distances: Sequence[Distance],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Way (n, d), m, of the particle of each cell with fluid from its middle, and its volume over that of the cell (n,).

    Args:
        lattice: the cells.
        periodic: per axis, whether it is periodic.
        fluid: which cells of the domain hold a particle.
        solid: which cells of the domain hold none because of a body.
        distances: of the bodies.
    """
    from scipy.spatial import cKDTree

    d = lattice.dimension
    spacing, lower = np.array(lattice.spacing), np.array(lattice.lower)
    extent = spacing * np.array(lattice.count)
    sites = points_of(lattice.axes(domain_only=True), np.nonzero(fluid))
    reach = 0.5 * float(np.linalg.norm(spacing)) * (1.0 + 1e-9)  # half the diagonal: a surface beyond it cuts no cell
    cut = np.abs(nearest_body(distances, sites)) < reach
    empty = points_of(lattice.axes(domain_only=True), np.nonzero(solid & ~fluid))
    empty = empty[nearest_body(distances, empty) > -reach]
    near = np.concatenate([sites[cut], empty])
    volume, way = np.where(cut, 0.0, 1.0), np.zeros_like(sites)
    if not len(near) or not len(sites):
        return way, volume

    def wrapped(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(periodic, np.mod(points - lower, extent) % extent, points - lower)

    tree = cKDTree(wrapped(sites), boxsize=np.where(periodic, extent, 0.0))
    parts = _PARTS[d]
    for offset in itertools.product(*[(np.arange(parts) + 0.5) / parts - 0.5] * d):
        points = near + np.array(offset) * spacing
        points = points[nearest_body(distances, points) > 0.0]
        _, owner = tree.query(wrapped(points), distance_upper_bound=_FAR * float(spacing.max()))
        points, owner = points[owner < len(sites)], owner[owner < len(sites)]
        off = points - sites[owner]
        off -= np.where(periodic, np.round(off / extent) * extent, 0.0)
        volume += np.bincount(owner, minlength=len(volume)) / parts**d
        for axis in range(d):
            way[:, axis] += np.bincount(owner, weights=off[:, axis], minlength=len(volume)) / parts**d
    return way / np.maximum(volume, 1e-3)[:, None], volume
