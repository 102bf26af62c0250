"""Validation: run cases at a level of effort, compare each with its reference, and keep one table of it all.

The runs of a case stand in its `validation` section: at each level a list of names with changes to the case. A case
without one has the run `default`, the file as it is, at the level quick.

    output folder/
      table.json                  rows and runs, the machine, the command
      table.md                    the rows as a Markdown table
      <case>-<run>.png            the figure of a run
      runs/<case>-<run>/          its run folder

The table is written anew after each run, so that what is done is kept whatever happens next.
"""

from __future__ import annotations

import fnmatch
import gc
import json
import math
import multiprocessing
import re
import shutil
import time
import traceback
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.case.plain import set_path
from warpsph.case.validation_runs import VALIDATION_LEVELS, ValidationRun
from warpsph.case.values import suggestion
from warpsph.errors import CaseError, DivergenceError, Interrupted, OutputError, Problem, WarpsphError
from warpsph.files.output import json_text
from warpsph.files.whole_files import make_folder, write_text
from warpsph.study import figures
from warpsph.study.comparison import definition_of
from warpsph.study.provenance import provenance

if TYPE_CHECKING:
    from warpsph.simulation import Progress, Simulation

MISSED = 6
"""Exit code of `validate` when a quantity missed what is allowed, or a run did not get to its end."""

BAD = ("missed", "diverged", "failed")
"""Outcomes that make a validation fail."""

COLUMNS = (
    "case", "run", "quantity", "value", "reference", "error", "allowed", "outcome", "particles", "steps", "seconds",
)  # fmt: skip
ALIGN = "lllrrrrlrrr"
"""Columns of the table, and whether each stands left or right."""

SHIPPED = Path(__file__).resolve().parents[2] / "cases"
"""The case files of a checkout, beside the package."""


# ---- which runs ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Planned:
    """One run to come: `case` has the changes of `run` in it and of `validation` the figure alone."""

    case_name: str
    level: str
    run: ValidationRun
    case: Case

    @property
    def name(self) -> str:
        """`<case>-<run>`, as files and folders are called."""
        return f"{self.case_name}-{file_name(self.run.name)}"


def file_name(run: str) -> str:
    """Name of a run with _ for what a file name should not hold."""
    return re.sub(r"[^A-Za-z0-9.+=-]", "_", run)


def find_cases(places: Sequence[Path] = ()) -> dict[str, Path]:
    """Case files by name: those of each folder, and each file that is named itself (default: the shipped ones).

    Raises CaseError if a place does not exist or has no case files, or two files have one name.
    """
    found: dict[str, Path] = {}
    problems = []
    for place in places or (SHIPPED,):
        files = [place] if place.is_file() else sorted(place.glob("*.yaml"))
        if not files:
            rule = "holds no *.yaml files" if place.is_dir() else "no such file or folder"
            remedy = "name a case file or a folder of them; the shipped cases come with a checkout of the project"
            problems.append(Problem("--cases", str(place), rule, remedy))
        for file in files:
            if file.stem in found:
                problems.append(Problem("--cases", str(file), f"{found[file.stem]} has the same name", "rename one"))
            found.setdefault(file.stem, file)
    if problems:
        raise CaseError(problems)
    return found


def case_of(case: Case, run: ValidationRun) -> Case:
    """The case of a validation run. Raises CaseError, with the paths of the changed case."""
    data = case.to_dict()
    section = data.pop("validation", {})
    if section.get("figure") is not None:
        data["validation"] = {"figure": section["figure"]}
    problems = []
    for path, value in run.changes.items():
        try:
            set_path(data, path, value)
        except CaseError as error:
            problems += error.problems
    if problems:
        raise CaseError(problems)
    return Case.from_dict(data, case.source_folder)


def runs_of(case: Case, name: str, levels: Iterable[str] = VALIDATION_LEVELS) -> list[Planned]:
    """The runs of a case at some levels. Raises CaseError that names every bad change in the words of the file."""
    planned, problems = [], []
    for level in levels:
        for position, run in enumerate(getattr(case.validation, level)):
            try:
                planned.append(Planned(name, level, run, case_of(case, run)))
            except CaseError as error:
                place = f"validation.{level}.{position}.changes"
                problems += [_of_change(problem, place, run) for problem in error.problems]
    if problems:
        raise CaseError(problems)
    return planned


def _of_change(problem: Problem, place: str, run: ValidationRun) -> Problem:
    """A problem of a changed case as one of the change that made it."""
    for key, value in run.changes.items():
        if f"{problem.path}.".startswith(f"{key}."):
            return replace(problem, path=f"{place}.{problem.path}")
        if f"{key}.".startswith(f"{problem.path}."):
            rule = f"{problem.path} then {problem.rule}"
            return Problem(f"{place}.{key}", value, rule, problem.remedy)
    return replace(problem, path=place, rule=f"{problem.path} then {problem.rule}")


def plan(
    level: str, names: Sequence[str] = (), places: Sequence[Path] = (), precision: str | None = None
) -> list[Planned]:
    """The runs of a level, in the order of the case names.

    level: one of VALIDATION_LEVELS
    names: cases, or single runs as `<case>-<run>`; * and ? stand for anything (default: all cases)
    places: see `find_cases`
    precision: float32 or float64 instead of what the cases say

    Raises CaseError with all that is wrong: an unknown name, one without runs at this level, a bad case or change.
    """
    files = find_cases(places)
    problems: list[Problem] = []
    loaded: dict[str, Case | None] = {}
    planned: dict[str, Planned] = {}

    def load(name: str) -> Case | None:
        if name not in loaded:
            try:
                loaded[name] = load_case(files[name])
            except CaseError as error:
                loaded[name] = None
                problems.extend(replace(p, path=f"{files[name].name}: {p.path}") for p in error.problems)
        return loaded[name]

    for name in names or ("*",):
        chosen = _choose(name, files)
        if not chosen:
            problems.append(Problem("NAME", name, "there is no such case", suggestion(name, files)))
        before, faults = len(planned), len(problems)
        there: list[str] = []
        for stem, pattern in chosen.items():
            case = load(stem)
            if case is None:
                continue
            try:
                runs = runs_of(case, stem, [level])
            except CaseError as error:
                problems += [replace(p, path=f"{files[stem].name}: {p.path}") for p in error.problems]
                continue
            there += [f"{file_name(run.name)} ({at})" for at in VALIDATION_LEVELS for run in getattr(case.validation, at)]
            for run in runs:
                if fnmatch.fnmatchcase(file_name(run.run.name), pattern):
                    planned[run.name] = run
        if chosen and len(planned) == before and len(problems) == faults and names:
            if not any(run.case_name in chosen for run in planned.values()):
                rule, remedy = f"has no such run at the level {level}", f"there are {', '.join(there)}"
                problems.append(Problem("NAME", name, rule, remedy))
    if problems:
        raise CaseError(list(dict.fromkeys(problems)))
    order = {name: position for position, name in enumerate(files)}
    result = sorted(planned.values(), key=lambda run: order[run.case_name])
    if precision is not None:
        result = [replace(run, case=run.case.replace({"precision": precision})) for run in result]
    if not result:
        raise CaseError([Problem("--level", level, "no case has runs at this level", "choose another level")])
    return result


def _choose(name: str, files: Iterable[str]) -> dict[str, str]:
    """The cases that a name means, each with the pattern of its runs."""
    whole = {stem: "*" for stem in files if fnmatch.fnmatchcase(stem, name)}
    if whole:
        return whole
    cuts = [place for place, letter in enumerate(name) if letter == "-"]
    pairs = [(name[:cut], name[cut + 1 :]) for cut in cuts]
    return {stem: run for stem in files for case, run in pairs if fnmatch.fnmatchcase(stem, case)}


# ---- the table -------------------------------------------------------------------------------------------


@dataclass
class Table:
    """What has been done.

    about: command, level, device, machine, versions
    runs: one dict a run, with its `rows`
    interrupted: whether the user stopped before the last run
    notes: what could not be drawn, and why
    """

    about: dict[str, Any]
    runs: list[dict[str, Any]] = field(default_factory=list)
    interrupted: bool = False
    notes: list[str] = field(default_factory=list)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of all runs, each with what the columns of COLUMNS need."""
        shared = ("case", "run", "particles", "steps", "seconds", "precision")
        return [{**{key: run[key] for key in shared}, **row} for run in self.runs for row in run["rows"]]

    @property
    def bad(self) -> list[dict[str, Any]]:
        """The rows that are not within what is allowed."""
        return [row for row in self.rows if row["outcome"] in BAD]

    @property
    def exit_code(self) -> int:
        """130 after Ctrl-C, MISSED if anything was missed, else 0."""
        return Interrupted.exit_code if self.interrupted else MISSED if self.bad else 0

    def write(self, folder: Path) -> None:
        """Write table.json and table.md into a folder. Raises OutputError."""
        runs = [{key: value for key, value in run.items() if key != "rows"} for run in self.runs]
        data = {**self.about, "interrupted": self.interrupted, "rows": self.rows, "runs": runs}
        write_text(folder / "table.json", json_text(data))
        write_text(folder / "table.md", self.markdown())

    @classmethod
    def read(cls, folder: Path) -> Table:
        """The table in a folder. Raises CaseError if there is none."""
        path = folder / "table.json"
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            runs = [{**run, "rows": []} for run in data.pop("runs")]
            places = {(run["case"], run["run"]): run for run in runs}
            for row in data.pop("rows"):
                kept = {key: row.get(key) for key in _ROW}
                places[row["case"], row["run"]]["rows"].append(kept)
        except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
            rule = f"holds no readable table.json ({type(error).__name__})"
            raise CaseError([Problem("FOLDER", str(folder), rule, "name the output folder of a validate")]) from error
        return cls(data, runs, data.pop("interrupted", False))

    def markdown(self) -> str:
        """The rows as a Markdown table."""
        bars = ["---" if side == "l" else "---:" for side in ALIGN]
        lines = [COLUMNS, bars, *(cells(row, first) for row, first in with_first(self.rows))]
        return "".join("| " + " | ".join(_escaped(cell) for cell in line) + " |\n" for line in lines)


_ROW = ("quantity", "value", "reference", "error", "allowed", "absolute", "outcome", "unit", "note", "source", "definition")


def _escaped(cell: str) -> str:
    return cell.replace("|", "\\|")


def with_first(rows: Iterable[dict[str, Any]]) -> list[tuple[dict[str, Any], bool]]:
    """Each row and whether it is the first one of its run."""
    result, last = [], None
    for row in rows:
        result.append((row, (row["case"], row["run"]) != last))
        last = row["case"], row["run"]
    return result


def cells(row: Mapping[str, Any], first: bool = True) -> list[str]:
    """Text of a row's cells, by COLUMNS; what belongs to the run is left out unless it is its first row."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.5g}"

    def share(value: float | None) -> str:
        return "" if value is None else f"{value:.3g}" if row["absolute"] else f"{100 * value:.3g} %"

    def count(value: int | None) -> str:
        return "" if value is None else f"{value:,}".replace(",", " ")

    unit = row["unit"]
    seconds = row["seconds"]
    return [
        row["case"] if first else "",
        row["run"] if first else "",
        row["quantity"] + (f" [{unit}]" if unit not in ("", "1") else ""),
        number(row["value"]),
        number(row["reference"]),
        share(row["error"]),
        share(row["allowed"]),
        row["outcome"],
        count(row["particles"]) if first else "",
        count(row["steps"]) if first else "",
        "" if not first or seconds is None else f"{seconds:.1f}" if seconds < 100 else f"{seconds:.0f}",
    ]


def rows_of(errors: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The rows of a run from the `errors` of its summary.

    A quantity with a limit and without a number, e.g. because the run ended too early, counts as missed.
    """
    rows = []
    for quantity, entry in errors.items():
        error, allowed = entry["error"], entry["allowed"]
        known = error is not None and math.isfinite(error)
        if allowed is not None:
            outcome = "ok" if known and abs(error) <= allowed else "missed"
        else:
            outcome = "no limit" if known else "no value"
        rows.append(
            {
                "quantity": quantity,
                **{key: entry[key] for key in ("value", "reference", "error", "allowed", "unit", "note", "source")},
                "absolute": str(entry["note"]).startswith("absolute"),
                "outcome": outcome,
            }
        )
    if not rows:
        rows.append(_row_without("no reference", "the case is compared with nothing"))
    return rows


def _row_without(outcome: str, note: str) -> dict[str, Any]:
    """The row of a run that has no quantities."""
    row: dict[str, Any] = dict.fromkeys(_ROW)
    return row | {"quantity": "", "unit": "", "absolute": False, "outcome": outcome, "note": note}


# ---- running ---------------------------------------------------------------------------------------------


Started = Callable[[Planned, int, int], AbstractContextManager[Callable[["Progress"], None] | None]]
"""Told of a run that begins, its number from 1 and how many there are; gives a context with the run's progress."""


def validate(
    runs: Sequence[Planned],
    folder: Path,
    *,
    device: str = "cpu",
    threads: int | None = None,
    command: str = "",
    processes: int = 1,
    seconds: Mapping[str, float] | None = None,
    draw: bool = True,
    keep: bool = True,
    earlier: Table | None = None,
    started: Started | None = None,
    finished: Callable[[dict[str, Any]], None] | None = None,
) -> Table:
    """Run one after another, or several at a time, and write table and figures after each.

    runs: see `plan`
    folder: output folder; made if it is not there
    device, threads: as of `Simulation`; the threads are those of each run
    processes: how many runs are made at the same time, each by a process of its own
    seconds: what runs are expected to take, by their names: of runs at the same time the longest begin first
    command: command line, for the table
    draw: draw the figures; without matplotlib they are left out with a note
    keep: keep the run folders
    earlier: table of this folder to go on from: its finished runs count, the others are run again
    started, finished: told of each run, before and after; `finished` gets its entry of the table. Of runs at the same
        time only the end is told

    Returns the table. A run that diverges or fails in another way is a row and does not stop the others; Ctrl-C ends
    with what is done. Raises CaseError if there is no such device, OutputError if the table cannot be written.
    """
    table = Table(_about(runs, device, threads, command))
    if earlier is not None:
        table.about = {**earlier.about, **provenance(), "command": command}
        table.runs = [run for run in earlier.runs if run["status"] == "finished"]
    done = {(run["case"], run["run"]) for run in table.runs}
    if draw and not figures.can_draw():
        draw = False
        table.notes.append(f"matplotlib is not installed: no figures; draw them later with --figures-from {folder}")
    make_folder(folder)
    left = [run for run in runs if (run.case_name, run.run.name) not in done]
    places = {run.name: _free(folder / "runs" / run.name) for run in left}
    if processes > 1:
        expected = seconds or {}
        left.sort(key=lambda run: expected.get(run.name, 0.0), reverse=True)
        outcomes = _side_by_side(left, places, table.about, device, threads, processes)
    else:
        outcomes = _in_turn(left, places, table.about, device, threads, len(done), started)
    try:
        for run, entry in outcomes:
            place = places[run.name]
            table.runs.append({**entry, "folder": place.relative_to(folder).as_posix()})
            table.write(folder)
            if finished is not None:
                finished(table.runs[-1])
            if draw:
                note = _draw(folder, table.runs[-1], ())
                table.notes += [note] if note else []
            if not keep:
                shutil.rmtree(place, ignore_errors=True)
    except (Interrupted, KeyboardInterrupt):
        table.interrupted = True
    finally:
        outcomes.close()
    if processes > 1:  # in the order of the plan, not of their ends
        order = {(run.case_name, run.run.name): position for position, run in enumerate(runs)}
        table.runs.sort(key=lambda entry: order.get((entry["case"], entry["run"]), len(order)))
    table.write(folder)
    return table


_Outcomes = Generator[tuple[Planned, dict[str, Any]], None, None]


def _in_turn(
    runs: Sequence[Planned],
    places: Mapping[str, Path],
    about: dict[str, Any],
    device: str,
    threads: int | None,
    done: int,
    started: Started | None,
) -> _Outcomes:
    """Make one run after the other in this process; `done` is how many were made before."""
    for number, run in enumerate(runs, done + 1):
        with started(run, number, done + len(runs)) if started is not None else nullcontext() as progress:
            entry = _execute(run, places[run.name], about, device, threads, progress)
        yield run, entry


def _side_by_side(
    runs: Sequence[Planned],
    places: Mapping[str, Path],
    about: dict[str, Any],
    device: str,
    threads: int | None,
    processes: int,
) -> _Outcomes:
    """Make several runs at the same time, each in a process of its own, in the order of their ends.

    The processes are started anew: those that are forked would share what Warp holds of the device.
    """
    pool = ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn"))
    try:
        jobs = {pool.submit(_execute_apart, run, places[run.name], device, threads): run for run in runs}
        for job in as_completed(jobs):
            try:
                entry, machine = job.result()
            except BrokenProcessPool as error:
                rule = "a process ended without a result, perhaps for want of memory: lower --processes"
                raise WarpsphError(rule) from error
            about.update(machine)
            yield jobs[job], entry
    finally:
        pool.shutdown(cancel_futures=True)


def _execute_apart(
    run: Planned, folder: Path, device: str, threads: int | None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """`_execute` in a process of its own; the entry, and what it tells of the machine."""
    from warpsph.running.model import quiet_warp

    quiet_warp(device)
    machine: dict[str, Any] = {}
    return _execute(run, folder, machine, device, threads, None), machine


def _about(runs: Sequence[Planned], device: str, threads: int | None, command: str) -> dict[str, Any]:
    levels = dict.fromkeys(run.level for run in runs)
    return {
        **provenance(),
        "command": command,
        "level": ", ".join(levels),
        "device": device,
        "device_name": None,
        "processor": None,
        "system": None,
        "threads": threads,
        "versions": {},
    }


def _free(folder: Path) -> Path:
    """The folder, or the first free one with a number behind its name."""
    number = 1
    free = folder
    while free.exists():
        number += 1
        free = folder.with_name(f"{folder.name}_{number}")
    return free


def _execute(
    run: Planned,
    folder: Path,
    about: dict[str, Any],
    device: str,
    threads: int | None,
    progress: Callable[[Progress], None] | None,
) -> dict[str, Any]:
    """Run, and return the entry of the table; `about` gets the names of the machine.

    Raises Interrupted; any other error becomes a row.
    """
    from warpsph.simulation import Simulation

    case = run.case.replace({"output.checkpoint": "none"})
    simulation: Simulation | None = None
    rows, status, problem = [], "failed", None
    begin = time.perf_counter()
    try:
        preparing = getattr(progress, "preparing", None)
        simulation = Simulation(case, output=folder, device=device, threads=threads, preparing=preparing)
        simulation.run(progress=progress)
        rows, status = rows_of(simulation.summary["errors"]), "finished"
        for row in rows:
            row["definition"] = definition_of(case, row["quantity"]) if row["quantity"] in case.reference else None
    except Interrupted:
        raise
    except DivergenceError as error:
        status, problem = "diverged", str(error)
    except WarpsphError as error:
        if isinstance(error, CaseError) and any(entry.path == "device" for entry in error.problems):
            raise
        problem = str(error)
    except Exception as error:  # whatever it is, it must not cost the other runs
        problem = f"{type(error).__name__}: {error}"
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "traceback.txt").write_text(traceback.format_exc(), encoding="utf-8")
    if problem is not None:
        rows = [_row_without(status, problem)]
    summary = simulation.summary if simulation is not None else {}
    if summary:
        machine = summary["machine"]
        about.update(
            device_name=summary["device_name"], processor=machine["processor"], system=machine["system"],
            threads=summary["threads"], versions={**summary["versions"], "python": machine["python"]},
        )  # fmt: skip
    entry = {
        "case": run.case_name,
        "run": run.run.name,
        "level": run.level,
        "title": case.title,
        "changes": dict(run.run.changes),
        "precision": case.precision,
        "status": status,
        "problem": problem,
        **{key: summary.get(key) for key in ("particles", "fluid_particles", "steps", "time", "setup_seconds")},
        "seconds": summary.get("wall_seconds", time.perf_counter() - begin),
        "mups": summary.get("mups"),
        "warnings": summary.get("warnings", []),
        "rows": rows,
    }
    if simulation is not None:
        simulation.close()
    del simulation
    gc.collect()  # the next run needs the memory of the device
    return entry


# ---- figures ---------------------------------------------------------------------------------------------


def draw_figures(folder: Path, references: Sequence[Path] = (SHIPPED / "reference",)) -> tuple[list[Path], list[str]]:
    """Draw the figures of an output folder whose run folders were kept; return the files and what went wrong.

    references: folders with the reference files, for runs that were computed on another machine

    Raises CaseError if the folder holds no table, or matplotlib is missing.
    """
    if not figures.can_draw():
        raise CaseError([Problem("--figures-from", str(folder), "needs matplotlib", "pip install matplotlib")])
    table = Table.read(folder)
    written, notes = [], []
    for entry in table.runs:
        note = _draw(folder, entry, references)
        if note:
            notes.append(note)
        else:
            written.append(_figure(folder, entry))
    return written, notes


def _figure(folder: Path, entry: Mapping[str, Any]) -> Path:
    return folder / f"{entry['case']}-{file_name(entry['run'])}.png"


def _draw(folder: Path, entry: Mapping[str, Any], references: Sequence[Path]) -> str:
    """Draw the figure of a run; return why it could not be drawn, else an empty text."""
    place = folder / entry["folder"]
    title = f"{entry['title'] or entry['case']}, {entry['run']}"
    if entry["status"] != "finished":
        title += f" ({entry['status']})"
    try:
        case = figures.case_of_run(place, references)
        figures.draw_validation(place, case, title, _figure(folder, entry))
    except (WarpsphError, OSError, ValueError, ArithmeticError) as error:
        return f"no figure of {entry['case']} {entry['run']}: {error}"
    return ""


def output_folder(level: str, device: str) -> Path:
    """The first free one of validation/<level>-<device>, ..._2 and so on; it is made.

    Raises OutputError if it cannot be.
    """
    folder = Path("validation", f"{level}-{device.replace(':', '')}")
    while True:
        free = _free(folder)
        try:
            free.mkdir(parents=True)
            return free
        except FileExistsError:
            continue
        except OSError as error:
            raise OutputError(f"cannot create the output folder {free}: {error.strerror}") from error


def check_continued(folder: Path, level: str, device: str) -> Table:
    """The table of a folder that is to be completed. Raises CaseError if it was made in another way."""
    table = Table.read(folder)
    problems = []
    for key, value in (("level", level), ("device", device)):
        if table.about.get(key) != value:
            rule, remedy = f"the folder was made with {table.about.get(key)}", "repeat its options, or name a new folder"
            problems.append(Problem(f"--{key}", value, rule, remedy))
    if problems:
        raise CaseError(problems)
    return table


def problem_lines(table: Table) -> list[str]:
    """One line for each run that did not get to its end, and for each quantity without a number."""
    lines = [f"{run['case']} {run['run']}: {run['status']}: {run['problem']}" for run in table.runs if run["problem"]]
    for row in table.rows:
        if row["quantity"] and row["error"] is None and row["note"]:
            lines.append(f"{row['case']} {row['run']}, {row['quantity']}: {row['note']}")
    return lines


