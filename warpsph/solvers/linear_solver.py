"""Sparse linear systems on the device: an ELL matrix, conjugate gradients and BiCGSTAB over it.

How a scheme uses it::

    matrix = EllMatrix(n, width, launcher, precision)            # arrays columns, values, counts, diagonal
    multigrid = Multigrid(matrix, launcher, ...)                 # see multigrid.py; arrays position, moment
    solver = LinearSolver(matrix, launcher, preconditioner=multigrid, tolerance=1e-6)
    solver.bind(rhs, x)                                          # arrays of the run; x is start value and result

    fill matrix, moment, rhs with kernels of one's own, then
    solver.record()

`record()` on CUDA launches, or records into the graph being captured, the whole solve: set-up of the preconditioner, the
loop as `wp.capture_while`, nothing read back; it may stand inside the body of another `capture_while`. On a CPU device it
runs the loop on the host. `solver.solve(rhs, x)` is the same from the host, with a result. The device keeps the sums over
all solves (`solver.totals()` reads them); an unsuccessful solve is counted there and never hangs: `max_iterations` bounds
every loop.

After `matrix.resize(width)` the arrays are new: bind them again, and capture again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import warp as wp

from warpsph.engine.launch import Bindings, Launcher, Task
from warpsph.errors import CapacityError
from warpsph.kernels.core.block_sums import LANES
from warpsph.kernels.core.spec import types
from warpsph.kernels.linear import solve_state as entry
from warpsph.kernels.linear.krylov import make_kernels
from warpsph.solvers.accuracy import attainable

LARGEST_NARROW = 2**31 - 1  # entries that one 32-bit index reaches
WIDEST_ROW = 32767  # `counts` is 16-bit by default
MOST_BLOCKS = 2048  # partial sums on a CPU, whatever the number of threads
ROWS_OF_BLOCK = 16  # at least, on a CPU

REASONS = {
    entry.CONVERGED: "converged",
    entry.OUT_OF_ITERATIONS: "iterations",
    entry.STALLED: "stalled",
    entry.NOT_FINITE: "nan",
}
REMEDIES = {
    "converged": "",
    "iterations": "max_iterations is reached: raise it, or use the multigrid preconditioner",
    "stalled": "the residual no longer falls: use a looser tolerance or float64; conjugate gradients need a symmetric "
    "positive definite matrix, BiCGSTAB does not",
    "nan": "matrix, right-hand side or start value hold values that are not finite",
}


class EllMatrix:
    """A square sparse matrix with rows of at most `width` entries beside the diagonal, y_i = diagonal_i x_i + sum a_ik x_k.

    An entry may name its own row. A row that is out of the system has count 0, diagonal 1 and right-hand side 0, and no
    other row names it. Entries are laid out like the neighbour list: row by row on a CPU, column by column on a GPU
    (`kernels.pair.make_entry(matrix.row_list)`).

    Args:
        n: rows.
        width: entries a row may have at first.
        launcher: its device holds the arrays.
        precision: "float32" or "float64".
        row_list: layout; by default that of the device.
        count_type: integer type of `counts`.
        wide: see `resize`.

    Attributes:
        columns: int32 (n width,), column of each entry; if `wide` (n, width) or, by columns, (width, n).
        values: real, of the same shape, its value.
        wide: the entries are more than 31 bits number, see `kernels.pair.make_entry`.
        counts: (n,), entries used of each row.
        diagonal: real (n,).
        excess: real (n,), diagonal + sum of the values of a row, the coupling to what is not in the system; the solver
            fills it.
        inverse: real (n,), 1 / diagonal, or 0; the solver fills it.

    Raises:
        CapacityError: the arrays do not fit in memory, or a row has more entries than 16 bits count.
    """

    def __init__(
        self,
        n: int,
        width: int,
        launcher: Launcher,
        precision: str = "float32",
        row_list: bool | None = None,
        count_type: Any = wp.int16,
        wide: bool = False,
    ) -> None:
        self.n = n
        self.precision = precision
        self.device = launcher.device
        self.row_list = launcher.is_cpu if row_list is None else row_list
        self.count_type = count_type
        self.real = types(2, precision).real
        self.version = 0
        self.counts: Any = wp.zeros(n, dtype=count_type, device=self.device)
        self.diagonal: Any = wp.zeros(n, dtype=self.real, device=self.device)
        self.excess: Any = wp.zeros(n, dtype=self.real, device=self.device)
        self.inverse: Any = wp.zeros(n, dtype=self.real, device=self.device)
        self.columns: Any = None
        self.values: Any = None
        self.width = 0
        self.wide = False
        self.resize(width, wide)

    def resize(self, width: int, wide: bool = False) -> None:
        """Replace `columns` and `values` by arrays of `width` entries a row; their content is lost.

        Args:
            width: entries a row may have.
            wide: lay the arrays out for more entries than 31 bits number even if there are fewer.

        Raises:
            CapacityError: the arrays do not fit in memory, or a row has more entries than 16 bits count.
        """
        width = max(width, 1)
        if width > WIDEST_ROW:
            rule = f"a row of {width} entries is more than the {WIDEST_ROW} that can be counted"
            raise CapacityError(f"matrix: {rule}; lower numerics.smoothing_ratio or part the clump of particles",
                                key="numerics.smoothing_ratio")
        self.columns = self.values = None
        try:
            self.wide = wide or width * self.n > LARGEST_NARROW
            shape: Any = width * self.n
            if self.wide:
                shape = (self.n, width) if self.row_list else (width, self.n)
            self.columns = wp.zeros(shape, dtype=int, device=self.device)
            self.values = wp.zeros(shape, dtype=self.real, device=self.device)
        except RuntimeError as error:
            raise CapacityError(f"matrix of {width} entries a row does not fit in memory: {error}") from error
        self.width = width
        self.version += 1

    def memory(self) -> int:
        """Return the bytes of all arrays."""
        arrays = (self.columns, self.values, self.counts, self.diagonal, self.excess, self.inverse)
        return sum(int(array.capacity) for array in arrays)

    def bindings(self) -> dict[str, Any]:
        """Return the arrays by the argument names of the kernels."""
        return {
            "n": self.n,
            "width": self.width,
            "counts": self.counts,
            "columns": self.columns,
            "values": self.values,
            "diagonal": self.diagonal,
            "excess": self.excess,
            "inverse": self.inverse,
        }

    def fill(self, diagonal: np.ndarray, pointers: np.ndarray, columns: np.ndarray, values: np.ndarray) -> None:
        """Fill from host arrays: the entries of row i are those from pointers[i] to pointers[i + 1]; widens if needed.

        Args:
            diagonal: (n,).
            pointers: (n + 1,).
            columns, values: (entries,), without the diagonal.
        """
        counts = np.diff(pointers)
        if counts.max(initial=0) > self.width:
            self.resize(int(counts.max()))
        rows = np.repeat(np.arange(self.n), counts)
        place = np.arange(len(columns)) - np.repeat(pointers[:-1], counts)
        at = rows * self.width + place if self.row_list else place * self.n + rows
        all_columns = np.zeros(self.n * self.width, dtype=np.int32)
        all_values = np.zeros(self.n * self.width, dtype=wp.dtype_to_numpy(self.real))
        all_columns[at] = columns
        all_values[at] = values
        self.columns.assign(all_columns.reshape(self.columns.shape))
        self.values.assign(all_values.reshape(self.values.shape))
        self.counts.assign(counts.astype(wp.dtype_to_numpy(self.count_type)))
        self.diagonal.assign(np.asarray(diagonal, dtype=all_values.dtype))


class Rows:
    """Launches kernels over the rows of a matrix in blocks, with one partial sum a block.

    Args:
        launcher: launches kernels.
        n: rows.
        row_list: rows in stretches, one a block (CPU), instead of one a thread (GPU).
    """

    def __init__(self, launcher: Launcher, n: int, row_list: bool) -> None:
        self.launcher = launcher
        if row_list:
            self.chunk = max(ROWS_OF_BLOCK, math.ceil(n / MOST_BLOCKS))
            self.block_count = max(1, math.ceil(n / self.chunk))
            self.items, self.deciders = self.block_count, 1
        else:
            block = LANES if launcher.device.is_cuda else 1
            self.chunk = 1
            self.block_count = max(1, math.ceil(n / block))
            self.items, self.deciders = self.block_count * block, block

    def sweep(self, name: str, kernel: Any, bindings: Bindings, special: Mapping[str, Any] | None = None) -> Task:
        """Return the task that runs a kernel over all rows."""
        return self.launcher.task(name, kernel, self.items, bindings, special=special)

    def decide(self, name: str, kernel: Any, bindings: Bindings, special: Mapping[str, Any] | None = None) -> Task:
        """Return the task that runs a kernel of one block."""
        return self.launcher.task(name, kernel, self.deciders, bindings, single=True, special=special)


class Preconditioner(Protocol):
    """What a solver needs of a preconditioner object."""

    # factor of r / diagonal in the vector that `tasks` starts from
    weight: float

    def setup_tasks(self) -> Sequence[Task]:
        """Return the tasks that prepare it for the matrix of this solve; `inverse` and `excess` are there."""
        ...

    def tasks(self, rows: Rows, bindings: Bindings, residual: Any, scaled: Any) -> Sequence[Task]:
        """Return the tasks scaled = M residual; scaled holds weight / diagonal residual before.

        The last one leaves residual . scaled in the second entry of the partial sums.
        """
        ...


@dataclass(frozen=True)
class Result:
    """Outcome of a solve.

    Attributes:
        iterations: of the Krylov method.
        residual: |b - A x| / |b| in the 2-norm, evaluated in float64 (with the mean of b taken out of a singular system).
        converged: the tolerance was reached.
        reason: "converged", "iterations", "stalled" or "nan".
        remedy: what to do about it; empty if converged.
        restarts: how often the recurrence began again from the evaluated residual.
    """

    iterations: int
    residual: float
    converged: bool
    reason: str
    remedy: str
    restarts: int


@dataclass(frozen=True)
class Totals:
    """Sums over all solves since `reset_totals`.

    Attributes:
        solves: how many.
        iterations: of all together.
        worst_iterations: most of one solve.
        worst_residual: largest relative residual that a solve ended with.
        failures: solves that did not reach the tolerance.
    """

    solves: int
    iterations: int
    worst_iterations: int
    worst_residual: float
    failures: int


class LinearSolver:
    """Solves A x = b for an `EllMatrix` by preconditioned conjugate gradients or BiCGSTAB.

    Args:
        matrix: the matrix; symmetric positive (semi-)definite for "cg".
        launcher: launches kernels.
        method: "cg" or "bicgstab".
        preconditioner: "none", "jacobi", or an object such as `multigrid.Multigrid`.
        tolerance: relative residual |b - A x| / |b| to reach, at least `attainable(precision)`.
        max_iterations: by default 100 with a preconditioner object, else 500 or 10 sqrt(n), whichever is more.
        singular: the constant (over rows that have entries) is a null vector of A, but for rounding of any size. If it is
            not said, the device finds it out in every solve: no row sum is more than rounding. Where it is one, b is
            projected to zero mean over these rows, and so is x.

    Attributes:
        solution: float64 (n,), the sum that x is rounded from.
        state: float64 (STATE_SIZE,) on the device, see `kernels/linear/solve_state.py`: iterations, residual and reason of
            the last solve and sums over solves.
        flags: int32 on the device; the first entry is 1 while a solve goes on.

    Raises:
        ValueError: unknown method or preconditioner, or a tolerance that the precision cannot give.
    """

    def __init__(
        self,
        matrix: EllMatrix,
        launcher: Launcher,
        method: str = "cg",
        preconditioner: str | Preconditioner = "jacobi",
        tolerance: float = 1.0e-6,
        max_iterations: int | None = None,
        singular: bool = False,
    ) -> None:
        if method not in ("cg", "bicgstab"):
            raise ValueError(f"method: {method!r} is not a solver; choose 'cg' or 'bicgstab'")
        if isinstance(preconditioner, str) and preconditioner not in ("none", "jacobi"):
            raise ValueError(
                f"preconditioner: {preconditioner!r} is none; choose 'none', 'jacobi' or give an object such as a Multigrid"
            )
        if not tolerance >= attainable(matrix.precision):
            raise ValueError(
                f"tolerance: {tolerance:g} is below {attainable(matrix.precision):g}, the least that a solve in "
                f"{matrix.precision} reaches; use a larger one" + (" or float64" if matrix.precision == "float32" else "")
            )
        if max_iterations is None:
            simple = isinstance(preconditioner, str)
            max_iterations = max(500, 10 * math.isqrt(matrix.n)) if simple else 100
        if max_iterations < 1:
            raise ValueError(f"max_iterations: {max_iterations} is below 1")
        self.matrix = matrix
        self.launcher = launcher
        self.method = method
        self.preconditioner = preconditioner
        self.singular = singular
        device, n, real = matrix.device, matrix.n, matrix.real
        self.rows = Rows(launcher, n, matrix.row_list)
        self.state: Any = wp.zeros(entry.STATE_SIZE, dtype=wp.float64, device=device)
        self.flags: Any = wp.zeros(entry.FLAGS_SIZE, dtype=int, device=device)
        self.solution: Any = wp.zeros(n, dtype=wp.float64, device=device)
        names = ["residual", "scaled", "search", "product"]
        if method == "bicgstab":
            names += ["scaled2", "product2", "shadow"]
        self._vectors = {name: wp.zeros(n, dtype=real, device=device) for name in names}
        self._sums: Any = wp.zeros(self.rows.block_count, dtype=wp.vec3d, device=device)
        self._views = (self.state.numpy(), self.flags.numpy()) if launcher.is_cpu else None
        self._rhs: Any = None
        self._x: Any = None
        self._bound = -1
        self._graph: Any = None
        self.begin_tasks: list[Task] = []
        self.iteration_tasks: list[Task] = []
        self.check_tasks: list[Task] = []
        self.end_tasks: list[Task] = []
        self.set_limits(tolerance, max_iterations)

    # what a caller sets and reads --------------------------------------------------------------------------------------

    def set_limits(self, tolerance: float, max_iterations: int) -> None:
        """Set tolerance and most iterations, also between launches of a graph that holds the solve."""
        self._write({entry.TOLERANCE: tolerance, entry.LIMIT: max_iterations})
        self.tolerance, self.max_iterations = tolerance, max_iterations

    def _write(self, entries: Mapping[int, float]) -> None:
        host = self.state.numpy()
        for index, value in entries.items():
            host[index] = value
        if self._views is None:
            self.state.assign(host)

    def result(self) -> Result:
        """Return the outcome of the last solve (waits for the device)."""
        state = self.state.numpy()
        reason = REASONS[int(state[entry.REASON])]
        return Result(
            iterations=int(state[entry.ITERATIONS]),
            residual=float(state[entry.RESIDUAL]),
            converged=reason == "converged",
            reason=reason,
            remedy=REMEDIES[reason],
            restarts=int(state[entry.RESTARTS]),
        )

    def totals(self) -> Totals:
        """Return the sums over all solves since `reset_totals` (waits for the device)."""
        state = self.state.numpy()
        return Totals(
            solves=int(state[entry.SOLVES]),
            iterations=int(state[entry.TOTAL_ITERATIONS]),
            worst_iterations=int(state[entry.WORST_ITERATIONS]),
            worst_residual=float(state[entry.WORST_RESIDUAL]),
            failures=int(state[entry.FAILURES]),
        )

    def reset_totals(self) -> None:
        """Begin the sums over solves anew."""
        names = (entry.SOLVES, entry.TOTAL_ITERATIONS, entry.WORST_ITERATIONS, entry.WORST_RESIDUAL, entry.FAILURES)
        self._write(dict.fromkeys(names, 0.0))

    def memory(self) -> int:
        """Return the bytes of vectors and sums; the matrix and the preconditioner object are not in it."""
        arrays = [*self._vectors.values(), self.solution, self._sums]
        return sum(int(array.capacity) for array in arrays)

    # tasks -------------------------------------------------------------------------------------------------------------

    def bind(self, rhs: Any, x: Any) -> None:
        """Bind right-hand side and result, arrays of at least n entries in the precision of the matrix.

        Args:
            rhs: b; not changed.
            x: start value, overwritten with the solution.
        """
        if self._rhs is rhs and self._x is x and self._bound == self.matrix.version:
            return
        for name, array in (("rhs", rhs), ("x", x)):
            if array.dtype is not self.matrix.real or array.shape[0] < self.matrix.n:
                raise ValueError(
                    f"{name}: {array.shape} of {array.dtype} does not fit {self.matrix.n} rows of {self.matrix.real}"
                )
        self._rhs, self._x, self._bound, self._graph = rhs, x, self.matrix.version, None
        rows, matrix = self.rows, self.matrix
        kernels = make_kernels(matrix.precision, matrix.row_list, matrix.count_type, matrix.wide)
        device = self.matrix.device
        outer = self.preconditioner
        simple = isinstance(outer, str)
        # a weight of 0 stands for no scaling with the diagonal
        weight = outer.weight if not isinstance(outer, str) else float(outer == "jacobi")
        bindings = Bindings(device, self.matrix.bindings())
        bindings.update(
            self._vectors,
            rhs=rhs,
            x=x,
            solution=self.solution,
            sums=self._sums,
            solve_state=self.state,
            solve_flags=self.flags,
            chunk=rows.chunk,
            block_count=rows.block_count,
            weight=self.matrix.real(weight),
            singular=int(self.singular),
            scaled_is_final=int(simple),
        )

        def sweep(kernel: Any, **special: Any) -> Task:
            return rows.sweep("solve", kernel, bindings, special)

        def decide(kernel: Any) -> Task:
            return rows.decide("solve", kernel, bindings)

        def precondition(vector: str) -> list[Task]:
            if isinstance(outer, str):
                return []
            return list(outer.tasks(rows, bindings, self._vectors["residual"], self._vectors[vector]))

        self.begin_tasks = [sweep(kernels.prepare), decide(kernels.decide_prepare), sweep(kernels.release)]
        if not isinstance(outer, str):
            self.begin_tasks += outer.setup_tasks()
        self.check_tasks = [sweep(kernels.evaluate), decide(kernels.decide_evaluate)]
        if self.method == "cg":
            # scaled = M r belongs to the beginning of an iteration: it is not needed after the last one
            head = precondition("scaled")
            if head:
                head.append(decide(kernels.decide_beta))
            self.iteration_tasks = [
                *head,
                sweep(kernels.search),
                sweep(kernels.product),
                decide(kernels.decide_alpha),
                sweep(kernels.update),
                decide(kernels.decide_update),
            ]
        else:
            # the vector that a preconditioner starts from is `search` scaled, not the residual
            first, second = [], []
            if not isinstance(outer, str):
                first = list(outer.tasks(rows, bindings, self._vectors["search"], self._vectors["scaled"]))
                second = precondition("scaled2")
            self.iteration_tasks = [
                sweep(kernels.bi_search),
                *first,
                sweep(kernels.bi_product),
                decide(kernels.decide_bi_alpha),
                sweep(kernels.half_update),
                *second,
                sweep(kernels.bi_second),
                decide(kernels.decide_omega),
                sweep(kernels.bi_update),
                decide(kernels.decide_bi_update),
            ]
        end = self.launcher.task("solve", kernels.decide_end, 1, bindings, single=True)
        self.end_tasks = [
            sweep(kernels.solution_sum), decide(kernels.decide_solution_mean), sweep(kernels.deliver), end,
        ]  # fmt: skip

    def record(self) -> None:
        """Run the solve, or record it into the graph being captured; `bind` comes before.

        Raises:
            RuntimeError: nothing is bound, or the matrix has been resized since.
        """
        if self._bound != self.matrix.version:
            raise RuntimeError("bind the arrays of the solve first, and again after the matrix has been resized")

        def runner(tasks: list[Task]) -> Callable[[], None]:
            def run() -> None:
                for task in tasks:
                    task.run()

            return run

        iteration, check = runner(self.iteration_tasks), runner(self.check_tasks)
        runner(self.begin_tasks)()
        check()
        if self._views is not None:
            flags = self._views[1]
            while flags[entry.ACTIVE]:
                while flags[entry.RUNNING]:
                    iteration()
                check()
        else:
            running = self.flags[entry.RUNNING : entry.RUNNING + 1]

            def body() -> None:
                wp.capture_while(running, iteration)
                check()

            wp.capture_while(self.flags[entry.ACTIVE : entry.ACTIVE + 1], body)
        runner(self.end_tasks)()

    def solve(self, rhs: Any, x: Any) -> Result:
        """Solve A x = rhs from the host, starting from x, and wait for the result.

        Args:
            rhs, x: arrays of at least n entries in the precision of the matrix; x is overwritten.
        """
        self.bind(rhs, x)
        if self.launcher.is_cpu:
            self.record()
        else:
            if self._graph is None:
                # run from the host once, so that every module is loaded before the capture
                self.record()
                result = self.result()
                with wp.ScopedCapture(device=self.matrix.device) as capture:
                    self.record()
                self._graph = capture.graph
                return result
            wp.capture_launch(self._graph)
        return self.result()
