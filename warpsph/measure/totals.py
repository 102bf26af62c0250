"""Sums and extremes over the phases, which most gauges are made of.

A class for each group of them. A run forms them on its device (`warpsph.running.device_sums`), so that a record copies a few
numbers; of a snapshot they are formed here, from the same terms in the same order. P is the number of phases and d that of
dimensions; a phase without particles has the sums 0 and the extremes nan.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self, TypeVar

import numpy as np

from warpsph.case.signals import varies, vector_at
from warpsph.snapshot import Snapshot


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


def eos_of_case(case: Any) -> dict[str, PhaseEos] | None:
    """Equations of state, if the case gives every number; None if one is `auto`, or of several fluids.

    The pressure at which each of several has its density follows from the start of a run (theory: riemann#a1).
    """
    if len(case.phases) > 1:
        return None
    result = {}
    for name, phase in case.phases.items():
        numbers = (phase.density, phase.sound_speed, phase.gamma, phase.background_pressure)
        if not all(isinstance(number, (int, float)) for number in numbers):
            return None
        result[name] = PhaseEos(*(float(number) for number in numbers))
    return result


def eos_of_run(case: Any, sound_speed: Sequence[float], nominal_pressure: np.ndarray) -> dict[str, PhaseEos]:
    """Equations of state with the sound speed [m/s] and the nominal pressure [Pa] that a run has for each phase."""
    numbers = zip(case.phases.items(), sound_speed, nominal_pressure, strict=True)
    return {
        name: PhaseEos(phase.density, c, phase.gamma, phase.background_pressure + float(nominal))
        for (name, phase), c, nominal in numbers
    }


class Scene:
    """What of a case the sums depend on: `eos` as given, or that of the case; None if it is not known."""

    def __init__(self, case: Any, eos: Mapping[str, PhaseEos] | None = None) -> None:
        self.dimension: int = case.dimension
        self.phase_names: list[str] = list(case.phase_names)
        known = eos if eos is not None else eos_of_case(case)
        self.eos = [known[name] for name in self.phase_names] if known else None
        self.internal_energy: bool = case.scheme.internal_energy
        self.heats = [float(phase.gamma) - 1.0 for phase in case.phases.values()]
        self._gravity = case.gravity
        self.gravity_varies = varies(case.gravity)
        central = case.central_force
        self.pull = 0.0 if central is None else float(central.rate) ** 2
        self.center = np.zeros(self.dimension) if central is None else np.asarray(central.center, np.float64)
        self.lower = np.asarray(case.domain.lower, np.float64)
        self.upper = np.asarray(case.domain.upper, np.float64)
        self.periodic = tuple(case.periodic)

    def gravity_at(self, time: float) -> np.ndarray:
        """Gravity at a time [s], (d,) m/s^2."""
        return np.asarray(vector_at(self._gravity, time), np.float64)

    @property
    def phase_count(self) -> int:
        """P."""
        return len(self.phase_names)

    @property
    def middle(self) -> np.ndarray:
        """Middle of the domain, (d,) m."""
        return 0.5 * (self.lower + self.upper)

    def bins(self, spacing: float) -> np.ndarray:
        """Slices, one particle spacing [m] wide, that the domain is cut into along each axis, (d,); 0 where not periodic."""
        count = np.maximum(((self.upper - self.lower) / spacing).astype(np.int64), 1)
        return np.where(self.periodic, count, 0)


class PhaseSums(Protocol):
    """A group of sums over each phase."""

    group: ClassVar[str]
    """name of the group in the kernels"""

    @classmethod
    def made_of(cls, totals: np.ndarray, largest: np.ndarray, scene: Scene, cuts: np.ndarray) -> Self:
        """The group from the added terms (P, added) and the largest ones (P, kept)."""

    @staticmethod
    def terms(snapshot: Snapshot, scene: Scene, cuts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is added, (n, added), and of what the largest is kept, (n, kept), of n fluid particles."""


SumsT = TypeVar("SumsT", bound=PhaseSums)


@dataclass(frozen=True)
class Motion:
    """How the phases move."""

    group: ClassVar[str] = "motion"
    volume: np.ndarray
    """(P,) m^d"""
    flow: np.ndarray
    """(P, d) sum of V v, m^d m/s"""
    momentum: np.ndarray
    """(P, d) sum of m v, kg m/s"""
    spin: np.ndarray
    """(P, 3) sum of m x cross v, kg m^2/s"""
    scale: np.ndarray
    """(P,) sum of m |v|, kg m/s"""
    max_speed: np.ndarray
    """(P,) m/s"""

    @classmethod
    def made_of(cls, totals: np.ndarray, largest: np.ndarray, scene: Scene, cuts: np.ndarray) -> Self:
        d = scene.dimension
        speed = np.sqrt(_or_nan(largest[:, 0]))
        return cls(totals[:, 0], totals[:, 1 : 1 + d], totals[:, 4 : 4 + d], totals[:, 7:10], totals[:, 10], speed)

    @staticmethod
    def terms(snapshot: Snapshot, scene: Scene, cuts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        velocity = _three(snapshot.velocity)
        momentum = np.asarray(snapshot.mass, np.float64)[:, None] * velocity
        spin = np.cross(_three(snapshot.position), momentum)
        volume = np.asarray(snapshot.volume, np.float64)[:, None]
        scale = np.sqrt(np.einsum("ij,ij->i", momentum, momentum))[:, None]
        square = np.einsum("ij,ij->i", velocity, velocity)[:, None]
        return np.hstack([volume, volume * velocity, momentum, spin, scale]), square


@dataclass(frozen=True)
class Energies:
    """Energies of the phases [J]."""

    group: ClassVar[str] = "energy"
    kinetic: np.ndarray
    """(P,)"""
    potential: np.ndarray
    """(P,) sum of m (-g.x + B^2 |x - c|^2/2), g at the moment, B and c those of a central force"""
    elastic: np.ndarray
    """(P,) see PhaseEos; 0 if the scene has no equations of state; of a gas its internal energy, p V/(gamma - 1)"""

    @classmethod
    def made_of(cls, totals: np.ndarray, largest: np.ndarray, scene: Scene, cuts: np.ndarray) -> Self:
        return cls(totals[:, 0], totals[:, 1], totals[:, 2])

    @staticmethod
    def terms(snapshot: Snapshot, scene: Scene, cuts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mass = np.asarray(snapshot.mass, np.float64)
        velocity = np.asarray(snapshot.velocity, np.float64)
        way = snapshot.position - scene.center
        gravity = scene.gravity_at(snapshot.time)
        height = 0.5 * scene.pull * np.einsum("ij,ij->i", way, way) - snapshot.position @ gravity
        elastic = np.zeros(len(mass))
        for index, eos in enumerate(scene.eos or []):
            mine = snapshot.phase == index
            if scene.internal_energy:
                elastic[mine] = snapshot.pressure[mine] * snapshot.volume[mine] / scene.heats[index]
            else:
                elastic[mine] = mass[mine] * eos.elastic_energy(snapshot.density[mine])
        kinetic = 0.5 * mass * np.einsum("ij,ij->i", velocity, velocity)
        return np.stack([kinetic, mass * height, elastic], axis=1), np.empty((len(mass), 0))


@dataclass(frozen=True)
class Pressures:
    """Pressures in the phases."""

    group: ClassVar[str] = "pressure"
    mean: np.ndarray
    """(P,) over the volume, Pa"""
    highest: np.ndarray
    """(P,) Pa"""
    lowest: np.ndarray
    """(P,) Pa"""

    @classmethod
    def made_of(cls, totals: np.ndarray, largest: np.ndarray, scene: Scene, cuts: np.ndarray) -> Self:
        return cls(mean_over(totals[:, 0], totals[:, 1]), _or_nan(largest[:, 0]), -_or_nan(largest[:, 1]))

    @staticmethod
    def terms(snapshot: Snapshot, scene: Scene, cuts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pressure = np.asarray(snapshot.pressure, np.float64)
        volume = np.asarray(snapshot.volume, np.float64)
        return np.stack([volume, pressure * volume], axis=1), np.stack([pressure, -pressure], axis=1)


@dataclass(frozen=True)
class Places:
    """Where the phases are; along periodic axes put together by `put_together`.

    All but the volume is nan if a place is not finite.
    """

    group: ClassVar[str] = "place"
    volume: np.ndarray
    """(P,) m^d"""
    centroid: np.ndarray
    """(P, d) weighted with the volume, m; inside the domain along an axis that is cut"""
    lowest: np.ndarray
    """(P, d) m"""
    highest: np.ndarray
    """(P, d) m"""
    moment: np.ndarray
    """(P, d) mean of (x - centroid)^2 over the volume, with that of the particles, V^(2/d)/12 each, m^2"""
    cuts: np.ndarray
    """(P, d) where a periodic axis is cut, m; nan for an axis that is not"""
    shift: np.ndarray
    """(P, d) what is added to places behind the cut, a whole number of periods, m"""

    @classmethod
    def made_of(cls, totals: np.ndarray, largest: np.ndarray, scene: Scene, cuts: np.ndarray) -> Self:
        d = scene.dimension
        first, second = totals[:, 1 : 1 + d], totals[:, 4 : 4 + d]
        volume = totals[:, 0]
        valid = np.isfinite(totals).all(axis=1) & (volume > 0.0)
        share = np.divide(1.0, volume, out=np.full(len(volume), math.nan), where=valid)[:, None]
        centroid = scene.middle + first * share
        moment = np.maximum(second * share - (first * share) ** 2, 0.0) + totals[:, 7:8] / 12.0 * share
        extent = scene.upper - scene.lower
        shift = np.where(np.isfinite(cuts), -extent * np.floor((centroid - scene.lower) / extent), 0.0)
        known = share * volume[:, None]  # 1 or nan
        highest, lowest = largest[:, :d] * known + shift, -largest[:, 3 : 3 + d] * known + shift
        return cls(volume, centroid + shift, lowest, highest, moment, cuts, shift)

    @staticmethod
    def terms(snapshot: Snapshot, scene: Scene, cuts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position = snapshot.position.astype(np.float64)
        for phase in range(scene.phase_count):
            mine = snapshot.phase == phase
            position[mine] = behind_cuts(position[mine], cuts[phase], scene)
        way = _three(position - scene.middle)
        volume = np.asarray(snapshot.volume, np.float64)[:, None]
        own = volume ** (2.0 / scene.dimension)
        position = _three(position)
        return np.hstack([volume, volume * way, volume * way * way, volume * own]), np.hstack([position, -position])

    def put_together(self, position: np.ndarray, phase: int, scene: Scene) -> np.ndarray:
        """Positions (n, d) of particles of a phase with the periodic axes cut, m."""
        return np.asarray(behind_cuts(position, self.cuts[phase], scene) + self.shift[phase])


def _three(values: np.ndarray) -> np.ndarray:
    """Vectors (n, d) with three components, float64."""
    padded = np.zeros((len(values), 3))
    padded[:, : values.shape[1]] = values
    return padded


def _or_nan(largest: np.ndarray) -> np.ndarray:
    """The largest of nothing is nan."""
    return np.where(largest == -math.inf, math.nan, largest)


def mean_over(volume: np.ndarray, product: np.ndarray) -> np.ndarray:
    """Means (P,) or (P, d) of what was added with the weights `volume` (P,); nan where there is none."""
    weight = volume.reshape(-1, *(1,) * (product.ndim - 1))
    return np.divide(product, weight, out=np.full(product.shape, math.nan), where=weight > 0)


def behind_cuts(position: np.ndarray, cuts: np.ndarray, scene: Scene) -> np.ndarray:
    """Positions (n, d) moved by whole periods to between the cut (d,) of each axis and the next image of it, m."""
    result = np.array(position, np.float64)
    for axis in np.flatnonzero(np.isfinite(cuts)):
        length = scene.upper[axis] - scene.lower[axis]
        result[:, axis] -= length * np.floor((result[:, axis] - cuts[axis]) / length)
    return result


def cut_of(occupied: np.ndarray, lower: float, length: float) -> float:
    """Where to cut a periodic axis so that a phase is in one piece: in its widest gap [m]; nan if it goes all the way round.

    occupied: (bins,) bool, whether some of the phase is in each slice of the axis
    lower, length: of the axis, m
    """
    bins, places = len(occupied), np.flatnonzero(occupied)
    if not len(places):
        return math.nan
    gaps = np.diff(np.append(places, places[0] + bins)) - 1
    if gaps.max() < 2:
        return math.nan
    start = places[(int(gaps.argmax()) + 1) % len(places)]
    # Half a bin below the start: a particle on a bin's lower edge may be rounded to either side of it.
    return float(lower + (start - 0.5) * length / bins)


def no_cuts(scene: Scene) -> np.ndarray:
    """(P, d) nan."""
    return np.full((scene.phase_count, scene.dimension), math.nan)


def find_cuts(snapshot: Snapshot, scene: Scene) -> np.ndarray:
    """Where the periodic axes are cut for each phase of a snapshot, (P, d) m; nan where not."""
    cuts = no_cuts(scene)
    for axis, bins in enumerate(scene.bins(snapshot.particle_spacing)):
        if not bins:
            continue
        lower, length = scene.lower[axis], scene.upper[axis] - scene.lower[axis]
        for phase in range(scene.phase_count):
            place = snapshot.position[snapshot.phase == phase, axis]
            place = place[np.isfinite(place)]
            index = ((place - lower) / length * bins).astype(np.int64) % bins
            cuts[phase, axis] = cut_of(np.bincount(index, minlength=bins) > 0, lower, length)
    return cuts


def sums_of(snapshot: Snapshot, kind: type[SumsT], scene: Scene) -> SumsT:
    """A group of sums over the phases: what the device formed, or formed from the particles of the snapshot."""
    if kind in snapshot.sums:
        return snapshot.sums[kind]
    fluid = snapshot.select(snapshot.phase >= 0)
    cuts = find_cuts(fluid, scene) if kind is Places else no_cuts(scene)
    added, kept = kind.terms(fluid, scene, cuts)
    totals = np.zeros((scene.phase_count, added.shape[1]))
    largest = np.full((scene.phase_count, kept.shape[1]), -math.inf)
    for phase in range(scene.phase_count):
        mine = fluid.phase == phase
        totals[phase] = added[mine].sum(axis=0)
        largest[phase] = kept[mine].max(axis=0, initial=-math.inf)
    return kind.made_of(totals, largest, scene, cuts)
