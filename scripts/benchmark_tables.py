"""Tables, pictures and the shipped table of the benchmark, from its records.

    python scripts/benchmark_tables.py [--pictures]     # writes warpsph/fronts.json, and docs/benchmark/*.png

Records are benchmarks/front_cpu.json and, if it is there, front_h200.json, as `python -m warpsph benchmark --json` writes
them; pictures of the latter are docs/benchmark/h200/*.png. Other codes, which ran on a CPU, come from benchmarks/peers.json.
The tables of docs/benchmark.md are written by `scripts/write_tables.py`, which also says whether warpsph/fronts.json is as
the records say.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from warpsph.case.plain import set_path
from warpsph.cli.benchmark_command import read_peers
from warpsph.files.output import json_text
from warpsph.study.benchmark import Benchmark, draw_benchmark, read_benchmark
from warpsph.study.benchmark_advice import FILE, features, identity, length
from warpsph.study.benchmark_pictures import comparable
from warpsph.study.benchmark_plan import LEVELS, Planned, find_plans, planned
from warpsph.study.fronts import (
    NOISE,
    TARGETS,
    Row,
    by_case,
    distances,
    front,
    most_accurate,
    quickest,
    quickest_for_sure,
    seconds_of,
)

ROOT = Path(__file__).resolve().parents[1]
DEVICES = ("cpu", "h200")
"""Records are front_NAME.json; the pictures of the first stand in docs/benchmark, of the others in a folder of that name."""

KEPT = ("case", "choice", "particle_spacing", "precision", "device", "threads", "seconds", "steps", "particles", "error")
"""What the shipped table holds of a run."""

Cells = tuple[list[str], str, list[list[str]]]
"""Head, alignment and rows of a table."""


def records() -> dict[str, Benchmark]:
    """The stored benchmarks by their device."""
    paths = {name: ROOT / "benchmarks" / f"front_{name}.json" for name in DEVICES}
    return {name: read_benchmark(path) for name, path in paths.items() if path.exists()}


def percent(error: float | None) -> str:
    """An error as text."""
    return "none" if error is None else f"{100 * error:.2g} %"


def of_run(row: Row) -> str:
    """Choice, spacing and seconds of a run."""
    return f"{row['choice']}, {row['particle_spacing']:.4g} m, {row['seconds']:.2g} s"


# ---- tables ----------------------------------------------------------------------------------------------


def fronts(found: Benchmark) -> Cells:
    """Every run on the front of its case."""
    lines = []
    for name, rows in by_case(found.rows).items():
        for place, row in enumerate(front(rows)):
            memory = f"{row['memory_bytes'] / 2**20:.2g}"
            lines.append(
                [f"`{name}`" if place == 0 else "", row["choice"], f"{row['particle_spacing']:.4g}", str(row["particles"]),
                 str(row["steps"]), f"{row['seconds']:.2g}", memory, percent(row["error"])]
            )  # fmt: skip
    return ["case", "choice", "spacing [m]", "particles", "steps", "seconds", "MiB", "error"], "llrrrrrr", lines


def defaults(found: Benchmark) -> Cells:
    """Whether the default form lies on the front, and if not what is quicker and as accurate."""
    lines = []
    for name, rows in by_case(found.rows).items():
        for place, distance in enumerate(distances(rows)):
            row, better = distance.row, distance.better
            on = better is row
            factor = f"{distance.factor:.2f} times" if distance.factor <= NOISE else f"**{distance.factor:.2g} times**"
            told = "on the front" if on else f"{factor} that of {of_run(better)} ({percent(better['error'])})"
            first = f"`{name}`" if place == 0 else ""
            lines.append([first, f"{row['particle_spacing']:.4g}", f"{row['seconds']:.2g}", percent(row["error"]), told])
    return ["case", "spacing [m]", "seconds", "error", "time of the default"], "lrrrl", lines


def targets(found: Benchmark) -> Cells:
    """The quickest run at each of TARGETS that is no accident."""
    lines = []
    for name, rows in by_case(found.rows).items():
        cells = []
        for target in TARGETS:
            row = quickest_for_sure(rows, target)
            best = most_accurate(rows)
            least = "none" if best is None else f"{percent(best['error'])} with {best['choice']}"
            cells.append(f"not reached ({least})" if row is None else of_run(row))
        lines.append([f"`{name}`", found.cases[name]["error_name"], *cells])
    return ["case", "error", *(percent(target) for target in TARGETS)], "lllll", lines


def failures(found: Benchmark) -> Cells:
    """Runs that did not get to their end, or that have no error."""
    lines = []
    for row in found.rows:
        if row["status"] != "finished" or row["error"] is None:
            problem = str(row["problem"] or "no error").splitlines()[0]
            lines.append([f"`{row['case']}`", row["choice"], f"{row['particle_spacing']:.4g}", row["status"], problem])
    return ["case", "choice", "spacing [m]", "status", "why"], "llrll", lines


def others(found: Benchmark) -> Cells:
    """Other codes: whether they are in the picture, and what it takes here to be as accurate."""
    lines = []
    peers = read_peers(None)
    for name, rows in by_case(found.rows).items():
        drawn = comparable(peers, name, found.cases[name])
        for row in (row for row in peers if row["case"] == name):
            ours = quickest(rows, abs(row["error"])) if any(row is other for other in drawn) else None
            told = "another error: not drawn" if not any(row is other for other in drawn) else (
                "not reached" if ours is None else of_run(ours))  # fmt: skip
            lines.append(
                [f"`{name}`", f"{row['peer']} {row['version']}", f"`{row['command']}`", str(row["particles"]),
                 f"{seconds_of(row, True):.3g}", f"{row['error_name']} {percent(abs(row['error']))}", told]
            )  # fmt: skip
    return ["case", "code", "command", "particles", "seconds", "error", "here, as accurate"], "lllrrll", lines


def tables() -> dict[str, Callable[[], Cells]]:
    """The tables by name; of a device without a record they have no rows."""
    made: dict[str, Callable[[], Cells]] = {}
    for device in DEVICES:
        for make in (fronts, defaults, targets, failures, others):
            made[f"benchmark_{make.__name__}_{device}"] = lambda make=make, device=device: make(
                records().get(device, Benchmark({}))
            )
    return made


def commands() -> str:
    """The command of each record, its machine, commit and date."""
    lines = []
    for found in records().values():
        about = found.about
        threads = f"{about['threads']} thread{'' if about['threads'] == 1 else 's'}, " if about["device"] == "cpu" else ""
        lines.append(f"{about['command']}\n    # {about['device_name']}, {threads}{about['date']}, {about['commit'][:7]}\n")
    return "```sh\n" + "".join(lines) + "```\n"


# ---- what the package ships --------------------------------------------------------------------------------


def shipped() -> str:
    """The text of warpsph/fronts.json: the finished runs of all records, and what their scenes are like."""
    plans: dict[str, Planned] = {name: planned(name, path, LEVELS[0]) for name, path in find_plans().items()}
    cases, rows, sources = {}, [], []
    for found in records().values():
        keys = ("commit", "date", "command", "level", "device", "device_name", "threads")
        sources.append({key: found.about[key] for key in keys})
        for row in found.rows:
            plan = plans.get(row["case"])
            if plan is None or row["error"] is None or row["status"] != "finished":
                continue
            run = {"numerics": dict(plan.case.to_dict().get("numerics", {}))}
            for key, value in row["changes"].items():
                if key.startswith("numerics."):
                    set_path(run, key, value)
            told = ("numerics", "precision")  # whole, and as a column
            extra = {key: value for key, value in row["changes"].items() if key.partition(".")[0] not in told}
            rows.append({**{key: row[key] for key in KEPT}, "settings": {**run, **extra}})
        cases |= {name: _scene(plans[name], found) for name in found.cases if name in plans}
    return json_text({"sources": sources, "cases": cases, "rows": rows})


def _scene(plan: Planned, found: Benchmark) -> dict[str, Any]:
    """What a benchmark's scene is like."""
    about = found.cases[plan.name]
    return {
        "says": about["says"], "error_name": about["error_name"], "identity": identity(plan.case),
        "features": features(plan.case), "length": float(f"{length(plan.case):.6g}"),
    }  # fmt: skip


def pictures() -> list[Path]:
    """Draw docs/benchmark/*.png from the first record, with other codes, and docs/benchmark/NAME/*.png from the others."""
    drawn = []
    for name, found in records().items():
        first = name == DEVICES[0]
        folder = ROOT / "docs" / "benchmark" / ("" if first else name)
        folder.mkdir(exist_ok=True)
        drawn += draw_benchmark(found, folder, read_peers(None) if first else ())
    return drawn


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", action="store_true", help="draw docs/benchmark/*.png too")
    chosen = parser.parse_args(arguments)
    FILE.write_text(shipped(), encoding="utf-8")
    print(FILE)
    for path in pictures() if chosen.pictures else ():
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
