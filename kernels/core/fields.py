"""The particle fields, each declared once: element type, rows, whether it follows the sort, when it exists.

The allocation, the sort and the checkpoint read this table; a kernel argument of the same name is bound to the field.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import warp as wp

from .spec import Spec, types_of


def _always(spec: Spec) -> bool:
    return True


def _riemann(spec: Spec) -> bool:
    return spec.scheme == "riemann"


def _projected(spec: Spec) -> bool:
    return spec.scheme == "isph"


def _multiphase(spec: Spec) -> bool:
    return spec.multiphase


def _walls(spec: Spec) -> bool:
    return spec.walls


def _walls_of_riemann(spec: Spec) -> bool:
    return spec.walls and spec.scheme == "riemann"


def _no_slip(spec: Spec) -> bool:
    return spec.wall_no_slip


def _shifting(spec: Spec) -> bool:
    return spec.shifting


def _interface(spec: Spec) -> bool:
    return spec.interface


def _band_list(spec: Spec) -> bool:
    return spec.interface and spec.row_list


def _tension(spec: Spec) -> bool:
    return spec.tension != "none"


def _contact(spec: Spec) -> bool:
    return spec.contact_angle


def _sided(spec: Spec) -> bool:
    return spec.multiphase and not spec.paper_star


def _flagged(spec: Spec) -> bool:
    return spec.multiphase or any(spec.periodic)


@dataclasses.dataclass(frozen=True)
class Field:
    """One particle field.

    Attributes:
        name: also the argument name in kernels.
        kind: "real", "vec", "mat", "pair" (pressure, volume), "int8", "uint8", "int16" or "int32".
        rows: "fluid", "wall" or "all"; fluid rows come before wall rows.
        kept: part of the state between steps: follows the sort and is written to checkpoints.
        exists: whether a `Spec` has the field.
        unit: SI unit.
        meaning: one line.
    """

    name: str
    kind: str
    rows: str
    kept: bool
    exists: Callable[[Spec], bool]
    unit: str
    meaning: str

    def dtype(self, spec: Spec) -> Any:
        """Return the Warp element type for a `Spec`."""
        named = {"int8": wp.int8, "uint8": wp.uint8, "int16": wp.int16, "int32": wp.int32}
        return named.get(self.kind) or getattr(types_of(spec), self.kind)


FIELDS: tuple[Field, ...] = (
    Field("anchor", "vec", "all", True, _always, "m", "position at the last list build"),
    Field("offset", "vec", "fluid", True, _always, "m", "way since the last list build"),
    Field("position", "vec", "all", True, _always, "m", "anchor + offset"),
    Field("midway", "vec", "fluid", False, _riemann, "m", "position in the middle of the step, for the continuity sweep"),
    Field("velocity", "vec", "all", True, _always, "m/s", "half a step behind the position; of the surface for walls"),
    Field("acceleration", "vec", "fluid", True, _always, "m/s^2", "of the last momentum sweep"),
    Field("velocity_old", "vec", "fluid", True, _projected, "m/s", "velocity of the step before"),
    Field("velocity_star", "vec", "fluid", False, _projected, "m/s", "velocity without the pressure of the step"),
    Field("pressure", "real", "fluid", True, _projected, "Pa", "of the last solve, start of the next"),
    Field("pressure_gradient", "vec", "fluid", True, _projected, "Pa/m", "of the last step"),
    Field("lasting_gradient", "vec", "fluid", True, _projected, "Pa/m", "of the last two steps, without impacts"),
    Field("dilation", "real", "fluid", True, _projected, "1/s", "divergence of the velocity after the last step"),
    Field("dilation_old", "real", "fluid", True, _projected, "1/s", "the same, one step earlier"),
    Field("correction", "mat", "fluid", False, _projected, "-", "makes gradients exact for linear fields"),
    Field("crowding", "vec", "fluid", False, _projected, "1/m", "sum of grad W V: zero on an even arrangement"),
    Field("spread", "real", "fluid", False, _projected, "-", "divergence of the positions: d inside a fluid"),
    Field("company", "real", "fluid", False, _projected, "-", "spread without the own images behind walls"),
    Field("exposed", "uint8", "fluid", False, _projected, "-", "surface before fragments are counted to it"),
    Field("surface", "uint8", "fluid", False, _projected, "-", "0 inside, 1 at the free surface, 2 isolated"),
    Field("surface_normal", "vec", "fluid", False, _projected, "-", "outward normal; of use at the surface alone"),
    Field("unknown", "real", "fluid", False, _projected, "Pa", "solution of the pressure equation"),
    Field("source", "real", "fluid", False, _projected, "1/s^2", "its right-hand side"),
    Field("density_excess", "real", "fluid", True, _always, "-", "rho/rho0 - 1"),
    Field("rest_volume", "real", "fluid", True, _always, "m^d", "mass / rho0"),
    Field("state", "pair", "all", True, _always, "Pa, m^d", "pressure and volume"),
    Field("state_old", "pair", "fluid", False, _riemann, "Pa, m^d", "state before the continuity sweep"),
    Field("particle_id", "int32", "all", True, _always, "-", "number given at the start"),
    Field("phase", "int8", "fluid", True, _multiphase, "-", "index of the fluid phase"),
    Field("wall_impact", "real", "fluid", True, _walls_of_riemann, "Pa", "what a wall adds to the pressure of an impact"),
    Field("shift", "vec", "fluid", True, _shifting, "m", "shift to apply in the next drift"),
    Field("carried", "vec", "fluid", True, _shifting, "m/s", "change of velocity that belongs to the shift"),
    Field("velocity_gradient", "mat", "fluid", False, _sided, "1/s", "grad v of the own phase, next to an interface"),
    Field("facing", "vec", "fluid", False, _sided, "-", "unit vector to the other phases, next to an interface"),
    Field("fraction", "real", "fluid", False, _interface, "-", "share of the own phase around a particle"),
    Field("contact_cosine", "real", "fluid", False, _contact, "-", "of the contact angle of its own phase"),
    Field("normal", "vec", "fluid", True, _interface, "1/m", "gradient of the own phase's share"),
    Field("interface_weight", "real", "fluid", True, _interface, "-", "(|normal| h)^2, zero away from interfaces"),
    Field("curvature", "real", "fluid", True, _tension, "1/m", "of the interface, positive if the own phase is convex"),
    Field("wall_body", "int32", "wall", True, _walls, "-", "number of the wall body"),
    Field("slip", "uint8", "wall", True, _no_slip, "-", "1 on free-slip walls"),
    Field("wall_depth", "real", "wall", True, _no_slip, "m", "distance of a wall particle from the surface; 0: unknown"),
    Field("mirror_velocity", "vec", "wall", True, _no_slip, "m/s", "velocity that friction on the wall sees"),
    Field("fluid_neighbours", "int16", "all", False, _always, "-", "fluid particles in the list"),
    Field("wall_neighbours", "int16", "fluid", False, _walls, "-", "wall particles in the list, after the fluid"),
    Field("flags", "uint8", "all", False, _flagged, "-", "bits of `pair`: image, first ring, band"),
    Field("band_mark", "int32", "fluid", False, _band_list, "-", "1 in the interface band"),
    Field("band_sum", "int32", "fluid", False, _band_list, "-", "running sum of band_mark"),
    Field("band", "int32", "fluid", False, _band_list, "-", "particles of the interface band, in order"),
)


def fields_of(spec: Spec) -> tuple[Field, ...]:
    """Return the fields that exist for a `Spec`, in table order."""
    return tuple(field for field in FIELDS if field.exists(spec))
