"""What a case can be run with and can hardly mean: warnings of `check` and `run`.

Each names the key, what it has, why that has no use, and what to write instead. What may be meant is no doubt: a place
beyond an open side, where water may fall, or a gate that is lifted out through a roof.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic_core import PydanticCustomError

from warpsph.case.domain import AXES
from warpsph.case.values import NumberRule
from warpsph.errors import short
from warpsph.running.tension_doubts import contradicting_angles, missing_pairs
from warpsph.scene.forcing import Track, forcing_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry

ROUNDING = 1.0e-9  # of a time or a length: what two that are the same may differ by
LOOKS = 400  # times of a run at which it is looked where a body is
MOST_POINTS = 500  # of a body; of more those that a convex hull needs


def doubts(case: Case, geometry: Geometry) -> list[str]:
    """Return the warnings of a case, a line each."""
    return [
        *missing_pairs(case),
        *contradicting_angles(case),
        *_late_times(case),
        *_long_window(case),
        *_places_outside(case),
        *_bodies_through_walls(case, geometry),
    ]


# times ------------------------------------------------------------------------------------------------------


def _late_times(case: Case) -> Iterator[str]:
    """Times of gauges and particle files that no run of the file reaches: its validation runs may be longer."""
    last = max([case.end_time, *_other_ends(case)]) * (1.0 + ROUNDING)
    timed: dict[str, Any] = {f"gauges.{name}": gauge for name, gauge in case.gauges.items()}
    timed["output.particles"] = case.output.particles
    for path, part in timed.items():
        times = getattr(part, "times", None) or ()
        late = [time for time in times if time > last]
        if late:
            yield (
                f"{path}.times: nothing is measured or written at {_listed(late)} s, after end_time {case.end_time:g} s; "
                "raise end_time, or delete them"
            )


def _other_ends(case: Case) -> Iterator[float]:
    """End times of the validation runs of the file."""
    runs = case.validation
    for run in (*runs.quick, *runs.seed, *runs.fine, *runs.ci):
        with suppress(PydanticCustomError):  # no number: told where the run is made
            end = NumberRule().validate(run.changes.get("end_time", 0.0))
            if isinstance(end, int | float):
                yield float(end)


def _long_window(case: Case) -> Iterator[str]:
    """A window of Lyapunov exponents that never gets complete."""
    lyapunov = case.output.lyapunov
    if lyapunov is not None and lyapunov.window > case.end_time * (1.0 + ROUNDING):
        yield (
            f"output.lyapunov.window: {lyapunov.window:g} s are longer than the run of {case.end_time:g} s, so that all "
            "exponents are those of a shorter time (ftle_age); lower it, or raise end_time"
        )


# places -----------------------------------------------------------------------------------------------------


def _places_outside(case: Case) -> Iterator[str]:
    """Places of gauges where no fluid can ever be."""
    for name, gauge in case.gauges.items():
        path = f"gauges.{name}"
        if gauge.type == "elevation":
            for k, place in enumerate(gauge.places):
                yield from _outside(case, f"{path}.places.{k}", place, wraps=False)
        elif gauge.type == "points":
            for k, point in enumerate(gauge.points):
                yield from _outside(case, f"{path}.points.{k}", point)
        elif gauge.type in ("line", "reattachment"):
            for key, point in (("from", gauge.from_), ("to", gauge.to)):
                yield from _outside(case, f"{path}.{key}", point)


def _outside(case: Case, path: str, place: Sequence[float], wraps: bool = True) -> Iterator[str]:
    """Say so if a place, which may lack the last axis, is beyond a side that fluid does not pass.

    wraps: the gauge knows that the fluid at a periodic side goes on at the other one
    """
    for axis, x in enumerate(place):
        lower, upper, sides = case.domain.lower[axis], case.domain.upper[axis], case.sides[axis]
        slack = ROUNDING * (upper - lower)
        beyond = sides.lower if x < lower - slack else sides.upper if x > upper + slack else None
        if beyond is None or beyond.kind == "open" or (beyond.kind == "periodic" and wraps):
            continue
        yield (
            f"{path}: [{_listed(place)}] is outside of the domain, {AXES[axis]} from {lower:g} to {upper:g} m, where no "
            "fluid comes; move it inside"
        )
        return


# bodies -----------------------------------------------------------------------------------------------------


def _bodies_through_walls(case: Case, geometry: Geometry) -> Iterator[str]:
    """Bodies that start clear of a wall of the domain and are taken through it, and through fluid that lies before it.

    Without fluid in its way a body that leaves may be meant: a gate that is lifted out. So may one that begins in the wall.
    """
    tracks = forcing_of(case).tracks if case.bodies else ()
    fluid = geometry.position[: geometry.fluid_count]
    for track in tracks:
        rows = geometry.body == geometry.body_names.index(track.name) + 1
        found = _collision(case, track, geometry.position[rows], fluid)
        if found is not None:
            axis, side, time = found
            yield (
                f"bodies.{short(track.name)}.motion: takes the body through the wall at {AXES[axis]} = {side:g} m (by "
                f"t = {time:.3g} s) and the fluid before it; walls stop no body: end the motion before them, or move that "
                "side farther out"
            )


def _collision(
    case: Case, track: Track, points: NDArray[np.float64], fluid: NDArray[np.float64]
) -> tuple[int, float, float] | None:
    """Return (axis, coordinate in m, time in s) of the wall that a body is taken through, None without any.

    points: (n, d), particles of the body at time 0, m; fluid: (m, d), particles of the fluid then, m
    """
    from scipy.spatial import cKDTree

    if not len(points) or not len(fluid):
        return None
    spacing, outline = case.spacing, _outline(points)
    walls = [
        (axis, sign, float(getattr(case.domain, end)[axis]))
        for axis, sides in enumerate(case.sides)
        for end, sign in (("lower", -1.0), ("upper", 1.0))
        if getattr(sides, end).kind == "wall"
    ]
    # particles are half a spacing below the surface of a body
    clear = [wall for wall in walls if (wall[1] * (outline[:, wall[0]] - wall[2])).max() < -1.5 * spacing]
    for time in np.linspace(0.0, case.end_time, LOOKS + 1):
        now = track.place(outline, float(time))
        for axis, sign, side in clear:
            if (sign * (now[:, axis] - side)).max() > spacing:
                where = track.place(points, float(time))
                inside = where[sign * (where[:, axis] - side) < 0.0]
                near = cKDTree(fluid).query(inside, distance_upper_bound=spacing)[0] if len(inside) else np.empty(0)
                if np.isfinite(near).any():
                    return axis, side, float(time)
                clear = [wall for wall in clear if wall != (axis, sign, side)]
    return None


def _outline(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points (n, d) that are outermost in some direction; all, where they are few or span no volume."""
    from scipy.spatial import ConvexHull, QhullError

    if len(points) <= MOST_POINTS:
        return points
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points


def _listed(values: Sequence[float]) -> str:
    """Return numbers with commas between them; of more than 5 the first ones."""
    first = ", ".join(f"{value:g}" for value in values[:5])
    return first + (" ..." if len(values) > 5 else "")
