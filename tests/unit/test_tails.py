"""Thin tails of bodies: two sheets of boundary particles, and lines of sight that see one thing wherever they go."""

import math

import numpy as np
import pytest
import warp as wp
from scipy.spatial import cKDTree

from warpsph.case.case import Case
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.core.visibility import make_sight
from warpsph.running import model as model_module
from warpsph.running.model import Model
from warpsph.scene.airfoils import airfoil, naca_4
from warpsph.scene.body_sampling import sample
from warpsph.scene.geometry import build
from warpsph.scene.physics import derive
from warpsph.scene.surfaces import Ball, Hollow, Outline, box_surface
from warpsph.scene.tails import find_tails
from warpsph.scene.thinness import thin_places
from warpsph.start import start_warp

DX = 0.02
LAYERS = 3
REACH = LAYERS * DX  # of the default kernel, 2 h with h = 1.5 spacings


def wedge(degrees, length=1.0):
    """A triangle with its sharp corner at the origin, the body at negative x."""
    half = length * math.tan(math.radians(degrees / 2))
    return Outline.of_corners([(0, 0), (-length, -half), (-length, half)])


def weight(r):
    """Wendland's C2 kernel in 2-D with the default smoothing length."""
    h = 1.5 * DX
    q = np.minimum(r / h, 2.0)
    return KERNELS["wendland_c2"].alpha[1] / h**2 * (2 - q) ** 4 * (1 + 2 * q)


@pytest.fixture(scope="module")
def sight():
    """The `wp.func`s of lines of sight, for arrays: hidden(x_i, x_j, edge, along), side(...); 2-D, float64."""
    start_warp()
    funcs = make_sight(2, "float64")

    @wp.kernel(module="unique", enable_backward=False)
    def look(
        xi: wp.array(dtype=wp.vec2d),
        xj: wp.array(dtype=wp.vec2d),
        edge: wp.array(dtype=wp.vec2d),
        along: wp.array(dtype=wp.vec2d),
        extent: wp.array(dtype=wp.float64),
        hidden: wp.array(dtype=int),
        side: wp.array(dtype=int),
    ):
        k = wp.tid()
        across = wp.vec2d(-along[k][1], along[k][0])
        hidden[k] = int(0)
        if wp.static(funcs.hidden)(xi[k], xj[k], edge[k], along[k], across, extent[k]):
            hidden[k] = 1
        side[k] = wp.static(funcs.side_entered)(xi[k], xj[k], edge[k], along[k], across, extent[k])

    def run(*points, extent=np.inf):
        points = np.broadcast_arrays(*points)
        n = len(points[0])
        extent = np.minimum(np.broadcast_to(extent, n), 1e30)
        arrays = [wp.array(np.ascontiguousarray(p), dtype=wp.vec2d, device="cpu") for p in points]
        arrays.append(wp.array(np.ascontiguousarray(extent), dtype=wp.float64, device="cpu"))
        found = [wp.zeros(n, dtype=int, device="cpu") for _ in range(2)]
        wp.launch(look, dim=n, inputs=[*arrays, *found], device="cpu")
        return found[0].numpy().astype(bool), found[1].numpy()

    return run


def of(sampling, frame):
    """Edges and directions of frames as lines of sight take them; those of bodies that go on behind."""
    assert np.isinf(sampling.frames.extent[frame]).all()
    return sampling.frames.edge[frame], sampling.frames.along[frame]


def seen(sight, x, fluid, sampling):
    """Which fluid particles and which boundary particles a fluid particle at x sees."""
    fluid_seen = np.ones(len(fluid), dtype=bool)
    if sampling.frames.count:
        distance, frame = cKDTree(sampling.frames.point).query(x)
        if distance < REACH + DX:
            fluid_seen = ~sight(x[None], fluid, *of(sampling, [frame]))[0]
    _, side = sight(x[None], sampling.position, *of(sampling, sampling.frame))
    return fluid_seen, (sampling.sheet == 0) | (sampling.sheet == side)


def lattice(low, high):
    axes = [np.arange(a, b, DX) + DX / 2 for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def test_lines_of_sight_against_crossing_segments(sight):
    """Hidden is what a segment reaches across the body, a segment behind the edge, found by solving for where they meet."""
    random = np.random.default_rng(1)
    n = 2000
    a, b, edge = random.uniform(-1, 1, (3, n, 2))
    angle = random.uniform(0, 2 * math.pi, n)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    extent = random.uniform(0, 1, n)
    # a + s (b - a) = edge - t along
    matrix = np.stack([b - a, along], axis=2)
    s, t = np.linalg.solve(matrix, (edge - a)[:, :, None])[:, :, 0].T
    crossed = (s > 0) & (s < 1) & (t > 0) & (t < extent)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    side_of_a = np.where(((a - edge) * across).sum(axis=1) < 0, -1, 1)
    side_of_b = np.where(((b - edge) * across).sum(axis=1) < 0, -1, 1)
    hidden, side = sight(a, b, edge, along, extent=extent)
    assert 100 < crossed.sum() < n - 100
    assert np.array_equal(hidden, crossed)
    assert np.array_equal(side, np.where(crossed, side_of_a, side_of_b))
    assert np.array_equal(sight(b, a, edge, along, extent=extent)[0], hidden)


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_around_a_thin_plate_everything_is_seen_once(sight, rows):
    """A plate of one to three rows of lattice cells: each fluid particle has the sum of weights of a full lattice."""
    half = rows * DX / 2
    plate = Outline.of_corners([(-0.4, -half), (0.0, -half), (0.0, half), (-0.4, half)])
    found = sample(plate, DX, LAYERS)
    cells = lattice((-0.6, -10 * DX + half % DX), (0.2, 10 * DX + half % DX))
    fluid = cells[plate.signed_distance(cells) > 0]
    near = fluid[(plate.signed_distance(fluid) < REACH)]
    whole = weight(np.linalg.norm(lattice((-0.2, -0.2), (0.2, 0.2)) - DX / 2, axis=1)).sum()
    assert len(near) > 100
    for x in near:
        fluid_seen, body_seen = seen(sight, x, fluid, found)
        total = weight(np.linalg.norm(fluid[fluid_seen] - x, axis=1)).sum() * DX**2
        total += (weight(np.linalg.norm(found.position[body_seen] - x, axis=1)) * found.volume[body_seen]).sum()
        assert total == pytest.approx(whole * DX**2, abs=1e-12)


def test_wherever_one_looks_at_a_wedge_there_is_one_thing(sight):
    """Monte Carlo at a tail of 10 degrees: a point that is seen is in the fluid, or in the band of one sheet, never both."""
    body = wedge(10)
    (tail,) = find_tails(body, DX, REACH)
    random = np.random.default_rng(2)
    x, y = random.uniform((-0.1, -0.1), (0.1, 0.1), (2, 12000, 2))
    kept = (body.signed_distance(x) > 0.5 * DX) & (np.linalg.norm(x - y, axis=1) < REACH)
    x, y = x[kept], y[kept]
    hidden, side = sight(x, y, tail.edge[None], tail.along[None])
    in_fluid = (body.signed_distance(y) > 0) & ~hidden
    count = in_fluid.astype(int)
    for sheet in tail.sheets:
        depth = (sheet.point[0] - y) @ sheet.normal[0]
        count += ((depth > 0) & (depth < REACH) & (side == sheet.side)).astype(int)
    assert len(count) > 500 and hidden.sum() > 50
    assert (count == 1).all()


@pytest.mark.parametrize("degrees", [6, 10, 20, 40])
def test_a_wedge_has_two_sheets_of_full_depth(degrees):
    found = sample(wedge(degrees), DX, LAYERS)
    half = math.radians(degrees / 2)
    for side in (-1, 1):
        own = found.sheet == side
        normal = np.array([math.sin(half), side * math.cos(half)])
        assert found.normal[own] == pytest.approx(np.tile(normal, (own.sum(), 1)), abs=1e-9)
        assert found.depth[own] == pytest.approx((found.layer[own] + 0.5) * DX)
        for m in range(LAYERS):
            row = np.sort(found.position[own & (found.layer == m)] @ np.array([math.cos(half), -side * math.sin(half)]))
            assert np.diff(row) == pytest.approx(DX, rel=0.05)
            assert row[-1] > REACH - DX  # past the edge
    assert (found.area > 0).sum() == (found.leader == np.arange(found.count)).sum()
    assert found.area.sum() == pytest.approx(wedge(degrees).extent)
    assert {int(s) for s in found.sheet[found.leader] - found.sheet} == {0}


def test_pressure_of_one_side_of_a_wedge_goes_on_and_the_other_is_not_seen(sight):
    """A pressure linear on each side, with a jump between: the fit at each sheet has its own side's, to rounding."""
    body = wedge(10)
    found = sample(body, DX, LAYERS)
    cells = lattice((-0.9, -0.3), (0.3, 0.3))
    fluid = cells[body.signed_distance(cells) >= 0.5 * DX]

    def pressure(points, side):
        return np.where(side > 0, 1 + 2 * points[:, 0] + 3 * points[:, 1], 7 - 4 * points[:, 0] + points[:, 1])

    p = pressure(fluid, np.where(fluid[:, 1] > 0, 1, -1))
    own = np.flatnonzero((found.sheet != 0) & (found.foot[:, 0] < -REACH) & (found.foot[:, 0] > -0.6))
    assert len(own) > 100
    wrong = 0
    for j in own:
        at = found.leader[j]
        # just off the foot, so that the point is on its own side of the tail at the very edge as well
        place = found.foot[at] + 0.1 * DX * found.normal[at]
        near = np.flatnonzero(np.linalg.norm(fluid - place, axis=1) < REACH)
        frame = found.frame[at]
        hidden, _ = sight(place[None], fluid[near], *of(found, [frame]))
        wrong += hidden.sum()
        near = near[~hidden]
        w = weight(np.linalg.norm(fluid[near] - place, axis=1))
        base = np.column_stack([np.ones(len(near)), fluid[near] - place])
        fit = np.linalg.solve(base.T @ (w[:, None] * base), base.T @ (w * p[near]))
        value = fit[0] + fit[1:] @ (found.position[j] - place)
        assert value == pytest.approx(pressure(found.position[[j]], found.sheet[j])[0], abs=1e-9)
    assert wrong > 100  # without lines of sight they would have taken part


def test_a_thin_airfoil_ends_at_its_nose(sight):
    """Three spacings thick: what is above and below, but before the nose, sees each other; what is behind it does not."""
    wing = airfoil(naca_4("0012"), 25 * DX, pivot=0.0)
    found = sample(wing, DX, LAYERS)
    frames = found.frames
    assert np.isfinite(frames.extent).all()
    assert found.area.sum() == pytest.approx(wing.extent)
    above = np.array([[-0.5 * DX, DX], [0.5 * DX, 1.5 * DX], [5 * DX, 3 * DX], [20 * DX, 3 * DX], [26 * DX, DX]])
    below = above * [1, -1]
    near = cKDTree(frames.point).query(above)[1]
    hidden, _ = sight(above, below, frames.edge[near], frames.along[near], extent=frames.extent[near])
    assert hidden.tolist() == [False, True, True, True, False]


@pytest.mark.parametrize("rows_of_cpu", [True, False])
def test_neighbour_lists_leave_out_what_a_plate_hides(device, rows_of_cpu, monkeypatch):
    """On the device: sums over the lists are those of a full lattice, and each pair is listed from both ends."""
    monkeypatch.setattr(model_module, "derive", lambda case, geometry, row_list: derive(case, geometry, rows_of_cpu))
    case = Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": DX,
            "end_time": 1.0,
            "domain": {"lower": [-0.3, -0.2], "upper": [0.3, 0.2], "boundary": {"x": "periodic", "y": "periodic"}},
            "phases": {"water": {"density": 1000, "viscosity": 1}},
            "fluids": [{"phase": "water", "shape": "rest"}],
            "bodies": {"plate": {"shape": {"box": {"lower": [-0.2, -0.02], "upper": [0.2, 0.0]}}}},
        }
    )
    model = Model(case, device, geometry=build(case, REACH))  # without the small displacements that a run begins with
    assert model.physics.spec.tails and model.geometry.arrangement == "lattice"
    model.stepper.prepare(fresh=True)
    particles, n = model.particles, model.geometry.fluid_count
    position = particles.get("position").astype(float)
    fluid, wall = (particles.get(f"{kind}_neighbours").astype(int) for kind in ("fluid", "wall"))
    entries, width = model.stepper.list.neighbours.numpy(), model.stepper.list.width
    rows = entries.reshape(-1, width) if model.stepper.list.spec.row_list else entries.reshape(width, -1).T
    listed = [set(rows[i, : fluid[i] + (wall[i] if i < n else 0)].tolist()) for i in range(len(rows))]
    assert all(i in listed[j] for i in range(n) for j in listed[i])
    volume = DX**2
    sums = np.full(n, weight(0.0)) * volume
    for i in range(n):
        d = position[list(listed[i])] - position[i]
        d -= [0.6, 0.4] * np.round(d / [0.6, 0.4])
        sums[i] += weight(np.linalg.norm(d, axis=1)).sum() * volume
    whole = weight(np.linalg.norm(lattice((-0.2, -0.2), (0.2, 0.2)) - DX / 2, axis=1)).sum() * volume
    assert sums == pytest.approx(whole, abs=2e-5)


@pytest.mark.parametrize(
    ("surface", "tails"),
    [
        (box_surface((0, 0), (1, 1)), 0),
        (box_surface((0, 0), (0.05, 0.05)), 0),  # small, but not slender
        (box_surface((0, 0), (1, 0.05)), 2),
        (box_surface((0, 0), (1, 0.1)), 0),
        (wedge(10), 1),
        (wedge(59), 1),
        (Outline.of_corners([(0, 0), (1, 0), (0.5, 0.9)]), 0),  # 61, 61 and 58 degrees
        (airfoil(naca_4("0012"), 1.0), 1),
        (airfoil(naca_4("4412", closed=False), 1.0, 8.0), 1),
    ],
)
def test_which_ends_are_tails(surface, tails):
    found = find_tails(surface, DX, REACH)
    if surface.bounds[1, 1] == 0.9:
        tails = 1
    assert len(found) == tails
    for tail in found:
        assert surface.signed_distance(tail.edge[None])[0] == pytest.approx(0, abs=1e-9)
        assert surface.signed_distance((tail.edge + 0.01 * DX * tail.along)[None])[0] > 0
        assert sorted(sheet.side for sheet in tail.sheets) == [-1, 1]


def test_a_tail_ends_where_the_body_is_twice_as_thick_as_the_kernel_reaches():
    """A wedge is 2 H thick, measured by the circle that fits in, at H / tan(half angle) along its side from the edge."""
    (tail,) = find_tails(wedge(20), DX, REACH)
    for sheet in tail.sheets:
        assert sheet.goes_on
        assert sheet.arc[-1] == pytest.approx(REACH / math.tan(math.radians(10)), abs=0.3 * DX)


# thin places --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("surface", "thickness", "refused"),
    [
        (box_surface((0, 0), (1, 1)), math.inf, False),
        (Ball((0, 0), 1.5 * DX), 3 * DX, False),
        (Ball((0, 0), 0.4 * DX), 0.8 * DX, True),
        (box_surface((0, 0, 0), (0.2, 0.2, 3 * DX)), 3 * DX, False),
        (box_surface((0, 0, 0), (0.2, 0.2, 0.5 * DX)), 0.5 * DX, True),
        (Hollow(Ball((0, 0), 1.5 * DX)), math.inf, False),
        (box_surface((0, 0), (1, 0.5 * DX)), math.inf, False),  # a plate is two tails
        (wedge(10, 2.0), math.inf, False),
    ],
)
def test_thin_places(surface, thickness, refused):
    found = thin_places(surface, DX, LAYERS)
    assert found.thickness == pytest.approx(thickness, rel=0.01)
    assert (found.refused > DX ** (surface.dimension - 1)) == refused
    assert (found.warned > 0) == math.isfinite(thickness)


def test_the_wall_of_a_tube_is_thin():
    import shapely

    tube = Outline(shapely.Point(0, 0).buffer(0.3, 64).difference(shapely.Point(0, 0).buffer(0.25, 64)))
    found = thin_places(tube, DX, LAYERS)
    assert found.thickness == pytest.approx(0.05, rel=0.02) and found.refused == 0
    assert found.warned == pytest.approx(tube.extent, rel=1e-6)
