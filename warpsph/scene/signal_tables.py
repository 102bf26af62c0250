"""Signals as piecewise polynomials, which a device evaluates without the host (theory: common#signals).

A formula becomes quintic pieces, each with the value and the first two derivatives that the formula has at both of its ends
(`case/derivatives.py`), so that neighbouring pieces meet in all three. Pieces are halved until value, first and second
derivative (as many as are asked for) are right at points between, within TOLERANCE of the largest in the octave.

Pieces are dyadic: the octaves [2^k, 2^(k+1)] and [0, 2^FIRST], each cut into FEWEST parts and those into halves. Whether a
piece is good does not depend on the end of the run, so that a longer run reads the same numbers, bit by bit.

Ends are approached from within a piece: a kink or a jump at a time that is an end of pieces (0.5, 1, 2, ...) is met exactly.
One elsewhere is enclosed by halving down to a piece of 2^-DEEPEST of its octave, which a straight line then crosses. What
lasts less than a hundredth of the time that has passed may be overlooked altogether (a table has no such limit). A motion
must not jump, nor may its velocity: nothing could follow.

A table becomes the pieces of its cubic spline (not-a-knot), or its straight lines.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpsph.case.derivatives import jet_of
from warpsph.case.expressions import Expression
from warpsph.case.signals import FormulaSignal, TableSignal, Varying
from warpsph.errors import CaseError, Problem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

TERMS = 6  # coefficients of a piece, from the constant one on
FIRST = -20  # exponent of the end of the first octave [s]
FEWEST = 32  # parts of an octave
DEEPEST = 26  # halvings of an octave after which a straight line takes the place of a kink
TOLERANCE = (1e-10, 1e-9, 1e-8)  # of value, first and second derivative, over the largest in the octave
MOST_PIECES = 2**20
INSIDE = 2.0**-20  # distance from its end at which a piece looks at the formula, over its width
ROUNDING = 16.0  # times what the formula knows of its own rounding: what differences of values make of it
# where a piece is tested, over its width: nowhere that a half of it has an end
TESTED = np.array([0.045, 0.17, 0.29, 0.43, 0.56, 0.69, 0.83, 0.955])

VALUE, RATE, ACCELERATION = 0, 1, 2
"""How many derivatives of a signal have to be right: those of a force, of the velocity of a wall, of a place."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """A piecewise polynomial.

    begin: (n,) start of each piece, s, rising; the first is at or before 0, and the last piece goes on
    terms: (n, TERMS) coefficients of powers of the time since `begin`, the constant first
    before: (n,) integral from time 0 to `begin`
    end: end of the last piece, s
    """

    begin: NDArray[np.float64]
    terms: NDArray[np.float64]
    before: NDArray[np.float64]
    end: float

    def at(self, time: float | NDArray[np.float64], order: int = VALUE) -> NDArray[np.float64]:
        """Value at times [s], or its derivative of the order; order -1: the integral from time 0."""
        times = np.asarray(time, dtype=np.float64)
        piece = np.clip(np.searchsorted(self.begin, times, side="right") - 1, 0, None)
        since = times - self.begin[piece]
        total = np.zeros(times.shape)
        for k in reversed(range(max(order, 0), TERMS)):
            total = total * since + self.terms[piece, k] * (math.perm(k, order) if order >= 0 else 1.0 / (k + 1))
        return np.asarray(total if order >= 0 else self.before[piece] + total * since)

    def extremes(self, end: float, order: int = VALUE, begin: float = 0.0) -> tuple[float, float]:
        """Least and largest value, or derivative of the order, from `begin` to `end` [s], looked for at 8 points a piece."""
        until = np.append(self.begin[1:], max(float(self.begin[-1]), end))
        points = (self.begin[:, None] + np.linspace(0.0, 1.0, 8, endpoint=False) * (until - self.begin)[:, None]).ravel()
        found = self.at(np.concatenate([points[(points >= begin) & (points <= end)], [begin, end]]), order)
        return float(found.min()), float(found.max())


def pieces_of(path: str, signal: Varying, end_time: float, order: int = VALUE) -> Pieces:
    """The pieces of a signal or number from 0 to the end of a run.

    path: key of the signal, for messages.
    end_time: end of the run, s.
    order: how many derivatives have to be right; with ACCELERATION a signal whose velocity jumps is refused.

    Raises CaseError if the signal is not finite, jumps where it must not, or takes too many pieces.
    """
    if isinstance(signal, FormulaSignal):
        return _of_formula(path, signal.expression.text, signal.expression, end_time, order)
    if isinstance(signal, TableSignal):
        times, values = signal.rows()
        if order == ACCELERATION and signal.interpolation == "linear" and len(times) > 2:
            rule = "has a velocity that jumps at every time of its table, which nothing could follow"
            raise CaseError([Problem(f"{path}.interpolation", "linear", rule, "write interpolation: cubic")])
        return _of_table(signal.path, times.tobytes(), values.tobytes(), signal.interpolation == "linear")
    return _finished(np.zeros(1), np.array([[float(signal), *[0.0] * (TERMS - 1)]]), math.inf)


def _finished(begin: NDArray[np.float64], terms: NDArray[np.float64], end: float) -> Pieces:
    """Pieces with their integrals, which are zero at time 0."""
    width = np.diff(begin)
    whole = sum(terms[:-1, k] * width ** (k + 1) / (k + 1) for k in range(TERMS))
    before = np.concatenate([[0.0], np.cumsum(whole)]) if len(width) else np.zeros(1)
    raw = Pieces(begin, terms, before, end)
    return Pieces(begin, terms, before - float(raw.at(0.0, -1)), end)


@functools.lru_cache(maxsize=64)
def _of_table(path: Path, times: bytes, values: bytes, linear: bool) -> Pieces:
    """The pieces of a table; the arguments are its numbers, so that another table is another entry of the cache."""
    t, f = np.frombuffer(times), np.frombuffer(values)
    terms = np.zeros((len(t) - 1, TERMS))
    if linear or len(t) < 3:
        terms[:, 0], terms[:, 1] = f[:-1], np.diff(f) / np.diff(t)
    else:
        from scipy.interpolate import CubicSpline

        terms[:, :4] = CubicSpline(t, f).c[::-1].T
    return _finished(t[:-1].copy(), terms, float(t[-1]))


@functools.lru_cache(maxsize=64)
def _of_formula(path: str, text: str, expression: Expression, end_time: float, order: int) -> Pieces:
    """The pieces of a formula, see the head of this file."""
    parts = _first_parts(expression, end_time)
    found: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    count = 0
    while len(parts.begin):
        terms, good = _fitted(expression, parts, order)
        last = ~good & (parts.width <= 1.5 * parts.floor)
        if last.any():
            terms[last] = _bridged(path, text, expression, parts.begin[last], parts.width[last])
            good |= last
        found.append((parts.begin[good], terms[good]))
        count += int(good.sum())
        if count + 2 * int((~good).sum()) > MOST_PIECES:
            rule = f"takes more than {MOST_PIECES} pieces until end_time {end_time:g} s: it swings too fast"
            raise CaseError([Problem(path, text, rule, "write a slower formula, or a smaller end_time")])
        parts = parts.select(~good).halved().select_before(end_time)
    starts, terms = (np.concatenate(part) for part in zip(*found, strict=True))
    rows = np.argsort(starts)
    pieces = _finished(starts[rows], terms[rows], end_time)
    if order == ACCELERATION:
        _check_motion(path, text, pieces)
    return pieces


@dataclass(frozen=True)
class _Parts:
    """Pieces still to be judged: begin, width, least width [s] (n,), and size of value and two derivatives (3, n)."""

    begin: NDArray[np.float64]
    width: NDArray[np.float64]
    floor: NDArray[np.float64]
    size: NDArray[np.float64]

    def select(self, rows: NDArray[np.bool_]) -> _Parts:
        return _Parts(self.begin[rows], self.width[rows], self.floor[rows], self.size[:, rows])

    def select_before(self, end_time: float) -> _Parts:
        return self.select(self.begin < end_time)

    def halved(self) -> _Parts:
        half = 0.5 * self.width
        begin = np.concatenate([self.begin, self.begin + half])
        return _Parts(begin, np.tile(half, 2), np.tile(self.floor, 2), np.tile(self.size, 2))


def _first_parts(expression: Expression, end_time: float) -> _Parts:
    """The parts of the octaves up to the end [s]; the size of a derivative is its largest in the whole octave."""
    octaves = [0.0]
    while octaves[-1] < end_time:
        octaves.append(2.0 ** (FIRST + len(octaves) - 1))
    low, whole = np.array(octaves[:-1]), np.diff(octaves)
    begin = low[:, None] + whole[:, None] * np.arange(FEWEST) / FEWEST
    points = begin[:, :, None] + (whole / FEWEST)[:, None, None] * TESTED
    found = np.abs(jet_of(expression, "t", points)[:3]).reshape(3, len(low), -1)
    size = np.where(np.isfinite(found), found, 0.0).max(axis=2)
    width, floor = (np.repeat(part, FEWEST) for part in (whole / FEWEST, whole * 2.0**-DEEPEST))
    return _Parts(begin.ravel(), width, floor, np.repeat(size, FEWEST, axis=1)).select_before(end_time)


def _fitted(expression: Expression, parts: _Parts, order: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Polynomials (n, TERMS) of pieces, and which of them are good.

    In a short piece the differences of values that a quintic is made of are nothing but rounding. There the second
    derivative alone, a straight line between its ends, is the better choice.
    """
    left, right = _ends(expression, parts.begin, parts.width)
    with np.errstate(all="ignore"):
        exact = jet_of(expression, "t", parts.begin[:, None] + parts.width[:, None] * TESTED)
        terms, short = _hermite(left, right, parts.width), _straight(left, right, parts.width)
        error, of_short = _errors(terms, exact, parts.width), _errors(short, exact, parts.width)
        better = (of_short[2] < error[2]) | ~np.isfinite(error[2])
        terms[better], error[:, better] = short[better], of_short[:, better]
        good = np.asarray(np.isfinite(terms).all(axis=1))
        rounding = ROUNDING * exact[3].max(axis=1)
        for k in range(order + 1):
            good &= error[k] <= TOLERANCE[k] * parts.size[k] + rounding / parts.width**k
    return terms, good


def _errors(
    terms: NDArray[np.float64], exact: NDArray[np.float64], width: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest error (3, n) of value, first and second derivative at the points where pieces are tested."""
    since = width[:, None] * TESTED
    found = []
    for k in range(3):
        powers = [math.perm(m, k) * terms[:, m, None] * since ** (m - k) for m in range(k, TERMS)]
        found.append(np.abs(sum(powers) - exact[k]).max(axis=1))
    return np.array(found)


def _ends(
    expression: Expression, begin: NDArray[np.float64], width: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Jets (3, n) at both ends of pieces, from within: taken a little inside and carried to the end by a Taylor series."""
    step = INSIDE * width
    found = []
    with np.errstate(all="ignore"):
        for place, way in ((begin + step, -step), (begin + width - step, step)):
            f, f1, f2, _ = jet_of(expression, "t", place)
            found.append(np.array([f + way * f1 + 0.5 * way**2 * f2, f1 + way * f2, f2]))
    return found[0], found[1]


def _hermite(
    left: NDArray[np.float64], right: NDArray[np.float64], width: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Quintics (n, TERMS) that have given jets at both ends."""
    w = width
    terms = np.zeros((len(w), TERMS))
    terms[:, 0], terms[:, 1], terms[:, 2] = left[0], left[1], 0.5 * left[2]
    value = right[0] - (left[0] + w * left[1] + 0.5 * w**2 * left[2])
    rate = w * (right[1] - (left[1] + w * left[2]))
    second = w**2 * (right[2] - left[2])
    terms[:, 3] = (10.0 * value - 4.0 * rate + 0.5 * second) / w**3
    terms[:, 4] = (-15.0 * value + 7.0 * rate - second) / w**4
    terms[:, 5] = (6.0 * value - 3.0 * rate + 0.5 * second) / w**5
    return terms


def _straight(
    left: NDArray[np.float64], right: NDArray[np.float64], width: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Cubics (n, TERMS) with the jet at the left end and the second derivative at the right one."""
    terms = np.zeros((len(width), TERMS))
    terms[:, 0], terms[:, 1], terms[:, 2] = left[0], left[1], 0.5 * left[2]
    terms[:, 3] = (right[2] - left[2]) / (6.0 * width)
    return terms


def _bridged(
    path: str, text: str, expression: Expression, begin: NDArray[np.float64], width: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Straight lines (n, TERMS) across the smallest pieces, in which a kink or a jump is.

    Raises CaseError where the formula has no finite value.
    """
    a, b = (jet_of(expression, "t", place)[0] for place in (begin, begin + width))
    finite = np.isfinite(a) & np.isfinite(b)
    if not finite.all():
        when = float(begin[np.argmin(finite)])
        raise CaseError([Problem(path, text, f"has no finite value near t = {when:.6g} s", "change the formula there")])
    terms = np.zeros((len(begin), TERMS))
    terms[:, 0], terms[:, 1] = a, (b - a) / width
    return terms


def _check_motion(path: str, text: str, pieces: Pieces) -> None:
    """Refuse a motion that jumps, or whose velocity does, from one piece to the next. Raises CaseError."""
    width = np.diff(pieces.begin)
    for order, share in ((VALUE, 1e-9), (RATE, 1e-6)):
        powers = [math.perm(k, order) * pieces.terms[:-1, k] * width ** (k - order) for k in range(order, TERMS)]
        jump = np.abs(sum(powers) - pieces.terms[1:, order])
        most = share * np.abs(pieces.terms[:, order]).max() + 1e-14 * np.abs(pieces.terms[:, 0]).max()
        if (jump > most).any():
            what = "jumps" if order == VALUE else "has a velocity that jumps"
            when = float(pieces.begin[1:][np.argmax(jump > most)])
            rule = f"{what} near t = {when:.6g} s, which nothing could follow"
            raise CaseError([Problem(path, text, rule, "smooth it there, e.g. with tanh")])


def joined(parts: Sequence[Pieces]) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """Several signals as a device reads them: (first piece of each (n + 1,), begin, terms with `before` as the last)."""
    first = np.concatenate([[0], np.cumsum([len(part.begin) for part in parts])]).astype(np.int32)
    begin = np.concatenate([part.begin for part in parts])
    terms = np.concatenate([np.column_stack([part.terms, part.before]) for part in parts])
    return first, begin, terms
