"""How many lanes a particle should have on a GPU: milliseconds a step over scenes, sizes and numbers of lanes.

    python scripts/bench_lanes.py [SCENE[:PARTICLES,PARTICLES ...] ...] [--lanes 1 2 4 8] [--device cuda:0]
                                  [--precision float32] [--seconds 0.25] [--json FILE]

Scenes are those of `profile_stages.py`, and `box`, a periodic box in 3-D with one phase; `shear` and `shear_3d`, drops in
shear with friction in stages. All scenes with sizes of their own, if none is named. `rule` is what a run takes by itself
(`lanes_for` of `kernels/core/lanes.py`). Each time is the median of five portions of a run, after sixty steps.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import time
from pathlib import Path
from typing import Any
from unittest import mock

import warp as wp

sys.path.insert(0, str(Path(__file__).parent))  # when imported instead of run
import bench_speed  # noqa: E402
import profile_stages  # noqa: E402

from warpsph.case.case import Case  # noqa: E402
from warpsph.kernels.core.lanes import lanes_for  # noqa: E402
from warpsph.running.model import Model, quiet_warp  # noqa: E402
from warpsph.study.provenance import provenance  # noqa: E402

SCENES = {
    **profile_stages.SCENES,
    "box": lambda n: bench_speed.box(round(n ** (1 / 3))),
    "shear": lambda n: profile_stages.shipped("shear_drop", (64 / n) ** 0.5),
    "shear_3d": lambda n: profile_stages.shipped("shear_drop_3d", (144 / n) ** (1 / 3)),
}
SIZES = {
    "droplet": (5e3, 1.1e4, 2e4, 4e4, 7e4, 1.2e5, 2.5e5, 1e6),
    "bubble": (1.1e4, 4e4),
    "vortices": (5e3, 1e4, 2e4, 4e4, 7e4, 1.2e5, 2.5e5, 1e6),
    "delta": (5e3, 1e4, 4e4, 1e5, 2.5e5, 1e6),
    "surface": (1.2e4, 4e4, 1e5),
    "surface_3d": (1.8e4, 6e4),
    "box": (1e4, 3e4, 6e4, 1.25e5, 3e5, 1e6, 3e6),
    "shear": (8e3, 3e4),
    "shear_3d": (3e4, 1.2e5, 4e5),
    "blast": (1e4, 4e4, 1.3e5),
}
WARM_UP, FOREVER, PORTIONS = 60, 1.0e9, 5


def parsed(text: str) -> tuple[str, tuple[float, ...]]:
    """Return scene and sizes of an argument, `droplet` or `droplet:10000,40000`."""
    scene, _, sizes = text.partition(":")
    if scene not in SCENES:
        raise argparse.ArgumentTypeError(f"{scene}: no scene of that name; there are {', '.join(SCENES)}")
    if not sizes and scene not in SIZES:
        raise argparse.ArgumentTypeError(f"{scene}: has no sizes of its own; write {scene}:10000,40000")
    if not sizes:
        return scene, SIZES[scene]
    try:
        found = tuple(float(size) for size in sizes.split(","))
    except ValueError:
        found = ()
    if not found or not all(1 <= size < math.inf for size in found):
        raise argparse.ArgumentTypeError(f"{text}: sizes are numbers of particles, as in {scene}:10000,40000")
    return scene, found


def measure(data: dict[str, Any], lanes: int, device: str, seconds: float) -> tuple[Model, float]:
    """Return a scene's model with so many lanes, and the ms a step that it takes."""
    from warpsph.running import model as of_model

    with mock.patch.object(of_model, "lanes_for", return_value=lanes):
        model = Model(Case.from_dict(data), device=device)
    stepper = model.stepper
    stepper.prepare(fresh=True)
    stepper.run(FOREVER, WARM_UP)
    wp.synchronize_device(model.device)
    begin = time.perf_counter()
    stepper.run(FOREVER, 20)
    stepper.read()
    portion = max(20, int(20 * seconds / PORTIONS / (time.perf_counter() - begin)))
    times = []
    for _ in range(PORTIONS):
        begin = time.perf_counter()
        stepper.run(FOREVER, portion)
        stepper.read()
        times.append((time.perf_counter() - begin) / portion)
    return model, 1.0e3 * statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=parsed, metavar="SCENE[:PARTICLES,...]")
    parser.add_argument("--lanes", type=int, nargs="+", default=[1, 2, 4, 8], choices=[1, 2, 4, 8, 16, 32])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--precision", default="float32", choices=["float32", "float64"])
    parser.add_argument("--seconds", type=float, default=0.25, help="measured time of each number")
    parser.add_argument("--json", type=Path, help="write the rows to a file")
    arguments = parser.parse_args()
    if arguments.json and not arguments.json.absolute().parent.is_dir():
        parser.error(f"--json {arguments.json}: there is no folder {arguments.json.parent}; make it first")
    if not arguments.device.startswith("cuda") or not wp.is_cuda_available():
        parser.error(f"--device {arguments.device}: lanes are of a GPU, and there is none of that name here")
    quiet_warp()
    rows = []
    print(f"{'scene':12} {'particles':>9} {'rule':>4}  " + " ".join(f"{lanes:>7} l" for lanes in arguments.lanes))
    for scene, sizes in arguments.scenes or [(name, SIZES[name]) for name in SIZES]:
        for size in sizes:
            data = {**SCENES[scene](int(size)), "precision": arguments.precision}
            found = {lanes: measure(data, lanes, arguments.device, arguments.seconds) for lanes in arguments.lanes}
            model = found[arguments.lanes[0]][0]
            spec, particles = model.physics.spec, model.particles.fluid_count
            rule = lanes_for(spec, particles, model.device.sm_count)
            row = {"scene": scene, "particles": particles, "precision": arguments.precision, "dimension": spec.dimension}
            row |= {"multiphase": spec.multiphase, "varying_h": spec.varying_h}
            row["ms_per_step"] = {str(lanes): found[lanes][1] for lanes in arguments.lanes}
            rows.append(row)
            times = " ".join(f"{found[lanes][1]:9.4f}" for lanes in arguments.lanes)
            print(f"{scene:12} {particles:9d} {rule:4d}  {times}", flush=True)
    if arguments.json:
        device = wp.get_device(arguments.device)
        record = {**provenance(), "device": device.name, "multiprocessors": device.sm_count, "rows": rows}
        arguments.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
