"""What `check` and `show` print; `run --dry-run` prints both."""

from __future__ import annotations

from typing import TYPE_CHECKING

from warpsph.cli.reporting import quieten_warp, refuse, say
from warpsph.cli.tables import duration, format_cell, mebibytes, print_table

if TYPE_CHECKING:
    from warpsph.case.case import Case


def print_estimate(case: Case) -> None:
    quieten_warp(False)
    from warpsph.running.preview import estimate

    found = estimate(case)
    about = "about " if "refused" in found else ""
    across = found.get("sound_across")
    rows = [
        ("fluid particles", f"{about}{format_cell(found['particles'])}"),
        ("wall particles", f"{about}{format_cell(found['walls'])}"),
        ("memory of the device", f"{about}{mebibytes(found['memory_bytes'])}"),
        ("memory of the host", f"about {mebibytes(found['host_bytes'])}"),
        ("start pressure", found.get("start_pressure") or None),
        ("lowest sound across the stream", None if across is None else f"{across:.3g} 1/s"),
        ("time step", None if found.get("dt") is None else f"{found['dt']:.3g} s"),
        ("steps", found.get("steps")),
        ("estimated time", duration(found["seconds"]) if "seconds" in found else None),
    ]
    print_table(case.title or "Case", ["", ""], [row for row in rows if row[1] is not None])
    for warning in found.get("warnings", []):
        say(f"warning: {warning}")
    if "refused" in found:
        raise found["refused"]


def print_advice(case: Case, error: float, device: str) -> None:
    """Print what to take for an error, by the stored benchmarks of a kind of device. Raises CaseError if there are none."""
    from warpsph.study.benchmark_advice import advise, kind_of, stored_fronts

    table = stored_fronts()
    if not table["cases"]:
        say("no benchmark is stored in this version: nothing to suggest")
        return
    known = dict.fromkeys(kind_of(entry["device"]) for entry in table["sources"])
    if kind_of(device) not in known:
        refuse("--device", device, "no benchmark of such a device is stored", f"choose from: {', '.join(known)}")
    found = advise(case, error, table, device)
    origin = f"the benchmark {found.case} ({found.says}), {found.error_name}"
    print(f"for an error of {100 * error:g} %, from {origin}")
    if not found.exact:
        print(f"the nearest there is; other than there: {', '.join(found.differences) or 'shape and numbers alone'}")
    for text in found.refused:
        say(f"not for this case: {text}")
    if found.row is None:
        best = found.best
        told = "it has no runs" if best is None else (
            f"the best was {100 * best['error']:.2g} % with {best['choice']} at {best['particle_spacing']:.4g} m "
            f"in {duration(best['seconds'])}")  # fmt: skip
        print(f"no run that this case allows had this error: {told}")
        return
    if found.condition is not None:
        say(f"with these settings: {found.condition}")
    row = found.row
    rows = [(key, format_cell(value) if value != {} else "as by default") for key, value in found.changes.items()]
    rows.append(("spacings over the length", f"{found.across:.3g}"))
    if not found.exact and found.seconds is not None:
        rows += [("particles", format_cell(found.particles)), ("steps", format_cell(found.steps))]
        rows.append(("expected time", f"about {duration(found.seconds)}"))
    source = next(entry for entry in table["sources"] if entry["device"] == row["device"])
    counts = f"{row['particles']} particles, {row['steps']} steps"
    measured = f"{100 * row['error']:.2g} % in {duration(row['seconds'])}, {counts}"
    rows.append((f"measured: {row['choice']}", measured))
    threads = f", {source['threads']} thread(s)" if source["device"] == "cpu" else ""
    rows.append(("on", f"{source['device_name']}{threads}, {source['date']}"))
    print_table("Settings", ["", ""], rows)


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
        print_table("Absent", ["stage", "why"], [(stage["name"], stage["reason"]) for stage in plan["absent"]])
