"""Schemes: each file lists the stages of one time step, in order, with the reason for each."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from warpsph.kernels.core.spec import Spec


def of(spec: Spec) -> ModuleType:
    """Return the module of the scheme of a `Spec`: it has `step(spec)` and `absent(spec)`."""
    from warpsph.schemes import isph, riemann

    return {"riemann": riemann, "isph": isph}[spec.scheme]
