"""Which particles are at the free surface, and the pressure there (theory: isph#b4)."""

import numpy as np
import pytest

from tests.helpers import lattice
from tests.projection import INSIDE, ISOLATED, SURFACE, Stages, open_spec
from warpsph.kernels.core.mirror import NO_SLIP, NO_WALL
from warpsph.kernels.isph.surface import WITHIN

SPACING = 0.1
BOTH = pytest.mark.parametrize("precision", ["float64", "float32"])
DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3])
# Divergence of the positions on half-space lattices: inside, first and second row, corner (theory: isph#b4).
TABLE = [
    # dimension, kernel, h/dx, inside, row 0, row 1, corner
    (2, "cubic", 1.5, 2.013, 1.231, 1.799, 0.728),
    (2, "wendland_c2", 1.25, 1.933, 1.249, 1.883, 0.77),
    (2, "wendland_c2", 2.0, 1.998, 1.184, 1.627, 0.69),
    (3, "cubic", 1.5, 3.030, 1.985, 2.810, 1.28),
    (3, "wendland_c2", 1.25, 2.938, 2.049, 2.900, 1.40),
    (3, "wendland_c2", 2.0, 2.998, 1.874, 2.571, 1.16),
]


def block(counts, jitter=0.0, seed=3):
    return lattice(counts, SPACING, jitter, seed)


def seen(x, precision="float64", spec=None, **options):
    """Return (bench, kinds of the particles) of a cloud."""
    bench = Stages(spec or open_spec(x.shape[1], precision), x, spacing=SPACING, **options)
    bench.look()
    return bench, bench.get("surface").astype(int)


def rim(x):
    """Return how many layers of a lattice block are outside of each particle."""
    return np.rint(np.minimum(x - x.min(axis=0), x.max(axis=0) - x).min(axis=1) / SPACING).astype(int)


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row[0]}-D {row[1]} {row[2]}")
def test_divergence_of_the_positions(row, device):
    """The table, from a block large enough to hold all four kinds of place."""
    dimension, kernel, ratio, *expected = row
    count = 9
    x = block((count,) * dimension)
    bench, _ = seen(x, spec=open_spec(dimension, kernel=kernel), ratio=ratio, width=500, device=device)
    spread = bench.get("spread").reshape((count,) * dimension)
    middle = (count // 2,) * (dimension - 1)
    places = [(count // 2, *middle), (0, *middle), (1, *middle), (0, 0, *middle[1:])]
    for place, value, rounding in zip(places, expected, (6e-4, 6e-4, 6e-4, 6e-3), strict=True):
        assert spread[place] == pytest.approx(value, abs=rounding)


@BOTH
@DIMENSIONS
def test_the_outermost_layer_is_the_surface(dimension, precision, device):
    """Faces, edges and corners of a block; neither the layer below nor what is inside. The corner of a cube is spray."""
    x = block((9, 8) if dimension == 2 else (7, 6, 6))
    _, kind = seen(x, precision, device=device)
    corner = (np.abs(x) > x.max(axis=0) - 0.5 * SPACING).sum(axis=1) == 3
    np.testing.assert_array_equal(kind, np.where(corner, ISOLATED, np.where(rim(x) == 0, SURFACE, INSIDE)))


@pytest.mark.parametrize("ratio", [1.25, 1.5, 2.0])
@DIMENSIONS
def test_smoothing_lengths(dimension, ratio, device):
    """Wider kernels see the surface from the second layer: the cone in front of a particle confirms or denies it.

    Inside of an edge the widest kernel has so few neighbours that the second layer counts too.
    """
    x = block((9, 9) if dimension == 2 else (8, 8, 8))
    _, kind = seen(x, ratio=ratio, width=400, device=device)
    second = (np.abs(x) > x.max(axis=0) - 1.5 * SPACING).sum(axis=1) >= 2
    away = ~second | (rim(x) == 0) if ratio == 2.0 else np.ones(len(x), dtype=bool)
    np.testing.assert_array_equal((kind != INSIDE)[away], (rim(x) == 0)[away])


@pytest.mark.parametrize("seed", range(3))
@DIMENSIONS
def test_disorder_inside_is_no_surface(dimension, seed, device):
    """Jitter of 0.2 spacings; the outermost layer is found all the same, but for the odd one behind others."""
    counts = (16, 16) if dimension == 2 else (9, 9, 9)
    x = block(counts, jitter=0.2, seed=seed)
    layer = rim(block(counts))
    _, kind = seen(x, device=device)
    assert (kind[layer >= 2] == INSIDE).all()
    assert (kind[layer == 1] == INSIDE).mean() > 0.95
    assert (kind[layer == 0] != INSIDE).mean() > 0.95


@DIMENSIONS
def test_a_round_surface(dimension, device):
    """A ball cut out of a lattice: what is more than two spacings below is inside, the outermost is at the surface."""
    x = block((15,) * dimension)
    radius = 0.7
    x = x[np.linalg.norm(x, axis=1) < radius]
    depth = radius - np.linalg.norm(x, axis=1)
    _, kind = seen(x, device=device)
    assert (kind[depth > 2.0 * SPACING] == INSIDE).all()
    assert (kind[depth < 0.5 * SPACING] != INSIDE).all()


@BOTH
@DIMENSIONS
def test_spray_is_isolated(dimension, precision, device):
    """A single particle, a pair and a row of three have p = 0, whatever they had before; the end of a row is isolated."""
    x = np.zeros((6, dimension))
    x[1:3, 0] = 1.0, 1.0 + SPACING
    x[3:, 0] = 3.0, 3.0 + SPACING, 3.0 + 2 * SPACING
    bench, kind = seen(x, precision, pressure=5.0, device=device)
    assert (kind[:4] == ISOLATED).all() and (kind != INSIDE).all()
    np.testing.assert_array_equal(bench.get("pressure"), 0.0)


def test_a_void_has_a_surface(device):
    """A hole of one particle is closed; around a hole of five by five the particles are at a surface."""
    x = block((19, 19))
    middle = np.abs(x).max(axis=1)
    _, kind = seen(x[middle > 0.5 * SPACING], device=device)
    inner = middle[middle > 0.5 * SPACING] < 4.5 * SPACING
    assert (kind[inner] == INSIDE).all()
    ring = middle > 2.5 * SPACING
    _, kind = seen(x[ring], device=device)
    beside, beyond = middle[ring] < 3.5 * SPACING, (middle[ring] > 4.5 * SPACING) & (middle[ring] < 7.5 * SPACING)
    straight = beside & (np.abs(x[ring]).min(axis=1) < 1.5 * SPACING)
    assert straight.sum() == 12 and (kind[straight] == SURFACE).all()
    assert (kind[beyond] == INSIDE).all()


def test_a_sparse_place_is_a_surface_whatever_stands_in_front(device):
    """Inside a loose cluster every particle may be covered: below SPARSE that does not count."""
    x = 1.45 * block((9, 9), jitter=0.02)
    bench, kind = seen(x, device=device)
    share = bench.get("company") / 2
    centre = np.abs(x).max(axis=1) < 0.2
    assert (share[centre] < 0.75).all() and (share[centre] > 0.3).all()
    assert (kind[centre] == SURFACE).all()
    # a little denser they are covered
    bench, kind = seen(x * 1.12 / 1.45, device=device)
    share = bench.get("company") / 2
    assert (share[centre] > 0.75).all() and (kind[centre] == INSIDE).all()


@DIMENSIONS
def test_fragments_have_no_inside(dimension, device):
    """A dense splash of 4 x 3 (x 3) particles: the two in the middle count to the surface; with 5^d there is an inside."""
    x = 0.9 * block((4, 3, 3)[:dimension], jitter=0.02)
    bench, kind = seen(x, pressure=5.0, device=device)
    dropped = bench.get("exposed") == INSIDE
    assert dropped.sum() == 2, "nothing to drop"
    assert (kind != INSIDE).all()
    np.testing.assert_array_equal(bench.get("pressure")[dropped], 0.0)
    x = block((5,) * dimension)
    _, kind = seen(x, device=device)
    np.testing.assert_array_equal(kind == INSIDE, rim(x) > 0)


def test_what_a_fragment_needs_inside(device):
    """WITHIN is between the middle row of a film of three and a row that has none beside it."""
    film = block((15, 3), jitter=0.02)
    bench, kind = seen(film, device=device)
    middle = (np.abs(film[:, 1]) < 0.5 * SPACING) & (np.abs(film[:, 0]) < 3.5 * SPACING)
    assert (kind[middle] == INSIDE).all()
    f = next(iter(bench.pairs()))
    inside = bench.get("exposed") == INSIDE
    share = -(f[2] * (f[1] ** 2).sum(axis=-1))[:, inside].sum(axis=1) / 2
    assert share[middle].min() > 1.3 * WITHIN
    _, kind = seen(block((15, 2), jitter=0.02), device=device)
    assert (kind != INSIDE).all()


@BOTH
@DIMENSIONS
def test_rows_at_a_wall_are_inside(dimension, precision, device):
    """Images stand for the fluid behind a wall, in edges and corners too; at the surface the top row is at it."""
    x = lattice((9, 8) if dimension == 2 else (7, 6, 6), SPACING, centre=False)
    upper = x.max(axis=0) + 0.5 * SPACING
    top = dimension - 1
    kinds = [NO_SLIP] * (2 * dimension)
    kinds[2 * top + 1] = NO_WALL
    _, kind = seen(x, precision, kinds=kinds, lower=0.0, upper=upper, width=300, device=device)
    np.testing.assert_array_equal(kind, np.where(x[:, top] > upper[top] - SPACING, SURFACE, INSIDE))


@DIMENSIONS
def test_own_images_are_no_company(dimension, device):
    """A single particle in a corner sees itself 2^d - 1 times and is isolated all the same."""
    x = np.full((1, dimension), 0.5 * SPACING)
    bench, kind = seen(x, kinds=[NO_SLIP] * (2 * dimension), lower=0.0, upper=1.0, device=device)
    assert bench.get("spread")[0] > 0.15 * dimension and bench.get("company")[0] == 0.0
    assert kind.tolist() == [ISOLATED]


@DIMENSIONS
def test_pressure_at_a_surface(dimension, device):
    """p = -depth n.grad p^n: for a linear pressure that vanishes half a spacing outside it is exact at a flat surface."""
    x = block((11, 9) if dimension == 2 else (9, 7, 7))
    top = x[:, -1].max()
    pressure = 8.0 * (top + 0.5 * SPACING - x[:, -1])
    gradient = np.zeros(dimension)
    gradient[-1] = -8.0
    depth = 0.5 * SPACING
    bench = Stages(open_spec(dimension), x, spacing=SPACING, surface_depth=depth, pressure=pressure, device=device)
    bench.put("lasting_gradient", gradient)
    bench.look()
    flat = (x[:, -1] > top - 0.5 * SPACING) & (np.abs(x[:, :-1]).max(axis=1) < (1.5 if dimension == 2 else 0.6) * SPACING)
    assert flat.any() and (bench.get("surface")[flat] == SURFACE).all()
    np.testing.assert_allclose(bench.get("pressure")[flat], pressure[flat], rtol=1e-6)
    inside = bench.get("surface") == INSIDE
    np.testing.assert_array_equal(bench.get("pressure")[inside], pressure[inside])
    # the printed scheme: p = 0 at the particles
    bench.bindings["surface_depth"] = 0.0
    bench.put("pressure", pressure)
    bench.look()
    np.testing.assert_array_equal(bench.get("pressure")[~inside], 0.0)


def test_a_crowded_or_stretched_row_knows_its_depth(device):
    """A plane cuts an even, slightly disordered cloud in any direction: the depth of its outermost particles below the plane
    is half a spacing on average alone, and is known better from what they see."""
    errors, constant = [], []
    for angle in np.linspace(0.0, 0.7, 8):
        x = lattice((41, 41), SPACING, 0.1, int(100 * angle)) @ np.array(
            [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        )
        x = x[(np.abs(x[:, 0]) < 1.2) & (x[:, 1] > -1.0) & (x[:, 1] < 0.5)]
        pressure = 8.0 * (0.5 - x[:, 1])
        bench = Stages(open_spec(), x, spacing=SPACING, surface_depth=0.5 * SPACING, pressure=pressure, device=device)
        bench.put("lasting_gradient", (0.0, -8.0))
        bench.look()
        flat = (np.abs(x[:, 0]) < 0.7) & (x[:, 1] > 0.5 - 2.5 * SPACING) & (bench.get("surface") == SURFACE)
        errors.extend((bench.get("pressure") - pressure)[flat] / (8.0 * SPACING))
        constant.extend((0.5 * SPACING - (0.5 - x[:, 1]))[flat] / SPACING)
    assert len(errors) > 60
    assert np.std(errors) < 0.75 * np.std(constant) and abs(np.mean(errors)) < 0.1


def test_pressure_at_a_surface_is_bounded_by_that_around(device):
    """After an impact the gradient of the step before is of no use: no more than the mean of the neighbours."""
    x = block((11, 9))
    for sign in (1.0, -1.0):
        bench = Stages(open_spec(), x, spacing=SPACING, surface_depth=0.05, pressure=2.0, device=device)
        bench.put("lasting_gradient", (0.0, -1e6 * sign))
        bench.look()
        flat = (rim(x) == 0) & (np.abs(x[:, 0]) < 2.5 * SPACING) & (x[:, 1] > 0)
        assert flat.sum() == 5
        np.testing.assert_allclose(bench.get("pressure")[flat], 2.0 * sign, rtol=1e-12)


def test_a_symmetric_neighbourhood_is_no_surface(device):
    """Where no direction points outwards, by an exact balance, the confirming scan finds nothing in front either."""
    film = block((15, 3))
    _, kind = seen(film, device=device)
    middle = (np.abs(film[:, 1]) < 0.5 * SPACING) & (np.abs(film[:, 0]) < 3.5 * SPACING)
    assert (kind[middle] == INSIDE).all()
