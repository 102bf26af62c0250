"""Delta-plus-SPH as a scheme of the registry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from warpsph.errors import Problem
from warpsph.schemes.base import LOAD_ARRAYS
from warpsph.schemes.delta_numerics import DeltaNumerics
from warpsph.schemes.flow_through import FlowThrough, given_pressures, held_volume

if TYPE_CHECKING:
    import numpy as np

    from warpsph.engine.population import Population
    from warpsph.engine.program import Absent, Program
    from warpsph.kernels.core.fields import Field
    from warpsph.kernels.core.spec import Spec
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics

RARE_WAY = 0.05  # way of the fastest particle, as share of h, after which the volume is looked at again
SHIFT_CAP = 0.1  # longest shift of a step, in particle spacings


class DeltaScheme(FlowThrough):
    """Weakly compressible delta-plus-SPH."""

    name = "delta_plus"
    summary = "weakly compressible delta-plus-SPH, one phase"
    numerics = DeltaNumerics
    usual_ratio = 2.0
    shifts = True
    continues_sides = True
    loaded_start = True
    follows_origins = True
    # velocity_old is of the wall stage, which knows schemes of two time levels, wall_impact of births
    work = LOAD_ARRAYS | {"velocity_old", "phase", "wall_impact"}
    kept = (*FlowThrough.kept, "budget_work", "budget_kick", "budget_force")
    budgets = True

    def staggered(self, spec: Spec) -> bool:
        """Whether velocities are half a step behind: in the leapfrog, not with Runge-Kutta."""
        return not spec.runge_kutta

    def check(self, case: Any) -> Iterator[Problem]:
        """Yield what the scheme cannot do: several phases, surface tension, inlets and outlets with Runge-Kutta."""
        if len(case.phases) > 1:
            rule = f"takes one phase, the case has {len(case.phases)}"
            yield Problem("numerics.scheme", self.name, rule, "write scheme: riemann, or leave one phase")
        if len(case.surface_tension) > 0:
            rule = "does not act with scheme: delta_plus"
            yield Problem("surface_tension", len(case.surface_tension), rule, "write scheme: riemann, or delete it")
        if case.has_flow_through and case.numerics.integrator == "rk4":
            rule = "does not know inlets and outlets"
            yield Problem("numerics.integrator", "rk4", rule, "write leapfrog, or auto")
        if case.has_flow_through:
            yield from held_volume(case)
        yield from given_pressures(case)

    def derive(self, case: Any, geometry: Geometry, row_list: bool) -> Physics:
        """Return the numbers of a run, see `delta_physics`."""
        from warpsph.schemes import delta_physics

        return delta_physics.derive(case, geometry, row_list)

    def fields(self) -> Sequence[Field]:
        """Return the declarations of its fields."""
        from warpsph.engine.integrators import work_fields
        from warpsph.kernels.delta.delta_fields import ADVANCED, DELTA_FIELDS

        return [*DELTA_FIELDS, *work_fields(ADVANCED)]

    def program(self, spec: Spec, choices: Mapping[str, Any]) -> Program:
        """Return what runs, see `delta_program`."""
        from warpsph.schemes import delta_program

        return delta_program.program(spec)

    def absent(self, spec: Spec) -> list[Absent]:
        """Return what a step leaves out, and why."""
        from warpsph.schemes import delta_program

        return delta_program.absent(spec)

    def fill(self, population: Population, case: Any, geometry: Geometry, physics: Physics) -> None:
        """Put densities, volumes of the particles at the reference density, and whole neighbourhoods."""
        import numpy as np

        from warpsph.scene import start_values

        excess = start_values.density_excess(case, geometry, physics)
        population.put("density_excess", excess)
        population.put("rest_volume", geometry.volume[: geometry.fluid_count] * (1.0 + excess))
        if physics.spec.free_surface:
            population.put("wholeness", np.ones(geometry.fluid_count))
        self.fill_zone(population, geometry, physics)

    def values(self, params: Any, case: Any, geometry: Geometry, physics: Physics, device: Any) -> dict[str, Any]:
        """Set the numbers of its sweeps."""
        import warp as wp

        from warpsph.kernels.core.smoothing import make_smoothing

        choices = physics.choices
        ratio = physics.h / case.spacing
        params.shifting = float(choices["shifting"])
        params.shift_cap = SHIFT_CAP / ratio
        params.damping = float(choices["acoustic_damping"])
        params.relaxation_time = float(choices["relaxation_time"])
        if physics.spec.room:
            params.room = float(choices["room_rate"])
        shape, _ = make_smoothing(physics.spec.kernel, "float64")
        return {
            **self.open_values(case, geometry, physics, device),
            **(budget_arrays(device) if physics.spec.budget else {}),
            "density_diffusion": float(choices["density_diffusion"]),
            "artificial_viscosity": float(choices["artificial"]),
            "shift_speed": float(physics.scales["velocity"]),
            "shift_peak": 1.0 / float(shape(wp.float64(1.0 / ratio))),
        }

    def set_clock(self, clock: np.ndarray, counters: np.ndarray, physics: Physics) -> None:
        """Set the sound that limits the step, and when the volume is looked at again."""
        from warpsph.kernels.core import clock as ck

        clock[ck.SOUND] = physics.acoustic
        clock[ck.RELAXATION] = float(physics.choices["acoustic_relaxation"])
        clock[ck.RARE_LIMIT] = RARE_WAY * physics.h


def budget_arrays(device: Any) -> dict[str, Any]:
    """Return the arrays of the budget gauge by kernel argument, see `kernels/delta/budget_sums.py`."""
    import warp as wp

    from warpsph.case.budget_terms import TERMS
    from warpsph.kernels.core.block_sums import FOLDS
    from warpsph.kernels.delta.budget_sums import BLOCKS, Sum

    terms, blocks = len(TERMS), BLOCKS[bool(device.is_cpu)]
    shapes: dict[str, Any] = {
        "budget_sums": (blocks, terms),
        "budget_changes": (blocks, terms),
        "budget_folds": (FOLDS, 2 * terms),
        "budget_kick": terms,
        "budget_work": terms,
        "budget_force": terms,
    }
    return {name: wp.zeros(shape, dtype=Sum, device=device) for name, shape in shapes.items()}
