"""A small standing capillary wave between two viscous fluids: Prosperetti's solution of the initial-value problem.

    python scripts/prosperetti.py --laplace 3000 --ratio 1 1000 > cases/reference/n_capillary_wave.csv
    python scripts/prosperetti.py --reynolds 2.5 25 250 > cases/reference/m_standing_wave_viscous.csv

Two fluids without limits, of equal kinematic viscosity, at rest with the interface at y = a_0 cos(kx); A. Prosperetti, Phys.
Fluids 24 (1981) 1217. With omega^2 = sigma k^3/(rho_1 + rho_2), n = nu k^2 and beta = rho_1 rho_2/(rho_1 + rho_2)^2

    a/a_0 = 4 (1 - 4 beta) n^2/(8 (1 - 4 beta) n^2 + omega^2) erfc(sqrt(n t))
            + sum_i z_i/Z_i omega^2/(z_i^2 - n) exp((z_i^2 - n) t) erfc(z_i sqrt(t))

z_i are the roots of

    z^4 - 4 beta sqrt(n) z^3 + 2 (1 - 6 beta) n z^2 + 4 (1 - 3 beta) n^(3/2) z + (1 - 4 beta) n^2 + omega^2

and Z_i the products of the differences z_j - z_i to the other three. For different kinematic viscosities there is no such
form.

A gravity wave under a vacuum has beta = 0 and omega^2 = g k tanh(kH): of a depth H with a smooth floor, n alone is that of
deep water, by a share of 1 - tanh(kH), 0.4 % of what friction does with H half a wavelength.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from scipy.special import wofz


def amplitude(
    time: np.ndarray, density: tuple[float, float], viscosity: float, tension: float, wavelength: float
) -> np.ndarray:
    """Return a/a_0 (n,).

    Args:
        time: since the start, at rest [s], (n,).
        density: of both fluids [kg/m^3].
        viscosity: kinematic, of both [m^2/s].
        tension: between them [N/m].
        wavelength: of the wave [m].
    """
    k = 2 * np.pi / wavelength
    total = sum(density)
    return _amplitude(time, tension * k**3 / total, viscosity * k * k, density[0] * density[1] / total**2)


def gravity_wave(time: np.ndarray, viscosity: float, wavelength: float, depth: float, gravity: float) -> np.ndarray:
    """Return a/a_0 (n,) of the free surface of a basin with a smooth floor.

    Args:
        time: since the start, at rest [s], (n,).
        viscosity: kinematic [m^2/s].
        wavelength: of the wave [m].
        depth: of the basin [m].
        gravity: its acceleration [m/s^2].
    """
    k = 2 * np.pi / wavelength
    return _amplitude(time, gravity * k * np.tanh(k * depth), viscosity * k * k, 0.0)


def _amplitude(time: np.ndarray, omega2: float, n: float, beta: float) -> np.ndarray:
    """Return a/a_0 (n,) for omega^2 [1/s^2], n = nu k^2 [1/s] and beta."""
    roots = np.roots(
        [1, -4 * beta * n**0.5, 2 * (1 - 6 * beta) * n, 4 * (1 - 3 * beta) * n**1.5, (1 - 4 * beta) * n**2 + omega2]
    )
    t = np.asarray(time, dtype=float)
    # exp(z^2 t) erfc(z sqrt t) in one: each factor alone overflows
    steady = 4 * (1 - 4 * beta) * n**2 / (8 * (1 - 4 * beta) * n**2 + omega2)
    result = steady * np.exp(-n * t) * wofz(1j * np.sqrt(n * t)) + 0j
    for i, z in enumerate(roots):
        others = np.prod(np.delete(roots, i) - z)
        result += z / others * omega2 / (z * z - n) * np.exp(-n * t) * wofz(1j * z * np.sqrt(t))
    return result.real


def standing_waves(numbers: list[float]) -> None:
    """Print a/a_0 over the time [s], a column for each Reynolds number, of the wave of cases/standing_wave.yaml."""
    time = np.linspace(0.0, 5.0, 501)
    depth, gravity = 1.0, 9.81
    scale = depth * np.sqrt(gravity * depth)
    columns = [gravity_wave(time, scale / number, 2.0, depth, gravity) for number in numbers]
    print("t_s", *(f"Re_{number:g}" for number in numbers), sep=",")
    np.savetxt(sys.stdout, np.column_stack([time, *columns]), fmt="%.8g", delimiter=",")


def main() -> None:
    """Print a/a_0 over omega t, a column for each ratio of densities; Laplace number of the denser fluid."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--laplace", type=float, default=3000.0, help="sigma L/(rho nu^2) of the denser fluid")
    parser.add_argument("--ratio", type=float, nargs="+", default=[1.0, 1000.0], help="of the densities, 1 or more")
    parser.add_argument("--end", type=float, default=25.0, help="omega t")
    parser.add_argument("--rows", type=int, default=501)
    parser.add_argument("--reynolds", type=float, nargs="+", help="H sqrt(gH)/nu: the standing wave of 2 m in 1 m of water")
    options = parser.parse_args()
    if options.reynolds:
        if min(options.reynolds) <= 0:
            parser.error("--reynolds: needs numbers above 0")
        return standing_waves(options.reynolds)
    turned = np.linspace(0.0, options.end, options.rows)
    columns = [turned]
    for ratio in options.ratio:
        omega, viscosity = np.sqrt((2 * np.pi) ** 3 / (1 + ratio)), 1 / np.sqrt(ratio * options.laplace)
        columns.append(amplitude(turned / omega, (ratio, 1.0), viscosity, 1.0, 1.0))
    print("omega_t", *(f"ratio_{ratio:g}" for ratio in options.ratio), sep=",")
    np.savetxt(sys.stdout, np.column_stack(columns), fmt="%.8g", delimiter=",")


if __name__ == "__main__":
    main()
