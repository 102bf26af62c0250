"""Checks between fields: references, and the runs of a validation."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from warpsph.case.checking import check_length, check_names, each, known_phase, texts
from warpsph.case.columns import column_formula, column_names
from warpsph.case.drafts import Problems, guarded, model_of
from warpsph.case.places import dig
from warpsph.case.references import (
    ReferenceCurve,
    ReferenceCurves,
    ReferenceExact,
    ReferenceInterface,
    ReferenceValue,
)
from warpsph.case.validation_runs import VALIDATION_LEVELS
from warpsph.case.values import suggestion
from warpsph.errors import MISSING, ExpressionError, Problem, short


def check_references(case: Any, folder: Path | None, raw: Any) -> Problems:
    yield from each(_check_reference, list(case.reference.items()), case, folder, raw)


def _check_reference(case: Any, folder: Path | None, raw: Any, name: Any, reference: Any) -> Problems:
    path = f"reference.{name}"
    if isinstance(reference, ReferenceExact):
        yield from guarded(_check_exact(case, raw, path, reference))
        return
    if isinstance(reference, ReferenceInterface):
        yield from guarded(_check_interface(case, folder, raw, path, reference))
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
    if getattr(reference, "reduce", None) == "strouhal" and kind != "force_coefficients":
        rule = f"needs the length and speed of a gauge of type force_coefficients, {reference.gauge} is one of type {kind}"
        yield Problem(f"{path}.reduce", "strouhal", rule, "use frequency, or another gauge")
    yield from _check_moved(path, reference)
    yield from guarded(_check_column(case, path, reference, gauge))
    if isinstance(reference, ReferenceCurves):
        if kind != "line" and not (kind == "surface_stress" and case.dimension == 2):
            told = f"needs a gauge of type line, or surface_stress in 2-D, this is {kind}"
            yield Problem(f"{path}.gauge", reference.gauge, told, "use curve")
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
    elif kind in ("line", "surface_stress"):
        remedy = "use curves, reduce: slope, or a gauge of type points" if kind == "line" else "use curves"
        rule = f"is a gauge of type {kind} and has profiles, not one number a time"
        yield Problem(f"{path}.gauge", reference.gauge, rule, remedy)


def _check_reduce(path: str, reference: Any) -> Problems:
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


def _check_moved(path: str, reference: Any) -> Problems:
    """A way moved is something else than what the error is divided by without it, and is not nothing."""
    if getattr(reference, "moved_from", None) is None:
        return
    if isinstance(reference, ReferenceValue) and reference.value == reference.moved_from:
        rule = "is the reference itself: there is no way that the error could be divided by"
        yield Problem(f"{path}.moved_from", reference.moved_from, rule, "give where it started, or delete it")
    if isinstance(reference, ReferenceCurve) and reference.relative_to != "peak":
        rule = "with moved_from the error is divided by the way moved"
        yield Problem(f"{path}.relative_to", reference.relative_to, rule, "delete one of both")


def _check_column(case: Any, path: str, reference: Any, gauge: Any) -> Problems:
    """The column of a reference is one of its gauge, or arithmetic of its columns."""
    known = column_names(reference.gauge, gauge, case)
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


def _check_exact(case: Any, raw: Any, path: str, reference: ReferenceExact) -> Problems:
    for position, formula in enumerate(reference.exact):
        many = len(reference.exact) > 1
        yield from check_names(case, f"{path}.exact.{position}" if many else f"{path}.exact", formula)
    wanted = case.dimension if reference.field == "velocity" else 1
    if len(reference.exact) != wanted:
        yield Problem(
            f"{path}.exact",
            texts(reference.exact),
            f"needs {wanted} formula{'s' if wanted > 1 else ''} for {reference.field}",
            "write one an axis for velocity, one for anything else",
        )
    if dig(raw, "output", "particles") is MISSING:
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
) -> Problems:
    line = reference.interface
    if case.dimension != 2:
        yield Problem(path, MISSING, "an interface needs dimension: 2", "compare with value or curve")
        return
    yield from known_phase(case, f"{path}.phase", reference.phase)
    yield from check_length(2, f"{path}.interface.offset", line.offset)
    yield from _check_file(folder, f"{path}.interface", line.file, {})
    if dig(raw, "output", "particles") is MISSING:
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


def _check_file(folder: Path | None, path: str, name: str, columns: Mapping[str, str]) -> Problems:
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


def check_validation(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    figure = case.validation.figure
    if figure is not None and figure.phases is not None:
        for position, name in enumerate(figure.phases):
            yield from known_phase(case, f"validation.figure.phases.{position}", name)
    levels = [(level, position) for level in VALIDATION_LEVELS for position in range(len(getattr(case.validation, level)))]
    yield from each(_check_changes, levels, case)


def _check_changes(case: Any, level: str, position: int) -> Problems:
    """What a run changes is part of a case."""
    sections = [name for name in model_of(case).model_fields if name != "validation"]
    for key in getattr(case.validation, level)[position].changes:
        section = key.split(".")[0]
        if section not in sections:
            rule = f"{short(key)} does not begin with a section of the case"
            yield Problem(f"validation.{level}.{position}.changes", MISSING, rule, suggestion(section, sections))
