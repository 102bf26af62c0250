"""A drop in shear between two walls in 2-D with inertia, by finite elements.

    python scripts/shear_drop_inertia.py --reynolds 0.1 --capillary 0.1 0.2 0.3 0.4 --output drops

prints the deformation D and angle of each drop at the end, those of the ellipse with the same second moments, as the gauge
`deformation` has them, and writes both over time to drops/Ca_*.csv. The box is that of cases/shear_drop.yaml, 8 R long,
periodic, with walls at y = +-4 R that move at +-4. At the start the drop is a circle in undisturbed shear.

Units: R = 1, shear rate 1, viscosity of the matrix 1 and its density Re, so that the tension is 1/Ca.

Equations.  On nodes that move at w, in the drop and around it, with the jump of stress at the interface,

    rho (du/dt + (u - w) . grad u) = div sigma,   sigma = -p I + 2 mu D(u),   div u = 0,   [sigma n] = kappa n/Ca,

whose weak form has the tension as - int t . dv/ds ds/Ca along the interface (`oscillating_drop_exact.py`).

Method.  Isoparametric Taylor-Hood triangles (P2 velocity and places, P1 pressure) that fit the interface, where the pressure
is double. Nodes of the interface move with the fluid across it and are spread evenly along it, on a cubic spline; the others
follow by a Laplace equation on the mesh of the start, so that no new mesh is made. Time: BDF2 for velocities and places,
three passes over the geometry of the new time in each step. A pass has the normals of the one before, along which nodes
move in a fluid that passes them at a speed of order 1, so passes settle only while the step is below a quarter of an edge,
and less around a thin drop, whose surface is faster.

Checks.  Re = 1e-3 has the deformation of the boundary integrals of `shear_drop_exact.py`; the area of the drop is printed;
two sizes of elements and two steps give the error by difference (docs/records/shear.md#inertia).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from oscillating_drop_exact import EDGE_SLOPES, EDGE_WEIGHTS
from rotating_square_exact import P1, P2, gathered, gradients_and_weights, start_of_steps
from scipy.interpolate import CubicSpline
from scipy.sparse import block_array, coo_array, csr_array, diags_array
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Blocks = list[list[csr_array]]  # a matrix of both components with both
HALF = 4.0  # of the box, in radii
GROWTH = 1.15  # of the rings of vertices, from one to the next away from the interface
PASSES = 3  # over the geometry of the new time


def ring_points(radius: float, count: int, turn: float = 0.0) -> Floats:
    """Return `count` points of a circle, anticlockwise, the first at `turn` of a distance."""
    angle = 2 * np.pi * (np.arange(count) + turn) / count
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def vertices_of(size: float, coarse: float) -> tuple[Floats, int]:
    """Return the vertices, those of the interface first, and how many these are: rings, and the edge of the box."""
    around = max(8, round(2 * np.pi / size))
    parts = [ring_points(1.0, around)]
    for way in (-1, 1):
        radius, length, turn = 1.0, size, 0.5
        while True:
            length = min(GROWTH * length, coarse)
            radius += way * np.sqrt(3) / 2 * length
            if radius < 0.6 * length or radius > HALF * np.sqrt(2):
                break
            parts.append(ring_points(radius, max(5, round(2 * np.pi * radius / length)), turn))
            turn = 0.5 - turn
    inner = np.concatenate([*parts, np.zeros((1, 2))])
    inner = inner[np.abs(inner).max(axis=1) < HALF - 0.55 * coarse]
    count = round(2 * HALF / coarse)
    side, far = -HALF + 2 * HALF * np.arange(count) / count, np.full(count, HALF)
    box = [np.stack(s, axis=1) for s in ((side, -far), (far, side), (-side, far), (-far, -side))]
    return np.concatenate([inner, *box]), around


class DropMesh:
    """Six-node triangles of a box with a circle in it, whose arcs are edges of triangles.

    Args:
        size: length of the edges on the circle [R].
        coarse: length of those far from it [R].
    """

    def __init__(self, size: float, coarse: float) -> None:
        places, around = vertices_of(size, coarse)
        triangles = Delaunay(places).simplices.astype(np.int64)
        first, second, third = (places[triangles[:, k]] for k in range(3))
        turned = np.linalg.det(np.stack([second - first, third - first], axis=1)) < 0
        triangles[turned] = triangles[turned][:, [0, 2, 1]]
        pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
        self.nodes: Floats = np.concatenate([places, places[unique].mean(axis=1)])
        self.elements: Ints = np.concatenate([triangles, len(places) + inverse.reshape(-1, 3)], axis=1)
        lookup = {(int(a), int(b)): len(places) + k for k, (a, b) in enumerate(unique)}
        numbers = np.arange(around)
        following = np.roll(numbers, -1)
        middle = np.array([lookup[min(a, b), max(a, b)] for a, b in zip(numbers.tolist(), following.tolist(), strict=True)])
        self.nodes[middle] /= np.linalg.norm(self.nodes[middle], axis=1)[:, None]
        self.edges: Ints = np.stack([numbers, middle, following], axis=1)
        self.ring: Ints = self.edges[:, :2].ravel()
        """Nodes along the interface, vertex and middle in turn, anticlockwise."""
        self.inside: NDArray[np.bool_] = np.linalg.norm(places[triangles].mean(axis=1), axis=1) < 1
        twin = np.arange(len(places))
        twin[:around] = len(places) + numbers
        self.pressure_of: Ints = np.where(self.inside[:, None], twin[triangles], triangles)
        """(triangles, 3) unknown pressures of the corners: the drop has its own at the interface"""
        self.pressures = len(places) + around
        self.at_wall: NDArray[np.bool_] = np.abs(np.abs(self.nodes[:, 1]) - HALF) < 1e-9
        self.at_end: NDArray[np.bool_] = np.abs(np.abs(self.nodes[:, 0]) - HALF) < 1e-9
        self.spread = self._spread()

    def _spread(self) -> csr_array:
        """Return the matrix (nodes, unknowns) that gives nodes their velocity: 0 at walls, one at both ends of the box."""
        x, y = self.nodes.T
        same = np.arange(len(x))
        right, left = (np.flatnonzero(self.at_end & (s * x > 0)) for s in (1, -1))
        same[right[np.argsort(y[right])]] = left[np.argsort(y[left])]
        number = np.full(len(x), -1)
        free = np.flatnonzero((same == np.arange(len(x))) & ~self.at_wall)
        number[free] = np.arange(len(free))
        rows = np.flatnonzero(~self.at_wall)
        return coo_array((np.ones(len(rows)), (rows, number[same[rows]])), shape=(len(x), len(free))).tocsr()


class Forms:
    """The matrices of the weak form on one geometry, for density and viscosity (triangles,)."""

    def __init__(self, mesh: DropMesh, nodes: Floats, rho: Floats, mu: Floats) -> None:
        e, n = mesh.elements, len(nodes)
        self.gradient, self.weight = gradients_and_weights(nodes[e])
        self.mesh, self.nodes, self.rho = mesh, nodes, rho
        self.mass = gathered(np.einsum("t,tq,qi,qj->tij", rho, self.weight, P2, P2, optimize=True), e, e, (n, n))
        weighted = self.gradient * self.weight[:, :, None, None]
        k = np.einsum("t,tqia,tqjb->abtij", mu, weighted, self.gradient, optimize=True)
        blocks = [[2 * k[0, 0] + k[1, 1], k[1, 0]], [k[0, 1], k[0, 0] + 2 * k[1, 1]]]
        self.viscous = [[gathered(b, e, e, (n, n)) for b in row] for row in blocks]
        self.laplace = gathered(k[0, 0] + k[1, 1], e, e, (n, n))
        div = np.einsum("tqia,qj->atij", weighted, P1, optimize=True)
        p = mesh.pressure_of
        self.divergence = [gathered(d, e, p, (n, mesh.pressures)) for d in div]
        small = np.einsum("tq,qi,qj->tij", self.weight, P1, P1, optimize=True)
        self.pressure_mass = gathered(small, p, p, (mesh.pressures, mesh.pressures))

    def convection(self, velocity: Floats) -> csr_array:
        """Return the matrix of rho (velocity . grad) u, for velocities (nodes, 2) less those of the mesh."""
        e = self.mesh.elements
        along = np.einsum("qk,tka,tqja->tqj", P2, velocity[e], self.gradient, optimize=True)
        local = np.einsum("t,tq,qi,tqj->tij", self.rho, self.weight, P2, along, optimize=True)
        return gathered(local, e, e, (len(self.nodes), len(self.nodes)))

    def tension(self) -> tuple[Floats, Blocks]:
        """Return the forces (nodes, 2) of a tension of 1, and what it answers to a way of the interface across itself.

        The answer is the matrix of int (n . d(way)/ds) (n . dv/ds) ds, in blocks of both components, for the part along the
        normals of any field of ways.
        """
        edges, n = self.mesh.edges, len(self.nodes)
        along = np.einsum("qi,eia->eqa", EDGE_SLOPES, self.nodes[edges])
        speed = np.linalg.norm(along, axis=2)
        along /= speed[:, :, None]
        force = np.zeros_like(self.nodes)
        np.add.at(force, edges, -np.einsum("q,eqa,qi->eia", EDGE_WEIGHTS, along, EDGE_SLOPES))
        out = np.stack([along[..., 1], -along[..., 0]], axis=-1)
        slopes = np.einsum("q,qi,qj->qij", EDGE_WEIGHTS, EDGE_SLOPES, EDGE_SLOPES)
        local = np.einsum("eq,eqa,eqb,qij->abeij", 1 / speed, out, out, slopes, optimize=True)
        stiff = [[gathered(block, edges, edges, (n, n)) for block in row] for row in local]
        at = np.zeros_like(self.nodes)
        at[self.mesh.ring] = normals(self.nodes[self.mesh.ring])
        across = [[diags_array(at[:, a] * at[:, b]) for b in (0, 1)] for a in (0, 1)]
        return force, [[stiff[a][0] @ across[0][b] + stiff[a][1] @ across[1][b] for b in (0, 1)] for a in (0, 1)]

    def solve(self, inertia: csr_array, answer: Blocks, load: Floats, at_walls: Floats) -> Floats:
        """Solve (inertia + answer + viscous) u - G p = load, G^T u = 0 for the velocities (nodes, 2) with `at_walls` given.

        A tiny compressibility settles the pressure, which is free by a constant.
        """
        spread, (gx, gy) = self.mesh.spread, self.divergence
        a = [[self.viscous[i][j] + answer[i][j] for j in (0, 1)] for i in (0, 1)]
        for i in (0, 1):
            a[i][i] = a[i][i] + inertia
        fixed = [load[:, i] - a[i][0] @ at_walls[:, 0] - a[i][1] @ at_walls[:, 1] for i in (0, 1)]
        inner = [[spread.T @ block @ spread for block in row] for row in a]
        g = [spread.T @ gx, spread.T @ gy]
        rows = [[*inner[0], -g[0]], [*inner[1], -g[1]], [-g[0].T, -g[1].T, -1e-9 * self.pressure_mass]]
        right = [spread.T @ fixed[0], spread.T @ fixed[1], gx.T @ at_walls[:, 0] + gy.T @ at_walls[:, 1]]
        x = splu(block_array(rows, format="csc")).solve(np.concatenate(right))
        count = spread.shape[1]
        return at_walls + np.stack([spread @ x[:count], spread @ x[count: 2 * count]], axis=1)

    def shape_of_drop(self) -> tuple[float, float, float]:
        """Return deformation, angle to the walls [degrees] and area of the drop, by its second moments."""
        inside = self.mesh.inside
        places = np.einsum("qi,tia->tqa", P2, self.nodes[self.mesh.elements[inside]])
        weight = self.weight[inside]
        area = float(weight.sum())
        places = places - np.einsum("tq,tqa->a", weight, places) / area
        values, vectors = np.linalg.eigh(np.einsum("tq,tqa,tqb->ab", weight, places, places))
        short, long = np.sqrt(values)
        angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])) % 180
        return float((long - short) / (long + short)), float(angle), area


class Follower:
    """Places of all nodes from those of the interface, by a Laplace equation for the ways on the mesh of the start."""

    def __init__(self, mesh: DropMesh) -> None:
        ones = np.ones(len(mesh.elements))
        laplace = Forms(mesh, mesh.nodes, ones, ones).laplace.tocsc()
        held = mesh.at_wall | mesh.at_end
        held[mesh.ring] = True
        self.mesh, self.free = mesh, np.flatnonzero(~held)
        self.factors = splu(laplace[self.free][:, self.free])
        self.pull = laplace[self.free][:, mesh.ring]

    def places(self, ring: Floats) -> Floats:
        """Return the places (nodes, 2) for those of the interface (n, 2)."""
        way = ring - self.mesh.nodes[self.mesh.ring]
        places = self.mesh.nodes.copy()
        places[self.mesh.ring] = ring
        places[self.free] -= self.factors.solve(self.pull @ way)
        return places


def outline(ring: Floats) -> tuple[CubicSpline, Floats]:
    """Return the closed cubic spline through the points (n, 2) over the chord, and the chord at them (n + 1,)."""
    closed = np.concatenate([ring, ring[:1]])
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    return CubicSpline(chord, closed, bc_type="periodic"), chord


def normals(ring: Floats) -> Floats:
    """Return the unit normals (n, 2) out of the drop."""
    curve, chord = outline(ring)
    along = curve(chord[:-1], 1)
    return np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]


def spread_evenly(ring: Floats) -> Floats:
    """Return as many points of even distance on the spline through the points (n, 2), moved along it by none in the mean."""
    curve, chord = outline(ring)
    points, weights = np.polynomial.legendre.leggauss(5)
    half = np.diff(chord)[:, None] / 2
    speed = np.linalg.norm(curve(chord[:-1, None] + half * (1 + points), 1), axis=-1)
    length = np.concatenate([[0.0], np.cumsum((speed * half) @ weights)])
    even = length[-1] * np.arange(len(ring)) / len(ring)
    even += (length[:-1] - even).mean()
    back = CubicSpline(length, chord - length * chord[-1] / length[-1], bc_type="periodic")
    return curve((even * chord[-1] / length[-1] + back(even % length[-1])) % chord[-1])


class Drop:
    """A drop in shear: places and velocities of the nodes, at two times.

    Args:
        reynolds, capillary: by the viscosity and density of the matrix.
        viscosity, density: of the drop over those of the matrix.
        size, coarse: lengths of the edges of triangles at the interface and far from it [R].
    """

    def __init__(
        self, reynolds: float, capillary: float, viscosity: float, density: float, size: float, coarse: float
    ) -> None:
        self.mesh = DropMesh(size, coarse)
        self.follower = Follower(self.mesh)
        self.capillary = capillary
        self.rho = np.where(self.mesh.inside, density * reynolds, reynolds)
        self.mu = np.where(self.mesh.inside, viscosity, 1.0)
        self.x: Floats = self.mesh.nodes.copy()
        self.u: Floats = np.stack([self.x[:, 1], 0 * self.x[:, 1]], axis=1)
        self.at_walls = np.where(self.mesh.at_wall[:, None], self.u, 0.0)
        self.x_old, self.u_old, self.dt_old = self.x, self.u, np.inf
        self.forms = Forms(self.mesh, self.x, self.rho, self.mu)

    def advance(self, dt: float) -> None:
        """Go on by a step, of backward Euler at first, of BDF2 for steps of any two lengths then."""
        ratio = dt / self.dt_old
        c0, c1, c2 = (1 + 2 * ratio) / (1 + ratio), -(1 + ratio), ratio**2 / (1 + ratio)
        before_x, before_u = c1 * self.x + c2 * self.x_old, c1 * self.u + c2 * self.u_old
        ring, u = self.mesh.ring, self.u + ratio * (self.u - self.u_old)
        x = self._moved(self.x + ratio * (self.x - self.x_old), u, before_x[ring], dt, c0)
        for _ in range(PASSES):
            forms = Forms(self.mesh, x, self.rho, self.mu)
            force, stiffness = forms.tension()
            answer = [[dt / c0 / self.capillary * block for block in row] for row in stiffness]
            load = force / self.capillary - forms.mass @ before_u / dt
            load += np.stack([row[0] @ u[:, 0] + row[1] @ u[:, 1] for row in answer], axis=1)
            carried = forms.convection(u - (c0 * x + before_x) / dt)
            u = forms.solve(c0 / dt * forms.mass + carried, answer, load, self.at_walls)
            x = self._moved(x, u, before_x[ring], dt, c0)
        self.x_old, self.x, self.u_old, self.u, self.dt_old = self.x, x, self.u, u, dt
        self.forms = Forms(self.mesh, x, self.rho, self.mu)

    def _moved(self, x: Floats, u: Floats, before: Floats, dt: float, c0: float) -> Floats:
        """Return the places of all nodes when the interface has moved at u across itself, its direction taken at x."""
        ring = self.mesh.ring
        out = normals(x[ring])
        across = out * np.sum(out * u[ring], axis=1, keepdims=True)
        return self.follower.places(spread_evenly((dt * across - before) / c0))


def run(drop: Drop, step: float, end: float) -> Floats:
    """Return the rows time, D, angle [degrees], area of the drop over that of the circle, for times in shear rates."""
    times = start_of_steps(step, end)
    rows = [[0.0, *drop.forms.shape_of_drop()]]
    for before, now in zip(times, times[1:], strict=False):
        drop.advance(now - before)
        rows.append([now, *drop.forms.shape_of_drop()])
    table = np.array(rows)
    table[:, 3] /= table[0, 3]
    return table


def main() -> None:
    """Read the arguments and run."""
    parser = argparse.ArgumentParser(description="Drops in shear between two walls in 2-D with inertia.")
    parser.add_argument("--reynolds", type=float, default=0.1, help="rho G R^2/mu of the matrix")
    parser.add_argument("--capillary", type=float, nargs="+", default=[0.2], help="mu G R/sigma, mu of the matrix")
    parser.add_argument("--viscosity", type=float, default=1.0, help="of the drop over that of the matrix")
    parser.add_argument("--density", type=float, default=1.0, help="of the drop over that of the matrix")
    parser.add_argument("--size", type=float, default=0.1, help="length of the elements at the interface over R")
    parser.add_argument("--coarse", type=float, default=0.5, help="the same far from it")
    parser.add_argument("--step", type=float, help="time step times the shear rate, a sixth of --size if not given")
    parser.add_argument("--end", type=float, default=10.0, help="end of the run times the shear rate")
    parser.add_argument("--output", type=Path, help="folder for the curves over time")
    a = parser.parse_args()
    for name, value in vars(a).items():
        for number in value if isinstance(value, list) else [value]:
            if isinstance(number, float) and not 0 < number < np.inf:
                parser.error(f"--{name} {number:g}: needs a number above 0")
    if not a.size <= a.coarse <= 1:
        parser.error(f"--size {a.size:g} --coarse {a.coarse:g}: needs size <= coarse <= 1, edges that fit a drop of R = 1")
    a.step = a.step or a.size / 6
    if a.step > a.size / 4:
        parser.error(f"--step {a.step:g}: needs at most a quarter of --size {a.size:g}, or passes do not settle")
    if a.end < 4 * a.step:
        parser.error(f"--end {a.end:g}: needs at least four steps of --step {a.step:g}")
    if a.output:
        if a.output.exists() and not a.output.is_dir():
            parser.error(f"--output {a.output}: is a file, and needs to be a folder or a new name")
        a.output.mkdir(parents=True, exist_ok=True)
    print("     Ca         D   angle  change of D, angle in the last tenth  area")
    for capillary in a.capillary:
        table = run(Drop(a.reynolds, capillary, a.viscosity, a.density, a.size, a.coarse), a.step, a.end)
        late = table[table[:, 0] > 0.9 * a.end]
        drift = np.ptp(late[:, 1:3], axis=0)
        print(f"{capillary:7g} {table[-1, 1]:9.6f} {table[-1, 2]:7.3f}  {drift[0]:.1e}, {drift[1]:.1e}"
              f"                       {table[-1, 3]:.6f}", flush=True)
        if a.output:
            np.savetxt(a.output / f"Ca_{capillary:g}.csv", table, "%.6g", ",", comments="",
                       header="G_t,D,angle_deg,area_over_start")


if __name__ == "__main__":
    main()
