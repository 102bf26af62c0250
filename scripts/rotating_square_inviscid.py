"""Reference solution of the rotating square of ideal liquid: the limit of finite elements at three Reynolds numbers.

    python scripts/rotating_square_inviscid.py --output square   # pip install triangle; 10 minutes on two cores

Without friction the surface has no smooth solution to compute directly: the pressure falls from it into the liquid, so
that every ripple of it grows, the shorter the faster (Rayleigh-Taylor), and a mesh makes ripples.  With a little friction
short ones die, and what is left depends on it smoothly: in 1 / Re, Re = omega L^2 / nu, to first order, since a free
surface has no layer that would bring in a root of it.  So `rotating_square_exact.py` is run at Re = 1 000, 2 000 and
3 000, and pressure, energy and outline are continued along a straight line in 1 / Re from the first and the last of them
to 0.  The middle one tells how straight the line is: the difference from it at its own 1 / Re is printed.

Writes centre.csv (every 0.02 of omega t: time, pressure at the centre, radius of the tips, kinetic energy),
outline_wt1.csv and outline_wt2.csv to the output folder, and the runs to folders in it.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rotating_square_exact import checked, run

Floats = NDArray[np.float64]
REYNOLDS = (1000.0, 2000.0, 3000.0)
# The columns of centre.csv of a run that have a limit: the nearest place of the surface is where ripples show first.
COLUMNS = {"p_centre_over_rho_w2_L2": 1, "r_max_tip_over_L": 2, "kinetic_energy_over_rho_w2_L4": 4}


def along_line(reynolds: tuple[float, float], values: tuple[Floats, Floats], wanted: float) -> Floats:
    """Return what the straight line in 1/Re through two values (any shape) has at 1/Re = `wanted`, 0 for the limit."""
    first, last = 1 / reynolds[0], 1 / reynolds[1]
    slope = (values[1] - values[0]) / (last - first)
    return np.asarray(values[1] + slope * (wanted - last))


def continued(runs: list[Path], name: str, wanted: float) -> Floats:
    """Return the table `name` of the first and the last run, continued to 1/Re = `wanted`."""
    tables = [np.loadtxt(folder / name, delimiter=",", skiprows=1) for folder in (runs[0], runs[-1])]
    return along_line((REYNOLDS[0], REYNOLDS[-1]), (tables[0], tables[1]), wanted)


def main() -> None:
    """Read the arguments, run the three and write their limit."""
    parser = argparse.ArgumentParser(description="Rotating square of ideal liquid, as the limit of Re = 1 000 to 3 000.")
    parser.add_argument("--size", type=float, default=0.02, help="length of the elements at the surface over L")
    parser.add_argument("--step", type=float, default=0.005, help="time step times omega")
    parser.add_argument("--end", type=float, default=2.0, help="end of the run, omega t")
    parser.add_argument("--processes", type=int, default=2, help="runs at the same time")
    parser.add_argument("--output", type=Path, default=Path("out"), help="folder for the results")
    a = checked(parser)
    runs = [a.output / f"re{number:g}" for number in REYNOLDS]
    with ProcessPoolExecutor(a.processes) as pool:
        for done in [pool.submit(run, number, a.size, a.step, a.end, folder, 0.1, 2)
                     for number, folder in zip(REYNOLDS, runs, strict=True)]:
            done.result()
    columns = [0, *COLUMNS.values()]
    table = continued(runs, "centre.csv", 0)[:, columns]
    np.savetxt(a.output / "centre.csv", table, "%.6g", ",", comments="", header=",".join(["omega_t", *COLUMNS]))
    middle = np.loadtxt(runs[1] / "centre.csv", delimiter=",", skiprows=1)[:, columns]
    off = np.abs(middle - continued(runs, "centre.csv", 1 / REYNOLDS[1])[:, columns]).max(axis=0)
    print("largest distance of the middle run from the line:", dict(zip(COLUMNS, off[1:].tolist(), strict=True)))
    for name in ("outline_wt1.csv", "outline_wt2.csv"):
        if (runs[0] / name).exists():
            header = "x1_over_L,y1_over_L,x2_over_L,y2_over_L"
            np.savetxt(a.output / name, continued(runs, name, 0), "%.6f", ",", comments="", header=header)
            middle = np.loadtxt(runs[1] / name, delimiter=",", skiprows=1)
            print(name, "the same:", np.abs(middle - continued(runs, name, 1 / REYNOLDS[1])).max())


if __name__ == "__main__":
    main()
