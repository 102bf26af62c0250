"""The bodies of a case: their surfaces, the cells of the lattice that they take, and their boundary particles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpsph.errors import ExpressionError, Problem
from warpsph.scene.airfoils import airfoil, naca_4, read_section
from warpsph.scene.body_sampling import Sampling, layers_of, sample
from warpsph.scene.fluid_regions import expression_problem
from warpsph.scene.lattice import Lattice
from warpsph.scene.roots import Footing, gap_of, joined, moved, rooted
from warpsph.scene.surfaces import Ball, Hollow, Outline, Repeated, ShapeError, Surface, box_surface
from warpsph.scene.thinness import REFUSED, WARNED, ThinPlaces, thin_places
from warpsph.scene.traced import trace_expression

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from warpsph.case.bodies import Body
    from warpsph.case.case import Case

__all__ = ["Solid", "make_solids", "surface_of"]

SAME = 1e-6
"""Share of a spacing up to which two distances are the same."""

OFF_LATTICE = 0.02
"""A surface nearer than this to faces of lattice cells, in spacings, counts as represented by them; as for interfaces."""


@dataclass(eq=False)
class Solid:
    """A body in a lattice.

    surface: in place
    sampling: its boundary particles
    filling: (m, d), particles that fill its layers once, m: fluid is arranged beside them
    distance: of the middle of each cell of the lattice from the surface, m, negative in the body; infinite two spacings and
        more beyond the box around the shape
    stout: it has no thin tail, nor would have one if it went on into the wall that it ends on, and is no mirror of cells
        between inlets
    """

    surface: Surface
    sampling: Sampling
    filling: NDArray[np.float64]
    distance: NDArray[np.float64]
    stout: bool

    def on_lattice(self, spacing: float) -> bool:
        """Whether the surface runs between cells of the lattice wherever it is."""
        return _on_lattice(self.distance, spacing)


def _on_lattice(distance: NDArray[np.float64], spacing: float) -> bool:
    return not bool((np.abs(distance) < (0.5 - OFF_LATTICE) * spacing).any())


def surface_of(
    case: Case, body: Body, low: NDArray[np.float64], high: NDArray[np.float64], walls: Sequence[Footing] = ()
) -> Surface:
    """The surface of a body at rest.

    low, high: corners of the space in which a condition is looked at, m.
    walls: of the domain, into which the body that a condition describes goes on.

    Raises ShapeError if the shape has none, ExpressionError if a condition cannot be evaluated.
    """
    shape = body.shape
    found: Surface
    if shape.sphere is not None:
        found = Ball(shape.sphere.center, shape.sphere.radius)
    elif shape.box is not None:
        found = box_surface(shape.box.lower, shape.box.upper)
    elif shape.polygon is not None:
        found = Outline.of_corners(shape.polygon.points)
    elif shape.airfoil is not None:
        wing = shape.airfoil
        if wing.naca is not None:
            section = naca_4(wing.naca, wing.closed)
        else:
            section = read_section(case.reference_file(str(wing.file)))
        found = airfoil(section, wing.chord, wing.angle, wing.pivot, wing.position)
    elif shape.stl is not None:
        from warpsph.scene.meshes import read_stl

        found = read_stl(case.reference_file(shape.stl.file), shape.stl.scale, shape.stl.translate)
    elif shape.where is not None:
        beyond = np.zeros((2, len(low)))
        for wall in walls:
            beyond[(wall.way + 1) // 2, wall.axis] = wall.reach
        found = trace_expression(shape.where.condition, low.tolist(), high.tolist(), case.spacing, beyond)
    else:
        raise ShapeError("is for fluids only")
    return Hollow(found) if body.hollow else found


def footings(case: Case, body: Body, lattice: Lattice, support: float) -> list[Footing]:
    """The walls of the domain that a body at rest, or one that moves along them, may stand on.

    A gap of less than a spacing holds no particle. A body on a wall goes on twice as deep as the smoothing kernel reaches.

    support: reach of the smoothing kernel, m.
    """
    found = []
    for k, sides in enumerate(case.sides):
        if body.hollow or (body.motion is not None and not body.motion.keeps(k)):
            continue
        for side, way, plane in ((sides.lower, -1, lattice.lower[k]), (sides.upper, 1, lattice.upper[k])):
            if side.kind == "wall":
                found.append(Footing(k, way, plane, lattice.spacing[k], 2.0 * support))
    return found


def _standing(
    path: str, surface: Surface, walls: list[Footing], case: Case, warnings: list[str]
) -> Surface:
    """The surface of a body, gone on into the walls that it stands on; gaps that this closes are warned of."""
    for wall in walls:
        asked = (case.domain.lower if wall.way < 0 else case.domain.upper)[wall.axis]
        gap = gap_of(surface, replace(wall, plane=asked))
        if gap > SAME * case.spacing:
            warnings.append(
                f"{path} ends {gap:.3g} m before the wall at {'xyz'[wall.axis]} = {asked:g}, less than a particle takes: "
                "it goes on into the wall"
            )
        surface = rooted(surface, wall)
    return surface


def with_images(sampling: Sampling, body: Body, case: Case, lattice: Lattice, support: float) -> Sampling:
    """The boundary particles of a body and their images beyond the sides of the domain that mirror the fluid.

    Beside a body that ends on such a side the images of the fluid would leave its place free beyond the side. An image has
    no area and the leader of its particle. It moves as its particle does: a body that moves has images beyond those sides
    along which it slides, and none beyond others.

    support: reach of the smoothing kernel, m; the images are as deep.
    """
    for k, sides in enumerate(case.sides):
        if body.motion is not None and not body.motion.keeps(k):
            continue
        for side, plane in ((sides.lower, lattice.lower[k]), (sides.upper, lattice.upper[k])):
            near = np.flatnonzero(np.abs(sampling.position[:, k] - plane) < support)
            if side.kind == "wall" and len(near):
                sampling = sampling.reflected(near, k, plane)
    return sampling


def goes_on(case: Case, body: Body, surface: Surface, lattice: Lattice) -> NDArray[np.bool_]:
    """Along which axes (d,) a body goes on at the other side of the domain: periodic ones that are longer than it is.

    Along a longer one, and what a condition describes, it ends with the domain, whose other side goes on with it.
    """
    lower, upper = np.array(lattice.lower), np.array(lattice.upper)
    period = upper - lower
    if body.hollow or body.shape.where is not None:
        return np.zeros(len(period), dtype=np.bool_)
    start, end = surface.bounds
    shorter = end - start < period - np.array(lattice.spacing)
    return np.asarray(case.periodic) & shorter & (start > lower - period) & (end < upper + period)


def of_cells(case: Case, surfaces: Iterable[Surface], lattice: Lattice) -> bool:
    """Whether no body of a case moves or cuts cells of the lattice."""
    still = all(body.motion is None for body in case.bodies.values())
    return still and all(_on_lattice(_cell_distance(surface, lattice), case.spacing) for surface in surfaces)


def repeated(surface: Surface, on: NDArray[np.bool_], lattice: Lattice, near: float) -> Surface:
    """The surface with those of its images along the axes `on` that come nearer than `near`, m, to the domain."""
    shifts = _shifts(surface, on, lattice, near)
    return Repeated(surface, shifts) if len(shifts) > 1 else surface


def _shifts(surface: Surface, on: NDArray[np.bool_], lattice: Lattice, near: float) -> NDArray[np.float64]:
    """Where such images are, (m, d), m; the first is the surface itself, 0."""
    lower, upper = np.array(lattice.lower), np.array(lattice.upper)
    steps = np.stack(np.meshgrid(*[(0, -1, 1) if axis else (0,) for axis in on], indexing="ij"), axis=-1)
    shifts = steps.reshape(-1, len(on)) * (upper - lower)
    start, end = surface.bounds[0] + shifts, surface.bounds[1] + shifts
    there = np.all((end > lower - near) & (start < upper + near), axis=1)
    there[0] = True
    return shifts[there]


def _images(body: Body, surface: Surface, case: Case, lattice: Lattice, near: float) -> list[Surface]:
    """A body, and of kinds that `joined` joins those of its images that come nearer than `near`, m, to the domain."""
    shifts = _shifts(surface, goes_on(case, body, surface, lattice), lattice, near)
    images = (moved(surface, shift) for shift in shifts[1:])
    return [surface, *(image for image in images if image is not None)]


def make_solids(
    case: Case, lattice: Lattice, support: float, problems: list[Problem], warnings: list[str]
) -> list[Solid]:
    """The bodies of a case, in their order; where two overlap, the first has the particles.

    support: reach of the smoothing kernel, m; the layers of boundary particles are as deep, and as far a body sticks out of
        an open side of the domain, an inlet or an outlet. It ends with the domain at other sides.
    warnings: what the user should know is added.
    """
    spacing = case.spacing
    layers = math.ceil(support / spacing - 1e-9)
    beyond = np.array(
        [[layers * s * (side.kind in ("open", "inlet", "outlet")) for side in (sides.lower, sides.upper)]
         for sides, s in zip(case.sides, lattice.spacing, strict=True)]
    )  # fmt: skip
    low, high = np.array(lattice.lower) - beyond[:, 0], np.array(lattice.upper) + beyond[:, 1]
    solids: list[Solid] = []
    surfaces = _surfaces(case, lattice, support, low, high, problems, warnings)
    cells = case.scheme.mirrors_sides and case.has_flow_through and of_cells(case, surfaces.values(), lattice)
    images = {name: _images(case.bodies[name], one, case, lattice, 2.0 * support) for name, one in surfaces.items()}
    for name, surface in surfaces.items():
        path, body = f"bodies.{name}.shape", case.bodies[name]
        thin = _too_thin(path, body, thin_places(surface, spacing, layers), spacing, warnings)
        if thin is not None:
            problems.append(thin)
            continue
        beside = [image for k in surfaces if k != name and case.bodies[k].motion == body.motion for image in images[k]]
        whole = joined(surface, beside, 2.0 * support)
        on = goes_on(case, body, surface, lattice)
        first, last = np.where(on, -np.inf, low).tolist(), np.where(on, np.inf, high).tolist()
        sampling = sample(whole, spacing, layers, first, last, case.scheme.mean_edges)
        stout = not sampling.sheet.any()
        if case.scheme.mirrors_sides and (cells or not stout):
            # a tail that stands on a mirror would need lines of sight to its images; cells between inlets mirror the fluid
            stout = False
            surface = whole = surface_of(case, body, low, high)
            sampling = sample(surface, spacing, layers, first, last, case.scheme.mean_edges)
        if whole is not surface:
            sampling = sampling.only(surface.signed_distance(sampling.position) <= SAME * spacing)
        surface = repeated(surface, on, lattice, 2.0 * spacing)
        inside, places = np.zeros(sampling.count, dtype=np.bool_), lattice.within(sampling.position, on)
        for other in solids:
            inside |= other.surface.signed_distance(places) <= SAME * spacing
        sampling = sampling.only(~inside)
        distance = _cell_distance(surface, lattice)
        if sampling.count == 0:
            rule = f"holds no particle of its own: it is outside the domain or inside another body (spacing {spacing:g} m)"
            if any(case.periodic):
                rule += ", which periodic sides repeat"
            if (distance < 0.0).all():
                rule = "leaves no room for fluid: it fills the whole domain"
            problems.append(Problem(path, body.shape.kind, rule, "move or enlarge it, or delete it"))
            continue
        filling = sampling.position
        if sampling.sheet.any():
            filling = layers_of(surface.shape if isinstance(surface, Repeated) else surface, spacing, layers).position
        filling = lattice.within(filling, on)
        if case.scheme.mirrors_sides and stout:
            sampling = with_images(sampling, body, case, lattice, support)
        solids.append(Solid(surface, sampling, filling, distance, stout))
    return solids


def _surfaces(
    case: Case,
    lattice: Lattice,
    support: float,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    problems: list[Problem],
    warnings: list[str],
) -> dict[str, Surface]:
    """The surfaces of the bodies of a case by their names, gone on into walls; of those that have none a problem."""
    found = {}
    for name, body in case.bodies.items():
        path = f"bodies.{name}.shape"
        try:
            walls = footings(case, body, lattice, support)
            found[name] = _standing(path, surface_of(case, body, low, high, walls), walls, case, warnings)
        except ExpressionError as error:
            problems.append(expression_problem(path, body.shape, error))
        except ShapeError as error:
            kind = body.shape.kind
            problems.append(Problem(f"{path}.{kind}", kind, error.rule, error.remedy))
    return found


def _too_thin(
    path: str, body: Body, found: ThinPlaces, spacing: float, warnings: list[str]
) -> Problem | None:
    """The problem of a body that is too thin; what is only thin becomes a warning."""
    at = ", ".join(f"{x:g}" for x in found.place)
    told = f"is {found.thickness:.3g} m thick at ({at}), {found.thickness / spacing:.2g} spacings"
    if found.refused > spacing ** (len(found.place) - 1):
        remedy = f"make particle_spacing smaller than {found.thickness:.3g} m, or the body thicker"
        return Problem(path, body.shape.kind, f"{told}: it has to be {REFUSED:g} or more", remedy)
    if found.warned > 0.0:
        warnings.append(f"{path} {told}: below {WARNED:g} the fluid on one side feels that on the other")
    return None


def _cell_distance(surface: Surface, lattice: Lattice) -> NDArray[np.float64]:
    """Signed distance of the middle of each cell; cells two spacings and more outside the box around the shape have
    +-inf."""
    far = 2.0 * max(lattice.spacing)
    axes = lattice.axes()
    cut = tuple(
        slice(*np.searchsorted(axis, (surface.bounds[0, k] - far, surface.bounds[1, k] + far)))
        for k, axis in enumerate(axes)
    )
    distance = np.full(lattice.shape, -np.inf if surface.hollow else np.inf)
    grid = np.meshgrid(*(axis[part] for axis, part in zip(axes, cut, strict=True)), indexing="ij")
    points = np.stack(grid, axis=-1)
    distance[cut] = surface.signed_distance(points.reshape(-1, lattice.dimension)).reshape(points.shape[:-1])
    return distance
