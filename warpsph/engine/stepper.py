"""The step loop: the program of a scheme bound to levels, list rebuilds, growth, and the device's clock.

On CUDA the whole loop is one captured graph: nothing is read back until the target time, the step limit, a fault, or a
node that finds that there is no room. That stops the loop in the middle of a step; the host makes room, does the rest of the
step and starts the loop again. On a CPU device the same nodes run from a host loop.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import warp as wp

from warpsph.engine import audit
from warpsph.engine.device_clock import DeviceClock
from warpsph.engine.launch import Task
from warpsph.engine.level import Level
from warpsph.engine.program import (
    STOPPING,
    Births,
    BuildList,
    ForEachLevel,
    KeepList,
    Node,
    Program,
    Rarely,
    Solve,
    Stage,
    Substeps,
)
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.spec import Spec

STOPS = {ck.FAULT_LIST: (BuildList, KeepList), ck.FAULT_CAPACITY: (Births,)}


class HasProgram(Protocol):
    """What the loop needs of a scheme."""

    def program(self, spec: Spec, choices: Mapping[str, Any]) -> Program:
        """Return the program of a structure."""


class Stepper:
    """Runs time steps.

    Args:
        scheme: gives the program.
        levels: particles with their start values, the coarsest first; a uniform run has one.
        clock: of all levels.
        choices: of the numerics, which the program may depend on.
    """

    def __init__(
        self, scheme: HasProgram, levels: Sequence[Level], clock: DeviceClock, choices: Mapping[str, Any] | None = None
    ) -> None:
        self.scheme, self.levels, self._clock, self.choices = scheme, list(levels), clock, dict(choices or {})
        self.launcher = levels[0].launcher
        self.nodes, self.start_nodes, self.first_nodes, self.changes = Bound(self), Bound(self), Bound(self), Bound(self)
        self.births: dict[str, Bound] = {}
        self._started = False
        self._bind()

    # what a uniform run has one of -----------------------------------------------------------------------------------

    @property
    def spec(self) -> Spec:
        """Structure of the first level."""
        return self.levels[0].spec

    @property
    def particles(self) -> Any:
        """Population of the first level."""
        return self.levels[0].particles

    @property
    def bindings(self) -> Any:
        """Kernel arguments of the first level."""
        return self.levels[0].bindings

    @property
    def list(self) -> Any:
        """Neighbour list of the first level."""
        return self.levels[0].list

    @property
    def systems(self) -> Any:
        """Linear systems of the first level; None for a scheme that has none."""
        return self.levels[0].systems

    @property
    def clock(self) -> Any:
        """The clock's array."""
        return self._clock.clock

    @property
    def counters(self) -> Any:
        """The counters' array."""
        return self._clock.counters

    @property
    def maxima(self) -> Any:
        """The maxima of each thread."""
        return self._clock.maxima

    @property
    def faults(self) -> Any:
        """The fault of each thread."""
        return self._clock.faults

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (clock, counters); on a CPU device these are live views, on CUDA host copies."""
        return self._clock.read()

    def write(self, clock: Any = None, counters: Any = None) -> None:
        """Set entries of clock and counters."""
        self._clock.write(clock, counters)

    # binding -----------------------------------------------------------------------------------------------------------

    def _bind(self) -> None:
        """Bind all nodes; needed again whenever an array was replaced. Arguments are checked before anything compiles."""
        self.program = self.scheme.program(self.spec, self.choices)
        for level in self.levels:
            if level.systems is not None:
                level.systems.bind()
            audit.check(self.program, level.bindings, level.particles, level.written)
        self._sized: list[tuple[Task, Level, str]] = []
        self.nodes.bind(self.program.step, self.levels)
        self.start_nodes.bind(self.program.start, self.levels)
        self.first_nodes.bind(self.program.first or (), self.levels)
        self.changes.bind(self.program.changes, self.levels)
        self._measures: dict[str, Bound] = {}
        self.restart_clock = self.levels[0].task(self.program.advance, {"advancing": 0})
        self._graph: Any = None

    @property
    def step_tasks(self) -> Sequence[Task]:
        """The tasks of a step in the order in which they run, without those of the list."""
        return self.nodes.tasks

    def task(self, stage: Stage, level: Level) -> Task:
        """Return the task of a stage on a level; its size follows that of the band or the live count."""
        task = level.task(stage)
        if stage.rows == "band" or (stage.rows == "fluid" and level.particles.changing):
            self._sized.append((task, level, stage.rows))
        return task

    def measure(self, name: str) -> None:
        """Run the nodes that a gauge needs, see `Program.measures`."""
        if name not in self._measures:
            self._measures[name] = Bound(self).bind(self.program.measures[name], self.levels)
            self._resize()
        self._measures[name].run()

    # the list ----------------------------------------------------------------------------------------------------------

    def rebuild(self, moving: bool = True) -> bool:
        """Rebuild the neighbour lists from the host, widening them until they hold every neighbour.

        Args:
            moving: False builds the list of the last build again, from the anchors, after a restart.

        Returns whether one had to be widened, which stops the loop of steps.
        """
        widened = self._change() if moving else False
        for level in self.levels:
            while True:
                for task in level.list.tasks if moving else level.list.tasks_again:
                    task.timed()
                _, counters = self.read()
                if counters[ck.FAULT] != ck.FAULT_LIST:
                    break
                level.widen(int(counters[ck.LIST_PEAK]))
                self._bind()
                self.write(counters={ck.FAULT: 0, ck.ROOM: 1})
                widened = True
        self._resize()
        return widened

    def _change(self) -> bool:
        """Run the changes that come before a list, making room until all births fit; return whether any had to be made."""
        grown = False
        self.changes.run()
        while self.program.changes and self.read()[1][ck.FAULT] == ck.FAULT_CAPACITY:
            _, counters = self.read()
            self.grow(int(counters[ck.WANTED]), int(counters[ck.GROWING]))
            self.changes.run()
            grown = True
        return grown

    def _resize(self) -> None:
        """Let a CPU device run over the rows that there are; on CUDA the kernels return beyond them."""
        if not self.launcher.is_cpu:
            return
        _, counters = self.read()
        for task, level, rows in self._sized:
            if task.resize is None:
                continue
            if rows == "band" and level.spec.interface:
                task.resize(int(counters[ck.BAND_COUNT]))
            elif rows == "fluid":
                task.resize(level.particles.fluid_count)

    def care_for_list(self) -> None:
        """Check the lists, and make them anew where they are used up."""
        _, counters = self.read()
        if counters[ck.CHECK]:
            for level in self.levels:
                for task in level.list.check_tasks:
                    task.timed()
        if self.read()[1][ck.REBUILD] and self.rebuild():
            self.restart_clock.run()

    def grow(self, wanted: int, level: int = 0) -> None:
        """Make room for `wanted` fluid particles on a level; its list has to be built anew."""
        self.levels[level].grow(wanted)
        self.write(counters={ck.FAULT: 0, ck.ROOM: 1, ck.CHECK: 0})
        self._bind()
        self._resize()

    def give_birth(self, name: str) -> None:
        """Run births from the host until there is room for all."""
        self.births[name].run()
        while self.read()[1][ck.FAULT] == ck.FAULT_CAPACITY:
            _, counters = self.read()
            self.grow(int(counters[ck.WANTED]), int(counters[ck.GROWING]))
            self.restart_clock.run()  # the fault had ended the loop
            self.births[name].run()

    # start ---------------------------------------------------------------------------------------------------------------

    def prepare(self, fresh: bool) -> None:
        """Build the first list; on a fresh start also run the scheme's nodes of the start.

        Args:
            fresh: False after a restart, where what they find is part of the saved state. The list of the last build is
                built again: a step may begin with it, and gauges and outputs right after the restart look at it.

        Raises RuntimeError for a second fresh start where particles come and go: it would fill the buffers again.
        """
        if fresh:
            if self.program.changes and self._started:
                raise RuntimeError("the start is prepared already: inlets and outlets have their particles")
            self._started = True
            self.start_nodes.run()
            self._maxima_to_clock()
        else:
            clock, counters = (array.copy() for array in self.read())
            maxima = self.maxima.numpy().copy()
            self.rebuild(moving=False)
            self.maxima.assign(maxima)
            kept = {index: clock[index] for index in (ck.OFFSET, ck.CHECK_LASTS)}
            self.write(clock=kept, counters={k: int(counters[k]) for k in (ck.REBUILDS, ck.STRAIGHT)})

    def _maxima_to_clock(self) -> None:
        """Hand speed and acceleration of the start to the clock, which limits the first step with them."""
        maxima = self.maxima.numpy().reshape(-1, ck.MAXIMA).max(axis=0)
        speed = 0.0
        for level in self.levels:
            velocity = level.particles.get("velocity")[: level.particles.fluid_count].astype(np.float64)
            speed = max(speed, float(np.sqrt((velocity**2).sum(axis=1).max(initial=0.0))))
        self.write(
            clock={
                ck.SPEED: speed,
                ck.ACCELERATION: float(np.sqrt(maxima[1])),
                ck.SHIFT: float(np.sqrt(maxima[3])),
            }
        )
        self.maxima.zero_()

    # the loop ------------------------------------------------------------------------------------------------------------

    def run(self, target: float, most_steps: int) -> None:
        """Step until the target time [s], at most `most_steps` steps, or until a fault (see `read`)."""
        _, counters = self.read()
        if self.program.first is not None and counters[ck.STEPS] == 0 and most_steps > 0:
            self.write(clock={ck.TARGET: target}, counters={ck.STEP_LIMIT: 1, ck.ROOM: 1})
            self.restart_clock.run()
            if self.read()[1][ck.RUNNING]:
                self.first_nodes.run()
            if most_steps == 1:
                return
            most_steps -= 1
        _, counters = self.read()
        self.write(
            clock={ck.TARGET: target},
            counters={ck.STEP_LIMIT: min(int(counters[ck.STEPS]) + most_steps, 2**31 - 1), ck.ROOM: 1},
        )
        self.restart_clock.run()
        if self.launcher.is_cpu:
            self._run_cpu()
        else:
            self._run_cuda()

    def _run_cpu(self) -> None:
        _, counters = self.read()
        if self.nodes.keeps_list:
            self.care_for_list()
        while counters[ck.RUNNING]:
            self.nodes.run()

    def _run_cuda(self) -> None:
        while True:
            if self._graph is None:
                self._capture()
            wp.capture_launch(self._graph)
            _, counters = self.read()
            fault = int(counters[ck.FAULT])
            if fault not in STOPS:
                return
            self._go_on(fault)

    def _go_on(self, fault: int) -> None:
        """Make room where a node found none, and do the rest of the step from the host."""
        in_list = fault == ck.FAULT_LIST or bool(self.program.changes)
        stops = STOPS[ck.FAULT_LIST if in_list else fault]
        place = next(k for k, node in enumerate(self.program.step) if isinstance(node, stops))
        if in_list:
            _, counters = self.read()
            if fault == ck.FAULT_LIST:
                for level in self.levels:
                    level.widen(int(counters[ck.LIST_PEAK]))
                self.write(counters={ck.FAULT: 0, ck.ROOM: 1})
                self._bind()
            else:
                self.grow(int(counters[ck.WANTED]), int(counters[ck.GROWING]))
            self.rebuild()
            place += 1
        self.nodes.run(place)
        if place == len(self.program.step):
            self.restart_clock.run()

    def record_care(self) -> None:
        """Record `care_for_list` into a graph: one condition where nothing is to be done, since each costs time."""

        def check() -> None:
            for level in self.levels:
                for task in level.list.check_tasks:
                    task.run()

        def care() -> None:
            wp.capture_if(self._clock.flag(ck.CHECK), check)
            wp.capture_if(self._clock.flag(ck.REBUILD), self.record_rebuild)

        wp.capture_if(self._clock.flag(ck.CARE), care)

    def record_rebuild(self) -> None:
        """Record a rebuild of all lists into a graph; it is left out where births before it find no room."""

        def build() -> None:
            for level in self.levels:
                for task in level.list.tasks:
                    task.run()

        if self.program.changes:
            self.changes.record()
            wp.capture_if(self._clock.flag(ck.ROOM), build)
        else:
            build()

    def flag(self, index: int) -> Any:
        """Return the array of one counter, for a condition of a captured graph."""
        return self._clock.flag(index)

    def _capture(self) -> None:
        with wp.ScopedCapture(device=self.launcher.device) as capture:
            if self.nodes.keeps_list:
                self.record_care()
            wp.capture_while(self.flag(ck.RUNNING), self.nodes.record)
        self._graph = capture.graph

    def timings(self) -> dict[str, float]:
        """Return the seconds spent in each node so far, by its name; tasks of the list are named `list: ...`."""
        seconds: dict[str, float] = {}
        lists = [task for level in self.levels for task in (*level.list.tasks, *level.list.check_tasks)] + self.changes.tasks
        for label, task in [(t.name, t) for t in self.step_tasks] + [(f"list: {t.name}", t) for t in lists]:
            seconds[label] = seconds.get(label, 0.0) + task.seconds
        return seconds


class Bound:
    """Nodes bound to the levels of a stepper: each has a way to run from the host and one to be recorded into a graph.

    Attributes:
        tasks: those of all nodes, lists excepted, in the order in which they run.
        keeps_list: a `KeepList` is among them, so that a loop has to begin with a look at the list.
    """

    def __init__(self, stepper: Stepper) -> None:
        self.stepper = stepper
        self.tasks: list[Task] = []
        self.keeps_list = False
        self._host: list[Callable[[], None]] = []
        self._device: list[Callable[[], None]] = []
        self._stops: set[int] = set()

    def bind(self, nodes: Sequence[Node], levels: Sequence[Level]) -> Bound:
        """Bind to the present arrays, in the place of what was bound before; return self."""
        self.tasks, self._host, self._device, self._stops = [], [], [], set()
        self.keeps_list = any(isinstance(node, KeepList) for node in nodes)
        for node in nodes:
            if isinstance(node, STOPPING):
                self._stops.add(len(self._host))
            self._add(node, levels)
        return self

    def run(self, begin: int = 0) -> None:
        """Run the nodes from number `begin` on from the host; one that makes room may bind all anew meanwhile."""
        k = begin
        while k < len(self._host):
            self._host[k]()
            k += 1

    def record(self, begin: int = 0) -> None:
        """Record the nodes into a graph; what follows one that finds no room is left out then."""
        for k in range(begin, len(self._device)):
            self._device[k]()
            if k in self._stops and k + 1 < len(self._device):
                wp.capture_if(self.stepper.flag(ck.ROOM), functools.partial(self.record, k + 1))
                return

    def _add(self, node: Node, levels: Sequence[Level]) -> None:
        stepper = self.stepper
        if isinstance(node, Stage):
            # there is one clock, whatever the number of levels
            once = node.kernel is stepper.program.advance.kernel
            for level in levels[:1] if once else levels:
                self._add_task(stepper.task(node, level))
        elif isinstance(node, Solve):
            for level in levels:
                assert level.systems is not None, f"{node.name}: the scheme has no linear systems"
                self._add_task(Task(node.name, level.systems.solve(node.system)))
        elif isinstance(node, BuildList):
            self._host.append(lambda: _ignore(stepper.rebuild()))
            self._device.append(stepper.record_rebuild)
        elif isinstance(node, KeepList):
            self._host.append(stepper.care_for_list)
            self._device.append(stepper.record_care)
        else:
            self._add_group(node, levels)

    def _add_task(self, task: Task) -> None:
        self.tasks.append(task)
        self._host.append(task.timed)
        self._device.append(task.run)

    def _add_group(self, node: Node, levels: Sequence[Level]) -> None:
        stepper = self.stepper
        if isinstance(node, ForEachLevel):
            # level by level, where stages outside run one by one on all levels
            for level in levels:
                self._add_inner(Bound(stepper).bind(node.nodes, [level]))
        elif isinstance(node, Substeps):
            inner = Bound(stepper).bind(node.nodes, levels)
            for _ in range(node.times):
                self._add_inner(inner)
        elif isinstance(node, Rarely):
            inner = Bound(stepper).bind(node.nodes, levels)
            self.tasks += inner.tasks

            def run() -> None:
                if stepper.read()[1][ck.RARE]:
                    inner.run()

            self._host.append(run)
            self._device.append(lambda: wp.capture_if(stepper.flag(ck.RARE), inner.record))
        elif isinstance(node, Births):
            inner = stepper.births[node.name] = Bound(stepper).bind(list(node.stages), levels)
            self.tasks += inner.tasks
            self._host.append(functools.partial(stepper.give_birth, node.name))
            self._device.append(inner.record)

    def _add_inner(self, inner: Bound) -> None:
        self.tasks += [task for task in inner.tasks if task not in self.tasks]
        self._host.append(inner.run)
        self._device.append(inner.record)


def _ignore(_: Any) -> None:
    """Take a result that nobody asks for."""
