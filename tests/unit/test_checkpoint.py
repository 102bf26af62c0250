"""Checkpoints: bit-exact round trip, damage that is noticed, and what is left when writing is interrupted."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from warpsph.errors import OutputError
from warpsph.files import checkpoint
from warpsph.files.checkpoint import CheckpointError, delete_after, latest, load, prune, save

ATTRIBUTES = {
    "time": 0.1 + 0.2,
    "step": 2**60,
    "nothing": None,
    "flag": True,
    "case": "title: Tröpfchen\n" * 10000,
    "nested": {"list": [1, 2.5, "x"], "infinite": float("inf")},
}


def make_arrays():
    random = np.random.default_rng(3)
    return {
        "position": random.normal(size=(50, 2)),
        "velocity": random.normal(size=(50, 2)).astype(np.float32),
        "phase": np.arange(50, dtype=np.int32),
        "kind": np.zeros(50, np.uint8),
        "id": np.arange(50, dtype=np.int64) + 2**50,
        "mask": np.arange(50) % 2 == 0,
        "scalar": np.array(1 / 3),
        "empty": np.zeros((0, 3)),
        "special": np.array([np.nan, np.inf, -0.0, 5e-324]),
        "strided": np.arange(20.0).reshape(4, 5)[:, ::2],
    }


def save_small(path: Path, step: int = 1) -> Path:
    save(path, {"position": np.arange(1000.0) + step}, {"step": step})
    return path


def test_round_trip_is_exact_to_the_bit(tmp_path):
    arrays = make_arrays()
    save(tmp_path / "step_1.h5", arrays, {**ATTRIBUTES, "count": np.int32(4), "dt": np.float32(0.1)})
    read, attributes = load(tmp_path / "step_1.h5")
    assert set(read) == set(arrays)
    for name, array in arrays.items():
        assert read[name].dtype == array.dtype
        assert read[name].shape == array.shape
        assert read[name].tobytes() == np.ascontiguousarray(array).tobytes()
    assert attributes == {**ATTRIBUTES, "count": 4, "dt": float(np.float32(0.1))}
    assert os.listdir(tmp_path) == ["step_1.h5"]


def test_same_state_gives_the_same_values_after_saving_again(tmp_path):
    path = save_small(tmp_path / "step_1.h5")
    save_small(path, step=2)
    arrays, attributes = load(path)
    assert attributes == {"step": 2}
    assert arrays["position"][0] == 2.0


def test_what_cannot_be_stored_is_refused(tmp_path):
    with pytest.raises(TypeError, match="'a'.*cannot hold"):
        save(tmp_path / "a.h5", {"a": np.array(["text"])}, {})
    with pytest.raises(ValueError, match="cannot be the name"):
        save(tmp_path / "a.h5", {"a/b": np.zeros(1)}, {})
    with pytest.raises(TypeError, match="cannot hold object"):
        save(tmp_path / "a.h5", {}, {"x": object()})
    assert os.listdir(tmp_path) == []


# -- damage ------------------------------------------------------------------------------------------------


def test_flipped_bits_are_noticed(tmp_path):
    path = save_small(tmp_path / "step_1.h5")
    with h5py.File(path, "r+") as file:
        file["arrays/position"][17] = 0.0
    with pytest.raises(CheckpointError, match="is damaged: the checksum of 'position'"):
        load(path)
    path = save_small(tmp_path / "step_2.h5")
    with h5py.File(path, "r+") as file:
        file["attributes"][0] += 1
    with pytest.raises(CheckpointError, match="is damaged: the checksum of its attributes"):
        load(path)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.95])
def test_cut_file_is_an_error(tmp_path, share):
    path = save_small(tmp_path / "step_1.h5")
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(CheckpointError, match="step_1.h5: cannot be read as a checkpoint"):
        load(path)


def test_other_files_and_versions_are_named(tmp_path):
    with pytest.raises(CheckpointError, match="there is no such checkpoint"):
        load(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(CheckpointError, match="cannot be read as a checkpoint"):
        load(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(CheckpointError, match="is not a checkpoint of warpsph"):
        load(tmp_path / "other.h5")
    path = save_small(tmp_path / "step_1.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["version"] = checkpoint.VERSION + 1
    with pytest.raises(CheckpointError, match="has checkpoint format 2, this warpsph reads 1; use a newer"):
        load(path)
    assert issubclass(CheckpointError, OutputError)


# -- the newest, and how many ------------------------------------------------------------------------------


def test_latest_skips_broken_ones_and_says_so(tmp_path):
    assert latest(tmp_path) is None
    assert latest(tmp_path / "no folder") is None
    for step in (9, 10, 200):
        save_small(tmp_path / f"step_{step}.h5", step)
    (tmp_path / "step_300.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    (tmp_path / ".step_400.h5.partial").write_bytes(b"")
    messages = []
    assert latest(tmp_path, messages.append) == tmp_path / "step_200.h5"
    assert len(messages) == 1
    assert "step_300.h5: cannot be read" in messages[0]
    with pytest.warns(UserWarning, match="step_300"):
        assert latest(tmp_path) == tmp_path / "step_200.h5"


def test_prune_and_delete_after(tmp_path):
    for step in (1, 9, 10, 200):
        save_small(tmp_path / f"step_{step}.h5", step)
    save_small(tmp_path / "mine.h5")
    assert prune(tmp_path, 2) == [tmp_path / "step_1.h5", tmp_path / "step_9.h5"]
    assert prune(tmp_path, 2) == []
    assert delete_after(tmp_path, 10) == [tmp_path / "step_200.h5"]
    save_small(tmp_path / "step_11.h5", 11)
    assert prune(tmp_path, 0) == [tmp_path / "step_10.h5"]  # the last one stays
    assert sorted(os.listdir(tmp_path)) == ["mine.h5", "step_11.h5"]


# -- interrupted writing -----------------------------------------------------------------------------------


@pytest.mark.parametrize("function", ["fsync", "replace"])
def test_failure_while_writing_keeps_the_old_file(tmp_path, monkeypatch, function):
    path = save_small(tmp_path / "step_1.h5")
    before = path.read_bytes()

    def fail(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, function, fail)
    with pytest.raises(OutputError, match="step_1.h5: the disk is full"):
        save_small(path, step=2)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["step_1.h5"]


def test_too_little_space_is_seen_before_writing(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 1000}))
    with pytest.raises(OutputError, match=r"the disk is full: 0.0 MB needed, 0.0 MB free; .*keep"):
        save_small(tmp_path / "step_1.h5")
    assert os.listdir(tmp_path) == []
    monkeypatch.undo()
    with pytest.raises(OutputError, match="step_1.h5: cannot be written"):
        save_small(tmp_path / "no folder" / "step_1.h5")


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit on the size of files")
def test_hdf5_error_in_the_middle_of_a_file(tmp_path):
    """The kernel stops the file at 64 kB; the process must still be able to end in order."""
    code = f"""
import resource, signal, sys
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
from pathlib import Path
import numpy as np
from warpsph.files.checkpoint import save
from warpsph.errors import OutputError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (65536, 65536))
try:
    save(Path({str(tmp_path)!r}) / "step_1.h5", {{"a": np.zeros(100000), "b": np.ones(100000)}}, {{}})
except OutputError as error:
    print("refused:", error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.startswith("refused:"), done.stderr
    assert "step_1.h5: cannot be written" in done.stdout
    assert os.listdir(tmp_path) == []
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_kill_while_writing_leaves_whole_checkpoints(tmp_path):
    """A process that does nothing but write checkpoints is killed; what has its final name must be whole."""
    code = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
from pathlib import Path
import numpy as np
from warpsph.files.checkpoint import prune, save
for step in range(10000):
    save(Path({str(tmp_path)!r}) / f"step_{{step}}.h5", {{"a": np.full(300000, step)}}, {{"step": step}})
    prune(Path({str(tmp_path)!r}), 2)
    print(step, flush=True)
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for _ in range(3):
        last = int(process.stdout.readline())
    time.sleep(0.013)
    process.send_signal(signal.SIGKILL)
    last = int((process.stdout.read().split() or [last])[-1])
    process.wait()
    process.stdout.close()
    paths = sorted(tmp_path.glob("*.h5"))
    assert 1 <= len(paths) <= 3
    for path in paths:
        arrays, attributes = load(path)
        assert (arrays["a"] == attributes["step"]).all()
    newest = latest(tmp_path, pytest.fail)
    assert newest is not None
    assert load(newest)[1]["step"] >= last
