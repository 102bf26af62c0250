"""What can be read of a faulty case, so that one look shows all that is wrong with it."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from types import SimpleNamespace
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError

from warpsph.case.places import is_model, members
from warpsph.errors import Problem

Problems = Iterator[Problem]
"""What a check yields."""


class _SkipCheck(Exception):
    """A check touched a value that is reported already."""


class _UnknownValue:
    """Stands in a draft for a value that could not be read; any use of it ends the check that uses it."""

    def _skip(self, *_args: Any) -> Any:
        raise _SkipCheck

    __getattr__ = __iter__ = __len__ = __bool__ = __getitem__ = __contains__ = __float__ = __int__ = _skip
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __hash__ = _skip
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __neg__ = (
        _skip
    )
    __index__ = __abs__ = __str__ = __repr__ = __format__ = _skip


_UNKNOWN: Any = _UnknownValue()


@functools.cache
def _adapter(model: type[BaseModel], name: str) -> TypeAdapter[Any]:
    info = model.model_fields[name]
    annotation: Any = info.annotation
    return TypeAdapter(Annotated[(annotation, *info.metadata)] if info.metadata else annotation)


@functools.cache
def _part_adapter(key: int) -> TypeAdapter[Any]:
    return TypeAdapter(_PARTS[key])


_PARTS: dict[int, Any] = {}


class _Draft(SimpleNamespace):
    """What could be read of a faulty part of a case: the attributes of its model, and what properties make of them."""

    def __init__(self, model: type[BaseModel]) -> None:
        super().__init__(_model=model)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.__dict__["_model"], name, None)
        if not isinstance(found, property) or found.fget is None:
            raise AttributeError(name)
        return found.fget(self)


def draft(model: type[BaseModel], raw: Any) -> Any:
    """Attributes of `model` as far as they can be read from `raw`; the others are _UNKNOWN."""
    result = _Draft(model)
    for name, info in model.model_fields.items():
        key = info.alias or name
        if key in raw:
            value = _draft_value(_adapter(model, name), info.annotation, raw[key])
        else:
            value = _UNKNOWN if info.is_required() else info.get_default(call_default_factory=True)
        setattr(result, name, value)
    return result


def model_of(case: Any) -> type[BaseModel]:
    """The model of a case, or of the draft of one."""
    return case._model if isinstance(case, _Draft) else type(case)


def _draft_value(adapter: TypeAdapter[Any], annotation: Any, raw: Any) -> Any:
    """`raw` as its type if it is right; else what is right of its parts; else _UNKNOWN."""
    try:
        return adapter.validate_python(raw)
    except ValidationError:
        pass
    if isinstance(raw, Mapping) and isinstance(raw.get("type"), str):
        # Parts of a faulty gauge can be read once its type is known.
        annotation = next(
            (member for tag, member in members(annotation) if tag == f"<{raw['type']}>"), annotation
        )
    if is_model(annotation):
        return draft(annotation.model_for(raw), raw) if isinstance(raw, Mapping) and not annotation.opaque else _UNKNOWN
    arguments = get_args(annotation)
    if get_origin(annotation) is tuple and isinstance(raw, list | tuple) and _holds_models(arguments[0]):
        return tuple(_draft_part(arguments[0], item) for item in raw)
    if isinstance(raw, Mapping) and len(arguments) == 2 and _holds_models(arguments[1]):
        return {key: _draft_part(arguments[1], item) for key, item in raw.items()}
    return _UNKNOWN


def _holds_models(annotation: Any) -> bool:
    return any(is_model(member) for _, member in members(annotation))


def _draft_part(annotation: Any, raw: Any) -> Any:
    _PARTS[id(annotation)] = annotation
    return _draft_value(_part_adapter(id(annotation)), annotation, raw)


def guarded(problems: Problems) -> Problems:
    """The problems of one check up to the point where it meets a value that could not be read."""
    try:
        yield from problems
    except _SkipCheck:
        return
