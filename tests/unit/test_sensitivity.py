"""Constants that are not derived: the list, what changes them, and the table of what that does."""

import argparse
import ast
import importlib.util
import sys
from pathlib import Path

import pytest

from warpsph.case.case_file import load_case
from warpsph.study.validation import find_cases, runs_of

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


def script(name):
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


sensitivity = script("sensitivity")
sensitivity_table = script("sensitivity_table")
LISTED = sensitivity.constants()


# ---- the list --------------------------------------------------------------------------------------------


def test_each_constant_stands_once_and_at_the_head_of_its_module():
    names = [entry.name for entry in LISTED]
    assert len(set(names)) == len(names) > 50
    for name in names:
        assert any(isinstance(part, ast.Constant) for part in ast.walk(ast.parse(sensitivity_table.value_of(name)))), name


def test_each_run_is_one_of_the_level_ci():
    cases = find_cases()
    known = {name: {run.run.name for run in runs_of(load_case(path), name, ["ci"])} for name, path in cases.items()}
    for entry in LISTED:
        assert entry.runs, entry.name
        for run in entry.runs:
            case, _, name = run.partition("/")
            assert name in known[case], f"{entry.name}: {run}"


def test_jobs_are_all_runs_as_they_are_and_with_half_and_double():
    entries = [entry for entry in LISTED if entry.name.endswith("gas_forces.WEAK")]
    keys = [job.key for job in sensitivity.jobs_of(entries)]
    name = "warpsph.kernels.gas.gas_forces.WEAK"
    assert keys == [" 1 sod/180", " 1 noh/25", *(f"{name} {f} {run}" for f in ("0.5", "2") for run in ("sod/180", "noh/25"))]


# ---- a constant changed ----------------------------------------------------------------------------------


def after(source, name, factor):
    space = {}
    exec(compile(sensitivity.changed_source(source, name, factor), "module", "exec"), space)
    return space


def test_a_number_and_what_is_made_of_it_are_changed():
    space = after("A = 0.4\nB = 3.0 * A\nC = A\n", "A", 0.5)
    assert (space["A"], space["B"], space["C"]) == pytest.approx((0.2, 0.6, 0.2))


def test_one_of_a_pair_an_expression_an_integer_and_a_table():
    space = after("LOW, HIGH = 0.25, 0.1\n", "HIGH", 2.0)
    assert (space["LOW"], space["HIGH"]) == (0.25, 0.2)
    assert after("A = 2.0 / 3.0\n", "A", 2.0)["A"] == pytest.approx(4.0 / 3.0)
    steps = after("STEPS = 5\n", "STEPS", 2.0)["STEPS"]
    assert steps == 10 and isinstance(steps, int)
    assert after("LIMIT = {'a': 0.125, 'b': 0.06}\n", "LIMIT", 2.0)["LIMIT"] == {"a": 0.25, "b": 0.12}


def test_what_cannot_be_changed_is_refused():
    with pytest.raises(LookupError, match="no constant B"):
        sensitivity.changed_source("A = 1.0\n", "B", 2.0)
    with pytest.raises(RuntimeError, match="is imported already"):
        sensitivity.change("warpsph.case.case_file.A", 2.0)


@pytest.mark.parametrize("entry", LISTED, ids=lambda entry: entry.name)
def test_each_module_can_be_imported_with_its_constant_changed(entry, monkeypatch):
    module, _, name = entry.name.rpartition(".")
    plain = importlib.import_module(module)
    finder = sensitivity.ChangedFinder(entry.name, 2.0)
    spec = finder.find_spec(module, sys.modules[module.rpartition(".")[0]].__path__)
    changed = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, module, changed)  # structs and dataclasses look their module up
    spec.loader.exec_module(changed)
    values = vars(changed)[name], vars(plain)[name]
    if isinstance(values[0], dict):
        assert values[0] == {key: 2 * value for key, value in values[1].items()}
    else:
        assert values[0] == 2 * values[1] and type(values[0]) is type(values[1])


OPTIONS = argparse.Namespace(device="cpu", limit=300.0)


@pytest.mark.parametrize(
    ("constant", "run"),
    [
        ("warpsph.kernels.gas.gas_forces.WEAK", "sod/180"),  # a global of a kernel
        ("warpsph.kernels.delta.fluid_pairs.CROWDING", "taylor_green/25 delta_plus"),
        ("warpsph.schemes.gas_physics.COURANT", "sod/180"),  # a number of the host
    ],
)
def test_a_changed_constant_reaches_the_run_and_leaves_nothing_behind(constant, run):
    """A process with a constant changed computes something else, though kernels of both lie in the same cache."""
    job = sensitivity.Job(constant, 64.0, run)
    plain = sensitivity.measured_apart(sensitivity.Job("", 1.0, run), OPTIONS)
    changed = sensitivity.measured_apart(job, OPTIONS)
    again = sensitivity.measured_apart(sensitivity.Job("", 1.0, run), OPTIONS)
    assert plain["failed"] is None and plain["errors"]
    assert plain["errors"] == again["errors"]
    assert changed["failed"] or changed["errors"] != plain["errors"]
    assert not (changed["failed"] or "").startswith("exit code"), changed["failed"]


def test_a_run_that_never_imports_a_constant_is_an_error():
    job = sensitivity.Job("warpsph.kernels.isph.surface.LONE", 2.0, "sod/180")
    assert "it cannot feel it" in sensitivity.measured_apart(job, OPTIONS)["failed"]


# ---- the table -------------------------------------------------------------------------------------------

ENTRY = sensitivity.Constant("m.A", "a", "chosen", "calibrated", ("case/1",))
NOISE = {"case/1": {"drag": 0.001}}


def told(error, failed=None, allowed=0.02):
    def job(value, ended=None):
        return {"failed": ended, "errors": {"drag": {"error": value, "allowed": allowed, "absolute": False}}}

    jobs = {" 1 case/1": job(0.01), "m.A 2 case/1": job(error, failed)}
    return sensitivity_table.effect(ENTRY, 2.0, jobs, NOISE)


def test_what_the_table_tells_of_a_constant():
    assert sensitivity_table.effect(ENTRY, 2.0, {}, NOISE) == "not measured"
    assert told(0.01) == "no change"
    assert told(0.0105) == "within noise"
    assert told(0.0111, allowed=0.2) == "slight"
    assert told(0.02) == "case/1, drag: 1 → 2 %"
    assert told(-0.02) == "**case/1, drag: 1 → -2 %**"  # moves by 3 % where 2 % are allowed
    assert told(0.01, "DivergenceError") == "**case/1: DivergenceError**"
    assert told(None).startswith("**case/1, drag: 1 → inf")
    assert told(0.5, allowed=None) == "within noise"
