"""Time, step length, flags and faults of a run: one clock on the device, which all levels share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from warpsph.engine.launch import Launcher
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.spec import Spec, types_of


class DeviceClock:
    """The arrays that `kernels/core/clock.py` describes, and the maxima and faults that sweeps report to them.

    Args:
        spec: structure of the run.
        launcher: launches kernels; each of its threads has maxima and a fault of its own.
        clock: float64 (CLOCK_SIZE,) start values.
        counters: int32 (COUNTERS_SIZE,) start values.
    """

    def __init__(self, spec: Spec, launcher: Launcher, clock: np.ndarray, counters: np.ndarray) -> None:
        device = launcher.device
        self.clock: Any = wp.array(clock, dtype=wp.float64, device=device)
        self.counters: Any = wp.array(counters, dtype=int, device=device)
        self.maxima: Any = wp.zeros(ck.MAXIMA * launcher.threads, dtype=types_of(spec).real, device=device)
        self.faults: Any = wp.full(launcher.threads, ck.NO_PARTICLE, dtype=int, device=device)
        self._views = (self.clock.numpy(), self.counters.numpy()) if launcher.is_cpu else None

    def arrays(self) -> dict[str, Any]:
        """Return the arrays by kernel argument name."""
        return {"clock": self.clock, "counters": self.counters, "maxima": self.maxima, "faults": self.faults}

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (clock, counters); on a CPU device these are live views, on CUDA host copies."""
        if self._views is not None:
            return self._views
        return self.clock.numpy(), self.counters.numpy()

    def write(self, clock: Mapping[int, float] | None = None, counters: Mapping[int, int] | None = None) -> None:
        """Set entries of clock and counters."""
        for array, entries in ((self.clock, clock), (self.counters, counters)):
            if entries:
                host = array.numpy()
                if self._views is None:
                    host = host.copy()
                for index, value in entries.items():
                    host[index] = value
                if self._views is None:
                    array.assign(host)

    def flag(self, index: int) -> Any:
        """Return the array of one counter, for a condition of a captured graph."""
        return self.counters[index : index + 1]
