"""Friction of disorder: flows that it leaves alone, what it keeps, and what it takes."""

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.kernels.riemann.disorder import HELD
from warpsph.running.model import Model
from warpsph.simulation import Simulation

BOX = {
    "dimension": 2,
    "particle_spacing": 1 / 24,
    "precision": "float64",
    "end_time": 3e-7,
    "domain": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5], "boundary": {"x": "free_slip", "y": "free_slip"}},
    "phases": {"water": {"density": 2.0, "sound_speed": 20.0}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "start": {"noise": 0.2},
    "output": {"particles": "none", "checkpoint": "none"},
}
PERIODIC = {"lower": [-0.5, -0.5], "upper": [0.5, 0.5], "boundary": {"x": "periodic", "y": "periodic"}}
SWIRL = ["sin(2*pi*x)*cos(2*pi*y)", "-cos(2*pi*x)*sin(2*pi*y)"]
ROUGH = ["sin(317*x + 211*y)", "cos(401*y - 173*x)"]  # at particles 1/24 apart as good as chance


def friction(velocity, **changes):
    """The fluid, and the change of its velocity per time (n, 2) by three tiny steps with the friction, less that without."""
    found = []
    for strength in (4, 0):
        numerics = {"maximum_step": 1e-7, "shifting": 0, "room_rate": 0, "disorder_friction": strength}
        case = BOX | {"start": BOX["start"] | {"velocity": velocity}, "numerics": numerics} | changes
        found.append(Simulation(case, threads=1).run().state)
    return found[0], (found[0].velocity - found[1].velocity) / found[0].time


@pytest.mark.parametrize("velocity", [["-y", "x"], ["x", "-y"], ["y", "0"], ["x + 2*y", "3*x"]])
def test_a_linear_flow_feels_nothing_on_any_arrangement(velocity):
    _, force = friction(velocity)
    rough = np.abs(friction(ROUGH)[1]).max()
    assert rough > 10.0
    assert np.abs(force).max() < 1e-5 * rough


def test_it_keeps_momentum_and_angular_momentum_and_takes_energy():
    # a disc with nothing around it, whose particles no wall holds
    domain = BOX["domain"] | {"boundary": {"x": "open", "y": "open"}}
    disc = [{"phase": "water", "shape": {"sphere": {"center": [0, 0], "radius": 0.4}}}]
    fluid, force = friction(ROUGH, domain=domain, fluids=disc)
    push = fluid.mass[:, None] * force
    torque = fluid.position[:, 0] * push[:, 1] - fluid.position[:, 1] * push[:, 0]
    size = np.abs(push).sum()
    assert np.abs(push.sum(axis=0)).max() < 1e-6 * size
    assert abs(torque.sum()) < 1e-6 * size
    assert (push * fluid.velocity).sum() < 0


def by_all_pairs(position, velocity, mass, density, sound, phase=None):
    """The law over all pairs of one phase in numpy (n, 2): Wendland C2, h = 1.5 spacings, without viscosity."""
    h, volume = 1.5 / 24, mass / density
    d = position[:, None] - position[None]
    r = np.linalg.norm(d, axis=2) + np.eye(len(d))
    q = np.minimum(r / h, 2)
    weight = -35 / (4 * np.pi * h**4) * (1 - q / 2) ** 3 * volume[None]  # F V_j
    np.fill_diagonal(weight, 0)
    if phase is not None:
        weight = weight * (phase[:, None] == phase[None])
    v = velocity[:, None] - velocity[None]
    moment = -np.einsum("ij,ija,ijb->iab", weight, d, d)
    gradient = -np.einsum("ij,ija,ijb->iab", weight, v, d) @ np.linalg.inv(moment)
    b = np.minimum(4 * np.linalg.norm(gradient, axis=(1, 2)) * h, 0.2 * sound)
    b[np.linalg.det(moment) <= 0.1] = np.nan
    beyond = np.einsum("ija,ija->ij", v, d) - 0.5 * np.einsum("ija,ijab,ijb->ij", d, gradient[:, None] + gradient[None], d)
    pair = np.nan_to_num(0.5 * (b[:, None] + b[None]) * beyond / r * weight)
    return (2.0 / density)[:, None] * np.einsum("ij,ija->ia", pair, d)


def test_it_is_the_law():
    domain = BOX["domain"] | {"boundary": {"x": "open", "y": "open"}}
    disc = [{"phase": "water", "shape": {"sphere": {"center": [0, 0], "radius": 0.4}}}]
    fluid, force = friction(ROUGH, domain=domain, fluids=disc)
    # of three steps the first has none: no continuity sweep is before it
    law = by_all_pairs(fluid.position, fluid.velocity, fluid.mass, fluid.density, 20.0)
    share = (force * law).sum() / (law**2).sum()
    assert 0.5 < share < 1.0
    assert np.abs(force - share * law).max() < 1e-4 * np.abs(law).max()


def test_fluids_that_touch_do_not_rub_by_it():
    """Two fluids that are alike, side by side: each has the law by itself."""
    domain = BOX["domain"] | {"boundary": {"x": "open", "y": "open"}}
    halves = [{"phase": name, "shape": {"box": {"lower": [x, -0.4], "upper": [x + 0.4, 0.4]}}}
              for name, x in (("water", -0.4), ("brine", 0.0))]  # fmt: skip
    phases = {name: BOX["phases"]["water"] for name in ("water", "brine")}
    fluid, force = friction(ROUGH, domain=domain, fluids=halves, phases=phases)
    law = by_all_pairs(fluid.position, fluid.velocity, fluid.mass, fluid.density, 20.0, fluid.phase)
    share = (force * law).sum() / (law**2).sum()
    assert 0.5 < share < 1.0
    assert np.abs(force - share * law).max() < 1e-4 * np.abs(law).max()


def loss(spacings):
    """Rate [1/s] at which the friction takes energy from vortices on a lattice, over that energy."""
    fluid, force = friction(SWIRL, domain=PERIODIC, particle_spacing=1 / spacings, start={"velocity": SWIRL})
    return -(force * fluid.velocity).sum() / (fluid.velocity**2).sum()


def test_what_it_takes_from_a_smooth_flow_falls_at_fourth_order():
    """b is of first order in h, what a pair of a smooth flow has beyond its gradients of third."""
    coarse, fine = loss(24), loss(48)
    assert coarse > 0
    assert np.log2(coarse / fine) == pytest.approx(4.0, abs=0.3)


def test_viscosity_counts():
    """Where friction of the fluid does more, there is none, and it is no part of the run."""
    water = BOX["phases"]["water"]
    thick = {"phases": {"water": water | {"viscosity": 2.0}}}
    numerics = {"numerics": {"disorder_friction": 4}}
    assert np.abs(friction(SWIRL, phases={"water": water | {"viscosity": 0.2}})[1]).max() == 0
    assert not Model(Case.from_dict(BOX | thick), threads=1).physics.spec.disorder
    assert Model(Case.from_dict(BOX | thick | numerics), threads=1).physics.spec.disorder
    assert Model(Case.from_dict(BOX), threads=1).physics.spec.disorder


@pytest.mark.parametrize(("viscosity", "acts"), [(0.01, False), (0.001, True)])
def test_a_resolved_layer_at_a_wall_is_left_alone(viscosity, acts):
    """|G| h^2 is 3 and 31 nu at the walls of a channel flow of 2 m/s; away from them 1.5 nu would do."""
    wall = {"wall": "no_slip"}
    domain = {"lower": [-0.5, -0.5], "upper": [0.5, 0.5], "boundary": {"x": "periodic", "y": {"lower": wall, "upper": wall}}}
    water = BOX["phases"]["water"] | {"viscosity": 2.0 * viscosity}
    fluid, force = friction(["2*(1 - 4*y*y)", "0"], domain=domain, phases={"water": water})
    beside = np.abs(fluid.position[:, 1]) > 0.5 - 1 / 24
    strongest = np.abs(force[beside]).max()
    assert (strongest > 0.01) == acts  # what neighbours farther off bring is 0.001


def test_spray_takes_no_part():
    """Two particles and a free surface: no gradient, no friction."""
    domain = BOX["domain"] | {"boundary": {"x": "free_slip", "y": {"lower": "free_slip", "upper": "open"}}}
    fluids = [{"phase": "water", "shape": {"box": {"lower": [-2 / 24, 0], "upper": [0, 1 / 24]}}}]
    _, force = friction(ROUGH, domain=domain, fluids=fluids, start={"velocity": ROUGH})
    assert np.abs(force).max() == 0


def begun():
    """A model of the rough box in float64 that has made its start."""
    numerics = {"maximum_step": 1e-7, "shifting": 0, "room_rate": 0}
    case = Case.from_dict(BOX | {"start": BOX["start"] | {"velocity": ROUGH}, "numerics": numerics})
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    return model


def test_it_is_found_anew_every_fourth_step():
    """From the gradients of the step before: the first of all has those of the start."""
    model, found, gradients = begun(), [], []
    for _ in range(3 * HELD + 1):
        model.stepper.run(1.0, 1)
        found.append(model.particles.get("disorder_force"))
        gradients.append(model.particles.get("flow_gradient"))
    assert np.abs(found[0]).max() > 10.0
    for later, step in enumerate(range(1, len(found)), start=1):
        assert np.array_equal(found[step - 1], found[step]) == (later % HELD != 0), step
    # step 0 has the start's and its own, which nothing reads
    for step in range(1, len(gradients)):
        assert np.array_equal(gradients[step - 1], gradients[step]) == ((step + 1) % HELD != 0), step


def test_what_is_held_outlives_a_restart():
    model = begun()
    model.stepper.run(1.0, 2)
    saved = model.save_state()
    model.stepper.run(1.0, 2 * HELD)
    other = begun()
    other.load_state(saved)
    other.stepper.run(1.0, 2 * HELD)
    assert np.array_equal(model.particles.get("velocity"), other.particles.get("velocity"))
