"""Gauges of drops: how far they are deformed and which way they lie, and into which pieces they have broken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from warpsph.measure.gauge import Gauge, Needs
from warpsph.measure.totals import behind_cuts, cut_of
from warpsph.snapshot import Snapshot


@dataclass(frozen=True)
class Ellipsoid:
    """The ellipse (3-D: ellipsoid) with the second moments of a patch of fluid."""

    semi_axes: np.ndarray
    """(d,) from the longest to the shortest [m]"""
    directions: np.ndarray
    """(d, d) their unit vectors, one a row; the first component that is not 0 is positive"""

    @property
    def deformation(self) -> float:
        """D = (L - B)/(L + B) of the longest and the shortest axis."""
        longest, shortest = float(self.semi_axes[0]), float(self.semi_axes[-1])
        return (longest - shortest) / (longest + shortest)


def ellipsoid(position: np.ndarray, volume: np.ndarray) -> Ellipsoid:
    """Return the ellipse or ellipsoid with the second moments of particles (theory: riemann#drops).

    A particle counts as a square (cube) of its volume, whose own second moment is volume^(2/d)/12. Of a filled ellipsoid the
    mean of x^2 along a semi-axis a is a^2/(d + 2).

    position: (n, d) in one piece [m]; volume: (n,) [m^d]. All is nan without particles or where one is not finite.
    """
    dimension = position.shape[1]
    if not len(position) or not np.isfinite(position).all() or not np.isfinite(volume).all():
        return Ellipsoid(np.full(dimension, math.nan), np.full((dimension, dimension), math.nan))
    weight = volume / volume.sum()
    offset = position - weight @ position
    moment = (weight[:, None] * offset).T @ offset
    moment += np.eye(dimension) * (weight @ volume ** (2.0 / dimension)) / 12.0
    squares, vectors = np.linalg.eigh(moment)
    directions = vectors.T[::-1]
    leading = directions[np.arange(dimension), np.argmax(np.abs(directions) > 1e-12, axis=1)]
    return Ellipsoid(np.sqrt((dimension + 2) * squares[::-1]), directions * np.sign(leading)[:, None])


class DeformationGauge(Gauge):
    """The ellipse or ellipsoid with the second moments of each phase, see `ellipsoid`.

    - `long_axis`, (3-D: `middle_axis`,) `short_axis`: its semi-axes L and B
    - `deformation`: (L - B)/(L + B)
    - `angle` (2-D): of the long axis from +x to +y, within a quarter turn; 3-D: `direction_x` ..., its unit vector, whose
      first component that is not 0 is positive

    Along a periodic axis a phase that does not fill the axis is put together first. A phase without particles has nan.
    """

    needs = Needs.of(fields=("position", "volume"))

    def row(self, snapshot: Snapshot) -> list[float]:
        result: list[float] = []
        for index in chosen_phases(self):
            mine = snapshot.phase == index
            position = in_one_piece(snapshot.position[mine], self.scene, snapshot.particle_spacing)
            shape = ellipsoid(position, snapshot.volume[mine].astype(np.float64))
            result += [*shape.semi_axes, shape.deformation]
            long_axis = shape.directions[0]
            result += [math.atan2(long_axis[1], long_axis[0])] if self.dimension == 2 else [*long_axis]
        return result


class FragmentsGauge(Gauge):
    """The pieces of each phase: particles that a chain of its particles connects, with links up to `reach` spacings.

    - `count`: pieces of at least `least` particles
    - `volume_1` ... (2-D: `area_1`): of the largest ones, 0 where there are fewer
    - `rest`: of all others, small ones included
    """

    needs = Needs.of(fields=("position", "volume"))
    reach: ClassVar[float] = 1.6
    """in particle spacings: beyond the diagonal of a lattice, 1.41, short of a row of another phase in between, 2"""

    def row(self, snapshot: Snapshot) -> list[float]:
        result: list[float] = []
        radius = self.reach * snapshot.particle_spacing
        for index in chosen_phases(self):
            mine = snapshot.phase == index
            position, volume = snapshot.position[mine], snapshot.volume[mine].astype(np.float64)
            if not np.isfinite(position).all():
                result += [math.nan] * (self.spec.largest + 2)
                continue
            piece = pieces(position, radius, self.scene.lower, self.scene.upper, self.scene.periodic)
            size = np.bincount(piece)
            sums = np.sort(np.bincount(piece, volume)[size >= self.spec.least])[::-1]
            listed = np.zeros(self.spec.largest)
            listed[: len(sums)] = sums[: len(listed)]
            result += [float(len(sums)), *listed, max(float(volume.sum() - listed.sum()), 0.0)]
        return result


def chosen_phases(gauge: Gauge) -> list[int]:
    """Return the places of the phases of a gauge with the key `phases`: those that it names, or all."""
    named = gauge.spec.phases
    return [gauge.phase_names.index(name) for name in (gauge.phase_names if named is None else named)]


def in_one_piece(position: np.ndarray, scene: Any, spacing: float) -> np.ndarray:
    """Return positions (n, d) with periodic axes cut in the widest gap between particles, so that drops are whole [m]."""
    position = np.asarray(position, np.float64)
    cuts = np.full(scene.dimension, math.nan)
    for axis, bins in enumerate(scene.bins(spacing)):
        place = position[:, axis]
        if bins and len(place) and np.isfinite(place).all():
            lower, length = scene.lower[axis], scene.upper[axis] - scene.lower[axis]
            index = ((place - lower) / length * bins).astype(np.int64) % bins
            cuts[axis] = cut_of(np.bincount(index, minlength=bins) > 0, lower, length)
    return behind_cuts(position, cuts, scene)


def pieces(
    position: np.ndarray, radius: float, lower: np.ndarray, upper: np.ndarray, periodic: Sequence[bool]
) -> np.ndarray:
    """Return the number (n,) of the piece that each particle belongs to; those within `radius` belong together.

    position: (n, d), finite [m]; radius: [m]
    lower, upper, periodic: (d,) of the domain [m]
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    count = len(position)
    if not count:
        return np.empty(0, np.int64)
    length = np.where(periodic, upper - lower, 0.0)
    place = np.asarray(position, np.float64) - lower
    wraps = length > 0
    # A remainder may be rounded up to the length itself, which the tree does not take.
    place[:, wraps] = np.mod(place[:, wraps], length[wraps])
    place[:, wraps] = np.where(place[:, wraps] < length[wraps], place[:, wraps], 0.0)
    pairs = cKDTree(place, boxsize=length).query_pairs(radius, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], np.int64)
