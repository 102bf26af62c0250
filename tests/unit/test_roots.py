"""Bodies that stand on walls of the domain or on each other go on into them, whatever their shape and the lattice."""

import math

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.running.model import Model
from warpsph.scene.meshes import Mesh
from warpsph.scene.roots import Footing, gap_of, joined, rooted
from warpsph.scene.surfaces import Ball, Hollow, Outline, box_surface

FLOOR = Footing(axis=1, way=-1, plane=0.0, near=0.1, reach=1.0)
RIGHT = Footing(axis=0, way=1, plane=2.0, near=0.1, reach=1.0)
RECTANGLE = [[0.55, 0], [0.65, 0], [0.65, 0.1], [0.55, 0.1]]


def cube(lower, upper):
    pv = pytest.importorskip("pyvista")
    return Mesh(pv.Box(bounds=[lower[0], upper[0], lower[1], upper[1], lower[2], upper[2]]))


def test_an_outline_on_a_wall_has_legs_as_wide_as_its_soles():
    """An arch with two feet, each 0.5 wide: of the room under it nothing is taken."""
    arch = Outline.of_corners([(0, 0), (0.5, 0), (0.5, 1), (1, 1), (1, 0), (1.5, 0), (1.5, 2), (0, 2)])
    found = rooted(arch, FLOOR)
    assert found.measure == pytest.approx(arch.measure + 2 * 0.5 * 1.0)
    probes = np.array([[0.25, -0.9], [1.25, -0.9], [0.75, -0.9], [0.75, 0.5]])
    assert found.inside(probes).tolist() == [True, True, False, False]
    assert len(found.edges()[0]) == 8  # no corner where the old foot was


def test_a_wedge_keeps_its_slopes():
    wedge = Outline.of_corners([(0, 0), (1, 0), (0.5, 1)])
    found = rooted(wedge, FLOOR)
    assert found.measure == pytest.approx(0.5 + 1.0)
    probes = np.array([[0.2, 0.5], [0.05, 0.2], [0.5, 0.5], [1.2, 0.05]])
    assert found.signed_distance(probes) == pytest.approx(wedge.signed_distance(probes))


@pytest.mark.parametrize("wall", [FLOOR, RIGHT])
def test_boxes_and_outlines_and_meshes_are_the_same(wall):
    lower, upper = np.array([1.2, 0.0, 0.3]), np.array([2.0, 0.7, 0.8])
    bricks = [box_surface(lower, upper), cube(lower, upper)]
    solid = [rooted(brick, wall) for brick in bricks]
    assert solid[1].bounds == pytest.approx(solid[0].bounds)
    assert solid[1].measure == pytest.approx(solid[0].measure)
    assert solid[1].extent == pytest.approx(solid[0].extent)
    plane = rooted(box_surface(lower[:2], upper[:2]), wall)
    assert plane.bounds == pytest.approx(solid[0].bounds[:, :2])


def test_only_the_sole_of_a_mesh_goes_down():
    """A pyramid on the floor: below it a prism as wide as its base."""
    pv = pytest.importorskip("pyvista")
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)]
    faces = np.hstack([[4, 3, 2, 1, 0], [3, 0, 1, 4], [3, 1, 2, 4], [3, 2, 3, 4], [3, 3, 0, 4]])
    pyramid = Mesh(pv.PolyData(np.array(corners, dtype=float), faces))
    found = rooted(pyramid, Footing(axis=2, way=-1, plane=-0.01, near=0.1, reach=1.0))
    assert found.measure == pytest.approx(1 / 3 + 1.01)
    assert found.bounds[0, 2] == pytest.approx(-1.01)


def test_a_mesh_whose_soles_meet_in_a_point_stays():
    """Two cubes that touch in an edge above the floor and stand with one corner of each at one place."""
    pv = pytest.importorskip("pyvista")
    top = [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (2, 1, 1), (2, 2, 1), (1, 2, 1)]
    corners = np.array([*((x, y, 0.0) for x, y, _ in top), (0.5, 0.5, 1.0), (1.5, 1.5, 1.0)], dtype=float)
    soles = [(0, 1, 2, 3, 7), (2, 4, 5, 6, 8)]
    faces = []
    for *foot, tip in soles:
        faces += [[4, *foot[::-1]], *([3, foot[k], foot[(k + 1) % 4], tip] for k in range(4))]
    mesh = Mesh(pv.PolyData(corners, np.hstack(faces)))
    assert rooted(mesh, Footing(axis=2, way=-1, plane=0.0, near=0.1, reach=1.0)) is mesh


def test_what_does_not_stand_on_the_wall_stays():
    for surface in (Ball([0, 0.3], 0.3), Hollow(Ball([0, 0.3], 0.3)), box_surface([0, 0.2], [1, 1])):
        assert rooted(surface, FLOOR) is surface
        assert gap_of(surface, FLOOR) == 0.0
    deep = box_surface([0, -3.0], [1, 1])
    assert rooted(deep, FLOOR).bounds == pytest.approx(deep.bounds)


@pytest.mark.parametrize("lower", [[0, 0.06], [0, 0.06, 0]])
def test_a_gap_that_holds_no_particle_is_closed(lower):
    surface = box_surface(lower, [1] * len(lower))
    assert gap_of(surface, FLOOR) == pytest.approx(0.06)
    assert rooted(surface, FLOOR).bounds[0, 1] == -1.0


def tank(shape, spacing=0.0117, others=None, **body):
    """A tank whose walls, of whole cells, are not quite where its sides are, and a body on the floor."""
    sides = {"x": "free_slip", "y": {"lower": "free_slip", "upper": "open"}}
    more = {name: {"shape": {"box": box}, "wall": "free_slip"} for name, box in (others or {}).items()}
    return Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": spacing,
            "end_time": 1.0,
            "domain": {"lower": [0, 0], "upper": [1, 0.9], "boundary": sides},
            "gravity": [0, -9.81],
            "phases": {"water": {"density": 1000}},
            "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.3, 0.4]}}}],
            "bodies": {**more, "block": {"shape": shape, "wall": "free_slip", **body}},
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )


SHAPES = {
    "box": {"box": {"lower": [0.55, 0], "upper": [0.65, 0.1]}},
    "polygon": {"polygon": {"points": RECTANGLE}},
    "where": {"where": {"condition": "where(abs(x - 0.6) < 0.05, y, 1) < 0.1"}},
    "gap": {"box": {"lower": [0.55, 0.005], "upper": [0.65, 0.1]}},
    "polygon_gap": {"polygon": {"points": [[0.55, 0.005], [0.65, 0.005], [0.65, 0.1], [0.55, 0.1]]}},
}


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("motion", [{}, {"motion": {"translation": ["0.01*sin(t)", 0]}}])
def test_no_particle_of_a_body_on_the_floor_faces_down(kind, motion):
    """The faces before which fluid may be are three; water that got under a fourth was held by nothing there."""
    model = Model(tank(SHAPES[kind], **motion))
    fluid, particles = model.particles.fluid_count, model.particles
    assert model.geometry.body_names[-1] == "block"
    own = particles.get("wall_body") == len(model.geometry.body_names)
    assert own.sum() > 60 and particles.get("wall_normal")[own][:, 1].min() > -1e-6
    assert particles.get("position")[fluid:][own][:, 1].min() > model.geometry.lattice.lower[1]
    assert any("less than a particle takes" in text for text in model.geometry.warnings) == ("gap" in kind)


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus"])
def test_water_runs_over_a_polygon_on_the_floor_and_not_under_it(scheme):
    """Before, seven particles were inside by 0.4 s and the run diverged (Riemann), or three and by 0.95 s."""
    case = tank(SHAPES["polygon"]).replace({"numerics": {"scheme": scheme}})
    model = Model(case)
    model.stepper.prepare(fresh=True)
    block = box_surface([0.55, -1], [0.65, 0.1])
    while model.time < 1.2:
        model.stepper.run(1.2, 100)
        position = model.particles.get("position")[: model.particles.fluid_count].astype(float)
        depth = -block.signed_distance(position[position[:, 1] > -0.02])
        assert depth.max() < 0.3 * 0.0117 and math.isfinite(depth.max())


def test_outlines_that_touch_are_one():
    base, top = box_surface([0, 0], [2, 1]), box_surface([0.5, 1], [1.5, 2])
    apart = box_surface([5, 0], [6, 1])
    both = [joined(base, [apart, top], 1.0), joined(top, [base, apart], 1.0)]
    for found in both:
        assert found.measure == pytest.approx(3.0, rel=1e-5)
        assert found.extent == pytest.approx(8.0, rel=1e-5)
    assert (both[0].edges()[0] == both[1].edges()[0]).all()
    assert joined(base, [apart], 1.0) is base


def test_what_hangs_together_by_a_third_is_one():
    row = [box_surface([k, 0], [k + 1, 1]) for k in range(3)]
    ends = [joined(row[0], [row[1], row[2]], 1.0), joined(row[2], [row[0], row[1]], 1.0)]
    assert ends[0].measure == pytest.approx(3.0, rel=1e-5) and (ends[0].edges()[0] == ends[1].edges()[0]).all()


def test_a_disc_that_an_outline_cuts_is_joined():
    found = joined(box_surface([-1, -2], [1, 0]), [Ball([0, 0], 0.5)], 1.0)
    assert found.measure == pytest.approx(4.0 + math.pi / 8, rel=1e-3)


def test_a_brick_goes_on_into_the_brick_that_holds_its_face():
    base, top = box_surface([0, 0, 0], [2, 2, 1]), box_surface([0.5, 0.5, 1], [1.5, 1.5, 2])
    assert joined(top, [base], 0.4).bounds == pytest.approx(np.array([[0.5, 0.5, 0.6], [1.5, 1.5, 2]]))
    assert joined(top, [base], 9.0).bounds[0, 2] == pytest.approx(0.0)
    assert joined(base, [top], 0.4) is base
    aside = box_surface([2.5, 0.5, 1], [3.5, 1.5, 2])
    assert joined(aside, [base], 0.4) is aside


def test_a_block_of_two_boxes_has_the_particles_of_one():
    """Each row once, none between the two, and all of the surface: as the outline of both has them."""
    lower = {"lower": [0.55, 0], "upper": [0.65, 0.05]}
    upper = {"box": {"lower": [0.55, 0.05], "upper": [0.65, 0.1]}}
    two, one = Model(tank(upper, others={"base": lower})), Model(tank(SHAPES["box"]))
    places = []
    for model, names in ((two, ("base", "block")), (one, ("block",))):
        bodies = [model.geometry.body_names.index(name) + 1 for name in names]
        own = np.isin(model.particles.get("wall_body"), bodies)
        position = model.particles.get("position")[model.particles.fluid_count :][own]
        order = np.lexsort(position.round(4).T)
        sums = [float(model.particles.get(name)[own].sum()) for name in ("wall_area", "boundary_volume")]
        places.append((position[order], *sums))
    assert len(places[0][0]) == len(places[1][0])
    assert places[0][1] == pytest.approx(places[1][1], rel=1e-4)
    assert places[0][2] == pytest.approx(places[1][2], rel=1e-3)


@pytest.mark.parametrize(("scheme", "end"), [("riemann", 1.8), ("isph", 1.2)])
def test_no_water_gets_between_boxes_that_touch(scheme, end):
    """Before, a particle was inside at 1.6 s (Riemann), and the run diverged before 1.2 s (ISPH)."""
    base = {"lower": [0.5, 0], "upper": [0.7, 0.05]}
    tower = {"box": {"lower": [0.55, 0.05], "upper": [0.65, 0.15]}}
    model = Model(tank(tower, others={"base": base}).replace({"numerics": {"scheme": scheme}}))
    model.stepper.prepare(fresh=True)
    blocks = [box_surface([0.5, -1], [0.7, 0.05]), box_surface([0.55, -1], [0.65, 0.15])]
    while model.time < end:
        model.stepper.run(end, 100)
        position = model.particles.get("position")[: model.particles.fluid_count].astype(float)
        position = position[position[:, 1] > -0.02]
        assert min(block.signed_distance(position).min() for block in blocks) > -0.4 * 0.0117
