"""Interfaces of a 2-D scene as lines: drawn through the particles, and the sides of a line that is given.

The share of a phase at a point is what its particles contribute to the smoothing sum there,

    c(x) = sum over the phase of V W(x - x_j) / sum over all fluid of V W(x - x_j),

1 inside the phase, 0 outside, 1/2 on the interface. It is evaluated on a grid of two nodes a particle spacing, and
marching squares draw the line c = 1/2. W is a Wendland C2 kernel with h = 2 particle spacings, wide enough that the
rows of a lattice leave 0.5 % of the length of the line, an evened-out arrangement less. So

- a line of any shape is found, several pieces and holes among them;
- one particle alone in the other phase makes c = 0.14 there, three together 0.4: they belong to no line;
- threads thinner than about 1.5 spacings are lost, and where the line has the curvature k it lies 0.6 k spacing^2 on
  its hollow side (0.6 % of a radius of 10 spacings, 0.15 % of 20);
- where fluid and walls fill less than 0.85 of the kernel, at a free surface, what is missing counts as another phase.

Walls are their particles. Of schemes whose walls at sides of the domain are mirrors there are none: cells of a lattice
stand in for them (`cells_behind_mirrors`), so that a line ends at a wall with every scheme. The shares go on into walls. Of
the area of a phase the part in bodies is taken off: the share of their particles in the sum over fluid and bodies, whose
integral is the area of the bodies whatever their shape.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

SMOOTHING = 2.0
"""Smoothing length of the share of a phase, in particle spacings; the kernel reaches twice as far."""

NODES = 2
"""Nodes of the grid a particle spacing."""

LEVEL = 0.5
"""Share of a phase on its surface."""

_GAP = 0.15
"""Missing part of the kernel up to which a point counts as filled: disorder and the gap at an interface stay below."""


@dataclass(frozen=True)
class Share:
    """The share of a phase on the nodes of a grid.

    values: (nx + 1, ny + 1), between 0 and 1
    x, y: (nx + 1,) and (ny + 1,) coordinates of the nodes, m; the first and last lie on the sides of the domain
    room: (nx + 1, ny + 1), part of the surroundings of each node that bodies leave to fluid; None: all of it
    """

    values: np.ndarray
    x: np.ndarray
    y: np.ndarray
    room: np.ndarray | None = None

    @property
    def amount(self) -> float:
        """The area that the phase takes, m^2: the integral of c over what bodies leave, in which c goes on."""
        values = self.values if self.room is None else self.values * self.room
        return float(_trapezoid(self.x) @ values @ _trapezoid(self.y))


def _trapezoid(nodes: np.ndarray) -> np.ndarray:
    """Weights (n,) of the trapezoidal rule on evenly spaced nodes."""
    weight = np.full(len(nodes), (nodes[-1] - nodes[0]) / (len(nodes) - 1))
    weight[[0, -1]] *= 0.5
    return weight


def shares_of_phases(
    position: np.ndarray,
    volume: np.ndarray,
    phase: np.ndarray,
    count: int,
    lower: Sequence[float] | np.ndarray,
    upper: Sequence[float] | np.ndarray,
    periodic: Sequence[bool],
    spacing: float,
) -> list[Share]:
    """The share of each of `count` phases, see the module.

    position: (n, 2) of all particles, walls included, m
    volume: (n,) their areas, m^2
    phase: (n,) int, index of the phase, -1 for walls
    lower, upper, periodic: of the domain, an entry an axis, m
    spacing: particle spacing, m
    """
    x, volume, phase = np.asarray(position, np.float64), np.asarray(volume, np.float64), np.asarray(phase)
    low = np.asarray(lower, np.float64)
    extent = np.asarray(upper, np.float64) - low
    wraps = np.asarray(periodic, bool)
    support = 2.0 * SMOOTHING * spacing
    cells = np.maximum(np.rint(NODES * extent / spacing).astype(np.int64), 1)
    step = extent / cells
    # Of a periodic axis the last node is the first one again; it is added in the end.
    size = np.where(wraps, cells, cells + 1)
    nodes = [low[k] + step[k] * np.arange(size[k]) for k in (0, 1)]
    values, mixed, wanted, near = _far_field(x, volume, phase, count, low, extent, wraps, support, nodes)

    # Sums for the wanted nodes alone, numbered in their order; one more entry takes what falls elsewhere.
    places = int(np.count_nonzero(wanted))
    number = np.full(wanted.shape, places)
    number[wanted] = np.arange(places)
    x, volume, phase = x[near], volume[near], phase[near]
    in_body = (phase < 0) & ((x >= low) & (x <= low + extent)).all(axis=1)
    rows = [(phase < 0) & ~in_body, in_body, *(phase == k for k in range(count))]
    sums = np.zeros((len(rows), places + 1))
    first = np.ceil((x - support - low) / step).astype(np.int64)
    reach = np.floor(2.0 * support / step).astype(np.int64) + 1
    node_y = first[:, 1, None] + np.arange(reach[1])
    square_y = (low[1] + node_y * step[1] - x[:, 1, None]) ** 2
    node_y = node_y % size[1] if wraps[1] else node_y
    within_y = (node_y >= 0) & (node_y < size[1])
    node_y = np.where(within_y, node_y, 0)
    for i in range(int(reach[0])):
        node_x = first[:, 0] + i
        q = np.sqrt((low[0] + node_x * step[0] - x[:, 0])[:, None] ** 2 + square_y) / support
        node_x = node_x % size[0] if wraps[0] else node_x
        within = (node_x >= 0) & (node_x < size[0])
        at = number[np.where(within, node_x, 0)[:, None], node_y]
        at[~within_y | ~within[:, None]] = places
        weight = volume[:, None] * (1.0 - np.minimum(q, 1.0)) ** 4 * (1.0 + 4.0 * q)
        for row, mine in zip(sums, rows, strict=True):
            if mine.any():
                row += np.bincount(at[mine].ravel(), weight[mine].ravel(), minlength=places + 1)
    sums *= 7.0 / (math.pi * support**2)
    fluid = sums[2:].sum(axis=0)
    void = 1.0 - fluid - sums[0] - sums[1]
    total = fluid + np.clip(2.0 * (void - _GAP), 0.0, np.maximum(void, 0.0))
    axes = [low[k] + step[k] * np.arange(cells[k] + 1) for k in (0, 1)]

    def closed(value: np.ndarray) -> np.ndarray:
        for k in np.flatnonzero(wraps):
            value = np.concatenate([value, value.take([0], axis=k)], axis=k)
        return value

    room = np.ones(wanted.shape)
    # The particles of the two sides of a thin tail overlap: bodies take no more than fluid and sides leave.
    bodies = np.minimum(sums[1], np.maximum(1.0 - fluid - sums[0], 0.0))
    room[wanted] = _ratio(fluid, fluid + bodies)[:places]
    room = closed(room)
    result = []
    for own, value in zip(sums[2:], values, strict=True):
        value[mixed] = _ratio(own, total)[number[mixed]]
        result.append(Share(closed(value), axes[0], axes[1], room))
    return result


def _ratio(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Part over whole, 0 where there is nothing."""
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0)


def cells_behind_mirrors(case: Any) -> tuple[np.ndarray, float]:
    """Centres (n, 2) of cells behind the walls at sides of a 2-D domain where these are mirrors, m, and their area, m^2.

    Like the wall particles of the other schemes they reach as far as the kernel, fill the corner between two walls, and end
    at the rim of an open side. None, where the scheme has particles there itself.
    """
    if not case.scheme.mirrors_sides:
        return np.empty((0, 2)), 0.0
    layers = math.ceil(2.0 * SMOOTHING)
    axes, inside, area = [], [], 1.0
    for low, high, sides in zip(case.domain.lower, case.domain.upper, case.sides, strict=True):
        count = max(round((high - low) / case.spacing), 1)
        before, after = (layers if side.kind == "wall" else 0 for side in (sides.lower, sides.upper))
        index = np.arange(-before, count + after)
        axes.append(low + (index + 0.5) * ((high - low) / count))
        inside.append((index >= 0) & (index < count))
        area *= (high - low) / count
    behind = ~(inside[0][:, None] & inside[1])
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)[behind], area


def _far_field(
    x: np.ndarray,
    volume: np.ndarray,
    phase: np.ndarray,
    phases: int,
    low: np.ndarray,
    extent: np.ndarray,
    wraps: np.ndarray,
    support: float,
    nodes: list[np.ndarray],
) -> tuple[list[np.ndarray], np.ndarray, np.ndarray, np.ndarray]:
    """Where the shares are 0 or 1 at a glance, since only one phase is within reach: most of the scene.

    Returns the values of all nodes for each phase, the masks of the nodes whose shares need the sums and of those that need
    any, as what bodies leave does beside them, and the mask of the particles that these sums need.
    """
    count = np.maximum((extent / support).astype(np.int64), 1)
    size = extent / count

    def bins_of(points: np.ndarray, k: int) -> np.ndarray:
        index = np.floor((points - low[k]) / size[k]).astype(np.int64)
        return index % count[k] if wraps[k] else np.clip(index, 0, count[k] - 1)

    def amount(of: np.ndarray) -> np.ndarray:
        flat = at[0][of] * count[1] + at[1][of]
        return np.bincount(flat, volume[of], minlength=int(count.prod())).reshape(count)

    def around(mask: np.ndarray) -> np.ndarray:
        """The mask and the bins next to it, across the sides too: where these are walls, a few sums too many."""
        for k in (0, 1):
            mask = mask | np.roll(mask, 1, axis=k) | np.roll(mask, -1, axis=k)
        return mask

    at = [bins_of(x[:, k], k) for k in (0, 1)]
    inside = ((x >= low) & (x <= low + extent)).all(axis=1)
    # a free surface runs through a bin that fluid and bodies do not fill
    reached = [around(amount(inside) < 0.6 * size.prod())]
    reached += [around(amount(phase == k) > 0.0) for k in range(phases)]
    mixed = np.sum(reached, axis=0) > 1
    wanted = mixed | around(amount(inside & (phase < 0)) > 0.0)
    node_bins = np.ix_(bins_of(nodes[0], 0), bins_of(nodes[1], 1))
    values = [each[node_bins].astype(np.float64) for each in reached[1:]]
    return values, mixed[node_bins], wanted[node_bins], around(wanted)[at[0], at[1]]


# ------------------------------------------------------------------------------------------------------------
# marching squares


@dataclass(frozen=True)
class Contour:
    """The line around a phase.

    segments: (k, 2, 2) the two ends of each piece, of these x and y, m; the sides of the domain are no part of it
    inside: (nx, ny) share of each cell of the grid that lies inside, 0 to 1
    lowest, highest: (2,) ends of the phase along each axis, m: of the line, or the side of the domain that it touches
    cell: area of a cell, m^2
    """

    segments: np.ndarray
    inside: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray
    cell: float

    @property
    def length(self) -> float:
        """Length of the line, m."""
        return float(np.hypot(*(self.segments[:, 1] - self.segments[:, 0]).T).sum())

    @property
    def area(self) -> float:
        """Area that it encloses, m^2."""
        return float(self.inside.sum() * self.cell)

    @property
    def circularity(self) -> float:
        """2 sqrt(pi area) / length: perimeter of the circle of the same area over the length of the line."""
        length = self.length
        return 2.0 * math.sqrt(math.pi * self.area) / length if length > 0.0 else math.nan

    def asymmetry(self, axis: int) -> float:
        """Mean distance of the line from its mirror image, m.

        axis: the one across which it is mirrored, at the middle of the domain. The area between two lines close together
        is their distance integrated along them: this is the area in which the phase differs from its mirror image, over
        the length of the line.
        """
        length = self.length
        difference = np.abs(self.inside - np.flip(self.inside, axis)).sum() * self.cell
        return float(difference / length) if length > 0.0 else math.nan


# corners of a cell counter-clockwise from its lower left; edge k goes from corner k to the next
_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def contour(share: Share) -> Contour:
    """The line at which the share of a phase is 1/2, by marching squares with linear interpolation."""
    v = share.values
    cells = np.array(v.shape) - 1
    parts = [(slice(a, a + cells[0]), slice(b, b + cells[1])) for a, b in _CORNERS]
    above = v >= LEVEL
    within = np.sum([above[part] for part in parts], axis=0)
    cut = (within > 0) & (within < 4)
    value = np.stack([v[part][cut] for part in parts], axis=1)
    following = np.roll(value, -1, axis=1)
    corners = value >= LEVEL
    crossed = corners != np.roll(corners, -1, axis=1)
    along = np.divide(LEVEL - value, following - value, out=np.zeros_like(value), where=crossed)
    points = _CORNERS + along[:, :, None] * (np.roll(_CORNERS, -1, axis=0) - _CORNERS)

    # Two opposite corners inside: one piece or two, as the mean of the four says. The two lines of such a cell cut off
    # the corners that are inside, or those that are not; corners 0 and 2 lie between the edges 3, 0 and 1, 2.
    saddle = crossed.all(axis=1)
    apart = saddle & (value.mean(axis=1) < LEVEL)
    first_pair = saddle & (corners[:, 0] == apart)
    other_pair = saddle & ~first_pair
    rows = np.arange(len(value))
    start, end = np.argmax(crossed, axis=1), 3 - np.argmax(crossed[:, ::-1], axis=1)
    start[saddle] = 0
    end[saddle] = np.where(first_pair, 3, 1)[saddle]
    lines = [(rows, start, end), (rows[first_pair], 1, 2), (rows[other_pair], 2, 3)]
    place = np.stack(np.nonzero(cut), axis=1)
    ends = [np.stack([place[row] + points[row, a], place[row] + points[row, b]], axis=1) for row, a, b in lines]
    scale = np.array([share.x[-1] - share.x[0], share.y[-1] - share.y[0]]) / cells
    segments = np.concatenate(ends) * scale + (share.x[0], share.y[0])

    area = _polygon_area(points, corners, crossed)
    legs = np.where(corners, along * (1.0 - np.roll(along, 1, axis=1)), 0.0)
    area[apart] = 0.5 * legs.sum(axis=1)[apart]
    inside = (within == 4).astype(np.float64)
    inside[cut] = area

    ends_of = []
    for k, axis in enumerate((share.x, share.y)):
        found = np.concatenate([segments[:, :, k].ravel(), axis[above.any(axis=1 - k)]])
        ends_of.append((found.min(), found.max()) if len(found) else (math.nan, math.nan))
    lowest, highest = np.array(ends_of).T
    return Contour(segments, inside, lowest, highest, float(scale.prod()))


def _polygon_area(points: np.ndarray, corners: np.ndarray, crossed: np.ndarray) -> np.ndarray:
    """Area (n,) of the part of unit cells that lies inside, taken as one piece.

    points: (n, 4, 2) crossing of each edge; corners, crossed: (n, 4) which corners lie inside, which edges are crossed
    """
    ring = np.empty((len(points), 8, 2))
    ring[:, 0::2], ring[:, 1::2] = _CORNERS, points
    there = np.empty((len(points), 8), bool)
    there[:, 0::2], there[:, 1::2] = corners, crossed
    # A corner that is not there repeats the one before it and so adds nothing; before the first comes the last.
    last = ring[np.arange(len(ring)), 7 - np.argmax(there[:, ::-1], axis=1)]
    for k in range(8):
        last = np.where(there[:, k, None], ring[:, k], last)
        ring[:, k] = last
    x, y = ring[..., 0], ring[..., 1]
    return np.asarray(0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1))


# ------------------------------------------------------------------------------------------------------------
# sides of a line


def join_ends(segments: np.ndarray) -> np.ndarray:
    """Segments (n, 2, 2) of lines that were stored piece by piece, with the small gaps between the pieces closed, m.

    The facets of a volume-of-fluid program are cut at the faces of its cells, each by itself, so that their ends do not
    quite meet. Each end is joined to the nearest end of another segment, if that is nearer to no other end and no
    further away than a segment is long on average; the joints are appended.
    """
    count = len(segments)
    if count < 2:
        return segments
    ends = np.asarray(segments, np.float64).reshape(-1, 2)
    owner = np.repeat(np.arange(count), 2)
    limit = float(np.hypot(*(segments[:, 1] - segments[:, 0]).T).mean())
    free = np.ones(len(ends), bool)
    joints = []
    while True:
        left = np.flatnonzero(free)
        nearest, distance = _nearest(ends[left], owner[left])
        mutual = (nearest[nearest] == np.arange(len(left))) & (np.arange(len(left)) < nearest) & (distance <= limit)
        if not mutual.any():
            break
        a, b = left[mutual], left[nearest[mutual]]
        joints.append(np.stack([ends[a], ends[b]], axis=1)[distance[mutual] > 0.0])
        free[a] = free[b] = False
    return np.concatenate([segments, *joints])


def _nearest(points: np.ndarray, owner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index of, and distance to, the nearest point of another owner; (n,) each, infinitely far if there is none.

    No owner has more than two points.
    """
    from scipy.spatial import cKDTree

    if not len(points):
        return np.zeros(0, np.int64), np.zeros(0)
    # Of the three nearest one is of another owner, the point itself and its fellow being the other two.
    distance, index = cKDTree(points).query(points, k=3)
    index = np.minimum(index, len(points) - 1)  # one beyond the last stands for none, infinitely far
    distance = np.where(owner[index] == owner[:, None], math.inf, distance)
    first = np.argmin(distance, axis=1)[:, None]
    return np.take_along_axis(index, first, axis=1)[:, 0], np.take_along_axis(distance, first, axis=1)[:, 0]


def crossings_above(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """How often a ray upwards (+y) from each point crosses a line, (n,) int.

    points: (n, 2), m
    segments: (k, 2, 2), m
    """
    order = np.argsort(points[:, 0], kind="stable")
    x, y = points[order].T
    found = np.zeros(len(points), np.int64)
    left, right = segments[:, :, 0].min(axis=1), segments[:, :, 0].max(axis=1)
    # half-open intervals: where two segments meet, one of them counts
    ranges = np.searchsorted(x, left), np.searchsorted(x, right)
    for first, last, ((x1, y1), (x2, y2)) in zip(*ranges, segments, strict=True):
        if first < last:
            found[first:last] += y1 + (x[first:last] - x1) * ((y2 - y1) / (x2 - x1)) > y[first:last]
    result = np.empty_like(found)
    result[order] = found
    return result
