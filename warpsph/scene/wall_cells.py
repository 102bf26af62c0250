"""Wall particles: the layers behind the sides of the domain, and the obstacles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.domain import AXES
from warpsph.case.signals import vector_at
from warpsph.errors import ExpressionError, Problem
from warpsph.scene.fluid_regions import expression_problem
from warpsph.scene.lattice import Lattice, points_of
from warpsph.scene.masks import inside

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case


class WallCells:
    """The wall particles of a case: first the sides of the domain, then the obstacles."""

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

    @property
    def count(self) -> int:
        return len(self.body)

    def solid_in_domain(self) -> NDArray[np.bool_] | None:
        """Which cells of the domain are solid; None if none is."""
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
            self._append(cells, velocity, free, np.full(n, len(self.names)), np.zeros(n))

    def _append(self, cells: tuple[NDArray[np.intp], ...], velocity: Any, slip: Any, body: Any, sides: Any) -> None:
        self.position = np.concatenate([self.position, points_of(self.lattice.axes(), cells)])
        self.velocity = np.concatenate([self.velocity, velocity])
        self.slip = np.concatenate([self.slip, slip.astype(np.uint8)])
        self.body = np.concatenate([self.body, body.astype(np.int32)])
        self.sides = np.concatenate([self.sides, sides.astype(np.uint8)])
