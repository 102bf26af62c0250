"""The file of a sweep: a base case, parameters, how they are combined, and what is measured of each run.

    case: shear_drop.yaml            # beside this file
    method: grid                     # grid, list, latin_hypercube, sobol
    parameters:
      particle_spacing: [1/8, 1/16]            # a key of the case, as with --set
      Ca: {from: 0.1, to: 0.4, number: 4}      # used in `settings` below: no key of the case itself
    settings:
      surface_tension.0.coefficient: 1/0.1/{Ca}
    measure:
      D: {gauge: drop, column: deformation drop, reduce: mean, window: [2, 3]}
      error: {reference: deformation}
    variants:                                  # each at every point
      default: {}
      wide: {numerics.smoothing_ratio: 2.5}
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, StrictStr, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from warpsph.case.reports import report
from warpsph.case.values import (
    AlsoWritten,
    CaseModel,
    ChoiceRule,
    FreezeMapping,
    FrozenDict,
    Name,
    Number,
    NumberRule,
    PositiveNumber,
    Times,
    as_list,
    as_mapping,
    bad_value,
    suggestion,
)
from warpsph.case.yaml_text import Tree, placed, read_file
from warpsph.errors import CaseError, Problem

PLACEHOLDER = re.compile(r"\{([^{}]+)\}")
"""A parameter in the text of a setting, `{Ca}`."""

VARIANT = "variant"
"""Column of the name of a variant."""

ALWAYS = (
    "run", "status", "problem", "seconds", "setup_seconds", "cpu_seconds", "steps", "particles", "memory_bytes", "time",
)  # fmt: skip
"""Columns that every table of a sweep has, besides those of the parameters and measurements."""


def _as_values(value: Any) -> Any:
    """Short form of a parameter: the list of its values."""
    return {"values": value} if isinstance(value, list | tuple) else value


def _as_plain_values(value: Any) -> Any:
    """Values of a parameter: numbers, arithmetic such as 1/8, words; no nested data."""
    values = as_list(value)
    if not values:
        raise bad_value("needs at least one value")
    for item in values:
        if not isinstance(item, int | float | str):
            raise bad_value("needs numbers or words as values", "name a key below that holds a single value")
    return tuple(_number_or_word(item) for item in values)


def _number_or_word(value: Any) -> Any:
    """Arithmetic as the number that it is; true, false and other text as they are."""
    if not isinstance(value, str):
        return value
    try:
        return NumberRule().validate(value)
    except PydanticCustomError:
        return value


class Parameter(CaseModel):
    """What a parameter runs through: its values, or a range that points are taken from."""

    values: Annotated[tuple[Any, ...], BeforeValidator(_as_plain_values)] | None = Field(
        default=None, description="the values, numbers or words", examples=["[0.1, 0.2]"]
    )
    from_: Number | None = Field(default=None, alias="from", description="lower end of the range", examples=["0.1"])
    to: Number | None = Field(default=None, description="upper end of the range", examples=["0.4"])
    number: Annotated[int, NumberRule(least=2, integer=True)] | None = Field(
        default=None, description="how many values a grid takes of the range, both ends included", examples=["4"]
    )
    spacing: Annotated[Literal["linear", "log"], ChoiceRule()] = Field(
        default="linear", description="whether values, or their logarithms, are spread evenly", examples=["log"]
    )

    @model_validator(mode="after")
    def _values_or_range(self) -> Self:
        if (self.values is None) == (self.from_ is None or self.to is None):
            raise bad_value("needs either values, or from and to", "write e.g. {from: 0.1, to: 0.4, number: 4}")
        if self.values is not None and self.number is not None:
            raise bad_value("has values and a number", "delete one")
        if self.from_ is not None and self.to is not None:
            if not self.from_ < self.to:
                raise bad_value("needs from below to")
            if self.spacing == "log" and self.from_ <= 0:
                raise bad_value("needs a range above 0 for spacing: log")
        return self


class Measurement(CaseModel):
    """One number that is taken of a run: of a gauge, or of a reference of the case."""

    gauge: Name | None = Field(default=None, description="gauge of the case", examples=["drop"])
    column: StrictStr | None = Field(
        default=None, description="column of the gauge, or arithmetic of its columns", examples=["deformation drop"]
    )
    reduce: Annotated[Literal["final", "mean", "max", "min", "rms"], ChoiceRule()] = Field(
        default="final", description="how the rows become one number", examples=["mean"]
    )
    window: Times | None = Field(default=None, description="first and last time of the rows, s", examples=["[2, 3]"])
    reference: Name | None = Field(default=None, description="reference of the case: its error", examples=["decay"])

    @model_validator(mode="after")
    def _gauge_or_reference(self) -> Self:
        if (self.gauge is None) == (self.reference is None):
            raise bad_value("needs a gauge or a reference", "write e.g. {gauge: energy, column: kinetic}")
        if self.gauge is not None and self.column is None:
            raise bad_value("needs a column of the gauge", "add e.g. column: kinetic")
        if self.window is not None and len(self.window) != 2:
            raise bad_value("needs a window of two times", "write e.g. window: [2, 3]")
        return self


def as_settings(value: Any) -> Any:
    """Settings with dotted keys."""
    for key in as_mapping(value):
        if not isinstance(key, str) or not all(key.split(".")):
            raise bad_value("needs dotted keys of the case", "write e.g. phases.water.density: 900")
    return value


_Parameter = Annotated[Parameter, AlsoWritten(_as_values, {"type": "array"})]


class Sweep(CaseModel):
    """A sweep as its file describes it."""

    case: StrictStr = Field(description="case file, beside the file of the sweep", examples=["shear_drop.yaml"])
    method: Annotated[Literal["grid", "list", "latin_hypercube", "sobol"], ChoiceRule()] = Field(
        default="grid",
        description="grid: each value with each; list: first values together, second values ...; else samples of ranges",
        examples=["grid"],
    )
    samples: Annotated[int, NumberRule(least=1, integer=True)] | None = Field(
        default=None, description="number of samples, for latin_hypercube and sobol", examples=["64"]
    )
    seed: Annotated[int, NumberRule(least=0, integer=True)] = Field(
        default=0, description="the same seed gives the same samples", examples=["0"]
    )
    parameters: Annotated[
        Mapping[str, _Parameter], FreezeMapping(), BeforeValidator(as_settings), Field(min_length=1)
    ] = Field(description="dotted key of the case, or a name that settings use -> values", examples=["{end_time: [1, 2]}"])
    settings: Annotated[Mapping[str, Any], FreezeMapping(), BeforeValidator(as_settings)] = Field(
        default_factory=FrozenDict,
        description="dotted key of the case -> value of all runs, with {name} for the value of a parameter",
        examples=["{end_time: '10*{period}'}"],
    )
    variants: Annotated[
        Mapping[str, Annotated[Mapping[str, Any], FreezeMapping(), BeforeValidator(as_settings)]], FreezeMapping()
    ] = Field(
        default_factory=FrozenDict,
        description="name -> dotted keys and values, as in `settings` and after these; each is run at every point",
        examples=["{default: {}, quintic: {numerics.kernel: quintic}}"],
    )
    measure: Annotated[Mapping[Name, Measurement], FreezeMapping()] = Field(
        default_factory=FrozenDict, description="name of a column -> what it holds", examples=["{error: {reference: decay}}"]
    )
    wall_time: PositiveNumber | None = Field(
        default=None, description="s that a run may take, with what sets it up; else it failed", examples=["3600"]
    )
    warm_up: bool = Field(
        default=False,
        description="make a few steps first where kernels are new to the process, so that `seconds` hold no compilation",
        examples=["true"],
    )
    repeats: Annotated[int, NumberRule(least=1, integer=True)] = Field(
        default=1,
        description="times that a run shorter than 1 s is made; seconds and cpu_seconds are the least of all",
        examples=["3"],
    )
    keep_runs: bool = Field(default=False, description="keep a run folder of each run", examples=["true"])

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        sampled = self.method in ("latin_hypercube", "sobol")
        if sampled != (self.samples is not None):
            rule = f"needs samples with method: {self.method}" if sampled else f"takes no samples with method: {self.method}"
            raise bad_value(rule, "write e.g. method: sobol, samples: 64")
        for name, parameter in self.parameters.items():
            if sampled and (parameter.values is not None or parameter.number is not None):
                raise bad_value(f"takes {name} from a range with method: {self.method}", "write {from: 0.1, to: 0.4}")
            if not sampled and parameter.values is None and parameter.number is None:
                raise bad_value(f"needs the number of values of {name} with method: {self.method}", "add e.g. number: 4")
        counts = {name: parameter.number or len(parameter.values or ()) for name, parameter in self.parameters.items()}
        if self.method == "list" and len(set(counts.values())) > 1:
            told = ", ".join(f"{name} {count}" for name, count in counts.items())
            raise bad_value(f"needs equally many values of each parameter with method: list, here {told}")
        for name in self.used:
            if name not in self.parameters:
                place = "settings" if name in _names(self.settings) else "variants"
                raise bad_value(f"uses {{{name}}} in {place}, which is no parameter", suggestion(name, self.parameters))
        columns = [*ALWAYS, *self.varied, *self.measure]
        double = [name for name in (*self.measure, *self.varied) if columns.count(name) > 1]
        if double:
            kind = "measurement" if double[0] in self.measure else "parameter"
            raise bad_value(f"has two columns with the name {double[0]}", f"call the {kind} otherwise")
        return self

    @property
    def varied(self) -> list[str]:
        """Names of the columns that tell runs apart: the parameters, and `variant` where there are variants."""
        return [*self.parameters, *([VARIANT] if self.variants else [])]

    @property
    def used(self) -> list[str]:
        """Names of parameters in the texts of `settings` and `variants`, those within lists and mappings too."""
        return _names([self.settings, self.variants])

    def changes(self, point: Mapping[str, Any]) -> dict[str, Any]:
        """Dotted keys of the case and their values at a point of the parameters; numbers stand in brackets in a text."""
        result = {name: value for name, value in point.items() if name in self.parameters and name not in self.used}
        variant = self.variants[point[VARIANT]] if self.variants else {}
        return result | {key: _filled_in(value, point) for key, value in (*self.settings.items(), *variant.items())}

    def to_dict(self) -> dict[str, Any]:
        """Plain data as in a file, without what was left out."""
        plain: dict[str, Any] = self.model_dump(mode="json", by_alias=True, exclude_unset=True)
        return plain


def _texts(value: Any) -> Iterator[str]:
    """All texts in a setting, however deep in lists and mappings they stand; keys are none."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping | list | tuple):
        for item in value.values() if isinstance(value, Mapping) else value:
            yield from _texts(item)


def _names(value: Any) -> list[str]:
    """Names in braces in all texts of a setting, each once."""
    return list(dict.fromkeys(name for text in _texts(value) for name in PLACEHOLDER.findall(text)))


def _filled_in(value: Any, point: Mapping[str, Any]) -> Any:
    """A setting with the values of a point in all its texts."""
    if isinstance(value, str):
        return PLACEHOLDER.sub(lambda found: _bracketed(point[found.group(1)]), value)
    if isinstance(value, Mapping):
        return {key: _filled_in(item, point) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_filled_in(item, point) for item in value]
    return value


def _bracketed(value: Any) -> str:
    """A value in a formula: numbers in brackets, so that a sign or a quotient keeps its meaning; words as they are."""
    if isinstance(value, str) and re.fullmatch(r"[A-Za-z_]\w*", value):
        return value
    return f"({value})" if isinstance(value, str) else f"({value!r})"


def load_sweep(source: Sweep | Path | str | Mapping[str, Any]) -> tuple[Sweep, Path]:
    """The validated sweep that a file or plain data describes, and the folder that its case is looked up in.

    Raises CaseError with all problems, line and column where they are known.
    """
    if isinstance(source, Sweep):
        return source, Path.cwd()
    if isinstance(source, Mapping):
        tree, folder = Tree(dict(source)), Path.cwd()
    elif isinstance(source, Path | str):
        tree, folder = read_file(Path(source)), Path(source).parent
    else:
        raise CaseError([Problem("(sweep)", source, "needs the name of a file or a mapping of keys", "write a sweep file")])
    if tree.problems:
        raise CaseError(tree.problems)
    try:
        return Sweep.model_validate(tree.data), folder
    except ValidationError as error:
        found = (replace(p, path="(sweep)") if p.path == "(case)" else p for p in report(error, Sweep, tree.data))
        problems = [placed(problem, tree.places, []) for problem in found]
        raise CaseError(problems) from None
