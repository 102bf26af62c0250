"""The case files: each is valid and runs; `--validate` runs each in full and holds it to the accuracy asked for."""

import math
from pathlib import Path

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.simulation import Simulation
from warpsph.study import validation

FOLDER = Path(__file__).parents[2] / "cases"
FILES = {path.stem: path for folder in (FOLDER, FOLDER / "papers") for path in sorted(folder.glob("*.yaml"))}
NAMES = list(FILES)

# A spacing at which a start is a matter of seconds, where the one of the file is not.
COARSE = {
    "cylinder_periodic": 1 / 6,
    "cylinder_start": 1 / 20,
    "dam_break_3d": 0.03,
    "naca0012": 1 / 30,
    "rising_bubble_3d": 0.1 / 4,
    "static_drop_3d": 0.25 / 5,
}


def load(name, **changes) -> Case:
    case = Case.load(FILES[name])
    return case.replace({key.replace("__", "."): value for key, value in changes.items()}) if changes else case


def errors(folder, name, **changes) -> dict[str, dict]:
    """Run a case in full; its comparisons by name, and none of them without a number."""
    simulation = Simulation(load(name, **changes), output=folder / "run", threads=1).run()
    found = simulation.summary["errors"]
    assert all(entry["error"] is not None and math.isfinite(entry["error"]) for entry in found.values()), found
    return found


@pytest.mark.parametrize("name", NAMES)
def test_the_file_is_valid_and_says_what_it_is(name):
    text = FILES[name].read_text(encoding="utf-8")
    assert text.startswith("# ") and "# Look at: " in text and "# Takes about " in text
    case = load(name)
    assert case.title
    assert case.reference, "a case is compared with something"
    assert all(entry.source for entry in case.reference.values())


@pytest.mark.parametrize("name", NAMES)
def test_its_validation_runs_are_valid(name):
    runs = validation.runs_of(load(name), name)
    assert "quick" in {run.level for run in runs}
    for run in runs:
        # a run without a limit shows nothing, except that of a pair which reports what the other form does
        assert "corrected" in run.name or any(entry.allowed is not None for entry in run.case.reference.values())
        shown = run.case.validation.figure
        # the runs of ci are too short for pictures
        assert run.level == "ci" or shown is None or shown.times is None or shown.times[-1] <= run.case.end_time


def test_the_fluids_of_each_capillary_wave_are_those_of_its_closed_form():
    """Prosperetti's solution is one of equal kinematic viscosities, Laplace number 3000 of the denser fluid."""
    for run in validation.runs_of(load("capillary_wave"), "capillary_wave"):
        lower, upper = (run.case.phases[name] for name in ("lower", "upper"))
        tension = run.case.surface_tension[0].coefficient
        assert lower.viscosity / lower.density == pytest.approx(upper.viscosity / upper.density, rel=1e-6), run.name
        assert tension * lower.density / lower.viscosity**2 == pytest.approx(3000.0, rel=1e-6), run.name


@pytest.mark.parametrize("name", NAMES)
def test_the_case_starts(name, tmp_path):
    case = load(name)
    coarse = COARSE.get(name)
    end = 1e-3 * case.end_time
    changes = {"end_time": end, "numerics.maximum_step": end / 4}
    if coarse is not None:
        changes["particle_spacing"] = coarse
    simulation = Simulation(case.replace(changes), output=tmp_path / "run", threads=1).run()
    assert simulation.summary["steps"] >= 4
    state = simulation.state.fluid
    assert np.isfinite(state.velocity).all() and np.isfinite(state.pressure).all()
    assert list(simulation.summary["errors"]) == list(case.reference)


def test_the_starter_case_does_what_its_title_says(tmp_path):
    """An ellipse at first, a circle with the pressure of one in the end, by the references that the file names."""
    text = (FOLDER.parent / "warpsph" / "starter.yaml").read_text(encoding="utf-8").replace("NAME", "mine")
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    simulation = Simulation(tmp_path / "mine.yaml", output=tmp_path / "run", threads=1).run()
    assert simulation.case.title == "Drop that becomes round"
    shape = simulation.gauge("shape")
    width, height = (shape[f"highest_{axis} oil"] - shape[f"lowest_{axis} oil"] for axis in "xy")
    assert width[0] == pytest.approx(0.006, rel=0.02) and height[0] == pytest.approx(0.004, rel=0.02)
    assert shape["circularity oil"][0] < 0.975
    assert width[-1] == pytest.approx(height[-1], rel=0.03)
    errors = simulation.summary["errors"]
    assert set(errors) == {"round", "pressure_jump"} and all(entry["passed"] for entry in errors.values()), errors
    assert simulation.summary["wall_seconds"] < 60 and simulation.summary["warnings"] == []


# -- in full -----------------------------------------------------------------------------------------------


# Cases whose quick runs take less than a minute together; `python -m warpsph validate` runs the others too.
SHORT = ("couette", "dam_break", "hydrostatic_tank", "layered_tank", "poiseuille", "standing_wave", "taylor_green*")


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("name", SHORT)
def test_errors_stay_within_what_the_file_allows(name, precision, tmp_path):
    runs = validation.plan("quick", [name], precision=precision)
    table = validation.validate(runs, tmp_path / "out", threads=1, draw=False)
    assert not table.bad, table.markdown()


@pytest.mark.slow
def test_channel_errors_fall_at_second_order(tmp_path):
    coarse = errors(tmp_path / "40", "poiseuille")["profile"]["error"]
    fine = errors(tmp_path / "80", "poiseuille", particle_spacing=1e-3 / 80)["profile"]["error"]
    assert fine < 0.4 * coarse


@pytest.mark.slow
@pytest.mark.parametrize("name", ["taylor_green", "taylor_green_lattice"])
def test_taylor_green_at_twice_the_resolution(name, tmp_path):
    coarse = errors(tmp_path / "50", name)
    fine = errors(tmp_path / "100", name, particle_spacing=0.01)
    assert abs(fine["decay"]["error"]) < 0.01
    assert fine["speed_l1"]["error"] < coarse["speed_l1"]["error"]


@pytest.mark.slow
def test_the_lattice_start_of_taylor_green_is_not_several_times_worse(tmp_path):
    noisy = errors(tmp_path / "noisy", "taylor_green")["speed_l1"]["error"]
    lattice = errors(tmp_path / "lattice", "taylor_green_lattice")["speed_l1"]["error"]
    assert lattice < 3 * noisy


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hydrostatic_tank", "layered_tank"])
def test_a_tank_at_rest_does_not_drift(name, tmp_path):
    simulation = Simulation(load(name), output=tmp_path / "run", threads=1).run()
    energy = simulation.gauge("energy")
    early = energy["potential"][np.searchsorted(energy["time"], 1.6)]
    weight = simulation.state.fluid.mass.sum() * 9.81
    # the centre of mass may not move by what could be seen: a twentieth of the particle spacing
    assert abs(energy["potential"][-1] - early) < 0.05 * simulation.case.spacing * weight
    speed = simulation.gauge("momentum")
    late = speed["max_speed"][speed["time"] >= 1.6]
    assert late.max() < 2e-3 * math.sqrt(9.81)


@pytest.mark.slow
def test_the_standing_wave_converges(tmp_path):
    coarse = errors(tmp_path / "40", "standing_wave")["wave"]["error"]
    fine = errors(tmp_path / "80", "standing_wave", particle_spacing=1 / 80)["wave"]["error"]
    assert fine < coarse


@pytest.mark.slow
def test_the_dam_break_keeps_its_energy_and_its_water(tmp_path):
    simulation = Simulation(load("dam_break"), output=tmp_path / "run", threads=1).run()
    energy = simulation.gauge("energy")
    assert energy["total"].max() < 1.01 * energy["total"][0]
    x, y = simulation.state.fluid.position.T
    # spray may leave over the rim; nothing may be inside a wall, four layers thick
    thick = 4 * 0.146 / 40
    walls = (y < 0.876) & (((x > -thick) & (x < 0)) | ((x > 0.584) & (x < 0.584 + thick)))
    floor = (y < 0) & (y > -thick) & (x > 0) & (x < 0.584)
    assert not walls.any() and not floor.any()
