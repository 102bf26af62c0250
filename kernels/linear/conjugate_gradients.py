"""Conjugate gradients (Hestenes & Stiefel 1952), preconditioned, with fused dot products: one iteration."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import make_entry
from warpsph.kernels.core.spec import types

from .decorators import exact_kernel, make_sweep
from .products import make_product
from .reductions import make_sums
from .solve_state import (
    ALPHA,
    BETA,
    FRESH,
    GOAL2,
    ITERATIONS,
    LIMIT,
    ONE,
    PEAK2,
    REPLACING,
    RESIDUAL2,
    RESIDUAL_MEAN,
    RHO,
    RHS2,
    ROWS,
    RUNNING,
    SCALED_MEAN,
    SINGULAR,
    TOLERANCE,
    ZERO,
)

# Residuals of conjugate gradients grow at first, in a large system to a hundred times |b|, and the recurrence keeps the
# rounding of the largest: its unit, relative to it. Where that counts beside the tolerance, r is evaluated as soon as it has
# fallen to DROP of the largest, where the rounding is far below it, and the recurrence goes on with the same directions.
UNIT = {"float32": 2.0**-24, "float64": 2.0**-53}
COUNTS = 0.1  # share of the tolerance
DROP = 1.0e-3


@functools.cache
def make_cg_sweeps(precision: str, row_list: bool, count_type: Any, wide: bool) -> tuple[Any, Any, Any]:
    """Return the kernels cg_search, cg_product and cg_update over the rows."""
    real = types(2, precision).real
    store_sums, _ = make_sums(row_list)
    _, summed_product, _ = make_product(precision, row_list, count_type, wide)
    Columns, Values = make_entry(row_list, wide).array, make_entry(row_list, wide, real).array
    sweep = make_sweep(row_list)

    @sweep
    def cg_search(
        first: int,
        n: int,
        chunk: int,
        counts: wp.array(dtype=count_type),
        scaled: wp.array(dtype=real),
        search: wp.array(dtype=real),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        beta = real(solve_state[BETA])
        if solve_state[SCALED_MEAN] != ZERO:
            mean = real(solve_state[SCALED_MEAN])
            if solve_state[FRESH] > ZERO:
                beta = real(0.0)
            while i < end:
                z = scaled[i]
                if int(counts[i]) > 0:
                    z -= mean
                if beta != real(0.0):
                    z += beta * search[i]
                search[i] = z
                i += 1
        elif solve_state[FRESH] > ZERO:
            while i < end:
                search[i] = scaled[i]
                i += 1
        else:
            while i < end:
                search[i] = scaled[i] + beta * search[i]
                i += 1

    @sweep
    def cg_product(
        first: int,
        n: int,
        chunk: int,
        width: int,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        search: wp.array(dtype=real),
        product: wp.array(dtype=real),
        sums: wp.array(dtype=wp.vec3d),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        pq = wp.float64(0.0)
        while i < end:
            q = summed_product(i, n, width, counts, columns, values, excess, search)
            product[i] = real(q)
            pq += wp.float64(search[i]) * q
            i += 1
        store_sums(t, pq, ZERO, ZERO, sums)

    @sweep
    def cg_update(
        first: int,
        n: int,
        chunk: int,
        weight: real,
        counts: wp.array(dtype=count_type),
        inverse: wp.array(dtype=real),
        search: wp.array(dtype=real),
        product: wp.array(dtype=real),
        solution: wp.array(dtype=wp.float64),
        residual: wp.array(dtype=real),
        scaled: wp.array(dtype=real),
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        alpha = solve_state[ALPHA]
        alpha_r = real(alpha)
        rr = wp.float64(0.0)
        rz = wp.float64(0.0)
        total = wp.float64(0.0)
        while i < end:
            solution[i] = solution[i] + alpha * wp.float64(search[i])
            r = residual[i] - alpha_r * product[i]
            z = real(r)
            if weight > real(0.0):
                z *= weight * inverse[i]
            residual[i] = r
            scaled[i] = z
            rr += wp.float64(r) * wp.float64(r)
            rz += wp.float64(r) * wp.float64(z)
            if int(counts[i]) > 0:
                total += wp.float64(r)
            i += 1
        store_sums(t, rr, rz, total, sums)

    return cg_search, cg_product, cg_update


@functools.cache
def make_cg_decisions(precision: str, row_list: bool) -> tuple[Any, Any, Any]:
    """Return the kernels decide_alpha, decide_update and decide_beta: what follows from the sums of a sweep."""
    _, total_sums = make_sums(row_list)
    kept2 = (UNIT[precision] / COUNTS) ** 2

    @exact_kernel
    def decide_alpha(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
        solve_flags: wp.array(dtype=int),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            alpha = ZERO
            if total[0] > ZERO and solve_state[RHO] > ZERO:
                alpha = solve_state[RHO] / total[0]
            else:
                # matrix or preconditioner are not positive definite here: evaluate, and begin anew if that gains anything
                solve_flags[RUNNING] = 0
            solve_state[ALPHA] = alpha

    @exact_kernel
    def decide_update(
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
            solve_state[ITERATIONS] = solve_state[ITERATIONS] + ONE
            solve_state[RESIDUAL2] = rr
            solve_state[FRESH] = ZERO
            if solve_state[SINGULAR] > ZERO:
                solve_state[RESIDUAL_MEAN] = total[2] / solve_state[ROWS]
            peak = wp.max(solve_state[PEAK2], rr)
            solve_state[PEAK2] = peak
            tolerance = solve_state[TOLERANCE]
            # written so that a residual that is not a number ends the loop too
            if not (rr > solve_state[GOAL2]) or solve_state[ITERATIONS] >= solve_state[LIMIT]:
                solve_flags[RUNNING] = 0
            elif rr < wp.float64(DROP * DROP) * peak and solve_flags[RUNNING] == 1:
                if wp.float64(wp.static(kept2)) * peak > tolerance * tolerance * solve_state[RHS2]:
                    solve_flags[RUNNING] = 0
                    solve_state[REPLACING] = ONE
            if scaled_is_final == 1:
                solve_state[BETA] = total[1] / solve_state[RHO]
                solve_state[RHO] = total[1]

    @exact_kernel
    def decide_beta(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            # The coarsest grid answers the rounding of a residual that should sum to zero with a constant of any size.
            # In the search direction it would take the digits of all else.
            mean = ZERO
            if solve_state[SINGULAR] > ZERO:
                mean = total[2] / solve_state[ROWS]
            solve_state[SCALED_MEAN] = mean
            rho = total[1] - mean * total[0]
            beta = ZERO
            if solve_state[FRESH] == ZERO and solve_state[RHO] != ZERO:
                beta = rho / solve_state[RHO]
            solve_state[BETA] = beta
            solve_state[RHO] = rho

    return decide_alpha, decide_update, decide_beta
