"""Float64 sums over particles, in an order that does not depend on the number of threads.

A block of particles each, a stretch of them on a CPU core and a thread block on a GPU, then one sum over the blocks.
"""

import functools
from typing import Any

import warp as wp

LANES = 256
"""Threads of a block on a GPU; launches of kernels that add up over a block count on it."""

FOLDS = 64
"""Groups of blocks on a CPU: partial sums of groups round less than one long sum."""


@functools.cache
def make_block_sums(dtype: Any, row_list: bool) -> tuple[Any, Any]:
    """Return the `wp.func`s (store_block(t, value, sums), total_of_blocks(t, block_count, sums)) of sums of a vector type.

    Row lists (CPU): t is a block of particles and `value` its sum; one thread totals. Else (GPU): t is a thread, all
    threads of its block call either function, and the total is known to all `LANES` threads of one block.
    """
    size = dtype._length_

    if row_list:

        @wp.func
        def store_block(t: int, value: dtype, sums: wp.array(dtype=dtype)):
            sums[t] = value

        @wp.func
        def total_of_blocks(t: int, block_count: int, sums: wp.array(dtype=dtype)):
            total = dtype()
            for fold in range(FOLDS):
                part = dtype()
                k = int(fold)
                while k < block_count:
                    part += sums[k]
                    k += FOLDS
                total += part
            return total

    else:

        @wp.func
        def store_block(t: int, value: dtype, sums: wp.array(dtype=dtype)):
            block = dtype()
            for entry in range(wp.static(size)):
                part = wp.tile_sum(wp.tile(value[entry]))
                block[entry] = part[0]
            if t % wp.block_dim() == 0:
                sums[t / wp.block_dim()] = block

        @wp.func
        def total_of_blocks(t: int, block_count: int, sums: wp.array(dtype=dtype)):
            own = dtype()
            k = int(t)
            while k < block_count:
                own += sums[k]
                k += wp.block_dim()
            total = dtype()
            for entry in range(wp.static(size)):
                part = wp.tile_sum(wp.tile(own[entry]))
                total[entry] = part[0]
            return total

    return store_block, total_of_blocks
