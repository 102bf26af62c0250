"""Pressure and friction at the stations of the surface of a body, as the device has them now (theory: bodies#arc)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.scene.arc import arc_lengths, tangents
from warpsph.snapshot import Stations

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.engine.population import Population
    from warpsph.engine.stepper import Stepper
    from warpsph.running.wall_loads import WallLoads
    from warpsph.scene.geometry import Geometry


@dataclass(frozen=True)
class _Order:
    """The stations of a body: numbers of their wall particles, in the order of the arc where there is one.

    number: (n,), place among the wall particles of the start
    arc: (n,), m, of a plane body, else None
    hollow: whether the body is all around its shape
    """

    number: NDArray[np.intp]
    arc: NDArray[np.float64] | None
    hollow: bool


class SurfaceStress:
    """What the fluid does along the surfaces of bodies.

    A station is a particle of the first layer: its foot, the surface that it stands for, and the stress there, of which the
    load over the surface is the sum (`kernels/core/surface_load.py`).
    """

    def __init__(self, case: Case, geometry: Geometry, particles: Population, stepper: Stepper, loads: WallLoads) -> None:
        self.case, self.geometry = case, geometry
        self.particles, self.stepper, self.loads = particles, stepper, loads
        self._orders: dict[str, _Order] = {}

    def measure(self, body: str) -> Stations:
        """Return the stations of a body now."""
        self.loads.measure("surface_load")
        order = self._order(body)
        row = np.empty(self.particles.wall_count, dtype=np.intp)
        row[self._of_walls("particle_id") - self.geometry.fluid_count] = np.arange(len(row))
        rows = row[order.number]

        def get(name: str) -> NDArray[np.float64]:
            return np.asarray(self._of_walls(name)[rows], np.float64)

        normal, area = get("wall_normal"), get("wall_area")
        foot = get("position") + normal * get("wall_depth")[:, None]
        bindings = self.stepper.bindings
        stress = {name: np.float64(bindings[name].numpy()[rows]) / area[:, None] for name in ("load", "friction")}
        friction = stress["friction"]
        pressure = np.einsum("ij,ij->i", friction - stress["load"], normal)
        centre = self.loads.centre(body)
        along = angle = None
        if order.arc is not None:
            along = np.einsum("ij,ij->i", friction, tangents(normal, order.hollow))
            angle = np.arctan2(foot[:, 1] - centre[1], foot[:, 0] - centre[0]) % (2.0 * np.pi)
        return Stations(foot, normal, area, pressure, friction, order.arc, angle, along)

    def _of_walls(self, name: str) -> NDArray[Any]:
        """Return the rows of a field that are those of walls, in their present order; of the fluid nothing is copied."""
        array: Any = self.particles.arrays[name]
        if self.particles.fields[name].rows == "all":
            array = array[self.particles.fluid_capacity :]
        return np.asarray(array.numpy())

    def _order(self, body: str) -> _Order:
        """Return the stations of a body, found at the first call."""
        if body not in self._orders:
            geometry, spacing = self.geometry, self.case.spacing
            surface = geometry.surface
            assert surface is not None, "a body has a surface"
            wall = geometry.kind == 1
            own = geometry.body[wall] == geometry.body_names.index(body) + 1
            number = np.flatnonzero(own & (surface.area > 0.0))
            shape = geometry.shapes[list(self.case.bodies).index(body)]
            arc = None
            if shape.dimension == 2:
                normal = surface.normal[number]
                foot = geometry.position[wall][number] + surface.depth[number, None] * normal
                lattice = geometry.lattice
                arc = arc_lengths(shape, foot, normal, spacing, list(lattice.lower), list(lattice.upper))
                number, arc = number[np.argsort(arc, kind="stable")], np.sort(arc)
            self._orders[body] = _Order(number, arc, shape.hollow)
        return self._orders[body]
