"""Value, first and second derivative of an expression in one variable, exact: jets carried through its tree.

A jet is (f, f', f'', e) of a part of the expression, arrays over the points. Every rule is the chain rule twice: for g(u) it
is (g, g' u', g'' u'^2 + g' u''). Where a part is chosen (`where`, `minimum`, `abs`, comparisons) the derivatives are those
of the part that was chosen; a jump has derivative 0 on both sides. e bounds what rounding has made of f, in units of the
rounding of 1: each operation adds its own to what it hands on of its operands, so that 1 - cos(t) knows how poor it is.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.case.expressions import CONSTANTS, Expression

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Jet = tuple[Any, Any, Any, Any]


def jet_of(expression: Expression, name: str, at: ArrayLike) -> NDArray[np.float64]:
    """Value, first and second derivative by the variable `name`, and rounding of the value: (4, ...) for points (...).

    Where the expression has none (sqrt(t) at 0) the numbers are infinite or nan.

    Raises KeyError if the expression has other variables.
    """
    points = np.asarray(at, dtype=np.float64)
    seed = (points, np.ones_like(points), np.zeros_like(points), np.abs(points))
    with np.errstate(all="ignore"):
        jet = _jet(expression.tree, {name: seed})
    found = np.array([np.broadcast_to(part, points.shape) for part in jet], dtype=np.float64)
    found[3] *= np.finfo(np.float64).eps
    return found


def _constant(value: Any) -> Jet:
    return value, 0.0, 0.0, np.abs(value)


def _chain(u: Jet, g: Any, g1: Any, g2: Any) -> Jet:
    """g(u) from g and its derivatives at u."""
    return g, g1 * u[1], g2 * u[1] ** 2 + g1 * u[2], np.abs(g1) * u[3] + np.abs(g)


def _choose(condition: Any, a: Jet, b: Jet) -> Jet:
    f, f1, f2, e = (np.where(condition, one, other) for one, other in zip(a, b, strict=True))
    return f, f1, f2, e


def _add(a: Jet, b: Jet, sign: float = 1.0) -> Jet:
    f = a[0] + sign * b[0]
    return f, a[1] + sign * b[1], a[2] + sign * b[2], a[3] + b[3] + np.abs(f)


def _multiply(a: Jet, b: Jet) -> Jet:
    f = a[0] * b[0]
    rounding = np.abs(a[0]) * b[3] + np.abs(b[0]) * a[3] + np.abs(f)
    return f, a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2], rounding


def _divide(a: Jet, b: Jet) -> Jet:
    q = a[0] / b[0]
    q1 = (a[1] - q * b[1]) / b[0]
    rounding = (a[3] + np.abs(q) * b[3]) / np.abs(b[0]) + np.abs(q)
    return q, q1, (a[2] - 2.0 * q1 * b[1] - q * b[2]) / b[0], rounding


def _power(a: Jet, b: Jet) -> Jet:
    value = np.power(a[0], b[0])
    if not np.any(b[1]) and not np.any(b[2]):
        first = np.where(b[0] == 0.0, 0.0, b[0] * np.power(a[0], b[0] - 1.0))
        second = np.where(b[0] * (b[0] - 1.0) == 0.0, 0.0, b[0] * (b[0] - 1.0) * np.power(a[0], b[0] - 2.0))
        return _chain(a, value, first, second)
    log = _chain(a, np.log(a[0]), 1.0 / a[0], -1.0 / a[0] ** 2)
    return _chain(_multiply(b, log), value, value, value)


def _remainder(a: Jet, b: Jet) -> Jet:
    return _add(a, _multiply(_constant(np.floor_divide(a[0], b[0])), b), -1.0)


def _arctan2(y: Jet, x: Jet) -> Jet:
    square = x[0] ** 2 + y[0] ** 2
    first = (x[0] * y[1] - y[0] * x[1]) / square
    second = (x[0] * y[2] - y[0] * x[2] - first * 2.0 * (x[0] * x[1] + y[0] * y[1])) / square
    f = np.arctan2(y[0], x[0])
    return f, first, second, (np.abs(x[0]) * y[3] + np.abs(y[0]) * x[3]) / square + np.abs(f)


def _hypot(a: Jet, b: Jet) -> Jet:
    f = np.hypot(a[0], b[0])
    first = (a[0] * a[1] + b[0] * b[1]) / f
    second = (a[1] ** 2 + a[0] * a[2] + b[1] ** 2 + b[0] * b[2] - first**2) / f
    return f, first, second, (np.abs(a[0]) * a[3] + np.abs(b[0]) * b[3]) / f + f


def _tan(u: Jet) -> Jet:
    g = np.tan(u[0])
    return _chain(u, g, 1.0 + g**2, 2.0 * g * (1.0 + g**2))


def _tanh(u: Jet) -> Jet:
    g = np.tanh(u[0])
    return _chain(u, g, 1.0 - g**2, -2.0 * g * (1.0 - g**2))


def _sqrt(u: Jet) -> Jet:
    g = np.sqrt(u[0])
    return _chain(u, g, 0.5 / g, -0.25 / (g * u[0]))


_FUNCTIONS: dict[str, Callable[..., Jet]] = {
    "sin": lambda u: _chain(u, np.sin(u[0]), np.cos(u[0]), -np.sin(u[0])),
    "cos": lambda u: _chain(u, np.cos(u[0]), -np.sin(u[0]), -np.cos(u[0])),
    "tan": _tan,
    "exp": lambda u: _chain(u, np.exp(u[0]), np.exp(u[0]), np.exp(u[0])),
    "sqrt": _sqrt,
    "abs": lambda u: _chain(u, np.abs(u[0]), np.sign(u[0]), 0.0),
    "log": lambda u: _chain(u, np.log(u[0]), 1.0 / u[0], -1.0 / u[0] ** 2),
    "tanh": _tanh,
    "sinh": lambda u: _chain(u, np.sinh(u[0]), np.cosh(u[0]), np.sinh(u[0])),
    "cosh": lambda u: _chain(u, np.cosh(u[0]), np.sinh(u[0]), np.cosh(u[0])),
    "arctan2": _arctan2,
    "hypot": _hypot,
    "minimum": lambda a, b: _choose(a[0] <= b[0], a, b),
    "maximum": lambda a, b: _choose(a[0] >= b[0], a, b),
    "where": lambda condition, a, b: _choose(condition[0] != 0.0, a, b),
    "sign": lambda u: _constant(np.sign(u[0])),
    "floor": lambda u: _constant(np.floor(u[0])),
}
_OPERATORS: dict[type[ast.operator], Callable[[Jet, Jet], Jet]] = {
    ast.Add: _add,
    ast.Sub: lambda a, b: _add(a, b, -1.0),
    ast.Mult: _multiply,
    ast.Div: _divide,
    ast.Pow: _power,
    ast.FloorDiv: lambda a, b: _constant(np.floor_divide(a[0], b[0])),
    ast.Mod: _remainder,
}
_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
    ast.Eq: np.equal, ast.NotEq: np.not_equal,
}  # fmt: skip


def _jet(node: ast.expr, variables: dict[str, Jet]) -> Jet:
    """Jet of a checked tree; conditions are 0 or 1."""
    match node:
        case ast.Constant(value=value):
            return _constant(np.float64(value))  # type: ignore[arg-type]
        case ast.Name(id=name):
            return variables[name] if name in variables else _constant(np.float64(CONSTANTS[name]))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return _constant(np.where(_jet(operand, variables)[0] != 0.0, 0.0, 1.0))
        case ast.UnaryOp(op=op, operand=operand):
            jet = _jet(operand, variables)
            return (-jet[0], -jet[1], -jet[2], jet[3]) if isinstance(op, ast.USub) else jet
        case ast.BinOp(op=op, left=left, right=right):
            return _OPERATORS[type(op)](_jet(left, variables), _jet(right, variables))
        case ast.BoolOp(op=op, values=values):
            truths = [_jet(operand, variables)[0] != 0.0 for operand in values]
            combine = np.logical_and if isinstance(op, ast.And) else np.logical_or
            result = truths[0]
            for truth in truths[1:]:
                result = combine(result, truth)
            return _constant(np.where(result, 1.0, 0.0))
        case ast.Compare(left=left, ops=ops, comparators=comparators):
            result = np.True_
            a = _jet(left, variables)[0]
            for comparison, comparator in zip(ops, comparators, strict=True):
                b = _jet(comparator, variables)[0]
                result = np.logical_and(result, _COMPARISONS[type(comparison)](a, b))
                a = b
            return _constant(np.where(result, 1.0, 0.0))
        case ast.Call(func=ast.Name(id=name), args=args):
            return _FUNCTIONS[name](*(_jet(argument, variables) for argument in args))
    raise AssertionError(f"unchecked node {type(node).__name__}")  # unreachable: expressions are checked when compiled
