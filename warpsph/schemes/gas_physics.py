"""Numbers of a run of the compressible gas: what `auto` comes to, the structure, limits of the time step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpsph.case.expressions import Expression
from warpsph.errors import CaseError, Problem
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import Spec
from warpsph.scene.forcing import forcing_of
from warpsph.scene.physics import Physics, check_periods, smoothing_ratio
from warpsph.schemes.gas_numerics import GasNumerics

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry

COURANT, RK4_COURANT = 0.3, 0.6
ALPHA, BETA, PRINTED_BETA = 1.0, 2.0, 1.0


def derive(case: Case, geometry: Geometry, row_list: bool) -> Physics:
    """Return the physics of a case of the gas whose particles are known; see `physics.derive`."""
    numerics = case.numerics
    assert isinstance(numerics, GasNumerics)
    paper = numerics.formulation == "paper"
    choices: dict[str, Any] = {"pressure_gradient": "conservative", "viscosity_form": "auto", "shifting": 0.0}
    reasons: dict[str, str] = {}

    def choose(key: str, automatic: Any, reason: str) -> Any:
        given = getattr(numerics, key)
        choices[key] = automatic if given == "auto" else given
        if given == "auto":
            reasons[key] = reason
        return choices[key]

    choose("smoothing_ratio", smoothing_ratio(case), "enough neighbours in this dimension")
    reason = "printed form" if paper else "resolves what is dense"
    length = choose("smoothing_length", "constant" if paper else "adaptive", reason)
    choose("unlock", 0.0, "not needed")
    artificial = choose("dissipation", "artificial" if paper else "riemann", "printed form" if paper else "sharper")
    star = choose("riemann_solver", "exact", "holds for every strength of a shock")
    limited = choose("reconstruction", "limited", "second order") == "limited"
    choose("artificial_viscosity", ALPHA, "usual value")
    choose("quadratic_viscosity", PRINTED_BETA if paper else BETA, "printed value" if paper else "usual value")
    heat = choose("conductivity", 0.0, "not asked for")
    integrator = choose("integrator", "kick_drift_kick", "one look at all pairs a step")
    choose("courant", RK4_COURANT if integrator == "rk4" else COURANT, "error of the fan below that of space")
    hold = choose("hold_open_sides", True, "the gas goes on beyond open sides")
    choose("skin", case.scheme.skin, "of the scheme")
    choices["kernel"] = numerics.kernel
    choices["maximum_step"] = numerics.maximum_step

    h = float(choices["smoothing_ratio"]) * case.spacing
    support = h * KERNELS[numerics.kernel].support
    riemann, forcing = artificial == "riemann", forcing_of(case)
    spec = Spec(
        dimension=case.dimension,
        precision=case.precision,
        kernel=numerics.kernel,
        periodic=tuple(case.periodic),
        gravity=bool(np.any(forcing.hydrostatic() != 0)),
        body_force=bool(np.any(forcing.driving() != 0)),
        free_surface=case.has_open_sides,
        scheme="gas",
        mirror=any("wall" in (axis.lower.kind, axis.upper.kind) for axis in case.sides),
        artificial_viscosity=not riemann,
        runge_kutta=integrator != "kick_drift_kick",
        varying_h=True,
        constant_h=length == "constant",
        star=str(star) if riemann else "",
        limited=riemann and limited,
        conduction=not riemann and float(heat) > 0,
        held=case.has_open_sides and bool(hold),
        internal_energy=True,
        row_list=row_list,
    )
    widest = support
    if length != "constant":
        largest = float(geometry.volume[: geometry.fluid_count].max()) ** (1.0 / case.dimension)
        widest = max(support, float(choices["smoothing_ratio"]) * largest * KERNELS[numerics.kernel].support)
    check_periods(case, geometry, widest * (1.0 + float(choices["skin"])))
    check_channels(case, geometry, widest)
    speed, sound = start_speeds(case, geometry)
    highest = float(absolute_pressure(case, geometry).max())
    return Physics(
        spec=spec,
        choices=choices,
        reasons=reasons,
        h=h,
        support=support,
        sound_speed=(sound,),
        scales={"velocity": speed, "length": extent_of(geometry), "pressure": highest},
        step_cap={} if numerics.maximum_step is None else {"maximum_step": numerics.maximum_step},
        densities=(case.phases[case.phase_names[0]].density,),
        tension=np.zeros((1, 1)),
        acoustic=sound,
        runaway=math.inf,
    )


def check_channels(case: Case, geometry: Geometry, support: float) -> None:
    """Refuse mirrors so near to each other that a particle could see the image of an image.

    Raises:
        CaseError: names the axis and the least width.
    """
    problems = []
    for axis, width in mirrored_axes(case, geometry):
        if width < support:
            rule = f"{width:.4g} m: two walls are mirrors, which have to be {support:.4g} m apart, the radius of the kernel"
            remedy = "enlarge the domain, or lower particle_spacing or numerics.smoothing_ratio"
            problems.append(Problem(f"domain.boundary.{'xyz'[axis]}", case.sides[axis].lower.kind, rule, remedy))
    if problems:
        raise CaseError(problems)


def mirrored_axes(case: Case, geometry: Geometry) -> list[tuple[int, float]]:
    """Return (axis, width [m]) of all axes whose both sides are walls."""
    lattice = geometry.lattice
    widths = [float(high - low) for low, high in zip(lattice.lower, lattice.upper, strict=True)]
    both = [axis.lower.kind == axis.upper.kind == "wall" for axis in case.sides]
    return [(axis, width) for axis, width in enumerate(widths) if both[axis]]


def longest_smoothing(case: Case, geometry: Geometry, spec: Spec) -> float:
    """Return the smoothing length [m] beyond which a particle would need second images; 1e30 if it never does.

    A list holds the nearest image over a period, all within half of it, and single reflections, all within the width
    between two mirrors.
    """
    lattice = geometry.lattice
    rooms = [width for _, width in mirrored_axes(case, geometry)]
    rooms += [0.5 * (u - low) for low, u, wraps in zip(lattice.lower, lattice.upper, case.periodic, strict=True) if wraps]
    return float(min(rooms, default=1.0e30)) / KERNELS[spec.kernel].support


def absolute_pressure(case: Case, geometry: Geometry) -> np.ndarray:
    """Return the pressure of each particle at the start, with that of the background, (fluid,) [Pa]."""
    background = case.phases[case.phase_names[0]].background_pressure
    return np.asarray(geometry.pressure[: geometry.fluid_count] + background)


def start_density(case: Case, geometry: Geometry) -> np.ndarray:
    """Return the density of each particle at the start, (fluid,) [kg/m^3]."""
    if geometry.density is not None:
        return geometry.density
    return np.full(geometry.fluid_count, case.phases[case.phase_names[0]].density)


def start_speeds(case: Case, geometry: Geometry) -> tuple[float, float]:
    """Return (largest speed, largest speed of sound) at the start [m/s]."""
    gamma = case.phases[case.phase_names[0]].gamma
    speed = float(np.sqrt((geometry.velocity[: geometry.fluid_count] ** 2).sum(axis=1)).max(initial=0.0))
    square = gamma * absolute_pressure(case, geometry) / start_density(case, geometry)
    return speed, math.sqrt(max(float(square.max(initial=0.0)), 0.0))


def lattice_sums(kernel: str, eta: float, dimension: int) -> tuple[float, float]:
    """Return (sum of V W, Omega) in an even lattice of cells V = (h/eta)^d.

    W is divided by the sum, so that an even gas has its density. It is within 1e-2 of 1 for usual eta, and 1 for a B-spline
    with eta = 1 (theory: compressible#c1-density).
    """
    shape, slope = make_smoothing(kernel, "float64")
    steps = np.arange(-math.ceil(KERNELS[kernel].support * eta), math.ceil(KERNELS[kernel].support * eta) + 1)
    squares = sum(axis**2 for axis in np.meshgrid(*[steps.astype(float)] * dimension))
    values, counts = np.unique(squares, return_counts=True)
    ratios = [wp.float64(math.sqrt(value) / eta) for value in values]
    total = float(np.dot([float(shape(q)) for q in ratios], counts))
    change = float(np.dot([float(slope(q)) * float(q) ** 2 for q in ratios], counts))
    return KERNELS[kernel].alpha[dimension - 1] / eta**dimension * total, -change / (dimension * total)


def extent_of(geometry: Geometry) -> float:
    """Return the shortest side of the box around the fluid [m]."""
    lattice = geometry.lattice
    return float(min(u - low for low, u in zip(lattice.lower, lattice.upper, strict=True)))


def check_positive(case: Case, density: np.ndarray, pressure: np.ndarray) -> None:
    """Refuse a start without density or pressure at some particle.

    Raises:
        CaseError: names the key and the least value.
    """
    for key, values, unit in (("start.density", density, "kg/m^3"), ("start.pressure", pressure, "Pa")):
        if len(values) and not float(values.min()) > 0.0:
            rule = f"is {float(values.min()):g} {unit} at some particle, a gas needs more than 0"
            formula = getattr(case.start, key.split(".")[1])
            text = formula.text if isinstance(formula, Expression) else formula
            raise CaseError([Problem(key, text, rule, "change the formula there")])


def beside_open_sides(case: Case, geometry: Geometry, reach: np.ndarray) -> np.ndarray:
    """Return which particles are within their reach (fluid,) [m] of an open side, (fluid,) uint8."""
    position = geometry.position[: geometry.fluid_count]
    held = np.zeros(len(position), dtype=np.uint8)
    for axis, sides in enumerate(case.sides):
        if sides.lower.kind == "open":
            held |= (position[:, axis] - geometry.lattice.lower[axis] < reach).astype(np.uint8)
        if sides.upper.kind == "open":
            held |= (geometry.lattice.upper[axis] - position[:, axis] < reach).astype(np.uint8)
    return held
