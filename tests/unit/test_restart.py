"""A restart continues bit by bit; a run repeats itself bit by bit, whatever the number of threads."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.scenes import FULL, PERIODIC, case_of
from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.engine import launch
from warpsph.errors import CaseError, OutputError
from warpsph.files import checkpoint
from warpsph.kernels.core import clock as ck
from warpsph.running.model import Model

SCENES = {"periodic": PERIODIC, "full": FULL}


@pytest.fixture(
    scope="module", params=["periodic-float32", "periodic-float64", "full-float32", "full-float64"]
)
def scene(request):
    name, precision = request.param.split("-")
    return case_of(SCENES[name], precision=precision)


@pytest.fixture(scope="module", params=[1, 2], ids=["1 thread", "2 threads"])
def threads(request):
    return request.param


@pytest.fixture(scope="module")
def whole(scene, threads, tmp_path_factory):
    """Run folder of the run that nothing interrupts."""
    folder = tmp_path_factory.mktemp("whole")
    Simulation(scene, output=folder / "run", threads=threads).run()
    return folder / "run"


def checkpoints(run: Path) -> list[Path]:
    return sorted((run / "checkpoint").glob("*.h5"))


def assert_same_files(one: Path, other: Path, parts=("particles", "gauges")) -> None:
    for part in parts:
        names = sorted(path.name for path in (one / part).iterdir())
        assert names == sorted(path.name for path in (other / part).iterdir())
        for name in names:
            assert (one / part / name).read_bytes() == (other / part / name).read_bytes(), name


def assert_same_state(one: Path, other: Path) -> None:
    """Two checkpoints hold the same bits: fields, clock and counters."""
    a, attributes = checkpoint.load(one)
    b, others = checkpoint.load(other)
    assert attributes["time"] == others["time"] and attributes["step"] == others["step"]
    assert_same_arrays(a, b)


def assert_same_arrays(a, b) -> None:
    assert a.keys() == b.keys() and len(a) > 10
    for name in a.keys() - {"clock", "counters"}:
        assert a[name].tobytes() == b[name].tobytes(), name
    # of clock and counters, what does not tell how the run was cut into portions
    numbers = [index for index in range(ck.CLOCK_SIZE) if index != ck.TARGET]
    np.testing.assert_array_equal(a["clock"][numbers], b["clock"][numbers])
    for counter in (ck.STEPS, ck.REBUILDS, ck.STEPS_SINCE_RARE, ck.BAND_COUNT):
        assert a["counters"][counter] == b["counters"][counter], counter


def clocks(run: Path) -> np.ndarray:
    return np.array([checkpoint.load(path)[0]["clock"] for path in checkpoints(run)])


def test_scenes_use_the_list_between_rebuilds(whole):
    """A restart has something to get wrong: checkpoints fall between two list builds."""
    summary = json.loads((whole / "summary.json").read_text())
    assert 2 < summary["list_rebuilds"] < 0.8 * summary["steps"]
    assert clocks(whole)[:, ck.OFFSET].max() > 0
    if summary["title"] == "vortices":
        assert np.count_nonzero(clocks(whole)[:-1, ck.EXCESS_PRESSURE])


@pytest.mark.parametrize("which", ["early", "late", "pressed"])
def test_continues_in_its_folder_bit_by_bit(scene, threads, whole, tmp_path, which):
    """Also where the volume constraint has just asked for a pressure."""
    run = tmp_path / "run"
    shutil.copytree(whole, run)
    pressed = int(np.flatnonzero(np.append(clocks(run)[:-1, ck.EXCESS_PRESSURE], 1))[0])
    start = checkpoints(run)[{"early": 0, "late": -3, "pressed": min(pressed, 4)}[which]]
    simulation = Simulation(scene, output=run, restart=start, threads=threads)
    assert_same_arrays(checkpoint.load(start)[0], simulation.model.save_state())
    assert checkpoints(run)[-1] == start  # later ones belong to the future that is computed again
    assert simulation.gauge(next(iter(scene.gauges)))["time"][-1] <= simulation.model.time * (1 + 1e-9)
    simulation.run()
    assert_same_files(whole, run)
    assert [path.name for path in checkpoints(whole)] == [path.name for path in checkpoints(run)]
    assert_same_state(checkpoints(whole)[-1], checkpoints(run)[-1])


def test_end_time_beyond_the_old_end(scene, threads, whole, tmp_path):
    """The shorter run stops at an output of the longer one, and so takes the same steps."""
    run = tmp_path / "run"
    Simulation(scene.replace({"end_time": scene.end_time / 2}), output=run, threads=threads).run()
    short = json.loads((run / "summary.json").read_text())
    simulation = Simulation(scene, output=run, restart=run, threads=threads).run()
    assert_same_files(whole, run)
    assert_same_state(checkpoints(whole)[-1], checkpoints(run)[-1])
    assert simulation.summary["restarted_from"] == {"time": scene.end_time / 2, "step": short["steps"]}
    assert simulation.summary["steps"] == json.loads((whole / "summary.json").read_text())["steps"]


def test_repeats_itself_whatever_the_threads(scene, whole, tmp_path, monkeypatch):
    """Also where the parts of the threads are smaller than a run would make them."""
    monkeypatch.setattr(launch, "SMALLEST_SHARE", 8)
    for threads in (1, 2, 3):
        Simulation(scene, output=tmp_path / str(threads), threads=threads).run()
        assert_same_files(whole, tmp_path / str(threads))
        for one, other in zip(checkpoints(whole), checkpoints(tmp_path / str(threads)), strict=True):
            assert_same_state(one, other)


# The rest is about files, and needs one scene only.


@pytest.fixture(scope="module")
def drop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drop") / "run"
    Simulation(case_of(FULL), output=folder, threads=1).run()
    return folder


def test_into_a_new_folder(drop, tmp_path):
    """It starts at the checkpoint, with all that is due there, and leaves the old folder alone."""
    before = {path: path.stat().st_mtime_ns for path in drop.rglob("*")}
    start = checkpoints(drop)[3]  # at 0.2 s
    Simulation(case_of(FULL), output=tmp_path / "new", restart=start, threads=1).run()
    assert {path: path.stat().st_mtime_ns for path in drop.rglob("*")} == before
    moment = checkpoint.load(start)[1]["time"]
    for old in (drop / "gauges").iterdir():
        heading, *rows = old.read_text().splitlines()
        late = [row for row in rows if float(row.split(",")[0]) >= moment * (1 - 1e-9)]
        assert (tmp_path / "new" / "gauges" / old.name).read_text().splitlines() == [heading, *late], old.name
    frames = sorted((drop / "particles").glob("fluid_*.vtp"))
    new = sorted((tmp_path / "new" / "particles").glob("fluid_*.vtp"))
    assert [path.read_bytes() for path in frames[2:]] == [path.read_bytes() for path in new]
    assert_same_state(checkpoints(drop)[-1], checkpoints(tmp_path / "new")[-1])


def test_into_a_new_folder_between_two_rows_of_a_gauge(drop, tmp_path):
    """What a gauge was due to measure before the checkpoint is past; the device measures nothing for it then."""
    at = {"gauge": "interface", "column": "interface_length", "value": 2.0}
    references = {"end": {**at, "reduce": "final"}, "all": {**at, "reduce": "mean"}}
    case = case_of(FULL, gauges__interface__interval=0.06, gauges__load__interval=0.07, reference=references)
    first = checkpoints(drop)[0]
    for folder in (tmp_path / "new", None):
        simulation = Simulation(case, output=folder, restart=first, threads=1).run()
        assert simulation.summary["status"] == "finished"
        assert simulation.gauge("interface")["time"] == pytest.approx([0.06, 0.12, 0.18, 0.24, 0.3, 0.36])
        assert simulation.gauge("load")["time"] == pytest.approx([0.07, 0.14, 0.21, 0.28, 0.35])
        assert simulation.gauge("jump")["time"][0] == pytest.approx(0.06)
        errors = simulation.summary["errors"]
        assert errors["end"]["error"] is not None
        assert errors["all"]["error"] is None and "goes on from a checkpoint" in errors["all"]["note"]
    assert len(list((tmp_path / "new" / "particles").glob("fluid_*.vtp"))) == 4


def test_never_cuts_a_folder_of_another_run(drop, tmp_path):
    other = tmp_path / "other"
    Simulation(case_of(FULL, end_time=0.1), output=other, threads=1).run()
    before = {path: path.stat().st_mtime_ns for path in other.rglob("*")}
    with pytest.raises(OutputError, match="not empty"):
        Simulation(case_of(FULL), output=other, restart=checkpoints(drop)[0], threads=1)
    assert {path: path.stat().st_mtime_ns for path in other.rglob("*")} == before


def test_nothing_is_cut_if_the_restart_fails(drop, tmp_path):
    """A gauge whose columns changed is refused before frames and checkpoints of the future are dropped."""
    run = tmp_path / "run"
    shutil.copytree(drop, run)
    changed = case_of(FULL, gauges__shape={"type": "energy", "interval": 0.02})
    with pytest.raises(OutputError, match="columns"):
        Simulation(changed, output=run, restart=checkpoints(run)[0], threads=1)
    assert [path.name for path in checkpoints(run)] == [path.name for path in checkpoints(drop)]
    assert_same_files(drop, run)
    assert (run / "case.yaml").read_bytes() == (drop / "case.yaml").read_bytes()
    # the folder is free again
    Simulation(case_of(FULL), output=run, restart=checkpoints(run)[0], threads=1).close()


def test_in_memory_alone(drop):
    simulation = Simulation(case_of(FULL), restart=drop, threads=1)
    np.testing.assert_array_equal(
        simulation.state.position, Simulation(case_of(FULL), restart=drop).state.position
    )
    assert simulation.run().summary["status"] == "finished"


@pytest.mark.parametrize("end", [0.4, 0.25, 0.01])
def test_of_a_finished_run_changes_nothing(drop, tmp_path, end):
    """Nothing is left to do: it is refused, and nobody touches the folder."""
    before = {path: path.stat().st_mtime_ns for path in [drop, *drop.rglob("*")]}
    for output in (drop, tmp_path / "new"):
        with pytest.raises(CaseError, match="nothing left to compute.*later end_time") as caught:
            Simulation(case_of(FULL, end_time=end), output=output, restart=drop, threads=1)
        assert caught.value.problems[0].path == "end_time"
    assert {path: path.stat().st_mtime_ns for path in [drop, *drop.rglob("*")]} == before
    assert not (tmp_path / "new").exists()


def test_of_a_run_that_was_killed_before_its_summary(drop, tmp_path):
    """The last checkpoint is there, the comparison is not: it is made up for."""
    run = tmp_path / "run"
    shutil.copytree(drop, run)
    (run / "summary.json").unlink()
    Simulation(case_of(FULL), output=run, restart=run, threads=1).run()
    assert_same_files(drop, run)
    assert_same_state(checkpoints(drop)[-1], checkpoints(run)[-1])
    assert json.loads((run / "summary.json").read_text())["status"] == "finished"


@pytest.mark.parametrize("shorter", [0.25, 0.01], ids=["behind the end", "before the checkpoint"])
def test_end_time_before_the_checkpoint(drop, tmp_path, shorter):
    """In memory alone: nothing is left to do; the run ends at once."""
    simulation = Simulation(case_of(FULL, end_time=shorter), restart=drop, threads=1).run()
    assert simulation.model.time == pytest.approx(0.4)


def test_broken_checkpoint_is_skipped_and_said(drop, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(drop, run)
    newest, before = checkpoints(run)[-1], checkpoints(run)[-2]
    newest.write_bytes(newest.read_bytes()[:5000])
    simulation = Simulation(case_of(FULL), output=run, restart=run, threads=1)
    assert simulation.model.time == checkpoint.load(before)[1]["time"]
    assert any(newest.name in line for line in simulation.warnings)
    assert newest.name in (run / "log.txt").read_text()
    simulation.close()


def test_changed_numbers_are_fine(drop):
    """A restart may change what the state does not hang on."""
    changes = {
        "end_time": 0.41,
        "numerics.skin": 0.04,
        "phases.liquid.viscosity": 0.1,
        "gravity": [0.05, -0.1],
    }
    Simulation(case_of(FULL).replace(changes), restart=drop, threads=1).run()


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("particle_spacing", 1 / 20),
        ("precision", "float64"),
        ("domain.upper", [2, 2]),
        ("domain.boundary", {"x": "wall", "y": "free_slip"}),
        ("fluids.0.shape", {"box": {"lower": [0.25, 0.25], "upper": [0.75, 0.6875]}}),
    ],
)
def test_another_scene_is_refused(drop, path, value):
    with pytest.raises(CaseError) as caught:
        Simulation(case_of(FULL).replace({path: value}), restart=drop, threads=1)
    assert caught.value.problems[0].path == path.split(".")[0]


THREE = {
    "dimension": 2, "particle_spacing": 1 / 12, "end_time": 0.01,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "wall"}},
    "phases": {name: {"density": 1, "viscosity": 0.1} for name in ("a", "b", "c")},
    "surface_tension": [{"between": pair, "coefficient": 1} for pair in (["a", "b"], ["b", "c"], ["a", "c"])],
    "fluids": [{"phase": "a", "shape": {"box": {"lower": [0, 0], "upper": [0.5, 0.5]}}},
               {"phase": "b", "shape": {"box": {"lower": [0.5, 0], "upper": [1, 0.5]}}}, {"phase": "c", "shape": "rest"}],
    "output": {"particles": "none"},
}  # fmt: skip
ONE_TENSION = {"surface_tension": [{"between": ["a", "b"], "coefficient": 1}]}


@pytest.mark.parametrize("turn", [False, True], ids=["taken away", "added"])
def test_a_balance_of_three_tensions_that_comes_or_goes_is_told(tmp_path, turn):
    """Not by the shape of an array, of which a user knows nothing."""
    case = Case.from_dict(THREE)
    first, second = (case.replace(ONE_TENSION), case) if turn else (case, case.replace(ONE_TENSION))
    Simulation(first, output=tmp_path / "run", threads=1).run()
    with pytest.raises(CaseError) as caught:
        Simulation(second.replace({"end_time": 0.02}), restart=tmp_path / "run", threads=1)
    (problem,) = caught.value.problems
    assert problem.path == "surface_tension"
    assert f"{'without' if turn else 'with'} a balance of tensions where three fluids meet" in problem.rule
    assert "shape" not in problem.rule


def test_a_tension_between_three_fluids_may_change_for_a_restart(tmp_path):
    Simulation(Case.from_dict(THREE), output=tmp_path / "run", threads=1).run()
    changed = Case.from_dict(THREE).replace({"surface_tension.0.coefficient": 0.5, "end_time": 0.012})
    again = Simulation(changed, restart=tmp_path / "run", threads=1)
    again.run()
    assert again.state.time == pytest.approx(0.012)


def test_folder_without_checkpoint_is_refused(tmp_path):
    (tmp_path / "checkpoint").mkdir()
    with pytest.raises(CaseError, match="no readable checkpoint"):
        Simulation(case_of(FULL), restart=tmp_path, threads=1)


def test_the_pressure_at_which_fluids_have_their_density_is_that_of_the_start_of_the_whole_run():
    """A restart knows the particles of the start, not where they were fitted to."""
    case = Case.from_dict({
        "dimension": 2, "particle_spacing": 1 / 16, "end_time": 0.05, "gravity": [0, -0.98],
        "domain": {"lower": [0, 0], "upper": [1, 2], "boundary": {"x": "free_slip", "y": "wall"}},
        "phases": {"water": {"density": 1000, "viscosity": 10}, "gas": {"density": 100, "viscosity": 1}},
        "fluids": [{"phase": "gas", "shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.25}}},
                   {"phase": "water", "shape": "rest"}],
        "start": {"pressure": "980*(2 - y)", "arrangement": "fitted"}, "output": {"particles": "none"},
    })  # fmt: skip
    whole, again = Model(case, threads=1), Model(case, threads=1, fresh=False)
    assert (whole.nominal_pressure != again.nominal_pressure).any()  # else there is nothing to get wrong
    state = {name: np.array(values) for name, values in whole.save_state().items()}
    again.load_state(state)
    np.testing.assert_array_equal(again.nominal_pressure, whole.nominal_pressure)
    backgrounds = [model.stepper.bindings["phases"].numpy()["background"] for model in (whole, again)]
    np.testing.assert_array_equal(*backgrounds)
    del state["nominal_pressure"]  # a checkpoint of before, whose densities are those of no pressure
    again.load_state(state)
    assert not again.stepper.bindings["phases"].numpy()["background"].any()
