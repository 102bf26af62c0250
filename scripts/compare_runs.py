"""How far two runs of one scene agree: the area in which a phase of the one is not where it is in the other.

    python scripts/compare_runs.py RUN RUN [--phase NAME] [--times T ...] [--limit SHARE [--until T]]
                                   [--relative-to phase|domain] [--json FILE]

For example two resolutions of the double bubble, kept by `python -m warpsph validate double_bubble --level seed`:

    python scripts/compare_runs.py validation/seed-cpu/runs/double_bubble-200_x_300_Bo_80 \\
        validation/seed-cpu/runs/double_bubble-320_x_480_Bo_80 --limit 0.05

Each is a run folder with particle files, 2-D, of the same domain and phases; the times are those that both have.
The phase is where its share of the smoothing sum is 1/2 or more (`measure/contour.py`), of each run at its own
resolution; both are looked at on the finer one's grid of two points a particle spacing. `share` is the differing
area over the area of the phase, mean of both runs, or with `--relative-to domain` over that of the domain. `pieces`
counts the connected patches of the phase in each run: after a rupture the runs need not agree any more, and with
`--limit` alone the times before either run's first change of that number are judged, with
`--until` those up to the time given.

Exit code 1 if a judged share is above the limit, 2 if the runs cannot be compared.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.errors import WarpsphError
from warpsph.measure.contour import LEVEL, Share, cells_behind_mirrors, shares_of_phases
from warpsph.study import plot
from warpsph.study.figures import case_of_run
from warpsph.study.provenance import provenance

SHIPPED = Path(__file__).resolve().parents[1] / "cases" / "reference"
SAME_TIME = 1e-6  # of a time


class NotComparable(Exception):
    """Why two runs cannot be compared."""


def share_of(case: Case, frame: plot.Frame, phase: int) -> Share:
    """The share of a phase in a frame of a run."""
    parts = [frame.fluid] + ([frame.wall] if frame.wall is not None else [])
    behind, area = cells_behind_mirrors(case)
    position = np.concatenate([*(part.position[:, :2] for part in parts), behind])
    # a wall particle takes the room of a cell of the lattice, whatever mass it was written with
    cell = frame.fluid.particle_spacing**2
    volumes = [part.volume if part is frame.fluid else np.full(len(part), cell) for part in parts]
    volume = np.concatenate([*volumes, np.full(len(behind), area)])
    kinds = [part.phase if part is frame.fluid else np.full(len(part), -1) for part in parts]
    kind = np.concatenate([*kinds, np.full(len(behind), -1)])
    if not np.isfinite(volume).all() or not np.isfinite(position).all():
        raise NotComparable(f"the particles of t = {frame.time:g} s have no volumes: write mass and density")
    shares = shares_of_phases(
        position, volume, kind, len(case.phase_names), case.domain.lower, case.domain.upper, case.periodic,
        frame.fluid.particle_spacing,
    )  # fmt: skip
    return shares[phase]


def at_points(share: Share, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Values (nx, ny) of a share between its nodes, bilinear, at the coordinates x (nx,) and y (ny,) [m]."""
    values = share.values
    for axis, (nodes, wanted) in enumerate(((share.x, x), (share.y, y))):
        place = np.clip((wanted - nodes[0]) / (nodes[-1] - nodes[0]) * (len(nodes) - 1), 0.0, len(nodes) - 1.0)
        low = np.minimum(place.astype(np.int64), len(nodes) - 2)
        weight = (place - low)[:, None] if axis == 0 else place - low
        values = (1.0 - weight) * values.take(low, axis) + weight * values.take(low + 1, axis)
    return values


def pieces_of(inside: np.ndarray) -> int | None:
    """Number of connected patches of a mask (nx, ny); None without SciPy."""
    try:
        from scipy.ndimage import label
    except ImportError:
        return None
    return int(label(inside)[1])


def difference(first: Share, second: Share) -> dict[str, Any]:
    """How far a phase of two runs agrees.

    Returns `differing`, area [m^2] where one has the phase and the other has not; `areas` of the phase in both [m^2];
    `domain`, area of the domain [m^2]; `pieces` of both, see `pieces_of`.
    """
    sides = [max(len(a), len(b)) - 1 for a, b in ((first.x, second.x), (first.y, second.y))]
    extent = [nodes[-1] - nodes[0] for nodes in (first.x, first.y)]
    # the middles of the finer one's cells
    x, y = (
        nodes[0] + size * (np.arange(count) + 0.5) / count
        for nodes, size, count in zip((first.x, first.y), extent, sides, strict=True)
    )
    one, other = (at_points(share, x, y) >= LEVEL for share in (first, second))
    cell = math.prod(extent) / math.prod(sides)
    return {
        "differing": float((one != other).sum() * cell),
        "areas": [float(mask.sum() * cell) for mask in (one, other)],
        "domain": float(math.prod(extent)),
        "pieces": [pieces_of(one), pieces_of(other)],
    }


def compare(
    folders: tuple[Path, Path], phase: str | None = None, times: list[float] | None = None, relative_to: str = "phase"
) -> list[dict[str, Any]]:
    """One row a time: `time`, `share` and the keys of `difference`.

    folders: run folders; phase: its name (default: the lightest); times: s (default: all that both runs have)
    relative_to: phase or domain, what the differing area is divided by

    Raises NotComparable or WarpsphError.
    """
    cases = [case_of_run(folder, (SHIPPED,)) for folder in folders]
    one, other = cases
    for case in cases:
        if case.dimension != 2:
            raise NotComparable("needs runs of dimension 2")
    if (one.domain.lower, one.domain.upper) != (other.domain.lower, other.domain.upper):
        raise NotComparable("the runs have different domains")
    if list(one.phase_names) != list(other.phase_names):
        raise NotComparable(f"the runs have different phases: {list(one.phase_names)}, {list(other.phase_names)}")
    if phase is None:
        phase = min(one.phase_names, key=lambda name: one.phases[name].density)
    if phase not in one.phase_names:
        raise NotComparable(f"there is no phase {phase!r}; there are {', '.join(one.phase_names)}")
    index = list(one.phase_names).index(phase)

    series = [plot.read_series(folder) for folder in folders]
    pairs = []
    for frame in series[0][0].frames:
        same = (mate for mate in series[1][0].frames if math.isclose(mate[0], frame[0], rel_tol=SAME_TIME, abs_tol=1e-12))
        mate = next(same, None)
        if mate is not None:
            pairs.append((frame, mate))
    if times is not None:
        missing = [t for t in times if not any(math.isclose(t, frame[0], rel_tol=1e-3, abs_tol=1e-12) for frame, _ in pairs)]
        if missing:
            raise NotComparable(f"no particle files of both runs at t = {', '.join(f'{t:g}' for t in missing)} s")
        pairs = [pair for pair in pairs if any(math.isclose(t, pair[0][0], rel_tol=1e-3, abs_tol=1e-12) for t in times)]
    if not pairs:
        raise NotComparable("the runs have no particle files of the same time")

    rows = []
    for pair in pairs:
        shares = [
            share_of(case, plot.read_frame(*both, frame), index)
            for case, both, frame in zip(cases, series, pair, strict=True)
        ]
        found = difference(*shares)
        size = found["domain"] if relative_to == "domain" else 0.5 * sum(found["areas"])
        if size == 0.0:
            raise NotComparable(f"at t = {pair[0][0]:g} s neither run has {phase}")
        rows.append({"time": pair[0][0], "share": found["differing"] / size, **found})
    return rows


def judged(rows: list[dict[str, Any]], until: float | None) -> list[dict[str, Any]]:
    """The rows that a limit is for: up to a time [s], or before the number of pieces of either run first changes."""
    if until is not None:
        return [row for row in rows if row["time"] <= until * (1.0 + SAME_TIME)]
    changed = next((place for place, row in enumerate(rows) if row["pieces"] != rows[0]["pieces"]), len(rows))
    return rows[:changed]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs=2, type=Path, metavar="RUN")
    parser.add_argument("--phase", metavar="NAME", help="the phase that is compared (default: the lightest)")
    parser.add_argument("--times", nargs="+", type=float, metavar="T", help="times [s] (default: all that both runs have)")
    parser.add_argument("--limit", type=float, metavar="SHARE", help="largest share that is taken")
    parser.add_argument("--until", type=float, metavar="T", help="last time [s] that the limit is for (default: rupture)")
    parser.add_argument("--relative-to", choices=("phase", "domain"), default="phase")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows to a file")
    chosen = parser.parse_args(arguments)
    try:
        rows = compare(tuple(chosen.runs), chosen.phase, chosen.times, chosen.relative_to)
    except (NotComparable, WarpsphError) as error:
        print(error, file=sys.stderr)
        return 2
    if chosen.json is not None:
        record = {**provenance(), "rows": rows}
        chosen.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    held = [] if chosen.limit is None else judged(rows, chosen.until)
    print("    time [s]   differing     share   pieces")
    for row in rows:
        pieces = ", ".join("-" if count is None else str(count) for count in row["pieces"])
        outcome = "" if row not in held else "  ok" if row["share"] <= chosen.limit else "  MISSED"
        print(f"{row['time']:12.6g}{row['differing']:12.4g}{100 * row['share']:8.2f} %   {pieces}{outcome}")
    return 1 if any(row["share"] > chosen.limit for row in held) else 0


if __name__ == "__main__":
    sys.exit(main())
