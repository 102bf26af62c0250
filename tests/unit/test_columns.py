"""The columns of gauges: known from the case, and those that a gauge has."""

import pytest

from tests.scenes import FULL, case_of
from warpsph.case.budget_terms import MOVING, TERMS
from warpsph.case.case import Case
from warpsph.case.columns import Column, column_names, columns_of
from warpsph.case.gauge_models import GAUGES
from warpsph.measure import gauges

BLOCK = {
    "dimension": 3,
    "particle_spacing": 0.1,
    "end_time": 1.0,
    "domain": {"lower": [0, 0, 0], "upper": [1, 1, 1], "boundary": {axis: "wall" for axis in "xyz"}},
    "phases": {"water": {"density": 1000}, "oil": {"density": 900}},
    "fluids": [
        {"phase": "water", "shape": {"box": {"lower": [0, 0, 0], "upper": [1, 1, 0.5]}}},
        {"phase": "oil", "shape": "rest"},
    ],
    "bodies": {"ball": {"shape": {"sphere": {"center": [0.5, 0.5, 0.5], "radius": 0.2}}}},
}
FIELDS = ["velocity", "pressure", "volume"]
WHERE = {
    "force_coefficients": {"speed": 1, "length": 0.4, "area": 0.1, "lift": [0, 0, 1], "phase": "water"},
    "interface_wave": {"phase": "water", "wavelength": 0.5},
    "surface_stress": {"speed": 1, "density": 1},
    "fragments": {"phases": ["oil"], "largest": 2},
    "lens": {"phase": "oil"},
    "elevation": {"places": [[0.1, 0.1], [0.5, 0.1]]},
    "points": {"points": [[0.1] * 3], "fields": FIELDS},
    "line": {"from": [0.1] * 3, "to": [0.9] * 3, "count": 3, "fields": FIELDS},
    "reattachment": {"from": [0.1] * 3, "to": [0.9] * 3, "count": 3},
}
SAMPLED = "x y z velocity_x velocity_y velocity_z pressure volume"
# type of gauge -> its columns and their units, in 3-D
EXPECTED = {
    "energy": ("kinetic|potential|elastic|total|kinetic water|total water|kinetic oil|total oil", {"J"}),
    "momentum": (
        "momentum_x|momentum_y|momentum_z|angular_x|angular_y|angular_z|scale|max_speed", {"kg m/s", "kg m^2/s", "m/s"}
    ),
    "budget": (
        "|".join(
            f"power {term}|work {term}" + "".join(
                f"|{name}_{axis} {term}" for name in ("force", "impulse") for axis in "xyz" if term in ("total", *MOVING)
            )
            for term in ("total", *TERMS)
        ),
        {"W", "J", "N", "N s"},
    ),
    "phase_pressure": ("water|oil|water - oil|max|min", {"Pa"}),
    "interface_length": ("interface_length", {"m^2"}),
    "interface_wave": ("cosine|sine", {"m"}),
    "phase_velocity": (
        "|".join(f"{name} {phase}" for phase in ("water", "oil") for name in (*SAMPLED.split()[3:6], "max_speed")), {"m/s"}
    ),
    "strays": ("water|oil", {"1"}),
    "lens": ("angle water|angle oil|angle air|width", {"rad", "m"}),
    "deformation": (
        "|".join(
            f"{name} {phase}"
            for phase in ("water", "oil")
            for name in "long_axis middle_axis short_axis deformation direction_x direction_y direction_z".split()
        ),
        {"m", "1"},
    ),
    "fragments": ("count oil|volume_1 oil|volume_2 oil|rest oil", {"1", "m^3"}),
    "wall_force": (
        "|".join(f"force_{axis}{body}" for body in ("", " domain", " ball") for axis in "xyz")
        + "".join(f"|{part}_{axis} ball" for part in ("pressure", "friction", "torque") for axis in "xyz"),
        {"N", "N m"},
    ),
    "force_coefficients": (
        "|".join(
            f"{name} ball"
            for name in "Cd Cl Cs Cm Cm_roll Cm_yaw Cd_pressure Cd_friction Cl_pressure Cl_friction".split()
        ),
        {"1"},
    ),
    "surface_stress": (
        "x|y|z|normal_x|normal_y|normal_z|area|pressure|shear|friction_x|friction_y|friction_z|Cp|Cf",
        {"m", "m^2", "1", "Pa"},
    ),
    "elevation": ("surface_1|surface_2", {"m"}),
    "points": (SAMPLED.replace(" ", "|"), {"m", "m/s", "Pa", "m^3"}),
    "line": (SAMPLED.replace(" ", "|"), {"m", "m/s", "Pa", "m^3"}),
    "flow_rate": (
        "|".join(f"{name} x_{end}" for end in ("lower", "upper") for name in ("flow", "through", "face_pressure")),
        {"kg/s", "kg", "Pa"},
    ),
    "reattachment": ("separation|reattachment", {"m"}),
}  # fmt: skip


# what a gauge needs of the scene beside that
SCENE = {
    "flow_rate": {
        "domain": {
            **BLOCK["domain"],
            "boundary": {
                "x": {"lower": {"inlet": {"velocity": [1, 0, 0]}}, "upper": {"outlet": {}}}, "y": "wall", "z": "wall"
            },
        },
        "phases": {"water": {"density": 1000}},
        "fluids": [{"phase": "water", "shape": "rest"}],
    },
    "lens": {
        "dimension": 2,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "phases": {name: {"density": 1000} for name in ("water", "oil", "air")},
        "fluids": [
            {"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.3]}}},
            {"phase": "oil", "shape": {"box": {"lower": [0, 0.3], "upper": [1, 0.6]}}},
            {"phase": "air", "shape": "rest"},
        ],
        "bodies": {},
    },
    "budget": {
        "phases": {"water": {"density": 1000}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "numerics": {"scheme": "delta_plus"},
    },
}  # fmt: skip


@pytest.mark.parametrize("kind", EXPECTED)
def test_the_case_knows_the_columns(kind):
    gauge = {"type": kind, "interval": 0.1, **WHERE.get(kind, {})}
    case = Case.from_dict({**BLOCK, **SCENE.get(kind, {}), "gauges": {"g": gauge}})
    found = columns_of(case.gauges["g"], case)
    assert "|".join(column.name for column in found) == EXPECTED[kind][0]
    assert {column.unit for column in found} == EXPECTED[kind][1]
    assert column_names("g", case.gauges["g"], case) == ["time", *EXPECTED[kind][0].split("|")]


def test_each_type_of_gauge_has_a_model_columns_and_a_measurement():
    assert set(GAUGES) == set(gauges.GAUGES)
    written = {kind: {"type": kind, "interval": 0.1, **WHERE.get(kind, {})} for kind in GAUGES}
    written["fragments"] |= {"phases": [next(iter(case_of(FULL).phases))]}
    written["elevation"] |= {"places": [[0.1]]}
    written["interface_wave"] |= {"phase": next(iter(case_of(FULL).phases)), "wavelength": 1.0}
    written["points"] |= {"points": [[0.1] * 2]}
    for kind in ("line", "reattachment"):
        written[kind] |= {"from": [0.1] * 2, "to": [0.9] * 2}
    for kind in ("flow_rate", "force_coefficients", "surface_stress", "budget", "lens"):  # needs of their own
        del written[kind]
    case = case_of(FULL, gauges=written, reference={})
    for kind, spec in case.gauges.items():
        made = gauges.GAUGES[kind](kind, spec, case)
        left_out = {Column("elastic", "J/m")} if kind == "energy" else set()  # the sound speeds are chosen by the run
        assert made.columns == [column for column in columns_of(spec, case) if column not in left_out]


def test_a_mirror_adds_a_column():
    case = case_of(FULL, gauges={"g": {"type": "contour", "interval": 0.1, "mirror": "x"}}, reference={})
    names = column_names("g", case.gauges["g"], case)
    assert [name for name in names if name.startswith("asymmetry")] == [f"asymmetry {phase}" for phase in case.phase_names]
