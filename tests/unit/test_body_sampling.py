"""Boundary particles of bodies: the lattice of a box, exact volumes, even spacing, what the surface is to each particle."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from warpsph.scene.body_sampling import layers_of, sample
from warpsph.scene.surfaces import Ball, Hollow, Outline, box_surface

DX = 0.05


def nearest(points):
    """Distance of each point from the nearest other."""
    return cKDTree(points).query(points, k=2)[0][:, 1]


def largest_hole(surface, sampling, spacing, layers):
    """Farthest that a place in the layers, no nearer to their border than half a spacing, is from a particle."""
    reach = layers * spacing if surface.hollow else 0.0
    low, high = surface.bounds[0] - reach, surface.bounds[1] + reach
    axes = [np.arange(a, b, spacing / (8 if surface.dimension == 2 else 3)) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, surface.dimension)
    distance = surface.signed_distance(points)
    points = points[(distance < -0.5 * spacing) & (distance > -(layers - 0.5) * spacing)]
    return cKDTree(sampling.position).query(points)[0].max()


def bodies():
    corners = [(0, 0), (1.0, 0.37), (0.81, 0.88), (0.3, 0.5), (-0.2, 0.6)]
    return {
        "circle": Ball((0.02, 0.0), 0.5),
        "hollow circle": Hollow(Ball((0.02, 0.0), 0.5)),
        "polygon": Outline.of_corners(corners),
        "hollow polygon": Hollow(Outline.of_corners(corners)),
        "ellipse": Outline.of_corners([(0.7 * math.cos(a), 0.3 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 400)]),
    }


@pytest.mark.parametrize("lower", [(0.0, 0.0), (0.1, -0.25)])
def test_a_box_on_the_lattice_is_the_lattice(lower):
    upper = (lower[0] + 0.8, lower[1] + 0.6)
    found = sample(box_surface(lower, upper), DX, 3)
    x, y = (a + DX * (np.arange(round((b - a) / DX)) + 0.5) for a, b in zip(lower, upper, strict=True))
    cells = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    deep = np.minimum(cells - lower, np.array(upper) - cells).min(axis=1)
    cells = cells[deep < 3 * DX]
    assert found.count == len(cells)
    distance, place = cKDTree(cells).query(found.position)
    assert distance.max() < 1e-13 and len(set(place)) == len(cells)
    assert found.volume == pytest.approx(DX**2, rel=1e-12)
    at_corner = (found.layer == 0) & (np.minimum(found.position - lower, upper - found.position) < 0.6 * DX).all(axis=1)
    assert at_corner.sum() == 4
    assert found.area[at_corner] == pytest.approx(2 * DX)
    assert found.area[(found.layer == 0) & ~at_corner] == pytest.approx(DX)


@pytest.mark.parametrize("lower", [(0.0, 0.0), (0.3, 0.2), (10.24, -5.12), (0.3, 0.7, -1.1), (100.1, 0.2, 0.7)])
def test_a_corner_has_the_mean_normal_of_its_faces_wherever_the_box_is(lower):
    """And its foot on the edge, in all layers: with the normal of one face rounding would choose which."""
    d, layers = len(lower), 3
    surface = box_surface(lower, np.add(lower, 0.8 if d == 2 else 0.7))
    found = sample(surface, 0.1, layers, mean_edges=True)
    inside = np.minimum(found.position - lower, surface.bounds[1] - found.position)
    ties = np.abs(inside - inside.min(axis=1, keepdims=True)) < 0.01
    several = ties.sum(axis=1) > 1
    assert several.sum() == (12 if d == 2 else 12 * (5 + 3 + 1) + 8 * layers)
    mean = np.where(ties, np.sign(found.position - surface.bounds.mean(axis=0)), 0.0)
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    assert found.normal[several] == pytest.approx(mean[several], abs=1e-6)
    assert found.depth[several] == pytest.approx((inside.min(axis=1) * np.sqrt(ties.sum(axis=1)))[several], abs=1e-6)


@pytest.mark.parametrize("hollow", [False, True])
def test_a_box_in_three_dimensions_is_the_lattice(hollow):
    dx, layers = 0.1, 2
    box = box_surface((0, 0, 0), (0.8, 0.6, 0.5))
    found = sample(Hollow(box) if hollow else box, dx, layers)
    n = np.array([8, 6, 5])
    cells = (n + 2 * layers).prod() - n.prod() if hollow else n.prod() - (n - 2 * layers).prod()
    assert found.count == cells
    assert np.abs(found.position / dx - 0.5 - np.rint(found.position / dx - 0.5)).max() < 1e-12
    assert found.volume == pytest.approx(dx**3)
    assert found.area.sum() == pytest.approx(box.extent)


def test_a_hollow_box_has_the_cells_around_it_corners_included():
    found = sample(Hollow(box_surface((0, 0), (0.5, 0.4))), 0.1, 2)
    assert found.count == 9 * 8 - 5 * 4
    assert np.abs(found.position / 0.1 - 0.5 - np.rint(found.position / 0.1 - 0.5)).max() < 1e-12
    assert found.volume == pytest.approx(0.01)
    assert found.normal[np.abs(found.position[:, 0] - 0.25) < 0.21][:, 0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", bodies())
def test_particles_of_plane_bodies_are_even(name):
    surface = bodies()[name]
    found = sample(surface, DX, 4)
    assert nearest(found.position).min() > 0.6 * DX * (1 - 1e-6)
    # on a square lattice 0.71 spacings, the half diagonal
    assert largest_hole(surface, found, DX, 4) < 1.0 * DX
    assert 0.3 * DX**2 < found.volume.min() and found.volume.max() < 2.0 * DX**2


@pytest.mark.parametrize("name", bodies())
def test_feet_normals_and_leaders(name):
    surface = bodies()[name]
    found = sample(surface, DX, 4)
    assert np.abs(surface.signed_distance(found.foot)) == pytest.approx(0.0, abs=1e-9)
    assert found.position + found.depth[:, None] * found.normal == pytest.approx(found.foot, abs=1e-9)
    assert (found.depth > 0).all()
    first = found.layer == 0
    leads = np.flatnonzero(found.area > 0)
    assert set(found.leader) == set(leads) <= set(np.flatnonzero(first))
    assert np.array_equal(found.leader[leads], leads)
    apart = np.linalg.norm(found.position[found.leader] - found.foot, axis=1)
    assert apart.max() < 2.0 * DX
    assert (found.area[~first] == 0).all()
    assert found.area.sum() == pytest.approx(surface.extent, rel=1e-12)


@pytest.mark.parametrize("n", [3, 7, 24])
def test_volumes_of_rings_are_exact(n):
    """Each ring of a circle has its own area, and so have the rings around it."""
    dx = 0.5 / n
    ball = Ball((0.0, 0.0), 0.5)
    found = sample(ball, dx, 3)
    for m in range(3):
        ring = math.pi * ((0.5 - m * dx) ** 2 - max(0.5 - (m + 1) * dx, 0.0) ** 2)
        assert found.volume[found.layer == m].sum() == pytest.approx(ring, rel=1e-12)
    hollow = sample(Hollow(ball), dx, 3)
    assert hollow.volume.sum() == pytest.approx(math.pi * ((0.5 + 3 * dx) ** 2 - 0.25), rel=1e-12)


@pytest.mark.parametrize("cells", [(6, 5), (11, 7), (10.5, 6.5)])
def test_a_body_has_the_same_particles_elsewhere(cells):
    """The innermost rest of an odd number of rows included, whose places are a matter of which points are nearest."""
    dx = 1 / 12
    first = None
    for offset in np.random.default_rng(2).uniform(-30, 30, (20, 2)):
        (x0, y0), (x1, y1) = offset, offset + np.array(cells) * dx
        found = layers_of(Outline.of_corners([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), dx, 60)
        here = np.column_stack([found.position - offset, found.volume])
        first = here if first is None else first
        assert here == pytest.approx(first, abs=1e-9 * dx)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.25, 1.0), min_size=4, max_size=9), st.floats(0, 6.3), st.integers(6, 30))
def test_a_full_body_has_its_volume(radii, turn, cells):
    """All layers of any polygon that goes once around the origin add up to its area, none nearer than 0.6 spacings."""
    angle = turn + np.arange(len(radii)) * (2 * math.pi / len(radii))
    surface = Outline.of_corners(np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.array(radii)[:, None])
    dx = 1.0 / cells
    found = layers_of(surface, dx, 60)
    assert found.volume.sum() == pytest.approx(surface.measure, rel=1e-9)
    assert (found.volume > 0).all()
    if len(found.position) > 1:
        assert nearest(found.position).min() > 0.6 * dx * (1 - 1e-6)
    assert surface.signed_distance(found.position).max() < 0


def test_shells_of_a_sphere():
    ball, dx = Ball((0.0, 0.1, 0.0), 0.5), 0.05
    found = sample(ball, dx, 3)
    for m in range(3):
        own = found.layer == m
        shell = 4 / 3 * math.pi * ((0.5 - m * dx) ** 3 - (0.5 - (m + 1) * dx) ** 3)
        assert found.volume[own].sum() == pytest.approx(shell, rel=1e-12)
        assert found.depth[own] == pytest.approx((m + 0.5) * dx)
        assert nearest(found.position[own]).min() > 0.8 * dx
    assert nearest(found.position).min() > 0.6 * dx * (1 - 1e-6)
    assert largest_hole(ball, found, dx, 3) < 1.2 * dx  # 0.87 on a cubic lattice
    assert found.area.sum() == pytest.approx(ball.extent)


@pytest.mark.parametrize("hollow", [False, True])
def test_shells_of_a_mesh(hollow):
    import pyvista as pv

    from warpsph.scene.meshes import Mesh

    ball = Mesh(pv.Icosphere(radius=0.5, nsub=4))
    surface, dx = (Hollow(ball) if hollow else ball), 0.125
    found = sample(surface, dx, 2)
    assert nearest(found.position).min() > 0.6 * dx * (1 - 1e-6)
    assert largest_hole(surface, found, dx, 2) < 1.2 * dx
    assert np.abs(found.depth - (found.layer + 0.5) * dx).max() < 0.1 * dx
    outer, inner = (0.75, 0.5) if hollow else (0.5, 0.25)
    assert found.volume.sum() == pytest.approx(4 / 3 * math.pi * (outer**3 - inner**3), rel=0.02)
    assert found.area.sum() == pytest.approx(ball.extent, rel=1e-9)


def test_a_mesh_that_its_layers_fill_has_its_volume():
    import pyvista as pv

    from warpsph.scene.meshes import Mesh

    cube = Mesh(pv.Cube(x_length=0.6, y_length=0.5, z_length=0.4).triangulate())
    found = sample(cube, 0.1, 9)
    assert found.volume.sum() == pytest.approx(0.12, rel=1e-6)


def test_a_particle_in_the_corner_of_a_tank_is_led_by_one_at_its_sides():
    """No part of the surface is nearest to it, so that nothing is fitted before it."""
    found = sample(Hollow(box_surface((0, 0), (0.5, 0.4))), 0.1, 2)
    corner = np.flatnonzero((found.layer == 0) & (found.area == 0))
    assert len(corner) == 4
    assert (found.area[found.leader] > 0).all()
    assert np.linalg.norm(found.foot[found.leader[corner]] - found.foot[corner], axis=1) == pytest.approx(0.05)


def test_only_what_is_between_the_corners_is_kept():
    ball = Ball((0.0, 0.0), 0.5)
    found = sample(ball, DX, 3, lower=(0.0, -1.0), upper=(1.0, 1.0))
    assert (found.position[:, 0] > 0).all()
    assert found.area.sum() == pytest.approx(ball.extent / 2, rel=1e-2)


def closed_surfaces():
    import pyvista as pv

    from warpsph.scene.airfoils import airfoil, naca_4
    from warpsph.scene.meshes import Mesh

    return {
        **bodies(),
        "box": box_surface((0.0, 0.1), (0.4, 0.35)),
        "box off the lattice": box_surface((0.013, 0.1), (0.4, 0.332)),
        "airfoil": airfoil(naca_4("2412", False), 2.0, 5.0, 0.25, (0.0, 0.0)),
        "box in 3-D": box_surface((0.0, 0.1, 0.2), (0.3, 0.35, 0.4)),
        "hollow box in 3-D": Hollow(box_surface((0.0, 0.1, 0.2), (0.3, 0.35, 0.4))),
        "turned cube": Mesh(pv.Cube(x_length=0.5, y_length=0.3).triangulate().clean().rotate_z(20).rotate_x(13)),
        "cone": Mesh(pv.Cone(height=0.5, radius=0.3, resolution=40).triangulate().clean()),
    }


@pytest.mark.parametrize("name", closed_surfaces())
def test_facets_of_a_closed_surface_bear_uniform_and_linear_pressures_exactly(name):
    """The vector areas add up to 0, and pressures x, y, z have the volume as their forces: the divergence theorem."""
    surface = closed_surfaces()[name]
    found = sample(surface, DX, 3)
    facets, d = found.facets, surface.dimension
    assert np.abs(facets.vector.sum(axis=0)).max() < 1e-12 * surface.extent
    volume = facets.vector.T @ facets.foot + facets.moment.sum(axis=0)
    side = -1.0 if surface.hollow else 1.0
    assert volume == pytest.approx(side * surface.measure * np.eye(d), abs=1e-9 * surface.measure)
    assert np.bincount(facets.owner, facets.area, minlength=found.count) == pytest.approx(found.area, abs=1e-15)
    assert np.linalg.norm(facets.normal, axis=1) == pytest.approx(1.0)
    assert (np.einsum("ij,ij->i", facets.normal, facets.vector) > 0.9 * facets.area).all()


def test_a_corner_has_a_facet_on_each_face():
    found = sample(box_surface((0, 0), (0.5, 0.4)), 0.1, 2).facets
    owners, count = np.unique(found.owner, return_counts=True)
    assert sorted(count) == [1] * 10 + [2] * 4
    assert found.area == pytest.approx(0.1)
    for owner in owners[count == 2]:
        one, other = found.normal[found.owner == owner]
        assert one @ other == pytest.approx(0.0, abs=1e-12)
    assert np.abs(found.moment).max() < 1e-15
    brick = sample(box_surface((0, 0, 0), (0.5, 0.4, 0.3)), 0.1, 2).facets
    assert np.bincount(np.unique(brick.owner, return_counts=True)[1]).tolist() == [0, 22, 24, 8]


@pytest.mark.parametrize("sides", [2, 3])
def test_facets_are_the_same_wherever_a_body_is(sides):
    """Rounding chooses the one normal that a particle in a corner has, but not its facets."""
    lower, upper = np.array([0.2, 0.12, 0.3])[:sides], np.array([0.4, 0.32, 0.44])[:sides]

    def facets(way):
        found = sample(box_surface(lower + way, upper + way), 0.02, 2).facets
        rows = np.column_stack([found.foot - way, found.normal, found.area / 0.02 ** (sides - 1)])
        return rows[np.lexsort(np.round(rows, 6).T)]

    here = facets(np.zeros(sides))
    for way in ([10.24, -5.12, 0.64], [0.3, 0.7, -1.1]):
        assert facets(np.array(way[:sides])) == pytest.approx(here, abs=1e-9)
