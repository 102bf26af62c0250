"""Krylov solvers: against dense solutions, in both layouts and precisions, and what they say when they cannot."""

import numpy as np
import pytest
import warp as wp

from warpsph.engine.launch import Launcher
from warpsph.errors import CapacityError
from warpsph.kernels.linear import solve_state as entry
from warpsph.running.model import quiet_warp
from warpsph.solvers.accuracy import attainable
from warpsph.solvers.linear_solver import EllMatrix, LinearSolver

quiet_warp()


def launcher_of(device="cpu", threads=1):
    return Launcher(wp.get_device(device), threads)


def network(n=300, anchored=True, seed=3, skew=0.0):
    """Return the dense matrix of a random network of weights; anchored: some nodes are tied to 0, which makes it regular."""
    random = np.random.default_rng(seed)
    weights = np.zeros((n, n))
    for distance in (1, 2, 17):
        i = np.arange(n - distance)
        weights[i, i + distance] = random.uniform(0.2, 1.0, n - distance)
    weights += weights.T
    # a first-order term: the matrix is no longer symmetric, its row sums stay
    drift = np.zeros((n, n))
    i = np.arange(n - 1)
    drift[i, i + 1], drift[i + 1, i] = skew, -skew
    matrix = np.diag(weights.sum(axis=1)) - weights + drift - np.diag(drift.sum(axis=1))
    if anchored:
        matrix[::50, ::50] += np.diag(np.full(len(range(0, n, 50)), 0.5))
    return matrix


def ell_of(dense, launcher, precision="float64", row_list=None, width=1):
    """Return the ELL matrix of a dense one."""
    n = len(dense)
    beside = dense - np.diag(np.diag(dense))
    rows, columns = np.nonzero(beside)
    pointers = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
    matrix = EllMatrix(n, width, launcher, precision, row_list=row_list)
    matrix.fill(np.diag(dense), pointers, columns, beside[rows, columns])
    return matrix


def vector(values, matrix):
    return wp.array(np.asarray(values), dtype=matrix.real, device=matrix.device)


def run(
    dense, b, method="cg", preconditioner="jacobi", precision="float64", device="cpu", start=None, row_list=None, **keywords
):
    """Solve a dense system through the solver; return (result, x in float64, solver)."""
    launcher = launcher_of(device)
    matrix = ell_of(dense, launcher, precision, row_list)
    solver = LinearSolver(matrix, launcher, method, preconditioner, **keywords)
    x = vector(np.zeros(len(b)) if start is None else start, matrix)
    result = solver.solve(vector(b, matrix), x)
    return result, x.numpy().astype(float), solver


@pytest.mark.parametrize("preconditioner", ["none", "jacobi"])
@pytest.mark.parametrize("method", ["cg", "bicgstab"])
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_agrees_with_a_dense_solve(method, preconditioner, precision, device):
    dense = network().astype(precision).astype(float)
    b = np.random.default_rng(1).standard_normal(len(dense)).astype(precision).astype(float)
    tolerance = {"float32": 1e-9, "float64": 1e-12}[precision]
    result, x, solver = run(dense, b, method, preconditioner, precision, device, tolerance=tolerance)
    assert result.converged and result.reason == "converged" and result.remedy == ""
    exact = np.linalg.solve(dense, b)
    # the float64 sum is as good as the tolerance, also where matrix and residuals are single
    spread = np.linalg.norm(solver.solution.numpy() - exact) / np.linalg.norm(exact)
    assert spread < np.linalg.cond(dense) * 2 * tolerance
    np.testing.assert_array_equal(x, solver.solution.numpy().astype(precision).astype(float))
    rest = np.linalg.norm(b - dense @ solver.solution.numpy()) / np.linalg.norm(b)
    # the matrix of the solver has row sums below the rounding of the diagonal set to zero
    assert rest <= tolerance + 4 * np.finfo(precision).eps * np.abs(exact).max() * np.abs(dense).max() * 20 / np.linalg.norm(
        b
    )
    assert result.residual <= tolerance


def test_bicgstab_solves_what_is_not_symmetric(device):
    dense = network(skew=0.3)
    assert not np.allclose(dense, dense.T)
    b = np.sin(np.arange(len(dense)))
    result, x, _ = run(dense, b, "bicgstab", "jacobi", device=device, tolerance=1e-10)
    assert result.converged
    np.testing.assert_allclose(x, np.linalg.solve(dense, b), rtol=0, atol=1e-7 * np.abs(x).max())


def test_both_layouts_give_the_same(device):
    dense = network()
    b = np.cos(np.arange(len(dense)))
    (first, x, _), (second, y, _) = (run(dense, b, row_list=rows, tolerance=1e-10) for rows in (True, False))
    assert first.converged and second.converged
    np.testing.assert_allclose(x, y, rtol=0, atol=1e-8 * np.abs(x).max())


@pytest.mark.parametrize("method", ["cg", "bicgstab"])
def test_the_result_does_not_depend_on_the_threads(method):
    # copies of one system, so many that every thread has blocks of rows to work on
    copies, dense = 50, network()
    beside = dense - np.diag(np.diag(dense))
    rows, columns = np.nonzero(beside)
    counts = np.tile(np.bincount(rows, minlength=300), copies)
    pointers = np.concatenate([[0], np.cumsum(counts)])
    shifted = (columns + 300 * np.arange(copies)[:, None]).ravel()
    values = np.tile(beside[rows, columns], copies)
    b = np.cos(np.arange(300 * copies))
    found = []
    for threads in (1, 2, 3):
        launcher = launcher_of(threads=threads)
        matrix = EllMatrix(300 * copies, 1, launcher, "float64")
        matrix.fill(np.tile(np.diag(dense), copies), pointers, shifted, values)
        solver = LinearSolver(matrix, launcher, method, "jacobi", tolerance=1e-8)
        assert solver.rows.items >= 256 * threads
        x = wp.zeros(matrix.n, dtype=matrix.real, device="cpu")
        assert solver.solve(vector(b, matrix), x).converged
        found.append(x.numpy().copy())
        launcher.team.close()
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


@pytest.mark.parametrize("method", ["cg", "bicgstab"])
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_singular_systems_are_projected(method, precision, device):
    dense = network(anchored=False).astype(precision).astype(float)
    n = len(dense)
    # two rows out of the system: they keep their own equation and take no part in any mean
    dense[[7, 90], :] = dense[:, [7, 90]] = 0.0
    np.fill_diagonal(dense, 0.0)
    np.fill_diagonal(dense, -dense.sum(axis=1))
    dense[[7, 90], [7, 90]] = 1.0
    part = np.ones(n, dtype=bool)
    part[[7, 90]] = False
    b = np.random.default_rng(2).standard_normal(n) + 5.0
    b[~part] = 0.0
    start = np.full(n, 3.0)
    result, x, _ = run(dense, b, method, "jacobi", precision, device, singular=True, start=start, tolerance=1e-6)
    assert result.converged
    eps = np.finfo(precision).eps
    assert abs(x[part].mean()) < 4 * eps * np.abs(x).max()
    np.testing.assert_array_equal(x[~part], 0.0)
    aim = b.copy()
    aim[part] -= b[part].mean()
    exact = np.linalg.pinv(dense[np.ix_(part, part)], rcond=1e-10) @ aim[part]
    np.testing.assert_allclose(x[part], exact, rtol=0, atol=2e-4 * np.abs(exact).max())


@pytest.mark.parametrize("said", [True, False])
def test_a_constant_right_hand_side_of_a_singular_system_is_zero(said, device):
    result, x, _ = run(
        network(anchored=False), np.full(300, 2.5), singular=said, start=np.linspace(0, 1, 300), device=device
    )
    assert result.converged and result.iterations == 0
    np.testing.assert_array_equal(x, 0.0)


@pytest.mark.parametrize("method", ["cg", "bicgstab"])
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_the_device_finds_out_whether_a_system_is_singular(method, precision, device):
    """One solver, its matrix tied to 0 or not from one solve to the next: the host says nothing about it."""
    launcher = launcher_of(device)
    floating, anchored = (network(anchored=tied).astype(precision).astype(float) for tied in (False, True))
    matrix = ell_of(floating, launcher, precision, width=8)
    solver = LinearSolver(matrix, launcher, method, "jacobi", tolerance=1e-7)
    b = np.random.default_rng(2).standard_normal(300) + 5.0
    rhs, x = vector(b, matrix), vector(np.full(300, 3.0), matrix)
    for dense in (floating, anchored, floating):
        matrix.diagonal.assign(np.diag(dense).astype(precision))
        result = solver.solve(rhs, x)
        assert result.converged
        # the float64 sum of the rows of `floating` is rounding
        aim = b - b.mean() if dense is floating else b
        exact = np.linalg.pinv(dense, rcond=1e-6) @ aim
        np.testing.assert_allclose(x.numpy(), exact, rtol=0, atol=1e-4 * np.abs(exact).max())


def test_a_weak_tie_is_a_tie_and_rounding_is_none(device):
    """Row sums up to 1e-5 of the diagonal (single precision) are rounding, what is more couples a row to pressure 0."""
    for tie, singular in ((3e-6, True), (3e-5, False)):
        dense = network(anchored=False)
        dense[40, 40] *= 1.0 + tie
        result, x, solver = run(dense, np.full(300, 2.5), precision="float32", device=device)
        assert bool(solver.state.numpy()[entry.SINGULAR]) is singular
        assert (np.abs(solver.matrix.excess.numpy()).max() == 0.0) == singular
        assert result.converged and bool(np.abs(x).max() == 0.0) is singular


@pytest.mark.parametrize("method", ["cg", "bicgstab"])
def test_zero_right_hand_side(method, device):
    result, x, _ = run(network(), np.zeros(300), method, start=np.linspace(1, 2, 300), device=device)
    assert (result.iterations, result.residual, result.reason) == (0, 0.0, "converged")
    np.testing.assert_array_equal(x, 0.0)


def test_warm_start(device):
    dense = network()
    b = np.sin(np.arange(300))
    exact = np.linalg.solve(dense, b)
    cold, _, _ = run(dense, b, device=device, tolerance=1e-8)
    warm, _, _ = run(dense, b, device=device, tolerance=1e-8, start=exact + 1e-6 * np.cos(np.arange(300)))
    there, x, _ = run(dense, b, device=device, tolerance=1e-8, start=exact)
    assert there.iterations == 0 < warm.iterations < 0.7 * cold.iterations
    np.testing.assert_array_equal(x, exact)


@pytest.mark.parametrize("method", ["cg", "bicgstab"])
def test_too_few_iterations_are_reported_and_the_best_is_kept(method, device):
    dense, b = network(), np.sin(np.arange(300))
    result, x, solver = run(dense, b, method, device=device, max_iterations=20, tolerance=1e-10)
    assert (result.iterations, result.converged, result.reason) == (20, False, "iterations")
    assert "max_iterations" in result.remedy
    rest = np.linalg.norm(b - dense @ x) / np.linalg.norm(b)
    assert rest == pytest.approx(result.residual, rel=1e-6) and 1e-10 < rest < 1.0
    assert solver.totals().failures == 1


def test_an_indefinite_matrix_stalls_instead_of_hanging(device):
    dense = -network()
    result, x, _ = run(dense, np.ones(300), "cg", "none", device=device)
    assert result.reason == "stalled" and not result.converged
    assert "symmetric" in result.remedy and "float64" in result.remedy
    assert np.isfinite(x).all()


@pytest.mark.parametrize("method", ["cg", "bicgstab"])
@pytest.mark.parametrize("where", ["rhs", "start", "matrix"])
def test_what_is_not_finite_ends_the_solve(method, where, device):
    dense, b, start = network(), np.ones(300), np.zeros(300)
    if where == "rhs":
        b[3] = np.nan
    elif where == "start":
        start[3] = np.inf
    else:
        dense[3, 4] = np.nan
    result, x, solver = run(dense, b, method, device=device, start=start)
    assert result.reason == "nan" and not result.converged
    # the start value is kept
    np.testing.assert_array_equal(x, start)
    assert solver.totals().failures == 1


def test_the_start_value_is_kept_if_a_number_overflows_on_the_way(device):
    dense, start = network() * 1e-20, np.linspace(1, 2, 300).astype(np.float32)
    result, x, _ = run(dense, np.full(300, 1e25), "cg", "jacobi", "float32", device, start=start)
    assert result.reason == "nan"
    np.testing.assert_array_equal(x, start)


def test_totals_add_up_and_a_failure_does_not_spoil_the_next_solve(device):
    dense, b = network(), np.sin(np.arange(300))
    launcher = launcher_of(device)
    matrix = ell_of(dense, launcher)
    solver = LinearSolver(matrix, launcher, tolerance=1e-6)
    bad = b.copy()
    bad[0] = np.nan
    rhs, x = vector(b, matrix), vector(np.zeros(300), matrix)
    first = solver.solve(rhs, x)
    rhs.assign(bad)
    assert solver.solve(rhs, x).reason == "nan"
    rhs.assign(2 * b)
    third = solver.solve(rhs, x)
    assert first.converged and third.converged
    totals = solver.totals()
    assert (totals.solves, totals.failures) == (3, 1)
    assert totals.iterations == first.iterations + third.iterations
    assert totals.worst_iterations == max(first.iterations, third.iterations)
    assert not np.isfinite(totals.worst_residual)
    solver.reset_totals()
    assert solver.solve(rhs, x).converged
    totals = solver.totals()
    assert (totals.solves, totals.failures) == (1, 0) and totals.worst_residual <= 1e-6


def test_limits_change_between_solves(device):
    dense, b = network(), np.sin(np.arange(300))
    launcher = launcher_of(device)
    matrix = ell_of(dense, launcher)
    solver = LinearSolver(matrix, launcher, tolerance=1e-3)
    rhs, x = vector(b, matrix), vector(np.zeros(300), matrix)
    loose = solver.solve(rhs, x)
    solver.set_limits(1e-9, 2000)
    x.zero_()
    tight = solver.solve(rhs, x)
    assert 1e-9 < loose.residual <= 1e-3 and tight.residual <= 1e-9 and tight.iterations > loose.iterations


def test_single_precision_reaches_what_is_attainable(device):
    """Refinement in float64: a chain of 400 nodes has a condition of 6e4, the rounded solution a residual of 1e-3."""
    n = 400
    dense = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    b = np.cos(np.arange(n) / n)
    result, x, solver = run(
        dense, b, precision="float32", device=device, tolerance=attainable("float32"), max_iterations=60000
    )
    # the rounding of the recurrence is replaced on the way: it never has to begin again
    assert result.converged and result.restarts == 0
    b32 = b.astype(np.float32).astype(float)
    rest = np.linalg.norm(b32 - dense @ solver.solution.numpy()) / np.linalg.norm(b32)
    assert rest <= 1.01 * attainable("float32")
    assert np.linalg.norm(b32 - dense @ x) / np.linalg.norm(b32) > 1e-5


def test_rounding_of_the_diagonal_is_no_coupling(device):
    """In a closed system the diagonal is the rounded sum of the weights: the constant stays an exact null vector."""
    dense = network(anchored=False)
    launcher = launcher_of(device)
    matrix = ell_of(dense.astype(np.float32), launcher, "float32")
    anchored = ell_of(network().astype(np.float32), launcher, "float32")
    for system in (matrix, anchored):
        LinearSolver(system, launcher).solve(vector(np.sin(np.arange(300)), system), vector(np.zeros(300), system))
    np.testing.assert_array_equal(matrix.excess.numpy(), 0.0)
    expected = np.zeros(300)
    expected[::50] = 0.5
    np.testing.assert_allclose(anchored.excess.numpy(), expected, atol=1e-6)
    assert (anchored.excess.numpy() == 0.0).sum() == 294


def test_nothing_is_allocated_after_the_first_solve(device):
    dense, b = network(), np.sin(np.arange(300))
    launcher = launcher_of(device)
    matrix = ell_of(dense, launcher)
    solver = LinearSolver(matrix, launcher, "bicgstab", "jacobi")
    rhs, x = vector(b, matrix), vector(np.zeros(300), matrix)
    solver.solve(rhs, x)
    graph = solver._graph
    assert (graph is None) == launcher.is_cpu
    made = []
    original = wp.array.__init__

    def counted(self, *arguments, **keywords):
        data = keywords.get("data", arguments[0] if arguments else None)
        if (
            keywords.get("ptr") is None
            and data is not None
            or keywords.get("shape") is not None
            and keywords.get("ptr") is None
        ):
            made.append((arguments, keywords))
        original(self, *arguments, **keywords)

    wp.array.__init__ = counted
    try:
        wp.zeros(3, device=device)
        seen = len(made)
        for factor in (1.0, 2.0):
            rhs.assign(factor * b) if device == "cpu" else rhs.fill_(factor)
            count = len(made)
            assert solver.solve(rhs, x).converged
            # on a GPU the result is copied to the host
            assert len(made) == count or not launcher.is_cpu
            assert solver._graph is graph
    finally:
        wp.array.__init__ = original
    assert seen > 0, "the count sees nothing"


def test_resized_matrix_must_be_bound_again():
    launcher = launcher_of()
    dense, b = network(), np.sin(np.arange(300))
    matrix = ell_of(dense, launcher, width=6)
    solver = LinearSolver(matrix, launcher, tolerance=1e-8)
    rhs, x = vector(b, matrix), vector(np.zeros(300), matrix)
    with pytest.raises(RuntimeError, match="bind"):
        solver.record()
    first = solver.solve(rhs, x)
    exact = x.numpy().copy()
    matrix.resize(11)
    with pytest.raises(RuntimeError, match="resized"):
        solver.record()
    again = ell_of(dense, launcher, width=11)
    wp.copy(matrix.columns, again.columns)
    wp.copy(matrix.values, again.values)
    x.zero_()
    solver.bind(rhs, x)
    solver.record()
    assert solver.result().iterations == first.iterations
    np.testing.assert_array_equal(x.numpy(), exact)


@pytest.mark.cuda
def test_a_solve_inside_a_captured_loop(device):
    """Three solves by one graph, whose loop the device counts down, each from the result of the last."""
    dense, b = network(), np.sin(np.arange(300))
    launcher = launcher_of(device)
    matrix = ell_of(dense, launcher)
    solver = LinearSolver(matrix, launcher, tolerance=1e-9)
    rhs, x = vector(b, matrix), vector(np.zeros(300), matrix)
    solver.bind(rhs, x)
    solver.record()
    left = wp.array([3], dtype=int, device=device)

    @wp.kernel(module="unique", enable_backward=False)
    def count_down(left: wp.array(dtype=int), x: wp.array(dtype=wp.float64)):
        i = wp.tid()
        x[i] = wp.float64(0.0)
        if i == 0:
            left[0] = left[0] - 1

    def body():
        wp.launch(count_down, dim=300, inputs=[left, x], device=device)
        solver.record()

    wp.launch(count_down, dim=300, inputs=[wp.clone(left), wp.clone(x)], device=device)
    solver.reset_totals()
    with wp.ScopedCapture(device=device) as capture:
        wp.capture_while(left, body)
    wp.capture_launch(capture.graph)
    totals = solver.totals()
    assert totals.solves == 3 and totals.failures == 0 and totals.iterations == 3 * totals.worst_iterations
    np.testing.assert_allclose(x.numpy(), np.linalg.solve(dense, b), rtol=0, atol=1e-6)


def test_wrong_arguments():
    launcher = launcher_of()
    matrix = ell_of(network(), launcher, "float32")
    for keywords, text in (
        ({"method": "gmres"}, "'gmres'"),
        ({"preconditioner": "ilu"}, "'ilu'"),
        ({"tolerance": 1e-14}, "float64"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"max_iterations": 0}, "max_iterations"),
    ):
        with pytest.raises(ValueError, match=text):
            LinearSolver(matrix, launcher, **keywords)
    solver = LinearSolver(matrix, launcher)
    with pytest.raises(ValueError, match="rhs"):
        solver.bind(wp.zeros(300, dtype=wp.float64, device="cpu"), wp.zeros(300, dtype=wp.float32, device="cpu"))
    with pytest.raises(CapacityError):
        matrix.resize(40000)


def test_the_state_has_room_for_every_entry():
    names = [
        "TOLERANCE",
        "LIMIT",
        "ITERATIONS",
        "RESIDUAL",
        "REASON",
        "RESTARTS",
        "SOLVES",
        "TOTAL_ITERATIONS",
        "WORST_RESIDUAL",
    ]
    names += [
        "FAILURES",
        "WORST_ITERATIONS",
        "RHS2",
        "RESIDUAL2",
        "RHO",
        "ALPHA",
        "BETA",
        "OMEGA",
        "LAST2",
        "STRIKES",
        "GOAL2",
    ]
    names += ["RHS_MEAN", "SOLUTION_MEAN", "FRESH", "SHADOW2", "ROWS", "RESIDUAL_MEAN", "SINGULAR", "PEAK2", "REPLACING"]
    names += ["SCALED_MEAN"]
    assert sorted(getattr(entry, name) for name in names) == list(range(entry.STATE_SIZE))
