"""Contact angles: the normals of interfaces next to walls (theory: riemann#a8), the key `contact_angle`, drops on a wall."""

import dataclasses
import math

import numpy as np
import pytest
import warp as wp

from tests.helpers import Bench, Fluid, lattice
from tests.scenes import FULL, case_of
from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.kernels.core.spec import Spec, types
from warpsph.kernels.riemann.contact import make_wall_normal
from warpsph.running.model import Model
from warpsph.running.preview import describe
from warpsph.scene.physics import contact_matrix
from warpsph.schemes import riemann_program as riemann

SPEC = Spec(
    dimension=2,
    precision="float64",
    multiphase=True,
    walls=True,
    tension="pressure_jump",
    interface=True,
    contact_angle=True,
    leaning=True,
)
NEUTRAL = dataclasses.replace(SPEC, contact_angle=False, leaning=False)
ANGLES = (30, 60, 90, 120, 150)
LAYERS = 3  # of wall particles: the support is 3 spacings


# the formula -----------------------------------------------------------------------------------------------------


def wall_normal(unit, wall, angle, height):
    """Evaluate the `wp.func` for one set of values; angle in degrees."""
    dimension = len(unit)
    vec = types(dimension, "float64").vec
    function = make_wall_normal(dimension, "float64")

    @wp.kernel(module="unique", enable_backward=False)
    def apply(unit: vec, wall: vec, cosine: wp.float64, height: wp.float64, out: wp.array(dtype=vec)):
        out[0] = function(unit, wall, cosine, height)

    out = wp.zeros(1, dtype=vec, device="cpu")
    numbers = [vec(*unit), vec(*wall), math.cos(math.radians(angle)), height]
    wp.launch(apply, dim=1, inputs=[*numbers, out], device="cpu")
    return out.numpy()[0]


def turned(angle):
    """Normal out of a liquid that fills a wedge of `angle` degrees on the floor, to the left of its edge."""
    return np.array([math.sin(math.radians(angle)), math.cos(math.radians(angle))])


def test_a_wedge_on_a_flat_wall():
    """90 degrees: the normal is along the wall; towards 0, a film, it is that of the wall; towards 180 it points into it."""
    floor = [0.0, 1.0]
    for leaning in (40, 90, 140):
        np.testing.assert_allclose(wall_normal(turned(leaning), floor, 90, 0.0), [1, 0], atol=1e-12)
        np.testing.assert_allclose(wall_normal(turned(leaning), floor, 0.01, 0.0), [0, 1], atol=2e-4)
        np.testing.assert_allclose(wall_normal(turned(leaning), floor, 179.99, 0.0), [0, -1], atol=2e-4)
        np.testing.assert_allclose(wall_normal(turned(leaning), floor, 60, 0.0), turned(60), atol=1e-12)
    # the other edge of the wedge
    np.testing.assert_allclose(wall_normal([-1.0, 0.0], floor, 60, 0.0), turned(60) * [-1, 1], atol=1e-12)


def test_the_other_phase_sees_the_opposite():
    """Its normal is the opposite one and its angle the rest of 180 degrees."""
    mine = wall_normal(turned(80), [0.0, 1.0], 60, 0.3**0.5)
    np.testing.assert_allclose(wall_normal(-turned(80), [0.0, 1.0], 120, 0.3**0.5), -mine, atol=1e-12)


def test_the_computed_normal_takes_over_away_from_the_wall():
    floor = [0.0, 1.0]
    np.testing.assert_allclose(wall_normal(turned(100), floor, 60, 1.0), turned(100), atol=1e-12)
    # half and half: the direction in the middle of two unit vectors
    np.testing.assert_allclose(wall_normal(turned(100), floor, 60, 0.5**0.5), turned(80), atol=1e-12)


@pytest.mark.parametrize(("angle", "first", "second"), [(30, 13, 6), (60, 6, 3), (120, -3, -1), (150, -12, -6)])
def test_how_far_computed_normals_lean_at_a_wall(angle, first, second, device):
    """Why the prescribed angle takes over with a square (the figures at the head of `contact`, means of six starts)."""
    leaning = []
    for seed in range(6):
        bench, x = edge(90, interface=angle, seed=seed, device=device)
        bench.run(*(stage for stage in riemann.curvature(bench.spec) if stage.name in ("own_fraction", "colour_normal")))
        cosine, strong = outward(bench)[:, 1], bench.get("interface_weight") > 0.05
        rows = [strong & (x[:, 1] > row) & (x[:, 1] < row + 1) for row in range(2)]
        leaning.append([np.degrees(np.arccos(np.nanmean(cosine[row]))) - angle for row in rows])
    assert np.mean(leaning, axis=0) == pytest.approx([first, second], abs=1)


def test_a_film_along_the_wall_is_left_alone():
    """It does not meet the wall here; where it leans a little the prescribed normal comes in gradually."""
    floor = [0.0, 1.0]
    for film in ([0.0, 1.0], [0.0, -1.0], [1e-9, 1.0]):
        np.testing.assert_allclose(wall_normal(film, floor, 60, 0.0), film, atol=1e-8)
    bends = [wall_normal(turned(lean), floor, 60, 0.0) @ turned(60) for lean in (1, 4, 8, 20)]
    assert all(np.diff(bends) > 0) and bends[0] < 0.7 and bends[-1] == pytest.approx(1.0)


def test_three_dimensions():
    """The normal turns in the plane of the wall's and its own; an inclined wall."""
    wall = np.array([1.0, 2.0, 2.0]) / 3
    along = np.array([2.0, 1.0, -2.0]) / 3
    unit = (along + 0.4 * wall) / math.hypot(1, 0.4)
    found = wall_normal(unit, wall, 60, 0.0)
    np.testing.assert_allclose(found, along * math.sin(math.pi / 3) + wall * 0.5, atol=1e-12)


# the stage -------------------------------------------------------------------------------------------------------


def cosines_of(angle, count=2):
    """Contact angle of phase 0 against every other one."""
    matrix = np.zeros((count, count))
    matrix[0, 1:] = math.cos(math.radians(angle))
    return matrix - matrix.T


def edge(angle, interface=90, spec=SPEC, jitter=0.1, seed=1, **options):
    """Return (bench, positions) of a phase 0 that fills a wedge of `interface` degrees on the floor, all evaluated."""
    counts = (40, 12) if spec.dimension == 2 else (16, 7, 8)
    x = lattice(counts, 1.0, jitter, seed, centre=False)
    x[:, 0] -= 0.5 * counts[0]
    plane = [np.arange(n) + 0.5 for n in counts]
    plane[0] = plane[0] - 0.5 * counts[0]
    plane[1] = -np.arange(LAYERS) - 0.5
    walls = np.stack(np.meshgrid(*plane, indexing="ij"), axis=-1).reshape(-1, len(counts))
    normal = turned(interface)
    phase = (x[:, 0] * normal[0] + x[:, 1] * normal[1] > 0).astype(int)
    options = {"phase": phase, "fluids": (Fluid(), Fluid()), "cosines": cosines_of(angle), **options}
    bench = Bench(spec, x, spacing=1.0, walls=walls, **options)
    bench.run(*riemann.curvature(bench.spec))
    return bench, x


def outward(bench):
    """Unit normals out of phase 0, (n, d), nan where there is none."""
    normal = bench.get("normal") * np.where(bench.get("phase") == 0, -1, 1)[:, None]
    length = np.linalg.norm(normal, axis=1)
    return np.where((bench.get("interface_weight") > 0)[:, None], normal / np.maximum(length, 1e-300)[:, None], np.nan)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_first_row_has_the_contact_angle(angle, device):
    """On either side of the interface, whatever its own angle; further up less and less."""
    bench, x = edge(angle, device=device)
    unit = outward(bench)
    height = x[:, 1]
    strong = bench.get("interface_weight") > 0.05
    for side in (0, 1):
        first = strong & (height < 1) & (bench.get("phase") == side)
        assert first.any()
        # at the top of the row, 0.6 of 2.5 spacings, f = 0.24^2 of the computed normal, which is 60 degrees off at 30 and
        # 150: 2.9 degrees, and f times the few degrees that this leans by
        assert np.degrees(np.arccos(unit[first, 1])) == pytest.approx(angle, abs=3.3)
        assert (unit[first, 0] > 0).all()
    left = [np.nanmean((unit @ turned(angle))[strong & (height > row) & (height < row + 1)]) for row in range(3)]
    assert left[0] > 0.998 and (angle == 90 or left[0] > left[1] > left[2])


def test_out_of_reach_nothing_changes(device):
    """The lengths of normals do not change either, nor do their weights."""
    bench, x = edge(50, device=device)
    plain, _ = edge(50, spec=NEUTRAL, device=device)
    far = x[:, 1] > bench.support - 0.5 + 0.2
    assert (bench.get("interface_weight")[far] > 0.05).sum() > 10
    np.testing.assert_allclose(bench.get("normal")[far], plain.get("normal")[far], rtol=1e-12, atol=1e-12)
    assert np.abs(bench.get("normal") - plain.get("normal"))[x[:, 1] < 1].max() > 0.1
    lengths = [np.linalg.norm(one.get("normal"), axis=1) for one in (bench, plain)]
    np.testing.assert_allclose(*lengths, rtol=1e-12, atol=1e-12)
    weights = [one.get("interface_weight") for one in (bench, plain)]
    np.testing.assert_allclose(*weights, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("angle", [60, 120])
def test_the_curvature_at_the_wall_is_what_is_left_to_turn(angle, device):
    """A flat interface at 90 degrees: the curvature adds up to 90 degrees less the contact angle along it."""
    bench, x = edge(angle, jitter=0.05, device=device)
    kappa = np.where(bench.get("phase") == 0, 1, -1) * bench.get("curvature")
    weight = bench.get("interface_weight")
    rows = np.floor(x[:, 1]).astype(int)
    mean = [np.average(kappa[rows == row], weights=weight[rows == row]) for row in range(8)]
    # an interface that leans towards the wall as it comes near is hollow seen from the phase with the small angle
    assert sum(mean) == pytest.approx(math.radians(angle - 90), rel=0.25)
    assert np.abs(mean[6:]).max() < 0.03


def test_at_its_own_angle_an_interface_stays_flat(device):
    """A wedge of 60 degrees with a contact angle of 60: less curvature at the wall than without, where the normals lean."""
    largest = []
    for spec in (SPEC, NEUTRAL):
        found = []
        for seed in range(3):
            bench, x = edge(60, interface=60, spec=spec, seed=seed, device=device)
            low, weight = x[:, 1] < 3, bench.get("interface_weight")
            kappa = np.where(bench.get("phase") == 0, 1, -1) * bench.get("curvature")
            found.append(np.average(kappa[low], weights=weight[low]))
        largest.append(abs(np.mean(found)))
    assert largest[0] < 0.5 * largest[1]


def test_an_interface_that_does_not_reach_the_wall_keeps_its_normals():
    """The way to the wall along it, height over sine, is two reaches or more: a bubble beside a wall."""
    floor = [0.0, 1.0]
    for lean, height in ((20, 0.7), (10, 0.4), (160, 0.7)):
        np.testing.assert_allclose(wall_normal(turned(lean), floor, 90, height), turned(lean), atol=1e-12)
    # within one reach it counts whole, between one and two less and less
    whole = turned(30) * 0.49**2 + np.array([1.0, 0.0]) * (1 - 0.49**2)
    np.testing.assert_allclose(wall_normal(turned(30), floor, 90, 0.49), whole / np.linalg.norm(whole), atol=1e-12)
    left = [wall_normal(turned(30), floor, 90, height) @ turned(30) for height in (0.5, 0.6, 0.8, 0.99)]
    assert np.all(np.diff(left) > 0) and left[-1] > 1 - 1e-6


@pytest.mark.parametrize("triple", [0, 3], ids=["a normal", "a normal of each phase"])
def test_a_layer_that_meets_a_side_does_not_meet_the_floor(triple, device):
    """Three rows on the floor, in reach of it, beside a side: the mean of both walls turned normals by 45 degrees."""
    x = lattice((20, 12), 1.0, 0.0, 1, centre=False)
    around = np.stack(np.meshgrid(np.arange(-LAYERS, 20) + 0.5, np.arange(-LAYERS, 12) + 0.5), axis=-1).reshape(-1, 2)
    walls = around[(around < 0).any(axis=1)]
    spec = dataclasses.replace(SPEC, leaning=False, triple=triple)
    fluids = (Fluid(),) * max(triple, 2)
    bench = Bench(spec, x, spacing=1.0, walls=walls, phase=(x[:, 1] > 3).astype(int), fluids=fluids, device=device)
    bench.run(*riemann.curvature(bench.spec))
    normal = bench.get("normal")[(np.abs(x[:, 1] - 3) < 2) & (x[:, 0] < 4)]
    assert len(normal) == 16
    # sums over one side lean by a degree; near the side they are turned upright
    lean = np.degrees(np.arctan2(np.abs(normal[:, 0]), np.abs(normal[:, 1])))
    assert lean.max() < 2.0


def test_a_wall_in_three_dimensions(device):
    spec = dataclasses.replace(SPEC, dimension=3, periodic=(False,) * 3)
    bench, x = edge(60, spec=spec, device=device)
    first = (x[:, 1] < 1) & (bench.get("interface_weight") > 0.05) & (np.abs(x[:, 2] - 4) < 2)
    unit = outward(bench)[first]
    assert len(unit) >= 8
    assert np.degrees(np.arccos(unit[:, 1])) == pytest.approx(60, abs=4)
    assert np.abs(unit[:, 2]).max() < 0.3


def test_columns_give_the_same(device):
    """The layout for GPUs, which does without the compact list of the band."""
    rows, _ = edge(60, interface=110, device=device)
    columns, _ = edge(60, interface=110, spec=dataclasses.replace(SPEC, row_list=False), device=device)
    for name in ("contact_cosine", "normal", "curvature"):
        np.testing.assert_allclose(columns.get(name), rows.get(name), rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("triple", [False, True], ids=["a normal", "a normal of each phase"])
def test_each_pair_has_its_own_angle(triple, device):
    """Three phases side by side on a wall."""
    cosines = np.zeros((3, 3))
    for (a, b), angle in {(0, 1): 40, (1, 2): 120}.items():
        cosines[a, b] = math.cos(math.radians(angle))
        cosines[b, a] = -cosines[a, b]
    x = lattice((40, 12), 1.0, 0.1, centre=False)
    phase = np.digitize(x[:, 0], [14, 27])
    walls = np.stack(np.meshgrid(np.arange(40) + 0.5, -np.arange(LAYERS) - 0.5), axis=-1).reshape(-1, 2)
    fluids = (Fluid(), Fluid(), Fluid())
    spec = dataclasses.replace(SPEC, triple=3 if triple else 0)
    bench = Bench(spec, x, spacing=1.0, phase=phase, fluids=fluids, walls=walls, cosines=cosines, device=device)
    bench.run(*riemann.curvature(bench.spec))
    if triple:  # the weights of all phases; that of the own one is that of its normal
        own = np.take_along_axis(bench.get("interface_weight"), phase[:, None], axis=1)[:, 0]
    normal, weight = bench.get("normal"), own if triple else bench.get("interface_weight")
    first = (x[:, 1] < 1) & (weight > 0.05)
    for place, left, angle in ((14, 0, 40), (27, 1, 120)):
        rows = first & (np.abs(x[:, 0] - place) < 3)
        unit = normal[rows] / np.linalg.norm(normal[rows], axis=1)[:, None] * np.where(phase[rows] == left, -1, 1)[:, None]
        assert set(phase[rows]) == {left, left + 1}
        assert np.degrees(np.arctan2(unit[:, 0], unit[:, 1])) == pytest.approx(angle, abs=3)


# the key ---------------------------------------------------------------------------------------------------------


def test_the_angle_belongs_to_the_first_named_phase():
    case = case_of(FULL).replace({"surface_tension.0.contact_angle": 60})
    assert case.surface_tension[0].contact_angle == 60
    assert contact_matrix(case) == pytest.approx(np.array([[0, 0.5], [-0.5, 0]]))
    turned_round = case.replace({"surface_tension.0.between": ["liquid", "gas"]})
    assert contact_matrix(turned_round) == pytest.approx(np.array([[0, -0.5], [0.5, 0]]))
    assert Case.from_dict(case.to_dict()) == case
    assert case.resolved({})["surface_tension"][0]["contact_angle"] == 60
    assert case.replace({"surface_tension.0.contact_angle": "none"}).surface_tension[0].contact_angle is None


@pytest.mark.parametrize("value", [0, 180, -20, 200, "sixty", True, [60]])
def test_impossible_angles(value):
    with pytest.raises(CaseError, match="> 0 and < 180") as error:
        case_of(FULL).replace({"surface_tension.0.contact_angle": value})
    assert [problem.path for problem in error.value.problems] == ["surface_tension.0.contact_angle"]


def test_an_angle_needs_a_wall():
    changes = {"surface_tension.0.contact_angle": 60, "domain.boundary": {"x": "periodic", "y": "periodic"}, "gauges": {}}
    with pytest.raises(CaseError, match="angle at a wall, and there is none"):
        case_of(FULL).replace(changes)
    ball = {"ball": {"shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.2}}}}
    layer = {"box": {"lower": [0, 0], "upper": [1, 0.25]}}
    fluids = [{"phase": "liquid", "shape": layer}, {"phase": "gas", "shape": "rest"}]
    assert case_of(FULL).replace({**changes, "bodies": ball, "fluids": fluids})


def test_what_is_shown_and_what_runs():
    """90 degrees where nothing is given, with a stage; cosines are summed where an angle is another one."""
    upright = case_of(FULL)
    shown, less = describe(upright.replace({"surface_tension.0.contact_angle": 60})), describe(upright)
    assert [plan["structure"]["leaning"] for plan in (shown, less)] == [True, False]
    names = [[stage["name"] for stage in plan["stages"]] for plan in (shown, less)]
    assert names[0] == names[1]
    assert names[0].index("colour_normal") < names[0].index("contact_normal") < names[0].index("curvature")
    assert set(shown["structure"]["fields"]) - set(less["structure"]["fields"]) == {"contact_cosine"}
    told = describe(upright.replace({"surface_tension.0.contact_angle": 90}))
    assert told["structure"] == less["structure"]


@pytest.mark.parametrize(
    "changes",
    [
        {"surface_tension.0.coefficient": 0},
        {"domain.boundary": {"x": "periodic", "y": "periodic"}, "gauges": {}},
        {"numerics.formulation": "paper"},
    ],
    ids=["no tension", "no wall", "the printed form"],
)
def test_scenes_without_contact_angles(changes):
    plan = describe(case_of(FULL).replace(changes))
    assert plan["structure"]["contact_angle"] is False
    assert "contact_normal" in [row["name"] for row in plan["absent"]]


# drops on a wall -------------------------------------------------------------------------------------------------

DROP = {
    "title": "drop on the floor",
    "dimension": 2,
    "particle_spacing": 0.25 / 8,
    "end_time": 0.5,
    "domain": {
        "lower": [-0.5, 0],
        "upper": [0.5, 0.5],
        "boundary": {"x": "periodic", "y": {"lower": "free_slip", "upper": "wall"}},
    },
    "phases": {"liquid": {"density": 10, "viscosity": 0.5}, "gas": {"density": 1, "viscosity": 0.05, "gamma": 1.4}},
    "surface_tension": [{"between": ["liquid", "gas"], "coefficient": 1.0, "contact_angle": 90}],
    "fluids": [
        {"phase": "liquid", "shape": {"sphere": {"center": [0, 0], "radius": 0.25}}},
        {"phase": "gas", "shape": "rest"},
    ],
    "output": {"particles": "none", "checkpoint": "none"},
    "gauges": {"surface": {"type": "contour", "interval": 0.1}},
}


@pytest.mark.parametrize(("angle", "way"), [(60, 1), (90, 0), (120, -1)])
def test_a_half_disc_spreads_or_draws_back(angle, way):
    """By its contact angle; written for the gas, the rest of 180 degrees does the same."""
    case = case_of(DROP)
    pair = {"between": ["gas", "liquid"], "coefficient": 1.0, "contact_angle": 180 - angle}
    foot = []
    for change in ({"surface_tension.0.contact_angle": angle}, {"surface_tension": [pair]}):
        surface = Simulation(case.replace(change), threads=1).run().gauge("surface")
        foot.append((surface["highest_x liquid"] - surface["lowest_x liquid"])[[0, -1]] / 2)
    np.testing.assert_array_equal(foot[0], foot[1])
    moved = (foot[0][1] - foot[0][0]) / 0.25
    assert moved * way > 0.08 if way else abs(moved) < 0.04


# layers at rest --------------------------------------------------------------------------------------------------

WATER = {"density": 998, "viscosity": 1.0e-3}
OIL = {"density": 870, "viscosity": 0.05}
AIR = {"density": 1.2, "viscosity": 1.8e-5}
LAYER_TENSIONS = {("water", "oil"): 0.035, ("oil", "air"): 0.030, ("water", "air"): 0.072}


def layers_at_rest(phases, side):
    """Return a case with the fluids above one another, 6 mm each, between sides; no contact angle is given."""
    fluids = [
        {"phase": name, "shape": {"box": {"lower": [0, 0.006 * k], "upper": [0.016, 0.006 * (k + 1)]}}}
        for k, name in enumerate(phases)
    ]
    return Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": 0.001,
            "end_time": 0.2,
            "domain": {"lower": [0, 0], "upper": [0.016, 0.006 * len(phases)], "boundary": {"x": side, "y": "wall"}},
            "gravity": [0, -9.81],
            "phases": phases,
            "surface_tension": [
                {"between": list(pair), "coefficient": value}
                for pair, value in LAYER_TENSIONS.items()
                if set(pair) <= set(phases)
            ],
            "fluids": fluids,
            "start": {"pressure": "hydrostatic"},
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )


@pytest.mark.parametrize("phases", [{"water": WATER, "air": AIR}, {"water": WATER, "oil": OIL, "air": AIR}], ids=len)
def test_walls_do_not_drive_layers_at_rest(phases):
    """What is left moves as between periodic sides; where walls took no part it was 4 and 20 times as fast."""
    largest = {}
    for side in ("periodic", "wall"):
        model = Model(layers_at_rest(phases, side), threads=1)
        model.stepper.prepare(fresh=True)
        found = []
        for time in (0.05, 0.1, 0.15, 0.2):
            model.stepper.run(time, 10**6)
            velocity = model.particles.get("velocity")[: model.particles.fluid_count]
            found.append(np.linalg.norm(velocity, axis=1).max())
        largest[side] = max(found)
    assert largest["wall"] < 2 * largest["periodic"]
