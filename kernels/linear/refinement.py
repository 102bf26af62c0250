"""Around the recurrence of a Krylov method: what comes before it, the evaluation of the residual, the result.

The solution is summed up in float64, and every residual that is not a recurrence is evaluated in float64 (iterative
refinement).
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import make_entry
from warpsph.kernels.core.spec import types

from .decorators import exact_kernel, make_sweep
from .products import make_product
from .reductions import make_sums
from .solve_state import (
    ACTIVE,
    BETA,
    CONVERGED,
    FAILURES,
    FRESH,
    GOAL2,
    ITERATIONS,
    LAST2,
    LIMIT,
    NOT_FINITE,
    ONE,
    OUT_OF_ITERATIONS,
    PEAK2,
    REASON,
    REPLACING,
    RESIDUAL,
    RESIDUAL2,
    RESIDUAL_MEAN,
    RESTARTS,
    RHO,
    RHS2,
    RHS_MEAN,
    ROWS,
    RUNNING,
    SCALED_MEAN,
    SINGULAR,
    SOLUTION_MEAN,
    SOLVES,
    STALLED,
    STRIKES,
    TOLERANCE,
    TOTAL_ITERATIONS,
    WORST_ITERATIONS,
    WORST_RESIDUAL,
    ZERO,
)

PATIENCE = 2  # restarts without gain before a solve counts as stalled
GAIN = 0.25  # of r.r that a restart must at least get down to
# The recurrence aims a little lower than the tolerance, so that the evaluated residual passes at the first try.
AIM = 0.81
# Lower than this, relative to where it began, the recurrence says nothing about the residual.
REACH = {"float32": 1.0e-7, "float64": 1.0e-13}
# A row sum below this share of the diagonal is rounding of the sum that the caller built the diagonal from.
ROUNDING = {"float32": 4.0 * 2.0**-23, "float64": 4.0 * 2.0**-52}
# A row sum above this share couples the row to what is not in the system. Rounding of a long row stays well below: 1e-6 in
# single precision for a hundred entries.
COUPLED = {"float32": 1.0e-5, "float64": 1.0e-13}


@functools.cache
def make_prepare(precision: str, row_list: bool, count_type: Any, wide: bool) -> tuple[Any, Any, Any]:
    """Return the kernels solve_prepare, decide_prepare and solve_release: row sums, diagonal, null vector of a system."""
    real = types(2, precision).real
    store_sums, total_sums = make_sums(row_list)
    list_begin, list_step, value_at, Values, _ = make_entry(row_list, wide, real)
    rounding, coupled = ROUNDING[precision], COUPLED[precision]

    @exact_kernel
    def solve_prepare(
        first: int,
        n: int,
        chunk: int,
        width: int,
        counts: wp.array(dtype=count_type),
        values: Values,
        diagonal: wp.array(dtype=real),
        rhs: wp.array(dtype=real),
        x: wp.array(dtype=real),
        excess: wp.array(dtype=real),
        inverse: wp.array(dtype=real),
        solution: wp.array(dtype=wp.float64),
        sums: wp.array(dtype=wp.vec3d),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        step = list_step(n)
        rhs_total = wp.float64(0.0)
        rows = wp.float64(0.0)
        held = wp.float64(0.0)  # rows that are coupled to what is not in the system
        while i < end:
            d = wp.float64(diagonal[i])
            total = wp.float64(d)
            k = list_begin(i, width)
            for _entry in range(int(counts[i])):
                total += wp.float64(value_at(values, i, k))
                k += step
            if wp.abs(total) < wp.float64(wp.static(rounding)) * wp.abs(d):
                total = ZERO
            excess[i] = real(total)
            inv = ZERO
            if d != ZERO:
                inv = ONE / d
            inverse[i] = real(inv)
            start = wp.float64(x[i])
            if int(counts[i]) == 0:
                if wp.isfinite(start):
                    start = wp.float64(rhs[i]) * inv
            else:
                rhs_total += wp.float64(rhs[i])
                rows += ONE
                # written so that a sum that is not a number is a coupling
                if not (wp.abs(total) <= wp.float64(wp.static(coupled)) * wp.abs(d)):
                    held += ONE
            solution[i] = start
            i += 1
        store_sums(t, rhs_total, rows, held, sums)

    @exact_kernel
    def decide_prepare(
        first: int,
        block_count: int,
        singular: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            mean = ZERO
            null = ZERO
            if total[1] > ZERO and (singular == 1 or total[2] == ZERO):
                null = ONE
                mean = total[0] / total[1]
            solve_state[SINGULAR] = null
            solve_state[RHS_MEAN] = mean
            solve_state[SOLUTION_MEAN] = ZERO
            solve_state[RESIDUAL_MEAN] = ZERO
            solve_state[SCALED_MEAN] = ZERO
            solve_state[ROWS] = wp.max(total[1], ONE)
            solve_state[ITERATIONS] = ZERO
            solve_state[RESTARTS] = ZERO
            solve_state[STRIKES] = ZERO
            solve_state[REPLACING] = ZERO
            solve_state[LAST2] = wp.float64(-1.0)

    @exact_kernel
    def solve_release(
        first: int,
        n: int,
        chunk: int,
        counts: wp.array(dtype=count_type),
        excess: wp.array(dtype=real),
        solve_state: wp.array(dtype=wp.float64),
    ):
        """No row of a singular system is coupled to anything outside, not by rounding either."""
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        if solve_state[SINGULAR] == ZERO:
            end = i
        while i < end:
            if int(counts[i]) > 0:
                excess[i] = real(0.0)
            i += 1

    return solve_prepare, decide_prepare, solve_release


@functools.cache
def make_evaluate(precision: str, row_list: bool, count_type: Any, wide: bool) -> tuple[Any, Any]:
    """Return the kernels solve_evaluate and decide_evaluate: the residual, and whether and how the solve goes on."""
    real = types(2, precision).real
    store_sums, total_sums = make_sums(row_list)
    _, _, exact_product = make_product(precision, row_list, count_type, wide)
    Columns, Values = make_entry(row_list, wide).array, make_entry(row_list, wide, real).array
    reach2 = REACH[precision] ** 2
    sweep = make_sweep(row_list)

    @sweep
    def solve_evaluate(
        first: int,
        n: int,
        chunk: int,
        width: int,
        weight: real,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        inverse: wp.array(dtype=real),
        rhs: wp.array(dtype=real),
        solution: wp.array(dtype=wp.float64),
        residual: wp.array(dtype=real),
        scaled: wp.array(dtype=real),
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        rr = wp.float64(0.0)
        rz = wp.float64(0.0)
        bb = wp.float64(0.0)
        while i < end:
            b = wp.float64(rhs[i])
            if int(counts[i]) > 0:
                b -= solve_state[RHS_MEAN]
            bb += b * b
            r = b - exact_product(i, n, width, counts, columns, values, excess, solution)
            z = real(r)
            if weight > real(0.0):
                z *= weight * inverse[i]
            residual[i] = real(r)
            scaled[i] = z
            rr += r * r
            rz += r * wp.float64(z)
            i += 1
        store_sums(t, rr, rz, bb, sums)

    @exact_kernel
    def decide_evaluate(
        first: int,
        block_count: int,
        scaled_is_final: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
        solve_flags: wp.array(dtype=int),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            rr = total[0]
            bb = total[2]
            mean = solve_state[RHS_MEAN]
            # what the mean leaves of a constant is rounding
            if bb < wp.float64(1.0e-26) * solve_state[ROWS] * mean * mean:
                bb = ZERO
            solve_state[RHS2] = bb
            last = solve_state[LAST2]
            tolerance = solve_state[TOLERANCE]
            goal = tolerance * tolerance * bb
            going = int(0)
            reason = int(CONVERGED)
            relative = ZERO
            if bb > ZERO:
                relative = wp.sqrt(rr / bb)
            strikes = solve_state[STRIKES]
            replacing = solve_state[REPLACING] > ZERO
            if last >= ZERO and not replacing:
                if rr > wp.float64(GAIN) * last:
                    strikes += ONE
                else:
                    strikes = ZERO
            if not wp.isfinite(rr) or not wp.isfinite(bb):
                reason = NOT_FINITE
                relative = rr
            elif bb == ZERO or rr <= goal:
                reason = CONVERGED
            elif solve_state[ITERATIONS] >= solve_state[LIMIT]:
                reason = OUT_OF_ITERATIONS
            elif strikes >= wp.float64(PATIENCE):
                reason = STALLED
            else:
                going = 1
                if last >= ZERO and not replacing:
                    solve_state[RESTARTS] = solve_state[RESTARTS] + ONE
            solve_state[STRIKES] = strikes
            solve_state[RESIDUAL] = relative
            solve_state[REASON] = wp.float64(reason)
            solve_state[LAST2] = rr
            solve_state[RESIDUAL2] = rr
            solve_state[RESIDUAL_MEAN] = ZERO
            if replacing:
                solve_state[FRESH] = ZERO
                if scaled_is_final == 1:
                    solve_state[BETA] = solve_state[BETA] * total[1] / solve_state[RHO]
                    solve_state[RHO] = total[1]
            else:
                solve_state[FRESH] = ONE
                solve_state[BETA] = ZERO
                solve_state[RHO] = total[1]
            solve_state[PEAK2] = rr
            solve_state[REPLACING] = ZERO
            solve_state[GOAL2] = wp.max(wp.float64(AIM) * goal, wp.float64(wp.static(reach2)) * rr)
            solve_flags[ACTIVE] = going
            solve_flags[RUNNING] = going

    return solve_evaluate, decide_evaluate


@functools.cache
def make_deliver(precision: str, row_list: bool, count_type: Any) -> tuple[Any, Any, Any, Any]:
    """Return the kernels solution_sum, decide_solution_mean, solve_deliver and decide_end: the result of a solve."""
    real = types(2, precision).real
    store_sums, total_sums = make_sums(row_list)

    @exact_kernel
    def solution_sum(
        first: int,
        n: int,
        chunk: int,
        counts: wp.array(dtype=count_type),
        solution: wp.array(dtype=wp.float64),
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        if solve_state[SINGULAR] == ZERO:
            end = i
        total = wp.float64(0.0)
        rows = wp.float64(0.0)
        while i < end:
            if int(counts[i]) > 0:
                total += solution[i]
                rows += ONE
            i += 1
        store_sums(t, total, rows, ZERO, sums)

    @exact_kernel
    def decide_solution_mean(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            mean = ZERO
            if total[1] > ZERO:
                mean = total[0] / total[1]
            solve_state[SOLUTION_MEAN] = mean

    @exact_kernel
    def solve_deliver(
        first: int,
        n: int,
        chunk: int,
        counts: wp.array(dtype=count_type),
        solution: wp.array(dtype=wp.float64),
        x: wp.array(dtype=real),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        empty = solve_state[RHS2] == ZERO
        keep = int(solve_state[REASON]) == NOT_FINITE
        mean = solve_state[SOLUTION_MEAN]
        while i < end:
            value = solution[i]
            if int(counts[i]) > 0:
                value -= mean
            if empty:
                value = ZERO
            if not keep:
                solution[i] = value
                x[i] = real(value)
            i += 1

    @exact_kernel
    def decide_end(solve_state: wp.array(dtype=wp.float64)):
        iterations = solve_state[ITERATIONS]
        if solve_state[RHS2] == ZERO:
            solve_state[RESIDUAL] = ZERO
        solve_state[SOLVES] = solve_state[SOLVES] + ONE
        solve_state[TOTAL_ITERATIONS] = solve_state[TOTAL_ITERATIONS] + iterations
        solve_state[WORST_ITERATIONS] = wp.max(solve_state[WORST_ITERATIONS], iterations)
        worst = solve_state[WORST_RESIDUAL]
        # a residual that is not a number stays the worst
        if not (solve_state[RESIDUAL] <= worst) and not wp.isnan(worst):
            solve_state[WORST_RESIDUAL] = solve_state[RESIDUAL]
        if int(solve_state[REASON]) != CONVERGED:
            solve_state[FAILURES] = solve_state[FAILURES] + ONE

    return solution_sum, decide_solution_mean, solve_deliver, decide_end
