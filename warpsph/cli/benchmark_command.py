"""`benchmark`: error against seconds of every sensible choice."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from warpsph.cli.arguments import device_problems, seconds_of, wall_time_problems
from warpsph.cli.options import Debug
from warpsph.cli.reporting import problem, quieten_warp, reported, say
from warpsph.cli.tables import print_table

if TYPE_CHECKING:
    from warpsph.study.benchmark import Benchmark
    from warpsph.study.sweep import Finished


class Effort(StrEnum):
    """How much work a benchmark is."""

    quick = "quick"
    fine = "fine"
    full = "full"


def benchmark(
    names: Annotated[list[str] | None, typer.Argument(metavar="[CASE]...", help="Benchmarks (default: all).")] = None,
    level: Annotated[
        Effort, typer.Option(help="quick: minutes on one thread; fine: minutes on a GPU; full: every choice, hours.")
    ] = Effort.quick,
    device: Annotated[str, typer.Option(help="Device to run on: cpu, cuda:0, ...")] = "cpu",
    threads: Annotated[int, typer.Option(min=1, help="CPU threads of a run.")] = 1,
    processes: Annotated[
        int, typer.Option(min=1, help="Runs at the same time, on a local cluster of Dask; seconds suffer.")
    ] = 1,
    output: Annotated[
        Path | None, typer.Option(help="Output folder; one of the same benchmark goes on (default: benchmark/LEVEL-DEVICE).")
    ] = None,
    record: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Copy front.json to a file.")] = None,
    plans: Annotated[Path | None, typer.Option(help="Folder of plans (default: cases/benchmark of the checkout).")] = None,
    peers: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Figures of other codes (default: benchmarks/peers.json of the checkout)."),
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Make runs again that failed.")] = False,
    wall_time: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Longest time of a run, e.g. 90 or 10m (default: what the plans say)."),
    ] = None,
    draw: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw a picture of each case.")] = True,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check the plans and list the runs.")] = False,
    debug: Debug = False,
) -> None:
    """Measure error against run time of every sensible choice, and mark the front."""
    folder = output if output is not None else Path("benchmark", f"{level.value}-{device.replace(':', '')}")
    with reported(debug, lambda: folder if folder.exists() else None):
        from warpsph.errors import CaseError
        from warpsph.study.benchmark import benchmark as run_benchmark
        from warpsph.study.benchmark_plan import find_plans, planned
        from warpsph.study.sweep_points import points_of

        if dry_run:
            wanted = [planned(name, path, level.value) for name, path in find_plans(names or (), plans).items()]
            rows = [[plan.name, *point.values()] for plan in wanted for point in points_of(plan.sweep)]
            print_table(f"Runs of level {level.value}", ["case", "particle_spacing", "choice"], rows, width=160)
            return
        if problems := [*device_problems(device), *wall_time_problems(wall_time)]:
            raise CaseError(problems)
        others = read_peers(peers)
        quieten_warp(debug)
        found = run_benchmark(
            folder, names or (), level=level.value, device=device, threads=threads, processes=processes, retry=retry,
            wall_time=None if wall_time is None else seconds_of(wall_time), plans=plans, peers=others, draw=draw,
            command=f"python -m warpsph {shlex.join(sys.argv[1:])}", finished=_told,
        )  # fmt: skip
        print_fronts(found)
        for row in found.failed:
            say(f"{row['case']} {row['choice']} at {row['particle_spacing']:g}: {row['status']}: {row['problem']}")
        if record is not None:
            _copy(folder / "front.json", record)
        print(f"{len(found.rows)} runs, {len(found.failed)} failed, {folder / 'front.json'}")
        raise typer.Exit(found.exit_code)


def read_peers(path: Path | None) -> list[dict[str, Any]]:
    """Rows of other codes; none where the default file is not there. Raises CaseError for a file that holds none."""
    from warpsph.errors import CaseError
    from warpsph.study.benchmark_plan import SHIPPED

    file = path if path is not None else SHIPPED.parents[1] / "benchmarks" / "peers.json"
    if path is None and not file.exists():
        return []
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))["rows"]
        return [{**dict(row), "case": row["case"], "error_name": row["error_name"]} for row in rows]
    except (OSError, ValueError, LookupError, TypeError) as error:
        rule = f"holds no readable rows of other codes ({type(error).__name__})"
        raise CaseError([problem("--peers", str(file), rule, "name a file like benchmarks/peers.json")]) from error


def _told(name: str) -> Finished:
    """What prints a line a run of a case."""

    def line(row: dict[str, Any], done: int, total: int) -> None:
        seconds = "" if row["seconds"] is None else f", {row['seconds']:.3g} s"
        run = f"{row['variant']} at {row['particle_spacing']:.4g}"
        print(f"{name} [{done}/{total}] {run}: {row['status']}{seconds}", flush=True)

    return line


def print_fronts(found: Benchmark) -> None:
    """Print every run, those on the front of their case marked."""
    from warpsph.study.fronts import by_case, front

    lines = []
    for name, rows in by_case(found.rows).items():
        best = front(rows)
        for place, row in enumerate(rows):
            error = "" if row["error"] is None else f"{100 * row['error']:.3g} %"
            memory = None if row["memory_bytes"] is None else f"{row['memory_bytes'] / 2**20:.3g}"
            mark = "front" if any(row is other for other in best) else "" if row["status"] == "finished" else row["status"]
            lines.append(
                [name if place == 0 else "", row["choice"], row["particle_spacing"], row["particles"], row["steps"],
                 row["seconds"], memory, error, mark]
            )  # fmt: skip
    head = ["case", "choice", "spacing", "particles", "steps", "seconds", "MiB", "error", ""]
    print_table("Error against seconds", head, lines, align="llrrrrrrl", width=140)


def _copy(source: Path, target: Path) -> None:
    """Copy the record. Raises OutputError."""
    from warpsph.files.whole_files import write_failure

    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
    except OSError as error:
        raise write_failure(target, error) from error
