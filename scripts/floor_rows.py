"""What a floor does to water that slides along it: a standing wave without friction, row by row.

    python scripts/floor_rows.py [--scheme riemann] [--spacings 80] [--height 0.005] [--halves 10] [--body]

Water 0.25 m deep on a free-slip floor, periodic over a wave of 1 m, starts level with the velocities of a standing wave. A
line each half period: velocities along the floor over those of linear theory, in rows 0 to 4 from it and in the row in the
middle of the depth; and the kinetic energy over that of the start, all of it and that of the wave alone.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

import warpsph
from warpsph.case.case import Case
from warpsph.running.model import Model

WAVE, DEPTH, GRAVITY, DENSITY = 2.0 * math.pi, 0.25, 9.81, 1000.0
OMEGA = math.sqrt(GRAVITY * WAVE * math.tanh(WAVE * DEPTH))
BODY = {"floor": {"shape": {"box": {"lower": [-0.5, -0.3], "upper": [1.5, 0.0]}}, "wall": "free_slip"}}


def scene(spacings: int, height: float, scheme: str, body: bool) -> dict[str, Any]:
    """Return the case: on the side of the domain, or on a body."""
    speed = height * OMEGA / math.sinh(WAVE * DEPTH)
    low = -0.15 if body else 0.0
    return {
        "dimension": 2,
        "particle_spacing": 1 / spacings,
        "end_time": 1000.0,
        "gravity": [0, -GRAVITY],
        "domain": {
            "lower": [0, low],
            "upper": [1, 0.5],
            "boundary": {"x": "periodic", "y": {"lower": "open" if body else "free_slip", "upper": "open"}},
        },
        "phases": {"water": {"density": DENSITY}},
        "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, DEPTH]}}}],
        **({"bodies": BODY} if body else {}),
        "start": {
            "pressure": "hydrostatic",
            "velocity": [f"-{speed}*sin({WAVE}*x)*cosh({WAVE}*y)", f"{speed}*cos({WAVE}*x)*sinh({WAVE}*y)"],
        },
        "numerics": {"scheme": scheme},
        "output": {"particles": "none", "checkpoint": "none"},
    }


def state(model: Model) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return positions and velocities of the fluid (n, 2) in the order of its numbers."""
    fluid = model.snapshot().fluid
    return np.asarray(fluid.position[:, :2], np.float64), np.asarray(fluid.velocity[:, :2], np.float64)


def wave_share(x: np.ndarray[Any, Any], v: np.ndarray[Any, Any]) -> float:
    """Return the sum of squares of the part of the velocities that is potential flow of the wave."""
    mode = np.stack(
        [-np.sin(WAVE * x[:, 0]) * np.cosh(WAVE * x[:, 1]), np.cos(WAVE * x[:, 0]) * np.sinh(WAVE * x[:, 1])], axis=1
    )
    return float((v * mode).sum() ** 2 / (mode**2).sum())


def main() -> None:
    """Run the wave and print a line each half period."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scheme", default="riemann", choices=("riemann", "delta_plus", "isph"))
    parser.add_argument("--spacings", type=int, default=80, help="a wave")
    parser.add_argument("--height", type=float, default=0.005, help="of the wave by linear theory [m]")
    parser.add_argument("--halves", type=int, default=10, help="half periods")
    parser.add_argument("--body", action="store_true", help="the floor is a body, not a side of the domain")
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="keys of the case")
    args = parser.parse_args()
    if args.spacings < 24:
        parser.error("--spacings has to be 24 at least: with fewer a quarter of a metre has no six rows")
    if args.height <= 0.0:
        parser.error("--height has to be above 0: velocities are told over those of the wave")
    case: Case = warpsph.load_case(scene(args.spacings, args.height, args.scheme, args.body), args.set)
    model = Model(case, threads=1, device="cpu")
    model.stepper.prepare(fresh=True)
    start, first = state(model)
    row = np.floor(start[:, 1] * args.spacings).astype(int)
    energy = float((first**2).sum())
    for half in range(1, args.halves + 1):
        model.stepper.run(half * math.pi / OMEGA, 10**9)
        x, v = state(model)
        rows = []
        for q in [*range(5), round(DEPTH * args.spacings / 2)]:
            sine = np.sin(WAVE * start[row == q, 0])
            found = (v[row == q, 0] * sine).sum() / (sine**2).sum()
            speed = args.height * OMEGA * math.cosh(WAVE * (q + 0.5) / args.spacings) / math.sinh(WAVE * DEPTH)
            rows.append(found / (-speed * (-1.0) ** half))
        text = " ".join(f"{r:.2f}" for r in rows)
        whole, wave = float((v**2).sum()) / energy, wave_share(x, v) / energy
        print(f"{half / 2:g} periods: rows {text}; energy {whole:.3f}, wave {wave:.3f}", flush=True)


if __name__ == "__main__":
    main()
