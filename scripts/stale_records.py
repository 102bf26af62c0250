"""Records of benchmarks/ that are older than the numerics they measure.

    python scripts/stale_records.py [RECORD ...] [--strict]

A record names the commit of the code that made it, or, where that was not kept ("commit_is": "of the record"), the commit
that brought the record itself. It is stale if a later commit of this branch changed code that its numbers come from:

    riemann      kernels/riemann, what else the Riemann scheme runs on
    isph         kernels/isph, what else projection ISPH runs on
    delta_plus   kernels/delta, what else delta-plus-SPH runs on
    gas          kernels/gas, what else the compressible gas runs on
    linear       kernels/linear, warpsph/solvers

and, for all schemes, kernels/core and warpsph/engine, schemes, scene. Commits that cannot have changed a number do not
count: those whose files are the same but for comments, docstrings, imports and names of files, and those that are listed
with a reason in benchmarks/no_change_commits.txt, after a look at bit-identical results.

--strict: exit code 1 if there are stale records
"""

from __future__ import annotations

import argparse
import ast
import json
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RECORDS = ROOT / "benchmarks"
NO_CHANGE = RECORDS / "no_change_commits.txt"

SCHEMES = ("riemann", "isph", "delta_plus", "gas")
FOLDERS = {  # of whole topics
    "kernels/riemann": {"riemann"},
    "kernels/isph": {"isph"},
    "kernels/delta": {"delta_plus"},
    "kernels/gas": {"gas"},
    "kernels/linear": {"linear"},
    "warpsph/solvers": {"linear"},
}
COMMON = ("kernels", "warpsph/engine", "warpsph/schemes", "warpsph/scene", "warpsph/running/model.py", "warpsph/start.py")
# Files of one topic, wherever they stand: until the folders above were made all lay in kernels/ and warpsph/.
FILES = {
    "riemann": "contact density drift integrate interface interface_flow load momentum star volume riemann stepper "
    "riemann_numerics riemann_physics riemann_program riemann_scheme",
    "isph": "projection diffusion surface mirror isph incompressible projection_stepper "
    "isph_numerics isph_physics isph_program isph_scheme isph_systems",
    "delta_plus": "delta_numerics delta_physics delta_program delta_scheme",
    "gas": "gas_numerics gas_physics gas_program gas_scheme",
    "linear": "krylov grid_cycle linear_solver multigrid",
}
OLD_COMMON = "borders geometry launch magnitudes model neighbours packing particles physics simulation"


@cache
def topics_of(path: str) -> frozenset[str]:
    """Which topics a source file belongs to; none if no number of a run depends on it."""
    if not path.endswith(".py") or path.endswith("__init__.py"):
        return frozenset()
    for folder, topics in FOLDERS.items():
        if path.startswith(f"{folder}/"):
            return frozenset(topics)
    parts = path.split("/")
    flat = parts[0] == "warpsph" and len(parts) == 2
    if not path.startswith(COMMON) and not flat and not path.startswith("warpsph/schemes/"):
        return frozenset()
    for topic, names in FILES.items():
        if Path(path).stem in names.split():
            return frozenset({topic})
    if flat and Path(path).stem not in OLD_COMMON.split():
        return frozenset()
    return frozenset(SCHEMES)


def git(*arguments: str) -> str:
    """What git prints; raises CalledProcessError."""
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout


# ---- what a commit changed -------------------------------------------------------------------------------


def bare(source: str) -> str:
    """Python source without what no result depends on: comments, docstrings, imports, formatting."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if not isinstance(body, list):
            continue
        node.body = [entry for entry in body if not _idle(entry)]  # type: ignore[attr-defined]
    return ast.dump(tree)


def _idle(node: ast.AST) -> bool:
    """Whether a statement is an import or a text alone."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return isinstance(node.value.value, str)
    return isinstance(node, ast.Import | ast.ImportFrom)


def same(commit: str, before: str, after: str) -> bool:
    """Whether a file, perhaps renamed, is the same but for what `bare` takes away."""
    try:
        old, new = git("show", f"{commit}^:{before}"), git("show", f"{commit}:{after}")
        return bare(old) == bare(new)
    except (subprocess.CalledProcessError, SyntaxError):
        return False


@cache
def changed_topics(commit: str) -> frozenset[str]:
    """Topics whose numbers a commit may have changed."""
    found: set[str] = set()
    for line in git("diff-tree", "-r", "-M", "--root", "--no-commit-id", "--name-status", commit).splitlines():
        status, *paths = line.split("\t")
        topics = topics_of(paths[0]) | topics_of(paths[-1])
        if topics <= found or (status[0] in "MR" and same(commit, paths[0], paths[-1])):
            continue
        found |= topics
    return frozenset(found)


def listed_commits(path: Path) -> dict[str, str]:
    """Commits that moved no result, with the reason; lines are a hash, a blank and the reason, # begins a comment."""
    if not path.exists():
        return {}
    lines = (line.split("#")[0].strip() for line in path.read_text(encoding="utf-8").splitlines())
    return {words[0]: " ".join(words[1:]) for words in (line.split() for line in lines) if words}


@cache
def later_commits(commit: str) -> tuple[str, ...]:
    """Commits of this branch that do not come before one, newest first, without merges. Raises CalledProcessError."""
    return tuple(git("rev-list", "--no-merges", f"{commit}..HEAD", "--", "kernels", "warpsph").split())


# ---- records ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Record:
    """A file of benchmarks/ and what it says of its origin.

    commit: hash; exact: whether that of the code that ran; dirty: whether that code was changed further
    topics: what its numbers come from
    """

    path: Path
    commit: str
    exact: bool
    dirty: bool
    date: str
    topics: frozenset[str]


@cache
def scheme_of_case(name: str) -> str:
    """The scheme in a shipped case file, from its text; the default where it names none."""
    path = ROOT / "cases" / f"{name}.yaml"
    head = path.read_text(encoding="utf-8").split("\nvalidation:")[0] if path.exists() else ""
    return next((scheme for scheme in SCHEMES if f"scheme: {scheme}" in head), "riemann")


def scheme_of_run(case: str, run: str) -> str:
    """The scheme of a run: the one that its name ends with, or that of its case."""
    return next((scheme for scheme in SCHEMES if scheme in run.replace(" ", "_")), scheme_of_case(case))


def case_and_run(key: str) -> tuple[str, str]:
    """Case and run of a key CASE/RUN, or CASE-RUN as the command line has it."""
    case, _, run = key.partition("/") if "/" in key else key.partition("-")
    return case, run


def topics_of_record(name: str, data: Any) -> frozenset[str]:
    """What the numbers of a record come from, by its name and its rows."""
    if name.startswith("solver"):
        return frozenset({"linear"})
    if name.startswith("isph"):
        return frozenset({"isph", "linear"})
    rows = data.get("rows", []) if isinstance(data, dict) else []
    runs = {(row["case"], row["run"]) for row in rows if isinstance(row, dict) and "case" in row and "run" in row}
    if isinstance(data, dict) and isinstance(data.get("runs"), dict):
        runs |= {case_and_run(key) for key in data["runs"]}
    schemes = {scheme_of_run(case, run) for case, run in runs}
    if not schemes:
        schemes = {"riemann"} if name.startswith(("stress", "random", "speed", "skip", "double")) else set(SCHEMES)
    return frozenset(schemes | ({"linear"} if "isph" in schemes else set()))


def read_record(path: Path) -> Record:
    """A record and its origin; of a text file, or one that does not tell, the commit that brought it."""
    data: Any = json.loads(path.read_text(encoding="utf-8")) if path.suffix == ".json" else {}
    commit = data.get("commit") if isinstance(data, dict) else None
    exact = commit is not None and data.get("commit_is") != "of the record"
    date = data.get("date", "") if isinstance(data, dict) else ""
    if commit is None:
        commit, _, date = git("log", "-1", "--format=%H %ad", "--date=short", "--", str(path)).strip().partition(" ")
    dirty = bool(data.get("dirty")) if isinstance(data, dict) else False
    return Record(path, commit, exact, dirty, date, topics_of_record(path.name, data))


def later_changes(record: Record, known: Iterable[str]) -> list[str] | None:
    """Commits after a record that may have changed its numbers, newest first; None if its commit is not in this history."""
    try:
        later = later_commits(record.commit)
    except subprocess.CalledProcessError:
        return None
    passed = tuple(known)
    return [
        commit for commit in later if not commit.startswith(passed or ("-",)) and changed_topics(commit) & record.topics
    ]


def main(arguments: list[str] | None = None) -> int:
    """Print the stale records; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("records", nargs="*", type=Path, metavar="RECORD", help="files (default: all of benchmarks/)")
    parser.add_argument("--strict", action="store_true", help="exit code 1 if there are stale records")
    chosen = parser.parse_args(arguments)
    found = sorted(path for path in RECORDS.rglob("*") if path.suffix in (".json", ".txt") and path != NO_CHANGE)
    records = [read_record(path.resolve()) for path in chosen.records or found]
    known = listed_commits(NO_CHANGE)
    stale = 0
    for record in records:
        name = record.path.relative_to(ROOT)
        if not record.commit:
            print(f"{name}: is not committed")
            continue
        changes = later_changes(record, known)
        origin = f"{record.commit[:7]} of {record.date}{'' if record.exact else ' (of the record)'}"
        if record.dirty:
            print(f"{name}: made by code that differs from {origin}")
        if changes is None:
            print(f"{name}: its commit {record.commit[:7]} is not in this history")
        elif changes:
            topics = ", ".join(sorted(record.topics))
            print(f"{name}: {origin}; {len(changes)} later changes of {topics}, last {changes[0][:7]}")
        stale += changes is None or bool(changes)
    print(f"{stale} of {len(records)} records are stale")
    return 1 if stale and chosen.strict else 0


if __name__ == "__main__":
    sys.exit(main())
