"""Curves of a sensor in several runs of `dam_break_lobovsky`, over the experiment and published delta-SPH: one picture.

    python scripts/sensor_curves.py RUN [RUN ...] [--labels TEXT ...] [--output FILE.png]

RUN are run folders; the sensors 3 and 30 mm above the floor have a panel each. Pressures over rho g H, times over sqrt(H/g),
each curve a running mean over 0.05 sqrt(H/g).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

REFERENCE = Path(__file__).parents[1] / "cases" / "reference"
HEIGHT, GRAVITY, DENSITY = 0.3, 9.81, 1000.0  # of the case [m, m/s^2, kg/m^3]
SENSORS = {"sensor_3": ("3 mm", "p1", "P1"), "sensor_30": ("30 mm", "p3", "P3")}
SPAN = 0.05  # of the running mean [sqrt(H/g)]


def curve(run: Path, sensor: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times [sqrt(H/g)] and smoothed pressures [rho g H] of a sensor of a run; dry is 0."""
    rows = np.loadtxt(run / "gauges" / f"{sensor}.csv", delimiter=",", skiprows=1)
    time, pressure = rows[:, 0] / np.sqrt(HEIGHT / GRAVITY), np.nan_to_num(rows[:, -1]) / (DENSITY * GRAVITY * HEIGHT)
    width = max(int(SPAN / np.median(np.diff(time))), 1)
    return time, np.convolve(pressure, np.ones(width) / width, "same")


def main(arguments: list[str] | None = None) -> int:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN")
    parser.add_argument("--labels", nargs="+", default=[], help="of the runs (default: names of the folders)")
    parser.add_argument("--output", type=Path, default=Path("sensor_curves.png"))
    chosen = parser.parse_args(arguments)
    for run in chosen.runs:
        if not (run / "gauges" / "sensor_3.csv").is_file():
            parser.error(f"{run}: has no gauges/sensor_3.csv; needs a run of dam_break_lobovsky")

    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    labels = [*chosen.labels, *(run.name for run in chosen.runs[len(chosen.labels) :])]
    figure, axes = plt.subplots(2, 1, figsize=(8, 7), layout="constrained", sharex=True)
    for axis, (sensor, (height, measured, computed)) in zip(axes, SENSORS.items(), strict=True):
        for run, label in zip(chosen.runs, labels, strict=True):
            axis.plot(*curve(run, sensor), lw=0.9, label=label)
        published = np.loadtxt(
            REFERENCE / f"m_dambreak_pressure_decourcy2024_deltaSPH_{computed}.csv", delimiter=",", skiprows=1
        )
        axis.plot(*published.T[:2], "k", lw=1.4, label="delta-SPH, De Courcy et al. 2024")
        experiment = np.loadtxt(REFERENCE / f"m_dambreak_pressure_lobovsky_{measured}.csv", delimiter=",", skiprows=1)
        axis.plot(*experiment.T[:2], "k.", ms=4, label="experiment, Lobovsky et al. 2014")
        axis.set(ylabel=f"p/(rho g H) at {height}", xlim=(2.1, 7), ylim=(-0.3, 4))
    axes[0].legend(fontsize=8)
    axes[1].set(xlabel="t sqrt(g/H)")
    figure.savefig(chosen.output, dpi=80)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
