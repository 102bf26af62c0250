"""scripts/curvature_error.py: the constants that the tension kernels have from it, and a limit known exactly."""

import importlib.util
from pathlib import Path

import pytest

from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.riemann.interface import BEND

PATH = Path(__file__).parents[2] / "scripts" / "curvature_error.py"
loaded = importlib.util.spec_from_file_location("curvature_error", PATH)
curvature_error = importlib.util.module_from_spec(loaded)
loaded.loader.exec_module(curvature_error)


@pytest.mark.parametrize("kernel", list(KERNELS))
def test_the_constants_are_those_of_the_script(kernel):
    for form, stored in zip(curvature_error.FORMS, BEND[kernel], strict=True):
        if form == "cylinder" and kernel not in ("wendland_c2", "quintic"):
            continue  # the slowest of the three integrals
        found = curvature_error.Interface(kernel, form, points=28).curvatures()[1]
        assert found == pytest.approx(stored, abs=0.01)


def test_a_gaussian_has_twice_and_two_and_a_half_times_its_variance():
    """Exact for a Gaussian that is not cut, all means of which are Gaussian; this one is cut at 3 h."""
    v = KERNELS["gaussian"].variance
    for form, factor, variance in (("circle", 2.0, v[1]), ("sphere", 2.5, v[2])):
        assert curvature_error.Interface("gaussian", form).curvatures()[1] == pytest.approx(factor * variance, rel=0.015)
