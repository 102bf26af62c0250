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
        self.vec = types_of(particles.spec).vec
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

    def _array(self, name: str) -> Any:
        if name not in self._arrays:
            self._arrays[name] = wp.zeros(self.particles.wall_count, dtype=self.vec, device=self.launcher.device)
        return self._arrays[name]

    def _centres(self, geometry: Geometry) -> np.ndarray:
        """Return the centre of the surface of each wall body, (bodies, d) [m]: the mean of its first layer's feet."""
        result = np.zeros((len(self.names), self.particles.spec.dimension))
        surface = geometry.surface
        if surface is None:
            return result
        wall = geometry.kind == 1
        foot = geometry.position[wall] + surface.depth[:, None] * surface.normal
        for k in range(len(self.names)):
            rows = (geometry.body[wall] == k + 1) & (surface.area > 0)
            if rows.any():
                result[k] = np.average(foot[rows], axis=0, weights=surface.area[rows])
        return result
