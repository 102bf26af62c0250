"""What a scene takes of memory, told from its case alone before anything is made.

A count of particles comes from arithmetic: cells of the domain, layers of wall particles, and the share of the cells that
the shapes of the case fill, looked at in some ten thousand of them. It costs milliseconds whatever the number of particles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.engine import free_memory
from warpsph.engine.neighbours import MOST_PARTICLES, default_width, grid_layout
from warpsph.errors import CapacityError, CaseError, ExpressionError, Problem
from warpsph.kernels.core import permute
from warpsph.scene.body_sampling import working_memory
from warpsph.scene.body_surfaces import surface_of
from warpsph.scene.lattice import Lattice, make_lattice
from warpsph.scene.masks import inside
from warpsph.scene.open_faces import buffer_layers, open_axis, open_sides
from warpsph.scene.physics import contact_matrix, support_radius
from warpsph.scene.surfaces import ShapeError, Surface

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.kernels.core.spec import Spec

SITES = 40_000
"""Cells that are looked at to tell how much of the domain the shapes fill."""

# Bytes of host memory, measured as peaks of the resident set with 1 to 4 M particles in 2-D and 3-D.
BUILD, BUILD_AXIS = 25, 47  # of a particle while the geometry is built: the first, and the second for each dimension
BUILD_CELL = 10  # of a cell of the lattice without a particle
KEPT, KEPT_AXIS = 26, 24  # of a particle in the geometry that a run keeps
COPY, COPY_AXIS = 100, 47  # of a particle while the state is copied for output
# Bytes on the device beside fields and list.
EXTREMES = 12  # vectors a cell of the neighbour search for what particles have moved
REFINEMENTS = 60  # trials of a spacing that fits


@dataclass(frozen=True)
class Count:
    """How many there are, to a few per cent.

    cells: of the lattice, layers beyond the sides of the domain included
    fluid, walls: particles
    filled: whether the fluid leaves no room in the domain
    lattice: the cells
    sampling: bytes of host memory that making the boundary particles of each body takes
    """

    cells: int
    fluid: int
    walls: int
    filled: bool
    lattice: Lattice
    sampling: dict[str, float]

    @property
    def particles(self) -> int:
        """Fluid and wall particles."""
        return self.fluid + self.walls


def count(case: Case, support: float) -> Count:
    """Return how many particles a case has, without making any.

    Args:
        case: validated case.
        support: support radius of the smoothing kernel [m].

    Raises:
        CaseError: the domain holds no cell, or is too short for its periods.
    """
    lattice = make_lattice(case, support)
    domain = math.prod(lattice.count)
    fluid, solid = _shares(case, lattice)
    layers = math.ceil(support / case.spacing - 1e-9)
    surfaces = _surfaces(case, lattice)
    area = sum(surface.extent for surface in surfaces.values())
    walls = min(round(solid * domain), math.ceil(layers * area / case.spacing ** (case.dimension - 1)))
    sampling = {name: working_memory(surface, case.spacing, layers) for name, surface in surfaces.items()}
    if not case.scheme.mirrors_sides:
        free = 1
        for n, sides, (before, after) in zip(lattice.count, case.sides, lattice.layers, strict=True):
            free *= n + before * (sides.lower.kind != "wall") + after * (sides.upper.kind != "wall")
        walls += math.prod(lattice.shape) - free
    filled = fluid + solid == 1.0 and not case.has_open_sides
    return Count(math.prod(lattice.shape), round(fluid * domain), walls, filled, lattice, sampling)


def _surfaces(case: Case, lattice: Lattice) -> dict[str, Surface]:
    """Return the surfaces of the bodies that have one."""
    low, high = np.array(lattice.lower), np.array(lattice.upper)
    found = {}
    for name, body in case.bodies.items():
        with suppress(ExpressionError, ShapeError):  # told with its place when the geometry is built
            found[name] = surface_of(case, body, low, high)
    return found


def _shares(case: Case, lattice: Lattice) -> tuple[float, float]:
    """Return the shares of the domain's cells that are fluid and solid, from an even sample of them."""
    axes: list[Any] = [None] * lattice.dimension
    left = float(SITES)
    for position, k in enumerate(sorted(range(lattice.dimension), key=lattice.count.__getitem__)):
        n = lattice.count[k]
        most = max(4, int(left ** (1 / (lattice.dimension - position))))  # short axes leave more to the long ones
        some = np.arange(n) if n <= most else np.floor((np.arange(most) + 0.5) * (n / most))
        axes[k] = lattice.lower[k] + (some + 0.5) * lattice.spacing[k]
        left /= len(some)

    def covered(owners: Any) -> Any:
        mask = np.zeros([len(axis) for axis in axes], dtype=np.bool_)
        for owner in owners:
            if owner.shape.kind == "rest":
                mask[:] = True
            else:
                with suppress(ExpressionError, ValueError):  # told with its place when the geometry is built
                    own = inside(owner.shape, axes, case.spacing)
                    mask |= ~own if getattr(owner, "hollow", False) else own
        return mask

    solid = covered(case.bodies.values())
    return float((covered(case.fluids) & ~solid).mean()), float(solid.mean())


# what a run takes -------------------------------------------------------------------------------------------


def building(case: Case, found: Count) -> int:
    """Return the bytes of host memory that building the geometry takes at most."""
    d = case.dimension
    return found.particles * (BUILD + BUILD_AXIS * d) + max(found.cells - found.particles, 0) * BUILD_CELL


def running_on_host(case: Case, found: Count) -> int:
    """Return the bytes of host memory of a run whose fields are elsewhere: the geometry, and a copy of the state."""
    d = case.dimension
    return max(building(case, found), found.particles * (KEPT + COPY + (KEPT_AXIS + COPY_AXIS) * d))


def on_device(case: Case, spec: Spec, fluid: int, walls: int, support: float, skin: float, lattice: Lattice) -> int:
    """Return the bytes of device memory of a run: fields, neighbour list, search grid and sort buffers, ISPH matrix.

    Args:
        case: validated case.
        spec: structure of the run.
        fluid, walls: particles.
        support: support radius [m]; skin: of the list as share of it.
        lattice: cells of the domain, for its box.
    """
    fluid += buffered(case, spec, support, skin, lattice)
    real = 8 if spec.precision == "float64" else 4
    size = {"real": real, "vec": spec.dimension * real, "mat": spec.dimension**2 * real, "pair": 2 * real}
    size["origins"] = spec.windows * size["vec"]
    size.update(phased=spec.triple * real, normals=spec.triple * size["vec"], curved=max(spec.triple, 1) * real)
    size.update(int8=1, uint8=1, int16=2, int32=4)
    rows = {"fluid": fluid, "wall": walls, "all": fluid + walls}
    fields = [field for field in case.scheme.fields() if field.exists(spec)]
    memory = sum(rows[field.rows] * size[field.kind] for field in fields)
    # sort keys and order, double; copies of the fields that are sorted at once
    memory += (fluid + walls) * 16
    memory += permute.room([permute.aligned(rows[field.rows] * size[field.kind]) for field in fields if field.kept])
    capacity = case.numerics.neighbour_capacity
    entries = default_width(spec, support, case.spacing, skin) if capacity == "auto" else int(capacity)
    memory += (fluid + walls) * entries * 4
    margin = support if walls else 0.0
    lower, upper = ([x + sign * margin * (not p) for x, p in zip(end, spec.periodic, strict=True)]
                    for end, sign in ((lattice.lower, -1), (lattice.upper, 1)))  # fmt: skip
    grid = math.prod(grid_layout(lower, upper, spec.periodic, support * (1.0 + skin))[0])
    memory += grid * (4 * (2 if walls else 1) + EXTREMES * size["vec"])
    return memory + case.scheme.memory_beside(spec, fluid, entries)


def _structure(case: Case, found: Count, row_list: bool) -> Spec:
    """Return the structure of a run as far as it decides which fields there are."""
    from warpsph.kernels.core.spec import Spec

    paper = case.numerics.formulation == "paper"
    several = len(case.phases) > 1
    corrected = case.numerics.pressure_gradient == "corrected" or (
        case.numerics.pressure_gradient == "auto" and found.filled and not paper
    )
    given = case.numerics.shifting
    shifting = (corrected or case.scheme.shifts) if given == "auto" else float(given) > 0
    disorder = getattr(case.numerics, "disorder_friction", 0.0)
    spared = getattr(case.numerics, "spared_gradient", "gravity")
    viscous = any(phase.viscosity > 0 for phase in case.phases.values())
    tension = case.has_surface_tension
    measured = any(gauge.type == "interface_length" for gauge in case.gauges.values())
    return Spec(
        dimension=case.dimension,
        precision=case.precision,
        multiphase=several,
        periodic=tuple(case.periodic),
        walls=found.walls > 0,
        wall_no_slip=viscous and found.walls > 0,
        tension="pressure_jump" if tension else "none",
        triple=len(case.phases) if tension and len(case.phases) > 2 else 0,
        leaning=tension and found.walls > 0 and bool(np.any(contact_matrix(case) != 0)),
        interface=several and (tension or measured),
        paper_star=paper and several,
        shifting=shifting,
        disorder=not paper and (disorder == "auto" or float(disorder) > 0),
        inertia=spared == "acceleration" or (spared == "auto" and not (found.filled or paper or several)),
        scheme=case.numerics.scheme,
        budget=any(gauge.type == "budget" for gauge in case.gauges.values()),
        changing=case.has_flow_through,
        open_axis=open_axis(case),
        windows=0 if case.output.lyapunov is None else case.output.lyapunov.starts,
        row_list=row_list,
    )


def buffered(case: Case, spec: Spec, support: float, skin: float, lattice: Lattice) -> int:
    """Return how many particles the buffers of inlets and outlets hold."""
    if spec.open_axis < 0:
        return 0
    layers = buffer_layers(support, skin, lattice.spacing[spec.open_axis])
    face = math.prod(lattice.count) // lattice.count[spec.open_axis]
    return sum(layers * face for _ in open_sides(case))


def expected_on_device(case: Case, found: Count, row_list: bool = True) -> int:
    """Return what `on_device` will be, before the geometry is known."""
    skin = case.numerics.skin
    if skin == "auto":
        skin = case.scheme.skin
    spec = _structure(case, found, row_list)
    return on_device(case, spec, found.fluid, found.walls, support_radius(case), float(skin), found.lattice)


# the verdict ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Need:
    """Memory of one place: what takes it, the bytes it takes and those that are free."""

    what: str
    place: str
    bytes: int
    free: int


def _needs(case: Case, found: Count, device: Any | None) -> list[Need]:
    """Return what a case takes where; of building alone if there is no device."""
    host, needs = free_memory.host_free(), []
    if host is not None:
        needs.append(Need("building them", "memory of this machine", building(case, found), host))
    if device is not None:
        row_list = bool(device.is_cpu)
        fields = expected_on_device(case, found, row_list)
        free = free_memory.device_free(device)
        if free is not None:
            needs.append(Need("their run", f"memory of {device}", fields, free))
            fields = 0
        if host is not None:
            needs.append(Need("their run", "memory of this machine", running_on_host(case, found) + fields, host))
    return needs


def shortage(case: Case, device: Any | None = None, found: Count | None = None) -> CapacityError | None:
    """Return the error that tells why a case does not fit, or None if it does.

    Args:
        case: validated case.
        device: Warp device of the run; None asks about building the particles alone.
        found: the count, if it is known.

    Raises:
        CaseError: as `count`.
    """
    found = count(case, support_radius(case)) if found is None else found
    large = _too_large_body(case, found)
    if large is not None:
        return large
    tight = [need for need in _needs(case, found, device) if need.bytes > need.free]
    key = "particle_spacing"
    if tight:
        worst = max(tight, key=lambda need: need.bytes / max(need.free, 1))
        rule = (
            f"makes about {found.particles} particles; {worst.what} takes {_size(worst.bytes)}, but of the {worst.place} "
            f"{_size(worst.free)} are free"
        )
    elif found.particles > MOST_PARTICLES:
        rule = f"makes about {found.particles} particles, more than the {MOST_PARTICLES} that a run can number"
    else:
        return None
    return CapacityError(str(Problem(key, case.spacing, rule, _remedy(case, found, device))), key=key)


def _too_large_body(case: Case, found: Count) -> CapacityError | None:
    """Return the error of a body whose surface takes more memory to sample than there is: mostly one in other units."""
    free = free_memory.host_free()
    if free is None or not found.sampling:
        return None
    name, taken = max(found.sampling.items(), key=lambda item: item[1])
    if taken <= free:
        return None
    body, lattice = case.bodies[name], found.lattice
    surface = surface_of(case, body, np.array(lattice.lower), np.array(lattice.upper))
    sizes = (_box(surface.bounds[0], surface.bounds[1]), _box(lattice.lower, lattice.upper))
    rule = (
        f"is {sizes[0]} m in a domain of {sizes[1]} m: its boundary particles take {_size(taken)} to make, but "
        f"{_size(free)} of the memory of this machine are free"
    )
    units = "check its unit (scale: 0.001 for millimetres), " if body.shape.stl is not None else ""
    remedy = f"{units}cut off what is far outside the domain, or write a larger particle_spacing"
    path = f"bodies.{name}.shape.{body.shape.kind}"
    return CapacityError(str(Problem(path, body.shape.kind, rule, remedy)), key=path)


def _box(lower: Sequence[float] | np.ndarray, upper: Sequence[float] | np.ndarray) -> str:
    """Return the sides of a box as text: '2 x 1'."""
    return " x ".join(f"{high - low:.3g}" for low, high in zip(lower, upper, strict=True))


def _size(number: float) -> str:
    """Return bytes as text: '12.3 GB (12345678901 bytes)'."""
    return f"{number / 1e9:.3g} GB ({number:.0f} bytes)"


def _remedy(case: Case, found: Count, device: Any | None) -> str:
    """Return the advice to take a spacing that fits, the smallest there is within a few per cent."""
    spacing = case.spacing
    for _ in range(REFINEMENTS):
        tight = [need.bytes / max(need.free, 1) for need in _needs(case, found, device)]
        share = max([found.particles / MOST_PARTICLES, *tight])
        if share <= 1.0:
            return f"a particle_spacing of {_up(spacing)} would fit"
        spacing *= max(share ** (1 / case.dimension), 1.01)
        coarser = case.model_copy(update={"particle_spacing": spacing})
        try:
            found = count(coarser, support_radius(coarser))
        except CaseError:
            break
        case = coarser
    return "run it on a machine with more memory"


def _up(value: float) -> str:
    """Return a number with three digits, rounded up."""
    digits = 2 - math.floor(math.log10(value))
    scale = 10.0**digits
    return f"{math.ceil(value * scale - 1e-9) / scale:.6g}"
