"""Compile-time structure of a run: everything that decides *which* code exists, and no number.

Two runs with equal `Spec` share every compiled kernel; numbers travel in `params.Params`.
"""

import dataclasses
import functools
import platform
from typing import Any, NamedTuple

import warp as wp

# Floating-point freedom the neighbour sums may take on a CPU: reordered sums, fused multiply-add, reciprocals.
# Not the whole of -ffast-math: NaN and infinity keep their meaning, so a diverging run is still seen.
FREEDOM = "-march=native -mreassociate -fno-signed-zeros -freciprocal-math -ffp-contract=fast"
# Neighbours in vectors of eight numbers, each read by itself: quicker than sixteen, and than loads that gather
# (docs/records/pair_loops.md#vectors).
VECTORS = " -target-feature +prefer-256-bit -target-feature +prefer-no-gather"
SWEEP_OPTIONS: dict[str, Any] = {
    "fast_math": True,
    "cpu_compiler_flags": FREEDOM + (VECTORS if platform.machine() in ("x86_64", "AMD64") else ""),
}

BLOCK = 256
"""Threads of a block on a GPU: what Warp launches by default."""


@dataclasses.dataclass(frozen=True)
class Spec:
    """Structure of one run; hashable, the key of every kernel factory.

    Attributes:
        dimension: number of space dimensions, 1, 2 or 3.
        precision: "float32" or "float64", of the particle fields.
        kernel: smoothing kernel, a key of `smoothing.KERNELS`.
        multiphase: more than one fluid phase.
        periodic: per axis, whether it is periodic.
        walls: wall particles exist.
        bodies: some walls have a surface of their own, see `wall_fit`.
        tails: some bodies have thin tails, whose two sides do not see each other, see `visibility`.
        flat_walls: all walls with a surface of their own are sides of the domain.
        own_sides: sides of the domain have their own velocity in continuity, where bodies may not (riemann, delta_plus).
        dry_walls: walls that no fluid has come to are not there (delta_plus).
        wall_sound: beside such walls, sound would grow without the measures of `wall_fit`.
        wall_no_slip: some wall exerts viscous friction (then `viscosity` is not "none").
        viscosity: "none", "morris", "radial", "isotropic" or "paper".
        viscous_stages: stages of friction in a step, 1 where it is explicit (riemann).
        unlike_viscosity: phases differ in viscosity, so that friction between them asks for depths (riemann).
        tension: "none", "pressure_jump" or "body_force".
        kinked: weights bend the pressure between fluids by their depths, and these by the curvature (riemann).
        triple: phases, three or more with tensions between them, whose interfaces may meet; 0: none do.
        contact_angle: interfaces meet walls at angles that are given, or 90 degrees.
        leaning: some of these angles are not 90 degrees.
        interface: interface normals are evaluated: in every step where `curved`, else where a gauge asks for them.
        corrected: corrected ("minus") pressure gradient instead of the conservative ("plus") one.
        paper_star: arithmetic star states of the printed scheme at interfaces.
        printed: the sweeps as the paper prints them, with nothing else (riemann, isph).
        gravity: a hydrostatic acceleration acts.
        body_force: an acceleration that pressure does not balance acts.
        central_force: an acceleration -B^2 (x - center) acts.
        shifting: particles are shifted towards an even arrangement.
        volume_constraint: the mean pressure follows from the volume of a closed domain.
        momentum_axes: periodic axes on which nothing pushes: the total momentum along them is kept (riemann).
        room: the density is held to the room that the particles take.
        surface_room: the same under a free surface, and thin fluid has no pressure (riemann).
        interface_force: pair force that keeps phases apart.
        dissipation: the pressure difference enters the star velocity.
        inertia: it spares the pressure gradient that the acceleration tells, not that of gravity alone (riemann).
        acoustic_damping: compression and expansion have a viscosity of their own (riemann, delta_plus).
        disorder: disordered velocities have a friction that a smooth flow does not feel (riemann).
        relaxation: the pressure follows a compression in two parts, one of which fades, so that sound dies (riemann,
            delta_plus).
        free_surface: an axis is open, so that wall pressure never pulls.
        scheme: name of the scheme in the registry.
        varying_force: gravity or body force depends on time, see `signals`.
        varying_sides: the velocity of a side of the domain does.
        moving: bodies move.
        changing: particles are born or die.
        open_axis: axis whose sides are inlets or outlets, -1 for none; with any the number of particles changes.
        sponge: layers next to inlets or outlets damp the flow.
        windows: windows of time whose Lyapunov exponents are followed at once, see `flow_map`; 0: none.
        mirror: sides of the domain are walls made of mirror images (isph).
        second_order: BDF2 in time instead of the first-order projection (isph).
        implicit_viscosity: the viscous term is stabilised by an implicit solve (isph).
        viscosity_by_axis: the components of implicit viscosity have matrices of their own (isph).
        density_diffusion: the density is evened out (delta_plus).
        exact_divergence: the divergence is exact for linear velocities (delta_plus).
        tension_control: pressure below zero acts by its differences (delta_plus): "inside" away from free surfaces, "gaps"
            there where the neighbourhood has a gap alone, "" nowhere.
        artificial_viscosity: fluid particles have friction beside that of their phase (delta_plus, gas).
        budget: a gauge asks where momentum and energy come from and go (delta_plus).
        shift_form: "" for that of the scheme; "positions" or "consistent": what a shift changes (delta_plus).
        shift_ahead: the shift of the coming step is known before it, and the check of the list takes it in (delta_plus).
        runge_kutta: four stages of Runge and Kutta instead of the leapfrog (delta_plus), or of two (gas).
        varying_h: each particle has a smoothing length of its own (gas).
        constant_h: they are all the same none the less (gas).
        star: "" or how the Riemann problem of a pair is solved, "acoustic" or "exact" (gas).
        limited: second-order reconstruction of the states of a pair (gas).
        conduction: artificial conduction of heat (gas).
        held: particles beside open sides keep the state of the start (gas).
        internal_energy: the fluid has an internal energy that is no function of its density (gas).
        row_list: neighbour list stored particle by particle (CPU) instead of neighbour by neighbour (GPU).
        few: so few particles that a GPU runs all of them at once, whatever registers a sweep takes.
        lanes: threads of a particle in sweeps over pairs on a GPU, see `lanes`; 1 on a CPU.
        wide_list: the neighbour list has more entries than 31 bits number; known with its width.
    """

    dimension: int
    precision: str = "float32"
    kernel: str = "wendland_c2"
    multiphase: bool = False
    periodic: tuple[bool, ...] = (False, False)
    walls: bool = False
    bodies: bool = False
    tails: bool = False
    flat_walls: bool = False
    own_sides: bool = False
    dry_walls: bool = False
    wall_sound: bool = False
    wall_no_slip: bool = False
    viscosity: str = "none"
    viscous_stages: int = 1
    unlike_viscosity: bool = False
    tension: str = "none"
    kinked: bool = False
    triple: int = 0
    contact_angle: bool = False
    leaning: bool = False
    interface: bool = False
    corrected: bool = False
    paper_star: bool = False
    printed: bool = False
    gravity: bool = False
    body_force: bool = False
    central_force: bool = False
    shifting: bool = False
    volume_constraint: bool = False
    momentum_axes: tuple[int, ...] = ()
    room: bool = False
    surface_room: bool = False
    interface_force: bool = False
    dissipation: bool = True
    inertia: bool = False
    acoustic_damping: bool = False
    disorder: bool = False
    relaxation: bool = False
    free_surface: bool = False
    scheme: str = "riemann"
    mirror: bool = False
    second_order: bool = False
    implicit_viscosity: bool = False
    viscosity_by_axis: bool = False
    density_diffusion: bool = False
    exact_divergence: bool = False
    tension_control: str = ""
    artificial_viscosity: bool = False
    budget: bool = False
    shift_form: str = ""
    shift_ahead: bool = False
    runge_kutta: bool = False
    varying_force: bool = False
    varying_sides: bool = False
    moving: bool = False
    changing: bool = False
    open_axis: int = -1
    sponge: bool = False
    windows: int = 0
    varying_h: bool = False
    constant_h: bool = False
    star: str = ""
    limited: bool = False
    conduction: bool = False
    held: bool = False
    internal_energy: bool = False
    row_list: bool = True
    few: bool = False
    lanes: int = 1
    wide_list: bool = False

    @property
    def viscous_jump(self) -> bool:
        """Friction between fluids lacks a part of the stress, which the Morris form does not have in its pairs (riemann)."""
        return self.unlike_viscosity and self.viscosity == "morris"

    @property
    def momentum_constraint(self) -> bool:
        """The total momentum is kept along some axis."""
        return bool(self.momentum_axes)

    @property
    def curved(self) -> bool:
        """The curvature of interfaces is known: tension takes it, and so do depths where weights make a kink (riemann)."""
        return self.tension != "none" or self.kinked


def pair_sweep(spec: Spec, blocks: int = 4) -> dict[str, Any]:
    """Return the options of `wp.kernel` for a sweep over the pairs of a `Spec` (riemann).

    On a GPU each thread has one particle, without a loop over more, which costs registers: sweeps wait for memory, and hide
    that by other threads. With several phases a sweep would take up to 128 registers and more, so that a quarter of the
    threads or fewer fit; limited to what lets `blocks` blocks run side by side, the rest in the first cache, momentum and
    continuity of the droplet of `bench_speed` are 1.7 and 1.4 times quicker (H200; in 3-D and in float64 1.2 to 1.8 times,
    docs/speed.md#registers). With one phase the compiler needs fewer by itself, and a limit costs up to 10 %; where there
    are so few particles that hardly one waits for registers (`few_particles`) it costs 5 to 10 %.

    Args:
        blocks: blocks of BLOCK threads on a multiprocessor.
    """
    options: dict[str, Any] = {
        "module": "unique",
        "enable_backward": False,
        "module_options": SWEEP_OPTIONS,
        "grid_stride": False,
    }
    return options | ({"launch_bounds": (BLOCK, blocks)} if spec.multiphase and not spec.few else {})


def few_particles(spec: Spec, count: int, multiprocessors: int) -> bool:
    """Return whether so few particles are quicker in sweeps over several phases without a limit on registers.

    Of 128 registers, which these sweeps take in single precision, two blocks have room on a multiprocessor; up to twice as
    many particles wait for that for less time than a limit costs, with any number of lanes (docs/speed.md#lanes).
    """
    return count <= (4 if spec.precision == "float32" else 2) * BLOCK * multiprocessors


class Types(NamedTuple):
    """Warp types of a precision and dimension: scalar, vector, square matrix, (pressure, volume) pair."""

    real: Any
    vec: Any
    mat: Any
    pair: Any


@functools.cache
def types(dimension: int, precision: str) -> Types:
    """Return the Warp types for a dimension (1, 2, 3) and a precision ("float32", "float64")."""
    real = {"float32": wp.float32, "float64": wp.float64}[precision]
    return Types(
        real,
        wp.types.vector(length=dimension, dtype=real),
        wp.types.matrix(shape=(dimension, dimension), dtype=real),
        wp.types.vector(length=2, dtype=real),
    )


def types_of(spec: Spec) -> Types:
    """Return the Warp types of a `Spec`."""
    return types(spec.dimension, spec.precision)


@functools.cache
def phase_types(dimension: int, precision: str, count: int) -> tuple[Any, Any]:
    """Return the Warp types of a number and of a vector for each of `count` phases, the latter a row a phase."""
    real = types(dimension, precision).real
    return wp.types.vector(length=count, dtype=real), wp.types.matrix(shape=(count, dimension), dtype=real)


def phase_types_of(spec: Spec) -> tuple[Any, Any]:
    """Return the Warp types of a number and of a vector for each phase of a `Spec` whose interfaces may meet."""
    return phase_types(spec.dimension, spec.precision, max(spec.triple, 3))


def curvature_type(spec: Spec) -> Any:
    """Return the Warp type of what a particle knows of interfaces: a number, or one for each phase."""
    return phase_types_of(spec)[0] if spec.triple else types_of(spec).real


def origins_type(spec: Spec) -> Any:
    """Return the Warp type of where a particle was at the start of each window: the places one after the other."""
    return wp.types.vector(length=max(spec.windows, 1) * spec.dimension, dtype=types_of(spec).real)
