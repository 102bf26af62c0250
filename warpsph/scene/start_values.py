"""Start values of fluid particles that follow from the case."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics


def nominal_pressure(case: Case, geometry: Geometry, physics: Physics) -> np.ndarray:
    """Return the pressure at which each phase has the density of the case, (phases,) Pa (theory: riemann#a1).

    Where several fluids fill the domain it is the mean of the start over the phase, so that each has the mass of its density
    times its room; at a free surface, and for one fluid, whose mass counts for nothing but a factor, it is 0.
    """
    spec = physics.spec
    count = len(case.phase_names)
    if not spec.multiphase or spec.free_surface or spec.printed:
        return np.zeros(count)
    nf = geometry.fluid_count
    phase, volume = geometry.phase[:nf], geometry.volume[:nf]
    pressures = np.bincount(phase, volume * geometry.pressure[:nf], count)
    return np.asarray(pressures / np.maximum(np.bincount(phase, volume, count), np.finfo(float).tiny))


def density_excess(case: Case, geometry: Geometry, physics: Physics) -> np.ndarray:
    """Return rho/rho0 - 1 of the pressure p of the start, (fluid,): s = ((p - p_n)/B + 1)^(1/gamma) - 1."""
    phases = [case.phases[name] for name in case.phase_names]
    nf = geometry.fluid_count
    phase = geometry.phase[:nf]
    pressure = geometry.pressure[:nf] - nominal_pressure(case, geometry, physics)[phase]
    stiffness = np.array([p.density * c**2 / p.gamma for p, c in zip(phases, physics.sound_speed, strict=True)])
    gamma = np.array([p.gamma for p in phases])
    excess = np.expm1(np.log1p(np.maximum(pressure / stiffness[phase], -0.9)) / gamma[phase])
    return np.asarray(excess)
