"""Does water that has splashed keep its volume? A column falls into a closed tank and sloshes on.

    python scripts/sloshing_volume.py [--schemes riemann isph delta_plus] [--spacings 40] [--times 10 20 40]
                                      [--dimension 3] [--set KEY=VALUE ...] [--processes N] [--json FILE]

A column of height and width 1 m in a tank 2.5 m long without friction; in 3-D 2 m long and 0.7 m wide. At each time, in
sqrt(H/g), over the start: *volume*, what lies within 0.75 spacings (3-D: 0.8) of a particle; *height*, of the centre of
mass over that of water at rest (waves lift it too); *speed*, root of the mean square of the velocities over sqrt(g H);
*hot*, share of the particles of which the pressure is more than twice that of the deepest water at rest. Exit code 1 if a
run diverges.
"""

from __future__ import annotations

import argparse
import json
import math
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.study.provenance import provenance

HEIGHT, GRAVITY, DENSITY = 1.0, 9.81, 1000.0
TANK = {2: (2.5, 3.0), 3: (2.0, 0.7, 2.0)}  # by dimension; its last axis is the vertical [m]
SCHEMES = ("riemann", "isph", "delta_plus")
NEAR = {2: 0.75, 3: 0.8}  # of a spacing, by dimension: disordered particles leave no hole between them


def rest(dimension: int) -> float:
    """Return the depth of the water at rest [m]."""
    return HEIGHT * HEIGHT / TANK[dimension][0]


def scene(scheme: str, count: int, end: float, changes: tuple[str, ...] = (), dimension: int = 2) -> Case:
    """Return the case of a scheme with `count` spacings a height, to `end` sqrt(H/g), with changes KEY=VALUE."""
    tank, axes = TANK[dimension], "xyz"[:dimension]
    sides = dict.fromkeys(axes[:-1], "free_slip") | {axes[-1]: {"lower": "free_slip", "upper": "open"}}
    column = {"lower": [0] * dimension, "upper": [HEIGHT, *tank[1:-1], HEIGHT]}
    return load_case(
        {
            "title": f"sloshing volume, {scheme}, {count}",
            "dimension": dimension,
            "particle_spacing": HEIGHT / count,
            "end_time": end * math.sqrt(HEIGHT / GRAVITY),
            "domain": {"lower": [0] * dimension, "upper": list(tank), "boundary": sides},
            "gravity": [0] * (dimension - 1) + [-GRAVITY],
            "phases": {"water": {"density": DENSITY, "viscosity": 0.0}},
            "fluids": [{"phase": "water", "shape": {"box": column}}],
            "start": {"pressure": "hydrostatic"},
            "numerics": {"scheme": scheme},
            "output": {"particles": "none", "checkpoint": "none"},
        },
        list(changes),
    )


def covered(points: np.ndarray, spacing: float) -> float:
    """Return the area [m^2] or volume [m^3] within NEAR spacings of points (n, d), by a grid of half spacings."""
    from scipy.spatial import cKDTree

    dimension = points.shape[1]
    axes = [np.arange(0.25 * spacing, size, 0.5 * spacing) for size in TANK[dimension]]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, dimension)
    near = cKDTree(points).query(places, distance_upper_bound=NEAR[dimension] * spacing)[0] < np.inf
    return float(near.sum()) * (0.5 * spacing) ** dimension


def run(task: tuple[str, int, tuple[float, ...], tuple[str, ...], int]) -> dict[str, Any]:
    """Run one scene; return what is measured at each time."""
    from warpsph.kernels.core import clock as ck
    from warpsph.simulation import Simulation

    scheme, count, times, changes, dimension = task
    case = scene(scheme, count, max(times), changes, dimension)
    depth = rest(dimension)
    model = Simulation(case, device="cpu", threads=1).model
    model.stepper.prepare(fresh=True)
    particles, n, spacing = model.particles, model.particles.fluid_count, case.spacing
    start = covered(particles.get("position")[:n].astype(float), spacing)
    row: dict[str, Any] = {"scheme": scheme, "spacings": count, "particles": n, "diverged": None, "samples": []}
    for time in sorted(times):
        model.stepper.run(time * math.sqrt(HEIGHT / GRAVITY), 10**9)
        clock, counters = model.stepper.read()
        if counters[ck.FAULT]:
            row["diverged"] = float(clock[ck.TIME])
            break
        place = particles.get("position")[:n].astype(float)
        speed = np.linalg.norm(particles.get("velocity")[:n].astype(float), axis=1)
        pressure = particles.get("state")[:n, 0] if "state" in particles.fields else particles.get("pressure")[:n]
        row["samples"].append(
            {
                "time": time,
                "volume": covered(place, spacing) / start,
                "height": float(place[:, -1].mean()) / (depth / 2),
                "speed": float(np.sqrt((speed**2).mean())) / math.sqrt(GRAVITY * HEIGHT),
                "hot": float((pressure > 2 * DENSITY * GRAVITY * depth).mean()),
            }
        )
    return row | {"steps": model.steps}


def main() -> int:
    """Run the scenes and print a row for each time; return 1 if a run diverged."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--schemes", nargs="+", default=list(SCHEMES), choices=SCHEMES)
    parser.add_argument("--spacings", nargs="+", type=int, default=[40], help="spacings a height")
    parser.add_argument("--times", nargs="+", type=float, default=[10.0, 20.0, 40.0], help="in sqrt(H/g)")
    parser.add_argument("--dimension", type=int, default=2, choices=tuple(TANK))
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", dest="changes")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    if options.processes < 1 or min(options.spacings) < 4 or min(options.times) <= 0:
        parser.error("--processes has to be 1 or more, --spacings 4 or more, --times above 0")
    times, changes = tuple(options.times), tuple(options.changes)
    tasks = [(scheme, n, times, changes, options.dimension) for n in options.spacings for scheme in options.schemes]
    rows = []
    with ProcessPoolExecutor(options.processes) as pool:
        for row in pool.map(run, tasks):
            rows.append(row)
            for sample in row["samples"]:
                values = "  ".join(f"{name} {sample[name]:.3f}" for name in ("volume", "height", "speed", "hot"))
                print(f"{row['scheme']:<10} {row['spacings']:4d}  t {sample['time']:5.4g}  {values}", flush=True)
            if row["diverged"] is not None:
                print(f"{row['scheme']:<10} {row['spacings']:4d}  diverged at {row['diverged']:.4g} s", flush=True)
    if options.json:
        record = provenance() | {"dimension": options.dimension, "changes": options.changes, "rows": rows}
        options.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return int(any(row["diverged"] is not None for row in rows))


if __name__ == "__main__":
    raise SystemExit(main())
