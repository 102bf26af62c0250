"""Points of a sweep: grids, lists, and samples of ranges."""

from __future__ import annotations

import itertools
import math
import warnings
from typing import Any

import numpy as np

from warpsph.study.sweep_file import VARIANT, Parameter, Sweep


def points_of(sweep: Sweep) -> list[dict[str, Any]]:
    """The points of a sweep in the order of their runs, each the value of every parameter by its name.

    Where there are variants, all points of the first come first, with its name as `variant`.
    A grid turns the last parameter fastest. Samples are those of `scipy.stats.qmc`, scrambled by `seed`: the same
    seed gives the same points, and more samples of a Sobol sequence begin with those of fewer.
    """
    points = _plain_points(sweep)
    return [point | {VARIANT: name} for name in sweep.variants for point in points] if sweep.variants else points


def _plain_points(sweep: Sweep) -> list[dict[str, Any]]:
    """The points of the parameters alone."""
    names = list(sweep.parameters)
    if sweep.samples is None:
        columns = [_values(parameter) for parameter in sweep.parameters.values()]
        rows = zip(*columns, strict=True) if sweep.method == "list" else itertools.product(*columns)
        return [dict(zip(names, row, strict=True)) for row in rows]
    unit = _samples(sweep.method, len(names), sweep.samples, sweep.seed)
    ranges = list(sweep.parameters.items())
    return [
        {name: _within(parameter, float(share)) for (name, parameter), share in zip(ranges, row, strict=True)}
        for row in unit
    ]


def _samples(method: str, dimension: int, count: int, seed: int) -> np.ndarray:
    """Samples of the unit cube, (count, dimension)."""
    from scipy.stats import qmc

    if method == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(dimension, seed=seed).random(count))
    with warnings.catch_warnings():
        # Scipy warns where the number is no power of two: the first points of the sequence are wanted all the same.
        warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
        return np.asarray(qmc.Sobol(dimension, seed=seed).random(count))


def _values(parameter: Parameter) -> list[Any]:
    """The values of a parameter of a grid or list."""
    if parameter.values is not None:
        return list(parameter.values)
    assert parameter.number is not None
    return [_within(parameter, place / (parameter.number - 1)) for place in range(parameter.number)]


def _within(parameter: Parameter, share: float) -> float:
    """The value at a share of the way through a range, exact at both ends."""
    low, high = parameter.from_, parameter.to
    assert low is not None and high is not None
    if share in (0.0, 1.0):
        return high if share else low
    if parameter.spacing == "log":
        return math.exp((1.0 - share) * math.log(low) + share * math.log(high))
    return (1.0 - share) * low + share * high
