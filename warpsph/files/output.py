"""The run folder: layout, particle files for ParaView, log and summary, and the thread that writes them.

    run folder/
      case.yaml                      the case as it was run
      reference/                     copies of the reference files that it names, so that the folder can be moved
      log.txt
      particles/fluid_000000.vtp ... fluid.pvd       open the .pvd in ParaView, show as Point Gaussian
      particles/wall_000000.vtp ...  wall.pvd        one frame only, unless walls move
      gauges/<name>.csv
      checkpoint/step_000001000.h5 ...
      summary.json

Every file except log.txt and the gauges is written under a temporary name and renamed when it is complete,
so what carries its final name can be read at any moment, also after the process was killed.
"""

from __future__ import annotations

import json
import math
import queue
import threading
import xml.etree.ElementTree as xml
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from warpsph.errors import OutputError
from warpsph.files.vtp import DEFAULT_FIELDS, PARTICLE_FIELDS, read_vtp, three_components, write_vtp
from warpsph.files.whole_files import PARTIAL, whole_file, write_failure, write_text
from warpsph.snapshot import OPTIONAL_FIELDS, Snapshot

# ------------------------------------------------------------------------------------------------------------
# When outputs are due


class Schedule:
    """Moments at which something is due: every `interval` from 0 on, or at the given `times` [s].

    A moment counts as reached within a relative 1e-9, because the sum of the time steps is not exact.
    """

    def __init__(self, interval: float | None = None, times: Sequence[float] | None = None) -> None:
        if interval is not None and times is not None:
            raise ValueError("give an interval or times, not both")
        if interval is not None and not interval > 0:
            raise ValueError(f"interval must be positive, not {interval}")
        self.interval = interval
        self._times = sorted(float(time) for time in times) if times is not None else None
        self._index = 0

    def _moment(self, index: int) -> float:
        if self._times is not None:
            return self._times[index] if index < len(self._times) else math.inf
        return math.inf if self.interval is None else index * self.interval

    def _tolerance(self, time: float) -> float:
        return 1e-9 * max(abs(time), self.interval or 0.0)

    @property
    def next(self) -> float:
        """The next moment that is due [s]; infinity if none is left."""
        return self._moment(self._index)

    def due(self, time: float) -> bool:
        """Whether the next moment has been reached at `time`."""
        return time >= self.next - self._tolerance(time)

    def advance(self, time: float) -> None:
        """Go on to the first moment after `time`."""
        if self._times is None and self.interval is not None:
            self._index = max(self._index, int(time / self.interval) - 1, 0)
        while self.due(time):
            self._index += 1


# ------------------------------------------------------------------------------------------------------------
# The .pvd file of a series


class Series:
    """A series of frames `<kind>_000000.vtp` in a folder, and the `<kind>.pvd` that gives each its time."""

    def __init__(self, folder: Path, kind: str) -> None:
        self.path = folder / f"{kind}.pvd"
        self.kind = kind
        self.frames: list[tuple[float, str]] = []  # time [s], file name

    def read(self) -> None:
        """Take over the frames of an existing .pvd file; raises OutputError if it cannot be read."""
        self.frames = []
        if not self.path.exists():
            return
        try:
            for element in xml.parse(self.path).iter("DataSet"):
                self.frames.append((float(element.attrib["timestep"]), element.attrib["file"]))
        except (OSError, ValueError, KeyError, xml.ParseError) as error:
            raise OutputError(f"{self.path}: cannot be read as a series: {error}") from error

    def cut_after(self, time: float) -> None:
        """Drop frames later than `time` [s] and delete their files."""
        late = [(moment, name) for moment, name in self.frames if moment > time + 1e-9 * abs(time)]
        if not late:
            return
        self.frames = [frame for frame in self.frames if frame not in late]
        self._write()
        for _, name in late:
            with suppress(OSError):
                (self.path.parent / name).unlink(missing_ok=True)

    def add(self, time: float, write: Callable[[Path], object]) -> Path:
        """Let `write` make the frame's file, then name it in the .pvd; it replaces one of the same time."""
        if self.frames and abs(self.frames[-1][0] - time) <= 1e-9 * abs(time):
            name = self.frames[-1][1]
            frames = [*self.frames[:-1], (time, name)]
        else:
            name = f"{self.kind}_{self._next_number():06d}.vtp"
            frames = [*self.frames, (time, name)]
        path = self.path.parent / name
        write(path)
        self.frames = frames
        self._write()
        return path

    def _next_number(self) -> int:
        return int(self.frames[-1][1].rsplit("_", 1)[1].split(".")[0]) + 1 if self.frames else 0

    def _write(self) -> None:
        lines = [
            '<?xml version="1.0"?>',
            '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
            "<Collection>",
            *(
                f'<DataSet timestep="{time!r}" group="" part="0" file={quoteattr(name)}/>'
                for time, name in self.frames
            ),
            "</Collection>",
            "</VTKFile>",
            "",
        ]
        write_text(self.path, "\n".join(lines))


# ------------------------------------------------------------------------------------------------------------
# The run folder


class RunFolder:
    """The folder of one run; it belongs to this object until `close`.

    `path` must not exist or be empty, unless `resume` is true. `case_text` goes to case.yaml; without it `write_case`
    writes that file later. `fields`, `precision` and `compress` are those of `write_vtp`. Raises OutputError if the
    folder holds something, is in use or cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        case_text: str | None = None,
        resume: bool = False,
        fields: Sequence[str] = DEFAULT_FIELDS,
        precision: str = "float32",
        compress: bool = False,
    ) -> None:
        self.path = Path(path)
        self.particles = self.path / "particles"
        self.gauges = self.path / "gauges"
        self.checkpoints = self.path / "checkpoint"
        self.references = self.path / "reference"
        self.case_path = self.path / "case.yaml"
        self.log_path = self.path / "log.txt"
        self.summary_path = self.path / "summary.json"
        self.fields = tuple(fields)
        self.precision = precision
        self.compress = compress
        self._log_lock = threading.Lock()
        self._last_walls: np.ndarray | None = None
        self._missing: set[str] = set()
        try:
            if self.path.exists():
                if not self.path.is_dir():
                    raise OutputError(f"{self.path}: is a file, not a folder; choose another --output")
                if not resume and any(self.path.iterdir()):
                    raise OutputError(
                        f"{self.path}: the output folder is not empty; choose another one with --output, "
                        "delete it, or continue its run with --restart"
                    )
            self.path.mkdir(parents=True, exist_ok=True)
            # Without resume the log must be new ("x"): of two runs that found the folder empty, one gets it.
            self._log = open(self.log_path, "a" if resume else "x", encoding="utf-8")
        except FileExistsError as error:
            raise OutputError(f"{self.path}: another run has just taken this output folder") from error
        except OSError as error:
            raise write_failure(self.path, error) from error
        self.series = {kind: Series(self.particles, kind) for kind in ("fluid", "wall")}
        try:
            self._take()
            for folder in (self.path, self.particles, self.gauges, self.checkpoints):
                folder.mkdir(exist_ok=True)
                for leftover in folder.glob(f".*{PARTIAL}"):
                    leftover.unlink()
            if resume:
                for series in self.series.values():
                    series.read()
            if case_text is not None:
                self.write_case(case_text)
        except OSError as error:
            self._log.close()
            raise write_failure(self.path, error) from error
        except OutputError:
            self._log.close()
            raise

    def _take(self) -> None:
        """Lock the folder against a second process; the lock goes with the process, however that ends."""
        try:
            import fcntl
        except ImportError:  # not a POSIX system: no lock
            return
        try:
            fcntl.flock(self._log, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise OutputError(f"{self.path}: another run is writing into this folder") from error
        except OSError:  # a file system without locks
            return

    def write_case(self, text: str) -> None:
        """Write case.yaml. Raises OutputError."""
        write_text(self.case_path, text)

    def keep_references(self, files: Mapping[str, Path]) -> dict[str, str]:
        """Copy reference files into the folder and return their names there, relative to it, by their names in the case.

        files: path of each by the name that the case has for it; what is not there is left out. Files of one name from
        different places get different ones. Raises OutputError.
        """
        names: dict[str, str] = {}
        sources: dict[str, Path] = {}  # name in the folder -> where the file comes from
        for name, path in files.items():
            if not path.is_file():
                continue
            kept, number = path.name, 1
            while sources.setdefault(kept, path.resolve()) != path.resolve():
                number += 1
                kept = f"{path.stem}_{number}{path.suffix}"
            names[name] = f"{self.references.name}/{kept}"
        try:
            # All are read before one is written: a case may name files of this very folder.
            contents = {kept: source.read_bytes() for kept, source in sources.items()}
            if contents:
                self.references.mkdir(exist_ok=True)
        except OSError as error:
            raise OutputError(f"{error.filename}: a reference file cannot be copied: {error.strerror or error}") from error
        for kept, content in contents.items():
            with whole_file(self.references / kept, needed=len(content)) as temporary:
                temporary.write_bytes(content)
        return names

    def cut_after(self, time: float) -> None:
        """Before continuing from a checkpoint of `time` [s]: drop the frames that were written later."""
        for series in self.series.values():
            series.cut_after(time)
        walls = self.series["wall"].frames
        if walls:
            with suppress(OutputError):  # without it the walls are written once more
                self._last_walls = read_vtp(self.particles / walls[-1][1]).position

    def log(self, text: str) -> None:
        """Append a line to log.txt; callable from any thread. Raises OutputError."""
        try:
            with self._log_lock:
                self._log.write(text.rstrip("\n") + "\n")
                self._log.flush()
        except OSError as error:
            raise write_failure(self.log_path, error) from error

    def write_particles(self, snapshot: Snapshot) -> None:
        """Write the frame of this moment: fluid always, walls if new or moved. Raises OutputError."""
        for name in self.fields:
            if name in OPTIONAL_FIELDS and getattr(snapshot, name) is None and name not in self._missing:
                self._missing.add(name)
                self.log(
                    f"particle field {name!r} does not exist in this scene and is left out of the output"
                )
        fluid, wall = snapshot.fluid, snapshot.wall
        self.series["fluid"].add(
            snapshot.time, lambda path: write_vtp(path, fluid, self.fields, self.precision, self.compress)
        )
        # as in the file, so that it can be compared with what a run before a restart has written
        position = three_components(wall.position, "<f4" if self.precision == "float32" else "<f8")
        if len(wall) and not (self._last_walls is not None and np.array_equal(self._last_walls, position)):
            self.series["wall"].add(
                snapshot.time, lambda path: write_vtp(path, wall, self.fields, self.precision, self.compress)
            )
            self._last_walls = position

    def write_failed_state(self, snapshot: Snapshot) -> Path:
        """Write the fluid of a run that went wrong, for a look, outside of the series; returns its path."""
        path = self.particles / "failed_fluid.vtp"
        present = [name for name in PARTICLE_FIELDS if getattr(snapshot, name) is not None]
        write_vtp(path, snapshot.fluid, present, "float64")
        return path

    def checkpoint_path(self, step: int) -> Path:
        """Where the checkpoint of a step belongs."""
        return self.checkpoints / f"step_{step:09d}.h5"

    def gauge_path(self, name: str) -> Path:
        """Where the rows of a gauge belong."""
        return self.gauges / f"{name}.csv"

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write summary.json; numbers that JSON does not have (nan, inf) become null. Raises OutputError."""
        write_text(self.summary_path, json_text(summary), durable=True)

    def read_summary(self) -> dict[str, Any]:
        """The content of summary.json; raises OutputError if it is missing or broken."""
        try:
            return json.loads(self.summary_path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise OutputError(f"{self.summary_path}: cannot be read: {error}") from error

    def close(self) -> None:
        """Give the folder up."""
        self._log.close()

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def last_particles(folder: Path, dimension: int) -> Snapshot:
    """The fluid of the last frame in a run folder; raises OutputError if there is none."""
    series = Series(folder / "particles", "fluid")
    series.read()
    if not series.frames:
        raise OutputError(f"{series.path}: no particles were written")
    return read_vtp(series.path.parent / series.frames[-1][1], dimension)


def json_text(data: Mapping[str, Any]) -> str:
    """JSON text of nested data; numbers that JSON does not have (nan, inf) become null."""
    return json.dumps(_plain(data), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _plain(value: Any) -> Any:
    """`value` in the types of JSON."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value)


# ------------------------------------------------------------------------------------------------------------
# Writing while the computation goes on


class Writer:
    """A thread that writes while the computation goes on.

    `handlers` maps a kind of job to the function that does it, e.g. {"particles": folder.write_particles}.
    At most `depth` jobs wait; `put` blocks while the queue is full, so a slow disk holds the run back
    instead of filling the memory. An error in a job is raised by every later `put` and `flush`, or by
    `close` if it has not been raised before, and the jobs after it are dropped.
    """

    def __init__(self, handlers: Mapping[str, Callable[[Any], object]], depth: int = 2) -> None:
        self._handlers = dict(handlers)
        self._jobs: queue.Queue[tuple[str, Any] | None] = queue.Queue(maxsize=depth)
        self._error: BaseException | None = None
        self._reported = False
        self._closed = False
        self.busy_seconds = 0.0
        # A daemon: a process that dies from an error elsewhere must not hang on jobs that nobody will close.
        self._thread = threading.Thread(target=self._work, name="warpsph writer", daemon=True)
        self._thread.start()

    def put(self, kind: str, payload: Any) -> None:
        """Queue a job, whose `payload` must not be changed afterwards. Raises errors of earlier jobs."""
        if self._closed:
            raise RuntimeError("the writer is closed")
        if kind not in self._handlers:
            raise KeyError(f"no handler for {kind!r}; there are {', '.join(self._handlers)}")
        self._raise()
        self._jobs.put((kind, payload))

    def flush(self) -> None:
        """Wait until all queued jobs are done. Raises their errors."""
        self._jobs.join()
        self._raise()

    def close(self) -> None:
        """Finish all queued jobs and end the thread. Raises their errors; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        self._jobs.put(None)
        self._thread.join()
        if not self._reported:
            self._raise()

    def _raise(self) -> None:
        if self._error is not None:
            self._reported = True
            raise self._error

    def _work(self) -> None:
        while True:
            job = self._jobs.get()
            try:
                if job is None:
                    return
                if self._error is None:
                    start = perf_counter()
                    self._handlers[job[0]](job[1])
                    self.busy_seconds += perf_counter() - start
            except BaseException as error:  # every kind is the caller's to see
                self._error = error
            finally:
                del job  # while it waits for the next job the thread must not keep this one's memory
                self._jobs.task_done()

    def __enter__(self) -> Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except BaseException as write_error:
            if error is None:
                raise
            error.add_note(f"while this was handled, writing failed too: {write_error}")
