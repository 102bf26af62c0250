"""Files that are whole or absent: written under a temporary name and renamed when they are complete."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from warpsph.errors import OutputError

PARTIAL = ".partial"
"""Ending of the temporary name."""


def write_failure(path: Path, error: OSError, needed: int = 0) -> OutputError:
    """The OutputError that explains why `path` could not be written; `needed`: size of the file [bytes]."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        need = f", {needed / 1e6:.1f} MB needed" if needed else ""
        return OutputError(f"{path}: the disk is full{need}; free some space or write less often")
    return OutputError(f"{path}: cannot be written: {error.strerror or error}")


def make_folder(path: Path) -> None:
    """Create the folder `path` and those above it, unless it is there; raises OutputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_failure(path, error) from error


@contextmanager
def whole_file(path: Path, *, durable: bool = False, needed: int = 0) -> Iterator[Path]:
    """Give a temporary path beside `path`, and rename it to `path` if the block ends without an error.

    After an error the temporary file is gone and `path` is what it was before. `durable` also waits until
    the data is on the disk, so that it survives a loss of power and not only of the process. Raises
    OutputError for any OSError.
    """
    temporary = path.with_name(f".{path.name}{PARTIAL}")
    try:
        try:
            yield temporary
            if durable:
                _sync(temporary)
            os.replace(temporary, path)
            if durable:
                _sync(path.parent)
        except BaseException:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise write_failure(path, error, needed) from error


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_text(path: Path, text: str, *, durable: bool = False) -> None:
    """Write `text` to `path` in one go; raises OutputError."""
    with whole_file(path, durable=durable) as temporary:
        temporary.write_text(text, encoding="utf-8")
