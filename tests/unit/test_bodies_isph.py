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
    force = DRAG[share] * 0.01
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
    if across >= 48:
        # steady: the cylinder bears what drives the fluid beside it
        assert model.wall_forces()["wall_force_x cylinder"] == pytest.approx(force * (1.0 - share), rel=0.05)
    return force / speed / DRAG[share] - 1.0


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_drag_of_cylinders_converges_with_second_order(share: float) -> None:
    coarse, fine = (drag(across, share, 0.5) for across in (24, 48))
    assert abs(fine) < 0.02
    assert abs(coarse) > 3.0 * abs(fine)


@pytest.mark.parametrize("start", [{"noise": 0.25}, {"arrangement": "lattice"}])
def test_drag_of_cylinders_on_any_arrangement(start: dict) -> None:
    assert abs(drag(48, 0.1, 0.5, **start)) < 0.02


def test_flow_between_cylinders() -> None:
    inner, outer, turn, gaps = 0.5, 1.0, 0.02, 20
    spacing = (outer - inner) / gaps
    half = outer + 5 * spacing
    circles = {"inner": inner, "outer": outer}
    model = Model(
        Case.from_dict(
            {
                "dimension": 2,
                "particle_spacing": spacing,
                "end_time": 1.0,
                "domain": {"lower": [-half, -half], "upper": [half, half], "boundary": {"x": "periodic", "y": "periodic"}},
                "phases": {"oil": {"density": 1.0, "viscosity": 1.0}},
                "fluids": [{"phase": "oil", "shape": {"sphere": {"center": [0, 0], "radius": outer}}}],
                "bodies": {
                    name: {"shape": {"sphere": {"center": [0, 0], "radius": radius}}, "hollow": name == "outer"}
                    for name, radius in circles.items()
                },
                "numerics": {"scheme": "isph"},
            }
        )
    )
    particles, fluid = model.particles, model.geometry.fluid_count
    velocity, position = particles.get("velocity"), particles.get("position")[fluid:]
    foot = position + particles.get("wall_depth")[:, None] * particles.get("wall_normal")
    turning = particles.get("wall_body") == 1
    velocity[fluid:][turning] = turn * np.stack([-foot[turning, 1], foot[turning, 0]], axis=1)
    particles.put("velocity", velocity)
    model.stepper.prepare(True)
    model.stepper.run(0.5, 10**6)
    x, v = particles.get("position")[:fluid], particles.get("velocity")[:fluid]
    r = np.linalg.norm(x, axis=1)
    slope = turn * inner**2 / (inner**2 - outer**2)
    exact = slope * r - slope * outer**2 / r
    around = (v[:, 1] * x[:, 0] - v[:, 0] * x[:, 1]) / r
    assert np.abs(around - exact).max() < 0.01 * turn * inner
    assert np.abs((v * x).sum(axis=1) / r).max() < 0.01 * turn * inner
    forces = model.wall_forces()
    torque = -4.0 * math.pi * turn * inner**2 * outer**2 / (outer**2 - inner**2)
    assert forces["wall_torque_z inner"] / torque == pytest.approx(1.0, abs=0.03)
    assert forces["wall_torque_z outer"] / torque == pytest.approx(-1.0, abs=0.03)


TANK = {
    "dimension": 2,
    "particle_spacing": 1.0 / 40,
    "gravity": [0, -9.81],
    "domain": {"lower": [0, 0], "upper": [1, 1.2], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
    "phases": {"water": {"density": 1000.0, "viscosity": 1.0}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 1]}}}],
    "bodies": {"cylinder": {"shape": {"sphere": {"center": [0.5, 0.45], "radius": 0.2}}}},
    "numerics": {"scheme": "isph"},
}


def test_buoyancy_of_a_cylinder() -> None:
    forces = run(TANK, 0.2).wall_forces()
    weight = 1000.0 * 9.81 * math.pi * 0.2**2
    assert forces["wall_force_y cylinder"] / weight == pytest.approx(1.0, abs=0.01)
    assert abs(forces["wall_force_x cylinder"]) < 0.01 * weight


@pytest.mark.parametrize(("wall", "viscosity"), [("no_slip", 1.0e-3), ("free_slip", 0.0)])
def test_dam_break_onto_a_cylinder(wall: str, viscosity: float) -> None:
    model = run(
        {
            **TANK,
            "domain": {**TANK["domain"], "upper": [3, 2]},
            "phases": {"water": {"density": 1000.0, "viscosity": viscosity}},
            "bodies": {"pier": {"shape": {"sphere": {"center": [1.8, 0.3], "radius": 0.2}}, "wall": wall}},
        },
        0.6,
    )
    fluid = slice(0, model.geometry.fluid_count)
    x, v = model.particles.get("position")[fluid], model.particles.get("velocity")[fluid]
    assert (np.linalg.norm(x - [1.8, 0.3], axis=1) > 0.2).all()
    energy = (0.5 * (v**2).sum(axis=1) + 9.81 * x[:, 1]).mean()
    assert energy < 9.81 * 0.5  # what it began with
