"""Boundary particles of a body: where they are, and what the surface is to each of them (theory: bodies#sampling).

Layers parallel to the surface, half a spacing deep and then one spacing apart, as many as the smoothing kernel reaches. A
body fills its layers exactly: the volumes of the particles add up to the volume of the layers. A straight body whose
faces lie between cells of the lattice gets the cells of the lattice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.rings import Rows, ball_rings, outline_rings
from warpsph.scene.shells import ball_shells, brick_shells, relaxed_shells
from warpsph.scene.surfaces import Ball, Brick, Hollow, Outline, Surface

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["Sampling", "sample"]

_PATCHES = {2: 16, 3: 4}
"""Patches of the surface a spacing, by dimension, that are shared among the particles of the first layer."""


@dataclass(frozen=True)
class Sampling:
    """The boundary particles of a body: n of them in d dimensions.

    position: (n, d), m
    foot: (n, d), the point of the surface nearest to each, m
    normal: (n, d), unit normal of the surface there, into the fluid
    depth: (n,), distance of the particle from its foot, m; position + depth normal = foot
    area: (n,), length (2-D) or area (3-D) of surface that a particle of the first layer stands for, m^(d-1); 0 below it
    volume: (n,), m^d
    layer: (n,), 0 at the surface
    leader: (n,), index of the particle of the first layer nearest to the foot
    """

    position: NDArray[np.float64]
    foot: NDArray[np.float64]
    normal: NDArray[np.float64]
    depth: NDArray[np.float64]
    area: NDArray[np.float64]
    volume: NDArray[np.float64]
    layer: NDArray[np.intp]
    leader: NDArray[np.intp]

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self.depth)

    def only(self, kept: NDArray[np.bool_]) -> Sampling:
        """A part of the particles (n,); those whose leader goes get the nearest one of the first layer that stays.

        What has no particle of the first layer left goes as well.
        """
        from scipy.spatial import cKDTree

        first = np.flatnonzero(kept & (self.layer == 0))
        if len(first) == 0:
            kept = np.zeros_like(kept)
        new_row = np.cumsum(kept) - 1
        leader = self.leader.copy()
        lost = kept & ~kept[leader]
        if lost.any():
            leader[lost] = first[cKDTree(self.position[first]).query(self.foot[lost])[1]]
        columns = {name: getattr(self, name)[kept] for name in self.__dataclass_fields__ if name != "leader"}
        return replace(self, leader=new_row[leader[kept]], **columns)


def sample(
    surface: Surface,
    spacing: float,
    layers: int,
    lower: Sequence[float] | None = None,
    upper: Sequence[float] | None = None,
) -> Sampling:
    """The boundary particles of a body.

    Args:
        surface: of the body.
        spacing: particle spacing, m.
        layers: how many; with enough of them the body is full.
        lower, upper: only particles and surface between these corners count, m; None: all.
    """
    rows = layers_of(surface, spacing, layers)
    low = np.full(surface.dimension, -np.inf) if lower is None else np.asarray(lower, dtype=np.float64)
    high = np.full(surface.dimension, np.inf) if upper is None else np.asarray(upper, dtype=np.float64)
    kept = np.all((rows.position > low) & (rows.position < high), axis=1)
    return described(surface, Rows(rows.position[kept], rows.volume[kept], rows.layer[kept]), spacing, low, high)


def layers_of(surface: Surface, spacing: float, layers: int) -> Rows:
    """The particles of the layers of a body, without what the surface is to them."""
    hollow = isinstance(surface, Hollow)
    shape = surface.shape if isinstance(surface, Hollow) else surface
    if isinstance(shape, Ball):
        make = ball_rings if shape.dimension == 2 else ball_shells
        return make(shape, spacing, layers, hollow)
    if isinstance(shape, Outline):
        return outline_rings(shape, spacing, layers, hollow)
    if isinstance(shape, Brick):
        return brick_shells(shape, spacing, layers, hollow)
    return relaxed_shells(surface, spacing, layers)


def described(
    surface: Surface, rows: Rows, spacing: float, low: NDArray[np.float64], high: NDArray[np.float64]
) -> Sampling:
    """Particles with their feet, normals, shares of the surface between two corners, and leaders."""
    from scipy.spatial import cKDTree

    foot, normal = surface.closest(rows.position)
    n = len(rows.position)
    first = np.flatnonzero(rows.layer == 0)
    area = np.zeros(n)
    leader = np.zeros(n, dtype=np.intp)
    if len(first):
        tree = cKDTree(rows.position[first])
        middle, _, size = surface.patches(spacing / _PATCHES[surface.dimension])
        held = np.all((middle >= low) & (middle <= high), axis=1)
        owner = first[tree.query(middle[held])[1]]
        area[:] = np.bincount(owner, size[held], minlength=n)
        leader = first[tree.query(foot)[1]]
        leader[first] = first
    return Sampling(
        position=rows.position,
        foot=foot,
        normal=normal,
        depth=np.linalg.norm(rows.position - foot, axis=1),
        area=area,
        volume=rows.volume,
        layer=rows.layer,
        leader=leader,
    )
