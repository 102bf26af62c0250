"""Particles that are born and die: drops that fall freely through a domain, in above and out below."""

import math

import numpy as np
import pytest

from tests.rain import Rain
from warpsph.case.case import Case
from warpsph.errors import WarpsphError
from warpsph.kernels.core import clock as ck
from warpsph.running.model import Model
from warpsph.schemes import registry

HEIGHT, WIDTH, SPACING, GRAVITY = 1.0, 0.5, 0.05, 10.0
SCHEME = Rain()
LAYER = round(WIDTH / SPACING)
FALL_TIME = (-SCHEME.speed + math.sqrt(SCHEME.speed**2 + 2 * GRAVITY * HEIGHT)) / GRAVITY

CASE = {
    "dimension": 2,
    "particle_spacing": SPACING,
    "end_time": 100.0,
    "domain": {"lower": [0, 0], "upper": [WIDTH, HEIGHT], "boundary": {"x": "periodic", "y": "open"}},
    "gravity": [0, -GRAVITY],
    "phases": {"water": {"density": 1000.0}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0.9], "upper": [WIDTH, 1.0]}}}],
    "numerics": {"scheme": "rain"},
}


@pytest.fixture(autouse=True, scope="module")
def known():
    """The scheme, for the tests of this file."""
    registry.register(SCHEME)
    yield
    registry.unregister(SCHEME.name)


def rain(device, precision="float64", room=0):
    """A run of the rain, its list built."""
    SCHEME.first_room = room
    model = Model(Case.from_dict({**CASE, "precision": precision}), device=device, threads=1)
    model.stepper.prepare(fresh=True)
    return model


def expected(time):
    """Ids of the drops that are there at a time, and the heights of the layers, from the law of falling bodies."""
    layers = np.arange(1, math.floor(time / SCHEME.period) + 1)
    age = time - layers * SCHEME.period
    height = HEIGHT - SCHEME.speed * age - 0.5 * GRAVITY * age**2
    there = height >= 0
    first = 2 * LAYER  # the drops of the start have long left
    ids = first + (layers[there][:, None] - 1) * LAYER + np.arange(LAYER)
    return ids.ravel(), height[there]


@pytest.mark.parametrize("precision, steps", [("float64", 100_000), ("float32", 10_000)])
def test_count_and_mass_of_a_rain(device, precision, steps):
    """Each drop that entered and has not left is there once, at its place; capacity has grown once."""
    model = rain(device, precision, room=60)
    start = model.particles.fluid_capacity
    grown = []
    grow = model.stepper.grow
    model.stepper.grow = lambda wanted, level=0: (grown.append(wanted), grow(wanted, level))
    model.stepper.run(1000.0, steps)
    assert model.steps == steps and model.stepper.read()[1][ck.FAULT] == 0
    assert model.time == pytest.approx(steps * SCHEME.time_step, rel=1e-9)
    ids, heights = expected(model.time)
    state = model.snapshot()
    np.testing.assert_array_equal(state.particle_id, ids)
    assert state.mass.sum() == pytest.approx(len(ids) * 1000.0 * SPACING**2, rel=1e-6 if precision == "float32" else 1e-14)
    assert len(grown) == 1 and model.particles.fluid_capacity > start
    # kick-drift-kick is exact for a constant acceleration: what is left is rounding
    np.testing.assert_allclose(
        state.position[:, 1], np.repeat(heights, LAYER), atol=2e-4 if precision == "float32" else 1e-9
    )


def test_restart_in_the_middle_is_bit_identical(device):
    """From a state between two growths, into a run that has no room for it."""
    whole = rain(device)
    whole.stepper.run(1000.0, 3_000)
    saved = {name: np.array(values) for name, values in whole.save_state().items()}
    whole.stepper.run(1000.0, 3_000)
    rest = rain(device)
    rest.load_state(saved)
    rest.stepper.prepare(fresh=False)
    assert rest.particles.fluid_capacity >= rest.particles.fluid_count > 2 * LAYER
    rest.stepper.run(1000.0, 3_000)
    for name, values in whole.save_state().items():
        again = rest.save_state()[name]
        if name == "counters":  # how long a list was, and what room was asked for, is no state
            values, again = (counters[ck.COUNTERS.kept] for counters in (values, again))
        np.testing.assert_array_equal(values, again, err_msg=name)


def test_room_changes_nothing(device):
    """A run that grows is the run that had room from the start."""
    narrow, wide = rain(device), rain(device, room=500)
    for model in (narrow, wide):
        model.stepper.run(1000.0, 2_000)
    assert wide.particles.fluid_capacity == 500 > narrow.particles.fluid_capacity
    for name in ("particle_id", "position", "velocity"):
        np.testing.assert_array_equal(getattr(narrow.snapshot(), name), getattr(wide.snapshot(), name))


def test_sums_that_do_not_follow_births_are_refused(device):
    """A wrong count would be added up without a word."""
    with pytest.raises(WarpsphError, match="births and deaths of scheme rain"):
        _ = rain(device).sums
