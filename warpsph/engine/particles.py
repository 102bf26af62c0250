"""The particles of a run on their device: one array per field of the table in `kernels/core/fields.py`."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from warpsph.kernels.core.fields import Field, fields_of
from warpsph.kernels.core.spec import Spec


class Particles:
    """Structure of arrays; fluid particles come first, wall particles after them.

    Args:
        spec: structure of the run; decides which fields exist.
        fluid_count: number of fluid particles.
        wall_count: number of wall particles.
        device: Warp device.

    Attributes:
        arrays: field name -> Warp array.
    """

    def __init__(self, spec: Spec, fluid_count: int, wall_count: int, device: Any) -> None:
        self.spec = spec
        self.fluid_count = fluid_count
        self.wall_count = wall_count
        self.count = fluid_count + wall_count
        self.device = device
        self.fields: dict[str, Field] = {field.name: field for field in fields_of(spec)}
        self.arrays: dict[str, Any] = {
            field.name: wp.zeros(self.rows(field), dtype=field.dtype(spec), device=device)
            for field in self.fields.values()
        }

    def rows(self, field: Field) -> int:
        """Return the number of rows of a field."""
        return {"fluid": self.fluid_count, "wall": self.wall_count, "all": self.count}[field.rows]

    def put(self, name: str, values: np.ndarray) -> None:
        """Copy host values of shape (rows, ...) into a field; raises ValueError on a wrong shape."""
        array = self.arrays[name]
        if not array.size:
            return
        expected = (array.shape[0], *getattr(array.dtype, "_shape_", ()))
        kind = wp.dtype_to_numpy(getattr(array.dtype, "_wp_scalar_type_", array.dtype))
        host = np.ascontiguousarray(values, dtype=kind)
        if host.shape != expected:
            raise ValueError(f"{name}: shape {host.shape}, expected {expected}")
        array.assign(host)

    def get(self, name: str) -> np.ndarray:
        """Return a host copy of a field, in the current order of the particles."""
        host = self.arrays[name].numpy()
        return np.array(host) if self.arrays[name].device.is_cpu else host  # on a CPU it is the field itself

    def kept(self) -> dict[str, np.ndarray]:
        """Return host copies of the fields that make up the state between two steps."""
        return {name: self.get(name) for name, field in self.fields.items() if field.kept}

    def memory(self) -> int:
        """Return the bytes of all fields."""
        return sum(int(array.capacity) for array in self.arrays.values())
