"""The command line: `python -m warpsph COMMAND`.

Each command loads the case, hands it to the module that does the work and prints what comes back. Other than
typer everything is imported inside the commands: `--help` answers at once, a command pays for what it uses.

Exit codes: 0 done, 1 unexpected error, 2 bad input, 3 diverged, 4 cannot write, 5 the scene does not fit the memory,
or a list cannot grow, 6 validate: a reference was missed or a run failed; sweep, benchmark: a run failed, 7 the wall time
is over, 130 interrupted.
"""

import typer

from warpsph.cli.benchmark_command import benchmark
from warpsph.cli.case_commands import check, new, schema, show
from warpsph.cli.ftle_command import ftle
from warpsph.cli.info_command import info
from warpsph.cli.plot_command import plot
from warpsph.cli.run_command import run
from warpsph.cli.sweep_command import sweep
from warpsph.cli.validate_command import validate

__all__ = ["app", "main"]

app = typer.Typer(
    name="warpsph",
    help="Smoothed particle hydrodynamics on NVIDIA Warp.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # help without rich: rich takes longer to import than all the rest
    pretty_exceptions_enable=False,
)
# In the order of `--help`.
for command in (run, check, show, new, schema, plot, ftle, validate, sweep, benchmark, info):
    app.command()(command)


def main() -> None:
    """Entry point of `python -m warpsph` and of the `warpsph` command."""
    app(prog_name="python -m warpsph")
