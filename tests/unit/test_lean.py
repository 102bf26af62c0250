"""What a scene does not need is not there: no stage, array, kernel or import; and steps allocate nothing."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import warp as wp

from tests.scenes import FULL, LEAN, PERIODIC, case_of
from warpsph import Simulation
from warpsph.engine.launch import Launcher
from warpsph.engine.program import lines
from warpsph.kernels.core import clock as ck
from warpsph.running.preview import describe

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ("pyvista", "vtk", "vtkmodules", "matplotlib", "h5py", "scipy", "pandas")

# What each piece of physics brings with it.
FIELDS = {
    "second phase": {"phase", "velocity_gradient", "facing", "interface_depth"},
    "friction of disorder": {"disorder_force", "disorder_speed", "flow_gradient"},
    "walls": {"wall_body", "wall_neighbours", "wall_impact"},
    "friction on walls": {"slip", "wall_depth", "mirror_velocity"},
    "friction between fluids": {"gradient_at_interface"},
    "tension": {"fraction", "normal", "interface_weight", "curvature", "mean_curvature"},
    "sound of tension": {"settled"},
    "interface band": {"band_mark", "band_sum", "band"},
    "shift": {"shift", "carried"},
}
STAGES = {
    "second phase": ["interface_flow"],
    "friction between fluids": ["interface_gradient"],
    "walls": ["wall_state"],
    "sound of tension": ["relaxation"],
    "tension": ["own_fraction", "colour_normal", "curvature", "mean_curvature", "sharp_curvature"],
    "contact angle": ["contact_normal"],
    "volume constraint": ["volume", "volume_close"],
}
KERNELS = {
    "second phase": {"interface_flow"},
    "friction between fluids": {"interface_gradient"},
    "walls": {"wall_state"},
    "sound of tension": {"relaxation"},
    "tension": {"own_fraction", "colour_normal", "interface_curvature", "evened_curvature", "mark_band", "gather_band"},
    "contact angle": {"contact_normal"},
    "volume constraint": {"sum_volume", "close_volume"},
}


@pytest.fixture
def kernels(monkeypatch):
    """Names of the kernels that simulations bind from now on."""
    bound: list[str] = []
    original = Launcher.task

    def task(self, name, kernel, *arguments, **keywords):
        bound.append(kernel.key)
        return original(self, name, kernel, *arguments, **keywords)

    monkeypatch.setattr(Launcher, "task", task)
    return bound


@pytest.fixture
def loads(monkeypatch):
    """Names of the modules that Warp compiles or loads from now on."""
    loaded: list[str] = []
    module = type(wp.get_module("tests"))
    original = module.load

    def load(self, *arguments, **keywords):
        before = len(self.execs)
        result = original(self, *arguments, **keywords)
        if len(self.execs) != before:
            loaded.append(self.name)
        return result

    monkeypatch.setattr(module, "load", load)
    return loaded


@pytest.fixture
def allocations(monkeypatch):
    """Shapes of the Warp arrays that are made from now on."""
    made: list[object] = []
    original = wp.array.__init__

    def init(self, *arguments, **keywords):
        original(self, *arguments, **keywords)
        made.append(self.shape)

    monkeypatch.setattr(wp.array, "__init__", init)
    return made


def base_name(key: str) -> str:
    return key.split("__locals__")[-1].strip("_")


def structure(scene, kernels):
    kernels.clear()
    model = Simulation(case_of(scene), threads=1).model
    stages = [task.name for task in model.stepper.step_tasks]
    return set(model.particles.arrays), stages, {base_name(key) for key in kernels}


def test_leanest_against_fullest(kernels):
    lean_fields, lean_stages, lean_kernels = structure(LEAN, kernels)
    full_fields, full_stages, full_kernels = structure(FULL, kernels)
    assert full_fields - lean_fields == set().union(*FIELDS.values())
    assert lean_fields <= full_fields
    assert lean_stages == ["kick_drift", "continuity", "momentum", "advance"]
    assert set(full_stages) - set(lean_stages) == {stage for stages in STAGES.values() for stage in stages}
    assert set().union(*KERNELS.values()) <= full_kernels - lean_kernels


@pytest.mark.parametrize(
    ("physics", "changes", "fields", "stages"),
    [
        (
            "tension",
            {"surface_tension": []},
            ["sound of tension"],
            ["sound of tension", "contact angle"],
        ),
        (
            # the curvature is for the tension, and for depths where weights differ
            "tension and weight",
            {"surface_tension": [], "gravity": [0, 0]},
            ["tension", "sound of tension", "interface band"],
            ["sound of tension", "tension", "contact angle"],
        ),
        (
            "tension and densities",
            {"surface_tension": [], "phases.gas.density": 100},
            ["tension", "sound of tension", "interface band"],
            ["sound of tension", "tension", "contact angle"],
        ),
        (
            "viscosity",
            {"phases.gas.viscosity": 0, "phases.liquid.viscosity": 0},
            ["friction on walls", "friction between fluids"],
            ["friction between fluids"],
        ),
        (
            "other viscosity",
            {"phases.gas.viscosity": 1, "phases.liquid.viscosity": 1},
            ["friction between fluids"],
            ["friction between fluids"],
        ),
        ("shift", {"numerics.shifting": 0}, ["shift"], []),
        ("disorder", {"numerics.disorder_friction": 0}, ["friction of disorder"], []),
        ("constraint", {"numerics.volume_constraint": False}, [], ["volume constraint"]),
        ("gravity", {"gravity": [0, 0]}, [], []),
        (
            "walls",
            {"domain.boundary": {"x": "periodic", "y": "periodic"}, "gravity": [0, 0]},
            ["walls", "friction on walls"],
            ["walls", "contact angle", "volume constraint"],  # in a periodic box the volume is summed up with the momentum
        ),
    ],
)
def test_one_piece_less(physics, changes, fields, stages):
    """Without one piece of physics exactly its arrays and stages are missing, and `show` says so."""
    changes = {**changes, "gauges": {}, "output.particles": None}
    full, less = describe(case_of(FULL)), describe(case_of(FULL).replace(changes))
    gone = set(full["structure"]["fields"]) - set(less["structure"]["fields"])
    assert gone == {field for name in fields for field in FIELDS[name]}
    names = [[stage["name"] for stage in plan["stages"]] for plan in (full, less)]
    assert set(names[0]) - set(names[1]) == {stage for name in stages for stage in STAGES[name]}
    kept = set(names[0]) & set(names[1])
    assert [name for name in names[0] if name in kept] == [name for name in names[1] if name in kept]
    # what `show` tells is what runs
    model = Simulation(case_of(FULL).replace(changes), threads=1).model
    assert [name for _, name, _ in lines(model.stepper.program.step)] == names[1]
    assert [task.name for task in model.stepper.step_tasks] == [name for name in names[1] if name not in ("rarely", "list")]
    assert list(model.particles.arrays) == less["structure"]["fields"]
    assert len(less["absent"]) > len(full["absent"]) or physics == "walls"
    assert all(entry["reason"] for entry in [*less["absent"], *less["stages"]])


def test_absent_arrays_take_no_memory():
    """An argument without an array is bound to an empty one."""
    model = Simulation(case_of(LEAN), threads=1).model
    for array in model.stepper.bindings._empty.values():
        assert array.size == 0
    assert model.particles.memory() <= 80 * model.particles.count


@pytest.mark.parametrize("scene", [LEAN, PERIODIC, FULL], ids=["lean", "periodic", "full"])
def test_steps_compile_and_allocate_nothing(scene, loads, allocations):
    """List rebuilds are among the steps."""
    model = Simulation(case_of(scene), threads=1).model
    model.stepper.run(1.0, 20)
    assert allocations
    rebuilds = int(model.stepper.read()[1][ck.REBUILDS])
    loads.clear()
    allocations.clear()
    model.stepper.run(1.0, 150)
    assert model.steps == 170
    assert model.stepper.read()[1][ck.REBUILDS] > rebuilds
    assert loads == [] and allocations == []


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("surface_tension.0.coefficient", [0.1, 0.6]),
        ("phases.liquid.viscosity", [0.01, 0.2]),
        ("phases.liquid.density", [10, 200]),
        ("phases.gas.sound_speed", [20.0, 40.0]),
        ("phases.gas.background_pressure", [0.0, 5.0]),
        ("gravity", [[0, -0.2], [0.1, 0]]),
        ("numerics.courant", [0.1, 0.3]),
        ("numerics.shifting", [0.01, 1.0]),
        ("numerics.neighbour_capacity", [4, 100]),
    ],
)
def test_sweep_over_a_number_compiles_nothing(path, values, loads):
    short = case_of(FULL, end_time=0.02)
    Simulation(short, threads=1).run()
    loads.clear()
    for value in values:
        Simulation(short.replace({path: value}), threads=1).run()
    assert loads == []


def test_another_structure_does_compile(loads):
    """The recorder of the tests above sees what is new."""
    Simulation(case_of(LEAN, numerics__velocity_dissipation=0, end_time=0.01), threads=1)
    assert any("continuity" in name or "momentum" in name for name in loads)


SCRIPT = """
import json, sys
import warp as wp
wp.config.log_level = wp.LOG_WARNING
wp.init()
loaded = []
module = type(wp.get_module("x"))
original = module.load
def load(self, *arguments, **keywords):
    before = len(self.execs)
    result = original(self, *arguments, **keywords)
    if len(self.execs) != before:
        loaded.append(self.name)
    return result
module.load = load
from tests.scenes import LEAN, case_of
from warpsph import Simulation
from warpsph.engine.program import lines
folder = sys.argv[1]
heavy = lambda: [name for name in json.loads(sys.argv[2]) if name in sys.modules]
found = {}
LEAN["gauges"] = {"energy": LEAN["gauges"]["energy"]}
Simulation(case_of(LEAN, end_time=0.02), threads=1).run()
found["nothing written"] = heavy()
Simulation(case_of(LEAN, end_time=0.02, output__checkpoint=None), output=folder + "/a", threads=1).run()
found["particles written"] = heavy()
Simulation(case_of(LEAN, end_time=0.02), output=folder + "/b", threads=1).run()
found["checkpoints written"] = heavy()
print(json.dumps({"imports": found, "kernels": loaded}))
"""


def test_a_lean_process(tmp_path):
    """In a process of its own: what a lean run imports, and every kernel module it compiles or loads."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path), json.dumps(HEAVY)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["imports"] == {
        "nothing written": [],
        "particles written": [],
        "checkpoints written": ["h5py"],
    }
    text = " ".join(found["kernels"])
    assert "momentum" in text and "kick_drift" in text and "build_list" in text
    for names in (*KERNELS.values(), {"sum_momentum", "fold_momentum", "close_momentum"}):
        for name in names:
            assert name not in text
    assert len(found["kernels"]) == len(set(found["kernels"]))
