"""Least-squares fits of a quadratic about a point: through the value known there, or for the value there."""

import functools
from typing import Any, NamedTuple

import warp as wp

from .spec import types

LEAST_PIVOT = 1.0e-3  # of a diagonal entry that elimination may leave: below it the points do not tell the terms apart


class Quadratic(NamedTuple):
    """Parts of the fit of u = sum_a c_a r_a + sum_(a<=b) c_ab r_a r_b.

    Attributes:
        terms: their number, d + d (d+1)/2.
        basis: `wp.func` basis(r), the terms at r, a vector.
        vector, square, sides: types of a vector of terms, of the normal matrix, and of its right-hand sides.
        solve: `wp.func` solve(normal, right) -> (found, coefficients): the first d rows are the slopes.
        value: `wp.func` value(normal, first, weight, right, total) -> (found, value): of u at r = 0 where it is not known,
            from the weighted sums of basis (x) basis, of the basis, of 1, of u basis and of u.
    """

    terms: int
    basis: Any
    vector: Any
    square: Any
    sides: Any
    solve: Any
    value: Any


@functools.cache
def make_quadratic(dimension: int) -> Quadratic:
    """Return the fit for a dimension; computed in float64, of r over a length like their spread."""
    _, vec, _, _ = types(dimension, "float64")
    terms = dimension + dimension * (dimension + 1) // 2
    vector = wp.types.vector(length=terms, dtype=wp.float64)
    square = wp.types.matrix(shape=(terms, terms), dtype=wp.float64)
    sides = wp.types.matrix(shape=(terms, dimension), dtype=wp.float64)

    @wp.func
    def basis(r: vec):
        result = vector()
        place = int(dimension)
        for a in range(wp.static(dimension)):
            result[a] = r[a]
            for b in range(a, wp.static(dimension)):
                result[place] = r[a] * r[b]
                place += 1
        return result

    @wp.func
    def solve(normal: square, right: sides):
        n = int(terms)  # a variable: loops over a constant would be unrolled into terms^3 statements
        d = int(dimension)
        m = normal
        x = right
        found = bool(True)
        for k in range(n):
            pivot = m[k, k]
            if not (pivot > wp.float64(LEAST_PIVOT) * normal[k, k]):
                found = bool(False)
            else:
                for row in range(k + 1, n):
                    factor = m[row, k] / pivot
                    for column in range(k, n):
                        m[row, column] = m[row, column] - factor * m[k, column]
                    for column in range(d):
                        x[row, column] = x[row, column] - factor * x[k, column]
        if found:
            for back in range(n):
                k = n - 1 - back
                for column in range(d):
                    total = x[k, column]
                    for other in range(k + 1, n):
                        total = total - m[k, other] * x[other, column]
                    x[k, column] = total / m[k, k]
        return found, x

    @wp.func
    def value(normal: square, first: vector, weight: wp.float64, right: vector, total: wp.float64):
        # the terms less their means, and u less its own: what is left has no constant
        inv = wp.float64(1.0) / weight
        columns = sides()  # the first alone counts
        for a in range(int(terms)):
            columns[a, 0] = right[a] - first[a] * (total * inv)
        found, x = solve(normal - wp.outer(first, first * inv), columns)
        result = total * inv
        for a in range(int(terms)):
            result -= x[a, 0] * (first[a] * inv)
        return found, result

    return Quadratic(terms, basis, vector, square, sides, solve, value)
