"""Tables and numbers on stdout."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console



def console(width: int = 110) -> Console:
    """Console for stdout; `width` counts where there is no terminal."""
    from rich.console import Console

    # Without a terminal rich would wrap tables to 80 columns.
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else width)


def print_table(
    title: str, columns: Iterable[str], rows: Iterable[Iterable[Any]], align: str = "", width: int = 110
) -> None:
    """Print a table; `align` has an l or r for each column (default: all l), `width` counts without a terminal."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    columns = list(columns)
    table = Table(
        title=title or None,
        box=box.SIMPLE_HEAD,
        show_header=any(columns),
        title_justify="left",
        title_style="bold",
    )
    for column, side in zip(columns, align or "l" * len(columns), strict=True):
        table.add_column(column, justify="right" if side == "r" else "left", overflow="fold")
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(format_cell(cell)) for cell in row))
    console(width).print(table)


def format_cell(value: Any) -> str:
    """Short text for a cell: numbers with four digits, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}".replace(",", " ")
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {format_cell(entry)}" for key, entry in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(format_cell(entry) for entry in value)
    return str(value)


def duration(seconds: float | None) -> str:
    """'42 s', '3 min 20 s', '2 h 05 min'; '?' if unknown."""
    if seconds is None or not math.isfinite(seconds):
        return "?"
    if seconds < 60:
        return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def mebibytes(number: int) -> str:
    return f"{number / 2**20:,.1f} MiB".replace(",", " ")
