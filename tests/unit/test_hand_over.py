"""Kernels handed from thread to thread on a CPU: repeated launches, helpers that watch, sleep, are late or many."""

import threading
import time

import numpy as np
import pytest
import warp as wp

from warpsph.engine import replay as replay_module
from warpsph.engine import team as team_module
from warpsph.engine.launch import Bindings, Launcher
from warpsph.engine.replay import Replay
from warpsph.kernels.core.handover import ASLEEP

ROWS = 4000


@wp.kernel(module="unique", enable_backward=False)
def count(first: int, slot: int, more: int, seen: wp.array(dtype=int), by: wp.array(dtype=int)):
    i = wp.tid() + first
    for _ in range(1 + more * slot):  # helpers have more to do
        seen[i] = seen[i] + 1
    by[i] = slot


def counting(threads: int, more: int = 0):
    """Return (launcher, task over ROWS rows, visits of each row, thread that was there last)."""
    launcher = Launcher(wp.get_device("cpu"), threads)
    seen, by = wp.zeros(ROWS, dtype=int, device="cpu"), wp.full(ROWS, -1, dtype=int, device="cpu")
    bindings = Bindings(launcher.device, {"more": more, "seen": seen, "by": by})
    return launcher, launcher.task("count", count, ROWS, bindings), seen.numpy(), by.numpy()


def test_a_replay_does_what_the_launch_does():
    seen, by = wp.zeros(10, dtype=int, device="cpu"), wp.zeros(10, dtype=int, device="cpu")
    command = wp.launch(count, dim=10, inputs=[0, 3, 0, seen, by], device="cpu", record_cmd=True)
    replay = Replay(command, first_at=0)
    assert not seen.numpy().any()  # listening runs nothing
    assert replay._kernel is not None  # this Warp can be repeated
    replay.launch()
    assert (seen.numpy() == 1).all() and (by.numpy() == 3).all()
    replay.set_range(4, 3)
    replay.launch()
    assert seen.numpy().tolist() == [1] * 4 + [2] * 3 + [1] * 3


def test_a_warp_that_launches_in_another_way_is_asked_each_time(monkeypatch):
    monkeypatch.setattr(replay_module._Listener, "forward", lambda self, *arguments: self.calls.append((*arguments, None)))
    launcher, task, seen, by = counting(2)
    for turn in range(1, 4):
        task.run()
        assert (seen == turn).all()
    assert sorted(set(by)) == [0, 1]
    launcher.team.close()


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_every_row_is_visited_once_by_the_thread_whose_part_it_is(threads):
    launcher, task, seen, by = counting(threads)
    for turn in range(1, 201):
        task.run()
        assert (seen == turn).all()
    assert (np.diff(by) >= 0).all() and sorted(set(by)) == list(range(threads))
    task.resize(600)  # of 3 threads the parts are too small now
    task.run()
    assert (seen[:600] == 201).all() and (seen[600:] == 200).all()
    launcher.team.close()


def test_helpers_get_kernels_outside_the_interpreter_while_they_watch(monkeypatch):
    monkeypatch.setattr(team_module, "PATIENCE", 10_000_000)
    monkeypatch.setattr(team_module, "LATE", 10**9)
    launcher, task, seen, _ = counting(3)
    task.run()  # the first wakes them
    monkeypatch.setattr(launcher.team, "run", lambda parts: pytest.fail("went through the interpreter"))
    for turn in range(2, 100):
        task.run()
        assert (seen == turn).all()
    monkeypatch.undo()
    launcher.team.close()


def test_a_helper_that_sleeps_is_woken():
    launcher, task, seen, _ = counting(2)
    for turn in range(1, 4):
        task.run()
        deadline = time.monotonic() + 10
        while launcher.team._boxes[0][0] != ASLEEP and time.monotonic() < deadline:
            time.sleep(0.01)
        assert launcher.team._boxes[0][0] == ASLEEP
        assert (seen == turn).all()
    launcher.team.close()


def test_waits_for_a_helper_that_is_late_and_then_lets_it_rest(monkeypatch):
    """Its part takes longer than the caller watches for: the caller asks again until it is done."""
    monkeypatch.setattr(team_module, "PATIENCE", 10_000_000)
    monkeypatch.setattr(team_module, "SLICE", 0.0)  # any wait is late
    launcher, task, seen, _ = counting(2, more=2000)
    task.run()
    monkeypatch.setattr(team_module, "PATIENCE", 1)  # of the caller alone
    task.resize(ROWS)
    for turn in range(2, 2 + team_module.LATE):
        assert launcher.team._rest == 0
        task.run()
        assert (seen[: ROWS // 2] == turn).all() and (seen[ROWS // 2 :] == 2001 * turn).all()
    assert launcher.team._rest == team_module.REST
    task.run()
    assert launcher.team._rest == team_module.REST - 1 and (seen[: ROWS // 2] == 2 + team_module.LATE).all()
    launcher.team.close()


def test_callables_run_beside_the_caller_and_their_errors_arrive():
    launcher, task, seen, _ = counting(2)
    task.run()
    names = []
    launcher.team.run([lambda: names.append(threading.current_thread().name)] * 2)
    assert len(set(names)) == 2

    def fails():
        raise ValueError("of a helper")

    with pytest.raises(ValueError, match="of a helper"):
        launcher.team.run([lambda: None, fails])
    task.run()
    assert (seen == 2).all()
    launcher.team.close()


def test_closing_ends_the_helpers():
    before = set(threading.enumerate())
    launcher, task, seen, _ = counting(3)
    task.run()
    helpers = set(threading.enumerate()) - before
    assert len(helpers) == 2
    launcher.team.close()
    for helper in helpers:
        helper.join(timeout=10)
        assert not helper.is_alive()
    task.run()  # on the calling thread
    assert (seen == 2).all()
