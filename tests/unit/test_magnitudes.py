"""Absurd numbers are refused with key, value, rule and remedy; strange ones that can be computed are not."""

import pytest
from typer.testing import CliRunner

from tests.isph_scenes import TANK
from tests.scenes import FULL, PERIODIC, case_of
from warpsph import cli
from warpsph.case.case_file import save_case
from warpsph.errors import CaseError
from warpsph.running.preview import estimate

NONE = {"particles": "none", "checkpoint": "none"}
DROP = {**FULL, "gauges": {}, "output": NONE}
VORTICES = {**PERIODIC, "gauges": {}, "output": NONE}
SMALL = {"domain.upper": [1e-24, 1e-24], "particle_spacing": 1e-25}

ABSURD = {
    # what is changed, which key is named, what its rule says
    "gravity beyond float32": (DROP, {"gravity": [0, -1e300]}, "gravity.1", "beyond the numbers"),
    "gravity": (DROP, {"gravity": [0, -1e30]}, "gravity.1", "square of the gravity"),
    "viscosity": (VORTICES, {"phases.water.viscosity": 1e30}, "phases.water.viscosity", "steps"),
    "density": (VORTICES, {"phases.water.density": 1e300}, "phases.water.density", "beyond the numbers"),
    "no density": (VORTICES, {"phases.water.density": 1e-300}, "phases.water.density", "beyond the numbers"),
    "sound speed": (VORTICES, {"phases.water.sound_speed": 1e30}, "phases.water.sound_speed", "stiffness"),
    "no sound speed": (VORTICES, {"phases.water.sound_speed": 1e-30}, "phases.water.sound_speed", "stiffness"),
    "tension": (DROP, {"surface_tension.0.coefficient": 1e30}, "surface_tension.0.coefficient", "steps"),
    "time": (VORTICES, {"end_time": 1e300}, "end_time", "steps"),
    "a long time": (VORTICES, {"end_time": 1e16}, "end_time", "steps"),
    "step": (VORTICES, {"numerics.maximum_step": 1e-300}, "numerics.maximum_step", "steps"),
    "size": (VORTICES, {"domain.upper": [1e300, 1e300]}, "domain.upper.0", "beyond the numbers"),
    "a large world": (
        VORTICES,
        {"domain.upper": [1e25, 1e25], "particle_spacing": 1e24},
        "domain.upper.0",
        "volume of a particle",
    ),
    "a small world": (VORTICES, SMALL, "particle_spacing", "volume of a particle"),
    "body force": (VORTICES, {"body_force": [1e30, 0]}, "body_force.0", "square of the body force"),
    "gravity of isph": (TANK, {"gravity": [0, -1e200]}, "gravity.1", "square of the gravity inf"),
    "speed": (VORTICES, {"precision": "float64", "scales.velocity": 1e200}, "scales.velocity", "no computer holds"),
    "viscosity of isph": (TANK, {"phases.water.viscosity": 1e60}, "phases.water.viscosity", "steps"),
}


@pytest.mark.parametrize("name", ABSURD)
def test_absurd_numbers_are_refused(name):
    scene, changes, key, rule = ABSURD[name]
    with pytest.raises(CaseError) as caught:
        estimate(case_of(scene).replace(changes))
    found = {problem.path: problem for problem in caught.value.problems}
    assert key in found, str(caught.value)
    assert rule in found[key].rule
    assert "write" in found[key].remedy and found[key].value is not None
    assert "inf particles" not in str(caught.value)


def test_check_show_and_run_refuse_them(tmp_path):
    save_case(case_of(VORTICES).replace({"phases.water.viscosity": 1e30}), tmp_path / "case.yaml")
    for command in (["check"], ["show"], ["run", "--output", str(tmp_path / "run")]):
        result = CliRunner().invoke(cli.app, [command[0], str(tmp_path / "case.yaml"), *command[1:]])
        assert result.exit_code == 2
        assert "phases.water.viscosity: 1e+30" in result.stderr and "write a smaller number" in result.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "changes",
    [
        {"gravity": [0, -1e-30]},
        {"phases.gas.viscosity": 1e-40},
        {"surface_tension.0.coefficient": 1e-30},
        {"precision": "float64", "gravity": [0, -1e-200]},
    ],
    ids=str,
)
def test_what_is_as_good_as_zero_is_none_of_it(changes):
    assert estimate(case_of(DROP).replace(changes))["steps"] > 0


def test_float64_holds_more():
    """Where that is so, it is part of the remedy."""
    case = case_of({**VORTICES, "start": {}, "scales": {"velocity": 1}}).replace({**SMALL, "end_time": 1e-44})
    with pytest.raises(CaseError, match="or precision: float64"):
        estimate(case)
    assert estimate(case.replace({"precision": "float64"}))["particles"] == 100
