"""The section `bodies` of a case: solids with a surface of their own."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from warpsph.case.motion import Motion
from warpsph.case.shapes import BodyShape
from warpsph.case.values import CaseModel, WallKind


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
