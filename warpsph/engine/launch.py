"""Launching kernels: one call whatever the device.

On CUDA a task is one kernel launch, recorded into a graph by the stepper. On a CPU device Warp runs a launch on one
thread but releases the interpreter lock, so a task is one recorded launch per thread over parts of the index range.
A kernel takes its arguments by name from a `Bindings`; two names are special: `first` (start of the index range)
and `slot` (number of the thread, where each may keep a maximum of its own).
"""

from __future__ import annotations

import difflib
import queue
import threading
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

import warp as wp

OWN = frozenset({"first", "slot"})  # arguments that a launch gives itself
SMALLEST_SHARE = 256  # items below which a launch is not worth splitting


class ThreadTeam:
    """A fixed set of helper threads that run callables beside the calling thread.

    Args:
        threads: number of threads including the caller.
    """

    def __init__(self, threads: int) -> None:
        self.threads = max(1, threads)
        self._inboxes: list[queue.SimpleQueue[Callable[[], None] | None]] = []
        self._done: queue.SimpleQueue[BaseException | None] = queue.SimpleQueue()
        for number in range(1, self.threads):
            inbox: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
            self._inboxes.append(inbox)
            threading.Thread(target=self._serve, args=(inbox,), name=f"warpsph-{number}", daemon=True).start()

    def _serve(self, inbox: queue.SimpleQueue[Callable[[], None] | None]) -> None:
        while (work := inbox.get()) is not None:
            error: BaseException | None = None
            try:
                work()
            except BaseException as caught:  # handed to the caller
                error = caught
            self._done.put(error)

    def run(self, parts: Sequence[Callable[[], None]]) -> None:
        """Run the parts side by side, the first on the calling thread; return when all are done."""
        for inbox, part in zip(self._inboxes, parts[1:], strict=False):
            inbox.put(part)
        error: BaseException | None = None
        try:
            parts[0]()
        finally:
            for _ in parts[1:]:
                error = self._done.get() or error
        if error is not None:
            raise error

    def close(self) -> None:
        """Stop the helper threads."""
        for inbox in self._inboxes:
            inbox.put(None)
        self._inboxes = []


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
        command = wp.launch(kernel, dim=max(count, 1), inputs=values, device=self.device, record_cmd=True)
        state = {"count": count}

        def resize(new: int) -> None:
            state["count"] = new
            command.set_dim(max(new, 1))

        if self.is_cpu:

            def run() -> None:
                if state["count"] > 0:
                    command.launch()

        else:

            def run() -> None:
                # recorded into graphs: the index range must not change afterwards
                if count > 0:
                    command.launch()

        return Task(name, run, resize)

    def _split(self, name: str, kernel: Any, count: int, bindings: Bindings, start: int, extra: dict[str, Any]) -> Task:
        commands = []
        first_at = next((n for n, a in enumerate(kernel.adj.args) if a.label == "first"), None)
        if first_at is None:
            return self._whole(name, kernel, count, bindings, start, extra)
        for slot in range(self.threads):
            values = bindings.arguments(kernel, {"first": start, "slot": slot, **extra})
            commands.append(wp.launch(kernel, dim=1, inputs=values, device=self.device, record_cmd=True))
        active: list[Callable[[], None]] = []
        team = self.team

        def resize(new: int) -> None:
            shares = self.threads if new >= SMALLEST_SHARE * self.threads else 1
            active.clear()
            for slot in range(shares if new > 0 else 0):
                begin, end = new * slot // shares, new * (slot + 1) // shares
                commands[slot].set_param_at_index(first_at, start + begin)
                commands[slot].set_dim(end - begin)
                active.append(commands[slot].launch)

        def run() -> None:
            if len(active) > 1:
                team.run(active)
            elif active:
                active[0]()

        resize(count)
        return Task(name, run, resize)
