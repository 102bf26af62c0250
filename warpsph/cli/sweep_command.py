"""`sweep`: one case at many points of its parameters."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from warpsph.cli.arguments import device_problems
from warpsph.cli.options import Debug
from warpsph.cli.reporting import quieten_warp, reported, say
from warpsph.cli.tables import console, print_table


def sweep(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="File of the sweep (YAML).", show_default=False)],
    output: Annotated[
        Path | None, typer.Option(help="Output folder; one of the same sweep goes on (default: sweeps/STUDY).")
    ] = None,
    device: Annotated[str, typer.Option(help="Device to run on: cpu, cuda:0, ...")] = "cpu",
    threads: Annotated[
        int | None, typer.Option(min=1, help="CPU threads of a run (default: all, divided among the processes).")
    ] = None,
    processes: Annotated[int, typer.Option(min=1, help="Runs at the same time, on a local cluster of Dask.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers make the runs.")
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Make runs again that failed.")] = False,
    draw: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw a figure of each measurement.")] = True,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check the study and list the runs.")] = False,
    debug: Debug = False,
) -> None:
    """Run a case at many points of its parameters; one table of what is measured."""
    folder = output if output is not None else Path("sweeps", study.stem)
    with reported(debug, lambda: folder if folder.exists() else None):
        from warpsph.errors import CaseError
        from warpsph.study.sweep import sweep as run_sweep
        from warpsph.study.sweep_file import load_sweep
        from warpsph.study.sweep_points import points_of

        plan, _ = load_sweep(study)
        points = points_of(plan)
        if dry_run:
            rows = [[number, *point.values()] for number, point in enumerate(points)]
            print_table(f"Runs of {study.name}", ["run", *plan.parameters], rows, width=160)
            return
        # The workers of a scheduler have devices of their own.
        problems = device_problems(device) if scheduler is None else []
        if problems:
            raise CaseError(problems)
        quieten_warp(debug)
        with _progress(len(points)) as finished:
            table = run_sweep(
                study, folder, device=device, threads=threads, processes=processes, scheduler=scheduler,
                retry=retry, draw=draw, finished=finished,
            )  # fmt: skip
        for row in table.rows:
            if row["problem"]:
                say(f"run {row['run']}: {row['status']}: {row['problem']}")
        facts = f"{len(table.rows)} runs, {len(table.failed)} failed, {folder / 'table.csv'}"
        print(facts + (" (interrupted)" if table.interrupted else ""))
        raise typer.Exit(130 if table.interrupted else 6 if table.failed else 0)


@contextmanager
def _progress(count: int) -> Iterator[Callable[[dict[str, Any], int, int], None]]:
    """Callback that shows how many runs are done: a bar on a terminal, else a line a run."""
    if not sys.stdout.isatty():
        yield lambda row, done, total: print(f"[{done}/{total}] run {row['run']}: {row['status']}", flush=True)
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console()) as progress:
        task = progress.add_task("", total=count)
        yield lambda row, done, total: progress.update(task, completed=done, total=total)
