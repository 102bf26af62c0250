"""Pictures of benchmarks: error over seconds of every choice, the front, and other codes beside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpsph.study.benchmark_plan import DEFAULT
from warpsph.study.fronts import Row, counts, front, seconds_of

LARGEST = 1.0
"""Errors above this are not drawn: they would press the others together."""

MARKERS = "osD^v<>pPX*hd8H"
"""Shapes of the points, by choice; those of other codes are hollow."""


def comparable(peers: Sequence[Mapping[str, Any]], name: str, about: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The rows of other codes that have seconds and the error by which a benchmark judges."""
    known = about.get("peer_errors", ())
    return [row for row in peers if row["case"] == name and row["error_name"] in known and counts(row) and row["error"]]


def draw_case(
    path: Path, name: str, about: Mapping[str, Any], rows: Sequence[Row], peers: Sequence[Mapping[str, Any]] = ()
) -> Path | None:
    """Draw the runs of a case and return the file; None, and nothing drawn, where no run has an error in 0 to LARGEST.

    A line joins the resolutions of a choice; the front is a grey band under its points. Raises OutputError.
    """
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    from warpsph.files.whole_files import whole_file

    drawn = [row for row in rows if counts(row) and 0 < row["error"] <= LARGEST and row["seconds"] > 0]
    if not drawn:
        return None
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    panel = figure.add_subplot()
    _front(panel, front(drawn))
    choices = dict.fromkeys(row["choice"] for row in drawn)
    colours = colormaps["tab20"].colors  # type: ignore[attr-defined]
    for position, choice in enumerate(choices):
        colour = "black" if choice == DEFAULT else colours[(2 * position + position // 10) % len(colours)]
        _choice(panel, choice, MARKERS[position % len(MARKERS)], colour, [row for row in drawn if row["choice"] == choice])
    for position, row in enumerate(comparable(peers, name, about)):
        seconds = seconds_of(row, row.get("threads", 1) == 1)
        panel.loglog(
            seconds, abs(row["error"]), MARKERS[position % len(MARKERS)], markerfacecolor="none", markersize=9,
            color="black", label=f"{row['peer']}, {row['particles']} particles",
        )  # fmt: skip
    panel.set_xlabel("seconds of the run, without set-up")
    panel.set_ylabel("\n".join(_wrapped(about["error_name"], 52)))
    left_out = sorted({row["choice"] for row in rows if counts(row) and row["error"] > LARGEST})
    panel.set_title(name + (f"   (above {100 * LARGEST:g} %: {', '.join(left_out)})" if left_out else ""), fontsize=10)
    panel.grid(True, which="major", alpha=0.3)
    _ticks(panel)
    panel.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, format="png", dpi=90)
    return path


def _front(panel: Any, rows: Sequence[Row]) -> None:
    """The staircase below and to the left of which there is no run."""
    seconds, errors = [row["seconds"] for row in rows], [row["error"] for row in rows]
    panel.step(seconds, errors, where="post", color="0.8", linewidth=7, solid_capstyle="round", label="front", zorder=0)
    panel.set_xscale("log")
    panel.set_yscale("log")
    if len(rows) == 1:  # a staircase of one step is no line
        panel.loglog(seconds, errors, "o", color="0.8", markersize=14, zorder=0)


def _ticks(panel: Any) -> None:
    """Labels at 1, 2 and 5 of each decade; errors in per cent."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis, form in ((panel.xaxis, lambda value, _: f"{value:g}"), (panel.yaxis, lambda value, _: f"{100 * value:g} %")):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(form))
        axis.set_minor_formatter(NullFormatter())


def _choice(panel: Any, choice: str, marker: str, colour: Any, rows: Sequence[Row]) -> None:
    """The resolutions of a choice, coarse to fine."""
    ordered = sorted(rows, key=lambda row: -row["particle_spacing"])
    panel.loglog(
        [row["seconds"] for row in ordered], [row["error"] for row in ordered], marker=marker, linestyle="-",
        color=colour, linewidth=2.2 if choice == DEFAULT else 0.9, markersize=6 if choice == DEFAULT else 5, label=choice,
        zorder=3 if choice == DEFAULT else 2,
    )  # fmt: skip


def _wrapped(text: str, width: int) -> list[str]:
    import textwrap

    return textwrap.wrap(text, width)
