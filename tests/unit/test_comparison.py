"""Errors against references: every norm by hand, files and memory alike; what is not comparable says why."""

import math
from dataclasses import replace

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.files.output import RunFolder
from warpsph.measure.gauges import GaugeSet
from warpsph.snapshot import FLUID, WALL, Snapshot
from warpsph.study.comparison import compare, format_comparison
from warpsph.study.norms import NotComparable, extreme, particle_norm, period
from warpsph.study.results import pick_column

GAUGES = {
    "energy": {"type": "energy", "interval": 0.1},
    "jump": {"type": "phase_pressure", "interval": 0.1},
    "size": {"type": "extents", "interval": 0.1},
    "profile": {
        "type": "line",
        "from": [0.0, -1.0],
        "to": [0.0, 1.0],
        "count": 5,
        "fields": ["velocity"],
        "times": [0.5, 1.0],
    },
}


def make_case(reference, source=None) -> Case:
    return Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": 0.1,
            "end_time": 1.0,
            "domain": {"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
            "phases": {"gas": {"density": 1.0}, "liquid": {"density": 1000.0}},
            "fluids": [
                {"phase": "gas", "shape": {"sphere": {"center": [0, 0], "radius": 0.5}}},
                {"phase": "liquid", "shape": "rest"},
            ],
            "gauges": GAUGES,
            "reference": reference,
        },
        source,
    )


def write_gauge(run, name, text):
    (run / "gauges").mkdir(exist_ok=True, parents=True)
    (run / "gauges" / f"{name}.csv").write_text(text)


def one(case, run=None, **options):
    (result,) = compare(case, run, **options)
    return result


@pytest.fixture
def run(tmp_path):
    """A run folder with hand-made gauges: kinetic = 2 t, gas = 3 + t, liquid = 1."""
    times = [k / 10 for k in range(11)]
    write_gauge(
        tmp_path, "energy", "time [s],kinetic [J/m]\n" + "".join(f"{time},{2 * time}\n" for time in times)
    )
    write_gauge(
        tmp_path,
        "jump",
        "time [s],gas [Pa],liquid [Pa],gas - liquid [Pa]\n"
        + "".join(f"{time},{3 + time},1.0,{2 + time}\n" for time in times),
    )
    write_gauge(
        tmp_path,
        "profile",
        "time [s],x [m],y [m],velocity_x [m/s]\n"
        + "".join(f"{time},0.0,{y},{time * (y + 1)}\n" for time in (0.5, 1.0) for y in (-1, -0.5, 0, 0.5, 1)),
    )
    return tmp_path


# -- one number --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reduce", "value"),
    [("mean", 1.6), ("max", 2.0), ("min", 1.2), ("final", 2.0), ("rms", math.sqrt(13.2 / 5))],
)  # fmt: skip
def test_reductions_in_a_window(run, reduce, value):
    entry = {"gauge": "energy", "column": "kinetic", "reduce": reduce, "window": [0.6, 1.0], "value": 1.5}
    result = one(make_case({"decay": {**entry, "allowed": 0.1, "source": "by hand"}}), run)
    assert result["quantity"] == "decay"
    assert result["value"] == pytest.approx(value)
    assert result["reference"] == 1.5
    assert result["error"] == pytest.approx((value - 1.5) / 1.5)  # signed
    assert result["passed"] is (abs(value - 1.5) / 1.5 <= 0.1)
    assert (result["allowed"], result["unit"], result["source"]) == (0.1, "J/m", "by hand")
    assert result["note"] == ""


def test_negative_references_and_errors(run):
    entry = {"gauge": "energy", "column": "kinetic", "reduce": "final", "value": -2.5, "allowed": 3}
    result = one(make_case({"a": entry}), run)
    assert result["error"] == pytest.approx(-1.8)
    below = one(make_case({"a": {**entry, "value": 4.0, "allowed": 0.1}}), run)
    assert below["error"] == pytest.approx(-0.5)
    assert below["passed"] is False


def test_a_reference_of_zero_gives_the_absolute_error(run):
    entry = {"gauge": "energy", "column": "kinetic", "reduce": "max", "value": 0, "allowed": 3}
    result = one(make_case({"speed": entry}), run)
    assert result["error"] == pytest.approx(2.0)
    assert result["passed"] is True
    assert result["note"].startswith("absolute")


@pytest.mark.parametrize(("column", "value"), [("gas - liquid", 3.0), ("liquid - gas", -3.0), ("gas", 4.0)])
def test_columns_and_arithmetic_of_columns(run, column, value):
    entry = {"gauge": "jump", "column": column, "reduce": "final", "value": 1}
    result = one(make_case({"jump": entry}), run)
    assert result["value"] == pytest.approx(value)
    assert result["unit"] == "Pa"


def test_window_beyond_the_end_is_not_reached(run):
    entry = {"gauge": "energy", "column": "kinetic", "window": [0.5, 1.0], "value": 1, "allowed": 0.1}
    case = make_case({"late": entry})
    rows = (run / "gauges" / "energy.csv").read_text().splitlines(keepends=True)
    (run / "gauges" / "energy.csv").write_text("".join(rows[:9]))  # up to 0.7
    result = one(case, run)
    assert result["value"] is result["error"] is result["passed"] is None
    assert result["note"] == "not reached: needs t = 1 s, the run ended at 0.7 s"
    # The gauge need not have a row at the very end of the run.
    assert one(case, run, end_time=1.0)["value"] == pytest.approx(1.2)
    assert "ended at 0.9 s" in one(case, run, end_time=0.9)["note"]


def test_what_is_missing_becomes_a_note(run):
    case = make_case({"a": {"gauge": "size", "column": "area gas", "value": 1}})
    assert "size.csv: cannot be read" in one(case, run)["note"]
    assert "there is no gauge 'size'" in one(case)["note"]
    case = make_case({"a": {"gauge": "energy", "column": "elastic", "value": 1}})
    assert one(case, run)["note"] == "there is no column 'elastic'; there are time, kinetic"
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n")
    case = make_case({"a": {"gauge": "energy", "column": "kinetic", "value": 1}})
    assert one(case, run)["note"].startswith("not reached")


def test_nan_does_not_pass(run):
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n0.0,nan\n1.0,1.0\n")
    case = make_case({"a": {"gauge": "energy", "column": "kinetic", "value": 1, "allowed": 0.5}})
    result = one(case, run)
    assert math.isnan(result["error"])
    assert result["passed"] is False
    assert "not a finite number" in result["note"]


def test_the_value_farthest_from_the_reference(run):
    entry = {"gauge": "energy", "column": "kinetic", "reduce": "farthest", "window": [0.1, 0.9]}  # 0.2 to 1.8
    assert one(make_case({"a": {**entry, "value": 1.1}}), run)["value"] == pytest.approx(0.2)
    assert one(make_case({"a": {**entry, "value": 0.9}}), run)["value"] == pytest.approx(1.8)
    assert one(make_case({"a": {**entry, "value": 0, "column": "-kinetic"}}), run)["error"] == pytest.approx(-1.8)


def test_the_largest_change_since_the_start(run):
    entry = {"gauge": "energy", "column": "2 - kinetic", "reduce": "change", "value": 0, "allowed": 0.9}  # 2 to 0
    result = one(make_case({"a": entry}), run)
    assert (result["value"], result["unit"], result["passed"]) == (pytest.approx(-1.0), "1", False)
    assert result["note"].startswith("absolute")
    late = one(make_case({"a": {**entry, "window": [0.5, 0.8]}}), run)
    assert late["value"] == pytest.approx(0.4 / 1.0 - 1)
    assert "begins with 0" in one(make_case({"a": {**entry, "column": "kinetic"}}), run)["note"]


@pytest.mark.parametrize(
    ("reduce", "formula", "value", "unit"),
    [
        ("trough", lambda u: 0.3 + 2 * u**2 * (1 + 0.4 * u), 0.3, "J/m"),
        ("trough_time", lambda u: 0.3 + 2 * u**2 * (1 + 0.4 * u), 0.52, "s"),
        ("peak", lambda u: 0.3 - 2 * u**2 * (1 + 0.4 * u), 0.3, "J/m"),
        ("peak_time", lambda u: 0.3 - 2 * u**2 * (1 + 0.4 * u), 0.52, "s"),
        ("peak", lambda u: 0.3 + u, 0.68, "J/m"),  # no turn in the window: its better end
        ("trough_time", lambda u: 0.3 + u, 0.1, "s"),
    ],
)  # fmt: skip
def test_extremes_lie_between_the_rows(run, reduce, formula, value, unit):
    times = [k / 20 for k in range(21)]
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n" + "".join(f"{t},{formula(t - 0.52)}\n" for t in times))
    entry = {"gauge": "energy", "column": "kinetic", "reduce": reduce, "window": [0.1, 0.9], "value": 1.0}
    result = one(make_case({"a": entry}), run)
    assert result["value"] == pytest.approx(value, rel=1e-6)
    assert result["unit"] == unit
    assert ("there" in result["note"]) is reduce.endswith("time")


def test_a_symmetric_peak_is_found_where_it_is():
    """The cubic's first coefficient is rounding alone there, of which the root must not be lost."""
    t = np.linspace(0.05, 0.15, 11)
    assert extreme(t, np.sin(5 * np.pi * t), True)[:2] == pytest.approx((0.1, 1.0), rel=2e-3)
    assert extreme(t, np.full(11, 3.0), True)[1] == pytest.approx(3.0)
    assert extreme(t, 2 * t, False) == pytest.approx((0.05, 0.1, 11))


def test_extremes_are_not_taken_from_the_noise(run):
    noise = np.random.default_rng(0).normal(size=201) * 0.01
    rows = [(k / 200, 1 - (k / 200 - 0.5) ** 2 + noise[k]) for k in range(201)]
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n" + "".join(f"{t},{v}\n" for t, v in rows))
    entry = {"gauge": "energy", "column": "kinetic", "value": 1.0}
    assert one(make_case({"a": {**entry, "reduce": "max"}}), run)["error"] > 0.01
    assert abs(one(make_case({"a": {**entry, "reduce": "peak"}}), run)["error"]) < 0.003
    few = make_case({"a": {**entry, "reduce": "peak", "window": [0.5, 0.52]}})
    assert "eight rows" in one(few, run)["note"]


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_peak_of_a_whole_run_is_that_of_the_rows_around_it(run, noise):
    """A bump a tenth as long as the run: a cubic through all rows is far lower, and the largest row has its noise."""
    t = np.linspace(0, 10, 501)
    v = np.exp(-(((t - 3.21) / 0.5) ** 2)) + 0.3 * np.exp(-((t - 7) ** 2))
    v += noise * np.random.default_rng(1).normal(size=501)
    at, value, rows = extreme(t, v, True)
    assert value == pytest.approx(1.0, abs=0.02) and at == pytest.approx(3.21, abs=0.03) and 8 < rows < 60
    assert extreme(t, -v, False) == pytest.approx((at, -value, rows))
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n" + "".join(f"{a},{b}\n" for a, b in zip(t, v, strict=True)))
    entry = {"gauge": "energy", "column": "kinetic", "reduce": "peak", "value": 1.0}
    result = one(make_case({"a": entry}), run)
    assert result["value"] == pytest.approx(value) and f"by the {rows} rows around it" in result["note"]


def test_a_peak_at_the_end_of_a_run_has_the_rows_before_it():
    t = np.linspace(0, 10, 501)
    assert extreme(t, np.exp(2 * (t - 10)), True)[:2] == pytest.approx((10, 1), rel=0.04)


def test_arithmetic_of_columns_whose_names_have_several_words():
    """`highest_x gas` is part of `highest_x gas liquid`, and `gas - liquid` is arithmetic, not a name in it."""
    names = ("time", "highest_x gas", "highest_x gas liquid", "gas", "liquid", "gas - liquid", "scale")
    columns = dict(zip(names, np.array([[0.0, 5, 70, 11, 13, -2, 0], [1.0, 5, 70, 11, 13, -2, 3]]).T, strict=True))
    units = {name: "m" for name in names[1:-1]} | {"time": "s", "scale": "kg/s"}

    def last(column):
        values, unit = pick_column(columns, units, column)
        return values[-1], unit

    assert last("highest_x gas liquid - highest_x gas") == (65.0, "m")
    assert last("2 * highest_x gas / scale") == (pytest.approx(10 / 3), "")
    assert last("2*gas - liquid")[0] == 9.0  # not 2 * (gas - liquid)
    with pytest.raises(Exception, match="there is no column 'highest_x gasliquid'"):
        pick_column(columns, units, "highest_x gasliquid")


def noise_case(run, times, values, **changes):
    rows = "".join(f"{t},{v}\n" for t, v in zip(times, values, strict=True))
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n" + rows)
    entry = {"gauge": "energy", "column": "kinetic", "reduce": "noise", "span": 0.2, "value": 0, **changes}
    return one(make_case({"a": {**entry, "allowed": 0.01}}), run)


def test_noise_is_what_a_parabola_leaves(run):
    t = np.linspace(0, 1, 101)
    smooth = 3 - 2 * t + 5 * t**2
    assert noise_case(run, t, smooth)["value"] == pytest.approx(0, abs=1e-12)
    # to and fro from row to row: 21 rows and their mean take next to nothing from it
    shaken = noise_case(run, t, smooth + 0.1 * (-1.0) ** np.arange(101))
    assert shaken["value"] == pytest.approx(0.1, rel=0.15)
    assert (shaken["unit"], shaken["passed"]) == ("J/m", False)
    assert shaken["note"] == "absolute error, as the reference is 0; about parabolas of 0.2 s"
    # what swings within a span is noise, the same swing over four spans is not
    fast = noise_case(run, t, smooth + 0.1 * np.sin(2 * np.pi * t / 0.1))["value"]
    slow = noise_case(run, t, smooth + 0.1 * np.sin(2 * np.pi * t / 0.8))["value"]
    assert fast > 0.07 and slow < 2e-4
    # the window cuts what lies before it
    early = np.where(t < 0.3, 0.1 * (-1.0) ** np.arange(101), 0.0)
    assert noise_case(run, t, smooth + early, window=[0.3, 1.0])["value"] == pytest.approx(0, abs=1e-12)


def test_noise_follows_rows_that_are_not_even(run):
    t = np.sort(np.random.default_rng(0).uniform(0, 1, 200))
    assert noise_case(run, t, 3 - 2 * t + 5 * t**2)["value"] == pytest.approx(0, abs=1e-9)


def test_noise_needs_rows_and_numbers(run):
    t = np.linspace(0, 1, 101)
    assert "eight rows within 0.05 s" in noise_case(run, t, t, span=0.05)["note"]
    assert "a window longer than that" in noise_case(run, t, t, span=1.5)["note"]
    assert "not a finite number" in noise_case(run, t, np.where(t > 0.5, np.nan, 1.0))["note"]


@pytest.mark.parametrize(
    ("reduce", "changes", "path", "rule"),
    [
        ("noise", {}, "reference.a.span", "noise needs a span"),
        ("mean", {"span": 1}, "reference.a.span", "belongs to reduce: noise"),
    ],
)
def test_span_belongs_to_noise(reduce, changes, path, rule):
    entry = {"gauge": "energy", "column": "kinetic", "reduce": reduce, "value": 0, **changes}
    with pytest.raises(CaseError) as caught:
        make_case({"a": entry})
    (problem,) = caught.value.problems
    assert problem.path == path and rule in problem.rule and problem.remedy


def test_slope_of_a_part_of_the_last_profile(run):
    """u = t (y + 1), over the distance s = y + 1 from the start: the slope is t."""
    entry = {"gauge": "profile", "column": "velocity_x", "reduce": "slope", "between": [0.4, 1.6], "value": 2.0}
    result = one(make_case({"shear": entry}), run)
    assert result["value"] == pytest.approx(1.0)
    assert result["error"] == pytest.approx(-0.5)
    assert (result["unit"], result["note"]) == ("m/s/m", "at t = 1 s")
    assert one(make_case({"shear": {**entry, "window": [0, 0.6]}}), run, end_time=1.0)["value"] == pytest.approx(0.5)
    rows = "time [s],x [m],y [m],velocity_x [m/s]\n" + "".join(f"1,0,{y},{y * abs(y)}\n" for y in (-1, -0.5, 0, 0.5, 1))
    write_gauge(run, "profile", rows)
    half = {**entry, "value": 1.0}
    # of a parabola the slope in the middle of the part: 2 s at s = 0.5 on either side
    assert one(make_case({"shear": {**half, "between": [1.0, 2.0]}}), run)["value"] == pytest.approx(1.0)
    assert one(make_case({"shear": {**half, "between": [0.0, 0.5]}}), run)["value"] == pytest.approx(1.5)
    assert "no two points" in one(make_case({"shear": {**half, "between": [0.6, 0.9]}}), run)["note"]


# -- curves over time --------------------------------------------------------------------------------------


def curve_case(run, rows, **changes):
    (run / "ref.csv").write_text("t_ms,KE,note\n" + rows)
    curve = {"file": "ref.csv", "time": "t_ms", "value": "KE", "scale": 2.0, "time_scale": 1e-3}
    entry = {"gauge": "energy", "column": "kinetic", "curve": curve, **changes}
    return make_case({"decay": entry}, run)


# Twice the reference's values: 0.4 + 2 t at all times up to 0.5, where the curve ends; the run has 2 t.
LINE = "0,0.2,\n250,0.45,\n500,0.7,\n"


@pytest.mark.parametrize(
    ("norm", "relative_to", "error"),
    [
        ("max", "peak", 0.4 / 1.4),
        ("max", "initial", 1.0),
        ("max", "pointwise", 1.0),
        ("rms", "peak", 0.4 / 1.4),
        ("rms", "pointwise", math.sqrt(np.mean([(0.4 / (0.4 + 0.2 * k)) ** 2 for k in range(6)]))),
        ("final", "peak", 0.4 / 1.4),
        ("final", "initial", 1.0),
        ("final", "pointwise", 0.4 / 1.4),
        ("max", "absolute", 0.4),
        ("rms", "absolute", 0.4),
    ],
)
def test_curve_norms(run, norm, relative_to, error):
    result = one(curve_case(run, LINE, norm=norm, relative_to=relative_to, allowed=0.5), run)
    assert result["error"] == pytest.approx(error)
    assert result["passed"] is (error <= 0.5)
    assert "compared over 0 to 0.5 s" in result["note"]
    assert result["unit"] == "J/m"
    if norm == "final":
        assert (result["value"], result["reference"]) == (pytest.approx(1.0), pytest.approx(1.4))


def test_curve_in_a_window(run):
    """Off by 0.4 at all times: 0.4 of 0.4 + 2 t is the largest share where t is smallest."""
    entry = {"relative_to": "pointwise", "window": [0.2, 0.4]}
    result = one(curve_case(run, LINE, **entry), run)
    assert result["error"] == pytest.approx(0.4 / 0.8)
    assert result["note"] == "compared over 0.2 to 0.4 s, largest at 0.2 s"
    short = one(curve_case(run, LINE, **entry), run, end_time=0.3)
    assert short["error"] is None
    assert short["note"] == "not reached: needs t = 0.4 s, the run ended at 0.3 s"


@pytest.mark.parametrize(
    ("reduce", "value", "reference"),
    # the run has 2 t and the curve 0.4 + 2 t, at 0.2, 0.3, 0.4 s
    [
        ("mean", 0.6, 1.0),
        ("max", 0.8, 1.2),
        ("min", 0.4, 0.8),
        ("final", 0.8, 1.2),
        ("rms", math.sqrt(1.16 / 3), math.sqrt(3.08 / 3)),
    ],
)
def test_curve_and_column_reduced_in_the_same_way(run, reduce, value, reference):
    result = one(curve_case(run, LINE, reduce=reduce, window=[0.2, 0.4], allowed=0.1), run)
    assert (result["value"], result["reference"]) == (pytest.approx(value), pytest.approx(reference))
    assert result["error"] == pytest.approx(value / reference - 1)  # signed
    assert (result["unit"], result["passed"]) == ("J/m", False)
    assert result["note"] == "over 0.2 to 0.4 s"
    absolute = one(curve_case(run, LINE, reduce=reduce, window=[0.2, 0.4], relative_to="absolute"), run)
    assert absolute["error"] == pytest.approx(value - reference)
    assert absolute["note"].startswith("absolute")


def test_periods_and_peaks_of_a_curve(run):
    """The run swings with the period 0.4 s about its mean, the curve with 0.5 s and half the height."""
    t = np.linspace(0, 1, 101)
    swing = np.sin(2 * np.pi * t / 0.4)
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n" + "".join(f"{a},{b}\n" for a, b in zip(t, swing, strict=True)))
    known = 0.25 * np.sin(2 * np.pi * t / 0.5 + 0.3)  # a factor of 2 is in the case
    rows = "".join(f"{1000 * a},{b},\n" for a, b in zip(t, known, strict=True))
    result = one(curve_case(run, rows, reduce="period"), run)
    assert (result["value"], result["unit"]) == (pytest.approx(0.4, rel=1e-3), "s")
    assert result["reference"] == pytest.approx(0.5, rel=1e-3)
    peak = {"window": [0.05, 0.15]}
    highest = one(curve_case(run, rows, reduce="peak", **peak), run)
    assert (highest["value"], highest["reference"]) == (pytest.approx(1.0, rel=2e-3), pytest.approx(0.5, rel=2e-3))
    assert highest["note"].startswith("over 0.05 to 0.15 s; at 0.1 s")
    time = one(curve_case(run, rows, reduce="peak_time", **peak), run)
    assert (time["value"], time["unit"]) == (pytest.approx(0.1, rel=1e-3), "s")
    assert time["reference"] == pytest.approx(0.5 * (0.25 - 0.3 / (2 * np.pi)), rel=1e-2)


def test_noise_of_a_curve_and_of_the_column(run):
    """From row to row the run jumps by 0.1 to either side of a parabola, the curve by 0.05 (the case has a factor of 2)."""
    t = np.linspace(0, 1, 101)
    jumps = (-1.0) ** np.arange(101)
    rows = "".join(f"{a},{b}\n" for a, b in zip(t, 1 + t * t + 0.1 * jumps, strict=True))
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n" + rows)
    known = "".join(f"{1000 * a},{b},\n" for a, b in zip(t, 3 - 2 * t + 0.025 * jumps, strict=True))
    result = one(curve_case(run, known, reduce="noise", span=0.2, window=[0.1, 0.9]), run)
    assert result["error"] == pytest.approx(1.0, abs=1e-6)
    assert result["value"] == pytest.approx(0.1, rel=0.15)
    assert "about parabolas of 0.2 s" in result["note"]
    sparse = "".join(f"{a},{a},\n" for a in range(0, 1001, 40))  # five points within 0.2 s
    result = one(curve_case(run, sparse, reduce="noise", span=0.2), run)
    assert result["error"] is None and "points within 0.2 s: noise needs eight" in result["note"]


@pytest.mark.parametrize(
    ("changes", "rule"), [({"reduce": "noise"}, "needs a span"), ({"span": 1}, "belongs to reduce: noise")]
)
def test_span_of_a_curve_belongs_to_noise(run, changes, rule):
    with pytest.raises(CaseError, match=f"reference.decay.span.*{rule}"):
        curve_case(run, LINE, **changes)


def test_a_curve_that_does_not_cover_the_window_is_not_reduced(run):
    """The curve ends at 0.5 s."""
    short = one(curve_case(run, LINE, reduce="mean", window=[0.2, 0.9]), run)
    assert short["note"] == "ref.csv does not cover the window: 0.2 to 0.5 s of it alone"
    late = one(curve_case(run, "300,0.1,\n1000,1,\n", reduce="mean", window=[0.0, 0.9]), run)
    assert "does not cover the window" in late["note"]
    zero = one(curve_case(run, "0,0,\n1000,0,\n", reduce="mean"), run)
    assert zero["error"] is None and "relative_to: absolute" in zero["note"]


@pytest.mark.parametrize(("key", "value"), [("norm", "rms"), ("relative_to", "pointwise")])
def test_reduce_leaves_no_room_for_norms(run, key, value):
    with pytest.raises(CaseError) as caught:
        curve_case(run, LINE, reduce="mean", **{key: value})
    (problem,) = caught.value.problems
    assert problem.path == f"reference.decay.{key}" and "with reduce" in problem.rule
    # a resolved case, which holds all defaults, stays valid
    case = curve_case(run, LINE, reduce="mean")
    assert Case.from_dict(case.to_dict(defaults=True), run).reference["decay"].reduce == "mean"


def test_an_absolute_error_is_told_in_its_unit(run):
    case = curve_case(run, LINE, relative_to="absolute", allowed=0.3)
    assert one(case, run)["note"].startswith("absolute error; compared over 0 to 0.5 s")
    (line,) = format_comparison(compare(case, run))
    assert "error 0.4 J/m (allowed 0.3 J/m, EXCEEDED)" in line


def test_curve_names_the_worst_place(run):
    result = one(curve_case(run, "0,0,\n300,0.3,\n301,9,\n399,9,\n400,0.4,\n1000,1.0,\n"), run)
    assert result["error"] == pytest.approx(0, abs=1e-12)  # the gauge has no row where the curve is off
    result = one(curve_case(run, "0,0,\n300,0.3,\n400,0.7,\n500,0.5,\n1000,1.0,\n"), run)
    assert (result["value"], result["reference"]) == (pytest.approx(0.8), pytest.approx(1.4))
    assert result["error"] == pytest.approx(0.6 / 2.0)
    assert "largest at 0.4 s" in result["note"]


def test_curve_rows_may_be_out_of_order_or_empty(run):
    result = one(curve_case(run, "1000,1.0,\n0,0,\n500,,\n200,0.2,x\n"), run)
    assert result["error"] == pytest.approx(0, abs=1e-12)


def test_curve_that_cannot_be_compared(run):
    assert one(curve_case(run, "5000,1,\n6000,1,\n"), run)["note"].startswith(
        "not reached: the reference begins at 5 s"
    )
    assert "peak value is 0" in one(curve_case(run, "0,0,\n1000,0,\n"), run)["note"]
    assert "0 everywhere" in one(curve_case(run, "0,0,\n1000,0,\n", relative_to="pointwise"), run)["note"]
    case = curve_case(run, LINE)
    (run / "ref.csv").write_text("a,b\n1,2\n")
    assert one(case, run)["note"] == "ref.csv has no column 't_ms'; it has a, b"
    (run / "ref.csv").unlink()
    assert "ref.csv cannot be read" in one(case, run)["note"]


# -- profiles ----------------------------------------------------------------------------------------------


def profile_case(run, text, columns, **changes):
    (run / "profile.csv").write_text(text)
    curves = {"file": "profile.csv", "position": "y", "columns": columns, "scale": 1e-3}
    entry = {"gauge": "profile", "column": "velocity_x", "curves": curves, **changes}
    return make_case({"profile": entry}, run)


# mm/s over the distance s from the line's start: exactly s/2 at 0.5 s; s with 0.1 m/s more at s = 1 at 1 s.
PROFILES = "y,u=0.5,u=1\n0,0,0\n1,500,1100\n2,1000,2000\n"


def test_profiles_at_two_times(run):
    columns = {0.5: "u=0.5", 1.0: "u=1"}
    result = one(profile_case(run, PROFILES, columns, allowed=0.01), run)
    assert result["error"] == pytest.approx(0.1 / 2.0)
    assert (result["value"], result["reference"]) == (pytest.approx(1.0), pytest.approx(1.1))
    assert result["passed"] is False
    assert "at 0.5 s, 5 % at 1 s" in result["note"]
    assert "largest at 1 m along the line" in result["note"]
    differences = np.array([0, 0.05, 0.1, 0.05, 0])
    cases = [
        ({"norm": "rms"}, math.sqrt(np.mean((differences / 2) ** 2))),
        ({"norm": "final"}, math.sqrt(np.mean((differences / 2) ** 2))),
        ({"relative_to": "pointwise"}, 0.1 / 1.1),
        ({"relative_to": "initial"}, 0.1 / 1.0),
        ({"relative_to": "absolute"}, 0.1),
    ]
    for changes, error in cases:
        assert one(profile_case(run, PROFILES, columns, **changes), run)["error"] == pytest.approx(error)


def test_final_profile_alone(run):
    """The first profile is wrong, the last one right."""
    text = "y,u=0.5,u=1\n0,0,0\n1,900,1000\n2,1000,2000\n"
    columns = {0.5: "u=0.5", 1.0: "u=1"}
    assert one(profile_case(run, text, columns, norm="rms"), run)["error"] > 0.1
    result = one(profile_case(run, text, columns, norm="final"), run)
    assert result["error"] == pytest.approx(0, abs=1e-12)
    assert result["value"] == pytest.approx(math.sqrt(np.mean(np.array([0, 0.5, 1, 1.5, 2]) ** 2)))


def test_profiles_of_a_short_run(run):
    rows = (run / "gauges" / "profile.csv").read_text().splitlines(keepends=True)
    (run / "gauges" / "profile.csv").write_text("".join(rows[:6]))
    both = {0.5: "u=0.5", 1.0: "u=1"}
    result = one(profile_case(run, PROFILES, both, allowed=0.01), run, end_time=0.7)
    assert result["error"] == pytest.approx(0, abs=1e-12)
    assert "no rows at 1 s" in result["note"]
    result = one(profile_case(run, PROFILES, {1.0: "u=1"}), run, end_time=0.7)
    assert result["error"] is None
    assert result["note"] == "not reached: needs t = 1 s, the run ended at 0.7 s"
    case = profile_case(run, PROFILES, both)
    (run / "profile.csv").write_text("y,u=0.5\n0,0\n")
    assert "has no column 'u=1'" in one(case, run)["note"]


def test_profile_points_beyond_the_reference_are_left_out(run):
    result = one(profile_case(run, "y,u=0.5\n0.5,250\n1.5,750\n", {0.5: "u=0.5"}), run)
    assert result["error"] == pytest.approx(0, abs=1e-12)
    assert result["note"].endswith(" m along the line")


# -- particles ---------------------------------------------------------------------------------------------


def make_particles(at=0.5) -> Snapshot:
    """Four fluid particles and a wall particle that must not count."""
    position = np.array([[0.1, 0.2], [0.3, -0.4], [-0.5, 0.6], [0.7, 0.8], [1.0, 1.0]])
    n = len(position)
    return Snapshot(
        time=at,
        step=5,
        dt=0.1,
        dimension=2,
        position=position,
        velocity=np.array([[3.0, 4.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0], [99.0, 99.0]]),
        density=np.full(n, 1000.0),
        pressure=np.array([1.0, 2.0, 3.0, 6.0, 99.0]),
        mass=np.ones(n),
        volume=np.array([1.0, 1.0, 1.0, 2.0, 9.0]),
        phase=np.array([0, 0, 0, 0, -1], np.int32),
        particle_id=np.arange(n),
        kind=np.array([FLUID] * 4 + [WALL], np.uint8),
        particle_spacing=0.1,
    )


def exact_case(**entry):
    return make_case({"l1": {"particles": "last", **entry}})


def test_l1_of_the_speed():
    particles = make_particles()
    case = exact_case(field="speed", exact="2*exp(-t) + x", norm="l1", allowed=0.5)
    result = one(case, snapshot=particles)
    exact = 2 * math.exp(-0.5) + particles.position[:4, 0]
    speed = np.array([5.0, 1.0, 1.0, 0.0])
    assert result["error"] == pytest.approx(np.mean(np.abs(speed - exact)) / np.mean(np.abs(exact)))
    assert result["value"] == pytest.approx(1.75)
    assert result["reference"] == pytest.approx(np.mean(exact))
    assert (result["unit"], result["note"]) == ("m/s", "at t = 0.5 s")


@pytest.mark.parametrize("norm", ["l1", "l2", "max"])
def test_norms_of_a_vector(norm):
    particles = make_particles()
    result = one(exact_case(field="velocity", exact=["y", "-x + t"], norm=norm), snapshot=particles)
    x, y = particles.position[:4].T
    exact = np.stack([y, -x + 0.5], axis=1)
    difference = np.linalg.norm(particles.velocity[:4] - exact, axis=1)
    length = np.linalg.norm(exact, axis=1)
    expected = {
        "l1": difference.mean() / length.mean(),
        "l2": math.sqrt((difference**2).sum() / (length**2).sum()),
        "max": difference.max() / length.max(),
    }
    assert result["error"] == pytest.approx(expected[norm])


def test_mean_over_the_volume_is_absolute():
    """Each particle counts with its volume, and a reference of 0 changes nothing."""
    particles = make_particles()
    particles.volume[:4] = [1.0, 2.0, 3.0, 4.0]
    case = exact_case(field="pressure", exact="10*x**2", norm="l1_volume", allowed=1e-3)
    result = one(case, snapshot=particles)
    wrong = np.abs(particles.pressure[:4] - 10 * particles.position[:4, 0] ** 2)
    assert result["error"] == pytest.approx((wrong * [0.1, 0.2, 0.3, 0.4]).sum())
    assert result["note"].startswith("absolute") and result["passed"] is False


def test_pressure_with_and_without_its_mean():
    particles = make_particles()
    fluid = particles.fluid
    exact = 10 * fluid.position[:, 0] ** 2
    case = exact_case(field="pressure", exact="10*x**2", norm="l2")
    expected = math.sqrt(np.sum((fluid.pressure - exact) ** 2) / np.sum(exact**2))
    assert one(case, snapshot=particles)["error"] == pytest.approx(expected)

    class WithoutMean:
        """The same entry with remove_mean."""

        def __getattr__(self, name):
            return True if name == "remove_mean" else getattr(case.reference["l1"], name)

    stand_in = type("Case", (), {"reference": {"p": WithoutMean()}, "dimension": 2})()
    result = one(stand_in, snapshot=particles)
    p = fluid.pressure - np.average(fluid.pressure, weights=fluid.volume)
    q = exact - np.average(exact, weights=fluid.volume)
    assert result["error"] == pytest.approx(math.sqrt(np.sum((p - q) ** 2) / np.sum(q**2)))
    assert "without the means" in result["note"]


def test_exact_rest_gives_the_absolute_error():
    result = one(exact_case(field="speed", exact=0, norm="max", allowed=6), snapshot=make_particles())
    assert result["error"] == 5.0
    assert result["passed"] is True
    assert result["note"].startswith("absolute")


def test_particles_come_from_the_last_frame(tmp_path):
    case = exact_case(field="pressure", exact="t", norm="max")
    with RunFolder(tmp_path / "run") as folder:
        folder.write_particles(make_particles(0.25))
        folder.write_particles(make_particles(0.5))
    result = one(case, folder.path)
    assert result["error"] == pytest.approx(5.5 / 0.5)
    assert "no particles were written" in one(case, tmp_path)["note"]
    assert one(case)["note"] == "there are no particles"


def test_formula_without_a_finite_value_becomes_a_note():
    result = one(exact_case(field="speed", exact="1/(x - 0.3)", norm="l1"), snapshot=make_particles())
    assert result["error"] is None
    assert "has no finite value" in result["note"]


def test_particle_norm_of_equal_fields_is_zero():
    values = np.random.default_rng(1).normal(size=(9, 2))
    for norm in ("l1", "l2", "max"):
        assert particle_norm(values, values, norm)[0] == 0.0


# -- an interface ------------------------------------------------------------------------------------------


def interface_case(folder, **changes):
    """Gas inside of the diamond |x| + |y| < 1.05 of the file, whose unit is 2.1 m and of which the right half is stored."""
    (folder / "line.csv").write_text("x1,y1,x2,y2\n0,0.5,0.5,0\n0.5,0,0,-0.5\n")
    line = {"file": "line.csv", "time": 0.5, "scale": 2.1, "mirror": 0.0, **changes.pop("line", {})}
    return make_case({"shape": {"phase": "gas", "interface": line, **changes}}, folder)


def filled(lower=(-1, -1), upper=(1, 1), spacing=0.1, at=0.5) -> Snapshot:
    """Cells of a box, each with a particle in the middle; gas where |x| + |y| < 1.05, liquid elsewhere."""
    axes = [np.arange(low + spacing / 2, high, spacing) for low, high in zip(lower, upper, strict=True)]
    position = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    n = len(position)
    phase = np.where(np.abs(position).sum(axis=1) < 1.05, 0, 1).astype(np.int32)
    return Snapshot(
        time=at, step=5, dt=0.1, dimension=2, position=position, velocity=np.zeros((n, 2)), density=np.full(n, 1000.0),
        pressure=np.zeros(n), mass=np.full(n, 1000 * spacing**2), volume=np.full(n, spacing**2), phase=phase,
        particle_id=np.arange(n), kind=np.full(n, FLUID, np.uint8), particle_spacing=spacing,
    )  # fmt: skip


def test_area_on_the_wrong_side_of_an_interface(tmp_path):
    particles = filled()
    assert one(interface_case(tmp_path), snapshot=particles)["error"] == 0.0
    gas, liquid = np.flatnonzero(particles.phase == 0), np.flatnonzero(particles.phase == 1)
    particles.phase[[gas[0], gas[5], liquid[3]]] = [1, 1, 0]
    result = one(interface_case(tmp_path, allowed=0.005), snapshot=particles)
    assert (result["value"], result["reference"], result["unit"]) == (pytest.approx(0.03), pytest.approx(4.0), "m^2")
    assert result["error"] == pytest.approx(0.03 / 4)
    assert result["passed"] is False
    assert result["note"] == "of the area of all fluid at t = 0.5 s; 67 % of it where gas should be"
    against_gas = one(interface_case(tmp_path, relative_to="phase"), snapshot=particles)
    assert against_gas["reference"] == pytest.approx(0.01 * len(gas))
    assert against_gas["error"] == pytest.approx(0.03 / (0.01 * len(gas)))
    # moved to the right, the diamond leaves gas behind
    moved = interface_case(tmp_path, line={"offset": [0.8, 0.0], "mirror": 0.8})
    assert one(moved, snapshot=filled())["value"] > 0.5


def test_fluid_that_is_missing_is_on_the_wrong_side_too(tmp_path):
    """Of a hole, and of a drop that shrank, no particle is where it should not be."""
    whole = filled()
    hole = np.abs(whole.position).max(axis=1) < 0.4  # 8 x 8 particles
    result = one(interface_case(tmp_path), snapshot=whole.select(~hole))
    assert result["value"] == pytest.approx(0.64, rel=0.1)
    assert result["note"].endswith("100 % of it where gas should be, 100 % without any fluid")
    # 0.36 m^2 of this hole lie in the gas, the rest in the liquid, where the interface does not say what should be
    aside = np.abs(whole.position - (0.5, 0.5)).max(axis=1) < 0.4
    assert one(interface_case(tmp_path), snapshot=whole.select(~aside))["value"] == pytest.approx(0.36, rel=0.1)
    # one particle of a lattice leaves no gap that counts; what a body takes is not missing
    assert one(interface_case(tmp_path), snapshot=whole.select(np.arange(len(whole)) != 210))["error"] == 0.0
    whole.kind[hole] = WALL
    assert one(interface_case(tmp_path), snapshot=whole)["value"] == 0.0


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_patch_with_a_free_surface_against_its_outline(tmp_path, noise):
    """Its own outline, and one that is a tenth longer to the right."""
    (tmp_path / "square.csv").write_text("x1,y1,x2,y2\n-.5,-.5,.5,-.5\n.5,-.5,.5,.5\n.5,.5,-.5,.5\n-.5,.5,-.5,-.5\n")
    data = make_case({}, tmp_path).to_dict()
    data["domain"]["boundary"] = {"x": "open", "y": "open"}
    data["particle_spacing"] = 0.02
    data["phases"] = {"liquid": {"density": 1000.0}}
    data["fluids"] = [{"phase": "liquid", "shape": {"box": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5]}}}]
    line = {"file": "square.csv", "time": 0.5}
    data["reference"] = {"outline": {"phase": "liquid", "interface": line, "relative_to": "domain"}}
    case = Case.from_dict(data, tmp_path)
    patch = filled((-0.5, -0.5), (0.5, 0.5), spacing=0.02)
    patch.phase[:] = 0
    patch.position += 0.02 * noise * np.random.default_rng(1).uniform(-1, 1, patch.position.shape)
    assert one(case, snapshot=patch)["error"] < (0.008 if noise else 1e-9)  # 0.1 spacings along the outline
    short = patch.select(patch.position[:, 0] < 0.4)
    result = one(case, snapshot=short)
    assert result["value"] == pytest.approx(0.1, rel=0.05)
    assert result["error"] == pytest.approx(0.1 / 0.9, rel=0.05)
    patch.position[:, 0] *= 1.2  # beyond the outline instead: the particles there count
    assert one(case, snapshot=patch)["error"] == pytest.approx(0.2 / 1.2, rel=0.1)


@pytest.mark.parametrize("side", ["wall", "periodic"])
def test_nothing_is_missing_beyond_a_side(tmp_path, side):
    (tmp_path / "low.csv").write_text("x1,y1,x2,y2\n-1,0,1,0\n")
    data = make_case({"low": {"phase": "liquid", "interface": {"file": "low.csv", "time": 0.5}}}, tmp_path).to_dict()
    data["domain"]["boundary"] = {"x": side, "y": "wall"}
    particles = filled()
    particles.phase[:] = np.where(particles.position[:, 1] < 0, 1, 0)
    particles.position *= 0.995  # compressed by half of what a column of particles takes
    assert one(Case.from_dict(data, tmp_path), snapshot=particles)["value"] == 0.0


def test_an_interface_needs_the_particles_of_its_time(tmp_path):
    case = interface_case(tmp_path)
    with RunFolder(tmp_path / "run") as folder:
        for time in (0.25, 0.5, 0.75):
            particles = filled(at=time)
            particles.phase[:3] = 0 if time == 0.5 else 1
            folder.write_particles(particles)
    area = 3 * 0.01
    assert one(case, folder.path)["value"] == pytest.approx(area)
    assert one(case, frames=folder.path, snapshot=filled(at=0.75))["value"] == pytest.approx(area)
    late = interface_case(tmp_path, line={"time": 2.0})
    assert one(late, folder.path)["note"] == "not reached: needs t = 2 s, the run ended at 0.75 s"
    between = interface_case(tmp_path, line={"time": 0.4})
    assert one(between, folder.path)["note"] == "there is no particle file of t = 0.4 s"
    assert one(case, snapshot=filled(at=0.4))["note"] == "there is no particle file of t = 0.5 s"
    (tmp_path / "line.csv").write_text("a,b\n1,2\n")
    assert "line.csv" in one(case, folder.path)["note"]


def test_walls_in_the_files_are_not_missing(tmp_path):
    particles = filled()
    particles.kind[np.abs(particles.position).max(axis=1) < 0.4] = WALL
    with RunFolder(tmp_path / "run") as folder:
        folder.write_particles(particles)
        folder.write_particles(replace(particles, time=0.75))
    assert one(interface_case(tmp_path), folder.path)["value"] == 0.0
    assert one(interface_case(tmp_path, line={"time": 0.75}), folder.path)["value"] == 0.0


# -- ways moved --------------------------------------------------------------------------------------------


def test_the_error_of_a_place_is_one_of_the_way_moved(run):
    entry = {"gauge": "jump", "column": "gas", "reduce": "final", "value": 4.2, "moved_from": 3.2, "allowed": 0.1}
    result = one(make_case({"place": entry}), run)  # 4 instead of 4.2: 4.8 % of the coordinate
    assert result["error"] == pytest.approx(-0.2)
    assert result["passed"] is False and result["note"] == "of the way of 1 Pa"
    back = one(make_case({"place": {**entry, "moved_from": 5.2}}), run)
    assert back["error"] == pytest.approx(-0.2)  # too low, whichever way it went


def test_a_curve_of_a_place_is_compared_by_the_way_moved(run, tmp_path):
    (tmp_path / "way.csv").write_text("t,x\n0,3\n1,5\n")
    curve = {"file": "way.csv", "time": "t", "value": "x"}
    entry = {"gauge": "jump", "column": "gas", "curve": curve, "moved_from": 3, "norm": "max"}
    result = one(make_case({"way": entry}, tmp_path), run)
    assert (result["value"], result["reference"], result["error"]) == (4.0, 5.0, pytest.approx(0.5))
    assert result["note"] == "compared over 0 to 1 s, of the way of 2 Pa, largest at 1 s"
    half = one(make_case({"way": {**entry, "window": [0, 0.5]}}, tmp_path), run)
    assert half["error"] == pytest.approx(0.5)  # of the way within the window
    rms = one(make_case({"way": {**entry, "norm": "rms"}}, tmp_path), run)
    assert rms["error"] == pytest.approx(np.sqrt(np.mean((np.arange(11) / 10) ** 2)) / 2)
    reduced = one(make_case({"way": {**entry, "reduce": "final"}}, tmp_path), run)
    assert reduced["error"] == pytest.approx(-0.5)
    (tmp_path / "way.csv").write_text("t,x\n0,3\n1,3\n")
    assert "stays at 3" in one(make_case({"way": entry}, tmp_path), run)["note"]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"moved_from": 1.5}, "place.moved_from: 1.5 -> is the reference itself"),
        ({"value": None, "curve": {"file": "way.csv", "time": "t", "value": "x"}, "relative_to": "absolute"},
         "place.relative_to: absolute -> with moved_from the error is divided by the way moved"),
    ],
)  # fmt: skip
def test_a_way_moved_that_is_none_is_refused(tmp_path, changes, complaint):
    (tmp_path / "way.csv").write_text("t,x\n0,3\n1,5\n")
    entry = {"gauge": "jump", "column": "gas", "value": 1.5, "moved_from": 1, **changes}
    with pytest.raises(CaseError) as caught:
        make_case({"place": {key: value for key, value in entry.items() if value is not None}}, tmp_path)
    assert complaint in str(caught.value)


# -- from memory, and as text ------------------------------------------------------------------------------


def test_gauges_in_memory_count_before_files(run):
    entry = {"gauge": "energy", "column": "kinetic", "reduce": "final", "value": 1}
    case = make_case({"decay": entry})
    with GaugeSet(case) as gauges:
        gauges.record(make_particles(0.0))
        assert one(case, run, gauges=gauges)["value"] == pytest.approx(0.5 * 27)
    assert one(case, run)["value"] == pytest.approx(2.0)


def test_rows_before_a_restart_are_missed(run):
    """What a number takes from the whole run or a window is no such number without their first rows."""
    late = [f"{k / 10},{0.2 * k}\n" for k in range(4, 11)]
    write_gauge(run, "energy", "time [s],kinetic [J/m]\n" + "".join(late))
    entry = {"gauge": "energy", "column": "kinetic", "reduce": "mean", "value": 1}
    for part in ({}, {"window": [0.3, 0.8]}, {"reduce": "change"}):
        result = one(make_case({"mean": {**entry, **part}}), run)
        assert result["error"] is None and "to 0.4 s: the run goes on from a checkpoint" in result["note"]
    assert one(make_case({"mean": {**entry, "window": [0.4, 0.8]}}), run)["value"] == pytest.approx(1.2)
    assert one(make_case({"mean": {**entry, "window": [0.31, 0.8]}}), run)["value"] == pytest.approx(1.2)
    assert one(make_case({"end": {**entry, "reduce": "final"}}), run)["value"] == pytest.approx(2.0)


def test_text_of_the_results(run):
    case = make_case(
        {
            "jump": {
                "gauge": "jump",
                "column": "gas - liquid",
                "reduce": "final",
                "value": 2,
                "allowed": 0.03,
            },
            "rest": {"gauge": "energy", "column": "kinetic", "reduce": "max", "value": 0, "allowed": 3},
            "late": {"gauge": "energy", "column": "kinetic", "window": [0, 1.0], "value": 1},
        }
    )
    lines = format_comparison(compare(case, run, end_time=0.5))
    assert lines[0] == "jump: 3 Pa, reference 2 Pa, error 50 % (allowed 3 %, EXCEEDED)"
    assert lines[1].startswith("rest: 2 J/m, reference 0 J/m, error 2 J/m (allowed 3 J/m); absolute error")
    assert lines[2] == "late: not reached: needs t = 1 s, the run ended at 0.5 s"
    assert compare(make_case({})) == []


def test_period_is_the_time_between_upward_crossings():
    times = np.linspace(0.0, 10.0, 401)
    values = 3.0 + np.exp(-0.05 * times) * np.cos(2.0 * np.pi * times / 2.5)
    assert period(times, values) == pytest.approx(2.5, rel=5e-3)


def test_what_a_window_lacks_for_a_period_is_said():
    """How often the column crosses its mean, and what to do; numbers that are none were said to be too few periods."""
    times = np.linspace(0.0, 3.0, 61)
    values = np.cos(2.0 * np.pi * times / 2.5)
    with pytest.raises(NotComparable, match=r"upwards 1 times from 0 to 3 s.*two crossings.*longer window"):
        period(times, values)
    with pytest.raises(NotComparable, match="not a finite number"):
        period(times, np.where(times > 1.0, np.nan, values))
