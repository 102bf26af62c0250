"""What goes wrong while a run goes on: kills, signals, divergence, full lists, full disks.

Each time: what is said, the exit code, what the folder holds, and that a restart ends as it would have.
"""

import contextlib
import errno
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.scenes import FULL, PERIODIC, case_of
from warpsph import Simulation, cli, simulation
from warpsph.case.case_file import save_case
from warpsph.engine import neighbours
from warpsph.errors import CapacityError, CaseError, DivergenceError, Interrupted, OutputError, WallTimeReached
from warpsph.files import checkpoint, whole_files
from warpsph.files.output import Series
from warpsph.files.vtp import read_vtp
from warpsph.measure.gauge_files import read_gauge

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def long_case():
    """About a second of computing, and many outputs."""
    return case_of(FULL, end_time=1.2, numerics__courant=0.2)


@pytest.fixture(scope="module")
def undisturbed(long_case, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    Simulation(long_case, output=folder, threads=1).run()
    return folder


def assert_same_results(one: Path, other: Path) -> None:
    """The same frames and gauges, byte by byte, and the same last state."""
    for part in ("particles", "gauges"):
        files = {path.name: path.read_bytes() for path in (other / part).iterdir()}
        assert files.pop("failed_fluid.vtp", None) is None
        assert {path.name: path.read_bytes() for path in (one / part).iterdir()} == files
    a, b = (checkpoint.load(checkpoint.latest(run / "checkpoint", pytest.fail))[0] for run in (one, other))
    for name in ("position", "velocity", "density_excess", "particle_id"):
        assert a[name].tobytes() == b[name].tobytes()


def assert_whole(run: Path, dimension: int = 2) -> None:
    """Every file that carries its final name can be read, and the series names what is there."""
    assert not list(run.rglob("*.partial"))
    assert_readable(run, dimension)


def assert_readable(run: Path, dimension: int = 2) -> None:
    for path in (run / "checkpoint").glob("[!.]*.h5"):
        checkpoint.load(path)
    series = Series(run / "particles", "fluid")
    series.read()
    for moment, name in series.frames:
        assert read_vtp(run / "particles" / name, dimension).time == moment
    for path in (run / "gauges").glob("*.csv"):
        read_gauge(path)


def hear_hang_ups() -> None:
    """The tests may themselves run under nohup, whose deaf ear a child would inherit."""
    if sys.platform != "win32":
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def start(*arguments: object) -> subprocess.Popen:
    command = [sys.executable, "-m", "warpsph", *map(str, arguments)]
    hear = None if sys.platform == "win32" else hear_hang_ups
    return subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=hear
    )  # fmt: skip


def wait_for(condition, process: subprocess.Popen) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.005)


def last_step(run: Path) -> int:
    names = sorted(path.stem for path in (run / "checkpoint").glob("[!.]*.h5"))
    return int(names[-1].split("_")[1]) if names else -1


# Kills and signals ------------------------------------------------------------------------------------------


def test_kill_at_any_moment(long_case, undisturbed, tmp_path):
    """Killed twice and restarted: at most one interval is lost, and the end is the same bit by bit."""
    run, case = tmp_path / "run", tmp_path / "case.yaml"
    save_case(long_case, case)
    arguments = ["run", case, "--output", run, "--threads", "1"]
    luck = random.Random()
    for _ in range(2):
        before = last_step(run)
        process = start(*arguments)
        wait_for(lambda before=before: last_step(run) > before, process)
        time.sleep(luck.uniform(0, 0.1))
        process.kill()
        process.communicate()
        with contextlib.suppress(OutputError):  # the last row may be cut off in the middle
            computed = read_gauge(run / "gauges" / "jump.csv")[0]["time"][-1]
            kept = checkpoint.load(checkpoint.latest(run / "checkpoint", pytest.fail))[1]["time"]
            assert computed - kept <= 0.05 + 0.02 + 1e-9
        for path in (run / "checkpoint").glob("[!.]*.h5"):
            checkpoint.load(path)
        arguments = ["run", case, "--restart", run, "--threads", "1"]
    process = start(*arguments)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert_same_results(undisturbed, run)
    assert_whole(run)


def test_ctrl_c(long_case, undisturbed, tmp_path):
    """Exit code 130, everything whole, and a restart goes on bit by bit."""
    run, case = tmp_path / "run", tmp_path / "case.yaml"
    save_case(long_case, case)
    process = start("run", case, "--output", run, "--threads", 1)
    wait_for(lambda: last_step(run) > 0, process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err and f"--restart {run}" in err and "Ctrl-C" in err
    summary = json.loads((run / "summary.json").read_text())
    assert summary["status"] == "interrupted" and 0 < summary["time"] < 1.2
    assert last_step(run) == summary["steps"]
    assert_whole(run)
    Simulation(long_case, output=run, restart=run, threads=1).run()
    assert_same_results(undisturbed, run)


@pytest.mark.parametrize(("number", "moment"), [(signal.SIGINT, 0.1), (signal.SIGINT, 0.7512), (signal.SIGTERM, 0.1)])
def test_signal(long_case, undisturbed, tmp_path, monkeypatch, number, moment):
    """At an output time and between two, pressed again and again, also while the checkpoint is written.

    All that is due has been written before the run stops.
    """
    monkeypatch.setattr(simulation, "PORTION", 0.0)
    before = signal.getsignal(number)
    save = checkpoint.save

    def pressed_while_saving(*arguments):
        save(*arguments)
        if (tmp_path / "pressed").exists():
            os.kill(os.getpid(), number)

    monkeypatch.setattr(checkpoint, "save", pressed_while_saving)

    def press(p):
        if p.time >= moment * (1 - 1e-9):
            (tmp_path / "pressed").touch()
            signal.raise_signal(number)
            signal.raise_signal(number)

    with pytest.raises(Interrupted) as caught:
        Simulation(long_case, output=tmp_path / "run", threads=1).run(press)
    assert caught.value.exit_code == 130
    assert ("Ctrl-C" if number == signal.SIGINT else "SIGTERM") in str(caught.value)
    assert signal.getsignal(number) is before
    (tmp_path / "pressed").unlink()
    reached = checkpoint.load(checkpoint.latest(tmp_path / "run" / "checkpoint"))[1]["time"]
    assert moment * (1 - 1e-9) <= reached < moment + 0.02
    Simulation(long_case, output=tmp_path / "run", restart=tmp_path / "run", threads=1).run()
    assert_same_results(undisturbed, tmp_path / "run")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGHUP")
@pytest.mark.parametrize("terminal", [False, True])
def test_hang_up(long_case, undisturbed, tmp_path, terminal):
    """The signal alone, and a terminal that is closed under the run: a checkpoint, exit code 130, and a restart goes on."""
    run, case = tmp_path / "run", tmp_path / "case.yaml"
    save_case(long_case, case)
    arguments = ("run", case, "--output", run, "--threads", 1)
    if terminal:
        process, ours = start_on_a_terminal(*arguments)
        wait_for(lambda: os.read(ours, 4096) and last_step(run) > 0, process)
        os.close(ours)  # the kernel tells the leader of the session
    else:
        process = start(*arguments)
        wait_for(lambda: last_step(run) > 0, process)
        process.send_signal(signal.SIGHUP)
        _, err = process.communicate(timeout=60)
        assert "Traceback" not in err and "stopped by SIGHUP" in err and f"--restart {run}" in err
    assert process.wait(timeout=60) == 130
    summary = json.loads((run / "summary.json").read_text())
    assert summary["status"] == "interrupted" and 0 < summary["time"] < 1.2
    assert "stopped by SIGHUP" in (run / "log.txt").read_text()
    assert not (run / "traceback.txt").exists()
    assert_whole(run)
    Simulation(long_case, output=run, restart=run, threads=1).run()
    assert_same_results(undisturbed, run)


def start_on_a_terminal(*arguments: object) -> tuple[subprocess.Popen, int]:
    """A run on a terminal of its own, and our end of it; closing that hangs up."""
    import fcntl
    import pty
    import termios

    ours, its = pty.openpty()
    command = [sys.executable, "-m", "warpsph", *map(str, arguments)]
    process = subprocess.Popen(
        command, cwd=ROOT, stdin=its, stdout=its, stderr=its, start_new_session=True,
        preexec_fn=lambda: (hear_hang_ups(), fcntl.ioctl(0, termios.TIOCSCTTY, 0)),
    )  # fmt: skip
    os.close(its)
    return process, ours


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGHUP")
def test_hang_up_is_ignored_under_nohup(long_case, undisturbed, tmp_path):
    run, case = tmp_path / "run", tmp_path / "case.yaml"
    save_case(long_case, case)
    command = ["nohup", sys.executable, "-m", "warpsph", "run", case, "--output", run, "--threads", "1"]
    process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    wait_for(lambda: last_step(run) > 0, process)
    process.send_signal(signal.SIGHUP)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert_same_results(undisturbed, run)


def test_wall_time(long_case, undisturbed, tmp_path, monkeypatch):
    """Exit code 7 and how to go on; what is given with --restart goes on bit by bit."""
    run, case = tmp_path / "run", tmp_path / "case.yaml"
    save_case(long_case, case)
    process = start("run", case, "--output", run, "--threads", 1, "--wall-time", "0.001")
    _, err = process.communicate(timeout=60)
    assert process.returncode == 7
    assert "stopped after 0.001 s of wall time at t = " in err and f"go on with --restart {run}" in err
    assert "Traceback" not in err
    assert json.loads((run / "summary.json").read_text())["status"] == "interrupted"
    assert last_step(run) > 0
    assert_whole(run)
    # A second time, in the middle of a run: it sleeps past the end of its time there. A fast machine would be through before
    # the first look at the clock.
    monkeypatch.setattr(simulation, "PORTION", 0.0)
    begin = time.perf_counter()
    again = Simulation(long_case, output=run, restart=run, threads=1, wall_time=3.0)

    def sleep(p):
        time.sleep(max(begin + 3.5 - time.perf_counter(), 0.0))

    with pytest.raises(WallTimeReached, match="stopped after 3 s of wall time"):
        again.run(sleep)
    assert_whole(run)
    process = start("run", case, "--restart", run, "--threads", 1, "--wall-time", "10min")
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert_same_results(undisturbed, run)


@pytest.mark.parametrize("wall_time", [0, -1.0, float("nan"), "60", True])
def test_wall_time_is_a_number_of_seconds(wall_time):
    with pytest.raises(CaseError, match="wall_time: .* -> needs a number of seconds above 0; write e.g. 3600"):
        Simulation(case_of(PERIODIC), wall_time=wall_time)


def test_signal_without_a_folder(monkeypatch):
    """The state stays in memory, and the run can go on."""
    monkeypatch.setattr(simulation, "PORTION", 0.0)
    run = Simulation(case_of(PERIODIC), threads=1)
    with pytest.raises(Interrupted) as caught:
        run.run(lambda p: signal.raise_signal(signal.SIGINT))
    assert "--restart" not in str(caught.value)
    assert 0 < run.model.time < 0.1
    run.run()
    undisturbed = Simulation(case_of(PERIODIC), threads=1).run()
    np.testing.assert_array_equal(run.state.position, undisturbed.state.position)


# Divergence -------------------------------------------------------------------------------------------------


SELDOM_SAVED = case_of(PERIODIC, output__checkpoint={"interval": 0.1})


def spoil(run: Simulation, field: str, identity: int, value: float, after: float):
    """Return a progress callback that writes a value into a field of one particle."""

    def write(p):
        if p.time > after and not done:
            done.append(p.time)
            particles = run.model.particles
            values = particles.get(field)
            values[int(np.flatnonzero(particles.get("particle_id") == identity)[0])] = value
            particles.put(field, values)

    done: list[float] = []
    return write


@pytest.mark.parametrize(
    "field",
    [
        "velocity",
        "density_excess",
        "acceleration",
        "state",
        "offset",
        "anchor",
        "shift",
        "carried",
    ],
)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_not_finite(tmp_path, monkeypatch, field, value):
    """Wherever it comes from, it ends the run within a few steps and never reaches a checkpoint."""
    monkeypatch.setattr(simulation, "PORTION", 0.0)
    run = Simulation(SELDOM_SAVED, output=tmp_path / "run", threads=1)
    with pytest.raises(DivergenceError) as caught:
        run.run(spoil(run, field, 123, value, 0.11))
    assert_told(caught.value, tmp_path / "run", 0.11)
    if field not in ("density_excess", "state"):  # these reach the neighbours before they are looked at
        assert caught.value.particle == 123


def test_lost_particle_is_seen():
    """Without a place a particle has no neighbours, and nothing but its position tells that it is lost."""
    run = Simulation(case_of(PERIODIC), threads=1)
    run.model.stepper.run(1.0, 5)
    spoil(run, "offset", 123, np.nan, -1.0)(run.model)
    run.model.stepper.rebuild()
    run.model.stepper.run(1.0, 5)
    assert run.model.steps == 6
    with pytest.raises(DivergenceError, match="particle 123 at .nan, nan. has position not finite"):
        run.run()


def test_runaway_speed(tmp_path, monkeypatch):
    monkeypatch.setattr(simulation, "PORTION", 0.0)
    run = Simulation(SELDOM_SAVED, output=tmp_path / "run", threads=1)
    with pytest.raises(DivergenceError) as caught:
        run.run(spoil(run, "velocity", 123, 1000.0, 0.11))
    assert_told(caught.value, tmp_path / "run", 0.11)
    assert caught.value.particle == 123 and caught.value.quantity == "velocity"
    assert "velocity 1414 m/s, limit 98.29 m/s" in str(caught.value)


def assert_told(error: DivergenceError, run: Path, after: float) -> None:
    """The message names particle, time, quantity and files; the run can go on from its checkpoints."""
    assert error.exit_code == 3
    assert after < error.time < after + 0.02 and 0 <= error.particle < 400
    text = str(error)
    assert f"particle {error.particle} at (" in text and f"t = {error.time:.6g} s" in text
    assert error.quantity in ("position", "velocity", "density", "acceleration") and error.quantity in text
    last = checkpoint.latest(run / "checkpoint", pytest.fail)
    arrays, attributes = checkpoint.load(last)
    assert str(last) in text and attributes["time"] == pytest.approx(0.1)
    for name, array in arrays.items():
        assert name in ("clock", "counters") or np.isfinite(array).all(), name
    failed = read_vtp(run / "particles" / "failed_fluid.vtp", 2)
    assert failed.time == error.time and len(failed) == 400
    summary = json.loads((run / "summary.json").read_text())
    assert summary["status"] == "diverged" and summary["problem"] == text
    assert text in (run / "log.txt").read_text()
    assert_whole(run)
    Simulation(SELDOM_SAVED, output=run, restart=run, threads=1).run()
    assert not (run / "particles" / "failed_fluid.vtp").exists()


def test_not_finite_at_the_very_end(tmp_path, monkeypatch):
    """No further step would see it: the run must not end as if nothing had happened."""
    monkeypatch.setattr(simulation, "PORTION", 0.0)
    for folder in (tmp_path / "run", None):
        run = Simulation(case_of(PERIODIC, end_time=0.1), output=folder, threads=1)
        with pytest.raises(DivergenceError):
            run.run(spoil(run, "acceleration", 5, np.nan, 0.1 * (1 - 1e-9)))
    last = checkpoint.latest(tmp_path / "run" / "checkpoint", pytest.fail)
    assert checkpoint.load(last)[1]["time"] == pytest.approx(0.08)


def test_divergence_on_the_command_line(tmp_path):
    case = case_of(PERIODIC, phases__water__viscosity=0, start__velocity=["20*sin(20*x)", "20*cos(30*y)"])
    case = case.replace({"phases.water.sound_speed": 2.0, "scales.velocity": 1.0, "numerics.courant": 1.0})
    save_case(case, tmp_path / "case.yaml")
    result = CliRunner().invoke(
        cli.app, ["run", str(tmp_path / "case.yaml"), "--output", str(tmp_path / "run"), "--threads", "1"]
    )
    assert result.exit_code == 3
    assert "the run diverged at t = " in result.stderr and "particle " in result.stderr
    assert "Traceback" not in result.output + result.stderr
    assert not (tmp_path / "run" / "traceback.txt").exists()


# The neighbour list -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", [PERIODIC, FULL], ids=["periodic", "full"])
def test_narrow_list_grows_and_gives_the_same_bits(scene):
    states = []
    for capacity in (4, 400):
        run = Simulation(case_of(scene, numerics__neighbour_capacity=capacity), threads=2).run()
        states.append(run.model.save_state())
        assert run.model.stepper.list.width > 20
        assert run.summary["timings"]["momentum"] > 0
    for name in states[0].keys() - {"clock", "counters"}:
        assert states[0][name].tobytes() == states[1][name].tobytes(), name


def test_list_grows_in_the_middle_of_a_run(monkeypatch):
    """Particles that gather need a wider list at a rebuild between two steps."""
    run = Simulation(case_of(PERIODIC), threads=1)
    narrow = run.model.stepper.list
    peak = int(run.model.stepper.read()[1][simulation_clock().LIST_PEAK])
    narrow.resize(peak)  # wide enough for the start alone
    run.model.stepper._bind()
    run.model.stepper.rebuild()
    run.run()
    wide = Simulation(case_of(PERIODIC, numerics__neighbour_capacity=400), threads=1).run()
    np.testing.assert_array_equal(run.state.position, wide.state.position)


def simulation_clock():
    from warpsph.kernels.core import clock

    return clock


def test_list_that_cannot_grow(tmp_path, monkeypatch):
    """Exit code 5, with the key to look at; at the start and in the middle of a run."""
    with pytest.raises(CapacityError, match="numerics.smoothing_ratio") as caught:
        Simulation(case_of(PERIODIC), threads=1).model.stepper.list.resize(32768)
    assert caught.value.exit_code == 5
    monkeypatch.setattr(neighbours, "WIDEST", 20)
    save_case(case_of(PERIODIC, numerics__neighbour_capacity=4), tmp_path / "case.yaml")
    arguments = ["run", str(tmp_path / "case.yaml"), "--output", str(tmp_path / "run"), "--threads", "1"]
    result = CliRunner().invoke(cli.app, arguments)
    assert result.exit_code == 5
    assert "numerics.smoothing_ratio" in result.stderr and "Traceback" not in result.stderr
    assert "numerics.smoothing_ratio" in (tmp_path / "run" / "log.txt").read_text()


# Writing ----------------------------------------------------------------------------------------------------


@pytest.fixture
def small_disk(tmp_path):
    """A function that mounts a disk of some kilobytes and returns its folder, where that is allowed."""
    mounted = []

    def mount(kilobytes: int) -> Path:
        folder = tmp_path / f"disk{len(mounted)}"
        folder.mkdir()
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", folder], capture_output=True)
        if done.returncode != 0:
            pytest.skip("mounting is not allowed here")
        mounted.append(folder)
        return folder

    if shutil.which("mount") is None or not hasattr(os, "geteuid") or os.geteuid() != 0:
        pytest.skip("mounting is not allowed here")
    yield mount
    for folder in mounted:
        subprocess.run(["umount", folder], check=True)


@pytest.mark.parametrize("kilobytes", [24, 72, 150, 250])
def test_full_disk(undisturbed, long_case, small_disk, tmp_path, kilobytes):
    """Whatever file is the first that does not fit. With more room the run goes on, or starts anew."""
    disk = small_disk(kilobytes)
    save_case(long_case, tmp_path / "case.yaml")
    arguments = ["run", str(tmp_path / "case.yaml"), "--output", str(disk / "run"), "--threads", "1"]
    result = CliRunner().invoke(cli.app, arguments)
    assert result.exit_code == 4, result.output
    assert "the disk is full" in result.stderr and "Traceback" not in result.stderr + result.output
    assert_whole(disk / "run")
    subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
    restart = disk / "run" if last_step(disk / "run") > 0 else None
    folder = disk / ("run" if restart else "anew")
    Simulation(long_case, output=folder, restart=restart, threads=1).run()
    assert_same_results(undisturbed, folder)


@pytest.mark.parametrize("part", ["fluid_000002.vtp", "fluid.pvd", "step_", "summary.json"])
def test_full_disk_at_a_file(tmp_path, monkeypatch, part):
    """The same without a mount, for each kind of file that is written in one piece."""
    replace = os.replace

    def refuse(source, target):
        if Path(target).name.startswith(part) and (part != "fluid.pvd" or frames.append(1) or len(frames) > 2):
            raise OSError(errno.ENOSPC, "No space left on device")
        replace(source, target)

    frames: list[int] = []
    monkeypatch.setattr(whole_files.os, "replace", refuse)
    with pytest.raises(OutputError, match="the disk is full"):
        Simulation(case_of(PERIODIC), output=tmp_path / "run", threads=1).run()
    assert_whole(tmp_path / "run")


def test_write_error_is_told_inside_a_handler(tmp_path, monkeypatch):
    """An exception that the caller is just handling must not hide that nothing was written."""

    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    changes = {"output.particles": None, "output.checkpoint": {"interval": 1.0}}
    run = Simulation(case_of(PERIODIC).replace(changes), output=tmp_path / "run", threads=1)
    monkeypatch.setattr(whole_files.os, "replace", refuse)
    try:
        raise KeyError
    except KeyError:
        with pytest.raises(OutputError, match="the disk is full"):
            run.run()
    assert run.summary["status"] == "failed"


def test_divergence_with_a_full_disk(tmp_path, monkeypatch):
    """What happened first is told, although its state cannot be written."""
    monkeypatch.setattr(simulation, "PORTION", 0.0)

    def refuse(*_):
        raise OutputError("the disk is full")

    run = Simulation(case_of(PERIODIC), output=tmp_path / "run", threads=1)
    monkeypatch.setattr(run.folder, "write_failed_state", refuse)
    with pytest.raises(DivergenceError, match="the state could not be written: the disk is full"):
        run.run(spoil(run, "velocity", 123, np.nan, 0.11))


def test_interrupt_with_a_full_disk(tmp_path, monkeypatch):
    """No checkpoint, no promise of a restart."""
    monkeypatch.setattr(simulation, "PORTION", 0.0)

    def refuse(*_):
        raise OutputError("the disk is full")

    monkeypatch.setattr(checkpoint, "save", refuse)
    run = Simulation(case_of(PERIODIC), output=tmp_path / "run", threads=1)
    with pytest.raises(OutputError, match="the disk is full"):
        run.run(lambda p: signal.raise_signal(signal.SIGINT))


def test_read_only_folder(small_disk, tmp_path):
    disk = small_disk(1000)
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    save_case(case_of(PERIODIC), tmp_path / "case.yaml")
    for folder in (disk / "run", disk):
        result = CliRunner().invoke(cli.app, ["run", str(tmp_path / "case.yaml"), "--output", str(folder)])
        assert result.exit_code == 4
        assert str(folder) in result.stderr and "ead-only" in result.stderr


def test_folder_in_use(tmp_path):
    """By a run that is going on; by files of another one."""
    first = Simulation(case_of(PERIODIC), output=tmp_path / "run", threads=1)
    names = sorted(path.name for path in tmp_path.rglob("*"))
    with pytest.raises(OutputError, match="not empty"):
        Simulation(case_of(PERIODIC), output=tmp_path / "run", threads=1)
    first.run()
    second = Simulation(case_of(PERIODIC, end_time=0.3), output=tmp_path / "run", restart=tmp_path / "run", threads=1)
    before = (tmp_path / "run" / "gauges" / "energy.csv").read_bytes()
    with pytest.raises(OutputError, match="another run is writing"):
        Simulation(case_of(PERIODIC, end_time=0.3), output=tmp_path / "run", restart=tmp_path / "run", threads=1)
    assert (tmp_path / "run" / "gauges" / "energy.csv").read_bytes() == before
    second.run()
    assert names and last_step(tmp_path / "run") > 60
