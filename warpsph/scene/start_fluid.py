"""The fluid particles at time 0: their places, velocities and pressures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from warpsph.case.domain import AXES
from warpsph.case.signals import vector_at
from warpsph.errors import ExpressionError, Problem
from warpsph.scene.lattice import Lattice, points_of
from warpsph.scene.masks import values_at

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case


_WALL_GAP = 0.25
"""Nearest that a random displacement brings a particle to the wall of a side, in spacings."""


@dataclass
class FluidParticles:
    """The fluid particles.

    cells: index of the cell of each particle, one array (n,) an axis
    position: (n, d), m
    shift: (n, d), how far the particle stands from the middle of its cell, m; None if it stands there
    """

    cells: tuple[NDArray[np.intp], ...]
    position: NDArray[np.float64]
    shift: NDArray[np.float64] | None


def fluid_particles(
    case: Case, lattice: Lattice, region: NDArray[np.int32], noise: float, way: NDArray[np.float64] | None
) -> FluidParticles:
    """A particle in the middle of every cell that belongs to a region, displaced by `way` (n, d), m, and by `noise`."""
    cells = np.nonzero(region >= 0)
    sites = points_of(lattice.axes(domain_only=True), cells)
    if not noise and way is None:
        return FluidParticles(cells, sites, None)
    spacing = np.array(lattice.spacing)
    shift = np.random.default_rng(case.start.seed).uniform(-1.0, 1.0, sites.shape)
    shift *= noise * spacing
    if way is not None:
        shift += way
    position = sites + shift
    for k, sides in enumerate(case.sides):
        low, high, gap = lattice.lower[k], lattice.upper[k], _WALL_GAP * lattice.spacing[k]
        if sides.periodic:
            continue
        if sides.lower.kind == "wall":
            np.maximum(position[:, k], low + gap, out=position[:, k])
        if sides.upper.kind == "wall":
            np.minimum(position[:, k], high - gap, out=position[:, k])
    np.subtract(position, sites, out=shift)
    for k in range(lattice.dimension):
        if case.periodic[k]:
            low, high = lattice.lower[k], lattice.upper[k]
            position[:, k] = low + np.mod(position[:, k] - low, high - low)
            # The remainder of a tiny negative number is rounded up to the period.
            position[position[:, k] >= high, k] = low
    return FluidParticles(cells, position, shift)


def start_velocity(case: Case, fluid: FluidParticles, problems: list[Problem]) -> NDArray[np.float64]:
    """Velocity (n, d) of fluid particles, m/s."""
    velocity = np.zeros_like(fluid.position)
    for k, expression in enumerate(case.start.velocity):
        try:
            velocity[:, k] = values_at(expression, list(fluid.position.T), (len(velocity),))
        except ExpressionError as error:
            problems.append(Problem(f"start.velocity.{k}", error.text, error.rule_with_column, error.remedy))
    return velocity


def start_density(case: Case, fluid: FluidParticles, problems: list[Problem]) -> NDArray[np.float64] | None:
    """Density (n,) of fluid particles where the case gives one, kg/m^3; None stands for that of the phases."""
    formula = case.start.density
    if formula is None:
        return None
    try:
        return np.array(values_at(formula, list(fluid.position.T), (len(fluid.position),)))
    except ExpressionError as error:
        problems.append(Problem("start.density", error.text, error.rule_with_column, error.remedy))
        return None


def start_pressure(
    case: Case,
    lattice: Lattice,
    density: NDArray[np.float64],
    solid: NDArray[np.bool_] | None,
    fluid: FluidParticles,
    filled: bool,
    problems: list[Problem],
    warnings: list[str],
) -> NDArray[np.float64] | None:
    """Pressure (n,) of fluid particles without the background, Pa; None stands for zero.

    density: of every cell of the domain, 0 where there is no fluid, kg/m^3.
    filled: the fluid fills a domain without open sides.
    """
    start = automatic_pressure(case, filled) if case.start.pressure == "auto" else case.start.pressure
    if start is None:
        return None
    if not isinstance(start, str):
        try:
            return values_at(start, list(fluid.position.T), (len(fluid.position),))
        except ExpressionError as error:
            problems.append(Problem("start.pressure", error.text, error.rule_with_column, error.remedy))
            return None
    gravity = np.array(vector_at(case.gravity), dtype=np.float64)
    if not gravity.any():
        warnings.append("start.pressure: hydrostatic has no effect without gravity")
        return None
    axis = int(np.argmax(np.abs(gravity)))
    if case.periodic[axis]:
        rule = f"needs a top, but the domain is periodic along gravity ({AXES[axis]})"
        problems.append(Problem("start.pressure", start, rule, "write none, or close that axis with walls"))
        return None
    if np.count_nonzero(gravity) > 1:
        warnings.append(
            "start.pressure: gravity lies along no axis; the hydrostatic start follows its "
            f"{AXES[axis]} component only"
        )
    of_cells = hydrostatic_pressure(density, solid, axis, float(gravity[axis]), lattice.spacing[axis])
    pressure = of_cells[fluid.cells]
    if fluid.shift is not None:
        # dp = rho g . dx takes the pressure from the site to where the particle went.
        pressure += density[fluid.cells] * (fluid.shift @ gravity)
    return pressure


def automatic_pressure(case: Case, filled: bool) -> Literal["hydrostatic"] | None:
    """What `start.pressure: auto` comes to; see `Scheme.loaded_start`."""
    closed = filled and not case.has_flow_through and len(case.phases) == 1
    if not (closed and case.scheme.loaded_start):
        return None
    pulled = [g != 0 for g in vector_at(case.gravity)]
    along_wall = not any(pulls and wraps for pulls, wraps in zip(pulled, case.periodic, strict=True))
    return "hydrostatic" if any(pulled) and along_wall else None


def hydrostatic_pressure(
    density: NDArray[np.float64], solid: NDArray[np.bool_] | None, axis: int, gravity: float, spacing: float
) -> NDArray[np.float64]:
    """Pressure at rest in the middle of each cell of a lattice, Pa, summed from the top of each column.

    density: of each cell, any number of dimensions, 0 where it is empty, kg/m^3
    solid: cells of bodies, of the same shape, or None. They count as filled with what is beside them at
    the same
        level, so that the fluid below a body has the pressure of its surroundings.
    axis: the columns' axis
    gravity: component along it, m/s^2; down is the way it points
    spacing: cell size along it, m
    """
    # From here on row 0 is the top: a cell carries all that is above it and half of its own weight.
    rows = np.moveaxis(density, axis, 0)[:: 1 if gravity > 0 else -1]
    if solid is not None and solid.any():
        rows = _fill_solid(rows, np.moveaxis(solid, axis, 0)[:: 1 if gravity > 0 else -1])
    carried = np.cumsum(rows, axis=0)
    carried -= 0.5 * rows
    carried *= abs(gravity) * spacing
    return np.moveaxis(carried[:: 1 if gravity > 0 else -1], 0, axis)


def _fill_solid(rows: NDArray[np.float64], solid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Densities with every solid cell replaced by the nearest cell of its level that is not; if the whole
    level is solid, by the cell above.

    rows: density with the top of the lattice at index 0 of the first axis.
    """
    rows, open_cells = rows.copy(), ~solid
    for axis in [*range(1, rows.ndim), 0]:
        n = rows.shape[axis]
        index = np.arange(n, dtype=np.int32).reshape([-1 if k == axis else 1 for k in range(rows.ndim)])
        before = np.maximum.accumulate(np.where(open_cells, index, -n), axis=axis)
        if axis == 0:
            source = before
        else:
            backwards = np.flip(np.where(open_cells, index, 2 * n), axis)
            after = np.flip(np.minimum.accumulate(backwards, axis=axis), axis)
            source = np.where(index - before <= after - index, before, after)
        found = (source >= 0) & (source < n)
        rows = np.where(found, np.take_along_axis(rows, np.clip(source, 0, n - 1), axis), rows)
        open_cells = open_cells | found
    return rows
