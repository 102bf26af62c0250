"""YAML 1.2 in and out, as case files are written.

The text is parsed into events by ruamel.yaml and built into plain dicts, lists, numbers and text here.
Building it here keeps the line and column of every key for the messages, refuses what a case file does not
need (aliases, tags, several documents, duplicate keys, deep nesting) and leaves no input that can make the
reader run away. Scalars follow the core schema of YAML 1.2: `1e-3` is a number, `on` and `yes` are text.
"""

from __future__ import annotations

import dataclasses
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml import events as ev
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from warpsph.case.plain import set_path
from warpsph.errors import MISSING, CaseError, Problem

__all__ = ["Tree", "apply_override", "dump_yaml", "placed", "read_file", "read_yaml"]

LARGEST_FILE = 500_000
"""Most bytes of a case file."""

DEEPEST_NESTING = 20
"""Most levels of mappings and lists inside each other."""

Place = tuple[int, int]
"""Line and column."""


@dataclass
class Tree:
    """Plain data of a document, the place (line, column) of each dotted path, and problems met on the way."""

    data: Any = None
    places: dict[str, Place] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)


def read_file(path: Path) -> Tree:
    """Read the text of a file. Raises CaseError for what makes the rest unreadable."""
    return _read(_file_text(path), str(path))


def read_yaml(text: str, name: str = "(text)") -> Any:
    """Plain dicts, lists, numbers, text, bools and None of one YAML document.

    name: what the text is called in messages. Raises CaseError.
    """
    tree = _read(text, name, top_level_mapping=False)
    if tree.problems:
        raise CaseError(tree.problems)
    return tree.data


def dump_yaml(data: Mapping[str, Any]) -> str:
    """YAML text of nested plain dicts, lists, numbers and text; `read_yaml` gives the same data back."""
    writer: Any = YAML(pure=True)
    writer.width = 100_000
    writer.allow_unicode = True
    writer.indent(mapping=2, sequence=4, offset=2)
    stream = io.StringIO()
    writer.dump(_styled(data, top=True), stream)
    return stream.getvalue()


_LONGEST_LINE = 100


def _styled(value: Any, top: bool = False) -> Any:
    """`value` marked for the writer: the short and simple on one line, text that needs it in quotes."""
    if isinstance(value, Mapping):
        result: Any = CommentedMap((_styled(key), _styled(item)) for key, item in value.items())
    elif isinstance(value, list | tuple):
        result = CommentedSeq(_styled(item) for item in value)
    elif isinstance(value, str) and (not value.isprintable() or _scalar(value) != value):
        return DoubleQuotedScalarString(value)
    else:
        return value
    if not top and len(repr(value)) <= _LONGEST_LINE and _is_simple(value):
        result.fa.set_flow_style()
    else:
        result.fa.set_block_style()
    return result


def _is_simple(value: Any) -> bool:
    """Whether a mapping or list reads well on one line: a list has no mappings in it."""
    if isinstance(value, Mapping):
        return all(_is_simple(item) for item in value.values())
    if isinstance(value, list | tuple):
        return not any(isinstance(item, Mapping) for item in value)
    return True


def _file_text(path: Path) -> str:
    """Text of a case file. Raises CaseError."""

    def refuse(rule: str, remedy: str = "") -> CaseError:
        return CaseError([Problem(str(path), MISSING, rule, remedy)])

    try:
        if path.is_dir():
            raise refuse("is a folder", "name the case file in it")
        if not path.exists():
            raise refuse("there is no such file", _nearby(path))
        if not path.is_file():
            raise refuse("is not a regular file", "name a YAML file")
        if path.stat().st_size > LARGEST_FILE:
            raise refuse(f"is larger than {LARGEST_FILE:,} bytes", "a case file is a short text")
        raw = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise refuse(f"cannot be read ({reason})", "check the name and the permissions") from None
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        problem = Problem(str(path), MISSING, "is not UTF-8 text", "save it as UTF-8", line)
        raise CaseError([problem]) from None


def _nearby(path: Path) -> str:
    """Remedy for a missing file: one with another ending."""
    for suffix in (".yaml", ".yml"):
        other = path.with_suffix(suffix) if path.name else path
        if other != path and other.is_file():
            return f"did you mean {other}?"
    return "check the name"


def _read(text: str, name: str, top_level_mapping: bool = True) -> Tree:
    """Parse and build one document. Raises CaseError for what makes the rest unreadable."""
    parser: Any = YAML(typ="safe", pure=True)
    try:
        tree = _Builder(name).build(parser.parse(text))
    except MarkedYAMLError as error:
        raise CaseError([_syntax_problem(error, text, name)]) from None
    except (YAMLError, ValueError, RecursionError, IndexError, AttributeError, TypeError) as error:
        # ruamel's reader and scanner raise these for some malformed texts (control characters, odd
        # directives).
        first_line = str(error).strip().split("\n")[0] or type(error).__name__
        raise CaseError([Problem(name, MISSING, f"is not YAML: {first_line}", "check the file")]) from None
    if top_level_mapping and not isinstance(tree.data, dict):
        rule = "is empty" if tree.data is None else "needs a mapping of keys at the top level"
        value = MISSING if tree.data is None else tree.data
        raise CaseError([*tree.problems, Problem(name, value, rule, "write e.g. dimension: 2")])
    return tree


def _syntax_problem(error: MarkedYAMLError, text: str, name: str) -> Problem:
    """A syntax error in one line."""
    mark = error.problem_mark or error.context_mark
    message = " ".join(part for part in (error.context, error.problem) if part) or "syntax error"
    line = text.split("\n")[mark.line] if mark is not None and mark.line <= text.count("\n") else ""
    remedy = "check quotes, brackets and the indentation"
    if "\\t" in message or "\t" in line:
        remedy = "indent with blanks, not with tabs"
    elif "mapping values" in message:
        remedy = "put text that contains a colon in quotes, or check the indentation"
    elif "cannot start any token" in message or "alias" in message or "anchor" in message:
        remedy = "put text that starts with a special character in quotes"
    place = (None, None) if mark is None else (mark.line + 1, mark.column + 1)
    return Problem(name, line.strip() or MISSING, f"is not YAML: {message}", remedy, *place)


_INTEGER = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITY = re.compile(r"[-+]?\.(inf|Inf|INF)")
_WORDS: dict[str, Any] = {
    "": None, "~": None, "null": None, "Null": None, "NULL": None,
    "true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False,
    ".nan": float("nan"), ".NaN": float("nan"), ".NAN": float("nan"),
}  # fmt: skip


def _scalar(text: str) -> Any:
    """Value of a plain scalar by the core schema of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]
    if len(text) <= 400:
        if _INTEGER.fullmatch(text):
            return int(text)
        if _BASED.fullmatch(text):
            return int(text, 0)
        if _FLOAT.fullmatch(text):
            return float(text)
        if _INFINITY.fullmatch(text):
            return float("-inf" if text[0] == "-" else "inf")
    return text


_NO_KEY: Any = object()


@dataclass
class _Frame:
    """A mapping or list under construction."""

    container: Any
    path: str
    key: Any = _NO_KEY
    key_text: str = ""
    repeated: bool = False


class _Builder:
    """Builds plain data from the parser's events, without recursion."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.tree = Tree()
        self.frames: list[_Frame] = []
        self.documents = 0

    def build(self, events: Iterator[Any]) -> Tree:
        for event in events:
            line, column = event.start_mark.line + 1, event.start_mark.column + 1
            if isinstance(event, ev.DocumentStartEvent):
                self.documents += 1
                if self.documents > 1:
                    self.stop(
                        self.name, MISSING, "holds several documents", "delete all from --- on", line, column
                    )
            elif isinstance(event, ev.AliasEvent):
                self.stop(
                    self.here(),
                    f"*{event.anchor}",
                    "aliases are not allowed",
                    "write the value out",
                    line,
                    column,
                )
            elif isinstance(event, ev.ScalarEvent | ev.MappingStartEvent | ev.SequenceStartEvent):
                if event.tag is not None:
                    self.stop(self.here(), str(event.tag), "tags are not allowed", "delete it", line, column)
                if isinstance(event, ev.ScalarEvent):
                    plain = event.implicit[0] and event.style in (None, "")
                    self.add(_scalar(event.value) if plain else event.value, line, column)
                else:
                    self.open({} if isinstance(event, ev.MappingStartEvent) else [], line, column)
            elif isinstance(event, ev.MappingEndEvent | ev.SequenceEndEvent):
                self.frames.pop()
        return self.tree

    def stop(self, path: str, value: Any, rule: str, remedy: str, line: int, column: int) -> None:
        """End with what was found so far and one more problem."""
        problem = Problem(path or self.name, value, rule, remedy, line, column)
        raise CaseError([*self.tree.problems, problem])

    def here(self) -> str:
        """Dotted path of the entry that comes next."""
        if not self.frames:
            return ""
        frame = self.frames[-1]
        last = str(len(frame.container)) if isinstance(frame.container, list) else frame.key_text
        return f"{frame.path}.{last}".strip(".")

    def open(self, container: Any, line: int, column: int) -> None:
        """Begin a mapping or list."""
        if len(self.frames) >= DEEPEST_NESTING:
            self.stop(
                self.here(),
                MISSING,
                f"is nested deeper than {DEEPEST_NESTING} levels",
                "simplify",
                line,
                column,
            )
        if self.frames and isinstance(self.frames[-1].container, dict) and self.frames[-1].key is _NO_KEY:
            self.stop(
                self.here(),
                MISSING,
                "has a key that is a list or mapping",
                "quote text in [ ] or { }",
                line,
                column,
            )
        path = self.here()
        self.add(container, line, column)
        self.frames.append(_Frame(container, path))

    def add(self, value: Any, line: int, column: int) -> None:
        """Put a value, or a key, where it belongs."""
        if not self.frames:
            self.tree.data = value
            return
        frame = self.frames[-1]
        path = self.here()
        if isinstance(frame.container, list):
            self.tree.places.setdefault(path, (line, column))
            frame.container.append(value)
        elif frame.key is _NO_KEY:
            frame.key, frame.key_text = value, str(value)
            frame.repeated = value in frame.container
            path = self.here()
            if frame.repeated:
                first = self.tree.places.get(path, (0, 0))[0]
                self.tree.problems.append(
                    Problem(
                        path,
                        MISSING,
                        f"stands here a second time (first in line {first})",
                        "delete one",
                        line,
                        column,
                    )
                )
            else:
                self.tree.places.setdefault(path, (line, column))
        else:
            # Of a repeated key the first value counts, so that the rest of the file can be checked too.
            if not frame.repeated:
                frame.container[frame.key] = value
            frame.key, frame.key_text = _NO_KEY, ""


def apply_override(data: Any, override: str) -> str:
    """Apply one `a.b=c` to plain data and return its path. Raises CaseError."""
    path, equals, text = override.partition("=")
    path = path.strip()
    if not equals or not path:
        raise CaseError(
            [Problem(override or "(override)", MISSING, "needs the form key=value", "write e.g. end_time=2")]
        )
    try:
        value = _read(text, path, top_level_mapping=False)
    except CaseError as error:
        # Line and column within an override say nothing.
        raise CaseError([dataclasses.replace(p, line=None, column=None) for p in error.problems]) from None
    if value.problems:
        raise CaseError(
            [dataclasses.replace(p, path=f"{path}.{p.path}", line=None, column=None) for p in value.problems]
        )
    set_path(data, path, value.data)
    return path


def placed(problem: Problem, places: Mapping[str, Place], overridden: Sequence[str]) -> Problem:
    """The problem with the line and column of its key, or of the innermost part around it in the file."""
    path = problem.path
    if any(f"{path}.".startswith(f"{changed}.") for changed in overridden):
        return problem
    while path:
        if path in places:
            line, column = places[path]
            return dataclasses.replace(problem, line=line, column=column)
        path = path.rpartition(".")[0]
    return problem
