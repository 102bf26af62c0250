"""Vorticity and Q of the fluid: exact for quadratic velocities, second order for others, in files, gauges and pictures."""

import dataclasses
import math

import numpy as np
import pytest

from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.files.output import last_particles
from warpsph.running.model import Model
from warpsph.running.state_copy import EVERYTHING, copy_state
from warpsph.snapshot import Snapshot
from warpsph.study import plot

FLOW = ("vorticity", "q_criterion")


def model_of(n, dimension=2, **changes):
    """Return the model of disordered fluid between walls at the two ends of y, in float64."""
    axes = "xyz"[:dimension]
    data = {
        "dimension": dimension,
        "precision": "float64",
        "particle_spacing": 1 / n,
        "end_time": 1.0,
        "domain": {
            "lower": [0] * dimension,
            "upper": [1] * dimension,
            "boundary": {axis: "wall" if axis == "y" else "periodic" for axis in axes},
        },
        "phases": {"w": {"density": 1.0, "viscosity": 0.01}},
        "fluids": [{"phase": "w", "shape": "rest"}],
        "scales": {"velocity": 1},
        "start": {"noise": 0.3},
    }
    model = Model(Case.from_dict(data | changes), threads=1)
    model.stepper.prepare(True)
    return model


def flow_of(model, velocity):
    """Return the fluid with its vorticity and Q if it had the velocity that a function of the positions gives."""
    particles = model.particles
    v, a = particles.get("velocity"), particles.get("acceleration")
    x = particles.get("position")[: particles.fluid_count]
    v[: len(x)] = velocity(*x.T)
    a[:] = 0.0
    particles.put("velocity", v)
    particles.put("acceleration", a)
    return copy_state(model, EVERYTHING | {*FLOW}).snapshot().fluid


@pytest.mark.parametrize("scheme", ["riemann", "isph", "delta_plus"])
def test_a_parabola_between_walls_is_exact_up_to_them(scheme):
    """Poiseuille flow: vorticity -du/dy; walls of particles or of images take no part."""
    fluid = flow_of(model_of(12, numerics={"scheme": scheme}), lambda x, y: np.stack([4 * y * (1 - y), 0 * y], axis=1))
    y = fluid.position[:, 1]
    assert fluid.vorticity == pytest.approx(-4 * (1 - 2 * y), abs=1e-10)
    assert fluid.q_criterion == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize(("turn", "strain"), [(3.0, 0.0), (0.0, 2.0), (1.0, 0.5)])
def test_q_of_rotation_and_strain(turn, strain):
    """(u, v) = turn (-y, x) + strain (x, -y): vorticity 2 turn, Q = turn^2 - strain^2. Away from the periodic sides."""
    model = model_of(12)
    fluid = flow_of(model, lambda x, y: np.stack([strain * x - turn * y, turn * x - strain * y], axis=1))
    inside = np.abs(fluid.position[:, 0] - 0.5) < 0.5 - model.physics.support
    assert fluid.vorticity[inside] == pytest.approx(2 * turn, abs=1e-10)
    assert fluid.q_criterion[inside] == pytest.approx(turn**2 - strain**2, abs=1e-10)


def test_three_dimensions():
    """u = A x + quadratic terms: curl and Q from the exact gradient."""
    rng = np.random.default_rng(4)
    gradient, bend = rng.normal(size=(3, 3)), rng.normal(size=(3, 3, 3))

    def velocity(*x):
        x = np.stack(x, axis=1)
        return x @ gradient.T + np.einsum("abc,nb,nc->na", bend, x, x)

    model = model_of(8, 3)
    fluid = flow_of(model, velocity)
    x = fluid.position
    slopes = gradient + np.einsum("abc,nc->nab", bend + bend.transpose(0, 2, 1), x)
    exact = np.stack([slopes[:, (k + 2) % 3, (k + 1) % 3] - slopes[:, (k + 1) % 3, (k + 2) % 3] for k in range(3)], axis=1)
    inside = (np.abs(x[:, [0, 2]] - 0.5) < 0.5 - model.physics.support).all(axis=1)
    assert inside.any()
    assert fluid.vorticity[inside] == pytest.approx(exact[inside], abs=1e-9)
    q = -0.5 * np.einsum("nab,nba->n", slopes, slopes)
    assert fluid.q_criterion[inside] == pytest.approx(q[inside], abs=1e-9)


def vortices_error(n):
    """Return the largest error of the vorticity of Taylor-Green vortices, over the largest vorticity."""
    k = 2 * math.pi
    sides = {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}}
    fluid = flow_of(
        model_of(n, domain=sides),
        lambda x, y: np.stack([-np.cos(k * x) * np.sin(k * y), np.sin(k * x) * np.cos(k * y)], axis=1),
    )
    exact = 2 * k * np.cos(k * fluid.position[:, 0]) * np.cos(k * fluid.position[:, 1])
    return np.abs(fluid.vorticity - exact).max() / (2 * k)


def test_vortices_converge_with_second_order():
    """On disordered particles, by halving the spacing twice; a linear fit is of first order there."""
    errors = [vortices_error(n) for n in (16, 32, 64)]
    assert errors[2] < 0.01
    assert np.log2(errors[0] / errors[2]) / 2 > 1.8


def test_velocities_half_a_step_behind_are_brought_up():
    """The Riemann scheme has v - a dt/2; a shear that grows at the rate a/v has that much more vorticity now."""
    model = model_of(12)
    model.stepper.run(1.0, 3)
    particles = model.particles
    v, a = particles.get("velocity"), particles.get("acceleration")
    y = particles.get("position")[: particles.fluid_count, 1]
    v[:], a[:] = 0.0, 0.0
    v[: len(y), 0], a[: len(y), 0] = y, 10.0 * y
    particles.put("velocity", v)
    particles.put("acceleration", a)
    state = copy_state(model, EVERYTHING | {*FLOW})
    assert state.dt > 0
    assert state.snapshot().fluid.vorticity == pytest.approx(-(1 + 0.5 * state.dt * 10.0), abs=1e-10)


def test_a_particle_in_the_air_has_none():
    """One particle far from the others has no gradient, and the vorticity 0."""
    fluids = [
        {"phase": "w", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}},
        {"phase": "w", "shape": {"box": {"lower": [0.5, 0.9], "upper": [0.55, 0.95]}}},
    ]
    fluid = flow_of(model_of(20, fluids=fluids), lambda x, y: np.stack([y * y, 0 * y], axis=1))
    assert fluid.vorticity[fluid.position[:, 1] > 0.8].tolist() == [0.0]
    below = fluid.position[:, 1] < 0.8
    assert fluid.vorticity[below] == pytest.approx(-2 * fluid.position[below, 1], abs=1e-10)


STREAM = {
    "dimension": 2,
    "particle_spacing": 0.1,
    "end_time": 0.02,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "wall"}},
    "phases": {"w": {"density": 1.0, "viscosity": 0.1}},
    "fluids": [{"phase": "w", "shape": "rest"}],
    "start": {"velocity": ["4*y*(1 - y)", 0]},
    "output": {"particles": {"interval": 0.02, "fields": ["velocity", *FLOW]}, "checkpoint": "none"},
    "gauges": {"probe": {"type": "points", "interval": 0.01, "points": [[0.5, 0.5], [0.5, 0.25]], "fields": [*FLOW]}},
}


def test_files_gauges_and_pictures_hold_them(tmp_path):
    run = Simulation(Case.from_dict(STREAM), device="cpu", threads=1, output=tmp_path / "run").run()
    fluid = last_particles(tmp_path / "run", 2).fluid
    assert fluid.vorticity == pytest.approx(-4 * (1 - 2 * fluid.position[:, 1]), abs=0.5)
    assert np.abs(fluid.q_criterion).max() < 1.0
    probe = run.gauge("probe")
    assert probe["vorticity"][:2] == pytest.approx([0.0, -2.0], abs=0.05)
    assert set(probe) == {"time", "x", "y", *FLOW}
    (picture, *_) = plot.plot_run(tmp_path / "run", "vorticity", [0.02])
    assert picture.stat().st_size > 0


def test_a_picture_of_files_without_vorticity_takes_that_of_the_velocities():
    x = np.random.default_rng(1).uniform(0, 1, (200, 2))
    n = len(x)
    fluid = Snapshot(
        0.0, 0, 0.1, 2, x, 3.0 * np.stack([-x[:, 1], x[:, 0]], axis=1), *np.ones((4, n)), np.zeros(n, np.int32),
        np.arange(n), np.zeros(n, np.uint8), 1.0,
    )  # fmt: skip
    view = plot.view_of(np.zeros(3), np.array([1.0, 1.0, 0.0]), 1.0, None)
    assert plot.field_of(plot.Frame(0.0, fluid, None), view, "vorticity") == pytest.approx(6.0, abs=1e-9)
    held = dataclasses.replace(fluid, vorticity=np.full(n, 7.0))
    assert plot.field_of(plot.Frame(0.0, held, None), view, "vorticity") == pytest.approx(7.0)
