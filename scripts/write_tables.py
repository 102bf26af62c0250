"""Tables of README.md and docs/ from the records in benchmarks/.

    python scripts/write_tables.py            # writes every table anew
    python scripts/write_tables.py --check    # exit code 1, and says which, if one differs from its records

A table stands between two marks, each a line of its own, anywhere in README.md or docs/:

    <!-- table: NAME -->
    <!-- end table -->

    two_phase, one_phase, projection, delta_plus, gas   errors of the shipped cases by resolution: phases or scheme
    misses                             every error that is beyond the limit of its case
    unrecorded                         runs of the cases of which there is no record
    measured_at                        commit, date and device of the runs that the tables of errors show
    ci                                 the errors that the level ci is held to
    validation_h200                    every row of the records of the H200, with its value and reference
    commands_h200                      the commands of these records
    speed_cpu, speed_h200              million particle-steps a second
    lanes_h200                         milliseconds a step by how many threads a particle has
    profile_h200                       the stages that take most of a step, and their share of the copy bandwidth
    benchmark_NAME_DEVICE              fronts, defaults, targets, failures, others of the benchmark on cpu, h200
    benchmark_commands                 the commands of these records
    constants                          constants that are not derived, and what half and double of each changes

What stands between the marks is made from the records alone: no row is chosen by hand, and a limit that is missed is said
in the row. Of several records of one run the newest counts. Limits are those of the case file as it is; a row that was
measured under another definition than that of the case file is marked.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.case.references import ReferenceValue
from warpsph.errors import CaseError
from warpsph.kernels.core.lanes import lanes_for
from warpsph.kernels.core.spec import Spec
from warpsph.study import baseline
from warpsph.study.comparison import definition_of
from warpsph.study.reference_files import known_curve
from warpsph.study.validation import find_cases, runs_of

sys.path.insert(0, str(Path(__file__).resolve().parent))  # not there where Python runs with -P, or a test loads this file
import benchmark_tables  # noqa: E402
import sensitivity_table  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
BENCHMARKS = ROOT / "benchmarks"
SENSITIVITY = tuple(BENCHMARKS / f"sensitivity{part}.json" for part in ("", "_added", "_walls", "_full"))
H200 = BENCHMARKS / "validation_h200"
LEVELS = ("quick", "seed", "fine")
OLD = "†"
"""Mark of an error that was measured under another definition."""

ORDER = (
    "square_droplet static_droplet static_drop_3d oscillating_drop sessile_drop rayleigh_taylor rising_bubble "
    "rising_bubble_3d hysing_1 hysing_2 double_bubble layered_couette layered_poiseuille layered_tank drop_impact "
    "dam_break_air elliptic_drop rotating_square rotating_square_inviscid oscillating_drop_central taylor_green "
    "taylor_green_lattice poiseuille couette hydrostatic_tank standing_wave dam_break dam_break_3d "
    "dam_break_block dam_break_lobovsky open_channel backward_step"
).split()
MARKS = re.compile(r"(<!-- table: ([a-z0-9_]+) -->\n)(.*?)(<!-- end table -->)", re.DOTALL)


# ---- records ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """One error on record, and what its case asks.

    entry: the row as `validate` wrote it; record: the rest of its file
    allowed: limit of the case file, or that of the row where the case file has no such quantity any more
    old: whether the definition of the error has changed since
    least: whether the error is one of the definition of today that it exceeds for sure, see `by_the_way_moved`
    """

    entry: dict[str, Any]
    record: dict[str, Any]
    path: Path
    level: str
    allowed: float | None
    old: bool
    least: bool = False

    @property
    def run(self) -> str:
        return str(self.entry["run"])

    @property
    def case(self) -> str:
        return str(self.entry["case"])

    @property
    def quantity(self) -> str:
        return str(self.entry["quantity"])

    @property
    def ended(self) -> bool:
        return bool(self.entry["quantity"])

    @property
    def missed(self) -> bool:
        """Whether it is beyond its limit; a run that failed, or an error without a number, is."""
        error = self.entry["error"]
        if not self.ended:
            return True
        return self.allowed is not None and (error is None or abs(error) > self.allowed)

    @property
    def text(self) -> str:
        """The error, or what there is instead."""
        error = self.entry["error"]
        if error is None:
            return str(self.entry["note"] or self.entry["outcome"])
        return ("≥ " if self.least else "") + share(error, self.entry["absolute"]) + (OLD if self.old else "")

    @property
    def precision(self) -> str:
        """Nothing for float32, else the precision with a space before it."""
        precision = self.entry.get("precision", "float32")
        return "" if precision == "float32" else f" {precision}"

    @property
    def device(self) -> str:
        """CPU, or the short name of a GPU."""
        record = self.record
        return "CPU" if record["device"] == "cpu" else str(record["device_name"]).replace("NVIDIA ", "").split()[0]

    @property
    def commit(self) -> str:
        """The short hash of the commit."""
        return str(self.record["commit"])[:7]

    @property
    def where(self) -> str:
        """Device, precision unless float32, date and commit."""
        return f"{self.device}{self.precision}, {self.record['date']}, {self.commit}"


@cache
def case_of(name: str) -> Case | None:
    """A shipped case, None if there is none of the name."""
    path = ROOT / "cases" / f"{name}.yaml"
    return load_case(path) if path.exists() else None


def phases_in(name: str) -> int:
    """How many phases a case has."""
    case = case_of(name)
    return 1 if case is None else len(case.phases)


@cache
def cases_of_runs(name: str) -> dict[str, Case]:
    """Run -> its case, of a shipped case and all levels."""
    case = case_of(name)
    return {} if case is None else {run.run.name: run.case for run in runs_of(case, name)}


def measured_otherwise(entry: dict[str, Any], case: Case) -> bool:
    """Whether an error of a record was defined otherwise than by its case of today; if the record does not say, it was."""
    return bool(entry.get("definition") != definition_of(case, entry["quantity"]))


def rows_of(path: Path) -> list[Row]:
    """The rows of a record of `validate`."""
    record = json.loads(path.read_text(encoding="utf-8"))
    entries = record.pop("rows")
    record.pop("runs", None)
    rows = []
    for entry in entries:
        case = cases_of_runs(entry["case"]).get(entry["run"])
        reference = None if case is None else case.reference.get(entry["quantity"])
        allowed = entry["allowed"] if reference is None else reference.allowed
        old = case is not None and reference is not None and measured_otherwise(entry, case)
        moved = by_the_way_moved(entry, reference, case) if old else None
        if moved is not None:
            entry |= {"error": moved, "absolute": False}
            exact = isinstance(reference, ReferenceValue)
            rows.append(Row(entry, record, path, record["level"], allowed, not exact, not exact))
        else:
            rows.append(Row(entry, record, path, record["level"], entry["allowed"] if old else allowed, old))
    return rows


def by_the_way_moved(entry: dict[str, Any], reference: Any, case: Any) -> float | None:
    """The error as a share of the way moved, of a row that was measured without it; None if it is not about a way.

    Of a value it is exact. Of a curve the row holds the values where the error was largest by the old measure, or root mean
    squares of both: neither differ by more than the new measure does, so that this is the least that it can be.
    """
    if getattr(reference, "moved_from", None) is None or entry["value"] is None:
        return None
    difference = float(entry["value"] - entry["reference"])
    if isinstance(reference, ReferenceValue):
        return difference / abs(reference.value - reference.moved_from)
    times, values = known_curve(reference, case)
    first, last = reference.window or (0.0, case.end_time)
    inside = (times >= first) & (times <= last * (1 + 1e-9))
    return abs(difference) / float(abs(values[inside] - reference.moved_from).max())


def place_of(row: Row) -> tuple[int, str, int, int]:
    """Place in a table: case, level, run in the order of the case file."""
    case = ORDER.index(row.case) if row.case in ORDER else len(ORDER)
    names = list(cases_of_runs(row.case))
    return case, row.case, LEVELS.index(row.level), names.index(row.run) if row.run in names else len(names)


@cache
def h200_rows() -> list[Row]:
    """All rows of the records of the H200."""
    return sorted((row for path in sorted(H200.glob("*.json")) for row in rows_of(path)), key=place_of)


@cache
def newest_rows() -> list[Row]:
    """The rows of all records of `validate` at LEVELS: of each run, in each precision, those of the newest record."""
    files = [*H200.glob("*.json"), *BENCHMARKS.glob("*.json")]
    found: dict[tuple[str, str, str], list[Row]] = {}
    for path in sorted(files):
        record = json.loads(path.read_text(encoding="utf-8"))
        if "level" not in record or record["level"] not in LEVELS or "rows" not in record or "cases" in record:
            continue
        own: dict[tuple[str, str, str], list[Row]] = {}
        for row in rows_of(path):
            own.setdefault((row.case, row.run, row.entry.get("precision", "float32")), []).append(row)
        for key, rows in own.items():
            if key not in found or rank(rows[0]) > rank(found[key][0]):
                found[key] = rows
    return sorted((row for rows in found.values() for row in rows), key=place_of)


def rank(row: Row) -> tuple[str, bool]:
    """The newer of two records counts, of one day that of a GPU."""
    return row.record["date"], row.record["device"] != "cpu"


# ---- cells -----------------------------------------------------------------------------------------------


def number(value: float | None, form: str = ".5g") -> str:
    """A number as text, nothing for None."""
    return "" if value is None else format(value, form)


def share(value: float | None, absolute: bool) -> str:
    """An error or a limit: per cent, or in the unit of the quantity."""
    if value is None:
        return ""
    return f"{value:.3g}" if absolute else f"{100 * value:.3g} %"


def line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"


def table(head: Iterable[str], align: str, rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table; align has l or r for each column."""
    bars = ["---:" if side == "r" else "---" for side in align]
    return line(head) + line(bars) + "".join(line(row) for row in rows)


def unit_of(row: Row) -> str:
    unit = row.entry["unit"]
    return f" [{unit}]" if row.entry["absolute"] and unit not in ("", "1", None) else ""


# ---- tables ----------------------------------------------------------------------------------------------


def by_resolution(wanted: Callable[[Row], bool]) -> str:
    """One line a case and quantity, with the error of each run."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in newest_rows():
        if wanted(row):
            groups.setdefault((row.case, row.quantity), []).append(row)
    lines = []
    last = ""
    for (case, quantity), rows in groups.items():
        name = quantity.replace("_", " ") + unit_of(rows[0]) if quantity else "**did not end**"
        runs, errors, limits = [], [], []
        for row in rows:
            runs.append(row.run + row.precision)
            errors.append(f"**{row.text}**" if row.missed else row.text)
            limits.append("reported" if row.allowed is None else share(row.allowed, row.entry["absolute"]))
        missed = sum(row.missed for row in rows)
        shown = limits[:1] if len(set(limits)) == 1 else limits
        verdict = f"**missed** {missed} of {len(rows)}" if missed else ""
        first = f"`{case}`" if case != last else ""
        lines.append([first, name, "; ".join(runs), "; ".join(errors), "; ".join(shown), verdict])
        last = case
    return table(["case", "quantity", "runs", "error of each", "allowed", ""], "llllll", lines)


def scheme_of(row: Row) -> str:
    for scheme in ("isph", "riemann", "delta_plus"):
        if scheme in row.run.split():
            return scheme
    case = case_of(row.case)
    return "riemann" if case is None else str(case.numerics.scheme)


def misses() -> str:
    """All rows beyond their limits."""
    lines = []
    for row in newest_rows():
        if row.missed:
            allowed = share(row.allowed, row.entry["absolute"])
            quantity = row.quantity.replace("_", " ") + unit_of(row)
            lines.append([f"`{row.case}` {row.run}", quantity, row.text, allowed, row.where])
    return table(["case, run", "quantity", "error", "allowed", "record"], "llrrl", lines)


def unrecorded() -> str:
    """Runs of the shipped cases without a record."""
    there = {(row.case, row.run) for row in newest_rows()}
    lines = []
    for name, path in find_cases().items():
        for run in runs_of(load_case(path), name, LEVELS):
            if (name, run.run.name) not in there:
                lines.append([f"`{name}`", run.run.name, run.level])
    return table(["case", "run", "level"], "lll", lines)


def measured_at() -> str:
    """Commit, date and device of the runs that the tables of errors show, the newest first.

    Records hold the day alone: of one day the rows stand by their hashes.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in newest_rows():
        groups.setdefault((commit_of(row), row.device), []).append(row)
    lines = []
    for (commit, device), rows in groups.items():
        days = sorted({row.record["date"] for row in rows})
        lines.append((days[-1], commit, device, " to ".join(dict.fromkeys((days[0], days[-1]))), runs_by_case(rows)))
    cells = [[commit, date, device, runs] for _, commit, device, date, runs in sorted(lines, reverse=True)]
    return table(["commit", "date", "device", "cases and their runs"], "llll", cells)


def commit_of(row: Row) -> str:
    """The commit of a row, and whether it is not that of the code but the one that brought the record."""
    return row.commit + (" (of the record)" if row.record.get("commit_is") == "of the record" else "")


def runs_by_case(rows: Iterable[Row]) -> str:
    """Cases with their runs, each case on a line of its own in the cell."""
    runs: dict[str, dict[str, None]] = {}
    for row in rows:
        runs.setdefault(row.case, {})[row.run + row.precision] = None
    return "<br>".join(f"`{case}` {'; '.join(names)}" for case, names in runs.items())


def ci() -> str:
    """The errors that the level ci is held to."""
    record = baseline.read_baseline(baseline.FILE)
    lines = []
    for key, run in record["runs"].items():
        case, _, name = key.partition("/")
        for position, (quantity, entry) in enumerate(run["errors"].items()):
            absolute = entry["absolute"]
            numbers = [share(entry[word], absolute) for word in ("error", "noise", "allowed")]
            first = f"`{case}` {name}" if position == 0 else ""
            lines.append([first, quantity.replace("_", " "), *numbers, "**missed**" if entry["missed"] else ""])
    return table(["case, run", "quantity", "error", "noise", "allowed", ""], "llrrrl", lines)


def validation_h200() -> str:
    """Every row of the H200."""
    lines = []
    last = None
    for row in h200_rows():
        entry = row.entry
        run = row.run + row.precision
        first = (row.case, run) != last
        last = (row.case, run)
        allowed = "reported" if row.allowed is None else share(row.allowed, entry["absolute"])
        lines.append(
            [
                f"`{row.case}` {run}" if first else "",
                row.quantity.replace("_", " ") + (f" [{entry['unit']}]" if entry["unit"] not in ("", "1", None) else ""),
                number(entry["value"]),
                number(entry["reference"]),
                row.text,
                allowed,
                "**missed**" if row.missed else "" if row.allowed is None else "ok",
                str(entry["steps"]) if first else "",
                number(entry["seconds"], ".1f") if first else "",
            ]
        )
    head = ["case, run", "quantity", "value", "reference", "error", "allowed", "", "steps", "seconds"]
    return table(head, "llrrrrlrr", lines)


def commands_h200() -> str:
    """The commands that made the records of the H200."""
    lines = []
    for path in sorted(H200.glob("*.json")):
        record = json.loads(path.read_text(encoding="utf-8"))
        lines.append(f"{record['command']}   # {path.name}, {record['date']}, {record['commit'][:7]}\n")
    return "```sh\n" + "".join(lines) + "```\n"


def spaced(value: float) -> str:
    """A whole number with a space between thousands."""
    return f"{value:,.0f}".replace(",", " ")


def _speeds(name: str) -> list[dict[str, Any]]:
    return list(json.loads((BENCHMARKS / f"{name}.json").read_text(encoding="utf-8"))["rows"])


def speed_cpu() -> str:
    """Million particle-steps a second by precision and threads."""
    rows = _speeds("speed_cpu")
    columns = list(dict.fromkeys((row["precision"], row["threads"]) for row in rows))
    found = {(row["scene"], row["precision"], row["threads"]): row["mups"] for row in rows}
    scenes = dict.fromkeys(row["scene"] for row in rows)
    head = [f"{precision}, {threads} thread{'s' if threads > 1 else ''}" for precision, threads in columns]
    lines = [[scene, *(number(found.get((scene, *column)), ".2f") for column in columns)] for scene in scenes]
    return table(["scene", *head], "l" + "r" * len(head), lines)


def speed_h200() -> str:
    """Steps, and how far they are from the memory's limit."""
    lines = [
        [row["scene"], spaced(row["particles"]), f"{row['ms_per_step']:.3f}", spaced(row["mups"]),
         f"{row['floor_ratio']:.1f}", f"{100 * row['shares'].get('neighbour list', 0.0):.0f} %"]
        for row in _speeds("speed_h200")
    ]  # fmt: skip
    head = ["scene", "particles", "ms a step", "million particle-steps/s", "x floor", "list work"]
    return table(head, "lrrrrr", lines)


def lanes_h200() -> str:
    """Milliseconds a step by lanes of a particle, in bold the number that a run takes by itself."""
    record = json.loads((BENCHMARKS / "lanes_h200.json").read_text(encoding="utf-8"))
    rows = record["rows"]
    lanes = list(rows[0]["ms_per_step"])
    lines = []
    for row in rows:
        times = [f"{row['ms_per_step'][n]:.3f}" for n in lanes]
        spec = Spec(row["dimension"], multiphase=row["multiphase"], varying_h=row["varying_h"])
        own = lanes_for(spec, row["particles"], record["multiprocessors"])
        bold = [f"**{text}**" if int(n) == own else text for n, text in zip(lanes, times, strict=True)]
        lines.append([row["scene"], spaced(row["particles"]), *bold])
    return table(["scene", "particles", *lanes], "lr" + "r" * len(lanes), lines)


def profile_h200() -> str:
    """The stages of each scene that take most of its time, and how near they come to the bandwidth of a copy.

    Shares are those of the time in stages; the making of neighbour lists counts as one stage. Nothing is said of the
    bandwidth of stages that do not run as one kernel.
    """
    record = json.loads((BENCHMARKS / "profile_h200.json").read_text(encoding="utf-8"))
    lines = []
    for scene in record["scenes"]:
        inside = scene["us_in_stages"]
        spent: dict[str, float] = {}
        moved: dict[str, float | None] = {}
        for row in scene["rows"]:
            stage = "list" if row["stage"].startswith("list: ") else row["stage"]
            spent[stage] = spent.get(stage, 0.0) + row["us_per_step"]
            moved[stage] = None if stage == "list" else row["bandwidth"]
        cells = []
        for stage in sorted(spent, key=lambda stage: -spent[stage])[:3]:
            rate = moved[stage]
            near = "" if rate is None else f", {rate / 1e9:.0f} GB/s, {rate / record['bandwidth']:.2f}"
            cells.append(f"{stage} {spent[stage]:.0f} µs, {100 * spent[stage] / inside:.0f} %{near}")
        lines.append([scene["scene"], spaced(scene["particles"]), spaced(inside), *cells])
    head = ["scene", "particles", "µs a step in stages", "largest", "second", "third"]
    return table(head, "lrrlll", lines)


def cells_or_none(head: Iterable[str], align: str, rows: list[list[str]]) -> str:
    """A table, or the word none where it has no rows."""
    return table(head, align, rows) if rows else "None.\n"


TABLES: dict[str, Callable[[], str]] = {
    "two_phase": lambda: by_resolution(lambda row: phases_in(row.case) > 1),
    "projection": lambda: by_resolution(lambda row: phases_in(row.case) == 1 and scheme_of(row) == "isph"),
    "one_phase": lambda: by_resolution(lambda row: phases_in(row.case) == 1 and scheme_of(row) == "riemann"),
    "delta_plus": lambda: by_resolution(lambda row: scheme_of(row) == "delta_plus"),
    "gas": lambda: by_resolution(lambda row: scheme_of(row) == "gas"),
    "misses": misses,
    "unrecorded": unrecorded,
    "measured_at": measured_at,
    "ci": ci,
    "validation_h200": validation_h200,
    "commands_h200": commands_h200,
    "speed_cpu": speed_cpu,
    "speed_h200": speed_h200,
    "lanes_h200": lanes_h200,
    "profile_h200": profile_h200,
    "benchmark_commands": benchmark_tables.commands,
    **{name: lambda make=make: cells_or_none(*make()) for name, make in benchmark_tables.tables().items()},
    "constants": lambda: table(*sensitivity_table.constants(*SENSITIVITY)),
}


# ---- files -----------------------------------------------------------------------------------------------


def filled(text: str, where: str) -> str:
    """A text with all its tables made anew. Raises ValueError for a mark without its other, or of no known table."""
    pairs = len(MARKS.findall(text))
    if text.count("<!-- table: ") != pairs or text.count("<!-- end table -->") != pairs:
        raise ValueError(f"{where}: each <!-- table: NAME --> needs an <!-- end table -->, each on a line of its own")

    def make(match: re.Match[str]) -> str:
        if match[2] not in TABLES:
            raise ValueError(f"{where}: there is no table {match[2]}; there are {', '.join(TABLES)}")
        return f"{match[1]}\n{TABLES[match[2]]()}\n{match[4]}"

    return MARKS.sub(make, text)


def main(arguments: list[str] | None = None) -> int:
    """Write or check all tables; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a table is not up to date")
    chosen = parser.parse_args(arguments)
    differ = []
    try:
        for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
            text = path.read_text(encoding="utf-8")
            new = filled(text, str(path.relative_to(ROOT)))
            if new == text:
                continue
            differ.append(str(path.relative_to(ROOT)))
            if not chosen.check:
                path.write_text(new, encoding="utf-8")
        shipped = benchmark_tables.shipped()
        if shipped != benchmark_tables.FILE.read_text(encoding="utf-8"):
            differ.append("warpsph/fronts.json")
            if not chosen.check:
                benchmark_tables.FILE.write_text(shipped, encoding="utf-8")
    except (ValueError, CaseError) as error:
        print(error, file=sys.stderr)
        return 2
    if chosen.check and differ:
        names = ", ".join(differ)
        print(f"tables differ from their records in {names}: run python scripts/write_tables.py", file=sys.stderr)
        return 1
    print(f"wrote {', '.join(differ)}" if differ else "all tables are as their records say")
    return 0


if __name__ == "__main__":
    sys.exit(main())
