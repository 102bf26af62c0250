"""What every scheme has. Light: nothing here imports Warp, a kernel or another part of the package."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpsph.case.numerics import NumericsBase
    from warpsph.errors import Problem

__all__ = ["Scheme"]


class Scheme:
    """A way to solve the equations of a scene.

    Attributes:
        name: what `numerics.scheme` calls it.
        summary: one line about it.
        numerics: model of the section `numerics` of its cases.
    """

    name: str
    summary: str
    numerics: type[NumericsBase]

    def check(self, case: Any) -> Iterator[Problem]:
        """Yield what is wrong with a case of this scheme, beyond its single values.

        case: a Case, or what could be read of a faulty one. Of the latter, a value that could not be read ends the check
            that uses it; it has been reported.
        """
        yield from ()
