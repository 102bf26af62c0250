"""Delta-plus-SPH: its sums against exact fields, whole runs against exact flows, and what it refuses."""

import dataclasses
import math

import numpy as np
import pytest
import warp as wp

from tests.helpers import Bench, Fluid, lattice
from tests.scenes import PERIODIC
from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.engine.program import Stage
from warpsph.errors import CaseError
from warpsph.kernels.core.clock import TIME
from warpsph.kernels.core.eigenvalue import make_least_eigenvalue
from warpsph.kernels.core.spec import Spec, types
from warpsph.kernels.delta.delta_continuity import make_delta_continuity
from warpsph.running.divergence import runaway_particle
from warpsph.running.model import Model
from warpsph.schemes import delta_program as delta

SPACING = 0.1
WATER = Fluid(density=2.0, viscosity=0.3, sound_speed=10.0, gamma=7.0)
BASE = Spec(dimension=2, precision="float64", scheme="delta_plus", viscosity="radial")
DIFFUSIVE = dataclasses.replace(BASE, density_diffusion=True)
NUMBERS = {"density_diffusion": 0.1, "artificial_viscosity": 0.0, "shift_speed": 1.0, "shift_peak": 1.0, "closing": 0}


def bench_of(spec, counts=(14, 14), **options):
    """Return (bench, positions) of a disordered cloud in an open box, h = 2 dx."""
    x = lattice(counts, SPACING, 0.25, 1, centre=False)
    rng = np.random.default_rng(2)
    given = dict(
        spacing=SPACING, ratio=2.0, fluids=(WATER,), lower=0.0, upper=np.array(counts) * SPACING, width=120,
        volume=SPACING ** len(counts) * rng.uniform(0.8, 1.2, len(x)), values=NUMBERS, shift_cap=0.05, shifting=2.0,
    )  # fmt: skip
    return Bench(spec, x, **{**given, **options}), x


def stage(spec, name):
    return next(node for node in delta.step(spec) if getattr(node, "name", "") == name)


def rate_of(bench):
    """Return the rate of the density excess, of particles that stand where they are in the middle of the step."""
    bench.particles.put("midway", bench.particles.get("position"))
    bench.run(stage(bench.spec, "continuity"))
    return bench.get("density_rate")


def whole(bench, x):
    """Return which particles have all their neighbours."""
    return ((x > bench.support) & (x < bench.upper - bench.support)).all(axis=1)


def away_from_corners(bench, x, and_neighbours):
    """Return which particles are not the last of a row at a corner, nor see one of those."""
    corner = np.minimum(x, bench.upper - x).max(axis=1)
    return corner > (bench.support + SPACING if and_neighbours else SPACING)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_least_eigenvalue(dimension, precision):
    mat = types(dimension, precision).mat
    function = make_least_eigenvalue(dimension, precision)
    rng = np.random.default_rng(4)
    m = rng.normal(size=(50, dimension, dimension))
    m += m.transpose(0, 2, 1)
    m[0] = np.eye(dimension)
    m[1] = np.diag([2.0, 1.0, 1.0][:dimension])
    given = wp.array(m, dtype=mat)
    found = wp.zeros(len(m), dtype=types(dimension, precision).real)

    @wp.kernel(module="unique", enable_backward=False)
    def apply(given: wp.array(dtype=mat), found: wp.array(dtype=types(dimension, precision).real)):
        found[wp.tid()] = function(given[wp.tid()])

    wp.launch(apply, dim=len(m), inputs=[given, found])
    tolerance = 2e-6 if precision == "float32" else 1e-7  # the root of a multiple eigenvalue has half of the digits
    np.testing.assert_allclose(found.numpy(), np.linalg.eigvalsh(m)[:, 0], atol=10 * tolerance)


def test_diffusion_leaves_a_linear_pressure_alone_and_evens_out_a_peak():
    """On any arrangement, but for corners, where a moment may be too thin to invert; what one particle loses others get."""
    bench, x = bench_of(DIFFUSIVE)
    bench.put_state(pressure=3.0 + x @ [2.0, -5.0])
    bench.run(stage(bench.spec, "momentum"))
    sides = away_from_corners(bench, x, False)
    gradient = bench.get("pressure_gradient")[sides]
    np.testing.assert_allclose(gradient, np.broadcast_to([2.0, -5.0], gradient.shape), rtol=1e-9)
    far = away_from_corners(bench, x, True)
    np.testing.assert_allclose(rate_of(bench)[far], 0.0, atol=1e-12)
    peak = np.exp(-(((x - 0.7) / 0.15) ** 2).sum(axis=1))
    bench.put_state(pressure=peak)
    bench.run(stage(bench.spec, "momentum"))
    rate = rate_of(bench)
    top = np.argmax(peak)
    assert rate[top] < 0 and rate[top] == rate.min()
    volume = bench.get("state")[:, 1]
    assert abs(rate @ volume) < 1e-12 * np.abs(rate * volume).sum()


def test_diffusion_is_that_of_its_equation():
    """delta h c D(p)/(rho0 c^2), D from the sum over all pairs in NumPy."""
    bench, x = bench_of(DIFFUSIVE)
    p = np.cos(3 * x[:, 0]) * np.sin(4 * x[:, 1])
    bench.put_state(pressure=p)
    bench.run(stage(bench.spec, "momentum"))
    gradient, volume = bench.get("pressure_gradient"), bench.get("state")[:, 1]
    d = x[:, None] - x[None]
    q = np.linalg.norm(d, axis=-1) / bench.h
    slope = -10 * np.clip(2 - q, 0, None) ** 3 * 7 / (64 * math.pi) / bench.h**4  # W'/r
    psi = 2 * ((p[None] - p[:, None]) + 0.5 * np.einsum("ijk,ijk->ij", gradient[:, None] + gradient[None], d))
    exact = -0.1 * bench.h * 10.0 / (2.0 * 10.0**2) * (psi * slope * volume[None]).sum(axis=1)
    np.testing.assert_allclose(rate_of(bench), exact, rtol=1e-9, atol=1e-12)


def test_exact_divergence_of_a_linear_velocity():
    spec = dataclasses.replace(BASE, exact_divergence=True)
    gradient = np.array([[1.0, 2.0], [-3.0, 0.5]])
    x = lattice((14, 14), SPACING, 0.25, 1, centre=False)
    bench, x = bench_of(spec, velocity=x @ gradient.T)
    np.testing.assert_allclose(rate_of(bench)[away_from_corners(bench, x, False)], -1.5, rtol=1e-9)
    plain, _ = bench_of(BASE, velocity=x @ gradient.T)
    assert np.abs(rate_of(plain)[whole(plain, x)] + 1.5).max() > 0.01  # what it is good for


def test_pairs_conserve_momentum_and_angular_momentum_under_pressure():
    """All pressures above zero: the plus form. Below zero, the minus form leaves a uniform pressure alone."""
    spec = dataclasses.replace(BASE, tension_control="inside")
    rng = np.random.default_rng(5)
    bench, x = bench_of(spec, pressure=rng.uniform(0.5, 1.0, 196), velocity=rng.normal(size=(196, 2)))
    bench.run(stage(spec, "momentum"))
    force = bench.get("acceleration") * (2.0 * bench.get("rest_volume"))[:, None]
    size = np.linalg.norm(force, axis=1).sum()
    assert np.linalg.norm(force.sum(axis=0)) < 1e-12 * size
    assert abs((x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]).sum()) < 1e-12 * size
    bench.put("velocity", 0.0)
    bench.put_state(pressure=-1.0)
    bench.run(stage(spec, "momentum"))
    np.testing.assert_allclose(bench.get("acceleration"), 0.0, atol=1e-11)
    assert (bench.get("pressure_sign") == -1).all()


@pytest.mark.parametrize("tension", [-1.0, 1.0])
def test_tension_in_a_full_domain_does_not_pull_at_a_gap(tension):
    """A lattice that lacks two particles: beside the gap a uniform pressure below zero does nothing, elsewhere it pulls."""
    spec = dataclasses.replace(BASE, tension_control="gaps", periodic=(True, True))
    x = lattice((14, 14), SPACING, 0.0, 1, centre=False)
    lacking = np.linalg.norm(x - [0.65, 0.65], axis=1).argsort()[[0, 1]]
    assert np.linalg.norm(np.diff(x[lacking], axis=0)) == pytest.approx(SPACING)
    stay = np.delete(x, lacking, axis=0)
    bench = Bench(
        spec, stay, spacing=SPACING, ratio=2.0, fluids=(WATER,), lower=0.0, upper=1.4, width=120, volume=SPACING**2,
        values=NUMBERS,
    )  # fmt: skip
    bench.put_state(pressure=tension)
    bench.run(stage(spec, "momentum"))

    def slope(d):  # of the kernel over a distance, times it
        q = np.linalg.norm(d, axis=-1, keepdims=True) / bench.h
        return -10 * np.clip(2 - q, 0, None) ** 3 * 7 / (64 * math.pi) / bench.h**4 * d

    lost = np.linalg.norm(slope(stay[:, None] - x[lacking][None]).sum(axis=1), axis=-1)
    gap = lost > np.linalg.norm(slope(np.array([SPACING, 0.0])))
    assert gap.sum() == 14  # six beside them, the diagonal ones, and two rows above and below
    expected = np.where(gap & (tension < 0), -1, 1)
    np.testing.assert_array_equal(bench.get("pressure_sign"), expected)
    pulled = np.linalg.norm(bench.get("acceleration"), axis=1) > 1e-9
    np.testing.assert_array_equal(pulled, (lost > 1e-12) & (expected == 1))


def test_what_is_crowded_has_no_gap():
    """A lattice with two particles more in a cell: sums of gradients are as large as beside a gap, moments larger."""
    spec = dataclasses.replace(BASE, tension_control="gaps", periodic=(True, True))
    x = lattice((14, 14), SPACING, 0.0, 1, centre=False)
    more = np.array([[0.69, 0.7], [0.71, 0.7]])
    bench = Bench(
        spec, np.vstack([x, more]), spacing=SPACING, ratio=2.0, fluids=(WATER,), lower=0.0, upper=1.4, width=120,
        volume=SPACING**2, values=NUMBERS,
    )  # fmt: skip
    bench.put_state(pressure=-1.0)
    bench.run(stage(spec, "momentum"))
    assert (bench.get("pressure_sign") == 1).all()
    assert np.linalg.norm(bench.get("acceleration"), axis=1).max() > 1.0  # of a sum that is far from zero


@pytest.mark.parametrize("control", ["inside", "gaps"])
def test_tension_next_to_a_free_surface_pulls(control):
    """The minus form is for places that are whole: within a support of the surface pairs attract each other."""
    spec = dataclasses.replace(BASE, tension_control=control, free_surface=True)
    bench, x = bench_of(spec, counts=(20, 20), pressure=-1.0)
    bench.put("wholeness", 1.0)
    bench.run(stage(spec, "state"))
    bench.put_state(pressure=-1.0)
    bench.run(stage(spec, "momentum"))
    inside = whole(bench, x)
    assert bench.get("wholeness")[inside].min() > 0.75 and bench.get("wholeness")[~inside].min() < 0.4
    first = bench.get("pressure_sign")  # of the surface only the next sweep knows
    assert (first == -1).all() if control == "inside" else (first == -1).any()
    bench.run(stage(spec, "state"))
    bench.put_state(pressure=-1.0)
    bench.run(stage(spec, "momentum"))
    sign = bench.get("pressure_sign")
    rim = ((x < 0.5 * bench.support) | (x > bench.upper - 0.5 * bench.support)).any(axis=1)
    deep = ((x > 2 * bench.support) & (x < bench.upper - 2 * bench.support)).all(axis=1)
    assert (sign[rim] == 1).all()
    assert (sign[deep] == -1).all() == (control == "inside")


def test_shift_goes_into_gaps_and_not_through_a_surface():
    spec = dataclasses.replace(BASE, shifting=True, shift_form="consistent", free_surface=True, density_diffusion=True)
    x = lattice((20, 20), SPACING, 0.05, 1, centre=False)
    gap = np.argmin(((x - 1.0) ** 2).sum(axis=1))
    beside = np.argsort(((x - x[gap]) ** 2).sum(axis=1))[1:5]
    away = x[beside] - x[gap]
    x = np.delete(x, gap, axis=0)
    beside = beside - (beside > gap)
    bench = Bench(spec, x, spacing=SPACING, ratio=2.0, fluids=(WATER,), lower=0.0, upper=2.0, width=120, values=NUMBERS,
                  shift_cap=0.05, shifting=2.0)  # fmt: skip
    bench.put("wholeness", 1.0)
    bench.set_clock(SPEED=1.0, STEP=0.01)
    for _ in range(2):
        bench.run(stage(spec, "momentum"), stage(spec, "state"))
    shift = bench.get("shift")
    assert (np.einsum("ij,ij->i", shift[beside], away) < 0).all()
    assert np.linalg.norm(shift, axis=1).max() <= 0.005 * (1 + 1e-9)
    bottom = (x[:, 1] < 0.1) & (np.abs(x[:, 0] - 1) < 0.5)
    assert np.abs(shift[bottom, 1]).max() < 0.2 * np.abs(shift[beside]).max()


def test_what_a_shift_carries_is_that_of_the_new_place():
    """grad v dx of a linear velocity, for an even shift; whatever speed the frame has."""
    spec = dataclasses.replace(BASE, shifting=True, shift_form="consistent")
    gradient = np.array([[1.0, 2.0], [-3.0, -1.0]])
    x = lattice((14, 14), SPACING, 0.0, 1, centre=False)
    for frame in (0.0, 100.0):
        bench = Bench(spec, x, spacing=SPACING, ratio=2.0, fluids=(WATER,), lower=0.0, upper=1.4, width=120, values=NUMBERS,
                      velocity=x @ gradient.T + frame)  # fmt: skip
        bench.put("shift", [1e-3, 2e-3])
        rate_of(bench)
        inside = whole(bench, x)
        exact = np.broadcast_to(gradient @ [1e-3, 2e-3], (inside.sum(), 2))
        np.testing.assert_allclose(bench.get("carried")[inside], exact, rtol=2e-3)


WALLED = dataclasses.replace(BASE, shifting=True, shift_form="consistent", walls=True)


@pytest.mark.parametrize("options", [{}, {"flow_part": False}], ids=["leapfrog", "runge_kutta"])
def test_a_shift_carries_no_velocity_beside_a_wall(options):
    """None where a wall is within the support, that of the new place beyond, in both integrators; density everywhere."""
    gradient = np.array([[1.0, 2.0], [-3.0, -1.0]])
    x = lattice((18, 18), SPACING, 0.0, 1, centre=False)
    floor = lattice((18, 4), SPACING, 0.0, 1, centre=False) - [0.0, 4 * SPACING]
    bench = Bench(WALLED, x, walls=floor, spacing=SPACING, ratio=2.0, fluids=(WATER,), lower=0.0, upper=1.8, width=120,
                  values=NUMBERS, velocity=x @ gradient.T, excess=1e-3 * x[:, 0])  # fmt: skip
    bench.put("shift", [1e-3, 2e-3])
    bench.set_clock(STEP=0.01)
    bench.particles.put("midway", bench.particles.get("position")[: len(x)])
    bench.run(Stage("continuity", make_delta_continuity(WALLED, **options), "fluid", ""))
    carried = bench.get("carried")
    touches = x[:, 1] + 0.5 * SPACING < bench.support - 1e-9  # the first row of the wall is half a spacing below its surface
    assert (carried[touches] == 0).all()
    inside = whole(bench, x) & ~touches
    np.testing.assert_allclose(carried[inside], np.broadcast_to(gradient @ [1e-3, 2e-3], (inside.sum(), 2)), rtol=2e-3)
    assert np.abs(carried[~touches & (x[:, 1] < bench.support)]).min() > 0
    if options:  # the rate of the density is then what the shift carries alone
        between = (x[:, 0] > bench.support) & (x[:, 0] < bench.upper[0] - bench.support)
        assert bench.get("density_rate")[touches & between].min() > 0


# whole runs -------------------------------------------------------------------------------------------------


def vortices(n, **numerics):
    """Return a case of Taylor-Green vortices at Re = 100 that runs for 0.4 turns."""
    return Case.from_dict({
        **PERIODIC,
        "particle_spacing": 1 / n,
        "end_time": 0.4,
        "phases": {"water": {"density": 1.0, "viscosity": 0.01, "sound_speed": 10, "gamma": 1}},
        "start": {"velocity": ["-cos(2*pi*x)*sin(2*pi*y)", "sin(2*pi*x)*cos(2*pi*y)"],
                  "pressure": "-0.25*(cos(4*pi*x)+cos(4*pi*y))"},
        "numerics": {"scheme": "delta_plus", **numerics},
        "output": {"particles": "none", "checkpoint": "none"},
        "gauges": {"energy": {"type": "energy", "interval": 0.4}},
    })  # fmt: skip


def test_vortices_decay():
    """Speed within 2 % of exp(-8 pi^2 nu t), pressure level and momentum where they were."""
    run = Simulation(vortices(25), device="cpu", threads=1).run()
    energy = run.gauge("energy")["kinetic"]
    assert math.sqrt(energy[-1] / energy[0]) == pytest.approx(math.exp(-8 * math.pi**2 * 0.01 * 0.4), rel=0.02)
    state = run.state
    assert abs(np.average(state.pressure, weights=state.volume)) < 0.1  # a thousandth of rho c^2
    assert np.abs(np.average(state.velocity, axis=0, weights=state.volume)).max() < 2e-3


TANK = {
    "dimension": 2,
    "particle_spacing": 1 / 16,
    "end_time": 1.0,
    "domain": {"lower": [0, 0], "upper": [1, 1.25], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
    "gravity": [0, -1.0],
    "phases": {"water": {"density": 1000, "viscosity": 5.0}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 1]}}}],
    "start": {"pressure": "hydrostatic"},
    "numerics": {"scheme": "delta_plus"},
    "output": {"particles": "none", "checkpoint": "none"},
    "gauges": {"load": {"type": "wall_force", "interval": 0.5}},
}


def test_water_at_rest_stays_at_rest_and_weighs_on_the_floor():
    run = Simulation(Case.from_dict(TANK), device="cpu", threads=1).run()
    assert np.linalg.norm(run.state.velocity, axis=1).max() < 0.02
    assert run.gauge("load")["force_y domain"][-1] == pytest.approx(-1000.0, rel=0.02)
    water = run.state.fluid
    depth = 1 - water.position[:, 1]
    assert np.abs(water.pressure - 1000 * depth).max() < 0.04 * 1000


@pytest.mark.parametrize("excess", [-0.95, 3.0, math.nan])
def test_a_density_that_ran_away_is_named(excess):
    model = Model(Case.from_dict(TANK), threads=1)
    values = np.zeros(model.particles.fluid_count)
    values[3] = excess
    model.particles.put("density_excess", values)
    identity, _, quantity, value, _ = runaway_particle(model, 3)
    assert identity == 3 and quantity == "density" and f"rho/rho0 - 1 = {excess:.3g}" in value


def test_a_restart_goes_on_bit_by_bit(tmp_path):
    """A free surface, walls, shift and diffusion; cut in the middle of the life of a list."""
    case = Case.from_dict({**TANK, "end_time": 0.1, "start": {}, "output": {"checkpoint": {"interval": 0.05}}})
    whole_run = Simulation(case, output=tmp_path / "whole", device="cpu", threads=1).run()
    point = sorted((tmp_path / "whole" / "checkpoint").glob("*.h5"))[0]
    rest = Simulation(case, output=tmp_path / "rest", device="cpu", threads=1, restart=point).run()
    for name in ("position", "velocity", "pressure"):
        np.testing.assert_array_equal(getattr(rest.state, name), getattr(whole_run.state, name))


def test_three_dimensions():
    """A periodic box of vortices runs a few steps without losing momentum or energy."""
    sides = {axis: "periodic" for axis in "xyz"}
    model = Model(Case.from_dict({
        "dimension": 3, "particle_spacing": 1 / 12, "end_time": 1,
        "domain": {"lower": [0, 0, 0], "upper": [1, 1, 1], "boundary": sides},
        "phases": {"water": {"density": 1.0, "viscosity": 0.01}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "start": {"velocity": ["sin(2*pi*x)*cos(2*pi*y)*cos(2*pi*z)", "-cos(2*pi*x)*sin(2*pi*y)*cos(2*pi*z)", "0"]},
        "numerics": {"scheme": "delta_plus"},
    }), threads=1)  # fmt: skip
    model.stepper.prepare(True)
    before = np.array(model.snapshot().fluid.velocity, dtype=float)
    model.stepper.run(1.0, 20)
    after = np.array(model.snapshot().fluid.velocity, dtype=float)
    assert np.abs(after.mean(axis=0)).max() < 1e-3
    decayed = math.exp(-24 * math.pi**2 * 0.01 * float(model.stepper.read()[0][TIME]))
    assert (after**2).sum() / (before**2).sum() == pytest.approx(decayed, rel=0.08)  # with 12 spacings a wave


@pytest.mark.parametrize(
    "changes, told",
    [
        ({"phases": {"water": {"density": 1000}, "oil": {"density": 900}}}, "takes one phase"),
        ({"numerics": {"scheme": "delta_plus", "star_states": "weighted"}}, "scheme: riemann"),
        ({"numerics": {"scheme": "delta_plus", "pressure_gradient": "corrected"}}, "conservative"),
    ],
)
def test_what_the_scheme_cannot_do_is_refused(changes, told):
    with pytest.raises(CaseError, match=told):
        Case.from_dict({**TANK, **changes})


@pytest.mark.parametrize("body", [False, True])
def test_a_particle_beside_a_wall_is_stopped(body):
    """One that flies at a floor, or a body, loses 40 % of its speed in a time dx/c when it touches, and never turns."""
    spec = dataclasses.replace(BASE, viscosity="none", walls=True, free_surface=True, bodies=body)
    floor = lattice((9, 4), SPACING, 0.0, 1, centre=False) - [0.0, 0.4]
    given = dict(spacing=SPACING, ratio=2.0, fluids=(WATER,), width=120, walls=floor, values=NUMBERS)
    for gap, stopped in ((0.01, True), (0.5, False)):
        bench = Bench(spec, np.array([[0.45, gap * SPACING]]), velocity=[[0.0, -1.0]], **given)
        if body:
            bench.put("wall_depth", -floor[:, 1])
            bench.put("wall_normal", [0.0, 1.0])
        bench.set_clock(STEP=0.01)
        bench.run(stage(spec, "momentum"))
        speed = -1.0 + 0.01 * bench.get("acceleration")[0, 1]
        assert (-0.6 < speed <= 0.0) if stopped else speed == -1.0
