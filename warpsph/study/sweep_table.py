"""The table of a sweep: a row a run, as CSV and HDF5."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.files.whole_files import whole_file, write_text
from warpsph.study.sweep_file import ALWAYS


@dataclass
class SweepTable:
    """What a sweep has given so far.

    parameters, measures: names of columns
    rows: one dict a run that is done, in the order of the points: `run` (its number from 0), each parameter and measure,
        `variant` where there are any, `status` (finished, diverged, too slow, failed), `problem` (why not finished, or
        what could not be measured), `seconds` (without set-up), `setup_seconds`, `cpu_seconds` (of all threads, without
        set-up), `steps`, `particles`, `memory_bytes` (of the arrays of particles and lists on the device), `time` (s that
        the run reached). None where there is no number
    points: how many runs the sweep has
    interrupted: whether the user stopped before the last run
    """

    folder: Path
    parameters: Sequence[str]
    measures: Sequence[str]
    points: int
    rows: list[dict[str, Any]] = field(default_factory=list)
    interrupted: bool = False

    @property
    def columns(self) -> list[str]:
        """Names of the columns, in the order of the files."""
        return [ALWAYS[0], *self.parameters, *self.measures, *ALWAYS[1:]]

    @property
    def failed(self) -> list[dict[str, Any]]:
        """Rows of runs that did not get to their end."""
        return [row for row in self.rows if row["status"] != "finished"]

    def column(self, name: str) -> np.ndarray:
        """A column, (rows,): floats with nan where there is no number, or objects where it holds texts."""
        values = [row[name] for row in self.rows]
        if any(isinstance(value, str) for value in values):
            return np.array(["" if value is None else str(value) for value in values], object)
        return np.array([np.nan if value is None else value for value in values], np.float64)

    def write(self) -> None:
        """Write table.csv and table.h5 into the folder. Raises OutputError."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([row[name] for name in self.columns] for row in self.rows)
        write_text(self.folder / "table.csv", text.getvalue())
        self._write_hdf5()

    def _write_hdf5(self) -> None:
        """One compound dataset `table` with a field a column: float64, texts as UTF-8."""
        import h5py

        columns = {name: self.column(name) for name in self.columns}
        text = h5py.string_dtype("utf-8")
        kinds = [(name, text if values.dtype == object else np.float64) for name, values in columns.items()]
        data = np.empty(len(self.rows), kinds)
        for name, values in columns.items():
            data[name] = values
        with whole_file(self.folder / "table.h5") as temporary, h5py.File(temporary, "w") as file:
            file.create_dataset("table", data=data)
