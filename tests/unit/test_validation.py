"""Validation: which runs it makes, the table it writes, what it does when something goes wrong, and its figures."""

import copy
import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.scenes import PERIODIC
from warpsph import cli
from warpsph.case.case import Case
from warpsph.case.case_file import dump_yaml
from warpsph.cli import validate_command
from warpsph.errors import CaseError
from warpsph.simulation import Simulation
from warpsph.study import curl, figures, validation
from warpsph.study.comparison import compared

PNG = b"\x89PNG\r\n\x1a\n"
START = 0.25  # kinetic energy of the vortices, J/m

REFERENCE = {
    "start": {"gauge": "energy", "column": "kinetic", "reduce": "max", "value": START, "allowed": 0.05},
    "decay": {
        "gauge": "energy",
        "column": "kinetic",
        "curve": {"file": "decay.csv", "time": "t", "value": "E"},
        "norm": "final",
        "allowed": 0.1,
    },
    "pressure": {"gauge": "probe", "column": "pressure", "reduce": "final", "value": 0},
    "speed": {
        "particles": "last",
        "field": "speed",
        "exact": "exp(-0.08*pi**2*t)*hypot(cos(2*pi*x)*sin(2*pi*y), sin(2*pi*x)*cos(2*pi*y))",
        "allowed": 0.2,
    },
}
RUNS = {
    "quick": [{"name": "20"}, {"name": "1/16", "changes": {"particle_spacing": "1/16"}}],
    "seed": [{"name": "strict", "changes": {"reference.start.allowed": 1e-9, "reference.decay": None}}],
    "figure": {"field": "vorticity", "times": [0, 0.05]},
}


def scene(**changes):
    """The vortices of 5 ms with references, as plain data."""
    data = copy.deepcopy(PERIODIC) | {"end_time": 0.05, "reference": REFERENCE, "validation": RUNS}
    del data["gauges"]["probe"]["interval"]
    data["gauges"]["probe"]["times"] = [0.0, 0.05]
    data["output"] = {"particles": {"interval": 0.05}}
    return data | changes


@pytest.fixture
def cases(tmp_path):
    """A folder with the cases `vortices` and `plain`, the second one without a validation section."""
    folder = tmp_path / "cases"
    folder.mkdir()
    times = np.linspace(0, 1, 101)
    rows = "".join(f"{t},{START * np.exp(-0.16 * np.pi**2 * t)}\n" for t in times)
    (folder / "decay.csv").write_text("t,E\n" + rows)
    (folder / "vortices.yaml").write_text(dump_yaml(scene()))
    plain = scene()
    del plain["validation"], plain["reference"]
    (folder / "plain.yaml").write_text(dump_yaml(plain))
    return folder


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Run a command line in the folder of the test; gives exit code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["warpsph", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        out, err = capsys.readouterr()
        return stopped.value.code or 0, out, err

    return run


def names(runs):
    return [run.name for run in runs]


# ---- which runs ------------------------------------------------------------------------------------------


def test_plan_takes_all_cases_of_a_level_in_order(cases):
    assert names(validation.plan("quick", places=[cases])) == ["plain-default", "vortices-20", "vortices-1_16"]
    (run,) = validation.plan("seed", places=[cases])
    assert (run.case_name, run.run.name, run.level) == ("vortices", "strict", "seed")
    assert run.case.reference["start"].allowed == 1e-9 and "decay" not in run.case.reference
    # of the section only what the figure needs stays in the case of the run
    assert list(run.case.to_dict()["validation"]) == ["figure"]


@pytest.mark.parametrize(
    "wanted, found",
    [
        (["vort*"], ["vortices-20", "vortices-1_16"]),
        (["vortices-1_16"], ["vortices-1_16"]),
        (["vortices-2?", "plain"], ["plain-default", "vortices-20"]),
        (["*-default"], ["plain-default"]),
        (["plain", "pl*"], ["plain-default"]),
    ],
)
def test_plan_selects_by_name(cases, wanted, found):
    assert names(validation.plan("quick", wanted, [cases])) == found


def test_plan_takes_files_and_changes_the_precision(cases):
    (run,) = validation.plan("quick", places=[cases / "plain.yaml"], precision="float64")
    assert run.name == "plain-default" and run.case.precision == "float64"


def test_an_unknown_name_lists_the_known_ones(cases):
    with pytest.raises(CaseError) as caught:
        validation.plan("quick", ["droplet", "plain", "vortices-7"], [cases])
    text = str(caught.value)
    assert "NAME: droplet -> there is no such case; write one of plain, vortices" in text
    there = "there are 20 (quick), 1_16 (quick), strict (seed)"
    assert f"NAME: vortices-7 -> has no such run at the level quick; {there}" in text
    assert len(caught.value.problems) == 2


def test_a_named_case_without_runs_at_the_level_is_an_error(cases):
    with pytest.raises(CaseError, match="plain -> has no such run at the level seed; there are default"):
        validation.plan("seed", ["plain"], [cases])
    with pytest.raises(CaseError, match="no case has runs at this level"):
        validation.plan("fine", places=[cases])


def test_cases_that_cannot_be_found(cases, tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(CaseError) as caught:
        validation.find_cases([cases, tmp_path / "empty", tmp_path / "nothing", cases / "plain.yaml"])
    text = str(caught.value)
    assert "holds no *.yaml files" in text and "no such file or folder" in text and "has the same name" in text


def test_every_bad_change_is_named_in_the_words_of_the_file(cases):
    runs = [
        {"name": "a", "changes": {"phases.watr.viscosity": 1}},
        {"name": "b", "changes": {"particle_spacing": -1, "reference.decy.allowed": 0.1}},
        {"name": "c", "changes": {"gauges.energy": None}},
    ]
    (cases / "vortices.yaml").write_text(dump_yaml(scene(validation={"quick": runs})))
    with pytest.raises(CaseError) as caught:
        validation.plan("quick", ["vortices"], [cases])
    text = str(caught.value)
    place = "vortices.yaml: validation.quick."
    assert f"{place}0.changes.phases.watr.viscosity: 1 -> phases.watr then is the phase of no fluid" in text
    assert f"{place}0.changes: (missing) -> phases.watr.density then is required" in text
    assert f"{place}1.changes.particle_spacing: -1 -> needs a number > 0" in text
    assert f"{place}1.changes.reference.decy.allowed: 0.1 -> reference.decy then needs exactly one of" in text
    assert f"{place}2.changes: energy -> reference.start.gauge then is not one of the gauges" in text


def test_check_also_checks_the_validation_runs(cases, command):
    runs = {"fine": [{"name": "a", "changes": {"particle_spacing": "x"}}]}
    (cases / "vortices.yaml").write_text(dump_yaml(scene(validation=runs)))
    code, _, err = command("check", cases / "vortices.yaml")
    assert code == 2 and "validation.fine.0.changes.particle_spacing: x -> needs a number > 0" in err
    # runs are changes of the file: what --set takes out of a case need not suit them
    code, _, err = command("check", cases / "vortices.yaml", "--set", "title=another")
    assert code == 0, err


# ---- the table -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folder and table of the quick runs, drawn, and what was told of them."""
    folder = tmp_path_factory.mktemp("finished")
    cases = folder / "cases"
    cases.mkdir()
    times = np.linspace(0, 1, 101)
    rows = "".join(f"{t},{START * np.exp(-0.16 * np.pi**2 * t)}\n" for t in times)
    (cases / "decay.csv").write_text("t,E\n" + rows)
    (cases / "vortices.yaml").write_text(dump_yaml(scene()))
    runs = validation.plan("quick", places=[cases])
    told = []
    output = folder / "output"
    table = validation.validate(runs, output, threads=1, command="the command", finished=told.append)
    return output, table, told


def test_table_holds_what_the_runs_say(finished):
    folder, table, told = finished
    assert [(row["run"], row["quantity"], row["outcome"]) for row in table.rows] == [
        (run, quantity, outcome)
        for run in ("20", "1/16")
        for quantity, outcome in (("start", "ok"), ("decay", "ok"), ("pressure", "no limit"), ("speed", "ok"))
    ]
    assert table.exit_code == 0 and not table.bad and table.notes == []
    summary = json.loads((folder / "runs" / "vortices-1_16" / "summary.json").read_text())
    row = table.rows[4]
    assert row["value"] == pytest.approx(summary["errors"]["start"]["value"])
    assert (row["particles"], row["steps"]) == (256, summary["steps"])
    assert row["seconds"] == pytest.approx(summary["wall_seconds"])
    assert [entry["run"] for entry in told] == ["20", "1/16"] and told[1]["changes"] == {"particle_spacing": "1/16"}


def test_table_files(finished):
    folder, table, _ = finished
    data = json.loads((folder / "table.json").read_text())
    assert data["command"] == "the command" and data["level"] == "quick" and data["device"] == "cpu"
    assert data["threads"] == 1 and data["processor"] and data["device_name"] and data["interrupted"] is False
    assert data["versions"]["warp-lang"] and data["runs"][1]["folder"] == "runs/vortices-1_16"
    assert data["rows"][0]["precision"] == "float32"
    lines = (folder / "table.md").read_text().splitlines()
    assert len(lines) == 2 + 8
    heading = [cell.strip() for cell in lines[0].strip("|").split("|")]
    assert heading == list(validation.COLUMNS)
    cells = [cell.strip() for cell in lines[2].strip("|").split("|")]
    assert cells[:3] == ["vortices", "20", "start [J/m]"] and cells[7:9] == ["ok", "400"]
    assert float(cells[3]) == pytest.approx(table.rows[0]["value"], rel=1e-4) and cells[6] == "5 %"
    # what belongs to the run stands in its first row alone
    assert [cell.strip() for cell in lines[3].strip("|").split("|")][:3] == ["", "", "decay [J/m]"]
    again = validation.Table.read(folder)
    assert again.rows == json.loads(json.dumps(table.rows)) and again.markdown() == table.markdown()


def test_absolute_errors_are_no_shares():
    row = {"quantity": "p", "value": 0.5, "reference": 0.0, "error": 0.5, "allowed": 0.7, "outcome": "ok", "unit": "Pa"}
    row |= {"case": "a", "run": "b", "particles": 1, "steps": 12_345, "seconds": 1234.5}
    assert validation.cells(row | {"absolute": True})[5:7] == ["0.5", "0.7"]
    cells = validation.cells(row | {"absolute": False})
    assert cells[5:7] == ["50 %", "70 %"] and cells[9:] == ["12 345", "1234"]


@pytest.mark.parametrize(
    "error, allowed, outcome",
    [
        (0.1, 0.2, "ok"),
        (-0.3, 0.2, "missed"),
        (None, 0.2, "missed"),
        (float("nan"), 0.2, "missed"),
        (0.1, None, "no limit"),
        (None, None, "no value"),
    ],
)
def test_outcomes(error, allowed, outcome):
    entry = {"value": 1, "reference": 1, "error": error, "allowed": allowed, "unit": "", "note": "", "source": None}
    (row,) = validation.rows_of({"x": entry})
    assert row["outcome"] == outcome


def test_a_case_without_references_is_told(cases, tmp_path):
    table = validation.validate(validation.plan("quick", ["plain"], [cases]), tmp_path / "out", draw=False)
    assert [row["outcome"] for row in table.rows] == ["no reference"] and table.exit_code == 0


# ---- when something goes wrong ---------------------------------------------------------------------------


def test_a_missed_reference_gives_the_exit_code(cases, command):
    code, out, err = command("validate", "--cases", cases, "--level", "seed", "--no-figures", "--threads", 1)
    assert code == validation.MISSED == 6, err
    (line,) = [line for line in out.splitlines() if " start " in line]
    assert "missed" in line and "strict" in line
    assert "1 of 2 results with a limit within it" in out
    data = json.loads(Path("validation/seed-cpu/table.json").read_text())
    assert [row["outcome"] for row in data["rows"]] == ["missed", "no limit", "ok"]
    assert data["command"].startswith("python -m warpsph validate --cases ")


def test_a_run_that_fails_is_a_row_and_stops_no_other(cases, tmp_path, monkeypatch):
    runs = [
        # a sound speed far below the velocity: it diverges
        {"name": "diverges", "changes": {"phases.water.sound_speed": 0.01, "end_time": 2}},
        {"name": "breaks"},
        {"name": "fine"},
    ]
    (cases / "vortices.yaml").write_text(dump_yaml(scene(validation={"quick": runs})))
    run = Simulation.run

    def break_second(simulation, **options):
        if simulation.folder.path.name == "vortices-breaks":
            raise RuntimeError("out of luck")
        return run(simulation, **options)

    monkeypatch.setattr(Simulation, "run", break_second)
    table = validation.validate(validation.plan("quick", ["vortices"], [cases]), tmp_path / "out", draw=False)
    outcomes = [[row["outcome"] for row in entry["rows"]] for entry in table.runs]
    assert outcomes == [["diverged"], ["failed"], ["ok", "ok", "no limit", "ok"]]
    assert table.exit_code == validation.MISSED
    lines = validation.problem_lines(table)
    assert "vortices diverges: diverged: the run diverged at t = " in lines[0]
    assert lines[1] == "vortices breaks: failed: RuntimeError: out of luck"
    assert "out of luck" in (tmp_path / "out" / "runs" / "vortices-breaks" / "traceback.txt").read_text()
    assert "diverged" in (tmp_path / "out" / "table.md").read_text()


def test_ctrl_c_keeps_what_is_done_and_continue_does_the_rest(cases, command, monkeypatch):
    began = []

    def interrupt_second(run, number, count):
        began.append(run.name)
        if len(began) == 2:
            raise KeyboardInterrupt
        return progress(run, number, count)

    progress = validate_command._validation_progress
    monkeypatch.setattr(validate_command, "_validation_progress", interrupt_second)
    options = ("--cases", cases, "--no-figures", "--threads", 1, "--output", "out")
    code, out, _ = command("validate", "vortices", *options)
    assert code == 130 and "1 runs" in out and "(interrupted)" in out
    data = json.loads(Path("out/table.json").read_text())
    assert data["interrupted"] is True and [run["run"] for run in data["runs"]] == ["20"]

    code, _, err = command("validate", "vortices", *options)
    assert code == 2 and "folder in use" in err
    code, _, err = command("validate", "vortices", *options, "--continue", "--level", "seed")
    assert code == 2 and "the folder was made with quick" in err
    code, out, _ = command("validate", "vortices", *options, "--continue")
    assert code == 0 and began == ["vortices-20", "vortices-1_16", "vortices-1_16"]
    assert [run["run"] for run in json.loads(Path("out/table.json").read_text())["runs"]] == ["20", "1/16"]


def test_options_that_contradict_are_told_at_once(cases, command):
    code, _, err = command("validate", "drop", "--cases", cases, "--device", "cuda:9", "--continue")
    assert code == 2
    assert "no such case" in err and "--device: cuda:9" in err and "--continue" in err


def test_dry_run_lists_and_computes_nothing(cases, command, tmp_path):
    code, out, _ = command("validate", "--cases", cases, "--dry-run")
    assert code == 0 and "particle_spacing 1/16" in out and "default" in out
    assert not (tmp_path / "validation").exists()


# ---- figures ---------------------------------------------------------------------------------------------


def test_a_figure_of_each_run(finished):
    folder, _, _ = finished
    for name in ("vortices-20.png", "vortices-1_16.png"):
        assert (folder / name).read_bytes().startswith(PNG)


def test_without_matplotlib_the_figures_wait(cases, command, monkeypatch):
    monkeypatch.setattr(figures, "can_draw", lambda: False)
    code, _, err = command("validate", "vortices-20", "--cases", cases, "--threads", 1, "--output", "out")
    assert code == 0 and "matplotlib is not installed: no figures" in err and "--figures-from out" in err
    assert not list(Path("out").glob("*.png"))
    assert command("validate", "--figures-from", "out")[0] == 2


def test_figures_are_drawn_later_with_reference_files_from_elsewhere(cases, command, tmp_path):
    options = ("--cases", cases, "--threads", 1, "--output", tmp_path / "out")
    assert command("validate", "vortices-20", *options, "--no-figures")[0] == 0
    assert not (tmp_path / "out" / "vortices-20.png").exists()
    # a run folder that lacks its files, as those of earlier versions do on another machine
    shutil.rmtree(tmp_path / "out" / "runs" / "vortices-20" / "reference")
    (cases / "reference").mkdir()
    (cases / "decay.csv").rename(cases / "reference" / "decay.csv")
    code, out, err = command("validate", "--figures-from", tmp_path / "out")
    assert code == 1 and "no figure of vortices 20: reference.decay.curve.file" in err
    code, out, err = command("validate", "--figures-from", tmp_path / "out", "--cases", cases)
    assert code == 0 and out.strip().endswith("vortices-20.png"), err
    assert (tmp_path / "out" / "vortices-20.png").read_bytes().startswith(PNG)


def test_run_folders_can_be_dropped(cases, tmp_path):
    runs = validation.plan("quick", ["vortices-20"], [cases])
    validation.validate(runs, tmp_path / "out", threads=1, keep=False)
    assert (tmp_path / "out" / "vortices-20.png").exists() and not (tmp_path / "out" / "runs" / "vortices-20").exists()


def test_a_figure_shows_particles_and_curves_over_their_references(finished, monkeypatch):
    from matplotlib.figure import Figure

    saved = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **_: (saved.append(figure), path.write_bytes(b"")))
    folder = finished[0] / "runs" / "vortices-20"
    case = figures.case_of_run(folder)
    figures.draw_validation(folder, case, "a title", folder / "figure.png")
    (figure,) = saved
    above, below = figure.subfigs
    pictures = [axes for axes in above.axes if axes.get_title()]
    assert [axes.get_title() for axes in pictures] == ["t = 0 s", "t = 0.05 s"]
    assert len(pictures[0].collections[-1].get_offsets()) == 400
    assert above.axes[-1].get_ylabel() == "vorticity [1/s]"
    panels = {axes.get_title().split(":")[0]: axes for axes in below.axes}
    assert set(panels) == {"start", "decay", "pressure", "speed"}
    assert "(allowed 10 %)" in panels["decay"].get_title()
    run, reference = panels["decay"].lines
    # no more of it than the run reached
    assert reference.get_xdata()[-1] == pytest.approx(run.get_xdata()[-1]) and run.get_xdata()[-1] <= 0.05
    assert reference.get_ydata()[0] == pytest.approx(START) and run.get_ydata()[0] == pytest.approx(START, rel=0.05)
    assert list(panels["start"].lines[1].get_ydata()) == [START, START]
    points = panels["speed"].lines[0]
    assert len(points.get_xdata()) == 400
    assert np.abs(points.get_ydata() - points.get_xdata()).mean() < 0.1


def test_a_figure_shows_a_run_that_ended_early_as_far_as_it_came(finished, monkeypatch, tmp_path):
    from matplotlib.figure import Figure

    saved = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **_: (saved.append(figure), path.write_bytes(b"")))
    folder = finished[0] / "runs" / "vortices-20"
    case = figures.case_of_run(folder).replace({"validation.figure.times": [0, 7.5]})
    figures.draw_validation(folder, case, "", tmp_path / "figure.png")
    pictures = [axes for axes in saved[0].subfigs[0].axes if axes.get_title()]
    assert [axes.get_title() for axes in pictures] == ["t = 0 s", "t = 0.05 s"]


def test_a_figure_leaves_out_what_is_none_of_its_phases(finished, monkeypatch, tmp_path):
    """The pressure of one phase of two: no particle of the other, and the same part of the scene."""
    from matplotlib.figure import Figure

    from warpsph.study import plot

    saved = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **_: (saved.append(figure), path.write_bytes(b"")))
    read = plot.read_frame

    def two_phases(*arguments):
        frame = read(*arguments)
        frame.fluid.phase = (frame.fluid.position[:, 0] > 0.5).astype(np.int32)
        return frame

    monkeypatch.setattr(plot, "read_frame", two_phases)
    folder = finished[0] / "runs" / "vortices-20"
    names = figures.case_of_run(folder).phase_names
    case = figures.case_of_run(folder).replace({"validation.figure": {"field": "pressure", "phases": names}})
    figures.draw_validation(folder, case, "", tmp_path / "figure.png")
    for axes in [axes for axes in saved[0].subfigs[0].axes if axes.get_title()]:
        offsets = axes.collections[-1].get_offsets()
        assert 150 < len(offsets) < 250 and offsets[:, 0].max() <= 0.5
        assert axes.get_xlim()[1] > 0.9


def test_data_of_curves_and_of_what_cannot_be_read(finished):
    folder = finished[0] / "runs" / "vortices-20"
    case = figures.case_of_run(folder)
    kinds = {entry.quantity: entry.kind for entry in compared(case, folder)}
    assert kinds == {"start": "value", "decay": "curve", "pressure": "value", "speed": "exact"}
    fields = [*case.gauges["probe"].fields, "density"]  # which the file of that run does not have
    other = case.replace({"gauges.probe.fields": fields, "reference.pressure.column": "density"})
    assert [entry.quantity for entry in compared(other, folder)] == ["start", "decay", "speed"]


def test_reference_interface_is_drawn_over_its_time(finished, tmp_path, monkeypatch):
    from warpsph.study import plot

    drawn = []
    monkeypatch.setattr(plot, "draw_segments", lambda panel, segments: drawn.append((panel.get_title(), segments)))
    folder = finished[0] / "runs" / "vortices-20"
    (tmp_path / "line.csv").write_text("x1,y1,x2,y2\n0,1,1,1\n")
    line = {"phase": "water", "interface": {"file": str(tmp_path / "line.csv"), "time": 0.05, "scale": 0.5}}
    case = figures.case_of_run(folder).replace({"reference.line": line})
    figures.draw_validation(folder, case, "", tmp_path / "figure.png")
    ((_, segments),) = drawn
    assert segments.tolist() == [[[0.0, 0.5], [0.5, 0.5]]]


def test_vorticity_of_a_rigid_rotation_and_of_a_shear():
    rng = np.random.default_rng(1)
    x = rng.uniform(0, 1, (300, 2))
    rotation = 3.0 * np.stack([-x[:, 1], x[:, 0]], axis=1)
    assert curl.vorticity(x, rotation, 1.0) == pytest.approx(np.full(300, 6.0), abs=1e-9)
    shear = np.stack([2.0 * x[:, 1], np.zeros(300)], axis=1)
    assert curl.vorticity(x, shear, 1.0) == pytest.approx(np.full(300, -2.0), abs=1e-9)
    # two blobs far apart do not see each other; a particle alone has no value
    apart = np.concatenate([x, x + 10.0, [[30.0, 30.0]]])
    still = np.concatenate([rotation, np.zeros((301, 2))])
    found = curl.vorticity(apart, still, 1.0)
    assert found[:300] == pytest.approx(np.full(300, 6.0), abs=1e-9) and not found[300:600].any()
    assert np.isnan(found[600])


def test_spray_outside_of_the_domain_does_not_shrink_the_picture(finished):
    from warpsph.study import plot

    folder = finished[0] / "runs" / "vortices-20"
    frame = plot.read_frame(*(series := plot.read_series(folder)), series[0].frames[0])
    assert frame.wall is None
    frame.fluid.position[7] = 0.5, 40.0, 0.0
    lower, upper = figures._corners([frame], figures.case_of_run(folder))
    assert upper[1] == 1.0 and 0.9 < upper[0] <= 1.0 and 0.0 <= lower[0] < 0.1 and upper[2] == 0.0


@pytest.mark.parametrize(
    "reduce, window, seen",
    [
        ("mean", (0.2, 0.6), ([0.2, 0.6], [0.5, 0.5])),
        ("final", None, ([0.9, 1.0], [0.5, 0.5])),
        ("peak_time", None, ([0.5, 0.5], [0, 1])),
        ("period", None, None),
        ("noise", None, None),
    ],
)
def test_reference_of_a_value_is_drawn_where_it_counts(reduce, window, seen):
    from matplotlib.figure import Figure

    from warpsph.study.comparison import Compared

    times = np.linspace(0, 1, 11)
    entry = Compared("x", "g", "c", "m", "value", {0.0: (times, times)}, value=0.5, window=window, reduce=reduce)
    panel = Figure().subplots()
    figures._draw_value(panel, [entry], {"x": {"allowed": 0.1, "note": ""}})
    references = panel.lines[1:]
    assert len(references) == (0 if seen is None else 1)
    if seen is not None:
        assert np.asarray(references[0].get_data()) == pytest.approx(np.array(seen))
    bands = [band.get_datalim(panel.transData).get_points() for band in panel.collections]
    assert len(bands) == (reduce in ("mean", "final"))
    if bands:
        assert bands[0][:, 1] == pytest.approx([0.45, 0.55])


def test_a_long_label_takes_several_lines():
    from warpsph.study.comparison import Compared

    label = "highest_x gas - lowest_x gas + highest_y gas - lowest_y gas"
    text = figures._axis(Compared("x", "g", label, "m", "value", {}))
    assert " ".join(text.split("\n")) == "highest x gas - lowest x gas + highest y gas - lowest y gas [m]"
    assert max(map(len, text.split("\n"))) <= 34
    assert figures._axis(Compared("x", "g", "gas - liquid", "Pa", "value", {})) == "gas - liquid [Pa]"


def test_pictures_are_arranged_to_fit():
    for count in range(1, 9):
        for aspect in (0.2, 0.5, 1.0, 2.0, 5.0):
            columns, width = figures._arrange(count, aspect)
            rows = -(-count // columns)
            assert columns <= count and columns * width <= figures.WIDTH
            assert rows * width * aspect <= figures._HIGHEST + 1e-9


def test_case_of_a_run_needs_a_run_folder(tmp_path):
    with pytest.raises(CaseError, match="case.yaml.*cannot be read"):
        figures.case_of_run(tmp_path)
    with pytest.raises(CaseError, match="no readable table.json"):
        validation.Table.read(tmp_path)


def test_shipped_cases_are_found():
    assert {"square_droplet", "taylor_green"} <= set(validation.find_cases())
    assert isinstance(validation.plan("quick", ["taylor_green-50"])[0].case, Case)
