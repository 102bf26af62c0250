"""Sums and extremes of a phase, for gauges: float64, in a fixed order, so that no number of threads changes a digit.

The particles are dealt to a fixed number of blocks. The thread of block b of phase p adds up what this block holds of the
phase, into row p * block_count + b of `totals` and `largest`; the host adds the blocks. What is added is one of the GROUPS.
Vectors have three components, in 2-D with z = 0.
"""

import functools
from typing import Any

import warp as wp

from .clock import LAST_STEP
from .fields import FLUID
from .spec import types

# group -> (entries that are added, entries of which the largest is kept), in the order of `warpsph.measure.totals`
GROUPS = {"motion": (11, 1), "energy": (3, 0), "pressure": (2, 2), "place": (8, 6), "interface": (1, 0)}

# columns of `materials`, one row a phase
DENSITY = 0  # rho0 [kg/m^3]
STIFFNESS = 1  # c^2 / gamma [m^2/s^2]
POWER = 2  # gamma - 1 [-]
BACKGROUND = 3  # background pressure / rho0 [m^2/s^2]


@functools.cache
def make_scene() -> Any:
    """Return the struct of what sums depend on beside particles and materials."""

    @wp.struct
    class Scene:
        gravity: wp.vec3d  # [m/s^2]
        center: wp.vec3d  # of the central force [m]
        pull: wp.float64  # B^2 of the central acceleration -B^2 (x - center) [1/s^2]
        middle: wp.vec3d  # of the domain, from which places are measured [m]

    return Scene


@functools.cache
def make_elastic_energy() -> Any:
    """Return the `wp.func` elastic energy [J/kg] of a density excess s, by a row of `materials`."""

    @wp.func
    def log_of_one_plus(x: wp.float64):
        # What rounding takes from 1 + x it takes from the divisor too, which keeps the digits of a small x.
        u = wp.float64(1.0) + x
        result = x
        if u != wp.float64(1.0):
            result = wp.log(u) * (x / (u - wp.float64(1.0)))
        return result

    @wp.func
    def exp_minus_one(x: wp.float64):
        u = wp.exp(x)
        result = x
        if u != wp.float64(1.0):
            result = (u - wp.float64(1.0)) * (x / wp.log(u))
        return result

    @wp.func
    def elastic_energy(s: wp.float64, material: wp.vec4d):
        power = log_of_one_plus(s)
        if material[POWER] != wp.float64(0.0):
            power = exp_minus_one(material[POWER] * power) / material[POWER]
        loss = s / (wp.float64(1.0) + s)
        return material[STIFFNESS] * (power - loss) + material[BACKGROUND] * loss

    return elastic_energy


@functools.cache
def make_particle() -> Any:
    """Return the struct of one fluid particle as the sums see it."""

    @wp.struct
    class Particle:
        position: wp.vec3d
        velocity: wp.vec3d
        mass: wp.float64
        volume: wp.float64
        excess: wp.float64  # rho/rho0 - 1
        pressure: wp.float64
        slope: wp.float64  # |grad c| of its own phase [1/m]

    return Particle


def _make_terms(group: str, dimension: int, internal: bool) -> tuple[Any, Any, Any, Any]:
    """Return the types of sums and extremes of a group, and the `wp.func`s that give both for one particle."""
    added, kept = GROUPS[group]
    Total = wp.types.vector(length=added, dtype=wp.float64)
    Largest = wp.types.vector(length=max(kept, 1), dtype=wp.float64)
    Scene, Particle = make_scene(), make_particle()
    elastic_energy = make_elastic_energy()

    @wp.func
    def no_extremes(p: Particle):
        return Largest()

    @wp.func
    def motion(p: Particle, material: wp.vec4d, scene: Scene):
        flow = p.volume * p.velocity
        momentum = p.mass * p.velocity
        spin = wp.cross(p.position, momentum)
        return Total(
            p.volume, flow[0], flow[1], flow[2], momentum[0], momentum[1], momentum[2], spin[0], spin[1], spin[2],
            wp.sqrt(wp.dot(momentum, momentum)),
        )  # fmt: skip

    @wp.func
    def motion_extremes(p: Particle):
        return Largest(wp.dot(p.velocity, p.velocity))

    @wp.func
    def energy(p: Particle, material: wp.vec4d, scene: Scene):
        way = p.position - scene.center
        height = wp.float64(0.5) * scene.pull * wp.dot(way, way) - wp.dot(p.position, scene.gravity)
        kinetic = wp.float64(0.5) * p.mass * wp.dot(p.velocity, p.velocity)
        stored = wp.float64(0.0)
        if wp.static(internal):
            stored = p.pressure * p.volume / material[POWER]
        else:
            stored = p.mass * elastic_energy(p.excess, material)
        return Total(kinetic, p.mass * height, stored)

    @wp.func
    def pressure(p: Particle, material: wp.vec4d, scene: Scene):
        return Total(p.volume, p.pressure * p.volume)

    @wp.func
    def pressure_extremes(p: Particle):
        return Largest(p.pressure, -p.pressure)

    @wp.func
    def place(p: Particle, material: wp.vec4d, scene: Scene):
        x = p.position - scene.middle
        first = p.volume * x
        own = wp.pow(p.volume, wp.float64(wp.static(2.0 / dimension)))
        return Total(
            p.volume, first[0], first[1], first[2], first[0] * x[0], first[1] * x[1], first[2] * x[2], p.volume * own
        )  # fmt: skip

    @wp.func
    def place_extremes(p: Particle):
        x = p.position
        return Largest(x[0], x[1], x[2], -x[0], -x[1], -x[2])

    @wp.func
    def interface(p: Particle, material: wp.vec4d, scene: Scene):
        return Total(p.slope * p.volume)

    terms = {"motion": motion, "energy": energy, "pressure": pressure, "place": place, "interface": interface}
    extremes = {"motion": motion_extremes, "pressure": pressure_extremes, "place": place_extremes}
    return Total, Largest, terms[group], extremes.get(group, no_extremes)


@functools.cache
def make_phase_sums(
    group: str, dimension: int, precision: str, multiphase: bool, leapfrog: bool, in_rows: bool, zones: bool = False,
    internal: bool = False,
) -> tuple[Any, Any, Any]:  # fmt: skip
    """Return (kernel, type of a row of `totals`, type of a row of `largest`); see the module.

    group: of GROUPS
    leapfrog: the velocities are half a step behind the positions and are carried on to them
    in_rows: a block is a stretch of particles (CPU) instead of every block_count-th particle (GPU)
    zones: rows without a particle and buffers of open sides do not count
    internal: the fluid is a gas, whose stored energy is p V/(gamma - 1)
    """
    real, vec, _, pair = types(dimension, precision)
    Total, Largest, terms, extremes = _make_terms(group, dimension, internal)
    Scene, Particle = make_scene(), make_particle()
    kept = GROUPS[group][1]
    at_interface = group == "interface"

    @wp.kernel(module="unique", enable_backward=False)
    def phase_sums(
        first: int,
        block_count: int,
        fluid_count: int,
        scene: Scene,
        clock: wp.array(dtype=wp.float64),
        materials: wp.array(dtype=wp.vec4d),
        cuts: wp.array(dtype=wp.vec3d),
        periods: wp.array(dtype=wp.vec3d),
        phase: wp.array(dtype=wp.int8),
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        density_excess: wp.array(dtype=real),
        rest_volume: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        normal: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        totals: wp.array(dtype=Total),
        largest: wp.array(dtype=Largest),
    ):
        row = wp.tid() + first
        own = row / block_count
        k = row - own * block_count
        step = block_count
        end = fluid_count
        if wp.static(in_rows):
            chunk = (fluid_count + block_count - 1) / block_count
            k = k * chunk
            end = wp.min(k + chunk, fluid_count)
            step = 1
        material = materials[own]
        cut = cuts[own]
        period = periods[own]
        ahead = wp.float64(0.5) * clock[LAST_STEP]
        total = Total()
        most = Largest()
        for entry in range(wp.static(kept)):
            most[entry] = wp.float64(-wp.inf)
        p = Particle()
        while k < end:
            counts = bool(True)
            if wp.static(multiphase):
                counts = int(phase[k]) == own
            if wp.static(zones):
                counts = counts and int(zone[k]) == FLUID
            if counts:
                for axis in range(wp.static(dimension)):
                    x = wp.float64(anchor[k][axis]) + wp.float64(offset[k][axis])
                    if period[axis] > wp.float64(0.0):
                        x -= period[axis] * wp.floor((x - cut[axis]) / period[axis])
                    p.position[axis] = x
                    v = wp.float64(velocity[k][axis])
                    if wp.static(leapfrog):
                        v += ahead * wp.float64(acceleration[k][axis])
                    p.velocity[axis] = v
                p.excess = wp.float64(density_excess[k])
                rest = wp.float64(rest_volume[k])
                p.mass = material[DENSITY] * rest
                p.volume = rest / (wp.float64(1.0) + p.excess)
                p.pressure = wp.float64(state[k][0])
                if wp.static(at_interface):
                    p.volume = wp.float64(state[k][1])
                    square = wp.float64(0.0)
                    for axis in range(wp.static(dimension)):
                        square += wp.float64(normal[k][axis]) * wp.float64(normal[k][axis])
                    p.slope = wp.sqrt(square)
                total += terms(p, material, scene)
                most = wp.max(most, extremes(p))
            k += step
        totals[row] = total
        largest[row] = most

    return phase_sums, Total, Largest


@functools.cache
def make_fold(dtype: Any, largest: bool) -> Any:
    """Return the kernel that adds up the partial sums of each part (a phase, a body), or takes the largest, in groups.

    A GPU needs tens of thousands of partial sums to be busy; so many are slower to copy than to fold.
    """

    @wp.kernel(module="unique", enable_backward=False)
    def fold_sums(
        first: int,
        block_count: int,
        folds: int,
        partial: wp.array(dtype=dtype),
        folded: wp.array(dtype=dtype),
    ):
        row = wp.tid() + first
        part = row / folds
        k = row - part * folds
        result = partial[part * block_count + k]
        k += folds
        while k < block_count:
            if wp.static(largest):
                result = wp.max(result, partial[part * block_count + k])
            else:
                result = result + partial[part * block_count + k]
            k += folds
        folded[row] = result

    return fold_sums


@functools.cache
def make_mark_bins(dimension: int, precision: str, multiphase: bool, zones: bool = False) -> Any:
    """Return the kernel over the fluid that marks which slices of the domain along each axis hold some of a phase.

    `occupied` has `most_bins` entries for each axis of each phase; the slices start at `lower` and are `bins` an axis, 0 for
    an axis that is not looked at.
    """
    _, vec, _, _ = types(dimension, precision)

    @wp.kernel(module="unique", enable_backward=False)
    def mark_bins(
        first: int,
        most_bins: int,
        lower: wp.vec3d,
        extent: wp.vec3d,
        bins: wp.vec3i,
        phase: wp.array(dtype=wp.int8),
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        occupied: wp.array(dtype=wp.uint8),
    ):
        i = wp.tid() + first
        if wp.static(zones):
            if int(zone[i]) != FLUID:
                return
        own = int(0)
        if wp.static(multiphase):
            own = int(phase[i])
        for axis in range(wp.static(dimension)):
            count = bins[axis]
            x = wp.float64(anchor[i][axis]) + wp.float64(offset[i][axis])
            if count > 0 and wp.isfinite(x):
                # Towards zero, as NumPy's integers.
                place = wp.trunc((x - lower[axis]) / extent[axis] * wp.float64(count))
                place -= wp.float64(count) * wp.floor(place / wp.float64(count))
                occupied[(own * 3 + axis) * most_bins + wp.clamp(int(place), 0, count - 1)] = wp.uint8(1)

    return mark_bins


@functools.cache
def make_mark_near(dimension: int, precision: str, zones: bool = False) -> Any:
    """Return the kernel over the fluid that marks in `near` the particles in the wanted cells of a grid.

    `wanted_cells` has 1 where a cell is wanted, the last axis fastest; cells start at `cells_lower` and have the sizes
    `cell_size`. What lies outside the grid belongs to its outermost cells, along a periodic axis to its image.
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.kernel(module="unique", enable_backward=False)
    def mark_near(
        first: int,
        cells_lower: wp.vec3d,
        cell_size: wp.vec3d,
        cell_count: wp.vec3i,
        wraps: wp.vec3i,
        wanted_cells: wp.array(dtype=wp.uint8),
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        zone: wp.array(dtype=wp.int8),
        near: wp.array(dtype=wp.uint8),
    ):
        i = wp.tid() + first
        if wp.static(zones):
            if int(zone[i]) != FLUID:
                near[i] = wp.uint8(0)
                return
        cell = int(0)
        for axis in range(wp.static(dimension)):
            x = wp.float64(anchor[i][axis]) + wp.float64(offset[i][axis])
            count = wp.float64(cell_count[axis])
            place = wp.floor((x - cells_lower[axis]) / cell_size[axis])
            if wraps[axis] != 0:
                place -= count * wp.floor(place / count)
            place = wp.clamp(place, wp.float64(0.0), count - wp.float64(1.0))
            cell = cell * cell_count[axis] + wp.clamp(int(place), 0, cell_count[axis] - 1)
        near[i] = wanted_cells[cell]

    return mark_near


@functools.cache
def make_body_forces(dimension: int, precision: str) -> Any:
    """Return the kernel that adds the forces on the particles of each wall body, in blocks as the sums of phases."""
    _, vec, _, _ = types(dimension, precision)

    @wp.kernel(module="unique", enable_backward=False)
    def body_forces(
        first: int,
        block_count: int,
        wall_count: int,
        wall_body: wp.array(dtype=int),
        load: wp.array(dtype=vec),
        forces: wp.array(dtype=wp.vec3d),
    ):
        row = wp.tid() + first
        body = row / block_count
        k = row - body * block_count
        total = wp.vec3d()
        while k < wall_count:
            if wall_body[k] == body + 1:
                for axis in range(wp.static(dimension)):
                    total[axis] += wp.float64(load[k][axis])
            k += block_count
        forces[row] = total

    return body_forces
