"""Lines around phases: lengths, areas and places that follow by hand, and the sides of a reference line."""

import math

import numpy as np
import pytest

from warpsph.measure.contour import SMOOTHING, Contour, Share, contour, crossings_above, join_ends, shares_of_phases

CLOSED = (False, False)


def cells(spacing, lower=(0.0, 0.0), upper=(1.0, 1.0)):
    """Cell centres of a box, (n, 2)."""
    axes = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(lower, upper, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def box_with_walls(spacing, jitter=0.0, seed=3):
    """Particles of the unit square and of five wall layers around it: positions and phase 0 or -1."""
    every = cells(spacing, (-5 * spacing, -5 * spacing), (1 + 5 * spacing, 1 + 5 * spacing))
    inside = ((every > 0) & (every < 1)).all(axis=1)
    every[inside] += np.random.default_rng(seed).uniform(-jitter, jitter, (inside.sum(), 2)) * spacing
    return every, np.where(inside, 0, -1)


def lines(position, phase, spacing, periodic=CLOSED, upper=(1.0, 1.0), volume=None) -> list[Contour]:
    volume = np.full(len(position), spacing**2) if volume is None else volume
    shares = shares_of_phases(position, volume, phase, int(phase.max()) + 1, (0.0, 0.0), upper, periodic, spacing)
    return [contour(share) for share in shares]


def from_centre(position, x=0.5, y=0.5):
    return np.hypot(position[:, 0] - x, position[:, 1] - y)


# -- lines through particles -------------------------------------------------------------------------------


@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_a_disc(jitter):
    spacing = 1 / 80
    position, phase = box_with_walls(spacing, jitter)
    phase[(phase == 0) & (from_centre(position) < 0.25)] = 1
    radius = math.sqrt((phase == 1).sum() * spacing**2 / math.pi)
    outer, line = lines(position, phase, spacing)
    assert line.length == pytest.approx(2 * math.pi * radius, rel=0.006)
    assert line.area == pytest.approx(math.pi * radius**2, rel=0.005)
    assert 0.994 < line.circularity < 1.0
    assert line.lowest == pytest.approx([0.25, 0.25], abs=0.2 * spacing)
    assert line.highest == pytest.approx([0.75, 0.75], abs=0.2 * spacing)
    # of two phases that fill the box each has the line of the other
    assert outer.length == pytest.approx(line.length)
    assert outer.area == pytest.approx(1 - line.area)
    assert (*outer.lowest, *outer.highest) == (0, 0, 1, 1)


def test_a_ring_and_a_drop_beside_it():
    spacing = 1 / 100
    position, phase = box_with_walls(spacing)
    ring = np.abs(from_centre(position, 0.35, 0.35) - 0.2) < 0.06
    phase[ring | (from_centre(position, 0.8, 0.8) < 0.12)] = 1
    _, line = lines(position, phase, spacing)
    assert line.length == pytest.approx(2 * math.pi * (0.26 + 0.14 + 0.12), rel=0.01)
    assert line.area == pytest.approx(math.pi * (0.26**2 - 0.14**2 + 0.12**2), rel=0.01)


def test_a_layer_ends_at_its_surface_and_at_the_walls():
    spacing = 1 / 20
    position, phase = box_with_walls(spacing)
    phase[(phase == 0) & (position[:, 1] < 0.3)] = 1
    _, line = lines(position, phase, spacing)
    assert line.length == pytest.approx(1.0, rel=1e-6)
    assert line.area == pytest.approx(0.3, rel=1e-6)
    assert line.lowest == pytest.approx([0.0, 0.0])
    assert line.highest == pytest.approx([1.0, 0.3])


def test_a_free_surface_and_no_line_along_the_walls():
    spacing = 1 / 20
    position, phase = box_with_walls(spacing)
    keep = (phase == -1) | (position[:, 1] < 0.4)
    position, phase = position[keep], phase[keep]
    (line,) = lines(position, phase, spacing)
    middle = line.segments[np.all(np.abs(line.segments[:, :, 0] - 0.5) < 0.3, axis=1)]
    assert middle[:, :, 1] == pytest.approx(0.4, abs=0.15 * spacing)
    assert line.length == pytest.approx(1.0, rel=0.05)
    assert line.lowest == pytest.approx([0.0, 0.0])


def test_a_periodic_axis_makes_no_difference_to_a_drop():
    spacing = 1 / 40
    position = cells(spacing)
    found = []
    for shift in (0.0, 0.45):
        moved = np.mod(position + [shift, -shift], 1.0)
        phase = (from_centre(position) < 0.2).astype(int)
        found.append(lines(moved, phase, spacing, (True, True))[1])
    centred, across = found
    assert across.length == pytest.approx(centred.length, rel=1e-9)
    assert across.area == pytest.approx(centred.area, rel=1e-9)
    assert across.highest == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize("periodic", [(False, False), (True, False), (True, True)])
def test_shares_are_the_sums_of_the_definition(periodic):
    spacing = 1 / 16
    rng = np.random.default_rng(5)
    position = cells(spacing) + rng.uniform(-0.2, 0.2, (256, 2)) * spacing
    walls = cells(spacing, (-0.25, -0.25), (1.25, 1.25))
    walls = walls[~((walls > 0) & (walls < 1))[:, [k for k in (0, 1) if not periodic[k]]].all(axis=1)]
    for k in (0, 1):
        if periodic[k]:
            walls = walls[(walls[:, k] > 0) & (walls[:, k] < 1)]
    if all(periodic):
        walls = walls[:0]
    phase = np.where(position[:, 0] + 0.4 * position[:, 1] < 0.6, 0, 1)
    phase[from_centre(position, 0.2, 0.7) < 0.15] = 2
    volume = rng.uniform(0.8, 1.2, 256) * spacing**2
    every = np.concatenate([position, walls])
    all_volume = np.concatenate([volume, np.full(len(walls), spacing**2)])
    all_phase = np.concatenate([phase, np.full(len(walls), -1)])
    shares = shares_of_phases(every, all_volume, all_phase, 3, (0, 0), (1, 1), periodic, spacing)
    nodes = np.stack(np.meshgrid(shares[0].x, shares[0].y, indexing="ij"), axis=-1)
    assert nodes.shape == (33, 33, 2) and nodes[-1, -1] == pytest.approx([1, 1])
    offset = nodes[:, :, None] - position
    for k in (0, 1):
        if periodic[k]:
            offset[..., k] -= np.round(offset[..., k])
    q = np.hypot(offset[..., 0], offset[..., 1]) / (2 * SMOOTHING * spacing)
    weight = np.where(q < 1, (1 - np.minimum(q, 1)) ** 4 * (1 + 4 * q), 0) * volume
    for k, share in enumerate(shares):
        assert share.values == pytest.approx(weight[..., phase == k].sum(axis=-1) / weight.sum(axis=-1), abs=1e-12)
    assert sum(share.amount for share in shares) == pytest.approx(1.0)


def test_the_amount_does_not_depend_on_the_volumes_of_the_particles():
    spacing = 1 / 40
    position, phase = box_with_walls(spacing, 0.1)
    phase[(phase == 0) & (from_centre(position) < 0.3)] = 1
    for volume in (spacing**2, 1.05 * spacing**2):  # both phases say 5 % too much: the places have not changed
        shares = shares_of_phases(
            position, np.full(len(position), volume), phase, 2, (0, 0), (1, 1), CLOSED, spacing
        )
        assert shares[1].amount == pytest.approx((phase == 1).sum() * spacing**2, rel=2e-3)


@pytest.mark.parametrize(("count", "found"), [(1, False), (2, False), (9, True)])
def test_particles_alone_in_the_other_phase_are_no_line(count, found):
    spacing = 1 / 20
    position, phase = box_with_walls(spacing)
    near = np.argsort(from_centre(position, 0.475, 0.475), kind="stable")
    phase[near[:count]] = 1
    line = lines(position, phase, spacing)[1]
    assert (line.length > 0) is found
    assert math.isnan(line.highest[1]) is not found
    assert math.isnan(line.circularity) is not found


def test_asymmetry_is_the_mean_distance_from_the_mirror_image():
    spacing, shift, radius = 1 / 100, 0.02, 0.25
    position, phase = box_with_walls(spacing)
    phase[from_centre(position, 0.5 + shift, 0.5) < radius] = 1
    _, line = lines(position, phase, spacing)
    # two circles 2 shift apart: the mean of 2 shift abs(cos) round the circle
    assert line.asymmetry(0) == pytest.approx(4 * shift / math.pi, rel=0.03)
    assert line.asymmetry(1) == pytest.approx(0.0, abs=1e-9)


# -- marching squares --------------------------------------------------------------------------------------


def grid(values):
    values = np.asarray(values, float)
    return Share(values, np.arange(values.shape[0], dtype=float), np.arange(values.shape[1], dtype=float))


@pytest.mark.parametrize("slope", [(1, 0), (0, 1), (1, 1), (2, -1), (-0.3, 0.7), (-1, -3)])
@pytest.mark.parametrize("level", [0.3, 0.95, 1.4])
def test_a_plane_is_cut_exactly(slope, level):
    x, y = np.meshgrid(np.linspace(0, 3, 4), np.linspace(0, 2, 3), indexing="ij")
    plane = slope[0] * (x - 1.5) + slope[1] * (y - 1.0) + level - 0.5
    line = contour(grid(plane))
    at_ends = slope[0] * (line.segments[..., 0] - 1.5) + slope[1] * (line.segments[..., 1] - 1.0) + level - 0.5
    assert at_ends == pytest.approx(0.5)
    fine = np.stack(np.meshgrid((np.arange(900) + 0.5) / 300, (np.arange(600) + 0.5) / 300, indexing="ij"), axis=-1)
    above = slope[0] * (fine[..., 0] - 1.5) + slope[1] * (fine[..., 1] - 1.0) + level - 0.5 >= 0.5
    assert line.area == pytest.approx(above.mean() * 6, abs=0.01)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("strong", [False, True])
def test_opposite_corners_make_one_piece_or_two(turned, strong):
    high, low = (1.0, 0.25) if strong else (0.75, 0.0)
    values = np.array([[high, low], [low, high]])
    line = contour(grid(values[::-1] if turned else values))
    assert len(line.segments) == 2
    # the lines cross the edges a third or two thirds of the way from a high corner
    leg = (high - 0.5) / (high - low)
    small = leg if not strong else 1 - leg
    assert line.area == pytest.approx(small**2 if not strong else 1 - small**2)
    assert line.length == pytest.approx(2 * math.sqrt(2) * small)


def test_a_single_node_is_a_diamond():
    values = np.zeros((3, 3))
    values[1, 1] = 1.0
    line = contour(grid(values))
    assert line.length == pytest.approx(4 * math.sqrt(0.5))
    assert line.area == pytest.approx(0.5)
    assert line.lowest == pytest.approx([0.5, 0.5]) and line.highest == pytest.approx([1.5, 1.5])


def test_nothing_and_everything():
    nothing, everything = contour(grid(np.zeros((3, 4)))), contour(grid(np.ones((3, 4))))
    assert nothing.length == everything.length == nothing.area == 0
    assert np.isnan(nothing.lowest).all()
    assert everything.area == 6
    assert (*everything.lowest, *everything.highest) == (0, 0, 2, 3)


# -- sides of a line ---------------------------------------------------------------------------------------


def circle(count=40, radius=1.0):
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    points = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def test_crossings_of_a_triangle():
    triangle = np.array([[[0, 0], [2, 0]], [[2, 0], [1, 1]], [[1, 1], [0, 0]]], float)
    points = np.array([[1, 0.5], [1, -0.5], [1, 1.5], [0.5, 0.25], [0.5, 0.75], [3, 0], [-1, 0], [1.9, 0.05]])
    assert crossings_above(points, triangle).tolist() == [1, 2, 0, 1, 0, 0, 0, 1]
    assert crossings_above(points[:0], triangle).shape == (0,)


def test_gaps_between_pieces_are_closed():
    whole = circle()
    # each facet a little shorter than it was and in any order and direction, as facets are stored
    rng = np.random.default_rng(2)
    broken = whole.mean(axis=1, keepdims=True) + (whole - whole.mean(axis=1, keepdims=True)) * 0.97
    broken = broken[rng.permutation(len(broken))]
    broken[::2] = broken[::2, ::-1]
    gap = 0.5 * (whole[3, 1] - whole[3, 0]) * 0.01 + whole[3, 1]
    points = np.array([[gap[0], 0.0], [gap[0], -2.0], [0.0, 0.0], [0.3, 0.2], [1.5, 0.0]])
    joined = join_ends(broken)
    assert len(joined) == 2 * len(broken)
    assert (crossings_above(points, joined) % 2).tolist() == [1, 0, 1, 1, 0]
    assert (crossings_above(points, broken) % 2).tolist() != [1, 0, 1, 1, 0]


def test_a_tiny_piece_is_joined_to_others_and_not_to_itself():
    pieces = np.array([[[0, 0], [1, 0.2]], [[1.06, 0.2], [1.05, 0.2]], [[1.1, 0.2], [2, 0]]])
    joined = join_ends(pieces)
    assert len(joined) == 5
    assert crossings_above(np.array([[1.03, 0], [1.055, 0], [1.08, 0]]), joined).tolist() == [1, 1, 1]


def test_what_fits_already_and_what_is_far_away_is_left():
    assert len(join_ends(circle())) == 40
    open_line = circle()[:10]
    assert len(join_ends(open_line)) == 10
    assert len(join_ends(open_line[:1])) == 1


@pytest.mark.parametrize("jitter", [0.0, 0.1])
@pytest.mark.parametrize("depth", [3, 20])
def test_the_amount_has_no_part_in_bodies(jitter, depth):
    """A disc between two fluids, with so many layers of particles, which may leave its middle empty."""
    spacing = 1 / 80
    position, phase = box_with_walls(spacing, jitter)
    body = (phase == 0) & (from_centre(position) < 0.2)
    phase[(phase == 0) & (position[:, 1] < 0.5)] = 1
    phase[body] = -1
    kept = ~body | (from_centre(position) > 0.2 - depth * spacing)
    taken = [(phase == k).sum() * spacing**2 for k in (0, 1)]
    volume = np.full(kept.sum(), spacing**2)
    shares = shares_of_phases(position[kept], volume, phase[kept], 2, (0, 0), (1, 1), CLOSED, spacing)
    assert [share.amount for share in shares] == pytest.approx(taken, rel=2e-3)


def test_a_plate_whose_sides_overlap_takes_its_room_once():
    """As thin bodies have particles for each side: here twice the area of a plate of three rows."""
    spacing = 1 / 40
    position, phase = box_with_walls(spacing)
    plate = (phase == 0) & (np.abs(position - (0.5, 0.4125)) < (0.3, 1.5 * spacing)).all(axis=1)
    phase[plate] = -1
    volume = np.where(plate, 2.0, 1.0) * spacing**2
    (share,) = shares_of_phases(position, volume, phase, 1, (0, 0), (1, 1), CLOSED, spacing)
    assert share.amount == pytest.approx((phase == 0).sum() * spacing**2, rel=4e-3)
