"""The columns of gauges as the case knows them are those that gauges have in a run."""

import pytest

from tests.scenes import FULL, case_of
from warpsph.case.case import Case
from warpsph.case.columns import column_names, columns_of
from warpsph.case.gauge_models import GAUGES
from warpsph.measure import gauges

BLOCK = {
    "dimension": 3,
    "particle_spacing": 0.1,
    "end_time": 1.0,
    "domain": {"lower": [0, 0, 0], "upper": [1, 1, 1], "boundary": {axis: "wall" for axis in "xyz"}},
    "phases": {"water": {"density": 1000}, "oil": {"density": 900}},
    "surface_tension": [{"between": ["water", "oil"], "coefficient": 0.1}],
    "fluids": [
        {"phase": "water", "shape": {"box": {"lower": [0, 0, 0], "upper": [1, 1, 0.5]}}},
        {"phase": "oil", "shape": "rest"},
    ],
    "obstacles": [{"shape": {"sphere": {"center": [0.5, 0.5, 0.5], "radius": 0.2}}}],
}
FIELDS = ["velocity", "pressure", "volume", "normal", "curvature"]


def gauge_of(kind, dimension):
    """A gauge of a type, with all that may change its columns."""
    points, ends = [[0.1] * dimension, [0.2] * dimension], {"from": [0.1] * dimension, "to": [0.9] * dimension, "count": 3}
    extra = {"points": {"points": points, "fields": FIELDS}, "line": {**ends, "fields": FIELDS}, "contour": {"mirror": "x"}}
    return {"type": kind, "interval": 0.1, **extra.get(kind, {})}


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kind", GAUGES)
def test_a_gauge_has_the_columns_that_the_case_says(kind, dimension):
    if kind == "contour" and dimension == 3:
        pytest.skip("contours are lines")
    written = {"g": gauge_of(kind, dimension)}
    case = case_of(FULL, gauges=written, reference={}) if dimension == 2 else Case.from_dict({**BLOCK, "gauges": written})
    made = gauges.GAUGES[kind]("g", case.gauges["g"], case)
    if kind == "energy":  # as in a run, which knows the equations of state
        made = gauges.EnergyGauge("g", case.gauges["g"], case, {"": gauges.PhaseEos(1.0, 1.0, 1.0)})
    assert [(column.name, column.unit) for column in columns_of(case.gauges["g"], case)] == [
        (column.name, column.unit) for column in made.columns
    ]
    assert column_names("g", case.gauges["g"], case)[0] == "time"
