"""Messages on stderr: exceptions become a message and an exit code."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:

    from warpsph.errors import Problem


LONGEST_LINE = 1500
"""Characters of a line of an error message, at most."""


@contextmanager
def reported(debug: bool, run_folder: Callable[[], Path | None] = lambda: None) -> Iterator[None]:
    """Turn exceptions into a message on stderr and an exit code.

    An unexpected exception leaves its traceback in a file: in the run folder if there is one, else in a
    temporary file.
    """
    try:
        yield
    except (typer.Exit, typer.Abort, typer.BadParameter):
        raise
    except KeyboardInterrupt:
        say("interrupted")
        raise typer.Exit(130) from None
    except Exception as error:
        if isinstance(error, OSError) and error.errno == errno.EPIPE:
            raise  # the reader of our output went away (`... | head`); typer ends quietly
        from warpsph.errors import CaseError, WarpsphError

        if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
            error = CaseError([problem("name of a file", error.filename, "is too long", "choose a shorter one")])
        if isinstance(error, WarpsphError):
            if debug:
                import traceback

                traceback.print_exc()
            else:
                say(_in_short(error))
            raise typer.Exit(error.exit_code) from None
        if debug:
            raise
        say(f"unexpected {type(error).__name__}: {_in_short(error)}\ntraceback in {_write_traceback(run_folder())}")
        raise typer.Exit(1) from None


def say(message: str) -> None:
    """Print a line on stderr; where there is no terminal any more, nothing."""
    try:
        print(message, file=sys.stderr, flush=True)
    except OSError:
        forget_terminal()


def forget_terminal() -> None:
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


def problem(path: str, value: Any, rule: str, remedy: str) -> Problem:
    from warpsph.errors import Problem

    return Problem(path, value, rule, remedy)


def refuse(path: str, value: Any, rule: str, remedy: str) -> None:
    from warpsph.errors import CaseError

    raise CaseError([problem(path, value, rule, remedy)])


def quieten_warp(debug: bool, cuda: bool = False) -> None:
    """Keep Warp's start-up and compilation messages out of the output, unless --debug asks for them."""
    if debug:
        return
    from warpsph.start import start_warp

    start_warp(cuda)
