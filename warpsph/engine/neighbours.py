"""Neighbour list with a skin: built from a cell grid, kept until a particle has used up half the skin.

A rebuild takes up the way since the last one, orders all particles by cell, permutes every kept field, fills the list
and marks the interface band. It is a fixed sequence of tasks, which runs from the host or inside a captured graph.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from warpsph.engine import free_memory
from warpsph.engine.launch import Bindings, Launcher, Task
from warpsph.engine.population import Population
from warpsph.errors import CapacityError
from warpsph.kernels.core import cells, dry_walls, permute, slack, varying_list, visibility
from warpsph.kernels.core.clock import make_judge
from warpsph.kernels.core.leaks import EVERYWHERE, make_hold_spilled, make_in_cells, make_leaks, make_sunk
from warpsph.kernels.core.mirror import code_shift, make_sides
from warpsph.kernels.core.origins import make_wrap
from warpsph.kernels.core.spec import Spec, types_of

LARGEST_NARROW = 2**31 - 1  # entries that one 32-bit index reaches; beyond them the list is a wide one
MOST_CELLS = 2**30  # of the grid: keys are 32-bit integers
MOST_PARTICLES = 2**29 - 1  # a column of a wide list is strided with a 32-bit number of bytes
WIDEST = 32767  # neighbours are counted with 16 bits
# A cell may not be narrower than half the list radius, not even by the rounding of a coordinate.
CELL_MARGIN = 1.001


def grid_layout(
    lower: Sequence[float], upper: Sequence[float], periodic: Sequence[bool], list_radius: float
) -> tuple[list[int], list[float]]:
    """Return (cells per axis, cell width per axis [m]) for cells of at least half the list radius."""
    counts, widths = [], []
    for low, high, wraps in zip(lower, upper, periodic, strict=True):
        width = 0.5 * list_radius * CELL_MARGIN
        extent = high - low
        if wraps:
            count = max(1, math.floor(extent / width))
            width = extent / count
        else:
            count = max(1, math.ceil(extent / width))
        counts.append(count)
        widths.append(width)
    return counts, widths


def brute_force_pairs(position: np.ndarray, box: Sequence[float], radius: float) -> set[tuple[int, int]]:
    """Return all ordered pairs (i, j) nearer than `radius`, by testing every pair: the twin that tests compare with.

    Args:
        position: (n, d) in m.
        box: period of each axis in m, 0 where it is not periodic.
        radius: in m.
    """
    difference = position[:, None, :] - position[None, :, :]
    for axis, period in enumerate(box):
        if period > 0:
            difference[..., axis] -= period * np.round(difference[..., axis] / period)
    near = np.einsum("ijk,ijk->ij", difference, difference) < radius * radius
    np.fill_diagonal(near, False)
    return {(int(i), int(j)) for i, j in np.argwhere(near)}


class NeighbourList:
    """The list, its grid and the tasks that rebuild it.

    Args:
        particles: fields to sort along.
        launcher: launches kernels.
        bindings: values for kernel arguments; the list adds its own.
        lower, upper: box that the cells cover [m]; particles outside are kept in the rim cells.
        periodic: per axis.
        support: support radius of the smoothing kernel [m].
        skin: skin as share of the support.
        width: entries a particle may have at first.
        cell_bodies: whether there are bodies that are made of cells.
    """

    def __init__(
        self,
        particles: Population,
        launcher: Launcher,
        bindings: Bindings,
        lower: Sequence[float],
        upper: Sequence[float],
        periodic: Sequence[bool],
        support: float,
        skin: float,
        width: int,
        cell_bodies: bool = False,
    ) -> None:
        self.particles = particles
        self._seeks_bodies = particles.spec.bodies or cell_bodies
        self.launcher = launcher
        self.bindings = bindings
        self.support = support
        self.list_radius = support * (1.0 + skin)
        self.spec = dataclasses.replace(particles.spec, wide_list=False)
        spec, device = self.spec, particles.device
        # where lengths vary they may grow, and cells that are a little wider spare a slightly thinner gas a longer search
        margin = varying_list.CELL_MARGIN if spec.varying_h else 1.0
        counts, widths = grid_layout(lower, upper, periodic, margin * self.list_radius)
        self.cells_per_axis = counts
        grid = cells.make_grid(spec.dimension, spec.precision)()
        vec = types_of(spec).vec
        grid.origin = vec(*map(float, lower))
        grid.inv_cell = vec(*(1.0 / width_ for width_ in widths))
        grid.box = vec(*(float(u - low) if p else 0.0 for low, u, p in zip(lower, upper, periodic, strict=True)))
        grid.nx, grid.ny, grid.nz = (counts + [1, 1])[:3]
        cell_count = math.prod(counts)
        # particles that died are sorted into a cell of their own behind those of the fluid
        block = cell_count + int(spec.changing)
        grid.cell_count = block
        grid.list_radius2 = self.list_radius**2
        n = particles.capacity
        kinds = 2 if particles.wall_count else 1
        if block * kinds >= MOST_CELLS:
            rule = f"{block * kinds} cells of the neighbour search are more than the {MOST_CELLS} that can be numbered"
            raise CapacityError(f"domain: {rule}; make the domain smaller or particle_spacing larger", key="domain")
        if n > MOST_PARTICLES:
            rule = f"{n} particles are more than the {MOST_PARTICLES} that a list can number"
            raise CapacityError(f"particle_spacing: {rule}; make it larger", key="particle_spacing")
        if spec.mirror and n >= 2 ** code_shift(spec.dimension):
            rule = f"a list with mirror images numbers at most {2 ** code_shift(spec.dimension)} particles"
            raise CapacityError(f"{n} particles: {rule}; make the sides of the domain periodic or open")
        bindings.setdefault("sides", make_sides(spec.dimension, spec.precision)())
        self.key_bits = max(1, (block * kinds).bit_length())
        self.cell_start = wp.zeros(block * kinds + 1, dtype=int, device=device)
        self.sort_keys = wp.zeros(2 * n, dtype=int, device=device)
        self.sort_order = wp.zeros(2 * n, dtype=int, device=device)
        self.list_peak = wp.zeros(launcher.threads, dtype=int, device=device)
        self._moved: list[Any] = []  # arrays that sorting knows by their addresses: fields, their copies, tables of both
        self._counts_leaks = "phase_count" in bindings
        if self._counts_leaks:
            phases = int(bindings["phase_count"])
            bindings.update(
                leaks_found=wp.zeros(launcher.threads * phases, dtype=int, device=device),
                leak_counts=wp.zeros(2 * phases, dtype=int, device=device),
            )
        # only where a side is open can fluid be beyond a wall that is not in it
        thick = float(bindings.get("wall_thickness", EVERYWHERE))
        self._holds_spilled = self._counts_leaks and thick < EVERYWHERE and not (spec.changing or spec.varying_h)
        bindings.update(
            grid=grid,
            cell_start=self.cell_start,
            sort_keys=self.sort_keys,
            sort_order=self.sort_order,
            list_peak=self.list_peak,
        )
        # extremes of the displacements in each cell, and over a window of cells (two buffers, one axis after the other)
        real = types_of(spec).real
        self.cell_count = cell_count
        self._extremes = [[wp.empty(cell_count, dtype=vec, device=device) for _ in range(4)] for _ in range(3)]
        self.slack_maxima = wp.zeros(2 * launcher.threads, dtype=real, device=device)
        if spec.tails:
            # about a spacing, half the support, lies between the places of frames
            bindings.update(
                frame_reach=real(1.5 * self.list_radius), frame_corners=wp.zeros(2, dtype=vec, device=device)
            )  # fmt: skip
        bindings.update(slack_maxima=self.slack_maxima, skin_length=real(skin * support))
        if spec.varying_h:
            bindings.update(cell_reach=wp.zeros(cell_count, dtype=int, device=device))
        self.check_tasks = self._make_check_tasks()
        self.width = 0
        self.neighbours: Any = None
        self.resize(width)

    def resize(self, width: int) -> None:
        """Give every particle room for `width` neighbours; the list must be rebuilt afterwards.

        Raises:
            CapacityError: more neighbours than 16 bits count, or more entries than fit in the device's memory.
        """
        width = (width + 3) // 4 * 4
        n = self.particles.capacity
        if width > WIDEST:
            raise CapacityError(
                f"neighbour list: a particle with up to {width} neighbours has more than the {WIDEST} that can be counted; "
                "a clump of particles or a far too large smoothing length (numerics.smoothing_ratio) is the usual cause",
                key="numerics.smoothing_ratio",
            )
        self.neighbours = None
        self.bindings.pop("neighbours", None)
        wide = width * n > LARGEST_NARROW
        shape: Any = width * n
        if wide:
            shape = (n, width) if self.spec.row_list else (width, n)
        try:
            # not filled: no entry is read before it is written, and pages of a CPU that no row reaches cost no memory
            self.neighbours = wp.empty(shape, dtype=int, device=self.particles.device)
        except RuntimeError as error:
            raise CapacityError(self._too_large(width, str(error)), key="particle_spacing") from error
        self.spec = dataclasses.replace(self.spec, wide_list=wide)
        self.width = width
        self.bindings["neighbours"] = self.neighbours
        self.bindings["list_width"] = width
        self._sorting = self._permute_tasks()
        self.tasks = self._make_tasks(moving=True)
        self.tasks_again = self._make_tasks(moving=False)

    def widen(self, peak: int) -> None:
        """Give every particle room for the `peak` neighbours of one, and some to spare; raises CapacityError as `resize`."""
        self.resize(min(int(1.2 * peak) + 4, max(peak + 1, WIDEST - 7)))

    def _too_large(self, width: int, reason: str) -> str:
        """Return the message for a list of so many entries a particle that the memory does not hold, with a way out."""
        n, device = self.particles.capacity, self.particles.device
        need = 4 * width * n
        text = f"neighbour list: {n} particles with room for {width} neighbours each need {need} bytes on {device}"
        free = free_memory.host_free() if device.is_cpu else free_memory.device_free(device)
        if free is None or not 0 < free < need:
            return f"{text}, which are not free ({reason}); make particle_spacing larger"
        larger = math.ceil(100 * (need / free) ** (1 / self.spec.dimension)) / 100
        return f"{text}, but {free} are free; a particle_spacing {larger:g} times as large would fit"

    def memory(self) -> int:
        """Return the bytes of the list alone (the grid and the sort buffers are not in it)."""
        return int(self.neighbours.capacity)

    def memory_beside(self) -> int:
        """Return the bytes of grid, sort buffers, sorted copies and displacement extremes."""
        arrays = [self.cell_start, self.sort_keys, self.sort_order, self._moved[0]]
        arrays += [array for buffer in self._extremes for array in buffer]
        return sum(int(array.capacity) for array in arrays)

    def _permute_tasks(self) -> list[Task]:
        """Return the tasks that put all kept fields in the order of the cells, see `kernels/core/permute.py`."""
        particles, device = self.particles, self.particles.device
        fields = [field for field in particles.fields.values() if field.kept and particles.rows(field)]
        arrays = [particles.arrays[field.name] for field in fields]
        sizes = [permute.aligned(int(array.capacity)) for array in arrays]
        copies = wp.empty(permute.room(sizes), dtype=wp.uint8, device=device)
        self._moved = [copies, *arrays]
        tasks = []
        for numbers in permute.rounds(sizes):
            columns, place = [], int(copies.ptr)
            for k in numbers:
                base = particles.fluid_capacity if fields[k].rows == "wall" else 0
                columns.append(permute.column(arrays[k], place, base))
                place += sizes[k]
            table: Any = wp.array(columns, dtype=permute.Column, device=device)
            self._moved.append(table)
            run = permute.RUN[self.launcher.is_cpu]
            runs = (max(column.rows for column in columns) + run - 1) // run
            for gathers in (True, False):
                kernel, special = permute.make_permute(gathers), {"run": run, "columns": table}
                tasks.append(self.launcher.task("permute", kernel, runs, self.bindings, special=special))
        return tasks

    def _make_tasks(self, moving: bool) -> list[Task]:
        spec = self.spec
        launcher, bindings, particles = self.launcher, self.bindings, self.particles
        n, fluid, wall = particles.capacity, particles.fluid_capacity, particles.wall_count
        tasks = []
        if spec.varying_h and moving:
            tasks.append(launcher.task("keys", varying_list.make_note_lengths(spec), fluid, bindings))
        if spec.windows and any(spec.periodic) and moving:
            tasks.append(launcher.task("keys", make_wrap(spec), fluid, bindings))
        tasks.append(launcher.task("keys", cells.make_keys(spec), fluid, bindings, special={"moving": int(moving)}))
        if wall:
            still = int(moving and spec.moving)
            tasks.append(launcher.task("keys", cells.make_keys(spec), wall, bindings, fluid, special={"moving": still}))

        def sort() -> None:
            wp.utils.radix_sort_pairs(self.sort_keys, self.sort_order, n, 0, self.key_bits)

        tasks.append(Task("sort", sort))
        tasks += self._sorting
        if not self._seeks_bodies:
            tasks += self.leak_tasks("anchor")
        by_cells = not launcher.is_cpu
        rows = self.cell_start.shape[0] if by_cells else n + 1
        tasks.append(launcher.task("ranges", cells.make_ranges(by_cells), rows, bindings))
        if spec.changing:
            special = {"dead_cell": self.cell_count}
            tasks.append(launcher.task("ranges", cells.make_live(), 1, bindings, single=True, special=special))
        if spec.varying_h:
            clear, spread = varying_list.make_clear_reach(), varying_list.make_spread_reach(spec)
            tasks.append(launcher.task("ranges", clear, self.cell_count, bindings))
            tasks.append(launcher.task("ranges", spread, fluid, bindings))
            tasks.append(launcher.task("list", varying_list.make_varying_list(spec), n, bindings))
        else:
            tasks.append(launcher.task("list", cells.make_list(spec), n, bindings))
        if spec.dry_walls:
            tasks.append(launcher.task("list", dry_walls.make_covered(spec), wall, bindings))
        if spec.tails:
            tasks += self._sight_tasks()
        if self._seeks_bodies:
            tasks += self.leak_tasks("anchor")  # they look at the list
        if self._holds_spilled:
            tasks.append(launcher.task("leaks", make_hold_spilled(spec), fluid, bindings))
        if spec.interface:
            mark, gather = cells.make_band(spec)
            tasks.append(launcher.task("band", mark, fluid, bindings))

            if spec.row_list:

                def add_up() -> None:
                    wp.utils.array_scan(particles.arrays["band_mark"], particles.arrays["band_sum"], inclusive=True)

                tasks.append(Task("band", add_up))
                tasks.append(launcher.task("band", gather, fluid, bindings))
        tasks.append(launcher.task("finish", cells.make_finish(spec.precision), 1, bindings, single=True))
        return tasks

    def _sight_tasks(self) -> list[Task]:
        """Return the tasks that take out of the list what thin tails of bodies hide, see `kernels/core/visibility.py`."""
        spec, launcher, bindings = self.spec, self.launcher, self.bindings
        find_box = visibility.make_frame_box(spec.dimension, spec.precision)
        tasks = []
        if spec.moving:
            place, walls = visibility.make_place_frames(spec), self.particles.wall_count
            tasks.append(launcher.task("sight", place, walls, bindings))
        return [
            *tasks,
            launcher.task("sight", find_box, 1, bindings, single=True),
            launcher.task("sight", visibility.make_nearest_frame(spec), self.particles.fluid_capacity, bindings),
            launcher.task("sight", visibility.make_unsee(spec), self.particles.capacity, bindings),
        ]

    def leak_tasks(self, place: str) -> list[Task]:
        """Return the tasks that count fluid beyond walls and inside bodies; none where nobody asks for it.

        Args:
            place: the field that holds the positions: `anchor` right after a build, else `position`.
        """
        if not self._counts_leaks:
            return []
        count, close = make_leaks(self.particles.spec)
        fluid = self.particles.fluid_capacity
        special = {"place": self.particles.arrays[place]}
        tasks = [self.launcher.task("leaks", count, fluid, self.bindings, special=special)]
        if self._seeks_bodies:
            inside = make_sunk(self.spec) if self.spec.bodies else make_in_cells(self.spec)
            tasks.append(self.launcher.task("leaks", inside, fluid, self.bindings))
        tasks.append(self.launcher.task("leaks", close, 1, self.bindings, single=True))
        return tasks

    def _make_check_tasks(self) -> list[Task]:
        """Return the tasks that find out whether the list outlasts the next steps, see `kernels/core/slack.py`."""
        spec, launcher, bindings = self.spec, self.launcher, self.bindings
        bindings.update({name: self.particles.arrays[name] for name in ("offset", "velocity", "anchor", "position")})
        shift = self.particles.arrays["shift" if spec.shift_ahead else "offset"]  # the latter stands for none
        extremes, window, relative = slack.make_slack(spec)
        judge = make_judge(spec.precision, spec.shift_ahead)
        names = ("low_now", "high_now", "low_then", "high_then")
        cells_, spare, other = self._extremes

        def arguments(source: list[Any], target: list[Any]) -> dict[str, Any]:
            found = dict(zip(names, source, strict=True))
            found.update(zip((f"{name}_out" for name in names), target, strict=True))
            return found

        first = {"shift": shift, **arguments(cells_, spare)}
        tasks = [launcher.task("check", extremes, self.cell_count, bindings, special=first)]
        source = cells_
        for axis in range(spec.dimension):
            target = spare if source is not spare else other
            special = {"axis": axis, **arguments(source, target)}
            tasks.append(launcher.task("check", window, self.cell_count, bindings, special=special))
            source = target
        tasks.append(launcher.task("check", relative, self.cell_count, bindings, special=arguments(cells_, source)))
        tasks.append(launcher.task("check", judge, 1, bindings, single=True))
        return tasks


def default_width(spec: Spec, support: float, spacing: float, skin: float) -> int:
    """Return list entries to start with: particles within support + skin on a lattice, and half as many again."""
    radius = support * (1.0 + skin) / spacing
    ball = {1: 2.0 * radius, 2: math.pi * radius**2, 3: 4.0 / 3.0 * math.pi * radius**3}[spec.dimension]
    return int(1.35 * ball) + 8
