"""Coefficients of the forces on bodies: by hand, in both dimensions, and what a case may say about them."""

import numpy as np
import pytest

from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.measure.gauges import GaugeSet
from warpsph.snapshot import Snapshot

STREAM = {"type": "force_coefficients", "interval": 0.1, "speed": 2.0, "length": 0.5}


def case_of(gauge=(), dimension=2, bodies=("fin",), folder=None, **changes):
    axes = "xyz"[:dimension]
    shapes = {
        name: {"shape": {"sphere": {"center": [0.5 + k] + [0.5] * (dimension - 1), "radius": 0.3}}}
        for k, name in enumerate(bodies)
    }
    data = {
        "dimension": dimension,
        "particle_spacing": 0.1,
        "end_time": 1.0,
        "domain": {"lower": [0] * dimension, "upper": [3, 1, 1][:dimension], "boundary": dict.fromkeys(axes, "periodic")},
        "phases": {"water": {"density": 1000}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "bodies": shapes,
        "gauges": {"c": {**STREAM, **dict(gauge)}},
    }
    return Case.from_dict(data | changes, folder)


def loads(body, force, friction, torque, centre):
    """What the device measures of a body."""
    turning = "z" if len(force) == 2 else "xyz"
    found = {}
    for name, axes, values in (
        ("force", "xyz", force), ("friction", "xyz", friction), ("torque", turning, torque), ("centre", "xyz", centre)
    ):  # fmt: skip
        found |= {f"wall_{name}_{axis} {body}": value for axis, value in zip(axes, values, strict=False)}
    return found


def measured(case, extra):
    d = case.dimension
    snapshot = Snapshot(
        0.0, 0, 0.1, d, np.zeros((1, d)), np.zeros((1, d)), *np.zeros((4, 1)), np.zeros(1, np.int32), np.zeros(1, np.int64),
        np.zeros(1, np.uint8), 0.1, extra=extra,
    )  # fmt: skip
    gauges = GaugeSet(case)
    gauges.record(snapshot)
    return {name: float(values[0]) for name, values in gauges.series("c").items() if name != "time"}


def test_two_dimensions_by_hand():
    """q = 1000 * 2^2 / 2 = 2000 Pa, q L = 1000 N/m, q L^2 = 500 N; a torque from x to y turns the nose down."""
    row = measured(case_of(), loads("fin", [300.0, 50.0], [100.0, 20.0], [25.0], [0.5, 0.5]))
    assert row == pytest.approx(
        {
            "Cd fin": 0.3, "Cl fin": 0.05, "Cm fin": -0.05,
            "Cd_pressure fin": 0.2, "Cd_friction fin": 0.1, "Cl_pressure fin": 0.03, "Cl_friction fin": 0.02,
        }
    )  # fmt: skip


def test_directions_density_and_pivot():
    """The stream goes up, lift points to the left; q = 4 Pa, q L = 2 N/m; the force of 3 N/m up acts at (0.5, 0.5)."""
    gauge = {"density": 2.0, "drag": [0, 5], "pivot": [0.25, 0.5]}
    row = measured(case_of(gauge), loads("fin", [-1.0, 3.0], [0.0, 1.0], [0.1], [0.5, 0.5]))
    assert (row["Cd fin"], row["Cl fin"], row["Cd_friction fin"]) == pytest.approx((1.5, 0.5, 0.5))
    assert row["Cm fin"] == pytest.approx(-(0.1 + 0.25 * 3.0) / (4.0 * 0.5**2))
    downwards = measured(case_of({**gauge, "lift": [1, 0]}), loads("fin", [-1.0, 3.0], [0.0, 1.0], [0.1], [0.5, 0.5]))
    assert downwards["Cl fin"] == pytest.approx(-0.5)
    assert downwards["Cm fin"] == pytest.approx(-row["Cm fin"])


def test_three_dimensions_by_hand():
    """q A = 500 N, q A L = 250 N m; side force and pitch have the axis lift x drag = z x x = y."""
    gauge = {"area": 0.25, "lift": [0, 0, 1]}
    row = measured(case_of(gauge, 3), loads("fin", [50.0, 5.0, 100.0], [10.0, 0.0, 20.0], [2.5, 25.0, 5.0], [0.5] * 3))
    assert row == pytest.approx(
        {
            "Cd fin": 0.1, "Cl fin": 0.2, "Cs fin": 0.01, "Cm fin": 0.1, "Cm_roll fin": 0.01, "Cm_yaw fin": 0.02,
            "Cd_pressure fin": 0.08, "Cd_friction fin": 0.02, "Cl_pressure fin": 0.16, "Cl_friction fin": 0.04,
        }
    )  # fmt: skip


def test_of_several_bodies_those_that_are_named():
    case = case_of({"bodies": ["rear"]}, bodies=("front", "rear"))
    extra = loads("front", [1.0, 0.0], [0.0, 0.0], [0.0], [0.5, 0.5])
    extra |= loads("rear", [9.0, 0.0], [0.0, 0.0], [0.0], [1.5, 0.5])
    assert {name: value for name, value in measured(case, extra).items() if name.startswith("Cd ")} == {"Cd rear": 0.009}
    both = measured(case_of(bodies=("front", "rear")), extra)
    assert (both["Cd front"], both["Cd rear"]) == (0.001, 0.009)


TWO_PHASES = {
    "phases": {"water": {"density": 1000}, "oil": {"density": 900}},
    "fluids": [
        {"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [3, 0.5]}}},
        {"phase": "oil", "shape": "rest"},
    ],
}


@pytest.mark.parametrize(
    ("gauge", "changes", "key", "rule"),
    [
        ({}, {"bodies": {}}, "type", "needs bodies"),
        ({"bodies": ["fim"]}, {}, "bodies.0", "is not one of the bodies.*did you mean fin"),
        ({"bodies": ["fin", "fin"]}, {}, "bodies.1", "named twice"),
        ({"bodies": []}, {}, "bodies", "names no body"),
        ({"phase": "watr"}, {}, "phase", "is not one of the phases.*did you mean water"),
        ({"phase": "water", "density": 1}, {}, "density", "beside phase: water"),
        ({}, TWO_PHASES, "phase", "2 phases.*write e.g. phase: water"),
        ({"area": 1}, {}, "area", "no use in 2-D"),
        ({"drag": [0, 0]}, {}, "drag", "no direction"),
        ({"drag": [1, 0, 0]}, {}, "drag", "needs 2 numbers"),
        ({"lift": [1, 1]}, {}, "lift", "right angles to drag, it is at 45 degrees"),
        ({"pivot": [0]}, {}, "pivot", "needs 2 numbers"),
        ({"speed": 0}, {}, "speed", "needs a number > 0"),
    ],
)
def test_what_a_case_may_not_say(gauge, changes, key, rule):
    with pytest.raises(CaseError, match=rf"gauges\.c\.{key}\b.*{rule}"):
        case_of(gauge, **changes)


@pytest.mark.parametrize(("gauge", "key"), [({"lift": [0, 0, 1]}, "area"), ({"area": 1}, "lift")])
def test_three_dimensions_need_an_area_and_a_lift(gauge, key):
    with pytest.raises(CaseError, match=rf"gauges\.c\.{key}.*is missing"):
        case_of(gauge, 3)


@pytest.mark.parametrize("scheme", ["riemann", "isph", "delta_plus"])
def test_every_scheme_has_the_coefficients_of_its_loads(scheme):
    """A stream past a cylinder in a periodic box: coefficients are the forces of wall_force over q L, the parts add up."""
    keys = {"density": 3.0, "speed": 0.1, "length": 0.6}
    case = case_of(
        keys,
        end_time=0.02,
        domain={"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
        phases={"water": {"density": 1.0, "viscosity": 0.1}},
        body_force=[1.0, 0.3],
        start={"velocity": [0.1, 0]},
        numerics={"scheme": scheme},
        gauges={"c": {**STREAM, **keys}, "f": {"type": "wall_force", "interval": 0.1}},
        output={"particles": "none", "checkpoint": "none"},
    )
    case = case.replace({"gauges.c.interval": 0.01, "gauges.f.interval": 0.01})
    run = Simulation(case, device="cpu", threads=1).run()
    c, f = run.gauge("c"), run.gauge("f")
    scale = 0.5 * 3.0 * 0.1**2 * 0.6
    assert len(c["time"]) == 3 and (c["Cd_friction fin"][1:] > 0).all()
    assert c["Cd fin"] == pytest.approx(f["force_x fin"] / scale, rel=1e-12)
    assert c["Cl_pressure fin"] == pytest.approx(f["pressure_y fin"] / scale, rel=1e-12)
    assert c["Cd_pressure fin"] + c["Cd_friction fin"] == pytest.approx(c["Cd fin"], rel=1e-9)
    assert c["Cm fin"] == pytest.approx(-f["torque_z fin"] / (scale * 0.6), rel=1e-12)
