"""Errors held to recorded ones: the level ci of `validate`.

Runs so coarse or short that all of them take minutes miss many of the limits that their cases state for finer ones; what
they show is a change. Each error is held to the one on record:

    worse     abs(error) > (1 + SLACK) abs(recorded) + noise: fails
    better    abs(error) < (1 - SLACK) abs(recorded) - noise: asks to be recorded
    missing   no number where one is on record, or where the case names a quantity: fails
    failed    the run did not get to its end, or was not made at all: fails
    new       nothing is on record: asks to be recorded; fails beyond the limit of the case
    held      else; beyond the limit of the case it is a known miss

Noise is what an error changes by for no reason, as by another order of a sum on another processor: the same run is made
again with start.noise greater by DISTURBANCE, about the rounding of a position in float32, and a Courant number less by
that share of itself, and again by twice that. Where the program displaces a lattice by more anyway (numerics.unlock) the
places stay, and the steps alone differ. The record holds NOISE_FACTOR times the larger change, as two runs rarely show the
largest that there is.
Other random starts (start.seed) would change many errors by more: which one is drawn is part of a run.

    record: {commit, dirty, date, command, level, device, threads, versions, processor, noise, runs}
    runs: "<case>/<run>" -> {commit, dirty, date, seconds, errors}
    errors: quantity -> {error, noise, allowed, absolute, missed, samples}; missed: beyond the limit of the case;
            samples: errors of the disturbed runs
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from warpsph.errors import CaseError, Problem
from warpsph.files.output import json_text
from warpsph.files.whole_files import write_text
from warpsph.scene.geometry import build
from warpsph.scene.physics import derive, support_radius
from warpsph.study.provenance import CHECKOUT, provenance
from warpsph.study.validation import MISSED, Planned, Table, file_name

FILE = CHECKOUT / "benchmarks" / "baseline_ci.json"
"""The record of a checkout."""

SLACK = 0.1
"""Share of the recorded error by which an error may change."""

DISTURBANCE = 1e-5
"""By how much more start.noise displaces the particles of a disturbed run, in spacings, and shorter its steps are."""

TIMES = (1, 2)
"""How many times the DISTURBANCE each disturbed run has."""

NOISE_FACTOR = 2.0
"""Noise over the largest change of an error among the disturbed runs."""

FAILING = ("worse", "missing", "failed")
"""Verdicts that fail."""

RECORD = "python -m warpsph validate --level ci --record"
"""The command that writes the record."""


@dataclass(frozen=True)
class Verdict:
    """What is to be said about one error of a run, or about a run without any (quantity is empty then).

    outcome: see the module
    error, recorded, noise, allowed: None if there is no such number
    absolute: whether they are in the unit of the quantity, else shares
    """

    case: str
    run: str
    quantity: str
    outcome: str
    error: float | None = None
    recorded: float | None = None
    noise: float | None = None
    allowed: float | None = None
    absolute: bool = False
    note: str = ""

    @property
    def fails(self) -> bool:
        """Whether the validation fails because of it."""
        return self.outcome in FAILING or (self.outcome == "new" and self.missed)

    @property
    def missed(self) -> bool:
        """Whether the error is beyond the limit of its case."""
        return self.error is not None and self.allowed is not None and abs(self.error) > self.allowed


# ---- judging ---------------------------------------------------------------------------------------------


def read_baseline(path: Path) -> dict[str, Any]:
    """The record in a file. Raises CaseError if it cannot be read."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        for run in record["runs"].values():
            for entry in run["errors"].values():
                float(entry["error"]), float(entry["noise"])
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        rule = f"holds no readable record ({type(error).__name__})"
        raise CaseError([Problem("--baseline", str(path), rule, f"write one: {RECORD}")]) from error
    return record


def key_of(case: str, run: str) -> str:
    """Name of a run in the record."""
    return f"{case}/{run}"


def judge(entries: Iterable[Mapping[str, Any]], record: Mapping[str, Any], planned: Iterable[str] = ()) -> list[Verdict]:
    """Verdicts on all errors of some runs, and on runs that are missing.

    entries: runs of a table of `validate`, with their rows
    record: see the module
    planned: keys of the runs that should be there, see `key_of`; those without an entry fail
    """
    verdicts = []
    left = dict.fromkeys(planned)
    for entry in entries:
        key = key_of(entry["case"], entry["run"])
        left.pop(key, None)
        known = record["runs"].get(key, {"errors": {}})["errors"]
        if entry["status"] != "finished":
            note = f"{entry['status']}: {entry['problem']}"
            verdicts.append(Verdict(entry["case"], entry["run"], "", "failed", note=note))
            continue
        rows = {row["quantity"]: row for row in entry["rows"] if row["quantity"]}
        for quantity in dict.fromkeys([*rows, *known]):
            verdicts.append(_judge_row(entry, quantity, rows.get(quantity), known.get(quantity)))
    for key in left:
        case, _, run = key.partition("/")
        verdicts.append(Verdict(case, run, "", "failed", note="is on record and was not run"))
    return verdicts


def _judge_row(
    entry: Mapping[str, Any], quantity: str, row: Mapping[str, Any] | None, known: Mapping[str, Any] | None
) -> Verdict:
    """The verdict on one quantity, that has a row, an entry of the record, or both."""
    verdict = Verdict(entry["case"], entry["run"], quantity, "held")
    if known is not None:
        verdict = replace(verdict, recorded=known["error"], noise=known["noise"], absolute=bool(known["absolute"]))
    if row is None:
        return replace(verdict, outcome="missing", note="the case names it no more")
    verdict = replace(verdict, allowed=row["allowed"], absolute=bool(row["absolute"]))
    error = row["error"]
    if error is None or not math.isfinite(error):
        return replace(verdict, outcome="missing", note=str(row["note"]))
    verdict = replace(verdict, error=error)
    if known is None:
        return replace(verdict, outcome="new")
    if bool(known["absolute"]) != verdict.absolute:
        return replace(verdict, outcome="worse", note="recorded in another unit: record it again")
    return replace(verdict, outcome=outcome_of(error, known["error"], known["noise"]))


def outcome_of(error: float, recorded: float, noise: float) -> str:
    """worse, better or held, of finite numbers of either sign."""
    size, before = abs(error), abs(recorded)
    if size > (1.0 + SLACK) * before + noise:
        return "worse"
    return "better" if size < (1.0 - SLACK) * before - noise else "held"


def told(verdict: Verdict) -> list[str]:
    """Cells of a table: case, run, quantity, error, recorded, noise, allowed, verdict."""

    def share(value: float | None) -> str:
        return "" if value is None else f"{value:.3g}" if verdict.absolute else f"{100 * value:.3g} %"

    outcome = verdict.outcome + (", beyond its limit" if verdict.missed else "")
    numbers = [share(value) for value in (verdict.error, verdict.recorded, verdict.noise, verdict.allowed)]
    return [verdict.case, verdict.run, verdict.quantity, *numbers, ": ".join(filter(None, [outcome, verdict.note]))]


# ---- recording -------------------------------------------------------------------------------------------


def variants(runs: Iterable[Planned]) -> list[Planned]:
    """Each run, followed by the disturbed ones that show its noise.

    Displacements are random numbers times start.noise: a little more of it moves each particle a little in its direction.
    Steps that are a little shorter reach runs whose particles the program displaces itself.
    """
    result = []
    for run in runs:
        result.append(run)
        courant = float(derive(run.case, build(run.case, support_radius(run.case))).choices["courant"])
        for times in TIMES:
            changes = {"start.noise": run.case.start.noise + times * DISTURBANCE}
            changes["numerics.courant"] = courant * (1.0 - times * DISTURBANCE)
            case = run.case.replace(changes)
            name = _variant(run.run.name, times)
            result.append(replace(run, run=run.run.model_copy(update={"name": name}), case=case))
    return result


def _variant(run: str, times: int) -> str:
    return f"{run} disturbed {times}"


def record(table: Table, runs: Sequence[Planned], path: Path, whole: bool = False) -> list[Verdict]:
    """Write the errors of `runs` and their `variants` in a table to the record; return the faults that forbid it.

    Other runs that are on record stay there, unless these are the `whole` of all runs.

    Raises OutputError if the file cannot be written.
    """
    entries = {(entry["case"], entry["run"]): entry for entry in table.runs}
    nothing: dict[str, Any] = {"runs": {}}
    names = [(run.case_name, name) for run in runs for name in (run.run.name, *(_variant(run.run.name, n) for n in TIMES))]
    wanted = [key_of(*name) for name in names]
    faults = [verdict for verdict in judge(entries.values(), nothing, wanted) if verdict.outcome in FAILING]
    if faults:
        return faults
    made = provenance()
    found = {}
    for run in runs:
        own = entries[run.case_name, run.run.name]
        others = [entries[run.case_name, _variant(run.run.name, times)] for times in TIMES]
        found[key_of(run.case_name, run.run.name)] = {
            **made,
            "seconds": round(own["seconds"], 1),
            "errors": {row["quantity"]: _recorded(row, others) for row in own["rows"] if row["quantity"]},
        }
    kept: dict[str, Any] = {}
    if not whole:
        with suppress(CaseError):
            kept = read_baseline(path)["runs"]
    keys = ("level", "device", "device_name", "processor", "threads", "versions")
    head = {**made, "command": RECORD, **{key: table.about.get(key) for key in keys}}
    head["noise"] = (
        f"{NOISE_FACTOR:g} times the largest change of an error in runs with more start.noise and shorter steps by "
        f"{', '.join(f'{times * DISTURBANCE:g}' for times in TIMES)}"
    )
    write_text(path, json_text({**head, "runs": dict(sorted({**kept, **found}.items()))}))
    return []


def _recorded(row: Mapping[str, Any], others: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The entry of one error: its noise is that among the same quantity of other runs."""
    samples = [other["error"] for entry in others for other in entry["rows"] if other["quantity"] == row["quantity"]]
    # Errors of both signs are as good as each other, so their sizes are what changes.
    change = max((abs(abs(sample) - abs(row["error"])) for sample in samples), default=0.0)
    return {
        "error": row["error"],
        "noise": NOISE_FACTOR * change,
        "allowed": row["allowed"],
        "absolute": row["absolute"],
        "missed": row["outcome"] == "missed",
        "samples": samples,
    }


# ---- a validation that is held to the record, or makes it --------------------------------------------------


class Held:
    """The runs of the level ci and what becomes of their errors.

    runs: what is to be run, the variants too if they are to be recorded
    seconds: what they took when they were recorded, by the names of runs
    """

    def __init__(self, runs: Sequence[Planned], path: Path | None, recording: bool, whole: bool) -> None:
        """Of planned runs; `whole` if they are all there are, so that what else is on record is missing.

        Raises CaseError if errors are to be held to a record that cannot be read.
        """
        self.path = FILE if path is None else path
        self.recording = recording
        self._planned = list(runs)
        self._whole = whole
        self._faults: list[Verdict] = []
        try:
            self._record = read_baseline(self.path)
        except CaseError:
            if not recording:
                raise
            self._record = {"runs": {}}
        self.runs = variants(runs) if recording else list(runs)
        known = self._record["runs"]
        self.seconds = {}
        for run in self._planned:
            taken = known.get(key_of(run.case_name, run.run.name), {}).get("seconds", math.inf)
            for name in (run.run.name, *(_variant(run.run.name, times) for times in TIMES)):
                self.seconds[f"{run.case_name}-{file_name(name)}"] = taken

    def verdicts(self, table: Table) -> list[Verdict]:
        """On the errors of a table, against the record as it was before; the record is written if that is wanted."""
        if self.recording:
            self._faults = record(table, self._planned, self.path, self._whole)
            if self._faults:
                return self._faults
        planned = [key_of(run.case_name, run.run.name) for run in self._planned]
        own = [entry for entry in table.runs if key_of(entry["case"], entry["run"]) in planned]
        return judge(own, self._record, [*planned, *(self._record["runs"] if self._whole else ())])

    def exit_code(self, verdicts: Iterable[Verdict]) -> int:
        """MISSED if anything fails; of a recording, if a run did not get to its end or an error has no number."""
        faults = self._faults if self.recording else [verdict for verdict in verdicts if verdict.fails]
        return MISSED if faults else 0

    def lines(self, verdicts: Sequence[Verdict]) -> list[str]:
        """How it went, and what is to be done."""
        count = {name: sum(v.outcome == name for v in verdicts) for name in ("held", "better", "new", *FAILING)}
        counts = ", ".join(f"{number} {name}" for name, number in count.items())
        misses = sum(verdict.missed for verdict in verdicts)
        lines = [f"{counts}; {misses} beyond the limit of their case, which is stated for finer runs"]
        if self.recording:
            lines.append("nothing recorded" if self.exit_code(verdicts) else f"recorded in {self.path}")
        elif count["better"] or count["new"]:
            lines.append(f"better or new errors are not held until they are recorded: {RECORD}")
        return lines
