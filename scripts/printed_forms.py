#!/usr/bin/env python3
"""The cases of the papers, as printed and with the default form: errors against one reference, and seconds.

    python scripts/printed_forms.py [CASE ...] [--level quick|seed|fine] [--run NAME] [--rows NAME ...]
                                    [--device cpu|cuda:0] [--threads N] [--json FILE]

Cases are those of `cases/papers/`. Rows of each run:

* printed: as the file has it, `numerics.formulation: paper` with the settings of the paper;
* default: the same scene, spacing and times in the default form with all numbers that it takes by itself;

and of the Riemann scheme (Yang et al. 2019)

* printed, default steps: the same without its time step, half of the step (28) instead;
* printed, longest steps: all that (28) to (30) allow;
* printed, means: without the Riemann solution, (6) and (7) with the friction of (16), figure 10 b;
* printed, means, no friction: (6) and (7) as they stand, without viscosity;

of projection ISPH (Qiu 2013)

* printed, no shift: without (20), figure 4;
* printed, solved to 1e-6: the pressure equation, which is printed with 1e-3.

Errors are relative, in per cent, or absolute where the reference is 0. A run that ends early shows why in place of seconds.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.study.provenance import provenance
from warpsph.study.validation import find_cases, runs_of

sys.path.insert(0, str(Path(__file__).parent))  # when imported instead of run
from variants import measure, shown  # noqa: E402

PAPERS = Path(__file__).resolve().parent.parent / "cases" / "papers"
WITHOUT_RIEMANN = "numerics.velocity_dissipation=0"


def frictionless(case: Case) -> str:
    """Return the changes that take the viscosity out of all phases."""
    return " ".join(f"phases.{name}.viscosity=0" for name in case.phases)


def by_default(case: Case) -> str:
    """Return the changes that leave all numbers of a case to the default form."""
    changes = ["numerics.formulation=improved", "numerics.maximum_step=none", "start.arrangement=auto"]
    if case.numerics.scheme == "isph":
        return " ".join([*changes, "numerics.kernel=wendland_c2"])
    changes += ["numerics.interface_force=auto"]
    for name in case.phases:
        changes += [f"phases.{name}.sound_speed=auto", f"phases.{name}.background_pressure=0"]
    return " ".join(changes)


def rows_of(case: Case) -> dict[str, str]:
    """Return the changes of each row by its name."""
    ends = {"default": by_default(case)}
    if case.numerics.scheme == "isph":
        others = {"printed, no shift": "numerics.shifting=0", "printed, solved to 1e-6": "numerics.tolerance=1e-6"}
        return {"printed": "", **others, **ends}
    return {
        "printed": "",
        "printed, default steps": "numerics.maximum_step=none numerics.courant=0.5",
        "printed, longest steps": "numerics.maximum_step=none",
        "printed, means": WITHOUT_RIEMANN,
        "printed, means, no friction": f"{WITHOUT_RIEMANN} {frictionless(case)}",
        **ends,
    }


def main() -> int:
    """Print a table for each run; return 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="by name; default: all")
    parser.add_argument("--level", default="quick", choices=["quick", "seed", "fine"])
    parser.add_argument("--run", help="the run of this name alone, as in the file")
    parser.add_argument("--rows", nargs="+", help="these rows alone")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write the numbers to this file, after each run")
    options = parser.parse_args()
    known = find_cases([PAPERS])
    if unknown := [name for name in options.cases if name not in known]:
        parser.error(f"no case is called {', '.join(unknown)}; there are {', '.join(known)}")
    data: dict[str, Any] = {**provenance(), "command": "python scripts/printed_forms.py " + " ".join(sys.argv[1:])}
    data |= {"device": options.device, "runs": {}}
    for name in options.cases or known:
        for run in runs_of(load_case(known[name]), name):
            if run.level != options.level or (options.run and run.run.name != options.run):
                continue
            results: dict[str, dict[str, Any]] = {}
            for row, changes in rows_of(run.case).items():
                if options.rows and row not in options.rows:
                    continue
                results[row] = measure(run, changes, options.device, options.threads, None)
                data["runs"][run.name] = results
                if options.json is not None:
                    options.json.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
            print(table(run.name, results), flush=True)
    return 0


def table(title: str, results: dict[str, dict[str, Any]]) -> str:
    """Return the Markdown table of a run."""
    names = list(dict.fromkeys(name for result in results.values() for name in result["errors"]))
    lines = [f"\n{title}\n", "| form | seconds | steps | " + " | ".join(names) + " |", "|---|---|---|" + "---|" * len(names)]
    for row, result in results.items():
        cells = [row, result["failed"] or f"{result['seconds']:g}", str(result["steps"])]
        lines.append("| " + " | ".join([*cells, *(shown(result, name) for name in names)]) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
