"""Signals: numbers that may depend on time.

In a file: a number, a formula in t ("0.1*sin(2*pi*t)"), or a column of a table,

    {table: shaker.csv, column: acceleration, time: t, interpolation: cubic}

whose file is looked up like a reference file. What does not depend on time stays a plain float, so that code which knows
constants alone goes on as it is; a `Signal` stands where it does.
"""

from __future__ import annotations

import csv
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, PrivateAttr, StrictStr
from pydantic_core import CoreSchema, core_schema

from warpsph.case.expressions import Expression, compile_expression
from warpsph.case.values import (
    CaseModel,
    ChoiceRule,
    FormulaRule,
    NumberRule,
    as_list,
    bad_value,
    formula_pattern,
    suggestion,
)
from warpsph.errors import CaseError, ExpressionError, Problem

Interpolation = Literal["cubic", "linear"]
MOST_BYTES = 500_000_000  # of a table that is read


@dataclass(frozen=True)
class FormulaSignal:
    """A formula in t."""

    expression: Expression

    def at(self, time: ArrayLike) -> NDArray[np.float64]:
        """Values at times [s], float64 of their shape. Raises ExpressionError where one is not finite."""
        return self.expression.evaluate(t=time)

    def plain(self) -> str:
        """As a case file writes it."""
        return self.expression.text


class TableSignal(CaseModel):
    """A column of a CSV file over time, interpolated."""

    table: StrictStr = Field(description="CSV file, relative to the case file", examples=["shaker.csv"])
    column: StrictStr = Field(description="column of the values", examples=["acceleration"])
    time: StrictStr | None = Field(default=None, description="column of the times, s (default the first)", examples=["t"])
    interpolation: Annotated[Interpolation, ChoiceRule()] = Field(
        default="cubic",
        description="cubic: a spline with two continuous derivatives; linear: straight lines",
        examples=["linear"],
    )
    _folder: Path | None = PrivateAttr(None)

    @property
    def path(self) -> Path:
        """The file."""
        return (self._folder or Path()) / self.table

    def rows(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times [s] and values of the table; raises CaseError, with the key `table`, `column` or `time`, if it has none."""
        return read_columns(self.path, self.table, self.column, self.time, _stamp(self.path))

    def at(self, time: ArrayLike) -> NDArray[np.float64]:
        """Values at times [s], float64 of their shape; beyond the ends of the table those of its ends."""
        times, values = self.rows()
        inside = np.clip(np.asarray(time, dtype=np.float64), times[0], times[-1])
        if self.interpolation == "linear" or len(times) < 3:
            return np.asarray(np.interp(inside, times, values), dtype=np.float64)
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(times, values)(inside), dtype=np.float64)

    def plain(self) -> dict[str, Any]:
        """As a case file writes it."""
        return {key: getattr(self, key) for key in type(self).model_fields if key in self.model_fields_set}


Signal = FormulaSignal | TableSignal
Varying = float | FormulaSignal | TableSignal
"""A number, or what stands for one that depends on time."""


@dataclass(frozen=True)
class SignalRule:
    """Validation of a signal: a number or arithmetic stays a number; a formula with t or a mapping becomes a Signal."""

    def validate(self, value: Any, table: Any) -> Varying:
        if isinstance(value, FormulaSignal):
            value = value.plain()
        if isinstance(value, Mapping | TableSignal):
            read: TableSignal = table(value)
            return read
        if not isinstance(value, str):
            number = NumberRule().validate(value)
            assert isinstance(number, float | int)
            return number
        if value.strip() in ("auto", "none", ""):
            raise bad_value("needs a number, a formula in t, or a mapping with the key table")
        try:
            compile_expression(value, names=())
        except ExpressionError:
            return FormulaSignal(FormulaRule(names=("t",)).validate(value))
        number = NumberRule().validate(value)
        assert isinstance(number, float | int)
        return number

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(
            self.validate,
            handler.generate_schema(TableSignal),
            serialization=core_schema.plain_serializer_function_ser_schema(signal_text),
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return signal_schema(handler(schema))


def signal_schema(table: dict[str, Any]) -> dict[str, Any]:
    """JSON schema of what can be written for a signal, from that of a table."""
    text = {"type": "string", "description": "arithmetic, or a formula in t", "pattern": formula_pattern(("t",))}
    return {"anyOf": [{"type": "number"}, text, table]}


def signal_text(value: Varying) -> Any:
    """A signal as a case file writes it: a number stays one."""
    return value if isinstance(value, float | int) else value.plain()


SignalNumber = Annotated[Varying, SignalRule()]
SignalVector = Annotated[tuple[SignalNumber, ...], Field(min_length=1), BeforeValidator(as_list)]


def is_signal(value: Any) -> TypeGuard[Signal]:
    """Whether a value depends on time."""
    return isinstance(value, FormulaSignal | TableSignal)


def varies(vector: Sequence[Varying]) -> bool:
    """Whether any component of a vector depends on time."""
    return any(is_signal(value) for value in vector)


def value_at(value: Varying, time: float) -> float:
    """Value of a signal or number at a time [s]."""
    return float(value) if isinstance(value, float | int) else float(value.at(time))


def vector_at(vector: Sequence[Varying], time: float = 0.0) -> tuple[float, ...]:
    """Values of a vector at a time [s]; constants pass as they are."""
    return tuple(value_at(value, time) for value in vector)


def bound_to(folder: Path | None, value: Any) -> None:
    """Let a table know the folder of its case."""
    if isinstance(value, TableSignal):
        value._folder = folder


def signals_of(case: Any) -> Iterator[tuple[str, Signal]]:
    """Yield (path, signal) of everything in a case, or in the draft of one, that depends on time."""
    entries: list[tuple[str, Any]] = []
    for name in ("gravity", "body_force"):
        entries += [(f"{name}.{k}", value) for k, value in enumerate(getattr(case, name))]
    for axis in "xyz"[: case.dimension]:
        for end in ("lower", "upper"):
            velocity = getattr(getattr(case.domain.boundary, axis), end).velocity
            entries += [(f"domain.boundary.{axis}.{end}.velocity.{k}", value) for k, value in enumerate(velocity)]
    for name, body in case.bodies.items():
        if body.motion is not None:
            entries += [(f"bodies.{name}.motion.{key}", value) for key, value in body.motion.signals()]
    yield from ((path, value) for path, value in entries if is_signal(value))


def _stamp(path: Path) -> int:
    """What changes when a file is written anew; 0 for one that is not there."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


@functools.lru_cache(maxsize=64)
def read_columns(
    path: Path, name: str, column: str, time: str | None, stamp: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [s], rising, and values of a CSV file with a head line.

    path: the file; name: as the case has it, for messages.
    column, time: heads of the columns; no time is the first column.
    stamp: changes when the file does.

    Raises CaseError whose path is the key that is wrong: `table`, `column` or `time`.
    """

    def refused(key: str, value: Any, rule: str, remedy: str) -> CaseError:
        return CaseError([Problem(key, value, rule, remedy)])

    try:
        if not path.is_file():
            raise refused("table", name, f"there is no such file in {path.parent}", "correct the name")
        if path.stat().st_size > MOST_BYTES:
            raise refused("table", name, f"is larger than {MOST_BYTES:,} bytes", "write fewer lines")
        with path.open(newline="", encoding="utf-8-sig") as stream:
            lines = [line for line in csv.reader(stream) if line and not line[0].lstrip().startswith("#")]
    except (OSError, ValueError, csv.Error) as error:
        rule = f"cannot be read ({type(error).__name__})"
        raise refused("table", name, rule, "name a CSV text file") from None
    head = [cell.strip() for cell in lines[0]] if lines else []
    for key, wanted in (("column", column), ("time", time)):
        if wanted is not None and wanted not in head:
            raise refused(key, wanted, f"is not a column of {name}", suggestion(wanted, head))
    places = (0 if time is None else head.index(time)), head.index(column)
    numbers = np.array([[_cell(line, place) for place in places] for line in lines[1:]], dtype=np.float64).reshape(-1, 2)
    if len(numbers) < 2:
        raise refused("table", name, "needs at least two lines of numbers below its head", "add some")
    wrong = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
    if len(wrong):
        raise refused("table", name, f"has no number in line {wrong[0] + 2}", "correct that line")
    falling = np.flatnonzero(np.diff(numbers[:, 0]) <= 0.0)
    if len(falling):
        rule = f"needs rising times, but line {falling[0] + 3} is not later than the one before"
        raise refused("time", head[places[0]], rule, "sort the lines and delete doubles")
    return numbers[:, 0].copy(), numbers[:, 1].copy()


def _cell(line: Sequence[str], place: int) -> float:
    try:
        return float(line[place])
    except (ValueError, IndexError):
        return float("nan")


def check_signal(path: str, value: Any, folder: Path | None, end_time: float) -> Iterator[Problem]:
    """Yield what is wrong with a signal: a table that cannot be read, or that does not last from 0 to the end of the run.

    path: key of the signal; folder: of the case file, None if there is none (then files are not looked at).
    """
    if isinstance(value, FormulaSignal):
        try:
            value.at(0.0)
        except ExpressionError as error:
            yield Problem(path, error.text, error.rule_with_column, error.remedy)
    if not isinstance(value, TableSignal) or folder is None:
        return
    bound_to(folder, value)
    try:
        times, _ = value.rows()
    except CaseError as error:
        yield from (Problem(f"{path}.{p.path}", p.value, p.rule, p.remedy) for p in error.problems)
        return
    if times[0] > 0.0 or times[-1] < end_time * (1.0 - 1e-12):
        rule = f"lasts from {times[0]:g} to {times[-1]:g} s, the run from 0 to {end_time:g} s"
        yield Problem(f"{path}.table", value.table, rule, "lengthen the table, or write a smaller end_time")
