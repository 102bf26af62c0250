"""Pressures that a start leaves out and the fluid makes at once: their share, and how long their sound lasts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from warpsph.scene.forcing import forcing_of
from warpsph.scene.physics import flow_scales

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry

# What is left of the sound of a start when it counts as dead: half and double move the end of relaxation by 15 %
# (theory: riemann#relaxation; docs/records/sound.md#until).
DEAD = 0.01
# Particles of a phase at which the gradient of the start velocity is looked at, and neighbours of each that give it.
LOOKED_AT = 2000
NEIGHBOURS = 12
# Share of a run over which bodies are seen to move at its start.
SOON = 1.0e-6


def given(case: Case) -> bool:
    """Return whether the start has a pressure of its own, so that nothing sets in at once."""
    return case.start.pressure not in (None, "auto", "hydrostatic")


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
    along itself. A wall or a body that meets the fluid at another normal velocity has to turn it aside. The share is
    J/(J + P), J the dynamic pressure of the differences, from the mean velocity or from that of walls, and P what each
    phase sees without motion. Differences count from the share `least` of the fastest on.
    """
    if given(case):
        return 0.0
    fluid = geometry.kind == 0
    velocity, phase = geometry.velocity[fluid], geometry.phase[fluid]
    density = np.array([case.phases[name].density for name in case.phase_names])
    motion = max(
        density[k] * _turning(geometry.position[fluid][phase == k], velocity[phase == k], least) for k in range(len(density))
    )
    walls = _wall_velocity(case, geometry)
    fastest = max(np.abs(velocity).max(initial=0.0), np.abs(walls).max(initial=0.0))
    met = _met(case, geometry, walls) if fastest > 0 else 0.0
    if met > least * fastest:
        motion = max(motion, float(density.max()) * met**2)
    if motion == 0.0:
        return 0.0
    _, seen = flow_scales(case, geometry, tension, filled=True)
    return float(motion / (motion + seen.max()))


def _turning(position: np.ndarray, velocity: np.ndarray, least: float) -> float:
    """Return the largest square of a difference from the mean velocity [m^2/s^2], 0 where nothing turns the flow."""
    if len(position) <= NEIGHBOURS:
        return 0.0
    velocity = velocity - velocity.mean(axis=0)
    fastest = float((velocity**2).sum(axis=1).max())
    source = float(np.abs(_source(position, velocity)).max()) if fastest > 0 else 0.0
    return fastest if source * (np.ptp(position, axis=0).max() / math.pi) ** 2 > least * fastest else 0.0


def _wall_velocity(case: Case, geometry: Geometry) -> np.ndarray:
    """Return the velocity of each wall particle at time 0, (walls, d) m/s, those of bodies that move included."""
    walls = geometry.kind == 1
    velocity = geometry.boundary_velocity[walls].copy()
    soon = SOON * case.end_time
    for track in forcing_of(case).tracks:
        rows = geometry.body[walls] == geometry.body_names.index(track.name) + 1
        point = geometry.position[walls][rows]
        velocity[rows] = (track.place(point, soon) - track.place(point, 0.0)) / soon
    return velocity


def _met(case: Case, geometry: Geometry, wall_velocity: np.ndarray) -> float:
    """Return the largest normal velocity [m/s] at which walls and bodies meet the fluid beside them.

    wall_velocity: (walls, d), m/s
    """
    from scipy.spatial import cKDTree

    fluid = geometry.kind == 0
    position, velocity = geometry.position[fluid], geometry.velocity[fluid]
    near = 1.5 * case.spacing
    met = 0.0
    if geometry.surface is not None:
        walls, surface = ~fluid, geometry.surface
        first = surface.area != 0
        foot = (geometry.position[walls] + surface.depth[:, None] * surface.normal)[first]
        foot = geometry.lattice.within(foot, case.periodic)
        distance, there = cKDTree(position).query(foot, distance_upper_bound=near)
        beside = np.isfinite(distance)
        moved = velocity[there[beside]] - wall_velocity[first][beside]
        return float(np.abs((moved * surface.normal[first][beside]).sum(axis=1)).max(initial=0.0))
    lattice = geometry.lattice
    for axis, pair in enumerate(case.sides):
        for side, plane in ((pair.lower, lattice.lower[axis]), (pair.upper, lattice.upper[axis])):
            if side.kind == "wall":
                beside = np.abs(position[:, axis] - plane) < near
                met = max(met, float(np.abs(velocity[beside, axis]).max(initial=0.0)))
    return met


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
