"""`info`: what is installed and which devices there are."""

from __future__ import annotations

import os
from typing import Any

from warpsph.cli.options import Debug
from warpsph.cli.reporting import quieten_warp, reported
from warpsph.cli.tables import print_table


def info(debug: Debug = False) -> None:
    """Print versions, devices, threads and where compiled kernels are kept."""
    with reported(debug):
        _print_info()


def _print_info() -> None:
    import platform
    from importlib.metadata import PackageNotFoundError, version

    import warpsph

    quieten_warp(False)
    import warp

    warp.init()
    rows: list[tuple[str, Any]] = [("warpsph", warpsph.__version__), ("Python", platform.python_version())]
    for package in ("warp-lang", "numpy", "h5py", "pyvista", "vtk", "pydantic", "matplotlib"):
        try:
            rows.append((package, version(package)))
        except PackageNotFoundError:
            rows.append((package, "not installed"))
    rows.append(("machine", f"{platform.system()} {platform.machine()}"))
    for device in warp.get_devices():
        memory = f", {device.total_memory / 2**30:.0f} GiB" if device.is_cuda else ""
        rows.append((f"device {device}", f"{device.name}{memory}"))
    rows.append(
        ("CPU threads", len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count())
    )
    rows.append(("kernel cache", warp.config.kernel_cache_dir))
    print_table("", ["", ""], rows)
