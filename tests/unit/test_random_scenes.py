"""Random scenes: the same for the same seed, valid, of every kind, and judged by what they allow."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.running.model import Model

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
SEEDS = range(1, 61)


@pytest.fixture(scope="module")
def modules():
    """The scripts (random_scenes, stress)."""
    spec = importlib.util.spec_from_file_location("stress_of_scenes", SCRIPTS / "stress.py")
    stress = importlib.util.module_from_spec(spec)
    sys.modules["stress_of_scenes"] = stress
    spec.loader.exec_module(stress)
    yield stress.random_scenes, stress
    del sys.modules["stress_of_scenes"]


@pytest.fixture(scope="module")
def scenes(modules):
    return [modules[0].scene(seed) for seed in SEEDS]


def test_a_seed_is_a_scene(modules, scenes):
    assert modules[0].scene(7) == scenes[6]
    assert len({json.dumps(data, sort_keys=True) for data in scenes}) == len(scenes)


def test_every_scene_is_a_valid_case_of_liquids_and_gases(scenes):
    for data in scenes:
        case = Case.from_dict(data)
        assert 1 <= len(case.phases) <= 3 and max(phase.density for phase in case.phases.values()) > 100


def test_scenes_of_every_kind_are_drawn(scenes):
    kinds = {
        "3-D": [data["dimension"] == 3 for data in scenes],
        "three phases": [len(data["phases"]) == 3 for data in scenes],
        "one phase": [len(data["phases"]) == 1 for data in scenes],
        "body": ["bodies" in data for data in scenes],
        "thrown": ["velocity" in data["start"] for data in scenes],
        "no gravity": [not any(data["gravity"]) for data in scenes],
        "tension": [bool(data["surface_tension"]) for data in scenes],
        "periodic": ["periodic" in data["domain"]["boundary"].values() for data in scenes],
        "lid": ["velocity" in json.dumps(data["domain"]) for data in scenes],
        "open": ["open" in json.dumps(data["domain"]) for data in scenes],
        "isph": [data.get("numerics", {}).get("scheme") == "isph" for data in scenes],
        "float64": [data["precision"] == "float64" for data in scenes],
        "millimetres": [data["domain"]["upper"][0] < 0.01 for data in scenes],
        "metres": [data["domain"]["upper"][0] > 0.5 for data in scenes],
    }
    missing = [kind for kind, there in kinds.items() if not any(there)]
    assert not missing


def test_what_a_scene_allows(modules):
    """A block of water 0.1 m above the floor of a box, with air: its energies and speeds by hand."""
    data = {
        "dimension": 2, "particle_spacing": 0.02, "end_time": 1.0, "gravity": [0, -9.81],
        "domain": {"lower": [0, 0], "upper": [0.4, 0.4], "boundary": {"x": "wall", "y": "wall"}},
        "phases": {"water": {"density": 1000}, "air": {"density": 1.0}},
        "surface_tension": [{"between": ["water", "air"], "coefficient": 0.07}],
        "fluids": [
            {"phase": "water", "shape": {"box": {"lower": [0.1, 0.1], "upper": [0.3, 0.3]}}},
            {"phase": "air", "shape": "rest"},
        ],
        "start": {"velocity": ["where(0.1 < x < 0.3 and 0.1 < y < 0.3, 2, 0)", "0"], "arrangement": "lattice"},
        "numerics": {"unlock": 0},
    }  # fmt: skip
    model = Model(Case.from_dict(data), threads=1)
    model.stepper.prepare(fresh=True)
    allowed = modules[0].Allowed(model, model.snapshot().fluid)
    kinetic, surface = 0.5 * 1000 * 0.04 * 2**2, 0.07 * 0.8
    air = 1.0 * (0.16 - 0.04)
    # sorted by density the water lies 0.1 m deep and the air above it
    lifted = 9.81 * (40 * 0.2 + air * 0.2 - 40 * 0.05 - air * 0.25)
    dust = modules[0].LIFT * 0.02 * (40 + air) * 9.81
    assert allowed.scale == pytest.approx(kinetic + surface + lifted + dust, rel=1e-3)
    pressure = 1000 * (9.81 * 0.4 + 0.5 * 2**2) + 0.07 / 0.02
    np.testing.assert_allclose(allowed.speed, 2 * np.sqrt(2 * pressure / np.array([1000.0, 1.0])), rtol=1e-3)
    assert not allowed.fed


def test_a_scene_is_run_and_told(modules, tmp_path, capsys):
    _, stress = modules
    file = tmp_path / "rows.json"
    arguments = ["--scenes", "1", "--seed", "2", "--steps", "60", "--threads", "1", "--json", str(file)]
    assert stress.main(arguments) == 0
    assert "1 scenes, 0 missed a limit" in capsys.readouterr().out
    data = json.loads(file.read_text())
    assert data["steps"] == 60 and data["rows"][0]["seed"] == 2 and data["rows"][0]["steps"] == 60
    assert set(data["rows"][0]["criteria"]) == {"lives", "leaks", "speed", "energy"}


@pytest.mark.parametrize("fault", ["lives", "leaks", "speed", "energy"])
def test_what_is_wrong_fails(modules, fault, monkeypatch, capsys):
    """Each criterion alone makes the exit code 1: a fault, a particle in a wall, a bullet, energy from nothing."""
    scenes, stress = modules
    real = Model.snapshot

    def snapshot(self):
        found = real(self)
        if self.steps > 10:
            if fault == "speed":
                found.velocity[0] = 1e6
                found.mass[0] = 0.0
            if fault == "energy":
                found.velocity[:] = 2.0 * np.sqrt(9.81) + 0.1
        return found

    monkeypatch.setattr(Model, "snapshot", snapshot)
    if fault == "leaks":
        monkeypatch.setattr(Model, "leaks", lambda self: ({"oil": 1}, {"oil": 0}))
    if fault == "lives":
        monkeypatch.setattr(scenes, "scene", lambda seed: {"dimension": 7})
        monkeypatch.setattr(scenes, "describe", lambda data: "broken")
    assert stress.main(["--scenes", "1", "--seed", "18", "--steps", "40", "--threads", "1"]) == 1
    out = capsys.readouterr().out
    assert f"{fault} 1" in out.splitlines()[-1]
