"""Airfoils: NACA 4-digit sections by their numbers, others from a file of coordinates.

Coordinates are in chords, the nose at the origin and the tail near (1, 0), ordered from the tail over the upper side to
the nose and back along the lower side (`Selig`). A file may be in this order or in that of Lednicer: two blocks, each
from nose to tail, upper side first, after a line with the number of points of each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.surfaces import NOT_THERE, Outline, ShapeError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["airfoil", "naca_4", "read_section"]

_CLOSED_TAIL = -0.1036
_OPEN_TAIL = -0.1015
"""Last coefficient of the thickness of NACA 4-digit sections: with the first the tail has no thickness, with the second, the
one of the report that defined them, 0.21 % of the chord at a section of 10 %."""

_SAME_POINT = 1e-7
"""Distance, in chords, below which two points of a section are one."""

POINTS_A_SIDE = 400
"""Points along each side of a section: with 400, ordered by cosine, polygon and curve differ by less than 1e-5 chords."""


def naca_4(digits: str, closed: bool = True, points: int = POINTS_A_SIDE) -> NDArray[np.float64]:
    """Corners (k, 2) of a NACA 4-digit section in chords, in the order of Selig (theory: bodies#airfoils).

    Args:
        digits: four digits: camber in %, its place in tenths of the chord, thickness in % (two digits).
        closed: whether the tail is sharp; otherwise blunt, as in the report of 1933.
        points: points along each side, more closely at the nose and the tail.

    Raises:
        ShapeError: not four digits, or a section without thickness.
    """
    if len(digits) != 4 or not digits.isdecimal() or not digits.isascii():
        raise ShapeError(f"is no NACA 4-digit section: {digits}", 'write four digits, e.g. naca: "0012"')
    m, p, t = int(digits[0]) / 100, int(digits[1]) / 10, int(digits[2:]) / 100
    if t == 0.0:
        raise ShapeError(f"has no thickness: NACA {digits}", "the last two digits are the thickness in % of the chord")
    if (m > 0.0) != (p > 0.0):
        raise ShapeError(f"has a camber without its place or the reverse: NACA {digits}", "write e.g. 2412 or 0012")
    x = 0.5 * (1.0 - np.cos(np.linspace(0.0, math.pi, points + 1)))
    last = _CLOSED_TAIL if closed else _OPEN_TAIL
    thick = 5.0 * t * (0.2969 * np.sqrt(x) + x * (-0.1260 + x * (-0.3516 + x * (0.2843 + x * last))))
    camber, slope = np.zeros_like(x), np.zeros_like(x)
    if m > 0.0:
        fore = x < p
        camber = np.where(fore, m / p**2 * (2 * p * x - x**2), m / (1 - p) ** 2 * (1 - 2 * p + 2 * p * x - x**2))
        slope = np.where(fore, 2 * m / p**2 * (p - x), 2 * m / (1 - p) ** 2 * (p - x))
    angle = np.arctan(slope)
    upper = np.column_stack([x - thick * np.sin(angle), camber + thick * np.cos(angle)])
    lower = np.column_stack([x + thick * np.sin(angle), camber - thick * np.cos(angle)])
    return _joined(upper, lower)


def _joined(upper: NDArray[np.float64], lower: NDArray[np.float64]) -> NDArray[np.float64]:
    """Both sides, each from nose to tail, as one line from tail to tail; points given twice once."""
    corners = np.concatenate([upper[::-1], lower[1:] if np.linalg.norm(upper[0] - lower[0]) < _SAME_POINT else lower])
    if np.linalg.norm(corners[0] - corners[-1]) < _SAME_POINT:
        corners[0] = 0.5 * (corners[0] + corners[-1])
        corners = corners[:-1]
    return corners


def read_section(path: Path) -> NDArray[np.float64]:
    """Corners (k, 2) of the section in a file of coordinates, in chords, in the order of Selig.

    Lines that are not two numbers are titles or remarks. Between the points of the file the section is a cubic spline
    along each side, so that the surface has no kinks that the section does not have.

    Raises:
        ShapeError: the file is missing, has too few points, or is in no known order.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        raise ShapeError(f"names a file that is not there: {path}", NOT_THERE) from None
    rows = [pair for line in text.splitlines() if (pair := _two_numbers(line)) is not None]
    if len(rows) < 7:
        raise ShapeError(f"has {len(rows)} lines of two numbers: {path}", "give x/c y/c, a point a line, 7 or more")
    points = np.array(rows)
    if points[0].min() > 1.5:
        upper, lower = _lednicer(points, path)
    else:
        upper, lower = _selig(points, path)
    return _joined(_smooth(upper), _smooth(lower))


def _two_numbers(line: str) -> tuple[float, float] | None:
    words = line.replace(",", " ").split()
    try:
        x, y = (float(word) for word in words)
    except ValueError:
        return None
    return (x, y) if math.isfinite(x) and math.isfinite(y) else None


def _lednicer(points: NDArray[np.float64], path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Upper and lower side, each from nose to tail, of a file whose first line counts the points of each."""
    above, below = (round(number) for number in points[0])
    points = points[1:]
    if above + below != len(points) or min(above, below) < 3:
        raise ShapeError(
            f"announces {above} + {below} points and has {len(points)}: {path}", "correct the line of the numbers of points"
        )
    _in_chords(points, path)
    upper, lower = points[:above], points[above:]
    for side in (upper, lower):
        if side[0, 0] > side[-1, 0]:
            raise ShapeError(f"has a side that does not run from nose to tail: {path}", "order each block by growing x/c")
    return (upper, lower) if upper[:, 1].mean() > lower[:, 1].mean() else (lower, upper)


def _selig(points: NDArray[np.float64], path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Upper and lower side, each from nose to tail, of points that go around from tail to tail."""
    _in_chords(points, path)
    nose = int(points[:, 0].argmin())
    if nose in (0, len(points) - 1) or min(points[0, 0], points[-1, 0]) < 0.5:
        raise ShapeError(
            f"is in no known order: {path}",
            "go from the tail over one side to the nose and back (Selig), or give two blocks with their numbers of points "
            "first (Lednicer)",
        )
    one, other = points[: nose + 1][::-1], points[nose:]
    return (one, other) if one[:, 1].mean() > other[:, 1].mean() else (other, one)


def _in_chords(points: NDArray[np.float64], path: Path) -> None:
    low, high = points[:, 0].min(), points[:, 0].max()
    if low < -0.1 or not 0.9 < high < 1.1:
        raise ShapeError(
            f"has x from {low:g} to {high:g}: {path}",
            "give coordinates in chords, nose at 0 and tail at 1; chord: scales them",
        )


def _smooth(side: NDArray[np.float64]) -> NDArray[np.float64]:
    """A side with many points on the cubic spline through those given, which stay where they are."""
    from scipy.interpolate import CubicSpline

    keep = np.concatenate([[True], np.linalg.norm(np.diff(side, axis=0), axis=1) > _SAME_POINT])
    side = side[keep]
    if len(side) < 4:
        return side
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(side, axis=0), axis=1))])
    between = max(1, math.ceil(POINTS_A_SIDE / len(side)))
    parts = [np.linspace(a, b, between, endpoint=False) for a, b in zip(along[:-1], along[1:], strict=True)]
    return np.asarray(CubicSpline(along, side)(np.concatenate([*parts, along[-1:]])))


def airfoil(
    section: NDArray[np.float64],
    chord: float,
    angle: float = 0.0,
    pivot: float = 0.25,
    position: Sequence[float] = (0.0, 0.0),
) -> Outline:
    """An airfoil in the plane.

    Args:
        section: corners (k, 2) in chords, as `naca_4` and `read_section` return them.
        chord: m
        angle: angle of attack against the x axis, degrees; positive lifts the nose.
        pivot: the point of the chord about which it is turned, in chords from the nose.
        position: where that point is, m.

    Raises:
        ShapeError: the section crosses itself or encloses no area.
    """
    turn = math.radians(angle)
    x, y = (section[:, 0] - pivot) * chord, section[:, 1] * chord
    # The nose is at negative x of the pivot: lifting it is a turn clockwise.
    corners = np.column_stack([x * math.cos(turn) + y * math.sin(turn), -x * math.sin(turn) + y * math.cos(turn)])
    return Outline.of_corners(corners + np.asarray(position, dtype=np.float64))
