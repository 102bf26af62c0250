"""Scenes of projection ISPH for tests of whole runs. They share their structures, because each new one compiles kernels."""

from typing import Any

import numpy as np

from tests.scenes import case_of
from warpsph import Simulation
from warpsph.scene.geometry import build
from warpsph.scene.physics import derive, support_radius

DX = 0.1
NONE = {"particles": "none", "checkpoint": "none"}
# All scenes with a free surface have one structure, so that they share their kernels.
TANK: dict[str, Any] = {
    "title": "tank",
    "dimension": 2,
    "particle_spacing": DX,
    "precision": "float64",
    "end_time": 0.1,
    "domain": {"lower": [0, 0], "upper": [0.9, 1.2], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
    "gravity": [0, -9.81],
    "phases": {"water": {"density": 1000.0, "viscosity": 0.001}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.9, 0.8]}}}],
    "numerics": {"scheme": "isph", "unlock": 0},
    "output": NONE,
}
# A drop over a floor that is far away, in hardly any gravity.
DROP: dict[str, Any] = {
    **TANK,
    "title": "drop",
    "domain": {"lower": [0, 0], "upper": [4, 4], "boundary": {"x": "open", "y": {"lower": "wall", "upper": "open"}}},
    "gravity": [0, -1e-9],
    "fluids": [{"phase": "water", "shape": {"sphere": {"center": [2, 2], "radius": 0.5}}}],
    "scales": {"velocity": 2, "length": 1},
}
VORTICES: dict[str, Any] = {
    "title": "vortices",
    "dimension": 2,
    "particle_spacing": 1 / 12,
    "precision": "float64",
    "end_time": 0.1,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {"water": {"density": 1.0, "viscosity": 0.01}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "start": {"velocity": ["-cos(2*pi*x)*sin(2*pi*y)", "sin(2*pi*x)*cos(2*pi*y)"]},
    "numerics": {"scheme": "isph", "unlock": 0},
    "output": NONE,
}
COUETTE: dict[str, Any] = {
    **VORTICES,
    "title": "couette",
    "particle_spacing": 0.1,
    "domain": {
        "lower": [0, 0],
        "upper": [1, 1],
        "boundary": {"x": "periodic", "y": {"lower": "wall", "upper": {"wall": "no_slip", "velocity": [1, 0]}}},
    },
    "start": {"velocity": ["y", 0], "noise": 0.1},
}
SCENES = {"tank": TANK, "drop": DROP, "vortices": VORTICES, "couette": COUETTE}


HARDLY = 1e-15  # a coefficient that acts on nothing, of a stage that is compiled


def spec_of(scene):
    """Return the structure of a scene."""
    case = case_of(scene)
    return derive(case, build(case, support_radius(case))).spec


def start(scene, threads=1, device="cpu", **changes):
    """Return the simulation of a scene, changed as for `scenes.case_of`."""
    return Simulation(case_of(scene, **changes), threads=threads, device=device)


def rows(simulation, name):
    """Return a fluid field in the order of the particle ids."""
    particles = simulation.model.particles
    values = particles.get(name)[: particles.fluid_count].astype(float)
    return values[np.argsort(particles.get("particle_id")[: particles.fluid_count])]
