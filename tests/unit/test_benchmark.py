"""Benchmarks: plans, fronts, rows and pictures, what goes on where it stopped, failures, advice, and what is shipped."""

import copy
import json
import math
from pathlib import Path

import pytest

from tests.scenes import LEAN
from warpsph import cli
from warpsph.case.case import Case
from warpsph.case.case_file import dump_yaml, load_case
from warpsph.cli.arguments import error_of
from warpsph.cli.benchmark_command import read_peers
from warpsph.errors import CaseError
from warpsph.simulation import Simulation
from warpsph.study import sweep as sweeps
from warpsph.study.benchmark import benchmark, read_benchmark
from warpsph.study.benchmark_advice import advise, features, identity, length, nearest, stored_fronts
from warpsph.study.benchmark_pictures import comparable, draw_case
from warpsph.study.benchmark_plan import LEVELS, find_plans, load_plan, planned
from warpsph.study.fronts import NOISE, beats, distances, front, most_accurate, quickest, quickest_for_sure, seconds_of, sure
from warpsph.study.sweep import execute

ROOT = Path(__file__).resolve().parents[2]


def row(seconds, error, choice="default", spacing=0.1, **others):
    return {"case": "scene", "choice": choice, "particle_spacing": spacing, "seconds": seconds, "error": error} | others


def scene(**changes):
    """64 particles and a few steps."""
    data = copy.deepcopy(LEAN) | {"particle_spacing": 1 / 8, "end_time": 0.01}
    data["output"] = {"particles": "none", "checkpoint": "none"}
    data["gauges"] = {"energy": {"type": "energy", "interval": 0.002}}
    data["reference"] = {"start": {"gauge": "energy", "column": "kinetic", "reduce": "max", "value": 0.25}}
    return data | changes


def plan(**changes):
    return {
        "case": "../scene.yaml",
        "says": "a scene",
        "errors": {"start": "start"},
        "error": "abs(start)",
        "error_name": "error of the energy",
        "peer_errors": ["start"],
        "choices": {"default": {}, "h 1.3": {"numerics.smoothing_ratio": 1.3}, "broken": {"start.velocity": [1e30, 0]}},
        "quick": {"particle_spacing": ["1/8", "1/10"], "choices": ["default", "h 1.3"]},
        "fine": {"particle_spacing": ["1/16"], "choices": ["default"]},
        "full": {"particle_spacing": ["1/8"], "choices": ["default", "broken"]},
    } | changes


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a case and, in plans/, its plan."""
    (tmp_path / "plans").mkdir()
    (tmp_path / "scene.yaml").write_text(dump_yaml(scene()), encoding="utf-8")
    (tmp_path / "plans" / "scene.yaml").write_text(dump_yaml(plan()), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


# ---- fronts ----------------------------------------------------------------------------------------------


def test_the_front_is_what_nobody_beats():
    rows = [row(1, 0.1), row(2, 0.05), row(2.5, 0.06), row(4, 0.01), row(0.5, 0.2), row(5, 0.01), row(4.5, 0.3)]
    assert front(rows) == [rows[4], rows[0], rows[1], rows[3]]


def test_equal_points_are_both_on_the_front_and_a_tie_in_one_is_decided_by_the_other():
    twins = [row(1, 0.1, "a"), row(1, 0.1, "b")]
    assert front(twins) == twins
    assert front([row(1, 0.1), row(1, 0.2), row(2, 0.1)]) == [row(1, 0.1)]
    assert beats(row(1, 0.1), row(1, 0.2)) and not beats(row(1, 0.1), row(1, 0.1))


def test_failures_and_missing_numbers_take_no_part():
    good = row(2, 0.1)
    bad = [row(1, None), row(1, math.nan), row(None, 0.01), row(1, 0.01, status="diverged"), row(math.inf, 0.01)]
    assert front([*bad, good]) == [good] and quickest([*bad, good], 1) == good == most_accurate([*bad, good])
    assert front(bad) == [] and quickest(bad, 1) is None and most_accurate(bad) is None


def test_a_coarse_run_that_is_accurate_by_accident_is_not_taken():
    rows = [row(1, 0.01, spacing=0.1), row(2, 0.06, spacing=0.05), row(4, 0.02, spacing=0.025), row(9, 0.02, "other")]
    assert quickest(rows, 0.03) == rows[0] and quickest_for_sure(rows, 0.03) == rows[2]
    assert quickest_for_sure(rows, 0.07) == rows[0] and quickest_for_sure(rows, 0.015) is None
    assert sure(rows, 0.03) == [rows[2], rows[3]]
    assert quickest_for_sure([rows[0], rows[1] | {"status": "diverged"}], 0.03) == rows[0]


def test_the_default_form_is_not_left_for_what_takes_as_long():
    rows = [row(1.05, 0.01), row(1.0, 0.01, "other"), row(0.9, 0.01, "third")]
    assert quickest_for_sure(rows[:2], 0.02) == rows[0] and quickest_for_sure(rows, 0.02) == rows[2]


def test_on_one_thread_other_work_on_the_machine_does_not_count():
    busy = row(4, 0.1, cpu_seconds=3)
    assert seconds_of(busy, True) == 3 and seconds_of(busy, False) == 4
    assert seconds_of(row(4, 0.1, cpu_seconds=None), True) == 4 and seconds_of(row(None, 0.1, cpu_seconds=3), True) is None


def test_how_far_the_default_is_from_the_front():
    rows = [row(4, 0.1), row(1, 0.05, "other"), row(8, 0.01, spacing=0.05), row(1, 0.1, spacing=0.2, status="failed")]
    first, second = distances(rows)
    assert (first.row, first.better, first.factor) == (rows[0], rows[1], 4.0)
    assert (second.row, second.better, second.factor) == (rows[2], rows[2], 1.0)
    assert quickest(rows, 0.05) == rows[1] and quickest(rows, 0.005) is None


# ---- plans -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", find_plans())
def test_every_run_of_a_shipped_plan_is_a_valid_case(name, level):
    found = planned(name, find_plans()[name], level)
    assert found.sweep.variants and next(iter(found.sweep.variants)) == "default"
    spacings = found.sweep.parameters["particle_spacing"].values
    assert list(spacings) == sorted(spacings, reverse=True) and len(spacings) > 1


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"choices": {"h 2": {}, "default": {}}}, "`default: {}` as the first choice"),
        ({"choices": {"default": {"end_time": 1}}}, "`default: {}` as the first choice"),
        ({"error": "abs(stat)"}, "cannot be computed"),
        ({"quick": {"particle_spacing": [1], "choices": ["h2"]}}, "names h2 at the level quick, which is no choice"),
        ({"errors": {"start": "begin"}}, "the case has no such reference"),
        ({"settings": {"phases.oil.density": 1}}, "choices.default at 0.125: phases"),
    ],
)
def test_wrong_plans_are_refused(here, changes, complaint):
    path = here / "plans" / "scene.yaml"
    path.write_text(dump_yaml(plan(**changes)), encoding="utf-8")
    with pytest.raises(CaseError, match=complaint.replace("(", "\\(")):
        planned("scene", path, "quick")


def test_an_error_needs_all_its_parts(here):
    path = here / "plans" / "scene.yaml"
    path.write_text(dump_yaml(plan(errors={"a": "start", "b": "start"}, error="maximum(a, -2*b)")), encoding="utf-8")
    found = load_plan(path)
    assert found.judged({"a": 0.1, "b": -0.2}) == 0.4
    assert found.judged({"a": -0.3, "b": 1.0}) == 0.3
    assert found.judged({"a": 0.1, "b": None}) is None and found.judged({"a": math.nan, "b": 0.1}) is None


def test_unknown_benchmarks_and_levels_are_refused(here):
    with pytest.raises(CaseError, match="there is no such benchmark"):
        find_plans(["scen"], here / "plans")
    with pytest.raises(CaseError, match="holds no"):
        find_plans(folder=here / "nothing")
    with pytest.raises(CaseError, match="there is no such level"):
        benchmark("out", level="slow", plans=here / "plans")


# ---- runs ------------------------------------------------------------------------------------------------


def test_a_small_benchmark_and_going_on(here, monkeypatch, capsys):
    made = []
    monkeypatch.setattr(sweeps, "execute", lambda task: made.append(task.number) or execute(task))
    peers = {"rows": [row(0.01, 0.5, error_name="start", peer="SomeSPH", particles=64, version="1", command="run")]}
    Path("peers.json").write_text(json.dumps(peers), encoding="utf-8")
    call = ["benchmark", "scene", "--plans", "plans", "--output", "out", "--json", "front.json", "--peers", "peers.json"]
    monkeypatch.setattr("sys.argv", ["warpsph", *call])  # the command that is kept
    with pytest.raises(SystemExit) as stop:
        cli.app(call)
    assert stop.value.code == 0 and made == [0, 1, 2, 3]
    out = capsys.readouterr().out
    assert "front" in out and "4 runs, 0 failed" in out
    found = read_benchmark(here / "front.json")
    assert [(entry["choice"], entry["particle_spacing"]) for entry in found.rows] == [
        ("default", 0.125), ("default", 0.1), ("h 1.3", 0.125), ("h 1.3", 0.1),
    ]  # fmt: skip
    assert [entry["particles"] for entry in found.rows] == [64, 100, 64, 100]
    for entry in found.rows:
        assert entry["error"] == abs(entry["errors"]["start"]) and entry["status"] == "finished"
        assert 0 < entry["seconds"] < 60 and entry["cpu_seconds"] > 0 and entry["setup_seconds"] > 0
        # at least position, velocity, density and mass of each particle in single precision
        assert entry["memory_bytes"] > 4 * 6 * entry["particles"] and entry["threads"] == 1
    assert found.rows[2]["changes"] == {"numerics.smoothing_ratio": 1.3}
    assert found.about["commit"] and "benchmark" in found.about["command"] and found.about["level"] == "quick"
    picture = here / "out" / "scene.png"
    assert picture.stat().st_size < 100_000
    with pytest.raises(SystemExit):
        cli.app(call)
    assert made == [0, 1, 2, 3], "runs that are done are not made again"


def test_a_run_that_fails_is_a_row(here):
    found = benchmark("out", level="full", plans=here / "plans", draw=False)
    good, bad = found.rows
    assert (good["choice"], good["status"]) == ("default", "finished")
    assert bad["choice"] == "broken" and bad["status"] != "finished" and bad["problem"] and bad["error"] is None
    assert found.failed == [bad] and found.exit_code == 6
    assert front(found.rows) == [good]


def test_a_run_that_takes_too_long_is_a_row_and_may_be_given_more_time(here):
    slow = benchmark("out", level="full", wall_time=1e-6, plans=here / "plans", draw=False)
    assert [entry["status"] for entry in slow.rows] == ["too slow", "failed"]
    more = benchmark("out", level="full", retry=True, plans=here / "plans", draw=False)
    assert more.rows[0]["status"] == "finished"


def test_the_plans_of_a_command_can_be_looked_at(here, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.app(["benchmark", "--plans", "plans", "--dry-run", "--level", "full"])
    assert stop.value.code == 0 and "broken" in capsys.readouterr().out and not Path("benchmark").exists()


def test_short_runs_are_repeated_and_the_quickest_counts(here, monkeypatch):
    seconds = iter([0.5, 0.2, 0.3])
    before = Simulation._summarise
    made = []

    def timed(self, *arguments):
        made.append(self)
        return before(self, *arguments) | {"wall_seconds": next(seconds)}

    monkeypatch.setattr(Simulation, "_summarise", timed)
    case = Case.from_dict(scene())
    task = sweeps.Task(0, case.to_dict(), None, {}, {}, {}, None, "cpu", 1, repeats=3)
    found = execute(task)
    assert len(made) == 3 and found["seconds"] == 0.2


# ---- pictures --------------------------------------------------------------------------------------------


def test_peers_are_drawn_only_with_the_same_error(tmp_path):
    about = {"error_name": "an error", "peer_errors": ["l1"]}
    peer = {"peer": "SomeSPH", "particles": 100}
    same = peer | {"error_name": "l1"}
    peers = [row(1, 0.1, **same), row(1, 0.1, **peer, error_name="l2"), row(None, 0.1, **same)]
    peers.append(row(1, 0.1, **same) | {"case": "other"})
    assert comparable(peers, "scene", about) == peers[:1]
    rows = [row(1, 0.1), row(2, 0.05, spacing=0.05), row(1.5, 0.2, "other"), row(1, 0.0, "exact")]
    assert draw_case(tmp_path / "a.png", "scene", about, rows, peers).stat().st_size > 5000
    assert draw_case(tmp_path / "b.png", "scene", about, [row(1, None)]) is None and not (tmp_path / "b.png").exists()


def test_figures_of_peers_are_read_or_refused(tmp_path):
    path = tmp_path / "peers.json"
    path.write_text('{"rows": [{"case": "a"}]}', encoding="utf-8")
    with pytest.raises(CaseError, match="holds no readable rows of other codes"):
        read_peers(path)


# ---- advice ----------------------------------------------------------------------------------------------


def table():
    """A table of two benchmarks, that of the scene and one of a drop."""
    case = Case.from_dict(scene())
    other = features(case) | {"kind": "two phases", "tension": True}
    told = {"says": "a scene", "error_name": "error"}
    common = {"device": "cpu", "precision": "float32", "threads": 1, "particles": 100, "steps": 10}
    common |= {"settings": {"numerics": {}}}
    rows = [
        row(1.0, 0.04, **common),
        row(4.0, 0.008, "fine", 0.05, **common),
        row(2.0, 0.009, "gas", **common | {"settings": {"numerics": {"scheme": "gas", "kernel": "no kernel"}}}),
        row(0.1, 0.001, **common | {"case": "drop"}),
    ]
    cases = {
        "drop": told | {"identity": "0", "features": other, "length": 1.0},
        "scene": told | {"identity": identity(case), "features": features(case), "length": 1.0},
    }
    source = {"device": "cpu", "device_name": "a processor", "threads": 1, "date": "2026-01-01"}
    return {"sources": [source], "cases": cases, "rows": rows}


def test_a_benchmark_itself_gets_its_row_whatever_its_spacing():
    case = Case.from_dict(scene(particle_spacing=1 / 16, precision="float64"))
    found = advise(case, 0.05, table())
    assert (found.case, found.exact, found.row["seconds"]) == ("scene", True, 1.0) and not found.differences
    assert found.changes["particle_spacing"] == pytest.approx(0.1) and found.changes["precision"] == "float32"


def test_the_quickest_choice_that_the_scene_allows_is_taken():
    found = advise(Case.from_dict(scene()), 0.01, table())
    assert found.row["choice"] == "fine" and len(found.refused) == 1 and found.refused[0].startswith("gas: ")
    # the particles and steps of the run at the rate of the stored one: 250 particle-steps a second
    assert found.particles == 400 and found.seconds == pytest.approx(found.particles * found.steps / 250)


def test_a_gauge_that_the_settings_do_not_allow_is_a_condition():
    wall = {"load": {"type": "wall_force", "interval": 0.01}}
    data = scene(gauges=wall, reference={})
    data["domain"] |= {"boundary": {"x": "wall", "y": "wall"}}
    case = Case.from_dict(data)
    known = table()
    known["cases"]["scene"] |= {"features": features(case), "identity": identity(case)}
    known["rows"] = [known["rows"][0] | {"settings": {"numerics": {"scheme": "isph"}}}]
    found = advise(case, 0.05, known)
    assert found.row is not None and "gauges.load" in found.condition


def test_an_error_that_was_never_reached_names_the_best():
    found = advise(Case.from_dict(scene()), 0.001, table())
    assert found.row is None and found.best["error"] == 0.008


def test_another_scene_takes_as_many_spacings_over_its_length():
    data = scene(particle_spacing=1 / 32)
    data["domain"]["upper"] = [0.5, 0.5]
    case = Case.from_dict(data)
    found = advise(case, 0.05, table())
    assert length(case) == pytest.approx(0.5, rel=0.01)
    assert not found.exact and found.case == "scene" and found.across == pytest.approx(10)
    assert found.changes["particle_spacing"] == pytest.approx(1 / 20, rel=0.01)


def test_advice_is_that_of_the_kind_of_device():
    known = table()
    known["rows"].append(known["rows"][0] | {"device": "cuda:0", "seconds": 0.1, "particles": 1000})
    case = Case.from_dict(scene())
    assert advise(case, 0.05, known).row["seconds"] == 1.0, "runs of a GPU are no advice for a CPU"
    for device in ("cuda", "cuda:0", "cuda:1"):
        assert advise(case, 0.05, known, device).row["seconds"] == 0.1
        assert advise(case, 0.01, known, device).row is None, "nor the other way round"


def test_scenes_are_told_apart():
    names = "dam_break elliptic_drop shear_drop square_droplet rayleigh_taylor sod taylor_green hysing_1".split()
    cases = {name: load_case(ROOT / "cases" / f"{name}.yaml") for name in names}
    known = {"cases": {name: {"identity": "", "features": features(case)} for name, case in cases.items()}}
    for name, like in (
        ("dam_break_lobovsky", "dam_break"), ("rotating_square", "elliptic_drop"), ("capillary_wave", "shear_drop"),
        ("oscillating_drop", "square_droplet"), ("layered_poiseuille", "rayleigh_taylor"), ("noh", "sod"),
        ("taylor_green_lattice", "taylor_green"), ("double_bubble", "hysing_1"),
    ):  # fmt: skip
        assert nearest(load_case(ROOT / "cases" / f"{name}.yaml"), known) == like, name


@pytest.mark.parametrize(("text", "error"), [("1%", 0.01), ("0.2 %", 0.002), ("0.05", 0.05)])
def test_errors_are_read(text, error):
    assert error_of(text) == pytest.approx(error, rel=1e-12)


@pytest.mark.parametrize("text", ["abc", "0", "0%", "200%", "-1%", "nan", "inf", "1", ""])
def test_wrong_errors_are_refused(text, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.app(["check", str(ROOT / "cases" / "sod.yaml"), "--for-error", text])
    message = capsys.readouterr().err
    assert stop.value.code == 2
    assert "--for-error" in message and "needs an error above 0 and below 100 %" in message and "write e.g. 1%" in message


def test_a_device_without_a_benchmark_is_refused(capsys):
    with pytest.raises(SystemExit) as stop:
        cli.app(["check", str(ROOT / "cases" / "sod.yaml"), "--for-error", "1%", "--device", "abacus"])
    message = capsys.readouterr().err
    assert stop.value.code == 2
    assert "--device" in message and "abacus" in message and "choose from: cpu, cuda" in message


# ---- what is stored --------------------------------------------------------------------------------------


def test_every_case_on_record_has_its_picture_on_the_page():
    page = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    for record, folder in (("front_cpu", "benchmark"), ("front_h200", "benchmark/h200")):
        for name in read_benchmark(ROOT / "benchmarks" / f"{record}.json").cases:
            picture = f"{folder}/{name}.png"
            assert f"]({picture})" in page, picture
            assert 5_000 < (ROOT / "docs" / picture).stat().st_size < 100_000, picture


@pytest.mark.parametrize("machine", ["cpu", "cuda:0"])
def test_the_table_of_the_package_gives_advice_for_each_of_its_cases(machine):
    known = stored_fronts()
    assert set(known["cases"]) == set(find_plans())
    for name, path in find_plans().items():
        case = load_case((path.parent / load_plan(path).case).resolve())
        own = [entry for entry in known["rows"] if entry["case"] == name and entry["device"] == machine]
        worst = max(entry["error"] for entry in own)
        found = advise(case, worst, known, machine)
        assert (found.case, found.exact) == (name, True)
        assert found.row == sure(own, worst)[0], "none is worse than the worst"
        assert found.row["seconds"] <= NOISE * min(entry["seconds"] for entry in own)
