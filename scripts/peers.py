"""Other SPH codes on scenes of the benchmark: their seconds, and their errors by the definitions that judge ours.

    python -m venv PEERS && PEERS/bin/pip install --pre pysph matplotlib h5py    # compiles for minutes
    python scripts/peers.py --python PEERS/bin/python [--only sod taylor_green ...] --json benchmarks/peers.json

Each scene is an example that PySPH ships, run as its users run it: one thread, in double precision, its own step. A short
run before compiles; what counts is the processor time of the process and, beside it, its time by the clock, without the
time to start and to read the compiled code, which a second short run takes too. The error is found here, from the particles
of its last file (`peer_errors.py`). Each run is made once.
`python -m warpsph benchmark` draws the rows in its pictures, `docs/benchmark.md` has them in a table.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # when imported instead of run
import peer_errors  # noqa: E402

from warpsph.files.whole_files import write_text  # noqa: E402
from warpsph.running.summary import machine  # noqa: E402
from warpsph.study.provenance import provenance  # noqa: E402

Particles = Mapping[str, np.ndarray]

READ = """
import glob, sys
import numpy
from pysph.solver.utils import get_files, load
last = load(get_files(sys.argv[1])[-1])
array = last["arrays"]["fluid"]
names = [name for name in ("x", "y", "u", "v", "m", "rho", "p") if name in array.properties]
numpy.savez(sys.argv[2], t=last["solver_data"]["t"], count=last["solver_data"]["count"],
            **{name: array.get(name, only_real_particles=True) for name in names})
"""
"""Run by the Python of PySPH: the last file of an output folder as plain arrays."""


@dataclass(frozen=True)
class Peer:
    """A run of PySPH.

    case: benchmark that it stands beside; scheme: of PySPH; example, arguments: of `pysph run`
    error_name: as the benchmark names it; error: from the particles of the last file
    """

    case: str
    scheme: str
    example: str
    arguments: str
    error_name: str
    error: Callable[[Particles], float]


def vortices(p: Particles) -> float:
    return peer_errors.taylor_green_l1(places(p), np.stack([p["u"], p["v"]], axis=1), float(p["t"]), 100.0)


def tip(p: Particles) -> float:
    return peer_errors.elliptic_drop(places(p), float(p["t"]))


def channel(p: Particles) -> float:
    return peer_errors.poiseuille(p["y"], p["u"], float(p["t"]), 8 * 0.01 * 1.25e-4, 0.01, 1.0)


def tube(p: Particles) -> float:
    inside = np.abs(p["x"]) <= 0.5
    return peer_errors.sod(p["x"][inside], p["rho"][inside], (p["m"] / p["rho"])[inside], float(p["t"]))


def places(p: Particles) -> np.ndarray:
    return np.stack([p["x"], p["y"]], axis=1)


DISORDERED = "--nx 50 --re 100 --perturb 0.2 --tf 2"
PEERS = (
    Peer("sod", "gsph", "gas_dynamics.sod_shocktube", "--scheme gsph --tf 0.15", "density_l1", tube),
    Peer("sod", "mpm", "gas_dynamics.sod_shocktube", "--scheme mpm --tf 0.15", "density_l1", tube),
    Peer("sod", "adke", "gas_dynamics.sod_shocktube", "--scheme adke --tf 0.15", "density_l1", tube),
    Peer("taylor_green", "edac", "taylor_green", f"--scheme edac {DISORDERED}", "speed_l1", vortices),
    Peer("taylor_green", "tvf", "taylor_green", f"--scheme tvf {DISORDERED}", "speed_l1", vortices),
    Peer("taylor_green", "sisph", "taylor_green", "--scheme sisph --nx 50 --re 100 --tf 2", "speed_l1", vortices),
    Peer("poiseuille", "tvf", "poiseuille", "--tf 10", "velocity_l2", channel),
    Peer("elliptic_drop", "iisph", "elliptical_drop", "--scheme iisph --tf 0.0076", "height", tip),
    Peer("elliptic_drop", "wcsph", "elliptical_drop", "--scheme wcsph --tf 0.0076", "height", tip),
)


def measured(python: Path, peer: Peer, folder: Path) -> dict[str, object]:
    """Run a peer, before that twice for a few steps, and return its row. Raises CalledProcessError where it fails."""
    line = [str(python.parent / "pysph"), "run", peer.example, *shlex.split(peer.arguments)]
    short = [*line, "--max-steps", "2", "-d", str(folder / "first")]
    timed(short)  # compiles
    start_wall, start_cpu = timed(short)
    timed_folder = folder / "whole"
    wall, cpu = timed([*line, "--pfreq", "1000000", "-d", str(timed_folder)])
    arrays = folder / "last.npz"
    subprocess.run([str(python), "-c", READ, str(timed_folder), str(arrays)], check=True, capture_output=True)
    last = dict(np.load(arrays))
    return {
        "case": peer.case,
        "peer": f"PySPH {peer.scheme}",
        "version": version(python),
        "command": f"pysph run {peer.example} {peer.arguments}",
        "particles": len(last["x"]),
        "steps": int(last["count"]),
        "seconds": wall - start_wall,
        "cpu_seconds": cpu - start_cpu,
        "error": peer.error(last),
        "error_name": peer.error_name,
        "machine": machine()["processor"],
        "threads": 1,
    }


def timed(line: list[str]) -> tuple[float, float]:
    """Run a command on one thread; return its seconds by the clock and of the processor."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(line, check=True, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def version(python: Path) -> str:
    """Version of PySPH in an environment."""
    code = "import importlib.metadata as m; print(m.version('pysph'))"
    return subprocess.run([str(python), "-c", code], check=True, capture_output=True, text=True).stdout.strip()


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", type=Path, required=True, help="the Python of an environment that has PySPH")
    parser.add_argument("--only", nargs="+", default=[], metavar="CASE", help="cases of the benchmark")
    parser.add_argument("--json", type=Path, help="rows are added to this file, in place of those of the same command")
    chosen = parser.parse_args(arguments)
    if not (chosen.python.parent / "pysph").exists():
        parser.error(
            f"--python {chosen.python}: there is no PySPH beside it; "
            "make an environment with pip install --pre pysph matplotlib h5py"
        )
    if strangers := [name for name in chosen.only if name not in {peer.case for peer in PEERS}]:
        parser.error(f"--only {strangers[0]}: choose from {', '.join(dict.fromkeys(peer.case for peer in PEERS))}")
    rows, failed = [], 0
    for peer in PEERS:
        if chosen.only and peer.case not in chosen.only:
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                row = measured(chosen.python, peer, Path(folder))
            except subprocess.CalledProcessError as error:
                print(f"{peer.case} {peer.scheme}: failed\n{(error.stderr or '')[-2000:]}", file=sys.stderr)
                failed += 1
                continue
        rows.append(row)
        print(f"{peer.case} {peer.scheme}: {row['cpu_seconds']:.3g} s, error {row['error']:.4g}", flush=True)
        if chosen.json is not None:
            old = json.loads(chosen.json.read_text(encoding="utf-8"))["rows"] if chosen.json.exists() else []
            kept = [known for known in old if known["command"] not in {new["command"] for new in rows}]
            command = "python scripts/peers.py --python PEERS/bin/python --json benchmarks/peers.json"
            head = {**provenance(), "command": command}
            write_text(chosen.json, json.dumps({**head, "rows": kept + rows}, indent=1) + "\n")
    return 6 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
