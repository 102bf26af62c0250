"""Which state of the program made a record, and when."""

from __future__ import annotations

import os
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[2]
"""The checkout that this module belongs to, if it is one."""

NUMERICS = ("warpsph", "kernels", "cases", "scripts")
"""Folders whose changes can change a record."""

COMMIT_VARIABLE = "WARPSPH_COMMIT"
"""Environment variable that names the commit where the code is a copy without its history."""


def provenance() -> dict[str, Any]:
    """The entries `commit`, `dirty` and `date` of a record, as they were when this module was loaded: the checkout may
    have moved on when a long run ends.

    commit: of the checkout of the running code, as git names it; None outside of a checkout, unless COMMIT_VARIABLE names it
    dirty: whether tracked files of NUMERICS differ from the commit; None if that is not known
    date: today, in UTC
    """
    return dict(_AT_START)


def _state() -> dict[str, Any]:
    date = datetime.now(UTC).date().isoformat()
    if not (CHECKOUT / ".git").exists():
        return {"commit": os.environ.get(COMMIT_VARIABLE), "dirty": None, "date": date}
    commit = _git("rev-parse", "HEAD")
    changed = _git("status", "--porcelain", "--untracked-files=no", "--", *NUMERICS)
    return {"commit": commit or None, "dirty": None if changed is None else bool(changed), "date": date}


def _git(*arguments: str) -> str | None:
    """What git prints in the checkout, None if it cannot tell."""
    try:
        done = subprocess.run(["git", *arguments], cwd=CHECKOUT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


_AT_START = _state()
