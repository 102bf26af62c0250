"""Forces and walls that depend on time, in runs: exact answers, restarts, and what a constant one must not notice."""

import copy
import math
import shutil

import numpy as np
import pytest

from tests.scenes import LEAN, case_of
from tests.unit.test_restart import assert_same_files, assert_same_state, checkpoints
from warpsph import Simulation, run
from warpsph.scene.forcing import forcing_of
from warpsph.scene.geometry import build
from warpsph.scene.physics import derive, support_radius

BOX = {
    "dimension": 2,
    "particle_spacing": 1 / 12,
    "end_time": 0.3,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "free_slip", "y": "free_slip"}},
    "phases": {"water": {"density": 1000}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "output": {"particles": "none", "checkpoint": "none"},
}
FREE = {**BOX, "domain": {**BOX["domain"], "boundary": {"x": "periodic", "y": "periodic"}}, "particle_spacing": 1 / 16}
SCHEMES = ["riemann", "isph"]


def scene(data, **changes):
    return case_of(copy.deepcopy(data), **changes)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_free_fluid_follows_the_integral_of_the_force_to_second_order(scheme):
    """Velocity of a periodic box under cos(7t), 0.3t: the error falls fourfold when the step is halved."""
    exact = np.array([math.sin(7 * 0.3) / 7, 0.15 * 0.3**2])
    errors = []
    for step in (0.006, 0.003):
        case = scene(FREE, numerics={"scheme": scheme, "maximum_step": step}, body_force=["cos(7*t)", "0.3*t"])
        state = run(case, threads=1).state
        assert np.ptp(state.velocity, axis=0).max() < 1e-6
        errors.append(np.abs(state.velocity.mean(axis=0) - exact).max())
    assert errors[1] < 0.3 * errors[0] < 1e-3


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    "forces",
    [
        {"body_force": [3.0, 0.0]},
        {"gravity": [0.0, -1.0], "body_force": [0.0, 4.0]},
        {"gravity": ["3*sin(20*t**2)", "-9.81*cos(2*t)"], "body_force": [2.0, "5*t"]},
    ],
    ids=["constant", "against gravity", "varying"],
)
def test_a_closed_box_is_at_rest_under_any_force(scheme, forces):
    """p = rho (g + f).x, no motion: exact for the projection; the Riemann scheme rings a little with what it starts with."""
    case = scene(BOX, numerics={"scheme": scheme}, **forces)
    forcing = forcing_of(case)
    start = forcing.start()[0].tolist()
    case = case.replace({"start.pressure": f"1000*({start[0]!r}*(x - 0.5) + {start[1]!r}*(y - 0.5))"})
    state = run(case, threads=1).state.fluid
    g = np.array([float(part.at(0.3)) for part in forcing.gravity]) + [float(part.at(0.3)) for part in forcing.body_force]
    error = np.abs(state.pressure - 1000.0 * (state.position - 0.5) @ g).max() / (1000.0 * np.abs(g).sum())
    assert error < (1e-5 if scheme == "isph" else 0.02)
    assert np.abs(state.velocity).max() < (1e-5 if scheme == "isph" else 0.01)


def test_a_force_along_a_channel_is_no_pressure():
    """A constant body force along a periodic axis stays what it was: no part of what walls know."""
    channel = {**BOX["domain"], "boundary": {"x": "periodic", "y": "wall"}}
    case = scene(BOX, domain=channel, body_force=[0.1, 0.0], gravity=[0.0, -9.81])
    balanced, driving = forcing_of(case).start()
    assert balanced.tolist() == [0.0, -9.81] and driving.tolist() == [0.1, 0.0]
    spec = derive(case, build(case, support_radius(case))).spec
    assert spec.gravity and spec.body_force and not spec.varying_force


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_sliding_wall_drags_the_fluid_along(scheme):
    """Stokes' second problem over half a period, from the flow that repeats itself."""
    k, nu = 4.0, 2 * math.pi / 32
    sliding = {"wall": "no_slip", "velocity": ["cos(2*pi*t)", 0]}
    case = scene(
        BOX,
        end_time=0.5,
        particle_spacing=1 / 20,
        domain__upper=[0.4, 1],
        domain__boundary={"x": "periodic", "y": {"lower": sliding, "upper": "wall"}},
        phases={"oil": {"density": 1000, "viscosity": 1000 * nu, "gamma": 1}},
        fluids=[{"phase": "oil", "shape": "rest"}],
        start={"velocity": ["exp(-4*y)*cos(4*y)", 0]},
        numerics={"scheme": scheme},
    )
    state = run(case, threads=1).state.fluid
    y = state.position[:, 1]
    exact = np.exp(-k * y) * np.cos(math.pi - k * y)
    assert np.sqrt(np.mean((state.velocity[:, 0] - exact) ** 2)) < 0.02


def test_cells_in_corners_move_with_the_sides_that_they_are_behind():
    """The velocity of wall particles is that of the sides at the middle of the last step, the mean of two in an edge."""
    walls = {
        "x": {"lower": "wall", "upper": {"wall": "no_slip", "velocity": [0, "t"]}},
        "y": {"lower": {"wall": "no_slip", "velocity": ["2*t", 0]}, "upper": "wall"},
    }
    case = scene(BOX, domain__boundary=walls, phases={"water": {"density": 1000, "viscosity": 1.0}}, scales={"velocity": 1})
    simulation = run(case, threads=1)
    state = simulation.state
    wall, middle = state.wall, state.time - 0.5 * state.dt
    low, right = wall.position[:, 1] < 0, wall.position[:, 0] > 1
    edge = low & right
    expected = np.zeros_like(wall.velocity)
    expected[low, 0], expected[right, 1] = 2 * middle, middle
    np.testing.assert_allclose(wall.velocity[~edge & (low | right)], expected[~edge & (low | right)], rtol=1e-5)
    np.testing.assert_allclose(wall.velocity[edge], expected[edge], rtol=1e-5)
    static = build(case.replace({"end_time": 0.2}), support_radius(case))
    assert (static.velocity == 0).all()


def test_what_a_scene_will_see_knows_the_largest_force_and_wall():
    """Gravity and walls that are zero at first count with what they come to."""
    case = scene(BOX, end_time=10.0, gravity=[0, "-9.81*minimum(t, 1)"])
    later = derive(case, build(case, support_radius(case))).sound_speed[0]
    constant = scene(BOX, end_time=10.0, gravity=[0, -9.81])
    assert later == pytest.approx(derive(constant, build(constant, support_radius(constant))).sound_speed[0], rel=1e-6)
    slides = {"x": "periodic", "y": {"lower": "wall", "upper": {"wall": "no_slip", "velocity": ["3*sin(t)", 0]}}}
    case = scene(BOX, end_time=10.0, domain__boundary=slides)
    assert derive(case, build(case, support_radius(case))).scales["velocity"] == pytest.approx(3.0, rel=1e-3)
    shaken = scene(FREE, end_time=10.0, body_force=["2*cos(10*t)", 0])
    assert derive(shaken, build(shaken, support_radius(shaken))).scales["velocity"] == pytest.approx(0.4, rel=1e-3)


def test_potential_energy_is_that_of_gravity_at_the_moment():
    gauges = {"energy": {"type": "energy", "interval": 0.1}}
    case = scene(BOX, gravity=[0, "-1 - t"], gauges=gauges, numerics={"scheme": "isph"})
    found = run(case, threads=1).gauge("energy")
    np.testing.assert_allclose(found["potential"], 500.0 * (1.0 + found["time"]), rtol=1e-4)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_restart_continues_bit_by_bit(scheme, threads, tmp_path):
    """In the middle of forces and of a sliding wall, also with a later end; the table travels with the run folder."""
    (tmp_path / "s.csv").write_text("t,a\n0,0\n0.1,1\n0.2,0.5\n0.3,-1\n0.5,0\n", encoding="utf-8")
    from warpsph import Case

    walls = {"x": "periodic", "y": {"lower": "wall", "upper": {"wall": "no_slip", "velocity": ["sin(30*t)", 0]}}}
    data = {
        **LEAN,
        "end_time": 0.3,
        "domain": {**LEAN["domain"], "boundary": walls},
        "phases": {"water": {"density": 1.0, "viscosity": 0.01}},
        "gravity": [0, "-1 - 0.5*sin(20*t)"],
        "body_force": [{"table": "s.csv", "column": "a"}, 0.0],
        "numerics": {"scheme": scheme},
    }
    case = Case.from_dict(data, tmp_path)
    whole = tmp_path / "whole"
    Simulation(case, output=whole, threads=threads).run()
    assert (whole / "case.yaml").exists()
    part = tmp_path / "part"
    shutil.copytree(whole, part)
    kept = checkpoints(part)
    Simulation(case, output=part, restart=kept[len(kept) // 2], threads=threads).run()
    assert_same_files(whole, part)
    assert_same_state(checkpoints(whole)[-1], checkpoints(part)[-1])
    short = tmp_path / "short"
    Simulation(case.replace({"end_time": 0.2}), output=short, threads=threads).run()
    Simulation(case, output=short, restart=short, threads=threads).run()
    assert_same_state(checkpoints(whole)[-1], checkpoints(short)[-1])
