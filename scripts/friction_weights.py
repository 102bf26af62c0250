"""Weights of radial friction that feel neither rows nor disorder: how they were found, and how well they do.

    python scripts/friction_weights.py            # errors of the weights in use
    python scripts/friction_weights.py --fit      # finds them anew, a minute on one core

What radial friction makes of a quadratic velocity is the sum of F x_i x_j x_k x_l / r^2 over the neighbours: sum/integral is
the viscosity that a flow has, over the given one.  F = -K (1 - s)^1.5 (1 + a_1 s + ... + a_4 s^4), s = r/R, R the support,
with a_k such that sums are integrals as nearly as possible, by least squares, over supports of 2.6 to 5 spacings (those of 3
and 4, h = 1.5 and 2 spacings with Wendland's kernels, count most), on

    lattices    2-D: square, hexagonal; 3-D: simple, face-centred and body-centred cubic: shear and stretching along the axes
    rows        what fluid is that slides: its neighbours are in rows (2-D) or layers (3-D) a spacing apart, and anywhere
                along them; shear across
    disorder    random places that pushed each other apart, as shifted particles have: the mean, and the scatter from
                particle to particle
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from warpsph.kernels.core.viscosity import FRICTION_SHAPE

Floats = NDArray[np.float64]
Weights = Callable[[Floats], Floats]
TERMS = 5
# Supports in spacings and how much each counts.
SUPPORTS = {2.6: 0.3, 2.8: 0.5, 3.0: 3.0, 3.2: 0.7, 3.4: 0.7, 3.6: 0.7, 4.0: 2.0, 4.5: 0.5, 5.0: 0.5}
ROWS, SCATTER, WHOLE = 1.5, 0.3, 1000.0  # how much rows, the scatter and the integral itself count
POINTS, POINT_WEIGHTS = np.polynomial.legendre.leggauss(200)
# Vectors of cells of volume 1, and the places in a cell.
CELLS: dict[str, tuple[float, Floats]] = {
    "square": (1.0, np.zeros((1, 2))),
    "simple": (1.0, np.zeros((1, 3))),
    "body": (2 ** (1 / 3), np.array([[0, 0, 0], [0.5, 0.5, 0.5]])),
    "face": (4 ** (1 / 3), np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])),
}


def basis(power: int) -> Weights:
    """Return (1 - s)^1.5 s^power."""
    return lambda s: np.maximum(1 - s, 0) ** 1.5 * s**power


def shape(factors: Floats | tuple[float, ...]) -> Weights:
    """Return the weights with the given factors of the powers of s."""
    return lambda s: sum((f * basis(k)(s) for k, f in enumerate(factors)), np.zeros_like(s))


def integral(weights: Weights, support: float, dimension: int) -> float:
    """Return the integral of w x^2 y^2/r^2 over the ball of the radius `support` in spacings."""
    r = 0.5 * support * (POINTS + 1)
    sphere = 2 * math.pi ** (dimension / 2) / math.gamma(dimension / 2)
    inside = (0.5 * support * POINT_WEIGHTS * weights(r / support) * r ** (dimension + 1)).sum()
    return float(sphere * inside / (dimension * (dimension + 2)))


def lattice(name: str, support: float) -> Floats:
    """Return the neighbours (n, dimension) of a lattice with a volume of 1 a place."""
    if name == "hexagonal":
        side = math.sqrt(2 / math.sqrt(3))
        count = np.arange(-2 * int(support) - 4, 2 * int(support) + 5)
        i, j = (a.ravel() for a in np.meshgrid(count, count))
        places = np.stack([(i + 0.5 * j) * side, 0.5 * math.sqrt(3) * j * side], axis=1)
    else:
        side, cell = CELLS[name]
        count = np.arange(-int(support) - 2, int(support) + 3)
        corners = np.stack([a.ravel() for a in np.meshgrid(*[count] * cell.shape[1])], axis=1)
        places = side * (corners[:, None] + cell[None]).reshape(-1, cell.shape[1])
    r = np.linalg.norm(places, axis=1)
    return np.asarray(places[(r > 1e-9) & (r < support)])


def moments(weights: Weights, support: float, away: Floats) -> Floats:
    """Return what each neighbour (n, dimension) adds to stretching along each axis and to shear, 1 in sum if all is right.

    Stretching along x is sum w x^4/r^2 / 3, shear the sum of w x^2 y^2/r^2 over the first two axes.
    """
    square = away**2
    r2 = square.sum(axis=1)
    each = weights(np.sqrt(r2) / support) / r2
    parts = [each * square[:, a] ** 2 / 3 for a in range(away.shape[1])] + [each * square[:, 0] * square[:, 1]]
    return np.stack(parts, axis=1) / integral(weights, support, away.shape[1])


def sliding(weights: Weights, support: float, dimension: int) -> float:
    """Return the viscosity over the given one of shear across rows or layers a spacing apart, with no order along them."""
    total = 0.0
    for row in range(1, math.ceil(support)):
        half = math.sqrt(support**2 - row**2)
        r = 0.5 * half * (POINTS + 1)
        # Along a row to both sides; in a layer by rings, half of whose x^2 + z^2 is x^2.
        measure = 2 * np.ones_like(r) if dimension == 2 else math.pi * r
        r2 = r**2 + row**2
        total += 2 * (0.5 * half * POINT_WEIGHTS * measure * weights(np.sqrt(r2) / support) * r**2 * row**2 / r2).sum()
    return float(total / integral(weights, support, dimension))


def disordered(dimension: int, count: int = 7, steps: int = 400) -> tuple[Floats, float]:
    """Return random places (n, dimension) in a periodic box of volume n that pushed each other apart, and its side."""
    rng = np.random.default_rng(dimension)
    side = float(3 * count if dimension == 2 else count)
    x = rng.uniform(0, side, (round(side**dimension), dimension))
    for _ in range(steps):
        pairs = cKDTree(x, boxsize=side).query_pairs(1.9, output_type="ndarray")
        away = x[pairs[:, 0]] - x[pairs[:, 1]]
        away -= side * np.round(away / side)
        r = np.linalg.norm(away, axis=1)
        push = 0.1 * (1 - r / 1.9)[:, None] ** 2 * away / r[:, None]
        for column, sign in ((0, 1.0), (1, -1.0)):
            np.add.at(x, pairs[:, column], sign * push)
        x %= side
    return x, side


def around(places: Floats, side: float, support: float) -> tuple[Floats, NDArray[np.int64]]:
    """Return the vectors (pairs, dimension) to the neighbours of all places in a periodic box, and whose they are."""
    pairs = cKDTree(places, boxsize=side).query_pairs(support, output_type="ndarray")
    away = places[pairs[:, 1]] - places[pairs[:, 0]]
    away -= side * np.round(away / side)
    return np.vstack([away, -away]), np.concatenate([pairs[:, 0], pairs[:, 1]])


def disorder(weights: Weights, support: float, places: Floats, side: float) -> Floats:
    """Return stretching and shear (places, dimension + 1) of each place."""
    away, whose = around(places, side, support)
    each = moments(weights, support, away)
    return np.stack([np.bincount(whose, column, len(places)) for column in each.T], axis=1)


def lattices(dimension: int) -> tuple[str, ...]:
    """Return the names of the lattices of a dimension."""
    return ("square", "hexagonal") if dimension == 2 else ("simple", "face", "body")


def fit(dimension: int) -> Floats:
    """Return the factors of the powers of s, the first of them 1."""
    places, side = disordered(dimension)
    rows: list[Floats] = []
    for support, counts in SUPPORTS.items():
        terms = [basis(k) for k in range(TERMS)]
        whole = np.array([integral(w, support, dimension) for w in terms]) / support ** (dimension + 2)

        def add(values: list[float] | Floats, weight: float, less: float = 1.0) -> None:
            rows.append(weight * counts * whole * (np.asarray(values) - less))  # noqa: B023

        for name in lattices(dimension):
            sums = np.array([moments(w, support, lattice(name, support)).sum(axis=0) for w in terms])
            for column in sums.T:
                add(column, 1.0)
        add([sliding(w, support, dimension) for w in terms], ROWS)
        if 2 * support > side or support > 4:
            continue
        found = np.array([disorder(w, support, places, side) for w in terms])
        for a in range(found.shape[2]):
            add(found[:, :, a].mean(axis=1), 1.0)
            size, along = np.linalg.eigh(np.cov(found[:, :, a]))
            for share, vector in zip(np.sqrt(np.maximum(size, 0)), along.T, strict=True):
                add(share * vector, SCATTER, less=0.0)
    rows.append(WHOLE * np.array([integral(basis(k), 1.0, dimension) for k in range(TERMS)]))
    wanted = np.zeros(len(rows))
    wanted[-1] = WHOLE
    found = np.linalg.lstsq(np.array(rows), wanted)[0]
    return np.asarray(found / found[0])


def report(weights: Weights, dimension: int) -> None:
    """Print the errors of the viscosity in per cent."""
    places, side = disordered(dimension)
    for support in (2.6, 3.0, 3.4, 4.0, 5.0):
        line = f"  R = {support:g} spacings:"
        for name in lattices(dimension):
            sums = moments(weights, support, lattice(name, support)).sum(axis=0) - 1
            line += f" {name} {100 * sums[0]:+.2f} {100 * sums[-1]:+.2f},"
        line += f" rows {100 * (sliding(weights, support, dimension) - 1):+.2f}"
        if 2 * support < side:
            each = disorder(weights, support, places, side)
            mean, scatter = 100 * (each.mean(axis=0) - 1), 100 * each.std(axis=0)
            line += f", disorder {mean[0]:+.2f} ({scatter[0]:.1f}) {mean[-1]:+.2f} ({scatter[-1]:.1f})"
        print(line)


def main() -> None:
    """Print the errors of weights, found anew or those in use."""
    parser = argparse.ArgumentParser(description="Weights of radial friction that feel neither rows nor disorder.")
    parser.add_argument("--fit", action="store_true", help="find the weights anew")
    chosen = parser.parse_args()
    print("Errors of the viscosity in per cent: stretching, shear; scatter from particle to particle in brackets.")
    for dimension in (2, 3):
        factors = fit(dimension) if chosen.fit else np.array(FRICTION_SHAPE[dimension])
        print(f"{dimension}-D, factors", ", ".join(f"{f:.3f}" for f in factors),
              "weights at s = 0 ... 1:", np.round(shape(factors)(np.linspace(0, 1, 11)), 3))
        report(shape(factors), dimension)
        print(" (1 - s)^1.5 alone")
        report(basis(0), dimension)
        print(" Wendland C2, whose slope over r is (1 - s)^3")
        report(lambda s: np.maximum(1 - s, 0) ** 3, dimension)


if __name__ == "__main__":
    main()
