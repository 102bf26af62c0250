"""Stiffness of a lattice under pressure (docs/records/formulation.md#lattice), scripts/lattice_stiffness.py."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.core.smoothing import make_smoothing

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def script():
    loaded = importlib.util.spec_from_file_location("lattice_stiffness", ROOT / "scripts/lattice_stiffness.py")
    module = importlib.util.module_from_spec(loaded)
    loaded.loader.exec_module(module)
    return module


@pytest.mark.parametrize("kind", ["square", "hexagonal"])
def test_stiffness_is_what_the_forces_of_pairs_do(script, kind):
    """kappa from n against the work of the pairs' forces under equal pressure, w'(r)/r (x^2 - y^2) for a strain (e, -e)."""
    ratio, strain = 1.5, 1e-3
    shape, slope = make_smoothing("wendland_c2", "float64")
    places = script.lattice(kind, 2.2 * ratio)

    def pull(e):
        x, y = (places * [np.exp(e), np.exp(-e)]).T / ratio
        return sum(float(slope(wp.float64(q))) * d for q, d in zip(np.hypot(x, y), x * x - y * y, strict=True))

    crowd = sum(float(shape(wp.float64(q))) for q in np.hypot(*places.T) / ratio)
    work = (pull(strain) - pull(-strain)) / (2 * strain) / (4 * crowd)
    assert script.stiffness("wendland_c2", ratio, kind)[0] == pytest.approx(work, rel=0.02)


def test_a_hexagonal_lattice_is_alike_in_all_directions(script):
    found = script.stiffness("wendland_c2", 2.0, "hexagonal")
    assert np.ptp(found) < 0.02 * abs(found.mean())
    assert np.ptp(script.stiffness("wendland_c2", 1.5, "square")) > 0.02


def test_a_wide_kernel_measures_a_gradient_as_it_is(script):
    """Sums of a wide smooth kernel over a lattice are its integrals; the usual kernel in 2-D measures 0.26 % too little."""
    assert abs(script.gradient("quintic", 2.0, "square")) < 1e-5
    assert script.gradient("wendland_c2", 1.5, "square") == pytest.approx(-0.0026, abs=5e-5)
