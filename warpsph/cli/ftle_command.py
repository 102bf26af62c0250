"""`ftle`: Lyapunov exponents from the particle files of a run."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from warpsph.cli.options import Debug
from warpsph.cli.reporting import reported


class Direction(StrEnum):
    """Which exponents."""

    backward = "backward"
    forward = "forward"
    both = "both"


def ftle(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", show_default=False)],
    start: Annotated[
        float | None, typer.Option("--from", metavar="SECONDS", help="Time of the earlier frame (default: the first).")
    ] = None,
    end: Annotated[
        float | None, typer.Option("--to", metavar="SECONDS", help="Time of the later frame (default: the last).")
    ] = None,
    direction: Annotated[
        Direction, typer.Option(help="backward: at the places of the later frame; forward: of the earlier one.")
    ] = Direction.both,
    output: Annotated[Path | None, typer.Option(help="Folder of the files (default: RUN/ftle).")] = None,
    pictures: Annotated[bool, typer.Option(help="Draw them, too.")] = True,
    debug: Debug = False,
) -> None:
    """Write finite-time Lyapunov exponents between two stored frames, for ParaView and as pictures.

    Of particles that are in both frames, known by their ids. A run with output.lyapunov has exponents without the shifts of
    its particles in them.
    """
    with reported(debug):
        from warpsph.study.stored_exponents import DIRECTIONS, write_exponents

        directions = DIRECTIONS if direction == Direction.both else (direction.value,)
        for path in write_exponents(folder, start, end, directions, output, pictures):
            print(path)
