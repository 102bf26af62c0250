"""Pictures of a run, made from its run folder: particles coloured by a field, and curves of its gauges."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.case_file import read_yaml
from warpsph.case.columns import FIELD_UNITS, VECTOR_FIELDS
from warpsph.errors import CaseError, OutputError, Problem
from warpsph.files.output import Series
from warpsph.files.vtp import read_vtp
from warpsph.files.whole_files import make_folder, whole_file
from warpsph.measure.gauge_files import read_gauge
from warpsph.snapshot import Snapshot
from warpsph.study.curl import vorticity
from warpsph.study.raster import owners

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import EllipseCollection
    from matplotlib.figure import Figure, FigureBase
    from matplotlib.lines import Line2D

UNITS = FIELD_UNITS | {"mass": "kg", "phase": "1", "volume": "m^3"}
"""Unit of each field that can be drawn; in 2-D mass and volume are per metre of depth."""

_UNITS_2D = {"mass": "kg/m", "volume": "m^2"}
_LONGEST_EDGE = 3.0  # of a triangle between neighbouring particles, in particle spacings
_AXES = "xyz"
WALL_COLOUR = "0.75"
DISC = 2 / math.sqrt(math.pi)  # diameter / spacing of a disc as large as a particle's share of the plane
_LEGEND = 0.12  # share of the height of a figure that a phase takes in the legend
_SLICE = 1.5  # spacings from a particle to the parts of a slice that can belong to it
_SLICE_PIXELS = 16, 1200  # of a spacing, and along the longer side of a slice at most
_LONGEST_CURVE = 5000  # points; more than a picture can show
_MOST_CURVES = 8  # in one panel
_ROUNDED = 1e-3  # share of the last time by which a time that is asked for may lie beyond it


def plot_run(
    folder: Path | str,
    field: str = "pressure",
    times: Sequence[float] | slice | None = None,
    output: Path | str | None = None,
    slice_axis: str | None = None,
    over: np.ndarray | None = None,
    phases: Sequence[str] | None = None,
) -> list[Path]:
    """Draw the particles of a run at some times and the curves of its gauges; return the PNG files written.

    In one dimension the particles are drawn as the field over x.

    folder: run folder
    field: a scalar field of the particle files, `vorticity`, a component of a vector (velocity_x), or the magnitude of a
        vector (velocity; speed is the same)
    times: s, within those of the run; for each the nearest frame is drawn, of slice(T1, T2) every frame from T1 to T2
        (default: the first, the middle and the last frame)
    output: PNG of the particles (default: plots/<field>.png in the run folder); the gauges go beside it, to
        <output>_gauges.png (default: plots/gauges.png)
    slice_axis: "x", "y" or "z": in 3-D the axis that the slice through the middle is normal to (default: the
        shortest side of the scene)
    over: (n, 2, 2) segments that are drawn over the particles of every frame, see `read_segments` [m]
    phases: names of the phases that are drawn, the others are left white (default: all)

    Raises CaseError if there is no such run or no such field, time or phase in it, OutputError if a file cannot be read
    or written.
    """
    folder = Path(folder)
    series, walls = read_series(folder)
    if output is None:
        particles_png, gauges_png = folder / "plots" / f"{field}.png", folder / "plots" / "gauges.png"
    else:
        particles_png = Path(output)
        gauges_png = particles_png.with_name(f"{particles_png.stem}_gauges{particles_png.suffix}")

    frames = [read_frame(series, walls, name) for name in choose_frames(series.frames, times)]
    corners = [corners_of(frame) for frame in frames]
    view = view_of(
        np.min([lower for lower, _ in corners], axis=0),
        np.max([upper for _, upper in corners], axis=0),
        frames[0].fluid.particle_spacing,
        slice_axis,
    )
    names = phase_names(folder)
    shown = shown_phases(names, phases)
    frames = [view.cut(frame).only(shown) for frame in frames]
    on_line = all(not frame.fluid.position[:, 1:].any() for frame in frames)
    picture = _draw_profiles(frames, view, field) if on_line else _draw_particles(frames, view, field, names, over)
    written = [_save(picture, particles_png)]
    curves = _draw_gauges(sorted((folder / "gauges").glob("*.csv")))
    if curves is not None:
        written.append(_save(curves, gauges_png))
    return written


@dataclass
class Frame:
    """What one picture of the particles shows."""

    time: float  # s
    fluid: Snapshot
    wall: Snapshot | None

    def only(self, phases: Sequence[int] | None) -> "Frame":
        """The frame without the fluid of other phases, given by their numbers; None takes all."""
        if phases is None:
            return self
        if not _written(self.fluid, "phase"):
            remedy = "run again with phase in output.particles.fields, or draw all of them"
            raise CaseError([Problem("phases", list(phases), "the particle files of this run hold no phase", remedy)])
        return Frame(self.time, self.fluid.select(np.isin(self.fluid.phase, phases)), self.wall)


# ---- reading ---------------------------------------------------------------------------------------------


def read_series(folder: Path) -> tuple[Series, Series]:
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


def choose_frames(
    frames: list[tuple[float, str]], times: Sequence[float] | slice | None
) -> list[tuple[float, str]]:
    """The frames nearest to `times` [s], each once and in order of time; of a slice(T1, T2) all from T1 to T2.

    Raises CaseError if a time is before the first frame or after the last one, or no frame is within the slice.
    """
    stored = np.array([time for time, _ in frames])
    if times is None:
        chosen = {0, (len(frames) - 1) // 2, len(frames) - 1}
    elif isinstance(times, slice):
        start = -math.inf if times.start is None else times.start - 1e-9 * abs(times.start)
        stop = math.inf if times.stop is None else times.stop + 1e-9 * abs(times.stop)
        chosen = set(np.flatnonzero((start <= stored) & (stored <= stop)).tolist())
        if not chosen:
            given = ":".join("" if end is None else f"{end:g}" for end in (times.start, times.stop))
            remedy = f"the run has frames from {stored[0]:g} to {stored[-1]:g} s"
            raise CaseError([Problem("times", given, "no frame of the run is within", remedy)])
    else:
        # A time may be rounded as the titles of pictures are.
        slack = _ROUNDED * float(np.abs(stored).max())
        beyond = [time for time in times if not stored[0] - slack <= time <= stored[-1] + slack]
        if beyond:
            given = ",".join(f"{time:g}" for time in beyond)
            remedy = f"the run has frames from {stored[0]:g} to {stored[-1]:g} s"
            raise CaseError([Problem("times", given, "no frame of the run is near", remedy)])
        chosen = {int(np.argmin(np.abs(stored - time))) for time in times}
    return [frames[index] for index in sorted(chosen)]


def read_frame(series: Series, walls: Series, frame: tuple[float, str]) -> Frame:
    """The particles of an entry of `series.frames`, with the walls as they are then."""
    time, name = frame
    folder = series.path.parent
    # Walls at rest are written once: the last frame up to this time holds.
    wall_name = next((wall for moment, wall in reversed(walls.frames) if moment <= time * (1 + 1e-9)), None)
    return Frame(time, read_vtp(folder / name), read_vtp(folder / wall_name) if wall_name else None)


def phase_names(folder: Path) -> list[str]:
    """Names of the phases from the run's case.yaml; empty if that cannot be read (it costs a legend only)."""
    try:
        return list(read_yaml((folder / "case.yaml").read_text(encoding="utf-8"))["phases"])
    except (OSError, ValueError, LookupError, TypeError, CaseError):
        return []


def shown_phases(names: Sequence[str], phases: Sequence[str] | None) -> list[int] | None:
    """Numbers of the phases that are to be drawn, None for all. Raises CaseError for a name that is none of `names`."""
    if phases is None:
        return None
    unknown = [phase for phase in phases if phase not in names]
    if unknown or not phases:
        remedy = f"choose from: {', '.join(names)}" if names else "leave it out: the run's case.yaml cannot be read"
        raise CaseError([Problem("phases", ",".join(unknown), "is no phase of this run", remedy)])
    return sorted(names.index(phase) for phase in phases)


# ---- geometry --------------------------------------------------------------------------------------------


def corners_of(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3,) of all particles, those of a run that went wrong at infinity left out [m]."""
    parts = [part for part in (frame.fluid, frame.wall) if part is not None]
    position = np.concatenate([part.position for part in parts])
    position = position[np.isfinite(position).all(axis=1)]
    if len(position) == 0:
        return np.zeros(3), np.ones(3)
    return position.min(axis=0), position.max(axis=0)


@dataclass(frozen=True)
class View:
    """Which part of a scene a picture shows."""

    axes: tuple[int, int]
    """the axes to the right and upwards"""
    lower: np.ndarray
    """(2,) lower corner of the picture [m]"""
    upper: np.ndarray
    """(2,) upper corner of the picture [m]"""
    spacing: float
    """distance of the particles [m]"""
    middle: float | None
    """where the third axis is cut [m]; None in 2-D"""

    @property
    def aspect(self) -> float:
        """Height over width."""
        return float((self.upper[1] - self.lower[1]) / (self.upper[0] - self.lower[0]))

    @property
    def note(self) -> str:
        """Where the slice is; empty in 2-D."""
        return "" if self.middle is None else f"slice at {_AXES[3 - sum(self.axes)]} = {self.middle:.4g} m"

    def cut(self, frame: Frame) -> Frame:
        """The particles of a frame that the slice may meet; in 2-D the frame as it is."""
        if self.middle is None:
            return frame
        reach = _SLICE * self.spacing

        def part(of: Snapshot) -> Snapshot:
            return of.select(np.abs(self.depth(of)) <= reach)

        return Frame(frame.time, part(frame.fluid), None if frame.wall is None else part(frame.wall))

    def depth(self, part: Snapshot) -> np.ndarray:
        """(n,) distances from the slice, signed [m]; 0 in 2-D."""
        if self.middle is None:
            return np.zeros(len(part))
        return np.asarray(part.position[:, 3 - sum(self.axes)] - self.middle)

    def place(self, part: Snapshot) -> np.ndarray:
        """(n, 2) positions in the picture [m]."""
        return part.position[:, self.axes]


def view_of(lower: np.ndarray, upper: np.ndarray, spacing: float, slice_axis: str | None) -> View:
    """The view of particles between two corners (3,) [m]; in 3-D a slice through the middle.

    slice_axis: axis that the slice is normal to; None for the shortest side of the scene. Raises CaseError for any
    other name than x, y, z.
    """
    extent = upper - lower
    middle: float | None = None
    axis = 2
    if slice_axis is not None and slice_axis not in _AXES:
        raise CaseError([Problem("slice_axis", slice_axis, "no such axis", "choose from: x, y, z")])
    if slice_axis is not None or extent[2] > 0:
        # by default the last of equally short sides
        axis = 2 - int(np.argmin(extent[::-1])) if slice_axis is None else _AXES.index(slice_axis)
        middle = float(0.5 * (lower[axis] + upper[axis]))
    first, second = (other for other in range(3) if other != axis)
    shown = [first, second]
    return View((first, second), lower[shown] - spacing, upper[shown] + spacing, spacing, middle)


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


def values_of(part: Snapshot, field: str) -> np.ndarray:
    """(n,) values of a field, of a component or of the magnitude of a vector. Raises CaseError if absent."""
    name, axis = _parse_field(field)
    if name not in UNITS or not _written(part, name):
        remedy = f"choose from: {', '.join(known for known in UNITS if _written(part, known))}"
        raise CaseError([Problem("field", field, "not in the particle files of this run", remedy)])
    values: np.ndarray = getattr(part, name)
    if values.ndim == 1:
        return values
    return np.linalg.norm(values, axis=1) if axis is None else values[:, axis]


def field_of(frame: Frame, view: "View", field: str) -> np.ndarray:
    """(n,) values of what colours the fluid of a frame, which is cut to the view. Raises CaseError if absent.

    Vorticity that the particle files do not hold is found from the velocities in the plane of the picture.
    """
    fluid = frame.fluid
    if field != "vorticity" or _written(fluid, "vorticity") or not _written(fluid, "velocity"):
        return values_of(fluid, field)
    return vorticity(view.place(fluid), fluid.velocity[:, view.axes], _LONGEST_EDGE * view.spacing)


# ---- particles -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ColourScale:
    """How the values of a field become colours."""

    field: str
    colours: Any  # name of a colour map, or the map
    norm: Any  # matplotlib's Normalize
    extend: str  # which ends are open: neither, min, max or both

    def rgba(self, values: np.ndarray) -> np.ndarray:
        """(n, 4) uint8 colours of values (n,)."""
        from matplotlib import colormaps

        colours = colormaps[self.colours] if isinstance(self.colours, str) else self.colours
        return np.asarray(colours(self.norm(values), bytes=True))

    def bar(self, figure: "FigureBase", axes: "list[Axes]", view: View, names: list[str]) -> None:
        """Draw the colour bar of some panels; `names` are those of the phases."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import BoundaryNorm

        mappable = ScalarMappable(self.norm, self.colours)
        if not isinstance(self.norm, BoundaryNorm):
            bar = figure.colorbar(mappable, ax=axes, extend=self.extend, aspect=30)
        else:  # a legend: one short field a phase
            count = len(self.norm.boundaries) - 1
            share = min(1.0, _LEGEND * count)
            bar = figure.colorbar(mappable, ax=axes, shrink=share, aspect=30 * share, drawedges=True)
            ticks = range(int(self.norm.boundaries[0] + 0.5), int(self.norm.boundaries[-1] + 0.5))
            bar.set_ticks(list(ticks), labels=[names[k] if k < len(names) else str(k) for k in ticks])
        bar.set_label(_label(self.field, flat=view.middle is None))


def scale_of(field: str, values: np.ndarray) -> ColourScale:
    """The colour scale for all `values` of a field that are to be shown."""
    if field == "phase":
        return ColourScale(field, *_phase_colours(values), "neither")
    return ColourScale(field, *_colour_scale(values))


def set_axes(panel: "Axes", view: View) -> None:
    """Give a panel the limits and labels of a view."""
    (left, bottom), (right, top) = view.lower, view.upper
    panel.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    panel.set_xlabel(f"{_AXES[view.axes[0]]} [m]")
    panel.set_ylabel(f"{_AXES[view.axes[1]]} [m]")
    space_ticks(panel)


def space_ticks(panel: "Axes") -> None:
    """Keep the labels of ticks apart: few along x, and lengths of millimetres with one power of ten for all."""
    panel.locator_params(axis="x", nbins=5)
    panel.ticklabel_format(scilimits=(-2, 4))


def _draw_particles(
    frames: list[Frame], view: View, field: str, names: list[str], over: np.ndarray | None
) -> "Figure":
    """One panel a frame, discs as large as the particles, one colour scale for all."""
    fields = [field_of(frame, view, field) for frame in frames]
    scale = scale_of(field, np.concatenate(fields))
    figure, axes = _panels(len(frames), view.aspect)
    for panel, frame, values in zip(axes, frames, fields, strict=True):
        draw_frame(panel, view, frame, values, scale)
        if over is not None:
            draw_segments(panel, over)
        set_axes(panel, view)
        panel.set_title(f"t = {frame.time:.4g} s")
    scale.bar(figure, axes, view, names)
    if view.note:
        figure.suptitle(view.note)
    return figure


def _draw_profiles(frames: list[Frame], view: View, field: str) -> "Figure":
    """The field over x of a scene of one dimension, one panel a frame, the same axes for all."""
    fields = [field_of(frame, view, field) for frame in frames]
    shared = np.concatenate([values[np.isfinite(values)] for values in fields])
    low, high = float(shared.min(initial=0.0)), float(shared.max(initial=0.0))
    margin = 0.05 * (high - low) or 1.0
    figure, axes = _panels(len(frames), 1.5)
    for panel, frame, values in zip(axes, frames, fields, strict=True):
        panel.plot(frame.fluid.position[:, 0], values, ".", markersize=3)
        panel.set(xlim=(view.lower[0], view.upper[0]), ylim=(low - margin, high + margin))
        panel.set_xlabel("x [m]")
        panel.set_ylabel(_label(field, flat=False))
        space_ticks(panel)
        panel.set_title(f"t = {frame.time:.4g} s")
    return figure


def save_frames(
    frames: list[Frame], field: str, path: Path, names: list[str], slice_axis: str | None = None
) -> Path:
    """Draw frames as panels of one picture, a slice of them in 3-D, and return its path; arguments as of `plot_run`.

    Raises CaseError if a frame has no such field, OutputError if the file cannot be written.
    """
    corners = [corners_of(frame) for frame in frames]
    lower, upper = (np.array(ends) for ends in zip(*corners, strict=True))
    view = view_of(lower.min(axis=0), upper.max(axis=0), frames[0].fluid.particle_spacing, slice_axis)
    return _save(_draw_particles([view.cut(frame) for frame in frames], view, field, names, None), path)


def draw_frame(panel: "Axes", view: View, frame: Frame, values: np.ndarray, scale: ColourScale) -> None:
    """Draw a frame that is cut to the view: in 2-D its particles as discs, in 3-D what the slice meets.

    values: (n,) of the fluid's particles, in the colours of the scale
    """
    if view.middle is None:
        if frame.wall is not None:
            draw_discs(panel, view.place(frame.wall), view.spacing, color=WALL_COLOUR)
        draw_discs(panel, view.place(frame.fluid), view.spacing, array=values, cmap=scale.colours, norm=scale.norm)
        return
    width, height = view.upper - view.lower
    pixels = min(_SLICE_PIXELS[0] / view.spacing, _SLICE_PIXELS[1] / max(width, height))  # of a metre
    shape = max(round(height * pixels), 1), max(round(width * pixels), 1)
    picture = slice_picture(view, frame, scale.rgba(values), shape)
    extent = (view.lower[0], view.upper[0], view.lower[1], view.upper[1])
    panel.imshow(picture, extent=extent, origin="lower", interpolation="nearest")


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


def draw_discs(panel: "Axes", position: np.ndarray, spacing: float, **style: Any) -> "EllipseCollection":
    """Discs as large as particles of a spacing, at (n, 2) positions, both in the units of the axes."""
    from matplotlib.collections import EllipseCollection

    style.update(units="xy", offsets=position, offset_transform=panel.transData, linewidth=0)
    discs = EllipseCollection([DISC * spacing], [DISC * spacing], [0.0], **style)
    panel.add_collection(discs, autolim=False)
    return discs


def slice_owner(view: View, frame: Frame, shape: tuple[int, int]) -> np.ndarray:
    """(rows, columns) which particle of a frame, cut to the view, the slice meets in each pixel; -1 where none.

    Of a thin layer of centres a disordered fluid would show holes that are none: what fills them lies a little beside the
    plane. Each pixel belongs to the particle nearest to it in space. Holes into which a ball of _SLICE spacings radius does
    not fit are closed, which is less than a particle sees around it.

    The fluid's particles count from 0, those of the walls go on behind them. Row 0 is at the bottom.
    """
    parts = [frame.fluid] if frame.wall is None else [frame.fluid, frame.wall]
    position = np.concatenate([view.place(part) for part in parts])
    depth = np.concatenate([view.depth(part) for part in parts])
    return owners(position, depth, view.lower, view.upper, shape, view.spacing, _SLICE)


def slice_picture(view: View, frame: Frame, colours: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(rows, columns, 4) uint8 picture of the slice of a frame that is cut to the view.

    colours: (n, 4) uint8 of the fluid's particles; walls are grey
    """
    from matplotlib.colors import to_rgba

    grey = np.round(255 * np.array(to_rgba(WALL_COLOUR))).astype(np.uint8)
    walls = 0 if frame.wall is None else len(frame.wall)
    # One more row, clear, is what the owner -1 finds.
    table = np.concatenate([colours, np.broadcast_to(grey, (walls, 4)), np.zeros((1, 4), np.uint8)])
    return table[slice_owner(view, frame, shape)]


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
    palette = colormaps["tab10" if high < 10 else "tab20"]
    colours = ListedColormap([palette(k % palette.N) for k in range(low, high + 1)])
    return colours, BoundaryNorm(np.arange(low - 0.5, high + 1.0), high - low + 1)


def _label(field: str, flat: bool) -> str:
    """Name and unit of a field for an axis or colour bar."""
    name, _ = _parse_field(field)
    units = UNITS | (_UNITS_2D if flat else {})
    title = "speed" if field == "velocity" else field.replace("_", " ")
    return _with_unit(title, units[name])


def _with_unit(title: str, unit: str) -> str:
    return title if unit in ("", "1") else f"{title} [{unit}]".strip()


# ---- reference interfaces over the particles ---------------------------------------------------------------


def draw_segments(panel: "Axes", segments: np.ndarray, colour: str = "black") -> "Line2D":
    """Draw segments (n, 2, 2) [m] over whatever a panel shows, with a white rim that sets them off."""
    from matplotlib.patheffects import Normal, Stroke

    # one curve, broken by nan after each segment: the rim of one segment must not cover the end of another
    breaks = np.full((len(segments), 1, 2), np.nan)
    x, y = np.concatenate([segments, breaks], axis=1).reshape(-1, 2).T
    rim = [Stroke(linewidth=2.6, foreground="white"), Normal()]
    (line,) = panel.plot(x, y, color=colour, linewidth=1.2, path_effects=rim, scalex=False, scaley=False)
    return line


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
        for (label, (x, y)), style in zip(panel.curves.items(), _line_styles(len(panel.curves)), strict=True):
            every = max(1, math.ceil(len(x) / _LONGEST_CURVE))
            drawn.plot(x[::every], y[::every], label=label, linewidth=1.2, marker="." if len(x) < 3 else None, **style)
        drawn.set(title=panel.title, xlabel=panel.x_label, ylabel=panel.y_label)
        drawn.grid(alpha=0.3)
        space_ticks(drawn)
        if len(panel.curves) <= _MOST_CURVES:
            drawn.legend(fontsize="small")
        else:  # a legend this long would hide the curves
            drawn.legend(fontsize="x-small", loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    return figure


def _line_styles(count: int) -> list[dict[str, Any]]:
    """How the curves of a panel are drawn: no two in the same colour, of many neighbours in other dashes too."""
    from matplotlib import colormaps

    if count <= 10:
        return [{"color": f"C{k}"} for k in range(count)]
    colours = colormaps["turbo"](np.linspace(0.02, 0.98, count))
    dashes = ("-", "--", ":", "-.")
    return [{"color": tuple(colour), "linestyle": dashes[k % 4]} for k, colour in enumerate(colours)]


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
    """Write a whole picture, in the format that its name ends with; PNG without one. Return where it is."""
    path = path if path.suffix else path.with_suffix(".png")
    make_folder(path.parent)
    try:
        with whole_file(path) as temporary:
            figure.savefig(temporary, dpi=150, format=path.suffix[1:].lower())
    except ValueError as error:  # matplotlib knows no such format
        raise OutputError(f"{path}: cannot be written: {error}") from error
    return path
