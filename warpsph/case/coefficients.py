"""What makes coefficients of forces: the reference pressure of a stream, and the directions of drag and lift."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpsph.case.checking import check_length, known_phase
from warpsph.case.drafts import Problems, guarded
from warpsph.case.values import suggestion
from warpsph.errors import MISSING, Problem

RIGHT_ANGLE = 1e-6
"""Largest cosine between drag and lift."""


def reference_pressure(case: Any, gauge: Any) -> float:
    """Return q = density speed^2/2 of a gauge with the keys `speed`, `density` and `phase` [Pa]."""
    density = gauge.density
    if density is None:
        density = case.phases[gauge.phase or next(iter(case.phases))].density
    return 0.5 * float(density) * float(gauge.speed) ** 2


def stream_directions(gauge: Any, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit vectors of drag and lift, (d,) each, of a gauge with the keys `drag` and `lift`."""
    drag = np.asarray(gauge.drag or np.eye(dimension)[0], np.float64)
    drag = drag / np.linalg.norm(drag)
    lift = np.asarray(gauge.lift or (-drag[1], drag[0]), np.float64)
    return drag, lift / np.linalg.norm(lift)


def chosen_bodies(case: Any, gauge: Any) -> list[str]:
    """Return the bodies of a gauge with the key `bodies`: those that it names, or all."""
    return list(case.bodies) if gauge.bodies is None else list(gauge.bodies)


def chosen_body(case: Any, gauge: Any) -> str:
    """Return the body of a gauge with the key `body`: the one that it names, or the only one."""
    return str(next(iter(case.bodies))) if gauge.body is None else str(gauge.body)


def check_surface_stress(case: Any, path: str, gauge: Any) -> Problems:
    """A gauge along a surface has one body, and one density if it makes coefficients."""
    known = [str(name) for name in case.bodies]
    if not known:
        yield Problem(f"{path}.type", gauge.type, "needs a body", "add one, or use a gauge of type points at a wall")
    elif gauge.body is not None and gauge.body not in known:
        yield Problem(f"{path}.body", gauge.body, "is not one of the bodies", suggestion(gauge.body, known))
    elif gauge.body is None and len(known) > 1:
        rule = f"is missing, and the scene has {len(known)} bodies"
        yield Problem(f"{path}.body", MISSING, rule, f"write e.g. body: {known[0]}, with a gauge for each")
    if gauge.speed is not None:
        yield from check_reference_density(case, path, gauge)
        return
    for key in ("density", "phase", "far_pressure"):
        if key in gauge.model_fields_set:
            rule = "is for coefficients, and without speed there are none"
            yield Problem(f"{path}.{key}", getattr(gauge, key), rule, "add speed, or delete it")


def check_coefficients(case: Any, path: str, gauge: Any) -> Problems:
    """A gauge of coefficients has bodies, one density, an area in 3-D, and directions at right angles."""
    yield from check_bodies(case, path, gauge)
    yield from check_reference_density(case, path, gauge)
    yield from guarded(_check_directions(case, path, gauge))
    if case.dimension == 3 and gauge.area is None:
        rule = "is missing: in 3-D forces are divided by an area (dimension: 3)"
        yield Problem(f"{path}.area", MISSING, rule, "write e.g. area: pi*0.5**2, the frontal one, or that of the wing")
    elif case.dimension == 2 and gauge.area is not None:
        rule = "is of no use in 2-D, where forces are per metre of depth (dimension: 2)"
        yield Problem(f"{path}.area", gauge.area, rule, "delete it: they are divided by length")
    if gauge.pivot is not None:
        yield from guarded(check_length(case.dimension, f"{path}.pivot", gauge.pivot))


def check_bodies(case: Any, path: str, gauge: Any) -> Problems:
    """The scene has bodies, and a gauge names some of them, each once."""
    known = [str(name) for name in case.bodies]
    if not known:
        yield Problem(f"{path}.type", gauge.type, "needs bodies", "add one, or use a gauge of type wall_force")
        return
    if gauge.bodies is not None and not gauge.bodies:
        yield Problem(f"{path}.bodies", [], "names no body", f"delete it, or write e.g. bodies: [{known[0]}]")
    for position, name in enumerate(gauge.bodies or ()):
        if name not in known:
            yield Problem(f"{path}.bodies.{position}", name, "is not one of the bodies", suggestion(name, known))
        elif name in gauge.bodies[:position]:
            yield Problem(f"{path}.bodies.{position}", name, "is named twice", "delete one")


def check_reference_density(case: Any, path: str, gauge: Any) -> Problems:
    """One density for the reference pressure: a number, that of a phase, or that of the only phase."""
    if gauge.density is not None and gauge.phase is not None:
        yield Problem(f"{path}.density", gauge.density, f"is given beside phase: {gauge.phase}", "delete one of both")
    elif gauge.phase is not None:
        yield from known_phase(case, f"{path}.phase", gauge.phase)
    elif gauge.density is None and len(case.phases) > 1:
        rule = f"is missing, and the scene has {len(case.phases)} phases: coefficients need to know which one streams"
        yield Problem(f"{path}.phase", MISSING, rule, f"write e.g. phase: {next(iter(case.phases))}")


def _check_directions(case: Any, path: str, gauge: Any) -> Problems:
    """Drag and lift are vectors at right angles; in 3-D lift does not follow from drag."""
    right = True
    for key in ("drag", "lift"):
        vector = getattr(gauge, key)
        yield from check_length(case.dimension, f"{path}.{key}", vector)
        right &= not vector or len(vector) == case.dimension
        if vector and not any(vector):
            right = False
            remedy = f"write e.g. {key}: {[1] + [0] * (case.dimension - 1)}"
            yield Problem(f"{path}.{key}", list(vector), "has no direction", remedy)
    if case.dimension == 3 and not gauge.lift:
        rule = "is missing: in 3-D it does not follow from drag"
        yield Problem(f"{path}.lift", MISSING, rule, "write e.g. lift: [0, 0, 1]")
        return
    if not right:
        return
    drag, lift = stream_directions(gauge, case.dimension)
    if abs(drag @ lift) > RIGHT_ANGLE:
        angle = np.degrees(np.arccos(np.clip(drag @ lift, -1.0, 1.0)))
        rule = f"has to be at right angles to drag, it is at {angle:.4g} degrees"
        remedy = "delete it" if case.dimension == 2 else "turn one of both"
        yield Problem(f"{path}.lift", list(gauge.lift), rule, remedy)
