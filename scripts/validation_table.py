"""The table of docs/validation_h200.md from the records of `validate` in a folder.

    python scripts/validation_table.py benchmarks/validation_h200 > docs/validation_h200.md
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

ORDER = (
    "square_droplet static_droplet static_drop_3d oscillating_drop sessile_drop rayleigh_taylor rising_bubble hysing_1 "
    "hysing_2 double_bubble layered_couette layered_poiseuille elliptic_drop rotating_square rotating_square_inviscid "
    "oscillating_drop_central taylor_green poiseuille hydrostatic_tank dam_break dam_break_3d dam_break_lobovsky"
).split()
LEVELS = ("quick", "seed", "fine")


def number(value: float | None, form: str = ".5g") -> str:
    """Return a number as text, nothing for None."""
    return "" if value is None else format(value, form)


def line(row: dict[str, Any], first: bool) -> str:
    """Return one line of the table; case, run, steps and seconds stand in the first line of a run."""
    percent = not row["absolute"]
    error = number(None if row["error"] is None else row["error"] * (100 if percent else 1), ".2f" if percent else ".2g")
    allowed = number(row["allowed"] * (100 if percent else 1), ".2g") if row["allowed"] is not None else "reported"
    unit = " %" if percent else ""
    cells = [
        f"`{row['case']}` {row['run']}" if first else "",
        row["quantity"].replace("_", " "),
        number(row["value"]),
        number(row["reference"]),
        error + (unit if error else ""),
        allowed + (unit if row["allowed"] is not None else ""),
        {"missed": "**missed**", "no limit": ""}.get(row["outcome"], row["outcome"]),
        str(row["steps"]) if first else "",
        number(row["seconds"], ".1f") if first else "",
    ]
    return "| " + " | ".join(cells) + " |"


def main(folder: Path) -> None:
    """Print the table of all records in a folder, and the commands that made them."""
    found: list[tuple[int, int, dict[str, Any]]] = []
    commands = []
    for path in sorted(folder.glob("*.json")):
        record = json.loads(path.read_text(encoding="utf-8"))
        commands.append(f"{record['command']}   # {path.name}")
        for row in record["rows"]:
            if "float64" in record["command"]:
                row["run"] += " float64"
            place = ORDER.index(row["case"]) if row["case"] in ORDER else len(ORDER)
            found.append((place, LEVELS.index(record["level"]), row))
    found.sort(key=lambda entry: entry[:2])
    device = record["device_name"]
    print(f"# Validation on one {device}\n\nMade by `python scripts/validation_table.py {folder}` from the records there.")
    print("Errors without a percent sign are in the unit of the quantity. Most runs shared the device with up to nine")
    print("others: their seconds are upper bounds.\n")
    print("| case, run | quantity | value | reference | error | allowed | | steps | seconds |")
    print("|---|---|---:|---:|---:|---:|---|---:|---:|")
    last = None
    for _, _, row in found:
        print(line(row, (row["case"], row["run"]) != last))
        last = (row["case"], row["run"])
    print("\nThe commands:\n\n```sh")
    print("\n".join(commands))
    print("```")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
