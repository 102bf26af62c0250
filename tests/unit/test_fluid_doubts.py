"""Warnings about scenes of several fluids: angles, tensions, gaps and thin layers; none where the scene may be meant."""

import copy
import math

import numpy as np
import pytest

from tests.scenes import case_of
from warpsph import Simulation
from warpsph.running.preview import describe, estimate
from warpsph.running.tension_doubts import contradicting_angles, missing_pairs
from warpsph.scene.narrow import pieces

# Oil, water and a lighter oil in layers of 5, 5 and 6 rows between walls; the kernel reaches 3 spacings.
TENSIONS = {"ab": 1.0, "bc": 0.8, "ca": 0.6}
LAYERS = {
    "dimension": 2,
    "particle_spacing": 0.05,
    "end_time": 0.1,
    "domain": {"lower": [0, 0], "upper": [1, 0.8], "boundary": {"x": "periodic", "y": "wall"}},
    "phases": {"a": {"density": 1000}, "b": {"density": 900}, "c": {"density": 800}},
    "surface_tension": [{"between": list(pair), "coefficient": value} for pair, value in TENSIONS.items()],
    "fluids": [
        {"phase": "a", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.25]}}},
        {"phase": "b", "shape": {"box": {"lower": [0, 0.25], "upper": [1, 0.5]}}},
        {"phase": "c", "shape": "rest"},
    ],
    "output": {"particles": "none", "checkpoint": "none"},
}
# Energies of a wall with a, b and c, and the angles in the first-named phase that they make.
ENERGY = {"a": 0.1, "b": 0.3, "c": 0.5}
ANGLES = {
    pair: math.degrees(math.acos((ENERGY[pair[1]] - ENERGY[pair[0]]) / value)) for pair, value in TENSIONS.items()
}


def told(case, key):
    return [line for line in estimate(case)["warnings"] if line.startswith(key)]


# contact angles ----------------------------------------------------------------------------------------------


def with_angles(*angles, turned=()):
    """Return the case with the angles of ab, bc and ca, those in `turned` measured in the other phase."""
    entries = []
    for (pair, value), angle in zip(TENSIONS.items(), angles, strict=True):
        turn = pair in turned
        entry = {"between": list(reversed(pair)) if turn else list(pair), "coefficient": value}
        entries.append(entry if angle is None else {**entry, "contact_angle": 180 - angle if turn else angle})
    return case_of(LAYERS, surface_tension=entries)


@pytest.mark.parametrize("turned", [(), ("ab",), ("bc", "ca"), ("ab", "bc", "ca")])
def test_angles_of_one_wall_are_fine(turned):
    """Whichever phase an angle is measured in, and rounded to half a degree."""
    rounded = [round(2 * angle) / 2 for angle in ANGLES.values()]
    for angles in (ANGLES.values(), rounded, (90, 90, 90), (None, None, None)):
        assert not list(contradicting_angles(with_angles(*angles, turned=turned)))


@pytest.mark.parametrize("turned", [False, True])
def test_angles_that_contradict(turned):
    """The line has the value that the third angle would have, in the phase that it is named for."""
    case = with_angles(ANGLES["ab"], ANGLES["bc"], 60, turned=("ca",) if turned else ())
    (line,) = told(case, "surface_tension")
    right = 180 - ANGLES["ca"] if turned else ANGLES["ca"]
    given = "120 degrees in a beside c" if turned else "60 degrees in c beside a"
    assert line.startswith(f"surface_tension.2.contact_angle: {given} contradict")
    assert f"write {right:.1f}, or" in line and "Young's equation" in line
    assert not list(contradicting_angles(case.replace({"surface_tension.2.contact_angle": round(right, 1)})))


def test_no_angle_fits():
    (line,) = contradicting_angles(with_angles(20, 20, 90))
    cosine = (math.cos(math.radians(20)) * 1.8) / 0.6
    assert f"its cosine would be {-cosine:.3g}, a would wet the wall below c whole" in line


def test_a_pair_without_an_angle_counts_as_90_degrees():
    """As `contact_matrix` has it; only where another pair has an angle."""
    (line,) = contradicting_angles(with_angles(ANGLES["ab"], None, ANGLES["ca"]))
    assert line.startswith("surface_tension.1.contact_angle: no angle counts as 90 degrees, which in b beside c contradicts")
    assert f"write {ANGLES['bc']:.1f}, or" in line
    assert len(list(contradicting_angles(with_angles(60, None, None)))) == 1
    two = {"phases": {"a": {"density": 1}, "b": {"density": 1}}, "fluids": LAYERS["fluids"][:2]}
    entry = {"between": ["a", "b"], "coefficient": 1, "contact_angle": 60}
    assert not list(contradicting_angles(case_of({**LAYERS, **two, "surface_tension": [entry]})))


def test_four_phases():
    """A loop of four pairs closes as well as one of three."""
    scene = copy.deepcopy(LAYERS)
    scene["phases"]["d"] = {"density": 700}
    scene["fluids"].insert(2, {"phase": "d", "shape": {"box": {"lower": [0, 0.5], "upper": [1, 0.65]}}})
    ring = [(["a", "b"], 60), (["c", "d"], 60), (["b", "c"], 120), (["d", "a"], 120)]
    scene["surface_tension"] = [{"between": pair, "coefficient": 1, "contact_angle": angle} for pair, angle in ring]
    assert not list(contradicting_angles(case_of(scene)))
    scene["surface_tension"][3]["contact_angle"] = 100
    (line,) = contradicting_angles(case_of(scene))
    assert line.startswith("surface_tension.3") and "write 120.0" in line


# pairs without a tension -------------------------------------------------------------------------------------


def test_a_pair_without_a_tension():
    entries = LAYERS["surface_tension"]
    (line,) = told(case_of(LAYERS, surface_tension=entries[:2]), "surface_tension")
    assert "no entry for a and c: it counts as 0" in line and "add {between: [a, c], coefficient: ...}" in line
    assert "for a and b, a and c: it" in next(missing_pairs(case_of(LAYERS, surface_tension=entries[1:2])))


def test_pairs_that_are_meant_to_have_none():
    entries = copy.deepcopy(LAYERS["surface_tension"])
    entries[2]["coefficient"] = 0
    for given in (entries, [], [{**entries[0], "coefficient": 0}]):
        assert not told(case_of(LAYERS, surface_tension=given), "surface_tension")


# gaps --------------------------------------------------------------------------------------------------------


def boxes(*corners, **changes):
    """Return the case with boxes of the phases a, b and c, each (lower, upper)."""
    fluids = [
        {"phase": "abc"[k], "shape": {"box": {"lower": list(lower), "upper": list(upper)}}}
        for k, (lower, upper) in enumerate(corners)
    ]
    return case_of(LAYERS, fluids=fluids, **changes)


FULL = ((0, 0), (1, 0.25)), ((0, 0.25), (1, 0.5)), ((0, 0.5), (1, 0.8))


@pytest.mark.parametrize("rows", [1, 2])
def test_a_gap_between_boxes(rows):
    """Below the three spacings that the kernel reaches; in `check`, `show` and `run`."""
    case = boxes(FULL[0], ((0, 0.25 + 0.05 * rows), (1, 0.5)), FULL[2])
    (line,) = told(case, "fluids:")
    assert f"no region fills {20 * rows} cells" in line and "the first at (0.025, 0.275)" in line and "shape rest" in line
    assert line in describe(case)["warnings"] and line in Simulation(case, threads=1).warnings


def test_a_gap_around_a_box():
    """With its corners, which have no fluid on two sides."""
    hole = {"where": {"condition": "y < 0.5 and not (0.3 < x and x < 0.7 and y > 0.2)"}}
    inner = {"box": {"lower": [0.35, 0.25], "upper": [0.65, 0.5]}}
    fluids = [{"phase": "a", "shape": hole}, {"phase": "b", "shape": inner}, LAYERS["fluids"][2]]
    fluids[2] = {"phase": "c", "shape": {"box": {"lower": [0, 0.5], "upper": [1, 0.8]}}}
    (line,) = told(case_of(LAYERS, fluids=fluids), "fluids:")
    assert "no region fills 18 cells" in line


OPEN = {
    "three spacings": (((0, 0), (1, 0.25)), ((0, 0.4), (1, 0.6)), ((0, 0.6), (1, 0.8))),
    "below a roof": (*FULL[:2], ((0, 0.5), (1, 0.75))),
    "a free surface": (*FULL[:2], ((0, 0.5), (1, 0.65))),
    # two columns a spacing apart, below and above which all is empty
    "columns": (((0.2, 0.2), (0.45, 0.6)), ((0.5, 0.2), (0.75, 0.6)), ((0.2, 0.6), (0.45, 0.75))),
}  # fmt: skip


@pytest.mark.parametrize("name", OPEN)
def test_empty_space_that_may_be_meant(name):
    assert not told(boxes(*OPEN[name]), "fluids")


def test_full_domains_have_no_gap():
    assert not told(case_of(LAYERS), "fluids") and not told(boxes(*FULL), "fluids")


def test_pieces_go_on_across_periodic_sides():
    mask = np.zeros((6, 5), np.bool_)
    mask[0, 1] = mask[5, 1] = mask[3, 3] = True
    assert len(np.unique(pieces(mask, (False, False)))) == 4
    piece = pieces(mask, (True, False))
    assert piece[0, 1] == piece[5, 1] != piece[3, 3] and piece[2, 0] == 0


# thin layers -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_a_thin_layer(rows):
    """Of one row and two, not of three, which is what the kernel reaches."""
    top = 0.25 + 0.05 * rows
    lines = told(boxes(FULL[0], ((0, 0.25), (1, top)), ((0, top), (1, 0.8))), "fluids")
    assert len(lines) == (rows < 3)
    if lines:
        assert lines[0].startswith(f"fluids.1.shape: b is nowhere more than {rows} row")
        assert f"({20 * rows} particles)" in lines[0] and f"particle_spacing to {0.05 * rows / 3:.2g}" in lines[0]


def test_a_thin_layer_on_a_wall_and_a_thin_ring():
    (line,) = told(boxes(((0, 0), (1, 0.1)), ((0, 0.1), (1, 0.5)), FULL[2]), "fluids")
    assert line.startswith("fluids.0.shape: a is nowhere more than 2 rows")
    ring = {"where": {"condition": "abs(sqrt((x - 0.5)**2 + (y - 0.4)**2) - 0.25) < 0.04"}}
    disc = {"where": {"condition": "sqrt((x - 0.5)**2 + (y - 0.4)**2) < 0.21"}}
    fluids = [{"phase": "a", "shape": ring}, {"phase": "b", "shape": disc}, LAYERS["fluids"][2]]
    (line,) = told(case_of(LAYERS, fluids=fluids), "fluids")
    assert line.startswith("fluids.0.shape: a is nowhere more than")


def test_a_drop_with_pointed_ends_is_no_layer():
    drop = {"sphere": {"center": [0.5, 0.4], "radius": 0.11}}
    fluids = [{"phase": "a", "shape": LAYERS["fluids"][0]["shape"]}, {"phase": "b", "shape": drop}, LAYERS["fluids"][2]]
    assert not told(case_of(LAYERS, fluids=fluids), "fluids")


def test_a_channel_of_one_fluid_may_be_narrow():
    """Two rows between walls: no other fluid is beside it."""
    narrow = {"lower": [0, 0], "upper": [1, 0.1], "boundary": {"x": "periodic", "y": "wall"}}
    one = {"phases": {"a": {"density": 1}}, "fluids": [{"phase": "a", "shape": "rest"}], "surface_tension": []}
    assert not told(case_of({**LAYERS, **one, "domain": narrow}), "fluids")


# drops on walls ----------------------------------------------------------------------------------------------


def drop_on_floor(rows, angle=60.0, height=0.0, boundary="wall"):
    """Half a disc of so many rows on the floor of a tank of 40 x 20 cells, or a whole one at `height` spacings."""
    tension = {"between": ["water", "air"], "coefficient": 0.07}
    return case_of(
        {
            "dimension": 2,
            "particle_spacing": 1 / 40,
            "end_time": 0.1,
            "domain": {"lower": [0, 0], "upper": [1, 0.5], "boundary": {"x": "wall", "y": boundary}},
            "phases": {"water": {"density": 1000}, "air": {"density": 1.2}},
            "surface_tension": [tension if angle is None else {**tension, "contact_angle": angle}],
            "fluids": [
                {"phase": "water", "shape": {"sphere": {"center": [0.5, height / 40], "radius": rows / 40}}},
                {"phase": "air", "shape": "rest"},
            ],
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )


@pytest.mark.parametrize("rows", [4, 5])
def test_a_low_drop_on_a_wall_is_told(rows):
    (line,) = told(drop_on_floor(rows), "fluids.0.shape")
    assert f"water lies {rows} rows" in line and "contact_angle" in line and f"to {rows / 240:.2g}" in line


def test_drops_that_an_angle_can_hold_are_fine():
    """High enough, without an angle, away from the wall, on a side that is none."""
    fine = [drop_on_floor(6), drop_on_floor(5, angle=None), drop_on_floor(5, height=10)]
    fine.append(drop_on_floor(5, boundary="periodic"))
    assert not [line for case in fine for line in told(case, "fluids.0.shape")]


def test_a_layer_over_the_whole_floor_is_no_drop():
    case = drop_on_floor(5).replace({"fluids.0.shape": {"box": {"lower": [0, 0], "upper": [1, 5 / 40]}}})
    assert not told(case, "fluids.0.shape")
