"""When bodies that start in the air come to the fluid: what they do before moves no water (theory: riemann#a1)."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.signal_tables import ACCELERATION, RATE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.scene.forcing import Forcing, Track
    from warpsph.scene.geometry import Geometry

FINEST = 1.0e-4  # of the run: contact is looked for no finer than that


@dataclass(frozen=True)
class Spread:
    """How far fluid may have got from where it starts: its box, wider by min(fastest t, first t + pull t^2).

    lower, upper: (d,), corners of the box, m; first, fastest: speeds at the start and of the run, m/s; pull: m/s^2, twice
    what falls makes of a way in the time t.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    first: float
    fastest: float
    pull: float

    def gap(self, lower: NDArray[np.float64], upper: NDArray[np.float64], time: float) -> float:
        """Distance of another box from the fluid at a time [m]; below 0 once fluid may be at it."""
        apart = np.maximum(np.maximum(lower - self.upper, self.lower - upper), 0.0)
        return float(np.linalg.norm(apart)) - min(self.fastest * time, self.first * time + self.pull * time * time)


def first_contact(track: Track, corners: NDArray[np.float64], spread: Spread, speed: float, end: float) -> float:
    """Return a time [s] until which no fluid is at a body: 0 if it is in the fluid from the start, `end` if never.

    corners: (n, d), of a box around the body at time 0, a spacing wider than it, m; speed: bound on
    that of the body, m/s.
    """
    time = 0.0
    closing = speed + 2.0 * spread.fastest  # of first t + pull t^2 where fastest t takes over it is less than that
    while time < end:
        places = track.place(corners, time)
        gap = spread.gap(places.min(axis=0), places.max(axis=0), time)
        if gap <= closing * FINEST * end:
            return time
        time += gap / closing if closing > 0.0 else end
    return end


def pushing(case: Case, geometry: Geometry, forcing: Forcing, reach: dict[str, float], fastest: float) -> float:
    """Return the largest acceleration [m/s^2] of a moving body while fluid may be at it, 0 without any.

    reach: distance of the farthest point of each body from its pivot, m; fastest: of the flow, m/s.
    """
    fluid = geometry.kind == 0
    if not forcing.tracks or not fluid.any():
        return 0.0
    spread = spread_of(case, geometry, forcing, fastest)
    most = 0.0
    for track in forcing.tracks:
        rows = geometry.body == geometry.body_names.index(track.name) + 1
        begin = 0.0
        if rows.any() and not any(case.periodic):
            around = geometry.position[rows]
            low, high = around.min(axis=0) - case.spacing, around.max(axis=0) + case.spacing
            corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
            speed = track.largest(forcing.end_time, RATE, reach[track.name] + case.spacing * math.sqrt(case.dimension))
            begin = first_contact(track, corners, spread, speed, forcing.end_time)
        most = max(most, track.largest(forcing.end_time, ACCELERATION, reach[track.name], begin))
    return most


def spread_of(case: Case, geometry: Geometry, forcing: Forcing, fastest: float) -> Spread:
    """Return how far the fluid may get; with what else pushes it from the start it has its largest speed at once."""
    fluid = geometry.kind == 0
    position, velocity = geometry.position[fluid], geometry.velocity[fluid]
    pull = float(np.linalg.norm(forcing.hydrostatic() + forcing.driving()))
    if case.central_force is not None:
        far = np.linalg.norm(position - np.asarray(case.central_force.center), axis=1).max()
        pull += case.central_force.rate**2 * float(far)
    first = float(np.sqrt((velocity**2).sum(axis=1)).max())
    pushed = len(forcing.tracks) > 1 or case.start.pressure not in (None, "auto", "hydrostatic") or case.has_flow_through
    fastest = max(first, fastest)
    half = 0.5 * case.spacing
    return Spread(position.min(axis=0) - half, position.max(axis=0) + half, fastest if pushed else first, fastest, pull)
