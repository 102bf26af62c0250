"""Boundary particles of a body: layers along its surface, each particle with its foot on the surface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.shapes import Sphere


@dataclass(frozen=True)
class Sampling:
    """Boundary particles of a body; n of them, d dimensions.

    position: (n, d), m
    normal: (n, d), unit vector from the body into the fluid, at the foot
    depth: (n,), distance from the foot, the nearest point of the surface, m
    area: (n,), area of the surface that a particle of the first layer stands for, 0 for those beneath, m^(d-1)
    volume: (n,), m^d
    leader: (n,) int, index of the particle of the first layer that is nearest to the foot; of itself in the first layer
    measure: volume that the body takes from the domain, m^d
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    depth: NDArray[np.float64]
    area: NDArray[np.float64]
    volume: NDArray[np.float64]
    leader: NDArray[np.int64]
    measure: float

    @property
    def foot(self) -> NDArray[np.float64]:
        """(n, d), the nearest point of the surface, m."""
        return self.position + self.depth[:, None] * self.normal


def circle(shape: Sphere, hollow: bool, spacing: float, layers: int) -> Sampling:
    """Rings of boundary particles of a circle, at depths of half a spacing, one and a half, ..."""
    center, sign = np.array(shape.center), -1.0 if hollow else 1.0
    parts, leader, first = [], [], 0
    for layer in range(layers):
        outer = shape.radius - sign * layer * spacing
        inner = max(outer - sign * spacing, 0.0)
        if outer <= 0.0:
            break
        middle = 0.5 * (outer + inner)
        count = max(1, round(2.0 * math.pi * middle / spacing))
        angle = (np.arange(count) + 0.5 * (layer % 2)) * (2.0 * math.pi / count)
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        area = 2.0 * math.pi * shape.radius / count if layer == 0 else 0.0
        volume = math.pi * abs(outer**2 - inner**2) / count
        depth = np.full(count, abs(shape.radius - middle))
        row = np.ones(count)
        parts.append((center + middle * normal, sign * normal, depth, area * row, volume * row))
        first = first or count
        leader.append(np.round(angle * first / (2.0 * math.pi)).astype(np.int64) % first)
    places, normals, depths, areas, volumes = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Sampling(places, normals, depths, areas, volumes, np.concatenate(leader), sign * math.pi * shape.radius**2)
