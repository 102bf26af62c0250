"""Gauges of shapes: how far the phases reach, how round they are, the line around them, what has left them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np

from warpsph.measure.contour import cells_behind_mirrors, contour, shares_of_phases
from warpsph.measure.gauge import AXES, Gauge, Needs
from warpsph.measure.totals import Places, sums_of
from warpsph.snapshot import Snapshot


class InterfaceWaveGauge(Gauge):
    """Amplitudes a and b [m] of an interface at the height y_0 + a cos(k x) + b sin(k x) + waves of other lengths.

    Below the interface, over the length L of a whole number of waves and the section across both axes,

        integral of cos(k x) dV = a/2 times L and the width of the section,

    whatever the shape of the interface, as long as each x has one height. The integral is the sum over the particles: no
    line has to be found, and an interface of particles has the amplitude to which their places and volumes add up.
    """

    needs = Needs.of(fields=("position", "volume"))

    def row(self, snapshot: Snapshot) -> list[float]:
        inside = snapshot.phase == self.phase_names.index(self.spec.phase)
        along = AXES.index(self.spec.axis)
        turn = 2.0 * math.pi / self.spec.wavelength * snapshot.position[inside, along]
        section = float(np.prod((np.asarray(self.scene.upper) - np.asarray(self.scene.lower))[:-1]))
        volume = 2.0 / section * snapshot.volume[inside]
        return [float(volume @ np.cos(turn)), float(volume @ np.sin(turn))]


class ExtentsGauge(Gauge):
    """Where each phase is, how large and how round.

    - `lowest_x`, `highest_x` ...: the outermost particle centres; the surface is half a particle spacing
      further out, and one particle that strays decides (the gauge `contour` finds the surface itself)
    - `front`: the same as `highest_x`
    - `centroid_x` ...: weighted with the volume
    - `area` (3-D: `volume`): the sum of the particles' volumes
    - `circularity`, `roundness` (2-D): see `outline`; they mean something for one compact, star-shaped patch
    - `semi_axis_x` ...: sqrt((d + 2) <(x - centroid_x)^2>), the semi-axes of an ellipse or ellipsoid along the axes of the
      scene that has the same second moments. A particle counts as a square (cube) of its volume, with a second moment of
      its own, volume^(2/d)/12: a rectangle of lattice cells has its exact moments

    Along a periodic axis a phase that does not fill the axis is put together first, so that a drop that
    crosses the boundary is still one drop; its centroid is inside the domain, its ends may reach beyond. A
    phase without particles has nan, and area 0.
    """

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        # The outline is made of places of particles, everything else of sums.
        self.needs = Needs.of(Places, fields=("position",) if self.dimension == 2 else ())

    def row(self, snapshot: Snapshot) -> list[float]:
        places = sums_of(snapshot, Places, self.scene)
        result: list[float] = []
        for index, volume in enumerate(places.volume):
            highest = places.highest[index]
            result += [*places.lowest[index], *highest, *places.centroid[index], highest[0], volume]
            if self.dimension == 2:
                result += self._roundness(snapshot, places, index)
            result += [*np.sqrt((self.dimension + 2) * places.moment[index])]
        return result

    def _roundness(self, snapshot: Snapshot, places: Places, index: int) -> list[float]:
        """Circularity and roundness of a phase."""
        if not np.isfinite(places.centroid[index]).all():
            return [math.nan, math.nan]
        position = places.put_together(snapshot.position[snapshot.phase == index], index, self.scene)
        shape = outline(position - places.centroid[index], snapshot.particle_spacing)
        return [shape.circularity, shape.roundness]


@dataclass(frozen=True)
class Outline:
    """The smoothed outline r(theta) of a patch of particles in 2-D."""

    radius: np.ndarray
    """(360,) distance from the centre at theta = 0, 1, 2 ... degrees [m]"""
    area: float
    """enclosed by the outline [m^2]"""
    perimeter: float
    """[m]"""

    @property
    def circularity(self) -> float:
        """2 sqrt(pi area) / perimeter: 1 for a circle, 0.91 for a square (8 modes blunt its corners)."""
        return 2.0 * math.sqrt(math.pi * self.area) / self.perimeter

    @property
    def roundness(self) -> float:
        """Standard deviation of r(theta) over its mean: 0 for a circle."""
        return float(self.radius.std() / self.radius.mean())


def outline(offset: np.ndarray, spacing: float, modes: int = 8) -> Outline:
    """The smoothed outline of particles at `offset` (n, 2) from their centroid [m]; nan for too few of them.

    The plane is cut into sectors about two spacings wide at the rim, and the outermost particle of each is
    taken. Through these a Fourier series r(theta) of at most `modes` modes is fitted by least squares and
    moved out by half a spacing, from the centres to the surface. Points further than three spacings (or a
    tenth of the radius) from the fit are left out and the fit repeated, so that a few strays do not count.
    Area and perimeter both belong to this outline, so its circularity never exceeds 1; the lattice alone
    takes about 0.002 from it at 15 particles a radius.
    """
    angle = np.arctan2(offset[:, 1], offset[:, 0])
    distance = np.hypot(offset[:, 0], offset[:, 1])
    # The radius of the disc with this many particles; 2 spacings a sector leave each one a particle of the
    # outer layer.
    size = math.sqrt(max(len(offset), 1) / math.pi)
    sectors = min(int(math.pi * size), 180)
    theta = np.radians(np.arange(360))
    if sectors < 8:
        return Outline(np.full(360, math.nan), math.nan, math.nan)
    sector = np.minimum(((angle + math.pi) / (2 * math.pi) * sectors).astype(np.int64), sectors - 1)
    rim = np.zeros(sectors)
    np.maximum.at(rim, sector, distance)
    outermost = np.flatnonzero(distance == rim[sector])
    angle, distance = angle[outermost], distance[outermost]
    modes = min(modes, (len(outermost) - 1) // 3)
    basis = _fourier(angle, modes)
    kept = np.ones(len(angle), bool)
    allowed = max(3.0 * spacing, 0.1 * size * spacing)
    for _ in range(5):
        coefficients = np.linalg.lstsq(basis[kept], distance[kept], rcond=None)[0]
        near = np.abs(basis @ coefficients - distance) <= allowed
        if np.array_equal(near, kept) or near.sum() < basis.shape[1]:
            break
        kept = near
    radius = np.maximum(_fourier(theta, modes) @ coefficients + 0.5 * spacing, 0.0)
    orders = np.arange(1, modes + 1)
    cosines, sines = coefficients[1 : modes + 1], coefficients[modes + 1 :]
    slope = np.cos(np.outer(theta, orders)) @ (orders * sines) - np.sin(np.outer(theta, orders)) @ (
        orders * cosines
    )
    # The mean over whole periods is the exact integral of r^2, and all but exact for the length.
    area = math.pi * float(np.mean(radius**2))
    perimeter = 2.0 * math.pi * float(np.mean(np.hypot(radius, slope)))
    return Outline(radius, area, perimeter)


def _fourier(angle: np.ndarray, modes: int) -> np.ndarray:
    """(n, 1 + 2 modes): 1, cos(k angle), sin(k angle)."""
    phase = np.outer(angle, np.arange(1, modes + 1))
    return np.hstack([np.ones((len(angle), 1)), np.cos(phase), np.sin(phase)])


class ContourGauge(Gauge):
    """The line around each phase in 2-D, of any shape and in any number of pieces (see `warpsph.measure.contour`).

    - `perimeter`: length of the line; where the phase touches a wall there is none
    - `circularity`: 2 sqrt(pi A) / perimeter, with the area A that the line encloses, so that it never exceeds 1; a
      disc of a lattice has 0.995 to 0.997. It means something for a phase that touches no wall
    - `filling`: the area that the phase takes, measured by the places of the particles, over the sum of their volumes
      m/rho: 1 if the particles take the room that their densities say. So it stays 1 when a gas is compressed, and
      shows what the equation of state does not: gaps, overlaps, drift of the density
    - `lowest_x`, `highest_x` ...: ends of the line, hence of the phase itself; particles that stray alone or in pairs
      do not count. A tip of the curvature k is cut off by 0.6 k spacing^2
    - `asymmetry`, with the key `mirror`: mean distance of the line from its mirror image about the middle of the
      domain [m]

    A phase without particles has nan.
    """

    needs = Needs.of(fields=("position", "volume"))

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        mirror = getattr(spec, "mirror", None)
        self.mirror = None if mirror is None else AXES.index(mirror)
        self.walls, self.wall_area = cells_behind_mirrors(case)

    def row(self, snapshot: Snapshot) -> list[float]:
        count = len(self.phase_names)
        fluid = snapshot.phase >= 0
        amount = np.bincount(snapshot.phase[fluid], snapshot.volume[fluid], minlength=count)
        if not np.isfinite(snapshot.position).all() or not np.isfinite(amount).all():
            return [math.nan] * len(self.columns)
        walls = len(self.walls)
        shares = shares_of_phases(
            np.concatenate([snapshot.position, self.walls]),
            np.concatenate([snapshot.volume, np.full(walls, self.wall_area)]),
            np.concatenate([snapshot.phase, np.full(walls, -1)]), count,
            self.scene.lower, self.scene.upper, self.scene.periodic, snapshot.particle_spacing,
        )  # fmt: skip
        result: list[float] = []
        for share, area in zip(shares, amount, strict=True):
            line = contour(share)
            filling = share.amount / area if area > 0 else math.nan
            result += [line.length if area > 0 else math.nan, line.circularity, filling, *line.lowest, *line.highest]
            result += [] if self.mirror is None else [line.asymmetry(self.mirror)]
        return result


class StraysGauge(Gauge):
    """How many particles of each phase have left it: those with fewer than 3 others of their phase within 2 spacings.

    In a lattice a particle has 12 within this distance (3-D: 32), on a plane surface 8 (22), at a right angle 5.
    """

    needs = Needs.of(fields=("position",))
    reach: ClassVar[float] = 2.0
    """in particle spacings"""
    company: ClassVar[int] = 3

    def row(self, snapshot: Snapshot) -> list[float]:
        # A particle that the lattice put exactly two spacings away counts, rounded or not.
        radius = (self.reach + 1e-3) * snapshot.particle_spacing
        box = (self.scene.lower, self.scene.upper, self.scene.periodic)
        result = []
        for index in range(len(self.phase_names)):
            position = snapshot.position[snapshot.phase == index]
            position = position[np.isfinite(position).all(axis=1)]
            result.append(float(isolated(position, radius, self.company, *box).sum()))
        return result


def isolated(
    position: np.ndarray,
    radius: float,
    company: int,
    lower: np.ndarray,
    upper: np.ndarray,
    periodic: Sequence[bool],
) -> np.ndarray:
    """Mask (n,) of the particles with fewer than `company` others within `radius`.

    position: (n, d), m; radius: m
    lower, upper, periodic: (d,) of the domain, m; particles outside of it are looked at like any other
    """
    count, dimension = position.shape
    extent = upper - lower
    bins = np.maximum((extent / radius).astype(np.int64), 1)
    place = np.floor((position - lower) / extent * bins)
    place = np.where(periodic, np.mod(place, bins), np.clip(place, 0, bins - 1)).astype(np.int64)
    place = np.minimum(place, bins - 1)
    flat = np.ravel_multi_index(tuple(place.T), tuple(bins)) if count else np.empty(0, np.int64)
    order = np.argsort(flat, kind="stable")
    x, place = position[order], place[order]
    ends = np.cumsum(np.bincount(flat, minlength=int(bins.prod())))
    starts = np.concatenate([[0], ends[:-1]])

    found = np.zeros(count, np.int64)
    active = np.arange(count)
    steps = [(0,) if n == 1 else (0, 1) if n == 2 and wraps else (0, -1, 1) for n, wraps in zip(bins, periodic, strict=True)]
    # The own bin comes first: after it most particles have company enough and drop out.
    for step in product(*steps):
        near = place[active] + step
        near = np.where(periodic, np.mod(near, bins), near)
        inside = ((near >= 0) & (near < bins)).all(axis=1)
        rows, near = active[inside], near[inside]
        bin_of = np.ravel_multi_index(tuple(near.T), tuple(bins)) if len(near) else np.empty(0, np.int64)
        other, last = starts[bin_of], ends[bin_of]
        while len(rows):
            more = other < last
            rows, other, last = rows[more], other[more], last[more]
            offset = x[other] - x[rows]
            offset = np.where(periodic, offset - extent * np.round(offset / extent), offset)
            found[rows] += (np.einsum("ij,ij->i", offset, offset) <= radius**2) & (other != rows)
            other = other + 1
        active = active[found[active] < company]
    result = np.zeros(count, bool)
    result[order[active]] = True
    return result
