"""Flow that spreads along walls: it is not compressed by them, and its first row stays a row (docs/theory/delta.md#d6)."""

import copy
from typing import Any

import numpy as np
import pytest

import warpsph
from warpsph.running.model import Model

QUIET = ["output={particles: none, checkpoint: none}"]
SPACING = 1 / 40
RATE = 2.0  # d v_x / d x, 1/s
# water that runs against a floor and spreads along it, u = a (x, -y)
FLOOR: dict[str, Any] = {
    "dimension": 2,
    "particle_spacing": SPACING,
    "end_time": 1,
    "domain": {"lower": [-1, 0], "upper": [1, 1], "boundary": {"x": "open", "y": {"lower": "free_slip", "upper": "open"}}},
    "phases": {"water": {"density": 1000, "sound_speed": 20}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [-0.5, 0], "upper": [0.5, 0.5]}}}],
    "start": {"velocity": [f"{RATE}*x", f"-{RATE}*y"]},
}
# the same in a corner, whose other side it runs away from
CORNER: dict[str, Any] = {
    **FLOOR,
    "domain": {
        "lower": [0, 0],
        "upper": [1, 1],
        "boundary": {"x": {"lower": "free_slip", "upper": "open"}, "y": {"lower": "free_slip", "upper": "open"}},
    },
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.5, 0.5]}}}],
}
# a vortex that fills a box
BOX: dict[str, Any] = {
    **FLOOR,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "free_slip", "y": "free_slip"}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "start": {"velocity": [f"{RATE}/pi*sin(pi*x)*cos(pi*y)", f"-{RATE}/pi*cos(pi*x)*sin(pi*y)"]},
}
BODY = "bodies={far: {shape: {box: {lower: [0.8, 0.8], upper: [0.9, 0.9]}}}}"  # all walls have a surface with it
CELLS = ["numerics.scheme=riemann"]
FITS = [*CELLS, BODY]
DELTA = ["numerics.scheme=delta_plus"]
TWO = [*CELLS, "phases.oil={density: 900, sound_speed: 20}",
       "fluids=[{phase: oil, shape: {box: {lower: [0, 0], upper: [0.5, 1]}}}, {phase: water, shape: rest}]"]  # fmt: skip
EVEN = "numerics.unlock=0"  # a lattice to the last digit
ROUND = "bodies={far: {shape: {sphere: {center: [0.7, 0.7], radius: 0.12}}}}"  # cut, so that walls are no cells


def begun(case: dict[str, Any], changes: list[str]) -> Model:
    """Return the model of a case before its first step."""
    model = Model(warpsph.load_case(copy.deepcopy(case), [*changes, *QUIET]), threads=1)
    model.stepper.prepare(fresh=True)
    return model


def compression(case: dict[str, Any], changes: list[str]) -> np.ndarray:
    """Return the rate of the density in the first two rows at walls, over that of the flow along them, after a step."""
    model = begun(case, changes)
    start = model.snapshot().fluid
    before = start.density.astype(np.float64)[np.argsort(start.particle_id)]
    model.stepper.run(1.0e9, 1)
    snapshot = model.snapshot()
    place, after = snapshot.fluid.position.astype(np.float64), snapshot.fluid.density.astype(np.float64)
    order = np.argsort(snapshot.fluid.particle_id)
    rate = (after[order] / before - 1.0) / snapshot.time
    place = place[order]
    # away from free surfaces and bodies; several fluids in a corner between walls with a surface have their images
    low, high = 0.1 if ROUND in changes else 0.0, 0.3
    near = (place[:, 1] < 2 * SPACING) & (np.abs(place[:, 0]) < high) & (place[:, 0] > (-high if case is FLOOR else low))
    return rate[near] / RATE


@pytest.mark.parametrize(
    ("case", "changes"),
    [(FLOOR, CELLS), (FLOOR, FITS), (FLOOR, DELTA), (FLOOR, [*DELTA, BODY]), (FLOOR, [*DELTA, "numerics.formulation=paper"]),
     (CORNER, CELLS), (CORNER, FITS), (CORNER, DELTA),
     (BOX, [*CELLS, EVEN]), (BOX, [*TWO, EVEN]), (BOX, [*TWO, EVEN, ROUND]), (BOX, DELTA)],
)  # fmt: skip
def test_walls_do_not_compress_what_spreads_along_them(case, changes):
    """The image of a particle's own velocity made 0.2 of it."""
    assert np.abs(compression(case, changes)).max() < 0.05


@pytest.mark.parametrize("changes", [CELLS, FITS, DELTA])
def test_compression_along_the_normal_counts_in_full(changes):
    """u = -a y alone: walls take no part in the sum, which is divided by the share that it has."""
    case = {**FLOOR, "start": {"velocity": ["0", f"-{RATE}*y"]}}
    assert compression(case, changes) == pytest.approx(1.0, abs=0.05)


# a stream of 0.4 m that falls on a floor at 1 m/s, scripts/foreign/plate.yaml: a stagnation pressure of 500 Pa
STREAM: dict[str, Any] = {
    "dimension": 2,
    "particle_spacing": 0.02,
    "end_time": 2,
    "domain": {"lower": [-2, 0], "upper": [2, 3], "boundary": {"x": "open", "y": {"lower": "wall", "upper": "open"}}},
    "phases": {"water": {"density": 1000}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [-0.2, 0.1], "upper": [0.2, 2.1]}}}],
    "start": {"velocity": [0, -1]},
}


@pytest.mark.parametrize("changes", [CELLS, DELTA])
def test_first_row_of_a_stream_against_a_wall_stays_a_row(changes):
    """It stood at a third of its places, 1 to 1.5 spacings off the wall, with pressures 789 Pa apart in delta-plus-SPH."""
    model = begun(STREAM, changes)
    places, spread = [], []
    for time in np.arange(0.6, 1.1, 0.05):
        model.stepper.run(float(time), 10**9)
        fluid = model.snapshot().fluid
        x, y = np.abs(fluid.position[:, 0]), fluid.position[:, 1]
        places.append(((y < 0.02) & (x < 0.2)).sum() * 0.02 / 0.4)
        spread.append(fluid.pressure[(y < 0.04) & (x < 0.1)].std())
    assert np.mean(places) > 0.9 and np.mean(spread) < 0.1 * 500


def test_two_like_fluids_slide_around_in_a_drum():
    """Round walls have the image of what meets them for several fluids: with their own velocity a turn lost 6 %."""
    ring = "x**2 + y**2 < 0.5**2 and x**2 + y**2 > 0.2**2"
    inner, outer = "x**2 + y**2 < 0.35**2", "x**2 + y**2 >= 0.35**2"
    case = {
        "dimension": 2,
        "particle_spacing": 0.02,
        "end_time": 2,
        "domain": {"lower": [-0.7, -0.7], "upper": [0.7, 0.7]},
        "phases": {"water": {"density": 1000}, "oil": {"density": 1000}},
        "fluids": [
            {"phase": "oil", "shape": {"where": {"condition": f"{ring} and {inner}"}}},
            {"phase": "water", "shape": {"where": {"condition": f"{ring} and {outer}"}}},
        ],
        "bodies": {
            "drum": {"shape": {"sphere": {"center": [0, 0], "radius": 0.5}}, "hollow": True},
            "core": {"shape": {"sphere": {"center": [0, 0], "radius": 0.2}}},
        },
        "start": {"velocity": ["-2*pi*y", "2*pi*x"], "pressure": "2000*pi**2*(x**2 + y**2 - 0.2**2)"},
    }

    def kinetic(model: Model) -> float:
        fluid = model.snapshot().fluid
        return float((fluid.mass * (fluid.velocity.astype(np.float64) ** 2).sum(axis=1)).sum())

    model = begun(case, [])
    start = kinetic(model)
    model.stepper.run(1.0, 10**9)
    assert kinetic(model) == pytest.approx(start, rel=0.02)
