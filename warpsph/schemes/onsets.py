"""Pressures that a start leaves out and the fluid makes at once: their share, and how long their sound lasts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.physics import flow_scales

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry

# What is left of the sound of a start when it counts as dead: half and double move the end of relaxation by 15 % (theory:
# riemann#relaxation, docs/records/sound.md#until).
DEAD = 0.01
# Particles of a phase at which the gradient of the start velocity is looked at, and neighbours of each that give it.
LOOKED_AT = 2000
NEIGHBOURS = 12


def given(case: Case) -> bool:
    """Return whether the start has a pressure of its own, so that nothing sets in at once."""
    return case.start.pressure not in (None, "hydrostatic")


def tension_onset(case: Case, geometry: Geometry, tension: np.ndarray) -> float:
    """Return the share of the pressures that tension makes at once, 0 to 1; 0 where the start gives the pressure."""
    if not (tension > 0).any() or given(case):
        return 0.0
    _, whole = flow_scales(case, geometry, tension, filled=True)
    _, without = flow_scales(case, geometry, np.zeros_like(tension), filled=True)
    jump = float((whole - without).max())
    return jump / (jump + float(without.max())) if jump > 0 else 0.0


def motion_onset(case: Case, geometry: Geometry, tension: np.ndarray, least: float) -> float:
    """Return the share of the pressures that start velocities make at once, 0 to 1; 0 where the start gives the pressure.

    A flow v without divergence has the pressure of lap p = -rho tr(G G), G = grad v: none where it is uniform or sheared
    along itself. The share is J/(J + P), J the largest dynamic pressure of the differences from the mean velocity and P what
    each phase sees without motion. It is 0 if the source, over the longest side of the phase, makes less than `least` of J.
    """
    if given(case):
        return 0.0
    motion = 0.0
    fluid = geometry.kind == 0
    position, velocity, phase = geometry.position[fluid], geometry.velocity[fluid], geometry.phase[fluid]
    for k, name in enumerate(case.phase_names):
        x, v = position[phase == k], velocity[phase == k]
        if len(x) <= NEIGHBOURS:
            continue
        v = v - v.mean(axis=0)
        fastest = float((v**2).sum(axis=1).max())
        source = np.abs(_source(x, v)).max() if fastest > 0 else 0.0
        if source * float(np.ptp(x, axis=0).max() / math.pi) ** 2 > least * fastest:
            motion = max(motion, case.phases[name].density * fastest)
    if motion == 0.0:
        return 0.0
    _, seen = flow_scales(case, geometry, tension, filled=True)
    return motion / (motion + float(seen.max()))


def _source(position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return tr(G G) - (tr G)^2 [1/s^2] at some of the particles, G the gradient of the velocity that fits neighbours best.

    The second term is that of a divergence, which the flow has none of and the fit has: without both a flow that is sheared
    along itself has no source on uneven particles either.
    """
    from scipy.spatial import cKDTree

    some = np.linspace(0, len(position) - 1, min(LOOKED_AT, len(position))).astype(int)
    _, near = cKDTree(position).query(position[some], k=NEIGHBOURS + 1)
    x = position[near] - position[near].mean(axis=1, keepdims=True)
    v = velocity[near] - velocity[near].mean(axis=1, keepdims=True)
    gradient = np.linalg.pinv(x) @ v
    return np.asarray(np.einsum("nij,nji->n", gradient, gradient) - np.einsum("nii->n", gradient) ** 2)


def dying(relaxation: float, wave: float) -> float:
    """Return the time [s] after which the sound of a start has died to 1 %, with the rate m/(4 tau) of the longest wave.

    relaxation: m, stiffness of the part of the pressure that fades; wave: tau [s], see `riemann_physics.longest_wave`.
    """
    return 4.0 * math.log(1.0 / DEAD) * wave / relaxation
