"""The figure of a validation run: its particles at some times, and what was compared over the reference.

Made from a run folder alone, so that it can be drawn on another machine than the one that computed the run.
"""

from __future__ import annotations

import importlib.util
import json
import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.references import ReferenceInterface
from warpsph.errors import CaseError, Problem
from warpsph.files.whole_files import whole_file
from warpsph.study import plot
from warpsph.study.comparison import Compared, compared
from warpsph.study.segments import read_segments

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

    from warpsph.case.case import Case

WIDTH = 12.0
"""Width of a figure [inch]."""

_HIGHEST = 6.5  # of the particles [inch]
_WORTH = 1.3  # how much larger pictures have to become for one more row of them
_BESIDE = 2.0  # what colour bar and labels take of the width [inch]
_CURVE_COLUMNS = 3
_CURVE_HEIGHT = 2.9  # of a panel of curves [inch]
# reductions whose result is no value of the column
_NO_VALUES = ("period", "peak_time", "trough_time", "noise", "frequency", "amplitude", "strouhal")
_LONGEST_LABEL = 34  # letters beside a panel of curves; longer arithmetic of columns takes more lines
_FEW = 25  # reference points that are drawn one by one
_MOST_POINTS = 20_000  # particles in one panel against their exact values
_SAME_TIME = 5e-3  # share of a time within which a reference interface belongs to a picture


def can_draw() -> bool:
    """Whether matplotlib is installed."""
    return importlib.util.find_spec("matplotlib") is not None


def draw_validation(folder: Path, case: Case, title: str, output: Path) -> Path:
    """Draw the figure of a validation run and return its path.

    folder: run folder
    case: case of the run, with reference files that can be found; its `validation.figure` says what of the particles
        is shown (default: the phases, or the speed of a single one, at four times)
    title: stands above the figure
    output: PNG file

    Raises CaseError if the run has no particle files or not the field, OutputError if a file cannot be read or written.
    """
    from matplotlib.figure import Figure

    shown = case.validation.figure
    field = shown.field if shown is not None else "phase" if len(case.phases) > 1 else "speed"
    phases = plot.shown_phases(case.phase_names, None if shown is None else shown.phases)
    series, walls = plot.read_series(folder)
    times = shown.times if shown is not None and shown.times is not None else _four(series.frames)
    # A run that ended early is shown as far as it came.
    reached = np.clip(times, series.frames[0][0], series.frames[-1][0]).tolist()
    frames = [plot.read_frame(series, walls, frame) for frame in plot.choose_frames(series.frames, reached)]
    view = plot.view_of(*_corners(frames, case), frames[0].fluid.particle_spacing, None)
    frames = [view.cut(frame).only(phases) for frame in frames]
    panels = _panels_of(compared(case, folder))

    columns, size = _arrange(len(frames), view.aspect)
    rows = math.ceil(len(frames) / columns)
    above = rows * (size * view.aspect + 0.4) + 0.8
    below = _CURVE_HEIGHT * math.ceil(len(panels) / _CURVE_COLUMNS)
    figure = Figure(figsize=(WIDTH, above + below), layout="constrained")
    figure.suptitle(title)
    upper: FigureBase = figure
    if panels:
        parts: Any = figure.subfigures(2, 1, height_ratios=[above, below])
        upper = parts[0]
        _draw_panels(parts[1], panels, _results(folder))
    _draw_particles(upper, columns, frames, view, field, case)
    with whole_file(output) as temporary:
        figure.savefig(temporary, dpi=150, format="png")
    return output


def _four(frames: Sequence[tuple[float, str]]) -> list[float]:
    """Four times from the first frame to the last one, evenly spread [s]."""
    first, last = frames[0][0], frames[-1][0]
    return [first + share * (last - first) / 3 for share in range(4)]


def _corners(frames: Sequence[plot.Frame], case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3,) of what is shown: the fluid, other than spray that has left the domain, and the walls [m]."""
    inside = np.zeros((2, 3))
    inside[0, : case.dimension], inside[1, : case.dimension] = case.domain.lower, case.domain.upper
    corners = []
    for frame in frames:
        corners.append(np.clip(plot.corners_of(plot.Frame(frame.time, frame.fluid, None)), *inside))
        if frame.wall is not None:
            corners.append(np.array(plot.corners_of(plot.Frame(frame.time, frame.wall, None))))
    return np.min([lower for lower, _ in corners], axis=0), np.max([upper for _, upper in corners], axis=0)


def _results(folder: Path) -> Mapping[str, Mapping[str, Any]]:
    """What summary.json says of each compared quantity; empty if it cannot be read (it costs the numbers only)."""
    try:
        found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["errors"]
    except (OSError, ValueError, LookupError, TypeError):
        return {}
    return found if isinstance(found, dict) else {}


# ---- particles -------------------------------------------------------------------------------------------


def _arrange(count: int, aspect: float) -> tuple[int, float]:
    """Columns of `count` pictures of an aspect (height / width), and the width of one [inch]."""
    best = (1, 0.0)
    for rows in range(1, count + 1):
        columns = math.ceil(count / rows)
        width = min((WIDTH - _BESIDE) / columns - 0.1, (_HIGHEST / rows - 0.4) / aspect)
        if width > _WORTH * best[1]:
            best = (columns, width)
    return best


def _draw_particles(
    figure: FigureBase, columns: int, cuts: list[plot.Frame], view: plot.View, field: str, case: Case
) -> None:
    """One panel a frame, cut to the view, with the reference interface of its time where the case names one."""
    fields = [plot.field_of(cut, view, field) for cut in cuts]
    scale = plot.scale_of(field, np.concatenate(fields))
    rows = math.ceil(len(cuts) / columns)
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).flat)
    for unused in axes[len(cuts) :]:
        unused.remove()
    axes = axes[: len(cuts)]
    for panel, cut, values in zip(axes, cuts, fields, strict=True):
        plot.draw_frame(panel, view, cut, values, scale)
        for line in _interfaces(case, cut.time):
            plot.draw_segments(panel, line)
        plot.set_axes(panel, view)
        panel.set_title(f"t = {cut.time:.4g} s", fontsize="medium")
        panel.label_outer()
    scale.bar(figure, axes, view, case.phase_names)


def _interfaces(case: Case, time: float) -> list[np.ndarray]:
    """Segments (n, 2, 2) [m] of the reference interfaces of a time [s]; of each file once."""
    lines = [entry.interface for entry in case.reference.values() if isinstance(entry, ReferenceInterface)]
    here = {line.file: line for line in lines if math.isclose(line.time, time, rel_tol=_SAME_TIME, abs_tol=1e-9)}
    return [
        read_segments(case.reference_file(line.file), line.scale, line.offset, line.mirror) for line in here.values()
    ]


# ---- curves ----------------------------------------------------------------------------------------------


def _panels_of(entries: Sequence[Compared]) -> list[list[Compared]]:
    """The entries by panel: those that compare the same column of the same kind share one."""
    panels: dict[tuple[str, str], list[Compared]] = {}
    for entry in entries:
        panels.setdefault((entry.kind, f"{entry.gauge} {entry.label}"), []).append(entry)
    return list(panels.values())


def _draw_panels(
    figure: FigureBase, panels: list[list[Compared]], results: Mapping[str, Mapping[str, Any]]
) -> None:
    rows = math.ceil(len(panels) / _CURVE_COLUMNS)
    axes = list(figure.subplots(rows, math.ceil(len(panels) / rows), squeeze=False).flat)
    for unused in axes[len(panels) :]:
        unused.remove()
    for panel, entries in zip(axes, panels, strict=False):
        draw = {"value": _draw_value, "curve": _draw_curve, "curves": _draw_profiles, "exact": _draw_exact}
        draw[entries[0].kind](panel, entries, results)
        panel.grid(alpha=0.3)
        found = [results.get(entry.quantity, {}) for entry in entries]
        told = [_told(entry.quantity, result) for entry, result in zip(entries, found, strict=True)]
        missed = any(result.get("passed") is False for result in found)
        panel.set_title("\n".join(told), fontsize="medium", color="firebrick" if missed else "black")


def _told(quantity: str, result: Mapping[str, Any]) -> str:
    """Name of a quantity and its error, e.g. `decay 0.7 % (allowed 2 %)`."""
    error, allowed = result.get("error"), result.get("allowed")
    if error is None:
        return quantity

    def share(value: float) -> str:
        return f"{value:.3g}" if _is_absolute(result) else f"{100 * value:.3g} %"

    return f"{quantity}: error {share(error)}" + (f" (allowed {share(allowed)})" if allowed is not None else "")


def _is_absolute(result: Mapping[str, Any]) -> bool:
    return str(result.get("note", "")).startswith("absolute")


def _axis(entry: Compared) -> str:
    text = entry.label.replace("_", " ") + (f" [{entry.unit}]" if entry.unit not in ("", "1") else "")
    return textwrap.fill(text, _LONGEST_LABEL, break_long_words=False, break_on_hyphens=False)


def _draw_value(panel: Axes, entries: list[Compared], results: Mapping[str, Mapping[str, Any]]) -> None:
    """The column over time; over the times that count the reference, and how far off it may be."""
    times, values = entries[0].run[0.0]
    panel.plot(times, values, color="C0", linewidth=1.3, label="run", marker="." if len(times) < 3 else None)
    for entry in entries:
        start, end = entry.window or (times[0], times[-1])
        if entry.reduce == "final":
            start = end - 0.1 * (end - start)
        if entry.reduce in _NO_VALUES:
            if entry.reduce.endswith("_time"):
                panel.axvline(entry.value, color="black", linestyle="--", linewidth=1.0, label="reference")
            continue
        value, result = entry.value, results.get(entry.quantity, {})
        allowed = result.get("allowed")
        size = 1.0 if _is_absolute(result) else abs(value)
        if entry.reduce == "change":  # relative to the first row that counts
            first = values[np.searchsorted(times, start * (1 - 1e-9))]
            value, size = (1.0 + value) * first, abs(first)
        panel.plot([start, end], [value] * 2, color="black", linestyle="--", linewidth=1.0, label="reference")
        if allowed is not None:
            low = 0.0 if value == 0 and np.nanmin(values) >= 0 else value - allowed * size
            panel.fill_between([start, end], low, value + allowed * size, color="black", alpha=0.1, linewidth=0)
    panel.set(xlabel="t [s]", ylabel=_axis(entries[0]))
    _legend(panel)


def _draw_curve(panel: Axes, entries: list[Compared], _results: Mapping[str, Mapping[str, Any]]) -> None:
    """The column over time over the reference curve, of which the times of the run are shown."""
    for number, entry in enumerate(entries):
        times, values = entry.run[0.0]
        if number == 0:
            panel.plot(times, values, color="C0", linewidth=1.6, label="run")
        at, known = entry.reference[0.0]
        margin = 1e-9 * max(abs(times[0]), abs(times[-1]))
        seen = (at >= times[0] - margin) & (at <= times[-1] + margin)
        _draw_reference(panel, at[seen], known[seen], "reference")
    panel.set(xlabel="t [s]", ylabel=_axis(entries[0]))
    _legend(panel)


def _draw_profiles(panel: Axes, entries: list[Compared], _results: Mapping[str, Mapping[str, Any]]) -> None:
    """Profiles along the line, a colour a time, over the reference profiles."""
    from matplotlib import colormaps

    run = {time: points for entry in entries for time, points in entry.run.items()}
    colours = colormaps["viridis"](np.linspace(0.0, 0.85, max(len(run), 2)))
    for (time, points), colour in zip(sorted(run.items()), colours, strict=False):
        panel.plot(*points, color=colour, linewidth=1.6, label=f"t = {time:.4g} s")
    for number, points in enumerate(points for entry in entries for points in entry.reference.values()):
        _draw_reference(panel, *points, "reference" if number == 0 else "")
    panel.set(xlabel="distance along the line [m]", ylabel=_axis(entries[0]))
    _legend(panel)


def _draw_reference(panel: Axes, x: np.ndarray, y: np.ndarray, label: str) -> None:
    """A reference curve: points where there are few, else a dashed line."""
    style: dict[str, Any] = {"linestyle": "--", "linewidth": 1.0}
    if len(x) <= _FEW:
        style = {"linestyle": "none", "marker": "o", "markersize": 3.5, "markerfacecolor": "none"}
    panel.plot(x, y, color="black", label=label or None, **style)


def _draw_exact(panel: Axes, entries: list[Compared], _results: Mapping[str, Mapping[str, Any]]) -> None:
    """What the particles have over what they should have."""
    exact, values = entries[0].run[0.0]
    every = max(1, math.ceil(len(exact) / _MOST_POINTS))
    panel.plot(exact[::every], values[::every], ".", color="C0", markersize=1.5, label="particles")
    ends = [float(np.nanmin(exact)), float(np.nanmax(exact))]
    panel.plot(ends, ends, color="black", linestyle="--", linewidth=1.0, label="exact")
    panel.set(xlabel="exact " + _axis(entries[0]), ylabel=_axis(entries[0]))
    _legend(panel)


def _legend(panel: Axes) -> None:
    """A legend with each label once."""
    handles, labels = panel.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    panel.legend(once.values(), once.keys(), fontsize="small")


# ---- reference files -------------------------------------------------------------------------------------


def case_of_run(folder: Path, references: Sequence[Path] = ()) -> Case:
    """The case of a run folder.

    references: folders in which reference files are looked for by name if they are not where the run found them, which
        is so when it was computed on another machine.

    Raises CaseError if the case cannot be read.
    """
    from warpsph.case.case import Case
    from warpsph.case.case_file import read_yaml

    path = folder / "case.yaml"
    try:
        data = read_yaml(path.read_text(encoding="utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError([Problem(str(path), "", f"cannot be read: {error}", "name a run folder")]) from error
    if isinstance(data, dict):
        for holder, key in _file_places(data):
            if not (folder / str(holder[key])).is_file():
                name = Path(str(holder[key])).name
                holder[key] = str(next((f / name for f in references if (f / name).is_file()), holder[key]))
    return Case.from_dict(data, folder)


def _file_places(data: dict[str, Any]) -> list[tuple[dict[Any, Any], Any]]:
    """Where a plain case names reference files: the mapping and the key."""
    places: list[tuple[dict[Any, Any], Any]] = []
    for reference in (data.get("reference") or {}).values():
        places += [(reference[part], "file") for part in ("curve", "curves", "interface") if part in reference]
    return places


