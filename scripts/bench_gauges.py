"""What gauges cost: one scene with and without them, by turns, on any device.

    python scripts/bench_gauges.py [--device cpu|cuda:0] [--particles 2e6] [--records 600] [--steps 6000] [--rounds 2]
                                   [--threads 2] [--gauges sums|all]

A bubble of gas in a tank of water in three dimensions. `sums` are the gauges whose numbers the device adds up: energy,
momentum, pressures, velocities, extents, forces on the walls. `all` adds what also needs places of particles on the host:
the surface energy, 19 sensors at a wall, strays (at every 25th record), and the length of the interface.

The records are spread evenly over the steps. A run without gauges stops at the same moments and measures nothing there, so
that the difference is what the gauges take, and not that the portions between two stops are shorter. On a machine that
others use too the difference of run times is their noise; the difference of processor times, on a CPU, and the time that
records hold the run up remain.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from warpsph import Simulation
from warpsph.case.case import Case

SUMS = ("energy", "momentum", "phase_pressure", "phase_velocity", "extents", "wall_force")
MORE = ("interface_length", "points", "strays")


class NoRecorder:
    """Stands in for the recorder of a run that is to measure nothing."""

    def take(self, names: Iterable[str]) -> None:
        """Take nothing."""

    def write(self, record: None) -> None:
        """Write nothing."""


def scene(particles: float, everything: bool) -> dict[str, Any]:
    """A tank of about so many particles, twice as high as wide, without gauges."""
    return {
        "title": "gauges",
        "dimension": 3,
        "particle_spacing": 1.0 / max(round((particles / 2.0) ** (1.0 / 3.0)), 4),
        "end_time": 1.0,
        "domain": {
            "lower": [0, 0, 0],
            "upper": [1, 1, 2],
            "boundary": {"x": "free_slip", "y": "free_slip", "z": "wall"},
        },
        "gravity": [0, 0, -9.81],
        "phases": {
            "water": {"density": 1000, "viscosity": 1.0, "gamma": 7},
            "gas": {"density": 1, "viscosity": 0.01, "gamma": 1.4},
        },
        "surface_tension": [{"between": ["gas", "water"], "coefficient": 1.0}] if everything else [],
        "fluids": [
            {"phase": "gas", "shape": {"sphere": {"center": [0.5, 0.5, 0.5], "radius": 0.25}}},
            {"phase": "water", "shape": "rest"},
        ],
        "start": {"pressure": "hydrostatic"},
        "output": {"particles": "none", "checkpoint": "none"},
    }


def gauges(everything: bool, interval: float) -> dict[str, Any]:
    """Gauges every `interval` [s]."""
    result: dict[str, Any] = {name: {"type": name, "interval": interval} for name in SUMS}
    if everything:
        result |= {name: {"type": name, "interval": interval} for name in MORE}
        result["points"] |= {"points": [[0, 0.5, height / 10] for height in range(1, 20)], "fields": ["pressure"]}
        result["strays"]["interval"] = 25 * interval
    return result


def duration(data: dict[str, Any], steps: int, options: argparse.Namespace) -> float:
    """Simulated time [s] that so many steps take, from the last of a few steps."""
    run = Simulation(Case.from_dict(data), device=options.device, threads=options.threads)
    run.model.stepper.run(1.0, 20)
    return steps * run.model.snapshot().dt


def measure(case: Case, records: bool, options: argparse.Namespace) -> dict[str, Any]:
    """Run the case, with its records or without; what its summary says, `seconds` of it, and those of all processors."""
    with tempfile.TemporaryDirectory() as folder:
        run = Simulation(case, output=Path(folder) / "run", device=options.device, threads=options.threads)
        run._recorder.take(list(case.gauges))  # loads the kernels
        if not records:
            run._recorder = NoRecorder()
        begin, processor = time.perf_counter(), time.process_time()
        run.run()
        took = {"seconds": time.perf_counter() - begin, "processor": time.process_time() - processor}
        return {**run.summary, **took}


def main() -> None:
    """Run by turns and print the share of the run time that the gauges take."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--particles", type=float, default=1e5)
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--steps", type=int, help="default: 10 a record")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--gauges", choices=("sums", "all"), default="sums")
    options = parser.parse_args()
    everything = options.gauges == "all"
    data = scene(options.particles, everything)
    end = duration(data, options.steps or 10 * options.records, options)
    data |= {"end_time": end, "gauges": gauges(everything, end / options.records)}
    case = Case.from_dict(data)
    found: dict[bool, list[float]] = {True: [], False: []}
    processor: dict[bool, list[float]] = {True: [], False: []}
    held: list[float] = []
    for number in range(options.rounds):
        for records in (False, True):
            result = measure(case, records, options)
            found[records].append(result["seconds"])
            processor[records].append(result["processor"])
            output = result["output_seconds"]
            if records:
                held.append(output["copying"])
            print(
                f"round {number + 1}, {'with' if records else 'without'} gauges: {result['seconds']:.2f} s, "
                f"{result['particles']} particles, {result['steps']} steps; held up {output['copying']:.2f} s, "
                f"writing beside the run {output['writing beside the run']:.2f} s",
                flush=True,
            )
    total = statistics.median(found[True])
    print(f"{options.records} records of {options.gauges} gauges on {options.device}, run time {total:.1f} s:")
    for what, seconds, whole in (
        ("difference of the run times", total - statistics.median(found[False]), total),
        (
            "difference of the processor times",
            statistics.median(processor[True]) - statistics.median(processor[False]),
            statistics.median(processor[True]),
        ),
        ("time that records hold the run up", statistics.median(held), total),
    ):
        print(f"  {what}: {1e3 * seconds / options.records:.1f} ms a record, {100 * seconds / whole:.1f} %")


if __name__ == "__main__":
    main()
