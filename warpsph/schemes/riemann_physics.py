"""Numbers of a run with the Riemann scheme: what `auto` comes to, the structure, sound speeds, limits of the time step.

Everything a user may leave `auto` is decided here, from the physics given, and shown by `warpsph show`.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from warpsph.case.domain import AXES
from warpsph.errors import CaseError, Problem
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.riemann.disorder import AS_VISCOUS
from warpsph.scene.fluid_regions import LIGHT
from warpsph.scene.forcing import forcing_of
from warpsph.scene.open_faces import open_axis, open_sides
from warpsph.scene.physics import (
    VISCOUS_LIMIT,
    Physics,
    check_periods,
    contact_matrix,
    flow_scales,
    has_room,
    smoothing_ratio,
    tension_matrix,
    turning_rate,
)
from warpsph.schemes.flow_through import check_filled
from warpsph.schemes.onsets import DEAD, dying, motion_onset, tension_onset
from warpsph.schemes.viscous_steps import reach, worth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry
    from warpsph.schemes.riemann_numerics import RiemannNumerics

# Mach number squared that a weakly compressible fluid may reach: density varies by about 1 %.
COMPRESSION = 0.01
# The same for the pressure that a phase sees which is lighter than LIGHT times the densest: it starts with the density of
# its start pressure, or shares a closed domain with a stiffer phase, so that its volume follows the *change* of the pressure
# alone, a fraction of what it sees. Its sound sets the time step.
LIGHT_COMPRESSION = 0.04
# Share of the scene's pressure range that a phase must carry even where it sees little of it itself.
SHARED_PRESSURE = 0.01
# Stiffness rho c^2 that a dense phase gets against the lightest one at least: under a pressure that they share it gives way
# by a tenth as much. 5 and 20 make the same of all cases (docs/records/sound.md).
LEAST_STIFFER = 10.0
# Shift of a step over h^2 |grad v| dt sum grad W V: how much faster particles are evened out than the flow disorders them.
SHIFTING = 16.0
# Rate, over |grad v|, at which the density follows the room that the particles take: 1 to 3 differ little.
ROOM_RATE = 2.0
SURFACE_ROOM_RATE = 0.25  # the same over the shear rate, where the fluid has a free surface: more makes noise
# Displacement that breaks the symmetry of a lattice, in particle spacings: for the corrected gradient a perfect lattice
# that is sheared is a balance on a knife's edge, which ends in voids.
UNLOCK = 0.05
# Step of friction in stages over L^2/nu where `auto` chooses their number: half of it changes the start of a channel flow by
# 0.05 % of its speed, six times as much by 1 % (docs/records/shear.md).
CHANGE = 0.002
# Stiffness m of the part of the pressure that fades, over that of the rest, where tension, or velocities of the start,
# alone make the pressures at once: the sound of a start is gone, to 1 %, after the time 18.4/(pi m) L/c; a step is shorter
# by sqrt(1 + m) until then (docs/records/sound.md).
RELAXATION = 1.0
# The same to the end of a run in which bodies move: what their accelerations send out dies to 1 % in 23 crossings.
MOVING_RELAXATION = 0.25
# Radians that a flow turns by until the sound of a tension that sets in at once has died to 1 % (theory: riemann#a1).
QUIET = 0.25
# Bulk viscosity over rho c h: double of it damps little more, four times as much is beyond what walls with a fit bear
# (docs/records/open_boundaries.md).
DAMPING = 0.25
# Friction of disorder over |grad v| h: 2 and 8 on record (docs/records/sound.md#disorder).
DISORDER = 4.0
COURANT = 0.5  # time step over h/(c + u): half of the measured limit of the leapfrog (theory: riemann#a9)
CAPILLARY = 0.25  # time step over sqrt(rho h^3/(2 pi sigma)), the time scale of capillary waves of the length of h


def derive(case: Case, geometry: Geometry, row_list: bool = True) -> Physics:
    """Return the physics of a case of the Riemann scheme whose particles are known; see `physics.derive`."""
    numerics = case.numerics
    paper = numerics.formulation == "paper"
    names = case.phase_names
    phases = [case.phases[name] for name in names]
    filled = not has_room(case, geometry)
    check_filled(case, filled)
    tension = tension_matrix(case)
    has_tension = bool((tension > 0).any())
    forcing = forcing_of(case)
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
        "paper" if paper else "morris" if filled else "isotropic",
        "printed form"
        if paper
        else "isotropic at any smoothing ratio"
        if filled
        else "right damping at a free surface, along rows as across them",
    )
    tension_form = choose(
        "tension_form", "body_force" if paper else "pressure_jump", "printed form" if paper else "well balanced"
    )
    zeta = choose("interface_force", 0.08 if paper else 0.0, "printed value" if paper else "phases stay apart without")
    choose("smoothing_ratio", smoothing_ratio(case), "printed value" if paper else "least locking and noise")
    shifting = choose(
        "shifting", SHIFTING if corrected else 0.0, "the corrected gradient needs it" if corrected else "not needed"
    )
    closed = filled and not case.has_flow_through
    constraint = choose(
        "volume_constraint",
        corrected and closed,
        "the corrected gradient leaves the mean pressure free" if corrected and closed else "not needed",
    )
    held = corrected and filled and float(shifting) > 0
    followed = held or not (filled or paper)
    room = choose(
        "room_rate",
        ROOM_RATE if held else SURFACE_ROOM_RATE if followed else 0.0,
        "density must not drift away from the room that the particles take" if followed else "not needed",
    )
    locked = corrected and geometry.arrangement == "lattice"
    choose(
        "unlock",
        UNLOCK if locked else 0.0,
        "a perfect lattice is no start for the corrected gradient" if locked else "not needed",
    )
    dissipation = choose("velocity_dissipation", 1.0, "Riemann problem")
    moves_freely = not (filled or paper) and len(phases) == 1
    why = "fluid under a free surface may turn and fall" if moves_freely else "several fluids, no free surface or printed"
    spared = choose("spared_gradient", "acceleration" if moves_freely else "gravity", why)
    if spared == "acceleration" and (filled or len(phases) > 1):
        rule = "is for one fluid with a free surface"
        raise CaseError([Problem("numerics.spared_gradient", spared, rule, "write auto or gravity")])
    ringing = case.has_flow_through and corrected
    reason = "sound of a start between inlets and outlets dies out" if ringing else "not needed"
    damping = choose("acoustic_damping", DAMPING if ringing else 0.0, reason)
    choose("courant", 1.0 if paper else COURANT, "printed value" if paper else "half of the measured limit of the leapfrog")
    choose("skin", case.scheme.skin, "measured optimum of sweeps and rebuilds")
    choices["kernel"] = numerics.kernel
    choices["maximum_step"] = numerics.maximum_step

    ratio = float(choices["smoothing_ratio"])
    h = ratio * case.spacing
    support = h * KERNELS[numerics.kernel].support
    scales, seen = flow_scales(case, geometry, tension, filled)
    lengths = phase_lengths(case, geometry)
    onset = tension_onset(case, geometry, tension)
    often = crossings(onset) * (turning_rate(case, geometry, tension, scales) if len(phases) > 1 else 0.0)
    wanted, warnings = sound_speeds(case, scales, seen, filled, [often * size for size in lengths])
    share, reason = 0.0, "not needed"
    relaxes = corrected and not paper and not case.has_flow_through
    if relaxes:
        if onset > COMPRESSION:
            share, reason = onset, "tension sets in at once: the sound of that share of the pressures dies"
        else:
            motion = motion_onset(case, geometry, tension, COMPRESSION)
            if motion > COMPRESSION:
                share, reason = motion, "the start has velocities without their pressures: the sound of those dies"
    sounding = relaxes and bool(forcing.tracks)
    if sounding and RELAXATION * share < MOVING_RELAXATION:
        share, reason = MOVING_RELAXATION / RELAXATION, "bodies that move send out sound all the time"
    calm = viscosity_is_enough(case, wanted, h)
    disorder = choose(
        "disorder_friction",
        0.0 if paper or calm else DISORDER,
        "printed form" if paper else "viscosity is enough" if calm else "disorder is evened, smooth flow is not",
    )
    relaxed = float(choose("acoustic_relaxation", RELAXATION * share, reason))
    frozen = math.sqrt(1.0 + relaxed)  # speed of the fastest sound over that of slow pressures
    wave = longest_wave(lengths, wanted)
    choose("relaxation_time", wave, "the longest wave dies out fastest")
    over = dying(relaxed, wave) if relaxed > 0 and "acoustic_relaxation" in reasons and not sounding else None
    choose("relaxation_end", over, "the sound of the start is gone" if over else "never")
    fitted = fitted_walls(case, geometry)
    if float(damping) > 0 and fitted and not corrected:
        rule = "beside bodies needs the corrected pressure gradient: their pressure differences drive the density else"
        raise CaseError([Problem("numerics.acoustic_damping", damping, rule, "write auto or 0")])
    angles = has_tension and geometry.wall_count > 0 and not paper
    sticky = viscous and bool((geometry.wall_slip[geometry.kind == 1] == 0).any())
    gravity = bool(np.any(forcing.hydrostatic() != 0))
    weighed = gravity or bool(forcing.tracks) or case.central_force is not None
    kinked = corrected and star != "arithmetic" and weighed and len({phase.density for phase in phases}) > 1
    spec = Spec(
        dimension=case.dimension,
        precision=case.precision,
        kernel=numerics.kernel,
        multiphase=len(phases) > 1,
        periodic=tuple(case.periodic),
        walls=geometry.wall_count > 0,
        bodies=fitted,
        own_sides=fitted and sticky and filled and len(phases) == 1,
        wall_sound=fitted and corrected and len(phases) == 1,
        tails=fitted and geometry.surface is not None and geometry.surface.frames.count > 0,
        wall_no_slip=sticky,
        viscosity=str(form) if viscous else "none",
        unlike_viscosity=viscous and star != "arithmetic" and len({phase.viscosity for phase in phases}) > 1,
        tension=str(tension_form) if has_tension else "none",
        kinked=kinked,
        triple=len(phases) if tension_form == "pressure_jump" and not paper and has_triple_points(tension) else 0,
        contact_angle=angles,
        leaning=angles and bool(np.any(contact_matrix(case) != 0)),
        interface=len(phases) > 1
        and (has_tension or kinked or any(gauge.type == "interface_length" for gauge in case.gauges.values())),
        corrected=corrected,
        paper_star=star == "arithmetic" and len(phases) > 1,
        printed=paper,
        gravity=gravity,
        body_force=bool(np.any(forcing.driving() != 0)),
        varying_force=forcing.varying_force,
        varying_sides=forcing.varying_sides,
        moving=bool(forcing.tracks),
        central_force=case.central_force is not None,
        shifting=float(shifting) > 0,
        volume_constraint=bool(constraint),
        room=held and float(room) > 0,
        surface_room=not filled and not paper and float(room) > 0,
        momentum_axes=momentum_axes(case) if corrected and not sticky else (),
        interface_force=float(zeta) > 0 and len(phases) > 1,
        dissipation=float(dissipation) > 0,
        inertia=spared == "acceleration" and float(dissipation) > 0,
        acoustic_damping=float(damping) > 0,
        disorder=float(disorder) > 0,
        relaxation=relaxed > 0,
        free_surface=not filled,
        changing=case.has_flow_through,
        open_axis=open_axis(case),
        sponge=any(flow.sponge is not None for _, _, _, flow in open_sides(case)),
        row_list=row_list,
    )
    sound = float(choices["courant"]) * h / (frozen * max(wanted) + scales["velocity"])
    explicit = {**step_limits(case, spec, h, tension), "sound": sound}
    change = friction_change(spec, explicit, h, scales["length"])
    stages, reason = friction_stages(case, spec, {**explicit, **change})
    choices["viscous_stages"] = stages
    if reason:
        reasons["viscous_stages"] = reason
    spec = dataclasses.replace(spec, viscous_stages=stages)
    cap = step_limits(case, spec, h, tension) | (change if reason and stages > 1 else {})
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
        acoustic=frozen * max(wanted),
    )


def needed_sound_speeds(
    case: Case, scales: dict[str, float], seen: np.ndarray, filled: bool
) -> list[float]:
    """Return the least sound speed of each phase [m/s] (theory: riemann#a1).

    c_k^2 >= max(U^2, p_k/rho_k, 0.01 p_max/rho_k, mu_k U/(rho_k L), mu_k U_c/(rho_k h)) / 0.01, p_k the pressure that
    phase k sees; p_k / 4 for a light phase whose volume its start pressure holds, or a closed domain that is full
    (`filled`); U_c the speed of sides in corners.
    """
    velocity, length = scales["velocity"], scales["length"]
    scraping = corner_speed(case) / (smoothing_ratio(case) * case.spacing)
    largest = float(seen.max(initial=0.0))
    densest = max(case.phases[name].density for name in case.phase_names)
    held = filled or case.start.pressure not in (None, "auto")
    result = []
    for name, pressure in zip(case.phase_names, seen, strict=True):
        phase = case.phases[name]
        share = LIGHT_COMPRESSION / COMPRESSION if held and phase.density < LIGHT * densest else 1.0
        square = max(
            velocity**2,
            float(pressure) / (share * phase.density),
            SHARED_PRESSURE * largest / phase.density,
            phase.viscosity * velocity / (phase.density * length) if length > 0 else 0.0,
            phase.viscosity * scraping / phase.density,
        )
        result.append(math.sqrt(square / COMPRESSION))
    return result


def corner_speed(case: Case) -> float:
    """Return the largest speed with which a side slides towards a wall, or away from one, at the end of it [m/s].

    Friction makes a pressure of mu U/r in such a corner, of the other sign where it slides away (Taylor 1962).
    """
    largest = 0.0
    forcing = forcing_of(case)
    for number, side in enumerate(forcing.sides):
        for axis, speed in enumerate(forcing.largest(side)):
            ends = case.sides[axis]
            if axis != number // 2 and "wall" in (ends.lower.kind, ends.upper.kind):
                largest = max(largest, abs(float(speed)))
    return largest


def sound_speeds(
    case: Case, scales: dict[str, float], seen: np.ndarray, filled: bool, crossed: Sequence[float]
) -> tuple[list[float], list[str]]:
    """Return the sound speed of each phase [m/s], and a warning for each given one that is too low.

    seen: pressure that each phase sees [Pa]; crossed: speed at which each phase is crossed often enough [m/s].
    """
    needed = needed_sound_speeds(case, scales, seen, filled)
    densities = [case.phases[name].density for name in case.phase_names]
    # A phase may be stiffer at no cost as long as its sound is no faster than that of the others: it gives way less than the
    # lightest, or sound crosses it often while the flow turns.
    fastest, light = max(needed), min(densities)
    lifted = [
        max(c, min(fastest, max(fastest * math.sqrt(LEAST_STIFFER * light / rho), speed)))
        for c, rho, speed in zip(needed, densities, crossed, strict=True)
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


def viscosity_is_enough(case: Case, sound: Sequence[float], h: float) -> bool:
    """Return whether viscosity does more than the friction of disorder even where all of the velocity changes over h [m].

    sound: speed of sound of each phase [m/s]; a tenth of it is as fast as it flows.
    """
    fastest = math.sqrt(COMPRESSION)
    phases = [case.phases[name] for name in case.phase_names]
    return all(
        DISORDER * fastest * c * h <= AS_VISCOUS * phase.viscosity / phase.density
        for c, phase in zip(sound, phases, strict=True)
    )


def momentum_axes(case: Case) -> tuple[int, ...]:
    """Return the periodic axes along which nothing but gravity and body forces pushes the fluid as a whole.

    Walls push along none of them if they are sides of the domain without friction: what a contact line takes at one edge of
    a fluid it gives at the other.
    """
    if case.bodies or case.has_flow_through or case.central_force is not None:
        return ()
    sides = [getattr(case.domain.boundary, name) for name in AXES[: case.dimension]]
    if any(side.kind == "open" for both in sides for side in (both.lower, both.upper)):
        return ()
    return tuple(axis for axis, periodic in enumerate(case.periodic) if periodic)


def has_triple_points(tension: np.ndarray) -> bool:
    """Return whether there are three phases or more, and tensions between at least two pairs, as a matrix [N/m]."""
    return len(tension) > 2 and int(np.count_nonzero(np.triu(tension, 1) > 0)) > 1


def crossings(onset: float) -> float:
    """Return how often sound crosses a phase while the flow turns by a radian: 10, more by the share of an onset."""
    enough = 1.0 / math.sqrt(COMPRESSION)
    quiet = 4.0 * math.log(1.0 / DEAD) / (math.pi * RELAXATION * QUIET)
    return enough + onset * (quiet - enough)


def phase_lengths(case: Case, geometry: Geometry) -> list[float]:
    """Return the longest side of each phase [m], 0 for one without particles."""
    fluid = geometry.kind == 0
    position, phase = geometry.position[fluid], geometry.phase[fluid]
    found = [position[phase == k] for k in range(len(case.phase_names))]
    return [float((np.ptp(rows, axis=0) + case.spacing).max()) if len(rows) else 0.0 for rows in found]


def longest_wave(lengths: list[float], sound: list[float]) -> float:
    """Return the time [s] in which the slowest of the longest waves of phases turns by one radian.

    lengths: longest side [m], sound: speed of sound [m/s] of each phase (theory: riemann#relaxation).
    """
    return max(length / (math.pi * c) for length, c in zip(lengths, sound, strict=True))


def step_limits(case: Case, spec: Spec, h: float, tension: np.ndarray) -> dict[str, float]:
    """Return the constant limits of the time step [s] by name (theory: riemann#a9)."""
    if spec.printed:
        return printed_limits(case, spec, h, tension)
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
            limits["viscosity"] = reach(spec.viscous_stages) * VISCOUS_LIMIT[spec.viscosity] * h * h / nu
    if spec.tension != "none":
        limit = math.inf
        for i, a in enumerate(phases):
            for j, b in enumerate(phases):
                if i != j and tension[i, j] > 0:
                    # capillary waves move both phases
                    rho = 0.5 * (a.density + b.density)
                    limit = min(limit, CAPILLARY * math.sqrt(rho * h**3 / (2 * math.pi * tension[i, j])))
        limits["surface tension"] = limit
    if case.numerics.maximum_step is not None:
        limits["maximum_step"] = float(case.numerics.maximum_step)
    return limits


def printed_limits(case: Case, spec: Spec, h: float, tension: np.ndarray) -> dict[str, float]:
    """Return the constant limits of the time step [s] by name, as printed: eqs (29) and (30) (theory: printed#yang).

    0.125 rho h^2/mu and 0.5 sqrt(rho h^3/(2 pi sigma)), the least of the phases, each with its own density.
    """
    limits: dict[str, float] = {}
    phases = [case.phases[name] for name in case.phase_names]
    if spec.viscosity != "none":
        limits["viscosity"] = min(0.125 * a.density * h * h / a.viscosity for a in phases if a.viscosity > 0)
    if spec.tension != "none":
        coefficient, rho = float(tension.max()), min(a.density for a in phases)
        limits["surface tension"] = 0.5 * math.sqrt(rho * h**3 / (2 * math.pi * coefficient))
    if case.numerics.maximum_step is not None:
        limits["maximum_step"] = float(case.numerics.maximum_step)
    return limits


def friction_change(spec: Spec, limits: dict[str, float], h: float, length: float) -> dict[str, float]:
    """Return the step [s] up to which friction in stages follows a flow of a length [m] that starts or stops, by name.

    limits: of the time step by name, that of explicit friction among them [s]; h: smoothing length [m].
    """
    if "viscosity" not in limits:
        return {}
    friction = limits["viscosity"]
    return {"change by friction": max(CHANGE * (length / h) ** 2 / VISCOUS_LIMIT[spec.viscosity], 1.0) * friction}


def friction_stages(case: Case, spec: Spec, limits: dict[str, float]) -> tuple[int, str]:
    """Return the stages of friction in a step, and why so many where the case leaves it open (theory: riemann#stages).

    limits: of the time step by name, that of explicit friction among them [s].

    Raises:
        CaseError: the case asks for stages that walls with a surface of their own do not have.
    """
    given = cast("RiemannNumerics", case.numerics).viscous_stages
    friction = limits.get("viscosity", math.inf)
    longest, what = min((limit, name) for name, limit in limits.items() if name != "viscosity")
    if given != "auto":
        if int(given) > 1 and spec.bodies:
            rule = "needs walls that are sides of the domain or whole cells at rest: others answer friction with a fit"
            raise CaseError([Problem("numerics.viscous_stages", given, rule, "write auto or 1")])
        return (int(given) if spec.viscosity != "none" else 1), ""
    if spec.printed:
        return 1, ""
    if spec.viscosity == "none" or spec.bodies or spec.open_axis >= 0:
        return 1, "no viscosity, or bodies, inlets or outlets"
    return worth(longest / friction), f"explicit friction allows steps of {friction:.3g} s, {what} of {longest:.3g} s"


def fitted_walls(case: Case, geometry: Geometry) -> bool:
    """Whether the walls have a surface of their own: where there are bodies, with two exceptions in which walls are cells.

    Both are for bodies of whole cells that stay where they are. In several fluids they hold small drops of one fluid off
    their corners, where a fit knows no corner; between inlets and outlets the eddy behind such a corner is nearer to what
    others have found.
    """
    moving = any(body.motion is not None for body in case.bodies.values())
    if geometry.cut or moving:
        return True
    return bool(case.bodies) and len(case.phases) == 1 and open_axis(case) < 0
