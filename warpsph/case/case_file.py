"""Case files: from a file to a validated case and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpsph.case.case import Case
from warpsph.case.plain import rename_files
from warpsph.case.yaml_text import dump_yaml, read_yaml
from warpsph.errors import CaseError, OutputError, Problem

__all__ = ["as_case", "dump_case", "dump_yaml", "load_case", "read_yaml", "save_case"]


def load_case(path: Path | str | Mapping[str, Any], overrides: Sequence[str] = ()) -> Case:
    """Read, change and validate a case, see `Case.load`. Raises CaseError."""
    return Case.load(path, overrides)


def as_case(case: Case | Path | str | Mapping[str, Any]) -> Case:
    """The validated case that a Case, the name of a case file or plain data stands for. Raises CaseError."""
    if isinstance(case, Case):
        return case
    if not isinstance(case, Path | str | Mapping):
        remedy = 'write e.g. "case.yaml", or {"dimension": 2, ...}'
        raise CaseError([Problem("(case)", case, "needs a Case, the name of a case file or a mapping of keys", remedy)])
    return load_case(case)


def dump_case(
    case: Case, defaults: bool = False, folder: Path | str | None = None, names: Mapping[str, str] | None = None
) -> str:
    """YAML text of a case.

    defaults: also write what the user left out.
    folder: where the text will be stored; names of reference files are made absolute if that is not the
        case's own folder (None: they stay as they are).
    names: instead of this, other names for reference files by their present ones.
    """
    data = case.to_dict(defaults=defaults)
    if names is not None:
        rename_files(data, names)
    elif folder is not None and case.source_folder is not None:
        if Path(folder).resolve() != case.source_folder.resolve():
            case.make_files_absolute(data)
    return dump_yaml(data)


def save_case(case: Case, path: Path | str, defaults: bool = False) -> None:
    """Write a case as a YAML file that `load_case` reads back. Raises OutputError if that is not possible."""
    path = Path(path)
    try:
        path.write_text(dump_case(case, defaults, path.parent), encoding="utf-8")
    except (OSError, ValueError) as error:
        raise OutputError(f"{path} cannot be written: {error}") from error
