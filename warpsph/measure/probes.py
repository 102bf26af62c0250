"""Fields at any point by SPH interpolation, on the host.

A moving-least-squares estimate from the fluid within the support radius: exact for a quadratic field, also next to a
wall; where fewer particles are near it falls back to a linear fit, then to the Shepard mean, and to NaN where the point
is outside the fluid.

Next to a wall all particles are on one side, and the fit is carried on beyond them to the wall. A quadratic is off by
1.7 times what single particles are off there, a linear fit (`degree` 1) by 1.0 times, at the price of the field's curvature.

Across a shock a fit swings beyond what it was fitted to, below zero ahead of a strong one. Where particles have smoothing
lengths of their own, as those of a gas with shocks have, a value stays in the range of the particles around the point.
That costs a smooth field an error of second order, at its extremes. At an edge, with particles on one side alone, the
range is wider by what a linear field changes on the way from the nearest particle to the point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from warpsph.snapshot import Snapshot


def sample(
    snapshot: Snapshot, points: np.ndarray, fields: Sequence[str], support: float, box: Sequence[float], degree: int = 2,
    reach: float | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Return field name -> values at the points, (m,) or (m, dimension) for vectors.

    Args:
        snapshot: state; its fluid particles are used.
        points: (m, dimension) [m].
        fields: "velocity", "pressure", "density", "speed" or another field of the snapshot.
        support: radius of the weight, a Wendland C2 kernel [m].
        box: period of each axis [m], 0 where it is not periodic.
        degree: of the polynomial that is fitted, 2 or 1.
        reach: support radius over the smoothing length of a particle, where each has its own (`own["smoothing"]`): a point
            then has the support of the particle that is nearest to it, and values are bounded.
    """
    from scipy.spatial import cKDTree

    fluid = snapshot.fluid
    fluid = fluid.select(np.isfinite(fluid.position).all(axis=1))
    points = np.asarray(points, dtype=float).reshape(-1, snapshot.dimension)
    columns = {name: _values(fluid, name) for name in fields}
    stacked = np.column_stack([value.reshape(len(fluid), math.prod(value.shape[1:])) for value in columns.values()])
    period = np.asarray(box, dtype=float)
    tree = cKDTree(_into(fluid.position, period), boxsize=period, balanced_tree=False, compact_nodes=False)
    supports = np.full(len(points), support)
    if reach is not None and len(fluid):
        supports = reach * fluid.own["smoothing"][tree.query(_into(points, period))[1]].astype(float)
    near = tree.query_ball_point(_into(points, period), supports, return_sorted=True)
    result = np.full((len(points), stacked.shape[1]), np.nan)
    for k, (point, rows) in enumerate(zip(points, near, strict=True)):
        near_rows = np.asarray(rows, dtype=np.int64)
        result[k] = _at(point, fluid, stacked, near_rows, float(supports[k]), period, degree, reach is not None)
    out: dict[str, np.ndarray] = {}
    place = 0
    for name, value in columns.items():
        width = 1 if value.ndim == 1 else value.shape[1]
        block = result[:, place : place + width]
        out[name] = block[:, 0] if value.ndim == 1 else block
        place += width
    return out


def _values(fluid: Snapshot, name: str) -> np.ndarray:
    if name == "speed":
        return np.asarray(np.linalg.norm(fluid.velocity, axis=1))
    value = getattr(fluid, name, None)
    if not isinstance(value, np.ndarray):
        raise KeyError(f"no field {name!r} to interpolate")
    return np.asarray(value, dtype=float)


def _into(position: np.ndarray, period: np.ndarray) -> np.ndarray:
    """Positions (n, dimension) moved to between 0 and the period of each axis that has one [m]."""
    wraps = period > 0
    length = np.where(wraps, period, 1.0)
    inside = np.mod(position, length)
    inside[inside >= length] = 0.0  # what rounding takes to the period itself
    return np.where(wraps, inside, position)


def _at(
    point: np.ndarray,
    fluid: Snapshot,
    values: np.ndarray,
    rows: np.ndarray,
    support: float,
    period: np.ndarray,
    degree: int,
    bounded: bool,
) -> np.ndarray:
    """The fields (columns of `values`) at a point, from the particles in `rows`, which are those within the support."""
    d = fluid.position[rows] - point
    d -= np.where(period > 0, period * np.round(d / np.where(period > 0, period, 1.0)), 0.0)
    q = np.linalg.norm(d, axis=1) / support
    inside = q < 1.0
    d, q, rows = d[inside], q[inside], rows[inside]
    if not len(rows):
        return np.full(values.shape[1], np.nan)
    weight = (1.0 - q) ** 4 * (1.0 + 4.0 * q) * fluid.volume[rows]
    s = d / support
    first, second = np.triu_indices(s.shape[1])
    # quadratic where the neighbourhood allows, else linear: a linear fit is off by the curvature of the field
    full = np.column_stack([np.ones(len(rows)), s, s[:, first] * s[:, second]])
    linear = full[:, : 1 + s.shape[1]]
    for basis in (full, linear) if degree == 2 else (linear,):
        moment = basis.T @ (weight[:, None] * basis)
        right = basis.T @ (weight[:, None] * values[rows])
        if len(rows) > 1.5 * len(moment) and np.linalg.cond(moment) < 1.0e6:
            found = np.asarray(np.linalg.solve(moment, right)[0])
            return _bounded(found, values[rows], s) if bounded else found
    return np.asarray(right[0] / moment[0, 0])


def _bounded(found: np.ndarray, values: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Fields (k,) of a point, held to the range of those of the particles (n, k) at s (n, dimension) from it."""
    low, high = values.min(axis=0), values.max(axis=0)
    one_sided = (s > 0.0).all(axis=0) | (s < 0.0).all(axis=0)
    share = np.abs(s).min(axis=0) / np.maximum(np.ptp(s, axis=0), 1.0e-12)
    room = min(float(share[one_sided].sum()), 1.0) * (high - low)
    return np.asarray(np.clip(found, low - room, high + room))
