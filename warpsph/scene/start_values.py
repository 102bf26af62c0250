"""Start values of fluid particles that follow from the case."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics


def density_excess(case: Case, geometry: Geometry, physics: Physics) -> np.ndarray:
    """Return rho/rho0 - 1 that goes with the pressure of the start, (fluid,): s = (p/B + 1)^(1/gamma) - 1."""
    phases = [case.phases[name] for name in case.phase_names]
    nf = geometry.fluid_count
    phase = geometry.phase[:nf]
    stiffness = np.array([p.density * c**2 / p.gamma for p, c in zip(phases, physics.sound_speed, strict=True)])
    gamma = np.array([p.gamma for p in phases])
    excess = np.expm1(np.log1p(np.maximum(geometry.pressure[:nf] / stiffness[phase], -0.9)) / gamma[phase])
    return np.asarray(excess)
