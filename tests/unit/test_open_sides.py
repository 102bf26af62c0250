"""Inlets and outlets: what goes in and out, what arrives at a side and what comes back from it."""

from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

from tests.helpers import evaluate
from tests.open_scenes import CHANNEL, INLET, OUTLET, THROUGH, buffers, prepared, run, scene, through
from warpsph.case.case import Case
from warpsph.engine.program import Stage
from warpsph.errors import CaseError
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.eos import make_eos
from warpsph.kernels.core.fields import BUFFER, FLUID
from warpsph.kernels.core.open_flow import make_excess, make_sponge
from warpsph.kernels.core.side_fit import LEAST_PIVOT, make_solve
from warpsph.measure.flow_gauges import ReattachmentGauge, turns
from warpsph.measure.totals import Motion
from warpsph.running.model import Model
from warpsph.scene.open_faces import buffer_layers, make_faces, signal_samples
from warpsph.schemes import open_run

# formulas ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [1.0, 1.4, 7.0])
def test_density_of_a_pressure_is_the_inverse_of_the_equation_of_state(device, gamma):
    """To rounding, for pressures from a millionth to a tenth of the stiffness, both signs."""
    size = np.logspace(-6, -1, 11)
    pressure = 50.0 * np.concatenate([-size, size])
    rest = np.full_like(pressure, 50.0), np.full_like(pressure, gamma)
    excess = evaluate(make_excess("float64"), "float64", pressure, *rest, device=device)
    np.testing.assert_allclose(evaluate(make_eos("float64"), "float64", excess, *rest, device=device), pressure, rtol=1e-12)


@pytest.mark.parametrize("size", [4, 7])
def test_solution_by_elimination(device, size):
    """A symmetric positive system against NumPy; of a singular one the solution of the terms that it tells apart."""
    solve = make_solve(size)
    row = wp.types.vector(length=size, dtype=wp.float64)
    square = wp.types.matrix(shape=(size, size), dtype=wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def apply(m: wp.array(dtype=square), b: wp.array(dtype=row), x: wp.array(dtype=row)):
        x[0] = solve(m[0], b[0])

    def solution(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
        x = wp.zeros(1, dtype=row, device=device)
        inputs = [wp.array([matrix], dtype=square, device=device), wp.array([right], dtype=row, device=device), x]
        wp.launch(apply, dim=1, inputs=inputs, device=device)
        return x.numpy()[0]

    random = np.random.default_rng(1)
    root = random.normal(size=(size, size))
    right = random.normal(size=size)
    matrix = root @ root.T + np.eye(size)
    np.testing.assert_allclose(solution(matrix, right), np.linalg.solve(matrix, right), rtol=1e-9)
    expected = np.zeros(size)
    expected[0] = 1.0
    np.testing.assert_allclose(solution(np.ones((size, size)), np.ones(size)), expected, atol=1e-12)


@pytest.mark.parametrize("scatter", [1e-6, 1e-3, 1e-2, 0.1])
def test_a_column_of_particles_makes_no_slope(device, scatter):
    """A column whose places scatter by less than 0.2 spacings, noise of 1: the slope stays below what 0.2 make of it."""
    size = 4
    solve = make_solve(size)
    row = wp.types.vector(length=size, dtype=wp.float64)
    square = wp.types.matrix(shape=(size, size), dtype=wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def apply(m: wp.array(dtype=square), b: wp.array(dtype=row), x: wp.array(dtype=row)):
        k = wp.tid()
        x[k] = solve(m[k], b[k])

    random = np.random.default_rng(3)
    count = 200
    across = np.linspace(-2.0, 2.0, 9)
    terms = np.stack([np.ones((count, 9)), *np.broadcast_arrays(across, across**2 * np.ones((count, 1)))], axis=2)
    terms = np.concatenate([terms, -1.0 + scatter * random.normal(size=(count, 9, 1))], axis=2)
    noise = random.uniform(-1.0, 1.0, size=(count, 9))
    moments = np.einsum("ijk,ijl->ikl", terms, terms) / 9
    rights = np.einsum("ij,ijk->ik", noise, terms) / 9
    x = wp.zeros(count, dtype=row, device=device)
    inputs = [wp.array(moments, dtype=square, device=device), wp.array(rights, dtype=row, device=device), x]
    wp.launch(apply, dim=count, inputs=inputs, device=device)
    slopes = np.abs(x.numpy()[:, -1])
    assert slopes.max() <= 1.0 / np.sqrt(LEAST_PIVOT)
    assert slopes.max() <= scatter / LEAST_PIVOT * 3.0


def test_samples_of_a_signal_do_not_depend_on_the_end():
    """A run that goes on for longer sees the same ramp; a constant needs one sample."""
    case = scene(THROUGH, **{INLET: {"velocity": [1, 0], "ramp": "minimum(t/0.5, 1)"}})
    model = Model(case, device="cpu", threads=1)
    faces = make_faces(case, model.geometry, model.physics.support, 0.1)
    short, step = signal_samples(faces, 1.0, 0.01)
    long, same = signal_samples(faces, 2.0, 0.01)
    assert step == same == 0.01 and len(short[1]) == 1
    np.testing.assert_array_equal(short[0], long[0][: len(short[0])])
    np.testing.assert_allclose(long[0], np.minimum(np.arange(len(long[0])) * 0.01 / 0.5, 1.0))


def test_layers_reach_a_support_however_late_a_list_is_made():
    """Support 3 spacings: a particle at the side sees 3; the rows may have moved by 0.84, and the next is up to 1 away."""
    assert buffer_layers(0.3, 0.12, 0.1) == 5
    assert buffer_layers(0.3, 0.6, 0.1) == 6


def test_changes_of_sign_along_a_line():
    """Linear between points, from negative to positive alone."""
    np.testing.assert_allclose(turns(np.arange(5.0), np.array([1.0, -1.0, 3.0, -2.0, 2.0])), [1.25, 3.5])


def test_a_start_is_prepared_once():
    """A second time filled the buffers again, beyond the arrays."""
    model = prepared(scene(THROUGH), "cpu")
    count = model.particles.fluid_count
    with pytest.raises(RuntimeError, match="prepared already"):
        model.stepper.prepare(fresh=True)
    assert model.particles.fluid_count == count


def test_where_a_flow_comes_back_to_a_wall():
    """u = (x - 1.7) y + 3 y^2 turns at x = 1.7 - 3 y on a line at y, and its shear at the wall at 1.7."""
    for wall, place in ((None, 1.7 - 3 * 0.05), ([7, 0], 1.7)):
        gauge = {"type": "reattachment", "from": [0, 0.05], "to": [3, 0.05], "count": 31, "interval": 1}
        case = scene(THROUGH, gauges={"eddy": gauge | ({} if wall is None else {"wall": wall})})
        found = ReattachmentGauge("eddy", case.gauges["eddy"], case)
        x, y = found.points.T
        velocity = np.stack([(x - 1.7) * y + 3 * y**2, 0 * x], axis=1)
        (row,) = found.rows(SimpleNamespace(samples={"eddy": {"velocity": velocity}}))
        assert np.isnan(row[0]) and row[1] == pytest.approx(place, abs=1e-9)
    for wall, rule in (([1, 0.05], "lies on the line itself"), ([1], "2 numbers|needs 2|has 1")):
        with pytest.raises(CaseError, match=rf"gauges\.eddy\.wall.*({rule})"):
            scene(THROUGH, gauges={"eddy": gauge | {"wall": wall}})


# what arrives at a side ----------------------------------------------------------------------------------------


def test_fit_is_exact_for_a_linear_pressure_and_a_parabola_along_the_side(device):
    """At a disordered start; the pressure of the buffers continues the line, their velocity is that of the side."""
    profile = "0.7 + 0.4*y - 0.3*y**2"
    case = scene(
        CHANNEL, **{INLET: {"velocity": [profile, 0]}, OUTLET: {"pressure": "2.0 + 3.0*3 - 1.5*y", "waves": "reflect"}},
        start__velocity=[profile, 0], start__pressure="2.0 + 3.0*x - 1.5*y", start__noise=0.2,
    )  # fmt: skip
    model = prepared(case, device)
    face = model.stepper.bindings["face_pressure"].numpy()
    speed = model.stepper.bindings["face_velocity"].numpy()
    y = model.stepper.bindings["site_position"].numpy()[:, 1]
    inlet = np.arange(len(y)) < len(y) // 2
    np.testing.assert_allclose(face[:, 0], 2.0 + 9.0 * ~inlet - 1.5 * y, atol=2e-4)
    np.testing.assert_allclose(face[:, 1], np.where(inlet, -3.0, 3.0), atol=1e-3)
    np.testing.assert_allclose(speed[:, 0], 0.7 + 0.4 * y - 0.3 * y**2, atol=2e-5)
    zone, position, velocity, state = buffers(model)
    np.testing.assert_allclose(state[:, 0], 2.0 + 3.0 * np.clip(position[:, 0], -0.3, 3.3) - 1.5 * position[:, 1], atol=1e-3)
    np.testing.assert_allclose(velocity[:, 1], 0.0, atol=1e-12)


# what goes through -----------------------------------------------------------------------------------------------


def test_uniform_flow_goes_on_for_100_lengths(device):
    """A disturbance of a tenth leaves and nothing comes after it: 1e-5 of U and rho U^2, particles steady."""
    model = prepared(scene(THROUGH, start__velocity=["1 + 0.1*sin(2*pi*y/0.8)", 0], start__noise=0.1), device)
    count = model.fluid_count
    state = run(model, 100.0)
    assert abs(model.fluid_count - count) <= 8  # a row may be on its way in or out
    fluid = state.fluid
    assert len(fluid) == model.fluid_count
    np.testing.assert_allclose(fluid.velocity, np.broadcast_to([1.0, 0.0], fluid.velocity.shape), atol=1e-5)
    assert np.abs(fluid.pressure).max() < 1e-5 * 2.0
    masses = model.stepper.bindings["through"].numpy()
    assert masses[0] == pytest.approx(2.0 * 0.8 * 100.0, rel=0.002) and masses[1] == 0 == masses[2]
    assert len(np.unique(model.particles.get("particle_id"))) == model.particles.count


def test_mass_in_the_domain_is_that_of_the_start_and_what_crossed(device):
    """Through an inlet that turns into an outlet and back, so that both sides let fluid in and out."""
    case = scene(THROUGH, **{INLET: {"velocity": [1, 0], "ramp": "cos(2*pi*t/3)"}, f"{OUTLET}.waves": "reflect"})
    model = prepared(case, device)
    start = model.snapshot().fluid.mass.sum()
    most = 0.0
    for time in np.arange(0.25, 6.01, 0.25):
        mass = run(model, time).fluid.mass.sum()
        assert mass == pytest.approx(start + through(model), rel=2e-6)
        most = max(most, abs(model.snapshot().fluid.velocity[:, 0] - np.cos(2 * np.pi * time / 3)).max())
    masses = model.stepper.bindings["through"].numpy()
    assert (masses > 0.5).all()
    assert most < 0.08  # sound takes 0.1 of the period to and fro


def test_rows_of_a_sheared_inlet_stay_whole(device):
    """Each row moves at its own speed; after many births its particles are still a spacing apart."""
    model = prepared(scene(CHANNEL), device)
    run(model, 2.0)
    zone, position, _, _ = buffers(model)
    inlet = position[zone == BUFFER]
    row = np.floor(inlet[:, 1] / 0.1)
    for y in range(10):
        x = np.sort(inlet[row == y, 0])
        assert 4 <= len(x) <= 6
        np.testing.assert_allclose(np.diff(x), 0.1, atol=2e-5)
    # the next one of a row is born as soon as it is inside of the depth of 0.5 m
    assert inlet[:, 0].min() < -0.42


def test_channel_flow_goes_through(device):
    """A developed flow stays one, between a given velocity and a given pressure: 1 % of the peak, and its pressure drop."""
    state = run(prepared(scene(CHANNEL), device), 4.0).fluid
    x, y = state.position.T
    error = (state.velocity[:, 0] - 6 * y * (1 - y)) / 1.5
    assert np.sqrt((error**2).mean()) < 0.01
    slope = np.polyfit(x, state.pressure, 1)[0]
    assert slope == pytest.approx(-12 * 0.05, rel=0.05)


# sound -------------------------------------------------------------------------------------------------------------


def pulse(device, waves):
    """The largest pressure that comes back from the outlet of a pulse that goes out there, over that of the pulse."""
    height, width, sound = 0.5, 0.5, 10.0
    case = scene(
        THROUGH, **{OUTLET: {"pressure": 0, "waves": waves}},
        domain__upper=[4, 0.8], particle_spacing=0.05,
        start__pressure=f"{height}*exp(-((x - 2)/{width})**2)",
        start__velocity=[f"1 + {height / (2 * sound)}*exp(-((x - 2)/{width})**2)", 0],
    )  # fmt: skip
    state = run(prepared(case, device), 0.33).fluid
    back = 0.5 * (state.pressure - 2 * sound * (state.velocity[:, 0] - 1.0))
    bins = np.floor(state.position[:, 0] / 0.2).astype(int)
    mean = np.bincount(bins, weights=back) / np.bincount(bins)
    return float(np.abs(mean).max() / height)


def test_a_pulse_leaves(device):
    """Under 3 % of it come back at the default; where the pressure is held nearly all does, less what the scheme damps."""
    assert pulse(device, "leave") < 0.03
    assert pulse(device, "reflect") > 0.5


@pytest.mark.parametrize("ramp", ["1", "minimum(t/0.1, 1)"])
def test_a_start_from_rest_is_over_when_sound_has_run_to_and_fro(device, ramp):
    """Outlets know what flow is on its way: the pressure Z U that meets it there is gone after 2 L/c, not after 10 L/c."""
    case = scene(THROUGH, **{INLET: {"velocity": [1, 0], "ramp": ramp}}, start__velocity=[0, 0], domain__upper=[2, 0.8])
    state = run(prepared(case, device), 0.6).fluid
    np.testing.assert_allclose(state.velocity[:, 0], 1.0, atol=0.05)
    assert np.abs(state.pressure).max() < 0.05 * 2.0 * 10.0


def test_a_sponge_draws_the_flow_to_what_is_given(device):
    """Quadratically towards the side, the velocity at the inlet, the density at the outlet; nothing outside of it."""
    sponges = {
        INLET: {"velocity": [1, 0], "sponge": {"length": 0.4, "strength": 2.0}},
        OUTLET: {"pressure": 3.0, "sponge": {"length": 0.3}},
    }
    model = prepared(scene(THROUGH), device)
    level, case = model.stepper.levels[0], scene(THROUGH, **sponges)
    values = open_run.arguments(
        open_run.open_run(case, model.geometry, model.physics), case, model.geometry, model.physics, model.device
    )
    zone = model.particles.get("zone")
    x = model.particles.get("position")[: len(zone), 0]
    velocity = np.array(model.particles.get("velocity"))
    velocity[:] = [1.5, 0.2]
    zero = np.zeros_like(velocity)
    for name, field in (("velocity", velocity), ("acceleration", zero), ("density_excess", zero[:, 0])):
        model.particles.put(name, field)
    model.stepper.write(clock={ck.STEP: 0.001})
    level.task(Stage("sponge", make_sponge(level.spec), "fluid", ""), values).run()
    fluid = zone == FLUID
    rate = fluid * 2.0 * 10.0 / 0.4 * np.maximum(1.0 - x / 0.4, 0.0) ** 2
    expected = -rate[:, None] * np.array([0.5, 0.2])
    np.testing.assert_allclose(model.particles.get("acceleration"), expected, atol=2e-5)
    rate = fluid * 3.0 * 10.0 / 0.3 * np.maximum(1.0 - (1.0 - x) / 0.3, 0.0) ** 2
    stiffness = 2.0 * 10.0**2 / 7.0
    expected = rate * 0.001 * ((1.0 + 3.0 / stiffness) ** (1.0 / 7.0) - 1.0)
    np.testing.assert_allclose(model.particles.get("density_excess"), expected, atol=2e-7)


# runs --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["restart", "growth", "threads"])
def test_results_do_not_depend_on(device, kind, monkeypatch):
    """A restart in the middle, a start with less room, a second thread: bit by bit the same."""
    case = scene(CHANNEL)
    whole, other = prepared(case, device), prepared(case, device, threads=2 if kind == "threads" else 1)
    if kind == "growth":
        other = narrow(case, device, monkeypatch)
        assert other.particles.fluid_capacity == other.particles.fluid_count + 1 < whole.particles.fluid_capacity
    whole.stepper.run(100.0, 150)
    if kind == "restart":
        other = Model(case, device=device, threads=1, fresh=False)
        other.load_state({name: np.array(values) for name, values in whole.save_state().items()})
        other.stepper.prepare(fresh=False)
    else:
        other.stepper.run(100.0, 150)
    for model in (whole, other):
        model.stepper.run(100.0, 250)
    assert other.particles.grown == (kind == "growth")
    assert whole.steps == other.steps == 400
    first, second = whole.save_state(), other.save_state()
    for name, values in first.items():
        if name in ("counters", "clock"):
            kept = (ck.COUNTERS if name == "counters" else ck.CLOCK).kept
            np.testing.assert_array_equal(values[kept], second[name][kept], err_msg=name)
        else:
            np.testing.assert_array_equal(values, second[name], err_msg=name)


def test_a_saved_state_does_not_change_any_more(device):
    """It is written beside the run, which goes on meanwhile."""
    model = prepared(scene(CHANNEL), device)
    run(model, 0.1)
    saved = model.save_state()
    before = {name: np.array(values) for name, values in saved.items()}
    run(model, 0.3)
    for name, values in before.items():
        np.testing.assert_array_equal(values, saved[name], err_msg=name)


def narrow(case, device, monkeypatch):
    """A run that has room for the particles of the start alone."""
    with monkeypatch.context() as patch:
        patch.setattr(open_run, "ROOM", 1.0)
        return prepared(case, device)


def test_what_leaks_is_counted_after_the_arrays_have_grown(device, monkeypatch):
    model = narrow(scene(CHANNEL), device, monkeypatch)
    run(model, 1.0)
    assert model.particles.grown
    before = model.leaks()[1]["water"]
    position, zone = model.particles.get("position"), model.particles.get("zone")
    position[int(np.flatnonzero(zone == FLUID)[0])] = [1.5, -0.06]
    model.particles.put("position", position)
    assert model.leaks()[1]["water"] == before + 1


def test_the_rows_of_those_who_died_are_empty(device):
    """Their entries named wall particles by rows that others have after the arrays have grown: sweeps read out of bounds."""
    model = prepared(scene(CHANNEL), device)
    run(model, 0.05)
    alive, live = model.particles.get("alive"), int(model.stepper.read()[1][ck.LIVE])
    assert model.particles.get("wall_neighbours")[:live][-40:].max() > 0
    alive[live - 40 : live] = 0
    model.particles.put("alive", alive)
    model.stepper.rebuild()
    after = int(model.stepper.read()[1][ck.LIVE])
    assert after < live
    for name in ("fluid_neighbours", "wall_neighbours"):
        assert not model.particles.arrays[name].numpy()[after : model.particles.fluid_capacity].any()


def test_gauges_leave_out_the_buffers(device, monkeypatch):
    """Sums of the device are those of the snapshot, which has the domain alone, also after the arrays have grown."""
    model = narrow(scene(CHANNEL), device, monkeypatch)
    grown = model.particles.grown
    for time in (0.05, 1.0):
        fluid = run(model, time).fluid
        assert (fluid.position[:, 0] > -0.1).all() and (fluid.position[:, 0] < 3.1).all()
        motion = model.sums.form([Motion])[Motion]
        assert motion.volume.sum() == pytest.approx(fluid.volume.sum(), rel=1e-6)
        assert motion.momentum.sum(axis=0)[0] == pytest.approx((fluid.mass * fluid.velocity[:, 0]).sum(), rel=1e-6)
    assert model.particles.grown > grown
    rates = model.flow_rates()
    assert rates["flow x_lower"] == pytest.approx(1.0, rel=0.03)
    assert rates["flow x_upper"] == pytest.approx(-1.0, rel=0.03)
    total = rates["through x_lower"] + rates["through x_upper"]
    assert total == pytest.approx(through(model))
    assert FLUID in model.particles.get("zone")


# cases -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes, path, words",
    [
        ({INLET: {}}, "x.lower.inlet", "either velocity or pressure"),
        ({INLET: {"velocity": [1]}}, "x.lower.inlet.velocity", "2"),
        ({INLET: {"velocity": ["1/y", 0]}}, None, None),
        ({OUTLET: {"velocity": [1, 0]}}, "x.upper.outlet.velocity", "not a known key"),
        ({"domain.boundary.x.upper": {"inlet": {"velocity": [-1, 0]}}}, "x.lower.inlet", "leaves the pressure free"),
        ({"domain.boundary.y": {"lower": {"outlet": {}}, "upper": "wall"}}, "y.lower.outlet", "one axis alone"),
        ({"domain.boundary.y": "open"}, "y.lower", "fly away"),
        ({"phases.oil": {"density": 1}}, "x.lower.inlet", "one phase"),
        ({"numerics.volume_constraint": True}, "volume_constraint", "inlets and outlets"),
    ],
)
def test_what_is_wrong_with_a_case_is_told(changes, path, words):
    """Key, rule and remedy."""
    case = scene(THROUGH)
    if path is None:
        case.replace(changes)
        return
    with pytest.raises(CaseError) as caught:
        case.replace(changes)
    assert any(path in problem.path and words in problem.rule for problem in caught.value.problems), caught.value


def test_fluid_has_to_fill_the_domain():
    """With room in it there would be a free surface, which buffers do not know."""
    half = {"box": {"lower": [0, 0], "upper": [1, 0.4]}}
    with pytest.raises(CaseError, match="has to fill it"):
        Model(scene(THROUGH, fluids=[{"phase": "water", "shape": half}]), device="cpu", threads=1)


def test_profile_without_a_value_is_told():
    """At a site of the side, with the formula."""
    inlet = {INLET: {"velocity": ["1/(y - 0.05)", 0]}}
    with pytest.raises(CaseError, match="no finite value"):
        Model(scene(THROUGH, **inlet), device="cpu", threads=1)


def test_sound_speed_knows_the_inlet():
    """Ten times the largest speed of profile and ramp, where the fluid starts at rest."""
    case = scene(THROUGH, **{INLET: {"velocity": ["3*y", 0], "ramp": "2*minimum(t, 1)"}}, start__velocity=[0, 0],
                 phases__water__sound_speed="auto")  # fmt: skip
    physics = Model(case, device="cpu", threads=1).physics
    assert physics.sound_speed[0] == pytest.approx(10 * 2 * 3 * 0.75)


def test_sound_speed_knows_the_narrowest_section():
    """A baffle leaves a quarter of a channel of 40 rows open: 4 times the speed of a uniform inlet, by continuity."""
    case = {
        "dimension": 2,
        "particle_spacing": 0.01,
        "end_time": 1,
        "domain": {"lower": [0, 0], "upper": [1, 0.4], "boundary": {"x": {"lower": {"inlet": {"velocity": [1, 0]}},
                                                                          "upper": {"outlet": {}}}, "y": "wall"}},
        "phases": {"water": {"density": 1000, "viscosity": 0.001}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "bodies": {"baffle": {"shape": {"box": {"lower": [0.5, 0.1], "upper": [0.6, 0.5]}}}},
    }  # fmt: skip
    for bodies, speed in ((case["bodies"], 4.0), ({}, 1.0)):
        physics = Model(Case.from_dict({**case, "bodies": bodies}), device="cpu", threads=1).physics
        assert physics.scales["velocity"] == pytest.approx(speed)
        assert physics.sound_speed[0] == pytest.approx(10 * speed)


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus", "isph"])
@pytest.mark.parametrize(("lower", "inlet", "fits"), [(0.1, {"velocity": [1, 0]}, True), (-0.1, {"velocity": [1, 0]}, False),
                                                      (-0.1, {"velocity": [0, 0]}, True), (-0.1, {"pressure": 3}, True)])
def test_an_inlet_into_a_dead_end_is_refused(scheme, lower, inlet, fits):
    """A body that closes a pipe leaves what comes in no way out; a pressure or no flow may be given there."""
    sides = {"lower": {"inlet": inlet}, "upper": {"outlet": {}}}
    case = {
        "dimension": 2,
        "particle_spacing": 0.02,
        "end_time": 1,
        "domain": {"lower": [0, 0], "upper": [1, 0.4], "boundary": {"x": sides, "y": "wall"}},
        "phases": {"water": {"density": 1000, "viscosity": 0.001, "sound_speed": 10}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "bodies": {"block": {"shape": {"box": {"lower": [0.5, lower], "upper": [0.6, 0.5]}}}},
        "numerics": {"scheme": scheme},
    }
    if fits:
        Model(Case.from_dict(case), device="cpu", threads=1)
    else:
        with pytest.raises(CaseError, match=r"x\.lower\.inlet\.velocity: .*1.*dead end.*leave a way"):
            Model(Case.from_dict(case), device="cpu", threads=1)


def test_a_ramp_that_is_not_finite_is_told_by_its_key():
    case = Case.load("cases/open_channel.yaml", ["domain.boundary.x.lower={inlet: {pressure: 1, ramp: 1/t}}"])
    with pytest.raises(CaseError, match=r"domain\.boundary\.x\.lower\.inlet\.ramp: 1/t .*finite"):
        Model(case)
