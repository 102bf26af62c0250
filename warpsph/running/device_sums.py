"""Sums over the phases, the walls and the interfaces, formed on the device of a run: a few numbers come to the host."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import warp as wp

from warpsph.engine.launch import Bindings, Launcher, Task
from warpsph.engine.population import Population
from warpsph.kernels.core import phase_sums
from warpsph.kernels.core.clock import TIME
from warpsph.measure.totals import Energies, PhaseSums, Places, Scene, cut_of, no_cuts

BLOCKS = {True: 256, False: 65536}  # partial sums of each phase, on a CPU and on a GPU
FOLDS = {True: 256, False: 1024}  # what is left of them for the host


class DeviceSums:
    """Forms sums of the present state; what one of them takes is compiled and allocated when it is first asked for.

    Args:
        particles: the fields.
        launcher: launches kernels.
        clock: of the stepper, on the device; it gives the step that velocities are half behind.
        scene: what of the case the sums depend on, with its equations of state.
        spacing: of the particles [m].
        staggered: velocities are half a step behind positions.
    """

    def __init__(
        self, particles: Population, launcher: Launcher, clock: Any, scene: Scene, spacing: float, staggered: bool
    ) -> None:
        self.particles, self.launcher, self.scene, self.staggered = particles, launcher, scene, staggered
        device = launcher.device
        self.zones = "zone" in particles.arrays
        self.blocks, self.folds = BLOCKS[launcher.is_cpu], FOLDS[launcher.is_cpu]
        self.bins = scene.bins(spacing)
        self._cuts = wp.zeros(scene.phase_count, dtype=wp.vec3d, device=device)
        self._periods = wp.zeros(scene.phase_count, dtype=wp.vec3d, device=device)
        self._bindings = Bindings(
            device,
            {
                **particles.arrays,
                "clock": clock,
                "block_count": self.blocks,
                "fluid_count": particles.fluid_capacity,
                "scene": _device_scene(scene),
                "materials": wp.array(_materials(scene), dtype=wp.vec4d, device=device),
                "cuts": self._cuts,
                "periods": self._periods,
            },
            particles.declared | {"normal", "load"},
        )
        self._reductions: dict[str, tuple[list[Callable[[], None]], Any, Any]] = {}

    def form(self, kinds: Iterable[type[PhaseSums]]) -> dict[type, PhaseSums]:
        """Return groups of sums by their class."""
        return {kind: self._form(kind) for kind in kinds}

    def interface_length(self) -> float:
        """Return the volume integral of |grad C| [m^(d-1)] of the normals that the particles hold."""
        return float(self._reduce("interface")[0].sum())

    def body_forces(self, load: Any, bodies: int) -> np.ndarray:
        """Return the force on each of the wall bodies, (bodies, d) [N], from that on each wall particle.

        load: (walls,) Warp array of vectors [N]
        """
        spec, walls = self.particles.spec, self.particles.wall_count
        kernel = phase_sums.make_body_forces(spec.dimension, spec.precision)
        forces = wp.zeros(bodies * self.blocks, dtype=wp.vec3d, device=self.launcher.device)
        special = {"wall_count": walls, "load": load, "forces": forces}
        self.launcher.task("body forces", kernel, bodies * self.blocks, self._bindings, special=special).run()
        fold, forces = self._folding(forces, bodies, largest=False)
        fold()
        total = forces.numpy().reshape(bodies, self.folds, 3).sum(axis=1)
        return np.asarray(total[:, : spec.dimension])

    def _form(self, kind: type[PhaseSums]) -> PhaseSums:
        cuts = no_cuts(self.scene)
        if kind is Places and self.bins.any():
            cuts = self._find_cuts()
            cut = np.isfinite(cuts)
            extent = self.scene.upper - self.scene.lower
            self._cuts.assign(_three(np.where(cut, cuts, 0.0)))
            self._periods.assign(_three(np.where(cut, extent, 0.0)))
        if kind is Energies and self.scene.gravity_varies:
            self._bindings["scene"] = _device_scene(self.scene, float(self._bindings["clock"].numpy()[TIME]))
            self._reductions.pop(kind.group, None)
        totals, largest = self._reduce(kind.group)
        if kind is Places:
            self._periods.zero_()
        return kind.made_of(totals, largest, self.scene, cuts)

    def _reduce(self, group: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the added terms (P, added) and the largest ones (P, kept) of a group."""
        if group not in self._reductions:
            self._reductions[group] = self._reduction(group)
        runs, totals, largest = self._reductions[group]
        for run in runs:
            run()
        shape = self.scene.phase_count, self.folds, -1
        kept = phase_sums.GROUPS[group][1]
        return totals.numpy().reshape(shape).sum(axis=1), largest.numpy().reshape(shape).max(axis=1)[:, :kept]

    def _folding(self, partial: Any, parts: int, largest: bool) -> tuple[Callable[[], None], Any]:
        """Return what folds the partial sums of so many parts, and the array that it leaves."""
        if self.folds == self.blocks:
            return _nothing, partial
        folded = wp.zeros(parts * self.folds, dtype=partial.dtype, device=self.launcher.device)
        kernel = phase_sums.make_fold(partial.dtype, largest)
        special = {"folds": self.folds, "partial": partial, "folded": folded}
        return self.launcher.task("fold", kernel, parts * self.folds, self._bindings, special=special).run, folded

    def _reduction(self, group: str) -> tuple[list[Callable[[], None]], Any, Any]:
        spec = self.particles.spec
        kernel, total, most = phase_sums.make_phase_sums(
            group, spec.dimension, spec.precision, spec.multiphase, self.staggered, self.launcher.is_cpu, self.zones,
            spec.internal_energy,
        )  # fmt: skip
        phases = self.scene.phase_count
        rows = phases * self.blocks
        totals = wp.zeros(rows, dtype=total, device=self.launcher.device)
        largest = wp.zeros(rows, dtype=most, device=self.launcher.device)
        special = {"totals": totals, "largest": largest}
        task = self.launcher.task(f"sums: {group}", kernel, rows, self._bindings, special=special)
        fold, totals = self._folding(totals, phases, largest=False)
        fold_largest, largest = self._folding(largest, phases, largest=True)
        return [task.run, fold, fold_largest], totals, largest

    def _find_cuts(self) -> np.ndarray:
        """Return where the periodic axes are cut for each phase, (P, d) [m]; nan where not."""
        scene, cuts = self.scene, no_cuts(self.scene)
        task, occupied = self._marking
        occupied.zero_()
        task.run()
        marks = occupied.numpy().reshape(scene.phase_count, 3, -1)
        for axis in np.flatnonzero(self.bins):
            lower, length = scene.lower[axis], scene.upper[axis] - scene.lower[axis]
            for phase in range(scene.phase_count):
                cuts[phase, axis] = cut_of(marks[phase, axis, : self.bins[axis]] > 0, lower, length)
        return cuts

    @functools.cached_property
    def _marking(self) -> tuple[Task, Any]:
        """The task that marks which slices of the periodic axes a phase is in, and the marks."""
        spec, scene = self.particles.spec, self.scene
        kernel = phase_sums.make_mark_bins(spec.dimension, spec.precision, spec.multiphase, self.zones)
        most = int(self.bins.max())
        occupied = wp.zeros(scene.phase_count * 3 * most, dtype=wp.uint8, device=self.launcher.device)
        special = {
            "most_bins": most,
            "lower": wp.vec3d(*_three(scene.lower)),
            "extent": wp.vec3d(*_three(scene.upper - scene.lower)),
            "bins": wp.vec3i(*map(int, _three(self.bins))),
            "occupied": occupied,
        }
        return self.launcher.task("bins", kernel, self.particles.fluid_capacity, self._bindings, special=special), occupied


def _nothing() -> None:
    """Fold nothing: a CPU has few partial sums."""


class Nearby:
    """Finds the fluid particles within reach of points on the device.

    Args:
        particles: the fields.
        launcher: launches kernels.
        scene: for the domain.
        reach: m.
    """

    def __init__(self, particles: Population, launcher: Launcher, scene: Scene, reach: float) -> None:
        self.particles, self.launcher, self.scene = particles, launcher, scene
        extent = scene.upper - scene.lower
        self.count = np.maximum((extent / reach).astype(np.int64), 1)
        self.size = extent / self.count
        self._tasks: dict[bytes, Callable[[], None]] = {}
        self._near = wp.zeros(particles.fluid_capacity, dtype=wp.uint8, device=launcher.device)

    def rows(self, points: np.ndarray) -> np.ndarray:
        """Return the rows of fluid particles, in their present order, among which are all within reach of the points.

        points: (n, d) [m]
        """
        key = points.tobytes()
        if key not in self._tasks:
            self._tasks[key] = self._task(self._wanted(points)).run
        self._tasks[key]()
        return np.flatnonzero(self._near.numpy())

    def _wanted(self, points: np.ndarray) -> np.ndarray:
        """The cells of the points and those next to them, (cells along each axis) uint8."""
        scene = self.scene
        wanted = np.zeros(self.count, dtype=np.uint8)
        place = np.floor((points - scene.lower) / self.size).astype(np.int64)
        for step in np.ndindex(*(3,) * scene.dimension):
            cell = place + np.array(step) - 1
            cell = np.where(scene.periodic, cell % self.count, np.clip(cell, 0, self.count - 1))
            wanted[tuple(cell.T)] = 1
        return wanted

    def _task(self, wanted: np.ndarray) -> Task:
        spec, scene, device = self.particles.spec, self.scene, self.launcher.device
        bindings = Bindings(device, self.particles.arrays, self.particles.declared)
        special = {
            "cells_lower": wp.vec3d(*_three(scene.lower)),
            "cell_size": wp.vec3d(*_three(self.size)),
            "cell_count": wp.vec3i(*map(int, _three(self.count))),
            "wraps": wp.vec3i(*map(int, _three(np.array(scene.periodic, float)))),
            "wanted_cells": wp.array(wanted.ravel(), dtype=wp.uint8, device=device),
            "near": self._near,
        }
        kernel = phase_sums.make_mark_near(spec.dimension, spec.precision, "zone" in self.particles.arrays)
        return self.launcher.task("near", kernel, self.particles.fluid_capacity, bindings, special=special)


def _three(values: np.ndarray) -> np.ndarray:
    """Vectors (d,) or (n, d) with three components, float64."""
    padded = np.zeros((*values.shape[:-1], 3))
    padded[..., : values.shape[-1]] = values
    return padded


def _device_scene(scene: Scene, time: float = 0.0) -> Any:
    """The scene as kernels see it, with gravity as it is at a time [s]."""
    result = phase_sums.make_scene()()
    result.gravity = wp.vec3d(*_three(scene.gravity_at(time)))
    result.center = wp.vec3d(*_three(scene.center))
    result.pull = wp.float64(scene.pull)
    result.middle = wp.vec3d(*_three(scene.middle))
    return result


def _materials(scene: Scene) -> np.ndarray:
    """The columns of `materials` for each phase, (P, 4). Raises ValueError without equations of state."""
    if scene.eos is None:
        raise ValueError("the equations of state must be known")
    rows = [
        (eos.density, eos.sound_speed**2 / eos.gamma, eos.gamma - 1.0, eos.background_pressure / eos.density)
        for eos in scene.eos
    ]
    return np.array(rows)
