#!/usr/bin/env python3
"""Hashes of final states: whether a change of the program changed a result.

    python scripts/state_hashes.py --output before.txt           # on one commit
    python scripts/state_hashes.py --against before.txt          # on another: exit 1 if a hash differs

Each case runs a few steps in both precisions, on one and on two threads (or on a CUDA device), coarsened to at most
--particles. What is hashed: positions, velocities, densities, pressures, masses and phases of all particles, and time.
It uses the public API alone, so that the same script measures any commit.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

CASES = Path(__file__).resolve().parent.parent / "cases"
HASHED = ("position", "velocity", "density", "pressure", "mass", "phase", "particle_id")


def shortened(path: Path, precision: str, particles: int, steps: int) -> Any:
    """Return a case that runs about so many steps with at most so many particles, and measures nothing."""
    import warpsph
    try:
        from warpsph.running.preview import estimate
    except ImportError:  # commits before the rooms
        from warpsph.simulation import estimate

    case = warpsph.load_case(path)
    plain = {"gauges": {}, "reference": {}, "output": {"particles": "none", "checkpoint": "none"}, "precision": precision}
    case = case.replace(plain)
    most = particles * (5 if case.dimension == 3 else 1)  # three axes need more to have an inside
    spacing = case.spacing
    for _ in range(20):
        found = estimate(case)
        if "dt" in found and found["particles"] + found["walls"] <= most:
            break
        spacing *= 1.25 if "dt" in found else 2.0
        case = case.replace({"particle_spacing": spacing})
    return case.replace({"end_time": steps * estimate(case)["dt"]})


def state_hash(path: Path, precision: str, device: str, threads: int, particles: int, steps: int) -> str:
    """Run a case and return the hash of its final state."""
    import numpy as np

    import warpsph

    case = shortened(path, precision, particles, steps)
    state = warpsph.run(case, device=device, threads=threads).state
    digest = hashlib.sha256()
    for name in HASHED:
        digest.update(np.ascontiguousarray(getattr(state, name)).tobytes())
    digest.update(np.float64(state.time).tobytes())
    return f"{digest.hexdigest()[:16]} {len(state)} particles {state.step} steps"


def runs(device: str) -> Iterator[tuple[Path, str, int]]:
    """Yield (case, precision, threads) of everything that is hashed."""
    for path in sorted(CASES.glob("*.yaml")):
        for precision in ("float32", "float64"):
            for threads in (1, 2) if device == "cpu" else (1,):
                yield path, precision, threads


def line(job: tuple[Path, str, int], device: str, particles: int, steps: int) -> str:
    """Return one line of the table."""
    path, precision, threads = job
    try:
        found = state_hash(path, precision, device, threads, particles, steps)
    except Exception as error:  # a case that fails has to fail in the same way after the change
        found = f"{type(error).__name__}: {str(error).splitlines()[0][:100]}"
    return f"{path.stem:26s} {precision} {device} {threads}: {found}"


def main() -> int:
    """Print the hashes, and compare them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, help="write the table there too")
    parser.add_argument("--against", type=Path, help="a table to compare with")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--steps", type=int, default=25)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", default="", help="cases whose name contains this")
    options = parser.parse_args()
    jobs = [job for job in runs(options.device) if options.only in job[0].stem]
    begin, lines = time.perf_counter(), []
    with ProcessPoolExecutor(options.processes) as pool:
        waiting = [pool.submit(line, job, options.device, options.particles, options.steps) for job in jobs]
        for future in waiting:
            lines.append(future.result())
            print(lines[-1], flush=True)
    print(f"# {len(lines)} states in {time.perf_counter() - begin:.0f} s", file=sys.stderr)
    if options.output is not None:
        options.output.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if options.against is None:
        return 0
    wanted = set(options.against.read_text(encoding="utf-8").splitlines())
    wrong = [text for text in lines if text not in wanted]
    print(f"# {len(lines) - len(wrong)} of {len(lines)} as in {options.against}", file=sys.stderr)
    for text in wrong:
        print(f"# differs: {text}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
