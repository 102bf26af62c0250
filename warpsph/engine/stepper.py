"""The step loop: stages of a scheme bound to the particles, list rebuilds, and the device's clock.

On CUDA the whole loop is one captured graph: `while running: step; if list used up: rebuild`, so nothing is read back
until the target time, the step limit or a fault. On a CPU device the same tasks run from a host loop.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from warpsph.engine.launch import Bindings, Launcher, Task
from warpsph.engine.neighbours import NeighbourList
from warpsph.engine.particles import Particles
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.schemes import riemann
from warpsph.schemes.stage import Stage

# partial sums of a reduction: enough to fill a GPU, few enough to add up on one core
BLOCKS = {True: 512, False: 16384}

WIDEST = 32760  # neighbour counts are 16-bit


class Stepper:
    """Runs time steps.

    Args:
        spec: structure of the run; the list decides `wide_list`.
        particles: its particles, with the start values of the kept fields.
        launcher: launches kernels.
        values: run-time numbers by kernel argument name: `params`, `phases`, `tension`.
        neighbour_list: keywords of `NeighbourList`.
        clock: float64 (CLOCK_SIZE,) start values, see `kernels/core/clock.py`.
        counters: int32 (COUNTERS_SIZE,) start values.
    """

    def __init__(
        self,
        spec: Spec,
        particles: Particles,
        launcher: Launcher,
        values: Mapping[str, Any],
        neighbour_list: Mapping[str, Any],
        clock: np.ndarray,
        counters: np.ndarray,
    ) -> None:
        self.spec = spec
        self.particles = particles
        self.launcher = launcher
        device = launcher.device
        self.clock: Any = wp.array(clock, dtype=wp.float64, device=device)
        self.counters: Any = wp.array(counters, dtype=int, device=device)
        self.maxima = wp.zeros(ck.MAXIMA * launcher.threads, dtype=types_of(spec).real, device=device)
        self.faults = wp.full(launcher.threads, ck.NO_PARTICLE, dtype=int, device=device)
        blocks = BLOCKS[launcher.is_cpu] if spec.volume_constraint or spec.momentum_constraint else 0
        self.bindings = Bindings(device, values)
        self.bindings.update(particles.arrays)
        self.bindings.update(
            clock=self.clock,
            counters=self.counters,
            maxima=self.maxima,
            faults=self.faults,
            particle_count=particles.count,
            fluid_count=particles.fluid_count,
            block_count=blocks,
            volume_sums=wp.zeros(blocks, dtype=wp.vec2d, device=device),
            volume_folds=wp.zeros(ck.FOLDS if blocks else 0, dtype=wp.vec2d, device=device),
            momentum_sums=wp.zeros(blocks, dtype=wp.vec4d, device=device),
            momentum_folds=wp.zeros(ck.FOLDS if blocks else 0, dtype=wp.vec4d, device=device),
            advancing=1,
        )
        self.list = NeighbourList(particles, launcher, self.bindings, **neighbour_list)
        self.spec = self.list.spec
        self._views = (self.clock.numpy(), self.counters.numpy()) if launcher.is_cpu else None
        self._graph: Any = None
        self._allocate()
        self._bind()

    def _allocate(self) -> None:
        """Make what the scheme needs beside particles and list; the list's width is known."""

    def _bind(self) -> None:
        """Bind all stages; needed again whenever an array was replaced."""
        groups = {
            "step": riemann.step(self.spec),
            "start": riemann.start(self.spec),
            "geometry": riemann.geometry(self.spec) if self.spec.interface and self.spec.tension == "none" else [],
        }
        tasks = {name: [self._task(stage) for stage in stages] for name, stages in groups.items()}
        self.step_tasks, self.start_tasks, self.geometry_tasks = tasks["step"], tasks["start"], tasks["geometry"]
        rare = [k for k, stage in enumerate(groups["step"]) if stage.rare]
        first, end = (rare[0], rare[-1] + 1) if rare else (0, 0)
        self.rare = range(first, end)
        self._band_tasks = [
            task
            for name, stages in groups.items()
            for stage, task in zip(stages, tasks[name], strict=True)
            if stage.rows == "band"
        ]
        self.state_task = self._task(riemann.state(self.spec))
        self.restart_clock = self._task(riemann.advance(self.spec), {"advancing": 0})
        self._graph = None

    def _task(self, stage: Stage, special: Mapping[str, Any] | None = None) -> Task:
        particles = self.particles
        rows, start = {
            "fluid": (particles.fluid_count, 0),
            "wall": (particles.wall_count, 0),
            "band": (particles.fluid_count, 0),
            "blocks": (self.bindings["block_count"], 0),
            "folds": (ck.FOLDS, 0),
            "one": (1, 0),
        }[stage.rows]
        single = stage.rows == "one"
        return self.launcher.task(stage.name, stage.kernel, rows, self.bindings, start, single, special)

    # the device's numbers ------------------------------------------------------------------------------------------

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (clock, counters); on a CPU device these are live views, on CUDA host copies."""
        if self._views is not None:
            return self._views
        return self.clock.numpy(), self.counters.numpy()

    def write(self, clock: Mapping[int, float] | None = None, counters: Mapping[int, int] | None = None) -> None:
        """Set entries of clock and counters."""
        for array, entries in ((self.clock, clock), (self.counters, counters)):
            if entries:
                host = array.numpy()
                if self._views is None:
                    host = host.copy()
                for index, value in entries.items():
                    host[index] = value
                if self._views is None:
                    array.assign(host)

    def solves(self) -> dict[str, Any] | None:
        """Return the sums over the pressure solves so far; None for a scheme that has none."""
        return None

    # rebuild -------------------------------------------------------------------------------------------------------

    def rebuild(self, moving: bool = True) -> bool:
        """Rebuild the neighbour list from the host, widening it until it holds every neighbour.

        Args:
            moving: False builds the list of the last build again, from the anchors, after a restart.

        Returns whether the list had to be widened, which stops the loop of steps.
        """
        widened = False
        while True:
            for task in self.list.tasks if moving else self.list.tasks_again:
                task.timed()
            _, counters = self.read()
            if counters[ck.FAULT] != ck.FAULT_LIST:
                break
            self._widen(int(counters[ck.LIST_PEAK]))
            widened = True
        if self.launcher.is_cpu and self.spec.interface:
            band = self.list.band_count(counters)
            for task in self._band_tasks:
                if task.resize is not None:
                    task.resize(band)
        return widened

    def _widen(self, peak: int) -> None:
        self.list.resize(min(int(1.2 * peak) + 4, max(peak + 1, WIDEST)))
        self.spec = self.list.spec
        self._bind()
        self.write(counters={ck.FAULT: 0})

    def prepare(self, fresh: bool) -> None:
        """Build the first list; on a fresh start also evaluate state and acceleration.

        Args:
            fresh: False after a restart, where both are part of the saved state.
        """
        if fresh:
            self.state_task.run()
            self.rebuild()
            for task in self.start_tasks:
                task.run()
            self.maxima_to_clock()
        else:
            clock, counters = (array.copy() for array in self.read())
            maxima = self.maxima.numpy().copy()
            self.rebuild(moving=False)
            self.maxima.assign(maxima)
            kept = {index: clock[index] for index in (ck.OFFSET, ck.CHECK_LASTS)}
            self.write(clock=kept, counters={k: int(counters[k]) for k in (ck.REBUILDS, ck.STRAIGHT)})

    def wall_load(self) -> Any:
        """Return the force of the fluid on each wall particle, a Warp array of (walls,) vectors [N]."""
        load = wp.zeros(self.particles.wall_count, dtype=types_of(self.spec).vec, device=self.launcher.device)
        self._task(riemann.wall_load(self.spec), {"load": load}).run()
        return load

    def maxima_to_clock(self) -> None:
        """Hand speed and acceleration of the start to the clock, which limits the first step with them."""
        maxima = self.maxima.numpy().reshape(-1, ck.MAXIMA).max(axis=0)
        velocity = self.particles.get("velocity")[: self.particles.fluid_count]
        speed = float(np.sqrt((velocity.astype(np.float64) ** 2).sum(axis=1).max(initial=0.0)))
        self.write(
            clock={
                ck.SPEED: speed,
                ck.ACCELERATION: float(np.sqrt(maxima[1])),
                ck.SHIFT: float(np.sqrt(maxima[3])),
            }
        )
        self.maxima.zero_()

    # the loop ------------------------------------------------------------------------------------------------------

    def run(self, target: float, most_steps: int) -> None:
        """Step until the target time [s], at most `most_steps` steps, or until a fault (see `read`)."""
        _, counters = self.read()
        self.write(
            clock={ck.TARGET: target},
            counters={ck.STEP_LIMIT: min(int(counters[ck.STEPS]) + most_steps, 2**31 - 1)},
        )
        self.restart_clock.run()
        if self.launcher.is_cpu:
            self._run_cpu()
        else:
            self._run_cuda()

    def _run_cpu(self) -> None:
        _, counters = self.read()
        self._care_for_list(counters)
        while counters[ck.RUNNING]:
            for k, task in enumerate(self.step_tasks):
                if k not in self.rare or counters[ck.RARE]:
                    task.timed()
            self._care_for_list(counters)

    def _care_for_list(self, counters: np.ndarray) -> None:
        if counters[ck.CHECK]:
            for task in self.list.check_tasks:
                task.timed()
        if counters[ck.REBUILD] and self.rebuild():
            self.restart_clock.run()

    def _run_cuda(self) -> None:
        while True:
            if self._graph is None:
                self._capture()
            wp.capture_launch(self._graph)
            _, counters = self.read()
            if counters[ck.FAULT] != ck.FAULT_LIST:
                return
            # the list was too narrow: the loop stopped before using it
            self._widen(int(counters[ck.LIST_PEAK]))
            self.rebuild()
            self.restart_clock.run()

    def _capture(self) -> None:
        def flag(index: int) -> Any:
            return self.counters[index : index + 1]

        running, care, unsure, used_up = flag(ck.RUNNING), flag(ck.CARE), flag(ck.CHECK), flag(ck.REBUILD)
        tasks, rare = self.step_tasks, self.rare

        def rare_tasks() -> None:
            for k in rare:
                tasks[k].run()

        def check() -> None:
            for task in self.list.check_tasks:
                task.run()

        def rebuild() -> None:
            for task in self.list.tasks:
                task.run()

        def care_for_list() -> None:
            wp.capture_if(unsure, check)
            wp.capture_if(used_up, rebuild)

        def body() -> None:
            for task in tasks[: rare.start]:
                task.run()
            if rare:
                wp.capture_if(flag(ck.RARE), rare_tasks)
            for task in tasks[rare.stop :]:
                task.run()
            # last in the step: a list that proves too narrow stops the loop before anything reads it; one condition where
            # nothing is to be done, because each costs some microseconds
            wp.capture_if(care, care_for_list)

        with wp.ScopedCapture(device=self.launcher.device) as capture:
            wp.capture_if(care, care_for_list)
            wp.capture_while(running, body)
        self._graph = capture.graph
