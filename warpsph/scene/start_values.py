"""Start values of fluid particles that follow from the case."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics


MEETING = 4  # spacings: edge of the cells in which fluids count as meeting, about a support


def nominal_pressure(case: Case, geometry: Geometry, physics: Physics) -> np.ndarray:
    """Return the pressure at which each phase has the density of the case, (phases,) Pa (theory: riemann#a1).

    Where several fluids fill the domain it is the mean of the start where the phase meets others: what a difference of
    densities does it does there. At a free surface, and for one fluid, whose mass counts for nothing but a factor, it is 0.
    """
    spec = physics.spec
    count = len(case.phase_names)
    if not spec.multiphase or spec.free_surface or spec.printed:
        return np.zeros(count)
    nf = geometry.fluid_count
    phase, volume, pressure = geometry.phase[:nf], geometry.volume[:nf], geometry.pressure[:nf]
    if not pressure.any():
        return np.zeros(count)
    weight = volume * _meetings(geometry.position[:nf] / (MEETING * case.spacing), phase, count)
    alone = np.bincount(phase, weight, count) == 0.0
    weight = np.where(alone[phase], volume, weight)  # a phase that meets none has its mean
    total = np.bincount(phase, weight, count)
    return np.asarray(np.bincount(phase, weight * pressure, count) / np.maximum(total, np.finfo(float).tiny))


def _meetings(position: np.ndarray, phase: np.ndarray, count: int) -> np.ndarray:
    """Return in how many of two grids of unit cells, half a cell apart, a particle is in a cell with other phases, (n,)."""
    meetings = np.zeros(len(phase))
    for offset in (0.0, 0.5):
        cells = np.floor(position - position.min(axis=0) + offset).astype(np.int64)
        cell = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
        first = np.full(cell.max() + 1, count)
        last = np.full(cell.max() + 1, -1)
        np.minimum.at(first, cell, phase)
        np.maximum.at(last, cell, phase)
        meetings += first[cell] != last[cell]
    return meetings


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
