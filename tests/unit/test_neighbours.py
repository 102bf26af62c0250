"""Neighbour list against a search of all pairs (methods, test N), flags, sorting and growth."""

import itertools

import numpy as np
import pytest
import warp as wp

from tests.helpers import Bench, Fluid, Setup, lattice
from warpsph.engine.neighbours import brute_force_pairs, grid_layout
from warpsph.errors import CapacityError
from warpsph.kernels.core import cells
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.pair import BAND, NEAR, WRAPPED
from warpsph.kernels.core.spec import Spec

MARGIN = 1e-6  # pairs nearer than this (relative) to a radius may fall on either side of it


def nearest_image(difference, box):
    for axis, period in enumerate(box):
        if period > 0:
            difference[..., axis] -= period * np.round(difference[..., axis] / period)
    return difference


def pairs_of(lists):
    """Return the set of pairs of a list; a neighbour listed twice fails the test."""
    for i, entries in enumerate(lists):
        assert len(entries) == len(set(entries)), f"particle {i} lists a neighbour twice"
    return {(i, j) for i, entries in enumerate(lists) for j in entries}


def check_list(bench, position):
    """The list holds the pairs within its radius, no others."""
    pairs = pairs_of(bench.neighbours()[0])
    radius = bench.list.list_radius
    assert brute_force_pairs(position, bench.box, radius * (1 - MARGIN)) <= pairs
    assert pairs <= brute_force_pairs(position, bench.box, radius * (1 + MARGIN))


def cloud(count, size, seed=1):
    """Return `count` random positions in the box from 0 to `size`, some of them in a clump."""
    rng = np.random.default_rng(seed)
    size = np.asarray(size, dtype=float)
    x = rng.uniform(0, 1, (count, len(size))) * size
    x[: count // 8] = 0.4 * size + rng.uniform(0, 0.1, (count // 8, len(size))) * size.min()
    return x


def make(position, periodic, size, *, ratio=1.5, precision="float64", spacing=0.1, **options):
    spec = Spec(dimension=len(size), precision=precision, periodic=periodic)
    options.setdefault("width", 260)
    return Bench(spec, position, spacing=spacing, ratio=ratio, lower=0.0, upper=np.asarray(size), **options)


def test_brute_force_twin():
    x = np.array([[0.05, 0.5], [0.95, 0.5], [0.2, 0.5], [0.05, 0.9]])
    assert brute_force_pairs(x, [0, 0], 0.2) == {(0, 2), (2, 0)}
    assert brute_force_pairs(x, [1, 0], 0.2) == {(0, 2), (2, 0), (0, 1), (1, 0)}
    assert brute_force_pairs(x, [0, 1], 0.5) == brute_force_pairs(x, [0, 0], 0.5) | {(0, 3), (3, 0)} | {
        pair for pair in brute_force_pairs(x, [0, 1], 0.5) if 3 in pair
    }


AXES_2D = [(False, False), (True, False), (False, True), (True, True)]
AXES_3D = [(False, False, False), (True, False, True), (False, True, False), (True, True, True)]


@pytest.mark.parametrize("periodic", AXES_2D + AXES_3D)
def test_random_cloud(periodic, device):
    size = (1.7, 1.3) if len(periodic) == 2 else (0.9, 0.75, 0.8)
    x = cloud(600 if len(periodic) == 2 else 900, size)
    ratio = 1.5 if len(periodic) == 2 else 1.0
    check_list(make(x, periodic, size, ratio=ratio, device=device), x)


@pytest.mark.parametrize("periodic", [(False, False), (True, True)])
def test_list_by_columns(periodic, device):
    """The layout for GPUs holds the same pairs."""
    x = cloud(300, (1.7, 1.3))
    spec = Spec(dimension=2, precision="float64", periodic=periodic, row_list=False)
    bench = Bench(spec, x, spacing=0.1, lower=0.0, upper=(1.7, 1.3), width=200, device=device)
    check_list(bench, x)


@pytest.mark.parametrize("periodic", [(True, True), (True, True, True)])
@pytest.mark.parametrize("room", [1.001, 1.13, 1.26])
def test_smallest_periodic_boxes(periodic, room, device):
    """From twice the support: fewer than five cells an axis; below room 1.12 two images of a particle may lie
    within the list radius."""
    ratio, spacing = 1.5, 0.1
    support = 2 * ratio * spacing
    size = [2 * support * room] * len(periodic)
    counts, _ = grid_layout([0.0] * len(size), size, periodic, 1.12 * support)
    assert max(counts) < 5
    x = cloud(250, size)
    bench = make(x, periodic, size, ratio=ratio, width=252, device=device)
    check_list(bench, x)


def test_uneven_boxes(device):
    """One axis of few cells beside one of many, and a box of one cell on an open axis."""
    x = cloud(500, (0.61, 3.0))
    check_list(make(x, (True, True), (0.61, 3.0), device=device), x)
    x = cloud(300, (0.05, 3.0))
    check_list(make(x, (False, True), (0.05, 3.0), device=device), x)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("periodic", [(False, False), (True, True)])
def test_particles_on_cell_faces_and_on_the_boundary(periodic, precision, device):
    """Faces, edges and corners of cells, and both ends of the domain."""
    spacing, ratio = 0.1, 1.0
    size = np.array([1.2, 1.2])
    counts, widths = grid_layout([0, 0], size, periodic, 2 * ratio * spacing * 1.12)
    faces = [np.arange(n + 1) * w for n, w in zip(counts, widths, strict=True)]
    x = np.array(list(itertools.product(*faces)))
    if any(periodic):
        x = x[(x < size - 1e-9).all(axis=1)]
    else:
        x = np.minimum(x, size)
        x = np.concatenate([x, size - x[(x == 0).any(axis=1)]])
    x = np.unique(np.round(x, 12), axis=0)
    x = np.concatenate([x, cloud(200, size)]).astype(precision).astype(float)
    check_list(make(x, periodic, size, ratio=ratio, precision=precision, device=device), x)


def test_particles_outside_an_open_domain(device):
    """They stay in the cells at the rim, and their neighbours find them."""
    x = cloud(300, (2.2, 2.2)) - 0.6
    check_list(make(x, (False, False), (1.0, 1.0), device=device), x)
    x = np.concatenate([x, [[1e3, -1e3], [1e3 + 0.1, -1e3]]])
    check_list(make(x, (False, False), (1.0, 1.0), device=device), x)


@pytest.mark.parametrize("periodic", [(False, False), (True, True), (True, True, True)])
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_largest_drift_loses_no_pair(periodic, precision, device):
    """After half the skin in any direction all pairs within the support are in the list."""
    size = (1.5, 1.4) if len(periodic) == 2 else (0.8, 0.75, 0.8)
    ratio = 1.5 if len(periodic) == 2 else 1.0
    x = cloud(500, size).astype(precision).astype(float)
    bench = make(x, periodic, size, ratio=ratio, precision=precision, device=device)
    way = np.random.default_rng(9).normal(size=x.shape)
    way *= bench.half_skin / np.linalg.norm(way, axis=1, keepdims=True)
    pairs = pairs_of(bench.neighbours()[0])
    assert brute_force_pairs(x + way, bench.box, bench.support * (1 - MARGIN)) <= pairs
    # and head on: the two of a pair outside the list cannot come within the support
    outside = brute_force_pairs(x, bench.box, bench.list.list_radius * 1.2) - pairs
    assert outside
    i, j = np.array(sorted(outside)).T
    distance = np.linalg.norm(nearest_image(x[i] - x[j], bench.box), axis=1)
    assert distance.min() - 2 * bench.half_skin >= bench.support * (1 - MARGIN)


@pytest.mark.parametrize("periodic", [(True, False), (True, True)])
def test_pairs_that_wrap_are_flagged(periodic, device):
    """A particle is flagged if the nearest image of a neighbour lies across the boundary."""
    size = (1.6, 1.4)
    x = cloud(500, size)
    bench = make(x, periodic, size, device=device)
    flagged = (bench.get("flags").astype(int) & WRAPPED) != 0
    lists = bench.neighbours()[0]
    expected = [
        any((np.abs(x[i] - x[j])[list(periodic)] > 0.5 * np.array(size)[list(periodic)]).any() for j in lists[i])
        for i in range(len(x))
    ]
    np.testing.assert_array_equal(flagged, expected)
    assert 0 < flagged.sum() < len(x)


def test_walls_come_after_the_fluid(device):
    """A fluid particle lists fluid, then walls; a wall particle lists fluid only."""
    rng = np.random.default_rng(4)
    fluid, walls = rng.uniform(0, 1, (200, 2)), rng.uniform(-0.3, 1.3, (150, 2))
    spec = Spec(dimension=2, precision="float64", walls=True)
    bench = Bench(spec, fluid, walls=walls, spacing=0.1, width=300, device=device)
    fluid_lists, wall_lists = bench.neighbours()
    every = np.concatenate([fluid, walls])
    expected = brute_force_pairs(every, [0, 0], bench.list.list_radius)
    assert pairs_of(fluid_lists) == {(i, j) for i, j in expected if j < 200}
    assert pairs_of(wall_lists) == {(i, j) for i, j in expected if i < 200 and j >= 200}


def test_walls_across_a_periodic_boundary(device):
    """A channel: walls below, periodic along it."""
    fluid = lattice((10, 6), 0.1, jitter=0.2, centre=False)
    walls = lattice((10, 3), 0.1, centre=False) - [0.0, 0.3]
    spec = Spec(dimension=2, precision="float64", periodic=(True, False), walls=True)
    bench = Bench(spec, fluid, walls=walls, spacing=0.1, lower=(0, -0.3), upper=(1.0, 0.6), device=device)
    fluid_lists, wall_lists = bench.neighbours()
    expected = brute_force_pairs(np.concatenate([fluid, walls]), bench.box, bench.list.list_radius)
    assert pairs_of(fluid_lists) | pairs_of(wall_lists) == {(i, j) for i, j in expected if min(i, j) < len(fluid)}
    flagged = (bench.get("flags").astype(int) & WRAPPED) != 0
    assert flagged[len(fluid) :].any() and not flagged[len(fluid) :].all()


def test_interface_flags_and_band(device):
    """NEAR: another phase in the list. BAND: a NEAR particle in the list. The band is complete."""
    x = cloud(500, (2.0, 2.0))
    phase = (np.hypot(*(x - 0.9).T) > 0.6).astype(int)
    spec = Spec(dimension=2, precision="float64", multiphase=True, tension="pressure_jump", interface=True)
    bench = Bench(spec, x, spacing=0.1, ratio=1.0, phase=phase, fluids=(Fluid(), Fluid()), width=200, device=device)
    lists = bench.neighbours()[0]
    flags = bench.get("flags").astype(int)
    near = np.array([any(phase[j] != phase[i] for j in lists[i]) for i in range(len(x))])
    np.testing.assert_array_equal((flags & NEAR) != 0, near)
    band = np.array([near[i] or any(near[j] for j in lists[i]) for i in range(len(x))])
    np.testing.assert_array_equal((flags & BAND) != 0, band)
    assert 0 < near.sum() < band.sum() < len(x)
    if bench.spec.row_list:
        count = bench.counter(ck.BAND_COUNT)
        members = bench.particles.get("band")[:count]
        assert (np.diff(members) > 0).all()
        assert set(bench.particles.get("particle_id")[members]) == set(np.flatnonzero(band))


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_rebuild_wraps_sorts_and_keeps_what_was_rounded(precision, device):
    """Particles that left a periodic box come in on the other side; every kept field follows its particle."""
    size = np.array([1.6, 1.4])
    x = cloud(400, size).astype(precision).astype(float)
    bench = make(x, (True, True), size, precision=precision, device=device)
    rng = np.random.default_rng(8)
    way = rng.uniform(-0.4, 0.4, x.shape).astype(precision).astype(float)
    velocity = rng.normal(size=x.shape).astype(precision).astype(float)
    excess = rng.normal(size=len(x)).astype(precision).astype(float)
    bench.put("offset", way)
    bench.put("velocity", velocity)
    bench.put("density_excess", excess)
    bench.rebuild()
    anchor, offset = bench.get("anchor"), bench.get("offset")
    tiny = 1e-6 if precision == "float32" else 1e-14
    assert (anchor >= -tiny).all() and (anchor <= size + tiny).all()
    # nothing is lost: anchor + remainder is the old place to far below the rounding of a coordinate
    error = nearest_image(anchor + offset - (x + way), np.asarray(bench.box))
    period = float(np.float32(size[0])) - size[0] if precision == "float32" else 0.0
    assert np.abs(error).max() < 1e-13 + 2 * abs(period) + (1e-9 if precision == "float32" else 0.0)
    np.testing.assert_array_equal(bench.get("velocity"), velocity)
    np.testing.assert_array_equal(bench.get("density_excess"), excess)
    assert sorted(bench.particles.get("particle_id")) == list(range(len(x)))
    check_list(bench, anchor)


def test_list_is_sorted_by_cell(device):
    """Neighbours in the list are close in memory: cells are in rows, particles in cells."""
    x = cloud(600, (2.0, 2.0))
    bench = make(x, (False, False), (2.0, 2.0), device=device)
    counts, widths = (
        bench.list.cells_per_axis,
        grid_layout([0, 0], [2, 2], (False, False), bench.list.list_radius)[1],
    )
    low = np.asarray(bench.list_keywords["lower"])
    anchor = bench.particles.get("anchor")
    cell = np.floor((anchor - low) / widths).astype(int)
    assert (np.diff(cell[:, 1] * counts[0] + cell[:, 0]) >= 0).all()


def test_a_narrow_list_is_noticed_and_widened(device):
    x = cloud(300, (1.0, 1.0))
    spec = Spec(dimension=2, precision="float64")
    options = dict(spacing=0.1, ratio=1.0, lower=0.0, upper=1.0, device=device)
    bench = Bench(spec, x, width=200, **options)
    peak = max(map(len, bench.neighbours()[0]))
    stepper = Setup(spec, x, width=4, **options).stepper()
    assert stepper.list.width == 4 < peak
    stepper.rebuild()
    _, counters = stepper.read()
    assert counters[ck.FAULT] == 0
    assert counters[ck.LIST_PEAK] >= peak
    assert stepper.list.width >= peak
    ids = stepper.particles.get("particle_id")
    table = stepper.list.neighbours.numpy()
    n, width = len(x), stepper.list.width
    table = table.reshape(n, width) if stepper.spec.row_list else table.reshape(width, n).T
    counts = stepper.particles.get("fluid_neighbours")
    pairs = {(int(ids[i]), int(ids[j])) for i in range(n) for j in table[i, : counts[i]]}
    assert pairs == brute_force_pairs(x, [0, 0], stepper.list.list_radius)


def test_a_list_beyond_all_numbers(device):
    bench = make(cloud(50, (1.0, 1.0)), (False, False), (1.0, 1.0), device=device)
    with pytest.raises(CapacityError):
        bench.list.resize(40000)


def test_a_list_that_does_not_fit_the_memory(device, monkeypatch):
    """What it needs, what is free, and a larger spacing that fits, never a longer list."""
    bench = make(cloud(50, (1.0, 1.0)), (False, False), (1.0, 1.0), device=device)

    def full(*_arguments, **_options):
        raise RuntimeError("Failed to allocate")

    monkeypatch.setattr(wp, "empty", full)
    monkeypatch.setattr("warpsph.engine.free_memory.host_free", lambda: 1000)
    monkeypatch.setattr("warpsph.engine.free_memory.device_free", lambda _device: 1000)
    with pytest.raises(CapacityError) as caught:
        bench.list.resize(80)
    text = str(caught.value)
    assert "need 16000 bytes" in text and "1000 are free" in text
    assert text.endswith("a particle_spacing 4 times as large would fit")


def test_cells_are_no_narrower_than_half_the_list_radius():
    for periodic in (False, True):
        for extent in np.linspace(0.1, 3.0, 50):
            (count,), (width,) = grid_layout([0.0], [extent], [periodic], 0.3)
            assert width >= 0.15 or count == 1
            assert count * width >= extent * (1 - 1e-12)
            if periodic:
                assert count * width == pytest.approx(extent)


@pytest.mark.parametrize("by_cells", [True, False])
@pytest.mark.parametrize("keys", [[0, 0, 3, 3, 3, 7], [2], [9, 9], [], list(range(10)), [5] * 40 + [6] * 3])
def test_ranges_of_cells(by_cells, keys):
    """Cells without particles, at both ends too, begin where the next particle is; the last entry is the count."""
    count, places = len(keys), 11  # ten cells and the end
    sort_keys = wp.array(np.array([*keys, -1], dtype=np.int32), dtype=int, device="cpu")
    cell_start = wp.full(places, -5, dtype=int, device="cpu")
    rows = places if by_cells else count + 1
    wp.launch(cells.make_ranges(by_cells), dim=rows, inputs=[0, count, sort_keys, cell_start], device="cpu")
    np.testing.assert_array_equal(cell_start.numpy(), np.searchsorted(keys, np.arange(places), side="left"))
