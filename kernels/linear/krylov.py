"""Krylov solvers over an ELL matrix: conjugate gradients and BiCGSTAB with fused dot products.

Hestenes & Stiefel (1952) and van der Vorst (1992), preconditioned. Three things make single precision enough:

* The product is taken in differences, (A x)_i = e_i x_i + sum_k a_ik (x_k - x_i) with e_i = A_ii + sum_k a_ik, the row
sum. A
  smooth x then loses nothing to cancellation, and the constant is an exact null vector of a closed system.
* The solution is summed up in float64, and every residual that is not a recurrence is evaluated in float64 (iterative
  refinement); search directions and residuals are vectors of the precision of the matrix.
* Dot products are float64 sums in a fixed order: a block of rows each (a stretch of rows on a CPU core, a thread block on
a GPU),
  then one sum over the blocks. The result does not depend on the number of threads.

All decisions are taken on the device by kernels of one thread (block), which work on the float64 array `solve_state` and the
int32 array `solve_flags`; see the indices below.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.pair import make_entry
from warpsph.kernels.core.spec import SWEEP_OPTIONS, types

# entries of `solve_state`: what the caller sets
TOLERANCE = 0  # relative residual to reach
LIMIT = 1  # iterations at most
# what a solve leaves behind
ITERATIONS = 2
RESIDUAL = 3  # |b - A x| / |b|, evaluated, not from the recurrence
REASON = 4  # CONVERGED ...
RESTARTS = 5  # how often the recurrence was started again from the evaluated residual
# summed up over solves
SOLVES = 6
TOTAL_ITERATIONS = 7
WORST_RESIDUAL = 8
FAILURES = 9  # solves that did not reach the tolerance
WORST_ITERATIONS = 10
# what passes between the kernels of a solve
RHS2 = 11  # b.b
RESIDUAL2 = 12  # r.r of the recurrence
RHO = 13  # r.z (CG) or shadow.r (BiCGSTAB)
ALPHA = 14
BETA = 15
OMEGA = 16
LAST2 = 17  # r.r at the last evaluation
STRIKES = 18  # restarts in a row that gained nothing
GOAL2 = 19  # r.r at which the recurrence stops
RHS_MEAN = 20
SOLUTION_MEAN = 21
FRESH = 22  # 1: the next iteration begins a recurrence
SHADOW2 = 23  # shadow.shadow
ROWS = 24  # rows that have entries
RESIDUAL_MEAN = 25  # of r over them, rounding alone: 0 unless singular
SINGULAR = 26  # 1: the constant over these rows is a null vector
PEAK2 = 27  # largest r.r since the last evaluation
REPLACING = 28  # 1: the recurrence goes on from the residual that is evaluated next
STATE_SIZE = 29

# entries of `solve_flags`
ACTIVE = 0  # the solve goes on
RUNNING = 1  # the recurrence goes on
FLAGS_SIZE = 2

# values of REASON
CONVERGED = 0
OUT_OF_ITERATIONS = 1
STALLED = 2
NOT_FINITE = 3

LANES = 256  # threads of a block on a GPU; the launches below count on it
PATIENCE = 2  # restarts without gain before a solve counts as stalled
GAIN = 0.25  # of r.r that a restart must at least get down to
# The recurrence aims a little lower than the tolerance, so that the evaluated residual passes at the first try.
AIM = 0.81
# Lower than this, relative to where it began, the recurrence says nothing about the residual.
REACH = {"float32": 1.0e-7, "float64": 1.0e-13}
# Residuals of conjugate gradients grow at first, in a large system to a hundred times |b|, and the recurrence keeps the
# rounding of the largest: its unit, relative to it. Where that counts beside the tolerance, r is evaluated as soon as it has
# fallen to DROP of the largest, where the rounding is far below it, and the recurrence goes on with the same directions.
UNIT = {"float32": 2.0**-24, "float64": 2.0**-53}
COUNTS = 0.1  # share of the tolerance
DROP = 1.0e-3
# A row sum below this share of the diagonal is rounding of the sum that the caller built the diagonal from.
ROUNDING = {"float32": 4.0 * 2.0**-23, "float64": 4.0 * 2.0**-52}
# A row sum above this share couples the row to what is not in the system. Rounding of a long row stays well below: 1e-6 in
# single precision for a hundred entries.
COUPLED = {"float32": 1.0e-5, "float64": 1.0e-13}


@wp.func_native("#if defined(__CUDA_ARCH__)\n__syncthreads();\n#endif\n")
def barrier():
    """Wait for the threads of the block; nothing on a CPU, where a block is one thread."""
    ...


@functools.cache
def make_sums(row_list: bool) -> tuple[Any, Any]:
    """Return the `wp.func`s (store_sums(t, a, b, c, sums), total_sums(t, block_count, sums)) of block-wise sums.

    Row lists (CPU): item t is a block of rows. Else (GPU): item t is a thread, its block has `LANES` of them and all call
    it.
    """
    if row_list:

        @wp.func
        def store_sums(t: int, a: wp.float64, b: wp.float64, c: wp.float64, sums: wp.array(dtype=wp.vec3d)):
            sums[t] = wp.vec3d(a, b, c)

        @wp.func
        def total_sums(t: int, block_count: int, sums: wp.array(dtype=wp.vec3d)):
            total = wp.vec3d()
            for k in range(block_count):
                total += sums[k]
            return total

    else:

        @wp.func
        def store_sums(t: int, a: wp.float64, b: wp.float64, c: wp.float64, sums: wp.array(dtype=wp.vec3d)):
            sum_a = wp.tile_sum(wp.tile(a))
            sum_b = wp.tile_sum(wp.tile(b))
            sum_c = wp.tile_sum(wp.tile(c))
            total = wp.vec3d(sum_a[0], sum_b[0], sum_c[0])
            if t % wp.block_dim() == 0:
                sums[t / wp.block_dim()] = total

        @wp.func
        def total_sums(t: int, block_count: int, sums: wp.array(dtype=wp.vec3d)):
            own = wp.vec3d()
            k = int(t)
            while k < block_count:
                own += sums[k]
                k += wp.block_dim()
            sum_a = wp.tile_sum(wp.tile(own[0]))
            sum_b = wp.tile_sum(wp.tile(own[1]))
            sum_c = wp.tile_sum(wp.tile(own[2]))
            return wp.vec3d(sum_a[0], sum_b[0], sum_c[0])

    return store_sums, total_sums


# In C++: an array access in Warp's language multiplies with a stride known at run time alone, which costs a CPU four times
# the product itself. (Warp makes a macro of `float(`: hence casts in the style of C.)
ROW_PRODUCT = """
const auto *entry = values.data + {begin};
const int *column = columns.data + {begin};
const size_t step = {step};
const auto *vector = x.data;
const {number} own = vector[i];
const int count = counts.data[i];
{number} total = excess.data[i] * own;
for (int k = 0; k < count; ++k) {{
    total += *entry * (({number})vector[*column] - own);
    entry += step;
    column += step;
}}
return total;
"""


@functools.cache
def make_product(precision: str, row_list: bool, count_type: Any, wide: bool = False) -> tuple[Any, Any, Any]:
    """Return the `wp.func`s (row_product, summed_product, exact_product): row i of A x.

    The first is evaluated in the precision of the matrix and good for smoothing; the others in float64, of a vector in the
    precision of the matrix and of one in float64. In single precision a recurrence with the first would drift from the
    residual by 1e-6 of it where the solution varies over a thousand particles.
    """
    real = types(2, precision).real
    layout = {"begin": "(size_t)i * width", "step": "1"} if row_list else {"begin": "i", "step": "n"}
    number = {"float32": "float", "float64": "double"}[precision]
    Columns, Values = make_entry(row_list, wide).array, make_entry(row_list, wide, real).array

    @wp.func_native(ROW_PRODUCT.format(number=number, **layout))
    def row_product(
        i: int,
        n: int,
        width: int,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        x: wp.array(dtype=real),
    ) -> real: ...

    @wp.func_native(ROW_PRODUCT.format(number="double", **layout))
    def summed_product(
        i: int,
        n: int,
        width: int,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        x: wp.array(dtype=real),
    ) -> wp.float64: ...

    @wp.func_native(ROW_PRODUCT.format(number="double", **layout))
    def exact_product(
        i: int,
        n: int,
        width: int,
        counts: wp.array(dtype=count_type),
        columns: Columns,
        values: Values,
        excess: wp.array(dtype=real),
        x: wp.array(dtype=wp.float64),
    ) -> wp.float64: ...

    return row_product, summed_product, exact_product


class Kernels(NamedTuple):
    """Kernels of a solver. Those over rows take `first, n, chunk`; those that `decide` one block of `LANES` threads."""

    prepare: Any
    decide_prepare: Any
    release: Any
    evaluate: Any
    decide_evaluate: Any
    search: Any
    product: Any
    decide_alpha: Any
    update: Any
    decide_update: Any
    decide_beta: Any
    bi_search: Any
    bi_product: Any
    decide_bi_alpha: Any
    half_update: Any
    bi_second: Any
    decide_omega: Any
    bi_update: Any
    decide_bi_update: Any
    solution_sum: Any
    decide_solution_mean: Any
    deliver: Any
    decide_end: Any


@functools.cache
def make_kernels(precision: str, row_list: bool, count_type: Any, wide: bool = False) -> Kernels:
    """Return the kernels of both solvers for a precision, a list layout and the integer type of `counts`.

    Names of arrays: rhs b, x start value and result, solution the float64 sum, residual r, scaled z = M r (at first
    weight / diagonal r), search p, product A p. BiCGSTAB: scaled and scaled2 are M p and M s, product and product2 their
    images, shadow the residual that it projects on.
    """
    real = types(2, precision).real
    store_sums, total_sums = make_sums(row_list)
    _, summed_product, exact_product = make_product(precision, row_list, count_type, wide)
    Columns = make_entry(row_list, wide).array
    list_begin, list_step, value_at, Values, _ = make_entry(row_list, wide, real)
    rounding, coupled = ROUNDING[precision], COUPLED[precision]
    reach2 = REACH[precision] ** 2
    kept2 = (UNIT[precision] / COUNTS) ** 2
    zero, one = wp.constant(wp.float64(0.0)), wp.constant(wp.float64(1.0))

    def kernel(function: Any) -> Any:
        return wp.kernel(function, module="unique", enable_backward=False)

    def sweep(function: Any) -> Any:
        options = dict(SWEEP_OPTIONS) if row_list else {}
        return wp.kernel(function, module="unique", enable_backward=False, module_options=options or None)

    # before the loop -------------------------------------------------------------------------------------------------

    @kernel
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
                total = zero
            excess[i] = real(total)
            inv = zero
            if d != zero:
                inv = one / d
            inverse[i] = real(inv)
            start = wp.float64(x[i])
            if int(counts[i]) == 0:
                if wp.isfinite(start):
                    start = wp.float64(rhs[i]) * inv
            else:
                rhs_total += wp.float64(rhs[i])
                rows += one
                # written so that a sum that is not a number is a coupling
                if not (wp.abs(total) <= wp.float64(wp.static(coupled)) * wp.abs(d)):
                    held += one
            solution[i] = start
            i += 1
        store_sums(t, rhs_total, rows, held, sums)

    @kernel
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
            mean = zero
            null = zero
            if total[1] > zero and (singular == 1 or total[2] == zero):
                null = one
                mean = total[0] / total[1]
            solve_state[SINGULAR] = null
            solve_state[RHS_MEAN] = mean
            solve_state[SOLUTION_MEAN] = zero
            solve_state[RESIDUAL_MEAN] = zero
            solve_state[ROWS] = wp.max(total[1], one)
            solve_state[ITERATIONS] = zero
            solve_state[RESTARTS] = zero
            solve_state[STRIKES] = zero
            solve_state[REPLACING] = zero
            solve_state[LAST2] = wp.float64(-1.0)

    @kernel
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
        if solve_state[SINGULAR] == zero:
            end = i
        while i < end:
            if int(counts[i]) > 0:
                excess[i] = real(0.0)
            i += 1

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

    @kernel
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
                bb = zero
            solve_state[RHS2] = bb
            last = solve_state[LAST2]
            tolerance = solve_state[TOLERANCE]
            goal = tolerance * tolerance * bb
            going = int(0)
            reason = int(CONVERGED)
            relative = zero
            if bb > zero:
                relative = wp.sqrt(rr / bb)
            strikes = solve_state[STRIKES]
            replacing = solve_state[REPLACING] > zero
            if last >= zero and not replacing:
                if rr > wp.float64(GAIN) * last:
                    strikes += one
                else:
                    strikes = zero
            if not wp.isfinite(rr) or not wp.isfinite(bb):
                reason = NOT_FINITE
                relative = rr
            elif bb == zero or rr <= goal:
                reason = CONVERGED
            elif solve_state[ITERATIONS] >= solve_state[LIMIT]:
                reason = OUT_OF_ITERATIONS
            elif strikes >= wp.float64(PATIENCE):
                reason = STALLED
            else:
                going = 1
                if last >= zero and not replacing:
                    solve_state[RESTARTS] = solve_state[RESTARTS] + one
            solve_state[STRIKES] = strikes
            solve_state[RESIDUAL] = relative
            solve_state[REASON] = wp.float64(reason)
            solve_state[LAST2] = rr
            solve_state[RESIDUAL2] = rr
            solve_state[RESIDUAL_MEAN] = zero
            if replacing:
                solve_state[FRESH] = zero
                if scaled_is_final == 1:
                    solve_state[BETA] = solve_state[BETA] * total[1] / solve_state[RHO]
                    solve_state[RHO] = total[1]
            else:
                solve_state[FRESH] = one
                solve_state[BETA] = zero
                solve_state[RHO] = total[1]
            solve_state[PEAK2] = rr
            solve_state[REPLACING] = zero
            solve_state[GOAL2] = wp.max(wp.float64(AIM) * goal, wp.float64(wp.static(reach2)) * rr)
            solve_flags[ACTIVE] = going
            solve_flags[RUNNING] = going

    # conjugate gradients ---------------------------------------------------------------------------------------------

    @sweep
    def cg_search(
        first: int,
        n: int,
        chunk: int,
        scaled: wp.array(dtype=real),
        search: wp.array(dtype=real),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        i = t * chunk
        end = wp.min(i + chunk, n)
        beta = real(solve_state[BETA])
        if solve_state[FRESH] > zero:
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
        store_sums(t, pq, zero, zero, sums)

    @kernel
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
            alpha = zero
            if total[0] > zero and solve_state[RHO] > zero:
                alpha = solve_state[RHO] / total[0]
            else:
                # matrix or preconditioner are not positive definite here: evaluate, and begin anew if that gains anything
                solve_flags[RUNNING] = 0
            solve_state[ALPHA] = alpha

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

    @kernel
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
            solve_state[ITERATIONS] = solve_state[ITERATIONS] + one
            solve_state[RESIDUAL2] = rr
            solve_state[FRESH] = zero
            if solve_state[SINGULAR] > zero:
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
                    solve_state[REPLACING] = one
            if scaled_is_final == 1:
                solve_state[BETA] = total[1] / solve_state[RHO]
                solve_state[RHO] = total[1]

    @kernel
    def decide_beta(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            rho = total[1]
            beta = zero
            if solve_state[FRESH] == zero and solve_state[RHO] != zero:
                beta = rho / solve_state[RHO]
            solve_state[BETA] = beta
            solve_state[RHO] = rho

    # BiCGSTAB --------------------------------------------------------------------------------------------------------

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
        fresh = solve_state[FRESH] > zero
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
        store_sums(t, sv, zero, zero, sums)

    @kernel
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
            if solve_state[FRESH] > zero:
                # the shadow is the residual itself
                solve_state[RHO] = solve_state[RESIDUAL2]
                solve_state[SHADOW2] = solve_state[RESIDUAL2]
            alpha = zero
            if total[0] != zero:
                alpha = solve_state[RHO] / total[0]
            if alpha == zero or not wp.isfinite(alpha):
                alpha = zero
                solve_flags[RUNNING] = 0
            solve_state[ALPHA] = alpha

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
        store_sums(t, ts, tt, zero, sums)

    @kernel
    def decide_omega(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            omega = zero
            if total[1] > zero:
                omega = total[0] / total[1]
            solve_state[OMEGA] = omega

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
        store_sums(t, rr, sr, zero, sums)

    @kernel
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
            solve_state[ITERATIONS] = solve_state[ITERATIONS] + one
            solve_state[RESIDUAL2] = rr
            solve_state[FRESH] = zero
            beta = zero
            omega = solve_state[OMEGA]
            old = solve_state[RHO]
            if omega != zero and old != zero:
                beta = (rho / old) * (solve_state[ALPHA] / omega)
            solve_state[BETA] = beta
            solve_state[RHO] = rho
            # residual and shadow orthogonal up to rounding, or no step: breakdown, a new shadow helps
            broken = rho * rho < wp.float64(1.0e-24) * rr * solve_state[SHADOW2] or omega == zero
            if not (rr > solve_state[GOAL2]) or broken or solve_state[ITERATIONS] >= solve_state[LIMIT]:
                solve_flags[RUNNING] = 0

    # after the loop --------------------------------------------------------------------------------------------------

    @kernel
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
        if solve_state[SINGULAR] == zero:
            end = i
        total = wp.float64(0.0)
        rows = wp.float64(0.0)
        while i < end:
            if int(counts[i]) > 0:
                total += solution[i]
                rows += one
            i += 1
        store_sums(t, total, rows, zero, sums)

    @kernel
    def decide_solution_mean(
        first: int,
        block_count: int,
        sums: wp.array(dtype=wp.vec3d),
        solve_state: wp.array(dtype=wp.float64),
    ):
        t = wp.tid() + first
        total = total_sums(t, block_count, sums)
        if t == 0:
            mean = zero
            if total[1] > zero:
                mean = total[0] / total[1]
            solve_state[SOLUTION_MEAN] = mean

    @kernel
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
        empty = solve_state[RHS2] == zero
        keep = int(solve_state[REASON]) == NOT_FINITE
        mean = solve_state[SOLUTION_MEAN]
        while i < end:
            value = solution[i]
            if int(counts[i]) > 0:
                value -= mean
            if empty:
                value = zero
            if not keep:
                solution[i] = value
                x[i] = real(value)
            i += 1

    @kernel
    def decide_end(solve_state: wp.array(dtype=wp.float64)):
        iterations = solve_state[ITERATIONS]
        if solve_state[RHS2] == zero:
            solve_state[RESIDUAL] = zero
        solve_state[SOLVES] = solve_state[SOLVES] + one
        solve_state[TOTAL_ITERATIONS] = solve_state[TOTAL_ITERATIONS] + iterations
        solve_state[WORST_ITERATIONS] = wp.max(solve_state[WORST_ITERATIONS], iterations)
        worst = solve_state[WORST_RESIDUAL]
        # a residual that is not a number stays the worst
        if not (solve_state[RESIDUAL] <= worst) and not wp.isnan(worst):
            solve_state[WORST_RESIDUAL] = solve_state[RESIDUAL]
        if int(solve_state[REASON]) != CONVERGED:
            solve_state[FAILURES] = solve_state[FAILURES] + one

    return Kernels(
        solve_prepare, decide_prepare, solve_release, solve_evaluate, decide_evaluate,
        cg_search, cg_product, decide_alpha, cg_update, decide_update, decide_beta,
        bi_search, bi_product, decide_bi_alpha, bi_half_update, bi_second, decide_omega, bi_update, decide_bi_update,
        solution_sum, decide_solution_mean, solve_deliver, decide_end,
    )  # fmt: skip
