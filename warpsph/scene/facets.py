"""Facets: what a particle of the first layer stands for of the surface, one for each face (theory: bodies#arc).

A particle in a corner stands for parts of two or three faces, each with a normal of its own. A facet knows the sums of its
pieces that loads take: with them uniform and linear pressures have exactly the force of the surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.rings import CORNER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.scene.surfaces import Surface

__all__ = ["Facets", "facets_of"]


@dataclass(frozen=True)
class Facets:
    """Parts of a surface without corners, n of them in d dimensions, in the order of their particles.

    owner: (n,), index of the particle of the first layer that stands for it
    foot: (n, d), point of the surface in it, m
    normal: (n, d), unit normal into the fluid there
    area: (n,), its length (2-D) or area (3-D), m^(d-1)
    vector: (n, d), sum of size times normal over its pieces, m^(d-1); over a closed surface it is 0
    moment: (n, d, d), sum of size times normal (x) (middle - foot) over its pieces, m^d
    """

    owner: NDArray[np.intp]
    foot: NDArray[np.float64]
    normal: NDArray[np.float64]
    area: NDArray[np.float64]
    vector: NDArray[np.float64]
    moment: NDArray[np.float64]

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.owner)

    @staticmethod
    def none(dimension: int) -> Facets:
        """No facets."""
        return Facets.plane(np.empty(0, np.intp), np.empty((0, dimension)), np.empty((0, dimension)), np.empty(0))

    @staticmethod
    def plane(
        owner: NDArray[np.intp], foot: NDArray[np.float64], normal: NDArray[np.float64], area: NDArray[np.float64]
    ) -> Facets:
        """Facets that are plane, with their feet in the middle; see `Facets`."""
        n, d = foot.shape
        return Facets(owner, foot, normal, area, area[:, None] * normal, np.zeros((n, d, d)))

    @staticmethod
    def joined(parts: list[Facets]) -> Facets:
        """Several as one."""
        names = ("owner", "foot", "normal", "area", "vector", "moment")
        return Facets(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})

    def rows(self, kept: NDArray[np.bool_]) -> Facets:
        """Some of them, by a mask (n,)."""
        return Facets(
            self.owner[kept], self.foot[kept], self.normal[kept], self.area[kept], self.vector[kept], self.moment[kept]
        )

    def only(self, kept: NDArray[np.bool_]) -> Facets:
        """Those of a part of the particles, by a mask over these; owners are counted anew."""
        rows = self.rows(kept[self.owner])
        return replace(rows, owner=(np.cumsum(kept) - 1)[rows.owner])


def facets_of(
    surface: Surface,
    owner: NDArray[np.intp],
    middle: NDArray[np.float64],
    normal: NDArray[np.float64],
    size: NDArray[np.float64],
    own_foot: NDArray[np.float64],
    own_normal: NDArray[np.float64],
) -> Facets:
    """The facets that pieces of a surface make up: those of one particle that turn by less than a corner are one.

    The facet of a particle that has no other keeps the foot and the normal of its particle; others have the middle of their
    pieces and the mean normal.

    Args:
        surface: of the body.
        owner: (k,), the particle that stands for each piece.
        middle, normal, size: (k, d), m, (k, d) and (k,), m^(d-1), of the pieces.
        own_foot, own_normal: (n, d), of all particles, m.
    """
    d = middle.shape[1]
    found: list[NDArray[np.intp]] = []
    straight = math.cos(CORNER)
    left = np.arange(len(owner))
    while len(left):
        # the first facet of a particle begins with the piece along its normal, the next ones with the first piece left
        rank = np.einsum("ij,ij->i", normal[left], own_normal[owner[left]]) if not found else np.zeros(len(left))
        order = np.lexsort((left, -rank, owner[left]))
        particle, begin = np.unique(owner[left[order]], return_index=True)
        seed = np.zeros((len(own_foot), d))
        seed[particle] = normal[left[order[begin]]]
        same = np.einsum("ij,ij->i", normal[left], seed[owner[left]]) >= straight - 1e-9
        found.append(left[same])
        left = left[~same]
    if not found:
        return Facets.none(d)
    piece = np.concatenate(found)
    number = np.concatenate([np.full(len(rows), k) for k, rows in enumerate(found)])
    _, label = np.unique(owner[piece] * len(found) + number, return_inverse=True)  # by particle, then in the order found

    def total(values: NDArray[np.float64]) -> NDArray[np.float64]:
        result = np.zeros((label.max() + 1, *values.shape[1:]))
        np.add.at(result, label, values)
        return result

    weight = size[piece]
    area, vector = total(weight), total(weight[:, None] * normal[piece])
    holder = np.zeros(len(area), dtype=np.intp)
    holder[label] = owner[piece]
    foot, unit = own_foot[holder].copy(), own_normal[holder].copy()
    direction = vector / np.linalg.norm(vector, axis=1)[:, None]
    moved = np.bincount(holder, minlength=len(own_foot))[holder] > 1
    moved |= np.einsum("ij,ij->i", direction, unit) < straight
    if moved.any():
        foot[moved] = surface.closest((total(weight[:, None] * middle[piece]) / area[:, None])[moved])[0]
        unit[moved] = direction[moved]
    arm = middle[piece] - foot[label]
    moment = total(weight[:, None, None] * normal[piece][:, :, None] * arm[:, None, :])
    return Facets(holder, foot, unit, area, vector, moment)
