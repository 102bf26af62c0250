"""Particles of equal mass in a gas whose density varies along x: rows of a lattice, moved along x."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpsph.errors import ExpressionError, Problem
from warpsph.scene.lattice import Lattice
from warpsph.scene.masks import values_at
from warpsph.scene.start_fluid import FluidParticles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case

FINE = 64  # points in a cell at which the density is added up: a jump is found within 1/64 of a cell


def equal_masses(
    case: Case, lattice: Lattice, fluid: FluidParticles, problems: list[Problem]
) -> NDArray[np.float64] | None:
    """Move the particles along x, in place, and return the volume of each over that of a cell, (n,).

    A particle at the share s of the length of the domain goes to where the share s of the mass lies before it. A gas that
    does not fill the domain, or a density that is no function of x alone, is a problem.
    """
    formula = case.start.density
    if len(fluid.position) != np.prod(lattice.count):
        rule = "moves whole rows of particles, and the gas does not fill the domain"
        problems.append(Problem("start.arrangement", "equal_mass", rule, "write lattice, or let one fluid fill the domain"))
        return None
    if formula is None:
        return None
    if formula.names - ({"x", "r"} if case.dimension == 1 else {"x"}):
        rule = "has to depend on x alone where start.arrangement is equal_mass"
        problems.append(Problem("start.density", formula.text, rule, "write arrangement: lattice"))
        return None
    low, cells, spacing = lattice.lower[0], lattice.count[0], lattice.spacing[0]
    step = spacing / FINE
    edges = low + step * np.arange(cells * FINE + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    try:
        density = np.array(values_at(formula, [middle], middle.shape))
        if not density.min() > 0.0:
            rule = f"is {density.min():g} kg/m^3 at x = {middle[density.argmin()]:g}, a gas needs more than 0"
            problems.append(Problem("start.density", formula.text, rule, "change the formula there"))
            return None
        before = np.concatenate([[0.0], np.cumsum(density) * step])
        share = (fluid.position[:, 0] - low) / (cells * spacing)
        fluid.position[:, 0] = np.interp(share * before[-1], before, edges)
        here = values_at(formula, [fluid.position[:, 0]], share.shape)
    except ExpressionError as error:
        problems.append(Problem("start.density", error.text, error.rule_with_column, error.remedy))
        return None
    return np.asarray(before[-1] / (cells * spacing) / here)
