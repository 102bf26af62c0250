"""Height of a free surface above places: where the smoothed volume of the fluid falls to a half.

    c(x) = sum of V W(x - x_j)  over the fluid, and over its images behind walls at sides of the domain and across periods

is 1 inside of the fluid and 1/2 on a flat surface, which on a lattice is half a spacing above the first row. W is a Wendland
C2 kernel with h = 2 particle spacings: wide enough that the rows of a lattice do not show, and that a particle of spray does
not reach 1/2. Along the line through a place the height is that of the highest point where c = 1/2, at most that of a roof.

A wall at the upper end of the last axis, a roof, is no mirror: the image of a surface below it would add to c in the gap
between both and lift the surface.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from warpsph.measure.gauge import Gauge, Needs
from warpsph.snapshot import FLUID, Snapshot

SMOOTHING = 2.0
"""Smoothing length, in particle spacings; the kernel reaches twice as far."""

NODES = 4
"""Places a particle spacing at which c is evaluated; between them it is a straight line."""

_NORM = {2: 7.0 / (4.0 * math.pi), 3: 21.0 / (16.0 * math.pi)}  # of (1 - q/2)^4 (1 + 2 q), times h^d


def surface_height(
    place: np.ndarray,
    position: np.ndarray,
    volume: np.ndarray,
    mirrors: list[tuple[int, float]],
    spacing: float,
    roof: float = math.inf,
    periods: Sequence[tuple[int, float]] = (),
) -> float:
    """Height of the surface above a place, m; nan where there is no fluid.

    place: (d - 1,) all coordinates but the last, m
    position, volume: of the fluid, (n, d) and (n,), m and m^d
    mirrors: walls at sides but a roof, as (axis, coordinate in m)
    spacing: particle spacing, m
    roof: height of the wall at the upper end of the last axis, m; infinity without one
    periods: axes but the last that are periodic, as (axis, length in m)
    """
    d, h = position.shape[1], SMOOTHING * spacing
    reach = 2.0 * h
    x, v = _across_periods(place, position, volume, periods, reach)
    near = (np.abs(x[:, : d - 1] - place) < reach).all(axis=1)
    x, v = x[near], v[near]
    for axis, side in mirrors:
        if axis == d - 1 or abs(place[axis] - side) < reach:
            close = np.abs(x[:, axis] - side) < 2.0 * reach
            image = x[close].copy()
            image[:, axis] = 2.0 * side - image[:, axis]
            x, v = np.concatenate([x, image]), np.concatenate([v, v[close]])
    across2 = ((x[:, : d - 1] - place) ** 2).sum(axis=1)
    inside = across2 < reach * reach
    x, v, across2 = x[inside], v[inside], across2[inside]
    if not len(x):
        return math.nan
    top, step = float(x[:, -1].max()), spacing / NODES
    highest = min(top + reach, roof)
    heights = highest - step * np.arange(math.ceil((highest - float(x[:, -1].min()) + reach) / step) + 1)
    c = np.zeros(len(heights))
    for k, y in enumerate(heights):
        q = np.sqrt(across2 + (x[:, -1] - y) ** 2) / h
        c[k] = (v * np.maximum(1.0 - 0.5 * q, 0.0) ** 4 * (1.0 + 2.0 * q)).sum() * _NORM[d] / h**d
        if c[k] >= 0.5:
            return float(y + step * (c[k] - 0.5) / (c[k] - c[k - 1])) if k else float(y)
    return math.nan


def _across_periods(
    place: np.ndarray, position: np.ndarray, volume: np.ndarray, periods: Sequence[tuple[int, float]], reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """The fluid where its images nearest to a place are, and the next ones of periods that are narrower than the kernel."""
    x, v = position, volume
    for axis, length in periods:
        x = x.copy()
        x[:, axis] -= length * np.round((x[:, axis] - place[axis]) / length)
        beyond = math.ceil(max(reach / length - 0.5, 0.0))
        shifts = [k * length * np.eye(x.shape[1])[axis] for k in range(-beyond, beyond + 1)]
        x, v = np.concatenate([x + shift for shift in shifts]), np.tile(v, len(shifts))
    return x, v


class ElevationGauge(Gauge):
    """Height of the free surface above given places: a column each."""

    needs = Needs.of(fields=("position", "volume"))

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.places = np.asarray(spec.places, np.float64).reshape(-1, self.dimension - 1)
        self.mirrors = [
            (axis, float(getattr(case.domain, end)[axis]))
            for axis, sides in enumerate(case.sides)
            for end in ("lower", "upper")
            if getattr(sides, end).kind == "wall" and (axis, end) != (self.dimension - 1, "upper")
        ]
        self.periods = [
            (axis, float(case.domain.upper[axis] - case.domain.lower[axis]))
            for axis, sides in enumerate(case.sides[:-1])
            if sides.periodic
        ]
        covered = case.sides[-1].upper.kind == "wall"
        self.roof = float(case.domain.upper[-1]) if covered else math.inf

    def row(self, snapshot: Snapshot) -> list[float]:
        fluid = snapshot.kind == FLUID
        position, volume = snapshot.position[fluid], snapshot.volume[fluid]
        spacing = self.case.particle_spacing
        return [
            surface_height(place, position, volume, self.mirrors, spacing, self.roof, self.periods) for place in self.places
        ]
