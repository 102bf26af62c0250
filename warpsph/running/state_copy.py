"""Copies of the state on the host: raw fields, quickly, while the run waits; a Snapshot of them when there is time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.fields import FLUID as IN_FLUID
from warpsph.running.exponents import find_exponents
from warpsph.running.flow_fields import DERIVED
from warpsph.snapshot import FLUID, LYAPUNOV_FIELDS, OPTIONAL_FIELDS, WALL, Snapshot

if TYPE_CHECKING:
    from warpsph.running.model import Model

# field of a snapshot -> fields of the device that it is made of, of those that the scene has
SOURCES = {
    "position": ("anchor", "offset"),
    "velocity": ("velocity", "acceleration"),
    "acceleration": ("acceleration",),
    "density": ("density_excess",),
    "pressure": ("state",),
    "mass": ("rest_volume",),
    "volume": ("rest_volume", "density_excess"),
    "particle_id": ("particle_id",),
    "normal": ("normal",),
    "curvature": ("curvature",),
    "vorticity": ("vorticity",),
    "q_criterion": ("q_criterion",),
    **{name: (name,) for name in LYAPUNOV_FIELDS},
}
EVERYTHING = frozenset(SOURCES) - {*DERIVED}


@dataclass(frozen=True)
class StateCopy:
    """Raw fields of the particles at one moment.

    wanted: fields of the snapshot that are to be made of it
    arrays: by name on the device; fluid rows first, then walls
    fluid_count, wall_count: rows
    time, dt: s; step: number of steps done
    """

    model: Model
    wanted: frozenset[str]
    arrays: dict[str, np.ndarray]
    fluid_count: int
    wall_count: int
    time: float
    dt: float
    step: int

    def snapshot(self, ordered: bool = True) -> Snapshot:
        """Make a snapshot; a field that was not wanted holds nan, or None where a scene may lack it.

        ordered: sort the rows by particle id, which must be among the fields
        """
        model, spec = self.model, self.model.physics.spec
        nf, n = self.fluid_count, self.fluid_count + self.wall_count
        made: dict[str, Any] = {name: self._make(name) for name in self.wanted}
        for name in EVERYTHING - self.wanted - {*OPTIONAL_FIELDS}:
            shape = (n, spec.dimension) if name in ("position", "velocity") else n
            made[name] = np.broadcast_to(np.int64(-1) if name == "particle_id" else np.float64(np.nan), shape)
        kind = np.full(n, WALL, dtype=np.uint8)
        kind[:nf] = FLUID
        result = Snapshot(
            time=self.time,
            step=self.step,
            dt=self.dt,
            dimension=spec.dimension,
            phase=self._phase(),
            kind=kind,
            particle_spacing=model.case.spacing,
            own=self._own(),
            **made,
        )
        if "alive" in self.arrays:
            there = np.ones(n, dtype=np.bool_)
            there[:nf] = self.arrays["alive"] > 0
            if "zone" in self.arrays:  # the buffers of open sides are no part of the scene
                there[:nf] &= self.arrays["zone"] == IN_FLUID
            result = result.select(there)
        return result.select(np.argsort(result.particle_id, kind="stable")) if ordered else result

    def _own(self) -> dict[str, np.ndarray]:
        """Fields that the scheme shows, NaN for walls."""
        shown = [name for name in self.model.scheme.shown if name in self.arrays]
        return {name: self._fluid_and_walls(self.arrays[name], np.nan) for name in shown}

    def _phase(self) -> np.ndarray:
        phase = np.full(self.fluid_count + self.wall_count, -1, dtype=np.int32)
        phase[: self.fluid_count] = self.arrays["phase"] if "phase" in self.arrays else 0
        return phase

    def _rest_density(self) -> np.ndarray:
        """(fluid,) rho0 of each fluid particle."""
        case = self.model.case
        rho0 = np.array([case.phases[name].density for name in case.phase_names])
        return np.asarray(rho0[self._phase()[: self.fluid_count]])

    def _density(self) -> np.ndarray:
        """(fluid,) rho of each fluid particle."""
        rest = self._rest_density()
        if "density_excess" not in self.arrays:
            return rest
        return np.asarray(rest * (1.0 + self.arrays["density_excess"].astype(np.float64)))

    def _make(self, name: str) -> np.ndarray | None:
        """A field of the snapshot, rows in the order of the device."""
        model, case, spec = self.model, self.model.case, self.model.physics.spec
        arrays, nf, n = self.arrays, self.fluid_count, self.fluid_count + self.wall_count
        wall_density = float(case.phases[case.phase_names[0]].density)
        wall_volume = self.model.geometry.lattice.cell_volume
        if name in OPTIONAL_FIELDS and any(source not in arrays for source in SOURCES[name]):
            return None
        if name == "particle_id":
            return arrays["particle_id"].astype(np.int64)
        if name == "pressure":
            return arrays["state"][:, 0].astype(np.float64) if "state" in arrays else np.zeros(n)
        if name == "density":
            return self._fluid_and_walls(self._density(), wall_density)
        if name == "mass":
            return self._fluid_and_walls(self._rest_density() * arrays["rest_volume"], wall_density * wall_volume)
        if name == "volume":
            return self._fluid_and_walls(self._rest_density() * arrays["rest_volume"] / self._density(), wall_volume)
        if name == "curvature" and spec.triple:
            own = arrays["curvature"][np.arange(nf), arrays["phase"]]
            return self._fluid_and_walls(own, 0.0)
        if name in ("curvature", "q_criterion", "vorticity", *LYAPUNOV_FIELDS) and arrays[name].ndim == 1:
            return self._fluid_and_walls(arrays[name], 0.0)
        source = "anchor" if name == "position" else name
        result = np.zeros((n, 3 if name == "vorticity" else spec.dimension))
        result[: len(arrays[source])] = arrays[source]
        if name == "position":
            result[:nf] += arrays["offset"]
            if spec.moving:
                result[nf:] = arrays["position"][nf:]
        if name == "velocity" and model.scheme.staggered(spec):
            result[:nf] += 0.5 * self.dt * arrays["acceleration"].astype(np.float64)
        return result

    def _fluid_and_walls(self, fluid: np.ndarray, wall: float) -> np.ndarray:
        result = np.full(self.fluid_count + self.wall_count, wall)
        result[: self.fluid_count] = fluid
        return result


def copy_state(model: Model, wanted: Iterable[str] = EVERYTHING, rows: np.ndarray | None = None) -> StateCopy:
    """Copy what some fields of a snapshot are made of to the host.

    wanted: names of SOURCES; of none the copy has no particles
    rows: of the fluid particles to copy, without walls; all of both by default
    """
    wanted, particles, spec = frozenset(wanted), model.particles, model.physics.spec
    clock, counters = model.stepper.read()
    numbers: dict[str, Any] = {"time": float(clock[ck.TIME]), "dt": float(clock[ck.LAST_STEP])}
    numbers["step"] = int(counters[ck.STEPS])
    if not wanted:
        return StateCopy(model, wanted, {}, 0, 0, **numbers)
    names = {source for name in wanted for source in SOURCES[name]}
    if spec.tension == "none":
        names -= {"normal", "curvature"}
    lyapunov = model.case.output.lyapunov
    asked = () if lyapunov is None else lyapunov.fields
    names -= {*LYAPUNOV_FIELDS} - {*asked}
    if names & {*LYAPUNOV_FIELDS}:
        find_exponents(model)
    names |= {"phase", "alive", "zone", *model.scheme.shown}
    if spec.moving and "position" in wanted:
        names |= {"position"}
    present = sorted(names & particles.arrays.keys())
    derived = model.flow_fields() if names & {*DERIVED} else {}
    if rows is not None:
        chosen: Any = wp.array(rows, dtype=int, device=model.device)
        found = {name: particles.arrays[name] for name in present} | derived
        arrays = {name: _rows_of(array, rows, chosen) for name, array in found.items()}
        return StateCopy(model, wanted, arrays, len(rows), 0, **numbers)
    arrays = {name: particles.get(name) for name in present}
    arrays |= {name: np.array(array.numpy()[: particles.fluid_count]) for name, array in derived.items()}
    return StateCopy(model, wanted, arrays, particles.fluid_count, particles.wall_count, **numbers)


def _rows_of(array: Any, rows: np.ndarray, chosen: Any) -> np.ndarray:
    """Rows of a field as a host copy; `chosen` holds them on the device."""
    if array.device.is_cpu:
        return np.asarray(array.numpy()[rows])
    return np.asarray(wp.indexedarray(array, [chosen]).numpy()) if len(rows) else array[:0].numpy()
