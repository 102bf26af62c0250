"""Viscosity in stages: its polynomial, its operator, walls, momentum, what is steady, and when it is chosen."""

import math

import numpy as np
import pytest

from tests.helpers import Bench, Fluid, lattice
from tests.scenes import PERIODIC, case_of
from warpsph import Simulation
from warpsph.errors import CaseError
from warpsph.kernels.core.spec import Spec
from warpsph.scene.geometry import build
from warpsph.scene.physics import VISCOUS_LIMIT, derive, support_radius
from warpsph.schemes import viscous_steps
from warpsph.schemes.viscous_steps import LEAST, MOST, reach, viscous_stages, weights, worth

SPACING = 0.1
FLUIDS = (Fluid(density=2.0, viscosity=0.3), Fluid(density=0.5, viscosity=4.0))
COUNTS = {2: (9, 9), 3: (6, 6, 6)}
COUETTE = {
    "dimension": 2,
    "particle_spacing": 1 / 16,
    "end_time": 4.0,
    "domain": {
        "lower": [0, 0],
        "upper": [0.5, 1],
        "boundary": {"x": "periodic", "y": {"lower": "wall", "upper": {"wall": "no_slip", "velocity": [0.02, 0]}}},
    },
    "phases": {"thick": {"density": 1, "viscosity": 1}, "thin": {"density": 1, "viscosity": 0.05}},
    "fluids": [
        {"phase": "thick", "shape": {"box": {"lower": [0, 0], "upper": [0.5, 0.5]}}},
        {"phase": "thin", "shape": "rest"},
    ],
    "output": {"particles": "none", "checkpoint": "none"},
}


def solved(stages, apply, push):
    """Return y of the last stage for the rate push - apply(y)."""
    table = weights(stages)
    before, now = 0.0 * push, table[0].step * push
    for row in table[1:]:
        before, now = now, row.now * now + row.before * before + row.step * (push - apply(now))
    return now


def bench(spec, dimension=2, **options):
    """Return a disordered periodic cloud of two phases."""
    counts = COUNTS[dimension]
    x = np.mod(lattice(counts, SPACING, 0.2, centre=False), SPACING * np.array(counts))
    rng = np.random.default_rng(5)
    volume = SPACING**dimension * rng.uniform(0.9, 1.1, len(x))
    phase = (x[:, 0] > 0.5 * counts[0] * SPACING).astype(int)
    options = {"lower": 0.0, "upper": SPACING * np.array(counts), "volume": volume, "phase": phase, **options}
    made = Bench(spec, x, spacing=SPACING, ratio=1.25, skin=0.05, fluids=FLUIDS, **options)
    return made, volume * np.array([fluid.density for fluid in FLUIDS])[phase]


def spec_of(dimension=2, stages=4, form="radial", precision="float64", **changes):
    return Spec(
        dimension=dimension, precision=precision, multiphase=True, viscosity=form, viscous_stages=stages, paper_star=True,
        dissipation=False, **{"periodic": (True,) * dimension, **changes},
    )  # fmt: skip


def friction(made, velocity):
    """Return A v of the momentum sweep, from the difference that the velocity makes."""
    result = []
    for sign in (0.0, 1.0):
        made.put("velocity", sign * velocity)
        result.append(made.acceleration())
    return result[0] - result[1]


def staged(made, push, tau):
    """Run the stages on an acceleration; return what they leave there."""
    made.put("acceleration", push)
    made.set_clock(STEP_CAP=tau, COURANT=math.inf)
    for stage in viscous_stages(made.spec):
        special = {**stage.values, **{name: made.particles.arrays[field] for name, field in stage.fields.items()}}
        count = made.particles.fluid_count
        made.launcher.task(stage.name, stage.kernel, count, made.bindings, special=special).run()
    return made.get("acceleration")


# -- the polynomial ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("stages", [3, 4, 7, 16, 50])
def test_amplification_is_a_damped_chebyshev_polynomial(stages):
    """1 - z phi(z) = T(w0 - w1 z)/T(w0), with the slope -1 at 0 and below 1/cosh(sqrt 2) up to the limit."""
    limit = 2.0 * reach(stages)
    z = np.linspace(0.0, limit, 2001)
    at = 1.0 + 1.0 / stages**2
    chebyshev = np.polynomial.Chebyshev.basis(stages)
    slope = chebyshev(at) / chebyshev.deriv()(at)
    factor = 1.0 - z * solved(stages, lambda y: z * y, np.ones_like(z))
    assert factor == pytest.approx(chebyshev(at - slope * z) / chebyshev(at), abs=1e-9)
    assert (at - slope * limit) == pytest.approx(-1.0)
    stiff = z > (at - 1.0) / slope
    assert np.abs(factor[stiff]).max() < 1.02 / math.cosh(math.sqrt(2.0))
    assert np.abs(factor[1:]).max() < 1.0
    assert abs(1.0 - 1.05 * (limit) * solved(stages, lambda y: 1.05 * limit * y, 1.0)) > np.abs(factor[-1])


def test_a_smooth_flow_has_its_own_inertia():
    assert [solved(stages, lambda y: 0.0 * y, 1.0) for stages in (3, 5, 16)] == pytest.approx([1.0, 1.0, 1.0])


def test_reach_grows_with_the_square():
    assert reach(1) == 1.0
    assert [reach(stages) / stages**2 for stages in (8, 16, 50)] == pytest.approx([0.629] * 3, abs=2e-3)


def test_as_many_stages_as_are_fastest():
    assert worth(0.5) == worth(1.0) == worth(1.2) == 1
    assert worth(math.inf) == MOST
    found = [worth(ratio) for ratio in (2.0, 4.0, 8.0, 20.0, 60.0, 150.0)]
    assert found == sorted(found) and found[0] >= LEAST
    for ratio, stages in zip((4.0, 8.0, 20.0, 60.0), found[1:5], strict=True):
        assert 0.5 * ratio <= reach(stages) <= 2.0 * ratio


# -- the kernels -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("form", "dimension", "stages"),
    [("radial", 2, 3), ("radial", 2, 6), ("morris", 2, 4), ("radial", 3, 5), ("isotropic", 2, 4)],
)
def test_stages_are_the_polynomial_of_the_friction_of_the_sweep(form, dimension, stages, device):
    made, mass = bench(spec_of(dimension, stages, form), dimension, device=device)
    push = np.random.default_rng(1).normal(size=(len(mass), dimension))
    tau = 0.06 * reach(stages) * made.h**2 / (max(f.viscosity for f in FLUIDS) / min(f.density for f in FLUIDS))
    expected = solved(stages, lambda y: tau * friction(made, y), push)
    found = staged(made, push, tau)
    assert np.abs(expected - push).max() > 0.3
    assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("stages", [3, 16])
def test_no_mode_grows_where_the_sweep_corrects_for_disorder(stages):
    """The friction of the sweep is not that of the stages then; a step is stable at their full reach, not at thrice it."""
    count = 8
    x = np.mod(lattice((count, count), SPACING, 0.2, centre=False), SPACING * count)
    operators = []
    for changes in ({}, {"corrected": True, "shifting": True}):
        alike = {"dimension": 2, "precision": "float64", "periodic": (True, True), "viscosity": "radial"}
        spec = Spec(**alike, **changes)
        options = {"spacing": SPACING, "skin": 0.02, "lower": 0.0, "upper": SPACING * count}
        made = Bench(spec, x, fluids=(Fluid(density=1.0, viscosity=1.0),), **options)
        units = np.eye(x.size).reshape(x.size, *x.shape)
        operators.append(np.stack([friction(made, unit).ravel() for unit in units], axis=1))
    plain, corrected = operators
    assert np.abs(plain - corrected).max() > 0.05 * np.abs(plain).max()
    growth = []
    for times in (1.0, 3.0):
        tau = times * reach(stages) * VISCOUS_LIMIT["radial"] * made.h**2
        phi = solved(stages, lambda y, tau=tau: tau * plain @ y, np.eye(x.size))
        growth.append(np.abs(np.linalg.eigvals(np.eye(x.size) - tau * phi @ corrected)).max())
    assert growth[0] == pytest.approx(1.0, abs=1e-9) and growth[1] > 1.5


def test_stages_conserve_both_momenta():
    made, mass = bench(spec_of(stages=6, periodic=(False, False)))
    x = made.get("position")
    push = np.random.default_rng(1).normal(size=x.shape)
    found = staged(made, push, 2e-4)
    assert mass @ found == pytest.approx(mass @ push, abs=1e-10)
    spin = [mass @ (x[:, 0] * a[:, 1] - x[:, 1] * a[:, 0]) for a in (push, found)]
    assert spin[1] == pytest.approx(spin[0], abs=1e-10)
    assert np.abs(found - push).max() > 0.1


def test_the_largest_acceleration_is_that_of_the_last_stage():
    made, _ = bench(spec_of(stages=4))
    push = np.random.default_rng(1).normal(size=made.get("acceleration").shape)
    found = staged(made, push, 2e-3)
    largest = made.bindings["maxima"].numpy()[1]
    assert largest == pytest.approx((found**2).sum(axis=1).max()) and largest < 0.99 * (push**2).sum(axis=1).max()


@pytest.mark.parametrize("slip", [0, 1])
def test_a_wall_mirrors_what_the_particle_has(slip):
    """One particle before a row of walls: friction is that of a neighbour with -ratio times its own."""
    spec = Spec(dimension=2, precision="float64", viscosity="morris", walls=True, wall_no_slip=True, viscous_stages=3)
    walls = np.column_stack([SPACING * np.arange(-2, 3), np.full(5, -SPACING)])
    made = Bench(spec, np.zeros((1, 2)), spacing=SPACING, walls=walls, slip=slip, fluids=(FLUIDS[0],))
    made.put("mirror_ratio", 0.5)
    tau, push = 9e-3, np.array([[1.0, 0.5]])
    r = np.hypot(*walls.T)
    q = r / made.h
    slope = np.where(q < 2.0, 7.0 / (64 * math.pi * made.h**4) * 10.0 * (2.0 - np.minimum(q, 2.0)) ** 3, 0.0)  # -W'/r
    rate = tau * 2.0 * FLUIDS[0].viscosity / FLUIDS[0].density * 1.5 * slope.sum() * SPACING**2 * (1 - slip)
    assert staged(made, push, tau) == pytest.approx(solved(3, lambda y: rate * y, push), rel=1e-10)
    assert slip or rate > 0.1


# -- whole runs --------------------------------------------------------------------------------------------


def test_layers_in_steady_shear_with_twenty_times_the_step(device):
    """The stress of both layers is exact to what explicit friction has, whatever the step."""
    simulation = Simulation(case_of(COUETTE, numerics__viscous_stages=6), device=device).run()
    state, physics = simulation.state, simulation.physics
    stress = 0.02 / (0.5 / 1 + 0.5 / 0.05)
    y = state.position[:, 1]
    exact = np.where(y < 0.5, stress * y, 0.02 - stress * (1 - y) / 0.05)
    fluid = state.kind == 0
    assert np.abs(state.velocity[fluid, 0] - exact[fluid]).max() < 0.02 * 0.02
    explicit = derive_of(1)
    assert physics.step_cap["viscosity"] == pytest.approx(reach(6) * explicit.step_cap["viscosity"])
    assert physics.estimated_step() > 20 * explicit.estimated_step()


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_a_shear_wave_decays_as_with_explicit_friction(precision):
    """exp(-nu k^2 t): the difference between 1, 4 and 8 stages falls with the step, and none is unstable."""
    changes = {
        "phases__water__viscosity": 1.0, "start": {"noise": 0.1, "velocity": ["sin(2*pi*y)", "0"]},
        "end_time": 0.02, "gauges": {}, "output": COUETTE["output"], "precision": precision,
        "phases__water__sound_speed": 10.0, "numerics__maximum_step": 0.002,
    }  # fmt: skip
    left = {}
    for stages in (1, 4, 8):
        simulation = Simulation(case_of(PERIODIC, numerics__viscous_stages=stages, **changes), device="cpu")
        simulation.run()
        state = simulation.state
        left[stages] = 2.0 * np.mean(state.velocity[:, 0] * np.sin(2 * math.pi * state.position[:, 1]))
    exact = math.exp(-4 * math.pi**2 * 0.02)
    assert left[1] == pytest.approx(exact, rel=0.03)
    assert left[4] == pytest.approx(left[1], rel=0.02)
    assert left[8] == pytest.approx(left[1], rel=0.05)


def derive_of(stages, **changes):
    case = case_of(COUETTE, numerics__viscous_stages=stages, **changes)
    return derive(case, build(case, support_radius(case)))


def test_auto_takes_what_other_limits_leave():
    found = derive_of("auto", particle_spacing=1 / 64)
    assert found.spec.viscous_stages == found.choices["viscous_stages"] > 2
    assert "explicit friction allows steps of" in found.reasons["viscous_stages"]
    assert derive_of("auto", particle_spacing=1 / 64, numerics__maximum_step=1e-5).spec.viscous_stages == 1
    thin = {"phases": {name: {"density": 1} for name in ("thick", "thin")}}
    assert derive_of("auto", particle_spacing=1 / 64, **thin).spec.viscous_stages == 1
    assert derive_of(5, **thin).spec.viscous_stages == 1
    assert case_of(COUETTE).numerics.viscous_stages == 1


def test_a_body_with_a_surface_has_no_stages():
    body = {"bodies": {"ball": {"shape": {"sphere": {"center": [0.25, 0.75], "radius": 0.1}}}}}
    one = {"phases": {"thick": {"density": 1, "viscosity": 1}}, "fluids": [{"phase": "thick", "shape": "rest"}]}
    assert derive_of("auto", **body, **one).spec.viscous_stages == 1
    with pytest.raises(CaseError, match=r"numerics.viscous_stages.*others answer friction with a fit"):
        derive_of(4, **body, **one)


def test_two_stages_and_inlets_are_refused():
    with pytest.raises(CaseError, match=r"numerics.viscous_stages.*needs 1, or 3 and more"):
        case_of(COUETTE, numerics__viscous_stages=2)
    sides = {"lower": {"inlet": {"velocity": [1, 0]}}, "upper": {"outlet": {}}}
    one = {"phases": {"thick": {"density": 1, "viscosity": 1}}, "fluids": [{"phase": "thick", "shape": "rest"}]}
    boundary = {"domain": {**COUETTE["domain"], "boundary": {"x": sides, "y": "wall"}}}
    with pytest.raises(CaseError, match=r"numerics.viscous_stages.*knows no inlets and outlets"):
        case_of(COUETTE, numerics__viscous_stages=4, **one, **boundary)


def test_stages_are_shown():
    from warpsph.schemes import riemann_program

    spec = spec_of(stages=5)
    names = [stage.name for stage in riemann_program.program(spec).stages() if stage.name == "viscous_stage"]
    assert len(names) == 2 * 4  # of a step and of the start
    assert viscous_steps.viscous_stages(spec_of(stages=1)) == []


def test_auto_follows_a_channel_that_starts():
    """The step stays at 0.002 L^2/nu where sound would allow more, and stages are no more than that needs."""
    channel = {
        "phases": {"thick": {"density": 1, "viscosity": 1, "sound_speed": 0.3}},
        "fluids": [{"phase": "thick", "shape": "rest"}], "particle_spacing": 1 / 64, "body_force": [0.02, 0.0],
    }  # fmt: skip
    found = derive_of("auto", **channel)
    explicit = derive_of(1, **channel).estimated_step()
    assert 5 * explicit < found.estimated_step() == pytest.approx(0.002 * 0.5**2)
    assert reach(found.spec.viscous_stages - 1) * explicit < 0.002 * 0.5**2 <= found.step_cap["viscosity"]
    assert "change by friction" not in derive_of(8, **channel).step_cap
