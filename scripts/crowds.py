"""Do particles crowd? How many stand closer than a fluid has them, through the run of a case, under variants of keys.

    python scripts/crowds.py CASE.yaml [--set KEY=VALUE ...] [--variant "KEY=VALUE KEY=VALUE" ...] [--end SECONDS]
                             [--device cuda:0] [--threads N] [--json FILE]

80 times a run, for each particle of the fluid, the particles within 1.5 spacings of it are counted, itself among them: a
lattice has 9 (2-D) or 19 (3-D). The table gives, summed over the samples, particles with more than 1.3, 1.6 and 2 times
that; how many of those with 1.6 are in thin fluid (Riemann scheme); the largest count; the range of the density excess and
the largest speed. A run that diverges is told, and its samples up to there are counted. Exit code 1 if one does, 2 if the
case is wrong or has one dimension.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from warpsph.case.case_file import load_case
from warpsph.errors import CaseError, Problem, WarpsphError
from warpsph.running.model import Model
from warpsph.study.provenance import provenance

SAMPLES = 80
REACH = 1.5  # spacings
LATTICE = {2: 9, 3: 19}
SHARES = (1.3, 1.6, 2.0)  # of the count in a lattice
LEFT_OUT = ["reference={}", "gauges={}", "output.particles=none", "output.checkpoint=none"]


def counts_of(position: np.ndarray, spacing: float) -> np.ndarray:
    """Return how many particles are within 1.5 spacings of each, itself included; position: (n, d) [m]."""
    return np.asarray(cKDTree(position).query_ball_point(position, REACH * spacing, return_length=True, workers=-1))


def run(path: Path, changes: list[str], end: float | None, device: str, threads: int) -> dict[str, Any]:
    """Return the row of a case with changes KEY=VALUE."""
    case = load_case(path, [*LEFT_OUT, *changes])
    if case.dimension not in LATTICE:
        raise CaseError([Problem("dimension", case.dimension, "crowds are counted in 2-D and 3-D", "take such a case")])
    model = Model(case, device=device, threads=threads)
    model.stepper.prepare(fresh=True)
    lattice, spacing, particles = LATTICE[case.dimension], float(case.particle_spacing), model.particles
    crowded, thin, row = np.zeros(len(SHARES), dtype=int), 0, {"most": 0, "least": 0.0, "largest": 0.0, "speed": 0.0}
    diverged = None
    for sample in range(1, SAMPLES + 1):
        try:
            model.stepper.run((end or float(case.end_time)) * sample / SAMPLES, 10**9)
        except WarpsphError as error:
            diverged = str(error)
            break
        fluid = particles.fluid_count
        count = counts_of(particles.get("position")[:fluid], spacing)
        crowded += [int((count > share * lattice).sum()) for share in SHARES]
        if "thin" in particles.arrays:
            thin += int(((particles.get("thin")[:fluid] != 0) & (count > SHARES[1] * lattice)).sum())
        excess, velocity = particles.get("density_excess")[:fluid], particles.get("velocity")[:fluid]
        row["most"] = max(row["most"], int(count.max()))
        row["least"], row["largest"] = min(row["least"], float(excess.min())), max(row["largest"], float(excess.max()))
        row["speed"] = max(row["speed"], float(np.sqrt((velocity**2).sum(axis=1).max())))
    return {"particles": particles.fluid_count, "crowded": crowded.tolist(), "thin": thin, **row, "diverged": diverged}


def main() -> int:
    """Print a row for each variant; return 1 if one diverged."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", type=Path, metavar="CASE.yaml")
    parser.add_argument("--set", nargs="+", action="extend", default=[], dest="changes", metavar="KEY=VALUE")
    parser.add_argument("--variant", action="append", help='"KEY=VALUE KEY=VALUE"; "" is the case as it is')
    parser.add_argument("--end", type=float, help="in place of end_time [s]")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write the numbers to this file, after each run")
    options = parser.parse_args()
    data: dict[str, Any] = {**provenance(), "command": "python scripts/crowds.py " + " ".join(sys.argv[1:]), "rows": {}}
    print("| variant | particles | over 1.3, 1.6, 2 of a lattice | of these thin | most | density excess | speed |")
    print("|---|---|---|---|---|---|---|")
    for variant in options.variant or [""]:
        try:
            row = run(options.case, [*options.changes, *variant.split()], options.end, options.device, options.threads)
        except CaseError as error:
            parser.error(str(error))
        data["rows"][variant] = row
        crowded = ", ".join(str(count) for count in row["crowded"])
        cells = [variant or "as it is", row["particles"], crowded, row["thin"], row["most"]]
        cells += [f"{row['least']:.3f} to {row['largest']:.3f}", f"{row['speed']:.3g}"]
        print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)
        if row["diverged"]:
            print(f"{variant or 'as it is'}: {row['diverged']}", file=sys.stderr)
        if options.json is not None:
            options.json.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    return int(any(row["diverged"] for row in data["rows"].values()))


if __name__ == "__main__":
    raise SystemExit(main())
