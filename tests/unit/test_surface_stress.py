"""Pressure and friction along the surface of bodies: exact ones, their sum, and where the stations are."""

import math

import numpy as np
import pytest

from tests.unit.test_bodies_riemann import Annulus, circle, made
from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.measure.gauges import GaugeSet
from warpsph.running.model import Model
from warpsph.running.recorder import Recorder
from warpsph.scene.airfoils import airfoil, naca_4
from warpsph.scene.arc import arc_lengths, tangents
from warpsph.scene.body_sampling import sample
from warpsph.scene.surfaces import Ball, Hollow, box_surface
from warpsph.study.comparison import compare

WIDE = ([-9.0, -9.0], [9.0, 9.0])


def stations(surface, spacing=0.05, corners=WIDE):
    """Return feet, normals and arc lengths of the stations of a surface, in the order of the arc."""
    found = sample(surface, spacing, 3, *corners)
    first = found.area > 0
    foot, normal = found.foot[first], found.normal[first]
    arc = arc_lengths(surface, foot, normal, spacing, *corners)
    order = np.argsort(arc)
    return foot[order], normal[order], arc[order]


@pytest.mark.parametrize("hollow", [False, True])
def test_the_arc_of_a_circle_is_its_angle(hollow):
    ball = Ball([0.2, 0.1], 0.5)
    foot, _, arc = stations(Hollow(ball) if hollow else ball)
    angle = np.arctan2(foot[:, 1] - 0.1, foot[:, 0] - 0.2) % (2 * math.pi)
    assert arc == pytest.approx(0.5 * angle, abs=1e-6)


def test_the_arc_of_a_box_begins_in_its_lower_right_corner():
    foot, _, arc = stations(box_surface([0, 0], [1, 0.5]))
    way = [0.5, 1.0, 0.5, 1.0]  # right, top, left, bottom
    sides = [foot[:, 1], 1.0 - foot[:, 0], 0.5 - foot[:, 1], foot[:, 0]]
    on = np.stack([foot[:, 0] == 1, foot[:, 1] == 0.5, foot[:, 0] == 0, foot[:, 1] == 0])
    exact = [sum(way[: side.argmax()]) + sides[side.argmax()][k] for k, side in enumerate(on.T)]
    assert arc == pytest.approx(exact, abs=1e-9)


def test_a_body_that_ends_on_a_side_begins_there():
    foot, _, arc = stations(box_surface([0, -0.5], [1, 0.5]), corners=([-9.0, 0.0], [9.0, 9.0]))
    assert (foot[0], foot[-1]) == (pytest.approx([1.0, 0.025]), pytest.approx([0.0, 0.025]))
    assert (arc[0], arc[-1]) == pytest.approx((0.025, 2.0 - 0.025))


def test_the_arc_of_an_airfoil_tells_the_sides_of_its_tail_apart():
    wing = airfoil(naca_4("0012", True), 1.0, 4.0, 0.25, (0, 0))
    foot, normal, arc = stations(wing, 0.01)
    upper = tangents(normal, False)[:, 0] < 0  # anticlockwise: back to the nose along the upper side
    half = 0.5 * wing.extent
    assert (upper == (arc < half)).mean() > 0.99
    assert np.abs(np.diff(arc) - np.linalg.norm(np.diff(foot, axis=0), axis=1)).max() < 0.001


def recorded(model, **gauges):
    """Return what gauges of a model measure now, by name: the last row, or all rows, of each column."""
    case = model.case.replace({"gauges": {name: {"interval": 1.0, **gauge} for name, gauge in gauges.items()}})
    made_of = GaugeSet(case)
    recorder = Recorder(model, made_of)
    recorder.write(recorder.take(gauges))
    return {name: made_of.series(name) for name in gauges}


def test_a_fluid_at_rest_presses_with_its_depth():
    """p = rho g (H - y) at each station, within 1 % of the pressure of the tank, and no friction to speak of."""
    model = made(
        particle_spacing=0.025,
        domain={"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        gravity=[0.0, -9.81],
        phases={"w": {"density": 1000.0, "viscosity": 20.0}},
        bodies={"c": circle([0.52, 0.43], 0.15)},
        start={"pressure": "hydrostatic"},
    )
    model.stepper.run(0.2, 10**6)
    found = recorded(model, s={"type": "surface_stress"}, f={"type": "wall_force"})
    s = found["s"]
    assert np.hypot(s["x"] - 0.52, s["y"] - 0.43) == pytest.approx(0.15, abs=1e-6)
    # the centre of the surface is the mean of its stations, whose lengths are counted in sixteenths of a spacing
    assert s["arc"] == pytest.approx(0.15 * s["angle"], abs=0.05 * 0.025)
    level = s["pressure"] + 9810.0 * s["y"]
    assert np.abs(level - level.mean()).max() < 0.01 * 9810.0
    assert np.abs(s["shear"]).max() < 0.01 * 9810.0 * 0.15
    force = [
        (s["length"] * (s[f"friction_{axis}"] - s["pressure"] * s[f"normal_{axis}"])).sum() for axis in "xy"
    ]
    # the force of the gauge knows how the pressure changes along what a station stands for, and how that bends
    whole = [found["f"][f"force_{axis} c"][-1] for axis in "xy"]
    assert force == pytest.approx(whole, abs=5e-3 * 9810.0 * math.pi * 0.15**2)
    assert abs(found["f"]["force_x c"][-1]) < 1e-4 * found["f"]["force_y c"][-1]
    assert s["length"].sum() == pytest.approx(2 * math.pi * 0.15, rel=1e-3)


def test_friction_of_the_flow_between_cylinders():
    """The inner one turns anticlockwise and is held back, the outer one is dragged along: torque/(2 pi r^2) on each."""
    scene = Annulus(10)
    scene.model.stepper.run(1.0, 10**6)
    gauge = {"type": "surface_stress", "speed": 2.0, "density": 3.0}
    found = recorded(scene.model, a={**gauge, "body": "in"}, b={**gauge, "body": "out"})
    inner, outer = found["a"], found["b"]
    for rows, radius, sign in ((inner, scene.inner, -1.0), (outer, scene.outer, 1.0)):
        exact = sign * scene.torque / (2.0 * math.pi * radius**2)
        assert rows["shear"].mean() == pytest.approx(exact, rel=0.025)
        assert np.abs(rows["shear"] - exact).max() < 0.05 * abs(exact)
        assert rows["Cf"] == pytest.approx(rows["shear"] / 6.0)
        assert rows["Cp"] == pytest.approx(rows["pressure"] / 6.0)
        assert (np.diff(rows["arc"]) > 0).all()


@pytest.mark.parametrize("scheme", ["isph", "delta_plus"])
def test_the_other_schemes_press_on_a_round_tank(scheme):
    """Fluid at rest in a round tank: hydrostatic, as the Riemann scheme."""
    case = Case.from_dict({
        "dimension": 2, "particle_spacing": 0.05, "end_time": 1.0, "gravity": [0, -9.81],
        "domain": {"lower": [-0.7, -0.7], "upper": [0.7, 0.7], "boundary": {"x": "open", "y": "open"}},
        "phases": {"w": {"density": 1000.0, "viscosity": 10.0}},
        "fluids": [{"phase": "w", "shape": {"sphere": {"center": [0, 0], "radius": 0.5}}}],
        "bodies": {"tank": {**circle([0, 0], 0.5), "hollow": True}},
        "start": {"pressure": "9810*(0.5 - y)"}, "numerics": {"scheme": scheme},
    })  # fmt: skip
    model = Model(case, threads=1)
    model.stepper.prepare(True)
    model.stepper.run(0.02, 10**6)
    s = recorded(model, s={"type": "surface_stress"})["s"]
    level = s["pressure"] + 9810.0 * s["y"]
    assert np.abs(level - level.mean()).max() < 0.03 * 9810.0


def test_a_sphere_in_three_dimensions():
    model = Model(
        Case.from_dict({
            "dimension": 3, "particle_spacing": 0.1, "end_time": 1.0, "gravity": [0, 0, -1],
            "domain": {"lower": [0] * 3, "upper": [1] * 3, "boundary": dict.fromkeys("xyz", "wall")},
            "phases": {"w": {"density": 1.0, "viscosity": 0.1}},
            "fluids": [{"phase": "w", "shape": "rest"}],
            "bodies": {"ball": {"shape": {"sphere": {"center": [0.5] * 3, "radius": 0.3}}}},
            "start": {"pressure": "hydrostatic"},
        }),
        threads=1,
    )  # fmt: skip
    model.stepper.prepare(True)
    s = recorded(model, s={"type": "surface_stress"})["s"]
    assert "arc" not in s
    assert s["area"].sum() == pytest.approx(4 * math.pi * 0.3**2, rel=0.01)
    normal = np.stack([s[f"normal_{axis}"] for axis in "xyz"])
    place = np.stack([s[axis] for axis in "xyz"])
    assert place == pytest.approx(0.5 + 0.3 * normal, abs=1e-5)
    level = s["pressure"] + s["z"]
    assert np.abs(level - level.mean()).max() < 0.03


def case_of(gauge, names=("a", "b"), folder=None, **changes):
    places = {name: circle([1.0 + k, 0.5], 0.3) for k, name in enumerate(names)}
    base = {
        "dimension": 2, "particle_spacing": 0.1, "end_time": 1.0,
        "domain": {"lower": [0, 0], "upper": [3, 1], "boundary": {"x": "periodic", "y": "periodic"}},
        "phases": {"w": {"density": 1.0, "viscosity": 1.0}}, "fluids": [{"phase": "w", "shape": "rest"}], "bodies": places,
        "gauges": {"s": {"type": "surface_stress", "interval": 0.1, **gauge}},
    }  # fmt: skip
    return Case.from_dict(base | changes, folder)


@pytest.mark.parametrize(
    ("gauge", "bodies", "key", "rule"),
    [
        ({}, ("a", "b"), "body", "is missing, and the scene has 2 bodies.*body: a"),
        ({"body": "c"}, ("a", "b"), "body", "is not one of the bodies"),
        ({}, (), "type", "needs a body"),
        ({"density": 1}, ("a",), "density", "without speed"),
        ({"far_pressure": 1}, ("a",), "far_pressure", "without speed"),
    ],
)
def test_what_a_case_may_not_say(gauge, bodies, key, rule):
    with pytest.raises(CaseError, match=rf"gauges\.s\.{key}\b.*{rule}"):
        case_of(gauge, bodies)


def test_bodies_of_whole_cells_in_several_fluids_have_no_surface():
    two = {"w": {"density": 1.0}, "o": {"density": 0.9}}
    fluids = [{"phase": "w", "shape": {"box": {"lower": [0, 0], "upper": [3, 0.5]}}}, {"phase": "o", "shape": "rest"}]
    block = {"bodies": {"a": {"shape": {"box": {"lower": [1, 0.3], "upper": [1.5, 0.8]}}}}}
    with pytest.raises(CaseError, match=r"gauges\.s\.type.*wall of whole cells"):
        Model(case_of({}, ("a",), phases=two, fluids=fluids, **block), threads=1)


def test_a_profile_along_the_surface_against_one_in_angles(tmp_path):
    """Shear 2 sin(angle) at 0.5 s, against the same over the angle/pi but for a tenth more."""
    angle = np.linspace(0, 2 * math.pi, 41)
    table = np.stack([angle / math.pi, np.sin(angle) / 1.1], axis=1)
    np.savetxt(tmp_path / "known.csv", table, delimiter=",", header="theta_over_pi,s", comments="")
    curves = {"file": "known.csv", "position": "theta_over_pi", "position_scale": "pi*0.3", "columns": {0.5: "s"}}
    curves["scale"] = 2
    reference = {"gauge": "s", "column": "2*shear", "curves": curves, "norm": "rms"}
    case = case_of({}, ("a",), tmp_path, reference={"r": reference})
    (tmp_path / "gauges").mkdir()
    rows = np.stack([np.full(41, 0.5), 0.3 * angle, np.sin(angle)], axis=1)
    np.savetxt(tmp_path / "gauges" / "s.csv", rows, delimiter=",", header="time [s],arc [m],shear [Pa]", comments="")
    (result,) = compare(case, tmp_path, end_time=1.0)
    assert result["error"] == pytest.approx(0.1 * np.sqrt(np.mean(np.sin(angle) ** 2)), rel=1e-3)


def test_a_surface_has_no_one_number_a_time():
    reference = {"r": {"gauge": "s", "column": "shear", "value": 1}}
    with pytest.raises(CaseError, match=r"reference\.r\.gauge.*has profiles.*use curves"):
        case_of({}, ("a",), reference=reference)


def test_a_dry_surface_bears_no_pressure():
    """A ball half in water: nothing above the water, and no suction anywhere on it."""
    data = {
        "dimension": 2,
        "particle_spacing": 0.05,
        "end_time": 1.0,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
        "gravity": [0, -9.81],
        "phases": {"water": {"density": 1000}},
        "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}}],
        "bodies": {"ball": {"shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.16}}}},
        "start": {"pressure": "hydrostatic"},
    }
    model = Model(Case.from_dict(data), threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(0.05, 10**9)
    found = model.surface_stress("ball")
    assert (found.pressure >= 0).all()
    np.testing.assert_array_equal(found.pressure[found.position[:, 1] > 0.5 + 2 * 0.05], 0.0)
    assert found.pressure[found.position[:, 1] < 0.4].min() > 500


def box_at_rest(scheme, lower, upper, origin=(0.0, 0.0), **more):
    """Return the model of a box in water at rest, after its start."""
    d = len(lower)
    origin = np.array([*origin, 0.0, 0.0][:d])
    wide = np.array([0.6, 0.5] if d == 2 else [0.8, 0.6, 0.6])
    model = Model(
        Case.from_dict({
            "dimension": d, "particle_spacing": 0.02 if d == 2 else 0.05, "end_time": 1.0,
            "gravity": [0.0] * (d - 1) + [-9.81],
            "domain": {"lower": list(origin), "upper": list(origin + wide), "boundary": dict.fromkeys("xyz"[:d], "wall")},
            "phases": {"w": {"density": 1000.0, "viscosity": 1.0}},
            "fluids": [{"phase": "w", "shape": "rest"}],
            "bodies": {"b": {"shape": {"box": {"lower": list(origin + lower), "upper": list(origin + upper)}}, **more}},
            "start": {"pressure": "hydrostatic"}, "numerics": {"scheme": scheme},
        }),
        threads=1,
    )  # fmt: skip
    model.stepper.prepare(True)
    return model


@pytest.mark.parametrize("origin", [(0.0, 0.0), (1.28, -0.64), (0.3, 0.2)])
@pytest.mark.parametrize("shift", [0.0, 0.007])
@pytest.mark.parametrize("scheme", ["isph", "riemann"])
def test_a_box_in_water_at_rest_bears_its_weight(scheme, shift, origin):
    """Wherever it is: a particle in a corner stands for two faces, each with a normal of its own."""
    model = box_at_rest(scheme, np.array([0.2, 0.12]) + shift, np.array([0.4, 0.32]) + shift, origin)
    forces, weight = model.wall_forces(), 9810.0 * 0.2 * 0.2
    assert forces["wall_force_y b"] == pytest.approx(weight, rel=1e-4)
    assert abs(forces["wall_force_x b"]) < 1e-4 * weight
    assert abs(forces["wall_torque_z b"]) < 1e-4 * weight * 0.2
    s = model.surface_stress("b")
    assert s.area.sum() == pytest.approx(0.8)
    force = (s.area[:, None] * (s.friction - s.pressure[:, None] * s.normal)).sum(axis=0)
    assert force == pytest.approx([0.0, weight], abs=1e-4 * weight)
    assert (np.diff(s.arc) > 0).all()
    on = np.abs(s.position - origin - np.array([0.3, 0.22]) - shift).max(axis=1)
    assert on == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize("scheme", ["isph", "riemann"])
def test_a_small_box_in_three_dimensions_bears_its_weight(scheme):
    model = box_at_rest(scheme, np.array([0.2, 0.2, 0.2]), np.array([0.4, 0.4, 0.4]))
    forces, weight = model.wall_forces(), 9810.0 * 0.2**3
    assert forces["wall_force_z b"] == pytest.approx(weight, rel=1e-4)
    assert abs(forces["wall_force_x b"]) + abs(forces["wall_force_y b"]) < 1e-4 * weight
    assert max(abs(forces[f"wall_torque_{axis} b"]) for axis in "xyz") < 1e-4 * weight * 0.2
    assert model.surface_stress("b").area.sum() == pytest.approx(6 * 0.2**2)


def test_stations_turn_with_their_body():
    """A box that has turned by an angle: stations on its faces, and forces that add up as those of a closed surface."""
    motion = {"rotation": "30*t**2", "pivot": [0.3, 0.22]}
    model = box_at_rest("isph", np.array([0.24, 0.16]), np.array([0.36, 0.28]), motion=motion)
    model.stepper.run(0.1, 10**6)
    s, angle = model.surface_stress("b"), 30 * 0.1**2
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    at_start, normal = (s.position - [0.3, 0.22]) @ turn, s.normal @ turn
    assert np.abs(at_start).max(axis=1) == pytest.approx(0.06, abs=1e-5)
    assert np.abs(normal).max(axis=1) == pytest.approx(1.0, abs=1e-5)
    assert np.einsum("ij,ij->i", at_start, normal) == pytest.approx(0.06, abs=1e-5)
    forces = model.wall_forces()
    force = (s.area[:, None] * (s.friction - s.pressure[:, None] * s.normal)).sum(axis=0)
    assert force == pytest.approx([forces["wall_force_x b"], forces["wall_force_y b"]], rel=1e-4)
    arm = s.position - [0.3, 0.22]
    each = s.area[:, None] * (s.friction - s.pressure[:, None] * s.normal)
    assert (arm[:, 0] * each[:, 1] - arm[:, 1] * each[:, 0]).sum() == pytest.approx(forces["wall_torque_z b"], rel=1e-3)
