"""A neighbour list that is kept has every pair within the support, in each step of a run, whatever moves the particles."""

import copy

import numpy as np
import pytest

from tests.scenes import PERIODIC
from warpsph.case.case import Case
from warpsph.kernels.core import clock as ck
from warpsph.running.model import Model

STEPS = 60
# The arrangement of the start is uneven, so that some particles are shifted by as much as is allowed, and the whole flow
# goes through the box, so that no list outlasts its half skin by standing still.
SCENE = {
    **copy.deepcopy(PERIODIC),
    "gauges": {},
    "start": {"noise": 0.3, "velocity": ["1 - cos(2*pi*x)*sin(2*pi*y)", "sin(2*pi*x)*cos(2*pi*y)"]},
}


def listed(model):
    """Return {(id, id)} of the list, and the ids in the order of the particles."""
    particles, lists = model.particles, model.stepper.levels[0].list
    ids = particles.get("particle_id")
    table = lists.neighbours.numpy()
    table = table.reshape(-1, lists.width) if model.physics.spec.row_list else table.reshape(lists.width, -1).T
    count = particles.get("fluid_neighbours")
    return {(ids[i], ids[j]) for i in range(len(ids)) for j in table[i, : count[i]]}


def near(model, radius):
    """Return {(id, id)} of the particles within a radius, across the sides of the box of one length."""
    ids, x = model.particles.get("particle_id"), model.particles.get("position")
    d = x[:, None] - x[None]
    d -= np.round(d)
    i, j = np.nonzero((d**2).sum(axis=2) < radius**2)
    return {(ids[a], ids[b]) for a, b in zip(i, j, strict=True) if a != b}


@pytest.mark.parametrize(
    "numerics",
    [{"scheme": "riemann"}, {"scheme": "delta_plus"}, {"scheme": "delta_plus", "integrator": "rk4"}],
    ids=["riemann", "delta_plus", "rk4"],
)
def test_every_pair_of_every_step_is_in_the_list(numerics, device):
    model = Model(Case.from_dict({**SCENE, "numerics": numerics}), device=device, threads=1)
    model.stepper.prepare(fresh=True)
    first = int(model.stepper.read()[1][ck.REBUILDS])
    for _ in range(STEPS):
        pairs = listed(model)
        model.stepper.run(1.0e3, 1)
        assert near(model, 0.9999 * model.physics.support) <= pairs
    clock, counters = model.stepper.read()
    assert counters[ck.STEPS] == STEPS
    # Else little has been tested: a list that is made in every step is complete.
    assert 2 < counters[ck.REBUILDS] - first < 0.75 * STEPS
