"""The particle fields of the delta-plus scheme, beside those that every scheme of fluid flow has."""

import dataclasses

from warpsph.kernels.core.fields import COMMON, FLOW, Field, always
from warpsph.kernels.core.spec import Spec


def _diffusion(spec: Spec) -> bool:
    return spec.density_diffusion


def _runge_kutta(spec: Spec) -> bool:
    return spec.runge_kutta


def _control(spec: Spec) -> bool:
    return bool(spec.tension_control)


def _surface(spec: Spec) -> bool:
    return spec.free_surface


def _budget(spec: Spec) -> bool:
    return spec.budget


def _room(spec: Spec) -> bool:
    return spec.room


def _relaxing(spec: Spec) -> bool:
    return spec.relaxation


def _damping(spec: Spec) -> bool:
    return spec.acoustic_damping


def _part(name: str, meaning: str) -> Field:
    """Return the declaration of a part of the acceleration."""
    return Field(f"budget_{name}", "vec", "fluid", False, _budget, "m/s^2", f"acceleration by {meaning}")


def _gain(name: str, meaning: str) -> Field:
    """Return the declaration of what a particle gains in a step."""
    return Field(f"budget_{name}", "real", "fluid", False, _budget, "J", f"energy gained in this step by {meaning}")


BUDGET_FIELDS: tuple[Field, ...] = (
    _part("pressure", "pressures of the fluid, all of them in the plus form"),
    _part("tension", "what tension control makes of them"),
    _part("viscous", "viscosity of the phase"),
    _part("artificial", "artificial viscosity"),
    _part("wall", "pressure at walls"),
    _part("friction", "friction on walls"),
    _part("contact", "contact with walls"),
    _part("gravity", "gravity and the central force"),
    _part("body", "the body force"),
    _gain("flow", "compression between fluid particles"),
    _gain("wall_flow", "compression against walls"),
    _gain("exact", "the correction of the divergence"),
    _gain("diffusion", "density diffusion"),
    _gain("shift", "what the shift carries"),
    _gain("volume", "the volume constraint"),
    _gain("room", "what holds the density to the room of the particles"),
    _gain("spray", "densities of spray that are let go"),
    _gain("lift", "the shift in the field of gravity"),
)
"""what the budget gauge adds up"""

DELTA_FIELDS: tuple[Field, ...] = (
    *COMMON,
    *FLOW,
    Field("midway", "vec", "fluid", False, always, "m", "position in the middle of the step, for the continuity sweep"),
    Field("density_rate", "real", "fluid", False, always, "1/s", "of the density excess"),
    Field("room_part", "real", "fluid", False, _room, "1/s", "part of it that holds it to the room of the particles"),
    Field("flow_rate", "real", "fluid", False, _damping, "1/s", "of the density excess by the divergence of the velocity"),
    Field("settled", "real", "fluid", True, _relaxing, "Pa", "pressure of the density, late by the time of relaxation"),
    Field("slow_rate", "real", "fluid", False, _runge_kutta, "1/s", "part of it that is taken once a step"),
    Field("pressure_gradient", "vec", "fluid", True, _diffusion, "Pa/m", "corrected gradient of the last momentum sweep"),
    Field("pressure_sign", "int8", "fluid", True, _control, "-", "-1 where the own pressure acts by differences, else 1"),
    Field("wholeness", "real", "fluid", True, _surface, "-", "least eigenvalue of the moment: 1 inside, 1/2 at a surface"),
    Field("wholeness_old", "real", "fluid", False, _surface, "-", "that of the last momentum sweep"),
    *BUDGET_FIELDS,
)

ADVANCED: tuple[Field, ...] = tuple(
    dataclasses.replace(field, exists=_runge_kutta)
    for name in ("offset", "velocity", "density_excess")
    for field in DELTA_FIELDS
    if field.name == name
)
"""what the stages of Runge and Kutta advance, in this order; `work_fields` of them exist in those runs alone"""
