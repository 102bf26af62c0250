"""Stages of projection ISPH on small clouds: exact for what they must be exact for (theory: isph#b1 to isph#b8)."""

import dataclasses
import itertools

import numpy as np
import pytest
import warp as wp

from tests.helpers import Fluid, lattice
from tests.isph_scenes import SCENES, spec_of
from tests.projection import INSIDE, ISOLATED, Stages, channel_spec, codes_of, open_spec, periodic_spec
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.mirror import FREE_SLIP, NO_SLIP, NO_WALL
from warpsph.kernels.core.smoothing import window_integral
from warpsph.kernels.core.weights import LONGEST, make_weights
from warpsph.kernels.isph.pressure import UNSURE
from warpsph.kernels.isph.projection import CLOSEST, SMALLEST_MOMENT
from warpsph.kernels.isph.regularise import CONTACT, CROWDED, MOST_PUSH
from warpsph.schemes import isph_program as isph
from warpsph.schemes.isph_physics import row_shares

SPACING = 0.1
WATER = Fluid(density=4.0, viscosity=0.3)
BOTH = pytest.mark.parametrize("precision", ["float64", "float32"])
DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3])
EXACT = {"float64": 1e-11, "float32": 3e-5}
GRAVITY = np.array([0.5, -9.81, 2.0])
STEP = {"dt": 0.02, "last": 0.016}  # omega = 1.25


def cloud(dimension, jitter=0.2, seed=1):
    """Return a disordered block in the first quadrant (octant), (n, d)."""
    return lattice((9, 8) if dimension == 2 else (7, 6, 6), SPACING, jitter, seed, centre=False)


def drop(dimension=2, precision="float64", x=None, spec=None, **options):
    """Return (bench, positions) of a block with a surface on all sides; no wall."""
    x = cloud(dimension) if x is None else x
    options.setdefault("fluids", (WATER,))
    return Stages(spec or open_spec(dimension, precision), x, spacing=SPACING, **options), x


def tank(dimension=2, precision="float64", kinds=None, x=None, **options):
    """Return (bench, positions) of a block in an open tank: walls below and at both ends of the other axes."""
    x = cloud(dimension) if x is None else x
    top = 1 if dimension == 2 else 2
    if kinds is None:
        kinds = [NO_SLIP, FREE_SLIP] * dimension
        kinds[2 * top + 1] = NO_WALL
    upper = np.array([0.9, 0.8] if dimension == 2 else [0.7, 0.6, 0.6])
    options.setdefault("fluids", (WATER,))
    return Stages(
        open_spec(dimension, precision), x, spacing=SPACING, kinds=kinds, lower=0.0, upper=upper, width=300, **options
    ), x


def linear(x, seed=7):
    """Return (G, u) of a linear velocity field u = u0 + G x."""
    random = np.random.default_rng(seed)
    gradient = random.normal(size=(x.shape[1], x.shape[1]))
    return gradient, random.normal(size=x.shape[1]) + x @ gradient.T


def whole(bench):
    """Return which particles have enough neighbours for a corrected gradient."""
    return np.linalg.det(bench.moments()) > 1.0001 * SMALLEST_MOMENT**bench.spec.dimension


def interior(x, layers=3.2):
    """Return which particles of a block have a full support."""
    inside = (x > x.min(axis=0) + layers * SPACING) & (x < x.max(axis=0) - layers * SPACING)
    return inside.all(axis=1)


# weights in time ------------------------------------------------------------------------------------------------------


def weights(second_order, step, last, device="cpu"):
    function = make_weights(second_order)

    @wp.kernel(module="unique", enable_backward=False)
    def apply(clock: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.vec4d)):
        out[0] = function(clock)

    clock = np.zeros(ck.CLOCK_SIZE)
    clock[ck.STEP], clock[ck.LAST_STEP] = step, last
    out = wp.zeros(1, dtype=wp.vec4d, device=device)
    wp.launch(apply, dim=1, inputs=[wp.array(clock, dtype=wp.float64, device=device), out], device=device)
    return out.numpy()[0]


@pytest.mark.parametrize("ratio", [0.05, 0.5, 1.0, 1.25, LONGEST])
def test_second_order_weights_are_exact_for_a_parabola(ratio, device):
    """u = 1, t, t^2 at variable steps; the way is exact for a velocity that is linear in time."""
    dt, last = 0.3, 0.3 / ratio
    c0, c1, beta, omega = weights(True, dt, last, device)
    assert omega == pytest.approx(ratio)
    for power in (0, 1, 2):
        rate = power * dt ** (power - 1) if power else 0.0
        assert c0 * 0.0**power - c1 * (-last) ** power + beta * dt * rate == pytest.approx(dt**power, abs=1e-14)
    assert dt * ((1 + omega / 2) * 1.0 - omega / 2 * (1.0 - 2.0 * last)) == pytest.approx(dt + dt**2, abs=1e-14)


@pytest.mark.parametrize(
    "second_order, step, last", [(True, 0.1, 0.0), (True, 0.1, 0.1 / (1.01 * LONGEST)), (False, 0.1, 0.1)]
)
def test_first_order_weights(second_order, step, last, device):
    """At the start, after a very short step, and in the printed scheme."""
    np.testing.assert_array_equal(weights(second_order, step, last, device), [1.0, 0.0, 1.0, 0.0])


# predict --------------------------------------------------------------------------------------------------------------


@BOTH
@DIMENSIONS
def test_what_a_neighbourhood_looks_like(dimension, precision, device):
    """Moment, its inverse, spread, company, evenness and normal against sums over explicit images, surfaces included."""
    bench, x = tank(dimension, precision, device=device)
    bench.look()
    moment = bench.moments()
    even, pairing, own = np.zeros_like(x), np.zeros_like(x), np.zeros(len(x))

    def w(q):
        return np.clip(2.0 - q, 0, None) ** 4 * (1 + 2 * q)

    for code, d, f in bench.pairs():
        q = np.linalg.norm(d, axis=-1) / bench.h
        even += np.einsum("ij,ija->ia", f, d)
        pairing += np.einsum("ij,ija->ia", f * (w(q) / w(SPACING / bench.h)) ** 4, d)
        if code:
            own += -np.diag(f) * (np.diag(np.linalg.norm(d, axis=-1)) ** 2)
    close = {"rtol": 0, "atol": 10 * EXACT[precision]}
    assert own.max() > 0.05
    np.testing.assert_allclose(bench.get("spread"), np.trace(moment, axis1=1, axis2=2), **close)
    np.testing.assert_allclose(bench.get("company"), np.trace(moment, axis1=1, axis2=2) - own, **close)
    np.testing.assert_allclose(bench.get("crowding") * bench.h, (even + 0.2 * pairing) * bench.h, **close)
    known = whole(bench)
    inverse = np.where(known[:, None, None], np.linalg.inv(moment), np.eye(dimension))
    assert known.mean() > 0.8
    np.testing.assert_allclose(bench.get("correction"), inverse, **close)
    outward = -np.einsum("iab,ib->ia", inverse, even)
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    strong = length[:, 0] * bench.h > 0.01
    normals = bench.get("surface_normal")
    np.testing.assert_allclose(normals[strong], (outward / length)[strong], rtol=0, atol=1e3 * close["atol"])


@DIMENSIONS
def test_thin_neighbourhoods_have_no_correction(dimension, device):
    """A single particle, a pair, a row: the identity, and finite numbers everywhere."""
    x = np.zeros((6, dimension))
    x[1:3, 0] = 1.0, 1.0 + SPACING
    x[3:, 0] = 3.0, 3.0 + SPACING, 3.0 + 2 * SPACING
    bench, _ = drop(dimension, x=x, velocity=x, device=device)
    star = bench.look()
    np.testing.assert_array_equal(bench.get("correction"), np.broadcast_to(np.eye(dimension), (6, dimension, dimension)))
    assert np.isfinite(star).all() and np.isfinite(bench.get("surface_normal")).all()


@pytest.mark.parametrize("step", [STEP, {"dt": 0.02, "last": 0.0}], ids=["BDF2", "first step"])
def test_velocity_without_pressure(step, device):
    """u* = c0 u - c1 u_old + beta dt (g + b - B^2 (x - x_c)), of particles that do not see each other."""
    random = np.random.default_rng(0)
    x = np.arange(5)[:, None] * [1.0, 0.5]
    u, old = random.normal(size=(2, 5, 2))
    bench, _ = drop(
        x=x, spec=open_spec(central_force=True), velocity=u, velocity_old=old, gravity=GRAVITY[:2], body_force=(3.0, 1.0),
        device=device, **step,
    )  # fmt: skip
    bench.params.center = type(bench.params.center)(0.3, 0.4)
    bench.params.pull = 25.0
    c0, c1, beta, _ = weights(True, step["dt"], step["last"])
    expected = c0 * u - c1 * old + beta * step["dt"] * (GRAVITY[:2] + [3.0, 1.0] - 25.0 * (x - [0.3, 0.4]))
    np.testing.assert_allclose(bench.look(), expected, rtol=0, atol=1e-13)


def friction(bench):
    """Return the viscous acceleration that the prediction adds, (n, d)."""
    c0, c1, beta, _ = weights(True, bench.dt, bench.clock_array.numpy()[ck.LAST_STEP])
    u, old = bench.get("velocity"), bench.get("velocity_old")
    return (bench.look() - c0 * u + c1 * old) / (beta * bench.dt)


@DIMENSIONS
def test_viscous_term_is_exact_for_a_parabola_on_a_lattice(dimension, device):
    """nu lap of the velocity extrapolated to the new time, whatever the second moment (theory: common#lattice)."""
    x = lattice((9,) * dimension, SPACING)
    random = np.random.default_rng(3)
    second = random.normal(size=(2, dimension, dimension, dimension))  # component, two axes
    u, old = (np.einsum("kab,ia,ib->ik", s, x, x) for s in second)
    for ratio in (1.25, 2.0):
        bench, _ = drop(
            dimension, x=x, spec=periodic_spec(dimension), velocity=u, velocity_old=old, ratio=ratio, device=device, **STEP
        )
        laplacian = 2 * np.trace(second, axis1=2, axis2=3)
        expected = WATER.viscosity / WATER.density * (laplacian[0] + 1.25 * (laplacian[0] - laplacian[1]))
        centre = int(np.argmin(np.linalg.norm(x, axis=1)))  # four layers around it: a full support
        np.testing.assert_allclose(friction(bench)[centre], expected, rtol=0, atol=1e-9)


@DIMENSIONS
def test_viscous_term_of_a_linear_flow_is_zero(dimension, device):
    """Isotropic form, where the particles are uneven; next to a surface it keeps the whole sum, as without stress there."""
    x = cloud(dimension)
    _, u = linear(x)
    bench, _ = drop(dimension, x=x, spec=periodic_spec(dimension), velocity=u, device=device)
    felt = friction(bench)
    inner = bench.get("spread") > 0.9 * dimension
    assert inner.sum() > 10 and not inner.all()
    assert np.abs(felt[inner]).max() < 1e-9


@BOTH
@DIMENSIONS
def test_rotation_feels_no_friction(dimension, precision, device):
    """Central form: neither inside nor at the surface, however uneven."""
    x = cloud(dimension)
    spin = np.zeros((dimension, dimension))
    spin[0, 1], spin[1, 0] = -2.0, 2.0
    bench, _ = drop(dimension, precision, x=x, velocity=x @ spin.T, device=device)
    scale = WATER.viscosity / WATER.density / SPACING
    assert np.abs(friction(bench)[whole(bench)]).max() < 30 * EXACT[precision] * scale


def test_images_continue_a_couette_flow(device):
    """Between no-slip sides that move with the flow nothing is felt, beside a side that stands the flow is slowed."""
    x = cloud(2)
    u = np.stack([x[:, 1] + 0.5, 0 * x[:, 1]], axis=1)
    for lowest, free in ((0.5, 0), (0.0, 0), (0.0, 1)):
        kinds = [NO_WALL, NO_WALL, FREE_SLIP if free else NO_SLIP, NO_SLIP]
        bench = Stages(
            channel_spec(), x, spacing=SPACING, kinds=kinds, lower=0.0, upper=(0.9, 0.8), velocity=u, fluids=(WATER,),
            side_velocity=[[0, 0], [0, 0], [lowest, 0], [1.3, 0]], device=device,
        )  # fmt: skip
        felt = friction(bench)
        if lowest == 0.5:
            # the flow is not periodic at the ends x = 0, 0.9 only if it depends on x
            assert np.abs(felt).max() < 1e-9
        else:
            beside = x[:, 1] < 0.1
            assert (felt[beside, 0] < -0.01).all() if not free else (felt[beside, 0] > 0.01).all()
            assert np.abs(felt[x[:, 1] > 0.45]).max() < 1e-9


# the pressure equation --------------------------------------------------------------------------------------------------


@BOTH
@DIMENSIONS
def test_matrix_is_symmetric(dimension, precision, device):
    """Sides, edges, corners, a surface taken out, disorder, unequal volumes; against the sums over explicit images."""
    volume = np.random.default_rng(5).uniform(0.9, 1.1, len(cloud(dimension))) * SPACING**dimension
    bench, x = tank(dimension, precision, gravity=GRAVITY[:dimension], volume=volume, device=device)
    bench.look()
    matrix, _ = bench.assemble()
    inside = bench.get("surface") == INSIDE
    assert 0.3 * len(x) < inside.sum() < len(x)
    size = np.abs(matrix).max()
    rounding = {"float64": 1e-14, "float32": 2e-6}[precision] * size
    assert np.abs(matrix - matrix.T).max() < rounding
    # rows and columns of the surface are out
    np.testing.assert_array_equal(matrix[~inside], np.eye(len(x))[~inside])
    assert np.abs(matrix[inside][:, ~inside]).max() == 0
    expected, coupling = np.zeros_like(matrix), np.zeros(len(x))
    second = np.zeros((len(x), dimension, dimension))
    share = volume / SPACING**dimension
    for _, d, f in bench.pairs():
        w = -2.0 * share[:, None] * f / WATER.density
        np.fill_diagonal(w, 0.0)
        expected[np.ix_(inside, inside)] -= w[np.ix_(inside, inside)]
        coupling += w.sum(axis=1)
        second += np.einsum("ij,ija,ijb->iab", 0.5 * w * inside[None] * inside[:, None], d, d)
    expected[np.diag_indices(len(x))] = np.where(inside, coupling, 1.0)
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=10 * rounding)
    # the preconditioners see neither the surface nor own images: diagonal and second moment of the rows
    order = bench.rows_of("source")
    np.testing.assert_allclose(bench.matrix.diagonal.numpy(), np.diag(expected)[order], rtol=0, atol=10 * rounding)
    np.testing.assert_allclose(bench.moment.numpy(), second[order], rtol=0, atol=10 * rounding * bench.h**2)
    assert np.linalg.eigvalsh(0.5 * (matrix + matrix.T)).min() > 0


@DIMENSIONS
def test_rows_without_a_surface_add_up_to_zero(dimension, device):
    """The constant is the null vector of a closed box; own images take no part."""
    x = cloud(dimension)
    upper = [0.9, 0.8] if dimension == 2 else [0.7, 0.6, 0.6]
    bench = Stages(
        channel_spec(dimension), x, spacing=SPACING, kinds=[NO_WALL, NO_WALL] + [NO_SLIP] * (2 * dimension - 2), lower=0.0,
        upper=upper, width=300, device=device,
    )  # fmt: skip
    bench.look()
    matrix, _ = bench.assemble()
    assert np.abs(matrix.sum(axis=1)).max() < 1e-12 * np.abs(matrix).max()
    assert np.abs(matrix - matrix.T).max() < 1e-14 * np.abs(matrix).max()
    values = np.linalg.eigvalsh(matrix)
    assert abs(values[0]) < 1e-11 * values[-1] < 1e-5 * values[1]


@BOTH
@DIMENSIONS
def test_hydrostatic_pressure_solves_the_equation_of_a_tank(dimension, precision, device):
    """A p = b for p = rho g.x and fluid at rest on any cloud, with its surface rows known and images in balance."""
    g = GRAVITY[:dimension]
    bench, x = tank(dimension, precision, gravity=g, device=device, **STEP)
    star = bench.look()
    pressure = 7.0 + WATER.density * x @ g
    bench.put("pressure", pressure)
    bench.put("lasting_gradient", WATER.density * g)
    matrix, right = bench.assemble()
    inside = bench.get("surface") == INSIDE
    beta = weights(True, **{"step": STEP["dt"], "last": STEP["last"]})[2]
    np.testing.assert_allclose(star, np.broadcast_to(beta * STEP["dt"] * g, x.shape), rtol=1e-6)
    scale = (np.abs(matrix) @ np.abs(pressure))[inside].max()
    known = np.where(inside, pressure, 0.0)
    assert np.abs(matrix @ known - right)[inside].max() < EXACT[precision] * 0.1 * scale
    np.testing.assert_array_equal(right[~inside], 0.0)
    # the start value of the solver is the last pressure
    np.testing.assert_allclose(bench.get("unknown")[inside], pressure[inside], rtol=1e-6)
    # without the deferred correction the equation is wrong
    bench.bindings["deferred"] = 0.0
    matrix, right = bench.assemble()
    assert np.abs(matrix @ known - right)[inside].max() > 1e-3 * scale


@DIMENSIONS
def test_any_linear_pressure_solves_the_equation_of_a_drop(dimension, device):
    a = GRAVITY[:dimension] * 3.0
    bench, x = drop(dimension, velocity=(1.0, 2.0, 3.0)[:dimension], device=device)
    bench.look()
    pressure = 2.0 + x @ a
    bench.put("pressure", pressure)
    bench.put("lasting_gradient", a)
    matrix, right = bench.assemble()
    inside = bench.get("surface") == INSIDE
    assert inside.sum() > 8
    scale = (np.abs(matrix) @ np.abs(pressure))[inside].max()
    assert np.abs(matrix @ np.where(inside, pressure, 0.0) - right)[inside].max() < 1e-13 * scale


@BOTH
@DIMENSIONS
def test_divergence_of_a_linear_flow_is_exact(dimension, precision, device):
    """Source -V tr G spread/(d beta dt) by the corrected divergence; walls through the origin continue u = (a x, b y)."""
    for walls in (False, True):
        x = cloud(dimension)
        gradient, u = linear(x)
        kinds = None
        if walls:
            gradient = np.diag(np.diag(gradient))
            u = x @ gradient.T
            kinds = [FREE_SLIP, NO_WALL] * dimension
        bench = Stages(
            open_spec(dimension, precision), x, spacing=SPACING, fluids=(WATER,), velocity=u, kinds=kinds, lower=0.0,
            upper=2.0, width=300, device=device, **STEP,
        )  # fmt: skip
        bench.look()
        bench.put("velocity_star", u)
        bench.put("pressure", np.zeros(len(x)))  # that of the surface balances its friction
        _, right = bench.assemble()
        inside = (bench.get("surface") == INSIDE) & whole(bench)
        beta = weights(True, STEP["dt"], STEP["last"])[2]
        rate = bench.get("spread") / dimension / (beta * STEP["dt"])
        expected = -rate * np.trace(gradient)
        close = {"rtol": 0, "atol": 10 * EXACT[precision] * np.abs(expected).max()}
        np.testing.assert_allclose(right[inside], expected[inside], **close)
        # relaxed: BDF2 of dD/dt = -D/tau with 1/tau = 2 u_max/h + nu/h^2, tau at least dt
        before, earlier = np.random.default_rng(2).normal(size=(2, len(x)))
        bench.put("dilation", before)
        bench.put("dilation_old", earlier)
        bench.bindings["relaxed"] = 1
        c0, c1, _, omega = weights(True, STEP["dt"], STEP["last"])
        creep = WATER.viscosity / WATER.density / bench.h**2 * STEP["dt"]
        for speed, ratio in ((0.2 * bench.h / STEP["dt"], min(0.4 + creep, 1.0)), (2 * bench.h / STEP["dt"], 1.0)):
            bench.set_clock(SPEED=speed)
            _, right = bench.assemble()
            stays = c0 * before - c1 * earlier - beta * ratio * (before + omega * (before - earlier))
            expected = -rate * (np.trace(gradient) - stays)
            np.testing.assert_allclose(right[inside], expected[inside], **close)


@DIMENSIONS
def test_a_wall_that_moves_towards_the_fluid_compresses_it(dimension, device):
    """An image has the normal velocity mirrored against the wall's; sideways it slips."""
    x = cloud(dimension, jitter=0.0)
    for u, v, moves in ((0.0, 1.0, True), (1.0, 1.0, False), (1.0, 0.0, True)):
        velocity = np.zeros_like(x)
        velocity[:, 0] = u
        velocity[:, 1] = 3.0  # sideways
        walls = np.zeros((2 * dimension, dimension))
        walls[0, 0] = v
        bench = Stages(
            open_spec(dimension), x, spacing=SPACING, velocity=velocity, side_velocity=walls, lower=0.0, upper=2.0,
            width=300, kinds=[NO_SLIP] + [NO_WALL] * (2 * dimension - 1), fluids=(Fluid(viscosity=0.0),), device=device,
        )  # fmt: skip
        bench.look()
        _, right = bench.assemble()
        beside = (bench.get("surface") == INSIDE) & (x[:, 0] < 0.1)
        assert beside.any()
        if moves:  # source = - divergence > 0 where the wall comes nearer
            assert (right[beside] * np.sign(v - u) > 1.0).all()
        else:
            assert np.abs(right[beside]).max() < 1e-10


def pressure_errors(count, device):
    """Return (error of A p/V - lap p, error of the solution) for p = cos cos on a periodic lattice of the unit square."""
    dx = 1.0 / count
    x = lattice((count, count), dx, centre=False)
    bench = Stages(periodic_spec(), x, spacing=dx, fluids=(WATER,), lower=0.0, upper=1.0, device=device)
    bench.look()
    p = np.cos(2 * np.pi * x[:, 0]) * np.cos(2 * np.pi * x[:, 1])
    slope = -2 * np.pi * np.stack(
        [
            np.sin(2 * np.pi * x[:, 0]) * np.cos(2 * np.pi * x[:, 1]),
            np.cos(2 * np.pi * x[:, 0]) * np.sin(2 * np.pi * x[:, 1]),
        ],
        axis=1,
    )
    # (beta dt/rho) grad p, whose divergence is that of p
    bench.put("velocity_star", slope / WATER.density)
    matrix, right = bench.assemble()
    spread = bench.get("spread") / 2
    laplacian = -matrix @ p * WATER.density / spread
    solved = np.linalg.solve(matrix + 1.0 / len(x), right)
    return np.abs(laplacian + 8 * np.pi**2 * p).max() / (8 * np.pi**2), np.abs(solved - p).max()


def test_pressure_equation_converges_with_second_order(device):
    coarse, fine = (np.array(pressure_errors(count, device)) for count in (12, 24))
    order = np.log2(coarse / fine)
    assert (coarse < 0.2).all() and (np.abs(order - 2.0) < 0.25).all()


def test_a_particle_without_neighbours_has_a_row_of_its_own(device):
    """Nothing to solve, and no division by zero."""
    bench = Stages(channel_spec(), [[0.45, 0.4]], spacing=SPACING, lower=0.0, upper=(0.9, 0.8), velocity=1.0, device=device)
    bench.look()
    matrix, right = bench.assemble()
    assert matrix.tolist() == [[1.0]] and right.tolist() == [0.0]


def test_both_layouts_give_the_same():
    """List and matrix row by row, as on a CPU, and column by column, as on a GPU."""
    x = cloud(2)
    found = []
    for rows in (True, False):
        bench = Stages(
            open_spec(row_list=rows), x, spacing=SPACING, kinds=[NO_SLIP, FREE_SLIP, NO_SLIP, NO_WALL], lower=0.0,
            upper=(0.9, 0.8), width=300, fluids=(WATER,), gravity=GRAVITY[:2], velocity=linear(x)[1], surface_depth=0.05,
            pressure=np.sin(20 * x[:, 0]), shifting=16.0, shift_cap=0.05, **STEP,
        )  # fmt: skip
        star = bench.look()
        matrix, right = bench.assemble()
        gradient = bench.gradient(np.cos(20 * x[:, 1]))
        bench.regularise()
        found.append((star, matrix, right, gradient, bench.get("surface"), bench.get("shift"), bench.get("carried")))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * np.abs(one).max())


# pressure taken over ----------------------------------------------------------------------------------------------------


def test_particles_of_the_surface_keep_their_pressure(device):
    bench, x = drop(device=device)
    bench.look()
    inside = bench.get("surface") == INSIDE
    bench.put("pressure", 3.0)
    bench.put("unknown", np.arange(len(x)) + 10.0)
    bench.run(isph.take(bench.spec)[0])
    expected = np.where(inside, np.arange(len(x)) + 10.0, 3.0)
    np.testing.assert_array_equal(bench.get("pressure"), expected)
    state = bench.get("state")
    np.testing.assert_array_equal(state[:, 0], expected)
    np.testing.assert_allclose(state[:, 1], SPACING**2)


@BOTH
@DIMENSIONS
def test_gradient_of_a_linear_pressure_is_exact(dimension, precision, device):
    """Of any in a drop, of the hydrostatic one in a tank with its sides, edges and corners; surfaces included."""
    g = GRAVITY[:dimension]
    for make, a in ((drop, np.array([3.0, -2.0, 5.0])[:dimension]), (tank, WATER.density * g)):
        bench, x = make(dimension, precision, gravity=g, device=device)
        bench.look()
        found = bench.gradient(7.0 + x @ a)
        known = whole(bench)
        assert known.mean() > (0.6 if make is drop else 0.8)
        np.testing.assert_allclose(found[known], np.broadcast_to(a, x.shape)[known], rtol=0, atol=20 * EXACT[precision] * 40)


def test_velocity_is_corrected_by_the_gradient(device):
    """u = u* - beta dt/rho grad p, the old velocity kept, the acceleration and the maxima that limit the next step."""
    random = np.random.default_rng(6)
    x = cloud(2)
    u, star, before = random.normal(size=(3, len(x), 2))
    bench, _ = drop(x=x, velocity=u, device=device, **STEP)
    bench.look()
    pressure = random.normal(size=len(x))
    gradient = bench.gradient(pressure)
    bench.put("pressure_gradient", before * np.linalg.norm(gradient, axis=1, keepdims=True))
    bench.put("velocity_star", star)
    bench.run(isph.take(bench.spec)[1])
    beta = weights(True, STEP["dt"], STEP["last"])[2]
    new = star - beta * STEP["dt"] / WATER.density * gradient
    np.testing.assert_allclose(bench.get("velocity"), new, atol=1e-12)
    np.testing.assert_array_equal(bench.get("velocity_old"), u)
    np.testing.assert_allclose(bench.get("acceleration"), (new - u) / STEP["dt"], atol=1e-10)
    np.testing.assert_allclose(bench.get("pressure_gradient"), gradient, atol=1e-12)
    maxima = bench.bindings["maxima"].numpy()
    assert maxima[0] == pytest.approx((new**2).sum(axis=1).max())
    assert maxima[1] == pytest.approx((((new - u) / STEP["dt"]) ** 2).sum(axis=1).max())
    # what lasts: along the new gradient, as long as the shorter of both, nothing if they oppose
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    ratio = np.minimum(1.0, np.linalg.norm(before, axis=1, keepdims=True))
    agree = (gradient * before).sum(axis=1, keepdims=True) > 0
    assert 5 < agree.sum() < len(x) - 5 and (length > 0).all()
    np.testing.assert_allclose(bench.get("lasting_gradient"), np.where(agree, gradient * ratio, 0.0), atol=1e-12)


def test_conservative_gradient_keeps_the_momentum(device):
    """The printed form: the forces of any pressure add up to zero."""
    x = cloud(2)
    spec = periodic_spec(corrected=False, second_order=False)
    bench = Stages(spec, x, spacing=SPACING, lower=0.0, upper=(0.9, 0.8), device=device)
    bench.look()
    found = bench.gradient(np.random.default_rng(1).normal(size=len(x)))
    assert np.abs(found).max() > 1.0
    assert np.abs(found.sum(axis=0)).max() < 1e-11 * np.abs(found).sum()


# positions --------------------------------------------------------------------------------------------------------------


@BOTH
def test_particles_move_with_the_velocity_extrapolated(precision, device):
    """x + dt [(1 + omega/2) u - omega/2 u_old] + shift, and both velocities take what belongs to the shift."""
    random = np.random.default_rng(8)
    x = cloud(2)
    u, old, shift, carried = random.normal(size=(4, len(x), 2)) * 0.1
    bench, _ = drop(precision=precision, x=x, velocity=u, velocity_old=old, device=device, **STEP)
    bench.put("shift", shift * 0.01)
    bench.put("carried", carried)
    bench.move()
    way = STEP["dt"] * (1.625 * u - 0.625 * old) + 0.01 * shift
    close = {"rtol": 0, "atol": EXACT[precision] / 10}
    np.testing.assert_allclose(bench.get("position")[: len(x)], x + way, **close)
    np.testing.assert_allclose(bench.get("velocity")[: len(x)], u + carried, **close)
    np.testing.assert_allclose(bench.get("velocity_old"), old + carried, **close)
    assert bench.bindings["faults"].numpy()[0] == ck.NO_PARTICLE


def test_printed_scheme_ends_with_the_mean_velocity(device):
    """x* = x + dt u, then x = x + dt (u + u_new)/2."""
    random = np.random.default_rng(9)
    x = cloud(2)
    u, new = random.normal(size=(2, len(x), 2))
    spec = periodic_spec(corrected=False, second_order=False)
    bench = Stages(spec, x, spacing=SPACING, velocity=u, device=device, **STEP)
    bench.move()
    np.testing.assert_allclose(bench.get("position"), x + STEP["dt"] * u, atol=1e-13)
    bench.put("velocity", new)
    bench.put("velocity_old", u)
    bench.run(next(stage for stage in isph.finish(spec) if stage.name == "settle"))
    np.testing.assert_allclose(bench.get("position"), x + STEP["dt"] * 0.5 * (u + new), atol=1e-13)


@DIMENSIONS
def test_a_wall_stops_what_has_no_pressure(dimension, device):
    """A particle that would come nearer than CLOSEST stands there; it may leave the wall, and slide along it."""
    x = np.full((3, dimension), 0.5)
    x[:, 1] = 0.3, 0.5, 0.7
    x[0, 0], x[1, 0], x[2, 0] = 0.06, 0.94, 0.06
    u = np.zeros_like(x)
    u[:, 0] = -3.0, 3.0, 4.0
    u[:, 1] = 1.0
    bench = Stages(
        open_spec(dimension), x, spacing=SPACING, kinds=[NO_SLIP, NO_SLIP] + [NO_WALL] * (2 * dimension - 2), velocity=u,
        lower=0.0, upper=1.0, dt=0.02, device=device,
    )  # fmt: skip
    bench.move()
    moved, velocity = bench.get("position"), bench.get("velocity")
    np.testing.assert_allclose(moved[:, 0], [CLOSEST * SPACING, 1.0 - CLOSEST * SPACING, 0.14], atol=1e-14)
    np.testing.assert_allclose(moved[:, 1], x[:, 1] + 0.02, atol=1e-14)
    for name in ("velocity", "velocity_old"):
        np.testing.assert_array_equal(bench.get(name)[:, 0], [0.0, 0.0, 4.0])
    np.testing.assert_array_equal(velocity[:, 1], 1.0)


@pytest.mark.parametrize("bad", ["nan", "infinite", "runaway"])
def test_a_runaway_particle_is_reported(bad, device):
    x = cloud(2)
    u = np.zeros_like(x)
    u[17, 1] = {"nan": np.nan, "infinite": np.inf, "runaway": 101.0}[bad]
    bench, _ = drop(x=x, velocity=u, device=device)
    bench.look()
    row = int(bench.bindings["faults"].numpy()[0])
    assert row != ck.NO_PARTICLE
    assert bench.particles.get("particle_id")[row] == 17  # the row it has after the sort
    bench, _ = drop(x=x, velocity=0.1, device=device)
    bench.look()
    assert bench.bindings["faults"].numpy()[0] == ck.NO_PARTICLE


# shift ------------------------------------------------------------------------------------------------------------------


@DIMENSIONS
def test_shift_evens_out_and_keeps_a_linear_flow(dimension, device):
    """A particle carries the velocity of where it goes, its old velocity too; the divergence left over is measured."""
    x = cloud(dimension)
    gradient, u = linear(x)
    bench, _ = drop(dimension, x=x, velocity=u, shifting=16.0, shift_cap=0.05, dt=0.01, device=device)
    bench.look()
    bench.set_clock(SPEED=1e3)
    bench.regularise()
    known = whole(bench)
    shift, carried = bench.get("shift"), bench.get("carried")
    still = np.linalg.norm(shift, axis=1) < 1e-6 * SPACING
    assert still.mean() < 0.2
    # what lies ahead of a linear flow, but next to the surface no faster than the fastest of the neighbours
    surface = bench.get("surface")
    near = np.array([(np.linalg.norm(x - p, axis=1) < bench.support)[surface != INSIDE].any() for p in x])
    change = shift @ gradient.T
    size = np.linalg.norm(change, axis=1)
    for i in np.flatnonzero(near & (size > 0)):
        around = np.linalg.norm(x - x[i], axis=1) < bench.support
        most = ((u[around] - u[i]) @ change[i] / size[i]).max()
        change[i] *= min(1.0, most / size[i])
    bound = near & known & (np.linalg.norm(change, axis=1) < size - 1e-9)
    assert (bound.any() or dimension == 3) and (near & known & ~bound).any()
    np.testing.assert_allclose(carried[known], change[known], atol=1e-12)
    np.testing.assert_allclose(bench.get("dilation")[known], np.trace(gradient), atol=1e-10)
    # of the length of the way, and no longer than the cap
    inner = interior(x, 2.2) & known
    strain = np.linalg.norm(0.5 * (gradient + gradient.T))  # away from the surface what turns as a whole is left alone
    free = -16.0 * strain * 0.01 * bench.h**2 * bench.get("crowding")
    length = np.linalg.norm(free, axis=1, keepdims=True)
    capped = free * np.minimum(1.0, 0.05 * bench.h / length)
    assert np.linalg.norm(shift, axis=1).max() < 0.0501 * bench.h
    assert not (inner & ~near).any() or np.allclose(shift[inner & ~near], capped[inner & ~near], atol=1e-13)
    bench.set_clock(STEP=0.0)
    bench.move()
    now = bench.get("position")
    kept = known & ~bound
    np.testing.assert_allclose((bench.get("velocity") - u)[kept], ((now - x) @ gradient.T)[kept], atol=1e-12)
    # a divergence beyond u_max/h is no measurement
    bench.set_clock(SPEED=1e-3)
    bench.put("velocity", u)
    bench.regularise()
    assert np.abs(bench.get("dilation")).max() <= 1.0001e-3 / bench.h


def test_shift_lowers_the_unevenness(device):
    """sum grad W V of a disordered periodic lattice falls, step by step."""
    x = lattice((10, 10), SPACING, jitter=0.25, seed=2, centre=False)
    bench = Stages(
        periodic_spec(), x, spacing=SPACING, lower=0.0, upper=1.0, shifting=16.0, shift_cap=0.05, dt=0.003, device=device
    )

    def unevenness():
        return np.linalg.norm(sum(np.einsum("ij,ija->ia", f, d) for _, d, f in bench.pairs()))

    found = [unevenness()]
    for _ in range(8):
        at = bench.get("position")
        bench.put("velocity", 0.5 * np.stack([np.sin(2 * np.pi * at[:, 1]), np.sin(2 * np.pi * at[:, 0])], axis=1))
        bench.look()
        bench.regularise()
        for name in ("velocity", "velocity_old", "carried"):
            bench.put(name, 0.0)
        bench.move()
        found.append(unevenness())
    assert (np.diff(found) < 0).all() and found[-1] < 0.6 * found[0]


@DIMENSIONS
def test_shift_is_tangential_at_a_surface(dimension, device):
    """Along the mean normal of the surface near by there is a push off near ones alone; isolated ones do not shift."""
    x = np.concatenate([cloud(dimension), np.full((1, dimension), 3.0)])
    gradient, u = linear(x)
    bench, _ = drop(dimension, x=x, velocity=u, shifting=16.0, shift_cap=0.05, dt=0.01, device=device)
    bench.look()
    bench.regularise()
    shift, surface, normals = bench.get("shift"), bench.get("surface"), bench.get("surface_normal")
    assert surface[-1] == ISOLATED and (shift[-1] == 0.0).all()
    q = np.linalg.norm(x[:, None] - x[None], axis=-1) / bench.h
    w = np.clip(2.0 - q, 0, None) ** 4 * (1 + 2 * q)
    mean = w @ np.where((surface != INSIDE)[:, None], normals, 0.0)
    length = np.linalg.norm(mean, axis=1)
    near = length > 1e-3 * 16
    assert near.mean() > 0.5
    normal = mean[near] / length[near][:, None]
    along = (shift[near] * normal).sum(axis=1)
    apart = x[:, None] - x[None]
    r = np.linalg.norm(apart, axis=-1)
    close = np.where((r > 0) & (r < CROWDED * SPACING), 1.0 - r / (CROWDED * SPACING), 0.0)
    pushed = np.einsum("ij,ija->ia", close / np.where(r > 0, r, 1.0), apart)
    strength = np.minimum(np.linalg.norm(gradient) * 0.01, MOST_PUSH)
    expected = 0.25 * 16.0 * strength * SPACING * (pushed[near] * normal).sum(axis=1)
    uncapped = (np.linalg.norm(shift[near], axis=1) < 0.0499 * bench.h) & whole(bench)[near]
    assert uncapped.any() and np.abs(expected[uncapped]).max() > 1e-3 * SPACING
    np.testing.assert_allclose(along[uncapped], expected[uncapped], rtol=0, atol=1e-10 * SPACING)
    assert np.linalg.norm(shift[near], axis=1).mean() > 1e-4 * SPACING


@DIMENSIONS
def test_even_rows_at_a_surface_are_not_pushed(dimension, device):
    """Neighbours that are missing outside push nobody: a lattice does not shift along the normal of a flat side."""
    x = lattice((13, 8) if dimension == 2 else (9, 9, 6), SPACING, 0.0, 1, centre=False)
    _, u = linear(x)
    bench, _ = drop(dimension, x=x, velocity=u, shifting=16.0, shift_cap=0.05, dt=0.01, device=device)
    bench.look()
    bench.regularise()
    middle = (np.abs(x - x.mean(axis=0))[:, :-1] < 0.6 * SPACING).all(axis=1)
    flat = middle & (np.abs(x[:, -1] - x[:, -1].max()) < 0.1 * SPACING)
    assert flat.any() and np.abs(bench.get("shift")[flat, -1]).max() < 1e-9 * SPACING


# collisions -------------------------------------------------------------------------------------------------------------


@BOTH
@DIMENSIONS
def test_collisions_keep_the_momentum(dimension, precision, device):
    """Particles nearer than CONTACT lose the speed of their approach and nothing else."""
    x = np.zeros((7, dimension))
    x[1, 0] = 0.9 * CONTACT * SPACING  # comes nearer
    x[2:4, 1] = 1.0, 1.0 + 0.9 * CONTACT * SPACING  # goes away
    x[4:6, 1] = 2.0, 2.0 + 1.1 * CONTACT * SPACING  # comes nearer, but is not there yet
    x[6] = 5.0
    u = np.zeros_like(x)
    u[0, 0], u[1, 0], u[1, 1] = 2.0, -1.0, 0.7
    u[2, 1], u[3, 1] = -1.0, 1.0
    u[4, 1], u[5, 1] = 1.0, -1.0
    bench, _ = drop(dimension, precision, x=x, velocity=u, device=device)
    bench.look()
    bench.regularise()
    expected = np.zeros_like(x)
    expected[0, 0], expected[1, 0] = -1.5, 1.5
    np.testing.assert_allclose(bench.get("carried"), expected, rtol=0, atol=10 * EXACT[precision])


@DIMENSIONS
def test_a_crowd_of_collisions_keeps_the_momentum(dimension, device):
    random = np.random.default_rng(10)
    x = random.uniform(-0.5, 0.5, size=(6, dimension)) * SPACING
    u = -20.0 * x + random.normal(size=x.shape)
    bench, _ = drop(dimension, x=x, velocity=u, shifting=0.0, device=device)
    bench.look()
    bench.regularise()
    carried = bench.get("carried")
    assert np.abs(carried).max() > 0.1
    assert np.abs(carried.sum(axis=0)).max() < 1e-13
    torque = np.einsum("ia,ib->ab", x, carried)
    assert np.abs(torque - torque.T).max() < 1e-13
    pairs = [(i, j) for i, j in itertools.combinations(range(6), 2) if np.linalg.norm(x[i] - x[j]) < CONTACT * SPACING]
    assert len(pairs) > 2


def test_a_particle_hits_its_image_as_a_wall(device):
    """At 0.2 spacings off a wall the normal velocity goes, the tangential one stays."""
    bench = Stages(
        open_spec(), [[0.5, 0.02]], spacing=SPACING, kinds=[NO_WALL, NO_WALL, NO_SLIP, NO_WALL], lower=0.0, upper=1.0,
        velocity=(1.0, -3.0), device=device,
    )  # fmt: skip
    bench.look()
    bench.regularise()
    np.testing.assert_allclose(bench.get("carried"), [[0.0, 3.0]], atol=1e-12)


def test_specs_of_the_bench_are_those_of_runs():
    """The scenes of this file share their kernels with those of whole runs, and so test what runs."""
    assert spec_of(SCENES["tank"]) == open_spec()
    assert spec_of(SCENES["vortices"]) == periodic_spec()
    assert spec_of(SCENES["couette"]) == channel_spec()
    assert codes_of(Stages(open_spec(), [[0.0, 0.0]], spacing=1.0).kinds) == [0]
    assert dataclasses.replace(open_spec(), dimension=3, periodic=(False,) * 3) == open_spec(3)


@pytest.mark.parametrize("free", [True, False])
def test_a_free_fluid_holds_little_tension(free, device):
    """-0.5 rho u_max^2 is the least pressure with a free surface; a closed box knows its pressure up to a constant."""
    x = cloud(2)
    spec = open_spec(2, "float64") if free else dataclasses.replace(open_spec(2, "float64"), free_surface=False)
    bench = Stages(
        spec, x, spacing=SPACING, fluids=(WATER,), velocity=np.zeros_like(x), lower=0.0, upper=2.0, width=300, device=device,
        **STEP,
    )  # fmt: skip
    bench.look()
    bench.set_clock(SPEED=2.0)
    wanted = np.linspace(-5.0, 5.0, len(x)) * WATER.density
    bench.put("unknown", wanted)
    bench.put("pressure", 7.0)
    accept, _ = isph.take(spec)
    bench.run(accept)
    inside = bench.get("surface") == INSIDE
    least = -0.5 * WATER.density * 4.0 if free else -np.inf
    rows = inside if free else np.ones(len(x), dtype=bool)
    np.testing.assert_allclose(bench.get("pressure")[rows], np.maximum(wanted, least)[rows])
    if free:
        assert (wanted[inside] < least).any() and (bench.get("pressure")[~inside] == 7.0).all()


@pytest.mark.parametrize("share", [0.9, 0.99, 1.01, 1.1])
def test_what_is_too_dense_is_let_go(share, device):
    """The source asks for a divergence of feedback u/h (excess E beyond 1 %), away from a surface alone."""
    x = lattice((13, 12), SPACING, 0.0, 1, centre=False)
    bench, _ = drop(x=x, velocity=0.0, device=device)
    bench.look()
    bench.set_clock(SPEED=3.0)
    params = bench.bindings["params"]
    volume = bench.get("rest_volume")
    speed, feedback = 3.0, 0.1
    params.feedback = 0.0
    _, without = bench.assemble()
    bench.put("rest_volume", volume * share)
    params.wall_volume = params.wall_volume * share  # so that nothing else in the source changes
    params.feedback = feedback
    _, right = bench.assemble()
    around = np.linalg.norm(np.mgrid[-3:4, -3:4].reshape(2, -1), axis=0) * SPACING / bench.support
    lattice_excess = (np.clip(1.0 - around**2, 0, None) ** 2).sum() * SPACING**2 / window_integral(2, bench.support) - 1.0
    assert abs(lattice_excess) < 0.003
    excess = (1.0 + lattice_excess) * share - 1.0
    excess -= np.clip(excess, -UNSURE, UNSURE)
    dt, last = (float(bench.clock_array.numpy()[k]) for k in (ck.STEP, ck.LAST_STEP))
    beta = weights(bench.spec.second_order, dt, last)[2]
    surface = x[bench.get("surface") != INSIDE]
    apart = np.linalg.norm(x[:, None] - surface[None], axis=2).min(axis=1)
    far, near = apart > 2.01 * bench.h, (apart < 1.9 * bench.h) & (bench.get("surface") == INSIDE)
    assert far.sum() > 8 and near.sum() > 8
    expected = bench.get("spread") / 2 * feedback * speed / bench.h * excess / (beta * dt)
    np.testing.assert_allclose((right - without)[far], expected[far], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose((right - without)[near], 0.0, atol=1e-9)


@DIMENSIONS
def test_window_of_the_density(dimension):
    """The integral of (1 - r^2/R^2)^2 over a ball, by quadrature; points at random see the number density without bias."""
    n = 60
    edge = (np.arange(n) + 0.5) / n * 2 - 1
    square = sum(axis**2 for axis in np.meshgrid(*[edge] * dimension))
    volume = (np.clip(1 - square, 0, None) ** 2).sum() * (2 / n) ** dimension
    assert window_integral(dimension, 0.3) == pytest.approx(volume * 0.3**dimension, rel=1e-3)


@DIMENSIONS
def test_shares_of_rows(dimension, device):
    """The spread of the two outermost rows of a lattice is what the depth of a surface is judged by."""
    x = lattice((13, 13) if dimension == 2 else (9, 9, 9), SPACING, 0.0, 1, centre=False)
    bench, _ = drop(dimension, x=x, device=device)
    bench.look()
    middle = (np.abs(x - x.mean(axis=0))[:, :-1] < 0.6 * SPACING).all(axis=1)
    top = x[:, -1].max()
    for row, share in enumerate(row_shares(bench.spec, bench.h / SPACING)):
        found = bench.get("company")[middle & (np.abs(x[:, -1] - top + row * SPACING) < 0.1 * SPACING)] / dimension
        np.testing.assert_allclose(found, share, rtol=1e-6)
