"""What scripts share that judge random scenes: their options, a row printed for each run, the file, the exit code."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from warpsph.errors import CaseError
from warpsph.study.provenance import provenance

SCHEMES = ("riemann", "isph", "delta_plus")


def parser_of(text: str | None, first: int) -> argparse.ArgumentParser:
    """Return the parser of a script with a docstring `text`, whose first seed is `first` unless another is given."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20, help="scenes a scheme")
    parser.add_argument("--first", type=int, default=first, help="seed of the first")
    parser.add_argument("--schemes", nargs="+", default=list(SCHEMES), choices=SCHEMES)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", type=Path, help="file to write")
    return parser


def options_of(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Return the options of the command line; what is wrong with them is told before anything runs."""
    options = parser.parse_args()
    if options.count < 1 or options.processes < 1:
        parser.error("--count and --processes have to be 1 or more")
    if options.json and not options.json.absolute().parent.is_dir():
        parser.error(f"--json {options.json}: its folder does not exist")
    return options


def run_changed(
    text: str | None,
    scene: Callable[[int, str, list[str]], Any],
    run: Callable[[tuple[int, str, Any]], dict[str, Any]],
    missed: Callable[[dict[str, Any]], bool],
    shown: Callable[[dict[str, Any]], str],
) -> int:
    """Be the main function of a script with a docstring `text` whose scenes have keys changed by `--set`; see `run_all`.

    scene: (seed, scheme, changes) -> what a run makes of it; of the first in each scheme wrong changes are told.
    """
    parser = parser_of(text, first=0)
    parser.add_argument("--set", action="append", default=[], dest="changes", metavar="KEY=VALUE", help="a key of all cases")
    options = options_of(parser)
    for scheme in options.schemes:
        try:
            scene(options.first, scheme, options.changes)
        except CaseError as error:
            parser.error(f"--set in {scheme}: {error}")
    return run_all(options, options.changes, run, missed, shown)


def run_all(
    options: argparse.Namespace,
    more: Any,
    run: Callable[[tuple[int, str, Any]], dict[str, Any]],
    missed: Callable[[dict[str, Any]], bool],
    shown: Callable[[dict[str, Any]], str],
) -> int:
    """Run each seed in each scheme, print a line each, write the file; return 1 if any is missed.

    run: (seed, scheme, more) -> row with `diverged` [s] or None; shown: what is printed of a row.
    """
    seeds: Sequence[int] = range(options.first, options.first + options.count)
    rows = []
    with ProcessPoolExecutor(options.processes) as pool:
        for row in pool.map(run, [(seed, scheme, more) for seed in seeds for scheme in options.schemes]):
            rows.append(row)
            ending = "" if row["diverged"] is None else f"diverged at {row['diverged']:.4g} s"
            print(f"{shown(row)}  {'MISSED ' if missed(row) else ''}{ending}", flush=True)
    if options.json:
        record = {**provenance(), "command": "python " + " ".join(sys.argv), "rows": rows}
        options.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    failed = sum(map(missed, rows))
    print(f"{len(rows)} runs, {failed} missed, {sum(row['diverged'] is not None for row in rows)} of them diverged")
    return int(failed > 0)
