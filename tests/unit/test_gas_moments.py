"""Pressure forces by moments of masses, and walls of the gas (theory: compressible#c1-moment, compressible#c1-walls)."""

import numpy as np
import pytest

from warpsph import Simulation
from warpsph.case.case import Case

MATRICES = {
    "turns": [[0.0, -1.0], [1.0, 0.0]],
    "shears": [[0.0, 1.0], [0.0, 0.0]],
    "stretches": [[1.0, 0.0], [0.0, -1.0]],
    "grows": [[1.0, 0.0], [0.0, 1.0]],
}


def still(matrix=None, noise=0.3, count=30, side="open", **changes):
    """Gas of one pressure on disordered places, its velocity linear in x and y; float64. A key a__b is a.b of the case."""
    a = matrix or [[0.0, 0.0], [0.0, 0.0]]
    plain = {
        "dimension": 2,
        "precision": "float64",
        "particle_spacing": 1 / count,
        "end_time": 1.0,
        "domain": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5], "boundary": {"x": side, "y": side}},
        "phases": {"air": {"density": 1.0, "gamma": 1.4}},
        "fluids": [{"phase": "air", "shape": "rest"}],
        "start": {"noise": noise, "pressure": 1.0, "velocity": [f"{row[0]}*x + {row[1]}*y" for row in a]},
        "numerics": {"scheme": "gas"},
    }
    return Case.from_dict(plain).replace({key.replace("__", "."): value for key, value in changes.items()})


def started(case, device="cpu"):
    """A model with the rates of its start."""
    model = Simulation(case, device=device, threads=1).model
    model.stepper.prepare(fresh=True)
    return model


def inner(model):
    """Which particles see no held ones; fields of the kernels are in the order of the list."""
    return np.abs(model.particles.get("position")).max(axis=1) < 0.3


@pytest.mark.parametrize("motion", MATRICES)
def test_linear_motion_does_its_work_and_no_more(motion, device):
    """-p/rho div v on disordered particles: what turns or is sheared at one volume is not heated at all."""
    model = started(still(MATRICES[motion]), device)
    near = inner(model)
    power, density = (model.particles.get(name)[near] for name in ("power", "density"))
    work = -np.trace(MATRICES[motion]) / density
    assert near.sum() > 100
    assert power == pytest.approx(work, abs=1e-10)


def test_first_order_states_know_scalars_alone(device):
    """Without gradients there is no moment: the same gas is heated as it is stretched, which the test above would see."""
    model = started(still(MATRICES["stretches"], numerics__reconstruction="none"), device)
    assert np.abs(model.particles.get("power")[inner(model)]).max() > 1e-3


@pytest.mark.parametrize("rate, gentle", [(1.0, True), (-0.1, True), (-200.0, False)])
def test_what_closes_in_as_a_shock_has_the_scalar(rate, gentle, device):
    """h |div v|/c is 0.004 where the gas closes in slowly and 7 where it does not."""
    model = started(still([[0.5 * rate, 0.0], [0.0, 0.5 * rate]]), device)
    near = inner(model)
    stretching, stiffening = (model.particles.get(name)[near] for name in ("stretching", "stiffening"))
    off = np.abs(stretching / stiffening[:, None, None] - np.eye(2)).max()
    assert off > 0.05 if gentle else off < 1e-4


def test_a_moment_has_the_trace_of_its_scalar(device):
    """tr T^-1 = d Omega: on a line, and in a gas that is even in all directions, both are the same."""
    model = started(still(), device)
    near = inner(model)
    stretching, stiffening, density = (model.particles.get(name)[near] for name in ("stretching", "stiffening", "density"))
    traces = np.trace(np.linalg.inv(stretching * density[:, None, None] ** 2), axis1=1, axis2=2)
    assert traces == pytest.approx(2.0 / (stiffening * density**2), rel=1e-9)


def test_no_particle_stays_beyond_a_mirror(device):
    """Thin gas that dense gas presses into a corner: its particles meet their own images, which hardly repel them."""
    case = still(count=32, side="free_slip", noise=0.0, end_time=0.6,
                 start__density="where(x + y < -0.5, 0.125, 1)", start__pressure="where(x + y < -0.5, 0.14, 1)")  # fmt: skip
    model = started(case, device)
    model.stepper.run(0.6, 10_000)
    assert np.abs(model.snapshot().position).max() <= 0.5


def put_beyond(model):
    """Put the particle next to a wall where its image is, moving as that does."""
    particles = model.particles
    states = {name: particles.get(name) for name in ("position", "offset", "velocity", "acceleration")}
    row = int(np.argmin(states["position"][:, 0]))
    way = 2.0 * (-0.5 - states["position"][row, 0])
    assert -0.02 < way < 0.0
    for name in ("position", "offset"):
        states[name][row, 0] += way
    for name in ("velocity", "acceleration"):
        states[name][row, 0] *= -1.0
    for name, values in states.items():
        particles.put(name, values)


@pytest.mark.parametrize("integrator", ["kick_drift_kick", "rk2"])
def test_a_reflection_changes_nothing_within(integrator, device):
    """A particle put beyond a wall and its image within: the same rates of all others, and the same state a step later."""
    case = still(side="free_slip", numerics__integrator=integrator, numerics__maximum_step=1e-3)
    states = []
    for beyond in (False, True):
        model = started(case, device)
        if beyond:
            put_beyond(model)
        model.stepper.run(1.0, 3)
        snapshot = model.snapshot()
        states.append((snapshot.position, snapshot.velocity))
    assert np.abs(states[1][0]).max() <= 0.5
    assert states[0][0] == pytest.approx(states[1][0], abs=1e-12)
    assert states[0][1] == pytest.approx(states[1][1], abs=1e-12)


def floor_error(count, device):
    """Mean error of the pressure within 0.1 of floor and lid of an atmosphere of one temperature, after 0.5 s at rest."""
    case = still(count=count, side="free_slip", noise=0.0, gravity=[0.0, -1.0],
                 start__density="exp(-y)", start__pressure="exp(-y)")  # fmt: skip
    model = started(case, device)
    model.stepper.run(0.5, 10_000)
    snapshot = model.snapshot()
    y = snapshot.position[:, 1]
    near = np.abs(y) > 0.4
    return float(np.abs(snapshot.pressure[near] / np.exp(-y[near]) - 1.0).mean())


def test_a_gas_at_rest_before_walls_carries_its_weight(device):
    """The images of an atmosphere go on with its weight: errors at the walls are nearer to second order than to first."""
    coarse, fine = floor_error(40, device), floor_error(80, device)
    assert fine < 0.5**1.5 * coarse


def test_gradients_before_walls_go_on_with_the_weight(device):
    """dp/dy = -rho g of an atmosphere at the start, in the first rows as within."""
    case = still(count=40, side="free_slip", noise=0.0, gravity=[0.0, -1.0],
                 start__density="exp(-y)", start__pressure="exp(-y)")  # fmt: skip
    model = started(case, device)
    slope, y = model.particles.get("pressure_gradient")[:, 1], model.particles.get("position")[:, 1]
    assert slope == pytest.approx(-np.exp(-y), rel=0.01)
