"""Projection ISPH as a scheme of the registry."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from warpsph.errors import Problem
from warpsph.scene.open_faces import open_sides
from warpsph.schemes.base import LOAD_ARRAYS
from warpsph.schemes.flow_through import FlowThrough
from warpsph.schemes.isph_numerics import IsphNumerics
from warpsph.schemes.printed_form import printed_projection
from warpsph.solvers.accuracy import attainable

if TYPE_CHECKING:
    import numpy as np

    from warpsph.engine.level import Level, Systems
    from warpsph.engine.population import Population
    from warpsph.engine.program import Absent, Program
    from warpsph.kernels.core.fields import Field
    from warpsph.kernels.core.spec import Spec
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics

# Bytes on the device of a particle: vectors of the solver, grids of the preconditioner.
SOLVER, SOLVER_AXIS = 36, 30
SHIFT_CAP = 0.25  # longest shift of a step, in spacings: two neighbours do not change places


class IsphScheme(FlowThrough):
    """Projection ISPH."""

    name = "isph"
    summary = "projection ISPH, one incompressible phase"
    numerics = IsphNumerics
    mirrors_sides = True
    skin = 0.001  # the list is made anew in every step
    shifts = True
    follows_origins = True
    free_pressure = True
    mean_edges = True
    usual_causes = (
        "a body that moves through a wall or leaves the fluid no room, a start far from equilibrium, too large a Courant "
        "number (numerics.courant), or pressure solves that end above their tolerance (numerics.maximum_iterations)"
    )
    # the last one is that of wall impacts, of which births know
    work = LOAD_ARRAYS | {"wall_impact"}
    kept = ("site_ahead", "face_pressure", "face_velocity", "face_before", "through")

    def check(self, case: Any) -> Iterator[Problem]:
        """Yield what the scheme cannot do: phases, tension, forces on sides, sponges that draw the flow, a tolerance."""
        if len(case.phases) > 1:
            rule = f"takes one phase, the case has {len(case.phases)}"
            yield Problem("numerics.scheme", "isph", rule, "write scheme: riemann, or leave one phase")
        if len(case.surface_tension) > 0:
            rule = "does not act with scheme: isph"
            yield Problem("surface_tension", len(case.surface_tension), rule, "write scheme: riemann, or delete it")
        least = attainable(case.precision)
        if case.numerics.tolerance != "auto" and case.numerics.tolerance < least:
            remedy = f"write at least {least:g}" + (", or precision: float64" if case.precision == "float32" else "")
            yield Problem("numerics.tolerance", case.numerics.tolerance, f"is out of reach in {case.precision}", remedy)
        if case.numerics.formulation == "paper":
            yield from printed_projection(case)
        for name, gauge in case.gauges.items():
            if gauge.type == "wall_force" and not case.bodies:
                rule = "needs wall particles, which scheme: isph has at bodies alone"
                yield Problem(f"gauges.{name}.type", gauge.type, rule, "use a gauge of type points at the wall")
        for name, _, _, flow in open_sides(case):
            # what is about sound alone has nothing to do; a sponge that draws the flow itself would be missed
            if flow.sponge is not None and flow.sponge.velocity is not None:
                path = f"domain.boundary.{name.replace('_', '.')}.{flow.word}.sponge.velocity"
                rule = "draws the flow, and with scheme: isph no sponge acts: there is no sound"
                value = flow.plain()["sponge"]["velocity"]
                yield Problem(path, value, rule, "delete it, or write numerics: {scheme: riemann}")

    def derive(self, case: Any, geometry: Geometry, row_list: bool) -> Physics:
        """Return the numbers of a run, see `isph_physics`."""
        from warpsph.schemes import isph_physics

        return isph_physics.derive(case, geometry, row_list)

    def fields(self) -> Sequence[Field]:
        """Return the declarations of its fields."""
        from warpsph.kernels.isph.isph_fields import ISPH_FIELDS

        return ISPH_FIELDS

    def program(self, spec: Spec, choices: Mapping[str, Any]) -> Program:
        """Return what runs, see `isph_program`."""
        from warpsph.schemes import isph_program

        return isph_program.program(spec)

    def absent(self, spec: Spec) -> list[Absent]:
        """Return what a step leaves out, and why."""
        from warpsph.schemes import isph_program

        return isph_program.absent(spec)

    def fill(self, population: Population, case: Any, geometry: Geometry, physics: Physics) -> None:
        """Put the pressures of the start, and the velocities as those of the step before too."""
        import numpy as np

        fluid = geometry.fluid_count
        population.put("density_excess", np.zeros(fluid))
        population.put("rest_volume", geometry.volume[:fluid])
        population.put("velocity_old", geometry.velocity[:fluid])
        population.put("pressure", geometry.pressure[:fluid])
        state = np.zeros((geometry.count, 2))
        state[:, 1] = geometry.volume
        state[:fluid, 0] = geometry.pressure[:fluid]
        population.put("state", state)
        self.fill_zone(population, geometry, physics)

    def values(self, params: Any, case: Any, geometry: Geometry, physics: Physics, device: Any) -> dict[str, Any]:
        """Set the numbers of its sweeps; return those of the deferred correction and of the rows below a surface."""
        from warpsph.schemes.isph_physics import full_share, row_shares, row_strain

        choices = physics.choices
        params.shifting = float(choices["shifting"])
        params.shift_cap = SHIFT_CAP * case.spacing / physics.h
        params.feedback = float(choices["volume_feedback"])
        params.filter = float(choices["velocity_filter"])
        first_row, second_row = row_shares(physics.spec, physics.h / case.spacing)
        return {
            **self.open_values(case, geometry, physics, device),
            "deferred": float(bool(choices["deferred_correction"])),
            "relaxed": int(bool(choices["relaxed_divergence"])),
            "surface_depth": float(choices["surface_offset"]) * case.spacing,
            "first_row": first_row,
            "second_row": second_row,
            "full_spread": full_share(physics.spec, physics.h / case.spacing) * case.dimension,
            "row_strain": row_strain(physics.spec, physics.h / case.spacing, float(choices["surface_offset"])),
        }

    def set_clock(self, clock: np.ndarray, counters: np.ndarray, physics: Physics) -> None:
        """Leave sound and skin out of the step, whose list is made anew; let implicit viscosity limit it by accuracy."""
        import math

        from warpsph.kernels.core import clock as ck
        from warpsph.schemes.isph_physics import CHANGE

        clock[ck.SKIN] = clock[ck.FARTHEST] = 1.0e30
        if physics.spec.printed:
            clock[ck.FORCE] = math.inf  # the printed limits know no acceleration
        if physics.spec.implicit_viscosity:
            clock[ck.VISCOUS_STEP], clock[ck.CHANGE] = physics.viscous_step, CHANGE
            clock[ck.AT_REST] = physics.rest_speed

    def systems(self, case: Any, geometry: Geometry, physics: Physics) -> Callable[[Level], Systems]:
        """Return what makes matrix and solvers of a level."""
        from warpsph.scene.open_faces import open_sides
        from warpsph.schemes.isph_systems import IsphSystems

        choices = physics.choices
        given = any(flow.given_velocity is None for _, _, _, flow in open_sides(case))
        options = {
            "singular": not (physics.spec.free_surface or given),
            "method": choices["solver"],
            "preconditioner": choices["preconditioner"],
            "tolerance": choices["tolerance"],
            "maximum_iterations": choices["maximum_iterations"],
            "lower": geometry.lattice.lower,
            "upper": geometry.lattice.upper,
            "spacing": case.spacing,
        }
        return lambda level: IsphSystems(level, options)

    def memory_beside(self, spec: Spec, fluid: int, entries: int) -> int:
        """Return the bytes of matrix, solver and preconditioner."""
        real = 8 if spec.precision == "float64" else 4
        return fluid * (entries * (4 + real) + SOLVER + SOLVER_AXIS * spec.dimension)
