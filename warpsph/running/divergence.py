"""The particle at which a run diverged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from warpsph.kernels.core.params import LEAST_DENSITY

if TYPE_CHECKING:
    from warpsph.running.model import Model


def runaway_particle(model: Model, row: int) -> tuple[int, str, str, str, str]:
    """Return (id, position, quantity, value, cause) of the particle in a row: which quantity is at fault, and what it is."""
    identity = int(model.particles.get("particle_id")[row])
    velocity = model.particles.get("velocity")[row].astype(float)
    excess = float(model.particles.get("density_excess")[row])
    position = model.particles.get("position")[row].astype(float)
    speed = float(np.linalg.norm(velocity))
    most = model.most_excess(row)
    cause = f"Usual causes: {model.scheme.usual_causes}"
    known = model.scheme.fault(model.case, model.geometry, model.physics, model.particles, row)
    if not np.isfinite(position).all():
        quantity, value = "position", "not finite"
    elif not math.isfinite(speed):
        quantity, value = "velocity", "not finite"
    elif known is not None:
        quantity, value, cause = known
    elif not -LEAST_DENSITY < excess < most:  # nor is what is not finite
        limits = f", limits {-LEAST_DENSITY:g} and {most:.3g}" if math.isfinite(excess) else ""
        quantity, value = "density", f"rho/rho0 - 1 = {excess:.3g}{limits}"
    elif speed >= model.physics.runaway:
        quantity, value = "velocity", f"{speed:.4g} m/s, limit {model.physics.runaway:.4g} m/s"
    else:
        quantity, value = "acceleration", "not finite"
    return identity, _point(position), quantity, value, cause


def _point(position: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in position) + ")"
