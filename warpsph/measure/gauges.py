"""Gauges: numbers measured while a run goes on, one CSV file each.

| type | columns | needs |
|---|---|---|
| energy | kinetic, potential, elastic, surface, total, and `kinetic gas`, `total gas` ... for each phase | particles |
| momentum | momentum_x ..., angular_z (3-D: x, y, z), scale, max_speed | particles |
| phase_pressure | the name of each phase, `gas - liquid` ..., max, min | particles |
| extents | `lowest_x gas`, `highest_x gas`, `centroid_x gas`, `semi_axis_x gas`, `front gas`, `area gas` ... | particles |
| contour | `perimeter gas`, `circularity gas`, `filling gas`, `lowest_x gas`, `highest_x gas` ... (2-D) | particles |
| phase_velocity | `velocity_x gas` ..., `max_speed gas` | particles |
| strays | the name of each phase | particles |
| interface_length | interface_length | extra |
| wall_force | force_x ..., and `force_x block` ... for each body | extra |
| points, line | position and fields, one row for each point | samples |

To add one: a class with `columns` and `rows`, and its name in GAUGES.

The files start with a line of names and units, `time [s],kinetic [J/m]`; numbers are written with all their
digits and each row is on its way to the disk before the next step is done. In 2-D every quantity is per
metre of depth.
"""

from __future__ import annotations

import csv
import functools
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from warpsph.case.expressions import Expression, compile_expression
from warpsph.case.sensors import face_spots, wall_normal
from warpsph.errors import CaseError, OutputError, Problem, WarpsphError, listed
from warpsph.files.output import Schedule, whole_file, write_failure
from warpsph.measure.contour import contour, shares_of_phases
from warpsph.measure.interface_area import interface_areas
from warpsph.snapshot import Snapshot

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Column:
    """Name and unit of one column of a gauge."""

    name: str
    unit: str

    def __str__(self) -> str:
        return f"{self.name} [{self.unit}]"


@dataclass(frozen=True)
class PhaseEos:
    """Equation of state of a phase: p = B ((rho/rho0)^gamma - 1) + background, with B = rho0 c^2 / gamma."""

    density: float
    """rho0 [kg/m^3]"""
    sound_speed: float
    """c [m/s]"""
    gamma: float
    background_pressure: float = 0.0
    """[Pa]"""

    def elastic_energy(self, density: np.ndarray) -> np.ndarray:
        """Energy stored by compressing from rho0 to `density` [J/kg]: the integral of p / rho^2 over rho."""
        s = np.asarray(density, np.float64) / self.density - 1.0
        # Both terms are of size s and their sum of size s^2: expm1 and log1p keep the digits of a small s.
        log = np.log1p(s)
        power = log if self.gamma == 1.0 else np.expm1((self.gamma - 1.0) * log) / (self.gamma - 1.0)
        loss = s / (1.0 + s)
        stiffness = self.sound_speed**2 / self.gamma
        return stiffness * (power - loss) + self.background_pressure / self.density * loss


class Gauge:
    """Base of all gauges: what one measures from a snapshot."""

    needs: ClassVar[str] = "particles"
    """what of the snapshot is looked at: `particles`, `extra` or `samples`"""

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        self.name = name
        self.spec = spec
        self.dimension: int = case.dimension
        self.phase_names: list[str] = list(case.phase_names)

    @property
    def axes(self) -> tuple[str, ...]:
        return AXES[: self.dimension]

    def unit(self, three_d: str, two_d: str) -> str:
        """The unit in this dimension."""
        return three_d if self.dimension == 3 else two_d

    @property
    def columns(self) -> list[Column]:
        """Names and units of the columns after the time."""
        raise NotImplementedError

    def row(self, snapshot: Snapshot) -> list[float]:
        """One number for each column."""
        raise NotImplementedError

    def rows(self, snapshot: Snapshot) -> np.ndarray:
        """(rows, columns) float64; one row, except for gauges of many points."""
        return np.asarray([self.row(snapshot)], np.float64)


def _by_phase(snapshot: Snapshot, values: np.ndarray, count: int) -> np.ndarray:
    """Sum of `values` (n,) for each phase, (count,) float64, from the fluid particles."""
    fluid = snapshot.phase >= 0
    return np.bincount(snapshot.phase[fluid], np.asarray(values[fluid], np.float64), minlength=count)


class EnergyGauge(Gauge):
    """Energies of the fluid [J]: kinetic, potential, elastic (see PhaseEos), surface and their total.

    potential = sum m (-g.x + B^2 |x - c|^2/2), B and c those of a central force.
    surface = sum over the pairs of phases of their surface tension times the length (3-D: area) of their interface (see
    `interface_area`); that of a wall with a contact angle is not known and left out. It belongs to no phase: the
    totals of the phases are without it.

    Without equations of state (`eos`) the column `elastic` is left out and not part of the total, without surface tension
    the column `surface`.
    """

    def __init__(self, name: str, spec: Any, case: Any, eos: Mapping[str, PhaseEos] | None = None) -> None:
        super().__init__(name, spec, case)
        self.gravity = np.asarray(case.gravity, np.float64)
        self.central = case.central_force
        self.eos = eos if eos is not None else _eos_of_case(case)
        self.tensions = [pair for pair in case.surface_tension if pair.coefficient > 0]
        self.domain, self.periodic = case.domain, tuple(case.periodic)

    @property
    def columns(self) -> list[Column]:
        unit = self.unit("J", "J/m")
        parts = [*(["elastic"] if self.eos else []), *(["surface"] if self.tensions else [])]
        names = ["kinetic", "potential", *parts, "total"]
        for phase in self.phase_names:
            names += [f"kinetic {phase}", f"total {phase}"]
        return [Column(name, unit) for name in names]

    def row(self, snapshot: Snapshot) -> list[float]:
        count = len(self.phase_names)
        mass = np.asarray(snapshot.mass, np.float64)
        velocity = np.asarray(snapshot.velocity, np.float64)
        kinetic = _by_phase(snapshot, 0.5 * mass * np.einsum("ij,ij->i", velocity, velocity), count)
        height = -(snapshot.position @ self.gravity)
        if self.central is not None:
            way = snapshot.position - np.asarray(self.central.center, np.float64)
            height = height + 0.5 * self.central.rate**2 * np.einsum("ij,ij->i", way, way)
        potential = _by_phase(snapshot, mass * height, count)
        total = kinetic + potential
        result = [kinetic.sum(), potential.sum()]
        if self.eos:
            elastic = np.zeros(count)
            for index, name in enumerate(self.phase_names):
                mine = snapshot.phase == index
                elastic[index] = mass[mine] @ self.eos[name].elastic_energy(snapshot.density[mine])
            total += elastic
            result.append(elastic.sum())
        surface = self._surface(snapshot) if self.tensions else 0.0
        result += [surface] if self.tensions else []
        result.append(total.sum() + surface)
        for index in range(count):
            result += [kinetic[index], total[index]]
        return result

    def _surface(self, snapshot: Snapshot) -> float:
        areas = interface_areas(
            snapshot.position, snapshot.volume, snapshot.phase, len(self.phase_names),
            self.domain.lower, self.domain.upper, self.periodic, snapshot.particle_spacing,
        )  # fmt: skip
        places = [sorted(self.phase_names.index(name) for name in pair.between) for pair in self.tensions]
        return sum(pair.coefficient * areas[a, b] for pair, (a, b) in zip(self.tensions, places, strict=True))


def _eos_of_case(case: Any) -> dict[str, PhaseEos] | None:
    """Equations of state, if the case gives every number; None if one is `auto`."""
    result = {}
    for name, phase in case.phases.items():
        numbers = (phase.density, phase.sound_speed, phase.gamma, phase.background_pressure)
        if not all(isinstance(number, (int, float)) for number in numbers):
            return None
        result[name] = PhaseEos(*(float(number) for number in numbers))
    return result


class MomentumGauge(Gauge):
    """Linear and angular momentum of the fluid, the latter about the origin.

    `scale` is the sum of m |v|, to which a drift of the momentum can be compared; `max_speed` is the largest |v|.
    """

    @property
    def columns(self) -> list[Column]:
        linear, angular = self.unit("kg m/s", "kg/s"), self.unit("kg m^2/s", "kg m/s")
        spins = AXES if self.dimension == 3 else ("z",)
        return [
            *(Column(f"momentum_{axis}", linear) for axis in self.axes),
            *(Column(f"angular_{axis}", angular) for axis in spins),
            Column("scale", linear),
            Column("max_speed", "m/s"),
        ]

    def row(self, snapshot: Snapshot) -> list[float]:
        fluid = snapshot.phase >= 0
        mass = np.asarray(snapshot.mass[fluid], np.float64)
        velocity = np.asarray(snapshot.velocity[fluid], np.float64)
        momentum = mass[:, None] * velocity
        position = snapshot.position[fluid]
        if self.dimension == 3:
            angular = np.cross(position, momentum).sum(axis=0)
        else:
            angular = np.array([position[:, 0] @ momentum[:, 1] - position[:, 1] @ momentum[:, 0]])
        scale = np.sqrt(np.einsum("ij,ij->i", momentum, momentum)).sum()
        fastest = math.sqrt(np.einsum("ij,ij->i", velocity, velocity).max(initial=0.0))
        return [*momentum.sum(axis=0), *angular, scale, fastest]


class PhasePressureGauge(Gauge):
    """Pressure averaged over the volume of each phase, the difference of each two, and the extremes [Pa].

    The column of a pair is named in the order of the case's phases, `gas - liquid`. A phase without
    particles has nan.
    """

    @property
    def columns(self) -> list[Column]:
        pairs = [f"{first} - {second}" for first, second in combinations(self.phase_names, 2)]
        return [Column(name, "Pa") for name in [*self.phase_names, *pairs, "max", "min"]]

    def row(self, snapshot: Snapshot) -> list[float]:
        count = len(self.phase_names)
        volume = _by_phase(snapshot, snapshot.volume, count)
        product = _by_phase(snapshot, np.asarray(snapshot.pressure, np.float64) * snapshot.volume, count)
        mean = np.divide(product, volume, out=np.full(count, np.nan), where=volume > 0)
        pressure = snapshot.pressure[snapshot.phase >= 0]
        extremes = [pressure.max(), pressure.min()] if len(pressure) else [math.nan, math.nan]
        return [*mean, *(first - second for first, second in combinations(mean, 2)), *extremes]


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
        self.periodic = tuple(case.periodic)
        self.lower = np.asarray(case.domain.lower, np.float64)
        self.upper = np.asarray(case.domain.upper, np.float64)

    @property
    def columns(self) -> list[Column]:
        result = []
        for phase in self.phase_names:
            for quantity in ("lowest", "highest", "centroid"):
                result += [Column(f"{quantity}_{axis} {phase}", "m") for axis in self.axes]
            result.append(Column(f"front {phase}", "m"))
            if self.dimension == 2:
                result.append(Column(f"area {phase}", "m^2"))
                result += [Column(f"circularity {phase}", "1"), Column(f"roundness {phase}", "1")]
            else:
                result.append(Column(f"volume {phase}", "m^3"))
            result += [Column(f"semi_axis_{axis} {phase}", "m") for axis in self.axes]
        return result

    def row(self, snapshot: Snapshot) -> list[float]:
        result: list[float] = []
        for index in range(len(self.phase_names)):
            mine = snapshot.phase == index
            volume = np.asarray(snapshot.volume[mine], np.float64)
            position = snapshot.position[mine]
            if not len(volume) or not np.isfinite(position).all():
                result += [math.nan] * (3 * self.dimension + 1) + [float(volume.sum())]
                result += [math.nan] * (4 if self.dimension == 2 else 3)
                continue
            position = self._together(position, volume, snapshot.particle_spacing)
            total = volume.sum()
            centroid = volume @ position / total
            highest = position.max(axis=0)
            result += [*position.min(axis=0), *highest, *centroid, highest[0], total]
            if self.dimension == 2:
                shape = outline(position - centroid, snapshot.particle_spacing)
                result += [shape.circularity, shape.roundness]
            own = volume ** (2.0 / self.dimension) / 12.0
            moment = volume @ ((position - centroid) ** 2 + own[:, None]) / total
            result += [*np.sqrt((self.dimension + 2) * moment)]
        return result

    def _together(self, position: np.ndarray, volume: np.ndarray, spacing: float) -> np.ndarray:
        """Positions with the periodic axes cut where the phase has its widest gap."""
        position = np.array(position, np.float64)
        for axis in range(self.dimension):
            if not self.periodic[axis]:
                continue
            length = self.upper[axis] - self.lower[axis]
            bins = max(int(length / spacing), 1)
            index = ((position[:, axis] - self.lower[axis]) / length * bins).astype(np.int64) % bins
            occupied = np.flatnonzero(np.bincount(index, minlength=bins))
            gaps = np.diff(np.append(occupied, occupied[0] + bins)) - 1
            if gaps.max() < 2:  # the phase goes all the way round
                continue
            start = occupied[(int(gaps.argmax()) + 1) % len(occupied)]
            # Half a bin below the start: a particle on a bin's lower edge may be rounded to either side of
            # it.
            cut = self.lower[axis] + (start - 0.5) * length / bins
            x = cut + np.mod(position[:, axis] - cut, length)
            position[:, axis] = x - length * np.floor((volume @ x / volume.sum() - self.lower[axis]) / length)
        return position


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

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.periodic = tuple(case.periodic)
        self.lower, self.upper = case.domain.lower, case.domain.upper
        mirror = getattr(spec, "mirror", None)
        self.mirror = None if mirror is None else AXES.index(mirror)

    @property
    def columns(self) -> list[Column]:
        result = []
        for phase in self.phase_names:
            units = {"perimeter": "m", "circularity": "1", "filling": "1"}
            result += [Column(f"{name} {phase}", unit) for name, unit in units.items()]
            result += [Column(f"{end}_{axis} {phase}", "m") for end in ("lowest", "highest") for axis in self.axes]
            result += [] if self.mirror is None else [Column(f"asymmetry {phase}", "m")]
        return result

    def row(self, snapshot: Snapshot) -> list[float]:
        count = len(self.phase_names)
        amount = _by_phase(snapshot, snapshot.volume, count)
        if not np.isfinite(snapshot.position).all() or not np.isfinite(amount).all():
            return [math.nan] * len(self.columns)
        shares = shares_of_phases(
            snapshot.position, snapshot.volume, snapshot.phase, count,
            self.lower, self.upper, self.periodic, snapshot.particle_spacing,
        )  # fmt: skip
        result: list[float] = []
        for share, area in zip(shares, amount, strict=True):
            line = contour(share)
            filling = share.amount / area if area > 0 else math.nan
            result += [line.length if area > 0 else math.nan, line.circularity, filling, *line.lowest, *line.highest]
            result += [] if self.mirror is None else [line.asymmetry(self.mirror)]
        return result


class PhaseVelocityGauge(Gauge):
    """Velocity of each phase, averaged over its volume, and its largest speed [m/s]; nan without particles.

    The vertical one of a bubble is its rise velocity.
    """

    @property
    def columns(self) -> list[Column]:
        names = (*(f"velocity_{axis}" for axis in self.axes), "max_speed")
        return [Column(f"{name} {phase}", "m/s") for phase in self.phase_names for name in names]

    def row(self, snapshot: Snapshot) -> list[float]:
        count = len(self.phase_names)
        velocity = np.asarray(snapshot.velocity, np.float64)
        volume = _by_phase(snapshot, snapshot.volume, count)
        flow = np.stack([_by_phase(snapshot, snapshot.volume * part, count) for part in velocity.T], axis=1)
        mean = np.divide(flow, volume[:, None], out=np.full_like(flow, np.nan), where=volume[:, None] > 0)
        speed = np.sqrt(np.einsum("ij,ij->i", velocity, velocity))
        result: list[float] = []
        for index in range(count):
            mine = speed[snapshot.phase == index]
            result += [*mean[index], mine.max() if len(mine) else math.nan]
        return result


class StraysGauge(Gauge):
    """How many particles of each phase have left it: those with fewer than 3 others of their phase within 2 spacings.

    In a lattice a particle has 12 within this distance (3-D: 32), on a plane surface 8 (22), at a right angle 5.
    """

    reach: ClassVar[float] = 2.0
    """in particle spacings"""
    company: ClassVar[int] = 3

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.box = (np.asarray(case.domain.lower, np.float64), np.asarray(case.domain.upper, np.float64))
        self.periodic = tuple(case.periodic)

    @property
    def columns(self) -> list[Column]:
        return [Column(phase, "1") for phase in self.phase_names]

    def row(self, snapshot: Snapshot) -> list[float]:
        # A particle that the lattice put exactly two spacings away counts, rounded or not.
        radius = (self.reach + 1e-3) * snapshot.particle_spacing
        result = []
        for index in range(len(self.phase_names)):
            position = snapshot.position[snapshot.phase == index]
            position = position[np.isfinite(position).all(axis=1)]
            result.append(float(isolated(position, radius, self.company, *self.box, self.periodic).sum()))
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


class InterfaceLengthGauge(Gauge):
    """Length (3-D: area) of all interfaces between phases, as the device measured it."""

    needs: ClassVar[str] = "extra"

    @property
    def columns(self) -> list[Column]:
        return [Column("interface_length", self.unit("m^2", "m"))]

    def row(self, snapshot: Snapshot) -> list[float]:
        return [_extra(self, snapshot, "interface_length")]


def wall_bodies(case: Any) -> list[str]:
    """Names of the solid bodies of a case, as in `wall_force_x <body>`: `domain` if it has walls, then the
    obstacles.

    An obstacle without a name is called obstacle_1, obstacle_2 ... by its place in the list.
    """
    names = [obstacle.name or f"obstacle_{place}" for place, obstacle in enumerate(case.obstacles, 1)]
    at_domain = any("wall" in (axis.lower.kind, axis.upper.kind) for axis in case.sides)
    return (["domain"] if at_domain else []) + names


class WallForceGauge(Gauge):
    """Force of the fluid on the walls: of all bodies together, and of each (`wall_bodies`)."""

    needs: ClassVar[str] = "extra"

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.bodies = wall_bodies(case)

    @property
    def columns(self) -> list[Column]:
        unit = self.unit("N", "N/m")
        return [
            *(Column(f"force_{axis}", unit) for axis in self.axes),
            *(Column(f"force_{axis} {body}", unit) for body in self.bodies for axis in self.axes),
        ]

    def row(self, snapshot: Snapshot) -> list[float]:
        forces = np.array(
            [
                [_extra(self, snapshot, f"wall_force_{axis} {body}") for axis in self.axes]
                for body in self.bodies
            ]
        ).reshape(-1, self.dimension)
        return [*forces.sum(axis=0), *forces.ravel()]


def _extra(gauge: Gauge, snapshot: Snapshot, key: str) -> float:
    if key not in snapshot.extra:
        known = ", ".join(sorted(snapshot.extra)) or "nothing"
        raise WarpsphError(f"gauges.{gauge.name}: this scene does not measure {key!r} (it measures {known})")
    return float(snapshot.extra[key])


# Fields that can be sampled, and their units.
FIELD_UNITS = {
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "density": "kg/m^3",
    "pressure": "Pa",
    "volume": "m^3",
    "phase": "1",
    "curvature": "1/m",
    "normal": "1",
}
VECTOR_FIELDS = ("velocity", "acceleration", "normal")


class PointsGauge(Gauge):
    """Fields at given points: one row for each point and time, with the point's position.

    With an `area` each point is the middle of a sensor's face, and its row holds the means over the face (`sensors`). Of a
    face that is partly dry the pressure is that of the force on it: a dry part adds nothing to the mean and counts in full.
    Other fields are means over the wet part. A face without fluid has nan, like a point without.

    Next to a wall the fluid alone is looked at, on its one side; the pressures of wall particles take no part. The value at
    a point is that of a quadratic through the fluid within the support radius, carried on to the wall (`probes`). At the
    face of a sensor it is that of a linear fit, which has 0.6 of the noise; the pressure at a wall is nearly linear there.

    The values come interpolated in `snapshot.samples[name][field]`, (samples,) or (samples, dimension); `samples_at` holds
    their places, those of the first point first.
    """

    needs: ClassVar[str] = "samples"

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.case = case
        self.fields: list[str] = list(spec.fields)
        self.degree = 2 if getattr(spec, "area", None) is None else 1

    @functools.cached_property
    def samples_at(self) -> np.ndarray:
        """Where the fields are interpolated, (samples, dimension) [m]."""
        area = getattr(self.spec, "area", None)
        if area is None:
            return self.points
        faces = []
        for point in self.points:
            normal = wall_normal(self.case, point) if self.spec.normal is None else self.spec.normal
            faces.append(point + face_spots(area, normal, self.case.particle_spacing))
        return np.concatenate(faces)

    @functools.cached_property
    def points(self) -> np.ndarray:
        """The points, (points, dimension), m."""
        return np.asarray(self.spec.points, np.float64).reshape(-1, self.dimension)

    @property
    def columns(self) -> list[Column]:
        result = [Column(axis, "m") for axis in self.axes]
        for name in self.fields:
            unit = self.unit("m^3", "m^2") if name == "volume" else FIELD_UNITS[name]
            if name in VECTOR_FIELDS:
                result += [Column(f"{name}_{axis}", unit) for axis in self.axes]
            else:
                result.append(Column(name, unit))
        return result

    def rows(self, snapshot: Snapshot) -> np.ndarray:
        samples = snapshot.samples.get(self.name, {})
        parts = [self.points]
        for name in self.fields:
            if name not in samples:
                raise WarpsphError(f"gauges.{self.name}: this scene does not sample {name!r}")
            width = self.dimension if name in VECTOR_FIELDS else 1
            values = np.asarray(samples[name], np.float64).reshape(len(self.points), -1, width)
            parts.append(_mean_over_faces(values, dry_is_zero=name == "pressure"))
        return np.hstack(parts)

    def row(self, snapshot: Snapshot) -> list[float]:
        """The row of the first point."""
        return list(self.rows(snapshot)[0])


def _mean_over_faces(values: np.ndarray, dry_is_zero: bool) -> np.ndarray:
    """Means (points, width) of samples (points, samples of each, width); nan, where it is dry, is 0 or left out."""
    wet = np.isfinite(values)
    count = wet.sum(axis=1)
    divisor = np.full_like(count, values.shape[1]) if dry_is_zero else count
    total = np.where(wet, values, 0.0).sum(axis=1)
    return np.divide(total, divisor, out=np.full(count.shape, np.nan), where=count > 0)


class LineGauge(PointsGauge):
    """Fields at `count` points spread evenly from `from` to `to`, both ends included."""

    @functools.cached_property
    def points(self) -> np.ndarray:
        """The points, (points, dimension), m."""
        start, end = np.asarray(self.spec.from_, np.float64), np.asarray(self.spec.to, np.float64)
        share = np.linspace(0.0, 1.0, self.spec.count)[:, None]
        return (1.0 - share) * start + share * end


GAUGES: dict[str, type[Gauge]] = {
    "energy": EnergyGauge,
    "momentum": MomentumGauge,
    "phase_pressure": PhasePressureGauge,
    "extents": ExtentsGauge,
    "contour": ContourGauge,
    "phase_velocity": PhaseVelocityGauge,
    "strays": StraysGauge,
    "interface_length": InterfaceLengthGauge,
    "wall_force": WallForceGauge,
    "points": PointsGauge,
    "line": LineGauge,
}


def column_names(name: str, spec: Any, case: Any) -> list[str]:
    """Names of the columns that a gauge of a case will have in a run, the time first."""
    kind = GAUGES[spec.type]
    # A run gives the energy gauge equations of state; that there are some is all that its columns depend on.
    gauge = EnergyGauge(name, spec, case, {"": PhaseEos(1.0, 1.0, 1.0)}) if kind is EnergyGauge else kind(name, spec, case)
    return ["time", *(column.name for column in gauge.columns)]


def column_formula(names: Iterable[str], text: str) -> tuple[Expression, dict[str, str]]:
    """Arithmetic of columns such as `2 * kinetic` or `highest_x gas - lowest_x gas`.

    Returns the expression and the column that each of its names stands for. Raises ExpressionError.
    """
    names = list(names)
    called = {name: name for name in names if name.isidentifier()}
    formula = text
    # A name of several words gets one word as a stand-in, the longest first, since `kinetic gas` may be part of another.
    # `gas - liquid` is none of them: as arithmetic it means the same.
    several = [name for name in names if " " in name and all(word.isidentifier() for word in name.split(" "))]
    for place, name in enumerate(sorted(several, key=len, reverse=True)):
        formula, count = re.subn(rf"(?<!\w){re.escape(name)}(?!\w)", f"column_{place}", formula)
        if count:
            called[f"column_{place}"] = name
    return compile_expression(formula, names=list(called)), called


# ------------------------------------------------------------------------------------------------------------
# CSV files


def parse_heading(cell: str) -> tuple[str, str]:
    """Name and unit of a heading `name [unit]`; the unit is empty if there is none."""
    name, bracket, rest = cell.strip().rpartition(" [")
    return (name, rest.rstrip("]")) if bracket else (cell.strip(), "")


def read_gauge(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns of a gauge's file and their units, both by name; the time comes first. Raises OutputError."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror or error}") from error
    lines = list(csv.reader(io.StringIO(text)))
    if not lines:
        raise OutputError(f"{path}: is empty")
    heading = [parse_heading(cell) for cell in lines[0]]
    try:
        rows = np.array([[float(cell) for cell in line] for line in lines[1:]], np.float64)
        rows = rows.reshape(len(lines) - 1, len(heading))
    except ValueError as error:
        raise OutputError(f"{path}: has a row that does not fit its heading: {error}") from error
    return {name: rows[:, k] for k, (name, _) in enumerate(heading)}, dict(heading)


class _Table:
    """The rows of one gauge, in memory and (with a path) in its file."""

    def __init__(self, columns: Sequence[Column], path: Path | None) -> None:
        self.columns = columns
        self.path = path
        self.blocks: list[np.ndarray] = []
        buffer = io.StringIO()
        csv.writer(buffer, lineterminator="\n").writerow(str(column) for column in columns)
        self.heading = buffer.getvalue()
        self._file: io.FileIO | None = None

    def open(self, restart_time: float | None) -> None:
        """Make the file, or with a restart time [s] take over the rows that are there up to it. Raises OutputError."""
        path = self.path
        if path is None:
            return
        if restart_time is not None and path.exists():
            self._take_over(path, restart_time)
        else:
            with whole_file(path) as temporary:
                temporary.write_text(self.heading, encoding="utf-8")
        try:
            self._file = open(path, "ab", buffering=0)
        except OSError as error:
            raise write_failure(path, error) from error

    def check(self) -> str:
        """The rows of the file, if there is one, as text. Raises OutputError if it cannot be continued."""
        path = self.path
        if path is None or not path.exists():
            return ""
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise OutputError(f"{path}: cannot be continued: {error}") from error
        heading, newline, body = text.partition("\n")
        if heading + newline != self.heading:
            raise OutputError(
                f"{path}: cannot be continued: its columns are not those of this case any more; "
                "rename the gauge or write to another folder with --output"
            )
        return body

    def _take_over(self, path: Path, restart_time: float) -> None:
        """Keep the rows up to the restart time; later ones, and a last one that was cut off, go."""
        body = self.check()
        limit = restart_time + 1e-9 * abs(restart_time)
        kept, rows = [], []
        for line in body.splitlines(keepends=True):
            try:
                row = [float(cell) for cell in line.split(",")]
            except ValueError:
                break
            if len(row) != len(self.columns) or not line.endswith("\n") or row[0] > limit:
                break
            kept.append(line)
            rows.append(row)
        with whole_file(path) as temporary:
            temporary.write_text(self.heading + "".join(kept), encoding="utf-8")
        if rows:
            self.blocks.append(np.array(rows))

    def append(self, rows: np.ndarray) -> None:
        """Add rows (k, columns); after an error the file ends with its last whole row."""
        self.blocks.append(rows)
        if self._file is None:
            return
        assert self.path is not None
        data = "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()).encode()
        size = 0
        try:
            size = self._file.seek(0, io.SEEK_END)
            view = memoryview(data)
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            self._file.truncate(size)
            raise write_failure(self.path, error) from error

    def series(self) -> dict[str, np.ndarray]:
        if len(self.blocks) > 1:
            self.blocks = [np.concatenate(self.blocks)]
        rows = self.blocks[0] if self.blocks else np.empty((0, len(self.columns)))
        return {column.name: rows[:, k].copy() for k, column in enumerate(self.columns)}

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None


# ------------------------------------------------------------------------------------------------------------
# All gauges of a run


def schedule_of(spec: Any) -> Schedule:
    """When a gauge of a case is due."""
    return Schedule(getattr(spec, "interval", None), getattr(spec, "times", None))


class GaugeSet:
    """The gauges of a case: when they are due, their rows in memory and in `folder` (None: in memory only).

    `eos` gives the energy gauge the sound speeds that were chosen for `auto`. Of a run that starts later than 0, at
    `start_time` [s], what was due before is past. With `restart_time` [s] that is so too, and the files in the folder are
    continued: rows after that time are cut off, but only once all files are known to fit. Raises OutputError.
    """

    def __init__(
        self,
        case: Any,
        folder: Path | None = None,
        *,
        eos: Mapping[str, PhaseEos] | None = None,
        restart_time: float | None = None,
        start_time: float | None = None,
    ) -> None:
        self.gauges: dict[str, Gauge] = {}
        self.schedules: dict[str, Schedule] = {}
        self._tables: dict[str, _Table] = {}
        for name, spec in (case.gauges or {}).items():
            kind = GAUGES[spec.type]
            gauge = EnergyGauge(name, spec, case, eos) if kind is EnergyGauge else kind(name, spec, case)
            columns = [Column("time", "s"), *gauge.columns]
            names = [column.name for column in columns]
            twice = next((column for column in names if names.count(column) > 1), None)
            if twice is not None:
                rule = f"has two columns called {twice!r}"
                raise CaseError([Problem(f"gauges.{name}", spec.type, rule, "rename the phase or obstacle")])
            self.gauges[name] = gauge
            self._tables[name] = _Table(columns, None if folder is None else folder / f"{name}.csv")
            self.schedules[name] = schedule_of(spec)
        if restart_time is not None:
            start_time = restart_time
            for table in self._tables.values():
                table.check()
        for name, table in self._tables.items():
            table.open(restart_time)
            if start_time is not None:
                # What is due right at the restart may be missing in the file, if the checkpoint was written before the row.
                self.schedules[name].advance(start_time * (1.0 - 1e-8))
                if table.blocks:
                    self.schedules[name].advance(float(table.blocks[-1][-1, 0]))

    @property
    def next_time(self) -> float:
        """When the next gauge is due [s]; infinity if none is."""
        return min((schedule.next for schedule in self.schedules.values()), default=math.inf)

    def due(self, time: float) -> list[str]:
        """Names of the gauges that are due at `time` [s]."""
        return [name for name, schedule in self.schedules.items() if schedule.due(time)]

    def needs(self, names: Iterable[str]) -> set[str]:
        """What these gauges look at: any of `particles`, `extra`, `samples`."""
        return {self.gauges[name].needs for name in names}

    @property
    def sample_points(self) -> dict[str, np.ndarray]:
        """Places (n, dimension) [m] at which gauges want interpolated fields, by gauge name."""
        return {name: gauge.samples_at for name, gauge in self._samplers().items()}

    @property
    def sample_fields(self) -> dict[str, list[str]]:
        """The fields that these gauges want at their points, by gauge name."""
        return {name: gauge.fields for name, gauge in self._samplers().items()}

    @property
    def sample_degrees(self) -> dict[str, int]:
        """Degree of the polynomial that is fitted for each of these gauges, by gauge name."""
        return {name: gauge.degree for name, gauge in self._samplers().items()}

    def _samplers(self) -> dict[str, PointsGauge]:
        return {name: gauge for name, gauge in self.gauges.items() if isinstance(gauge, PointsGauge)}

    def record(self, snapshot: Snapshot) -> list[str]:
        """Measure and write every gauge that is due at the snapshot's time; returns their names."""
        names = self.due(snapshot.time)
        for name in names:
            rows = self.gauges[name].rows(snapshot)
            times = np.full((len(rows), 1), snapshot.time)
            self._tables[name].append(np.hstack([times, rows]))
            self.schedules[name].advance(snapshot.time)
        return names

    def series(self, name: str) -> dict[str, np.ndarray]:
        """What a gauge has measured so far: column name (without unit) -> values, `time` among them."""
        if name not in self._tables:
            raise KeyError(f"no gauge {name!r}; there are {listed(self._tables) or 'none'}")
        return self._tables[name].series()

    def units(self, name: str) -> dict[str, str]:
        """Column name -> unit."""
        return {column.name: column.unit for column in self._tables[name].columns}

    def close(self) -> None:
        """Close the files; `series` stays available."""
        for table in self._tables.values():
            table.close()

    def __enter__(self) -> GaugeSet:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
