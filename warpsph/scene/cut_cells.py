"""Volumes of the fluid particles beside a body, whose surface cuts the cells of the lattice.

A particle stands for the free part of its own cell, and for that part of the cells without a particle that is nearer to it
than to another. So the particles share exactly the room that the bodies leave, and each has that of its surroundings.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.lattice import Lattice, points_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Distance", "free_volumes", "nearest_body"]

Distance = Callable[["NDArray[np.float64]"], "NDArray[np.float64]"]
"""From points (n, d) to the distance of each from the surface of a body (n,), negative inside it, m."""

_PARTS = {1: 64, 2: 16, 3: 5}
"""Points along each axis of a cell at which it is asked whether it is free, by dimension."""


def nearest_body(distances: Sequence[Distance], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance (n,) of points (n, d) from the nearest of several bodies, m."""
    nearest = np.full(len(points), np.inf)
    for distance in distances:
        np.minimum(nearest, distance(points), out=nearest)
    return nearest


def free_volumes(
    lattice: Lattice,
    periodic: Sequence[bool],
    fluid: NDArray[np.bool_],
    solid: NDArray[np.bool_],
    distances: Sequence[Distance],
) -> NDArray[np.float64]:
    """Volume (n,) of the particle of each cell that holds fluid, in the order of the cells, m^d.

    Args:
        lattice: the cells.
        periodic: per axis, whether it is periodic.
        fluid: which cells of the domain hold a particle.
        solid: which cells of the domain hold none because of a body.
        distances: of the bodies.
    """
    from scipy.spatial import cKDTree

    d = lattice.dimension
    spacing = np.array(lattice.spacing)
    cells = np.nonzero(fluid)
    sites = points_of(lattice.axes(domain_only=True), cells)
    volume = np.full(len(sites), lattice.cell_volume)
    reach = 0.5 * float(np.linalg.norm(spacing)) * (1.0 + 1e-9)  # half the diagonal: a surface beyond it cuts no cell
    cut = np.abs(nearest_body(distances, sites)) < reach
    volume[cut] = 0.0
    empty = points_of(lattice.axes(domain_only=True), np.nonzero(solid & ~fluid))
    empty = empty[nearest_body(distances, empty) > -reach]
    near = np.concatenate([sites[cut], empty])
    if not len(near) or not len(sites):
        return volume

    def wrapped(points: NDArray[np.float64]) -> NDArray[np.float64]:
        extent = spacing * np.array(lattice.count)
        moved = points - np.array(lattice.lower)
        return np.where(periodic, np.mod(moved, extent) % extent, moved)

    period = np.where(periodic, spacing * np.array(lattice.count), 0.0)
    tree = cKDTree(wrapped(sites), boxsize=period)
    parts = _PARTS[d]
    part = lattice.cell_volume / parts**d
    places = [(np.arange(parts) + 0.5) / parts - 0.5] * d
    for offset in itertools.product(*places):
        points = near + np.array(offset) * spacing
        points = points[nearest_body(distances, points) > 0.0]
        _, owner = tree.query(wrapped(points))
        volume += np.bincount(owner, minlength=len(volume)) * part
    return volume
