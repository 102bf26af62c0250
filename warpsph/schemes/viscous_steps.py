"""Stages of viscosity in the Riemann scheme: their weights, how far they reach, how many a scene is worth.

Runge-Kutta-Chebyshev of the first order (theory: riemann#stages; Verwer, Hundsdorfer & Sommeijer 1990), for the rate
dy/dt = a - tau A y from y = 0.
"""

from __future__ import annotations

import dataclasses
import functools

from warpsph.engine.program import Stage
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.riemann.viscous_stages import make_viscous_stage

# Least number: the closing stage writes what the second one still reads of neighbours.
LEAST = 3
# Largest number that `auto` takes: 161 times the step of explicit friction.
MOST = 16
# Damping epsilon: what is stiff keeps a share below 1/cosh(sqrt(2 epsilon)) = 0.46 in a step, so that the friction of the
# momentum sweep, with its corrections for disorder, may be 1.37 times that of the stages before a step is unstable. It
# costs a third of the reach that 0.05 would have.
DAMPING = 1.0
# What a stage takes of the time of a step without, measured on a CPU (docs/records/shear.md).
STAGE_COST = 0.25


@dataclasses.dataclass(frozen=True)
class StageWeights:
    """Weights of stage j: y_j = now y_{j-1} + before y_{j-2} + step (a - tau A y_{j-1}); y_0 = 0."""

    now: float
    before: float
    step: float


@functools.cache
def weights(stages: int) -> tuple[StageWeights, ...]:
    """Return the weights of the stages 1 to `stages`, the first one y_1 = step a."""
    value, rate = _chebyshev(stages)
    at = 1.0 + DAMPING / stages**2
    slope = value[stages] / rate[stages]
    result = [StageWeights(0.0, 0.0, slope / at)]
    for j in range(2, stages + 1):
        share = value[j - 1] / value[j]
        result.append(StageWeights(2.0 * at * share, -value[j - 2] / value[j], 2.0 * slope * share))
    return tuple(result)


def reach(stages: int) -> float:
    """Return how many steps of explicit friction (forward Euler at its limit) one step with so many stages is long."""
    if stages == 1:
        return 1.0
    value, rate = _chebyshev(stages)
    return (2.0 + DAMPING / stages**2) * rate[stages] / (2.0 * value[stages])


def worth(ratio: float) -> int:
    """Return the number of stages that is fastest where all else allows `ratio` times the step of explicit friction."""

    def time(stages: int) -> float:
        return (1.0 + STAGE_COST * (stages - 1)) / min(reach(stages), ratio)

    return min((1, *range(LEAST, MOST + 1)), key=time) if ratio > 1.0 else 1


def _chebyshev(stages: int) -> tuple[list[float], list[float]]:
    """Return the Chebyshev polynomials T_0 ... T_stages and their derivatives at 1 + DAMPING / stages^2."""
    at = 1.0 + DAMPING / stages**2
    value, rate = [1.0, at], [0.0, 1.0]
    for _ in range(2, stages + 1):
        rate.append(2.0 * value[-1] + 2.0 * at * rate[-1] - rate[-2])
        value.append(2.0 * at * value[-1] - value[-2])
    return value, rate


def viscous_stages(spec: Spec) -> list[Stage]:
    """Return the stages that follow the momentum sweep; none where friction is explicit."""
    if spec.viscous_stages == 1:
        return []
    table = weights(spec.viscous_stages)
    between, closing = make_viscous_stage(spec, False), make_viscous_stage(spec, True)
    result = []
    # Two arrays take turns; the first y is a multiple of the acceleration itself.
    names = ["acceleration", "rate_odd", "rate_even"]
    for j in range(2, spec.viscous_stages + 1):
        now = table[j - 1]
        last = j == spec.viscous_stages
        fields = {
            "rate_now": names[0] if j == 2 else names[1 + j % 2],
            "rate_before": names[0] if j <= 3 else names[2 - j % 2],
            "rate_next": names[2 - j % 2],
        }
        before = 0.0 if j == 2 else now.before * (table[0].step if j == 3 else 1.0)
        values = {
            "scale_now": table[0].step if j == 2 else 1.0,
            "weight_now": now.now,
            "weight_before": before,
            "weight_step": now.step,
        }
        reason = "steps beyond the limit of explicit friction"
        result.append(Stage("viscous_stage", closing if last else between, "fluid", reason, values, fields))
    return result
