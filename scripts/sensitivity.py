"""What half and double of each constant that is not derived changes: the runs that feel it, made again with both.

    python scripts/sensitivity.py --workers 30 --output benchmarks/sensitivity.json
    python scripts/sensitivity.py --only 'kernels.riemann.*' --output one.json      # constants whose name fits
    python scripts/sensitivity.py --list                                            # jobs that are left, none is run

scripts/constants.yaml has the constants, with meaning, source and runs. A job is a run of the level ci with one constant at
1, 1/2 or 2 times its value, in a process of its own: there the source of the constant's module is changed while it is
imported, so that copies by `from ... import` and numbers that are made of it follow. Jobs that stand in the output file are
not run again. A run that diverges, or takes longer than --limit, is a result.

    record: {commit, dirty, date, command, device, jobs}
    jobs: "<constant> <factor> <case>/<run>" -> {commit, seconds, steps, failed, errors}; no constant: the run as it is
    errors: quantity -> {error, allowed, absolute}: error of the reference, its limit, whether in the unit of the quantity
"""

from __future__ import annotations

import argparse
import ast
import fnmatch
import importlib.abc
import importlib.machinery
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CONSTANTS = ROOT / "scripts" / "constants.yaml"
FACTORS = (0.5, 2.0)
KINDS = ("literature", "calibrated", "safety")


@dataclass(frozen=True)
class Constant:
    """An entry of the list.

    name: dotted, as it is imported; meaning: with its unit; source: literature or measurement it comes from
    kind: one of KINDS; runs: "<case>/<run>" of the level ci that feel it
    """

    name: str
    meaning: str
    source: str
    kind: str
    runs: tuple[str, ...]


@dataclass(frozen=True)
class Job:
    """A run with a constant at `factor` times its value; the constant "" and the factor 1: the run as it is."""

    constant: str
    factor: float
    run: str

    @property
    def key(self) -> str:
        return f"{self.constant} {self.factor:g} {self.run}"


def constants() -> list[Constant]:
    """The list. Raises ValueError for an entry of an unknown kind, TypeError for one with other keys."""
    from ruamel.yaml import YAML

    entries = YAML(typ="safe").load(CONSTANTS.read_text(encoding="utf-8"))
    found = [Constant(**{**entry, "runs": tuple(entry["runs"])}) for entry in entries]
    for entry in found:
        if entry.kind not in KINDS:
            raise ValueError(f"{entry.name}: kind is {entry.kind}; it must be one of {', '.join(KINDS)}")
    return found


# ---- a constant changed ----------------------------------------------------------------------------------


def scaled(value: ast.expr, factor: float) -> ast.expr:
    """A number, or each number of a tuple or of the values of a dict, times a factor; integers stay integers."""
    if isinstance(value, ast.Tuple):
        return ast.copy_location(ast.Tuple([scaled(part, factor) for part in value.elts], ast.Load()), value)
    if isinstance(value, ast.Dict):
        return ast.copy_location(ast.Dict(value.keys, [scaled(part, factor) for part in value.values]), value)
    product: ast.expr = ast.BinOp(value, ast.Mult(), ast.Constant(factor))
    if isinstance(value, ast.Constant) and isinstance(value.value, int):
        product = ast.Call(ast.Name("round", ast.Load()), [product], [])
    return ast.copy_location(product, value)


def assigned(tree: ast.Module, name: str) -> ast.expr:
    """The expression that a module gives to `name` at its head. Raises LookupError if there is none."""
    for node in tree.body:
        if not isinstance(node, ast.Assign):
            continue
        (target,) = node.targets
        if isinstance(target, ast.Name) and target.id == name:
            return node.value
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            for part, value in zip(target.elts, node.value.elts, strict=True):
                if isinstance(part, ast.Name) and part.id == name:
                    return value
    raise LookupError(f"no constant {name} is assigned at the head of the module")


def changed_source(source: str, name: str, factor: float) -> ast.Module:
    """The syntax tree of a module whose constant `name` is `factor` times as large. Raises LookupError if it has none."""
    tree = ast.parse(source)
    value = assigned(tree, name)

    class Replace(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return scaled(value, factor) if node is value else self.generic_visit(node)

    return ast.fix_missing_locations(Replace().visit(tree))


class ChangedLoader(importlib.machinery.SourceFileLoader):
    """Loads a module with one constant changed, never from compiled files."""

    def __init__(self, module: str, path: str, name: str, factor: float) -> None:
        super().__init__(module, path)
        self.changes = (name, factor)

    def get_code(self, fullname: str) -> CodeType:
        source = Path(self.path).read_text(encoding="utf-8")
        # not with the annotations of this file's __future__: Warp reads those of a kernel as objects
        code: CodeType = compile(changed_source(source, *self.changes), self.path, "exec", dont_inherit=True)
        return code


class ChangedFinder(importlib.abc.MetaPathFinder):
    """Finds the module of a constant, and leaves all others to the usual finders."""

    def __init__(self, constant: str, factor: float) -> None:
        self.module, _, self.name = constant.rpartition(".")
        self.factor = factor

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self.module:
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path)
        if spec is not None and spec.origin is not None:
            spec.loader = ChangedLoader(fullname, spec.origin, self.name, self.factor)
        return spec


def change(constant: str, factor: float) -> None:
    """Make every later import of the constant's module see it changed. Raises RuntimeError if it is imported already."""
    finder = ChangedFinder(constant, factor)
    if finder.module in sys.modules:
        raise RuntimeError(f"{finder.module} is imported already: its constant cannot be changed any more")
    sys.meta_path.insert(0, finder)


# ---- one job ---------------------------------------------------------------------------------------------


def measure(job: Job, device: str) -> dict[str, Any]:
    """Run a job in this process; return its seconds, steps, errors and, where it ended early, how."""
    if job.constant:
        change(job.constant, job.factor)
    from warpsph.case.case_file import load_case
    from warpsph.errors import WarpsphError
    from warpsph.simulation import Simulation
    from warpsph.study.validation import find_cases, runs_of

    name, _, run = job.run.partition("/")
    (case,) = [planned.case for planned in runs_of(load_case(find_cases()[name]), name, ["ci"]) if planned.run.name == run]
    begin, failed, steps, rows = time.perf_counter(), None, None, {}
    try:
        simulation = Simulation(case, device=device, threads=1)
        simulation.run()
        rows = simulation.summary.get("errors", {})
    except WarpsphError as error:
        failed = type(error).__name__
    if job.constant and job.constant.rpartition(".")[0] not in sys.modules:
        raise RuntimeError(f"{job.run} never imports the module of {job.constant}: it cannot feel it")
    if failed is None:
        steps = simulation.model.steps
    errors = {quantity: entry_of(row) for quantity, row in rows.items()}
    return {"seconds": round(time.perf_counter() - begin, 1), "steps": steps, "failed": failed, "errors": errors}


def entry_of(row: dict[str, Any]) -> dict[str, Any]:
    """What is kept of a row of the errors of a run."""
    absolute = "absolute" in str(row.get("note", ""))
    return {"error": row.get("error"), "allowed": row.get("allowed"), "absolute": absolute}


def measured_apart(job: Job, options: argparse.Namespace) -> dict[str, Any]:
    """Run a job in a process of its own; a process that dies or takes too long is a result."""
    command = [sys.executable, "-P", str(Path(__file__).resolve()), "--device", options.device]
    command += ["--job", job.constant, str(job.factor), job.run]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    empty = {"seconds": None, "steps": None, "errors": {}}
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=options.limit, check=False
        )
    except subprocess.TimeoutExpired:
        return {**empty, "failed": f"not ended in {options.limit:g} s"}
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or ["nothing"]
        return {**empty, "failed": f"exit code {done.returncode}: {said[-1][:200]}"}
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


# ---- all jobs --------------------------------------------------------------------------------------------


def jobs_of(entries: Sequence[Constant]) -> Iterator[Job]:
    """Each run as it is, once, and with each constant that it feels at each factor."""
    for run in dict.fromkeys(run for entry in entries for run in entry.runs):
        yield Job("", 1.0, run)
    for entry in entries:
        for factor in FACTORS:
            for run in entry.runs:
                yield Job(entry.name, factor, run)


def usual_seconds() -> dict[str, float]:
    """How long each run of the level ci took when its errors were recorded."""
    record = json.loads((ROOT / "benchmarks" / "baseline_ci.json").read_text(encoding="utf-8"))
    return {run: float(entry["seconds"]) for run, entry in record["runs"].items()}


def main() -> int:
    """Run the jobs that are left, the longest first, and write the record after each; return 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, help="the record; jobs that stand in it are not run again")
    parser.add_argument("--only", default="*", metavar="PATTERN", help="constants whose name fits")
    parser.add_argument("--workers", type=int, default=1, help="processes at a time")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--limit", type=float, default=240.0, help="seconds that a job may take")
    parser.add_argument("--shortest-first", action="store_true", help="the other way round, for a run that will be cut off")
    parser.add_argument("--list", action="store_true", help="print the jobs that are left")
    parser.add_argument("--job", nargs=3, metavar=("CONSTANT", "FACTOR", "RUN"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.job:
        constant, factor, run = options.job
        print(json.dumps(measure(Job(constant, float(factor), run), options.device)))
        return 0
    if options.output is None and not options.list:
        parser.error("--output FILE is needed")
    from warpsph.study.provenance import provenance

    origin = provenance()
    record: dict[str, Any] = {"jobs": {}}
    if options.output is not None and options.output.exists():
        record = json.loads(options.output.read_text(encoding="utf-8"))
    record = {**origin, "command": "python scripts/sensitivity.py " + " ".join(sys.argv[1:]), "device": options.device} | {
        "jobs": record["jobs"]
    }
    usual = usual_seconds()
    left = [job for job in jobs_of([entry for entry in constants() if fnmatch.fnmatchcase(entry.name, options.only)])]
    left = [job for job in left if job.key not in record["jobs"]]
    left.sort(key=lambda job: usual.get(job.run, 0.0), reverse=not options.shortest_first)
    if options.list:
        for job in left:
            print(f"{usual.get(job.run, 0.0):6.1f} s  {job.key}")
        return 0
    with ThreadPoolExecutor(options.workers) as pool:
        waiting = {pool.submit(measured_apart, job, options): job for job in left}
        for count, future in enumerate(as_completed(waiting), 1):
            job, result = waiting[future], future.result()
            record["jobs"][job.key] = {"commit": origin["commit"], **result}
            part = options.output.with_suffix(".part")
            part.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
            part.replace(options.output)
            print(f"{count}/{len(left)} {job.key}: {result['failed'] or result['seconds']}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
