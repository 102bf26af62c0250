"""What drives a scene and may depend on time, as pieces: gravity, body force, velocities of sides, motions of bodies.

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
from warpsph.scene.signal_tables import ACCELERATION, RATE, VALUE, Pieces, joined, pieces_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from warpsph.case.case import Case
    from warpsph.case.motion import Motion


@dataclass(frozen=True, eq=False)
class Track:
    """The motion of a body: x(t) = pivot + translation + R(rotation) (x(0) - pivot); d dimensions.

    translation: d, m; rotation: rad
    pivot: (d,), m; axis: (3,), unit vector of the axis
    """

    name: str
    translation: tuple[Pieces, ...]
    rotation: Pieces
    pivot: NDArray[np.float64]
    axis: NDArray[np.float64]

    def place(self, point: NDArray[np.float64], time: float) -> NDArray[np.float64]:
        """Where a point (d,) of the body, m, of time 0 is at a time, s; or several, (n, d)."""
        d = len(self.pivot)
        arm = (point - self.pivot) @ self.turn(time)[:d, :d].T
        way = np.array([float(part.at(time)) for part in self.translation])
        return np.asarray(self.pivot + way + arm)

    def turn(self, time: float) -> NDArray[np.float64]:
        """How the body is turned at a time, s, since time 0: (3, 3)."""
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_rotvec(float(self.rotation.at(time)) * self.axis).as_matrix())

    def largest(self, end_time: float, order: int, reach: float, begin: float = 0.0) -> float:
        """Bound on the speed (order RATE) or acceleration (ACCELERATION) of a point `reach` m from the pivot, SI units.

        begin, end_time: between these times, s.
        """

        def most(part: Pieces, derivative: int) -> float:
            return max(map(abs, part.extremes(end_time, derivative, begin)))

        straight = float(np.linalg.norm([most(part, order) for part in self.translation]))
        if order == RATE:
            return straight + most(self.rotation, RATE) * reach
        return straight + (most(self.rotation, ACCELERATION) + most(self.rotation, RATE) ** 2) * reach


@dataclass(frozen=True, eq=False)
class Forcing:
    """The pieces of what drives a scene; d dimensions.

    gravity, body_force: d each, m/s^2
    sides: velocity of each side, 2 d of d each, the lower one of the first axis first, m/s
    tracks: of the bodies that move
    held: (d,), whether walls at sides hold up a body force along an axis
    end_time: until which the pieces last, s
    varying_force: gravity or body force depends on time
    varying_sides: the velocity of a side does
    """

    gravity: tuple[Pieces, ...]
    body_force: tuple[Pieces, ...]
    sides: tuple[tuple[Pieces, ...], ...]
    tracks: tuple[Track, ...]
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

    def body_speed(self, reach: dict[str, float]) -> float:
        """Bound on the speed of the bodies that move, m/s; 0 without any.

        reach: distance of the farthest point of each body from its pivot, m.
        """
        return max((track.largest(self.end_time, RATE, reach[track.name]) for track in self.tracks), default=0.0)

    def arrays(self) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
        """All signals as a device reads them, in the order of `kernels/core/time_signals.py`; see `signal_tables.joined`."""
        motions = [part for track in self.tracks for part in (*track.translation, track.rotation)]
        return joined([*self.gravity, *self.body_force, *(part for side in self.sides for part in side), *motions])


def forcing_of(case: Case) -> Forcing:
    """What drives a case.

    Raises CaseError with the first signal that cannot be brought into pieces.
    """
    d, end = case.dimension, case.end_time

    def pieces(path: str, vector: Sequence[Varying]) -> tuple[Pieces, ...]:
        return tuple(pieces_of(f"{path}.{k}", value, end) for k, value in enumerate(vector or (0.0,) * d))

    def track(name: str, motion: Motion) -> Track:
        path, zero = f"bodies.{name}.motion", (0.0,) * d
        axis = np.array(motion.axis if d == 3 and motion.axis else (0.0, 0.0, 1.0))
        translation = enumerate(motion.translation or zero)
        return Track(
            name,
            tuple(pieces_of(f"{path}.translation.{k}", value, end, ACCELERATION) for k, value in translation),
            pieces_of(f"{path}.rotation", motion.rotation, end, ACCELERATION),
            np.array(motion.pivot or zero),
            axis / np.linalg.norm(axis),
        )

    ends = [(axis, name) for axis in AXES[:d] for name in ("lower", "upper")]
    sides = [getattr(getattr(case.domain.boundary, axis), name) for axis, name in ends]
    names = [f"domain.boundary.{axis}.{name}.velocity" for axis, name in ends]
    return Forcing(
        gravity=pieces("gravity", case.gravity),
        body_force=pieces("body_force", case.body_force),
        sides=tuple(pieces(name, side.velocity) for name, side in zip(names, sides, strict=True)),
        tracks=tuple(track(name, body.motion) for name, body in case.bodies.items() if body.motion is not None),
        held=np.array(["wall" in (sides[2 * k].kind, sides[2 * k + 1].kind) for k in range(d)]),
        end_time=end,
        varying_force=varies(case.gravity) or varies(case.body_force),
        varying_sides=any(varies(side.velocity) for side in sides),
    )
