"""Launching kernels: one call whatever the device.

On CUDA a task is one kernel launch, recorded into a graph by the stepper. On a CPU device Warp runs a launch on one
thread but releases the interpreter lock, so a task is one recorded launch per thread over parts of the index range.
A kernel takes its arguments by name from a `Bindings`; two names are special: `first` (start of the index range)
and `slot` (number of the thread, where each may keep a maximum of its own).
"""

from __future__ import annotations

import difflib
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

import warp as wp

from warpsph.engine.replay import Replay
from warpsph.engine.team import ThreadTeam
from warpsph.kernels.core.lanes import threads_of

OWN = frozenset({"first", "slot"})  # arguments that a launch gives itself
SMALLEST_SHARE = 256  # items below which a launch is not worth splitting


class Bindings(dict[str, Any]):
    """Values for kernel arguments by name; a declared array that the run does not have is bound to an empty one.

    Args:
        device: Warp device.
        values: by argument name.
        declared: names of arrays that may be absent by the structure of the run.
    """

    def __init__(self, device: Any, values: Mapping[str, Any], declared: Iterable[str] = ()) -> None:
        super().__init__(values)
        self.device = device
        self.declared = frozenset(declared)
        self._empty: dict[Any, Any] = {}

    def check(self, kernel: Any, special: Collection[str] = ()) -> None:
        """Refuse a kernel with an argument that is neither bound nor a declared array; nothing is compiled for that.

        Raises:
            KeyError: names kernel and argument, and for an array the declared name that is most like it.
        """
        for argument in kernel.adj.args:
            name = argument.label
            if name in self or name in special or name in OWN:
                continue
            if not isinstance(argument.type, wp.array):
                raise KeyError(f"{kernel.key}: no value for argument {name!r}")
            if name not in self.declared:
                near = difflib.get_close_matches(name, [*self.declared, *self], 1)
                hint = f"; did you mean {near[0]!r}?" if near else "; declare a field or a work array of that name"
                raise KeyError(f"{kernel.key}: argument {name!r} is an array that nobody declares{hint}")

    def arguments(self, kernel: Any, special: Mapping[str, Any]) -> list[Any]:
        """Return the argument list of a kernel; raises KeyError as `check`."""
        self.check(kernel, special)
        result = []
        for argument in kernel.adj.args:
            if argument.label in special:
                result.append(special[argument.label])
            elif argument.label in self:
                result.append(self[argument.label])
            else:
                dtype = argument.type.dtype
                if dtype not in self._empty:
                    self._empty[dtype] = wp.empty(0, dtype=dtype, device=self.device)
                result.append(self._empty[dtype])
        return result


class Task:
    """A kernel bound to its arguments and to an index range; `run()` launches it."""

    def __init__(self, name: str, runs: Callable[[], None], resize: Callable[[int], None] | None = None) -> None:
        self.name = name
        self.run = runs
        self.resize = resize
        self.seconds = 0.0

    def timed(self) -> None:
        """Run and add the time it took to `seconds` (the caller waits for the device)."""
        begin = time.perf_counter()
        self.run()
        self.seconds += time.perf_counter() - begin


class Launcher:
    """Turns kernels into tasks for a device.

    Args:
        device: Warp device.
        threads: threads of a CPU device; ignored on CUDA.
        preparing: called with the number of kernels that are ready, before each one that is to be loaded or compiled.
    """

    def __init__(self, device: Any, threads: int = 1, preparing: Callable[[int], None] | None = None) -> None:
        self.device = device
        self.is_cpu = bool(device.is_cpu)
        self.threads = max(1, threads) if self.is_cpu else 1
        self.team = ThreadTeam(self.threads)
        self._preparing = preparing
        self._ready: set[Any] = set()

    def task(
        self,
        name: str,
        kernel: Any,
        count: int,
        bindings: Bindings,
        start: int = 0,
        single: bool = False,
        special: Mapping[str, Any] | None = None,
    ) -> Task:
        """Return the task that runs `kernel` over the rows start .. start + count.

        Args:
            single: run on one thread only (kernels of one index).
            special: argument values of this task alone.
        """
        extra = dict(special or {})
        if self._preparing is not None and kernel not in self._ready:
            self._preparing(len(self._ready))
            self._ready.add(kernel)
        if not self.is_cpu or single or self.threads == 1:
            return self._whole(name, kernel, count, bindings, start, extra)
        return self._split(name, kernel, count, bindings, start, extra)

    def _whole(self, name: str, kernel: Any, count: int, bindings: Bindings, start: int, extra: dict[str, Any]) -> Task:
        values = bindings.arguments(kernel, {"first": start, "slot": 0, **extra})
        threads = threads_of(kernel)
        command = wp.launch(kernel, dim=max(count, 1) * threads, inputs=values, device=self.device, record_cmd=True)
        if not self.is_cpu:

            def run() -> None:
                # recorded into graphs: the index range must not change afterwards
                if count > 0:
                    command.launch()

            return Task(name, run, lambda new: command.set_dim(max(new, 1) * threads))

        replay = Replay(command)
        active: list[Callable[[], None]] = [replay.launch] if count > 0 else []

        def resize(new: int) -> None:
            replay.set_range(start, max(new, 1))
            active[:] = [replay.launch] if new > 0 else []

        return self._of_active(name, active, resize)

    def _split(self, name: str, kernel: Any, count: int, bindings: Bindings, start: int, extra: dict[str, Any]) -> Task:
        first_at = next((n for n, a in enumerate(kernel.adj.args) if a.label == "first"), None)
        if first_at is None:
            return self._whole(name, kernel, count, bindings, start, extra)
        parts = []
        for slot in range(self.threads):
            values = bindings.arguments(kernel, {"first": start, "slot": slot, **extra})
            parts.append(Replay(wp.launch(kernel, dim=1, inputs=values, device=self.device, record_cmd=True), first_at))
        active: list[Callable[[], None]] = []

        def resize(new: int) -> None:
            shares = self.threads if new >= SMALLEST_SHARE * self.threads else 1
            for slot in range(shares):
                begin, end = new * slot // shares, new * (slot + 1) // shares
                parts[slot].set_range(start + begin, max(end - begin, 1))
            active[:] = [self.team.together(parts[:shares])] if new > 0 else []

        resize(count)
        return self._of_active(name, active, resize)

    @staticmethod
    def _of_active(name: str, active: list[Callable[[], None]], resize: Callable[[int], None]) -> Task:
        def run() -> None:
            for launch in active:
                launch()

        return Task(name, run, resize)
