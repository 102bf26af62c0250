"""What a run cannot hold of what follows from its inputs: numbers against the precision, steps against the time.

Nothing here is a limit of taste. A number is refused because it is beyond what the precision represents, or because time
would stand still: its step could not be added to the end time in float64. The key that is named is the most extreme one of
those that may be to blame.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from warpsph.case.magnitudes import fits, most_extreme, range_of, remedy_for
from warpsph.errors import CaseError, Problem
from warpsph.scene.forcing import forcing_of

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics

MOST_STEPS = 2**52  # beyond them a step is lost when it is added to a time near the end, in float64
EXTREME = 9.0  # powers of ten from 1 at which an input, not the length of the run, is to blame for its steps
FASTEST = 10.0  # speeds up to so many times the speed of sound are told from a run that diverges


def _derived(case: Case, physics: Physics) -> Iterator[tuple[str, float, bool]]:
    """Yield (what it is, value, whether anything is divided by it) of what kernels are given or make of it at once."""
    d, h, spacing = case.dimension, physics.h, case.particle_spacing
    yield "volume of a particle [m^d]", spacing**d, True
    yield "gradient of the smoothing kernel [1/m^(d+2)]", h ** -(d + 2), True
    forcing = forcing_of(case)
    for what, vector in (("gravity", forcing.gravity), ("body force", forcing.body_force)):
        yield f"square of the {what} [m^2/s^4]", float(sum(x * x for x in forcing.largest(vector))), False
    for name, c in zip(case.phase_names, physics.sound_speed, strict=True):
        phase = case.phases[name]
        yield f"mass of a particle of {name} [kg]", phase.density * spacing**d, True
        yield f"kinematic viscosity of {name} over h^2 [1/s]", phase.viscosity / phase.density / h**2, False
        if physics.acoustic > 0.0:
            yield f"sound speed of {name} [m/s]", c, True
            yield f"stiffness of {name} [Pa]", phase.density * c**2, True
            yield f"compressibility of {name} [1/Pa]", 1.0 / (phase.density * c**2), True
            yield f"square of the largest speed of {name} [m^2/s^2]", (FASTEST * c) ** 2, True
    yield "jump of the surface tension at the smallest radius [Pa]", float(physics.tension.max(initial=0.0)) / h, False
    for name, value in physics.scales.items():
        yield f"scale of the {name}", value, False


def _check_derived(case: Case, physics: Physics) -> Iterator[Problem]:
    """Yield the first derived number that the precision does not hold, and too many steps."""
    precision = case.precision
    path, value = most_extreme(case)
    for what, number, divisor in _derived(case, physics):
        if not fits(number, precision, divisor):
            told = what.replace(" [", f" {number:.3g} [", 1)
            rule = f"makes the {told}, beyond the numbers of the run ({range_of(precision)})"
            yield Problem(path, value, rule, remedy_for(value, precision, fits(number, "float64", divisor)))
            return
    step = physics.estimated_step()
    if step > 0 and case.end_time / step <= MOST_STEPS:
        return
    steps = case.end_time / step if step > 0 else math.inf
    rule = f"makes a run of {steps:.3g} steps of {step:.3g} s, more than the {MOST_STEPS:.2g} that its time tells apart"
    if abs(math.log10(abs(value))) < EXTREME:
        path, value = "end_time", case.end_time
        yield Problem(path, value, rule, f"write at most {MOST_STEPS * step:.3g}")
        return
    yield Problem(path, value, rule, remedy_for(value, precision, False))


def checked(derive: Callable[..., Physics]) -> Callable[..., Physics]:
    """Return the derivation of a scheme with the check of what it derives; numbers that break its arithmetic are told too.

    The result raises CaseError.
    """

    @functools.wraps(derive)
    def with_check(case: Case, geometry: Geometry, row_list: bool) -> Physics:
        try:
            with np.errstate(all="ignore"):
                physics = derive(case, geometry, row_list)
                problems = list(_check_derived(case, physics))
        except (OverflowError, ZeroDivisionError):
            path, value = most_extreme(case)
            rule = "makes numbers that no computer holds (largest 1.8e+308)"
            raise CaseError([Problem(path, value, rule, remedy_for(value, case.precision, False))]) from None
        if problems:
            raise CaseError(problems)
        return physics

    return with_check
