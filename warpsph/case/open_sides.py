"""Inlets and outlets at sides of the domain: what is given there, and what comes from inside."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, ModelWrapValidatorHandler, model_validator

from warpsph.case.expressions import Expression
from warpsph.case.values import (
    CaseModel,
    ChoiceRule,
    Formula,
    FormulaRule,
    NumberRule,
    PositiveNumber,
    as_list,
    bad_value,
)

if TYPE_CHECKING:
    import numpy as np

_Profile = Annotated[tuple[Formula, ...], Field(min_length=1), BeforeValidator(as_list)]
_Signal = Annotated[Expression, FormulaRule(names=("t",))]
_Waves = Annotated[Literal["reflect", "leave"], ChoiceRule()]


class Sponge(CaseModel):
    """A layer inside the domain, next to an open side, that draws the flow to what is given there."""

    length: PositiveNumber = Field(description="thickness of the layer, m", examples=["0.5"])
    strength: Annotated[float, NumberRule(above=0, most=100)] = Field(
        default=3.0, description="rate at the side, in sound speeds over length", examples=["3"]
    )
    velocity: _Profile | None = Field(
        default=None,
        description="velocity that the flow is drawn to, m/s: a number or formula in x, y, z, r an axis "
        "(default: that of the inlet; an outlet without one draws the pressure alone)",
        examples=["[1, 0]"],
    )


class OpenSide(CaseModel):
    """What an inlet and an outlet have in common."""

    word: ClassVar[str]

    ramp: _Signal | None = Field(
        default=None,
        description="factor on what is given, a formula in t (s) (default 1)",
        examples=['"minimum(t/0.5, 1)"'],
    )
    waves: _Waves = Field(default="reflect", description="whether sound is thrown back", examples=["leave"])
    relaxation: Annotated[float, NumberRule(above=0, most=100)] = Field(
        default=0.08,
        description="rate at which the mean comes back to what is given where waves leave, in sound speeds over the length "
        "of the domain",
        examples=["0.25"],
    )
    sponge: Sponge | None = Field(
        default=None, description="layer inside that damps what comes near", examples=["{length: 1}"]
    )

    @property
    def given_velocity(self) -> tuple[Expression, ...] | None:
        """Velocity of an inlet, a formula an axis; None where the pressure is given."""
        return getattr(self, "velocity", None)

    @property
    def given_pressure(self) -> Expression | None:
        """Pressure where it is given; None stands for 0 then."""
        return getattr(self, "pressure", None)

    @property
    def steady(self) -> bool:
        """Whether what is given does not depend on time."""
        return self.ramp is None or self.ramp.constant is not None

    def factor(self, times: np.ndarray) -> np.ndarray:
        """Return the factor on what is given at times [s], (n,). Raises ExpressionError where it is not finite."""
        import numpy as np

        return np.ones(len(times)) if self.ramp is None else np.asarray(self.ramp.evaluate(t=times))

    def plain(self) -> dict[str, Any]:
        """What was written, as plain data."""
        return self.model_dump(mode="python", by_alias=True, exclude_unset=True)


class Inlet(OpenSide):
    """Where fluid comes in: its velocity is given and the pressure comes from inside, or the other way round."""

    word: ClassVar[str] = "inlet"

    velocity: _Profile | None = Field(
        default=None,
        description="velocity of what comes in, m/s: a number or formula in x, y, z, r an axis; the pressure follows from "
        "the flow inside",
        examples=['["6*y*(1 - y)", 0]'],
    )
    pressure: Formula | None = Field(
        default=None,
        description="pressure at the inlet instead of a velocity, Pa: a number or formula in x, y, z, r; the velocity "
        "across the side follows from the flow inside",
        examples=["100"],
    )
    waves: _Waves = Field(
        default="reflect",
        description="reflect: what is given holds at every moment, so that sound is thrown back; leave: sound goes out, and "
        "the mean is drawn to what is given",
        examples=["leave"],
    )

    @model_validator(mode="wrap")
    @classmethod
    def _one_of_both(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        made = handler(value)
        if (made.velocity is None) == (made.pressure is None):
            raise bad_value("needs either velocity or pressure", "write e.g. inlet: {velocity: [1, 0]}")
        return made


class Outlet(OpenSide):
    """Where fluid goes out: the pressure is given, the velocity comes from inside."""

    word: ClassVar[str] = "outlet"

    pressure: Formula | None = Field(
        default=None,
        description="pressure at the outlet, Pa: a number or formula in x, y, z, r (default 0)",
        examples=["0"],
    )
    waves: _Waves = Field(
        default="leave",
        description="leave: sound goes out, and the mean pressure is drawn to what is given; reflect: the pressure holds "
        "at every moment, so that sound is thrown back",
        examples=["leave"],
    )
