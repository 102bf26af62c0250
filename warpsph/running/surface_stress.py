"""Pressure and friction at the stations of the surface of a body, as the device has them now (theory: bodies#arc)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.scene.arc import arc_lengths, tangents
from warpsph.scene.body_surfaces import goes_on
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
    """The stations of a body: its facets, in the order of the arc where there is one.

    facet: (n,), place among the facets of all walls
    number: (n,), of their particles: place among the wall particles of the start
    arc: (n,), m, of a plane body, else None
    hollow: whether the body is all around its shape
    """

    facet: NDArray[np.intp]
    number: NDArray[np.intp]
    arc: NDArray[np.float64] | None
    hollow: bool


class SurfaceStress:
    """What the fluid does along the surfaces of bodies.

    A station is what a particle of the first layer stands for of one face: its foot, its size, and the stress there, of
    which the load over the surface is the sum (`kernels/core/surface_load.py`).
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
        rows, bindings = row[order.number], self.stepper.bindings

        def get(name: str) -> NDArray[np.float64]:
            return np.asarray(bindings[f"facet_{name}"].numpy()[order.facet], np.float64)

        turn = bindings["body_turn"].numpy().astype(np.float64)[self.geometry.body_names.index(body)]
        normal, area = get("normal") @ turn.T, get("area")
        foot = np.asarray(self._of_walls("position")[rows], np.float64) + get("arm") @ turn.T
        pressure, friction = get("pressure"), get("friction")
        centre = self.loads.centre(body)
        lattice = self.geometry.lattice
        period = np.subtract(lattice.upper, lattice.lower)
        foot -= np.asarray(self.case.periodic) * period * np.round((foot - centre) / period)  # the body in one piece
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
            facets = surface.facets
            own = geometry.body[geometry.kind == 1][facets.owner] == geometry.body_names.index(body) + 1
            facet = np.flatnonzero(own)
            shape = geometry.shapes[list(self.case.bodies).index(body)]
            arc = None
            if shape.dimension == 2:
                lattice = geometry.lattice
                foot, normal = facets.foot[facet], facets.normal[facet]
                on = goes_on(self.case, self.case.bodies[body], shape, lattice)
                low, high = np.where(on, -np.inf, lattice.lower), np.where(on, np.inf, lattice.upper)
                arc = arc_lengths(shape, foot, normal, spacing, low.tolist(), high.tolist())
                facet, arc = facet[np.argsort(arc, kind="stable")], np.sort(arc)
            self._orders[body] = _Order(facet, facets.owner[facet], arc, shape.hollow)
        return self._orders[body]
