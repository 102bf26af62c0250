"""Stages that follow where particles were when windows of time began, for Lyapunov exponents; any scheme of fluid flow."""

from __future__ import annotations

from warpsph.engine.program import Node, Stage
from warpsph.kernels.core.flow_map import make_carry, make_follow, make_turn
from warpsph.kernels.core.lyapunov import make_backward
from warpsph.kernels.core.spec import Spec

EXPONENTS = "lyapunov"
"""name of the measure that writes the backward exponents"""


def windows(spec: Spec) -> list[Stage]:
    """Return the stages that stand before the particles move: the window that is due begins, shifts are followed."""
    if not spec.windows:
        return []
    return [
        Stage("turn_windows", make_turn(spec), "one", "Lyapunov exponents: is a window to begin"),
        Stage("carry_origins", make_carry(spec), "fluid", "places at the start of the windows"),
    ]


def follow_shift(spec: Spec) -> list[Stage]:
    """Return the stage behind the one that finds the shift of the coming step, with the list of these positions."""
    if not (spec.windows and spec.shifting):
        return []
    return [Stage("follow_shift", make_follow(spec), "fluid", "what the shift changes of those places")]


def exponents(spec: Spec) -> dict[str, list[Node]]:
    """Return the measure of the exponents, by its name."""
    if not spec.windows:
        return {}
    return {EXPONENTS: [Stage("backward_exponent", make_backward(spec), "fluid", "Lyapunov exponents of an output")]}
