"""Records of the gauges of a run: what must be taken while the run waits, and what is computed beside it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.kernels.core.smoothing import KERNELS
from warpsph.measure.gauges import GaugeSet
from warpsph.measure.probes import sample
from warpsph.running.budgets import budget
from warpsph.running.device_sums import Nearby
from warpsph.running.state_copy import SOURCES, StateCopy, copy_state
from warpsph.snapshot import Stations

if TYPE_CHECKING:
    from warpsph.running.model import Model


@dataclass(frozen=True)
class Record:
    """What the gauges that are due at one moment need.

    state: fields of all particles; of none, if no gauge needs any
    around: the fluid around the points of gauges, if any are due
    sums, extra, surfaces: as in a snapshot
    """

    state: StateCopy
    around: StateCopy | None
    sums: dict[type, Any]
    extra: dict[str, float]
    surfaces: dict[str, Stations]


class Recorder:
    """Takes records of a run and writes the rows of its gauges.

    Args:
        model: the run.
        gauges: its gauges, with the equations of state of the run.
    """

    def __init__(self, model: Model, gauges: GaugeSet) -> None:
        self.model, self.gauges = model, gauges
        lattice, periodic = model.geometry.lattice, model.physics.spec.periodic
        self._box = [
            upper - lower if wraps else 0.0
            for lower, upper, wraps in zip(lattice.lower, lattice.upper, periodic, strict=True)
        ]
        self._nearby: Nearby | None = None
        self._grown = 0

    def take(self, names: Iterable[str]) -> Record:
        """Take what these gauges need of the present state; called by the thread of the run."""
        names = list(names)
        needs, model = self.gauges.needs(names), self.model
        extra: dict[str, float] = {}
        if "interface_length" in needs.extra:
            extra["interface_length"] = model.interface_length()
        if "wall_force" in needs.extra:
            extra.update(model.wall_forces())
        if "flow_rate" in needs.extra:
            extra.update(model.flow_rates())
        surfaces = {body: model.surface_stress(body) for body in sorted(needs.surfaces)}
        if "budget" in needs.extra:
            extra.update(budget(model.stepper.bindings, model.case.dimension))
        around = None
        if needs.samples:
            points = self.gauges.sample_points
            everywhere = np.concatenate([points[name] for name in names if name in points])
            wanted = {"position", "volume", *needs.samples} & SOURCES.keys()
            around = copy_state(model, wanted, self._around(everywhere))
        return Record(copy_state(model, needs.fields), around, model.sums.form(needs.sums), extra, surfaces)

    def write(self, record: Record) -> None:
        """Measure and write the rows that are due; called by the thread that writes. Raises OutputError."""
        gauges = self.gauges
        snapshot = record.state.snapshot(ordered=False)
        snapshot.sums, snapshot.extra, snapshot.surfaces = record.sums, record.extra, record.surfaces
        if record.around is not None:
            fluid = record.around.snapshot(ordered=False)
            points, fields, degrees = gauges.sample_points, gauges.sample_fields, gauges.sample_degrees
            for name in gauges.due(snapshot.time):
                if name in points:
                    support, spec = self.model.physics.support, self.model.physics.spec
                    reach = KERNELS[spec.kernel].support if spec.varying_h else None
                    chosen = points[name], fields[name], support, self._box, degrees[name], reach
                    snapshot.samples[name] = sample(fluid, *chosen)
        gauges.record(snapshot)

    def _around(self, points: np.ndarray) -> np.ndarray:
        """Rows of the fluid particles within reach of the points (n, d)."""
        model = self.model
        if model.physics.spec.varying_h:  # how far a particle reaches is its own affair
            return np.arange(model.particles.fluid_count)
        if self._nearby is None or self._grown != model.particles.grown:
            self._nearby = Nearby(model.particles, model.launcher, self.gauges.scene, model.physics.support)
            self._grown = model.particles.grown
        return self._nearby.rows(points)
