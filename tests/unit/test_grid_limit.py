"""scripts/grid_limit.py: means over a window, order and limit of three grids."""

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = runpy.run_path(str(ROOT / "scripts/grid_limit.py"))


@pytest.mark.parametrize("order", [0.76, 1.0, 2.0])
def test_a_power_of_the_spacing_is_found(order):
    means = tuple(3.0 - 0.5 * h**order for h in (1.0, 0.5, 0.25))
    assert SCRIPT["limit"](means) == pytest.approx((order, 3.0), rel=1e-12)


@pytest.mark.parametrize("means", [(1.0, 2.0, 3.0), (1.0, 2.0, 1.5), (1.0, 2.0, 2.0)])
def test_what_does_not_settle_has_no_limit(means):
    assert all(math.isnan(number) for number in SCRIPT["limit"](means))


def test_the_mean_is_that_of_straight_lines_between_the_rows(tmp_path):
    (tmp_path / "curve.csv").write_text("t,v\n0,0\n1,2\n2,nan\n3,0\n")
    curve = f"{tmp_path / 'curve.csv'}:t:v"
    assert SCRIPT["mean_of"](curve, (0.5, 2.0)) == pytest.approx((0.5 * 1.5 + 1.5) / 1.5)
    for window in ((-1.0, 2.0), (2.0, 4.0), (2.0, 1.0)):
        with pytest.raises(ValueError, match="--window"):
            SCRIPT["mean_of"](curve, window)
    (tmp_path / "empty.csv").write_text("t,v\n")
    with pytest.raises(ValueError, match="has no rows"):
        SCRIPT["mean_of"](f"{tmp_path / 'empty.csv'}:t:v", (0.0, 1.0))
    with pytest.raises(ValueError, match="no column w; take one of t, v"):
        SCRIPT["mean_of"](f"{tmp_path / 'curve.csv'}:t:w", (0.0, 1.0))


def test_the_case_has_the_limits_of_its_reference():
    """The values that square_droplet.yaml is compared with are those of its own files."""
    folder = ROOT / "cases/reference"
    coarse, fine = (folder / f"c_square_bubble_seed000_computed{end}.csv" for end in ("", "_N128"))
    curves = [f"{coarse}:t_s:dp_Pa_N32", f"{coarse}:t_s:dp_Pa_N64", f"{fine}:t_s:dp_Pa"]
    text = (ROOT / "cases/square_droplet.yaml").read_text()
    for window in ((12.0, 20.0), (20.0, 30.0)):
        found = SCRIPT["limit"](tuple(SCRIPT["mean_of"](curve, window) for curve in curves))[1]
        assert f"window: [{window[0]:g}, {window[1]:g}], value: {np.round(found, 4):g}," in text
