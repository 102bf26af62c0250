"""Multigrid: levels, operators against their equations, the cycle as a symmetric contraction, bounded iterations."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpsph.engine.launch import Bindings, Launcher
from warpsph.errors import CapacityError
from warpsph.kernels.linear.levels import COLLAPSE, HALVE, MOST_SWEEPS, STAY
from warpsph.running.model import quiet_warp
from warpsph.solvers.linear_solver import LinearSolver
from warpsph.solvers.multigrid import WIDE, Multigrid, periodic_cells, plan_levels, sweep_weights

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "bench_solver.py"
quiet_warp()


@pytest.fixture(scope="module")
def bench():
    spec = importlib.util.spec_from_file_location("bench_solver", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules["bench_solver"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["bench_solver"]


class Cycle:
    """The preconditioner of a system as a function of NumPy vectors."""

    def __init__(self, bench, system, precision="float64", device="cpu", threads=1, method="cg", **keywords):
        self.system = system
        launcher = Launcher(wp.get_device(device), threads)
        self.matrix, self.multigrid = bench.build(system, launcher, precision)
        for name, value in keywords.items():
            setattr(self.multigrid, name, value)
        self.solver = LinearSolver(self.matrix, launcher, method, self.multigrid, singular=system.singular)
        self.rhs = wp.array(system.rhs, dtype=self.matrix.real, device=device)
        self.x = wp.zeros(self.matrix.n, dtype=self.matrix.real, device=device)
        self.solver.bind(self.rhs, self.x)
        for task in self.solver.begin_tasks:
            task.run()
        arrays = {"sums": self.solver._sums, "solve_state": self.solver.state}
        rows = self.solver.rows
        bindings = Bindings(self.matrix.device, {**self.matrix.bindings(), **arrays})
        bindings.update(chunk=rows.chunk, block_count=rows.block_count)
        self.source, self.target = wp.zeros_like(self.x), wp.zeros_like(self.x)
        self.tasks = self.multigrid.tasks(rows, bindings, self.source, self.target)

    def __call__(self, r):
        real = self.matrix.precision
        self.source.assign(r.astype(real))
        self.target.assign((self.multigrid.weight * r / self.system.diagonal).astype(real))
        for task in self.tasks:
            task.run()
        return self.target.numpy().astype(float)

    def dense(self):
        return np.stack([self(unit) for unit in np.eye(self.matrix.n)], axis=1)

    def solve(self):
        self.x.zero_()
        return self.solver.solve(self.rhs, self.x)


# levels ----------------------------------------------------------------------------------------------------------------


def test_levels_halve_down_to_a_few_nodes():
    plans = plan_levels((100, 37), (False, False))
    assert [plan.cells for plan in plans] == [(100, 37), (50, 19), (25, 10), (13, 5), (7, 3)] + [(4, 2)][: len(plans) - 5]
    assert math.prod(plans[-1].nodes) <= 32
    assert all(way == STAY for way in plans[-1].way)


def test_a_long_channel_is_coarsened_along_its_length():
    plans = plan_levels((4096, 5), (False, False))
    assert math.prod(plans[-1].nodes) <= 30
    shapes = [(plan.cells, plan.wrap) for plan in plans]
    assert ((512, 1), (False, False)) in shapes and ((256, 1), (False, True)) in shapes
    collapse = plans[shapes.index(((512, 1), (False, False)))]
    assert collapse.way == (HALVE, COLLAPSE)


@pytest.mark.parametrize("extent", [3.0, 7.0, 40.0, 100.0, 111.0, 1000.0])
def test_periodic_axes_halve_evenly(extent):
    cells = periodic_cells(extent, 2.0)
    assert 1 / 1.5 < (extent / cells) / 2.0 < 1.5 or extent < 4.5
    plans = plan_levels((cells, cells), (True, True))
    for plan, coarse in zip(plans, plans[1:], strict=False):
        assert coarse.cells == tuple(c // 2 if w == HALVE else 1 for c, w in zip(plan.cells, plan.way, strict=True))
        assert all(way != HALVE or c % 2 == 0 for c, way in zip(plan.cells, plan.way, strict=True))


# operators ---------------------------------------------------------------------------------------------------------------


def hats(f, inverse):
    """Return values (n, 2^d) and gradients (n, 2^d, d) of the corner functions at places f (n, d) of a cell."""
    n, dimension = f.shape
    value, gradient = np.ones((n, 2**dimension)), np.ones((n, 2**dimension, dimension))
    for corner in range(2**dimension):
        for axis in range(dimension):
            up = corner >> axis & 1
            factor = f[:, axis] if up else 1 - f[:, axis]
            value[:, corner] *= factor
            for other in range(dimension):
                gradient[:, corner, other] *= (1 if up else -1) * inverse[axis] if other == axis else factor
    return value, gradient


def operator_of(system, plan, fine_operator=None, cell=2.0):
    """Return (interpolation from the nodes, operator) of the finest grid as dense matrices, from the equations alone."""
    position = system.position
    n, dimension = position.shape
    extent = np.array(system.upper) - np.array(system.lower)
    inverse = np.array([c / e if w else 1 / cell for c, e, w in zip(plan.cells, extent, plan.wrap, strict=True)])
    s = (position - np.array(system.lower)) * inverse
    at = np.floor(s).astype(int)
    for axis in range(dimension):
        if not plan.wrap[axis]:
            at[:, axis] = np.clip(at[:, axis], 0, plan.cells[axis] - 1)
    f = np.clip(s - at, 0, 1)
    value, gradient = hats(f, inverse)
    nodes = plan.nodes
    count = math.prod(nodes)
    index = np.zeros((n, 2**dimension), dtype=int)
    for corner in range(2**dimension):
        stride = 1
        for axis in range(dimension):
            index[:, corner] += (at[:, axis] + (corner >> axis & 1)) % (nodes[axis] if plan.wrap[axis] else 10**9) * stride
            stride *= nodes[axis]
    interpolation = np.zeros((n, count))
    for corner in range(2**dimension):
        np.add.at(interpolation, (np.arange(n), index[:, corner]), value[:, corner])
    excess = system.diagonal + np.add.reduceat(np.append(system.values, 0.0), system.pointers[:-1])
    local = np.einsum("nka,nab,nlb->nkl", gradient, system.moment, gradient)
    local += excess[:, None, None] * value[:, :, None] * value[:, None, :]
    operator = np.zeros((count, count))
    for k in range(2**dimension):
        for m in range(2**dimension):
            np.add.at(operator, (index[:, k], index[:, m]), local[:, k, m])
    return interpolation, operator


def grid_interpolation(fine, coarse):
    """Return the dense interpolation between the nodes of two levels."""
    result = np.eye(1)
    for axis in range(len(fine.cells)):
        nf, nc = fine.nodes[axis], coarse.nodes[axis]
        part = np.zeros((nf, nc))
        for i in range(nf):
            if fine.way[axis] == HALVE:
                part[i, i // 2] += 0.5
                part[i, (i + 1) // 2 % nc if coarse.wrap[axis] else (i + 1) // 2] += 0.5
            elif fine.way[axis] == STAY:
                part[i, i] = 1.0
            else:
                part[i, 0] = 1.0
        result = np.kron(part, result)
    return result


def stencil_matrix(multigrid, k):
    """Return the operator of a level as the device holds it, dense."""
    level, plan = multigrid._levels[k], multigrid.plans[k]
    dimension, size = multigrid.dimension, 3**multigrid.dimension
    raw = multigrid.stencil.numpy()[level.node_base * size :][: level.node_count * size]
    entries = raw.reshape(-1, size) if multigrid.matrix.row_list else raw.reshape(size, -1).T
    nodes = [*plan.nodes, 1][:3]
    result = np.zeros((level.node_count, level.node_count))
    for node in range(level.node_count):
        at = (node % nodes[0], node // nodes[0] % nodes[1], node // (nodes[0] * nodes[1]))
        for slot in range(size):
            if slot == size // 2:
                result[node, node] += entries[node, slot]
                continue
            other = [at[axis] + slot // 3**axis % 3 - 1 if axis < dimension else 0 for axis in range(3)]
            for axis in range(dimension):
                if plan.wrap[axis]:
                    other[axis] %= nodes[axis]
            if all(0 <= o < m for o, m in zip(other, nodes, strict=True)):
                place = (other[2] * nodes[1] + other[1]) * nodes[0] + other[0]
                result[node, place] += entries[node, slot]
                result[node, node] -= entries[node, slot]
            else:
                assert entries[node, slot] == 0.0, "a coupling leaves the grid"
    return result


@pytest.mark.parametrize(
    ("shape", "dimension", "size"),
    [("free", 2, 500), ("closed", 2, 400), ("periodic", 2, 600), ("drops", 2, 900), ("free", 3, 700), ("periodic", 3, 512)],
)
def test_operators_are_those_of_the_equations(bench, shape, dimension, size, device):
    system = bench.make_system(shape, dimension, size)
    cycle = Cycle(bench, system, device=device)
    multigrid = cycle.multigrid
    assert len(multigrid.plans) > 1
    _, operator = operator_of(system, multigrid.plans[0])
    for k, plan in enumerate(multigrid.plans):
        if k > 0:
            link = grid_interpolation(multigrid.plans[k - 1], plan)
            operator = link.T @ operator @ link
        found = stencil_matrix(multigrid, k)
        np.testing.assert_allclose(found, operator, rtol=0, atol=1e-11 * np.abs(operator).max())


@pytest.mark.parametrize("size", [700, 16000])  # the larger one has a level with two pairs of sweeps
def test_a_level_for_each_launch_or_all_in_one_is_the_same(bench, size, device):
    system = bench.make_system("free", 2, size)
    launcher = Launcher(wp.get_device(device))
    matrix, first = bench.build(system, launcher, "float64")
    one_by_one = Multigrid(
        matrix, launcher, 2, "float64", matrix.row_list, system.lower, system.upper, 1.0, system.periodic,
        position=first.position, moment=first.moment, small=0,
    )  # fmt: skip
    if launcher.is_cpu or size == 700:
        assert first.first_small == 0
    assert one_by_one.first_small == len(one_by_one.plans) - 1 > 1
    assert (one_by_one._levels[-2].pairs == 2) is (size == 16000)
    rhs, results = wp.array(system.rhs, dtype=wp.float64, device=device), []
    for multigrid in (first, one_by_one):
        x = wp.zeros(matrix.n, dtype=wp.float64, device=device)
        assert LinearSolver(matrix, launcher, preconditioner=multigrid).solve(rhs, x).converged
        results.append(x.numpy())
    np.testing.assert_allclose(results[0], results[1], rtol=0, atol=1e-11 * np.abs(results[0]).max())


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize(
    ("shape", "dimension", "size"), [("free", 2, 3000), ("closed", 2, 1600), ("periodic", 2, 2304), ("closed", 3, 1000)]
)
def test_the_coarsest_operator_is_inverted(bench, shape, dimension, size, precision, device):
    cycle = Cycle(bench, bench.make_system(shape, dimension, size), precision, device)
    multigrid = cycle.multigrid
    operator = stencil_matrix(multigrid, len(multigrid.plans) - 1)
    m = len(operator)
    assert 3 < m <= 30
    inverse = multigrid._coarsest_inverse.numpy().reshape(m, m).astype(float)
    # in single precision a hundredth at most, in the directions with the smallest eigenvalues
    near = {"float32": 2e-2, "float64": 1e-5}[precision]
    assert np.abs(operator @ inverse @ operator - operator).max() < near * np.abs(operator).max()
    assert np.linalg.eigvalsh(0.5 * (inverse + inverse.T))[0] > -1e-6 * np.abs(inverse).max()


@pytest.mark.parametrize("long", [False, True])
def test_sweeps_contract_whatever_the_operator(long):
    """|(1 - w_1 m) (1 - w_2 m) ...| < 1 for every eigenvalue 0 < m <= 2 of D^-1 A, and small where they aim at."""
    for width in (1, 2, 4, 8, 16, 32, 64, 1024):
        weights = sweep_weights(width, long)
        assert len(weights) % 2 == 0 and len(weights) <= MOST_SWEEPS
        m = np.linspace(1e-3, 2.0, 4000)
        left = np.abs(np.prod([1.0 - w * m for w in weights], axis=0))
        assert left.max() < 1.0
        least = next((least for limit, _, least in WIDE[long] if width >= limit), 0.5)
        assert left[m >= least].max() < 0.37
    assert len(sweep_weights(1, long)) == 2 and len(sweep_weights(4, long)) == (4 if long else 2)
    assert len(sweep_weights(64, long)) == 8


# the cycle ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "dimension", "size", "best"),
    [("free", 2, 900, 0.5), ("closed", 2, 900, 0.5), ("periodic", 2, 900, 0.5), ("drops", 2, 900, 0.5), ("film", 2, 900,
    0.4),
     ("free", 3, 1500, 0.4), ("closed", 3, 1000, 0.4)],
)  # fmt: skip
def test_the_cycle_is_symmetric_and_contracts(bench, shape, dimension, size, best):
    """All eigenvalues of M A near 1, but for the constant of a singular system.

    They may exceed 1 a little, because the operator of the finest grid is no Galerkin product.
    """
    system = bench.make_system(shape, dimension, size)
    inverse = Cycle(bench, system).dense()
    assert np.abs(inverse - inverse.T).max() < 1e-11 * np.abs(inverse).max()
    matrix = system.matrix().toarray()
    values, vectors = np.linalg.eigh(matrix)
    regular = values > 1e-9 * values[-1]
    assert (~regular).sum() == int(system.singular)
    root = vectors[:, regular] * np.sqrt(values[regular])
    spectrum = np.linalg.eigvalsh(root.T @ (0.5 * (inverse + inverse.T)) @ root)
    assert spectrum[0] > 1.0 - best and spectrum[-1] < 1.1


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize(
    ("shape", "dimension", "sizes"),
    [("free", 2, (4000, 40000)), ("closed", 2, (4000, 160000)), ("periodic", 2, (4000, 40000)), ("drops", 2, (20000,)),
     ("film", 2, (5000,)), ("free", 3, (12000,)), ("closed", 3, (12000,))],
)  # fmt: skip
def test_at_most_ten_iterations_at_every_size(bench, shape, dimension, sizes, precision, device):
    for size in sizes:
        system = bench.make_system(shape, dimension, size)
        cycle = Cycle(bench, system, precision, device)
        result = cycle.solve()
        assert result.converged and result.iterations <= 10, f"{shape} {size}"
        b = cycle.rhs.numpy().astype(float)
        if system.singular:
            b -= b.mean()
            assert abs(cycle.solver.solution.numpy().mean()) < 1e-12 * np.abs(cycle.solver.solution.numpy()).max()
        rest = np.linalg.norm(b - system.matrix() @ cycle.solver.solution.numpy()) / np.linalg.norm(b)
        # beside the tolerance: the rounding of the matrix itself
        assert rest < {"float32": 3e-6, "float64": 1.0001e-6}[precision]


def test_cubic_spline_and_strong_disorder(bench):
    for keywords in ({"kernel": "cubic"}, {"jitter": 0.45}):
        result = Cycle(bench, bench.make_system("free", 2, 10000, **keywords)).solve()
        assert result.converged and result.iterations <= 10


def test_bicgstab_takes_it_too(bench, device):
    system = bench.make_system("closed", 2, 3000)
    by_cg, by_bicgstab = (Cycle(bench, system, device=device, method=method) for method in ("cg", "bicgstab"))
    first, second = by_cg.solve(), by_bicgstab.solve()
    assert first.converged and second.converged and second.iterations <= first.iterations
    np.testing.assert_allclose(by_cg.x.numpy(), by_bicgstab.x.numpy(), rtol=0, atol=1e-4 * np.abs(by_cg.x.numpy()).max())


@pytest.mark.parametrize("method", ["cg", "bicgstab"])
def test_rows_out_of_the_system_are_left_alone(bench, method, device):
    """Rows with count 0, wherever their particles lie, change nothing for the others."""
    system = bench.make_system("free", 2, 1500)
    plain = Cycle(bench, system, device=device, method=method)
    expected = plain.solve()
    extra = 40
    places = np.random.default_rng(5).uniform(0, system.upper[0], (extra, 2))
    n = len(system.diagonal)
    more = bench.System(
        np.concatenate([system.position, places]), np.concatenate([system.diagonal, np.ones(extra)]),
        np.concatenate([system.pointers, np.full(extra, system.pointers[-1])]), system.columns, system.values,
        np.concatenate([system.moment, np.zeros((extra, 2, 2))]), system.lower, system.upper, system.periodic, False,
        np.concatenate([system.rhs, np.zeros(extra)]),
    )  # fmt: skip
    cycle = Cycle(bench, more, device=device, method=method)
    result = cycle.solve()
    assert result.iterations == expected.iterations
    np.testing.assert_array_equal(cycle.x.numpy()[n:], 0.0)
    np.testing.assert_allclose(cycle.x.numpy()[:n], plain.x.numpy(), rtol=0, atol=1e-10 * np.abs(plain.x.numpy()).max())


def test_the_result_does_not_depend_on_the_threads(bench):
    system = bench.make_system("closed", 2, 30000)
    found = []
    for threads in (1, 2):
        cycle = Cycle(bench, system, "float32", threads=threads)
        assert cycle.multigrid.first_small > 0 and cycle.solve().converged
        found.append(cycle.x.numpy().copy())
        cycle.multigrid.launcher.team.close()
    np.testing.assert_array_equal(found[0], found[1])


def test_it_follows_the_particles(bench, device):
    """The hierarchy is rebuilt in every solve: positions and matrix of another state, in the same arrays."""
    first, second = (bench.make_system("closed", 2, 2500, seed=seed) for seed in (1, 2))
    cycle = Cycle(bench, first, device=device)
    assert cycle.solve().iterations <= 10
    cycle.matrix.fill(second.diagonal, second.pointers, second.columns, second.values)
    cycle.multigrid.position.assign(second.position)
    cycle.multigrid.moment.assign(second.moment)
    cycle.rhs.assign(second.rhs)
    result = cycle.solve()
    fresh = Cycle(bench, second, device=device).solve()
    assert result.converged and result.iterations == fresh.iterations


def test_a_drop_that_crosses_a_wide_box_leaves_nothing_behind(bench, device):
    """Cells and nodes that the fluid has left are empty again; some of the new ones were empty before."""
    system = bench.make_system("free", 2, 5000)
    side = system.upper[0]
    system.upper = [3 * side, 2 * side]
    places = [(0.0, 0.0), (1.31 * side, 0.77 * side), (1.94 * side, 0.11 * side), (0.2 * side, 0.3 * side)]
    cycle = Cycle(bench, system, device=device)
    start = system.position
    for k, place in enumerate(places):
        system.position = start + np.array(place)
        cycle.multigrid.position.assign(system.position)
        found = cycle.solve()
        fresh = Cycle(bench, system, device=device)
        assert cycle.multigrid.first_small > 0
        assert found == fresh.solve(), f"place {k}"
        np.testing.assert_array_equal(cycle.x.numpy(), fresh.x.numpy())
        np.testing.assert_array_equal(cycle.multigrid.element.numpy(), fresh.multigrid.element.numpy())
        active = fresh.multigrid._nodes["node_inverse"].numpy()
        np.testing.assert_array_equal(cycle.multigrid._nodes["node_inverse"].numpy(), active)
        assert 0 < (active > 0).sum() < 0.5 * len(active)


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_a_closed_system_that_nobody_called_singular(bench, precision, device):
    """A box that is not full and has no particle at a surface: nothing on the host tells that the constant is free."""
    system = bench.make_system("closed", 2, 4000)
    expected = Cycle(bench, system, precision, device)
    first = expected.solve()
    system.singular = False
    cycle = Cycle(bench, system, precision, device)
    assert cycle.solve() == first and first.converged
    np.testing.assert_array_equal(cycle.x.numpy(), expected.x.numpy())


@pytest.mark.parametrize("seed", range(4))
def test_a_good_start_of_a_closed_system_is_no_harm(bench, seed, device):
    """What rounding leaves of the sum of a small residual must not fill the search with a constant."""
    system = bench.make_system("closed", 2, 1600)
    n = len(system.diagonal)
    rng = np.random.default_rng(seed)
    rows = np.repeat(np.arange(n), np.diff(system.pointers))
    # the two ends of a pair compute its entry each, and differ in the last digits
    system.values *= 1.0 + rng.uniform(-3.0e-7, 3.0e-7, len(rows))
    system.diagonal = -np.bincount(rows, system.values, n)
    pressure = 100.0 * system.position[:, 1]

    def product(x):
        return np.bincount(rows, system.values * (x[system.columns] - x[rows]), n)

    system.rhs = product(pressure)
    cycle = Cycle(bench, system, "float32", device)
    away = rng.standard_normal(n)
    away *= 3.0e-5 * np.linalg.norm(system.rhs) / np.linalg.norm(product(away))
    cycle.x.assign((pressure + away).astype(np.float32))
    result = cycle.solver.solve(cycle.rhs, cycle.x)
    assert result.converged and result.iterations <= 10, result


def test_the_work_follows_the_fluid_in_a_wide_box(bench):
    """On a CPU a box twenty times as wide adds no cells, and nodes of small levels alone."""
    system = bench.make_system("free", 2, 5000)
    close = Cycle(bench, system)
    first = close.solve()
    system.upper = [20 * upper for upper in system.upper]
    wide = Cycle(bench, system)
    second = wide.solve()
    assert second.converged and abs(second.iterations - first.iterations) <= 1
    inner, outer = (cycle.multigrid._active_counts.numpy().reshape(-1, 2) for cycle in (close, wide))
    nodes = [level.node_count for level in wide.multigrid._levels]
    assert nodes[0] > 300 * inner[0, 1]
    for k, count in enumerate(outer[:, 1]):
        assert count == nodes[k] <= 256 or count <= inner[min(k, len(inner) - 1), 1], f"level {k}"


def test_a_failed_solve_leaves_nothing_behind(bench, device):
    system = bench.make_system("free", 2, 900)
    cycle = Cycle(bench, system, device=device)
    good = cycle.solve()
    expected = cycle.x.numpy().copy()
    broken = system.rhs.copy()
    broken[5] = np.nan
    # the grids themselves see what is not finite, not the right-hand side alone
    moment = system.moment.copy()
    moment[7] = np.nan
    cycle.multigrid.moment.assign(moment)
    cycle.solve()
    cycle.rhs.assign(broken)
    assert cycle.solve().reason == "nan"
    cycle.multigrid.moment.assign(system.moment)
    cycle.rhs.assign(system.rhs)
    assert cycle.solve().iterations == good.iterations
    np.testing.assert_array_equal(cycle.x.numpy(), expected)


def test_positions_outside_the_box_and_on_its_rim(bench, device):
    system = bench.make_system("free", 2, 1500)
    system.lower = [value + 6.0 for value in system.lower]
    system.upper = [value - 7.5 for value in system.upper]
    assert (system.position < 6.0).any() and (system.position > system.upper[0]).any()
    system.position[3] = system.upper
    result = Cycle(bench, system, device=device).solve()
    assert result.converged


def test_wrong_arguments(bench):
    system = bench.make_system("free", 2, 200)
    launcher = Launcher(wp.get_device("cpu"))
    matrix, _ = bench.build(system, launcher, "float32")

    def make(dimension=2, precision="float32", upper=(14.0, 14.0), spacing=1.0):
        size = len(upper)
        return Multigrid(matrix, launcher, dimension, precision, True, [0.0] * size, upper, spacing, [False] * size)

    make()
    for keywords, text in (
        ({"dimension": 1}, "jacobi"),
        ({"precision": "float64"}, "float64"),
        ({"upper": (14.0, 0.0)}, "positive"),
        ({"spacing": 0.0}, "positive"),
    ):
        with pytest.raises(ValueError, match=text):
            make(**keywords)
    with pytest.raises(CapacityError, match="jacobi"):
        make(upper=(1.0e5, 1.0e5))
