"""Riemann multiphase SPH as a scheme of the registry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from warpsph.errors import Problem
from warpsph.schemes.base import Scheme
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


class RiemannScheme(Scheme):
    """Weakly compressible Riemann SPH."""

    name = "riemann"
    summary = "weakly compressible Riemann SPH, any number of phases"
    numerics = RiemannNumerics
    printed_ratio = 1.25
    follows_origins = True
    open_sides = True
    kept = ("side_memory", "site_ahead", "face_pressure", "face_velocity", "through")
    # the last of the wall stage, which knows schemes of two time levels
    work = frozenset({"load", "friction", "velocity_old"})

    def check(self, case: Any) -> Iterator[Problem]:
        """Yield what needs a closed or periodic domain and has none."""
        rate = case.numerics.room_rate
        if rate != "auto" and rate > 0 and case.has_open_sides:
            rule = "needs a closed or periodic domain: at a free surface the window of a particle is cut"
            yield Problem("numerics.room_rate", rate, rule, "write auto or 0")
        if case.numerics.volume_constraint is True:
            for axis, sides in zip("xyz", case.sides, strict=False):
                if "open" in (sides.lower.kind, sides.upper.kind):
                    rule = f"needs a closed or periodic domain, {axis} is open"
                    yield Problem("numerics.volume_constraint", True, rule, "write auto or false")
            if case.has_flow_through:
                rule = "needs a closed or periodic domain; inlets and outlets give the pressure"
                yield Problem("numerics.volume_constraint", True, rule, "write auto or false")

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

    def room(self, case: Any, geometry: Geometry, physics: Physics) -> int:
        """Return room for the fluid, and for the buffers of inlets and outlets."""
        from warpsph.schemes import open_run

        if physics.spec.open_axis < 0:
            return geometry.fluid_count
        return open_run.room(open_run.open_run(case, geometry, physics), geometry.fluid_count)

    def fill(self, population: Population, case: Any, geometry: Geometry, physics: Physics) -> None:
        """Put densities, and volumes of the particles at the reference density."""
        import numpy as np

        from warpsph.scene import start_values

        excess = start_values.density_excess(case, geometry, physics)
        population.put("density_excess", excess)
        population.put("rest_volume", geometry.volume[: geometry.fluid_count] * (1.0 + excess))
        if physics.spec.open_axis >= 0:
            population.put("zone", np.ones(geometry.fluid_count))

    def values(self, params: Any, case: Any, geometry: Geometry, physics: Physics, device: Any) -> dict[str, Any]:
        """Set the numbers of its sweeps."""
        choices = physics.choices
        if physics.spec.room:
            params.room = float(choices["room_rate"])
        params.dissipation = float(choices["velocity_dissipation"])
        params.shifting = float(choices["shifting"])
        params.shift_cap = SHIFT_CAP
        params.zeta = float(choices["interface_force"])
        if physics.spec.open_axis < 0:
            return {}
        from warpsph.schemes import open_run

        return open_run.arguments(open_run.open_run(case, geometry, physics), case, geometry, physics, device)

    def flow_rates(self, case: Any, geometry: Geometry, physics: Physics, bindings: Mapping[str, Any]) -> dict[str, float]:
        """Return the flow, mass and pressure of each inlet and outlet."""
        from warpsph.schemes import open_run

        if physics.spec.open_axis < 0:
            return {}
        return open_run.flow_rates(case, geometry, physics, bindings)

    def set_clock(self, clock: np.ndarray, counters: np.ndarray, physics: Physics) -> None:
        """Set the sound that limits the step, and when the rare stages run."""
        import math

        from warpsph.kernels.core import clock as ck

        clock[ck.SOUND] = max(physics.sound_speed)
        clock[ck.RARE_LIMIT] = RARE_WAY * physics.h
        clock[ck.RARE_CAP] = physics.step_cap.get("surface tension", math.inf)
