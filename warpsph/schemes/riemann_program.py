"""Riemann multiphase SPH: one kick-drift-kick step, read from top to bottom (theory: riemann#a1 to riemann#a10; seed 000).

Star states of each pair from the Riemann problem, tension as a pressure jump inside it, corrected or conservative
pressure gradient, leapfrog with one continuity and one momentum sweep.
"""

from __future__ import annotations

from typing import Any

from warpsph.engine.program import Absent, BuildList, KeepList, Node, Program, Rarely, Stage
from warpsph.kernels.core.clock import make_advance
from warpsph.kernels.core.poses import MIDDLE, NEXT
from warpsph.kernels.core.relaxation import make_relaxation
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.core.time_signals import depends_on_time
from warpsph.kernels.riemann.body_flow import continues_flow
from warpsph.kernels.riemann.contact import make_contact, make_phase_contact
from warpsph.kernels.riemann.density import make_continuity, make_state
from warpsph.kernels.riemann.drift import make_drift
from warpsph.kernels.riemann.integrate import make_kick_drift
from warpsph.kernels.riemann.interface import make_curvature, make_evened, make_fraction, make_normal
from warpsph.kernels.riemann.interface_flow import make_interface_flow
from warpsph.kernels.riemann.interface_gradient import make_interface_gradient
from warpsph.kernels.riemann.load import make_load
from warpsph.kernels.riemann.meeting_phases import (
    make_phase_curvatures,
    make_phase_evened,
    make_phase_normals,
    make_phase_shares,
)
from warpsph.kernels.riemann.momentum import make_momentum
from warpsph.kernels.riemann.printed_load import make_printed_load
from warpsph.kernels.riemann.printed_sweeps import make_printed_continuity, make_printed_momentum
from warpsph.kernels.riemann.printed_tension import make_printed_colour, make_printed_curvature, make_printed_normal
from warpsph.kernels.riemann.surface_room import make_surface_room, make_thin
from warpsph.kernels.riemann.volume import make_volume
from warpsph.schemes.map_stages import exponents, follow_shift, windows
from warpsph.schemes.open_stages import buffer_gradient, closed_sides, crossing, fill, open_flow, sponge
from warpsph.schemes.viscous_steps import viscous_stages
from warpsph.schemes.wall_stages import bodies, moving_sides, signals, surface_load, walls, walls_ahead


def program(spec: Spec) -> Program:
    """Return what runs for a `Spec`."""
    measures: dict[str, list[Node]] = {"interface": [], **exponents(spec)}
    if spec.interface and not spec.curved:
        measures["interface"] = [*geometry(spec)]
    if spec.walls:
        measures["wall_load"] = [*signals(spec), *wall_load(spec)]
    if spec.bodies:
        measures["surface_load"] = [*signals(spec), *surface_load(spec)]
    return Program(
        step=step(spec),
        start=start(spec),
        advance=advance(spec),
        measures=measures,
        changes=crossing(spec),
    )


def step(spec: Spec) -> list[Node]:
    """Return the nodes of one time step, in order."""
    if spec.printed:
        return printed_step(spec)
    rare = [*constraints(spec), *curvature(spec), *surface_room(spec)]
    return [
        *signals(spec),
        *moving_sides(spec),
        *bodies(spec, MIDDLE, speed=1),
        *windows(spec),
        Stage("kick_drift", make_kick_drift(spec), "fluid", "moves the particles"),
        *sides(spec),
        *(walls_ahead(spec, grown=spec.corrected) if continues_flow(spec) else []),
        Stage("continuity", make_continuity(spec), "fluid", "density and pressure from star velocities"),
        *relaxation(spec),
        *bodies(spec, NEXT, closing=1),
        *open_flow(spec),
        *walls(spec, across=spec.wall_sound),
        *([Rarely(rare)] if rare else []),
        *buffer_gradient(spec, spec.bodies and spec.corrected),
        Stage("momentum", make_momentum(spec), "fluid", "acceleration from star pressures"),
        *viscous_stages(spec),
        *follow_shift(spec),
        *sponge(spec),
        advance(spec),
        KeepList(),
    ]


def printed_step(spec: Spec) -> list[Node]:
    """Return the nodes of one time step as the paper prints it, in order (theory: printed#yang)."""
    return [
        *signals(spec),
        *moving_sides(spec),
        *windows(spec),
        Stage("kick_drift", make_kick_drift(spec), "fluid", "moves the particles"),
        Stage("continuity", make_printed_continuity(spec), "fluid", "density and pressure, eq (13)"),
        *walls(spec),
        *curvature(spec),
        Stage("momentum", make_printed_momentum(spec), "fluid", "acceleration, eq (27)"),
        advance(spec),
        KeepList(),
    ]


def constraints(spec: Spec) -> list[Stage]:
    """Return the stages that hold the volume of a closed domain and the momentum along periodic axes."""
    stages = []
    if spec.momentum_constraint:
        add, close = make_drift(spec)
        both = ", and mean pressure" if spec.volume_constraint else ""
        stages.append(Stage("drift", add, "blocks", f"periodic axes with the corrected gradient: total momentum{both}"))
        stages.append(Stage("drift_close", close, "last", "mean velocity that is to be taken out"))
    elif spec.volume_constraint:
        add, close = make_volume(spec)
        stages.append(Stage("volume", add, "blocks", "closed domain with the corrected gradient: mean pressure"))
        stages.append(Stage("volume_close", close, "last", "closes the volume sum"))
    return stages


def surface_room(spec: Spec) -> list[Stage]:
    """Return the stages by which density follows the room of the particles where the fluid has a free surface."""
    if not spec.surface_room:
        return []
    return [
        Stage("surface_room", make_surface_room(spec), "fluid", "a free surface: density follows the room of the particles"),
        Stage("thin", make_thin(spec), "fluid", "a free surface: thin fluid has no pressure"),
    ]


def start(spec: Spec) -> list[Node]:
    """Return the nodes that complete a start: state from density, list, then the acceleration."""
    return [
        *signals(spec),
        *bodies(spec, NEXT, speed=1, closing=1),
        *fill(spec),
        state(spec),
        *relaxation(spec, beginning=1),
        BuildList("the first list"),
        *open_flow(spec, beginning=1),
        *sides(spec),
        *walls(spec, across=spec.wall_sound),
        *curvature(spec),
        *surface_room(spec),
        *buffer_gradient(spec, spec.bodies and spec.corrected),
        Stage("momentum", momentum(spec), "fluid", "first acceleration"),
        *viscous_stages(spec),
        *follow_shift(spec),
    ]


def momentum(spec: Spec) -> Any:
    """Return the momentum sweep, the printed one where it is asked for."""
    return make_printed_momentum(spec) if spec.printed else make_momentum(spec)


def state(spec: Spec) -> Stage:
    """Return the stage that evaluates pressure and volume from the density at the start."""
    return Stage("state", make_state(spec), "fluid", "pressure of the start")


def relaxation(spec: Spec, beginning: int = 0) -> list[Stage]:
    """Return the stage that damps sound by a part of the pressure that fades."""
    if not spec.relaxation:
        return []
    return [Stage("relaxation", make_relaxation(spec), "fluid", "pressure that fades: sound dies", {"beginning": beginning})]


def advance(spec: Spec) -> Stage:
    """Return the stage that ends a step; without advancing it also prepares the first one."""
    return Stage("advance", make_advance(spec.precision), "one", "time, next step length, list check")


def geometry(spec: Spec) -> list[Stage]:
    """Return the stages that a gauge of the interface needs where no curvature runs them in every step."""
    return [
        Stage("own_fraction", make_fraction(spec), "band", "colour for the interface gauge"),
        Stage("colour_normal", make_normal(spec), "band", "normals for the interface gauge"),
    ]


def wall_load(spec: Spec) -> list[Stage]:
    """Return the stages that a wall-force gauge runs: the force on each wall particle."""
    if spec.printed:
        return [Stage("wall_load", make_printed_load(spec), "wall", "wall-force gauge")]
    if spec.bodies and spec.corrected:
        return surface_load(spec)
    return [Stage("wall_load", make_load(spec), "wall", "wall-force gauge")]


def sides(spec: Spec) -> list[Stage]:
    """Return the stages that look at the flow on each side of the interfaces; the printed form has none."""
    if not spec.multiphase or spec.paper_star:
        return []
    stages = [Stage("interface_flow", make_interface_flow(spec), "fluid", "velocity on each side of the interfaces")]
    if spec.viscous_jump:
        text = "velocity gradient at interfaces, for the friction between fluids"
        stages.append(Stage("interface_gradient", make_interface_gradient(spec), "fluid", text))
    return stages


def curvature(spec: Spec) -> list[Stage]:
    """Return the stages that find the curvature of the interfaces."""
    if not spec.curved:
        return []
    if spec.printed:
        return [
            Stage("colour", make_printed_colour(spec), "fluid", "smoothed colour, below eq (21)"),
            Stage("colour_normal", make_printed_normal(spec), "fluid", "interface normals, eq (21)"),
            Stage("curvature", make_printed_curvature(spec), "fluid", "interface curvature, eq (23)"),
        ]
    if spec.triple:
        return meeting_phases(spec)
    stages = [
        Stage("own_fraction", make_fraction(spec), "band", "colour for the curvature"),
        Stage("colour_normal", make_normal(spec), "band", "interface normals"),
    ]
    if spec.contact_angle:
        stages.append(Stage("contact_normal", make_contact(spec), "band", "contact angle: normals next to walls"))
    stages.append(Stage("curvature", make_curvature(spec), "band", "curvature of the interfaces"))
    if spec.tension != "body_force":
        text = "curvature the same on both sides of an interface"
        stages.append(Stage("mean_curvature", make_evened(spec, False), "band", text))
        stages.append(Stage("sharp_curvature", make_evened(spec, True), "band", "what the means have smoothed is put back"))
    return stages


def meeting_phases(spec: Spec) -> list[Stage]:
    """Return the stages that find the curvature of the interface of each phase, where three and more may meet."""
    turned = []
    if spec.contact_angle:
        text = "contact angle: normals of each phase next to walls"
        turned = [Stage("phase_contact", make_phase_contact(spec), "band", text)]
    return [
        Stage("phase_shares", make_phase_shares(spec), "band", "colours for the surface tension of phases that meet"),
        Stage("phase_normals", make_phase_normals(spec), "band", "normals of the interface of each phase"),
        *turned,
        Stage("phase_curvatures", make_phase_curvatures(spec), "band", "curvature of the interface of each phase"),
        Stage("phase_means", make_phase_evened(spec, False), "band", "curvature the same on both sides of an interface"),
        Stage("phase_sharpened", make_phase_evened(spec, True), "band", "what the means have smoothed is put back"),
    ]


def absent(spec: Spec) -> list[Absent]:
    """Return what a step leaves out for a `Spec`, and why."""
    rows = []
    if not spec.walls:
        rows.append(Absent("wall_state", "the scene has no walls"))
    if spec.walls and not spec.wall_no_slip:
        rows.append(Absent("wall friction", "no viscosity, or all walls are free-slip"))
    if not spec.multiphase:
        rows.append(Absent("interface_flow, interface pairs", "a single phase"))
    if not spec.curved:
        why = "neither surface tension, nor weights that differ"
        rows.append(Absent("own_fraction, colour_normal, curvature, mean_curvature, sharp_curvature", why))
    if not spec.contact_angle:
        why = "the printed form has no contact angles" if spec.printed else "no tension at walls"
        rows.append(Absent("contact_normal", f"{why}: walls take no part in the interfaces"))
    if spec.viscosity == "none":
        rows.append(Absent("viscous term", "all viscosities are zero"))
    if spec.multiphase and spec.viscosity != "none" and not spec.viscous_jump:
        rows.append(Absent("interface_gradient", "viscosities are the same, or friction has the radial or the printed form"))
    if spec.viscous_stages == 1:
        rows.append(Absent("viscous_stage", "friction, if there is any, is explicit: numerics.viscous_stages is 1"))
    if not spec.gravity:
        rows.append(Absent("gravity", "gravity is zero"))
    if not spec.body_force:
        rows.append(Absent("body force", "body_force is zero"))
    if not depends_on_time(spec):
        rows.append(Absent("signals", "nothing depends on time"))
    if not spec.acoustic_damping:
        rows.append(Absent("acoustic damping", "numerics.acoustic_damping is 0"))
    if not spec.disorder:
        rows.append(Absent("friction of disorder", "numerics.disorder_friction is 0"))
    if not spec.inertia:
        rows.append(Absent("inertia", "numerics.spared_gradient is gravity"))
    if not spec.relaxation:
        rows.append(Absent("relaxation", "numerics.acoustic_relaxation is 0"))
    if not spec.shifting:
        rows.append(Absent("shift", "numerics.shifting is 0"))
    if not spec.corrected:
        rows.append(Absent("gradient correction", "the conservative pressure gradient needs none"))
    if not spec.volume_constraint:
        rows.append(Absent("volume", "the pressure level is fixed by a free surface or by the conservative gradient"))
    if not spec.windows:
        rows.append(Absent("turn_windows, carry_origins, follow_shift", "output.lyapunov is not asked for"))
    if not spec.room:
        rows.append(Absent("room", "a free surface, or numerics has no corrected gradient, no shifting or no room_rate"))
    if not spec.surface_room:
        rows.append(Absent("surface_room, thin", "no free surface, or numerics.room_rate is 0"))
    if not spec.momentum_constraint:
        why = "no periodic axis along which nothing pushes, or a gradient that conserves momentum pair by pair"
        rows.append(Absent("drift", why))
    if not spec.interface_force:
        rows.append(Absent("interface force", "numerics.interface_force is 0"))
    rows += closed_sides(spec)
    if not any(spec.periodic):
        rows.append(Absent("periodic images", "no periodic axis"))
    return rows
