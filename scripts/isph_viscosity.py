"""Explicit against implicit viscosity of projection ISPH: steps, CPU seconds and errors of the same runs, alternately.

    python scripts/isph_viscosity.py                     # CPU, one thread, minutes
    python scripts/isph_viscosity.py --only 'poiseuille*' --changes 0.05 0.1 0.2
    python scripts/isph_viscosity.py --json benchmarks/isph_viscosity_cpu.json

Errors are those of the `reference` section of the case file; values, which have no reference, those at the end of the run.
`--changes` tries other accuracy limits of the step (`warpsph.schemes.isph_physics.CHANGE`). A run that diverged shows
when it did.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import sys
import time
from pathlib import Path
from typing import Any

from warpsph.case.case_file import load_case
from warpsph.errors import WarpsphError
from warpsph.schemes import isph_physics as incompressible
from warpsph.simulation import Simulation
from warpsph.study.provenance import provenance

CASES = Path(__file__).resolve().parent.parent / "cases"
DECAY = "exp(-8*pi**2*t)"
SLOW = ["phases.fluid.viscosity=1", "end_time=0.03", "reference.decay=none", "reference.velocity_l2=none",
        f"reference.speed_l1.exact={DECAY}*hypot(cos(2*pi*x)*sin(2*pi*y), sin(2*pi*x)*cos(2*pi*y))",
        "gauges.energy.interval=0.01", "gauges.momentum.interval=0.01", "output.particles.interval=0.01"]  # fmt: skip
NO_EXACT = ["reference.centre_pressure=none", "reference.centre_noise=none"]

# name -> (case file, overrides, entries of its `reference`)
RUNS: dict[str, tuple[str, list[str], tuple[str, ...]]] = {
    "poiseuille 40": ("poiseuille", ["gauges.energy=none"], ("profile", "profile_at_10_ms")),
    "taylor-green 50, Re 100": ("taylor_green", [], ("speed_l1", "decay")),
    "taylor-green 100, Re 100": ("taylor_green", ["particle_spacing=1/100"], ("speed_l1", "decay")),
    "taylor-green 50, Re 1, lattice": ("taylor_green_lattice", SLOW, ("speed_l1",)),
    "viscous drop, Re 10": ("elliptic_drop", ["phases.water.viscosity=1e4", *NO_EXACT], ("area",)),
    "viscous drop, Re 1": ("elliptic_drop", ["phases.water.viscosity=1e5", "end_time=0.008", *NO_EXACT], ("area",)),
    "rotating square 50, Re 100": (
        "rotating_square", [], ("centre_pressure", "angular_momentum", "outline_1", "outline_3", "outline_5"),
    ),
    "poiseuille 80": ("poiseuille", ["particle_spacing=1e-3/80", "gauges.energy=none"], ("profile", "profile_at_10_ms")),
}  # fmt: skip
LONG = ("poiseuille 80",)  # whose explicit run takes a quarter of an hour
# of the last row of a gauge: name -> (run, gauge, column)
VALUES = {
    "semi_axis_x": ("viscous drop*", "shape", "semi_axis_x water"),
    "semi_axis_y": ("viscous drop*", "shape", "semi_axis_y water"),
    "kinetic": ("viscous drop*", "energy", "kinetic"),
}


def measure(name: str, overrides: list[str], device: str, threads: int) -> dict[str, Any]:
    """Run a case and return {seconds, steps, errors by entry, values at the end, failed: text or None ...}."""
    case_name, own, entries = RUNS[name]
    case = load_case(CASES / f"{case_name}.yaml", ["numerics.scheme=isph", *own, *overrides])
    simulation = Simulation(case, device=device, threads=threads)
    begin, failed = time.process_time(), None  # of one thread: others on the machine do not count
    try:
        simulation.run()
    except WarpsphError:
        failed = f"diverged at t = {simulation.model.time:.4g} s"
    seconds = time.process_time() - begin
    found = simulation.summary.get("errors", {})
    steps = simulation.model.steps
    result: dict[str, Any] = {"seconds": seconds, "steps": steps, "errors": {}, "values": {}, "failed": failed}
    viscous = simulation.summary.get("solver", {}).get("viscosity")
    if viscous:
        result["viscous_iterations_a_step"] = viscous["iterations"] / max(steps, 1)
        result["viscous_failures"] = viscous["failures"]
    if failed is None:
        result["errors"] = {entry: found[entry]["error"] for entry in entries if found[entry].get("error") is not None}
        for quantity, (pattern, gauge, column) in VALUES.items():
            if fnmatch.fnmatch(name, pattern):
                result["values"][quantity] = float(simulation.gauge(gauge)[column][-1])
    return result


def main() -> int:
    """Print the table; return 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=["*"], help="patterns of run names")
    parser.add_argument("--changes", nargs="*", type=float, default=[incompressible.CHANGE], help="limits to try")
    parser.add_argument("--all", action="store_true", help="also explicit Poiseuille flow at 80, a quarter of an hour")
    parser.add_argument("--set", nargs="*", default=[], help="more overrides")
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    options = parser.parse_args()
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"viscosity of projection ISPH, {options.device}: errors in per cent of the reference")
    for column in ("run", "viscosity", "steps", "s", "errors [%]", "values"):
        table.add_column(column, justify="left" if column in ("run", "viscosity") else "right")
    rows = []
    for name in RUNS:
        if not any(fnmatch.fnmatch(name, pattern) for pattern in options.only):
            continue
        kinds = [("explicit", "false", 0.0)] if options.all or name not in LONG else []
        kinds += [(f"implicit, {change:g}", "true", change) for change in options.changes]
        for kind, implicit, change in kinds:
            incompressible.CHANGE = change
            overrides = [*options.set, f"numerics.implicit_viscosity={implicit}"]
            result = measure(name, overrides, options.device, options.threads)
            rows.append({"run": name, "viscosity": kind, **result})
            print(rows[-1], file=sys.stderr, flush=True)
            errors = ", ".join(f"{entry} {100 * error:.3g}" for entry, error in result["errors"].items())
            values = ", ".join(f"{entry} {value:.5g}" for entry, value in result["values"].items())
            table.add_row(name, kind, str(result["steps"]), f"{result['seconds']:.1f}", result["failed"] or errors, values)
    Console(width=200).print(table)
    if options.json is not None:
        command = "python scripts/isph_viscosity.py " + " ".join(sys.argv[1:])
        data = {**provenance(), "command": command, "device": options.device, "threads": options.threads, "rows": rows}
        options.json.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
