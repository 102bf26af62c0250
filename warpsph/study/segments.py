"""Reference interfaces in files: lines that are stored as segments."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpsph.errors import CaseError, Problem, listed

SEGMENT_COLUMNS = ("x1", "y1", "x2", "y2")


def read_segments(
    path: Path | str,
    scale: float = 1.0,
    offset: Sequence[float] = (0.0, 0.0),
    mirror: float | None = None,
) -> np.ndarray:
    """Read the segments of a reference interface, (n, 2, 2): of each the two ends, of these x and y [m].

    path: CSV file whose first four columns are x1, y1, x2, y2; the names may go on (x1_over_R, "y1 [m]"), further
        columns are left alone, as are blank lines and those that begin with #
    scale: length of the file's unit [m]
    offset: where the file's origin is in the scene [m]; added after scaling
    mirror: x of an axis of symmetry in the scene [m]; the segments come twice, as they are and mirrored about it

    Raises CaseError if the file cannot be read or is no such table, or a number is not finite.
    """
    needed = f"name a CSV file whose first columns are {', '.join(SEGMENT_COLUMNS)}"
    given = {"over_scale": [scale], "over_offset": list(offset), "over_mirror": [] if mirror is None else [mirror]}
    problems = [
        Problem(key, numbers, "needs finite numbers", "write e.g. 0.5")
        for key, numbers in given.items()
        if not all(math.isfinite(number) for number in numbers)
    ]
    if scale == 0:
        remedy = "give the length of the file's unit in m"
        problems.append(Problem("over_scale", scale, "needs a number other than 0", remedy))
    if len(offset) != 2:
        problems.append(Problem("over_offset", list(offset), "needs two numbers", "write e.g. 0.5,0"))

    def refuse(rule: str, remedy: str = needed) -> None:
        raise CaseError([*problems, Problem("over", str(path), rule, remedy)])

    rows: list[list[float]] = []
    heading: list[str] | None = None
    try:
        with open(path, encoding="utf-8", newline="") as file:
            reader = csv.reader(file)
            for row in reader:
                if not any(cell.strip() for cell in row) or row[0].lstrip().startswith("#"):
                    continue
                if heading is None:
                    heading = [cell.strip() for cell in row[:4]]
                    named = [re.match(r"[xy][12](?![0-9A-Za-z])", cell) for cell in heading]
                    if tuple(match.group() if match else "" for match in named) != SEGMENT_COLUMNS:
                        refuse(f"its first columns are {listed(heading)}")
                    continue
                try:
                    numbers = [float(cell) for cell in row[:4]]
                except ValueError:
                    numbers = []
                if len(numbers) != 4 or not all(math.isfinite(number) for number in numbers):
                    refuse(f"line {reader.line_num} does not begin with four numbers", "correct or delete the line")
                rows.append(numbers)
    except OSError as error:
        refuse(f"cannot be read: {error.strerror or error}")
    except (UnicodeDecodeError, csv.Error):
        refuse("is no CSV file")
    if not rows:
        refuse("holds no segments")
    if problems:
        raise CaseError(problems)
    segments = np.array(rows, np.float64).reshape(-1, 2, 2) * scale + np.asarray(offset, np.float64)
    if mirror is None:
        return segments
    return np.concatenate([segments, np.array([2.0 * mirror, 0.0]) + segments * np.array([-1.0, 1.0])])
