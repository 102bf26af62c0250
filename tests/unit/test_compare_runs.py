"""The comparison of two runs: areas of known shapes, what rupture changes, and runs that cannot be compared."""

import importlib.util
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.files.output import RunFolder
from warpsph.snapshot import FLUID, WALL, Snapshot

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "compare_runs.py"


@pytest.fixture(scope="module")
def compare_runs():
    spec = importlib.util.spec_from_file_location("compare_runs", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["compare_runs"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["compare_runs"]


def snapshot(count, time, discs, width=2.0):
    """A lattice of `count` particles a unit in a box of `width` x 2 above walls; gas in the discs (x, y, radius)."""
    dx = 1.0 / count
    x = (np.arange(round(width * count)) + 0.5) * dx
    y = (np.arange(-3, 2 * count) + 0.5) * dx
    position = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    wall = position[:, 1] < 0
    inside = np.any([np.hypot(position[:, 0] - a, position[:, 1] - b) < r for a, b, r in discs], axis=0) & ~wall
    n = len(position)
    density = np.where(inside, 1.0, 1000.0)
    return Snapshot(
        time=time, step=0, dt=0.1, dimension=2, position=position, velocity=np.zeros((n, 2)), density=density,
        pressure=np.zeros(n), mass=density * dx**2, volume=np.full(n, dx**2),
        phase=np.where(wall, -1, np.where(inside, 0, 1)).astype(np.int32), particle_id=np.arange(n),
        kind=np.where(wall, WALL, FLUID).astype(np.uint8), particle_spacing=dx,
    )  # fmt: skip


def make_run(path, count, frames, width=2.0, names=("gas", "liquid")):
    """A run folder with the frames {time: discs}."""
    case = Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": 1.0 / count,
            "end_time": 1.0,
            "domain": {"lower": [0, 0], "upper": [width, 2], "boundary": {"x": "periodic", "y": "wall"}},
            "phases": {names[0]: {"density": 1.0}, names[1]: {"density": 1000.0}},
            "fluids": [
                {"phase": names[0], "shape": {"sphere": {"center": [1, 1], "radius": 0.5}}},
                {"phase": names[1], "shape": "rest"},
            ],
        }
    )
    with RunFolder(path, case_text=json.dumps(case.to_dict())) as folder:
        for time, discs in frames.items():
            folder.write_particles(snapshot(count, time, discs, width))
    return path


ONE = [(1.0, 1.0, 0.5)]
TWO = [(0.5, 1.0, 0.3), (1.5, 1.0, 0.3)]


def test_area_of_two_discs_side_by_side(compare_runs, tmp_path):
    """Discs of radius R whose centres are d apart: pi R^2 less the lens that they share, on either side."""
    moved = [(1.1, 1.0, 0.5)]
    runs = make_run(tmp_path / "a", 40, {0.0: ONE, 1.0: ONE}), make_run(tmp_path / "b", 64, {0.0: ONE, 0.4: ONE, 1.0: moved})
    start, end = compare_runs.compare(runs)
    assert (start["time"], end["time"]) == (0.0, 1.0)  # 0.4 s is in one run alone
    half = math.acos(0.1)
    lens = 2 * 0.25 * (half - math.sin(half) * math.cos(half))
    exact = 2 * (math.pi * 0.25 - lens)
    assert end["differing"] == pytest.approx(exact, rel=0.03)
    assert end["areas"] == pytest.approx([math.pi * 0.25] * 2, rel=0.01)
    assert end["share"] == pytest.approx(exact / (math.pi * 0.25), rel=0.03)
    assert end["pieces"] == start["pieces"] == [1, 1]
    # the same disc at two resolutions: what the smoothing takes from the line
    assert start["share"] < 0.01
    (of_the_box,) = compare_runs.compare(runs, times=[1.0], relative_to="domain")
    assert of_the_box["share"] == pytest.approx(exact / 4.0, rel=0.03)
    # the other phase differs in the same places
    (liquid,) = compare_runs.compare(runs, phase="liquid", times=[1.0])
    assert liquid["differing"] == pytest.approx(end["differing"], rel=0.02)


def test_a_phase_on_a_wall_ends_there(compare_runs, tmp_path):
    """Half a disc on the floor, whose walls are in the files too, and across the periodic side."""
    runs = make_run(tmp_path / "a", 40, {0.0: [(0.0, 0.0, 0.5), (2.0, 0.0, 0.5)]}), make_run(tmp_path / "b", 40, {0.0: ONE})
    (row,) = compare_runs.compare(runs)
    assert row["areas"] == pytest.approx([math.pi / 8, math.pi / 4], rel=0.02)
    assert row["differing"] == pytest.approx(sum(row["areas"]), rel=0.1)  # they meet in no more than a corner
    series = compare_runs.plot.read_series(runs[0])
    frame = compare_runs.plot.read_frame(*series, series[0].frames[0])
    share = compare_runs.share_of(compare_runs.case_of_run(runs[0]), frame, 0)
    # walls are neither phase nor void: the gas fills the floor
    assert compare_runs.at_points(share, np.array([0.0, 1.0]), np.array([0.0])).ravel() == pytest.approx([1.0, 0.0])


def test_the_limit_is_for_the_time_before_a_rupture(compare_runs, tmp_path, capsys):
    moved = [(1.05, 1.0, 0.5)]
    runs = [
        str(make_run(tmp_path / "a", 40, {0.0: ONE, 0.5: ONE, 1.0: ONE})),
        str(make_run(tmp_path / "b", 40, {0.0: ONE, 0.5: moved, 1.0: TWO})),
    ]
    assert compare_runs.main([*runs]) == 0
    assert "ok" not in capsys.readouterr().out
    assert compare_runs.main([*runs, "--limit", "0.2"]) == 0  # 1.0 s has two pieces and is not judged
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[-1] for line in lines[1:]] == ["ok", "ok", "2"]
    assert lines[3].split()[-2:] == ["1,", "2"]
    assert compare_runs.main([*runs, "--limit", "0.05"]) == 1
    assert "MISSED" in capsys.readouterr().out
    assert compare_runs.main([*runs, "--limit", "0.05", "--until", "0.1"]) == 0
    assert compare_runs.main([*runs, "--limit", "0.2", "--until", "1.0"]) == 1
    table = tmp_path / "rows.json"
    assert compare_runs.main([*runs, "--times", "0.5", "--json", str(table)]) == 0
    (row,) = json.loads(table.read_text())["rows"]
    assert row["time"] == 0.5 and row["share"] > 0.05


def test_runs_that_cannot_be_compared(compare_runs, tmp_path, capsys):
    one = make_run(tmp_path / "a", 10, {0.0: ONE})

    def refused(*arguments):
        assert compare_runs.main([str(one), *map(str, arguments)]) == 2
        return capsys.readouterr().err

    assert "different domains" in refused(make_run(tmp_path / "wide", 10, {0.0: ONE}, width=3.0))
    assert "of the same time" in refused(make_run(tmp_path / "late", 10, {0.7: ONE}))
    assert "different phases" in refused(make_run(tmp_path / "oil", 10, {0.0: ONE}, names=("gas", "oil")))
    assert "no phase 'oil'; there are gas, liquid" in refused(one, "--phase", "oil")
    assert "at t = 0.3 s" in refused(one, "--times", 0.3)
    assert "cannot be read" in refused(tmp_path / "nowhere")
