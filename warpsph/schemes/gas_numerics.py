"""The compressible gas: its keys of `numerics`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from warpsph.case.numerics import Auto, NumericsBase, Switch
from warpsph.case.values import ChoiceRule, NumberRule

__all__ = ["GasNumerics"]


class GasNumerics(NumericsBase):
    """How the compressible gas is computed. `formulation` sets the defaults of the keys that are `auto`."""

    scheme: Literal["gas"] = Field(
        default="gas", description="compressible gas with shocks, one phase, in 1-D, 2-D and 3-D", examples=["gas"]
    )
    pressure_gradient: Annotated[Literal["auto", "conservative"], ChoiceRule()] = Field(
        default="auto", description="conservative: pairs exchange momentum and energy to rounding", examples=["auto"]
    )
    viscosity_form: Annotated[Literal["auto"], ChoiceRule()] = Field(
        default="auto", description="the gas has no viscosity of its own; see dissipation", examples=["auto"]
    )
    kernel: Annotated[
        Literal["wendland_c2", "wendland_c4", "wendland_c6", "cubic", "quintic", "gaussian"], ChoiceRule()
    ] = Field(default="cubic", description="smoothing kernel", examples=["cubic"])
    smoothing_ratio: Annotated[float | Auto, NumberRule(least=0.8, most=4, auto=True)] = Field(
        default="auto",
        description="eta of the smoothing length h = eta (m/rho)^(1/d) of each particle. auto: 1 in 1-D, 1.3 in 2-D and 3-D",
        examples=["1.2"],
    )
    shifting: Annotated[float | Auto, NumberRule(least=0, most=0, auto=True)] = Field(
        default="auto", description="none: the particles of a gas go with it. auto: 0", examples=["0"]
    )
    smoothing_length: Annotated[Literal["auto", "adaptive", "constant"], ChoiceRule()] = Field(
        default="auto",
        description="adaptive: that of each particle follows its density; constant: smoothing_ratio times particle_spacing. "
        "auto: adaptive (paper: constant)",
        examples=["adaptive"],
    )
    courant: Annotated[float | Auto, NumberRule(above=0, most=2, auto=True)] = Field(
        default="auto",
        description="time step divided by h over the signal speed of a pair. auto: 0.3; 0.6 with rk4",
        examples=["0.3"],
    )
    integrator: Annotated[Literal["auto", "kick_drift_kick", "rk2", "rk4"], ChoiceRule()] = Field(
        default="auto",
        description="kick_drift_kick: one look at all pairs a step, with predicted velocity and energy; rk2, rk4: "
        "Runge-Kutta. auto: kick_drift_kick",
        examples=["rk2"],
    )
    dissipation: Annotated[Literal["auto", "riemann", "artificial"], ChoiceRule()] = Field(
        default="auto",
        description="what makes shocks: the Riemann problem of each pair, or artificial viscosity. auto: riemann (paper: "
        "artificial)",
        examples=["riemann"],
    )
    riemann_solver: Annotated[Literal["auto", "exact", "acoustic"], ChoiceRule()] = Field(
        default="auto",
        description="solution of the Riemann problem: exact, or acoustic, which fails for strong shocks. auto: exact",
        examples=["exact"],
    )
    reconstruction: Annotated[Literal["auto", "limited", "none"], ChoiceRule()] = Field(
        default="auto",
        description="states of a pair in its middle: limited: by limited gradients, second order; none: those of the "
        "particles, first order. auto: limited",
        examples=["limited"],
    )
    artificial_viscosity: Annotated[float | Auto, NumberRule(least=0, most=10, auto=True)] = Field(
        default="auto", description="factor alpha of artificial viscosity. auto: 1", examples=["1"]
    )
    quadratic_viscosity: Annotated[float | Auto, NumberRule(least=0, most=10, auto=True)] = Field(
        default="auto", description="factor beta of artificial viscosity. auto: 2 (paper: 1)", examples=["2"]
    )
    conductivity: Annotated[float | Auto, NumberRule(least=0, most=10, auto=True)] = Field(
        default="auto",
        description="factor of artificial conduction, with dissipation: artificial. auto: 0",
        examples=["1"],
    )
    hold_open_sides: Switch = Field(
        default="auto",
        description="particles within a support of an open side keep density, energy and velocity of the start, and go on "
        "like a piston, at which weak waves are reflected; one that a compression drives to its speed of sound is let go. "
        "Make the domain long enough where gas flows in, as none is born behind them. false: the gas expands freely. "
        "auto: true",
        examples=["true"],
    )
