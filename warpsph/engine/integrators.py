"""Integrators for schemes whose kernels write rates: a few stages that advance declared fields (theory: common#integrators).

    rk4(spec, {"temperature": "heating"}, rates=[Stage("conduction", ...)])

is the four stages of Runge and Kutta, each with the rates evaluated anew; what is in `frozen` is evaluated once a step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import warp as wp

from warpsph.engine.program import Node, Stage
from warpsph.kernels.core.fields import Field
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.core.updates import make_add, make_close, make_keep, make_place, make_substep, make_watch

HALF, SIXTH, THIRD = 0.5, 1.0 / 6.0, 1.0 / 3.0


def work_fields(fields: Sequence[Field]) -> list[Field]:
    """Return the declarations that a Runge-Kutta method needs for fields that it advances: start and sum of rates."""
    declared = []
    for field in fields:
        for part, meaning in (("start", "at the start of the step"), ("total", "weighted sum of its rates")):
            name, text = f"{field.name}_{part}", f"{field.name} {meaning}"
            declared.append(Field(name, field.kind, field.rows, False, field.exists, field.unit, text))
    return declared


def rk4(
    spec: Spec, advanced: Mapping[str, Field], rates: Sequence[Node], frozen: Sequence[Node] = ()
) -> list[Node]:
    """Return the nodes of a classical fourth-order Runge-Kutta step, without the clock.

    Args:
        spec: structure of the run.
        advanced: name of the rate -> the field that it advances. Positions are advanced as `offset` with the rate
            `velocity`, which has to stand before what advances the velocity.
        rates: nodes that write the rates from the present fields.
        frozen: nodes that run once a step, before the others: diffusive terms that are taken at its start.

    Raises:
        ValueError: a field is advanced before it serves as a rate.
    """
    nodes: list[Node] = [*frozen, *_each(spec, advanced, _keep)]
    for share, weight in ((HALF, SIXTH), (HALF, THIRD), (1.0, THIRD)):
        nodes += [*rates, *_each(spec, advanced, _substep, share, weight), *_places(spec, advanced)]
    return [*nodes, *rates, *_each(spec, advanced, _close, SIXTH), *_places(spec, advanced)]


def rk2(
    spec: Spec, advanced: Mapping[str, Field], rates: Sequence[Node], frozen: Sequence[Node] = ()
) -> list[Node]:
    """Return the nodes of the midpoint rule, second order; arguments as of `rk4`."""
    return [
        *frozen,
        *_each(spec, advanced, _keep),
        *rates,
        *_each(spec, advanced, _substep, HALF, 0.0),
        *_places(spec, advanced),
        *rates,
        *_each(spec, advanced, _close, 1.0),
        *_places(spec, advanced),
    ]


def kick_drift_kick(
    spec: Spec, kicks: Mapping[str, Field], drifts: Mapping[str, Field], rates: Sequence[Node]
) -> list[Node]:
    """Return the nodes of a step that is symplectic where the rates follow from the drifting fields alone.

    Args:
        spec: structure of the run.
        kicks: name of the rate -> the field that it advances by two half steps, such as acceleration -> velocity.
        drifts: the same for the whole step between them, such as velocity -> offset.
        rates: nodes that write the rates of the kicks; those of the last step are the first ones of the next.
    """
    return [
        *_each(spec, kicks, _add, HALF),
        *_each(spec, drifts, _add, 1.0),
        *_places(spec, drifts),
        *rates,
        *_each(spec, kicks, _add, HALF),
    ]


def watch(spec: Spec) -> Stage:
    """Return the stage that watches over speeds, ways and faults, for a step whose own stages do not."""
    return Stage("watch", make_watch(spec), "fluid", "faults")


def _each(spec: Spec, advanced: Mapping[str, Field], make: Any, *numbers: float) -> list[Stage]:
    done: set[str] = set()
    for rate, field in advanced.items():
        if rate in done:
            raise ValueError(f"{rate}: is advanced before it serves as the rate of {field.name}; name it after that")
        done.add(field.name)
    return [make(spec, rate, field, *numbers) for rate, field in advanced.items()]


def _keep(spec: Spec, rate: str, field: Field) -> Stage:
    names = {"value": field.name, "start": f"{field.name}_start", "total": f"{field.name}_total"}
    return _stage(f"keep {field.name}", make_keep(field.dtype(spec)), field, {}, names, "where the step begins")


def _substep(spec: Spec, rate: str, field: Field, share: float, weight: float) -> Stage:
    names = {"value": field.name, "rate": rate, "start": f"{field.name}_start", "total": f"{field.name}_total"}
    kernel = make_substep(field.dtype(spec), spec.precision)
    return _stage(f"try {field.name}", kernel, field, {"share": share, "weight": weight}, names, "Runge-Kutta stage")


def _close(spec: Spec, rate: str, field: Field, weight: float) -> Stage:
    names = {"value": field.name, "rate": rate, "start": f"{field.name}_start", "total": f"{field.name}_total"}
    kernel = make_close(field.dtype(spec), spec.precision)
    return _stage(f"advance {field.name}", kernel, field, {"weight": weight}, names, "weighted mean of the rates")


def _add(spec: Spec, rate: str, field: Field, share: float) -> Stage:
    kernel = make_add(field.dtype(spec), spec.precision)
    names = {"value": field.name, "rate": rate}
    return _stage(f"advance {field.name}", kernel, field, {"share": share}, names, f"{share:g} of a step")


def _stage(name: str, kernel: Any, field: Field, numbers: dict[str, float], names: dict[str, str], reason: str) -> Stage:
    values = {key: wp.float64(value) for key, value in numbers.items()}
    return Stage(name, kernel, "wall" if field.rows == "wall" else "fluid", reason, values, names)


def _places(spec: Spec, advanced: Mapping[str, Field]) -> list[Stage]:
    """Return the stage that places the particles, where their way is among what is advanced."""
    if all(field.name != "offset" for field in advanced.values()):
        return []
    return [Stage("place", make_place(spec), "fluid", "positions from the way since the list was built")]
