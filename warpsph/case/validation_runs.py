"""The section `validation` of a case: the runs of the command `validate`, and their figures."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, StrictStr

from warpsph.case.values import (
    CaseModel,
    ChoiceRule,
    FreezeMapping,
    FrozenDict,
    Name,
    Times,
    as_list,
    as_mapping,
    bad_value,
)

VALIDATION_LEVELS = ("quick", "seed", "fine", "ci")
"""How much work a validation is: minutes on a CPU, the resolution of the published study, finer on a GPU; ci is so coarse
or short that every case is run for each change of the program, and its errors are held to recorded ones."""

_RUN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+=/ -]{0,39}")


def _as_run_name(value: Any) -> str:
    """Names of runs stand in tables and, with _ for what a file name cannot hold, name folders."""
    if not isinstance(value, str):
        raise bad_value("needs text", f'write name: "{value}"' if isinstance(value, int | float) else "")
    if not _RUN_NAME.fullmatch(value):
        raise bad_value("needs 1 to 40 letters, digits, blanks and _ . + = / -, a letter or digit first")
    return value


def _as_changes(value: Any) -> Any:
    """Changes with dotted text as keys and, as elsewhere in a case, `none` for nothing."""
    changes = {}
    for key, item in as_mapping(value).items():
        if not isinstance(key, str) or not all(key.split(".")):
            raise bad_value("needs dotted paths as keys", "write e.g. {phases.water.density: 900}")
        changes[key] = "none" if item is None else item
    return changes


class ValidationRun(CaseModel):
    """One run of a case with some of its values changed."""

    name: Annotated[StrictStr, BeforeValidator(_as_run_name)] = Field(
        description="name of the run in tables and folders", examples=['"100"']
    )
    changes: Annotated[Mapping[str, Any], FreezeMapping(), BeforeValidator(_as_changes)] = Field(
        default_factory=FrozenDict,
        description="dotted path -> value, as with --set; none takes an entry of reference or gauges out",
        examples=["{particle_spacing: 2/100, reference.pressure_jump.allowed: 0.01}"],
    )


def _different_runs(runs: tuple[ValidationRun, ...]) -> tuple[ValidationRun, ...]:
    """Two runs of a level must not share a folder."""
    folders = [re.sub(r"[^a-z0-9.+=-]", "_", run.name.lower()) for run in runs]
    for position, folder in enumerate(folders):
        if folder in folders[:position]:
            raise bad_value(f"has two runs with the name {runs[position].name}", "give each its own name")
    return runs


_Runs = Annotated[tuple[ValidationRun, ...], BeforeValidator(as_list), AfterValidator(_different_runs)]
_THE_FILE = ValidationRun(name="default")


class ValidationFigure(CaseModel):
    """What the figure of each validation run shows of the particles, under the interfaces of `reference`."""

    field: Annotated[Literal["phase", "speed", "pressure", "density", "vorticity"], ChoiceRule()] = Field(
        description="what colours the particles", examples=["phase"]
    )
    times: Times | None = Field(
        default=None,
        description="times of the pictures, s, rising (default: four from start to end)",
        examples=["[0, 1, 2]"],
    )
    phases: Annotated[tuple[Name, ...], Field(min_length=1), BeforeValidator(as_list)] | None = Field(
        default=None,
        description="phases that are drawn; the others are left white, and out of the colour scale (default: all)",
        examples=["[water]"],
    )


class Validation(CaseModel):
    """What `python -m warpsph validate` runs at each level. No part of a run itself."""

    quick: _Runs = Field(
        default=(_THE_FILE,),
        description="runs that take minutes on a CPU (default: the file as it is)",
        examples=['[{name: "52", changes: {}}]'],
    )
    seed: _Runs = Field(
        default=(),
        description="runs at the resolution of the published study",
        examples=['[{name: "100", changes: {particle_spacing: 2/100}}]'],
    )
    fine: _Runs = Field(
        default=(),
        description="finer runs, for a GPU",
        examples=['[{name: "200", changes: {particle_spacing: 2/200}}]'],
    )
    ci: _Runs = Field(
        default=(),
        description="runs of seconds, whose errors are held to recorded ones",
        examples=['[{name: "26", changes: {particle_spacing: 2/26}}]'],
    )
    figure: ValidationFigure | None = Field(
        default=None, description="pictures of the particles", examples=["{field: phase, times: [0, 1]}"]
    )
