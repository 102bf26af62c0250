"""Values at points of a gas with shocks: in the range of the particles around, of second order where it is smooth."""

import numpy as np
import pytest

from warpsph.measure.probes import sample
from warpsph.snapshot import Snapshot

RATIO = 1.2  # smoothing length over spacing


def gas(dimension, count, field, noise=0.0):
    """A disordered gas in a unit box with a density that is a function of the positions (n, d), and as pressure too."""
    spacing = 1.0 / count
    axes = np.meshgrid(*[(np.arange(count) + 0.5) * spacing] * dimension, indexing="ij")
    x = np.stack(axes, axis=-1).reshape(-1, dimension)
    x += noise * spacing * np.random.default_rng(1).uniform(-1, 1, x.shape)
    n = len(x)
    values = field(x)
    ids = np.arange(n, dtype=np.int64)
    nothing = np.zeros(n)
    return Snapshot(
        time=0.0, step=0, dt=0.0, dimension=dimension, position=x, velocity=np.zeros_like(x), density=values,
        pressure=values.copy(), mass=nothing + 1.0, volume=np.full(n, spacing**dimension), phase=np.zeros(n, np.int32),
        particle_id=ids, kind=np.zeros(n, np.uint8), particle_spacing=spacing,
        own={"smoothing": np.full(n, RATIO * spacing)},
    )  # fmt: skip


def density_at(snapshot, points):
    """As the gauges of a gas ask for it."""
    box = [0.0] * snapshot.dimension
    return sample(snapshot, points, ["density"], 2.0 * RATIO * snapshot.particle_spacing, box, reach=2.0)["density"]


@pytest.mark.parametrize("dimension, count", [(1, 100), (2, 30)])
def test_a_line_through_a_shock_stays_in_the_range(dimension, count):
    """Of 1000 to 1: a fit would swing to -100 ahead of it."""
    snapshot = gas(dimension, count, lambda x: np.where(x[:, 0] < 0.5, 1000.0, 1.0), 0.2)
    points = np.full((400, dimension), 0.5)
    points[:, 0] = np.linspace(0.1, 0.9, 400)
    found = density_at(snapshot, points)
    assert found.min() >= 1.0 and found.max() <= 1000.0
    # it is still a shock: three spacings away nothing is seen of it
    away = np.abs(points[:, 0] - 0.5) > 3.5 / count
    np.testing.assert_allclose(found[away], np.where(points[away, 0] < 0.5, 1000.0, 1.0), rtol=1e-12)


@pytest.mark.parametrize("dimension, counts", [(1, (40, 80, 160)), (2, (12, 24, 48))])
def test_a_smooth_field_keeps_its_order(dimension, counts):
    """Second order at least, with extremes inside, in 2-D up to the edges; a line of particles has too few there."""

    def field(x):
        return 2.0 + np.cos(2 * np.pi * x[:, 0]) + x[:, -1]

    points = np.random.default_rng(2).uniform(0.0, 1.0, (300, dimension))
    edge = 2.5 / counts[0] if dimension == 1 else 0.0
    points[:, 0] = np.linspace(edge, 1.0 - edge, 300)
    errors = [np.abs(density_at(gas(dimension, n, field), points) - field(points)).max() for n in counts]
    assert errors[0] / errors[1] > 2**1.6 and errors[1] / errors[2] > 2**1.6, errors


def test_a_linear_field_is_exact_up_to_the_edge():
    """The bound at an edge leaves what a straight line through the particles says there."""
    points = np.column_stack([np.linspace(0.0, 1.0, 101), np.full(101, 0.31)])
    found = density_at(gas(2, 20, lambda x: 1.0 + 3.0 * x[:, 0]), points)
    np.testing.assert_allclose(found, 1.0 + 3.0 * points[:, 0], rtol=1e-9)
