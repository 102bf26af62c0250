"""The wave in the rows of a column: its frequency, its height, and what it leaves over.

A wave is a mean with a sine and up to two overtones, y = a_0 + sum_k (a_k cos 2 pi k f t + b_k sin 2 pi k f t), k = 1 ... 3,
which is enough for lift and drag of a body that sheds vortices. All of its numbers come from one fit by least squares, so
that sound and noise of the rows move them by their share over the root of the number of rows; crossings and extremes would
follow single rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from warpsph.study.norms import NotComparable

OVERTONES = 3
"""Sines of a wave, the first included."""
ROWS_A_CYCLE = 4
"""Rows that a cycle of the highest sine needs: with two its sine and its cosine could be the same."""
OF_WAVES = ("frequency", "amplitude", "strouhal")
"""Ways of reducing a column to a number of its wave."""


@dataclass(frozen=True)
class Wave:
    """The wave of a column.

    frequency: 1/s
    mean, amplitude: in the unit of the column; the latter is half of the way from the lowest to the highest point
    left: root mean square of what the wave leaves of the rows, over the amplitude
    cycles: how many the rows cover
    """

    frequency: float
    mean: float
    amplitude: float
    left: float
    cycles: float

    def __str__(self) -> str:
        """How good a wave it is, for a note."""
        return f"{self.cycles:.1f} cycles, deviations from the wave {100 * self.left:.2g} % of its amplitude"


def of_wave(reduce: str, times: np.ndarray, values: np.ndarray, unit: str, gauge: Any) -> tuple[float, str, str]:
    """Return a number of the wave in the rows of a window, one of OF_WAVES, its unit and a note.

    gauge: of the case, whose length and speed make a frequency a Strouhal number, f length/speed

    Raises NotComparable, see `wave`.
    """
    found = wave(times, values)
    if reduce == "amplitude":
        return found.amplitude, unit, str(found)
    if reduce == "strouhal":
        return found.frequency * gauge.length / gauge.speed, "1", str(found)
    return found.frequency, "1/s", str(found)


def wave(times: np.ndarray, values: np.ndarray) -> Wave:
    """Return the wave that fits the rows of a window best.

    times, values: (n,), s, rising, and the unit of the column

    Raises NotComparable if there are fewer than two cycles, no wave in the rows (it has less of their variance than what is
    left), or values that are not finite.
    """
    if len(times) < 2 * ROWS_A_CYCLE or not np.isfinite(values).all():
        raise NotComparable("a wave needs eight rows with numbers in the window")
    span = float(times[-1] - times[0])
    spread = float(np.std(values))
    if spread <= 1e-12 * float(np.abs(values).max()):
        raise NotComparable("the column does not change in the window")
    frequency = _refined(times, values, _strongest(times, values), 0.5 / span, 1)
    sines = max(1, min(OVERTONES, int(len(times) / (ROWS_A_CYCLE * frequency * span))))
    frequency = _refined(times, values, frequency, 0.25 / span, sines)
    cycles = frequency * span
    if cycles < 2:
        raise NotComparable(f"fewer than two cycles in the window, {cycles:.2g}")
    coefficients, left = _fit(times, values, frequency, sines)
    if left**2 > 0.5 * spread**2:
        raise NotComparable("no wave in the window: the best one has less of the variance than what is left")
    phases = np.linspace(0.0, 1.0, 720, endpoint=False)
    heights = _terms(phases, 1.0, sines)[:, 1:] @ coefficients[1:]
    amplitude = 0.5 * float(np.ptp(heights))
    return Wave(frequency, float(coefficients[0]), amplitude, left / amplitude, cycles)


def _strongest(times: np.ndarray, values: np.ndarray) -> float:
    """Return the frequency at which the spectrum of the rows is highest [1/s], to a quarter of the inverse of their span."""
    count = len(times)
    even = np.linspace(times[0], times[-1], count)
    level = np.interp(even, times, values)
    level = (level - level.mean()) * np.hanning(count)
    padded = 4 * count
    spectrum = np.abs(np.fft.rfft(level, padded))
    frequencies = np.fft.rfftfreq(padded, even[1] - even[0])
    # below, the window of Hann cannot tell a wave from a drift
    spectrum[frequencies < 1.5 / (times[-1] - times[0])] = 0.0
    return float(frequencies[np.argmax(spectrum)])


def _refined(times: np.ndarray, values: np.ndarray, frequency: float, reach: float, sines: int) -> float:
    """Return the frequency within `reach` of another at which the fit leaves least [1/s]."""
    from scipy.optimize import minimize_scalar

    ends = (max(frequency - reach, 0.1 * frequency), frequency + reach)
    found = minimize_scalar(
        lambda f: _fit(times, values, f, sines)[1], bounds=ends, method="bounded", options={"xatol": 1e-7 * frequency}
    )
    return float(found.x)


def _fit(times: np.ndarray, values: np.ndarray, frequency: float, sines: int) -> tuple[np.ndarray, float]:
    """Return the coefficients of the wave of a frequency, and the root mean square of what it leaves."""
    terms = _terms(times - times[0], frequency, sines)
    coefficients = np.linalg.lstsq(terms, values, rcond=None)[0]
    return coefficients, float(np.sqrt(np.mean((values - terms @ coefficients) ** 2)))


def _terms(times: np.ndarray, frequency: float, sines: int) -> np.ndarray:
    """Return the terms of the wave at some times, (n, 1 + 2 sines)."""
    angles = 2.0 * np.pi * frequency * np.outer(times, np.arange(1, sines + 1))
    return np.hstack([np.ones((len(times), 1)), np.cos(angles), np.sin(angles)])
