"""The fitted arrangement of a start: rows of particles along the interfaces, even spacing elsewhere.

The particles of the lattice are displaced a little at random, so that nothing of its symmetry is left, and then moved by
`kernels/core/cloud.py` on the device of the run: some hundred times towards where their neighbours are even on all sides,
each time pushed back to half a spacing from the interfaces of their phase. Sides of the domain count as such too. Twice a
displacement in long waves gives each fluid its first moments (`moments`).
Beyond them, in bodies and away from the fluid stand particles that do not move; the empty space beside a free surface
is filled with particles of a phase of its own, which are thrown away afterwards.

All lengths here are in particle spacings, so that float32 resolves a ten-thousandth of one in any domain.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpsph.engine.launch import Bindings, Task
from warpsph.engine.neighbours import NeighbourList, default_width
from warpsph.engine.population import Population
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.cloud import ROW, make_cloud, make_packing
from warpsph.kernels.core.fields import COMMON, FLOW
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.scene.borders import VOID, Interface, Regions, find_interface, spread, volumes
from warpsph.scene.moments import moment_shift

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from warpsph.engine.launch import Launcher

ITERATIONS = {2: 150, 3: 100}  # by dimension
STRENGTH = 0.5  # A: at 0.7 it still settles
RATIO = 1.5  # smoothing length in spacings, whatever that of the run
# Iterations after which long waves, which iterations do not even out, are taken out at once; the rest repairs the rows.
LONG_WAVES = {2: (75, 110), 3: (50, 75)}
NOISE = 0.1  # displacement of the lattice, in spacings
SKIN = 0.15
# Share of the way to the first row that a particle between it and the second is moved, in the first and the last iteration:
# at first it may still be pressed out of a row that is too dense; in the end the row is exact to 0.02.
DRAWN = (0.2, 0.7)
# Iterations before which the neighbour list is built: particles go far at first and hardly move later.
LIST_BUILDS = (0, 1, 2, 4, 7, 12, 20, 30, 45, 65, 90, 120)


class Packer:
    """Makes fitted arrangements, see `geometry.Arrange`.

    Args:
        launcher: launches kernels on the device of the run.

    Attributes:
        unevenness: after a call: root mean square of h |sum_j grad W V_j| over the fluid particles.
    """

    def __init__(self, launcher: Launcher) -> None:
        self.launcher = launcher
        self.unevenness = math.nan

    def __call__(self, regions: Regions, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the way of each fluid particle from the middle of its cell (n, d), m, and its volume over the cell's (n,).

        Args:
            regions: what fills the domain.
            seed: of the random displacement.

        Raises:
            CapacityError: the neighbour list cannot hold the particles.
        """
        unit = regions.unit
        width = np.array(regions.lattice.spacing) / unit  # of a lattice cell, about 1
        sites, phase, fixed = _sites(regions)
        volume = np.ones(len(sites))
        fluid = phase != VOID
        filled = volumes(regions)
        entry = regions.entry[regions.entry != VOID]
        volume[fluid] = filled.factor[entry]
        box = width * regions.lattice.count
        low = np.where(regions.periodic, -np.inf, ROW)
        high = np.where(regions.periodic, np.inf, box - ROW)
        start = sites * width
        start += np.random.default_rng([seed, 1]).uniform(-NOISE, NOISE, start.shape)
        start = np.clip(start, low, np.maximum(high, low))
        # a single fluid has no interface whose long waves would be wrong, and moments of its own to lose at walls
        several = len(np.unique(phase[fluid])) > 1
        moments = partial(
            moment_shift,
            volume=volume[fluid],
            region=filled.region[entry],
            profiles=filled.profiles,
            count=regions.lattice.count,
            periodic=regions.periodic,
        )
        way = self._settle(
            regions, start, phase, volume, fixed * width, find_interface(regions), moments if several else None
        )
        way += start - sites * width
        return way[fluid] * unit, volume[fluid]

    def _settle(
        self,
        regions: Regions,
        start: NDArray[np.float64],
        phase: NDArray[np.int32],
        volume: NDArray[np.float64],
        fixed: NDArray[np.float64],
        interface: Interface,
        moments: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
    ) -> NDArray[np.float64]:
        """Iterate; return the way (n, d) of each particle that may move.

        start: (n, d) where they begin; fluid first, then those of empty space
        phase: (n,), VOID in empty space
        volume: (n,)
        fixed: (m, d) particles that stay
        moments: from the places of the fluid particles, in cells, to the ways that give each region its moments
        """
        launcher, device = self.launcher, self.launcher.device
        n, d = start.shape
        void = len(regions.phase_of_entry)  # no phase has this number
        spec = Spec(
            dimension=d,
            multiphase=True,
            periodic=tuple(regions.periodic),
            walls=len(fixed) > 0,
            row_list=launcher.is_cpu,
        )
        real, vec, _, _ = types_of(spec)
        particles = Population(spec, (*COMMON, *FLOW), n, len(fixed), device)
        every = np.concatenate([start, fixed])
        particles.put("anchor", every)
        particles.put("position", every)
        particles.put("particle_id", np.arange(len(every)))
        particles.put("phase", np.where(phase == VOID, void, phase))
        particles.put("rest_volume", volume)

        unit, width = regions.unit, np.array(regions.lattice.spacing) / regions.unit
        box = width * regions.lattice.count
        periodic = np.array(regions.periodic)
        kernel = KERNELS[spec.kernel]
        params = make_params(d, spec.precision)()
        params.h = RATIO
        params.inv_h = 1.0 / RATIO
        params.g_norm = kernel.alpha[d - 1] / RATIO ** (d + 2)
        params.shifting = STRENGTH
        params.box = vec(*np.where(periodic, box, 0.0).tolist())
        params.half_box = vec(*np.where(periodic, 0.5 * box, 1.0e30).tolist())
        cloud = make_cloud(d, spec.precision)()
        cloud.inv_cell = vec(*(1.0 / width).tolist())
        cloud.low = vec(*np.where(periodic, -1.0e30, np.minimum(ROW, 0.5 * box)).tolist())
        cloud.high = vec(*np.where(periodic, 1.0e30, np.maximum(box - ROW, 0.5 * box)).tolist())
        cloud.nx, cloud.ny, cloud.nz = (*regions.lattice.count, 1, 1)[:3]
        cells = _by_cell(regions, interface)
        bindings = Bindings(device, {"params": params, "cloud": cloud}, particles.declared)
        bindings.update(particles.arrays)
        bindings.update(
            particle_count=particles.capacity,
            fluid_count=n,
            clock=wp.zeros(ck.CLOCK_SIZE, dtype=wp.float64, device=device),
            counters=wp.zeros(ck.COUNTERS_SIZE, dtype=int, device=device),
            maxima=wp.zeros(ck.MAXIMA * launcher.threads, dtype=real, device=device),
            way=wp.zeros(n, dtype=vec, device=device),
            uneven=wp.zeros(n, dtype=vec, device=device),
            towards_row=wp.zeros(1, dtype=real, device=device),
            cloud_start=wp.array(cells["start"], dtype=int, device=device),
            cloud_near=wp.array(cells["near"], dtype=wp.uint8, device=device),
            cloud_point=wp.array(cells["point"] / unit, dtype=vec, device=device),
            cloud_normal=wp.array(cells["normal"], dtype=vec, device=device),
            cloud_below=wp.array(np.where(cells["below"] == VOID, void, cells["below"]), dtype=wp.int8, device=device),
            cloud_above=wp.array(np.where(cells["above"] == VOID, void, cells["above"]), dtype=wp.int8, device=device),
        )
        support = RATIO * kernel.support
        margin = np.where(periodic, 0.0, support + 1.0)
        neighbours = NeighbourList(
            particles, launcher, bindings, (-margin).tolist(), (box + margin).tolist(), spec.periodic, support, SKIN,
            default_width(spec, support, 1.0, SKIN),
        )  # fmt: skip
        tasks: list[Task] = []
        for iteration in range(ITERATIONS[d]):
            if iteration in LIST_BUILDS:
                if _build(neighbours, bindings["counters"]) or not tasks:
                    arrange, go = make_packing(neighbours.spec)
                    tasks = [launcher.task("arrange", arrange, n, bindings), launcher.task("go", go, n, bindings)]
            bindings["towards_row"].fill_(DRAWN[0] + (DRAWN[1] - DRAWN[0]) * iteration / ITERATIONS[d])
            for task in tasks:
                task.run()
            if moments is not None and iteration + 1 in LONG_WAVES[d]:
                particle = particles.get("particle_id")[:n]
                place = np.empty((n, d))
                place[particle] = particles.get("anchor")[:n].astype(np.float64) + particles.get("offset")
                shift = np.zeros((n, d))
                shift[phase != VOID] = moments(place[phase != VOID] / width) * width
                bindings["way"].assign(wp.array(shift[particle], dtype=vec, device=device))
                tasks[1].run()
        order = np.argsort(particles.get("particle_id")[:n], kind="stable")
        end = (particles.get("anchor")[:n].astype(np.float64) + particles.get("offset"))[order]
        uneven = bindings["uneven"].numpy()[order][phase != VOID].astype(np.float64) * RATIO
        self.unevenness = float(np.sqrt((uneven**2).sum(axis=1).mean()))
        # the tasks of a list refer to the list: without this its memory would wait for the garbage collector
        for held in (neighbours.tasks, neighbours.tasks_again, neighbours.check_tasks):
            held.clear()
        way = end - start
        return np.where(periodic, way - box * np.round(way / box), way)


def _build(neighbours: NeighbourList, counters: Any) -> bool:
    """Build the neighbour list; return whether it had to be made wider, which makes its old array useless."""
    widened = False
    while True:
        for task in neighbours.tasks:
            task.run()
        found = counters.numpy().copy()
        if found[ck.FAULT] != ck.FAULT_LIST:
            return widened
        neighbours.resize(int(1.2 * found[ck.LIST_PEAK]) + 4)
        found[ck.FAULT] = 0
        counters.assign(found)
        widened = True


def _sites(regions: Regions) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Where particles begin, in cells from the lower corner of the domain.

    Returns those that move (n, d), fluid first, the phase of each (n,), VOID for those that fill empty space beside the
    fluid, and those that stay (m, d): beyond the sides, in bodies, and in empty space farther away.
    """
    reach = math.ceil(RATIO * KERNELS[Spec(dimension=2).kernel].support * regions.unit / min(regions.lattice.spacing))
    fluid = regions.entry != VOID
    covered = np.zeros(fluid.shape, dtype=np.bool_) if regions.covered is None else regions.covered
    moves = fluid.copy()
    if not (fluid | covered).all():
        moves = spread(fluid, regions.periodic, np.logical_or, reach) & ~covered
    pad = [(0, 0) if wraps else (reach, reach) for wraps in regions.periodic]
    around = np.pad(moves, pad)
    stays = spread(around, regions.periodic, np.logical_or, reach) & ~around & ~np.pad(covered, pad)
    before = np.array([low for low, _ in pad])
    cells = [np.argwhere(fluid), np.argwhere(moves & ~fluid)]
    phase = np.full(sum(map(len, cells)), VOID, dtype=np.int32)
    phase[: len(cells[0])] = regions.phase_of_entry[regions.entry[fluid]]
    mobile, fixed = (found.astype(np.float64) + 0.5 for found in (np.concatenate(cells), np.argwhere(stays) - before))
    if regions.boundary is not None:
        boundary = (regions.boundary - np.array(regions.lattice.lower)) / np.array(regions.lattice.spacing)
        fixed = np.concatenate([fixed, boundary])
    return mobile, phase, fixed


def _by_cell(regions: Regions, interface: Interface) -> dict[str, NDArray[Any]]:
    """The interface points ordered by lattice cell, from the lower corner of the domain.

    Returns `point` (m, d), m; `normal`, `below`, `above` of the interface; `start` (cells + 1,), the first point of each
    cell, x running fastest; `near` (cells,), 1 where a cell or one beside it holds points.
    """
    lattice = regions.lattice
    count = np.array(lattice.count)
    point = interface.point - np.array(lattice.lower)
    cell = np.floor(point / np.array(lattice.spacing)).astype(np.intp)
    cell = np.where(regions.periodic, np.mod(cell, count), np.clip(cell, 0, count - 1))
    key = np.ravel_multi_index(tuple(cell.T), tuple(count), order="F")
    order = np.argsort(key, kind="stable")
    held = np.bincount(key, minlength=math.prod(lattice.count))
    near = spread((held > 0).reshape(lattice.count, order="F"), regions.periodic, np.logical_or)
    return {
        "point": point[order],
        "normal": interface.normal[order],
        "below": interface.below[order],
        "above": interface.above[order],
        "start": np.concatenate([[0], np.cumsum(held)]).astype(np.int32),
        "near": near.ravel(order="F").astype(np.uint8),
    }
