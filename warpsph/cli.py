"""The command line: `python -m warpsph COMMAND`.

Each command loads the case, hands it to the module that does the work and prints what comes back. Other than
typer everything is imported inside the commands: `--help` answers at once, a command pays for what it uses.

Exit codes: 0 done, 1 unexpected error, 2 bad input, 3 diverged, 4 cannot write, 5 the scene does not fit the memory,
or a list cannot grow, 6 validate: a reference was missed or a run failed, 7 the wall time is over, 130 interrupted.
"""

import errno
import json
import math
import os
import re
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from warpsph.case.case import Case
    from warpsph.errors import Problem

app = typer.Typer(
    name="warpsph",
    help="Smoothed particle hydrodynamics on NVIDIA Warp.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # help without rich: rich takes longer to import than all the rest
    pretty_exceptions_enable=False,
)

LONGEST_LINE = 1500
"""Characters of a line of an error message, at most."""

PLAIN_PROGRESS_INTERVAL = 5.0
"""Seconds between two progress lines where there is no terminal to draw a bar on."""

PREPARING_DELAY = 1.0
"""Seconds after which kernels that are not ready are being compiled, not only loaded."""


class Precision(StrEnum):
    """Floating-point type of the particle state."""

    float32 = "float32"
    float64 = "float64"


class Level(StrEnum):
    """How much work a validation is."""

    quick = "quick"
    seed = "seed"
    fine = "fine"
    ci = "ci"


CaseFile = Annotated[Path, typer.Argument(metavar="CASE", help="Case file (YAML).", show_default=False)]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change a value of the case, e.g. phases.oil.density=900."
    ),
]
PrecisionOption = Annotated[Precision | None, typer.Option("--precision", help="Same as --set precision=...")]
EndTime = Annotated[
    float | None, typer.Option("--end-time", metavar="SECONDS", help="Same as --set end_time=...")
]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


@app.command()
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
    with _reported(debug, lambda: folder):
        from warpsph.errors import CaseError

        # Everything that is wrong with the command is reported at once, the file's problems and the options'.
        problems = [
            *_output_problems(output, restart),
            *_device_problems(device),
            *_restart_problems(restart),
            *_wall_time_problems(wall_time),
        ]
        try:
            loaded = _load(case, overrides, precision, end_time)
        except CaseError as error:
            problems = [*error.problems, *problems]
        if problems:
            raise CaseError(problems)

        if dry_run:
            _print_estimate(loaded)
            _print_plan(loaded)
            return

        _quieten_warp(debug)
        from warpsph.simulation import Simulation

        folder = _claim_output(case, output, restart)
        choices: dict[str, Any] = {"device": device, "threads": threads, "restart": restart}
        choices["wall_time"] = None if wall_time is None else _seconds_of(wall_time)
        try:
            chosen = {key: value for key, value in choices.items() if value is not None}
            with _progress_display(transient=True) as display:
                simulation = Simulation(loaded, output=folder, preparing=display.preparing, **chosen)
            print(f"{case} -> {folder}", flush=True)
            for line in simulation.warnings:
                print(f"warning: {line}", file=sys.stderr, flush=True)
            with _progress_display() as show_progress:
                simulation.run(progress=show_progress)
        except BaseException:
            with suppress(OSError):  # only removes a folder into which nothing was written
                folder.rmdir()
            raise
        _print_summary(simulation.summary, folder)


@app.command()
def check(
    case: CaseFile,
    precision: PrecisionOption = None,
    overrides: Overrides = None,
    end_time: EndTime = None,
    debug: Debug = False,
) -> None:
    """Validate a case; print particle counts, memory, time step and estimated time."""
    with _reported(debug):
        from warpsph.study.validation import runs_of

        loaded = _load(case, overrides, precision, end_time)
        runs_of(loaded, case.stem)  # raises if a validation run is wrong
        _print_estimate(loaded)


@app.command()
def show(
    case: CaseFile,
    precision: PrecisionOption = None,
    overrides: Overrides = None,
    end_time: EndTime = None,
    debug: Debug = False,
) -> None:
    """Print the resolved case and the stages of one step, and why others are absent."""
    with _reported(debug):
        _print_plan(_load(case, overrides, precision, end_time))


@app.command()
def new(
    name: Annotated[Path, typer.Argument(metavar="NAME", help="Name of the case; writes NAME.yaml.")],
    debug: Debug = False,
) -> None:
    """Write a commented case to start from."""
    with _reported(debug):
        path = name if name.suffix in (".yaml", ".yml") else name.with_name(name.name + ".yaml")
        text = Path(__file__).with_name("starter.yaml").read_text(encoding="utf-8")
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text.replace("NAME", path.stem))
        except FileExistsError:
            _refuse("NAME", str(path), "exists already", "choose another name")
        except OSError as error:
            from warpsph.errors import OutputError

            raise OutputError(f"cannot write {path}: {error.strerror}") from error
        print(f"{path} written; try: python -m warpsph check {path}")


@app.command()
def schema(debug: Debug = False) -> None:
    """Print the JSON schema of case files, for completion in editors."""
    with _reported(debug):
        from warpsph.case.case import case_schema

        print(json.dumps(case_schema(), indent=2))


@app.command()
def plot(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", show_default=False)],
    field: Annotated[
        str, typer.Option(help="Field to colour the particles by, e.g. speed, velocity_x.")
    ] = "pressure",
    times: Annotated[
        str | None,
        typer.Option(
            metavar="T1,T2,...|T1:T2",
            help="Times in s, or every frame from T1 to T2 (default: first, middle and last; movie: every frame).",
        ),
    ] = None,
    output: Annotated[Path | None, typer.Option(help="PNG file (default: RUN/plots/FIELD.png).")] = None,
    phases: Annotated[
        str | None,
        typer.Option(metavar="NAME,...", help="Phases to draw, the others are left white (default: all)."),
    ] = None,
    movie: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a movie instead: .gif, or .mp4 with ffmpeg.")
    ] = None,
    fps: Annotated[
        float | None, typer.Option(metavar="NUMBER", help="Frames a second of the movie (default: 10).")
    ] = None,
    over: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="Draw segments over the particles; columns x1, y1, x2, y2."),
    ] = None,
    over_scale: Annotated[
        float | None, typer.Option(metavar="S", help="Length of that file's unit in m (default: 1).")
    ] = None,
    over_offset: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Where that file's origin is, in m (default: 0,0).")
    ] = None,
    over_mirror: Annotated[
        float | None, typer.Option(metavar="X", help="Draw the segments mirrored about x = X too, in m.")
    ] = None,
    debug: Debug = False,
) -> None:
    """Draw the particles of a run and its gauge curves, or make a movie of the particles."""
    choices: dict[str, Any] = {"field": field, "times": _parse_times(times)}
    if phases is not None:
        choices["phases"] = [name.strip() for name in phases.split(",")]
    with _reported(debug):
        problems = []
        overlay = {"--over-scale": over_scale, "--over-offset": over_offset, "--over-mirror": over_mirror}
        for option, value in overlay.items():
            if value is not None and over is None:
                problems.append(_problem(option, value, "there is nothing to draw over", "add --over FILE.csv"))
        if movie is None and fps is not None:
            problems.append(_problem("--fps", fps, "a picture has no frames", "add --movie FILE.gif"))
        if movie is not None and output is not None:
            rule = "names the PNG of a picture, but a movie is to be made"
            problems.append(_problem("--output", str(output), rule, "leave --output or --movie out"))
        if problems:
            from warpsph.errors import CaseError

            raise CaseError(problems)
        if over is not None:
            from warpsph.study.segments import read_segments

            offset = (0.0, 0.0) if over_offset is None else _parse_numbers(over_offset, "--over-offset", "0.5,0")
            scale = 1.0 if over_scale is None else over_scale
            choices["over"] = read_segments(over, scale, offset, over_mirror)
        if movie is not None:
            from warpsph.study.movie import make_movie

            if fps is not None:
                choices["fps"] = fps
            with _frame_progress() as show_progress:
                path = make_movie(folder, movie, progress=show_progress, **choices)
            print(path)
            return
        from warpsph.study.plot import plot_run

        for path in plot_run(folder, output=output, **choices):
            print(path)


@app.command()
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
    with _reported(debug, lambda: folder):
        from warpsph.errors import CaseError
        from warpsph.study import validation
        from warpsph.study.baseline import Held

        if figures_from is not None:
            written, notes = validation.draw_figures(figures_from, _reference_folders(cases))
            for path in written:
                print(path)
            for note in notes:
                _say(note)
            raise typer.Exit(1 if notes else 0)

        problems = [*_device_problems(device), *([] if resume else _output_problems(output, None))]
        if resume and output is None:
            problems.append(_problem("--continue", True, "needs --output", "name the folder to go on in"))
        if level is not Level.ci and (record or baseline is not None):
            problems.append(_problem("--record" if record else "--baseline", True, "belongs to --level ci", "add it"))
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
            _print_table(f"Runs of the level {level.value}", ["case", "run", "spacing", "changes"], rows, width=160)
            return

        earlier = None
        if output is not None and resume:
            earlier = validation.check_continued(output, level.value, device)
        folder = output if output is not None else validation.output_folder(level.value, device)
        _quieten_warp(debug)
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


@app.command()
def info(debug: Debug = False) -> None:
    """Print versions, devices, threads and where compiled kernels are kept."""
    with _reported(debug):
        _print_info()


def main() -> None:
    """Entry point of `python -m warpsph` and of the `warpsph` command."""
    app(prog_name="python -m warpsph")


# ---- errors ----------------------------------------------------------------------------------------------


@contextmanager
def _reported(debug: bool, run_folder: Callable[[], Path | None] = lambda: None) -> Iterator[None]:
    """Turn exceptions into a message on stderr and an exit code.

    An unexpected exception leaves its traceback in a file: in the run folder if there is one, else in a
    temporary file.
    """
    try:
        yield
    except (typer.Exit, typer.Abort, typer.BadParameter):
        raise
    except KeyboardInterrupt:
        _say("interrupted")
        raise typer.Exit(130) from None
    except Exception as error:
        if isinstance(error, OSError) and error.errno == errno.EPIPE:
            raise  # the reader of our output went away (`... | head`); typer ends quietly
        from warpsph.errors import CaseError, WarpsphError

        if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
            error = CaseError([_problem("name of a file", error.filename, "is too long", "choose a shorter one")])
        if isinstance(error, WarpsphError):
            if debug:
                import traceback

                traceback.print_exc()
            else:
                _say(_in_short(error))
            raise typer.Exit(error.exit_code) from None
        if debug:
            raise
        _say(f"unexpected {type(error).__name__}: {_in_short(error)}\ntraceback in {_write_traceback(run_folder())}")
        raise typer.Exit(1) from None


def _say(message: str) -> None:
    """Print a line on stderr; where there is no terminal any more, nothing."""
    try:
        print(message, file=sys.stderr, flush=True)
    except OSError:
        _forget_terminal()


def _forget_terminal() -> None:
    """Send what is still to be printed nowhere: the terminal is gone, and that must not change the exit code."""
    sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")


def _in_short(error: Exception) -> str:
    """The text of an error with its lines cut: names of files and folders may be long."""
    from warpsph.errors import short

    return "\n".join(short(line, LONGEST_LINE) for line in str(error).splitlines())


def _write_traceback(folder: Path | None) -> str:
    """Write the traceback of the exception being handled to a file and return where it is."""
    import tempfile
    import traceback

    text = f"{' '.join(sys.argv)}\n\n{traceback.format_exc()}"
    if folder is not None:
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / "traceback.txt"
            path.write_text(text, encoding="utf-8")
            return str(path)
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="warpsph-", suffix=".txt", delete=False, encoding="utf-8"
        ) as file:
            file.write(text)
            return file.name
    except OSError:
        return f"no file (no place to write it):\n{text}"


def _problem(path: str, value: Any, rule: str, remedy: str) -> "Problem":
    from warpsph.errors import Problem

    return Problem(path, value, rule, remedy)


def _refuse(path: str, value: Any, rule: str, remedy: str) -> None:
    from warpsph.errors import CaseError

    raise CaseError([_problem(path, value, rule, remedy)])


# ---- input -----------------------------------------------------------------------------------------------


def _load(
    path: Path, overrides: list[str] | None, precision: Precision | None = None, end_time: float | None = None
) -> "Case":
    """Load a case with the changes of the command line; the named options win over --set."""
    from warpsph.case.case_file import load_case

    changes = list(overrides or [])
    if precision is not None:
        changes.append(f"precision={precision.value}")
    if end_time is not None:
        changes.append(f"end_time={end_time!r}")
    return load_case(path, overrides=changes)


def _in_use(folder: Path) -> bool:
    """True if something is there already that a run would mix with or overwrite."""
    return folder.exists() and (not folder.is_dir() or any(folder.iterdir()))


def _restarted_run(restart: Path) -> Path:
    """Run folder that a checkpoint, or the run folder itself, belongs to."""
    if restart.is_dir():
        return restart.parent if restart.name == "checkpoint" else restart
    return restart.parent.parent if restart.parent.name == "checkpoint" else restart.parent


def _output_problems(output: Path | None, restart: Path | None) -> "list[Problem]":
    if output is None or not _in_use(output):
        return []
    if restart is not None and output.resolve() == _restarted_run(restart).resolve():
        return []  # the run continues in its own folder
    return [_problem("--output", str(output), "folder in use", "name a folder that is new or empty")]


def _restart_problems(restart: Path | None) -> "list[Problem]":
    if restart is None or restart.exists():
        return []
    return [
        _problem(
            "--restart", str(restart), "no such file or folder", "name a checkpoint/*.h5 or a run folder"
        )
    ]


_CLOCK = re.compile(r"(?P<h>\d+):(?P<m>[0-5]?\d):(?P<s>[0-5]?\d(?:\.\d*)?)")
_WORDS = re.compile(r"(?:(?P<d>\d+)d)?(?:(?P<h>\d+)h)?(?:(?P<m>\d+)m(?:in)?)?(?:(?P<s>\d+(?:\.\d*)?)s)?")


def _seconds_of(text: str) -> float | None:
    """Seconds of a time: a number of them, `1h30m` (d, h, m, s in this order) or `HH:MM:SS`; None if it is none above 0."""
    text = text.replace(" ", "")
    try:
        seconds = float(text)
    except ValueError:
        found = _CLOCK.fullmatch(text) or _WORDS.fullmatch(text)
        parts = found.groupdict() if found else {}
        length = {"d": 86400, "h": 3600, "m": 60, "s": 1}
        seconds = sum(length[unit] * float(number) for unit, number in parts.items() if number)
    return seconds if 0 < seconds < math.inf else None


def _wall_time_problems(wall_time: str | None) -> "list[Problem]":
    if wall_time is None or _seconds_of(wall_time) is not None:
        return []
    rule, remedy = "needs a time above 0", "write seconds, e.g. 5400, or 1h30m, or 01:30:00"
    return [_problem("--wall-time", wall_time, rule, remedy)]


def _device_problems(device: str | None) -> "list[Problem]":
    if device is None or device == "cpu":
        return []  # always there: no need to start Warp to find out
    _quieten_warp(False, cuda=True)
    import warp

    names = [str(known) for known in warp.get_devices()]
    if device in names or (device == "cuda" and warp.is_cuda_available()):
        return []
    return [_problem("--device", device, "no such device here", f"choose from: {', '.join(names)}")]


def _claim_output(case: Path, output: Path | None, restart: Path | None) -> Path:
    """Create the run folder and return it.

    Without --output a restart goes on in its own folder, and a new run takes the first free name of
    runs/CASE, runs/CASE_2, ... Creating it here lets two runs that start together get two folders.
    """
    try:
        if output is not None or restart is not None:
            folder = output if output is not None else _restarted_run(restart)  # type: ignore[arg-type]
            folder.mkdir(parents=True, exist_ok=True)
            return folder
        number = 1
        while True:
            folder = Path("runs", case.stem if number == 1 else f"{case.stem}_{number}")
            try:
                folder.mkdir(parents=True)
                return folder
            except FileExistsError:
                number += 1
    except OSError as error:
        from warpsph.errors import OutputError

        raise OutputError(f"cannot create the run folder {error.filename}: {error.strerror}") from error


def _parse_times(text: str | None) -> list[float] | slice | None:
    """Times of --times [s]; `T1:T2`, either of which may be missing, is the slice between them."""
    if text is None:
        return None
    start, colon, stop = text.partition(":")
    if not colon:
        return _parse_numbers(text, "--times", "0,0.5,1 or 0:1")
    ends = [_parse_numbers(end, "--times", "0,0.5,1 or 0:1") if end.strip() else [None] for end in (start, stop)]
    if any(len(end) > 1 for end in ends):
        raise typer.BadParameter("needs two times around the colon, e.g. 0:1", param_hint="--times")
    return slice(ends[0][0], ends[1][0])


def _parse_numbers(text: str, option: str, example: str) -> list[float]:
    """Numbers separated by commas."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if not numbers or not all(math.isfinite(number) for number in numbers):
        raise typer.BadParameter(f"needs numbers separated by commas, e.g. {example}", param_hint=option)
    return numbers


def _quieten_warp(debug: bool, cuda: bool = False) -> None:
    """Keep Warp's start-up and compilation messages out of the output, unless --debug asks for them."""
    if debug:
        return
    from warpsph.start import start_warp

    start_warp(cuda)


# ---- output ----------------------------------------------------------------------------------------------


def _console(width: int = 110) -> "Console":
    """Console for stdout; `width` counts where there is no terminal."""
    from rich.console import Console

    # Without a terminal rich would wrap tables to 80 columns.
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else width)


def _print_table(
    title: str, columns: Iterable[str], rows: Iterable[Iterable[Any]], align: str = "", width: int = 110
) -> None:
    """Print a table; `align` has an l or r for each column (default: all l), `width` counts without a terminal."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    columns = list(columns)
    table = Table(
        title=title or None,
        box=box.SIMPLE_HEAD,
        show_header=any(columns),
        title_justify="left",
        title_style="bold",
    )
    for column, side in zip(columns, align or "l" * len(columns), strict=True):
        table.add_column(column, justify="right" if side == "r" else "left", overflow="fold")
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(_format(cell)) for cell in row))
    _console(width).print(table)


def _format(value: Any) -> str:
    """Short text for a cell: numbers with four digits, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}".replace(",", " ")
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_format(entry)}" for key, entry in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(_format(entry) for entry in value)
    return str(value)


def _duration(seconds: float | None) -> str:
    """'42 s', '3 min 20 s', '2 h 05 min'; '?' if unknown."""
    if seconds is None or not math.isfinite(seconds):
        return "?"
    if seconds < 60:
        return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def _print_estimate(case: "Case") -> None:
    _quieten_warp(False)
    from warpsph.simulation import estimate

    found = estimate(case)
    about = "about " if "refused" in found else ""
    rows = [
        ("fluid particles", f"{about}{_format(found['particles'])}"),
        ("wall particles", f"{about}{_format(found['walls'])}"),
        ("memory of the device", f"{about}{_mebibytes(found['memory_bytes'])}"),
        ("memory of the host", f"about {_mebibytes(found['host_bytes'])}"),
        ("time step", None if found.get("dt") is None else f"{found['dt']:.3g} s"),
        ("steps", found.get("steps")),
        ("estimated time", _duration(found["seconds"]) if "seconds" in found else None),
    ]
    _print_table(case.title or "Case", ["", ""], [row for row in rows if row[1] is not None])
    for warning in found.get("warnings", []):
        _say(f"warning: {warning}")
    if "refused" in found:
        raise found["refused"]


def _mebibytes(number: int) -> str:
    return f"{number / 2**20:,.1f} MiB".replace(",", " ")


def _print_plan(case: "Case") -> None:
    _quieten_warp(False)
    from warpsph.case.case_file import dump_yaml
    from warpsph.simulation import describe

    plan = describe(case)
    print(f"# resolved case\n{dump_yaml(plan['resolved'])}")
    _print_table("Structure", ["choice", "value"], plan["structure"].items())
    _print_table("Chosen by auto", ["key", "why"], plan["reasons"].items())
    _print_table(
        "Stages of one step, in order",
        ["", "stage", "why"],
        [(str(number), stage["name"], stage["reason"]) for number, stage in enumerate(plan["stages"], 1)],
    )
    if plan["absent"]:
        _print_table(
            "Absent", ["stage", "why"], [(stage["name"], stage["reason"]) for stage in plan["absent"]]
        )


class _Display:
    """Shows how far a run is: called with its progress, and before that with the number of kernels that are ready."""

    def __init__(self, show: Callable[[Any], None], preparing: Callable[[int], None]) -> None:
        self._show = show
        self.preparing = preparing

    def __call__(self, progress: Any) -> None:
        self._show(progress)


def _progress_display(transient: bool = False) -> AbstractContextManager[_Display]:
    """Context that yields the callback which shows the progress of a run; a transient bar is wiped out at the end."""
    return _progress_bar(transient) if sys.stdout.isatty() else nullcontext(_progress_lines())


def _progress_lines() -> _Display:
    """Callback that prints a line now and then."""
    last = -math.inf
    told = time.monotonic() - PLAIN_PROGRESS_INTERVAL + PREPARING_DELAY

    def preparing(ready: int) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told >= PLAIN_PROGRESS_INTERVAL:
            told = now
            print(f"compiling kernels: {ready} ready", flush=True)

    def show_progress(p: Any) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= PLAIN_PROGRESS_INTERVAL or p.time >= p.end_time:
            last = now
            print(
                f"t {p.time:.5g} of {p.end_time:g} s  step {p.step}  dt {p.dt:.3g} s  {p.mups:.3g} Mups  "
                f"{100 * p.share:.1f} %  {_duration(p.seconds_left)} left",
                flush=True,
            )

    return _Display(show_progress, preparing)


@contextmanager
def _progress_bar(transient: bool) -> Iterator[_Display]:
    """Callback that draws a bar on the terminal, from the first step on; before it, what is being done instead."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    progress = Progress(
        TextColumn("{task.fields[time]}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn(
            "step {task.fields[step]}  dt {task.fields[dt]}  {task.fields[mups]} Mups  "
            "{task.fields[left]} left"
        ),
        console=_console(),
        transient=transient,
    )
    progress.start()
    try:
        task = progress.add_task("", total=1.0, time="preparing the first step ...", step="0", dt="?", mups="?", left="?")

        def show_progress(p: Any) -> None:
            progress.update(
                task,
                completed=p.share,
                time=f"t {p.time:.5g} / {p.end_time:g} s",
                step=str(p.step),
                dt=f"{p.dt:.3g} s",
                mups=f"{p.mups:.3g}",
                left=_duration(p.seconds_left),
            )

        def preparing(ready: int) -> None:
            progress.update(task, time=f"compiling kernels: {ready} ready ...")

        yield _Display(show_progress, preparing)
    finally:
        try:
            progress.stop()
        except OSError:  # the run has been stopped because the terminal is gone
            _forget_terminal()


@contextmanager
def _frame_progress() -> Iterator[Callable[[int, int], None]]:
    """Callback that shows on stderr, beside the names on stdout, how many frames of a movie are drawn."""
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = TextColumn("frames"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        with Progress(*columns, console=Console(stderr=True)) as progress:
            task = progress.add_task("")
            yield lambda done, total: progress.update(task, completed=done, total=total)
        return
    last = time.monotonic()

    def show_progress(done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= PLAIN_PROGRESS_INTERVAL or done == total:
            last = now
            _say(f"frame {done} of {total}")

    yield show_progress


def _reference_folders(cases: list[Path] | None) -> list[Path]:
    """Where the reference files of cases are: in `reference` beside the case files."""
    from warpsph.study.validation import SHIPPED

    homes = [place if place.is_dir() else place.parent for place in cases or []]
    return [home / "reference" for home in (*homes, SHIPPED)]


def _validation_progress(run: Any, number: int, count: int) -> AbstractContextManager[Callable[[Any], None]]:
    """Say which run begins; a context with the callback that shows its progress."""
    print(f"[{number}/{count}] {run.case_name} {run.run.name}", flush=True)
    return _progress_display()


def _print_validated(entry: Mapping[str, Any]) -> None:
    """One line about a run that is done."""
    outcomes = [row["outcome"] for row in entry["rows"]]
    told = ", ".join(f"{outcomes.count(outcome)} {outcome}" for outcome in dict.fromkeys(outcomes))
    print(f"    {entry['status']}: {told}; {_duration(entry['seconds'])}", flush=True)
    if entry["problem"]:
        _say(f"    {entry['problem']}")


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
        _print_table("Validation", COLUMNS, rows, align=ALIGN, width=180)
    for note in (*problem_lines(table), *table.notes):
        _say(note)
    judged = [row for row in table.rows if row["outcome"] == "ok" or row["outcome"] in BAD]
    facts = [
        f"{len(table.runs)} runs",
        f"{len(judged) - len(table.bad)} of {len(judged)} results with a limit within it",
        _duration(sum(run["seconds"] for run in table.runs)),
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
        _print_table("Against the record", columns, rows, align="lllrrrrl", width=180)
    for line in held.lines(verdicts):
        print(line)
    print(f"{len(table.runs)} runs, {_duration(sum(run['seconds'] for run in table.runs))} one after another, {folder}")
    return int(held.exit_code(verdicts))


def _print_summary(summary: Mapping[str, Any], folder: Path) -> None:
    """Comparison with the reference, time per stage and one line about the run."""
    rows = [_comparison_row(entry) for entry in _comparisons(summary)]
    if rows:
        columns = ["quantity", "value", "reference", "error", "allowed", "note"]
        _print_table("Against the reference", columns, rows, align="lrrrrl")

    timings = {stage: _seconds(entry) for stage, entry in summary.get("timings", {}).items()}
    total = sum(timings.values())
    if total > 0:
        _print_table(
            "Time per stage",
            ["stage", "s", "%"],
            [(stage, f"{spent:.3f}", f"{100 * spent / total:.1f}") for stage, spent in timings.items()],
            align="lrr",
        )
    facts = [
        f"{_format(summary['particles'])} particles" if "particles" in summary else "",
        f"{_format(summary['steps'])} steps" if "steps" in summary else "",
        _duration(summary["wall_seconds"]) if "wall_seconds" in summary else "",
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
        return _format(value) if value is None or note.startswith("absolute") else f"{100 * value:.3g} %"

    shown = Text(share(error))
    if error is not None and allowed is not None:
        # NaN is not within the limit.
        shown = Text(share(error), "green") if abs(error) <= allowed else Text(f"! {share(error)}", "red")
    name = entry["quantity"] if unit in ("", "1") else f"{entry['quantity']} [{unit}]"
    return [name, entry.get("value"), entry.get("reference"), shown, share(allowed), note]


def _seconds(timing: Any) -> float:
    """Seconds of a timing that is a number or a mapping with `seconds`."""
    return float(timing["seconds"] if isinstance(timing, Mapping) else timing)


def _print_info() -> None:
    import platform
    from importlib.metadata import PackageNotFoundError, version

    import warpsph

    _quieten_warp(False)
    import warp

    warp.init()
    rows: list[tuple[str, Any]] = [("warpsph", warpsph.__version__), ("Python", platform.python_version())]
    for package in ("warp-lang", "numpy", "h5py", "pyvista", "vtk", "pydantic", "matplotlib"):
        try:
            rows.append((package, version(package)))
        except PackageNotFoundError:
            rows.append((package, "not installed"))
    rows.append(("machine", f"{platform.system()} {platform.machine()}"))
    for device in warp.get_devices():
        memory = f", {device.total_memory / 2**30:.0f} GiB" if device.is_cuda else ""
        rows.append((f"device {device}", f"{device.name}{memory}"))
    rows.append(
        ("CPU threads", len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count())
    )
    rows.append(("kernel cache", warp.config.kernel_cache_dir))
    _print_table("", ["", ""], rows)
