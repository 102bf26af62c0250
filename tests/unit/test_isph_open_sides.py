"""Inlets and outlets of projection ISPH: what goes through, what is given at the sides, restarts and room."""

import copy

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.engine.program import Stage
from warpsph.errors import CaseError
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.fields import BUFFER, FLUID
from warpsph.kernels.isph.open_projection import make_rows_outside
from warpsph.running.model import Model
from warpsph.schemes import open_run

# A box that fluid of density 2 flows through, the same everywhere along y.
THROUGH = {
    "dimension": 2,
    "particle_spacing": 0.1,
    "end_time": 200.0,
    "domain": {
        "lower": [0, 0],
        "upper": [1, 0.8],
        "boundary": {
            "x": {"lower": {"inlet": {"velocity": [1, 0]}}, "upper": {"outlet": {"pressure": 0}}},
            "y": "periodic",
        },
    },
    "numerics": {"scheme": "isph"},
    "phases": {"water": {"density": 2.0}},
    "fluids": [{"phase": "water", "shape": "rest"}],
}

# Poiseuille flow of Re = 20 between no-slip walls.
PARABOLA = "6*y*(1 - y)"
CHANNEL = {
    **THROUGH,
    "domain": {
        "lower": [0, 0],
        "upper": [3, 1],
        "boundary": {
            "x": {"lower": {"inlet": {"velocity": [PARABOLA, 0]}}, "upper": {"outlet": {"pressure": 0}}},
            "y": "wall",
        },
    },
    "phases": {"water": {"density": 1.0, "viscosity": 0.05}},
    "start": {"velocity": [PARABOLA, 0]},
}
INLET = "domain.boundary.x.lower.inlet"
LOWER, UPPER = "domain.boundary.x.lower", "domain.boundary.x.upper"


def scene(data, changes=None):
    """A case with changes by dotted path."""
    case = Case.from_dict(copy.deepcopy(data))
    return case.replace(changes) if changes else case


def prepared(case, device, threads=1):
    """A run of the case, its list built."""
    model = Model(case, device=device, threads=threads)
    model.stepper.prepare(fresh=True)
    return model


def run(model, time):
    """Step to a time [s] without a fault and return the fluid."""
    model.stepper.run(time, 10**8)
    assert model.stepper.read()[1][ck.FAULT] == 0
    return model.snapshot().fluid


def through(model):
    """Mass that has come in less what has gone out [kg/m]."""
    masses = model.stepper.bindings["through"].numpy().reshape(-1, 2)
    return float((masses[:, 0] - masses[:, 1]).sum())


# what goes through -------------------------------------------------------------------------------------------------


def test_a_disturbance_of_a_uniform_flow_goes_and_none_comes(device):
    """A shear of a tenth and displaced particles leave within 10 lengths of the domain; as many particles are there."""
    model = prepared(scene(THROUGH, {"start.velocity": ["1 + 0.1*sin(2*pi*y/0.8)", 0], "start.noise": 0.1}), device)
    count = model.fluid_count
    for time in (10.0, 20.0):
        fluid = run(model, time)
        np.testing.assert_allclose(fluid.velocity, np.broadcast_to([1.0, 0.0], fluid.velocity.shape), atol=1e-6)
        assert np.abs(fluid.pressure).max() < 1e-6 * 2.0
        assert abs(len(fluid) - count) <= 8  # a row may be on its way in or out
    masses = model.stepper.bindings["through"].numpy()
    assert masses[0] == pytest.approx(2.0 * 0.8 * 20.0, rel=0.01) and masses[1] == 0 == masses[2]
    assert len(np.unique(model.particles.get("particle_id"))) == model.particles.count


def test_an_inlet_that_opens_at_once_starts_all_of_the_flow(device):
    """After one step of dt the velocity is there, by the pressure rho U (L - x)/dt that it takes; float32 and tolerance."""
    model = prepared(scene(THROUGH), device)
    fluid = run(model, 0.01)
    assert model.steps == 1
    np.testing.assert_allclose(fluid.velocity, np.broadcast_to([1.0, 0.0], fluid.velocity.shape), atol=2e-5)
    np.testing.assert_allclose(fluid.pressure, 200.0 * (1.0 - fluid.position[:, 0]), atol=0.02)


def test_a_ramp_ends_when_it_says(device):
    """Samples are a tenth of a step apart, so that the kink is rounded by a hundredth of what the ramp changes."""
    model = prepared(scene(THROUGH, {INLET: {"velocity": [1, 0], "ramp": "minimum(t/0.5, 1)"}}), device)
    np.testing.assert_allclose(run(model, 0.5).velocity[:, 0], 1.0, atol=0.015)


def test_a_flow_that_changes_its_direction_follows_its_signal(device):
    """Fluid comes and goes at both sides: u = cos(2 pi t/3), dp/dx = rho 2 pi/3 sin; mass adds up."""
    ramp = {"velocity": [1, 0], "ramp": "cos(2*pi*t/3)"}
    model = prepared(scene(THROUGH, {INLET: ramp, "start.velocity": [1, 0]}), device)
    start = model.snapshot().fluid.mass.sum()
    for time in np.arange(0.5, 6.01, 0.5):
        fluid = run(model, time)
        phase = 2 * np.pi * time / 3
        # the Courant number allows steps of 0.06 s: second order leaves (2 pi/3 dt)^2/3 = 0.5 %
        np.testing.assert_allclose(fluid.velocity[:, 0], np.cos(phase), atol=0.02)
        slope = np.polyfit(fluid.position[:, 0], fluid.pressure, 1)[0]
        assert slope == pytest.approx(2.0 * 2 * np.pi / 3 * np.sin(phase), abs=0.1)
        assert fluid.mass.sum() == pytest.approx(start + through(model), rel=2e-6)
    assert (model.stepper.bindings["through"].numpy() > 0.5).all()


def test_rows_beyond_the_sides_stay_whole(device):
    """In a flow that swings each row of the inlet keeps its spacing, also to the fluid that it becomes."""
    ramp = {"velocity": [PARABOLA, 0], "ramp": "1 + 0.5*sin(2*pi*t/2)"}
    model = prepared(scene(CHANNEL, {INLET: ramp}), device)
    run(model, 3.0)
    zone = model.particles.get("zone")
    position = model.particles.get("position")[: len(zone)]
    assert set(zone) == {FLUID, BUFFER, BUFFER + 1}
    inlet = position[zone == BUFFER]
    for y in range(10):
        x = np.sort(inlet[np.floor(inlet[:, 1] / 0.1) == y, 0])
        assert 4 <= len(x) <= 6
        np.testing.assert_allclose(np.diff(x), 0.1, atol=1e-4)


@pytest.mark.parametrize(
    "inlet, error, flow",
    # the sites of a parabola add 1/(2 n^2) = 0.5 % to its flow; between two pressures the friction at the walls decides
    [({"velocity": [PARABOLA, 0]}, 0.01, 0.006), ({"pressure": 1.8}, 0.02, 0.035)],
)
def test_poiseuille_flow_goes_through(device, inlet, error, flow):
    """10 spacings across: a developed flow stays one, with its pressure drop in the mean of some moments."""
    model = prepared(scene(CHANNEL, {LOWER: {"inlet": inlet}}), device)
    slopes = []
    for time in np.arange(4.0, 6.01, 0.25):
        fluid = run(model, time)
        x, y = fluid.position.T
        assert np.sqrt(((fluid.velocity[:, 0] - 6 * y * (1 - y)) ** 2).mean()) / 1.5 < error
        slopes.append(np.polyfit(x, fluid.pressure, 1)[0])
    assert np.mean(slopes) == pytest.approx(-12 * 0.05, rel=0.05)
    rates = model.flow_rates()
    assert rates["flow x_lower"] == pytest.approx(1.0, abs=flow)
    assert rates["flow x_upper"] == pytest.approx(-rates["flow x_lower"], abs=0.003)


def test_flow_past_a_body(device):
    """A box on the floor, of whole cells: births know nothing of walls here, and what comes in goes out."""
    box = {"box": {"shape": {"box": {"lower": [1, 0], "upper": [1.4, 0.3]}}}}
    model = prepared(scene(CHANNEL, {"bodies": box}), device)
    start = model.snapshot().fluid.mass.sum()
    fluid = run(model, 2.0)
    masses = model.stepper.bindings["through"].numpy()
    assert masses[0] == pytest.approx(2.0, rel=0.05)
    assert fluid.mass.sum() == pytest.approx(start + through(model), rel=2e-6)
    assert fluid.mass.sum() == pytest.approx(start, rel=0.02)  # a row of one spacing is 3 %
    assert fluid.velocity[np.abs(fluid.position[:, 0] - 1.2) < 0.2, 0].max() > 1.5


DISC = {"center": [1.0, 0.5], "radius": 0.2}
STREAM = {
    "particle_spacing": 1 / 16, "domain.boundary.y": "free_slip", LOWER: {"inlet": {"velocity": [1, 0]}},
    "start.velocity": [0, 0], "phases.water.viscosity": 0.1, "scales": {"velocity": 2.0, "length": 0.4},
}  # fmt: skip


def means(model, times, *names):
    """Means of loads and of what goes through the sides over some moments."""
    rows = []
    for time in times:
        run(model, time)
        rows.append({**model.wall_forces(), **model.flow_rates()})
    return [np.mean([row[name] for row in rows]) for name in names]


def test_a_body_takes_what_the_stream_loses(device):
    """A disc that cuts cells, between sides without friction: its drag is the difference of pressures."""
    disc = {"disc": {"shape": {"sphere": DISC}}}
    model = prepared(scene(CHANNEL, {**STREAM, "bodies": disc}), device)
    assert model.physics.spec.bodies
    names = ("wall_force_x disc", "face_pressure x_lower", "face_pressure x_upper", "flow x_lower", "flow x_upper")
    drag, before, behind, inflow, outflow = means(model, np.arange(2.0, 4.01, 0.13), *names)
    assert inflow == pytest.approx(1.0, rel=1e-6) and -outflow == pytest.approx(1.0, rel=0.01)
    assert before - behind > 0.5 and drag == pytest.approx(before - behind, rel=0.06)
    assert model.leaks()[0] == {"water": 0}


def test_a_disc_that_turns_in_a_stream_is_pushed_aside(device):
    """Turning against the clock in a stream along x it is pushed down, the other way round up, and is held back alike."""
    pushed = []
    for turn in (2.5, -2.5):
        motion = {"rotation": f"{turn}*(t - tanh(t))", "pivot": DISC["center"]}
        disc = {"disc": {"shape": {"sphere": DISC}, "motion": motion}}
        model = prepared(scene(CHANNEL, {**STREAM, "bodies": disc}), device)
        pushed.append(means(model, np.arange(3.0, 4.01, 0.13), "wall_force_y disc", "wall_torque_z disc"))
    (down, back), (up, forth) = pushed
    assert down < -0.1 and up == pytest.approx(-down, rel=0.1)
    assert back < -0.05 and forth == pytest.approx(-back, rel=0.03)


def test_weight_along_the_sides_is_no_flow(device):
    """Fluid at rest under gravity between two open sides that give its pressure, walls below and above."""
    weight = {"pressure": "9.81*(1 - y)"}
    changes = {LOWER: {"inlet": weight}, UPPER: {"outlet": weight}, "gravity": [0, -9.81], "start.velocity": [0, 0],
               "scales.velocity": 1.0, "end_time": 1.0}  # fmt: skip
    fluid = run(prepared(scene(CHANNEL, changes), device), 0.5)
    assert np.abs(fluid.velocity).max() < 1e-4 * np.sqrt(9.81)
    np.testing.assert_allclose(fluid.pressure, 9.81 * (1.0 - fluid.position[:, 1]), atol=1e-3 * 9.81)


def test_velocities_given_at_both_ends(device):
    """From rest to a uniform flow; the pressure has no mean. A parabola that other sites sample has the same flow."""
    ramp = {"inlet": {"velocity": [1, 0], "ramp": "minimum(t, 1)"}}
    model = prepared(scene(THROUGH, {LOWER: ramp, UPPER: ramp, "start.noise": 0.1}), device)
    fluid = run(model, 0.5)
    np.testing.assert_allclose(fluid.velocity[:, 0], 0.5, atol=2e-3)
    assert np.polyfit(fluid.position[:, 0], fluid.pressure, 1)[0] == pytest.approx(-2.0, rel=0.01)
    assert abs(fluid.pressure.mean()) < 1e-6
    totals = model.stepper.systems.report()
    assert totals["failures"] == 0 and totals["worst_iterations"] < 20
    step = scene(THROUGH, {LOWER: {"inlet": {"velocity": ["1 + 0.001*y", 0]}}, UPPER: {"inlet": {"velocity": [1, 0]}}})
    model = Model(step, device=device, threads=1)
    faces = open_run.open_run(step, model.geometry, model.physics).faces
    assert faces[1].velocity[:, 0].sum() == pytest.approx(faces[0].velocity[:, 0].sum(), rel=1e-12)


def test_real_water_with_a_signal_and_a_wall_without_friction(device):
    """10 mm of water over a floor, free-slip above, 1.6 spacings a boundary layer; the pressure swings once in 2 s."""
    height, length, nu, rho, swing = 0.01, 0.04, 1.0e-6, 1000.0, 0.01 * np.pi
    drop = {"inlet": {"pressure": rho * swing * length, "ramp": "sin(pi*t)"}}
    changes = {
        "particle_spacing": height / 20, "domain.upper": [length, height], "scales.velocity": 0.02, LOWER: drop,
        "domain.boundary.y": {"lower": "wall", "upper": "free_slip"}, "start.velocity": [0, 0],
        "phases.water": {"density": rho, "viscosity": nu * rho},
    }  # fmt: skip
    model = prepared(scene(CHANNEL, changes), device)
    fluid = run(model, 1.0)
    # u_t = swing sin(pi t) + nu u_yy from rest, u = sum of b_k(t) sin(w_k y), w_k = (k + 1/2) pi/height
    w = (np.arange(400) + 0.5) * np.pi / height
    rate = nu * w**2
    growth = (np.pi * np.exp(-rate) + np.pi) / (rate**2 + np.pi**2)  # integral of exp(-rate (1 - s)) sin(pi s) to t = 1
    exact = (2.0 * swing / (height * w) * growth) @ np.sin(np.outer(w, fluid.position[:, 1]))
    assert np.sqrt(((fluid.velocity[:, 0] - exact) ** 2).mean()) < 0.015 * 0.02
    assert np.abs(fluid.velocity[:, 1]).max() < 0.01 * 0.02
    rates = model.flow_rates()
    assert rates["flow x_lower"] == pytest.approx(-rates["flow x_upper"], rel=0.005)


def test_bodies_go_on_beyond_inlets():
    """By the support of the kernel, 3 layers, so that no fluid beside them sees a hole."""
    box = {"step": {"shape": {"box": {"lower": [-1, 0], "upper": [1, 0.5]}}}}
    geometry = Model(scene(CHANNEL, {"bodies": box}), device="cpu", threads=1).geometry
    walls = geometry.position[geometry.kind == 1]
    np.testing.assert_allclose(walls.min(axis=0), [-0.25, 0.05], atol=1e-9)
    np.testing.assert_allclose(walls.max(axis=0), [0.95, 0.45], atol=1e-9)


# runs --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["restart", "growth", "threads"])
def test_results_do_not_depend_on(device, kind, monkeypatch):
    """A restart in the middle, a start with less room, a second thread: bit by bit the same."""
    case = scene(CHANNEL)
    whole = prepared(case, device)
    if kind == "growth":
        with monkeypatch.context() as patch:
            patch.setattr(open_run, "ROOM", 1.0)
            other = prepared(case, device)
    else:
        other = prepared(case, device, threads=2 if kind == "threads" else 1)
    whole.stepper.run(100.0, 30)
    if kind == "restart":
        other = Model(case, device=device, threads=1, fresh=False)
        other.load_state({name: np.array(values) for name, values in whole.save_state().items()})
        other.stepper.prepare(fresh=False)
    else:
        other.stepper.run(100.0, 30)
    for model in (whole, other):
        model.stepper.run(100.0, 40)
    assert other.particles.grown == (kind == "growth")
    first, second = whole.save_state(), other.save_state()
    for name, values in first.items():
        if name in ("counters", "clock"):
            kept = (ck.COUNTERS if name == "counters" else ck.CLOCK).kept
            np.testing.assert_array_equal(values[kept], second[name][kept], err_msg=name)
        else:
            np.testing.assert_array_equal(values, second[name], err_msg=name)


def test_rows_without_fluid_are_out_of_the_equations(device):
    """Buffers and rows that no particle has: identity, whatever was there; those of the fluid stay."""
    model = prepared(scene(CHANNEL), device)
    model.stepper.run(100.0, 2)
    bindings, level = model.stepper.bindings, model.stepper.levels[0]
    for name, value in (("matrix_counts", 3), ("matrix_diagonal", 7.0), ("source", 5.0)):
        bindings[name].fill_(value)
    level.task(Stage("rows_outside", make_rows_outside(level.spec), "matrix_diagonal", "")).run()
    fluid = bindings["zone"].numpy() == FLUID
    assert 0 < fluid.sum() < len(fluid) > model.particles.fluid_count
    np.testing.assert_array_equal(bindings["matrix_counts"].numpy(), np.where(fluid, 3, 0))
    np.testing.assert_array_equal(bindings["matrix_diagonal"].numpy(), np.where(fluid, 7.0, 1.0))
    np.testing.assert_array_equal(bindings["source"].numpy(), np.where(fluid, 5.0, 0.0))


# cases -------------------------------------------------------------------------------------------------------------


def test_keys_about_sound_do_nothing(device):
    """To the last bit: a case for the other schemes runs as it is."""
    sound = {
        LOWER: {"inlet": {"velocity": [1, 0], "waves": "leave", "relaxation": 0.5, "sponge": {"length": 0.3}}},
        UPPER: {"outlet": {"pressure": 0, "waves": "reflect", "sponge": {"length": 0.2}}},
    }
    plain = {LOWER: {"inlet": {"velocity": [1, 0]}}, UPPER: {"outlet": {"pressure": 0}}}
    states = []
    for sides in (sound, plain):
        model = prepared(scene(THROUGH, {**sides, "start.velocity": ["1 + 0.1*sin(2*pi*y)", 0]}), device)
        model.stepper.run(100.0, 5)
        states.append(model.snapshot().fluid)
        told = [line for line in model.physics.warnings if "there is no sound" in line]
        assert len(told) == (5 if sides is sound else 0), told
    for name in ("position", "velocity", "pressure"):
        np.testing.assert_array_equal(getattr(states[0], name), getattr(states[1], name), err_msg=name)


def test_a_sponge_that_draws_the_flow_is_refused():
    """With key and remedy: no sponge acts."""
    with pytest.raises(CaseError, match=r"x\.upper\.outlet\.sponge\.velocity.* no sponge acts.*delete it"):
        scene(THROUGH, {UPPER: {"outlet": {"sponge": {"length": 0.2, "velocity": [1, 0]}}}})


def test_what_a_run_cannot_do_is_told():
    """A free surface, more that goes out than comes in, the conservative gradient."""
    half = [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.4]}}}]
    with pytest.raises(CaseError, match="has to fill it"):
        Model(scene(THROUGH, {"fluids": half}), device="cpu", threads=1)
    uneven = {LOWER: {"inlet": {"velocity": [1, 0]}}, UPPER: {"inlet": {"velocity": [1.5, 0]}}}
    with pytest.raises(CaseError, match=r"x\.upper\.inlet\.velocity: .*more than comes in"):
        Model(scene(THROUGH, uneven), device="cpu", threads=1)
    with pytest.raises(CaseError, match=r"numerics\.pressure_gradient: conservative .*corrected"):
        Model(scene(THROUGH, {"numerics.pressure_gradient": "conservative"}), device="cpu", threads=1)
