"""Products of an ELL matrix and a vector, in differences: (A x)_i = e_i x_i + sum_k a_ik (x_k - x_i), e_i the row sum."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import make_entry
from warpsph.kernels.core.spec import types

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
