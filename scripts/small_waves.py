"""How much energy small gravity waves lose, that theory keeps: travelling ones, or standing ones.

    python scripts/small_waves.py [--scheme isph|riemann|delta_plus] [--spacings 82] [--height 0.0425] [--standing]
                                  [--periods 4] [--set numerics.maximum_step=0.005 ...]

A periodic basin, one wave of 2.05 m long and 0.5 m deep, no friction. Travelling waves start from the displacements and the
velocities of a wave eta = A cos(kx - wt) to second order in kA,

    x = X - A C sin kX + A^2 k/(4 sinh^2 kd) sin 2kX,   C = cosh kY/sinh kd
    y = Y + A S cos kX + A^2 k/(4 sinh^2 kd) sinh 2kY,  S = sinh kY/sinh kd

with (X, Y) a lattice whose rows lie along the surface: a surface cut out of a lattice is a staircase, and what it does in
the first period hides what the scheme does. Standing waves start flat from the velocities alone.

Printed: mean kinetic energy of each period over that of theory, rho g A^2/4 a length, half of it for a standing wave, and
what kinetic and potential energy gain together by the end of each [J/m]. Figures: docs/records/isph.md#decay.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.simulation import Simulation

LENGTH, DEPTH, GRAVITY, DENSITY = 2.05, 0.5, 9.81, 1000.0
WAVE_NUMBER = 2.0 * math.pi / LENGTH
SAMPLES = 16  # a period


def case_of(scheme: str, spacings: int, height: float, standing: bool, changes: list[str]) -> Case:
    """The basin at rest with the velocities of the wave; its depth is a whole number of rows."""
    spacing = LENGTH / spacings
    depth = round(DEPTH / spacing) * spacing
    k, rate = WAVE_NUMBER, frequency(depth)
    share = f"{float(height * rate / np.sinh(k * depth))}"
    c, s = f"cosh({k}*y)", f"sinh({k}*y)"
    start: dict[str, Any] = {"velocity": [f"-{share}*{c}*sin({k}*x)", f"{share}*{s}*cos({k}*x)"]}
    if not standing:
        weight = f"({c}/{float(np.cosh(k * depth))} - {s}/{float(np.sinh(k * depth))})"
        start = {
            "velocity": [f"{share}*{c}*cos({k}*x)", f"{share}*{s}*sin({k}*x)"],
            "pressure": f"{DENSITY * GRAVITY}*({depth} - y + {height}*cos({k}*x)*{weight})",
        }
    return load_case(
        {
            "dimension": 2,
            "particle_spacing": spacing,
            "end_time": 100.0,
            "domain": {
                "lower": [0, 0],
                "upper": [LENGTH, 2 * DEPTH],
                "boundary": {"x": "periodic", "y": {"lower": "free_slip", "upper": "open"}},
            },
            "gravity": [0, -GRAVITY],
            "phases": {"water": {"density": DENSITY}},
            "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [LENGTH, depth]}}}],
            "start": start,
            "numerics": {"scheme": scheme},
            "output": {"particles": "none", "checkpoint": "none"},
        },
        changes,
    )


def frequency(depth: float) -> float:
    """Angular frequency of the wave [rad/s]."""
    return float(np.sqrt(GRAVITY * WAVE_NUMBER * np.tanh(WAVE_NUMBER * depth)))


def displace(model: Any, height: float, depth: float) -> None:
    """Move the fluid from its lattice to where the wave has it at first."""
    count, k = model.geometry.fluid_count, WAVE_NUMBER
    offset = model.particles.get("offset")
    position = model.particles.get("position")
    x, y = position[:count].astype(float).T
    second = height**2 * k / (4.0 * np.sinh(k * depth) ** 2)
    moved = np.stack(
        [
            -height * np.cosh(k * y) / np.sinh(k * depth) * np.sin(k * x) + second * np.sin(2 * k * x),
            height * np.sinh(k * y) / np.sinh(k * depth) * np.cos(k * x) + second * np.sinh(2 * k * y),
        ],
        axis=1,
    )
    offset[:count] += moved
    position[:count] += moved
    model.particles.put("offset", offset)
    model.particles.put("position", position)


def energies(model: Any, spacing: float) -> tuple[float, float]:
    """Kinetic and potential energy of the fluid [J/m]."""
    count = model.geometry.fluid_count
    mass = DENSITY * spacing**2
    position, velocity = (model.particles.get(name)[:count].astype(float) for name in ("position", "velocity"))
    return 0.5 * mass * float((velocity**2).sum()), mass * GRAVITY * float(position[:, 1].sum())


def main() -> int:
    """Run one wave and print its energies; return 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scheme", default="isph", choices=["isph", "riemann", "delta_plus"])
    parser.add_argument("--spacings", type=int, default=82, help="of a wave")
    parser.add_argument("--height", type=float, default=0.0425, help="amplitude A, m")
    parser.add_argument("--standing", action="store_true")
    parser.add_argument("--periods", type=int, default=4)
    parser.add_argument("--set", nargs="*", default=[], help="further keys, as numerics.maximum_step=0.005")
    options = parser.parse_args()
    if options.spacings < 16 or options.height <= 0 or options.periods < 1:
        parser.error("--spacings has to be 16 or more, --height above 0, --periods 1 or more")
    case = case_of(options.scheme, options.spacings, options.height, options.standing, options.set)
    depth = round(DEPTH / case.spacing) * case.spacing
    model = Simulation(case, device="cpu", threads=1).model
    if not options.standing:
        displace(model, options.height, depth)
    model.stepper.prepare(fresh=True)
    period = 2.0 * np.pi / frequency(depth)
    rows = [energies(model, case.spacing)]
    for sample in range(1, options.periods * SAMPLES + 1):
        model.stepper.run(sample * period / SAMPLES, 10**9)
        model.stepper.read()
        rows.append(energies(model, case.spacing))
    kinetic, potential = np.array(rows).T
    expected = DENSITY * GRAVITY * options.height**2 / 4 * LENGTH * (0.5 if options.standing else 1.0)
    means = kinetic[:-1].reshape(options.periods, SAMPLES).mean(axis=1) / expected
    gains = (kinetic + potential)[::SAMPLES] - kinetic[0] - potential[0]
    print("kinetic energy, of theory's ", " ".join(f"{value:.3f}" for value in means))
    print("gain, J/m                  ", " ".join(f"{value:.2f}" for value in gains), f"of {2 * expected:.2f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
