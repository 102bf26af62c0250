"""warpsph: smoothed particle hydrodynamics on NVIDIA Warp.

    import warpsph

    result = warpsph.run("cases/square_droplet.yaml", device="cpu")

    case = warpsph.load_case("cases/square_droplet.yaml")
    result = warpsph.run(case.replace({"end_time": 1.0}))

Nothing heavy is imported here: each public name is looked up in its module when it is first used.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

# An installed warpsph contains its kernels. In a checkout they stand in `kernels/`, beside this package.
_package = os.path.dirname(os.path.abspath(__file__))
if not os.path.isdir(os.path.join(_package, "kernels")):
    __path__.append(os.path.dirname(_package))

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.case.case_file import load_case
    from warpsph.errors import (
        CapacityError,
        CaseError,
        DivergenceError,
        Interrupted,
        OutputError,
        WallTimeReached,
        WarpsphError,
    )
    from warpsph.simulation import Simulation, run
    from warpsph.snapshot import Snapshot
    from warpsph.study.movie import make_movie
    from warpsph.study.plot import plot_run
    from warpsph.study.sweep import sweep

# public name -> the module that defines it
_PUBLIC = {
    "CapacityError": "warpsph.errors",
    "Case": "warpsph.case.case",
    "CaseError": "warpsph.errors",
    "DivergenceError": "warpsph.errors",
    "Interrupted": "warpsph.errors",
    "OutputError": "warpsph.errors",
    "Simulation": "warpsph.simulation",
    "Snapshot": "warpsph.snapshot",
    "WallTimeReached": "warpsph.errors",
    "WarpsphError": "warpsph.errors",
    "load_case": "warpsph.case.case_file",
    "make_movie": "warpsph.study.movie",
    "plot_run": "warpsph.study.plot",
    "run": "warpsph.simulation",
    "sweep": "warpsph.study.sweep",
}

__all__ = [
    "CapacityError",
    "Case",
    "CaseError",
    "DivergenceError",
    "Interrupted",
    "OutputError",
    "Simulation",
    "Snapshot",
    "WallTimeReached",
    "WarpsphError",
    "__version__",
    "load_case",
    "make_movie",
    "plot_run",
    "run",
    "sweep",
]


def __getattr__(name: str) -> Any:
    module = _PUBLIC.get(name)
    if module is None:
        raise AttributeError(f"module 'warpsph' has no attribute {name!r}")
    value = getattr(import_module(module), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
