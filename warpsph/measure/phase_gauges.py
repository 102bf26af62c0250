"""Gauges of sums over the phases: energies, momentum, pressures, velocities; and what walls and interfaces add up to."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from warpsph.case.coefficients import chosen_bodies, reference_pressure, stream_directions
from warpsph.case.columns import Column, wall_bodies
from warpsph.measure.gauge import Gauge, Needs
from warpsph.measure.interface_area import interface_areas
from warpsph.measure.totals import Energies, Motion, PhaseEos, Pressures, Scene, mean_over, sums_of
from warpsph.snapshot import Snapshot


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
        self.scene = Scene(case, eos)
        self.tensions = [pair for pair in case.surface_tension if pair.coefficient > 0]
        self.needs = Needs.of(Energies, fields=("position", "volume") if self.tensions else ())

    @property
    def columns(self) -> list[Column]:
        """Names and units of the columns after the time; without `elastic` where the equations of state are not known."""
        return [column for column in super().columns if self.scene.eos or column.name != "elastic"]

    def row(self, snapshot: Snapshot) -> list[float]:
        energies = sums_of(snapshot, Energies, self.scene)
        total = energies.kinetic + energies.potential
        result = [energies.kinetic.sum(), energies.potential.sum()]
        if self.scene.eos:
            total = total + energies.elastic
            result.append(energies.elastic.sum())
        surface = self._surface(snapshot) if self.tensions else 0.0
        result += [surface] if self.tensions else []
        result.append(total.sum() + surface)
        for kinetic, all_of_phase in zip(energies.kinetic, total, strict=True):
            result += [kinetic, all_of_phase]
        return result

    def _surface(self, snapshot: Snapshot) -> float:
        areas = interface_areas(
            snapshot.position, snapshot.volume, snapshot.phase, len(self.phase_names),
            self.scene.lower, self.scene.upper, self.scene.periodic, snapshot.particle_spacing,
        )  # fmt: skip
        places = [sorted(self.phase_names.index(name) for name in pair.between) for pair in self.tensions]
        return sum(pair.coefficient * areas[a, b] for pair, (a, b) in zip(self.tensions, places, strict=True))


class MomentumGauge(Gauge):
    """Linear and angular momentum of the fluid, the latter about the origin.

    `scale` is the sum of m |v|, to which a drift of the momentum can be compared; `max_speed` is the largest |v|.
    """

    needs = Needs.of(Motion)

    def row(self, snapshot: Snapshot) -> list[float]:
        motion = sums_of(snapshot, Motion, self.scene)
        spin = motion.spin.sum(axis=0)
        fastest = motion.max_speed[~np.isnan(motion.max_speed)].max(initial=0.0)
        return [
            *motion.momentum.sum(axis=0), *{3: spin, 2: spin[2:]}.get(self.dimension, ()), motion.scale.sum(), fastest
        ]  # fmt: skip


class BudgetGauge(Gauge):
    """What gives the fluid momentum and energy and what takes them: rates of the last step, and sums since the start.

    The total is that of all terms but `lift`, which is potential energy: of kinetic and elastic energy, and of momentum.
    """

    needs = Needs.of(extra=("budget",))

    def row(self, snapshot: Snapshot) -> list[float]:
        return [self.extra(snapshot, column.name) for column in self.columns]


class PhasePressureGauge(Gauge):
    """Pressure averaged over the volume of each phase, the difference of each two, and the extremes [Pa].

    The column of a pair is named in the order of the case's phases, `gas - liquid`. A phase without
    particles has nan.
    """

    needs = Needs.of(Pressures)

    def row(self, snapshot: Snapshot) -> list[float]:
        found = sums_of(snapshot, Pressures, self.scene)
        differences = [first - second for first, second in combinations(found.mean, 2)]
        return [*found.mean, *differences, np.fmax.reduce(found.highest), np.fmin.reduce(found.lowest)]


class PhaseVelocityGauge(Gauge):
    """Velocity of each phase, averaged over its volume, and its largest speed [m/s]; nan without particles.

    The vertical one of a bubble is its rise velocity.
    """

    needs = Needs.of(Motion)

    def row(self, snapshot: Snapshot) -> list[float]:
        motion = sums_of(snapshot, Motion, self.scene)
        mean = mean_over(motion.volume, motion.flow)
        return [*np.column_stack([mean, motion.max_speed]).ravel()]


class InterfaceLengthGauge(Gauge):
    """Length (3-D: area) of all interfaces between phases, as the device measured it."""

    needs = Needs.of(extra=("interface_length",))

    def row(self, snapshot: Snapshot) -> list[float]:
        return [self.extra(snapshot, "interface_length")]


class WallForceGauge(Gauge):
    """Force of the fluid on the walls: of all bodies together, and of each (`wall_bodies`).

    Of the bodies of the case also the parts of pressure and friction, and the torque about `pivot` [m], or about the
    centre of the surface.
    """

    needs = Needs.of(extra=("wall_force",))

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.bodies = wall_bodies(case)

    def row(self, snapshot: Snapshot) -> list[float]:
        forces = np.array([self._vector(snapshot, "wall_force", body) for body in self.bodies])
        forces = forces.reshape(-1, self.dimension)
        parts = (part for body in self.case.bodies for part in self._parts(snapshot, body))
        return [*forces.sum(axis=0), *forces.ravel(), *parts]

    def _vector(self, snapshot: Snapshot, quantity: str, body: str) -> np.ndarray:
        return np.array([self.extra(snapshot, f"{quantity}_{axis} {body}") for axis in self.axes])

    def _parts(self, snapshot: Snapshot, body: str) -> list[float]:
        force, friction, torque = self._load(snapshot, body)
        return [*(force - friction), *friction, *torque]

    def _load(self, snapshot: Snapshot, body: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force on a body of the case, its part of friction, and the torque about the pivot, (d,), (d,) and (1 or 3,)."""
        force = self._vector(snapshot, "wall_force", body)
        friction = self._vector(snapshot, "wall_friction", body)
        turning = self.axes if self.dimension == 3 else ("z",)
        torque = np.array([self.extra(snapshot, f"wall_torque_{axis} {body}") for axis in turning])
        if self.spec.pivot is not None:
            arm = self._vector(snapshot, "wall_centre", body) - np.array(self.spec.pivot)
            torque = torque + (np.cross(arm, force) if self.dimension == 3 else arm[0] * force[1] - arm[1] * force[0])
        return force, friction, torque


class ForceCoefficientsGauge(WallForceGauge):
    """Drag, lift and moment of bodies over those of a stream: C = F/(q A), Cm = M/(q A L).

    A is the area, in 2-D the length L times a metre of depth. The axis lift x drag is that of the side force and of the
    pitching moment Cm, positive nose up; rolling is about drag, yawing about lift.
    """

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.bodies = chosen_bodies(case, spec)
        self.drag, self.lift = stream_directions(spec, self.dimension)
        self.force_scale = reference_pressure(case, spec) * (spec.area if self.dimension == 3 else spec.length)

    def row(self, snapshot: Snapshot) -> list[float]:
        return [number for body in self.bodies for number in self._coefficients(snapshot, body)]

    def _coefficients(self, snapshot: Snapshot, body: str) -> list[float]:
        """The columns of one body."""
        drag, lift, scale = self.drag, self.lift, self.force_scale
        force, friction, torque = self._load(snapshot, body)
        pressure = force - friction
        if self.dimension == 3:
            side = np.cross(lift, drag)
            moments = [torque @ axis / (scale * self.spec.length) for axis in (side, drag, lift)]
            whole = [force @ drag / scale, force @ lift / scale, force @ side / scale, *moments]
        else:
            about = lift[0] * drag[1] - lift[1] * drag[0]  # z of lift x drag: 1 or -1
            whole = [force @ drag / scale, force @ lift / scale, about * torque[0] / (scale * self.spec.length)]
        return [*whole, *(part @ axis / scale for axis in (drag, lift) for part in (pressure, friction))]
