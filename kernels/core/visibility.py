"""Lines of sight at thin tails of bodies: what a particle sees past an edge, and what the body hides (theory: bodies#tails).

Near its edge a tail counts as the half plane from the edge into the body, in the middle between its two sides. A line of
sight from x_i to x_j either crosses it, and then enters the body on the side of x_i, or does not, and then what is at x_j is
on its own side. Each boundary particle of a tail belongs to the sheet of one side, and is seen through that side alone.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from .spec import types


class Sight(NamedTuple):
    """`wp.func`s of lines of sight at an edge.

    side_entered(x_i, x_j, edge, along, across): 1 or -1, the side from which x_i looks at x_j: +1 that of `across`.
    hidden(x_i, x_j, edge, along, across): whether the tail is between the two points.
    """

    side_entered: Any
    hidden: Any


@functools.cache
def make_sight(dimension: int, precision: str) -> Sight:
    """Return the functions for a dimension and precision; `along` and `across` are unit vectors at right angles."""
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def hidden(xi: vec, xj: vec, edge: vec, along: vec, across: vec):
        hi = wp.dot(xi - edge, across)
        hj = wp.dot(xj - edge, across)
        # The crossing is at ((x_i - edge).along |h_j| + (x_j - edge).along |h_i|) / (|h_i| + |h_j|) past the edge.
        past = wp.dot(xi - edge, along) * wp.abs(hj) + wp.dot(xj - edge, along) * wp.abs(hi)
        return hi * hj < real(0.0) and past < real(0.0)

    @wp.func
    def side_entered(xi: vec, xj: vec, edge: vec, along: vec, across: vec):
        h = wp.dot(xj - edge, across)
        if hidden(xi, xj, edge, along, across):
            h = -h
        side = int(1)
        if h < real(0.0):
            side = -1
        return side

    return Sight(side_entered, hidden)
