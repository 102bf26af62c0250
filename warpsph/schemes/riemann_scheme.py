"""Riemann multiphase SPH as a scheme of the registry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from warpsph.errors import Problem
from warpsph.schemes.base import LOAD_ARRAYS
from warpsph.schemes.flow_through import FlowThrough, given_pressures, held_volume
from warpsph.schemes.printed_form import printed_form
from warpsph.schemes.riemann_numerics import RiemannNumerics

if TYPE_CHECKING:
    import numpy as np

    from warpsph.engine.population import Population
    from warpsph.engine.program import Absent, Program
    from warpsph.kernels.core.fields import Field
    from warpsph.kernels.core.spec import Spec
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics

SHIFT_CAP = 0.01  # longest shift of a step as share of h
RARE_WAY = 0.05  # way of the fastest particle, as share of h, after which the rare stages run again
ROOM_WAY = 1.0  # the same where under a free surface the room of the particles alone is looked at


class RiemannScheme(FlowThrough):
    """Weakly compressible Riemann SPH."""

    name = "riemann"
    summary = "weakly compressible Riemann SPH, any number of phases"
    numerics = RiemannNumerics
    printed_ratio = 1.25
    loaded_start = True
    follows_origins = True
    # the last of the wall stage, which knows schemes of two time levels
    work = LOAD_ARRAYS | {"velocity_old"}

    def check(self, case: Any) -> Iterator[Problem]:
        """Yield what the numbers of the scheme contradict each other or the domain in."""
        damping = case.numerics.acoustic_damping
        if damping != "auto" and damping > 0 and len(case.phases) > 1:
            rule = "is for one fluid: at an interface the two sides would be compressed by different pressures"
            yield Problem("numerics.acoustic_damping", damping, rule, "write auto or 0")
        yield from given_pressures(case)
        stages = case.numerics.viscous_stages
        if stages == 2:
            yield Problem("numerics.viscous_stages", stages, "needs 1, or 3 and more", "write 3, 1 or auto")
        if stages != "auto" and stages > 1 and case.has_flow_through:
            rule = "knows no inlets and outlets: what a buffer does is not friction's to change"
            yield Problem("numerics.viscous_stages", stages, rule, "write auto or 1")
        if case.numerics.formulation == "paper":
            yield from printed_form(case)
        yield from held_volume(case)

    def derive(self, case: Any, geometry: Geometry, row_list: bool) -> Physics:
        """Return the numbers of a run, see `riemann_physics`."""
        from warpsph.schemes import riemann_physics

        return riemann_physics.derive(case, geometry, row_list)

    def fields(self) -> Sequence[Field]:
        """Return the declarations of its fields."""
        from warpsph.kernels.riemann.riemann_fields import RIEMANN_FIELDS

        return RIEMANN_FIELDS

    def program(self, spec: Spec, choices: Mapping[str, Any]) -> Program:
        """Return what runs, see `riemann_program`."""
        from warpsph.schemes import riemann_program

        return riemann_program.program(spec)

    def staggered(self, spec: Spec) -> bool:
        """Velocities are half a step behind."""
        return True

    def absent(self, spec: Spec) -> list[Absent]:
        """Return what a step leaves out, and why."""
        from warpsph.schemes import riemann_program

        return riemann_program.absent(spec)

    def fill(self, population: Population, case: Any, geometry: Geometry, physics: Physics) -> None:
        """Put densities, and volumes of the particles at the reference density."""
        from warpsph.scene import start_values

        excess = start_values.density_excess(case, geometry, physics)
        population.put("density_excess", excess)
        population.put("rest_volume", geometry.volume[: geometry.fluid_count] * (1.0 + excess))
        self.fill_zone(population, geometry, physics)

    def values(self, params: Any, case: Any, geometry: Geometry, physics: Physics, device: Any) -> dict[str, Any]:
        """Set the numbers of its sweeps."""
        from warpsph.kernels.core.smoothing import lattice_slope, window_integral

        choices = physics.choices
        if physics.spec.room or physics.spec.surface_room:
            params.room = float(choices["room_rate"])
            params.window_norm = 1.0 / window_integral(case.dimension, physics.support, 4)
        params.dissipation = float(choices["velocity_dissipation"])
        params.even_slope = lattice_slope(physics.spec.kernel, physics.h / case.spacing, case.dimension) / physics.h
        params.shifting = float(choices["shifting"])
        params.damping = float(choices["acoustic_damping"])
        params.relaxation_time = float(choices["relaxation_time"])
        params.disorder = float(choices["disorder_friction"])
        params.shift_cap = SHIFT_CAP
        params.zeta = float(choices["interface_force"])
        return self.open_values(case, geometry, physics, device)

    def set_clock(self, clock: np.ndarray, counters: np.ndarray, physics: Physics) -> None:
        """Set the sound that limits the step, and when the rare stages run."""
        import math

        from warpsph.kernels.core import clock as ck

        clock[ck.SOUND] = physics.acoustic
        clock[ck.RELAXATION] = float(physics.choices["acoustic_relaxation"])
        if physics.spec.printed:
            clock[ck.FORCE] = math.inf  # the printed limits know no acceleration
        clock[ck.RARE_LIMIT] = RARE_WAY * physics.h
        spec = physics.spec
        if spec.surface_room and not (spec.volume_constraint or spec.momentum_constraint or spec.interface):
            # what is left follows how neighbours change, whichever step that takes
            clock[ck.RARE_LIMIT] = ROOM_WAY * physics.h
            counters[ck.RARE_STEPS] = 2**31 - 1  # as many as it takes
        clock[ck.RARE_CAP] = physics.step_cap.get("surface tension", math.inf)
