"""Means over time of what several grids computed, and the limit that they tend to: how far off is a reference itself?

    python scripts/grid_limit.py --window 12 20 \\
        cases/reference/c_square_bubble_seed000_computed.csv:t_s:dp_Pa_N32 \\
        cases/reference/c_square_bubble_seed000_computed.csv:t_s:dp_Pa_N64 \\
        cases/reference/c_square_bubble_seed000_computed_N128.csv:t_s:dp_Pa

Curves are given as FILE:TIME:VALUE, the coarsest grid first, each twice as fine as the one before. The mean m over the
window is that of straight lines between the rows. Three grids have the order p = log2((m2 - m1)/(m3 - m2)) and the limit
m3 + (m3 - m2)/(2^p - 1) (Richardson). The limit of first order, m3 + (m3 - m2), is beside it: by what both differ the limit
is not known.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np


def mean_of(curve: str, window: tuple[float, float]) -> float:
    """Mean of the column over the window.

    Raises:
        ValueError: the curve is not FILE:TIME:VALUE, or it does not cover the window.
    """
    parts = curve.rsplit(":", 2)
    if len(parts) != 3:
        raise ValueError(f"{curve} -> needs FILE:TIME:VALUE")
    table = np.atleast_1d(np.genfromtxt(Path(parts[0]), delimiter=",", names=True, deletechars=""))
    for name in parts[1:]:
        if name not in (table.dtype.names or ()):
            raise ValueError(f"{curve} -> {parts[0]} has no column {name}; take one of {', '.join(table.dtype.names or ())}")
    known = np.isfinite(table[parts[2]])
    times, values = table[parts[1]][known], table[parts[2]][known]
    if not len(times):
        raise ValueError(f"{curve} -> has no rows")
    begin, end = window
    if not times[0] <= begin < end <= times[-1]:
        raise ValueError(f"--window {begin:g} {end:g} -> needs begin < end within {times[0]:g} ... {times[-1]:g} of {curve}")
    at = np.unique(np.concatenate([[begin, end], times[(times > begin) & (times < end)]]))
    return float(np.trapezoid(np.interp(at, times, values), at) / (end - begin))


def limit(means: tuple[float, float, float]) -> tuple[float, float]:
    """Order and limit of three grids, each twice as fine as the one before; nan where they tend to none."""
    first, second = means[1] - means[0], means[2] - means[1]
    if second == 0.0 or first / second <= 1.0:
        return math.nan, math.nan
    order = math.log2(first / second)
    return order, means[2] + second / (2.0**order - 1.0)


def main() -> None:
    """Print the means, the order and both limits."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("curves", nargs=3, metavar="FILE:TIME:VALUE", help="the coarsest grid first")
    parser.add_argument("--window", nargs=2, type=float, required=True, metavar=("BEGIN", "END"), help="of time")
    options = parser.parse_args()
    try:
        coarse, middle, fine = (mean_of(curve, tuple(options.window)) for curve in options.curves)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    order, found = limit((coarse, middle, fine))
    settled = f"order {order:.2f}, limit {found:.5g}" if order > 0 else "they tend to no limit"
    print(f"means {coarse:.5g}, {middle:.5g}, {fine:.5g}; {settled}")
    print(f"limit of first order {2.0 * fine - middle:.5g}")


if __name__ == "__main__":
    main()
