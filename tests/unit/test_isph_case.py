"""Whole steps of projection ISPH through `Simulation`: rest, invariances, exact motions, order in time, restart."""

import copy
import math
from typing import Any

import numpy as np
import pytest

from tests.isph_scenes import COUETTE, DROP, DX, HARDLY, TANK, VORTICES, rows, start
from tests.scenes import case_of
from warpsph import Simulation
from warpsph.engine import launch
from warpsph.files import checkpoint
from warpsph.kernels.core import clock as ck


def steps(simulation, count):
    """Do `count` steps towards the end time; return the state."""
    simulation.model.stepper.run(simulation.case.end_time, count)
    assert simulation.model.steps == count
    return simulation.state


def deep(scene, height=0.8):
    """Return the start pressure and speed scale of a tank."""
    return 1000.0 * 9.81 * height, math.sqrt(9.81 * height)


def in_three(scene, **changes):
    """Return a scene in 3-D, the third axis like the first; the second stays the vertical."""
    scene = copy.deepcopy(scene)
    scene["dimension"] = 3
    domain = scene["domain"]
    domain["lower"], domain["upper"] = [*domain["lower"], 0], [*domain["upper"], domain["upper"][0]]
    domain["boundary"]["z"] = domain["boundary"]["x"]
    if "gravity" in scene:
        scene["gravity"] = [*scene["gravity"], 0]
    for fluid in scene["fluids"]:
        shape = fluid["shape"]
        if isinstance(shape, dict) and "box" in shape:
            box = shape["box"]
            box["lower"], box["upper"] = [*box["lower"], box["lower"][0]], [*box["upper"], box["upper"][0]]
        if isinstance(shape, dict) and "sphere" in shape:
            shape["sphere"]["center"] = [*shape["sphere"]["center"], shape["sphere"]["center"][0]]
    return {**scene, **changes}


# rest -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_tank_is_at_rest_after_one_step(dimension, precision, device):
    """From p = 0: the first solve finds the hydrostatic pressure; what is left is what the solver leaves."""
    scene = TANK if dimension == 2 else in_three(TANK)
    if dimension == 3:
        scene["domain"]["upper"], scene["fluids"][0]["shape"]["box"]["upper"] = [0.6, 1.0, 0.6], [0.6, 0.6, 0.6]
    height = 0.8 if dimension == 2 else 0.6
    simulation = start(scene, device=device, precision=precision, numerics__tolerance=1e-8)
    state = steps(simulation, 1)
    pressure, speed = deep(scene, height)
    assert np.linalg.norm(state.velocity, axis=1).max() < 1e-5 * speed
    np.testing.assert_allclose(state.pressure, pressure * (1 - state.position[:, 1] / height), rtol=0, atol=1e-4 * pressure)
    state = steps_more(simulation, 9)
    assert np.linalg.norm(state.velocity, axis=1).max() < 1e-4 * speed


def steps_more(simulation, count):
    """Do `count` steps more; return the state."""
    simulation.model.stepper.run(simulation.case.end_time, count)
    return simulation.state


def test_a_disordered_tank_stays_at_rest(device):
    """Nothing in the equations is wrong for a linear pressure on an uneven arrangement."""
    simulation = start(TANK, device=device, start__noise=0.1, start__seed=3, numerics__tolerance=1e-9)
    state = steps(simulation, 1)
    _, speed = deep(TANK)
    assert np.linalg.norm(state.velocity, axis=1).max() < 0.03 * speed


def test_couette_flow_is_steady(device):
    """The linear profile between a moving and a standing no-slip side, particles disordered."""
    simulation = start(COUETTE, device=device, numerics__maximum_step=0.01, numerics__volume_feedback=0)
    state = steps(simulation, 3)
    np.testing.assert_allclose(state.velocity[:, 0], state.position[:, 1], atol=2e-3)
    assert np.abs(state.velocity[:, 1]).max() < 2e-3


# invariances ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_moving_box_sees_the_same_flow(precision, device):
    """A uniform velocity changes nothing but positions, also across the periodic sides."""
    velocity = VORTICES["start"]["velocity"]
    drifting = {**VORTICES, "start": {"velocity": [f"{velocity[0]} + 2", f"{velocity[1]} - 3"]}}
    fixed = {"numerics__maximum_step": 0.005, "end_time": 1.0, "precision": precision, "numerics__relaxed_divergence": False}
    tight = {"numerics__tolerance": 1e-11 if precision == "float64" else 1e-8}
    still = steps(start(VORTICES, device=device, **fixed, **tight), 8)
    moved = steps(start(drifting, device=device, **fixed, **tight), 8)
    close = {"float64": 1e-7, "float32": 3e-4}[precision]
    np.testing.assert_allclose(moved.velocity - [2.0, -3.0], still.velocity, rtol=0, atol=close)
    way = (moved.position - still.position - [0.08, -0.12] + 0.5) % 1.0 - 0.5
    assert np.abs(way).max() < close
    one, other = (state.pressure - state.pressure.mean() for state in (moved, still))
    np.testing.assert_allclose(one, other, rtol=0, atol=20 * close)


def test_a_turned_drop_moves_in_the_same_way(device):
    """Stretched along x or along y: the same drop, turned by a quarter."""
    stretch = {"end_time": 0.2, "numerics__maximum_step": 0.005, "numerics__tolerance": 1e-11}
    one = steps(start({**DROP, "start": {"velocity": ["x-2", "2-y"]}}, device=device, **stretch), 5)
    other = steps(start({**DROP, "start": {"velocity": ["2-x", "y-2"]}}, device=device, **stretch), 5)
    turned = np.stack([4.0 - other.position[:, 1], other.position[:, 0]], axis=1)
    order = [int(np.argmin(np.linalg.norm(turned - x, axis=1))) for x in one.position]
    assert len(set(order)) == len(order)
    np.testing.assert_allclose(turned[order], one.position, atol=1e-8)
    velocity = np.stack([-other.velocity[:, 1], other.velocity[:, 0]], axis=1)
    np.testing.assert_allclose(velocity[order], one.velocity, atol=1e-7)


def test_a_flying_drop_is_not_disturbed(device):
    """A drop with one velocity keeps it: no pressure, no shift, no surface effect."""
    simulation = start({**DROP, "start": {"velocity": [1.5, 0.5]}}, device=device, numerics__maximum_step=0.01, end_time=1.0)
    before = simulation.state
    state = steps(simulation, 10)
    np.testing.assert_allclose(state.velocity, before.velocity, atol=1e-7)
    np.testing.assert_allclose(state.position, before.position + state.time * np.array([1.5, 0.5]), atol=1e-7)
    assert np.abs(state.pressure).max() < 1e-3


def test_momentum_of_a_periodic_box(device):
    """The corrected gradient changes it by 1e-4 a step on a disordered arrangement; the printed one keeps it.

    Hardly any friction and shift: both are corrected for disorder as well.
    """
    noise = {"start__noise": 0.1, "end_time": 1.0, "numerics__maximum_step": 0.005, "phases__water__viscosity": 1e-16}
    for formulation, most in (("improved", 5e-3), ("paper", 1e-12)):
        simulation = start(
            VORTICES, device=device, numerics__formulation=formulation, numerics__shifting=HARDLY, **noise
        )
        before = simulation.state
        state = steps(simulation, 10)
        lost = ((state.velocity - before.velocity) * state.mass[:, None]).sum(axis=0)
        assert np.abs(lost).max() < most * (np.abs(before.velocity).max() * state.mass.sum())


# exact motions --------------------------------------------------------------------------------------------------------

SINGLE = {**DROP, "title": "one particle", "gravity": [0, -9.81], "end_time": 0.2}
SINGLE["fluids"] = [{"phase": "water", "shape": {"box": {"lower": [1.95, 1.95], "upper": [2.05, 2.05]}}}]


def flight(scene, device, step, end=0.1, **changes):
    simulation = start(scene, device=device, end_time=end, numerics__maximum_step=step, **changes)
    simulation.run()
    return simulation.state


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_particle_in_free_flight(dimension, device):
    """A parabola: after the first-order start both velocity and way are those of BDF2, which has no error in a parabola."""
    velocity = [1.0, 2.0, -1.0][:dimension]
    scene = {**(SINGLE if dimension == 2 else in_three(SINGLE)), "start": {"velocity": velocity}}
    first = start(scene, device=device).state.position[0]
    errors = []
    for step in (0.01, 0.005):
        state = flight(scene, device, step)
        assert len(state.position) == 1
        np.testing.assert_allclose(state.velocity[0], np.array(velocity) - [0, 9.81 * 0.1, 0][:dimension], atol=1e-12)
        errors.append(state.position[0] - first - 0.1 * np.array(velocity) + [0, 0.5 * 9.81 * 0.01, 0][:dimension])
        # the first step, u dt without g dt^2/2, is the only error
        np.testing.assert_allclose(errors[-1][1], 0.5 * 9.81 * step**2, rtol=1e-6)
        np.testing.assert_allclose(errors[-1][0], 0.0, atol=1e-12)


@pytest.mark.parametrize("shape", ["three particles", "two drops"])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_few_particles_and_touching_drops(shape, precision, device):
    """Three particles side by side, and two drops with a common point, fall as a whole."""
    if shape == "three particles":
        fluids = [{"phase": "water", "shape": {"box": {"lower": [1.8, 2], "upper": [2.1, 2.1]}}}]
    else:
        fluids = [
            {"phase": "water", "shape": {"sphere": {"center": [x, 2], "radius": 0.3}}} for x in (1.7, 2.3)
        ]  # fmt: skip
    scene = {**DROP, "gravity": [0, -9.81], "fluids": fluids}
    simulation = start(scene, device=device, precision=precision, numerics__maximum_step=0.01)
    before = simulation.state
    assert len(before.position) == 3 if shape == "three particles" else len(before.position) > 40
    simulation.run()
    state = simulation.state
    fall = -9.81 * state.time
    close = {"float64": 1e-4, "float32": 2e-3}[precision]
    np.testing.assert_allclose(state.velocity[:, 1], fall, atol=close)
    assert np.abs(state.velocity[:, 0]).max() < close
    np.testing.assert_allclose(state.position[:, 0], before.position[:, 0], atol=close)


def test_two_drops_that_meet(device):
    """They hit each other: momentum stays, nothing flies off."""
    fluids = [{"phase": "water", "shape": {"sphere": {"center": [x, 2], "radius": 0.3}}} for x in (1.6, 2.4)]
    scene = {**DROP, "fluids": fluids, "start": {"velocity": ["2-x", 0]}, "end_time": 1.0}
    simulation = start(scene, device=device)
    before = np.abs(simulation.state.velocity).max()
    simulation.run()
    state = simulation.state
    momentum = (state.velocity * state.mass[:, None]).sum(axis=0) / state.mass.sum()
    assert np.abs(momentum).max() < 0.05 * before
    assert np.linalg.norm(state.velocity, axis=1).max() < 2.0 * before
    kinetic = 0.5 * (state.velocity**2).sum(axis=1).mean()
    assert kinetic < 0.5 * 0.43**2


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_drop_hits_a_wall_and_stays_inside(precision, device):
    """Thrown into the corner of floor and side wall: every particle stays within, none is stuck to another."""
    corner = {axis: {"lower": "wall", "upper": "open"} for axis in "xy"}
    domain = {"lower": [0, 0], "upper": [2, 2], "boundary": corner}
    scene = {**DROP, "domain": domain, "gravity": [0, -9.81], "end_time": 0.5, "start": {"velocity": [-2, -2]}}
    scene["fluids"] = [{"phase": "water", "shape": {"sphere": {"center": [0.6, 0.6], "radius": 0.4}}}]
    simulation = start(scene, device=device, precision=precision)
    simulation.run()
    state = simulation.state
    assert state.time == pytest.approx(0.5)
    assert state.position.min() > 0.0
    apart = np.linalg.norm(state.position[:, None] - state.position[None], axis=-1)
    np.fill_diagonal(apart, 1.0)
    assert apart.min() > 0.1 * DX
    assert np.linalg.norm(state.velocity, axis=1).max() < 2.0 * math.sqrt(8 + 2 * 9.81)


def test_a_particle_leaves_the_domain(device):
    """Through an open side and far away: it flies on, the rest is not disturbed, the run ends."""
    fluids = [
        {"phase": "water", "shape": {"sphere": {"center": [1, 2], "radius": 0.3}}},
        {"phase": "water", "shape": {"box": {"lower": [3.8, 2], "upper": [3.9, 2.1]}}},
    ]
    scene = {**DROP, "fluids": fluids, "start": {"velocity": ["where(x > 3, 40, 0)", 0]}, "end_time": 0.5}
    simulation = start({**scene, "scales": {"velocity": 40, "length": 1}}, device=device)
    simulation.run()
    state = simulation.state
    gone = state.position[:, 0] > 4
    assert gone.sum() == 1 and state.position[gone][0, 0] == pytest.approx(3.85 + 20, abs=1e-6)
    assert np.abs(state.velocity[~gone]).max() < 1e-6


def test_a_drop_in_three_dimensions(device):
    """Stretched for a few steps: the corrected velocity stays free of divergence, the drop whole."""
    scene = in_three({**DROP, "start": {"velocity": ["x-2", "2-y"]}}, start={"velocity": ["x-2", "y-2", "-2*(z-2)"]})
    simulation = start(scene, device=device, particle_spacing=0.125, end_time=0.1, numerics__maximum_step=0.02)
    simulation.run()
    state = simulation.state
    assert simulation.model.steps >= 3
    surface = rows(simulation, "surface")
    assert 0.1 < (surface == 0).mean() < 0.9
    rate = rows(simulation, "dilation")[surface == 0]
    assert np.sqrt((rate**2).mean()) < 0.1 * math.sqrt(6)
    # strain grows and falls slowly: the velocity is still close to linear in the position
    strain = np.linalg.lstsq(state.position - 2.0, state.velocity, rcond=None)[0]
    assert abs(np.trace(strain)) < 0.1 * np.linalg.norm(strain) and strain[0, 0] == pytest.approx(strain[1, 1], rel=1e-3)
    assert (state.velocity * state.mass[:, None]).sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-4 * state.mass.sum())


# order in time --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time_order", [2, 1])
def test_order_in_time(time_order, device):
    """Differences between runs with steps h, h/2 and h/4 fall by 2^order: Taylor-Green vortices on one lattice.

    Shift and smoothing, which a step adds at its end, are of first order in time and of third in the spacing: without them.
    """
    found = []
    for step in (0.005, 0.0025, 0.00125):
        simulation = start(
            VORTICES,
            device=device,
            end_time=0.08,
            numerics__maximum_step=step,
            numerics__time_order=time_order,
            numerics__shifting=HARDLY,
            numerics__volume_feedback=0,
            numerics__velocity_filter=0,
            numerics__pressure_gradient="corrected" if time_order == 2 else "conservative",
            numerics__tolerance=1e-11,
        )
        simulation.run()
        found.append(np.concatenate([simulation.state.position, simulation.state.velocity], axis=1))
    wrapped = [(b - a + 0.5) % 1.0 - 0.5 for a, b in zip(found, found[1:], strict=False)]
    coarse, fine = (np.sqrt((d**2).mean()) for d in wrapped)
    assert math.log2(coarse / fine) == pytest.approx(time_order, abs=0.25)


# sameness -------------------------------------------------------------------------------------------------------------

SPLASH: dict[str, Any] = {
    **TANK,
    "title": "splash",
    "end_time": 0.3,
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.4, 0.8]}}}],
}


def kept(simulation):
    return simulation.model.save_state()


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name in one.keys() - {"clock", "counters"}:
        assert one[name].tobytes() == other[name].tobytes(), name
    numbers = [index for index in range(ck.CLOCK_SIZE) if index != ck.TARGET]
    np.testing.assert_array_equal(one["clock"][numbers], other["clock"][numbers])
    assert one["counters"][ck.STEPS] == other["counters"][ck.STEPS]


@pytest.mark.parametrize("scene", ["splash", "vortices"])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_restart_continues_bit_by_bit(scene, precision, device, tmp_path):
    """From every checkpoint of the run."""
    case = case_of(
        SPLASH if scene == "splash" else {**VORTICES, "end_time": 0.3},
        precision=precision,
        output__checkpoint={"interval": 0.06, "keep": 9},
    )
    whole = Simulation(case, output=tmp_path / "whole", threads=1, device=device).run()
    files = sorted((tmp_path / "whole" / "checkpoint").glob("*.h5"))
    assert len(files) == 5 and whole.model.steps > 8
    for file in files[:-1]:
        again = Simulation(case, restart=file, threads=1, device=device)
        assert_same(checkpoint.load(file)[0], kept(again))
        again.run()
        assert_same(kept(whole), kept(again))


def test_threads_do_not_change_the_result(monkeypatch):
    monkeypatch.setattr(launch, "SMALLEST_SHARE", 8)
    for scene in (SPLASH, VORTICES):
        one, two = (start(scene, threads=threads).run() for threads in (1, 2))
        assert_same(kept(one), kept(two))


def test_a_list_that_has_to_grow(device):
    """Widened in the middle of a step, in the first one and later: bit by bit the same run."""
    wide = start(SPLASH, device=device)
    assert_same(kept(wide.run()), kept(start(SPLASH, device=device, numerics__neighbour_capacity=4).run()))
    # room for the start alone: it proves too narrow once particles come nearer
    crowd = {**SPLASH, "start": {"velocity": ["-8*(x-0.2)", "-8*(y-0.4)"]}}
    whole = start(crowd, device=device)
    peak = int(whole.model.stepper.read()[1][ck.LIST_PEAK])
    tight = start(crowd, device=device, numerics__neighbour_capacity=peak)
    stepper = tight.model.stepper
    before = stepper.list.width
    assert_same(kept(whole.run()), kept(tight.run()))
    assert stepper.list.width > before and stepper.systems.matrix.width == stepper.list.width


# what a run tells ------------------------------------------------------------------------------------------------------


def test_the_divergence_left_over_is_told(device):
    """Root mean square inside the fluid; surface particles, which no equation holds, do not count."""
    simulation = start(SPLASH, device=device)
    simulation.run()
    particles, told = simulation.model.particles, simulation.summary["solver"]
    inside = particles.get("surface") == 0
    assert 0 < inside.sum() < len(inside)
    left = particles.get("dilation")[inside]
    assert told["divergence"] == pytest.approx(math.sqrt((left.astype(float) ** 2).mean()), rel=1e-12)
    h = simulation.physics.h
    speed = np.linalg.norm(simulation.state.velocity, axis=1).max()
    assert told["divergence_h_over_u"] == pytest.approx(told["divergence"] * h / speed, rel=0.2)


def test_a_swinging_drop_keeps_its_outline_and_energy(device):
    """A drop in a central force is drawn out to 1.9 R, up and then sideways, and is round again after a period.

    Nothing damps it and nothing feeds it: it keeps its particles, its area to a tenth of a spacing at the surface, and loses
    no more energy than a first-order error, dx/R.
    """
    radius, rate, n = 1.0, 1.0, 20
    simulation = start(
        {
            "dimension": 2, "particle_spacing": radius / n, "end_time": 1e9, "numerics": {"scheme": "isph"},
            "domain": {"lower": [-2.4, -2.4], "upper": [2.4, 2.4], "boundary": {"x": "open", "y": "open"}},
            "central_force": {"rate": rate}, "phases": {"water": {"density": 1000}},
            "fluids": [{"phase": "water", "shape": {"sphere": {"center": [0, 0], "radius": radius}}}],
            "start": {"arrangement": "fitted", "velocity": ["-x", "y"], "pressure": "1000*(1 - x**2 - y**2)"},
        },
        device=device,
    )  # fmt: skip

    def energy(state):
        return 0.5 * (state.mass @ ((state.velocity**2).sum(axis=1) + rate**2 * (state.position**2).sum(axis=1)))

    first = energy(simulation.state)
    simulation.model.stepper.run(4.8273430, 10**6)
    state = simulation.state
    x = state.position - state.position.mean(axis=0)
    apart = np.linalg.norm(x[:, None] - x[None], axis=2) * n
    # as the gauge `strays` counts; a particle of the surface may have its second neighbour 1.5 spacings away
    assert ((apart < 2.0).sum(axis=1) > 3).all(), "particles have left the drop"
    assert np.linalg.norm(x, axis=1).max() < 1.0 + 1.0 / n
    area = 4.0 * math.sqrt(np.linalg.det(np.cov(x.T, bias=True)))
    assert abs(area - 1.0) < 2 * 0.1 / n
    assert -1.0 / n < energy(state) / first - 1.0 < 0.1 / n


@pytest.mark.parametrize("scheme", ["riemann", "isph"])
def test_a_central_force_pulls_towards_its_centre(scheme, device):
    """-B^2 (x - centre) in both schemes; the Riemann scheme starts with p = 0, so that nothing else acts."""
    scene = {**DROP, "central_force": {"rate": 3.0, "center": [1.9, 2.05]}, "precision": "float64"}
    simulation = start(scene, device=device, numerics={"scheme": scheme})
    particles, stepper = simulation.model.particles, simulation.model.stepper
    if scheme == "isph":
        stepper.run(simulation.case.end_time, 1)
        # u* - u over the first step, before any pressure
        pull = (particles.get("velocity_star") - particles.get("velocity_old")) / stepper.read()[0][ck.LAST_STEP]
    else:
        pull = particles.get("acceleration")
    position = particles.get("position")[: particles.fluid_count]
    np.testing.assert_allclose(pull, -9.0 * (position - [1.9, 2.05]), atol=1e-9)
