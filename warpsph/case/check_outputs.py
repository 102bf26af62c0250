"""Checks between fields: output and gauges."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.checking import check_length, check_often, each, extent_of, known_phase
from warpsph.case.coefficients import check_coefficients, check_surface_stress
from warpsph.case.domain import AXES
from warpsph.case.drafts import Problems, guarded
from warpsph.case.sensors import NoPlane, face_radius, wall_normal
from warpsph.errors import Problem

_INTERFACE_FIELDS = ("normal", "curvature")


def check_output(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    def particles() -> Problems:
        if case.output.particles is not None:
            yield from check_interface_fields(case, "output.particles.fields", case.output.particles.fields)

    parts = (("particles", lambda: case.output.particles), ("checkpoint", lambda: case.output.checkpoint))
    yield from guarded(particles())
    yield from guarded(_check_lyapunov(case))
    for name, read in parts:
        yield from guarded(check_often(case, f"output.{name}.interval", read))


def _check_lyapunov(case: Any) -> Problems:
    """Exponents are fields of particle files, and a scheme has to follow where particles were."""
    if case.output.lyapunov is None:
        return
    path = "output.lyapunov"
    if not case.scheme.follows_origins:
        rule = f"scheme: {case.scheme.name} does not follow where particles were"
        yield Problem(path, case.output.lyapunov.window, rule, "take another scheme, or delete it")
    if case.output.particles is None:
        rule = "is written to particle files, and there are none"
        yield Problem(path, case.output.lyapunov.window, rule, "delete it, or write output.particles")


def check_interface_fields(case: Any, path: str, fields: Sequence[str]) -> Problems:
    """Normals and curvature exist only with surface tension."""
    wanted = [name for name in fields if name in _INTERFACE_FIELDS]
    if wanted and len(case.surface_tension) == 0:
        yield Problem(
            path, list(fields), f"{', '.join(wanted)} needs surface_tension", "delete it from the list"
        )


def check_gauges(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    yield from each(_check_gauge, list(case.gauges.items()), case)


def _check_gauge(case: Any, name: Any, gauge: Any) -> Problems:
    path = f"gauges.{name}"
    yield from guarded(check_often(case, f"{path}.interval", lambda: gauge))
    if gauge.type == "wall_force":
        if not case.has_walls:
            yield Problem(
                f"{path}.type", gauge.type, "needs a wall or a body", "delete the gauge or add a wall"
            )
        if gauge.pivot is not None:
            yield from guarded(check_length(case.dimension, f"{path}.pivot", gauge.pivot))
            if not case.bodies:
                yield Problem(
                    f"{path}.pivot", list(gauge.pivot), "needs bodies: torque is that on bodies", "delete it"
                )
    elif gauge.type == "force_coefficients":
        yield from guarded(check_coefficients(case, path, gauge))
    elif gauge.type == "surface_stress":
        yield from guarded(check_surface_stress(case, path, gauge))
    elif gauge.type == "budget":
        yield from guarded(_check_budget(case, path, gauge))
    elif gauge.type == "contour":
        if case.dimension != 2:
            yield Problem(f"{path}.type", gauge.type, "needs dimension: 2", "use extents")
    elif gauge.type in ("deformation", "fragments"):
        for position, phase in enumerate(gauge.phases or ()):
            yield from known_phase(case, f"{path}.phases.{position}", phase)
    elif gauge.type == "lens":
        yield from known_phase(case, f"{path}.phase", gauge.phase)
        if case.dimension != 2 or len(case.phases) != 3:
            yield Problem(f"{path}.type", gauge.type, "needs dimension: 2 and three phases", "use contour or extents")
    elif gauge.type == "interface_length":
        if len(case.phases) < 2:
            yield Problem(f"{path}.type", gauge.type, "needs at least two phases", "delete the gauge")
    elif gauge.type == "interface_wave":
        yield from known_phase(case, f"{path}.phase", gauge.phase)
        yield from guarded(_check_wave(case, path, gauge))
    elif gauge.type == "elevation":
        for position, place in enumerate(gauge.places):
            yield from guarded(_check_place(case, f"{path}.places.{position}", place))
    elif gauge.type == "points":
        for position, point in enumerate(gauge.points):
            yield from guarded(check_length(case.dimension, f"{path}.points.{position}", point))
        yield from check_interface_fields(case, f"{path}.fields", gauge.fields)
        yield from guarded(_check_faces(case, path, gauge))
    elif gauge.type == "flow_rate":
        if not case.has_flow_through:
            yield Problem(f"{path}.type", gauge.type, "needs an inlet or an outlet", "delete the gauge")
    elif gauge.type in ("line", "reattachment"):
        yield from guarded(check_length(case.dimension, f"{path}.from", gauge.from_))
        yield from guarded(check_length(case.dimension, f"{path}.to", gauge.to))
        if gauge.from_ == gauge.to:
            yield Problem(
                f"{path}.to", list(gauge.to), "is the same point as from", "use a gauge of type points"
            )
        elif gauge.type == "reattachment" and gauge.wall is not None:
            yield from guarded(_check_wall(case, path, gauge))
        yield from check_interface_fields(case, f"{path}.fields", gauge.fields)


def _check_wall(case: Any, path: str, gauge: Any) -> Problems:
    """A point off the line, for the line has to run beside the wall."""
    yield from check_length(case.dimension, f"{path}.wall", gauge.wall)
    way, off = np.subtract(gauge.to, gauge.from_), np.subtract(gauge.from_, gauge.wall)
    if np.linalg.norm(off - way * (off @ way) / (way @ way)) < 1e-6 * case.spacing:
        rule = "lies on the line itself, which has to run a little off the wall"
        yield Problem(f"{path}.wall", list(gauge.wall), rule, "move from and to half a spacing or a spacing into the fluid")


def _check_budget(case: Any, path: str, gauge: Any) -> Problems:
    """A scheme that can follow the budget, in steps that are added up exactly, of particles that stay."""
    where = f"{path}.type"
    if not case.scheme.budgets:
        rule = f"does not act with scheme: {case.scheme.name}"
        yield Problem(where, gauge.type, rule, "write numerics.scheme: delta_plus, or delete the gauge")
    elif case.numerics.integrator == "rk4" or (case.numerics.integrator == "auto" and case.numerics.formulation == "paper"):
        rule = "follows the steps of the leapfrog"
        yield Problem(where, gauge.type, rule, "write numerics.integrator: leapfrog, or delete the gauge")
    elif case.has_flow_through:
        yield Problem(where, gauge.type, "does not know what comes through inlets and outlets", "delete the gauge")


def _check_wave(case: Any, path: str, gauge: Any) -> Problems:
    """An axis along the interface, and whole waves in the domain: else the rest of a wave would count as one."""
    along = AXES.index(gauge.axis)
    if along >= case.dimension - 1:
        rule = f"has to lie in the interface, which the axis {AXES[case.dimension - 1]} crosses"
        yield Problem(f"{path}.axis", gauge.axis, rule, "write x" if case.dimension > 1 else "delete the gauge")
        return
    waves = (case.domain.upper[along] - case.domain.lower[along]) / gauge.wavelength
    if round(waves) < 1 or abs(waves - round(waves)) > 1e-6 * waves:
        rule = f"the domain holds {waves:.6g} of it along {gauge.axis}; needs a whole number"
        yield Problem(f"{path}.wavelength", gauge.wavelength, rule, "divide the length of the domain by a whole number")


def _check_place(case: Any, path: str, place: Sequence[float]) -> Problems:
    """A place of an elevation gauge has a coordinate for each axis but the last."""
    wanted = case.dimension - 1
    if len(place) != wanted:
        rule = f"needs {wanted} number{'s' if wanted > 1 else ''} (dimension: {case.dimension}), all axes but the last"
        yield Problem(path, list(place), rule, f"write e.g. {[0] * wanted}")


def _check_faces(case: Any, path: str, gauge: Any) -> Problems:
    """The faces of sensors have a plane and lie within the domain."""
    normal = gauge.normal
    if gauge.area is None:
        if normal is not None:
            yield Problem(f"{path}.normal", list(normal), "is that of an area, and there is none", "add area, or delete it")
        return
    yield from check_length(case.dimension, f"{path}.normal", normal or ())
    if normal is not None and not any(normal):
        rule = "has no direction"
        yield Problem(f"{path}.normal", list(normal), rule, "write that of the wall, e.g. normal: [1, 0]")
    elif normal is None or len(normal) == case.dimension:
        points = [(position, point) for position, point in enumerate(gauge.points) if len(point) == case.dimension]
        yield from each(_check_face, points, case, path, gauge)


def _check_face(case: Any, path: str, gauge: Any, position: int, point: Sequence[float]) -> Problems:
    """The face around one point."""
    where = f"{path}.points.{position}"
    try:
        normal = wall_normal(case, point) if gauge.normal is None else np.asarray(gauge.normal, np.float64)
    except NoPlane as reason:
        yield Problem(where, list(point), str(reason), "move it to the wall, or give normal")
        return
    extent = extent_of(case)
    if extent is None:
        return
    across = np.sqrt(np.maximum(1.0 - (normal / np.linalg.norm(normal)) ** 2, 0.0))
    reach = face_radius(gauge.area, case.dimension) * across
    for k, axis in enumerate(AXES[: case.dimension]):
        lower, upper = case.domain.lower[k], case.domain.upper[k]
        first, last = point[k] - reach[k], point[k] + reach[k]
        slack = 1e-9 * extent[k]
        if reach[k] > 0 and not getattr(case.domain.boundary, axis).periodic and not (
            lower - slack <= first and last <= upper + slack
        ):
            rule = f"its area reaches from {axis} = {first:.4g} to {last:.4g} m, the domain from {lower:g} to {upper:g} m"
            yield Problem(where, list(point), rule, "move the point, or lower area")
