"""Walls that no fluid has come to are not there: how much of them is, what falls, what rests, and crevices."""

import numpy as np
import pytest
import warp as wp

import warpsph
from warpsph.kernels.core.dry_walls import make_seen, make_wetted
from warpsph.kernels.core.spec import Spec
from warpsph.running.model import Model

SPACING = 0.05
TANK = {
    "title": "tank",
    "dimension": 2,
    "particle_spacing": SPACING,
    "end_time": 1.0,
    "domain": {
        "lower": [0, 0],
        "upper": [2, 1.5],
        "boundary": {"x": "free_slip", "y": {"lower": "free_slip", "upper": "open"}},
    },
    "phases": {"water": {"density": 1000, "sound_speed": 20}},
    "numerics": {"scheme": "delta_plus", "artificial_viscosity": 0},
    "output": {"particles": "none", "checkpoint": "none"},
}


def box(lower: list[float], upper: list[float]) -> list[dict]:
    return [{"phase": "water", "shape": {"box": {"lower": lower, "upper": upper}}}]


def made(**changes: object) -> Model:
    model = Model(warpsph.load_case({**TANK, **changes}), threads=1)
    model.stepper.prepare(fresh=True)
    return model


def fluid(model: Model, name: str) -> np.ndarray:
    return np.asarray(model.particles.get(name))[: model.particles.fluid_count]


@pytest.mark.parametrize("precision", [wp.float32, wp.float64])
def test_share_of_a_wall(precision):
    """All of it up to a spacing from the nearest particle, none from one and a half on."""
    wetted = make_wetted("float64" if precision == wp.float64 else "float32")

    @wp.kernel
    def ask(nearest2: wp.array(dtype=precision), share: wp.array(dtype=precision)):
        i = wp.tid()
        share[i] = wetted(nearest2[i], precision(2.0))

    away = np.array([0.3, 0.7, 1.0, 1.25, 1.4, 1.5, 3.0, 1e15])
    share = wp.zeros(len(away), dtype=precision, device="cpu")
    wp.launch(ask, dim=len(away), inputs=[wp.array((2.0 * away) ** 2, dtype=precision, device="cpu"), share], device="cpu")
    assert np.allclose(share.numpy(), [1, 1, 1, 0.5, 0.2, 0, 0, 0], atol=1e-6)


@pytest.mark.parametrize(("dry_walls", "expected"), [(True, [1, 1, 0.5, 0.2, 0.2, 0.2]), (False, [0.2] * 6)])
def test_what_touches_a_wall_meets_all_of_it(dry_walls, expected):
    """Up to half a spacing from the plane of the wall, also where it is dry; from a spacing on what is there for all."""
    seen = make_seen(Spec(dimension=2, precision="float64", dry_walls=dry_walls))
    vec = wp.vec2d

    @wp.kernel
    def ask(clear: wp.array(dtype=wp.float64), volume: wp.array(dtype=wp.float64)):
        i = wp.tid()
        normal = vec(wp.float64(0.6), wp.float64(0.8))
        along = vec(wp.float64(-2.4), wp.float64(1.8))
        d = (clear[i] + wp.float64(3.0)) * normal + along
        volume[i] = seen(d, wp.float64(0.2), wp.float64(1.0), normal, wp.float64(3.0), wp.float64(2.0))

    clear = wp.array([-0.2, 1.0, 1.5, 1.9, 2.0, 5.0], dtype=wp.float64, device="cpu")
    volume = wp.zeros(6, dtype=wp.float64, device="cpu")
    wp.launch(ask, dim=6, inputs=[clear, volume], device="cpu")
    assert np.allclose(volume.numpy(), expected, atol=1e-12)


def test_a_dry_floor_does_not_push():
    """A block under pressure, three spacings over a floor, has the accelerations that it has far from it."""
    pushed = []
    for height in (0.125, 0.525):
        model = made(
            fluids=box([0.8, height], [1.2, height + 0.4]), start={"pressure": "1000"}, precision="float64"
        )
        model.stepper.run(1.0e9, 1)
        order = np.argsort(fluid(model, "particle_id"))
        pushed.append(fluid(model, "acceleration")[order])
    assert np.abs(pushed[1]).max() > 10.0
    assert np.abs(pushed[0] - pushed[1]).max() < 1.0e-9 * np.abs(pushed[1]).max()


def test_what_falls_meets_a_dry_floor_late():
    """A block in free flight feels nothing of a floor within its support, and lands a row over it."""
    model = made(fluids=box([0.8, 0.2], [1.2, 0.6]), start={"velocity": [0, -1]}, precision="float64")
    lowest = []
    while not lowest or lowest[-1] > 1.6 * SPACING:
        model.stepper.run(1.0e9, 1)
        lowest.append(fluid(model, "position")[:, 1].min())
    assert lowest[0] > 4.0 * SPACING and lowest[-1] > 1.5 * SPACING  # support: four spacings
    assert np.abs(fluid(model, "velocity") - [0, -1]).max() < 1.0e-9
    assert np.abs(fluid(model, "density_excess")).max() < 1.0e-12
    model.stepper.run(model.time + 0.05, 10**6)
    row = fluid(model, "position")[:, 1].min()
    assert 0.25 * SPACING < row < 0.85 * SPACING
    assert fluid(model, "state")[:, 0].max() > 500.0  # rho v^2/2 at least, where it is stopped


@pytest.mark.parametrize("wall", ["free_slip", "no_slip"])
@pytest.mark.parametrize("radius", [0.1, 0.21, 0.33])
def test_water_at_rest_finds_all_walls(radius, wall):
    """On the lattice of a start every wall that the fluid reaches has all of its volume, a disc that cuts cells too."""
    model = made(
        fluids=box([0, 0], [2, 1]),
        gravity=[0, -9.81],
        start={"pressure": "hydrostatic"},
        phases={"water": {"density": 1000, "viscosity": 0.1}},
        bodies={"disc": {"shape": {"sphere": {"center": [1.013, 0.489], "radius": radius}}, "wall": wall}},
    )
    walls = model.particles.fluid_count
    places = np.asarray(model.particles.get("position"))[walls:]
    whole = np.asarray(model.particles.get("boundary_volume"))
    there = np.asarray(model.particles.get("state"))[walls:, 1]
    wet = places[:, 1] < 1.0 - 0.5 * SPACING
    assert wet.sum() > 300 and np.array_equal(there[wet], whole[wet])
    above = places[:, 1] > 1.0 + 2.0 * SPACING
    assert above.sum() > 50 and not there[above].any()


def test_nothing_is_pressed_into_a_crevice():
    """Between a disc and the floor that it goes through fluid ends before the walls meet; these hold it all the same."""
    model = made(
        fluids=box([0, 0], [2, 1]),
        gravity=[0, -9.81],
        start={"pressure": "hydrostatic"},
        bodies={"disc": {"shape": {"sphere": {"center": [1.013, 0.1], "radius": 0.3}}, "wall": "free_slip"}},
    )
    model.stepper.run(0.5, 10**6)
    places, speed = fluid(model, "position"), np.linalg.norm(fluid(model, "velocity"), axis=1)
    assert places[:, 1].min() > 0.25 * SPACING
    assert speed.max() < 0.05 * np.sqrt(2.0 * 9.81)  # of the speed of a fall from the surface


def test_a_full_domain_and_the_printed_form_have_all_walls():
    closed = {**TANK["domain"], "boundary": {"x": "free_slip", "y": "free_slip"}}
    assert not made(fluids=box([0, 0], [2, 1.5]), domain=closed).physics.spec.dry_walls
    printed = {"scheme": "delta_plus", "formulation": "paper"}
    disc = {"disc": {"shape": {"sphere": {"center": [1.013, 0.489], "radius": 0.2}}, "wall": "free_slip"}}
    spec = made(fluids=box([0, 0], [2, 1]), numerics=printed, bodies=disc).physics.spec
    assert spec.bodies and not spec.dry_walls
    assert made(fluids=box([0, 0], [2, 1])).physics.spec.dry_walls
