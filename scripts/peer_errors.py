"""Errors by which runs of different programs are compared: one definition a scene, from particles alone.

They need arrays of NumPy and nothing of the program that made them, so that the particles of any code can be measured:

    taylor_green_l1, taylor_green_l2   speed, and velocity as a vector, of decaying vortices in a periodic unit square
    elliptic_drop                      tip of a drop that a pure strain draws out
    poiseuille                         velocity across a channel that starts from rest
    sod                                density of Sod's shock tube
    laplace_jump                       pressure jump of a round drop

Each is taken where the particles are at that time, and 0 for a field that is exact there.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))  # not there where Python runs with -P, or a test loads this file
from exact_gas import Gas, Riemann  # noqa: E402

SERIES = 200  # terms: the last is 2.5e-3^3 of the first, and still less at any time after the start


def taylor_green(position: np.ndarray, time: float, reynolds: float) -> np.ndarray:
    """Velocity (n, 2) of the decaying vortices at `position` (n, 2), in speeds and lengths of the box.

    u = -e^(bt) cos 2 pi x sin 2 pi y, v = e^(bt) sin 2 pi x cos 2 pi y with b = -8 pi^2/Re, which solves Navier-Stokes.
    """
    x, y = 2.0 * math.pi * np.asarray(position, dtype=float).T
    decay = math.exp(-8.0 * math.pi**2 * time / reynolds)
    return decay * np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], axis=1)


def taylor_green_l1(position: np.ndarray, velocity: np.ndarray, time: float, reynolds: float) -> float:
    """Mean of ||v| - |v_exact|| over the mean of |v_exact|; the direction of the velocity does not count.

    position, velocity: (n, 2), in lengths and speeds of the box
    """
    exact = np.linalg.norm(taylor_green(position, time, reynolds), axis=1)
    return float(np.abs(np.linalg.norm(velocity, axis=1) - exact).mean() / exact.mean())


def taylor_green_l2(position: np.ndarray, velocity: np.ndarray, time: float, reynolds: float) -> float:
    """Root of sum |v - v_exact|^2 over sum |v_exact|^2, of the velocity as a vector; arguments as of `taylor_green_l1`."""
    return relative_l2(velocity, taylor_green(position, time, reynolds))


def relative_l2(values: np.ndarray, exact: np.ndarray) -> float:
    """Root of the sum of squares of the difference over that of the exact values, arrays of one shape."""
    return float(np.linalg.norm(np.asarray(values, dtype=float) - exact) / np.linalg.norm(exact))


def stretched(time: float, rate: float = 100.0, steps: int = 2000) -> float:
    """Longer semi-axis over the radius R of a drop of ideal fluid that begins with u = (-rate x, rate y) [1/s] at time 0.

    An ellipse of semi-axes R e^-s and R e^s has the velocity s' (-x, y) and the kinetic energy rho pi R^4 s'^2 cosh(2 s)/4.
    Nothing takes it, so s' = rate/sqrt(cosh(2 s)) (Monaghan 1994 writes the same as two equations); four-stage Runge-Kutta.
    """

    def slope(s: float) -> float:
        return rate / math.sqrt(math.cosh(2.0 * s))

    s, step = 0.0, time / steps
    for _ in range(steps):
        first = slope(s)
        second = slope(s + 0.5 * step * first)
        third = slope(s + 0.5 * step * second)
        s += step * (first + 2.0 * second + 2.0 * third + slope(s + step * third)) / 6.0
    return math.exp(s)


def elliptic_drop(position: np.ndarray, time: float, beyond: float = 0.0, radius: float = 1.0, rate: float = 100.0) -> float:
    """Tip of the drop along y against the exact one, relative and signed: below 0 it is too short.

    position: (n, 2) of the particles of the drop, its centre at 0 [m]
    beyond: how far the surface was from the centre of the topmost particle at the start [m]; 0 where that lay on it
    """
    return float((np.max(np.asarray(position)[:, 1]) + beyond) / (radius * stretched(time, rate)) - 1.0)


def poiseuille_profile(y: np.ndarray, time: float, force: float, viscosity: float, height: float) -> np.ndarray:
    """Velocity (n,) [m/s] at the distances y (n,) from one wall, of a channel at rest at time 0 (Morris, Fox and Zhu 1997).

    force: acceleration along the channel [m/s^2]; viscosity: kinematic [m^2/s]; height: between the walls [m]
    """
    y = np.asarray(y, dtype=float)
    odd = 2.0 * np.arange(SERIES)[:, None] + 1.0
    waves = np.sin(odd * math.pi * y / height) * np.exp(-((odd * math.pi / height) ** 2) * viscosity * time) / odd**3
    steady = force / (2.0 * viscosity) * y * (height - y)
    return np.asarray(steady - 4.0 * force * height**2 / (viscosity * math.pi**3) * waves.sum(axis=0))


def poiseuille(y: np.ndarray, velocity: np.ndarray, time: float, force: float, viscosity: float, height: float) -> float:
    """Relative L2 error of the velocity along the channel, (n,) [m/s], at y (n,) [m]; else as `poiseuille_profile`."""
    return relative_l2(velocity, poiseuille_profile(y, time, force, viscosity, height))


def sod(x: np.ndarray, density: np.ndarray, volume: np.ndarray, time: float) -> float:
    """Sum of V |rho - rho_exact| over the sum of V: states (1, 0, 1) and (0.125, 0, 0.1) of gamma 1.4 that touched at x = 0.

    x, density, volume: (n,), of the particles at a time above 0
    """
    exact = Riemann(Gas(1.0, 0.0, 1.0), Gas(0.125, 0.0, 0.1)).at(x, time)[0]
    return float(np.sum(volume * np.abs(density - exact)) / np.sum(volume))


def laplace_jump(position: np.ndarray, pressure: np.ndarray, centre: np.ndarray, radius: float, tension: float) -> float:
    """Pressure jump of a round drop in 2-D against tension/radius, relative and signed.

    The jump is the mean pressure of particles nearer to the centre than half the radius, less that of those farther than
    1.7 radii: both stay clear of the layer in which a smeared surface tension acts.

    position: (n, 2) [m]; pressure: (n,) [Pa]; centre: (2,) [m]; radius: of the circle of the same area [m]; tension: [N/m]

    Raises ValueError if no particle lies in one of both regions.
    """
    distance = np.linalg.norm(np.asarray(position, dtype=float) - centre, axis=1)
    inside, outside = distance < 0.5 * radius, distance > 1.7 * radius
    if not (inside.any() and outside.any()):
        raise ValueError(f"no particle within {0.5 * radius:g} m of the centre, or none beyond {1.7 * radius:g} m")
    return float((pressure[inside].mean() - pressure[outside].mean()) * radius / tension - 1.0)
