"""Smoothing of the velocity of a fluid with a free surface by central forces between pairs (theory: isph#b6)."""

import numpy as np
import pytest

from tests.helpers import lattice
from tests.projection import INSIDE, Stages, open_spec
from warpsph.kernels.core.mirror import FREE_SLIP, NO_WALL
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.isph.regularise import MOST_FILTER

SPACING = 0.1
DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3])


def patch(dimension, jitter=0.15):
    """A disordered block of particles whose sides are free."""
    return lattice((11, 9) if dimension == 2 else (7, 7, 6), SPACING, jitter, 3, centre=False)


def smoothed(x, u, device, rate=1.0, dt=0.01, **options):
    """Return the bench after the stages: without a shift and without contacts all that is carried is smoothing."""
    settings = {"shifting": 0.0, "shift_cap": 0.05, "dt": dt, "device": device, **options}
    bench = Stages(open_spec(x.shape[1]), x, spacing=SPACING, velocity=u, width=500, **settings)
    bench.bindings["params"].filter = rate
    bench.look()
    bench.regularise()
    return bench


def expected(bench, u):
    """The sum over pairs and images, from the gradients and rates that the first of both stages has left."""
    gradient, rate = bench.get("velocity_gradient"), bench.get("smoothing")
    total = np.zeros_like(u)
    dimension = u.shape[1]
    scale = dimension * KERNELS["wendland_c2"].alpha[dimension - 1] / bench.h**dimension
    for code, d, _ in bench.pairs():
        sign = np.where([(code >> (2 * axis)) & 3 for axis in range(u.shape[1])], -1.0, 1.0)
        mirrored = sign[:, None] * gradient * sign
        mean = 0.5 * (gradient[:, None] + mirrored[None])
        deviation = (u * sign)[None] - u[:, None] + np.einsum("ijab,ijb->ija", mean, d)
        r = np.linalg.norm(d, axis=-1)
        q = r / bench.h
        weight = scale * bench.get("rest_volume")[None] * np.clip(2.0 - q, 0, None) ** 4 * (1.0 + 2.0 * q)
        e = d / np.where(r > 0.0, r, 1.0)[..., None]
        strength = weight * 0.5 * (rate[:, None] + rate[None]) * (e * deviation).sum(axis=-1)
        total += (strength[..., None] * e).sum(axis=1)
    return total


@DIMENSIONS
@pytest.mark.parametrize("wall", [False, True], ids=["free", "wall"])
def test_is_the_sum_over_pairs(dimension, wall, device):
    """Any velocity, next to a surface and not, with and without images behind a wall."""
    x = patch(dimension)
    u = np.random.default_rng(5).normal(size=x.shape)
    kinds = [NO_WALL] * (2 * dimension)
    options = {}
    if wall:
        kinds[2] = FREE_SLIP
        options = {"kinds": kinds, "lower": x.min(axis=0) - 0.5 * SPACING, "upper": x.max(axis=0) + 10 * SPACING}
    bench = smoothed(x, u, device, **options)
    change = bench.get("carried")
    # the stage adds (1e-6 h)^2 to r^2: 1e-11 of a pair at 0.3 h
    np.testing.assert_allclose(change, expected(bench, u), rtol=0, atol=1e-10 * np.abs(change).max())
    assert np.linalg.norm(change, axis=1).max() > 1e-3


@DIMENSIONS
def test_conserves_both_momenta(dimension, device):
    """A free body: neither its momentum nor its angular momentum changes, by rounding alone; its energy falls."""
    x = patch(dimension)
    u = np.random.default_rng(5).normal(size=x.shape) + 3.0
    bench = smoothed(x, u, device, dt=1e-3)
    change = bench.get("carried")
    scale = np.abs(change).sum()
    assert scale > 0.0 and np.abs(change.sum(axis=0)).max() < 1e-13 * scale
    arm = x - x.mean(axis=0)
    turning = np.einsum("ia,ib->ab", arm, change)
    assert np.abs(turning - turning.T).max() < 1e-13 * scale
    assert (u * change).sum() < 0.0


@DIMENSIONS
def test_leaves_a_linear_flow(dimension, device):
    """Wherever the gradients of a neighbourhood are exact."""
    x = patch(dimension)
    gradient = np.random.default_rng(2).normal(size=(dimension, dimension))
    bench = smoothed(x, x @ gradient.T, device)
    exact = np.abs(bench.get("velocity_gradient") - gradient).max(axis=(1, 2)) < 1e-10
    # particles all of whose neighbours have it
    whole = np.array([exact[np.linalg.norm(x - p, axis=1) < bench.support].all() for p in x])
    assert whole.any() and bench.get("smoothing")[whole].max() > 0.0
    np.testing.assert_allclose(bench.get("carried")[whole], 0.0, atol=1e-12)


@DIMENSIONS
def test_acts_at_the_rate_of_the_flow(dimension, device):
    """The rate is f |grad u| dt, at most a half, next to a surface and away from it; none with f = 0."""
    x = lattice((15, 15) if dimension == 2 else (11, 11, 11), SPACING, 0.05, 3, centre=False)
    gradient = np.diag(np.arange(1.0, dimension + 1.0))
    gradient -= np.eye(dimension) * np.trace(gradient) / dimension
    bench = smoothed(x, x @ gradient.T, device, rate=0.5)
    rate, surface = bench.get("smoothing"), bench.get("surface")
    found = np.linalg.norm(bench.get("velocity_gradient"), axis=(1, 2))
    far = np.array([(surface[np.linalg.norm(x - p, axis=1) < bench.support] == INSIDE).all() for p in x])
    assert far.any() and (surface != INSIDE).any()
    np.testing.assert_allclose(rate, 0.5 * 0.01 * found, rtol=1e-12)
    bench = smoothed(x, x @ gradient.T, device, dt=10.0)
    assert bench.get("smoothing").max() == MOST_FILTER
    assert (smoothed(x, x @ gradient.T, device, rate=0.0).get("carried") == 0.0).all()


def test_leaves_a_quadratic_flow(device):
    """On an even arrangement, far from the surface: half the sum of both gradients is that of the chord of a parabola."""
    x = lattice((19, 19), SPACING, 0.0, 3, centre=False)
    u = np.stack([x[:, 1] ** 2 + x[:, 0] * x[:, 1], x[:, 0] ** 2 - 2.0 * x[:, 0] * x[:, 1]], axis=1)
    bench = smoothed(x, u, device)
    # gradients of a quadratic field are exact on whole neighbourhoods, which all of a particle's neighbours have to have
    inner = (np.abs(x - x.mean(axis=0)) < 0.5 * 18 * SPACING - 2.0 * bench.support - SPACING).all(axis=1)
    assert inner.sum() >= 1 and bench.get("smoothing")[inner].min() > 0.0
    noise = np.random.default_rng(1).normal(size=u.shape) * 1e-3
    rough = smoothed(x, u + noise, device).get("carried")[inner]
    assert np.abs(bench.get("carried")[inner]).max() < 1e-12 < 1e-7 < np.abs(rough).max()
