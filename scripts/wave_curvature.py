"""Does the interface of a capillary wave rest where it is flat? Its curvature by the particles against its amplitude.

    python scripts/wave_curvature.py [--spacings 64] [--until 5] [--set KEY=VALUE ...]

Runs `cases/capillary_wave.yaml`. The particles of the interface give the curvature K in K cos(k x), a least-squares fit with
the weights |n|^4 of the tension kernels (`docs/theory/riemann.md#a6`); the gauge `wave` gives the amplitude A, by the area
of the lower phase. A cosine has K = k^2 A (1 - 3/8 (k A)^2). What is left, `offset` [1/m], is not the shape of the interface
but the arrangement of the particles: it changes its sign with the motion where rows that the flow has slanted turn the
normals (`docs/records/tension.md#memory`). `in spacings` is the amplitude that it stands for.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from warpsph.case.case_file import load_case
from warpsph.errors import WarpsphError
from warpsph.simulation import Simulation

CASE = Path(__file__).parents[1] / "cases" / "capillary_wave.yaml"
WAVE_NUMBER = 2 * math.pi
FREQUENCY = math.sqrt(WAVE_NUMBER**3 / 2)  # of the shipped case without viscosity [1/s]


def cosine_of_curvature(frame: pv.PolyData) -> float:
    """Return K [1/m] of the curvature K cos(k x), positive where the lower phase is convex."""
    weight = (frame["normal"] ** 2).sum(axis=1) ** 2
    cosine = np.cos(WAVE_NUMBER * frame.points[:, 0])
    curvature = np.where(frame["phase"] == 0, 1.0, -1.0) * frame["curvature"]
    return float((weight * curvature * cosine).sum() / (weight * cosine**2).sum())


def offsets(spacings: int, until: float, changes: dict[str, str]) -> list[tuple[float, float, float]]:
    """Return the time times the frequency, the amplitude [m] and the offset of the curvature [1/m] at each frame."""
    settings: dict[str, Any] = {
        "particle_spacing": f"1/{spacings}",
        "end_time": str(until / FREQUENCY),
        "output.particles.interval": str(0.25 / FREQUENCY),
        "output.particles.fields": ["phase", "normal", "curvature"],
        "gauges.wave.interval": str(0.05 / FREQUENCY),
        **changes,
    }
    with tempfile.TemporaryDirectory() as folder:
        simulation = Simulation(load_case(CASE).replace(settings), output=Path(folder) / "run", threads=1)
        simulation.run()
        gauge = simulation.gauge("wave")
        frames = pv.get_reader(str(Path(folder) / "run" / "particles" / "fluid.pvd"))
        rows = []
        for time in frames.time_values:
            frames.set_active_time_value(time)
            amplitude = float(np.interp(time, gauge["time"], gauge["cosine"]))
            slope = WAVE_NUMBER * amplitude
            found = cosine_of_curvature(frames.read()[0])
            rows.append((FREQUENCY * time, amplitude, found - WAVE_NUMBER * slope * (1 - 0.375 * slope**2)))
    return rows


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacings", type=int, default=64, help="particles a wavelength (default: 64)")
    parser.add_argument("--until", type=float, default=5.0, metavar="PHASE", help="omega t of the end (default: 5)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a key of the case")
    options = parser.parse_args()
    wrong = [text for text in options.set if "=" not in text]
    if wrong:
        parser.error(f"--set {wrong[0]}: write KEY=VALUE")
    if options.spacings < 8 or not 0 < options.until < math.inf:
        parser.error("--spacings has to be at least 8, --until above 0 and finite")
    try:
        rows = offsets(options.spacings, options.until, dict(text.split("=", 1) for text in options.set))
    except WarpsphError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    print(f"{'omega t':>8s} {'amplitude':>10s} {'offset':>9s} {'in spacings':>12s}")
    for phase, amplitude, offset in rows:
        print(f"{phase:8.2f} {amplitude:10.5f} {offset:+9.4f} {offset / WAVE_NUMBER**2 * options.spacings:+12.4f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
