"""Multigrid preconditioner of `LinearSolver` for symmetric systems of particles, rebuilt from them in every solve.

How a scheme uses it::

    multigrid = Multigrid(matrix, launcher, dimension, precision, row_list, lower, upper, spacing, periodic)
    solver = LinearSolver(matrix, launcher, preconditioner=multigrid, tolerance=1e-6)

Beside the matrix the scheme fills `multigrid.moment`, for every row that is in the system
    M_a = 1/2 sum_b w_ab x_ab (x) x_ab,   w_ab = -a_ab, over the entries b of the row,
where x_ab is the separation that the weight belongs to: from the nearest periodic image, or from the mirror image if the
entry stands for one. `multigrid.position` is the array of positions, the caller's if it was given. Rows with count 0 take
no part. The coupling d_a to what is not in the system the solver takes from the matrix itself (`matrix.excess`).

See `kernels/linear/grid_cycle.py` for the equations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warpsph.engine.launch import Bindings, Launcher, Task
from warpsph.errors import CapacityError
from warpsph.kernels.core.block_sums import LANES
from warpsph.kernels.core.spec import types
from warpsph.kernels.linear.grid_cycle import Kernels, make_kernels
from warpsph.kernels.linear.levels import COLLAPSE, HALVE, MOST_SWEEPS, STAY, Level, SweepWeights, make_frame
from warpsph.solvers.linear_solver import EllMatrix, Rows

LARGEST_ARRAY = 2**31 - 1
COARSEST = 30  # nodes of the coarsest level, whose operator is inverted, about
CELL = 2.0  # cell width of the finest grid in particle spacings
# Damping of the Jacobi sweeps. On the particles 2 / weight must exceed the largest eigenvalue of D^-1 A, which is at most 2
# for non-negative weights (row sums); on the grid the usual 8/9 (2-D) is a little more than what is best in 3-D.
PARTICLE_WEIGHT = 0.9
GRID_WEIGHT = 0.8
# Levels of cells so many times as wide as the finest get more pairs of sweeps: (width, pairs, smallest eigenvalue of D^-1 A
# that the sweeps aim at); the largest is 2. By measurement; on a finest grid of more than LONG cells along an axis the
# error that they take out weighs more, and their launches weigh less.
LONG = 700
WIDE = {False: ((32, 4, 0.05), (8, 2, 0.15)), True: ((16, 4, 0.05), (4, 2, 0.15))}
# Factor of the correction from the grids: their functions are stiffer than what the particles do between the nodes.
OVER = 1.05
# Levels of at most so many nodes are left to one thread (CPU) or one block (GPU): a launch or a barrier costs more than
# they do.
SMALL = {True: 4096, False: 1024}
ENTIRE = 256  # levels of at most so many nodes are visited as a whole on a CPU: listing what the fluid needs costs more


@dataclass(frozen=True)
class LevelPlan:
    """One level: cells per axis, whether each axis is periodic, and what each does to the next level (STAY, HALVE,
    COLLAPSE)."""

    cells: tuple[int, ...]
    wrap: tuple[bool, ...]
    way: tuple[int, ...]

    @property
    def nodes(self) -> tuple[int, ...]:
        """Nodes per axis."""
        return tuple(c if w else c + 1 for c, w in zip(self.cells, self.wrap, strict=True))


def periodic_cells(extent: float, cell: float) -> int:
    """Return the number of cells on a periodic axis, 2^k or 3 2^k, nearest to extent / cell in ratio."""
    target = max(extent / cell, 2.0)
    k = math.floor(math.log2(target))
    candidates = [c for c in (3 * 2 ** (k - 1) // 2 if k > 1 else 2, 2**k, 3 * 2 ** (k - 1), 2 ** (k + 1)) if c >= 2]
    return min(candidates, key=lambda c: abs(math.log(c / target)))


def plan_levels(cells: Sequence[int], periodic: Sequence[bool], coarsest: int = COARSEST) -> list[LevelPlan]:
    """Return the levels from the finest grid to one of about `coarsest` nodes.

    Every axis is halved until one cell is left (periodic: two or three); the next step makes it constant, so that a long
    channel is coarsened along its length until its cells are square no more than on the finest grid.
    """
    plans: list[LevelPlan] = []
    now, wrap = tuple(cells), tuple(bool(p) for p in periodic)
    while True:
        nodes = math.prod(c if w else c + 1 for c, w in zip(now, wrap, strict=True))
        ways, then, then_wrap = [], [], []
        for c, w in zip(now, wrap, strict=True):
            if w and c == 1:
                way, nc, nw = STAY, 1, True
            elif w and (c < 4 or c % 2):
                way, nc, nw = COLLAPSE, 1, True
            elif not w and c == 1:
                way, nc, nw = COLLAPSE, 1, True
            else:
                way, nc, nw = HALVE, (c + 1) // 2, w
            ways.append(way)
            then.append(nc)
            then_wrap.append(nw)
        last = nodes <= coarsest or all(w and c == 1 for c, w in zip(then, then_wrap, strict=True))
        plans.append(LevelPlan(now, wrap, tuple(STAY for _ in now) if last else tuple(ways)))
        if last:
            return plans
        now, wrap = tuple(then), tuple(then_wrap)


def sweep_weights(width: int, long: bool) -> list[float]:
    """Return the weights of the sweeps on a level whose cells are `width` times as wide as those of the finest.

    Args:
        width: 1, 2, 4 ...
        long: the finest grid has more than `LONG` cells along an axis.

    Returns:
        An even number of weights. More than two are inverse roots of the Chebyshev polynomial between the eigenvalues aimed
        at; a small and a large one take turns, so that no sweep magnifies much.
    """
    pairs, least = next(((pairs, least) for limit, pairs, least in WIDE[long] if width >= limit), (1, 0.0))
    if pairs == 1:
        return 2 * [GRID_WEIGHT]
    count = 2 * pairs
    roots = [0.5 * (2.0 + least) + 0.5 * (2.0 - least) * math.cos(math.pi * (k + 0.5) / count) for k in range(count)]
    return [1.0 / roots[k // 2 if k % 2 == 0 else count - 1 - k // 2] for k in range(count)]


class Multigrid:
    """One V-cycle over particles and background grids, as preconditioner of conjugate gradients.

    One damped Jacobi sweep on the particles and two on each grid (four on those of wide cells), before and after the
    coarser levels, and the inverse of the coarsest operator: symmetric and positive definite for a symmetric positive
    definite matrix.

    Args:
        matrix: symmetric matrix with couplings a_ab <= 0 off the diagonal.
        launcher: launches kernels.
        dimension: 2 or 3.
        precision: that of the matrix.
        row_list: layout of the matrix.
        lower, upper: box of the finest grid [m]; positions outside are moved to its rim. Empty parts cost memory, 0.2 kB
            (2-D) or 0.5 kB (3-D) a cell in single precision, and on a GPU a little time.
        spacing: particle spacing [m]; cells are about two spacings wide.
        periodic: per axis; then upper - lower is the period.
        position: vectors, at least one for each row [m]; by default an own array.
        moment: symmetric matrices, at least one for each row, see the top of the file; by default an own array.
        cell: cell width of the finest grid in particle spacings; by measurement 2 needs the fewest iterations for its cost.
        small: levels with at most so many nodes are worked on in one launch.

    Attributes:
        position, moment: the arrays read in every solve.
        coupling: `matrix.excess`, which the solver fills from the matrix; nothing to be done.
        plans: levels, finest first.

    Raises:
        ValueError: dimension, precision, layout or box make no grid.
        CapacityError: the grid has too many nodes to be numbered, or does not fit in memory.
    """

    weight = PARTICLE_WEIGHT

    def __init__(
        self,
        matrix: EllMatrix,
        launcher: Launcher,
        dimension: int,
        precision: str,
        row_list: bool,
        lower: Sequence[float],
        upper: Sequence[float],
        spacing: float,
        periodic: Sequence[bool],
        position: Any = None,
        moment: Any = None,
        cell: float = CELL,
        small: int | None = None,
    ) -> None:
        if dimension not in (2, 3):
            raise ValueError(f"dimension: {dimension} has no multigrid; choose preconditioner 'jacobi'")
        if precision != matrix.precision or row_list != matrix.row_list:
            raise ValueError(f"precision {precision!r}, row_list {row_list}: not those of the matrix")
        if not spacing > 0.0 or any(not high > low for low, high in zip(lower, upper, strict=True)):
            raise ValueError(f"box {list(lower)} to {list(upper)} with spacing {spacing}: all extents must be positive")
        if row_list and not launcher.is_cpu:
            raise ValueError("row_list: True is the layout of a CPU device, where the host lists the cells in use")
        self.matrix = matrix
        self.launcher = launcher
        self.dimension = dimension
        device, n = matrix.device, matrix.n
        real, vec, mat, _ = types(dimension, precision)
        self.position: Any = wp.zeros(n, dtype=vec, device=device) if position is None else position
        self.moment: Any = wp.zeros(n, dtype=mat, device=device) if moment is None else moment
        self.coupling: Any = matrix.excess
        cells, inverse = [], []
        for low, high, wraps in zip(lower, upper, periodic, strict=True):
            extent = float(high) - float(low)
            count = periodic_cells(extent, cell * spacing) if wraps else max(1, math.ceil(extent / (cell * spacing) - 1e-6))
            cells.append(count)
            inverse.append(count / extent if wraps else 1.0 / (cell * spacing))
        self.plans = plan_levels(cells, periodic)
        frame = make_frame(dimension, precision)()
        frame.origin, frame.inv_cell = vec(*map(float, lower)), vec(*inverse)
        self._levels = self._place_levels()
        corners, stencil = 4**dimension, 3**dimension
        cell_total = sum(level.cell_count for level in self._levels)
        node_total = self._node_total
        if max(cell_total * corners, node_total * stencil) > LARGEST_ARRAY:
            raise CapacityError(
                f"multigrid: a box of {' x '.join(map(str, cells))} cells is more than 32-bit indices can number; make the "
                "domain smaller, or choose preconditioner 'jacobi'",
                key="domain",
            )
        finest = self._levels[0].cell_count
        try:
            self.element: Any = wp.zeros(cell_total * corners, dtype=real, device=device)
            self.stencil: Any = wp.zeros(node_total * stencil, dtype=real, device=device)
            self._nodes = {
                name: wp.zeros(node_total, dtype=real, device=device)
                for name in ("node_inverse", "node_rhs", "node_x", "node_work")
            }
            self._ranges = {name: wp.zeros(finest, dtype=int, device=device) for name in ("range_begin", "range_end")}
            # on a CPU: cells and nodes with particles near, at the places of the level, and how many there are of each
            listed = matrix.row_list
            self._active_counts: Any = wp.zeros(2 * len(self._levels) if listed else 0, dtype=int, device=device)
            self._active = {
                "active_cells": wp.zeros(cell_total if listed else 0, dtype=int, device=device),
                "active_nodes": wp.zeros(node_total if listed else 0, dtype=int, device=device),
            }
            self._keys: Any = wp.zeros(2 * n, dtype=int, device=device)
            self._order: Any = wp.zeros(2 * n, dtype=int, device=device)
            self._fraction: Any = wp.zeros(n, dtype=vec, device=device)
            self._corner_sums: Any = wp.zeros(finest * 2**dimension, dtype=real, device=device)
            self._work: Any = wp.zeros(n, dtype=real, device=device)
            coarsest = self._levels[-1].node_count ** 2
            self._coarsest_work: Any = wp.zeros(coarsest, dtype=wp.float64, device=device)
            self._coarsest_inverse: Any = wp.zeros(coarsest, dtype=real, device=device)
        except RuntimeError as error:
            raise CapacityError(f"multigrid of {finest} cells does not fit in memory: {error}", key="domain") from error
        self._key_bits = max(1, finest.bit_length())
        limit = SMALL[launcher.is_cpu] if small is None else small
        self.first_small = next(
            (k for k, level in enumerate(self._levels) if level.node_count <= limit), len(self._levels) - 1
        )
        # from this level on; every level that is launched on its own is listed
        self._entire = next(
            (k for k, level in enumerate(self._levels) if k > self.first_small and level.node_count <= ENTIRE),
            len(self._levels),
        )
        # live views of the arrays
        arrays = {**self._nodes, **self._ranges, **self._active, "element": self.element, "corner_sums": self._corner_sums}
        arrays["active_counts"] = self._active_counts
        self._views = {name: array.numpy() for name, array in arrays.items()} if matrix.row_list else {}
        if matrix.row_list:
            for k, level in enumerate(self._levels):
                if k >= self._entire:
                    self._views["active_counts"][2 * k : 2 * k + 2] = level.cell_count, level.node_count
                    self._views["active_cells"][level.cell_base :][: level.cell_count] = np.arange(level.cell_count)
                    self._views["active_nodes"][level.node_base :][: level.node_count] = np.arange(level.node_count)
        most = max(max(level.cell_count, level.node_count) for level in self._levels)
        self._marks = np.zeros(most if matrix.row_list else 0, dtype=np.int32)
        self._lanes = LANES if device.is_cuda else 1
        self._bindings = Bindings(device, self._nodes)
        self._bindings.update(
            self._ranges,
            **self._active,
            active_counts=self._active_counts,
            n=n,
            frame=frame,
            element=self.element,
            stencil=self.stencil,
            grid_sort_keys=self._keys,
            grid_order=self._order,
            grid_fraction=self._fraction,
            corner_sums=self._corner_sums,
            particle_work=self._work,
            position=self.position,
            moment=self.moment,
            counts=matrix.counts,
            excess=matrix.excess,
            inverse=matrix.inverse,
            levels=wp.array(self._levels, dtype=Level, device=device),
            lanes=self._lanes,
            first_small=self.first_small,
            level_count=len(self._levels),
            coarsest_work=self._coarsest_work,
            coarsest_inverse=self._coarsest_inverse,
            weight=real(PARTICLE_WEIGHT),
            over=real(OVER),
        )

    def _weights(self, k: int) -> list[float]:
        """Return the weights of the sweeps on level k before the next one."""
        return sweep_weights(2**k, max(self.plans[0].cells) > LONG)

    def _place_levels(self) -> list[Any]:
        """Return the `Level` structs; node arrays have room for the rows around each level."""

        def three(values: Sequence[int], rest: int) -> Any:
            return wp.vec3i(*[*map(int, values), rest][:3])

        levels = []
        cell_base, node_base = 0, 0
        for k, plan in enumerate(self.plans):
            level = Level()
            weights = self._weights(k)
            level.pairs = len(weights) // 2
            level.weights = SweepWeights(*weights, *(MOST_SWEEPS - len(weights)) * [0.0])
            level.cells, level.nodes = three(plan.cells, 1), three(plan.nodes, 1)
            level.wrap, level.way = three(plan.wrap, 0), three(plan.way, STAY)
            pad = 1 + level.nodes[0] * (1 + level.nodes[1])
            level.cell_base, level.node_base = cell_base, node_base + pad
            level.cell_count, level.node_count = math.prod(plan.cells), math.prod(plan.nodes)
            cell_base += level.cell_count
            node_base += level.node_count + 2 * pad
            levels.append(level)
        self._node_total = node_base
        return levels

    def memory(self) -> int:
        """Return the bytes of all own arrays."""
        arrays = [*self._nodes.values(), *self._ranges.values(), *self._active.values()]
        arrays += [self.element, self.stencil, self._keys, self._order, self._fraction, self._corner_sums]
        arrays += [self._work, self.moment, self._active_counts, self._coarsest_work, self._coarsest_inverse]
        return sum(int(array.capacity) for array in arrays)

    def _over_nodes(self, kernel: Any, k: int, **special: Any) -> Task:
        task = self.launcher.task("multigrid", kernel, self._levels[k].node_count, self._bindings, special=special)
        self._node_tasks[k].append(task)
        return task

    def _over_cells(self, kernel: Any, k: int, per_cell: int, **special: Any) -> Task:
        count = self._levels[k].cell_count * per_cell
        task = self.launcher.task("multigrid", kernel, count, self._bindings, special=special)
        self._cell_tasks[k].append((task, per_cell))
        return task

    @property
    def _kernels(self) -> Kernels:
        """The kernels for the layout that the matrix has now."""
        matrix = self.matrix
        return make_kernels(self.dimension, matrix.precision, matrix.row_list, matrix.count_type, matrix.wide)

    def _one_block(self, kernel: Any) -> Task:
        return self.launcher.task("multigrid", kernel, self._lanes, self._bindings, single=True)

    def setup_tasks(self) -> list[Task]:
        """Return the tasks that sort the particles into cells and build the operators of all grids."""
        kernels, levels, n = self._kernels, self._levels, self.matrix.n
        corners = 2**self.dimension
        finest = levels[0]

        def sort() -> None:
            wp.utils.radix_sort_pairs(self._keys, self._order, n, 0, self._key_bits)

        def clear() -> None:
            for array in self._ranges.values():
                array.zero_()

        def over_particles(kernel: Any) -> Task:
            return self.launcher.task("multigrid", kernel, n, self._bindings, special={"level": finest})

        self._node_tasks: list[list[Task]] = [[] for _ in levels]
        self._cell_tasks: list[list[tuple[Task, int]]] = [[] for _ in levels]
        tasks = [over_particles(kernels.keys), Task("multigrid", sort)]
        if self.matrix.row_list:
            tasks.append(Task("multigrid", self._list_active))
        else:
            tasks.append(Task("multigrid", clear))
        tasks += [
            over_particles(kernels.ranges),
            self._over_cells(kernels.elements, 0, corners, level=finest),
        ]
        for k in range(self.first_small):
            if k > 0:
                tasks.append(self._over_cells(kernels.coarse_elements, k, corners, fine=levels[k - 1], coarse=levels[k]))
            tasks.append(self._over_nodes(kernels.stencils, k, level=levels[k]))
        tasks.append(self._one_block(kernels.small_setup))
        return tasks

    def _list_active(self) -> None:
        """List cells and nodes with particles near and fit the tasks to them; zero what no longer has any (CPU alone).

        The work follows the fluid, however large the box is.
        """
        keys = self._keys.numpy()[: self.matrix.n]
        cells = keys[np.flatnonzero(np.diff(keys, prepend=-1))]
        cells = cells[cells < self._levels[0].cell_count]
        ways = {HALVE: lambda c: c // 2, STAY: lambda c: c, COLLAPSE: lambda c: c * 0}
        for k, (level, plan) in enumerate(zip(self._levels[: self._entire], self.plans, strict=False)):
            at = np.unravel_index(cells, plan.cells[::-1])[::-1]
            near: list[Any] = [0]
            stride = 1
            for c, count, wraps in zip(at, plan.nodes, plan.wrap, strict=True):
                both = stride * c, stride * ((c + 1) % count if wraps else c + 1)
                near = [place + part for part in both for place in near]
                stride *= count
            nodes = self._distinct(near, level.node_count)
            self._forget(k, cells, nodes)
            self._views["active_counts"][2 * k : 2 * k + 2] = len(cells), len(nodes)
            self._views["active_cells"][level.cell_base :][: len(cells)] = cells
            self._views["active_nodes"][level.node_base :][: len(nodes)] = nodes
            for task, per_cell in self._cell_tasks[k]:
                if task.resize is not None:
                    task.resize(len(cells) * per_cell)
            for task in self._node_tasks[k]:
                if task.resize is not None:
                    task.resize(len(nodes))
            if k + 1 < self._entire:
                coarse = self.plans[k + 1]
                into = [ways[way](c) for way, c in zip(plan.way, at, strict=True)]
                parents = np.ravel_multi_index(into[::-1], coarse.cells[::-1])
                cells = self._distinct([parents], self._levels[k + 1].cell_count)

    def _distinct(self, parts: Sequence[np.ndarray], size: int) -> np.ndarray:
        """Return the distinct numbers below `size` in increasing order."""
        if 4 * sum(map(len, parts)) > size:
            flags = np.zeros(size, dtype=bool)
            for part in parts:
                flags[part] = True
            return np.flatnonzero(flags)
        numbers = np.concatenate(parts)
        order = np.arange(len(numbers), dtype=np.int32)
        self._marks[numbers] = order
        return np.sort(numbers[self._marks[numbers] == order])

    def _forget(self, k: int, cells: np.ndarray, nodes: np.ndarray) -> None:
        """Zero what the last set-up left in cells and nodes of level k that are no longer in use."""

        def gone(name: str, base: int, count: int, now: np.ndarray) -> np.ndarray:
            old = self._views[name][base:][:count]
            if len(old) == len(now) and np.array_equal(old, now):
                return old[:0]
            self._marks[old] = 0
            self._marks[now] = 1
            return old[self._marks[old] == 0]

        level = self._levels[k]
        cell_count, node_count = self._views["active_counts"][2 * k : 2 * k + 2]
        left = gone("active_cells", level.cell_base, cell_count, cells)
        if len(left):
            per_cell = 4**self.dimension
            self._views["element"].reshape(-1, per_cell)[level.cell_base + left] = 0.0
            if k == 0:
                self._views["corner_sums"].reshape(-1, 2**self.dimension)[left] = 0.0
                for name in ("range_begin", "range_end"):
                    self._views[name][left] = 0
        left = gone("active_nodes", level.node_base, node_count, nodes)
        if len(left):
            for name in self._nodes:
                self._views[name][level.node_base + left] = 0.0

    def tasks(self, rows: Rows, bindings: Bindings, residual: Any, scaled: Any) -> list[Task]:
        """Return the tasks scaled = M residual, one cycle; see `linear_solver.Preconditioner`."""
        kernels, levels, real = self._kernels, self._levels, self.matrix.real
        finest = levels[0]
        own = Bindings(self.matrix.device, {**bindings, **self._bindings})
        vectors = {"source": residual, "result": scaled}
        x, work = self._nodes["node_x"], self._nodes["node_work"]

        def sweeps(k: int, weights: Sequence[float]) -> list[Task]:
            ends = len(weights) // 2 * [(x, work), (work, x)]
            return [
                self._over_nodes(kernels.sweep, k, level=levels[k], source=source, target=target, sweep_weight=real(weight))
                for weight, (source, target) in zip(weights, ends, strict=True)
            ]

        tasks = [
            rows.sweep("multigrid", kernels.residual, own, vectors),
            self._over_cells(kernels.collect, 0, 1, level=finest),
            self._over_nodes(kernels.gather, 0, level=finest),
        ]
        for k in range(self.first_small):
            level, coarse = levels[k], levels[k + 1]
            tasks += [
                self._over_nodes(kernels.first_sweeps, k, level=level),
                *sweeps(k, self._weights(k)[2:]),
                self._over_nodes(kernels.grid_residual, k, level=level),
                self._over_nodes(kernels.restrict_residual, k + 1, fine=level, coarse=coarse),
            ]
        tasks.append(self._one_block(kernels.small_cycle))
        for k in reversed(range(self.first_small)):
            level, coarse = levels[k], levels[k + 1]
            tasks += [
                self._over_nodes(kernels.prolong, k, fine=level, coarse=coarse),
                *sweeps(k, self._weights(k)[::-1]),
            ]
        tasks += [
            rows.sweep("multigrid", kernels.spread, own, {"level": finest, **vectors}),
            rows.sweep("multigrid", kernels.smooth, own, vectors),
        ]
        return tasks
