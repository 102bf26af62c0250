"""Accuracy of the cases against their references: one table, from the runs' own gauges.

    python scripts/accuracy.py [--device cpu|cuda:0] [--threads N] [--only NAME ...] [--precision float32 float64]
                               [--json FILE]

Each row runs a case file of cases/ with the changes given in ROWS and prints every entry of its `reference`, the
steps and the seconds. `--only` takes the beginnings of row names.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

CASES = Path(__file__).resolve().parent.parent / "cases"

# row name -> (case file, changes)
ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    **{f"taylor_green {n} noise": ("taylor_green", {"particle_spacing": f"1/{n}"}) for n in (25, 50, 100, 200)},
    **{f"taylor_green {n} lattice": ("taylor_green_lattice", {"particle_spacing": f"1/{n}"}) for n in (25, 50, 100, 200)},
    # drift of the total momentum over 10 000 steps of the conservative form, against sum m |v| at the start, (2/pi)^2
    "momentum, conservative": (
        "taylor_green_lattice",
        {
            "end_time": 14.0,
            "numerics.pressure_gradient": "conservative",
            "reference": {
                "momentum_drift": {
                    "gauge": "momentum", "column": "hypot(momentum_x, momentum_y)", "reduce": "max", "value": 0,
                    "allowed": 1e-6 * 0.405,
                }
            },
        },
    ),
    "momentum, corrected": (
        "taylor_green_lattice",
        {
            "end_time": 14.0,
            "reference": {
                "momentum_drift": {
                    "gauge": "momentum", "column": "hypot(momentum_x, momentum_y)", "reduce": "max", "value": 0,
                }
            },
        },
    ),
    "poiseuille 40": ("poiseuille", {}),
    "couette 40": ("couette", {}),
    "hydrostatic_tank": ("hydrostatic_tank", {}),
    "layered_tank": ("layered_tank", {}),
    "standing_wave": ("standing_wave", {}),
    "dam_break": ("dam_break", {}),
    "dam_break_3d": ("dam_break_3d", {}),
    **{f"square_droplet {n}": ("square_droplet", {"particle_spacing": f"2/{n}"}) for n in (52, 76, 100, 200)},
    **{
        f"static_droplet R/{n} ratio {ratio}": (
            "static_droplet",
            {
                "particle_spacing": f"0.25/{n}",
                "phases.liquid.density": ratio,
                # the same Ohnesorge number 0.5 of the heavy fluid
                "phases.liquid.viscosity": 0.5 * (ratio * 0.5) ** 0.5,
                "phases.gas.viscosity": 0.5 * (ratio * 0.5) ** 0.5 / min(100, ratio),
                "phases.gas.gamma": 1.4 if ratio > 1 else 7,
            },
        )
        for n in (10, 20)
        for ratio in (1, 10, 1000)
    },
    **{f"oscillating_drop {n}": ("oscillating_drop", {"particle_spacing": f"1/{n}"}) for n in (60, 90, 120)},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--only", nargs="+", default=[], help="rows whose name starts with one of these")
    parser.add_argument("--precision", nargs="+", default=["float32"], choices=["float32", "float64"])
    parser.add_argument("--json", type=Path, help="write the rows to a file")
    arguments = parser.parse_args()

    from warpsph.case_file import load_case
    from warpsph.errors import WarpsphError
    from warpsph.simulation import Simulation

    rows = []
    print(f"{'run':32} {'prec':7} {'quantity':18} {'value':>11} {'reference':>11} {'error':>9} {'allowed':>8} "
          f"{'particles':>9} {'steps':>7} {'seconds':>8}")  # fmt: skip
    for name, (file, changes) in ROWS.items():
        if arguments.only and not any(name.startswith(start) for start in arguments.only):
            continue
        for precision in arguments.precision:
            off = {"output.checkpoint": "none", "precision": precision}
            case = load_case(CASES / f"{file}.yaml").replace({**changes, **off})
            begin = time.perf_counter()
            try:
                simulation = Simulation(case, device=arguments.device, threads=arguments.threads).run()
            except WarpsphError as error:
                print(f"{name:32} {precision:7} {error}", flush=True)
                continue
            summary = simulation.summary
            for quantity, entry in summary["errors"].items():
                row = {
                    "run": name, "case": file, "changes": changes, "precision": precision, "quantity": quantity,
                    **{key: entry[key] for key in ("value", "reference", "error", "allowed", "unit", "note")},
                    "particles": summary["particles"], "steps": summary["steps"],
                    "seconds": time.perf_counter() - begin, "device": summary["device_name"],
                }  # fmt: skip
                rows.append(row)
                cells = [
                    "-" if row[key] is None else format(row[key], spec)
                    for key, spec in (("value", ".5g"), ("reference", ".5g"), ("error", ".2%"), ("allowed", ".2%"))
                ]
                missed = row["error"] is not None and row["allowed"] is not None and abs(row["error"]) > row["allowed"]
                print(
                    f"{name:32} {precision:7} {quantity:18} {cells[0]:>11} {cells[1]:>11} {cells[2]:>9} {cells[3]:>8} "
                    f"{row['particles']:9d} {row['steps']:7d} {row['seconds']:8.1f}" + ("  missed" if missed else ""),
                    flush=True,
                )
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
