"""How well are drops in shear deformed? Table over capillary number, ratios of viscosity and density, resolution.

    python scripts/shear_drops.py [--device cpu|cuda:0] [--processes N] [--threads N] [--precision float32|float64]
                                  [--capillary 0.1 0.2 ...] [--spacings 8 16 ...] [--viscosity 0.1 1 10]
                                  [--density 0.01 1 100] [--ratio 2] [--end-time T] [--set numerics.shifting=8 ...]
                                  [--case shear_drop] [--json FILE]

Runs `cases/shear_drop.yaml` (or `shear_drop_3d`) for each combination; ratios are those of the drop over the matrix. Time in
1/shear rate; by default until the drop is steady: max(2, 20 Ca), (1 + ratio of viscosities)/2 times that for a thick one.
The table has the deformation D and the angle, means over the last fifth of the run, their errors against the reference
(2-D: with the inertia of the case by `shear_drop_inertia.py` where that is known, else for equal densities Stokes flow by
`shear_drop_exact.py`; 3-D: with one viscosity Stokes flow without walls by `shear_drop_exact_3d.py`, else Cox 1969 for
small deformation), the largest distance from the reference over time, the swing of D (standard deviation over the same
fifth), the area (2-D) or volume (3-D) of the ellipse over that of the start, pieces, stages of friction, steps and seconds.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.simulation import Simulation
from warpsph.study.provenance import provenance

CASES = Path(__file__).parents[1] / "cases"
STEADY = "i_drop_shear_2D_inertia.csv"  # by shear_drop_inertia.py
STOKES = "i_drop_shear_2D_stokes.csv"  # without inertia, by shear_drop_exact.py: for other viscosities
STOKES_3D = "i_drop_shear_3D_stokes.csv"  # the same without walls, by shear_drop_exact_3d.py: one viscosity
OVER_TIME = "i_drop_shear_2D_inertia_transient.csv"
REYNOLDS = 0.1


def table_of(name: str) -> np.ndarray:
    """A table of the references, its columns by name."""
    return np.genfromtxt(CASES / "reference" / name, delimiter=",", names=True, deletechars="")


def steady_reference(dimension: int, capillary: float, viscosity: float, density: float) -> tuple[float, float]:
    """D and angle [degrees] that a drop should have; nan where none is known."""
    if dimension == 3:
        if density != 1.0:
            return math.nan, math.nan
        rows = table_of(STOKES_3D)
        mine = rows[rows["Ca"] == capillary]
        if viscosity == 1.0 and len(mine):
            return float(mine["D_second_moments"][0]), float(mine["orientation_deg"][0])
        turn = 19 * viscosity * capillary / 20
        taylor = capillary * (19 * viscosity + 16) / (16 * viscosity + 16)
        return taylor / math.hypot(1.0, turn), 45 - math.degrees(0.5 * math.atan(turn))
    rows = table_of(STEADY)
    mine = rows[(rows["Ca"] == capillary) & (rows["lambda"] == viscosity) & (rows["density"] == density)]
    if not len(mine) and density == 1.0:
        rows = table_of(STOKES)
        mine = rows[(rows["Ca"] == capillary) & (rows["lambda"] == viscosity)]
    if not len(mine):
        return math.nan, math.nan
    return float(mine["D_second_moments"][0]), float(mine["orientation_deg"][0])


def over_time(dimension: int, capillary: float, viscosity: float, density: float) -> np.ndarray | None:
    """Times and D of the reference over time, (n, 2); None where there is none."""
    rows = table_of(OVER_TIME)
    column = f"D_Ca{capillary:g}" + "".join(
        f"_{name}{ratio:g}" for name, ratio in (("viscosity", viscosity), ("density", density)) if ratio != 1.0
    )
    names = rows.dtype.names or ()
    if dimension == 3 or column not in names:
        return None
    return np.column_stack([rows[names[0]], rows[column]])


def case_of(wanted: dict[str, Any]) -> Case:
    """The case of a row of the table."""
    case = Case.load(CASES / f"{wanted['case']}.yaml")
    tension = 1.0 / REYNOLDS / wanted["capillary"]
    phases = {
        "phases.drop.viscosity": wanted["viscosity"] / REYNOLDS,
        "phases.drop.density": wanted["density"],
    }
    return case.replace(
        {
            "particle_spacing": 1.0 / wanted["spacings"],
            "end_time": wanted["end_time"],
            "precision": wanted["precision"],
            **phases,
            "surface_tension.0.coefficient": tension,
            "start.pressure": f"where(r < 1, {(case.dimension - 1) * tension}, 0)",
            "numerics.smoothing_ratio": wanted["ratio"],
            "output.particles": "none",
            "reference": {},
            **dict(text.split("=", 1) for text in wanted["set"]),
        }
    )


def measure(wanted: dict[str, Any]) -> dict[str, Any]:
    """Run one drop and return its row of the table."""
    case = case_of(wanted)
    run = Simulation(case, device=wanted["device"], threads=wanted["threads"]).run()
    drop, pieces, summary = run.gauge("drop"), run.gauge("pieces"), run.summary
    late = drop["time"] >= 0.8 * drop["time"][-1]
    deformation = drop["deformation drop"]
    if case.dimension == 2:
        angle = np.degrees(drop["angle drop"])
        size = drop["long_axis drop"] * drop["short_axis drop"]
    else:
        angle = np.degrees(np.arctan2(drop["direction_y drop"], drop["direction_x drop"]))
        size = drop["long_axis drop"] * drop["middle_axis drop"] * drop["short_axis drop"]
    properties = (case.dimension, wanted["capillary"], wanted["viscosity"], wanted["density"])
    exact, exact_angle = steady_reference(*properties)
    curve = over_time(*properties)
    off = math.nan
    if curve is not None:
        known = drop["time"] <= curve[-1, 0]
        off = float(np.abs(deformation - np.interp(drop["time"], *curve.T))[known].max() / curve[:, 1].max())
    mean, mean_angle = float(deformation[late].mean()), float(angle[late].mean())
    return {
        **wanted,
        "deformation": mean,
        "deformation_error": mean / exact - 1.0,
        "angle": mean_angle,
        "angle_error": mean_angle - exact_angle,
        "over_time": off,
        "swing": float(deformation[late].std()),
        "size": float(size[-1] / size[0]),
        "pieces": int(pieces["count drop"].max()),
        "status": summary["status"],
        "steps": summary["steps"],
        "stages": run.physics.choices["viscous_stages"],
        "seconds": summary["wall_seconds"],
        "particles": summary["fluid_particles"],
        "device_name": summary["device_name"],
    }


def wanted_rows(arguments: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """What to run, the quick ones first."""
    choices = itertools.product(arguments.spacings, arguments.density, arguments.viscosity, arguments.capillary)
    for spacings, density, viscosity, capillary in choices:
        steady = max(2.0, 20.0 * capillary) * max(1.0, 0.5 * (1.0 + viscosity))
        yield {
            "case": arguments.case, "spacings": spacings, "density": density, "viscosity": viscosity, "capillary": capillary,
            "ratio": arguments.ratio, "end_time": arguments.end_time or steady, "set": arguments.set,
            "device": arguments.device, "threads": arguments.threads, "precision": arguments.precision,
        }  # fmt: skip


def line(row: dict[str, Any]) -> str:
    """A row of the table as text."""
    error, swing = 100 * row["deformation_error"], 100 * row["swing"] / row["deformation"]
    return (
        f"{row['spacings']:>4g} {row['density']:>6g} {row['viscosity']:>6g} {row['capillary']:>5g}   "
        f"{row['deformation']:.4f} {error:>6.2f} % {row['angle']:>6.2f} {row['angle_error']:>6.2f}   "
        f"{100 * row['over_time']:>6.2f} % {swing:>5.2f} % {row['size']:.4f} {row['pieces']:>3}   "
        f"{row['stages']:>2} {row['steps']:>8} {row['seconds']:>8.1f} {row['status']}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1, help="CPU threads of each run")
    parser.add_argument("--processes", type=int, default=1, help="runs at once")
    parser.add_argument("--precision", default="float32", choices=["float32", "float64"])
    parser.add_argument("--case", default="shear_drop", choices=["shear_drop", "shear_drop_3d"])
    parser.add_argument("--capillary", type=float, nargs="+", default=[0.1, 0.2, 0.3, 0.4])
    parser.add_argument("--spacings", type=float, nargs="+", default=[8, 16], help="particle spacings a radius")
    parser.add_argument("--viscosity", type=float, nargs="+", default=[1.0])
    parser.add_argument("--density", type=float, nargs="+", default=[1.0])
    parser.add_argument("--ratio", type=float, default=2.0, help="smoothing length over spacing")
    parser.add_argument("--end-time", type=float, help="default: until the drop is steady")
    parser.add_argument("--set", nargs="*", default=[], help="further keys, as numerics.shifting=8")
    parser.add_argument("--json", type=Path, help="write the rows to a file")
    arguments = parser.parse_args()

    print("R/dx density viscos.   Ca        D    error   angle  error   in time  swing   size pieces stages steps seconds")
    rows = []
    with ProcessPoolExecutor(arguments.processes, get_context("spawn")) as pool:
        for row in pool.map(measure, wanted_rows(arguments)):
            rows.append(row)
            print(line(row), flush=True)
    if arguments.json:
        command = "python scripts/shear_drops.py " + " ".join(sys.argv[1:])
        record = {**provenance(), "command": command, "rows": rows}
        arguments.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
