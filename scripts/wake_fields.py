"""Fields of a stored 2-D run as one picture, one row a field or one column a time: vorticity beside Lyapunov exponents.

    python scripts/wake_fields.py RUN --fields vorticity ftle_backward --times 60 --box -1.4 14.5 -2.6 2.6 --output wake.png

RUN is the folder of a run whose particle files have the fields (`output.particles.fields`, `output.lyapunov`). Values
between particles are means of the three nearest; where none is within a spacing and a half the picture is white.
"""

import argparse
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from scipy.spatial import cKDTree

from warpsph.case.case_file import load_case
from warpsph.files.vtp import read_vtp

matplotlib.use("Agg")
import matplotlib.pyplot as plt

RANGES = {"vorticity": "RdBu_r", "ftle_backward": "magma", "ftle_forward": "magma"}


def image(position: np.ndarray, values: np.ndarray, box: list[float], spacing: float) -> np.ndarray:
    """Values on a grid over the box, nan without fluid."""
    x, y = np.meshgrid(np.arange(box[0], box[1], spacing / 2), np.arange(box[2], box[3], spacing / 2))
    way, row = cKDTree(position).query(np.c_[x.ravel(), y.ravel()], k=3)
    share = 1.0 / (way + 0.01 * spacing)
    result = (values[row] * share).sum(axis=1) / share.sum(axis=1)
    result[way[:, 0] > 1.5 * spacing] = np.nan
    return np.asarray(result.reshape(x.shape))


def frame(run: Path, time: float) -> Any:
    """The fluid of the stored frame that is nearest to a time [s]."""
    files = sorted(run.glob("**/fluid_*.vtp"))
    frames = [read_vtp(path, 2) for path in files]
    return min(frames, key=lambda one: abs(one.time - time))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--fields", nargs="+", default=["vorticity"])
    parser.add_argument("--times", nargs="+", type=float, required=True)
    parser.add_argument("--box", nargs=4, type=float, required=True)
    parser.add_argument("--limits", nargs="+", type=float, default=[], help="largest value of each field")
    parser.add_argument("--output", type=Path, required=True)
    given = parser.parse_args()
    spacing = load_case(given.run / "case.yaml").spacing
    shape = (len(given.fields), len(given.times))
    size = (12.0 / max(shape[1] / 3, 1.2), 3.2 * shape[0])
    figure, axes = plt.subplots(*shape, figsize=size, squeeze=False, constrained_layout=True)
    for row, field in enumerate(given.fields):
        for column, time in enumerate(given.times):
            fluid = frame(given.run, time)
            values = image(fluid.position, np.asarray(getattr(fluid, field)), given.box, spacing)
            top = given.limits[row] if row < len(given.limits) else float(np.nanquantile(np.abs(values), 0.99))
            low = -top if field == "vorticity" else 0.0
            axis = axes[row, column]
            colours = {"cmap": RANGES.get(field, "viridis"), "vmin": low, "vmax": top}
            shown = axis.imshow(values, origin="lower", extent=given.box, **colours)
            axis.set_title(f"t = {fluid.time:g} s")
        figure.colorbar(shown, ax=list(axes[row]), label=f"{field}, 1/s", shrink=0.85)
    figure.savefig(given.output, dpi=75)
