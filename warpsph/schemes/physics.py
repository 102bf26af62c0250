"""From a case and its particles to numbers: what the scene needs, sound speeds, time-step limits.

Everything a user may leave `auto` is decided here, from the physics given, and shown by `warpsph show`.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import CaseError, Problem
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.core.spec import Spec
from warpsph.scene.geometry import LIGHT
from warpsph.schemes.magnitudes import checked

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry

# Mach number squared that a weakly compressible fluid may reach: density varies by about 1 %.
COMPRESSION = 0.01
# The same for the pressure that a phase sees which is lighter than LIGHT times the densest: it starts with the density of
# its start pressure, or shares a closed domain with a stiffer phase, so that its volume follows the *change* of the pressure
# alone, a fraction of what it sees. Its sound sets the time step.
LIGHT_COMPRESSION = 0.04
# Share of the scene's pressure range that a phase must carry even where it sees little of it itself.
SHARED_PRESSURE = 0.01
# Stiffness rho c^2 that a dense phase gets against the lightest one, in a scene with gravity and without. The pressure noise
# of the dense phase grows with its rho c: at 1000 times it tears the films of a rising bubble. Without gravity a scene
# starts far from balance and moves slowly, and its sound has to die down meanwhile: in the square droplet the dense phase
# rings by 2 Pa about a jump of 1.7 Pa for the whole run at 50 times.
STIFFER = {True: 50.0, False: 1000.0}
# Curvature of a corner that the particles resolve, as share of 1/h: the pressure it makes must not compress much either.
CORNER = 0.1
# Forward-Euler limits of the viscous terms in rho h^2/mu (theory: riemann#a9), with a margin.
VISCOUS_LIMIT = {"morris": 0.125, "radial": 0.06, "paper": 0.06}
# Density excess that is never a fault by itself: the counterpart of the rarefaction that is one, `params.LEAST_DENSITY`.
LEAST_EXCESS = 0.9
IMPROVED_RATIO = 1.5
PAPER_RATIO = 1.25
SKIN = 0.12
# Shift of a step over h^2 |grad v| dt sum grad W V: how much faster particles are evened out than the flow disorders them.
SHIFTING = 16.0
# Rate, over |grad v|, at which the density follows the room that the particles take: 1 to 3 differ little.
ROOM_RATE = 2.0
# Displacement that breaks the symmetry of a lattice, in particle spacings: for the corrected gradient a perfect lattice
# that is sheared is a balance on a knife's edge, which ends in voids.
UNLOCK = 0.05


def smoothing_ratio(case: Case) -> float:
    """Return h / particle_spacing of a case."""
    given = case.numerics.smoothing_ratio
    if given != "auto":
        return float(given)
    printed = case.numerics.formulation == "paper" and case.numerics.scheme == "riemann"
    return PAPER_RATIO if printed else IMPROVED_RATIO


def support_radius(case: Case) -> float:
    """Return the support radius of the smoothing kernel in m."""
    return smoothing_ratio(case) * case.spacing * KERNELS[case.numerics.kernel].support


@dataclasses.dataclass(frozen=True)
class Physics:
    """Numbers of a run, all SI.

    Attributes:
        spec: compile-time structure.
        choices: what `auto` came to, by key of `numerics`.
        reasons: why, by the same keys (where it is not obvious).
        h: smoothing length [m]; support: support radius [m].
        sound_speed: per phase [m/s]; densities: reference density per phase [kg/m^3].
        scales: velocity [m/s], length [m], pressure [Pa] that the flow is expected to see.
        tension: (phases, phases) surface tension of each pair [N/m].
        step_cap: constant limits of the time step by name [s].
        viscous_step: limit of the time step that implicit viscosity is freed from [s]; 0 where viscosity is explicit.
        runaway: speed that stops the run [m/s].
        warnings: lines for the user.
    """

    spec: Spec
    choices: dict[str, Any]
    reasons: dict[str, str]
    h: float
    support: float
    sound_speed: tuple[float, ...]
    scales: dict[str, float]
    tension: np.ndarray
    step_cap: dict[str, float]
    runaway: float
    warnings: tuple[str, ...]
    densities: tuple[float, ...]
    viscous_step: float = 0.0

    @property
    def hardest_pressure(self) -> float:
        """Largest rho c^2 of the phases [Pa]: what the hardest of them makes when stopped at the speed of its sound."""
        return max(rho * c**2 for rho, c in zip(self.densities, self.sound_speed, strict=True))

    def most_excess(self, gamma: float, density: float, sound_speed: float) -> float:
        """Return the density excess at which a phase carries the hardest pressure [-]: more is divergence.

        A gas that a liquid runs into may be pressed to several times its density: no fault, but its equation of state.
        """
        ratio = 1.0 + gamma * self.hardest_pressure / (density * sound_speed**2)
        return float(max(ratio ** (1.0 / gamma) - 1.0, LEAST_EXCESS))

    def estimated_step(self) -> float:
        """Return the time step to expect [s], before the flow is known."""
        fastest = self.scales["velocity"]
        if self.spec.scheme == "riemann":
            fastest += max(self.sound_speed)
        acoustic = self.choices["courant"] * self.h / fastest if fastest > 0 else math.inf
        return min(acoustic, *self.step_cap.values()) if self.step_cap else acoustic


@checked
def derive(case: Case, geometry: Geometry, row_list: bool = True) -> Physics:
    """Return the physics of a case whose particles are known.

    Args:
        case: validated case.
        geometry: its particles.
        row_list: list layout of the device, see `Spec`.
    """
    if case.numerics.scheme == "isph":
        from warpsph.schemes import incompressible

        return incompressible.derive(case, geometry, row_list)
    numerics = case.numerics
    paper = numerics.formulation == "paper"
    names = case.phase_names
    phases = [case.phases[name] for name in names]
    filled = not has_room(case, geometry)
    tension = tension_matrix(case)
    has_tension = bool((tension > 0).any())
    gravity = np.asarray(case.gravity, dtype=float)
    viscous = any(phase.viscosity > 0 for phase in phases)

    choices: dict[str, Any] = {}
    reasons: dict[str, str] = {}

    def choose(key: str, automatic: Any, reason: str) -> Any:
        given = getattr(numerics, key)
        choices[key] = automatic if given == "auto" else given
        if given == "auto":
            reasons[key] = reason
        return choices[key]

    gradient = choose(
        "pressure_gradient",
        "corrected" if filled and not paper else "conservative",
        "the fluid fills a closed or periodic domain" if filled else "a free surface or open sides",
    )
    if paper and numerics.pressure_gradient == "auto":
        reasons["pressure_gradient"] = "printed form"
    corrected = gradient == "corrected"
    star = choose("star_states", "arithmetic" if paper else "weighted", "printed form" if paper else "density weights")
    form = choose(
        "viscosity_form",
        "paper" if paper else "radial" if has_tension or not filled else "morris",
        "printed form"
        if paper
        else "right damping at an interface with tension"
        if has_tension
        else "right damping at a free surface"
        if not filled
        else "isotropic at any smoothing ratio",
    )
    tension_form = choose(
        "tension_form", "body_force" if paper else "pressure_jump", "printed form" if paper else "well balanced"
    )
    zeta = choose("interface_force", 0.08 if paper else 0.0, "printed value" if paper else "phases stay apart without")
    choose("smoothing_ratio", smoothing_ratio(case), "printed value" if paper else "least locking and noise")
    shifting = choose(
        "shifting", SHIFTING if corrected else 0.0, "the corrected gradient needs it" if corrected else "not needed"
    )
    constraint = choose(
        "volume_constraint",
        corrected and filled,
        "the corrected gradient leaves the mean pressure free" if corrected and filled else "not needed",
    )
    held = corrected and filled and float(shifting) > 0
    room = choose(
        "room_rate",
        ROOM_RATE if held else 0.0,
        "density must not drift away from the room that the particles take" if held else "not needed",
    )
    locked = corrected and geometry.arrangement == "lattice"
    choose(
        "unlock",
        UNLOCK if locked else 0.0,
        "a perfect lattice is no start for the corrected gradient" if locked else "not needed",
    )
    dissipation = choose("velocity_dissipation", 1.0, "Riemann problem")
    choose("courant", 0.5, "half of the measured limit of the leapfrog")
    choose("skin", SKIN, "measured optimum of sweeps and rebuilds")
    choices["kernel"] = numerics.kernel
    choices["maximum_step"] = numerics.maximum_step

    ratio = float(choices["smoothing_ratio"])
    h = ratio * case.spacing
    support = h * KERNELS[numerics.kernel].support
    scales, seen = flow_scales(case, geometry, tension, filled)
    wanted, warnings = sound_speeds(case, scales, seen, filled)
    spec = Spec(
        dimension=case.dimension,
        precision=case.precision,
        kernel=numerics.kernel,
        multiphase=len(phases) > 1,
        periodic=tuple(case.periodic),
        walls=geometry.wall_count > 0,
        wall_no_slip=viscous and bool((geometry.wall_slip[geometry.kind == 1] == 0).any()),
        viscosity=str(form) if viscous else "none",
        tension=str(tension_form) if has_tension else "none",
        contact_angle=has_tension
        and geometry.wall_count > 0
        and any(pair.contact_angle is not None and pair.coefficient > 0 for pair in case.surface_tension),
        interface=len(phases) > 1
        and (has_tension or any(gauge.type == "interface_length" for gauge in case.gauges.values())),
        corrected=corrected,
        paper_star=star == "arithmetic" and len(phases) > 1,
        gravity=bool(np.any(gravity != 0)),
        body_force=bool(np.any(np.asarray(case.body_force, dtype=float) != 0)),
        central_force=case.central_force is not None,
        shifting=float(shifting) > 0,
        volume_constraint=bool(constraint),
        room=held and float(room) > 0,
        momentum_constraint=corrected and all(case.periodic) and geometry.wall_count == 0,
        interface_force=float(zeta) > 0 and len(phases) > 1,
        dissipation=float(dissipation) > 0,
        free_surface=not filled,
        row_list=row_list,
    )
    cap = step_limits(case, spec, h, tension)
    check_periods(case, geometry, support * (1.0 + float(choices["skin"])))
    return Physics(
        spec=spec,
        choices=choices,
        reasons=reasons,
        h=h,
        support=support,
        sound_speed=tuple(wanted),
        scales=scales,
        tension=tension,
        step_cap=cap,
        runaway=10.0 * max(max(wanted), scales["velocity"]),
        warnings=tuple(warnings),
        densities=tuple(phase.density for phase in phases),
    )


def has_room(case: Case, geometry: Geometry) -> bool:
    """Return whether the fluid leaves room in the domain, so that it has a free surface."""
    solid = _obstacles_inside(geometry)
    return case.has_open_sides or geometry.fluid_count + solid < math.prod(geometry.lattice.count)


def check_periods(case: Case, geometry: Geometry, list_radius: float) -> None:
    """Refuse a periodic axis on which a particle could be a neighbour of two images of another.

    Raises CaseError.
    """
    problems = []
    lattice = geometry.lattice
    for axis, (low, high, wraps) in enumerate(zip(lattice.lower, lattice.upper, case.periodic, strict=True)):
        if wraps and high - low < 2.0 * list_radius:
            rule = f"a periodic axis must be at least {2.0 * list_radius:.4g} m long, twice the radius of the neighbour list"
            remedy = "enlarge the domain, or lower particle_spacing, numerics.smoothing_ratio or numerics.skin"
            problems.append(Problem(f"domain.boundary.{'xyz'[axis]}", "periodic", f"{high - low:.4g} m: {rule}", remedy))
    if problems:
        raise CaseError(problems)


def _obstacles_inside(geometry: Geometry) -> int:
    """Return how many lattice sites of the domain an obstacle takes."""
    sides = {f"{axis}_{end}" for axis in "xyz" for end in ("lower", "upper")}
    bodies = [n + 1 for n, name in enumerate(geometry.body_names) if name not in sides]
    return int(np.isin(geometry.body, bodies).sum())


def tension_matrix(case: Case) -> np.ndarray:
    """Return the (phases, phases) surface tension [N/m]; the diagonal holds the largest of the row (body-force form)."""
    names = case.phase_names
    matrix = np.zeros((len(names), len(names)))
    for pair in case.surface_tension:
        a, b = (names.index(name) for name in pair.between)
        matrix[a, b] = matrix[b, a] = pair.coefficient
    np.fill_diagonal(matrix, matrix.max(axis=1, initial=0.0))
    return matrix


def contact_matrix(case: Case) -> np.ndarray:
    """Return the (phases, phases) cosine of the contact angle, of the row's phase against the column's; 0: 90 degrees."""
    names = case.phase_names
    matrix = np.zeros((len(names), len(names)))
    for pair in case.surface_tension:
        if pair.contact_angle is not None:
            a, b = (names.index(name) for name in pair.between)
            matrix[a, b] = math.cos(math.radians(pair.contact_angle))
            matrix[b, a] = -matrix[a, b]
    return matrix


def flow_scales(
    case: Case, geometry: Geometry, tension: np.ndarray, filled: bool
) -> tuple[dict[str, float], np.ndarray]:
    """Return the scales of the flow and the pressure [Pa] that each phase sees.

    velocity: largest of start, walls, channel flow driven by the body force, free fall over the fluid's height (free
    surface) and capillary motion; pressure: hydrostatic head, Laplace jump, and what a body force builds up before walls
    and bodies.
    """
    phases = [case.phases[name] for name in case.phase_names]
    fluid = geometry.kind == 0
    position, phase = geometry.position[fluid], geometry.phase[fluid]
    extent = np.ptp(position, axis=0) + case.spacing if len(position) else np.ones(case.dimension)
    g = np.asarray(case.gravity, dtype=float)
    head = float(np.abs(g) @ extent)  # g H, m^2/s^2
    density = np.array([p.density for p in phases])
    seen = np.zeros(len(phases))
    if head > 0:
        # pressure at the bottom of each phase, from the weight of all fluid above it
        axis = int(np.argmax(np.abs(g)))
        up = -np.sign(g[axis]) * position[:, axis]
        layer = np.round((up - up.min()) / case.spacing).astype(int)
        area = np.prod(extent) / extent[axis]
        weight = np.bincount(layer, weights=density[phase] * geometry.volume[fluid], minlength=layer.max() + 1)
        # a column no denser than the mean of its layer; free surfaces make it an upper bound near the deepest part
        filled_area = np.bincount(layer, weights=geometry.volume[fluid], minlength=layer.max() + 1) / case.spacing
        mean = weight / np.maximum(filled_area, 1e-300 + area * 1e-6)
        above = np.cumsum(mean[::-1])[::-1] * abs(g[axis])
        for k in range(len(phases)):
            rows = layer[phase == k]
            if len(rows):
                seen[k] = above[rows.min()]
    jump = 0.0
    capillary = 0.0
    for a in range(len(phases)):
        for b in range(a + 1, len(phases)):
            if tension[a, b] > 0:
                volume = min(geometry.volume[fluid][phase == a].sum(), geometry.volume[fluid][phase == b].sum())
                if case.dimension == 2:
                    r = math.sqrt(volume / math.pi)
                else:
                    r = (0.75 * volume / math.pi) ** (1 / 3)
                if r > 0:
                    here = (case.dimension - 1) * tension[a, b] / r
                    capillary = max(capillary, math.sqrt(2 * here / (density[a] + density[b])))
                    jump = max(jump, here, CORNER * tension[a, b] / (smoothing_ratio(case) * case.spacing))
    seen += jump + float(density.max()) * _dammed_head(case, geometry, extent)
    speed = float(np.sqrt((geometry.velocity[fluid] ** 2).sum(axis=1)).max(initial=0.0))
    wall_speed = float(np.sqrt((geometry.boundary_velocity**2).sum(axis=1)).max(initial=0.0))
    for sides in case.sides:  # of mirrors, which are no particles
        wall_speed = max(wall_speed, *(float(np.linalg.norm(end.velocity or 0.0)) for end in (sides.lower, sides.upper)))
    length = float(extent.min())
    driven = 0.0
    drive = float(np.linalg.norm(case.body_force))
    if drive > 0:
        nu = min((p.viscosity / p.density for p in phases if p.viscosity > 0), default=0.0)
        driven = min(drive * length**2 / (8 * nu) if nu > 0 else math.inf, math.sqrt(drive * float(extent.max())))
    falling = 0.0 if filled else math.sqrt(2 * head)
    pulled = 0.0
    if case.central_force is not None and not filled:
        far = float(np.linalg.norm(position - np.asarray(case.central_force.center), axis=1).max(initial=0.0))
        pulled = case.central_force.rate * far
    guessed = max(speed, wall_speed, driven, falling, pulled, capillary)
    scales = {
        "velocity": guessed if case.scales.velocity == "auto" else float(case.scales.velocity),
        "length": length if case.scales.length == "auto" else float(case.scales.length),
        "pressure": float(seen.max()) if case.scales.pressure == "auto" else float(case.scales.pressure),
    }
    if case.scales.pressure != "auto":
        seen = np.full(len(phases), scales["pressure"])
    return scales, seen


def _dammed_head(case: Case, geometry: Geometry, extent: np.ndarray) -> float:
    """Return f L [m^2/s^2], the pressure over density that a body force f makes where something stands in its way.

    Along a periodic axis it drives a flow and no pressure, unless a body holds that up: the drop over a period is rho f L.
    """
    held = [not wraps or bool(case.obstacles) for wraps in case.periodic]
    return float(np.where(held, np.abs(np.asarray(case.body_force, dtype=float)), 0.0) @ extent)


def heavy(case: Case) -> bool:
    """Return whether gravity acts."""
    return bool(np.any(np.asarray(case.gravity, dtype=float) != 0))


def needed_sound_speeds(case: Case, scales: dict[str, float], seen: np.ndarray, filled: bool) -> list[float]:
    """Return the least sound speed of each phase [m/s] (theory: riemann#a1).

    c_k^2 >= max(U^2, p_k/rho_k, 0.01 p_max/rho_k, mu_k U/(rho_k L)) / 0.01, p_k the pressure that phase k sees; p_k / 4
    under gravity for a light phase whose volume its start pressure holds, or a closed domain that is full (`filled`).
    """
    velocity, length = scales["velocity"], scales["length"]
    largest = float(seen.max(initial=0.0))
    densest = max(case.phases[name].density for name in case.phase_names)
    held = heavy(case) and (filled or case.start.pressure is not None)
    result = []
    for name, pressure in zip(case.phase_names, seen, strict=True):
        phase = case.phases[name]
        share = LIGHT_COMPRESSION / COMPRESSION if held and phase.density < LIGHT * densest else 1.0
        square = max(
            velocity**2,
            float(pressure) / (share * phase.density),
            SHARED_PRESSURE * largest / phase.density,
            phase.viscosity * velocity / (phase.density * length) if length > 0 else 0.0,
        )
        result.append(math.sqrt(square / COMPRESSION))
    return result


def sound_speeds(
    case: Case, scales: dict[str, float], seen: np.ndarray, filled: bool
) -> tuple[list[float], list[str]]:
    """Return the sound speed of each phase [m/s], and a warning for each given one that is too low."""
    needed = needed_sound_speeds(case, scales, seen, filled)
    # A dense phase may be stiffer at no cost as long as its sound is no faster.
    fastest, light = max(needed), min(case.phases[name].density for name in case.phase_names)
    lifted = [
        max(c, min(fastest, fastest * math.sqrt(STIFFER[heavy(case)] * light / case.phases[name].density)))
        for name, c in zip(case.phase_names, needed, strict=True)
    ]
    floor = max(needed) if max(needed) > 0 else 1.0
    result, warnings = [], []
    for name, least, chosen in zip(case.phase_names, needed, lifted, strict=True):
        given = case.phases[name].sound_speed
        if given == "auto":
            result.append(chosen if chosen > 0 else floor)
            continue
        result.append(float(given))
        # half of the square is still a few per cent of compression: worth a word only beyond that
        if float(given) < least / math.sqrt(2):
            warnings.append(
                f"phases.{name}.sound_speed: {float(given):g} m/s is too low for what the scene will see "
                f"(speed {scales['velocity']:.3g} m/s, pressure {scales['pressure']:.3g} Pa): density would vary by more "
                f"than a few per cent; use at least {least:.4g} m/s or `auto`"
            )
    return result, warnings


def step_limits(case: Case, spec: Spec, h: float, tension: np.ndarray) -> dict[str, float]:
    """Return the constant limits of the time step [s] by name (theory: riemann#a9)."""
    phases = [case.phases[name] for name in case.phase_names]
    limits: dict[str, float] = {}
    if spec.viscosity != "none":
        # kinematic viscosity that the lighter partner of any pair feels
        nu = 0.0
        for a in phases:
            for b in phases:
                if a.viscosity + b.viscosity > 0:
                    mu = a.viscosity if a is b else 2 * a.viscosity * b.viscosity / (a.viscosity + b.viscosity)
                    nu = max(nu, mu / a.density)
        if nu > 0:
            limits["viscosity"] = VISCOUS_LIMIT[spec.viscosity] * h * h / nu
    if spec.tension != "none":
        limit = math.inf
        for i, a in enumerate(phases):
            for j, b in enumerate(phases):
                if i != j and tension[i, j] > 0:
                    # capillary waves move both phases
                    rho = 0.5 * (a.density + b.density)
                    limit = min(limit, 0.25 * math.sqrt(rho * h**3 / (2 * math.pi * tension[i, j])))
        limits["surface tension"] = limit
    if case.numerics.maximum_step is not None:
        limits["maximum_step"] = float(case.numerics.maximum_step)
    return limits
