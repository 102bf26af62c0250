"""Keys and words of other programs: the message says how to write here what they mean."""

from typing import Any

import pytest

from warpsph.case.case import Case
from warpsph.errors import CaseError


def told(path: str, **changes: Any) -> str:
    """Rule and remedy of the only problem of a small case with changes, which is at the path."""
    plain = {
        "dimension": 2,
        "particle_spacing": 1 / 16,
        "end_time": 0.1,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "phases": {"water": {"density": 1}},
        "fluids": [{"phase": "water", "shape": "rest"}],
    }
    with pytest.raises(CaseError) as raised:
        Case.from_dict({**plain, **changes})
    (problem,) = raised.value.problems
    assert problem.path == path
    return f"{problem.rule}; {problem.remedy}"


@pytest.mark.parametrize(
    ("word", "meant"), [("no_slip", "wall"), ("no-slip", "wall"), ("No slip", "wall"), ("slip", "free_slip")]
)
def test_no_slip_sides_are_walls(word, meant):
    """For no_slip it was "did you mean free_slip?", the opposite."""
    for path, sides in (("x", {"x": word}), ("x.lower", {"x": {"lower": word}})):
        domain = {"lower": [0, 0], "upper": [1, 1], "boundary": {**sides, "y": "wall"}}
        text = told(f"domain.boundary.{path}", domain=domain)
        assert text.endswith("write wall, which is a no-slip wall" if meant == "wall" else "did you mean free_slip?")


@pytest.mark.parametrize(("key", "value"), [("density", 500), ("mass", 3), ("velocity", [0, 1])])
def test_bodies_move_as_they_are_told(key, value):
    """The density of a floating body was said to be at home at start.density."""
    body = {"shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.2}}, key: value}
    text = told(f"bodies.b.{key}", bodies={"b": body})
    assert "float or fall freely do not exist" in text and "motion: {translation" in text


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("circle", "write sphere"), ("cylinder", "hypot"), ("ellipse", "hypot"), ("triangle", "polygon"),
        ("rectangle", "write box"), ("Plane", "where"),
    ],
)  # fmt: skip
def test_shapes_of_other_programs(word, meant):
    """They were told "write e.g. shape: rest"."""
    for shape in (word, {word: {"radius": 1}}):
        text = told("fluids.0.shape", fluids=[{"phase": "water", "shape": shape}]).split("the word rest; ")[1]
        assert meant in text and "shape: rest" not in text and "one of" not in text


def test_a_turned_box_is_a_polygon():
    box = {"lower": [0, 0], "upper": [1, 1], "angle": 30}
    text = told("fluids.0.shape.box.angle", fluids=[{"phase": "water", "shape": {"box": box}}])
    assert "along the axes" in text and "polygon" in text and "where" in text
