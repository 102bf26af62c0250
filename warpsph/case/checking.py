"""What the checks between fields have in common."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from warpsph.case.domain import AXES
from warpsph.case.drafts import Problems, guarded
from warpsph.case.expressions import Expression
from warpsph.case.signals import is_signal, signal_text
from warpsph.case.values import formula_text, suggestion
from warpsph.errors import Problem

_MOST_OUTPUTS = 1_000_000


def each(check: Callable[..., Problems], items: Iterable[tuple[Any, ...]], *common: Any) -> Problems:
    """Run one check for each of several items, so that a faulty item does not hide the others."""
    for item in items:
        yield from guarded(check(*common, *item))


def texts(vector: Sequence[Any]) -> list[Any]:
    return [signal_text(entry) if is_signal(entry) else formula_text(entry) for entry in vector]


def check_length(dimension: int, path: str, vector: Sequence[Any]) -> Problems:
    """A vector has one entry an axis (an empty one is a default that is filled in later)."""
    if vector and len(vector) != dimension:
        key = path.split(".")[-1]
        example = (
            f"write e.g. {key}: {[0] * dimension}" if not key.isdecimal() else f"write e.g. {[0] * dimension}"
        )
        yield Problem(path, texts(vector), f"needs {dimension} numbers (dimension: {dimension})", example)


def check_corners(dimension: int, path: str, lower: Sequence[float], upper: Sequence[float]) -> Problems:
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


def extent_of(case: Any) -> list[float] | None:
    """Lengths of the domain along its axes, m; None if its corners are wrong (reported elsewhere)."""
    lower, upper, dimension = case.domain.lower, case.domain.upper, case.dimension
    if len(lower) != dimension or len(upper) != dimension:
        return None
    extent = [b - a for a, b in zip(lower, upper, strict=True)]
    return extent if all(length > 0 and math.isfinite(length) for length in extent) else None


def known_phase(case: Any, path: str, name: str) -> Problems:
    if name not in list(case.phases):
        yield Problem(
            path, name, "is not one of the phases", suggestion(name, [str(key) for key in case.phases])
        )


def check_names(case: Any, path: str, formula: Any) -> Problems:
    """No z in two dimensions, no y in one."""
    if not isinstance(formula, Expression):
        return
    for axis in AXES[case.dimension :]:
        if axis in formula.names:
            rule = f"uses {axis} (dimension: {case.dimension})"
            yield Problem(path, formula.text, rule, f"use {' and '.join(AXES[: case.dimension])} only")
            return


def check_often(case: Any, path: str, read: Callable[[], Any]) -> Problems:
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
