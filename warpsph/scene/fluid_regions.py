"""Which region of the case holds each cell of the domain, and whether the lattice suits it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from warpsph.case.domain import AXES
from warpsph.errors import MISSING, ExpressionError, Problem
from warpsph.scene.borders import VOID, Regions, fluid_pairs_off_lattice
from warpsph.scene.lattice import Lattice, cell_text, first_cell
from warpsph.scene.masks import contains, inside, on_sites

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.case.shapes import Shape
    from warpsph.scene.surfaces import Surface


LIGHT = 0.2
"""Share of the largest density below which a phase counts as light: a gas beside a liquid."""


def expression_problem(path: str, shape: Shape, error: Exception) -> Problem:
    if isinstance(error, ExpressionError):
        return Problem(f"{path}.where.condition", error.text, error.rule_with_column, error.remedy)
    return Problem(path, shape.kind, str(error), "use box, sphere, polygon or where")


def fluid_regions(
    case: Case,
    lattice: Lattice,
    solid: NDArray[np.bool_] | None,
    problems: list[Problem],
) -> NDArray[np.int32]:
    """Position in `case.fluids` of the region that holds each cell of the domain; -1 where there is none."""
    axes = lattice.axes(domain_only=True)
    region = np.full(lattice.count, -1, dtype=np.int32)
    # `rest` takes what the others leave, wherever it stands in the list.
    order = sorted(range(len(case.fluids)), key=lambda k: case.fluids[k].shape.kind == "rest")
    for k in order:
        fluid, path = case.fluids[k], f"fluids.{k}.shape"
        rest = fluid.shape.kind == "rest"
        if rest:
            mask = region < 0
        else:
            try:
                mask = inside(fluid.shape, axes, case.spacing)
            except ExpressionError as error:
                problems.append(expression_problem(path, fluid.shape, error))
                continue
        if solid is not None:
            mask &= ~solid
        clash = mask & (region >= 0)
        if not rest and clash.any():
            cell = first_cell(clash)
            other = int(region[tuple(cell)])
            both = np.count_nonzero(clash)
            rule = f"overlaps fluids.{other} at {cell_text(axes, cell)} ({both} particles in both)"
            remedy = "separate the regions, or give one of them the shape rest"
            problems.append(Problem(path, fluid.shape.kind, rule, remedy))
        elif not mask.any():
            why = "the other regions leave nothing of the domain" if rest else "no particle lies in it"
            remedy = "delete this region" if rest else "move or enlarge it, or make particle_spacing smaller"
            rule = f"{why} (particle_spacing: {case.spacing:g})"
            problems.append(Problem(path, fluid.shape.kind, rule, remedy))
        region[mask] = k
    return region


def loose_gas(
    case: Case, lattice: Lattice, phase: NDArray[np.int32], solid: NDArray[np.bool_] | None, support: float
) -> list[Problem]:
    """A problem for each light phase beside a dense one that an open side or empty space is in reach of.

    Nothing holds the pressure of a gas there: it is torn like a liquid, and what it does to the liquid is nonsense. A
    liquid alone has a free surface there, at which its pressure is zero.

    phase: of each cell of the domain, -1 where there is no fluid
    support: reach of the smoothing kernel, m; it is followed along the axes, and bodies end it
    """
    names = case.phase_names
    densities = [case.phases[name].density for name in names]
    light = [k for k, density in enumerate(densities) if density < LIGHT * max(densities)]
    problems: list[Problem] = []
    if not light:
        return problems
    passable = ~solid if solid is not None else np.ones(phase.shape, np.bool_)
    empty, beside_empty = (phase < 0) & passable, np.zeros(phase.shape, np.bool_)
    if not (case.has_open_sides or empty.any()):
        return problems
    places = {"fluids": beside_empty}  # key -> cells from which it is in reach
    for axis, sides in enumerate(case.sides):
        reach = math.ceil(support / lattice.spacing[axis] - 1e-9)
        beside_empty |= _seen(empty, passable, axis, reach, case.periodic[axis])
        both = sides.lower.kind == sides.upper.kind
        for end, side, first in (("lower", sides.lower, 0), ("upper", sides.upper, -1)):
            if side.kind == "open":
                rim = np.zeros(phase.shape, np.bool_)
                np.moveaxis(rim, axis, 0)[first] = np.moveaxis(passable, axis, 0)[first]
                key = f"domain.boundary.{AXES[axis]}" + ("" if both else f".{end}")
                places[key] = _seen(rim, passable, axis, reach - 1, wraps=False) | places.get(key, False)
    for key, seen in places.items():
        for k in light:
            touched = seen & (phase == k)
            if touched.any():
                gas = f"the gas {names[k]} ({densities[k]:g} kg/m^3 beside {max(densities):g})"
                problems.append(_loose_gas_problem(key, gas, cell_text(lattice.axes(domain_only=True), first_cell(touched))))
    return problems


def _seen(start: NDArray[np.bool_], passable: NDArray[np.bool_], axis: int, reach: int, wraps: bool) -> NDArray[np.bool_]:
    """The cells at most `reach` cells from those of `start` along an axis, with none between that is not passable."""
    cells, free = np.moveaxis(start.copy(), axis, 0), np.moveaxis(passable, axis, 0)
    for _ in range(reach):
        grown = cells.copy()
        grown[1:] |= cells[:-1]
        grown[:-1] |= cells[1:]
        if wraps:
            grown[0] |= cells[-1]
            grown[-1] |= cells[0]
        cells = grown & free
    return np.moveaxis(cells, 0, axis)


def _loose_gas_problem(key: str, gas: str, place: str) -> Problem:
    if key == "fluids":
        rule = f"{gas} meets empty space at {place}, where nothing holds its pressure"
        remedy = "fill the space with it (shape: rest) in a closed or periodic domain, or leave the gas out"
        return Problem(key, MISSING, rule, remedy)
    rule = f"{gas} meets this side at {place}, where nothing holds its pressure"
    remedy = "make the side a wall, or leave the gas out: the liquid then has a free surface"
    return Problem(key, "open", rule, remedy)


def off_lattice(case: Case, lattice: Lattice) -> list[str]:
    """A line for each face of a box that a lattice cannot represent."""
    return [
        f"fluids.{k}.shape.box: a face across the {axis} axis runs through the middle of particles, so the "
        "region is half a spacing off there; choose a particle_spacing that puts it between rows"
        for k, fluid in sorted(enumerate(case.fluids), key=lambda item: item[1].shape.kind == "rest")
        for axis in on_sites(fluid.shape, lattice)
    ]


class EntryAt:
    """The rule that says which entry of `fluids` holds each of the points (n, d), VOID for none and in bodies."""

    def __init__(self, case: Case, bodies: Sequence[Surface] = ()) -> None:
        self.case = case
        self.bodies = bodies

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        fluids = self.case.fluids
        rest = next((k for k, fluid in enumerate(fluids) if fluid.shape.kind == "rest"), VOID)
        entry = np.full(len(points), rest, dtype=np.int32)
        # the first of two that overlap between the sites of the lattice has the point
        for k in reversed(range(len(fluids))):
            if fluids[k].shape.kind != "rest":
                entry[contains(fluids[k].shape, points, self.case.spacing)] = k
        for body in self.bodies:
            near = np.all((points >= body.bounds[0]) & (points <= body.bounds[1]), axis=1)
            if body.hollow:
                entry[~near] = VOID
            entry[near] = np.where(body.inside(points[near]), VOID, entry[near])
        return entry

    def in_bodies(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of the points (n, d) are in a body."""
        found = np.zeros(len(points), dtype=np.bool_)
        for body in self.bodies:
            near = np.all((points >= body.bounds[0]) & (points <= body.bounds[1]), axis=1)
            if body.hollow:
                found |= ~near
            found[near] |= body.inside(points[near])
        return found


def chosen_arrangement(case: Case, regions: Regions, off_lattice_bodies: Sequence[str] = ()) -> tuple[str, str]:
    """What `start.arrangement` comes to, and why.

    off_lattice_bodies: names of bodies whose surface runs through lattice cells.
    """
    given = case.start.arrangement
    if given != "auto":
        return given, "as given"
    if off_lattice_bodies:
        return "fitted", f"the surface of {', '.join(off_lattice_bodies)} runs through rows of particles"
    if len(case.phases) < 2:
        return "lattice", "a single phase"
    pairs = fluid_pairs_off_lattice(regions)
    if not pairs:
        return "lattice", "every interface between two phases lies between rows of particles"
    names = case.phase_names
    told = ", ".join(f"{names[a]} and {names[b]}" for a, b in sorted(pairs))
    return "fitted", f"the interface of {told} runs through rows of particles"
