"""Gauges of flows through a domain: what goes through its open sides, where a flow leaves a wall and comes back."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from warpsph.measure.gauge import Gauge, Needs
from warpsph.measure.point_gauges import LineGauge
from warpsph.snapshot import Snapshot


class FlowRateGauge(Gauge):
    """Mass flow into the domain, mass that has come in less what has gone out, and mean pressure, of each open side.

    The flow is that of the sites of the side at this moment. The mass is the sum over the particles that have crossed it;
    they are counted when a neighbour list is made, so that it moves in steps.
    """

    needs = Needs.of(extra=("flow_rate",))

    def row(self, snapshot: Snapshot) -> list[float]:
        return [self.extra(snapshot, column.name) for column in self.columns]


class ReattachmentGauge(LineGauge):
    """Where the flow along a wall leaves it and comes back: changes of sign of the velocity along a line close to the wall.

    `separation` is the first place where the velocity turns from forward to backward, `reattachment` the last one where it
    turns from backward to forward, as distances from the first point of the line, between two points by interpolation; nan
    if there is none. Forward is from the first point to the last.

    With `wall`, delta off the line, the sign is that of the shear at the wall, (4 u(delta) - u(2 delta))/(2 delta) of the
    parabola through both velocities and 0: on the line itself a flow that comes back to the wall turns earlier.
    """

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.needs = Needs.of(samples=self.fields)

    @functools.cached_property
    def points(self) -> np.ndarray:
        """The points of the line, with `wall` then those twice as far off it, m."""
        line = super().points
        if self.spec.wall is None:
            return line
        way, off = line[-1] - line[0], line[0] - np.asarray(self.spec.wall, np.float64)
        return np.concatenate([line, line + (off - way * (off @ way) / (way @ way))])

    def rows(self, snapshot: Snapshot) -> np.ndarray:
        count = self.spec.count
        way = self.points[count - 1] - self.points[0]
        length = float(np.linalg.norm(way))
        velocity = np.asarray(snapshot.samples[self.name]["velocity"], np.float64)
        along = velocity @ (way / length)
        if self.spec.wall is not None:
            along = 4.0 * along[:count] - along[count:]
        place = np.linspace(0.0, length, count)
        return np.array([[_first(turns(place, -along)), _last(turns(place, along))]])


def turns(place: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Places where a value (n,) at ascending places turns from negative to positive, linear between two of them."""
    before, after = value[:-1], value[1:]
    k = np.flatnonzero((before < 0) & (after >= 0))
    return np.asarray(place[k] - before[k] * (place[k + 1] - place[k]) / (after[k] - before[k]))


def _first(places: np.ndarray) -> float:
    return float(places[0]) if len(places) else float("nan")


def _last(places: np.ndarray) -> float:
    return float(places[-1]) if len(places) else float("nan")
