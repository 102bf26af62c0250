"""`validate`: cases against their references."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated, Any

import typer

from warpsph.cli.arguments import device_problems, output_problems
from warpsph.cli.options import Debug, Level, PrecisionOption
from warpsph.cli.progress import progress_display
from warpsph.cli.reporting import problem, quieten_warp, reported, say
from warpsph.cli.tables import duration, print_table


def validate(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", help="Cases, or single runs as CASE-RUN; * and ? stand for anything."),
    ] = None,
    level: Annotated[
        Level,
        typer.Option(
            help="How much work: minutes on a CPU, as in the published study, finer; ci: seconds, errors held to a record."
        ),
    ] = Level.quick,
    device: Annotated[str, typer.Option(help="Device to run on: cpu, cuda:0, ...")] = "cpu",
    precision: PrecisionOption = None,
    threads: Annotated[
        int | None, typer.Option(min=1, help="CPU threads of a run (default: all; 1 of several runs at a time).")
    ] = None,
    processes: Annotated[int, typer.Option(min=1, help="Runs at the same time.")] = 1,
    cases: Annotated[
        list[Path] | None, typer.Option(help="Folder of case files, or a case file (default: the shipped ones).")
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Output folder, new or empty (default: validation/LEVEL-DEVICE).")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--continue", help="Go on in the folder --output: its finished runs count.")
    ] = False,
    draw: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw a figure of each run.")] = True,
    figures_from: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Only draw the figures of an output folder.")
    ] = None,
    keep: Annotated[bool, typer.Option("--keep-runs/--drop-runs", help="Keep the run folders.")] = True,
    baseline: Annotated[
        Path | None, typer.Option(help="Level ci: the recorded errors (default: benchmarks/baseline_ci.json).")
    ] = None,
    record: Annotated[
        bool, typer.Option("--record", help="Level ci: measure the noise too, and write both to --baseline.")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check the cases and list the runs.")] = False,
    debug: Debug = False,
) -> None:
    """Run cases, compare them with their references, and print one table."""
    folder: Path | None = None
    with reported(debug, lambda: folder):
        from warpsph.errors import CaseError
        from warpsph.study import validation
        from warpsph.study.baseline import Held

        if figures_from is not None:
            written, notes = validation.draw_figures(figures_from, _reference_folders(cases))
            for path in written:
                print(path)
            for note in notes:
                say(note)
            raise typer.Exit(1 if notes else 0)

        problems = [*device_problems(device), *([] if resume else output_problems(output, None))]
        if resume and output is None:
            problems.append(problem("--continue", True, "needs --output", "name the folder to go on in"))
        if level is not Level.ci and (record or baseline is not None):
            problems.append(problem("--record" if record else "--baseline", True, "belongs to --level ci", "add it"))
        try:
            runs = validation.plan(level.value, names or [], cases or [], None if precision is None else precision.value)
        except CaseError as error:
            problems = [*error.problems, *problems]
        if problems:
            raise CaseError(problems)
        held = None if level is not Level.ci else Held(runs, baseline, record, whole=not names and not cases)
        if held is not None:
            runs = held.runs
        if dry_run:
            rows = [(run.case_name, run.run.name, f"{run.case.spacing:.4g} m", dict(run.run.changes)) for run in runs]
            print_table(f"Runs of the level {level.value}", ["case", "run", "spacing", "changes"], rows, width=160)
            return

        earlier = None
        if output is not None and resume:
            earlier = validation.check_continued(output, level.value, device)
        folder = output if output is not None else validation.output_folder(level.value, device)
        quieten_warp(debug)
        table = validation.validate(
            runs,
            folder,
            device=device,
            threads=threads if threads is not None or processes == 1 else 1,
            command=f"python -m warpsph {shlex.join(sys.argv[1:])}",
            processes=processes,
            seconds=None if held is None else held.seconds,
            draw=draw,
            keep=keep,
            earlier=earlier,
            started=_validation_progress,
            finished=_print_validated,
        )
        if held is None or table.interrupted:
            _print_validation(table, folder)
            raise typer.Exit(table.exit_code)
        raise typer.Exit(_print_held(held, table, folder))


def _reference_folders(cases: list[Path] | None) -> list[Path]:
    """Where the reference files of cases are: in `reference` beside the case files."""
    from warpsph.study.validation import SHIPPED

    homes = [place if place.is_dir() else place.parent for place in cases or []]
    return [home / "reference" for home in (*homes, SHIPPED)]


def _validation_progress(run: Any, number: int, count: int) -> AbstractContextManager[Callable[[Any], None]]:
    """Say which run begins; a context with the callback that shows its progress."""
    print(f"[{number}/{count}] {run.case_name} {run.run.name}", flush=True)
    return progress_display()


def _print_validated(entry: Mapping[str, Any]) -> None:
    """One line about a run that is done."""
    outcomes = [row["outcome"] for row in entry["rows"]]
    told = ", ".join(f"{outcomes.count(outcome)} {outcome}" for outcome in dict.fromkeys(outcomes))
    print(f"    {entry['status']}: {told}; {duration(entry['seconds'])}", flush=True)
    if entry["problem"]:
        say(f"    {entry['problem']}")


def _print_validation(table: Any, folder: Path) -> None:
    """The table, what went wrong, and one line about it all."""
    from rich.text import Text

    from warpsph.study.validation import ALIGN, BAD, COLUMNS, cells, problem_lines, with_first

    rows: list[list[Any]] = []
    for row, first in with_first(table.rows):
        line: list[Any] = list(cells(row, first))
        style = "red" if row["outcome"] in BAD else "green" if row["outcome"] == "ok" else ""
        line[COLUMNS.index("outcome")] = Text(row["outcome"], style)
        rows.append(line)
    if rows:
        print_table("Validation", COLUMNS, rows, align=ALIGN, width=180)
    for note in (*problem_lines(table), *table.notes):
        say(note)
    judged = [row for row in table.rows if row["outcome"] == "ok" or row["outcome"] in BAD]
    facts = [
        f"{len(table.runs)} runs",
        f"{len(judged) - len(table.bad)} of {len(judged)} results with a limit within it",
        duration(sum(run["seconds"] for run in table.runs)),
        str(folder),
    ]
    print(", ".join(facts) + (" (interrupted)" if table.interrupted else ""))


def _print_held(held: Any, table: Any, folder: Path) -> int:
    """What the errors of a table are against the recorded ones, but for those that are held; the exit code."""
    from warpsph.study.baseline import told

    verdicts = held.verdicts(table)
    rows = [told(verdict) for verdict in verdicts if verdict.outcome != "held" or verdict.fails]
    if rows:
        columns = ["case", "run", "quantity", "error", "recorded", "noise", "allowed", "verdict"]
        print_table("Against the record", columns, rows, align="lllrrrrl", width=180)
    for line in held.lines(verdicts):
        print(line)
    print(f"{len(table.runs)} runs, {duration(sum(run['seconds'] for run in table.runs))} one after another, {folder}")
    return int(held.exit_code(verdicts))
