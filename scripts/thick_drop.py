"""How fast does a drop of another viscosity go back to a circle? Against Stokes flow in the same box.

    python scripts/thick_drop.py [--spacings 8 16 32] [--viscosity 10] [--sound-speed 100] [--device cpu|cuda:0]
                                 [--set numerics.viscosity_form=radial ...]

An ellipse of axes 1.1 and 1/1.1 in a matrix at rest, walls at +-4, period 8; tension 100, viscosity of the matrix 10
(2-D). Printed are the rate at which D falls once the flow has begun, that of the boundary integrals of
scripts/shear_drop_exact.py, and the error. 8 spacings a radius take 3 s on one core, 16 12 s, 32 a minute.
"""

import argparse
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.simulation import Simulation

sys.path.insert(0, str(Path(__file__).resolve().parent))  # not there where Python runs with -P, or a test loads this file
from shear_drop_exact import Channel, Drop, Interface, spread  # noqa: E402

TENSION, MATRIX, LONG, HALF = 100.0, 10.0, 1.1, 4.0


def case_of(spacings: int, ratio: float, sound_speed: float = 100.0) -> dict[str, Any]:
    """The case with so many spacings a radius and a drop of `ratio` times the viscosity of its matrix."""
    inside = f"(x/{LONG})**2 + (y*{LONG})**2 < 1"
    return {
        "dimension": 2,
        "particle_spacing": 1 / spacings,
        "end_time": 0.25 * 8 / max(spacings, 8) + 0.05,
        "domain": {"lower": [-HALF, -HALF], "upper": [HALF, HALF], "boundary": {"x": "periodic", "y": "wall"}},
        "phases": {
            "drop": {"density": 1, "viscosity": ratio * MATRIX, "gamma": 1, "sound_speed": sound_speed},
            "matrix": {"density": 1, "viscosity": MATRIX, "gamma": 1, "sound_speed": sound_speed},
        },
        "surface_tension": [{"between": ["drop", "matrix"], "coefficient": TENSION}],
        "fluids": [{"phase": "drop", "shape": {"where": {"condition": inside}}}, {"phase": "matrix", "shape": "rest"}],
        "start": {"pressure": f"where({inside}, {TENSION}, 0)"},
        "numerics": {"viscous_stages": "auto", "smoothing_ratio": 2},
        "output": {"particles": "none", "checkpoint": "none"},
        "gauges": {"drop": {"type": "deformation", "interval": 0.01, "phases": ["drop"]}},
    }


def rate_of(time: np.ndarray, deformation: np.ndarray) -> float:
    """Rate at which D falls [1/s], rows (n,); the first 0.06 s, in which the flow begins, do not count."""
    late = time > 0.06
    return float(-np.polyfit(time[late], np.log(deformation[late]), 1)[0])


def rate_of_stokes_flow(ratio: float) -> float:
    """The same of the boundary integrals, from the start on [1/s]."""
    angle = 2 * np.pi * np.arange(64) / 64
    place = spread(np.column_stack([LONG * np.cos(angle), np.sin(angle) / LONG]), np.pi)
    drop = Drop(ratio, TENSION / MATRIX, Channel(HALF, 2 * HALF), shear=0.0)
    first, step = Interface(place).shape()[0], 2e-3
    for _ in range(5):
        place = place + step * drop.motion(place + step / 2 * drop.motion(place)[0])[0]
    return math.log(first / Interface(place).shape()[0]) / (5 * step)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacings", type=int, nargs="+", default=[8, 16], help="particle spacings a radius")
    parser.add_argument("--viscosity", type=float, default=10.0, help="of the drop over that of the matrix")
    parser.add_argument("--sound-speed", type=float, default=100.0, help="m/s")
    parser.add_argument("--set", nargs="*", default=[], help="further keys, as numerics.shifting=0")
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()
    if min(options.spacings) < 4:
        parser.error(f"--spacings {min(options.spacings)}: fewer than 4 a radius are no drop; give 4 or more")
    if not (options.viscosity > 0 and options.sound_speed > 0):
        parser.error("--viscosity and --sound-speed have to be above 0")
    if any("=" not in text for text in options.set):
        parser.error("--set: write key=value, as numerics.shifting=0")
    exact = rate_of_stokes_flow(options.viscosity)
    for spacings in options.spacings:
        case = Case.from_dict(case_of(spacings, options.viscosity, options.sound_speed))
        case = case.replace(dict(text.split("=", 1) for text in options.set))
        found = Simulation(case, device=options.device, threads=1).run().gauge("drop")
        rate = rate_of(found["time"], found["deformation drop"])
        print(f"{spacings:4d} spacings a radius: {rate:.3f}/s, Stokes flow {exact:.3f}/s, {100 * (rate / exact - 1):+.1f} %")


if __name__ == "__main__":
    main()
