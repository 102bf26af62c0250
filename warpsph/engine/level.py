"""A level of resolution: particles, neighbour list, numbers and systems; a uniform run has one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import warp as wp

from warpsph.engine.device_clock import DeviceClock
from warpsph.engine.launch import Bindings, Launcher, Task
from warpsph.engine.neighbours import NeighbourList
from warpsph.engine.population import Population
from warpsph.engine.program import Stage
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core import time_signals
from warpsph.kernels.core.block_sums import FOLDS, LANES
from warpsph.kernels.core.spec import Spec

BLOCKS = 512
"""Stretches of particles that are added up each by itself on a CPU."""


class Systems(Protocol):
    """The linear systems of a scheme on one level."""

    written: frozenset[str]
    """fields that solves write"""

    def bind(self) -> None:
        """Bind to the present arrays and list; called again whenever one was replaced."""

    def solve(self, system: str) -> Callable[[], None]:
        """Return what solves a system, from the host or recorded into a graph; KeyError if there is none of that name."""

    def report(self) -> dict[str, Any]:
        """Return sums over the solves so far for the summary of a run."""


class Level:
    """Particles of one resolution and what runs on them.

    Args:
        particles: with the start values of the kept fields.
        launcher: launches kernels.
        clock: shared by all levels.
        values: run-time numbers by kernel argument name: `params`, `phases`, ...
        neighbour_list: keywords of `NeighbourList`.
        systems: makes the linear systems of the scheme, from the level.
        work: further names of arrays that kernels of the scheme may ask for.

    Attributes:
        spec: structure of the run; the list decides `wide_list`.
    """

    def __init__(
        self,
        particles: Population,
        launcher: Launcher,
        clock: DeviceClock,
        values: Mapping[str, Any],
        neighbour_list: Mapping[str, Any],
        systems: Callable[[Level], Systems | None] | None = None,
        work: frozenset[str] = frozenset(),
    ) -> None:
        self.particles, self.launcher, self.clock = particles, launcher, clock
        self._list_keywords = dict(neighbour_list)
        self._make_systems = systems
        self.bindings = Bindings(launcher.device, values, declared=particles.declared | work | time_signals.ARRAYS)
        self.bindings.update(clock.arrays())
        self.bindings.update(advancing=1)
        self._take_particles(int(neighbour_list["width"]))

    def _take_particles(self, width: int) -> None:
        """Bind the arrays of the particles, and make list and systems for as many as there is room for."""
        particles = self.particles
        self.bindings.update(particles.arrays)
        self.bindings.update(particle_count=particles.capacity, fluid_count=particles.fluid_capacity)
        self._make_sums(particles.fluid_capacity)
        if particles.changing:
            particles.live = self.live_count
        self.list = NeighbourList(particles, self.launcher, self.bindings, **{**self._list_keywords, "width": width})
        self.spec: Spec = self.list.spec
        self.systems = self._make_systems(self) if self._make_systems is not None else None

    def _make_sums(self, fluid_count: int) -> None:
        """Bind the partial sums over that many particles, where the volume or the momentum is held."""
        spec, device = self.particles.spec, self.launcher.device
        self._lanes = 1 if self.launcher.is_cpu else LANES
        count = 0
        if spec.volume_constraint or spec.momentum_constraint:
            count = BLOCKS if spec.row_list else max(1, math.ceil(fluid_count / self._lanes))
        self.bindings.update(
            block_count=count,
            volume_sums=wp.zeros(count, dtype=wp.vec2d, device=device),
            momentum_sums=wp.zeros(count, dtype=wp.vec4d, device=device),
        )

    @property
    def written(self) -> frozenset[str]:
        """Fields that are written outside of stages."""
        return self.systems.written if self.systems is not None else frozenset()

    def live_count(self) -> int:
        """Return how many fluid particles there are."""
        return int(self.clock.read()[1][ck.LIVE])

    def grow(self, wanted: int) -> None:
        """Make room for `wanted` fluid particles and half as many again; the list has to be built anew."""
        self.particles.grow(wanted + wanted // 2)
        self._take_particles(self.list.width)

    def widen(self, peak: int) -> None:
        """Give the list room for particles with `peak` neighbours; it has to be built anew."""
        self.list.widen(peak)
        self.spec = self.list.spec

    def rows(self, stage: Stage) -> tuple[int, int]:
        """Return (number of rows, first row) that a stage runs over."""
        if isinstance(stage.rows, int):
            return stage.rows, 0
        particles = self.particles
        named = {
            "fluid": (particles.fluid_capacity, 0),
            "wall": (particles.wall_count, 0),
            "band": (particles.fluid_capacity, 0),
            "blocks": (self.bindings["block_count"] * self._lanes, 0),
            "last": (self._lanes, 0),
            "folds": (FOLDS, 0),
            "one": (1, 0),
        }
        return named[stage.rows] if stage.rows in named else (int(self.bindings[stage.rows].shape[0]), 0)

    def task(self, stage: Stage, values: Mapping[str, Any] | None = None) -> Task:
        """Return the task of a stage on this level, with values of this task alone."""
        rows, start = self.rows(stage)
        arrays = {argument: self.bindings[field] for argument, field in stage.fields.items()}
        special = {**stage.values, **arrays, **(values or {})}
        return self.launcher.task(stage.name, stage.kernel, rows, self.bindings, start, stage.rows == "one", special)
