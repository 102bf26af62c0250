"""The compressible gas as a scheme of the registry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from warpsph.case.gauge_models import LOAD_GAUGES
from warpsph.case.signals import varies
from warpsph.errors import Problem
from warpsph.schemes.base import Fault, Scheme
from warpsph.schemes.gas_numerics import GasNumerics

if TYPE_CHECKING:
    import numpy as np

    from warpsph.engine.population import Population
    from warpsph.engine.program import Absent, Program
    from warpsph.kernels.core.fields import Field
    from warpsph.kernels.core.spec import Spec
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics

MOST_GAMMA = 3.0  # of a gas with one degree of freedom
# Seconds of a pair over those of the Riemann scheme, by the solver of Riemann problems; "" for artificial viscosity.
# Measured on a core shared with others: 4.3, 2.8 and 1.35 us a particle and step in a plane of 4 096 particles, where the
# estimate of 0.58 us for Taylor-Green vortices in the Riemann scheme was 0.9.
PAIR_COST = {"exact": 8.0, "acoustic": 5.0, "": 2.4}


class GasScheme(Scheme):
    """Compressible gas with an energy equation and smoothing lengths that follow the density."""

    name = "gas"
    summary = "compressible gas with shocks, one phase"
    numerics = GasNumerics
    mirrors_sides = True
    dimensions = (1, 2, 3)
    ratios = {1: 1.0, 2: 1.3, 3: 1.3}
    varying_density = True
    internal_energy = True
    skin = 0.3
    shown = ("energy", "smoothing")
    usual_causes = "too large a Courant number (numerics.courant), or the acoustic solver at a strong shock"
    kept = ("signal_rates",)

    def check(self, case: Any) -> Iterator[Problem]:
        """Yield what the scheme cannot do: several phases, tension, viscosity, bodies, moving walls, gauges of forces."""
        if len(case.phases) > 1:
            rule = f"takes one phase, the case has {len(case.phases)}"
            yield Problem("numerics.scheme", self.name, rule, "leave one phase; start.density varies within it")
        if len(case.surface_tension) > 0:
            rule = "does not act with scheme: gas"
            yield Problem("surface_tension", len(case.surface_tension), rule, "delete it, or write scheme: riemann")
        if len(case.bodies) > 0:
            rule = "are not known to scheme: gas"
            yield Problem("bodies", len(case.bodies), rule, "delete them; sides of the domain may be walls")
        for name, phase in case.phases.items():
            if not 1.0 < phase.gamma <= MOST_GAMMA:
                rule = f"is the ratio of heats of a gas, above 1 and at most {MOST_GAMMA:g}"
                yield Problem(f"phases.{name}.gamma", phase.gamma, rule, "write gamma: 1.4")
            if phase.viscosity > 0:
                rule = "does not act with scheme: gas"
                yield Problem(f"phases.{name}.viscosity", phase.viscosity, rule, "delete it, or write scheme: riemann")
            if phase.sound_speed != "auto":
                rule = "follows from pressure and density with scheme: gas"
                yield Problem(f"phases.{name}.sound_speed", phase.sound_speed, rule, "delete it")
        yield from self._check_start(case)
        yield from self._check_forces(case)
        yield from self._check_sides(case)
        yield from self._check_gauges(case)

    def _check_start(self, case: Any) -> Iterator[Problem]:
        """Yield what is wrong with the state at time 0: a gas without pressure has no energy."""
        background = max(phase.background_pressure for phase in case.phases.values())
        given = "none" if case.start.pressure in (None, "auto") else case.start.pressure
        if given == "hydrostatic" or (given == "none" and background == 0.0):
            rule = "is the pressure of the gas, which scheme: gas has to know everywhere"
            yield Problem("start.pressure", given, rule, "write a number or a formula in x, y, z, r")

    def _check_forces(self, case: Any) -> Iterator[Problem]:
        """Yield forces that the gas does not know."""
        for key in ("gravity", "body_force"):
            if varies(getattr(case, key)):
                yield Problem(key, "of time", "has to be constant with scheme: gas", "write numbers")
        if case.central_force is not None:
            yield Problem("central_force", case.central_force.rate, "does not act with scheme: gas", "delete it")

    def _check_sides(self, case: Any) -> Iterator[Problem]:
        """Yield sides that the gas does not know."""
        for axis, sides in zip("xyz", case.sides, strict=False):
            for end, side in (("lower", sides.lower), ("upper", sides.upper)):
                if side.moves:
                    rule = "moves, which an inviscid gas does not feel"
                    yield Problem(f"domain.boundary.{axis}.{end}", side.kind, rule, "write free_slip")

    def _check_gauges(self, case: Any) -> Iterator[Problem]:
        """Yield gauges of forces on walls: mirrors, the only walls of a gas, have no particles that bear one."""
        for name, gauge in case.gauges.items():
            if gauge.type in LOAD_GAUGES:
                rule = "is not known to scheme: gas, whose walls are mirrors"
                remedy = "use a gauge of type points with fields: [pressure] at the wall, or delete it"
                yield Problem(f"gauges.{name}.type", gauge.type, rule, remedy)

    def derive(self, case: Any, geometry: Geometry, row_list: bool) -> Physics:
        """Return the numbers of a run, see `gas_physics`."""
        from warpsph.schemes import gas_physics

        return gas_physics.derive(case, geometry, row_list)

    def fields(self) -> Sequence[Field]:
        """Return the declarations of its fields."""
        from warpsph.engine.integrators import work_fields
        from warpsph.kernels.gas.gas_fields import ADVANCED, GAS_FIELDS

        return [*GAS_FIELDS, *work_fields(ADVANCED)]

    def program(self, spec: Spec, choices: Mapping[str, Any]) -> Program:
        """Return what runs, see `gas_program`."""
        from warpsph.schemes import gas_program

        return gas_program.program(spec, choices["integrator"])

    def absent(self, spec: Spec) -> list[Absent]:
        """Return what a step leaves out, and why."""
        from warpsph.schemes import gas_program

        return gas_program.absent(spec)

    def pair_cost(self, spec: Spec) -> float:
        """Return how long a pair takes over one of the Riemann scheme: most of it are the iterations of Riemann problems."""
        return PAIR_COST[spec.star]

    def fill(self, population: Population, case: Any, geometry: Geometry, physics: Physics) -> None:
        """Put masses, densities and the pressures that the energies follow from."""
        import numpy as np

        from warpsph.schemes import gas_physics

        fluid = geometry.fluid_count
        density, pressure = gas_physics.start_density(case, geometry), gas_physics.absolute_pressure(case, geometry)
        gas_physics.check_positive(case, density, pressure)
        volume = geometry.volume[:fluid]
        rest = case.phases[case.phase_names[0]].density
        population.put("mass", density * volume)
        population.put("rest_volume", density * volume / rest)
        population.put("density", density)
        population.put("state", np.stack([pressure, volume], axis=1))
        eta = float(physics.choices["smoothing_ratio"])
        constant = physics.spec.constant_h
        smoothing = np.full(fluid, physics.h) if constant else eta * volume ** (1.0 / case.dimension)
        population.put("smoothing", smoothing)
        omega = 1.0 if constant else gas_physics.lattice_sums(physics.spec.kernel, eta, case.dimension)[1]
        population.put("stiffening", 1.0 / (omega * density**2))
        if physics.spec.held:
            population.put("held", gas_physics.beside_open_sides(case, geometry, smoothing * physics.support / physics.h))

    def values(self, params: Any, case: Any, geometry: Geometry, physics: Physics, device: Any) -> dict[str, Any]:
        """Return the numbers of its sweeps."""
        import warp as wp

        from warpsph.kernels.core.smoothing import KERNELS
        from warpsph.kernels.core.spec import types_of
        from warpsph.kernels.gas.gas_forces import SLOTS
        from warpsph.kernels.gas.gas_steps import STEP_GROWTH
        from warpsph.schemes import gas_physics

        choices, d = physics.choices, physics.spec.dimension
        real = types_of(physics.spec).real
        kernel = KERNELS[physics.spec.kernel]
        eta = float(choices["smoothing_ratio"])
        total, _ = gas_physics.lattice_sums(physics.spec.kernel, eta, d)
        return {
            "w_norm": real(kernel.alpha[d - 1] / total),
            "reach": real(kernel.support),
            "crowding": real(eta**d),
            "alpha": real(choices["artificial_viscosity"]),
            "beta": real(choices["quadratic_viscosity"]),
            "conductivity": real(choices["conductivity"]),
            "courant": real(choices["courant"]),
            "swell_weight": real(float(choices["courant"]) / STEP_GROWTH),
            "longest_smoothing": real(gas_physics.longest_smoothing(case, geometry, physics.spec)),
            "heats": real(case.phases[case.phase_names[0]].gamma - 1.0),
            "signal_rates": wp.zeros(SLOTS, dtype=real, device=device),
        }

    def fault(self, case: Any, geometry: Geometry, physics: Physics, population: Population, row: int) -> Fault | None:
        """Return what stopped the run: a support that outgrew its channel, or a particle without energy."""
        from warpsph.schemes import gas_physics

        smoothing, energy = (float(population.get(name)[row]) for name in ("smoothing", "energy"))
        longest = gas_physics.longest_smoothing(case, geometry, physics.spec)
        if smoothing > longest:
            reach = physics.support / physics.h
            value = f"{reach * smoothing:.4g} m, longest {reach * longest:.4g} m: beyond it particles have a second image"
            cause = "The gas is too thin there for a domain so narrow; enlarge it, or lower particle_spacing"
            return Fault("support", value, cause)
        if energy <= 0.0:
            return Fault("energy", f"{energy:.4g} J/kg", f"Usual causes: {self.usual_causes}")
        return None

    def set_clock(self, clock: np.ndarray, counters: np.ndarray, physics: Physics) -> None:
        """Let the signals of the particles limit the step, and every used-up list be made anew without a check."""
        import numpy as np

        from warpsph.kernels.core import clock as ck

        clock[ck.COURANT] = np.inf
        clock[ck.FORCE] = np.inf
        clock[ck.SIGNAL_COURANT] = float(physics.choices["courant"])
        clock[ck.FARTHEST] = 0.0
