"""Where the time of a step goes: seconds, runs and launches of each stage, and what it moves against the bandwidth.

    python scripts/profile_stages.py [SCENE ...] [--device cpu|cuda:0] [--threads 1] [--precision float32]
                                     [--particles 10000] [--steps 200] [--json FILE]

Scenes (all, if none is named): `droplet`, a square droplet of two phases with tension between walls; `vortices`, the
Taylor-Green flow with the defaults of the Riemann scheme; `lean`, the same with the conservative gradient and
h = 1.25 dx; `surface` and `surface_3d`, dam breaks of the Riemann scheme; `bubble`, the bubble that rises, water and air
with tension between walls; `delta`, vortices with delta-plus-SPH; `drop`, the elliptic drop of projection ISPH; `blast`,
the point explosion of the compressible gas in 2-D.

Steps run from the host, stage by stage, on a GPU too, with the device's own clock around each: what a graph saves between
stages is not in it, and the times of a GPU add up to more than a step takes. `us/step` is what a stage takes of a step on
average, `runs` how often a step runs it, `launches` how many kernels, sorts, scans, copies and fills that makes in a step.
`GB/s` is the least a stage moves over its time: each array that its kernel is given once, of the list the entries that are
there; a share of the copy bandwidth near 1 says that nothing is left to gain but bytes, a small one that the stage
computes, waits for single loads, or is over before it has begun. Stages of linear systems and of the list are timed alone.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import warp as wp

sys.path.insert(0, str(Path(__file__).parent))  # when imported instead of run
import bench_speed  # noqa: E402

from warpsph.case.case import Case  # noqa: E402
from warpsph.case.case_file import load_case  # noqa: E402
from warpsph.engine.launch import Launcher, Task  # noqa: E402
from warpsph.engine.program import Stage, walk  # noqa: E402
from warpsph.kernels.core import clock as ck  # noqa: E402
from warpsph.running.model import Model, quiet_warp  # noqa: E402
from warpsph.study.provenance import provenance  # noqa: E402

CASES = Path(__file__).resolve().parent.parent / "cases"
WARM_UP = 20  # steps
FOREVER = 1.0e3  # s
# What launches beside the kernels of tasks.
LAUNCHING = (
    (wp, "copy"), (wp.utils, "radix_sort_pairs"), (wp.utils, "array_scan"), (wp.array, "zero_"), (wp.array, "fill_"),
)  # fmt: skip


def shipped(name: str, spacing: float) -> dict[str, Any]:
    """Return a shipped case at a spacing [m] that measures and writes nothing and goes on for ever."""
    data = load_case(CASES / f"{name}.yaml").to_dict()
    kept = {key: value for key, value in data.items() if key not in ("reference", "validation", "gauges")}
    output = {"particles": "none", "checkpoint": "none"}
    return {**kept, "particle_spacing": spacing, "end_time": FOREVER, "output": output}


def across(particles: int) -> int:
    """Return how many of so many particles stand along the side of a square."""
    return max(round(particles**0.5), 8)


SCENES: dict[str, Callable[[int], dict[str, Any]]] = {
    "droplet": lambda n: bench_speed.square_droplet(across(n)),
    "vortices": lambda n: bench_speed.taylor_green(across(n), False),
    "lean": lambda n: bench_speed.taylor_green(across(n), True),
    "surface": lambda n: shipped("dam_break", (0.146 * 0.292 / n) ** 0.5),
    "surface_3d": lambda n: shipped("dam_break_3d", (0.146 * 0.073 * 0.292 / n) ** (1 / 3)),
    "bubble": lambda n: shipped("rising_bubble", (0.6 / n) ** 0.5),
    "delta": lambda n: bench_speed.delta_plus(across(n)),
    "drop": lambda n: shipped("elliptic_drop", (np.pi / n) ** 0.5),
    "blast": lambda n: shipped("sedov", 1.0 / across(n)),
}


@dataclasses.dataclass
class Spent:
    """What the tasks of one name took so far: device seconds, runs, launches."""

    seconds: float = 0.0
    runs: int = 0
    launches: int = 0


class Ledger:
    """Books what each task takes, while `open`; tasks have to be made within it."""

    def __init__(self, device: Any) -> None:
        self.device = device
        self.spent: dict[Task, Spent] = {}
        self.launches = 0

    @contextlib.contextmanager
    def open(self) -> Iterator[None]:
        """Count the launches of this thread and time tasks; another thread launches its share of the same kernels."""
        with contextlib.ExitStack() as stack:
            if self.device.is_cpu:
                stack.enter_context(mock.patch.object(Launcher, "_of_active", self._counted_task(Launcher._of_active)))
            for owner, name in LAUNCHING if self.device.is_cpu else (*LAUNCHING, (wp.Launch, "launch")):
                stack.enter_context(mock.patch.object(owner, name, self._counted(getattr(owner, name))))
            stack.enter_context(mock.patch.object(Task, "timed", lambda task: self.book(task)))
            yield

    def _counted(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **keywords: Any) -> Any:
            if threading.current_thread() is threading.main_thread():
                self.launches += 1
            return function(*arguments, **keywords)

        return call

    def _counted_task(self, make: Callable[..., Task]) -> staticmethod:
        """A task of a CPU runs its kernel on one thread or hands it to several: it is one launch."""

        def call(name: str, active: list[Callable[[], None]], resize: Callable[[int], None]) -> Task:
            task = make(name, active, resize)
            run = task.run

            def counted() -> None:
                self.launches += len(active)
                run()

            task.run = counted
            return task

        return staticmethod(call)

    def book(self, task: Task) -> None:
        """Run a task and add what it took."""
        before, begin = self.launches, time.perf_counter()
        if self.device.is_cpu:
            task.run()
            seconds = time.perf_counter() - begin
        else:
            events = [wp.Event(self.device, enable_timing=True) for _ in range(2)]
            wp.record_event(events[0])
            task.run()
            wp.record_event(events[1])
            seconds = 1.0e-3 * wp.get_event_elapsed_time(*events)
        spent = self.spent.setdefault(task, Spent())
        spent.seconds += seconds
        spent.runs += 1
        spent.launches += self.launches - before


def step_from_host(stepper: Any, steps: int) -> None:
    """Do steps stage by stage, without a graph.

    Raises:
        RuntimeError: the run diverged.
    """
    done = int(stepper.read()[1][ck.STEPS])
    stepper.write(clock={ck.TARGET: FOREVER}, counters={ck.STEP_LIMIT: done + steps, ck.ROOM: 1})
    stepper.restart_clock.run()
    if stepper.nodes.keeps_list:
        stepper.care_for_list()
    for _ in range(steps):
        stepper.nodes.run()
    if stepper.read()[1][ck.FAULT]:
        raise RuntimeError("the run diverged")


def entries(model: Any) -> float:
    """Return how many entries the list has."""
    found = sum(model.particles.get(f"{kind}_neighbours").astype(float).sum() for kind in ("fluid", "wall")
                if f"{kind}_neighbours" in model.particles.arrays)  # fmt: skip
    return float(found)


def least_bytes(model: Any) -> dict[str, float]:
    """Return by the name of a stage what one run of it moves at least: each array once, of the list what is there [B]."""
    bindings, listed = model.stepper.bindings, entries(model)
    share = float(model.stepper.read()[1][ck.BAND_COUNT]) / model.particles.fluid_count
    moved: dict[str, list[float]] = {}
    for stage in (node for node in walk(model.stepper.program.step) if isinstance(node, Stage)):
        total = 0.0
        for argument in stage.kernel.adj.args:
            array = bindings.get(stage.fields.get(argument.label, argument.label))
            if argument.label == "neighbours":
                total += 4.0 * listed
            elif isinstance(array, wp.array):
                total += array.capacity
        moved.setdefault(stage.name, []).append(total * (share if stage.rows == "band" else 1.0))
    return {name: sum(values) / len(values) for name, values in moved.items()}


def measure(scene: str, options: argparse.Namespace) -> dict[str, Any]:
    """Run a scene; return its rows, a stage each, in the order of a step, and those of the list."""
    data = {**SCENES[scene](options.particles), "precision": options.precision}
    ledger = Ledger(wp.get_device(options.device))
    with ledger.open():
        model = Model(Case.from_dict(data), device=options.device, threads=options.threads)
        stepper = model.stepper
        stepper.prepare(fresh=True)
        stepper.run(FOREVER, 1)  # the first step may be one of its own
        step_from_host(stepper, WARM_UP)
        ledger.spent.clear()
        begin = time.perf_counter()
        step_from_host(stepper, options.steps)
        wall = time.perf_counter() - begin
    sums = {task.name: Spent() for task in stepper.step_tasks}  # in the order of a step; then those of lists
    for task, spent in ledger.spent.items():
        row = sums.setdefault(task.name if task.name in sums else f"list: {task.name}", Spent())
        row.seconds += spent.seconds
        row.runs += spent.runs
        row.launches += spent.launches
    moved, total = least_bytes(model), sum(spent.seconds for spent in ledger.spent.values())
    rows = []
    for name, spent in sums.items():
        if spent.runs:
            rate = moved[name] * spent.runs / max(spent.seconds, 1e-9) if moved.get(name) else None
            rows.append({
                "stage": name, "runs": spent.runs / options.steps, "launches": spent.launches / options.steps,
                "us_per_step": 1e6 * spent.seconds / options.steps, "share": spent.seconds / total, "bandwidth": rate,
            })  # fmt: skip
    return {
        "scene": scene, "device": options.device, "threads": model.launcher.threads, "precision": options.precision,
        "particles": model.particles.count, "neighbours": entries(model) / model.particles.fluid_count,
        "us_per_step": 1e6 * wall / options.steps, "us_in_stages": 1e6 * total / options.steps,
        "launches": sum(row["launches"] for row in rows), "rows": rows,
    }  # fmt: skip


def show(result: dict[str, Any], bandwidth: float) -> None:
    """Print the table of a scene."""
    print(f"\n{result['scene']}: {result['particles']} particles, {result['neighbours']:.1f} neighbours in the list, "
          f"{result['device']}, {result['threads']} thread(s), {result['precision']}; "
          f"{result['us_per_step']:.0f} us a step, {result['us_in_stages']:.0f} of them in stages, "
          f"{result['launches']:.1f} launches\n")  # fmt: skip
    print("| stage | runs | launches | us/step | share | GB/s | of copy |\n|---|---|---|---|---|---|---|")
    for row in result["rows"]:
        rate = row["bandwidth"]
        last = f"{1e-9 * rate:.1f} | {rate / bandwidth:.2f}" if rate else " | "
        print(f"| {row['stage']} | {row['runs']:.2f} | {row['launches']:.2f} | {row['us_per_step']:.1f} "
              f"| {100 * row['share']:.1f} % | {last} |", flush=True)  # fmt: skip


def main() -> None:
    """Print a table for each scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(SCENES)}")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--precision", choices=["float32", "float64"], default="float32")
    parser.add_argument("--particles", type=float, default=1.0e4)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    options = parser.parse_args()
    unknown = set(options.scenes) - set(SCENES)
    if unknown:
        parser.error(f"unknown scene {', '.join(sorted(unknown))}; there are {', '.join(SCENES)}")
    options.particles = int(options.particles)
    quiet_warp()
    device = wp.get_device(options.device)
    bandwidth = bench_speed.copy_bandwidth(device, 256 if device.is_cpu else 2000)
    print(f"copy bandwidth {bandwidth / 1e9:.0f} GB/s")
    results = []
    for scene in options.scenes or SCENES:
        results.append(measure(scene, options))
        show(results[-1], bandwidth)
    if options.json:
        record = {**provenance(), "bandwidth": bandwidth, "scenes": results}
        options.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
