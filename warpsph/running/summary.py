"""Parts of the summary of a run."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.snapshot import Snapshot


def leak_warning(most: Mapping[str, int], last: Mapping[str, int]) -> str:
    """Return the warning of particles where none may be: the largest count of each place, and that at the end."""
    counts = ", ".join(f"{name} {most[name]} (at the end {last[name]})" for name in most if most[name])
    return (
        f"particles beyond a wall or inside a body: {counts}; what they do there means nothing. "
        "A smaller particle_spacing, or a start without a jump of the velocity at a wall, keeps them in"
    )


def spilled(case: Case, fluid: Snapshot, reach: float) -> dict[str, int]:
    """Return how many particles of each phase have gone over the rim of an open side and are outside a wall of the domain.

    That is who is beyond a side that is a wall, by more than the `reach` [m] of its particles, or beyond an open side too.
    """
    count = len(fluid.position)
    over, behind, outside = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    for axis, sides in enumerate(case.sides):
        x = fluid.position[:, axis]
        for side, beyond in (
            (sides.lower, case.domain.lower[axis] - x),
            (sides.upper, x - case.domain.upper[axis]),
        ):
            if side.kind == "wall":
                behind |= beyond > 0.0
                outside |= beyond > reach
            elif side.kind == "open":
                over |= beyond > 0.0
    gone = outside | (behind & over)
    return {name: int(np.count_nonzero(gone & (fluid.phase == k))) for k, name in enumerate(case.phase_names)}


def spill_warning(counts: Mapping[str, int]) -> str:
    """Return the warning of particles that have gone over the rim of an open side."""
    listed = ", ".join(f"{name} {count}" for name, count in counts.items() if count)
    return (
        f"particles that went over the rim of an open side and are outside: {listed}; "
        "they are stopped outside. Move that side of the domain farther out, or make it a wall"
    )


def solver_warnings(totals: Mapping[str, Any]) -> list[str]:
    """Return a warning for each kind of solve of which some failed, from the sums over a run."""
    texts = []
    if totals["failures"]:
        texts.append(
            f"{totals['failures']} of {totals['solves']} pressure solves ended above numerics.tolerance "
            f"({totals['tolerance']:g}), the worst at a relative residual of {totals['worst_residual']:.2g}: raise "
            "numerics.maximum_iterations, use preconditioner: multigrid, a looser tolerance or precision: float64"
        )
    viscous = totals.get("viscosity", {"failures": 0})
    if viscous["failures"]:
        texts.append(
            f"{viscous['failures']} of {viscous['solves']} solves of implicit viscosity ended above a relative residual "
            f"of {viscous['tolerance']:g}, the worst at {viscous['worst_residual']:.2g}: raise "
            "numerics.maximum_iterations, lower numerics.maximum_step, or use precision: float64"
        )
    return texts


def machine() -> dict[str, Any]:
    """Return what the run is on."""
    from warpsph.running.model import default_threads

    return {
        "system": platform.platform(),
        "processor": _processor(),
        "processors": default_threads(),
        "python": platform.python_version(),
    }


def device_name(device: str) -> str:
    """Return the name of a device in words; of the CPU that of the processor."""
    if device == "cpu":
        return _processor()
    import warp

    return str(warp.get_device(device).name)


def _processor() -> str:
    """Return the name of the processor."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def versions() -> dict[str, str]:
    """Return the versions of the packages that a run uses, by name."""
    found = {}
    for name in ("warp-lang", "numpy", "h5py", "pyvista", "pydantic"):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found
