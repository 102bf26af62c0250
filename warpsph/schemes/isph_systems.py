"""The linear systems of projection ISPH on a level: pressure, and implicit viscosity."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.fields import FLUID
from warpsph.kernels.core.spec import types_of
from warpsph.solvers.linear_solver import EllMatrix, LinearSolver

if TYPE_CHECKING:
    from warpsph.engine.level import Level

VISCOUS_TOLERANCE = 100.0  # of the viscous equation over that of the pressure equation


class IsphSystems:
    """Matrix and solvers.

    Args:
        level: particles and list that they belong to.
        options: method, preconditioner, tolerance, maximum_iterations; singular: nothing gives the pressure; lower, upper,
            spacing [m] of the multigrid.
    """

    written = frozenset({"unknown"})

    def __init__(self, level: Level, options: Mapping[str, Any]) -> None:
        self.level, self.options = level, options
        spec, launcher = level.spec, level.launcher
        rows = level.particles.fluid_capacity
        self.matrix = EllMatrix(rows, level.list.width, launcher, spec.precision, spec.row_list, wide=spec.wide_list)
        self.moment: Any = wp.zeros(rows, dtype=types_of(spec).mat, device=launcher.device)
        self.solver = LinearSolver(
            self.matrix,
            launcher,
            method=options["method"],
            preconditioner=self._preconditioner(),
            tolerance=options["tolerance"],
            max_iterations=options["maximum_iterations"],
            singular=options["singular"],
        )
        self.viscous_solver: LinearSolver | None = None
        if spec.implicit_viscosity:
            # The matrix of the pressure takes the viscous one first. It is close to the identity: the diagonal will do.
            self.viscous_solver = LinearSolver(
                self.matrix,
                launcher,
                tolerance=min(VISCOUS_TOLERANCE * options["tolerance"], 0.01),
                max_iterations=options["maximum_iterations"],
            )

    def _preconditioner(self) -> Any:
        level, options, spec = self.level, self.options, self.level.spec
        if options["preconditioner"] != "multigrid":
            return options["preconditioner"]
        from warpsph.solvers.multigrid import Multigrid

        return Multigrid(
            self.matrix,
            level.launcher,
            spec.dimension,
            spec.precision,
            spec.row_list,
            lower=options["lower"],
            upper=options["upper"],
            spacing=options["spacing"],
            periodic=spec.periodic,
            position=level.particles.arrays["position"],
            moment=self.moment,
        )

    def bind(self) -> None:
        """Bind to the present arrays, the matrix as wide as the list."""
        level, matrix = self.level, self.matrix
        if matrix.width != level.list.width:
            matrix.resize(level.list.width, level.spec.wide_list)
        level.bindings.update(
            matrix_width=matrix.width,
            matrix_columns=matrix.columns,
            matrix_values=matrix.values,
            matrix_counts=matrix.counts,
            matrix_diagonal=matrix.diagonal,
            matrix_moment=self.moment,
        )
        arrays = level.particles.arrays
        for solver in (self.solver, self.viscous_solver):
            if solver is not None:
                solver.bind(arrays["source"], arrays["unknown"])

    def solve(self, system: str) -> Callable[[], None]:
        """Return what solves "pressure" or "viscosity"."""
        solver = {"pressure": self.solver, "viscosity": self.viscous_solver}[system]
        assert solver is not None
        return solver.record

    def report(self) -> dict[str, Any]:
        """Return the sums over the pressure solves so far, what was asked for, and the divergence that is left over.

        `divergence` is the root mean square of div u after the last step inside the fluid [1/s]; `divergence_h_over_u` the
        same times h over the largest speed. `viscosity` holds the sums over the solves of implicit viscosity, if any.
        """
        totals: dict[str, Any] = dataclasses.asdict(self.solver.totals())
        if self.viscous_solver is not None:
            solver = self.viscous_solver
            totals["viscosity"] = {"tolerance": solver.tolerance, **dataclasses.asdict(solver.totals())}
        named = {key: self.options[key] for key in ("method", "preconditioner", "tolerance", "maximum_iterations")}
        particles = self.level.particles
        inside = particles.get("surface") == 0
        if "zone" in particles.arrays:
            inside &= particles.get("zone") == FLUID
        left = particles.get("dilation")[inside].astype(float)
        divergence = float(np.sqrt(np.mean(left**2))) if len(left) else 0.0
        speed = float(self.level.clock.read()[0][ck.SPEED])
        relative = divergence * float(self.level.bindings["params"].h) / speed if speed > 0 else 0.0
        return {**named, **totals, "divergence": divergence, "divergence_h_over_u": relative}
