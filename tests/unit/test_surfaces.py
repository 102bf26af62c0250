"""Surfaces of bodies: distances against brute force, airfoils against their formulas, what wrong shapes and files say."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpsph.case.expressions import compile_expression
from warpsph.scene.airfoils import airfoil, naca_4, read_section
from warpsph.scene.surfaces import Ball, Hollow, Outline, ShapeError, box_surface
from warpsph.scene.traced import trace, trace_expression

SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def star(angles, radii):
    """A polygon that goes once around the origin."""
    order = np.sort(np.asarray(angles, dtype=float))
    return np.stack([np.cos(order), np.sin(order)], axis=1) * np.asarray(radii, dtype=float)[:, None]


def brute_distance(corners, points):
    """Distance of points from a polygon, edge by edge, and whether they are inside (winding angle)."""
    distance = np.full(len(points), np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    angle = np.arctan2(*(corners[None] - points[:, None]).transpose(2, 0, 1)[::-1])
    turn = (np.roll(angle, -1, axis=1) - angle + np.pi) % (2 * np.pi) - np.pi
    return distance, np.abs(turn.sum(axis=1)) > np.pi


polygons = st.integers(3, 9).flatmap(
    lambda n: st.tuples(
        st.permutations([k for k in range(24)]).map(lambda order: sorted(order[:n])),
        st.lists(st.floats(0.3, 1.0), min_size=n, max_size=n),
    )
).map(lambda pair: star(np.array(pair[0]) * (2 * math.pi / 24), pair[1]))
around = [p for p in np.random.default_rng(1).uniform(-1.2, 1.2, (60, 2))]


def simple(corners):
    try:
        return Outline.of_corners(corners)
    except ShapeError:
        return None


@settings(max_examples=20, deadline=None)
@given(polygons)
def test_distance_of_polygons_against_brute_force(corners):
    surface = simple(corners)
    if surface is None or surface.measure < 0.01:
        return
    points = np.array(around)
    distance, inside = brute_distance(corners, points)
    signed = surface.signed_distance(points)
    assert np.abs(signed) == pytest.approx(distance, abs=1e-12)
    clear = distance > 1e-9
    assert np.array_equal((signed < 0)[clear], inside[clear])


def every_surface():
    where = trace(lambda p: (np.abs(p) < 0.5).all(axis=1), (-1, -1, -1), (1, 1, 1), 0.2)
    return {
        "circle": Ball((0.1, 0.0), 0.6),
        "sphere": Ball((0.1, 0.0, -0.1), 0.6),
        "polygon": Outline.of_corners([(-0.5, -0.4), (0.6, -0.5), (0.1, 0.0), (0.4, 0.7), (-0.6, 0.3)]),
        "brick": box_surface((-0.5, -0.3, -0.6), (0.4, 0.7, 0.5)),
        "traced cube": where,
        "hollow circle": Hollow(Ball((0.1, 0.0), 0.6)),
    }


@pytest.mark.parametrize("name", every_surface())
def test_feet_and_normals_belong_to_the_distance(name):
    """x = foot + distance * normal, the foot is on the surface, the normal is the gradient of the distance."""
    surface = every_surface()[name]
    points = np.random.default_rng(2).uniform(-1, 1, (200, surface.dimension))
    distance = surface.signed_distance(points)
    foot, normal = surface.closest(points)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, abs=1e-12)
    assert foot + distance[:, None] * normal == pytest.approx(points, abs=1e-9)
    assert np.abs(surface.signed_distance(foot)) == pytest.approx(0.0, abs=2e-7)
    step = 1e-5
    gradient = np.stack(
        [
            surface.signed_distance(points + step * e) - surface.signed_distance(points - step * e)
            for e in np.eye(surface.dimension)
        ],
        axis=1,
    ) / (2 * step)  # fmt: skip
    smooth = np.abs(np.linalg.norm(gradient, axis=1) - 1) < 1e-3  # not across the middle of the body
    assert smooth.mean() > 0.9
    assert normal[smooth] == pytest.approx(gradient[smooth], abs=2e-3)


@pytest.mark.parametrize("name", every_surface())
def test_patches_cover_the_surface_and_close(name):
    """The patches add up to the surface, and their normals to nothing: a constant pressure does not push a body."""
    surface = every_surface()[name]
    middle, normal, size = surface.patches(0.05)
    assert size.sum() == pytest.approx(surface.extent, rel=1e-12)
    assert (normal * size[:, None]).sum(axis=0) == pytest.approx(0.0, abs=1e-3 * surface.extent)
    sign = -1 if surface.hollow else 1
    volume = sign * np.einsum("ij,ij,i->", middle, normal, size) / surface.dimension
    assert volume == pytest.approx(surface.measure, rel=3e-3)


def test_a_normal_on_the_surface_is_that_of_the_face():
    outline = Outline.of_corners(SQUARE)
    _, normal = outline.closest(np.array([[0.5, 0.0], [1.0, 0.25], [0.25, 1.0], [0.5, 1e-13]]))
    assert normal == pytest.approx(np.array([[0, -1], [1, 0], [0, 1], [0, -1]]), abs=1e-12)
    # beyond a corner it turns with the point
    _, normal = outline.closest(np.array([[2.0, 2.0]]))
    assert normal == pytest.approx(np.array([[1, 1]]) / math.sqrt(2))


@pytest.mark.parametrize("dimension", [2, 3])
def test_of_two_faces_that_are_as_near_the_first_axis_has_its_own(dimension):
    """On the bisectors of all corners and edges, wherever the box stands: rounding would choose now this, now that face."""
    offsets = np.random.default_rng(1).uniform(-3, 3, (50, dimension))
    corner = np.stack(np.meshgrid(*[(-1.0, 1.0)] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    for offset in offsets:
        lower, upper = offset, offset + [0.7, 0.4, 0.9][:dimension]
        points = np.where(corner < 0, lower, upper) - 0.1 * corner
        foot, normal = box_surface(lower, upper).closest(points)
        expected = np.zeros_like(normal)
        expected[:, 0] = corner[:, 0]
        np.testing.assert_allclose(normal, expected, atol=1e-12)
        np.testing.assert_allclose(points - foot, -0.1 * expected, atol=1e-12)
        # midway between two faces the upper one: the shortest side is that along y
        _, normal = box_surface(lower, upper).closest(np.array([offset + np.array([0.35, 0.2, 0.45][:dimension])]))
        np.testing.assert_allclose(normal[0], [0.0, 1.0, 0.0][:dimension], atol=1e-12)


def test_the_sense_of_rotation_of_a_polygon_does_not_matter():
    points = np.random.default_rng(3).uniform(-1, 2, (50, 2))
    one, other = Outline.of_corners(SQUARE), Outline.of_corners(SQUARE[::-1])
    assert one.signed_distance(points) == pytest.approx(other.signed_distance(points))
    assert one.closest(points)[1] == pytest.approx(other.closest(points)[1])


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ([(0, 0), (1, 1), (1, 0), (0, 1)], "crosses or touches itself"),
        ([(0, 0), (1, 1)], "fewer than three"),
        ([(0, 0), (0, 0), (1, 1), (1, 1)], "fewer than three"),
        ([(0, 0), (1, 0), (2, 0)], "encloses no area"),
    ],
)
def test_polygons_that_bound_nothing_are_refused(corners, words):
    with pytest.raises(ShapeError, match=words):
        Outline.of_corners(corners)


def test_a_box_needs_its_corners_in_order():
    with pytest.raises(ShapeError, match="lower coordinate is not below"):
        box_surface((0, 0), (1, -1))


# conditions ---------------------------------------------------------------------------------------------------


def test_a_traced_circle_is_the_circle():
    condition = compile_expression("(x - 0.1)**2 + y**2 < 0.25")
    surface = trace_expression(condition, (-1, -1), (1, 1), 0.05)
    circle = Ball((0.1, 0.0), 0.5)
    points = np.random.default_rng(4).uniform(-1, 1, (300, 2))
    # chords of at most the diagonal c of a grid cell, a quarter of a spacing wide: c^2 / 8 R = 7.8e-5
    assert surface.signed_distance(points) == pytest.approx(circle.signed_distance(points), abs=7.9e-5)
    assert surface.measure == pytest.approx(math.pi / 4, rel=2e-4)


def test_corners_between_grid_lines_are_put_back():
    surface = trace(lambda p: np.abs(p[:, 0] - 0.013) + np.abs(p[:, 1] + 0.007) < 0.4, (-1, -1), (1, 1), 0.1)
    assert surface.measure == pytest.approx(0.32, rel=1e-4)  # 0.3184 with all four cut off
    corner = np.array([[0.413, -0.007], [0.013, 0.393], [-0.387, -0.007], [0.013, -0.407]])
    assert surface.signed_distance(corner) == pytest.approx(0.0, abs=1e-3)


def test_a_traced_body_ends_at_the_box():
    surface = trace(lambda p: p[:, 0] < 0.33, (0, 0), (1, 2), 0.1)
    assert surface.measure == pytest.approx(0.66, rel=1e-6)
    assert surface.bounds == pytest.approx(np.array([[0, 0], [0.33, 2]]), abs=1e-6)


def test_a_traced_body_may_have_holes_and_parts():
    def rings(p):
        r = np.linalg.norm(p, axis=1)
        return ((r > 0.3) & (r < 0.5)) | (np.linalg.norm(p - 0.8, axis=1) < 0.1)

    surface = trace(rings, (-1, -1), (1, 1), 0.05)
    assert surface.measure == pytest.approx(math.pi * (0.25 - 0.09 + 0.01), rel=1e-3)
    assert surface.signed_distance(np.array([[0.0, 0.0], [0.4, 0.0], [0.8, 0.8]])) == pytest.approx(
        [0.3, -0.1, -0.1], abs=3e-4
    )


def test_a_traced_sphere_is_the_sphere():
    surface = trace(lambda p: (p**2).sum(axis=1) < 0.25, (-1, -1, -1), (1, 1, 1), 0.1)
    points = np.random.default_rng(5).uniform(-1, 1, (300, 3))
    exact = np.linalg.norm(points, axis=1) - 0.5
    assert surface.signed_distance(points) == pytest.approx(exact, abs=1.9e-3)  # diagonals of grid cells of 0.05
    assert surface.measure == pytest.approx(math.pi / 6, rel=7e-3)


def test_a_condition_that_holds_nowhere_is_refused():
    with pytest.raises(ShapeError, match="holds no point of the domain"):
        trace(lambda p: p[:, 0] > 2, (0, 0), (1, 1), 0.1)


# airfoils -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("digits", ["0012", "0024"])
def test_area_and_chord_of_symmetric_sections(digits, closed):
    """The area is twice the integral of the half thickness, known term by term."""
    t, last = int(digits[2:]) / 100, -0.1036 if closed else -0.1015
    half = 5 * t * (0.2969 * 2 / 3 - 0.1260 / 2 - 0.3516 / 3 + 0.2843 / 4 + last / 5)
    section = naca_4(digits, closed)
    surface = airfoil(section, chord=2.0)
    assert surface.measure == pytest.approx(4 * 2 * half, rel=2e-5)
    assert section[:, 0].min() == 0.0 and section[:, 0].max() == 1.0
    # the thickest place, 30 % of the chord, is the number in the name within a thousandth of it
    assert 2 * section[:, 1].max() == pytest.approx(t, rel=2e-3)
    tail = section[np.isclose(section[:, 0], 1.0)]
    assert len(tail) == (1 if closed else 2)
    if not closed:
        assert np.ptp(tail[:, 1]) == pytest.approx(10 * t * 0.0021, rel=1e-9)


def test_camber_of_a_cambered_section():
    section = naca_4("4412", points=800)
    nose = int(np.linalg.norm(section, axis=1).argmin())
    upper, lower = section[: nose + 1][::-1], section[nose:]
    x = np.linspace(0.05, 0.95, 50)
    middle = 0.5 * (np.interp(x, *upper.T) + np.interp(x, *lower.T))
    fore = 0.04 / 0.16 * (0.8 * x - x**2)
    aft = 0.04 / 0.36 * (0.2 + 0.8 * x - x**2)
    assert middle == pytest.approx(np.where(x < 0.4, fore, aft), abs=2e-3)
    # the table of ordinates of Abbott and von Doenhoff
    assert np.interp([0.3, 0.4, 0.5], *upper.T) == pytest.approx([0.0976, 0.0980, 0.0919], abs=1e-4)
    assert np.interp([0.3, 0.4, 0.5], *lower.T) == pytest.approx([-0.0226, -0.0180, -0.0140], abs=1e-4)


def test_angle_of_attack_lifts_the_nose_about_the_pivot():
    surface = airfoil(naca_4("0012"), chord=2.0, angle=8.0, pivot=0.25, position=(3.0, 1.0))
    a = math.radians(8)
    nose = np.array([[3 - 0.5 * math.cos(a), 1 + 0.5 * math.sin(a)]])
    tail = np.array([[3 + 1.5 * math.cos(a), 1 - 1.5 * math.sin(a)]])
    assert surface.signed_distance(np.concatenate([nose, tail])) == pytest.approx(0.0, abs=1e-9)


def selig(section):
    return "NACA 0012\n" + "\n".join(f"{x:.6f} {y:.6f}" for x, y in section)


def lednicer(section):
    nose = int(section[:, 0].argmin())
    upper, lower = section[: nose + 1][::-1], np.concatenate([section[nose:], section[:1]])
    lines = [f"{len(upper)}. {len(lower)}.", "", *(f"{x:.6f} {y:.6f}" for x, y in upper), ""]
    return "NACA 0012\n" + "\n".join([*lines, *(f"{x:.6f} {y:.6f}" for x, y in lower)])


@pytest.mark.parametrize("write", [selig, lednicer])
def test_a_file_of_coordinates_is_the_section(tmp_path, write):
    """Sixty points a side, read and splined, are the section within a ten-thousandth of the chord."""
    path = tmp_path / "section.dat"
    path.write_text(write(naca_4("0012", points=60)))
    surface, exact = airfoil(read_section(path), 1.0), airfoil(naca_4("0012"), 1.0)
    assert surface.measure == pytest.approx(exact.measure, rel=1e-4)
    assert exact.signed_distance(surface._start) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("only a title\n", "has 0 lines of two numbers"),
        ("\n".join(f"{x} 0.1" for x in range(10)), "x from 0 to 9"),
        ("\n".join(["5 5", *("0.5 0.1" for _ in range(9))]), r"announces 5 \+ 5 points and has 9"),
        ("\n".join(f"{x / 10} {0.1 * math.sin(x)}" for x in range(11)), "in no known order"),
        ("\n".join(f"{100 - 10 * x} {x % 3}" for x in range(11)), "x from 0 to 100"),
    ],
)
def test_files_of_coordinates_that_are_none(tmp_path, text, words):
    path = tmp_path / "section.dat"
    path.write_text(text)
    with pytest.raises(ShapeError, match=words):
        read_section(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ShapeError, match="not there"):
        read_section(tmp_path / "no.dat")


@pytest.mark.parametrize("digits", ["12", "00x2", "0000", "0412", "4012", "12345"])
def test_sections_that_are_none(digits):
    with pytest.raises(ShapeError):
        naca_4(digits)


# STL ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def stl(tmp_path):
    """A function that writes a pyvista mesh as STL and returns the path."""

    def write(mesh, binary=True):
        path = tmp_path / "body.stl"
        mesh.save(path, binary=binary)
        return path

    return write


@pytest.mark.parametrize("binary", [True, False])
def test_an_stl_box_is_the_box(stl, binary):
    import pyvista as pv

    from warpsph.scene.meshes import read_stl

    path = stl(pv.Cube(x_length=2.0, y_length=1.0, z_length=1.0).triangulate(), binary)
    mesh = read_stl(path, scale=0.5, translate=(0.1, 0.2, 0.3))
    brick = box_surface((-0.4, -0.05, 0.05), (0.6, 0.45, 0.55))
    points = np.random.default_rng(6).uniform(-1, 1, (300, 3))
    assert mesh.measure == pytest.approx(0.25, rel=1e-6)
    assert mesh.extent == pytest.approx(2.5, rel=1e-6)
    assert mesh.signed_distance(points) == pytest.approx(brick.signed_distance(points), abs=1e-6)
    assert mesh.closest(points)[1] == pytest.approx(brick.closest(points)[1], abs=1e-4)


def test_a_mesh_turned_inside_out_is_turned_back(stl):
    import pyvista as pv

    from warpsph.scene.meshes import Mesh

    mesh = pv.Icosphere(radius=0.5, nsub=3)
    turned = pv.PolyData(mesh.points, np.column_stack([np.full(mesh.n_cells, 3), mesh.regular_faces[:, ::-1]]).ravel())
    assert Mesh(turned).signed_distance(np.zeros((1, 3)))[0] == pytest.approx(-0.5, rel=0.02)


def test_stl_files_that_bound_nothing_are_refused(stl, tmp_path):
    import pyvista as pv

    from warpsph.scene.meshes import read_stl

    box = pv.Cube().triangulate().clean()
    for mesh, words in (
        (box.extract_cells(range(11)).extract_surface(algorithm=None), "not watertight: it has 3 open edges"),
        (box.merge(pv.Cube(center=(1.0, 1.0, 0.0)).triangulate()), "not watertight: 1 edges"),
    ):
        with pytest.raises(ShapeError, match=re.escape(words)):
            read_stl(stl(mesh))
    text = tmp_path / "text.stl"
    text.write_text("this is no mesh")
    with pytest.raises(ShapeError, match="is no STL file"):
        read_stl(text)
    with pytest.raises(ShapeError, match="not there"):
        read_stl(tmp_path / "no.stl")
