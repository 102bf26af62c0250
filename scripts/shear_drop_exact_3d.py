"""A drop in simple shear in unbounded 3-D Stokes flow, drop and matrix of one viscosity: boundary integrals.

    python scripts/shear_drop_exact_3d.py --capillary 0.05 0.1 0.2 0.3 0.35 --json steady.json --curve curves.csv

prints the steady deformation D and angle of each capillary number: those of the ellipsoid with the same second moments, as
the gauge `deformation` has them, and those of the longest and the shortest radius in the plane of shear, as papers have
them. A drop that finds no steady state is followed to --end-time; `speed left`, the largest normal speed at the end, tells
whether it moves on.

Units: R = 1, shear rate 1, viscosity 1, so that the tension is 1/Ca. The flow far away is (y, 0, 0).

With one viscosity the interface moves as point forces on it have it (C. Pozrikidis, Boundary Integral and Singularity
Methods, 1992, section 5.3)

    u_j(x0) = [y0, 0, 0]_j - 1/(8 pi Ca) int (k - k0) n_i G_ij dS,    G_ij = d_ij/r + r_i r_j/r^3,  r = x - x0

with k the sum of the principal curvatures, k0 that at x0, and n the normal out of the drop; int n_i G_ij dS is 0.

The drop is x = A e/s(e), e on the unit sphere: A makes of the sphere the ellipsoid of the drop's second moments, anew every
`INTERVAL`, and s is a series of spherical harmonics next to 1, exactly 1 for any ellipsoid. Only those harmonics are in it
that do not change with x -> -x nor with z -> -z, as the drop has both symmetries. With F(y) = |y| s(y/|y|), which is 1 on
the drop for y = A^-1 x, the gradient q = A^-T (s e + grad s) to x gives

    n = q/|q|,   n dS = det A q/s^3 de,   k = div(q/|q|),   ds/dt = -s u.q

Everything is of spectral accuracy in space: the integral is taken in polar coordinates about each point x0, where that of a
point force is smooth (Gauss's rule in the polar angle, the trapezoid rule around). In time: the Runge-Kutta method of fourth
order.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from shear_drop_exact import refuse_folders, write_columns  # noqa: E402

INTERVAL = 0.05  # between the times of a curve; the ellipsoid A is taken anew as often
STABLE = 2.0  # step times the rate of the stiffest mode; the method allows 2.78
STEADY = 1e-6  # largest change of D and of the angle [rad] in one unit of time at which a drop counts as steady


def harmonics(degree: int, polar: np.ndarray, azimuth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the spherical harmonics of even n up to a degree and even m >= 0, (p, modes), complex, of unit norm.

    With them their slopes along the polar angle and along the azimuth, per length on the sphere. The modes are in the order
    of `modes`; the recurrences are those of the associated Legendre functions. No point may be a pole.

    Args:
        polar, azimuth: (p,) angles of the points [rad].
    """
    cosine, sine = np.cos(polar), np.sin(polar)
    value, slope = [], []
    sectoral = np.full_like(polar, np.sqrt(1 / (4 * np.pi)))  # n = m
    for m in range(degree + 1):
        if m:
            sectoral = np.sqrt((2 * m + 1) / (2 * m)) * sine * sectoral
        if m % 2:
            continue
        before, here = np.zeros_like(polar), sectoral
        for n in range(m, degree + 1):
            if n > m:
                shrink = np.sqrt(((n - 1) ** 2 - m**2) / (4 * (n - 1) ** 2 - 1)) if n > m + 1 else 0.0
                before, here = here, np.sqrt((4 * n**2 - 1) / (n**2 - m**2)) * (cosine * here - shrink * before)
            if n % 2 == 0:
                value.append(here)
                fall = np.sqrt((2 * n + 1) * (n**2 - m**2) / (2 * n - 1)) if n else 0.0
                slope.append((n * cosine * here - fall * before) / sine)
    order = modes(degree)[1]
    wave = np.exp(1j * np.outer(azimuth, order))
    values = np.column_stack(value) * wave
    return values, np.column_stack(slope) * wave, 1j * order * values / sine[:, None]


def modes(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return n and m (modes,) of the harmonics up to a degree."""
    pairs = [(n, m) for m in range(0, degree + 1, 2) for n in range(m, degree + 1, 2)]
    return np.array([n for n, _ in pairs]), np.array([m for _, m in pairs])


def frame(polar: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Return the unit vectors (3, 3, p) outwards, along the polar angle and along the azimuth; components first."""
    (c, s), (ca, sa) = (np.cos(polar), np.sin(polar)), (np.cos(azimuth), np.sin(azimuth))
    return np.stack([[s * ca, c * ca, -sa], [s * sa, c * sa, ca], [c, -s, 0 * c]])


def real(matrix: np.ndarray) -> np.ndarray:
    """Return the real matrix (p, 2 modes) that makes of real, then imaginary parts the real part of the product."""
    return np.hstack([matrix.real, -matrix.imag])


@dataclass(frozen=True)
class Around:
    """Half the sphere about a point at azimuth 0, in polar coordinates; the other half follows from x -> -x."""

    value: np.ndarray
    """(p, 2 modes), see `real`, as are the slopes"""
    slopes: tuple[np.ndarray, np.ndarray]
    frame: np.ndarray
    """(3, 3, p), see `frame`"""
    weight: np.ndarray
    """(p,) area on the unit sphere"""

    @classmethod
    def point(cls, degree: int, polar: float, rings: int) -> "Around":
        """Return `rings` rings of 2 rings points each about the point at a polar angle [rad]."""
        nodes, weights = np.polynomial.legendre.leggauss(rings)
        distance, around = np.pi / 4 * (nodes + 1), np.pi * (np.arange(2 * rings) + 0.5) / rings
        out, south, east = frame(np.array([polar]), np.zeros(1))[:, :, 0].T
        ring = np.cos(around)[:, None] * south + np.sin(around)[:, None] * east
        place = np.cos(distance)[:, None, None] * out + np.sin(distance)[:, None, None] * ring
        angles = polar_angles(place.reshape(-1, 3).T)
        value, *slopes = (real(matrix) for matrix in harmonics(degree, *angles))
        weight = np.repeat(np.pi / 4 * weights * np.sin(distance) * np.pi / rings, 2 * rings)
        return cls(value, (slopes[0], slopes[1]), frame(*angles), weight)


def polar_angles(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the polar angle and the azimuth (p,) of directions (3, p) of any length."""
    return np.arctan2(np.hypot(place[0], place[1]), place[2]), np.arctan2(place[1], place[0])


class Sphere:
    """The nodes on the unit sphere and the series of even harmonics on them.

    They fill a quarter, azimuth below pi and z > 0, that stands for all by symmetry; all latitudes have the same azimuths.

    Args:
        degree: of the harmonics, even.
        rings: of the points of the integral about each node, from it to a right angle; by default the degree + 4.
    """

    def __init__(self, degree: int, rings: int | None = None) -> None:
        self.degree = degree
        self.n, self.m = modes(degree)
        half = 3 * degree // 4 + 1  # latitudes on one side: half as many again as the harmonics need, for their products
        cosines, weights = np.polynomial.legendre.leggauss(2 * half)
        self.latitude = np.arccos(cosines[half:])
        self.longitude = np.pi * np.arange(2 * half) / (2 * half)
        self.weight = np.repeat(2 * weights[half:], len(self.longitude)) * (2 * np.pi / len(self.longitude))
        """(nodes,) area that each stands for; all 4 pi"""
        self.angles = np.repeat(self.latitude, len(self.longitude)), np.tile(self.longitude, len(self.latitude))
        self.frame = frame(*self.angles)
        self.value, *slopes = harmonics(degree, *self.angles)
        self.slopes = slopes[0], slopes[1]
        cotangent, sine = (function(self.angles[0])[:, None] for function in (lambda a: 1 / np.tan(a), np.sin))
        across = -(self.m**2) * self.value / sine**2 + cotangent * slopes[0]
        along = -self.n * (self.n + 1) * self.value - across  # the Laplacian of a harmonic is -n (n + 1) times it
        mixed = 1j * self.m / sine * (slopes[0] - cotangent * self.value)
        self.bend = along, mixed, across
        """second covariant derivatives: twice along the polar angle, once along each, twice along the azimuth"""
        self.around = [Around.point(degree, polar, rings or degree + 4) for polar in self.latitude]
        self.turn = np.exp(1j * np.outer(self.m, self.longitude))
        """(modes, longitudes) factors of a series that is turned back about z by each longitude"""
        c, s, none = np.cos(self.longitude), np.sin(self.longitude), np.zeros(len(self.longitude))
        self.turned = np.stack([[c, -s, none], [s, c, none], [none, none, none + 1]])
        """(3, 3, longitudes) the rotation by each longitude"""

    def series(self, values: np.ndarray) -> np.ndarray:
        """Return the coefficients (modes,) of values (nodes,): the values are the real part of the sum."""
        return np.where(self.m, 2, 1) * ((self.weight * values) @ self.value.conj())


class Interface:
    """A closed surface x = A e/s(e) about the origin, with the symmetries of a drop in shear.

    Args:
        sphere: the nodes.
        stretch: (3, 3) A [R].
        series: (modes,) coefficients of s.
    """

    def __init__(self, sphere: Sphere, stretch: np.ndarray, series: np.ndarray) -> None:
        self.sphere, self.stretch, self.series = sphere, stretch, series
        self.inverse = np.linalg.inv(stretch)
        out, south, east = sphere.frame.transpose(1, 0, 2)
        self.s = (sphere.value @ series).real
        slope = [(matrix @ series).real for matrix in sphere.slopes]
        self.position = stretch @ out / self.s
        """(3, nodes) [R]"""
        self.gradient = self.inverse.T @ (self.s * out + slope[0] * south + slope[1] * east)
        """q (3, nodes) [1/R], along the normal out of the drop"""
        along, mixed, across = ((matrix @ series).real for matrix in sphere.bend)
        parts = ((along + self.s, south, south), (2 * mixed, south, east), (across + self.s, east, east))
        steepness = np.sqrt(np.sum(self.gradient**2, axis=0))
        normal = self.normal = self.gradient / steepness
        """(3, nodes) out of the drop"""
        self.curvature = np.zeros_like(self.s)
        """(nodes,) sum of the principal curvatures, 2 for a sphere [1/R]"""
        for factor, one, other in parts:
            one, other = self.inverse.T @ one, self.inverse.T @ other
            trace = np.sum(one * other, axis=0) - np.sum(one * normal, axis=0) * np.sum(other * normal, axis=0)
            self.curvature += self.s * factor * trace / steepness

    @property
    def volume(self) -> float:
        """The volume inside [R^3]."""
        return float(np.linalg.det(self.stretch) / 3 * self.sphere.weight @ self.s**-3)

    def ellipsoid(self) -> np.ndarray:
        """Return the symmetric matrix (3, 3) that makes of the unit sphere the ellipsoid with the same second moments [R].

        The mean of x_i x_j over an ellipsoid of semi-axis a is a^2/5; that over the drop is an integral over the sphere.
        """
        out = self.stretch @ self.sphere.frame[:, 0]
        flat = self.sphere.weight * self.s**-5
        # The nodes stand for those at -z, where products with one z are opposite, and at -x, where all are the same.
        moments = (flat * out) @ out.T * np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]])
        moments *= np.linalg.det(self.stretch) / (5 * self.volume)
        squares, vectors = np.linalg.eigh(5 * moments)
        return (vectors * np.sqrt(squares)) @ vectors.T

    def shape(self) -> tuple[float, float]:
        """Return D = (L - B)/(L + B) and the angle [degrees] of the ellipsoid with the same second moments."""
        axes, vectors = np.linalg.eigh(self.ellipsoid())
        if axes[2] - axes[0] < 1e-12:
            return 0.0, 45.0  # a sphere, which shear begins to draw out at this angle
        return deformation_of(axes[2], axes[0]), angle_of(*vectors[:2, 2])

    def radii(self) -> tuple[float, float]:
        """Return D = (L - B)/(L + B) of the extreme radii in the plane of shear, and the angle of the longest [degrees]."""

        def place(azimuth: np.ndarray) -> np.ndarray:
            polar = np.full_like(azimuth, np.pi / 2)
            s = (harmonics(self.sphere.degree, polar, azimuth)[0] @ self.series).real
            return self.stretch @ frame(polar, azimuth)[:, 0] / s

        half_turn = np.pi * np.arange(512) / 512
        square = np.sum(place(half_turn) ** 2, axis=0)
        ends = []
        for index in (square.argmin(), square.argmax()):
            before, here, after = square[np.arange(index - 1, index + 2) % 512]
            off = (before - after) / (before - 2 * here + after) / 2  # the vertex of a parabola, in steps
            ends.append(place(half_turn[[index]] + off * np.pi / 512)[:, 0])
        shortest, longest = (float(np.linalg.norm(end)) for end in ends)
        return deformation_of(longest, shortest), angle_of(*ends[1][:2])

    def spread(self, volume: float) -> "Interface":
        """Return the same drop over the ellipsoid of its second moments, scaled to a volume [R^3]."""
        stretch = self.ellipsoid()
        place = self.inverse @ stretch @ self.sphere.frame[:, 0]
        s = (harmonics(self.sphere.degree, *polar_angles(place))[0] @ self.series).real * np.sqrt(np.sum(place**2, axis=0))
        new = Interface(self.sphere, stretch, self.sphere.series(s))
        return Interface(self.sphere, stretch * (volume / new.volume) ** (1 / 3), new.series)


def deformation_of(longest: float, shortest: float) -> float:
    """Return D of two semi-axes."""
    return float((longest - shortest) / (longest + shortest))


def angle_of(x: float, y: float) -> float:
    """Return the angle [degrees] of a line to the x axis, from -90 to 90."""
    return float(np.degrees(np.arctan2(y, x) if x > 0 else np.arctan2(-y, -x)))


@dataclass(frozen=True)
class Drop:
    """What decides about the motion of a drop."""

    tension: float
    """1/Ca [viscosity x shear rate x R]"""
    shear: float = 1.0
    """shear rate; 0 for a drop at rest"""

    def velocity(self, surface: Interface) -> np.ndarray:
        """Return the velocity (3, nodes) of the fluids at the nodes of their interface."""
        sphere, count = surface.sphere, len(surface.sphere.longitude)
        series = np.stack([surface.series, sphere.series(surface.curvature)])
        # (s and curvature, modes, longitudes): as each node of a latitude has them when its own azimuth is 0
        series = series[:, :, None] * sphere.turn
        series = np.concatenate([series.real, series.imag], axis=1)
        stretch = np.einsum("ab,bcj->acj", surface.stretch, sphere.turned)
        inverse = np.einsum("ba,bcj->acj", surface.inverse, sphere.turned)
        velocity = np.zeros((3, len(sphere.weight)))
        velocity[0] = self.shear * surface.position[1]
        for row, around in enumerate(sphere.around):
            mine = slice(row * count, (row + 1) * count)
            s = around.value @ series[0]
            out, south, east = around.frame.transpose(1, 0, 2)[:, :, :, None]
            gradient = s * out + (around.slopes[0] @ series[0]) * south + (around.slopes[1] @ series[0]) * east
            place = np.einsum("abj,bpj->apj", stretch, out / s)
            jump = around.value @ series[1] - surface.curvature[mine]
            force = np.einsum("abj,bpj->apj", inverse, gradient * (jump / s**3 * around.weight[:, None]))
            here = surface.position[:, None, mine]
            flow = point_flow(force, place - here) - point_flow(force, place + here)
            velocity[:, mine] -= self.tension * np.linalg.det(surface.stretch) / (8 * np.pi) * flow
        return velocity

    def motion(self, surface: Interface) -> tuple[np.ndarray, float]:
        """Return the rate (modes,) of the series and the largest normal speed."""
        velocity = self.velocity(surface)
        rate = -surface.s * np.sum(velocity * surface.gradient, axis=0)
        return surface.sphere.series(rate), float(np.abs(np.sum(velocity * surface.normal, axis=0)).max())

    def run(self, degree: int, end_time: float) -> Iterator[tuple[float, Interface, float]]:
        """Yield time, interface and largest normal speed every `INTERVAL`, from a sphere to the end or the steady state.

        Args:
            degree: of the harmonics, even.
            end_time: over the inverse of the shear rate.
        """
        sphere = Sphere(degree)
        surface = Interface(sphere, np.eye(3), sphere.series(np.ones(len(sphere.weight))))
        past: list[tuple[float, float]] = []  # D and angle [rad] of all times
        for turn in range(round(end_time / INTERVAL) + 1):
            deformation, degrees = surface.shape()
            past.append((deformation, float(np.radians(degrees))))
            yield turn * INTERVAL, surface, self.motion(surface)[1]
            if turn * INTERVAL > 1 and np.ptp(past[-round(1 / INTERVAL) :], axis=0).max() < STEADY:
                return
            stiffest = relaxation(degree) * self.tension / np.linalg.eigvalsh(surface.stretch)[0]
            steps = int(np.ceil(INTERVAL * max(stiffest / STABLE, 1.0)))
            for _ in range(steps):
                surface = self._step(surface, INTERVAL / steps)
            surface = surface.spread(4 * np.pi / 3)

    def _step(self, surface: Interface, step: float) -> Interface:
        def moved(rate: np.ndarray, time: float) -> Interface:
            return Interface(surface.sphere, surface.stretch, surface.series + time * rate)

        first = self.motion(surface)[0]
        second = self.motion(moved(first, step / 2))[0]
        third = self.motion(moved(second, step / 2))[0]
        fourth = self.motion(moved(third, step))[0]
        return moved(first + 2 * second + 2 * third + fourth, step / 6)


def point_flow(force: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return the sums (3, targets) of force_i G_ij over the sources.

    Args:
        force: (3, sources, targets) of each source.
        offset: (3, sources, targets) source less target [R].
    """
    square = np.sum(offset**2, axis=0)
    along = np.sum(force * offset, axis=0) / square
    return np.sum((force + along * offset) / np.sqrt(square), axis=1)


def relaxation(n: int) -> float:
    """Return the rate [tension/(viscosity x R)] at which a harmonic of degree n on a sphere of one viscosity falls.

    A normal force Y on the unit sphere makes the normal speed 2 n (n + 1)/((2 n - 1)(2 n + 1)(2 n + 3)) Y, by the
    eigenvalues of the single layer, and r = 1 + Y has the curvature 2 + (n - 1)(n + 2) Y. For n = 2 the rate is 16/35.
    """
    return 2 * (n - 1) * n * (n + 1) * (n + 2) / ((2 * n - 1) * (2 * n + 1) * (2 * n + 3))


def cox(capillary: float) -> tuple[float, float]:
    """Return D and angle [degrees] of a barely deformed drop of one viscosity (Cox 1969)."""
    turn = 19 * capillary / 20
    return 35 / 32 * capillary / float(np.hypot(1, turn)), 45 - float(np.degrees(np.arctan(turn))) / 2


def refuse(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """End with a message and exit code 2 if a value has no meaning or a result could not be written."""
    wrong = [value for value in options.capillary if not 0 < value < np.inf]
    if wrong:
        parser.error(f"--capillary {wrong[0]:g}: has to be above 0 and finite")
    if options.degree % 2 or options.degree < 4:
        parser.error(f"--degree {options.degree}: has to be even and at least 4")
    if not 0 < options.end_time < np.inf:
        parser.error(f"--end-time {options.end_time:g}: has to be above 0 and finite")
    refuse_folders(parser, options.json, options.curve)


def main() -> None:
    """Print the steady deformation of each capillary number."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--capillary", type=float, nargs="+", default=[0.1], help="viscosity x shear rate x R/tension")
    parser.add_argument("--degree", type=int, default=12, help="of the spherical harmonics, even")
    parser.add_argument("--end-time", type=float, default=60.0, help="times the shear rate, without a steady state")
    parser.add_argument("--json", metavar="FILE", help="the table, a list of one object per capillary number")
    parser.add_argument("--curve", metavar="FILE", help="D and angle over time as comma-separated values")
    options = parser.parse_args()
    refuse(parser, options)
    rows, curves = [], {}
    print("| Ca | D | angle [degrees] | D of radii | its angle | t | speed left | Cox 1969 |\n" + "|---" * 8 + "|")
    for capillary in options.capillary:
        curve = []
        for t, surface, speed in Drop(1 / capillary).run(options.degree, options.end_time):  # noqa: B007
            curve.append((t, *surface.shape()))
        t, deformation, angle = curve[-1]
        of_radii, its_angle = surface.radii()
        state = f"{deformation:.5f} | {angle:.3f} | {of_radii:.5f} | {its_angle:.3f} | {t:.2f} | {speed:.1e}"
        print(f"| {capillary:g} | {state} | {{:.5f}}, {{:.2f}} |".format(*cox(capillary)), flush=True)
        curves[f"Ca{capillary:g}"] = curve
        row = {"capillary": capillary, "deformation": deformation, "angle": angle, "deformation_of_radii": of_radii}
        rows.append(row | {"angle_of_radii": its_angle, "time": t, "speed_left": speed})
    if options.json:
        with open(options.json, "w") as file:
            json.dump(rows, file, indent=1)
    if options.curve:
        names = [f"{part}_{name}" for name in curves for part in ("D", "angle")]
        write_columns(options.curve, ["G_t", *names], curves)


if __name__ == "__main__":
    main()
