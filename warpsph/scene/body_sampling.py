"""Boundary particles of a body: where they are, and what the surface is to each of them (theory: bodies#sampling).

Layers parallel to the surface, half a spacing deep and then one spacing apart, as many as the smoothing kernel reaches. A
body fills its layers exactly: the volumes of the particles add up to the volume of the layers. A straight body whose
faces lie between cells of the lattice gets the cells of the lattice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.scene.facets import Facets, facets_of
from warpsph.scene.rings import CORNER, Rows, ball_rings, outline_rings
from warpsph.scene.sheets import Frames, SheetRows, beside_sheets, frames_of, sheet_rows
from warpsph.scene.shells import ball_shells, brick_shells, relaxed_shells
from warpsph.scene.surfaces import Ball, Brick, Hollow, Outline, Surface
from warpsph.scene.tails import Tail, find_tails

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["Sampling", "sample", "working_memory"]

_PATCHES = {2: 16, 3: 4}
"""Patches of the surface a spacing, by dimension, that are shared among the particles of the first layer."""


# Bytes of host memory while a body is sampled, measured as peaks with tracemalloc, by how its surface is looked at.
_PIECE, _MESH_PIECE = 50, 700  # of a patch of its surface
_SITE, _MESH_SITE = 100, 400  # of a site of the lattice in the box around it, of bodies in 3-D that are no spheres


@dataclass(frozen=True)
class Sampling:
    """The boundary particles of a body: n of them in d dimensions.

    position: (n, d), m
    foot: (n, d), the point of the surface nearest to each, m
    normal: (n, d), unit normal of the surface there, into the fluid
    depth: (n,), distance of the particle from its foot, m; position + depth normal = foot
    area: (n,), length (2-D) or area (3-D) of surface that a particle of the first layer stands for, m^(d-1); 0 below it, in
        the corners of hollow bodies, from where no surface is nearest, and past the edges of tails
    volume: (n,), m^d
    layer: (n,), 0 at the surface
    leader: (n,), index of the particle with an area whose foot is nearest; of itself if it has one
    sheet: (n,), 0, or for particles of a thin tail the side through which alone they are seen, 1 or -1 (`tails.py`); they
        overlap the other side and the fluid there, and their volumes are those of a thick body
    frame: (n,), which of `frames` the lines of sight to a particle of a tail are judged by, -1 for others
    frames: of the tails
    facets: what each particle with an area stands for, by faces
    """

    position: NDArray[np.float64]
    foot: NDArray[np.float64]
    normal: NDArray[np.float64]
    depth: NDArray[np.float64]
    area: NDArray[np.float64]
    volume: NDArray[np.float64]
    layer: NDArray[np.intp]
    leader: NDArray[np.intp]
    sheet: NDArray[np.int8]
    frame: NDArray[np.intp]
    frames: Frames
    facets: Facets

    @property
    def count(self) -> int:
        """Number of particles."""
        return len(self.depth)

    def only(self, kept: NDArray[np.bool_]) -> Sampling:
        """A part of the particles (n,); those whose leader goes get another."""
        columns = {name: getattr(self, name)[kept] for name in _COLUMNS}
        return replace(self, **columns, facets=self.facets.only(kept)).led()

    def reflected(self, rows: NDArray[np.intp], axis: int, plane: float) -> Sampling:
        """The particles, then the images of some `rows` across the plane at right angles to an axis at `plane`, m."""
        columns: dict[str, Any] = {name: getattr(self, name) for name in _COLUMNS}
        columns = {name: np.concatenate([column, column[rows]]) for name, column in columns.items()}
        for name in ("position", "foot"):
            columns[name][self.count :, axis] = 2.0 * plane - columns[name][self.count :, axis]
        columns["normal"][self.count :, axis] *= -1.0
        columns["area"][self.count :] = 0.0
        return replace(self, **columns)

    def carriers(self) -> NDArray[np.intp]:
        """Which frame each particle carries (n,), -1 for none: every frame moves with a particle of a tail, the nearest
        free one."""
        from scipy.spatial import cKDTree

        carried = np.full(self.count, -1, dtype=np.intp)
        free = np.flatnonzero(self.sheet)
        for k, point in enumerate(self.frames.point):
            if len(free):
                nearest = int(cKDTree(self.position[free]).query(point)[1])
                carried[free[nearest]] = k
                free = np.delete(free, nearest)
        return carried

    def led(self) -> Sampling:
        """The same particles, each led by the one with an area whose foot is nearest, of its own sheet if there is one.

        Without any area, of a body that no fluid meets, each leads itself.
        """
        from scipy.spatial import cKDTree

        leader = np.arange(self.count)
        for sheet in (-1, 0, 1):
            own = self.sheet == sheet
            first = np.flatnonzero(own & (self.area > 0.0))
            if len(first) == 0:
                first = np.flatnonzero(self.area > 0.0)
            if len(first) and own.any():
                leader[own] = first[cKDTree(self.foot[first]).query(self.foot[own])[1]]
                leader[first] = first
        return replace(self, leader=leader)


_TIE = 1e-6
"""Share of the size of a body by which its faces are as near to a particle."""

_SHARPEST = 0.5
"""Cosine between the mean normal and a face below which an edge is sharper than 60 degrees: a tail, or a plate."""

_COLUMNS = tuple(field.name for field in fields(Sampling) if field.name not in ("frames", "facets"))
"""What a sampling has of each particle."""


def sample(
    surface: Surface,
    spacing: float,
    layers: int,
    lower: Sequence[float] | None = None,
    upper: Sequence[float] | None = None,
    mean_edges: bool = False,
) -> Sampling:
    """The boundary particles of a body.

    Args:
        surface: of the body.
        spacing: particle spacing, m.
        layers: how many; with enough of them the body is full.
        lower, upper: only particles and surface between these corners count, m; None: all.
        mean_edges: particles as near to several faces have their edge and mean normal, else one of the faces.
    """
    rows = layers_of(surface, spacing, layers)
    low = np.full(surface.dimension, -np.inf) if lower is None else np.asarray(lower, dtype=np.float64)
    high = np.full(surface.dimension, np.inf) if upper is None else np.asarray(upper, dtype=np.float64)
    tails = find_tails(surface, spacing, layers * spacing) if isinstance(surface, Outline) else []
    if tails:
        thin = beside_sheets(tails, surface.closest(rows.position)[0], spacing)
        rows = Rows(rows.position[~thin], rows.volume[~thin], rows.layer[~thin])
    frames = Frames.joined([frames_of(tail, spacing, layers * spacing) for tail in tails], surface.dimension)
    found = [_of_layers(surface, rows, mean_edges)]
    real = [rows.layer == 0]
    for tail in tails:
        for sheet in tail.sheets:
            own = sheet_rows(tail, sheet, rows, spacing, layers)
            found.append(_of_sheet(own, sheet.side, frames))
            real.append(own.real & (own.layer == 0))
    joined = replace(_joined(found), frames=frames)
    kept = np.all((joined.position > low) & (joined.position < high), axis=1)
    first = np.concatenate(real) & kept
    facets = _facets(surface, joined, first, tails, spacing, low, high)
    area = np.zeros(joined.count)
    np.add.at(area, facets.owner, facets.area)
    return replace(joined, area=area, facets=facets).only(kept)


def working_memory(surface: Surface, spacing: float, layers: int) -> float:
    """About how many bytes of host memory `sample` takes, which works on the whole body, in the domain or not."""
    d, shape = surface.dimension, surface.shape if isinstance(surface, Hollow) else surface
    pieces = surface.extent / (spacing / _PATCHES[d]) ** (d - 1)
    if d == 2 or isinstance(shape, Ball):
        return pieces * _PIECE
    room = surface.bounds[1] - surface.bounds[0] + (2.0 * layers * spacing if surface.hollow else 0.0)
    sites = float(np.prod(room / spacing))
    if isinstance(shape, Brick):
        return pieces * _PIECE + sites * _SITE
    return pieces * _MESH_PIECE + sites * _MESH_SITE


def layers_of(surface: Surface, spacing: float, layers: int) -> Rows:
    """The particles of the layers of a body, without what the surface is to them."""
    hollow = isinstance(surface, Hollow)
    shape = surface.shape if isinstance(surface, Hollow) else surface
    if isinstance(shape, Ball):
        make = ball_rings if shape.dimension == 2 else ball_shells
        return make(shape, spacing, layers, hollow)
    if isinstance(shape, Outline):
        return outline_rings(shape, spacing, layers, hollow)
    if isinstance(shape, Brick):
        return brick_shells(shape, spacing, layers, hollow)
    return relaxed_shells(surface, spacing, layers)


def _of_layers(surface: Surface, rows: Rows, mean_edges: bool) -> Sampling:
    """The particles of layers, without areas and leaders."""
    foot, normal = _nearest(surface, rows.position) if mean_edges else surface.closest(rows.position)
    n, d = rows.position.shape
    return Sampling(
        position=rows.position,
        foot=foot,
        normal=normal,
        depth=np.linalg.norm(rows.position - foot, axis=1),
        area=np.zeros(n),
        volume=rows.volume,
        layer=rows.layer,
        leader=np.arange(n),
        sheet=np.zeros(n, dtype=np.int8),
        frame=np.full(n, -1, dtype=np.intp),
        frames=Frames.joined([], d),
        facets=Facets.none(d),
    )


def _nearest(surface: Surface, position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Foot (n, d), m, and normal (n, d) of particles; of one that is as near to several faces, their edge and mean normal.

    Which of the faces `Surface.closest` names rounding decides, and with it how the fluid would be continued into a corner.
    The edge is the point of the mean normal through the particle that lies on the planes of all these faces.
    """
    foot, normal = surface.closest(position)
    depth = np.linalg.norm(position - foot, axis=1)
    aside = _TIE * surface.size
    found = [normal]
    for axis in range(position.shape[1]):
        for way in (-aside, aside):
            moved = position + way * np.eye(position.shape[1])[axis]
            other_foot, other = surface.closest(moved)
            tied = np.abs(np.linalg.norm(position - other_foot, axis=1) - depth) < 4.0 * aside
            known = [np.einsum("ij,ij->i", other, one) > math.cos(CORNER) for one in found]
            found.append(np.where((tied & ~np.any(known, axis=0))[:, None], other, 0.0))
    total = np.sum(found, axis=0)
    length = np.linalg.norm(total, axis=1)
    mean = total / np.where(length > 0.0, length, 1.0)[:, None]
    slope = np.einsum("ij,ij->i", mean, normal)
    # Faces that are opposite, in the middle of a thin body, or far apart on a bent one have no edge in common.
    edge = (slope > _SHARPEST) & (slope < math.cos(0.5 * CORNER))
    outwards = np.sign(np.einsum("ij,ij->i", foot - position, normal))
    point = position + (outwards * depth / np.where(edge, slope, 1.0))[:, None] * mean
    edge &= np.linalg.norm(point - surface.closest(point)[0], axis=1) < 4.0 * aside
    return np.where(edge[:, None], point, foot), np.where(edge[:, None], mean, normal)


def _of_sheet(rows: SheetRows, side: int, frames: Frames) -> Sampling:
    """The particles of a sheet, without areas and leaders; the frames are those of all tails."""
    from scipy.spatial import cKDTree

    n = len(rows.position)
    return Sampling(
        position=rows.position,
        foot=rows.foot,
        normal=rows.normal,
        depth=np.linalg.norm(rows.position - rows.foot, axis=1),
        area=np.zeros(n),
        volume=rows.volume,
        layer=rows.layer,
        leader=np.arange(n),
        sheet=np.full(n, side, dtype=np.int8),
        frame=cKDTree(frames.point).query(rows.foot)[1],
        frames=Frames.joined([], 2),
        facets=Facets.none(2),
    )


def _joined(parts: list[Sampling]) -> Sampling:
    """Several samplings as one, without their frames, facets and leaders."""
    columns: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS}
    return Sampling(frames=parts[0].frames, facets=parts[0].facets, **columns)


def _facets(
    surface: Surface,
    sampling: Sampling,
    first: NDArray[np.bool_],
    tails: list[Tail],
    spacing: float,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> Facets:
    """The surface between two corners shared among the particles `first` (n,), each piece to the nearest one.

    Where the body is thin that of its own sheet is meant: the side of a tail is left to the particles of that side.
    """
    from scipy.spatial import cKDTree

    middle, normal, size = surface.patches(spacing / _PATCHES[surface.dimension])
    held = np.all((middle >= low) & (middle <= high), axis=1)
    middle, normal, size = middle[held], normal[held], size[held]
    side = np.zeros(len(middle), dtype=np.int8)
    for tail in tails:
        near = np.flatnonzero(beside_sheets([tail], middle, spacing))
        across = np.array([-tail.along[1], tail.along[0]])
        side[near] = np.where(normal[near] @ across > 0.0, 1, -1)
    owner = np.full(len(middle), -1, dtype=np.intp)
    for own in (-1, 0, 1):
        rows = np.flatnonzero(first & (sampling.sheet == own))
        if len(rows) == 0:
            rows = np.flatnonzero(first)  # the nose of a body that is a tail all the way
        pieces = side == own
        if len(rows) and pieces.any():
            owner[pieces] = rows[cKDTree(sampling.position[rows]).query(middle[pieces])[1]]
    shared = (owner >= 0) & (size > 0.0)
    return facets_of(
        surface, owner[shared], middle[shared], normal[shared], size[shared], sampling.foot, sampling.normal
    )
