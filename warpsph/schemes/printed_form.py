"""What a case may ask of the printed form of the Riemann scheme (theory: printed#yang)."""

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
}


def printed_form(case: Any) -> Iterator[Problem]:
    """Yield what the printed form does not have: keys of the default form, bodies, flow through, contact angles."""
    remedy = "write numerics.formulation: improved"
    for key, printed in PRINTED_VALUES.items():
        value = getattr(case.numerics, key)
        if value not in ("auto", printed):
            rule = f"is none of the printed form, which has {str(printed).lower()}"
            yield Problem(f"numerics.{key}", value, rule, f"write auto, or {remedy.removeprefix('write ')}")
    rule = "is not known to the printed form (numerics.formulation: paper)"
    for name in case.bodies:
        yield Problem(f"bodies.{name}", "a body", rule, remedy)
    if case.has_flow_through:
        yield Problem("domain.boundary", "an inlet or outlet", rule, remedy)
    for number, pair in enumerate(case.surface_tension):
        if pair.contact_angle is not None:
            yield Problem(f"surface_tension.{number}.contact_angle", pair.contact_angle, rule, remedy)
    if case.has_surface_tension and len(case.phases) > 2:
        colours = "has one colour, 0 in one phase and 1 in the other, in the printed form (numerics.formulation: paper)"
        yield Problem("surface_tension", f"{len(case.phases)} phases", colours, remedy)
