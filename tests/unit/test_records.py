"""Records: which commit made them, which are older than the numerics, and the tables of the docs."""

import dataclasses
import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from warpsph.study import provenance as origin

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = ROOT / "benchmarks"


def script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


stale_records = script("stale_records")
write_tables = script("write_tables")


def git(folder, *arguments):
    command = ["git", "-c", "user.name=A", "-c", "user.email=a@b.c", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout.strip()


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """An empty repository that both scripts take for the checkout; gives a function that commits files."""
    git(tmp_path, "init", "-q")
    for module in (stale_records, write_tables):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(stale_records, "RECORDS", tmp_path / "benchmarks")
    monkeypatch.setattr(stale_records, "NO_CHANGE", tmp_path / "benchmarks" / "no_change_commits.txt")
    monkeypatch.setattr(origin, "CHECKOUT", tmp_path)
    stale_records.changed_topics.cache_clear()
    stale_records.later_commits.cache_clear()

    def commit(files, message="change"):
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text)
        git(tmp_path, "add", "-A")
        git(tmp_path, "commit", "-q", "-m", message)
        return git(tmp_path, "rev-parse", "HEAD")

    return commit


# ---- provenance ------------------------------------------------------------------------------------------


def test_commit_and_whether_it_was_changed(checkout, tmp_path):
    commit = checkout({"kernels/a.py": "x = 1\n", "notes.txt": "a"})
    found = origin._state()
    assert (found["commit"], found["dirty"]) == (commit, False)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", found["date"])
    (tmp_path / "notes.txt").write_text("b")  # moves no result
    assert origin._state()["dirty"] is False
    (tmp_path / "kernels" / "a.py").write_text("x = 2\n")
    assert origin._state()["dirty"] is True


def test_a_copy_without_history_is_told_its_commit(tmp_path, monkeypatch):
    monkeypatch.setattr(origin, "CHECKOUT", tmp_path)
    assert origin._state()["commit"] is None
    monkeypatch.setenv(origin.COMMIT_VARIABLE, "abc")
    assert (origin._state()["commit"], origin._state()["dirty"]) == ("abc", None)


def test_every_record_says_where_it_comes_from():
    for path in BENCHMARKS.rglob("*.json"):
        record = json.loads(path.read_text(encoding="utf-8"))
        assert re.fullmatch(r"[0-9a-f]{40}", record["commit"]), path
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", record["date"]), path


# ---- stale records ---------------------------------------------------------------------------------------


SOURCE = '"""A module."""\n\nimport math\n\n\ndef f(x):\n    return 2 * x\n'


def stale(capsys, *arguments):
    code = stale_records.main(["--strict", *arguments])
    return code, capsys.readouterr().out


def test_a_record_is_stale_after_a_change_of_its_numerics(checkout, capsys):
    first = checkout({"kernels/riemann/momentum.py": SOURCE, "kernels/isph/projection.py": SOURCE})
    isph = {"commit": first, "date": "2026-01-01", "dirty": False, "rows": []}
    checkout({"benchmarks/isph_variants.json": json.dumps(isph), "benchmarks/speed.json": json.dumps(isph)})
    code, out = stale(capsys)
    assert code == 0 and "0 of 2 records are stale" in out

    changed = checkout({"kernels/riemann/momentum.py": SOURCE.replace("2", "3")})
    stale_records.later_commits.cache_clear()
    code, out = stale(capsys)
    assert code == 1 and "1 of 2 records are stale" in out
    assert f"benchmarks/speed.json: {first[:7]} of 2026-01-01; 1 later changes of riemann, last {changed[:7]}" in out

    listed = {"benchmarks/no_change_commits.txt": f"# reasons\n{changed[:12]}  hashes of all final states are the same\n"}
    checkout(listed)
    stale_records.later_commits.cache_clear()
    code, out = stale(capsys)
    assert code == 0 and "0 of 2" in out


@pytest.mark.parametrize(
    ("files", "topics"),
    [
        ({"kernels/core/cells.py": SOURCE.replace("A module", "Another word").replace("import math", "")}, set()),
        ({"kernels/core/cells.py": SOURCE.replace("    return", "    # twice\n    return")}, set()),
        ({"kernels/core/cells.py": SOURCE.replace("2 * x", "3 * x")}, {"riemann", "isph", "delta_plus", "gas"}),
        ({"kernels/delta/delta_drift.py": SOURCE, "warpsph/schemes/gas_physics.py": SOURCE}, {"delta_plus", "gas"}),
        ({"kernels/riemann/new.py": SOURCE}, {"riemann"}),
        ({"warpsph/solvers/multigrid.py": SOURCE}, {"linear"}),
        ({"warpsph/schemes/isph_physics.py": SOURCE}, {"isph"}),
        ({"warpsph/scene/packing.py": SOURCE}, {"riemann", "isph", "delta_plus", "gas"}),
        ({"warpsph/momentum.py": SOURCE, "kernels/krylov.py": SOURCE}, {"riemann", "linear"}),  # before the folders
        ({"warpsph/study/plot.py": SOURCE, "tests/unit/test_a.py": SOURCE, "docs/accuracy.md": "a"}, set()),
    ],
)
def test_what_a_commit_may_have_changed(checkout, files, topics):
    checkout({"kernels/core/cells.py": SOURCE})
    assert stale_records.changed_topics(checkout(files)) == topics


def test_a_moved_file_changes_nothing(checkout, tmp_path):
    checkout({"kernels/cells.py": SOURCE * 9})
    (tmp_path / "kernels" / "core").mkdir()
    git(tmp_path, "mv", "kernels/cells.py", "kernels/core/cells.py")
    commit = checkout({"kernels/core/cells.py": (SOURCE * 9).replace("import math", "import math as m")})
    assert stale_records.changed_topics(commit) == set()


def test_records_of_unknown_commits_and_of_changed_code_are_told(checkout, capsys):
    lost = {"commit": "0" * 40, "date": "2026-01-01", "dirty": True}
    checkout({"benchmarks/speed.json": json.dumps(lost), "benchmarks/random.txt": "rows\n"})
    code, out = stale(capsys)
    assert code == 1 and "is not in this history" in out and "made by code that differs" in out
    assert "random.txt" not in out


def test_topics_of_records_follow_the_schemes_of_their_runs():
    topics = stale_records.topics_of_record
    rows = [{"case": "taylor_green", "run": "50"}, {"case": "taylor_green", "run": "50 isph"}]
    assert topics("validation.json", {"rows": rows[:1]}) == {"riemann"}
    assert topics("validation.json", {"rows": rows[1:]}) == {"isph", "linear"}
    assert topics("validation.json", {"rows": [{"case": "elliptic_drop", "run": "0.04"}]}) == {"isph", "linear"}
    assert topics("baseline_ci.json", {"runs": {"dam_break_lobovsky/20 riemann": {}}}) == {"riemann"}
    dashed = {"dam_break_lobovsky-60_delta_plus": {}, "sod-720": {}}
    assert topics("variants.json", {"runs": dashed}) == {"delta_plus", "gas"}
    assert topics("validation.json", {"rows": [{"case": "turning_ring", "run": "50"}]}) == {"delta_plus"}
    assert topics("validation.json", {"rows": [{"case": "sod", "run": "720"}]}) == {"gas"}


# ---- tables ----------------------------------------------------------------------------------------------


def test_tables_of_the_docs_are_as_their_records_say(capsys):
    assert write_tables.main(["--check"]) == 0, capsys.readouterr().err


def test_a_table_is_written_and_checked(checkout, tmp_path, monkeypatch, capsys):
    checkout(
        {"README.md": "no table\n", "docs/accuracy.md": "before\n<!-- table: one -->\nold\n<!-- end table -->\nafter\n"}
    )
    monkeypatch.setattr(write_tables, "TABLES", {"one": lambda: write_tables.table(["a", "b"], "lr", [["x|y", "1"]])})
    assert write_tables.main(["--check"]) == 1
    assert "docs/accuracy.md: run python scripts/write_tables.py" in capsys.readouterr().err
    assert write_tables.main([]) == 0
    text = (tmp_path / "docs" / "accuracy.md").read_text()
    assert text == (
        "before\n<!-- table: one -->\n\n| a | b |\n| --- | ---: |\n| x\\|y | 1 |\n\n<!-- end table -->\nafter\n"
    )
    assert write_tables.main(["--check"]) == 0 and write_tables.main([]) == 0
    assert (tmp_path / "docs" / "accuracy.md").read_text() == text


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("<!-- table: two -->\n<!-- end table -->\n", "there is no table two; there are one"),
        ("<!-- table: one -->\nrows\n", "needs an <!-- end table -->"),
        ("<!-- end table -->\n", "needs an <!-- end table -->"),
    ],
)
def test_marks_that_are_wrong_are_refused(checkout, monkeypatch, capsys, text, complaint):
    checkout({"README.md": text})
    monkeypatch.setattr(write_tables, "TABLES", {"one": lambda: ""})
    assert write_tables.main([]) == 2
    assert complaint in capsys.readouterr().err


def test_no_missed_row_is_left_out_or_unmarked():
    """Each row of each record that counts stands in a table; each that is beyond its limit is marked there and listed."""
    rows = write_tables.newest_rows()
    missed = [row for row in rows if row.missed]
    assert missed and len(missed) < len(rows)
    lines = write_tables.misses().splitlines()[2:]
    assert len(lines) == len(missed)
    tables = "".join(write_tables.TABLES[name]() for name in ("two_phase", "projection", "one_phase", "delta_plus", "gas"))
    counted = sum(int(found) for found in re.findall(r"\*\*missed\*\* (\d+) of", tables))
    assert counted == len(missed)
    lines = [line.split("|") for line in tables.splitlines() if line.startswith(("| `", "|  "))]
    assert sum(len(cells[3].split(";")) for cells in lines) == len(rows)
    full = write_tables.validation_h200().splitlines()[2:]
    assert len(full) == len(write_tables.h200_rows())
    assert sum("**missed**" in line for line in full) == sum(row.missed for row in write_tables.h200_rows())


def recorded_row(folder, quantity, definition=None, run="40", case="hysing_1", **changes):
    """The row of a record with one error."""
    entry = {
        "case": case, "run": run, "quantity": quantity, "value": 1.07, "reference": 1.0817, "error": -0.02, "unit": "m",
        "allowed": 0.05, "absolute": False, "outcome": "ok", "note": "", "precision": "float32", **changes,
    }  # fmt: skip
    known = write_tables.definition_of(write_tables.cases_of_runs(case)[run], quantity)
    entry["definition"] = known if definition is None else definition
    record = {"commit": "a" * 40, "date": "2026-01-01", "device": "cpu", "level": "quick", "rows": [entry]}
    (folder / "record.json").write_text(json.dumps(record))
    (row,) = write_tables.rows_of(folder / "record.json")
    return row


def test_a_limit_that_was_tightened_makes_a_miss_and_another_definition_is_marked(tmp_path):
    row = recorded_row(tmp_path, "smallest_circularity")
    assert (row.allowed, row.missed, row.text) == (0.01, True, "-2 %")
    row = recorded_row(tmp_path, "smallest_circularity", "other")
    assert (row.allowed, row.missed, row.text) == (0.05, False, "-2 %†")


def test_errors_of_coordinates_are_told_as_shares_of_the_way_moved(tmp_path):
    row = recorded_row(tmp_path, "centre_of_mass_t3", "other")  # from 0.5 to 1.0817 m
    assert row.entry["error"] == pytest.approx(-0.0117 / 0.5817)
    assert (row.allowed, row.missed, row.text) == (0.005, True, "-2.01 %")
    row = recorded_row(tmp_path, "centroid", "other", "90 x 150", "rising_bubble", value=0.39, reference=0.4)
    assert row.entry["error"] == pytest.approx(0.01 / 0.19926, rel=1e-4)
    assert (row.allowed, row.missed, row.text) == (0.02, True, "≥ 5.02 %†")


def test_each_run_stands_once_with_what_it_was_measured_at():
    """The table has every run of the tables of errors, each with the commit, date and device that its rows have."""
    head, *lines = [line.strip("| ").split(" | ") for line in write_tables.measured_at().splitlines() if "---" not in line]
    assert head == ["commit", "date", "device", "cases and their runs"]
    found = []
    for commit, date, device, cases in lines:
        for case, _, runs in (told.partition("` ") for told in cases.split("<br>")):
            found += [(commit.partition(" ")[0], date, device, case.strip("`"), run) for run in runs.split("; ")]
    wanted = set()
    for row in write_tables.newest_rows():
        device, date, commit = row.where.split(", ")
        device, *precision = device.split(" ")
        wanted.add((commit, date, device, row.case, " ".join([row.run, *precision])))
    assert len(found) == len(wanted) and set(found) == wanted
    assert len({(commit, device) for commit, _, device, _ in lines}) == len(lines)
    dates = [date for _, date, _, _ in lines]
    assert dates == sorted(dates, reverse=True)


def test_runs_of_one_commit_and_device_are_one_row_the_newest_first(tmp_path, monkeypatch):
    row = recorded_row(tmp_path, "centre_of_mass_t3")
    gpu = {"device": "cuda:0", "device_name": "NVIDIA H200", "date": "2026-01-02"}

    def changed(entry, **record):
        return dataclasses.replace(row, entry=row.entry | entry, record=row.record | record)

    rows = [
        row,
        changed({"quantity": "top"}),
        changed({"run": "80"}, commit="b" * 40, date="2026-01-03", commit_is="of the record"),
        changed({"run": "160", "precision": "float64"}),
        changed({"case": "hysing_2"}, date="2026-01-02"),
        changed({"run": "320"}, **gpu),
    ]
    monkeypatch.setattr(write_tables, "newest_rows", lambda: rows)
    assert write_tables.measured_at().splitlines()[2:] == [
        "| bbbbbbb (of the record) | 2026-01-03 | CPU | `hysing_1` 80 |",
        "| aaaaaaa | 2026-01-02 | H200 | `hysing_1` 320 |",
        "| aaaaaaa | 2026-01-01 to 2026-01-02 | CPU | `hysing_1` 40; 160 float64<br>`hysing_2` 40 |",
    ]


def test_a_run_that_failed_is_a_miss(tmp_path):
    entry = {
        "case": "hysing_1", "run": "40", "quantity": "", "value": None, "reference": None, "error": None, "unit": "",
        "allowed": None, "absolute": False, "outcome": "diverged", "note": "a particle is lost", "precision": "float32",
    }  # fmt: skip
    record = {"commit": "a" * 40, "date": "2026-01-01", "device": "cpu", "level": "quick", "rows": [entry]}
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record))
    (row,) = write_tables.rows_of(path)
    assert row.missed and not row.ended
