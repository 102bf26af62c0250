"""The section `gauges` of a case: a model for each type of gauge."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, Any, Literal, cast

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    SerializeAsAny,
    Tag,
    TypeAdapter,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)

from warpsph.case.outputs import Timed
from warpsph.case.values import (
    ChoiceRule,
    Name,
    Number,
    NumberRule,
    PositiveNumber,
    Vector,
    as_list,
    bad_value,
    field_list,
    kind_of,
    schema_of_fields,
    suggestion,
)
from warpsph.errors import MISSING, short

SAMPLED_FIELDS = (
    "velocity", "density", "pressure", "volume", "phase", "acceleration", "normal", "curvature", "vorticity", "q_criterion"
)  # fmt: skip
"""Fields that gauges can interpolate at points and along lines."""


class GaugeModel(Timed):
    """A time series written to gauges/<name>.csv."""

    type: str = Field(description="what is measured", examples=["energy"])


class EnergyGauge(GaugeModel):
    """Kinetic, potential, elastic and surface energy of the fluid."""

    type: Literal["energy"] = Field(description="energies of the fluid; surface energy where there is surface tension")


class MomentumGauge(GaugeModel):
    """Momentum of the fluid."""

    type: Literal["momentum"] = Field(description="momentum of the fluid")


class BudgetGauge(GaugeModel):
    """Where the momentum and the energy of the fluid come from and go."""

    type: Literal["budget"] = Field(description="what gives the fluid momentum and energy, and what takes them (delta_plus)")


class PhasePressureGauge(GaugeModel):
    """Mean pressure of each phase."""

    type: Literal["phase_pressure"] = Field(description="mean pressure of each phase")


class InterfaceLengthGauge(GaugeModel):
    """Length (3-D: area) of the interface between phases."""

    type: Literal["interface_length"] = Field(description="length of the interface")


class InterfaceWaveGauge(GaugeModel):
    """Amplitude of a wave of an interface that is flat but for it."""

    type: Literal["interface_wave"] = Field(description="amplitude of a wave of an interface, by the moments of a phase")
    phase: Name = Field(description="the phase below the interface", examples=["water"])
    wavelength: PositiveNumber = Field(description="m; the domain holds a whole number of them", examples=[1.0])
    axis: Annotated[Literal["x", "y"], ChoiceRule()] = Field(
        default="x", description="along the wave; the last axis of the scene is upwards", examples=["x"]
    )


class ExtentsGauge(GaugeModel):
    """Extents and centre of each phase."""

    type: Literal["extents"] = Field(description="extents of each phase")


class ContourGauge(GaugeModel):
    """The line around each phase (2-D)."""

    type: Literal["contour"] = Field(description="the line around each phase (2-D)")
    mirror: Annotated[Literal["x", "y"] | None, ChoiceRule(none=True)] = Field(
        default=None,
        description="axis across which the scene is symmetric about the middle of the domain: adds asymmetry",
        examples=["x"],
    )


_Phases = Annotated[tuple[Name, ...] | None, BeforeValidator(as_list)]


class DeformationGauge(GaugeModel):
    """Deformation and orientation of each phase."""

    type: Literal["deformation"] = Field(description="semi-axes, deformation and orientation of drops by second moments")
    phases: _Phases = Field(default=None, description="which phases (default: all)", examples=["[drop]"])


class FragmentsGauge(GaugeModel):
    """The pieces that each phase is in."""

    type: Literal["fragments"] = Field(description="pieces that a phase is in, and their volumes")
    phases: _Phases = Field(default=None, description="which phases (default: all)", examples=["[drop]"])
    largest: Annotated[int, NumberRule(least=1, most=100, integer=True)] = Field(
        default=3, description="how many of the largest pieces have a column of their own", examples=["3"]
    )
    least: Annotated[int, NumberRule(least=1, most=1_000_000, integer=True)] = Field(
        default=5, description="fewest particles that count as a piece", examples=["5"]
    )


class LensGauge(GaugeModel):
    """The angles at the rim of a lens of one phase between two others (2-D)."""

    type: Literal["lens"] = Field(description="angles at the rim of a lens between two other phases, and its width (2-D)")
    phase: Name = Field(description="phase of the lens", examples=["oil"])


class PhaseVelocityGauge(GaugeModel):
    """Mean velocity of each phase."""

    type: Literal["phase_velocity"] = Field(description="mean velocity of each phase")


class StraysGauge(GaugeModel):
    """Particles that have left their phase."""

    type: Literal["strays"] = Field(description="particles without company of their own phase")


class WallForceGauge(GaugeModel):
    """Force of the fluid on the walls."""

    type: Literal["wall_force"] = Field(description="force on the walls, and torque on bodies")
    pivot: Vector | None = Field(
        default=None,
        description="point about which the torques on bodies are taken, m (default: of each the centre of its surface)",
        examples=["[0, 0]"],
    )


class ForceCoefficientsGauge(GaugeModel):
    """Drag, lift and moment of bodies over those of a stream."""

    type: Literal["force_coefficients"] = Field(description="drag, lift and moment of bodies, without units")
    speed: PositiveNumber = Field(description="U of the reference pressure q = density U^2/2, m/s", examples=["1"])
    length: PositiveNumber = Field(
        description="length L by which forces (2-D, per metre of depth) and moments are divided, such as the diameter or "
        "the chord, m: C = F/(q L), Cm = M/(q L^2)",
        examples=["1"],
    )
    area: PositiveNumber | None = Field(
        default=None,
        description="area A by which forces are divided (3-D), m^2: C = F/(q A), Cm = M/(q A L)",
        examples=["0.785"],
    )
    density: PositiveNumber | None = Field(
        default=None, description="density of q, kg/m^3 (default: that of the only phase)", examples=["1000"]
    )
    phase: Name | None = Field(
        default=None, description="phase whose density is that of q (default: the only phase)", examples=["water"]
    )
    bodies: Annotated[tuple[Name, ...] | None, BeforeValidator(as_list)] = Field(
        default=None, description="which bodies (default: all)", examples=["[cylinder]"]
    )
    drag: Vector | None = Field(
        default=None,
        description="direction of drag, of any length, that in which the stream goes (default: +x)",
        examples=["[1, 0]"],
    )
    lift: Vector | None = Field(
        default=None,
        description="direction of lift, at right angles to drag (default: in 2-D that of drag turned by 90 degrees from x "
        "to y)",
        examples=["[0, 1]"],
    )
    pivot: Vector | None = Field(
        default=None,
        description="point about which moments are taken, m (default: of each body the centre of its surface)",
        examples=["[0.25, 0]"],
    )


class SurfaceStressGauge(GaugeModel):
    """Pressure and friction along the surface of a body."""

    type: Literal["surface_stress"] = Field(description="pressure and friction along the surface of a body")
    body: Name | None = Field(default=None, description="which body (default: the only one)", examples=["cylinder"])
    speed: PositiveNumber | None = Field(
        default=None,
        description="U of the reference pressure q = density U^2/2, m/s: adds the coefficients Cp and Cf",
        examples=["1"],
    )
    density: PositiveNumber | None = Field(
        default=None, description="density of q, kg/m^3 (default: that of the only phase)", examples=["1000"]
    )
    phase: Name | None = Field(
        default=None, description="phase whose density is that of q (default: the only phase)", examples=["water"]
    )
    far_pressure: Number = Field(
        default=0.0, description="pressure of the stream, Pa: Cp = (p - far_pressure)/q", examples=["0"]
    )


class ElevationGauge(GaugeModel):
    """Height of the free surface above given places."""

    type: Literal["elevation"] = Field(description="height of the free surface")
    places: Annotated[tuple[Vector, ...], Field(min_length=1), BeforeValidator(as_list)] = Field(
        description="the places: their coordinates but for the last axis, along which the height is measured, m",
        examples=["[[0], [0.5]]"],
    )


class FlowRateGauge(GaugeModel):
    """What goes through inlets and outlets."""

    type: Literal["flow_rate"] = Field(description="mass flow, mass and pressure of each inlet and outlet")


_SampledFields = Annotated[
    tuple[str, ...], Field(min_length=1), field_list(SAMPLED_FIELDS), schema_of_fields(SAMPLED_FIELDS)
]


class PointsGauge(GaugeModel):
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


class LineGauge(GaugeModel):
    """Fields at evenly spaced points of a line."""

    type: Literal["line"] = Field(description="fields along a line")
    from_: Vector = Field(alias="from", description="first point, m", examples=["[0, 0]"])
    to: Vector = Field(description="last point, m", examples=["[0, 1]"])
    count: Annotated[int, NumberRule(least=2, most=1_000_000, integer=True)] = Field(
        description="number of points, both ends included", examples=["51"]
    )
    fields: _SampledFields = Field(description="fields to interpolate", examples=["[velocity]"])


class ReattachmentGauge(GaugeModel):
    """Where a flow along a wall leaves it and comes back to it."""

    type: Literal["reattachment"] = Field(description="where the flow along a wall leaves it and comes back")
    from_: Vector = Field(alias="from", description="first point of a line close to the wall, m", examples=["[0, 0.01]"])
    to: Vector = Field(description="last point, m", examples=["[10, 0.01]"])
    count: Annotated[int, NumberRule(least=2, most=1_000_000, integer=True)] = Field(
        description="number of points, both ends included", examples=["201"]
    )
    wall: Vector | None = Field(
        default=None,
        description="any point of the wall along the line, at rest, that the flow sticks to, m: what counts is the sign of "
        "the shear at it, of a parabola through the velocity there, on the line and twice as far off (default: the sign of "
        "the velocity on the line)",
        examples=["[0, 0]"],
    )

    @property
    def fields(self) -> tuple[str, ...]:
        """What is interpolated at the points."""
        return ("velocity",)


GAUGES: dict[str, type[GaugeModel]] = {
    "energy": EnergyGauge,
    "momentum": MomentumGauge,
    "budget": BudgetGauge,
    "phase_pressure": PhasePressureGauge,
    "interface_length": InterfaceLengthGauge,
    "interface_wave": InterfaceWaveGauge,
    "extents": ExtentsGauge,
    "contour": ContourGauge,
    "deformation": DeformationGauge,
    "fragments": FragmentsGauge,
    "lens": LensGauge,
    "phase_velocity": PhaseVelocityGauge,
    "strays": StraysGauge,
    "wall_force": WallForceGauge,
    "force_coefficients": ForceCoefficientsGauge,
    "surface_stress": SurfaceStressGauge,
    "elevation": ElevationGauge,
    "points": PointsGauge,
    "line": LineGauge,
    "flow_rate": FlowRateGauge,
    "reattachment": ReattachmentGauge,
}

LOAD_GAUGES = ("wall_force", "force_coefficients", "surface_stress")
"""Types of gauges that need the force of the fluid on wall particles."""


REGISTERED: dict[str, type[GaugeModel]] = {}
"""models of gauges that a program has added, see `warpsph.measure.gauges.register`"""


def _gauge_type(value: Any) -> str:
    """Tag of the gauge model, in < > so that the report can tell it from a key."""
    return f"<{value['type'] if isinstance(value, Mapping) else value.type}>"


def _check_gauge_type(value: Any) -> Any:
    if isinstance(value, GaugeModel):
        return value
    if not isinstance(value, Mapping):
        raise bad_value("needs a mapping with type and interval", "write e.g. {type: energy, interval: 0.1}")
    kind = value.get("type", MISSING)
    if kind is MISSING:
        close = difflib.get_close_matches("type", [key for key in value if isinstance(key, str)], 1)
        remedy = f"did you mean type where {short(close[0])} is?" if close else "add type: " + " | ".join(GAUGES)
        raise bad_value("needs the key type", remedy)
    known = [*GAUGES, *REGISTERED]
    if not isinstance(kind, str) or kind not in known:
        raise bad_value(
            f"has an unknown type {short(kind) if isinstance(kind, str) else kind_of(kind)}",
            suggestion(kind, known),
        )
    return value


def _as_registered(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    """Read a gauge that a program has added with its own model, all others as one of the union."""
    if isinstance(value, tuple(REGISTERED.values())):
        return value
    if isinstance(value, Mapping) and value.get("type") in REGISTERED:
        return REGISTERED[value["type"]].model_validate(value)
    return handler(value)


Gauge = Annotated[
    Annotated[EnergyGauge, Tag("<energy>")]
    | Annotated[MomentumGauge, Tag("<momentum>")]
    | Annotated[BudgetGauge, Tag("<budget>")]
    | Annotated[PhasePressureGauge, Tag("<phase_pressure>")]
    | Annotated[InterfaceLengthGauge, Tag("<interface_length>")]
    | Annotated[InterfaceWaveGauge, Tag("<interface_wave>")]
    | Annotated[ExtentsGauge, Tag("<extents>")]
    | Annotated[ContourGauge, Tag("<contour>")]
    | Annotated[DeformationGauge, Tag("<deformation>")]
    | Annotated[FragmentsGauge, Tag("<fragments>")]
    | Annotated[LensGauge, Tag("<lens>")]
    | Annotated[PhaseVelocityGauge, Tag("<phase_velocity>")]
    | Annotated[StraysGauge, Tag("<strays>")]
    | Annotated[WallForceGauge, Tag("<wall_force>")]
    | Annotated[ForceCoefficientsGauge, Tag("<force_coefficients>")]
    | Annotated[SurfaceStressGauge, Tag("<surface_stress>")]
    | Annotated[ElevationGauge, Tag("<elevation>")]
    | Annotated[PointsGauge, Tag("<points>")]
    | Annotated[LineGauge, Tag("<line>")]
    | Annotated[FlowRateGauge, Tag("<flow_rate>")]
    | Annotated[ReattachmentGauge, Tag("<reattachment>")],
    Discriminator(_gauge_type),
    WrapValidator(_as_registered),
    BeforeValidator(_check_gauge_type),
    SerializeAsAny(),
]


def as_gauge(data: Mapping[str, Any]) -> GaugeModel:
    """Return the section of a gauge from plain data, outside of a case. Raises pydantic.ValidationError."""
    return cast(GaugeModel, TypeAdapter(Gauge).validate_python(dict(data)))
