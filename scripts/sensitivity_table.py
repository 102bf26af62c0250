"""The table of constants for docs/theory/constants.md, from scripts/constants.yaml and a record of scripts/sensitivity.py.

Of each constant and factor the table tells one error, the one that moves most over its limit:

    not measured      the record has not all the runs
    no change         every error of every run is the same to the last digit
    within noise      no error with a limit moves by more than the noise that the level ci has on record for it
    slight            one does, but none by 1 % of its limit
    A: e1 -> e2       run and quantity, the error as it is and with the constant changed, in bold where it moves by more than
                      its limit or the run does not end
"""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
from sensitivity import FACTORS, ROOT, Constant, Job, assigned  # noqa: E402
from sensitivity import constants as listed  # noqa: E402

NOISE = ROOT / "benchmarks" / "baseline_ci.json"
SLIGHT = 0.01
"""Change of an error, over its limit, below which the table has no numbers."""


@dataclass(frozen=True)
class Move:
    """How far a constant moves one error.

    before, after: the error of the run as it is, and with the constant changed; allowed: its limit; noise: what moves it
    for no reason; absolute: whether all are in the unit of the quantity, else shares
    """

    run: str
    quantity: str
    before: float
    after: float
    allowed: float
    noise: float
    absolute: bool

    @property
    def share(self) -> float:
        """The change over the limit."""
        return abs(self.after - self.before) / self.allowed

    @property
    def text(self) -> str:
        unit, times = ("", 1.0) if self.absolute else (" %", 100.0)
        told = f"{self.run}, {self.quantity}: {times * self.before:.3g} → {times * self.after:.3g}{unit}"
        return f"**{told}**" if self.share > 1.0 else told


def moves(job: Job, plain: Mapping[str, Any], changed: Mapping[str, Any], noise: Mapping[str, float]) -> list[Move]:
    """The errors of a run that have a limit, with and without a constant changed; one that is gone counts as infinite."""
    found = []
    for quantity, row in plain["errors"].items():
        if row["error"] is None or not row["allowed"]:
            continue
        after = changed["errors"].get(quantity, {}).get("error")
        after = float("inf") if after is None else after
        usual = noise.get(quantity, 0.0)
        found.append(Move(job.run, quantity, row["error"], after, row["allowed"], usual, row["absolute"]))
    return found


def effect(entry: Constant, factor: float, jobs: Mapping[str, Any], noise: Mapping[str, Mapping[str, float]]) -> str:
    """What the table tells of a constant at a factor, see the module."""
    found, same = [], True
    for run in entry.runs:
        job = Job(entry.name, factor, run)
        plain, changed = jobs.get(Job("", 1.0, run).key), jobs.get(job.key)
        if plain is None or changed is None:
            return "not measured"
        if changed["failed"] or plain["failed"]:
            return f"**{run}: {changed['failed'] or 'the run as it is ended with ' + plain['failed']}**"
        same = same and plain["errors"] == changed["errors"]
        found += moves(job, plain, changed, noise.get(run, {}))
    if same:
        return "no change"
    beyond = [move for move in found if abs(move.after - move.before) > move.noise]
    if not beyond:
        return "within noise"
    largest = max(beyond, key=lambda move: move.share)
    return largest.text if largest.share >= SLIGHT else "slight"


def value_of(name: str) -> str:
    """The value of a constant as its module has it. Raises LookupError if it has none of that name."""
    module, _, attribute = name.rpartition(".")
    path = ROOT / (module.removeprefix("warpsph.") if ".kernels." in module else module).replace(".", "/")
    return ast.unparse(assigned(ast.parse(path.with_suffix(".py").read_text(encoding="utf-8")), attribute))


def jobs_about(entry: Constant, records: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """The jobs of the last record that has changed a constant, its runs as they are from the same record."""
    for jobs in reversed(records):
        if any(Job(entry.name, factor, run).key in jobs for factor in FACTORS for run in entry.runs):
            return jobs
    return {}


def constants(*paths: Path) -> tuple[Sequence[str], str, list[Sequence[str]]]:
    """Head, alignment and rows of the table; `paths`: records, the last ones asked first; none of them: not measured."""
    records = [json.loads(path.read_text(encoding="utf-8"))["jobs"] for path in paths if path.exists()]
    usual = json.loads(NOISE.read_text(encoding="utf-8"))["runs"]
    noise = {run: {name: row["noise"] for name, row in entry["errors"].items()} for run, entry in usual.items()}
    rows = [
        (f"`{entry.name.removeprefix('warpsph.')}`", value_of(entry.name), entry.meaning, entry.kind, entry.source,
         *(effect(entry, factor, jobs_about(entry, records), noise) for factor in FACTORS))
        for entry in listed()
    ]  # fmt: skip
    return ("constant", "value", "meaning", "kind", "source", "half", "double"), "lrlllll", list(rows)
