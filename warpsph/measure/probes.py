"""Fields at any point by SPH interpolation, on the host.

A moving-least-squares estimate from the fluid within the support radius: exact for a quadratic field, also next to a
wall; where fewer particles are near it falls back to a linear fit, then to the Shepard mean, and to NaN where the point
is outside the fluid.

Next to a wall all particles are on one side, and the fit is carried on beyond them to the wall. A quadratic is off by
1.7 times what single particles are off there, a linear fit (`degree` 1) by 1.0 times, at the price of the field's curvature.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpsph.snapshot import Snapshot


def sample(
    snapshot: Snapshot, points: np.ndarray, fields: Sequence[str], support: float, box: Sequence[float], degree: int = 2
) -> dict[str, np.ndarray]:
    """Return field name -> values at the points, (m,) or (m, dimension) for vectors.

    Args:
        snapshot: state; its fluid particles are used.
        points: (m, dimension) [m].
        fields: "velocity", "pressure", "density", "speed" or another field of the snapshot.
        support: radius of the weight, a Wendland C2 kernel [m].
        box: period of each axis [m], 0 where it is not periodic.
        degree: of the polynomial that is fitted, 2 or 1.
    """
    fluid = snapshot.fluid
    points = np.asarray(points, dtype=float).reshape(-1, snapshot.dimension)
    columns = {name: _values(fluid, name) for name in fields}
    stacked = np.column_stack([value.reshape(len(fluid), -1) for value in columns.values()])
    result = np.full((len(points), stacked.shape[1]), np.nan)
    for k, point in enumerate(points):
        result[k] = _at(point, fluid, stacked, support, box, degree)
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


def _at(
    point: np.ndarray, fluid: Snapshot, values: np.ndarray, support: float, box: Sequence[float], degree: int
) -> np.ndarray:
    # axis by axis, so that most particles are dropped after one comparison
    rows = np.arange(len(fluid))
    offsets: list[np.ndarray] = []
    for axis, period in enumerate(box):
        d = fluid.position[rows, axis] - point[axis]
        if period > 0:
            d -= period * np.round(d / period)
        near = np.abs(d) < support
        rows = rows[near]
        offsets = [offset[near] for offset in offsets] + [d[near]]
    if not len(rows):
        return np.full(values.shape[1], np.nan)
    d = np.column_stack(offsets)
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
            return np.asarray(np.linalg.solve(moment, right)[0])
    return np.asarray(right[0] / moment[0, 0])
