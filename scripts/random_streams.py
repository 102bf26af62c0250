"""Random bodies between inlets and outlets: does the stream live, stay whole, and keep its volume?

    python scripts/random_streams.py [--count 20] [--first 0] [--schemes riemann isph delta_plus] [--set KEY=VALUE ...]
                                     [--processes N] [--json FILE]

A channel of nine by four body lengths (2-D, 8 to 12 spacings a length; each sixth seed 3-D, six by two and a half by two
and a half, 6) between an inlet of given velocity and an outlet of given pressure; sides without friction, with it, or
periodic. In it a box, a ball, a diamond or a step that goes on beyond the inlet, at rest, turning or swaying, and in half of
the scenes a ball behind it. Lengths from 1 mm to 1 m, speeds from 1 cm/s to 3 m/s, Reynolds numbers from 1 to 10 000; the
stream is there at first or comes within half a length over the speed.

Judged, ten times a run: whether it diverged; the largest hole, as `full_tanks.py` has it, a spacing and a half away from all
sides; the fastest particle over the speed; particles deeper than half a spacing in a body; the volume of the particles over
the room for them. Exit code 1 if a run diverged, has a hole of more than two particles, let more than 1 % of its particles
in, or is off by more than 3 % in volume.
"""

from __future__ import annotations

import math
import random
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from warpsph.case.case import Case
from warpsph.case.case_file import load_case

sys.path.insert(0, str(Path(__file__).resolve().parent))  # when imported instead of run

from full_tanks import HOLE, LET_IN  # noqa: E402
from random_runs import run_changed  # noqa: E402

SAMPLES, END = 10, 9.0  # times of a run that are judged; when it ends, in lengths of the body over the speed
VOLUME = 0.03  # of the room


def shape_of(kind: str, center: list[float], length: float, floor: float) -> dict[str, Any]:
    """Return a body as a case has it; a step begins at `floor` [m]."""
    half = 0.5 * length
    if kind == "ball":
        return {"sphere": {"center": center, "radius": half}}
    if kind == "diamond":
        points = [[center[0] + x * length, center[1] + y * length] for x, y in ((-0.5, 0), (0, -0.6), (0.5, 0), (0, 0.6))]
        return {"polygon": {"points": points}}
    lower, upper = [x - half for x in center], [x + half for x in center]
    if kind == "step":
        lower = [-2 * length, floor, *[-length] * (len(center) - 2)]
        upper = [2 * length, length, *[5 * length] * (len(center) - 2)]
    return {"box": {"lower": lower, "upper": upper}}


class Motion(NamedTuple):
    """The first body turns about `center` [m] at up to `turn` [rad/s], or sways across the stream by `sway` [m].

    rate: 1/s.
    """

    center: tuple[float, ...]
    rate: float
    turn: float = 0.0
    sway: float = 0.0

    def keys(self) -> dict[str, Any]:
        """Return it as a case has it."""
        if self.turn:
            return {"rotation": f"{self.turn}*(t - tanh({self.rate}*t)/{self.rate})", "pivot": list(self.center)}
        return {"translation": [0, f"{0.5 * self.sway}*(1 - cos({self.rate}*t))", 0][: len(self.center)]}

    def undo(self, points: np.ndarray, t: float) -> np.ndarray:
        """Return where points (n, d) that move along were at time 0, m."""
        back = np.array(points, dtype=float)
        back[:, 1] -= 0.5 * self.sway * (1 - math.cos(self.rate * t))
        angle = self.turn * (t - math.tanh(self.rate * t) / self.rate)
        if angle:
            cos, sin = math.cos(angle), math.sin(angle)
            back = self.center + (back - self.center) @ np.array([[cos, -sin], [sin, cos]])
        return back


def scene(seed: int, scheme: str, changes: list[str]) -> tuple[Case, Motion | None, float]:
    """Return the case of a seed in a scheme, how its first body moves, and the speed [m/s]."""
    draw, plane = random.Random(f"stream {seed}"), seed % 6 != 5
    length, speed = (math.exp(draw.uniform(math.log(a), math.log(b))) for a, b in ((1e-3, 1.0), (0.01, 3.0)))
    spacings = draw.randint(8, 12) if plane else 6
    size = [9 * length, 4 * length] if plane else [6 * length, 2.5 * length, 2.5 * length]
    side = draw.choice(("wall", "free_slip", "periodic"))
    kind = draw.choice(("box", "ball", "diamond", "step") if plane else ("box", "ball", "step"))
    wall = draw.choice(("no_slip", "free_slip"))
    floor = 0.0 if side == "periodic" else -length  # the plane y = 0 has fluid below it
    offset = draw.uniform(-0.3, 0.3) * length
    center = [2.5 * length, 0.5 * size[1] + offset, 0.5 * size[-1]][: len(size)]
    bodies: dict[str, Any] = {"first": {"shape": shape_of(kind, center, length, floor), "wall": wall}}
    motion = None
    if kind != "step" and draw.random() < 0.4:
        turns = {"turn": draw.choice((-1, 1)) * speed / length} if plane and draw.random() < 0.5 else {"sway": 0.4 * length}
        motion = Motion(tuple(center), speed / length, **turns)
        bodies["first"]["motion"] = motion.keys()
    if draw.random() < 0.5:
        behind = [x + y for x, y in zip(center, [2.2 * length, -0.6 * length, 0.1 * length], strict=False)]
        bodies["second"] = {"shape": shape_of("ball", behind, length, floor), "wall": draw.choice(("no_slip", "free_slip"))}
    profile = "1"
    if side == "wall" and kind != "step" and plane:
        profile = draw.choice(("1", f"6*(y/{size[1]})*(1 - y/{size[1]})"))
    elif kind == "step":
        profile = f"where(y > {length}, 1, 0)"
    given: dict[str, Any] = {"velocity": [f"{speed}*({profile})", *[0] * (len(size) - 1)]}
    start: dict[str, Any] = {"velocity": given["velocity"]}
    if draw.random() < 0.5:
        given["ramp"], start = f"0.5*(1 - cos(pi*minimum({2 * speed / length}*t, 1)))", {}
    viscosity = 1000 * speed * length / math.exp(draw.uniform(0, math.log(1e4)))
    sides: dict[str, Any] = dict.fromkeys("xyz"[: len(size)], side)
    sides["x"] = {"lower": {"inlet": given}, "upper": {"outlet": {"pressure": 0}}}
    case = load_case(
        {
            "title": f"{kind}, seed {seed}",
            "dimension": len(size),
            "particle_spacing": length / spacings,
            "end_time": END * length / speed,
            "domain": {"lower": [0] * len(size), "upper": size, "boundary": sides},
            "phases": {"water": {"density": 1000, "viscosity": viscosity}},
            "fluids": [{"phase": "water", "shape": "rest"}],
            "bodies": bodies,
            "start": start,
            "scales": {"velocity": 3 * speed, "length": length},
            "numerics": {"scheme": scheme},
            "output": {"particles": "none", "checkpoint": "none"},
        },
        changes,
    )
    return case, motion, speed


class Bodies:
    """How far points are from the nearest surface of the bodies of a case."""

    def __init__(self, case: Case, motion: Motion | None) -> None:
        from warpsph.scene.body_surfaces import surface_of

        low, high = np.array(case.domain.lower, dtype=float), np.array(case.domain.upper, dtype=float)
        self.surfaces = [surface_of(case, body, 2 * low - high, 2 * high - low) for body in case.bodies.values()]
        self.motion = motion

    def distance(self, points: np.ndarray, t: float) -> np.ndarray:
        """Distances of points (n, d) at a time, m; below 0 within a body."""
        places = [points if self.motion is None else self.motion.undo(points, t), *[points] * (len(self.surfaces) - 1)]
        ways = [surface.signed_distance(x) for surface, x in zip(self.surfaces, places, strict=True)]
        return np.asarray(np.min(ways, axis=0))


def run(task: tuple[int, str, list[str]]) -> dict[str, Any]:
    """Run one scene and return what is judged."""
    from warpsph.kernels.core import clock as ck
    from warpsph.simulation import Simulation

    case, motion, speed = scene(*task)
    model = Simulation(case, device="cpu", threads=1).model
    dx, bodies = case.spacing, Bodies(case, motion)
    lower, upper = np.array(case.domain.lower, dtype=float), np.array(case.domain.upper, dtype=float)
    step = 0.25 * dx if case.dimension == 2 else 0.5 * dx
    fine = [np.arange(a + 0.5 * step, b, step) for a, b in zip(lower, upper, strict=True)]
    grid = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1).reshape(-1, case.dimension)
    within = ((grid > lower + 1.5 * dx) & (grid < upper - 1.5 * dx)).all(axis=1)
    diverged: float | None = None
    hole = fastest = inside = volume = 0.0
    for sample in range(1, SAMPLES + 1):
        t = case.end_time * sample / SAMPLES
        model.stepper.run(t, 10**9)
        clock, counters = model.stepper.read()
        if counters[ck.FAULT]:
            diverged = float(clock[ck.TIME])
            break
        fluid = model.snapshot().fluid
        water, free = fluid.position[:, : case.dimension].astype(float), bodies.distance(grid, t)
        fastest = max(fastest, float(np.linalg.norm(fluid.velocity, axis=1).max()))
        inside = max(inside, float((bodies.distance(water, t) < -0.5 * dx).sum()))
        hole = max(hole, float(cKDTree(water).query(grid[within & (free > dx)])[0].max()))
        off = len(water) * dx**case.dimension / ((free > 0).sum() * step**case.dimension) - 1
        volume = off if abs(off) > abs(volume) else volume
    return {
        "seed": task[0], "scheme": task[1], "body": case.title.split(",")[0], "particles": len(model.snapshot().fluid),
        "steps": model.steps, "diverged": diverged, "hole": hole / dx, "fastest": fastest / speed, "inside": int(inside),
        "volume": volume,
    }  # fmt: skip


def missed(row: dict[str, Any]) -> bool:
    """Whether a run diverged, tore, let in more than what counts, or lost or gained as much."""
    torn = row["hole"] > HOLE or row["inside"] > LET_IN * row["particles"] or abs(row["volume"]) > VOLUME
    return row["diverged"] is not None or torn


def shown(row: dict[str, Any]) -> str:
    """Return what is printed of a run."""
    return (
        f"{row['seed']:6d} {row['scheme']:<10} {row['body']:<8} {row['particles']:6d} particles  hole {row['hole']:.2f}  "
        f"fastest {row['fastest']:6.2f}  inside {row['inside']:3d}  volume {100 * row['volume']:5.1f} %"
    )


if __name__ == "__main__":
    raise SystemExit(run_changed(__doc__, scene, run, missed, shown))
