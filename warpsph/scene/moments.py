"""The first moments of a fitted start: each fluid has not only its volume, but has it where the case puts it.

Rows along an interface and even spacing elsewhere are reached by steps that a particle takes with its neighbours, and waves
that are much longer than a spacing hardly feel them. They leave a little too much fluid here and too little there, 1e-4 of
it: over a column of many spacings that is a hundredth of a spacing, which the interface has to give back as soon as the
fluid evens out (theory: riemann#start).

Measured with cosines along each axis. A particle stands for an interval of a spacing: sum_i V_i cos(k x_i) sin(k dx/2)/
(k dx/2) is the integral of cos(k x) over a region, for a lattice exactly.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

__all__ = ["moment_shift"]

SHORTEST = 16.0
"""Least wavelength, in spacings: forty iterations of the packing even out shorter ones."""

MODES = 8
"""Most harmonics along an axis, what bounds the work."""

LEAST = 0.05
"""Singular values below this share of the largest are left alone: cosines that a small region cannot tell apart."""

BATCH = 1 << 18
"""Particles at a time."""

FARTHEST = 0.1
"""Most that a particle is moved, in spacings: a region that needs more is too thin for its cells."""


def moment_shift(
    place: NDArray[np.float64],
    volume: NDArray[np.float64],
    region: NDArray[np.intp],
    profiles: list[NDArray[np.float64]],
    count: tuple[int, ...],
    periodic: tuple[bool, ...],
) -> NDArray[np.float64]:
    """Return the way (n, d), in lattice cells, that gives each region its moments along each axis.

    Args:
        place: (n, d), of the particles, in cells from the lower corner of the domain.
        volume: (n,), of the particles, in cells.
        region: (n,), the region of each.
        profiles: for each axis the volume of each region along it, in cells: (regions, bins), bins of equal width.
        count: cells of the domain along each axis.
        periodic: of each axis.
    """
    way = np.zeros_like(place)
    for name in np.unique(region):
        own = region == name
        for axis, amounts in enumerate(profiles):
            way[own, axis] = _along(place[own, axis], volume[own], amounts[name], count[axis], periodic[axis])
    return way


def _along(
    x: NDArray[np.float64], volume: NDArray[np.float64], amount: NDArray[np.float64], count: int, periodic: bool
) -> NDArray[np.float64]:
    """The way (n,) of the particles of one region along an axis of `count` cells that gives them the moments of `amount`."""
    waves = _wave_numbers(count, periodic)
    way: NDArray[np.float64] = np.zeros_like(x)
    if not len(waves):
        return way
    bin_width = count / len(amount)
    middles = bin_width * np.arange(0.5, len(amount))
    wanted = _cosines(middles, waves, bin_width, count, periodic)[0] @ amount
    found = np.zeros_like(wanted)
    change = np.zeros((len(wanted), len(wanted)))
    for part in _parts(len(x)):
        value, slope, mover = _cosines(x[part], waves, 1.0, count, periodic)
        found += value @ volume[part]
        change += (slope * volume[part]) @ mover.T
    amplitude = np.linalg.lstsq(change, wanted - found, rcond=LEAST)[0]
    for part in _parts(len(x)):
        way[part] = amplitude @ _cosines(x[part], waves, 1.0, count, periodic)[2]
    np.multiply(way, FARTHEST / max(float(np.abs(way).max()), FARTHEST), out=way)
    return way


def _wave_numbers(count: int, periodic: bool) -> NDArray[np.float64]:
    """Wave numbers 2 pi/wavelength, per cell, of the cosines along an axis of `count` cells."""
    first = (2.0 if periodic else 1.0) * math.pi / count
    most = min(MODES, math.floor(2.0 * math.pi / (SHORTEST * first)))
    return np.linspace(first, most * first, most)


def _cosines(
    x: NDArray[np.float64], waves: NDArray[np.float64], width: float, count: int, periodic: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Mean of each cosine over an interval of `width` about x, its slope, and the ways that change it, all (modes, n).

    A closed axis has cosines alone, whose ways end at the rows beside its sides; a periodic one has sines too.
    """
    angle = waves[:, None] * x
    cosine, sine = np.cos(angle), np.sin(angle)
    share = np.sinc(0.5 * waves * width / math.pi)[:, None]
    slope = share * waves[:, None]
    if not periodic:
        between_rows = waves * (count / (count - 1.0))
        return share * cosine, -slope * sine, np.sin(between_rows[:, None] * (x - 0.5))
    return (
        np.concatenate([share * cosine, share * sine]),
        np.concatenate([-slope * sine, slope * cosine]),
        np.concatenate([sine, cosine]),
    )


def _parts(n: int) -> Iterator[slice]:
    """Slices of n that make batches."""
    for start in range(0, n, BATCH):
        yield slice(start, start + BATCH)
