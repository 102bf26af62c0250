"""The numbers of a run, and those of them that follow from a case and its particles whatever the scheme."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import CaseError, Problem
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.core.spec import Spec
from warpsph.scene.feasibility import checked
from warpsph.scene.first_contact import pushing
from warpsph.scene.forcing import Forcing, forcing_of
from warpsph.scene.open_faces import given_scales

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry

# Curvature of a corner that the particles resolve, as share of 1/h: the pressure it makes must not compress much either.
CORNER = 0.1
# Forward-Euler limits of the viscous terms in rho h^2/mu (theory: riemann#a9), with a margin.
VISCOUS_LIMIT = {"morris": 0.125, "radial": 0.06, "isotropic": 0.1, "paper": 0.06}
# Density excess that is never a fault by itself: the counterpart of the rarefaction that is one, `params.LEAST_DENSITY`.
LEAST_EXCESS = 0.9
IMPROVED_RATIO = 1.5


def smoothing_ratio(case: Case) -> float:
    """Return h / particle_spacing of a case."""
    given = case.numerics.smoothing_ratio
    if given != "auto":
        return float(given)
    printed = case.numerics.formulation == "paper"
    usual = case.scheme.ratios.get(case.dimension) or case.scheme.usual_ratio
    return (case.scheme.printed_ratio if printed else None) or usual or IMPROVED_RATIO


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
        acoustic: speed of sound that the time step follows [m/s]; 0 where sound does not limit it.
        viscous_step: limit of the time step that implicit viscosity is freed from [s]; 0 where viscosity is explicit.
        slow_step: time step that implicit viscosity takes in the slowest shear flow [s].
        rest_speed: speed below which what is left of a flow is rounding [m/s].
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
    step_cap: dict[str, float]
    densities: tuple[float, ...]
    tension: np.ndarray
    runaway: float = math.inf
    warnings: tuple[str, ...] = ()
    acoustic: float = 0.0
    viscous_step: float = 0.0
    slow_step: float = math.inf
    rest_speed: float = 0.0

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

    def estimated_step(self, calm: bool = False) -> float:
        """Return the time step to expect [s], before the flow is known; calm: once the sound of the start has died."""
        fastest = self.scales["velocity"] + (max(self.sound_speed) if calm else self.acoustic)
        courant = self.choices["courant"] * self.h / fastest if fastest > 0 else math.inf
        return float(min(courant, self.slow_step, *self.step_cap.values()))

    def estimated_steps(self, end_time: float) -> int:
        """Return how many steps to expect to a time [s]."""
        over = self.choices.get("relaxation_end")
        if over is None or over >= end_time:
            return math.ceil(end_time / self.estimated_step())
        return math.ceil(over / self.estimated_step() + (end_time - over) / self.estimated_step(calm=True))


def derive(case: Case, geometry: Geometry, row_list: bool = True) -> Physics:
    """Return the physics of a case whose particles are known, as its scheme derives it.

    Args:
        case: validated case.
        geometry: its particles.
        row_list: list layout of the device, see `Spec`.

    Raises:
        CaseError: a number that follows is beyond the precision, or a periodic axis is too short.
    """
    derived: Physics = checked(case.scheme.derive)(case, geometry, row_list)
    _check_surface_gauges(case, derived)
    lyapunov = case.output.lyapunov
    if lyapunov is None:
        return derived
    return dataclasses.replace(derived, spec=dataclasses.replace(derived.spec, windows=lyapunov.starts))


def _check_surface_gauges(case: Case, physics: Physics) -> None:
    """Refuse gauges along the surface of bodies that are walls of cells. Raises CaseError."""
    rule = (
        "needs a body with a surface of its own: one at rest whose faces lie between particles is a wall of whole cells in "
        "several fluids and between inlets"
    )
    remedy = "move the body by a tenth of a spacing, or use a gauge of type wall_force"
    problems = [
        Problem(f"gauges.{name}.type", gauge.type, rule, remedy)
        for name, gauge in case.gauges.items() if gauge.type == "surface_stress" and not physics.spec.bodies
    ]  # fmt: skip
    if problems:
        raise CaseError(problems)


def has_room(case: Case, geometry: Geometry) -> bool:
    """Return whether the fluid leaves room in the domain, so that it has a free surface."""
    return geometry.at_open_side or geometry.fluid_count + geometry.blocked < math.prod(geometry.lattice.count)


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
            matrix[a, b] = math.sin(math.radians(90.0 - pair.contact_angle))  # exactly 0 at 90
            matrix[b, a] = -matrix[a, b]
    return matrix


def flow_scales(
    case: Case, geometry: Geometry, tension: np.ndarray, filled: bool
) -> tuple[dict[str, float], np.ndarray]:
    """Return the scales of the flow and the pressure [Pa] that each phase sees.

    velocity: largest of start, walls, inlets, channel flow driven by the body force or between given pressures, free fall
    over the fluid's height (free surface) and capillary motion; pressure: hydrostatic head, Laplace jump, what inlets and
    outlets give, and what a body force builds up before walls and bodies.
    """
    phases = [case.phases[name] for name in case.phase_names]
    fluid = geometry.kind == 0
    position, phase = geometry.position[fluid], geometry.phase[fluid]
    extent = np.ptp(position, axis=0) + case.spacing if len(position) else np.ones(case.dimension)
    forcing = forcing_of(case)
    g = forcing.largest(forcing.gravity)
    head = float(np.abs(g) @ extent)  # g H, m^2/s^2
    density = np.array([p.density for p in phases])
    seen = np.zeros(len(phases))
    if head > 0:
        axis = int(np.argmax(np.abs(g)))
        for pull in sorted({*forcing.ranges(forcing.gravity)[axis].tolist()} - {0.0}, key=abs):
            seen = np.maximum(seen, _weight_above(case, geometry, extent, axis, pull))
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
    wall_speed = max(wall_speed, forcing.side_speed())  # of mirrors too, which are no particles
    reach = body_reach(forcing, geometry)
    wall_speed = max(wall_speed, forcing.body_speed(reach))
    length = float(extent.min())
    driven = 0.0
    drive = float(np.linalg.norm(forcing.largest(forcing.body_force)))
    if drive > 0:
        nu = min((p.viscosity / p.density for p in phases if p.viscosity > 0), default=0.0)
        driven = min(drive * length**2 / (8 * nu) if nu > 0 else math.inf, math.sqrt(drive * float(extent.max())))
        if forcing.varying_force:
            driven = min(driven, forcing.largest_impulse())
    falling = 0.0 if filled else math.sqrt(2 * float(forcing.hydrostatic() @ extent))
    pulled = 0.0
    if case.central_force is not None and not filled:
        far = float(np.linalg.norm(position - np.asarray(case.central_force.center), axis=1).max(initial=0.0))
        pulled = case.central_force.rate * far
    flow = max(speed, wall_speed, falling, pulled)
    pushed = pushing(case, geometry, forcing, reach, flow)
    seen += float(density.max()) * pushed * float(extent.max())
    if case.has_flow_through:
        given, pressure, passing = given_scales(case, geometry)
        speed, driven = max(speed, given), max(driven, passing)
        seen += pressure
    guessed = max(speed, wall_speed, driven, falling, pulled, capillary)
    scales = {
        "velocity": guessed if case.scales.velocity == "auto" else float(case.scales.velocity),
        "length": length if case.scales.length == "auto" else float(case.scales.length),
        "pressure": float(seen.max()) if case.scales.pressure == "auto" else float(case.scales.pressure),
    }
    if case.scales.pressure != "auto":
        seen = np.full(len(phases), scales["pressure"])
    return scales, seen


def turning_rate(case: Case, geometry: Geometry, tension: np.ndarray, scales: dict[str, float]) -> float:
    """Return the rate [1/s] at which the flow of several fluids turns around (theory: riemann#a1).

    The largest of: speed over length of the scene; the rates of the longest wave around a round drop of each phase in each
    larger one, two wave lengths around it, by its tension and by its buoyancy.
    """
    fluid = geometry.kind == 0
    phase, volumes, d = geometry.phase[fluid], geometry.volume[fluid], case.dimension
    density = [case.phases[name].density for name in case.phase_names]
    volume = [float(volumes[phase == k].sum()) for k in range(len(density))]
    forcing = forcing_of(case)
    g = float(np.linalg.norm(forcing.largest(forcing.gravity)))
    rate = scales["velocity"] / scales["length"] if scales["length"] > 0 else 0.0
    for a, inner in enumerate(density):
        for b, outer in enumerate(density):
            if a != b and 0 < volume[a] <= volume[b]:
                radius = (volume[a] / {1: 2.0, 2: math.pi, 3: 4.0 * math.pi / 3.0}[d]) ** (1.0 / d)
                inertia = {1: math.inf, 2: (inner + outer) / 6.0, 3: (3.0 * inner + 2.0 * outer) / 24.0}[d]
                buoyancy = abs(inner - outer) / (inner + outer) * g * 2.0 / radius
                rate = max(rate, math.sqrt(buoyancy), math.sqrt(tension[a, b] / (inertia * radius**3)))
    return rate


def body_reach(forcing: Forcing, geometry: Geometry) -> dict[str, float]:
    """Return the distance of the farthest particle of each moving body from its pivot [m], by name."""
    reach = {}
    for track in forcing.tracks:
        rows = geometry.body == geometry.body_names.index(track.name) + 1
        reach[track.name] = float(np.linalg.norm(geometry.position[rows] - track.pivot, axis=1).max(initial=0.0))
    return reach


def _weight_above(case: Case, geometry: Geometry, extent: np.ndarray, axis: int, g: float) -> np.ndarray:
    """Return the pressure at the bottom of each phase (P,) from the weight of all fluid above it [Pa].

    extent: of the fluid (d,) [m]; axis, g: along which gravity acts, and its component [m/s^2].
    """
    fluid = geometry.kind == 0
    position, phase = geometry.position[fluid], geometry.phase[fluid]
    density = np.array([case.phases[name].density for name in case.phase_names])
    up = -np.sign(g) * position[:, axis]
    layer = np.round((up - up.min()) / case.spacing).astype(int)
    area = np.prod(extent) / extent[axis]
    weight = np.bincount(layer, weights=density[phase] * geometry.volume[fluid], minlength=layer.max() + 1)
    # a column no denser than the mean of its layer; free surfaces make it an upper bound near the deepest part
    filled_area = np.bincount(layer, weights=geometry.volume[fluid], minlength=layer.max() + 1) / case.spacing
    mean = weight / np.maximum(filled_area, 1e-300 + area * 1e-6)
    above = np.cumsum(mean[::-1])[::-1] * abs(g)
    seen = np.zeros(len(density))
    for k in range(len(density)):
        rows = layer[phase == k]
        if len(rows):
            seen[k] = above[rows.min()]
    return seen


def _dammed_head(case: Case, geometry: Geometry, extent: np.ndarray) -> float:
    """Return f L [m^2/s^2], the pressure over density that a body force f makes where something stands in its way.

    Along a periodic axis it drives a flow and no pressure, unless a body holds that up: the drop over a period is rho f L.
    """
    held = [not wraps or bool(case.bodies) for wraps in case.periodic]
    forcing = forcing_of(case)
    return float(np.where(held, np.abs(forcing.largest(forcing.body_force)), 0.0) @ extent)


