"""Lyapunov exponents of the particles of a run, as outputs want them (theory: lyapunov#windows)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpsph.kernels.core.forward_map import make_forward, make_seeds
from warpsph.kernels.core.origins import NEXT, SLOT, TURN_SIZE
from warpsph.kernels.core.spec import types_of
from warpsph.schemes.map_stages import EXPONENTS

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.kernels.core.spec import Spec
    from warpsph.running.model import Model

KEPT = ("window_start", "window_turn")
"""arrays beside the fields that a restart goes on from"""
GRID_CELLS = 128  # along each axis of the search among the places of the start, which repeats beyond


def window_values(case: Case, spec: Spec, device: Any) -> dict[str, Any]:
    """Return what the stages of the windows read and write, by kernel argument; nothing where nobody asks for exponents."""
    lyapunov = case.output.lyapunov
    if lyapunov is None:
        return {}
    turn = np.zeros(TURN_SIZE, dtype=np.int32)
    turn[NEXT], turn[SLOT] = 1, -1
    return {
        "window_period": wp.float64(lyapunov.window / lyapunov.starts),
        "window_start": wp.zeros(lyapunov.starts, dtype=wp.float64, device=device),
        "window_turn": wp.array(turn, dtype=int, device=device),
    }


def find_exponents(model: Model) -> None:
    """Write the exponents of the oldest window, and age and way of each particle in it, into their fields."""
    model.stepper.measure(EXPONENTS)
    lyapunov = model.case.output.lyapunov
    if lyapunov is not None and "forward" in lyapunov.direction:
        _find_forward(model)


def _find_forward(model: Model) -> None:
    """Write the forward exponents: a search among the places that particles had at the start of the window."""
    particles, spec, device = model.particles, model.physics.spec, model.device
    rows = particles.fluid_count
    if rows == 0:
        return
    real, vec, _, _ = types_of(spec)
    seeds = {
        "seed_point": wp.empty(rows, dtype=wp.vec3, device=device),
        "seed": wp.empty(rows, dtype=vec, device=device),
        "seed_now": wp.empty(rows, dtype=vec, device=device),
        "seed_weight": wp.empty(rows, dtype=real, device=device),
    }
    bindings = model.stepper.bindings
    model.launcher.task("seeds", make_seeds(spec), rows, bindings, special=seeds).run()
    depth = GRID_CELLS if spec.dimension == 3 else 1
    search = wp.HashGrid(GRID_CELLS, GRID_CELLS, depth, device=device)
    reach = model.physics.support
    search.build(seeds["seed_point"], reach)
    special = {**seeds, "search": wp.uint64(search.id), "reach": wp.float32(reach)}
    model.launcher.task("forward_exponent", make_forward(spec), rows, bindings, special=special).run()
    wp.synchronize_device(device)  # the search lives as long as this
