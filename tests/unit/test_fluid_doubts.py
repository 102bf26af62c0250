"""Warnings about scenes of several fluids: angles and tensions; none where the scene may be meant."""

import copy
import math

import pytest

from tests.scenes import case_of
from warpsph.running.preview import estimate
from warpsph.running.tension_doubts import contradicting_angles, missing_pairs

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
