"""From a validated case to particles: a lattice of sites, cut by the shapes of the case, on NumPy arrays.

The domain is divided into cells of one particle spacing; each particle starts in the middle of a cell. One
pass over this lattice decides what every cell holds:

1. walls: where a side of the domain is a wall, the lattice continues beyond it for as many layers as the
   smoothing kernel reaches, corners included;
2. bodies: their surfaces are sampled whatever the lattice is, and
   cells nearer to one than half a spacing hold no fluid;
3. fluids: each remaining cell of the domain gets the phase of the region that contains it, or stays empty; what rounding
   leaves empty beside bodies and walls gets the fluid beside it.

Where an interface between two phases runs through lattice cells, the start is a *fitted* one (`start.arrangement`): it
has the particles of the lattice, but whoever wants it gives `build` a function that arranges them along the interface
(`warpsph/scene/packing.py`). Without one, `build` stops at the lattice, which is enough for counts, walls and physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import CaseError, Problem
from warpsph.scene.body_surfaces import SAME
from warpsph.scene.borders import Regions
from warpsph.scene.cut_cells import cut_places
from warpsph.scene.equal_masses import equal_masses
from warpsph.scene.fluid_regions import EntryAt, chosen_arrangement, fluid_regions, loose_gas, off_lattice
from warpsph.scene.lattice import Lattice, make_lattice
from warpsph.scene.narrow import narrow_places
from warpsph.scene.rounded_volume import rounded_volumes
from warpsph.scene.slivers import find_slivers
from warpsph.scene.start_fluid import automatic_pressure, fluid_particles, start_density, start_pressure, start_velocity
from warpsph.scene.surfaces import Repeated
from warpsph.scene.wall_cells import Surroundings, WallCells

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.scene.surfaces import Surface


__all__ = ["FLUID", "WALL", "Arrange", "Geometry", "build"]

FLUID, WALL = 0, 1


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
    density: (fluid,), kg/m^3, where `start.density` gives it; None: that of the phases
    wall_slip: (n,) uint8, 1 on free-slip walls
    wall_sides: (n,) uint8, the sides whose velocity a wall particle has: bit 2 axis the lower, 2 axis + 1 the upper one
    boundary_velocity: (n, d), m/s; velocity of the wall, 0 for fluid
    body: (n,) int32, 0 for fluid, k for the k-th wall body
    body_names: name of the k-th wall body at position k - 1: `x_lower`, `y_upper`, ..., then the bodies
    blocked: number of cells of the domain that hold no fluid because of bodies
    cut: names of the bodies whose surface cuts cells of the lattice
    stout: whether no body has a thin tail, nor would have one if it went on into the wall that it ends on
    at_open_side: whether a cell that no body takes lies at an open side of the domain
    shapes: surfaces of the bodies, in their order
    surface: where the surface of the walls is, seen from each wall particle; None where no wall has one
    lattice: the cells that the particles come from; its `lower` and `upper` are where the walls stand
    arrangement: lattice or fitted: what `start.arrangement` came to
    arrangement_reason: why
    loaded: what `start.pressure` came to where it is auto: hydrostatic or none; else empty
    warnings: lines of text for the user
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    phase: NDArray[np.int32]
    kind: NDArray[np.uint8]
    volume: NDArray[np.float64]
    pressure: NDArray[np.float64]
    wall_slip: NDArray[np.uint8]
    wall_sides: NDArray[np.uint8]
    boundary_velocity: NDArray[np.float64]
    body: NDArray[np.int32]
    body_names: tuple[str, ...]
    blocked: int
    cut: tuple[str, ...]
    stout: bool
    at_open_side: bool
    shapes: tuple[Surface, ...]
    surface: Surroundings | None
    lattice: Lattice
    arrangement: str = "lattice"
    arrangement_reason: str = ""
    loaded: str = ""
    warnings: list[str] = field(default_factory=list)
    density: NDArray[np.float64] | None = None

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

    walls = WallCells(case, lattice)
    if not case.scheme.mirrors_sides:
        walls.add_sides()
    walls.add_bodies(support, problems, warnings)
    covered = walls.covered(0.0)[lattice.domain] if case.bodies else None
    region = fluid_regions(case, lattice, covered, problems)
    if problems:
        raise CaseError(problems)

    surfaces = [solid.surface for solid in walls.solids]
    entry_at = EntryAt(case, surfaces)
    slivers = find_slivers(case, lattice, region, covered, support, entry_at)
    warnings += slivers.lines(lattice)
    region = slivers.region
    phase_index = {name: k for k, name in enumerate(case.phase_names)}
    # The entry appended at the end is what region -1, an empty cell, finds.
    phase_of_region = np.array([*(phase_index[fluid.phase] for fluid in case.fluids), -1], dtype=np.int32)
    problems += loose_gas(case, lattice, phase_of_region[region], covered, support)
    warnings += narrow_places(case, lattice, region, phase_of_region, covered, support)
    boundary = np.concatenate([solid.filling for solid in walls.solids]) if walls.solids else None
    entries = slivers.filled(entry_at, lattice)
    regions = Regions(lattice, case.periodic, region, phase_of_region, entries, covered, boundary)
    cut = [name for name, solid in zip(case.bodies, walls.solids, strict=True) if not solid.on_lattice(case.spacing)]
    arrangement, reason = chosen_arrangement(case, regions, cut)
    if arrangement == "lattice":
        warnings += off_lattice(case, lattice)
        if cut:
            covered = walls.covered(0.5 * case.spacing * (1.0 - SAME))[lattice.domain]
            region = np.where(covered, np.int32(-1), region)
    packed = arrange(regions, case.start.seed) if arrange is not None and arrangement == "fitted" else None
    if packed is None and cut and covered is not None:
        distances = [solid.surface.signed_distance for solid in walls.solids]
        packed = cut_places(lattice, case.periodic, region >= 0, covered, distances)
    fluid = fluid_particles(case, lattice, region, max(case.start.noise, unlock), None if packed is None else packed[0])
    crowded = equal_masses(case, lattice, fluid, problems) if arrangement == "equal_mass" else None
    velocity = start_velocity(case, fluid, problems)
    varying = start_density(case, fluid, problems)
    blocked = 0 if covered is None else int(np.count_nonzero(covered))
    open_side = _at_open_side(case, np.ones(lattice.count, np.bool_) if covered is None else ~covered)
    filled = not open_side and len(fluid.position) + blocked >= math.prod(lattice.count)
    pressure = None
    loaded = automatic_pressure(case, filled) or "none" if case.start.pressure == "auto" else ""
    if case.start.pressure is not None:
        rest_density = np.array([*(phase.density for phase in case.phases.values()), 0.0])
        density = rest_density[phase_of_region][region]
        pressure = start_pressure(case, lattice, density, covered, fluid, filled, problems, warnings)
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
    if crowded is not None:
        volume[:fluids] *= crowded
    if arrangement == "lattice":
        of_region = np.bincount(region[fluid.cells], weights=volume[:fluids], minlength=len(case.fluids))
        warnings += rounded_volumes(case, regions, np.asarray(of_region, np.float64))
    continued = case.scheme.continues_sides and walls.count > 0
    surface = walls.surface() if case.bodies or continued else None
    if surface is not None:
        volume[fluids:] = surface.volume
    return Geometry(
        position=rows(fluid.position, walls.position, np.float64, vector),
        velocity=rows(velocity, walls.velocity, np.float64, vector),
        phase=rows(phase_of_region[region[fluid.cells]], -1, np.int32),
        kind=rows(None, WALL, np.uint8),
        volume=volume,
        pressure=rows(pressure, 0.0, np.float64),
        wall_slip=rows(None, walls.slip, np.uint8),
        wall_sides=rows(None, walls.sides, np.uint8),
        boundary_velocity=rows(None, walls.velocity, np.float64, vector),
        body=rows(None, walls.body, np.int32),
        body_names=tuple(walls.names),
        blocked=blocked,
        cut=tuple(cut),
        stout=all(solid.stout for solid in walls.solids),
        at_open_side=open_side,
        shapes=tuple(found.shape if isinstance(found, Repeated) else found for found in surfaces),
        surface=surface,
        lattice=lattice,
        arrangement=arrangement,
        arrangement_reason=reason,
        loaded=loaded,
        warnings=warnings,
        density=varying,
    )


def _at_open_side(case: Case, free: NDArray[np.bool_]) -> bool:
    """Whether a free cell of the domain lies at an open side; a hollow body may close a domain whose sides are open."""
    for axis, sides in enumerate(case.sides):
        cells = np.moveaxis(free, axis, 0)
        for side, rim in ((sides.lower, cells[0]), (sides.upper, cells[-1])):
            if side.kind == "open" and rim.any():
                return True
    return False
