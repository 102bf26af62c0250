"""The script of the pull on a point where three interfaces meet: its sectors, and the pull on one that is out of balance."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

import warpsph
from warpsph.scene.geometry import build
from warpsph.scene.physics import support_radius

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "triple_point.py"
EQUAL = np.ones((3, 3)) - np.eye(3)


@pytest.fixture(scope="module")
def triple_point():
    spec = importlib.util.spec_from_file_location("triple_point", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["triple_point"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["triple_point"]


@pytest.mark.parametrize("angles", [(120, 120, 120), (90, 143, 127), (200, 90, 70), (60, 210, 90)])
def test_sectors_have_their_angles(triple_point, angles):
    directions = np.radians(np.cumsum([25.0, angles[0], angles[1]]))
    case = triple_point.three_sectors(directions, EQUAL)
    geometry = build(case, support_radius(case))
    fluid = geometry.kind == 0
    # A particle that noise moved across an interface kept its phase: leave out a spacing on both sides.
    x, phase = geometry.position[fluid], geometry.phase[fluid]
    turned = np.degrees(np.mod(np.arctan2(x[:, 1], x[:, 0]) - directions[0], 2 * math.pi))
    expected = np.searchsorted(np.cumsum(angles[:2]), turned, side="right")
    distance = np.min([np.abs(x[:, 0] * math.sin(a) - x[:, 1] * math.cos(a)) for a in directions], axis=0)
    assert (phase == expected)[distance > 1.0].all()


# Of water-air, water-oil, oil-air, and of oil, water, air: Neumann's angles of tensions 5 : 4 : 3, one point out of balance,
# and oil that wets all of the water, so that no angles are in balance.
@pytest.mark.parametrize(
    ("tensions", "angles"),
    [
        ((1.0, 0.8, 0.6), (90.0, 143.13, 126.87)),
        ((1.0, 1.0, 1.0), (150.0, 105.0, 105.0)),
        ((1.0, 0.5, 0.4), (60.0, 150.0, 150.0)),
    ],
)
def test_a_point_is_pulled_as_the_tensions_pull(triple_point, tensions, angles):
    """An interface that is 3 degrees off pulls with 0.052 of its tension.

    With the tension of each pair the unequal ones are 0.34 and 0.57 off.
    """
    water_air, water_oil, oil_air = tensions
    matrix = np.array([[0, water_oil, oil_air], [water_oil, 0, water_air], [oil_air, water_air, 0]])
    directions = np.radians(np.cumsum([0.0, *angles[:2]]))
    exact = np.array([oil_air, water_oil, water_air]) @ np.column_stack([np.cos(directions), np.sin(directions)])
    found = []
    for turn in np.radians([5.0, 50.0, 95.0, 140.0, 185.0, 230.0, 275.0, 320.0]):
        back = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        found.append(back @ triple_point.pulls(triple_point.three_sectors(directions + turn, matrix), matrix)["program"])
    error = 2.0 * np.std(found, axis=0).max() / math.sqrt(len(found))
    assert np.hypot(*(np.mean(found, axis=0) - exact)) < 0.052 + error


def with_a_fourth(case):
    """Return the case with a phase of its own beyond x = 14, out of reach of the middle, and the tensions of all pairs."""
    scene = case.to_dict()
    scene["phases"] = {**scene["phases"], "tin": dict(scene["phases"]["air"])}
    tin = "x > 14"
    for fluid in scene["fluids"][:2]:
        condition = fluid["shape"]["where"]["condition"]
        fluid["shape"] = {"where": {"condition": f"({condition}) and not ({tin})"}}
    scene["fluids"] = [{"phase": "tin", "shape": {"where": {"condition": tin}}}, *scene["fluids"]]
    scene["surface_tension"] += [{"between": ["tin", name], "coefficient": 2.0} for name in ("oil", "water", "air")]
    return warpsph.Case.from_dict(scene)


def test_a_point_of_three_out_of_four_phases(triple_point):
    """As with three: the third phase of a pair is the one that is there."""
    tensions, angles = (1.0, 0.8, 0.6), (90.0, 143.13, 126.87)
    water_air, water_oil, oil_air = tensions
    matrix = np.array([[0, water_oil, oil_air], [water_oil, 0, water_air], [oil_air, water_air, 0]])
    four = np.pad(matrix, (0, 1), constant_values=2.0)
    four[3, 3] = 0
    directions = np.radians(np.cumsum([0.0, *angles[:2]]))
    found = []
    for turn in np.radians([5.0, 50.0, 95.0, 140.0, 185.0, 230.0, 275.0, 320.0]):
        back = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        case = with_a_fourth(triple_point.three_sectors(directions + turn, matrix))
        found.append(back @ triple_point.pulls(case, four)["program"])
    error = 2.0 * np.std(found, axis=0).max() / math.sqrt(len(found))
    assert np.hypot(*np.mean(found, axis=0)) < 0.052 + error
