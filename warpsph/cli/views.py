"""What `check` and `show` print; `run --dry-run` prints both."""

from __future__ import annotations

from typing import TYPE_CHECKING

from warpsph.cli.reporting import quieten_warp, say
from warpsph.cli.tables import duration, format_cell, mebibytes, print_table

if TYPE_CHECKING:

    from warpsph.case.case import Case


def print_estimate(case: Case) -> None:
    quieten_warp(False)
    from warpsph.running.preview import estimate

    found = estimate(case)
    about = "about " if "refused" in found else ""
    rows = [
        ("fluid particles", f"{about}{format_cell(found['particles'])}"),
        ("wall particles", f"{about}{format_cell(found['walls'])}"),
        ("memory of the device", f"{about}{mebibytes(found['memory_bytes'])}"),
        ("memory of the host", f"about {mebibytes(found['host_bytes'])}"),
        ("time step", None if found.get("dt") is None else f"{found['dt']:.3g} s"),
        ("steps", found.get("steps")),
        ("estimated time", duration(found["seconds"]) if "seconds" in found else None),
    ]
    print_table(case.title or "Case", ["", ""], [row for row in rows if row[1] is not None])
    for warning in found.get("warnings", []):
        say(f"warning: {warning}")
    if "refused" in found:
        raise found["refused"]


def print_plan(case: Case) -> None:
    quieten_warp(False)
    from warpsph.case.case_file import dump_yaml
    from warpsph.running.preview import describe

    plan = describe(case)
    print(f"# resolved case\n{dump_yaml(plan['resolved'])}")
    print_table("Structure", ["choice", "value"], plan["structure"].items())
    print_table("Chosen by auto", ["key", "why"], plan["reasons"].items())
    print_table(
        "Stages of one step, in order",
        ["", "stage", "why"],
        [
            (str(number), "  " * stage["depth"] + stage["name"], stage["reason"])
            for number, stage in enumerate(plan["stages"], 1)
        ],
    )
    if plan["absent"]:
        print_table(
            "Absent", ["stage", "why"], [(stage["name"], stage["reason"]) for stage in plan["absent"]]
        )
