"""The errors that warpsph raises on purpose, each with the exit code of the command line.

| error | exit code | meaning |
|---|---|---|
| `WarpsphError` | 1 | anything else that warpsph refuses to do |
| `CaseError` | 2 | the case file (or an override) is wrong; lists every problem at once |
| `DivergenceError` | 3 | the state became non-finite or ran away |
| `OutputError` | 4 | results cannot be written |
| `CapacityError` | 5 | the scene does not fit the memory, or a list is full and cannot grow |
| - | 6 | `validate` is done, but a reference was missed or a run failed; `sweep` is done, but a run failed |
| `WallTimeReached` | 7 | the run used up its wall time; the state is in a checkpoint |
| `Interrupted` | 130 | the user stopped the run |
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

__all__ = [
    "MISSING",
    "CapacityError",
    "CaseError",
    "DivergenceError",
    "ExpressionError",
    "Interrupted",
    "OutputError",
    "Problem",
    "WallTimeReached",
    "WarpsphError",
    "listed",
    "short",
]

_LONGEST_VALUE = 60
_LONGEST_PATH = 200
_LONGEST_RULE = 1000
_MOST_PROBLEMS_SHOWN = 50
_MOST_NAMES = 40


class _Missing:
    """Stands for the value of a key that is not there."""

    def __repr__(self) -> str:
        return "(missing)"


MISSING: Any = _Missing()


def _one_line(text: str) -> str:
    """`text` with control characters and line separators escaped, so that a problem stays one line."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def _value_text(value: Any, budget: int = _LONGEST_VALUE, depth: int = 0) -> str:
    """`value` the way a case file writes it, on one line and cut to about `budget` characters."""
    if value is None:
        return "(empty)" if depth == 0 else "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        text = _one_line(value[: budget + 1])
        if text == "" or text != text.strip():
            text = repr(text)
    elif depth > 4:
        text = "..."
    elif isinstance(value, Mapping):
        parts = []
        for key, item in value.items():
            parts.append(f"{_value_text(key, 20, depth + 1)}: {_value_text(item, 20, depth + 1)}")
            if sum(map(len, parts)) > budget:
                break
        text = "{" + ", ".join(parts) + "}"
    elif isinstance(value, list | tuple):
        parts = []
        for item in value:
            parts.append(_value_text(item, 20, depth + 1))
            if sum(map(len, parts)) > budget:
                break
        text = "[" + ", ".join(parts) + "]"
    elif isinstance(value, int):
        # An integer of thousands of digits cannot be turned into text within Python's own limit.
        text = str(value) if value.bit_length() < 1000 else "(a huge integer)"
    else:
        text = _one_line(repr(value))
    return text if len(text) <= budget else text[: budget - 3] + "..."


def short(text: object, longest: int = _LONGEST_VALUE) -> str:
    """Text that somebody else wrote, on one line and cut to `longest` characters, for a message."""
    line = _one_line(str(text)[: longest + 1])
    return line if len(line) <= longest else line[: longest - 3] + "..."


def listed(names: Iterable[object], most: int = _MOST_NAMES) -> str:
    """Names with commas between them, each cut short; of more than `most` the first ones and how many there are."""
    known = [short(name) for name in names]
    return ", ".join(known) if len(known) <= most else ", ".join(known[:most]) + f" ... ({len(known)} in all)"


class WarpsphError(Exception):
    """Base of every error that warpsph raises on purpose; `exit_code` is what the command line returns."""

    exit_code = 1


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with a case.

    path: dotted path of the key, list positions as numbers (`fluids.0.shape.box.lower`); usable in `--set`
    value: the offending value as the user gave it (`MISSING` when there is none)
    rule: what the value has to fulfil
    remedy: what to write instead (may be empty)
    line, column: place in the file, counted from 1, when it is known
    """

    path: str
    value: Any
    rule: str
    remedy: str = ""
    line: int | None = None
    column: int | None = None

    def __str__(self) -> str:
        # Rules and remedies are ours and short, but may quote what the user wrote.
        text = f"{short(self.path, _LONGEST_PATH)}: {_value_text(self.value)} -> {short(self.rule, _LONGEST_RULE)}"
        if self.remedy:
            text += f"; {short(self.remedy, _LONGEST_RULE)}"
        if self.line is not None:
            text += f" (line {self.line}" + (f", column {self.column})" if self.column is not None else ")")
        return text


class CaseError(WarpsphError):
    """A case that cannot be run. `problems` holds all that is wrong; the text has one line a problem."""

    exit_code = 2

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems: list[Problem] = list(problems)
        super().__init__(self.problems)

    def __str__(self) -> str:
        lines = [str(problem) for problem in self.problems[:_MOST_PROBLEMS_SHOWN]]
        hidden = len(self.problems) - len(lines)
        if hidden > 0:
            lines.append(f"... and {hidden} more")
        return "\n".join(lines)


class ExpressionError(CaseError):
    """A text that is not an acceptable expression, or has no finite value where it is needed.

    column: position in the text, counted from 1, when it is known
    """

    def __init__(self, text: str, rule: str, remedy: str = "", column: int | None = None) -> None:
        self.text = text
        self.rule = rule
        self.remedy = remedy
        self.column = column
        if column is not None:
            rule = f"{rule} (column {column} of the expression)"
        self.rule_with_column = rule
        super().__init__([Problem("expression", text, rule, remedy)])

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.text, self.rule, self.remedy, self.column)


class DivergenceError(WarpsphError):
    """The state of the simulation became non-finite or ran away.

    particle: id of the particle that showed it first, time: simulated time in s, quantity: name of the field
    """

    exit_code = 3

    def __init__(self, message: str, *, particle: int, time: float, quantity: str) -> None:
        super().__init__(message)
        self.particle = particle
        self.time = time
        self.quantity = quantity

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (
            type(self),
            str(self),
            {"particle": self.particle, "time": self.time, "quantity": self.quantity},
        )


class OutputError(WarpsphError):
    """Results cannot be written: no permission, disk full, folder in use."""

    exit_code = 4


class CapacityError(WarpsphError):
    """The scene does not fit the memory, or a list is full and cannot grow. `key` is the case key to change."""

    exit_code = 5

    def __init__(self, message: str, *, key: str = "numerics.neighbour_capacity") -> None:
        super().__init__(message if key in message else f"{message}; raise {key}")
        self.key = key

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (type(self), str(self), {"key": self.key})


class Interrupted(WarpsphError):
    """The user stopped the run; the output in progress was finished first."""

    exit_code = 130


class WallTimeReached(Interrupted):
    """The run stopped at the end of the wall time that it was given; the output in progress was finished first."""

    exit_code = 7


def _rebuild(kind: Any, message: str, keywords: dict[str, Any]) -> Any:
    """Make an error with keyword-only arguments again after it crossed a process boundary."""
    return kind(message, **keywords)
