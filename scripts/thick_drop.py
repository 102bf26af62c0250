"""How fast does a drop of another viscosity go back to a circle? Against Stokes flow in the same box.

    python scripts/thick_drop.py [--spacings 8 16 32] [--viscosity 10] [--tension 100] [--sound-speed 100]
                                 [--device cpu|cuda:0] [--set numerics.viscosity_form=radial ...]

An ellipse of axes 1.1 and 1/1.1 in a matrix at rest, walls at +-4, period 8; viscosity of the matrix 10, densities 1 (2-D).
Printed are the rate at which D falls once the flow has begun, that of the boundary integrals of
scripts/shear_drop_exact.py between the same two deformations, and the error. Inertia makes the rate larger, by 0.3 of
rate/10 with one viscosity and 0.5 of it with a tenth: less tension takes it out, and as much longer. With a tension of 100
8 spacings a radius take 3 s on one core, 16 12 s, 32 a minute.
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
BEGUN = 0.06  # s with a tension of TENSION, after which the flow has begun


def case_of(spacings: int, ratio: float, sound_speed: float = 100.0, tension: float = TENSION) -> dict[str, Any]:
    """The case with so many spacings a radius and a drop of `ratio` times the viscosity of its matrix."""
    inside = f"(x/{LONG})**2 + (y*{LONG})**2 < 1"
    slower = TENSION / tension
    return {
        "dimension": 2,
        "particle_spacing": 1 / spacings,
        "end_time": (0.25 * 8 / max(spacings, 8) + 0.05) * slower,
        "domain": {"lower": [-HALF, -HALF], "upper": [HALF, HALF], "boundary": {"x": "periodic", "y": "wall"}},
        "phases": {
            "drop": {"density": 1, "viscosity": ratio * MATRIX, "gamma": 1, "sound_speed": sound_speed},
            "matrix": {"density": 1, "viscosity": MATRIX, "gamma": 1, "sound_speed": sound_speed},
        },
        "surface_tension": [{"between": ["drop", "matrix"], "coefficient": tension}],
        "fluids": [{"phase": "drop", "shape": {"where": {"condition": inside}}}, {"phase": "matrix", "shape": "rest"}],
        "start": {"pressure": f"where({inside}, {tension}, 0)"},
        "numerics": {"viscous_stages": "auto", "smoothing_ratio": 2},
        "output": {"particles": "none", "checkpoint": "none"},
        "gauges": {"drop": {"type": "deformation", "interval": 0.01 * slower, "phases": ["drop"]}},
    }


def rate_of(time: np.ndarray, deformation: np.ndarray, tension: float = TENSION) -> tuple[float, float, float]:
    """Rate at which D falls [1/s], and the D between which it is measured, from rows (n,)."""
    late = time > BEGUN * TENSION / tension
    rate, first = np.polyfit(time[late], np.log(deformation[late]), 1)
    begin, end = (math.exp(first + rate * time[late][k]) for k in (0, -1))
    return float(-rate), begin, end


def rate_of_stokes_flow(ratio: float, begin: float = 0.094, end: float = 0.09, tension: float = TENSION) -> float:
    """The mean rate of the boundary integrals [1/s] on the way from the one D to the other, both below 0.095."""
    angle = 2 * np.pi * np.arange(64) / 64
    place = spread(np.column_stack([LONG * np.cos(angle), np.sin(angle) / LONG]), np.pi)
    drop = Drop(ratio, tension / MATRIX, Channel(HALF, 2 * HALF), shear=0.0)
    step = 0.01 * MATRIX * (1 + ratio) / tension
    logs = [math.log(Interface(place).shape()[0])]
    while logs[-1] > math.log(end):
        place = place + step * drop.motion(place + step / 2 * drop.motion(place)[0])[0]
        logs.append(math.log(Interface(place).shape()[0]))
    since = np.interp([-math.log(begin), -math.log(end)], [-level for level in logs], step * np.arange(len(logs)))
    return float(math.log(begin / end) / (since[1] - since[0]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacings", type=int, nargs="+", default=[8, 16], help="particle spacings a radius")
    parser.add_argument("--viscosity", type=float, default=10.0, help="of the drop over that of the matrix")
    parser.add_argument("--tension", type=float, default=TENSION, help="N/m")
    parser.add_argument("--sound-speed", type=float, default=100.0, help="m/s")
    parser.add_argument("--set", nargs="*", default=[], help="further keys, as numerics.shifting=0")
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()
    if min(options.spacings) < 4:
        parser.error(f"--spacings {min(options.spacings)}: fewer than 4 a radius are no drop; give 4 or more")
    if not min(options.viscosity, options.tension, options.sound_speed) > 0:
        parser.error("--viscosity, --tension and --sound-speed have to be above 0")
    if any("=" not in text for text in options.set):
        parser.error("--set: write key=value, as numerics.shifting=0")
    for spacings in options.spacings:
        case = Case.from_dict(case_of(spacings, options.viscosity, options.sound_speed, options.tension))
        case = case.replace(dict(text.split("=", 1) for text in options.set))
        found = Simulation(case, device=options.device, threads=1).run().gauge("drop")
        rate, begin, end = rate_of(found["time"], found["deformation drop"], options.tension)
        exact = rate_of_stokes_flow(options.viscosity, begin, end, options.tension)
        print(f"{spacings:4d} spacings a radius: {rate:.4f}/s, Stokes flow {exact:.4f}/s, {100 * (rate / exact - 1):+.1f} %")


if __name__ == "__main__":
    main()
