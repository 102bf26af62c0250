"""The case: everything a run needs to know, validated and frozen.

A case is a tree of pydantic models whose attributes mirror the keys of the YAML file. `Case.from_dict` (and
`warpsph.case.case_file.load_case`, which reads YAML) is the only door; it gathers every problem of the input and
raises one CaseError with all of them. Checking happens in two layers:

1. the fields, here: type, range, spelling. Each field's description states its unit and meaning;
2. the checks between fields, in case_checks.py. They also run on whatever part of a faulty case could be
   read, so that one look shows all that is wrong.

Numbers may be written as arithmetic text ("2/52"). A key whose value is `auto` is chosen later.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    PrivateAttr,
    StrictStr,
    Tag,
    ValidationError,
    ValidationInfo,
    model_serializer,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError

from warpsph.case.expressions import Expression, compile_expression
from warpsph.case.values import (
    AlsoWritten,
    CaseModel,
    ChoiceRule,
    Formula,
    FormulaRule,
    FreezeMapping,
    FrozenDict,
    Name,
    NonNegativeNumber,
    Number,
    NumberRule,
    PositiveNumber,
    Times,
    Vector,
    WallKind,
    as_list,
    as_mapping,
    bad_value,
    example,
    field_list,
    kind_of,
    schema_of_fields,
    suggestion,
    time_window,
)
from warpsph.errors import MISSING, CaseError, Problem, short

__all__ = [
    "PARTICLE_FIELDS",
    "SAMPLED_FIELDS",
    "SUPPORT_RATIO",
    "VALIDATION_LEVELS",
    "AxisBoundary",
    "Boundary",
    "Box",
    "Case",
    "CheckpointOutput",
    "ContourGauge",
    "Curve",
    "Curves",
    "Domain",
    "EnergyGauge",
    "ExtentsGauge",
    "Fluid",
    "Gauge",
    "InterfaceLengthGauge",
    "InterfaceLine",
    "LineGauge",
    "MomentumGauge",
    "Numerics",
    "Obstacle",
    "Output",
    "ParticleOutput",
    "Phase",
    "PhasePressureGauge",
    "PhaseVelocityGauge",
    "PointsGauge",
    "Polygon",
    "Reference",
    "ReferenceCurve",
    "ReferenceCurves",
    "ReferenceExact",
    "ReferenceInterface",
    "ReferenceValue",
    "Scales",
    "Shape",
    "Side",
    "Sphere",
    "Start",
    "StraysGauge",
    "SurfaceTension",
    "Validation",
    "ValidationFigure",
    "ValidationRun",
    "WallForceGauge",
    "Where",
    "case_schema",
    "rename_files",
    "set_path",
]

AXES = ("x", "y", "z")

SUPPORT_RATIO = {
    "wendland_c2": 2.0, "wendland_c4": 2.0, "wendland_c6": 2.0, "cubic": 2.0, "quintic": 3.0, "gaussian": 3.0,
}  # fmt: skip
"""Support radius of each smoothing kernel divided by h."""

PARTICLE_FIELDS = (
    "velocity", "density", "pressure", "mass", "volume", "phase", "particle_spacing", "particle_id",
    "acceleration", "normal", "curvature",
)  # fmt: skip
"""Fields that particle output may hold (positions are always written)."""

SAMPLED_FIELDS = ("velocity", "density", "pressure", "volume", "phase", "acceleration", "normal", "curvature")
"""Fields that gauges can interpolate at points and along lines."""


# ----------------------------------------------------------------------------------------------------------
# domain


class Side(CaseModel):
    """One side of the domain along one axis.

    In a file: `open`, `wall`, `free_slip`, or `{wall: no_slip|free_slip, velocity: [...]}`; `periodic` for
    both sides.
    """

    opaque: ClassVar[bool] = True

    wall: WallKind | None = Field(
        description="no_slip or free_slip wall; nothing on an open or periodic side"
    )
    velocity: Vector = Field(
        default=(),
        description="velocity of the wall within its own plane, m/s (default zero)",
        examples=["[1, 0]"],
    )
    _periodic: bool = PrivateAttr(default=False)

    @model_validator(mode="wrap")
    @classmethod
    def _from_word(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(value, str):
            if value == "periodic":
                raise bad_value("a single side cannot be periodic", "write periodic for the whole axis")
            if value not in _SIDE_WORDS:
                raise bad_value(
                    f"needs one of {', '.join(_SIDE_WORDS)} or a mapping with the key wall",
                    suggestion(value, _SIDE_WORDS),
                )
            return cls._of(value)
        if not isinstance(value, Mapping | Side):
            raise bad_value(f"needs one of {', '.join(_SIDE_WORDS)} or a mapping with the key wall")
        return handler(value)

    @classmethod
    def _of(cls, word: str) -> Self:
        """The side that a single word stands for."""
        side = cls.model_construct(wall={"wall": "no_slip", "free_slip": "free_slip"}.get(word), velocity=())
        side._periodic = word == "periodic"
        return side

    @property
    def kind(self) -> Literal["open", "wall", "periodic"]:
        """What the side is."""
        if self.wall is not None:
            return "wall"
        return "periodic" if self._periodic else "open"

    @property
    def moves(self) -> bool:
        """Whether the wall has a velocity other than zero."""
        return any(self.velocity)

    def _plain(self) -> Any:
        """The shortest way to write this side in a file."""
        if self.kind != "wall":
            return self.kind
        if self.moves:
            return {"wall": self.wall, "velocity": list(self.velocity)}
        return "wall" if self.wall == "no_slip" else "free_slip"


_SIDE_WORDS = ("open", "wall", "free_slip")
_AXIS_WORDS = ("periodic", "wall", "open", "free_slip")


class AxisBoundary(CaseModel):
    """Both sides of the domain along one axis."""

    opaque: ClassVar[bool] = True

    lower: Side = Field(default_factory=lambda: Side._of("open"), description="side at the lower end")
    upper: Side = Field(default_factory=lambda: Side._of("open"), description="side at the upper end")

    @model_validator(mode="wrap")
    @classmethod
    def _from_short(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(value, str):
            if value not in _AXIS_WORDS:
                raise bad_value(
                    f"needs one of {', '.join(_AXIS_WORDS)} or a mapping with lower and upper",
                    suggestion(value, _AXIS_WORDS),
                )
            side = Side._of(value)
            return cls.model_construct(lower=side, upper=side)
        if isinstance(value, AxisBoundary):
            return handler(value)
        if not isinstance(value, Mapping):
            raise bad_value(f"needs one of {', '.join(_AXIS_WORDS)} or a mapping with lower and upper")
        if "wall" in value or "velocity" in value:
            # One wall written for the whole axis; problems of the two copies are merged by the report.
            return handler({"lower": value, "upper": value})
        return handler(value)

    @property
    def periodic(self) -> bool:
        """Whether the axis is periodic."""
        return self.lower.kind == "periodic"

    @model_serializer
    def _plain(self) -> Any:
        lower, upper = self.lower._plain(), self.upper._plain()
        return lower if lower == upper else {"lower": lower, "upper": upper}

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        wall = {
            "type": "object",
            "properties": {
                "wall": {"enum": ["no_slip", "free_slip"]},
                "velocity": {"type": "array", "description": "m/s", "items": NumberRule().schema()},
            },
            "required": ["wall"],
            "additionalProperties": False,
        }
        side = {"anyOf": [{"enum": list(_SIDE_WORDS)}, wall]}
        sides = {
            "type": "object",
            "properties": {"lower": side, "upper": side},
            "additionalProperties": False,
        }
        return {"anyOf": [{"enum": list(_AXIS_WORDS)}, wall, sides]}


class Boundary(CaseModel):
    """What happens at the sides, per axis: periodic | wall | open | free_slip, or lower and upper apart."""

    x: AxisBoundary = Field(
        default_factory=AxisBoundary, description="sides across the x axis", examples=["wall"]
    )
    y: AxisBoundary = Field(
        default_factory=AxisBoundary, description="sides across the y axis", examples=["wall"]
    )
    z: AxisBoundary = Field(
        default_factory=AxisBoundary, description="sides across the z axis (3-D only)", examples=["wall"]
    )


class Domain(CaseModel):
    """The box in which the particles live."""

    lower: Vector = Field(description="lower corner, m", examples=["[0, 0]"])
    upper: Vector = Field(description="upper corner, m", examples=["[1, 1]"])
    boundary: Boundary = Field(
        default_factory=Boundary,
        description="what happens at the sides (default: open)",
        examples=["{x: wall, y: wall}"],
    )


# ----------------------------------------------------------------------------------------------------------
# shapes


class Box(CaseModel):
    """Axis-parallel box."""

    lower: Vector = Field(description="lower corner, m", examples=["[0, 0]"])
    upper: Vector = Field(description="upper corner, m", examples=["[1, 1]"])


class Sphere(CaseModel):
    """Ball; a disc in 2-D."""

    center: Vector = Field(description="centre, m", examples=["[0, 0]"])
    radius: PositiveNumber = Field(description="radius, m", examples=["0.25"])


class Polygon(CaseModel):
    """Inside of a closed polygon (2-D)."""

    points: Annotated[tuple[Vector, ...], BeforeValidator(as_list)] = Field(
        description="corners in order, m; the last is joined to the first",
        examples=["[[0, 0], [1, 0], [0, 1]]"],
    )


class Where(CaseModel):
    """All points of the domain that fulfil a condition."""

    condition: Annotated[Expression, FormulaRule(condition=True)] = Field(
        description="formula in x, y, z (m) and r that is true inside",
        examples=['"y < 0.5 + 0.1*sin(2*pi*x)"'],
    )


SHAPES = ("box", "sphere", "polygon", "where")


class Shape(CaseModel):
    """A region: exactly one of box, sphere, polygon, where; or the word `rest`, all that remains."""

    opaque: ClassVar[bool] = True

    box: Box | None = Field(
        default=None, description="axis-parallel box", examples=["{lower: [0, 0], upper: [1, 1]}"]
    )
    sphere: Sphere | None = Field(
        default=None, description="ball, disc in 2-D", examples=["{center: [0, 0], radius: 1}"]
    )
    polygon: Polygon | None = Field(
        default=None, description="closed polygon (2-D)", examples=["{points: [[0, 0], [1, 0], [0, 1]]}"]
    )
    where: Where | None = Field(
        default=None, description="all points that fulfil a condition", examples=['{condition: "y < 0.5"}']
    )

    @model_validator(mode="wrap")
    @classmethod
    def _one_of(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(value, Shape):
            return handler(value)
        options = f"needs exactly one of {', '.join(SHAPES)} with its numbers, or the word rest"
        if isinstance(value, str):
            if value != "rest":
                remedy = (
                    f"write {{{value}: {{...}}}}" if value in SHAPES else suggestion(value, [*SHAPES, "rest"])
                )
                raise bad_value(options, remedy)
            return cls.model_construct(box=None, sphere=None, polygon=None, where=None, _fields_set=set())
        if not isinstance(value, Mapping):
            raise bad_value(options)
        known = [key for key in value if key in SHAPES]
        if "rest" in value:
            raise bad_value(options, "write shape: rest")
        if len(known) > 1 or (
            not known and not any(difflib.get_close_matches(str(k), SHAPES) for k in value)
        ):
            raise bad_value(options)
        for key in known:
            if value[key] is None:
                raise bad_value(
                    f"{key} has no value", f"write e.g. {{{key}: {example(cls.model_fields[key])}}}"
                )
        return handler(value)

    @property
    def kind(self) -> str:
        """box, sphere, polygon, where or rest."""
        return next((name for name in SHAPES if getattr(self, name) is not None), "rest")

    @model_serializer
    def _plain(self) -> Any:
        kind = self.kind
        return "rest" if kind == "rest" else {kind: getattr(self, kind).model_dump()}

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        inner = handler.resolve_ref_schema(handler(schema))
        parts = {}
        for name, part in inner.get("properties", {}).items():
            options = [option for option in part.get("anyOf", []) if option.get("type") != "null"]
            parts[name] = options[0] if options else part
        region = {
            "type": "object",
            "properties": parts,
            "additionalProperties": False,
            "minProperties": 1,
            "maxProperties": 1,
        }
        return {"anyOf": [{"const": "rest"}, region], "description": inner.get("description", "")}


class Fluid(CaseModel):
    """A region filled with one phase. Regions must not overlap."""

    phase: Name = Field(description="name of a phase", examples=["water"])
    shape: Shape = Field(description="the region", examples=["rest"])


class Obstacle(CaseModel):
    """A solid body made of wall particles."""

    shape: Shape = Field(description="the region", examples=["{box: {lower: [0, 0], upper: [1, 1]}}"])
    wall: WallKind = Field(default="no_slip", description="no_slip or free_slip", examples=["no_slip"])
    velocity: Vector = Field(
        default=(), description="velocity of the surface, m/s (default zero)", examples=["[0, 0]"]
    )
    name: Name | None = Field(default=None, description="name in messages and output", examples=["block"])


# ----------------------------------------------------------------------------------------------------------
# matter, start, scales, numerics


class Phase(CaseModel):
    """One fluid and its equation of state."""

    density: PositiveNumber = Field(description="reference density, kg/m^3", examples=["1000"])
    viscosity: NonNegativeNumber = Field(
        default=0.0, description="dynamic viscosity, Pa s (default 0: inviscid)", examples=["1e-3"]
    )
    sound_speed: Annotated[float | Literal["auto"], NumberRule(above=0, auto=True)] = Field(
        default="auto",
        description="artificial speed of sound, m/s; auto: from the scales of the flow",
        examples=["10"],
    )
    gamma: Annotated[float, NumberRule(least=1, most=20)] = Field(
        default=7.0, description="exponent of the equation of state (7 liquid, 1.4 gas)", examples=["7"]
    )
    background_pressure: NonNegativeNumber = Field(
        default=0.0, description="pressure at the reference density, Pa", examples=["0"]
    )


class SurfaceTension(CaseModel):
    """Surface tension between two phases."""

    between: Annotated[tuple[Name, ...], BeforeValidator(as_list)] = Field(
        description="the two phases", examples=["[gas, liquid]"]
    )
    coefficient: NonNegativeNumber = Field(description="surface tension, N/m", examples=["0.07"])
    contact_angle: Annotated[float | None, NumberRule(above=0, below=180, none=True)] = Field(
        default=None,
        description="contact angle: between a wall and the interface that meets it, inside the first-named phase, degrees "
        "(default none: walls take no part)",
        examples=["60"],
    )


class Start(CaseModel):
    """The state at time 0."""

    arrangement: Annotated[Literal["auto", "lattice", "fitted"], ChoiceRule()] = Field(
        default="auto",
        description="lattice: particles in the middle of square cells; fitted: in rows along the interfaces, half a "
        "spacing from them, evenly spaced elsewhere. auto: fitted where an interface between two phases runs through cells",
        examples=["lattice"],
    )
    noise: Annotated[float, NumberRule(least=0, most=0.3)] = Field(
        default=0.0,
        description="random displacement of fluid particles, fraction of particle_spacing; also from a fitted arrangement",
        examples=["0.2"],
    )
    seed: Annotated[int, NumberRule(least=0, most=2**31 - 1, integer=True)] = Field(
        default=1, description="seed of the random displacement", examples=["1"]
    )
    velocity: Annotated[tuple[Formula, ...], Field(min_length=1), BeforeValidator(as_list)] = Field(
        default=(),
        description="velocity, m/s: one number or formula in x, y, z (m) and r an axis (default zero)",
        examples=["[0, 0]"],
    )
    pressure: Annotated[
        Expression | Literal["hydrostatic"] | None,
        FormulaRule(words=(("none", None), ("hydrostatic", "hydrostatic"))),
    ] = Field(
        default=None,
        description="pressure added to the background, Pa: none, hydrostatic, or a formula in x, y, z, r",
        examples=["hydrostatic"],
    )


_AutoScale = Annotated[float | Literal["auto"], NumberRule(above=0, auto=True)]


class CentralForce(CaseModel):
    """An acceleration towards a point that grows with the distance, -rate^2 (x - center)."""

    rate: PositiveNumber = Field(description="B of the acceleration -B^2 (x - center), 1/s", examples=["100"])
    center: Vector = Field(default=(), description="the point, m (default the origin)", examples=["[0, 0]"])


class Scales(CaseModel):
    """What the flow will see; sound speeds are derived from it."""

    velocity: _AutoScale = Field(default="auto", description="largest speed, m/s", examples=["1"])
    length: _AutoScale = Field(default="auto", description="length of the flow, m", examples=["1"])
    pressure: _AutoScale = Field(
        default="auto", description="largest pressure difference, Pa", examples=["1000"]
    )


_Auto = Literal["auto"]


class Numerics(CaseModel):
    """How it is computed. `formulation` sets the defaults of the keys that are `auto`."""

    scheme: Annotated[Literal["riemann", "isph"], ChoiceRule()] = Field(
        default="riemann",
        description="riemann: weakly compressible Riemann SPH, any number of phases; isph: projection ISPH, one "
        "incompressible phase",
        examples=["isph"],
    )
    formulation: Annotated[Literal["improved", "paper"], ChoiceRule()] = Field(
        default="improved",
        description="the improved formulation or the one printed in the paper",
        examples=["improved"],
    )
    pressure_gradient: Annotated[Literal["auto", "corrected", "conservative"], ChoiceRule()] = Field(
        default="auto",
        description="corrected: minus form, exact for linear pressure; conservative: plus form, conserves "
        "momentum. auto: corrected in closed or periodic domains, else conservative (paper: conservative)",
        examples=["auto"],
    )
    star_states: Annotated[Literal["auto", "weighted", "arithmetic"], ChoiceRule()] = Field(
        default="auto",
        description="weights of the star states. auto: weighted (paper: arithmetic)",
        examples=["auto"],
    )
    viscosity_form: Annotated[Literal["auto", "morris", "radial", "paper"], ChoiceRule()] = Field(
        default="auto",
        description="viscous term. auto: morris, radial with surface tension or a free surface (paper: paper)",
        examples=["auto"],
    )
    tension_form: Annotated[Literal["auto", "pressure_jump", "body_force"], ChoiceRule()] = Field(
        default="auto",
        description="surface tension. auto: pressure_jump (paper: body_force)",
        examples=["auto"],
    )
    interface_force: Annotated[float | _Auto, NumberRule(least=0, most=1, auto=True)] = Field(
        default="auto",
        description="factor of the force that keeps phases apart. auto: 0 (paper: 0.08)",
        examples=["0.01"],
    )
    kernel: Annotated[
        Literal["wendland_c2", "wendland_c4", "wendland_c6", "cubic", "quintic", "gaussian"], ChoiceRule()
    ] = Field(default="wendland_c2", description="smoothing kernel", examples=["wendland_c2"])
    smoothing_ratio: Annotated[float | _Auto, NumberRule(least=0.8, most=4, auto=True)] = Field(
        default="auto", description="smoothing length h divided by particle_spacing", examples=["1.5"]
    )
    shifting: Annotated[float | _Auto, NumberRule(least=0, most=20, auto=True)] = Field(
        default="auto",
        description="coefficient of particle shifting. auto: 16 with corrected, 0 with conservative",
        examples=["16"],
    )
    unlock: Annotated[float | _Auto, NumberRule(least=0, most=0.3, auto=True)] = Field(
        default="auto",
        description="random displacement at the start that breaks the symmetry of a lattice, fraction of "
        "particle_spacing; start.noise counts if it is larger. auto: 0.05 with corrected on a lattice, else 0",
        examples=["0"],
    )
    volume_constraint: Annotated[bool | _Auto, BeforeValidator(lambda v: _as_switch(v))] = Field(
        default="auto",
        description="keep the total volume of closed or periodic domains. auto: true with corrected there",
        examples=["true"],
    )
    room_rate: Annotated[float | _Auto, NumberRule(least=0, most=10, auto=True)] = Field(
        default="auto",
        description="rate, over |grad v|, at which the density of a filled domain follows the room that the particles take; "
        "0 also leaves the divergence of the continuity equation uncorrected. auto: 2 with corrected and shifting, else 0",
        examples=["2"],
    )
    velocity_dissipation: Annotated[float | _Auto, NumberRule(least=0, most=10, auto=True)] = Field(
        default="auto",
        description="factor on the pressure-difference term of the star velocity",
        examples=["1"],
    )
    courant: Annotated[float | _Auto, NumberRule(above=0, most=2, auto=True)] = Field(
        default="auto", description="time step divided by h/(c + v)", examples=["0.5"]
    )
    skin: Annotated[float | _Auto, NumberRule(least=0.03, most=1, auto=True)] = Field(
        default="auto",
        description="skin of the neighbour list, fraction of the support radius",
        examples=["0.1"],
    )
    neighbour_capacity: Annotated[int | _Auto, NumberRule(least=4, most=100_000, integer=True, auto=True)] = (
        Field(default="auto", description="room for neighbours of one particle", examples=["64"])
    )
    maximum_step: Annotated[float | None, NumberRule(above=0, none=True)] = Field(
        default=None, description="upper limit of the time step, s; none: no limit", examples=["1e-3"]
    )
    time_order: Annotated[int | _Auto, NumberRule(least=1, most=2, integer=True, auto=True)] = Field(
        default="auto",
        description="isph: 1, the printed projection, or 2, BDF2. auto: 2 (paper: 1)",
        examples=["2"],
    )
    relaxed_divergence: Annotated[bool | _Auto, BeforeValidator(lambda v: _as_switch(v))] = Field(
        default="auto",
        description="isph: take out divergence that is left over within h/(2 u_max), not at once. auto: true (paper: false)",
        examples=["true"],
    )
    deferred_correction: Annotated[bool | _Auto, BeforeValidator(lambda v: _as_switch(v))] = Field(
        default="auto",
        description="isph: take what an uneven arrangement makes of the last pressure gradient out of the pressure "
        "equation. auto: true (paper: false)",
        examples=["true"],
    )
    surface_offset: Annotated[float | _Auto, NumberRule(least=0, most=1, auto=True)] = Field(
        default="auto",
        description="isph: distance from an even row of particles at a free surface to the place where p = 0, in "
        "particle_spacing. auto: 0.5 (paper: 0)",
        examples=["0.5"],
    )
    volume_feedback: Annotated[float | _Auto, NumberRule(least=0, most=1, auto=True)] = Field(
        default="auto",
        description="isph: share of an excess of the density that is let go within h/u_max. auto: 0.1 (paper: 0)",
        examples=["0.1"],
    )
    surface_filter: Annotated[float | _Auto, NumberRule(least=0, most=100, auto=True)] = Field(
        default="auto",
        description="isph: rate at which the velocity next to a free surface is drawn to the linear field around it, over "
        "the velocity gradient. auto: 1 (paper: 0)",
        examples=["1"],
    )
    implicit_viscosity: Annotated[bool | _Auto, BeforeValidator(lambda v: _as_switch(v))] = Field(
        default="auto",
        description="isph: friction by an implicit solve, stable at any time step. auto: true where the limit of explicit "
        "friction is less than half of the other limits of the step (paper: false)",
        examples=["true"],
    )
    solver: Annotated[Literal["auto", "cg", "bicgstab"], ChoiceRule()] = Field(
        default="auto", description="isph: solver of the pressure equation. auto: cg", examples=["cg"]
    )
    preconditioner: Annotated[Literal["auto", "multigrid", "jacobi", "none"], ChoiceRule()] = Field(
        default="auto", description="isph: preconditioner of the solver. auto: multigrid", examples=["multigrid"]
    )
    tolerance: Annotated[float, NumberRule(least=1e-14, most=0.1)] = Field(
        default=1e-6, description="isph: relative residual of the pressure equation", examples=["1e-6"]
    )
    maximum_iterations: Annotated[int, NumberRule(least=1, most=1_000_000, integer=True)] = Field(
        default=1000, description="isph: iterations after which a solve is given up", examples=["1000"]
    )


def _as_switch(value: Any) -> Any:
    if value is True or value is False or (isinstance(value, str) and value == "auto"):
        return value
    raise bad_value("needs true, false or auto")


# ----------------------------------------------------------------------------------------------------------
# output and gauges


class _Timed(CaseModel):
    """Something that happens every `interval` or at given `times`; exactly one of both."""

    interval: PositiveNumber | None = Field(
        default=None, description="time between outputs, s", examples=["0.1"]
    )
    times: Times | None = Field(
        default=None, description="times of the outputs, s, rising", examples=["[0.1, 0.2]"]
    )

    @model_validator(mode="wrap")
    @classmethod
    def _has_times(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(value, Mapping):
            for key in ("interval", "times"):
                if key in value and value[key] is None:
                    raise bad_value(
                        f"{key} has no value", f"write e.g. {key}: {example(cls.model_fields[key])}"
                    )
        result = handler(value)
        if (result.interval is None) == (result.times is None):
            # A misspelt key has been reported by the handler before this is reached.
            which = "both" if result.times is not None else "neither"
            raise bad_value(f"needs either interval or times, has {which}", "write e.g. interval: 0.1")
        return result


class ParticleOutput(_Timed):
    """Particle files."""

    fields: Annotated[tuple[str, ...], field_list(PARTICLE_FIELDS), schema_of_fields(PARTICLE_FIELDS)] = (
        Field(
            default=("velocity", "density", "pressure", "mass", "phase"),
            description="fields to write",
            examples=["[velocity, pressure]"],
        )
    )


class CheckpointOutput(CaseModel):
    """Files from which a run can be continued."""

    interval: PositiveNumber = Field(description="simulated time between checkpoints, s", examples=["1"])
    keep: Annotated[int, NumberRule(least=1, most=1_000_000, integer=True)] = Field(
        default=3, description="how many of the last ones are kept", examples=["3"]
    )


def _none_word(value: Any) -> Any:
    """`none` switches an output off."""
    return None if isinstance(value, str) and value == "none" else value


class Output(CaseModel):
    """What is written beside the gauges. Each part may be `none`."""

    particles: Annotated[ParticleOutput | None, AlsoWritten(_none_word, {"const": "none"})] = Field(
        default=None,
        description="particle files; none: not written (default: 20 times a run)",
        examples=["{interval: 0.1}"],
    )
    checkpoint: Annotated[CheckpointOutput | None, AlsoWritten(_none_word, {"const": "none"})] = Field(
        default=None,
        description="restart files; none: not written (default: 10 times a run)",
        examples=["{interval: 0.5}"],
    )


class _Gauge(_Timed):
    """A time series written to gauges/<name>.csv."""

    type: str = Field(description="what is measured", examples=["energy"])


class EnergyGauge(_Gauge):
    """Kinetic, potential, elastic and surface energy of the fluid."""

    type: Literal["energy"] = Field(description="energies of the fluid; surface energy where there is surface tension")


class MomentumGauge(_Gauge):
    """Momentum of the fluid."""

    type: Literal["momentum"] = Field(description="momentum of the fluid")


class PhasePressureGauge(_Gauge):
    """Mean pressure of each phase."""

    type: Literal["phase_pressure"] = Field(description="mean pressure of each phase")


class InterfaceLengthGauge(_Gauge):
    """Length (3-D: area) of the interface between phases."""

    type: Literal["interface_length"] = Field(description="length of the interface")


class ExtentsGauge(_Gauge):
    """Extents and centre of each phase."""

    type: Literal["extents"] = Field(description="extents of each phase")


class ContourGauge(_Gauge):
    """The line around each phase (2-D)."""

    type: Literal["contour"] = Field(description="the line around each phase (2-D)")
    mirror: Annotated[Literal["x", "y"] | None, ChoiceRule(none=True)] = Field(
        default=None,
        description="axis across which the scene is symmetric about the middle of the domain: adds asymmetry",
        examples=["x"],
    )


class PhaseVelocityGauge(_Gauge):
    """Mean velocity of each phase."""

    type: Literal["phase_velocity"] = Field(description="mean velocity of each phase")


class StraysGauge(_Gauge):
    """Particles that have left their phase."""

    type: Literal["strays"] = Field(description="particles without company of their own phase")


class WallForceGauge(_Gauge):
    """Force of the fluid on the walls."""

    type: Literal["wall_force"] = Field(description="force on the walls")


_SampledFields = Annotated[
    tuple[str, ...], Field(min_length=1), field_list(SAMPLED_FIELDS), schema_of_fields(SAMPLED_FIELDS)
]


class PointsGauge(_Gauge):
    """Fields at fixed points."""

    type: Literal["points"] = Field(description="fields at points")
    points: Annotated[tuple[Vector, ...], Field(min_length=1), BeforeValidator(as_list)] = Field(
        description="the points, m", examples=["[[0, 0]]"]
    )
    fields: _SampledFields = Field(description="fields to interpolate", examples=["[pressure]"])
    area: Annotated[float | None, NumberRule(above=0, none=True)] = Field(
        default=None,
        description="face of a sensor around each point, in the plane of the wall: a disc, m^2; in 2-D its length along the "
        "wall, m. Each field is the mean over it, by linear fits; what is dry has no pressure (default: values at points)",
        examples=["4.2e-3"],
    )
    normal: Vector | None = Field(
        default=None,
        description="direction at right angles to the faces, of any length (default: that of the nearest wall)",
        examples=["[1, 0]"],
    )


class LineGauge(_Gauge):
    """Fields at evenly spaced points of a line."""

    type: Literal["line"] = Field(description="fields along a line")
    from_: Vector = Field(alias="from", description="first point, m", examples=["[0, 0]"])
    to: Vector = Field(description="last point, m", examples=["[0, 1]"])
    count: Annotated[int, NumberRule(least=2, most=1_000_000, integer=True)] = Field(
        description="number of points, both ends included", examples=["51"]
    )
    fields: _SampledFields = Field(description="fields to interpolate", examples=["[velocity]"])


GAUGES: dict[str, type[_Gauge]] = {
    "energy": EnergyGauge,
    "momentum": MomentumGauge,
    "phase_pressure": PhasePressureGauge,
    "interface_length": InterfaceLengthGauge,
    "extents": ExtentsGauge,
    "contour": ContourGauge,
    "phase_velocity": PhaseVelocityGauge,
    "strays": StraysGauge,
    "wall_force": WallForceGauge,
    "points": PointsGauge,
    "line": LineGauge,
}


def _gauge_type(value: Any) -> str:
    """Tag of the gauge model, in < > so that the report can tell it from a key."""
    return f"<{value['type'] if isinstance(value, Mapping) else value.type}>"


def _check_gauge_type(value: Any) -> Any:
    if isinstance(value, _Gauge):
        return value
    if not isinstance(value, Mapping):
        raise bad_value("needs a mapping with type and interval", "write e.g. {type: energy, interval: 0.1}")
    kind = value.get("type", MISSING)
    if kind is MISSING:
        close = difflib.get_close_matches("type", [key for key in value if isinstance(key, str)], 1)
        remedy = f"did you mean type where {short(close[0])} is?" if close else "add type: " + " | ".join(GAUGES)
        raise bad_value("needs the key type", remedy)
    if not isinstance(kind, str) or kind not in GAUGES:
        raise bad_value(
            f"has an unknown type {short(kind) if isinstance(kind, str) else kind_of(kind)}",
            suggestion(kind, GAUGES),
        )
    return value


Gauge = Annotated[
    Annotated[EnergyGauge, Tag("<energy>")]
    | Annotated[MomentumGauge, Tag("<momentum>")]
    | Annotated[PhasePressureGauge, Tag("<phase_pressure>")]
    | Annotated[InterfaceLengthGauge, Tag("<interface_length>")]
    | Annotated[ExtentsGauge, Tag("<extents>")]
    | Annotated[ContourGauge, Tag("<contour>")]
    | Annotated[PhaseVelocityGauge, Tag("<phase_velocity>")]
    | Annotated[StraysGauge, Tag("<strays>")]
    | Annotated[WallForceGauge, Tag("<wall_force>")]
    | Annotated[PointsGauge, Tag("<points>")]
    | Annotated[LineGauge, Tag("<line>")],
    Discriminator(_gauge_type),
    BeforeValidator(_check_gauge_type),
]


# ----------------------------------------------------------------------------------------------------------
# comparison with references


class _Reference(CaseModel):
    allowed: PositiveNumber | None = Field(
        default=None, description="largest acceptable relative error", examples=["0.03"]
    )
    source: StrictStr | None = Field(
        default=None, description="where the reference comes from", examples=["Yang 2019"]
    )


_Norm = Annotated[Literal["max", "rms", "final"], ChoiceRule()]
_RelativeTo = Annotated[Literal["peak", "pointwise", "initial", "absolute"], ChoiceRule()]
_Window = Annotated[tuple[NonNegativeNumber, ...], BeforeValidator(as_list), AfterValidator(time_window)]


def _interval(ends: tuple[float, ...]) -> tuple[float, ...]:
    if len(ends) != 2 or ends[0] >= ends[1]:
        raise bad_value("needs two distances, the smaller one first", "write e.g. between: [0.1, 0.4]")
    return ends


class ReferenceValue(_Reference):
    """One number derived from a gauge's column, against a reference number."""

    gauge: Name = Field(description="name of a gauge", examples=["energy"])
    column: StrictStr = Field(
        description="column of the gauge, or arithmetic of columns", examples=["kinetic"]
    )
    reduce: Annotated[
        Literal[
            "mean", "max", "min", "final", "rms", "farthest", "change", "period",
            "peak", "peak_time", "trough", "trough_time", "noise", "slope",
        ],
        ChoiceRule(),
    ] = Field(
        default="mean",
        description="how the column becomes one number. farthest: the value farthest from the reference; change: the "
        "largest relative change since the first row; peak, trough and their times: of the cubic through the rows of the "
        "window; noise: root mean square of the deviations from a parabola through the rows within half a span of each; "
        "slope: of a line gauge, at its last time",
        examples=["mean"],
    )  # fmt: skip
    window: _Window | None = Field(
        default=None,
        description="first and last time that count, s (default: the whole run)",
        examples=["[1, 2]"],
    )
    between: Annotated[tuple[NonNegativeNumber, ...], BeforeValidator(as_list), AfterValidator(_interval)] | None = Field(
        default=None,
        description="slope: part of the line that counts, distances from its `from`, m (default: all of it)",
        examples=["[0.1, 0.4]"],
    )
    span: PositiveNumber | None = Field(
        default=None,
        description="noise: the time over which the column is all but a parabola, s; what rings faster is noise",
        examples=["2"],
    )
    value: Number = Field(description="the reference, in the unit of the column", examples=["1.72"])
    moved_from: Number | None = Field(
        default=None,
        description="where a place that moves started, in the unit of the column: the error is divided by the way from "
        "there to the reference, not by a coordinate",
        examples=["0.5"],
    )


class Curve(CaseModel):
    """A reference curve over time in a CSV file."""

    file: StrictStr = Field(description="CSV file, relative to the case file", examples=["reference/x.csv"])
    time: StrictStr = Field(description="name of its time column", examples=["t_s"])
    value: StrictStr = Field(description="name of its value column", examples=["kinetic"])
    scale: Number = Field(default=1.0, description="factor on the value column", examples=["1"])
    time_scale: PositiveNumber = Field(
        default=1.0, description="factor that turns its time into s", examples=["1"]
    )


class ReferenceCurve(_Reference):
    """A gauge's column against a curve over time."""

    gauge: Name = Field(description="name of a gauge", examples=["energy"])
    column: StrictStr = Field(
        description="column of the gauge, or arithmetic of columns", examples=["kinetic"]
    )
    curve: Curve = Field(description="the reference curve", examples=["{file: x.csv, time: t_s, value: KE}"])
    window: _Window | None = Field(
        default=None,
        description="first and last time that count, s (default: what both the run and the curve cover)",
        examples=["[1, 2]"],
    )
    norm: _Norm = Field(default="max", description="how the deviations become one number", examples=["max"])
    reduce: Annotated[
        Literal[
            "mean", "max", "min", "final", "rms", "period", "peak", "peak_time", "trough", "trough_time", "noise"
        ],
        ChoiceRule(),
    ] | None = Field(
        default=None,
        description="instead of norm: column and curve each become one number in this way, over the same times, and these "
        "are compared (peak, trough and their times: of the cubic through the rows of the window; noise: as of a value)",
        examples=["mean"],
    )  # fmt: skip
    span: PositiveNumber | None = Field(
        default=None,
        description="noise: the time over which column and curve are all but parabolas, s; what rings faster is noise",
        examples=["2"],
    )
    relative_to: _RelativeTo = Field(
        default="peak",
        description="what the error is divided by; absolute: by nothing, in the unit of the column. With reduce: by the "
        "number of the curve, or absolute",
        examples=["peak"],
    )
    moved_from: Number | None = Field(
        default=None,
        description="where a place that moves started, in the unit of the column: the error is divided by the way from "
        "there to the reference (the farthest that the curve gets), not by a coordinate",
        examples=["0.5"],
    )


def _as_columns(value: Any) -> Any:
    """Mapping time -> column name with the times as numbers."""
    value = as_mapping(value)
    rule = NumberRule(least=0)
    result: dict[float, str] = {}
    for key, column in value.items():
        try:
            time = float(rule.validate(key))  # type: ignore[arg-type]
        except PydanticCustomError:
            raise bad_value("needs times (s, >= 0) as keys", "write e.g. {0.1: name_of_a_column}") from None
        if not isinstance(column, str) or not column:
            raise bad_value("needs names of columns as values", "write e.g. {0.1: name_of_a_column}")
        if time in result:
            raise bad_value(f"names the time {time:g} twice", "delete one")
        result[time] = column
    if not result:
        raise bad_value("is empty", "write e.g. {0.1: name_of_a_column}")
    return result


class Curves(CaseModel):
    """Reference profiles in a CSV file, one column a time."""

    file: StrictStr = Field(description="CSV file, relative to the case file", examples=["reference/x.csv"])
    position: StrictStr = Field(
        description="name of its position column (distance from the line's `from`, m)", examples=["y_m"]
    )
    columns: Annotated[Mapping[float, str], FreezeMapping(), BeforeValidator(_as_columns)] = Field(
        description="time in s -> name of the column", examples=['{0.1: "u_t=0.1"}']
    )
    scale: Number = Field(default=1.0, description="factor on the value columns", examples=["1"])


class ReferenceCurves(_Reference):
    """A line gauge's field against profiles at given times."""

    gauge: Name = Field(description="name of a line gauge", examples=["profile"])
    column: StrictStr = Field(
        description="field of the gauge, with _x, _y, _z for a vector", examples=["velocity_x"]
    )
    curves: Curves = Field(
        description="the reference profiles",
        examples=['{file: x.csv, position: y_m, columns: {0.1: "u_0.1"}}'],
    )
    norm: _Norm = Field(default="max", description="how the deviations become one number", examples=["max"])
    relative_to: _RelativeTo = Field(
        default="peak",
        description="what the error is divided by; absolute: by nothing, in the unit of the column",
        examples=["peak"],
    )


_ExactFormula = Annotated[Expression, FormulaRule(names=("x", "y", "z", "t", "r"))]


def _one_or_many(value: Any) -> Any:
    return as_list(value) if isinstance(value, list | tuple) else [value]


class ReferenceExact(_Reference):
    """A field of the particles against a formula."""

    particles: Annotated[Literal["last"], ChoiceRule()] = Field(
        description="which particle file", examples=["last"]
    )
    field: Annotated[Literal["speed", "velocity", "density", "pressure"], ChoiceRule()] = Field(
        description="the field that is compared", examples=["speed"]
    )
    exact: Annotated[tuple[_ExactFormula, ...], Field(min_length=1), AlsoWritten(_one_or_many)] = Field(
        description="formula in x, y, z (m), t (s) and r; a list of them for velocity",
        examples=['"exp(-t)*sin(x)"'],
    )
    norm: Annotated[Literal["l1", "l2", "max"], ChoiceRule()] = Field(
        default="l1", description="norm of the error", examples=["l1"]
    )


class InterfaceLine(CaseModel):
    """A reference interface (2-D) in a CSV file, each row a segment x1, y1, x2, y2."""

    file: StrictStr = Field(description="CSV file, relative to the case file", examples=["reference/x.csv"])
    time: NonNegativeNumber = Field(description="its time, s; there has to be a particle file of it", examples=["1.0"])
    scale: PositiveNumber = Field(default=1.0, description="length of the file's unit, m", examples=["0.1"])
    offset: Vector = Field(
        default=(), description="where the file's origin is in the scene, m (default zero)", examples=["[0, 0]"]
    )
    mirror: Annotated[float | None, NumberRule(none=True)] = Field(
        default=None,
        description="x of an axis of symmetry, m: the file holds one half",
        examples=["0"],
    )


class ReferenceInterface(_Reference):
    """The particles of a phase against an interface: those on the wrong side of it."""

    phase: Name = Field(
        description="phase on that side from which a ray upwards (+y) crosses the interface an odd number of times: the "
        "inside of a closed line, the lower side of one from wall to wall",
        examples=["gas"],
    )
    interface: InterfaceLine = Field(
        description="the reference interface", examples=["{file: reference/x.csv, time: 1.0}"]
    )
    relative_to: Annotated[Literal["domain", "phase"], ChoiceRule()] = Field(
        default="domain",
        description="what the area on the wrong side is divided by: that of all fluid, or that of the phase",
        examples=["domain"],
    )


REFERENCES = ("value", "curve", "curves", "exact", "interface")


def _reference_kind(value: Any) -> str:
    keys = value.keys() if isinstance(value, Mapping) else type(value).model_fields.keys()
    return next(f"<{kind}>" for kind in REFERENCES if kind in keys)


def _check_reference_kind(value: Any) -> Any:
    if isinstance(value, _Reference):
        return value
    options = f"needs exactly one of {', '.join(REFERENCES)}"
    if not isinstance(value, Mapping):
        raise bad_value("needs a mapping", "write e.g. {gauge: energy, column: kinetic, value: 1}")
    found = [kind for kind in REFERENCES if kind in value]
    if len(found) != 1:
        remedy = f"delete all but one of {', '.join(found)}" if found else ""
        for key in value if not found else ():
            close = difflib.get_close_matches(str(key), list(REFERENCES), 1)
            remedy = f"did you mean {close[0]} where {short(key)} is?" if close else remedy
        raise bad_value(options, remedy or "write e.g. value: 1.72")
    return value


Reference = Annotated[
    Annotated[ReferenceValue, Tag("<value>")]
    | Annotated[ReferenceCurve, Tag("<curve>")]
    | Annotated[ReferenceCurves, Tag("<curves>")]
    | Annotated[ReferenceExact, Tag("<exact>")]
    | Annotated[ReferenceInterface, Tag("<interface>")],
    Discriminator(_reference_kind),
    BeforeValidator(_check_reference_kind),
]


# ----------------------------------------------------------------------------------------------------------
# validation


VALIDATION_LEVELS = ("quick", "seed", "fine", "ci")
"""How much work a validation is: minutes on a CPU, the resolution of the published study, finer on a GPU; ci is so coarse
or short that every case is run for each change of the program, and its errors are held to recorded ones."""

_RUN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+=/ -]{0,39}")


def _as_run_name(value: Any) -> str:
    """Names of runs stand in tables and, with _ for what a file name cannot hold, name folders."""
    if not isinstance(value, str):
        raise bad_value("needs text", f'write name: "{value}"' if isinstance(value, int | float) else "")
    if not _RUN_NAME.fullmatch(value):
        raise bad_value("needs 1 to 40 letters, digits, blanks and _ . + = / -, a letter or digit first")
    return value


def _as_changes(value: Any) -> Any:
    """Changes with dotted text as keys and, as elsewhere in a case, `none` for nothing."""
    changes = {}
    for key, item in as_mapping(value).items():
        if not isinstance(key, str) or not all(key.split(".")):
            raise bad_value("needs dotted paths as keys", "write e.g. {phases.water.density: 900}")
        section = key.split(".")[0]
        if section == "validation" or section not in Case.model_fields:
            known = [name for name in Case.model_fields if name != "validation"]
            raise bad_value(f"{short(key)} does not begin with a section of the case", suggestion(section, known))
        changes[key] = "none" if item is None else item
    return changes


class ValidationRun(CaseModel):
    """One run of a case with some of its values changed."""

    name: Annotated[StrictStr, BeforeValidator(_as_run_name)] = Field(
        description="name of the run in tables and folders", examples=['"100"']
    )
    changes: Annotated[Mapping[str, Any], FreezeMapping(), BeforeValidator(_as_changes)] = Field(
        default_factory=FrozenDict,
        description="dotted path -> value, as with --set; none takes an entry of reference or gauges out",
        examples=["{particle_spacing: 2/100, reference.pressure_jump.allowed: 0.01}"],
    )


def _different_runs(runs: tuple[ValidationRun, ...]) -> tuple[ValidationRun, ...]:
    """Two runs of a level must not share a folder."""
    folders = [re.sub(r"[^a-z0-9.+=-]", "_", run.name.lower()) for run in runs]
    for position, folder in enumerate(folders):
        if folder in folders[:position]:
            raise bad_value(f"has two runs with the name {runs[position].name}", "give each its own name")
    return runs


_Runs = Annotated[tuple[ValidationRun, ...], BeforeValidator(as_list), AfterValidator(_different_runs)]
_THE_FILE = ValidationRun(name="default")


class ValidationFigure(CaseModel):
    """What the figure of each validation run shows of the particles, under the interfaces of `reference`."""

    field: Annotated[Literal["phase", "speed", "pressure", "vorticity"], ChoiceRule()] = Field(
        description="what colours the particles", examples=["phase"]
    )
    times: Times | None = Field(
        default=None,
        description="times of the pictures, s, rising (default: four from start to end)",
        examples=["[0, 1, 2]"],
    )
    phases: Annotated[tuple[Name, ...], Field(min_length=1), BeforeValidator(as_list)] | None = Field(
        default=None,
        description="phases that are drawn; the others are left white, and out of the colour scale (default: all)",
        examples=["[water]"],
    )


class Validation(CaseModel):
    """What `python -m warpsph validate` runs at each level. No part of a run itself."""

    quick: _Runs = Field(
        default=(_THE_FILE,),
        description="runs that take minutes on a CPU (default: the file as it is)",
        examples=['[{name: "52", changes: {}}]'],
    )
    seed: _Runs = Field(
        default=(),
        description="runs at the resolution of the published study",
        examples=['[{name: "100", changes: {particle_spacing: 2/100}}]'],
    )
    fine: _Runs = Field(
        default=(),
        description="finer runs, for a GPU",
        examples=['[{name: "200", changes: {particle_spacing: 2/200}}]'],
    )
    ci: _Runs = Field(
        default=(),
        description="runs of seconds, whose errors are held to recorded ones",
        examples=['[{name: "26", changes: {particle_spacing: 2/26}}]'],
    )
    figure: ValidationFigure | None = Field(
        default=None, description="pictures of the particles", examples=["{field: phase, times: [0, 1]}"]
    )


# ----------------------------------------------------------------------------------------------------------
# the case


class Case(CaseModel):
    """A complete, validated, immutable description of a run. SI units throughout."""

    title: StrictStr = Field(default="", description="one line for people", examples=['"my case"'])
    description: StrictStr = Field(
        default="", description="longer text for people", examples=['"what to look at"']
    )
    dimension: Annotated[Literal[2, 3], ChoiceRule()] = Field(
        description="number of space dimensions", examples=["2"]
    )
    particle_spacing: PositiveNumber = Field(
        description="distance of particles at the start, m", examples=["0.01"]
    )
    end_time: PositiveNumber = Field(description="simulated time at which the run ends, s", examples=["1.0"])
    precision: Annotated[Literal["float32", "float64"], ChoiceRule()] = Field(
        default="float32", description="floating point numbers of the computation", examples=["float32"]
    )
    domain: Domain = Field(
        description="the box in which the particles live", examples=["{lower: [0, 0], upper: [1, 1]}"]
    )
    gravity: Vector = Field(default=(), description="gravity, m/s^2 (default zero)", examples=["[0, -9.81]"])
    body_force: Vector = Field(
        default=(),
        description="acceleration of the fluid that is not counted as hydrostatic, m/s^2 (default zero)",
        examples=["[1e-4, 0]"],
    )
    central_force: CentralForce | None = Field(
        default=None, description="acceleration towards a point", examples=["{rate: 100}"]
    )
    phases: Annotated[Mapping[Name, Phase], Field(min_length=1), FreezeMapping()] = Field(
        description="the fluids by name, in the order of their index", examples=["{water: {density: 1000}}"]
    )
    surface_tension: Annotated[tuple[SurfaceTension, ...], BeforeValidator(as_list)] = Field(
        default=(),
        description="surface tension of pairs of phases",
        examples=["[{between: [gas, liquid], coefficient: 1}]"],
    )
    fluids: Annotated[tuple[Fluid, ...], Field(min_length=1), BeforeValidator(as_list)] = Field(
        description="which phase is where", examples=["[{phase: water, shape: rest}]"]
    )
    obstacles: Annotated[tuple[Obstacle, ...], BeforeValidator(as_list)] = Field(
        default=(), description="solid bodies", examples=["[{shape: {sphere: {center: [0, 0], radius: 1}}}]"]
    )
    start: Start = Field(default_factory=Start, description="state at time 0", examples=["{noise: 0.2}"])
    scales: Scales = Field(
        default_factory=Scales, description="what the flow will see", examples=["{velocity: 1}"]
    )
    numerics: Numerics = Field(
        default_factory=Numerics, description="how it is computed", examples=["{skin: 0.1}"]
    )
    output: Output = Field(
        default_factory=Output, description="files", examples=["{particles: {interval: 0.1}}"]
    )
    gauges: Annotated[Mapping[Name, Gauge], FreezeMapping()] = Field(
        default_factory=FrozenDict,
        description="time series by name",
        examples=["{energy: {type: energy, interval: 0.1}}"],
    )
    reference: Annotated[Mapping[Name, Reference], FreezeMapping()] = Field(
        default_factory=FrozenDict,
        description="comparisons with references by name",
        examples=["{decay: {gauge: energy, column: kinetic, reduce: final, value: 1}}"],
    )
    validation: Validation = Field(
        default_factory=Validation,
        description="runs of the command validate",
        examples=['{seed: [{name: "100", changes: {particle_spacing: 2/100}}]}'],
    )

    _source_folder: Path | None = PrivateAttr(None)

    @model_validator(mode="wrap")
    @classmethod
    def _all_problems_at_once(
        cls, value: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo
    ) -> Self:
        if isinstance(value, Case):
            return handler(value)
        from warpsph.case.checks import cross_check, draft, in_order, report

        context = info.context if isinstance(info.context, Mapping) else {}
        folder = context.get("source_folder")
        if not isinstance(value, Mapping):
            raise CaseError([Problem("(case)", value, "needs a mapping of keys", "write e.g. dimension: 2")])
        try:
            case = handler(value)
        except ValidationError as error:
            problems = report(error, value)
            problems += cross_check(draft(cls, value), folder, value)
            raise CaseError(in_order(problems)) from None
        case._source_folder = folder
        case._fill_defaults()
        found = cross_check(case, folder, value)
        if found:
            raise CaseError(in_order(found))
        return case

    def _fill_defaults(self) -> None:
        """Fill in the defaults that depend on dimension and end time; they stay `not set by the user`."""
        zero = (0.0,) * self.dimension

        def fill(model: BaseModel, name: str, default: Any) -> None:
            if name not in model.model_fields_set:
                object.__setattr__(model, name, default)
                model.model_fields_set.discard(name)

        fill(self, "gravity", zero)
        fill(self, "body_force", zero)
        if self.central_force is not None:
            fill(self.central_force, "center", zero)
        fill(self.start, "velocity", (compile_expression("0.0"),) * self.dimension)
        for obstacle in self.obstacles:
            fill(obstacle, "velocity", zero)
        for reference in self.reference.values():
            if isinstance(reference, ReferenceInterface):
                fill(reference.interface, "offset", zero)
        for axis in AXES:
            for side in (
                getattr(self.domain.boundary, axis).lower,
                getattr(self.domain.boundary, axis).upper,
            ):
                if not side.velocity:
                    object.__setattr__(side, "velocity", zero)
        fill(self.output, "particles", ParticleOutput(interval=self.end_time / 20))
        fill(self.output, "checkpoint", CheckpointOutput(interval=self.end_time / 10))

    # -- making cases ------------------------------------------------------------

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source_folder: Path | str | None = None) -> Case:
        """The case that the plain mapping `data` describes (keys as in a case file).

        source_folder: where relative reference files are looked up; None skips the look-up.
        Raises CaseError with all problems.
        """
        folder = Path(source_folder) if source_folder is not None else None
        return cls.model_validate(data, context={"source_folder": folder})

    @staticmethod
    def load(path: Path | str, overrides: Sequence[str] = ()) -> Case:
        """The case in a YAML file, see `warpsph.case.case_file.load_case`."""
        from warpsph.case.case_file import load_case

        return load_case(path, overrides)

    def replace(self, changes: Mapping[str, Any]) -> Case:
        """A copy with other values, e.g. `case.replace({"numerics.courant": 0.3, "phases.gas.density": 2})`.

        Keys are dotted paths, list positions are numbers (`fluids.0.phase`); None takes an entry of `reference`
        or `gauges` out (`{"reference.jump": None}`). The copy is validated like any case. Raises CaseError.
        """
        data = self.to_dict()
        problems = []
        for path, value in changes.items():
            try:
                set_path(data, path, value)
            except CaseError as error:
                problems += error.problems
        if problems:
            raise CaseError(problems)
        return type(self).from_dict(data, self.source_folder)

    def to_dict(self, defaults: bool = False) -> dict[str, Any]:
        """Plain dicts, lists, numbers and text as in a case file; `defaults` adds what the user left out.

        `Case.from_dict(case.to_dict(), case.source_folder) == case` holds.
        """
        plain = self.model_dump(mode="python", by_alias=True, exclude_unset=not defaults)
        if self.dimension == 2 and defaults:
            del plain["domain"]["boundary"]["z"]
        result: dict[str, Any] = _plain_case(plain)
        return result

    def resolved(self, known: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """`to_dict(defaults=True)` with every `auto` replaced that follows from the case itself.

        known: dotted path -> value for those that need more than the case (sound speeds, smoothing ratio
        ...); they win. Reference files get absolute paths, so that the result can be stored in another
        folder.
        """
        data = self.to_dict(defaults=True)
        data.pop("validation", None)  # says nothing about this run
        self.make_files_absolute(data)
        chosen = {f"numerics.{key}": value for key, value in _automatic_choices(self).items()}
        for path, value in {**chosen, **(known or {})}.items():
            set_path(data, path, value)
        return data

    def make_files_absolute(self, data: dict[str, Any]) -> None:
        """Turn the names of reference files in a plain case into absolute paths, in place."""
        if self.source_folder is not None:
            rename_files(data, {name: str(path.resolve()) for name, path in self.reference_files.items()})

    @property
    def reference_files(self) -> dict[str, Path]:
        """Path of each reference file by the name that the case has for it."""
        return {holder["file"]: self.reference_file(holder["file"]) for holder in _file_holders(self.to_dict())}

    # -- short cuts ------------------------------------------------------------

    @property
    def source_folder(self) -> Path | None:
        """Folder of the case file; relative reference files are looked up there. None if there is no file."""
        return self._source_folder

    @property
    def spacing(self) -> float:
        """particle_spacing, m."""
        return self.particle_spacing

    @property
    def phase_names(self) -> list[str]:
        """Names of the phases in the order of their index."""
        return list(self.phases)

    @property
    def sides(self) -> tuple[AxisBoundary, ...]:
        """The sides of the domain, one entry an axis of this dimension."""
        return tuple(getattr(self.domain.boundary, axis) for axis in AXES[: self.dimension])

    @property
    def periodic(self) -> tuple[bool, ...]:
        """Whether each axis is periodic."""
        return tuple(axis.periodic for axis in self.sides)

    @property
    def has_walls(self) -> bool:
        """Whether there are wall particles: a wall at a side, or an obstacle."""
        return bool(self.obstacles) or any(
            "wall" in (axis.lower.kind, axis.upper.kind) for axis in self.sides
        )

    @property
    def has_open_sides(self) -> bool:
        """Whether any side of the domain is open."""
        return any("open" in (axis.lower.kind, axis.upper.kind) for axis in self.sides)

    @property
    def has_surface_tension(self) -> bool:
        """Whether any pair of phases has a surface tension above zero."""
        return any(pair.coefficient > 0 for pair in self.surface_tension)

    def reference_file(self, name: str) -> Path:
        """Path of a reference file: an absolute name as it is, others within `source_folder`."""
        return (self.source_folder or Path()) / name


def _file_holders(data: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The mappings of a plain case that name a reference file under the key `file`."""
    parts = ("curve", "curves", "interface")
    return [entry[part] for entry in data.get("reference", {}).values() for part in parts if part in entry]


def rename_files(data: Mapping[str, Any], names: Mapping[str, str]) -> None:
    """Replace the names of reference files in a plain case, in place; names that are no key of `names` stay."""
    for holder in _file_holders(data):
        holder["file"] = names.get(holder["file"], holder["file"])


def _automatic_choices(case: Case) -> dict[str, Any]:
    """What `auto` means for the keys of numerics that follow from the case alone."""
    numerics = case.numerics
    paper = numerics.formulation == "paper"
    gradient = numerics.pressure_gradient
    if gradient == "auto":
        gradient = "conservative" if paper or case.has_open_sides else "corrected"
    viscosity = "paper" if paper else "radial" if case.has_surface_tension or case.has_open_sides else "morris"
    choices = {
        "pressure_gradient": gradient,
        "star_states": "arithmetic" if paper else "weighted",
        "viscosity_form": viscosity,
        "tension_form": "body_force" if paper else "pressure_jump",
        "interface_force": 0.08 if paper else 0.0,
        "unlock": 0.05 if gradient == "corrected" else 0.0,
        "shifting": 16.0 if gradient == "corrected" else 0.0,
        "volume_constraint": gradient == "corrected" and not case.has_open_sides,
        "room_rate": 2.0 if gradient == "corrected" and not case.has_open_sides and numerics.shifting != 0 else 0.0,
    }
    if numerics.scheme == "isph":
        choices = {}  # all follow from the physics
    return {key: value for key, value in choices.items() if getattr(numerics, key) == "auto"}


def _plain_case(value: Any) -> Any:
    """Dumped models as a case file writes them: lists for tuples, `none` where a key is switched off."""
    if isinstance(value, Mapping):
        return {
            key: "none" if item is None else _plain_case(item)
            for key, item in value.items()
            if item is not None or key in _NONE_KEYS
        }
    if isinstance(value, list | tuple):
        return [_plain_case(item) for item in value]
    return value


_NONE_KEYS = frozenset({"maximum_step", "pressure", "particles", "checkpoint"})
_REMOVABLE = ("reference", "gauges")


def set_path(data: Any, path: str, value: Any) -> None:
    """Set, in place, the entry of nested dicts and lists that a dotted path names; missing mappings are made.

    A value None, or the word none, takes an entry of `reference` or `gauges` out. Raises CaseError if the path leads
    through something that is neither, or names no such entry.
    """
    keys = path.split(".")
    if not all(keys):
        raise CaseError(
            [Problem(path or "(override)", value, "needs a dotted path such as a.b=c", "name every step")]
        )
    here = data
    if len(keys) == 2 and keys[0] in _REMOVABLE and (value is None or (isinstance(value, str) and value == "none")):
        entries = data.get(keys[0]) if isinstance(data, dict) else None
        if not isinstance(entries, dict) or keys[1] not in entries:
            known = list(entries) if isinstance(entries, dict) else []
            remedy = suggestion(keys[1], known) if known else "delete it"
            raise CaseError([Problem(path, value, "there is no such entry to take out", remedy)])
        del entries[keys[1]]
        return
    for depth, key in enumerate(keys):
        last = depth == len(keys) - 1
        so_far = short(".".join(keys[:depth]))
        if isinstance(here, list):
            if not key.isdecimal() or len(key) > 9 or int(key) >= len(here):
                rule = f"{so_far} is a list of {len(here)}"
                raise CaseError([Problem(path, value, rule, f"use a position 0 to {len(here) - 1}")])
            if last:
                here[int(key)] = value
            else:
                here = here[int(key)]
        elif isinstance(here, dict):
            if last:
                here[key] = value
            else:
                if here.get(key) is None or (here[key] == "none" and key in _NONE_KEYS):
                    here[key] = {}
                here = here[key]
        else:
            rule = f"{so_far} is a {kind_of(here)} and has no part {short(key)}"
            raise CaseError([Problem(path, value, rule, f"set {so_far} as a whole")])


def case_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of case files, for completion and checks in editors."""
    schema = Case.model_json_schema(by_alias=True, mode="validation")
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "warpsph case"
    return schema
