"""Several threads for one particle: who works on which neighbour, sums over lanes, how many lanes, and what is launched."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

import warpsph
from warpsph.engine.launch import Bindings, Launcher
from warpsph.engine.program import Stage, walk
from warpsph.kernels.core.lanes import lanes_for, make_added, make_lanes, make_largest, shared, threads_of
from warpsph.kernels.core.open_flow import make_arrival
from warpsph.kernels.core.pair import make_entry
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.isph.open_projection import make_side_pressure
from warpsph.running.model import Model

COUNTS = [0, 1, 3, 5, 0, 2, 9]  # neighbours of seven particles
PLAIN = Spec(dimension=2, row_list=False)
INTERFACES = {"interface_flow", "own_fraction", "colour_normal", "curvature", "mean_curvature", "sharp_curvature"}
PHASES = {"phase_shares", "phase_normals", "phase_curvatures", "phase_means", "phase_sharpened"}
SCENES = {
    "two fluids": ("square_droplet", ["particle_spacing=0.1"]),
    "unlike viscosities": ("rising_bubble", ["particle_spacing=0.04"]),
    "three fluids": ("oil_drop", ["particle_spacing=0.004"]),
    "friction in stages": ("shear_drop", ["particle_spacing=0.125"]),
    "free surface": ("dam_break", ["particle_spacing=0.01"]),
    "no-slip walls": ("lid_driven_cavity", ["particle_spacing=0.1"]),
    "3-D": ("shear_drop_3d", ["particle_spacing=0.5"]),
    "bodies": ("cylinder_array", []),
    "delta-plus": ("cylinder_start", ["particle_spacing=0.2"]),
    "delta-plus, free surface": ("dam_break", ["particle_spacing=0.01", "numerics.scheme=delta_plus"]),
    "gas": ("sedov", ["particle_spacing=0.04"]),
    "gas between walls": ("kelvin_helmholtz_gas", ["particle_spacing=1/32"]),
    "inlet and outlet": ("open_channel", []),
    "inlet and outlet, ISPH": ("open_channel", ["numerics.scheme=isph", "domain.boundary.x.upper={outlet: {}}"]),
}
OPEN_3D = (
    "open_channel",
    [
        "dimension=3", "particle_spacing=0.1", "domain.lower=[0, 0, 0]", "domain.upper=[1.5, 1, 0.8]",
        "domain.boundary.z=periodic",
    ],
)  # fmt: skip
SITES = {"open_arrival", "side_velocity", "side_pressure"}  # stages over sites of inlets and outlets, a warp each
EXPECTED = {  # the stages with lanes of a step, of those that the scenes before it do not have
    "two fluids": {"continuity", "momentum", "wall_state", *INTERFACES},
    "unlike viscosities": {"interface_gradient"},
    "three fluids": {"continuity", "momentum", *PHASES},
    "friction in stages": {"viscous_stage"},
    "free surface": {"continuity", "momentum", "surface_room"},
    "delta-plus": {"continuity", "momentum"},
    "gas": {"density", "gradient", "forces"},
    "inlet and outlet": {"open_arrival"},
    "inlet and outlet, ISPH": {"side_velocity", "side_pressure"},
}


def quiet(name: str, changes: list[str]) -> warpsph.Case:
    """A shipped case that measures and writes nothing, in double precision."""
    kept = ["precision=float64", "gauges={}", "reference={}", "validation={}", "output={particles: none, checkpoint: none}"]
    return warpsph.load_case(f"cases/{name}.yaml", [*kept, *changes])


@pytest.mark.parametrize("row_list", [False, True], ids=["columns", "rows"])
@pytest.mark.parametrize("lanes", [1, 2, 4, 8, 16, 32])
def test_every_neighbour_belongs_to_one_lane(lanes, row_list, device):
    particle_of, lane_of, part_of = make_lanes(lanes)
    access = make_entry(row_list)
    list_begin, list_step, read, List = access.begin, access.step, access.read, access.array
    rows, width = len(COUNTS), max(COUNTS)

    @wp.kernel(module="unique", enable_backward=False)
    def collect(entries: List, counts: wp.array(dtype=int), width: int, seen: wp.array2d(dtype=int)):
        t = wp.tid()
        i, lane = particle_of(t), lane_of(t)
        begin, stride = list_begin(i, width), list_step(counts.shape[0])
        end = begin + counts[i] * stride
        k, step = part_of(begin, stride, lane)
        while k < end:
            wp.atomic_add(seen, i, read(entries, i, k), 1)
            k += step

    table = np.tile(np.arange(width), (rows, 1))
    entries = wp.array((table if row_list else table.T).ravel().copy(), dtype=int, device=device)
    seen = wp.zeros((rows, width), dtype=int, device=device)
    counts = wp.array(COUNTS, dtype=int, device=device)
    wp.launch(collect, dim=rows * lanes, inputs=[entries, counts, width, seen], device=device)
    assert seen.numpy().tolist() == [[int(n < count) for n in range(width)] for count in COUNTS]


@pytest.mark.parametrize("lanes", [0, 3, 64])
def test_lanes_are_a_power_of_two_of_a_warp(lanes):
    with pytest.raises(ValueError, match=f"lanes: {lanes} is no power of two up to 32"):
        make_lanes(lanes)


@pytest.mark.parametrize("lanes", [1, 2, 4, 8, 16, 32])
@pytest.mark.parametrize("precision", [wp.float32, wp.float64])
def test_sums_and_largest_over_lanes(lanes, precision, device):
    """Of whole numbers, exact in any order; 257 rows, so that the last warp is not full."""
    if device == "cpu" and lanes > 1:
        pytest.skip("a CPU has one lane")
    rows = 257
    vec, mat = wp.types.vector(length=3, dtype=precision), wp.types.matrix(shape=(2, 3), dtype=precision)
    added, added_vec, added_mat = (make_added(lanes, dtype) for dtype in (precision, vec, mat))
    largest = make_largest(lanes, precision)
    particle_of, lane_of, _ = make_lanes(lanes)

    @wp.kernel(module="unique", enable_backward=False)
    def add(
        values: wp.array(dtype=precision),
        sums: wp.array(dtype=precision),
        vectors: wp.array(dtype=vec),
        matrices: wp.array(dtype=mat),
        most: wp.array(dtype=precision),
    ):
        t = wp.tid()
        i, lane = particle_of(t), lane_of(t)
        if i % 5 == 3:  # rows may leave as a whole
            return
        x = values[t]
        total, total_vec = added(x), added_vec(vec(x, precision(2.0) * x, -x))
        total_mat = added_mat(mat(x, x, x, precision(3.0) * x, x, x))
        top = largest(x)
        if lane > 0:
            return
        sums[i] = total
        vectors[i] = total_vec
        matrices[i] = total_mat
        most[i] = top

    x = np.random.default_rng(7).integers(-1000, 1000, rows * lanes).astype(float)
    arrays = [wp.zeros(rows, dtype=dtype, device=device) for dtype in (precision, vec, mat, precision)]
    values = wp.array(x, dtype=precision, device=device)
    wp.launch(add, dim=rows * lanes, inputs=[values, *arrays], device=device)
    table = x.reshape(rows, lanes) * (np.arange(rows) % 5 != 3)[:, None]
    total, largest_of = table.sum(axis=1), table.max(axis=1)
    sums, vectors, matrices, most = (array.numpy() for array in arrays)
    assert np.array_equal(sums, total) and np.array_equal(most, largest_of)
    assert np.array_equal(vectors, total[:, None] * [1, 2, -1])
    assert np.array_equal(matrices, total[:, None, None] * [[1, 1, 1], [3, 1, 1]])


@pytest.mark.parametrize(
    ("changes", "count", "lanes"),
    [
        ({}, 5_000, 8), ({}, 16_896, 8), ({}, 16_897, 4), ({}, 33_793, 2), ({}, 67_585, 1), ({}, 10**6, 1),
        ({"multiphase": True}, 33_792, 8), ({"multiphase": True}, 33_793, 4), ({"multiphase": True}, 135_168, 4),
        ({"multiphase": True}, 135_169, 2), ({"multiphase": True}, 10**6, 1),
        ({"varying_h": True}, 135_168, 4), ({"varying_h": True, "dimension": 1}, 1_000, 1),
        ({"dimension": 3}, 33_792, 8), ({"dimension": 3}, 33_793, 4), ({"dimension": 3}, 405_504, 4),
        ({"dimension": 3, "multiphase": True}, 405_505, 2), ({"dimension": 3}, 10**7, 2),
        ({"dimension": 1}, 100, 1),
    ],
)  # fmt: skip
def test_how_many_lanes(changes, count, lanes):
    """Of 132 multiprocessors: 1 024 threads each, 4 times that with several phases or in a gas, 12 times in 3-D."""
    assert lanes_for(dataclasses.replace(PLAIN, **changes), count, 132) == lanes


def test_a_launch_has_the_lanes_of_its_kernel(monkeypatch):
    """On a GPU a task over rows starts as many threads as these have lanes, also when their number changes."""

    @wp.kernel(module="unique", enable_backward=False)
    def count(first: int):
        wp.tid()

    sizes = []
    command = SimpleNamespace(set_dim=sizes.append, launch=lambda: None)
    monkeypatch.setattr(wp, "launch", lambda kernel, dim, **_: sizes.append(dim) or command)
    launcher = Launcher(SimpleNamespace(is_cpu=False))
    launcher.task("count", count, 100, Bindings("cpu", {})).resize(7)
    launcher.task("count", shared(count, dataclasses.replace(PLAIN, lanes=4)), 100, Bindings("cpu", {})).resize(7)
    assert sizes == [100, 7, 400, 28]


def stages_of(model: Model, lanes: int) -> dict[str, Stage]:
    """The stages of a step by name, as a GPU has them with so many lanes."""
    spec = dataclasses.replace(model.physics.spec, row_list=False, few=True, lanes=lanes)
    nodes = walk(model.scheme.program(spec, model.physics.choices).step)
    return {node.name: node for node in nodes if isinstance(node, Stage)}


@pytest.mark.parametrize("scene", EXPECTED)
def test_sweeps_are_compiled_with_lanes(scene, tmp_path):
    """For a GPU, which is not needed for that: each sweep exchanges numbers where it says that it has lanes."""
    model = Model(quiet(*SCENES[scene]), threads=1)
    assert all(threads_of(stage.kernel) == (32 if name in SITES else 1) for name, stage in stages_of(model, 1).items())
    swept = {name: stage.kernel for name, stage in stages_of(model, 8).items() if threads_of(stage.kernel) > 1}
    assert EXPECTED[scene] <= set(swept)
    assert all(threads_of(kernel) == (32 if name in SITES else 8) for name, kernel in swept.items())
    for name in EXPECTED[scene]:
        folder = tmp_path / name
        wp.compile_aot_module(swept[name].module, device=None, arch=80, module_dir=folder, use_ptx=True, strip_hash=True)
        (code,) = folder.glob("*.ptx")
        assert "shfl.sync" in code.read_text(), name


@pytest.mark.cuda
@pytest.mark.parametrize("scene", ["inlet and outlet", "inlet and outlet, ISPH", "inlet and outlet, 3-D"])
def test_sites_see_the_same_with_a_thread_and_with_a_warp(scene, device):
    """The fit at inlets and outlets, of uneven particles, by one thread a site and by 32: all sums agree to rounding."""
    model = Model(quiet(*SCENES.get(scene, OPEN_3D)), device=device)
    model.stepper.prepare(fresh=True)
    model.stepper.run(1.0e9, 20)
    level = model.stepper.levels[0]
    make, fields = make_arrival, ["site_arrival", "face_pressure", "face_velocity", "face_stretch"]
    if scene.endswith("ISPH"):
        make, fields = make_side_pressure, ["face_pressure"]
    rows, found = level.bindings["site_side"].shape[0], []
    for row_list, lanes in ((True, 1), (False, 32)):
        kernel = make(dataclasses.replace(level.spec, row_list=row_list))
        assert threads_of(kernel) == lanes
        level.launcher.task("sites", kernel, rows, level.bindings, special={"beginning": 1}).run()
        found.append({name: level.bindings[name].numpy().view(np.float64) for name in fields})
    for name, alone in found[0].items():
        assert np.abs(alone).max() > 0.0 or name == "face_stretch"
        assert np.abs(found[1][name] - alone).max() <= 1.0e-12 * max(np.abs(alone).max(), 1.0e-3), name


@pytest.mark.cuda
@pytest.mark.parametrize("lanes", [2, 4, 8])
@pytest.mark.parametrize("scene", SCENES)
def test_lanes_change_rounding_alone(scene, lanes, monkeypatch, device):
    """Forty steps in double precision: rounding grows to less than 1e-9 of the largest value of each field."""
    states = []
    for count in (1, lanes):
        monkeypatch.setattr("warpsph.running.model.lanes_for", lambda *_, count=count: count)
        model = Model(quiet(*SCENES[scene]), device=device)
        assert model.physics.spec.lanes == count
        model.stepper.prepare(fresh=True)
        model.stepper.run(1.0e9, 40)
        order = np.argsort(model.particles.get("particle_id"))
        states.append({name: model.particles.get(name)[order] for name in ("position", "velocity", "state")})
    for name, before in states[0].items():
        assert np.abs(states[1][name] - before).max() <= 1.0e-9 * np.abs(before).max(), name
