"""Projection ISPH: its keys of `numerics`, and what a case for it must fulfil."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from warpsph.case.numerics import Auto, NumericsBase, Switch
from warpsph.case.values import ChoiceRule, NumberRule

__all__ = ["IsphNumerics"]


class IsphNumerics(NumericsBase):
    """How projection ISPH computes. `formulation` sets the defaults of the keys that are `auto`."""

    scheme: Literal["isph"] = Field(
        default="isph", description="projection ISPH, one incompressible phase", examples=["isph"]
    )
    pressure_gradient: Annotated[Literal["auto", "corrected", "conservative"], ChoiceRule()] = Field(
        default="auto",
        description="corrected: minus form, exact for linear pressure; conservative: plus form, conserves "
        "momentum. auto: corrected (paper: conservative)",
        examples=["auto"],
    )
    viscosity_form: Annotated[Literal["auto", "morris", "radial", "isotropic", "paper"], ChoiceRule()] = Field(
        default="auto",
        description="viscous term; isotropic is radial with weights that do not feel the direction of rows. auto: morris, "
        "isotropic with a free surface (paper: morris)",
        examples=["auto"],
    )
    shifting: Annotated[float | Auto, NumberRule(least=0, most=20, auto=True)] = Field(
        default="auto",
        description="coefficient of particle shifting. auto: 16 (paper: C of its shift, 0.02)",
        examples=["16"],
    )
    unlock: Annotated[float | Auto, NumberRule(least=0, most=0.3, auto=True)] = Field(
        default="auto",
        description="random displacement at the start that breaks the symmetry of a lattice, fraction of "
        "particle_spacing; start.noise counts if it is larger. auto: 0",
        examples=["0"],
    )
    courant: Annotated[float | Auto, NumberRule(above=0, most=2, auto=True)] = Field(
        default="auto",
        description="time step divided by h/v. auto: 0.4, 0.2 with bodies that move (paper: 0.2)",
        examples=["0.4"],
    )
    skin: Annotated[float | Auto, NumberRule(least=0.001, most=1, auto=True)] = Field(
        default="auto",
        description="skin of the neighbour list, fraction of the support radius. auto: 0.001, the list is new in each step",
        examples=["0.001"],
    )
    time_order: Annotated[int | Auto, NumberRule(least=1, most=2, integer=True, auto=True)] = Field(
        default="auto", description="1, the printed projection, or 2, BDF2. auto: 2 (paper: 1)", examples=["2"]
    )
    relaxed_divergence: Switch = Field(
        default="auto",
        description="take out divergence that is left over within h/(2 u_max), not at once. auto: true (paper: false)",
        examples=["true"],
    )
    deferred_correction: Switch = Field(
        default="auto",
        description="take what an uneven arrangement makes of the last pressure gradient out of the pressure "
        "equation. auto: true (paper: false)",
        examples=["true"],
    )
    surface_offset: Annotated[float | Auto, NumberRule(least=0, most=1, auto=True)] = Field(
        default="auto",
        description="distance from an even row of particles at a free surface to the place where p = 0, in "
        "particle_spacing. auto: 0.5 (paper: 0)",
        examples=["0.5"],
    )
    volume_feedback: Annotated[float | Auto, NumberRule(least=0, most=1, auto=True)] = Field(
        default="auto",
        description="share of an excess of the density that is let go within h/u_max. auto: 0.1 (paper: 0)",
        examples=["0.1"],
    )
    velocity_filter: Annotated[float | Auto, NumberRule(least=0, most=100, auto=True)] = Field(
        default="auto",
        description="rate at which the velocity is drawn to the linear field around it, over the velocity gradient, less "
        "what friction does itself. auto: 1 (paper: 0)",
        examples=["1"],
    )
    implicit_viscosity: Switch = Field(
        default="auto",
        description="friction by an implicit solve, stable at any time step. auto: true where the limit of explicit "
        "friction is less than half of the other limits of the step (paper: false)",
        examples=["true"],
    )
    solver: Annotated[Literal["auto", "cg", "bicgstab"], ChoiceRule()] = Field(
        default="auto", description="solver of the pressure equation. auto: cg (paper: bicgstab)", examples=["cg"]
    )
    preconditioner: Annotated[Literal["auto", "multigrid", "jacobi", "none"], ChoiceRule()] = Field(
        default="auto", description="preconditioner of the solver. auto: multigrid (paper: none)", examples=["multigrid"]
    )
    tolerance: Annotated[float | Auto, NumberRule(least=1e-14, most=0.1, auto=True)] = Field(
        default="auto", description="relative residual of the pressure equation. auto: 1e-6 (paper: 1e-3)", examples=["1e-6"]
    )
    maximum_iterations: Annotated[int, NumberRule(least=1, most=1_000_000, integer=True)] = Field(
        default=1000, description="iterations after which a solve is given up", examples=["1000"]
    )
