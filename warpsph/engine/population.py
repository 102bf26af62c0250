"""The particles of a level on their device: one array per declared field, with a capacity and a live count.

Kinds have places of their own: fluid in the rows 0 .. fluid_capacity - 1, the live ones first, walls after them. Where
particles are born and die, the live count is the device's (`counters[LIVE]`): a list build sorts those that died behind the
last one that lives, and stages of births write behind it. Elsewhere capacity and count are the same number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp

from warpsph.kernels.core.fields import Field
from warpsph.kernels.core.spec import Spec


class Population:
    """Structure of arrays.

    Args:
        spec: structure of the run; decides which fields exist.
        fields: all fields that the scheme declares.
        fluid_count: number of fluid particles at the start.
        wall_count: number of wall particles.
        device: Warp device.
        capacity: fluid particles that there is room for, where their number changes (default: `fluid_count`).

    Attributes:
        arrays: field name -> Warp array.
        fields: the fields that exist, by name.
        declared: names of all declared fields, those that this structure lacks too.
        changing: whether particles are born or die.
        live: returns the live count, where it changes.
        grown: how many times the arrays were replaced by larger ones.
    """

    def __init__(
        self,
        spec: Spec,
        fields: Sequence[Field],
        fluid_count: int,
        wall_count: int,
        device: Any,
        capacity: int | None = None,
    ) -> None:
        self.spec = spec
        self.changing = spec.changing
        self.live: Callable[[], int] | None = None
        self.grown = 0
        self._start_count = fluid_count
        self.fluid_capacity = max(fluid_count, capacity or 0) if self.changing else fluid_count
        self.wall_count = wall_count
        self.device = device
        self.declared = frozenset(field.name for field in fields)
        self.fields: dict[str, Field] = {field.name: field for field in fields if field.exists(spec)}
        self.arrays: dict[str, Any] = {name: self._allocate(field) for name, field in self.fields.items()}
        if self.changing:
            self.put("alive", np.ones(fluid_count))

    def _allocate(self, field: Field) -> Any:
        return wp.zeros(self.rows(field), dtype=field.dtype(self.spec), device=self.device)

    @property
    def capacity(self) -> int:
        """Rows of a field of all particles: room for fluid, and walls."""
        return self.fluid_capacity + self.wall_count

    @property
    def fluid_count(self) -> int:
        """Fluid particles that there are."""
        return self._start_count if self.live is None else self.live()

    @property
    def count(self) -> int:
        """Fluid and wall particles that there are."""
        return self.fluid_count + self.wall_count

    def rows(self, field: Field) -> int:
        """Return the number of rows of a field's array."""
        return {"fluid": self.fluid_capacity, "wall": self.wall_count, "all": self.capacity}[field.rows]

    def put(self, name: str, values: np.ndarray) -> None:
        """Copy host values of shape (particles of the field's kind, ...) into a field; ValueError on a wrong shape."""
        array = self.arrays[name]
        if not array.size:
            return
        shape = getattr(array.dtype, "_shape_", ())
        kind = wp.dtype_to_numpy(getattr(array.dtype, "_wp_scalar_type_", array.dtype))
        host = np.ascontiguousarray(values, dtype=kind)
        live = {"fluid": self.fluid_count, "wall": self.wall_count, "all": self.count}[self.fields[name].rows]
        if host.shape != (live, *shape):
            raise ValueError(f"{name}: shape {host.shape}, expected {(live, *shape)}")
        if live != array.shape[0]:
            host = self._spread(self.fields[name], host)
        array.assign(host)

    def _spread(self, field: Field, host: np.ndarray) -> np.ndarray:
        """Return host values with room behind the fluid."""
        result = np.zeros((self.rows(field), *host.shape[1:]), dtype=host.dtype)
        fluid = self.fluid_count
        result[:fluid] = host[:fluid]
        if field.rows == "all":
            result[self.fluid_capacity :] = host[fluid:]
        return result

    def get(self, name: str) -> np.ndarray:
        """Return a host copy of a field, without the room behind the fluid, in the current order of the particles."""
        array, field = self.arrays[name], self.fields[name]
        host = array.numpy()
        if self.changing and field.rows != "wall":
            fluid = host[: self.fluid_count]
            return np.concatenate([fluid, host[self.fluid_capacity :]]) if field.rows == "all" else np.array(fluid)
        return np.array(host) if array.device.is_cpu else host  # on a CPU it is the field itself

    def kept(self) -> dict[str, np.ndarray]:
        """Return host copies of the fields that make up the state between two steps."""
        return {name: self.get(name) for name, field in self.fields.items() if field.kept}

    def grow(self, capacity: int) -> None:
        """Make room for more fluid particles; what is in the fields stays, walls move behind the new room."""
        self.grown += 1
        old, self.fluid_capacity = self.fluid_capacity, max(capacity, self.fluid_capacity)
        for name, field in self.fields.items():
            if field.rows == "wall":
                continue
            before = self.arrays[name]
            after = self.arrays[name] = self._allocate(field)
            if old:
                wp.copy(after, before, count=old)
            if field.rows == "all" and self.wall_count:
                wp.copy(after, before, dest_offset=self.fluid_capacity, src_offset=old, count=self.wall_count)

    def memory(self) -> int:
        """Return the bytes of all fields."""
        return sum(int(array.capacity) for array in self.arrays.values())
