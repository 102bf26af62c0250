"""The particle fields that every scheme has, each declared once: type, rows, whether it follows the sort, when it exists.

A scheme declares those of its own in the same way. The allocation, the sort and the checkpoint read the declarations; a
kernel argument of the same name is bound to the field.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import warp as wp

from .spec import Spec, curvature_type, origins_type, phase_types_of, types_of

NOBODY, FLUID, BUFFER = 0, 1, 2  # of `zone`; BUFFER + k is the buffer of the open side k


def always(spec: Spec) -> bool:
    """Every run."""
    return True


def multiphase(spec: Spec) -> bool:
    """Runs of several phases."""
    return spec.multiphase


def walls(spec: Spec) -> bool:
    """Runs with wall particles."""
    return spec.walls


def known_sides(spec: Spec) -> bool:
    """Runs in which wall particles know the sides of the domain that they are behind."""
    return spec.varying_sides or spec.own_sides


def no_slip(spec: Spec) -> bool:
    """Runs with friction on walls."""
    return spec.wall_no_slip


def staged_walls(spec: Spec) -> bool:
    """Runs with friction on walls in stages."""
    return spec.wall_no_slip and spec.viscous_stages > 1


def depths(spec: Spec) -> bool:
    """Runs in which wall particles know how far behind the surface they are."""
    return spec.wall_no_slip or spec.bodies


def bodies(spec: Spec) -> bool:
    """Runs with walls that have a surface of their own."""
    return spec.bodies


def moving_bodies(spec: Spec) -> bool:
    """Runs with bodies that have a surface of their own, and bodies that move."""
    return spec.bodies and spec.moving


def viscous_surface(spec: Spec) -> bool:
    """Return whether there is a free surface that friction pulls at."""
    return spec.free_surface and spec.viscosity != "none" and not spec.printed


def slipping(spec: Spec) -> bool:
    """Runs of one viscous fluid beside walls with a surface of their own."""
    return spec.bodies and spec.viscosity != "none" and not spec.multiphase


def implicit_at_bodies(spec: Spec) -> bool:
    """Runs of ISPH with implicit friction on bodies that have a surface of their own."""
    return spec.bodies and spec.implicit_viscosity


def free_surface(spec: Spec) -> bool:
    """Runs with a free surface."""
    return spec.free_surface


def smoothed(spec: Spec) -> bool:
    """Runs of ISPH that smooth the velocity, or need its gradient at a free surface."""
    return spec.free_surface or (spec.shifting and not spec.printed)


def pierced_surface(spec: Spec) -> bool:
    """Runs with a free surface and bodies, which may stand out of it."""
    return spec.free_surface and spec.bodies


def followed(spec: Spec) -> bool:
    """Runs with bodies whose surface pressure follows the fluid slowly."""
    return spec.wall_sound


def dry_walls(spec: Spec) -> bool:
    """Runs in which walls that no fluid has come to are not there."""
    return spec.dry_walls


def tails(spec: Spec) -> bool:
    """Runs with bodies that have thin tails."""
    return spec.tails


def moving_tails(spec: Spec) -> bool:
    """Runs with bodies that have thin tails, and bodies that move."""
    return spec.tails and spec.moving


def shifting(spec: Spec) -> bool:
    """Runs that shift particles."""
    return spec.shifting


def flagged(spec: Spec) -> bool:
    """Runs whose list tells phases or images apart."""
    return spec.multiphase or any(spec.periodic)


def varying_sides(spec: Spec) -> bool:
    """Runs in which the velocity of a side of the domain depends on time."""
    return spec.walls and spec.varying_sides


def moving(spec: Spec) -> bool:
    """Runs in which bodies move."""
    return spec.moving


def changing(spec: Spec) -> bool:
    """Runs in which particles are born or die."""
    return spec.changing


def flow_through(spec: Spec) -> bool:
    """Runs with inlets or outlets."""
    return spec.open_axis >= 0


def windowed(spec: Spec) -> bool:
    """Runs that follow where particles were at the start of windows of time."""
    return spec.windows > 0


def windowed_shifting(spec: Spec) -> bool:
    """Those of them that shift particles."""
    return spec.windows > 0 and spec.shifting


def windowed_changing(spec: Spec) -> bool:
    """Those of them in which particles are born."""
    return spec.windows > 0 and spec.changing


@dataclasses.dataclass(frozen=True)
class Field:
    """One particle field.

    Attributes:
        name: also the argument name in kernels.
        kind: "real", "vec", "mat", "pair" (pressure, volume), "int8", "uint8", "int16", "int32",
            "origins", a place for each window, "phased" or "normals", a number or a vector for each phase,
            "curved", a number, or one for each phase where `Spec.triple` says so.
        rows: "fluid", "wall" or "all"; fluid rows come before wall rows.
        kept: part of the state between steps: follows the sort and is written to checkpoints.
        exists: whether a `Spec` has the field.
        unit: SI unit.
        meaning: one line.
        blank: zeros are its value where no stage of a run writes it.
    """

    name: str
    kind: str
    rows: str
    kept: bool
    exists: Callable[[Spec], bool]
    unit: str
    meaning: str
    blank: bool = False

    def dtype(self, spec: Spec) -> Any:
        """Return the Warp element type for a `Spec`."""
        named = {"int8": wp.int8, "uint8": wp.uint8, "int16": wp.int16, "int32": wp.int32}
        if self.kind == "origins":
            return origins_type(spec)
        if self.kind == "curved":
            return curvature_type(spec)
        if self.kind in ("phased", "normals"):
            return phase_types_of(spec)[self.kind == "normals"]
        return named.get(self.kind) or getattr(types_of(spec), self.kind)


COMMON: tuple[Field, ...] = (
    Field("anchor", "vec", "all", True, always, "m", "position at the last list build"),
    Field("offset", "vec", "fluid", True, always, "m", "way since the last list build"),
    Field("position", "vec", "all", True, always, "m", "anchor + offset"),
    Field("velocity", "vec", "all", True, always, "m/s", "half a step behind the position; of the surface for walls"),
    Field("particle_id", "int32", "all", True, always, "-", "number given at the start"),
    Field("phase", "int8", "fluid", True, multiphase, "-", "index of the fluid phase"),
    Field("wall_body", "int32", "wall", True, walls, "-", "number of the wall body"),
    Field("home", "vec", "wall", True, moving, "m", "position at time 0 of a particle of a body"),
    Field("home_normal", "vec", "wall", True, moving, "-", "normal at time 0"),
    Field("wall_acceleration", "vec", "wall", True, moving, "m/s^2", "of a particle of a body"),
    Field("wall_sides", "uint8", "wall", True, known_sides, "-", "bits: the sides that a wall particle is behind"),
    Field("fluid_neighbours", "int16", "all", False, always, "-", "fluid particles in the list"),
    Field("wall_neighbours", "int16", "fluid", False, walls, "-", "wall particles in the list, after the fluid"),
    Field("flags", "uint8", "all", False, flagged, "-", "bits of `pair`: image, first ring, band"),
    Field("alive", "uint8", "fluid", True, changing, "-", "0 for a particle that the next list build drops"),
)
"""fields that the list needs, of any scheme"""

FLOW: tuple[Field, ...] = (
    Field("acceleration", "vec", "fluid", True, always, "m/s^2", "of the last momentum sweep"),
    Field("density_excess", "real", "fluid", True, always, "-", "rho/rho0 - 1"),
    Field("rest_volume", "real", "fluid", True, always, "m^d", "mass / rho0"),
    Field("state", "pair", "all", True, always, "Pa, m^d", "pressure and volume"),
    Field("shift", "vec", "fluid", True, shifting, "m", "shift to apply in the next drift"),
    Field("carried", "vec", "fluid", True, shifting, "m/s", "change of velocity that belongs to the shift"),
    Field("zone", "int8", "fluid", True, flow_through, "-", "0 nobody, 1 fluid, from 2 on the buffer of an open side"),
    Field("row_speed", "real", "fluid", True, flow_through, "m/s", "at which a buffer particle moves along the axis"),
    Field("slip", "uint8", "wall", True, no_slip, "-", "1 on free-slip walls"),
    Field("wall_depth", "real", "wall", True, depths, "m", "distance of a wall particle from the surface; 0: unknown"),
    Field("wall_normal", "vec", "wall", True, bodies, "-", "unit vector from the wall into the fluid, at the foot"),
    Field("wall_area", "real", "wall", True, bodies, "m^(d-1)", "of the surface before a particle of the first layer"),
    Field("boundary_volume", "real", "wall", True, bodies, "m^d", "volume of a wall particle"),
    Field("leader", "int32", "wall", True, bodies, "-", "number among the walls of the first-layer particle at the foot"),
    Field("sheet", "int8", "wall", True, tails, "-", "side of a thin tail through which a wall particle is seen; 0: any"),
    Field("frame", "int16", "wall", True, tails, "-", "number of the frame of lines of sight to it, -1: none"),
    Field("frame_carried", "int16", "wall", True, moving_tails, "-", "number of the frame that moves with it, -1: none"),
    Field("frame_near", "int16", "fluid", False, tails, "-", "number of the frame of lines of sight nearby, -1: none"),
    Field("row_of_wall", "int32", "wall", False, bodies, "-", "present row, among the walls, of each by its number"),
    Field("surface_pressure", "real", "wall", False, bodies, "Pa", "of the fluid at the foot, for the first layer"),
    Field("covered", "uint8", "wall", False, dry_walls, "-", "1 where another wall stands before the foot"),
    Field("surface_wet", "real", "wall", False, dry_walls, "-", "share of a wall that is there for the fluid"),
    Field("surface_gradient", "vec", "wall", False, bodies, "Pa/m", "of the pressure there"),
    Field("surface_slope", "real", "wall", True, followed, "Pa/m", "part of it along the normal that follows slowly"),
    Field("surface_shear", "mat", "wall", False, bodies, "1/s", "velocity gradient there, [a, b] = d v_a / d x_b"),
    Field("surface_velocity", "vec", "wall", False, bodies, "m/s", "of the fluid at the foot, for the first layer"),
    Field("surface_bend", "vec", "wall", False, bodies, "1/(m s)", "half the second derivative of v along the normal"),
    Field("surface_growth", "pair", "wall", False, bodies, "1/(m s)", "how a shear grows along a wall, see `shear_growth`"),
    Field("slip_slope", "vec", "wall", False, slipping, "1/s", "change of v along a wall without friction, across it"),
    Field("mirror_velocity", "vec", "wall", True, depths, "m/s", "of the flow continued into the wall"),
    Field("mirror_ratio", "real", "wall", False, staged_walls, "-", "velocity mirrored over that which is mirrored"),
    Field("origin", "origins", "fluid", True, windowed, "m", "place at the start of each window, see `flow_map`"),
    Field("origin_change", "origins", "fluid", True, windowed_shifting, "m", "what the coming shift makes of it"),
    Field("born", "real", "fluid", True, windowed_changing, "s", "time of birth"),
    Field("ftle_backward", "real", "fluid", False, windowed, "1/s", "backward Lyapunov exponent", True),
    Field("ftle_forward", "real", "fluid", False, windowed, "1/s", "forward Lyapunov exponent", True),
    Field("ftle_age", "real", "fluid", False, windowed, "s", "time that both are of", True),
    Field("ftle_way", "vec", "fluid", False, windowed, "m", "way in that time", True),
)
"""fields of a scheme of fluid flow"""
