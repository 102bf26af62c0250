"""Threads of a CPU that run the parts of a kernel side by side."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp

from warpsph.engine.replay import Replay
from warpsph.kernels.core.handover import ASLEEP, AWAKE, CALLED, HELPER_WORDS, NOBODY, OWN_WORDS, WAITING, make_handover

# Turns for which a thread watches for another before it lets the processor go, some 15 to 45 ns each: longer than what lies
# between two stages of a step. With fewer processors than busy threads they are lost to others (docs/speed.md#hand-over).
PATIENCE = 2_000
# A helper that is later than SLICE [s] so many times shares its processor with others, whose slices are a millisecond and
# more; then REST kernels go through the interpreter. A part of a large kernel may be as late: nothing is lost there.
SLICE, LATE, REST = 1e-3, 8, 1_000


class ThreadTeam:
    """A fixed set of helper threads that run kernels, or callables, beside the calling thread.

    Through the interpreter a hand-over takes 26 microseconds, most of which are a processor that wakes up. So a helper that
    has run something watches its box for a while, outside the interpreter, and gets its part of the next kernel from there.

    Args:
        threads: number of threads including the caller.
    """

    def __init__(self, threads: int) -> None:
        self.threads = max(1, threads)
        self._inboxes: list[queue.SimpleQueue[Callable[[], None] | None]] = []
        self._done: queue.SimpleQueue[BaseException | None] = queue.SimpleQueue()
        self._boxes = [np.zeros(8, dtype=np.int64) for _ in range(1, self.threads)]
        self._serving: list[Replay] = []  # what watches the boxes, once kernels are handed over
        self._late = self._rest = 0
        for number, box in enumerate(self._boxes):
            inbox: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
            self._inboxes.append(inbox)
            arguments = (number, inbox, box)
            threading.Thread(target=self._serve, args=arguments, name=f"warpsph-{number + 1}", daemon=True).start()

    def _serve(self, number: int, inbox: queue.SimpleQueue[Callable[[], None] | None], box: np.ndarray) -> None:
        while (work := inbox.get()) is not None:
            error: BaseException | None = None
            try:
                work()
            except BaseException as caught:  # handed to the caller
                error = caught
            watching = self._serving[number] if self._serving and self._rest == 0 else None
            box[0] = ASLEEP if watching is None else AWAKE
            self._done.put(error)
            if watching is not None:
                watching.launch()

    def run(self, parts: Sequence[Callable[[], None]]) -> None:
        """Run the parts side by side, the first on the calling thread; return when all are done.

        Once the team is closed they run one after the other.
        """
        if len(self._inboxes) < len(parts) - 1:
            for part in parts:
                part()
            return
        for inbox, box, part in zip(self._inboxes, self._boxes, parts[1:], strict=False):
            inbox.put(part)
            box[0] = CALLED
        error: BaseException | None = None
        try:
            parts[0]()
        finally:
            for _ in parts[1:]:
                error = self._done.get() or error
        if error is not None:
            raise error

    def together(self, parts: Sequence[Replay]) -> Callable[[], None]:
        """Return what runs the parts of one kernel side by side, the first on the calling thread."""
        launches = [part.launch for part in parts]
        addresses = [part.addresses() for part in parts]
        if len(parts) == 1:
            return launches[0]
        if None in addresses or len(parts) > self.threads:
            return lambda: self.run(launches)
        return self._handed([found for found in addresses if found is not None], launches)

    def _handed(
        self, addresses: Sequence[tuple[int, int, int]], launches: Sequence[Callable[[], None]]
    ) -> Callable[[], None]:
        serve, post = make_handover()
        if not self._serving:
            self._serving = [self._recorded(serve, box) for box in self._boxes]
        job = np.zeros(OWN_WORDS + HELPER_WORDS * (len(addresses) - 1), dtype=np.int64)
        (kernel, bounds, arguments), *others = addresses
        job[:OWN_WORDS] = len(others), 0, 0, kernel, bounds, arguments
        for at, (box, (_, *own)) in enumerate(zip(self._boxes, others, strict=False)):
            job[OWN_WORDS + HELPER_WORDS * at :][:HELPER_WORDS] = box.ctypes.data, *own
        posting = self._recorded(post, job)

        def run() -> None:
            if self._rest > 0:
                self._rest -= 1
                self.run(launches)
                return
            posting.launch()
            if job[2] == NOBODY:
                self.run(launches)
            elif job[2] == WAITING:
                self._wait(job, posting)

        return run

    def _wait(self, job: np.ndarray, posting: Replay) -> None:
        """Wait until the helpers of a job are done, and let others use this processor meanwhile."""
        begin = time.perf_counter()
        job[1] = 1
        try:
            while job[2] == WAITING:
                time.sleep(0)
                posting.launch()
        finally:  # Ctrl-C
            job[1] = 0
        self._late += time.perf_counter() - begin > SLICE
        if self._late == LATE:
            self._late, self._rest = 0, REST

    @staticmethod
    def _recorded(kernel: Any, words: np.ndarray) -> Replay:
        inputs = [words.ctypes.data, PATIENCE]
        return Replay(wp.launch(kernel, dim=1, inputs=inputs, device="cpu", record_cmd=True))

    def close(self) -> None:
        """Stop the helper threads."""
        for inbox, box in zip(self._inboxes, self._boxes, strict=False):
            inbox.put(None)
            box[0] = CALLED
        self._inboxes = []
