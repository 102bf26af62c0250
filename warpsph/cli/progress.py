"""How far a run, or a movie, is."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from warpsph.cli.reporting import forget_terminal, say
from warpsph.cli.tables import console, duration

PLAIN_PROGRESS_INTERVAL = 5.0
"""Seconds between two progress lines where there is no terminal to draw a bar on."""

PREPARING_DELAY = 1.0
"""Seconds after which kernels that are not ready are being compiled, not only loaded."""


class _Display:
    """Shows how far a run is: called with its progress, and before that with the number of kernels that are ready."""

    def __init__(self, show: Callable[[Any], None], preparing: Callable[[int], None]) -> None:
        self._show = show
        self.preparing = preparing

    def __call__(self, progress: Any) -> None:
        self._show(progress)


def progress_display(transient: bool = False) -> AbstractContextManager[_Display]:
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
                f"{100 * p.share:.1f} %  {duration(p.seconds_left)} left",
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
        console=console(),
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
                left=duration(p.seconds_left),
            )

        def preparing(ready: int) -> None:
            progress.update(task, time=f"compiling kernels: {ready} ready ...")

        yield _Display(show_progress, preparing)
    finally:
        try:
            progress.stop()
        except OSError:  # the run has been stopped because the terminal is gone
            forget_terminal()


@contextmanager
def frame_progress() -> Iterator[Callable[[int, int], None]]:
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
            say(f"frame {done} of {total}")

    yield show_progress
