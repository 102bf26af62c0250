"""Reference solution of the rotating square of liquid with a free surface and no air, gravity or surface tension.

    python scripts/rotating_square_exact.py --size 0.04 --step 0.01 --end 3 --output square   # pip install triangle

Problem.  A square [-L/2, L/2]^2 of liquid (rho = 1, L = 1) turns clockwise as a rigid body, u = omega (y, -x) with
omega = 1, at t = 0 and is then left alone.  Its viscosity is nu = omega L^2 / Re, and its surface bears no traction.

Equations.  In the frame of the fluid (x is the place of a fluid particle)

    dx/dt = u,    rho du/dt = div sigma,    div u = 0,    sigma = -p I + 2 mu D(u),    sigma n = 0 on the surface,

whose weak form holds the surface condition as the natural one:

    int rho du/dt . v + int 2 mu D(u) : D(v) - int p div v = 0  and  int q div u = 0  for all v and q.

Method.  Isoparametric Taylor-Hood triangles (P2 velocity and P2 geometry with curved edges, P1 pressure).  All nodes,
those in the middle of edges too, move with the fluid, so that no convective term is left and the area changes by the
error of the time integration alone (q = 1 lies in the space of the pressures).  Time: BDF2 with variable steps for both
the velocities and the places of the nodes; the geometry at the new time is predicted with extrapolated velocities and
improved in a second pass.  The first eight steps are graded up from a sixteenth of the step, since BDF2 starts with one
step of backward Euler.  The mesh is made anew (by Triangle) at fixed intervals or when its worst triangle is poor: the
surface is resampled on cubic splines between the four tips, which stay nodes for ever, with edges of the length
size * clip(4 * local width, 0.1, 1) that shrink towards the tips to a quarter of it.  Both levels of the velocity pass
to the new mesh by L2 projections onto the discretely divergence-free fields and the step between the two levels of the
geometry by interpolation; BDF2 then goes on without a new start.

Checks.  The pressure at the centre at t -> 0 is -0.1473427 rho omega^2 L^2 (series for laplace p = 2 with p = 0 on the
square), the kinetic energy begins at 1/12 and the angular momentum stays at -1/6, the area at 1, and the kinetic energy
lost equals the integral of the dissipation; all are printed.  The script writes history.csv (each step), centre.csv
(every 0.02) and outline_wt*.csv to the output folder.  Two meshes with two steps give the error by difference.  At
Re = 100 size 0.02 with step 0.005 (11 minutes to omega t = 3) differs from 0.04 with 0.01 by at most 1.8e-5 in the
pressure at the centre, 1.1e-5 in the tip radius, 4.5e-5 in the side radius and 2e-4 in the outline (area of the symmetric
difference at omega t = 3); its area is right to 2.4e-5, its angular momentum to 4.5e-5 of itself and its energy balance
to 3.8e-6.  The pressure at the centre first falls, by 2 nu omega t, since the normal viscous stress holds it so on the
whole surface (the strain rate there is omega t times the second derivative, 1, of p - r^2 / 2 across the surface).
"""

import argparse
import importlib.util
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.sparse import block_array, coo_array, csr_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
EXACT_START_PRESSURE = -0.1473427
OUTLINE_TIMES = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)


def shape_functions(r: Floats, s: Floats) -> tuple[Floats, Floats]:
    """Return the six quadratic shape functions (..., 6) and their gradients (..., 6, 2) at reference places r, s."""
    q = 1 - r - s
    values = np.stack([q * (2 * q - 1), r * (2 * r - 1), s * (2 * s - 1), 4 * q * r, 4 * r * s, 4 * s * q], axis=-1)
    zero = np.zeros_like(r)
    by_r = np.stack([1 - 4 * q, 4 * r - 1, zero, 4 * (q - r), 4 * s, -4 * s], axis=-1)
    by_s = np.stack([1 - 4 * q, zero, 4 * s - 1, -4 * r, 4 * r, 4 * (q - s)], axis=-1)
    return values, np.stack([by_r, by_s], axis=-1)


def quadrature() -> tuple[Floats, Floats, Floats]:
    """Return the places r, s and the weights of the seven-point rule of degree five on the reference triangle."""
    root = np.sqrt(15.0)
    a, b = (6 - root) / 21, (6 + root) / 21
    r = np.array([1 / 3, a, 1 - 2 * a, a, b, 1 - 2 * b, b])
    s = np.array([1 / 3, a, a, 1 - 2 * a, b, b, 1 - 2 * b])
    weights = np.array([9 / 80] + 3 * [(155 - root) / 2400] + 3 * [(155 + root) / 2400])
    return r, s, weights


POINT_R, POINT_S, WEIGHTS = quadrature()
P2, P2_GRADIENT = shape_functions(POINT_R, POINT_S)
P1 = np.stack([1 - POINT_R - POINT_S, POINT_R, POINT_S], axis=-1)


@dataclass
class Mesh:
    """Six-node triangles: the vertices come first among the nodes, the first of them being the centre."""

    nodes: Floats  # (nodes, 2)
    elements: Ints  # (triangles, 6): three vertices, then the middles of the edges 01, 12, 20.
    vertices: int
    surface: Ints  # Nodes along the surface, vertex and middle in turn, anticlockwise and beginning with a tip.
    tips: Ints  # Places of the four tips in `surface`.


def gathered(local: Floats, rows: Ints, columns: Ints, shape: tuple[int, int]) -> csr_array:
    """Return the sum of the local matrices (triangles, i, j) as one sparse matrix."""
    i = np.broadcast_to(rows[:, :, None], local.shape).ravel()
    j = np.broadcast_to(columns[:, None, :], local.shape).ravel()
    return coo_array((local.ravel(), (i, j)), shape=shape).tocsr()


def gradients_and_weights(places: Floats) -> tuple[Floats, Floats]:
    """Return the gradients of the shape functions (triangles, points, 6, 2) and the areas of the points (triangles, points).

    For the places (triangles, 6, 2) of the nodes; ends the script where a triangle is turned inside out.
    """
    jacobian = np.einsum("tia,qib->tqab", places, P2_GRADIENT)
    determinant = np.linalg.det(jacobian)
    if determinant.min() <= 0:
        raise SystemExit("A triangle is turned inside out: take a shorter --step or more friction.")
    return np.einsum("qib,tqba->tqia", P2_GRADIENT, np.linalg.inv(jacobian), optimize=True), determinant * WEIGHTS


class Forms:
    """The matrices of the weak form on one geometry."""

    def __init__(self, mesh: Mesh, nodes: Floats) -> None:
        """Assemble the mass, viscous (for mu = 1) and divergence matrices for the mesh at the given nodes."""
        elements = mesh.elements
        self.gradient, self.weight = gradients_and_weights(nodes[elements])
        self.mesh, self.count, self.nodes = mesh, len(nodes), nodes
        self.area = float(self.weight.sum())
        mass = np.einsum("tq,qi,qj->tij", self.weight, P2, P2, optimize=True)
        weighted = self.gradient * self.weight[:, :, None, None]
        k = np.einsum("tqia,tqjb->abtij", weighted, self.gradient, optimize=True)
        self.mass = gathered(mass, elements, elements, (self.count, self.count))
        blocks = [[2 * k[0, 0] + k[1, 1], k[1, 0]], [k[0, 1], k[0, 0] + 2 * k[1, 1]]]
        self.viscous = [[gathered(b, elements, elements, (self.count, self.count)) for b in row] for row in blocks]
        div = np.einsum("tqia,qj->atij", weighted, P1, optimize=True)
        self.divergence = [gathered(d, elements, elements[:, :3], (self.count, mesh.vertices)) for d in div]
        small = np.einsum("tq,qi,qj->tij", self.weight, P1, P1, optimize=True)
        self.pressure_mass = gathered(small, elements[:, :3], elements[:, :3], (mesh.vertices, mesh.vertices))

    def solve(self, inertia: float, mu: float, load: Floats) -> tuple[Floats, Floats]:
        """Solve inertia * M u + mu * V u - G p = load, G^T u = 0 for the velocities (nodes, 2) and the pressures.

        The matrix is factored without pivoting after a tiny compressibility has made it quasi-definite; refinement with
        the true matrix takes that away again.
        """
        m, (gx, gy) = inertia * self.mass, self.divergence
        (xx, xy), (yx, yy) = self.viscous
        rows = [[m + mu * xx, mu * xy, -gx], [mu * yx, m + mu * yy, -gy], [-gx.T, -gy.T, None]]
        true = block_array(rows, format="csc")
        regular = [*rows[:2], [-gx.T, -gy.T, -1e-5 / inertia * self.pressure_mass]]
        factors = splu(block_array(regular, format="csc"), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                       options={"SymmetricMode": True})
        right = np.concatenate([load[:, 0], load[:, 1], np.zeros(self.mesh.vertices)])
        x = factors.solve(right)
        for _ in range(3):
            x += factors.solve(right - true @ x)
        return x[: 2 * self.count].reshape(2, -1).T.copy(), x[2 * self.count:]

    def project(self, values: Floats) -> Floats:
        """Project velocities given at the quadrature points (triangles, points, 2) onto divergence-free fields."""
        local = np.einsum("tq,qi,tqa->tia", self.weight, P2, values, optimize=True)
        places = self.mesh.elements.ravel()
        load = np.stack([np.bincount(places, local[:, :, a].ravel(), self.count) for a in (0, 1)], axis=1)
        return self.solve(1.0, 0.0, load.astype(np.float64))[0]

    def centre_pressure(self, p: Floats) -> tuple[float, float]:
        """Return the pressure at the centre, by a fit of degree four to p around it, and the one of the nearest node.

        The P1 pressure is close to a projection of the true one, which its nodes miss by a multiple of the square of the
        element size where p is curved, but which a smooth fit recovers with a higher order.
        """
        points = np.einsum("qi,tia->tqa", P2, self.nodes[self.mesh.elements])
        # The disc of the fit has the radius 0.2 and stays within the liquid when the sides come nearer than 0.25.
        radius = min(0.2, 0.8 * float(np.linalg.norm(self.nodes[self.mesh.surface], axis=1).min()))
        near = (points**2).sum(axis=2) < radius**2
        x, y = points[near].T / radius
        root = np.sqrt(self.weight[near])
        terms = np.stack([x**i * y**j for i in range(5) for j in range(5 - i)], axis=1)
        values = (p[self.mesh.elements[:, :3]] @ P1.T)[near]
        fit = np.linalg.lstsq(terms * root[:, None], values * root)[0]
        nearest = (self.nodes[: self.mesh.vertices] ** 2).sum(axis=1).argmin()
        return float(fit[0]), float(p[nearest])

    def kinetic_energy(self, u: Floats) -> float:
        """Return the kinetic energy of the nodal velocities u."""
        return 0.5 * float(np.sum(u * (self.mass @ u)))

    def angular_momentum(self, u: Floats) -> float:
        """Return the angular momentum about the origin, anticlockwise being positive."""
        mu = self.mass @ u
        return float(np.sum(self.nodes[:, 0] * mu[:, 1] - self.nodes[:, 1] * mu[:, 0]))

    def dissipation(self, u: Floats) -> float:
        """Return the integral of 2 D(u) : D(u)."""
        return float(sum(u[:, a] @ (self.viscous[a][b] @ u[:, b]) for a in (0, 1) for b in (0, 1)))


def locate(mesh: Mesh, points: Floats, candidates: int = 12) -> tuple[Ints, Floats, Floats]:
    """Return for each point (n, 2) its triangle and its reference place r, s, slightly outside if it is off the mesh."""
    corners = mesh.nodes[mesh.elements]
    tree = cKDTree(corners[:, :3].mean(axis=1))
    near = tree.query(points, k=min(candidates, len(corners)))[1]
    r, s = np.full(near.shape, 1 / 3), np.full(near.shape, 1 / 3)
    for _ in range(5):
        values, gradients = shape_functions(r, s)
        miss = points[:, None, :] - np.einsum("nci,ncia->nca", values, corners[near], optimize=True)
        j = np.einsum("ncia,ncib->ncab", corners[near], gradients, optimize=True)
        det = j[..., 0, 0] * j[..., 1, 1] - j[..., 0, 1] * j[..., 1, 0]
        r = np.clip(r + (j[..., 1, 1] * miss[..., 0] - j[..., 0, 1] * miss[..., 1]) / det, -3, 3)
        s = np.clip(s + (j[..., 0, 0] * miss[..., 1] - j[..., 1, 0] * miss[..., 0]) / det, -3, 3)
    inside = np.minimum(np.minimum(r, s), 1 - r - s)
    best = (np.arange(len(points)), inside.argmax(axis=1))
    found, r1, s1 = near[best], r[best], s[best]
    lost = inside[best] < -0.01
    if candidates < 60 and lost.any():
        found[lost], r1[lost], s1[lost] = locate(mesh, points[lost], 60)
    return found, r1, s1


def interpolate(mesh: Mesh, place: tuple[Ints, Floats, Floats], field: Floats) -> Floats:
    """Evaluate a nodal P2 field (nodes, k) at located points."""
    values: Floats = np.einsum("ni,nia->na", shape_functions(place[1], place[2])[0], field[mesh.elements[place[0]]])
    return values


def surface_splines(points: Floats, tips: Ints) -> list[tuple[CubicSpline, Floats]]:
    """Return for each of the four sides a cubic spline over the chord length and the knots of it."""
    splines = []
    for first, last in zip(tips, [*tips[1:], len(points)], strict=True):
        side = points[np.arange(first, last + 1) % len(points)]
        knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(side, axis=0), axis=1))])
        splines.append((CubicSpline(knots, side), knots))
    return splines


def edge_lengths(splines: list[tuple[CubicSpline, Floats]], size: float) -> list[Floats]:
    """Return the wanted length of the edges at the knots of each side."""
    points = np.concatenate([f(knots) for f, knots in splines])
    tangents = np.concatenate([f(knots, 1) for f, knots in splines])
    inward = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1) / np.linalg.norm(tangents, axis=1)[:, None]
    across = points[None] - points[:, None]
    distance = np.linalg.norm(across, axis=2)
    opposite = (inward @ inward.T < -0.5) & (np.einsum("ija,ia->ij", across, inward) > 0)
    width = np.where(opposite, distance, 1.0).min(axis=1)
    length = size * np.clip(4 * width, 0.1, 1.0)
    ends = np.cumsum([len(knots) for _, knots in splines])
    tips = np.concatenate([[0], ends[:-1], ends - 1])
    length[tips] = 0.25 * length[tips]
    length = (length[None] + 0.2 * distance).min(axis=1)
    return list(np.split(length, ends[:-1]))


def make_mesh(splines: list[tuple[CubicSpline, Floats]], size: float) -> Mesh:
    """Mesh the inside of the surface."""
    corners: list[Floats] = []
    middles: list[Floats] = []
    tips: list[int] = []
    for (f, knots), length in zip(splines, edge_lengths(splines, size), strict=True):
        count = np.concatenate([[0.0], np.cumsum(np.diff(knots) * 0.5 * (1 / length[1:] + 1 / length[:-1]))])
        edges = int(np.ceil(count[-1]))
        ends = np.interp(np.linspace(0, count[-1], edges + 1), count, knots)
        tips.append(2 * sum(len(c) for c in corners))
        corners.append(f(ends[:-1]))
        middles.append(f(0.5 * (ends[:-1] + ends[1:])))
    ring, middle = np.concatenate(corners), np.concatenate(middles)
    n = len(ring)
    numbers = 1 + np.arange(n)
    plan = {"vertices": np.concatenate([[[0.0, 0.0]], ring]), "segments": np.stack([numbers, np.roll(numbers, -1)], axis=1)}
    import triangle

    made = triangle.triangulate(plan, f"pq30YYa{0.433 * (1.5 * size) ** 2:.9f}")
    triangles, places = made["triangles"].astype(np.int64), made["vertices"]
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
    nodes = np.concatenate([places, places[unique].mean(axis=1)])
    elements = np.concatenate([triangles, len(places) + inverse.reshape(-1, 3)], axis=1).astype(np.int64)
    lookup = {(int(a), int(b)): len(places) + k for k, (a, b) in enumerate(unique)}
    surface_middle = np.array([lookup[min(a, b), max(a, b)] for a, b in plan["segments"].tolist()])
    nodes[surface_middle] = middle
    surface = np.stack([numbers, surface_middle], axis=1).ravel()
    return Mesh(nodes, elements, len(places), surface, np.array(tips))


def worst_triangle(mesh: Mesh, nodes: Floats) -> float:
    """Return the smallest quality of a triangle, 1 for an equilateral one, and 0 for a nearly folded curved one."""
    corner = nodes[mesh.elements[:, :3]]
    sides = np.roll(corner, -1, axis=1) - corner
    twice = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    determinant = np.linalg.det(np.einsum("tia,qib->tqab", nodes[mesh.elements], P2_GRADIENT))
    if (determinant.min(axis=1) < 0.3 * determinant.max(axis=1)).any():
        return 0.0
    return float((2 * np.sqrt(3.0) * twice / (sides**2).sum(axis=(1, 2))).min())


def start_of_steps(step: float, end: float) -> Floats:
    """Return the times: eight graded steps over the first four, then even ones."""
    return np.concatenate([4 * step * (np.arange(8) / 8) ** 2, np.arange(4, round(end / step) + 1) * step])


def run(reynolds: float, size: float, step: float, end: float, output: Path, remesh: float, passes: int) -> None:
    """Compute the flow and write the histories and outlines to the output folder."""
    output.mkdir(parents=True, exist_ok=True)
    mu, began = 1 / reynolds, time.time()
    square = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])
    along = np.linspace(0, 1, 200, endpoint=False)[:, None]
    sides = [a + along * (b - a) for a, b in zip(square, np.roll(square, -1, axis=0), strict=True)]
    mesh = make_mesh(surface_splines(np.concatenate(sides), 200 * np.arange(4)), size)
    x = mesh.nodes.copy()
    u = np.stack([x[:, 1], -x[:, 0]], axis=1)
    x_old, u_old = x.copy(), u.copy()
    forms = Forms(mesh, x)
    p = Forms(mesh, x + 1e-6 * u).solve(1e6, mu, 1e6 * (Forms(mesh, x + 1e-6 * u).mass @ u))[1]
    start, raw = Forms(mesh, x + 1e-6 * u).centre_pressure(p)
    print(f"pressure at the centre at t -> 0: {start:.7f} (node: {raw:.7f}), exact {EXACT_START_PRESSURE}", flush=True)
    times = start_of_steps(step, end)
    rows: list[list[float]] = []
    lost, rate, last_remesh = 0.0, mu * forms.dissipation(u), 0.0
    for k, now in enumerate(times):
        if k > 0:
            dt = now - times[k - 1]
            ratio = dt / (times[k - 1] - times[k - 2]) if k > 1 else 0.0
            # The coefficients of variable-step BDF2; a ratio of zero gives backward Euler.
            c0, c1, c2 = (1 + 2 * ratio) / (1 + ratio), -(1 + ratio), ratio**2 / (1 + ratio)
            u_next = u + ratio * (u - u_old)
            for _ in range(passes):
                x_next = (dt * u_next - c1 * x - c2 * x_old) / c0
                forms = Forms(mesh, x_next)
                u_next, p = forms.solve(c0 / dt, mu, forms.mass @ (-c1 * u - c2 * u_old) / dt)
            x_old, x, u_old, u = x, x_next, u, u_next
            rate_old, rate = rate, mu * forms.dissipation(u)
            lost += 0.5 * dt * (rate + rate_old)
        mesh.nodes = x
        centre, raw = forms.centre_pressure(p)
        radius = np.linalg.norm(x[mesh.surface], axis=1)
        splines = surface_splines(x[mesh.surface], mesh.tips)
        fine = np.linalg.norm(np.concatenate([f(np.linspace(0, knots[-1], 2000)) for f, knots in splines]), axis=1)
        energy = forms.kinetic_energy(u)
        rows.append([now, centre, float(radius.max()), float(fine.min()), energy, forms.angular_momentum(u), forms.area,
                     lost, 1 / 12 - energy - lost, float(len(mesh.elements)), raw])
        for moment in OUTLINE_TIMES:
            if abs(now - moment) < 1e-9:
                line = np.concatenate([f(np.linspace(0, knots[-1], 201)[:-1]) for f, knots in splines])
                np.savetxt(output / f"outline_wt{moment:g}.csv", np.hstack([line, np.roll(line, -1, axis=0)]), "%.8f", ",",
                           header="x1_over_L,y1_over_L,x2_over_L,y2_over_L", comments="")
        if k % max(1, round(0.1 / step)) == 0 or k == len(times) - 1:
            print(f"t {now:.4f} p {centre:.6f} tip {rows[-1][2]:.5f} side {rows[-1][3]:.5f} energy {energy:.6f} "
                  f"balance {rows[-1][8]:.1e} momentum {rows[-1][5]:.7f} area {forms.area:.7f} "
                  f"triangles {len(mesh.elements)} quality {worst_triangle(mesh, x):.2f} "
                  f"raw p {rows[-1][10]:.6f} {time.time() - began:.0f} s", flush=True)
            np.savetxt(output / "history.csv", np.array(rows), "%.9g", ",", comments="", header="omega_t,p_centre,"
                       "r_max,r_min,kinetic_energy,angular_momentum,area,dissipated,energy_defect,triangles,p_node")
        if k > 8 and (now - last_remesh > remesh - 1e-9 or worst_triangle(mesh, x) < 0.35):
            new = make_mesh(splines, size)
            back = interpolate(mesh, locate(mesh, new.nodes), x - x_old)
            points = np.einsum("qi,tia->tqa", P2, new.nodes[new.elements])
            place = locate(mesh, points.reshape(-1, 2))
            both = interpolate(mesh, place, np.hstack([u, u_old])).reshape(*points.shape[:2], 4)
            x, x_old = new.nodes, new.nodes - back
            forms = Forms(new, x)
            u, u_old = forms.project(both[:, :, :2]), Forms(new, x_old).project(both[:, :, 2:])
            mesh, last_remesh = new, now
    table = np.array(rows)
    even = np.arange(0, end + 1e-9, 0.02)
    np.savetxt(output / "centre.csv", np.column_stack([even, CubicSpline(table[:, 0], table[:, 1:6])(even)]), "%.7g", ",",
               comments="", header="omega_t,p_centre_over_rho_w2_L2,r_max_tip_over_L,r_min_side_over_L,"
               "kinetic_energy_over_rho_w2_L4,angular_momentum_over_rho_w_L4")


def checked(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Return the arguments; every number must be above 0, and the mesh generator has to be there. Ends with code 2 else."""
    chosen = parser.parse_args()
    for name, value in vars(chosen).items():
        if isinstance(value, int | float) and not value > 0:
            parser.error(f"--{name} {value}: needs a number above 0")
    if importlib.util.find_spec("triangle") is None:
        parser.error("needs Shewchuk's mesh generator: pip install triangle")
    return chosen


def main() -> None:
    """Read the arguments and run."""
    parser = argparse.ArgumentParser(description="Rotating square of liquid with a free surface and no air.")
    parser.add_argument("--reynolds", type=float, default=100.0, help="omega L^2 / nu")
    parser.add_argument("--size", type=float, default=0.03, help="length of the elements at the surface over L")
    parser.add_argument("--step", type=float, default=0.01, help="time step times omega")
    parser.add_argument("--end", type=float, default=3.0, help="end of the run, omega t")
    parser.add_argument("--output", type=Path, default=Path("out"), help="folder for the results")
    parser.add_argument("--remesh", type=float, default=0.1, help="longest time between new meshes times omega")
    parser.add_argument("--passes", type=int, default=2, help="solutions in each step, the last with improved geometry")
    a = checked(parser)
    run(a.reynolds, a.size, a.step, a.end, a.output, a.remesh, a.passes)


if __name__ == "__main__":
    main()
