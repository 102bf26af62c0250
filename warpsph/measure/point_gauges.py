"""Gauges of fields at points, along lines and over the faces of sensors."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from warpsph.case.columns import VECTOR_FIELDS
from warpsph.case.sensors import face_spots, wall_normal
from warpsph.errors import WarpsphError
from warpsph.measure.gauge import Gauge, Needs
from warpsph.snapshot import Snapshot


class PointsGauge(Gauge):
    """Fields at given points: one row for each point and time, with the point's position.

    With an `area` each point is the middle of a sensor's face, and its row holds the means over the face (`sensors`). Of a
    face that is partly dry the pressure is that of the force on it: a dry part adds nothing to the mean and counts in full.
    Other fields are means over the wet part. A face without fluid has nan, like a point without.

    Next to a wall the fluid alone is looked at, on its one side; the pressures of wall particles take no part. The value at
    a point is that of a quadratic through the fluid within the support radius, carried on to the wall (`probes`). At the
    face of a sensor it is that of a linear fit, which has 0.6 of the noise; the pressure at a wall is nearly linear there.

    The values come interpolated in `snapshot.samples[name][field]`, (samples,) or (samples, dimension); `samples_at` holds
    their places, those of the first point first.
    """

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.fields: list[str] = list(spec.fields)
        self.needs = Needs.of(samples=self.fields)
        self.degree = 2 if getattr(spec, "area", None) is None else 1

    @functools.cached_property
    def samples_at(self) -> np.ndarray:
        """Where the fields are interpolated, (samples, dimension) [m]."""
        area = getattr(self.spec, "area", None)
        if area is None:
            return self.points
        faces = []
        for point in self.points:
            normal = wall_normal(self.case, point) if self.spec.normal is None else self.spec.normal
            faces.append(point + face_spots(area, normal, self.case.particle_spacing))
        return np.concatenate(faces)

    @functools.cached_property
    def points(self) -> np.ndarray:
        """The points, (points, dimension), m."""
        return np.asarray(self.spec.points, np.float64).reshape(-1, self.dimension)

    def rows(self, snapshot: Snapshot) -> np.ndarray:
        samples = snapshot.samples.get(self.name, {})
        parts = [self.points]
        for name in self.fields:
            if name not in samples:
                raise WarpsphError(f"gauges.{self.name}: this scene does not sample {name!r}")
            width = self.dimension if name in VECTOR_FIELDS else 1
            values = np.asarray(samples[name], np.float64).reshape(len(self.points), -1, width)
            parts.append(_mean_over_faces(values, dry_is_zero=name == "pressure"))
        return np.hstack(parts)

    def row(self, snapshot: Snapshot) -> list[float]:
        """The row of the first point."""
        return list(self.rows(snapshot)[0])


def _mean_over_faces(values: np.ndarray, dry_is_zero: bool) -> np.ndarray:
    """Means (points, width) of samples (points, samples of each, width); nan, where it is dry, is 0 or left out."""
    wet = np.isfinite(values)
    count = wet.sum(axis=1)
    divisor = np.full_like(count, values.shape[1]) if dry_is_zero else count
    total = np.where(wet, values, 0.0).sum(axis=1)
    return np.divide(total, divisor, out=np.full(count.shape, np.nan), where=count > 0)


class LineGauge(PointsGauge):
    """Fields at `count` points spread evenly from `from` to `to`, both ends included."""

    @functools.cached_property
    def points(self) -> np.ndarray:
        """The points, (points, dimension), m."""
        start, end = np.asarray(self.spec.from_, np.float64), np.asarray(self.spec.to, np.float64)
        share = np.linspace(0.0, 1.0, self.spec.count)[:, None]
        return (1.0 - share) * start + share * end
