"""Pull of the program's surface tension on a point where three straight interfaces meet, against the sum of the tensions.

    python scripts/triple_point.py --tensions 1 0.8 0.6 --angles 90 143.13 126.87

Three phases meet in the middle of a box, with the angles given (of oil, water and air, degrees; the tensions are those of
water-air, water-oil and oil-air). Exactly, the pull on what is around the point is the sum of sigma t over the three
interfaces, t the direction in which each leaves: nothing if the angles are those of Neumann's triangle. The program has no
force of tension but jumps of pressure between pairs of particles (theory: riemann#a6), of which a pair feels
-V_i V_j J_ij grad_i W on either side. Summed over all particles within 9 spacings of the point, at rest and without
pressure, the forces of the momentum sweep with the conservative gradient are its pull; straight interfaces add nothing to
it. Means and standard errors over `--turns` turns of the three interfaces, each with an arrangement of its own. `--ratio` is
h over the spacing: there is no other length. The other rows are sums over pairs: with the jumps of the program, with means
of the curvature that are not sharpened, and with the tension of each pair instead of parts of phases.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

NAMES = ("oil", "water", "air")
REACH = 9.0  # around the point, in spacings
HALF_BOX = 18  # in spacings


def three_sectors(directions: np.ndarray, tensions: np.ndarray, ratio: float | str = "auto") -> Any:
    """Return the case: oil from the first to the second direction [rad], then water, then air; spacing 1, h = ratio."""
    from warpsph import Case

    # In front of both sides of a sector (the outside of both, of one that is wider than half a turn) a point is in it.
    def sector(first: float, second: float) -> str:
        sides = [f"{math.cos(first)}*y - {math.sin(first)}*x > 0", f"{math.cos(second)}*y - {math.sin(second)}*x < 0"]
        return (" and " if (second - first) % (2 * math.pi) < math.pi else " or ").join(sides)

    oil, water = sector(directions[0], directions[1]), sector(directions[1], directions[2])
    pairs = [(0, 1), (0, 2), (1, 2)]
    return Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": 1.0,
            "end_time": 1.0e9,
            "precision": "float64",
            "domain": {
                "lower": [-HALF_BOX] * 2,
                "upper": [HALF_BOX] * 2,
                "boundary": {"x": "free_slip", "y": "free_slip"},
            },
            "phases": {name: {"density": 1.0, "viscosity": 1.0} for name in NAMES},
            "surface_tension": [{"between": [NAMES[a], NAMES[b]], "coefficient": float(tensions[a, b])} for a, b in pairs],
            "fluids": [
                {"phase": "oil", "shape": {"where": {"condition": oil}}},
                {"phase": "water", "shape": {"where": {"condition": water}}},
                {"phase": "air", "shape": "rest"},
            ],
            "numerics": {"smoothing_ratio": ratio, "pressure_gradient": "conservative"},
            "start": {"arrangement": "lattice", "noise": 0.15},
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )


def pulls(case: Any, tensions: np.ndarray) -> dict[str, np.ndarray]:
    """Return the pull (2,) on the middle of the box by the program, and by jumps of pairs from its curvatures."""
    from scipy.spatial import cKDTree

    from warpsph.running.model import Model
    from warpsph.scene.physics import smoothing_ratio

    model = Model(case, device="cpu", threads=1)
    model.stepper.prepare(fresh=True)
    names = ("phase", "curvature", "mean_curvature", "interface_weight", "position", "state", "acceleration")
    phase, curvature, mean, weight, x, state, acceleration = (np.asarray(model.particles.get(name)) for name in names)
    # walls stand behind the fluid, in the fields that have them
    x, volume = x[: len(phase)], state[: len(phase), 1]
    around = np.hypot(*x.T) < REACH
    program = (volume[:, None] * acceleration)[around].sum(axis=0)  # of fluids with the density 1
    support = 2.0 * smoothing_ratio(case)
    pairs = cKDTree(x).query_pairs(support, output_type="ndarray")
    i, j = pairs[phase[pairs[:, 0]] != phase[pairs[:, 1]]].T
    near = np.hypot(*(0.5 * (x[i] + x[j])).T) < REACH
    i, j = i[near], j[near]
    a, b = phase[i], phase[j]
    d = x[i] - x[j]
    q = np.hypot(*d.T) / support
    # Wendland C2 in 2-D: W'(r)/r
    slope = -140.0 / (math.pi * support**4) * (1.0 - q) ** 3 * volume[i] * volume[j]
    # Of the tension of a pair each phase has its part: sigma_ij = s_i + s_j for all three pairs.
    part = tensions.sum(axis=1) - 0.5 * np.triu(tensions).sum()

    def between(kappa: np.ndarray, k: np.ndarray) -> np.ndarray:
        """Return the curvature of the phases k of the pairs, weighted as the program does."""
        both = weight[i, k] + weight[j, k]
        return np.where(both > 1e-9, weight[i, k] * kappa[i, k] + weight[j, k] * kappa[j, k], 0.0) / np.maximum(both, 1e-9)

    jumps = {
        "its pairs": part[a] * between(curvature, a) - part[b] * between(curvature, b),
        "smoothed": part[a] * between(mean, a) - part[b] * between(mean, b),
        "tension of pair": 0.5 * tensions[a, b] * (between(curvature, a) - between(curvature, b)),
    }
    return {"program": program, **{name: -2.0 * (jump * slope) @ d for name, jump in jumps.items()}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tensions", nargs=3, type=float, default=[1, 0.8, 0.6], metavar=("WA", "WO", "OA"))
    parser.add_argument("--angles", nargs=3, type=float, default=[90, 143.13, 126.87], metavar=NAMES)
    parser.add_argument("--turns", type=int, default=12)
    parser.add_argument("--ratio", type=float, help="h over the spacing (default: that of the program)")
    chosen = parser.parse_args()
    water_air, water_oil, oil_air = chosen.tensions
    tensions = np.array([[0, water_oil, oil_air], [water_oil, 0, water_air], [oil_air, water_air, 0]])
    directions = np.radians(np.cumsum([0.0, chosen.angles[0], chosen.angles[1]]))
    # of oil-air, water-oil, water-air
    exact = np.array([oil_air, water_oil, water_air]) @ np.column_stack([np.cos(directions), np.sin(directions)])
    rows: dict[str, list[np.ndarray]] = {}
    for number in range(chosen.turns):
        turn = 2.0 * math.pi * (number + 0.3) / chosen.turns
        back = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        case = three_sectors(directions + turn, tensions, chosen.ratio or "auto")
        for name, pull in pulls(case, tensions).items():
            rows.setdefault(name, []).append(back @ pull)
    print(f"{'jump':16} {'pull x':>8} {'y':>8} {'off by':>8}   (along and across oil-air)")
    print(f"{'exact':16} {exact[0]:8.3f} {exact[1]:8.3f}")
    for name, found in rows.items():
        mean, error = np.mean(found, axis=0), np.std(found, axis=0).max() / math.sqrt(chosen.turns)
        print(f"{name:16} {mean[0]:8.3f} {mean[1]:8.3f} {np.hypot(*(mean - exact)):8.3f} +- {error:.3f}")


if __name__ == "__main__":
    main()
