"""Checkpoints: everything needed to continue a run bit for bit, as HDF5 files.

    /            attributes: format, version, crc32 of the JSON text
    /attributes  JSON text: numbers, texts and lists of the run (time, step, case ...)
    /arrays/*    one dataset an array, each with its crc32

A file is written under a temporary name, flushed to the disk and renamed, so a process killed at any moment
leaves the previous checkpoints whole. Checksums are verified on reading, because a disk or a copy can still
spoil a file.
"""

from __future__ import annotations

import json
import re
import shutil
import warnings
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.errors import OutputError
from warpsph.files.whole_files import whole_file

FORMAT = "warpsph checkpoint"
VERSION = 1


class CheckpointError(OutputError):
    """A checkpoint cannot be read: missing, broken, or of another format."""


def save(path: Path, arrays: Mapping[str, np.ndarray], attributes: Mapping[str, Any]) -> None:
    """Write a checkpoint.

    `arrays` are stored as they are (any number or bool type, any shape), `attributes` as JSON: None, bool,
    int, float (all digits, also nan and inf), str, and lists and dicts of these. Raises OutputError if the
    file cannot be written (`path` then is what it was before), ValueError or TypeError for what cannot be
    stored.
    """
    import h5py

    text = json.dumps(attributes, default=_number).encode()
    data = {name: np.asarray(array) for name, array in arrays.items()}
    for name, array in data.items():
        if array.dtype.kind not in "biuf":
            raise TypeError(f"array {name!r} has type {array.dtype}, which a checkpoint cannot hold")
        if not name or "/" in name or name.startswith("."):
            raise ValueError(f"{name!r} cannot be the name of an array in a checkpoint")
    needed = len(text) + sum(array.nbytes for array in data.values()) + 2048 * (len(data) + 2)
    try:
        free = shutil.disk_usage(path.parent).free
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
    # HDF5 leaves a mess behind when the disk fills up under it; better not to begin.
    if needed > free:
        raise OutputError(
            f"{path}: the disk is full: {needed / 1e6:.1f} MB needed, {free / 1e6:.1f} MB free; "
            "free some space or keep fewer checkpoints (output.checkpoint.keep)"
        )
    with whole_file(path, durable=True, needed=needed) as temporary:
        try:
            # No HDF5 file locks: nobody else knows this name, and many network file systems have none.
            with h5py.File(temporary, "w", locking=False) as file:
                file.attrs["format"] = FORMAT
                file.attrs["version"] = VERSION
                file.attrs["crc32"] = zlib.crc32(text)
                file["attributes"] = np.frombuffer(text, np.uint8)
                group = file.create_group("arrays")
                for name, array in data.items():
                    dataset = group.create_dataset(name, data=array)
                    dataset.attrs["crc32"] = _checksum(array)
                file.flush()
        except RuntimeError as error:  # how h5py reports a failure while closing
            raise OSError(str(error)) from error


def load(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and attributes of a checkpoint, verified; raises CheckpointError that says what is wrong."""
    import h5py

    path = Path(path)
    if not path.is_file():
        raise CheckpointError(f"{path}: there is no such checkpoint")
    try:
        with h5py.File(path, "r", locking=False) as file:
            if file.attrs.get("format") != FORMAT:
                raise CheckpointError(f"{path}: is not a checkpoint of warpsph")
            version = int(file.attrs["version"])
            if version != VERSION:
                raise CheckpointError(
                    f"{path}: has checkpoint format {version}, this warpsph reads {VERSION}; "
                    f"use {'a newer' if version > VERSION else 'an older'} warpsph"
                )
            text = file["attributes"][...].tobytes()
            if zlib.crc32(text) != int(file.attrs["crc32"]):
                raise CheckpointError(f"{path}: is damaged: the checksum of its attributes is wrong")
            arrays = {}
            for name, dataset in file["arrays"].items():
                array = dataset[()]
                array = array if isinstance(array, np.ndarray) else np.asarray(array)
                if _checksum(array) != int(dataset.attrs["crc32"]):
                    raise CheckpointError(f"{path}: is damaged: the checksum of {name!r} is wrong")
                arrays[name] = array
            return arrays, json.loads(text)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise CheckpointError(f"{path}: cannot be read as a checkpoint: {error}") from error


def latest(folder: Path, message: Callable[[str], None] = warnings.warn) -> Path | None:
    """The newest checkpoint of a folder that can be read; None if there is none.

    Newest is the one with the highest number in its name. Broken ones are skipped, each with a call of
    `message`.
    """
    for path in reversed(_sorted(Path(folder))):
        try:
            load(path)
        except CheckpointError as error:
            message(f"checkpoint skipped: {error}")
        else:
            return path
    return None


def prune(folder: Path, keep: int) -> list[Path]:
    """Delete all but the `keep` newest checkpoints (at least one stays); returns what was deleted."""
    old = _sorted(Path(folder))[: -max(keep, 1)]
    deleted = []
    for path in old:
        try:
            path.unlink(missing_ok=True)
        except OSError:  # it will be tried again after the next checkpoint
            continue
        deleted.append(path)
    return deleted


def delete_after(folder: Path, step: int) -> list[Path]:
    """Delete the checkpoints of steps after `step`, from which a run continues; returns what was deleted."""
    late = [path for path in _sorted(Path(folder)) if _number_of(path) > step]
    for path in late:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"{path}: cannot be deleted: {error.strerror or error}") from error
    return late


def _sorted(folder: Path) -> list[Path]:
    """Checkpoints from the oldest to the newest: files whose names end in a number; others stay."""
    if not folder.is_dir():
        return []
    paths = [path for path in folder.glob("*.h5") if not path.name.startswith(".") and _number_of(path) >= 0]
    return sorted(paths, key=lambda path: (_number_of(path), path.name))


def _number_of(path: Path) -> int:
    digits = re.search(r"\d+$", path.stem)
    return int(digits.group()) if digits else -1


def _checksum(array: np.ndarray) -> int:
    return zlib.crc32(np.ascontiguousarray(array).data)


def _number(value: Any) -> Any:
    """NumPy scalars and arrays, and paths, for JSON."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"a checkpoint cannot hold {type(value).__name__} as an attribute")
