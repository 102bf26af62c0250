"""A recorded launch on a CPU device, repeated without what Warp does anew in each."""

from __future__ import annotations

import ctypes
from typing import Any

REFERENCE = type(ctypes.byref(ctypes.c_int()))


class _Listener:
    """Stands in for the compiled kernel of a recorded launch, and keeps what it is called with."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []

    def forward(self, *arguments: Any) -> None:
        self.calls.append(arguments)


class Replay:
    """Repeats a recorded launch of a CPU device with the bounds and arguments that Warp made for it once.

    Warp builds the structure of all arguments in every launch, 9 to 12 microseconds for the sweeps of a step, in which no
    other thread can do so. What it hands to the compiled kernel is the same each time; with a Warp that works otherwise the
    launch goes through it as before.

    Args:
        command: what `wp.launch(..., record_cmd=True)` returned.
        first_at: index of the argument `first` of the kernel.
    """

    def __init__(self, command: Any, first_at: int | None = None) -> None:
        self.command = command
        self._first_at = first_at
        self._listen()

    def _listen(self) -> None:
        command, listener = self.command, _Listener()
        self._kernel: Any = None
        hooks = getattr(command, "hooks", None)
        if hooks is None or getattr(command, "block_dim", 1) not in (None, 1):
            return
        command.hooks = listener
        try:
            command.launch()
        finally:
            command.hooks = hooks
        if len(listener.calls) == 1 and len(listener.calls[0]) == 2:
            self._kernel = hooks.forward
            self._bounds, self._arguments = listener.calls[0]

    def set_range(self, first: int, count: int) -> None:
        """Let it run over the rows first .. first + count (0 .. count for a kernel without `first`)."""
        if self._first_at is not None:
            self.command.set_param_at_index(self._first_at, first)
        self.command.set_dim(count)
        self._listen()

    def launch(self) -> None:
        """Run the kernel on the calling thread, which leaves the interpreter to others meanwhile."""
        if self._kernel is None:
            self.command.launch()
        else:
            self._kernel(self._bounds, self._arguments)

    def addresses(self) -> tuple[int, int, int] | None:
        """Return the addresses of kernel, bounds and arguments; None where the kernel takes them in another way."""
        if self._kernel is None or not all(isinstance(value, REFERENCE) for value in (self._bounds, self._arguments)):
            return None
        kernel = ctypes.cast(self._kernel, ctypes.c_void_p).value
        return (
            int(kernel or 0),
            ctypes.addressof(self._bounds._obj),
            ctypes.addressof(self._arguments._obj),
        )
