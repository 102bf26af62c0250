"""`run`: run a case, and what is printed about a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from warpsph.cli.arguments import (
    claim_output,
    device_problems,
    load,
    output_problems,
    restart_problems,
    seconds_of,
    wall_time_problems,
)
from warpsph.cli.options import CaseFile, Debug, EndTime, Overrides, PrecisionOption
from warpsph.cli.progress import progress_display
from warpsph.cli.reporting import quieten_warp, reported, say
from warpsph.cli.tables import duration, format_cell, print_table
from warpsph.cli.views import print_estimate, print_plan


def run(
    case: CaseFile,
    device: Annotated[str | None, typer.Option(help="Device to run on: cpu, cuda:0, ...")] = None,
    precision: PrecisionOption = None,
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads (default: all).")] = None,
    output: Annotated[
        Path | None, typer.Option(help="Run folder, new or empty (default: runs/CASE).")
    ] = None,
    overrides: Overrides = None,
    end_time: EndTime = None,
    restart: Annotated[Path | None, typer.Option(help="Checkpoint, or run folder, to continue from.")] = None,
    wall_time: Annotated[
        str | None,
        typer.Option(
            "--wall-time", metavar="TIME", help="Stop with a checkpoint after this time: seconds, 1h30m or HH:MM:SS."
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check and show the case, do not run it.")
    ] = False,
    debug: Debug = False,
) -> None:
    """Run a case and write its run folder."""
    folder: Path | None = None
    with reported(debug, lambda: folder):
        from warpsph.errors import CaseError

        # Everything that is wrong with the command is reported at once, the file's problems and the options'.
        problems = [
            *output_problems(output, restart),
            *device_problems(device),
            *restart_problems(restart),
            *wall_time_problems(wall_time),
        ]
        try:
            loaded = load(case, overrides, precision, end_time)
        except CaseError as error:
            problems = [*error.problems, *problems]
        if problems:
            raise CaseError(problems)

        if dry_run:
            print_estimate(loaded)
            print_plan(loaded)
            return

        quieten_warp(debug)
        from warpsph.simulation import Simulation

        folder = claim_output(case, output, restart)
        choices: dict[str, Any] = {"device": device, "threads": threads, "restart": restart}
        choices["wall_time"] = None if wall_time is None else seconds_of(wall_time)
        try:
            chosen = {key: value for key, value in choices.items() if value is not None}
            with progress_display(transient=True) as display:
                simulation = Simulation(loaded, output=folder, preparing=display.preparing, **chosen)
            print(f"{case} -> {folder}", flush=True)
            told: set[str] = set()
            _print_warnings(simulation.warnings, told)
            try:
                with progress_display() as show_progress:
                    simulation.run(progress=show_progress)
            finally:  # also of what a run warned before it failed, and once the bar is no longer drawn
                _print_warnings(simulation.warnings, told)
        except BaseException:
            with suppress(OSError):  # only removes a folder into which nothing was written
                folder.rmdir()
            raise
        _print_summary(simulation.summary, folder)


def _print_warnings(warnings: Iterable[str], told: set[str]) -> None:
    """Print the warnings that are not among those told, and add them."""
    for line in warnings:
        if line not in told:
            told.add(line)
            say(f"warning: {line}")


def _print_summary(summary: Mapping[str, Any], folder: Path) -> None:
    """Comparison with the reference, time per stage and one line about the run."""
    rows = [_comparison_row(entry) for entry in _comparisons(summary)]
    if rows:
        columns = ["quantity", "value", "reference", "error", "allowed", "note"]
        print_table("Against the reference", columns, rows, align="lrrrrl")

    timings = {stage: _seconds(entry) for stage, entry in summary.get("timings", {}).items()}
    total = sum(timings.values())
    if total > 0:
        print_table(
            "Time per stage",
            ["stage", "s", "%"],
            [(stage, f"{spent:.3f}", f"{100 * spent / total:.1f}") for stage, spent in timings.items()],
            align="lrr",
        )
    facts = [
        f"{format_cell(summary['particles'])} particles" if "particles" in summary else "",
        f"{format_cell(summary['steps'])} steps" if "steps" in summary else "",
        duration(summary["wall_seconds"]) if "wall_seconds" in summary else "",
        " ".join(str(summary[key]) for key in ("device", "precision") if key in summary),
        str(folder),
    ]
    print(", ".join(fact for fact in facts if fact))


def _comparisons(summary: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Entries of the comparison, each with its quantity, from a list of them or a mapping by quantity."""
    errors = summary.get("errors") or []
    if isinstance(errors, Mapping):
        return [{"quantity": quantity, **entry} for quantity, entry in errors.items()]
    return list(errors)


def _comparison_row(entry: Mapping[str, Any]) -> list[Any]:
    """Cells of one compared quantity; an error that is too large, or no number, is marked."""
    from rich.text import Text

    unit, note = entry.get("unit") or "", entry.get("note") or ""
    error, allowed = entry.get("error"), entry.get("allowed")

    def share(value: float | None) -> str:
        """Errors are relative unless the note says otherwise."""
        return format_cell(value) if value is None or note.startswith("absolute") else f"{100 * value:.3g} %"

    shown = Text(share(error))
    if error is not None and allowed is not None:
        # NaN is not within the limit.
        shown = Text(share(error), "green") if abs(error) <= allowed else Text(f"! {share(error)}", "red")
    name = entry["quantity"] if unit in ("", "1") else f"{entry['quantity']} [{unit}]"
    return [name, entry.get("value"), entry.get("reference"), shown, share(allowed), note]


def _seconds(timing: Any) -> float:
    """Seconds of a timing that is a number or a mapping with `seconds`."""
    return float(timing["seconds"] if isinstance(timing, Mapping) else timing)
