"""`check`, `show`, `new` and `schema`: commands about case files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from warpsph.cli.arguments import error_of, load
from warpsph.cli.options import CaseFile, Debug, EndTime, Overrides, PrecisionOption
from warpsph.cli.reporting import refuse, reported
from warpsph.cli.views import print_advice, print_estimate, print_plan


def check(
    case: CaseFile,
    precision: PrecisionOption = None,
    overrides: Overrides = None,
    end_time: EndTime = None,
    for_error: Annotated[
        str | None,
        typer.Option(metavar="ERROR", help="Suggest settings for an error such as 1%, from the stored benchmark."),
    ] = None,
    device: Annotated[
        str, typer.Option(help="Whose runs --for-error looks at: cpu, or cuda for those of a GPU; need not be here.")
    ] = "cpu",
    debug: Debug = False,
) -> None:
    """Validate a case; print particle counts, memory, time step and estimated time."""
    with reported(debug):
        from warpsph.study.validation import runs_of

        error = None if for_error is None else error_of(for_error)
        loaded = load(case, overrides, precision, end_time)
        if not overrides:  # the runs of a validation are changes of the file, not of what --set makes of it
            runs_of(loaded, case.stem)  # raises if one is wrong
        print_estimate(loaded)
        if error is not None:
            print_advice(loaded, error, device)


def show(
    case: CaseFile,
    precision: PrecisionOption = None,
    overrides: Overrides = None,
    end_time: EndTime = None,
    debug: Debug = False,
) -> None:
    """Print the resolved case and the stages of one step, and why others are absent."""
    with reported(debug):
        print_plan(load(case, overrides, precision, end_time))


def new(
    name: Annotated[Path, typer.Argument(metavar="NAME", help="Name of the case; writes NAME.yaml.")],
    debug: Debug = False,
) -> None:
    """Write a commented case to start from."""
    with reported(debug):
        path = name if name.suffix in (".yaml", ".yml") else name.with_name(name.name + ".yaml")
        text = Path(__file__).parents[1].joinpath("starter.yaml").read_text(encoding="utf-8")
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text.replace("NAME", path.stem))
        except FileExistsError:
            refuse("NAME", str(path), "exists already", "choose another name")
        except OSError as error:
            from warpsph.errors import OutputError

            raise OutputError(f"cannot write {path}: {error.strerror}") from error
        print(f"{path} written; try: python -m warpsph check {path}")


def schema(debug: Debug = False) -> None:
    """Print the JSON schema of case files, for completion in editors."""
    with reported(debug):
        from warpsph.case.case import case_schema

        print(json.dumps(case_schema(), indent=2))
