"""Schemes whose domains fluid may flow through, and what inlets and outlets need of the rest of a case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from warpsph.errors import MISSING, CaseError, Problem
from warpsph.schemes.base import Scheme

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.engine.population import Population
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics


class FlowThrough(Scheme):
    """A scheme of fluid flow with inlets and outlets: room for what comes, numbers of the sides, flow rates."""

    open_sides = True
    kept: tuple[str, ...] = ("side_memory", "site_ahead", "face_pressure", "face_velocity", "through")

    def room(self, case: Any, geometry: Geometry, physics: Physics) -> int:
        """Return room for the fluid, and for the buffers of inlets and outlets."""
        from warpsph.schemes import open_run

        if physics.spec.open_axis < 0:
            return geometry.fluid_count
        return open_run.room(open_run.open_run(case, geometry, physics), geometry.fluid_count)

    def flow_rates(self, case: Any, geometry: Geometry, physics: Physics, bindings: Mapping[str, Any]) -> dict[str, float]:
        """Return the flow, mass and pressure of each inlet and outlet."""
        from warpsph.schemes import open_run

        if physics.spec.open_axis < 0:
            return {}
        return open_run.flow_rates(case, geometry, physics, bindings)

    def fill_zone(self, population: Population, geometry: Geometry, physics: Physics) -> None:
        """Put all particles of the start into the domain, where others are beyond its sides."""
        import numpy as np

        if physics.spec.open_axis >= 0:
            population.put("zone", np.ones(geometry.fluid_count))

    def open_values(self, case: Any, geometry: Geometry, physics: Physics, device: Any) -> dict[str, Any]:
        """Return the kernel arguments of inlets and outlets by name, none without them."""
        from warpsph.schemes import open_run

        if physics.spec.open_axis < 0:
            return {}
        return open_run.arguments(open_run.open_run(case, geometry, physics), case, geometry, physics, device)


def held_volume(case: Any) -> Iterator[Problem]:
    """Yield why `numerics.volume_constraint: true` does not go with the sides of a case, if that is so."""
    if case.numerics.volume_constraint is not True:
        return
    for axis, sides in zip("xyz", case.sides, strict=False):
        if "open" in (sides.lower.kind, sides.upper.kind):
            rule = f"needs a closed or periodic domain, {axis} is open"
            yield Problem("numerics.volume_constraint", True, rule, "write auto or false")
    if case.has_flow_through:
        rule = "needs a closed or periodic domain; inlets and outlets give the pressure"
        yield Problem("numerics.volume_constraint", True, rule, "write auto or false")


def given_pressures(case: Any) -> Iterator[Problem]:
    """Yield that `numerics.acoustic_relaxation` does not go with inlets and outlets, if a case has both."""
    relaxed = case.numerics.acoustic_relaxation
    if relaxed != "auto" and relaxed > 0 and case.has_flow_through:
        rule = "knows no inlets and outlets, whose buffers have a pressure of their own"
        yield Problem("numerics.acoustic_relaxation", relaxed, rule, "write auto or 0, or use numerics.acoustic_damping")


def room_left(case: Case, filled: bool) -> Iterator[Problem]:
    """Yield that the fluid has a free surface (not `filled`), where there are inlets or outlets."""
    if case.has_flow_through and not filled:
        rule = "leave room in the domain; with inlets or outlets the fluid has to fill it"
        yield Problem("fluids", MISSING, rule, "add {phase: ..., shape: rest} at the end")


def check_filled(case: Case, filled: bool) -> None:
    """Refuse a free surface with inlets or outlets. Raises CaseError."""
    problems = list(room_left(case, filled))
    if problems:
        raise CaseError(problems)
