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
| single number | (f - g) / g | f and g |
| curve, curves: max | max abs(f - g) / s | f and g where the error is largest |
| curve, curves: rms | sqrt(mean (f - g)^2) / s | their root mean squares |
| curve, curves: final | abs(f - g) / s at the last time | f and g there; curves: rms of the last profile |
| particles: l1 | mean abs(f - g) / mean abs(g) | mean abs(f) and mean abs(g) |
| particles: l2 | sqrt(sum abs(f - g)^2 / sum abs(g)^2) | their root mean squares |
| particles: max | max abs(f - g) / max abs(g) | max abs(f) and max abs(g) |

s is the largest abs(g) (relative_to: peak; of each profile for itself), abs(g) at the first time (initial),
or abs(g) at each time or position (pointwise; where g is 0 nothing is compared). abs of a vector is its
length.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.errors import ExpressionError, WarpsphError
from warpsph.expressions import compile_expression
from warpsph.gauges import GaugeSet, read_gauge
from warpsph.output import last_particles
from warpsph.snapshot import Snapshot

Columns = dict[str, np.ndarray]


class _NotComparable(Exception):
    """Why an entry has no result; the text becomes its note."""


def compare(
    case: Any,
    folder: Path | None = None,
    *,
    gauges: GaugeSet | None = None,
    snapshot: Snapshot | None = None,
    end_time: float | None = None,
) -> list[dict[str, Any]]:
    """Evaluate the references of a case; one dict an entry, in the order of the case (keys: see the module).

    folder: run folder, whose gauges/*.csv and last particle frame are read
    gauges, snapshot: taken instead of the files where given
    end_time: simulated time that the run reached [s]; without it the last row of each gauge decides
    """
    source = _Source(case, folder, gauges, snapshot, end_time)
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
    for key, function in (("exact", _exact), ("curves", _profiles), ("curve", _curve), ("value", _value)):
        if getattr(spec, key, None) is not None:
            return function(spec, source)
    raise _NotComparable("has none of value, curve, curves, exact")


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
    ) -> None:
        self.case = case
        self.folder = folder
        self._gauges = gauges
        self._snapshot = snapshot
        self._end_time = end_time

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


def pick_column(columns: Columns, units: Mapping[str, str], text: str) -> tuple[np.ndarray, str]:
    """Values and unit of a column, or of arithmetic of columns such as `2 * kinetic`.

    The unit is empty where it does not follow from sums and differences.
    """
    if text in columns:
        return columns[text], units.get(text, "")
    names = [name for name in columns if name.isidentifier()]
    try:
        expression = compile_expression(text, names=names)
        values = expression.evaluate(finite=False, **{name: columns[name] for name in names})
    except ExpressionError as error:
        raise _NotComparable(f"there is no column {text!r}; there are {', '.join(columns)}") from error
    found = {units.get(name, "") for name in expression.names}
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
        raise _NotComparable(f"{file} has no column {key!r}; it has {', '.join(table)}")
    return table[key]


# ------------------------------------------------------------------------------------------------------------
# The four kinds of entries


def _value(spec: Any, source: _Source) -> dict[str, Any]:
    """A column reduced to a number, against a number."""
    times, values, unit = source.column(spec)
    window = getattr(spec, "window", None)
    if window is not None:
        start, end = window
        reached = source.end(times)
        if end > reached * (1 + 1e-9):
            raise _NotComparable(f"not reached: needs t = {end:g} s, the run ended at {reached:g} s")
        inside = (times >= start * (1 - 1e-9)) & (times <= end * (1 + 1e-9))
        if not inside.any():
            raise _NotComparable(f"the gauge {spec.gauge!r} has no row from {start:g} to {end:g} s")
        times, values = times[inside], values[inside]
    if spec.reduce == "period":
        value, unit = period(times, values), "s"
    else:
        value = REDUCTIONS[spec.reduce](values)
    reference = float(spec.value)
    result = {"value": value, "reference": reference, "unit": unit}
    if reference == 0.0:
        return {**result, "error": value, "note": "absolute error, as the reference is 0"}
    return {**result, "error": (value - reference) / reference}


REDUCTIONS: dict[str, Callable[[np.ndarray], float]] = {
    "mean": lambda values: float(np.mean(values)),
    "max": lambda values: float(np.max(values)),
    "min": lambda values: float(np.min(values)),
    "final": lambda values: float(values[-1]),
    "rms": lambda values: float(np.sqrt(np.mean(values**2))),
}


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


def _curve(spec: Any, source: _Source) -> dict[str, Any]:
    """A column over time against a curve, at the gauge's times that the curve covers."""
    times, values, unit = source.column(spec)
    table = _read_table(source.case, spec.curve.file)
    known_times = _reference_column(table, spec.curve.time, spec.curve.file) * spec.curve.time_scale
    known = _reference_column(table, spec.curve.value, spec.curve.file) * spec.curve.scale
    given = np.isfinite(known_times) & np.isfinite(known)
    known_times, known = known_times[given], known[given]
    order = np.argsort(known_times, kind="stable")
    known_times, known = known_times[order], known[order]
    if not len(known):
        raise _NotComparable(f"{spec.curve.file} has no numbers in these columns")
    slack = 1e-9 * max(abs(known_times[0]), abs(known_times[-1]))
    covered = (times >= known_times[0] - slack) & (times <= known_times[-1] + slack)
    if not covered.any():
        begin, reached = known_times[0], source.end(times)
        raise _NotComparable(
            f"not reached: the reference begins at {begin:g} s, the run ended at {reached:g} s"
        )
    times, values = times[covered], values[covered]
    reference = np.interp(times, known_times, known)
    first = known[0]
    error, worst = _norm(values, reference, spec.norm, spec.relative_to, first)
    note = f"compared over {times[0]:g} to {times[-1]:g} s"
    result = {"unit": unit, "error": error}
    if spec.norm == "rms":
        result |= {"value": REDUCTIONS["rms"](values), "reference": REDUCTIONS["rms"](reference)}
        return {**result, "note": note}
    if spec.norm == "max":
        note += f", largest at {times[worst]:g} s"
    return {**result, "note": note, "value": float(values[worst]), "reference": float(reference[worst])}


def _profiles(spec: Any, source: _Source) -> dict[str, Any]:
    """Profiles along a line against those of a file, at given times."""
    columns, units = source.gauge(spec.gauge)
    values, unit = pick_column(columns, units, spec.column)
    times = columns["time"]
    start = np.asarray(source.case.gauges[spec.gauge].from_, np.float64)
    axes = ("x", "y", "z")[: len(start)]
    offset = np.stack([columns[axis] for axis in axes], axis=1) - start
    distance = np.sqrt(np.sum(offset**2, axis=1))
    table = _read_table(source.case, spec.curves.file)
    known_at = _reference_column(table, spec.curves.position, spec.curves.file)
    scale = getattr(spec.curves, "scale", 1.0)

    profiles: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []  # time, distance, run, reference
    missing = []
    first: float | None = None
    for moment, key in sorted(spec.curves.columns.items()):
        known = _reference_column(table, key, spec.curves.file) * scale
        given = np.isfinite(known_at) & np.isfinite(known)
        if not given.any():
            raise _NotComparable(f"{spec.curves.file} has no numbers in the column {key!r}")
        order = np.argsort(known_at[given], kind="stable")
        at, known = known_at[given][order], known[given][order]
        if first is None:
            first = float(np.abs(known).max())
        rows = np.abs(times - moment) <= 1e-6 * max(abs(moment), 1e-300)
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
    each = ", ".join(
        f"{100 * one:.3g} % at {time:g} s" for (one, _), (time, *_) in zip(errors, profiles, strict=True)
    )
    note = each + (f"; no rows at {', '.join(f'{time:g}' for time in missing)} s" if missing else "")
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
        scale = abs(first) if relative_to == "initial" else float(np.abs(reference).max())
        if scale == 0.0:
            raise _NotComparable(f"the reference's {relative_to} value is 0: nothing can be relative to it")
        relative = difference / scale
    if norm == "final":
        return float(relative[-1]), int(used[-1])
    if norm == "rms":
        return float(np.sqrt(np.mean(relative**2))), int(used[relative.argmax()])
    # argmax takes a nan for the largest, which is what it deserves
    return float(relative.max()), int(used[relative.argmax()])


def _exact(spec: Any, source: _Source) -> dict[str, Any]:
    """A field of the particles against a formula."""
    particles = source.particles()
    if not len(particles):
        raise _NotComparable("there are no particles")
    values, unit = _field(particles, spec.field)
    exact = [_expression_at(formula, particles) for formula in spec.exact]
    remove_mean = bool(getattr(spec, "remove_mean", False))
    if spec.field == "velocity":
        if len(exact) != particles.dimension:
            raise _NotComparable(f"exact needs {particles.dimension} components, it has {len(exact)}")
        reference = np.stack(exact, axis=1)
    elif spec.field == "speed" and len(exact) > 1:
        reference = _length(np.stack(exact, axis=1))
    else:
        reference = exact[0]
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
