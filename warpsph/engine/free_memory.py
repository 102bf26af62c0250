"""How much memory the machine and a device have left."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any


def host_free() -> int | None:
    """Return the bytes of memory that this process may still take: of the machine and of its control group.

    None where the system does not tell.
    """
    found = []
    with suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                found.append(1024 * int(line.split()[1]))
    if not found:
        with suppress(OSError, ValueError, AttributeError):  # all there is, where it is not told what is in use
            found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    found += _group_limits(Path("/sys/fs/cgroup"), Path("/proc/self/cgroup"))
    return min(found, default=None)


def _group_limits(mount: Path, groups: Path) -> list[int]:
    """Return what the control groups of this process, and those around them, leave it [bytes]."""
    found = []
    with suppress(OSError):
        for line in groups.read_text(encoding="utf-8").splitlines():
            _, controllers, name = line.split(":", 2)
            if controllers == "":
                base, limit, used, idle = mount, "memory.max", "memory.current", "inactive_file "
            elif "memory" in controllers.split(","):
                base, limit, used = mount / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"
                idle = "total_inactive_file "
            else:
                continue
            # in a container the own group is what is mounted, under a name that leads nowhere
            inner = base / name.strip("/")
            for folder in {base, inner, *inner.parents}:
                if folder != base and base not in folder.parents:
                    continue
                with suppress(OSError, ValueError):
                    most = int((folder / limit).read_text())
                    idle_bytes = 0
                    with suppress(OSError):
                        stats = (folder / "memory.stat").read_text().splitlines()
                        idle_bytes = sum(int(row.split()[1]) for row in stats if row.startswith(idle))
                    found.append(max(most - int((folder / used).read_text()) + idle_bytes, 0))
    return found


def device_free(device: Any) -> int | None:
    """Return the free bytes of a Warp device; None for a CPU, whose memory is the host's."""
    return None if device.is_cpu else int(device.free_memory)
