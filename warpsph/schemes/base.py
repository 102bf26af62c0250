"""What every scheme has. Light: nothing here imports Warp, a kernel or another part of the package."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np

    from warpsph.case.numerics import NumericsBase
    from warpsph.engine.level import Level, Systems
    from warpsph.engine.population import Population
    from warpsph.engine.program import Absent, Program
    from warpsph.errors import Problem
    from warpsph.kernels.core.fields import Field
    from warpsph.kernels.core.spec import Spec
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics

__all__ = ["LOAD_ARRAYS", "Fault", "Scheme"]

LOAD_ARRAYS = frozenset(
    {"load", "friction", "couple", "twist", "body_turn", "facet_first", "facet_arm", "facet_normal", "facet_area",
     "facet_vector", "facet_moment", "facet_pressure", "facet_friction"}
)  # fmt: skip
"""Arrays that gauges of loads bring with them (`warpsph/running/wall_loads.py`)."""


class Fault(NamedTuple):
    """What is wrong with a particle: the quantity at fault, its value with unit and limit, cause and remedy."""

    quantity: str
    value: str
    cause: str


class Scheme:
    """A way to solve the equations of a scene; it owns all that is its own, and no other file asks which scheme runs.

    What a scheme must have: `name`, `summary`, `numerics`, `derive`, `fields`, `program`. All else has a default.

    Attributes:
        name: what `numerics.scheme` calls it.
        summary: one line about it.
        numerics: model of the section `numerics` of its cases.
        mirrors_sides: walls at sides of the domain are mirror images of the fluid, not particles.
        continues_sides: without bodies the sides of the domain have a surface of their own, as bodies have.
        loaded_start: one fluid that fills a closed domain starts with the pressure of its weight where the case leaves it
            open: it would swing under it for long, and its upper half would be torn.
        printed_ratio: smoothing length over spacing of `formulation: paper`, or None for the usual one.
        usual_ratio: smoothing length over spacing that `auto` means otherwise, or None for that of the other schemes.
        ratios: the same by the dimension, where it depends on that.
        dimensions: numbers of space dimensions that it knows.
        varying_density: the density of a phase may vary in space at the start (`start.density`).
        internal_energy: the fluid has an internal energy of its own, `Spec.internal_energy`.
        skin: of the neighbour list, as share of the support radius, where the case says `auto`.
        shifts: particles are shifted whatever the pressure gradient is, for the estimate of memory.
        shown: names of fields that a snapshot carries in `own`, beside those of every scheme.
        work: names of arrays beside the fields that kernels ask for and that may be absent.
        kept: names of arrays beside the fields that a restart goes on from, where a run has them.
        follows_origins: its program has the stages of `map_stages`, which Lyapunov exponents need.
        open_sides: sides of the domain may be inlets and outlets.
        mean_edges: boundary particles in corners of bodies have the mean normal of their faces. Contact with the plane of
            the nearest foot, one for each axis, needs those of faces.
        usual_causes: of a run that diverges, the end of its message; each with the key that it hangs on, if it has one.
        budgets: a gauge of type budget can follow where momentum and energy come from and go.
        free_pressure: all of them may give a velocity, so that the pressure is known but for a constant.
    """

    name: str
    summary: str
    numerics: type[NumericsBase]
    mirrors_sides: bool = False
    continues_sides: bool = False
    loaded_start: bool = False
    printed_ratio: float | None = None
    usual_ratio: float | None = None
    ratios: Mapping[int, float] = {}
    dimensions: tuple[int, ...] = (2, 3)
    varying_density: bool = False
    internal_energy: bool = False
    skin: float = 0.12
    shifts: bool = False
    shown: tuple[str, ...] = ()
    work: frozenset[str] = frozenset()
    kept: tuple[str, ...] = ()
    follows_origins: bool = False
    open_sides: bool = False
    free_pressure: bool = False
    budgets: bool = False
    mean_edges: bool = False
    usual_causes: str = (
        "a sound speed that is too low, a start far from equilibrium, or too large a Courant number (numerics.courant)"
    )

    # a case ------------------------------------------------------------------------------------------------------------

    def check(self, case: Any) -> Iterator[Problem]:
        """Yield what is wrong with a case of this scheme, beyond its single values.

        case: a Case, or what could be read of a faulty one. Of the latter, a value that could not be read ends the check
            that uses it; it has been reported.
        """
        yield from ()

    def derive(self, case: Any, geometry: Geometry, row_list: bool) -> Physics:
        """Return the numbers of a run: structure, what `auto` comes to and why, sound speeds, limits of the time step.

        Raises:
            CaseError: the scene does not suit the scheme.
        """
        raise NotImplementedError

    # what runs -----------------------------------------------------------------------------------------------------------

    def fields(self) -> Sequence[Field]:
        """Return the declarations of all its particle fields."""
        raise NotImplementedError

    def program(self, spec: Spec, choices: Mapping[str, Any]) -> Program:
        """Return what runs for a structure and the choices of its `Physics`."""
        raise NotImplementedError

    def staggered(self, spec: Spec) -> bool:
        """Return whether velocities are half a step behind positions, as of a leapfrog."""
        return False

    def absent(self, spec: Spec) -> list[Absent]:
        """Return what a step leaves out for a structure, and why."""
        return []

    # the start -----------------------------------------------------------------------------------------------------------

    def room(self, case: Any, geometry: Geometry, physics: Physics) -> int:
        """Return for how many fluid particles there is room at first, where their number changes (`Spec.changing`)."""
        return geometry.fluid_count

    def fill(self, population: Population, case: Any, geometry: Geometry, physics: Physics) -> None:
        """Put the start values into fields beside anchor, position, velocity, phase, id and those of the walls."""

    def values(self, params: Any, case: Any, geometry: Geometry, physics: Physics, device: Any) -> dict[str, Any]:
        """Set its members of `params`, and return further kernel arguments by name, arrays on the device."""
        return {}

    def set_clock(self, clock: np.ndarray, counters: np.ndarray, physics: Physics) -> None:
        """Set its entries of the clock, see `kernels/core/clock.py`, in place."""

    def systems(self, case: Any, geometry: Geometry, physics: Physics) -> Callable[[Level], Systems] | None:
        """Return what makes its linear systems for a level, or None if it has none."""
        return None

    # what is read off a run -----------------------------------------------------------------------------------------

    def flow_rates(self, case: Any, geometry: Geometry, physics: Physics, bindings: Mapping[str, Any]) -> dict[str, float]:
        """Return what goes through inlets and outlets, for gauges; see `warpsph.measure.flow_gauges`."""
        return {}

    def fault(self, case: Any, geometry: Geometry, physics: Physics, population: Population, row: int) -> Fault | None:
        """Return what is wrong with the particle in a row that stopped the run, if the scheme knows more than its speed."""
        return None

    def pair_cost(self, spec: Spec) -> float:
        """Return how long a pair of particles takes over one of the Riemann scheme, for the estimate of `check`."""
        return 1.0

    def memory_beside(self, spec: Spec, fluid: int, entries: int) -> int:
        """Return the bytes on the device beside fields and list, of so many particles with so many list entries each."""
        return 0
