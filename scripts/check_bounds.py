"""Does a kernel read or write beyond an array? Runs of cases with the bounds of every access checked.

    python scripts/check_bounds.py [CASE-RUN ...] [--level ci] [--steps 200] [--device cpu]

Without names all runs of the level; `*` stands for anything. Warp checks an index in its debug mode alone, and stops the
process at the first that is wrong; in the usual mode such an access finds what is beside the array, and is fatal once in a
hundred runs. So each run has a process of its own, which notes the kernel that it launches. Five times slower than usual.
Exit code 1 if a run was stopped.
"""

from __future__ import annotations

import argparse
import fnmatch
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from warpsph.case.case_file import load_case
from warpsph.study.validation import Planned, find_cases, runs_of

SHOWN = 200  # characters of the note of a kernel


def planned(level: str, patterns: list[str]) -> list[Planned]:
    """Return the runs of a level whose CASE-RUN matches a pattern, all without one."""
    found = [run for name, path in find_cases().items() for run in runs_of(load_case(path), name, [level])]
    return [run for run in found if not patterns or any(fnmatch.fnmatchcase(run.name, pattern) for pattern in patterns)]


def note_kernels(note: Path) -> None:
    """Write the name of each kernel to a file before it is launched."""
    from warpsph.engine.launch import Launcher, Task

    task_of = Launcher._whole
    file = note.open("wb", buffering=0)

    def noting(self: Launcher, name: str, kernel: Any, *rest: Any) -> Task:
        task = task_of(self, name, kernel, *rest)
        run, line = task.run, f"{name} ({kernel.key})".ljust(SHOWN).encode()

        def launch() -> None:
            file.seek(0)
            file.write(line)
            run()

        task.run = launch
        return task

    Launcher._whole = noting  # type: ignore[method-assign,assignment]


def run_checked(name: str, level: str, device: str, steps: int, note: Path) -> None:
    """Run so many steps of a case in debug mode, in this process."""
    import warp as wp

    wp.config.mode = "debug"
    note_kernels(note)
    from warpsph.running.model import Model

    (run,) = planned(level, [name])
    model = Model(run.case, device=device, threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(run.case.end_time, steps)
    model.snapshot()


def main() -> int:
    """Run each in a process of its own and say where it was stopped."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--level", default="ci")
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--note", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.note is not None:
        run_checked(given.names[0], given.level, given.device, given.steps, given.note)
        return 0
    runs, stopped = planned(given.level, given.names), 0
    if not runs:
        parser.error(f"no run of level {given.level} is called {' '.join(given.names)}")
    with tempfile.TemporaryDirectory() as folder:
        note = Path(folder) / "kernel"
        for run in runs:
            note.write_text("before the first kernel")
            options = ["--level", given.level, "--steps", str(given.steps), "--device", given.device, "--note", str(note)]
            command = [sys.executable, __file__, run.name, *options]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            said = [line for line in done.stderr.splitlines() if "Assertion" in line or "Error" in line]
            verdict = "ok" if done.returncode == 0 else f"stopped in {note.read_text().strip()}"
            print(f"{run.name:50} {verdict}", *said, flush=True)
            stopped += done.returncode != 0
    print(f"{len(runs)} runs, {stopped} stopped")
    return 1 if stopped else 0


if __name__ == "__main__":
    sys.exit(main())
