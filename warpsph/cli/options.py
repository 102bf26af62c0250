"""Arguments that several commands share."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Precision(StrEnum):
    """Floating-point type of the particle state."""

    float32 = "float32"
    float64 = "float64"


class Level(StrEnum):
    """How much work a validation is."""

    quick = "quick"
    seed = "seed"
    fine = "fine"
    ci = "ci"


CaseFile = Annotated[Path, typer.Argument(metavar="CASE", help="Case file (YAML).", show_default=False)]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change a value of the case, e.g. phases.oil.density=900."
    ),
]
PrecisionOption = Annotated[Precision | None, typer.Option("--precision", help="Same as --set precision=...")]
EndTime = Annotated[
    float | None, typer.Option("--end-time", metavar="SECONDS", help="Same as --set end_time=...")
]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
