"""What each choice of projection ISPH is worth: error against seconds of its variants, on the same runs.

    python scripts/isph_variants.py                      # CPU, minutes
    python scripts/isph_variants.py --threads 2 --json benchmarks/isph_variants_cpu.json

Each row is one variant, the default with one choice changed, or the printed scheme; each pair of columns one case. Errors
are those of the `reference` section of the case file that the column names. A run that diverged shows when it did.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

from warpsph.case.case_file import load_case
from warpsph.errors import WarpsphError
from warpsph.simulation import Simulation
from warpsph.study.provenance import provenance

CASES = Path(__file__).resolve().parent.parent / "cases"

# name -> overrides of the default
VARIANTS: dict[str, list[str]] = {
    "default": [],
    "printed scheme": ["numerics.formulation=paper"],
    "first order in time": ["numerics.time_order=1"],
    "no deferred correction": ["numerics.deferred_correction=false"],
    "divergence out at once": ["numerics.relaxed_divergence=false"],
    "p = 0 at the particles": ["numerics.surface_offset=0"],
    "conservative gradient": ["numerics.pressure_gradient=conservative"],
    "no shifting": ["numerics.shifting=0"],
    "no filter of the velocity": ["numerics.velocity_filter=0"],
    "no volume feedback": ["numerics.volume_feedback=0"],
    "explicit viscosity": ["numerics.implicit_viscosity=false"],
    "half the time step": ["numerics.courant=0.2"],
    "tolerance 1e-4": ["numerics.tolerance=1e-4"],
}
# name -> (case file, overrides, entries of its `reference`)
RUNS: dict[str, tuple[str, list[str], tuple[str, ...]]] = {
    "elliptic drop 0.04": (
        "elliptic_drop",
        ["reference.centre_pressure.window=[1e-4, 0.012]"],
        ("semi_axis_x", "semi_axis_y", "centre_pressure"),
    ),
    "Taylor-Green 50": ("taylor_green", [], ("speed_l1",)),
    "dam break": ("dam_break", ["gauges.load=none", "end_time=0.6"], ("front",)),
}  # fmt: skip


def measure(
    case_name: str, overrides: list[str], entries: tuple[str, ...], device: str, threads: int
) -> dict[str, object]:
    """Run a case and return {seconds, steps, errors by entry, failed: text or None}."""
    case = load_case(CASES / f"{case_name}.yaml", ["numerics.scheme=isph", *overrides])
    simulation = Simulation(case, device=device, threads=threads)
    begin, failed = time.perf_counter(), None
    try:
        simulation.run()
    except WarpsphError:
        failed = f"diverged at t = {simulation.model.time:.4g} s"
    seconds = time.perf_counter() - begin
    found = simulation.summary.get("errors", {})
    errors = {}
    if failed is None:
        errors = {name: found[name]["error"] for name in entries if found.get(name, {}).get("error") is not None}
    return {"seconds": seconds, "steps": simulation.model.steps, "errors": errors, "failed": failed}


def main() -> int:
    """Print the table; return 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only", nargs="*", choices=sorted(RUNS), default=None, help="cases")
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    options = parser.parse_args()
    from rich.console import Console
    from rich.table import Table

    runs = {name: RUNS[name] for name in options.only or RUNS}
    table = Table(title=f"projection ISPH, {options.device}: errors in per cent of the reference, seconds of the run")
    table.add_column("variant")
    for name, (_, _, entries) in runs.items():
        table.add_column(f"{name}: {', '.join(entries)}", justify="right")
        table.add_column("s", justify="right")
    rows: dict[str, dict[str, object]] = {}
    for variant, overrides in VARIANTS.items():
        cells, rows[variant] = [variant], {}
        for name, (case_name, own, entries) in runs.items():
            result = measure(case_name, [*own, *overrides], entries, options.device, options.threads)
            rows[variant][name] = result
            errors = result["errors"]
            assert isinstance(errors, dict)
            shown = str(result["failed"]) if result["failed"] else ", ".join(f"{100 * e:.2f}" for e in errors.values())
            cells += [shown, f"{result['seconds']:.1f}"]
        table.add_row(*cells)
        print(f"{variant}: {rows[variant]}", file=sys.stderr, flush=True)
    Console(width=200).print(table)
    if options.json is not None:
        command = "python scripts/isph_variants.py " + " ".join(sys.argv[1:])
        data = {**provenance(), "command": command, "device": options.device, "variants": rows}
        options.json.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
