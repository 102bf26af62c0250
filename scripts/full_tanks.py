"""Random bodies that move through full tanks: does the fluid tear behind them, and does the run live?

    python scripts/full_tanks.py [--count 20] [--first 0] [--schemes riemann isph delta_plus] [--set KEY=VALUE ...]
                                 [--processes N] [--json FILE]

A closed tank of six by four body lengths (2-D, 8 to 14 spacings a length; each sixth seed 3-D, five by two by two, 8) is
full of one liquid. A box, a ball or a diamond starts along it with constant acceleration and goes on, or swings; some also
sway across it, or turn. Lengths from 1 mm to 1 m, speeds from 1 cm/s to 3 m/s, Reynolds numbers from 10 to 100 000, walls
with and without friction.

Judged, ten times a run: whether it diverged; the largest hole, that is the largest distance [spacings] from a place at
least a spacing away from all walls to the nearest particle (0.71 and 0.87 on a lattice in 2-D and 3-D, 1 where one particle
is missing, 1.12 where two neighbours are); the fastest particle over the greatest speed of the body; particles deeper than
half a spacing in the body. Exit code 1 if a run diverged, has a hole of more than two particles, or let more than 1 % of its
particles in.
"""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from warpsph.case.case import Case
from warpsph.case.case_file import load_case

sys.path.insert(0, str(Path(__file__).resolve().parent))  # when imported instead of run

from random_runs import run_changed  # noqa: E402

SAMPLES, END = 10, 2.5  # times of a run that are judged; when it ends, in lengths of the body over its speed
HOLE = 1.12  # spacings
LET_IN = 0.01  # of all particles
Places = dict[str, Callable[[float], float]]


def motion_of(draw: random.Random, length: float, speed: float, plane: bool) -> tuple[dict[str, Any], Places]:
    """Return the motion of a body as a case has it, and as functions of time: x, y [m] and angle [rad]."""
    rate = speed / length
    if draw.random() < 0.5:
        along = f"{0.5 * length}*(1 - cos({2 * rate}*t))"
        places: Places = {"x": lambda t: 0.5 * length * (1 - math.cos(2 * rate * t))}
    else:
        along = f"{length}*where({rate}*t < 1, 0.5*({rate}*t)**2, {rate}*t - 0.5)"
        places = {"x": lambda t: length * (0.5 * (rate * t) ** 2 if rate * t < 1 else rate * t - 0.5)}
    sway = 0.25 * length if draw.random() < 0.4 else 0.0
    turn = rate if plane and draw.random() < 0.4 else 0.0
    places |= {"y": lambda t: sway * math.sin(3 * rate * t), "angle": lambda t: turn * t}
    motion: dict[str, Any] = {"translation": [along, f"{sway}*sin({3 * rate}*t)", 0][: 2 if plane else 3]}
    if turn:
        motion |= {"rotation": f"{turn}*t", "pivot": [1.5 * length, 2 * length]}
    return motion, places


def scene(seed: int, scheme: str, changes: list[str]) -> tuple[Case, Places, float]:
    """Return the case of a seed in a scheme, where its body is, and the speed [m/s]."""
    draw, plane = random.Random(f"full tank {seed}"), seed % 6 != 5
    length, speed = (math.exp(draw.uniform(math.log(a), math.log(b))) for a, b in ((1e-3, 1.0), (0.01, 3.0)))
    spacings = draw.randint(8, 14) if plane else 8
    size = [6 * length, 4 * length] if plane else [5 * length, 2 * length, 2 * length]
    center = [1.5 * length, *(0.5 * extent for extent in size[1:])]
    kind = draw.choice(("box", "ball", "diamond") if plane else ("box", "ball"))
    shapes: dict[str, Any] = {
        "box": {"box": {"lower": [x - 0.5 * length for x in center], "upper": [x + 0.5 * length for x in center]}},
        "ball": {"sphere": {"center": center, "radius": 0.5 * length}},
        "diamond": {"polygon": {"points": [[center[0] + x * length, center[1] + y * length]
                                           for x, y in ((-0.5, 0), (0, -0.6), (0.5, 0), (0, 0.6))]}},
    }  # fmt: skip
    motion, places = motion_of(draw, length, speed, plane)
    side, wall = draw.choice(("wall", "free_slip")), draw.choice(("no_slip", "free_slip"))
    viscosity = 1000 * speed * length / math.exp(draw.uniform(math.log(10), math.log(1e5)))
    case = load_case(
        {
            "title": f"{kind}, seed {seed}",
            "dimension": len(size),
            "particle_spacing": length / spacings,
            "end_time": END * length / speed,
            "domain": {"lower": [0] * len(size), "upper": size, "boundary": dict.fromkeys("xyz"[: len(size)], side)},
            "phases": {"water": {"density": 1000, "viscosity": viscosity}},
            "fluids": [{"phase": "water", "shape": "rest"}],
            "bodies": {"body": {"shape": shapes[kind], "wall": wall, "motion": motion}},
            "numerics": {"scheme": scheme},
            "output": {"particles": "none", "checkpoint": "none"},
        },
        changes,
    )
    return case, places, speed


class Body:
    """How far points are from the surface of the moving body of a case."""

    def __init__(self, case: Case, places: Places) -> None:
        from warpsph.scene.body_surfaces import surface_of

        low, high = np.zeros(case.dimension), np.array(case.domain.upper, dtype=float)
        self.surface = surface_of(case, case.bodies["body"], low - high, high + high)
        self.places, self.pivot = places, np.array([0.25, 0.5]) * high[:2]  # of the plane tanks: no other body turns

    def distance(self, points: np.ndarray, t: float) -> np.ndarray:
        """Distances of points (n, d) at a time, m; below 0 within the body."""
        back = np.array(points, dtype=float)
        back[:, :2] -= [self.places["x"](t), self.places["y"](t)]
        cos, sin = math.cos(self.places["angle"](t)), math.sin(self.places["angle"](t))
        if sin:
            back[:, :2] = self.pivot + (back[:, :2] - self.pivot) @ np.array([[cos, -sin], [sin, cos]])
        return np.asarray(self.surface.signed_distance(back))


def run(task: tuple[int, str, list[str]]) -> dict[str, Any]:
    """Run one scene and return what is judged."""
    from warpsph.kernels.core import clock as ck
    from warpsph.simulation import Simulation

    case, places, speed = scene(*task)
    model = Simulation(case, device="cpu", threads=1).model
    n, dx, body, particles = model.particles.fluid_count, case.spacing, Body(case, places), model.particles
    upper = np.array(case.domain.upper, dtype=float)
    fine = [np.arange(dx, extent - dx, 0.25 * dx if case.dimension == 2 else 0.5 * dx) for extent in upper]
    grid = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1).reshape(-1, case.dimension)
    diverged: float | None = None
    hole = fastest = inside = 0.0
    for sample in range(1, SAMPLES + 1):
        t = case.end_time * sample / SAMPLES
        model.stepper.run(t, 10**9)
        clock, counters = model.stepper.read()
        if counters[ck.FAULT]:
            diverged = float(clock[ck.TIME])
            break
        water = particles.get("position")[:n, : case.dimension].astype(float)
        fastest = max(fastest, float(np.linalg.norm(particles.get("velocity")[:n], axis=1).max()))
        inside = max(inside, float((body.distance(water, t) < -0.5 * dx).sum()))
        hole = max(hole, float(cKDTree(water).query(grid[body.distance(grid, t) > dx])[0].max()))
    return {
        "seed": task[0], "scheme": task[1], "body": case.title.split(",")[0], "particles": n, "steps": model.steps,
        "diverged": diverged, "hole": hole / dx, "fastest": fastest / speed, "inside": int(inside),
    }  # fmt: skip


def missed(row: dict[str, Any]) -> bool:
    """Whether a run diverged, tore, or let in more than what counts."""
    return row["diverged"] is not None or row["hole"] > HOLE or row["inside"] > LET_IN * row["particles"]


def shown(row: dict[str, Any]) -> str:
    """Return what is printed of a run."""
    return (
        f"{row['seed']:6d} {row['scheme']:<10} {row['body']:<8} {row['particles']:6d} particles  "
        f"hole {row['hole']:.2f}  fastest {row['fastest']:6.2f}  inside {row['inside']:3d}"
    )


if __name__ == "__main__":
    raise SystemExit(run_changed(__doc__, scene, run, missed, shown))
