"""Regions of which a lattice has too much or too little are told, with a spacing that fits; others are not."""

import pytest

from tests.scenes import case_of
from warpsph.running.preview import describe, estimate
from warpsph.scene.geometry import build
from warpsph.scene.physics import support_radius

TANK = {
    "dimension": 2,
    "particle_spacing": 0.05,
    "end_time": 0.1,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
    "gravity": [0, -9.81],
    "phases": {"oil": {"density": 900, "viscosity": 1}},
    "fluids": [{"phase": "oil", "shape": {"where": {"condition": "y < 0.525"}}}],
    "output": {"particles": "none", "checkpoint": "none"},
}


def where(condition):
    return [{"phase": "oil", "shape": {"where": {"condition": condition}}}]


def told(case):
    return [line for line in estimate(case)["warnings"] if "fill whole cells" in line]


def test_half_a_row_is_told_with_a_spacing_that_fits():
    """In `check` and `run`: both areas, the depth in rows, and what to write."""
    case = case_of(TANK)
    (line,) = told(case)
    assert line.startswith("fluids.0.shape: has the area 0.525 m^2, but its particles 0.5 m^2 (-4.8%)")
    assert "its 0.525 m along y (10.5 rows), such as 0.04773, or write start.arrangement: fitted" in line
    assert line in describe(case)["warnings"]


@pytest.mark.parametrize(
    "changes",
    [
        {"fluids": where("y < 0.5")},
        {"fluids": where("y < 0.504")},  # 0.8 %
        {"particle_spacing": 0.525 / 11, "domain__upper": [1.05, 1.05]},
        {"start__arrangement": "fitted"},
        {"fluids": [{"phase": "oil", "shape": "rest"}]},
    ],
    ids=["whole rows", "little", "the spacing told", "fitted", "full"],
)
def test_what_fits_is_not_told(changes):
    assert not told(case_of(TANK, **changes))


def test_bodies_and_entries_that_touch_are_no_misfit():
    """Room in a body is none of the fluid's, and a tank filled in two entries of one phase is one region."""
    post = {"post": {"shape": {"box": {"lower": [0.4, 0], "upper": [0.6, 0.3]}}}}
    assert not told(case_of(TANK, bodies=post, fluids=where("y < 0.5")))
    assert "0.465 m^2" in told(case_of(TANK, bodies=post))[0]
    halves = where("y < 0.275") + where("y > 0.275 and y < 0.5")
    assert not told(case_of(TANK, fluids=halves))


def test_a_box_between_rows_is_told_once():
    box = [{"phase": "oil", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.525]}}}]
    case = case_of(TANK, fluids=box)
    assert not told(case) and any("through the middle of particles" in line for line in estimate(case)["warnings"])


def test_a_volume_in_space():
    """A drop of few particles, of no whole number of rows along any axis."""
    sides = {"lower": [0] * 3, "upper": [1] * 3, "boundary": dict.fromkeys("xyz", "wall")}
    drop = [{"phase": "oil", "shape": {"sphere": {"center": [0.5] * 3, "radius": 0.27}}}]
    case = case_of(TANK, dimension=3, particle_spacing=0.1, gravity=[0, 0, -9.81], domain=sides, fluids=drop)
    (line,) = told(case)
    taken = build(case, support_radius(case)).fluid_count * 1e-3
    assert "the volume 0.0824" in line and f"its particles {taken:.5g} m^3" in line
