"""Forces and torques of the fluid on walls and bodies, as the device has them now."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.spec import types_of
from warpsph.kernels.core.torques import make_load_torque
from warpsph.scene.forcing import forcing_of

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.engine.launch import Launcher
    from warpsph.engine.population import Population
    from warpsph.engine.stepper import Stepper
    from warpsph.running.device_sums import DeviceSums
    from warpsph.scene.geometry import Geometry


class WallLoads:
    """What the fluid does to the walls of a run.

    Attributes:
        home: (bodies, d), centre of the surface of each wall body at time 0 [m]; 0 for those without a surface of their own.
    """

    def __init__(
        self,
        case: Case,
        geometry: Geometry,
        particles: Population,
        launcher: Launcher,
        stepper: Stepper,
        sums: DeviceSums,
    ) -> None:
        self.case, self.names = case, geometry.body_names
        self.particles, self.launcher, self.stepper, self.sums = particles, launcher, stepper, sums
        self.real, self.vec, self.mat, _ = types_of(particles.spec)
        self.facets = None if geometry.surface is None else geometry.surface.facets
        self._at = geometry.position[geometry.kind == 1]  # of the wall particles at time 0
        self.home = self._centres(geometry)
        self.tracks = forcing_of(case).tracks
        self._arrays: dict[str, Any] = {}

    def measure(self, name: str = "wall_load") -> Any:
        """Return the force on each wall particle, a Warp array of (walls,) vectors [N].

        name: which of the measurements of the program, `surface_load` for that over the surface of bodies.
        """
        bindings = self.stepper.bindings
        for array in ("load", "friction"):
            if array not in bindings:
                bindings[array] = self._array(array)
        if self.particles.spec.bodies:
            if "couple" not in bindings:
                bindings.update(self._facet_arrays())
            bindings["twist"].zero_()  # which a load over the surface does not write
            if self.tracks:
                bindings["body_turn"].assign(self._turns())
        self.stepper.measure(name)
        return bindings["load"]

    def forces(self) -> dict[str, float]:
        """Return the force of the fluid on the walls: `wall_force_x <body>` -> N (2-D: per metre of depth).

        The sides of the domain count as one body, `domain`; every other body is one of its own. Of these also
        the part of friction, `wall_friction_x <body>`, the torque about the centre of the surface, `wall_torque_z <body>`
        (3-D: x, y, z) [N m], and that centre, `wall_centre_x <body>` [m], which moves with the body; nan where bodies are
        cells.
        """
        load = self.measure()
        forces = self._named("wall_force", "xyz", load)
        if self.particles.spec.bodies:
            axes = "xyz" if self.particles.spec.dimension == 3 else "z"
            forces |= self._named("wall_friction", "xyz", self.stepper.bindings["friction"])
            centres = self._present()
            forces |= self._named("wall_torque", axes, self._torque(load, centres))
            for name in self.case.bodies:
                centre = centres[self.names.index(name)]
                forces |= {f"wall_centre_{axis} {name}": float(x) for axis, x in zip("xyz", centre, strict=False)}
        else:
            d = self.particles.spec.dimension
            parts = {"friction": "xyz"[:d], "torque": "xyz" if d == 3 else "z", "centre": "xyz"[:d]}
            for name in self.case.bodies:
                forces |= {f"wall_{part}_{axis} {name}": math.nan for part, axes in parts.items() for axis in axes}
        return forces

    def centre(self, body: str) -> np.ndarray:
        """Return where the centre of the surface of a body is now, (d,) [m]."""
        return np.asarray(self._present()[self.names.index(body)])

    def _named(self, quantity: str, axes: str, load: Any) -> dict[str, float]:
        """Return the sums of vectors on wall particles over each body, by `quantity_axis body`."""
        sides = {f"{axis}_{end}" for axis in "xyz" for end in ("lower", "upper")}
        names = np.array([("domain" if name in sides else name) for name in self.names])
        of_bodies = self.sums.body_forces(load, len(self.names))
        result: dict[str, float] = {}
        for name in dict.fromkeys(["domain", *names.tolist()]):
            total = of_bodies[names == name].sum(axis=0)
            for axis, value in zip(axes, total, strict=False):
                result[f"{quantity}_{axis} {name}"] = float(value)
        return result

    def _present(self) -> np.ndarray:
        """Return where the centres are now, (bodies, d) [m]."""
        result = self.home.copy()
        time = float(self.stepper.read()[0][ck.TIME])
        for track in self.tracks:
            k = self.names.index(track.name)
            result[k] = track.place(self.home[k], time)
        return result

    def _torque(self, load: Any, centres: np.ndarray) -> Any:
        """Return the torque of the force on each wall particle about the centre (bodies, d) of its body [N m]."""
        spec, device = self.particles.spec, self.launcher.device
        special: dict[str, Any] = {
            "fluid_count": self.particles.fluid_capacity,
            "pivots": wp.array(centres, dtype=self.vec, device=device),
            "load": load,
            "torque": self._array("torque"),
        }
        kernel = make_load_torque(spec.dimension, spec.precision)
        self.launcher.task("torque", kernel, self.particles.wall_count, self.stepper.bindings, special=special).run()
        return special["torque"]

    def _facet_arrays(self) -> dict[str, Any]:
        """Return what the load over the surface takes and leaves, by kernel argument name (`surface_load`)."""
        facets, device = self.facets, self.launcher.device
        assert facets is not None, "walls with a surface of their own have facets"
        walls = len(self._at)
        first = np.concatenate([[0], np.cumsum(np.bincount(facets.owner, minlength=walls))])
        arrays: dict[str, tuple[Any, Any]] = {
            "facet_first": (first, int),
            "facet_arm": (facets.foot - self._at[facets.owner], self.vec),
            "facet_normal": (facets.normal, self.vec),
            "facet_area": (facets.area, self.real),
            "facet_vector": (facets.vector, self.vec),
            "facet_moment": (facets.moment, self.mat),
            "facet_pressure": (np.zeros(facets.count), self.real),
            "facet_friction": (np.zeros_like(facets.foot), self.vec),
            "body_turn": (np.tile(np.eye(facets.foot.shape[1]), (len(self.names), 1, 1)), self.mat),
        }
        made: dict[str, Any] = {name: wp.array(rows, dtype=kind, device=device) for name, (rows, kind) in arrays.items()}
        return {**made, "couple": self._array("couple"), "twist": self._array("twist")}

    def _turns(self) -> np.ndarray:
        """Return how each wall body is turned since time 0, (bodies, d, d)."""
        d = self.particles.spec.dimension
        result = np.tile(np.eye(d), (len(self.names), 1, 1))
        time = float(self.stepper.read()[0][ck.TIME])
        for track in self.tracks:
            result[self.names.index(track.name)] = track.turn(time)[:d, :d]
        return result

    def _array(self, name: str) -> Any:
        if name not in self._arrays:
            self._arrays[name] = wp.zeros(self.particles.wall_count, dtype=self.vec, device=self.launcher.device)
        return self._arrays[name]

    def _centres(self, geometry: Geometry) -> np.ndarray:
        """Return the centre of the surface of each wall body, (bodies, d) [m]: the mean of the feet of its facets."""
        result = np.zeros((len(self.names), self.particles.spec.dimension))
        if self.facets is None:
            return result
        body = geometry.body[geometry.kind == 1][self.facets.owner]
        for k in range(len(self.names)):
            rows = body == k + 1
            if rows.any():
                result[k] = np.average(self.facets.foot[rows], axis=0, weights=self.facets.area[rows])
        return result
