"""Inputs that the precision of a run cannot hold. Nothing here is a limit of taste; see also `scene/feasibility.py`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from warpsph.errors import Problem

DIVISORS = ("particle_spacing", "density", "sound_speed")  # last parts of inputs that may not be rounded to zero
TIMES = ("end_time", "numerics.maximum_step")  # kept in float64 whatever the precision

Input = tuple[str, float]


def inputs(case: Any) -> Iterator[Input]:
    """Yield (path, value) of the numbers of a case that decide what is computed, in SI units."""
    yield "particle_spacing", case.particle_spacing
    yield "end_time", case.end_time
    for end in ("lower", "upper"):
        yield from ((f"domain.{end}.{k}", x) for k, x in enumerate(getattr(case.domain, end)))
    for name in ("gravity", "body_force"):
        yield from ((f"{name}.{k}", x) for k, x in enumerate(getattr(case, name)))
    if case.central_force is not None:
        yield "central_force.rate", case.central_force.rate
    for name, phase in case.phases.items():
        for key in ("density", "viscosity", "sound_speed", "background_pressure"):
            yield f"phases.{name}.{key}", getattr(phase, key)
    for k, pair in enumerate(case.surface_tension):
        yield f"surface_tension.{k}.coefficient", pair.coefficient
    for key in ("velocity", "length", "pressure"):
        yield f"scales.{key}", getattr(case.scales, key)
    if case.numerics.maximum_step is not None:
        yield "numerics.maximum_step", case.numerics.maximum_step
    for axis in "xyz"[: case.dimension]:
        sides = getattr(case.domain.boundary, axis)
        for end in ("lower", "upper"):
            for k, x in enumerate(getattr(sides, end).velocity or ()):
                yield f"domain.boundary.{axis}.{end}.velocity.{k}", x


def numbers(case: Any) -> list[Input]:
    """Return those inputs that are numbers other than zero."""
    return [(path, float(x)) for path, x in inputs(case) if isinstance(x, int | float) and x != 0]


def limits_of(precision: str) -> tuple[float, float]:
    """Return the smallest and the largest number of a precision that keep all its digits."""
    held = np.finfo(precision)
    return float(held.tiny), float(held.max)


def fits(value: float, precision: str, divisor: bool) -> bool:
    """Return whether a number is held; one that nothing is divided by may be so small that it counts as zero."""
    smallest, largest = limits_of(precision)
    return math.isfinite(value) and abs(value) <= largest and (abs(value) >= smallest or not divisor)


def range_of(precision: str) -> str:
    smallest, largest = limits_of(precision)
    return f"precision {precision} holds {smallest:.2g} to {largest:.2g}"


def remedy_for(value: float, precision: str, wide: bool) -> str:
    """Return the advice for an input; `wide`: float64 would hold what float32 does not."""
    advice = "write a smaller number in SI units" if abs(value) > 1 else "write a larger number in SI units"
    return f"{advice}, or precision: float64" if wide and precision == "float32" else advice


def check_inputs(case: Any, *_: Any) -> Iterator[Problem]:
    """Yield a problem for each number of a case that its precision does not hold."""
    precision = case.precision
    for path, value in numbers(case):
        divisor = path.rpartition(".")[2] in DIVISORS
        if path not in TIMES and not fits(value, precision, divisor):
            remedy = remedy_for(value, precision, fits(value, "float64", divisor))
            yield Problem(path, value, f"is beyond the numbers of the run ({range_of(precision)})", remedy)


def most_extreme(case: Any) -> Input:
    """Return the input that is farthest from 1, in powers of ten."""
    return max(numbers(case), key=lambda entry: abs(math.log10(abs(entry[1]))))
