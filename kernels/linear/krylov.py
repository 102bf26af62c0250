"""Krylov solvers over an ELL matrix: conjugate gradients and BiCGSTAB with fused dot products.

Hestenes & Stiefel (1952) and van der Vorst (1992), preconditioned. Three things make single precision enough:

* The product is taken in differences, (A x)_i = e_i x_i + sum_k a_ik (x_k - x_i) with e_i = A_ii + sum_k a_ik, the row sum
  (`products`). A smooth x then loses nothing to cancellation, and the constant is an exact null vector of a closed system.
* The solution is summed up in float64, and every residual that is not a recurrence is evaluated in float64 (iterative
  refinement, `refinement`); search directions and residuals are vectors of the precision of the matrix.
* Dot products are float64 sums in a fixed order (`sums`). The result does not depend on the number of threads.

All decisions are taken on the device by kernels of one thread (block), which work on the float64 array `solve_state` and the
int32 array `solve_flags`, see `solve_state`.
"""

import functools
from typing import Any, NamedTuple

from .bicgstab import make_bi_decisions, make_bi_products, make_bi_updates
from .conjugate_gradients import make_cg_decisions, make_cg_sweeps
from .refinement import make_deliver, make_evaluate, make_prepare


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
    solve_prepare, decide_prepare, solve_release = make_prepare(precision, row_list, count_type, wide)
    solve_evaluate, decide_evaluate = make_evaluate(precision, row_list, count_type, wide)
    cg_search, cg_product, cg_update = make_cg_sweeps(precision, row_list, count_type, wide)
    decide_alpha, decide_update, decide_beta = make_cg_decisions(precision, row_list)
    bi_product, bi_second = make_bi_products(precision, row_list, count_type, wide)
    bi_search, bi_half_update, bi_update = make_bi_updates(precision, row_list)
    decide_bi_alpha, decide_omega, decide_bi_update = make_bi_decisions(row_list)
    solution_sum, decide_solution_mean, solve_deliver, decide_end = make_deliver(precision, row_list, count_type)
    return Kernels(
        solve_prepare, decide_prepare, solve_release, solve_evaluate, decide_evaluate,
        cg_search, cg_product, decide_alpha, cg_update, decide_update, decide_beta,
        bi_search, bi_product, decide_bi_alpha, bi_half_update, bi_second, decide_omega, bi_update, decide_bi_update,
        solution_sum, decide_solution_mean, solve_deliver, decide_end,
    )  # fmt: skip
