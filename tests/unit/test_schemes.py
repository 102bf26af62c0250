"""Schemes by name: each has numerics of its own, and a program may add one."""

import json
import subprocess
import sys
from typing import Annotated

import pytest
from jsonschema import Draft202012Validator
from pydantic import Field

from tests.scenes import FULL, case_of
from warpsph.case.case import Case, case_schema
from warpsph.case.case_file import dump_case, read_yaml
from warpsph.case.numerics import NumericsBase
from warpsph.case.values import NumberRule
from warpsph.errors import CaseError, Problem
from warpsph.schemes import registry
from warpsph.schemes.base import Scheme
from warpsph.schemes.isph_numerics import IsphNumerics
from warpsph.schemes.riemann_numerics import RiemannNumerics

TANK = {
    "dimension": 2,
    "particle_spacing": 0.1,
    "end_time": 1.0,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
    "phases": {"water": {"density": 1000}},
    "fluids": [{"phase": "water", "shape": "rest"}],
}


class Toy(Scheme):
    """A scheme as a program outside of the package makes it."""

    class Numerics(NumericsBase):
        """Its keys."""

        sharpness: Annotated[float, NumberRule(least=0, most=2)] = Field(default=1.0, description="s", examples=["1"])

    name = "toy"
    summary = "a scheme of the tests"
    numerics = Numerics

    def check(self, case):
        if case.numerics.sharpness > 1 and case.has_walls:
            yield Problem("numerics.sharpness", case.numerics.sharpness, "is too sharp for walls", "write 1")


@pytest.fixture
def toy(monkeypatch):
    monkeypatch.setattr(registry, "_known", dict(registry._known))
    registry.register(Toy())


def case_with(**numerics):
    return Case.from_dict({**TANK, "numerics": numerics})


def problems_with(**numerics):
    with pytest.raises(CaseError) as caught:
        case_with(**numerics)
    return {problem.path: problem for problem in caught.value.problems}


def test_the_scheme_decides_the_model():
    assert type(Case.from_dict(TANK).numerics) is RiemannNumerics
    assert type(case_with().numerics) is RiemannNumerics
    assert type(case_with(scheme="isph").numerics) is IsphNumerics
    assert not hasattr(case_with().numerics, "time_order") and not hasattr(case_with(scheme="isph").numerics, "star_states")


@pytest.mark.parametrize("name", ["riemann", "isph", "delta_plus", "gas"])
def test_each_scheme_has_a_name_a_summary_and_numerics(name):
    scheme = registry.find(name)
    assert scheme is registry.find(name) and scheme.name == name and scheme.summary
    assert issubclass(scheme.numerics, NumericsBase) and scheme.numerics().scheme == name
    assert all(info.description and info.examples for info in scheme.numerics.model_fields.values())


@pytest.mark.parametrize(
    ("scheme", "key", "owner"),
    [("isph", "star_states", "riemann"), ("riemann", "solver", "isph"), (None, "tolerance", "isph")],
)
def test_a_key_of_another_scheme_is_unknown_and_says_whose_it_is(scheme, key, owner):
    numerics = {key: "auto"} | ({} if scheme is None else {"scheme": scheme})
    problem = problems_with(**numerics)[f"numerics.{key}"]
    assert f"is a choice of scheme: {owner}, the case has scheme: {scheme or 'riemann'}" in problem.rule
    assert problem.remedy == f"delete it, or write scheme: {owner}"


def test_a_change_of_scheme_says_which_keys_are_left_over():
    with pytest.raises(CaseError, match="numerics.star_states.*scheme: riemann"):
        case_with(star_states="weighted").replace({"numerics.scheme": "isph"})
    assert type(case_with(courant=0.2).replace({"numerics.scheme": "isph"}).numerics) is IsphNumerics


def test_an_unknown_scheme_names_those_there_are(toy):
    problems = problems_with(scheme="isp", time_order=1, courant=-1, wrong=1)
    assert set(problems) == {"numerics.scheme", "numerics.courant", "numerics.wrong"}  # nothing about keys of a scheme
    assert problems["numerics.scheme"].remedy == "did you mean isph?"
    assert "riemann, isph, delta_plus, gas, toy" in problems["numerics.scheme"].rule
    assert "riemann, isph, delta_plus, gas, toy" in problems_with(scheme=3)["numerics.scheme"].rule


@pytest.mark.parametrize("written", [3, "isph", None, [1]])
def test_numerics_that_are_no_mapping(written):
    with pytest.raises(CaseError, match="numerics"):
        Case.from_dict({**TANK, "numerics": written})


def test_a_misspelt_key_is_corrected_in_the_scheme_at_hand():
    assert problems_with(scheme="isph", time_ordr=1)["numerics.time_ordr"].remedy == "did you mean time_order?"
    with pytest.raises(CaseError, match="at home at numerics.time_order"):
        Case.from_dict({**TANK, "time_order": 1})


def test_faults_of_other_sections_are_told_with_those_of_the_scheme():
    """The check of a scheme runs on what can be read of a faulty case, properties of a case included."""
    scene = {**TANK, "end_time": -1, "numerics": {"volume_constraint": True, "courant": 9}}
    scene["domain"] = {"lower": [0, 0], "upper": [1, 1]}
    with pytest.raises(CaseError) as caught:
        Case.from_dict(scene)
    wrong = {"end_time", "numerics.courant", "numerics.volume_constraint"}
    assert {problem.path for problem in caught.value.problems} == wrong


def test_a_scheme_of_a_program_works_at_once(toy):
    case = case_with(scheme="toy", sharpness="1/2", courant=0.2)
    assert type(case.numerics) is Toy.Numerics and case.numerics.sharpness == 0.5
    assert case.to_dict()["numerics"] == {"scheme": "toy", "courant": 0.2, "sharpness": 0.5}
    assert Case.from_dict(case.to_dict()) == case and Case.from_dict(read_yaml(dump_case(case, defaults=True)))
    assert "too sharp" in problems_with(scheme="toy", sharpness=2)["numerics.sharpness"].rule
    assert "<= 2" in problems_with(scheme="toy", sharpness=3)["numerics.sharpness"].rule
    assert "scheme: toy" in problems_with(sharpness=1)["numerics.sharpness"].rule
    assert case_with().replace({"numerics.scheme": "toy"}).numerics.scheme == "toy"


def test_a_name_is_given_once(toy):
    for name in ("toy", "isph"):
        other = Toy()
        other.name = name
        with pytest.raises(ValueError, match="already"):
            registry.register(other)
    with pytest.raises(KeyError, match="riemann, isph, delta_plus, gas, toy"):
        registry.find("sph")


@pytest.mark.parametrize(
    ("numerics", "good"),
    [
        ({}, True),
        ({"scheme": "riemann", "star_states": "weighted"}, True),
        ({"scheme": "isph", "time_order": 1}, True),
        ({"scheme": "toy", "sharpness": 1}, True),
        ({"time_order": 1}, False),
        ({"scheme": "isph", "star_states": "weighted"}, False),
        ({"scheme": "sph"}, False),
        ({"scheme": "toy", "sharpness": 3}, False),
    ],
)
def test_the_schema_knows_the_keys_of_each_scheme(toy, numerics, good):
    schema = json.loads(json.dumps(case_schema()))
    assert Draft202012Validator(schema).is_valid({**TANK, "numerics": numerics}) is good


def test_numerics_survive_a_way_through_a_file():
    case = case_of(FULL, numerics={"scheme": "riemann", "room_rate": 1, "maximum_step": 0.5})
    assert Case.from_dict(read_yaml(dump_case(case))) == case
    assert dump_case(case).count("room_rate") == 1 and "star_states" not in dump_case(case)


def test_numerics_of_the_schemes_need_no_warp():
    code = (
        "from warpsph.case.case import Case\nfrom warpsph.schemes import registry\n"
        "[registry.find(name) for name in registry.names()]\n"
        "import sys\nprint([name for name in ('warp', 'warpsph.kernels') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
