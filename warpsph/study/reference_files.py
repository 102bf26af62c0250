"""Tables of reference files: curves over time and profiles along a line."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.errors import listed
from warpsph.study.norms import NotComparable

Columns = dict[str, np.ndarray]


def read_table(case: Any, name: str) -> Columns:
    """Columns of a reference file by name; cells that are not numbers are nan."""
    path: Path = case.reference_file(name)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise NotComparable(f"the reference file {path} cannot be read: {error}") from error
    if not rows:
        raise NotComparable(f"the reference file {path} is empty")
    heading = [cell.strip() for cell in rows[0]]
    return {key: np.array([_number(row, place) for row in rows[1:]]) for place, key in enumerate(heading)}


def _number(row: list[str], place: int) -> float:
    try:
        return float(row[place])
    except (ValueError, IndexError):
        return math.nan


def _column(table: Columns, key: str, file: str) -> np.ndarray:
    if key not in table:
        raise NotComparable(f"{file} has no column {key!r}; it has {listed(table)}")
    return table[key]


def known_curve(spec: Any, case: Any) -> tuple[np.ndarray, np.ndarray]:
    """Times [s], rising, and values of the reference curve of an entry."""
    table = read_table(case, spec.curve.file)
    times = _column(table, spec.curve.time, spec.curve.file) * spec.curve.time_scale
    values = _column(table, spec.curve.value, spec.curve.file) * spec.curve.scale
    return _sorted_numbers(times, values, f"{spec.curve.file} has no numbers in these columns")


def known_profile(spec: Any, table: Columns, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Distances along the line [m], rising, and values of one profile of an entry."""
    at = _column(table, spec.curves.position, spec.curves.file) * spec.curves.position_scale
    values = _column(table, key, spec.curves.file) * spec.curves.scale
    return _sorted_numbers(at, values, f"{spec.curves.file} has no numbers in the column {key!r}")


def _sorted_numbers(at: np.ndarray, values: np.ndarray, complaint: str) -> tuple[np.ndarray, np.ndarray]:
    """The pairs that are numbers, in the order of `at`; raises NotComparable if there are none."""
    given = np.isfinite(at) & np.isfinite(values)
    if not given.any():
        raise NotComparable(complaint)
    order = np.argsort(at[given], kind="stable")
    return at[given][order], values[given][order]
