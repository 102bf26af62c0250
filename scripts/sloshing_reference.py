#!/usr/bin/env python3
"""Linear theory of sloshing in a tank that is shaken from rest: the curves of `cases/sloshing.yaml`.

    python scripts/sloshing_reference.py > cases/reference/n_sloshing_linear.csv

Seen from the tank the shaking is a body force f = a sin(w t) along x. With k_n = n pi/L, w_n^2 = g k_n tanh(k_n H), n odd,
and x - L/2 = sum b_n cos(k_n x), b_n = -4/(L k_n^2), the surface is eta = sum a_n(t) cos(k_n x) with

    a_n'' + 4 nu k_n^2 a_n' + w_n^2 a_n = (b_n w_n^2/g) f,    a_n(0) = a_n'(0) = 0

(Faltinsen 1978; friction as that of a potential flow, amplitude exp(-2 nu k^2 t)), and the centre of mass is off the middle
by sum a_n b_n/(2 H).
"""

from __future__ import annotations

import numpy as np

LENGTH, DEPTH, GRAVITY = 1.0, 0.5, 9.81  # m, m, m/s^2
FORCE, FREQUENCY = 0.2, 4.0  # m/s^2, rad/s
MODES = 4001


def amplitudes(time: np.ndarray, viscosity: float) -> tuple[np.ndarray, np.ndarray]:
    """Return b_n [1] (modes,) and a_n [m] (modes, times); viscosity: kinematic, m^2/s."""
    k = np.arange(1, MODES, 2) * np.pi / LENGTH
    square = GRAVITY * k * np.tanh(k * DEPTH)
    b = -4.0 / (LENGTH * k**2)
    damping = 2.0 * viscosity * k**2
    forced = FORCE * b * square / GRAVITY / (square - FREQUENCY**2 + 2j * damping * FREQUENCY)
    root = np.sqrt(damping**2 - square + 0j)
    slow, fast = -square / (damping + root), -(damping + root)  # of the free motion; their product is w_n^2
    first = (-FREQUENCY * forced.real + fast * forced.imag) / (slow - fast)
    second = -forced.imag - first
    free = first[:, None] * np.exp(slow[:, None] * time) + second[:, None] * np.exp(fast[:, None] * time)
    return b, (forced[:, None] * np.exp(1j * FREQUENCY * time)).imag + free.real


def main() -> None:
    """Print the table."""
    time = np.arange(0.0, 4.0 + 1e-9, 0.02)
    b, damped = amplitudes(time, 0.005)
    _, ideal = amplitudes(time, 0.0)
    columns = time, damped.sum(axis=0), ideal.sum(axis=0), b @ damped / (2.0 * DEPTH)
    print("t_s,eta_m,eta_inviscid_m,centroid_m")
    for row in zip(*columns, strict=True):
        print(f"{row[0]:.2f}," + ",".join(f"{value:.7g}" for value in row[1:]))


if __name__ == "__main__":
    main()
