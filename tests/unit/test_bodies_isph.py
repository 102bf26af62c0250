"""Bodies in projection ISPH against exact solutions: drag in Stokes flow, flow between cylinders, buoyancy, robustness."""

import math

import numpy as np
import pytest
from warpsph.case.case import Case
from warpsph.running.model import Model

DRAG = {0.1: 24.83, 0.4: 217.89}  # K = F/(mu U) of the square array (Sangani & Acrivos 1982), by solid fraction


def run(case: dict, until: float) -> Model:
    """Return a model after `until` seconds, which it must reach without a fault."""
    model = Model(Case.from_dict({**case, "end_time": until}))
    model.stepper.prepare(True)
    model.stepper.run(until, 10**6)
    assert model.time == pytest.approx(until)
    return model


def drag(across: int, share: float, until: float, **start: object) -> float:
    """Return K of a square array of cylinders over the exact one, less 1.

    The force that drives the fluid is a mean pressure gradient over the whole box: F is its product with the box.
    """
    force, speed = DRAG[share] * 0.01, 0.0
    model = run(
        {
            "dimension": 2,
            "particle_spacing": 1.0 / across,
            "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
            "body_force": [force, 0],
            "phases": {"oil": {"density": 1.0, "viscosity": 1.0}},
            "fluids": [{"phase": "oil", "shape": "rest"}],
            "bodies": {"cylinder": {"shape": {"sphere": {"center": [0.5, 0.5], "radius": math.sqrt(share / math.pi)}}}},
            "numerics": {"scheme": "isph"},
            "start": start,
        },
        until,
    )
    fluid = slice(0, model.geometry.fluid_count)
    volume = model.particles.get("rest_volume")
    speed = float((model.particles.get("velocity")[fluid, 0] * volume).sum())
    return force / speed / DRAG[share] - 1.0


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_drag_of_cylinders_converges_with_second_order(share: float) -> None:
    coarse, fine = (drag(across, share, 0.5) for across in (24, 48))
    assert abs(fine) < 0.02
    assert abs(coarse) > 3.0 * abs(fine)


@pytest.mark.parametrize("start", [{"noise": 0.25}, {"arrangement": "lattice"}])
def test_drag_of_cylinders_on_any_arrangement(start: dict) -> None:
    assert abs(drag(48, 0.1, 0.5, **start)) < 0.02
