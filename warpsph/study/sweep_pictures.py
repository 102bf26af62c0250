"""Pictures of a sweep, one a measurement: a line over one parameter, a family of lines or a map over two."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from warpsph.study.sweep_table import SweepTable

MOST_LINES = 6
"""Values of the second parameter that are drawn as lines; a grid of more is a map."""


def draw_sweep(table: SweepTable) -> list[Path]:
    """Draw every measurement of a sweep into its folder, over one or two parameters; return the files.

    Nothing is drawn over three and more parameters, over words, or where no run has a number. Raises OutputError.
    """
    from matplotlib.figure import Figure

    from warpsph.files.whole_files import whole_file

    axes = [table.column(name) for name in table.parameters]
    if len(axes) > 2 or any(axis.dtype == object for axis in axes):
        return []
    written = []
    for name in table.measures:
        values = table.column(name)
        known = np.isfinite(values)
        if not known.any():
            continue
        figure = Figure(figsize=(5.5, 4), layout="constrained")
        panel = figure.add_subplot()
        _draw(figure, panel, table.parameters, [axis[known] for axis in axes], values[known], name)
        path = table.folder / f"{name}.png"
        with whole_file(path) as temporary:
            figure.savefig(temporary, format="png", dpi=100)
        written.append(path)
    return written


def _draw(figure: Any, panel: Any, names: Any, axes: list[np.ndarray], values: np.ndarray, name: str) -> None:
    """One measurement: lines over the first parameter, or colours over both."""
    panel.set_xlabel(names[0])
    if len(axes) == 1:
        _line(panel, axes[0], values)
        panel.set_ylabel(name)
        return
    families = np.unique(axes[1])
    if len(families) > MOST_LINES:
        # Points carry the colours: samples stand anywhere, and runs that failed leave gaps.
        colours = panel.scatter(axes[0], axes[1], c=values, s=60)
        panel.set_ylabel(names[1])
        figure.colorbar(colours, ax=panel, label=name)
        return
    for value in families:
        chosen = axes[1] == value
        _line(panel, axes[0][chosen], values[chosen], f"{names[1]} {value:g}")
    panel.set_ylabel(name)
    panel.legend()


def _line(panel: Any, places: np.ndarray, values: np.ndarray, label: str | None = None) -> None:
    order = np.argsort(places, kind="stable")
    panel.plot(places[order], values[order], "o-", label=label)
