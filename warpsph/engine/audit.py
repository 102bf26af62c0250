"""A look at a program before anything compiles: arguments that nobody declares, fields that nobody writes.

Warp would bind a misspelt array to nothing and read out of bounds; a field that no stage writes would be read as zeros.
"""

from __future__ import annotations

import ast
import functools
import textwrap
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpsph.engine.launch import Bindings
    from warpsph.engine.population import Population
    from warpsph.engine.program import Program, Stage

# What a build of the neighbour list writes.
LIST_WRITES = frozenset(
    {"anchor", "offset", "position", "fluid_neighbours", "wall_neighbours", "flags", "band_mark", "band_sum", "band",
     "fraction", "normal", "interface_weight", "curvature",
     "share", "covered"}
)  # fmt: skip


@functools.cache
def access(kernel: Any) -> tuple[frozenset[str], frozenset[str]]:
    """Return (arguments that a kernel reads element by element, arguments that it writes or hands to a function)."""
    names = {argument.label for argument in kernel.adj.args}
    reads: set[str] = set()
    writes: set[str] = set()
    for node in ast.walk(ast.parse(textwrap.dedent(kernel.adj.source))):
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            (reads if isinstance(node.ctx, ast.Load) else writes).add(node.value.id)
        elif isinstance(node, ast.Call):
            writes |= {given.id for given in node.args if isinstance(given, ast.Name)}
    return frozenset(reads & names), frozenset(writes & names)


def check(program: Program, bindings: Bindings, population: Population, written: Collection[str] = ()) -> None:
    """Refuse a program that cannot be bound, or whose stage reads a field that nobody writes.

    Args:
        program: of a scheme.
        bindings: values and declared names.
        population: its fields; those that are kept have start values.
        written: further fields that are written outside of stages, such as the solution of a linear system.

    Raises:
        KeyError: names kernel and argument, or stage and field.
    """
    stages = list(program.stages())
    for stage in stages:
        bindings.check(stage.kernel, [*stage.values, *stage.fields])
        for argument, name in stage.fields.items():
            if name not in population.fields:
                raise KeyError(f"{stage.name}: argument {argument!r} stands for {name!r}, which is no field of this run")
    kept = {name for name, field in population.fields.items() if field.kept or field.blank}
    known = kept | LIST_WRITES | set(written) | {name for stage in stages for name in _named(stage, 1)}
    for stage in stages:
        for name in sorted(_named(stage, 0) & population.fields.keys()):
            if name not in known:
                raise KeyError(f"{stage.name}: reads the field {name!r}, which no stage writes and no start value fills")


def _named(stage: Stage, which: int) -> set[str]:
    """Return the names of fields that a stage reads (0) or writes (1)."""
    return {stage.fields.get(argument, argument) for argument in access(stage.kernel)[which]}
