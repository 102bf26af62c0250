"""The Python interface: load a case, change values, run, look at gauges and state; what a folder tells."""

import json
import shutil
import threading

import numpy as np
import pytest

import warpsph
from tests.scenes import FULL, PERIODIC, case_of
from warpsph import Simulation, load_case, simulation
from warpsph.case.case_file import save_case
from warpsph.errors import CaseError, WarpsphError
from warpsph.files import output
from warpsph.kernels.core import clock as ck
from warpsph.measure.gauge_files import read_gauge
from warpsph.running import preview, recorder
from warpsph.study.comparison import compared


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A finished run with an output folder."""
    folder = tmp_path_factory.mktemp("done") / "run"
    case = case_of(PERIODIC).replace(
        {
            "reference": {
                "decay": {
                    "gauge": "energy",
                    "column": "kinetic",
                    "reduce": "final",
                    "value": 0.1,
                    "allowed": 0.5,
                },
                "late": {
                    "gauge": "energy",
                    "column": "kinetic",
                    "reduce": "mean",
                    "window": [3, 4],
                    "value": 1,
                },
            }
        }
    )
    return Simulation(case, output=folder, threads=1).run()


def test_a_run_folder_can_be_moved(tmp_path, monkeypatch):
    """It has its own copies of the reference files: it goes on, is drawn and run again where nothing else is left."""
    home = tmp_path / "home"
    for name, value in (("one", 0.25), ("other", 0.2)):
        (home / name).mkdir(parents=True)
        (home / name / "decay.csv").write_text(f"t_s,KE\n0,{value}\n1,{value}\n")
    entry = {"gauge": "energy", "column": "kinetic"}
    references = {
        "relative": {**entry, "curve": {"file": "one/decay.csv", "time": "t_s", "value": "KE"}},
        "absolute": {**entry, "curve": {"file": str(home / "other" / "decay.csv"), "time": "t_s", "value": "KE"}},
    }
    save_case(case_of(PERIODIC, reference=references, end_time=0.02), home / "case.yaml")
    first = Simulation(load_case(home / "case.yaml"), output=tmp_path / "run", threads=1).run().summary["errors"]
    moved = tmp_path / "elsewhere" / "moved"
    moved.parent.mkdir()
    (tmp_path / "run").rename(moved)
    shutil.rmtree(home)
    monkeypatch.chdir(moved.parent)

    case = load_case("moved/case.yaml")
    assert str(tmp_path) not in (moved / "case.yaml").read_text()
    assert sorted(path.name for path in (moved / "reference").iterdir()) == ["decay.csv", "decay_2.csv"]
    again = warpsph.run(case, output="again", threads=1).summary["errors"]
    assert {name: found["error"] for name, found in again.items()} == {name: found["error"] for name, found in first.items()}
    longer = warpsph.run(case.replace({"end_time": 0.04}), output="moved", restart="moved", threads=1).summary["errors"]
    assert longer["relative"]["reference"] == 0.25 and longer["absolute"]["reference"] == 0.2
    assert [found.quantity for found in compared(load_case("moved/case.yaml"), moved)] == ["relative", "absolute"]


@pytest.mark.parametrize("kind", ["Case", "Path", "str", "dict"])
def test_a_case_may_be_a_file_or_plain_data(tmp_path, monkeypatch, kind):
    """Reference files of plain data are looked up in the current folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "decay.csv").write_text("t_s,KE\n0,0.25\n1,0.25\n")
    curve = {"file": "decay.csv", "time": "t_s", "value": "KE"}
    references = {"decay": {"gauge": "energy", "column": "kinetic", "curve": curve}}
    data = {**PERIODIC, "end_time": 0.02, "reference": references}
    save_case(warpsph.Case.from_dict(data), "case.yaml")
    case = {"Case": load_case("case.yaml"), "Path": tmp_path / "case.yaml", "str": "case.yaml", "dict": data}[kind]
    before = repr(data)
    result = warpsph.run(case, threads=1)
    assert result.summary["errors"]["decay"]["error"] is not None and result.case.end_time == 0.02
    assert preview.estimate(case)["particles"] == 400
    assert preview.describe(case)["resolved"]["dimension"] == 2
    assert repr(data) == before


def test_load_case_takes_plain_data_with_overrides():
    case = load_case(PERIODIC, ["end_time=0.5", "phases.water.density=2"])
    assert case.end_time == 0.5 and case.phases["water"].density == 2
    assert PERIODIC["end_time"] == 0.2 and PERIODIC["phases"]["water"]["density"] == 1.0


@pytest.mark.parametrize("case", [None, 3, [PERIODIC]])
def test_what_is_no_case_is_refused(case):
    with pytest.raises(CaseError, match="needs a Case, the name of a case file or a mapping"):
        warpsph.run(case)
    with pytest.raises(CaseError, match="there is no such file"):
        warpsph.run("nowhere.yaml")
    with pytest.raises(CaseError, match="end_time: -1"):
        warpsph.run({**PERIODIC, "end_time": -1})


def test_load_replace_run(tmp_path, monkeypatch):
    """Without an output folder nothing is written anywhere."""
    save_case(case_of(PERIODIC), tmp_path / "case.yaml")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(output, "RunFolder", None)
    case = load_case("case.yaml").replace({"end_time": 0.1, "phases.water.viscosity": 0.02})
    result = warpsph.run(case, threads=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case.yaml"]
    energy = result.gauge("energy")
    np.testing.assert_allclose(energy["time"], np.arange(6) * 0.02, rtol=1e-9)
    assert energy["kinetic"][-1] < 0.95 * energy["kinetic"][0]
    state = result.state
    assert state.time == result.model.time == pytest.approx(0.1)
    assert state.position.shape == state.velocity.shape == (400, 2)
    np.testing.assert_array_equal(state.particle_id, np.arange(400))
    with pytest.raises(KeyError, match="no gauge 'heat'"):
        result.gauge("heat")


def test_same_in_memory_and_in_files(done):
    again = Simulation(done.case, threads=1).run()
    for name in done.case.gauges:
        columns, units = read_gauge(done.folder.path / "gauges" / f"{name}.csv")
        for column, values in again.gauge(name).items():
            np.testing.assert_array_equal(values, columns[column])
            assert column in units
    np.testing.assert_array_equal(again.state.position, done.state.position)


def test_runs_in_another_thread():
    """There signals cannot be watched; the run does without."""
    result = []
    case = case_of(PERIODIC, end_time=0.01)
    thread = threading.Thread(target=lambda: result.append(Simulation(case, threads=1).run()))
    thread.start()
    thread.join()
    assert result[0].summary["status"] == "finished"


def test_gauge_while_running(tmp_path, monkeypatch):
    """Rows written by the writer thread are there as soon as the state is."""
    monkeypatch.setattr(simulation, "PORTION", 0.0)
    seen = []
    case = case_of(PERIODIC, end_time=0.1)
    run = Simulation(case, output=tmp_path / "run", threads=1)
    run.run(lambda p: seen.append((p.time, run.gauge("energy")["time"][-1])))
    assert len(seen) > 5
    for now, last in seen:
        assert now - 0.02 * (1 + 1e-9) <= last <= now


def test_progress(monkeypatch):
    monkeypatch.setattr(simulation, "PORTION", 0.0)
    told = []
    result = Simulation(case_of(PERIODIC), threads=1).run(told.append)
    assert [p.step for p in told] == sorted(p.step for p in told)
    last = told[-1]
    assert last.time == pytest.approx(0.2) and last.end_time == 0.2 and last.share == pytest.approx(1)
    assert (
        last.step == result.summary["steps"]
        and last.dt > 0
        and last.seconds_left == pytest.approx(0, abs=1e-6)
    )


def test_second_run_goes_nowhere(done):
    steps = done.model.steps
    with pytest.raises(WarpsphError, match="this run is over"):
        done.run()
    assert done.model.steps == steps


def test_end_reached_within_rounding(monkeypatch):
    """A last step that ends a rounding error short must end the run."""
    run = Simulation(case_of(PERIODIC), threads=1)
    calls = []

    def almost(target, most_steps):
        calls.append(target)
        assert len(calls) < 100
        run.model.stepper.write(clock={ck.TIME: np.nextafter(target, 0.0)})

    monkeypatch.setattr(run.model.stepper, "run", almost)
    run.run()
    assert run.gauge("energy")["time"][-1] == np.nextafter(0.2, 0.0)


def test_unknown_device():
    with pytest.raises(CaseError, match="no such device here; choose from: cpu"):
        Simulation(case_of(PERIODIC), device="cuda:9")


def test_summary(done):
    summary = json.loads((done.folder.path / "summary.json").read_text())
    assert summary["status"] == "finished" and summary["problem"] is None
    assert summary["steps"] == done.model.steps > 0
    assert summary["particles"] == summary["fluid_particles"] + summary["wall_particles"] == 400
    assert summary["time"] == pytest.approx(0.2)
    assert 0 < summary["wall_seconds"] < 60
    assert summary["device"] == "cpu" and summary["precision"] == "float32" and summary["threads"] == 1
    assert {"kick_drift", "continuity", "momentum", "list: list"} <= summary["timings"].keys()
    assert 0 < sum(summary["timings"].values()) <= summary["wall_seconds"]
    assert {"system", "processor", "processors", "python"} <= summary["machine"].keys()
    assert {"warpsph", "warp-lang", "numpy"} <= summary["versions"].keys()
    assert 0 < summary["bytes_per_particle"] <= 228 + 80  # copies of all sorted fields at once, in a scene as small as this
    decay = summary["errors"]["decay"]
    last = read_gauge(done.folder.path / "gauges" / "energy.csv")[0]["kinetic"][-1]
    assert (
        decay["value"] == last
        and decay["reference"] == 0.1
        and decay["error"] == pytest.approx(last / 0.1 - 1)
    )
    assert summary["errors"]["late"]["value"] is None and summary["errors"]["late"]["note"]


def test_log(done):
    lines = (done.folder.path / "log.txt").read_text().splitlines()
    assert lines[0].startswith("warpsph ") and "400 fluid" in lines[0] and "float32" in lines[0]
    shares = [float(line.split("%")[0]) for line in lines if " %: " in line]
    assert 5 <= len(shares) <= 20 and shares == sorted(shares)
    assert any(line.startswith("finished: t = 0.2 s") for line in lines)
    assert any(line.startswith("decay: ") for line in lines)


def test_warnings_reach_the_log(tmp_path):
    case = case_of(PERIODIC, end_time=0.001, phases__water__sound_speed=2.0)
    run = Simulation(case, output=tmp_path / "run", threads=1).run()
    assert any("too low" in line for line in run.summary["warnings"])
    assert "warning: phases.water.sound_speed" in (tmp_path / "run" / "log.txt").read_text()


def test_case_of_the_folder_runs_again(tmp_path):
    """Reference files are found from where the run folder's case stands."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "curve.csv").write_text("t,e\n0,0.2\n1,0.1\n")
    curve = {"file": "curve.csv", "time": "t", "value": "e"}
    changes = {
        "end_time": 0.01,
        "reference": {"decay": {"gauge": "energy", "column": "kinetic", "curve": curve}},
    }
    data = case_of(PERIODIC).to_dict() | changes
    case = warpsph.Case.from_dict(data, tmp_path / "in")
    Simulation(case, output=tmp_path / "run", threads=1).run()
    again = Simulation(load_case(tmp_path / "run" / "case.yaml"), threads=1).run()
    assert again.summary["errors"]["decay"]["value"] is not None


def test_only_due_samples_are_taken(monkeypatch):
    """Interpolation at points is the dearest gauge: it must not be done for the rows of others."""
    calls = []
    original = recorder.sample
    monkeypatch.setattr(recorder, "sample", lambda *a: calls.append(1) or original(*a))
    result = Simulation(case_of(PERIODIC), threads=1).run()
    assert len(calls) == len(result.gauge("probe")["time"]) == 3


def test_normals_follow_their_particles():
    """Ordering the particles anew leaves the written fields and the interface length as they were."""
    run = Simulation(case_of(FULL, end_time=0.1), threads=1).run()
    before, length = run.state, run.model.interface_length()
    run.model.stepper.rebuild()
    after = run.state
    assert np.abs(before.normal).max() > 1
    np.testing.assert_array_equal(after.normal, before.normal)
    np.testing.assert_array_equal(after.curvature, before.curvature)
    np.testing.assert_allclose(after.velocity, before.velocity, rtol=1e-12)
    assert run.model.interface_length() == pytest.approx(length, rel=1e-6)


def test_shapes_are_measured_and_compared_in_the_middle_of_a_run(tmp_path):
    """A square of liquid, and the box from x = 0.25 to 0.75 and y = 0.25 to 0.67 as the reference at half time."""
    (tmp_path / "box.csv").write_text(
        "x1,y1,x2,y2\n0.25,0.25,0.75,0.25\n0.75,0.25,0.75,0.67\n0.75,0.67,0.25,0.67\n0.25,0.67,0.25,0.25\n"
    )
    line = {"file": str(tmp_path / "box.csv"), "time": 0.01}
    case = case_of(FULL).replace(
        {
            "end_time": 0.02,
            "output.particles": {"interval": 0.01, "fields": ["phase", "volume"]},
            "gauges": {
                "surface": {"type": "contour", "interval": 0.01, "mirror": "x"},
                "rise": {"type": "phase_velocity", "interval": 0.01},
                "strays": {"type": "strays", "interval": 0.01},
            },
            "reference": {"shape": {"phase": "liquid", "interface": line, "relative_to": "phase", "allowed": 0.1}},
        }
    )
    run = Simulation(case, output=tmp_path / "run", threads=1).run()
    found = run.summary["errors"]["shape"]
    # one row of eight stands above the box, which holds 8 x 7 particles
    assert found["error"] == pytest.approx(8 / 56, rel=0.05)
    assert found["passed"] is False
    assert found["note"] == "of the area of liquid at t = 0.01 s; 0 % of it where liquid should be"
    surface = run.gauge("surface")
    assert surface["perimeter liquid"][0] == pytest.approx(1.8, abs=0.1)  # 2 with its corners
    assert surface["lowest_x liquid"][-1] == pytest.approx(0.25, abs=0.02)
    assert surface["asymmetry liquid"].max() < 0.01
    assert run.gauge("strays")["liquid"].max() == 0
    assert run.gauge("rise")["velocity_y liquid"][-1] < 0
    alone = Simulation(case, threads=1).run().summary["errors"]["shape"]
    assert (alone["error"], alone["note"]) == (None, "there is no particle file of t = 0.01 s")


def test_kernels_are_counted_while_they_are_made_ready():
    counts = []
    run = Simulation(case_of(PERIODIC, end_time=0.01), threads=1, preparing=counts.append)
    assert counts == list(range(len(counts))) and len(counts) > 10
    run.close()
