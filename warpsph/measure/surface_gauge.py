"""Gauge of pressure and friction along the surface of a body."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpsph.case.coefficients import chosen_body, reference_pressure
from warpsph.errors import WarpsphError
from warpsph.measure.gauge import Gauge, Needs
from warpsph.snapshot import Snapshot


class SurfaceStressGauge(Gauge):
    """One row for each station of the surface of a body: where it is, pressure and friction there [Pa].

    The stations of a plane body come in the order of its outline, and shear, the friction along it, has the sign of that
    sense. The sum over the stations of length (3-D: area) times (friction - pressure normal) is the force on the body, to
    second order in the size of a station over the radius of the surface.
    """

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        super().__init__(name, spec, case)
        self.body = chosen_body(case, spec)
        self.needs = Needs.of(surfaces=(self.body,))
        self.scale = None if spec.speed is None else reference_pressure(case, spec)

    def rows(self, snapshot: Snapshot) -> np.ndarray:
        if self.body not in snapshot.surfaces:
            raise WarpsphError(f"gauges.{self.name}: this scene does not measure the surface of {self.body!r}")
        found = snapshot.surfaces[self.body]
        places = [*found.position.T, *found.normal.T, found.area, found.pressure]
        if found.arc is not None and found.angle is not None and found.along is not None:
            shear = found.along
            columns = [found.arc, found.angle, *places, shear, *found.friction.T]
        else:
            along = found.friction - found.normal * np.einsum("ij,ij->i", found.friction, found.normal)[:, None]
            shear = np.linalg.norm(along, axis=1)
            columns = [*places, shear, *found.friction.T]
        if self.scale is not None:
            columns += [(found.pressure - self.spec.far_pressure) / self.scale, shear / self.scale]
        return np.stack(columns, axis=1)
