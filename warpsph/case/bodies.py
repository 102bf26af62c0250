"""The section `bodies` of a case: solids with a surface of their own."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from warpsph.case.motion import Motion
from warpsph.case.shapes import BodyShape
from warpsph.case.values import CaseModel, WallKind

FREE_KEYS = (
    "density", "mass", "inertia", "velocity", "angular_velocity", "center_of_mass", "centre_of_mass", "floating", "free",
    "rigid", "force", "gravity",
)  # fmt: skip
"""Keys that other programs give to bodies which the fluid moves."""


class Body(CaseModel):
    """A solid whose surface is where its shape says, whatever the lattice of the particles."""

    shape: BodyShape = Field(description="the region", examples=["{sphere: {center: [0, 0], radius: 1}}"])
    hollow: Annotated[bool, Field(strict=True)] = Field(
        default=False, description="the fluid is inside the shape, and the body all around it", examples=["false"]
    )
    wall: WallKind = Field(default="no_slip", description="no_slip or free_slip", examples=["no_slip"])
    motion: Motion | None = Field(
        default=None, description="how it moves (default: not at all)", examples=['{translation: ["0.1*sin(t)", 0]}']
    )

    @classmethod
    def foreign_key(cls, key: str, raw: Any) -> tuple[str, str] | None:
        """Rule and remedy for what would be a key of a body that floats or falls."""
        if key not in FREE_KEYS:
            return None
        rule = "is not a known key: bodies that float or fall freely do not exist, they move only as they are told"
        return rule, 'delete it, or give a motion: {translation: ["0.1*t", 0]} and the like, with rotation and pivot'
