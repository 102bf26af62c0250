"""Formulas in case files: one arithmetic expression, checked against a whitelist and evaluated with NumPy.

`compile_expression("1 - 0.15*sin(2*pi*x)")` parses the text into Python's own syntax tree and walks it;
every node has to be on the list below, so nothing of Python but arithmetic is reachable. Allowed are

- numbers, `pi`, `e` and the names given by the caller (`x y z t` and `r`, the distance from the origin)
- `+ - * / ** // %`, unary `+ -`, comparisons (also chained, `0 < x < 1`), `and`, `or`, `not`
- `sin cos tan exp sqrt abs log tanh sinh cosh arctan2 hypot minimum maximum where sign floor`

All numbers are floating point, which also bounds the cost of a power such as `9**9**9`. Length, depth and
size of a text are limited, so that a hostile one cannot hang the program.
"""

from __future__ import annotations

import ast
import difflib
import math
import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from warpsph.errors import ExpressionError, listed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

__all__ = ["FUNCTIONS", "NAMES", "Expression", "compile_expression"]

NAMES = ("x", "y", "z", "t", "r")
CONSTANTS = {"pi": math.pi, "e": math.e}
FUNCTIONS = {
    "sin": 1, "cos": 1, "tan": 1, "exp": 1, "sqrt": 1, "abs": 1, "log": 1, "tanh": 1, "sinh": 1, "cosh": 1,
    "arctan2": 2, "hypot": 2, "minimum": 2, "maximum": 2, "where": 3, "sign": 1, "floor": 1,
}  # fmt: skip
"""Name of each allowed function and the number of its arguments."""

LONGEST_TEXT = 2000
DEEPEST_TREE = 150
MOST_NODES = 1000

_BINARY: dict[type[ast.operator], str] = {
    ast.Add: "add", ast.Sub: "subtract", ast.Mult: "multiply", ast.Div: "divide",
    ast.Pow: "power", ast.FloorDiv: "floor_divide", ast.Mod: "remainder",
}  # fmt: skip
_COMPARE: dict[type[ast.cmpop], str] = {
    ast.Lt: "less", ast.LtE: "less_equal", ast.Gt: "greater", ast.GtE: "greater_equal",
    ast.Eq: "equal", ast.NotEq: "not_equal",
}  # fmt: skip
_OTHER_SPELLINGS = {
    "arcsin": "", "ln": "log", "log10": "log(...)/log(10)", "min": "minimum", "max": "maximum", "fabs": "abs",
    "atan2": "arctan2", "radius": "r", "time": "t", "if": "where", "step": "where", "sgn": "sign",
}  # fmt: skip


@dataclass(frozen=True)
class Expression:
    """A checked expression.

    text: the source as the user wrote it
    names: the variables that occur in it (`r` counts as itself)
    is_condition: true if the result is true or false (`x < 1`), false if it is a number
    """

    text: str
    names: frozenset[str] = field(compare=False)
    is_condition: bool = field(compare=False)
    _tree: ast.expr = field(compare=False, repr=False)

    @property
    def tree(self) -> ast.expr:
        """The checked syntax tree."""
        return self._tree

    @property
    def constant(self) -> float | None:
        """The value, if no variable occurs in the expression; else None.

        Raises ExpressionError if that value is not finite.
        """
        if self.names:
            return None
        return float(self.evaluate())

    def evaluate(self, *, finite: bool = True, **values: ArrayLike) -> NDArray[Any]:
        """Value at the given points.

        values: one array or number for each variable (`x=..., y=..., z=..., t=...`), all broadcast together;
            `r` is computed from those of x, y, z that are given unless it is given itself.
        finite: refuse results that are infinite or not a number.

        Returns a new array of the common shape of ALL values, float64, or bool for a condition.
        Raises ExpressionError when a variable has no value or, with `finite`, when a result is not finite.
        """
        import numpy as np

        points = {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}
        if "r" in self.names and "r" not in points:
            axes = [points[axis] for axis in ("x", "y", "z") if axis in points]
            if axes:
                points["r"] = np.sqrt(np.asarray(sum(axis * axis for axis in axes)))
        missing = sorted(self.names - points.keys())
        if missing:
            raise ExpressionError(self.text, f"{', '.join(missing)} has no value here", "use other variables")
        shape = np.broadcast_shapes(*(value.shape for value in points.values()))
        with np.errstate(all="ignore"):
            raw = _evaluate(self._tree, points)
        kind = np.bool_ if self.is_condition else np.float64
        result: NDArray[Any] = np.array(np.broadcast_to(np.asarray(raw, dtype=kind), shape))
        if finite and not self.is_condition and not np.all(np.isfinite(result)):
            raise ExpressionError(
                self.text, self._where_not_finite(result, points), "change the formula there"
            )
        return result

    def _where_not_finite(
        self, result: NDArray[np.float64], points: Mapping[str, NDArray[np.float64]]
    ) -> str:
        """Text that names the first point at which `result` is not finite."""
        import numpy as np

        first = np.unravel_index(int(np.argmin(np.isfinite(result))), result.shape)
        at = [
            f"{name} = {float(np.broadcast_to(points[name], result.shape)[first]):g}"
            for name in NAMES
            if name in points and (name in self.names or "r" in self.names)
        ]
        return "has no finite value" + (f" at {', '.join(at)}" if at else "")


def compile_expression(text: str, names: Collection[str] = NAMES, constants: bool = True) -> Expression:
    """Check `text` and return the expression.

    names: the variables that may occur.
    constants: whether `pi` and `e` are known (a variable of that name always wins).

    Raises ExpressionError naming the offending column.
    """
    tree = _parse(text)
    checker = _Checker(text, names, CONSTANTS if constants else {})
    is_condition = checker.check(tree, 1)
    return Expression(text, frozenset(checker.used), is_condition, tree)


def _parse(text: str) -> ast.expr:
    """Syntax tree of `text`."""
    if len(text) > LONGEST_TEXT:
        raise ExpressionError(text, f"is longer than {LONGEST_TEXT} characters", "shorten the formula")
    if not text.strip():
        raise ExpressionError(text, "is an empty expression", "write a number or a formula")
    for position, character in enumerate(text):
        if not (" " <= character <= "~" or character in "\t\r\n"):
            raise ExpressionError(
                text, "has a character that is not plain ASCII", "write pi, *, - and so on", position + 1
            )
        if character in "#'\"\\;`$?":
            raise ExpressionError(text, f"has {character} in a formula", "delete it", position + 1)
    # Line ends inside a folded YAML text are blanks; replacing one for one keeps the columns right.
    flat = text.replace("\n", " ").replace("\r", " ").replace("\t", " ")
    blanks = len(flat) - len(flat.lstrip())
    # A pair of parentheses makes leading blanks harmless; the columns move by one.
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse("(" + flat + ")", mode="eval").body
    except SyntaxError as error:
        column = min(max((error.offset or blanks + 2) - 1, 1), len(text))
        remedy = "check the parentheses and operators"
        if "unmatched" in str(error.msg) or "never closed" in str(error.msg):
            remedy = "close every parenthesis once"
        raise ExpressionError(text, "is not a formula", remedy, column) from None
    except (ValueError, MemoryError, RecursionError, OverflowError):
        raise ExpressionError(text, "is not a formula that can be read", "shorten or simplify it") from None
    # "1) + (2" is balanced only together with the added parentheses; on its own it has to fail as well.
    depth = 0
    for position, character in enumerate(flat):
        depth += (character == "(") - (character == ")")
        if depth < 0:
            raise ExpressionError(text, "closes a parenthesis that is not open", "check them", position + 1)
    return tree


class _Checker:
    """Walks a tree, refuses what is not on the whitelist, collects the variables."""

    def __init__(self, text: str, names: Collection[str], constants: Mapping[str, float]) -> None:
        self.text = text
        self.names = names
        self.constants = constants
        self.used: set[str] = set()
        self.count = 0

    def fail(self, node: ast.AST, rule: str, remedy: str = "") -> ExpressionError:
        return ExpressionError(self.text, rule, remedy, getattr(node, "col_offset", 1))

    def check(self, node: ast.expr, depth: int) -> bool:
        """Check `node`; true if it is a condition (in arithmetic conditions count as 0 and 1)."""
        self.count += 1
        if self.count > MOST_NODES or depth > DEEPEST_TREE:
            raise self.fail(node, "is too deep or too long", "shorten or simplify the formula")
        match node:
            case ast.Constant(value=value):
                self.check_constant(node, value)
                return False
            case ast.Name(id=name):
                self.check_name(node, name)
                return False
            case ast.UnaryOp(op=op, operand=operand):
                if isinstance(op, ast.Invert):
                    raise self.fail(node, "uses ~", "write not (...)")
                self.check(operand, depth + 1)
                return isinstance(op, ast.Not)
            case ast.BinOp(op=op, left=left, right=right):
                if isinstance(op, ast.BitXor):
                    raise self.fail(node, "uses ^", "write ** for a power")
                if isinstance(op, ast.BitAnd | ast.BitOr):
                    raise self.fail(node, "uses & or |", "write and, or")
                if type(op) not in _BINARY:
                    raise self.fail(node, "uses an operator that is not allowed", "use + - * / ** // %")
                self.check(left, depth + 1)
                self.check(right, depth + 1)
                return False
            case ast.BoolOp(values=values):
                for operand in values:
                    self.check(operand, depth + 1)
                return True
            case ast.Compare(left=left, ops=ops, comparators=comparators):
                if any(type(op) not in _COMPARE for op in ops):
                    raise self.fail(node, "compares with is or in", "use < <= > >= == !=")
                for operand in (left, *comparators):
                    self.check(operand, depth + 1)
                return True
            case ast.Call(func=func, args=args, keywords=keywords):
                return self.check_call(node, func, args, keywords, depth)
            case ast.IfExp():
                raise self.fail(node, "uses if ... else", "write where(condition, value, other_value)")
            case ast.Attribute():
                raise self.fail(node, "uses a dot name", "write sin(...), not np.sin(...)")
            case ast.Tuple():
                raise self.fail(node, "has a comma outside a function", "write 0.5, not 0,5; lists in [ ]")
        raise self.fail(
            node, "has something that is not arithmetic", "use numbers, names, + - * / ** and functions"
        )

    def check_constant(self, node: ast.expr, value: object) -> None:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(node, "has something that is not a number", "write numbers such as 0.5 or 1e-3")
        try:
            finite = math.isfinite(float(value))
        except OverflowError:
            finite = False
        if not finite:
            raise self.fail(node, "has a number that is too large", "stay below 1e308")

    def check_name(self, node: ast.expr, name: str) -> None:
        if name in self.names:
            self.used.add(name)
        elif name not in self.constants:
            if name in FUNCTIONS:
                raise self.fail(node, f"uses the function {name} without ( )", f"write {name}(...)")
            raise self.fail(node, f"has the unknown name {_short(name)}", self.suggest(name, self.known()))

    def check_call(
        self, node: ast.expr, func: ast.expr, args: list[ast.expr], keywords: list[ast.keyword], depth: int
    ) -> bool:
        if not isinstance(func, ast.Name):
            remedy = (
                "write sin(...), not np.sin(...)"
                if isinstance(func, ast.Attribute)
                else "write * to multiply"
            )
            raise self.fail(node, "calls something that is not a function", remedy)
        name = func.id
        if name not in FUNCTIONS:
            if name in self.names or name in self.constants:
                raise self.fail(node, f"calls {name}, which is a number", f"write {name} * (...)")
            raise self.fail(
                func, f"has the unknown function {_short(name)}", self.suggest(name, list(FUNCTIONS))
            )
        if keywords or any(isinstance(arg, ast.Starred) for arg in args) or len(args) != FUNCTIONS[name]:
            count = FUNCTIONS[name]
            raise self.fail(
                node,
                f"{name} takes {count} argument{'s' if count > 1 else ''}, not {len(args)}",
                f"write {name}({', '.join('abc'[:count])})",
            )
        for arg in args:
            self.check(arg, depth + 1)
        return False

    def known(self) -> list[str]:
        return [*self.names, *self.constants, *FUNCTIONS]

    def suggest(self, name: str, known: list[str]) -> str:
        other = _OTHER_SPELLINGS.get(name)
        close = [other] if other else difflib.get_close_matches(name[:40], known, 1)
        if close:
            return f"did you mean {close[0]}?"
        return f"known are {listed([*self.names, *self.constants])} and functions such as sin, exp, where"


def _short(name: str) -> str:
    return name if len(name) <= 30 else name[:27] + "..."


def _evaluate(node: ast.expr, points: Mapping[str, Any]) -> Any:
    """Value of a checked tree; numbers are float64 scalars or arrays, conditions are bool."""
    import numpy as np

    def number(operand: ast.expr) -> Any:
        return np.asarray(_evaluate(operand, points), dtype=np.float64)

    def truth(operand: ast.expr) -> Any:
        return np.asarray(_evaluate(operand, points)) != 0

    match node:
        case ast.Constant(value=value):
            return np.float64(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return points[name] if name in points else np.float64(CONSTANTS[name])
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return ~truth(operand)
        case ast.UnaryOp(op=op, operand=operand):
            return -number(operand) if isinstance(op, ast.USub) else number(operand)
        case ast.BinOp(op=op, left=left, right=right):
            return getattr(np, _BINARY[type(op)])(number(left), number(right))
        case ast.BoolOp(op=op, values=values):
            combine: Callable[[Any, Any], Any] = np.logical_and if isinstance(op, ast.And) else np.logical_or
            result = truth(values[0])
            for operand in values[1:]:
                result = combine(result, truth(operand))
            return result
        case ast.Compare(left=left, ops=ops, comparators=comparators):
            result = np.True_
            a = number(left)
            for comparison, comparator in zip(ops, comparators, strict=True):
                b = number(comparator)
                result = np.logical_and(result, getattr(np, _COMPARE[type(comparison)])(a, b))
                a = b
            return result
        case ast.Call(func=ast.Name(id="where"), args=[condition, yes, no]):
            return np.where(truth(condition), number(yes), number(no))
        case ast.Call(func=ast.Name(id=name), args=args):
            return getattr(np, name)(*(number(arg) for arg in args))
    raise AssertionError(f"unchecked node {type(node).__name__}")  # unreachable: _Checker refuses it
