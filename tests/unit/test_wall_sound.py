"""Walls with a surface of their own in flows with sound, between inlets and outlets and without."""

import numpy as np
import pytest

from tests.scenes import SOUND
from warpsph.case.case import Case
from warpsph.kernels.core import clock as ck
from warpsph.running.model import Model
from warpsph.scene.geometry import build
from warpsph.schemes import riemann_physics

FLOOR = {"shape": {"box": {"lower": [-9, -9], "upper": [9, 0.03]}}}
"""A floor between particles that stand at 0.05 and its odd multiples: it cuts cells."""


def channel(walls, profile, upper, bodies, **sections):
    """A domain with an inlet of given velocity and an outlet, walls at both sides of y, and bodies; 10 spacings a metre."""
    sides = {"lower": {"inlet": {"velocity": [profile, 0], "waves": "leave"}}, "upper": {"outlet": {}}}
    base = {
        "dimension": 2,
        "particle_spacing": 0.1,
        "end_time": 1000,
        "domain": {"lower": [0, -0.5], "upper": upper, "boundary": {"x": sides, "y": walls}},
        "phases": {"water": {"density": 1, "gamma": 1, "sound_speed": 15}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "start": {"velocity": [profile, 0]},
        "bodies": bodies,
    }
    return Case.from_dict({**base, **sections})


@pytest.fixture
def fitted(monkeypatch):
    """Bodies of whole cells have a surface too: nothing but the walls is not that of a lattice then."""
    monkeypatch.setattr(riemann_physics, "fitted_walls", lambda case, geometry: True)


def made(case, device="cpu"):
    """A run of the case, its list built; its walls have a surface of their own."""
    model = Model(case, device=device, threads=1)
    assert model.physics.spec.bodies
    model.stepper.prepare(fresh=True)
    return model


def at(model, time):
    """The fluid at a time [s], reached without a fault."""
    model.stepper.run(time, 10**8)
    assert model.stepper.read()[1][ck.FAULT] == 0
    return model.snapshot().fluid


def energy(fluid, sound):
    """Energy of sound in a fluid at rest [J/m]."""
    return 0.5 * float((fluid.volume * (fluid.pressure**2 / sound**2 + (fluid.velocity**2).sum(axis=1))).sum())


# sound -------------------------------------------------------------------------------------------------------------


def test_sound_between_two_walls_dies_out(device):
    """Half a wave to and fro, 20 spacings: velocities of walls that lag by a step, or slopes that do not, make it grow."""
    model = made(Case.from_dict(SOUND), device)
    first, second = (energy(at(model, time), 10.0) for time in (0.001, 1.0))
    assert 0.8 * first < second < 0.95 * first


# geometry ----------------------------------------------------------------------------------------------------------


def test_walls_go_on_straight_beyond_inlets_and_outlets():
    """Also bodies; what is out there bears no load."""
    case = channel("free_slip", "1", [2, 1], {"floor": FLOOR})
    geometry = build(case, support=0.3)
    wall = geometry.kind == 1
    position, surface = geometry.position[wall], geometry.surface
    for name, y, normal in (("y_upper", 1.0, -1.0), ("floor", 0.03, 1.0)):
        own = geometry.body[wall] == geometry.body_names.index(name) + 1
        own &= (position[:, 1] - y) * normal < 0
        x = position[own, 0]
        assert x.min() < -0.2 and x.max() > 2.2
        np.testing.assert_allclose(surface.normal[own], np.broadcast_to([0.0, normal], (own.sum(), 2)), atol=1e-12)
        np.testing.assert_allclose(surface.depth[own], np.abs(position[own, 1] - y), atol=1e-12)
        first = own & (surface.area != 0)
        beyond = (position[:, 0] < 0) | (position[:, 0] > 2)
        np.testing.assert_array_equal(surface.area[first] < 0, beyond[first])
        # each is led by the particle of the first layer at its own foot
        foot = position[surface.leader[own]][:, 0]
        assert np.abs(foot - x).max() < 0.06
        assert np.abs(np.maximum(surface.area[first], 0).sum() - 2.0) < 0.1


# flows -------------------------------------------------------------------------------------------------------------

LEVEL = {"shape": {"box": {"lower": [-9, -9], "upper": [9, 0]}}}
"""A floor between rows of particles."""


def test_a_uniform_flow_past_walls_without_friction_stays(device, fitted):
    """An inviscid flow is what it is after ten lengths of the domain."""
    floor = {**LEVEL, "wall": "free_slip"}
    fluid = at(made(channel("free_slip", "1", [1, 0.8], {"floor": floor}), device), 10.0)
    np.testing.assert_allclose(fluid.velocity, np.broadcast_to([1.0, 0.0], fluid.velocity.shape), atol=1e-4)
    assert np.abs(fluid.pressure).max() < 1e-3


def test_a_channel_between_surfaces_keeps_its_parabola(device, fitted):
    """Re = 20, seven lengths of the domain: 1 % of the peak, pressure drop within 5 %."""
    water = {"density": 1, "viscosity": 0.05, "gamma": 1, "sound_speed": 15}
    model = made(channel("wall", "6*y*(1 - y)*(y > 0)", [2, 1], {"floor": LEVEL}, phases={"water": water}), device)
    errors, slopes = [], []
    for time in (10.0, 11.0, 12.0, 13.0, 14.0):
        fluid = at(model, time)
        x, y = fluid.position.T
        error = (fluid.velocity[:, 0] - 6 * y * (1 - y)) / 1.5
        errors.append(np.sqrt((error**2).mean()))
        slopes.append(np.polyfit(x, fluid.pressure, 1)[0])
    assert np.mean(errors) < 0.01
    assert np.mean(slopes) == pytest.approx(-12 * 0.05, rel=0.05)


NODDING = {"translation": [0, "0.05*(1 - cos(2*pi*t))"], "rotation": "t", "pivot": [1, 0.22]}


@pytest.mark.parametrize("motion", [None, NODDING])
def test_a_cylinder_in_a_stream_lives(device, motion):
    """Re = 100 of its diameter, five spacings, at rest or moving across and turning: slow, a drag of order 1.

    Ideal flow past it, 0.36 of the channel and moving at up to 0.6 U, is as fast as 2 U/(1 - 0.36) + 0.6 U = 3.7 U; beyond a
    third of the speed of sound, 5 U, nothing is weakly compressible.
    """
    body = {"shape": {"sphere": {"center": [1, 0.22], "radius": 0.25}}, **({"motion": motion} if motion else {})}
    water = {"density": 1, "viscosity": 0.005, "gamma": 1, "sound_speed": 15}
    model = made(channel("free_slip", "1", [3, 1], {"cylinder": body}, phases={"water": water}), device)
    loads = []
    for time in np.arange(3.0, 6.0, 0.2):
        fluid = at(model, time)
        assert np.linalg.norm(fluid.velocity, axis=1).max() < 15.0 / 3.0
        assert np.abs(fluid.pressure).max() < 12.0
        loads.append(model.wall_forces()["wall_force_x cylinder"])
    assert 0.5 < np.mean(loads) / (0.5 * 0.5) < 6.0
