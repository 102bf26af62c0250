"""Walls that fluid slides along are smooth, however their particles lie (docs/theory/riemann.md#smooth)."""

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

import warpsph
from tests.helpers import quiet_warp
from warpsph.kernels.core.planes import make_cell_faces
from warpsph.running.model import Model

quiet_warp()

CASES = Path(__file__).resolve().parents[2] / "cases"
QUIET = ["output={particles: none, checkpoint: none}"]
SPACING = 1 / 40
SPEED = 0.1
# water without friction that slides on a floor, a quarter of a metre deep
STREAM: dict[str, Any] = {
    "dimension": 2,
    "particle_spacing": SPACING,
    "end_time": 1,
    "gravity": [0, -9.81],
    "domain": {
        "lower": [0, 0],
        "upper": [0.5, 0.5],
        "boundary": {"x": "periodic", "y": {"lower": "free_slip", "upper": "open"}},
    },
    "phases": {"water": {"density": 1000}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.5, 0.25]}}}],
    "start": {"velocity": [SPEED, 0], "pressure": "hydrostatic"},
    "numerics": {"scheme": "riemann", "unlock": 0},
}
FLOOR = [
    "domain.lower=[0, -0.1]",
    "domain.boundary.y=open",
    "bodies={floor: {shape: {box: {lower: [-0.5, -0.2], upper: [1.0, 0]}}, wall: free_slip}}",
]
CUBE = [
    "dimension=3",
    "gravity=[0, 0, -9.81]",
    "domain.lower=[0, 0, 0]",
    "domain.upper=[0.25, 0.2, 0.4]",
    "domain.boundary={x: periodic, y: periodic, z: {lower: free_slip, upper: open}}",
    "fluids=[{phase: water, shape: {box: {lower: [0, 0, 0], upper: [0.25, 0.2, 0.2]}}}]",
    f"start.velocity=[{SPEED}, {SPEED / 2}, 0]",
]


def begun(case: dict[str, Any], changes: list[str]) -> Model:
    """Return the model of a case before its first step."""
    model = Model(warpsph.load_case(copy.deepcopy(case), [*changes, *QUIET]), threads=1)
    model.stepper.prepare(fresh=True)
    return model


@pytest.mark.parametrize("changes", [[], FLOOR, CUBE], ids=["cells", "body", "3-D"])
def test_water_slides_on_a_floor_as_it_comes(changes):
    """Nothing holds it: not where its rows are to those of the floor, on the way of more than a spacing."""
    model = begun(STREAM, changes)
    for _ in range(10):
        model.stepper.run(model.time + 0.15 * SPACING / SPEED, 10**9)
        v = model.particles.get("velocity")[: model.geometry.fluid_count].astype(float)
        assert np.abs(v[:, 0] - SPEED).max() < 0.01 * SPEED


@pytest.mark.parametrize(("changes", "floor"), [([], "domain"), (FLOOR, "floor")], ids=["cells", "body"])
def test_the_gauge_of_a_floor_has_what_the_fluid_feels(changes, floor):
    """A quarter of a spacing beside the floor's particles: with all of the pairs 9e-4 of the weight, to one side.

    What is left is the part of pressure differences over a spacing, a tenth of that.
    """
    model = begun(STREAM, [*changes, "gauges={force: {type: wall_force, interval: 0.01}}"])
    model.stepper.run(0.25 * SPACING / SPEED, 10**9)
    forces = model.wall_forces()
    assert forces[f"wall_force_y {floor}"] == pytest.approx(-9.81 * 1000 * 0.5 * 0.25, rel=0.02)
    assert abs(forces[f"wall_force_x {floor}"]) < 3e-4 * abs(forces[f"wall_force_y {floor}"])


@pytest.mark.parametrize("changes", [[], FLOOR], ids=["cells", "body"])
def test_rows_above_a_floor_move_with_the_wave(changes):
    """Half a period of a standing wave, so low that no particle goes half a spacing: rows are not held by the floor.

    Held by it the lowest row came out at -1.1 and the fourth at 2.1 times what theory says of them (0.9 and 1.2 now).
    """
    k, depth, height = 2.0 * math.pi, 0.25, 0.005
    omega = math.sqrt(9.81 * k * math.tanh(k * depth))
    speed = height * omega / math.sinh(k * depth)
    start = [f"-{speed}*sin({k}*x)*cosh({k}*y)", f"{speed}*cos({k}*x)*sinh({k}*y)"]
    tank = ["domain.upper=[1, 0.5]", "fluids.0.shape={box: {lower: [0, 0], upper: [1, 0.25]}}"]
    model = begun(STREAM, [*changes, *tank, f"start.velocity={start}"])
    order = np.argsort(model.particles.get("particle_id")[: model.geometry.fluid_count])
    x = model.particles.get("position")[order].astype(float)
    model.stepper.run(math.pi / omega, 10**9)
    order = np.argsort(model.particles.get("particle_id")[: model.geometry.fluid_count])
    u = model.particles.get("velocity")[order, 0].astype(float)
    for row in range(4):
        here = np.abs(x[:, 1] - (row + 0.5) * SPACING) < 0.1 * SPACING
        assert here.sum() == 40
        wave = np.sin(k * x[here, 0])
        found = (u[here] * wave).sum() / (wave**2).sum()
        assert found == pytest.approx(speed * math.cosh(k * (row + 0.5) * SPACING), rel=0.3)


@pytest.mark.parametrize(
    ("cells", "plane"),
    [
        ([(i, -1) for i in range(-2, 4)], [1, 0]),  # a floor, the particle above any place of it
        ([(i, -1) for i in range(-2, 4)] + [(i, -2) for i in range(-2, 3)], [1, 0]),
        ([(i, -1) for i in range(-2, 2)], [0, 0]),  # it ends near by
        ([(i, -1) for i in range(-2, 4)] + [(3, j) for j in range(0, 3)], [0, 0]),  # a corner
        ([(2, -2), (3, -2), (2, -3)], [0, 0]),  # the edge of a block: nothing is straight ahead
        ([(-2, j) for j in range(-2, 4)], [0, 1]),
        ([], [0, 0]),
    ],
)
def test_where_cells_are_a_plane(cells, plane):
    """Cells of the spacing 1 around a particle that is a third beside and above one of them."""
    faces = make_cell_faces(2, "float64")
    before, along = faces.before, faces.along

    @wp.kernel(module="unique", enable_backward=False)
    def apply(cell: wp.array(dtype=wp.vec2d), out: wp.array(dtype=wp.vec2d)):
        ahead, low, high = wp.vec2d(), wp.vec2d(), wp.vec2d()
        for n in range(cell.shape[0]):
            ahead = wp.max(ahead, before(cell[n], wp.float64(0.5)))
            low, high = wp.min(low, cell[n]), wp.max(high, cell[n])
        out[0] = along(ahead, low, high, wp.float64(1.0))

    out = wp.zeros(1, dtype=wp.vec2d, device="cpu")
    places = wp.array(np.array(cells, dtype=float).reshape(-1, 2) - 1 / 3, dtype=wp.vec2d, device="cpu")
    wp.launch(apply, dim=1, inputs=[places, out], device="cpu")
    assert out.numpy()[0].tolist() == plane


def test_a_round_wall_is_no_plane():
    """What its particles do along themselves adds up to nothing around the drum: the angular momentum stays."""
    changes = ["numerics.scheme=riemann", "particle_spacing=1/50", "reference={}", "validation={}"]
    case = warpsph.load_case(CASES / "turning_ring.yaml", [*changes, *QUIET])
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)

    def momentum() -> float:
        fluid = model.snapshot().fluid
        x, v = fluid.position.astype(float), fluid.velocity.astype(float)
        return float((fluid.mass * (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])).sum())

    start = momentum()
    model.stepper.run(0.2, 10**9)
    assert momentum() == pytest.approx(start, rel=3e-5)
