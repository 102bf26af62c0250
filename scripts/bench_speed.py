"""Speed of whole runs: particles, neighbours, ms a step, million particle-steps a second, shares, distance to the floor.

    python scripts/bench_speed.py [--device cpu|cuda:0] [--threads 1 2] [--precision float32 float64] [--only NAME ...]
                                  [--seconds 2] [--peers] [--json FILE]

Scenes (the large ones on a GPU alone): Taylor-Green 2-D at 10 k, 100 k, 1 M, 4 M particles, once as the lean scene that
other codes are measured with (conservative gradient, Wendland C2, h = 1.25 dx) and once with the defaults, of the Riemann
scheme and to 1 M of delta-plus-SPH; a cylinder in a stream with the latter; a periodic
3-D box at 125 k, 1 M, 8 M, 32 M (25 GB, with the defaults 35 GB); the layered tank; the square droplet.

The floor is the least that two sweeps must read: the list (4 B an entry) and each particle's position, velocity,
pressure and volume once for each sweep, over the copy bandwidth of the device measured in the same run.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.study.provenance import provenance

PEERS = [
    # code, case, particles, Mups on 1 thread, on 2 threads (x86-64, 2 cores, float64)
    ("PySPH wcsph", "Taylor-Green", 10_000, 0.58, 0.73),
    ("PySPH tvf", "Taylor-Green", 10_000, 0.45, 0.69),
    ("PySPH edac", "Taylor-Green", 10_000, 0.38, 0.59),
    ("SPHinXsys (Riemann, dual time step)", "Taylor-Green", 10_000, 2.59, 4.89),
    ("DualSPHysics 5.4", "dam break 2-D", 82_001, 2.29, 4.27),
    ("PySPH morris (CSF, quintic)", "square droplet", 6_400, 0.154, 0.221),
]


def taylor_green(n: int, lean: bool) -> dict[str, Any]:
    """Taylor-Green vortex, Re = 100, with n x n particles."""
    numerics: dict[str, Any] = {}
    if lean:
        numerics = {"pressure_gradient": "conservative", "smoothing_ratio": 1.25}
    return {
        "dimension": 2,
        "particle_spacing": 1.0 / n,
        "end_time": 1.0e3,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
        "phases": {"fluid": {"density": 1.0, "viscosity": 0.01, "sound_speed": 10.0, "gamma": 7}},
        "fluids": [{"phase": "fluid", "shape": "rest"}],
        "start": {"noise": 0.2, "velocity": ["-cos(2*pi*x)*sin(2*pi*y)", "sin(2*pi*x)*cos(2*pi*y)"]},
        "numerics": numerics,
        "output": {"particles": "none", "checkpoint": "none"},
    }


def delta_plus(n: int) -> dict[str, Any]:
    """The same vortex with delta-plus-SPH and its defaults, h = 2 dx."""
    return {**taylor_green(n, False), "numerics": {"scheme": "delta_plus"}}


def stream(spacings: int) -> dict[str, Any]:
    """The cylinder in a stream of the case: a body with friction, an inlet, an outlet and sponges, with delta-plus-SPH."""
    from warpsph.case.case_file import load_case

    case = load_case(Path(__file__).parents[1] / "cases" / "cylinder_periodic.yaml")
    narrow = {"domain.lower": [-8, -10], "domain.upper": [16, 10]}
    data = case.replace({"particle_spacing": 1 / spacings, **narrow}).to_dict()
    return {key: value for key, value in data.items() if key not in ("reference", "validation", "gauges")}


def box(n: int) -> dict[str, Any]:
    """Periodic 3-D box with a Taylor-Green-like flow, n^3 particles, h = 1.3 dx, lean."""
    data = taylor_green(n, True)
    data["dimension"] = 3
    sides = {axis: "periodic" for axis in "xyz"}
    data["domain"] = {"lower": [0, 0, 0], "upper": [1, 1, 1], "boundary": sides}
    data["start"]["velocity"] = [
        "sin(2*pi*x)*cos(2*pi*y)*cos(2*pi*z)",
        "-cos(2*pi*x)*sin(2*pi*y)*cos(2*pi*z)",
        "0",
    ]
    data["numerics"]["smoothing_ratio"] = 1.3
    return data


def layered_tank(n: int) -> dict[str, Any]:
    """Heavy fluid under light fluid, 1000:1, hydrostatic start, n particles across."""
    return {
        "dimension": 2,
        "particle_spacing": 1.0 / n,
        "end_time": 1.0e3,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "gravity": [0, -1.0],
        "phases": {
            "water": {"density": 1000, "viscosity": 1.0},
            "air": {"density": 1, "viscosity": 0.01, "gamma": 1.4},
        },
        "fluids": [
            {"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}},
            {"phase": "air", "shape": "rest"},
        ],
        "start": {"pressure": "hydrostatic"},
        "output": {"particles": "none", "checkpoint": "none"},
    }


def square_droplet(n: int) -> dict[str, Any]:
    """Square droplet, 1000:1, surface tension, n particles across the box."""
    return {
        "dimension": 2,
        "particle_spacing": 2.0 / n,
        "end_time": 1.0e3,
        "domain": {"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "phases": {
            "gas": {"density": 1.0, "viscosity": 0.005, "gamma": 1.4},
            "liquid": {"density": 1000, "viscosity": 0.5},
        },
        "surface_tension": [{"between": ["gas", "liquid"], "coefficient": 1.0}],
        "fluids": [
            {"phase": "gas", "shape": {"box": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5]}}},
            {"phase": "liquid", "shape": "rest"},
        ],
        "output": {"particles": "none", "checkpoint": "none"},
    }


SCENES: dict[str, tuple[Any, bool]] = {
    # name -> (case, needs a GPU)
    "taylor_green 10k lean": (lambda: taylor_green(100, True), False),
    "taylor_green 10k": (lambda: taylor_green(100, False), False),
    "taylor_green 100k lean": (lambda: taylor_green(316, True), False),
    "taylor_green 100k": (lambda: taylor_green(316, False), False),
    "taylor_green 1M lean": (lambda: taylor_green(1000, True), True),
    "taylor_green 1M": (lambda: taylor_green(1000, False), True),
    "taylor_green 4M lean": (lambda: taylor_green(2000, True), True),
    "taylor_green 4M": (lambda: taylor_green(2000, False), True),
    "delta_plus 10k": (lambda: delta_plus(100), False),
    "delta_plus 100k": (lambda: delta_plus(316), False),
    "delta_plus 1M": (lambda: delta_plus(1000), True),
    "stream 100k": (lambda: stream(14), False),
    "stream 1M": (lambda: stream(46), True),
    "box 125k": (lambda: box(50), False),
    "box 1M": (lambda: box(100), True),
    "box 8M": (lambda: box(200), True),
    "box 32M": (lambda: box(318), True),
    "box 32M default": (lambda: {**box(318), "numerics": {}}, True),
    "layered_tank 10k": (lambda: layered_tank(100), False),
    "layered_tank 1M": (lambda: layered_tank(1000), True),
    "square_droplet 10k": (lambda: square_droplet(100), False),
    "square_droplet 1M": (lambda: square_droplet(1000), True),
}


def copy_bandwidth(device: Any, megabytes: int) -> float:
    """Return the copy bandwidth of a device in B/s, bytes read plus bytes written."""
    import warp as wp

    n = megabytes * 250_000
    source, target = wp.ones(n, dtype=wp.float32, device=device), wp.empty(n, dtype=wp.float32, device=device)
    wp.copy(target, source)
    times = []
    for _ in range(7):
        wp.synchronize_device(device)
        begin = time.perf_counter()
        wp.copy(target, source)
        wp.synchronize_device(device)
        times.append(time.perf_counter() - begin)
    return 8.0 * n / statistics.median(times)


def measure(name: str, device: str, threads: int, precision: str, seconds: float, bandwidth: float) -> dict[str, Any]:
    """Run one scene: warm up, then at least five portions of equal step count; medians."""
    import warp as wp

    from warpsph.case.case import Case
    from warpsph.kernels.core import clock as ck
    from warpsph.running.model import Model

    data = SCENES[name][0]()
    data["precision"] = precision
    begin = time.perf_counter()
    model = Model(Case.from_dict(data), device=device, threads=threads)
    stepper = model.stepper
    stepper.prepare(fresh=True)
    stepper.run(1.0e3, 20)
    wp.synchronize_device(model.device)
    setup = time.perf_counter() - begin
    begin = time.perf_counter()
    stepper.run(1.0e3, 20)
    took = max(time.perf_counter() - begin, 1e-6)
    portion = max(20, int(20 * seconds / 5 / took))
    times = []
    for task in [*stepper.step_tasks, *stepper.list.tasks, *stepper.list.check_tasks]:
        task.seconds = 0.0
    before = stepper.read()[1].copy()
    for _ in range(5):
        begin = time.perf_counter()
        stepper.run(1.0e3, portion)
        stepper.read()
        times.append((time.perf_counter() - begin) / portion)
    _, counters = stepper.read()
    if counters[ck.FAULT]:
        raise RuntimeError(f"{name}: the run diverged")
    rebuilds = int(counters[ck.REBUILDS] - before[ck.REBUILDS])
    checks = int(counters[ck.CHECKS] - before[ck.CHECKS])
    n = model.particles.count
    nf = model.particles.fluid_count
    listed = model.particles.get("fluid_neighbours")[:nf].astype(float).mean()
    if model.particles.wall_count:
        listed += model.particles.get("wall_neighbours").astype(float).mean()
    step = statistics.median(times)
    size = 8 if precision == "float64" else 4
    floor = nf * 2 * (4 * listed + size * (2 * model.physics.spec.dimension + 2)) / bandwidth
    shares: dict[str, float] = {}
    if not model.launcher.is_cpu:
        profile_cuda(model, rebuilds / (5 * portion), checks / (5 * portion))
    tasks = stepper.step_tasks
    total = sum(task.seconds for task in [*tasks, *stepper.list.tasks, *stepper.list.check_tasks]) or 1.0
    for task in tasks:
        shares[task.name] = shares.get(task.name, 0.0) + task.seconds / total
    shares["neighbour list"] = sum(task.seconds for task in [*stepper.list.tasks, *stepper.list.check_tasks]) / total
    return {
        "scene": name, "device": model.device.name if not model.launcher.is_cpu else "cpu",
        "threads": model.launcher.threads, "precision": precision, "particles": n, "neighbours": listed,
        "sweeps": 2, "ms_per_step": step * 1e3, "spread": (max(times) - min(times)) / step,
        "mups": n / step / 1e6, "steps_per_rebuild": 5 * portion / max(rebuilds, 1),
        "floor_ratio": step / floor, "bytes_per_particle": (model.particles.memory() + stepper.list.memory_beside()) / n,
        "setup_seconds": setup, "shares": shares,
    }  # fmt: skip


def profile_cuda(model: Any, rebuilds: float, checks: float) -> None:
    """Time each task alone, outside the captured graph; `rebuilds` and `checks` are how often a step needs one."""
    import warp as wp

    stepper = model.stepper
    for tasks, weight in ((stepper.step_tasks, 1.0), (stepper.list.check_tasks, checks), (stepper.list.tasks, rebuilds)):
        for _ in range(5):
            for task in tasks:
                wp.synchronize_device(model.device)
                begin = time.perf_counter()
                task.run()
                wp.synchronize_device(model.device)
                task.seconds += (time.perf_counter() - begin) * weight / 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--precision", nargs="+", default=["float32"], choices=["float32", "float64"])
    parser.add_argument("--only", nargs="+", default=[], help="scenes whose name starts with one of these")
    parser.add_argument("--seconds", type=float, default=2.0, help="measured time a scene")
    parser.add_argument("--peers", action="store_true", help="also print published and measured rates of other codes")
    parser.add_argument("--json", type=Path, help="write the rows to a file")
    arguments = parser.parse_args()

    import warp as wp

    from warpsph.running.model import quiet_warp

    quiet_warp()
    device = wp.get_device(arguments.device)
    bandwidth = copy_bandwidth(device, 256 if device.is_cpu else 2000)
    print(f"copy bandwidth {bandwidth / 1e9:.0f} GB/s")
    head = f"{'scene':24} {'prec':7} {'thr':>3} {'particles':>9} {'nb':>5} {'ms/step':>8} {'+-%':>4} {'Mups':>8} "
    print(head + f"{'st/reb':>6} {'x floor':>7} {'B/part':>6}  shares")
    rows = []
    for name, (_, needs_gpu) in SCENES.items():
        if arguments.only and not any(name.startswith(prefix) for prefix in arguments.only):
            continue
        if needs_gpu and device.is_cpu:
            continue
        for precision in arguments.precision:
            for threads in arguments.threads if device.is_cpu else [1]:
                row = measure(name, arguments.device, threads, precision, arguments.seconds, bandwidth)
                rows.append(row)
                top = sorted(row["shares"].items(), key=lambda item: -item[1])[:5]
                print(
                    f"{name:24} {precision:7} {row['threads']:3d} {row['particles']:9d} {row['neighbours']:5.1f} "
                    f"{row['ms_per_step']:8.3f} {100 * row['spread']:4.0f} {row['mups']:8.2f} "
                    f"{row['steps_per_rebuild']:6.1f} {row['floor_ratio']:7.1f} {row['bytes_per_particle']:6.0f}  "
                    + " ".join(f"{key} {100 * value:.0f}%" for key, value in top),
                    flush=True,
                )
    if arguments.peers:
        print("\nother codes on such a machine (2 cores), million particle-steps a second on 1 and 2 threads:")
        for code, case, particles, one, two in PEERS:
            print(f"  {code:38} {case:16} {particles:7d} {one:6.2f} {two:6.2f}")
    if arguments.json:
        record = {**provenance(), "bandwidth": bandwidth, "rows": rows}
        arguments.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
