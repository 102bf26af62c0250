"""How stiff a lattice of particles under pressure is against shear, and what that makes of the frequency of waves.

    python scripts/lattice_stiffness.py --kernel wendland_c2 --ratio 1.2 1.5 1.8 2 2.5

With the conservative gradient and a density that the velocities integrate, a particle resists by its pressure that the sum
n = sum_j V W(x_ij) over its neighbours changes. A flow without divergence keeps the density, not n: a lattice strained by
(e, -e) along two axes at right angles has to second order

    n = n_0 (1 + 2 kappa e^2),   an energy of 2 kappa e^2 p a volume, a shear modulus kappa p,

a pure number of the kernel, the ratio h over the spacing and the direction: it does not fall with the spacing. Under a
wave on deep water with displacement X e^(ky) the pressure is rho g |y| and e = k X e^(ky); the strain has kappa/2 rho g X^2
an area where the weight has rho g X^2/4, so that the frequency is high by the share kappa, linear in the wave: until
the lattice yields. Printed: mean, least and largest kappa over the directions of a square lattice and of a hexagonal one.

Beside it: what the sum of the lattice makes of a pressure gradient of 1, less 1: a column at rest has so much more pressure.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
STRAIN = 0.02
DIRECTIONS = 24


def lattice(kind: str, reach: float) -> Points:
    """Places (n, 2) within `reach` of one of them, a place for each unit of area; kind: square or hexagonal."""
    steps = np.arange(-2 * int(np.ceil(reach)), 2 * int(np.ceil(reach)) + 1)
    x, y = (axis.ravel().astype(np.float64) for axis in np.meshgrid(steps, steps))
    if kind == "hexagonal":
        side = np.sqrt(2 / np.sqrt(3))
        x, y = side * (x + y / 2), side * np.sqrt(3) / 2 * y
    near = np.hypot(x, y) < reach
    return np.column_stack([x[near], y[near]])


def stiffness(kernel: str, ratio: float, kind: str) -> NDArray[np.float64]:
    """kappa for each of `DIRECTIONS` directions of the strain from 0 to a quarter turn; ratio: h over the spacing."""
    import warp as wp

    from warpsph.kernels.core.smoothing import KERNELS, make_smoothing

    shape, _ = make_smoothing(kernel, "float64")
    places = lattice(kind, 1.1 * KERNELS[kernel].support * ratio)

    def crowd(angle: float, strain: float) -> float:
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        strained = places @ turn * [np.exp(strain), np.exp(-strain)]
        return sum(float(shape(wp.float64(distance / ratio))) for distance in np.hypot(*strained.T))

    angles = np.linspace(0, np.pi / 2, DIRECTIONS, endpoint=False)
    ends = [np.log(crowd(a, STRAIN) * crowd(a, -STRAIN) / crowd(a, 0.0) ** 2) for a in angles]
    return np.array(ends) / (4 * STRAIN**2)


def gradient(kernel: str, ratio: float, kind: str) -> float:
    """What the lattice makes of a gradient of 1, less 1: -sum V x^2 W'/r - 1, the mean over both axes."""
    import warp as wp

    from warpsph.kernels.core.smoothing import KERNELS, make_smoothing

    _, slope = make_smoothing(kernel, "float64")
    distances = np.hypot(*lattice(kind, 1.1 * KERNELS[kernel].support * ratio).T) / ratio
    total = sum(float(slope(wp.float64(q))) * q**2 for q in distances)
    return -0.5 * KERNELS[kernel].alpha[1] / ratio**2 * total - 1.0


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kernel", default="wendland_c2", help="a smoothing kernel of the case file (default wendland_c2)")
    parser.add_argument("--ratio", type=float, nargs="+", default=[1.2, 1.5, 1.8, 2.0, 2.5], help="h over the spacing")
    chosen = parser.parse_args()
    from warpsph.kernels.core.smoothing import KERNELS

    if chosen.kernel not in KERNELS:
        parser.error(f"--kernel {chosen.kernel}: needs one of {', '.join(KERNELS)}")
    if not all(ratio >= 1 for ratio in chosen.ratio):
        parser.error("--ratio: needs numbers from 1 on; below, a particle has no neighbours to speak of")
    print(f"{'lattice':10} {'h/dx':>5} {'mean':>8} {'least':>8} {'largest':>8} {'gradient':>9}")
    for kind in ("square", "hexagonal"):
        for ratio in chosen.ratio:
            kappa = stiffness(chosen.kernel, ratio, kind)
            off = gradient(chosen.kernel, ratio, kind)
            print(f"{kind:10} {ratio:5g} {kappa.mean():8.4f} {kappa.min():8.4f} {kappa.max():8.4f} {off:9.4f}")


if __name__ == "__main__":
    main()
