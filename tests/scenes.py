"""Small scenes for tests of whole runs. Tests share them, because each new structure compiles kernels."""

import copy
from typing import Any

from warpsph.case.case import Case

# Taylor-Green vortices at about Mach 0.1: corrected gradient, viscosity, shift, volume constraint.
PERIODIC: dict[str, Any] = {
    "title": "vortices",
    "dimension": 2,
    "particle_spacing": 1 / 20,
    "end_time": 0.2,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {"water": {"density": 1.0, "viscosity": 0.01}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "start": {
        "noise": 0.1,
        "velocity": ["-cos(2*pi*x)*sin(2*pi*y)", "sin(2*pi*x)*cos(2*pi*y)"],
    },
    "numerics": {"skin": 0.3},
    "output": {"particles": {"interval": 0.05}, "checkpoint": {"interval": 0.02, "keep": 20}},
    "gauges": {
        "energy": {"type": "energy", "interval": 0.02},
        "probe": {
            "type": "points",
            "points": [[0.5, 0.5]],
            "fields": ["pressure", "velocity"],
            "interval": 0.1,
        },
    },
}

# The same box with as little physics as there is.
LEAN: dict[str, Any] = {
    **PERIODIC,
    "title": "lean",
    "phases": {"water": {"density": 1.0}},
    "numerics": {"skin": 0.3, "pressure_gradient": "conservative", "disorder_friction": 0},
}

# Half a wave of sound to and fro between two walls without friction, 20 spacings: one of the domain, one of a body.
SOUND: dict[str, Any] = {
    "dimension": 2,
    "particle_spacing": 0.05,
    "end_time": 10,
    "domain": {"lower": [0, -1], "upper": [0.5, 1], "boundary": {"x": "periodic", "y": "free_slip"}},
    "phases": {"water": {"density": 1, "sound_speed": 10}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "bodies": {"floor": {"shape": {"box": {"lower": [-1, -2], "upper": [2, 0]}}, "wall": "free_slip"}},
    "start": {"pressure": "0.1*cos(pi*y)"},
}

# A drop in a box: two phases, tension, walls, gravity, viscosity, corrected gradient, shift.
FULL: dict[str, Any] = {
    "title": "drop in a box",
    "dimension": 2,
    "particle_spacing": 1 / 16,
    "end_time": 0.4,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
    "gravity": [0, -0.1],
    "phases": {
        "gas": {"density": 1.0, "viscosity": 0.005, "gamma": 1.4},
        "liquid": {"density": 100, "viscosity": 0.05},
    },
    "surface_tension": [{"between": ["gas", "liquid"], "coefficient": 0.5}],
    "fluids": [
        {"phase": "liquid", "shape": {"box": {"lower": [0.25, 0.25], "upper": [0.75, 0.75]}}},
        {"phase": "gas", "shape": "rest"},
    ],
    "numerics": {"skin": 0.06},
    "output": {
        "particles": {
            "interval": 0.1,
            "fields": ["velocity", "pressure", "density", "phase", "normal", "curvature"],
        },
        "checkpoint": {"interval": 0.05, "keep": 20},
    },
    "gauges": {
        "jump": {"type": "phase_pressure", "interval": 0.02},
        "interface": {"type": "interface_length", "interval": 0.05},
        "load": {"type": "wall_force", "interval": 0.05},
        "shape": {"type": "extents", "interval": 0.1},
    },
}


def case_of(scene: dict[str, Any], **changes: Any) -> Case:
    """Return the case of a scene, changed by dotted path, with __ for the dot: `numerics__skin=0.1`."""
    case = Case.from_dict(copy.deepcopy(scene))
    return (
        case.replace({path.replace("__", "."): value for path, value in changes.items()}) if changes else case
    )
