"""The stress matrix: its points and scenes are what they say, and its judgement tells what is wrong."""

import dataclasses
import importlib.util
import json
import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.case.gauge_models import as_gauge
from warpsph.measure.phase_gauges import EnergyGauge
from warpsph.measure.shape_gauges import ContourGauge
from warpsph.measure.totals import PhaseEos
from warpsph.scene.geometry import build
from warpsph.scene.physics import smoothing_ratio, support_radius
from warpsph.snapshot import FLUID, Snapshot

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "stress.py"


@pytest.fixture(scope="module")
def stress():
    spec = importlib.util.spec_from_file_location("stress", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["stress"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["stress"]


# ---- points ----------------------------------------------------------------------------------------------


def test_one_axis_at_a_time(stress):
    base, axes = stress.Point(), stress.axes_for(gpu=True, quick=False)
    points = stress.one_at_a_time(base, axes, automatic=1.5)
    assert points[0] == base and len(set(points)) == len(points)
    fields = [field.name for field in dataclasses.fields(base)]
    changed = [[name for name in fields if getattr(point, name) != getattr(base, name)] for point in points[1:]]
    assert all(len(names) == 1 for names in changed)
    for name, values in axes.items():
        found = {getattr(point, name) for point in points}
        assert found == set(values) - ({1.5} if name == "smoothing_ratio" else set())
    assert stress.differences(base, base) == "base"
    assert stress.differences(stress.Point(density_ratio=10.0, noise=0.3), base) == "rho 10, noise 0.3"


def test_the_finest_resolution_needs_a_gpu(stress):
    assert 40 in stress.axes_for(gpu=True, quick=False)["resolution"]
    assert max(stress.axes_for(gpu=False, quick=False)["resolution"]) == 20
    assert max(stress.axes_for(gpu=True, quick=True)["resolution"]) == 12


def test_random_points_repeat_with_their_seed(stress):
    axes = stress.axes_for(gpu=False, quick=False)
    first = stress.random_points(20, 1, axes, "drop")
    assert first == stress.random_points(20, 1, axes, "drop")
    assert first[:5] == stress.random_points(5, 1, axes, "drop")
    assert first != stress.random_points(20, 2, axes, "drop")
    assert first != stress.random_points(20, 1, axes, "tank")
    for name, values in axes.items():
        assert {getattr(point, name) for point in first} <= set(values)
        assert len({getattr(point, name) for point in first}) > 1


def test_a_point_from_the_command_line(stress):
    base = stress.Point()
    found = stress.parse_point(["density_ratio=10", "resolution=20", "precision=float64", "smoothing_ratio=2"], base)
    assert found == stress.Point(10.0, 100.0, 20, 0.0, "float64", 2.0)
    assert isinstance(found.resolution, int)
    assert stress.parse_point(["smoothing_ratio=auto"], found).smoothing_ratio == "auto"
    for wrong in ("density=10", "noise", "noise=much", "precision=double"):
        with pytest.raises(ValueError, match="--point: "):
            stress.parse_point([wrong], base)


# ---- scenes ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["drop", "tank", "stirred", "bubble", "wave", "lens", "impact"])
def test_scenes_are_valid_at_every_point_and_have_its_numbers(stress, name):
    axes = stress.axes_for(gpu=True, quick=False)
    scene = stress.SCENES[name]
    for point in stress.one_at_a_time(stress.Point(), axes, 1.5) + stress.random_points(5, 3, axes, name):
        case = Case.from_dict(scene.case(point))
        heavy, light = case.phases["heavy"], case.phases["light"]
        assert heavy.density / light.density == pytest.approx(point.density_ratio)
        assert heavy.viscosity / light.viscosity == pytest.approx(point.viscosity_ratio)
        assert (case.precision, case.start.noise) == (point.precision, point.noise)
        assert case.spacing == pytest.approx(0.25 / point.resolution)
        # everything else is automatic
        given = {"smoothing_ratio"} if point.smoothing_ratio != "auto" else set()
        assert case.numerics.model_fields_set == given
        assert smoothing_ratio(case) == (1.5 if point.smoothing_ratio == "auto" else point.smoothing_ratio)
        assert {phase.sound_speed for phase in case.phases.values()} == {"auto"}
        assert scene.energy(point) > 0 and min(scene.speed(point)) > 0
        # periodic scenes alone conserve momentum
        assert (scene.drift is not None) == all(case.periodic)


def test_what_the_scenes_hold(stress):
    point = stress.Point(density_ratio=100.0, resolution=20)
    area = math.pi / 16
    for name, expected in (
        ("drop", area), ("tank", 0.5), ("stirred", area), ("bubble", 1 - area),
        ("wave", 0.5), ("lens", 0.5 - area / 2), ("impact", area),
    ):  # fmt: skip
        case = Case.from_dict(stress.SCENES[name].case(point))
        geometry = build(case, support_radius(case))
        fluid = geometry.kind == 0
        assert geometry.volume[fluid & (geometry.phase == 0)].sum() == pytest.approx(expected, rel=0.01)
    # kinetic energy of the vortices, of which that of the drop is an estimate
    case = Case.from_dict(stress.SCENES["stirred"].case(point))
    geometry = build(case, support_radius(case))
    kinetic = 0.5 * np.where(geometry.phase == 0, 1.0, 0.01) * (geometry.velocity**2).sum(axis=1) * geometry.volume
    surface = 0.5 * 2 * math.pi * 0.25
    assert stress.SCENES["stirred"].energy(point) == pytest.approx(kinetic.sum() + surface, rel=0.05)


def test_surface_energy_of_three_phases_is_that_of_their_lines(stress):
    """Disc half in the heavy phase: two half circles and what they leave of the straight line, each with its tension."""
    case = Case.from_dict(stress.lens(stress.Point(density_ratio=10.0)))
    lengths = {("heavy", "light"): 0.5, ("heavy", "oil"): math.pi / 4, ("light", "oil"): math.pi / 4}
    lines = {
        f"perimeter {name}": sum(length for pair, length in lengths.items() if name in pair) for name in case.phases
    }
    expected = 0.5 * 1.0 + math.pi / 4 * (0.8 + 0.6)
    assert stress.surface_energy(case.surface_tension, lines) == pytest.approx(expected)
    assert stress.SCENES["lens"].energy(stress.Point()) == pytest.approx(expected)


def test_the_drop_that_hits_the_floor_has_its_numbers(stress):
    case = Case.from_dict(stress.impact(stress.Point(resolution=20)))
    heavy, sigma = case.phases["heavy"], case.surface_tension[0].coefficient
    assert heavy.density * 0.5 / sigma == pytest.approx(80)
    assert heavy.density * 0.5 / heavy.viscosity == pytest.approx(500)
    geometry = build(case, support_radius(case))
    fluid = geometry.kind == 0
    falls = geometry.velocity[fluid][:, 1] == -1
    assert np.count_nonzero(falls != (geometry.phase[fluid] == 0)) <= 0.01 * np.count_nonzero(falls)


def test_the_bubble_starts_in_balance(stress):
    """No pressure difference but hydrostatic far from it, the Laplace jump across its surface."""
    for ratio in (1.0, 1000.0):
        case = Case.from_dict(stress.bubble(stress.Point(density_ratio=ratio, resolution=40)))
        geometry = build(case, support_radius(case))
        fluid = geometry.kind == 0
        position, pressure, phase = geometry.position[fluid], geometry.pressure[fluid], geometry.phase[fluid]
        offset = position - (0.5, stress.BUBBLE_HEIGHT)
        distance = np.linalg.norm(offset, axis=1)
        low, high = (np.abs(distance - 0.25) < 0.02) & (phase == 1), (np.abs(distance - 0.25) < 0.02) & (phase == 0)
        jump = pressure[low].mean() - pressure[high].mean()
        assert jump == pytest.approx(stress.BUBBLE_TENSION / 0.25, rel=0.1)
        inside = distance < 0.2
        slope = np.polyfit(offset[inside, 1], pressure[inside], 1)[0]
        assert slope == pytest.approx(-2 / (ratio + 1), abs=1e-6)  # the pressure's gradient where both accelerate


# ---- measuring and judging -------------------------------------------------------------------------------


def lattice(stress, swap):
    """A fake model of the bubble scene, particles at rest on their lattice; `swap` change their phase."""
    case = Case.from_dict(stress.bubble(stress.Point(density_ratio=10.0)))
    geometry = build(case, support_radius(case))
    n = geometry.count
    phase = geometry.phase.astype(np.int32)
    phase[geometry.kind != FLUID] = -1
    phase[swap] = 1 - phase[swap]
    density = np.where(phase == 1, 0.1, 1.0)
    velocity = np.zeros((n, 2))
    velocity[phase == 1] = 0.3, 0.4
    snapshot = Snapshot(
        time=0.5, step=7, dt=0.1, dimension=2, position=geometry.position, velocity=velocity, density=density,
        pressure=np.zeros(n), mass=density * geometry.volume, volume=geometry.volume, phase=phase,
        particle_id=np.arange(n), kind=geometry.kind.astype(np.uint8), particle_spacing=case.spacing,
    )  # fmt: skip
    eos = {name: PhaseEos(phase.density, 10.0, phase.gamma) for name, phase in case.phases.items()}
    sections = [as_gauge({"type": name, "interval": 1.0}) for name in ("energy", "contour")]
    gauges = EnergyGauge("energy", sections[0], case, eos), ContourGauge("contour", sections[1], case)
    return SimpleNamespace(case=case, snapshot=lambda: snapshot), gauges, snapshot


def test_what_a_sample_holds(stress):
    model, gauges, snapshot = lattice(stress, [])
    found = stress.sample(model, *gauges)
    assert found["finite"] and (found["time"], found["step"]) == (0.5, 7)
    assert found["speed"] == [0.0, 0.5] and found["strays"] == 0
    bubble = snapshot.volume[snapshot.phase == 1].sum()
    assert found["energy"]["kinetic"] == pytest.approx(0.5 * 0.1 * 0.25 * bubble)
    assert found["energy"]["potential"] == pytest.approx(
        0.5 * (1 - bubble) + (0.5 - stress.BUBBLE_HEIGHT) * bubble + stress.BUBBLE_HEIGHT * 0.1 * bubble, rel=1e-3
    )
    assert found["energy"]["elastic"] == pytest.approx(0.0, abs=1e-12)
    # walls are no surface
    assert found["energy"]["surface"] == pytest.approx(stress.BUBBLE_TENSION * 2 * math.pi * 0.25, rel=0.01)
    assert found["mean_velocity"] == pytest.approx([0.03 * bubble / (1 - 0.9 * bubble), 0.04 * bubble / (1 - 0.9 * bubble)])
    assert stress.total(found) == pytest.approx(sum(found["energy"].values()))


def test_particles_alone_in_the_other_phase_are_strays(stress):
    _, _, snapshot = lattice(stress, [])
    place = np.linalg.norm(snapshot.position - (0.5, 0.85), axis=1)
    one = int(place.argmin())
    neighbour = int(np.argsort(place)[1])
    for swap, strays in (([one], 1), ([one, neighbour], 2)):
        model, gauges, _ = lattice(stress, swap)
        assert stress.sample(model, *gauges)["strays"] == strays


def test_a_state_that_is_not_finite(stress):
    model, gauges, snapshot = lattice(stress, [])
    snapshot.velocity[5, 0] = np.nan
    assert stress.sample(model, *gauges) == {"finite": False, "time": 0.5, "step": 7}


def moment(speed=(0.1, 0.1), energy=2.0, strays=0, mean=(0.0, 0.0), finite=True):
    return {
        "finite": finite, "time": 0.0, "step": 0, "speed": list(speed), "strays": strays, "mean_velocity": list(mean),
        "energy": {"kinetic": 0.5, "potential": 0.0, "elastic": 0.0, "surface": energy - 0.5},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("samples", "fault", "missed"),
    [
        ([moment(strays=2), moment(strays=2, energy=2.01)], "", set()),
        ([moment(), moment(energy=1.0)], "", set()),
        ([moment(), moment(speed=(1.1, 0.0)), moment()], "", {"speed"}),  # at any moment
        ([moment(), moment(speed=(0.0, 20.1)), moment()], "", {"speed"}),
        ([moment(), moment(speed=(0.9, 19.0)), moment()], "", set()),
        ([moment(), moment(energy=2.05)], "", {"energy"}),
        ([moment(), moment(energy=math.nan)], "", {"energy"}),
        ([moment(strays=2), moment(strays=3)], "", {"strays"}),
        ([moment(mean=(1.0, 0.0)), moment(mean=(1.0, 0.021))], "", {"drift"}),
        ([moment(mean=(1.0, 0.0)), moment(mean=(1.0, 0.019))], "", set()),
        ([moment(), moment()], "step 3: a particle ...", {"survives"}),
        ([moment(), moment(finite=False)], "", {"survives"}),
    ],
)
def test_judgement(stress, samples, fault, missed):
    scene = stress.Scene(dict, lambda point: (2.0, 40.0), 0.5, lambda point: 4.0, 2.0)
    criteria = stress.judge(scene, stress.Point(), samples, fault)
    assert tuple(criteria) == stress.CRITERIA
    assert {name for name, entry in criteria.items() if not entry["ok"]} == missed
    walled = dataclasses.replace(scene, drift=None)
    criteria = stress.judge(walled, stress.Point(), samples, fault)
    assert criteria["drift"] == {"value": None, "limit": None, "ok": True}


def test_numbers_are_shares_of_the_scene(stress):
    scene = stress.Scene(dict, lambda point: (2.0, 40.0), 0.5, lambda point: 4.0, 2.0)
    samples = [moment(), moment(speed=(0.6, 4.0), energy=1.5, strays=3, mean=(0.3, -0.4))]
    values = {name: entry["value"] for name, entry in stress.judge(scene, stress.Point(), samples, "").items()}
    assert values == pytest.approx({"survives": True, "speed": 0.3, "energy": -0.125, "strays": 3, "drift": 0.25})


def test_a_run_without_a_start(stress):
    for samples in ([], [moment(finite=False)]):
        criteria = stress.judge(stress.SCENES["drop"], stress.Point(), samples, "no room")
        assert tuple(criteria) == stress.CRITERIA and not any(entry["ok"] for entry in criteria.values())
        row = {"scene": "drop", "scene_times": 0.0, "steps": 0, "seconds": 0.0, "fault": "no room", "criteria": criteria}
        assert stress.line(row, "base").endswith("FAULT: no room")


def test_json_has_no_nan(stress):
    found = stress.plain({"a": [1, math.nan, (math.inf, "text")], "b": {"c": -math.inf, "d": None, "e": 0.5}})
    assert found == {"a": [1, None, [None, "text"]], "b": {"c": None, "d": None, "e": 0.5}}


def test_a_line_marks_what_missed(stress):
    scene = stress.SCENES["drop"]
    row = {"scene": "drop", "scene_times": 1.0, "steps": 10, "seconds": 0.1, "fault": ""}
    fine = {**row, "criteria": stress.judge(scene, stress.Point(), [moment(), moment()], "")}
    text = stress.line(fine, "base")
    assert text.startswith("drop ") and text.endswith(" ok") and "!" not in text
    bad = {**row, "criteria": stress.judge(scene, stress.Point(), [moment(), moment(strays=4, energy=3.0)], "")}
    assert "!4" in stress.line(bad, "base") and stress.line(bad, "base").endswith("missed energy, strays")
    lost = {**row, "fault": "step 9: gone", "criteria": stress.judge(scene, stress.Point(), [moment()], "step 9: gone")}
    assert stress.line(lost, "base").endswith("FAULT: step 9: gone")


# ---- runs: the bubble has the kernels of other tests -----------------------------------------------------


def test_a_run_from_start_to_end(stress):
    point = stress.Point(density_ratio=100.0, resolution=5, noise=0.1)
    row = stress.run("bubble", point, 43, "cpu", 1)
    assert row["steps"] == 43 and len(row["samples"]) == 21 and row["samples"][-1]["step"] == 43
    assert row["criteria"]["survives"]["ok"] and not row["fault"]
    assert row["time"] == row["samples"][-1]["time"] > 0
    assert 0 < row["criteria"]["speed"]["value"] < 2 and row["criteria"]["strays"]["value"] == 0
    assert row["point"] == dataclasses.asdict(point)
    assert Case.from_dict(row["case"]).phases["light"].density == 0.01
    json.dumps(stress.plain(row), allow_nan=False)


def test_a_run_that_fails_is_a_row_too(stress, monkeypatch):
    import warpsph.running.model

    class Failing(warpsph.running.model.Model):
        def __init__(self, *arguments, **keywords):
            super().__init__(*arguments, **keywords)
            steps = self.stepper.run

            def run(target, most_steps):
                if self.steps >= 20:
                    velocity = self.particles.get("velocity").copy()
                    velocity[3] = np.nan
                    self.particles.put("velocity", velocity)
                steps(target, most_steps)

            self.stepper.run = run

    monkeypatch.setattr(warpsph.running.model, "Model", Failing)
    row = stress.run("bubble", stress.Point(density_ratio=100.0, resolution=5), 40, "cpu", 1)
    assert not row["criteria"]["survives"]["ok"] and " at (" in row["fault"] and row["fault"].startswith("step 21: ")
    assert row["samples"][-1]["step"] == 20 and row["criteria"]["strays"]["ok"]
    assert json.loads(json.dumps(stress.plain(row), allow_nan=False))["steps"] == 21


def test_command(stress, tmp_path, capsys, monkeypatch):
    out = tmp_path / "new" / "stress.json"
    options = ["--quick", "--only", "bubble", "--steps", "20", "--threads", "1"]
    point = ["--point", "density_ratio=100", "resolution=5"]
    assert stress.main([*options, *point, "--json", str(out)]) == 0
    text = capsys.readouterr().out
    found = json.loads(out.read_text())
    (row,) = found["rows"]
    assert found["steps"] == row["steps"] == 20 and row["point"]["resolution"] == 5
    assert "rho 100, R/dx 5" in text and "1 runs, 0 missed a limit" in text
    monkeypatch.setattr(stress, "ENERGY_LIMIT", -1.0)
    assert stress.main([*options, *point]) == 1
    assert "missed energy" in capsys.readouterr().out


def test_command_runs_the_whole_plan(stress, capsys, monkeypatch):
    ran = []

    def run(scene, point, steps, device, threads):
        ran.append((scene, point, steps))
        criteria = stress.judge(stress.SCENES[scene], point, [moment(), moment()], "")
        return {"scene": scene, "criteria": criteria, "fault": "", "scene_times": 1.0, "steps": steps, "seconds": 0.0}

    monkeypatch.setattr(stress, "run", run)
    stress.main(["--only", "drop", "tank", "--random", "3", "--seed", "5"])
    axes = stress.axes_for(gpu=False, quick=False)
    expected = [
        (scene, point, 2000)
        for scene in ("drop", "tank")
        for point in stress.one_at_a_time(stress.Point(), axes, 1.5) + stress.random_points(3, 5, axes, scene)
    ]
    assert ran == expected
    for wrong in (["--point", "noise=much"], ["--steps", "0"], ["--only", "teapot"]):
        with pytest.raises(SystemExit) as stopped:
            stress.main(wrong)
        assert stopped.value.code == 2
    capsys.readouterr()


def test_runs_in_processes_are_those_of_one(tmp_path):
    """Two at a time, as a command: the same rows in the same order."""
    rows = []
    for processes in ("1", "2"):
        file = tmp_path / f"{processes}.json"
        subprocess.run(
            [sys.executable, str(SCRIPT), "--only", "drop", "tank", "--point", "resolution=5", "--steps", "20",
             "--threads", "1", "--processes", processes, "--json", str(file)],
            capture_output=True, timeout=300,
        )  # fmt: skip
        rows.append(json.loads(file.read_text())["rows"])
    assert [row["scene"] for row in rows[0]] == ["drop", "tank"]
    for one, two in zip(*rows, strict=True):
        assert one["scene"] == two["scene"] and one["criteria"] == two["criteria"]
