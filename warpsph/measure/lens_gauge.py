"""Gauge of a liquid lens: angles at which three interfaces meet, by circles through two and a line along the third."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from warpsph.measure.contour import Share, contour, shares_of_phases
from warpsph.measure.drop_gauges import in_one_piece
from warpsph.measure.gauge import Gauge, Needs
from warpsph.snapshot import Snapshot


@dataclass(frozen=True)
class Piece:
    """Part of the interface between two phases.

    places: (n, 2) middles of the segments of its line, m
    length: (n,) of each segment, m
    """

    places: np.ndarray
    length: np.ndarray


@dataclass(frozen=True)
class Circle:
    """A circle in 2-D: centre (2,), m, and radius, m."""

    center: np.ndarray
    radius: float


@dataclass(frozen=True)
class Line:
    """The points x with normal . x = offset; normal (2,) of length 1, offset in m."""

    normal: np.ndarray
    offset: float


def interface_between(shares: Sequence[Share], own: int, other: int, third: int, alone: float) -> Piece:
    """Return the line of the phase `own` where the phase `other` is beyond it and hardly anything of the phase `third` near.

    shares: of all phases on one grid
    alone: share of the third phase up to which a place is far enough from it; where it is more the smoothing bends the line

    Raises nothing: a phase without such a line has a piece of no segments.
    """
    segments = contour(shares[own]).segments
    places = segments.mean(axis=1)
    kept = (_at(shares[third], places) <= alone) & (_at(shares[other], places) > 0.25)
    return Piece(places[kept], np.hypot(*(segments[kept, 1] - segments[kept, 0]).T))


def _at(share: Share, places: np.ndarray) -> np.ndarray:
    """Values (n,) of a share at the nodes nearest to places (n, 2)."""
    index = [
        np.clip(np.rint((places[:, k] - axis[0]) / (axis[1] - axis[0])).astype(np.int64), 0, len(axis) - 1)
        for k, axis in enumerate((share.x, share.y))
    ]
    return np.asarray(share.values[index[0], index[1]])


def fitted_circle(piece: Piece) -> Circle:
    """Return the circle |x|^2 = 2 c . x + e with the least squares of both sides' difference, weighted with the lengths.

    Of fewer than 3 places all is nan.
    """
    if len(piece.places) < 3:
        return Circle(np.full(2, math.nan), math.nan)
    weight = piece.length / piece.length.sum()
    middle = weight @ piece.places
    x = piece.places - middle
    root = np.sqrt(weight)[:, None]
    square = (x**2).sum(axis=1)
    a, b, e = np.linalg.lstsq(root * np.column_stack([2.0 * x, np.ones(len(x))]), root[:, 0] * square, rcond=None)[0]
    return Circle(middle + (a, b), math.sqrt(a * a + b * b + e))


def fitted_line(piece: Piece, towards: np.ndarray) -> Line:
    """Return the line with the least squares of the distances, its normal on the side of the direction `towards` (2,).

    Of fewer than 2 places all is nan.
    """
    if len(piece.places) < 2:
        return Line(np.full(2, math.nan), math.nan)
    weight = piece.length / piece.length.sum()
    middle = weight @ piece.places
    x = piece.places - middle
    normal = np.linalg.eigh((weight[:, None] * x).T @ x)[1][:, 0]
    normal = normal * (1.0 if normal @ towards >= 0.0 else -1.0)
    return Line(normal, float(normal @ middle))


def cap_angle(circle: Circle, line: Line) -> float:
    """Return the angle inside of the cap that a circle cuts from the side of a line that its normal points to, rad.

    The cap has the height r (1 - cos angle) and the width 2 r sin angle. nan if they do not cross.
    """
    cosine = (line.offset - float(line.normal @ circle.center)) / circle.radius
    return math.acos(cosine) if abs(cosine) <= 1.0 else math.nan


class LensGauge(Gauge):
    """The angles of the phases where they meet at the rim of a lens of `phase` between the two others, and its width (2-D).

    A circle is laid through each side of the lens and a straight line along the interface between the other two phases, all
    but what is within reach of the rim, where the smoothing of the lines rounds the corner off. Where the sides cross the
    straight line they enclose the angles a and b with it inside of the lens.

    - `angle oil`: of the lens, a + b; of the two others pi - a and pi - b: together a full turn
    - `width`: of the lens, the mean of both circles

    It means something for one lens in one piece that touches no wall, where the interface between the others is straight.
    """

    needs = Needs.of(fields=("position", "volume"))
    alone: ClassVar[float] = 0.01
    """share of a third phase, see `interface_between`: reached about four spacings from the rim"""

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.lens = self.phase_names.index(spec.phase)
        self.others = [index for index in range(len(self.phase_names)) if index != self.lens]

    def row(self, snapshot: Snapshot) -> list[float]:
        if not np.isfinite(snapshot.position).all() or not np.isfinite(snapshot.volume).all():
            return [math.nan] * len(self.columns)
        shares = shares_of_phases(
            snapshot.position, snapshot.volume, snapshot.phase, len(self.phase_names),
            self.scene.lower, self.scene.upper, self.scene.periodic, snapshot.particle_spacing,
        )  # fmt: skip
        first, second = self.others
        near_first = self._piece(snapshot, shares, self.lens, first, second)
        near_second = self._piece(snapshot, shares, self.lens, second, first)
        between = self._piece(snapshot, shares, first, second, self.lens)
        if min(len(piece.places) for piece in (near_first, near_second, between)) < 3:
            return [math.nan] * len(self.columns)
        line = fitted_line(between, near_second.places.mean(axis=0) - near_first.places.mean(axis=0))
        circles = {second: fitted_circle(near_second), first: fitted_circle(near_first)}
        sides = {second: line, first: Line(-line.normal, -line.offset)}
        angles = {index: cap_angle(circles[index], sides[index]) for index in self.others}
        turn = {self.lens: sum(angles.values())} | {index: math.pi - angle for index, angle in angles.items()}
        width = sum(circles[index].radius * math.sin(angle) for index, angle in angles.items())
        return [*(turn[index] for index in range(len(self.phase_names))), width]

    def _piece(self, snapshot: Snapshot, shares: Sequence[Share], own: int, other: int, third: int) -> Piece:
        """A piece of an interface, its places within half a period of the middle of the lens."""
        piece = interface_between(shares, own, other, third, self.alone)
        mine = in_one_piece(snapshot.position[snapshot.phase == self.lens], self.scene, snapshot.particle_spacing)
        middle = mine.mean(axis=0) if len(mine) else np.full(self.dimension, math.nan)
        period = np.asarray(self.scene.upper) - np.asarray(self.scene.lower)
        offset = piece.places - middle
        turns = np.where(self.scene.periodic, np.round(offset / period), 0.0)
        return Piece(middle + offset - turns * period, piece.length)
