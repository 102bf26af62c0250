"""A time step as a tree: what runs, what CUDA captures, what `show` prints and what timings are named after.

A scheme returns a `Program`. Its nodes are plain data; `engine/interpreter.py` binds them to particles and runs them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

Rows = Literal["fluid", "wall", "band", "blocks", "last", "folds", "one"]


@dataclasses.dataclass(frozen=True)
class Stage:
    """One kernel.

    Attributes:
        name: shown to the user and in timings.
        kernel: Warp kernel; its arguments are bound by name.
        rows: what it runs over: fluid or wall particles, the interface band, blocks of particles, what totals their sums,
            groups of blocks, one thread, a number of rows of its own, or the entries of an array of another name.
        reason: why this scene needs it.
        values: argument values of this stage alone, by name.
        fields: arguments of this stage that stand for fields of other names: argument -> field.
    """

    name: str
    kernel: Any
    rows: Rows | str | int
    reason: str
    values: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    fields: Mapping[str, str] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class BuildList:
    """The neighbour list is made anew; particles that died are dropped, those that were born take part from here on."""

    reason: str = "the list is made anew in every step"
    name: str = "list"


@dataclasses.dataclass(frozen=True)
class KeepList:
    """The neighbour list is checked, and made anew, where the clock finds that it is used up."""

    reason: str = "kept until a particle has used up the skin"
    name: str = "list"


@dataclasses.dataclass(frozen=True)
class Births:
    """Stages that write new particles behind the last one; where they do not fit the population grows and they run again.

    The kernels count them in `counters[LIVE]`, or set `FAULT_CAPACITY` and `WANTED` and write nothing.
    """

    stages: Sequence[Stage]
    reason: str = "particles enter"
    name: str = "births"


@dataclasses.dataclass(frozen=True)
class Solve:
    """A linear system of the scheme is solved.

    Attributes:
        name: shown to the user and in timings.
        system: its name among `Systems.solves`.
    """

    name: str
    system: str
    reason: str


@dataclasses.dataclass(frozen=True)
class Rarely:
    """Nodes that run only in steps in which the device's clock asks for it (`clock.RARE`), every few steps."""

    nodes: Sequence[Node]
    reason: str = "changes at the pace of the flow, not of sound"
    name: str = "rarely"


@dataclasses.dataclass(frozen=True)
class Substeps:
    """Nodes that run `times` times in a row; they hold no list."""

    times: int
    nodes: Sequence[Node]
    reason: str
    name: str = "substeps"


@dataclasses.dataclass(frozen=True)
class ForEachLevel:
    """Nodes that run on each level of resolution, from the first to the last; a uniform run has one level."""

    nodes: Sequence[Node]
    reason: str = "each level of resolution"
    name: str = "levels"


Node = Stage | BuildList | KeepList | Births | Solve | Rarely | Substeps | ForEachLevel
GROUPS = (Rarely, Substeps, ForEachLevel)
STOPPING = (BuildList, KeepList, Births)
"""nodes that may find that there is no room, which stops the loop until the host has made some"""


@dataclasses.dataclass(frozen=True)
class Absent:
    """A stage that the scene does not need, and why."""

    name: str
    reason: str


@dataclasses.dataclass(frozen=True)
class Program:
    """What a scheme runs.

    Attributes:
        step: nodes of a time step, in order; the last stage is `advance`, but for a list that follows it.
        start: nodes that complete a fresh start, from the host.
        advance: the stage that ends a step: time and next step length. With `advancing` = 0 it prepares the first one.
        first: nodes of the first step where it differs; it runs from the host.
        measures: nodes that gauges run on demand, by name.
        changes: stages that run right before a list is made, where particles are born, die or change what they are. Births
            count themselves as those of `Births`; where they find no room nothing changes and they run again.
    """

    step: Sequence[Node]
    start: Sequence[Node]
    advance: Stage
    first: Sequence[Node] | None = None
    measures: Mapping[str, Sequence[Node]] = dataclasses.field(default_factory=dict)
    changes: Sequence[Stage] = ()

    def __post_init__(self) -> None:
        """Refuse lists and births in places where the loop could not go on from.

        Raises:
            ValueError: a list or births within a group of nodes; births that no list follows.
        """
        for node in walk(self.step):
            if isinstance(node, GROUPS):
                inner = next((n for n in walk(node.nodes) if isinstance(n, STOPPING)), None)
                if inner is not None:
                    raise ValueError(f"{inner.name}: may not stand in {node.name}, where no step can be taken up again")
        for node, after in zip(self.step, [*self.step[1:], None], strict=True):
            if isinstance(node, Births) and not isinstance(after, BuildList | KeepList):
                raise ValueError(f"{node.name}: needs a list right after it, in which the new particles take part")

    def stages(self) -> Iterator[Stage]:
        """Yield all stages, those of start, first step and gauges too."""
        for nodes in (self.step, self.start, self.first or (), (self.advance,), self.changes, *self.measures.values()):
            yield from (node for node in walk(nodes) if isinstance(node, Stage))


def walk(nodes: Sequence[Node]) -> Iterator[Node]:
    """Yield nodes and all nodes within them, in the order in which they run."""
    for node in nodes:
        yield node
        if isinstance(node, GROUPS):
            yield from walk(node.nodes)
        elif isinstance(node, Births):
            yield from node.stages


def lines(
    nodes: Sequence[Node], depth: int = 0, changes: Sequence[Stage] = ()
) -> Iterator[tuple[int, str, str]]:
    """Yield (depth, name, reason) of each node for people; `changes` of the program stand below its lists."""
    for node in nodes:
        name = node.name if not isinstance(node, Substeps) else f"{node.name} ({node.times} times)"
        yield depth, name, node.reason
        if isinstance(node, GROUPS):
            yield from lines(node.nodes, depth + 1)
        elif isinstance(node, Births):
            yield from lines(list(node.stages), depth + 1)
        elif isinstance(node, BuildList | KeepList):
            yield from lines(changes, depth + 1)
