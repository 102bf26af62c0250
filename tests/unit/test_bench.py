"""The benchmark of what a scene does not need works; its times are nobody's test."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from tests.scenes import case_of
from warpsph.kernels.core import clock as ck
from warpsph.running.preview import describe

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "bench_skip.py"


@pytest.fixture(scope="module")
def bench_skip():
    spec = importlib.util.spec_from_file_location("bench_skip", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["bench_skip"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["bench_skip"]


def test_each_scene_has_less_than_the_one_before(bench_skip):
    plans = [describe(case_of(data)) for data in bench_skip.scenes(20).values()]
    for more, less in zip(plans, plans[1:], strict=False):
        # without walls there is no friction on them to tell of; instead of walls come periodic images and a drift
        gone = {row["name"] for row in more["absent"]} - {"periodic images", "wall friction", "drift"}
        assert gone < {row["name"] for row in less["absent"]}
        stages = [[row["name"] for row in plan["stages"] if "drift_" not in row["name"]] for plan in (more, less)]
        assert set(stages[1]) - {"drift"} <= set(stages[0]) and len(stages[1]) <= len(stages[0])
    assert [stage["name"] for stage in plans[-1]["stages"]] == ["kick_drift", "continuity", "momentum", "advance", "list"]


@pytest.mark.parametrize("threads", [1, 2])
def test_hand_written_step_is_the_step_of_the_package(bench_skip, threads):
    bench = bench_skip.Bench(bench_skip.scenes(24)["leanest"], "cpu", threads, 24)
    hand = bench_skip.HandStep(bench.model)
    check = bench_skip.compare(bench, hand)
    assert check["steps"] == 20 and check["moved"] > 1e-6
    assert bench_skip.agrees(check)
    # repeated runs start from the same state
    first, again = (bench.state_after(hand.run, 5) for _ in range(2))
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert bench.model.steps == bench_skip.WARM_UP + 5


def test_hand_written_sweeps_on_the_list_of_a_gpu(bench_skip, monkeypatch):
    """The layout by columns, from the rows that a CPU has."""
    bench = bench_skip.Bench(bench_skip.scenes(24)["leanest"], "cpu", 1, 24)
    rows = bench.model.stepper.list
    columns = rows.neighbours.numpy().reshape(-1, rows.width).T.ravel()
    monkeypatch.setattr(rows, "neighbours", wp.array(columns, dtype=int, device="cpu"))
    by_columns = bench_skip.hand_sweeps(False)
    monkeypatch.setattr(bench_skip, "hand_sweeps", lambda by_rows: by_columns)
    assert bench_skip.agrees(bench_skip.compare(bench, bench_skip.HandStep(bench.model)))


def test_a_step_that_is_not_the_same_is_told(bench_skip):
    bench = bench_skip.Bench(bench_skip.scenes(24)["leanest"], "cpu", 1, 24)
    hand = bench_skip.HandStep(bench.model)
    hand.sweeps[2] = lambda: None  # no momentum sweep
    check = bench_skip.compare(bench, hand)
    assert not check["identical"] and not bench_skip.agrees(check)


def test_no_list_work_in_what_is_measured(bench_skip):
    bench = bench_skip.Bench(bench_skip.scenes(24)["leanest"], "cpu", 1, 1024)
    assert 1 <= bench.window < 1024
    counters = bench.state_after(bench.package, bench.window)["counters"]
    before = bench.state_after(lambda steps: None, 0)["counters"]
    assert counters[ck.STEPS] == before[ck.STEPS] + bench.window
    assert counters[ck.REBUILDS] == before[ck.REBUILDS] and counters[ck.CHECKS] == before[ck.CHECKS]


def test_command(bench_skip, tmp_path, capsys):
    out = tmp_path / "skip.json"
    assert bench_skip.main(["--particles", "400", "--rounds", "1", "--window", "2", "--json", str(out)]) == 0
    text = capsys.readouterr().out
    record = json.loads(out.read_text())
    assert {"commit", "dirty", "date"} <= set(record)
    (found,) = record["rows"]
    assert [row["scene"] for row in found["rows"]] == [*bench_skip.scenes(20), "leanest by hand"]
    for row in found["rows"]:
        assert row["scene"] in text and row["ms_per_step"] > 0
    full, lean, hand = found["rows"][0], *found["rows"][-2:]
    assert set(hand["arrays"]) == set(lean["arrays"]) - {"particle_id"}
    assert len(full["arrays"]) > len(lean["arrays"]) and full["bytes_per_particle"] > lean["bytes_per_particle"]
    assert found["ratio"] > 0 and "leanest, package over hand" in text
