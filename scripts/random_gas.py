"""Random scenes of compressible gas: does the run live, and what stops it if not?

    python scripts/random_gas.py [--count 40] [--first 0] [--steps 400] [--json FILE]

A box in one, two or three dimensions (200, 40, 14 particles a side) whose sides are periodic, walls or open; density and
pressure differ by factors of up to 300 and 1 000 between two parts of it (step, disc, wave), velocities by up to Mach 4;
some are disordered, some have gravity, some hold what is beside open sides.

Judged after so many steps: whether a support outgrew its channel or period (a limit that the run names), or the run was lost
for another reason, and how many particles are beyond walls. Exit code 1 if a run was lost or a particle is beyond a wall.
"""

from __future__ import annotations

import argparse
import json
import math
import random
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.kernels.core import clock as ck
from warpsph.running.divergence import runaway_particle
from warpsph.running.model import Model
from warpsph.study.provenance import provenance

COUNTS = {1: 200, 2: 40, 3: 14}
SIDES = ("periodic", "free_slip", "wall", "open")


def scene(seed: int) -> Case:
    """Return the scene of a seed."""
    draw = random.Random(seed)
    dimension = draw.choice((1, 2, 2, 2, 3))
    axes = "xyz"[:dimension]
    share = {
        "step": f"0.5 + 0.5*tanh((x - {draw.uniform(-0.2, 0.2):.3f})/0.03)",
        "disc": f"0.5 - 0.5*tanh(({'hypot(x, y)' if dimension > 1 else 'abs(x)'} - 0.2)/0.03)",
        "wave": "0.5 + 0.5*sin(2*pi*x)",
    }[draw.choice(("step", "disc", "wave"))]
    dense, hot = (math.exp(draw.uniform(0, math.log(most))) - 1.0 for most in (300, 1000))
    speed = draw.uniform(0, 4)
    waves = [f"{speed * draw.uniform(-1, 1):.3f}*sin(2*pi*{axes[(k + 1) % dimension]} + {draw.uniform(0, 6):.2f})"
             for k in range(dimension)]  # fmt: skip
    case: dict[str, Any] = {
        "dimension": dimension,
        "particle_spacing": 1 / COUNTS[dimension],
        "end_time": 10,
        "domain": {
            "lower": [-0.5] * dimension,
            "upper": [0.5] * dimension,
            "boundary": {axis: draw.choice(SIDES) for axis in axes},
        },
        "phases": {"gas": {"density": 1.0, "gamma": draw.choice((1.2, 1.4, 5 / 3))}},
        "fluids": [{"phase": "gas", "shape": "rest"}],
        "start": {
            "density": f"1 + {dense:.4f}*({share})",
            "pressure": f"1 + {hot:.4f}*({share if draw.random() < 0.5 else f'1 - ({share})'})",
            "velocity": waves,
            "noise": draw.choice((0.0, 0.0, 0.1, 0.3)),
        },
        "numerics": {"scheme": "gas", "hold_open_sides": draw.random() < 0.5},
    }
    if draw.random() < 0.4:
        case["gravity"] = [0.0] * (dimension - 1) + [-draw.uniform(0.1, 3)]
    return Case.from_dict(case)


def judge(seed: int, steps: int) -> dict[str, Any]:
    """Run the scene of a seed and return what became of it."""
    case = scene(seed)
    model = Model(case, threads=1, device="cpu")
    model.stepper.prepare(fresh=True)
    model.stepper.run(case.end_time, steps)
    counters = model.stepper.read()[1]
    stopped = "" if not counters[ck.FAULT] else runaway_particle(model, int(counters[ck.FAULT_PARTICLE]))[2]
    place = model.snapshot().position
    walls = [k for k, sides in enumerate(case.sides) if sides.lower.kind == "wall"]
    # in float32 a place is known to a part in ten million
    beyond = int((np.abs(place[:, walls]).max(axis=1) > 0.5 + 1e-6).sum()) if walls else 0
    boundary = [sides.lower.kind for sides in case.sides]
    return {"seed": seed, "sides": boundary, "steps": int(model.steps), "stopped": stopped, "beyond": beyond}


def main() -> int:
    """Run all scenes and print what became of each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    rows = []
    for seed in range(args.first, args.first + args.count):
        rows.append(judge(seed, args.steps))
        print(" ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    counts = {reason or "lived": sum(row["stopped"] == reason for row in rows) for reason in ("", "support")}
    counts["lost"] = len(rows) - sum(counts.values())
    beyond = sum(row["beyond"] > 0 for row in rows)
    print(f"{counts}, runs with particles beyond walls: {beyond}")
    if args.json:
        args.json.write_text(json.dumps({**provenance(), "rows": rows}, indent=1) + "\n")
    return int(counts["lost"] > 0 or beyond > 0)


if __name__ == "__main__":
    raise SystemExit(main())
