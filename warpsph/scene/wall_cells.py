"""Wall particles: the layers behind the sides of the domain, and the boundary particles of bodies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.domain import AXES
from warpsph.case.signals import vector_at
from warpsph.errors import Problem
from warpsph.scene.body_surfaces import Solid, make_solids
from warpsph.scene.facets import Facets
from warpsph.scene.lattice import Lattice, points_of
from warpsph.scene.sheets import Frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case


@dataclass(frozen=True)
class Surroundings:
    """The surface of the walls as each wall particle has it before it; n rows.

    normal: (n, d), unit vector from the wall into the fluid, at the foot
    depth: (n,), distance from the foot, the nearest point of the surface, m
    area: (n,), area of the surface that a particle of the first layer stands for, 0 for those beneath, m^(d-1); negative
        where its foot is beyond an inlet or outlet, so that it counts in no force
    volume: (n,), m^d
    leader: (n,) int, row of the particle of the first layer that is nearest to the foot
    sheet: (n,) int, side of a thin tail through which alone a particle is seen, 1 or -1; 0 for all others
    frame: (n,) int, which of `frames` lines of sight to it are judged by, -1 for none
    carried: (n,) int, which of `frames` moves with the particle, -1 for none
    frames: of all tails
    facets: of the surface, by the rows of their particles; none beyond inlets and outlets
    """

    normal: NDArray[np.float64]
    depth: NDArray[np.float64]
    area: NDArray[np.float64]
    volume: NDArray[np.float64]
    leader: NDArray[np.int64]
    sheet: NDArray[np.int8]
    frame: NDArray[np.int64]
    carried: NDArray[np.int64]
    frames: Frames
    facets: Facets


def surroundings_of_sides(
    position: NDArray[np.float64], lattice: Lattice, through: NDArray[np.bool_] | None = None
) -> Surroundings:
    """The surface of the sides of the domain, seen from the middles (n, d) of cells beyond them, m.

    through: (d, 2), which sides are inlets or outlets: beyond them the walls beside go on straight.
    """
    from scipy.spatial import cKDTree

    n = len(position)
    lower, upper = np.array(lattice.lower), np.array(lattice.upper)
    if through is not None:
        lower, upper = np.where(through[:, 0], -np.inf, lower), np.where(through[:, 1], np.inf, upper)
    foot = np.clip(position, lower, upper)
    way = foot - position
    depth = np.linalg.norm(way, axis=1)
    normal = way / np.maximum(depth, 1e-300)[:, None]
    spacing = np.array(lattice.spacing)
    beyond = np.round(np.abs(way) / spacing + 0.5).astype(int)  # layers behind each side, 0 beside it
    first = np.flatnonzero(beyond.sum(axis=1) == 1)
    leader, area = np.zeros(n, dtype=np.int64), np.zeros(n)
    if len(first):
        leader = first[cKDTree(foot[first]).query(foot)[1]]
        area[first] = lattice.cell_volume / (beyond[first] * spacing).sum(axis=1)
    seen_by_all = np.zeros(n, dtype=np.int8), np.full(n, -1), np.full(n, -1)
    return Surroundings(
        normal,
        depth,
        area,
        np.full(n, lattice.cell_volume),
        leader,
        *seen_by_all,
        Frames.joined([], lattice.dimension),
        Facets.plane(first, foot[first], normal[first], area[first]),
    )


class WallCells:
    """The wall particles of a case: first the sides of the domain, then the bodies.

    solid: which cells of the lattice the sides take
    position, velocity: (n, d), m and m/s
    slip: (n,) uint8, 1 on free-slip walls
    body: (n,) int32, number of the wall body, from 1
    solids: the bodies, in their order
    """

    def __init__(self, case: Case, lattice: Lattice) -> None:
        d = lattice.dimension
        self.case = case
        self.lattice = lattice
        self.names: list[str] = []
        self.solid = np.zeros(lattice.shape if case.has_walls else (0,) * d, dtype=np.bool_)
        self.position = np.empty((0, d))
        self.velocity = np.empty((0, d))
        self.slip = np.empty(0, dtype=np.uint8)
        self.sides = np.empty(0, dtype=np.uint8)
        self.body = np.empty(0, dtype=np.int32)
        self.solids: list[Solid] = []

    @property
    def count(self) -> int:
        return len(self.body)

    def add_sides(self) -> None:
        """Fill the layers beyond those sides of the domain that are walls.

        A cell beyond two or three walls at once (edges and corners) obeys the no-slip ones among them, all of
        them if none is no-slip. Each of these walls goes on beyond the edge with its velocity, so that what moves along it
        cancels out in the divergence of the fluid beside it, above and below: along each axis the cell has the mean
        velocity of the walls that can have one, those whose normal is another axis. It is counted to the body of the wall
        that it lies deepest behind.
        """
        lattice, d = self.lattice, self.lattice.dimension
        # per axis, for each layer of cells: how far beyond a wall it is (in layers, 0 if it is not), and
        # which wall
        depth = [np.zeros(n, dtype=np.int32) for n in lattice.shape]
        slips = [np.zeros(n, dtype=np.bool_) for n in lattice.shape]
        speeds = [np.zeros((n, d)) for n in lattice.shape]
        bodies = [np.zeros(n, dtype=np.int32) for n in lattice.shape]
        bits = [np.zeros(n, dtype=np.uint8) for n in lattice.shape]
        for k in range(d):
            before, after = lattice.layers[k]
            last = lattice.shape[k] - after
            for end, side, beyond, layer in (
                ("lower", self.case.sides[k].lower, slice(0, before), np.arange(before, 0, -1)),
                ("upper", self.case.sides[k].upper, slice(last, None), np.arange(1, after + 1)),
            ):
                if side.kind != "wall":
                    continue
                self.names.append(f"{AXES[k]}_{end}")
                depth[k][beyond] = layer
                slips[k][beyond] = side.wall == "free_slip"
                speeds[k][beyond] = vector_at(side.velocity) or 0.0
                bits[k][beyond] = 1 << (2 * k + (end == "upper"))
                bodies[k][beyond] = len(self.names)
        if not self.names:
            return
        for k in range(d):
            layers = tuple(slice(None) if j != k else np.flatnonzero(depth[k]) for j in range(d))
            self.solid[layers] = True
        cells = np.nonzero(self.solid)
        behind = np.stack([depth[k][cells[k]] for k in range(d)], axis=1)
        slip = np.stack([slips[k][cells[k]] for k in range(d)], axis=1)
        no_slip = (behind > 0) & ~slip
        any_no_slip = np.asarray(no_slip.any(axis=1))
        decides = np.where(any_no_slip[:, None], no_slip, behind > 0)

        velocity = np.zeros((len(behind), d))
        for axis in range(d):
            others = [k for k in range(d) if k != axis]
            own = sum(np.where(decides[:, k], speeds[k][cells[k]][:, axis], 0.0) for k in others)
            velocity[:, axis] = own / np.maximum(decides[:, others].sum(axis=1), 1)

        deepest = np.argmax(2 * behind + no_slip, axis=1)  # among equals a no-slip wall, then the first axis
        body = np.choose(deepest, [bodies[k][cells[k]] for k in range(d)])
        sides = sum(np.where(decides[:, k], bits[k][cells[k]], 0) for k in range(d))
        self._append(cells, velocity, ~any_no_slip, body, sides)

    def add_bodies(self, support: float, problems: list[Problem], warnings: list[str]) -> None:
        """Add the boundary particles of the bodies; `covered` says which cells they take.

        support: reach of the smoothing kernel, m; the layers are as deep.
        """
        self.solids = make_solids(self.case, self.lattice, support, problems, warnings)
        for solid, (name, body) in zip(self.solids, self.case.bodies.items(), strict=False):
            self.names.append(name)
            n = solid.sampling.count
            free = np.full(n, body.wall == "free_slip")
            still = np.zeros((n, self.lattice.dimension))
            self._append_at(solid.sampling.position, still, free, np.full(n, len(self.names)), np.zeros(n))

    def covered(self, nearer: float) -> NDArray[np.bool_]:
        """Cells of the lattice whose middle is in a body or nearer to one than `nearer`, m."""
        found = np.zeros(self.lattice.shape, dtype=np.bool_)
        for solid in self.solids:
            found |= solid.distance < nearer
        return found

    def surface(self) -> Surroundings:
        """Where the surface is, seen from each wall particle; see `Surroundings`."""
        lattice = self.lattice
        known = sum(solid.sampling.count for solid in self.solids)
        sides = surroundings_of_sides(self.position[: self.count - known], lattice, self._through())
        parts, first, first_frame = [sides], len(sides.depth), 0
        for solid in self.solids:
            s = solid.sampling
            frame = np.where(s.frame < 0, -1, s.frame + first_frame)
            carried = s.carriers()
            carried = np.where(carried < 0, -1, carried + first_frame)
            facets, leader = replace(s.facets, owner=s.facets.owner + first), s.leader + first
            parts.append(
                Surroundings(s.normal, s.depth, s.area, s.volume, leader, s.sheet, frame, carried, s.frames, facets)
            )  # fmt: skip
            first += s.count
            first_frame += s.frames.count
        names = ("normal", "depth", "area", "volume", "leader", "sheet", "frame", "carried")
        columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        foot = self.position + columns["normal"] * columns["depth"][:, None]
        beyond = self._beyond(foot)
        columns["area"] = np.where(beyond, -columns["area"], columns["area"])
        facets = Facets.joined([part.facets for part in parts])
        return Surroundings(
            **columns,
            frames=Frames.joined([part.frames for part in parts], lattice.dimension),
            facets=facets.rows(~beyond[facets.owner]),
        )

    def _through(self) -> NDArray[np.bool_]:
        """Which sides of each axis are inlets or outlets, (d, 2)."""
        return np.array([[side.flow is not None for side in (axis.lower, axis.upper)] for axis in self.case.sides])

    def _beyond(self, point: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which points (n, d) are beyond an inlet or outlet, m."""
        through = self._through()
        below = (point < self.lattice.lower) & through[:, 0]
        return np.asarray((below | ((point > self.lattice.upper) & through[:, 1])).any(axis=1))

    def _append(self, cells: tuple[NDArray[np.intp], ...], velocity: Any, slip: Any, body: Any, sides: Any) -> None:
        self._append_at(points_of(self.lattice.axes(), cells), velocity, slip, body, sides)

    def _append_at(self, position: Any, velocity: Any, slip: Any, body: Any, sides: Any) -> None:
        self.position = np.concatenate([self.position, position])
        self.velocity = np.concatenate([self.velocity, velocity])
        self.slip = np.concatenate([self.slip, slip.astype(np.uint8)])
        self.body = np.concatenate([self.body, body.astype(np.int32)])
        self.sides = np.concatenate([self.sides, sides.astype(np.uint8)])
