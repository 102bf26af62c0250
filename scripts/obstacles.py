"""Random dam breaks against obstacles on the floor: does water get into them, and does the run live?

    python scripts/obstacles.py [--count 20] [--first 1] [--schemes riemann isph delta_plus] [--dimension 3] [--processes N]
                                [--json FILE]

A column of water of random size (a tank 5 cm to 3 m long, 55 to 90 spacings, which do not divide it) runs against one of
eight obstacles of random size: boxes on each other and beside each other, trapezoid, triangle, disc sunk into the floor,
hill given by a condition, step that ends on the wall, arch. Walls with and without friction, 6 sqrt(L/g). In 3-D, 26 to 40
spacings and a third as wide, of six: boxes on each other and beside each other, pillar, step, ball sunk into the floor,
bridge.

Judged, 60 times a run: whether it diverged; how many particles were ever deeper than half a spacing in an obstacle, or
as far below the floor; the range of the densities; the largest kinetic and potential energy over those of the start.
Exit code 1 if a run diverged or let more than 1 % of its particles in.
"""

from __future__ import annotations

import math
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.case.case_file import load_case

sys.path.insert(0, str(Path(__file__).resolve().parent))  # when imported instead of run

from random_runs import options_of, parser_of, run_all  # noqa: E402

KINDS = ("stack", "pair", "trapezoid", "triangle", "disc", "hill", "step", "arch")
KINDS_IN_SPACE = ("stack", "pair", "pillar", "step", "ball", "bridge")
GRAVITY = 9.81
SAMPLES = 60
LET_IN = 0.01  # of all particles


def box(lower: tuple[float, ...], upper: tuple[float, ...]) -> dict[str, Any]:
    """Return the shape of a box."""
    return {"box": {"lower": list(lower), "upper": list(upper)}}


def polygon(*points: tuple[float, float]) -> dict[str, Any]:
    """Return the shape of a polygon."""
    return {"polygon": {"points": [list(point) for point in points]}}


def shapes_of(kind: str, length: float, draw: random.Random) -> list[dict[str, Any]]:
    """Return the shapes of an obstacle in a tank of a length [m]."""
    x, w, h = (length * draw.uniform(*span) for span in ((0.5, 0.6), (0.1, 0.2), (0.08, 0.2)))
    if kind == "stack":
        return [box((x, 0), (x + w, h / 2)), box((x + w / 4, h / 2), (x + 3 * w / 4, h))]
    if kind == "pair":
        return [box((x, 0), (x + w / 2, h / 2)), box((x + w / 2, 0), (x + w, h))]
    if kind == "trapezoid":
        return [polygon((x, 0), (x + w, 0), (x + 0.7 * w, h), (x + 0.3 * w, h))]
    if kind == "triangle":
        return [polygon((x, 0), (x + w, 0), (x + w, h))]
    if kind == "disc":
        return [{"sphere": {"center": [x, draw.uniform(-0.25, 0.4) * w], "radius": w / 2}}]
    if kind == "hill":
        return [{"where": {"condition": f"y < {h}*exp(-((x - {x})/{w / 2})**2) - {h / 10}"}}]
    if kind == "step":
        return [box((x, 0), (length, h / 2))]
    legs = ((x + w / 3, 0), (x + w / 3, h / 2), (x + 2 * w / 3, h / 2), (x + 2 * w / 3, 0))
    return [polygon((x, 0), *legs, (x + w, 0), (x + w, h), (x, h))]


def shapes_in_space(kind: str, length: float, width: float, draw: random.Random) -> list[dict[str, Any]]:
    """Return the shapes of an obstacle in a tank of a length and a width [m]."""
    x, w, h = (length * draw.uniform(*span) for span in ((0.5, 0.6), (0.12, 0.25), (0.1, 0.25)))
    y0, y1 = (width * draw.uniform(*span) for span in ((0.0, 0.4), (0.6, 1.0)))
    if kind == "stack":
        return [box((x, y0, 0), (x + w, y1, h / 2)), box((x + w / 4, y0, h / 2), (x + 3 * w / 4, y1, h))]
    if kind == "pair":
        return [box((x, y0, 0), (x + w / 2, y1, h / 2)), box((x + w / 2, y0, 0), (x + w, y1, h))]
    if kind == "pillar":
        return [box((x, y0, 0), (x + w, y1, 0.6 * length))]
    if kind == "step":
        return [box((x, 0, 0), (length, width, h / 2))]
    if kind == "ball":
        return [{"sphere": {"center": [x, (y0 + y1) / 2, draw.uniform(-0.25, 0.4) * w], "radius": w / 2}}]
    return [box((x, y0, h / 2), (x + w, y1, h))]


def scene(seed: int, scheme: str, dimension: int = 2) -> Case:
    """Return the case of a seed in a scheme."""
    plane = dimension == 2
    draw = random.Random(f"obstacle {seed}" if plane else f"obstacle in space {seed}")
    length = math.exp(draw.uniform(math.log(0.05), math.log(3.0)))
    size = [length, 1.5 * length] if plane else [length, length / 3, 1.5 * length]
    side, across = draw.choice(("free_slip", "wall")), "xy"[: dimension - 1]
    kind = draw.choice(KINDS if plane else KINDS_IN_SPACE)
    walls = ("free_slip", "no_slip")
    shapes = shapes_of(kind, length, draw) if plane else shapes_in_space(kind, length, size[1], draw)
    bodies = {f"body_{k}": {"shape": shape, "wall": draw.choice(walls)} for k, shape in enumerate(shapes)}
    width, height = draw.uniform(0.25, 0.35) * length, draw.uniform(0.3, 0.45) * length
    friction = draw.choice((0.0, 1e-6, 1e-4 * math.sqrt(GRAVITY * length) * length))
    return load_case(
        {
            "title": f"{kind}, seed {seed}",
            "dimension": dimension,
            "particle_spacing": length / draw.uniform(*((55, 90) if plane else (26, 40))),
            "end_time": 6 * math.sqrt(length / GRAVITY),
            "domain": {
                "lower": [0] * dimension,
                "upper": size,
                "boundary": {axis: side for axis in across} | {"xyz"[dimension - 1]: {"lower": side, "upper": "open"}},
            },
            "gravity": [*(0 for _ in across), -GRAVITY],
            "phases": {"water": {"density": 1000, "viscosity": 1000 * friction}},
            "fluids": [{"phase": "water", "shape": box((0,) * dimension, (width, *size[1:-1], height))}],
            "bodies": bodies,
            "start": {"pressure": "hydrostatic"},
            "numerics": {"scheme": scheme},
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )


class Depths:
    """How deep points are in the obstacles of a case."""

    def __init__(self, case: Case) -> None:
        from warpsph.scene.body_surfaces import surface_of

        length = float(case.domain.upper[0])
        low, high = np.full(case.dimension, -length), np.array(case.domain.upper, dtype=float)
        self.surfaces = [surface_of(case, body, low, high) for body in case.bodies.values()]

    def deepest(self, points: np.ndarray) -> np.ndarray:
        """Depth of points (n, d), m, in the obstacle that each is deepest in; 0 and less outside."""
        return np.max([-surface.signed_distance(points) for surface in self.surfaces], axis=0)


def run(task: tuple[int, str, int]) -> dict[str, Any]:
    """Run one scene and return what is judged."""
    from warpsph.kernels.core import clock as ck
    from warpsph.simulation import Simulation

    seed, scheme, dimension = task
    case = scene(seed, scheme, dimension)
    model = Simulation(case, device="cpu", threads=1).model
    model.stepper.prepare(fresh=True)
    particles, depths = model.particles, Depths(case)
    n, spacing, floor = particles.fluid_count, case.spacing, float(model.geometry.lattice.lower[-1])
    inside: set[int] = set()
    below: set[int] = set()
    least = most = 0.0
    energies = [energy(particles, n)]
    diverged: float | None = None
    for sample in range(1, SAMPLES + 1):
        model.stepper.run(case.end_time * sample / SAMPLES, 10**9)
        clock, counters = model.stepper.read()
        if counters[ck.FAULT]:
            diverged = float(clock[ck.TIME])
            break
        place = particles.get("position")[:n].astype(float)
        names = particles.get("particle_id")[:n]
        within = (place[:, :-1] > 0) & (place[:, :-1] < np.array(case.domain.upper[:-1], dtype=float))
        under = (place[:, -1] < floor - 0.5 * spacing) & within.all(axis=1)
        deep = (depths.deepest(place) > 0.5 * spacing) & (place[:, -1] > floor)
        inside |= set(names[deep].tolist())
        below |= set(names[under].tolist())
        energies.append(energy(particles, n))
        if "density_excess" in particles.fields:
            excess = particles.get("density_excess")[:n]
            least, most = min(least, float(excess.min())), max(most, float(excess.max()))
    return {
        "seed": seed, "scheme": scheme, "obstacle": case.title.split(",")[0], "particles": n, "steps": model.steps,
        "diverged": diverged, "inside": len(inside), "below": len(below), "density": [least, most],
        "gained": max(energies) / energies[0] - 1.0,
    }  # fmt: skip


def energy(particles: Any, count: int) -> float:
    """Kinetic and potential energy of the first `count` particles, over their mass, J/kg; heights from the floor at 0."""
    speed2 = (particles.get("velocity")[:count].astype(float) ** 2).sum(axis=1)
    return float((0.5 * speed2 + GRAVITY * particles.get("position")[:count, -1].astype(float)).mean())


def missed(row: dict[str, Any]) -> bool:
    """Whether a run diverged, or let in more than what counts."""
    return row["diverged"] is not None or row["inside"] + row["below"] > LET_IN * row["particles"]


def shown(row: dict[str, Any]) -> str:
    """Return what is printed of a run."""
    return (
        f"{row['seed']:6d} {row['scheme']:<10} {row['obstacle']:<10} {row['particles']:6d} particles  inside "
        f"{row['inside']:3d}  below {row['below']:3d}  density {row['density'][0]:+.3f} {row['density'][1]:+.3f}  "
        f"gained {100 * row['gained']:+.2f} %"
    )


def main() -> int:
    """Run the scenes, print a row each; return 1 if any is missed."""
    parser = parser_of(__doc__, first=1)
    parser.add_argument("--dimension", type=int, default=2, choices=(2, 3))
    options = options_of(parser)
    return run_all(options, options.dimension, run, missed, shown)


if __name__ == "__main__":
    raise SystemExit(main())
