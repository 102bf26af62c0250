"""`scripts/oscillating_drop_exact.py`: the pieces of a finite-element solution of a drop that swings."""

import numpy as np
import pytest

from tests.scripts import load_script


@pytest.fixture(scope="module")
def script():
    return load_script("oscillating_drop_exact")


def fan(script, stretch, count):
    """A mesh of an ellipse without a mesh generator: triangles from the centre to `count` curved edges."""
    angle = 2 * np.pi * np.arange(count) / count
    between = angle + np.pi / count
    at = [np.stack([stretch * np.cos(a), np.sin(a) / stretch], axis=1) for a in (angle, between)]
    vertices = np.vstack([[[0.0, 0.0]], at[0]])
    nodes = np.vstack([vertices, at[1], at[0] / 2])
    k = np.arange(count)
    following = (k + 1) % count
    elements = np.stack([0 * k, 1 + k, 1 + following, 1 + 2 * count + k, 1 + count + k, 1 + 2 * count + following], axis=1)
    surface = np.stack([1 + k, 1 + count + k], axis=1).ravel()
    return script.Mesh(nodes, elements, count + 1, surface, surface[:: count // 2][:4])


def test_tension_of_a_circle_is_its_curvature(script):
    """Forces sum to zero, do the work -(length) with the displacement x, and balance a pressure of 1/R."""
    mesh = fan(script, 1.0, 64)
    force, length = script.tension(mesh, mesh.nodes)
    assert length == pytest.approx(2 * np.pi, rel=1e-6)
    np.testing.assert_allclose(force.sum(axis=0), 0, atol=1e-12)
    assert (force * mesh.nodes).sum() == pytest.approx(-length, rel=1e-12)
    forms = script.Forms(mesh, mesh.nodes)
    pressure = np.stack([d @ np.ones(mesh.vertices) for d in forms.divergence], axis=1)
    np.testing.assert_allclose(pressure + force, 0, atol=2e-3 * np.abs(force).max())


def test_stiffness_is_what_tension_answers_across_the_surface(script):
    """Of a stretched edge tension stays 1: the stiffness has more, but what it adds is not negative for any displacement."""
    mesh = fan(script, 1.2, 32)
    rng = np.random.default_rng(1)
    change = np.zeros_like(mesh.nodes)
    change[mesh.surface] = rng.normal(size=(len(mesh.surface), 2))
    more, less = (script.tension(mesh, mesh.nodes + small * change)[0] for small in (1e-6, -1e-6))
    answer = (more - less) / 2e-6
    stiff = script.stiffness(mesh, mesh.nodes)
    taken, given = (change * (stiff @ change)).sum(), -(change * answer).sum()
    assert 0 < given < taken


def test_semi_axes_of_an_ellipse(script):
    mesh = fan(script, 1.3, 128)
    assert script.semi_axes(script.Forms(mesh, mesh.nodes)) == pytest.approx((1.3, 1 / 1.3), rel=1e-6)


@pytest.mark.parametrize("mode", [2, 3])
def test_linear_mode_without_much_friction_is_that_of_lamb(script, mode):
    """s = -2 n (n - 1) mu + i sqrt(n (n^2 - 1)), to the order mu^(3/2) of the vortical layer."""
    off = []
    for ohnesorge in (1e-3, 1e-4):
        found = script.linear_mode(ohnesorge, mode)
        lamb = complex(-2 * mode * (mode - 1) * ohnesorge, (mode * (mode**2 - 1)) ** 0.5)
        assert found.real == pytest.approx(lamb.real, rel=0.15)
        off.append(abs(found - lamb))
    assert off[0] / off[1] == pytest.approx(10**1.5, rel=0.15)


def test_a_small_swing_has_the_rate_of_the_linear_mode(script, monkeypatch):
    """After the first half swing, which vorticity takes to come in, with one triangle from the centre to the surface."""
    monkeypatch.setattr(script, "ellipse_mesh", lambda stretch, size: fan(script, stretch, 24))
    table = script.run(0.1, 1.01, 1.0, 0.04, 5.2)
    exact = script.linear_mode(0.1)
    swing = table[:, 1] - table[:, 2]
    crossings = [np.interp(0, swing[[k + 1, k]], table[[k + 1, k], 0]) if swing[k] > 0
                 else np.interp(0, swing[[k, k + 1]], table[[k, k + 1], 0])
                 for k in range(len(swing) - 1) if swing[k] * swing[k + 1] < 0]
    assert len(crossings) == 4
    assert (crossings[3] - crossings[1]) == pytest.approx(2 * np.pi / exact.imag, rel=0.02)
    lows = [swing[(table[:, 0] > crossings[k]) & (table[:, 0] < crossings[k + 1])].min() for k in (0, 2)]
    assert np.log(lows[0] / lows[1]) == pytest.approx(-exact.real * 2 * np.pi / exact.imag, rel=0.15)
