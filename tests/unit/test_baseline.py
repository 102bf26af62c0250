"""Errors held to recorded ones: the verdict on each, what a record holds, and the command that makes and uses it."""

import copy
import dataclasses
import json
import math
import sys

import pytest

from tests.scenes import PERIODIC
from warpsph import cli
from warpsph.case.case_file import dump_yaml
from warpsph.errors import CaseError
from warpsph.study import baseline, validation


def row(quantity="decay", error=0.02, allowed=0.05, **changes):
    outcome = "no limit" if allowed is None else "ok" if error is not None and abs(error) <= allowed else "missed"
    return {
        "quantity": quantity, "value": 1.0, "reference": 1.0, "error": error, "allowed": allowed, "unit": "", "note": "",
        "source": None, "absolute": False, "outcome": outcome, **changes,
    }  # fmt: skip


def entry(*rows, case="vortices", run="20", status="finished", problem=None):
    return {"case": case, "run": run, "status": status, "problem": problem, "seconds": 1.25, "rows": list(rows)}


def recorded(error=0.02, noise=0.001, allowed=0.05, absolute=False):
    return {"error": error, "noise": noise, "allowed": allowed, "absolute": absolute, "missed": abs(error) > (allowed or 9)}


def record_of(**errors):
    return {"runs": {"vortices/20": {"seconds": 1.0, "errors": errors}}}


def verdict(found, known, **options):
    (one,) = baseline.judge([entry(found)], record_of(decay=known) if known else record_of(), **options)
    return one


# ---- verdicts --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "outcome", "fails"),
    [
        (0.02, "held", False),
        (0.0229, "held", False),  # a tenth and the noise: 0.023
        (0.0231, "worse", True),
        (-0.0231, "worse", True),  # either sign is as bad
        (-0.02, "held", False),
        (0.0171, "held", False),
        (0.0169, "better", False),
        (0.0, "better", False),
    ],
)
def test_an_error_is_worse_or_better_beyond_a_tenth_and_its_noise(error, outcome, fails):
    found = verdict(row(error=error), recorded())
    assert (found.outcome, found.fails) == (outcome, fails)
    assert (found.error, found.recorded, found.noise) == (error, 0.02, 0.001)


def test_of_no_error_any_is_worse_but_for_its_noise():
    assert verdict(row(error=1e-9), recorded(error=0.0, noise=0.0)).outcome == "worse"
    assert verdict(row(error=1e-9), recorded(error=0.0, noise=1e-8)).outcome == "held"


@pytest.mark.parametrize("error", [None, math.nan, math.inf])
def test_an_error_without_a_number_is_missing(error):
    for known in (recorded(), None):
        found = verdict(row(error=error, note="not reached"), known)
        assert (found.outcome, found.fails, found.note) == ("missing", True, "not reached")


def test_a_quantity_that_is_gone_is_missing():
    verdicts = baseline.judge([entry(row())], record_of(decay=recorded(), period=recorded()))
    assert [(found.quantity, found.outcome, found.fails) for found in verdicts] == [
        ("decay", "held", False),
        ("period", "missing", True),
    ]


def test_a_known_miss_is_held_and_a_new_one_fails():
    known = verdict(row(error=0.2), recorded(error=0.2))
    assert (known.outcome, known.missed, known.fails) == ("held", True, False)
    assert verdict(row(error=0.3), recorded(error=0.2)).fails
    fresh = verdict(row(error=0.2), None)
    assert (fresh.outcome, fresh.missed, fresh.fails) == ("new", True, True)
    within = verdict(row(), None)
    assert (within.outcome, within.fails) == ("new", False)
    assert not verdict(row(error=0.2, allowed=None), None).fails


@pytest.mark.parametrize("status", ["diverged", "failed"])
def test_a_run_that_does_not_end_fails(status):
    lost = entry(row(quantity="", error=None, allowed=None), status=status, problem="a particle is lost")
    (found,) = baseline.judge([lost], record_of(decay=recorded()))
    assert (found.outcome, found.fails, found.note) == ("failed", True, f"{status}: a particle is lost")


def test_a_run_that_was_not_made_fails():
    (found,) = baseline.judge([], record_of(decay=recorded()), planned=["vortices/20"])
    assert (found.case, found.run, found.outcome, found.fails) == ("vortices", "20", "failed", True)


def test_errors_of_different_units_are_not_compared():
    found = verdict(row(absolute=True), recorded())
    assert found.fails and "another unit" in found.note


def test_told_in_shares_or_in_the_unit():
    assert baseline.told(verdict(row(error=0.2), recorded())) == [
        "vortices", "20", "decay", "20 %", "2 %", "0.1 %", "5 %", "worse, beyond its limit",
    ]  # fmt: skip
    assert baseline.told(verdict(row(error=0.02, absolute=True), recorded(absolute=True)))[3:5] == ["0.02", "0.02"]


@pytest.mark.parametrize("text", ["", "[]", '{"runs": {"a/b": {"errors": {"c": {"error": null, "noise": 0}}}}}'])
def test_a_record_that_cannot_be_read_names_the_command(tmp_path, text):
    path = tmp_path / "baseline.json"
    path.write_text(text)
    with pytest.raises(CaseError, match="write one: python -m warpsph validate --level ci --record"):
        baseline.read_baseline(path)
    with pytest.raises(CaseError, match="no readable record"):
        baseline.read_baseline(tmp_path / "none.json")


# ---- the shipped record ----------------------------------------------------------------------------------


def test_every_shipped_case_has_runs_and_they_are_on_record():
    runs = validation.plan("ci")
    assert {run.case_name for run in runs} == set(validation.find_cases())
    record = baseline.read_baseline(baseline.FILE)
    assert {baseline.key_of(run.case_name, run.run.name) for run in runs} == set(record["runs"])
    for run in runs:
        errors = record["runs"][baseline.key_of(run.case_name, run.run.name)]["errors"]
        assert set(errors) == set(run.case.reference), run.name
    assert record["commit"] and record["dirty"] is False and record["date"]


def test_several_schemes_are_run_where_a_case_takes_them():
    runs = validation.plan("ci")
    schemes: dict[str, set[str]] = {}
    for run in runs:
        schemes.setdefault(run.case_name, set()).add(run.case.numerics.scheme)
    single = {
        run.case_name
        for run in runs
        # a compressible gas is one scheme's alone
        if len(run.case.phases) == 1 and not run.case.has_flow_through and run.case.numerics.scheme != "gas"
    }
    # Pressures below zero all over tear the patch with the Riemann scheme.
    assert {name for name in single if len(schemes[name]) == 1} == {"rotating_square_inviscid"}


# ---- the command -----------------------------------------------------------------------------------------

REFERENCE = {
    "start": {"gauge": "energy", "column": "kinetic", "reduce": "max", "value": 0.25, "allowed": 0.05},
    "end": {"gauge": "energy", "column": "kinetic", "reduce": "final", "value": 0.2, "allowed": 1e-6},
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with one case of the level ci, in which the commands run."""
    data = copy.deepcopy(PERIODIC) | {"end_time": 0.02, "reference": REFERENCE, "output": {"particles": "none"}}
    data["validation"] = {"quick": [], "ci": [{"name": "20"}]}
    (tmp_path / "vortices.yaml").write_text(dump_yaml(data))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def command(folder, monkeypatch, capsys):
    """`validate --level ci` in that folder; gives exit code, stdout and stderr."""

    def run(*arguments):
        given = ["validate", "--level", "ci", "--cases", "vortices.yaml", "--baseline", "record.json", "--no-figures"]
        monkeypatch.setattr(sys, "argv", ["warpsph", *given, *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        out, err = capsys.readouterr()
        return stopped.value.code or 0, out, err

    return run


def test_record_hold_and_fail(folder, command):
    code, _, err = command()
    assert code == 2 and "record.json -> holds no readable record" in err

    code, out, _ = command("--record")
    assert code == 0 and "recorded in record.json" in out
    record = json.loads((folder / "record.json").read_text())
    assert {"commit", "dirty", "date", "command", "threads", "noise"} <= set(record)
    (run,) = record["runs"].values()
    assert {"commit", "dirty", "date", "seconds"} <= set(run)
    end = run["errors"]["end"]
    assert end["missed"] and len(end["samples"]) == len(baseline.TIMES)
    assert end["noise"] == pytest.approx(2 * max(abs(abs(sample) - abs(end["error"])) for sample in end["samples"]))

    code, out, _ = command()  # the miss is known
    assert code == 0 and "2 held, 0 better" in out and "1 beyond the limit" in out

    end["error"] *= 0.5
    (folder / "record.json").write_text(json.dumps(record))
    code, out, _ = command()
    assert code == validation.MISSED and "worse" in out

    end["error"] *= 4
    (folder / "record.json").write_text(json.dumps(record))
    code, out, _ = command()
    assert code == 0 and "better" in out and "--record" in out


def test_disturbed_runs_start_and_step_a_little_otherwise(folder):
    """Also where the Courant number is the program's: places alone say nothing where it displaces a lattice itself."""
    (run,) = validation.plan("ci", places=[folder / "vortices.yaml"])
    given = run.case.replace({"numerics.courant": 0.3})
    for case, courant in ((run.case, 0.5), (given, 0.3)):
        plain, *disturbed = (each.case for each in baseline.variants([dataclasses.replace(run, case=case)]))
        assert plain is case and len(disturbed) == 2
        for times, other in enumerate(disturbed, 1):
            assert other.start.noise == pytest.approx(case.start.noise + 1e-5 * times, rel=1e-12)
            assert other.numerics.courant == pytest.approx(courant * (1 - 1e-5 * times), rel=1e-12)


def test_a_record_of_a_run_without_numbers_is_refused(folder, command):
    text = (folder / "vortices.yaml").read_text().replace("reduce: final", "window: [1, 2]")
    (folder / "vortices.yaml").write_text(text)
    code, out, _ = command("--record")
    assert code == validation.MISSED and "missing" in out and "nothing recorded" in out
    assert not (folder / "record.json").exists()


def test_side_by_side_gives_what_one_after_the_other_gives(folder):
    data = copy.deepcopy(PERIODIC) | {"end_time": 0.01, "reference": REFERENCE, "output": {"particles": "none"}}
    data["validation"] = {"ci": [{"name": "a"}, {"name": "b", "changes": {"start.noise": 0.1}}], "quick": []}
    (folder / "vortices.yaml").write_text(dump_yaml(data))
    runs = validation.plan("ci", places=[folder / "vortices.yaml"])
    alone = validation.validate(runs, folder / "alone", threads=1, draw=False)
    told = []
    both = validation.validate(runs, folder / "both", threads=1, draw=False, processes=2, finished=told.append)
    assert [run["run"] for run in both.runs] == ["a", "b"] and len(told) == 2
    assert [found["error"] for found in both.rows] == [found["error"] for found in alone.rows]
    assert both.about["processor"] == alone.about["processor"]


def test_options_of_the_level_ci_belong_to_it(folder, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["warpsph", "validate", "--cases", "vortices.yaml", "--record"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 2 and "--record: true -> belongs to --level ci" in capsys.readouterr().err
