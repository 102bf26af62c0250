"""Errors of Lyapunov exponents against exact flow maps, while the spacing is halved; their cost.

    python scripts/lyapunov.py gyre             # double gyre along given velocities, with a shift; docs/records/lyapunov.md
    python scripts/lyapunov.py vortices         # decaying vortices that the schemes compute
    python scripts/lyapunov.py cost             # seconds of a step with windows and without

Exact exponents are differences of the exact flow map, by Runge and Kutta, over a particle spacing, from where particles are
(backward) or their fluid was (forward). Run from the root of the checkout.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.drifting import VORTICES, along, at, back, case_of, double_gyre, exponent, prepared, vortices
from warpsph.running.model import Model

SCHEMES = ("riemann", "delta_plus", "isph")


def score(found: np.ndarray, exact: np.ndarray) -> str:
    """Correlation, and root mean square error over that of the exact values."""
    error = np.sqrt(((found - exact) ** 2).mean() / (exact**2).mean())
    return f"{np.corrcoef(found, exact)[0, 1]:.3f} {error:.3f}"


def line(name: str, fluid, flow, spacing: float, now: float, period: float = 0.0) -> None:
    """Print the error of places (median, in spacings) and both exponents at a time."""
    then = now - float(fluid.ftle_age[0])
    start = fluid.position - fluid.ftle_way
    off = start - back(flow, fluid.position, now, then)
    if period:
        off -= period * np.round(off / period)
    places = np.median(np.linalg.norm(off, axis=1)) / spacing
    backward = score(fluid.ftle_backward, exponent(flow, fluid.position, now, then, spacing))
    forward = score(fluid.ftle_forward, exponent(flow, start, then, now, spacing))
    moment = f"{name:24s} t {now:5.2f} age {now - then:5.2f}"
    print(f"{moment}  places {places:.4f}  backward {backward}  forward {forward}", flush=True)


def gyre(counts: list[int]) -> None:
    """The double gyre, T = 5 and 10."""
    for n in counts:
        keys = {"window": 10.0, "starts": 1, "time_step": 0.05, "even": 0.05}
        model = along("double_gyre", [0, 0], [2, 1], 1 / n, "wall", **keys)
        for now in (5.0, 10.0):
            line(f"double gyre 1/{n}", at(model, now), double_gyre, 1 / n, now)


def decaying(counts: list[int]) -> None:
    """Vortices of the schemes, T = 0.5: most fluid goes about half way around."""
    for scheme in SCHEMES:
        for n in counts:
            keys = {"output": {"lyapunov": {"window": 0.5, "starts": 2, "direction": ["backward", "forward"]}}}
            model = prepared(case_of(VORTICES, particle_spacing=1 / n, numerics={"scheme": scheme}, **keys))
            for now in (0.25, 0.5, 1.0):
                line(f"{scheme} 1/{n}", at(model, now), vortices, 1 / n, now, 1.0)


def cost(counts: list[int]) -> None:
    """Seconds of a step without windows and with 1, 4 and 8, on one thread, and bytes of a particle."""
    for scheme in SCHEMES:
        for n in counts:
            for windows in (0, 1, 4, 8):
                output = {"lyapunov": {"window": 9.0, "starts": windows}} if windows else {"lyapunov": "none"}
                case = case_of(VORTICES, particle_spacing=1 / n, numerics={"scheme": scheme}, output=output)
                model: Model = prepared(case)
                model.stepper.run(1e9, 20)
                best = np.inf
                for _ in range(3):
                    begin = time.perf_counter()
                    model.stepper.run(1e9, 20)
                    best = min(best, (time.perf_counter() - begin) / 20)
                memory = model.particles.memory() / model.particles.count
                took = f"{1e3 * best:.2f} ms a step, {memory:.0f} bytes a particle"
                print(f"{scheme} 1/{n} windows {windows}: {took}", flush=True)


def main() -> None:
    """Read the arguments and run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("gyre", "vortices", "cost"))
    parser.add_argument("--counts", type=int, nargs="+", help="particles along a length of 1")
    given = parser.parse_args()
    run, usual = {"gyre": (gyre, [24, 48, 96]), "vortices": (decaying, [32, 64, 128]), "cost": (cost, [128])}[given.what]
    run(given.counts or usual)


if __name__ == "__main__":
    main()
