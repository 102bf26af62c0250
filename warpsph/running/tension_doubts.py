"""Doubts about `surface_tension` in scenes of several fluids: pairs that were forgotten, contact angles that contradict."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.case.phases import SurfaceTension

AGREED = 1.0  # degrees that a contact angle may be off what others require: as they are rounded in a file
MOST_TOLD = 5  # pairs that a line names
STRAIGHT = 90.0  # degrees: what a pair without a contact angle counts as beside one with


def missing_pairs(case: Case) -> Iterator[str]:
    """Pairs without a tension where other pairs have one: whether they meet at the start or later, it counts as 0."""
    if not any(pair.coefficient > 0 for pair in case.surface_tension):
        return
    given = {frozenset(pair.between) for pair in case.surface_tension}
    missing = [pair for pair in combinations(case.phase_names, 2) if frozenset(pair) not in given]
    if missing:
        told = ", ".join(f"{a} and {b}" for a, b in missing[:MOST_TOLD]) + (" ..." if len(missing) > MOST_TOLD else "")
        a, b = missing[0]
        yield (
            f"surface_tension: has no entry for {told}: it counts as 0 there, while other pairs have a tension, so that "
            f"nothing pulls where they meet; add {{between: [{a}, {b}], coefficient: ...}}, with 0 if that is meant"
        )


def contradicting_angles(case: Case) -> Iterator[str]:
    """Contact angles that no wall can have together.

    Young's equation: a wall has an energy w of its own with each phase, and sigma_ab cos(theta_ab) = w_b - w_a for the angle
    in a. So the terms of three phases, each named first once, add up to nothing, and two angles give the third. The
    entries are taken in their order, those without an angle last; one that closes a loop is held against those before it.
    """
    pairs = [(k, pair) for k, pair in enumerate(case.surface_tension) if pair.coefficient > 0]
    if all(pair.contact_angle is None for _, pair in pairs):
        return
    energy = {name: 0.0 for name in case.phase_names}
    group = {name: name for name in case.phase_names}  # phases whose energies are known against each other
    for k, pair in sorted(pairs, key=lambda item: item[1].contact_angle is None):
        a, b = pair.between
        angle = STRAIGHT if pair.contact_angle is None else pair.contact_angle
        if group[a] == group[b]:
            required = (energy[b] - energy[a]) / pair.coefficient
            if abs(math.degrees(math.acos(min(max(required, -1.0), 1.0))) - angle) > AGREED:
                yield _contradiction(k, pair, required)
            continue
        offset = energy[a] + pair.coefficient * math.cos(math.radians(angle)) - energy[b]
        for name in [name for name in group if group[name] == group[b]]:
            energy[name] += offset
            group[name] = group[a]


def _contradiction(k: int, pair: SurfaceTension, required: float) -> str:
    """Return the line for an entry; required: cosine of the angle that the other entries leave it."""
    a, b = pair.between
    angle = pair.contact_angle
    told = f"no angle counts as {STRAIGHT:g} degrees, which" if angle is None else f"{angle:g} degrees"
    rule = "Young's equation, sigma cos(angle) summed over the pairs of three phases is 0 with each phase named first once"
    if abs(required) < 1.0:
        value = math.degrees(math.acos(required))
        remedy = f"write {value:.1f}, or correct the others"
    else:
        wetting, other = (a, b) if required > 0 else (b, a)
        remedy = (
            f"correct the others: no angle of this pair fits them (its cosine would be {required:.3g}, {wetting} would wet "
            f"the wall below {other} whole)"
        )
    return (
        f"surface_tension.{k}.contact_angle: {told} in {a} beside {b} {'contradicts' if angle is None else 'contradict'} "
        f"the other angles ({rule}): no wall has them all; {remedy}"
    )
