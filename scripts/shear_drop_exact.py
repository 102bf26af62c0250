"""A drop in shear between two walls in 2-D Stokes flow, drop and matrix of different viscosity: boundary integrals.

    python scripts/shear_drop_exact.py --viscosity 0.1 1 10 --capillary 0.1 0.2 0.4 --json steady.json --curve curves.csv

prints the steady deformation D and angle of each pair in the box of cases/shear_drop.yaml, 8 R long and 8 R wide. D and the
angle are those of the ellipse with the same second moments, as the gauge `deformation` has them. A drop that finds no steady
state is followed to --end-time; `speed left`, the largest normal speed at the end, tells whether it moves on.

Units: R = 1, shear rate 1, viscosity of the matrix 1, so that the tension is 1/Ca. The walls at y = +-H move at +-H.

The velocity of the interface obeys (C. Pozrikidis, Boundary Integral and Singularity Methods, 1992)

    u_j(x0) = 2/(1 + l) [y0, 0]_j - 1/(2 pi (1 + l)) int k n_i G_ij/Ca ds + (1 - l)/(2 pi (1 + l)) int u_i T_ijk n_k ds

with l the ratio of viscosities, k the curvature, n the normal out of the drop, and a Green's function G of stress T that is
periodic in x and 0 at the walls. It is the periodic one without walls, which is known in closed form, and a smooth flow that
takes its velocity from the walls, by Fourier modes along them.

Everything is of spectral accuracy in space: the trapezoid rule on points of equal distance, with the weights of R. Kress
(Linear Integral Equations, chapter 12) for the logarithm. In time: the Runge-Kutta method of fourth order.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

INTERVAL = 0.05  # between the times of a curve; the points are spread anew as often
STABLE = 2.0  # step times the rate of the stiffest mode; the method allows 2.78
STEADY = 1e-7  # largest change of D and of the angle [rad] in one unit of time at which a drop counts as steady


def derivative(values: np.ndarray) -> np.ndarray:
    """Return the derivative (n, ...) of periodic values (n, ...) to a parameter that runs over 2 pi along the first axis."""
    count = len(values)
    modes = 1j * np.arange(count // 2 + 1)
    modes[-1] = 0  # the highest mode of an even count has no derivative at the points
    return np.fft.irfft(modes.reshape(-1, *[1] * (values.ndim - 1)) * np.fft.rfft(values, axis=0), count, axis=0)


def integral(values: np.ndarray) -> np.ndarray:
    """Return the integral (n,) without mean of periodic values (n,), whose mean is left out, see `derivative`."""
    modes = np.arange(len(values) // 2 + 1)
    spectrum = np.fft.rfft(values)
    spectrum[[0, -1]] = 0
    return np.fft.irfft(spectrum / (1j * np.maximum(modes, 1)), len(values))


class Interface:
    """A closed curve through points, counter-clockwise, as a Fourier series in a parameter that runs over 2 pi.

    Args:
        position: (n, 2), n even [R].
    """

    def __init__(self, position: np.ndarray) -> None:
        slope = derivative(position)
        self.position = position
        self.stretch = np.hypot(*slope.T)
        """(n,) length per parameter [R]"""
        self.tangent = slope / self.stretch[:, None]
        self.normal = np.column_stack([self.tangent[:, 1], -self.tangent[:, 0]])
        """(n, 2) out of the drop"""
        self.curvature = np.sum(derivative(self.normal) * self.tangent, axis=1) / self.stretch
        """(n,) above 0 for a circle [1/R]"""
        self.weight = self.stretch * (2 * np.pi / len(position))
        """(n,) length of each point [R]"""

    @property
    def area(self) -> float:
        """The area inside [R^2]."""
        return float(np.sum(self.position * self.normal, axis=1) @ self.weight) / 2

    @property
    def centroid(self) -> np.ndarray:
        """(2,) the centre of the area [R]."""
        squares = np.sum(self.position**2, axis=1) * self.weight
        return squares @ self.normal / (2 * self.area)

    def shape(self) -> tuple[float, float]:
        """Return D = (L - B)/(L + B) and the angle [degrees] of the ellipse with the same second moments of area.

        By the divergence theorem the area's mean of x_i x_j is that of x_i x_j (x.n)/4 over the curve.
        """
        offset = self.position - self.centroid
        flux = np.sum(offset * self.normal, axis=1) * self.weight / (4 * self.area)
        squares, vectors = np.linalg.eigh((flux[:, None] * offset).T @ offset)
        short, long = np.sqrt(squares)
        x, y = vectors[:, 1]
        angle = np.arctan2(y, x) if x > 0 else np.arctan2(-y, -x)  # from -90 to 90 degrees
        return float((long - short) / (long + short)), float(np.degrees(angle))


def spread(position: np.ndarray, area: float) -> np.ndarray:
    """Return the points (n, 2) at equal distances along the curve, scaled about its centroid to the area [R^2].

    The highest modes are damped as exp(-36 (m/m_max)^25) (Hou, Lowengrub and Shelley 1994): products feed them falsely.
    """
    curve, count = Interface(position), len(position)
    wanted = parameter = 2 * np.pi * np.arange(count) / count
    modes = np.arange(count // 2 + 1)
    excess = np.fft.rfft(integral(curve.stretch) / curve.stretch.mean()) / count
    for _ in range(20):  # the distance along the curve goes with the parameter plus an excess that is next to nothing
        wave = np.exp(1j * np.outer(parameter, modes))
        parameter = wanted - 2 * (wave @ excess).real
    wave = np.exp(1j * np.outer(parameter, modes))
    spectrum = np.fft.rfft(position, axis=0) / count * np.exp(-36 * (modes / modes[-1]) ** 25)[:, None]
    spectrum[1:-1] *= 2
    new = Interface((wave @ spectrum).real)
    return new.centroid + (new.position - new.centroid) * np.sqrt(area / new.area)


@dataclass(frozen=True)
class Stokeslets:
    """The Green's function without walls, periodic in x, of sources less targets x, y (Pozrikidis 1992): in terms of

        A = 1/2 ln(2 cosh(w y) - 2 cos(w x)), w = 2 pi/period

    G_xx = -A - y A_y, G_xy = y A_x, G_yy = -A + y A_y, but for a constant. All arrays are (targets, sources).
    """

    log: np.ndarray
    """A"""
    yx: np.ndarray
    """y A_x"""
    yy: np.ndarray
    """y A_y"""
    stress: tuple[np.ndarray, np.ndarray, np.ndarray]
    """sum over k of T_xxk n_k, T_xyk n_k, T_yyk n_k with the normal n at the source"""

    def flow(self, force: np.ndarray) -> np.ndarray:
        """Return the sums (2, targets) of force_i G_ij over the sources, from forces (sources, 2)."""
        fx, fy = force.T
        along = -self.log @ fx - self.yy @ fx + self.yx @ fy
        return np.stack([along, -self.log @ fy + self.yy @ fy + self.yx @ fx])

    def double_layer(self, weight: np.ndarray) -> np.ndarray:
        """Return the matrix (2, targets, 2 sources) that makes of velocities, all x first, the integral of u_i T_ijk n_k."""
        xx, xy, yy = self.stress
        return np.stack([np.hstack([xx * weight, xy * weight]), np.hstack([xy * weight, yy * weight])])


def stokeslets(curve: Interface, target: np.ndarray | None, period: float) -> Stokeslets:
    """Return the kernels from the points of a curve to targets (m, 2) [R], or to these points themselves.

    Among the points themselves `log` holds the weights of Kress: its sums are good to all orders in spite of the logarithm.
    """
    at = curve.position if target is None else target
    wave = 2 * np.pi / period
    x, y = (curve.position[None, :, i] - at[:, None, i] for i in (0, 1))
    sine, sinh = np.sin(wave * x / 2), np.sinh(wave * y / 2)
    s2, h2 = sine**2, sinh**2  # without the differences of numbers next to 1 that cosh - cos would have
    c = 2 * (h2 + s2)
    if target is None:
        np.fill_diagonal(c, 1.0)
    sin_x, sinh_y = 2 * sine * np.cos(wave * x / 2), 2 * sinh * np.cosh(wave * y / 2)
    log, a_x, a_y = np.log(2 * c) / 2, wave * sin_x / (2 * c), wave * sinh_y / (2 * c)
    y_xy = -2 * y * a_x * a_y
    y_yy = y * wave**2 * (s2 - h2 + 2 * s2 * h2) / c**2
    n_x, n_y = curve.normal.T
    t_xxy, t_yyy = -2 * a_y - 2 * y_yy, -2 * a_y + 2 * y_yy
    stress = (
        (-4 * a_x - 2 * y_xy) * n_x + t_xxy * n_y,
        t_xxy * n_x + 2 * y_xy * n_y,
        2 * y_xy * n_x + t_yyy * n_y,
    )
    result = Stokeslets(log, y * a_x, y * a_y, stress)
    if target is None:
        _fill_limits(result, curve, wave)
    return result


def _fill_limits(kernels: Stokeslets, curve: Interface, wave: float) -> None:
    """Write the limits of the kernels for a point's flow upon itself, and the weights of the logarithm."""
    (t_x, t_y), count = curve.tangent.T, len(curve.position)
    np.fill_diagonal(kernels.yx, t_x * t_y)
    np.fill_diagonal(kernels.yy, t_y * t_y)
    for matrix, tangents in zip(kernels.stress, (t_x * t_x, t_x * t_y, t_y * t_y), strict=True):
        np.fill_diagonal(matrix, -2 * curve.curvature * tangents)
    chord = 2 * np.abs(np.sin(np.pi * np.arange(count) / count))
    chord[0] = 1.0
    spectrum = np.zeros(count // 2 + 1)  # of ln(chord): -1/(2 m) for each mode
    spectrum[1:] = -0.5 / np.arange(1, count // 2 + 1)
    exact = np.fft.irfft(spectrum, count)  # times the count: what the trapezoid rule should have found
    correction = count * exact - np.log(chord)
    index = np.arange(count)
    np.fill_diagonal(kernels.log, np.log(wave * curve.stretch))
    kernels.log[...] += correction[(index[None, :] - index[:, None]) % count]


@dataclass(frozen=True)
class Channel:
    """Walls at y = +-half_height [R], periodic in x [R]."""

    half_height: float
    period: float

    @property
    def walls(self) -> np.ndarray:
        """(2 m, 2) points on the upper, then on the lower wall.

        A point force at a distance d is felt there in modes up to exp(-2 pi d m/2/period), taken as far as 1e-15.
        """
        distance = 0.75 * (self.half_height - 1.0)
        count = 2 * int(np.ceil(5.5 * self.period / distance)) + 8
        x = np.tile(self.period * np.arange(count) / count, 2)
        return np.column_stack([x, np.repeat([self.half_height, -self.half_height], count)])

    def inner_flow(self, position: np.ndarray, wall: np.ndarray) -> np.ndarray:
        """Return the Stokes flow (2, n, ...) at points (n, 2) [R] from velocities (2, 2 m, ...) at the points of `walls`.

        Each mode e^{ikx} has a stream function a cosh ky + d y sinh ky + c sinh ky + b y cosh ky, all over cosh kH.
        """
        count, height = wall.shape[1] // 2, self.half_height
        spectrum = np.fft.rfft(wall.reshape(2, 2, count, -1), axis=2)[:, :, :-1] / count
        mean, spectrum = spectrum[0, :, 0].real, spectrum[:, :, 1:]
        k = 2 * np.pi / self.period * np.arange(1, count // 2)[:, None]
        tanh = np.tanh(k * height)
        upper, lower = 1j * spectrum[1] / k  # stream function at the walls, for v = -i k psi
        even, odd = (upper + lower) / 2, (upper - lower) / 2
        even_slope, odd_slope = (spectrum[0, 0] - spectrum[0, 1]) / 2, (spectrum[0, 0] + spectrum[0, 1]) / 2
        d = (even_slope - k * tanh * even) / (tanh + k * height * (1 - tanh**2))
        b = (tanh * odd_slope - k * odd) / (tanh - k * height * (1 - tanh**2))
        a, c = even - d * height * tanh, (odd - b * height) / tanh
        modes = np.concatenate([a, d, c, b])
        k, x, y = k.T, position[:, :1], position[:, 1:]
        grow, fall = np.exp(k * (y - height)), np.exp(-k * (y + height))
        wave = np.exp(1j * k * x) / (1 + np.exp(-2 * k * height))
        cosh, sinh = wave * (grow + fall), wave * (grow - fall)
        psi = np.hstack([k * cosh, k * y * sinh, k * sinh, k * y * cosh])
        slope = np.hstack([k * sinh, sinh + y * k * cosh, k * cosh, cosh + y * k * sinh])
        along = 2 * (slope @ modes).real + (mean[0] + mean[1]) / 2 + (mean[0] - mean[1]) / 2 * y / height
        across = 2 * (psi @ modes).imag  # -i k psi
        return np.stack([along, across]).reshape(2, len(position), *wall.shape[2:])


@dataclass(frozen=True)
class Drop:
    """A drop in a channel: what decides about its motion.

    A channel of some hundred radii stands for a plane without walls: both kernels are in closed form and cost no more.
    """

    ratio: float
    """viscosity of the drop over that of the matrix"""
    tension: float
    """1/Ca [viscosity of the matrix x shear rate x R]"""
    channel: Channel = Channel(4.0, 8.0)
    shear: float = 1.0
    """shear rate; 0 for a drop at rest"""

    def velocity(self, curve: Interface) -> np.ndarray:
        """Return the velocity (n, 2) of the fluids at the points of their interface."""
        channel, count = self.channel, len(curve.position)
        near = stokeslets(curve, None, channel.period)
        far = stokeslets(curve, channel.walls, channel.period)
        force = (self.tension * curve.curvature * curve.weight)[:, None] * curve.normal
        single = near.flow(force) - channel.inner_flow(curve.position, far.flow(force))
        known = -single / (2 * np.pi * (1 + self.ratio))
        known[0] += 2 / (1 + self.ratio) * self.shear * curve.position[:, 1]
        factor = (1 - self.ratio) / (2 * np.pi * (1 + self.ratio))
        if factor == 0:
            return known.T
        at_walls = far.double_layer(curve.weight)
        matrix = near.double_layer(curve.weight) - channel.inner_flow(curve.position, at_walls)
        matrix = np.eye(2 * count) - factor * matrix.reshape(2 * count, 2 * count)
        return np.linalg.solve(matrix, known.ravel()).reshape(2, count).T

    def motion(self, position: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the velocity (n, 2) of the points and the largest normal speed.

        Points go with the fluid along the normal, and along the curve so that their distances stay equal.
        """
        curve = Interface(position)
        normal = np.sum(self.velocity(curve) * curve.normal, axis=1)
        along = -integral(normal * curve.curvature * curve.stretch)
        return normal[:, None] * curve.normal + along[:, None] * curve.tangent, float(np.abs(normal).max())

    def run(self, points: int, end_time: float) -> Iterator[tuple[float, Interface, float]]:
        """Yield time, interface and largest normal speed every `INTERVAL`, from a circle to the end or the steady state.

        Steady is judged by D and angle: the normal speed falls no further than the points resolve the curvature.

        Args:
            points: of the interface, even.
            end_time: over the inverse of the shear rate.
        """
        angle = 2 * np.pi * np.arange(points) / points
        position = np.column_stack([np.cos(angle), np.sin(angle)])
        past: list[tuple[float, float]] = []  # D and angle [rad] of all times
        for turn in range(round(end_time / INTERVAL) + 1):
            curve = Interface(position)
            deformation, degrees = curve.shape()
            past.append((deformation, float(np.radians(degrees))))
            yield turn * INTERVAL, curve, self.motion(position)[1]
            if turn * INTERVAL > 1 and np.ptp(past[-round(1 / INTERVAL) :], axis=0).max() < STEADY:
                return
            # a wave of m on the circle falls at the rate m tension/(2 (1 + ratio)), the exact law of small ones
            stiffest = points / 2 / curve.stretch.min() * self.tension / (2 * (1 + self.ratio))
            steps = int(np.ceil(INTERVAL * max(stiffest / STABLE, 1.0)))
            for _ in range(steps):
                position = self._step(position, INTERVAL / steps)
            position = spread(position, np.pi)

    def _step(self, position: np.ndarray, step: float) -> np.ndarray:
        first = self.motion(position)[0]
        second = self.motion(position + step / 2 * first)[0]
        third = self.motion(position + step / 2 * second)[0]
        fourth = self.motion(position + step * third)[0]
        return position + step / 6 * (first + 2 * second + 2 * third + fourth)


def unbounded(ratio: float, capillary: float) -> tuple[float, float]:
    """Return D and angle [degrees] of a barely deformed drop without walls (docs/records/shear.md#ratios)."""
    q = (1 + ratio) * capillary
    return capillary / float(np.hypot(1, q)), 45 - float(np.degrees(np.arctan(q))) / 2


def write_curves(path: str, curves: dict[str, list[tuple[float, float, float]]]) -> None:
    """Write a table of t, D and angle [degrees] for each pair."""
    names = [f"{part}{pair if len(curves) > 1 else ''}" for pair in curves for part in ("D", "angle")]
    write_columns(path, ["t", *names], curves)


def write_columns(path: str, names: list[str], curves: dict[str, list[tuple[float, float, float]]]) -> None:
    """Write time, D and angle of each curve under these names; one that is steady before the others keeps its values."""
    longest = max(curves.values(), key=len)
    with open(path, "w") as file:
        file.write(",".join(names) + "\n")
        for row, (t, *_) in enumerate(longest):
            values = [value for curve in curves.values() for value in curve[min(row, len(curve) - 1)][1:]]
            file.write(",".join([f"{t:.6g}", *(f"{value:.6g}" for value in values)]) + "\n")


def refuse(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """End with a message and exit code 2 if a value has no meaning or a result could not be written."""
    for key in ("viscosity", "capillary"):
        wrong = [value for value in getattr(options, key) if not 0 < value < np.inf]
        if wrong:
            parser.error(f"--{key} {wrong[0]:g}: has to be above 0 and finite")
    if options.points % 2 or options.points < 8:
        parser.error(f"--points {options.points}: has to be even and at least 8")
    for key, least in (("half_height", 1.0), ("period", 2.0), ("end_time", 0.0)):
        if not least < getattr(options, key) < np.inf:
            parser.error(f"--{key.replace('_', '-')} {getattr(options, key):g}: has to be above {least:g} and finite")
    refuse_folders(parser, options.json, options.curve)


def refuse_folders(parser: argparse.ArgumentParser, *paths: str | None) -> None:
    """End with a message and exit code 2 if a result could not be written for want of its folder."""
    for path in paths:
        if path and not Path(path).absolute().parent.is_dir():
            parser.error(f"{path}: there is no such folder; make it first")


def main() -> None:
    """Print the steady deformation of each pair of viscosity ratio and capillary number."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--viscosity", type=float, nargs="+", default=[1.0], help="of the drop over that of the matrix")
    parser.add_argument("--capillary", type=float, nargs="+", default=[0.1], help="viscosity x shear rate x R/tension")
    parser.add_argument("--points", type=int, default=128, help="on the interface, even")
    parser.add_argument("--half-height", type=float, default=4.0, help="distance of each wall from the middle [R], above 1")
    parser.add_argument("--period", type=float, default=8.0, help="length of the box [R]")
    parser.add_argument("--end-time", type=float, default=100.0, help="times the shear rate, without a steady state")
    parser.add_argument("--json", metavar="FILE", help="the table, a list of one object per pair")
    parser.add_argument("--curve", metavar="FILE", help="D and angle over time as comma-separated values")
    options = parser.parse_args()
    refuse(parser, options)
    rows, curves = [], {}
    print("| viscosity | Ca | D | angle [degrees] | t | speed left | small, without walls |\n" + "|---" * 7 + "|")
    for ratio in options.viscosity:
        for capillary in options.capillary:
            drop = Drop(ratio, 1 / capillary, Channel(options.half_height, options.period))
            curve = []
            for t, interface, speed in drop.run(options.points, options.end_time):  # noqa: B007
                curve.append((t, *interface.shape()))
            t, deformation, angle = curve[-1]
            state = f"{deformation:.5f} | {angle:.3f} | {t:.2f} | {speed:.1e}"
            small = "{:.5f}, {:.2f}".format(*unbounded(ratio, capillary))
            print(f"| {ratio:g} | {capillary:g} | {state} | {small} |", flush=True)
            curves[f"_lambda{ratio:g}_Ca{capillary:g}"] = curve
            row = {"viscosity": ratio, "capillary": capillary, "deformation": deformation, "angle": angle, "time": t}
            rows.append(row | {"speed_left": speed})
    if options.json:
        with open(options.json, "w") as file:
            json.dump(rows, file, indent=1)
    if options.curve:
        write_curves(options.curve, curves)


if __name__ == "__main__":
    main()
