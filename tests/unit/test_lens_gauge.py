"""Gauge of a liquid lens against exact lenses: two circular arcs and a straight line that meet at given angles."""

import math

import numpy as np
import pytest

from tests.unit.test_gauges import lattice, make_case, make_snapshot, measure
from warpsph.errors import CaseError
from warpsph.measure.lens_gauge import Circle, Line, Piece, cap_angle, fitted_circle, fitted_line

HALF_WIDTH = 0.4
PHASES = {"oil": {"density": 1.0}, "water": {"density": 1.0}, "air": {"density": 1.0}}
FLUIDS = [{"phase": "oil", "shape": {"sphere": {"center": [0, 0], "radius": 0.4}}},
          {"phase": "water", "shape": {"where": {"condition": "y < 0 and r > 0.4"}}},
          {"phase": "air", "shape": "rest"}]  # fmt: skip
PERIODIC = {"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": "periodic", "y": "wall"}}


def lens(points, above, below, turn=0.0, center=(0.0, 0.0)):
    """Phase (n,) of points around an exact lens of the width 2 HALF_WIDTH with the angles above and below the line, degrees.

    turn: of the line about `center`, degrees
    """
    a, b, t = math.radians(above), math.radians(below), math.radians(turn)
    dx, dy = points[:, 0] - center[0], points[:, 1] - center[1]
    x, y = dx * math.cos(t) + dy * math.sin(t), dy * math.cos(t) - dx * math.sin(t)
    upper = np.hypot(x, y + HALF_WIDTH / math.tan(a)) < HALF_WIDTH / math.sin(a)
    lower = np.hypot(x, y - HALF_WIDTH / math.tan(b)) < HALF_WIDTH / math.sin(b)
    oil = np.where(y > 0, upper, lower)
    return np.where(oil, 0, np.where(y > 0, 2, 1)).astype(np.int32)


def row_of(phase, points, spacing, **changes):
    gauge = {"rim": {"type": "lens", "interval": 0.1, "phase": "oil"}}
    case = make_case(gauge, phases=PHASES, fluids=FLUIDS, particle_spacing=spacing, **changes)
    return measure(case, make_snapshot(points, spacing=spacing, phase=phase))


@pytest.mark.parametrize("spacing", [0.025, 0.0125])
@pytest.mark.parametrize(
    ("above", "below", "turn"), [(60, 60, 0), (60, 60, 15), (53.13, 36.87, 0), (90, 90, 0), (110, 40, 0)]
)
def test_angles_and_width_of_an_exact_lens(above, below, turn, spacing):
    points = lattice(spacing)
    row = row_of(lens(points, above, below, turn), points, spacing)
    # Arcs are seen up to 4 spacings from the rim. They are off by a tenth of a spacing on a staircase of cells, and where
    # they are curved by 0.6 spacings^2 times the curvature. If ends and middles are off in opposite directions the slope is
    # off by four times that over half of what is seen, and by more at the rim, which is farther away; and the width by what
    # that makes of the height, over the slope, at both ends.
    seen = HALF_WIDTH - 4 * spacing
    off = 0.1 * spacing + 0.6 * spacing**2 / HALF_WIDTH
    allowed = math.degrees(4 * off * HALF_WIDTH / seen**2)
    found = [math.degrees(row[f"angle {name}"]) for name in ("oil", "water", "air")]
    assert found[1:] == pytest.approx([180 - below, 180 - above], abs=allowed)
    assert found[0] == pytest.approx(above + below, abs=2 * allowed)
    assert sum(found) == pytest.approx(360)
    height = off * (1 + 2 * (HALF_WIDTH / seen) ** 2)
    assert row["width"] == pytest.approx(2 * HALF_WIDTH, abs=2 * (off + height / math.tan(math.radians(min(above, below)))))


def test_a_lens_across_a_periodic_side_is_the_same():
    points = lattice(0.025)
    row = row_of(lens(points, 60, 45), points, 0.025, domain=PERIODIC)
    moved = points + [0.9, 0.0]
    moved[:, 0] = np.mod(moved[:, 0] + 1.0, 2.0) - 1.0
    across = row_of(lens(points, 60, 45), moved, 0.025, domain=PERIODIC)
    assert across == pytest.approx(row, abs=1e-6)


def test_no_lens_has_no_angles():
    points = lattice(0.05)
    row = row_of(np.where(points[:, 1] > 0, 2, 1).astype(np.int32), points, 0.05)
    assert all(math.isnan(value) for name, value in row.items() if name != "time")


def test_circle_line_and_cap_are_exact():
    angle = np.linspace(0.3, 1.2, 20)
    arc = Piece(np.array([3.0, -1.0]) + 2.5 * np.column_stack([np.cos(angle), np.sin(angle)]), np.ones(20))
    circle = fitted_circle(arc)
    assert circle.center == pytest.approx([3.0, -1.0])
    assert circle.radius == pytest.approx(2.5)
    x = np.linspace(-1, 1, 9)
    line = fitted_line(Piece(np.column_stack([x, 0.5 * x + 0.25]), np.ones(9)), np.array([0.0, 1.0]))
    assert line.normal == pytest.approx(np.array([-0.5, 1.0]) / math.sqrt(1.25))
    assert line.offset == pytest.approx(0.25 / math.sqrt(1.25))
    # a half circle stands at 90 degrees; less of it at less, more of it at more
    floor = Line(np.array([0.0, 1.0]), 0.0)
    for height, degrees in ((0.0, 90), (-0.5, 60), (0.5, 120)):
        assert math.degrees(cap_angle(Circle(np.array([0.0, height]), 1.0), floor)) == pytest.approx(degrees)
    assert math.isnan(cap_angle(Circle(np.array([0.0, 2.0]), 1.0), floor))


def test_what_has_no_lens_is_refused():
    with pytest.raises(CaseError, match=r"phase.*is not one of the phases"):
        make_case({"rim": {"type": "lens", "interval": 0.1, "phase": "oli"}}, phases=PHASES, fluids=FLUIDS)
    with pytest.raises(CaseError, match=r"needs dimension: 2 and three phases"):
        make_case({"rim": {"type": "lens", "interval": 0.1, "phase": "gas"}})
