"""Signals: what a case file says, pieces that stand for a formula or a table, and what a device makes of them."""

import math

import numpy as np
import pytest
import warp as wp

from tests.helpers import quiet_warp
from tests.scenes import LEAN, case_of
from warpsph import CaseError
from warpsph.case.derivatives import jet_of
from warpsph.case.expressions import compile_expression
from warpsph.case.signals import FormulaSignal, TableSignal, bound_to, signals_of
from warpsph.kernels.core.time_signals import make_signal_at
from warpsph.scene import signal_tables
from warpsph.scene.signal_tables import ACCELERATION, TOLERANCE, VALUE, joined, pieces_of

quiet_warp()


def signal(text: str) -> FormulaSignal:
    return FormulaSignal(compile_expression(text, names=("t",)))


SMOOTH = ["sin(2*pi*t)", "t**3 - 2*t", "exp(-t)*cos(3*t)", "tanh(99*(t - 1.3))", "1000 + sin(t)", "1/(2.5 - t)"]
SMOOTH += ["sin(99*t)", "1 - cos(2*t)"]
OTHERS = ["2**t", "t**t", "arctan2(sin(t), 1 + t)", "hypot(t, 2)", "log(1 + t)", "sqrt(1 + t)", "cosh(t) - sinh(t)*tan(t/5)"]
CHOSEN = ["abs(t - 1)", "where(t < 1, t**2, 2*t - 1)", "minimum(t, 1)", "maximum(t, 1)", "t % 0.7", "t // 0.5", "(t<1)*t"]


@pytest.mark.parametrize("text", [*SMOOTH, *OTHERS, *CHOSEN])
def test_derivatives_are_exact(text):
    """Against differences of the formula, at points away from kinks."""
    t, h = np.array([0.31, 0.83, 1.57, 2.21]), 1e-4
    expression = compile_expression(text, names=("t",))

    def f(x):
        return expression.evaluate(t=x)

    value, first, second, rounding = jet_of(expression, "t", t)
    size = 1.0 + np.abs(second).max()
    assert (np.abs(value - f(t)) <= rounding).all() and (rounding < 1e-13 * (size + np.abs(value))).all()
    np.testing.assert_allclose(first, (8 * (f(t + h) - f(t - h)) - f(t + 2 * h) + f(t - 2 * h)) / (12 * h), atol=1e-7 * size)
    np.testing.assert_allclose(second, (f(t + h) - 2 * f(t) + f(t - h)) / h**2, atol=2e-3 * size)


@pytest.mark.parametrize("text", SMOOTH)
def test_pieces_keep_value_and_two_derivatives(text):
    """Between the points at which they were tested, within a few times the tolerance of an octave."""
    s = signal(text)
    pieces = pieces_of("x", s, 2.0, ACCELERATION)
    t = np.random.default_rng(1).uniform(1.0, 2.0, 5000)
    for order, exact in enumerate(jet_of(s.expression, "t", t)[:3]):
        rounding = 1e-13 * np.abs(exact).max() + (1e-7 if order == 2 and text.startswith("1000") else 0.0)
        assert np.abs(pieces.at(t, order) - exact).max() < 4 * TOLERANCE[order] * np.abs(exact).max() + rounding, order


def test_the_integral_is_that_of_the_formula():
    t = np.linspace(0.0, 7.0, 50)
    np.testing.assert_allclose(pieces_of("x", signal("cos(3*t)"), 7.0).at(t, -1), np.sin(3 * t) / 3, atol=1e-9)
    np.testing.assert_allclose(pieces_of("x", 2.5, 7.0).at(t, -1), 2.5 * t, rtol=1e-15)


def test_a_longer_run_reads_the_same_numbers():
    t = np.random.default_rng(2).uniform(0.0, 1.3, 3000)
    for text in ("sin(9*t)", "minimum(t, 0.7)", "exp(-((t - 1)/0.01)**2)"):
        short, long = (pieces_of("x", signal(text), end, ACCELERATION if "sin" in text else VALUE) for end in (1.3, 40.0))
        for order in (-1, 0, 1, 2):
            np.testing.assert_array_equal(short.at(t, order), long.at(t, order))


@pytest.mark.parametrize("when", [1.0, 1.3])
def test_kinks_and_jumps_of_forces(when):
    """A kink is exact; a jump takes 2^-26 of its octave, or nothing where pieces end."""
    t = np.append(np.linspace(0.0, 2.0, 4000), [when - 1e-7, when + 1e-7])
    ramp = pieces_of("x", signal(f"minimum(t, {when})"), 2.0)
    np.testing.assert_allclose(ramp.at(t), np.minimum(t, when), atol=1e-12)
    jump = pieces_of("x", signal(f"where(t < {when}, 1, 2)"), 2.0)
    np.testing.assert_array_equal(jump.at(t), np.where(t < when, 1.0, 2.0))


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("minimum(t, 1)", "velocity that jumps near t = 1 s"),
        ("abs(sin(3*t))", "velocity that jumps near t = 1.0472 s"),
        ("t - floor(t)", "jumps near t = 1 s"),
        ("where(t < 0.7, 0, 1)", "jumps near t = 0.7"),
        ("sqrt(t)", "velocity that jumps near t ="),
        ("1/(1.5 - t)", "has no finite value near t = 1.5 s"),
        ("sin(1e4*t)", "takes more than 16384 pieces"),
    ],
)
def test_motions_that_nothing_could_follow(text, rule, monkeypatch):
    monkeypatch.setattr(signal_tables, "MOST_PIECES", 2**14)
    with pytest.raises(CaseError) as caught:
        pieces_of("bodies.piston.motion.translation.0", signal(text), 2.0, ACCELERATION)
    problem = caught.value.problems[0]
    assert rule in problem.rule and problem.path == "bodies.piston.motion.translation.0" and problem.remedy


def test_an_acceleration_may_jump():
    for when in (1.0, 1.3):
        pieces = pieces_of("x", signal(f"where(t < {when}, 0, (t - {when})**2)"), 2.0, ACCELERATION)
        assert pieces.at(when - 1e-6, 2) == 0.0 and pieces.at(when + 1e-6, 2) == pytest.approx(2.0, rel=1e-9)


def table(folder, text: str, **keys) -> TableSignal:
    (folder / "s.csv").write_text(text, encoding="utf-8")
    read = TableSignal(table="s.csv", column="a", **keys)
    bound_to(folder, read)
    return read


def test_tables(tmp_path):
    """Cubic: exact for a cubic; linear: straight lines; both begin and end where the table does."""
    times = np.linspace(-0.5, 2.0, 11)
    rows = "\n".join(f"{t!r},{t**3 - t!r}" for t in times.tolist())
    cubic = pieces_of("x", table(tmp_path, "t,a\n" + rows), 2.0, ACCELERATION)
    t = np.random.default_rng(3).uniform(0.0, 2.0, 100)
    np.testing.assert_allclose(cubic.at(t), t**3 - t, atol=1e-13)
    np.testing.assert_allclose(cubic.at(t, 2), 6 * t, atol=1e-11)
    np.testing.assert_allclose(cubic.at(t, -1), t**4 / 4 - t**2 / 2, atol=1e-13)
    linear = table(tmp_path, "t,a\n" + rows, interpolation="linear", time="t")
    np.testing.assert_allclose(pieces_of("x", linear, 2.0).at(t), np.interp(t, times, times**3 - times), atol=1e-14)
    np.testing.assert_allclose(linear.at(t), np.interp(t, times, times**3 - times), atol=1e-14)
    with pytest.raises(CaseError, match="velocity that jumps at every time"):
        pieces_of("x", linear, 2.0, ACCELERATION)


@pytest.mark.parametrize(
    ("text", "keys", "path", "rule"),
    [
        ("t,b\n0,1\n1,2", {}, "gravity.0.column", "is not a column of"),
        ("t,a\n0,1\n1,2", {"time": "s"}, "gravity.0.time", "is not a column of"),
        ("t,a\n0,1", {}, "gravity.0.table", "at least two lines"),
        ("t,a\n0,1\n1,x", {}, "gravity.0.table", "has no number in line 3"),
        ("t,a\n0,1\n0,2", {}, "gravity.0.time", "rising times, but line 3"),
        ("t,a\n0,1\n0.1,2", {}, "gravity.0.table", "lasts from 0 to 0.1 s, the run from 0 to 0.2 s"),
        ("t,a\n0.1,1\n1,2", {}, "gravity.0.table", "lasts from 0.1 to 1 s"),
        ("t,a\n0,1\n1,2", {"colour": "red"}, "gravity.0.colour", "is not a known key"),
        ("t,a\n0,1\n1,2", {"interpolation": "cubical"}, "gravity.0.interpolation", "needs one of cubic, linear"),
    ],
)
def test_faults_of_tables_are_told_with_their_key(tmp_path, text, keys, path, rule):
    (tmp_path / "s.csv").write_text(text, encoding="utf-8")
    from warpsph import Case

    data = {**LEAN, "gravity": [{"table": "s.csv", "column": "a", **keys}, 0]}
    with pytest.raises(CaseError) as caught:
        Case.from_dict(data, tmp_path)
    assert [(p.path, rule in p.rule) for p in caught.value.problems] == [(path, True)]


@pytest.mark.parametrize(
    ("value", "rule"),
    [("sin(x)", "unknown name x"), ("t <", "is not a formula"), ("t < 1", "true or false"), ("none", "needs a number"),
     (None, "has no value"), ([1], "not a list"), ("log(t)", "has no finite value at t = 0")],
)  # fmt: skip
def test_faults_of_formulas(value, rule):
    with pytest.raises(CaseError) as caught:
        case_of(LEAN, gravity=[0, value])
    problem = caught.value.problems[0]
    assert problem.path == "gravity.1" and rule in problem.rule


def test_constants_stay_numbers_and_signals_survive_a_round_trip(tmp_path):
    (tmp_path / "s.csv").write_text("t,a\n0,1\n1,2\n2,5\n", encoding="utf-8")
    from warpsph import Case

    moving = {"lower": "wall", "upper": {"wall": "no_slip", "velocity": ["sin(t)", 0]}}
    data = {**LEAN, "gravity": ["2*3", -9.81], "body_force": [{"table": "s.csv", "column": "a"}, "0.1*t"]}
    data["domain"] = {**LEAN["domain"], "boundary": {"x": "periodic", "y": moving}}
    case = Case.from_dict(data, tmp_path)
    assert case.gravity == (6.0, -9.81) and all(type(g) is float for g in case.gravity)
    assert case.body_force[1].at(2.0) == 0.2 and case.body_force[0].at([0.0, 1.0]).tolist() == [1.0, 2.0]
    assert [path for path, _ in signals_of(case)] == ["body_force.0", "body_force.1", "domain.boundary.y.upper.velocity.0"]
    again = Case.from_dict(case.to_dict(), tmp_path)
    assert again == case and again.to_dict() == case.to_dict()
    resolved = case.resolved({})
    assert resolved["body_force"][0]["table"] == str((tmp_path / "s.csv").resolve())
    assert list(case.reference_files) == ["s.csv"]


def test_a_wall_slides_in_its_own_plane():
    side = {"lower": "wall", "upper": {"wall": "no_slip", "velocity": [0, "sin(t)"]}}
    with pytest.raises(CaseError, match="out of its plane"):
        case_of(LEAN, domain__boundary={"x": "periodic", "y": side})


def test_the_device_evaluates_what_the_host_does(device):
    signal_at = make_signal_at()
    parts = [pieces_of("x", value, 3.0) for value in (signal("sin(5*t)"), signal("minimum(t, 0.7)"), 4.0)]

    @wp.kernel(module="unique", enable_backward=False)
    def apply(
        k: int,
        times: wp.array(dtype=wp.float64),
        first: wp.array(dtype=int),
        begin: wp.array(dtype=wp.float64),
        terms: wp.array2d(dtype=wp.float64),
        out: wp.array(dtype=wp.vec4d),
    ):
        i = wp.tid()
        out[i] = signal_at(k, times[i], first, begin, terms)

    first, begin, terms = joined(parts)
    arrays = [wp.array(a, dtype=kind, device=device) for a, kind in ((first, int), (begin, wp.float64), (terms, wp.float64))]
    t = np.concatenate([np.random.default_rng(4).uniform(0.0, 3.0, 300), begin[:700], [0.0, 3.0, math.nextafter(3.0, 4.0)]])
    for k, part in enumerate(parts):
        out = wp.zeros(len(t), dtype=wp.vec4d, device=device)
        inputs = [k, wp.array(t, dtype=wp.float64, device=device), *arrays, out]
        wp.launch(apply, dim=len(t), inputs=inputs, device=device)
        found = out.numpy()
        for order in (-1, 0, 1, 2):
            exact = part.at(t, order)
            np.testing.assert_allclose(found[:, order + 1], exact, rtol=1e-12, atol=1e-12 * (1 + np.abs(exact).max()))
