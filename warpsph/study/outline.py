"""Error of an interface: fluid where the reference has none of its phase, and none where the reference has it.

    wrong area = areas of the particles whose centres lie on the other side of the reference interface than their phase
               + area on the phase's side of the interface that no particle covers

The first part alone would not see fluid that is missing: a patch with a free surface that shrank has no particle on the
wrong side. What particles cover reaches half a spacing beyond the outermost of them, as does the area of a particle; gaps
between them too narrow for a disc of one spacing radius are covered, since particles lie up to 0.85 spacings from the
middle of the gaps between them. Disorder of 0.2 spacings at a free surface counts as 0.07 spacings along it. On the side
of the other phase missing fluid is not counted: where that phase should be the interface does not say (it may end at a
free surface of its own).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from warpsph.errors import CaseError
from warpsph.measure.contour import crossings_above, join_ends
from warpsph.snapshot import Snapshot
from warpsph.study.norms import NotComparable
from warpsph.study.raster import owners
from warpsph.study.results import Results
from warpsph.study.segments import read_segments

PIXELS = 4
"""Pixels a particle spacing, of the picture from which the missing area is found."""

REACH = 1.0
"""Radius of the largest disc that fits into a gap between particles which counts as covered, in particle spacings."""


def interface_error(spec: Any, source: Results) -> dict[str, Any]:
    """The entries of a result for an interface of the case's `reference`, see the module.

    Raises NotComparable if there are no particles of that time, or none with an area.
    """
    line = spec.interface
    try:
        segments = read_segments(source.case.reference_file(line.file), line.scale, line.offset, line.mirror)
    except CaseError as error:
        raise NotComparable("; ".join(f"{problem.value} {problem.rule}" for problem in error.problems)) from error
    particles, walls = source.particles_at(line.time)
    volume = np.asarray(particles.volume, np.float64)
    if not len(particles) or not np.isfinite(volume).all():
        raise NotComparable(f"the particles of t = {line.time:g} s have no volumes: write mass and density")
    closed = join_ends(segments)
    belongs = crossings_above(particles.position, closed) % 2 == 1
    mine = particles.phase == source.case.phase_names.index(spec.phase)
    missing = missing_area(particles, walls, closed, source.case)
    strange = float(volume[mine & ~belongs].sum())
    displaced = float(volume[belongs & ~mine].sum())
    wrong = strange + displaced + missing
    inside = float(volume[belongs].sum()) + missing
    total = float(volume.sum()) if spec.relative_to == "domain" else inside
    note = f"of the area of {'all fluid' if spec.relative_to == 'domain' else spec.phase} at t = {particles.time:g} s"
    if wrong > 0.0:
        note += f"; {100 * (displaced + missing) / wrong:.0f} % of it where {spec.phase} should be"
    if missing > 0.0:
        note += f", {100 * missing / wrong:.0f} % without any fluid"
    if total == 0.0:
        raise NotComparable(f"nothing of the fluid lies where {spec.phase} should be")
    return {"value": wrong, "reference": total, "error": wrong / total, "unit": "m^2", "note": note}


def missing_area(particles: Snapshot, walls: Snapshot | None, segments: np.ndarray, case: Any) -> float:
    """Area on the inner side of a line that neither fluid nor wall covers, m^2.

    segments: (n, 2, 2) of a line without gaps, m; inside is where a ray upwards crosses it an odd number of times
    """
    spacing = float(case.spacing)
    # The inner side lies between the ends of the line along x, and nowhere above it.
    low, high = np.asarray(case.domain.lower, np.float64), np.asarray(case.domain.upper, np.float64)
    lower = np.array([max(low[0], segments[:, :, 0].min()), low[1]])
    upper = np.minimum(high, segments.reshape(-1, 2).max(axis=0))
    size = upper - lower
    if not (size > 0.0).all():
        return 0.0
    columns, rows = (int(count) for count in np.ceil(PIXELS * size / spacing))
    position = particles.position if walls is None else np.concatenate([particles.position, walls.position])
    position = _with_mirrors(position, low, high, case.sides, 2.0 * REACH * spacing)
    empty = owners(position, None, lower, upper, (rows, columns), spacing, REACH) < 0
    if not empty.any():
        return 0.0
    row, column = np.nonzero(empty)
    pixel = size / (columns, rows)
    centres = lower + (np.column_stack([column, row]) + 0.5) * pixel
    return float(np.count_nonzero(crossings_above(centres, segments) % 2) * pixel.prod())


def _with_mirrors(position: np.ndarray, low: np.ndarray, high: np.ndarray, sides: Any, reach: float) -> np.ndarray:
    """Positions (n, 2) and, of those nearer than `reach` to a side that is not open, their mirror images in it, m.

    What lies beyond a wall is not empty, and beyond a periodic side is as full as on this one.
    """
    for axis, side in enumerate(sides):
        for end, place in ((side.lower, low[axis]), (side.upper, high[axis])):
            if end.kind != "open":
                image = position[np.abs(position[:, axis] - place) <= reach]
                image[:, axis] = 2.0 * place - image[:, axis]
                position = np.concatenate([position, image])
    return position
