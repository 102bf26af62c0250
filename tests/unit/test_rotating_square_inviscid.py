"""`scripts/rotating_square_inviscid.py`: the straight line in 1/Re that leads to a liquid without friction."""

import numpy as np
import pytest

from tests.scripts import load_script


@pytest.fixture(scope="module")
def script():
    return load_script("rotating_square_inviscid")


def test_line_is_exact_for_what_is_linear_in_friction(script):
    """a + b/Re has the limit a, and a + b/2000 at Re = 2 000, component by component."""
    a, b = np.array([1.0, -2.0]), np.array([300.0, 50.0])
    ends = (1000.0, 3000.0)
    values = (a + b / ends[0], a + b / ends[1])
    np.testing.assert_allclose(script.along_line(ends, values, 0.0), a, rtol=1e-12)
    np.testing.assert_allclose(script.along_line(ends, values, 1 / 2000), a + b / 2000, rtol=1e-12)


def test_tables_of_the_outer_runs_are_continued(script, tmp_path):
    """Times, which both runs share, stay; the middle run takes no part."""
    runs = []
    for number in script.REYNOLDS:
        folder = tmp_path / f"re{number:g}"
        folder.mkdir()
        odd = 5.0 if number == script.REYNOLDS[1] else 0.0
        rows = [[0.0, 1.0 + odd], [0.5, 2.0 + 700 / number + odd]]
        np.savetxt(folder / "centre.csv", rows, delimiter=",", header="omega_t,p", comments="")
        runs.append(folder)
    found = script.continued(runs, "centre.csv", 0.0)
    np.testing.assert_allclose(found, [[0.0, 1.0], [0.5, 2.0]], rtol=1e-12)
