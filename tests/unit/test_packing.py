"""The fitted start: interface points and volumes against formulas, rows of particles against the curves they follow."""

import copy
import math

import numpy as np
import pytest
import warp as wp

from tests.scenes import FULL, case_of
from warpsph import simulation
from warpsph.case.case import Case
from warpsph.engine.launch import Launcher
from warpsph.running import preview
from warpsph.running.model import Model, quiet_warp
from warpsph.scene import borders, packing
from warpsph.scene.borders import VOID, Interface, find_interface, volumes
from warpsph.scene.geometry import build
from warpsph.scene.masks import contains, inside
from warpsph.scene.moments import moment_shift
from warpsph.scene.packing import Packer

quiet_warp()

WALLS = {"x": "wall", "y": "wall"}
PERIODIC = {"x": "periodic", "y": "periodic"}


def fluid(phase, shape, **numbers):
    return {"phase": phase, "shape": {shape: numbers} if numbers else shape}


def disc(radius, *center):
    return fluid("gas", "sphere", center=list(center), radius=radius)


REST = fluid("liquid", "rest")


def make(fluids, lower=(0, 0), upper=(30, 30), spacing=1.0, boundary=WALLS, **changes):
    """A case of as many phases as its fluids name; spacing 1 m unless told."""
    names = dict.fromkeys(entry["phase"] for entry in fluids)
    data = {
        "dimension": len(lower),
        "particle_spacing": spacing,
        "end_time": 1.0,
        "domain": {"lower": list(lower), "upper": list(upper), "boundary": boundary},
        "phases": {name: {"density": 1.0 + 9.0 * k} for k, name in enumerate(names)},
        "fluids": fluids,
    }
    return Case.from_dict(copy.deepcopy(data | changes))


def fit(case, device="cpu", threads=1):
    """Geometry of a case, fitted on a device if it is to be, and the Packer that did it."""
    packer = Packer(Launcher(wp.get_device(device), threads))
    return build(case, 3.0 * case.spacing, arrange=packer), packer


def regions_of(case):
    """What `build` hands to whoever arranges the particles."""
    held = []

    def keep(regions, seed):
        held.append(regions)
        n = np.count_nonzero(regions.entry != VOID)
        return np.zeros((n, regions.lattice.dimension)), np.ones(n)

    build(case.replace({"start.arrangement": "fitted"}), 3.0 * case.spacing, arrange=keep)
    return held[0]


def distances(case, position):
    """Distances (n, n) between particles, infinite to themselves, across periodic sides the shorter way."""
    d = position[:, None, :] - position[None, :, :]
    for axis, wraps in enumerate(case.periodic):
        if wraps:
            period = case.domain.upper[axis] - case.domain.lower[axis]
            d[..., axis] -= period * np.round(d[..., axis] / period)
    r = np.sqrt((d**2).sum(axis=2))
    np.fill_diagonal(r, np.inf)
    return r


def check_rows(distance, spacing, tolerance=0.05):
    """Both rows beside an interface stand half a spacing from it, and nothing is between them and the next rows.

    distance: of each particle from the interface, positive on the side that its phase belongs to.
    """
    assert distance.min() > (0.5 - tolerance) * spacing
    first = distance[distance < 0.85 * spacing]
    assert len(first) and np.abs(first - 0.5 * spacing).max() < tolerance * spacing


def nearest(curve, position):
    """Distance (n,) of each position from the nearest of many points on a curve."""
    return np.array([np.sqrt(((curve - x) ** 2).sum(axis=1)).min() for x in position])


# ------------------------------------------------------------------------------------------------------------
# borders


@pytest.mark.parametrize(
    "shape",
    [
        {"box": {"lower": [-0.4, -0.31], "upper": [0.3, 0.5]}},
        {"sphere": {"center": [0.1, 0.0], "radius": 0.43}},
        {"polygon": {"points": [[-0.5, -0.4], [0.5, -0.3], [0.0, 0.1], [0.2, 0.5], [-0.4, 0.5]]}},
        {"where": {"condition": "y < 0.2*sin(7*x) and r < 0.45"}},
    ],
)
def test_points_are_in_a_shape_as_sites_are(shape):
    """Also those on its border: the axes hold the corners of the box, and steps of the polygon's height."""
    shape = make([fluid("gas", *shape, **shape[next(iter(shape))])], (-1, -1), (1, 1), 0.1).fluids[0].shape
    axes = [np.unique([*np.linspace(-0.6, 0.6, 25), -0.4, 0.3]), np.unique([*np.linspace(-0.6, 0.6, 31), -0.31, 0.5])]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    expected = inside(shape, axes, 0.1)
    assert 0 < expected.sum() < expected.size
    np.testing.assert_array_equal(contains(shape, points, 0.1), expected.ravel())


@pytest.mark.parametrize(("center", "radius"), [((15.2, 14.7), 10.0), ((12.2, 11.7, 12.4), 8.0), ((4.1, 4.2), 2.5)])
def test_interface_points_lie_on_the_interface_with_its_normals(center, radius):
    d = len(center)
    phases = {"gas": {"density": 1.0}, "liquid": {"density": 2.0}}  # nearly alike, or the gas may not be near open sides
    case = make([disc(radius, *center), REST], (0,) * d, (24 + 6 * (d == 2),) * d, boundary={}, phases=phases)
    found = find_interface(regions_of(case))
    outward = found.point - center
    distance = np.linalg.norm(outward, axis=1)
    between = found.above != VOID
    between &= found.below != VOID
    assert np.abs(distance[between] - radius).max() < 1e-5
    outward = np.where(found.below == 0, 1.0, -1.0)[:, None] * outward / distance[:, None]
    assert (outward * found.normal).sum(axis=1)[between].min() > math.cos(0.02)
    # the open sides of the domain are no interface, and none is missing
    assert between.all() and len(distance) > 10 * radius ** (d - 1)


def test_interface_across_a_period_and_at_a_body():
    """A slab that ends at a periodic side and goes on at the other has no end there; inside a body there is nothing."""
    fluids = [
        fluid("gas", "box", lower=[22, 10.3], upper=[30, 20.4]),
        fluid("gas", "box", lower=[0, 10.3], upper=[7.6, 20.4]),
        REST,
    ]
    block = {"shape": {"box": {"lower": [3, 19], "upper": [6, 24]}}}
    case = make(fluids, boundary={"x": "periodic", "y": "wall"}, bodies={"block": block})
    found = find_interface(regions_of(case))
    x, y = found.point.T
    flat = (np.abs(y - 10.3) < 1e-4) | (np.abs(y - 20.4) < 1e-4)
    upright = (np.abs(x - 22) < 1e-4) | (np.abs(x - 7.6) < 1e-4)
    at_block = np.minimum(np.abs(x - 3), np.abs(x - 6)) < 1e-4
    at_block |= np.minimum(np.abs(y - 19), np.abs(y - 24)) < 1e-4
    assert (flat | upright | at_block).all()
    assert not ((x > 3 + 1e-4) & (x < 6 - 1e-4) & (y > 19 + 1e-4) & (y < 24 - 1e-4)).any()
    around = np.sort(x[flat & (y < 12)])
    around = np.concatenate([around[around > 15], around[around < 15] + 30])
    assert np.diff(around).max() < 0.3, "four points a spacing, across the side too"
    fitted, _ = fit(case)
    position, phase = fitted.position[: fitted.fluid_count], fitted.phase[: fitted.fluid_count]
    side = (position[:, 0] < 2) | (position[:, 0] > 28)
    inner = np.minimum(position[:, 1] - 10.3, 20.4 - position[:, 1])[side]
    check_rows(np.where(phase[side] == 0, inner, -inner), 1.0)


def test_normals_at_walls_and_at_a_triple_line():
    """The interface is met on one side of them alone."""
    slope = math.tan(0.4)
    lower = f"y < 15 + {slope}*(x - 15)"
    fluids = [fluid("gas", "where", condition=lower), fluid("oil", "where", condition=f"not {lower} and x < 14.3"), REST]
    found = find_interface(regions_of(make(fluids)))
    straight = (found.below == 0) | (found.above == 0)
    n = np.array([-math.sin(0.4), math.cos(0.4)])
    steep = np.abs(found.normal @ n)
    assert found.point[straight, 0].min() < 1.0 and found.point[straight, 0].max() > 29.0
    apart = np.linalg.norm(found.point - [14.3, 15 - 0.7 * slope], axis=1) > 0.5  # at the triple line there is no normal
    assert steep[straight & apart].min() > math.cos(0.01)
    upright = ~straight & apart
    assert np.abs(found.point[upright, 0] - 14.3).max() < 1e-5
    assert np.abs(found.normal[upright, 0]).min() > math.cos(0.01)


@pytest.mark.parametrize(
    ("fluids", "exact"),
    [
        ([disc(10, 15.2, 14.7), REST], [math.pi * 100]),
        ([disc(4, 15.2, 14.7), REST], [math.pi * 16]),
        ([fluid("gas", "box", lower=[8.33, 8.6], upper=[20.7, 22.25]), REST], [12.37 * 13.65]),
        ([fluid("gas", "polygon", points=[[3, 4], [26.5, 9.3], [12.2, 25]]), REST], [0.5 * (23.5 * 21 - 9.2 * 5.3)]),
        ([fluid("gas", "where", condition="y < 14 - 4*sin(2*pi*x/30)"), REST], [14 * 30]),
        ([fluid("gas", "where", condition="(x - 15)**2 < 100"), REST], [20 * 30]),
    ],
)
def test_volume_of_each_region(fluids, exact):
    regions = regions_of(make(fluids))
    factors = volumes(regions).factor
    count = np.bincount(regions.entry.ravel())
    assert factors[0] * count[0] == pytest.approx(exact[0], rel=1e-4)
    assert (factors * count).sum() == pytest.approx(900, rel=1e-13)


def test_volume_of_a_ball():
    regions = regions_of(make([disc(7, 10.2, 9.7, 10.4), REST], (0, 0, 0), (20, 20, 20), boundary={}))
    factors, count = volumes(regions).factor, np.bincount(regions.entry.ravel())
    assert factors[0] * count[0] == pytest.approx(4 / 3 * math.pi * 343, rel=1e-4)


def test_volume_of_many_cells_needs_few_samples_of_each(monkeypatch):
    monkeypatch.setattr(borders, "_BATCH", 100)
    regions = regions_of(make([disc(7, 10.2, 9.7, 10.4), REST], (0, 0, 0), (20, 20, 20), boundary={}))
    factors, count = volumes(regions).factor, np.bincount(regions.entry.ravel())
    assert factors[0] * count[0] == pytest.approx(4 / 3 * math.pi * 343, rel=1e-3)


def test_regions_of_a_phase_have_their_own_volume_unless_they_touch():
    """A drop in two halves and one apart from them; empty space and bodies count for nobody."""
    top = {"upper": "open", "lower": "wall"}
    drop = "(x - 8.3)**2 + (y - 9.2)**2 < 36"
    fluids = [
        fluid("gas", "where", condition=f"{drop} and x < 8.1"),
        fluid("gas", "where", condition=f"{drop} and x >= 8.1"),
        disc(5, 22.2, 12.4),
        fluid("liquid", "where", condition=f"y < 20.37 and not {drop} and hypot(x - 22.2, y - 12.4) >= 5"),
    ]
    block = {"shape": {"box": {"lower": [14, 0], "upper": [16, 4]}}}
    regions = regions_of(make(fluids, boundary={"x": "wall", "y": top}, bodies={"block": block}))
    factors = volumes(regions).factor
    count = np.bincount(regions.entry[regions.entry != VOID])
    assert factors[0] == factors[1] and factors[2] != factors[0]
    assert factors[0] * (count[0] + count[1]) == pytest.approx(36 * math.pi, rel=1e-4)
    assert factors[2] * count[2] == pytest.approx(25 * math.pi, rel=1e-4)
    assert factors[3] * count[3] == pytest.approx(20.37 * 30 - 61 * math.pi - 8, rel=1e-4)


# ------------------------------------------------------------------------------------------------------------
# what is fitted


@pytest.mark.parametrize(
    ("fluids", "boundary"),
    [
        ([fluid("gas", "box", lower=[8, 9], upper=[20, 21]), REST], WALLS),
        ([fluid("gas", "where", condition="y < 12"), REST], PERIODIC),
        ([fluid("gas", "polygon", points=[[5, 5], [20, 5], [20, 17], [5, 17]]), REST], WALLS),
        ([fluid("gas", "box", lower=[0, 0], upper=[30, 10]), fluid("oil", "box", lower=[0, 10], upper=[30, 21])], WALLS),
        ([disc(9, 15.2, 14.7), fluid("gas", "rest")], WALLS),  # no two phases differ
        ([disc(9, 15.2, 14.7)], {}),  # a free surface
    ],
)
def test_scenes_that_the_lattice_represents_are_left_alone_bit_for_bit(fluids, boundary):
    """Whatever becomes of the particles is what became of them on a lattice: nothing is called, nothing moves."""

    def never(regions, seed):
        raise AssertionError("nothing is to be arranged")

    case = make(fluids, boundary=boundary, start={"pressure": "x*y"})
    found = build(case, 3.0, 0.05, never)
    old = build(case.replace({"start.arrangement": "lattice"}), 3.0, 0.05)
    assert found.arrangement == "lattice"
    assert ("single" if len(case.phases) == 1 else "between rows") in found.arrangement_reason
    assert (found.volume == 1.0).all()
    for name in ("position", "velocity", "pressure", "volume", "phase"):
        assert getattr(found, name).tobytes() == getattr(old, name).tobytes()


@pytest.mark.parametrize("shift", [0.01, 0.03])
def test_an_interface_has_to_miss_the_cell_faces_by_two_percent(shift):
    case = make([fluid("gas", "where", condition=f"y < 12 + {shift}"), REST])
    assert build(case, 3.0).arrangement == ("lattice" if shift < 0.02 else "fitted")


def test_lattice_start_is_the_old_one(device):
    """Middles of cells, equal volumes; the run adds the displacement that breaks the symmetry."""
    case = make([disc(9, 15.2, 14.7), REST], start={"arrangement": "lattice"})
    found, _ = fit(case)
    inner = found.position[: found.fluid_count]
    assert (inner == np.floor(inner) + 0.5).all() and (found.volume == 1.0).all()
    model = Model(case, device=device, threads=1)
    off = model.geometry.position[:900] - inner
    assert 0.04 < np.abs(off).max() <= 0.05 and model.physics.choices["unlock"] == 0.05


def test_a_face_through_particles_needs_no_warning_where_it_is_fitted():
    fluids = [fluid("gas", "box", lower=[8.5, 8], upper=[20, 20]), REST]
    assert not build(make(fluids), 3.0).warnings
    told = build(make(fluids, start={"arrangement": "lattice"}), 3.0).warnings
    assert len(told) == 1 and "fluids.0" in told[0]


# ------------------------------------------------------------------------------------------------------------
# fitted arrangements


@pytest.mark.parametrize(
    ("radius", "center", "spacing", "corner"),
    [
        (10, (15.0, 15.0), 1.0, 0.0),
        (10, (15.3, 14.6), 0.02, 70.0),
        (6, (15.3, 14.6), 1.0, 0.0),
        (12, (15.2, 15.1), 3e5, -1e6),
    ],
)
def test_a_circle_in_a_box(device, radius, center, spacing, corner):
    place = [corner + spacing * c for c in center]
    upper = (corner + 30 * spacing,) * 2
    case = make([disc(radius * spacing, *place), REST], (corner,) * 2, upper, spacing)
    found, packer = fit(case, device)
    n = found.fluid_count
    position, volume, phase = found.position[:n], found.volume[:n], found.phase[:n]
    assert found.arrangement == "fitted" and n == 900 and found.volume[n:] == pytest.approx(spacing**2)
    outside = np.linalg.norm(position - place, axis=1) - radius * spacing
    check_rows(np.where(phase == 0, -outside, outside), spacing)
    assert (position.min(axis=0) >= corner + 0.499 * spacing).all()
    assert (position.max(axis=0) <= upper[0] - 0.499 * spacing).all()
    r = distances(case, found.position)[:n]
    assert r.min() > 0.7 * spacing
    # evenness, from all pairs; a lattice displaced by 0.05 spacings at random has 0.03
    h = 1.5 * spacing
    q = np.minimum(r / h, 2.0)
    weight = -10 * (2 - q) ** 3 * 7 / (64 * math.pi * h**4) * found.volume
    uneven = h * (position * weight.sum(axis=1)[:, None] - weight @ found.position)
    assert np.sqrt((uneven**2).sum(axis=1).mean()) < 0.006
    assert packer.unevenness == pytest.approx(np.sqrt((uneven**2).sum(axis=1).mean()), rel=0.2)
    assert volume[phase == 0].sum() == pytest.approx(math.pi * (radius * spacing) ** 2, rel=1e-4)
    assert volume.sum() == pytest.approx(900 * spacing**2, rel=1e-12)
    assert len(np.unique(volume[phase == 0])) == 1


def test_a_wavy_interface_between_walls(device):
    """The Rayleigh-Taylor start, rows right up to the walls: the sine has no curvature there and goes on beyond them."""
    dx = 1 / 40
    fluids = [fluid("gas", "where", condition="y < 1 - 0.15*sin(2*pi*x)"), REST]
    case = make(fluids, (0, 0), (1, 2), dx)
    found, _ = fit(case, device, threads=2)
    n = found.fluid_count
    x = np.linspace(-0.1, 1.1, 4001)
    curve = np.stack([x, 1 - 0.15 * np.sin(2 * np.pi * x)], axis=1)
    position, phase = found.position[:n], found.phase[:n]
    close = np.abs(position[:, 1] - 1) < 0.3
    above = position[close, 1] > 1 - 0.15 * np.sin(2 * np.pi * position[close, 0])
    assert (above == (phase[close] == 1)).all()
    check_rows(nearest(curve, position[close]), dx)
    # nearest to each other in the acute corners between interface and wall
    assert distances(case, found.position)[:n].min() > 0.6 * dx
    assert found.volume[:n][phase == 0].sum() == pytest.approx(1.0, rel=1e-4)


def test_a_ball(device):
    case = make([disc(5.5, 8.2, 7.7, 8.4), REST], (0, 0, 0), (16, 16, 16), boundary=WALLS | {"z": "periodic"})
    found, packer = fit(case, device)
    n = found.fluid_count
    outside = np.linalg.norm(found.position[:n] - [8.2, 7.7, 8.4], axis=1) - 5.5
    distance = np.where(found.phase[:n] == 0, -outside, outside)
    assert distance.min() > 0.45
    first = distance[distance < 0.85]
    assert (np.abs(first - 0.5) < 0.05).mean() > 0.99, "a few are caught between two rows"
    assert distances(case, found.position[:n]).min() > 0.6
    assert packer.unevenness < 0.006
    assert found.volume[:n][found.phase[:n] == 0].sum() == pytest.approx(4 / 3 * math.pi * 5.5**3, rel=1e-4)


def test_a_drop_across_a_periodic_corner(device):
    """In four pieces, which are one to the particles; the domain wraps and its particles stay in it."""
    piece = "minimum(x, 30 - x)**2 + minimum(y, 30 - y)**2 < 64"
    case = make([fluid("gas", "where", condition=piece), REST], boundary=PERIODIC)
    found, _ = fit(case, device)
    x = found.position
    assert (x >= 0).all() and (x < 30).all()
    outside = np.hypot(*np.minimum(x, 30 - x).T) - 8
    check_rows(np.where(found.phase == 0, -outside, outside), 1.0)
    assert distances(case, x).min() > 0.7


def test_a_slab_that_ends_beside_a_periodic_side():
    """Its last row is on the one side of it, the first row of the other fluid on the other side."""
    case = make([fluid("gas", "box", lower=[0, 6.0], upper=[12, 15.8]), REST], upper=(12, 16), boundary=PERIODIC)
    found, _ = fit(case)
    y = found.position[:, 1]
    inner = np.minimum(y - 6.0, 15.8 - y)
    outer = np.minimum(np.mod(6.0 - y, 16), np.mod(y - 15.8, 16))
    check_rows(np.where(found.phase == 0, inner, outer), 1.0)


@pytest.mark.parametrize(
    ("below", "above", "lower", "upper"),
    [(0, 1, -0.3, 0.0), (1, 0, 0.7, -0.06), (1, 2, 0.0, 0.0)],
    ids=["own phase below", "own phase above", "other phases"],
)
def test_push_from_a_single_interface_point(device, monkeypatch, below, above, lower, upper):
    """On an even lattice nothing else is left of one iteration. The particle 0.2 below the point is pushed to half a spacing
    from it, on the side of its phase; the one 0.8 above is too far to be pushed through, but drawn a fifth of the way to the
    row if that is its side; those aside are left alone, and all of them at an interface of other phases."""
    monkeypatch.setattr(packing, "ITERATIONS", {2: 1})
    case = make([fluid("liquid", "rest")], upper=(12, 12), boundary=PERIODIC)
    regions = regions_of(case)
    start = np.argwhere(np.ones((12, 12))) + 0.5
    point = Interface(np.array([[5.5, 5.7]]), np.array([[0.0, 1.0]]), np.array([below]), np.array([above]))
    packer = Packer(Launcher(wp.get_device(device), 1))
    way = packer._settle(regions, start, np.zeros(144, np.int32), np.ones(144), np.empty((0, 2)), point)
    expected = np.zeros((144, 2))
    expected[5 * 12 + 5, 1], expected[5 * 12 + 6, 1] = lower, upper
    np.testing.assert_allclose(way, expected, atol=2e-5)


def test_way_across_a_periodic_side(device, monkeypatch):
    """From 0.05 before it to 0.3 behind it, not back around the period, although the list was built anew after that."""
    monkeypatch.setattr(packing, "ITERATIONS", {2: 3})
    regions = regions_of(make([fluid("liquid", "rest")], upper=(12, 12), boundary=PERIODIC))
    start = np.argwhere(np.ones((12, 12))) + [0.95, 0.5]
    point = Interface(np.array([[11.8, 5.5]]), np.array([[1.0, 0.0]]), np.array([1]), np.array([0]))
    packer = Packer(Launcher(wp.get_device(device), 1))
    way = packer._settle(regions, start, np.zeros(144, np.int32), np.ones(144), np.empty((0, 2)), point)
    assert 0.3 < way[11 * 12 + 5, 0] < 0.4 and np.abs(way).max() < 0.4


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_interface_points_are_seen_across_a_periodic_side(device, monkeypatch, axis):
    """The particle is in the first cell of its row, 0.6 from a point in the last one: drawn a fifth of the way."""
    monkeypatch.setattr(packing, "ITERATIONS", {2: 1, 3: 1})
    d = 3 if axis == 2 else 2
    boundary = WALLS | {"z": "periodic"} if d == 3 else PERIODIC
    regions = regions_of(make([fluid("liquid", "rest")], (0,) * d, (12,) * d, boundary=boundary))
    start = np.argwhere(np.ones((12,) * d)) + 0.5
    place, normal = np.full((1, d), 5.5), np.zeros((1, d))
    place[0, axis], normal[0, axis] = 11.9, 1.0
    point = Interface(place, normal, np.array([1]), np.array([0]))
    far_wall = np.full((int(d == 3), d), -2.5)
    packer = Packer(Launcher(wp.get_device(device), 1))
    way = packer._settle(regions, start, np.zeros(12**d, np.int32), np.ones(12**d), far_wall, point)
    first = np.full(d, 5.5)
    first[axis] = 0.5
    expected = np.zeros(d)
    expected[axis] = -0.02
    np.testing.assert_allclose(way[np.abs(start - first).max(axis=1) < 0.1], [expected], atol=2e-5)


def corners_of(width, height, angle):
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [width / 2, height / 2]
    return (half @ turn + 15).tolist()


def test_a_rotated_box_has_rows_along_its_faces_and_in_its_corners():
    points = corners_of(14, 10, 0.4)
    found, _ = fit(make([fluid("gas", "polygon", points=points), REST]))
    n = found.fluid_count
    x = (found.position[:n] - 15) @ np.array([[math.cos(0.4), -math.sin(0.4)], [math.sin(0.4), math.cos(0.4)]])
    beyond = np.abs(x) - [7, 5]
    within = -beyond.max(axis=1)
    gas = found.phase[:n] == 0
    check_rows(within[gas], 1.0)
    out = np.where((beyond > 0).all(axis=1), np.hypot(*beyond.T), beyond.max(axis=1))[~gas]
    assert out.min() > 0.4
    first = out[out < 0.85]
    assert (np.abs(first - 0.5) < 0.05).mean() > 0.95, "off a corner a particle may stand between two rows"


@pytest.mark.parametrize("gap", [0.6, 0.9, 1.4, 1.9])
def test_a_film_between_two_drops(gap):
    """Rows where there is room for them; in a film too thin for one its particles stand in the middle."""
    left, right = 15 - 5 - gap / 2, 15 + 5 + gap / 2
    case = make([disc(5, left, 15.2), disc(5, right, 15.2), REST])
    found, _ = fit(case)
    n = found.fluid_count
    x, phase = found.position[:n], found.phase[:n]
    from_left = np.hypot(x[:, 0] - left, x[:, 1] - 15.2) - 5
    from_right = np.hypot(x[:, 0] - right, x[:, 1] - 15.2) - 5
    out = np.minimum(from_left, from_right)
    check_rows(-out[phase == 0], 1.0)
    narrow = np.abs(x[:, 1] - 15.2) < 0.45 * math.sqrt(max(1.0 - gap, 0.0) * 20)  # where the gap is below one spacing
    narrow &= (phase == 1) & (np.abs(x[:, 0] - 15) < 2)
    assert np.abs(from_left - from_right)[narrow].max(initial=0.0) < 0.1
    rest = (phase == 1) & (np.abs(x[:, 1] - 15.2) > 5)
    assert out[rest].min() > 0.45
    assert distances(case, found.position)[:n].min() > 0.6
    assert found.volume[:n][phase == 0].sum() == pytest.approx(50 * math.pi, rel=2e-4)


def test_a_film_thinner_than_a_spacing_is_left_in_the_middle():
    case = make([fluid("gas", "box", lower=[0, 14.2], upper=[30, 14.8]), REST])
    found, _ = fit(case)
    film = found.position[:900][found.phase[:900] == 0]
    assert len(film) == 30 and np.abs(film[:, 1] - 14.5).max() < 0.05
    assert found.volume[:900][found.phase[:900] == 0] == pytest.approx(0.6, rel=1e-3)
    assert np.isfinite(found.position).all()
    y = find_interface(regions_of(case)).point[:, 1]
    assert np.minimum(np.abs(y - 14.2), np.abs(y - 14.8)).max() < 1e-4, "where a region ends with the domain is no interface"


def test_a_needle_does_not_scatter_particles():
    case = make([fluid("gas", "polygon", points=[[3, 14], [27, 15], [3, 17]]), REST])
    found, _ = fit(case)
    sites = build(case, 3.0).position
    assert np.abs(found.position - sites).max() < 1.5
    assert distances(case, found.position)[: found.fluid_count].min() > 0.6


def test_three_phases():
    lower = "y < 15 + 3*sin(x/4)"
    fluids = [fluid("gas", "where", condition=f"{lower} and x < 14.3"),
              fluid("oil", "where", condition=f"{lower} and x >= 14.3"), REST]  # fmt: skip
    case = make(fluids)
    found, _ = fit(case)
    x, phase = found.position[:900], found.phase[:900]
    s = np.linspace(-3, 33, 4001)
    curve = np.stack([s, 15 + 3 * np.sin(s / 4)], axis=1)
    from_curve = nearest(curve, x) * np.where((x[:, 1] < 15 + 3 * np.sin(x[:, 0] / 4)) == (phase < 2), 1, -1)
    from_line = np.abs(x[:, 0] - 14.3) * np.where((x[:, 0] < 14.3) == (phase == 0), 1, -1)
    from_line[phase == 2] = np.inf
    check_rows(np.minimum(from_curve, from_line), 1.0)
    assert distances(case, found.position)[:900].min() > 0.7
    exact = contains(case.fluids[0].shape, np.random.default_rng(0).uniform(0, 30, (2_000_000, 2)), 1.0).mean() * 900
    assert found.volume[:900][phase == 0].sum() == pytest.approx(exact, rel=3e-3)


def test_free_surface_body_and_a_spacing_that_does_not_fit():
    """The surface gets a row of its own, nothing enters the body, and nothing rises into the empty space."""
    surface, bubble = "y < 18 + 2*sin(x/5)", "(x - 9)**2 + (y - 8.3)**2 < 25"
    fluids = [fluid("gas", "where", condition=bubble), fluid("liquid", "where", condition=f"{surface} and not {bubble}")]
    block = {"shape": {"box": {"lower": [20, 6.15], "upper": [25, 11.15]}}}
    boundary = {"x": "wall", "y": {"lower": "wall", "upper": "open"}}
    case = make(fluids, upper=(30.0, 30.3), boundary=boundary, bodies={"block": block})
    found, packer = fit(case)
    assert len(found.warnings) == 1 and "does not divide" in found.warnings[0]
    n = found.fluid_count
    x, phase = found.position[:n], found.phase[:n]
    s = np.linspace(-3, 33, 4001)
    down = nearest(np.stack([s, 18 + 2 * np.sin(s / 5)], axis=1), x)
    assert (x[:, 1] < 18 + 2 * np.sin(x[:, 0] / 5)).all()
    outside = np.hypot(x[:, 0] - 9, x[:, 1] - 8.3) - 5
    check_rows(np.where(phase == 0, -outside, np.minimum(outside, down)), 1.0, tolerance=0.08)
    walls = found.position[n:]
    apart = np.sqrt(((x[:, None] - walls[None]) ** 2).sum(axis=2)).min(axis=1)
    assert apart.min() > 0.8 and distances(case, x).min() > 0.7
    assert packer.unevenness < 0.01  # rows that follow the faces of the body meet at its corners


def test_far_from_interfaces_the_lattice_is_disturbed_but_even():
    case = make([disc(6, 40.3, 14.7), REST], upper=(80, 30))
    found, packer = fit(case)
    x = found.position[: found.fluid_count]
    far = np.abs(x[:, 0] - 40) > 20
    off = (x - np.floor(x) - 0.5)[far]
    assert 0.005 < np.sqrt((off**2).mean()) < 0.05
    assert packer.unevenness < 0.004


def test_fitted_on_request_without_an_interface():
    """One phase in a periodic box: an even arrangement without the symmetry of a lattice."""
    found, packer = fit(make([fluid("liquid", "rest")], boundary=PERIODIC, start={"arrangement": "fitted"}))
    off = found.position - np.floor(found.position) - 0.5
    assert found.arrangement == "fitted" and 0.005 < np.abs(off).max() < 0.2
    assert packer.unevenness < 0.002 and (found.volume == 1.0).all()


def test_same_seed_same_start(device):
    case = make([disc(6, 10.3, 9.7), REST], upper=(20, 20))
    first, again = fit(case, device)[0], fit(case, device)[0]
    assert first.position.tobytes() == again.position.tobytes() and first.volume.tobytes() == again.volume.tobytes()
    other = fit(case.replace({"start.seed": 2}), device)[0]
    assert np.abs(other.position - first.position).max() > 0.01


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_do_not_matter(threads):
    case = make([disc(10, 15.3, 14.7), REST])
    assert fit(case)[0].position.tobytes() == fit(case, threads=threads)[0].position.tobytes()


# ------------------------------------------------------------------------------------------------------------
# start values and runs


def test_start_values_belong_to_where_the_particles_are():
    start = {"velocity": ["x + 2*y", "-y"], "pressure": "10*x*y"}
    found, _ = fit(make([disc(6, 10.3, 9.7), REST], upper=(20, 20), start=start))
    n = found.fluid_count
    x, y = found.position[:n].T
    assert np.abs(x - np.floor(x) - 0.5).max() > 0.1, "they have left the lattice"
    np.testing.assert_allclose(found.velocity[:n], np.stack([x + 2 * y, -y], axis=1), rtol=1e-12)
    np.testing.assert_allclose(found.pressure[:n], 10 * x * y, rtol=1e-12)


def test_hydrostatic_pressure_follows_the_particles():
    """The column's pressure in the middle of the cell, and rho g.dx from there."""
    case = make([fluid("liquid", "where", condition="y < 10.3"), fluid("gas", "rest")], upper=(20, 20), gravity=[0, -10],
                start={"pressure": "hydrostatic"})  # fmt: skip
    found, _ = fit(case)
    on_lattice = build(case, 3.0)
    n = found.fluid_count
    density = np.where(found.phase[:n] == 0, 1.0, 10.0)
    fallen = on_lattice.position[:n, 1] - found.position[:n, 1]
    assert np.abs(fallen).max() > 0.15
    np.testing.assert_allclose(found.pressure[:n], on_lattice.pressure[:n] + 10 * density * fallen, rtol=1e-9)


def test_noise_displaces_a_fitted_start_and_unlock_does_not():
    case = make([disc(6, 10.3, 9.7), REST], upper=(20, 20))
    plain = Model(case, threads=1)
    fitted, _ = fit(case)
    assert plain.physics.choices["unlock"] == 0.0 and plain.physics.choices["pressure_gradient"] == "corrected"
    np.testing.assert_array_equal(plain.geometry.position, fitted.position)
    for changes in ({"start.noise": 0.2}, {"numerics.unlock": 0.2}):
        off = Model(case.replace(changes), threads=1).geometry.position - fitted.position
        assert 0.18 < np.abs(off).max() <= 0.2 + 1e-9 and (off[400:] == 0).all()


def test_the_masses_of_a_run_are_those_of_the_regions():
    model = Model(make([disc(6, 10.3, 9.7), REST], upper=(20, 20)), threads=1)
    state = model.snapshot()
    mine = state.kind == 0
    assert state.mass[mine & (state.phase == 0)].sum() == pytest.approx(36 * math.pi, rel=2e-4)
    assert state.mass[mine].sum() == pytest.approx(36 * math.pi + 10 * (400 - 36 * math.pi), rel=2e-4)


@pytest.fixture
def calls(monkeypatch):
    """Counts how often particles are arranged."""
    made = []
    arrange = packing.Packer.__call__

    def count(self, regions, seed):
        made.append(seed)
        return arrange(self, regions, seed)

    monkeypatch.setattr(packing.Packer, "__call__", count)
    return made


DROP = {"fluids": [fluid("liquid", "sphere", center=[0.5, 0.5], radius=0.28), fluid("gas", "rest")]}


def test_a_run_arranges_once_and_its_restart_never(calls, tmp_path):
    case = case_of({**FULL, **DROP}, end_time=0.1)
    first = simulation.Simulation(case, tmp_path / "run", threads=1).run()
    assert calls == [1]
    longer = case.replace({"end_time": 0.2})
    whole = simulation.Simulation(longer, tmp_path / "whole", threads=1).run()
    assert calls == [1, 1]
    again = simulation.Simulation(longer, tmp_path / "again", threads=1, restart=tmp_path / "run").run()
    assert calls == [1, 1] and again.first_step == first.model.steps
    np.testing.assert_array_equal(again.state.mass, first.state.mass)
    assert np.abs(again.state.position - whole.state.position).max() < 0.02


def test_check_and_show_arrange_nothing(calls):
    case = case_of({**FULL, **DROP})
    told = preview.describe(case)
    assert told["resolved"]["start"]["arrangement"] == "fitted" and told["resolved"]["numerics"]["unlock"] == 0.0
    assert "gas and liquid" in told["structure"]["start arrangement"]
    assert "gas and liquid" in told["reasons"]["start.arrangement"]
    assert preview.estimate(case)["particles"] == 256
    assert not calls
    aligned = preview.describe(case_of(FULL))
    assert aligned["resolved"]["start"]["arrangement"] == "lattice" and aligned["resolved"]["numerics"]["unlock"] == 0.05


# ------------------------------------------------------------------------------------------------------------
# moments


@pytest.mark.parametrize("across", [64, 96])
def test_a_wave_of_the_interface_has_its_amplitude(across):
    """To five thousandths of a spacing; rows and even spacing alone leave 0.024 and 0.043 of the first cosine."""
    condition = f"y < 48 + 0.02*{across}*cos(2*pi*x/{across})"
    fluids = [fluid("gas", "where", condition=condition), REST]
    geometry, _ = fit(make(fluids, upper=(across, 96), boundary={"x": "periodic", "y": "wall"}))
    own = geometry.phase == 0
    x, volume = geometry.position[own, 0], geometry.volume[own]
    for function, harmonic, amplitude in ((np.cos, 1, 0.02 * across), (np.sin, 1, 0.0), (np.cos, 2, 0.0), (np.sin, 2, 0.0)):
        k = 2 * math.pi * harmonic / across
        found = 2 / across * np.sinc(k / 2 / math.pi) * (volume * function(k * x)).sum()
        assert found == pytest.approx(amplitude, abs=0.005)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("volume", [1.0, 0.01])
def test_waves_of_displacement_give_each_region_its_moments(periodic, volume):
    """Two layers of particles that stand too dense at one end: after the shift their cosines are those of even layers."""
    rows = np.arange(0.5, 40)
    place = np.stack(np.meshgrid(rows, rows, indexing="ij"), axis=-1).reshape(-1, 2)
    region = (place[:, 1] > 25).astype(np.intp)
    even = place.copy()
    place[:, 0] += np.where(region, 0.03, -0.02) * np.sin(2 * math.pi * (place[:, 0] - 0.5) / 39)
    along_x = np.stack([np.full(160, 25 * volume / 4), np.full(160, 15 * volume / 4)])
    along_y = np.stack([np.repeat([volume * 10.0, 0.0], [100, 60]), np.repeat([0.0, volume * 10.0], [100, 60])])
    volumes_of = np.full(1600, volume)
    way = moment_shift(place, volumes_of, region, [along_x, along_y], (40, 40), (periodic, False))
    assert np.abs(place + way - even).max() < (0.006 if periodic else 1e-3)
    assert np.abs(way[:, 1]).max() < 1e-3
    for k in (math.pi / 40, 2 * math.pi / 40) if not periodic else (2 * math.pi / 40,):
        for own in (region == 0, region == 1):
            exact = volume * np.cos(k * even[own, 0]).sum()
            assert volume * np.cos(k * (place + way)[own, 0]).sum() == pytest.approx(exact, abs=1e-3 * volume)


def test_a_small_region_keeps_its_rows():
    """Four cells: the cosines of the domain cannot be told apart there, and nothing is moved by more than a tenth."""
    place = np.array([[10.2, 10.5], [11.2, 10.5], [10.2, 11.5], [11.2, 11.5]])
    amounts = np.zeros((1, 40))
    amounts[0, 10:12] = 2.0
    way = moment_shift(place, np.ones(4), np.zeros(4, np.intp), [amounts, amounts], (40, 40), (False, False))
    assert np.abs(way).max() <= 0.1


def test_profiles_say_where_a_region_is():
    regions = regions_of(make([fluid("gas", "polygon", points=[[0, 0], [30, 0], [0, 30]]), REST]))
    x, y = volumes(regions).profiles
    centre = (np.arange(x.shape[1]) + 0.5) * 30 / x.shape[1]
    for amounts in (x, y):
        assert amounts[0].sum() == pytest.approx(450, rel=1e-4) and amounts.sum() == pytest.approx(900)
        assert (amounts[0] * centre).sum() == pytest.approx(4500, rel=1e-3)
