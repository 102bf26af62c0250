"""The start of `scripts/small_waves.py` is a wave: its energies are those of theory, and its volume that of still water."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from warpsph.running.model import Model

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "small_waves.py"


@pytest.fixture(scope="module")
def waves():
    spec = importlib.util.spec_from_file_location("small_waves", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_travelling_wave_starts_with_the_energies_of_theory(waves):
    """Both are rho g A^2/4 a length, but for the square of kA and of the spacing."""
    height = 0.0425
    case = waves.case_of("isph", 82, height, False, ["numerics.maximum_step=0.005"])
    assert case.numerics.maximum_step == 0.005
    depth = round(waves.DEPTH / case.spacing) * case.spacing
    model = Model(case, device="cpu", threads=1)
    _, still = waves.energies(model, case.spacing)
    count = model.geometry.fluid_count
    x, y = model.particles.get("position")[:count].astype(float).T
    order = np.lexsort((np.floor(y / case.spacing), np.floor(x / case.spacing)))  # column by column
    waves.displace(model, height, depth)
    kinetic, potential = waves.energies(model, case.spacing)
    expected = waves.DENSITY * waves.GRAVITY * height**2 / 4 * waves.LENGTH
    within = (waves.WAVE_NUMBER * height) ** 2
    assert kinetic / expected == pytest.approx(1.0, abs=within)
    assert (potential - still) / expected == pytest.approx(1.0, abs=within)
    # the rows stay rows: areas of the cells of the lattice change by the cube of kA
    grid = model.particles.get("position")[:count].astype(float)[order].reshape(82, -1, 2)
    along, up = (np.gradient(grid, case.spacing, axis=axis)[1:-1, 1:-1] for axis in (0, 1))
    area = along[..., 0] * up[..., 1] - along[..., 1] * up[..., 0]
    assert np.abs(area - 1.0).max() < within**1.5


def test_a_standing_wave_starts_flat_with_all_of_its_energy_in_motion(waves):
    case = waves.case_of("riemann", 41, 0.02, True, [])
    model = Model(case, device="cpu", threads=1)
    kinetic, _ = waves.energies(model, case.spacing)
    expected = waves.DENSITY * waves.GRAVITY * 0.02**2 / 4 * waves.LENGTH
    assert kinetic / expected == pytest.approx(1.0, abs=0.01)
