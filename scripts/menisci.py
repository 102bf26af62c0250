"""Pressure jumps of the menisci of three fluids one after another between two plates, against Laplace and Young.

    python scripts/menisci.py --spacings 8 16 32

Water, oil and air fill a slit of 4 mm, each 8 mm of it, without weight. Where two of them meet stands a meniscus, an arc
that meets both plates at the contact angle of the pair: the pressures on its sides differ by 2 sigma cos(angle)/width. Two
angles are chosen, the third is the one of Young's equation (docs/case.md). Tensions near those of water, oil and air;
fluids are thick and air has 10 kg/m^3, so that the menisci come to rest in 0.2 s. `--walls wall` are plates with friction.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

from warpsph.errors import CaseError, Problem

WIDTH = 0.004  # m, between the plates
LENGTH = 0.008  # m, of each fluid along them
NAMES = ("water", "oil", "air")
WATER_AIR, OIL_AIR, OIL_WATER = 0.072, 0.030, 0.045  # N/m
WATER, OIL = 50.0, 35.0  # degrees, of the water and of the oil beside air


def young() -> float:
    """Return the contact angle of the oil beside the water [degrees] that belongs to the two others."""
    cosine = OIL_AIR * math.cos(math.radians(OIL)) - WATER_AIR * math.cos(math.radians(WATER))
    return math.degrees(math.acos(cosine / OIL_WATER))


def slit(spacings: int, walls: str = "free_slip") -> Any:
    """Return the case with `spacings` particles between the plates."""
    from warpsph import Case

    if spacings < 4:
        rule = "the menisci are as wide as the slit, and a kernel reaches three spacings"
        raise CaseError([Problem("--spacings", spacings, rule, "write 4 or more")])
    boxes = [{"box": {"lower": [LENGTH * k, 0], "upper": [LENGTH * (k + 1), WIDTH]}} for k in range(3)]
    return Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": WIDTH / spacings,
            "end_time": 0.2,
            "domain": {"lower": [0, 0], "upper": [3 * LENGTH, WIDTH], "boundary": {"x": "wall", "y": walls}},
            "phases": {
                "water": {"density": 998, "viscosity": 0.02},
                "oil": {"density": 870, "viscosity": 0.05},
                "air": {"density": 10, "viscosity": 0.01},
            },
            "surface_tension": [
                {"between": ["water", "air"], "coefficient": WATER_AIR, "contact_angle": WATER},
                {"between": ["oil", "air"], "coefficient": OIL_AIR, "contact_angle": OIL},
                {"between": ["oil", "water"], "coefficient": OIL_WATER, "contact_angle": young()},
            ],
            "fluids": [{"phase": name, "shape": box} for name, box in zip(NAMES, boxes, strict=True)],
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )


def jumps(case: Any) -> dict[str, tuple[float, float]]:
    """Return for the two menisci the jump at the end of the run and the exact one [Pa], the pressure behind over before."""
    from warpsph.running.model import Model

    model = Model(case, device="cpu", threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(case.end_time, 10**8)
    fluid = model.snapshot().fluid
    x, pressure = np.asarray(fluid.position)[:, 0], np.asarray(fluid.pressure)
    middles = [pressure[np.abs(x - LENGTH * (k + 0.5)) < LENGTH / 5].mean() for k in range(3)]
    exact = [2.0 * sigma * math.cos(math.radians(angle)) / WIDTH for sigma, angle in ((OIL_WATER, young()), (OIL_AIR, OIL))]
    # oil is behind water and before air: the pressure in the phase of the angle is the lower one where that is below 90
    return {
        "water, oil": (float(middles[1] - middles[0]), -exact[0]),
        "oil, air": (float(middles[2] - middles[1]), exact[1]),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacings", nargs="+", type=int, default=[8, 16], help="between the plates")
    parser.add_argument("--walls", choices=("free_slip", "wall"), default="free_slip", help="the plates")
    chosen = parser.parse_args()
    try:
        cases = [slit(spacings, chosen.walls) for spacings in chosen.spacings]
    except CaseError as error:
        parser.error(str(error))
    print(f"{'spacings':>8}  {'meniscus':12} {'jump, Pa':>9} {'exact':>9} {'off by':>8}")
    for spacings, case in zip(chosen.spacings, cases, strict=True):
        for name, (found, exact) in jumps(case).items():
            print(f"{spacings:8}  {name:12} {found:9.3f} {exact:9.3f} {found / exact - 1:8.2%}")


if __name__ == "__main__":
    main()
