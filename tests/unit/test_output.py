"""The run folder: particle files as PyVista reads them, series, refusals, full disks, the writing thread."""

import errno
import json
import math
import os
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as xml
from pathlib import Path

import numpy as np
import pytest

from warpsph.errors import OutputError
from warpsph.files import vtp
from warpsph.files.output import RunFolder, Schedule, Writer, last_particles
from warpsph.files.vtp import PARTICLE_FIELDS, read_vtp, write_vtp
from warpsph.snapshot import FLUID, WALL, Snapshot


def make_snapshot(dimension: int = 2, fluid: int = 7, walls: int = 0, at: float = 0.0, **changes) -> Snapshot:
    """Random particles; the last `walls` of them are walls."""
    n = fluid + walls
    random = np.random.default_rng(n + dimension)
    values = dict(
        time=at,
        step=int(at * 100),
        dt=0.01,
        dimension=dimension,
        position=random.uniform(-1, 1, (n, dimension)),
        velocity=random.uniform(-1, 1, (n, dimension)),
        density=random.uniform(900, 1100, n),
        pressure=random.uniform(-10, 10, n),
        mass=random.uniform(1, 2, n),
        volume=random.uniform(1, 2, n),
        phase=np.where(np.arange(n) < fluid, np.arange(n) % 2, -1).astype(np.int32),
        particle_id=np.arange(n, dtype=np.int64) + 2**40,
        kind=np.where(np.arange(n) < fluid, FLUID, WALL).astype(np.uint8),
        particle_spacing=0.125,
    )
    return Snapshot(**{**values, **changes})


# -- snapshot ----------------------------------------------------------------------------------------------


def test_snapshot_splits_into_fluid_and_wall():
    whole = make_snapshot(fluid=5, walls=3, normal=np.ones((8, 2)), extra={"interface_length": 2.0})
    assert (len(whole), len(whole.fluid), len(whole.wall)) == (8, 5, 3)
    np.testing.assert_array_equal(whole.wall.position, whole.position[5:])
    assert whole.fluid.normal.shape == (5, 2)
    assert whole.fluid.curvature is None
    assert whole.fluid.extra == {"interface_length": 2.0}
    assert whole.fluid.time == whole.time


# -- particle files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("precision", "real"), [("float32", np.float32), ("float64", np.float64)])
def test_vtp_is_read_back_by_pyvista(tmp_path, dimension, precision, real, compress):
    pyvista = pytest.importorskip("pyvista")
    n = 7
    particles = make_snapshot(
        dimension,
        n,
        at=0.3,
        normal=np.random.default_rng(1).normal(size=(n, dimension)),
        curvature=np.arange(n) * 0.1,
        acceleration=np.ones((n, dimension)),
        vorticity=np.arange(float(n)) if dimension == 2 else np.arange(3.0 * n).reshape(n, 3),
        q_criterion=-np.arange(float(n)),
        ftle_backward=np.arange(n) * 0.2,
        ftle_forward=np.arange(n) * 0.3,
        ftle_age=np.full(n, 0.4),
        ftle_way=np.full((n, dimension), 0.5),
    )
    path = tmp_path / "fluid_000000.vtp"
    size = write_vtp(path, particles, PARTICLE_FIELDS, precision, compress)
    assert path.stat().st_size == size
    mesh = pyvista.read(path)
    assert mesh.n_points == mesh.n_verts == n
    np.testing.assert_array_equal(mesh.verts.reshape(-1, 2), [[1, k] for k in range(n)])
    assert mesh.points.dtype == real
    np.testing.assert_array_equal(mesh.points[:, :dimension], particles.position.astype(real))
    assert not mesh.points[:, dimension:].any()
    for name in PARTICLE_FIELDS:
        values = mesh.point_data[name]
        expected = getattr(particles, name)
        if expected.ndim == 2:
            assert values.shape == (n, 3)
            assert not values[:, dimension:].any()
            values = values[:, :dimension]
        assert values.dtype == (np.int32 if name == "phase" else real)
        np.testing.assert_array_equal(values, expected.astype(values.dtype))
    np.testing.assert_array_equal(mesh.point_data["particle_id"], particles.particle_id)
    np.testing.assert_array_equal(mesh.point_data["particle_spacing"], np.full(n, 0.125))
    assert mesh.field_data["TimeValue"][0] == 0.3


@pytest.mark.parametrize("count", [0, 1, 300, 512, 1000])
def test_compressed_files_of_any_number_of_blocks(tmp_path, monkeypatch, count):
    """A block of 4096 bytes holds 512 particle ids: one that is cut, one that is full, several."""
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setattr(vtp, "_BLOCK", 4096)
    particles = make_snapshot(fluid=count, at=0.7)
    plain, small = tmp_path / "fluid_000000.vtp", tmp_path / "fluid_000001.vtp"
    size = write_vtp(plain, particles)
    assert write_vtp(small, particles, compress=True) == small.stat().st_size
    if count == 1000:
        assert small.stat().st_size < 0.6 * size
    mesh = pyvista.read(small)
    assert mesh.n_points == count and mesh.field_data["TimeValue"][0] == 0.7
    one, other = read_vtp(plain, 2), read_vtp(small, 2)
    assert one.time == other.time == 0.7
    for name in ("position", "velocity", "density", "pressure", "mass", "phase", "particle_id"):
        np.testing.assert_array_equal(getattr(other, name), getattr(one, name))
    if count:
        np.testing.assert_array_equal(mesh.point_data["particle_id"], other.particle_id)
        np.testing.assert_array_equal(mesh.points[:, :2], other.position.astype(np.float32))


def test_frames_are_compressed_on_request(tmp_path):
    with RunFolder(tmp_path / "run", compress=True) as folder:
        folder.write_particles(make_snapshot(fluid=100))
        path = folder.particles / "fluid_000000.vtp"
        assert b"vtkZLibDataCompressor" in path.read_bytes()
        assert len(last_particles(folder.path, 2)) == 100


def test_vtp_holds_the_chosen_fields_and_no_particles_is_fine(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    write_vtp(tmp_path / "a.vtp", make_snapshot(), ["pressure", "curvature", "particle_id"])
    assert set(pyvista.read(tmp_path / "a.vtp").point_data) == {"pressure", "particle_spacing", "particle_id"}
    write_vtp(tmp_path / "b.vtp", make_snapshot(fluid=0))
    assert pyvista.read(tmp_path / "b.vtp").n_points == 0
    with pytest.raises(ValueError, match="unknown particle field 'speed'"):
        write_vtp(tmp_path / "c.vtp", make_snapshot(), ["speed"])
    with pytest.raises(ValueError, match="precision"):
        write_vtp(tmp_path / "c.vtp", make_snapshot(), precision="double")


def test_own_reader_gives_back_what_was_written(tmp_path):
    particles = make_snapshot(at=1 / 3, curvature=np.arange(7.0))
    write_vtp(tmp_path / "fluid_000001.vtp", particles, PARTICLE_FIELDS, "float64")
    read = read_vtp(tmp_path / "fluid_000001.vtp", 2)
    assert read.time == particles.time
    assert read.particle_spacing == 0.125
    for name in ("position", "velocity", "density", "pressure", "mass", "volume", "phase", "particle_id"):
        np.testing.assert_array_equal(getattr(read, name), getattr(particles, name))
    np.testing.assert_array_equal(read.curvature, particles.curvature)
    assert read.normal is None
    assert len(read.fluid) == 7
    write_vtp(tmp_path / "wall_000000.vtp", particles, ["velocity", "mass", "density"])
    wall = read_vtp(tmp_path / "wall_000000.vtp")
    assert len(wall.wall) == 7
    assert wall.velocity.shape == (7, 3)
    assert np.isnan(wall.pressure).all()
    np.testing.assert_allclose(wall.volume, particles.mass / particles.density, rtol=1e-6)


@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.999])
def test_own_reader_refuses_a_cut_file(tmp_path, share, compress):
    path = tmp_path / "fluid_000000.vtp"
    write_vtp(path, make_snapshot(fluid=100), compress=compress)
    content = path.read_bytes()
    # The last array is the Verts' offsets, followed by 32 bytes of XML that nobody misses.
    path.write_bytes(content[: int((len(content) - 32) * share)])
    with pytest.raises(OutputError, match="cannot be read as a particle file"):
        read_vtp(path)


def test_series_is_read_by_pyvista_after_every_frame(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    with RunFolder(tmp_path / "run") as folder:
        for k, moment in enumerate([0.0, 0.1, 0.2]):
            folder.write_particles(make_snapshot(at=moment, walls=4, pressure=np.full(11, moment)))
            reader = pyvista.get_reader(folder.particles / "fluid.pvd")
            assert reader.time_values == [0.0, 0.1, 0.2][: k + 1]
            reader.set_active_time_value(moment)
            np.testing.assert_array_equal(reader.read()[0].point_data["pressure"], np.float32(moment))
        assert pyvista.get_reader(folder.particles / "wall.pvd").time_values == [0.0]
        names = sorted(path.name for path in folder.particles.iterdir())
    frames = [f"fluid_00000{k}.vtp" for k in range(3)]
    assert names == ["fluid.pvd", *frames, "wall.pvd", "wall_000000.vtp"]


def test_walls_are_written_again_only_when_they_have_moved(tmp_path):
    with RunFolder(tmp_path / "run") as folder:
        first = make_snapshot(walls=4)
        folder.write_particles(first)
        folder.write_particles(make_snapshot(walls=4, at=1.0))
        folder.write_particles(make_snapshot(walls=4, at=2.0, position=first.position + 0.1))
        folder.write_particles(make_snapshot(walls=4, at=3.0, position=first.position + 0.1))
        assert [time for time, _ in folder.series["wall"].frames] == [0.0, 2.0]
        assert [time for time, _ in folder.series["fluid"].frames] == [0.0, 1.0, 2.0, 3.0]


def test_fields_that_a_scene_lacks_are_named_once_in_the_log(tmp_path):
    with RunFolder(tmp_path / "run", fields=["pressure", "normal"]) as folder:
        folder.write_particles(make_snapshot())
        folder.write_particles(make_snapshot(at=1.0))
    assert folder.log_path.read_text().count("'normal'") == 1


def test_failed_state_keeps_nan_and_stays_out_of_the_series(tmp_path):
    with RunFolder(tmp_path / "run") as folder:
        folder.write_particles(make_snapshot())
        bad = make_snapshot(at=1.0, pressure=np.full(7, np.nan), density=np.full(7, 1e300))
        path = folder.write_failed_state(bad)
        folder.write_particles(bad)  # 1e300 is more than float32 holds
    assert np.isnan(read_vtp(path).pressure).all()
    assert read_vtp(path).density[0] == 1e300
    assert len(folder.series["fluid"].frames) == 2


# -- the folder --------------------------------------------------------------------------------------------


def test_layout_and_case_text(tmp_path):
    with RunFolder(tmp_path / "a" / "run", case_text="dimension: 2\n") as folder:
        folder.log("first line")
    assert sorted(path.name for path in folder.path.iterdir()) == [
        "case.yaml",
        "checkpoint",
        "gauges",
        "log.txt",
        "particles",
    ]
    assert folder.case_path.read_text() == "dimension: 2\n"
    assert folder.log_path.read_text() == "first line\n"
    assert folder.checkpoint_path(12).name == "step_000000012.h5"
    assert folder.gauge_path("jump") == folder.gauges / "jump.csv"


def test_used_folder_is_refused_and_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(OutputError, match="not empty.*--restart"):
        RunFolder(tmp_path, case_text="x")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
    for resume in (False, True):
        with pytest.raises(OutputError, match="is a file"):
            RunFolder(tmp_path / "thesis.tex", resume=resume)
    (tmp_path / "empty").mkdir()
    RunFolder(tmp_path / "empty").close()


def test_folder_in_use_is_refused_even_with_resume(tmp_path):
    pytest.importorskip("fcntl")
    folder = RunFolder(tmp_path / "run")
    with pytest.raises(OutputError, match="another run is writing"):
        RunFolder(tmp_path / "run", resume=True)
    folder.close()
    RunFolder(tmp_path / "run", resume=True).close()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="cannot be written: Permission denied"):
        RunFolder(tmp_path / "run")


def test_folder_below_a_file_is_an_output_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        RunFolder(tmp_path / "file" / "run")


def test_resume_drops_later_frames_and_goes_on(tmp_path):
    with RunFolder(tmp_path / "run") as folder:
        for moment in (0.0, 0.1, 0.2, 0.3):
            folder.write_particles(make_snapshot(at=moment, walls=2))
        (folder.particles / ".fluid_000004.vtp.partial").write_text("killed while it was written")
    with RunFolder(tmp_path / "run", resume=True) as folder:
        folder.cut_after(0.1 + 1e-14)
        assert [time for time, _ in folder.series["fluid"].frames] == [0.0, 0.1]
        assert sorted(path.name for path in folder.particles.glob("*fluid*")) == [
            "fluid.pvd",
            "fluid_000000.vtp",
            "fluid_000001.vtp",
        ]
        again = make_snapshot(at=0.1, walls=2, pressure=np.full(9, 5.0))
        folder.write_particles(again)  # replaces the frame of the same time
        folder.write_particles(make_snapshot(at=0.2, walls=2))
    frames = folder.series["fluid"].frames
    assert frames == [(0.0, "fluid_000000.vtp"), (0.1, "fluid_000001.vtp"), (0.2, "fluid_000002.vtp")]
    assert (read_vtp(folder.particles / "fluid_000001.vtp").pressure == 5.0).all()
    assert last_particles(folder.path, 2).time == 0.2


def test_last_particles_needs_a_frame(tmp_path):
    with RunFolder(tmp_path / "run"):
        pass
    with pytest.raises(OutputError, match="no particles were written"):
        last_particles(tmp_path / "run", 2)


def test_summary_is_plain_json(tmp_path):
    with RunFolder(tmp_path / "run") as folder:
        folder.write_summary(
            {
                "steps": np.int64(3),
                "error": math.nan,
                "jump": np.float32(0.5),
                "list": (1, np.array([1.0, np.inf])),
                "path": Path("a"),
                "nested": {1: True, "none": None},
            }
        )
    expected = {
        "steps": 3,
        "error": None,
        "jump": 0.5,
        "list": [1, [1.0, None]],
        "path": "a",
        "nested": {"1": True, "none": None},
    }
    assert json.loads(folder.summary_path.read_text()) == expected
    assert folder.read_summary() == expected
    folder.summary_path.write_text("{")
    with pytest.raises(OutputError, match="summary.json: cannot be read"):
        folder.read_summary()


# -- full disks --------------------------------------------------------------------------------------------


class FullDisk:
    """Stands for `open`: a file that takes `room` bytes and no more."""

    def __init__(self, room: int) -> None:
        self.room = room

    def __call__(self, path, mode="r", *arguments, **keywords):
        file = open(path, mode, *arguments, **keywords)
        if "w" not in mode:
            return file
        real, disk = file.write, self

        class Limited:
            def __enter__(self):
                return self

            def __exit__(self, *exception):
                file.close()

            def write(self, data):
                size = memoryview(data).nbytes
                if size > disk.room:
                    real(memoryview(data).cast("B")[: disk.room])
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                disk.room -= size
                return real(data)

        return Limited()


@pytest.mark.parametrize("room", [0, 100, 3000])
def test_full_disk_leaves_the_old_file_and_no_half_one(tmp_path, monkeypatch, room):
    path = tmp_path / "fluid_000000.vtp"
    write_vtp(path, make_snapshot(fluid=3))
    before = path.read_bytes()
    monkeypatch.setattr(vtp, "open", FullDisk(room), raising=False)
    with pytest.raises(OutputError, match=r"fluid_000000.vtp: the disk is full, 0.\d MB needed"):
        write_vtp(path, make_snapshot(fluid=1000))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["fluid_000000.vtp"]


def test_full_disk_does_not_spoil_series(tmp_path, monkeypatch):
    with RunFolder(tmp_path / "run") as folder:
        folder.write_particles(make_snapshot())
        monkeypatch.setattr(vtp, "open", FullDisk(100), raising=False)
        with pytest.raises(OutputError, match="disk is full"):
            folder.write_particles(make_snapshot(at=1.0))
        monkeypatch.undo()
        frames = xml.parse(folder.particles / "fluid.pvd").findall("Collection/DataSet")
        assert [frame.get("file") for frame in frames] == ["fluid_000000.vtp"]
        folder.write_particles(make_snapshot(at=1.0))
        assert [name for _, name in folder.series["fluid"].frames] == ["fluid_000000.vtp", "fluid_000001.vtp"]


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit on the size of files")
def test_file_that_the_system_refuses_to_grow(tmp_path):
    """The real thing, not a stand-in: the kernel stops the file at 64 kB."""
    code = f"""
import resource, signal, sys
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
from test_output import make_snapshot
from warpsph.errors import OutputError
from warpsph.files.vtp import write_vtp
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (65536, 65536))
try:
    write_vtp(Path({str(tmp_path)!r}) / "a.vtp", make_snapshot(fluid=10000))
except OutputError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert "a.vtp: cannot be written: File too large" in done.stdout, done.stderr
    assert os.listdir(tmp_path) == []


# -- the writer --------------------------------------------------------------------------------------------


def test_writer_overlaps_and_drains():
    gate, started, done = threading.Event(), threading.Event(), []

    def slow(payload):
        started.set()
        gate.wait(10)
        done.append(payload)

    with Writer({"slow": slow}) as writer:
        for k in range(3):  # one in work and two waiting
            writer.put("slow", k)
            started.wait(10)
        assert done == []  # the caller went on while the first job was not done
        blocked = threading.Thread(target=writer.put, args=("slow", 3))
        blocked.start()
        blocked.join(0.05)
        assert blocked.is_alive()  # the queue is bounded
        gate.set()
        blocked.join(10)
        writer.flush()
        assert done == [0, 1, 2, 3]
        writer.put("slow", 4)
    assert done == [0, 1, 2, 3, 4]
    with pytest.raises(RuntimeError, match="closed"):
        writer.put("slow", 5)


def test_writer_reports_the_error_and_drops_what_follows():
    done, gate = [], threading.Event()

    def work(payload):
        if payload == "bad":
            gate.wait(10)
            raise OutputError("the disk is full")
        done.append(payload)

    writer = Writer({"work": work})
    writer.put("work", "good")
    writer.put("work", "bad")
    writer.put("work", "waits behind it")
    gate.set()
    with pytest.raises(OutputError, match="the disk is full"):
        for _ in range(200):
            time.sleep(0.005)
            writer.put("work", "later")
    with pytest.raises(OutputError):
        writer.flush()
    writer.close()  # has been reported
    assert done == ["good"]


def test_writer_error_in_the_last_job_comes_with_close():
    writer = Writer({"work": lambda _: 1 / 0})
    writer.put("work", None)
    with pytest.raises(ZeroDivisionError):
        writer.close()
    writer.close()


def test_writer_does_not_hide_the_error_of_the_run():
    with pytest.raises(KeyError, match="the run") as caught:
        with Writer({"work": lambda _: 1 / 0}) as writer:
            writer.put("work", None)
            raise KeyError("the run")
    assert "division by zero" in caught.value.__notes__[0]
    with Writer({}) as writer, pytest.raises(KeyError, match="no handler"):
        writer.put("unknown", None)


# -- schedules ---------------------------------------------------------------------------------------------


def test_schedule_of_an_interval_does_not_drift():
    schedule, moments, now = Schedule(0.1), [], 0.0
    while now < 20:
        if schedule.due(now):
            moments.append(now)
            schedule.advance(now)
        now += 0.01  # the rounding of 2000 additions is far larger than one ulp
    np.testing.assert_allclose(moments, np.arange(200) * 0.1, atol=1e-10)


def test_schedule_of_times_and_none():
    schedule = Schedule(times=[0.5, 0.1])
    assert schedule.next == 0.1
    assert not schedule.due(0.0999)
    assert schedule.due(0.1 * (1 - 1e-12))
    schedule.advance(0.3)
    assert schedule.next == 0.5
    schedule.advance(7.0)
    assert schedule.next == math.inf
    assert not schedule.due(1e9)
    assert Schedule().next == math.inf
    assert Schedule(0.1).due(0.0)
    for wrong in (dict(interval=0.0), dict(interval=-1.0), dict(interval=1.0, times=[1])):
        with pytest.raises(ValueError):
            Schedule(**wrong)


def test_schedule_jumps_over_a_long_time_at_once():
    schedule = Schedule(1e-9)
    schedule.advance(1.0)
    assert 1.0 < schedule.next <= 1.0 + 2.1e-9
