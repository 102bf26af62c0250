"""The profile of stages books every launch of a step once, and its shares add up; its times are nobody's test."""

import argparse
import importlib.util
import sys
from pathlib import Path

import pytest

from warpsph.kernels.core import clock as ck

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "profile_stages.py"
STEPS = 2 * ck.RARE_INTERVAL


@pytest.fixture(scope="module")
def profile():
    spec = importlib.util.spec_from_file_location("profile_stages", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["profile_stages"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["profile_stages"]


def measured(profile, scene, threads=1):
    options = argparse.Namespace(device="cpu", threads=threads, precision="float32", particles=1600, steps=STEPS)
    result = profile.measure(scene, options)
    return result, {row["stage"]: row for row in result["rows"]}


@pytest.mark.parametrize("threads", [1, 2])
def test_each_stage_is_booked_once_a_step(profile, threads):
    result, rows = measured(profile, "vortices", threads)
    for name in ("kick_drift", "continuity", "momentum", "advance"):
        assert rows[name]["runs"] == rows[name]["launches"] == 1.0
    # the stages that run rarely do so every few steps, or sooner
    assert 1 / ck.RARE_INTERVAL <= rows["drift"]["runs"] <= 1.0
    assert rows["drift"]["launches"] == rows["drift"]["runs"]
    assert sum(row["share"] for row in result["rows"]) == pytest.approx(1.0)
    assert sum(row["launches"] for row in result["rows"]) == result["launches"]
    assert 0.0 < result["us_in_stages"] <= result["us_per_step"]
    # two sweeps read the whole list: at least its entries, and one vector of each particle
    assert rows["momentum"]["bandwidth"] > 0.0


def test_launches_of_a_solve_belong_to_it(profile):
    _, rows = measured(profile, "drop")
    assert rows["solve"]["runs"] == 1.0 and rows["solve"]["launches"] > 20.0


def test_what_a_stage_moves_is_its_arrays_once(profile):
    from warpsph.case.case import Case
    from warpsph.running.model import Model

    model = Model(Case.from_dict(profile.SCENES["lean"](400)), device="cpu", threads=1)
    model.stepper.prepare(fresh=True)
    moved = profile.least_bytes(model)
    arrays = model.particles.arrays
    listed = arrays["fluid_neighbours"].numpy().sum()
    assert profile.entries(model) == listed
    assert moved["momentum"] > 4 * listed + sum(arrays[name].capacity for name in ("position", "velocity", "state"))
    assert moved["advance"] < 1000
