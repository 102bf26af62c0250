"""Every type of gauge with every scheme: the check of the case refuses it, or it measures."""

import copy
from typing import Any

import pytest

from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.case.gauge_models import GAUGES
from warpsph.errors import CaseError
from warpsph.running.preview import estimate
from warpsph.schemes import registry

FORCES = {"wall_force", "force_coefficients", "surface_stress"}
EVERY = {"interval": 0.01}
LINE = {"from": [0.3, 0.2], "to": [0.7, 0.2], "count": 5}
WITH_KEYS: dict[str, dict[str, Any]] = {
    "interface_wave": {"phase": "a", "wavelength": 1},
    "lens": {"phase": "b"},
    "force_coefficients": {"speed": 1, "length": 0.3, "density": 1},
    "surface_stress": {"density": 1},
    "elevation": {"places": [[0.5]]},
    "points": {"points": [[0.5, 0.2]], "fields": ["pressure"]},
    "line": {**LINE, "fields": ["velocity"]},
    "reattachment": LINE,
}


def scene(scheme: str, phases: str, holds: str) -> dict[str, Any]:
    """A box with layers of fluids, one above the other, which may hold a body or stream, for a single short step."""
    layers = [
        {"phase": phase, "shape": {"where": {"condition": f"abs({len(phases)}*y - {k + 0.5}) < 0.5"}}}
        for k, phase in enumerate(phases)
    ]
    plain: dict[str, Any] = {
        "dimension": 2,
        "particle_spacing": 1 / 16,
        "end_time": 1e-5,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "gravity": [0, -1],
        "phases": {phase: {"density": 1, "gamma": 1.4} for phase in phases},
        "fluids": layers,
        "start": {"pressure": 1.0 if scheme == "gas" else "hydrostatic"},
        "numerics": {"scheme": scheme},
    }
    if "body" in holds:
        plain["bodies"] = {"block": {"shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.2}}}}
    if "stream" in holds:
        sides = {"lower": {"inlet": {"velocity": [0.1, 0]}}, "upper": {"outlet": {"pressure": 0}}}
        plain["domain"]["boundary"] = {"x": sides, "y": "free_slip"}
        plain |= {"gravity": [0, 0], "start": {"velocity": [0.1, 0]}}
    return plain


def refused(case: dict[str, Any]) -> bool:
    """Whether `check` refuses a gauge of a case."""
    try:
        estimate(Case.from_dict(copy.deepcopy(case)))
    except CaseError as error:
        assert all(problem.path.startswith("gauges.") and problem.remedy for problem in error.problems), str(error)
        return True
    return False


SCENES = [
    ("riemann", "abc", ""), ("riemann", "a", "body"), ("riemann", "a", "body in a stream"),
    ("delta_plus", "a", ""), ("delta_plus", "a", "body"), ("delta_plus", "a", "body in a stream"),
    ("isph", "a", ""), ("isph", "a", "body"), ("isph", "a", "body in a stream"), ("gas", "a", ""),
]  # fmt: skip


def test_every_scheme_has_a_scene():
    assert {name for name, _, _ in SCENES} == set(registry.names())


@pytest.mark.parametrize(("scheme", "phases", "holds"), SCENES)
def test_a_gauge_is_refused_by_the_check_or_measures(scheme, phases, holds):
    """`wall_force` with `scheme: gas` was let through by the check, and the run ended with a KeyError."""
    plain = scene(scheme, phases, holds)
    gauges = {kind: {"type": kind, **EVERY, **WITH_KEYS.get(kind, {})} for kind in GAUGES}
    taken = {kind: gauge for kind, gauge in gauges.items() if not refused({**plain, "gauges": {kind: gauge}})}
    assert {"energy", "points", "line", "extents"} <= taken.keys()
    assert not (scheme == "gas" and FORCES & taken.keys())
    run = Simulation({**plain, "gauges": taken}).run()
    for kind in taken:
        assert len(run.gauge(kind)["time"]) > 0, kind


BLOCK, PLATE = ({"lower": [0.375, 0.375], "upper": [right, 0.625]} for right in (0.625, 0.5))


@pytest.mark.parametrize(
    ("holds", "box", "numerics", "rule", "remedy"),
    [
        ("body in a stream", BLOCK, {}, "between inlets and outlets", "a tenth of a spacing"),
        ("body", BLOCK, {"pressure_gradient": "conservative"}, "pressure_gradient: conservative", "corrected"),
        ("body", PLATE, {}, "thinner than four spacings", "lower particle_spacing"),
    ],
)
def test_what_keeps_isph_from_measuring_forces_is_said(holds, box, numerics, rule, remedy):
    """The causes had one message, of bodies that "are no cells"."""
    plain = scene("isph", "a", holds)
    plain["bodies"] = {"block": {"shape": {"box": box}}}
    plain["numerics"] |= numerics
    plain["gauges"] = {"drag": {"type": "force_coefficients", **EVERY, **WITH_KEYS["force_coefficients"]}}
    with pytest.raises(CaseError) as raised:
        estimate(plain)
    (problem,) = raised.value.problems
    assert problem.path == "gauges.drag.type"
    assert rule in problem.rule
    assert remedy in problem.remedy
