"""What a run gave: its gauges and particles, from memory or from the run folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.columns import column_formula
from warpsph.errors import ExpressionError, listed, short
from warpsph.files.output import Series, last_particles
from warpsph.files.vtp import read_vtp
from warpsph.measure.gauge_files import read_gauge
from warpsph.measure.gauges import GaugeSet
from warpsph.snapshot import Snapshot
from warpsph.study.norms import NotComparable

Columns = dict[str, np.ndarray]


class Results:
    """Where gauges and particles come from: memory or the run folder."""

    def __init__(
        self,
        case: Any,
        folder: Path | None,
        gauges: GaugeSet | None,
        snapshot: Snapshot | None,
        end_time: float | None,
        frames: Path | None = None,
    ) -> None:
        self.case = case
        self.folder = folder
        self._gauges = gauges
        self._snapshot = snapshot
        self._end_time = end_time
        self._frames = folder if frames is None else frames

    def gauge(self, name: str) -> tuple[Columns, dict[str, str]]:
        """Columns and units of a gauge."""
        if self._gauges is not None and name in self._gauges.gauges:
            columns, units = self._gauges.series(name), self._gauges.units(name)
        elif self.folder is not None:
            columns, units = read_gauge(self.folder / "gauges" / f"{name}.csv")
        else:
            raise NotComparable(f"there is no gauge {name!r}")
        if not len(columns["time"]):
            raise NotComparable(f"not reached: the gauge {name!r} has no rows")
        return columns, units

    def column(self, spec: Any) -> tuple[np.ndarray, np.ndarray, str]:
        """Times, values and unit of a gauge's column, or of arithmetic of its columns."""
        columns, units = self.gauge(spec.gauge)
        values, unit = pick_column(columns, units, spec.column)
        return columns["time"], values, unit

    def end(self, times: np.ndarray) -> float:
        """The time that the run reached; `times` are those of the gauge in question."""
        return self._end_time if self._end_time is not None else float(times[-1])

    def particles(self) -> Snapshot:
        """Fluid particles at the end."""
        if self._snapshot is not None:
            return self._snapshot.fluid
        if self.folder is None:
            raise NotComparable("there are no particles")
        return last_particles(self.folder, self.case.dimension).fluid

    def particles_at(self, time: float) -> tuple[Snapshot, Snapshot | None]:
        """Fluid particles at a time [s], and those of walls and bodies as they are then, None if there are none."""
        slack = 1e-6 * max(abs(time), 1e-300)
        if self._snapshot is not None and abs(self._snapshot.time - time) <= slack:
            return self._snapshot.fluid, self._snapshot.wall
        reached = self._end_time
        if self._frames is not None:
            fluid, walls = (Series(self._frames / "particles", name) for name in ("fluid", "wall"))
            fluid.read()
            walls.read()
            for moment, name in fluid.frames:
                if abs(moment - time) <= slack:
                    found = read_vtp(fluid.path.parent / name, self.case.dimension).fluid
                    return found, self._walls_at(walls, time + slack)
            if reached is None and fluid.frames:
                reached = fluid.frames[-1][0]
        if reached is not None and reached < time - slack:
            raise NotComparable(f"not reached: needs t = {time:g} s, the run ended at {reached:g} s")
        raise NotComparable(f"there is no particle file of t = {time:g} s")

    def _walls_at(self, walls: Series, latest: float) -> Snapshot | None:
        """Walls of the last frame up to a time [s]: at rest they are written once."""
        name = next((name for moment, name in reversed(walls.frames) if moment <= latest), None)
        return None if name is None else read_vtp(walls.path.parent / name, self.case.dimension)


def pick_column(columns: Columns, units: Mapping[str, str], text: str) -> tuple[np.ndarray, str]:
    """Values and unit of a column, or of arithmetic of columns such as `2 * kinetic` or `highest_x gas - lowest_x gas`.

    The unit is empty where it does not follow from sums and differences.
    """
    if text in columns:
        return columns[text], units.get(text, "")
    try:
        expression, called = column_formula(columns, text)
        values = expression.evaluate(finite=False, **{word: columns[name] for word, name in called.items()})
    except ExpressionError as error:
        raise NotComparable(f"there is no column {short(text)!r}; there are {listed(columns)}") from error
    found = {units.get(called[word], "") for word in expression.names}
    return values, found.pop() if len(found) == 1 and not set("*/") & set(text) else ""


def distance_along(columns: Columns, gauge: Any) -> np.ndarray:
    """Distance of the rows of a line gauge from its first point, of one along a surface the arc [m]."""
    if gauge.type == "surface_stress":
        return columns["arc"]
    start = np.asarray(gauge.from_, np.float64)
    axes = ("x", "y", "z")[: len(start)]
    offset = np.stack([columns[axis] for axis in axes], axis=1) - start
    return np.asarray(np.sqrt(np.sum(offset**2, axis=1)))


def rows_at(times: np.ndarray, moment: float) -> np.ndarray:
    """Which rows of a gauge belong to a time [s]."""
    return np.asarray(np.abs(times - moment) <= 1e-6 * max(abs(moment), 1e-300))
