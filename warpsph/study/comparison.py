"""Comparison of a run with the references that its case names, from what the run wrote.

Each entry of the case's `reference` gives one result, a dict with the keys

    quantity    name of the entry
    value       what the run gave
    reference   what it should be
    error       relative unless `note` says absolute; signed for a single number, else a norm and never
    negative allowed     largest acceptable |error|, or None
    passed      whether |error| <= allowed; None if there is nothing to judge
    unit        of value and reference
    source      where the reference comes from, or None
    note        how the number came about, or why there is none; empty if there is nothing to say

`value`, `reference` and `error` are None when an entry cannot be evaluated, e.g. because the run ended
before the time that it is about ("not reached"). A comparison never stops a run that has been computed:
what is missing becomes a note.

With f the run's values and g the reference's, at the same times, points or particles:

| norm | error | value and reference are |
|---|---|---|
| single number, curve: reduce | (f - g) / g | f and g |
| curve, curves: max | max abs(f - g) / s | f and g where the error is largest |
| curve, curves: rms | sqrt(mean (f - g)^2) / s | their root mean squares |
| curve, curves: final | abs(f - g) / s at the last time | f and g there; curves: rms of the last profile |
| particles: l1 | mean abs(f - g) / mean abs(g) | mean abs(f) and mean abs(g) |
| particles: l2 | sqrt(sum abs(f - g)^2 / sum abs(g)^2) | their root mean squares |
| particles: max | max abs(f - g) / max abs(g) | max abs(f) and max abs(g) |
| interface | wrong area / area of the fluid or of the phase | wrong area and the area that divides it |

s is the largest abs(g) (relative_to: peak; of each profile for itself), abs(g) at the first time (initial),
abs(g) at each time or position (pointwise; where g is 0 nothing is compared), or 1 (absolute). abs of a vector is its
length. The wrong area is that of the particles whose centres lie on the other side of the reference interface than
their phase.

`reduce: noise` is the root mean square of what is left of a column when a parabola, fitted by least squares to the rows
within half a `span` of each row, is taken off there (the filter of Savitzky and Golay 1964). It passes what rings with
periods up to the span and is blind to slower motion: of a sine it leaves 1.0 to 1.2 of the amplitude at periods of half a
span or less, 0.24 at a whole span, 0.02 at two and 0.001 at four. Of a curve it is that of the line through its points at
the times of the gauge: a curve with fewer than eight points a span has lost what rings, and is not compared.
"""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.columns import column_formula
from warpsph.errors import CaseError, ExpressionError, WarpsphError, listed, short
from warpsph.files.output import Series, last_particles
from warpsph.files.vtp import read_vtp
from warpsph.measure.contour import crossings_above, join_ends
from warpsph.measure.gauge_files import read_gauge
from warpsph.measure.gauges import GaugeSet, schedule_of
from warpsph.snapshot import Snapshot
from warpsph.study.plot import read_segments

Columns = dict[str, np.ndarray]

_POINTS_A_SPAN = 8  # rows that a parabola with something left over needs


class _NotComparable(Exception):
    """Why an entry has no result; the text becomes its note."""


def compare(
    case: Any,
    folder: Path | None = None,
    *,
    gauges: GaugeSet | None = None,
    snapshot: Snapshot | None = None,
    end_time: float | None = None,
    frames: Path | None = None,
) -> list[dict[str, Any]]:
    """Evaluate the references of a case; one dict an entry, in the order of the case (keys: see the module).

    folder: run folder, whose gauges/*.csv and last particle frame are read
    gauges, snapshot: taken instead of the files where given
    end_time: simulated time that the run reached [s]; without it the last row of each gauge decides
    frames: run folder of whose particle files those of given times are read, if not `folder`
    """
    source = _Source(case, folder, gauges, snapshot, end_time, frames)
    results = []
    for quantity, spec in (case.reference or {}).items():
        result: dict[str, Any] = {
            "quantity": quantity,
            "value": None,
            "reference": None,
            "error": None,
            "allowed": spec.allowed,
            "passed": None,
            "unit": "",
            "source": spec.source,
            "note": "",
        }
        try:
            result.update(_evaluate(spec, source))
        except (_NotComparable, WarpsphError) as reason:
            result["note"] = str(reason)
        error = result["error"]
        if error is not None and not math.isfinite(error):
            result["note"] = "; ".join(filter(None, [result["note"], "not a finite number"]))
        if error is not None and spec.allowed is not None:
            result["passed"] = bool(abs(error) <= spec.allowed)
        results.append(result)
    return results


def format_comparison(results: list[dict[str, Any]]) -> list[str]:
    """One line of text an entry, for logs."""
    lines = []
    for result in results:
        if result["error"] is None:
            lines.append(f"{result['quantity']}: {result['note']}")
            continue
        unit = f" {result['unit']}" if result["unit"] not in ("", "1") else ""
        text = f"{result['quantity']}: {result['value']:.6g}{unit}, "
        text += f"reference {result['reference']:.6g}{unit}, "
        absolute = result["note"].startswith("absolute")
        text += f"error {result['error']:.3g}{unit}" if absolute else f"error {100 * result['error']:.3g} %"
        if result["allowed"] is not None:
            limit = f"{result['allowed']:.3g}{unit}" if absolute else f"{100 * result['allowed']:.3g} %"
            text += f" (allowed {limit}{'' if result['passed'] else ', EXCEEDED'})"
        if result["note"]:
            text += f"; {result['note']}"
        lines.append(text)
    return lines


def _evaluate(spec: Any, source: _Source) -> dict[str, Any]:
    """The entries of a result that depend on the run."""
    # The kinds of entries differ in which of these keys they have.
    kinds = (("interface", _interface), ("exact", _exact), ("curves", _profiles), ("curve", _curve), ("value", _value))
    for key, function in kinds:
        if getattr(spec, key, None) is not None:
            return function(spec, source)
    raise _NotComparable("has none of value, curve, curves, exact, interface")


# ------------------------------------------------------------------------------------------------------------
# What the run gave


class _Source:
    """Where gauges and particles come from: memory or the run folder."""

    def __init__(
        self,
        case: Any,
        folder: Path | None,
        gauges: GaugeSet | None,
        snapshot: Snapshot | None,
        end_time: float | None,
        frames: Path | None = None,
    ) -> None:
        self.case = case
        self.folder = folder
        self._gauges = gauges
        self._snapshot = snapshot
        self._end_time = end_time
        self._frames = folder if frames is None else frames

    def gauge(self, name: str) -> tuple[Columns, dict[str, str]]:
        """Columns and units of a gauge."""
        if self._gauges is not None and name in self._gauges.gauges:
            columns, units = self._gauges.series(name), self._gauges.units(name)
        elif self.folder is not None:
            columns, units = read_gauge(self.folder / "gauges" / f"{name}.csv")
        else:
            raise _NotComparable(f"there is no gauge {name!r}")
        if not len(columns["time"]):
            raise _NotComparable(f"not reached: the gauge {name!r} has no rows")
        return columns, units

    def column(self, spec: Any) -> tuple[np.ndarray, np.ndarray, str]:
        """Times, values and unit of a gauge's column, or of arithmetic of its columns."""
        columns, units = self.gauge(spec.gauge)
        values, unit = pick_column(columns, units, spec.column)
        return columns["time"], values, unit

    def end(self, times: np.ndarray) -> float:
        """The time that the run reached; `times` are those of the gauge in question."""
        return self._end_time if self._end_time is not None else float(times[-1])

    def particles(self) -> Snapshot:
        """Fluid particles at the end."""
        if self._snapshot is not None:
            return self._snapshot.fluid
        if self.folder is None:
            raise _NotComparable("there are no particles")
        return last_particles(self.folder, self.case.dimension).fluid

    def particles_at(self, time: float) -> Snapshot:
        """Fluid particles at a time [s]."""
        slack = 1e-6 * max(abs(time), 1e-300)
        if self._snapshot is not None and abs(self._snapshot.time - time) <= slack:
            return self._snapshot.fluid
        reached = self._end_time
        if self._frames is not None:
            series = Series(self._frames / "particles", "fluid")
            series.read()
            for moment, name in series.frames:
                if abs(moment - time) <= slack:
                    return read_vtp(series.path.parent / name, self.case.dimension).fluid
            if reached is None and series.frames:
                reached = series.frames[-1][0]
        if reached is not None and reached < time - slack:
            raise _NotComparable(f"not reached: needs t = {time:g} s, the run ended at {reached:g} s")
        raise _NotComparable(f"there is no particle file of t = {time:g} s")


def pick_column(columns: Columns, units: Mapping[str, str], text: str) -> tuple[np.ndarray, str]:
    """Values and unit of a column, or of arithmetic of columns such as `2 * kinetic` or `highest_x gas - lowest_x gas`.

    The unit is empty where it does not follow from sums and differences.
    """
    if text in columns:
        return columns[text], units.get(text, "")
    try:
        expression, called = column_formula(columns, text)
        values = expression.evaluate(finite=False, **{word: columns[name] for word, name in called.items()})
    except ExpressionError as error:
        raise _NotComparable(f"there is no column {short(text)!r}; there are {listed(columns)}") from error
    found = {units.get(called[word], "") for word in expression.names}
    return values, found.pop() if len(found) == 1 and not set("*/") & set(text) else ""


def _read_table(case: Any, name: str) -> Columns:
    """Columns of a reference file by name; cells that are not numbers are nan."""
    path: Path = case.reference_file(name)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise _NotComparable(f"the reference file {path} cannot be read: {error}") from error
    if not rows:
        raise _NotComparable(f"the reference file {path} is empty")
    heading = [cell.strip() for cell in rows[0]]
    return {key: np.array([_number(row, place) for row in rows[1:]]) for place, key in enumerate(heading)}


def _number(row: list[str], place: int) -> float:
    try:
        return float(row[place])
    except (ValueError, IndexError):
        return math.nan


def _reference_column(table: Columns, key: str, file: str) -> np.ndarray:
    if key not in table:
        raise _NotComparable(f"{file} has no column {key!r}; it has {listed(table)}")
    return table[key]


# ------------------------------------------------------------------------------------------------------------
# The five kinds of entries


def _value(spec: Any, source: _Source) -> dict[str, Any]:
    """A column reduced to a number, against a number."""
    reference = float(spec.value)
    note = ""
    if spec.reduce == "slope":
        value, unit, note = _slope(spec, source)
    else:
        times, values, unit = source.column(spec)
        inside = _in_window(spec, source, times)
        times, values = times[inside], values[inside]
        if spec.reduce != "final":
            _check_beginning(spec, source, times[0])
        if spec.reduce == "noise":
            value, note = noise(times, values, spec.span), f"about parabolas of {spec.span:g} s"
        elif spec.reduce == "farthest":
            value = float(values[np.argmax(np.abs(values - reference))])
        elif spec.reduce == "change":
            if values[0] == 0.0:
                raise _NotComparable("it begins with 0, which nothing can be relative to")
            change = values / values[0] - 1.0
            value, unit = float(change[np.argmax(np.abs(change))]), "1"
        else:
            value, unit, note = _reduced(spec.reduce, times, values, unit)
    result = {"value": value, "reference": reference, "unit": unit}
    if reference == 0.0:
        note = "; ".join(filter(None, ["absolute error, as the reference is 0", note]))
        return {**result, "error": value, "note": note}
    return {**result, "error": (value - reference) / reference, "note": note}


def _in_window(spec: Any, source: _Source, times: np.ndarray) -> np.ndarray:
    """Which rows of a gauge lie in the window of an entry; all if it has none."""
    if spec.window is None:
        return np.ones(len(times), bool)
    start, end = spec.window
    reached = source.end(times)
    if end > reached * (1 + 1e-9):
        raise _NotComparable(f"not reached: needs t = {end:g} s, the run ended at {reached:g} s")
    inside = (times >= start * (1 - 1e-9)) & (times <= end * (1 + 1e-9))
    if not inside.any():
        raise _NotComparable(f"the gauge {spec.gauge!r} has no row from {start:g} to {end:g} s")
    return np.asarray(inside)


def _check_beginning(spec: Any, source: _Source, first: float) -> None:
    """Refuse to reduce rows of which the first ones are missing, those before a restart into another folder.

    first: time of the first row in the window of the entry [s]
    """
    schedule = schedule_of(source.case.gauges[spec.gauge])
    if spec.window is not None:
        schedule.advance(spec.window[0] * (1 - 1e-8))
    if first > schedule.next + max(1e-6 * first, 0.5 * (schedule.interval or 0.0)):
        raise _NotComparable(
            f"the gauge {spec.gauge!r} has no rows from {schedule.next:g} to {first:g} s: the run goes on from a checkpoint"
        )


REDUCTIONS: dict[str, Callable[[np.ndarray], float]] = {
    "mean": lambda values: float(np.mean(values)),
    "max": lambda values: float(np.max(values)),
    "min": lambda values: float(np.min(values)),
    "final": lambda values: float(values[-1]),
    "rms": lambda values: float(np.sqrt(np.mean(values**2))),
}


def _reduced(reduce: str, times: np.ndarray, values: np.ndarray, unit: str) -> tuple[float, str, str]:
    """One number from the rows of a window, its unit and a note; the ways that need nothing but the rows."""
    if reduce == "period":
        return period(times, values), "s", ""
    if reduce in ("peak", "peak_time", "trough", "trough_time"):
        at, value = extreme(times, values, highest=reduce.startswith("peak"))
        return (at, "s", f"{value:.6g} there") if reduce.endswith("_time") else (value, unit, f"at {at:.6g} s")
    return REDUCTIONS[reduce](values), unit, ""


def noise(times: np.ndarray, values: np.ndarray, span: float) -> float:
    """Root mean square of the deviations of rows from the parabolas through their surroundings, see the module.

    times, values: (n,), s and the unit of the result
    span: s; rows nearer to either end than half of it are part of parabolas only

    Raises _NotComparable if no row has a whole span around it with eight rows in it, or values are not finite.
    """
    if not np.isfinite(values).all():
        raise _NotComparable("not a finite number in the window")
    half = 0.5 * span * (1 + 1e-9)
    first, last = np.searchsorted(times, times - half), np.searchsorted(times, times + half, side="right")
    whole = (times - times[0] >= half * (1 - 1e-8)) & (times[-1] - times >= half * (1 - 1e-8))
    whole &= last - first >= _POINTS_A_SPAN
    if not whole.any():
        raise _NotComparable(f"noise needs eight rows within {span:g} s, and a window longer than that")
    left = []
    for row in np.flatnonzero(whole):
        near = slice(first[row], last[row])
        fit = np.polynomial.polynomial.polyfit(times[near] - times[row], values[near], 2)
        left.append(values[row] - fit[0])
    return float(np.sqrt(np.mean(np.square(left))))


def period(times: np.ndarray, values: np.ndarray) -> float:
    """Mean time [s] between upward crossings of the mean value, each interpolated between two rows.

    Raises _NotComparable for fewer than two crossings.
    """
    level = values - values.mean()
    up = np.flatnonzero((level[:-1] < 0) & (level[1:] >= 0))
    if len(up) < 2:
        raise _NotComparable("fewer than two periods in the window")
    crossings = times[up] - level[up] * (times[up + 1] - times[up]) / (level[up + 1] - level[up])
    return float(np.mean(np.diff(crossings)))


def extreme(times: np.ndarray, values: np.ndarray, highest: bool) -> tuple[float, float]:
    """Time [s] and value of the highest or lowest point of the cubic that fits the rows best.

    A smooth curve is followed and noise is not: the largest of many noisy values is too large, and its time arbitrary.
    Where the cubic has no such point between the first and the last row, the better end is taken.

    Raises _NotComparable for fewer than eight rows, or values that are not finite.
    """
    if len(times) < 8 or not np.isfinite(values).all():
        raise _NotComparable("a cubic needs eight rows with numbers in the window")
    cubic = np.polynomial.Polynomial.fit(times, values, 3)
    # Roots of the slope c + b x + a x^2 by the form that keeps its digits when a is rounding alone, as at a symmetric peak.
    c, b, a = np.append(cubic.deriv().coef, [0.0, 0.0])[:3]
    square = b * b - 4.0 * a * c
    q = -0.5 * (b + math.copysign(math.sqrt(square), b)) if square >= 0.0 else 0.0
    roots = [top / bottom for top, bottom in ((c, q), (q, a)) if q != 0.0 and bottom != 0.0]
    turns = np.asarray(np.polynomial.polyutils.mapdomain(np.array(roots), cubic.window, cubic.domain))
    candidates = np.concatenate([turns[(turns > times[0]) & (turns < times[-1])], times[[0, -1]]])
    found = cubic(candidates)
    best = int(np.argmax(found) if highest else np.argmin(found))
    return float(candidates[best]), float(found[best])


def _slope(spec: Any, source: _Source) -> tuple[float, str, str]:
    """Slope of a straight line through a part of the last profile of a line gauge, its unit, and the time of it.

    Of a parabola it is the exact slope in the middle of the part.
    """
    columns, units = source.gauge(spec.gauge)
    values, unit = pick_column(columns, units, spec.column)
    distance = _distance(columns, source.case.gauges[spec.gauge])
    window = _in_window(spec, source, columns["time"])
    moment = columns["time"][window][-1]
    first, last = spec.between if spec.between is not None else (0.0, distance.max())
    slack = 1e-9 * distance.max()
    rows = _rows_at(columns["time"], moment) & (distance >= first - slack) & (distance <= last + slack)
    rows &= np.isfinite(values)
    if rows.sum() < 2:
        raise _NotComparable(f"the gauge {spec.gauge!r} has no two points from {first:g} to {last:g} m")
    fit = np.polynomial.Polynomial.fit(distance[rows], values[rows], 1)
    return float(fit.deriv()(0.0)), f"{unit}/m" if unit else "", f"at t = {moment:g} s"


def _curve(spec: Any, source: _Source) -> dict[str, Any]:
    """A column over time against a curve, at the gauge's times that the curve and the window cover."""
    times, values, unit = source.column(spec)
    inside = _in_window(spec, source, times)
    times, values = times[inside], values[inside]
    known_times, known = _known_curve(spec, source.case)
    slack = 1e-9 * max(abs(known_times[0]), abs(known_times[-1]))
    covered = (times >= known_times[0] - slack) & (times <= known_times[-1] + slack)
    if not covered.any():
        begin, reached = known_times[0], source.end(times)
        raise _NotComparable(
            f"not reached: the reference begins at {begin:g} s, the run ended at {reached:g} s"
        )
    times, values = times[covered], values[covered]
    reference = np.interp(times, known_times, known)
    if spec.reduce is not None:
        return _reduced_curve(spec, times, values, reference, unit, known_times)
    first = known[0]
    error, worst = _norm(values, reference, spec.norm, spec.relative_to, first)
    note = f"compared over {times[0]:g} to {times[-1]:g} s"
    if spec.relative_to == "absolute":
        note = f"absolute error; {note}"
    result = {"unit": unit, "error": error}
    if spec.norm == "rms":
        result |= {"value": REDUCTIONS["rms"](values), "reference": REDUCTIONS["rms"](reference)}
        return {**result, "note": note}
    if spec.norm == "max":
        note += f", largest at {times[worst]:g} s"
    return {**result, "note": note, "value": float(values[worst]), "reference": float(reference[worst])}


def _reduced_curve(
    spec: Any, times: np.ndarray, values: np.ndarray, reference: np.ndarray, unit: str, known_times: np.ndarray
) -> dict[str, Any]:
    """A column and a curve at the same `times`, each reduced to one number in the same way.

    known_times: those of the points of the curve [s]
    """
    if spec.window is not None:
        slack = 1e-9 * spec.window[1] + 2 * float(np.diff(times).max(initial=0.0))
        if times[-1] < spec.window[1] - slack or times[0] > spec.window[0] + slack:
            raise _NotComparable(f"{spec.curve.file} does not cover the window: {times[0]:g} to {times[-1]:g} s of it alone")
    if spec.reduce == "noise":
        _check_dense(spec, known_times[(known_times >= times[0]) & (known_times <= times[-1])])
        known, value = noise(times, reference, spec.span), noise(times, values, spec.span)
        note = f"about parabolas of {spec.span:g} s"
    else:
        known, _, _ = _reduced(spec.reduce, times, reference, unit)
        value, unit, note = _reduced(spec.reduce, times, values, unit)
    note = "; ".join(filter(None, [f"over {times[0]:g} to {times[-1]:g} s", note]))
    result = {"value": value, "reference": known, "unit": unit}
    if spec.relative_to == "absolute":
        return {**result, "error": value - known, "note": f"absolute error; {note}"}
    if known == 0.0:
        raise _NotComparable("the reference is 0: nothing can be relative to it; relative_to: absolute")
    return {**result, "error": (value - known) / known, "note": note}


def _check_dense(spec: Any, known_times: np.ndarray) -> None:
    """Raise _NotComparable if a curve has too few points, at these times [s], to show noise."""
    each = len(known_times) * spec.span / np.ptp(known_times) if len(known_times) > 1 else 0.0
    if each < _POINTS_A_SPAN:
        raise _NotComparable(f"{spec.curve.file} has {each:.2g} points within {spec.span:g} s: noise needs eight")


def _known_curve(spec: Any, case: Any) -> tuple[np.ndarray, np.ndarray]:
    """Times [s], rising, and values of the reference curve of an entry."""
    table = _read_table(case, spec.curve.file)
    times = _reference_column(table, spec.curve.time, spec.curve.file) * spec.curve.time_scale
    values = _reference_column(table, spec.curve.value, spec.curve.file) * spec.curve.scale
    return _sorted_numbers(times, values, f"{spec.curve.file} has no numbers in these columns")


def _known_profile(spec: Any, table: Columns, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Distances along the line [m], rising, and values of one profile of an entry."""
    at = _reference_column(table, spec.curves.position, spec.curves.file)
    values = _reference_column(table, key, spec.curves.file) * spec.curves.scale
    return _sorted_numbers(at, values, f"{spec.curves.file} has no numbers in the column {key!r}")


def _sorted_numbers(at: np.ndarray, values: np.ndarray, complaint: str) -> tuple[np.ndarray, np.ndarray]:
    """The pairs that are numbers, in the order of `at`; raises _NotComparable if there are none."""
    given = np.isfinite(at) & np.isfinite(values)
    if not given.any():
        raise _NotComparable(complaint)
    order = np.argsort(at[given], kind="stable")
    return at[given][order], values[given][order]


def _distance(columns: Columns, gauge: Any) -> np.ndarray:
    """Distance of the rows of a line gauge from its first point [m]."""
    start = np.asarray(gauge.from_, np.float64)
    axes = ("x", "y", "z")[: len(start)]
    offset = np.stack([columns[axis] for axis in axes], axis=1) - start
    return np.asarray(np.sqrt(np.sum(offset**2, axis=1)))


def _rows_at(times: np.ndarray, moment: float) -> np.ndarray:
    """Which rows of a gauge belong to a time [s]."""
    return np.asarray(np.abs(times - moment) <= 1e-6 * max(abs(moment), 1e-300))


def _profiles(spec: Any, source: _Source) -> dict[str, Any]:
    """Profiles along a line against those of a file, at given times."""
    columns, units = source.gauge(spec.gauge)
    values, unit = pick_column(columns, units, spec.column)
    times = columns["time"]
    distance = _distance(columns, source.case.gauges[spec.gauge])
    table = _read_table(source.case, spec.curves.file)

    profiles: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []  # time, distance, run, reference
    missing = []
    first: float | None = None
    for moment, key in sorted(spec.curves.columns.items()):
        at, known = _known_profile(spec, table, key)
        if first is None:
            first = float(np.abs(known).max())
        rows = _rows_at(times, moment)
        slack = 1e-9 * np.abs(at).max()
        rows &= (distance >= at[0] - slack) & (distance <= at[-1] + slack)
        if not rows.any():
            missing.append(moment)
            continue
        profiles.append((moment, distance[rows], values[rows], np.interp(distance[rows], at, known)))
    if not profiles:
        raise _NotComparable(
            f"not reached: needs t = {missing[0]:g} s, the run ended at {source.end(times):g} s"
            if missing[0] > source.end(times)
            else f"the gauge {spec.gauge!r} has no rows at {', '.join(f'{time:g}' for time in missing)} s"
        )
    assert first is not None

    if spec.norm == "final":
        profiles = profiles[-1:]
    norm = "rms" if spec.norm == "final" else spec.norm
    errors = [_norm(run, known, norm, spec.relative_to, first) for _, _, run, known in profiles]
    largest = int(np.argmax([error if math.isfinite(error) else math.inf for error, _ in errors]))
    moment, at, run, known = profiles[largest]
    error, worst = errors[largest]
    percent = (1.0, "") if spec.relative_to == "absolute" else (100.0, " %")
    each = ", ".join(
        f"{percent[0] * one:.3g}{percent[1]} at {time:g} s" for (one, _), (time, *_) in zip(errors, profiles, strict=True)
    )
    note = each + (f"; no rows at {', '.join(f'{time:g}' for time in missing)} s" if missing else "")
    if spec.relative_to == "absolute":
        note = f"absolute error; {note}"
    result = {"unit": unit, "error": error, "note": note}
    if norm == "rms":
        return {**result, "value": REDUCTIONS["rms"](run), "reference": REDUCTIONS["rms"](known)}
    note += f"; largest at {at[worst]:g} m along the line"
    return {**result, "note": note, "value": float(run[worst]), "reference": float(known[worst])}


def _norm(
    values: np.ndarray, reference: np.ndarray, norm: str, relative_to: str, first: float
) -> tuple[float, int]:
    """The error as the table of the module defines it, and the place of the largest (`final`: the last)."""
    difference = np.abs(values - reference)
    if relative_to == "pointwise":
        used = np.flatnonzero(reference)
        if not len(used):
            raise _NotComparable("the reference is 0 everywhere: nothing can be relative to it")
        relative = difference[used] / np.abs(reference[used])
    else:
        used = np.arange(len(values))
        scale = {"initial": abs(first), "absolute": 1.0}.get(relative_to, float(np.abs(reference).max()))
        if scale == 0.0:
            raise _NotComparable(f"the reference's {relative_to} value is 0: nothing can be relative to it")
        relative = difference / scale
    if norm == "final":
        return float(relative[-1]), int(used[-1])
    if norm == "rms":
        return float(np.sqrt(np.mean(relative**2))), int(used[relative.argmax()])
    # argmax takes a nan for the largest, which is what it deserves
    return float(relative.max()), int(used[relative.argmax()])


def _interface(spec: Any, source: _Source) -> dict[str, Any]:
    """The particles on the wrong side of a reference interface."""
    line = spec.interface
    try:
        segments = read_segments(source.case.reference_file(line.file), line.scale, line.offset, line.mirror)
    except CaseError as error:
        raise _NotComparable("; ".join(f"{problem.value} {problem.rule}" for problem in error.problems)) from error
    particles = source.particles_at(line.time)
    volume = np.asarray(particles.volume, np.float64)
    if not len(particles) or not np.isfinite(volume).all():
        raise _NotComparable(f"the particles of t = {line.time:g} s have no volumes: write mass and density")
    belongs = crossings_above(particles.position, join_ends(segments)) % 2 == 1
    mine = particles.phase == source.case.phase_names.index(spec.phase)
    wrong = float(volume[belongs != mine].sum())
    total = float(volume.sum() if spec.relative_to == "domain" else volume[belongs].sum())
    share = volume[belongs & ~mine].sum() / wrong if wrong > 0.0 else 0.0
    note = f"of the area of {'all fluid' if spec.relative_to == 'domain' else spec.phase} at t = {particles.time:g} s"
    if wrong > 0.0:
        note += f"; {100 * share:.0f} % of it where {spec.phase} should be"
    if total == 0.0:
        raise _NotComparable(f"nothing of the fluid lies where {spec.phase} should be")
    return {"value": wrong, "reference": total, "error": wrong / total, "unit": "m^2", "note": note}


def _exact(spec: Any, source: _Source) -> dict[str, Any]:
    """A field of the particles against a formula."""
    particles = source.particles()
    values, reference, unit = _field_and_exact(spec, particles)
    remove_mean = bool(getattr(spec, "remove_mean", False))
    if remove_mean:
        weight = particles.volume / particles.volume.sum()
        values, reference = values - weight @ values, reference - weight @ reference
    error, value, size, relative = particle_norm(values, reference, spec.norm)
    note = f"at t = {particles.time:g} s"
    if not relative:
        note = f"absolute error, as the reference is 0; {note}"
    if remove_mean:
        note += ", without the means"
    return {"value": value, "reference": size, "error": error, "unit": unit, "note": note}


def _field_and_exact(spec: Any, particles: Snapshot) -> tuple[np.ndarray, np.ndarray, str]:
    """A field of the particles, (n,) or (n, dimension), what it should be, and its unit."""
    if not len(particles):
        raise _NotComparable("there are no particles")
    values, unit = _field(particles, spec.field)
    exact = [_expression_at(formula, particles) for formula in spec.exact]
    if spec.field == "velocity":
        if len(exact) != particles.dimension:
            raise _NotComparable(f"exact needs {particles.dimension} components, it has {len(exact)}")
        return values, np.stack(exact, axis=1), unit
    if spec.field == "speed" and len(exact) > 1:
        return values, _length(np.stack(exact, axis=1)), unit
    return values, exact[0], unit


def particle_norm(values: np.ndarray, reference: np.ndarray, norm: str) -> tuple[float, float, float, bool]:
    """Error, size of the values, size of the reference, and whether the error is relative to the latter.

    `values` and `reference` are (n,) or (n, dimension); `norm` is l1, l2 or max, see the module.
    """
    difference = _length(values - reference)
    run, known = _length(values), _length(reference)
    reduce: Callable[[np.ndarray], float] = {
        "l1": lambda lengths: float(np.mean(lengths)),
        "l2": lambda lengths: float(np.sqrt(np.mean(lengths**2))),
        "max": lambda lengths: float(np.max(lengths)),
    }[norm]
    error, value, size = reduce(difference), reduce(run), reduce(known)
    return (error / size, value, size, True) if size > 0 else (error, value, size, False)


def _length(values: np.ndarray) -> np.ndarray:
    """Lengths of vectors, absolute values of numbers; (n,) float64."""
    values = np.asarray(values, np.float64)
    return np.abs(values) if values.ndim == 1 else np.sqrt(np.sum(values**2, axis=1))


def _field(particles: Snapshot, name: str) -> tuple[np.ndarray, str]:
    """Values and unit of a particle field."""
    if name == "speed":
        return _length(particles.velocity), "m/s"
    values = np.asarray(getattr(particles, name), np.float64)
    return values, {"velocity": "m/s", "pressure": "Pa", "density": "kg/m^3"}[name]


def _expression_at(formula: Any, particles: Snapshot) -> np.ndarray:
    """Values (n,) of a formula in x, y, z, t and r at the particles."""
    coordinates = dict(zip(("x", "y", "z"), particles.position.T, strict=False))
    return formula.evaluate(**coordinates, t=particles.time)


# ------------------------------------------------------------------------------------------------------------
# What a figure shows


Points = tuple[np.ndarray, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Compared:
    """The data behind one entry of a case's `reference`, for a figure.

    quantity: name of the entry; gauge: that it looks at, empty for particles
    label: what is compared, column or field; unit: its unit
    kind: value, curve, curves or exact, the kind of the entry
    run, reference: of curves a profile for each time [s], else one entry with the key 0: (x, y), each (n,). x is time
        [s], the distance along the line [m], or, of exact, what the particles should have. `reference` is empty for a
        value and for exact.
    value, window, reduce: the reference number, the times [s] that count and how the column becomes a number
    """

    quantity: str
    gauge: str
    label: str
    unit: str
    kind: str
    run: dict[float, Points]
    reference: dict[float, Points] = dataclasses.field(default_factory=dict)
    value: float = math.nan
    window: tuple[float, ...] | None = None
    reduce: str = ""


def compared(case: Any, folder: Path) -> list[Compared]:
    """The data behind the entries of a case's `reference`, from a run folder; what cannot be read is left out."""
    source = _Source(case, folder, None, None, None)
    found = []
    for quantity, spec in case.reference.items():
        try:
            found.append(_data(quantity, spec, source))
        except (_NotComparable, WarpsphError):
            continue
    return found


def _data(quantity: str, spec: Any, source: _Source) -> Compared:
    if getattr(spec, "interface", None) is not None:
        raise _NotComparable("a line in the plane is no curve over something")
    if getattr(spec, "reduce", "") == "slope":
        raise _NotComparable("the slope of a profile is no curve over time")
    if getattr(spec, "exact", None) is not None:
        values, reference, unit = _field_and_exact(spec, source.particles())
        return Compared(quantity, "", spec.field, unit, "exact", {0.0: (_signed(reference), _signed(values))})
    if getattr(spec, "curves", None) is not None:
        columns, units = source.gauge(spec.gauge)
        values, unit = pick_column(columns, units, spec.column)
        distance = _distance(columns, source.case.gauges[spec.gauge])
        table = _read_table(source.case, spec.curves.file)
        run, known = {}, {}
        for moment, key in sorted(spec.curves.columns.items()):
            rows = _rows_at(columns["time"], moment)
            if rows.any():
                run[moment] = distance[rows], values[rows]
                known[moment] = _known_profile(spec, table, key)
        return Compared(quantity, spec.gauge, spec.column, unit, "curves", run, known)
    times, values, unit = source.column(spec)
    if getattr(spec, "curve", None) is not None:
        return Compared(
            quantity, spec.gauge, spec.column, unit, "curve",
            {0.0: (times, values)}, {0.0: _known_curve(spec, source.case)},
        )  # fmt: skip
    return Compared(
        quantity, spec.gauge, spec.column, unit, "value", {0.0: (times, values)},
        value=spec.value, window=spec.window, reduce=spec.reduce,
    )  # fmt: skip


def _signed(values: np.ndarray) -> np.ndarray:
    """Numbers as they are, vectors as their lengths."""
    return values if values.ndim == 1 else _length(values)
