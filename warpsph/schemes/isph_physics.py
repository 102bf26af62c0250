"""Numbers of a run with projection ISPH: what `auto` comes to, the structure, the limits of the time step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.gauge_models import LOAD_GAUGES
from warpsph.errors import CaseError, Problem
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.isph.projection import FILLED
from warpsph.scene.forcing import forcing_of
from warpsph.scene.open_faces import open_axis, open_sides
from warpsph.scene.physics import VISCOUS_LIMIT, Physics, body_reach, check_periods, flow_scales, has_room, smoothing_ratio
from warpsph.schemes.flow_through import room_left
from warpsph.schemes.isph_numerics import IsphNumerics

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry

PRINTED_STEP = 0.2  # both limits that are printed, over h/u and over rho h^2/mu
PRINTED_SHIFT = 0.02
COURANT = 0.4  # time step over h / largest speed; 0.25 is no more accurate
MOVING_COURANT = 0.2  # with bodies that move, which may come towards the fluid as fast as it towards them
# Explicit BDF2 with an extrapolated viscous term bears a third less than forward Euler.
EXTRAPOLATED = 2.0 / 3.0
# Implicit viscosity: change of the velocity in a step over the largest speed. The error in time goes with its square:
# vortices that decay to a tenth are 0.02 % off at 0.025, 0.11 % at 0.05, 0.5 % at 0.1, beside 1.2 % in space at 50 x 50.
CHANGE = 0.05
# Speed below which a fluid is at rest, over that of the scene and that of a fall through it: what is left is rounding, in
# float32 of the weight, which changes in every step.
AT_REST = 1.0e-6
# Longest step without friction over that of explicit friction from which on implicit friction pays: both take the same time
# at a ratio of 1.6, implicit friction 0.4 of it at 3.2 (scripts/isph_viscosity.py).
WORTH = 2.0
# Longest step beside bodies over h^2/nu. Of what the pressure lacks at the scale of h a share h^2/(nu dt) comes in a step:
# through cylinders in Stokes flow the force on one is 7 % off with steps of 30 h^2/nu, and as with short steps with 8.
LAG = 8.0
SHIFTING = 16.0  # shift of a step over h^2 |grad u| dt sum grad W V, as of the Riemann scheme
FEEDBACK = 0.1  # divergence over E u_max/h that draws the volume back, E the density excess
FALL = 0.25  # time step over sqrt(h/g), the time scale of a fall by h


def row_shares(spec: Spec, ratio: float) -> tuple[float, float]:
    """Return sum V (x_j - x_i).grad_i W / d of the first and the second row below a flat surface, on a lattice.

    Args:
        spec: kernel and dimension.
        ratio: smoothing length over spacing.
    """
    terms, points = _pairs(spec, ratio)
    height = points[:, -1]
    spread = -terms * (points**2).sum(axis=1) / spec.dimension
    first, second = (float(spread[height < above].sum()) for above in (0.5, 1.5))
    return first, second


def full_share(spec: Spec, ratio: float) -> float:
    """Return the share of the spread from which on friction has neighbours on all sides (theory: isph#surface-stress).

    With a free surface it is the geometric mean of the second row below it and of the inside, on a lattice.

    Args:
        spec: kernel, dimension, and whether there is a free surface.
        ratio: smoothing length over spacing.
    """
    if not spec.free_surface:
        return FILLED
    terms, points = _pairs(spec, ratio)
    spread = -terms * (points**2).sum(axis=1) / spec.dimension
    return math.sqrt(float(spread[points[:, -1] < 1.5].sum()) * float(spread.sum()))


def row_strain(spec: Spec, ratio: float, offset: float) -> float:
    """Return how much faster than the fluid across a surface the depth of its row is stretched (theory: isph#b4).

    The gradient of a row at the surface, which is exact for linear fields, is that of a place c spacings inside: of a wave
    exp(kz) cos kx it is k (1 - ck), c = -sum F z (z^2 - x^2)/(2 sum F z^2) over a lattice below. So the row moves by a share
    ck less than the wave, and the fluid sees the weight of what it moves by only: 1 + c/offset mends that.

    Args:
        spec: kernel and dimension.
        ratio: smoothing length over spacing.
        offset: distance of the surface from its row over the spacing; 1 is returned where it is 0.
    """
    if offset <= 0:
        return 1.0
    terms, points = _pairs(spec, ratio)
    below = points[:, -1] < 0.5
    f, x, z = terms[below], points[below, 0], points[below, -1]
    return float(1.0 - (f * z * (z**2 - x**2)).sum() / (2.0 * (f * z**2).sum()) / offset)


def _pairs(spec: Spec, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Return W'/r V of the pairs of a particle of a lattice, (n,) 1/spacing^2, and where neighbours are, (n, d) spacings."""
    import itertools

    import warp as wp

    from warpsph.start import start_warp

    start_warp()
    kernel = KERNELS[spec.kernel]
    _, slope = make_smoothing(spec.kernel, "float64")
    reach = math.ceil(kernel.support * ratio)
    points = np.array(list(itertools.product(range(-reach, reach + 1), repeat=spec.dimension)), dtype=float)
    q = np.linalg.norm(points, axis=1) / ratio
    near = (q > 0.0) & (q < kernel.support)
    scale = kernel.alpha[spec.dimension - 1] / ratio ** (spec.dimension + 2)
    return scale * np.array([float(slope(wp.float64(value))) for value in q[near]]), points[near]


def _decay(phase: Any, length: float) -> float:
    """Return the time in which friction takes the slowest shear flow to a part in e [s]."""
    return length**2 * phase.density / (math.pi**2 * phase.viscosity)


def _slides(case: Case) -> bool:
    """Return whether a side of the domain is a free-slip wall."""
    return any(end.kind == "wall" and end.wall == "free_slip" for axis in case.sides for end in (axis.lower, axis.upper))


def _no_loads(case: Case, gradient: str) -> tuple[str, str]:
    """Return rule and remedy for gauges of forces on bodies that mirror the fluid cell by cell, and so bear no load."""
    other = "write numerics: {scheme: riemann} or {scheme: delta_plus}, or delete the gauge"
    if case.has_flow_through:
        rule = "cannot be measured between inlets and outlets with scheme: isph where all bodies are of whole cells: mirrors"
        return rule, f"move a body by a tenth of a spacing, or {other.removeprefix('write ')}"
    if gradient != "corrected":
        rule = f"cannot be measured with scheme: isph and pressure_gradient: {gradient}"
        return rule, f"write numerics.pressure_gradient: corrected, or {other.removeprefix('write ')}"
    rule = "cannot be measured on bodies thinner than four spacings with scheme: isph, which are mirrors that bear no load"
    return rule, f"lower particle_spacing until the thinnest body has four, or {other.removeprefix('write ')}"


def _check_open(case: Case, filled: bool, gradient: str) -> None:
    """Refuse what inlets and outlets do not go with. Raises CaseError.

    These are a free surface, and the conservative gradient, which throws particles about where rows come in beside a
    disordered fluid.
    """
    if not case.has_flow_through:
        return
    problems = []
    if gradient != "corrected":
        rule = "makes a flow through inlets and outlets unstable"
        problems.append(Problem("numerics.pressure_gradient", gradient, rule, "write pressure_gradient: corrected"))
    problems += room_left(case, filled)
    if problems:
        raise CaseError(problems)


def derive(case: Case, geometry: Geometry, row_list: bool) -> Physics:
    """Return the physics of an ISPH case whose particles are known; see `physics.derive`."""
    numerics = case.numerics
    assert isinstance(numerics, IsphNumerics)
    paper = numerics.formulation == "paper"
    filled = not has_room(case, geometry)
    forcing = forcing_of(case)
    phase = case.phases[case.phase_names[0]]
    choices: dict[str, Any] = {}
    reasons: dict[str, str] = {}

    def choose(key: str, automatic: Any, reason: str) -> Any:
        given = getattr(numerics, key)
        choices[key] = automatic if given == "auto" else given
        if given == "auto":
            reasons[key] = "printed form" if paper else reason
        return choices[key]

    gradient = choose("pressure_gradient", "conservative" if paper else "corrected", "exact for a linear pressure")
    _check_open(case, filled, str(gradient))
    form = choose("viscosity_form", "morris" if paper or filled else "isotropic", "right damping at a free surface")
    choose("smoothing_ratio", smoothing_ratio(case), "least noise")
    shifting = choose("shifting", PRINTED_SHIFT if paper else SHIFTING, "keeps the particles evenly spaced")
    choose("unlock", 0.0, "not needed")
    order = choose("time_order", 1 if paper else 2, "BDF2: energy of a stretching drop within 0.5 % instead of 1 %")
    choose("relaxed_divergence", not paper, "pressure without impulses where the surface changes")
    choose("deferred_correction", not paper, "pressure equation exact for a linear pressure on any arrangement")
    choose("surface_offset", 0.0 if paper else 0.5, "the surface is half a spacing outside of its particles")
    choose("volume_feedback", 0.0 if paper else FEEDBACK, "keeps the volume in long runs")
    choose("velocity_filter", 0.0 if paper else 1.0, "takes out the noise that shifts would feed")
    meeting = bool(forcing.tracks)
    reason = "a body and the fluid may meet" if meeting else "0.4 of a smoothing length a step"
    choose("courant", PRINTED_STEP if paper else MOVING_COURANT if meeting else COURANT, reason)
    choose("solver", "bicgstab" if paper else "cg", "the matrix is symmetric")
    choose("preconditioner", "none" if paper else "multigrid", "its iterations do not grow with the scene")
    choose("tolerance", 1e-3 if paper else 1e-6, "below what else is wrong")
    choose("skin", case.scheme.skin, "the list is made anew in every step")
    choices["kernel"] = numerics.kernel
    choices["maximum_step"] = numerics.maximum_step
    choices["maximum_iterations"] = numerics.maximum_iterations

    h = float(choices["smoothing_ratio"]) * case.spacing
    support = h * KERNELS[numerics.kernel].support
    viscous = phase.viscosity > 0
    scales, _ = flow_scales(case, geometry, np.zeros((1, 1)), filled)
    viscosity = str(form) if viscous else "none"
    cap: dict[str, float] = {}
    force = float(np.linalg.norm(np.abs(forcing.ranges(forcing.gravity) + forcing.ranges(forcing.body_force)).max(axis=1)))
    if force > 0 and not paper:
        cap["gravity"] = FALL * math.sqrt(h / force)
    if numerics.maximum_step is not None:
        cap["maximum_step"] = float(numerics.maximum_step)
    explicit = math.inf
    if viscous:
        limit = PRINTED_STEP if paper else VISCOUS_LIMIT[viscosity] * (EXTRAPOLATED if int(order) == 2 else 1.0)
        explicit = limit * h * h * phase.density / phase.viscosity
    velocity = scales["velocity"]
    if case.has_flow_through and velocity > 0:
        cap["inlets and outlets"] = float(choices["courant"]) * h / velocity  # of what they may do in the coming step
    pace = max(forcing.side_speed(), forcing.body_speed(body_reach(forcing, geometry)))
    pace = max(pace, float(np.linalg.norm(geometry.boundary_velocity, axis=1).max(initial=0.0)))
    if pace > 0 and not paper:
        cap["walls that move"] = float(choices["courant"]) * h / pace  # a fluid at rest knows nothing of them yet
    longest = min(float(choices["courant"]) * h / velocity if velocity > 0 else math.inf, *cap.values(), case.end_time)
    reason = "no friction"
    if viscous:
        reason = f"explicit friction allows steps of {explicit:.3g} s, all else of {longest:.3g} s"
    implicit = choose("implicit_viscosity", viscous and not paper and WORTH * explicit < longest, reason)
    implicit = viscous and bool(implicit)
    # Of whole cells and at rest they can mirror the fluid cell by cell. That is for the conservative gradient, which has no
    # other pressure of theirs, for thin ones, beside which the fit leaks, and between inlets, where the flow past sharp
    # edges is steadier with it.
    fitted = geometry.surface is not None and gradient == "corrected" and geometry.stout
    bodies = fitted or bool(geometry.cut) or bool(forcing.tracks)
    if not bodies:
        rule, remedy = _no_loads(case, str(gradient))
        problems = [
            Problem(f"gauges.{name}.type", gauge.type, rule, remedy)
            for name, gauge in case.gauges.items() if gauge.type in LOAD_GAUGES and case.bodies
        ]  # fmt: skip
        if problems:
            raise CaseError(problems)
    if bodies and gradient != "corrected":
        rule = "has no pressure of bodies that cut cells of the lattice or move"
        remedy = "write corrected, or make the bodies of whole cells that stay where they are"
        raise CaseError([Problem("numerics.pressure_gradient", str(gradient), rule, remedy)])
    if viscous and not implicit:
        cap["viscosity"] = explicit
    elif implicit and bodies:
        cap["pressure at bodies"] = LAG * h * h * phase.density / phase.viscosity
    spec = Spec(
        dimension=case.dimension,
        precision=case.precision,
        kernel=numerics.kernel,
        periodic=tuple(case.periodic),
        walls=geometry.wall_count > 0,
        bodies=bodies,
        tails=bodies and geometry.surface is not None and geometry.surface.frames.count > 0,
        wall_no_slip=viscous and bool((geometry.wall_slip[geometry.kind == 1] == 0).any()),
        viscosity=viscosity,
        corrected=gradient == "corrected",
        printed=paper,
        gravity=bool(np.any(forcing.hydrostatic() != 0)),
        body_force=bool(np.any(forcing.driving() != 0)),
        varying_force=forcing.varying_force,
        varying_sides=forcing.varying_sides,
        moving=bool(forcing.tracks),
        central_force=case.central_force is not None,
        shifting=float(shifting) > 0 or not (filled or paper),  # collisions at a free surface come with it
        free_surface=not filled,
        scheme="isph",
        changing=case.has_flow_through,
        open_axis=open_axis(case),
        mirror=any("wall" in (axis.lower.kind, axis.upper.kind) for axis in case.sides),
        second_order=int(order) == 2,
        implicit_viscosity=implicit,
        viscosity_by_axis=implicit and (viscosity != "morris" or _slides(case)),
        row_list=row_list,
    )
    check_periods(case, geometry, support * (1.0 + float(choices["skin"])))
    # of use to gauges alone, which ask for the energy of compression: there is none
    sound = 10.0 * max(scales["velocity"], 1e-30)
    warnings = []
    if phase.sound_speed != "auto":
        warnings.append(f"phases.{case.phase_names[0]}.sound_speed: has no meaning for scheme: isph")
    for name, _, _, flow in open_sides(case):
        path = f"domain.boundary.{name.replace('_', '.')}.{flow.word}"
        keys = [key for key in ("waves", "relaxation", "sponge") if key in flow.model_fields_set]
        warnings += [f"{path}.{key}: has no meaning for scheme: isph, there is no sound" for key in keys]
    return Physics(
        spec=spec,
        choices=choices,
        reasons=reasons,
        h=h,
        support=support,
        sound_speed=(sound,),
        scales=scales,
        tension=np.zeros((1, 1)),
        step_cap=cap,
        runaway=100.0 * scales["velocity"] if scales["velocity"] > 0 else math.inf,
        warnings=tuple(warnings),
        densities=(phase.density,),
        viscous_step=explicit if implicit else 0.0,
        rest_speed=AT_REST * max(velocity, math.sqrt(force * scales["length"])),
        slow_step=max(CHANGE * _decay(phase, scales["length"]), explicit) if implicit else math.inf,
    )
