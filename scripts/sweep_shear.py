"""Deformation and angle of a drop in shear over capillary number and ratio of viscosities: a map, made by `warpsph.sweep`.

    python scripts/sweep_shear.py OUTPUT [--capillary 0.1 0.2 0.3] [--viscosity 0.1 1 10] [--spacings 8]
                                  [--processes N] [--device cpu|cuda:0] [--scheduler ADDRESS]

Runs `cases/shear_drop.yaml` (Re = 0.1, equal densities, 8 R x 8 R) until the drop is steady and writes
OUTPUT/table.csv, table.h5, D.png and angle.png. Ratios of viscosities are those of the drop over the matrix. The same
command goes on where it stopped.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import warpsph

CASE = Path(__file__).parents[1] / "cases" / "shear_drop.yaml"


def study(capillary: list[float], viscosity: list[float], spacings: float) -> dict[str, Any]:
    """Return the study: units of the radius, the shear rate and the density, so that sigma = 1/(Re Ca)."""
    return {
        "case": str(CASE),
        "method": "grid",
        "parameters": {"Ca": capillary, "lambda": viscosity},
        "settings": {
            "particle_spacing": f"1/{spacings:g}",
            "phases.drop.viscosity": "{lambda}/0.1",
            "surface_tension.0.coefficient": "1/0.1/{Ca}",
            "start.pressure": "where(r < 1, 1/0.1/{Ca}, 0)",
            # a thick drop takes longer to become steady
            "end_time": "maximum(2, 20*{Ca})*maximum(1, (1 + {lambda})/2)",
        },
        "measure": {
            "D": {"gauge": "drop", "column": "deformation drop", "reduce": "final"},
            "angle": {"gauge": "drop", "column": "180/pi*angle drop", "reduce": "final"},
            "pieces": {"gauge": "pieces", "column": "count drop", "reduce": "max"},
        },
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("output", type=Path)
    parser.add_argument("--capillary", type=float, nargs="+", default=[0.1, 0.2, 0.3])
    parser.add_argument("--viscosity", type=float, nargs="+", default=[0.1, 1.0, 10.0])
    parser.add_argument("--spacings", type=float, default=8.0, help="a radius")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--scheduler", help="address of a Dask scheduler")
    options = parser.parse_args()
    table = warpsph.sweep(
        study(options.capillary, options.viscosity, options.spacings), options.output,
        processes=options.processes, device=options.device, scheduler=options.scheduler,
    )  # fmt: skip
    for ca, ratio, d, angle in zip(*(table.column(name) for name in ("Ca", "lambda", "D", "angle")), strict=True):
        print(f"Ca {ca:g}, viscosity ratio {ratio:g}: D = {d:.4f}, angle {angle:.2f} degrees")


if __name__ == "__main__":
    main()
