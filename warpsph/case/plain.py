"""Cases as plain data, dicts and lists as in a file: entries by dotted path, names of files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpsph.case.values import kind_of, suggestion
from warpsph.errors import CaseError, Problem, short

_SIGNALS = ("gravity", "body_force", "domain", "bodies")  # sections in which a signal may be a table


def file_holders(data: Mapping[str, Any]) -> list[tuple[dict[str, Any], str]]:
    """The mappings of a plain case that name a file, and the key that they do it under.

    References and shapes of bodies have a `file`, signals a `table`.
    """
    parts = ("curve", "curves", "interface")
    holders = [(entry[part], "file") for entry in data.get("reference", {}).values() for part in parts if part in entry]
    shapes = [part for body in data.get("bodies", {}).values() for part in body["shape"].values()]
    holders += [(shape, "file") for shape in shapes if shape.get("file")]
    return holders + [(table, "table") for section in _SIGNALS for table in _tables(data.get(section))]


def _tables(data: Any) -> list[dict[str, Any]]:
    """The tables of signals in plain data."""
    if isinstance(data, dict):
        return [data] if "table" in data else [table for value in data.values() for table in _tables(value)]
    return [table for value in data for table in _tables(value)] if isinstance(data, list) else []


def files_named(data: Mapping[str, Any]) -> list[str]:
    """The names of all files in a plain case."""
    return [holder[key] for holder, key in file_holders(data)]


def rename_files(data: Mapping[str, Any], names: Mapping[str, str]) -> None:
    """Replace the names of files in a plain case, in place; names that are no key of `names` stay."""
    for holder, key in file_holders(data):
        holder[key] = names.get(holder[key], holder[key])


def none_words(value: Any) -> Any:
    """Dumped models as a case file writes them: lists for tuples, `none` where a key is switched off."""
    if isinstance(value, Mapping):
        return {
            key: "none" if item is None else none_words(item)
            for key, item in value.items()
            if item is not None or key in _NONE_KEYS
        }
    if isinstance(value, list | tuple):
        return [none_words(item) for item in value]
    return value


_NONE_KEYS = frozenset({"maximum_step", "pressure", "particles", "checkpoint"})
_REMOVABLE = ("reference", "gauges")


def set_path(data: Any, path: str, value: Any) -> None:
    """Set, in place, the entry of nested dicts and lists that a dotted path names; missing mappings are made.

    A value None, or the word none, takes an entry of `reference` or `gauges` out. Raises CaseError if the path leads
    through something that is neither, or names no such entry.
    """
    keys = path.split(".")
    if not all(keys):
        raise CaseError(
            [Problem(path or "(override)", value, "needs a dotted path such as a.b=c", "name every step")]
        )
    here = data
    if len(keys) == 2 and keys[0] in _REMOVABLE and (value is None or (isinstance(value, str) and value == "none")):
        entries = data.get(keys[0]) if isinstance(data, dict) else None
        if not isinstance(entries, dict) or keys[1] not in entries:
            known = list(entries) if isinstance(entries, dict) else []
            remedy = suggestion(keys[1], known) if known else "delete it"
            raise CaseError([Problem(path, value, "there is no such entry to take out", remedy)])
        del entries[keys[1]]
        return
    for depth, key in enumerate(keys):
        last = depth == len(keys) - 1
        so_far = short(".".join(keys[:depth]))
        if isinstance(here, list):
            if not key.isdecimal() or len(key) > 9 or int(key) >= len(here):
                rule = f"{so_far} is a list of {len(here)}"
                raise CaseError([Problem(path, value, rule, f"use a position 0 to {len(here) - 1}")])
            if last:
                here[int(key)] = value
            else:
                here = here[int(key)]
        elif isinstance(here, dict):
            if last:
                here[key] = value
            else:
                if here.get(key) is None or (here[key] == "none" and key in _NONE_KEYS):
                    here[key] = {}
                here = here[key]
        else:
            rule = f"{so_far} is a {kind_of(here)} and has no part {short(key)}"
            raise CaseError([Problem(path, value, rule, f"set {so_far} as a whole")])
