"""Inlets and outlets of a scene: their sites, what is given there, and the particles that fill their buffers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.domain import AXES
from warpsph.errors import CaseError, ExpressionError, Problem
from warpsph.scene.masks import values_at
from warpsph.scene.narrow import pieces

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.case.open_sides import OpenSide
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.lattice import Lattice

MOST_SAMPLES = 1 << 20
"""Samples of a signal; beyond them the time between two grows."""


def open_sides(case: Case) -> Iterator[tuple[str, int, int, OpenSide]]:
    """Yield (name such as x_lower, axis, 0 for the lower and 1 for the upper side, what it is) of inlets and outlets."""
    for axis, sides in enumerate(case.sides):
        for end, (name, side) in enumerate((("lower", sides.lower), ("upper", sides.upper))):
            if side.flow is not None:
                yield f"{AXES[axis]}_{name}", axis, end, side.flow


def open_axis(case: Case) -> int:
    """Return the axis whose sides are inlets or outlets; -1 if there is none."""
    return next((axis for _, axis, _, _ in open_sides(case)), -1)


@dataclass(eq=False)
class Face:
    """An inlet or outlet; m sites, d dimensions.

    name: such as x_lower
    axis, end: of the domain; end is 0 for the lower side
    flow: what the case says of it
    across: the transverse axes, the first one fastest among the sites; of those that a dimension lacks the own one
    count: sites along each of them
    position: (m, d), m, on the side
    velocity: (m, d) given velocity, m/s, zero where the pressure is given
    pressure: (m,) given pressure, Pa, zero where the velocity is given
    sponge_velocity: (m, d) velocity that a sponge draws the flow to, m/s
    free: (m,) whether there is fluid on the inner side
    layers: of buffer particles
    """

    name: str
    axis: int
    end: int
    flow: OpenSide
    across: tuple[int, int]
    count: tuple[int, int]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    pressure: NDArray[np.float64]
    sponge_velocity: NDArray[np.float64]
    free: NDArray[np.bool_]
    layers: int

    @property
    def outward(self) -> int:
        """1 at the upper side, -1 at the lower."""
        return 1 if self.end else -1

    @property
    def gives_velocity(self) -> bool:
        """Whether the velocity is given, else the pressure."""
        return self.flow.given_velocity is not None


def buffer_layers(support: float, skin: float, spacing: float) -> int:
    """Return how many layers a buffer needs.

    A particle at the side sees a support of it. Until a new list is asked for whatever the flow it moves by a quarter of the
    radius of the list, and up to one layer more is missing between two births.
    """
    return math.ceil((support + 0.25 * support * (1.0 + skin)) / spacing + 1.0)


def wet_cells(geometry: Geometry) -> NDArray[np.bool_]:
    """Return which cells of the domain hold a fluid particle at the start."""
    lattice = geometry.lattice
    fluid = geometry.position[geometry.kind == 0]
    index = np.floor((fluid - np.array(lattice.lower)) / np.array(lattice.spacing)).astype(int)
    wet = np.zeros(lattice.count, dtype=np.bool_)
    wet[tuple(np.clip(index[:, k], 0, lattice.count[k] - 1) for k in range(lattice.dimension))] = True
    return wet


def beside(cells: NDArray[Any], axis: int, end: int) -> NDArray[Any]:
    """Return what cells of the domain have next to a side, the first transverse axis fastest."""
    return np.asarray(np.take(cells, -1 if end else 0, axis).T.ravel())


def make_faces(case: Case, geometry: Geometry, support: float, skin: float) -> list[Face]:
    """Return the inlets and outlets of a case whose particles are known.

    support: support radius, m; skin: of the neighbour list, as share of it

    Raises CaseError where a profile has no finite value.
    """
    problems: list[Problem] = []
    lattice, wet = geometry.lattice, wet_cells(geometry)
    faces = []
    for name, axis, end, flow in open_sides(case):
        others = [k for k in range(lattice.dimension) if k != axis]
        axes = [lattice.axes(domain_only=True)[k] for k in others]
        grid = np.meshgrid(*reversed(axes), indexing="ij")[::-1]  # the first transverse axis runs fastest
        position = np.empty((grid[0].size, lattice.dimension))
        for k, values in zip(others, grid, strict=True):
            position[:, k] = values.ravel()
        position[:, axis] = (lattice.lower, lattice.upper)[end][axis]
        free = beside(wet, axis, end)
        path = f"domain.boundary.{AXES[axis]}.{('lower', 'upper')[end]}.{flow.word}"
        velocity, pressure, drawn = _given(flow, position, path, problems)
        count = [*(len(values) for values in axes), 1][:2]
        across = [*others, axis][:2]
        layers = buffer_layers(support, skin, lattice.spacing[axis])
        sites = (across[0], across[1]), (count[0], count[1])
        faces.append(Face(name, axis, end, flow, *sites, position, velocity, pressure, drawn, free, layers))
    if problems:
        raise CaseError(problems)
    return faces


def _given(flow: OpenSide, position: NDArray[np.float64], path: str, problems: list[Problem]) -> Any:
    """Velocity (m, d), pressure (m,) and velocity of the sponge (m, d) given at the sites."""
    velocity, pressure, drawn = np.zeros_like(position), np.zeros(len(position)), np.zeros_like(position)
    places = list(position.T)
    in_sponge = None if flow.sponge is None else flow.sponge.velocity or flow.given_velocity
    try:
        for k, formula in enumerate(flow.given_velocity or ()):
            velocity[:, k] = values_at(formula, places, (len(position),))
        for k, formula in enumerate(in_sponge or ()):
            drawn[:, k] = values_at(formula, places, (len(position),))
        if flow.given_pressure is not None:
            pressure[:] = values_at(flow.given_pressure, places, (len(position),))
    except ExpressionError as error:
        problems.append(Problem(path, error.text, error.rule_with_column, error.remedy))
    return velocity, pressure, drawn


def fill_sites(faces: list[Face], lattice: Lattice) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Return places (n, d), m, and number of the face (n,) of the particles that fill the buffers."""
    places, numbers = [np.empty((0, lattice.dimension))], [np.empty(0, dtype=np.int8)]
    for number, face in enumerate(faces):
        for layer in range(face.layers):
            rows = face.position[face.free].copy()
            rows[:, face.axis] += face.outward * (layer + 0.5) * lattice.spacing[face.axis]
            places.append(rows)
            numbers.append(np.full(len(rows), number, dtype=np.int8))
    return np.concatenate(places), np.concatenate(numbers)


def factors_of(face: Face, times: NDArray[Any]) -> NDArray[np.float64]:
    """Return the factor on what is given at a face at times [s], (n,). Raises CaseError where it is not finite."""
    try:
        return face.flow.factor(times)
    except ExpressionError as error:
        path = f"domain.boundary.{AXES[face.axis]}.{('lower', 'upper')[face.end]}.{face.flow.word}.ramp"
        raise CaseError([Problem(path, error.text, error.rule_with_column, error.remedy)]) from None


def given_scales(case: Case, geometry: Geometry) -> tuple[float, float, float]:
    """Return (largest speed [m/s], largest pressure given [Pa], speed that given pressures may drive [m/s]).

    The first is the largest one given, or what the flow through a side makes in the narrowest section between bodies. A
    difference of pressure drives sqrt(2 dp/rho) at most, or in a viscous channel dp/L H^2/(8 mu), H its smallest width.

    Raises CaseError where a given velocity leads into a dead end.
    """
    lattice = geometry.lattice
    faces = make_faces(case, geometry, 0.0, 0.0)
    check_dead_ends(case, geometry, faces)
    times = np.linspace(0.0, case.end_time, 1001)
    speed, pressures = 0.0, []
    through = {face.end: 0.0 for face in faces}  # of one side, in sites times a speed
    for face in faces:
        factors = factors_of(face, times)
        if face.gives_velocity:
            through[face.end] += float(np.abs(face.velocity[face.free, face.axis]).sum() * np.abs(factors).max())
        speed = max(speed, float(np.linalg.norm(face.velocity[face.free], axis=1).max(initial=0.0) * np.abs(factors).max()))
        if not face.gives_velocity:
            ends = np.outer((face.pressure.min(), face.pressure.max()), (factors.min(), factors.max()))
            pressures += [float(ends.min()), float(ends.max())]
    speed = max(speed, max(through.values(), default=0.0) / _narrowest(case, geometry, faces[0].axis))
    if len({face.end for face in faces if not face.gives_velocity}) < 2:
        return speed, max(map(abs, pressures), default=0.0), 0.0
    drop = max(pressures) - min(pressures)
    light = min(phase.density for phase in case.phases.values())
    driven = math.sqrt(2.0 * drop / light)
    thin = min((phase.viscosity for phase in case.phases.values()), default=0.0)
    widths = [high - low for k, (low, high) in enumerate(zip(lattice.lower, lattice.upper, strict=True))
              if case.sides[k].lower.wall == "no_slip" and case.sides[k].upper.wall == "no_slip"]  # fmt: skip
    if thin > 0 and widths:
        axis = faces[0].axis
        driven = min(driven, drop / (lattice.upper[axis] - lattice.lower[axis]) * min(widths) ** 2 / (8.0 * thin))
    return speed, max(map(abs, pressures)), driven


def check_dead_ends(case: Case, geometry: Geometry, faces: list[Face]) -> None:
    """Raise CaseError where a velocity is given at the only inlet or outlet of the fluid behind it: it has nowhere to go."""
    piece = pieces(wet_cells(geometry), case.periodic)
    reached = {face.name: set(np.unique(beside(piece, face.axis, face.end))) - {0} for face in faces}
    problems = []
    for face in faces:
        others = set().union(*[found for name, found in reached.items() if name != face.name])
        through = np.isin(beside(piece, face.axis, face.end), list(reached[face.name] - others))
        if face.gives_velocity and face.velocity[through, face.axis].any():
            path = f"domain.boundary.{AXES[face.axis]}.{('lower', 'upper')[face.end]}.{face.flow.word}"
            rule = "leads into a dead end: the fluid behind it reaches no other inlet or outlet"
            given = [part.text for part in face.flow.given_velocity or ()]
            problems.append(Problem(f"{path}.velocity", given, rule, "leave a way to an outlet"))
    if problems:
        raise CaseError(problems)


def _narrowest(case: Case, geometry: Geometry, axis: int) -> int:
    """Return the number of fluid particles in the thinnest slice across an axis that has any, one spacing thick."""
    along = geometry.position[geometry.kind == 0, axis] - geometry.lattice.lower[axis]
    counts = np.bincount(np.maximum(np.floor(along / case.spacing).astype(int), 0))
    return int(counts[counts > 0].min())


def signal_samples(faces: list[Face], end_time: float, step: float) -> tuple[list[NDArray[np.float64]], float]:
    """Return samples of the factor in time of each face, and the time between two [s].

    step: time that a signal may be taken as linear in, s. It does not depend on the end of the run, so that a run that goes
    on for longer sees the same signal, unless that would take more than MOST_SAMPLES.
    """
    step = max(step, end_time / MOST_SAMPLES)
    times = np.arange(math.ceil(end_time / step) + 2) * step
    return [factors_of(face, times[:1] if face.flow.steady else times) for face in faces], step
