#!/usr/bin/env python3
"""Lid-driven cavity from rest by stream function and vorticity: the curves of `cases/lid_driven_cavity.yaml`.

    python scripts/cavity_reference.py --folder cases/reference     # 14 minutes on one core
    python scripts/cavity_reference.py --folder cases/reference --creeping      # without inertia, seconds

    dw/dt = d(psi, w)/d(x, y) + nu lap w,   lap psi = -w,   u = (dpsi/dy, -dpsi/dx)

on n x n cells of a unit box: the Jacobian of Arakawa (1966), Poisson's equation by sine transforms, wall vorticity of Thom
(1933), Heun's method in time; all of second order. The table is the limit of n = 128 and 256, f + (f_256 - f_128)/3. Printed
beside it: the largest difference of both grids, and the least u on the vertical, the largest and least v on the horizontal
middle line over those of Botella and Peyret 1998 (spectral, Re = 100 and 1000) and of Marchi, Suero and Araki 2009 (400).

Without inertia (case `creeping_cavity`) lap w = 0: one system of equations for psi.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.fft import dstn, idstn
from scipy.sparse import diags_array, eye_array, kron
from scipy.sparse.linalg import spsolve

ENDS = {100: 30.0, 400: 30.0, 1000: 60.0}  # Reynolds number -> s
KNOWN = {
    100: (-0.2140424, 0.1795728, -0.2538030),
    400: (-0.328729, 0.303832, -0.454058),
    1000: (-0.3885698, 0.3769447, -0.5270771),
}
CELLS = (128, 256)
INTERVAL = 0.1  # of the energy, s


class Cavity:
    """The flow on (n + 1, n + 1) nodes, the first axis x; the lid at y = 1 moves with speed 1."""

    def __init__(self, n: int, reynolds: float) -> None:
        self.n, self.h, self.viscosity = n, 1.0 / n, 1.0 / reynolds
        self.vorticity = np.zeros((n + 1, n + 1))
        self.stream = np.zeros((n + 1, n + 1))
        wave = (2.0 - 2.0 * np.cos(np.pi * np.arange(1, n) / n)) / self.h**2
        self.eigenvalues = wave[:, None] + wave[None, :]

    def close(self, w: np.ndarray) -> None:
        """Solve for the stream function of a vorticity, and write the vorticity of the walls."""
        psi, h = self.stream, self.h
        psi[1:-1, 1:-1] = idstn(dstn(w[1:-1, 1:-1], type=1) / self.eigenvalues, type=1)
        w[0, :], w[-1, :] = -2.0 * psi[1, :] / h**2, -2.0 * psi[-2, :] / h**2
        w[:, 0], w[:, -1] = -2.0 * psi[:, 1] / h**2, -2.0 * (psi[:, -2] + h) / h**2

    def rate(self, w: np.ndarray) -> np.ndarray:
        """Return dw/dt of the nodes inside, (n - 1, n - 1)."""
        p = self.stream

        def at(f: np.ndarray, i: int, j: int) -> np.ndarray:
            return f[1 + i : self.n + i, 1 + j : self.n + j]

        e, o, n, s = ((1, 0), (-1, 0), (0, 1), (0, -1))
        ne, nw, se, sw = ((1, 1), (-1, 1), (1, -1), (-1, -1))
        plus = (at(p, *e) - at(p, *o)) * (at(w, *n) - at(w, *s)) - (at(p, *n) - at(p, *s)) * (at(w, *e) - at(w, *o))
        flux = (
            at(p, *e) * (at(w, *ne) - at(w, *se)) - at(p, *o) * (at(w, *nw) - at(w, *sw))
            - at(p, *n) * (at(w, *ne) - at(w, *nw)) + at(p, *s) * (at(w, *se) - at(w, *sw))
        )  # fmt: skip
        cross = (
            at(w, *n) * (at(p, *ne) - at(p, *nw)) - at(w, *s) * (at(p, *se) - at(p, *sw))
            - at(w, *e) * (at(p, *ne) - at(p, *se)) + at(w, *o) * (at(p, *nw) - at(p, *sw))
        )  # fmt: skip
        around = at(w, *e) + at(w, *o) + at(w, *n) + at(w, *s) - 4.0 * at(w, 0, 0)
        return ((plus + flux + cross) / 12.0 + self.viscosity * around) / self.h**2

    def advance(self, dt: float) -> None:
        """One step of Heun's method."""
        w = self.vorticity
        first = self.rate(w)
        half = w.copy()
        half[1:-1, 1:-1] += dt * first
        self.close(half)
        w[1:-1, 1:-1] += 0.5 * dt * (first + self.rate(half))
        self.close(w)

    def velocity(self) -> tuple[np.ndarray, np.ndarray]:
        """Return u and v on the nodes."""
        u, v = np.gradient(self.stream, self.h, axis=1), -np.gradient(self.stream, self.h, axis=0)
        u[:, 0], u[0, :], u[-1, :], u[:, -1] = 0.0, 0.0, 0.0, 1.0
        v[:, [0, -1]], v[[0, -1], :] = 0.0, 0.0
        return u, v

    def energy(self) -> float:
        """Return the kinetic energy over the density, by the trapezoidal rule."""
        u, v = self.velocity()
        weight = np.ones(self.n + 1)
        weight[[0, -1]] = 0.5
        return float(0.5 * self.h**2 * np.einsum("ij,i,j->", u**2 + v**2, weight, weight))


def run(n: int, reynolds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return u on the vertical and v on the horizontal middle line at the end, and the energy each `INTERVAL`."""
    cavity = Cavity(n, reynolds)
    cavity.close(cavity.vorticity)
    steps = int(np.ceil(INTERVAL / min(0.2 * cavity.h**2 / cavity.viscosity, 0.4 * cavity.h)))
    energies = [0.0]
    for _ in range(round(ENDS[reynolds] / INTERVAL)):
        for _ in range(steps):
            cavity.advance(INTERVAL / steps)
        energies.append(cavity.energy())
    u, v = cavity.velocity()
    return u[n // 2, :], v[:, n // 2], np.array(energies)


def creeping(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return u on the vertical and v on the horizontal middle line of the flow without inertia."""
    h, inside = 1.0 / n, n - 1
    line = diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(inside, inside))
    beside = np.zeros((inside, inside))  # how many walls are next to a node: Thom's vorticity there is -2 psi/h^2
    for wall in (np.s_[0, :], np.s_[-1, :], np.s_[:, 0], np.s_[:, -1]):
        beside[wall] += 1.0
    laplacian = kron(line, eye_array(inside)) + kron(eye_array(inside), line)
    lid = np.zeros((inside, inside))
    lid[:, -1] = -2.0 * h
    system = (laplacian @ laplacian + 2.0 * diags_array(beside.ravel())).tocsc()
    psi = np.zeros((n + 1, n + 1))
    psi[1:-1, 1:-1] = spsolve(system, lid.ravel()).reshape(inside, inside)
    cavity = Cavity(n, 1.0)
    cavity.stream = psi
    u, v = cavity.velocity()
    return u[n // 2, :], v[:, n // 2]


def extremes(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the least u, the largest and the least v, of parabolas through the extreme nodes."""

    def top(f: np.ndarray) -> float:
        k = int(np.argmax(f[1:-1])) + 1
        a, b, c = f[k - 1 : k + 2]
        return float(b + (c - a) ** 2 / (8.0 * (2.0 * b - a - c)))

    return np.array([-top(-u), top(v), -top(-v)])


def write(path: Path, names: list[str], columns: list[np.ndarray]) -> None:
    """Write a table; columns that end earlier are empty there."""
    rows = max(map(len, columns))
    lines = [",".join(names)]
    lines += [",".join(f"{c[k]:.7g}" if k < len(c) else "" for c in columns) for k in range(rows)]
    path.write_text("\n".join(lines) + "\n")


def write_creeping(folder: Path) -> None:
    """Compute and write the flow without inertia, the limit of 256 and 512 cells."""
    coarse, fine = creeping(256), creeping(512)
    place = np.linspace(0.0, 1.0, 129)
    limit = [b[::4] + (b[::4] - a[::2]) / 3.0 for a, b in zip(coarse, fine, strict=True)]
    apart = max(float(np.abs(b[::4] - a[::2]).max()) for a, b in zip(coarse, fine, strict=True))
    print(f"no inertia: both grids differ by {apart:.2g}; extremes {extremes(*limit)}")
    write(folder / "m_cavity_creeping.csv", ["position_m", "u", "v"], [place, *limit])


def main() -> None:
    """Compute and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, required=True, help="where the tables go")
    parser.add_argument("--creeping", action="store_true", help="the flow without inertia alone")
    given = parser.parse_args()
    folder = given.folder
    if not folder.is_dir():
        parser.error(f"--folder {folder}: does not exist; make it, or name another folder")
    if given.creeping:
        write_creeping(folder)
        return
    every = CELLS[1] // CELLS[0]
    place = np.linspace(0.0, 1.0, CELLS[0] + 1)
    us, vs, energies = [], [], []
    for reynolds, known in KNOWN.items():
        coarse, fine = run(CELLS[0], reynolds), run(CELLS[1], reynolds)
        fine = (fine[0][::every], fine[1][::every], fine[2])
        for table, a, b in zip((us, vs, energies), coarse, fine, strict=True):
            table.append(b + (b - a) / 3.0)
        apart = [float(np.abs(b - a).max()) for a, b in zip(coarse, fine, strict=True)]
        over = extremes(us[-1], vs[-1]) / np.array(known) - 1.0
        print(f"Re = {reynolds}: grids apart by", *(f"{x:.1e}" for x in apart), "; over extremes known", np.round(over, 5))
    names = [str(reynolds) for reynolds in KNOWN]
    write(folder / "m_cavity_u.csv", ["y_m", *(f"u_Re{n}" for n in names)], [place, *us])
    write(folder / "m_cavity_v.csv", ["x_m", *(f"v_Re{n}" for n in names)], [place, *vs])
    time = INTERVAL * np.arange(max(map(len, energies)))
    write(folder / "m_cavity_energy.csv", ["t_s", *(f"E_Re{n}" for n in names)], [time, *energies])


if __name__ == "__main__":
    main()
