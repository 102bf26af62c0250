"""The columns of each type of gauge, and arithmetic of columns.

What a reference may compare is checked when a case is read, so that the columns are known here, before anything is measured.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from warpsph.case.budget_terms import MOVING, TERMS
from warpsph.case.coefficients import chosen_bodies
from warpsph.case.domain import AXES
from warpsph.case.expressions import Expression, compile_expression

__all__ = [
    "FIELD_UNITS",
    "OWN_COLUMNS",
    "VECTOR_FIELDS",
    "Column",
    "column_formula",
    "column_names",
    "columns_of",
    "open_side_names",
    "wall_bodies",
]

FIELD_UNITS = {
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "density": "kg/m^3",
    "pressure": "Pa",
    "volume": "m^3",
    "phase": "1",
    "curvature": "1/m",
    "normal": "1",
    "vorticity": "1/s",
    "q_criterion": "1/s^2",
    "ftle_backward": "1/s",
    "ftle_forward": "1/s",
    "ftle_age": "s",
    "ftle_way": "m",
}
"""Fields that can be sampled, and their units (3-D)."""

VECTOR_FIELDS = ("velocity", "acceleration", "normal", "ftle_way")


@dataclass(frozen=True)
class Column:
    """Name and unit of one column of a gauge."""

    name: str
    unit: str

    def __str__(self) -> str:
        return f"{self.name} [{self.unit}]"


OWN_COLUMNS: dict[str, Callable[[Any, Any], list[Column]]] = {}
"""columns of gauges that a program has added, from gauge and case, see `warpsph.measure.gauges.register`"""


def columns_of(spec: Any, case: Any) -> list[Column]:
    """Names and units of the columns after the time that a gauge has in a run.

    spec: the gauge in the case; case: the case, or what could be read of a faulty one.
    """
    if spec.type in OWN_COLUMNS:
        return OWN_COLUMNS[spec.type](spec, case)
    return _COLUMNS[spec.type](spec, case, list(case.phase_names), AXES[: case.dimension])


def column_names(name: str, spec: Any, case: Any) -> list[str]:
    """Names of the columns that the gauge `name` of a case has in a run, the time first."""
    return ["time", *(column.name for column in columns_of(spec, case))]


def wall_bodies(case: Any) -> list[str]:
    """Names of the solid bodies of a case, as in `wall_force_x <body>`: `domain` if it has walls, then the
    bodies.
    """
    at_domain = any("wall" in (axis.lower.kind, axis.upper.kind) for axis in case.sides)
    return [*(["domain"] if at_domain else []), *case.bodies]


def column_formula(names: Iterable[str], text: str) -> tuple[Expression, dict[str, str]]:
    """Arithmetic of columns such as `2 * kinetic` or `highest_x gas - lowest_x gas`.

    Returns the expression and the column that each of its names stands for. Raises ExpressionError.
    """
    names = list(names)
    called = {name: name for name in names if name.isidentifier()}
    formula = text
    # A name of several words gets one word as a stand-in, the longest first, since `kinetic gas` may be part of another.
    # `gas - liquid` is none of them: as arithmetic it means the same.
    several = [name for name in names if " " in name and all(word.isidentifier() for word in name.split(" "))]
    for place, name in enumerate(sorted(several, key=len, reverse=True)):
        formula, count = re.subn(rf"(?<!\w){re.escape(name)}(?!\w)", f"column_{place}", formula)
        if count:
            called[f"column_{place}"] = name
    return compile_expression(formula, names=list(called)), called


# ------------------------------------------------------------------------------------------------------------
# one function a type of gauge, called with the gauge of the case, the case, the names of its phases and its axes

_Names = Sequence[str]


def _unit(axes: _Names, three_d: str, two_d: str) -> str:
    """The unit in this dimension: in 2-D all is per metre of depth, in 1-D per square metre of the section."""
    return {3: three_d, 2: two_d}.get(len(axes), f"{three_d}/m^2")


def _energy(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    surface = ["surface"] if any(pair.coefficient > 0 for pair in case.surface_tension) else []
    names = ["kinetic", "potential", "elastic", *surface, "total"]
    for phase in phases:
        names += [f"kinetic {phase}", f"total {phase}"]
    return [Column(name, _unit(axes, "J", "J/m")) for name in names]


def _momentum(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    linear, angular = _unit(axes, "kg m/s", "kg/s"), _unit(axes, "kg m^2/s", "kg m/s")
    return [
        *(Column(f"momentum_{axis}", linear) for axis in axes),
        *(Column(f"angular_{axis}", angular) for axis in {3: axes, 2: ("z",)}.get(len(axes), ())),
        Column("scale", linear),
        Column("max_speed", "m/s"),
    ]


def _budget(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    force, impulse = _unit(axes, "N", "N/m"), _unit(axes, "N s", "N s/m")
    result = []
    for term in ("total", *TERMS):
        result += [Column(f"power {term}", _unit(axes, "W", "W/m")), Column(f"work {term}", _unit(axes, "J", "J/m"))]
        if term == "total" or term in MOVING:
            result += [Column(f"force_{axis} {term}", force) for axis in axes]
            result += [Column(f"impulse_{axis} {term}", impulse) for axis in axes]
    return result


def _phase_pressure(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    pairs = [f"{first} - {second}" for first, second in combinations(phases, 2)]
    return [Column(name, "Pa") for name in [*phases, *pairs, "max", "min"]]


def _extents(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    result = []
    for phase in phases:
        for quantity in ("lowest", "highest", "centroid"):
            result += [Column(f"{quantity}_{axis} {phase}", "m") for axis in axes]
        result.append(Column(f"front {phase}", "m"))
        if len(axes) == 2:
            result.append(Column(f"area {phase}", "m^2"))
            result += [Column(f"circularity {phase}", "1"), Column(f"roundness {phase}", "1")]
        else:
            result.append(Column(f"volume {phase}", "m^3"))
        result += [Column(f"semi_axis_{axis} {phase}", "m") for axis in axes]
    return result


def _contour(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    result = []
    for phase in phases:
        units = {"perimeter": "m", "circularity": "1", "filling": "1"}
        result += [Column(f"{name} {phase}", unit) for name, unit in units.items()]
        result += [Column(f"{end}_{axis} {phase}", "m") for end in ("lowest", "highest") for axis in axes]
        result += [] if getattr(spec, "mirror", None) is None else [Column(f"asymmetry {phase}", "m")]
    return result


def _deformation(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    lengths = ("long_axis", "short_axis") if len(axes) == 2 else ("long_axis", "middle_axis", "short_axis")
    lies = [("angle", "rad")] if len(axes) == 2 else [(f"direction_{axis}", "1") for axis in axes]
    units = [*((name, "m") for name in lengths), ("deformation", "1"), *lies]
    return [Column(f"{name} {phase}", unit) for phase in spec.phases or phases for name, unit in units]


def _fragments(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    unit, size = _unit(axes, "m^3", "m^2"), _unit(axes, "volume", "area")
    sizes = [f"{size}_{number}" for number in range(1, spec.largest + 1)]
    units = [("count", "1"), *((name, unit) for name in (*sizes, "rest"))]
    return [Column(f"{name} {phase}", unit) for phase in spec.phases or phases for name, unit in units]


def _lens(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    return [*(Column(f"angle {phase}", "rad") for phase in phases), Column("width", "m")]


def _phase_velocity(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    names = (*(f"velocity_{axis}" for axis in axes), "max_speed")
    return [Column(f"{name} {phase}", "m/s") for phase in phases for name in names]


def _strays(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    return [Column(phase, "1") for phase in phases]


def _interface_length(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    return [Column("interface_length", _unit(axes, "m^2", "m"))]


def _interface_wave(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    return [Column("cosine", "m"), Column("sine", "m")]


def _wall_force(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    unit = _unit(axes, "N", "N/m")
    return [
        *(Column(f"force_{axis}", unit) for axis in axes),
        *(Column(f"force_{axis} {body}", unit) for body in wall_bodies(case) for axis in axes),
        *(column for body in case.bodies for column in _body_load(body, axes)),
    ]


def _body_load(body: str, axes: _Names) -> list[Column]:
    """Parts of the force on a body with a surface of its own, and its torque."""
    unit, turning = _unit(axes, "N", "N/m"), _unit(axes, "N m", "N")
    return [
        *(Column(f"{part}_{axis} {body}", unit) for part in ("pressure", "friction") for axis in axes),
        *(Column(f"torque_{axis} {body}", turning) for axis in (axes if len(axes) == 3 else ("z",))),
    ]


def _force_coefficients(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    whole = ("Cd", "Cl", "Cm") if len(axes) == 2 else ("Cd", "Cl", "Cs", "Cm", "Cm_roll", "Cm_yaw")
    parts = ("Cd_pressure", "Cd_friction", "Cl_pressure", "Cl_friction")
    return [Column(f"{name} {body}", "1") for body in chosen_bodies(case, spec) for name in (*whole, *parts)]


def _surface_stress(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    places = [Column(axis, "m") for axis in axes] + [Column(f"normal_{axis}", "1") for axis in axes]
    coefficients = [] if spec.speed is None else [Column("Cp", "1"), Column("Cf", "1")]
    arc = [Column("arc", "m"), Column("angle", "rad")] if len(axes) == 2 else []
    size = Column("length", "m") if len(axes) == 2 else Column("area", "m^2")
    stress = [Column("pressure", "Pa"), Column("shear", "Pa"), *(Column(f"friction_{axis}", "Pa") for axis in axes)]
    return [*arc, *places, size, *stress, *coefficients]


def _elevation(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    return [Column(f"surface_{number}", "m") for number in range(1, len(spec.places) + 1)]


def _samples(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    result = [Column(axis, "m") for axis in axes]
    for name in spec.fields:
        unit = _unit(axes, "m^3", "m^2") if name == "volume" else FIELD_UNITS[name]
        if name in VECTOR_FIELDS or (name == "vorticity" and len(axes) == 3):
            result += [Column(f"{name}_{axis}", unit) for axis in axes]
        else:
            result.append(Column(name, unit))
    return result


def open_side_names(case: Any) -> list[str]:
    """Names of the inlets and outlets of a case, such as x_lower, in the order of the sides."""
    return [
        f"{axis}_{end}"
        for axis, sides in zip(AXES, case.sides, strict=False)
        for end in ("lower", "upper")
        if getattr(sides, end).flow is not None
    ]


def _flow_rate(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    units = {"flow": _unit(axes, "kg/s", "kg/(m s)"), "through": _unit(axes, "kg", "kg/m"), "face_pressure": "Pa"}
    sides = open_side_names(case)
    return [Column(f"{name} {side}", unit) for side in sides for name, unit in units.items()]


def _reattachment(spec: Any, case: Any, phases: _Names, axes: _Names) -> list[Column]:
    return [Column("separation", "m"), Column("reattachment", "m")]


_COLUMNS: dict[str, Callable[[Any, Any, _Names, _Names], list[Column]]] = {
    "energy": _energy,
    "momentum": _momentum,
    "budget": _budget,
    "phase_pressure": _phase_pressure,
    "interface_length": _interface_length,
    "interface_wave": _interface_wave,
    "extents": _extents,
    "contour": _contour,
    "deformation": _deformation,
    "fragments": _fragments,
    "lens": _lens,
    "phase_velocity": _phase_velocity,
    "strays": _strays,
    "wall_force": _wall_force,
    "force_coefficients": _force_coefficients,
    "surface_stress": _surface_stress,
    "elevation": _elevation,
    "points": _samples,
    "line": _samples,
    "flow_rate": _flow_rate,
    "reattachment": _reattachment,
}
