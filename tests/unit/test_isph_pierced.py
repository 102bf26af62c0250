"""Bodies that stand out of a free surface in projection ISPH: water at rest stays at rest (theory: isph#wetness)."""

from typing import Any

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.running.model import Model

HEIGHT = 0.8  # of the water [m]
PACE = np.sqrt(9.81 * HEIGHT)
BLOCK = {"box": {"lower": [0.4, 0.4], "upper": [0.8, 1.1]}}
CYLINDER = {"sphere": {"center": [0.6, HEIGHT], "radius": 0.25}}
LEVEL = {"box": {"lower": [0.4, 0.0], "upper": [0.8, HEIGHT]}}
HULL = {"polygon": {"points": [[0.3, 1.15], [0.6, 0.35], [0.9, 1.15]]}}


OTHERS = {  # of the table in docs/records/bodies_isph.md#pierced
    "block": BLOCK,
    "off": {"box": {"lower": [0.413, 0.427], "upper": [0.79, 1.1]}},
    "cylinder": CYLINDER,
    "hull": HULL,
    "beach": {"polygon": {"points": [[0.5, 0], [1.2, 0], [1.2, 1.1], [1.1, 1.1]]}},
    "plate": {"box": {"lower": [0.55, 0.3], "upper": [0.65, 1.1]}},
}


def tank(
    body: dict[str, Any],
    until: float,
    wall: str = "free_slip",
    dimension: int = 2,
    device: str = "cpu",
    steps: int = 10**6,
    per_metre: int = 0,
    viscosity: float = 0.001,
) -> Model:
    """Return water at rest with a body that stands out of it, after some time or some steps.

    per_metre: spacings of a metre; 0: 20 in 2-D, 10 in 3-D.
    """
    sides = {"x": "free_slip", "y": {"lower": "free_slip", "upper": "open"}}
    low, high = [0.0, 0.0], [1.2, 1.2]
    water = [1.2, HEIGHT]
    if dimension == 3:
        sides = {"x": "free_slip", "y": "free_slip", "z": {"lower": "free_slip", "upper": "open"}}
        low, high, water = [0.0, 0.0, 0.0], [1.2, 1.2, 1.2], [1.2, 1.2, HEIGHT]
    case = Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": 1.0 / (per_metre or (20 if dimension == 2 else 10)),
            "end_time": until,
            "domain": {"lower": low, "upper": high, "boundary": sides},
            "gravity": [*([0.0] * (dimension - 1)), -9.81],
            "phases": {"water": {"density": 1000, "viscosity": viscosity}},
            "fluids": [{"phase": "water", "shape": {"box": {"lower": low, "upper": water}}}],
            "bodies": {"body": {"shape": body, "wall": wall}},
            "start": {"pressure": "hydrostatic"},
            "numerics": {"scheme": "isph"},
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )
    model = Model(case, threads=1, device=device)
    model.stepper.prepare(fresh=True)
    model.stepper.run(until, steps)
    return model


def speeds(model: Model) -> np.ndarray:
    """Speeds of the fluid over that of a wave."""
    return np.linalg.norm(model.snapshot().fluid.velocity, axis=1) / PACE


def test_water_at_rest_beside_a_block_that_is_level_with_it_stays_at_rest() -> None:
    """Its edge has a leader that looks up, where no fluid is."""
    assert speeds(tank(LEVEL, 0.5)).max() < 1e-5


def show(name: str, per_metre: int) -> None:
    """Print rms and largest speed after 3 s without friction, the figures of docs/records/bodies_isph.md#pierced."""
    found = speeds(tank(OTHERS[name], 3.0, per_metre=per_metre, viscosity=0.0))
    print(f"{name} {per_metre}: {np.sqrt((found**2).mean()):.2g}, {found.max():.2g}")


@pytest.mark.parametrize("wall", ["free_slip", "no_slip"])
def test_water_at_rest_around_a_block_stays_at_rest(wall: str, device: str) -> None:
    """Rounding is all that moves it. What stood above the surface counted as fluid: 0.1 after 3 s, on any spacing."""
    assert speeds(tank(BLOCK, 0.5, wall, device=device)).max() < 1e-5


def test_water_at_rest_around_a_column_stays_at_rest_in_three_dimensions(device: str) -> None:
    column = {"box": {"lower": [0.4, 0.4, 0.4], "upper": [0.8, 0.8, 1.1]}}
    assert speeds(tank(column, 0.5, dimension=3, device=device)).max() < 1e-5


@pytest.mark.parametrize("body", [CYLINDER, HULL])
def test_water_around_a_body_of_any_shape_comes_to_rest(body: dict[str, Any]) -> None:
    """Particles start uneven beside it and settle: rms of 2e-3 and less after 3 s, where 1.3e-2 and more ran on for ever."""
    assert np.sqrt((speeds(tank(body, 3.0)) ** 2).mean()) < 4e-3


def test_a_wall_is_dry_above_the_surface_and_wet_below() -> None:
    model = tank(BLOCK, 0.01)
    fluid = model.geometry.fluid_count
    height = model.particles.get("position")[fluid:, 1]
    wet = model.particles.get("wetness")
    assert (wet[height < HEIGHT - 0.01] == 1.0).all()
    assert (wet[height > HEIGHT + 0.01] == 0.0).all()


def test_the_surface_beside_a_wall_is_that_of_the_rest() -> None:
    """Normal and depth of its last particle before the wall; they were 20 degrees and 0.9 rows off."""
    model = tank(BLOCK, 0.001)
    count = model.geometry.fluid_count
    x = model.particles.get("position")[:count]
    row = x[:, 1] > HEIGHT - 0.04
    assert (model.particles.get("surface")[:count][row] == 1).all()
    normal = model.particles.get("surface_normal")[:count][row]
    assert np.abs(normal - [0.0, 1.0]).max() < 1e-3
    assert model.particles.get("spread_depth")[:count][row] == pytest.approx(1.0, abs=1e-3)
    assert model.particles.get("pressure")[:count][row] == pytest.approx(1000 * 9.81 * 0.025, rel=1e-3)


def test_a_restart_goes_on_bit_by_bit() -> None:
    """What is wet follows from where the surface of the body was in the last step."""
    model = tank(CYLINDER, 1.0, steps=7)
    saved = model.save_state()
    model.stepper.run(1.0, 20)
    other = tank(CYLINDER, 1.0, steps=1)
    for name in ("beside", "wall_gap"):
        other.particles.put(name, np.zeros_like(other.particles.get(name)))
    other.load_state(saved)
    other.stepper.run(1.0, 20)
    for name in ("velocity", "position", "wetness"):
        assert np.array_equal(model.particles.get(name), other.particles.get(name)), name
    assert 0.0 < model.particles.get("wetness").mean() < 1.0
