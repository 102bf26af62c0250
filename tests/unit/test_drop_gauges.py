"""Gauges of drops against ellipses at known angles, boxes of cells, drops across a periodic side, and counted pieces."""

import math

import numpy as np
import pytest

from tests.unit.test_gauges import lattice, make_case, make_snapshot, measure
from warpsph.errors import CaseError
from warpsph.measure.drop_gauges import ellipsoid, pieces

PERIODIC = {"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": "periodic", "y": "wall"}}


def deformation(snapshot, dimension=2, **changes):
    gauge = {"type": "deformation", "interval": 0.1, "phases": ["gas"]}
    return measure(make_case({"drop": gauge}, dimension, **changes), snapshot)


def fragments(snapshot, **keys):
    changes = {"domain": keys.pop("domain")} if "domain" in keys else {}
    gauge = {"type": "fragments", "interval": 0.1, "phases": ["gas"], **keys}
    return measure(make_case({"pieces": gauge}, **changes), snapshot)


def ellipse(points, long_axis, short_axis, angle, center=(0.0, 0.0)):
    """The points inside of an ellipse whose long axis lies at an angle [degrees] from +x."""
    turn = math.radians(angle)
    x, y = points[:, 0] - center[0], points[:, 1] - center[1]
    along, across = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
    return points[np.hypot(along / long_axis, across / short_axis) < 1.0]


@pytest.mark.parametrize("angle", [0, 30, 80, -30, -75])
def test_deformation_of_an_ellipse_at_an_angle(angle):
    row = deformation(make_snapshot(ellipse(lattice(0.01), 0.7, 0.4, angle), spacing=0.01), particle_spacing=0.01)
    assert row["long_axis gas"] == pytest.approx(0.7, rel=2e-3)
    assert row["short_axis gas"] == pytest.approx(0.4, rel=2e-3)
    assert row["deformation gas"] == pytest.approx(0.3 / 1.1, rel=5e-3)
    assert math.degrees(row["angle gas"]) == pytest.approx(angle, abs=0.2)


def test_deformation_of_a_rectangle_of_cells_is_exact():
    """Second moments W^2/12 and H^2/12 of the cells: semi-axes 2 W/sqrt(12), 2 H/sqrt(12)."""
    points = lattice(0.05)
    inside = (np.abs(points[:, 0] - 0.2) < 0.2) & (np.abs(points[:, 1] + 0.1) < 0.3)
    row = deformation(make_snapshot(points[inside]))
    assert row["long_axis gas"] == pytest.approx(2 * 0.6 / math.sqrt(12))
    assert row["short_axis gas"] == pytest.approx(2 * 0.4 / math.sqrt(12))
    assert row["deformation gas"] == pytest.approx(0.2)
    assert abs(row["angle gas"]) == pytest.approx(math.pi / 2)


def test_deformation_of_a_box_of_cells_in_3d():
    axis = 0.2 * (np.arange(4) + 0.5)
    points = np.stack(np.meshgrid(axis[:2], axis, axis[:3], indexing="ij"), axis=-1).reshape(-1, 3)
    row = deformation(make_snapshot(points, spacing=0.2), 3, particle_spacing=0.2)
    for name, cells in (("long_axis", 4), ("middle_axis", 3), ("short_axis", 2)):
        assert row[f"{name} gas"] == pytest.approx(math.sqrt(5 / 12) * 0.2 * cells)
    assert row["deformation gas"] == pytest.approx(2 / 6)
    assert [row[f"direction_{axis} gas"] for axis in "xyz"] == pytest.approx([0, 1, 0])


def test_direction_of_an_ellipsoid_in_3d():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(200_000, 3))
    points = points[np.linalg.norm(points, axis=1) < 3.0] * [3.0, 1.0, 1.0]
    turn = np.array([[1, -1, 0], [1, 1, 0], [0, 0, math.sqrt(2)]]) / math.sqrt(2)  # x to the diagonal of x and y
    shape = ellipsoid(points @ turn.T, np.full(len(points), 1e-9))
    assert shape.directions[0] == pytest.approx([math.sqrt(0.5), math.sqrt(0.5), 0], abs=0.01)
    assert shape.deformation == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("center", [0.0, 0.9, 1.0, -0.97])
def test_deformation_of_a_drop_across_a_periodic_side(center):
    drop = ellipse(lattice(0.02), 0.5, 0.3, 30)
    whole = deformation(make_snapshot(drop, spacing=0.02), particle_spacing=0.02, domain=PERIODIC)
    moved = drop + [center, 0.0]
    moved[:, 0] = np.mod(moved[:, 0] + 1.0, 2.0) - 1.0
    row = deformation(make_snapshot(moved, spacing=0.02), particle_spacing=0.02, domain=PERIODIC)
    for name, value in whole.items():
        assert row[name] == pytest.approx(value, abs=1e-12)


def test_deformation_of_a_missing_or_broken_phase_is_nan():
    points = lattice(0.05)
    missing = deformation(make_snapshot(points, phase=np.ones(len(points), np.int32)))
    points[7] = np.nan
    broken = deformation(make_snapshot(points))
    for row in (missing, broken):
        assert all(math.isnan(row[f"{name} gas"]) for name in ("long_axis", "short_axis", "deformation", "angle"))


@pytest.mark.parametrize(("gap", "count"), [(0.05, 1), (0.1, 2)])
def test_two_drops_are_two_pieces_as_soon_as_a_row_is_between_them(gap, count):
    """Boxes of 6 x 4 and 3 x 4 cells, one and two spacings from row to row."""
    x, y = 0.05 * (np.arange(9) + 0.5), 0.05 * (np.arange(4) + 0.5)
    x[6:] += gap - 0.05
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    row = fragments(make_snapshot(points))
    assert row["count gas"] == count
    areas = [24 * 0.05**2, 12 * 0.05**2, 0.0] if count == 2 else [36 * 0.05**2, 0.0, 0.0]
    assert [row[f"area_{number} gas"] for number in (1, 2, 3)] == pytest.approx(areas)
    assert row["rest gas"] == pytest.approx(0.0, abs=1e-12)


def test_small_and_unlisted_pieces_are_the_rest():
    sizes = (30, 20, 10, 4)
    rows = [np.column_stack([0.05 * np.arange(size) - 0.9, np.full(size, 0.2 * k)]) for k, size in enumerate(sizes)]
    row = fragments(make_snapshot(np.vstack(rows)), largest=2, least=5)
    assert row["count gas"] == 3
    assert [row[f"area_{number} gas"] for number in (1, 2)] == pytest.approx([30 * 0.05**2, 20 * 0.05**2])
    assert row["rest gas"] == pytest.approx(14 * 0.05**2)
    assert "area_3 gas" not in row


@pytest.mark.parametrize(("side", "count"), [("periodic", 1), ("wall", 2)])
def test_a_drop_across_a_periodic_side_is_one_piece(side, count):
    points = lattice(0.05)
    points = points[(np.abs(points[:, 0]) > 0.8) & (np.abs(points[:, 1]) < 0.2)]
    row = fragments(make_snapshot(points), domain={**PERIODIC, "boundary": {"x": side, "y": "wall"}})
    assert row["count gas"] == count


def test_a_place_on_the_upper_side_is_that_on_the_lower_one():
    lower, upper = np.zeros(2), np.ones(2)
    found = pieces(np.array([[1.0, 0.5], [0.0, 0.5], [-1e-18, 0.5]]), 0.1, lower, upper, (True, False))
    assert len(set(found)) == 1


def test_fragments_of_a_missing_phase_are_none():
    points = lattice(0.05)
    row = fragments(make_snapshot(points, phase=np.ones(len(points), np.int32)))
    assert row["count gas"] == row["area_1 gas"] == row["rest gas"] == 0.0


@pytest.mark.parametrize("kind", ["deformation", "fragments"])
def test_an_unknown_phase_is_refused(kind):
    with pytest.raises(CaseError, match="phases.0.*is not one of the phases"):
        make_case({"drop": {"type": kind, "interval": 0.1, "phases": ["gsa"]}})
