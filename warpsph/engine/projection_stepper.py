"""The step loop of projection ISPH: move, list, predict, solve, correct.

The list is made in the middle of the step. Where it proves too narrow the rest of the step is left out, the host widens
it and does that rest, so that no step ever uses a truncated list.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import warp as wp

from warpsph.engine.launch import Task
from warpsph.engine.stepper import Stepper
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.spec import types_of
from warpsph.schemes import isph
from warpsph.solvers.linear_solver import EllMatrix, LinearSolver

# Solves of the first step: the pressure equation refers to the last pressure gradient, which is not known yet.
FIRST_PASSES = 8  # each leaves a tenth of the error
VISCOUS_TOLERANCE = 100.0  # of the viscous equation over that of the pressure equation


class ProjectionStepper(Stepper):
    """Runs time steps of projection ISPH; arguments as for `Stepper`, with those of the solver.

    Args:
        solver: method, preconditioner, tolerance, maximum_iterations; lower, upper, spacing [m] of the multigrid.
    """

    def __init__(self, *arguments: Any, solver: dict[str, Any], **options: Any) -> None:
        self.solver_options = solver
        super().__init__(*arguments, **options)

    def _allocate(self) -> None:
        spec, launcher, options = self.spec, self.launcher, self.solver_options
        rows = self.particles.fluid_count
        self.matrix = EllMatrix(rows, self.list.width, launcher, spec.precision, spec.row_list, wide=spec.wide_list)
        types = types_of(spec)
        device = launcher.device
        self.moment: Any = wp.zeros(rows, dtype=types.mat, device=device)
        preconditioner: Any = options["preconditioner"]
        if preconditioner == "multigrid":
            from warpsph.solvers.multigrid import Multigrid

            preconditioner = Multigrid(
                self.matrix,
                launcher,
                spec.dimension,
                spec.precision,
                spec.row_list,
                lower=options["lower"],
                upper=options["upper"],
                spacing=options["spacing"],
                periodic=spec.periodic,
                position=self.particles.arrays["position"],
                moment=self.moment,
            )
        self.solver = LinearSolver(
            self.matrix,
            launcher,
            method=options["method"],
            preconditioner=preconditioner,
            tolerance=options["tolerance"],
            max_iterations=options["maximum_iterations"],
            singular=not spec.free_surface,
        )
        self.solve_task = Task("solve", self.solver.record)
        self.viscous_solver: LinearSolver | None = None
        if spec.implicit_viscosity:
            # The matrix of the pressure takes the viscous one first. It is close to the identity: the diagonal will do.
            self.viscous_solver = LinearSolver(
                self.matrix,
                launcher,
                tolerance=min(VISCOUS_TOLERANCE * options["tolerance"], 0.01),
                max_iterations=options["maximum_iterations"],
            )

    def _bind(self) -> None:
        spec = self.spec
        matrix, arrays = self.matrix, self.particles.arrays
        if matrix.width != self.list.width:
            matrix.resize(self.list.width, spec.wide_list)
        self.bindings.update(
            matrix_width=matrix.width,
            matrix_columns=matrix.columns,
            matrix_values=matrix.values,
            matrix_counts=matrix.counts,
            matrix_diagonal=matrix.diagonal,
            matrix_moment=self.moment,
        )
        self.solver.bind(arrays["source"], arrays["unknown"])

        def bound(stages: Any) -> list[Task]:
            return [self._task(stage) for stage in stages]

        self.move_tasks = bound(isph.move(spec))
        self.look_tasks = [*bound(isph.look(spec)), *self._diffusion()]
        self.equation_tasks = [*bound(isph.equation(spec)), self.solve_task]
        self.finish_tasks = bound(isph.finish(spec))
        accept, correct = isph.take(spec)
        self.gradient_tasks = [self._task(accept), self._task(correct, {"advancing": 0})]
        self.step_tasks = [*self.move_tasks, *self.look_tasks, *self.equation_tasks, *self.finish_tasks]
        self.start_tasks, self.geometry_tasks, self._band_tasks = [], [], []
        self.rare = range(0)
        self.restart_clock = self._task(isph.advance(spec), {"advancing": 0})
        self._graph = None

    def _diffusion(self) -> list[Task]:
        """Return the tasks of implicit viscosity, one component after the other."""
        solver, spec = self.viscous_solver, self.spec
        if solver is None:
            return []
        arrays = self.particles.arrays
        solver.bind(arrays["source"], arrays["unknown"])
        fill, source, take = isph.diffuse(spec)
        each = isph.component_wise(spec.viscosity, self.bindings["sides"].kind.numpy())
        tasks = []
        for component in range(spec.dimension):
            special = {"component": component}
            if each or component == 0:
                tasks.append(self._task(fill, special))
            tasks += [self._task(source, special), Task("diffusion_solve", solver.record), self._task(take, special)]
        return tasks

    def solves(self) -> dict[str, Any]:
        """Return the sums over the pressure solves so far, what was asked for, and the divergence that is left over.

        `divergence` is the root mean square of div u after the last step inside the fluid [1/s]; `divergence_h_over_u` the
        same times h over the largest speed. `viscosity` holds the sums over the solves of implicit viscosity, if any.
        """
        totals: dict[str, Any] = dataclasses.asdict(self.solver.totals())
        if self.viscous_solver is not None:
            solver = self.viscous_solver
            totals["viscosity"] = {"tolerance": solver.tolerance, **dataclasses.asdict(solver.totals())}
        options = self.solver_options
        named = {key: options[key] for key in ("method", "preconditioner", "tolerance", "maximum_iterations")}
        inside = self.particles.get("surface") == 0
        left = self.particles.get("dilation")[inside].astype(float)
        divergence = float(np.sqrt(np.mean(left**2))) if inside.any() else 0.0
        speed = float(self.read()[0][ck.SPEED])
        relative = divergence * float(self.bindings["params"].h) / speed if speed > 0 else 0.0
        return {**named, **totals, "divergence": divergence, "divergence_h_over_u": relative}

    # start -------------------------------------------------------------------------------------------------------------

    def prepare(self, fresh: bool) -> None:
        """Build the first list; on a fresh start also find the gradient of the start pressure.

        Args:
            fresh: False after a restart, where it is part of the saved state.
        """
        if not fresh:
            return
        self.rebuild()
        for task in self.look_tasks:
            if task.name in ("wall_state", "predict"):  # the surface stage would overwrite the start pressure
                task.run()
        self.gradient_tasks[-1].run()
        self.maxima_to_clock()

    def _first_step(self) -> None:
        """Do the first step from the host, with a pressure equation that knows its own gradient."""
        for task in self.move_tasks:
            task.run()
        self.rebuild()
        for task in self.look_tasks:
            task.run()
        for number in range(FIRST_PASSES):
            for task in self.equation_tasks:
                task.run()
            if number < FIRST_PASSES - 1:
                for task in [*self.gradient_tasks, *self.look_tasks]:
                    task.run()
        for task in self.finish_tasks:
            task.run()

    # the loop ----------------------------------------------------------------------------------------------------------

    def run(self, target: float, most_steps: int) -> None:
        """Step until the target time [s], at most `most_steps` steps, or until a fault (see `read`)."""
        _, counters = self.read()
        if counters[ck.STEPS] == 0 and most_steps > 0:
            self.write(clock={ck.TARGET: target}, counters={ck.STEP_LIMIT: 1})
            self.restart_clock.run()
            if self.read()[1][ck.RUNNING]:
                self._first_step()
            if most_steps == 1:
                return
            most_steps -= 1
        super().run(target, most_steps)

    def _run_cpu(self) -> None:
        _, counters = self.read()
        while counters[ck.RUNNING]:
            for task in self.move_tasks:
                task.timed()
            self.rebuild()
            for task in (*self.look_tasks, *self.equation_tasks, *self.finish_tasks):
                task.timed()

    def _rest(self) -> None:
        for task in (*self.look_tasks, *self.equation_tasks, *self.finish_tasks):
            task.run()

    def _run_cuda(self) -> None:
        while True:
            if self._graph is None:
                self._capture()
            wp.capture_launch(self._graph)
            _, counters = self.read()
            if counters[ck.FAULT] != ck.FAULT_LIST:
                return
            # the list was too narrow: the loop stopped in the middle of a step
            self._widen(int(counters[ck.LIST_PEAK]))
            self.rebuild()
            self._rest()

    def _capture(self) -> None:
        running = self.counters[ck.RUNNING : ck.RUNNING + 1]

        def body() -> None:
            for task in (*self.move_tasks, *self.list.tasks):
                task.run()
            # a list that proves too narrow stops the loop before anything reads it
            wp.capture_if(running, self._rest)

        with wp.ScopedCapture(device=self.launcher.device) as capture:
            wp.capture_while(running, body)
        self._graph = capture.graph
