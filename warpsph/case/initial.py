"""The sections `start`, `scales` and `central_force` of a case: the state at time 0, what the flow will see, a force."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from warpsph.case.expressions import Expression
from warpsph.case.values import (
    CaseModel,
    ChoiceRule,
    Formula,
    FormulaRule,
    NumberRule,
    PositiveNumber,
    Vector,
    as_list,
)


class Start(CaseModel):
    """The state at time 0."""

    arrangement: Annotated[Literal["auto", "lattice", "fitted", "equal_mass"], ChoiceRule()] = Field(
        default="auto",
        description="lattice: particles in the middle of square cells; fitted: in rows along the interfaces, half a "
        "spacing from them, evenly spaced elsewhere; equal_mass: rows of a lattice, moved along x until all particles have "
        "the same mass (gas). auto: fitted where an interface between two phases runs through cells",
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
    density: Annotated[Expression | None, FormulaRule(words=(("none", None),))] = Field(
        default=None,
        description="density, kg/m^3: a formula in x, y, z, r; none: that of the phase (gas)",
        examples=['"where(x < 0, 1, 0.125)"'],
    )
    pressure: Annotated[
        Expression | Literal["hydrostatic", "auto"] | None,
        FormulaRule(words=(("none", None), ("hydrostatic", "hydrostatic"), ("auto", "auto"))),
    ] = Field(
        default="auto",
        description="pressure added to the background, Pa: none, hydrostatic, or a formula in x, y, z, r; auto: hydrostatic "
        "for one fluid with sound that fills a closed domain, else none",
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
