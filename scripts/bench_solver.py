"""Pressure solves: iterations and time against the number of unknowns, for each solver, on the same matrices.

    python scripts/bench_solver.py [--device cpu|cuda:0] [--threads 2] [--dimension 2] [--sizes 10000 40000 ...]
                                   [--shapes free closed ...] [--precision float32] [--tolerance 1e-6] [--only multigrid ...]
                                   [--json FILE]

Systems: particles of a lattice jittered by 0.25 dx, Wendland C2 with h = 1.25 dx (`--kernel cubic`: cubic spline, h = 1.5
dx), symmetric weights w_ab = -2 V (x_ab . grad W) / (r^2 + 0.01 h^2), right-hand side a cosine and noise. Shapes:

* free: a square or cube in the open; surface particles (low divergence of position) have pressure 0 and are taken out
* closed: a box, its walls mirror images; the system is singular
* periodic: the same without walls
* drops: many separate drops; film: a closed ring (shell) six particles thick

Solvers: conjugate gradients with each preconditioner, BiCGSTAB with the diagonal, and as peers `warp.optim.linear.cg`,
`scipy.sparse.linalg.cg` (diagonal preconditioner, float64) and pyamg's smoothed aggregation, where they can be imported.

`residual` is that of the solution a solver holds: the own solvers sum it up in float64, Warp's keeps x in the precision of
the matrix, whose rounding shows in single precision. Time is the median of several solves from x = 0. `set-up` is the part
of it that comes before the first residual: the whole multigrid hierarchy. scipy and pyamg run on one core; on a machine with
other work OMP_NUM_THREADS=1 keeps the dot products of NumPy from waiting for each other.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.study.provenance import provenance

KERNELS = {"wendland": 1.25, "cubic": 1.5}  # smoothing length in particle spacings; both reach to 2 h
# Position divergence below which a particle is of the free surface, as share of its value in a full lattice.
SURFACE = {2: 0.77, 3: 0.8}


@dataclass
class System:
    """A pressure system in compressed rows, spacing 1.

    Attributes:
        position: (n, d) of the unknowns.
        diagonal: (n,).
        pointers, columns, values: entries beside the diagonal, (n + 1,), (entries,), (entries,).
        moment: (n, d, d), see `warpsph.solvers.multigrid`.
        lower, upper, periodic: box of the grid.
        singular: the constant is a null vector.
        rhs: (n,).
    """

    position: np.ndarray
    diagonal: np.ndarray
    pointers: np.ndarray
    columns: np.ndarray
    values: np.ndarray
    moment: np.ndarray
    lower: list[float]
    upper: list[float]
    periodic: list[bool]
    singular: bool
    rhs: np.ndarray

    def matrix(self) -> Any:
        """Return the matrix as scipy CSR."""
        from scipy import sparse

        n = len(self.diagonal)
        return (
            sparse.csr_matrix((self.values, self.columns, self.pointers), shape=(n, n)) + sparse.diags(self.diagonal)
        ).tocsr()


def slope(kernel: str, r: np.ndarray, h: float) -> np.ndarray:
    """Return -(dW/dr) / r up to a constant."""
    q = r / h
    if kernel == "wendland":
        return np.maximum(1.0 - 0.5 * q, 0.0) ** 3
    return np.where(q < 1.0, 3.0 - 2.25 * q, 0.75 * np.maximum(2.0 - q, 0.0) ** 2 / np.maximum(q, 1e-9))


def shape_points(shape: str, dimension: int, size: int) -> tuple[np.ndarray, float]:
    """Return lattice points of about `size` particles, and the side of the box."""
    fill = {"free": 1.0, "closed": 1.0, "periodic": 1.0}
    if shape == "drops":
        fill["drops"] = {2: math.pi * 0.42**2, 3: 4.0 / 3.0 * math.pi * 0.42**3}[dimension]
    if shape == "film":
        # perimeter or surface of the ball, times six
        side = size / (6.0 * math.pi) if dimension == 2 else math.sqrt(size / (6.0 * math.pi))
        count = max(16, round(side))
    else:
        count = max(6, round((size / fill[shape]) ** (1.0 / dimension)))
    axes = [np.arange(count) + 0.5] * dimension
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dimension)
    if shape == "film":
        r = np.sqrt(((x - 0.5 * count) ** 2).sum(axis=1))
        x = x[(r < 0.5 * count) & (r > 0.5 * count - 6.0)]
    if shape == "drops":
        width = count / max(1, round(count / {2: 30, 3: 16}[dimension]))
        x = x[(((x % width) - 0.5 * width) ** 2).sum(axis=1) < (0.42 * width) ** 2]
    return x, float(count)


def make_system(
    shape: str, dimension: int, size: int, jitter: float = 0.25, kernel: str = "wendland", seed: int = 1
) -> System:
    """Return a system of about `size` unknowns; see the top of the file."""
    from scipy.spatial import cKDTree

    random = np.random.default_rng(seed)
    x, side = shape_points(shape, dimension, size)
    x = x + random.uniform(-jitter, jitter, x.shape)
    n = len(x)
    h = KERNELS[kernel]
    reach = 2.0 * h
    points, parent = x, np.arange(n)
    if shape == "closed":
        for axis in range(dimension):
            low, high = points[:, axis] < reach, points[:, axis] > side - reach
            below, above = points[low].copy(), points[high].copy()
            below[:, axis] *= -1.0
            above[:, axis] = 2.0 * side - above[:, axis]
            points = np.concatenate([points, below, above])
            parent = np.concatenate([parent, parent[low], parent[high]])
    if shape == "periodic":
        x = points = np.mod(x, side)
        tree = cKDTree(points, boxsize=side)
    else:
        tree = cKDTree(points)
    pairs = tree.query_pairs(reach, output_type="ndarray").astype(np.int32)
    del tree
    i, j = pairs[:, 0], pairs[:, 1]
    i, j = np.concatenate([i, j]), np.concatenate([j, i])
    del pairs
    real = i < n
    i, j = i[real], j[real]
    apart = x[i] - points[j]
    if shape == "periodic":
        apart -= side * np.round(apart / side)
    j = parent[j].astype(np.int32)
    r2 = (apart**2).sum(axis=1)
    strength = slope(kernel, np.sqrt(r2), h)
    weight = strength * r2 / (r2 + 0.01 * h * h)
    diagonal = np.bincount(i, weight, n)
    surface = np.zeros(n, dtype=bool)
    if shape not in ("closed", "periodic"):
        divergence = np.bincount(i, strength * r2, n)
        surface = divergence < SURFACE[dimension] * full_divergence(dimension, kernel)
    inside = ~surface
    keep = inside[i] & inside[j]
    number = np.cumsum(inside) - 1
    i, j, weight, apart = number[i[keep]], number[j[keep]], weight[keep], apart[keep]
    unknowns = int(inside.sum())
    diagonal = diagonal[inside]
    moment = np.empty((unknowns, dimension, dimension))
    for a in range(dimension):
        for b in range(dimension):
            moment[:, a, b] = 0.5 * np.bincount(i, weight * apart[:, a] * apart[:, b], unknowns)
    del apart
    order = np.argsort(i, kind="stable")
    counts = np.bincount(i, minlength=unknowns)
    position = x[inside]
    rhs = np.cos(3.0 * position[:, 0] / side) + 0.3 * random.standard_normal(unknowns)
    periodic = [shape == "periodic"] * dimension
    return System(
        position, np.where(diagonal > 0.0, diagonal, 1.0), np.concatenate([[0], np.cumsum(counts)]), j[order],
        -weight[order], moment, [0.0] * dimension, [side] * dimension, periodic, shape in ("closed", "periodic"), rhs,
    )  # fmt: skip


def full_divergence(dimension: int, kernel: str) -> float:
    """Return what a particle of a full lattice has as sum of slope r^2."""
    h = KERNELS[kernel]
    k = math.ceil(2.0 * h)
    axes = [np.arange(-k, k + 1)] * dimension
    r2 = (np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dimension) ** 2).sum(axis=1).astype(float)
    r2 = r2[(r2 > 0) & (r2 < 4.0 * h * h)]
    return float((slope(kernel, np.sqrt(r2), h) * r2).sum())


def build(system: System, launcher: Any, precision: str) -> tuple[Any, Any]:
    """Return (matrix, multigrid) of a system on the device of a launcher."""
    from warpsph.solvers.linear_solver import EllMatrix
    from warpsph.solvers.multigrid import Multigrid

    n, dimension = system.position.shape
    matrix = EllMatrix(n, int(np.diff(system.pointers).max(initial=1)), launcher, precision)
    matrix.fill(system.diagonal, system.pointers, system.columns, system.values)
    multigrid = Multigrid(
        matrix, launcher, dimension, precision, matrix.row_list, system.lower, system.upper, 1.0, system.periodic
    )
    multigrid.position.assign(system.position.astype(precision))
    multigrid.moment.assign(system.moment.astype(precision))
    return matrix, multigrid


def timed(action: Callable[[], Any], repeat: int) -> tuple[float, Any]:
    """Return (median seconds of several calls, result of the last); `action` waits for the device itself."""
    times, result = [], None
    for _ in range(repeat):
        begin = time.perf_counter()
        result = action()
        times.append(time.perf_counter() - begin)
        if sum(times) > 20.0:
            break
    return statistics.median(times), result


def own_solver(
    system: System, name: str, device: str, threads: int, precision: str, tolerance: float, repeat: int
) -> dict[str, Any]:
    """Measure a solver of warpsph; `name` is method-preconditioner."""
    import warp as wp

    from warpsph.engine.launch import Launcher
    from warpsph.solvers.linear_solver import LinearSolver

    launcher = Launcher(wp.get_device(device), threads)
    matrix, multigrid = build(system, launcher, precision)
    method, preconditioner = name.split("-")
    solver = LinearSolver(
        matrix, launcher, method, multigrid if preconditioner == "multigrid" else preconditioner, tolerance,
        singular=system.singular,
    )  # fmt: skip
    rhs = wp.array(system.rhs, dtype=matrix.real, device=launcher.device)
    x = wp.zeros(matrix.n, dtype=matrix.real, device=launcher.device)

    def solve() -> Any:
        x.zero_()
        return solver.solve(rhs, x)

    solve()
    seconds, result = timed(solve, repeat)

    if launcher.is_cpu:

        def begin() -> None:
            for task in solver.begin_tasks:
                task.run()

    else:
        with wp.ScopedCapture(device=launcher.device) as capture:
            for task in solver.begin_tasks:
                task.run()

        def begin() -> None:
            wp.capture_launch(capture.graph)
            wp.synchronize_device(launcher.device)

        begin()
    setup, _ = timed(begin, repeat)
    memory = matrix.memory() + solver.memory() + (multigrid.memory() if preconditioner == "multigrid" else 0)
    launcher.team.close()
    return {
        "iterations": result.iterations, "residual": result.residual, "reason": result.reason, "seconds": seconds,
        "setup_seconds": setup, "restarts": result.restarts, "bytes_per_row": memory / matrix.n,
    }  # fmt: skip


def warp_peer(system: System, device: str, precision: str, tolerance: float, repeat: int) -> dict[str, Any]:
    """Measure `warp.optim.linear.cg` with its diagonal preconditioner."""
    import warp as wp
    from warp.optim.linear import cg, preconditioner

    n = len(system.diagonal)
    real = {"float32": wp.float32, "float64": wp.float64}[precision]
    rows = np.repeat(np.arange(n), np.diff(system.pointers))
    every = np.arange(n)
    block = wp.sparse.bsr_zeros(n, n, block_type=real, device=device)
    wp.sparse.bsr_set_from_triplets(
        block,
        wp.array(np.concatenate([rows, every]), dtype=int, device=device),
        wp.array(np.concatenate([system.columns, every]), dtype=int, device=device),
        wp.array(np.concatenate([system.values, system.diagonal]), dtype=real, device=device),
    )
    b = system.rhs - (system.rhs.mean() if system.singular else 0.0)
    rhs = wp.array(b, dtype=real, device=device)
    x = wp.zeros(n, dtype=real, device=device)
    diagonal = preconditioner(block, "diag")

    def solve() -> Any:
        x.zero_()
        found = cg(block, rhs, x, tol=tolerance, maxiter=max(500, 10 * math.isqrt(n)), M=diagonal, check_every=10)
        wp.synchronize_device(device)
        return found

    cpu = wp.get_device(device).is_cpu
    if not cpu:
        solve()
    # on a CPU its dot products take many times as long as the rest
    seconds, found = timed(solve, 1 if cpu else min(repeat, 3))
    iterations = int(found[0])
    rest = np.linalg.norm(b - system.matrix() @ x.numpy().astype(float)) / np.linalg.norm(b)
    return {"iterations": iterations, "residual": float(rest), "reason": "", "seconds": seconds}


def scipy_peer(system: System, tolerance: float, repeat: int) -> dict[str, Any]:
    """Measure `scipy.sparse.linalg.cg`, float64, diagonal preconditioner."""
    from scipy import sparse
    from scipy.sparse.linalg import cg

    matrix = system.matrix()
    b = system.rhs - (system.rhs.mean() if system.singular else 0.0)
    scale = sparse.diags(1.0 / matrix.diagonal())
    count = [0]

    def solve() -> Any:
        count[0] = 0

        def step(_: Any) -> None:
            count[0] += 1

        return cg(matrix, b, rtol=tolerance, maxiter=20000, M=scale, callback=step)[0]

    seconds, x = timed(solve, min(repeat, 3))
    rest = np.linalg.norm(b - matrix @ x) / np.linalg.norm(b)
    return {"iterations": count[0], "residual": float(rest), "reason": "", "seconds": seconds}


def pyamg_peer(system: System, tolerance: float, repeat: int) -> dict[str, Any]:
    """Measure pyamg's smoothed aggregation with conjugate gradients, float64."""
    import pyamg

    matrix = system.matrix()
    b = system.rhs - (system.rhs.mean() if system.singular else 0.0)
    history: list[float] = []
    setups: list[float] = []
    # its default takes the null vector of a singular coarse matrix for a regular one, and the solve breaks down
    coarse = ("pinv", {"rtol": 1e-8}) if system.singular else "pinv"

    def solve() -> Any:
        history.clear()
        begin = time.perf_counter()
        hierarchy = pyamg.smoothed_aggregation_solver(matrix, coarse_solver=coarse)
        setups.append(time.perf_counter() - begin)
        return hierarchy.solve(b, tol=tolerance, accel="cg", residuals=history)

    seconds, x = timed(solve, min(repeat, 3))
    rest = np.linalg.norm(b - matrix @ x) / np.linalg.norm(b)
    return {
        "iterations": len(history) - 1, "residual": float(rest), "reason": "", "seconds": seconds,
        "setup_seconds": statistics.median(setups),
    }  # fmt: skip


OWN = ["cg-multigrid", "cg-jacobi", "cg-none", "bicgstab-jacobi"]
PEERS = ["warp cg-diag", "scipy cg-diag", "pyamg"]
DEFAULT_SIZES = {2: [10_000, 40_000, 160_000, 640_000], 3: [10_000, 40_000, 120_000, 1_000_000]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--dimension", type=int, default=2, choices=[2, 3])
    parser.add_argument("--sizes", type=int, nargs="+", default=None)
    parser.add_argument(
        "--shapes", nargs="+", default=["free", "closed"], choices=["free", "closed", "periodic", "drops", "film"]
    )
    parser.add_argument("--kernel", default="wendland", choices=list(KERNELS))
    parser.add_argument("--precision", nargs="+", default=["float32"], choices=["float32", "float64"])
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--jitter", type=float, default=0.25, help="in particle spacings")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--only", nargs="+", default=[], help="solvers whose name holds one of these")
    parser.add_argument("--json", type=Path, help="write the rows to a file")
    arguments = parser.parse_args()

    import warp as wp

    from warpsph.running.model import quiet_warp

    quiet_warp()
    device = wp.get_device(arguments.device)
    try:
        import pyamg  # noqa: F401

        peers = PEERS
    except ImportError:
        peers = PEERS[:-1]
        print("pyamg is not installed, its rows are left out: pip install pyamg")
    names = [name for name in OWN + peers if not arguments.only or any(part in name for part in arguments.only)]
    print(
        f"device {device.name if device.is_cuda else f'cpu, {arguments.threads} threads'}; tolerance {arguments.tolerance:g}"
    )
    print(
        f"{'shape':9} {'unknowns':>9} {'entries':>7} {'prec':7} {'solver':16} {'iter':>5} "
        f"{'residual':>9} {'set-up':>9} {'total':>9}"
    )
    rows = []
    for shape in arguments.shapes:
        for size in arguments.sizes or DEFAULT_SIZES[arguments.dimension]:
            system = make_system(shape, arguments.dimension, size, arguments.jitter, arguments.kernel)
            n = len(system.diagonal)
            for precision in arguments.precision:
                for name in names:
                    if name in OWN:
                        row = own_solver(
                            system,
                            name,
                            arguments.device,
                            arguments.threads,
                            precision,
                            arguments.tolerance,
                            arguments.repeat,
                        )
                    elif name.startswith("warp"):
                        row = warp_peer(system, arguments.device, precision, arguments.tolerance, arguments.repeat)
                    elif precision != arguments.precision[-1]:
                        continue
                    elif name.startswith("scipy"):
                        row = scipy_peer(system, arguments.tolerance, arguments.repeat)
                    else:
                        row = pyamg_peer(system, arguments.tolerance, arguments.repeat)
                    entries = len(system.columns) / n
                    rows.append(
                        {"shape": shape, "dimension": arguments.dimension, "unknowns": n, "entries": entries,
                         "precision": precision, "solver": name, "device": str(device), "threads": arguments.threads, **row}
                    )  # fmt: skip
                    setup = f"{1e3 * row['setup_seconds']:7.2f}ms" if "setup_seconds" in row else ""
                    mark = "" if row["reason"] in ("", "converged") else f"  {row['reason']}"
                    print(
                        f"{shape:9} {n:9d} {entries:7.1f} {precision:7} {name:16} {row['iterations']:5d} "
                        f"{row['residual']:9.1e} "
                        f"{setup:>9} {1e3 * row['seconds']:7.2f}ms{mark}",
                        flush=True,
                    )
    if arguments.json:
        command = "python scripts/bench_solver.py " + " ".join(sys.argv[1:])
        record = {**provenance(), "command": command, "tolerance": arguments.tolerance, "rows": rows}
        arguments.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
