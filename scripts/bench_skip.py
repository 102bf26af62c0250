"""What a scene does not need costs nothing: ms a step of ever leaner scenes, and of the leanest step written by hand.

    python scripts/bench_skip.py [--device cpu|cuda:0] [--threads 1 2] [--particles 10000] [--rounds 9] [--json FILE]

The scenes, each without one piece more than the one before: two phases 1000:1 with surface tension, walls, viscosity and
gravity; sigma = 0; a single phase; inviscid; no gravity; periodic instead of walls; the conservative pressure gradient.
Same spacing, smoothing length (1.25 dx), start velocity and sound speed, float32; a walled scene has wall particles on top.

The last one is compared with the same step written by hand in this file: four kernels without any option, their numbers
plain arguments, launched with nothing in between (on CUDA: one graph of all steps). It runs on the arrays and the
neighbour list of the package's run and ends each step with the same clock kernel, so both do the same work; that they do is
checked by comparing all fields after 20 steps.

Every measurement repeats the same steps from the same saved state, right after a list build; no list is checked or rebuilt
in them, in either. What a rebuild costs is a column of its own. All scenes take turns in one process; medians. `CPU ms` is
the processor time of all threads: where others use the machine too, it says more than the time on the wall.
"""

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from warpsph.case.case import Case
from warpsph.engine.replay import Replay
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.spec import SWEEP_OPTIONS
from warpsph.running.model import Model, quiet_warp
from warpsph.study.provenance import provenance

TARGET = 1.03  # package over hand
CHECKED_STEPS = 20
WARM_UP = 20
FOREVER = 1.0e6  # s
SPEED, SOUND = 0.05, 40.0  # m/s; the list then outlasts more than a hundred steps
PAIRS = 5  # comparisons with the hand-written step in a round


# scenes ----------------------------------------------------------------------------------------------------------------


def scenes(n: int) -> dict[str, dict[str, Any]]:
    """Return the cases with n x n fluid particles, from the full scene to the leanest, each the one before and less."""
    liquid = {"density": 1000.0, "viscosity": 0.5, "sound_speed": SOUND}
    gas = {"density": 1.0, "viscosity": 0.005, "gamma": 1.4, "sound_speed": SOUND}
    full = {
        "dimension": 2,
        "particle_spacing": 1.0 / n,
        "end_time": FOREVER,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "gravity": [0, -0.01],
        "phases": {"liquid": liquid, "gas": gas},
        "surface_tension": [{"between": ["gas", "liquid"], "coefficient": 1.0}],
        "fluids": [
            {"phase": "gas", "shape": {"box": {"lower": [0.25, 0.25], "upper": [0.75, 0.75]}}},
            {"phase": "liquid", "shape": "rest"},
        ],
        "start": {
            "noise": 0.1,
            "velocity": [f"{SPEED}*sin(2*pi*x)*cos(2*pi*y)", f"-{SPEED}*cos(2*pi*x)*sin(2*pi*y)"],
        },
        "numerics": {"smoothing_ratio": 1.25},
        "output": {"particles": "none", "checkpoint": "none"},
    }
    no_tension = {**full, "surface_tension": []}
    one_phase = {**no_tension, "phases": {"liquid": liquid}, "fluids": [{"phase": "liquid", "shape": "rest"}]}
    inviscid = {**one_phase, "phases": {"liquid": {**liquid, "viscosity": 0.0}}}
    weightless = {**inviscid, "gravity": [0, 0]}
    box = {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}}
    periodic = {**weightless, "domain": box}
    least = {"smoothing_ratio": 1.25, "pressure_gradient": "conservative", "disorder_friction": 0}
    leanest = {**periodic, "numerics": least}
    return {
        "full": full,
        "sigma = 0": no_tension,
        "single phase": one_phase,
        "inviscid": inviscid,
        "no gravity": weightless,
        "periodic": periodic,
        "leanest": leanest,
    }


# the step by hand ------------------------------------------------------------------------------------------------------


@wp.func
def nearest(d: float, period: float, half: float):
    """Component of a separation to the nearest periodic image."""
    result = d
    if d > half:
        result = d - period
    elif d < -half:
        result = d + period
    return result


@wp.func
def slope(q: float):
    """w'(q)/q of the Wendland C2 kernel."""
    u = wp.max(2.0 - q, 0.0)
    return -10.0 * u * u * u


@wp.func
def pressure_of(s: float, stiffness: float, g: float):
    """B [(1+s)^gamma - 1], by the binomial series where s is small."""
    series = s * (
        g
        + s
        * (g * (g - 1.0) / 2.0)
        * (
            1.0
            + s
            * ((g - 2.0) / 3.0)
            * (
                1.0
                + s
                * ((g - 3.0) / 4.0)
                * (1.0 + s * ((g - 4.0) / 5.0) * (1.0 + s * ((g - 5.0) / 6.0) * (1.0 + s * ((g - 6.0) / 7.0))))
            )
        )
    )
    result = stiffness * series
    if wp.abs(s) > 0.1:
        result = stiffness * (wp.pow(wp.max(1.0 + s, 0.0), g) - 1.0)
    return result


@wp.kernel(module="unique", enable_backward=False)
def hand_kick_drift(
    first: int,
    slot: int,
    clock: wp.array(dtype=wp.float64),
    acceleration: wp.array(dtype=wp.vec2),
    anchor: wp.array(dtype=wp.vec2),
    state: wp.array(dtype=wp.vec2),
    density_excess: wp.array(dtype=float),
    velocity: wp.array(dtype=wp.vec2),
    offset: wp.array(dtype=wp.vec2),
    position: wp.array(dtype=wp.vec2),
    midway: wp.array(dtype=wp.vec2),
    state_old: wp.array(dtype=wp.vec2),
    maxima: wp.array(dtype=float),
    faults: wp.array(dtype=int),
):
    i = wp.tid() + first
    dt = clock[ck.STEP]
    v = velocity[i] + acceleration[i] * float(wp.float64(0.5) * (dt + clock[ck.LAST_STEP]))
    way = offset[i] + v * float(dt)
    velocity[i] = v
    offset[i] = way
    x = anchor[i] + way
    position[i] = x
    midway[i] = anchor[i] + (way - v * float(wp.float64(0.5) * dt))
    state_old[i] = state[i]
    v2 = wp.dot(v, v)
    o2 = wp.dot(way, way)
    if v2 > maxima[slot * ck.MAXIMA]:
        wp.atomic_max(maxima, slot * ck.MAXIMA, v2)
    if o2 > maxima[slot * ck.MAXIMA + 2]:
        wp.atomic_max(maxima, slot * ck.MAXIMA + 2, o2)
    limit = float(clock[ck.RUNAWAY])
    if not (v2 < limit * limit and wp.abs(density_excess[i]) < 0.9 and wp.dot(x, x) < 1.0e30):
        wp.atomic_min(faults, slot, i)


def hand_sweeps(by_rows: bool) -> tuple[Any, Any]:
    """Return (continuity, momentum) for a list by rows (CPU) or by columns (GPU)."""

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def hand_continuity(
        first: int,
        count: int,
        width: int,
        inv_h: float,
        g_norm: float,
        inv_impedance: float,
        stiffness: float,
        gamma: float,
        box: wp.vec2,
        half: wp.vec2,
        clock: wp.array(dtype=wp.float64),
        neighbours: wp.array(dtype=int),
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        midway: wp.array(dtype=wp.vec2),
        velocity: wp.array(dtype=wp.vec2),
        state_old: wp.array(dtype=wp.vec2),
        rest_volume: wp.array(dtype=float),
        density_excess: wp.array(dtype=float),
        state: wp.array(dtype=wp.vec2),
    ):
        i = wp.tid() + first
        xi = midway[i]
        vi = velocity[i]
        p_i = state_old[i][0]
        wrapped = int(flags[i]) != 0
        rate = wp.float32(0.0)
        if wp.static(by_rows):
            k = i * width
            step = 1
        else:
            k = int(i)
            step = count
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbours[k]
            k += step
            d = xi - midway[j]
            if wrapped:
                d[0] = nearest(d[0], box[0], half[0])
                d[1] = nearest(d[1], box[1], half[1])
            r = wp.sqrt(wp.dot(d, d))
            state_j = state_old[j]
            f = slope(r * inv_h) * state_j[1]
            term = wp.dot(vi - velocity[j], d)
            dp = p_i - state_j[0]
            term += dp * r * inv_impedance
            rate += f * term
        s = density_excess[i]
        s += float(clock[ck.STEP]) * (1.0 + s) * g_norm * rate
        density_excess[i] = s
        state[i] = wp.vec2(pressure_of(s, stiffness, gamma), rest_volume[i] / (1.0 + s))

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def hand_momentum(
        first: int,
        slot: int,
        count: int,
        width: int,
        inv_h: float,
        g_norm: float,
        density: float,
        box: wp.vec2,
        half: wp.vec2,
        neighbours: wp.array(dtype=int),
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=wp.vec2),
        state: wp.array(dtype=wp.vec2),
        rest_volume: wp.array(dtype=float),
        acceleration: wp.array(dtype=wp.vec2),
        maxima: wp.array(dtype=float),
    ):
        i = wp.tid() + first
        xi = position[i]
        state_i = state[i]
        p_i = state_i[0]
        wrapped = int(flags[i]) != 0
        total = wp.vec2()
        if wp.static(by_rows):
            k = i * width
            step = 1
        else:
            k = int(i)
            step = count
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbours[k]
            k += step
            d = xi - position[j]
            if wrapped:
                d[0] = nearest(d[0], box[0], half[0])
                d[1] = nearest(d[1], box[1], half[1])
            state_j = state[j]
            f = slope(wp.sqrt(wp.dot(d, d)) * inv_h) * state_j[1]
            total += (state_j[0] + p_i) * (f * d)
        a = total * (-g_norm / (density * rest_volume[i] / state_i[1]))
        acceleration[i] = a
        a2 = wp.dot(a, a)
        if a2 > maxima[slot * ck.MAXIMA + 1]:
            wp.atomic_max(maxima, slot * ck.MAXIMA + 1, a2)

    return hand_continuity, hand_momentum


class HandStep:
    """The leanest step by hand, on the arrays of a model of the leanest scene.

    Args:
        model: model of the scene `leanest`, its list built; the list must keep its width.
    """

    STAGES = 4

    def __init__(self, model: Model) -> None:
        self.model = model
        stepper, arrays = model.stepper, model.particles.arrays
        params, (phase,) = stepper.bindings["params"], model.case.phases.values()
        continuity, momentum = hand_sweeps(model.launcher.is_cpu)
        n = model.particles.count
        stiffness = phase.density * model.physics.sound_speed[0] ** 2 / phase.gamma
        numbers = {
            "count": n,
            "width": stepper.list.width,
            "inv_h": params.inv_h,
            "g_norm": params.g_norm,
            "inv_impedance": 1.0 / (phase.density * model.physics.sound_speed[0]),
            "stiffness": stiffness,
            "gamma": phase.gamma,
            "density": phase.density,
            "box": wp.vec2(*params.box),
            "half": wp.vec2(*params.half_box),
        }
        values = {
            **numbers,
            **arrays,
            "neighbours": stepper.list.neighbours,
            "clock": stepper.clock,
            "maxima": stepper.maxima,
            "faults": stepper.faults,
            "counters": stepper.counters,
            "advancing": 1,
        }
        self.arrays = {
            argument.label
            for kernel in (hand_kick_drift, continuity, momentum)
            for argument in kernel.adj.args
            if argument.label in arrays
        }
        launcher = model.launcher
        threads = launcher.threads
        self.sweeps: list[Callable[[], None]] = []
        for kernel in (hand_kick_drift, continuity, momentum):
            parts = []
            for slot in range(threads):
                first, end = n * slot // threads, n * (slot + 1) // threads
                inputs = [{**values, "first": first, "slot": slot}[argument.label] for argument in kernel.adj.args]
                parts.append(wp.launch(kernel, end - first, inputs, device=model.device, record_cmd=True))
            # as the package launches its own kernels
            together = launcher.team.together([Replay(part) for part in parts]) if launcher.is_cpu else parts[0].launch
            self.sweeps.append(together)
        # the clock is the package's own: the time and the decisions of both are the same
        advance = wp.launch(
            ck.make_advance("float32"),
            1,
            [values[name] for name in ("advancing", "maxima", "faults", "clock", "counters")],
            device=model.device,
            record_cmd=True,
        )
        self.advance = Replay(advance).launch if launcher.is_cpu else advance.launch
        self.graphs: dict[int, Any] = {}

    def run(self, steps: int) -> None:
        """Do the steps; the list must outlast them."""
        stepper = self.model.stepper
        stepper.write(clock={ck.TARGET: FOREVER}, counters={ck.STEP_LIMIT: int(stepper.read()[1][ck.STEPS]) + steps})
        stepper.restart_clock.run()
        if not self.model.launcher.is_cpu:
            if steps not in self.graphs:
                with wp.ScopedCapture(device=self.model.device) as capture:
                    self._steps(steps)
                self.graphs[steps] = capture.graph
            wp.capture_launch(self.graphs[steps])
            stepper.read()  # as the package does to see how far it came
        else:
            self._steps(steps)

    def _steps(self, steps: int) -> None:
        drift, continuity, momentum = self.sweeps
        for _ in range(steps):
            drift()
            continuity()
            momentum()
            self.advance()


# measuring -------------------------------------------------------------------------------------------------------------


class Bench:
    """A scene that can do the same steps again and again, from a state right after a list build.

    Args:
        data: case.
        device, threads: where it runs.
        window: steps to do; fewer if the list does not outlast them.
    """

    def __init__(self, data: dict[str, Any], device: str, threads: int, window: int) -> None:
        self.model = Model(Case.from_dict(data), device=device, threads=threads)
        stepper = self.model.stepper
        stepper.prepare(fresh=True)
        stepper.run(FOREVER, WARM_UP)
        stepper.rebuild()
        self.rebuild_ms = 1e3 * statistics.median(self._time(stepper.rebuild)[0] for _ in range(5))
        self._live = [*self.model.particles.arrays.values(), stepper.clock, stepper.counters, stepper.maxima]
        self._live = [array for array in self._live if array.size]
        self._saved = [wp.clone(array) for array in self._live]
        self.window = window
        while not self._list_lasts():
            self.window //= 2
            if self.window < 1:
                raise RuntimeError("the list does not outlast a single step")

    def _time(self, run: Any) -> tuple[float, float]:
        wp.synchronize_device(self.model.device)
        begin, used = time.perf_counter(), time.process_time()
        run()
        wp.synchronize_device(self.model.device)
        return time.perf_counter() - begin, time.process_time() - used

    def _list_lasts(self) -> bool:
        before = self.model.stepper.read()[1].copy()
        self.restore()
        self.package(self.window)
        after = self.model.stepper.read()[1].copy()
        if after[ck.FAULT]:
            raise RuntimeError(f"the scene diverges at particle {after[ck.FAULT_PARTICLE]}")
        return bool((after[[ck.REBUILDS, ck.CHECKS]] == before[[ck.REBUILDS, ck.CHECKS]]).all())

    def restore(self) -> None:
        """Go back to the saved state."""
        for array, saved in zip(self._live, self._saved, strict=True):
            wp.copy(array, saved)

    def package(self, steps: int) -> None:
        """Do steps with the package."""
        self.model.stepper.run(FOREVER, steps)

    def ms_per_step(self, run: Any) -> tuple[float, float]:
        """Return (time, processor time) of a step [ms] in `run(steps)` over the window, from the saved state."""
        self.restore()
        wall, used = self._time(lambda: run(self.window))
        return 1e3 * wall / self.window, 1e3 * used / self.window

    def state_after(self, run: Any, steps: int) -> dict[str, np.ndarray]:
        """Return all fields, the clock and the counters after `run(steps)` from the saved state."""
        self.restore()
        run(steps)
        clock, counters = self.model.stepper.read()
        return {**self.model.particles.kept(), "clock": np.array(clock), "counters": np.array(counters)}


def compare(bench: Bench, hand: HandStep) -> dict[str, Any]:
    """Return how far package and hand are apart after the checked steps, in units of float32 rounding of each field."""
    steps = min(CHECKED_STEPS, bench.window)
    package, own = (bench.state_after(run, steps) for run in (bench.package, hand.run))
    start = bench.state_after(lambda _: None, 0)
    apart = {}
    for name in ("position", "velocity", "density_excess", "acceleration"):
        scale = float(np.abs(package[name]).max()) * float(np.finfo(np.float32).eps)
        apart[name] = float(np.abs(package[name] - own[name]).max()) / scale if scale > 0 else 0.0
    return {
        "steps": steps,
        "moved": float(np.abs(package["position"] - start["position"]).max()),
        "identical": all(np.array_equal(package[name], own[name]) for name in package if name != "counters"),
        "roundings": apart,
    }


def agrees(check: dict[str, Any]) -> bool:
    """Return whether package and hand did the same, but for the rounding that the steps add up."""
    apart = check["roundings"]
    # the noise of the start sends sound around: pressure, and with it the acceleration, amplifies a rounding
    return check["identical"] or max(apart["position"], apart["velocity"] / 50) < 4 * check["steps"]


def row_of(name: str, bench: Bench, times: list[tuple[float, float]]) -> dict[str, Any]:
    model = bench.model
    wall, used = zip(*times, strict=True)
    step = statistics.median(wall)
    return {
        "scene": name,
        "particles": model.particles.count,
        "window": bench.window,
        "ms_per_step": step,
        "cpu_ms_per_step": statistics.median(used),
        "spread": (max(wall) - min(wall)) / step,
        "rebuild_ms": bench.rebuild_ms,
        "stages": [task.name for task in model.stepper.step_tasks],
        "arrays": list(model.particles.arrays),
        "bytes_per_particle": model.particles.memory() / model.particles.count,
    }


def measure(device: str, threads: int, particles: int, rounds: int, window: int) -> dict[str, Any]:
    """Measure all scenes in turns; return their rows, from the full scene to the hand-written step, and the comparison."""
    benches = {name: Bench(data, device, threads, window) for name, data in scenes(max(8, round(particles**0.5))).items()}
    lean = benches["leanest"]
    hand = HandStep(lean.model)
    check = compare(lean, hand)
    runs = {"package": lean.package, "hand": hand.run}
    for run in runs.values():
        lean.ms_per_step(run)
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in benches if name != "leanest"}
    pair: dict[str, list[tuple[float, float]]] = {name: [] for name in runs}
    for turn in range(rounds):
        for name in times:
            times[name].append(benches[name].ms_per_step(benches[name].package))
        for repeat in range(PAIRS):
            for name in list(runs)[:: 1 if (turn + repeat) % 2 else -1]:
                pair[name].append(lean.ms_per_step(runs[name]))
    rows = [row_of(name, benches[name], found) for name, found in [*times.items(), ("leanest", pair["package"])]]
    own = row_of("leanest by hand", lean, pair["hand"])
    fields = [lean.model.particles.arrays[name] for name in sorted(hand.arrays)]
    own.update(
        stages=["hand_kick_drift", "hand_continuity", "hand_momentum", "advance"],
        arrays=sorted(hand.arrays),
        bytes_per_particle=sum(int(array.capacity) for array in fields) / lean.model.particles.count,
    )
    ratios = [a / b for (a, _), (b, _) in zip(pair["package"], pair["hand"], strict=True)]
    return {
        "device": lean.model.device.name if not lean.model.launcher.is_cpu else "cpu",
        "threads": lean.model.launcher.threads,
        "rows": [*rows, own],
        "ratio": rows[-1]["ms_per_step"] / own["ms_per_step"],
        "ratio_cpu": rows[-1]["cpu_ms_per_step"] / own["cpu_ms_per_step"] if own["cpu_ms_per_step"] > 0 else 1.0,
        "ratio_of_fastest": min(pair["package"])[0] / min(pair["hand"])[0],
        "ratio_quartiles": [float(q) for q in np.percentile(ratios, [25, 50, 75])],
        "check": check,
    }


def table(found: dict[str, Any]) -> str:
    """Return the text of a measurement."""
    full = found["rows"][0]["cpu_ms_per_step" if found["device"] == "cpu" else "ms_per_step"]
    lines = [
        f"{found['device']}, {found['threads']} thread(s); pure steps between list builds",
        f"{'scene':16} {'particles':>9} {'ms/step':>8} {'+-%':>4} {'CPU ms':>7} {'of full':>7} {'us/part.':>8} "
        f"{'stages':>6} {'arrays':>6} {'B/part.':>7} {'list build ms':>13}",
    ]
    for row in found["rows"]:
        spent = row["cpu_ms_per_step" if found["device"] == "cpu" else "ms_per_step"]
        lines.append(
            f"{row['scene']:16} {row['particles']:9d} {row['ms_per_step']:8.3f} {100 * row['spread']:4.0f} "
            f"{row['cpu_ms_per_step']:7.3f} {spent / full:7.2f} {1e3 * spent / row['particles']:8.4f} "
            f"{len(row['stages']):6d} {len(row['arrays']):6d} {row['bytes_per_particle']:7.0f} {row['rebuild_ms']:13.2f}"
        )
    check = found["check"]
    apart = ", ".join(f"{name} {value:.1f}" for name, value in check["roundings"].items())
    same = "bit-identical" if check["identical"] else f"apart by roundings: {apart}"
    low, middle, high = found["ratio_quartiles"]
    lines += [
        f"package and hand after {check['steps']} steps: {same}" + ("" if agrees(check) else "  NOT THE SAME"),
        f"leanest, package over hand: {found['ratio']:.3f} of the medians ({found['ratio_cpu']:.3f} in processor time, "
        f"{found['ratio_of_fastest']:.3f} of the fastest, quartiles of the pairs {low:.3f} {middle:.3f} {high:.3f}); "
        f"target {TARGET}: {'met' if found['ratio'] <= TARGET else 'MISSED'}",
    ]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, nargs="+", default=[1], help="of a CPU device")
    parser.add_argument("--particles", type=int, default=10_000, help="fluid particles, about")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--window", type=int, default=40, help="steps in a measurement, fewer if the list does not last")
    parser.add_argument("--json", type=Path, help="write what was measured to a file")
    given = parser.parse_args(arguments)
    quiet_warp()
    found = []
    for threads in given.threads if wp.get_device(given.device).is_cpu else [1]:
        found.append(measure(given.device, threads, given.particles, given.rounds, given.window))
        print(table(found[-1]) + "\n", flush=True)
    if given.json:
        given.json.write_text(json.dumps({**provenance(), "rows": found}, indent=1) + "\n", encoding="utf-8")
    return 0 if all(agrees(one["check"]) for one in found) else 1


if __name__ == "__main__":
    np.seterr(all="ignore")
    sys.exit(main())
