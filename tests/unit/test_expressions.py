"""Formulas of case files: right values, nothing but arithmetic, errors that name the column, no hanging."""

import copy
import pickle
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpsph.case.expressions import FUNCTIONS, compile_expression
from warpsph.errors import CaseError, ExpressionError

X = np.array([-1.5, -0.2, 0.0, 0.7, 2.0])
Y = np.array([0.3, -2.0, 0.0, 1.1, 0.4])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2/52", 2 / 52),
        ("1e-3", 1e-3),
        ("-2**2", -4.0),
        ("2**-1", 0.5),
        ("2**3**2", 512.0),
        ("7//2 + 7%4", 6.0),
        ("-7 % 4", 1.0),
        ("2*pi - pi*2 + e", np.e),
        ("sqrt(2)*hypot(3, 4)", 5 * np.sqrt(2)),
        ("where(1 < 2, 3, 4) + minimum(1, 2) + maximum(1, 2)", 6.0),
        ("(1 < 2) + (2 < 1)", 1.0),
        ("  1 +\n 2 ", 3.0),
        ("+.5", 0.5),
    ],
)
def test_constants(text, expected):
    assert compile_expression(text).constant == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-cos(2*pi*x)*sin(2*pi*y)", -np.cos(2 * np.pi * X) * np.sin(2 * np.pi * Y)),
        ("x - y*2", X - Y * 2),
        ("x//1 + x%1", X // 1 + X % 1),
        ("r", np.hypot(X, Y)),
        ("where(x > 0, x, -x) - abs(x)", np.zeros(5)),
        (
            "tan(x) + exp(y) + tanh(x) + sinh(y) + cosh(x)",
            np.tan(X) + np.exp(Y) + np.tanh(X) + np.sinh(Y) + np.cosh(X),
        ),
        ("arctan2(y, x) + sign(x) + floor(y)", np.arctan2(Y, X) + np.sign(X) + np.floor(Y)),
        ("log(1 + x**2)", np.log(1 + X**2)),
        ("x*(y < 0)", X * (Y < 0)),
        ("-(x < 0)", -(X < 0).astype(float)),
    ],
)
def test_fields(text, expected):
    result = compile_expression(text).evaluate(x=X, y=Y)
    assert result.dtype == np.float64
    np.testing.assert_allclose(result, expected, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0 < x < 1", (X > 0) & (X < 1)),
        ("x < 0 or y > 1", (X < 0) | (Y > 1)),
        ("x < 0 and y < 0 and x < y", (X < 0) & (Y < 0) & (X < Y)),
        ("not x < 0", X >= 0),
        ("x == 0", X == 0),
        ("x != 0", X != 0),
        ("x", None),
    ],
)
def test_conditions(text, expected):
    expression = compile_expression(text)
    assert expression.is_condition == (expected is not None)
    if expected is not None:
        result = expression.evaluate(x=X, y=Y)
        assert result.dtype == bool
        np.testing.assert_array_equal(result, expected)


def test_every_function_is_numpy():
    arguments = (np.array([0.3]), np.array([0.4]), np.array([0.5]))
    for name, count in FUNCTIONS.items():
        result = compile_expression(f"{name}({', '.join('xyz'[:count])})").evaluate(
            **dict(zip("xyz", arguments, strict=True))
        )
        assert result == getattr(np, name)(*arguments[:count]), name


def test_broadcasts_over_all_given_values_and_returns_new_arrays():
    x = np.zeros((3, 1))
    y = np.zeros(4)
    result = compile_expression("1").evaluate(x=x, y=y)
    assert result.shape == (3, 4)
    same = compile_expression("y").evaluate(y=y)
    same[:] = 1
    assert not y.any()
    assert compile_expression("x + t").evaluate(x=[1, 2], t=3).tolist() == [4.0, 5.0]


def test_r_counts_the_axes_that_are_given():
    assert compile_expression("r").evaluate(x=3.0, y=4.0) == 5
    assert compile_expression("r").evaluate(x=2.0, y=3.0, z=6.0) == 7
    assert compile_expression("r").evaluate(x=2.0, r=1.0) == 1


def test_names_and_own_variables():
    assert compile_expression("x + sin(t)*pi").names == {"x", "t"}
    columns = compile_expression("gas - liquid", names=["gas", "liquid"])
    assert columns.evaluate(gas=3.0, liquid=1.0) == 2
    # A variable called e is the variable, not Euler's number.
    assert compile_expression("e", names=["e"]).evaluate(e=7.0) == 7
    with pytest.raises(ExpressionError):
        compile_expression("pi", names=["gas"], constants=False)


def test_missing_variable_and_infinite_results_are_errors():
    with pytest.raises(ExpressionError, match="z has no value"):
        compile_expression("x + z").evaluate(x=1.0)
    with pytest.raises(ExpressionError, match=r"no finite value at x = 0\b"):
        compile_expression("1/x").evaluate(x=np.array([1.0, 0.0]))
    assert np.isinf(compile_expression("1/x").evaluate(x=0.0, finite=False))
    with pytest.raises(ExpressionError):
        _ = compile_expression("9**9**9").constant
    # The guarded division is fine: what counts is the result.
    assert compile_expression("where(x == 0, 1, sin(x)/x)").evaluate(x=0.0) == 1


def test_equal_by_text_and_can_be_copied():
    expression = compile_expression("x + 1")
    assert expression == compile_expression("x + 1") != compile_expression("x + 2")
    for twin in (pickle.loads(pickle.dumps(expression)), copy.deepcopy(expression)):
        assert twin == expression
        assert twin.evaluate(x=1.0) == 2


def test_error_is_a_case_error_and_survives_pickling():
    with pytest.raises(CaseError) as caught:
        compile_expression("x + foo")
    twin = pickle.loads(pickle.dumps(caught.value))
    assert str(twin) == str(caught.value)
    assert twin.column == 5


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("x + foo", 5, "unknown name foo"),
        ("x + sine(x)", 5, "did you mean sin"),
        ("x^2", 1, "write [*][*]"),
        ("np.sin(x)", 1, "not np.sin"),
        ("x.real", 1, "dot name"),
        ("1, 2", None, "comma"),
        ("0,5", None, "comma"),
        ("sin(x, y)", 1, "takes 1 argument, not 2"),
        ("where(x, y)", 1, "takes 3 arguments"),
        ("sin(x=1)", 1, "takes 1"),
        ("sin(*x)", 1, "takes 1"),
        ("sin + 1", 1, "without"),
        ("pi(2)", 1, "which is a number"),
        ("x(2)", 1, "which is a number"),
        ("2(x)", 1, "multiply"),
        ("(1 + 2", None, "not a formula"),
        ("1 + 2)", 6, "parenthesis"),
        ("1) + (2", 2, "parenthesis"),
        ("1 +", None, "not a formula"),
        ("2x", None, "not a formula"),
        ("x if x else y", None, "where"),
        ("x & y", None, "write and, or"),
        ("~x", None, "write not"),
        ("x @ y", None, "operator"),
        ("x << 2", None, "operator"),
        ("x is y", None, "compares"),
        ("x in y", None, "compares"),
        ("True", None, "not a number"),
        ("1j", None, "not a number"),
        ("'x'", 1, "in a formula"),
        ("x # y", 3, "in a formula"),
        ("x; y", 2, "in a formula"),
        ("π*x", 1, "ASCII"),
        ("2·x", 2, "ASCII"),
        ("x\0", 2, "ASCII"),
        ("[1, 2]", None, "not arithmetic"),
        ("[x for x in y]", None, "not arithmetic"),
        ("lambda: 1", None, "not arithmetic"),
        ("(x := 1)", None, "not arithmetic"),
        ("{1: 2}", None, "not arithmetic"),
        ("x[0]", None, "not arithmetic"),
        ("yield", None, "not arithmetic"),
        ("1e999", None, "too large"),
        ("9" * 400, None, "too large"),
        ("", None, "empty"),
        (" \n ", None, "empty"),
        ("import os", None, "not a formula"),
        ("__import__(x)", None, "unknown function"),
        ("__class__", None, "unknown name"),
        ("x" * 3000, None, "longer"),
        ("(" * 900 + "x" + ")" * 900, None, "formula"),
        ("-" * 1900 + "x", None, "formula"),
        ("+".join("x" * 900), None, "too deep"),
        ("sin(" * 400 + "x" + ")" * 400, None, "formula"),
        ("x**" * 600 + "x", None, "formula"),
    ],
)
def test_refused(text, column, words):
    with pytest.raises(ExpressionError, match=words) as caught:
        compile_expression(text)
    if column is not None:
        assert caught.value.column == column
    assert "\n" not in str(caught.value)


def test_long_but_honest_formulas_pass():
    assert compile_expression(" + ".join(["x"] * 120)).evaluate(x=1.0) == 120


def test_hostile_powers_cost_nothing():
    began = time.perf_counter()
    for text in ("9**9**9**9", "(((9**99)**99)**99)**99", "2**1023*2", "1e308*10"):
        with pytest.raises(ExpressionError):
            _ = compile_expression(text).constant
    assert time.perf_counter() - began < 1


ALPHABET = [*FUNCTIONS, " "]
ALPHABET += (
    "x y z t r pi e 1 2.5 1e3 0 and or not if else lambda , ( ) [ ] . + - * / ** // % < == ^ :=".split()
)


@settings(max_examples=400, deadline=None, derandomize=True)
@given(st.lists(st.sampled_from(ALPHABET), max_size=12).map("".join) | st.text(max_size=20))
def test_any_text_is_evaluated_or_refused(text):
    try:
        expression = compile_expression(text)
    except ExpressionError:
        return
    assert expression.evaluate(x=X, y=Y, z=X, t=0.5, r=Y, finite=False).shape == X.shape
