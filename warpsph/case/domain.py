"""The section `domain` of a case: the box, and what happens at its sides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import (
    Field,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    PrivateAttr,
    model_serializer,
    model_validator,
)
from pydantic_core import CoreSchema

from warpsph.case.open_sides import Inlet, OpenSide, Outlet
from warpsph.case.signals import SignalVector, TableSignal, signal_schema, signal_text
from warpsph.case.values import CaseModel, Vector, WallKind, bad_value, suggestion

AXES = ("x", "y", "z")


class Side(CaseModel):
    """One side of the domain along one axis.

    In a file: `open`, `wall`, `free_slip`, `{wall: no_slip|free_slip, velocity: [...]}`, `{inlet: {...}}` or
    `{outlet: {...}}`; `periodic` for both sides.
    """

    opaque: ClassVar[bool] = True

    wall: WallKind | None = Field(
        description="no_slip or free_slip wall; nothing on an open or periodic side"
    )
    velocity: SignalVector = Field(
        default=(),
        description="velocity of the wall within its own plane, m/s; may depend on time (default zero)",
        examples=["[1, 0]"],
    )
    inlet: Inlet | None = Field(
        default=None, description="fluid comes in here", examples=["{velocity: [1, 0]}"]
    )
    outlet: Outlet | None = Field(
        default=None, description="fluid goes out here", examples=["{pressure: 0}"]
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
                    f"needs one of {', '.join(_SIDE_WORDS)} or a mapping with the key wall, inlet or outlet",
                    _meant(value, _SIDE_WORDS),
                )
            return cls._of(value)
        if not isinstance(value, Mapping | Side):
            raise bad_value(f"needs one of {', '.join(_SIDE_WORDS)} or a mapping with the key wall, inlet or outlet")
        if isinstance(value, Mapping) and value.keys() & _FLOWS:
            if len(value) > 1:
                raise bad_value(f"has {' and '.join(map(str, value))}", "write inlet or outlet alone, with its own keys")
            return handler({"wall": None, **value})
        return handler(value)

    @classmethod
    def _of(cls, word: str) -> Self:
        """The side that a single word stands for."""
        side = cls.model_construct(wall={"wall": "no_slip", "free_slip": "free_slip"}.get(word), velocity=())
        side._periodic = word == "periodic"
        return side

    @property
    def kind(self) -> Literal["open", "wall", "periodic", "inlet", "outlet"]:
        """What the side is; `open` is one without anything, beyond which particles fly on."""
        if self.wall is not None:
            return "wall"
        if self.inlet is not None:
            return "inlet"
        if self.outlet is not None:
            return "outlet"
        return "periodic" if self._periodic else "open"

    @property
    def flow(self) -> OpenSide | None:
        """The inlet or outlet that the side is."""
        return self.inlet or self.outlet

    @property
    def moves(self) -> bool:
        """Whether the wall has a velocity other than zero."""
        return any(self.velocity)

    def _plain(self) -> Any:
        """The shortest way to write this side in a file."""
        if self.flow is not None:
            return {self.kind: self.flow.plain()}
        if self.kind != "wall":
            return self.kind
        if self.moves:
            return {"wall": self.wall, "velocity": [signal_text(value) for value in self.velocity]}
        return "wall" if self.wall == "no_slip" else "free_slip"


_FLOWS = {"inlet", "outlet"}
_SIDE_WORDS = ("open", "wall", "free_slip")
_AXIS_WORDS = ("periodic", "wall", "open", "free_slip")
_NO_SLIP_WORDS = ("no_slip", "noslip", "non_slip")


def _meant(word: str, words: tuple[str, ...]) -> str:
    """Remedy for an unknown word of a side: no-slip is what `wall` means, though its name is like that of `free_slip`."""
    folded = word.strip().lower().replace("-", "_").replace(" ", "_")
    return "write wall, which is a no-slip wall" if folded in _NO_SLIP_WORDS else suggestion(word, words)


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
                    _meant(value, _AXIS_WORDS),
                )
            side = Side._of(value)
            return cls.model_construct(lower=side, upper=side)
        if isinstance(value, AxisBoundary):
            return handler(value)
        if not isinstance(value, Mapping):
            raise bad_value(f"needs one of {', '.join(_AXIS_WORDS)} or a mapping with lower and upper")
        if value.keys() & _FLOWS:
            raise bad_value("is one for a single side", "write lower: or upper: before inlet and outlet")
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
                "velocity": {"type": "array", "description": "m/s", "items": signal_schema(TableSignal.model_json_schema())},
            },
            "required": ["wall"],
            "additionalProperties": False,
        }
        flows = [
            {"type": "object", "properties": {name: handler(model.__pydantic_core_schema__)}, "required": [name],
             "additionalProperties": False}
            for name, model in (("inlet", Inlet), ("outlet", Outlet))
        ]  # fmt: skip
        side = {"anyOf": [{"enum": list(_SIDE_WORDS)}, wall, *flows]}
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
