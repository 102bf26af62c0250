"""Sums over the rows of a system, in an order that does not depend on the number of threads.

Dot products are float64 sums: a block of rows each (a stretch of rows on a CPU core, a thread block on a GPU), then one sum
over the blocks.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.block_sums import make_block_sums


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
        store_block, total_sums = make_block_sums(wp.vec3d, False)

        @wp.func
        def store_sums(t: int, a: wp.float64, b: wp.float64, c: wp.float64, sums: wp.array(dtype=wp.vec3d)):
            store_block(t, wp.vec3d(a, b, c), sums)

    return store_sums, total_sums
