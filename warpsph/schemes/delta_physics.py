"""Numbers of a run with delta-plus-SPH: what `auto` comes to, the structure, sound speed, limits of the time step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import CaseError, Problem
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.core.spec import Spec
from warpsph.scene.forcing import forcing_of
from warpsph.scene.open_faces import open_axis, open_sides
from warpsph.scene.physics import VISCOUS_LIMIT, Physics, check_periods, flow_scales, has_room, smoothing_ratio
from warpsph.schemes.delta_numerics import DeltaNumerics
from warpsph.schemes.flow_through import check_filled
from warpsph.schemes.riemann_physics import MOVING_RELAXATION, fitted_walls, longest_wave, phase_lengths, sound_speeds

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry

COURANT, RK4_COURANT = 0.5, 1.25
DIFFUSION = 0.1
# A of the shift: 2 is that of Sun et al. 2017 and 2019, which leaves vortices that begin on a lattice disordered.
SHIFTING, PRINTED_SHIFTING = 8.0, 2.0
ROOM_RATE = 2.0
DAMPING = 0.25  # of sound, its bulk viscosity over rho c h; half and double: docs/theory/constants.md
ALPHA = 0.02  # artificial viscosity of inviscid flow with a free surface (Antuono et al. 2010)


def derive(case: Case, geometry: Geometry, row_list: bool) -> Physics:
    """Return the physics of a delta-plus case whose particles are known; see `physics.derive`."""
    numerics = case.numerics
    assert isinstance(numerics, DeltaNumerics)
    paper = numerics.formulation == "paper"
    filled = not has_room(case, geometry)
    check_filled(case, filled)
    forcing = forcing_of(case)
    phase = case.phases[case.phase_names[0]]
    choices: dict[str, Any] = {}
    reasons: dict[str, str] = {}

    def choose(key: str, automatic: Any, reason: str) -> Any:
        given = getattr(numerics, key)
        choices[key] = automatic if given == "auto" else given
        if given == "auto":
            reasons[key] = reason
        return choices[key]

    choose("pressure_gradient", "conservative", "of the scheme")
    reason = "printed form" if paper else "isotropic" if filled else "right damping at a free surface"
    form = choose("viscosity_form", "radial" if paper else "morris" if filled else "isotropic", reason)
    choose("smoothing_ratio", smoothing_ratio(case), "of the scheme")
    shifting = choose(
        "shifting",
        SHIFTING if filled and not paper else PRINTED_SHIFTING,
        "printed value" if paper else "breaks up the rows of strained particles" if filled else "more lifts free surfaces",
    )
    shift_form = choose("shift_form", "positions" if paper else "consistent", "printed form" if paper else "fields stay put")
    choose("unlock", 0.0, "not needed")
    varying = forcing.varying_force or forcing.varying_sides or bool(forcing.tracks)
    printed = paper and not varying and not case.has_flow_through
    reason = "printed form" if printed else "as accurate, and faster"
    rk4 = choose("integrator", "rk4" if printed else "leapfrog", reason) == "rk4"
    if rk4 and varying:
        rule = "does not know gravity, walls or bodies that depend on time"
        raise CaseError([Problem("numerics.integrator", "rk4", rule, "write leapfrog, or auto")])
    choose("courant", RK4_COURANT if rk4 else COURANT, "half of the limit of rk4" if rk4 else "a third of the limit")
    diffusion = choose("density_diffusion", DIFFUSION, "of the scheme")
    exact = choose(
        "exact_divergence",
        filled and not paper,
        "printed form" if paper else "the fluid fills the domain" if filled else "a free surface",
    )
    closed = filled and not case.has_flow_through
    reason = "holds the mean pressure of a full domain" if closed else "a free surface, or inlets and outlets"
    held = choose("volume_constraint", closed and not paper, "printed form" if paper else reason)
    reason = "printed form" if paper else "held by the whole domain" if closed else "nothing else holds the volume"
    room = choose("room_rate", 0.0 if paper or closed else ROOM_RATE, reason)
    reason = "printed form" if paper else "a full domain does not tear" if filled else "particles under tension do not clump"
    control = choose("tension_control", "gaps" if filled and not paper else True, reason)
    reason = "printed form" if paper else "rk4 knows none" if rk4 else "sound of splashes and starts dies out"
    damping = float(choose("acoustic_damping", 0.0 if paper or rk4 else DAMPING, reason))
    if rk4 and damping > 0:
        rule = "is a pressure of the last divergence, which integrator: rk4 has none of at its stages"
        raise CaseError([Problem("numerics.acoustic_damping", damping, rule, "write auto or 0, or integrator: leapfrog")])
    sounding = closed and bool(forcing.tracks) and not paper
    reason = "bodies that move send out sound all the time" if sounding else "not needed"
    relaxed = float(choose("acoustic_relaxation", MOVING_RELAXATION if sounding else 0.0, reason))
    if rk4 and relaxed > 0:
        rule = "is a pressure that remembers the last step, which integrator: rk4 has not at its stages"
        raise CaseError([Problem("numerics.acoustic_relaxation", relaxed, rule, "write auto or 0, or integrator: leapfrog")])
    frozen = math.sqrt(1.0 + relaxed)  # speed of the fastest sound over that of slow pressures
    alpha = choose("artificial_viscosity", 0.0 if filled else ALPHA, "no free surface" if filled else "a free surface")
    choose("skin", case.scheme.skin, "measured optimum of sweeps and rebuilds")
    choices["kernel"] = numerics.kernel
    choices["maximum_step"] = numerics.maximum_step

    h = float(choices["smoothing_ratio"]) * case.spacing
    support = h * KERNELS[numerics.kernel].support
    scales, seen = flow_scales(case, geometry, np.zeros((1, 1)), filled)
    sound, warnings = sound_speeds(case, scales, seen, filled, [0.0])
    choose("relaxation_time", longest_wave(phase_lengths(case, geometry), sound), "the longest wave dies out fastest")
    viscous = phase.viscosity > 0
    sticky = viscous and bool((geometry.wall_slip[geometry.kind == 1] == 0).any())
    # sides of the domain are continued as bodies are; the printed scheme has cells
    flat = not paper and not case.bodies and geometry.surface is not None
    fitted = flat or fitted_walls(case, geometry)
    choices["artificial"] = max(
        float(alpha) * h * sound[0] * phase.density / (2 * (case.dimension + 2)) - phase.viscosity, 0.0
    )
    spec = Spec(
        dimension=case.dimension,
        precision=case.precision,
        kernel=numerics.kernel,
        periodic=tuple(case.periodic),
        walls=geometry.wall_count > 0,
        bodies=fitted,
        flat_walls=flat,
        own_sides=sticky and fitted and filled and not flat,
        dry_walls=fitted and not filled and not paper,
        wall_sound=fitted and not rk4,  # whose walls are of the moment of each part of a step anyway
        tails=fitted and geometry.surface is not None and geometry.surface.frames.count > 0,
        wall_no_slip=sticky,
        viscosity=str(form) if viscous else "none",
        gravity=bool(np.any(forcing.hydrostatic() != 0)),
        body_force=bool(np.any(forcing.driving() != 0)),
        varying_force=forcing.varying_force,
        varying_sides=forcing.varying_sides,
        moving=bool(forcing.tracks),
        central_force=case.central_force is not None,
        shifting=float(shifting) > 0,
        free_surface=not filled,
        scheme="delta_plus",
        density_diffusion=float(diffusion) > 0,
        exact_divergence=bool(exact),
        acoustic_damping=damping > 0,
        relaxation=relaxed > 0,
        tension_control=control if isinstance(control, str) else "inside" if control else "",
        volume_constraint=bool(held),
        room=float(room) > 0,
        artificial_viscosity=choices["artificial"] > 0,
        budget=any(gauge.type == "budget" for gauge in case.gauges.values()),
        runge_kutta=rk4,
        shift_form=str(shift_form) if float(shifting) > 0 else "",
        shift_ahead=float(shifting) > 0,
        changing=case.has_flow_through,
        open_axis=open_axis(case),
        sponge=any(flow.sponge is not None for _, _, _, flow in open_sides(case)),
        row_list=row_list,
    )
    check_periods(case, geometry, support * (1.0 + float(choices["skin"])))
    return Physics(
        spec=spec,
        choices=choices,
        reasons=reasons,
        h=h,
        support=support,
        sound_speed=tuple(sound),
        scales=scales,
        tension=np.zeros((1, 1)),
        step_cap=step_limits(case, spec, h, choices["artificial"]),
        runaway=10.0 * max(sound[0], scales["velocity"]),
        warnings=tuple(warnings),
        densities=(phase.density,),
        acoustic=frozen * sound[0],
    )


def step_limits(case: Case, spec: Spec, h: float, artificial: float) -> dict[str, float]:
    """Return the constant limits of the time step [s] by name; `artificial`: viscosity beside that of the phase [Pa s]."""
    phase = case.phases[case.phase_names[0]]
    limits: dict[str, float] = {}
    form = VISCOUS_LIMIT["radial"] if artificial > 0 or spec.viscosity == "none" else VISCOUS_LIMIT[spec.viscosity]
    if phase.viscosity + artificial > 0:
        limits["viscosity"] = form * h * h * phase.density / (phase.viscosity + artificial)
    if case.numerics.maximum_step is not None:
        limits["maximum_step"] = float(case.numerics.maximum_step)
    return limits
