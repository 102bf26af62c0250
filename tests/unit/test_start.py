"""Starting Warp: what is said on the standard error where there is no CUDA driver."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from warpsph import start

ROOT = Path(__file__).resolve().parents[2]
WARNING = "CUDA warning"


def stderr_of(*arguments):
    done = subprocess.run([sys.executable, "-m", "warpsph", *arguments], cwd=ROOT, capture_output=True, text=True)
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    "arguments",
    [["info"], ["check", "cases/elliptic_drop.yaml"], ["run", "cases/taylor_green.yaml", "--end-time", "1e-9"]],
    ids=lambda arguments: arguments[0],
)
def test_nothing_is_said_of_cuda_that_nobody_asked_for(arguments, tmp_path):
    if arguments[0] == "run":
        arguments = [*arguments, "--output", str(tmp_path / "run")]
    code, text = stderr_of(*arguments)
    assert (code, WARNING in text) == (0, False), text


def test_a_missing_driver_is_told_to_who_asks_for_cuda():
    if start._driver_found():
        pytest.skip("there is a CUDA driver")
    code, text = stderr_of("run", "cases/taylor_green.yaml", "--device", "cuda:0")
    assert code == 2
    assert WARNING in text and "--device: cuda:0 -> no such device here" in text


def test_other_lines_of_compiled_code_are_kept(capfd):
    with start._without_line(b"driver"):
        os.write(2, b"first\nno driver here\n")
        os.write(2, b"last\n")
    assert capfd.readouterr().err == "first\nlast\n"


def test_lines_before_a_failure_are_kept(capfd):
    with pytest.raises(RuntimeError), start._without_line(b"driver"):
        os.write(2, b"reason\n")
        raise RuntimeError
    assert capfd.readouterr().err == "reason\n"
