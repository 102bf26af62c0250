#!/usr/bin/env python3
"""Exact solutions of an ideal gas: any Riemann problem.

`Riemann` is the exact solver of Toro (2009), chapter 4, with its pressure found by bracketing; that of
kernels/gas/riemann_states.py finds its own by Newton's method and is tested against this one.
"""

from __future__ import annotations

import dataclasses
import math

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
