"""The section `reference` of a case: what is compared with what, a model for each kind of reference."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, StrictStr, Tag
from pydantic_core import PydanticCustomError

from warpsph.case.expressions import Expression
from warpsph.case.values import (
    AlsoWritten,
    CaseModel,
    ChoiceRule,
    FormulaRule,
    FreezeMapping,
    Name,
    NonNegativeNumber,
    Number,
    NumberRule,
    PositiveNumber,
    Vector,
    as_list,
    as_mapping,
    bad_value,
    time_window,
)
from warpsph.errors import short


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
            "peak", "peak_time", "trough", "trough_time", "noise", "slope", "frequency", "amplitude", "strouhal",
        ],
        ChoiceRule(),
    ] = Field(
        default="mean",
        description="how the column becomes one number. farthest: the value farthest from the reference; change: the "
        "largest relative change since the first row; peak, trough and their times: of the cubic through the rows of the "
        "window, or those around the largest or lowest one where no cubic follows all; "
        "noise: root mean square of the deviations from a parabola through the rows within half a span of each; "
        "slope: of a line gauge, at its last time; frequency, amplitude: of the wave with two overtones that fits the rows "
        "of the window best, 1/s and half of the way from its lowest to its highest point; strouhal: that frequency times "
        "length over speed, those of a gauge of type force_coefficients",
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
            "mean", "max", "min", "final", "rms", "period", "peak", "peak_time", "trough", "trough_time", "noise",
            "frequency", "amplitude", "strouhal",
        ],
        ChoiceRule(),
    ] | None = Field(
        default=None,
        description="instead of norm: column and curve each become one number in this way, over the same times, and these "
        "are compared (peak, trough and their times: of the cubic through the rows of the window; noise, frequency, "
        "amplitude, strouhal: as of a value)",
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
        description="name of its position column: distance from the line's `from`, of a surface the arc, m", examples=["y_m"]
    )
    position_scale: PositiveNumber = Field(
        default=1.0, description="factor that turns its positions into m", examples=["pi*0.5"]
    )
    columns: Annotated[Mapping[float, str], FreezeMapping(), BeforeValidator(_as_columns)] = Field(
        description="time in s -> name of the column", examples=['{0.1: "u_t=0.1"}']
    )
    scale: Number = Field(default=1.0, description="factor on the value columns", examples=["1"])


class ReferenceCurves(_Reference):
    """A field along a line, or along the surface of a plane body, against profiles at given times."""

    gauge: Name = Field(description="name of a gauge of type line, or in 2-D surface_stress", examples=["profile"])
    column: StrictStr = Field(
        description="column of the gauge, such as a field with _x, _y, _z for a vector, or arithmetic of columns",
        examples=["velocity_x"],
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
    norm: Annotated[Literal["l1", "l1_volume", "l2", "max"], ChoiceRule()] = Field(
        default="l1",
        description="norm of the error; l1_volume: the mean over the volume of the fluid, in the unit of the field",
        examples=["l1"],
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
