"""The budget of momentum and energy, as the device has added it up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from warpsph.case.budget_terms import OUTSIDE, TERMS

ENERGY = 3  # entry of a row; those before it are the components of the momentum


def budget(bindings: Mapping[str, Any], dimension: int) -> dict[str, float]:
    """Return force [N], power [W], impulse [N s] and work [J] of each term and in total (2-D: per metre), by column.

    bindings: kernel arguments of a run with `Spec.budget`
    """
    inside = np.array([term not in OUTSIDE for term in TERMS])
    result: dict[str, float] = {}
    for array, vector, scalar in (("budget_force", "force", "power"), ("budget_work", "impulse", "work")):
        rows = np.array(bindings[array].numpy(), np.float64)
        for term, row in zip(("total", *TERMS), [rows[inside].sum(axis=0), *rows], strict=True):
            result[f"{scalar} {term}"] = float(row[ENERGY])
            result |= {f"{vector}_{axis} {term}": float(x) for axis, x in zip("xyz"[:dimension], row, strict=False)}
    return result
