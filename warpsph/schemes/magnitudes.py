"""Numbers that a run cannot hold: inputs and what follows from them against the precision, the steps against the time.

Nothing here is a limit of taste. A number is refused because it, or a number that the kernels are given, is beyond what the
precision represents, or because time would stand still: its step could not be added to the end time in float64. The key that
is named is the most extreme one of those that may be to blame.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import CaseError, Problem

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry
    from warpsph.schemes.physics import Physics

MOST_STEPS = 2**52  # beyond them a step is lost when it is added to a time near the end, in float64
EXTREME = 9.0  # powers of ten from 1 at which an input, not the length of the run, is to blame for its steps
FASTEST = 10.0  # speeds up to so many times the speed of sound are told from a run that diverges

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


def _numbers(case: Any) -> list[Input]:
    """Return those inputs that are numbers other than zero."""
    return [(path, float(x)) for path, x in inputs(case) if isinstance(x, int | float) and x != 0]


def _limits(precision: str) -> tuple[float, float]:
    """Return the smallest and the largest number of a precision that keep all its digits."""
    held = np.finfo(precision)
    return float(held.tiny), float(held.max)


def _fits(value: float, precision: str, divisor: bool) -> bool:
    """Return whether a number is held; one that nothing is divided by may be so small that it counts as zero."""
    smallest, largest = _limits(precision)
    return math.isfinite(value) and abs(value) <= largest and (abs(value) >= smallest or not divisor)


def _range(precision: str) -> str:
    smallest, largest = _limits(precision)
    return f"precision {precision} holds {smallest:.2g} to {largest:.2g}"


def _remedy(value: float, precision: str, wide: bool) -> str:
    """Return the advice for an input; `wide`: float64 would hold what float32 does not."""
    advice = "write a smaller number in SI units" if abs(value) > 1 else "write a larger number in SI units"
    return f"{advice}, or precision: float64" if wide and precision == "float32" else advice


def check_inputs(case: Any, *_: Any) -> Iterator[Problem]:
    """Yield a problem for each number of a case that its precision does not hold."""
    precision = case.precision
    for path, value in _numbers(case):
        divisor = path.rpartition(".")[2] in DIVISORS
        if path not in TIMES and not _fits(value, precision, divisor):
            remedy = _remedy(value, precision, _fits(value, "float64", divisor))
            yield Problem(path, value, f"is beyond the numbers of the run ({_range(precision)})", remedy)


def _derived(case: Case, physics: Physics) -> Iterator[tuple[str, float, bool]]:
    """Yield (what it is, value, whether anything is divided by it) of what kernels are given or make of it at once."""
    d, h, spacing = case.dimension, physics.h, case.particle_spacing
    yield "volume of a particle [m^d]", spacing**d, True
    yield "gradient of the smoothing kernel [1/m^(d+2)]", h ** -(d + 2), True
    yield "square of the gravity [m^2/s^4]", sum(x * x for x in case.gravity), False
    yield "square of the body force [m^2/s^4]", sum(x * x for x in case.body_force), False
    for name, c in zip(case.phase_names, physics.sound_speed, strict=True):
        phase = case.phases[name]
        yield f"mass of a particle of {name} [kg]", phase.density * spacing**d, True
        yield f"kinematic viscosity of {name} over h^2 [1/s]", phase.viscosity / phase.density / h**2, False
        if physics.spec.scheme == "riemann":
            yield f"sound speed of {name} [m/s]", c, True
            yield f"stiffness of {name} [Pa]", phase.density * c**2, True
            yield f"compressibility of {name} [1/Pa]", 1.0 / (phase.density * c**2), True
            yield f"square of the largest speed of {name} [m^2/s^2]", (FASTEST * c) ** 2, True
    yield "jump of the surface tension at the smallest radius [Pa]", float(physics.tension.max(initial=0.0)) / h, False
    for name, value in physics.scales.items():
        yield f"scale of the {name}", value, False


def _most_extreme(case: Case) -> Input:
    """Return the input that is farthest from 1, in powers of ten."""
    return max(_numbers(case), key=lambda entry: abs(math.log10(abs(entry[1]))))


def _check_derived(case: Case, physics: Physics) -> Iterator[Problem]:
    """Yield the first derived number that the precision does not hold, and too many steps."""
    precision = case.precision
    path, value = _most_extreme(case)
    for what, number, divisor in _derived(case, physics):
        if not _fits(number, precision, divisor):
            told = what.replace(" [", f" {number:.3g} [", 1)
            rule = f"makes the {told}, beyond the numbers of the run ({_range(precision)})"
            yield Problem(path, value, rule, _remedy(value, precision, _fits(number, "float64", divisor)))
            return
    step = physics.estimated_step()
    if physics.spec.scheme == "isph":
        from warpsph.schemes.incompressible import expected_step

        step = expected_step(case, physics)
    if step > 0 and case.end_time / step <= MOST_STEPS:
        return
    steps = case.end_time / step if step > 0 else math.inf
    rule = f"makes a run of {steps:.3g} steps of {step:.3g} s, more than the {MOST_STEPS:.2g} that its time tells apart"
    if abs(math.log10(abs(value))) < EXTREME:
        path, value = "end_time", case.end_time
        yield Problem(path, value, rule, f"write at most {MOST_STEPS * step:.3g}")
        return
    yield Problem(path, value, rule, _remedy(value, precision, False))


def checked(derive: Callable[..., Physics]) -> Callable[..., Physics]:
    """Return `physics.derive` with the check of what it derives; numbers that break its arithmetic are told as well.

    The result raises CaseError.
    """

    @functools.wraps(derive)
    def with_check(case: Case, geometry: Geometry, *arguments: Any, **options: Any) -> Physics:
        try:
            with np.errstate(all="ignore"):
                physics = derive(case, geometry, *arguments, **options)
                problems = list(_check_derived(case, physics))
        except (OverflowError, ZeroDivisionError):
            path, value = _most_extreme(case)
            rule = "makes numbers that no computer holds (largest 1.8e+308)"
            raise CaseError([Problem(path, value, rule, _remedy(value, case.precision, False))]) from None
        if problems:
            raise CaseError(problems)
        return physics

    return with_check
