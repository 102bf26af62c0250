"""How accurate a linear solve can be."""

from __future__ import annotations


def attainable(precision: str) -> float:
    """Return the smallest relative residual |b - A x| / |b| that a solver of a precision may be asked for.

    It is meant for the float64 sum `LinearSolver.solution`, whose residual is evaluated in float64; a solve ends as
    "stalled" at about 1e-16 |A| |x| / |b|, 1e-16 times the condition of the scaled matrix. The result x in single precision
    is that sum rounded, and its own residual is up to 6e-8 |A| |x| / |b| larger (measured: 5e-5 for 40 k particles with a
    free surface, 4e-4 in a closed box): noise of 6e-8 of the largest pressure from one particle to the next.
    """
    return {"float32": 1.0e-10, "float64": 1.0e-12}[precision]
