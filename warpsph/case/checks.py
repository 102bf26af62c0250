"""The checks between the fields of a case. A check that meets a value that could not be read ends there."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from warpsph.case.check_domain import check_boundary, check_domain, check_signals, check_vectors
from warpsph.case.check_open_sides import check_open_sides
from warpsph.case.check_outputs import check_gauges, check_output
from warpsph.case.check_phases import check_bodies, check_fluids, check_phases, check_start, check_tension
from warpsph.case.check_references import check_references, check_validation
from warpsph.case.drafts import Problems, guarded
from warpsph.case.magnitudes import check_inputs
from warpsph.case.places import dig
from warpsph.errors import MISSING, Problem


def cross_check(case: Any, folder: Path | None, raw: Any) -> list[Problem]:
    """All problems between the fields of `case` (a Case or the draft of one)."""
    return [_as_written(problem, raw) for check in _CHECKS for problem in guarded(check(case, folder, raw))]


def _as_written(problem: Problem, raw: Any) -> Problem:
    """The problem with its value as it stands in the file, not as it was understood."""
    steps = [int(step) if step.isdecimal() else step for step in problem.path.split(".")]
    written = dig(raw, *steps)
    return problem if written is MISSING else dataclasses.replace(problem, value=written)


def check_numerics(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    yield from case.scheme.check(case)


_CHECKS: tuple[Callable[[Any, Path | None, Any], Problems], ...] = (
    check_inputs,
    check_domain,
    check_vectors,
    check_boundary,
    check_signals,
    check_open_sides,
    check_phases,
    check_tension,
    check_fluids,

    check_bodies,
    check_start,
    check_numerics,
    check_output,
    check_gauges,
    check_references,
    check_validation,
)
