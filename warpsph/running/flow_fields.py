"""Fields of the flow that follow from those of the particles when something asks for them: vorticity and Q."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp

from warpsph.kernels.core.flow_gradient import make_flow_gradient
from warpsph.kernels.core.spec import types_of

if TYPE_CHECKING:
    from warpsph.engine.launch import Launcher
    from warpsph.engine.population import Population
    from warpsph.engine.stepper import Stepper

DERIVED = ("vorticity", "q_criterion")
"""Names of the fields."""
NEEDED = frozenset({"position", "velocity", "acceleration"})
"""Fields of a scheme from which they follow."""


class FlowFields:
    """Finds the fields of the present state on the device.

    Args:
        particles: the fields of the scheme.
        launcher: launches kernels.
        stepper: has the neighbour list and the clock.
        staggered: velocities are half a step behind positions.
    """

    def __init__(self, particles: Population, launcher: Launcher, stepper: Stepper, staggered: bool) -> None:
        self.particles, self.launcher, self.stepper, self.staggered = particles, launcher, stepper, staggered
        self._arrays: dict[str, Any] = {}

    def measure(self) -> dict[str, Any]:
        """Return Warp arrays by name: vorticity (fluid,), in 3-D (fluid, 3), and q_criterion (fluid,); empty if the scheme
        has no flow.
        """
        particles, spec = self.particles, self.particles.spec
        if not particles.arrays.keys() >= NEEDED:
            return {}
        rows, components = particles.fluid_capacity, 3 if spec.dimension == 3 else 1
        if not self._arrays or len(self._arrays["q_criterion"]) != rows:
            real, device = types_of(spec).real, self.launcher.device
            self._arrays = {
                "vorticity": wp.zeros(rows * components, dtype=real, device=device),
                "q_criterion": wp.zeros(rows, dtype=real, device=device),
            }
        kernel = make_flow_gradient(spec, self.staggered)
        count = particles.fluid_count
        if count:
            self.launcher.task("flow gradient", kernel, count, self.stepper.bindings, special=self._arrays).run()
        vorticity = self._arrays["vorticity"]
        if components == 3:
            vorticity = vorticity.reshape((rows, components))
        return {"vorticity": vorticity, "q_criterion": self._arrays["q_criterion"]}
