"""A run from start to end.

The loop, in words:

    build the particles, or load a checkpoint
    record what is due at the start (gauges, particles)
    until the end time:
        step to the next moment at which something is due, in portions of about half a second
            after each portion: report progress; stop on a fault
        gauges, particles, checkpoint: each where due, in this order, handed to a writer thread as copies
        after Ctrl-C, or when the wall time is over: a checkpoint, and stop
    write the last checkpoint and particles, compare with the references, write summary.json

A checkpoint is queued behind everything else that is due at its time, and the writer keeps that order: what a
restart finds on the disk is complete up to the checkpoint, whenever the process was killed.
"""

from __future__ import annotations

import dataclasses
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.case_file import as_case, dump_case
from warpsph.errors import (
    CaseError,
    DivergenceError,
    Interrupted,
    OutputError,
    Problem,
    WallTimeReached,
    WarpsphError,
)
from warpsph.files import checkpoint
from warpsph.files.output import RunFolder, Schedule, Writer
from warpsph.measure.gauges import GaugeSet
from warpsph.measure.totals import eos_of_run
from warpsph.running.divergence import runaway_particle
from warpsph.running.doubts import doubts
from warpsph.running.recorder import Recorder
from warpsph.running.restarts import SAME_CASE, check_fit, check_unfinished, find_checkpoint, is_inside, reached, scene_of
from warpsph.running.state_copy import EVERYTHING, SOURCES, StateCopy, copy_state
from warpsph.running.summary import leak_warning, machine, solver_warnings, spill_warning, spilled, versions
from warpsph.scene.physics import Physics
from warpsph.snapshot import Snapshot
from warpsph.study.comparison import compare, format_comparison

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.running.model import Model

    CaseLike = Case | Path | str | Mapping[str, Any]

PORTION = 0.5  # s of wall time between two looks at the clock
FIRST_STEPS = 1
LOG_SHARE, LOG_SECONDS = 0.05, 60.0  # a line of the log after each 5 % of the run, and at least every minute


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
        case: a validated case, the name of a case file, or the nested plain data that one would hold.
        output: folder for the results; None keeps gauges and the last state in memory alone.
        device: Warp device name, "cpu" or "cuda:0".
        threads: threads of a CPU device (default: all processors).
        restart: checkpoint file, its folder, or a run folder to go on from.
        wall_time: s after which the run stops with a checkpoint, counted from here; of a second `run` from its call
            (default: no limit). It is looked at about twice a second, after at least one step; the last checkpoint
            and the summary take what they take on top of it.
        preparing: called while kernels are compiled or loaded, with the number of those that are ready.

    A restart that writes into the folder of its checkpoint continues the files there and drops what is later
    than the checkpoint; another folder must be new or empty, and starts at the time of the checkpoint.

    Raises:
        CaseError: the case is wrong, the device does not exist, the checkpoint does not fit the case, `wall_time` is not
            above 0, or with an output folder there is nothing left to compute after the checkpoint.
        OutputError: the output folder cannot be used.
        CapacityError: the case does not fit the memory, or the neighbour list cannot hold the particles of the start.

    Attributes:
        case: the case.
        model: the state on the device.
        summary: what summary.json holds, after `run`.
    """

    def __init__(
        self,
        case: CaseLike,
        output: Path | str | None = None,
        device: str = "cpu",
        threads: int | None = None,
        restart: Path | str | None = None,
        wall_time: float | None = None,
        preparing: Callable[[int], None] | None = None,
    ) -> None:
        from warpsph.running.model import Model, quiet_warp

        begin = time.perf_counter()
        self._wall_time = _checked_wall_time(wall_time)
        self._deadline = begin + self._wall_time
        quiet_warp(device)
        _check_device(device)
        case = as_case(case)
        self.case = case
        self.summary: dict[str, Any] = {}
        self.warnings: list[str] = []
        self.folder: RunFolder | None = None
        self._restart: Path | None = None
        self._gauges: GaugeSet = GaugeSet(case)  # becomes that of the folder
        state: dict[str, np.ndarray] | None = None
        attributes: dict[str, Any] = {}
        if restart is not None:
            self._restart = find_checkpoint(Path(restart), self.warnings.append)
            state, attributes = checkpoint.load(self._restart)
            if output is not None:
                check_unfinished(case, self._restart, Path(output), float(attributes["time"]))
        self.model: Model = Model(case, device=device, threads=threads, fresh=state is None, preparing=preparing)
        if state is not None:
            check_fit(self.model, state, attributes)
            try:
                self.model.load_state(state)
            except ValueError as error:
                rule = f"does not fit the case: {error}"
                raise CaseError([Problem("restart", str(restart), rule, SAME_CASE)]) from error
        self.physics: Physics = self.model.physics
        geometry = self.model.geometry
        self.warnings += [*doubts(case, geometry), *geometry.warnings, *self.physics.warnings]
        self.started_at = self.model.time
        self.first_step = self.model.steps
        resume = output is not None and self._restart is not None and is_inside(self._restart, Path(output))
        # The folder is taken first, so that a wrong one is told before kernels are compiled; of what it holds
        # nothing is cut before everything else has worked.
        self.folder = self._open_folder(output, resume)
        try:
            self.model.stepper.prepare(fresh=state is None)
            self._gauges = self._make_gauges(resume)
            self._recorder = Recorder(self.model, self._gauges)
            if self.folder is not None and resume:
                self.folder.cut_after(self.started_at)
                (self.folder.particles / "failed_fluid.vtp").unlink(missing_ok=True)
                checkpoint.delete_after(self.folder.checkpoints, self.first_step)
            self._write_case()
            self._log_start()
        except BaseException as error:
            if self.folder is not None:
                with suppress(OutputError):
                    self.folder.log(f"failed: {error}")
            self.close()
            raise
        # when to take a snapshot; the gauges' own schedules move on when the writer thread has done the rows
        self._moments = {name: _schedule(spec) for name, spec in case.gauges.items()}
        for moment in self._moments.values():
            if self.started_at > 0:
                moment.advance(self.started_at * (1.0 - 1.0e-8))
        self._last_frame = -1.0
        if self.folder is not None and self.folder.series["fluid"].frames:
            self._last_frame = self.folder.series["fluid"].frames[-1][0]
        self._signal = ""
        self._writing: Writer | None = None
        self.setup_seconds = time.perf_counter() - begin
        self._copy_seconds = 0.0

    def _open_folder(self, output: Path | str | None, resume: bool) -> RunFolder | None:
        if output is None:
            return None
        particles = self.case.output.particles
        options: dict[str, Any] = {"precision": self.case.precision}
        if particles is not None:
            lyapunov = self.case.output.lyapunov
            fields = particles.fields if lyapunov is None else (*particles.fields, *lyapunov.fields)
            options |= {"fields": fields, "compress": particles.compress}
        return RunFolder(output, resume=resume, **options)

    def _write_case(self) -> None:
        """Write case.yaml, in the folder of a restart over that of the run so far, and the files that it names."""
        if self.folder is not None:
            names = self.folder.keep_references(self.case.reference_files)
            self.folder.write_case(dump_case(self.case, names=names))

    def _make_gauges(self, resume: bool) -> GaugeSet:
        eos = eos_of_run(self.case, self.physics.sound_speed, self.model.nominal_pressure)
        folder = None if self.folder is None else self.folder.gauges
        started = None if self._restart is None else self.started_at
        return GaugeSet(self.case, folder, eos=eos, restart_time=started if resume else None, start_time=started)

    def _log_start(self) -> None:
        if self.folder is None:
            return
        from warpsph import __version__

        model = self.model
        particles = model.particles
        origin = "starts"
        if self._restart is not None:
            origin = f"goes on from {self._restart} (step {self.first_step})"
        self.folder.log(
            f"warpsph {__version__} {origin} at t = {model.time:.6g} s, to {self.case.end_time:g} s: "
            f"{particles.fluid_count} fluid and {particles.wall_count} wall particles, {model.device}, "
            f"{model.launcher.threads} threads, {self.case.precision}"
        )
        for line in self.warnings:
            self.folder.log(f"warning: {line}")

    # Python access ------------------------------------------------------------------------------------------

    def gauge(self, name: str) -> dict[str, np.ndarray]:
        """Return what a gauge has measured: column -> (rows,) array, `time` [s] among them.

        Raises KeyError if there is no such gauge.
        """
        if self._writing is not None:
            self._writing.flush()  # rows are added by the writer thread
        return self._gauges.series(name)

    @property
    def state(self) -> Snapshot:
        """A host copy of the present state."""
        return self.model.snapshot()

    def close(self) -> None:
        """Give up the output folder of a run that is not going to be run; `run` does it at its end."""
        self._gauges.close()
        if self.folder is not None:
            self.folder.close()

    # the run ------------------------------------------------------------------------------------------------

    def run(self, progress: Callable[[Progress], None] | None = None) -> Simulation:
        """Run to the end time of the case and return self.

        Args:
            progress: called about twice a second.

        Raises:
            DivergenceError: the state became non-finite or ran away; the last good checkpoint is kept.
            CapacityError: the neighbour list cannot grow any further.
            OutputError: results cannot be written.
            Interrupted: Ctrl-C, or the system asked to end (SIGTERM, SIGHUP); the state is in a checkpoint.
            WallTimeReached: the `wall_time` is over; the state is in a checkpoint.
        """
        if self.folder is not None and self.summary:
            raise WarpsphError(
                f"{self.folder.path}: this run is over; make a new Simulation with restart= to go on"
            )
        begin = time.perf_counter()
        if self.summary:
            self._deadline = begin + self._wall_time
        status, failure, self._signal = "failed", None, ""
        with self._watch_signals(), self._writer() as writer:
            try:
                self._loop(writer, progress)
                if writer is not None:
                    writer.flush()
                status = "finished"
            except BaseException as error:
                failure = error
                if isinstance(error, (DivergenceError, Interrupted)):
                    status = "diverged" if isinstance(error, DivergenceError) else "interrupted"
                raise
            finally:
                self._close(writer, status, failure, begin)
        return self

    def _loop(self, writer: Writer | None, progress: Callable[[Progress], None] | None) -> None:
        case, end = self.case, self.case.end_time
        frames = _schedule(case.output.particles)
        saves = _schedule(case.output.checkpoint)
        now = self.model.time
        saves.advance(now)  # the start itself can always be made again
        if now > 0:
            # a frame at the start of a restart is in the folder already, unless the folder is a new one
            frames.advance(now if self._last_frame >= 0 else now * (1.0 - 1.0e-8))
        self._record(writer, frames)
        meter = _Meter(self, progress)
        while not reached(self.model.time, end):
            target = min(end, self.model.calm_from, *(s.next for s in (*self._moments.values(), frames, saves)))
            self._step_to(target, meter, writer)
            if reached(self.model.time, self.model.calm_from):
                self.model.calm_down()
            # also before a stop: a restart takes what is due at its time as written
            self._record(writer, frames)
            if self._signal or (self._is_late() and not reached(self.model.time, end)):
                self._stop(writer)
            if saves.due(self.model.time) and not reached(self.model.time, end):
                self._save(writer)
                saves.advance(self.model.time)
        if self.folder is not None and case.output.checkpoint is not None:
            self._save(writer)
        else:
            self._check(self.model.save_state(), writer)
        if case.output.particles is not None and self._last_frame != self.model.time:
            self._frame(writer)
        meter.report(last=True)

    def _step_to(self, target: float, meter: _Meter, writer: Writer | None) -> None:
        """Step until the target time, or until a signal asks to stop or the wall time is over."""
        from warpsph.kernels.core import clock as ck

        stepper = self.model.stepper
        while True:
            stepper.run(target, meter.portion)
            clock, counters = stepper.read()
            if counters[ck.FAULT] == ck.FAULT_STATE:
                self._fail(int(counters[ck.FAULT_PARTICLE]), writer)
            meter.report()
            if self._signal or self._is_late() or reached(float(clock[ck.TIME]), target):
                return

    def _is_late(self) -> bool:
        """Whether the wall time is over."""
        return time.perf_counter() >= self._deadline

    def _stop(self, writer: Writer | None) -> None:
        """Save the state, wait until it is on the disk, and raise Interrupted or WallTimeReached."""
        reason = f"by {self._signal}" if self._signal else f"after {self._wall_time:g} s of wall time"
        text = f"stopped {reason} at t = {self.model.time:.6g} s (step {self.model.steps})"
        if writer is not None and self.folder is not None:
            self._save(writer)
            writer.flush()
            text += f"; go on with --restart {self.folder.path}"
        raise Interrupted(text) if self._signal else WallTimeReached(text)

    def _check(self, state: Mapping[str, np.ndarray], writer: Writer | None) -> None:
        """Stop if a saved state is not finite: the device would see it only in the next step."""
        rows = self.model.particles.fluid_count
        for name, field in self.model.particles.fields.items():
            if field.kept and field.rows != "wall" and state[name].dtype.kind == "f":
                finite = np.isfinite(state[name][:rows]).reshape(rows, -1).all(axis=1)
                if not finite.all():
                    self._fail(int(np.argmin(finite)), writer)

    def _fail(self, row: int, writer: Writer | None) -> None:
        """Report the particle that ran away and keep the state for a look."""
        model = self.model
        identity, position, quantity, value, cause = runaway_particle(model, row)
        where = ""
        if self.folder is not None:
            try:
                if writer is not None:
                    writer.flush()
                where = f"; the state is in {self.folder.write_failed_state(model.snapshot())}"
            except OutputError as error:  # must not hide what happened
                where = f"; the state could not be written: {error}"
            last = checkpoint.latest(self.folder.checkpoints, self.folder.log)
            if last is not None:
                where += f"; the last good one is in {last}"
        raise DivergenceError(
            f"the run diverged at t = {model.time:.6g} s (step {model.steps}): particle {identity} at "
            f"{position} has {quantity} {value}{where}. {cause}",
            particle=identity,
            time=model.time,
            quantity=quantity,
        )

    # output -------------------------------------------------------------------------------------------------

    def _record(self, writer: Writer | None, frames: Schedule) -> None:
        now = self.model.time
        due = [name for name, moment in self._moments.items() if moment.due(now)]
        if due:
            begin = time.perf_counter()
            record = self._recorder.take(due)
            self._copy_seconds += time.perf_counter() - begin
            self._put(writer, "gauges", record)
            for name in due:
                self._moments[name].advance(now)
        if frames.due(now):
            self._frame(writer)
            frames.advance(now)

    def _frame(self, writer: Writer | None) -> None:
        self._last_frame = self.model.time
        if self.folder is not None:
            begin = time.perf_counter()
            state = copy_state(self.model, EVERYTHING | (SOURCES.keys() & {*self.folder.fields}))
            self._copy_seconds += time.perf_counter() - begin
            self._put(writer, "particles", state)

    def _write_particles(self, state: StateCopy) -> None:
        assert self.folder is not None
        self.folder.write_particles(state.snapshot())

    def _put(self, writer: Writer | None, kind: str, payload: Any) -> None:
        if writer is not None:
            writer.put(kind, payload)
        elif kind == "gauges":
            self._recorder.write(payload)

    def _save(self, writer: Writer | None) -> None:
        begin = time.perf_counter()
        state = self.model.save_state()
        self._check(state, writer)
        payload = (self.model.steps, state, self._attributes())
        self._copy_seconds += time.perf_counter() - begin
        self._put(writer, "checkpoint", payload)

    def _write_checkpoint(self, payload: tuple[int, dict[str, np.ndarray], dict[str, Any]]) -> None:
        step, state, attributes = payload
        assert self.folder is not None
        checkpoint.save(self.folder.checkpoint_path(step), state, attributes)
        kept = self.case.output.checkpoint
        checkpoint.prune(self.folder.checkpoints, kept.keep if kept is not None else 3)

    def _attributes(self) -> dict[str, Any]:
        from warpsph import __version__
        return {
            "version": __version__,
            "case": dump_case(self.case),
            "time": self.model.time,
            "step": self.model.steps,
            "device": str(self.model.device),
            "precision": self.case.precision,
            "scene": scene_of(self.case),
        }

    @contextmanager
    def _writer(self) -> Iterator[Writer | None]:
        if self.folder is None:
            yield None
            return
        handlers: dict[str, Callable[[Any], object]] = {
            "gauges": self._recorder.write,
            "particles": self._write_particles,
            "checkpoint": self._write_checkpoint,
        }
        with Writer(handlers) as writer:
            self._writing = writer
            try:
                yield writer
            finally:
                self._writing = None

    def _close(self, writer: Writer | None, status: str, failure: BaseException | None, begin: float) -> None:
        """Finish what is being written, compare with the references and write the summary."""
        if writer is not None:
            with suppress(WarpsphError):  # after a failure; a finished run has waited for the writer already
                writer.flush()
        try:
            self.summary = self._summarise(status, failure, time.perf_counter() - begin, writer)
            if self.folder is None:
                return
            seconds = self.summary["wall_seconds"]
            self.folder.log(
                f"{status}: t = {self.model.time:.6g} s, {self.model.steps} steps, {seconds:.2f} s"
            )
            for line in format_comparison(list(self.summary["errors"].values())):
                self.folder.log(line)
            if failure is not None:
                self.folder.log(str(failure) or type(failure).__name__)
            self.folder.write_summary(self.summary)
        except OutputError:
            if failure is None:
                raise
        finally:
            self.close()

    def _summarise(
        self, status: str, failure: BaseException | None, seconds: float, writer: Writer | None
    ) -> dict[str, Any]:
        model = self.model
        steps = model.steps - self.first_step
        origin = None if self._restart is None else {"time": self.started_at, "step": self.first_step}
        particles = model.particles
        last = model.snapshot() if status == "finished" else None
        frames = None if self.folder is None else self.folder.path
        results = compare(self.case, None, gauges=self._gauges, snapshot=last, end_time=model.time, frames=frames)
        stages = model.stepper.timings()
        from warpsph import __version__
        from warpsph.kernels.core import clock as ck

        _, counters = model.stepper.read()
        return {
            "title": self.case.title,
            "status": status,
            "problem": None if failure is None else str(failure) or type(failure).__name__,
            "time": model.time,
            "steps": model.steps,
            "restarted_from": origin,
            "particles": model.fluid_count + particles.wall_count,
            "fluid_particles": model.fluid_count,
            "wall_particles": particles.wall_count,
            "wall_seconds": seconds,
            "setup_seconds": self.setup_seconds,
            "device": str(model.device),
            "device_name": model.device.name,
            "threads": model.launcher.threads,
            "precision": self.case.precision,
            "mups": particles.count * steps / max(seconds, 1e-9) / 1e6,
            "list_rebuilds": int(counters[ck.REBUILDS]),
            "bytes_per_particle": (particles.memory() + model.stepper.list.memory_beside()) / max(particles.count, 1),
            "timings": {name: value for name, value in stages.items() if value > 0.0},
            "output_seconds": {
                "copying": self._copy_seconds,
                "writing beside the run": writer.busy_seconds if writer is not None else 0.0,
            },
            **self._solves(),
            **self._leaks(),
            **self._spilled(last),
            "sound_speed": dict(zip(self.case.phase_names, self.physics.sound_speed, strict=True)),
            "smoothing_length": self.physics.h,
            "machine": machine(),
            "versions": {"warpsph": __version__, **versions()},
            "warnings": list(self.warnings),
            "errors": {entry["quantity"]: entry for entry in results},
        }

    def _leaks(self) -> dict[str, Any]:
        """Return the fluid particles beyond walls and inside bodies for the summary; warn if there were any."""
        most, last = self.model.leaks()
        if any(most.values()):
            self._warn(leak_warning(most, last))
        return {"leaks": {"largest": most, "last": last}}

    def _spilled(self, last: Snapshot | None) -> dict[str, Any]:
        """Return the particles over the rim of an open side of a finished run for the summary; warn if there are any."""
        if last is None or not self.case.has_open_sides:
            return {}
        counts = spilled(self.case, last.fluid, self.physics.support)
        if any(counts.values()):
            self._warn(spill_warning(counts))
        return {"spilled": counts}

    def _warn(self, text: str) -> None:
        """Add a warning to the summary and the log of a run that is over."""
        self.warnings.append(text)
        if self.folder is not None:
            with suppress(OutputError):
                self.folder.log(f"warning: {text}")

    def _solves(self) -> dict[str, Any]:
        """Return the sums over the pressure solves of an ISPH run for the summary; warn of those that failed."""
        systems = self.model.stepper.systems
        if systems is None:
            return {}
        totals = systems.report()
        for text in solver_warnings(totals):
            self._warn(text)
        return {"solver": totals}

    @contextmanager
    def _watch_signals(self) -> Iterator[None]:
        """Turn Ctrl-C and a request to end into a flag that is looked at between portions.

        So nothing is left half done; further signals change nothing until the output is finished.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def note(number: int, _frame: Any) -> None:
            self._signal = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name

        numbers = [signal.SIGINT, signal.SIGTERM]
        # The terminal or the connection is gone (not on Windows). A run under nohup ignores that, and goes on.
        hang_up = getattr(signal, "SIGHUP", None)
        if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:
            numbers.append(hang_up)
        before = {number: signal.signal(number, note) for number in numbers}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class _Meter:
    """Watches the rate of a run, sizes the portions between two looks, and tells the caller and the log."""

    def __init__(self, simulation: Simulation, progress: Callable[[Progress], None] | None) -> None:
        self.simulation = simulation
        self.progress = progress
        self.portion = FIRST_STEPS
        self.begin = time.perf_counter()
        self.first_time = simulation.model.time
        self.last = (self.begin, simulation.model.steps)
        self.logged = (self.begin, self.first_time / simulation.case.end_time)

    def report(self, last: bool = False) -> None:
        """Take note of the steps done; tell it if it is time to, and at the last call in any case."""
        model = self.simulation.model
        now, steps = time.perf_counter(), model.steps
        took, done = now - self.last[0], steps - self.last[1]
        if done > 0 and took > 0.02:
            self.portion = int(min(max(done / took * PORTION, 1), 20 * self.portion, 10_000_000))
        end = self.simulation.case.end_time
        share = model.time / end
        log = now - self.logged[0] >= LOG_SECONDS or share - self.logged[1] >= LOG_SHARE
        tell = last or took >= 0.9 * PORTION
        if not (log or tell):
            return
        rate = done * model.particles.count / max(took, 1e-9) / 1e6
        simulated = model.time - self.first_time
        left = (end - model.time) / simulated * (now - self.begin) if simulated > 0 else None
        from warpsph.kernels.core import clock as ck

        dt = float(model.stepper.read()[0][ck.LAST_STEP])
        if tell:
            self.last = (now, steps)
            # After a signal nothing is shown any more: the terminal may be what is gone.
            if self.progress is not None and not self.simulation._signal:
                self.progress(Progress(model.time, end, steps, dt, rate, share, left))
        if log and self.simulation.folder is not None:
            self.logged = (now, share)
            self.simulation.folder.log(
                f"{100 * share:.0f} %: t = {model.time:.6g} s, step {steps}, dt {dt:.3g} s, {rate:.3g} Mups, "
                f"{now - self.begin:.1f} s"
            )


def run(case: CaseLike, **options: Any) -> Simulation:
    """Run a case and return the finished `Simulation`.

    Args:
        case: a validated case, the name of a case file, or the nested plain data that one would hold.
        options: `output`, `device`, `threads` and `restart` of `Simulation`.

    Raises:
        CaseError: the case is wrong, or an option does not fit it; else as `Simulation` and `Simulation.run`.
    """
    return Simulation(case, **options).run()


# helpers ------------------------------------------------------------------------------------------------


def _schedule(output: Any) -> Schedule:
    """Return when something is due; nothing ever, for None."""
    if output is None:
        return Schedule(times=())
    return Schedule(interval=getattr(output, "interval", None), times=getattr(output, "times", None))


def _check_device(device: str) -> None:
    import warp as wp

    names = [str(known) for known in wp.get_devices()]
    if device not in names and not (device == "cuda" and wp.is_cuda_available()):
        remedy = f"choose from: {', '.join(names)}"
        raise CaseError([Problem("device", device, "no such device here", remedy)])


def _checked_wall_time(wall_time: float | None) -> float:
    """The wall time [s], infinity for None; raises CaseError unless it is above 0."""
    if wall_time is None:
        return math.inf
    if isinstance(wall_time, bool) or not isinstance(wall_time, (int, float)) or not wall_time > 0:
        raise CaseError([Problem("wall_time", wall_time, "needs a number of seconds above 0", "write e.g. 3600")])
    return float(wall_time)
