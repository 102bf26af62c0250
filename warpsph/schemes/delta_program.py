"""Delta-plus-SPH: one kick-drift-kick step, read from top to bottom (theory: delta#d1 to delta#d6)."""

from __future__ import annotations

from warpsph.engine import integrators
from warpsph.engine.program import Absent, BuildList, KeepList, Node, Program, Rarely, Stage
from warpsph.kernels.core.clock import make_advance
from warpsph.kernels.core.poses import MIDDLE, NEXT
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.core.time_signals import depends_on_time
from warpsph.kernels.delta.budget_density import make_budget_density
from warpsph.kernels.delta.budget_forces import make_budget_forces
from warpsph.kernels.delta.budget_sums import make_budget_sums
from warpsph.kernels.delta.delta_continuity import continues_flow, make_delta_continuity
from warpsph.kernels.delta.delta_drift import make_delta_drift, make_delta_shift, make_delta_state
from warpsph.kernels.delta.delta_fields import ADVANCED
from warpsph.kernels.delta.delta_load import make_delta_load
from warpsph.kernels.delta.delta_momentum import make_delta_momentum
from warpsph.kernels.riemann.volume import make_volume
from warpsph.schemes.map_stages import exponents, follow_shift, windows
from warpsph.schemes.open_stages import buffer_gradient, closed_sides, crossing, fill, open_flow, sponge
from warpsph.schemes.wall_stages import bodies, moving_sides, signals, surface_load, walls, walls_ahead


def program(spec: Spec) -> Program:
    """Return what runs for a `Spec`."""
    measures: dict[str, list[Node]] = {**exponents(spec)}
    if spec.walls:
        measures["wall_load"] = [*signals(spec), *load(spec)]
    if spec.bodies:
        measures["surface_load"] = [*signals(spec), *surface_load(spec)]
    return Program(
        step=step(spec), start=start(spec), advance=advance(spec), measures=measures, changes=crossing(spec)
    )


def step(spec: Spec) -> list[Node]:
    """Return the nodes of one time step, in order."""
    return runge_kutta(spec) if spec.runge_kutta else leapfrog(spec)


def leapfrog(spec: Spec) -> list[Node]:
    """Return the nodes of a step of kick and drift, with one sweep for the density and one for the acceleration."""
    return [
        *signals(spec),
        *moving_sides(spec),
        *bodies(spec, MIDDLE, speed=1),
        *windows(spec),
        Stage("drift", make_delta_drift(spec), "fluid", "moves the particles"),
        *(walls_ahead(spec) if continues_flow(spec) else []),
        Stage("continuity", make_delta_continuity(spec), "fluid", "rate of the density, with its diffusion"),
        *budget_ahead(spec),
        state(spec, closing=1),
        *bodies(spec, NEXT, closing=1),
        *open_flow(spec),
        *walls(spec),
        *volume(spec),
        *buffer_gradient(spec, spec.density_diffusion),
        momentum(spec),
        *follow_shift(spec),
        *sponge(spec),
        *budget(spec, closing=1),
        advance(spec),
        KeepList(),
    ]


def runge_kutta(spec: Spec) -> list[Node]:
    """Return the nodes of a step of Runge and Kutta; diffusion and shift are taken at its start and held."""
    offset, velocity, excess = ADVANCED
    here, continued = {"midway": "position"}, continues_flow(spec)
    slow = make_delta_continuity(spec, flow_part=False)
    flow = make_delta_continuity(spec, slow_part=False)
    rates = [
        state(spec, closing=0),
        *walls(spec, sliding=continued),
        Stage("continuity", flow, "fluid", "rate of the density", fields=here),
        *(walls(spec) if continued and spec.bodies else []),
        Stage("acceleration", make_delta_momentum(spec, measuring=False), "fluid", "acceleration"),
    ]
    held = Stage("diffusion", slow, "fluid", "diffusion of the density", fields={**here, "density_rate": "slow_rate"})
    settle = Stage("settle", make_delta_shift(spec), "fluid", "shift of the particles, mean pressure")
    advanced = {"velocity": offset, "density_rate": excess, "acceleration": velocity}
    return [
        *windows(spec),
        *integrators.rk4(spec, advanced, rates, [held]),
        *([settle] if spec.shifting or spec.volume_constraint else []),
        state(spec, closing=0),
        *walls(spec),
        *volume(spec),
        momentum(spec),
        *follow_shift(spec),
        integrators.watch(spec),
        advance(spec),
        KeepList(),
    ]


def start(spec: Spec) -> list[Node]:
    """Return the nodes that complete a start: state from density, list, then the acceleration."""
    return [
        *signals(spec),
        *bodies(spec, NEXT, speed=1, closing=1),
        *fill(spec),
        state(spec, closing=0),
        BuildList("the first list"),
        state(spec, closing=0),
        *open_flow(spec, beginning=1),
        *walls(spec),
        *buffer_gradient(spec, spec.density_diffusion),
        momentum(spec),
        *follow_shift(spec),
        *budget(spec, closing=0),
    ]


def budget_ahead(spec: Spec) -> list[Stage]:
    """Return the stage that keeps apart what changes the density, while the rates are those of this step."""
    if not spec.budget:
        return []
    return [Stage("budget_density", make_budget_density(spec), "fluid", "budget gauge: what changes the density")]


def budget(spec: Spec, closing: int) -> list[Stage]:
    """Return the stages that add this step to the budget of momentum and energy; at a start they find the first forces."""
    if not spec.budget:
        return []
    add, fold, close = make_budget_sums(spec)
    values = {"closing": closing}
    return [
        Stage("budget_forces", make_budget_forces(spec), "fluid", "budget gauge: parts of the acceleration"),
        Stage("budget_sums", add, "budget_sums", "budget gauge: sums of both", values),
        Stage("budget_fold", fold, "folds", "adds up the parts of the budget"),
        Stage("budget_close", close, "one", "adds the step to the budget", values),
    ]


def volume(spec: Spec) -> list[Node]:
    """Return the stages that hold the volume of a closed domain, whose mean pressure nothing else holds."""
    if not spec.volume_constraint:
        return []
    add, close = make_volume(spec)
    stages = [
        Stage("volume", add, "blocks", "closed domain: mean pressure"),
        Stage("volume_close", close, "last", "closes the volume sum"),
    ]
    return [Rarely(stages)]


def momentum(spec: Spec) -> Stage:
    """Return the stage that finds accelerations."""
    return Stage("momentum", make_delta_momentum(spec), "fluid", "acceleration, pressure gradient and shift")


def state(spec: Spec, closing: int) -> Stage:
    """Return the stage that evaluates pressure and volume from the density, which it advances at the end of a step."""
    reason = "density of the end of the step, pressure" if closing else "pressure of the start"
    return Stage("state", make_delta_state(spec), "fluid", reason, {"closing": closing})


def load(spec: Spec) -> list[Stage]:
    """Return the stages that a wall-force gauge runs: the force on each wall particle.

    It is that of the pairs with the fluid. Where pressure below zero acts by its differences, pairs do not exchange
    momentum: in a domain that is full, bodies have the integral over their surface instead, unless it is for gaps alone.
    """
    if spec.bodies and spec.tension_control == "inside" and not spec.free_surface:
        return surface_load(spec)
    return [Stage("wall_load", make_delta_load(spec), "wall", "wall-force gauge")]


def advance(spec: Spec) -> Stage:
    """Return the stage that ends a step; without advancing it also prepares the first one."""
    return Stage("advance", make_advance(spec.precision), "one", "time, next step length, list check")


def absent(spec: Spec) -> list[Absent]:
    """Return what a step leaves out for a `Spec`, and why."""
    rows = []
    if not spec.walls:
        rows.append(Absent("wall_state", "the scene has no walls"))
    if spec.walls and not spec.wall_no_slip:
        rows.append(Absent("wall friction", "no viscosity, or all walls are free-slip"))
    if spec.walls and not spec.dry_walls:
        rows.append(Absent("dry walls", "the fluid fills the domain, walls are cells, or the form is the printed one"))
    if spec.viscosity == "none":
        rows.append(Absent("viscous term", "the viscosity is zero"))
    if not spec.artificial_viscosity:
        reason = "no free surface, enough viscosity, or numerics.artificial_viscosity is 0"
        rows.append(Absent("artificial viscosity", reason))
    if not spec.acoustic_damping:
        rows.append(Absent("acoustic damping", "numerics.acoustic_damping is 0"))
    if not spec.relaxation:
        rows.append(Absent("relaxation", "numerics.acoustic_relaxation is 0"))
    if not spec.gravity:
        rows.append(Absent("gravity", "gravity is zero"))
    if not spec.body_force:
        rows.append(Absent("body force", "body_force is zero"))
    if not depends_on_time(spec):
        rows.append(Absent("signals", "nothing depends on time"))
    if not spec.density_diffusion:
        rows.append(Absent("density diffusion", "numerics.density_diffusion is 0"))
    if not spec.tension_control:
        rows.append(Absent("tension control", "numerics.tension_control is false"))
    if not spec.shifting:
        rows.append(Absent("shift", "numerics.shifting is 0"))
    if not spec.windows:
        rows.append(Absent("turn_windows, carry_origins, follow_shift", "output.lyapunov is not asked for"))
    if not spec.volume_constraint:
        reason = "a free surface, inlets and outlets, or numerics.volume_constraint is false"
        rows.append(Absent("volume", reason))
    if not spec.free_surface:
        rows.append(Absent("free surface", "the fluid fills the domain"))
    if not spec.budget:
        rows.append(Absent("budget", "no gauge of that type"))
    rows += closed_sides(spec)
    if not any(spec.periodic):
        rows.append(Absent("periodic images", "no periodic axis"))
    return rows
