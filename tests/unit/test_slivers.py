"""Empty cells that rounding leaves between a fluid and what it lies against are no free surface; meant ones remain one."""

import numpy as np
import pytest

from tests.scenes import case_of
from warpsph.running.preview import describe, estimate
from warpsph.scene.geometry import build
from warpsph.scene.physics import has_room, support_radius

# A cylinder in a box whose circle runs through the middles of 12 cells: half of them are in neither shape.
CYLINDER = {
    "dimension": 2,
    "particle_spacing": 0.05,
    "end_time": 0.1,
    "domain": {"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
    "phases": {"oil": {"density": 900, "viscosity": 90}},
    "fluids": [{"phase": "oil", "shape": {"where": {"condition": "hypot(x, y) > sqrt(0.15625)"}}}],
    "bodies": {"inner": {"shape": {"sphere": {"center": [0, 0], "radius": "sqrt(0.15625)"}}}},
    "output": {"particles": "none", "checkpoint": "none"},
}
BALL = {
    **CYLINDER,
    "dimension": 3,
    "particle_spacing": 0.1,
    "domain": {"lower": [-1] * 3, "upper": [1] * 3, "boundary": dict.fromkeys("xyz", "wall")},
    "fluids": [{"phase": "oil", "shape": {"where": {"condition": "x*x + y*y + z*z > 0.2475"}}}],
    "bodies": {"ball": {"shape": {"sphere": {"center": [0] * 3, "radius": "sqrt(0.2475)"}}}},
}


def built(case):
    return build(case, support_radius(case))


def where(condition):
    return [{"phase": "oil", "shape": {"where": {"condition": condition}}}]


def told(case):
    return [line for line in estimate(case)["warnings"] if "too small for a free surface" in line]


@pytest.mark.parametrize(("scene", "cells"), [(CYLINDER, 6), (BALL, 21)], ids=["cylinder", "ball"])
def test_middles_on_a_common_surface_belong_to_the_fluid(scene, cells):
    """So that the domain is as full as with the shape rest; `check` and `run` say how many there are."""
    case = case_of(scene)
    geometry, rest = built(case), built(case_of(scene, fluids=[{"phase": "oil", "shape": "rest"}]))
    assert not has_room(case, geometry) and geometry.fluid_count == rest.fluid_count
    np.testing.assert_array_equal(geometry.position, rest.position)
    (line,) = told(case)
    assert line.startswith(f"fluids.0.shape: {cells} cells beside bodies or walls, the first at (-0.") and "rest" in line
    assert line in describe(case)["warnings"]


def test_the_arrangement_knows_no_void_in_a_full_domain():
    """Between the circle of the fluid and the smaller one of the body, too: all that is in no body is fluid."""
    regions = []

    def arrange(found, _seed):
        regions.append(found)
        count = np.count_nonzero(found.entry >= 0)
        return np.zeros((count, 2)), np.ones(count)

    case = case_of(CYLINDER, fluids=where("hypot(x, y) > 0.4"))
    assert told(case)
    build(case, support_radius(case), arrange=arrange)
    points = np.array([[0.0, 0.398], [0.28, -0.281], [0.0, 0.39], [0.9, 0.9]])
    assert regions[0].entries(points).tolist() == [0, 0, -1, 0]


def test_a_long_gap_in_which_no_particle_has_room_is_none():
    """A row of middles that lie between the fluid and a straight body: a tenth of the row is empty."""
    plate = {"plate": {"shape": {"box": {"lower": [-1, 0.677], "upper": [1, 1]}}}}
    case = case_of(CYLINDER, bodies=plate, fluids=where("y < 0.672"))
    assert not has_room(case, built(case)) and "40 cells" in told(case)[0]


def test_only_slivers_beside_a_free_surface_are_filled():
    """Below the surface of a tank around the same cylinder."""
    case = case_of(CYLINDER, fluids=where("y < 0.7 and hypot(x, y) > sqrt(0.15625)"))
    geometry = built(case)
    assert has_room(case, geometry) and "6 cells" in told(case)[0]
    assert geometry.position[:, 1][geometry.kind == 0].max() < 0.7


MEANT = {
    "one row under a lid": "y < 0.95",
    "a corner as large as the kernel": "not (x > 0.85 and y > 0.85)",
    "far from walls": "not (abs(x) < 0.05 and abs(y - 0.7) < 0.05)",
}


@pytest.mark.parametrize("condition", MEANT.values(), ids=MEANT)
def test_empty_space_that_is_meant(condition):
    bodies = {"block": {"shape": {"box": {"lower": [-0.2, -0.2], "upper": [0.2, 0.2]}}}}
    case = case_of(CYLINDER, bodies=bodies, fluids=where(f"({condition}) and not (abs(x) < 0.2 and abs(y) < 0.2)"))
    assert has_room(case, built(case)) and not told(case)


def test_a_row_of_a_narrow_tank_reaches_across_it():
    """Two cells wide: the row is as short as a sliver, but all of the surface that there is."""
    sides = {"x": "wall", "y": "wall"}
    tank = {"lower": [0, 0], "upper": [0.1, 1], "boundary": sides}
    case = case_of(CYLINDER, domain=tank, bodies={}, fluids=where("y < 0.95"))
    assert has_room(case, built(case)) and not told(case)
