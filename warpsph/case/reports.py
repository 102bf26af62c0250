"""pydantic's errors in the words and paths of the case file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, get_args, get_origin

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from warpsph.case.gauge_models import GAUGES
from warpsph.case.places import dig, is_model, keys_of, members
from warpsph.case.references import REFERENCES
from warpsph.case.values import CaseModel, example, suggestion
from warpsph.errors import MISSING, Problem

_TAGS = frozenset(f"<{name}>" for name in (*GAUGES, *REFERENCES))
_SECTIONS = ("domain", "start", "scales", "numerics", "output")


def _step(annotation: Any, part: Any, raw: Any) -> tuple[Any, FieldInfo | None]:
    """Annotation (and field) that `part` of an error's place leads to; raw: what the file has there."""
    for tag, member in members(annotation):
        if tag is not None and tag == part:
            return member, None
        if is_model(member):
            info = keys_of(member.model_for(raw)).get(part) if isinstance(part, str) else None
            if info is not None:
                return info.annotation, info
        elif get_args(member):
            arguments = get_args(member)
            return arguments[0 if get_origin(member) in (tuple, list) else -1], None
    return None, None


def _model_at(root: type[CaseModel], place: Sequence[Any], raw: Any) -> tuple[type[CaseModel] | None, FieldInfo | None]:
    """The model (if it is one) and the field (if it is one) at an error's place."""
    annotation: Any = root
    info: FieldInfo | None = None
    for part in place:
        annotation, info = _step(annotation, part, raw)
        if annotation is None:
            return None, None
        raw = raw if part in _TAGS else dig(raw, part)
    models = [member for _, member in members(annotation) if is_model(member)]
    return (models[0].model_for(raw) if len(models) == 1 else None), info


def _user_path(place: Sequence[Any], raw: Any) -> tuple[str, ...]:
    """Place of an error as steps of the user's file."""
    steps = [part for part in place if part not in _TAGS and part != "[key]"]
    if steps[:2] == ["domain", "boundary"] and len(steps) > 3 and steps[3] in ("lower", "upper"):
        written = dig(raw, *steps[:3])
        if isinstance(written, Mapping) and not {"lower", "upper"} & written.keys():
            del steps[3]
    return tuple(str(step) for step in steps)


def _homes(root: type[CaseModel], key: str) -> list[str]:
    """Sections in which a key is at home, for one that stands in the wrong section."""
    sections: list[tuple[str, type[CaseModel]]] = [("", root)]
    for section in (name for name in _SECTIONS if name in root.model_fields):
        annotation = root.model_fields[section].annotation
        sections += [(section, model) for _, member in members(annotation) if is_model(member) for model in member.models()]
    homes = {f"{section}.{key}" if section else key: None for section, model in sections if key in keys_of(model)}
    return list(homes)


def _unknown_key(root: type[CaseModel], place: Sequence[Any], raw: Any) -> tuple[str, str, str | None]:
    """Rule and remedy for an unknown key, and the key that was meant if one is close."""
    key = place[-1]
    rule = "is not a known key"
    model, _ = _model_at(root, place[:-1], raw)
    known = list(keys_of(model)) if model is not None else []
    if model is not None and isinstance(key, str):
        foreign = model.foreign_key(key, dig(raw, *(part for part in place[:-1] if part not in _TAGS)))
        if foreign is not None:
            return *foreign, None
    remedy = suggestion(key, known)
    if remedy.startswith("did you mean"):
        return rule, remedy, remedy.removeprefix("did you mean ").removesuffix("?")
    homes = _homes(root, key) if isinstance(key, str) else []
    if len(homes) == 1:
        return rule, f"this key is at home at {homes[0]}", None
    return rule, (f"keys here: {', '.join(known)}" if known else "delete it"), None


def report(error: ValidationError, root: type[CaseModel], raw: Any) -> list[Problem]:
    """One Problem for each of pydantic's errors. root: the model of the whole case; raw: the case as written."""
    problems: list[Problem] = []
    meant: set[tuple[str, ...]] = set()
    missing: list[tuple[tuple[str, ...], Problem]] = []
    for item in error.errors(include_url=False):
        place = item["loc"]
        steps = _user_path(place, raw)
        path = ".".join(steps) or "(case)"
        kind = item["type"]
        context = item.get("ctx", {})
        value = item.get("input")
        model, info = _model_at(root, place, raw)
        remedy = f"write e.g. {steps[-1]}: {example(info)}" if info is not None and info.examples else ""
        if kind == "missing":
            rule = f"is required ({info.description})" if info is not None else "is required"
            missing.append((steps, Problem(path, MISSING, rule, remedy.replace("write e.g.", "add e.g."))))
            continue
        if kind == "extra_forbidden":
            rule, remedy, close = _unknown_key(root, place, raw)
            if close is not None:
                meant.add((*steps[:-1], close))
        elif kind == "case":
            rule = context["rule"]
            remedy = context["remedy"] or remedy
        elif value is None:
            rule = "has no value"
            remedy = remedy or "give one or delete the key"
        elif kind in ("model_type", "model_attributes_type", "dict_type", "mapping_type"):
            rule = "needs a mapping" + (
                f" with keys among {', '.join(keys_of(model))}" if model is not None else ""
            )
        elif kind == "too_short" and value:
            continue  # none of its entries is right, which each of them is told
        elif kind == "too_short":
            rule = f"needs at least {context.get('min_length', 1)} entry"
        elif kind == "string_type":
            rule = "needs text"
            remedy = "put it in quotes"
        elif kind == "invalid_key":
            rule = "is not a known key; keys are text"
            remedy = "delete it"
        else:
            rule = str(item["msg"])
        problems.append(Problem(path, value, rule, remedy))
    # A misspelt required key is one problem, not two.
    problems += [problem for steps, problem in missing if steps not in meant]
    return problems


def in_order(problems: Iterable[Problem], root: type[CaseModel]) -> list[Problem]:
    """Problems without doubles, in the order of the sections of the case, whose model is `root`."""
    order = {key: position for position, key in enumerate(keys_of(root))}
    unique = {(problem.path, problem.rule): problem for problem in problems}
    return sorted(unique.values(), key=lambda problem: order.get(problem.path.split(".")[0], -1))
