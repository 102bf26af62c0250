"""The particle fields of the delta-plus scheme, beside those that every scheme of fluid flow has."""

import dataclasses

from warpsph.kernels.core.fields import COMMON, FLOW, Field, always
from warpsph.kernels.core.spec import Spec


def _diffusion(spec: Spec) -> bool:
    return spec.density_diffusion


def _runge_kutta(spec: Spec) -> bool:
    return spec.runge_kutta


def _control(spec: Spec) -> bool:
    return spec.tension_control


def _surface(spec: Spec) -> bool:
    return spec.free_surface


DELTA_FIELDS: tuple[Field, ...] = (
    *COMMON,
    *FLOW,
    Field("midway", "vec", "fluid", False, always, "m", "position in the middle of the step, for the continuity sweep"),
    Field("density_rate", "real", "fluid", False, always, "1/s", "of the density excess"),
    Field("slow_rate", "real", "fluid", False, _runge_kutta, "1/s", "part of it that is taken once a step"),
    Field("pressure_gradient", "vec", "fluid", True, _diffusion, "Pa/m", "corrected gradient of the last momentum sweep"),
    Field("pressure_sign", "int8", "fluid", True, _control, "-", "-1 where the own pressure acts by differences, else 1"),
    Field("wholeness", "real", "fluid", True, _surface, "-", "least eigenvalue of the moment: 1 inside, 1/2 at a surface"),
    Field("wholeness_old", "real", "fluid", False, _surface, "-", "that of the last momentum sweep"),
)

ADVANCED: tuple[Field, ...] = tuple(
    dataclasses.replace(field, exists=_runge_kutta)
    for name in ("offset", "velocity", "density_excess")
    for field in DELTA_FIELDS
    if field.name == name
)
"""what the stages of Runge and Kutta advance, in this order; `work_fields` of them exist in those runs alone"""
