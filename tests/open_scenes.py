"""Scenes with inlets and outlets, and what tests read off their runs."""

import copy

from warpsph.case.case import Case
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.fields import BUFFER
from warpsph.running.model import Model

# A box that fluid flows through, the same everywhere along y.
THROUGH = {
    "dimension": 2,
    "particle_spacing": 0.1,
    "end_time": 200.0,
    "domain": {
        "lower": [0, 0],
        "upper": [1, 0.8],
        "boundary": {
            "x": {"lower": {"inlet": {"velocity": [1, 0]}}, "upper": {"outlet": {"pressure": 0}}},
            "y": "periodic",
        },
    },
    "phases": {"water": {"density": 2.0, "sound_speed": 10.0}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "start": {"velocity": [1, 0]},
}

# A channel of height 1 with no-slip walls, Re = 20 of mean speed 1.
PARABOLA = "6*y*(1 - y)"
CHANNEL = {
    **THROUGH,
    "domain": {
        "lower": [0, 0],
        "upper": [3, 1],
        "boundary": {
            "x": {"lower": {"inlet": {"velocity": [PARABOLA, 0]}}, "upper": {"outlet": {"pressure": 0}}},
            "y": "wall",
        },
    },
    "phases": {"water": {"density": 1.0, "viscosity": 0.05, "gamma": 1, "sound_speed": 15.0}},
    "start": {"velocity": [PARABOLA, 0]},
}
INLET = "domain.boundary.x.lower.inlet"
OUTLET = "domain.boundary.x.upper.outlet"


def scene(data, **changes):
    """A case with changes by dotted path, __ for the dot."""
    case = Case.from_dict(copy.deepcopy(data))
    return case.replace({path.replace("__", "."): value for path, value in changes.items()}) if changes else case


def prepared(case, device, threads=1):
    """A run of the case, its list built."""
    model = Model(case, device=device, threads=threads)
    model.stepper.prepare(fresh=True)
    return model


def run(model, time):
    """Step to a time [s] without a fault."""
    model.stepper.run(time, 10**8)
    assert model.stepper.read()[1][ck.FAULT] == 0
    return model.snapshot()


def buffers(model):
    """Zone, position, velocity and pressure of the particles in the buffers."""
    zone = model.particles.get("zone")
    there = zone >= BUFFER
    fields = (model.particles.get(name)[: len(zone)][there] for name in ("position", "velocity", "state"))
    return zone[there], *fields


def through(model):
    """Mass that has come in less what has gone out [kg/m]."""
    masses = model.stepper.bindings["through"].numpy().reshape(-1, 2)
    return float((masses[:, 0] - masses[:, 1]).sum())
