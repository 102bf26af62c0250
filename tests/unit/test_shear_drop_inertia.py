"""`scripts/shear_drop_inertia.py`: finite elements of a drop in shear, against what is known exactly."""

import numpy as np
import pytest

from tests.scripts import load_script


@pytest.fixture(scope="module")
def script():
    return load_script("shear_drop_inertia")


def test_the_mesh_fills_the_box_and_fits_the_circle(script):
    drop = script.Drop(0.1, 0.2, 1.0, 100.0, 0.2, 0.6)
    assert drop.forms.weight.sum() == pytest.approx(64, rel=1e-12)
    assert drop.forms.mass.sum() == pytest.approx(0.1 * (64 + 99 * np.pi), rel=1e-5)
    assert drop.forms.weight[drop.mesh.inside].sum() == pytest.approx(np.pi, rel=1e-5)
    np.testing.assert_allclose(np.linalg.norm(drop.x[drop.mesh.ring], axis=1), 1, rtol=1e-12)
    # Both ends of the box have one velocity, and walls have none of their own.
    given = drop.mesh.spread @ np.arange(1.0, drop.mesh.spread.shape[1] + 1)
    ends = [given[drop.mesh.at_end & (s * drop.x[:, 0] > 0)] for s in (1, -1)]
    np.testing.assert_array_equal(np.sort(ends[0]), np.sort(ends[1]))
    assert (given[drop.mesh.at_wall] == 0).all()
    assert (given[~drop.mesh.at_wall] > 0).all()


def test_points_are_spread_evenly_on_their_curve(script):
    """An ellipse stays one, by the order of the spline, and no point moves when all are even already."""
    angle = 2 * np.pi * np.arange(64) / 64
    angle += 0.2 * np.sin(2 * angle)
    ring = np.stack([1.5 * np.cos(angle), np.sin(angle) / 1.5], axis=1)
    even = script.spread_evenly(ring)
    np.testing.assert_allclose((even[:, 0] / 1.5) ** 2 + (even[:, 1] * 1.5) ** 2, 1, atol=1e-3)
    again = script.spread_evenly(even)
    np.testing.assert_allclose(again, even, atol=1e-4)
    gaps = np.linalg.norm(np.diff(even, axis=0, append=even[:1]), axis=1)
    assert np.ptp(gaps) < 0.01 * gaps.mean()  # chords, which are shorter than arcs where the curve bends


def test_a_circle_at_rest_stays_at_rest(script):
    """Without walls that move, tension of 5 makes no more flow than the curve of its edges is off a circle."""
    drop = script.Drop(0.1, 0.2, 1.0, 1.0, 0.2, 0.6)
    drop.u, drop.u_old, drop.at_walls = (np.zeros_like(drop.x) for _ in range(3))
    for _ in range(3):
        drop.advance(0.1)
    assert np.abs(drop.u).max() < 5 * 1e-4
    assert drop.forms.shape_of_drop()[0] < 1e-5


def test_a_shear_wave_falls_as_it_should_where_nodes_move(script):
    """u = y + sin(pi y/4), one fluid without tension: the wave falls at nu (pi/4)^2, to second order in the step."""
    off = []
    for steps in (7, 14):
        drop = script.Drop(1.0, 1e9, 1.0, 1.0, 0.4, 0.8)
        drop.u[:, 0] += np.sin(np.pi * drop.u[:, 0] / 4)
        drop.u_old = drop.u
        for _ in range(steps):
            drop.advance(0.5 / steps)
        y = drop.x[:, 1]
        exact = y + np.sin(np.pi * y / 4) * np.exp(-((np.pi / 4) ** 2) * 0.5)
        error = drop.u - np.stack([exact, 0 * y], axis=1)
        assert np.abs(error).max() < 4e-3  # of the mesh
        wave = np.sin(np.pi * y / 4)
        off.append(error[:, 0] @ wave / (wave @ wave))
        assert np.abs(drop.x - drop.mesh.nodes).max() > 0.3  # the mesh moved
    assert off[0] / off[1] == pytest.approx(4, rel=0.1)


@pytest.mark.parametrize(("viscosity", "deformation", "angle"), [(1.0, 0.103885, 38.680), (0.1, 0.103147, 41.130)])
def test_slow_drops_are_those_of_stokes_flow(script, viscosity, deformation, angle):
    """Of the boundary integrals of `shear_drop_exact.py`; 16 edges around the drop are within 0.2 %."""
    table = script.run(script.Drop(1e-3, 0.1, viscosity, 1.0, 0.4, 1.0), 0.08, 4.0)
    assert table[-1, 1] == pytest.approx(deformation, rel=2e-3)
    assert table[-1, 2] == pytest.approx(angle, abs=0.1)
    assert table[-1, 3] == pytest.approx(1, abs=1e-3)
