"""The script that compares the curvature of a wave's particles with its amplitude."""

import numpy as np
import pytest
import pyvista as pv

from scripts.wave_curvature import cosine_of_curvature, offsets


def test_the_cosine_is_found_on_both_sides():
    """The curvature of the upper phase has the other sign; particles without a normal do not count."""
    x = (np.arange(200) + 0.5) / 200
    frame = pv.PolyData(np.column_stack([x, 0.01 * (-1.0) ** np.arange(200), 0 * x]))
    frame["phase"] = np.arange(200) % 2
    frame["curvature"] = np.where(frame["phase"] == 0, 1, -1) * (0.7 * np.cos(2 * np.pi * x) + 0.2 * np.sin(2 * np.pi * x))
    frame["normal"] = np.column_stack([0 * x, np.ones(200), 0 * x])
    assert cosine_of_curvature(frame) == pytest.approx(0.7)
    frame["normal"][::5] = 0
    frame["curvature"][::5] = 99
    assert cosine_of_curvature(frame) == pytest.approx(0.7, abs=0.01)


def test_a_short_run():
    """At the start the curvature is that of the cosine, to 10 % with 16 spacings."""
    rows = offsets(16, 0.25, {})
    assert rows[-1][0] == pytest.approx(0.25, rel=1e-3) and rows[-1][1] == pytest.approx(0.0195, rel=0.05)
    assert abs(rows[-1][2]) < 0.1 * (2 * np.pi) ** 2 * rows[-1][1]
