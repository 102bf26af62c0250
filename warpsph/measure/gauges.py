"""Gauges: numbers measured while a run goes on, one CSV file each.

| type | columns |
|---|---|
| energy | kinetic, potential, elastic, surface, total, and `kinetic gas`, `total gas` ... for each phase |
| momentum | momentum_x ..., angular_z (3-D: x, y, z), scale, max_speed |
| budget | `power viscosity`, `work viscosity`, `force_x viscosity`, `impulse_x viscosity` ... of each term and in total |
| phase_pressure | the name of each phase, `gas - liquid` ..., max, min |
| extents | `lowest_x gas`, `highest_x gas`, `centroid_x gas`, `semi_axis_x gas`, `front gas`, `area gas` ... |
| contour | `perimeter gas`, `circularity gas`, `filling gas`, `lowest_x gas`, `highest_x gas` ... (2-D) |
| deformation | `long_axis gas`, `short_axis gas`, `deformation gas`, `angle gas` (3-D: `direction_x gas` ...) ... |
| fragments | `count gas`, `area_1 gas` (3-D: `volume_1 gas`) ..., `rest gas` ... |
| lens | `angle oil`, `angle water`, `angle air`, width (2-D) |
| phase_velocity | `velocity_x gas` ..., `max_speed gas` |
| strays | the name of each phase |
| interface_length | interface_length |
| interface_wave | cosine, sine |
| wall_force | force_x ..., and `force_x block` ... for each body |
| force_coefficients | `Cd block`, `Cl block`, `Cm block`, `Cd_pressure block` ... of each body |
| surface_stress | arc, angle, position, normal, pressure, shear; one row for each station of the surface |
| elevation | `surface_1`, `surface_2` ... above each place |
| flow_rate | `flow x_lower`, `through x_lower`, `face_pressure x_lower` ... of each inlet and outlet |
| reattachment | separation, reattachment |
| points, line | position and fields, one row for each point |

What each looks at is in its `needs`.
To add one: a class with `needs` and `row` or `rows` (see `warpsph.measure.gauge`), its name in GAUGES, and its columns in
`warpsph.case.columns`.

The files start with a line of names and units, `time [s],kinetic [J/m]`; numbers are written with all their
digits and each row is on its way to the disk before the next step is done. In 2-D every quantity is per
metre of depth.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np

from warpsph.case.columns import OWN_COLUMNS, Column
from warpsph.case.gauge_models import REGISTERED, GaugeModel
from warpsph.errors import CaseError, Problem, listed
from warpsph.files.output import Schedule
from warpsph.measure.drop_gauges import DeformationGauge, FragmentsGauge
from warpsph.measure.elevation import ElevationGauge
from warpsph.measure.flow_gauges import FlowRateGauge, ReattachmentGauge
from warpsph.measure.gauge import Gauge, Needs
from warpsph.measure.gauge_files import GaugeFile
from warpsph.measure.lens_gauge import LensGauge
from warpsph.measure.phase_gauges import (
    BudgetGauge,
    EnergyGauge,
    ForceCoefficientsGauge,
    InterfaceLengthGauge,
    MomentumGauge,
    PhasePressureGauge,
    PhaseVelocityGauge,
    WallForceGauge,
)
from warpsph.measure.point_gauges import LineGauge, PointsGauge
from warpsph.measure.shape_gauges import ContourGauge, ExtentsGauge, InterfaceWaveGauge, StraysGauge
from warpsph.measure.surface_gauge import SurfaceStressGauge
from warpsph.measure.totals import PhaseEos, Scene
from warpsph.snapshot import Snapshot

GAUGES: dict[str, type[Gauge]] = {
    "energy": EnergyGauge,
    "momentum": MomentumGauge,
    "budget": BudgetGauge,
    "phase_pressure": PhasePressureGauge,
    "extents": ExtentsGauge,
    "contour": ContourGauge,
    "deformation": DeformationGauge,
    "fragments": FragmentsGauge,
    "lens": LensGauge,
    "phase_velocity": PhaseVelocityGauge,
    "strays": StraysGauge,
    "interface_length": InterfaceLengthGauge,
    "interface_wave": InterfaceWaveGauge,
    "wall_force": WallForceGauge,
    "force_coefficients": ForceCoefficientsGauge,
    "surface_stress": SurfaceStressGauge,
    "elevation": ElevationGauge,
    "points": PointsGauge,
    "line": LineGauge,
    "flow_rate": FlowRateGauge,
    "reattachment": ReattachmentGauge,
}


def register(model: type[GaugeModel], kind: type[Gauge]) -> None:
    """Add a type of gauge; cases that are loaded afterwards may use it.

    Args:
        model: its section of a case; `type` has a `Literal` of one name that is new.
        kind: what measures it, made with (name, section, case).

    Raises:
        ValueError: there is a gauge of that type already, the model names no type, or the kind no columns.
    """
    names = get_args(model.model_fields["type"].annotation)
    if len(names) != 1 or not isinstance(names[0], str):
        raise ValueError(f"{model.__name__}.type: needs a Literal of one name")
    if names[0] in GAUGES and REGISTERED.get(names[0]) is not model:
        raise ValueError(f"there is a gauge of type {names[0]!r} already; choose another name")
    if kind.columns is Gauge.columns:
        raise ValueError(f"{kind.__name__}: needs columns")
    GAUGES[names[0]], REGISTERED[names[0]] = kind, model
    OWN_COLUMNS[names[0]] = lambda spec, case: kind(names[0], spec, case).columns


def unregister(name: str) -> None:
    """Forget a type of gauge that was added. Raises KeyError if none of that name was."""
    del REGISTERED[name], GAUGES[name], OWN_COLUMNS[name]


# ------------------------------------------------------------------------------------------------------------
# All gauges of a run


def schedule_of(spec: Any) -> Schedule:
    """When a gauge of a case is due."""
    return Schedule(getattr(spec, "interval", None), getattr(spec, "times", None))


class GaugeSet:
    """The gauges of a case: when they are due, their rows in memory and in `folder` (None: in memory only).

    `eos` gives the energy gauge the sound speeds that were chosen for `auto`. Of a run that starts later than 0, at
    `start_time` [s], what was due before is past. With `restart_time` [s] that is so too, and the files in the folder are
    continued: rows after that time are cut off, but only once all files are known to fit. Raises OutputError.
    """

    def __init__(
        self,
        case: Any,
        folder: Path | None = None,
        *,
        eos: Mapping[str, PhaseEos] | None = None,
        restart_time: float | None = None,
        start_time: float | None = None,
    ) -> None:
        self.scene = Scene(case, eos)
        self.gauges: dict[str, Gauge] = {}
        self.schedules: dict[str, Schedule] = {}
        self._tables: dict[str, GaugeFile] = {}
        for name, spec in (case.gauges or {}).items():
            kind = GAUGES[spec.type]
            gauge = EnergyGauge(name, spec, case, eos) if kind is EnergyGauge else kind(name, spec, case)
            columns = [Column("time", "s"), *gauge.columns]
            names = [column.name for column in columns]
            twice = next((column for column in names if names.count(column) > 1), None)
            if twice is not None:
                rule = f"has two columns called {twice!r}"
                raise CaseError([Problem(f"gauges.{name}", spec.type, rule, "rename the phase or body")])
            self.gauges[name] = gauge
            self._tables[name] = GaugeFile(columns, None if folder is None else folder / f"{name}.csv")
            self.schedules[name] = schedule_of(spec)
        if restart_time is not None:
            start_time = restart_time
            for table in self._tables.values():
                table.check()
        for name, table in self._tables.items():
            table.open(restart_time)
            if start_time is not None:
                # What is due right at the restart may be missing in the file, if the checkpoint was written before the row.
                self.schedules[name].advance(start_time * (1.0 - 1e-8))
                if table.blocks:
                    self.schedules[name].advance(float(table.blocks[-1][-1, 0]))

    @property
    def next_time(self) -> float:
        """When the next gauge is due [s]; infinity if none is."""
        return min((schedule.next for schedule in self.schedules.values()), default=math.inf)

    def due(self, time: float) -> list[str]:
        """Names of the gauges that are due at `time` [s]."""
        return [name for name, schedule in self.schedules.items() if schedule.due(time)]

    def needs(self, names: Iterable[str]) -> Needs:
        """What these gauges look at."""
        return functools.reduce(operator.or_, (self.gauges[name].needs for name in names), Needs())

    @property
    def sample_points(self) -> dict[str, np.ndarray]:
        """Places (n, dimension) [m] at which gauges want interpolated fields, by gauge name."""
        return {name: gauge.samples_at for name, gauge in self._samplers().items()}

    @property
    def sample_fields(self) -> dict[str, list[str]]:
        """The fields that these gauges want at their points, by gauge name."""
        return {name: gauge.fields for name, gauge in self._samplers().items()}

    @property
    def sample_degrees(self) -> dict[str, int]:
        """Degree of the polynomial that is fitted for each of these gauges, by gauge name."""
        return {name: gauge.degree for name, gauge in self._samplers().items()}

    def _samplers(self) -> dict[str, PointsGauge]:
        return {name: gauge for name, gauge in self.gauges.items() if isinstance(gauge, PointsGauge)}

    def record(self, snapshot: Snapshot) -> list[str]:
        """Measure and write every gauge that is due at the snapshot's time; returns their names."""
        names = self.due(snapshot.time)
        for name in names:
            rows = self.gauges[name].rows(snapshot)
            times = np.full((len(rows), 1), snapshot.time)
            self._tables[name].append(np.hstack([times, rows]))
            self.schedules[name].advance(snapshot.time)
        return names

    def series(self, name: str) -> dict[str, np.ndarray]:
        """What a gauge has measured so far: column name (without unit) -> values, `time` among them."""
        if name not in self._tables:
            raise KeyError(f"no gauge {name!r}; there are {listed(self._tables) or 'none'}")
        return self._tables[name].series()

    def units(self, name: str) -> dict[str, str]:
        """Column name -> unit."""
        return {column.name: column.unit for column in self._tables[name].columns}

    def close(self) -> None:
        """Close the files; `series` stays available."""
        for table in self._tables.values():
            table.close()

    def __enter__(self) -> GaugeSet:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
