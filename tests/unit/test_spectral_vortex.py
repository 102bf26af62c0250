"""`scripts/spectral_vortex.py`: what a pseudo-spectral solution of a vortex has to hold."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "spectral_vortex.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("spectral_vortex", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_slow_flow_dies_as_its_waves_do(script):
    """The start has |k|^2 = 3: exp(-6 nu t) of its energy is left where friction is all there is."""
    start, end = script.energies(8, 5.0, 1.0)
    assert start == (0.0, pytest.approx(0.125))
    assert end == (pytest.approx(1.0), pytest.approx(0.125 * np.exp(-30), rel=1e-2))


def test_without_friction_energy_stays(script):
    """The rotation form keeps it, cut off modes or not, but for the fourth order of the steps."""
    assert script.energies(16, 0.0, 2.0)[-1][1] == pytest.approx(0.125, rel=1e-6)


def test_stretching_costs_energy(script):
    """By the series of Taylor and Green in t, Re = 100: more than friction of the start alone, 0.2 per cent after 1 s.

    d/dt of the energy is -2 nu times the enstrophy, whose second derivative by stretching is 5/24 of its start value at
    t = 0 (Brachet et al. 1983): 1 + 5 t^2/48 without friction, so that energy lacks 2 nu 3/8 (5/144) t^3 more.
    """
    found = script.energies(16, 0.01, 1.0)[-1][1]
    plain = 0.125 * np.exp(-0.06)
    assert found - plain == pytest.approx(-2 * 0.01 * 3 / 8 * 5 / 144, rel=0.2)
