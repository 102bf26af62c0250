"""BiCGSTAB (van der Vorst 1992), preconditioned, with fused dot products: one iteration.

Arrays `scaled` and `scaled2` are M p and M s, `product` and `product2` their images under A, `shadow` the residual that it
projects on.
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
    ALPHA,
    BETA,
    FRESH,
    GOAL2,
    ITERATIONS,
    LIMIT,
    OMEGA,
    ONE,
    RESIDUAL2,
    RHO,
    RUNNING,
    SHADOW2,
    ZERO,
)


@functools.cache
def make_bi_products(precision: str, row_list: bool, count_type: Any, wide: bool) -> tuple[Any, Any]:
    """Return the kernels bi_product and bi_second: the products with A."""
    real = types(2, precision).real
    store_sums, _ = make_sums(row_list)
    _, summed_product, _ = make_product(precision, row_list, count_type, wide)
    Columns, Values = make_entry(row_list, wide).array, make_entry(row_list, wide, real).array
    sweep = make_sweep(row_list)

    @sweep
    def bi_product(
        first: int,
        n: int,
        chunk: int,
        width: int,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        scaled: wp.array(dtype=real),
        shadow: wp.array(dtype=real),
        product: wp.array(dtype=real),
        sums: wp.array(dtype=wp.vec3d),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        sv = wp.float64(0.0)
        while i < end:
            v = summed_product(i, n, width, counts, columns, values, excess, scaled)
            product[i] = real(v)
            sv += wp.float64(shadow[i]) * v
            i += 1
        store_sums(t, sv, ZERO, ZERO, sums)

    @sweep
    def bi_second(
        first: int,
        n: int,
        chunk: int,
        width: int,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        scaled2: wp.array(dtype=real),
        residual: wp.array(dtype=real),
        product2: wp.array(dtype=real),
        sums: wp.array(dtype=wp.vec3d),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        ts = wp.float64(0.0)
        tt = wp.float64(0.0)
        while i < end:
            v = summed_product(i, n, width, counts, columns, values, excess, scaled2)
            product2[i] = real(v)
            ts += v * wp.float64(residual[i])
            tt += v * v
            i += 1
        store_sums(t, ts, tt, ZERO, sums)

    return bi_product, bi_second


@functools.cache
def make_bi_updates(precision: str, row_list: bool) -> tuple[Any, Any, Any]:
    """Return the kernels bi_search, bi_half_update and bi_update: the sums of vectors."""
    real = types(2, precision).real
    store_sums, _ = make_sums(row_list)
    sweep = make_sweep(row_list)

    @sweep
    def bi_search(
        first: int,
        n: int,
        chunk: int,
        weight: real,
        inverse: wp.array(dtype=real),
        residual: wp.array(dtype=real),
        shadow: wp.array(dtype=real),
        search: wp.array(dtype=real),
        product: wp.array(dtype=real),
        scaled: wp.array(dtype=real),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        beta = real(solve_state[BETA])
        omega = real(solve_state[OMEGA])
        fresh = solve_state[FRESH] > ZERO
        while i < end:
            p = residual[i]
            if fresh:
                shadow[i] = p
            else:
                p += beta * (search[i] - omega * product[i])
            search[i] = p
            if weight > real(0.0):
                p *= weight * inverse[i]
            scaled[i] = p
            i += 1

    @sweep
    def bi_half_update(
        first: int,
        n: int,
        chunk: int,
        weight: real,
        inverse: wp.array(dtype=real),
        product: wp.array(dtype=real),
        residual: wp.array(dtype=real),
        scaled2: wp.array(dtype=real),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        alpha = real(solve_state[ALPHA])
        while i < end:
            s = residual[i] - alpha * product[i]
            residual[i] = s
            if weight > real(0.0):
                s *= weight * inverse[i]
            scaled2[i] = s
            i += 1

    @sweep
    def bi_update(
        first: int,
        n: int,
        chunk: int,
        scaled: wp.array(dtype=real),
        scaled2: wp.array(dtype=real),
        product2: wp.array(dtype=real),
        shadow: wp.array(dtype=real),
        solution: wp.array(dtype=wp.float64),
        residual: wp.array(dtype=real),
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        alpha = solve_state[ALPHA]
        omega = solve_state[OMEGA]
        omega_r = real(omega)
        rr = wp.float64(0.0)
        sr = wp.float64(0.0)
        while i < end:
            solution[i] = solution[i] + alpha * wp.float64(scaled[i]) + omega * wp.float64(scaled2[i])
            r = residual[i] - omega_r * product2[i]
            residual[i] = r
            rr += wp.float64(r) * wp.float64(r)
            sr += wp.float64(shadow[i]) * wp.float64(r)
            i += 1
        store_sums(t, rr, sr, ZERO, sums)

    return bi_search, bi_half_update, bi_update


@functools.cache
def make_bi_decisions(row_list: bool) -> tuple[Any, Any, Any]:
    """Return the kernels decide_bi_alpha, decide_omega and decide_bi_update: what follows from the sums of a sweep."""
    _, total_sums = make_sums(row_list)

    @exact_kernel
    def decide_bi_alpha(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
        solve_flags: wp.array(dtype=int),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            if solve_state[FRESH] > ZERO:
                # the shadow is the residual itself
                solve_state[RHO] = solve_state[RESIDUAL2]
                solve_state[SHADOW2] = solve_state[RESIDUAL2]
            alpha = ZERO
            if total[0] != ZERO:
                alpha = solve_state[RHO] / total[0]
            if alpha == ZERO or not wp.isfinite(alpha):
                alpha = ZERO
                solve_flags[RUNNING] = 0
            solve_state[ALPHA] = alpha

    @exact_kernel
    def decide_omega(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            omega = ZERO
            if total[1] > ZERO:
                omega = total[0] / total[1]
            solve_state[OMEGA] = omega

    @exact_kernel
    def decide_bi_update(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
        solve_flags: wp.array(dtype=int),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            rr = total[0]
            rho = total[1]
            solve_state[ITERATIONS] = solve_state[ITERATIONS] + ONE
            solve_state[RESIDUAL2] = rr
            solve_state[FRESH] = ZERO
            beta = ZERO
            omega = solve_state[OMEGA]
            old = solve_state[RHO]
            if omega != ZERO and old != ZERO:
                beta = (rho / old) * (solve_state[ALPHA] / omega)
            solve_state[BETA] = beta
            solve_state[RHO] = rho
            # residual and shadow orthogonal up to rounding, or no step: breakdown, a new shadow helps
            broken = rho * rho < wp.float64(1.0e-24) * rr * solve_state[SHADOW2] or omega == ZERO
            if not (rr > solve_state[GOAL2]) or broken or solve_state[ITERATIONS] >= solve_state[LIMIT]:
                solve_flags[RUNNING] = 0

    return decide_bi_alpha, decide_omega, decide_bi_update
