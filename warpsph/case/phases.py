"""The sections `phases`, `surface_tension` and `fluids` of a case: what there is, and where."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from warpsph.case.shapes import Shape
from warpsph.case.values import (
    CaseModel,
    Name,
    NonNegativeNumber,
    NumberRule,
    PositiveNumber,
    as_list,
)


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
        "(default none: 90; in the printed form walls take no part)",
        examples=["60"],
    )


class Fluid(CaseModel):
    """A region filled with one phase. Regions must not overlap."""

    phase: Name = Field(description="name of a phase", examples=["water"])
    shape: Shape = Field(description="the region", examples=["rest"])
