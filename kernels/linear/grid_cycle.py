"""Multigrid preconditioner for systems of particles: background grids, their operators, and the cycle.

The unknowns are particles a with an ELL matrix of weights w_ab = -a_ab >= 0 and couplings d_a = A_aa - sum_b w_ab to what
is not in the system (pressure 0 at a free surface), so that
    x.A x = 1/2 sum_ab w_ab (x_a - x_b)^2 + sum_a d_a x_a^2.
Grid functions phi_I are (bi/tri)linear on a background grid. Operators: `elements`; where things lie: `levels`; sweeps:
`smoothers`; from grid to grid: `transfer`, and between particles and the finest grid: `particle_grid`.

Where a free surface passes through the middle of cells, the couplings d_a hold the sum of the nodes on both sides, not
their difference, which is the slope there. Jacobi sweeps take that out slowly, the slower the wider the cells: d_a counts
H/dx times as much as the gradient. So levels of wide cells get more pairs of sweeps, and the coarsest is solved exactly.
"""

import functools
from typing import Any, NamedTuple

from .elements import make_elements, make_grid_keys, make_operators
from .particle_grid import make_gather, make_particle_sweeps, make_spread
from .small_levels import make_small_cycle, make_small_setup
from .smoothers import make_grid_sweeps
from .transfer import make_transfer_sweeps


class Kernels(NamedTuple):
    """Kernels of the preconditioner, see `make_kernels`."""

    keys: Any
    ranges: Any
    elements: Any
    coarse_elements: Any
    stencils: Any
    small_setup: Any
    residual: Any
    collect: Any
    gather: Any
    spread: Any
    smooth: Any
    first_sweeps: Any
    grid_residual: Any
    restrict_residual: Any
    prolong: Any
    sweep: Any
    small_cycle: Any


@functools.cache
def make_kernels(dimension: int, precision: str, row_list: bool, count_type: Any, wide: bool = False) -> Kernels:
    """Return the kernels for a dimension (2 or 3), a precision, the layout of the matrix and the integer type of its counts.

    Set-up: keys and ranges (cell index of the particles, around a radix sort), elements, coarse_elements and stencils (one
    level a launch), small_setup (all small levels by one block). Cycle: residual, collect and gather (to the grid),
    first_sweeps, grid_residual, restrict_residual, prolong, sweep (one level a launch), small_cycle (all small levels),
    spread (to the particles), smooth.
    """
    grid_keys, grid_ranges = make_grid_keys(dimension, precision, count_type)
    grid_elements = make_elements(dimension, precision, row_list)
    grid_coarse_elements, grid_stencils = make_operators(dimension, precision, row_list)
    grid_small_setup = make_small_setup(dimension, precision, row_list)
    particle_residual, particle_smooth = make_particle_sweeps(precision, row_list, count_type, wide)
    grid_collect, grid_gather = make_gather(dimension, precision, row_list)
    particle_spread = make_spread(dimension, precision, row_list, count_type)
    grid_first_sweeps, grid_residual, grid_sweep = make_grid_sweeps(dimension, precision, row_list)
    grid_restrict, grid_prolong = make_transfer_sweeps(dimension, precision, row_list)
    grid_small_cycle = make_small_cycle(dimension, precision, row_list)
    return Kernels(
        grid_keys, grid_ranges, grid_elements, grid_coarse_elements, grid_stencils, grid_small_setup,
        particle_residual, grid_collect, grid_gather, particle_spread, particle_smooth,
        grid_first_sweeps, grid_residual, grid_restrict, grid_prolong, grid_sweep, grid_small_cycle,
    )  # fmt: skip
