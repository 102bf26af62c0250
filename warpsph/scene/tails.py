"""Thin tails of plane bodies: each side gets boundary particles of its own, as deep as the smoothing kernel reaches.

Towards a sharp edge a body becomes thinner than the reach of the kernel. Its layers then have no room, and fluid on one
side would see the other through it. So each side of a tail has a *sheet* of boundary particles that goes on as if the
body were thick: past the other side, and past the edge. A fluid particle sees those of the sheet through which its line
of sight enters the body, and no fluid behind the body (`kernels/core/visibility.py`, theory: bodies#tails): whatever it
looks at, it sees once.

A tail is a corner of less than 60 degrees, or a blunt end: two corners less than four spacings apart that turn the
outline by more than 120 degrees, with sides at least twice as long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.rings import CORNER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.scene.surfaces import Outline

__all__ = ["Sheet", "Tail", "find_tails"]

SHARP = math.radians(120.0)
"""Turn of the outline at an edge above which it is a tail; 90 degrees, the corner of a box, are none."""

BLUNT = 4.0
"""Thickness, in spacings, below which a blunt end is a tail."""

SLENDER = 2.0
"""Least length of the sides of a blunt tail over its thickness; a small square has none."""

_STEP = 0.25
"""Distance of the points that stand for a side, in spacings."""

_TURNED = 0.5
"""Cosine of the turn of a side from its edge at which it no longer counts as a side of the tail."""


@dataclass(frozen=True)
class Sheet:
    """One side of a tail, from its edge to where the body is thick.

    side: +1 on the side of the tail's `across`, -1 on the other
    point: (k, 2), along the side from the edge inwards, m
    normal: (k, 2), unit normals into the fluid
    arc: (k,), length from the edge, m
    goes_on: whether the body goes on behind its end, thick or as another tail, rather than ends there with a nose or a
        corner
    """

    side: int
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    arc: NDArray[np.float64]
    goes_on: bool


@dataclass(frozen=True)
class Tail:
    """A thin end of a body.

    edge: (2,), the corner, or the middle of a blunt end, m
    along: (2,), unit vector from the body past the edge, in the middle between the sides
    base: (2, 2), the corners of the end, m; one twice if it is sharp
    sheets: of both sides
    """

    edge: NDArray[np.float64]
    along: NDArray[np.float64]
    base: NDArray[np.float64]
    sheets: tuple[Sheet, Sheet]


def find_tails(outline: Outline, spacing: float, reach: float) -> list[Tail]:
    """The tails of a body.

    spacing: particle spacing, m
    reach: of the smoothing kernel, m; a side is followed until the body is twice as thick.
    """
    import shapely

    found = []
    for part in shapely.get_parts(outline.region):
        for line in (part.exterior, *part.interiors):
            ring = shapely.get_coordinates(line)[:-1]
            ends = _ends(ring, spacing)
            others = ring[sorted({k for pair in ends for k in pair})]
            found += [_tail(outline, ring, pair, others, spacing, reach) for pair in ends]
    return found


def _ends(ring: NDArray[np.float64], spacing: float) -> list[tuple[int, int]]:
    """Corners (first, last) of the sharp and blunt ends of a closed line with the body on its left; equal if sharp."""
    way = np.roll(ring, -1, axis=0) - ring
    angle = np.arctan2(way[:, 1], way[:, 0])
    turn = (angle - np.roll(angle, 1) + np.pi) % (2.0 * np.pi) - np.pi  # at each point, positive where the body is convex
    length = np.linalg.norm(way, axis=1)
    found = [(int(k), int(k)) for k in np.flatnonzero(turn > SHARP)]
    n = len(ring)
    for k in np.flatnonzero((turn > CORNER) & (turn <= SHARP)):
        after = (int(k) + 1) % n
        if not (CORNER < turn[after] <= SHARP and turn[k] + turn[after] > SHARP and length[k] < BLUNT * spacing):
            continue
        sides = _straight_length(length, turn, after, 1), _straight_length(length, turn, int(k), -1)
        if min(sides) >= SLENDER * length[k]:
            found.append((int(k), after))
    return found


def _straight_length(length: NDArray[np.float64], turn: NDArray[np.float64], start: int, step: int) -> float:
    """Length of a side from a corner to the next corner, forwards (step 1) or backwards (-1)."""
    n, k, total = len(length), start, 0.0
    for _ in range(n):
        total += float(length[k if step > 0 else k - 1])
        k = (k + step) % n
        if abs(turn[k]) > CORNER:
            break
    return total


def _tail(
    outline: Outline,
    ring: NDArray[np.float64],
    end: tuple[int, int],
    others: NDArray[np.float64],
    spacing: float,
    reach: float,
) -> Tail:
    """The tail at the corners `end` of a ring; `others` are the corners of all its ends."""
    first, last = end
    edge = 0.5 * (ring[first] + ring[last])
    forwards = _side(outline, np.roll(ring, -last, axis=0), 1.0, others, spacing, reach)
    backwards = _side(outline, np.roll(ring[::-1], first + 1, axis=0), -1.0, others, spacing, reach)
    inwards = sum((_chord(point, spacing) for point, *_ in (forwards, backwards)), np.zeros(2))
    along = -inwards / np.linalg.norm(inwards)
    across = np.array([-along[1], along[0]])
    sheets = []
    for point, normal, arc, goes_on in (forwards, backwards):
        sheets.append(Sheet(1 if normal[0] @ across > 0.0 else -1, point, normal, arc, goes_on))
    return Tail(edge, along, np.stack([ring[first], ring[last]]), (sheets[0], sheets[1]))


def _chord(point: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Unit vector from the edge to the point of a side about two spacings from it."""
    way = point[min(len(point) - 1, round(2.0 / _STEP))] - point[0]
    return np.asarray(way / np.linalg.norm(way))


def _side(
    outline: Outline,
    ring: NDArray[np.float64],
    sense: float,
    others: NDArray[np.float64],
    spacing: float,
    reach: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], bool]:
    """Points, normals and lengths along one side, see `Sheet`.

    ring: the closed line, beginning at the edge and going along the side
    sense: 1 if that is with the body on the left, -1 if on the right
    others: corners at which tails are: a side between two of them is shared
    """
    closed = np.concatenate([ring, ring[:1]])
    way = np.diff(closed, axis=0)
    length = np.linalg.norm(way, axis=1)
    angle = np.arctan2(way[:, 1], way[:, 0])
    turn = np.abs((np.diff(angle) + np.pi) % (2.0 * np.pi) - np.pi)
    corners = np.flatnonzero(turn > CORNER)
    end = float(length[: corners[0] + 1].sum() if len(corners) else 0.5 * length.sum())
    shared = len(corners) > 0 and bool((others == closed[corners[0] + 1]).all(axis=1).any())
    if shared:
        end *= 0.5
    steps = max(3, math.ceil(end / (_STEP * spacing)))
    arc = np.linspace(0.0, end, steps + 1)
    places = np.concatenate([[0.0], np.cumsum(length)])
    point = np.stack([np.interp(arc, places, closed[:, k]) for k in range(2)], axis=1)
    tangent = np.gradient(point, arc, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    normal = sense * np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    thick = -outline.signed_distance(point - reach * normal) >= reach * (1.0 - 1e-3)
    turned = normal @ normal[0] < _TURNED
    stop = np.flatnonzero(thick | turned)
    last = int(stop[0]) if len(stop) else steps
    last = max(last, 2)
    return point[: last + 1], normal[: last + 1], arc[: last + 1], bool(thick[last]) or (shared and len(stop) == 0)
