"""Fronts: which runs nobody beats in both seconds and error, and which to take for an error that is asked for.

A row is a dict with at least `case`, `choice`, `particle_spacing`, `seconds` (s) and `error` (relative); runs that failed
or have no number for either take part in nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from warpsph.study.benchmark_plan import DEFAULT

Row = Mapping[str, Any]

NOISE = 1.1
"""Seconds of equal runs differ by this factor."""

TARGETS = (0.05, 0.01, 0.002)
"""Errors for which a page names what to take."""


def counts(row: Row) -> bool:
    """Whether a row is of a finished run with finite seconds and error."""
    numbers = row.get("seconds"), row.get("error")
    return row.get("status", "finished") == "finished" and all(
        isinstance(number, int | float) and math.isfinite(number) for number in numbers
    )


def seconds_of(row: Row, one_thread: bool) -> float | None:
    """The seconds by which a run is judged, None if it has none.

    On one CPU thread those that the processor worked for it, where they are fewer than those of the clock: what the run
    takes on a machine that does nothing else. Elsewhere those of the clock.
    """
    seconds, worked = row.get("seconds"), row.get("cpu_seconds")
    return min(seconds, worked) if one_thread and seconds is not None and worked else seconds


def beats(row: Row, other: Row) -> bool:
    """Whether a row is at least as quick and as accurate as another one, and better in one of both."""
    no_worse = row["seconds"] <= other["seconds"] and row["error"] <= other["error"]
    return bool(no_worse and (row["seconds"] < other["seconds"] or row["error"] < other["error"]))


def front(rows: Iterable[Row]) -> list[Row]:
    """The rows that none beats, quickest first: of two that are equal in both, both."""
    there = [row for row in rows if counts(row)]
    kept = [row for row in there if not any(beats(other, row) for other in there)]
    return sorted(kept, key=lambda row: (row["seconds"], row["error"]))


def quickest(rows: Iterable[Row], error: float) -> Row | None:
    """The quickest row with at most an error, None if none has it."""
    fit = [row for row in rows if counts(row) and row["error"] <= error]
    return min(fit, key=lambda row: (row["seconds"], row["error"]), default=None)


def quickest_for_sure(rows: Sequence[Row], error: float) -> Row | None:
    """The quickest row with at most an error that no finer run of its choice exceeds, None if none has it.

    Where errors change sign from one resolution to the next, a coarse run may be accurate by accident.
    """
    return next(iter(sure(rows, error)), None)


def sure(rows: Sequence[Row], error: float) -> list[Row]:
    """The rows with at most an error that no finer run of their choice exceeds, quickest first.

    A run of the default form comes before others that are quicker by no more than NOISE: what takes as long is no reason to
    leave it.
    """

    def holds(row: Row) -> bool:
        finer = [other for other in rows if counts(other) and other["choice"] == row["choice"]
                 and other["particle_spacing"] <= row["particle_spacing"]]  # fmt: skip
        return all(other["error"] <= error for other in finer)

    def order(row: Row) -> tuple[float, float]:
        return row["seconds"] / (NOISE if row["choice"] == DEFAULT else 1.0), row["error"]

    return sorted((row for row in rows if counts(row) and holds(row)), key=order)


def most_accurate(rows: Iterable[Row]) -> Row | None:
    """The row with the least error, None if none has one."""
    return min((row for row in rows if counts(row)), key=lambda row: (row["error"], row["seconds"]), default=None)


@dataclass(frozen=True)
class Distance:
    """How far a run of the default form is from the front.

    row: the run
    better: the quickest run of another choice, or resolution, that is at least as accurate; the run itself on the front
    """

    row: Row
    better: Row

    @property
    def factor(self) -> float:
        """How many times the run takes as long as the better one; 1 on the front."""
        return float(self.row["seconds"] / max(self.better["seconds"], 1e-9))


def distances(rows: Sequence[Row]) -> list[Distance]:
    """For each finished run of the default form, coarsest first, how far from the front it is."""
    own = sorted(
        (row for row in rows if row["choice"] == DEFAULT and counts(row)), key=lambda row: -row["particle_spacing"]
    )
    return [Distance(row, quickest(rows, row["error"]) or row) for row in own]


def by_case(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by their case, in the order in which cases come."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row["case"], []).append(row)
    return found
