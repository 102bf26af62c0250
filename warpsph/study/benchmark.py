"""Benchmarks: error against seconds of every sensible choice in every case of `cases/benchmark`.

    output folder/
      front.json        every run: settings, seconds, steps, particles, memory, errors; machine, commit, command
      <case>.png        error over seconds, with the front
      <case>/           the sweep of the case, which goes on where it was stopped

Each case is one sweep, a choice at each resolution, in this process one after the other or on the workers of Dask.
Kernels are compiled before a run is timed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from warpsph.errors import CaseError, Interrupted, Problem
from warpsph.files.output import json_text
from warpsph.files.whole_files import write_text
from warpsph.study.benchmark_pictures import draw_case
from warpsph.study.benchmark_plan import LEVELS, Planned, find_plans, planned
from warpsph.study.fronts import by_case, seconds_of
from warpsph.study.provenance import provenance
from warpsph.study.sweep import Finished, sweep
from warpsph.study.sweep_file import VARIANT

COPIED = (
    "status", "problem", "setup_seconds", "cpu_seconds", "steps", "particles", "memory_bytes",
)  # fmt: skip
"""Columns of a sweep that a row of a benchmark has as they are."""


@dataclass
class Benchmark:
    """What a benchmark has given.

    about: commit, date, command, level, device, threads, machine
    cases: by case what its plan says: `says`, `error`, `error_name`, `peer_errors`
    rows: one dict a run: case, choice, changes (dotted keys of the choice), particle_spacing (m), precision, device,
        threads, seconds (see `seconds_of`) and wall_seconds of the run without set-up and compilation, the columns of COPIED
        (`cpu_seconds` are those of all threads, `memory_bytes` those of the arrays of particles and lists on the device),
        errors, error
    """

    about: dict[str, Any]
    cases: dict[str, dict[str, Any]] = field(default_factory=dict)
    rows: list[dict[str, Any]] = field(default_factory=list)
    interrupted: bool = False

    @property
    def failed(self) -> list[dict[str, Any]]:
        """Rows of runs that did not get to their end."""
        return [row for row in self.rows if row["status"] != "finished"]

    @property
    def exit_code(self) -> int:
        """130 after Ctrl-C, 6 if a run failed, else 0."""
        return Interrupted.exit_code if self.interrupted else 6 if self.failed else 0

    def to_dict(self) -> dict[str, Any]:
        """Plain data as front.json holds it."""
        return {**self.about, "interrupted": self.interrupted, "cases": self.cases, "rows": self.rows}


def read_benchmark(path: Path) -> Benchmark:
    """The benchmark in a file. Raises CaseError if it holds none."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        cases, rows, interrupted = data.pop("cases"), data.pop("rows"), data.pop("interrupted")
        return Benchmark(data, cases, rows, interrupted)
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        rule = f"holds no readable benchmark ({type(error).__name__})"
        raise CaseError([Problem("--json", str(path), rule, "name a front.json of `warpsph benchmark`")]) from error


def benchmark(
    output: Path | str,
    names: Sequence[str] = (),
    *,
    level: str = "quick",
    device: str = "cpu",
    threads: int | None = 1,
    processes: int = 1,
    retry: bool = False,
    wall_time: float | None = None,
    plans: Path | None = None,
    peers: Sequence[Mapping[str, Any]] = (),
    draw: bool = True,
    command: str = "",
    finished: Callable[[str], Finished] | None = None,
) -> Benchmark:
    """Run cases with every choice of their plans and return error and seconds of each run.

    Args:
        output: folder of the results. The same benchmark goes on there: runs that are done are not made again.
        names: benchmarks, by the names of their plans (default: all).
        level: quick, minutes on one thread; fine, minutes on a GPU; or full, every choice at every resolution, hours.
        device: as of `Simulation`.
        threads: CPU threads of a run.
        processes: runs at the same time on this machine, which their seconds suffer from; above 1 a local cluster of Dask.
        retry: make runs again that failed before.
        wall_time: s that a run may take, with what sets it up (default: what the plan says); one that takes longer is a row
            with the status `too slow`.
        plans: folder of plans (default: those of the checkout).
        peers: rows of other codes for the pictures.
        draw: draw the pictures.
        command: what is noted as the command.
        finished: called with the name of a case, returns what is told of each run that is done.

    A run that diverges, fails or takes too long is a row with its reason. Ctrl-C ends with what is done.

    Raises:
        CaseError: there is no such level or benchmark, a plan is wrong, the device does not exist, or the folder holds
            another benchmark.
        OutputError: the results cannot be written.
    """
    if level not in LEVELS:
        raise CaseError([Problem("--level", level, "there is no such level", f"choose from: {', '.join(LEVELS)}")])
    wanted = [planned(name, path, level) for name, path in find_plans(names, plans).items()]
    folder = Path(output)
    result = Benchmark(_about(command, level, device, threads, processes))
    for plan in wanted:
        limited = plan.sweep if wall_time is None else plan.sweep.model_copy(update={"wall_time": wall_time})
        table = sweep(
            limited, folder / plan.name, device=device, threads=threads, processes=processes, retry=retry, draw=False,
            finished=None if finished is None else finished(plan.name),
        )  # fmt: skip
        result.cases[plan.name] = {
            "says": plan.plan.says, "error": plan.plan.error, "error_name": plan.plan.error_name,
            "peer_errors": list(plan.plan.peer_errors),
        }  # fmt: skip
        result.rows += [_row(plan, row, device, threads) for row in table.rows]
        result.interrupted = table.interrupted
        write_text(folder / "front.json", json_text(result.to_dict()))
        if result.interrupted:
            break
    if draw:
        draw_benchmark(result, folder, peers)
    return result


def draw_benchmark(found: Benchmark, folder: Path, peers: Sequence[Mapping[str, Any]] = ()) -> list[Path]:
    """Draw a picture a case into a folder and return the files. Raises OutputError."""
    written = []
    for name, rows in by_case(found.rows).items():
        path = draw_case(folder / f"{name}.png", name, found.cases[name], rows, peers)
        written += [] if path is None else [path]
    return written


def _about(command: str, level: str, device: str, threads: int | None, processes: int) -> dict[str, Any]:
    """Which code, machine and command."""
    from warpsph import __version__
    from warpsph.running.summary import device_name, machine, versions

    return {
        **provenance(),
        "command": command,
        "level": level,
        "device": device,
        "device_name": device_name(device),
        "threads": threads,
        "processes": processes,
        "machine": machine(),
        "versions": {"warpsph": __version__, **versions()},
    }


def _row(plan: Planned, row: Mapping[str, Any], device: str, threads: int | None) -> dict[str, Any]:
    """A row of the benchmark from one of a sweep."""
    changes = dict(plan.plan.choices[row[VARIANT]])
    errors = {name: row[name] for name in plan.plan.errors}
    return {
        "case": plan.name,
        "choice": row[VARIANT],
        "changes": changes,
        "particle_spacing": row["particle_spacing"],
        "precision": changes.get("precision", plan.case.precision),
        "device": device,
        "threads": threads,
        "seconds": seconds_of(row, device == "cpu" and threads == 1),
        "wall_seconds": row["seconds"],
        **{key: row[key] for key in COPIED},
        "errors": errors,
        "error": plan.plan.judged(errors),
    }
