"""`plot`: pictures and movies of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from warpsph.cli.arguments import parse_numbers, parse_times
from warpsph.cli.options import Debug
from warpsph.cli.progress import frame_progress
from warpsph.cli.reporting import problem, reported


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
    choices: dict[str, Any] = {"field": field, "times": parse_times(times)}
    if phases is not None:
        choices["phases"] = [name.strip() for name in phases.split(",")]
    with reported(debug):
        problems = []
        overlay = {"--over-scale": over_scale, "--over-offset": over_offset, "--over-mirror": over_mirror}
        for option, value in overlay.items():
            if value is not None and over is None:
                problems.append(problem(option, value, "there is nothing to draw over", "add --over FILE.csv"))
        if movie is None and fps is not None:
            problems.append(problem("--fps", fps, "a picture has no frames", "add --movie FILE.gif"))
        if movie is not None and output is not None:
            rule = "names the PNG of a picture, but a movie is to be made"
            problems.append(problem("--output", str(output), rule, "leave --output or --movie out"))
        if problems:
            from warpsph.errors import CaseError

            raise CaseError(problems)
        if over is not None:
            from warpsph.study.segments import read_segments

            offset = (0.0, 0.0) if over_offset is None else parse_numbers(over_offset, "--over-offset", "0.5,0")
            scale = 1.0 if over_scale is None else over_scale
            choices["over"] = read_segments(over, scale, offset, over_mirror)
        if movie is not None:
            from warpsph.study.movie import make_movie

            if fps is not None:
                choices["fps"] = fps
            with frame_progress() as show_progress:
                path = make_movie(folder, movie, progress=show_progress, **choices)
            print(path)
            return
        from warpsph.study.plot import plot_run

        for path in plot_run(folder, output=output, **choices):
            print(path)
