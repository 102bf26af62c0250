"""The state of a simulation at one moment, as NumPy arrays on the host: what outputs and gauges see."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

FLUID = 0
WALL = 1


@dataclass(frozen=True)
class Stations:
    """Stress of the fluid at the stations of the surface of a body, n in d dimensions.

    Attributes:
        position: (n, d), of the surface [m].
        normal: (n, d), unit normal into the fluid [1].
        area: (n,), of the surface that a station stands for [m^(d-1)].
        pressure: (n,), of the fluid there, 0 where it is dry [Pa].
        friction: (n, d), viscous stress on the surface [Pa]; area (friction - pressure normal) is the force,
            to second order in the size of a station over the radius of the surface.
        arc, angle: (n,), way along the outline [m], and direction from the centre of the surface [rad]; None in 3-D.
        along: (n,), the friction in the sense of the outline [Pa]; None in 3-D.
    """

    position: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    pressure: np.ndarray
    friction: np.ndarray
    arc: np.ndarray | None
    angle: np.ndarray | None
    along: np.ndarray | None


# Arrays with one row a particle that a scene may lack.
LYAPUNOV_FIELDS = ("ftle_backward", "ftle_forward", "ftle_age", "ftle_way")
OPTIONAL_FIELDS = ("normal", "curvature", "acceleration", "vorticity", "q_criterion", *LYAPUNOV_FIELDS)


@dataclass
class Snapshot:
    """A host copy of all particles. Rows are sorted by `particle_id`; n is the number of particles.

    In 2-D every quantity is per metre of depth: masses are kg/m, volumes are areas in m^2.
    """

    time: float
    """simulated time [s]"""
    step: int
    """number of time steps done"""
    dt: float
    """size of the last time step [s]"""
    dimension: int
    """2 or 3"""
    position: np.ndarray
    """(n, dimension) float64 [m]"""
    velocity: np.ndarray
    """(n, dimension) [m/s]"""
    density: np.ndarray
    """(n,) [kg/m^3]"""
    pressure: np.ndarray
    """(n,) [Pa]"""
    mass: np.ndarray
    """(n,) [kg], in 2-D [kg/m]"""
    volume: np.ndarray
    """(n,) [m^3], in 2-D [m^2]"""
    phase: np.ndarray
    """(n,) int32, index into the case's `phase_names`; -1 for wall particles"""
    particle_id: np.ndarray
    """(n,) int64, keeps its particle through the whole run"""
    kind: np.ndarray
    """(n,) uint8, 0 fluid, 1 wall"""
    particle_spacing: float
    """initial distance between particles [m]"""
    normal: np.ndarray | None = None
    """(n, dimension) unit normal of the interface [1], or None"""
    curvature: np.ndarray | None = None
    """(n,) curvature of the interface [1/m], or None"""
    acceleration: np.ndarray | None = None
    """(n, dimension) [m/s^2], or None"""
    vorticity: np.ndarray | None = None
    """(n,) dv/dx - du/dy, in 3-D (n, 3), 0 for walls [1/s]; None where nothing has asked for it"""
    q_criterion: np.ndarray | None = None
    """(n,) second invariant of the velocity gradient, 0 for walls [1/s^2]; None where nothing has asked for it"""
    ftle_backward: np.ndarray | None = None
    """(n,) backward finite-time Lyapunov exponent of the oldest window [1/s], 0 for walls, or None"""
    ftle_forward: np.ndarray | None = None
    """(n,) the forward one, which belongs to `position - ftle_way` [1/s], or None"""
    ftle_age: np.ndarray | None = None
    """(n,) time that both are of [s], or None"""
    ftle_way: np.ndarray | None = None
    """(n, dimension) way of the fluid in that time [m], or None"""
    extra: dict[str, float] = field(default_factory=dict)
    """scalars that the device measured at this moment, such as `interface_length` or `wall_force_x block`"""
    own: dict[str, np.ndarray] = field(default_factory=dict)
    """fields of the scheme's own, (n,)"""
    samples: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    """gauge name -> field -> values at the gauge's points, (points,) or (points, dimension)"""
    surfaces: dict[str, Stations] = field(default_factory=dict)
    """body -> what the fluid does along its surface"""
    sums: dict[type, Any] = field(default_factory=dict)
    """sums over the phases that the device formed at this moment, by their class in `warpsph.measure.totals`"""

    def __len__(self) -> int:
        """The number of particles."""
        return len(self.particle_id)

    @property
    def fluid(self) -> Snapshot:
        """The fluid particles alone."""
        return self.select(self.kind == FLUID)

    @property
    def wall(self) -> Snapshot:
        """The wall particles alone."""
        return self.select(self.kind == WALL)

    def select(self, rows: np.ndarray) -> Snapshot:
        """The particles at `rows`, a mask (n,) or indices; scalars, `extra`, `samples`, `surfaces` and `sums` stay."""
        values: dict[str, Any] = {item.name: getattr(self, item.name) for item in fields(self)}
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                values[name] = value[rows]
        values["own"] = {name: value[rows] for name, value in self.own.items()}
        return Snapshot(**values)
