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
| particles: l1_volume | sum V abs(f - g) / sum V, absolute | sum V abs(f) / sum V and sum V abs(g) / sum V |
| particles: l2 | sqrt(sum abs(f - g)^2 / sum abs(g)^2) | their root mean squares |
| particles: max | max abs(f - g) / max abs(g) | max abs(f) and max abs(g) |
| interface | wrong area / area of the fluid or of the phase | wrong area and the area that divides it |

Of a place that moves, such as a front or a centroid, an error means something as a share of the way moved, not of a
coordinate whose origin is arbitrary: with `moved_from` the error of a value is divided by abs(g - moved_from), that of a
curve by s = max abs(g - moved_from).

s is the largest abs(g) (relative_to: peak; of each profile for itself), abs(g) at the first time (initial),
abs(g) at each time or position (pointwise; where g is 0 nothing is compared), or 1 (absolute). abs of a vector is its
length. The wrong area is told in warpsph.study.outline.

`reduce: noise` is the root mean square of what is left of a column when a parabola, fitted by least squares to the rows
within half a `span` of each row, is taken off there (the filter of Savitzky and Golay 1964). It passes what rings with
periods up to the span and is blind to slower motion: of a sine it leaves 1.0 to 1.2 of the amplitude at periods of half a
span or less, 0.24 at a whole span, 0.02 at two and 0.001 at four. Of a curve it is that of the line through its points at
the times of the gauge: a curve with fewer than eight points a span has lost what rings, and is not compared.

`reduce: frequency`, `amplitude` and `strouhal` are those of the wave, a mean with a sine and two overtones, that fits the
rows of the window best (`warpsph.study.oscillation`); the note says how many cycles there are and what the wave leaves over.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.errors import WarpsphError
from warpsph.measure.gauges import GaugeSet, schedule_of
from warpsph.snapshot import Snapshot
from warpsph.study.norms import (
    POINTS_A_SPAN,
    REDUCTIONS,
    NotComparable,
    length,
    noise,
    norm_of,
    particle_norm,
    reduced,
)
from warpsph.study.oscillation import OF_WAVES, of_wave
from warpsph.study.outline import interface_error
from warpsph.study.reference_files import known_curve, known_profile, read_table
from warpsph.study.results import Results, distance_along, pick_column, rows_at

MEASURES = {"interface": 2}
"""Kinds of references whose error has come to count something else, and how many ways of counting there were."""


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
    source = Results(case, folder, gauges, snapshot, end_time, frames)
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
        except (NotComparable, WarpsphError) as reason:
            result["note"] = str(reason)
        error = result["error"]
        if error is not None and not math.isfinite(error):
            result["note"] = "; ".join(filter(None, [result["note"], "not a finite number"]))
        if error is not None and spec.allowed is not None:
            result["passed"] = bool(abs(error) <= spec.allowed)
        results.append(result)
    return results


def definition_of(case: Any, quantity: str) -> str:
    """A short mark of how the error of a reference of a case is measured, the same for the same measurement.

    It changes with the reference but for its limit and source, with its gauge, and with what the kinds of MEASURES count.
    """
    reference = case.reference[quantity]
    data = {"reference": reference.model_dump(exclude={"allowed", "source"}, exclude_defaults=True)}
    gauge = getattr(reference, "gauge", None)
    if gauge is not None:
        data["gauge"] = case.gauges[gauge].model_dump(exclude_defaults=True)
    data["measure"] = {kind: number for kind, number in MEASURES.items() if hasattr(reference, kind)}
    text = json.dumps(data, sort_keys=True, default=lambda value: getattr(value, "text", str(value)))
    return hashlib.sha256(text.encode()).hexdigest()[:12]


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


def _evaluate(spec: Any, source: Results) -> dict[str, Any]:
    """The entries of a result that depend on the run."""
    # The kinds of entries differ in which of these keys they have.
    kinds = (("interface", interface_error), ("exact", _exact), ("curves", _profiles), ("curve", _curve), ("value", _value))
    for key, function in kinds:
        if getattr(spec, key, None) is not None:
            return function(spec, source)
    raise NotComparable("has none of value, curve, curves, exact, interface")


# ------------------------------------------------------------------------------------------------------------
# What the run gave


# ------------------------------------------------------------------------------------------------------------
# The five kinds of entries


def _value(spec: Any, source: Results) -> dict[str, Any]:
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
                raise NotComparable("it begins with 0, which nothing can be relative to")
            change = values / values[0] - 1.0
            value, unit = float(change[np.argmax(np.abs(change))]), "1"
        else:
            value, unit, note = _one_number(spec, source, times, values, unit)
    result = {"value": value, "reference": reference, "unit": unit}
    if spec.moved_from is not None:
        way = abs(reference - spec.moved_from)
        return {**result, "error": (value - reference) / way, "note": "; ".join(filter(None, [_of_way(way, unit), note]))}
    if reference == 0.0:
        note = "; ".join(filter(None, ["absolute error, as the reference is 0", note]))
        return {**result, "error": value, "note": note}
    return {**result, "error": (value - reference) / reference, "note": note}


def _one_number(
    spec: Any, source: Results, times: np.ndarray, values: np.ndarray, unit: str
) -> tuple[float, str, str]:
    """One number from the rows of a window, as `reduce` of an entry says, its unit and a note."""
    if spec.reduce in OF_WAVES:
        return of_wave(spec.reduce, times, values, unit, source.case.gauges[spec.gauge])
    return reduced(spec.reduce, times, values, unit)


def gauge_number(spec: Any, source: Results) -> tuple[float, str]:
    """The column of a gauge as one number, and its unit.

    spec: has `gauge`, `column`, `reduce` (a key of `REDUCTIONS`) and `window`, times in s or None

    Raises NotComparable if the gauge has no such column, or no row in the window.
    """
    times, values, unit = source.column(spec)
    inside = _in_window(spec, source, times)
    value, unit, _ = reduced(spec.reduce, times[inside], values[inside], unit)
    return value, unit


def _in_window(spec: Any, source: Results, times: np.ndarray) -> np.ndarray:
    """Which rows of a gauge lie in the window of an entry; all if it has none."""
    if spec.window is None:
        return np.ones(len(times), bool)
    start, end = spec.window
    reached = source.end(times)
    if end > reached * (1 + 1e-9):
        raise NotComparable(f"not reached: needs t = {end:g} s, the run ended at {reached:g} s")
    inside = (times >= start * (1 - 1e-9)) & (times <= end * (1 + 1e-9))
    if not inside.any():
        raise NotComparable(f"the gauge {spec.gauge!r} has no row from {start:g} to {end:g} s")
    return np.asarray(inside)


def _check_beginning(spec: Any, source: Results, first: float) -> None:
    """Refuse to reduce rows of which the first ones are missing, those before a restart into another folder.

    first: time of the first row in the window of the entry [s]
    """
    schedule = schedule_of(source.case.gauges[spec.gauge])
    if spec.window is not None:
        schedule.advance(spec.window[0] * (1 - 1e-8))
    if first > schedule.next + max(1e-6 * first, 0.5 * (schedule.interval or 0.0)):
        raise NotComparable(
            f"the gauge {spec.gauge!r} has no rows from {schedule.next:g} to {first:g} s: the run goes on from a checkpoint"
        )


def _slope(spec: Any, source: Results) -> tuple[float, str, str]:
    """Slope of a straight line through a part of the last profile of a line gauge, its unit, and the time of it.

    Of a parabola it is the exact slope in the middle of the part.
    """
    columns, units = source.gauge(spec.gauge)
    values, unit = pick_column(columns, units, spec.column)
    distance = distance_along(columns, source.case.gauges[spec.gauge])
    window = _in_window(spec, source, columns["time"])
    moment = columns["time"][window][-1]
    first, last = spec.between if spec.between is not None else (0.0, distance.max())
    slack = 1e-9 * distance.max()
    rows = rows_at(columns["time"], moment) & (distance >= first - slack) & (distance <= last + slack)
    rows &= np.isfinite(values)
    if rows.sum() < 2:
        raise NotComparable(f"the gauge {spec.gauge!r} has no two points from {first:g} to {last:g} m")
    fit = np.polynomial.Polynomial.fit(distance[rows], values[rows], 1)
    return float(fit.deriv()(0.0)), f"{unit}/m" if unit else "", f"at t = {moment:g} s"


def _curve(spec: Any, source: Results) -> dict[str, Any]:
    """A column over time against a curve, at the gauge's times that the curve and the window cover."""
    times, values, unit = source.column(spec)
    inside = _in_window(spec, source, times)
    times, values = times[inside], values[inside]
    known_times, known = known_curve(spec, source.case)
    slack = 1e-9 * max(abs(known_times[0]), abs(known_times[-1]))
    covered = (times >= known_times[0] - slack) & (times <= known_times[-1] + slack)
    if not covered.any():
        begin, reached = known_times[0], source.end(times)
        raise NotComparable(
            f"not reached: the reference begins at {begin:g} s, the run ended at {reached:g} s"
        )
    times, values = times[covered], values[covered]
    reference = np.interp(times, known_times, known)
    if spec.reduce is not None:
        return _reduced_curve(spec, source, times, values, reference, unit, known_times)
    first = known[0]
    note = f"compared over {times[0]:g} to {times[-1]:g} s"
    if spec.moved_from is None:
        error, worst = norm_of(values, reference, spec.norm, spec.relative_to, first)
    else:
        way = _way(reference, spec.moved_from)
        error, worst = norm_of(values / way, reference / way, spec.norm, "absolute", first)
        note += f", {_of_way(way, unit)}"
    if spec.relative_to == "absolute":
        note = f"absolute error; {note}"
    result = {"unit": unit, "error": error}
    if spec.norm == "rms":
        result |= {"value": REDUCTIONS["rms"](values), "reference": REDUCTIONS["rms"](reference)}
        return {**result, "note": note}
    if spec.norm == "max":
        note += f", largest at {times[worst]:g} s"
    return {**result, "note": note, "value": float(values[worst]), "reference": float(reference[worst])}


def _way(reference: np.ndarray, start: float) -> float:
    """The farthest that a reference (n,) gets from where it started; raises NotComparable if it stays there."""
    way = float(np.abs(reference - start).max())
    if way == 0.0:
        raise NotComparable(f"the reference stays at {start:g}: nothing can be relative to its way")
    return way


def _of_way(way: float, unit: str) -> str:
    return f"of the way of {way:.6g}{f' {unit}' if unit else ''}"


def _reduced_curve(
    spec: Any,
    source: Results,
    times: np.ndarray,
    values: np.ndarray,
    reference: np.ndarray,
    unit: str,
    known_times: np.ndarray,
) -> dict[str, Any]:
    """A column and a curve at the same `times`, each reduced to one number in the same way.

    known_times: those of the points of the curve [s]
    """
    if spec.window is not None:
        slack = 1e-9 * spec.window[1] + 2 * float(np.diff(times).max(initial=0.0))
        if times[-1] < spec.window[1] - slack or times[0] > spec.window[0] + slack:
            raise NotComparable(f"{spec.curve.file} does not cover the window: {times[0]:g} to {times[-1]:g} s of it alone")
    if spec.reduce == "noise":
        _check_dense(spec, known_times[(known_times >= times[0]) & (known_times <= times[-1])])
        known, value = noise(times, reference, spec.span), noise(times, values, spec.span)
        note = f"about parabolas of {spec.span:g} s"
    else:
        known, _, _ = _one_number(spec, source, times, reference, unit)
        value, unit, note = _one_number(spec, source, times, values, unit)
    note = "; ".join(filter(None, [f"over {times[0]:g} to {times[-1]:g} s", note]))
    result = {"value": value, "reference": known, "unit": unit}
    if spec.relative_to == "absolute":
        return {**result, "error": value - known, "note": f"absolute error; {note}"}
    if spec.moved_from is not None:
        way = _way(np.array([known]), spec.moved_from)
        return {**result, "error": (value - known) / way, "note": f"{note}; {_of_way(way, unit)}"}
    if known == 0.0:
        raise NotComparable("the reference is 0: nothing can be relative to it; relative_to: absolute")
    return {**result, "error": (value - known) / known, "note": note}


def _check_dense(spec: Any, known_times: np.ndarray) -> None:
    """Raise NotComparable if a curve has too few points, at these times [s], to show noise."""
    each = len(known_times) * spec.span / np.ptp(known_times) if len(known_times) > 1 else 0.0
    if each < POINTS_A_SPAN:
        raise NotComparable(f"{spec.curve.file} has {each:.2g} points within {spec.span:g} s: noise needs eight")


def _profiles(spec: Any, source: Results) -> dict[str, Any]:
    """Profiles along a line against those of a file, at given times."""
    columns, units = source.gauge(spec.gauge)
    values, unit = pick_column(columns, units, spec.column)
    times = columns["time"]
    distance = distance_along(columns, source.case.gauges[spec.gauge])
    table = read_table(source.case, spec.curves.file)

    profiles: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []  # time, distance, run, reference
    missing = []
    first: float | None = None
    for moment, key in sorted(spec.curves.columns.items()):
        at, known = known_profile(spec, table, key)
        if first is None:
            first = float(np.abs(known).max())
        rows = rows_at(times, moment)
        slack = 1e-9 * np.abs(at).max()
        rows &= (distance >= at[0] - slack) & (distance <= at[-1] + slack)
        if not rows.any():
            missing.append(moment)
            continue
        profiles.append((moment, distance[rows], values[rows], np.interp(distance[rows], at, known)))
    if not profiles:
        raise NotComparable(
            f"not reached: needs t = {missing[0]:g} s, the run ended at {source.end(times):g} s"
            if missing[0] > source.end(times)
            else f"the gauge {spec.gauge!r} has no rows at {', '.join(f'{time:g}' for time in missing)} s"
        )
    assert first is not None

    if spec.norm == "final":
        profiles = profiles[-1:]
    norm = "rms" if spec.norm == "final" else spec.norm
    errors = [norm_of(run, known, norm, spec.relative_to, first) for _, _, run, known in profiles]
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


def _exact(spec: Any, source: Results) -> dict[str, Any]:
    """A field of the particles against a formula."""
    particles = source.particles()
    values, reference, unit = _field_and_exact(spec, particles)
    remove_mean = bool(getattr(spec, "remove_mean", False))
    if remove_mean:
        weight = particles.volume / particles.volume.sum()
        values, reference = values - weight @ values, reference - weight @ reference
    error, value, size, relative = particle_norm(values, reference, spec.norm, particles.volume)
    note = f"at t = {particles.time:g} s"
    if not relative:
        why = ", a mean over the volume" if spec.norm == "l1_volume" else ", as the reference is 0"
        note = f"absolute error{why}; {note}"
    if remove_mean:
        note += ", without the means"
    return {"value": value, "reference": size, "error": error, "unit": unit, "note": note}


def _field_and_exact(spec: Any, particles: Snapshot) -> tuple[np.ndarray, np.ndarray, str]:
    """A field of the particles, (n,) or (n, dimension), what it should be, and its unit."""
    if not len(particles):
        raise NotComparable("there are no particles")
    values, unit = _field(particles, spec.field)
    exact = [_expression_at(formula, particles) for formula in spec.exact]
    if spec.field == "velocity":
        if len(exact) != particles.dimension:
            raise NotComparable(f"exact needs {particles.dimension} components, it has {len(exact)}")
        return values, np.stack(exact, axis=1), unit
    if spec.field == "speed" and len(exact) > 1:
        return values, length(np.stack(exact, axis=1)), unit
    return values, exact[0], unit


def _field(particles: Snapshot, name: str) -> tuple[np.ndarray, str]:
    """Values and unit of a particle field."""
    if name == "speed":
        return length(particles.velocity), "m/s"
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
    source = Results(case, folder, None, None, None)
    found = []
    for quantity, spec in case.reference.items():
        try:
            found.append(_data(quantity, spec, source))
        except (NotComparable, WarpsphError):
            continue
    return found


def _data(quantity: str, spec: Any, source: Results) -> Compared:
    if getattr(spec, "interface", None) is not None:
        raise NotComparable("a line in the plane is no curve over something")
    if getattr(spec, "reduce", "") == "slope":
        raise NotComparable("the slope of a profile is no curve over time")
    if getattr(spec, "exact", None) is not None:
        values, reference, unit = _field_and_exact(spec, source.particles())
        return Compared(quantity, "", spec.field, unit, "exact", {0.0: (_signed(reference), _signed(values))})
    if getattr(spec, "curves", None) is not None:
        columns, units = source.gauge(spec.gauge)
        values, unit = pick_column(columns, units, spec.column)
        distance = distance_along(columns, source.case.gauges[spec.gauge])
        table = read_table(source.case, spec.curves.file)
        run, known = {}, {}
        for moment, key in sorted(spec.curves.columns.items()):
            rows = rows_at(columns["time"], moment)
            if rows.any():
                run[moment] = distance[rows], values[rows]
                known[moment] = known_profile(spec, table, key)
        return Compared(quantity, spec.gauge, spec.column, unit, "curves", run, known)
    times, values, unit = source.column(spec)
    if getattr(spec, "curve", None) is not None:
        return Compared(
            quantity, spec.gauge, spec.column, unit, "curve",
            {0.0: (times, values)}, {0.0: known_curve(spec, source.case)},
        )  # fmt: skip
    return Compared(
        quantity, spec.gauge, spec.column, unit, "value", {0.0: (times, values)},
        value=spec.value, window=spec.window, reduce=spec.reduce,
    )  # fmt: skip


def _signed(values: np.ndarray) -> np.ndarray:
    """Numbers as they are, vectors as their lengths."""
    return values if values.ndim == 1 else length(values)
