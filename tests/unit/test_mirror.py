"""Mirror images in the neighbour list: against explicit reflection of every particle (theory: isph#b5)."""

import numpy as np
import pytest
import warp as wp

from tests.helpers import lattice
from tests.projection import Stages, codes_of, digits, open_spec, periodic_spec, reflect
from warpsph.engine import neighbours
from warpsph.errors import CapacityError
from warpsph.kernels.core.mirror import FREE_SLIP, NO_SLIP, NO_WALL, code_shift, make_images, make_sides
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.spec import types_of

SPACING = 0.1
SCENES = {
    "box": (2, (False, False), [NO_SLIP] * 4),
    "floor": (2, (False, False), [NO_WALL, NO_WALL, FREE_SLIP, NO_WALL]),
    "channel": (2, (True, False), [NO_WALL, NO_WALL, NO_SLIP, FREE_SLIP]),
    "box in 3-D": (3, (False, False, False), [NO_SLIP] * 6),
    "duct in 3-D": (3, (False, True, False), [NO_SLIP, NO_SLIP, NO_WALL, NO_WALL, FREE_SLIP, NO_WALL]),
}


def scene(name, precision="float64", row_list=True, device="cpu", **options):
    """Return a bench: a disordered cloud that fills its domain to the sides."""
    dimension, periodic, kinds = SCENES[name]
    counts = (9, 8) if dimension == 2 else (8, 7, 6)
    x = lattice(counts, SPACING, jitter=0.45, seed=4, centre=False)
    spec = open_spec(dimension, precision, periodic=periodic, row_list=row_list)
    upper = np.array(counts) * SPACING
    return Stages(spec, x, spacing=SPACING, kinds=kinds, lower=0.0, upper=upper, device=device, width=400, **options)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("name", SCENES)
def test_list_holds_the_images_that_reflection_makes(name, precision, device):
    """Sides, edges and corners, also beside periodic axes; nothing else, nothing twice (see `Stages.entries`)."""
    bench = scene(name, precision, device=device)
    expected, doubtful = set(), set()
    for code in codes_of(bench.kinds):
        distance = np.linalg.norm(bench.apart(code), axis=-1)
        if code == 0:
            np.fill_diagonal(distance, np.inf)
        margin = 1e-5 * bench.support  # at the rim the rounding decides
        for i, j in np.argwhere(distance < bench.list.list_radius + margin):
            target = expected if distance[i, j] < bench.list.list_radius - margin else doubtful
            target.add((int(i), int(j), code))
    found = bench.entries()
    assert expected - found == set() and found - expected - doubtful == set()
    assert len({code for _, _, code in expected}) == len(codes_of(bench.kinds)), "some image is not tried"


@pytest.mark.parametrize("name", ["box", "box in 3-D"])
def test_both_layouts_hold_the_same(name):
    assert scene(name).entries() == scene(name, row_list=False).entries()


@pytest.mark.parametrize("name", SCENES)
def test_an_image_is_seen_from_both_ends(name, device):
    """|x_a - R x_b| = |x_b - R x_a|: the pressure matrix is symmetric."""
    found = scene(name, device=device).entries()
    assert {(j, i, code) for i, j, code in found} == found
    assert any(i == j for i, j, _ in found), "nobody sees its own image"


def test_a_single_particle_in_a_corner_sees_itself_three_times(device):
    bench = Stages(
        open_spec(), [[0.04, 0.05]], spacing=SPACING, kinds=[NO_SLIP] * 4, lower=0.0, upper=1.0, device=device
    )
    assert bench.entries() == {(0, 0, 0b01), (0, 0, 0b0100), (0, 0, 0b0101)}
    away = Stages(open_spec(), [[0.5, 0.5]], spacing=SPACING, kinds=[NO_SLIP] * 4, lower=0.0, upper=1.0, device=device)
    assert away.entries() == set()


def evaluate(bench, codes, x, v):
    """Return what the functions of the images make of points and velocities, for each code: dict of (n, d)."""
    real, vec, _, _ = types_of(bench.spec)
    images = make_images(bench.spec)
    Params = make_params(bench.spec.dimension, bench.spec.precision)
    reflected, moved, rubbed, lifted, separated = (
        images.reflect,
        images.image_velocity,
        images.friction_velocity,
        images.lift,
        images.apart,
    )
    Sides = make_sides(bench.spec.dimension, bench.spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def apply(
        params: Params,
        sides: Sides,
        code: wp.array(dtype=int),
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        out: wp.array2d(dtype=vec),
    ):
        i = wp.tid()
        out[0, i] = reflected(x[i], code[i], sides)
        out[1, i] = moved(v[i], code[i], sides)
        out[2, i] = rubbed(v[i], code[i], sides)
        out[3, i] = lifted(x[i], code[i], sides)
        out[4, i] = separated(x[0], x[i], code[i], True, params, sides)

    n = len(codes)
    device = bench.device
    out = wp.zeros((5, n), dtype=vec, device=device)
    arrays = [wp.array(a, dtype=t, device=device) for a, t in ((codes, int), (x, vec), (v, vec))]
    wp.launch(apply, dim=n, inputs=[bench.params, bench.sides, *arrays, out], device=device)
    return dict(zip(("reflect", "normal", "friction", "lift", "apart"), out.numpy().astype(float), strict=True))


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_positions_and_velocities_of_images(dimension, precision, device):
    """Every code against the rule written for one side after the other; sides of both kinds, all of them moving."""
    random = np.random.default_rng(dimension)
    lower, upper = random.uniform(-2, -1, dimension), random.uniform(1, 2, dimension)
    kinds = [NO_SLIP, FREE_SLIP, FREE_SLIP, NO_SLIP, NO_SLIP, FREE_SLIP][: 2 * dimension]
    walls = random.normal(size=(2 * dimension, dimension))
    spec = open_spec(dimension, precision)
    bench = Stages(
        spec, [[0.0] * dimension], spacing=SPACING, kinds=kinds, side_velocity=walls, lower=lower, upper=upper, device=device
    )
    codes = [code for code in codes_of(kinds) if code]
    assert len(codes) == 3**dimension - 1
    x, v = random.normal(size=(len(codes), dimension)), random.normal(size=(len(codes), dimension))
    found = evaluate(bench, codes, x, v)
    close = {"rtol": 0, "atol": {"float64": 1e-13, "float32": 2e-6}[precision]}
    mirrored = np.array([reflect(p, code, lower, upper) for p, code in zip(x, codes, strict=True)])
    np.testing.assert_allclose(found["reflect"], mirrored, **close)
    np.testing.assert_allclose(found["lift"], mirrored - x, **close)
    np.testing.assert_allclose(found["apart"], x[0] - mirrored, **close)
    normal, friction = v.copy(), v.copy()
    for k, code in enumerate(codes):
        sides = [(axis, 2 * axis + digit - 1) for axis, digit in enumerate(digits(code, dimension)) if digit]
        for axis, side in sides:
            normal[k, axis] = 2 * walls[side, axis] - v[k, axis]
        friction[k] = normal[k]
        for _, side in sides:  # at an edge the last no-slip side decides
            if kinds[side] == NO_SLIP:
                friction[k] = 2 * walls[side] - v[k]
    np.testing.assert_allclose(found["normal"], normal, **close)
    np.testing.assert_allclose(found["friction"], friction, **close)


def test_an_image_across_a_periodic_axis_is_the_nearest(device):
    """Mirrored at the floor and seen across the period at once."""
    bench = scene("channel", device=device)
    x = np.array([[0.05, 0.05], [0.85, 0.06]])
    found = evaluate(bench, [0, 0b0100], x, x)
    np.testing.assert_allclose(found["apart"][1], [0.05 - (0.85 - 0.9), 0.05 + 0.06], atol=1e-14)


def test_too_many_particles_for_the_codes(monkeypatch, device):
    """An index and its code share 31 bits; the message says how many particles there may be, and what to do."""
    assert [code_shift(d) for d in (2, 3)] == [27, 25]
    for dimension in (2, 3):
        highest = max(codes_of([NO_SLIP] * (2 * dimension)))
        assert (highest << code_shift(dimension)) + 2 ** code_shift(dimension) - 1 < 2**31
    monkeypatch.setattr(neighbours, "code_shift", lambda dimension: 6)
    with pytest.raises(CapacityError, match=r"72 particles.*at most 64 particles.*periodic or open"):
        scene("box", device=device)
    # without images the list has all 31 bits
    Stages(periodic_spec(), lattice((9, 8), SPACING), spacing=SPACING, lower=(-0.45, -0.4), upper=(0.45, 0.4), device=device)
