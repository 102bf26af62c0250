"""A blast that leaves an open box, against the same blast in a box three times as wide.

    python scripts/open_blast.py [--spacings 40 80] [--times 0.5 0.8]

The scene is scripts/foreign/open_blast.yaml, run with held and with free ends. A line a run: means of the differences of
density and pressure from the wide box, over rings of 0.05 m around the middle within 0.5 m that both runs have particles in.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import warpsph
from warpsph.case.case import Case
from warpsph.running.model import Model

SCENE = Path(__file__).parent / "foreign" / "open_blast.yaml"
RINGS = np.arange(0.0, 0.51, 0.05)


def rings(case: Case) -> np.ndarray[Any, Any]:
    """Run a case and return density and pressure (rings, 2) at its end, nan where no particle is."""
    model = Model(case, threads=1, device="cpu")
    model.stepper.prepare(fresh=True)
    model.stepper.run(case.end_time, 10**6)
    found = model.snapshot()
    ring = np.digitize(np.hypot(*found.position[:, :2].T), RINGS) - 1
    table = np.full((len(RINGS) - 1, 2), np.nan)
    for k in np.unique(ring[ring < len(table)]):
        table[k] = found.density[ring == k].mean(), found.pressure[ring == k].mean()
    return table


def main() -> None:
    """Run all boxes and print their differences."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacings", type=int, nargs="+", default=[40, 80], help="spacings a metre")
    parser.add_argument("--times", type=float, nargs="+", default=[0.5, 0.8], help="ends of the runs [s]")
    args = parser.parse_args()
    scene = warpsph.load_case(SCENE)
    for count in args.spacings:
        for end in args.times:
            case = scene.replace({"particle_spacing": 1 / count, "end_time": end})
            wide = rings(case.replace({"domain.lower": [-1.5, -1.5], "domain.upper": [1.5, 1.5]}))
            for held in (True, False):
                off = np.abs(rings(case.replace({"numerics.hold_open_sides": held})) - wide)
                density, pressure = np.nanmean(off, axis=0)
                ends = "held" if held else "free"
                print(f"1/{count} m, {end:g} s, {ends}: {density:.4f} kg/m^3, {pressure:.4f} Pa", flush=True)


if __name__ == "__main__":
    main()
