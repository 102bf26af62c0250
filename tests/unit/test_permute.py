"""Fields in a new order: every size of element, walls behind the fluid, several rounds, runs of a CPU and of a GPU."""

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.core import permute

FLUID, WALLS = 137, 11
TYPES = [wp.uint8, wp.int8, wp.int16, wp.float32, wp.int32, wp.vec2, wp.float64, wp.vec3, wp.vec2d, wp.vec3d, wp.mat33d]


def moved(arrays, bases, order, run):
    """Sort arrays on the CPU as a list build does."""
    copies = [wp.zeros(permute.aligned(array.capacity), dtype=wp.uint8, device="cpu") for array in arrays]
    columns = [permute.column(array, copy.ptr, base) for array, copy, base in zip(arrays, copies, bases, strict=True)]
    table = wp.array(columns, dtype=permute.Column, device="cpu")
    rows = max(array.shape[0] for array in arrays)
    for gathers in (True, False):
        inputs = [0, run, table, order]
        wp.launch(permute.make_permute(gathers), dim=(rows + run - 1) // run, inputs=inputs, device="cpu")


@pytest.mark.parametrize("run", sorted(permute.RUN.values()))
def test_elements_of_every_size_follow_the_order(run):
    rng = np.random.default_rng(5)
    fluid, walls = rng.permutation(FLUID), FLUID + rng.permutation(WALLS)
    order = wp.array(np.concatenate([fluid, walls]).astype(np.int32), dtype=int, device="cpu")
    arrays, bases, expected = [], [], []
    for dtype in TYPES:
        for rows, base in ((FLUID, 0), (WALLS, FLUID), (FLUID + WALLS, 0)):
            kind = wp.dtype_to_numpy(getattr(dtype, "_wp_scalar_type_", dtype))
            host = rng.integers(0, 100, (rows, *getattr(dtype, "_shape_", ()))).astype(kind)
            arrays.append(wp.array(host, dtype=dtype, device="cpu"))
            bases.append(base)
            expected.append(host[order.numpy()[base : base + rows] - base])
    moved(arrays, bases, order, run)
    for array, values in zip(arrays, expected, strict=True):
        np.testing.assert_array_equal(array.numpy(), values)


def test_elements_that_would_not_be_moved_are_refused():
    array = wp.zeros(3, dtype=wp.types.vector(length=3, dtype=wp.int16), device="cpu")
    with pytest.raises(ValueError, match="elements of 6 bytes"):
        permute.column(array, 0, 0)


def test_rounds_take_all_fields_in_turn_and_no_more_than_fits():
    sizes = [30, 30, 50, 200, 10, 90]
    assert permute.rounds(sizes, 100) == [[0, 1], [2], [3], [4, 5]]
    assert permute.rounds([], 100) == []
    assert permute.room([16, 32]) == 48
    assert permute.room([permute.BUFFER, 16]) == permute.BUFFER


def test_copies_start_where_any_element_may():
    assert [permute.aligned(size) for size in (0, 1, 16, 17)] == [0, 16, 16, 32]
