"""A neighbour list that is kept has every pair within the support, in each step of a run, whatever moves the particles."""

import copy

import numpy as np
import pytest
import warp as wp

from tests.scenes import PERIODIC
from warpsph.case.case import Case
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.slack import make_extremes
from warpsph.kernels.core.spec import types
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


@pytest.mark.parametrize(("dimension", "precision"), [(1, "float32"), (2, "float64"), (3, "float32")])
def test_extremes_are_those_of_each_axis(dimension, precision, device):
    vec = types(dimension, precision).vec
    lower, higher = make_extremes(dimension, precision)

    @wp.kernel(module="unique", enable_backward=False)
    def extremes(a: wp.array(dtype=vec), b: wp.array(dtype=vec), low: wp.array(dtype=vec), high: wp.array(dtype=vec)):
        i = wp.tid()
        low[i] = lower(a[i], b[i])
        high[i] = higher(a[i], b[i])

    rng = np.random.default_rng(3)
    a, b = (wp.array(rng.normal(size=(100, dimension)), dtype=vec, device=device) for _ in range(2))
    low, high = wp.zeros_like(a), wp.zeros_like(a)
    wp.launch(extremes, dim=100, inputs=[a, b, low, high], device=device)
    np.testing.assert_array_equal(low.numpy(), np.minimum(a.numpy(), b.numpy()))
    np.testing.assert_array_equal(high.numpy(), np.maximum(a.numpy(), b.numpy()))
