"""Numbers from the rows of a run and of its reference: reductions of a column, and norms of a difference.

What each of them means is told in warpsph.study.comparison.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

POINTS_A_SPAN = 8
"""Rows that a parabola with something left over needs."""

FEWEST = 8
"""Rows that a cubic needs."""
LEFT_OVER = 0.125
"""Share of the standard deviation of the rows of a window that a cubic which follows them leaves over at most."""
LEFT_OVER_NEAR = 0.05
"""The same of rows that are chosen around the largest or lowest one, which need not be many."""
NARROWER = 0.8
"""Share of the rows that are looked at next where no cubic follows these."""


class NotComparable(Exception):
    """Why an entry has no result; the text becomes its note."""


REDUCTIONS: dict[str, Callable[[np.ndarray], float]] = {
    "mean": lambda values: float(np.mean(values)),
    "max": lambda values: float(np.max(values)),
    "min": lambda values: float(np.min(values)),
    "final": lambda values: float(values[-1]),
    "rms": lambda values: float(np.sqrt(np.mean(values**2))),
}


def reduced(reduce: str, times: np.ndarray, values: np.ndarray, unit: str) -> tuple[float, str, str]:
    """One number from the rows of a window, its unit and a note; the ways that need nothing but the rows."""
    if reduce == "period":
        return period(times, values), "s", ""
    if reduce in ("peak", "peak_time", "trough", "trough_time"):
        at, value, rows = extreme(times, values, highest=reduce.startswith("peak"))
        near = "" if rows == len(times) else f", by the {rows} rows around it"
        return (at, "s", f"{value:.6g} there{near}") if reduce.endswith("_time") else (value, unit, f"at {at:.6g} s{near}")
    return REDUCTIONS[reduce](values), unit, ""


def noise(times: np.ndarray, values: np.ndarray, span: float) -> float:
    """Root mean square of the deviations of rows from the parabolas through their surroundings, see the module.

    times, values: (n,), s and the unit of the result
    span: s; rows nearer to either end than half of it are part of parabolas only

    Raises NotComparable if no row has a whole span around it with eight rows in it, or values are not finite.
    """
    if not np.isfinite(values).all():
        raise NotComparable("not a finite number in the window")
    half = 0.5 * span * (1 + 1e-9)
    first, last = np.searchsorted(times, times - half), np.searchsorted(times, times + half, side="right")
    whole = (times - times[0] >= half * (1 - 1e-8)) & (times[-1] - times >= half * (1 - 1e-8))
    whole &= last - first >= POINTS_A_SPAN
    if not whole.any():
        raise NotComparable(f"noise needs eight rows within {span:g} s, and a window longer than that")
    left = []
    for row in np.flatnonzero(whole):
        near = slice(first[row], last[row])
        fit = np.polynomial.polynomial.polyfit(times[near] - times[row], values[near], 2)
        left.append(values[row] - fit[0])
    return float(np.sqrt(np.mean(np.square(left))))


def period(times: np.ndarray, values: np.ndarray) -> float:
    """Mean time [s] between upward crossings of the mean value, each interpolated between two rows.

    Raises NotComparable for fewer than two crossings, or values that are not finite.
    """
    if not np.isfinite(values).all():
        raise NotComparable("not a finite number in the window")
    level = values - values.mean()
    up = np.flatnonzero((level[:-1] < 0) & (level[1:] >= 0))
    if len(up) < 2:
        raise NotComparable(
            f"no period: the column crosses its mean upwards {len(up)} times from {times[0]:g} to {times[-1]:g} s, a period "
            "needs two crossings; take a longer window, or a later end_time"
        )
    crossings = times[up] - level[up] * (times[up + 1] - times[up]) / (level[up + 1] - level[up])
    return float(np.mean(np.diff(crossings)))


def extreme(times: np.ndarray, values: np.ndarray, highest: bool) -> tuple[float, float, int]:
    """Time [s] and value of the highest or lowest point of the cubic that fits rows best, and how many rows these are.

    A smooth curve is followed and noise is not: the largest of many noisy values is too large, and its time arbitrary.
    Where the cubic has no such point between the first and the last row, the better end is taken. The rows are all of them,
    or where no cubic follows these, as those of a whole run, the most around the largest or lowest one that a cubic follows.

    Raises NotComparable for fewer than eight rows, or values that are not finite.
    """
    if len(times) < FEWEST or not np.isfinite(values).all():
        raise NotComparable("a cubic needs eight rows with numbers in the window")
    middle = int(np.argmax(values) if highest else np.argmin(values))
    count, near = len(times), slice(None)
    most = LEFT_OVER
    while count > FEWEST and not _followed(times[near], values[near], most):
        most = LEFT_OVER_NEAR
        count = max(int(NARROWER * count), FEWEST)
        first = min(max(middle - count // 2, 0), len(times) - count)
        near = slice(first, first + count)
    return *_turn(times[near], values[near], highest), count


def _followed(times: np.ndarray, values: np.ndarray, most: float) -> bool:
    """Return whether a cubic through rows leaves no more over than noise, or than `most` of their standard deviation.

    Noise is what the fourth differences of the rows have, which see no cubic.
    """
    left = values - np.polynomial.Polynomial.fit(times, values, 3)(times)
    noise_of_rows = math.sqrt(float(np.mean(np.diff(values, 4) ** 2)) / 70.0)
    return float(np.sqrt(np.mean(left**2))) <= max(most * float(values.std()), 1.5 * noise_of_rows)


def _turn(times: np.ndarray, values: np.ndarray, highest: bool) -> tuple[float, float]:
    """Return time [s] and value of the highest or lowest point of the cubic through rows, between the first and the last."""
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


def norm_of(
    values: np.ndarray, reference: np.ndarray, norm: str, relative_to: str, first: float
) -> tuple[float, int]:
    """The error as the table of the module defines it, and the place of the largest (`final`: the last)."""
    difference = np.abs(values - reference)
    if relative_to == "pointwise":
        used = np.flatnonzero(reference)
        if not len(used):
            raise NotComparable("the reference is 0 everywhere: nothing can be relative to it")
        relative = difference[used] / np.abs(reference[used])
    else:
        used = np.arange(len(values))
        scale = {"initial": abs(first), "absolute": 1.0}.get(relative_to, float(np.abs(reference).max()))
        if scale == 0.0:
            raise NotComparable(f"the reference's {relative_to} value is 0: nothing can be relative to it")
        relative = difference / scale
    if norm == "final":
        return float(relative[-1]), int(used[-1])
    if norm == "rms":
        return float(np.sqrt(np.mean(relative**2))), int(used[relative.argmax()])
    # argmax takes a nan for the largest, which is what it deserves
    return float(relative.max()), int(used[relative.argmax()])


def particle_norm(
    values: np.ndarray, reference: np.ndarray, norm: str, volume: np.ndarray | None = None
) -> tuple[float, float, float, bool]:
    """Error, size of the values, size of the reference, and whether the error is relative to the latter.

    `values` and `reference` are (n,) or (n, dimension); `norm` is l1, l2, max, or l1_volume, which weighs each particle with
    its `volume` (n,); see the module.
    """
    difference = length(values - reference)
    run, known = length(values), length(reference)
    if norm == "l1_volume":
        error, value, size = (float(np.average(lengths, weights=volume)) for lengths in (difference, run, known))
        return error, value, size, False
    reduce: Callable[[np.ndarray], float] = {
        "l1": lambda lengths: float(np.mean(lengths)),
        "l2": lambda lengths: float(np.sqrt(np.mean(lengths**2))),
        "max": lambda lengths: float(np.max(lengths)),
    }[norm]
    error, value, size = reduce(difference), reduce(run), reduce(known)
    return (error / size, value, size, True) if size > 0 else (error, value, size, False)


def length(values: np.ndarray) -> np.ndarray:
    """Lengths of vectors, absolute values of numbers; (n,) float64."""
    values = np.asarray(values, np.float64)
    return np.abs(values) if values.ndim == 1 else np.sqrt(np.sum(values**2, axis=1))
