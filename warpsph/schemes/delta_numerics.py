"""Delta-plus-SPH: its keys of `numerics`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from warpsph.case.numerics import Auto, NumericsBase, Switch, one_of_switch
from warpsph.case.values import ChoiceRule, NumberRule

__all__ = ["DeltaNumerics"]


class DeltaNumerics(NumericsBase):
    """How delta-plus-SPH computes. `formulation` sets the defaults of the keys that are `auto`."""

    scheme: Literal["delta_plus"] = Field(
        default="delta_plus", description="weakly compressible delta-plus-SPH, one phase", examples=["delta_plus"]
    )
    pressure_gradient: Annotated[Literal["auto", "conservative"], ChoiceRule()] = Field(
        default="auto",
        description="conservative: plus form, conserves momentum, but see tension_control",
        examples=["auto"],
    )
    viscosity_form: Annotated[Literal["auto", "morris", "radial", "isotropic"], ChoiceRule()] = Field(
        default="auto",
        description="viscous term; isotropic is radial with weights that do not feel the direction of rows. auto: morris, "
        "isotropic with a free surface (paper: radial)",
        examples=["auto"],
    )
    smoothing_ratio: Annotated[float | Auto, NumberRule(least=0.8, most=4, auto=True)] = Field(
        default="auto", description="smoothing length h divided by particle_spacing. auto: 2", examples=["2"]
    )
    shifting: Annotated[float | Auto, NumberRule(least=0, most=20, auto=True)] = Field(
        default="auto",
        description="coefficient of particle shifting, 0 for none. auto: 8, 2 with a free surface (paper: 2)",
        examples=["8"],
    )
    shift_form: Annotated[Literal["auto", "positions", "consistent"], ChoiceRule()] = Field(
        default="auto",
        description="positions: a shift moves particles and nothing else; consistent: density and velocity become those "
        "of the new place. auto: consistent (paper: positions)",
        examples=["auto"],
    )
    unlock: Annotated[float | Auto, NumberRule(least=0, most=0.3, auto=True)] = Field(
        default="auto",
        description="random displacement at the start that breaks the symmetry of a lattice, fraction of "
        "particle_spacing; start.noise counts if it is larger. auto: 0",
        examples=["0"],
    )
    courant: Annotated[float | Auto, NumberRule(above=0, most=2, auto=True)] = Field(
        default="auto",
        description="time step divided by h/(c + v). auto: 0.5, 0.25 with bodies; 1.25 with rk4",
        examples=["0.5"],
    )
    integrator: Annotated[Literal["auto", "leapfrog", "rk4"], ChoiceRule()] = Field(
        default="auto",
        description="leapfrog: two sweeps a step; rk4: Runge-Kutta, ten sweeps a step, nothing may depend on time. "
        "auto: leapfrog (paper: rk4)",
        examples=["auto"],
    )
    density_diffusion: Annotated[float | Auto, NumberRule(least=0, most=1, auto=True)] = Field(
        default="auto",
        description="factor delta of the term that evens the density out. auto: 0.1, 0.5 with bodies",
        examples=["0.1"],
    )
    exact_divergence: Switch = Field(
        default="auto",
        description="divergence exact for linear velocities on any arrangement. auto: true where the fluid fills the domain "
        "(paper: false)",
        examples=["true"],
    )
    volume_constraint: Switch = Field(
        default="auto",
        description="keep the total volume of closed or periodic domains. auto: true there (paper: false)",
        examples=["true"],
    )
    room_rate: Annotated[float | Auto, NumberRule(least=0, most=50, auto=True)] = Field(
        default="auto",
        description="rate, over the shear rate, at which the density is held to the room that particles take. "
        "auto: 2 with a free surface, inlets or outlets, else 0 (paper: 0)",
        examples=["2"],
    )
    tension_control: Annotated[bool | Literal["auto", "gaps"], one_of_switch("gaps")] = Field(
        default="auto",
        description="pressure below zero acts by its differences, away from free surfaces, so that particles do not clump; "
        "pairs then exchange no momentum. gaps: only where a neighbour is missing, so that a full domain does not tear. "
        "auto: true with a free surface, else gaps (paper: true)",
        examples=["true"],
    )
    acoustic_damping: Annotated[float | Auto, NumberRule(least=0, most=0.5, auto=True)] = Field(
        default="auto",
        description="bulk viscosity over rho c h: damps sound, leaves other flow alone. auto: 0.25, 0 with rk4 (paper: 0)",
        examples=["0.25"],
    )
    acoustic_relaxation: Annotated[float | Auto, NumberRule(least=0, most=4, auto=True)] = Field(
        default="auto",
        description="stiffness of a part of the pressure that fades, over that of the rest: damps sound of all lengths; a "
        "step is shorter by the root of 1 + this. auto: 0.25 where bodies move in a full domain, else 0",
        examples=["0.25"],
    )
    relaxation_time: Annotated[float | Auto, NumberRule(above=0, auto=True)] = Field(
        default="auto",
        description="s, time in which that part fades. auto: length of the fluid over pi c",
        examples=["0.01"],
    )
    artificial_viscosity: Annotated[float | Auto, NumberRule(least=0, most=1, auto=True)] = Field(
        default="auto",
        description="factor alpha of a friction between fluid particles, as viscosity alpha h c rho/(2 (d + 2)) less that "
        "of the phase. auto: 0.02 with a free surface, else 0",
        examples=["0.02"],
    )
