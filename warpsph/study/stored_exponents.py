"""Lyapunov exponents from the particle files of a run: where particles were in one frame and in another.

Particles are known by their ids. Shifts are part of the way that files tell: a particle stands for the fluid that it began
with, which a scheme that shifts makes true to some part of a spacing only. The exponents that a run follows itself,
`output.lyapunov`, correct that.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.errors import CaseError, Problem
from warpsph.files.output import Series
from warpsph.files.vtp import read_vtp, write_vtp
from warpsph.files.whole_files import make_folder
from warpsph.snapshot import Snapshot
from warpsph.study.plot import Frame, choose_frames, phase_names, read_frame, read_series, save_frames

DIRECTIONS = ("backward", "forward")
LEAST_EIGENVALUE = 0.025  # least eigenvalue of a neighbourhood over the mean of them, below which there is no gradient
REACH = 3.0  # spacings within which particles are neighbours, the usual support of the schemes
ROWS = 100_000  # particles that are worked on at a time


def write_exponents(
    folder: Path | str,
    start: float | None = None,
    end: float | None = None,
    directions: Sequence[str] = DIRECTIONS,
    output: Path | str | None = None,
    pictures: bool = True,
) -> list[Path]:
    """Write the exponents between two frames of a run, a particle file and a picture a direction; return the paths.

    Args:
        folder: run folder.
        start, end: times of the frames [s]; the nearest ones are taken (default: the first and the last one).
        directions: of DIRECTIONS; backward is written at the places of the end, forward at those of the start.
        output: folder (default: ftle in the run folder).
        pictures: whether to draw them.

    Raises CaseError if there is no such run or time, OutputError if a file cannot be read or written.
    """
    folder = Path(folder)
    series, walls = read_series(folder)
    case = load_case(folder / "case.yaml")
    frames = _between(series, start, end)
    first, last, way = follow(series, frames, case)
    target = folder / "ftle" if output is None else Path(output)
    age = last.time - first.time
    written = []
    for direction in directions:
        field, back = f"ftle_{direction}", direction == "backward"
        here, there = (last, -way) if back else (first, way)
        rate = exponents(here.position, there, age, REACH * here.particle_spacing, box_of(case))
        found = dataclasses.replace(here, ftle_age=np.full(len(rate), age), ftle_way=way)
        setattr(found, field, rate)
        path = target / f"{direction}.vtp"
        make_folder(target)
        write_vtp(path, found, ("velocity", "phase", field, "ftle_age", "ftle_way"), "float64")
        written.append(path)
        if pictures:
            wall = read_frame(series, walls, frames[-1 if back else 0]).wall
            frame = Frame(found.time, read_vtp(path), wall)
            written.append(save_frames([frame], field, path.with_suffix(".png"), phase_names(folder)))
    return written


def _between(series: Series, start: float | None, end: float | None) -> list[tuple[float, str]]:
    """The frames from one time to another."""
    first, last = series.frames[0][0], series.frames[-1][0]
    times = [first if start is None else start, last if end is None else end]
    ends = choose_frames(series.frames, times)
    if len(ends) < 2 or times[0] > times[1]:
        rule = f"needs two frames of the run, one after the other, but --from {times[0]:g} and --to {times[1]:g} do not"
        remedy = f"the run has {len(series.frames)} frames from {first:g} to {last:g} s"
        raise CaseError([Problem("--to", times[1], f"{rule} name them", remedy)])
    return [frame for frame in series.frames if ends[0][0] <= frame[0] <= ends[-1][0]]


def box_of(case: Case) -> np.ndarray:
    """The period of each axis (d,) [m], 0 where it is not periodic."""
    extent = np.array(case.domain.upper, dtype=float) - np.array(case.domain.lower, dtype=float)
    return np.asarray(np.where(case.periodic, extent, 0.0))


def nearest(difference: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Differences of places (..., d) of the nearest images [m]."""
    period = np.where(box > 0, box, 1.0)
    return np.asarray(difference - np.where(box > 0, period * np.round(difference / period), 0.0))


def follow(series: Series, frames: Sequence[tuple[float, str]], case: Case) -> tuple[Snapshot, Snapshot, np.ndarray]:
    """Return (fluid of the first frame, of the last one, way from one to the other (n, d) [m]), of what is in all frames.

    Along a periodic axis the way is that of the nearest images from frame to frame: a particle may go less than half of the
    period between two of them. Rows are in the order of the ids.
    """
    box = box_of(case)
    wanted = frames if box.any() else [frames[0], frames[-1]]
    way = np.zeros(0)
    first = before = None
    for _, name in wanted:
        now = read_vtp(series.path.parent / name, case.dimension)
        now = now.select(np.argsort(now.particle_id, kind="stable"))
        if first is None or before is None:
            first, before, way = now, now, np.zeros_like(now.position)
            continue
        ids = np.intersect1d(before.particle_id, now.particle_id, assume_unique=True)
        kept = np.isin(before.particle_id, ids, assume_unique=True)
        before, first, way = before.select(kept), first.select(kept), way[kept]
        now = now.select(np.isin(now.particle_id, ids, assume_unique=True))
        way = way + nearest(now.position - before.position, box)
        before = now
    assert first is not None and before is not None
    return first, before, way


def exponents(place: np.ndarray, way: np.ndarray, age: float, support: float, box: np.ndarray) -> np.ndarray:
    """Return ln(largest singular value of I + grad way)/age at places (n, d) [1/s].

    The gradient is the corrected sum over the neighbours within `support` [m], with the weights of a Wendland C2 kernel; 0
    for particles whose neighbours lie in a line, or in three dimensions in a plane.
    """
    from scipy.spatial import cKDTree

    count, d = place.shape
    if count < 2:
        return np.zeros(count)
    periodic = box > 0
    inside = np.where(periodic, np.mod(place, np.where(periodic, box, 1.0)), place)
    tree = cKDTree(inside, boxsize=box) if periodic.any() else cKDTree(inside)
    most = min(count, _most_neighbours(tree, inside, support))
    result = np.zeros(count)
    for begin in range(0, count, ROWS):
        rows = slice(begin, begin + ROWS)
        distance, other = tree.query(inside[rows], k=most, distance_upper_bound=support, workers=-1)
        there = np.isfinite(distance) & (distance > 0)
        other = np.where(there, other, 0)
        arm = nearest(inside[other] - inside[rows, None], box)
        weighted = arm * np.where(there, np.maximum(1.0 - distance / support, 0.0) ** 3, 0.0)[:, :, None]
        moment = np.einsum("nka,nkb->nab", arm, weighted)
        spread = np.einsum("nka,nkb->nab", way[other] - way[rows, None], weighted)
        eigenvalues = np.linalg.eigvalsh(moment)
        whole = eigenvalues[:, 0] > LEAST_EIGENVALUE * eigenvalues.mean(axis=1)
        gradient = np.eye(d) + spread[whole] @ np.linalg.inv(moment[whole])
        largest = np.linalg.svd(gradient, compute_uv=False)[:, 0]
        values = np.zeros(len(whole))
        values[whole] = np.log(np.maximum(largest, 1e-300)) / age
        result[rows] = values
    return result


def _most_neighbours(tree: Any, place: np.ndarray, support: float) -> int:
    """The largest number of particles within the support of one, itself among them."""
    found = tree.query_ball_point(place, support, return_length=True, workers=-1)
    return max(2, math.ceil(float(np.max(found))))
