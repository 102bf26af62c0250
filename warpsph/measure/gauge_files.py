"""The CSV files of gauges: a line of names and units, then a line of numbers for each row."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpsph.case.columns import Column
from warpsph.errors import OutputError
from warpsph.files.whole_files import whole_file, write_failure


def parse_heading(cell: str) -> tuple[str, str]:
    """Name and unit of a heading `name [unit]`; the unit is empty if there is none."""
    name, bracket, rest = cell.strip().rpartition(" [")
    return (name, rest.rstrip("]")) if bracket else (cell.strip(), "")


def read_gauge(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns of a gauge's file and their units, both by name; the time comes first. Raises OutputError."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror or error}") from error
    lines = list(csv.reader(io.StringIO(text)))
    if not lines:
        raise OutputError(f"{path}: is empty")
    heading = [parse_heading(cell) for cell in lines[0]]
    try:
        rows = np.array([[float(cell) for cell in line] for line in lines[1:]], np.float64)
        rows = rows.reshape(len(lines) - 1, len(heading))
    except ValueError as error:
        raise OutputError(f"{path}: has a row that does not fit its heading: {error}") from error
    return {name: rows[:, k] for k, (name, _) in enumerate(heading)}, dict(heading)


class GaugeFile:
    """The rows of one gauge, in memory and (with a path) in its file."""

    def __init__(self, columns: Sequence[Column], path: Path | None) -> None:
        self.columns = columns
        self.path = path
        self.blocks: list[np.ndarray] = []
        buffer = io.StringIO()
        csv.writer(buffer, lineterminator="\n").writerow(str(column) for column in columns)
        self.heading = buffer.getvalue()
        self._file: io.FileIO | None = None

    def open(self, restart_time: float | None) -> None:
        """Make the file, or with a restart time [s] take over the rows that are there up to it. Raises OutputError."""
        path = self.path
        if path is None:
            return
        if restart_time is not None and path.exists():
            self._take_over(path, restart_time)
        else:
            with whole_file(path) as temporary:
                temporary.write_text(self.heading, encoding="utf-8")
        try:
            self._file = open(path, "ab", buffering=0)
        except OSError as error:
            raise write_failure(path, error) from error

    def check(self) -> str:
        """The rows of the file, if there is one, as text. Raises OutputError if it cannot be continued."""
        path = self.path
        if path is None or not path.exists():
            return ""
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise OutputError(f"{path}: cannot be continued: {error}") from error
        heading, newline, body = text.partition("\n")
        if heading + newline != self.heading:
            raise OutputError(
                f"{path}: cannot be continued: its columns are not those of this case any more; "
                "rename the gauge or write to another folder with --output"
            )
        return body

    def _take_over(self, path: Path, restart_time: float) -> None:
        """Keep the rows up to the restart time; later ones, and a last one that was cut off, go."""
        body = self.check()
        limit = restart_time + 1e-9 * abs(restart_time)
        kept, rows = [], []
        for line in body.splitlines(keepends=True):
            try:
                row = [float(cell) for cell in line.split(",")]
            except ValueError:
                break
            if len(row) != len(self.columns) or not line.endswith("\n") or row[0] > limit:
                break
            kept.append(line)
            rows.append(row)
        with whole_file(path) as temporary:
            temporary.write_text(self.heading + "".join(kept), encoding="utf-8")
        if rows:
            self.blocks.append(np.array(rows))

    def append(self, rows: np.ndarray) -> None:
        """Add rows (k, columns); after an error the file ends with its last whole row."""
        self.blocks.append(rows)
        if self._file is None:
            return
        assert self.path is not None
        data = "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()).encode()
        size = 0
        try:
            size = self._file.seek(0, io.SEEK_END)
            view = memoryview(data)
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            self._file.truncate(size)
            raise write_failure(self.path, error) from error

    def series(self) -> dict[str, np.ndarray]:
        if len(self.blocks) > 1:
            self.blocks = [np.concatenate(self.blocks)]
        rows = self.blocks[0] if self.blocks else np.empty((0, len(self.columns)))
        return {column.name: rows[:, k].copy() for k, column in enumerate(self.columns)}

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
