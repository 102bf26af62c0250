"""Where things are in a case: the models behind a place, the plain data at a place."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, TypeGuard, Union, get_args, get_origin

from pydantic import BaseModel, Tag
from pydantic.fields import FieldInfo

from warpsph.case.values import CaseModel
from warpsph.errors import MISSING


def keys_of(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """The keys of a model as a file writes them."""
    return {info.alias or name: info for name, info in model.model_fields.items()}


def is_model(annotation: Any) -> TypeGuard[type[CaseModel]]:
    return isinstance(annotation, type) and issubclass(annotation, CaseModel)


def members(annotation: Any) -> Iterator[tuple[str | None, Any]]:
    """The parts of a union, each with its tag."""
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *metadata = get_args(annotation)
        tag = next((item.tag for item in metadata if isinstance(item, Tag)), None)
        for inner_tag, member in members(inner):
            yield tag or inner_tag, member
    elif origin is Union or origin is types.UnionType:
        for part in get_args(annotation):
            yield from members(part)
    else:
        yield None, annotation


def dig(data: Any, *keys: Any) -> Any:
    """Entry of nested plain data, MISSING if there is none."""
    for key in keys:
        if isinstance(data, Mapping) and key in data:
            data = data[key]
        elif isinstance(data, list | tuple) and isinstance(key, int) and -len(data) <= key < len(data):
            data = data[key]
        else:
            return MISSING
    return data
