"""What drives a scene and may depend on time, as pieces: gravity, body force, velocities of the sides of the domain.

A body force counts as gravity on the axes on which walls at sides of the domain hold it up (`held`): the pressure balances
it there, at walls too. Along a periodic or an open axis it drives a flow and no pressure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpsph.case.domain import AXES
from warpsph.case.signals import Varying, varies
from warpsph.scene.signal_tables import VALUE, Pieces, joined, pieces_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case


@dataclass(frozen=True, eq=False)
class Forcing:
    """The pieces of what drives a scene; d dimensions.

    gravity, body_force: d each, m/s^2
    sides: velocity of each side, 2 d of d each, the lower one of the first axis first, m/s
    held: (d,), whether walls at sides hold up a body force along an axis
    end_time: until which the pieces last, s
    varying_force: gravity or body force depends on time
    varying_sides: the velocity of a side does
    """

    gravity: tuple[Pieces, ...]
    body_force: tuple[Pieces, ...]
    sides: tuple[tuple[Pieces, ...], ...]
    held: NDArray[np.bool_]
    end_time: float
    varying_force: bool
    varying_sides: bool

    def ranges(self, vector: Sequence[Pieces], order: int = VALUE) -> NDArray[np.float64]:
        """Least and largest value of each component in the run, (d, 2); order -1: of the integrals from time 0."""
        return np.array([part.extremes(self.end_time, order) for part in vector])

    def largest(self, vector: Sequence[Pieces]) -> NDArray[np.float64]:
        """The value of the largest magnitude that each component has in the run, (d,), with its sign."""
        low, high = self.ranges(vector).T
        return np.where(np.abs(low) > np.abs(high), low, high)

    def hydrostatic(self) -> NDArray[np.float64]:
        """Bound on the magnitude of each component of what pressure balances, (d,), m/s^2."""
        return np.abs(self.largest(self.gravity)) + np.where(self.held, np.abs(self.largest(self.body_force)), 0.0)

    def driving(self) -> NDArray[np.float64]:
        """Bound on the magnitude of each component of the body force that pressure does not balance, (d,), m/s^2."""
        return np.where(self.held, 0.0, np.abs(self.largest(self.body_force)))

    def start(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What pressure balances at time 0, (d,), and what it does not, m/s^2."""
        gravity, force = (np.array([float(part.at(0.0)) for part in vector]) for vector in (self.gravity, self.body_force))
        return gravity + np.where(self.held, force, 0.0), np.where(self.held, 0.0, force)

    def largest_impulse(self) -> float:
        """Bound on the speed that the body force gives to what nothing holds back, from any time to any other, m/s."""
        return float(np.linalg.norm(np.ptp(self.ranges(self.body_force, -1), axis=1)))

    def side_speed(self) -> float:
        """Largest speed of a side, m/s."""
        return max(float(np.linalg.norm(self.largest(side))) for side in self.sides)

    def arrays(self) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
        """All signals as a device reads them, in the order of `kernels/core/time_signals.py`; see `signal_tables.joined`."""
        return joined([*self.gravity, *self.body_force, *(part for side in self.sides for part in side)])


def forcing_of(case: Case) -> Forcing:
    """What drives a case.

    Raises CaseError with the first signal that cannot be brought into pieces.
    """
    d, end = case.dimension, case.end_time

    def pieces(path: str, vector: Sequence[Varying]) -> tuple[Pieces, ...]:
        return tuple(pieces_of(f"{path}.{k}", value, end) for k, value in enumerate(vector or (0.0,) * d))

    ends = [(axis, name) for axis in AXES[:d] for name in ("lower", "upper")]
    sides = [getattr(getattr(case.domain.boundary, axis), name) for axis, name in ends]
    names = [f"domain.boundary.{axis}.{name}.velocity" for axis, name in ends]
    return Forcing(
        gravity=pieces("gravity", case.gravity),
        body_force=pieces("body_force", case.body_force),
        sides=tuple(pieces(name, side.velocity) for name, side in zip(names, sides, strict=True)),
        held=np.array(["wall" in (sides[2 * k].kind, sides[2 * k + 1].kind) for k in range(d)]),
        end_time=end,
        varying_force=varies(case.gravity) or varies(case.body_force),
        varying_sides=any(varies(side.velocity) for side in sides),
    )
