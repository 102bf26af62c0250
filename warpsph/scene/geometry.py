"""From a validated case to particles: a lattice of sites, cut by the shapes of the case, on NumPy arrays.

The domain is divided into cells of one particle spacing; each particle starts in the middle of a cell. One
pass over this lattice decides what every cell holds:

1. walls: where a side of the domain is a wall, the lattice continues beyond it for as many layers as the
   smoothing kernel reaches, corners included;
2. obstacles: cells inside an obstacle become wall particles;
3. fluids: each remaining cell of the domain gets the phase of the region that contains it, or stays empty.

Cells are tested as axes, not as points: a shape gets one coordinate array an axis and returns the mask of the
whole lattice, so that a box costs next to nothing and ten million sites need no ten million temporary points.

A site exactly on the border of a region belongs to the region on its upper side, so regions that share a
border never share a site. Shapes are not repeated across periodic axes.

Where an interface between two phases runs through lattice cells, the start is a *fitted* one (`start.arrangement`): it
has the particles of the lattice, but whoever wants it gives `build` a function that arranges them along the interface
(`warpsph/scene/packing.py`). Without one, `build` stops at the lattice, which is enough for counts, walls and physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import MISSING, CaseError, ExpressionError, Problem
from warpsph.scene.borders import VOID, Regions, fluid_pairs_off_lattice

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.case.expressions import Expression
    from warpsph.case.shapes import Shape

__all__ = [
    "FLUID",
    "WALL",
    "Arrange",
    "Geometry",
    "Lattice",
    "build",
    "contains",
    "hydrostatic_pressure",
    "inside",
    "make_lattice",
]

AXES = ("x", "y", "z")
FLUID, WALL = 0, 1

_FIT = 1e-6
"""Relative misfit of an extent up to which it counts as a multiple of the spacing."""

_ON_BORDER = 1e-6
"""Distance, in spacings, within which a site counts as lying on a border."""

_BORDER_SHIFT = (1.0, 0.618, 0.414)
"""Direction in which sites are moved by `_ON_BORDER` before a test. Along no simple line, so that the sites
on a sloping border are decided in the same way all along it."""

LIGHT = 0.2
"""Share of the largest density below which a phase counts as light: a gas beside a liquid."""

_WALL_GAP = 0.25
"""Nearest that a random displacement brings a particle to the wall of a side, in spacings."""


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

    def axis(self, axis: int) -> NDArray[np.float64]:
        """Coordinates of the cell centres along one axis, layers included, m; ascending."""
        before, after = self.layers[axis]
        middle = np.arange(-before, self.count[axis] + after, dtype=np.float64) + 0.5
        return self.lower[axis] + middle * self.spacing[axis]

    def axes(self, domain_only: bool = False) -> list[NDArray[np.float64]]:
        """Coordinates along every axis."""
        cut = self.domain if domain_only else (slice(None),) * self.dimension
        return [self.axis(axis)[cut[axis]] for axis in range(self.dimension)]


@dataclass(eq=False)
class Geometry:
    """All particles at time 0, fluid first, then walls; n rows, d dimensions, float64 unless stated
    otherwise.

    position: (n, d), m
    velocity: (n, d), m/s; walls: the velocity of the wall
    phase: (n,) int32, index into the case's phases; -1 for walls
    kind: (n,) uint8, 0 fluid, 1 wall
    volume: (n,), m^d
    pressure: (n,), Pa, without the background pressure; 0 for walls
    wall_slip: (n,) uint8, 1 on free-slip walls
    boundary_velocity: (n, d), m/s; velocity of the wall, 0 for fluid
    body: (n,) int32, 0 for fluid, k for the k-th wall body
    body_names: name of the k-th wall body at position k - 1: `x_lower`, `y_upper`, ..., then the obstacles
    lattice: the cells that the particles come from; its `lower` and `upper` are where the walls stand
    arrangement: lattice or fitted: what `start.arrangement` came to
    arrangement_reason: why
    warnings: lines of text for the user
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    phase: NDArray[np.int32]
    kind: NDArray[np.uint8]
    volume: NDArray[np.float64]
    pressure: NDArray[np.float64]
    wall_slip: NDArray[np.uint8]
    boundary_velocity: NDArray[np.float64]
    body: NDArray[np.int32]
    body_names: tuple[str, ...]
    lattice: Lattice
    arrangement: str = "lattice"
    arrangement_reason: str = ""
    warnings: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self.kind)

    @property
    def fluid_count(self) -> int:
        """Number of fluid particles; they are the first rows."""
        return int(np.count_nonzero(self.kind == FLUID))

    @property
    def wall_count(self) -> int:
        """Number of wall particles."""
        return self.count - self.fluid_count


Arrange = Callable[[Regions, int], tuple["NDArray[np.float64]", "NDArray[np.float64]"]]
"""What makes a fitted arrangement: from the regions and a seed to the way of each fluid particle from the middle of its
cell (n, d), m, and its volume over that of the cell (n,); particles in the order of their cells."""


def build(case: Case, support: float, unlock: float = 0.0, arrange: Arrange | None = None) -> Geometry:
    """The particles of a case at time 0.

    support: support radius of the smoothing kernel, m; sets the thickness of the walls.
    unlock: least random displacement of the fluid particles as a fraction of the spacing.
    arrange: makes the fitted arrangement where the case has one; without it the particles stay on the lattice.

    Raises CaseError with every problem found: regions that overlap or hold no particle, no fluid at all, a gas beside a
    liquid at an open side or at empty space, a domain thinner than a particle, a periodic axis shorter than the support's
    diameter, start values that are not finite.
    """
    warnings: list[str] = []
    lattice = make_lattice(case, support, warnings)
    problems: list[Problem] = []

    walls = _Walls(case, lattice)
    if case.numerics.scheme != "isph":  # there the sides are mirrors
        walls.add_sides()
    walls.add_obstacles(problems)
    region = _regions(case, lattice, walls.solid_in_domain(), problems)
    if problems:
        raise CaseError(problems)

    phase_index = {name: k for k, name in enumerate(case.phase_names)}
    # The entry appended at the end is what region -1, an empty cell, finds.
    phase_of_region = np.array([*(phase_index[fluid.phase] for fluid in case.fluids), -1], dtype=np.int32)
    problems += _loose_gas(case, lattice, phase_of_region[region], walls.solid_in_domain(), support)
    regions = Regions(lattice, case.periodic, region, walls.solid_in_domain(), phase_of_region, _EntryAt(case))
    arrangement, reason = _arrangement(case, regions)
    if arrangement == "lattice":
        warnings += _off_lattice(case, lattice)
    packed = arrange(regions, case.start.seed) if arrange is not None and arrangement == "fitted" else None
    fluid = _fluid(case, lattice, region, max(case.start.noise, unlock), None if packed is None else packed[0])
    velocity = _start_velocity(case, fluid, problems)
    pressure = None
    if case.start.pressure is not None:
        rest_density = np.array([*(phase.density for phase in case.phases.values()), 0.0])
        density = rest_density[phase_of_region][region]
        pressure = _start_pressure(case, lattice, density, walls.solid_in_domain(), fluid, problems, warnings)
    if problems:
        raise CaseError(problems)

    fluids = len(fluid.position)
    total = fluids + walls.count

    def rows(of_fluid: Any, of_walls: Any, kind: Any, columns: tuple[int, ...] = ()) -> NDArray[Any]:
        array = np.zeros((total, *columns), dtype=kind)
        if of_fluid is not None:
            array[:fluids] = of_fluid
        array[fluids:] = of_walls
        return array

    vector = (lattice.dimension,)
    volume = np.full(total, lattice.cell_volume)
    if packed is not None:
        volume[:fluids] *= packed[1]
    return Geometry(
        position=rows(fluid.position, walls.position, np.float64, vector),
        velocity=rows(velocity, walls.velocity, np.float64, vector),
        phase=rows(phase_of_region[region[fluid.cells]], -1, np.int32),
        kind=rows(None, WALL, np.uint8),
        volume=volume,
        pressure=rows(pressure, 0.0, np.float64),
        wall_slip=rows(None, walls.slip, np.uint8),
        boundary_velocity=rows(None, walls.velocity, np.float64, vector),
        body=rows(None, walls.body, np.int32),
        body_names=tuple(walls.names),
        lattice=lattice,
        arrangement=arrangement,
        arrangement_reason=reason,
        warnings=warnings,
    )


# ------------------------------------------------------------------------------------------------------------
# the lattice


def make_lattice(case: Case, support: float, warnings: list[str] | None = None) -> Lattice:
    """The cells of the case's domain, and of the layers around it if there are walls or obstacles.

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


def _points(axes: Sequence[NDArray[np.float64]], cells: tuple[NDArray[np.intp], ...]) -> NDArray[np.float64]:
    """Centres (n, d) of the cells with the given indices."""
    points = np.empty((len(cells[0]), len(axes)))
    for k, (axis, index) in enumerate(zip(axes, cells, strict=True)):
        points[:, k] = axis[index]
    return points


def _open_grid(axes: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """The axes shaped so that they broadcast to the lattice."""
    d = len(axes)
    return [axis.reshape([-1 if k == j else 1 for j in range(d)]) for k, axis in enumerate(axes)]


def _at(axes: Sequence[NDArray[np.float64]], cell: Sequence[int]) -> str:
    """Text of a cell's centre."""
    return "(" + ", ".join(f"{axis[k]:.6g}" for axis, k in zip(axes, cell, strict=True)) + ")"


def _first(mask: NDArray[np.bool_]) -> list[int]:
    """Index of the first true cell."""
    return [int(k) for k in np.unravel_index(int(np.argmax(mask)), mask.shape)]


# ------------------------------------------------------------------------------------------------------------
# shapes


def inside(shape: Shape, axes: Sequence[NDArray[np.float64]], spacing: float) -> NDArray[np.bool_]:
    """Which sites of a lattice lie in a shape other than `rest`.

    axes: ascending coordinates along each axis, m.
    spacing: particle spacing, m; what is nearer to a border than 1e-6 of it lies on the border.

    Returns one bool a site; its shape is the lengths of the axes. Raises ExpressionError if a condition
    cannot be evaluated.
    """
    size = tuple(len(axis) for axis in axes)
    tiny = _ON_BORDER * spacing
    shifted = [axis + tiny * _BORDER_SHIFT[k] for k, axis in enumerate(axes)]
    if shape.box is not None:
        mask: Any = True
        for x, low, high in zip(_open_grid(shifted), shape.box.lower, shape.box.upper, strict=True):
            mask = mask & ((low <= x) & (x < high))
        return np.array(np.broadcast_to(mask, size))
    if shape.sphere is not None:
        grid = _open_grid(axes)
        square = sum((x - c) ** 2 for x, c in zip(grid, shape.sphere.center, strict=True))
        return np.asarray(square < max(shape.sphere.radius - tiny, 0.0) ** 2)
    if shape.polygon is not None:
        flat = _inside_polygon(shifted[0], shifted[1], np.array(shape.polygon.points, dtype=np.float64))
        return np.array(np.broadcast_to(flat.reshape(flat.shape + (1,) * (len(axes) - 2)), size))
    if shape.where is not None:
        return _values(shape.where.condition, _open_grid(shifted), size) != 0
    raise ValueError("`rest` is no shape of its own")


def contains(shape: Shape, points: NDArray[np.float64], spacing: float) -> NDArray[np.bool_]:
    """Which points (n, d), m, lie in a shape other than `rest`; what lies on a border is decided as by `inside`.

    spacing: particle spacing, m; what is nearer to a border than 1e-6 of it lies on the border.

    Raises ExpressionError if a condition cannot be evaluated.
    """
    tiny = _ON_BORDER * spacing
    shifted = points + tiny * np.array(_BORDER_SHIFT[: points.shape[1]])
    if shape.box is not None:
        return np.all((shape.box.lower <= shifted) & (shifted < np.array(shape.box.upper)), axis=1)
    if shape.sphere is not None:
        square = ((points - np.array(shape.sphere.center)) ** 2).sum(axis=1)
        return np.asarray(square < max(shape.sphere.radius - tiny, 0.0) ** 2)
    if shape.polygon is not None:
        x, y = shifted[:, 0], shifted[:, 1]
        corners = np.array(shape.polygon.points, dtype=np.float64)
        odd = np.zeros(len(points), dtype=np.bool_)
        for (x1, y1), (x2, y2) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if y1 > y2:  # the same edge gives the same numbers from both of its sides
                x1, y1, x2, y2 = x2, y2, x1, y1
            if y1 < y2:
                odd ^= (y1 <= y) & (y < y2) & (x < x1 + (y - y1) * ((x2 - x1) / (y2 - y1)))
        return odd
    if shape.where is not None:
        return _values(shape.where.condition, list(shifted.T), (len(points),)) != 0
    raise ValueError("`rest` is no shape of its own")


def _inside_polygon(
    x: NDArray[np.float64], y: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Even-odd test of all sites (x[i], y[j]) in a closed polygon with the corners `points` (k, 2)."""
    # An edge crosses the rows y[j] of its own height once and changes the side of all sites left of the
    # crossing. Marking where they end and summing the marks from the right, modulo 2, costs one visit per
    # edge and row.
    marks = np.zeros((len(x) + 1, len(y)), dtype=np.bool_)
    for (x1, y1), (x2, y2) in zip(points, np.roll(points, -1, axis=0), strict=True):
        if y1 > y2:  # the same edge gives the same numbers from both of its sides
            x1, y1, x2, y2 = x2, y2, x1, y1
        first, last = np.searchsorted(y, [y1, y2])
        if first < last:
            rows = np.arange(first, last)
            crossing = x1 + (y[rows] - y1) * ((x2 - x1) / (y2 - y1))
            marks[np.searchsorted(x, crossing), rows] ^= True
    return np.logical_xor.accumulate(marks[::-1], axis=0)[-2::-1]


def _values(expression: Expression, coordinates: Sequence[Any], size: tuple[int, ...]) -> NDArray[Any]:
    """Value of an expression at the given coordinates, one array an axis that broadcast to `size`.

    Only the coordinates that occur are handed over: a function of y alone is evaluated once a row.
    Raises ExpressionError.
    """
    named = dict(zip(AXES, coordinates, strict=False))
    if "r" not in expression.names:
        named = {name: value for name, value in named.items() if name in expression.names}
    return np.broadcast_to(expression.evaluate(**named), size)


def _on_sites(shape: Shape, lattice: Lattice) -> list[str]:
    """Names of the axes along which a face of a box runs through the middle of cells of the domain."""
    if shape.box is None:
        return []
    found = []
    for k in range(lattice.dimension):
        for face in (shape.box.lower[k], shape.box.upper[k]):
            place = (face - lattice.lower[k]) / lattice.spacing[k] - 0.5
            if -0.25 < place < lattice.count[k] - 0.75 and abs(place - round(place)) < _ON_BORDER:
                found.append(AXES[k])
    return sorted(set(found))


# ------------------------------------------------------------------------------------------------------------
# walls


class _Walls:
    """The wall particles of a case: first the sides of the domain, then the obstacles."""

    def __init__(self, case: Case, lattice: Lattice) -> None:
        d = lattice.dimension
        self.case = case
        self.lattice = lattice
        self.names: list[str] = []
        self.solid = np.zeros(lattice.shape if case.has_walls else (0,) * d, dtype=np.bool_)
        self.position = np.empty((0, d))
        self.velocity = np.empty((0, d))
        self.slip = np.empty(0, dtype=np.uint8)
        self.body = np.empty(0, dtype=np.int32)

    @property
    def count(self) -> int:
        return len(self.body)

    def solid_in_domain(self) -> NDArray[np.bool_] | None:
        """Which cells of the domain are solid; None if none is."""
        return self.solid[self.lattice.domain] if self.case.obstacles else None

    def add_sides(self) -> None:
        """Fill the layers beyond those sides of the domain that are walls.

        A cell beyond two or three walls at once (edges and corners) obeys the no-slip ones among them, all of
        them if none is no-slip. Each of these walls goes on beyond the edge with its velocity, so that what moves along it
        cancels out in the divergence of the fluid beside it, above and below: along each axis the cell has the mean
        velocity of the walls that can have one, those whose normal is another axis. It is counted to the body of the wall
        that it lies deepest behind.
        """
        lattice, d = self.lattice, self.lattice.dimension
        # per axis, for each layer of cells: how far beyond a wall it is (in layers, 0 if it is not), and
        # which wall
        depth = [np.zeros(n, dtype=np.int32) for n in lattice.shape]
        slips = [np.zeros(n, dtype=np.bool_) for n in lattice.shape]
        speeds = [np.zeros((n, d)) for n in lattice.shape]
        bodies = [np.zeros(n, dtype=np.int32) for n in lattice.shape]
        for k in range(d):
            before, after = lattice.layers[k]
            last = lattice.shape[k] - after
            for end, side, beyond, layer in (
                ("lower", self.case.sides[k].lower, slice(0, before), np.arange(before, 0, -1)),
                ("upper", self.case.sides[k].upper, slice(last, None), np.arange(1, after + 1)),
            ):
                if side.kind != "wall":
                    continue
                self.names.append(f"{AXES[k]}_{end}")
                depth[k][beyond] = layer
                slips[k][beyond] = side.wall == "free_slip"
                speeds[k][beyond] = side.velocity or 0.0
                bodies[k][beyond] = len(self.names)
        if not self.names:
            return
        for k in range(d):
            layers = tuple(slice(None) if j != k else np.flatnonzero(depth[k]) for j in range(d))
            self.solid[layers] = True
        cells = np.nonzero(self.solid)
        behind = np.stack([depth[k][cells[k]] for k in range(d)], axis=1)
        slip = np.stack([slips[k][cells[k]] for k in range(d)], axis=1)
        no_slip = (behind > 0) & ~slip
        any_no_slip = np.asarray(no_slip.any(axis=1))
        decides = np.where(any_no_slip[:, None], no_slip, behind > 0)

        velocity = np.zeros((len(behind), d))
        for axis in range(d):
            others = [k for k in range(d) if k != axis]
            own = sum(np.where(decides[:, k], speeds[k][cells[k]][:, axis], 0.0) for k in others)
            velocity[:, axis] = own / np.maximum(decides[:, others].sum(axis=1), 1)

        deepest = np.argmax(2 * behind + no_slip, axis=1)  # among equals a no-slip wall, then the first axis
        body = np.choose(deepest, [bodies[k][cells[k]] for k in range(d)])
        self._append(cells, velocity, ~any_no_slip, body)

    def add_obstacles(self, problems: list[Problem]) -> None:
        """Make the cells inside obstacles solid; where two overlap, the first has them.

        An obstacle may stick out of an open side as far as the layers reach.
        """
        lattice = self.lattice
        axes = lattice.axes() if self.case.obstacles else []
        for k, obstacle in enumerate(self.case.obstacles):
            path = f"obstacles.{k}.shape"
            try:
                mask = inside(obstacle.shape, axes, self.case.spacing)
            except (ExpressionError, ValueError) as error:
                problems.append(_expression_problem(path, obstacle.shape, error))
                continue
            mask &= ~self.solid
            self.names.append(obstacle.name or f"obstacle_{k + 1}")
            if not mask.any():
                rule = (
                    "holds no particle of its own: it is outside the domain, thinner than particle_spacing "
                    f"({self.case.spacing:g} m) or inside another obstacle"
                )
                problems.append(Problem(path, obstacle.shape.kind, rule, "move or enlarge it, or delete it"))
                continue
            self.solid |= mask
            cells = np.nonzero(mask)
            n = len(cells[0])
            velocity = np.broadcast_to(obstacle.velocity or 0.0, (n, lattice.dimension))
            free = np.full(n, obstacle.wall == "free_slip")
            self._append(cells, velocity, free, np.full(n, len(self.names)))

    def _append(self, cells: tuple[NDArray[np.intp], ...], velocity: Any, slip: Any, body: Any) -> None:
        self.position = np.concatenate([self.position, _points(self.lattice.axes(), cells)])
        self.velocity = np.concatenate([self.velocity, velocity])
        self.slip = np.concatenate([self.slip, slip.astype(np.uint8)])
        self.body = np.concatenate([self.body, body.astype(np.int32)])


# ------------------------------------------------------------------------------------------------------------
# fluid regions


def _expression_problem(path: str, shape: Shape, error: Exception) -> Problem:
    if isinstance(error, ExpressionError):
        return Problem(f"{path}.where.condition", error.text, error.rule_with_column, error.remedy)
    return Problem(path, shape.kind, str(error), "use box, sphere, polygon or where")


def _regions(
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
                problems.append(_expression_problem(path, fluid.shape, error))
                continue
        if solid is not None:
            mask &= ~solid
        clash = mask & (region >= 0)
        if not rest and clash.any():
            cell = _first(clash)
            other = int(region[tuple(cell)])
            both = np.count_nonzero(clash)
            rule = f"overlaps fluids.{other} at {_at(axes, cell)} ({both} particles in both)"
            remedy = "separate the regions, or give one of them the shape rest"
            problems.append(Problem(path, fluid.shape.kind, rule, remedy))
        elif not mask.any():
            why = "the other regions leave nothing of the domain" if rest else "no particle lies in it"
            remedy = "delete this region" if rest else "move or enlarge it, or make particle_spacing smaller"
            rule = f"{why} (particle_spacing: {case.spacing:g})"
            problems.append(Problem(path, fluid.shape.kind, rule, remedy))
        region[mask] = k
    return region


def _loose_gas(
    case: Case, lattice: Lattice, phase: NDArray[np.int32], solid: NDArray[np.bool_] | None, support: float
) -> list[Problem]:
    """A problem for each light phase beside a dense one that an open side or empty space is in reach of.

    Nothing holds the pressure of a gas there: it is torn like a liquid, and what it does to the liquid is nonsense. A
    liquid alone has a free surface there, at which its pressure is zero.

    phase: of each cell of the domain, -1 where there is no fluid
    support: reach of the smoothing kernel, m; it is followed along the axes, and obstacles end it
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
                problems.append(_loose_gas_problem(key, gas, _at(lattice.axes(domain_only=True), _first(touched))))
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


def _off_lattice(case: Case, lattice: Lattice) -> list[str]:
    """A line for each face of a box that a lattice cannot represent."""
    return [
        f"fluids.{k}.shape.box: a face across the {axis} axis runs through the middle of particles, so the "
        "region is half a spacing off there; choose a particle_spacing that puts it between rows"
        for k, fluid in sorted(enumerate(case.fluids), key=lambda item: item[1].shape.kind == "rest")
        for axis in _on_sites(fluid.shape, lattice)
    ]


class _EntryAt:
    """The rule that says which entry of `fluids` holds each of the points (n, d), VOID for none."""

    def __init__(self, case: Case) -> None:
        self.case = case

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        fluids = self.case.fluids
        rest = next((k for k, fluid in enumerate(fluids) if fluid.shape.kind == "rest"), VOID)
        entry = np.full(len(points), rest, dtype=np.int32)
        # the first of two that overlap between the sites of the lattice has the point
        for k in reversed(range(len(fluids))):
            if fluids[k].shape.kind != "rest":
                entry[contains(fluids[k].shape, points, self.case.spacing)] = k
        return entry


def _arrangement(case: Case, regions: Regions) -> tuple[str, str]:
    """What `start.arrangement` comes to, and why."""
    given = case.start.arrangement
    if given != "auto":
        return given, "as given"
    if len(case.phases) < 2:
        return "lattice", "a single phase"
    pairs = fluid_pairs_off_lattice(regions)
    if not pairs:
        return "lattice", "every interface between two phases lies between rows of particles"
    names = case.phase_names
    told = ", ".join(f"{names[a]} and {names[b]}" for a, b in sorted(pairs))
    return "fitted", f"the interface of {told} runs through rows of particles"


# ------------------------------------------------------------------------------------------------------------
# start values


@dataclass
class _Fluid:
    """The fluid particles.

    cells: index of the cell of each particle, one array (n,) an axis
    position: (n, d), m
    shift: (n, d), how far the particle stands from the middle of its cell, m; None if it stands there
    """

    cells: tuple[NDArray[np.intp], ...]
    position: NDArray[np.float64]
    shift: NDArray[np.float64] | None


def _fluid(
    case: Case, lattice: Lattice, region: NDArray[np.int32], noise: float, way: NDArray[np.float64] | None
) -> _Fluid:
    """A particle in the middle of every cell that belongs to a region, displaced by `way` (n, d), m, and by `noise`."""
    cells = np.nonzero(region >= 0)
    sites = _points(lattice.axes(domain_only=True), cells)
    if not noise and way is None:
        return _Fluid(cells, sites, None)
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
    return _Fluid(cells, position, shift)


def _start_velocity(case: Case, fluid: _Fluid, problems: list[Problem]) -> NDArray[np.float64]:
    """Velocity (n, d) of fluid particles, m/s."""
    velocity = np.zeros_like(fluid.position)
    for k, expression in enumerate(case.start.velocity):
        try:
            velocity[:, k] = _values(expression, list(fluid.position.T), (len(velocity),))
        except ExpressionError as error:
            problems.append(Problem(f"start.velocity.{k}", error.text, error.rule_with_column, error.remedy))
    return velocity


def _start_pressure(
    case: Case,
    lattice: Lattice,
    density: NDArray[np.float64],
    solid: NDArray[np.bool_] | None,
    fluid: _Fluid,
    problems: list[Problem],
    warnings: list[str],
) -> NDArray[np.float64] | None:
    """Pressure (n,) of fluid particles without the background, Pa; None stands for zero.

    density: of every cell of the domain, 0 where there is no fluid, kg/m^3.
    """
    start = case.start.pressure
    if start is None:
        return None
    if not isinstance(start, str):
        try:
            return _values(start, list(fluid.position.T), (len(fluid.position),))
        except ExpressionError as error:
            problems.append(Problem("start.pressure", error.text, error.rule_with_column, error.remedy))
            return None
    gravity = np.array(case.gravity, dtype=np.float64)
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


def hydrostatic_pressure(
    density: NDArray[np.float64], solid: NDArray[np.bool_] | None, axis: int, gravity: float, spacing: float
) -> NDArray[np.float64]:
    """Pressure at rest in the middle of each cell of a lattice, Pa, summed from the top of each column.

    density: of each cell, any number of dimensions, 0 where it is empty, kg/m^3
    solid: cells of obstacles, of the same shape, or None. They count as filled with what is beside them at
    the same
        level, so that the fluid below an obstacle has the pressure of its surroundings.
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
