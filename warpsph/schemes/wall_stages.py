"""Stages of walls, bodies and what depends on time that schemes with sound share."""

from __future__ import annotations

from warpsph.engine.program import Stage
from warpsph.kernels.core.drive import make_move_sides, make_signals
from warpsph.kernels.core.moving_bodies import make_move_bodies
from warpsph.kernels.core.poses import MIDDLE
from warpsph.kernels.core.shear_growth import make_shear_growth
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.core.surface_load import make_surface_load
from warpsph.kernels.core.time_signals import depends_on_time
from warpsph.kernels.core.wall import make_wall
from warpsph.kernels.core.wall_fit import HERE, make_wall_fit, make_wall_rows, make_wall_values


def signals(spec: Spec) -> list[Stage]:
    """Return the stage that evaluates what depends on time; walls move with their velocity in the middle of the step."""
    if not depends_on_time(spec):
        return []
    return [Stage("signals", make_signals(spec), "one", "what depends on time", {"share": 0.5, "ahead": 1.0})]


def moving_sides(spec: Spec) -> list[Stage]:
    """Return the stage that gives wall particles the velocity of the sides that they are behind."""
    if not (spec.walls and spec.varying_sides):
        return []
    return [Stage("move_sides", make_move_sides(spec), "wall", "the velocity of a side of the domain depends on time")]


def bodies(spec: Spec, level: int, speed: int = 0, closing: int = 0) -> list[Stage]:
    """Return the stage that brings moving bodies to where they are in the middle of the step or at its end."""
    if not spec.moving:
        return []
    reason = "bodies in the middle of the step" if level == MIDDLE else "bodies at the end of the step"
    values = {"level": level, "speed": speed, "closing": closing}
    return [Stage("move_bodies", make_move_bodies(spec), "wall", reason, values)]


def shear_growth(spec: Spec, fields: dict[str, str]) -> list[Stage]:
    """Return the stage after `wall_fit` that finds how the velocity bends across walls that the fluid sticks to."""
    return [Stage("shear_growth", make_shear_growth(spec), "wall", "shear that grows along the walls", fields=fields)]


def walls(
    spec: Spec, ahead: bool = False, across: bool = False, sliding: bool = False, grown: bool = False
) -> list[Stage]:
    """Return the stages that continue the flow into the walls; `ahead` of the continuity sweep it is for the velocities.

    across: velocities bend across the walls too, for a viscous term (theory: riemann#bodies).
    sliding: for a divergence, walls have the fluid's own velocity along them, where friction has not got hold of it.
    grown: across them it is that of a shear that grows along them (theory: riemann#growth).
    """
    if not spec.walls:
        return []
    if spec.bodies:
        sliding = sliding and spec.wall_no_slip  # other walls have that velocity anyway
        grown = grown and sliding and spec.dimension > 1
        fit = make_wall_fit(spec, across=across, followed=spec.wall_sound and not ahead, sliding=sliding, grown=grown)
        values = make_wall_values(spec, sliding=sliding, grown=grown)
        fields = {} if ahead else HERE
        return [
            Stage("wall_rows", make_wall_rows(), "wall", "where the list build has put each wall particle"),
            Stage("wall_fit", fit, "wall", "linear fit of the flow before the walls", fields=fields),
            *(shear_growth(spec, fields) if grown else []),
            Stage("wall_values", values, "wall", "pressure and mirrored velocity of the walls"),
        ]
    return [Stage("wall_state", make_wall(spec), "wall", "pressure and mirrored velocity of the walls")]


def surface_load(spec: Spec) -> list[Stage]:
    """Return the stages that gauges of bodies run: the force on each wall particle, over the surface."""
    # a build of the list may have moved the rows since the fit
    return [
        Stage("wall_fit", make_wall_fit(spec), "wall", "linear fit of the flow before the walls", fields=HERE),
        Stage("surface_load", make_surface_load(spec), "wall", "wall-force gauge, over the surface"),
    ]


def walls_ahead(spec: Spec, grown: bool = False) -> list[Stage]:
    """Return the stages that give the continuity sweep wall velocities of the same moment as those of the fluid.

    Those of the stages after it are a step old when the next one comes. That feeds sound that runs between two walls, but
    the conservative gradient has a dissipation that is more than that. A wall that moves on a curve has gone on by then: its
    old velocity lacks a step of its acceleration, as if it went away from the fluid (docs/records/walls.md#ahead).
    """
    needed = spec.wall_sound or (spec.bodies and spec.moving)
    return walls(spec, ahead=True, sliding=True, grown=grown) if needed else []
