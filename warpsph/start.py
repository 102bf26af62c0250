"""Starting Warp without its banner, and without its complaint that there is no CUDA driver unless CUDA was asked for."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

DRIVERS = {"linux": ("libcuda.so", "libcuda.so.1"), "win32": ("nvcuda.dll",)}
NO_DRIVER = b"Could not find or load the NVIDIA CUDA driver"


def start_warp(cuda: bool = False) -> None:
    """Start Warp, if it has not been started, with nothing but its warnings on the standard error.

    Args:
        cuda: a CUDA device was asked for, so that a missing driver is worth its warning.
    """
    import warp as wp

    config: Any = wp.config
    if hasattr(wp, "LOG_WARNING"):
        config.log_level = wp.LOG_WARNING
    else:  # before Warp 1.13
        config.quiet = True
    if cuda or _driver_found():
        wp.init()
        return
    with _without_line(NO_DRIVER):
        wp.init()


def _driver_found() -> bool:
    """Return whether the CUDA driver can be loaded; True on systems where Warp does not look for one."""
    names = DRIVERS.get(sys.platform, ())
    for name in names:
        with suppress(OSError):
            ctypes.CDLL(name)
            return True
    return not names


@contextmanager
def _without_line(text: bytes) -> Iterator[None]:
    """Leave out those lines that compiled code writes to the standard error with this text; the others come at the end."""
    try:
        saved = os.dup(2)
    except OSError:  # there is no standard error
        yield
        return
    if sys.stderr is not None:
        sys.stderr.flush()
    with tempfile.TemporaryFile() as caught:
        os.dup2(caught.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            caught.seek(0)
            rest = b"".join(line for line in caught if text not in line)
            if rest:
                os.write(2, rest)
