"""Flow on each side of an interface: velocity gradients, continuity with them, facing directions, impact pressure."""

import dataclasses

import numpy as np
import pytest

from tests.helpers import Bench, Fluid, lattice
from warpsph.kernels.core.pair import NEAR
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.riemann.riemann_fields import RIEMANN_FIELDS
from warpsph.schemes import riemann_program as riemann

FLAT = Spec(dimension=2, precision="float64", multiphase=True)
SOLID = Spec(dimension=3, precision="float64", periodic=(False,) * 3, multiphase=True)
CORRECTED = dataclasses.replace(FLAT, corrected=True)
SPACING = 0.1
COUNTS = {2: (16, 16), 3: (12, 12, 12)}
STRAIN = {2: np.array([[1.0, 0.0], [0.0, -1.0]]), 3: np.diag([1.0, -2.0, 1.0])}
SHEAR = {2: np.array([[0.0, 1.0], [1.0, 0.0]]), 3: np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.5], [0.0, 0.5, 0.0]])}
TURN = {2: np.array([[0.0, -1.0], [1.0, 0.0]]), 3: np.array([[0.0, -1.0, 0.3], [1.0, 0.0, 0.5], [-0.3, -0.5, 0.0]])}
FIELDS = {"velocity_gradient", "facing"}


def fluids_of(ratio):
    return (Fluid(density=1.0, sound_speed=14.0, gamma=1.4), Fluid(density=ratio))


def flat(spec, jitter=0.0, flow=None, ratio=1000.0, **options):
    """Return (bench, positions about the middle of the interface) of phase 0 below phase 1, after the stage has run.

    The interface is between two rows, across the last axis; `flow` is grad v of a linear velocity field.
    """
    x = lattice(COUNTS[spec.dimension], SPACING, jitter)
    velocity = 0.0 if flow is None else x @ flow.T
    given = dict(phase=(x[:, -1] > 0).astype(int), fluids=fluids_of(ratio), velocity=velocity, spacing=SPACING)
    bench = Bench(spec, x, **{**given, **options})
    bench.prepare()
    return bench, x


def near(bench):
    """Return which fluid particles have one of another phase in their list."""
    return (bench.get("flags")[: bench.particles.fluid_count].astype(int) & NEAR) != 0


def middle(bench, x, reach=1.0):
    """Return which particles are farther than `reach` supports from the sides of the cloud."""
    return (np.abs(x) < np.abs(x).max(axis=0) - reach * bench.support).all(axis=1)


# velocity gradient ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_gradient_of_a_linear_velocity_is_exact(spec, device):
    """On a disordered cloud, from the own phase alone: each side has a flow of its own."""
    d = spec.dimension
    rng = np.random.default_rng(3)
    flows = rng.normal(size=(2, d, d))
    bench, x = flat(spec, 0.3, device=device, width=160 if d == 2 else 260)
    phase = bench.get("phase").astype(int)
    bench.put("velocity", np.einsum("nab,nb->na", flows[phase], x) + rng.normal(size=(2, d))[phase])
    bench.prepare()
    chosen = near(bench) & middle(bench, x, 0.5)
    assert chosen.sum() > 40
    np.testing.assert_allclose(bench.get("velocity_gradient")[chosen], flows[phase[chosen]], atol=1e-10)


def test_gradient_takes_in_walls_that_hold_the_fluid(device):
    """A no-slip wall continues the flow of either phase; a free-slip wall says nothing about it."""
    every = lattice(COUNTS[2], SPACING, 0.2)
    solid = every[:, 0] > 0.45
    x, walls = every[~solid], every[solid]
    spec = dataclasses.replace(FLAT, walls=True, wall_no_slip=True, viscosity="morris")
    flow = np.array([[0.5, 2.0], [-4.0, -0.5]])
    options = dict(phase=(x[:, 1] > 0).astype(int), walls=walls, spacing=SPACING, device=device)
    found = []
    for slip, mirror in (0, walls @ flow.T), (0, 0.0), (1, walls @ flow.T), (1, 0.0):
        bench = Bench(spec, x, fluids=fluids_of(1000.0), velocity=x @ flow.T, slip=slip, **options)
        bench.put("mirror_velocity", mirror)
        bench.run(*riemann.sides(bench.spec))
        beside = near(bench) & (x[:, 0] > 0.25) & (np.abs(x[:, 1]) < 0.3)
        assert beside.sum() > 8
        found.append(bench.get("velocity_gradient")[beside] - flow)
    held, still, free, also_free = (np.abs(error).max() for error in found)
    assert max(held, free, also_free) < 1e-10 and still > 1.0


@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_a_few_particles_have_no_gradient(spec, device):
    """A bent row of a few moves as one: what a gradient from so thin a neighbourhood would be is left out."""
    d = spec.dimension
    x = lattice(COUNTS[d], SPACING)
    centre = x[np.argmin(np.linalg.norm(x - 0.5 * SPACING, axis=1))]
    few = (np.abs(x[:, 0] - centre[0]) < 1.1 * SPACING) & (np.abs(x - centre)[:, 1:] < 0.01).all(axis=1)
    assert few.sum() == 3
    if d == 3:  # a fourth, or they would lie in a plane
        few |= (np.abs(x - centre - [2 * SPACING, 0.0, 0.0]) < 0.01).all(axis=1)
    x[few] += 0.2 * SPACING * np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, -1]])[: few.sum(), :d]
    velocity = np.random.default_rng(1).normal(size=x.shape)
    options = dict(fluids=fluids_of(1000.0), velocity=velocity, spacing=SPACING, device=device)
    bench = Bench(spec, x, phase=(~few).astype(int), **options)
    bench.put("velocity_gradient", 7.0)
    bench.prepare()
    gradient = np.abs(bench.get("velocity_gradient")).max(axis=(1, 2))
    assert (gradient[few] == 0).all()
    assert gradient[~few & near(bench)].min() > 0


@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_the_gradient_fades_with_the_neighbourhood(spec, device):
    """The corner of a drop of two particles a side has a part of the gradient, the middle of one of three all of it."""
    d = spec.dimension
    x = lattice(COUNTS[d], SPACING)
    flow = STRAIN[d] + SHEAR[d] + TURN[d]
    corner = np.argmin(np.linalg.norm(x - 0.5 * SPACING, axis=1))
    place = np.rint((x - x[corner]) / SPACING)
    options = dict(fluids=fluids_of(1000.0), velocity=x @ flow.T, spacing=SPACING, device=device)
    shares = []
    for least in (0, -1):
        own = ((place >= least) & (place <= 1)).all(axis=1)
        bench = Bench(spec, x, phase=(~own).astype(int), **options)
        bench.prepare()
        gradient = bench.get("velocity_gradient")[corner]
        shares.append(gradient[0, 0] / flow[0, 0])
        np.testing.assert_allclose(gradient, shares[-1] * flow, atol=1e-12)
    assert 0 < shares[0] < 0.5 and shares[1] == pytest.approx(1.0, abs=1e-12)


# continuity -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [1.0, 1000.0])
@pytest.mark.parametrize("flow", [STRAIN, SHEAR, TURN], ids=["strain", "shear", "rotation"])
@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_flow_without_divergence_compresses_nothing(spec, flow, ratio, device):
    """At a flat interface, on a lattice."""
    bench, x = flat(spec, flow=flow[spec.dimension], ratio=ratio, device=device)
    inside = middle(bench, x) & near(bench)
    for side in (0, 1):
        chosen = inside & (bench.get("phase") == side)
        assert chosen.sum() > 10
        assert np.abs(bench.density_rate()[chosen]).max() < 1e-11


@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_constant_states_would_compress_the_rows(spec, device):
    """What the gradients are for: the states of the particles themselves, 1000:1, give tens of per cent of the strain."""
    bench, x = flat(spec, flow=STRAIN[spec.dimension], device=device)
    inside = middle(bench, x) & near(bench)
    carried = bench.density_rate()
    bench.put("velocity_gradient", 0.0)
    constant = bench.density_rate()
    for side in (0, 1):
        chosen = inside & (bench.get("phase") == side)
        assert np.abs(constant[chosen]).max() > 0.2
        assert np.abs(carried[chosen]).max() < 0.05 * np.abs(constant[chosen]).max()


@pytest.mark.parametrize("shape", ["diagonal", "disc"])
def test_no_compression_at_other_interfaces(shape, device):
    x = lattice(COUNTS[2], SPACING)
    phase = {"diagonal": x.sum(axis=1) > 0.01, "disc": np.linalg.norm(x, axis=1) > 0.33}[shape].astype(int)
    for flow in (STRAIN, SHEAR, TURN):
        bench, _ = flat(FLAT, flow=flow[2], phase=phase, device=device)
        inside = middle(bench, x) & near(bench)
        assert inside.sum() > 20
        assert np.abs(bench.density_rate()[inside]).max() < 1e-11


@pytest.mark.parametrize("ratio", [1.0, 1000.0])
@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_a_dilation_is_seen_in_full(spec, ratio, device):
    """The other way round: both sides of the interface expand at the rate of a single phase."""
    d = spec.dimension
    bench, x = flat(spec, flow=0.5 * np.eye(d), ratio=ratio, device=device)
    single, _ = flat(spec, flow=0.5 * np.eye(d), ratio=ratio, phase=0, device=device)
    inside = middle(bench, x)
    assert (inside & near(bench)).any()
    rate = bench.density_rate()[inside]
    np.testing.assert_allclose(rate, single.density_rate()[inside], atol=1e-11)
    np.testing.assert_allclose(rate, -0.5 * d, rtol=0.01)


@pytest.mark.parametrize("spec", [FLAT, SOLID, CORRECTED])
def test_uniform_translation_is_no_flow(spec, device):
    """Zero to the last bit, on any cloud."""
    bench, _ = flat(spec, 0.3, velocity=np.array([3.0, -2.0, 5.0])[: spec.dimension], device=device, width=260)
    assert (bench.get("velocity_gradient") == 0).all()
    assert np.abs(bench.density_rate()).max() < 1e-13 * 5.0 / SPACING
    assert (bench.acceleration() == 0).all()


def test_rates_read_no_side_of_bulk_particles(device):
    """Where no other phase is near, nothing is computed, and what stands there does not matter."""
    bench, x = flat(FLAT, 0.2, flow=SHEAR[2], device=device)
    kept = {name: bench.get(name) for name in FIELDS}
    rate, a = bench.density_rate(), bench.acceleration()
    for name in FIELDS:
        bench.put(name, np.nan)
    bench.run(*riemann.sides(bench.spec))
    assert 0.2 < near(bench).mean() < 0.8
    for name in FIELDS:
        np.testing.assert_array_equal(bench.get(name)[near(bench)], kept[name][near(bench)])
        assert np.isnan(bench.get(name)[~near(bench)]).all()
    np.testing.assert_array_equal(bench.density_rate(), rate)
    np.testing.assert_array_equal(bench.acceleration(), a)


# pressure across an interface ---------------------------------------------------------------------------------

GRAVITY = 9.0


def weighed(spec, jitter, ratio, device, exact):
    """Return (accelerations, density rates) in the middle of two layers whose pressures bear their weight.

    exact: with the depths below the plane of the interface instead of those that the stage finds.
    """
    d = spec.dimension
    spec = dataclasses.replace(spec, corrected=True, gravity=True, dissipation=True)
    down = -GRAVITY * np.eye(d)[-1]
    bench, x = flat(spec, jitter, ratio=ratio, device=device, gravity=down, width=160 if d == 2 else 260)
    bench.put_state(pressure=np.where(x[:, -1] > 0, ratio, 1.0) * (x @ down))
    if exact:
        bench.put("interface_depth", np.abs(x[:, -1]) / bench.h)
    chosen = near(bench) & middle(bench, x)
    assert chosen.sum() > 40
    return bench.acceleration()[chosen], bench.density_rate()[chosen]


@pytest.mark.parametrize("ratio", [3.0, 1000.0])
@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_layers_that_bear_their_weight_stay_at_rest(spec, ratio, device):
    """A pressure with a kink: on any arrangement where depths are exact, on rows to what depths are off by.

    With the interface in the middle of every pair rows have 0.04 to 0.08 g, disordered particles up to 0.2.
    """
    a, rate = weighed(spec, 0.2, ratio, device, exact=True)
    np.testing.assert_allclose(a, 0.0, atol=1e-5 * GRAVITY)
    np.testing.assert_allclose(rate, 0.0, atol=1e-5)
    a, _ = weighed(spec, 0.0, ratio, device, exact=False)
    assert np.abs(a).max() < 0.05 * GRAVITY


# facing directions ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_facing_points_to_the_other_phase(spec, device):
    """A unit vector: across the interface on a lattice, about so on a disordered cloud."""
    normal = np.eye(spec.dimension)[-1]
    for jitter, least in ((0.0, 1 - 1e-12), (0.2, 0.6)):
        bench, x = flat(spec, jitter, device=device, width=260)
        facing = bench.get("facing")
        first_rows = middle(bench, x) & (np.abs(x[:, -1]) < (1.6 if jitter == 0 else 0.8) * SPACING)
        assert first_rows.sum() > 8
        np.testing.assert_allclose(np.linalg.norm(facing[first_rows], axis=1), 1.0, rtol=1e-12)
        assert (-np.sign(x[:, -1]) * (facing @ normal))[first_rows].min() >= least


@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_what_is_alone_faces_nowhere(spec, device):
    """A single particle, and a film of one row, see the other phase on all sides; those around them look at them."""
    d = spec.dimension
    x = lattice(COUNTS[d], SPACING)
    centre = x[np.argmin(np.linalg.norm(x - 0.5 * SPACING, axis=1))]
    for few in (np.linalg.norm(x - centre, axis=1) < 0.01, np.abs(x[:, -1] - centre[-1]) < 0.01):
        bench, _ = flat(spec, phase=(~few).astype(int), device=device)
        facing, inside = bench.get("facing"), middle(bench, x)
        assert (few & inside).any()
        assert (facing[few & inside] == 0).all()
        step = x - centre
        beside = ~few & inside & (np.abs(step[:, :-1]) < 0.01).all(axis=1) & (np.abs(step[:, -1]) < 1.1 * SPACING)
        assert beside.sum() == 2
        np.testing.assert_allclose(facing[beside], -step[beside] / SPACING, atol=1e-9)


# impact pressure --------------------------------------------------------------------------------------------


def few_of(x, shape):
    """Return which particles of a cloud about the origin are the single one, or the film of one row, near its middle."""
    centre = x[np.argmin(np.linalg.norm(x - 0.5 * SPACING, axis=1))]
    if shape == "film":
        return np.abs(x[:, -1] - centre[-1]) < 0.5 * SPACING
    return (x == centre).all(axis=1)


@pytest.mark.parametrize("ratio", [1.0, 1000.0])
@pytest.mark.parametrize("shape", ["particle", "film"])
@pytest.mark.parametrize("spec", [FLAT, SOLID, CORRECTED])
def test_what_flies_alone_is_stopped(spec, shape, ratio, device):
    """Light particles with a velocity across the heavy phase: slowed down in proportion, and not turned round in a step."""
    d = spec.dimension
    x = lattice(COUNTS[d], SPACING)
    few = few_of(x, shape)
    across = np.eye(d)[-1]
    found = []
    for speed in (1.0, -2.0):
        velocity = speed * few[:, None] * across
        bench, _ = flat(spec, phase=(~few).astype(int), velocity=velocity, ratio=ratio, device=device)
        a = bench.acceleration()
        inside = few & middle(bench, x)
        found.append(a[inside] @ across / speed)
        assert np.abs(a[inside][:, :-1]).max() < 1e-9 * np.abs(a).max()
    decay = -found[0]
    np.testing.assert_allclose(decay, -found[1], rtol=1e-9)
    step = 0.5 * bench.h / 14.0  # of the acoustic limit
    assert decay.min() * step > 0.03 and decay.max() * step < 1.0


@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_impact_conserves_momentum(spec, device):
    """Pair by pair in the conservative form: what a lone particle loses, those around it take, each along the line to it."""
    x = lattice(COUNTS[spec.dimension], SPACING, 0.05)
    few = few_of(x, "particle")
    velocity = few[:, None] * np.array([1.0, 0.4, -0.7])[: spec.dimension]
    bench, _ = flat(spec, 0.05, phase=(~few).astype(int), velocity=velocity, device=device)
    density = np.where(few, 1.0, 1000.0)
    force = bench.acceleration() * (density * bench.get("rest_volume"))[:, None]
    lost = force[few][0]
    assert lost @ velocity[few][0] < 0
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-13 * np.abs(lost).max())
    # those ahead are pushed on, those behind are drawn along
    taken = ~few & (np.abs(force).max(axis=1) > 0)
    assert taken.sum() > 5 and (force @ velocity[few][0])[taken].min() > 0
    line = (x - x[few]) / np.maximum(np.linalg.norm(x - x[few], axis=1), 1e-30)[:, None]
    aside = force[taken] - line[taken] * (force * line).sum(axis=1)[taken, None]
    assert np.abs(aside).max() < 1e-13 * np.abs(lost).max()


@pytest.mark.parametrize("spec", [FLAT, SOLID, CORRECTED])
def test_a_whole_interface_feels_no_impact(spec, device):
    """Both sides slide past each other, or part: where sides face each other there is no impact pressure."""
    for velocity in (np.eye(spec.dimension)[0], np.eye(spec.dimension)[-1]):
        left, alone = impact_at_interface(spec, 0.0, velocity, device)
        assert np.abs(left).max() < 1e-12 * np.abs(alone).max()


@pytest.mark.parametrize("spec", [FLAT, SOLID, CORRECTED])
def test_a_disordered_interface_slides(spec, device):
    """Every pair sees a common interface, also one that just reaches across it: no impact, no friction."""
    left, alone = impact_at_interface(spec, 0.2, np.eye(spec.dimension)[0], device)
    assert np.abs(left).max() < 1e-5 * np.abs(alone).max()


def impact_at_interface(spec, jitter, velocity, device):
    """Return the accelerations in the middle of a flat interface between a moving and a resting side.

    As they are, and as they would be if no particle faced the other phase.
    """
    bench, x = flat(spec, jitter, device=device, width=260)
    bench.put("velocity", np.where(bench.get("phase")[:, None] == 0, 0.0, velocity))
    bench.prepare()
    chosen = middle(bench, x) & near(bench)
    assert chosen.sum() > 10
    found = bench.acceleration()[chosen]
    bench.put("facing", 0.0)
    return found, bench.acceleration()[chosen]


# where there is none ----------------------------------------------------------------------------------------


def test_printed_form_and_single_phase_have_none():
    for spec in (dataclasses.replace(FLAT, paper_star=True), dataclasses.replace(FLAT, multiphase=False)):
        assert not FIELDS & {field.name for field in RIEMANN_FIELDS if field.exists(spec)}
        assert "interface_flow" not in {stage.name for stage in [*riemann.step(spec), *riemann.start(spec)]}
    assert FIELDS <= {field.name for field in RIEMANN_FIELDS if field.exists(FLAT)}
    names = [stage.name for stage in riemann.step(FLAT)]
    # of the velocities and positions that both sweeps of the step use
    assert names.index("kick_drift") < names.index("interface_flow") < names.index("continuity")
    assert "interface_flow" in {stage.name for stage in riemann.start(FLAT)}


# depth below an interface -----------------------------------------------------------------------------------

UNLIKE = {"unlike_viscosity": True, "viscosity": "morris"}


@pytest.mark.parametrize(
    ("spec", "kernel"), [(FLAT, "wendland_c2"), (FLAT, "quintic"), (FLAT, "gaussian"), (SOLID, "wendland_c2")]
)
def test_depth_of_rows(spec, kernel, device):
    """Rows of a lattice lie half a spacing deep, and one and a half: to a twentieth, which sums over rows are off by."""
    spec = dataclasses.replace(spec, kernel=kernel, **UNLIKE)
    bench, x = flat(spec, device=device, width=160 if spec.dimension == 2 else 260)
    depth = bench.get("interface_depth") * bench.h / SPACING
    chosen = near(bench) & middle(bench, x, 0.8) & (np.abs(x[:, -1]) < 2 * SPACING)
    assert len(np.unique(np.round(np.abs(x[chosen, -1]), 6))) == 2
    np.testing.assert_allclose(depth[chosen], np.abs(x[chosen, -1]) / SPACING, rtol=0.05)


def test_depth_of_disordered_particles(device):
    """To a fifth of a spacing (root mean square), and never less than a quarter of one."""
    spec = dataclasses.replace(FLAT, **UNLIKE)
    bench, x = flat(spec, 0.2, device=device, width=160)
    depth = bench.get("interface_depth") * bench.h / SPACING
    chosen = near(bench) & middle(bench, x, 0.8) & (np.abs(x[:, 1]) < 2.0 * SPACING)
    exact = np.maximum(np.abs(x[chosen, 1]) / SPACING, 0.25)
    assert depth[chosen].min() >= 0.25 - 1e-6
    assert np.abs(depth[chosen] - exact).max() < 0.35 and np.sqrt(np.mean((depth[chosen] - exact) ** 2)) < 0.2


@pytest.mark.parametrize("pressed", [0.6, 0.8, 1.25])
def test_depth_of_rows_that_a_flow_has_pressed(pressed, device):
    """As in the trough of a wave, where rows are nearer than at rest: the first has its depth, not that of rest.

    Sums over rows are off by p^2/4 over R^2 - a^2 of it (midpoint rule), p the distance of rows: 4.5 % at 1.25, the most.
    """
    spec = dataclasses.replace(FLAT, **UNLIKE)
    x = lattice((16, 16), SPACING) * (1 / pressed, pressed)
    options = dict(phase=(x[:, 1] > 0).astype(int), spacing=SPACING, device=device, width=160)
    bench = Bench(spec, x, fluids=fluids_of(1000.0), **options)
    bench.run(*riemann.sides(bench.spec))
    depth = bench.get("interface_depth") * bench.h / SPACING
    chosen = near(bench) & middle(bench, x, 0.6) & (np.abs(x[:, 1]) < pressed * SPACING)
    assert chosen.sum() >= 8
    np.testing.assert_allclose(depth[chosen], 0.5 * pressed, rtol=0.06)


@pytest.mark.parametrize("radius", [4.0, 6.0])
@pytest.mark.parametrize("spec", [FLAT, SOLID])
def test_depth_below_a_bent_interface(spec, radius, device):
    """Inside and outside of a disc and a ball, radius in spacings: within 0.05 spacings; as below a plane 0.1 to 0.3."""
    d = spec.dimension
    spec = dataclasses.replace(spec, tension="pressure_jump", corrected=True)
    x = lattice((int(2 * radius + 12),) * d, SPACING, 0.1)
    r = np.linalg.norm(x, axis=1) / SPACING
    inside = r < radius
    radius = (inside.sum() / (np.pi if d == 2 else 4 / 3 * np.pi)) ** (1 / d)  # of the same area or volume
    options = dict(phase=(~inside).astype(int), tension=1.0, spacing=SPACING, device=device, width=160 if d == 2 else 260)
    bench = Bench(spec, x, fluids=fluids_of(1000.0), **options)
    off = []
    for curvature in (0.0, (d - 1) / (radius * SPACING)):
        bench.put("curvature", np.where(inside, curvature, -curvature))
        bench.run(*riemann.sides(bench.spec))
        beyond = bench.get("interface_depth") * bench.h / SPACING - np.abs(r - radius)
        chosen = (np.abs(r - radius) > 0.6) & (np.abs(r - radius) < 2.0)
        off.append([beyond[chosen & side].mean() for side in (inside, ~inside)])
    assert off[0][0] < -0.07 and off[0][1] > 0.07
    assert np.abs(off[1]).max() < 0.05


@pytest.mark.parametrize("viscosity", [(1.0, 100.0), (10.0, 1.0)])
def test_two_layers_in_shear_feel_nothing(viscosity, device):
    """A velocity that is linear on each side, with one shear stress: no force; by harmonic means 6 to 8 % of the stress."""
    found = []
    for unlike in (True, False):
        spec = dataclasses.replace(FLAT, viscosity="morris", unlike_viscosity=unlike)
        fluids = tuple(Fluid(density=1.0, viscosity=mu) for mu in viscosity)
        bench, x = flat(spec, device=device, fluids=fluids, width=160)
        slope = np.where(x[:, 1] > 0, 1 / viscosity[1], 1 / viscosity[0])
        bench.put("velocity", np.column_stack([slope * x[:, 1], 0 * slope]))
        chosen = near(bench) & middle(bench, x)
        force = bench.acceleration()[chosen]  # of a mass of 1: rho = 1
        found.append(np.abs(force).max() * SPACING)  # over the stress of 1 by a spacing
    assert found[0] < 0.01 and found[1] > 0.05
