"""The picture of a 3-D run: which frames and which phase it shows, and what it refuses."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from warpsph.case.case_file import dump_yaml
from warpsph.files.vtp import write_vtp
from warpsph.snapshot import FLUID, Snapshot

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "picture_3d.py"


@pytest.fixture(scope="module")
def picture():
    spec = importlib.util.spec_from_file_location("picture_3d", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["picture_3d"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["picture_3d"]


def run_folder(folder, dimension=3, times=(0.0, 0.5, 1.0)):
    """Write a run folder: a cube of water with a few particles of gas."""
    names = "xyz"[:dimension]
    case = {
        "dimension": dimension,
        "particle_spacing": 0.25,
        "end_time": 1.0,
        "domain": {"lower": [0] * dimension, "upper": [1] * dimension, "boundary": {a: "wall" for a in names}},
        "phases": {"water": {"density": 1000}, "gas": {"density": 1}},
        "fluids": [
            {"phase": "gas", "shape": {"sphere": {"center": [0.5] * dimension, "radius": 0.3}}},
            {"phase": "water", "shape": "rest"},
        ],
    }
    (folder / "particles").mkdir(parents=True)
    (folder / "case.yaml").write_text(dump_yaml(case))
    axis = (np.arange(4) + 0.5) / 4
    x = np.stack(np.meshgrid(*[axis] * dimension), axis=-1).reshape(-1, dimension)
    n = len(x)
    phase = (np.linalg.norm(x - 0.5, axis=1) < 0.3).astype(np.int32)
    for number, time in enumerate(times):
        state = Snapshot(
            time=time, step=0, dt=0.0, dimension=dimension, position=x, velocity=np.zeros_like(x), density=np.ones(n),
            pressure=np.zeros(n), mass=np.ones(n), volume=np.full(n, 0.25**dimension), phase=phase,
            particle_id=np.arange(n), kind=np.full(n, FLUID, np.uint8), particle_spacing=0.25,
        )  # fmt: skip
        write_vtp(folder / "particles" / f"fluid_{number:06d}.vtp", state, ["velocity", "phase"])
    return folder


def test_picture_of_a_run(picture, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(picture, "read_vtp", lambda path, read=picture.read_vtp: shown.append(path.stem) or read(path))
    run = run_folder(tmp_path / "run")
    assert picture.main([str(run), "--output", str(tmp_path / "a.png")]) == 0
    assert shown == ["fluid_000000", "fluid_000002"]
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    shown.clear()
    assert picture.main([str(run), "--phase", "water", "--times", "0.6", "--output", str(tmp_path / "b.png")]) == 0
    assert shown[-1] == "fluid_000001"
    assert (tmp_path / "b.png").stat().st_size > 1000


@pytest.mark.parametrize(
    "make, options, told",
    [
        (lambda folder: folder, [], "case.yaml"),
        (lambda folder: run_folder(folder / "flat", dimension=2), [], "needs 3"),
        (lambda folder: run_folder(folder / "none", times=()), [], "no particle files"),
        (lambda folder: run_folder(folder / "oil"), ["--phase", "oil"], "needs one of water, gas"),
        (lambda folder: run_folder(folder / "late"), ["--times", "1.5"], "1.5 -> no frame of the run is near"),
    ],
)
def test_what_has_no_picture(picture, make, options, told, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        picture.main([str(make(tmp_path)), *options, "--output", str(tmp_path / "c.png")])
    assert stop.value.code == 2 and told in capsys.readouterr().err
    assert not (tmp_path / "c.png").exists()
