"""The script of the pull on a point where three interfaces meet: its sectors, and the pull on one that is out of balance."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

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


def test_a_point_out_of_balance_is_pulled_as_the_tensions_pull(triple_point):
    """With equal tensions the pull points where the three directions point, and is nearer to their sum than nothing is."""
    directions = np.radians(np.cumsum([0.0, 150.0, 105.0]))
    exact = np.array([np.cos(directions).sum(), np.sin(directions).sum()])
    found = []
    for turn in np.radians([20.0, 110.0, 200.0, 290.0]):
        back = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        found.append(back @ triple_point.pulls(triple_point.three_sectors(directions + turn, EQUAL), EQUAL)["program"])
    assert np.hypot(*(np.mean(found, axis=0) - exact)) < 0.5 * np.hypot(*exact)
