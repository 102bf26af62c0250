"""What all gauges share: columns, and what a gauge needs to see of the state."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpsph.case.columns import Column, columns_of
from warpsph.errors import WarpsphError
from warpsph.measure.totals import PhaseSums, Scene
from warpsph.snapshot import Snapshot

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Needs:
    """What gauges look at; a run measures and copies just that for a record."""

    sums: frozenset[type[PhaseSums]] = frozenset()
    """groups of `warpsph.measure.totals`, formed on the device"""
    extra: frozenset[str] = frozenset()
    """other numbers of the device: `interface_length`, `wall_force`, `flow_rate`, `budget`"""
    fields: frozenset[str] = frozenset()
    """of the snapshot, for all particles; `phase` and `kind` come with any"""
    samples: frozenset[str] = frozenset()
    """of the snapshot, for the fluid around the points of the gauge"""
    surfaces: frozenset[str] = frozenset()
    """bodies along whose surface the device measures what the fluid does"""

    @classmethod
    def of(
        cls,
        *sums: type[PhaseSums],
        extra: Iterable[str] = (),
        fields: Iterable[str] = (),
        samples: Iterable[str] = (),
        surfaces: Iterable[str] = (),
    ) -> Needs:
        """Needs from any iterables."""
        return cls(frozenset(sums), frozenset(extra), frozenset(fields), frozenset(samples), frozenset(surfaces))

    def __or__(self, other: Needs) -> Needs:
        return Needs(
            self.sums | other.sums,
            self.extra | other.extra,
            self.fields | other.fields,
            self.samples | other.samples,
            self.surfaces | other.surfaces,
        )


class Gauge:
    """Base of all gauges: what one measures from a snapshot.

    needs: what of the snapshot is looked at; nothing else of it need be there
    """

    needs: Needs

    def __init__(self, name: str, spec: Any, case: Any) -> None:
        self.name = name
        self.spec = spec
        self.case = case
        self.scene = Scene(case)
        self.dimension: int = case.dimension
        self.phase_names: list[str] = list(case.phase_names)

    @property
    def axes(self) -> tuple[str, ...]:
        return AXES[: self.dimension]

    def unit(self, three_d: str, two_d: str) -> str:
        """The unit in this dimension."""
        return {3: three_d, 2: two_d}.get(self.dimension, f"{three_d}/m^2")

    @property
    def columns(self) -> list[Column]:
        """Names and units of the columns after the time."""
        return columns_of(self.spec, self.case)

    def row(self, snapshot: Snapshot) -> list[float]:
        """One number for each column."""
        raise NotImplementedError

    def rows(self, snapshot: Snapshot) -> np.ndarray:
        """(rows, columns) float64; one row, except for gauges of many points."""
        return np.asarray([self.row(snapshot)], np.float64)

    def extra(self, snapshot: Snapshot, key: str) -> float:
        """A number that the device measured; raises WarpsphError if it did not."""
        if key not in snapshot.extra:
            known = ", ".join(sorted(snapshot.extra)) or "nothing"
            raise WarpsphError(f"gauges.{self.name}: this scene does not measure {key!r} (it measures {known})")
        return float(snapshot.extra[key])
