"""Linear waves of a flat interface between two fluids: the exact dispersion relation, and what grows without a disturbance.

    python scripts/dispersion.py --spacings 48 --density 1 --viscosity 0.01826

runs two fluids at rest, flat interface on the lattice, unit tension, and prints the growth rate of the speed [1/s]
and the exact rate of a wave 4.4 spacings long (docs/records/tension.md). Exactly, nothing grows.
"""

import argparse
import tempfile
from typing import Any

import numpy as np


def boundary_conditions(s: complex, k: float, density: tuple, viscosity: tuple, sigma: float) -> np.ndarray:
    """Return the conditions at y = 0, (4, 4), on v = A e^{ky} + B e^{q1 y} below and C e^{-ky} + D e^{-q2 y} above.

    All fields go with e^{ikx + st}, q^2 = k^2 + s/nu. Rows: v, u and shear stress continuous; normal stress against tension.
    """
    (r1, r2), (m1, m2) = density, viscosity
    q1, q2 = np.sqrt(k * k + s * r1 / m1 + 0j), np.sqrt(k * k + s * r2 / m2 + 0j)
    pull = sigma * k * k / s
    return np.array(
        [
            [1, 1, -1, -1],
            [k, q1, k, q2],
            [2 * m1 * k * k, m1 * (q1 * q1 + k * k), -2 * m2 * k * k, -m2 * (q2 * q2 + k * k)],
            [-r1 * s / k - 2 * m1 * k - pull, -2 * m1 * q1 - pull, -r2 * s / k - 2 * m2 * k, -2 * m2 * q2],
        ]
    )


def exact_rate(k: float, density: tuple, viscosity: tuple, sigma: float) -> complex:
    """Return s [1/s] of the wave number k [1/m]: minus the damping, plus i times the frequency.

    Args:
        k: wave number [1/m].
        density: of both fluids [kg/m^3].
        viscosity: dynamic, of both fluids [Pa s], above 0.
        sigma: tension [N/m].

    Raises:
        ValueError: if the wave is so damped that it does not swing.
    """
    s = 1j * np.sqrt(sigma * k**3 / sum(density))
    for part in np.geomspace(1e-4, 1.0, 60):  # the root is followed from the wave without friction
        friction = (part * viscosity[0], part * viscosity[1])

        def residual(z: complex, friction: tuple = friction) -> complex:
            return complex(np.linalg.det(boundary_conditions(z, k, density, friction, sigma)))

        last, value = s * (1 + 1e-4), residual(s * (1 + 1e-4))
        for _ in range(60):
            new = residual(s)
            if new == value or abs(s - last) < 1e-13 * abs(s):
                break
            s, last, value = s - new * (s - last) / (new - value), s, new
    if s.imag < 1e-6 * abs(s):
        raise ValueError(f"a wave of k = {k} 1/m does not swing at viscosities {viscosity} Pa s")
    return s


def scene(spacings: int, ratio: float, viscosity: float, end_time: float) -> dict[str, Any]:
    """Return the case: 1 x 3 m, the interface in the middle, kinematic viscosity equal on both sides [m^2/s]."""
    return {
        "dimension": 2,
        "particle_spacing": 1 / spacings,
        "end_time": end_time,
        "domain": {"lower": [0, 0], "upper": [1, 3], "boundary": {"x": "periodic", "y": "free_slip"}},
        "phases": {
            "lower": {"density": ratio, "viscosity": viscosity * ratio},
            "upper": {"density": 1.0, "viscosity": viscosity},
        },
        "surface_tension": [{"between": ["lower", "upper"], "coefficient": 1.0}],
        "fluids": [
            {"phase": "lower", "shape": {"box": {"lower": [0, 0], "upper": [1, 1.5]}}},
            {"phase": "upper", "shape": "rest"},
        ],
        "numerics": {"unlock": 0},
        "gauges": {"energy": {"type": "energy", "interval": end_time / 100}},
    }


def growth(time: np.ndarray, kinetic: np.ndarray) -> float:
    """Return the growth rate of the speed [1/s]: half the slope of ln E between 30 times its start and 1/30 of its end."""
    usable = kinetic > 0
    low, high = kinetic[usable][:5].max() * 30, kinetic.max() / 30
    part = usable & (kinetic > low) & (kinetic < high)
    if part.sum() < 5:
        return float("nan")
    return 0.5 * float(np.polyfit(time[part], np.log(kinetic[part]), 1)[0])


def main() -> None:
    """Run the scene and print the rates."""
    import warpsph
    from warpsph.case.case import Case

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacings", type=int, default=48)
    parser.add_argument("--density", type=float, default=1.0)
    parser.add_argument("--viscosity", type=float, default=0.01826)
    parser.add_argument("--end-time", type=float, default=1.0)
    options = parser.parse_args()
    case = Case.from_dict(scene(options.spacings, options.density, options.viscosity, options.end_time))
    with tempfile.TemporaryDirectory() as folder:
        energy = warpsph.run(case, output=folder).gauge("energy")
    names = list(energy)
    time, kinetic = np.asarray(energy[names[0]]), np.asarray(energy[next(n for n in names if "kinetic" in n)])
    print(f"kinetic energy {kinetic[1]:.2e} to {kinetic[-1]:.2e} J/m, growth {growth(time, kinetic):+.2f} 1/s")
    k = 2 * np.pi * options.spacings / 4.4
    density = (options.density, 1.0)
    try:
        print(f"exact {exact_rate(k, density, tuple(r * options.viscosity for r in density), 1.0):.2f} 1/s")
    except ValueError as problem:
        print(f"exact: {problem}")


if __name__ == "__main__":
    main()
