"""Riemann multiphase SPH: one kick-drift-kick step, read from top to bottom (methods A; seed 000).

Star states of each pair from the Riemann problem, tension as a pressure jump inside it, corrected or conservative
pressure gradient, leapfrog with one continuity and one momentum sweep.
"""

from __future__ import annotations

from warpsph.kernels.clock import make_advance
from warpsph.kernels.density import make_continuity, make_state
from warpsph.kernels.integrate import make_kick_drift
from warpsph.kernels.interface import make_curvature, make_fraction, make_normal
from warpsph.kernels.load import make_load
from warpsph.kernels.momentum import make_momentum
from warpsph.kernels.spec import Spec
from warpsph.kernels.volume import make_volume
from warpsph.kernels.wall import make_wall
from warpsph.schemes.stage import Absent, Stage


def step(spec: Spec) -> list[Stage]:
    """Return the stages of one time step for a `Spec`, in order."""
    stages = [
        Stage("kick_drift", make_kick_drift(spec), "fluid", "moves the particles"),
        Stage("continuity", make_continuity(spec), "fluid", "density and pressure from star velocities"),
    ]
    if spec.volume_constraint:
        add, fold, close = make_volume(spec)
        stages.append(Stage("volume", add, "blocks", "closed domain with the corrected gradient: mean pressure"))
        stages.append(Stage("volume_fold", fold, "folds", "adds up the parts of the volume"))
        stages.append(Stage("volume_close", close, "one", "closes the volume sum"))
    stages += before_momentum(spec)
    stages.append(Stage("momentum", make_momentum(spec), "fluid", "acceleration from star pressures"))
    stages.append(advance(spec))
    return stages


def start(spec: Spec) -> list[Stage]:
    """Return the stages that complete a start: state from density, list (by the stepper), then the acceleration."""
    return [
        *before_momentum(spec),
        Stage("momentum", make_momentum(spec), "fluid", "first acceleration"),
    ]


def state(spec: Spec) -> Stage:
    """Return the stage that evaluates pressure and volume from the density at the start."""
    return Stage("state", make_state(spec), "fluid", "pressure of the start")


def advance(spec: Spec) -> Stage:
    """Return the stage that ends a step; without advancing it also prepares the first one."""
    return Stage("advance", make_advance(spec.precision), "one", "time, next step length, list check")


def geometry(spec: Spec) -> list[Stage]:
    """Return the stages that a gauge of the interface needs where no tension runs them in every step."""
    return [
        Stage("own_fraction", make_fraction(spec), "band", "colour for the interface gauge"),
        Stage("colour_normal", make_normal(spec), "band", "normals for the interface gauge"),
    ]


def wall_load(spec: Spec) -> Stage:
    """Return the stage that a wall-force gauge runs: the force on each wall particle."""
    return Stage("wall_load", make_load(spec), "wall", "wall-force gauge")


def before_momentum(spec: Spec) -> list[Stage]:
    """Return the stages that a momentum sweep needs at its positions: walls and interface geometry."""
    stages = []
    if spec.walls:
        stages.append(Stage("wall_state", make_wall(spec), "wall", "pressure and mirrored velocity of the walls"))
    if spec.tension != "none":
        stages += [
            Stage("own_fraction", make_fraction(spec), "band", "colour for the surface tension"),
            Stage("colour_normal", make_normal(spec), "band", "interface normals"),
            Stage("curvature", make_curvature(spec), "band", "interface curvature for the pressure jump"),
        ]
    return stages


def absent(spec: Spec) -> list[Absent]:
    """Return what a step leaves out for a `Spec`, and why."""
    rows = []
    if not spec.walls:
        rows.append(Absent("wall_state", "the scene has no walls"))
    if spec.walls and not spec.wall_no_slip:
        rows.append(Absent("wall friction", "no viscosity, or all walls are free-slip"))
    if not spec.multiphase:
        rows.append(Absent("interface pairs", "a single phase"))
    if spec.tension == "none":
        rows.append(Absent("own_fraction, colour_normal, curvature", "no surface tension"))
    if spec.viscosity == "none":
        rows.append(Absent("viscous term", "all viscosities are zero"))
    if not spec.gravity:
        rows.append(Absent("gravity", "gravity is zero"))
    if not spec.body_force:
        rows.append(Absent("body force", "body_force is zero"))
    if not spec.shifting:
        rows.append(Absent("shift", "numerics.shifting is 0"))
    if not spec.corrected:
        rows.append(Absent("gradient correction", "the conservative pressure gradient needs none"))
    if not spec.volume_constraint:
        rows.append(Absent("volume", "the pressure level is fixed by a free surface or by the conservative gradient"))
    if not spec.interface_force:
        rows.append(Absent("interface force", "numerics.interface_force is 0"))
    if not any(spec.periodic):
        rows.append(Absent("periodic images", "no periodic axis"))
    return rows
