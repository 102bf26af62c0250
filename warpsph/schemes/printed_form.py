"""What a case may ask of the printed forms of the Riemann scheme and of ISPH (theory: printed#yang, printed#qiu)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from warpsph.errors import Problem

# Value of each key that belongs to the printed form; others are those of the default form.
PRINTED_VALUES: dict[str, Any] = {
    "pressure_gradient": "conservative",
    "viscosity_form": "paper",
    "viscous_stages": 1,
    "star_states": "arithmetic",
    "tension_form": "body_force",
    "shifting": 0,
    "volume_constraint": False,
    "room_rate": 0,
    "acoustic_damping": 0,
    "acoustic_relaxation": 0,
    "disorder_friction": 0,
    "spared_gradient": "gravity",
}


PRINTED_PROJECTION: dict[str, Any] = {
    "pressure_gradient": "conservative",
    "viscosity_form": "morris",
    "time_order": 1,
    "relaxed_divergence": False,
    "deferred_correction": False,
    "surface_offset": 0,
    "volume_feedback": 0,
    "velocity_filter": 0,
    "implicit_viscosity": False,
}
REMEDY = "write numerics.formulation: improved"
UNKNOWN = "is not known to the printed form (numerics.formulation: paper)"


def printed_scene(case: Any, values: dict[str, Any]) -> Iterator[Problem]:
    """Yield keys with other values than the printed ones, bodies, inlets and outlets."""
    for key, printed in values.items():
        value = getattr(case.numerics, key)
        if value not in ("auto", printed):
            rule = f"is none of the printed form, which has {str(printed).lower()}"
            yield Problem(f"numerics.{key}", value, rule, f"write auto, or {REMEDY.removeprefix('write ')}")
    for name in case.bodies:
        yield Problem(f"bodies.{name}", "a body", UNKNOWN, REMEDY)
    if case.has_flow_through:
        yield Problem("domain.boundary", "an inlet or outlet", UNKNOWN, REMEDY)


def printed_projection(case: Any) -> Iterator[Problem]:
    """Yield what the printed form of ISPH does not have: keys of the default form, bodies, flow through."""
    yield from printed_scene(case, PRINTED_PROJECTION)


def printed_form(case: Any) -> Iterator[Problem]:
    """Yield what the printed form does not have: keys of the default form, bodies, flow through, contact angles."""
    remedy = REMEDY
    yield from printed_scene(case, PRINTED_VALUES)
    rule = UNKNOWN
    for number, pair in enumerate(case.surface_tension):
        if pair.contact_angle is not None:
            yield Problem(f"surface_tension.{number}.contact_angle", pair.contact_angle, rule, remedy)
    if case.has_surface_tension and len(case.phases) > 2:
        colours = "has one colour, 0 in one phase and 1 in the other, in the printed form (numerics.formulation: paper)"
        yield Problem("surface_tension", f"{len(case.phases)} phases", colours, remedy)
