"""Wall particles: the layers behind the sides of the domain, the obstacles, and the bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.domain import AXES
from warpsph.errors import ExpressionError, Problem
from warpsph.scene.body_surfaces import Solid, make_solids
from warpsph.scene.fluid_regions import expression_problem
from warpsph.scene.lattice import Lattice, points_of
from warpsph.scene.masks import inside

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case


@dataclass(frozen=True)
class Surroundings:
    """The surface of the walls as each wall particle has it before it; n rows.

    normal: (n, d), unit vector from the wall into the fluid, at the foot
    depth: (n,), distance from the foot, the nearest point of the surface, m
    area: (n,), area of the surface that a particle of the first layer stands for, 0 for those beneath, m^(d-1)
    volume: (n,), m^d
    leader: (n,) int, row of the particle of the first layer that is nearest to the foot
    """

    normal: NDArray[np.float64]
    depth: NDArray[np.float64]
    area: NDArray[np.float64]
    volume: NDArray[np.float64]
    leader: NDArray[np.int64]


def surroundings_of_sides(position: NDArray[np.float64], lattice: Lattice) -> Surroundings:
    """The surface of the sides of the domain, seen from the middles (n, d) of cells beyond them, m."""
    from scipy.spatial import cKDTree

    n = len(position)
    foot = np.clip(position, lattice.lower, lattice.upper)
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
    return Surroundings(normal, depth, area, np.full(n, lattice.cell_volume), leader)


class WallCells:
    """The wall particles of a case: first the sides of the domain, then the obstacles, then the bodies.

    solid: which cells of the lattice sides and obstacles take
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
        self.body = np.empty(0, dtype=np.int32)
        self.solids: list[Solid] = []

    @property
    def count(self) -> int:
        return len(self.body)

    def solid_in_domain(self) -> NDArray[np.bool_] | None:
        """Which cells of the domain obstacles take; None if there are none."""
        return self.solid[self.lattice.domain] if self.case.obstacles else None

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
                speeds[k][beyond] = side.velocity or 0.0
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
        self._append(cells, velocity, ~any_no_slip, body)

    def add_obstacles(self, problems: list[Problem]) -> None:
        """Make the cells inside obstacles solid; where two overlap, the first has them.

        An obstacle may stick out of an open side as far as the layers reach.
        """
        lattice = self.lattice
        axes = lattice.axes() if self.case.obstacles else []
        for k, obstacle in enumerate(self.case.obstacles):
            path = f"obstacles.{k}.shape"
            try:
                mask = inside(obstacle.shape, axes, self.case.spacing)
            except (ExpressionError, ValueError) as error:
                problems.append(expression_problem(path, obstacle.shape, error))
                continue
            mask &= ~self.solid
            self.names.append(obstacle.name or f"obstacle_{k + 1}")
            if not mask.any():
                rule = (
                    "holds no particle of its own: it is outside the domain, thinner than particle_spacing "
                    f"({self.case.spacing:g} m) or inside another obstacle"
                )
                problems.append(Problem(path, obstacle.shape.kind, rule, "move or enlarge it, or delete it"))
                continue
            self.solid |= mask
            cells = np.nonzero(mask)
            n = len(cells[0])
            velocity = np.broadcast_to(obstacle.velocity or 0.0, (n, lattice.dimension))
            free = np.full(n, obstacle.wall == "free_slip")
            self._append(cells, velocity, free, np.full(n, len(self.names)))

    def add_bodies(self, support: float, problems: list[Problem]) -> None:
        """Add the boundary particles of the bodies; which cells they take is for `block` to say.

        support: reach of the smoothing kernel, m; the layers are as deep.
        """
        self.solids = make_solids(self.case, self.lattice, support, problems)
        for solid, (name, body) in zip(self.solids, self.case.bodies.items(), strict=False):
            self.names.append(name)
            n = solid.sampling.count
            free = np.full(n, body.wall == "free_slip")
            still = np.zeros((n, self.lattice.dimension))
            self._append_at(solid.sampling.position, still, free, np.full(n, len(self.names)))

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
        sides = surroundings_of_sides(self.position[: self.count - known], lattice)
        parts, first = [sides], len(sides.depth)
        for solid in self.solids:
            s = solid.sampling
            parts.append(Surroundings(s.normal, s.depth, s.area, s.volume, s.leader + first))
            first += len(s.depth)
        columns = zip(*((p.normal, p.depth, p.area, p.volume, p.leader) for p in parts), strict=True)
        return Surroundings(*(np.concatenate(column) for column in columns))

    def _append(self, cells: tuple[NDArray[np.intp], ...], velocity: Any, slip: Any, body: Any) -> None:
        self._append_at(points_of(self.lattice.axes(), cells), velocity, slip, body)

    def _append_at(self, position: Any, velocity: Any, slip: Any, body: Any) -> None:
        self.position = np.concatenate([self.position, position])
        self.velocity = np.concatenate([self.velocity, velocity])
        self.slip = np.concatenate([self.slip, slip.astype(np.uint8)])
        self.body = np.concatenate([self.body, body.astype(np.int32)])
