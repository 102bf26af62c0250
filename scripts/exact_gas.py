#!/usr/bin/env python3
"""Exact solutions of an ideal gas: any Riemann problem, the blast of Sedov, the implosion of Noh.

    python scripts/exact_gas.py riemann 1 0 1 0.125 0 0.1                # star state; formulas in x and t for a case file
    python scripts/exact_gas.py sedov 2 > cases/reference/h_sedov_2d.csv # profiles behind the shock; coefficients on stderr

`Riemann` is the exact solver of Toro (2009), chapter 4, with its pressure found by bracketing; that of
kernels/gas/riemann_states.py finds its own by Newton's method and is tested against this one.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys

import numpy as np


@dataclasses.dataclass(frozen=True)
class Gas:
    """A uniform state: density [kg/m^3], velocity [m/s], pressure [Pa]."""

    density: float
    velocity: float
    pressure: float

    def sound(self, gamma: float) -> float:
        """Return its speed of sound [m/s]."""
        return math.sqrt(gamma * self.pressure / self.density)


@dataclasses.dataclass(frozen=True)
class Star:
    """What lies between the waves: pressure [Pa] and velocity [m/s], and the densities on both sides of the contact."""

    pressure: float
    velocity: float
    left: float
    right: float


CENTRE = -8.0  # ln of r/R down to which the blast is integrated; within, the pressure is uniform and the gas nearly none


class Riemann:
    """The Riemann problem of two states of an ideal gas that touch at x = 0 from t = 0 on."""

    def __init__(self, left: Gas, right: Gas, gamma: float = 1.4) -> None:
        """Solve it; gamma > 1 is the ratio of heats."""
        self.left, self.right, self.gamma = left, right, gamma
        self.star = self._star()

    def _wave(self, side: Gas, pressure: float) -> float:
        """Return by how much the wave to a pressure changes the velocity of a side, away from the contact [m/s]."""
        g = self.gamma
        if pressure > side.pressure:
            fall = (pressure + (g - 1) / (g + 1) * side.pressure) * (g + 1) / 2 * side.density
            return (pressure - side.pressure) / math.sqrt(fall)
        if side.pressure == 0.0:
            return 0.0
        return 2 * side.sound(g) / (g - 1) * ((pressure / side.pressure) ** ((g - 1) / (2 * g)) - 1)

    def _behind(self, side: Gas, pressure: float) -> float:
        """Return the density of a side behind its wave [kg/m^3]."""
        g = self.gamma
        if pressure <= side.pressure:
            return side.density * (pressure / side.pressure) ** (1 / g) if side.pressure > 0.0 else 0.0
        slope = (g - 1) / (g + 1)
        return side.density * (pressure + slope * side.pressure) / (slope * pressure + side.pressure)

    def _star(self) -> Star:
        """Return the state between the waves; in a vacuum pressure and densities are 0."""
        from scipy.optimize import brentq

        left, right, g = self.left, self.right, self.gamma
        parting = right.velocity - left.velocity

        def rest(pressure: float) -> float:
            return self._wave(left, pressure) + self._wave(right, pressure) + parting

        if rest(0.0) >= 0.0:
            edges = left.velocity + 2 * left.sound(g) / (g - 1), right.velocity - 2 * right.sound(g) / (g - 1)
            return Star(0.0, 0.5 * sum(edges), 0.0, 0.0)
        high = max(left.pressure, right.pressure, 1e-300)
        while rest(high) < 0.0:
            high *= 4.0
        # in the logarithm, so that a pressure that is nearly nothing is as exact as one that is not
        low = high
        while rest(low) > 0.0:
            low *= 0.25
        pressure = high
        if low < high:
            pressure = math.exp(brentq(lambda s: rest(math.exp(s)), math.log(low), math.log(high), xtol=1e-15, rtol=1e-15))
        velocity = 0.5 * (left.velocity + right.velocity + self._wave(right, pressure) - self._wave(left, pressure))
        return Star(pressure, velocity, self._behind(left, pressure), self._behind(right, pressure))

    def _side(self, side: Gas, density: float, speed: np.ndarray, sign: float) -> np.ndarray:
        """Return (density, velocity, pressure) of one side at velocities x/t [m/s], seen along sign: (3, n)."""
        g, star = self.gamma, self.star
        c, u = side.sound(g), sign * side.velocity
        s = sign * speed
        outer = np.array([side.density, u, side.pressure])[:, None]
        inner = np.array([density, sign * star.velocity, star.pressure])[:, None]
        if star.pressure > side.pressure:
            flux = math.sqrt(side.density * ((g + 1) / 2 * star.pressure + (g - 1) / 2 * side.pressure))
            result = np.where(s > u + flux / side.density, outer, inner)
        else:
            # u = 2/(g+1) (-c + (g-1)/2 u0 + s) and c = s - u in the fan of a wave that goes along sign
            inside = 2 / (g + 1) * (-c + (g - 1) / 2 * u + s)
            ratio = np.maximum(s - inside, 0.0) / c if c > 0.0 else np.zeros_like(s)
            rho = side.density * ratio ** (2 / (g - 1))
            fan = np.array([rho, inside, side.pressure * ratio ** (2 * g / (g - 1))])
            tail = sign * star.velocity + (math.sqrt(g * star.pressure / density) if density > 0.0 else 0.0)
            if star.pressure == 0.0:
                tail = u - 2 * c / (g - 1)
            result = np.where(s > u + c, outer, np.where(s > tail, fan, inner))
        result[1] *= sign
        return result

    def at(self, position: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return density, velocity and pressure at positions [m] and a time > 0 [s], arrays shaped as the positions."""
        speed = np.ravel(np.asarray(position, float)) / time
        left = self._side(self.left, self.star.left, speed, -1.0)
        right = self._side(self.right, self.star.right, speed, 1.0)
        rho, u, p = np.where(speed < self.star.velocity, left, right)
        shape = np.shape(position)
        return rho.reshape(shape), u.reshape(shape), p.reshape(shape)

    def _pieces(self, side: Gas, density: float, sign: int) -> tuple[list[float], list[tuple[str, str, str]]]:
        """Return edges x/t [m/s] and the formulas between them of one side, from far away to the contact."""
        g, star, c, u = self.gamma, self.star, side.sound(self.gamma), side.velocity
        outer, inner = (
            (f"{rho:.10g}", f"{speed:.10g}", f"{p:.10g}")
            for rho, speed, p in ((side.density, u, side.pressure), (density, star.velocity, star.pressure))
        )
        if star.pressure > side.pressure:
            flux = math.sqrt(side.density * ((g + 1) / 2 * star.pressure + (g - 1) / 2 * side.pressure))
            return [u + sign * flux / side.density], [outer, inner]
        ratio = f"({2 / (g + 1) - sign * (g - 1) / (g + 1) * u / c:.10g}{sign * (g - 1) / (g + 1) / c:+.10g}*x/t)"
        fan = (
            f"{side.density:.10g}*{ratio}**{2 / (g - 1):.10g}",
            f"{(g - 1) / (g + 1) * u - sign * 2 / (g + 1) * c:.10g}+{2 / (g + 1):.10g}*x/t",
            f"{side.pressure:.10g}*{ratio}**{2 * g / (g - 1):.10g}",
        )
        tail = star.velocity + sign * math.sqrt(g * star.pressure / density) if density else u - sign * 2 * c / (g - 1)
        return [u + sign * c, tail], [outer, fan, inner]

    def formulas(self) -> dict[str, str]:
        """Return density, velocity and pressure as formulas in x and t, as `exact` of a case file takes them."""
        edges, parts = self._pieces(self.left, self.star.left, -1)
        right_edges, right_parts = self._pieces(self.right, self.star.right, 1)
        edges += [self.star.velocity, *right_edges[::-1]]
        parts += right_parts[::-1]
        texts = {}
        for column, name in enumerate(("density", "velocity", "pressure")):
            text = beyond = parts[-1][column]
            for edge, part in zip(edges[::-1], parts[-2::-1], strict=True):
                if part[column] != beyond:
                    text, beyond = f"where(x < {edge:.10g}*t, {part[column]}, {text})", part[column]
            texts[name] = text
        return texts


def surface(dimension: int) -> float:
    """Return the surface of the unit sphere: 2, 2 pi, 4 pi."""
    return (2.0, 2.0 * math.pi, 4.0 * math.pi)[dimension - 1]


class Sedov:
    """A point (line, plane) of energy in a uniform cold gas: the similarity solution of Sedov (1959).

    With x = r/R, u = R' V(x), rho = rho_0 G(x), p = rho_0 R'^2 P(x) and R R''/R'^2 = -d/2 the equations of Euler become
    ordinary ones, integrated from the strong shock at x = 1 inwards in ln x.
    """

    def __init__(self, dimension: int, gamma: float = 1.4, energy: float = 1.0, density: float = 1.0) -> None:
        """Integrate it. energy: J (2-D: J/m, 1-D: J/m^2); density: of the gas at rest, kg/m^3."""
        from scipy.integrate import solve_ivp

        self.dimension, self.gamma, self.energy, self.density = dimension, gamma, energy, density
        start = [2 / (gamma + 1), math.log((gamma + 1) / (gamma - 1)), math.log(2 / (gamma + 1)), 0.0, 0.0]
        self._inside = solve_ivp(
            self._slopes, (0.0, CENTRE), start, method="DOP853", rtol=1e-12, atol=1e-14, dense_output=True
        ).sol
        last = self._inside(CENTRE)
        energy_integral, momentum_integral = -last[3:]
        energy_integral += math.exp(last[2] + dimension * CENTRE) / (dimension * (gamma - 1))
        self.coefficient = surface(dimension) * (2 / (dimension + 2)) ** 2 * energy_integral
        """a of E = a rho_0 R^(d+2)/t^2."""
        self.momentum_coefficient = surface(dimension) * 2 / (dimension + 2) * momentum_integral
        """b of the sum of m |v| = b rho_0 R^(d+1)/t."""

    def _slopes(self, log_x: float, state: np.ndarray) -> list[float]:
        """Return the derivatives by ln x of V/x, ln G, ln P and the integrals of energy and momentum."""
        d, g = self.dimension, self.gamma
        ratio, log_density, log_pressure = state[:3]
        x, rho, p = math.exp(log_x), math.exp(log_density), math.exp(log_pressure)
        v, w, square = ratio * x, (ratio - 1) * x, p / rho
        slope = (0.5 * d * v * w - square * (d - g * (d - 1) * ratio)) / (w * w - g * square)
        density = -(slope + (d - 1) * ratio) / (ratio - 1)
        pressure = d / (ratio - 1) + g * density
        shell = x**d
        return [slope - ratio, density, pressure, shell * (0.5 * rho * v * v + p / (g - 1)), shell * rho * v]

    def radius(self, time: float) -> float:
        """Return where the shock is [m] at a time [s]."""
        return (self.energy * time**2 / (self.coefficient * self.density)) ** (1 / (self.dimension + 2))

    def at(self, radius: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return density, velocity outwards and pressure at distances [m] and a time [s]."""
        front = self.radius(time)
        speed = 2 * front / ((self.dimension + 2) * time)
        x = np.asarray(radius, float) / front
        ratio, log_density, log_pressure = self._inside(np.log(np.clip(x, math.exp(CENTRE), 1.0)))[:3]
        inside = x <= 1.0
        rho = self.density * np.where(inside, np.exp(log_density), 1.0)
        u = np.where(inside, speed * ratio * x, 0.0)
        return rho, u, np.where(inside, self.density * speed**2 * np.exp(log_pressure), 0.0)


@dataclasses.dataclass(frozen=True)
class Noh:
    """Cold gas of density 1 that falls on a plane, line or point with speed 1 (Noh 1987)."""

    dimension: int
    gamma: float = 5 / 3

    def at(self, radius: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return density, velocity outwards and pressure at distances [m] > 0 and a time [s]."""
        g = self.gamma
        r = np.asarray(radius, float)
        inside = r < 0.5 * (g - 1) * time
        dense = ((g + 1) / (g - 1)) ** self.dimension
        rho = np.where(inside, dense, (1 + time / r) ** (self.dimension - 1))
        return rho, np.where(inside, 0.0, -1.0), np.where(inside, 0.5 * (g - 1) * dense, 0.0)


def print_riemann(numbers: list[float], gamma: float) -> None:
    """Print the star state of (rho, u, p) on the left and on the right, and the formulas."""
    problem = Riemann(Gas(*numbers[:3]), Gas(*numbers[3:]), gamma)
    for name, value in dataclasses.asdict(problem.star).items():
        print(f"{name:10s} {value:.10g}")
    for name, text in problem.formulas().items():
        print(f'{name:10s} "{text}"')


def print_sedov(dimension: int, gamma: float) -> None:
    """Print the table of a blast over r/R, its density over that at rest, velocity over R', pressure over rho_0 R'^2."""
    blast = Sedov(dimension, gamma)
    print(f"energy {blast.coefficient:.8g} momentum {blast.momentum_coefficient:.8g}", file=sys.stderr)
    time = 1.0
    front = blast.radius(time)
    speed = 2 * front / ((dimension + 2) * time)
    x = np.concatenate([np.linspace(0.0, 0.8, 41)[:-1], np.linspace(0.8, 1.0, 81), [1.0, 1.2]])
    where = x * front
    where[-2] *= 1 + 1e-9  # the same place, ahead of the shock
    rho, u, p = blast.at(where, time)
    print("r_over_R,density_over_rho0,velocity_over_shock_speed,pressure_over_rho0_shock_speed2")
    for row in zip(x, rho, u / speed, p / speed**2, strict=True):
        print(",".join(f"{value:.8g}" if abs(value) > 1e-12 else "0" for value in row))


def main() -> None:
    """Read the command line and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    kinds = parser.add_subparsers(dest="kind", required=True)
    riemann = kinds.add_parser("riemann", help="density, velocity and pressure on the left, then on the right")
    riemann.add_argument("numbers", type=float, nargs=6)
    sedov = kinds.add_parser("sedov", help="table of a blast")
    sedov.add_argument("dimension", type=int, choices=(1, 2, 3))
    for one in (riemann, sedov):
        one.add_argument("--gamma", type=float, default=1.4, help="ratio of heats (1.4)")
    options = parser.parse_args()
    if options.kind == "riemann":
        print_riemann(options.numbers, options.gamma)
    else:
        print_sedov(options.dimension, options.gamma)


if __name__ == "__main__":
    main()
