"""Pictures of a run, made from its run folder: particles coloured by a field, and curves of its gauges."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case_file import read_yaml
from warpsph.errors import CaseError, OutputError, Problem
from warpsph.gauges import FIELD_UNITS, VECTOR_FIELDS, read_gauge
from warpsph.output import Series, read_vtp
from warpsph.snapshot import Snapshot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNITS = FIELD_UNITS | {"mass": "kg", "phase": "1", "volume": "m^3"}
"""Unit of each field that can be drawn; in 2-D mass and volume are per metre of depth."""

_UNITS_2D = {"mass": "kg/m", "volume": "m^2"}
_AXES = "xyz"
_WALL_COLOUR = "0.75"
_DISC = 2 / math.sqrt(math.pi)  # diameter / spacing of a disc as large as a particle's share of the plane
_LONGEST_CURVE = 5000  # points; more than a picture can show
_MOST_CURVES = 8  # in one panel


def plot_run(
    folder: Path | str,
    field: str = "pressure",
    times: Sequence[float] | None = None,
    output: Path | str | None = None,
    slice_axis: str | None = None,
) -> list[Path]:
    """Draw the particles of a run at some times and the curves of its gauges; return the PNG files written.

    folder: run folder
    field: a scalar field of the particle files, a component of a vector (velocity_x), or the magnitude of a
        vector (velocity; speed is the same)
    times: s; for each the nearest frame is drawn (default: the first, the middle and the last frame)
    output: PNG of the particles (default: plots/<field>.png in the run folder); the gauges go beside it, to
        <output>_gauges.png (default: plots/gauges.png)
    slice_axis: "x", "y" or "z": in 3-D the axis that the slice through the middle is normal to (default: the
        shortest side of the scene)

    Raises CaseError if there is no such run or no such field in it, OutputError if a file cannot be read or
    written.
    """
    folder = Path(folder)
    series, walls = _read_series(folder)
    if output is None:
        particles_png, gauges_png = folder / "plots" / f"{field}.png", folder / "plots" / "gauges.png"
    else:
        particles_png = Path(output)
        gauges_png = particles_png.with_name(f"{particles_png.stem}_gauges{particles_png.suffix}")

    frames = [_read_frame(series, walls, name) for name in _choose(series.frames, times)]
    frames, plane, note = _slice(frames, slice_axis)
    names = _phase_names(folder)
    written = [_save(_draw_particles(frames, plane, field, note, names), particles_png)]
    curves = _draw_gauges(sorted((folder / "gauges").glob("*.csv")))
    if curves is not None:
        written.append(_save(curves, gauges_png))
    return written


@dataclass
class _Frame:
    """What one panel shows."""

    time: float  # s
    fluid: Snapshot
    wall: Snapshot | None


# ---- reading ---------------------------------------------------------------------------------------------


def _read_series(folder: Path) -> tuple[Series, Series]:
    """The frames of the fluid, of which there is at least one, and of the walls."""
    if not folder.is_dir():
        remedy = "name the folder of a run, e.g. runs/drop"
        raise CaseError([Problem("RUN", str(folder), "no such folder", remedy)])
    series, walls = Series(folder / "particles", "fluid"), Series(folder / "particles", "wall")
    series.read()
    walls.read()
    if not series.frames:
        rule = f"no particle files listed in {series.path.relative_to(folder)}"
        raise CaseError([Problem("RUN", str(folder), rule, "name a run with output.particles switched on")])
    return series, walls


def _choose(frames: list[tuple[float, str]], times: Sequence[float] | None) -> list[tuple[float, str]]:
    """The frames nearest to `times` [s], each once and in order of time."""
    if times is None:
        chosen = {0, (len(frames) - 1) // 2, len(frames) - 1}
    else:
        stored = np.array([time for time, _ in frames])
        chosen = {int(np.argmin(np.abs(stored - time))) for time in times}
    return [frames[index] for index in sorted(chosen)]


def _read_frame(series: Series, walls: Series, frame: tuple[float, str]) -> _Frame:
    time, name = frame
    folder = series.path.parent
    # Walls at rest are written once: the last frame up to this time holds.
    wall_name = next((wall for moment, wall in reversed(walls.frames) if moment <= time * (1 + 1e-9)), None)
    return _Frame(time, read_vtp(folder / name), read_vtp(folder / wall_name) if wall_name else None)


def _phase_names(folder: Path) -> list[str]:
    """Names of the phases from the run's case.yaml; empty if that cannot be read (it costs a legend only)."""
    try:
        return list(read_yaml((folder / "case.yaml").read_text(encoding="utf-8"))["phases"])
    except (OSError, ValueError, LookupError, TypeError, CaseError):
        return []


# ---- geometry --------------------------------------------------------------------------------------------


def _box(frames: list[_Frame]) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3,) of all particles, those of a run that went wrong at infinity left out [m]."""
    parts = [part for frame in frames for part in (frame.fluid, frame.wall) if part is not None]
    position = np.concatenate([part.position for part in parts])
    position = position[np.isfinite(position).all(axis=1)]
    if len(position) == 0:
        return np.zeros(3), np.ones(3)
    return position.min(axis=0), position.max(axis=0)


def _slice(frames: list[_Frame], slice_axis: str | None) -> tuple[list[_Frame], tuple[int, int], str]:
    """Cut 3-D frames to a slice through the middle; also the two axes to draw and a note on the slice.

    Frames of a 2-D run come back as they are, with an empty note.
    """
    lower, upper = _box(frames)
    extent = upper - lower
    if slice_axis is None:
        if extent[2] == 0:
            return frames, (0, 1), ""
        axis = 2 - int(np.argmin(extent[::-1]))  # the last of equally short sides
    elif slice_axis in _AXES:
        axis = _AXES.index(slice_axis)
    else:
        raise CaseError([Problem("slice_axis", slice_axis, "no such axis", "choose from: x, y, z")])
    middle = 0.5 * (lower[axis] + upper[axis])
    half = 0.5 * frames[0].fluid.particle_spacing * (1 + 1e-5)

    def cut(part: Snapshot) -> Snapshot:
        return part.select(np.abs(part.position[:, axis] - middle) <= half)

    cuts = [_Frame(f.time, cut(f.fluid), None if f.wall is None else cut(f.wall)) for f in frames]
    first, second = (other for other in range(3) if other != axis)
    return cuts, (first, second), f"slice at {_AXES[axis]} = {middle:.4g} m"


def _parse_field(field: str) -> tuple[str, int | None]:
    """Name of the stored field and, for velocity_x and the like, the component."""
    if field == "speed":
        return "velocity", None
    name, _, component = field.rpartition("_")
    if name in VECTOR_FIELDS and component and component in _AXES:
        return name, _AXES.index(component)
    return field, None


def _written(part: Snapshot, name: str) -> bool:
    """True if the particle file holds the field: what it lacks is read as NaN, the phase as -1."""
    values = getattr(part, name)
    if values is None:
        return False
    return len(values) == 0 or bool(np.any(values >= 0) if name == "phase" else not np.all(np.isnan(values)))


def _values(part: Snapshot, field: str) -> np.ndarray:
    """(n,) values of a field, of a component or of the magnitude of a vector. Raises CaseError if absent."""
    name, axis = _parse_field(field)
    if name not in UNITS or not _written(part, name):
        remedy = f"choose from: {', '.join(known for known in UNITS if _written(part, known))}"
        raise CaseError([Problem("field", field, "not in the particle files of this run", remedy)])
    values: np.ndarray = getattr(part, name)
    if values.ndim == 1:
        return values
    return np.linalg.norm(values, axis=1) if axis is None else values[:, axis]


# ---- particles -------------------------------------------------------------------------------------------


def _draw_particles(
    frames: list[_Frame], plane: tuple[int, int], field: str, note: str, phase_names: list[str]
) -> "Figure":
    """One panel a frame, discs as large as the particles, one colour scale for all."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, Colormap, Normalize

    fields = [_values(frame.fluid, field) for frame in frames]
    everything = np.concatenate(fields)
    colours: str | Colormap
    norm: Normalize
    extend = "neither"
    if field == "phase":
        colours, norm = _phase_colours(everything)
    else:
        colours, norm, extend = _colour_scale(everything)

    spacing = frames[0].fluid.particle_spacing
    lower, upper = (corner[list(plane)] for corner in _box(frames))
    lower, upper = lower - spacing, upper + spacing
    width, height = upper - lower

    figure, axes = _panels(len(frames), height / width)
    for panel, frame, values in zip(axes, frames, fields, strict=True):
        if frame.wall is not None:
            _draw_discs(panel, frame.wall.position[:, plane], _DISC * spacing, color=_WALL_COLOUR)
        _draw_discs(
            panel, frame.fluid.position[:, plane], _DISC * spacing, array=values, cmap=colours, norm=norm
        )
        panel.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), aspect="equal")
        panel.set_title(f"t = {frame.time:.4g} s")
        panel.set_xlabel(f"{_AXES[plane[0]]} [m]")
        panel.set_ylabel(f"{_AXES[plane[1]]} [m]")
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=list(axes), extend=extend, aspect=30)
    bar.set_label(_label(field, flat=not note))
    if isinstance(norm, BoundaryNorm):
        ticks = range(int(norm.boundaries[0] + 0.5), int(norm.boundaries[-1] + 0.5))
        bar.set_ticks(list(ticks), labels=[phase_names[k] if k < len(phase_names) else str(k) for k in ticks])
    if note:
        figure.suptitle(note)
    return figure


def _panels(count: int, aspect: float) -> "tuple[Figure, list[Axes]]":
    """A figure of `count` panels whose height / width is `aspect`, in as many columns as look best."""
    from matplotlib.figure import Figure

    def ugliness(columns: int) -> float:
        """Distance from a figure 1.8 times as wide as high, and the panels missing in the last row."""
        rows = math.ceil(count / columns)
        return abs(math.log(columns / (rows * aspect) / 1.8)) + 0.3 * (rows * columns - count)

    columns = min(range(1, count + 1), key=ugliness)
    rows = math.ceil(count / columns)
    width = min(5.0, 16.0 / columns)
    height = min(max(width * aspect, 1.0), 9.0)
    figure = Figure(figsize=(width * columns + 1.5, (height + 0.7) * rows + 0.3), layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for unused in axes[count:]:
        unused.remove()
    return figure, axes[:count]


def _draw_discs(panel: "Axes", position: np.ndarray, diameter: float, **style: Any) -> None:
    """Discs of a diameter in the units of the axes, (n, 2) positions [m]."""
    from matplotlib.collections import EllipseCollection

    style.update(units="xy", offsets=position, offset_transform=panel.transData, linewidth=0)
    panel.add_collection(EllipseCollection([diameter], [diameter], [0.0], **style), autolim=False)


def _colour_scale(values: np.ndarray) -> tuple[str, Any, str]:
    """Colour map, scale and which ends are open; a few extreme particles do not stretch the scale."""
    from matplotlib.colors import Normalize

    finite = values[np.isfinite(values)].astype(float)
    if finite.size == 0:
        return "viridis", Normalize(0.0, 1.0), "neither"
    low, high = float(finite.min()), float(finite.max())
    inner_low, inner_high = (float(bound) for bound in np.percentile(finite, [0.5, 99.5]))
    open_low = low < inner_low - 0.5 * (inner_high - inner_low)
    open_high = high > inner_high + 0.5 * (inner_high - inner_low)
    if inner_high > inner_low:
        low, high = (inner_low if open_low else low), (inner_high if open_high else high)
    else:
        open_low = open_high = False
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
    if low < 0 < high and min(-low, high) > 0.2 * max(-low, high):
        bound = max(-low, high)
        return "RdBu_r", Normalize(-bound, bound), extend[open_low, open_high]
    # A constant field would leave a scale without width.
    margin = 0.0 if high - low > 1e-6 * max(abs(low), abs(high)) else 1e-3 * max(abs(low), abs(high), 1e-30)
    return "viridis", Normalize(low - margin, high + margin), extend[open_low, open_high]


def _phase_colours(values: np.ndarray) -> tuple[Any, Any]:
    """One colour a phase."""
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm, ListedColormap

    low, high = (int(values.min()), int(values.max())) if len(values) else (0, 0)
    palette = colormaps["tab10"]
    colours = ListedColormap([palette(k % 10) for k in range(low, high + 1)])
    return colours, BoundaryNorm(np.arange(low - 0.5, high + 1.0), high - low + 1)


def _label(field: str, flat: bool) -> str:
    """Name and unit of a field for an axis or colour bar."""
    name, _ = _parse_field(field)
    unit = _UNITS_2D.get(name, UNITS[name]) if flat else UNITS[name]
    title = "speed" if field == "velocity" else field.replace("_", " ")
    return _with_unit(title, unit)


def _with_unit(title: str, unit: str) -> str:
    return title if unit in ("", "1") else f"{title} [{unit}]".strip()


# ---- gauges ----------------------------------------------------------------------------------------------


@dataclass
class _Panel:
    """Curves that share their axes."""

    title: str
    x_label: str
    y_label: str
    curves: dict[str, tuple[np.ndarray, np.ndarray]]


def _draw_gauges(paths: list[Path]) -> "Figure | None":
    """One panel for each gauge and unit of its columns; None if there is nothing to draw."""
    panels = [panel for path in paths for panel in _gauge_panels(path)]
    if not panels:
        return None
    figure, axes = _panels(len(panels), 0.6)
    for drawn, panel in zip(axes, panels, strict=True):
        for label, (x, y) in panel.curves.items():
            every = max(1, math.ceil(len(x) / _LONGEST_CURVE))
            drawn.plot(x[::every], y[::every], label=label, linewidth=1.2, marker="." if len(x) < 3 else None)
        drawn.set(title=panel.title, xlabel=panel.x_label, ylabel=panel.y_label)
        drawn.grid(alpha=0.3)
        drawn.legend(fontsize="small")
    return figure


def _gauge_panels(path: Path) -> list[_Panel]:
    """What to draw of a gauge's file: its columns over time, or of a line the fields along it."""
    columns, units = read_gauge(path)
    time = columns.pop("time")
    if len(time) == 0:
        return []
    axes = [axis for axis in _AXES if axis in columns]
    if axes:
        return _sample_panels(path.stem, time, columns, units, axes)
    panels = []
    for unit in dict.fromkeys(units[name] for name in columns):
        curves = {name: (time, values) for name, values in columns.items() if units[name] == unit}
        panels.append(_Panel(path.stem, "t [s]", _with_unit("", unit), curves))
    return panels


def _sample_panels(
    title: str, time: np.ndarray, columns: dict[str, np.ndarray], units: dict[str, str], axes: list[str]
) -> list[_Panel]:
    """One panel a field for rows that belong to points: over time for a few points, else along the line."""
    points = np.column_stack([columns[axis] for axis in axes])
    count = int(np.argmax(time != time[0])) or len(time)  # rows of one time
    times = time[::count]
    panels = []
    for name in columns:
        if name in axes:
            continue
        curves = {}
        if count <= _MOST_CURVES:
            for k in range(count):
                label = "(" + ", ".join(f"{coordinate:.4g}" for coordinate in points[k]) + ")"
                curves[label] = (times, columns[name][k::count])
        else:
            along = np.linalg.norm(points[:count] - points[0], axis=1)
            shown = np.unique(
                np.linspace(0, len(times) - 1, min(len(times), _MOST_CURVES)).round().astype(int)
            )
            for k in shown:
                curves[f"t = {times[k]:.4g} s"] = (along, columns[name][k * count : (k + 1) * count])
        x_label = "t [s]" if count <= _MOST_CURVES else "distance along the line [m]"
        panels.append(_Panel(title, x_label, _with_unit(name.replace("_", " "), units[name]), curves))
    return panels


def _save(figure: "Figure", path: Path) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
    except ValueError as error:  # matplotlib knows no such format
        raise OutputError(f"{path}: cannot be written: {error}") from error
    return path
