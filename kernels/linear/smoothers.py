"""Jacobi sweeps and residuals on the grids of the multigrid preconditioner.

Products are taken in differences, (A x)_I = c_I x_I + sum_J A_IJ (x_J - x_I): the constant stays an exact null vector of a
closed system in any precision.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from warpsph.kernels.core.spec import types

from .decorators import make_sweep
from .levels import Level, make_layout

STENCIL = """
const int mx = {level}.nodes[0], my = {level}.nodes[1], mz = {level}.nodes[2];
const int ix = node % mx, iy = (node / mx) % my, iz = node / (mx * my);
const int lx = {level}.wrap[0] && ix == 0 ? mx - 1 : -1;
const int hx = {level}.wrap[0] && ix == mx - 1 ? 1 - mx : 1;
const int ly = ({level}.wrap[1] && iy == 0 ? my - 1 : -1) * mx;
const int hy = ({level}.wrap[1] && iy == my - 1 ? 1 - my : 1) * mx;
const int lz = ({level}.wrap[2] && iz == 0 ? mz - 1 : -1) * mx * my;
const int hz = ({level}.wrap[2] && iz == mz - 1 ? 1 - mz : 1) * mx * my;
const int at = {level}.node_base + node;
const auto *entry = stencil.data + {begin};
const size_t step = {step};
const auto *vector = x.data + at;
{more}
const auto own = {value_own};
auto total = entry[{centre} * step] * own;
{terms}
return total;
"""


def _stencil_code(dimension: int, row_list: bool, scaled: bool) -> str:
    """Return the C++ of (A x)_I of a node, or of (A D^-1 x)_I."""
    size = 3**dimension
    terms = []
    for slot in range(size):
        if slot == size // 2:
            continue
        parts = []
        for axis, name in enumerate("xyz"[:dimension]):
            side = slot // 3**axis % 3
            if side != 1:
                parts.append(("l" if side == 0 else "h") + name)
        place = " + ".join(parts)
        value = f"inv[{place}] * vector[{place}]" if scaled else f"vector[{place}]"
        terms.append(f"total += entry[{slot} * step] * ({value} - own);")
    return STENCIL.format(
        level="level",
        begin=f"(size_t)at * {size}" if row_list else f"(size_t)level.node_base * {size} + node",
        step="1" if row_list else "level.node_count",
        more="const auto *inv = node_inverse.data + at;" if scaled else "",
        value_own="inv[0] * vector[0]" if scaled else "vector[0]",
        centre=size // 2,
        terms="\n".join(terms),
    )


class Smoothers(NamedTuple):
    """`wp.func`s of one node, see `make_smoothers`."""

    first_sweeps: Any
    sweep: Any
    residual: Any


@functools.cache
def make_smoothers(dimension: int, precision: str, row_list: bool) -> Smoothers:
    """Return the `wp.func`s first_sweeps_of, sweep_of and residual_of."""
    real = types(dimension, precision).real

    @wp.func_native(_stencil_code(dimension, row_list, False))
    def stencil_product(level: Level, node: int, stencil: wp.array(dtype=real), x: wp.array(dtype=real)) -> real: ...

    @wp.func_native(_stencil_code(dimension, row_list, True))
    def scaled_product(
        level: Level,
        node: int,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        x: wp.array(dtype=real),
    ) -> real: ...

    @wp.func
    def first_sweeps_of(
        level: Level,
        node: int,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
    ):
        # two weighted Jacobi sweeps from zero: x = D^-1 ((v + w) b - v w A D^-1 b)
        at = level.node_base + node
        value = real(0.0)
        inverse = node_inverse[at]
        if inverse > real(0.0):
            image = scaled_product(level, node, stencil, node_inverse, node_rhs)
            v = real(level.weights[0])
            w = real(level.weights[1])
            value = inverse * ((v + w) * node_rhs[at] - v * w * image)
        node_x[at] = value

    @wp.func
    def sweep_of(
        level: Level,
        node: int,
        weight: real,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        source: wp.array(dtype=real),
        target: wp.array(dtype=real),
    ):
        at = level.node_base + node
        value = real(0.0)
        inverse = node_inverse[at]
        if inverse > real(0.0):
            rest = node_rhs[at] - stencil_product(level, node, stencil, source)
            value = source[at] + weight * inverse * rest
        target[at] = value

    @wp.func
    def residual_of(
        level: Level,
        node: int,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
        node_work: wp.array(dtype=real),
    ):
        at = level.node_base + node
        value = real(0.0)
        if node_inverse[at] > real(0.0):
            value = node_rhs[at] - stencil_product(level, node, stencil, node_x)
        node_work[at] = value

    return Smoothers(first_sweeps_of, sweep_of, residual_of)


@functools.cache
def make_grid_sweeps(dimension: int, precision: str, row_list: bool) -> tuple[Any, Any, Any]:
    """Return the kernels grid_first_sweeps, grid_residual and grid_sweep of one level."""
    real = types(dimension, precision).real
    listed = make_layout(dimension, row_list).listed
    first_sweeps_of, sweep_of, residual_of = make_smoothers(dimension, precision, row_list)
    sweep = make_sweep(row_list)

    @sweep
    def grid_first_sweeps(
        first: int,
        active_nodes: wp.array(dtype=int),
        level: Level,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
    ):
        node = listed(wp.tid() + first, level.node_base, active_nodes)
        first_sweeps_of(level, node, stencil, node_inverse, node_rhs, node_x)

    @sweep
    def grid_residual(
        first: int,
        active_nodes: wp.array(dtype=int),
        level: Level,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        node_x: wp.array(dtype=real),
        node_work: wp.array(dtype=real),
    ):
        node = listed(wp.tid() + first, level.node_base, active_nodes)
        residual_of(level, node, stencil, node_inverse, node_rhs, node_x, node_work)

    @sweep
    def grid_sweep(
        first: int,
        active_nodes: wp.array(dtype=int),
        level: Level,
        sweep_weight: real,
        stencil: wp.array(dtype=real),
        node_inverse: wp.array(dtype=real),
        node_rhs: wp.array(dtype=real),
        source: wp.array(dtype=real),
        target: wp.array(dtype=real),
    ):
        node = listed(wp.tid() + first, level.node_base, active_nodes)
        sweep_of(level, node, sweep_weight, stencil, node_inverse, node_rhs, source, target)

    return grid_first_sweeps, grid_residual, grid_sweep
