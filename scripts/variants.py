"""Errors of validation runs under variants of keys, side by side: what a choice is worth, scene by scene.

    python scripts/variants.py 'square_droplet-52' 'hysing_1-24' --variant "" --variant numerics.acoustic_relaxation=1
    python scripts/variants.py 'square_droplet-*' --variant "phases.gas.sound_speed=20 numerics.courant=0.25" --json out.json

Runs are named as `validate` names them, CASE-RUN of any level, and * stands for anything; those of other schemes are left
out unless --all. A variant is a list of key=value, "" the case as it is. Of each reference the error stands in the table: in
per cent, or in its unit where the reference is 0; for runs of two variants at once start the script twice.
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
from warpsph.case.yaml_text import read_yaml
from warpsph.errors import WarpsphError
from warpsph.simulation import Simulation
from warpsph.study.provenance import provenance
from warpsph.study.validation import Planned, find_cases, runs_of


def chosen(patterns: list[str], every: bool, places: list[Path]) -> list[Planned]:
    """The runs, in the order of the patterns. Exits where one fits none."""
    cases = find_cases(places)
    found: list[Planned] = []
    for pattern in patterns:
        own: dict[str, Planned] = {}
        for name, path in cases.items():
            if fnmatch.fnmatchcase(name, pattern.split("-")[0]):
                own |= {run.name: run for run in runs_of(load_case(path), name)}
        fitting = [run for run in own.values() if fnmatch.fnmatchcase(run.name, pattern)]
        found += [run for run in fitting if every or run.case.numerics.scheme == "riemann"]
        if not fitting:
            sys.exit(f"no run is called {pattern}")
    return found


def measure(run: Planned, variant: str, device: str, threads: int, precision: str | None) -> dict[str, Any]:
    """Run a variant and return its seconds, steps, sound speeds, errors by reference, or where it ended."""
    changes: dict[str, Any] = {key: read_yaml(value) for key, value in (text.split("=", 1) for text in variant.split())}
    if precision:
        changes["precision"] = precision
    case = run.case.replace(changes) if changes else run.case
    simulation = Simulation(case, device=device, threads=threads)
    begin, failed = time.perf_counter(), None
    try:
        simulation.run()
    except WarpsphError as error:
        failed = f"{type(error).__name__} at {simulation.model.time:.4g} s"
    errors = {}
    for name, row in simulation.summary.get("errors", {}).items():
        relative = "absolute" not in str(row.get("note", ""))
        errors[name] = {"error": row.get("error"), "value": row.get("value"), "relative": relative}
    return {
        "seconds": round(time.perf_counter() - begin, 1),
        "steps": simulation.model.steps,
        "sound_speed": list(simulation.physics.sound_speed),
        "failed": failed,
        "errors": errors,
    }


def shown(result: dict[str, Any], name: str) -> str:
    """An error as it stands in the table."""
    row = result["errors"].get(name)
    if row is None or row["error"] is None:
        return "-"
    return f"{100 * row['error']:.3g} %" if row["relative"] else f"{row['error']:.3g}"


def main() -> int:
    """Print a table for each run; return 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", metavar="CASE-RUN")
    parser.add_argument("--variant", action="append", help='"KEY=VALUE KEY=VALUE"; "" is the case as it is')
    parser.add_argument("--cases", nargs="+", type=Path, default=[], help="files or folders (default: the shipped cases)")
    parser.add_argument("--all", action="store_true", help="runs of other schemes too")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--precision", choices=["float32", "float64"])
    parser.add_argument("--json", type=Path, help="write the numbers to this file, after each run")
    options = parser.parse_args()
    if wrong := [text for variant in options.variant or [] for text in variant.split() if "=" not in text]:
        parser.error(f"--variant: {wrong[0]} needs the form KEY=VALUE")
    planned = chosen(options.runs, options.all, options.cases)
    if not planned:
        parser.error(f"{' '.join(options.runs)}: runs of other schemes are left out; add --all")
    data: dict[str, Any] = {**provenance(), "command": "python scripts/variants.py " + " ".join(sys.argv[1:])}
    data |= {"device": options.device, "runs": {}}
    for run in planned:
        results = {}
        for variant in options.variant or [""]:
            results[variant] = measure(run, variant, options.device, options.threads, options.precision)
            data["runs"][run.name] = results
            if options.json is not None:
                options.json.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
        names = list(dict.fromkeys(name for result in results.values() for name in result["errors"]))
        print(f"\n{run.name}: c = {', '.join(f'{c:.4g}' for c in next(iter(results.values()))['sound_speed'])} m/s\n")
        print("| variant | seconds | steps | " + " | ".join(names) + " |")
        print("|---|---|---|" + "---|" * len(names))
        for variant, result in results.items():
            cells = [result["failed"] or f"{result['seconds']:g}", str(result["steps"])]
            cells = [variant or "as it is", *cells, *(shown(result, name) for name in names)]
            print("| " + " | ".join(cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
