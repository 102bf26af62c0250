"""Movies of a run, made from its run folder: the particles frame by frame, coloured by a field.

The frames are read one at a time, first to find the part of the scene and the colour scale that all of them
share, then to draw them. Axes, labels and colour bar are drawn once; each frame is that background with the
particles on it: in 2-D as discs up to MOST_DISCS of them, else pixel by pixel.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import CaseError, OutputError, Problem
from warpsph.files.whole_files import make_folder, whole_file
from warpsph.study.plot import (
    WALL_COLOUR,
    ColourScale,
    Frame,
    View,
    choose_frames,
    corners_of,
    draw_discs,
    draw_segments,
    field_of,
    phase_names,
    read_frame,
    read_series,
    scale_of,
    set_axes,
    shown_phases,
    slice_picture,
    view_of,
)
from warpsph.study.raster import nearest_particles

if TYPE_CHECKING:
    from PIL.Image import Image

MOST_DISCS = 50_000
"""Particles up to which a frame is drawn with matplotlib (0.15 s on one core); more are set as pixels."""

CELL = 0.72
"""Reach of a particle that is set as pixels, in particle spacings: on a lattice half a diagonal, so no gaps are left."""

FASTEST = {".gif": 50.0, ".mp4": 240.0}
"""Kinds of movies, and the most frames a second that each can show (a GIF counts in 1/100 s, and viewers slow down
what is faster than 2 of these)."""

_DPI = 110
_PANEL = 25.0  # square inches
_WIDEST, _HIGHEST = 8.0, 7.0  # inches
_SAMPLES = 10_000  # values of a frame that the colour scale is found from
_COLOURS = 256  # of a GIF
_GREYS = 40  # of these, for letters, lines and walls


def make_movie(
    folder: Path | str,
    path: Path | str,
    field: str = "pressure",
    times: Sequence[float] | slice | None = None,
    fps: float = 10.0,
    slice_axis: str | None = None,
    over: np.ndarray | None = None,
    phases: Sequence[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write a movie of the particles of a run, one colour scale for all frames; return its path.

    folder: run folder
    path: .gif, or .mp4 for which ffmpeg must be installed; what has this name is replaced when the movie is whole
    field: as in `plot_run`
    times: s; of slice(T1, T2) the frames from T1 to T2, else the frames nearest to each (default: every frame)
    fps: frames shown in a second
    slice_axis, over, phases: as in `plot_run`
    progress: called with the number of frames done and of all

    Raises CaseError if there is no such run, field, time or phase in it, or no such kind of movie can be made;
    OutputError if a file cannot be read or written, or ffmpeg fails.
    """
    folder, path = Path(folder), Path(path)
    problems = _problems(path, fps)
    if problems:
        raise CaseError(problems)
    series, walls = read_series(folder)
    frames = choose_frames(series.frames, slice(None) if times is None else times)

    def read() -> Iterator[Frame]:
        return (read_frame(series, walls, frame) for frame in frames)

    names = phase_names(folder)
    shown = shown_phases(names, phases)
    view = _common_view(read(), slice_axis)
    samples = [_sample(field_of(view.cut(frame).only(shown), view, field)) for frame in read()]
    scale = scale_of(field, np.concatenate(samples))
    painter = _Painter(view, scale, names, _clock([time for time, _ in frames]), over)
    encoder = _Gif if path.suffix.lower() == ".gif" else _Mp4
    make_folder(path.parent)
    with whole_file(path) as temporary, encoder(temporary, path, painter.size, fps, scale) as movie:
        for number, frame in enumerate(read(), 1):
            movie.add(painter.paint(view.cut(frame).only(shown)))
            if progress is not None:
                progress(number, len(frames))
        movie.finish()
    return path


def ffmpeg() -> str | None:
    """Where ffmpeg is: the one that matplotlib is set to, by default the first on the path; None if there is none."""
    from matplotlib import rcParams

    return shutil.which(str(rcParams["animation.ffmpeg_path"]))


def _problems(path: Path, fps: float) -> list[Problem]:
    kind = path.suffix.lower()
    if kind not in FASTEST:
        return [Problem("movie", str(path), "no such kind of movie", "name a .gif or an .mp4 file")]
    problems = []
    if not 0 < fps <= FASTEST[kind]:
        rule = f"frames a second of a {kind[1:]} are more than 0 and at most {FASTEST[kind]:g}"
        problems.append(Problem("fps", fps, rule, "write e.g. 10"))
    if path.is_dir():
        problems.append(Problem("movie", str(path), "is a folder", "name a .gif or an .mp4 file"))
    if kind == ".mp4" and ffmpeg() is None:
        remedy = "install ffmpeg (ffmpeg.org) so that it is on the PATH, or name a .gif file"
        problems.append(Problem("movie", str(path), "an .mp4 needs the program ffmpeg, which is not found", remedy))
    return problems


# ---- what all frames share -------------------------------------------------------------------------------


def _common_view(frames: Iterator[Frame], slice_axis: str | None) -> View:
    """The part of the scene that holds every frame."""
    lower, upper = np.full(3, math.inf), np.full(3, -math.inf)
    spacing = 0.0
    for frame in frames:
        low, high = corners_of(frame)
        lower, upper = np.minimum(lower, low), np.maximum(upper, high)
        spacing = frame.fluid.particle_spacing
    return view_of(lower, upper, spacing, slice_axis)


def _sample(values: np.ndarray) -> np.ndarray:
    """The finite ones of `values`; of too many, evenly spread quantiles with both extremes among them."""
    finite = values[np.isfinite(values)]
    if len(finite) <= _SAMPLES:
        return finite
    return np.sort(finite)[np.linspace(0, len(finite) - 1, _SAMPLES).round().astype(np.int64)]


def _clock(times: Sequence[float]) -> Callable[[float], str]:
    """Text for a time, with as many decimals as tell the frames apart: it must not jump from frame to frame."""
    gaps = np.diff(times)
    least = float(gaps.min()) if len(gaps) and gaps.min() > 0 else max(map(abs, times), default=1.0) or 1.0
    decimals = min(max(1 - math.floor(math.log10(least)), 0), 12)
    return lambda time: f"t = {time:.{decimals}f} s"


# ---- drawing ---------------------------------------------------------------------------------------------


class _Painter:
    """Paints frames that share view, colours, and the picture around them.

    size: width and height in pixels, both even, as video codecs need them.
    """

    def __init__(
        self, view: View, scale: ColourScale, names: list[str], clock: Callable[[float], str], over: np.ndarray | None
    ) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.view, self.scale, self.clock = view, scale, clock
        height = min(math.sqrt(_PANEL * view.aspect), _HIGHEST)
        width = min(max(height / view.aspect, 1.5), _WIDEST)
        height = max(min(height, width * view.aspect), 1.0)
        self.size = 2 * round((width + 1.6) * _DPI / 2), 2 * round((height + 0.9) * _DPI / 2)
        # a hair more: the canvas cuts the product of inches and dpi down to whole pixels
        inches = [(pixels + 0.01) / _DPI for pixels in self.size]
        figure = Figure(figsize=(inches[0], inches[1]), dpi=_DPI, layout="constrained")
        self._canvas = FigureCanvasAgg(figure)
        self._panel = panel = figure.subplots()
        set_axes(panel, view)
        self._title = panel.set_title(clock(0.0), loc="left")
        if view.note:
            figure.suptitle(view.note)
        scale.bar(figure, [panel], view, names)
        self._canvas.draw()  # arranges the parts
        figure.set_layout_engine("none")
        self._title.set_animated(True)
        self._segments = None if over is None else draw_segments(panel, over)
        if self._segments is not None:
            self._segments.set_animated(True)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(figure.bbox)
        self._fluid: Any = None
        self._wall: Any = None
        self._pixels: Any = None

    def paint(self, frame: Frame) -> np.ndarray:
        """(height, width, 3) uint8 picture of a frame, which is cut to the view already."""
        self._canvas.restore_region(self._background)
        values = field_of(frame, self.view, self.scale.field)
        walls = 0 if frame.wall is None else len(frame.wall)
        if self.view.middle is None and len(values) + walls <= MOST_DISCS:
            self._discs(frame, values)
        else:
            self._set_pixels(frame, values)
        self._title.set_text(self.clock(frame.time))
        # the frame of the axes once more: small particles reach over its line
        for artist in (*self._panel.spines.values(), self._segments, self._title):
            if artist is not None:
                self._panel.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _discs(self, frame: Frame, values: np.ndarray) -> None:
        spacing, place = self.view.spacing, self.view.place
        if frame.wall is not None:
            if self._wall is None:
                position = np.zeros((0, 2))
                self._wall = draw_discs(self._panel, position, spacing, color=WALL_COLOUR, animated=True)
            self._wall.set_offsets(place(frame.wall))
            self._panel.draw_artist(self._wall)
        if self._fluid is None:
            style = {"cmap": self.scale.colours, "norm": self.scale.norm, "animated": True}
            self._fluid = draw_discs(self._panel, np.zeros((0, 2)), spacing, array=values[:0], **style)
        self._fluid.set_offsets(place(frame.fluid))
        self._fluid.set_array(values)
        self._panel.draw_artist(self._fluid)

    def _set_pixels(self, frame: Frame, values: np.ndarray) -> None:
        view, colours = self.view, self.scale.rgba(values)
        box = self._panel.bbox
        shape = max(round(box.height), 1), max(round(box.width), 1)
        if view.middle is None:
            picture = _flat_picture(view, frame, colours, shape)
        else:
            picture = slice_picture(view, frame, colours, shape)
        if self._pixels is None:
            extent = (view.lower[0], view.upper[0], view.lower[1], view.upper[1])
            self._pixels = self._panel.imshow(
                picture, extent=extent, origin="lower", interpolation="nearest", aspect="equal", animated=True
            )
        self._pixels.set_data(picture)
        self._panel.draw_artist(self._pixels)


def _flat_picture(view: View, frame: Frame, colours: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(rows, columns, 4) uint8 picture of a 2-D frame, the fluid over the walls; colours (n, 4) uint8 of the fluid."""
    from matplotlib.colors import to_rgba

    picture = np.zeros((*shape, 4), np.uint8)  # clear
    grey = np.array([to_rgba(WALL_COLOUR)]) * 255
    parts: list[tuple[Any, Any]] = [(frame.fluid, colours)]
    if frame.wall is not None:
        parts.insert(0, (frame.wall, np.broadcast_to(grey.astype(np.uint8), (len(frame.wall), 4))))
    for part, colour in parts:
        owner = nearest_particles(view.place(part), view.lower, view.upper, shape, CELL * view.spacing)
        picture[owner >= 0] = colour[owner[owner >= 0]]
    return picture


# ---- files -----------------------------------------------------------------------------------------------


class _Gif:
    """An animated GIF through Pillow, all frames with the same 256 colours: no colour flickers, and files stay small."""

    def __init__(self, temporary: Path, path: Path, size: tuple[int, int], fps: float, scale: ColourScale) -> None:
        self._file = open(temporary, "wb")  # now, so that an unwritable place is told before anything is drawn
        self._palette = _palette(scale)
        self._frames: list[Image] = []
        self._fps = fps

    def __enter__(self) -> _Gif:
        return self

    def __exit__(self, *exception: object) -> None:
        self._file.close()

    def add(self, picture: np.ndarray) -> None:
        from PIL import Image

        self._frames.append(Image.fromarray(picture).quantize(palette=self._palette, dither=Image.Dither.NONE))

    def finish(self) -> None:
        # times of frames are whole hundredths of a second; rounding their ends keeps the length of the movie
        ends = [round(100 * number / self._fps) * 10 for number in range(len(self._frames) + 1)]
        first, *others = self._frames
        durations = [after - before for before, after in zip(ends, ends[1:], strict=False)]
        first.save(
            self._file, format="GIF", save_all=True, append_images=others, duration=durations, loop=0, optimize=False
        )
        self._file.close()


def _palette(scale: ColourScale) -> Image:
    """A picture with the 256 colours of a movie: those of the scale, greys, and blends of both at the edge of discs."""
    from matplotlib import colormaps
    from PIL import Image

    colours = scale.colours
    colour_map = colormaps[colours] if isinstance(colours, str) else colours
    room = _COLOURS - _GREYS
    steps = min(colour_map.N, room)
    strong = np.asarray(colour_map(np.linspace(0.0, 1.0, steps)))[:, :3]
    # none nearly white: Pillow looks colours up coarsely and would tint the background with it
    blends = [share * strong + (1 - share) for share in np.linspace(1.0, 0.2, min(room // steps, 8))]
    greys = np.repeat(np.linspace(0.0, 1.0, _GREYS)[:, None], 3, axis=1)
    table = np.rint(255 * np.concatenate([*blends, greys])).astype(np.uint8)
    palette = Image.new("P", (1, 1))
    palette.putpalette(table.tobytes())
    return palette


class _Mp4:
    """An MP4 through ffmpeg, which gets the pictures through a pipe."""

    def __init__(self, temporary: Path, path: Path, size: tuple[int, int], fps: float, scale: ColourScale) -> None:
        program = ffmpeg()
        assert program is not None  # `_problems` has looked
        self._path = path
        self._messages = tempfile.TemporaryFile()
        # yuv420p is what every player can show; faststart lets a browser begin before it has the whole file
        command = [
            *(program, "-loglevel", "error", "-y"),
            *("-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", f"{size[0]}x{size[1]}", "-framerate", f"{fps:g}"),
            *("-i", "-", "-an", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(temporary)),
        ]
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=self._messages
            )
        except BaseException:
            self._messages.close()
            raise

    def __enter__(self) -> _Mp4:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        assert self._process.stdin is not None
        with suppress(OSError):  # what could not be flushed to a process that is gone
            self._process.stdin.close()
        self._messages.close()

    def add(self, picture: np.ndarray) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(picture.tobytes())
        except (BrokenPipeError, OSError) as error:
            self._fail(error)

    def finish(self) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except OSError as error:
            self._fail(error)
        if self._process.wait() != 0:
            self._fail(None)

    def _fail(self, error: OSError | None) -> None:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=10)
        self._messages.seek(0)
        said = self._messages.read().decode(errors="replace").strip().splitlines()
        text = said[-1] if said else f"exit code {self._process.returncode}"
        raise OutputError(f"{self._path}: ffmpeg failed: {text}; name a .gif file to do without it") from error
