"""Sweeps: points, rows and tables, what goes on where it stopped, runs that fail, and workers of Dask that die."""

import copy
import csv
import json
import os
import signal
import sys
from pathlib import Path

import h5py
import numpy as np
import pandas
import pytest

from tests.scenes import LEAN
from warpsph import cli
from warpsph.case.case_file import dump_yaml
from warpsph.errors import CaseError, DivergenceError, Interrupted
from warpsph.simulation import Simulation
from warpsph.study import sweep as sweeps
from warpsph.study.sweep import execute, sweep
from warpsph.study.sweep_file import load_sweep
from warpsph.study.sweep_pictures import draw_sweep
from warpsph.study.sweep_points import points_of

ENERGY = {"gauge": "energy", "column": "kinetic"}


def scene():
    """64 particles and a few steps."""
    data = copy.deepcopy(LEAN) | {"particle_spacing": 1 / 8, "end_time": 0.01}
    data["output"] = {"particles": "none", "checkpoint": "none"}
    data["gauges"] = {"energy": {"type": "energy", "interval": 0.002}}
    data["reference"] = {"start": {**ENERGY, "reduce": "max", "value": 0.25}}
    return data


def study(**changes):
    return {
        "case": "scene.yaml",
        "parameters": {"end_time": [0.004, 0.008]},
        "measure": {"last": ENERGY, "mean": {**ENERGY, "reduce": "mean"}, "error": {"reference": "start"}},
    } | changes


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """A folder with the case, which the tests are in."""
    (tmp_path / "scene.yaml").write_text(dump_yaml(scene()), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(monkeypatch):
    """The numbers of the runs that are made from now on."""
    numbers = []

    def noted(task):
        numbers.append(task.number)
        return execute(task)

    monkeypatch.setattr(sweeps, "execute", noted)
    return numbers


def points(**changes):
    return points_of(load_sweep(study(**changes))[0])


# ---- points ----------------------------------------------------------------------------------------------


def test_a_grid_turns_the_last_parameter_fastest():
    found = points(parameters={"a": [1, "1/8"], "b": {"from": 1, "to": 100, "number": 3, "spacing": "log"}})
    assert [(point["a"], round(point["b"], 9)) for point in found] == [
        (1, 1), (1, 10), (1, 100), (0.125, 1), (0.125, 10), (0.125, 100),
    ]  # fmt: skip


def test_a_list_takes_values_together():
    assert points(method="list", parameters={"a": [1, 2], "b": ["x", "y"]}) == [{"a": 1, "b": "x"}, {"a": 2, "b": "y"}]


@pytest.mark.parametrize("method", ["latin_hypercube", "sobol"])
def test_samples_follow_from_the_seed(method):
    ranges = {"a": {"from": 2, "to": 4}, "b": {"from": 0.01, "to": 100, "spacing": "log"}}
    first, again, other = (points(method=method, samples=16, seed=seed, parameters=ranges) for seed in (3, 3, 4))
    assert first == again != other
    a, b = (np.array([point[name] for point in first]) for name in "ab")
    unit = np.stack([(a - 2) / 2, (np.log10(b) + 2) / 4], axis=1)
    # A sample in each sixteenth of every range: both ways of sampling promise that.
    assert (np.sort(np.floor(16 * unit), axis=0) == np.arange(16)[:, None]).all()


def test_settings_take_values_in_brackets():
    plan, _ = load_sweep(study(parameters={"Ca": [0.2], "end_time": [1]}, settings={"gravity.1": "-1/{Ca}", "dimension": 2}))
    assert plan.changes({"Ca": -0.2, "end_time": 1}) == {"end_time": 1, "gravity.1": "-1/(-0.2)", "dimension": 2}


def test_settings_take_values_within_lists_and_mappings():
    settings = {
        "gravity": [0, "-({g})"],
        "gauges.p": {"type": "points", "points": [[0.5, "{g}/9.81"]], "interval": 1},
        "numerics": {"scheme": "{scheme}"},
    }
    plan, _ = load_sweep(study(parameters={"g": [9.81, -5], "scheme": ["isph"]}, settings=settings))
    assert plan.used == ["g", "scheme"]
    assert plan.changes({"g": -5, "scheme": "isph"}) == {
        "gravity": [0, "-((-5))"],
        "gauges.p": {"type": "points", "points": [[0.5, "(-5)/9.81"]], "interval": 1},
        "numerics": {"scheme": "isph"},
    }


# ---- runs and their table --------------------------------------------------------------------------------


def test_a_sweep_measures_what_single_runs_give():
    table = sweep(study(), "out")
    for row in table.rows:
        run = Simulation(scene() | {"end_time": row["end_time"]}).run()
        kinetic = run.gauge("energy")["kinetic"]
        assert row["status"] == "finished" and row["problem"] is None
        assert (row["last"], row["mean"]) == (kinetic[-1], np.mean(kinetic))
        assert row["error"] == run.summary["errors"]["start"]["error"]
        assert (row["particles"], row["steps"], row["time"]) == (64, run.summary["steps"], row["end_time"])
    assert [row["end_time"] for row in table.rows] == [0.004, 0.008]


def test_runs_of_one_structure_compile_nothing_anew():
    """Kernels are compiled and loaded for the first run alone: a new spacing, viscosity or time is a number."""
    import warp as wp

    loaded = []
    before = wp.Module.load

    def load(self, *arguments, **keywords):
        known = len(self.execs)
        result = before(self, *arguments, **keywords)
        loaded.append(len(self.execs) - known)
        return result

    parameters = {"particle_spacing": [1 / 8, 1 / 10], "phases.water.density": [1, 2, 3]}
    sweep(study(parameters={"end_time": [0.002]}), "first")
    wp.Module.load = load
    try:
        table = sweep(study(parameters=parameters), "out")
        assert sum(loaded) == 0
        sweep(study(parameters={"numerics.kernel": ["wendland_c4"]}), "other")
        assert sum(loaded) > 0, "another kernel is another structure: the count can see a compilation"
    finally:
        wp.Module.load = before
    assert len(table.rows) == 6 and not table.failed


def test_the_table_is_read_back():
    table = sweep(study(parameters={"end_time": [0.004, -1]}), "out")
    frame = pandas.read_csv("out/table.csv")
    with h5py.File("out/table.h5") as file:
        other = pandas.DataFrame(file["table"][:])
    assert list(frame.columns) == list(other.columns) == table.columns
    for name in ("run", "end_time", "last", "mean", "error", "steps", "particles", "time"):
        np.testing.assert_array_equal(frame[name], table.column(name))
        np.testing.assert_array_equal(other[name], table.column(name))
    assert list(frame["status"]) == [text.decode() for text in other["status"]] == ["finished", "failed"]


# ---- variants, warm-up ------------------------------------------------------------------------------------


def test_each_variant_is_run_at_every_point_after_the_settings():
    variants = {"default": {}, "dense": {"phases.water.density": 3, "end_time": 0.006}}
    table = sweep(study(variants=variants, settings={"phases.water.density": 2}), "out")
    told = [(row["variant"], row["end_time"], row["time"]) for row in table.rows]
    assert told == [("default", 0.004, 0.004), ("default", 0.008, 0.008), ("dense", 0.004, 0.006), ("dense", 0.008, 0.006)]
    # kinetic energy is that of the density: 3 over 2
    assert table.rows[2]["mean"] / table.rows[0]["mean"] == pytest.approx(1.5, rel=0.05)
    assert table.columns[:3] == ["run", "end_time", "variant"] and list(table.column("variant")[:1]) == ["default"]
    with pytest.raises(CaseError, match="begun with"):
        sweep(study(variants=variants | {"dense": {}}, settings={"phases.water.density": 2}), "out")


def test_variants_take_values_as_settings_do():
    variants = {"low": {"gravity": [0, "-{g}"]}, "high": {"gravity": [0, "-2*{g}"], "end_time": 2}}
    plan, _ = load_sweep(study(parameters={"g": [9.81, -5], "end_time": [1]}, variants=variants))
    assert plan.used == ["g"]
    assert plan.changes({"g": -5, "end_time": 1, "variant": "low"}) == {"end_time": 1, "gravity": [0, "-(-5)"]}
    assert plan.changes({"g": -5, "end_time": 1, "variant": "high"}) == {"end_time": 2, "gravity": [0, "-2*(-5)"]}
    with pytest.raises(CaseError, match=r"uses \{h\} in variants, which is no parameter"):
        load_sweep(study(variants={"low": {"end_time": "{h}"}}))


def test_a_parameter_called_variant_beside_variants_is_refused():
    with pytest.raises(CaseError, match="two columns with the name variant"):
        load_sweep(study(parameters={"variant": [1]}, variants={"default": {}}))


def test_a_structure_is_warmed_up_once_in_a_process(monkeypatch):
    monkeypatch.setattr(sweeps, "_warm", set())
    ends = []
    before = Simulation.run

    def run(self, *arguments):
        ends.append(self.case.end_time)
        return before(self, *arguments)

    monkeypatch.setattr(Simulation, "run", run)
    table = sweep(study(warm_up=True, variants={"default": {}, "c4": {"numerics.kernel": "wendland_c4"}}), "out")
    short = sweeps.WARM_UP * 0.004
    assert ends == [short, 0.004, 0.008, short, 0.004, 0.008]
    assert [row["time"] for row in table.rows] == [0.004, 0.008] * 2


def test_a_row_has_the_memory_and_the_time_of_the_processor():
    for row in sweep(study(), "out", threads=1).rows:
        assert row["memory_bytes"] > 64 * 4 * 6, "at least position, velocity, density and mass of 64 particles"
        assert 0 < row["cpu_seconds"] < 60


# ---- stops and failures ----------------------------------------------------------------------------------


def test_a_failed_run_is_a_row_with_its_reason(monkeypatch):
    """A bad value, a run that diverges, an error that nobody thought of."""
    before = Simulation.run

    def run(self, *arguments, **keywords):
        if self.case.end_time == 0.002:
            raise DivergenceError("the velocity became infinite", particle=3, time=0.001, quantity="velocity")
        if self.case.end_time == 0.006:
            raise ZeroDivisionError("of nobody's making")
        return before(self, *arguments, **keywords)

    monkeypatch.setattr(Simulation, "run", run)
    plan = study(parameters={"end_time": [-1, 0.002, 0.004, 0.006]})
    table = sweep(plan, "out")
    assert [row["status"] for row in table.rows] == ["failed", "diverged", "finished", "failed"]
    for row, reason in zip(table.rows, ("end_time: -1 -> ", "became infinite", None, "ZeroDivisionError: of"), strict=True):
        assert row["problem"] is None if reason is None else reason in row["problem"]
        assert (row["last"] is None) == (reason is not None)
    numbers = made(monkeypatch)
    sweep(plan, "out")
    assert numbers == []
    sweep(plan, "out", retry=True)
    assert numbers == [0, 1, 3]


def test_a_stopped_sweep_goes_on_where_it_stopped(monkeypatch):
    plan = study(parameters={"end_time": [0.002, 0.004, 0.006]})

    def stopped(task):
        if task.number == 1:
            raise Interrupted("Ctrl-C")
        return execute(task)

    monkeypatch.setattr(sweeps, "execute", stopped)
    table = sweep(plan, "out")
    assert table.interrupted and len(table.rows) == 1
    with open("out/table.csv", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 1
    numbers = made(monkeypatch)
    table = sweep(plan, "out")
    assert numbers == [1, 2] and not table.interrupted
    assert [row["run"] for row in table.rows] == [0, 1, 2]


def test_a_result_that_is_cut_short_is_made_again(monkeypatch):
    sweep(study(), "out")
    Path("out/results/000001.json").write_text('{"run": 1', encoding="utf-8")
    numbers = made(monkeypatch)
    assert len(sweep(study(), "out").rows) == 2
    assert numbers == [1]


def test_a_changed_study_refuses_the_old_folder():
    sweep(study(), "out")
    with pytest.raises(CaseError) as caught:
        sweep(study(parameters={"end_time": [0.004, 0.009]}), "out")
    [problem] = caught.value.problems
    assert (problem.path, problem.value) == ("parameters.end_time.values.1", 0.009)
    assert "0.008" in problem.rule and "--output" in problem.remedy
    data = scene()
    data["phases"]["water"]["density"] = 2.0
    Path("scene.yaml").write_text(dump_yaml(data), encoding="utf-8")
    with pytest.raises(CaseError, match="case.phases.water.density: 2.0 -> the sweep in out was begun with 1.0"):
        sweep(study(), "out")


# ---- errors of users -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"parameters": {}}, "parameters"),
        ({"metod": "grid"}, "metod.*did you mean method"),
        ({"method": "sobol"}, "needs samples"),
        ({"samples": 4}, "takes no samples"),
        ({"method": "sobol", "samples": 4}, "end_time from a range"),
        ({"parameters": {"end_time": {"from": 1, "to": 2}}}, "number of values of end_time"),
        ({"parameters": {"end_time": {"from": 2, "to": 1, "number": 2}}}, "from below to"),
        ({"parameters": {"end_time": {"from": 0, "to": 1, "number": 2, "spacing": "log"}}}, "above 0"),
        ({"method": "list", "parameters": {"a": [1], "b": [1, 2]}}, "equally many"),
        ({"settings": {"end_time": "{Co}"}, "parameters": {"Ca": [1]}}, "(sweep).*uses {Co}.*write one of Ca"),
        ({"settings": {"gravity": [0, "{Co}"]}, "parameters": {"Ca": [1]}}, "(sweep).*uses {Co}.*write one of Ca"),
        ({"measure": {"steps": ENERGY}}, "two columns with the name steps"),
        ({"measure": {"e": {"gauge": "enery", "column": "x"}}}, "measure.e.gauge: enery.*did you mean energy"),
        ({"measure": {"e": {"reference": "stat"}}}, "measure.e.reference: stat.*did you mean start"),
        ({"measure": {"e": {"gauge": "energy"}}}, "needs a column"),
        ({"parameters": {"end_tim": [1, 2]}}, "end_tim: 1 -> is not a known key; did you mean end_time"),
    ],
)
def test_errors_of_users(changes, said):
    with pytest.raises(CaseError, match=said):
        sweep(study(**changes), "out")
    assert not Path("out").exists()


def test_errors_of_a_file_have_their_line():
    text = "case: scene.yaml\nparameters:\n  end_time: {form: 1, to: 2, number: 2}\n"
    Path("study.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(CaseError, match=r"did you mean from\? \(line 3"):
        sweep("study.yaml", "out")


# ---- Dask ------------------------------------------------------------------------------------------------


def test_a_run_whose_worker_dies_is_made_again(monkeypatch):
    """Two workers; the one that takes the second run is killed in the middle of it, once."""
    monkeypatch.setattr(sweeps, "execute", dies_once)
    plan = study(parameters={"end_time": [0.002, 0.004, 0.006, 0.008]})
    table = sweep(plan, "out", processes=2, threads=1)
    assert [row["status"] for row in table.rows] == ["finished"] * 4
    assert Path("died").exists()
    alone = sweep(plan, "alone", threads=1)
    assert [row["last"] for row in table.rows] == [row["last"] for row in alone.rows]
    assert len(list(Path("out/results").glob("*.json"))) == 4


def dies_once(task):
    """Make a run; the first worker that takes run 1 is killed in it."""
    mark = task.source / "died"
    if task.number == 1 and not mark.exists():
        mark.write_text(str(os.getpid()), encoding="utf-8")
        os.kill(os.getpid(), signal.SIGKILL)
    return execute(task)


def test_a_scheduler_by_its_address(monkeypatch):
    """The workers of a cluster that was there before; nobody is at another address."""
    import distributed

    plan = study(parameters={"end_time": [0.002, 0.004]})
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        table = sweep(plan, "out", scheduler=cluster.scheduler_address, threads=1)
    assert [row["status"] for row in table.rows] == ["finished"] * 2
    monkeypatch.setattr(sweeps, "PATIENCE", 0.5)
    with pytest.raises(CaseError, match="--scheduler.*cannot be reached"):
        sweep(plan, "other", scheduler="tcp://127.0.0.1:9", threads=1)


def test_without_dask_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask", None)
    with pytest.raises(CaseError, match="pip install 'warpsph-simulator\\[dask\\]'"):
        sweep(study(), "out", processes=2)


def test_a_run_that_takes_too_long_is_a_row(monkeypatch):
    """More time and another try: the study may say another time in the same folder, and nothing else."""
    plan = study(parameters={"end_time": [0.002, 900.0]}, wall_time=3.0)
    table = sweep(plan, "out", threads=1)
    assert [row["status"] for row in table.rows] == ["finished", "too slow"]
    assert "wall time" in table.rows[1]["problem"] and table.rows[1]["steps"] > 0
    numbers = made(monkeypatch)
    again = sweep(plan | {"wall_time": 1.0}, "out", threads=1, retry=True)
    assert numbers == [1] and again.rows[1]["status"] == "too slow"


def test_the_stored_rows_are_plain_json():
    sweep(study(), "out")
    row = json.loads(Path("out/results/000000.json").read_text(encoding="utf-8"))
    assert row["run"] == 0 and row["particles"] == 64


# ---- command ---------------------------------------------------------------------------------------------


def test_the_command(capsys):
    Path("study.yaml").write_text(dump_yaml(study(parameters={"end_time": [0.002, -1]})), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        cli.app(["sweep", "study.yaml", "--output", "out", "--no-figures"])
    assert ended.value.code == 6, "a run failed"
    told = capsys.readouterr()
    assert "2 runs, 1 failed" in told.out and "end_time: -1" in told.err
    with pytest.raises(SystemExit) as ended:
        cli.app(["sweep", "study.yaml", "--dry-run"])
    assert ended.value.code == 0 and "0.002" in capsys.readouterr().out


def test_the_command_after_ctrl_c(monkeypatch):
    def stopped(task):
        raise Interrupted("Ctrl-C")

    monkeypatch.setattr(sweeps, "execute", stopped)
    Path("study.yaml").write_text(dump_yaml(study()), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        cli.app(["sweep", "study.yaml", "--output", "out"])
    assert ended.value.code == 130


def test_pictures():
    lines = sweep(study(), "lines")
    assert [path.name for path in draw_sweep(lines)] == ["last.png", "mean.png", "error.png"]
    two = sweep(study(parameters={"end_time": [0.002, 0.004], "phases.water.density": [1, 2]}), "map")
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in draw_sweep(two))
