"""Pull of the program's surface tension on a point where three straight interfaces meet, against the sum of the tensions.

    python scripts/triple_point.py --tensions 1 0.8 0.6 --angles 90 143.13 126.87

Three phases meet in the middle of a box, with the angles given (of oil, water and air, degrees; the tensions are those of
water-air, water-oil and oil-air). Exactly, the pull on what is around the point is the sum of sigma t over the three
interfaces, t the direction in which each leaves: nothing if the angles are those of Neumann's triangle. The program has no
force of tension but jumps of pressure between pairs of particles (theory: riemann#a6), of which a pair feels
-V_i V_j J_ij grad_i W on either side. Summed over all pairs across interfaces within 9 spacings of the point that is its
pull; straight interfaces add nothing to it. Means and standard errors over `--turns` turns of the three interfaces, each
with an arrangement of its own. The other rows take other jumps with the same curvature: see docs/records/tension.md.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

NAMES = ("oil", "water", "air")
REACH = 9.0  # around the point, in spacings
HALF_BOX = 18  # in spacings


def three_sectors(directions: np.ndarray, tensions: np.ndarray) -> Any:
    """Return the case: oil from the first to the second direction [rad], then water, then air; spacing 1."""
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
            "start": {"arrangement": "lattice", "noise": 0.15},
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )


def pulls(case: Any, tensions: np.ndarray) -> dict[str, np.ndarray]:
    """Return the pull (2,) on the middle of the box by the jumps of the program, and by others with its curvature."""
    from scipy.spatial import cKDTree

    from warpsph.running.model import Model
    from warpsph.scene.physics import smoothing_ratio

    model = Model(case, device="cpu", threads=1)
    model.stepper.prepare(fresh=True)
    names = ("phase", "curvature", "interface_weight", "position", "state")
    phase, curvature, weight, x, state = (np.asarray(model.particles.get(name)) for name in names)
    # walls stand behind the fluid, in the fields that have them
    x, volume = x[: len(phase)], state[: len(phase), 1]
    support = 2.0 * smoothing_ratio(case)
    pairs = cKDTree(x).query_pairs(support, output_type="ndarray")
    i, j = pairs[phase[pairs[:, 0]] != phase[pairs[:, 1]]].T
    near = (np.hypot(*(0.5 * (x[i] + x[j])).T) < REACH) & (weight[i] + weight[j] > 1e-9)
    i, j = i[near], j[near]
    d = x[i] - x[j]
    q = np.hypot(*d.T) / support
    # Wendland C2 in 2-D: W'(r)/r
    slope = -140.0 / (math.pi * support**4) * (1.0 - q) ** 3 * volume[i] * volume[j]
    # Of the tension of a pair each phase has its part: sigma_ij = s_i + s_j for all three pairs.
    part = tensions.sum(axis=1) - 0.5 * np.triu(tensions).sum()
    wi, wj = weight[i] / (weight[i] + weight[j]), weight[j] / (weight[i] + weight[j])
    jumps = {
        "program": tensions[phase[i], phase[j]] * (wi * curvature[i] - wj * curvature[j]),
        "parts of phases": part[phase[i]] * curvature[i] - part[phase[j]] * curvature[j],
        "parts, weighted": 2.0 * (part[phase[i]] * wi * curvature[i] - part[phase[j]] * wj * curvature[j]),
    }
    return {name: -2.0 * (jump * slope) @ d for name, jump in jumps.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tensions", nargs=3, type=float, default=[1, 0.8, 0.6], metavar=("WA", "WO", "OA"))
    parser.add_argument("--angles", nargs=3, type=float, default=[90, 143.13, 126.87], metavar=NAMES)
    parser.add_argument("--turns", type=int, default=12)
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
        for name, pull in pulls(three_sectors(directions + turn, tensions), tensions).items():
            rows.setdefault(name, []).append(back @ pull)
    print(f"{'jump':16} {'pull x':>8} {'y':>8} {'off by':>8}   (along and across oil-air)")
    print(f"{'exact':16} {exact[0]:8.3f} {exact[1]:8.3f}")
    for name, found in rows.items():
        mean, error = np.mean(found, axis=0), np.std(found, axis=0).max() / math.sqrt(chosen.turns)
        print(f"{name:16} {mean[0]:8.3f} {mean[1]:8.3f} {np.hypot(*(mean - exact)):8.3f} +- {error:.3f}")


if __name__ == "__main__":
    main()
