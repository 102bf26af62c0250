"""The plan of a benchmark, a small file a case: the error that it is judged by, the resolutions, and the choices.

    case: ../taylor_green.yaml                 # beside this file
    says: periodic flow of one phase           # the scenes that its results speak for
    errors: {speed_l1: speed_l1}               # column -> reference of the case
    error: abs(speed_l1)                       # arithmetic of the columns; what choices are judged by
    error_name: l1 error of the speed at t = 2
    peer_errors: [speed_l1]                    # names of the same error in benchmarks/peers.json
    settings: {gauges.momentum: none}          # of all runs: what the error does not need is left out
    choices:                                   # each changes one thing; `default` comes first
      default: {}
      isph: {numerics.scheme: isph}
    quick: {particle_spacing: [1/25, 1/50], choices: [default, isph]}
    fine: {particle_spacing: [1/100, 1/200], choices: [default]}
    full: {particle_spacing: [1/25, 1/50, 1/100], wall_time: 1800}

A level of a plan is a sweep: every choice at every resolution.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, StrictStr, ValidationError, model_validator

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.case.expressions import compile_expression
from warpsph.case.reports import report
from warpsph.case.values import (
    CaseModel,
    FreezeMapping,
    FrozenDict,
    Name,
    PositiveNumber,
    as_list,
    bad_value,
    suggestion,
)
from warpsph.case.yaml_text import placed, read_file
from warpsph.errors import CaseError, ExpressionError, Problem
from warpsph.study.sweep_file import VARIANT, Sweep, as_settings
from warpsph.study.sweep_points import points_of

SHIPPED = Path(__file__).resolve().parents[2] / "cases" / "benchmark"
"""The plans of a checkout, beside the package."""

LEVELS = ("quick", "fine", "full")
"""Levels of effort."""

Level = Literal["quick", "fine", "full"]

REPEATS = 3
"""Times that runs below a second are made; the quickest counts."""

DEFAULT = "default"
"""Name of the choice that changes nothing."""

Settings = Annotated[Mapping[str, Any], FreezeMapping(), BeforeValidator(as_settings)]


class Effort(CaseModel):
    """What a level runs."""

    particle_spacing: Annotated[tuple[PositiveNumber, ...], BeforeValidator(as_list), Field(min_length=1)] = Field(
        description="resolutions, m, coarsest first", examples=["[1/25, 1/50]"]
    )
    choices: Annotated[tuple[StrictStr, ...], BeforeValidator(as_list)] | None = Field(
        default=None, description="names of the choices (default: all)", examples=["[default, isph]"]
    )
    wall_time: PositiveNumber | None = Field(
        default=None, description="s that a run may take, with what sets it up", examples=["60"]
    )


class Plan(CaseModel):
    """A plan as its file describes it."""

    case: StrictStr = Field(description="case file, beside the file of the plan", examples=["../sod.yaml"])
    says: StrictStr = Field(description="the scenes that the results speak for", examples=["periodic flow of one phase"])
    errors: Annotated[Mapping[Name, Name], FreezeMapping(), Field(min_length=1)] = Field(
        description="column -> reference of the case whose error it holds", examples=["{l1: speed_l1}"]
    )
    error: StrictStr = Field(description="what choices are judged by: arithmetic of the errors", examples=["abs(l1)"])
    error_name: StrictStr = Field(description="that error in words", examples=["l1 error of the speed"])
    peer_errors: Annotated[tuple[StrictStr, ...], BeforeValidator(as_list)] = Field(
        default=(), description="names of the same error among the figures of other codes", examples=["[speed_l1]"]
    )
    settings: Settings = Field(
        default_factory=FrozenDict,
        description="dotted keys of the case and their values in all runs",
        examples=["{end_time: 1}"],
    )
    choices: Annotated[Mapping[str, Settings], FreezeMapping()] = Field(
        description="name -> dotted keys of the case and their values", examples=["{default: {}}"]
    )
    quick: Effort = Field(description="minutes on one thread", examples=["{particle_spacing: [1/25]}"])
    fine: Effort = Field(
        description="the resolutions that a GPU is for, with the choices worth their time; minutes on one",
        examples=["{particle_spacing: [1/100, 1/200], choices: [default]}"],
    )
    full: Effort = Field(
        description="every choice at every resolution, hours", examples=["{particle_spacing: [1/25, 1/50]}"]
    )

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if next(iter(self.choices), None) != DEFAULT or self.choices[DEFAULT]:
            raise bad_value("needs `default: {}` as the first choice", "write choices: {default: {}, ...}")
        try:
            compile_expression(self.error, tuple(self.errors))
        except ExpressionError as problem:
            raise bad_value(f"has an error that cannot be computed: {problem}", "use the names of `errors`") from None
        for level in LEVELS:
            for name in self.effort(level).choices or ():
                if name not in self.choices:
                    raise bad_value(f"names {name} at the level {level}, which is no choice", suggestion(name, self.choices))
        return self

    def effort(self, level: str) -> Effort:
        """The effort of one of LEVELS."""
        found: Effort = getattr(self, level)
        return found

    def judged(self, errors: Mapping[str, float | None]) -> float | None:
        """The error that choices are judged by, at least 0; None where one of its parts is missing or not finite."""
        known = {name: value for name, value in errors.items() if value is not None and math.isfinite(value)}
        expression = compile_expression(self.error, tuple(self.errors))
        if expression.names - known.keys():
            return None
        values: dict[str, Any] = {name: known[name] for name in expression.names}
        return abs(float(expression.evaluate(**values)))


@dataclass(frozen=True)
class Planned:
    """A plan with its name, the case at its own resolution and the sweep of a level."""

    name: str
    plan: Plan
    case: Case
    sweep: Sweep


def load_plan(path: Path) -> Plan:
    """The plan in a file. Raises CaseError with all problems, line and column where they are known."""
    tree = read_file(path)
    if tree.problems:
        raise CaseError(tree.problems)
    try:
        return Plan.model_validate(tree.data)
    except ValidationError as error:
        found = (replace(p, path="(plan)") if p.path == "(case)" else p for p in report(error, Plan, tree.data))
        raise CaseError([placed(problem, tree.places, []) for problem in found]) from None


def find_plans(names: Sequence[str] = (), folder: Path | None = None) -> dict[str, Path]:
    """Plan files by name: those named, else all of a folder (default: the shipped ones).

    Raises CaseError where there are none, or none of a name.
    """
    place = folder or SHIPPED
    files = {path.stem: path for path in sorted(place.glob("*.yaml"))}
    if not files:
        remedy = "name a folder of plans; the shipped ones come with a checkout of the project"
        raise CaseError([Problem("--plans", str(place), "holds no *.yaml files", remedy)])
    unknown = [name for name in names if name not in files]
    if unknown:
        raise CaseError([Problem("CASE", name, "there is no such benchmark", suggestion(name, files)) for name in unknown])
    return {name: files[name] for name in dict.fromkeys(names or files)}


def planned(name: str, path: Path, level: str) -> Planned:
    """A plan with its case and the sweep of a level, each of its runs a valid case.

    Raises CaseError that names choice and spacing of the first run that is none.
    """
    plan = load_plan(path)
    file = (path.parent / plan.case).resolve()
    case = load_case(file)
    effort = plan.effort(level)
    chosen = effort.choices if effort.choices is not None else tuple(plan.choices)
    sweep = Sweep.model_validate(
        {
            "case": str(file),
            "parameters": {"particle_spacing": list(effort.particle_spacing)},
            "settings": dict(plan.settings),
            "variants": {choice: dict(plan.choices[choice]) for choice in chosen},
            "measure": {column: {"reference": reference} for column, reference in plan.errors.items()},
            "wall_time": effort.wall_time,
            "warm_up": True,
            "repeats": REPEATS,
        }
    )
    for point in points_of(sweep):
        _check(path.name, plan, case, sweep, point)
    return Planned(name, plan, case, sweep)


def _check(name: str, plan: Plan, case: Case, sweep: Sweep, point: Mapping[str, Any]) -> None:
    """Raise CaseError if a run is no valid case, or has not the references that the plan names."""
    try:
        run = case.replace({"output.checkpoint": "none", **sweep.changes(point)})
    except CaseError as error:
        at = f"{name}: choices.{point[VARIANT]} at {point['particle_spacing']:g}"
        raise CaseError([replace(problem, path=f"{at}: {problem.path}") for problem in error.problems]) from None
    missing = [reference for reference in plan.errors.values() if reference not in run.reference]
    if missing:
        rule, remedy = "the case has no such reference", suggestion(missing[0], run.reference)
        raise CaseError([Problem(f"{name}: errors", missing[0], rule, remedy)])
