"""Bodies of triangles in 3-D: from an STL file or any closed mesh."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpsph.kernels.core.triangles import nearest_triangles
from warpsph.scene.surfaces import NOT_THERE, ShapeError, Surface
from warpsph.start import start_warp

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Mesh", "read_stl"]

_ON_SURFACE = 1e-7
"""Distance over the size of the mesh below which a point lies on it: corners in an STL file are float32."""


class Mesh(Surface):
    """The surface of a closed mesh of triangles.

    Args:
        poly: a pyvista PolyData. Corners at one place are made one, and triangles are turned so that their normals point
        out.

    Raises:
        ShapeError: the mesh is empty, has a hole, an edge of more than two triangles, or encloses no volume.
    """

    def __init__(self, poly: Any) -> None:
        poly = poly.triangulate().clean(tolerance=0.0) if poly.n_cells else poly
        if poly.n_cells == 0:
            raise ShapeError("holds no triangle", "export the mesh again")
        _check_closed(np.asarray(poly.regular_faces))
        poly = poly.compute_normals(
            cell_normals=True, point_normals=False, auto_orient_normals=True, consistent_normals=True, split_vertices=False
        )
        self.poly = poly
        self._tree: Any = None
        self.corners = np.asarray(poly.points, dtype=np.float64)
        self.triangles = np.asarray(poly.regular_faces, dtype=np.intp)
        a, b, c = (self.corners[self.triangles[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        self.bounds = np.stack([self.corners.min(axis=0), self.corners.max(axis=0)])
        self.measure = float(np.einsum("ij,ij->i", a - self.bounds[0], cross).sum() / 6.0)
        if not self.measure > 1e-12 * self.size**3:
            raise ShapeError("encloses no volume", "check the mesh: it may be flat or turned inside out in parts")
        self.area = 0.5 * np.linalg.norm(cross, axis=1)
        self.extent = float(self.area.sum())
        self.normal = cross / np.where(self.area > 0.0, 2.0 * self.area, 1.0)[:, None]

    def signed_distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Surface.signed_distance`."""
        return self._look(points)[0]

    def closest(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.closest`."""
        distance, foot, face = self._look(points)
        normal = self.normal[face]
        # At an edge or a corner of the mesh the way to the foot is not along the normal of the triangle.
        way = points - foot
        slanting = np.abs(distance) - np.abs(np.einsum("ij,ij->i", way, normal)) > 1e-12 * self.size
        slanting &= np.abs(distance) > _ON_SURFACE * self.size
        normal[slanting] = way[slanting] / distance[slanting, None]
        return foot, normal

    def patches(self, size: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """See `Surface.patches`; each triangle is cut into n^2 equal ones."""
        a, b, c = (self.corners[self.triangles[:, k]] for k in range(3))
        longest = np.sqrt(np.max([((b - a) ** 2).sum(1), ((c - b) ** 2).sum(1), ((a - c) ** 2).sum(1)], axis=0))
        cuts = np.maximum(1, np.ceil(longest / size)).astype(np.intp)
        found = []
        for n in np.unique(cuts):
            own = np.flatnonzero(cuts == n)
            weights = _thirds(int(n))
            middle = np.einsum("kw,wij->kij", weights, np.stack([a[own], b[own], c[own]]))
            normal = np.broadcast_to(self.normal[own], middle.shape)
            area = np.broadcast_to(self.area[own] / n**2, middle.shape[:2])
            found.append((middle.reshape(-1, 3), normal.reshape(-1, 3), area.ravel()))
        points, normals, areas = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return points, normals, areas

    def _look(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
        """Signed distance (n,), nearest point (n, 3) and the triangle that it is on (n,).

        The triangle is found in float32, lengths in sizes of the mesh; the rest is float64.
        """
        if self._tree is None:
            start_warp()
            self._tree = wp.Mesh(
                points=wp.array((self.corners - self.bounds[0]) / self.size, dtype=wp.vec3, device="cpu"),
                indices=wp.array(self.triangles.ravel(), dtype=int, device="cpu"),
            )
        n = len(points)
        at = (points - self.bounds[0]) / self.size
        face, sign = wp.zeros(n, dtype=int, device="cpu"), wp.zeros(n, dtype=float, device="cpu")
        farthest = 2.0 + float(np.abs(at).max(initial=0.0)) * 2.0
        inputs = [self._tree.id, wp.array(at, dtype=wp.vec3, device="cpu"), farthest, face, sign]
        wp.launch(nearest_triangles, dim=n, inputs=inputs, device="cpu")
        triangle = face.numpy().astype(np.intp)
        foot = _nearest_on_triangles(points, *(self.corners[self.triangles[triangle, k]] for k in range(3)))
        way = points - foot
        # x.
        height = np.einsum("ij,ij->i", way, self.normal[triangle])
        length = np.linalg.norm(way, axis=1)
        above = np.abs(height) > 0.99 * length
        inside = np.where(above, height < 0.0, sign.numpy() < 0.0)
        return np.where(inside, -length, length), foot, triangle


def _nearest_on_triangles(
    p: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The point of the triangle (a, b, c) nearest to p, row by row; all (n, 3)."""
    ab, ac = b - a, c - a
    d00, d01, d11 = (np.einsum("ij,ij->i", u, v) for u, v in ((ab, ab), (ab, ac), (ac, ac)))
    d20, d21 = np.einsum("ij,ij->i", p - a, ab), np.einsum("ij,ij->i", p - a, ac)
    det = d00 * d11 - d01 * d01
    det = np.where(det > 0.0, det, 1.0)
    v, w = (d11 * d20 - d01 * d21) / det, (d00 * d21 - d01 * d20) / det
    within = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0)
    best = a + v[:, None] * ab + w[:, None] * ac
    least = np.where(within, -1.0, np.inf)
    for start, way in ((a, ab), (b, c - b), (c, a - c)):
        length2 = np.einsum("ij,ij->i", way, way)
        share = np.clip(np.einsum("ij,ij->i", p - start, way) / np.where(length2 > 0.0, length2, 1.0), 0.0, 1.0)
        foot = start + share[:, None] * way
        distance = np.einsum("ij,ij->i", p - foot, p - foot)
        nearer = distance < least
        best = np.where(nearer[:, None], foot, best)
        least = np.where(nearer, distance, least)
    return best


def _check_closed(triangles: NDArray[Any]) -> None:
    """Raise ShapeError unless every edge of the triangles (n, 3) belongs to exactly two of them."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    if (count == 1).any():
        raise ShapeError(f"is not watertight: it has {(count == 1).sum()} open edges", "close the holes of the mesh")
    if (count > 2).any():
        raise ShapeError(
            f"is not watertight: {(count > 2).sum()} edges belong to more than two triangles",
            "export one closed surface without inner walls",
        )


def _thirds(n: int) -> NDArray[np.float64]:
    """Barycentric weights (n^2, 3) of the middles of the n^2 equal triangles that a triangle is cut into."""
    found = []
    for i in range(n):
        for j in range(n - i):
            found.append((i + 1 / 3, j + 1 / 3))
            if i + j < n - 1:
                found.append((i + 2 / 3, j + 2 / 3))
    uv = np.array(found) / n
    return np.column_stack([1.0 - uv.sum(axis=1), uv])


def read_stl(path: Path, scale: float = 1.0, translate: Sequence[float] = (0.0, 0.0, 0.0)) -> Mesh:
    """The surface in an STL file.

    Args:
        path: an ASCII or binary STL file.
        scale: factor on its coordinates, which have no unit: metres are what they are times this.
        translate: added to the scaled coordinates, m.

    Raises:
        ShapeError: the file is missing or no STL file, or the mesh is not closed.
    """
    import pyvista as pv

    if not path.is_file():
        raise ShapeError(f"names a file that is not there: {path}", NOT_THERE)
    head = path.read_bytes()[:4096]
    if not _is_stl(head, path.stat().st_size):
        raise ShapeError(f"is no STL file: {path}", "export the mesh as ASCII or binary STL")
    poly = pv.read(str(path))
    poly.points = np.asarray(poly.points, dtype=np.float64) * scale + np.asarray(translate, dtype=np.float64)
    return Mesh(poly)


def _is_stl(head: bytes, size: int) -> bool:
    """Whether a file that begins with `head` and has `size` bytes is an STL file, ASCII or binary."""
    if head.lstrip().startswith(b"solid") and b"facet" in head:
        return True
    return len(head) >= 84 and size == 84 + 50 * int.from_bytes(head[80:84], "little")
