"""Weakly compressible Riemann SPH: its keys of `numerics`, and what a case for it must fulfil."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from warpsph.case.numerics import Auto, NumericsBase, Switch
from warpsph.case.values import ChoiceRule, NumberRule

__all__ = ["RiemannNumerics"]


class RiemannNumerics(NumericsBase):
    """How weakly compressible Riemann SPH computes. `formulation` sets the defaults of the keys that are `auto`."""

    scheme: Literal["riemann"] = Field(
        default="riemann", description="weakly compressible Riemann SPH, any number of phases", examples=["riemann"]
    )
    pressure_gradient: Annotated[Literal["auto", "corrected", "conservative"], ChoiceRule()] = Field(
        default="auto",
        description="corrected: minus form, exact for linear pressure; conservative: plus form, conserves "
        "momentum. auto: corrected in closed or periodic domains, else conservative (paper: conservative)",
        examples=["auto"],
    )
    viscosity_form: Annotated[Literal["auto", "morris", "radial", "isotropic", "paper"], ChoiceRule()] = Field(
        default="auto",
        description="viscous term; isotropic is radial with weights that do not feel the direction of rows. auto: morris, "
        "isotropic with a free surface (paper: paper)",
        examples=["auto"],
    )
    viscous_stages: Annotated[int | Auto, NumberRule(least=1, most=50, integer=True, auto=True)] = Field(
        default=1,
        description="stages of friction in a step, for steps longer than explicit friction allows: 1 (explicit), or 3 and "
        "more. auto: as many as make a run fastest, 1 with bodies, inlets or outlets",
        examples=["auto"],
    )
    shifting: Annotated[float | Auto, NumberRule(least=0, most=20, auto=True)] = Field(
        default="auto",
        description="coefficient of particle shifting. auto: 16 with corrected, 0 with conservative",
        examples=["16"],
    )
    unlock: Annotated[float | Auto, NumberRule(least=0, most=0.3, auto=True)] = Field(
        default="auto",
        description="random displacement at the start that breaks the symmetry of a lattice, fraction of "
        "particle_spacing; start.noise counts if it is larger. auto: 0.05 with corrected on a lattice, else 0",
        examples=["0"],
    )
    courant: Annotated[float | Auto, NumberRule(above=0, most=2, auto=True)] = Field(
        default="auto", description="time step divided by h/(c + v). auto: 0.5 (paper: 1)", examples=["0.5"]
    )
    star_states: Annotated[Literal["auto", "weighted", "arithmetic"], ChoiceRule()] = Field(
        default="auto",
        description="weights of the star states. auto: weighted (paper: arithmetic)",
        examples=["auto"],
    )
    tension_form: Annotated[Literal["auto", "pressure_jump", "body_force"], ChoiceRule()] = Field(
        default="auto",
        description="surface tension. auto: pressure_jump (paper: body_force)",
        examples=["auto"],
    )
    interface_force: Annotated[float | Auto, NumberRule(least=0, most=1, auto=True)] = Field(
        default="auto",
        description="factor of the force that keeps phases apart. auto: 0 (paper: 0.08)",
        examples=["0.01"],
    )
    volume_constraint: Switch = Field(
        default="auto",
        description="keep the total volume of closed or periodic domains. auto: true with corrected there",
        examples=["true"],
    )
    room_rate: Annotated[float | Auto, NumberRule(least=0, most=10, auto=True)] = Field(
        default="auto",
        description="rate, over |grad v| (the shear rate where there is a free surface), at which the density follows the "
        "room that the particles take; 0 also leaves the divergence of filled domains uncorrected, and their pressure to "
        "thin fluid. auto: 2 with corrected and shifting, 0.25 with a free surface (paper: 0), else 0",
        examples=["2"],
    )
    disorder_friction: Annotated[float | Auto, NumberRule(least=0, most=20, auto=True)] = Field(
        default="auto",
        description="friction, over |grad v| h, of what velocities of neighbours differ by beyond their gradients: evens a "
        "disordered flow and leaves a smooth one, less what viscosity does already. auto: 4, 0 where viscosity is "
        "enough (paper: 0)",
        examples=["0"],
    )
    acoustic_damping: Annotated[float | Auto, NumberRule(least=0, most=0.5, auto=True)] = Field(
        default="auto",
        description="bulk viscosity of one fluid over rho c h: damps sound, leaves other flow alone. auto: 0.25 "
        "between inlets and outlets, else 0",
        examples=["0.25"],
    )
    acoustic_relaxation: Annotated[float | Auto, NumberRule(least=0, most=4, auto=True)] = Field(
        default="auto",
        description="stiffness of a part of the pressure that fades, over that of the rest: damps sound of all lengths; a "
        "step is shorter by the root of 1 + this. auto: the share of the pressures that tension, velocities of the start or "
        "walls that meet the fluid make at once, 1 without weight, 0 where it gives the pressure; 0.25 at least where "
        "bodies move in a full domain",
        examples=["1"],
    )
    relaxation_time: Annotated[float | Auto, NumberRule(above=0, auto=True)] = Field(
        default="auto",
        description="s, time in which that part fades. auto: length of the fluid over pi c, of the slowest phase",
        examples=["0.01"],
    )
    relaxation_end: Annotated[float | Auto | None, NumberRule(above=0, auto=True, none=True)] = Field(
        default="auto",
        description="s, time from which that part is left out and steps are as long as without it; none: never. auto: when "
        "the sound of the start has died to 1 %, none where acoustic_relaxation is given or bodies move",
        examples=["0.5", "none"],
    )
    spared_gradient: Annotated[Literal["auto", "gravity", "acceleration"], ChoiceRule()] = Field(
        default="auto",
        description="pressure gradient that dissipation spares: gravity's alone, or that which the acceleration tells too, "
        "without which fluid that turns, falls or is shaken is driven. auto: acceleration for one fluid with a free surface",
        examples=["gravity"],
    )
    velocity_dissipation: Annotated[float | Auto, NumberRule(least=0, most=10, auto=True)] = Field(
        default="auto",
        description="factor on the pressure-difference term of the star velocity",
        examples=["1"],
    )
