"""Going on from a checkpoint: which one, and whether it fits the case."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import CaseError, Problem, short
from warpsph.files import checkpoint

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.running.model import Model

REACHED = 1.0e-12  # a time counts as reached within this share of it: the sum of the steps is rounded
SAME_CASE = "restart with the case of its run"
# What a checkpoint was made of; a restart may change anything else.
SCENE = ("dimension", "particle_spacing", "precision", "domain", "fluids", "bodies")


def reached(moment: float, target: float) -> bool:
    """Whether a time [s] is another one, or later."""
    return moment >= target * (1.0 - REACHED)


def find_checkpoint(path: Path, message: Callable[[str], None]) -> Path:
    """Return the checkpoint that a file, a checkpoint folder or a run folder stands for; raises CaseError."""
    if not path.is_dir():
        return path
    folder = path / "checkpoint" if (path / "checkpoint").is_dir() else path
    found = checkpoint.latest(folder, message)
    if found is None:
        rule, remedy = "holds no readable checkpoint", "name a .h5 file or a run folder, or run the case anew"
        raise CaseError([Problem("restart", str(path), rule, remedy)])
    return found


def check_unfinished(case: Case, restart: Path, output: Path, moment: float) -> None:
    """Refuse to go on from a checkpoint of a time [s] at or after the end, before anything in a folder is changed.

    A run that was killed between its last checkpoint and its summary may go on: it has its comparison still to write.
    """
    if not reached(moment, case.end_time):
        return
    summary = output / "summary.json"
    if reached(case.end_time, moment) and is_inside(restart, output):
        try:
            if json.loads(summary.read_text(encoding="utf-8"))["status"] != "finished":
                return
        except (OSError, ValueError, KeyError, TypeError):
            return
    rule = f"the checkpoint {restart} is of t = {moment:.6g} s already: there is nothing left to compute"
    raise CaseError([Problem("end_time", case.end_time, rule, "give a later end_time, or name an earlier checkpoint")])


def is_inside(file: Path, folder: Path) -> bool:
    """Whether a checkpoint is one of the run folder's own."""
    return file.resolve().parent == (folder / "checkpoint").resolve()


def scene_of(case: Case) -> dict[str, Any]:
    """Return what must not change between a checkpoint and a restart, as JSON data; densities may."""
    data = {key: value for key, value in case.to_dict(defaults=True).items() if key in SCENE}
    return {**json.loads(json.dumps(data)), "phases": case.phase_names}


def check_fit(model: Model, state: Mapping[str, np.ndarray], attributes: Mapping[str, Any]) -> None:
    """Refuse a checkpoint of another scene; what may change on purpose (end time ...) is not compared."""
    saved, problems = attributes.get("scene", {}), []
    for key, value in scene_of(model.case).items():
        if saved.get(key) != value:
            rule = f"the checkpoint was written with {short(saved.get(key), 200)}"
            problems.append(Problem(key, value, rule, SAME_CASE))
    count = len(state.get("anchor", ()))
    if not problems and not model.particles.changing and count != model.particles.count:
        rule = f"the checkpoint holds {count} particles, the case {model.particles.count}"
        problems.append(Problem("restart", count, rule, SAME_CASE))
    weights = state.get("interface_weight")
    if not problems and weights is not None and "interface_weight" in model.particles.fields:
        balanced = weights.ndim == 2  # one weight for each phase
        if balanced != (model.physics.spec.triple > 0):
            rule = (
                f"the checkpoint is of a run {'with' if balanced else 'without'} a balance of tensions where three fluids "
                "meet, which runs of three fluids and more have if two pairs or more have a tension"
            )
            problems.append(Problem("surface_tension", model.case.to_dict()["surface_tension"], rule, SAME_CASE))
    if problems:
        raise CaseError(problems)
