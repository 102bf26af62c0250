"""Arguments in docstrings for the page of the Python interface; an extension of Griffe, named in mkdocs.yml.

Many docstrings list arguments as lines `name: meaning` without the heading `Args:`. They are read as if it were there.
"""

from __future__ import annotations

import re
from collections.abc import Container
from typing import Any

import griffe

LINE = re.compile(r"(\w+(?:, \w+)*): (.*)")


class Arguments(griffe.Extension):
    """Gives the lists of arguments of functions their heading."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Look at one function."""
        if func.docstring is not None and "Args:" not in func.docstring.value:
            names = {parameter.name for parameter in func.parameters}
            func.docstring.value = with_heading(func.docstring.value, names)


def with_heading(text: str, names: Container[str]) -> str:
    """A docstring with `Args:` over its lines `name: meaning`, each with its further lines; one name a line."""
    result: list[str] = []
    inside = False
    for line in text.splitlines():
        match = LINE.fullmatch(line)
        if match and all(name in names for name in match[1].split(", ")):
            result += [] if inside else ["", "Args:"]
            result += [f"    {name}: {match[2]}" for name in match[1].split(", ")]
            inside = True
        elif inside and line.startswith(" "):
            result.append(f"    {line}")
        else:
            result += ["", line] if inside and line else [line]
            inside = False
    return "\n".join(result)
