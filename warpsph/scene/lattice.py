"""The cells of the domain, one particle each, and the layers of cells around it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.domain import AXES
from warpsph.errors import CaseError, Problem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case


_FIT = 1e-6
"""Relative misfit of an extent up to which it counts as a multiple of the spacing."""


@dataclass(frozen=True)
class Lattice:
    """The cells of the domain and of the layers around it; d = number of dimensions.

    lower: lower corner of the domain's cells, m
    spacing: cell size along each axis, m
    count: cells of the domain along each axis
    layers: further cells (before, after) the domain along each axis
    """

    lower: tuple[float, ...]
    spacing: tuple[float, ...]
    count: tuple[int, ...]
    layers: tuple[tuple[int, int], ...]

    @property
    def dimension(self) -> int:
        """Number of dimensions."""
        return len(self.count)

    @property
    def upper(self) -> tuple[float, ...]:
        """Upper corner of the domain's cells, m."""
        return tuple(a + n * s for a, n, s in zip(self.lower, self.count, self.spacing, strict=True))

    @property
    def cell_volume(self) -> float:
        """Volume of a cell, m^d."""
        return math.prod(self.spacing)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis, layers included."""
        return tuple(before + n + after for n, (before, after) in zip(self.count, self.layers, strict=True))

    @property
    def domain(self) -> tuple[slice, ...]:
        """Index of the domain's cells in an array of `shape`."""
        starts = (before for before, _ in self.layers)
        return tuple(slice(start, start + n) for start, n in zip(starts, self.count, strict=True))

    def within(self, points: NDArray[np.float64], periodic: Any) -> NDArray[np.float64]:
        """Points (n, d), m, those beyond the domain along axes that are `periodic` (d,) where they come in again."""
        lower, upper = np.array(self.lower), np.array(self.upper)
        periods = np.floor((points - lower) / (upper - lower)) * np.asarray(periodic)
        return np.asarray(points - periods * (upper - lower))

    def axis(self, axis: int) -> NDArray[np.float64]:
        """Coordinates of the cell centres along one axis, layers included, m; ascending."""
        before, after = self.layers[axis]
        middle = np.arange(-before, self.count[axis] + after, dtype=np.float64) + 0.5
        return self.lower[axis] + middle * self.spacing[axis]

    def axes(self, domain_only: bool = False) -> list[NDArray[np.float64]]:
        """Coordinates along every axis."""
        cut = self.domain if domain_only else (slice(None),) * self.dimension
        return [self.axis(axis)[cut[axis]] for axis in range(self.dimension)]


def make_lattice(case: Case, support: float, warnings: list[str] | None = None) -> Lattice:
    """The cells of the case's domain, and of the layers around it if there are walls or bodies.

    support: support radius of the smoothing kernel, m.
    warnings: gets a line for each axis whose extent is no multiple of the particle spacing.

    Raises CaseError if the domain holds no cell or a periodic axis is shorter than two support radii.
    """
    if not (math.isfinite(support) and support > 0):
        raise ValueError(f"support has to be a positive length, not {support}")
    warnings = [] if warnings is None else warnings
    problems = []
    spacing, lower, count, layers = [], [], [], []
    for axis, (start, end) in enumerate(zip(case.domain.lower, case.domain.upper, strict=True)):
        periodic = case.periodic[axis]
        extent = end - start
        n = math.floor(extent / case.spacing + 0.5)
        if n < 1:
            problems.append(
                Problem(
                    "particle_spacing",
                    case.spacing,
                    f"leaves no room for a particle along {AXES[axis]} ({extent:g} m)",
                    f"write at most {extent:g}",
                )
            )
            continue
        if periodic and extent < 2 * support * (1 - 1e-9):
            problems.append(
                Problem(
                    f"domain.boundary.{AXES[axis]}",
                    "periodic",
                    f"needs an extent of twice the support radius, {2 * support:.4g} m, has {extent:.4g} m",
                    "enlarge the domain or lower particle_spacing",
                )
            )
        fits = abs(extent - n * case.spacing) <= _FIT * extent
        if fits or periodic:
            step, first = extent / n, start
        else:
            step, first = case.spacing, start + 0.5 * (extent - n * case.spacing)
        if not fits:
            done = (
                f"the spacing along {AXES[axis]} is {step:.6g} m instead"
                if periodic
                else f"its {n} cells are centred and end {first - start:+.3g} m from both sides"
            )
            warnings.append(
                f"particle_spacing: {case.spacing:.10g} m does not divide the {extent:.10g} m of the domain "
                f"along {AXES[axis]}; {done} ({extent / n:.10g} would fit)"
            )
        # The tiny amount taken off keeps a support of exactly three spacings from becoming four by rounding.
        depth = 0 if periodic or not case.has_walls else math.ceil(support / step - 1e-9)
        spacing.append(step)
        lower.append(first)
        count.append(n)
        layers.append((depth, depth))
    if problems:
        raise CaseError(problems)
    return Lattice(tuple(lower), tuple(spacing), tuple(count), tuple(layers))


def points_of(axes: Sequence[NDArray[np.float64]], cells: tuple[NDArray[np.intp], ...]) -> NDArray[np.float64]:
    """Centres (n, d) of the cells with the given indices."""
    points = np.empty((len(cells[0]), len(axes)))
    for k, (axis, index) in enumerate(zip(axes, cells, strict=True)):
        points[:, k] = axis[index]
    return points


def open_grid(axes: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """The axes shaped so that they broadcast to the lattice."""
    d = len(axes)
    return [axis.reshape([-1 if k == j else 1 for j in range(d)]) for k, axis in enumerate(axes)]


def cell_text(axes: Sequence[NDArray[np.float64]], cell: Sequence[int]) -> str:
    """Text of a cell's centre."""
    return "(" + ", ".join(f"{axis[k]:.6g}" for axis, k in zip(axes, cell, strict=True)) + ")"


def first_cell(mask: NDArray[np.bool_]) -> list[int]:
    """Index of the first true cell."""
    return [int(k) for k in np.unravel_index(int(np.argmax(mask)), mask.shape)]
