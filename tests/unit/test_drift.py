"""Total momentum of a periodic box: kept, moved by body forces alone, bit by bit through a restart and on any threads."""

import copy
import dataclasses

import numpy as np
import pytest

from tests.scenes import FULL, LEAN, PERIODIC, case_of
from warpsph.engine import launch
from warpsph.engine.program import Rarely, walk
from warpsph.kernels.core import clock as ck
from warpsph.running.model import Model
from warpsph.running.preview import describe
from warpsph.schemes import riemann_program as riemann

# An uneven drop, off the middle, ten times lighter than what is around it.
BOX = {
    "dimension": 2,
    "particle_spacing": 1 / 20,
    "end_time": 10.0,
    "precision": "float64",
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {
        "light": {"density": 1.0, "viscosity": 0.05, "sound_speed": 10.22},
        "heavy": {"density": 10.0, "viscosity": 0.05, "sound_speed": 10.22},
    },
    "surface_tension": [{"between": ["light", "heavy"], "coefficient": 1.0}],
    "fluids": [
        {"phase": "light", "shape": {"box": {"lower": [0.3, 0.25], "upper": [0.7, 0.7]}}},
        {"phase": "heavy", "shape": "rest"},
    ],
    "start": {"noise": 0.1, "arrangement": "lattice"},
    "numerics": {"acoustic_relaxation": 0},
}


def prepared(changes=None, device="cpu", threads=1):
    """Return a model of the box, ready for its first step."""
    model = Model(case_of(BOX).replace(changes or {}), device=device, threads=threads)
    assert model.physics.spec.momentum_constraint
    model.stepper.prepare(fresh=True)
    return model


def masses(model):
    """Return the masses in the order of the arrays [kg/m]."""
    density = np.array([phase.density for phase in model.case.phases.values()])
    particles = model.particles
    return density[particles.get("phase").astype(int)] * particles.get("rest_volume").astype(float)


def momentum(model):
    """Return (sum m v, sum m |v|) of the velocities half a step behind the positions."""
    mass = masses(model)
    v = model.particles.get("velocity").astype(float)[: len(mass)]  # without walls
    return mass @ v, mass @ np.linalg.norm(v, axis=1)


def follow(model, steps):
    """Run steps one by one; return (how far the momentum is from what it must be, the scale sum m |v|), each (steps,...)."""
    start, _ = momentum(model)
    total, drive = masses(model).sum(), np.array(model.case.body_force)
    errors, scales, taken_out = [], [], 0
    for _ in range(steps):
        model.stepper.run(100.0, 1)
        clock, _ = model.stepper.read()
        found, scale = momentum(model)
        middle = clock[ck.TIME] - 0.5 * clock[ck.LAST_STEP]
        errors.append(found - start - total * drive * middle)
        scales.append(scale)
        drift = clock[ck.DRIFT_VELOCITY : ck.DRIFT_VELOCITY + model.case.dimension]
        if drift.any():
            # what the next kick takes out is all that there is
            taken_out += 1
            np.testing.assert_allclose(drift * total, -errors[-1], rtol=1e-9, atol=1e-13 * scale)
    assert taken_out >= (steps // ck.RARE_INTERVAL if model.physics.spec.momentum_constraint else 0)
    return np.array(errors), np.array(scales)


# the momentum -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes, share",
    [
        ({}, 5e-5),
        ({"start.velocity": [0.4, -0.3]}, 1e-5),
        ({"body_force": [0.5, 0.2]}, 1e-5),
    ],
    ids=["at rest", "moving", "driven"],
)
def test_momentum_is_kept(changes, share, device):
    """Over 300 steps in which a square becomes a circle; a body force makes it grow as M b t."""
    model = prepared(changes, device)
    errors, scales = follow(model, 300)
    assert model.stepper.read()[0][ck.TIME] > 0.8
    assert np.abs(errors[100:]).max() < share * scales.max()
    # nothing adds up: the last error is no larger than what a few steps leave
    steps = np.abs(np.diff(errors[200:], axis=0)).max()
    assert np.abs(errors[200:]).max() < ck.RARE_INTERVAL * steps


@pytest.mark.parametrize("drive", [0.0, 0.5])
def test_between_smooth_walls_the_momentum_along_them_is_kept(drive, device):
    """Across them it is theirs: the drop begins off the middle, and what pushes it there is left alone."""
    changes = {"domain.boundary": {"x": "periodic", "y": "free_slip"}, "body_force": [drive, 0.0]}
    model = prepared(changes, device)
    assert model.physics.spec.momentum_axes == (0,)
    across = []
    for _ in range(60):
        model.stepper.run(100.0, 1)
        across.append(model.stepper.read()[0][ck.DRIFT_VELOCITY + 1])
    assert not np.any(across)
    errors, scales = follow_along(model, 0, 240)
    assert np.abs(errors[100:]).max() < 5e-5 * scales.max()


def follow_along(model, axis, steps):
    """Run steps one by one; return (how far the momentum along an axis is from what it must be, sum m |v|), (steps,)."""
    total, drive = masses(model).sum(), model.case.body_force[axis]
    errors, scales = [], []
    for _ in range(steps):
        model.stepper.run(100.0, 1)
        clock, _ = model.stepper.read()
        found, scale = momentum(model)
        errors.append(found[axis] - total * drive * (clock[ck.TIME] - 0.5 * clock[ck.LAST_STEP]))
        scales.append(scale)
    return np.array(errors), np.array(scales)


def test_without_the_stage_it_drifts(device, monkeypatch):
    """The scene of the tests above has a drift to take out."""
    monkeypatch.setattr("warpsph.running.model.derive", without_constraint(monkeypatch))
    model = Model(case_of(BOX), device=device, threads=1)
    model.stepper.prepare(fresh=True)
    errors, scales = follow(model, 300)
    assert np.abs(errors[100:]).max() > 1e-3 * scales.max()


def without_constraint(monkeypatch):
    """Return `derive` with the momentum left to itself."""
    from warpsph.scene.physics import derive

    def changed(*arguments, **keywords):
        physics = derive(*arguments, **keywords)
        return dataclasses.replace(physics, spec=dataclasses.replace(physics.spec, momentum_axes=()))

    return changed


def test_the_box_moves_on_with_its_start_velocity(device):
    """The same flow, seen from a frame that moves: with equal steps nothing else is different, whenever lists are built.

    What rounding of the moving positions leaves, eps times the frame's speed, is amplified by c/u in every step.
    """
    frame, step, steps = np.array([0.5, -0.25]), 5e-4, 150
    # the correction of the viscous term looks at the list, skin and all, and so at when it was built
    inviscid = {"phases.light.viscosity": 0, "phases.heavy.viscosity": 0}
    changes = {"numerics.maximum_step": step, "scales.velocity": 0.6, **inviscid}
    still, moving = (
        prepared(changes | {"start.velocity": list(velocity)}, device) for velocity in (0 * frame, frame)
    )
    before = still.snapshot()
    for model in (still, moving):
        model.stepper.run(100.0, steps)
    one, other = still.snapshot(), moving.snapshot()
    assert one.time == other.time == pytest.approx(step * steps)
    assert still.stepper.read()[1][ck.REBUILDS] != moving.stepper.read()[1][ck.REBUILDS]
    np.testing.assert_allclose(other.velocity - frame, one.velocity, rtol=0, atol=1e-10 * np.linalg.norm(frame))
    apart = other.position - one.position - frame * one.time
    assert np.abs(apart - np.round(apart)).max() < 1e-12
    assert np.abs(one.position - before.position).max() > 1e-3


def test_three_dimensions(device):
    changes = {
        "dimension": 3,
        "particle_spacing": 1 / 8,
        "domain": {"lower": [0, 0, 0], "upper": [1, 1, 1], "boundary": dict.fromkeys("xyz", "periodic")},
        "fluids.0.shape": {"box": {"lower": [0.2, 0.2, 0.2], "upper": [0.7, 0.6, 0.7]}},
        "start.velocity": [0.4, -0.3, 0.2],
        "body_force": [0.5, 0.2, -0.7],
    }
    errors, scales = follow(prepared(changes, device), 60)
    assert np.abs(errors[20:]).max() < 2e-4 * scales.max()


# restart and threads ----------------------------------------------------------------------------------------


SWIRL = {
    "start.velocity": ["0.2+0.3*sin(2*pi*y)", "0.1+0.3*sin(2*pi*x)"],
    "start.noise": 0.0,
    "body_force": [0.5, 0.2],
    "numerics.skin": 0.06,
}


def same(one, other):
    """Assert that two saved states hold the same bits."""
    assert one.keys() == other.keys()
    for name in one.keys() - {"clock", "counters"}:
        assert one[name].tobytes() == other[name].tobytes(), name
    numbers = [index for index in range(ck.CLOCK_SIZE) if index != ck.TARGET]
    np.testing.assert_array_equal(one["clock"][numbers], other["clock"][numbers])
    for counter in (ck.STEPS, ck.REBUILDS, ck.STEPS_SINCE_RARE):
        assert one["counters"][counter] == other["counters"][counter], counter


def saved(model):
    return copy.deepcopy(model.save_state())


SLOW = {"start.velocity": ["0.1+0.1*sin(2*pi*y)", "0.1*sin(2*pi*x)"], "body_force": [0.2, 0.1]}


@pytest.mark.parametrize(
    "changes, reached",
    [
        ({"surface_tension": []}, 2),
        (SLOW | {"numerics.maximum_step": 1.5e-3}, 4),
        (SLOW | {"numerics.maximum_step": 5e-4}, ck.RARE_INTERVAL),
    ],
    ids=["way", "time", "steps"],
)
def test_restart_anywhere_between_two_constraints(changes, reached, device):
    """Bit by bit, also where a velocity is about to be taken out, whatever asks for that."""
    whole = prepared(SWIRL | changes, device)
    whole.stepper.run(100.0, 20)
    since, pending = set(), set()
    states = [saved(whole)]
    for _ in range(8):
        whole.stepper.run(100.0, 1)
        states.append(saved(whole))
    for state in states:
        since.add(int(state["counters"][ck.STEPS_SINCE_RARE]))
        pending.add(bool(state["clock"][ck.DRIFT_VELOCITY]))
    assert len(since) == reached and pending == {True, False}
    whole.stepper.run(100.0, 13)
    end = saved(whole)
    for state in states:
        model = Model(whole.case, device=device, threads=1, fresh=False)
        model.load_state(state)
        model.stepper.prepare(fresh=False)
        model.stepper.run(100.0, int(end["counters"][ck.STEPS] - state["counters"][ck.STEPS]))
        same(saved(model), end)


def test_threads_do_not_change_it(monkeypatch):
    """Neither the state nor any of the velocities that were taken out on the way; several particles a block."""
    monkeypatch.setattr(launch, "SMALLEST_SHARE", 8)
    ends, drifts = [], []
    for threads in (1, 2, 3):
        model = prepared(SWIRL | {"particle_spacing": 1 / 40}, threads=threads)
        drifts.append([])
        for _ in range(40):
            model.stepper.run(100.0, 1)
            drifts[-1].append(list(model.stepper.read()[0][ck.DRIFT_VELOCITY : ck.DRIFT_VELOCITY + 2]))
        ends.append(saved(model))
        model.launcher.team.close()
    assert ends[0]["counters"][ck.REBUILDS] >= 2 and np.count_nonzero(drifts[0]) >= 16
    for end, drift in zip(ends[1:], drifts[1:], strict=True):
        same(end, ends[0])
        assert drift == drifts[0]


# where it is ------------------------------------------------------------------------------------------------


WALLS = {"x": "periodic", "y": "wall"}
SMOOTH = {"x": "periodic", "y": "free_slip"}
OPEN = {"x": "periodic", "y": "open"}
PIN = {"pin": {"shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.2}}}}


@pytest.mark.parametrize(
    "scene, changes, kept",
    [
        (BOX, {}, True),
        (PERIODIC, {}, True),
        (BOX, {"domain.boundary": SMOOTH}, True),
        (BOX, {"domain.boundary": SMOOTH, "surface_tension.0.contact_angle": 60}, True),
        (BOX, {"domain.boundary": WALLS}, False),
        (BOX, {"domain.boundary": OPEN}, False),
        (BOX, {"domain.boundary": OPEN, "numerics.pressure_gradient": "corrected"}, False),
        (BOX, {"bodies": PIN}, False),
        (BOX, {"numerics.pressure_gradient": "conservative"}, False),
        (LEAN, {}, False),
        (FULL, {}, False),
    ],
)
def test_only_periodic_axes_along_which_nothing_pushes_have_it(scene, changes, kept):
    """Friction on walls and bodies takes momentum, the conservative gradient keeps it; `show` says so.

    Contact lines on walls without friction take at one edge of a fluid what they give at the other.
    """
    plan = describe(case_of(scene).replace(changes))
    assert bool(plan["structure"]["momentum_axes"]) is kept
    stages = [stage["name"] for stage in plan["stages"] if stage["name"].startswith("drift")]
    assert stages == (["drift", "drift_close"] if kept else [])
    assert ("drift" in {row["name"] for row in plan["absent"]}) is not kept


def test_it_runs_after_the_kick_and_rarely():
    nodes = riemann.step(prepared().physics.spec)
    names = [node.name for node in walk(nodes)]
    assert names.index("kick_drift") < names.index("drift") < names.index("momentum")
    rare = {node.name for group in nodes if isinstance(group, Rarely) for node in group.nodes}
    assert {name for name in names if name.startswith("drift")} <= rare
