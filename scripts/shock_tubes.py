#!/usr/bin/env python3
"""Shock tubes with three kernels, the default and the printed form: errors against the exact solution, order, one picture.

    python scripts/shock_tubes.py table [--figure docs/validation/shock_tubes.png]
    python scripts/shock_tubes.py order [--counts 225 450 900 1800 3600 7200]
    python scripts/shock_tubes.py random [--count 20] [--seed 1]

`table` runs `cases/shock_tube.yaml` (400 particles) and `cases/sod.yaml` (720) in float64: the default, artificial viscosity
in its place, and the printed form with a constant smoothing length that reaches from particle to particle in the thin gas.
It prints L1 errors, the means of abs(q - exact) over the volume; the largest and least pressure around the contact over p*,
less 1; and the largest relative change of the total energy. `order` halves the spacing of Sod's tube. `random` draws states:
densities from 0.1 to 10, pressures from 0.02 to 55, speeds up to 0.7 of sound, gamma of 1.2, 1.4, 5/3 or 2.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "scripts")]

from exact_gas import Gas, Riemann  # noqa: E402

import warpsph  # noqa: E402

TUBES = {"shock_tube": (Gas(1, 0, 1), Gas(0.25, 0, 0.1795)), "sod": (Gas(1, 0, 1), Gas(0.125, 0, 0.1))}
FORMS = {"default": {}, "artificial": {"numerics.dissipation": "artificial"}, "paper": {"numerics.formulation": "paper"}}
# Constant smoothing length of the printed form over the mean spacing: 1.2 and 0.9 spacings of the thin gas.
REACH = {"shock_tube": 3.0, "sod": 4.0}
KERNELS = ("gaussian", "cubic", "quintic")
GAMMA = 1.4
NAMES = ("density [kg/m^3]", "velocity [m/s]", "pressure [Pa]", "energy [J/kg]")


@dataclasses.dataclass(frozen=True)
class Result:
    """What one run gave: profiles (n,), L1 errors (4,), pressures around the contact over p* less 1, drift of energy."""

    position: np.ndarray
    profiles: tuple[np.ndarray, ...]
    errors: tuple[float, ...]
    overshoot: float
    undershoot: float
    drift: float
    steps: int


def measured(name: str, changes: dict, device: str) -> Result:
    """Run a tube with changes and measure it."""
    case = warpsph.load_case(ROOT / "cases" / f"{name}.yaml").replace({"precision": "float64", **changes})
    run = warpsph.run(case, device=device, threads=1)
    state, exact = run.state, Riemann(*TUBES[name], GAMMA)
    x = state.position[:, 0]
    rho, u, p = exact.at(x, state.time)
    found = state.density, state.velocity[:, 0], state.pressure, state.pressure / (GAMMA - 1) / state.density
    right = rho, u, p, p / (GAMMA - 1) / rho
    errors = tuple(float(np.average(np.abs(a - b), weights=state.volume)) for a, b in zip(found, right, strict=True))
    # halfway to the tail of the fan and to the shock
    contact, star = exact.star.velocity, exact.star
    tail = contact - np.sqrt(GAMMA * star.pressure / star.left)
    ahead = exact.right
    shock = ahead.velocity + np.sqrt(
        ((GAMMA + 1) / 2 * star.pressure + (GAMMA - 1) / 2 * ahead.pressure) / ahead.density
    )
    near = (x / state.time > 0.5 * (tail + contact)) & (x / state.time < 0.5 * (shock + contact))
    around = state.pressure[near] / star.pressure - 1
    energy = run.gauge("energy")["total"]
    order = np.argsort(x)
    return Result(
        x[order], tuple(values[order] for values in found), errors, float(around.max()), float(around.min()),
        float(np.abs(energy / energy[0] - 1).max()), run.summary["steps"],
    )  # fmt: skip


def row(label: str, result: Result) -> str:
    """One line of a table."""
    errors = " | ".join(f"{error:.5f}" for error in result.errors)
    return f"| {label} | {errors} | {result.overshoot:+.3f} {result.undershoot:+.3f} | {result.drift:.0e} | {result.steps} |"


def head(first: str) -> str:
    """The first lines of a table."""
    names = " | ".join(f"L1 {name.split()[0]}" for name in NAMES)
    return f"| {first} | {names} | pressure at the contact | energy | steps |\n|{'---|' * 8}"


def table(device: str, figure: Path | None) -> None:
    """Print all tubes, forms and kernels, and draw them."""
    found: dict[tuple[str, str, str], Result] = {}
    for name in TUBES:
        print(head(f"{name}: form, kernel"), flush=True)
        for form, changes in FORMS.items():
            for kernel in KERNELS:
                reach = {"numerics.smoothing_ratio": REACH[name]} if form == "paper" else {}
                result = measured(name, {**changes, **reach, "numerics.kernel": kernel}, device)
                found[name, form, kernel] = result
                print(row(f"{form}, {kernel}", result), flush=True)
        print()
    if figure is not None:
        draw(found, figure)


def draw(found: dict[tuple[str, str, str], Result], path: Path) -> None:
    """Draw the four profiles of each tube: kernels of the default form and of the printed one over the exact solution."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(4, len(TUBES) * 2, figsize=(20, 15), layout="constrained", sharex="col")
    for column, (name, form) in enumerate((name, form) for name in TUBES for form in ("default", "paper")):
        case = warpsph.load_case(ROOT / "cases" / f"{name}.yaml")
        x = np.linspace(case.domain.lower[0], case.domain.upper[0], 4001)
        rho, u, p = Riemann(*TUBES[name], GAMMA).at(x, case.end_time)
        for axis, exact, label, quantity in zip(
            axes[:, column], (rho, u, p, p / (GAMMA - 1) / rho), NAMES, range(4), strict=True
        ):
            for kernel, mark in zip(KERNELS, ("+", "x", "."), strict=True):
                result = found[name, form, kernel]
                axis.plot(result.position, result.profiles[quantity], mark, ms=3.5, mew=0.6, label=kernel)
            axis.plot(x, exact, "k", lw=0.8, label="exact")
            axis.set_ylabel(label)
            axis.grid(lw=0.3)
        axes[0, column].set_title(f"{name}, {len(result.position)} particles, {form}")
        axes[-1, column].set_xlabel("x [m]")
    axes[0, 0].legend()
    figure.savefig(path, dpi=70)
    plt.close(figure)


def order(device: str, counts: list[int]) -> None:
    """Print the errors of Sod's tube while the spacing falls, and the slope of that of the density."""
    print(head("sod: particles"), flush=True)
    errors = []
    for count in counts:
        result = measured("sod", {"particle_spacing": 1 / count}, device)
        errors.append(result.errors[0])
        print(row(str(count), result), flush=True)
    slopes = -np.diff(np.log(errors)) / np.diff(np.log(counts))
    all_of_them = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    print(f"\norders {', '.join(f'{slope:.2f}' for slope in slopes)}; all: {all_of_them:.2f}")


def drawn(generator: np.random.Generator) -> tuple[Gas, Gas, float]:
    """Two states and a ratio of heats that nobody chose."""
    density = np.exp(generator.uniform(-2.3, 2.3, 2))
    pressure = np.exp(generator.uniform(-4, 4, 2))
    gamma = float(generator.choice([1.2, 1.4, 5 / 3, 2.0]))
    speed = generator.uniform(-0.7, 0.7, 2) * np.sqrt(gamma * pressure / density)
    left, right = (Gas(*map(float, state)) for state in zip(density, speed, pressure, strict=True))
    return left, right, gamma


def random(device: str, count: int, seed: int) -> None:
    """Print errors of random Riemann problems between open ends: 400 particles of equal mass, float32."""
    given, errors_of = "left: density, velocity, pressure | right | gamma", "L1 density | velocity | pressure"
    print(f"| {given} | {errors_of} | least density | least pressure |\n|{'---|' * 8}")
    generator = np.random.default_rng(seed)
    for _ in range(count):
        left, right, gamma = drawn(generator)
        states = zip(dataclasses.astuple(left), dataclasses.astuple(right), strict=True)
        density, velocity, pressure = (f"where(x < 0, {a!r}, {b!r})" for a, b in states)
        fastest = max(abs(gas.velocity) + gas.sound(gamma) for gas in (left, right))
        run = warpsph.run(
            {
                "dimension": 1, "particle_spacing": 1 / 400, "end_time": 0.25 / fastest,
                "domain": {"lower": [-0.5], "upper": [0.5], "boundary": {"x": "open"}},
                "phases": {"gas": {"density": 0.5 * (left.density + right.density), "gamma": gamma}},
                "fluids": [{"phase": "gas", "shape": "rest"}],
                "start": {"arrangement": "equal_mass", "density": density, "velocity": [velocity], "pressure": pressure},
                "numerics": {"scheme": "gas"},
            },
            device=device, threads=1,
        )  # fmt: skip
        state = run.state
        x = state.position[:, 0]
        inside = np.abs(x) < 0.35  # what no end has moved away from, nor was held
        found = state.density, state.velocity[:, 0], state.pressure
        errors = []
        for value, exact in zip(found, Riemann(left, right, gamma).at(x, state.time), strict=True):
            far = np.average(np.abs(value - exact)[inside], weights=state.volume[inside])
            errors.append(f"{100 * far / max(float(np.ptp(exact)), 1e-12):.2f} %")
        sides = " | ".join(f"{gas.density:.3g}, {gas.velocity:.3g}, {gas.pressure:.3g}" for gas in (left, right))
        least = f"{state.density.min():.3g} | {state.pressure.min():.3g}"
        print(f"| {sides} | {gamma:.2f} | {' | '.join(errors)} | {least} |", flush=True)


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = parser.add_subparsers(dest="kind", required=True)
    one = kinds.add_parser("table")
    one.add_argument("--figure", type=Path, help="picture to write")
    two = kinds.add_parser("order")
    two.add_argument("--counts", type=int, nargs="+", default=[225, 450, 900, 1800, 3600, 7200])
    three = kinds.add_parser("random")
    three.add_argument("--count", type=int, default=20)
    three.add_argument("--seed", type=int, default=1)
    for kind in (one, two, three):
        kind.add_argument("--device", default="cpu")
    options = parser.parse_args()
    if options.kind == "table":
        table(options.device, options.figure)
    elif options.kind == "order":
        order(options.device, options.counts)
    else:
        random(options.device, options.count, options.seed)


if __name__ == "__main__":
    main()
