"""What a scene takes of memory, told before it is made: against what is then made, and what is said if it does not fit."""

import json
import re
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import pytest
import pyvista
from typer.testing import CliRunner

from tests.isph_scenes import TANK
from tests.scenes import FULL, PERIODIC, case_of
from warpsph import cli
from warpsph.case.case_file import load_case, save_case
from warpsph.engine import free_memory
from warpsph.errors import CapacityError
from warpsph.running import memory, model, preview
from warpsph.running.model import Model
from warpsph.scene.body_sampling import sample, working_memory
from warpsph.scene.geometry import build
from warpsph.scene.meshes import Mesh
from warpsph.scene.physics import support_radius
from warpsph.scene.surfaces import Brick
from warpsph.scene.thinness import thin_places

ROOT = Path(__file__).resolve().parents[2]
WITHIN = 0.3  # of what is taken
BOX = {
    **PERIODIC,
    "dimension": 3,
    "domain": {"lower": [0, 0, 0], "upper": [1, 1, 1], "boundary": {axis: "periodic" for axis in "xyz"}},
    "start": {"noise": 0.1},
    "gauges": {},
}
HUGE = {**BOX, "particle_spacing": 1e-3}
CASES = {
    "periodic": case_of(PERIODIC),
    "walls, two phases": case_of(FULL),
    "3-D": case_of(BOX),
    "isph": case_of(TANK, particle_spacing=0.1 / 4),
    "open, 3-D": load_case(ROOT / "cases/dam_break_3d.yaml"),
    "body": case_of(
        PERIODIC, bodies={"pin": {"shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.2}}}}, start__velocity=[0, 0]
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_the_count_is_that_of_the_geometry(name):
    """Exact where the sample holds every cell."""
    case = CASES[name]
    found, geometry = memory.count(case, support_radius(case)), build(case, support_radius(case))
    assert found.fluid == geometry.fluid_count
    # boundary particles of bodies are estimated from the surface
    assert found.walls == (pytest.approx(geometry.wall_count, rel=0.15) if name == "body" else geometry.wall_count)
    assert found.filled == (name in ("periodic", "walls, two phases", "3-D", "body"))


def test_the_count_of_a_finer_scene():
    """A part of the cells tells the share of a drop to a per cent."""
    case = load_case(ROOT / "cases/elliptic_drop.yaml", overrides=["particle_spacing=1/150"])
    found, geometry = memory.count(case, support_radius(case)), build(case, support_radius(case))
    assert found.cells > 10 * memory.SITES
    assert found.fluid == pytest.approx(geometry.fluid_count, rel=0.01)


@pytest.mark.parametrize("name", CASES)
def test_device_memory_is_as_foretold(name):
    case = CASES[name]
    run = Model(case, threads=1)
    stepper = run.stepper
    taken = run.particles.memory() + stepper.list.memory() + stepper.list.memory_beside()
    if stepper.systems is not None:
        systems = stepper.systems
        taken += systems.matrix.memory() + systems.solver.memory() + systems.solver.preconditioner.memory()
    assert memory.expected_on_device(case, memory.count(case, support_radius(case))) == pytest.approx(taken, rel=WITHIN)
    assert preview.estimate(case)["memory_bytes"] == pytest.approx(taken, rel=WITHIN)


PEAK = """
import json, sys
from warpsph.running import memory
from warpsph.case.case import Case
from warpsph.scene.body_sampling import sample, working_memory
from warpsph.scene.geometry import build
from warpsph.scene.meshes import Mesh
from warpsph.scene.physics import support_radius
from warpsph.scene.surfaces import Brick
from warpsph.scene.thinness import thin_places

def status(name):
    return next(1024 * int(row.split()[1]) for row in open("/proc/self/status") if row.startswith(name))

case = Case.from_dict(json.loads(sys.argv[1]))
support = support_radius(case)
build(case.replace({"particle_spacing": 5 * case.spacing}), support)  # what is imported on the way
open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
build(case, support)
print(status("VmHWM") - before, memory.building(case, memory.count(case, support)))
"""


@pytest.mark.parametrize("scene", ["plane", "box", "tank"])
def test_building_takes_what_is_foretold(scene):
    """The peak of the resident set, at some hundred thousand particles."""
    if not Path("/proc/self/clear_refs").exists():
        pytest.skip("needs the peak of the resident set")
    case = {
        "plane": lambda: case_of(PERIODIC, particle_spacing=1 / 800),
        "box": lambda: case_of(BOX, particle_spacing=1 / 80),
        "tank": lambda: load_case(ROOT / "cases/dam_break_3d.yaml", overrides=["particle_spacing=0.146/60"]),
    }[scene]()
    text = json.dumps({**case.to_dict(), "reference": {}, "validation": {}})
    done = subprocess.run([sys.executable, "-c", PEAK, text], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    taken, foretold = map(int, done.stdout.split())
    assert foretold == pytest.approx(taken, rel=WITHIN)


# what does not fit ------------------------------------------------------------------------------------------


def never(*_arguments, **_options):
    raise AssertionError("nothing may be built")


def test_check_of_a_scene_that_does_not_fit(tmp_path, monkeypatch):
    """It answers at once, from arithmetic, with its estimate and with what would fit."""
    monkeypatch.setattr(free_memory, "host_free", lambda: 16_000_000_000)
    monkeypatch.setattr(preview, "build", never)
    save_case(case_of(HUGE), tmp_path / "huge.yaml")
    begin = time.perf_counter()
    result = CliRunner().invoke(cli.app, ["check", str(tmp_path / "huge.yaml")])
    assert time.perf_counter() - begin < 5
    assert result.exit_code == 5, result.stderr
    assert re.search(r"fluid particles +about 1 000 000 000", result.stdout)
    for part in ("particle_spacing: 0.001", "building them takes 166 GB", "16 GB (16000000000 bytes) are free", "would fit"):
        assert part in result.stderr
    begin = time.perf_counter()
    found = preview.estimate(case_of(HUGE))
    assert time.perf_counter() - begin < 0.5
    assert found["particles"] == 10**9 and found["host_bytes"] == 166 * 10**9


def test_run_and_show_build_nothing_that_does_not_fit(tmp_path, monkeypatch):
    monkeypatch.setattr(free_memory, "host_free", lambda: 16_000_000_000)
    monkeypatch.setattr(preview, "build", never)
    monkeypatch.setattr(model, "build", never)
    save_case(case_of(HUGE), tmp_path / "huge.yaml")
    for arguments in (["run", "--output", str(tmp_path / "run")], ["run", "--dry-run"], ["show"]):
        result = CliRunner().invoke(cli.app, [arguments[0], str(tmp_path / "huge.yaml"), *arguments[1:]])
        assert result.exit_code == 5, result.stderr
        assert "particle_spacing: 0.001" in result.stderr and "would fit" in result.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("scene", [BOX, FULL, TANK], ids=["3-D", "walls", "isph"])
@pytest.mark.parametrize("place", ["host", "cuda"])
def test_the_spacing_that_is_named_fits(scene, place, monkeypatch):
    """And one finer by a tenth does not."""
    case = case_of(scene, particle_spacing=case_of(scene).spacing / 20)
    device = None
    if place == "cuda":
        device = SimpleNamespace(is_cpu=False, free_memory=8_000_000)
    else:
        monkeypatch.setattr(free_memory, "host_free", lambda: 2_000_000)
    error = memory.shortage(case, device)
    assert isinstance(error, CapacityError) and error.exit_code == 5
    spacing = float(re.search(r"a particle_spacing of (\S+) would fit", str(error)).group(1))

    def fits(value):
        return memory.shortage(case.model_copy(update={"particle_spacing": value}), device) is None

    assert fits(spacing)
    assert not fits(0.9 * spacing)


def test_a_cpu_run_that_does_not_fit(monkeypatch):
    """Building does, fields and list do not: an error of a run there, a warning of `check`, which knows no device."""
    case = case_of(BOX)
    found = memory.count(case, support_radius(case))
    free = memory.running_on_host(case, found) + memory.expected_on_device(case, found) // 2
    monkeypatch.setattr(free_memory, "host_free", lambda: free)
    with pytest.raises(CapacityError, match="their run takes"):
        Model(case, threads=1)
    estimate = preview.estimate(case)
    assert "refused" not in estimate
    assert any("a run on the CPU takes" in warning for warning in estimate["warnings"])


def test_more_particles_than_can_be_numbered(monkeypatch):
    monkeypatch.setattr(free_memory, "host_free", lambda: 10**15)
    error = memory.shortage(case_of(HUGE))
    assert "more than the 536870911 that a run can number" in str(error)
    assert "would fit" in str(error)


@pytest.mark.parametrize("command", ["check", "run"])
def test_a_mesh_in_millimetres_is_told_before_it_is_sampled(tmp_path, command):
    """A block of 100 m in a domain of 1 m, which took all of the memory and was killed. With a scale it is as any other."""
    pyvista.Cube(x_length=100.0, y_length=100.0, z_length=100.0).triangulate().save(tmp_path / "block.stl")
    bodies = {"block": {"shape": {"stl": {"file": str(tmp_path / "block.stl"), "translate": [0.5, 0.5, 0.5]}}}}
    case = case_of(BOX, bodies=bodies, particle_spacing=1 / 50, start__noise=0.0)
    save_case(case, tmp_path / "case.yaml")
    output = ["--output", str(tmp_path / "run")] if command == "run" else []
    done = CliRunner().invoke(cli.app, [command, str(tmp_path / "case.yaml"), *output])
    assert done.exit_code == 5, done.output
    assert "bodies.block.shape.stl" in done.stderr and "100 x 100 x 100 m in a domain of 1 x 1 x 1 m" in done.stderr
    assert "scale: 0.001" in done.stderr and not (tmp_path / "run").exists()
    small = case.replace({"bodies.block.shape.stl.scale": 0.005})
    assert memory.shortage(small) is None


def test_what_a_body_takes_to_sample(tmp_path):
    """Peaks of the memory that NumPy takes, of a mesh and of a box; a box that is far too long is refused, too."""
    block = pyvista.Cube(x_length=0.6, y_length=0.5, z_length=0.4).triangulate()
    for surface in (Mesh(block), Brick([0.0, 0.0, 0.0], [0.6, 0.5, 0.4])):
        tracemalloc.start()
        thin_places(surface, 0.02, 3)
        sample(surface, 0.02, 3, [0.2] * 3, [0.3] * 3)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert 0.3 < working_memory(surface, 0.02, 3) / peak < 3.0
    long = {"floor": {"shape": {"box": {"lower": [-1000, -1000, -10], "upper": [1000, 1000, 0.2]}}}}
    refused = memory.shortage(case_of(BOX, bodies=long, particle_spacing=1 / 50))
    assert "bodies.floor.shape.box" in str(refused) and "cut off what is far outside" in str(refused)


def test_what_a_control_group_leaves(tmp_path):
    """Both versions; the page cache that can be given up does not count as used."""
    own = tmp_path / "box" / "job"
    own.mkdir(parents=True)
    (tmp_path / "box" / "memory.max").write_text("5000\n")
    (tmp_path / "box" / "memory.current").write_text("1000\n")
    (own / "memory.max").write_text("max\n")
    (own / "memory.current").write_text("900\n")
    old = tmp_path / "memory" / "job"
    old.mkdir(parents=True)
    (old / "memory.limit_in_bytes").write_text("3000\n")
    (old / "memory.usage_in_bytes").write_text("2500\n")
    (old / "memory.stat").write_text("cache 700\ntotal_inactive_file 600\n")
    groups = tmp_path / "groups"
    groups.write_text("4:memory:/job\n3:cpu:/x\n0::/box/job\n")
    assert sorted(free_memory._group_limits(tmp_path, groups)) == [1100, 4000]
    assert free_memory._group_limits(tmp_path, tmp_path / "nothing") == []
    free = free_memory.host_free()
    assert free is None or free > 10**6


def test_the_largest_scene_of_the_benchmark_fits_a_large_gpu(monkeypatch):
    """32 M particles in 3-D have more list entries than 31 bits number, and fit 141 GB beside a host of 128 GiB."""
    import importlib.util

    from warpsph.case.case import Case
    from warpsph.engine.neighbours import LARGEST_NARROW

    spec = importlib.util.spec_from_file_location("bench_speed", ROOT / "scripts" / "bench_speed.py")
    bench = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(bench)
    monkeypatch.setattr(free_memory, "host_free", lambda: 100_000_000_000)
    for name in ("box 32M", "box 32M default"):
        case = Case.from_dict(bench.SCENES[name][0]())
        found = memory.count(case, support_radius(case))
        assert found.particles == 318**3 > 32_000_000
        assert 100 * found.particles > LARGEST_NARROW
        assert memory.shortage(case, SimpleNamespace(is_cpu=False, free_memory=140_000_000_000)) is None
        small = memory.shortage(case, SimpleNamespace(is_cpu=False, free_memory=20_000_000_000))
        assert "their run takes" in str(small) and "would fit" in str(small)
