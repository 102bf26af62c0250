"""Regions of the fluid whose particles, cells of a lattice, take another volume than the shape of the region.

A lattice knows whole rows: a tank that is filled 17.5 rows high gets 17 or 18. A fitted start has the volume of its shapes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from warpsph.case.domain import AXES
from warpsph.scene.borders import VOID, Regions, volumes
from warpsph.scene.masks import on_sites

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case

WORTH = 0.01  # share of the volume of a region from which on its misfit is told
_WHOLE = 0.1  # rows that a depth may be off a whole number of them and fits


def rounded_volumes(case: Case, regions: Regions, particles: NDArray[np.float64]) -> list[str]:
    """Return a line for each region of which the lattice has more than 1 % too much or too little.

    Entries of one phase that touch are one region. Boxes between rows are told as such (`fluid_regions.off_lattice`).

    Args:
        case: validated case.
        regions: what fills the domain.
        particles: (E,), volume of the particles of each entry [m^d].
    """
    if not (regions.entry == VOID).any() and len(case.fluids) == 1:
        return []
    whole = volumes(regions)
    lines = []
    for first in np.unique(whole.region):
        entries = np.flatnonzero(whole.region == first)
        if all(on_sites(case.fluids[k].shape, regions.lattice) for k in entries):
            continue
        volume = float(whole.profiles[0][first].sum()) * regions.lattice.cell_volume
        taken = float(particles[entries].sum())
        if abs(taken - volume) > WORTH * volume:
            lines.append(_line(case, int(first), volume, taken, _fitting_spacing(regions, whole.profiles, int(first))))
    return lines


def _line(case: Case, first: int, volume: float, taken: float, fits: tuple[str, float, float] | None) -> str:
    """Return what to tell of a region by its first entry; fits: axis, extent [m], and a spacing that divides it [m]."""
    unit, what = ("m^2", "area") if case.dimension == 2 else ("m^3", "volume")
    spacing = "lower particle_spacing"
    if fits is not None:
        axis, extent, fitting = fits
        rows = f"{extent:.4g} m along {axis} ({extent / case.spacing:.4g} rows)"
        spacing = f"choose a particle_spacing that divides its {rows}, such as {fitting:.4g}"
    return (
        f"fluids.{first}.shape: has the {what} {volume:.5g} {unit}, but its particles {taken:.5g} {unit} "
        f"({taken / volume - 1.0:+.1%}), since they fill whole cells; {spacing}, or write start.arrangement: fitted"
    )


def _fitting_spacing(regions: Regions, profiles: list[NDArray[np.float64]], first: int) -> tuple[str, float, float] | None:
    """Return the axis along which a region has no whole number of rows, its extent [m] and the next finer spacing [m].

    Of several axes the one whose rows are the farthest from a whole number; none where all are nearer than a tenth.
    """
    found: tuple[str, float, float] | None = None
    farthest = _WHOLE
    for axis, spacing in enumerate(regions.lattice.spacing):
        rows = _rows(profiles[axis][first], regions.lattice.count[axis])
        off = abs(rows - round(rows))
        if off > farthest:
            farthest = off
            found = AXES[axis], rows * spacing, rows * spacing / math.ceil(rows)
    return found


def _rows(profile: NDArray[np.float64], count: int) -> float:
    """Return how many rows a region extends along an axis of so many cells; its last bins count by what they hold.

    profile: volume in each bin along the axis.
    """
    held = np.flatnonzero(profile > 0.0)
    if len(held) < 4:
        return len(held) * count / len(profile)
    ends = [min(profile[k] / profile[inner], 1.0) for k, inner in ((held[0], held[1]), (held[-1], held[-2]))]
    return float((len(held) - 2 + sum(ends)) * count / len(profile))
