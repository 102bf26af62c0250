"""What the arguments of commands mean, and what is wrong with them."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from warpsph.cli.options import Precision
from warpsph.cli.reporting import problem, quieten_warp

if TYPE_CHECKING:

    from warpsph.case.case import Case
    from warpsph.errors import Problem


def load(
    path: Path, overrides: list[str] | None, precision: Precision | None = None, end_time: float | None = None
) -> Case:
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


def output_problems(output: Path | None, restart: Path | None) -> list[Problem]:
    if output is None or not _in_use(output):
        return []
    if restart is not None and output.resolve() == _restarted_run(restart).resolve():
        return []  # the run continues in its own folder
    return [problem("--output", str(output), "folder in use", "name a folder that is new or empty")]


def restart_problems(restart: Path | None) -> list[Problem]:
    if restart is None or restart.exists():
        return []
    return [
        problem(
            "--restart", str(restart), "no such file or folder", "name a checkpoint/*.h5 or a run folder"
        )
    ]


_CLOCK = re.compile(r"(?P<h>\d+):(?P<m>[0-5]?\d):(?P<s>[0-5]?\d(?:\.\d*)?)")
_WORDS = re.compile(r"(?:(?P<d>\d+)d)?(?:(?P<h>\d+)h)?(?:(?P<m>\d+)m(?:in)?)?(?:(?P<s>\d+(?:\.\d*)?)s)?")


def seconds_of(text: str) -> float | None:
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


def error_of(text: str) -> float:
    """The relative error that `1%` or `0.01` means. Raises CaseError unless it is above 0 and below 100 %."""
    from warpsph.errors import CaseError

    bare = text.strip().removesuffix("%")
    try:
        error = float(bare) / (100.0 if bare != text.strip() else 1.0)
    except ValueError:
        error = math.nan
    if not 0.0 < error < 1.0:
        rule, remedy = "needs an error above 0 and below 100 %", "write e.g. 1% or 0.01"
        raise CaseError([problem("--for-error", text, rule, remedy)])
    return error


def wall_time_problems(wall_time: str | None) -> list[Problem]:
    if wall_time is None or seconds_of(wall_time) is not None:
        return []
    rule, remedy = "needs a time above 0", "write seconds, e.g. 5400, or 1h30m, or 01:30:00"
    return [problem("--wall-time", wall_time, rule, remedy)]


def device_problems(device: str | None) -> list[Problem]:
    if device is None or device == "cpu":
        return []  # always there: no need to start Warp to find out
    quieten_warp(False, cuda=True)
    import warp

    names = [str(known) for known in warp.get_devices()]
    if device in names or (device == "cuda" and warp.is_cuda_available()):
        return []
    return [problem("--device", device, "no such device here", f"choose from: {', '.join(names)}")]


def claim_output(case: Path, output: Path | None, restart: Path | None) -> Path:
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


def parse_times(text: str | None) -> list[float] | slice | None:
    """Times of --times [s]; `T1:T2`, either of which may be missing, is the slice between them."""
    if text is None:
        return None
    start, colon, stop = text.partition(":")
    if not colon:
        return parse_numbers(text, "--times", "0,0.5,1 or 0:1")
    ends = [parse_numbers(end, "--times", "0,0.5,1 or 0:1") if end.strip() else [None] for end in (start, stop)]
    if any(len(end) > 1 for end in ends):
        raise typer.BadParameter("needs two times around the colon, e.g. 0:1", param_hint="--times")
    return slice(ends[0][0], ends[1][0])


def parse_numbers(text: str, option: str, example: str) -> list[float]:
    """Numbers separated by commas."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if not numbers or not all(math.isfinite(number) for number in numbers):
        raise typer.BadParameter(f"needs numbers separated by commas, e.g. {example}", param_hint=option)
    return numbers
