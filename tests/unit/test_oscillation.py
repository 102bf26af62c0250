"""Frequency and height of the wave in the rows of a gauge, and drag of a body against a curve in other units of time."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.unit.test_force_coefficients import case_of
from warpsph.errors import CaseError
from warpsph.study.comparison import compare
from warpsph.study.norms import NotComparable
from warpsph.study.oscillation import wave

CURVES = Path(__file__).parents[2] / "cases" / "reference"


def rows(count=400, span=20.0, seed=3):
    """Times as a run writes them: at the first step after each interval."""
    jitter = np.random.default_rng(seed).uniform(0.0, 0.3, count)
    return (np.arange(count) + jitter) * span / count


@pytest.mark.parametrize("frequency", [0.137, 0.5, 1.93])
def test_a_sine_off_the_lines_of_the_spectrum(frequency):
    times = rows()
    found = wave(times, 7.0 + 0.3 * np.sin(2 * np.pi * frequency * times + 1.0))
    assert found.frequency == pytest.approx(frequency, rel=1e-6)
    assert (found.mean, found.amplitude) == pytest.approx((7.0, 0.3), rel=1e-4)
    assert found.left < 1e-6
    assert found.cycles == pytest.approx(frequency * np.ptp(times))


def test_overtones_belong_to_the_wave():
    """A wave with a steep front is as high as it looks, not as its first sine."""
    times = rows()
    angle = 2 * np.pi * 0.21 * times
    found = wave(times, np.sin(angle) + 0.4 * np.sin(2 * angle) + 0.1 * np.cos(3 * angle))
    fine = np.linspace(0, 2 * np.pi, 100_001)
    whole = np.sin(fine) + 0.4 * np.sin(2 * fine) + 0.1 * np.cos(3 * fine)
    assert found.frequency == pytest.approx(0.21, rel=1e-6)
    assert found.amplitude == pytest.approx(0.5 * np.ptp(whole), rel=1e-4)


def test_noise_changes_it_by_its_share_over_the_root_of_the_rows():
    times = rows(1000)
    noise = 0.3 * np.random.default_rng(1).standard_normal(1000)
    found = wave(times, np.sin(2 * np.pi * 0.4 * times) + noise)
    assert found.frequency == pytest.approx(0.4, rel=5e-3)
    assert found.amplitude == pytest.approx(1.0, abs=4 * 0.3 * np.sqrt(6 / 1000))
    assert found.left == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        (lambda t: np.sin(2 * np.pi * 0.08 * t), "fewer than two cycles"),
        (lambda t: np.ones_like(t), "does not change"),
        (lambda t: np.random.default_rng(2).standard_normal(len(t)), "no wave"),
        (lambda t: np.where(t > 9, np.nan, t), "with numbers"),
    ],
)
def test_what_is_no_wave(values, reason):
    times = rows()
    with pytest.raises(NotComparable, match=reason):
        wave(times, values(times))


def write(folder, name, columns):
    (folder / "gauges").mkdir(exist_ok=True)
    head = ",".join(f"{key} [{'s' if key == 'time' else '1'}]" for key in columns)
    table = np.column_stack(list(columns.values()))
    np.savetxt(folder / "gauges" / f"{name}.csv", table, "%.17g", ",", header=head, comments="")


def entry(reduce, value, column="Cl fin"):
    return {"gauge": "c", "column": column, "reduce": reduce, "window": [5, 20], "value": value, "allowed": 0.02}


def test_a_periodic_stream_against_a_table(tmp_path):
    """Speed 2 m/s, length 0.5 m: a frequency of 0.66 1/s is a Strouhal number of 0.165; drag swings twice as fast."""
    times = rows(2000)
    growth = np.minimum(times / 5.0, 1.0)
    swing = 0.33 * growth * np.sin(2 * np.pi * 0.66 * times)
    drag = 1.34 + 0.01 * growth * np.sin(4 * np.pi * 0.66 * times)
    write(tmp_path, "c", {"time": times, "Cl fin": swing, "Cd fin": drag})
    references = {
        "strouhal": entry("strouhal", 0.165),
        "frequency": entry("frequency", 0.66),
        "lift": entry("amplitude", 0.33),
        "drag": entry("mean", 1.34, "Cd fin"),
        "swing": entry("amplitude", 0.01, "Cd fin"),
    }
    found = compare(case_of(end_time=20, reference=references), tmp_path, end_time=20.0)
    results = {result["quantity"]: result for result in found}
    assert [result["note"] for result in results.values() if result["error"] is None] == []
    assert results["strouhal"]["value"] == pytest.approx(0.165, rel=1e-4)
    assert (results["strouhal"]["unit"], results["frequency"]["unit"]) == ("1", "1/s")
    assert all(abs(result["error"]) < 1e-3 and result["passed"] for result in results.values())
    assert "cycles" in results["lift"]["note"]


@pytest.mark.parametrize(("factor", "passed"), [(1.03, True), (1.08, False)])
def test_drag_against_a_curve_over_the_time_in_radii(tmp_path, factor, passed):
    """R = 0.25 m and U = 2 m/s: T = 8 t. Drag that is 3 % off passes a limit of 5 % of each value over T = 0.2 to 6."""
    name = "j_cylinder_Cd_Re1000_KL.csv"
    known = np.loadtxt(CURVES / name, delimiter=",", skiprows=1)
    known = known[np.argsort(known[:, 0], kind="stable")]
    times = np.linspace(0.001, 0.8, 400)
    drag = factor * np.interp(8 * times, *known.T)
    drag[8 * times < 0.19] = 50.0  # what the window leaves out
    write(tmp_path, "c", {"time": times, "Cd fin": drag})
    (tmp_path / "reference").mkdir()
    shutil.copy(CURVES / name, tmp_path / "reference")
    curve = {"file": f"reference/{name}", "time": "T_Ut_over_R", "value": "Cd", "time_scale": "0.25/2"}
    reference = {"gauge": "c", "column": "Cd fin", "curve": curve, "window": ["0.2/8", "6/8"]}
    reference |= {"relative_to": "pointwise", "allowed": 0.05}
    case = case_of(folder=tmp_path, reference={"drag": reference})
    (result,) = compare(case, tmp_path, end_time=1.0)
    assert result["error"] == pytest.approx(factor - 1.0, rel=1e-6)
    assert result["passed"] is passed


def test_a_strouhal_number_needs_a_length_and_a_speed():
    loads = {"loads": {"type": "wall_force", "interval": 0.1}}
    reference = {"shedding": {"gauge": "loads", "column": "force_y fin", "reduce": "strouhal", "value": 0.2}}
    rule = r"reference\.shedding\.reduce.*needs the length and speed.*loads is one of type wall_force.*use frequency"
    with pytest.raises(CaseError, match=rule):
        case_of(gauges=loads, reference=reference)
