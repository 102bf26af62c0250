"""Checks between fields: phases and their tension, fluids, bodies, the start."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warpsph.case.checking import (
    check_corners,
    check_length,
    check_names,
    each,
    extent_of,
    known_phase,
)
from warpsph.case.domain import AXES
from warpsph.case.drafts import Problems, guarded
from warpsph.case.motion import check_motion
from warpsph.case.shapes import BODY_SHAPES
from warpsph.case.values import NAME
from warpsph.errors import MISSING, Problem

SIDES = tuple(f"{axis}_{end}" for axis in AXES for end in ("lower", "upper"))


def check_phases(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    used = {fluid.phase for fluid in case.fluids}
    # Where a fluid names an unknown phase, that is reported, and the phase it meant is not unused.
    if not used or not used <= set(case.phases):
        return
    for name in case.phases:
        if isinstance(name, str) and NAME.fullmatch(name) and name not in used:
            yield Problem(
                f"phases.{name}", MISSING, "is the phase of no fluid", "add a region to fluids or delete it"
            )


def check_tension(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    seen: set[frozenset[str]] = set()
    yield from each(_check_pair, list(enumerate(case.surface_tension)), case, seen)


def _check_pair(case: Any, seen: set[frozenset[str]], position: int, tension: Any) -> Problems:
    path = f"surface_tension.{position}.between"
    between = tension.between
    if len(between) != 2 or between[0] == between[1]:
        yield Problem(path, list(between), "needs two different phases", "write e.g. between: [gas, liquid]")
        return
    if frozenset(between) in seen:
        yield Problem(path, list(between), "names a pair of phases a second time", "delete one")
    seen.add(frozenset(between))
    for end, name in enumerate(between):
        yield from known_phase(case, f"{path}.{end}", name)
    if tension.contact_angle is not None and not case.has_walls:
        yield Problem(
            f"surface_tension.{position}.contact_angle",
            tension.contact_angle,
            "is the angle at a wall, and there is none",
            "delete it, or make a side of domain.boundary a wall or free_slip",
        )


def check_fluids(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    fluids = list(case.fluids)
    last = len(fluids) - 1

    def check(position: int, fluid: Any) -> Problems:
        yield from guarded(known_phase(case, f"fluids.{position}.phase", fluid.phase))
        if fluid.shape.kind == "rest" and position != last:
            yield Problem(
                f"fluids.{position}.shape",
                "rest",
                "has to be the last of fluids, and only once",
                "move it to the end",
            )

    yield from each(check, enumerate(fluids))
    shapes = ((f"fluids.{position}.shape", fluid) for position, fluid in enumerate(fluids))
    yield from each(_check_shape, shapes, case)


def check_bodies(case: Any, folder: Path | None, _raw: Any) -> Problems:
    def check(name: str, body: Any) -> Problems:
        if name == "domain" or name in SIDES:
            yield Problem(f"bodies.{name}", name, "is the name of sides of the domain in gauges", "choose another name")
        path = f"bodies.{name}.shape"
        if body.shape.kind == "rest":
            yield Problem(path, "rest", "is for fluids only", f"use one of {', '.join(BODY_SHAPES)}")
        if body.shape.airfoil is not None:
            path = f"{path}.airfoil"
            if case.dimension != 2:
                yield Problem(path, "airfoil", "needs dimension: 2", "use stl")
            yield from check_length(2, f"{path}.position", body.shape.airfoil.position)
            yield from _check_there(folder, path, body.shape.airfoil.file)
        if body.shape.stl is not None:
            path = f"{path}.stl"
            if case.dimension != 3:
                yield Problem(path, "stl", "needs dimension: 3", "use polygon, where or airfoil")
            yield from check_length(3, f"{path}.translate", body.shape.stl.translate)
            yield from _check_there(folder, path, body.shape.stl.file)

    def motion(name: str, body: Any) -> Problems:
        if body.motion is not None:
            yield from check_motion(f"bodies.{name}.motion", body.motion, case.dimension, folder, case.end_time)

    yield from each(motion, list(case.bodies.items()))
    yield from each(check, list(case.bodies.items()))
    yield from each(_check_shape, [(f"bodies.{name}.shape", body) for name, body in case.bodies.items()], case)


def _check_there(folder: Path | None, path: str, file: str | None) -> Problems:
    if folder is not None and file is not None and not (folder / file).is_file():
        yield Problem(f"{path}.file", file, "names no file", f"paths are relative to {folder}")


def _check_shape(case: Any, path: str, owner: Any) -> Problems:
    """Lengths of vectors, order of corners, place in the domain, of one shape."""
    shape = owner.shape
    dimension = case.dimension
    path = f"{path}.{shape.kind}"
    box: tuple[Sequence[float], Sequence[float]] | None = None
    if shape.box is not None:
        yield from check_length(dimension, f"{path}.lower", shape.box.lower)
        yield from check_length(dimension, f"{path}.upper", shape.box.upper)
        yield from check_corners(dimension, path, shape.box.lower, shape.box.upper)
        box = shape.box.lower, shape.box.upper
    elif shape.sphere is not None:
        yield from check_length(dimension, f"{path}.center", shape.sphere.center)
        radius = shape.sphere.radius
        box = [c - radius for c in shape.sphere.center], [c + radius for c in shape.sphere.center]
    elif shape.polygon is not None:
        points = shape.polygon.points
        if dimension != 2:
            yield Problem(path, MISSING, "a polygon needs dimension: 2", "use box, sphere or where")
            return
        if len(points) < 3:
            yield Problem(
                f"{path}.points", [list(point) for point in points], "needs at least 3 corners", "add some"
            )
            return
        for position, point in enumerate(points):
            yield from check_length(dimension, f"{path}.points.{position}", point)
        if all(len(point) == 2 for point in points):
            box = [min(p[k] for p in points) for k in (0, 1)], [max(p[k] for p in points) for k in (0, 1)]
            area = (
                sum(p[0] * q[1] - q[0] * p[1] for p, q in zip(points, (*points[1:], points[0]), strict=True))
                / 2
            )
            if abs(area) <= 1e-12 * (box[1][0] - box[0][0]) * (box[1][1] - box[0][1]):
                yield Problem(
                    f"{path}.points",
                    [list(point) for point in points],
                    "encloses no area",
                    "list the corners in order around the region",
                )
                return
    elif shape.where is not None:
        yield from check_names(case, f"{path}.condition", shape.where.condition)
    if box is None or extent_of(case) is None or not len(box[0]) == len(box[1]) == dimension:
        return
    for k, axis in enumerate(AXES[:dimension]):
        if box[0][k] >= case.domain.upper[k] or box[1][k] <= case.domain.lower[k]:
            yield Problem(
                path, MISSING, f"lies outside the domain along {axis}", "move it or enlarge the domain"
            )


def check_start(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    def velocity() -> Problems:
        for position, formula in enumerate(case.start.velocity):
            yield from check_names(case, f"start.velocity.{position}", formula)

    def pressure() -> Problems:
        yield from check_names(case, "start.pressure", case.start.pressure)
        if case.start.pressure == "hydrostatic":
            for axis, g in zip(AXES[: case.dimension], case.gravity, strict=False):
                if g != 0 and getattr(case.domain.boundary, axis).periodic:
                    yield Problem(
                        "start.pressure",
                        case.start.pressure,
                        f"cannot be hydrostatic along the periodic axis {axis} with gravity",
                        "use none, a wall, or body_force",
                    )

    def density() -> Problems:
        yield from check_names(case, "start.density", case.start.density)
        if case.scheme.varying_density:
            return
        if case.start.density is not None:
            rule = f"varies the density, which scheme: {case.scheme.name} does not know"
            yield Problem("start.density", case.start.density.text, rule, "delete it, or write numerics: {scheme: gas}")
        if case.start.arrangement == "equal_mass":
            rule = f"is for a density that varies, which scheme: {case.scheme.name} does not know"
            yield Problem("start.arrangement", "equal_mass", rule, "write auto, or numerics: {scheme: gas}")

    yield from guarded(velocity())
    yield from guarded(pressure())
    yield from guarded(density())
