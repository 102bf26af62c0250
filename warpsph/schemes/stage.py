"""What a scheme is made of."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

Rows = Literal["fluid", "wall", "band", "blocks", "folds", "one"]


@dataclasses.dataclass(frozen=True)
class Stage:
    """One kernel of a time step.

    Attributes:
        name: shown to the user and in timings.
        kernel: Warp kernel.
        rows: what it runs over: fluid or wall particles, the interface band, blocks of particles, groups of
            blocks, or one thread.
        reason: why this scene needs it.
        rare: runs only in steps in which the device's clock asks for it (`clock.RARE`), every few steps.
    """

    name: str
    kernel: Any
    rows: Rows
    reason: str
    rare: bool = False


@dataclasses.dataclass(frozen=True)
class Absent:
    """A stage that the scene does not need, and why."""

    name: str
    reason: str
