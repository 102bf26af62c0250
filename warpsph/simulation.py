"""A run from start to end.

The loop, in words:

    build the particles, or load a checkpoint
    record what is due at the start (gauges, particles)
    until the end time:
        step to the next moment at which something is due, in portions of about half a second
            after each portion: report progress; stop on a fault or on Ctrl-C
        gauges, particles, checkpoint: each where due, handed to a writer thread as copies
    write the last checkpoint and particles, compare with the references, write summary.json
"""

from __future__ import annotations

import dataclasses
import importlib.metadata
import math
import platform
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph import checkpoint
from warpsph.comparison import compare
from warpsph.errors import CaseError, DivergenceError, Interrupted, OutputError, Problem, WarpsphError
from warpsph.gauges import GaugeSet, PhaseEos
from warpsph.geometry import build
from warpsph.output import RunFolder, Schedule, Writer
from warpsph.physics import Physics, derive, support_radius
from warpsph.probes import sample
from warpsph.snapshot import Snapshot

if TYPE_CHECKING:
    from warpsph.case import Case
    from warpsph.model import Model

PORTION = 0.5  # s of wall time between two looks at the clock
FIRST_STEPS = 20
# Million particle-steps per second to expect where nothing was measured yet; only for the estimate of `check`.
GUESSED_RATE = {"cpu": 2.0, "cuda": 300.0}


@dataclasses.dataclass(frozen=True)
class Progress:
    """Where a run stands. Times in s, `mups` in million particle-steps per second, `share` from 0 to 1."""

    time: float
    end_time: float
    step: int
    dt: float
    mups: float
    share: float
    seconds_left: float | None


class Simulation:
    """One run of a case.

    Args:
        case: validated case.
        output: folder for the results; None keeps gauges and the last state in memory alone.
        device: Warp device name, "cpu" or "cuda:0".
        threads: threads of a CPU device (default: all processors).
        restart: checkpoint file, its folder, or a run folder to go on from.

    Raises:
        CaseError: the device does not exist, or the checkpoint does not fit the case.
        OutputError: the output folder cannot be used.

    Attributes:
        case: the case.
        model: the state on the device.
        summary: what summary.json holds, after `run`.
    """

    def __init__(
        self,
        case: Case,
        output: Path | str | None = None,
        device: str = "cpu",
        threads: int | None = None,
        restart: Path | str | None = None,
    ) -> None:
        from warpsph.model import Model, quiet_warp

        begin = time.perf_counter()
        quiet_warp()
        _check_device(device)
        self.case = case
        self.summary: dict[str, Any] = {}
        self.started_at = 0.0
        state: dict[str, np.ndarray] | None = None
        attributes: dict[str, Any] = {}
        if restart is not None:
            state, attributes = _load_checkpoint(Path(restart))
        self.model: Model = Model(case, device=device, threads=threads)
        if state is not None:
            _check_fit(self.model, state, attributes)
            try:
                self.model.load_state(state)
            except ValueError as error:
                raise CaseError(
                    [Problem("restart", str(restart), f"does not fit the case: {error}", "restart with the case of its run")]
                ) from error
        self.physics: Physics = self.model.physics
        self.warnings = [*self.model.geometry.warnings, *self.physics.warnings]
        self.folder = self._open_folder(output, restart is not None)
        self.model.stepper.prepare(fresh=state is None)
        self.started_at = self.model.time
        eos = {
            name: PhaseEos(phase.density, c, phase.gamma, phase.background_pressure)
            for (name, phase), c in zip(case.phases.items(), self.physics.sound_speed, strict=True)
        }
        self._gauges = GaugeSet(
            case,
            None if self.folder is None else self.folder.gauges,
            eos=eos,
            restart_time=self.started_at if restart is not None and self.folder is not None else None,
        )
        # when to take a snapshot; the gauges' own schedules move on when the writer thread has done the rows
        self._moments = {name: _schedule(spec) for name, spec in case.gauges.items()}
        for moment in self._moments.values():
            if self.started_at > 0:
                moment.advance(self.started_at * (1.0 - 1.0e-8))
        self._last_frame = -1.0
        self._interrupted = False
        self.setup_seconds = time.perf_counter() - begin
        self._snapshot_seconds = 0.0

    def _open_folder(self, output: Path | str | None, resume: bool) -> RunFolder | None:
        if output is None:
            return None
        from warpsph.case_file import dump_case

        particles = self.case.output.particles
        options: dict[str, Any] = {"precision": self.case.precision}
        if particles is not None:
            options["fields"] = particles.fields
        folder = RunFolder(output, case_text=dump_case(self.case), resume=resume, **options)
        if resume:
            folder.cut_after(self.model.time)
            checkpoint.delete_after(folder.checkpoints, self.model.steps)
        for line in self.warnings:
            folder.log(f"warning: {line}")
        return folder

    # Python access -------------------------------------------------------------------------------------------------

    def gauge(self, name: str) -> dict[str, np.ndarray]:
        """Return what a gauge has measured: column -> (rows,) array, `time` [s] among them. Raises KeyError."""
        return self._gauges.series(name)

    @property
    def state(self) -> Snapshot:
        """A host copy of the present state."""
        return self.model.snapshot()

    # the run -------------------------------------------------------------------------------------------------------

    def run(self, progress: Callable[[Progress], None] | None = None) -> Simulation:
        """Run to the end time of the case and return self.

        Args:
            progress: called about twice a second.

        Raises:
            DivergenceError: the state became non-finite or ran away; the last good checkpoint is kept.
            CapacityError: the neighbour list cannot grow any further.
            OutputError: results cannot be written.
            Interrupted: Ctrl-C; the state is in a checkpoint.
        """
        begin = time.perf_counter()
        status = "failed"
        first_step = self.model.steps
        with self._writer() as writer, self._watch_interrupt():
            try:
                self._loop(writer, progress)
                status = "finished"
            except Interrupted:
                status = "interrupted"
                raise
            finally:
                self._close(writer, status, begin, first_step)
        return self

    def _loop(self, writer: Writer | None, progress: Callable[[Progress], None] | None) -> None:
        case, end = self.case, self.case.end_time
        frames = _schedule(case.output.particles)
        saves = _schedule(case.output.checkpoint)
        now = self.model.time
        saves.advance(now)  # the start itself can always be made again
        if now > 0:
            frames.advance(now)
        self._record(writer, frames)
        meter = _Meter(self, progress)
        while self.model.time < end:
            target = min(end, *(s.next for s in (*self._moments.values(), frames, saves)))
            self._step_to(target, meter, writer)
            self._record(writer, frames)
            if saves.due(self.model.time) and self.model.time < end:
                self._save(writer)
                saves.advance(self.model.time)
        if self.folder is not None and case.output.checkpoint is not None:
            self._save(writer)
        if case.output.particles is not None and self._last_frame != self.model.time:
            self._frame(writer, self._take())

    def _step_to(self, target: float, meter: _Meter, writer: Writer | None) -> None:
        from warpsph.kernels import clock as ck

        stepper = self.model.stepper
        while True:
            stepper.run(target, meter.portion)
            clock, counters = stepper.read()
            if counters[ck.FAULT] == ck.FAULT_STATE:
                self._fail(int(counters[ck.FAULT_PARTICLE]), writer)
            meter.report()
            if self._interrupted:
                if self.folder is not None:
                    self._save(writer)
                raise Interrupted(
                    f"stopped by Ctrl-C at t = {self.model.time:.6g} s (step {self.model.steps})"
                    + (f"; go on with --restart {self.folder.path}" if self.folder is not None else "")
                )
            if clock[ck.TIME] >= target * (1.0 - 1.0e-12):
                return

    def _fail(self, row: int, writer: Writer | None) -> None:
        """Report the particle that ran away and keep the state for a look."""
        model = self.model
        identity = int(model.particles.get("particle_id")[row])
        velocity = model.particles.get("velocity")[row].astype(float)
        excess = float(model.particles.get("density_excess")[row])
        position = model.particles.get("position")[row].astype(float)
        speed = float(np.linalg.norm(velocity))
        if not np.isfinite(position).all():
            quantity, value = "position", "not finite"
        elif not math.isfinite(speed):
            quantity, value = "velocity", "not finite"
        elif not math.isfinite(excess) or abs(excess) >= 0.9:
            quantity, value = "density", f"rho/rho0 - 1 = {excess:.3g}"
        else:
            quantity, value = "velocity", f"{speed:.4g} m/s, limit {self.physics.runaway:.4g} m/s"
        where = ""
        if self.folder is not None:
            if writer is not None:
                writer.flush()
            where = f"; the state is in {self.folder.write_failed_state(model.snapshot())}"
            last = checkpoint.latest(self.folder.checkpoints)
            if last is not None:
                where += f", the last good one in {last}"
        raise DivergenceError(
            f"the run diverged at t = {model.time:.6g} s (step {model.steps}): particle {identity} at "
            f"{_point(position)} has {quantity} {value}{where}. Usual causes: a sound speed that is too low, a start far "
            "from equilibrium, or too large a Courant number (numerics.courant)",
            particle=identity,
            time=model.time,
            quantity=quantity,
        )

    # output --------------------------------------------------------------------------------------------------------

    def _take(self) -> Snapshot:
        begin = time.perf_counter()
        snapshot = self.model.snapshot()
        self._snapshot_seconds += time.perf_counter() - begin
        return snapshot

    def _record(self, writer: Writer | None, frames: Schedule) -> None:
        now = self.model.time
        due = [name for name, moment in self._moments.items() if moment.due(now)]
        frame = frames.due(now)
        if not due and not frame:
            return
        snapshot = self._take()
        if due:
            needs = self._gauges.needs(due)
            if "extra" in needs:
                self._add_extra(snapshot, due)
            self._put(writer, "gauges", snapshot)
            for name in due:
                self._moments[name].advance(now)
        if frame:
            self._frame(writer, snapshot)
            frames.advance(now)

    def _frame(self, writer: Writer | None, snapshot: Snapshot) -> None:
        self._last_frame = snapshot.time
        if self.folder is not None:
            self._put(writer, "particles", snapshot)

    def _put(self, writer: Writer | None, kind: str, payload: Any) -> None:
        if writer is not None:
            writer.put(kind, payload)
        elif kind == "gauges":
            self._write_gauges(payload)

    def _write_gauges(self, snapshot: Snapshot) -> None:
        box = self._box()
        points, fields = self._gauges.sample_points, self._gauges.sample_fields
        for name, positions in points.items():
            snapshot.samples[name] = sample(snapshot, positions, fields[name], self.physics.support, box)
        self._gauges.record(snapshot)

    def _box(self) -> list[float]:
        lattice = self.model.geometry.lattice
        return [
            upper - lower if wraps else 0.0
            for lower, upper, wraps in zip(lattice.lower, lattice.upper, self.physics.spec.periodic, strict=True)
        ]

    def _add_extra(self, snapshot: Snapshot, due: list[str]) -> None:
        types = {self.case.gauges[name].type for name in due}
        if "interface_length" in types:
            snapshot.extra["interface_length"] = self.model.interface_length()
        if "wall_force" in types:
            snapshot.extra.update(self.model.wall_forces())

    def _save(self, writer: Writer | None) -> None:
        state = self.model.save_state()
        payload = (self.model.steps, state, self._attributes())
        self._put(writer, "checkpoint", payload)

    def _write_checkpoint(self, payload: tuple[int, dict[str, np.ndarray], dict[str, Any]]) -> None:
        step, state, attributes = payload
        assert self.folder is not None
        checkpoint.save(self.folder.checkpoint_path(step), state, attributes)
        kept = self.case.output.checkpoint
        checkpoint.prune(self.folder.checkpoints, kept.keep if kept is not None else 3)

    def _attributes(self) -> dict[str, Any]:
        from warpsph import __version__
        from warpsph.case_file import dump_case

        return {
            "version": __version__,
            "case": dump_case(self.case),
            "time": self.model.time,
            "step": self.model.steps,
            "device": str(self.model.device),
            "precision": self.case.precision,
        }

    @contextmanager
    def _writer(self) -> Iterator[Writer | None]:
        if self.folder is None:
            yield None
            return
        handlers = {
            "gauges": self._write_gauges,
            "particles": self.folder.write_particles,
            "checkpoint": self._write_checkpoint,
        }
        with Writer(handlers) as writer:
            yield writer

    def _close(self, writer: Writer | None, status: str, begin: float, first_step: int) -> None:
        """Finish what is being written, compare with the references and write the summary."""
        problem = None
        try:
            if writer is not None:
                writer.flush()
        except WarpsphError as error:
            problem = error
        self._gauges.close()
        self.summary = self._summarise(status, time.perf_counter() - begin, first_step, writer)
        if self.folder is not None:
            try:
                self.folder.write_summary(self.summary)
                self.folder.log(
                    f"{status}: t = {self.model.time:.6g} s, {self.model.steps} steps, {self.summary['wall_seconds']:.2f} s"
                )
            except OutputError as error:
                problem = problem or error
            finally:
                self.folder.close()
        if problem is not None and sys.exc_info()[0] is None:
            raise problem

    def _summarise(self, status: str, seconds: float, first_step: int, writer: Writer | None) -> dict[str, Any]:
        model = self.model
        steps = model.steps - first_step
        particles = model.particles
        last = model.snapshot() if status == "finished" else None
        results = compare(self.case, None, gauges=self._gauges, snapshot=last, end_time=model.time)
        stages: dict[str, float] = {}
        for task in [*model.stepper.step_tasks, *model.stepper.list.tasks]:
            label = task.name if task in model.stepper.step_tasks else f"list: {task.name}"
            stages[label] = stages.get(label, 0.0) + task.seconds
        from warpsph import __version__
        from warpsph.kernels import clock as ck

        _, counters = model.stepper.read()
        return {
            "title": self.case.title,
            "status": status,
            "time": model.time,
            "steps": model.steps,
            "particles": particles.count,
            "fluid_particles": particles.fluid_count,
            "wall_particles": particles.wall_count,
            "wall_seconds": seconds,
            "setup_seconds": self.setup_seconds,
            "device": str(model.device),
            "device_name": model.device.name,
            "threads": model.launcher.threads,
            "precision": self.case.precision,
            "mups": particles.count * steps / max(seconds, 1e-9) / 1e6,
            "list_rebuilds": int(counters[ck.REBUILDS]),
            "bytes_per_particle": (particles.memory()) / max(particles.count, 1),
            "timings": {name: value for name, value in stages.items() if value > 0.0},
            "output_seconds": {
                "copying": self._snapshot_seconds,
                "writing beside the run": writer.busy_seconds if writer is not None else 0.0,
            },
            "sound_speed": dict(zip(self.case.phase_names, self.physics.sound_speed, strict=True)),
            "smoothing_length": self.physics.h,
            "machine": _machine(),
            "versions": {"warpsph": __version__, **_versions()},
            "warnings": list(self.warnings),
            "errors": {entry["quantity"]: entry for entry in results},
        }

    @contextmanager
    def _watch_interrupt(self) -> Iterator[None]:
        """Turn Ctrl-C into a flag that is looked at between portions, so that nothing is left half done."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def note(_number: int, _frame: Any) -> None:
            self._interrupted = True

        before = signal.signal(signal.SIGINT, note)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)


class _Meter:
    """Watches the rate of a run and sizes the portions between two looks."""

    def __init__(self, simulation: Simulation, progress: Callable[[Progress], None] | None) -> None:
        self.simulation = simulation
        self.progress = progress
        self.portion = FIRST_STEPS
        self.begin = time.perf_counter()
        self.first_time = simulation.model.time
        self.last = (self.begin, simulation.model.steps)
        self.told = self.begin

    def report(self) -> None:
        model = self.simulation.model
        now, steps = time.perf_counter(), model.steps
        took, done = now - self.last[0], steps - self.last[1]
        if done > 0 and took > 0.02:
            self.portion = int(min(max(done / took * PORTION, 1), 20 * self.portion, 10_000_000))
        if self.progress is None or now - self.told < 0.9 * PORTION:
            return
        rate = done * model.particles.count / max(took, 1e-9) / 1e6
        end = self.simulation.case.end_time
        simulated = model.time - self.first_time
        left = (end - model.time) / simulated * (now - self.begin) if simulated > 0 else None
        from warpsph.kernels import clock as ck

        dt = float(model.stepper.read()[0][ck.LAST_STEP])
        self.progress(Progress(model.time, end, steps, dt, rate, model.time / end, left))
        self.last = (now, steps)
        self.told = now


def run(case: Case, **options: Any) -> Simulation:
    """Run a case and return the finished `Simulation`; the options are those of `Simulation`."""
    return Simulation(case, **options).run()


# before a run ------------------------------------------------------------------------------------------------------


def describe(case: Case) -> dict[str, Any]:
    """Return what a run of the case would be: resolved case, structure, stages, and what is absent and why.

    Compiles and allocates nothing on a device.
    """
    from warpsph.kernels.fields import fields_of
    from warpsph.schemes import riemann

    geometry = build(case, support_radius(case))
    physics = derive(case, geometry)
    known: dict[str, Any] = {f"numerics.{key}": value for key, value in physics.choices.items() if value is not None}
    for name, c in zip(case.phase_names, physics.sound_speed, strict=True):
        known[f"phases.{name}.sound_speed"] = c
    for name, value in physics.scales.items():
        known[f"scales.{name}"] = value
    spec = physics.spec
    return {
        "resolved": case.resolved(known),
        "structure": {
            **{field.name: getattr(spec, field.name) for field in dataclasses.fields(spec) if field.name != "row_list"},
            "smoothing length": f"{physics.h:.6g} m",
            "support radius": f"{physics.support:.6g} m",
            "step limits": {name: f"{value:.4g} s" for name, value in physics.step_cap.items()},
            "fields": [field.name for field in fields_of(spec)],
        },
        "reasons": physics.reasons,
        "stages": [{"name": stage.name, "reason": stage.reason} for stage in riemann.step(spec)],
        "absent": [{"name": row.name, "reason": row.reason} for row in riemann.absent(spec)],
        "warnings": [*geometry.warnings, *physics.warnings],
    }


def estimate(case: Case) -> dict[str, Any]:
    """Return particle counts, memory [bytes], time step [s], steps and seconds to expect, and warnings."""
    from warpsph.kernels.fields import fields_of
    from warpsph.neighbours import default_width

    geometry = build(case, support_radius(case))
    physics = derive(case, geometry)
    spec = physics.spec
    size = {"real": 1, "vec": spec.dimension, "pair": 2}
    width = 8 if case.precision == "float64" else 4
    per_row = {"int8": 1, "uint8": 1, "int16": 2, "int32": 4}
    rows = {"fluid": geometry.fluid_count, "wall": geometry.wall_count, "all": geometry.count}
    memory = sum(
        rows[field.rows] * (per_row.get(field.kind) or size[field.kind] * width) for field in fields_of(spec)
    )
    memory += geometry.count * (16 + 2 * spec.dimension * width)  # sort keys and scratch
    capacity = case.numerics.neighbour_capacity
    skin = float(physics.choices["skin"])
    entries = default_width(spec, physics.support, case.spacing, skin) if capacity == "auto" else int(capacity)
    memory += geometry.count * entries * 4
    dt = physics.estimated_step()
    steps = math.ceil(case.end_time / dt)
    return {
        "particles": geometry.fluid_count,
        "walls": geometry.wall_count,
        "memory_bytes": memory,
        "dt": dt,
        "steps": steps,
        "seconds": steps * geometry.count / (GUESSED_RATE["cpu"] * 1e6),
        "warnings": [*geometry.warnings, *physics.warnings],
    }


# helpers -----------------------------------------------------------------------------------------------------------


def _schedule(output: Any) -> Schedule:
    """Return when something is due; nothing ever, for None."""
    if output is None:
        return Schedule(times=())
    return Schedule(interval=getattr(output, "interval", None), times=getattr(output, "times", None))


def _point(position: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in position) + ")"


def _check_device(device: str) -> None:
    import warp as wp

    names = [str(known) for known in wp.get_devices()]
    if device not in names and not (device == "cuda" and wp.is_cuda_available()):
        raise CaseError([Problem("device", device, "no such device here", f"choose from: {', '.join(names)}")])


def _load_checkpoint(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    file = path
    if path.is_dir():
        folder = path / "checkpoint" if (path / "checkpoint").is_dir() else path
        found = checkpoint.latest(folder)
        if found is None:
            raise CaseError([Problem("restart", str(path), "holds no readable checkpoint", "name a .h5 file or a run folder")])
        file = found
    return checkpoint.load(file)


def _check_fit(model: Model, state: Mapping[str, np.ndarray], attributes: Mapping[str, Any]) -> None:
    """Refuse a checkpoint of another scene; numbers that may change on purpose (end time, outputs) are not compared."""
    problems = []
    if attributes.get("precision") != model.case.precision:
        rule = f"was written in {attributes.get('precision')}"
        problems.append(Problem("precision", model.case.precision, rule, "restart with the same precision"))
    count = len(state.get("anchor", ()))
    if count != model.particles.count:
        rule = f"the checkpoint holds {count} particles, the case {model.particles.count}"
        problems.append(Problem("restart", count, rule, "restart with the case of its run"))
    if problems:
        raise CaseError(problems)


def _machine() -> dict[str, Any]:
    from warpsph.model import default_threads

    return {
        "system": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "processors": default_threads(),
        "python": platform.python_version(),
    }


def _versions() -> dict[str, str]:
    found = {}
    for name in ("warp-lang", "numpy", "h5py", "pyvista", "pydantic"):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found
