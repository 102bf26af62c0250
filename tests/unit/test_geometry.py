"""Geometry: lattice, regions, walls, bodies and start values against counts and integrals done by hand."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.scene.geometry import build
from warpsph.scene.lattice import make_lattice
from warpsph.scene.masks import _inside_polygon, inside
from warpsph.scene.start_fluid import hydrostatic_pressure

BASE = {
    "dimension": 2,
    "particle_spacing": 0.1,
    "end_time": 1.0,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
    "phases": {"water": {"density": 1000}},
    "fluids": [{"phase": "water", "shape": "rest"}],
}


def make(**changes):
    """BASE with some keys exchanged."""
    return Case.from_dict(copy.deepcopy(BASE) | changes)


def domain(boundary, lower=(0, 0), upper=(1, 1)):
    return {"lower": list(lower), "upper": list(upper), "boundary": boundary}


def box(lower, upper):
    return {"box": {"lower": list(lower), "upper": list(upper)}}


def problems_of(case, support=0.3):
    with pytest.raises(CaseError) as caught:
        build(case, support)
    return [(problem.path, problem.rule) for problem in caught.value.problems]


def shape_of(description):
    """A Shape as a case makes it."""
    fluids = [{"phase": "water", "shape": description}]
    return make(domain=domain({}, (-9, -9), (9, 9)), fluids=fluids).fluids[0].shape


def rows(array):
    """Rows of a position array as a set, rounded."""
    return {tuple(row) for row in np.round(array, 9).tolist()}


# ------------------------------------------------------------------------------------------------------------
# lattice


def test_sites_stand_in_the_middle_of_cells():
    g = build(make(), 0.3)
    fluid = g.position[g.kind == 0]
    middles = 0.05 + 0.1 * np.arange(10)
    assert rows(fluid) == rows(np.array([(x, y) for x in middles for y in middles]))
    assert g.volume == pytest.approx(0.01)
    assert g.volume[: g.fluid_count].sum() == pytest.approx(1.0)
    assert not g.warnings


def test_types_and_order():
    g = build(make(), 0.25)
    n = 16 * 16
    assert (g.count, g.fluid_count, g.wall_count) == (n, 100, n - 100)
    for array, shape, kind in [
        (g.position, (n, 2), np.float64),
        (g.velocity, (n, 2), np.float64),
        (g.phase, (n,), np.int32),
        (g.kind, (n,), np.uint8),
        (g.volume, (n,), np.float64),
        (g.pressure, (n,), np.float64),
        (g.wall_slip, (n,), np.uint8),
        (g.boundary_velocity, (n, 2), np.float64),
        (g.body, (n,), np.int32),
    ]:
        assert array.shape == shape and array.dtype == kind and array.flags.c_contiguous
    assert (np.diff(g.kind.astype(int)) >= 0).all(), "fluid first"
    assert (g.phase[g.kind == 1] == -1).all() and (g.phase[g.kind == 0] == 0).all()
    assert (g.body[g.kind == 0] == 0).all() and (g.body[g.kind == 1] > 0).all()


def test_rounded_spacing_fits():
    """A spacing typed with ten digits divides the domain; the lattice then fills it exactly."""
    g = build(make(particle_spacing=0.03846153846, domain=domain({"x": "wall"}, (-1, -1), (1, 1))), 0.1)
    assert g.lattice.count == (52, 52)
    assert g.lattice.upper == pytest.approx((1, 1), abs=1e-14)
    assert not g.warnings


def test_misfit_is_centred():
    g = build(make(domain=domain({}, upper=(1.03, 1.0))), 0.3)
    x = g.position[:, 0]
    assert g.lattice.count == (10, 10) and g.lattice.spacing == pytest.approx((0.1, 0.1))
    assert x.min() == pytest.approx(0.065) and x.max() == pytest.approx(1.03 - 0.065)
    assert len(g.warnings) == 1 and "along x" in g.warnings[0] and "particle_spacing" in g.warnings[0]


def test_misfit_of_a_periodic_axis_is_stretched():
    g = build(make(domain=domain({"x": "periodic"}, upper=(1.03, 1.0))), 0.3)
    assert g.lattice.spacing == pytest.approx((0.103, 0.1))
    assert g.volume.sum() == pytest.approx(1.03)
    assert np.diff(np.unique(g.position[:, 0])) == pytest.approx(0.103)
    assert len(g.warnings) == 1


def test_domain_thinner_than_a_particle():
    case = make()
    object.__setattr__(case, "particle_spacing", 3.0)  # the case's own check would come first
    assert [path for path, _ in problems_of(case)] == ["particle_spacing", "particle_spacing"]


def test_periodic_axis_shorter_than_the_support():
    case = make(domain=domain({"x": "periodic", "y": "wall"}))
    assert build(case, 0.5).fluid_count == 100
    assert [path for path, _ in problems_of(case, 0.51)] == ["domain.boundary.x"]


def test_support_has_to_be_a_length():
    for support in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="support"):
            build(make(), support)


# ------------------------------------------------------------------------------------------------------------
# shapes


def test_two_phases_of_the_square_droplet():
    fluids = [{"phase": "gas", "shape": box((-0.5, -0.5), (0.5, 0.5))}, {"phase": "liquid", "shape": "rest"}]
    phases = {"liquid": {"density": 1000}, "gas": {"density": 1}}
    case = make(particle_spacing="2/52", domain=domain({"x": "wall", "y": "wall"}, (-1, -1), (1, 1)),
                phases=phases, fluids=fluids)  # fmt: skip
    g = build(case, 3 * 2 / 52)
    assert np.bincount(g.phase[g.kind == 0]).tolist() == [52 * 52 - 26 * 26, 26 * 26]
    assert g.volume[g.phase == 1].sum() == pytest.approx(1.0)
    gas = g.position[g.phase == 1]
    assert gas.mean(axis=0) == pytest.approx((0, 0)) and np.abs(gas).max() < 0.5
    assert g.wall_count == 58**2 - 52**2, "three layers, not four by rounding"


def test_box_face_through_sites():
    """Half-open: the area stays right, the box is moved, and the user is told."""
    fluids = [{"phase": "water", "shape": box((-0.5, -0.5), (0.5, 0.5))}]
    g = build(make(particle_spacing=0.04, domain=domain({}, (-1, -1), (1, 1)), fluids=fluids), 0.12)
    assert g.fluid_count == 25 * 25
    assert len(g.warnings) == 2 and all("fluids.0" in line for line in g.warnings)


@pytest.mark.parametrize("edge", [0.05 + 0.1 * k for k in range(1, 10)])
def test_site_on_a_border_belongs_to_the_upper_side(edge):
    """Whatever the rounding of the site and of the border."""
    axes = [0.1 * (np.arange(10) + 0.5)] * 2
    below = round((edge - 0.05) / 0.1)
    points = [[-1, -1], [edge, -1], [edge, 2], [-1, 2]]
    condition = {"where": {"condition": f"x < {edge!r}"}}
    for shape in (box((-1, -1), (edge, 2)), {"polygon": {"points": points}}, condition):
        mask = inside(shape_of(shape), axes, 0.1)
        assert mask[:below].all() and not mask[below:].any()


def test_regions_that_share_a_border_share_no_site():
    """Boxes, and triangles cut along a diagonal that runs through sites, fill the domain exactly once."""
    pieces = [
        box((0, 0), (0.45, 1)),
        {"polygon": {"points": [[0.45, 0], [1, 0], [1, 0.55]]}},
        {"polygon": {"points": [[0.45, 0], [1, 0.55], [1, 1], [0.45, 1]]}},
    ]
    g = build(make(domain=domain({}), fluids=[{"phase": "water", "shape": piece} for piece in pieces]), 0.3)
    assert g.fluid_count == 100


def test_disc_is_symmetric_and_has_its_area():
    axes = [np.arange(-50, 51) * 0.1] * 2
    mask = inside(shape_of({"sphere": {"center": [0, 0], "radius": 4.0}}), axes, 0.1)
    for mirror in (mask[::-1], mask[:, ::-1], mask.T):
        assert (mask == mirror).all()
    assert mask.sum() == 5025 - 12, "Gauss's circle of radius 40, less its 12 points on the border"


def test_condition_of_one_coordinate():
    axes = [np.linspace(0, 1, 5), np.linspace(0, 1, 9)]
    mask = inside(shape_of({"where": {"condition": "y < 0.4"}}), axes, 0.1)
    assert mask.shape == (5, 9)
    assert (mask == (axes[1] < 0.4)).all()
    assert inside(shape_of({"where": {"condition": "r < 0.5 and not x > 0.3"}}), axes, 0.1).sum() == 4 + 4


@settings(deadline=None)
@given(
    points=st.lists(st.tuples(*[st.integers(-30, 30)] * 2), min_size=3, max_size=9),
    x=st.lists(st.integers(-40, 40), min_size=1, max_size=12, unique=True),
    y=st.lists(st.integers(-40, 40), min_size=1, max_size=12, unique=True),
)
def test_polygon_against_a_point_by_point_test(points, x, y):
    """Any polygon, also one that crosses itself; sites are kept off the corners' grid."""
    x, y = np.sort(x) + 0.31, np.sort(y) + 0.27
    expected = np.zeros((len(x), len(y)), dtype=bool)
    for i, a in enumerate(x):
        for j, b in enumerate(y):
            turns = 0.0
            for (x1, y1), (x2, y2) in zip(points, points[1:] + points[:1], strict=True):
                angle = math.atan2(y2 - b, x2 - a) - math.atan2(y1 - b, x1 - a)
                turns += (angle + math.pi) % (2 * math.pi) - math.pi
            expected[i, j] = round(turns / (2 * math.pi)) % 2 == 1
    found = _inside_polygon(x, y, np.array(points, dtype=float))
    # On an edge the angle test has no answer.
    on_edge = np.zeros_like(expected)
    for (x1, y1), (x2, y2) in zip(points, points[1:] + points[:1], strict=True):
        length = math.hypot(x2 - x1, y2 - y1)
        if length:
            offset = ((x[:, None] - x1) * (y2 - y1) - (y[None] - y1) * (x2 - x1)) / length
            on_edge |= np.abs(offset) < 1e-9
    assert (found == expected)[~on_edge].all()


def test_concave_polygon():
    """An L: the notch stays free."""
    points = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
    middles = np.arange(-5, 30) * 0.1 + 0.05
    mask = inside(shape_of({"polygon": {"points": points}}), [middles, middles], 0.1)
    assert mask.sum() == 300
    assert not mask[np.ix_(middles > 1, middles > 1)].any()


# ------------------------------------------------------------------------------------------------------------
# regions


def test_overlap_names_both_regions_and_a_place():
    fluids = [
        {"phase": "water", "shape": box((0, 0), (0.6, 1))},
        {"phase": "water", "shape": box((0.5, 0.5), (1, 1))},
    ]
    ((path, rule),) = problems_of(make(fluids=fluids))
    assert path == "fluids.1.shape"
    assert "overlaps fluids.0 at (0.55, 0.55) (5 particles" in rule


def test_empty_regions_are_reported_together():
    fluids = [
        {"phase": "water", "shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.01}}},
        {"phase": "water", "shape": {"where": {"condition": "x > 7"}}},
    ]
    assert [path for path, _ in problems_of(make(fluids=fluids))] == ["fluids.0.shape", "fluids.1.shape"]


def test_rest_without_room():
    fluids = [{"phase": "water", "shape": box((0, 0), (1, 1))}, {"phase": "water", "shape": "rest"}]
    assert [path for path, _ in problems_of(make(fluids=fluids))] == ["fluids.1.shape"]


def test_no_fluid_left_by_a_body():
    case = make(bodies={"block": {"shape": box((0, 0), (1, 1))}})
    assert problems_of(case) == [("bodies.block.shape", "leaves no room for fluid: it fills the whole domain")]


def test_without_rest_the_domain_stays_empty():
    fluids = [{"phase": "water", "shape": box((0, 0), (0.4, 0.5))}]
    g = build(make(fluids=fluids), 0.3)
    assert g.fluid_count == 20 and g.volume[:20].sum() == pytest.approx(0.2)


# ------------------------------------------------------------------------------------------------------------
# walls


def walls_at(g, x, y):
    """Row of the wall particle at (x, y)."""
    at = np.flatnonzero((g.kind == 1) & (np.abs(g.position - (x, y)) < 1e-9).all(axis=1))
    assert len(at) == 1
    return at[0]


@pytest.mark.parametrize("support, layers", [(0.25, 3), (0.3, 3), (0.30001, 4), (0.1, 1), (3 * 0.1, 3)])
def test_layers_reach_as_far_as_the_support(support, layers):
    g = build(make(), support)
    assert g.wall_count == (10 + 2 * layers) ** 2 - 100
    assert g.position.min() == pytest.approx(-(layers - 0.5) * 0.1)
    assert len(rows(g.position)) == g.count, "no two particles share a site"


def test_channel_walls_span_the_period():
    g = build(make(domain=domain({"x": "periodic", "y": {"lower": "wall", "upper": "open"}})), 0.3)
    wall = g.position[g.kind == 1]
    assert g.body_names == ("y_lower",)
    assert len(wall) == 10 * 3
    assert (wall[:, 1] < 0).all() and wall[:, 0].min() > 0 and wall[:, 0].max() < 1


def test_wall_beside_an_open_side_goes_on():
    g = build(make(domain=domain({"x": "open", "y": {"lower": "wall", "upper": "open"}})), 0.3)
    wall = g.position[g.kind == 1]
    assert len(wall) == 16 * 3 and (wall[:, 1] < 0).all()
    assert wall[:, 0].min() == pytest.approx(-0.25) and wall[:, 0].max() == pytest.approx(1.25)


def test_walls_without_any():
    g = build(make(domain=domain({"x": "periodic"})), 0.3)
    assert g.wall_count == 0 and g.body_names == () and g.count == 100


def test_lid_slip_and_bodies():
    boundary = {
        "x": {"lower": "wall", "upper": "free_slip"},
        "y": {"lower": "free_slip", "upper": {"wall": "no_slip", "velocity": [2, 0]}},
    }
    g = build(make(domain=domain(boundary)), 0.3)
    assert g.body_names == ("x_lower", "x_upper", "y_lower", "y_upper")

    def of(x, y):
        k = walls_at(g, x, y)
        assert (g.velocity[k] == g.boundary_velocity[k]).all()
        return g.body_names[g.body[k] - 1], int(g.wall_slip[k]), g.boundary_velocity[k].tolist()

    assert of(-0.15, 0.45) == ("x_lower", 0, [0, 0])
    assert of(1.15, 0.45) == ("x_upper", 1, [0, 0])
    assert of(0.45, -0.15) == ("y_lower", 1, [0, 0])
    assert of(0.45, 1.25) == ("y_upper", 0, [2, 0])
    # corners: the no-slip walls decide; the lid goes on beyond the edge; the body is the wall they are deepest behind
    assert of(1.05, 1.25) == ("y_upper", 0, [2, 0])
    assert of(-0.05, 1.25) == ("y_upper", 0, [2, 0])
    assert of(-0.25, 1.05) == ("x_lower", 0, [2, 0])
    assert of(-0.15, -0.25) == ("y_lower", 0, [0, 0])
    assert of(1.15, -0.15) == ("x_upper", 1, [0, 0])
    assert (g.boundary_velocity[g.kind == 0] == 0).all() and (g.wall_slip[g.kind == 0] == 0).all()
    moving = g.boundary_velocity[:, 0] != 0
    assert moving.sum() == 3 * (10 + 3 + 3), "above the fluid and both corners"


def test_each_of_two_moving_walls_goes_on_beyond_their_corner():
    boundary = {"x": {"wall": "no_slip", "velocity": [0, 3]}, "y": {"wall": "no_slip", "velocity": [2, 0]}}
    g = build(make(domain=domain(boundary)), 0.3)
    beyond = (g.position < 0) | (g.position > 1)
    expected = beyond[:, ::-1] * [2, 3]
    assert (g.boundary_velocity == expected).all()


def test_a_body_cuts_the_fluid():
    shapes = [{"phase": "water", "shape": box((0, 0), (0.6, 1))}, {"phase": "water", "shape": "rest"}]
    bodies = {
        "block": {"shape": box((0.3, 0.3), (0.5, 0.5))},
        "other": {"shape": box((0.4, 0.4), (0.7, 0.7)), "wall": "free_slip"},
    }
    g = build(make(fluids=shapes, bodies=bodies), 0.3)
    assert g.body_names[4:] == ("block", "other")
    assert g.fluid_count == 100 - 4 - 9 + 1
    assert (g.body == 5).sum() == 4 and (g.body == 6).sum() == 8, "the first has the shared cell"
    assert (g.wall_slip[g.body == 5] == 0).all() and (g.wall_slip[g.body == 6] == 1).all()
    assert len(rows(g.position)) == g.count


def test_a_body_on_an_open_side_and_in_a_wall():
    """Beyond an open side a body goes on for the layers of a wall; where a wall is, the wall stays."""
    boundary = {"x": {"lower": "wall", "upper": "open"}, "y": "open"}
    block = {"shape": box((-5, 0.2), (5, 0.8))}
    g = build(make(domain=domain(boundary), bodies={"bar": block}), 0.3)
    bar = g.position[g.body == 2]
    assert len(bar) == 6 * 13
    assert (bar[:, 0].min(), bar[:, 0].max()) == pytest.approx((0.05, 1.25))
    assert len(rows(g.position)) == g.count


def test_a_body_without_particles():
    bodies = {"block": {"shape": box((0.3, 0.3), (0.6, 0.6))}, "core": {"shape": box((0.4, 0.4), (0.5, 0.5))}}
    assert [path for path, _ in problems_of(make(bodies=bodies))] == ["bodies.core.shape"]


# ------------------------------------------------------------------------------------------------------------
# start values


def test_noise_is_bounded_repeatable_and_seeded():
    def positions(**start):
        return build(make(start=start), 0.3).position

    still = positions()
    noisy = positions(noise=0.2, seed=7)
    assert (noisy == positions(noise=0.2, seed=7)).all()
    assert not (noisy == positions(noise=0.2, seed=8)).all()
    shift = noisy - still
    assert np.abs(shift).max() <= 0.02 and np.abs(shift[:100]).max() > 0.019
    assert np.std(shift[:100]) == pytest.approx(0.02 / math.sqrt(3), rel=0.15)
    assert (shift[100:] == 0).all(), "walls stay"


def test_noise_stays_off_the_walls_and_inside_the_period():
    boundary = {"x": "periodic", "y": {"lower": "wall", "upper": "open"}}
    g = build(make(particle_spacing=0.02, domain=domain(boundary), start={"noise": 0.3}), 0.06)
    x, y = g.position[g.kind == 0].T
    assert x.min() >= 0 and x.max() < 1
    assert y.min() == pytest.approx(0.25 * 0.02), "some particle is stopped there"
    assert y.max() > 1 - 0.25 * 0.02, "no wall there"


def test_noise_across_a_period_keeps_the_particle_inside():
    """Displacements never reach a border (0.3 < 0.5), except for one made to: the wrap itself."""
    case = make(domain=domain({"x": "periodic"}))
    object.__setattr__(case.start, "noise", 0.9)
    object.__setattr__(case.start, "seed", 3)
    g = build(case, 0.3)
    x = g.position[:, 0]
    assert x.min() >= 0 and x.max() < 1
    jumps = np.abs(x - build(make(domain=domain({"x": "periodic"})), 0.3).position[:, 0])
    assert (jumps > 0.9).any(), "somebody crossed"


def test_velocity_is_taken_where_the_particle_is():
    g = build(make(start={"noise": 0.3, "velocity": ["x + 2*y", -3]}), 0.3)
    fluid = g.kind == 0
    assert g.velocity[fluid, 0] == pytest.approx(g.position[fluid] @ (1, 2))
    assert (g.velocity[fluid, 1] == -3).all() and (g.velocity[~fluid] == 0).all()


def test_pressure_from_a_formula():
    g = build(make(start={"noise": 0.3, "pressure": "10*x*y"}), 0.3)
    fluid = g.kind == 0
    assert g.pressure[fluid] == pytest.approx(10 * g.position[fluid].prod(axis=1))
    assert (g.pressure[~fluid] == 0).all()


def test_values_that_are_not_finite():
    found = problems_of(make(start={"velocity": ["log(x - 0.5)", "1/(y - y)"], "pressure": "sqrt(-x)"}))
    assert [path for path, _ in found] == ["start.velocity.0", "start.velocity.1", "start.pressure"]


def test_hydrostatic_one_phase_closed_tank():
    g = build(make(gravity=[0, -10], start={"pressure": "hydrostatic"}), 0.3)
    fluid = g.kind == 0
    assert g.pressure[fluid] == pytest.approx(1000 * 10 * (1 - g.position[fluid, 1]), rel=1e-13)
    assert (g.pressure[~fluid] == 0).all()


@pytest.mark.parametrize("noise", [0, 0.3])
def test_hydrostatic_two_layers(noise):
    """p is the integral of rho g from the top; displaced particles have the pressure of where they are."""
    fluids = [{"phase": "water", "shape": box((0, 0), (1, 0.6))}, {"phase": "air", "shape": "rest"}]
    phases = {"water": {"density": 1000}, "air": {"density": 1}}
    start = {"pressure": "hydrostatic", "noise": noise}
    case = make(gravity=[0, -9.81], start=start, fluids=fluids, phases=phases)
    g = build(case, 0.3)
    y = g.position[:, 1]
    air, water = g.phase == 1, g.phase == 0
    assert g.pressure[air] == pytest.approx(9.81 * (1 - y[air]), rel=1e-12)
    assert g.pressure[water] == pytest.approx(9.81 * (0.4 + 1000 * (0.6 - y[water])), rel=1e-12)


AIR_AND_WATER = {"air": {"density": 1.2, "gamma": 1.4}, "water": {"density": 1000}}
TANK = {"x": "wall", "y": {"lower": "wall", "upper": "open"}}
COLUMN = [{"phase": "water", "shape": box((0, 0), (0.3, 0.5))}, {"phase": "air", "shape": "rest"}]


@pytest.mark.parametrize(
    ("boundary", "fluids", "keys"),
    [
        (TANK, COLUMN, ["domain.boundary.y.upper"]),
        ({"x": "open", "y": TANK["y"]}, COLUMN, ["domain.boundary.x", "domain.boundary.y.upper"]),
        ({}, COLUMN, ["domain.boundary.x", "domain.boundary.y"]),
        # the reach is three cells, two of them of water
        (TANK, [{"phase": "air", "shape": box((0, 0), (1, 0.8))}, {"phase": "water", "shape": "rest"}],
         ["domain.boundary.y.upper"]),
        ({"x": "wall", "y": "wall"}, [COLUMN[0], {"phase": "air", "shape": box((0.3, 0), (1, 0.5))}], ["fluids"]),
        ({"x": "periodic", "y": "wall"}, [COLUMN[0], {"phase": "air", "shape": box((0.8, 0), (1, 1))}], ["fluids"]),
    ],
)  # fmt: skip
def test_a_gas_at_an_open_side_or_at_empty_space_is_refused(boundary, fluids, keys):
    """Nothing holds its pressure there."""
    case = make(domain=domain(boundary), phases=AIR_AND_WATER, fluids=fluids)
    with pytest.raises(CaseError) as caught:
        build(case, 0.3)
    assert sorted(problem.path for problem in caught.value.problems) == keys
    for problem in caught.value.problems:
        assert "the gas air (1.2 kg/m^3 beside 1000) meets" in problem.rule and "nothing holds its pressure" in problem.rule
        assert "leave the gas out" in problem.remedy and (problem.path == "fluids" or problem.value == "open")


@pytest.mark.parametrize(
    ("boundary", "fluids", "changes"),
    [
        ({"x": "wall", "y": "wall"}, COLUMN, {}),
        ({"x": "periodic", "y": "wall"}, COLUMN, {}),
        # a bubble inside of a liquid with a free surface or an open side
        (TANK, [{"phase": "air", "shape": box((0, 0), (1, 0.7))}, {"phase": "water", "shape": "rest"}], {}),
        (TANK, [{"phase": "air", "shape": box((0, 0), (0.5, 0.4))}, {"phase": "water", "shape": box((0, 0.4), (1, 0.8))},
                {"phase": "water", "shape": box((0.5, 0), (1, 0.4))}], {}),
        # oil on water is no gas, and a gas alone has nothing to be light beside
        (TANK, COLUMN, {"phases": {"air": {"density": 800}, "water": {"density": 1000}}}),
        (TANK, [{"phase": "air", "shape": box((0, 0), (1, 0.5))}], {"phases": {"air": {"density": 1.2}}}),
        # a lid holds it, however thin
        (TANK, [{"phase": "air", "shape": box((0, 0), (0.5, 0.8))}, {"phase": "water", "shape": box((0.5, 0), (1, 0.8))}],
         {"bodies": {"lid": {"shape": box((0, 0.8), (1, 0.9))}}}),
    ],
)  # fmt: skip
def test_a_gas_that_something_holds_is_fine(boundary, fluids, changes):
    build(make(**{"domain": domain(boundary), "phases": AIR_AND_WATER, "fluids": fluids, **changes}), 0.3)


def test_a_gas_at_an_open_side_in_three_dimensions():
    sides = {"x": "periodic", "y": "wall", "z": {"lower": "wall", "upper": "open"}}
    space = {"dimension": 3, "domain": domain(sides, (0, 0, 0), (1, 1, 1)), "phases": AIR_AND_WATER}
    water = {"phase": "water", "shape": box((0, 0, 0), (1, 1, 0.5))}
    assert [path for path, _ in problems_of(make(**space, fluids=[water, {"phase": "air", "shape": "rest"}]))] == [
        "domain.boundary.z.upper"
    ]


def test_hydrostatic_free_surface_counts_from_each_columns_top():
    fluids = [{"phase": "water", "shape": {"where": {"condition": "y < 0.3 + 0.4*x"}}}]
    g = build(make(gravity=[0, -10], start={"pressure": "hydrostatic"}, fluids=fluids), 0.3)
    (x, y), p = g.position[: g.fluid_count].T, g.pressure[: g.fluid_count]
    assert len(np.unique(x)) == 10
    for column in np.unique(x):
        here = x == column
        assert p[here] == pytest.approx(1e4 * (y[here].max() + 0.05 - y[here]), rel=1e-12)


@pytest.mark.parametrize("gravity, depth", [((10, 0), lambda x, y: x), ((-10, 0), lambda x, y: 1 - x),
                                            ((0, 10), lambda x, y: y + 1)])  # fmt: skip
def test_hydrostatic_follows_gravity(gravity, depth):
    """Also where rows and columns differ in number."""
    tank = domain({"x": "wall", "y": "wall"}, lower=(0, -1))
    tall = make(domain=tank, gravity=list(gravity), start={"pressure": "hydrostatic"})
    g = build(tall, 0.3)
    fluid = g.kind == 0
    assert g.pressure[fluid] == pytest.approx(1e4 * depth(*g.position[fluid].T), rel=1e-12)


def test_hydrostatic_around_bodies():
    """A block across the interface, one hanging from the ceiling: pressure depends on the level alone."""
    fluids = [{"phase": "water", "shape": box((0, 0), (1, 0.6))}, {"phase": "oil", "shape": "rest"}]
    phases = {"water": {"density": 1000}, "oil": {"density": 800}}
    bodies = {"one": {"shape": box((0.1, 0.4), (0.4, 0.8))}, "two": {"shape": box((0.7, 0.7), (0.8, 1))}}
    case = make(gravity=[0, -10], start={"pressure": "hydrostatic"}, fluids=fluids, phases=phases,
                bodies=bodies)  # fmt: skip
    g = build(case, 0.3)
    fluid = g.kind == 0
    y = g.position[fluid, 1]
    expected = np.where(y > 0.6, 8000 * (1 - y), 3200 + 1e4 * (0.6 - y))
    assert g.pressure[fluid] == pytest.approx(expected, rel=1e-12)


def test_hydrostatic_half_sunk_block():
    """Below a block that floats in a free surface there is the pressure of that level."""
    density = np.zeros((6, 6))
    density[:, :4] = 1.0
    solid = np.zeros((6, 6), dtype=bool)
    solid[2:4, 2:5] = True
    density[solid] = 0
    p = hydrostatic_pressure(density, solid, 1, -1.0, 1.0)
    assert p[:, :2] == pytest.approx(np.broadcast_to([3.5, 2.5], (6, 2)))


def test_hydrostatic_below_a_body_follows_its_nearest_neighbour():
    """Two liquids side by side and a block at the ceiling: each half of the block belongs to its side."""
    density = np.repeat([[1.0], [1.0], [1.0], [5.0], [5.0], [5.0]], 3, axis=1)
    solid = np.zeros((6, 3), dtype=bool)
    solid[1:5, 0] = True
    expected = np.cumsum(density, axis=1) - density / 2
    density[solid] = 0
    assert hydrostatic_pressure(density, solid, 1, 1.0, 1.0)[:, 1:] == pytest.approx(expected[:, 1:])


def test_hydrostatic_below_a_level_that_is_all_solid():
    density = np.array([[2.0, 2.0, 0.0, 3.0]])
    solid = np.array([[False, False, True, False]])
    assert hydrostatic_pressure(density, solid, 1, 1.0, 1.0)[0] == pytest.approx([1, 3, 5, 7.5])


def test_hydrostatic_warnings_and_refusal():
    start = {"pressure": "hydrostatic"}
    g = build(make(start=start), 0.3)
    assert (g.pressure == 0).all() and "without gravity" in g.warnings[0]
    g = build(make(start=start, gravity=[1, -10]), 0.3)
    assert "y component only" in g.warnings[0]
    case = make(gravity=[0, -10], start=start)
    object.__setattr__(case.domain, "boundary", make(domain=domain({"y": "periodic"})).domain.boundary)
    assert [path for path, _ in problems_of(case)] == ["start.pressure"]


# ------------------------------------------------------------------------------------------------------------
# three dimensions

CUBE = {
    "dimension": 3,
    "particle_spacing": 0.1,
    "domain": {"lower": [0, 0, 0], "upper": [0.6, 1, 0.8],
               "boundary": {"x": "wall", "y": "periodic", "z": {"lower": "wall", "upper": "free_slip"}}},
}  # fmt: skip


def test_three_dimensions():
    g = build(make(**CUBE, gravity=[0, 0, -10], start={"pressure": "hydrostatic", "noise": 0.1}), 0.2)
    assert g.fluid_count == 6 * 10 * 8 and g.volume[: g.fluid_count].sum() == pytest.approx(0.48)
    assert g.wall_count == 10 * (10 * 12 - 6 * 8)
    assert g.body_names == ("x_lower", "x_upper", "z_lower", "z_upper")
    fluid = g.kind == 0
    assert g.pressure[fluid] == pytest.approx(1e4 * (0.8 - g.position[fluid, 2]), rel=1e-12)
    assert g.wall_slip.sum() == 6 * 10 * 2, "edges belong to the no-slip side"


def test_three_dimensional_shapes():
    phases = {"water": {"density": 1000}, "oil": {"density": 800}, "mud": {"density": 2000}}
    fluids = [
        {"phase": "oil", "shape": {"sphere": {"center": [0.5, 0.5, 0.5], "radius": 0.3}}},
        {"phase": "mud", "shape": box((0, 0, 0), (1, 1, 0.1))},
        {"phase": "water", "shape": {"where": {"condition": "z > 0.1 and hypot(x - 0.5, y - 0.5) > 0.35"}}},
    ]
    case = make(dimension=3, particle_spacing=0.02, domain=domain({}, (0, 0, 0), (1, 1, 1)), phases=phases,
                fluids=fluids)  # fmt: skip
    g = build(case, 0.06)
    volumes = [g.volume[g.phase == k].sum() for k in range(3)]
    assert volumes == pytest.approx([0.9 * (1 - math.pi * 0.35**2), 4 / 3 * math.pi * 0.3**3, 0.1], rel=2e-2)


def test_a_corner_of_three_walls():
    lid = {"wall": "no_slip", "velocity": [1, 0, 0]}
    cube = domain({"x": "free_slip", "y": lid, "z": lid}, (0, 0, 0), (1, 1, 1))
    g = build(make(dimension=3, particle_spacing=0.25, domain=cube), 0.5)
    corner = np.flatnonzero((np.abs(g.position - (-0.125, -0.125, 1.125)) < 1e-9).all(axis=1))
    assert g.boundary_velocity[corner].tolist() == [[1, 0, 0]], "both no-slip walls agree"
    assert g.body_names[g.body[corner[0]] - 1] == "y_lower"
    assert g.count == 8**3


def test_make_lattice_alone():
    lattice = make_lattice(make(), 0.3)
    assert lattice.shape == (16, 16) and lattice.cell_volume == pytest.approx(0.01)
    assert lattice.axis(0)[lattice.domain[0]] == pytest.approx(0.05 + 0.1 * np.arange(10))
