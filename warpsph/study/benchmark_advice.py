"""Advice: what to take for an error that is asked for, from the stored fronts.

`fronts.json` in the package holds the runs of benchmarks with what their scenes are like. A scene is compared with those;
of the nearest one the quickest run with the error is taken, at as many spacings over the length of the scene, where the
length is (volume of the smallest phase)^(1/dimension) in both.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.case.domain import AXES
from warpsph.errors import CaseError
from warpsph.files.output import json_text
from warpsph.running.preview import estimate
from warpsph.scene.geometry import build
from warpsph.scene.physics import support_radius
from warpsph.study.fronts import Row, counts, most_accurate, sure

FILE = Path(__file__).resolve().parents[1] / "fronts.json"
"""The table that ships with the package; scripts/benchmark_tables.py writes it."""

WEIGHTS = {
    "kind": 100.0, "tension": 50.0, "free surface": 50.0, "walls": 10.0, "moving walls": 5.0, "gravity": 5.0,
    "viscosity": 3.0, "density ratio": 4.0, "dimension": 1.0,
}  # fmt: skip
"""How much a difference counts when scenes are compared; of density ratios, each factor of ten."""


def features(case: Case) -> dict[str, Any]:
    """What a scene is like, in the words of WEIGHTS: plain data that a table can hold."""
    data = case.to_dict()
    densities = [phase.density for phase in case.phases.values()]
    axes = [getattr(case.domain.boundary, axis) for axis in AXES[: case.dimension]]
    sides = [side for axis in axes for side in (axis.lower, axis.upper)]
    gas = case.scheme.internal_energy
    many = len(case.phases) > 1
    return {
        "kind": "compressible gas" if gas else "two phases" if many else "one phase",
        "tension": any(pair.coefficient > 0 for pair in case.surface_tension),
        "free surface": not gas and not many and any(side.kind == "open" for side in sides),
        "walls": any(side.kind == "wall" for side in sides) or bool(data.get("bodies")),
        "moving walls": any(side.kind == "wall" and side.moves for side in sides),
        "gravity": bool(data.get("gravity") or data.get("body_force")),
        "viscosity": any(bool(phase.viscosity) for phase in case.phases.values()),
        "density ratio": max(densities) / min(densities),
        "dimension": case.dimension,
    }


def difference(one: Mapping[str, Any], other: Mapping[str, Any]) -> float:
    """How unlike two scenes are: the sum of WEIGHTS over what differs."""
    total = 0.0
    for name, weight in WEIGHTS.items():
        if name == "density ratio":
            total += weight * abs(math.log10(one[name] / other[name]))
        elif one[name] != other[name]:
            total += weight
    return total


def unlike(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """What differs between a scene and another one, in words."""
    texts = []
    for name in WEIGHTS:
        if one[name] != other[name]:
            told = [("yes" if value else "no") if isinstance(value, bool) else f"{value:g}" if isinstance(value, int | float)
                    else str(value) for value in (one[name], other[name])]  # fmt: skip
            texts.append(f"{name} {told[0]} (there {told[1]})")
    return texts


def identity(case: Case) -> str:
    """A hash of a scene without what advice is about (spacing, precision, numerics) and what a run writes and is held to."""
    data = case.to_dict()
    for key in ("title", "particle_spacing", "precision", "numerics", "output", "gauges", "reference", "validation"):
        data.pop(key, None)
    return hashlib.sha256(json_text(data).encode()).hexdigest()[:16]


def length(case: Case) -> float:
    """(Volume of the smallest phase)^(1/dimension) of a scene, m. Raises CapacityError."""
    geometry = build(case, support_radius(case))
    fluid = geometry.kind == 0
    volumes = [float(geometry.volume[fluid & (geometry.phase == index)].sum()) for index in np.unique(geometry.phase[fluid])]
    return float(min(volumes) ** (1.0 / case.dimension))


@dataclass(frozen=True)
class Advice:
    """What to take for an error.

    case: name of the benchmark that it comes from
    says: the scenes that this benchmark speaks for; error_name: what its error is
    exact: whether the scene is that of the benchmark itself; differences: how it differs, in words
    row: the run that it is taken from; None where no run had the error
    best: the most accurate run
    changes: dotted keys and values to set
    across: spacings over the length
    particles, steps, seconds: of such a run of the scene, as expected; None where that is not known
    condition: what a gauge or reference of the case needs changed with these settings, None if nothing
    refused: choices that were quicker, but that the scene does not allow, with the reason
    """

    case: str
    says: str
    error_name: str
    exact: bool
    differences: Sequence[str]
    row: Row | None
    best: Row | None
    changes: Mapping[str, Any]
    across: float | None = None
    particles: int | None = None
    steps: int | None = None
    seconds: float | None = None
    condition: str | None = None
    refused: Sequence[str] = ()


def stored_fronts(path: Path = FILE) -> dict[str, Any]:
    """The table of the package: `cases` by name, `rows`, and where they come from."""
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def nearest(case: Case, table: Mapping[str, Any]) -> str:
    """Name of the benchmark whose scene is most like a case; the scene itself before all others."""
    own, mark = features(case), identity(case)
    return min(table["cases"], key=lambda name: (
        table["cases"][name]["identity"] != mark, difference(own, table["cases"][name]["features"])
    ))  # fmt: skip


def kind_of(device: str) -> str:
    """`cpu` or `cuda`, of a device such as `cuda:1`: what the rows of a table are told apart by."""
    return device.partition(":")[0]


def advise(case: Case, error: float, table: Mapping[str, Any], device: str = "cpu") -> Advice:
    """What to take for an error at most.

    Args:
        case: the scene.
        error: relative, above 0.
        table: as of `stored_fronts`.
        device: runs of this kind of device are looked at: those of any GPU for `cuda:1`.

    Raises CapacityError if the scene does not even fit the memory to be counted.
    """
    name = nearest(case, table)
    about = table["cases"][name]
    kind = kind_of(device)
    rows = [row for row in table["rows"] if row["case"] == name and kind_of(row["device"]) == kind and counts(row)]
    exact = about["identity"] == identity(case)
    differences = () if exact else tuple(unlike(features(case), about["features"]))
    told = {"case": name, "says": about["says"], "error_name": about["error_name"], "exact": exact,
            "differences": differences, "best": most_accurate(rows)}  # fmt: skip
    across_scene = about["length"] if exact else length(case)
    refused: list[str] = []
    for row in sure(rows, error):
        across = about["length"] / row["particle_spacing"]
        changes = {"particle_spacing": across_scene / across, "precision": row["precision"], **row["settings"]}
        condition = None
        try:
            expected = estimate(case.replace(changes))
        except CaseError as problem:
            try:  # what a case measures is no part of its flow: a gauge may be what the settings do not allow
                expected = estimate(case.replace({**changes, "gauges": {}, "reference": {}}))
                condition = str(problem.problems[0])
            except CaseError:
                refused.append(f"{row['choice']}: {problem.problems[0]}")
                continue
        found = {"row": row, "changes": changes, "across": across, "condition": condition,
                 "refused": tuple(dict.fromkeys(refused))}  # fmt: skip
        if "refused" in expected or "steps" not in expected:
            return Advice(**told, **found)
        count, steps = expected["particles"] + expected["walls"], expected["steps"]
        rate = row["particles"] * row["steps"] / row["seconds"]
        return Advice(**told, **found, particles=count, steps=steps, seconds=count * steps / rate)
    return Advice(**told, row=None, changes={}, refused=tuple(dict.fromkeys(refused)))
