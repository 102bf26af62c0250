"""Fits of a quadratic about a point with particles on one side: slopes through a known value, and a value not known."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.core.quadratic import make_quadratic


def fitted(dimension, points, weights, field):
    """The value at 0 of a quadratic through `field` at the points, and the slopes of one through the value there."""
    fit = make_quadratic(dimension)
    vec = wp.types.vector(length=dimension, dtype=wp.float64)
    square, sides, vector = fit.square, fit.sides, fit.vector
    basis, solve, value_of = fit.basis, fit.solve, fit.value

    @wp.kernel(module="unique", enable_backward=False)
    def whole(
        r: wp.array(dtype=vec),
        w: wp.array(dtype=wp.float64),
        u: wp.array(dtype=wp.float64),
        at: wp.float64,
        result: wp.array(dtype=wp.float64),
        slopes: wp.array(dtype=wp.float64),
    ):
        normal, first, right, rows = square(), vector(), vector(), sides()
        weight, total = wp.float64(0.0), wp.float64(0.0)
        for k in range(r.shape[0]):
            terms = w[k] * basis(r[k])
            normal += wp.outer(basis(r[k]), terms)
            first += terms
            right += u[k] * terms
            for a in range(wp.static(fit.terms)):
                rows[a, 0] = rows[a, 0] + (u[k] - at) * terms[a]
            weight += w[k]
            total += w[k] * u[k]
        found, value = value_of(normal, first, weight, right, total)
        known, x = solve(normal, rows)
        result[0] = wp.where(found, value, wp.float64(wp.nan))
        for a in range(wp.static(dimension)):
            slopes[a] = wp.where(known, x[a, 0], wp.float64(wp.nan))

    result = wp.zeros(1, dtype=wp.float64, device="cpu")
    slopes = wp.zeros(dimension, dtype=wp.float64, device="cpu")
    inputs = [wp.array(points, dtype=vec, device="cpu"), wp.array(weights, dtype=wp.float64, device="cpu")]
    values = wp.array(field(points), dtype=wp.float64, device="cpu")
    at = float(field(np.zeros((1, dimension)))[0])
    wp.launch(whole, 1, inputs=[*inputs, values, at], outputs=[result, slopes], device="cpu")
    return result.numpy()[0], slopes.numpy()


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_quadratic_is_met_exactly_from_one_side(dimension):
    rng = np.random.default_rng(5)
    points = rng.uniform(-1, 1, (40, dimension)) * 1.5
    points[:, -1] = np.abs(points[:, -1])
    bend = rng.normal(size=(dimension, dimension))
    slope = rng.normal(size=dimension)
    value, slopes = fitted(
        dimension,
        points,
        rng.uniform(0.1, 1, 40),
        lambda x: 3.0 + x @ slope + np.einsum("ka,ab,kb->k", x, bend, x),
    )
    assert value == pytest.approx(3.0, abs=1e-10)
    np.testing.assert_allclose(slopes, slope, atol=1e-10)


def test_too_few_points_are_no_fit():
    points = np.array([[0.1, 0.2], [0.5, 0.3], [-0.4, 0.6]])
    value, slopes = fitted(2, points, np.ones(3), lambda x: x[:, 0])
    assert np.isnan(value)
    assert np.isnan(slopes).all()
