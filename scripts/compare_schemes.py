"""Which scheme should a user take? Error against seconds of Riemann SPH, projection ISPH and delta-plus-SPH in three scenes.

    python scripts/compare_schemes.py [--device cpu|cuda:0] [--threads N] [--precision float32|float64]
                                      [--only elliptic dam taylor] [--finer 1] [--json FILE]

Scenes are those of `cases/`, each with all schemes at two resolutions (`--finer 2` halves the spacings of all):

* elliptic drop: largest error of both semi-axes over all times to 0.02 s, and root mean square of the error of the centre
  pressure over the start value, both against the exact solution;
* dam break, to 0.25 s, before the front meets the far wall: energy that is lost over the potential energy of the start,
  where an ideal fluid loses none (below 0: it gains), and root mean square of the relative distance of the front from the
  experiment, which an ideal fluid outruns by 10 to 20 %: no error of a scheme, but of all alike;
* Taylor-Green from a disordered start, to t = 2: l1 error of the speed and largest error of its decay.

Seconds are those of the run without set-up, with the kernels in Warp's cache: each scene is run for a few steps before.
No files are written. Best measured on a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.simulation import Simulation
from warpsph.study.provenance import provenance

CASES = Path(__file__).parents[1] / "cases"
SCHEMES = ("riemann", "isph", "delta_plus")
WARM_UP = 2e-3
"""Share of the time for which a scene is run to compile its kernels."""


def drop_errors(run: Simulation) -> dict[str, float]:
    """Errors of the elliptic drop, relative."""
    found = _errors(run)
    pressure = run.gauge("centre")
    exact = np.genfromtxt(CASES / "reference" / "a_elliptic_drop_exact.csv", delimiter=",", names=True)
    late = pressure["time"] >= 1e-4
    off = pressure["pressure"] - np.interp(pressure["time"], exact["t_s"], exact["p_centre_Pa"])
    return {
        "semi-axes": max(found["semi_axis_x"], found["semi_axis_y"]),
        "centre pressure": float(np.sqrt(np.mean(off[late] ** 2)) / exact["p_centre_Pa"][0]),
    }


def dam_errors(run: Simulation) -> dict[str, float]:
    """Energy lost until 0.25 s over that of the start, and the front over that of the experiment."""
    energy = run.gauge("energy")
    lost = (energy["total"][0] - energy["total"][-1]) / energy["potential"][0]
    return {"energy loss": float(lost), "front": _errors(run)["front"]}


def vortex_errors(run: Simulation) -> dict[str, float]:
    """Errors of the Taylor-Green vortices, relative."""
    found = _errors(run)
    return {"speed l1": found["speed_l1"], "decay": found["decay"]}


def _errors(run: Simulation) -> dict[str, float]:
    return {name: float(entry["error"]) for name, entry in run.summary["errors"].items() if entry["error"] is not None}


@dataclass(frozen=True)
class Scene:
    """A case, the spacings it is run at [m], what is changed in it, and how its errors are found."""

    case: str
    spacings: tuple[float, ...]
    changes: Mapping[str, Any]
    errors: Callable[[Simulation], dict[str, float]]


SCENES = {
    "elliptic drop": Scene("elliptic_drop", (0.04, 0.02), {}, drop_errors),
    "dam break": Scene("dam_break", (0.146 / 40, 0.146 / 80), {"end_time": 0.25, "gauges.load": "none"}, dam_errors),
    "Taylor-Green": Scene("taylor_green", (1 / 50, 1 / 100), {}, vortex_errors),
}


def measure(name: str, scheme: str, spacing: float, device: str, threads: int | None, precision: str) -> dict[str, Any]:
    """Run a scene and return its row of the table; seconds [s] without set-up, errors relative."""
    scene = SCENES[name]
    case = Case.load(CASES / f"{scene.case}.yaml")
    case = case.replace(
        {
            **scene.changes,
            "numerics.scheme": scheme,
            "particle_spacing": spacing,
            "precision": precision,
            "output.particles": {"times": [scene.changes.get("end_time", case.end_time)]},
            "output.checkpoint": "none",
        }
    )
    Simulation(case.replace({"end_time": WARM_UP * case.end_time}), device=device, threads=threads).run()
    run = Simulation(case, device=device, threads=threads).run()
    summary = run.summary
    return {
        "scene": name,
        "scheme": scheme,
        "spacing": spacing,
        "particles": summary["fluid_particles"],
        "steps": summary["steps"],
        "seconds": summary["wall_seconds"],
        "errors": scene.errors(run),
        "status": summary["status"],
        "device": summary["device_name"],
        "threads": summary["threads"],
        "precision": precision,
    }


def show(rows: list[dict[str, Any]]) -> None:
    """Print the table."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{rows[0]['device']}, {rows[0]['threads']} threads, {rows[0]['precision']}" if rows else "")
    for column in ("scene", "particles", "scheme", "errors", "steps", "seconds"):
        table.add_column(column, justify="right" if column in ("particles", "steps", "seconds") else "left")
    for row in rows:
        errors = ", ".join(f"{name} {100 * error:.3g} %" for name, error in row["errors"].items())
        table.add_row(
            row["scene"], f"{row['particles']:,}", row["scheme"], errors, f"{row['steps']:,}", f"{row['seconds']:.3g}"
        )  # fmt: skip
    Console(width=120).print(table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, help="CPU threads (default: all)")
    parser.add_argument("--precision", default="float32", choices=["float32", "float64"])
    parser.add_argument("--only", nargs="+", default=[], help="scenes whose name starts with one of these")
    parser.add_argument("--finer", type=float, default=1.0, help="divides the spacing of every run")
    parser.add_argument("--json", type=Path, help="write the rows to a file")
    arguments = parser.parse_args()

    rows = []
    for name, scene in SCENES.items():
        if arguments.only and not any(name.lower().startswith(word.lower()) for word in arguments.only):
            continue
        for spacing in scene.spacings:
            for scheme in SCHEMES:
                spacing_now = spacing / arguments.finer
                row = measure(name, scheme, spacing_now, arguments.device, arguments.threads, arguments.precision)
                rows.append(row)
                print(f"{name}, {row['particles']} particles, {scheme}: {row['seconds']:.3g} s", flush=True)
    show(rows)
    if arguments.json:
        command = "python scripts/compare_schemes.py " + " ".join(sys.argv[1:])
        record = {**provenance(), "command": command, "rows": rows}
        arguments.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
