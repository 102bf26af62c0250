"""Checks between fields: inlets and outlets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from warpsph.case.checking import check_length
from warpsph.case.domain import AXES
from warpsph.case.drafts import Problems
from warpsph.errors import Problem


def check_open_sides(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    """What inlets and outlets need of each other and of the rest of a case."""
    found = [
        (f"domain.boundary.{AXES[axis]}.{name}", axis, side)
        for axis, sides in enumerate(case.sides)
        for name, side in (("lower", sides.lower), ("upper", sides.upper))
        if side.flow is not None
    ]
    if not found:
        return
    path, axis, side = found[0]
    word = side.flow.word
    for place, _, other in found:
        yield from _check_vectors(case, f"{place}.{other.flow.word}", other.flow)
    if not case.scheme.open_sides:
        rule = f"is nothing that the scheme {case.scheme.name} has"
        yield Problem(f"{path}.{word}", word, rule, "write numerics: {scheme: riemann}, or drive the flow by a body_force")
    for place, own, other in found:
        if own != axis:
            rule = f"stands at another axis than {path}; inlets and outlets can be at the sides of one axis alone"
            yield Problem(f"{place}.{other.flow.word}", other.flow.word, rule, "make that side a wall or periodic")
    for k, sides in enumerate(case.sides):
        for name, end in (("lower", sides.lower), ("upper", sides.upper)):
            if end.kind == "open":
                rule = "fluid would fly away there, which inlets and outlets do not go with"
                yield Problem(f"domain.boundary.{AXES[k]}.{name}", "open", rule, "make it a wall, an inlet or an outlet")
    given = all(other.flow.given_velocity is not None for _, _, other in found)
    if given and not case.scheme.free_pressure:
        rule = "leaves the pressure free: no side gives one"
        yield Problem(f"{path}.{word}", word, rule, "make one side an outlet: {pressure: 0}")
    if len(case.phases) > 1:
        rule = "goes with one phase alone"
        yield Problem(f"{path}.{word}", word, rule, "leave one of the phases, or make the sides walls or periodic")


def _check_vectors(case: Any, path: str, flow: Any) -> Problems:
    """Velocities have a component an axis."""
    if flow.given_velocity is not None:
        yield from check_length(case.dimension, f"{path}.velocity", flow.given_velocity)
    if flow.sponge is not None and flow.sponge.velocity is not None:
        yield from check_length(case.dimension, f"{path}.sponge.velocity", flow.sponge.velocity)
