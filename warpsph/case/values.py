"""Values in a case: numbers, words, formulas, names, and the wording of what is wrong with them.

Each rule class annotates a pydantic field (`Annotated[float, NumberRule(above=0)]`) and does the whole
validation of its value, so that a problem is one message, not one for each way in which a union failed.
"""

from __future__ import annotations

import difflib
import math
import numbers
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    WithJsonSchema,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from warpsph.case.expressions import CONSTANTS, FUNCTIONS, Expression, compile_expression
from warpsph.errors import ExpressionError, listed, short

# ----------------------------------------------------------------------------------------------------------
# values: numbers, choices, expressions


def bad_value(rule: str, remedy: str = "") -> PydanticCustomError:
    """An error that carries its own wording to the report."""
    return PydanticCustomError("case", "{rule}", {"rule": rule, "remedy": remedy})


def suggestion(word: object, known: Iterable[str]) -> str:
    """`did you mean ...?`, or the list of what is known, cut if that is long."""
    options = list(known)
    if isinstance(word, str):
        folded = {option.lower(): option for option in options}
        close = difflib.get_close_matches(word.lower().replace("-", "_")[:60], list(folded), 1)
        if close:
            return f"did you mean {folded[close[0]]}?"
    return "write one of " + listed(options)


def formula_pattern(names: Iterable[str] = ()) -> str:
    """Regular expression, for the JSON schema, that finds nothing but the words and signs of a formula in `names`.

    It is no grammar: what is made of them is checked when the case is read.
    """
    words = sorted({*names, *CONSTANTS, *FUNCTIONS, "E", "and", "or", "not"}, key=len, reverse=True)
    return rf"^({'|'.join(words)}|[-+*/%(),.<>=!_0-9\s])+$"


@dataclass(frozen=True)
class NumberRule:
    """Validation of a number: a plain one or arithmetic text, within limits; optionally `auto` or `none`."""

    above: float | None = None
    below: float | None = None
    least: float | None = None
    most: float | None = None
    integer: bool = False
    auto: bool = False
    none: bool = False

    def words(self) -> str:
        """The rule in words, for messages."""
        parts = []
        if self.above is not None:
            parts.append(f"> {self.above:g}")
        if self.below is not None:
            parts.append(f"< {self.below:g}")
        if self.least is not None:
            parts.append(f">= {self.least:g}")
        if self.most is not None:
            parts.append(f"<= {self.most:g}")
        text = "a whole number" if self.integer else "a number"
        if parts:
            text += " " + " and ".join(parts)
        if self.auto:
            text += ", or auto"
        if self.none:
            text += ", or none"
        return text

    def validate(self, value: Any) -> float | int | str | None:
        if self.none and (value is None or (isinstance(value, str) and value == "none")):
            return None
        if isinstance(value, str):
            text = value.strip()
            if self.auto and text == "auto":
                return "auto"
            if text in ("auto", "none", ""):
                raise bad_value(f"needs {self.words()}")
            try:
                constant = compile_expression(value, names=()).constant
            except ExpressionError as error:
                raise bad_value(
                    f"needs {self.words()}; the text {error.rule_with_column}", error.remedy
                ) from None
            assert constant is not None
            number: float = constant
        elif isinstance(value, bool) or type(value).__name__ in ("bool", "bool_"):
            raise bad_value(f"needs {self.words()}, not true or false")
        elif isinstance(value, numbers.Real):
            try:
                number = float(value)
            except OverflowError:
                number = math.inf
        elif value is None:
            raise bad_value(f"has no value; needs {self.words()}")
        else:
            raise bad_value(f"needs {self.words()}, not a {kind_of(value)}")
        if not math.isfinite(number):
            raise bad_value(f"needs {self.words()}; it has to be finite")
        if (
            (self.above is not None and not number > self.above)
            or (self.below is not None and not number < self.below)
            or (self.least is not None and number < self.least)
            or (self.most is not None and number > self.most)
        ):
            raise bad_value(f"needs {self.words()}")
        if self.integer:
            if number != math.floor(number):
                raise bad_value(f"needs {self.words()}")
            return int(value) if isinstance(value, numbers.Integral) else int(number)
        return number

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.validate)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return self.schema()

    def schema(self) -> dict[str, Any]:
        """JSON schema of what can be written."""
        number: dict[str, Any] = {"type": "integer" if self.integer else "number"}
        if self.above is not None:
            number["exclusiveMinimum"] = self.above
        if self.below is not None:
            number["exclusiveMaximum"] = self.below
        if self.least is not None:
            number["minimum"] = self.least
        if self.most is not None:
            number["maximum"] = self.most
        options = [number, {"type": "string", "description": "arithmetic such as 2/52", "pattern": formula_pattern()}]
        if self.auto:
            options.append({"const": "auto"})
        if self.none:
            options.append({"enum": ["none", None]})
        return {"anyOf": options}


@dataclass(frozen=True)
class ChoiceRule:
    """Validation of one word out of the Literal that it annotates."""

    none: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        options = literal_options(source)

        def validate(value: Any) -> Any:
            if self.none and (value is None or (isinstance(value, str) and value == "none")):
                return None
            for option in options:
                if type(option) is type(value) and option == value:
                    return option
            known = [str(option) for option in options] + (["none"] if self.none else [])
            if value is None:
                raise bad_value(f"has no value; needs one of {', '.join(known)}")
            raise bad_value(f"needs one of {', '.join(known)}", suggestion(value, known))

        written = [*options, *(("none", None) if self.none else ())]
        return core_schema.no_info_plain_validator_function(
            validate, metadata={"pydantic_js_functions": [lambda _s, _h: {"enum": written}]}
        )


def literal_options(source: Any) -> tuple[Any, ...]:
    """All values of a Literal, or of a union that holds Literals."""
    if get_origin(source) is Literal:
        return get_args(source)
    return tuple(option for part in get_args(source) for option in literal_options(part))


def kind_of(value: Any) -> str:
    if isinstance(value, Mapping):
        return "mapping"
    if isinstance(value, list | tuple):
        return "list"
    if isinstance(value, str):
        return "text"
    if isinstance(value, bool):
        return "true or false"
    return "number" if isinstance(value, numbers.Real) else type(value).__name__


@dataclass(frozen=True)
class FormulaRule:
    """Validation of an expression or number; `condition` wants a comparison, else a number is wanted."""

    names: tuple[str, ...] = ("x", "y", "z", "r")
    condition: bool = False
    words: tuple[tuple[str, Any], ...] = ()

    def validate(self, value: Any) -> Any:
        for word, meaning in self.words:
            if value == word if isinstance(value, str) else (value is None and word == "none"):
                return meaning
        wanted = "a condition" if self.condition else "a number or a formula"
        if self.words:
            wanted = ", ".join(word for word, _ in self.words) + " or " + wanted
        wanted += f" in {', '.join(self.names)}"
        if isinstance(value, Expression):
            value = value.text
        if isinstance(value, numbers.Real) and not isinstance(value, bool):
            value = repr(NumberRule().validate(value))
        if not isinstance(value, str):
            raise bad_value(f"needs {wanted}, not {'nothing' if value is None else 'a ' + kind_of(value)}")
        try:
            expression = compile_expression(value, names=self.names)
            # A formula without variables has one value, which has to be a number.
            _ = expression.constant
        except ExpressionError as error:
            raise bad_value(f"needs {wanted}; the text {error.rule_with_column}", error.remedy) from None
        if self.condition and not expression.is_condition:
            raise bad_value(f"needs {wanted}, this is a number", 'compare, e.g. "y < 0.5 + 0.1*sin(x)"')
        if expression.is_condition and not self.condition:
            raise bad_value(
                f"needs {wanted}, this is true or false", "use where(condition, value, other_value)"
            )
        return expression

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.validate, serialization=core_schema.plain_serializer_function_ser_schema(formula_text)
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        text = {"type": "string", "description": f"formula in {', '.join(self.names)}"}
        options: list[dict[str, Any]] = [{**text, "pattern": formula_pattern(self.names)}]
        if not self.condition:
            options.append({"type": "number"})
        words: list[Any] = [word for word, _ in self.words]
        if words:
            options.append({"enum": [*words, None] if "none" in words else words})
        return {"anyOf": options} if len(options) > 1 else options[0]


def formula_text(value: Any) -> Any:
    """An expression as a case file writes it: a plain number stays one."""
    if not isinstance(value, Expression):
        return value
    try:
        return float(value.text)
    except ValueError:
        return value.text


def as_list(value: Any) -> Any:
    """Lists, tuples and NumPy arrays pass as lists; all else is refused before pydantic tries to be kind."""
    if hasattr(value, "tolist") and not isinstance(value, numbers.Real):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return list(value)
    if value is None:
        raise bad_value("has no value; needs a list in [ ]")
    raise bad_value(f"needs a list in [ ], not a {kind_of(value)}")


def rising(times: tuple[float, ...]) -> tuple[float, ...]:
    if any(b <= a for a, b in zip(times, times[1:], strict=False)):
        raise bad_value("needs rising times", "sort them and delete doubles")
    return times


def time_window(times: tuple[float, ...]) -> tuple[float, ...]:
    if len(times) != 2 or times[0] >= times[1]:
        raise bad_value("needs two times, the first before the second", "write e.g. window: [0.5, 1]")
    return times


NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


def as_name(value: Any) -> str:
    """Names become column heads and file names: letters, digits and _ only."""
    if not isinstance(value, str) or not NAME.fullmatch(value):
        raise bad_value("needs a name of letters, digits and _, starting with a letter")
    return value


Number = Annotated[float, NumberRule()]
PositiveNumber = Annotated[float, NumberRule(above=0)]
NonNegativeNumber = Annotated[float, NumberRule(least=0)]
Vector = Annotated[tuple[Number, ...], Field(min_length=1), BeforeValidator(as_list)]
Times = Annotated[
    tuple[NonNegativeNumber, ...], Field(min_length=1), BeforeValidator(as_list), AfterValidator(rising)
]
Name = Annotated[str, BeforeValidator(as_name)]
Formula = Annotated[Expression, FormulaRule()]
WallKind = Annotated[Literal["no_slip", "free_slip"], ChoiceRule()]

_K = TypeVar("_K")
_V = TypeVar("_V")


class FrozenDict(dict[_K, _V]):
    """A mapping that cannot be changed, so that a Case stays what was validated."""

    def _refuse(self, *_args: Any, **_keywords: Any) -> Any:
        raise TypeError("a Case is frozen; use case.replace({...})")

    __setitem__ = __delitem__ = clear = pop = popitem = setdefault = update = __ior__ = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, _memo: Any) -> Self:
        return self


def as_mapping(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    if value is None:
        raise bad_value("has no value; needs a mapping (name: ...)")
    raise bad_value(f"needs a mapping (name: ...), not a {kind_of(value)}")


class CaseModel(BaseModel):
    """Base of all parts of a case: frozen, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    opaque: ClassVar[bool] = False
    """Whether the model has short forms, so that its parts cannot be judged when it is faulty."""

    @classmethod
    def model_for(cls, raw: Any) -> type[CaseModel]:
        """The model that reads a section as written; another than this one where a key of the section decides it."""
        return cls

    @classmethod
    def models(cls) -> list[type[CaseModel]]:
        """All models that `model_for` may return."""
        return [cls]

    @classmethod
    def foreign_key(cls, key: str, raw: Any) -> tuple[str, str] | None:
        """Rule and remedy for a key of the section as written that this model does not have, if more is known of it."""
        return None


class FreezeMapping:
    """Annotation of a mapping field: only mappings come in, a FrozenDict comes out."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        inner = handler(source)
        return core_schema.no_info_before_validator_function(
            as_mapping, core_schema.no_info_after_validator_function(FrozenDict, inner)
        )


def example(info: FieldInfo) -> str:
    return str(info.examples[0]) if info.examples else "..."


def field_list(known: tuple[str, ...]) -> BeforeValidator:
    """Validation of a list of field names."""

    def validate(value: Any) -> Any:
        if isinstance(value, str):
            raise bad_value("needs a list of fields in [ ]", f"write [{value}]" if value in known else "")
        items = as_list(value)
        for item in items:
            if item not in known:
                raise bad_value(
                    f"knows no field {short(item) if isinstance(item, str) else kind_of(item)}",
                    suggestion(item, known),
                )
        if len(set(items)) != len(items):
            raise bad_value("names a field twice", "delete one")
        return items

    return BeforeValidator(validate)


@dataclass(frozen=True)
class AlsoWritten:
    """Annotation of a field that `understand` turns into what its type takes; its schema also allows `schema`.

    understand: from a value as written to one that the type knows
    schema: JSON schema of what can be written besides; None: one item of the list that the field is
    """

    understand: Callable[[Any], Any]
    schema: Mapping[str, Any] | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.understand, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        inner = handler(schema)
        return {"anyOf": [inner, inner["items"] if self.schema is None else dict(self.schema)]}


def schema_of_fields(known: tuple[str, ...]) -> WithJsonSchema:
    return WithJsonSchema({"type": "array", "items": {"enum": list(known)}, "uniqueItems": True})
