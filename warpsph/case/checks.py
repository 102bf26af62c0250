"""What is wrong with a case: pydantic's errors in the words of the case file, and the checks between fields.

`report` turns the errors of single fields into Problems, with the paths that the user wrote. `cross_check`
compares fields with each other. So that a faulty file gets both at once, `draft` reads as much as is right
of it; a check that meets a value that could not be read ends quietly, since that value has been reported.
"""

from __future__ import annotations

import csv
import dataclasses
import functools
import math
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel, Tag, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from warpsph.case.case import (
    AXES,
    GAUGES,
    REFERENCES,
    SHAPES,
    SUPPORT_RATIO,
    AxisBoundary,
    Case,
    Domain,
    Numerics,
    Output,
    ReferenceCurve,
    ReferenceCurves,
    ReferenceExact,
    ReferenceInterface,
    ReferenceValue,
    Scales,
    Start,
)
from warpsph.case.expressions import Expression
from warpsph.case.values import NAME, CaseModel, example, formula_text, suggestion
from warpsph.errors import MISSING, ExpressionError, Problem
from warpsph.measure.sensors import NoPlane, face_radius, wall_normal
from warpsph.schemes.magnitudes import check_inputs

# ----------------------------------------------------------------------------------------------------------
# the report: pydantic's errors in the words and paths of the case file


def _keys(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """The keys of a model as a file writes them."""
    return {info.alias or name: info for name, info in model.model_fields.items()}


def _members(annotation: Any) -> Iterator[tuple[str | None, Any]]:
    """The parts of a union, each with its tag."""
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *metadata = get_args(annotation)
        tag = next((item.tag for item in metadata if isinstance(item, Tag)), None)
        for inner_tag, member in _members(inner):
            yield tag or inner_tag, member
    elif origin is Union or origin is types.UnionType:
        for part in get_args(annotation):
            yield from _members(part)
    else:
        yield None, annotation


def _step(annotation: Any, part: Any) -> tuple[Any, FieldInfo | None]:
    """Annotation (and field) that `part` of an error's place leads to."""
    for tag, member in _members(annotation):
        if tag is not None and tag == part:
            return member, None
        if isinstance(member, type) and issubclass(member, BaseModel):
            info = _keys(member).get(part) if isinstance(part, str) else None
            if info is not None:
                return info.annotation, info
        elif get_args(member):
            arguments = get_args(member)
            return arguments[0 if get_origin(member) in (tuple, list) else -1], None
    return None, None


def _model_at(place: Sequence[Any]) -> tuple[type[BaseModel] | None, FieldInfo | None]:
    """The model (if it is one) and the field (if it is one) at an error's place."""
    annotation: Any = Case
    info: FieldInfo | None = None
    for part in place:
        annotation, info = _step(annotation, part)
        if annotation is None:
            return None, None
    models = [m for _, m in _members(annotation) if isinstance(m, type) and issubclass(m, BaseModel)]
    return (models[0] if len(models) == 1 else None), info


_TAGS = frozenset(f"<{name}>" for name in (*GAUGES, *REFERENCES))


def _dig(data: Any, *keys: Any) -> Any:
    """Entry of nested plain data, MISSING if there is none."""
    for key in keys:
        if isinstance(data, Mapping) and key in data:
            data = data[key]
        elif isinstance(data, list | tuple) and isinstance(key, int) and -len(data) <= key < len(data):
            data = data[key]
        else:
            return MISSING
    return data


def _user_path(place: Sequence[Any], raw: Any) -> tuple[str, ...]:
    """Place of an error as steps of the user's file."""
    steps = [part for part in place if part not in _TAGS and part != "[key]"]
    if steps[:2] == ["domain", "boundary"] and len(steps) > 3 and steps[3] in ("lower", "upper"):
        written = _dig(raw, *steps[:3])
        if isinstance(written, Mapping) and not {"lower", "upper"} & written.keys():
            del steps[3]
    return tuple(str(step) for step in steps)


@functools.cache
def _homes() -> dict[str, list[str]]:
    """Sections in which each key is at home, for keys that stand in the wrong one."""
    homes: dict[str, list[str]] = {}
    sections: dict[str, type[BaseModel]] = {
        "": Case, "domain": Domain, "start": Start, "scales": Scales, "numerics": Numerics, "output": Output,
    }  # fmt: skip
    for section, model in sections.items():
        for key in _keys(model):
            homes.setdefault(key, []).append(f"{section}.{key}" if section else key)
    return homes


def _unknown_key(place: Sequence[Any]) -> tuple[str, str | None]:
    """Remedy for an unknown key, and the key that was meant if one is close."""
    key = place[-1]
    model, _ = _model_at(place[:-1])
    known = list(_keys(model)) if model is not None else []
    remedy = suggestion(key, known)
    if remedy.startswith("did you mean"):
        return remedy, remedy.removeprefix("did you mean ").removesuffix("?")
    homes = _homes().get(key, []) if isinstance(key, str) else []
    if len(homes) == 1:
        return f"this key is at home at {homes[0]}", None
    return (f"keys here: {', '.join(known)}" if known else "delete it"), None


def report(error: ValidationError, raw: Any) -> list[Problem]:
    """One Problem for each of pydantic's errors."""
    problems: list[Problem] = []
    meant: set[tuple[str, ...]] = set()
    missing: list[tuple[tuple[str, ...], Problem]] = []
    for item in error.errors(include_url=False):
        place = item["loc"]
        steps = _user_path(place, raw)
        path = ".".join(steps) or "(case)"
        kind = item["type"]
        context = item.get("ctx", {})
        value = item.get("input")
        model, info = _model_at(place)
        remedy = f"write e.g. {steps[-1]}: {example(info)}" if info is not None and info.examples else ""
        if kind == "missing":
            rule = f"is required ({info.description})" if info is not None else "is required"
            missing.append((steps, Problem(path, MISSING, rule, remedy.replace("write e.g.", "add e.g."))))
            continue
        if kind == "extra_forbidden":
            rule = "is not a known key"
            remedy, close = _unknown_key(place)
            if close is not None:
                meant.add((*steps[:-1], close))
        elif kind == "case":
            rule = context["rule"]
            remedy = context["remedy"] or remedy
        elif value is None:
            rule = "has no value"
            remedy = remedy or "give one or delete the key"
        elif kind in ("model_type", "model_attributes_type", "dict_type", "mapping_type"):
            rule = "needs a mapping" + (
                f" with keys among {', '.join(_keys(model))}" if model is not None else ""
            )
        elif kind == "too_short":
            rule = f"needs at least {context.get('min_length', 1)} entry"
        elif kind == "string_type":
            rule = "needs text"
            remedy = "put it in quotes"
        elif kind == "invalid_key":
            rule = "is not a known key; keys are text"
            remedy = "delete it"
        else:
            rule = str(item["msg"])
        problems.append(Problem(path, value, rule, remedy))
    # A misspelt required key is one problem, not two.
    problems += [problem for steps, problem in missing if steps not in meant]
    return problems


def in_order(problems: Iterable[Problem]) -> list[Problem]:
    """Problems without doubles, in the order of the case's sections."""
    order = {key: position for position, key in enumerate(_keys(Case))}
    unique = {(problem.path, problem.rule): problem for problem in problems}
    return sorted(unique.values(), key=lambda problem: order.get(problem.path.split(".")[0], -1))


# ----------------------------------------------------------------------------------------------------------
# what can be read of a faulty case


class _SkipCheck(Exception):
    """A check touched a value that is reported already."""


class _UnknownValue:
    """Stands in a draft for a value that could not be read; any use of it ends the check that uses it."""

    def _skip(self, *_args: Any) -> Any:
        raise _SkipCheck

    __getattr__ = __iter__ = __len__ = __bool__ = __getitem__ = __contains__ = __float__ = __int__ = _skip
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __hash__ = _skip
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __neg__ = (
        _skip
    )
    __index__ = __abs__ = __str__ = __repr__ = __format__ = _skip


_UNKNOWN: Any = _UnknownValue()


@functools.cache
def _adapter(model: type[BaseModel], name: str) -> TypeAdapter[Any]:
    info = model.model_fields[name]
    annotation: Any = info.annotation
    return TypeAdapter(Annotated[(annotation, *info.metadata)] if info.metadata else annotation)


@functools.cache
def _part_adapter(key: int) -> TypeAdapter[Any]:
    return TypeAdapter(_PARTS[key])


_PARTS: dict[int, Any] = {}


def draft(model: type[BaseModel], raw: Any) -> Any:
    """Attributes of `model` as far as they can be read from `raw`; the others are _UNKNOWN."""
    draft = SimpleNamespace()
    for name, info in model.model_fields.items():
        key = info.alias or name
        if key in raw:
            value = _draft_value(_adapter(model, name), info.annotation, raw[key])
        else:
            value = _UNKNOWN if info.is_required() else info.get_default(call_default_factory=True)
        setattr(draft, name, value)
    return draft


def _draft_value(adapter: TypeAdapter[Any], annotation: Any, raw: Any) -> Any:
    """`raw` as its type if it is right; else what is right of its parts; else _UNKNOWN."""
    try:
        return adapter.validate_python(raw)
    except ValidationError:
        pass
    if isinstance(raw, Mapping) and isinstance(raw.get("type"), str):
        # Parts of a faulty gauge can be read once its type is known.
        annotation = next(
            (member for tag, member in _members(annotation) if tag == f"<{raw['type']}>"), annotation
        )
    if isinstance(annotation, type) and issubclass(annotation, CaseModel):
        return draft(annotation, raw) if isinstance(raw, Mapping) and not annotation.opaque else _UNKNOWN
    arguments = get_args(annotation)
    if get_origin(annotation) is tuple and isinstance(raw, list | tuple) and _holds_models(arguments[0]):
        return tuple(_draft_part(arguments[0], item) for item in raw)
    if isinstance(raw, Mapping) and len(arguments) == 2 and _holds_models(arguments[1]):
        return {key: _draft_part(arguments[1], item) for key, item in raw.items()}
    return _UNKNOWN


def _holds_models(annotation: Any) -> bool:
    return any(
        isinstance(member, type) and issubclass(member, BaseModel) for _, member in _members(annotation)
    )


def _draft_part(annotation: Any, raw: Any) -> Any:
    _PARTS[id(annotation)] = annotation
    return _draft_value(_part_adapter(id(annotation)), annotation, raw)


# ----------------------------------------------------------------------------------------------------------
# cross checks: each yields the problems of one aspect; a check that meets a value that could not be read
# ends there


_Problems = Iterator[Problem]

_AUTO_SUPPORT = 2 * 1.5
"""Support radius in particle spacings that is assumed while `smoothing_ratio` is `auto`."""

_INTERFACE_FIELDS = ("normal", "curvature")
_MOST_PARTICLES = 2**31 - 1
_MOST_OUTPUTS = 1_000_000


def cross_check(case: Any, folder: Path | None, raw: Any) -> list[Problem]:
    """All problems between the fields of `case` (a Case or the draft of one)."""
    return [_as_written(problem, raw) for check in _CHECKS for problem in _guarded(check(case, folder, raw))]


def _as_written(problem: Problem, raw: Any) -> Problem:
    """The problem with its value as it stands in the file, not as it was understood."""
    steps = [int(step) if step.isdecimal() else step for step in problem.path.split(".")]
    written = _dig(raw, *steps)
    return problem if written is MISSING else dataclasses.replace(problem, value=written)


def _guarded(problems: _Problems) -> _Problems:
    """The problems of one check up to the point where it meets a value that could not be read."""
    try:
        yield from problems
    except _SkipCheck:
        return


def _each(check: Callable[..., _Problems], items: Iterable[tuple[Any, ...]], *common: Any) -> _Problems:
    """Run one check for each of several items, so that a faulty item does not hide the others."""
    for item in items:
        yield from _guarded(check(*common, *item))


def _texts(vector: Sequence[Any]) -> list[Any]:
    return [formula_text(entry) for entry in vector]


def _check_length(dimension: int, path: str, vector: Sequence[Any]) -> _Problems:
    """A vector has one entry an axis (an empty one is a default that is filled in later)."""
    if vector and len(vector) != dimension:
        key = path.split(".")[-1]
        example = (
            f"write e.g. {key}: {[0] * dimension}" if not key.isdecimal() else f"write e.g. {[0] * dimension}"
        )
        yield Problem(path, _texts(vector), f"needs {dimension} numbers (dimension: {dimension})", example)


def _check_corners(dimension: int, path: str, lower: Sequence[float], upper: Sequence[float]) -> _Problems:
    """The upper corner of a box is above the lower one."""
    if len(lower) == len(upper) == dimension:
        for axis, a, b in zip(AXES, lower, upper, strict=False):
            if not a < b:
                yield Problem(
                    f"{path}.upper",
                    list(upper),
                    f"has to be above lower on the {axis} axis ({b:g} <= {a:g})",
                    "swap or correct the corners",
                )


def _vectors(case: Any) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Path and value of every vector of the case, each read only when asked for."""
    yield "domain.lower", lambda: case.domain.lower
    yield "domain.upper", lambda: case.domain.upper
    yield "gravity", lambda: case.gravity
    yield "body_force", lambda: case.body_force
    if getattr(case, "central_force", None) is not None:
        yield "central_force.center", lambda: case.central_force.center
    yield "start.velocity", lambda: case.start.velocity


def _check_vectors(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    def check(dimension: int, path: str, read: Callable[[], Any]) -> _Problems:
        yield from _check_length(dimension, path, read())

    yield from _each(check, _vectors(case), case.dimension)


def _extent(case: Any) -> list[float] | None:
    """Lengths of the domain along its axes, m; None if its corners are wrong (reported elsewhere)."""
    lower, upper, dimension = case.domain.lower, case.domain.upper, case.dimension
    if len(lower) != dimension or len(upper) != dimension:
        return None
    extent = [b - a for a, b in zip(lower, upper, strict=True)]
    return extent if all(length > 0 and math.isfinite(length) for length in extent) else None


def _check_domain(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    yield from _check_corners(case.dimension, "domain", case.domain.lower, case.domain.upper)
    extent = _extent(case)
    if extent is None:
        return
    spacing = case.particle_spacing
    short = [axis for axis, length in zip(AXES, extent, strict=False) if length < 1.999 * spacing]
    if short:
        yield Problem(
            "particle_spacing",
            spacing,
            f"leaves no room for two particles along {', '.join(short)}",
            f"write at most {min(extent) / 2:.4g}, or enlarge the domain",
        )
    count = math.prod(length / spacing for length in extent)
    if count > _MOST_PARTICLES:
        told = f"{count:.3g}" if math.isfinite(count) else "more than 1e308"
        # by logarithms: the volume of a domain may be beyond what a number holds
        fitting = math.exp((sum(map(math.log, extent)) - math.log(_MOST_PARTICLES)) / len(extent))
        yield Problem(
            "particle_spacing",
            spacing,
            f"makes {told} particles in the domain, at most 2^31 - 1",
            f"write at least {fitting * 1.01:.4g}",
        )


def _check_boundary(case: Any, _folder: Path | None, raw: Any) -> _Problems:
    if case.dimension == 2 and _dig(raw, "domain", "boundary", "z") is not MISSING:
        yield Problem(
            "domain.boundary.z",
            _dig(raw, "domain", "boundary", "z"),
            "has no z axis (dimension: 2)",
            "delete it",
        )
    yield from _each(_check_axis, [(position,) for position in range(case.dimension)], case, raw)


def _check_axis(case: Any, raw: Any, position: int) -> _Problems:
    axis = AXES[position]
    boundary = getattr(case.domain.boundary, axis)
    dimension = case.dimension
    written = _dig(raw, "domain", "boundary", axis)
    apart = isinstance(written, AxisBoundary) or bool(
        isinstance(written, Mapping) and {"lower", "upper"} & written.keys()
    )
    for name in ("lower", "upper") if apart else ("lower",):
        side = getattr(boundary, name)
        path = f"domain.boundary.{axis}.{name}.velocity" if apart else f"domain.boundary.{axis}.velocity"
        yield from _check_length(dimension, path, side.velocity)
        if len(side.velocity) == dimension and side.velocity[position] != 0:
            yield Problem(
                path,
                list(side.velocity),
                f"moves the wall out of its plane ({axis} has to be 0)",
                "let domain walls slide in their own plane only",
            )
    if boundary.periodic:
        extent = _extent(case)
        if extent is not None:
            ratio = case.numerics.smoothing_ratio
            spacing = case.particle_spacing
            support = (
                _AUTO_SUPPORT if ratio == "auto" else ratio * SUPPORT_RATIO[case.numerics.kernel]
            ) * spacing
            if extent[position] < 2 * support * (1 - 1e-9):
                yield Problem(
                    f"domain.boundary.{axis}",
                    "periodic",
                    f"needs a box of at least twice the support radius "
                    f"along {axis}: {2 * support:.4g} m, has {extent[position]:.4g} m",
                    "enlarge the domain or lower particle_spacing",
                )


def _known_phase(case: Any, path: str, name: str) -> _Problems:
    if name not in list(case.phases):
        yield Problem(
            path, name, "is not one of the phases", suggestion(name, [str(key) for key in case.phases])
        )


def _check_phases(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    used = {fluid.phase for fluid in case.fluids}
    # Where a fluid names an unknown phase, that is reported, and the phase it meant is not unused.
    if not used or not used <= set(case.phases):
        return
    for name in case.phases:
        if isinstance(name, str) and NAME.fullmatch(name) and name not in used:
            yield Problem(
                f"phases.{name}", MISSING, "is the phase of no fluid", "add a region to fluids or delete it"
            )


def _check_tension(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    seen: set[frozenset[str]] = set()
    yield from _each(_check_pair, list(enumerate(case.surface_tension)), case, seen)


def _check_pair(case: Any, seen: set[frozenset[str]], position: int, tension: Any) -> _Problems:
    path = f"surface_tension.{position}.between"
    between = tension.between
    if len(between) != 2 or between[0] == between[1]:
        yield Problem(path, list(between), "needs two different phases", "write e.g. between: [gas, liquid]")
        return
    if frozenset(between) in seen:
        yield Problem(path, list(between), "names a pair of phases a second time", "delete one")
    seen.add(frozenset(between))
    for end, name in enumerate(between):
        yield from _known_phase(case, f"{path}.{end}", name)
    if tension.contact_angle is not None and not _has_walls(case):
        yield Problem(
            f"surface_tension.{position}.contact_angle",
            tension.contact_angle,
            "is the angle at a wall, and there is none",
            "delete it, or make a side of domain.boundary a wall or free_slip",
        )


def _check_fluids(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    fluids = list(case.fluids)
    last = len(fluids) - 1

    def check(position: int, fluid: Any) -> _Problems:
        yield from _guarded(_known_phase(case, f"fluids.{position}.phase", fluid.phase))
        if fluid.shape.kind == "rest" and position != last:
            yield Problem(
                f"fluids.{position}.shape",
                "rest",
                "has to be the last of fluids, and only once",
                "move it to the end",
            )

    yield from _each(check, enumerate(fluids))
    shapes = ((f"fluids.{position}.shape", fluid) for position, fluid in enumerate(fluids))
    yield from _each(_check_shape, shapes, case)


def _check_obstacles(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    names: dict[str, int] = {}

    def check(position: int, obstacle: Any) -> _Problems:
        path = f"obstacles.{position}"
        yield from _guarded(_check_length(case.dimension, f"{path}.velocity", obstacle.velocity))
        if obstacle.name is not None and names.setdefault(obstacle.name, position) != position:
            yield Problem(
                f"{path}.name",
                obstacle.name,
                f"is the name of obstacle {names[obstacle.name]} already",
                "choose another",
            )
        if obstacle.shape.kind == "rest":
            yield Problem(f"{path}.shape", "rest", "is for fluids only", f"use one of {', '.join(SHAPES)}")

    yield from _each(check, enumerate(case.obstacles))
    shapes = ((f"obstacles.{position}.shape", obstacle) for position, obstacle in enumerate(case.obstacles))
    yield from _each(_check_shape, shapes, case)


def _check_shape(case: Any, path: str, owner: Any) -> _Problems:
    """Lengths of vectors, order of corners, place in the domain, of one shape."""
    shape = owner.shape
    dimension = case.dimension
    path = f"{path}.{shape.kind}"
    box: tuple[Sequence[float], Sequence[float]] | None = None
    if shape.box is not None:
        yield from _check_length(dimension, f"{path}.lower", shape.box.lower)
        yield from _check_length(dimension, f"{path}.upper", shape.box.upper)
        yield from _check_corners(dimension, path, shape.box.lower, shape.box.upper)
        box = shape.box.lower, shape.box.upper
    elif shape.sphere is not None:
        yield from _check_length(dimension, f"{path}.center", shape.sphere.center)
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
            yield from _check_length(dimension, f"{path}.points.{position}", point)
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
        yield from _check_names(case, f"{path}.condition", shape.where.condition)
    if box is None or _extent(case) is None or not len(box[0]) == len(box[1]) == dimension:
        return
    for k, axis in enumerate(AXES[:dimension]):
        if box[0][k] >= case.domain.upper[k] or box[1][k] <= case.domain.lower[k]:
            yield Problem(
                path, MISSING, f"lies outside the domain along {axis}", "move it or enlarge the domain"
            )


def _check_names(case: Any, path: str, formula: Any) -> _Problems:
    """No z in two dimensions."""
    if isinstance(formula, Expression) and case.dimension == 2 and "z" in formula.names:
        yield Problem(path, formula.text, "uses z (dimension: 2)", "use x and y only")


def _check_start(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    def velocity() -> _Problems:
        for position, formula in enumerate(case.start.velocity):
            yield from _check_names(case, f"start.velocity.{position}", formula)

    def pressure() -> _Problems:
        yield from _check_names(case, "start.pressure", case.start.pressure)
        if isinstance(case.start.pressure, str):
            for axis, g in zip(AXES[: case.dimension], case.gravity, strict=False):
                if g != 0 and getattr(case.domain.boundary, axis).periodic:
                    yield Problem(
                        "start.pressure",
                        case.start.pressure,
                        f"cannot be hydrostatic along the periodic axis {axis} with gravity",
                        "use none, a wall, or body_force",
                    )

    yield from _guarded(velocity())
    yield from _guarded(pressure())


def _check_numerics(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    if case.numerics.scheme == "isph":
        yield from _check_isph(case)
    other = "riemann" if case.numerics.scheme == "isph" else "isph"
    for key in _KEYS_OF[other]:
        if (value := getattr(case.numerics, key)) != "auto":
            rule = f"is a choice of scheme: {other}, the case has scheme: {case.numerics.scheme}"
            yield Problem(f"numerics.{key}", value, rule, "delete it, or write auto")
    rate = case.numerics.room_rate
    if rate != "auto" and rate > 0 and case.has_open_sides:
        rule = "needs a closed or periodic domain: at a free surface the window of a particle is cut"
        yield Problem("numerics.room_rate", rate, rule, "write auto or 0")
    if case.numerics.volume_constraint is True:
        for axis in AXES[: case.dimension]:
            sides = getattr(case.domain.boundary, axis)
            if "open" in (sides.lower.kind, sides.upper.kind):
                yield Problem(
                    "numerics.volume_constraint",
                    True,
                    f"needs a closed or periodic domain, {axis} is open",
                    "write auto or false",
                )


# keys of numerics that one scheme alone reads
_KEYS_OF = {
    "riemann": ("star_states", "tension_form", "interface_force", "velocity_dissipation", "room_rate"),
    "isph": (
        "time_order", "relaxed_divergence", "deferred_correction", "surface_offset", "volume_feedback", "surface_filter",
        "implicit_viscosity", "solver", "preconditioner",
    ),
}  # fmt: skip


def _check_isph(case: Any) -> _Problems:
    if len(case.phases) > 1:
        rule = f"takes one phase, the case has {len(case.phases)}"
        yield Problem("numerics.scheme", "isph", rule, "write scheme: riemann, or leave one phase")
    if len(case.surface_tension) > 0:
        rule = "does not act with scheme: isph"
        yield Problem("surface_tension", len(case.surface_tension), rule, "write scheme: riemann, or delete it")
    if case.numerics.volume_constraint is True:
        rule = "is part of scheme: riemann; isph keeps the volume by its pressure equation"
        yield Problem("numerics.volume_constraint", True, rule, "write auto")
    from warpsph.solvers.linear_solver import attainable

    least = attainable(case.precision)
    if case.numerics.tolerance < least:
        remedy = f"write at least {least:g}" + (", or precision: float64" if case.precision == "float32" else "")
        yield Problem("numerics.tolerance", case.numerics.tolerance, f"is out of reach in {case.precision}", remedy)
    for name, gauge in case.gauges.items():
        if gauge.type == "wall_force":
            rule = "needs wall particles, which scheme: isph has at obstacles alone, and their pressure"
            yield Problem(f"gauges.{name}.type", gauge.type, rule, "use a gauge of type points at the wall")


def _check_output(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    def particles() -> _Problems:
        if case.output.particles is not None:
            yield from _check_interface_fields(case, "output.particles.fields", case.output.particles.fields)

    parts = (("particles", lambda: case.output.particles), ("checkpoint", lambda: case.output.checkpoint))
    yield from _guarded(particles())
    for name, read in parts:
        yield from _guarded(_check_often(case, f"output.{name}.interval", read))


def _check_often(case: Any, path: str, read: Callable[[], Any]) -> _Problems:
    """Not more outputs than anyone can want."""
    part = read()
    if part is None or part.interval is None:
        return
    if case.end_time / part.interval > _MOST_OUTPUTS:
        yield Problem(
            path,
            part.interval,
            f"makes more than {_MOST_OUTPUTS:,} outputs until end_time {case.end_time:g}",
            f"write at least {case.end_time / _MOST_OUTPUTS:.3g}",
        )


def _check_interface_fields(case: Any, path: str, fields: Sequence[str]) -> _Problems:
    """Normals and curvature exist only with surface tension."""
    wanted = [name for name in fields if name in _INTERFACE_FIELDS]
    if wanted and len(case.surface_tension) == 0:
        yield Problem(
            path, list(fields), f"{', '.join(wanted)} needs surface_tension", "delete it from the list"
        )


def _has_walls(case: Any) -> bool:
    """`Case.has_walls`, of a draft too."""
    ends = [getattr(case.domain.boundary, axis) for axis in AXES[: case.dimension]]
    return len(case.obstacles) > 0 or any("wall" in (axis.lower.kind, axis.upper.kind) for axis in ends)


def _check_gauges(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    yield from _each(_check_gauge, list(case.gauges.items()), case)


def _check_gauge(case: Any, name: Any, gauge: Any) -> _Problems:
    path = f"gauges.{name}"
    yield from _guarded(_check_often(case, f"{path}.interval", lambda: gauge))
    if gauge.type == "wall_force":
        if not _has_walls(case):
            yield Problem(
                f"{path}.type", gauge.type, "needs a wall or an obstacle", "delete the gauge or add a wall"
            )
    elif gauge.type == "contour":
        if case.dimension != 2:
            yield Problem(f"{path}.type", gauge.type, "needs dimension: 2", "use extents")
    elif gauge.type == "interface_length":
        if len(case.phases) < 2:
            yield Problem(f"{path}.type", gauge.type, "needs at least two phases", "delete the gauge")
    elif gauge.type == "points":
        for position, point in enumerate(gauge.points):
            yield from _guarded(_check_length(case.dimension, f"{path}.points.{position}", point))
        yield from _check_interface_fields(case, f"{path}.fields", gauge.fields)
        yield from _guarded(_check_faces(case, path, gauge))
    elif gauge.type == "line":
        yield from _guarded(_check_length(case.dimension, f"{path}.from", gauge.from_))
        yield from _guarded(_check_length(case.dimension, f"{path}.to", gauge.to))
        if gauge.from_ == gauge.to:
            yield Problem(
                f"{path}.to", list(gauge.to), "is the same point as from", "use a gauge of type points"
            )
        yield from _check_interface_fields(case, f"{path}.fields", gauge.fields)


def _check_faces(case: Any, path: str, gauge: Any) -> _Problems:
    """The faces of sensors have a plane and lie within the domain."""
    normal = gauge.normal
    if gauge.area is None:
        if normal is not None:
            yield Problem(f"{path}.normal", list(normal), "is that of an area, and there is none", "add area, or delete it")
        return
    yield from _check_length(case.dimension, f"{path}.normal", normal or ())
    if normal is not None and not any(normal):
        rule = "has no direction"
        yield Problem(f"{path}.normal", list(normal), rule, "write that of the wall, e.g. normal: [1, 0]")
    elif normal is None or len(normal) == case.dimension:
        points = [(position, point) for position, point in enumerate(gauge.points) if len(point) == case.dimension]
        yield from _each(_check_face, points, case, path, gauge)


def _check_face(case: Any, path: str, gauge: Any, position: int, point: Sequence[float]) -> _Problems:
    """The face around one point."""
    where = f"{path}.points.{position}"
    try:
        normal = wall_normal(case, point) if gauge.normal is None else np.asarray(gauge.normal, np.float64)
    except NoPlane as reason:
        yield Problem(where, list(point), str(reason), "move it to the wall, or give normal")
        return
    extent = _extent(case)
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


def _check_references(case: Any, folder: Path | None, raw: Any) -> _Problems:
    yield from _each(_check_reference, list(case.reference.items()), case, folder, raw)


def _check_reference(case: Any, folder: Path | None, raw: Any, name: Any, reference: Any) -> _Problems:
    path = f"reference.{name}"
    if isinstance(reference, ReferenceExact):
        yield from _guarded(_check_exact(case, raw, path, reference))
        return
    if isinstance(reference, ReferenceInterface):
        yield from _guarded(_check_interface(case, folder, raw, path, reference))
        return
    if isinstance(reference, ReferenceCurve):
        curve = reference.curve
        yield from _check_file(
            folder, f"{path}.curve", curve.file, {"time": curve.time, "value": curve.value}
        )
    if isinstance(reference, ReferenceCurves):
        curves = reference.curves
        columns = {"position": curves.position} | {
            f"columns.{t:g}": column for t, column in curves.columns.items()
        }
        yield from _check_file(folder, f"{path}.curves", curves.file, columns)
    if reference.gauge not in list(case.gauges):
        known = [str(key) for key in case.gauges]
        remedy = suggestion(reference.gauge, known) if known else "add the gauge"
        yield Problem(f"{path}.gauge", reference.gauge, "is not one of the gauges", remedy)
        return
    gauge = case.gauges[reference.gauge]
    kind = gauge.type
    yield from _check_reduce(path, reference)
    yield from _check_moved(path, reference)
    yield from _guarded(_check_column(case, path, reference, gauge))
    if isinstance(reference, ReferenceCurves):
        if kind != "line":
            yield Problem(
                f"{path}.gauge", reference.gauge, f"needs a gauge of type line, this is {kind}", "use curve"
            )
            return
        if gauge.times is not None:
            for time in reference.curves.columns:
                if not any(math.isclose(time, known, rel_tol=1e-9) for known in gauge.times):
                    yield Problem(
                        f"{path}.curves.columns",
                        time,
                        f"is not one of the times of gauge {reference.gauge}",
                        "add it to the gauge's times",
                    )
    elif isinstance(reference, ReferenceValue) and reference.reduce == "slope":
        if kind != "line":
            yield Problem(
                f"{path}.gauge", reference.gauge, f"needs a gauge of type line, this is {kind}", "use another reduce"
            )
    elif kind == "line":
        yield Problem(
            f"{path}.gauge",
            reference.gauge,
            "is a gauge of type line and has profiles, not one number a time",
            "use curves, reduce: slope, or a gauge of type points",
        )


def _check_reduce(path: str, reference: Any) -> _Problems:
    """What belongs to one way of reducing is given with that one alone."""
    if isinstance(reference, ReferenceValue | ReferenceCurve):
        if reference.reduce == "noise" and reference.span is None:
            rule = "noise needs a span: the time over which the column is all but a parabola"
            yield Problem(f"{path}.span", MISSING, rule, "write e.g. span: 2")
        if reference.reduce != "noise" and reference.span is not None:
            yield Problem(f"{path}.span", reference.span, "belongs to reduce: noise", "delete it")
    if isinstance(reference, ReferenceCurve) and reference.reduce is not None:
        if reference.norm != "max":
            yield Problem(f"{path}.norm", reference.norm, "with reduce there is no norm", "delete one of both")
        if reference.relative_to not in ("peak", "absolute"):
            rule = "with reduce the error is relative to the number of the curve, or absolute"
            yield Problem(f"{path}.relative_to", reference.relative_to, rule, "delete it, or write absolute")


def _check_moved(path: str, reference: Any) -> _Problems:
    """A way moved is something else than what the error is divided by without it, and is not nothing."""
    if getattr(reference, "moved_from", None) is None:
        return
    if isinstance(reference, ReferenceValue) and reference.value == reference.moved_from:
        rule = "is the reference itself: there is no way that the error could be divided by"
        yield Problem(f"{path}.moved_from", reference.moved_from, rule, "give where it started, or delete it")
    if isinstance(reference, ReferenceCurve) and reference.relative_to != "peak":
        rule = "with moved_from the error is divided by the way moved"
        yield Problem(f"{path}.relative_to", reference.relative_to, rule, "delete one of both")


def _check_column(case: Any, path: str, reference: Any, gauge: Any) -> _Problems:
    """The column of a reference is one of its gauge, or arithmetic of its columns."""
    from warpsph.measure.gauges import column_formula, column_names

    known = column_names(reference.gauge, gauge, case if isinstance(case, Case) else _scene_of(case))
    if reference.column in known:
        return
    try:
        column_formula(known, reference.column)
    except ExpressionError as error:
        rule = f"is not a column of gauge {reference.gauge}, nor arithmetic of its columns: {error.rule}"
        # Of arithmetic it is one name that is wrong, and the expression knows which.
        about_one = error.remedy.startswith("did you mean") and not set("+-*/(").isdisjoint(reference.column)
        remedy = error.remedy if about_one else suggestion(reference.column, [name for name in known if name != "time"])
        yield Problem(f"{path}.column", reference.column, rule, remedy)


def _scene_of(case: Any) -> Any:
    """A draft with what gauges ask of a Case."""
    sides = tuple(getattr(case.domain.boundary, axis) for axis in AXES[: case.dimension])
    return SimpleNamespace(
        **vars(case), phase_names=list(case.phases), sides=sides, periodic=tuple(axis.periodic for axis in sides)
    )


def _check_exact(case: Any, raw: Any, path: str, reference: ReferenceExact) -> _Problems:
    for position, formula in enumerate(reference.exact):
        many = len(reference.exact) > 1
        yield from _check_names(case, f"{path}.exact.{position}" if many else f"{path}.exact", formula)
    wanted = case.dimension if reference.field == "velocity" else 1
    if len(reference.exact) != wanted:
        yield Problem(
            f"{path}.exact",
            _texts(reference.exact),
            f"needs {wanted} formula{'s' if wanted > 1 else ''} for {reference.field}",
            "write one an axis for velocity, one for anything else",
        )
    if _dig(raw, "output", "particles") is MISSING:
        return
    if case.output.particles is None:
        yield Problem(
            f"{path}.particles",
            reference.particles,
            "needs particle files, output.particles is none",
            "switch them on",
        )
        return
    field = "velocity" if reference.field == "speed" else reference.field
    if field not in case.output.particles.fields:
        yield Problem(
            f"{path}.field", reference.field, f"needs {field} in output.particles.fields", "add it there"
        )


def _check_interface(
    case: Any, folder: Path | None, raw: Any, path: str, reference: ReferenceInterface
) -> _Problems:
    line = reference.interface
    if case.dimension != 2:
        yield Problem(path, MISSING, "an interface needs dimension: 2", "compare with value or curve")
        return
    yield from _known_phase(case, f"{path}.phase", reference.phase)
    yield from _check_length(2, f"{path}.interface.offset", line.offset)
    yield from _check_file(folder, f"{path}.interface", line.file, {})
    if _dig(raw, "output", "particles") is MISSING:
        return
    if case.output.particles is None:
        yield Problem(
            f"{path}.interface.time", line.time, "needs particle files, output.particles is none", "switch them on"
        )
        return
    fields = case.output.particles.fields
    needed = ("phase", "volume") if "volume" in fields else ("phase", "mass", "density")
    missing = [name for name in needed if name not in fields]
    if missing:
        yield Problem(
            f"{path}.interface", MISSING, f"needs {', '.join(missing)} in output.particles.fields", "add them there"
        )
    if case.output.particles.times is not None:
        written = any(math.isclose(line.time, time, rel_tol=1e-9) for time in case.output.particles.times)
    else:
        count = line.time / case.output.particles.interval
        written = math.isclose(count, round(count), rel_tol=1e-6, abs_tol=1e-9)
    if not written and not math.isclose(line.time, case.end_time, rel_tol=1e-9):
        yield Problem(
            f"{path}.interface.time",
            line.time,
            "is not a time of output.particles",
            "add it to output.particles.times, or choose an interval that meets it",
        )


def _check_file(folder: Path | None, path: str, name: str, columns: Mapping[str, str]) -> _Problems:
    """A reference file can be read and has the columns that the case names."""
    if folder is None:
        return
    file = folder / name
    try:
        if not file.is_file():
            yield Problem(f"{path}.file", name, f"there is no such file in {folder}", "correct the name")
            return
        with file.open(encoding="utf-8-sig", newline="") as stream:
            header = [cell.strip() for cell in next(csv.reader([stream.readline(1_000_000)]), [])]
    except (OSError, ValueError, csv.Error) as error:
        yield Problem(
            f"{path}.file", name, f"cannot be read ({type(error).__name__})", "name a CSV text file"
        )
        return
    for key, column in columns.items():
        if column not in header:
            yield Problem(f"{path}.{key}", column, f"is not a column of {name}", suggestion(column, header))


def _check_validation(case: Any, _folder: Path | None, _raw: Any) -> _Problems:
    figure = case.validation.figure
    if figure is not None and figure.phases is not None:
        for position, name in enumerate(figure.phases):
            yield from _known_phase(case, f"validation.figure.phases.{position}", name)


_CHECKS: tuple[Callable[[Any, Path | None, Any], _Problems], ...] = (
    check_inputs,
    _check_domain,
    _check_vectors,
    _check_boundary,
    _check_phases,
    _check_tension,
    _check_fluids,
    _check_obstacles,
    _check_start,
    _check_numerics,
    _check_output,
    _check_gauges,
    _check_references,
    _check_validation,
)
