"""Projection ISPH: one step, read from top to bottom (theory: isph#b1 to isph#b6; seed 002).

Predict without pressure, solve the pressure equation that makes the velocity free of divergence, correct.
"""

from __future__ import annotations

import dataclasses

from warpsph.engine.program import Absent, BuildList, Node, Program, Solve, Stage, Substeps
from warpsph.kernels.core.clock import make_advance
from warpsph.kernels.core.drive import make_signals
from warpsph.kernels.core.moving_bodies import make_move_bodies
from warpsph.kernels.core.poses import NEXT
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.core.surface_load import make_surface_load
from warpsph.kernels.core.time_signals import depends_on_time
from warpsph.kernels.core.wall import make_wall
from warpsph.kernels.core.wall_fit import HERE, make_wall_fit, make_wall_rows, make_wall_values
from warpsph.kernels.isph.body_pressure import make_body_source, make_look_ahead, make_remember_walls
from warpsph.kernels.isph.diffusion import make_diffusion
from warpsph.kernels.isph.open_projection import (
    make_buffer_pressure,
    make_buffer_velocity,
    make_open_source,
    make_rows,
    make_rows_outside,
    make_side_given,
    make_side_pressure,
    make_side_velocity,
)
from warpsph.kernels.isph.pressure import make_accept, make_assemble, make_correct
from warpsph.kernels.isph.printed_projection import (
    make_printed_accept,
    make_printed_assemble,
    make_printed_correct,
    make_printed_predict,
    make_printed_shift,
)
from warpsph.kernels.isph.projection import make_advect, make_predict, make_settle
from warpsph.kernels.isph.regularise import make_regularise
from warpsph.kernels.isph.surface import make_surface
from warpsph.kernels.isph.surface_friction import make_surface_friction
from warpsph.kernels.isph.velocity_smoothing import make_smooth_velocity
from warpsph.kernels.isph.wetness import make_wetness
from warpsph.schemes.map_stages import exponents, follow_shift, windows
from warpsph.schemes.open_stages import crossing, fill

# Solves of the first step: the pressure equation refers to the last pressure gradient, which is not known yet.
FIRST_PASSES = 8  # each leaves a tenth of the error


def program(spec: Spec) -> Program:
    """Return what runs for a `Spec`; the list is made in the middle of a step."""
    measures: dict[str, list[Node]] = {**exponents(spec)}
    if spec.printed:
        return Program(
            step=printed_step(spec),
            start=[*signals(spec), BuildList("the first list")],
            advance=advance(spec),
            measures=measures,
        )
    if spec.bodies:
        measures["wall_load"] = [
            *signals(spec, ahead=0.0),  # those of the last step are not there right after a restart
            Stage("wall_fit", make_wall_fit(spec, across=True), "wall", "wall-force gauge: fit of the flow", fields=HERE),
            Stage("surface_load", make_surface_load(spec), "wall", "wall-force gauge"),
        ]
        measures["surface_load"] = measures["wall_load"]
    return Program(
        step=step(spec),
        start=start(spec),
        advance=advance(spec),
        first=first(spec),
        measures=measures,
        changes=crossing(spec, clock_follows=True),
    )


def step(spec: Spec) -> list[Node]:
    """Return the nodes of one time step, in order."""
    return [
        *signals(spec),
        *move(spec),
        BuildList(),
        *open_given(spec),
        *look(spec),
        *friction(spec),
        *pressure(spec),
        *finish(spec),
    ]


def printed_step(spec: Spec) -> list[Node]:
    """Return the nodes of one time step as the paper prints it, in order (theory: printed#qiu)."""
    return [
        *signals(spec),
        *move(spec),
        BuildList(),
        Stage("predict", make_printed_predict(spec), "fluid", "velocity without pressure, eq (13); surface, eq (16)"),
        Stage("assemble", make_printed_assemble(spec), "fluid", "pressure equation, eq (14)"),
        Solve("solve", "pressure", "pressure that makes the velocity free of divergence"),
        Stage("accept", make_printed_accept(spec), "fluid", "pressure from the solution"),
        Stage("correct", make_printed_correct(spec), "fluid", "velocity of the end of the step, eq (15)"),
        Stage("settle", make_settle(spec), "fluid", "positions from the mean of both velocities, eq (7)"),
        Stage("regularise", make_printed_shift(spec), "fluid", "shift of the particles, eqs (20), (21)"),
        *follow_shift(spec),
        advance(spec),
    ]


def first(spec: Spec) -> list[Node]:
    """Return the nodes of the first step, whose pressure equation has to know its own gradient."""
    again = [*_gradient(spec), *look(spec), *friction(spec), *pressure(spec)]
    return [
        *signals(spec),
        *move(spec),
        BuildList(),
        *open_given(spec),
        *look(spec),
        *friction(spec),
        *pressure(spec),
        Substeps(FIRST_PASSES - 1, again, "the gradient of the first pressure is not known before"),
        *finish(spec),
    ]


def start(spec: Spec) -> list[Node]:
    """Return the nodes that find the gradient of the start pressure, which the surface stage would overwrite."""
    seen = [stage for stage in look(spec) if stage.name not in ("surface", "fragments", "surface_friction")]
    return [
        *signals(spec),
        *bodies(spec),
        *fill(spec),
        BuildList("the first list"),
        *open_velocity(spec, beginning=1),
        *open_given(spec),
        *open_pressure(spec),
        *seen,
        _gradient(spec)[-1],
    ]


def _gradient(spec: Spec) -> list[Stage]:
    """Return the stages that take the pressure and its gradient over, and leave the velocity."""
    *accept, correct = take(spec)
    return [*accept, dataclasses.replace(correct, values={"advancing": 0})]


def pressure(spec: Spec) -> list[Node]:
    """Return the nodes of the pressure equation."""
    return [*equation(spec), Solve("solve", "pressure", "pressure that makes the velocity free of divergence")]


def friction(spec: Spec) -> list[Node]:
    """Return the nodes of implicit viscosity, one component after the other; none without `implicit_viscosity`."""
    if not spec.implicit_viscosity:
        return []
    fill, source, take_over = diffuse(spec)
    nodes: list[Node] = []
    for component in range(spec.dimension):
        values = {"component": component}
        if spec.viscosity_by_axis or component == 0:
            nodes.append(dataclasses.replace(fill, values=values))
        nodes.append(dataclasses.replace(source, values=values))
        nodes.append(Solve("diffusion_solve", "viscosity", "friction of one component of the velocity"))
        nodes.append(dataclasses.replace(take_over, values=values))
    return nodes


def signals(spec: Spec, ahead: float = 1.0) -> list[Stage]:
    """Return the stage that evaluates what depends on time: all of it at the end of the step, or now with `ahead` 0."""
    if not depends_on_time(spec):
        return []
    return [Stage("signals", make_signals(spec), "one", "what depends on time", {"share": 1.0, "ahead": ahead})]


def move(spec: Spec) -> list[Stage]:
    """Return the stage before the neighbour list of the step."""
    stages = [
        *windows(spec),
        Stage("advect", make_advect(spec), "fluid", "moves the particles; the list is built after it"),
    ]
    if spec.open_axis >= 0:
        sites, rows = make_rows(spec)
        before = [
            Stage("site_way", sites, "site_side", "rows that follow at inlets"),
            Stage("row_way", rows, "fluid", "speed of the rows beyond inlets and outlets"),
        ]
        stages = [*before, *stages]
    return [*bodies(spec), *stages]


def open_given(spec: Spec) -> list[Stage]:
    """Return the stages that bring to inlets, outlets and their buffers what is given at the end of the step."""
    if spec.open_axis < 0:
        return []
    return [
        Stage("side_given", make_side_given(spec), "site_side", "what is given at inlets and outlets"),
        Stage("buffer_given", make_buffer_pressure(spec), "fluid", "the same beyond them"),
        Stage("rows_outside", make_rows_outside(spec), "matrix_diagonal", "buffers are no part of the equations"),
    ]


def open_pressure(spec: Spec) -> list[Stage]:
    """Return the stages that continue the pressure of the fluid into the buffers."""
    if spec.open_axis < 0:
        return []
    return [
        Stage("side_pressure", make_side_pressure(spec), "site_side", "pressure that arrives at inlets and outlets"),
        Stage("buffer_pressure", make_buffer_pressure(spec), "fluid", "the same beyond them"),
    ]


def open_velocity(spec: Spec, beginning: int = 0) -> list[Stage]:
    """Return the stages that give sites and buffers the velocity of the end of the step."""
    if spec.open_axis < 0:
        return []
    start = {"beginning": beginning}
    return [
        Stage("side_velocity", make_side_velocity(spec), "site_side", "velocity of inlets and outlets", start),
        Stage("buffer_velocity", make_buffer_velocity(spec), "fluid", "the same beyond them"),
    ]


def bodies(spec: Spec) -> list[Stage]:
    """Return the stage that brings moving bodies to where they are at the end of the step."""
    if not spec.moving:
        return []
    values = {"level": NEXT, "speed": 1, "closing": 1}
    stages = [Stage("move_bodies", make_move_bodies(spec), "wall", "bodies at the end of the step", values)]
    if spec.bodies:
        stages.insert(0, Stage("remember_walls", make_remember_walls(spec), "wall", "velocity of bodies before the step"))
    return stages


def look(spec: Spec) -> list[Stage]:
    """Return the stages that look at the new arrangement."""
    stages = []
    if spec.bodies:
        stages.append(Stage("wall_rows", make_wall_rows(), "wall", "where the list build has put each wall particle"))
        ahead, walls_ahead = make_look_ahead(spec)
        stages.append(Stage("look_ahead", ahead, "fluid", "velocity extrapolated to the end of the step, which bodies see"))
        stages.append(Stage("walls_ahead", walls_ahead, "wall", "the same of bodies, and what they do beyond it"))
        stages += continued(spec, "velocity_ahead")
        if spec.free_surface:
            stages.append(Stage("wetness", make_wetness(spec), "wall", "what of bodies is above the surface"))
    elif spec.wall_no_slip and spec.walls:
        stages.append(Stage("wall_state", make_wall(spec), "wall", "mirrored velocity of the bodies"))
    stages.append(Stage("predict", make_predict(spec), "fluid", "velocity without pressure; correction of the gradient"))
    if spec.free_surface:
        if spec.viscosity != "none":
            friction = make_surface_friction(spec)
            stages.append(Stage("surface_friction", friction, "fluid", "friction across a surface, which pressure balances"))
        find, drop = make_surface(spec)
        stages.append(Stage("surface", find, "fluid", "particles at the free surface, and their pressure"))
        stages.append(Stage("fragments", drop, "fluid", "splashes of a few particles have no inside"))
    return stages


def continued(spec: Spec, field: str) -> list[Stage]:
    """Return the stages that continue pressure and a velocity field of the fluid into bodies; none without them."""
    if not spec.bodies:
        return []
    fields = {"velocity": field}
    return [
        Stage("wall_fit", make_wall_fit(spec, across=True), "wall", "fit of the flow before bodies", fields=HERE | fields),
        Stage("wall_values", make_wall_values(spec), "wall", "the flow continued into the bodies", fields=fields),
    ]


def diffuse(spec: Spec) -> list[Stage]:
    """Return the stages of implicit viscosity: matrix, right-hand side, and after the solver what takes the solution.

    They run for one component of the velocity after the other; none without `implicit_viscosity`.
    """
    if not spec.implicit_viscosity:
        return []
    fill, source, take_over = make_diffusion(spec)
    return [
        Stage("diffusion_matrix", fill, "fluid", "viscous equation: friction at any time step"),
        Stage("diffusion_source", source, "fluid", "its right-hand side, what the step adds to the extrapolated velocity"),
        Stage("diffusion_take", take_over, "fluid", "velocity without pressure from its solution"),
    ]


def equation(spec: Spec) -> list[Stage]:
    """Return the stages that write the pressure equation down; the solver follows them."""
    stages = [Stage("assemble", make_assemble(spec), "fluid", "matrix and right-hand side of the pressure equation")]
    if spec.bodies:
        stages.append(Stage("body_source", make_body_source(spec), "fluid", "bodies in the right-hand side"))
    if spec.open_axis >= 0:
        stages.append(Stage("open_source", make_open_source(spec), "fluid", "inlets and outlets in the equation"))
    return stages


def finish(spec: Spec) -> list[Stage]:
    """Return the stages after the solver."""
    stages = [
        *take(spec),
        *open_velocity(spec),
        *continued(spec, "velocity"),
        Stage("regularise", make_regularise(spec), "fluid", "divergence left over, shift of the particles"),
        *smooth(spec),
        *follow_shift(spec),
    ]
    if not spec.second_order:
        stages.append(Stage("settle", make_settle(spec), "fluid", "positions from the mean of both velocities"))
    stages.append(advance(spec))
    return stages


def smooth(spec: Spec) -> list[Stage]:
    """Return the stage that smooths the velocity; none without a shift."""
    if not spec.shifting:
        return []
    return [Stage("smooth_velocity", make_smooth_velocity(spec), "fluid", "noise of the velocity smoothed, by pairs")]


def take(spec: Spec) -> list[Stage]:
    """Return the stages that take the solution over: pressure, its gradient, velocity."""
    return [
        Stage("accept", make_accept(spec), "fluid", "pressure from the solution"),
        *open_pressure(spec),
        Stage("correct", make_correct(spec), "fluid", "velocity free of divergence"),
    ]


def advance(spec: Spec) -> Stage:
    """Return the stage that ends a step; without advancing it also prepares the first one."""
    return Stage("advance", make_advance(spec.precision), "one", "time and next step length")


def absent(spec: Spec) -> list[Absent]:
    """Return what a step leaves out for a `Spec`, and why."""
    rows = []
    if not spec.free_surface:
        rows.append(Absent("surface, fragments", "the fluid fills a closed or periodic domain"))
    if not spec.mirror:
        rows.append(Absent("mirror images", "no side of the domain is a wall"))
    if not spec.walls:
        rows.append(Absent("wall_state", "no bodies"))
    if spec.viscosity == "none":
        rows.append(Absent("viscous term", "viscosity is zero"))
    elif not spec.implicit_viscosity:
        rows.append(Absent("implicit viscosity", "friction does not limit the step much, or the case says so"))
    if not spec.gravity:
        rows.append(Absent("gravity", "gravity is zero"))
    if not depends_on_time(spec):
        rows.append(Absent("signals", "nothing depends on time"))
    if not spec.shifting:
        rows.append(Absent("shift, smooth_velocity", "numerics.shifting is 0"))
    if not spec.windows:
        rows.append(Absent("turn_windows, carry_origins, follow_shift", "output.lyapunov is not asked for"))
    if spec.second_order:
        rows.append(Absent("settle", "BDF2 moves the particles with both velocities before the solve"))
    if spec.open_axis < 0:
        names = "site_way, row_way, side_given, buffer_given, open_source, side_pressure, side_velocity, crossing"
        rows.append(Absent(names, "no side of the domain is an inlet or an outlet"))
    else:
        reason = "there is no sound: what is given holds at every moment"
        rows.append(Absent("sponge, relaxation of open sides", reason))
    if not any(spec.periodic):
        rows.append(Absent("periodic images", "no periodic axis"))
    return rows
