"""Stokes flow between two eccentric cylinders of which the inner one turns: reference of `journal_bearing` (Wannier 1950).

    python scripts/journal_bearing_exact.py                       # torques and forces
    python scripts/journal_bearing_exact.py --profile cases/reference/n_journal_bearing.csv

Problem.  A fluid of viscosity mu fills the gap between a cylinder of radius 1 about the origin, at rest, and one of radius
0.5 about (0.25, 0) that turns with the angular velocity 1; no inertia.

Method.  The velocity u + i v of a Stokes flow in the plane is phi(z) - z conj(phi'(z)) - conj(psi(z)) with analytic phi and
psi. Its pressure is -4 mu Re phi', the stress on a normal n 4 mu Re(phi') n - 2 mu (z conj(phi'') + conj(psi')) conj(n).
Between two circles phi and psi are Taylor series about the middle of the outer one, Laurent series about that of the inner
one, and logarithms whose jumps cancel in the velocity. The coefficients follow from the velocity on both circles by least
squares; they fall like the powers of a number below 1, so that 40 of each are right to rounding.

Checks (`tests/unit/test_journal_bearing_exact.py`): the velocity on both circles, the flow and the torque between concentric
cylinders, the balance of forces and moments on both.
"""

import argparse
import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]


class Bearing:
    """The flow between cylinders of radius `inner` about `offset` and `outer` about 0; viscosity and turning are 1."""

    def __init__(self, inner: float = 0.5, outer: float = 1.0, offset: float = 0.25, terms: int = 40) -> None:
        self.inner, self.outer, self.offset, self.terms = inner, outer, offset, terms
        ring = np.exp(2j * np.pi * np.arange(8 * terms) / (8 * terms))
        places = np.concatenate([offset + inner * ring, outer * ring])
        wanted = np.concatenate([1j * inner * ring, 0 * ring])
        rows = self._velocities(places)
        system = np.vstack([rows.real, rows.imag])
        size = np.linalg.norm(system, axis=0)
        size[size == 0] = 1.0  # phi = z makes no velocity
        self.coefficients = np.linalg.lstsq(system / size, np.concatenate([wanted.real, wanted.imag]), rcond=1e-13)[0] / size

    def _functions(self, z: Complex) -> list[tuple[Complex, ...]]:
        """Return (phi, phi', phi'', psi, psi') at z of each function of the basis; its coefficient is real."""
        none = np.zeros_like(z)
        out, inward = z / self.outer, self.inner / (z - self.offset)
        powers = [(out**0, none, none)]
        for n in range(1, self.terms + 1):
            second = n * (n - 1) * out ** max(n - 2, 0) / self.outer**2
            powers.append((out**n, n * out ** (n - 1) / self.outer, second))
            second = n * (n + 1) * inward ** (n + 2) / self.inner**2
            powers.append((inward**n, -n * inward ** (n + 1) / self.inner, second))
        found: list[tuple[Complex, ...]] = []
        for f, first, second in powers:
            for c in (1.0, 1j):
                found += [(c * f, c * first, c * second, none, none), (none, none, none, c * f, c * first)]
        log, first, second = np.log((z - self.offset) / self.inner), 1 / (z - self.offset), -1 / (z - self.offset) ** 2
        for c in (1.0 + 0j, 1j):
            found.append((c * log, c * first, c * second, -np.conj(c) * log, -np.conj(c) * first))
        return found

    def _velocities(self, z: Complex) -> Complex:
        """Return the velocity of each function of the basis at the places z (n,): (n, functions)."""
        parts = [f - z * np.conj(first) - np.conj(g) for f, first, _, g, _ in self._functions(z)]
        return np.stack(parts, axis=-1)

    def velocity(self, z: Complex) -> Complex:
        """Return u + i v at the places z (n,)."""
        return self._velocities(z) @ self.coefficients

    def load(self, radius: float, centre: float, count: int = 720) -> tuple[complex, float]:
        """Return the force x + i y on what a circle of the fluid holds, and its moment about the middle of the circle."""
        normal = np.exp(2j * np.pi * np.arange(count) / count)
        z = centre + radius * normal
        parts = [
            4 * first.real * normal - 2 * (z * np.conj(second) + np.conj(g)) * np.conj(normal)
            for _, first, second, _, g in self._functions(z)
        ]
        force = np.stack(parts, axis=-1) @ self.coefficients * (2 * np.pi * radius / count)
        return complex(force.sum()), float((np.conj(radius * normal) * force).imag.sum())


def main() -> None:
    """Print the loads over viscosity and angular velocity; write the velocity across both gaps."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--profile", type=Path, help="write the velocity over the way across both gaps to this file")
    given = parser.parse_args()
    if given.profile and not given.profile.absolute().parent.is_dir():
        parser.error(f"--profile {given.profile}: the folder does not exist; make it, or name another file")
    bearing = Bearing()
    force, torque = bearing.load(bearing.inner, bearing.offset)
    print(f"inner cylinder: torque about its centre {torque:.5f}, force ({force.real:.5f}, {force.imag:.5f})")
    force, torque = bearing.load(bearing.outer, 0.0)
    print(f"outer cylinder: torque about its centre {-torque:.5f}, force ({-force.real:.5f}, {-force.imag:.5f})")
    if given.profile:
        with given.profile.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["wide_m", "v_wide", "narrow_m", "v_narrow"])
            for k in range(31):
                wide, narrow = 0.025 * k, 0.25 / 30 * k
                v = bearing.velocity(np.array([wide - 1.0, narrow + 0.75], dtype=complex)).imag
                writer.writerow([f"{wide:.4f}", f"{v[0]:.6f}", f"{narrow:.6f}", f"{v[1]:.6f}"])


if __name__ == "__main__":
    main()
