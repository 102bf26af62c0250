"""Continuity and momentum sweeps: conservation, invariance, exactness, energy, the same from any layout."""

import dataclasses

import numpy as np
import pytest

from tests.helpers import Bench, Fluid, Setup, full, lattice
from warpsph.kernels.core.pair import NEAR
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.core.spec import Spec
from warpsph.schemes import riemann_program as riemann

BASE = Spec(dimension=2, precision="float64")
PLUS_MORRIS = dataclasses.replace(BASE, periodic=(True, True), multiphase=True, viscosity="morris")
PLUS_RADIAL = dataclasses.replace(BASE, multiphase=True, viscosity="radial")
PAPER = dataclasses.replace(
    BASE,
    multiphase=True,
    viscosity="paper",
    paper_star=True,
    tension="body_force",
    interface=True,
    interface_force=True,
)
MINUS_RADIAL = dataclasses.replace(
    BASE,
    multiphase=True,
    viscosity="radial",
    tension="pressure_jump",
    interface=True,
    corrected=True,
    shifting=True,
)
MINUS_MORRIS = dataclasses.replace(BASE, viscosity="morris", corrected=True, shifting=True, gravity=True, body_force=True)
MINUS_3D = dataclasses.replace(MINUS_MORRIS, dimension=3, periodic=(False,) * 3, gravity=False, body_force=False)

LIGHT_AND_HEAVY = (
    Fluid(density=1.0, viscosity=0.01, sound_speed=14.0, gamma=1.4),
    Fluid(density=1000.0, viscosity=1.0, sound_speed=10.0),
)
SPACING = 0.1
COUNTS = {2: (14, 14), 3: (8, 8, 8)}
FORMS = {"morris": PLUS_MORRIS, "radial": PLUS_RADIAL, "paper": PAPER}


def scene(spec, counts=(14, 14), jitter=0.35, seed=1, **options):
    """Return (bench, positions) of a disordered cloud of random velocity, pressure and volume."""
    rng = np.random.default_rng(seed)
    x = lattice(counts, SPACING, jitter, seed, centre=False)
    n = len(x)
    size = np.array(counts) * SPACING
    given = dict(
        spacing=SPACING,
        velocity=rng.normal(size=x.shape),
        pressure=rng.normal(size=n),
        volume=SPACING ** len(counts) * rng.uniform(0.8, 1.2, n),
        excess=rng.uniform(-0.05, 0.05, n),
        lower=0.0,
        upper=size,
        width=128 if len(counts) == 2 else 240,
    )
    if spec.multiphase:
        given.update(phase=(x[:, 0] > 0.45 * size[0]).astype(int), fluids=LIGHT_AND_HEAVY)
    else:
        given.update(fluids=LIGHT_AND_HEAVY[1:])
    given.update(options)
    if any(spec.periodic):
        x %= size
    return Bench(spec, x, **given), x


def mass(bench):
    """Return the masses: rho0 times the rest volume."""
    density = np.array([row["density"] for row in bench.values["phases"].numpy()])
    phase = bench.get("phase").astype(int) if bench.spec.multiphase else 0
    return density[phase] * bench.get("rest_volume")


def relative_sum(terms):
    """Return |sum of the rows| over the sum of their lengths."""
    return np.linalg.norm(terms.sum(axis=0)) / np.linalg.norm(terms, axis=1).sum()


def bulk(bench, x):
    """Return which particles are half a support from the sides: enough neighbours to correct with."""
    return ((x > 0.5 * bench.support) & (x < bench.upper - 0.5 * bench.support)).all(axis=1)


def constant_states(bench):
    """Give the pairs between two phases the states of the particles themselves, at an interface across x."""
    if not bench.spec.paper_star:
        bench.put("velocity_gradient", 0.0)
        bench.put("facing", np.where(bench.get("phase")[:, None] == 0, 1.0, -1.0) * [1.0, 0.0])


def kernel_sum(bench, x):
    """Return sum_j V_j grad_i W_ij of all particles, from all pairs (open domain)."""
    d = x[:, None] - x[None]
    r = np.linalg.norm(d, axis=-1)
    q = r / bench.h
    assert bench.spec.kernel == "wendland_c2"
    slope = -10.0 * np.clip(2.0 - q, 0.0, None) ** 3
    f = KERNELS["wendland_c2"].alpha[x.shape[1] - 1] / bench.h ** (x.shape[1] + 2) * slope
    return (f[..., None] * d * bench.get("state")[: len(x), 1][None, :, None]).sum(axis=1)


# conservation -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("part", ["pressure", "viscosity", "both"])
def test_conservative_form_conserves_momentum(form, part, device):
    options = {}
    if part == "pressure":
        options["velocity"] = 0.0
    if part == "viscosity":
        options["pressure"] = 0.0
    bench, x = scene(FORMS[form], device=device, zeta=0.08, **options)
    force = mass(bench)[:, None] * bench.acceleration()
    assert np.abs(force).max() > 0
    assert relative_sum(force) < 1e-12
    if form != "morris":
        torque = x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]
        assert abs(torque.sum()) < 1e-12 * (np.linalg.norm(x, axis=1) * np.linalg.norm(force, axis=1)).sum()


@pytest.mark.parametrize("form", FORMS)
def test_pressure_work_becomes_compression(form, device):
    """sum m v.a + sum V p (drho/dt)/rho = 0 without dissipation, also at 1000:1 (theory: riemann#a2)."""
    fluids = tuple(dataclasses.replace(fluid, viscosity=0.0) for fluid in LIGHT_AND_HEAVY)
    bench, _ = scene(FORMS[form], device=device, fluids=fluids, dissipation=0.0)
    constant_states(bench)
    power = mass(bench) * (bench.get("velocity") * bench.acceleration()).sum(axis=1)
    state = bench.get("state")
    compression = state[:, 0] * state[:, 1] * bench.density_rate()
    assert abs(power.sum() + compression.sum()) < 1e-12 * (np.abs(power).sum() + np.abs(compression).sum())


@pytest.mark.parametrize("form", FORMS)
def test_dissipation_takes_energy(form, device):
    bench, _ = scene(FORMS[form], device=device, velocity=0.0)
    state = bench.get("state")
    assert (state[:, 0] * state[:, 1] * bench.density_rate()).sum() < 0


@pytest.mark.parametrize("form", FORMS)
def test_viscosity_takes_energy(form, device):
    bench, _ = scene(FORMS[form], device=device, pressure=0.0)
    assert (mass(bench) * (bench.get("velocity") * bench.acceleration()).sum(axis=1)).sum() < 0


# invariance -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spec", [PLUS_MORRIS, PLUS_RADIAL, PAPER, MINUS_RADIAL, MINUS_MORRIS])
def test_rates_do_not_see_a_uniform_velocity(spec, device):
    bench, _ = scene(spec, device=device, tension=1.0)
    velocity = bench.get("velocity")
    results = []
    for extra in (0.0, np.array([300.0, -200.0])):
        bench.put("velocity", velocity + extra)
        bench.put("density_excess", 0.0)
        result = [bench.acceleration(dt=1e-3), bench.density_rate()[:, None]]
        if spec.shifting:
            result += [bench.get("shift"), bench.get("carried")]
        results.append(result)
    for at_rest, moving in zip(*results, strict=True):
        assert np.abs(moving - at_rest).max() < 1e-10 * np.abs(at_rest).max()


@pytest.mark.parametrize("spec", [PLUS_MORRIS, PLUS_RADIAL, PAPER, MINUS_RADIAL, MINUS_MORRIS])
def test_viscosity_is_odd_in_the_velocity(spec, device):
    bench, _ = scene(spec, device=device, pressure=0.0)
    a = bench.acceleration()
    bench.put("velocity", -bench.get("velocity"))
    assert np.abs(a).max() > 0
    np.testing.assert_allclose(bench.acceleration(), -a, rtol=1e-12, atol=1e-12 * np.abs(a).max())


@pytest.mark.parametrize("spec", [PLUS_RADIAL, PAPER])
def test_central_viscosity_does_not_see_rigid_rotation(spec, device):
    bench, x = scene(spec, device=device, pressure=0.0)
    scale = np.abs(bench.acceleration()).max()
    bench.put("velocity", 2.0 * np.stack([-x[:, 1], x[:, 0]], axis=1))
    assert np.abs(bench.acceleration()).max() < 1e-12 * scale


@pytest.mark.parametrize("spec", [PLUS_MORRIS, PLUS_RADIAL])
def test_two_equal_phases_are_one(spec, device):
    """The sums with and without an interface nearby agree."""
    fluid = Fluid(density=3.0, viscosity=0.2)
    two, _ = scene(spec, device=device, fluids=(fluid, fluid))
    one, _ = scene(spec, device=device, fluids=(fluid, fluid), phase=0)
    assert (two.get("flags") != one.get("flags")).any()
    constant_states(two)
    for values, expected in (
        (two.acceleration(), one.acceleration()),
        (two.density_rate(), one.density_rate()),
    ):
        np.testing.assert_allclose(values, expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("spec", [PLUS_MORRIS, MINUS_RADIAL])
def test_list_by_columns_gives_the_same(spec, device):
    rows, _ = scene(spec, device=device)
    columns, _ = scene(dataclasses.replace(spec, row_list=False), device=device)
    for values, expected in (
        (columns.acceleration(), rows.acceleration()),
        (columns.density_rate(), rows.density_rate()),
    ):
        np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-13 * np.abs(expected).max())


def test_single_precision(device):
    double, _ = scene(PLUS_MORRIS, device=device)
    single, _ = scene(dataclasses.replace(PLUS_MORRIS, precision="float32"), device=device)
    expected = double.acceleration()
    assert np.abs(single.acceleration() - expected).max() < 1e-5 * np.abs(expected).max()


# exactness --------------------------------------------------------------------------------------------------


def test_gradient_and_divergence_on_a_lattice(device):
    """Conservative forms: exact but for the second moment of the lattice (theory: common#lattice, L)."""
    x = lattice((9, 9), SPACING)
    gradient, flow = np.array([3.0, -2.0]), np.array([[1.0, 2.0], [-4.0, 0.5]])
    fluid = Fluid(density=5.0)
    bench = Bench(
        PLUS_RADIAL,
        x,
        spacing=SPACING,
        fluids=(fluid,),
        pressure=7.0 + x @ gradient,
        velocity=0.0,
        device=device,
    )
    centre = len(x) // 2
    np.testing.assert_allclose(bench.acceleration()[centre], -0.9974 * gradient / 5.0, rtol=6e-5)
    bench.put("velocity", x @ flow.T)
    bench.put_state(pressure=7.0)
    assert bench.density_rate()[centre] == pytest.approx(-0.9974 * np.trace(flow), rel=6e-5)


@pytest.mark.parametrize("spec", [MINUS_RADIAL, MINUS_MORRIS, MINUS_3D])
def test_corrected_form_is_exact_for_a_linear_pressure(spec, device):
    d = spec.dimension
    gradient = np.array([3.0, -2.0, 5.0])[:d]
    fluids = (Fluid(density=4.0),) * 2  # an interface between equal densities changes nothing
    bench, x = scene(spec, COUNTS[d], device=device, velocity=0.0, fluids=fluids, excess=0.02, dissipation=0.0)
    bench.put_state(pressure=100.0 + x @ gradient)
    density = mass(bench) / bench.get("state")[:, 1]
    error = bench.acceleration() + gradient / density[:, None]
    assert np.abs(error[bulk(bench, x)]).max() < 1e-10


@pytest.mark.parametrize("spec", [MINUS_RADIAL, MINUS_MORRIS, MINUS_3D])
def test_corrected_form_feels_no_uniform_pressure(spec, device):
    bench, _ = scene(spec, COUNTS[spec.dimension], device=device, velocity=0.0)
    bench.put_state(pressure=1e4)
    assert np.abs(bench.acceleration()).max() < 1e-8


def test_laplace_jump_is_balanced_anywhere(device):
    """Each phase at constant pressure, apart by sigma kappa: nothing moves, at 1000:1."""
    bench, _ = scene(MINUS_RADIAL, device=device, velocity=0.0, tension=0.7)
    inside = bench.get("phase") == 0
    kappa = 4.0
    bench.put("curvature", np.where(inside, kappa, -kappa))
    bench.put("interface_weight", np.random.default_rng(1).uniform(0.1, 1, len(inside)))
    jump = 0.7 * kappa
    bench.put_state(pressure=np.where(inside, 11.0 + jump, 11.0))
    balanced, rate = bench.acceleration(), bench.density_rate()
    bench.put("interface_weight", 0.0)
    unbalanced = bench.acceleration()
    assert np.abs(balanced).max() < 1e-12 * np.abs(unbalanced).max()
    assert np.abs(rate).max() < 1e-12 * np.abs(bench.density_rate()).max()
    # without the tension the higher pressure pushes the phases apart: the outer one away from the inner one
    near = (np.abs(unbalanced).max(axis=1) > 0) & ~inside
    assert unbalanced[near, 0].mean() > 0


ROTATION, DILATION = np.array([[0.0, -2.0], [2.0, 0.0]]), np.array([[1.5, 0.0], [0.0, 1.5]])


@pytest.mark.parametrize(
    "spec, flow",
    [
        (MINUS_MORRIS, np.array([[1.0, 2.0], [-4.0, 0.5]])),
        (MINUS_3D, np.array([[1.0, 2.0, -1.0], [-4.0, 0.5, 3.0], [0.2, 0.7, -1.5]])),
        (MINUS_RADIAL, ROTATION),
        (MINUS_RADIAL, DILATION),
    ],
)
def test_linear_velocity_feels_no_viscosity(spec, flow, device):
    """On a disordered cloud, in the bulk. The radial form would need a third moment for a strain."""
    fluids = (Fluid(density=4.0, viscosity=0.3),) * 2
    bench, x = scene(spec, COUNTS[spec.dimension], device=device, pressure=0.0, fluids=fluids, phase=0)
    scale = np.abs(bench.acceleration()).max()
    bench.put("velocity", x @ flow.T)
    assert np.abs(bench.acceleration()[bulk(bench, x)]).max() < 1e-11 * scale


def test_corrected_viscosity_of_a_parabola(device):
    """On a lattice the Morris form with its moment taken out is exact for a quadratic velocity."""
    x = lattice((9, 9), SPACING)
    velocity = np.stack([0.5 * x[:, 1] ** 2, np.zeros(len(x))], axis=1)
    fluid = Fluid(density=4.0, viscosity=0.3)
    bench = Bench(MINUS_MORRIS, x, spacing=SPACING, fluids=(fluid,), velocity=velocity, device=device)
    np.testing.assert_allclose(bench.acceleration()[len(x) // 2], [0.3 / 4.0, 0.0], atol=1e-12)


def test_gravity_and_body_force_act_alike(device):
    bench, _ = scene(MINUS_MORRIS, device=device, velocity=0.0, pressure=3.0, gravity=(0.5, -9.81), body_force=(2.0, 0.25))
    np.testing.assert_allclose(bench.acceleration(), full((2.5, -9.56), len(bench.get("rest_volume")), 2), atol=1e-10)


# forces of two particles ------------------------------------------------------------------------------------


def test_interface_force_keeps_phases_apart(device):
    """Repulsive and equal and opposite between two phases, nothing inside one (theory: riemann#a7)."""
    x = np.array([[0.0, 0.0], [0.08, 0.06]])
    for phase, sign in (([0, 1], 1), ([0, 0], 0)):
        forces = []
        for zeta in (0.0, 0.08):
            bench = Bench(
                PAPER, x, spacing=SPACING, pressure=[2.0, 5.0], phase=phase, fluids=LIGHT_AND_HEAVY,
                zeta=zeta, device=device,
            )  # fmt: skip
            forces.append(mass(bench)[:, None] * bench.acceleration())
        extra = forces[1] - forces[0]
        np.testing.assert_allclose(extra.sum(axis=0), 0.0, atol=1e-15)
        away = extra[1] @ (x[1] - x[0])
        if sign:
            gradient = np.linalg.norm(kernel_sum(bench, x)[0]) / SPACING**2
            assert away > 0
            assert np.linalg.norm(extra[0]) == pytest.approx(0.08 * 7.0 * gradient * SPACING**4, rel=1e-12)
        else:
            assert away == 0.0


@pytest.mark.parametrize("spec", [PLUS_RADIAL, PAPER])
def test_pressure_pushes_and_viscosity_holds(spec, device):
    x = np.array([[0.0, 0.0], [0.1, 0.0]])
    options = dict(spacing=SPACING, phase=[0, 1], fluids=LIGHT_AND_HEAVY, device=device)
    assert Bench(spec, x, pressure=1.0, **options).acceleration()[1, 0] > 0
    assert Bench(spec, x, pressure=-1.0, **options).acceleration()[1, 0] < 0
    for speed in (1.0, -1.0):
        a = Bench(spec, x, velocity=[[0.0, 0.0], [speed, 0.0]], **options).acceleration()
        assert a[1, 0] * speed < 0 < a[0, 0] * speed


def test_harmonic_mean_of_two_viscosities(device):
    """The friction between two media follows 2 mu_i mu_j / (mu_i + mu_j): the less viscous one decides."""
    x = np.array([[0.0, 0.0], [0.1, 0.0]])

    def friction(mu_0, mu_1):
        fluids = (Fluid(density=1.0, viscosity=mu_0), Fluid(density=1000.0, viscosity=mu_1))
        bench = Bench(
            PLUS_MORRIS, x, spacing=SPACING, lower=-1.0, upper=1.0, phase=[0, 1], fluids=fluids,
            velocity=[[0.0, 1.0], [0.0, 0.0]], device=device,
        )  # fmt: skip
        return (mass(bench) * bench.acceleration()[:, 1])[0]

    assert friction(0.3, 0.6) == pytest.approx(0.4 * friction(1.0, 1.0), rel=1e-12)
    assert friction(0.0, 0.6) == 0.0
    assert friction(0.0, 0.0) == 0.0


# continuity -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spec", [PLUS_MORRIS, PLUS_RADIAL, PAPER])
@pytest.mark.parametrize("phases", [(0, 0), (1, 1), (0, 1), (1, 0)])
def test_high_pressure_expands(spec, phases, device):
    """The pressure difference in the star velocity lowers the density of the particle of higher pressure."""
    x = np.array([[0.05, 0.0], [0.15, 0.02]])
    options = dict(spacing=SPACING, lower=-1.0, upper=1.0, fluids=LIGHT_AND_HEAVY, device=device)
    bench = Bench(spec, x, pressure=[2.0, 1.0], phase=phases, **options)
    rate = bench.density_rate()
    assert rate[0] < 0 < rate[1]
    assert rate[0] == pytest.approx(-rate[1], rel=1e-12)
    # u* = dp / (zeta_i + zeta_j) on either side, zeta = Z + 2 mu/dx (theory: riemann#viscous-star); the printed form has
    # mean density times mean sound speed
    fluids = [LIGHT_AND_HEAVY[k] for k in phases]
    rho, c, mu = np.array([[fluid.density, fluid.sound_speed, fluid.viscosity] for fluid in fluids]).T
    resistance = 2 * rho.mean() * c.mean() if spec.paper_star else (rho * c + 2 * mu / SPACING).sum()
    gradient = np.linalg.norm(kernel_sum(bench, x)[0])
    assert rate[0] == pytest.approx(-2 * gradient / resistance, rel=1e-12)
    assert np.abs(Bench(spec, x, pressure=[2.0, 1.0], phase=phases, dissipation=0.0, **options).density_rate()).max() == 0.0


def test_approaching_particles_are_compressed(device):
    x = np.array([[0.0, 0.0], [0.1, 0.0]])
    for phases in ([0, 0], [0, 1]):
        bench = Bench(
            PLUS_RADIAL, x, spacing=SPACING, velocity=[[1.0, 0.0], [-1.0, 0.0]], phase=phases,
            fluids=LIGHT_AND_HEAVY, device=device,
        )  # fmt: skip
        rate = bench.density_rate()
        assert (rate > 0).all()
        gradient = np.linalg.norm(kernel_sum(bench, x)[0])
        # relative velocity 2; the heavy particle hardly moves against the contact, the light one takes it all
        share = np.array([1.0, 1.0]) if phases == [0, 0] else 2 * np.array([1000.0, 1.0]) / 1001.0
        np.testing.assert_allclose(rate, 2 * gradient * share, rtol=1e-12)


def test_hydrostatic_pressure_drives_nothing(device):
    """A linear pressure in balance with gravity changes no density, on any cloud."""
    gravity = np.array([0.5, -9.81])
    bench, x = scene(MINUS_MORRIS, device=device, velocity=0.0, gravity=gravity, fluids=(Fluid(density=3.0),))
    bench.put_state(pressure=50.0 + 3.0 * x @ gravity)
    rate = bench.density_rate()
    bench.put_state(pressure=50.0)
    assert np.abs(rate).max() < 1e-12 * np.abs(bench.density_rate()).max()


def test_hydrostatic_interface_drives_nothing(device):
    """Two media, the interface midway between two particles: star velocity and density at rest."""
    spec = dataclasses.replace(PLUS_RADIAL, gravity=True)
    x = np.array([[0.0, -0.05], [0.0, 0.05]])
    options = dict(spacing=SPACING, phase=[1, 0], fluids=LIGHT_AND_HEAVY, gravity=(0.0, -9.81), device=device)
    rest = Bench(spec, x, pressure=[3.0 + 1000 * 9.81 * 0.05, 3.0 - 1 * 9.81 * 0.05], **options).density_rate()
    level = Bench(spec, x, pressure=3.0, **options).density_rate()
    assert np.abs(rest).max() < 1e-12 * np.abs(level).max()


# shift ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spec", [MINUS_RADIAL, MINUS_MORRIS])
def test_shift_needs_a_velocity_gradient(spec, device):
    """A fluid at rest or in uniform motion is not stirred, however uneven its particles lie."""
    for velocity in (0.0, (30.0, -20.0)):
        bench, _ = scene(spec, device=device, velocity=velocity)
        bench.acceleration(dt=0.1)
        assert np.abs(bench.get("shift")).max() < 1e-12 * SPACING
        assert np.abs(bench.get("carried")).max() < 1e-12


@pytest.mark.parametrize("spec", [MINUS_RADIAL, MINUS_MORRIS])
def test_shift_evens_out(spec, device):
    """Towards the emptier side away from interfaces, within its cap, and the cloud is more even after it."""
    fluids = (Fluid(density=4.0, viscosity=0.3),) * 2
    bench, x = scene(spec, device=device, pressure=0.0, fluids=fluids, volume=SPACING**2, shifting=0.5, shift_cap=0.05)
    bench.put("velocity", x @ np.array([[0.0, 3.0], [0.0, 0.0]]))
    before = kernel_sum(bench, x)
    bench.acceleration(dt=0.5)
    shift = bench.get("shift")
    length = np.linalg.norm(shift, axis=1)
    assert length.max() <= 0.05 * bench.h * (1 + 1e-9)
    assert length.max() > 0.01 * bench.h
    alone = (bench.get("flags")[: len(x)].astype(int) & NEAR) == 0 if spec.multiphase else np.full(len(x), True)
    assert alone.mean() > 0.4 and alone.all() != spec.multiphase
    np.testing.assert_allclose((shift[:, 0] * before[:, 1])[alone], (shift[:, 1] * before[:, 0])[alone], atol=1e-12)
    assert ((shift * before).sum(axis=1) <= 0)[alone].all()
    inside = (np.abs(x - 0.7) < 0.7 - bench.support).all(axis=1)
    after = kernel_sum(bench, x + shift * inside[:, None])
    norms = [np.linalg.norm(values[inside], axis=1) for values in (before, after)]
    assert np.sqrt((norms[1] ** 2).mean()) < 0.97 * np.sqrt((norms[0] ** 2).mean())


def test_shift_holds_phases_apart(device):
    """On an even lattice only particles that see another phase are shifted: straight away from it, both sides alike."""
    x = lattice((14, 14), SPACING, centre=False)
    phase = (x[:, 0] > 0.7).astype(int)
    fluids = (Fluid(density=4.0), Fluid(density=4000.0))
    options = dict(spacing=SPACING, fluids=fluids, velocity=x @ np.array([[0.0, 3.0], [0.0, 0.0]]), device=device)
    bench = Bench(MINUS_RADIAL, x, phase=phase, **options)
    bench.acceleration(dt=0.5)
    shift = bench.get("shift")
    middle = (np.abs(x - 0.7) < 0.4).all(axis=1)
    near = np.abs(x[:, 0] - 0.7) < bench.support - 0.5 * SPACING - 1e-9
    assert np.abs(shift[middle & ~near]).max() < 1e-14
    away = np.where(phase == 0, -1.0, 1.0) * shift[:, 0]
    assert away[middle & near].min() > 1e-8
    assert np.abs(shift[middle, 1]).max() < 1e-14
    np.testing.assert_allclose(shift[middle], -shift[::-1][middle[::-1]], atol=1e-14)
    bench = Bench(MINUS_RADIAL, x, phase=0, **options)
    bench.acceleration(dt=0.5)
    assert np.abs(bench.get("shift")[middle]).max() < 1e-14


def test_shift_grows_with_the_step(device):
    bench, x = scene(MINUS_MORRIS, device=device, pressure=0.0, shift_cap=100.0)
    bench.acceleration(dt=1e-3)
    short = bench.get("shift")
    bench.acceleration(dt=2e-3)
    np.testing.assert_allclose(bench.get("shift"), 2 * short, rtol=1e-10, atol=1e-18)
    bench.acceleration(dt=0.0)
    assert (bench.get("shift") == 0).all()


@pytest.mark.parametrize("spec", [MINUS_MORRIS, MINUS_RADIAL, MINUS_3D])
def test_shifted_particles_carry_the_fields_of_their_new_place(spec, device):
    """A linear velocity and a linear pressure look the same after the shift."""
    d = spec.dimension
    flow = np.array([[1.0, 2.0, -1.0], [-4.0, -1.0, 3.0], [0.2, 0.7, -1.5]])[:d, :d]
    gradient = np.array([3.0, -2.0, 5.0])[:d]
    fluids = (Fluid(density=4.0, sound_speed=9.0, gamma=1.0),) * 2
    bench, x = scene(spec, COUNTS[d], device=device, fluids=fluids, phase=0, shifting=0.2, excess=0.0)
    bench.put("velocity", x @ flow.T)
    bench.put_state(pressure=x @ gradient)
    bench.acceleration(dt=0.1)
    shift = bench.get("shift")
    assert np.abs(shift).max() > 1e-4 * SPACING
    inside = bulk(bench, x)
    np.testing.assert_allclose(bench.get("carried")[inside], (shift @ flow.T)[inside], atol=1e-12)
    # gamma = 1: p = rho0 c^2 s
    pressure = bench.get("density_excess") * 4.0 * 81.0
    np.testing.assert_allclose(pressure[inside], (shift @ gradient)[inside], atol=1e-12)


# leapfrog ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_kick_and_drift(precision, device):
    """v += (dt + dt_before)/2 a, then x += dt v and the shift with its change of velocity."""
    spec = dataclasses.replace(MINUS_MORRIS, precision=precision)
    bench, x = scene(spec, device=device)
    rng = np.random.default_rng(4)
    velocity, a, carried = rng.normal(size=(3, *x.shape))
    way, shift = 1e-3 * rng.normal(size=(2, *x.shape))
    values = {"velocity": velocity, "acceleration": a, "carried": carried, "offset": way, "shift": shift}
    for name, value in values.items():
        bench.put(name, value)
    anchor = bench.get("anchor")
    bench.set_clock(STEP=0.03, LAST_STEP=0.01)
    bench.run(riemann.step(bench.spec)[0])
    moved = velocity + 0.02 * a
    tiny = 1e-14 if precision == "float64" else 1e-6
    np.testing.assert_allclose(bench.get("velocity"), moved + carried, atol=tiny)
    np.testing.assert_allclose(bench.get("offset"), way + 0.03 * moved + shift, atol=0.1 * tiny)
    np.testing.assert_allclose(bench.get("position"), anchor + way + 0.03 * moved + shift, atol=tiny)
    np.testing.assert_array_equal(bench.get("anchor"), anchor)
    np.testing.assert_allclose(bench.get("midway"), bench.get("position") - 0.015 * moved, atol=tiny)
    np.testing.assert_array_equal(bench.get("state_old"), bench.get("state")[: len(x)])
    maxima = np.sqrt(bench.bindings["maxima"].numpy().astype(float))
    assert maxima[0] == pytest.approx(np.linalg.norm(moved + carried, axis=1).max(), rel=1e-5)
    assert maxima[2] == pytest.approx(np.linalg.norm(way + 0.03 * moved + shift, axis=1).max(), rel=1e-5)


# threads ----------------------------------------------------------------------------------------------------


def test_threads_give_identical_bits():
    """Twenty steps on one, two and three threads, with list rebuilds on the way."""
    rng = np.random.default_rng(2)
    x = lattice((36, 30), SPACING, 0.1, centre=False)
    size = np.array([3.6, 3.0])
    velocity = 3.0 * np.stack([np.sin(2 * np.pi * x[:, 0] / 3.6), rng.uniform(-1, 1, len(x))], axis=1)
    spec = dataclasses.replace(
        BASE, precision="float32", periodic=(True, True), corrected=True, shifting=True,
        volume_constraint=True, viscosity="morris",
    )  # fmt: skip
    results = []
    for threads in (1, 2, 3):
        setup = Setup(
            spec, x, spacing=SPACING, lower=0.0, upper=size, velocity=velocity,
            fluids=(Fluid(viscosity=0.01),), device="cpu",
        )  # fmt: skip
        stepper = setup.stepper(threads)
        stepper.prepare(fresh=True)
        stepper.run(1.0, 20)
        clock, counters = stepper.read()
        kept = setup.particles.kept()
        results.append((kept, clock.copy(), counters.copy()))
        stepper.launcher.team.close()
    one = results[0]
    assert one[2][0] == 20 and one[2][7] >= 2  # steps, rebuilds
    for kept, clock, counters in results[1:]:
        for name, values in one[0].items():
            np.testing.assert_array_equal(kept[name], values, err_msg=name)
        np.testing.assert_array_equal(clock, one[1])
        np.testing.assert_array_equal(counters, one[2])
