"""Bodies across periodic sides go on at the other side: where a body stands in a period changes nothing."""

import functools

import numpy as np
import pytest
from scipy.spatial import cKDTree

from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.running.model import Model
from warpsph.scene.surfaces import Ball, Repeated

DISC = {"sphere": {"center": [0.5, 0.5], "radius": 0.25}}


def box(shape, scheme="riemann", dimension=2, **more):
    """A periodic box of 12 spacings that a body force drives fluid through, past one body."""
    corners = {"lower": [0] * dimension, "upper": [1] * dimension}
    data = {
        "dimension": dimension,
        "particle_spacing": 1 / 12,
        "end_time": 1.0,
        "domain": {**corners, "boundary": dict.fromkeys("xyz"[:dimension], "periodic")},
        "phases": {"water": {"density": 1.0, "viscosity": 0.1}},
        "scales": {"velocity": 1.0},
        "body_force": [0.1, 0.05, 0.02][:dimension],
        "fluids": [{"phase": "water", "shape": "rest"}],
        "bodies": {"body": {"shape": shape}},
        "numerics": {"scheme": scheme},
    }
    return Case.from_dict(data | more)


def moved(shape, way):
    """A shape elsewhere."""
    (kind, keys), result = next(iter(shape.items())), {}
    for key, value in keys.items():
        if key in ("center", "lower", "upper"):
            value = [x + y for x, y in zip(value, way, strict=True)]
        if key == "points":
            value = [[x + y for x, y in zip(point, way, strict=True)] for point in value]
        result[key] = value
    return {kind: result}


def prepared(case, threads=1):
    model = Model(case, threads=threads)
    model.stepper.prepare(fresh=True)
    return model


def apart(points, others):
    """How far each of `others` is from the nearest point of a periodic unit box."""
    return cKDTree(points % 1.0, boxsize=1.0).query(others % 1.0)[0]


SHAPES = {
    "disc": DISC,
    "box": {"box": {"lower": [0.26, 0.3], "upper": [0.74, 0.7]}},
    "edge": {"box": {"lower": [1 / 4, 1 / 4], "upper": [3 / 4, 2 / 3]}},
    "diamond": {"polygon": {"points": [[0.2, 0.5], [0.5, 0.2], [0.8, 0.5], [0.5, 0.8]]}},
}


@functools.cache
def in_the_middle(kind):
    """A body that no side cuts."""
    return Model(box(SHAPES[kind]), threads=1)


CUT = [*((kind, (-0.5, 0.5)) for kind in SHAPES), ("box", (0.0, -0.5)), ("disc", (0.5, 0.25))]


@pytest.mark.parametrize(("kind", "way"), CUT)
def test_particles_are_those_of_a_body_in_the_middle(kind, way):
    """Fluid, boundary particles and what the surface is to them, moved along by whole spacings."""
    here, there = in_the_middle(kind), Model(box(moved(SHAPES[kind], way)), threads=1)
    assert there.particles.fluid_count == here.particles.fluid_count
    assert there.particles.wall_count == here.particles.wall_count
    count, dx = here.particles.fluid_count, 1 / 12
    first, second = (m.particles.get("position").astype(float) for m in (here, there))
    assert second.min() >= 0.0 and second.max() <= 1.0
    assert apart(second[count:], first[count:] + way).max() < 1e-5
    # the fluid is arranged anew: it has neither holes nor crowds, and is as far from the surface as that of the first
    for places in (first + way, second):
        fluid, walls = places[:count] % 1.0, places[count:] % 1.0
        assert cKDTree(fluid, boxsize=1.0).query(fluid, k=2)[0][:, 1].min() > 0.7 * dx
        assert apart(walls, fluid).min() > 0.7 * dx
        grid = np.stack(np.meshgrid(*[np.arange(0.01, 1, 0.02)] * 2), axis=-1).reshape(-1, 2)
        assert apart(places, grid[apart(second[count:], grid) > dx]).max() < 0.95 * dx
    for name in ("area", "volume", "depth"):
        was, now = (np.sort(getattr(m.geometry.surface, name)) for m in (here, there))
        np.testing.assert_allclose(now, was, rtol=1e-9, atol=1e-12)
    assert np.linalg.norm(there.geometry.surface.normal, axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("scheme", ["delta_plus", "isph"])
def test_flow_past_a_box_is_the_same_wherever_it_stands(scheme):
    """To rounding: no boundary particle on the bisector of a corner changes its face, none in the middle its place.

    (The Riemann scheme starts from a disorder that is another one for each arrangement of the fluid.)
    """
    speeds, forces = [], []
    for way in ((0.0, 0.0), (0.25, 0.0), (0.5, 0.5), (-1 / 3, 0.25)):
        model = prepared(box(moved(SHAPES["edge"], way), scheme, precision="float64"))
        model.stepper.run(10.0, 40)
        speeds.append(model.snapshot().fluid.velocity.mean(axis=0))
        load = model.wall_forces()
        forces.append([load["wall_force_x body"], load["wall_force_y body"]])
    np.testing.assert_allclose(speeds[1:], [speeds[0]] * 3, rtol=1e-7)
    np.testing.assert_allclose(forces[1:], [forces[0]] * 3, rtol=1e-6)


def touching(first, second, dimension):
    """Fluid around two bodies that touch each other, driven along the first axis."""
    return box(first, dimension=dimension, bodies={"first": {"shape": first}, "second": {"shape": second}})


PAIRS = {
    "boxes": (SHAPES["box"], {"box": {"lower": [0.74, 0.3], "upper": [1.0, 0.7]}}, (0.26, 0.0), 2),
    "box and disc": (SHAPES["box"], {"sphere": {"center": [0.84, 0.5], "radius": 0.1}}, (0.26, 0.0), 2),
    "beyond two sides": (SHAPES["box"], {"box": {"lower": [0.26, 0.7], "upper": [0.74, 0.9]}}, (0.5, 0.3), 2),
    "in 3-D": (
        {"box": {"lower": [0.25, 0.25, 0.25], "upper": [0.5, 0.75, 0.75]}},
        {"box": {"lower": [0.5, 0.25, 0.25], "upper": [0.75, 0.75, 0.75]}},
        (0.5, 0.0, 0.0),
        3,
    ),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_bodies_that_touch_across_a_side_are_those_that_touch_in_the_middle(pair):
    """No face is left between them, the one that a side parts from the other included."""
    first, second, way, dimension = PAIRS[pair]
    here = Model(touching(first, second, dimension), threads=1)
    there = Model(touching(moved(first, way), moved(second, tuple(x - (x > 0) for x in way)), dimension), threads=1)
    assert there.particles.wall_count == here.particles.wall_count
    count = here.particles.fluid_count
    walls = [m.particles.get("position").astype(float)[count:] for m in (here, there)]
    # the outline of bodies that touch is made on a grid of 1e-6 of their size, which its innermost row may feel
    far, dx = apart(walls[1], walls[0] + way), 1 / 12
    assert np.median(far) < 1e-5 * dx and far.max() < 0.25 * dx
    for name in ("area", "volume", "depth"):
        was, now = (getattr(m.geometry.surface, name) for m in (here, there))
        assert now.sum() == pytest.approx(was.sum(), rel=1e-4)


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus", "isph"])
def test_flow_past_a_body_at_a_corner(scheme, device):
    """Velocity and force are those of the body in the middle; cut off at the sides a quarter of it was there."""
    speeds, forces = [], []
    for way in ((0.0, 0.0), (0.5, 0.5), (-0.5, 0.5)):
        model = Model(box(moved(DISC, way), scheme), device=device, threads=1)
        model.stepper.prepare(fresh=True)
        model.stepper.run(0.2, 10**6)
        speeds.append(model.snapshot().fluid.velocity.mean(axis=0))
        load = model.wall_forces()
        forces.append([load["wall_force_x body"], load["wall_force_y body"]])
    np.testing.assert_allclose(speeds[1:], [speeds[0]] * 2, rtol=2e-3)
    np.testing.assert_allclose(forces[1:], [forces[0]] * 2, rtol=5e-3)


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus", "isph"])
def test_torque_and_stations_are_those_of_one_piece(scheme):
    """A disc that turns: its torque has the arm of its own centre, and the angles of its stations go around that."""
    torques = []
    for center in ([0.5, 0.5], [0.0, 1.0]):
        shape = {"sphere": {"center": center, "radius": 0.25}}
        bodies = {"body": {"shape": shape, "motion": {"rotation": "t - tanh(t)", "pivot": center}}}
        model = prepared(box(shape, scheme, bodies=bodies))
        model.stepper.run(0.3, 10**6)
        torques.append(model.wall_forces()["wall_torque_z body"])
        stations = model.surface_stress("body")
        way = stations.position - center
        np.testing.assert_allclose(np.linalg.norm(way, axis=1), 0.25, atol=1e-5)
        np.testing.assert_allclose(stations.angle, np.arctan2(way[:, 1], way[:, 0]) % (2 * np.pi), atol=0.01)
        assert stations.area.sum() == pytest.approx(0.5 * np.pi, rel=0.02)
        assert np.ptp(stations.arc) > 0.9 * 0.5 * np.pi and np.diff(stations.arc).max() < 1.2 / 12
    assert abs(torques[0]) > 1e-4 and torques[1] == pytest.approx(torques[0], rel=0.01)


def test_a_disc_that_crosses_a_side_keeps_its_torque():
    """It goes through a channel and turns; its own particles are on both sides of the domain between 2.4 and 3.5 s."""
    sides = {"lower": [0, 0], "upper": [1.5, 1], "boundary": {"x": "periodic", "y": "wall"}}
    shape = {"sphere": {"center": [0.4, 0.5], "radius": 0.2}}
    motion = {"translation": ["0.5*(t - tanh(t))", 0], "rotation": "t - tanh(t)", "pivot": [0.4, 0.5]}
    bodies = {"body": {"shape": shape, "motion": motion}}
    model = prepared(box(shape, "isph", domain=sides, body_force=[0, 0], bodies=bodies, end_time=4.0))
    torques = []
    for time in (2.2, 2.8, 3.2, 3.8):
        model.stepper.run(time, 10**6)
        load = model.wall_forces()
        torques.append(load["wall_torque_z body"])
        assert load["wall_centre_x body"] == pytest.approx(0.4 + 0.5 * (time - np.tanh(time)), abs=0.01)
    assert torques[0] < -0.03 and torques == pytest.approx([np.mean(torques)] * 4, rel=0.05)
    assert model.leaks()[0] == {"water": 0}


def test_a_floor_longer_than_a_period_ends_with_the_domain():
    floor = {"box": {"lower": [-0.5, -0.2], "upper": [1.5, 0.25]}}
    case = box(floor, domain={"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "free_slip"}})
    model = Model(case, threads=1)
    count = model.particles.fluid_count
    assert count == 12 * 9
    walls = model.particles.get("position")[count:]
    own = walls[(walls[:, 1] > 0) & (walls[:, 1] < 0.25)]
    assert len(own) == 12 * 3 and len(np.unique(np.round(own, 4), axis=0)) == len(own)


def test_an_image_that_the_case_names_itself_is_told_of():
    second = {"shape": moved(DISC, (0.5, 0.0))}
    with pytest.raises(CaseError, match=r"bodies\.again.*periodic sides repeat"):
        Model(box(DISC, bodies={"body": {"shape": moved(DISC, (-0.5, 0.0))}, "again": second}), threads=1)


@pytest.mark.parametrize("scheme", ["riemann", "isph"])
def test_a_sphere_at_a_corner_in_3d(scheme):
    ball = {"sphere": {"center": [0.5] * 3, "radius": 0.3}}
    speeds = []
    for way in ((0, 0, 0), (0.5, 0.5, 0.5)):
        model = prepared(box(moved(ball, way), scheme, 3, particle_spacing=1 / 10))
        model.stepper.run(1e9, 10)
        assert model.leaks()[0] == {"water": 0}
        speeds.append((model.particles.fluid_count, *model.snapshot().fluid.velocity.mean(axis=0)))
    np.testing.assert_allclose(speeds[1], speeds[0], rtol=5e-3)  # the disorder of the start is another one


def test_distances_of_a_repeated_surface():
    """At a corner of a unit square the nearest of four discs counts."""
    shifts = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=float)
    disc = Repeated(Ball([0.0, 0.0], 0.25), shifts)
    points = np.array([[0.1, 0.0], [0.9, 0.0], [0.05, 0.9], [0.8, 0.8], [0.5, 0.5]])
    near = np.linalg.norm(points[:, None] - shifts, axis=2).min(axis=1)
    np.testing.assert_allclose(disc.signed_distance(points), near - 0.25, atol=1e-12)
    foot, normal = disc.closest(points)
    np.testing.assert_allclose(foot + (near - 0.25)[:, None] * normal, points, atol=1e-12)
    np.testing.assert_allclose(disc.bounds, [[-0.25, -0.25], [1.25, 1.25]])
