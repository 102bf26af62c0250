"""Sweeps: one case at many points of its parameters, and one table of what was measured.

    output folder/
      sweep.json             the study and the base case, which a folder is held to when the sweep goes on in it
      results/000000.json    one file a run that is done, written whole
      table.csv, table.h5    one row a run
      <measure>.png          the pictures
      runs/000000/           the run folder, with keep_runs

Runs go one after the other in this process, or side by side on the workers of Dask, of this machine or of a scheduler's.
Runs of one structure share their compiled kernels: what a parameter changes is a number, as long as it switches no
effect on or off.
"""

from __future__ import annotations

import gc
import json
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.case.values import suggestion
from warpsph.errors import MISSING, CaseError, DivergenceError, Interrupted, Problem, WallTimeReached, WarpsphError
from warpsph.files.output import json_text
from warpsph.files.whole_files import write_failure, write_text
from warpsph.study.comparison import gauge_number
from warpsph.study.norms import NotComparable
from warpsph.study.provenance import provenance
from warpsph.study.results import Results
from warpsph.study.sweep_file import Measurement, Sweep, load_sweep
from warpsph.study.sweep_pictures import draw_sweep
from warpsph.study.sweep_points import points_of
from warpsph.study.sweep_table import SweepTable

if TYPE_CHECKING:
    from warpsph.simulation import Simulation

PATIENCE = 20.0
"""Seconds to wait for a scheduler."""

LOSSES = 3
"""How many workers may die under a run before it counts as failed."""

WARM_UP = 1e-3
"""Share of the end time of a run after which its warm-up ends."""

SHORT = 1.0
"""s; a run that is shorter is repeated where a sweep asks for it: what else the machine does counts most there."""

_warm: set[tuple[str, str]] = set()
"""What this process has warmed up: device, and the structure (`Spec`) with the gauges. Spacings and densities are
numbers, which ask for no other kernels."""


@dataclass(frozen=True)
class Task:
    """One run of a sweep, as it goes to a worker.

    data, source: the base case as plain data, and the folder of the files that it names
    changes: dotted keys and values of this run
    folder: run folder, None for a run that is not kept
    wall_time: s that it may take
    warm_up: whether to make a few steps first where this process has not run the structure yet
    repeats: times that a run shorter than SHORT is made
    """

    number: int
    data: Mapping[str, Any]
    source: Path | None
    point: Mapping[str, Any]
    changes: Mapping[str, Any]
    measure: Mapping[str, Measurement]
    folder: Path | None
    device: str
    threads: int | None
    wall_time: float | None = None
    warm_up: bool = False
    repeats: int = 1


Finished = Callable[[dict[str, Any], int, int], None]
"""Told of each run that is done: its row, how many are done, how many there are."""


def sweep(
    study: Sweep | Path | str | Mapping[str, Any],
    output: Path | str,
    *,
    device: str = "cpu",
    threads: int | None = None,
    processes: int = 1,
    scheduler: str | None = None,
    retry: bool = False,
    draw: bool = True,
    finished: Finished | None = None,
) -> SweepTable:
    """Run a case at many points of its parameters and return the table.

    Args:
        study: name of a sweep file, or the nested plain data that one would hold, whose case is then looked up in the
            current folder.
        output: folder of the results. A folder of the same sweep goes on: its runs that are done are not made again.
        device: as of `Simulation`.
        threads: CPU threads of a run (default: all processors, divided among the processes).
        processes: runs at the same time on this machine; above 1 a local cluster of Dask.
        scheduler: address of a Dask scheduler, whose workers make the runs instead.
        retry: make runs again that failed before.
        draw: draw the pictures.
        finished: told of each run that is done.

    A run that diverges or fails is a row with its reason and does not stop the others. Ctrl-C ends with what is done
    (`SweepTable.interrupted`).

    Raises:
        CaseError: the study is wrong, no point of it gives a valid case, the device does not exist, the folder is that
            of another sweep, or Dask is needed and missing.
        OutputError: the results cannot be written.
    """
    plan, home = load_sweep(study)
    folder = Path(output)
    case = load_case(home / plan.case)
    points = points_of(plan)
    _check(plan, case, points)
    if threads is None and scheduler is None and processes > 1:
        from warpsph.running.model import default_threads

        threads = max(1, default_threads() // processes)
    _claim(folder, plan, case)
    known = _stored(folder, len(points), retry)
    tasks = [_task(plan, case, folder, number, point, device, threads) for number, point in enumerate(points)]
    left = [task for task in tasks if task.number not in known]
    table = SweepTable(folder, plan.varied, list(plan.measure), len(points))
    table.rows = [known[number] for number in sorted(known)]
    outcomes = _in_turn(left) if processes == 1 and scheduler is None else _on_dask(left, processes, scheduler)
    try:
        for row in outcomes:
            write_text(folder / "results" / f"{row['run']:06d}.json", json_text(row), durable=True)
            known[row["run"]] = row
            table.rows = [known[number] for number in sorted(known)]
            if finished is not None:
                finished(row, len(known), len(points))
    except (Interrupted, KeyboardInterrupt):
        table.interrupted = True
    finally:
        outcomes.close()
        table.write()
    if draw:
        draw_sweep(table)
    return table


def _check(plan: Sweep, case: Case, points: Sequence[Mapping[str, Any]]) -> None:
    """Raise CaseError for measurements of what the case has not, and if no point gives a valid case.

    A setting may add what is measured: looked at is the first valid case of a run, or else the case as it is.
    """
    first: CaseError | None = None
    valid: Case | None = None
    for point in points:
        try:
            valid = _case_at(case, plan.changes(point))
            break
        except CaseError as error:
            first = first or error
    seen = valid or case
    problems = []
    for name, spec in plan.measure.items():
        for kind, known in (("gauge", seen.gauges), ("reference", seen.reference)):
            wanted = getattr(spec, kind)
            if wanted is not None and wanted not in known:
                remedy = suggestion(wanted, known) if known else f"add it to the section {kind} of the case"
                problems.append(Problem(f"measure.{name}.{kind}", wanted, f"{plan.case} has no such {kind}", remedy))
    if problems:
        raise CaseError(problems)
    if valid is None:
        assert first is not None
        raise first


def _case_at(case: Case, changes: Mapping[str, Any]) -> Case:
    """The case of a run. Raises CaseError."""
    return case.replace({"output.checkpoint": "none", **changes})


def _task(
    plan: Sweep, case: Case, folder: Path, number: int, point: Mapping[str, Any], device: str, threads: int | None
) -> Task:
    place = folder.resolve() / "runs" / f"{number:06d}" if plan.keep_runs else None
    source = None if case.source_folder is None else case.source_folder.resolve()
    measure = dict(plan.measure)
    changes = plan.changes(point)
    return Task(
        number, case.to_dict(), source, point, changes, measure, place, device, threads, plan.wall_time, plan.warm_up,
        plan.repeats,
    )  # fmt: skip


# ---- the folder ------------------------------------------------------------------------------------------


def _claim(folder: Path, plan: Sweep, case: Case) -> None:
    """Make the folder and store the study in it, or see that the folder is one of the same study."""
    data = case.to_dict()
    data.pop("validation", None)
    # how long runs may take is no part of what they are: with more of it, and `retry`, a sweep goes on
    study = json.loads(json_text({**plan.to_dict(), "case": data, "wall_time": None}))
    path = folder / "sweep.json"
    try:
        (folder / "results").mkdir(parents=True, exist_ok=True)
        stored = json.loads(path.read_text(encoding="utf-8"))["study"] if path.exists() else None
    except OSError as error:
        raise write_failure(folder, error) from error
    except (ValueError, LookupError, TypeError) as error:
        rule, remedy = "holds no readable sweep.json", "name a new folder"
        raise CaseError([Problem("--output", str(folder), rule, remedy)]) from error
    if stored is None:
        write_text(path, json_text({"study": study, **provenance()}), durable=True)
        return
    old, new = _flat(stored), _flat(study)
    problems = []
    for key in dict.fromkeys([*new, *old]):
        if new.get(key, MISSING) != old.get(key, MISSING):
            before = repr(old[key]) if key in old else "nothing"
            rule = f"the sweep in {folder} was begun with {before}"
            problems.append(Problem(key, new.get(key, MISSING), rule, "put it back, or name a new --output"))
    if problems:
        raise CaseError(problems)


def _flat(data: Any, path: str = "") -> dict[str, Any]:
    """Leaves of nested data by their dotted paths."""
    if isinstance(data, Mapping | list) and data:
        parts = data.items() if isinstance(data, Mapping) else enumerate(data)
        return {name: leaf for key, part in parts for name, leaf in _flat(part, f"{path}.{key}").items()}
    return {path.removeprefix("."): data}


def _stored(folder: Path, count: int, retry: bool) -> dict[int, dict[str, Any]]:
    """The rows of runs that are done, by their numbers; without those that failed if they are to be made again."""
    rows: dict[int, dict[str, Any]] = {}
    for path in sorted((folder / "results").glob("[0-9]*.json")):
        with suppress(OSError, ValueError, LookupError, TypeError):  # what cannot be read is made again
            row = json.loads(path.read_text(encoding="utf-8"))
            if row["run"] < count and not (retry and row["status"] != "finished"):
                rows[row["run"]] = row
    return rows


# ---- the runs --------------------------------------------------------------------------------------------


_Outcomes = Generator[dict[str, Any], None, None]


def _in_turn(tasks: Sequence[Task]) -> _Outcomes:
    """Make one run after the other in this process."""
    for task in tasks:
        yield execute(task)


def _on_dask(tasks: Sequence[Task], processes: int, address: str | None) -> _Outcomes:
    """Make runs on the workers of Dask, in the order of their ends.

    A run whose worker died is given to another one, `LOSSES` times. Workers take one run at a time.
    """
    try:
        import dask
        import distributed
    except ImportError as error:
        option, value = ("--processes", processes) if address is None else ("--scheduler", address)
        rule, remedy = "needs Dask, which is not installed", "pip install 'warpsph-simulator[dask]'"
        raise CaseError([Problem(option, value, rule, remedy)]) from error
    if not tasks:
        return
    dask.config.set({"distributed.scheduler.allowed-failures": LOSSES})
    cluster = None
    if address is None:
        cluster = distributed.LocalCluster(
            n_workers=min(processes, len(tasks)), threads_per_worker=1, processes=True, dashboard_address=None
        )
    try:
        client = distributed.Client(cluster if cluster is not None else address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise CaseError([Problem("--scheduler", address, f"cannot be reached ({error})", "start dask scheduler")]) from error
    try:
        futures = {client.submit(execute, task, pure=False): task for task in tasks}
        for future in distributed.as_completed(futures):
            failure = future.exception()
            yield future.result() if failure is None else _failed_row(futures[future], failure)
            future.release()
    finally:
        client.cancel(list(futures))
        client.close()
        if cluster is not None:
            cluster.close()


def _failed_row(task: Task, error: BaseException) -> dict[str, Any]:
    """The row of a run that gave nothing, e.g. because workers died under it."""
    if isinstance(error, CaseError | Interrupted):
        raise error
    return _row(task, "failed", f"{type(error).__name__}: {error}", {}, {})


def _row(
    task: Task, status: str, problem: str | None, summary: Mapping[str, Any], measured: Mapping[str, float | None]
) -> dict[str, Any]:
    each = summary.get("bytes_per_particle")
    return {
        "run": task.number,
        **task.point,
        **{name: measured.get(name) for name in task.measure},
        "status": status,
        "problem": problem,
        "seconds": summary.get("wall_seconds"),
        "setup_seconds": summary.get("setup_seconds"),
        "cpu_seconds": None,
        **{key: summary.get(key) for key in ("steps", "particles")},
        "memory_bytes": None if each is None else round(each * summary["particles"]),
        "time": summary.get("time"),
    }


def execute(task: Task) -> dict[str, Any]:
    """Make a run and return its row; what workers of Dask call.

    Raises Interrupted, and CaseError if there is no such device; any other error becomes a row.
    """
    simulation: Simulation | None = None
    measured: dict[str, float | None] = {}
    status, problem = "failed", None
    quickest: tuple[float, float] | None = None
    try:
        base = Case.from_dict(task.data, task.source)
        case = _case_at(base, task.changes)
        simulation = _simulation(case, task)
        structure = task.device, f"{simulation.physics.spec} {sorted(case.gauges)}"
        if task.warm_up and structure not in _warm:
            simulation.close()
            _warm_up(case, task)
            _warm.add(structure)
            simulation = _simulation(case, task)  # anew: the wall time is that of the run alone
        begin = time.process_time()
        simulation.run()
        cpu_seconds = time.process_time() - begin
        measured, problem = _measure(task, simulation)
        status = "finished"
        quickest = _repeated(case, task, simulation.summary["wall_seconds"], cpu_seconds)
    except WallTimeReached as error:
        status, problem = "too slow", str(error)
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
    row = _row(task, status, problem, simulation.summary if simulation is not None else {}, measured)
    row |= {} if quickest is None else {"seconds": quickest[0], "cpu_seconds": quickest[1]}
    if simulation is not None:
        simulation.close()
    del simulation
    gc.collect()  # the next run needs the memory of the device
    return row


def _simulation(case: Case, task: Task) -> Simulation:
    """The run of a task, set up. Raises WarpsphError."""
    from warpsph.simulation import Simulation

    return Simulation(
        case, output=_free(task.folder), device=task.device, threads=task.threads, wall_time=task.wall_time
    )


def _repeated(case: Case, task: Task, seconds: float, cpu_seconds: float) -> tuple[float, float]:
    """The least seconds and the least CPU seconds of the runs that a task asks for; the first took those given."""
    best = seconds, cpu_seconds
    for _ in range(task.repeats - 1 if seconds < SHORT else 0):
        simulation = _simulation(case, replace(task, folder=None))
        begin = time.process_time()
        simulation.run()
        now = simulation.summary["wall_seconds"], time.process_time() - begin
        best = min(best[0], now[0]), min(best[1], now[1])
        simulation.close()
    return best


def _warm_up(case: Case, task: Task) -> None:
    """Make the first steps of a run, which compiles and loads its kernels. Raises WarpsphError."""
    from warpsph.simulation import Simulation

    short = case.replace({"end_time": WARM_UP * case.end_time, "reference": {}, "output.particles": "none"})
    Simulation(short, device=task.device, threads=task.threads).run().close()


def _free(folder: Path | None) -> Path | None:
    """The run folder, emptied of what an attempt that was cut off has left."""
    if folder is not None and folder.exists():
        import shutil

        shutil.rmtree(folder, ignore_errors=True)
    return folder


def _measure(task: Task, simulation: Simulation) -> tuple[dict[str, float | None], str | None]:
    """The measurements of a finished run, and why some could not be taken."""
    found: dict[str, float | None] = {}
    notes = []
    source = Results(simulation.case, None, simulation._gauges, None, simulation.model.time)
    for name, spec in task.measure.items():
        if spec.reference is not None:
            entry = simulation.summary["errors"].get(spec.reference, {"error": None, "note": "the reference was taken out"})
            found[name] = entry["error"]
            notes += [f"{name}: {entry['note']}"] if entry["error"] is None else []
            continue
        try:
            found[name] = gauge_number(spec, source)[0]
        except NotComparable as reason:
            found[name] = None
            notes.append(f"{name}: {reason}")
    return found, "; ".join(notes) or None
