"""Vorticity of a picture's particles from their velocities alone, for particle files that do not hold it."""

from __future__ import annotations

import numpy as np


def vorticity(position: np.ndarray, velocity: np.ndarray, longest: float) -> np.ndarray:
    """Vorticity dv/dx - du/dy at the particles, (n,) [1/s]; nan where a particle has no neighbours.

    The velocity is linear on the triangles between neighbouring particles (Delaunay); a particle gets the mean over its
    triangles, weighted with their areas. Across a periodic side nothing is seen: there the mean is one-sided.

    position, velocity: (n, 2), m and m/s; longest: edge [m] from which on a triangle spans a gap and does not count.
    """
    from matplotlib.tri import Triangulation

    result = np.full(len(position), np.nan)
    usable = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1))
    if len(usable) < 3:
        return result
    x, u = np.asarray(position[usable], np.float64), np.asarray(velocity[usable], np.float64)
    try:
        corner = Triangulation(x[:, 0], x[:, 1]).triangles
    except (RuntimeError, ValueError):  # all particles on one line
        return result
    a, b = x[corner[:, 1]] - x[corner[:, 0]], x[corner[:, 2]] - x[corner[:, 0]]
    edge = np.max([np.hypot(*side.T) for side in (a, b, b - a)], axis=0)
    twice_area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    kept = (edge < longest) & (np.abs(twice_area) > 1e-6 * edge**2)
    corner, a, b, twice_area = corner[kept], a[kept], b[kept], twice_area[kept]
    du, dv = u[corner[:, 1]] - u[corner[:, 0]], u[corner[:, 2]] - u[corner[:, 0]]
    # times twice the area: dv/dx and du/dy of the plane through the three corners
    curl = (du[:, 1] * b[:, 1] - dv[:, 1] * a[:, 1]) - (dv[:, 0] * a[:, 0] - du[:, 0] * b[:, 0])
    curl *= np.sign(twice_area)
    total, weight = np.zeros(len(x)), np.zeros(len(x))
    for k in range(3):
        np.add.at(total, corner[:, k], curl)
        np.add.at(weight, corner[:, k], np.abs(twice_area))
    result[usable] = np.divide(total, weight, out=np.full(len(x), np.nan), where=weight > 0)
    return result
