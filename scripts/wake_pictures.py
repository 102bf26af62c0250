"""Picture of what the parts of delta-plus-SPH do for a body in a stream: particles behind a cylinder, with and without them.

    python scripts/wake_pictures.py [--spacings 20] [--way 1] [--device cpu|cuda:0] [--threads 1] [--output FILE.png]

A cylinder of diameter 1 m is set in motion through water at rest, at Re = 200, in a box of 8 x 4 m with free-slip sides.
Four states, one picture each, after a way of `--way` diameters: with the shift of 2017 and the control of tension, without
the one, without the other, and the default; the volume is held in all, so that the wake is under tension. Coloured is the
pressure over rho U^2/2. What is printed: how much of the smoothing kernel particles fill around the body, which is 1 where
they are even, and the mean pressure of the box.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.errors import DivergenceError
from warpsph.simulation import Simulation

# the shift and the control of tension of the papers
PRINTED = {"shifting": 2, "tension_control": True}
SPEEDING = 0.5  # time in which the cylinder comes to the speed of 1 m/s [s]
STATES: dict[str, dict[str, Any]] = {
    "shift (A = 2) and control of tension": PRINTED,
    "no shift": {**PRINTED, "shifting": 0},
    "no control of tension": {**PRINTED, "tension_control": False},
    "default (A = 8, no control of tension)": {},
}


def scene(spacings: int, way: float, numerics: dict[str, Any]) -> Case:
    """Return the case of one state; `spacings` a diameter, `way` in diameters."""
    return Case.from_dict({
        "dimension": 2,
        "particle_spacing": 1 / spacings,
        "end_time": way + 0.5 * SPEEDING,
        "domain": {"lower": [-2, -2], "upper": [6, 2], "boundary": {"x": "free_slip", "y": "free_slip"}},
        "phases": {"water": {"density": 1.0, "viscosity": 0.005, "sound_speed": 15}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "bodies": {
            "cylinder": {
                "shape": {"sphere": {"center": [0, 0], "radius": 0.5}},
                "motion": {"translation": [f"where(t < {SPEEDING}, t**2, t - {0.5 * SPEEDING})", 0]},
            }
        },
        "numerics": {"scheme": "delta_plus", **numerics},
        "output": {"particles": "none", "checkpoint": "none"},
    })  # fmt: skip


def place(time: float) -> float:
    """Return where the cylinder is at a time [s], m."""
    return time**2 if time < SPEEDING else time - 0.5 * SPEEDING


def room(position: np.ndarray, spacing: float, around: np.ndarray) -> np.ndarray:
    """Return how much of the smoothing kernel (Wendland C2, h = 2 dx) particles fill at given points; 1 where they are even.

    position: (n, 2) [m], around: (m, 2) [m]
    """
    from scipy.spatial import cKDTree

    h = 2 * spacing
    pairs = cKDTree(around).sparse_distance_matrix(cKDTree(position), 2 * h, output_type="coo_matrix")
    q = pairs.data / h
    weight = 7 / (4 * np.pi * h**2) * (1 - q / 2) ** 4 * (2 * q + 1) * spacing**2
    return np.bincount(pairs.row, weight, len(around))


def main(arguments: list[str] | None = None) -> int:
    """Run the states and write table and picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacings", type=int, default=20, help="a diameter (default: 20)")
    parser.add_argument("--way", type=float, default=1.0, help="diameters (default: 1)")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--output", type=Path, default=Path("wake_pictures.png"))
    chosen = parser.parse_args(arguments)

    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from PIL import Image

    spacing = 1 / chosen.spacings
    figure, axes = plt.subplots(2, 2, figsize=(9.6, 8), layout="constrained", sharey=True)
    for axis, (name, numerics) in zip(axes.flat, STATES.items(), strict=True):
        run = Simulation(scene(chosen.spacings, chosen.way, numerics), device=chosen.device, threads=chosen.threads)
        end, way = "", chosen.way
        try:
            run.run()
        except DivergenceError as error:
            end, way = f" (diverged at t = {error.time:.2g} s)", place(error.time)
        water = run.model.snapshot().fluid
        inside = (np.abs(water.position - [2, 0]) < [3.5, 1.5]).all(axis=1)
        inside &= np.hypot(water.position[:, 0] - way, water.position[:, 1]) > 0.5 + 4 * spacing
        filled = room(water.position, spacing, water.position[inside])
        mean = np.average(water.pressure, weights=water.volume)
        print(
            f"{name + end:58} filled {filled.min():.2f} to {filled.max():.2f}, "
            f"rms off 1 {np.sqrt(((filled - 1) ** 2).mean()):.4f}; "
            f"mean pressure {2 * mean:.3f} rho U^2/2",
            flush=True,
        )
        colour = 2 * (water.pressure - mean)
        shown = axis.scatter(*water.position.T, c=colour, s=5, lw=0, cmap="RdBu_r", vmin=-2, vmax=2)
        axis.add_patch(plt.Circle((way, 0), 0.5, color="0.3"))
        axis.set(title=name + end, xlim=(way - 2.2, way + 1.2), ylim=(-1.4, 1.4), aspect="equal")
    figure.colorbar(shown, ax=axes, label="pressure less its mean, over rho U^2/2", shrink=0.6)
    figure.savefig(chosen.output, dpi=64)
    Image.open(chosen.output).quantize(48).save(chosen.output, optimize=True)  # thousands of points take half the bytes
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
