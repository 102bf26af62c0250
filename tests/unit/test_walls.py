"""Wall particles: extrapolated pressure, mirrored velocity, and what fluid near a wall feels (theory: riemann#a5)."""

import dataclasses

import numpy as np
import pytest
import warp as wp

from tests.helpers import Bench, Fluid, lattice
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.riemann.load import make_load
from warpsph.schemes import riemann_program as riemann

SPACING = 0.1
WATER = Fluid(density=4.0, viscosity=0.3)
# a tank, corrected gradient, gravity, and a channel in the conservative form without gravity
TANK = Spec(
    dimension=2,
    precision="float64",
    walls=True,
    wall_no_slip=True,
    viscosity="morris",
    corrected=True,
    shifting=True,
    gravity=True,
)
CHANNEL = Spec(
    dimension=2,
    precision="float64",
    periodic=(True, False),
    walls=True,
    wall_no_slip=True,
    viscosity="morris",
)
GRAVITY = np.array([0.5, -9.81])


def tank(jitter=0.2, spec=TANK, **options):
    """Return (bench, fluid, walls): fluid in a closed box of 8 x 8 particles with three layers of wall."""
    every = lattice((14, 14), SPACING, centre=False) - 0.3
    solid = ((every < 0) | (every > 0.8)).any(axis=1)
    fluid = every[~solid] + np.random.default_rng(1).uniform(-jitter, jitter, (64, 2)) * SPACING
    options.setdefault("fluids", (WATER,))
    return Bench(spec, fluid, walls=every[solid], spacing=SPACING, **options), fluid, every[solid]


def channel(**options):
    """Return (bench, fluid, walls): eight rows of fluid, periodic along x, between walls of three."""
    every = lattice((10, 14), SPACING, centre=False) - [0.0, 0.3]
    solid = (every[:, 1] < 0) | (every[:, 1] > 0.8)
    options.setdefault("fluids", (WATER,))
    bench = Bench(
        options.pop("spec", CHANNEL),
        every[~solid],
        walls=every[solid],
        spacing=SPACING,
        lower=(0.0, -0.3),
        upper=(1.0, 1.1),
        **options,
    )
    return bench, every[~solid], every[solid]


def wall_pressure(bench, fluid):
    return bench.get("state")[len(fluid) :, 0]


def test_hydrostatic_pressure_is_carried_into_the_wall(device):
    """Exact for a linear pressure, whatever the cloud: p_w = p(x_w)."""
    bench, fluid, walls = tank(gravity=GRAVITY, device=device)
    bench.put_state(pressure=50.0 + WATER.density * fluid @ GRAVITY)
    bench.prepare()
    expected = 50.0 + WATER.density * walls @ GRAVITY
    seen = [len(entries) > 0 for entries in bench.neighbours()[0][len(fluid) :]]
    reached = np.array([np.linalg.norm(fluid - w, axis=1).min() < 0.9 * bench.support for w in walls])
    assert reached.sum() > 0.5 * len(walls) and all(np.array(seen)[reached])
    np.testing.assert_allclose(wall_pressure(bench, fluid)[reached], expected[reached], atol=1e-10)


def test_fluid_at_rest_stays_at_rest(device):
    """Hydrostatic pressure, walls included: no acceleration and no change of density anywhere in the tank."""
    bench, fluid, _ = tank(gravity=GRAVITY, device=device)
    bench.put_state(pressure=50.0 + WATER.density * fluid @ GRAVITY)
    bench.prepare()
    assert np.abs(bench.acceleration()).max() < 1e-11 * np.linalg.norm(GRAVITY)
    assert np.abs(bench.density_rate()).max() < 1e-12


def test_wall_at_the_edge_of_the_support(device):
    """However little fluid a wall particle sees, its pressure is that of the fluid."""
    walls = np.array([[0.0, 0.0]])
    for distance in (0.9, 0.98, 0.995):
        fluid = np.array([[distance * 0.3, 0.0]])
        bench = Bench(TANK, fluid, walls=walls, spacing=SPACING, pressure=7.0, device=device)
        bench.prepare()
        assert wall_pressure(bench, fluid)[0] == pytest.approx(7.0, rel=1e-12)


def test_each_phase_weighs_as_itself_at_the_wall(device):
    """Two phases by the wall: each fluid neighbour is extrapolated with its own density."""
    spec = dataclasses.replace(TANK, multiphase=True, viscosity="none", wall_no_slip=False, shifting=False)
    fluids = (Fluid(density=1.0), Fluid(density=1000.0))
    bench, fluid, walls = tank(spec=spec, gravity=GRAVITY, fluids=fluids, device=device)
    phase = (fluid[:, 0] > 0.4).astype(int)
    bench.put("phase", phase)
    density = np.array([1.0, 1000.0])[phase]
    pressure = np.random.default_rng(2).uniform(0, 10, len(fluid))
    bench.put_state(pressure=pressure)
    bench.prepare()
    d = walls[:, None] - fluid[None]
    q = np.linalg.norm(d, axis=-1) / bench.h
    w = np.clip(2 - q, 0, None) ** 4 * (1 + 2 * q)
    reached = w.sum(axis=1) > 1e-3
    expected = (w * (pressure + density * (d @ GRAVITY))).sum(axis=1)[reached] / w.sum(axis=1)[reached]
    np.testing.assert_allclose(wall_pressure(bench, fluid)[reached], expected, rtol=1e-11)


def test_mirrored_velocity(device):
    """v_mirror = 2 v_wall - v_fluid for a uniform flow."""
    wall_velocity = np.array([0.5, -0.25])
    bench, fluid, walls = tank(velocity=(2.0, 3.0), wall_velocity=wall_velocity, gravity=GRAVITY, device=device)
    bench.prepare()
    reached = np.array([np.linalg.norm(fluid - w, axis=1).min() < 0.9 * bench.support for w in walls])
    expected = np.broadcast_to(2 * wall_velocity - [2.0, 3.0], walls.shape)
    np.testing.assert_allclose(bench.get("mirror_velocity")[reached], expected[reached], atol=1e-12)


def test_wall_without_fluid(device):
    """Away from all fluid: no pressure, its own velocity."""
    walls = np.array([[0.0, -0.05], [5.0, 5.0]])
    bench = Bench(
        TANK,
        np.array([[0.0, 0.05]]),
        walls=walls,
        spacing=SPACING,
        fluids=(WATER,),
        pressure=7.0,
        wall_velocity=(1.0, 2.0),
        device=device,
    )
    bench.prepare()
    np.testing.assert_allclose(wall_pressure(bench, [0]), [7.0, 0.0])
    np.testing.assert_allclose(bench.get("mirror_velocity"), [[2.0, 4.0], [1.0, 2.0]])


def test_wall_never_pulls_on_a_free_surface(device):
    for free_surface in (False, True):
        spec = dataclasses.replace(TANK, free_surface=free_surface)
        bench, fluid, _ = tank(spec=spec, pressure=-3.0, device=device)
        bench.prepare()
        pressure = wall_pressure(bench, fluid)
        if free_surface:
            assert (pressure == 0.0).all()
        else:
            assert pressure.min() == pytest.approx(-3.0)


def test_flow_towards_a_wall_is_compressed(device):
    """The wall's own velocity counts, not the mirrored one, over the share of a compression that its sum has (delta#d6)."""
    bench, fluid, walls = channel(velocity=(0.0, -1.0), device=device)
    rate = bench.density_rate()
    lowest, highest = fluid[:, 1] < 0.1, fluid[:, 1] > 0.7
    assert (rate[lowest] > 0).all() and (rate[highest] < 0).all()
    # (1/rho) drho/dt = sum (v - v_w).grad W V over the wall / (1 - sum W V over the wall)
    i = int(np.flatnonzero(lowest)[4])
    d = fluid[i] - walls
    q = np.linalg.norm(d, axis=1) / bench.h
    gradient = 7 / (64 * np.pi) / bench.h**4 * -10 * np.clip(2 - q, 0, None) ** 3 * d[:, 1] * SPACING**2
    wall_part = (7 / (64 * np.pi) / bench.h**2 * np.clip(2 - q, 0, None) ** 4 * (1 + 2 * q) * SPACING**2).sum()
    assert rate[i] == pytest.approx(-1.0 * gradient.sum() / (1 - wall_part), rel=1e-12)
    moving, _, _ = channel(velocity=(0.0, -1.0), wall_velocity=(0.0, -1.0), device=device)
    assert np.abs(moving.density_rate()).max() < 1e-12


def test_friction_of_no_slip_and_free_slip_walls(device):
    """A no-slip wall slows the flow beside it; a free-slip one does not, nor one that moves along."""
    for slip, wall_velocity, slowed in ((0, 0.0, True), (1, 0.0, False), (0, (1.0, 0.0), False)):
        bench, fluid, _ = channel(velocity=(1.0, 0.0), slip=slip, wall_velocity=wall_velocity, device=device)
        bench.prepare()
        a = bench.acceleration()
        beside = (fluid[:, 1] < 0.1) | (fluid[:, 1] > 0.7)
        assert np.abs(a[:, 1]).max() < 1e-12
        assert (a[beside, 0] < -1e-3).all() if slowed else np.abs(a).max() < 1e-12
        assert np.abs(a[np.abs(fluid[:, 1] - 0.4) < 0.06]).max() < 1e-12


def test_couette_flow_is_steady_between_moving_walls(device):
    """A linear profile feels friction only beside the walls, whose particles mirror a mean."""
    bench, fluid, walls = channel(device=device)
    bench.put("velocity", np.concatenate([np.stack([fluid[:, 1], 0 * fluid[:, 1]], 1), np.zeros_like(walls)]))
    velocity = bench.get("velocity")
    velocity[len(fluid) :, 0] = np.where(walls[:, 1] > 0.4, 0.8, 0.0)
    bench.put("velocity", velocity)
    bench.prepare()
    a = bench.acceleration()[:, 0]
    scale = WATER.viscosity / WATER.density / SPACING  # of a velocity step of one spacing
    assert np.abs(a[np.abs(fluid[:, 1] - 0.4) < 0.06]).max() < 1e-12
    assert np.abs(a).max() < 0.35 * scale
    # the flow is the same seen from the other wall
    upside_down = np.lexsort((fluid[:, 0], -fluid[:, 1]))
    upright = np.lexsort((fluid[:, 0], fluid[:, 1]))
    np.testing.assert_allclose(a[upright], -a[upside_down], atol=1e-11)


def test_couette_flow_feels_nothing_where_the_surface_is_known(device):
    """With the distance of the wall particles from the surface their mirrored velocity continues the linear profile."""
    bench, fluid, walls = channel(device=device)
    bench.put("wall_depth", np.maximum(-walls[:, 1], walls[:, 1] - 0.8))
    linear = np.stack([np.concatenate([fluid, walls])[:, 1], np.zeros(len(fluid) + len(walls))], axis=1)
    velocity = linear.copy()
    velocity[len(fluid) :, 0] = np.where(walls[:, 1] > 0.4, 0.8, 0.0)
    bench.put("velocity", velocity)
    bench.prepare()
    reached = np.abs(walls[:, 1] - 0.4) < 0.6
    np.testing.assert_allclose(bench.get("mirror_velocity")[reached], linear[len(fluid) :][reached], atol=1e-12)
    assert np.abs(bench.acceleration()).max() < 1e-11


def test_pressure_holds_the_fluid_off_the_wall(device):
    bench, fluid, _ = channel(pressure=2.0, device=device)
    bench.put_state(pressure=2.0 + (fluid[:, 1] < 0.1))  # compressed against the lower wall
    bench.prepare()
    a = bench.acceleration()
    assert (a[fluid[:, 1] < 0.1, 1] > 0).all()


@pytest.mark.parametrize("part", ["pressure", "friction", "both"])
def test_load_is_the_reaction_of_the_fluid(part, device):
    """Force on the walls plus force on the fluid is zero in the conservative form."""
    rng = np.random.default_rng(3)
    bench, fluid, walls = channel(device=device)
    if part != "friction":
        bench.put_state(pressure=rng.uniform(1, 2, len(fluid)))
    if part != "pressure":
        bench.put("velocity", np.concatenate([rng.normal(size=fluid.shape), np.zeros_like(walls)]))
    bench.prepare()
    load = wp.zeros(len(walls), dtype=types_of(bench.spec).vec, device=bench.device)
    bench.bindings["load"] = load
    bench.run(riemann.Stage("wall_load", make_load(bench.spec), "wall", ""))
    on_walls = load.numpy().sum(axis=0)
    on_fluid = (WATER.density * bench.get("rest_volume")[:, None] * bench.acceleration()).sum(axis=0)
    assert np.abs(on_walls).max() > 1e-3
    np.testing.assert_allclose(on_walls, -on_fluid, atol=1e-12)


def test_load_of_a_uniform_pressure(device):
    """The fluid presses the lower wall down and the upper wall up, with p times the length."""
    bench, fluid, walls = channel(pressure=3.0, device=device)
    bench.prepare()
    load = wp.zeros(len(walls), dtype=types_of(bench.spec).vec, device=bench.device)
    bench.bindings["load"] = load
    bench.run(riemann.Stage("wall_load", make_load(bench.spec), "wall", ""))
    order = bench.rows_of("wall_body")
    force = np.empty((len(walls), 2))
    force[order] = load.numpy()
    below = walls[:, 1] < 0
    np.testing.assert_allclose(force[below].sum(axis=0), [0.0, -3.0], atol=0.02)
    np.testing.assert_allclose(force[~below].sum(axis=0), [0.0, 3.0], atol=0.02)
