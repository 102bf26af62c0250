"""The first row of fluid before the wall of a body is evened as the fluid behind it is (theory: riemann#bodies)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

import warpsph
from warpsph.running.model import Model

PLATE = 0.8  # m, where its face is
TANK: dict[str, Any] = {
    "title": "still water with a plate along a side",
    "dimension": 2,
    "particle_spacing": 0.05,
    "end_time": 1.0,
    "domain": {"lower": [0, 0], "upper": [1, 1.2], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
    "gravity": [0, -9.81],
    "phases": {"water": {"density": 1000, "viscosity": 0}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 1]}}}],
    "bodies": {"plate": {"shape": {"polygon": {"points": [[PLATE, -0.2], [1.1, -0.2], [1.1, 1.4], [PLATE, 1.4]]}}}},
    "start": {"pressure": "hydrostatic"},
    "output": {"particles": "none", "checkpoint": "none"},
}


def left_over(tank: dict[str, Any], side: float) -> NDArray[np.float64]:
    """How much is left, after steps 1 to 4, of a pressure that one row alone has, `side` metres from the wall at x = 0.8."""
    case = warpsph.load_case(tank)
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    n = model.particles.fluid_count
    x = model.particles.get("position")[:n]
    rest = model.particles.get("density_excess")
    row = (np.abs(x[:, 0] - (PLATE - side)) < 0.01) & (np.abs(x[:, 1] - 0.5) < 0.26)
    assert row.sum() == 10
    wave = np.where(row, 1.0e-3, 0.0)
    pushed = rest.copy()
    pushed[:n] += wave.astype(rest.dtype)
    model.particles.put("density_excess", pushed)
    left = []
    for step in range(1, 5):
        model.stepper.run(1.0, step)
        change = model.particles.get("density_excess")[:n] - rest[:n]
        left.append(float(change @ wave / (wave @ wave)))
    return np.array(left)


def test_a_pressure_of_the_first_row_is_evened() -> None:
    """Before a body a row that differs from the next comes to their mean as before a wall of cells, within a tenth.

    Cells take no part in pressure differences; the velocities mirrored in a body are a little different. With a part of the
    body's walls, whose pressures are continued from the row itself, 0.50, -0.44 are left after steps 2, 3; cells leave
    0.12, -0.13.
    """
    water = TANK["fluids"][0]["shape"]["box"]
    box = {"lower": water["lower"], "upper": [PLATE, water["upper"][1]]}
    cells = {
        **{key: value for key, value in TANK.items() if key != "bodies"},
        "domain": {**TANK["domain"], "upper": [PLATE, 1.2]},
        "fluids": [{"phase": "water", "shape": {"box": box}}],
    }
    half_row = 0.5 * TANK["particle_spacing"]
    assert np.abs(left_over(TANK, half_row) - left_over(cells, half_row)).max() < 0.1
