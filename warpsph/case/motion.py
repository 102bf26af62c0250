"""The key `motion` of a body: where it is at a time.

    x(t) = pivot + translation(t) + R(rotation(t)) (x(0) - pivot)

R turns by the angle about the axis (3-D), counter-clockwise in 2-D. The shape of the body says where it is at time 0, so
translation and rotation are zero there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import Field

from warpsph.case.signals import Signal, SignalNumber, SignalVector, check_signal, is_signal, signal_text, value_at
from warpsph.case.values import CaseModel, Vector
from warpsph.errors import CaseError, ExpressionError, Problem

AT_REST = 1e-9  # translation and rotation at time 0 up to which they count as zero, over the largest up to end_time


class Motion(CaseModel):
    """The motion of a body, prescribed."""

    translation: SignalVector = Field(
        default=(),
        description="way from where the shape is, m; depends on time (default none)",
        examples=['["0.1*sin(t)", 0]'],
    )
    rotation: SignalNumber = Field(
        default=0.0, description="angle about the pivot, rad; depends on time (default none)", examples=['"2*pi*t"']
    )
    pivot: Vector = Field(
        default=(),
        description="point that the rotation leaves in place, m (default the origin)",
        examples=["[0, 0]"],
    )
    axis: Vector = Field(
        default=(), description="direction of the axis of rotation, of any length (3-D only)", examples=["[0, 0, 1]"]
    )

    def signals(self) -> Iterator[tuple[str, Signal]]:
        """Yield (key, signal) of what depends on time."""
        entries = [*((f"translation.{k}", value) for k, value in enumerate(self.translation)), ("rotation", self.rotation)]
        yield from ((key, value) for key, value in entries if is_signal(value))

    @property
    def turns(self) -> bool:
        """Whether there is a rotation."""
        return is_signal(self.rotation) or self.rotation != 0.0

    def keeps(self, axis: int) -> bool:
        """Whether every point of the body keeps its coordinate along an axis."""
        if self.turns:
            return False
        return not self.translation or (not is_signal(self.translation[axis]) and self.translation[axis] == 0.0)


def check_motion(path: str, motion: Any, dimension: int, folder: Path | None, end_time: float) -> Iterator[Problem]:
    """Yield what is wrong with a motion: lengths of its vectors, tables, an axis that is none, a start that is elsewhere."""
    for key in ("translation", "pivot", "axis"):
        vector = getattr(motion, key)
        if vector and len(vector) != dimension and (key != "axis" or dimension == 3):
            rule = f"needs {dimension} numbers (dimension: {dimension})"
            yield Problem(f"{path}.{key}", [signal_text(v) for v in vector], rule, f"write e.g. {key}: {[0] * dimension}")
    if dimension == 2 and motion.axis:
        yield Problem(f"{path}.axis", list(motion.axis), "has no meaning in 2-D, where all turns in its plane", "delete it")
    if dimension == 3 and (motion.turns or motion.axis) and not math.hypot(*motion.axis) > 0.0:
        yield Problem(f"{path}.axis", list(motion.axis), "needs a direction for the rotation", "write e.g. axis: [0, 0, 1]")
    for key, signal in motion.signals():
        yield from check_signal(f"{path}.{key}", signal, folder, end_time)
    if not motion.turns and not any(is_signal(value) or value != 0.0 for value in motion.translation):
        yield Problem(path, "", "moves nothing", "write translation or rotation, or delete it")
    entries = [*((f"translation.{k}", v) for k, v in enumerate(motion.translation)), ("rotation", motion.rotation)]
    for key, value in entries:
        try:
            start, later = value_at(value, 0.0), max(abs(value_at(value, end_time * share)) for share in (0.25, 0.5, 1.0))
        except (ExpressionError, CaseError, OSError):
            continue  # told above, or when the pieces are made
        if abs(start) > AT_REST * max(later, abs(start) * 1e-3):
            rule = f"is {start:.6g} at time 0, where the shape says how the body stands; it has to be 0"
            yield Problem(f"{path}.{key}", signal_text(value), rule, "subtract that value, and move the shape instead")
