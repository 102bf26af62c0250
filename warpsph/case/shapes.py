"""Regions of space, of fluids and bodies."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    StrictStr,
    model_serializer,
    model_validator,
)
from pydantic_core import CoreSchema

from warpsph.case.expressions import Expression
from warpsph.case.values import (
    CaseModel,
    FormulaRule,
    Number,
    PositiveNumber,
    Vector,
    as_list,
    bad_value,
    example,
    suggestion,
)

TURNED = ("angle", "rotation", "rotate", "orientation", "axes")
"""Keys by which other programs turn a box."""


class Box(CaseModel):
    """Axis-parallel box."""

    lower: Vector = Field(description="lower corner, m", examples=["[0, 0]"])
    upper: Vector = Field(description="upper corner, m", examples=["[1, 1]"])

    @classmethod
    def foreign_key(cls, key: str, raw: Any) -> tuple[str, str] | None:
        """Rule and remedy for an angle, which a box does not have."""
        if key not in TURNED:
            return None
        return "is not a known key: a box lies along the axes", "write a polygon (2-D) or where instead of a turned box"


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


def _four_digits(naca: str) -> str:
    """What names a NACA section of the series that is known."""
    if not re.fullmatch("[0-9]{4}", naca):
        rule = "is no NACA section of four digits, the only series that is known"
        raise bad_value(rule, 'write e.g. naca: "0012", or file: for the coordinates of another one')
    return naca


class Airfoil(CaseModel):
    """An airfoil (2-D): a NACA 4-digit section, or one from a file of coordinates."""

    naca: Annotated[StrictStr, AfterValidator(_four_digits)] | None = Field(
        default=None,
        description="four digits, in quotes: camber, its place, thickness",
        examples=['"0012"'],
        json_schema_extra={"pattern": "^[0-9]{4}$"},
    )
    file: StrictStr | None = Field(
        default=None,
        description="file of coordinates in chords, order of Selig or Lednicer, relative to the case file",
        examples=["sections/e387.dat"],
    )
    closed: Annotated[bool, Field(strict=True)] = Field(
        default=True, description="sharp tail of a NACA section; false: blunt, as it was defined", examples=["true"]
    )
    chord: PositiveNumber = Field(description="chord, m", examples=["1.0"])
    angle: Number = Field(default=0.0, description="angle of attack, degrees, positive nose up", examples=["8"])
    pivot: Number = Field(default=0.25, description="point about which it is turned, in chords", examples=["0.25"])
    position: Vector = Field(description="place of the pivot, m", examples=["[0, 0]"])

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.naca is None) == (self.file is None):
            raise bad_value("needs exactly one of naca and file", 'write e.g. naca: "0012"')
        if self.file is not None and not self.closed:
            raise bad_value("has closed: false, which is for naca alone", "delete it: a file gives its own tail")
        return self


class Stl(CaseModel):
    """The closed mesh in an STL file (3-D)."""

    file: StrictStr = Field(description="STL file, ASCII or binary, relative to the case file", examples=["hull.stl"])
    scale: PositiveNumber = Field(default=1.0, description="factor that turns its lengths into m", examples=["0.001"])
    translate: Vector = Field(default=(0.0, 0.0, 0.0), description="added after that, m", examples=["[0, 0, 0]"])


SHAPES = ("box", "sphere", "polygon", "where")
BODY_SHAPES = (*SHAPES, "airfoil", "stl")
_DISC = "in 2-D write sphere: {center: [x, y], radius: r}, a disc"
_ROUND = {
    **dict.fromkeys(("circle", "disc", "disk"), _DISC),
    **dict.fromkeys(
        ("cylinder", "tube", "pipe"), f'{_DISC}; in 3-D e.g. where: {{condition: "hypot(x, y) < 0.1 and abs(z) < 0.5"}}'
    ),
    "ball": "write sphere: {center: [x, y, z], radius: r}",
    **dict.fromkeys(("ellipse", "ellipsoid"), 'write e.g. where: {condition: "hypot(x/0.2, y/0.1) < 1"}'),
}
_STRAIGHT = {
    **dict.fromkeys(("rectangle", "square", "cube", "cuboid", "block"), "write box: {lower: [x, y], upper: [x, y]}"),
    **dict.fromkeys(("triangle", "wedge"), "write polygon: {points: [[x, y], ...]} (2-D), or where with a condition"),
    **dict.fromkeys(("plane", "halfspace", "half_space"), 'write e.g. where: {condition: "y < 0.5"}'),
}
_KNOWN_ELSEWHERE = {**_ROUND, **_STRAIGHT}
"""Names of shapes in other programs, and how to write them here."""


class Shape(CaseModel):
    """A region: exactly one of box, sphere, polygon, where; or the word `rest`, all that remains."""

    opaque: ClassVar[bool] = True
    kinds: ClassVar[tuple[str, ...]] = SHAPES

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
        options = f"needs exactly one of {', '.join(cls.kinds)} with its numbers, or the word rest"
        if isinstance(value, str):
            if value != "rest":
                remedy = _KNOWN_ELSEWHERE.get(value.lower()) or (
                    f"write {{{value}: {{...}}}}" if value in cls.kinds else suggestion(value, [*cls.kinds, "rest"])
                )
                raise bad_value(options, remedy)
            return cls.model_construct(**dict.fromkeys(cls.kinds), _fields_set=set())
        if not isinstance(value, Mapping):
            raise bad_value(options)
        known = [key for key in value if key in cls.kinds]
        elsewhere = [_KNOWN_ELSEWHERE[str(key).lower()] for key in value if str(key).lower() in _KNOWN_ELSEWHERE]
        if elsewhere and not known:
            raise bad_value(options, elsewhere[0])
        if "rest" in value:
            raise bad_value(options, "write shape: rest")
        if len(known) > 1 or (
            not known and not any(difflib.get_close_matches(str(k), cls.kinds) for k in value)
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
        """One of `kinds`, or rest."""
        return next((name for name in self.kinds if getattr(self, name) is not None), "rest")

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


class BodyShape(Shape):
    """The region of a body: exactly one of box, sphere, polygon, where, airfoil, stl."""

    kinds: ClassVar[tuple[str, ...]] = BODY_SHAPES

    airfoil: Airfoil | None = Field(
        default=None, description="airfoil (2-D)", examples=['{naca: "0012", chord: 1, position: [0, 0]}']
    )
    stl: Stl | None = Field(default=None, description="closed mesh (3-D)", examples=["{file: hull.stl}"])
