"""How the kernels of the linear solvers are compiled."""

from collections.abc import Callable
from typing import Any

import warp as wp

from warpsph.kernels.core.spec import SWEEP_OPTIONS


def exact_kernel(function: Any) -> Any:
    """Return the kernel of a function that has to be evaluated as it is written: decisions, null vectors."""
    return wp.kernel(function, module="unique", enable_backward=False)


def make_sweep(row_list: bool) -> Callable[[Any], Any]:
    """Return the decorator of sweeps over rows, cells or nodes; on a CPU (`row_list`) their sums may be reordered."""
    options = dict(SWEEP_OPTIONS) if row_list else None

    def sweep(function: Any) -> Any:
        return wp.kernel(function, module="unique", enable_backward=False, module_options=options)

    return sweep
