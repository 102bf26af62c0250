"""What holds fluid in front of walls: impact, reaction, carried velocity, moving edges; stiff pairs; the count of leaks."""

import dataclasses

import numpy as np
import pytest

from tests.helpers import Bench, Fluid, lattice
from warpsph.case.case import Case
from warpsph.kernels.core.leaks import INSIDE, SUNK
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.riemann.star import make_one_sided
from warpsph.running.model import Model
from warpsph.scene.geometry import build
from warpsph.scene.physics import derive, support_radius
from warpsph.simulation import Simulation

SPACING = 0.1
GAS_AND_LIQUID = (Fluid(density=1.2, sound_speed=20.0, gamma=1.4), Fluid(density=1000.0, sound_speed=10.0))
SPEC = Spec(dimension=2, precision="float64", walls=True, corrected=True, shifting=True, volume_constraint=False)
FREE = Spec(dimension=2, precision="float64", walls=True, free_surface=True)
TWO = dataclasses.replace(SPEC, multiphase=True)


def floor(width=12):
    """Three layers of wall below y = 0."""
    x, y = np.meshgrid((np.arange(width) - width // 2 + 0.5) * SPACING, (-np.arange(3) - 0.5) * SPACING, indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=1)


def above(rows, width=12):
    x, y = np.meshgrid((np.arange(width) - width // 2 + 0.5) * SPACING, (np.arange(rows) + 0.5) * SPACING, indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=1)


def options(device):
    return {"spacing": SPACING, "fluids": GAS_AND_LIQUID[1:], "device": device}


def alone(into_wall, own_even):
    """The share of a particle with those sums along y, for walls in reach."""
    import warp as wp

    function = make_one_sided(2, "float64").alone
    vec = wp.types.vector(length=2, dtype=wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def apply(table: wp.array2d(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        i = wp.tid()
        t = table[i]
        out[i] = function(vec(wp.float64(0.0), t[0]), vec(wp.float64(0.0), t[1]), wp.float64(1.0))

    table = wp.array(np.stack(np.broadcast_arrays(into_wall, own_even), axis=1), dtype=wp.float64)
    out = wp.zeros(table.shape[0], dtype=wp.float64)
    wp.launch(apply, dim=table.shape[0], inputs=[table, out], device="cpu")
    return out.numpy()


def test_who_is_alone_at_a_wall():
    """Whole behind: not at all; half missing: wholly; linear in between."""
    own = np.array([1.0, 0.75, 0.5, 0.0, -1.0])
    np.testing.assert_allclose(alone(np.full(5, -1.0), own), [0.0, 0.5, 1.0, 1.0, 1.0])
    assert alone(np.array([-1e-6]), np.zeros(1)) == [0.0], "a wall that is hardly in reach"


@pytest.mark.parametrize("gap, share", [(0.5, 0.0), (0.25, 0.0), (0.175, 0.5), (0.1, 1.0), (0.0, 1.0)])
def test_a_row_that_has_lost_its_place_is_held(gap, share, device):
    """Of what drives fluid into floor and side of a corner the walls take their share, each along its own axis."""
    wall = lattice((12, 12), SPACING, centre=False) - 0.3
    wall = wall[(wall < 0).any(axis=1)]
    rows = lattice((6, 6), SPACING, centre=False) + (gap - 0.5) * SPACING
    force = dict(body_force=(-3.0, -2.0), spacing=SPACING, fluids=GAS_AND_LIQUID[1:], device=device)
    spec = dataclasses.replace(SPEC, body_force=True)
    bench = Bench(spec, rows, walls=wall, **force)
    bench.prepare()
    a = bench.acceleration()
    first = np.isclose(rows[:, 0], rows[:, 0].min()), np.isclose(rows[:, 1], rows[:, 1].min())
    inner = (rows < 3 * SPACING).all(axis=1)  # where neither the fluid nor the wall ends
    for axis, free in enumerate((-3.0, -2.0)):
        held = a[inner & first[axis], axis] / free
        if share == 0.0 and gap == 0.5:
            np.testing.assert_allclose(held, 1.0, atol=1e-9)
        # nearer than its row a particle has less of its phase behind it, too, than wall before it
        assert (held < 1.0 - share + 1e-9).all() and (held > -1e-9).all()
        np.testing.assert_allclose(a[(rows > 3 * SPACING).all(axis=1), axis], free, atol=1e-9)


@pytest.mark.parametrize("spec", [SPEC, FREE], ids=["corrected", "conservative"])
def test_a_lone_particle_meets_the_impact_pressure(spec, device):
    """a = -(2/rho) Z u_n sum grad W V along the normal, whatever moves along the wall; nothing where it leaves."""
    fluid = np.array([[0.05, 0.05]])
    accelerations = {}
    for name, velocity in (("into", (0.3, -1.0)), ("along", (0.3, 0.0)), ("off", (0.3, 1.0))):
        bench = Bench(spec, fluid, walls=floor(), velocity=velocity, **options(device))
        bench.prepare()
        accelerations[name] = bench.acceleration(dt=1e-9)[0]
    d = fluid[0] - floor()
    q = np.linalg.norm(d, axis=1) / bench.h
    gradient = 7 / (64 * np.pi) / bench.h**4 * 10 * np.clip(2 - q, 0, None) ** 3 * SPACING**2 @ d
    c = GAS_AND_LIQUID[1].sound_speed
    assert accelerations["into"] == pytest.approx([0.0, 2 * c * 1.0 * gradient[1]], rel=1e-6, abs=1e-9 * c)
    assert np.abs(accelerations["along"]).max() < 1e-9 * c and np.abs(accelerations["off"]).max() < 1e-9 * c


def test_a_fluid_that_is_whole_feels_no_impact(device):
    """It makes its impact pressure by its density: the momentum sweep adds nothing of first order."""
    rows = above(4)
    bench = Bench(SPEC, rows, walls=floor(), velocity=(0.0, -1.0), **options(device))
    bench.prepare()
    inner = (np.abs(rows[:, 0]) < 0.25) & (rows[:, 1] < 0.1)
    assert inner.sum() == 4 and np.abs(bench.acceleration(dt=1e-9)[inner]).max() < 1e-9
    # the same row without the others behind it
    bench = Bench(SPEC, above(1), walls=floor(), velocity=(0.0, -1.0), **options(device))
    bench.prepare()
    assert bench.acceleration(dt=1e-9)[:, 1].min() > 10.0


def test_however_long_the_step_the_wall_does_not_throw_back(device):
    """Backward Euler: the kick of a step of any length leaves a particle no faster off the wall than at rest."""
    for step in (1e-4, 1e-2, 1.0):
        bench = Bench(SPEC, np.array([[0.05, 0.05]]), walls=floor(), velocity=(0.0, -1.0), **options(device))
        bench.prepare()
        assert 0.0 < bench.acceleration(dt=step)[0, 1] * step < 1.0


@pytest.mark.parametrize("gravity", [(0.0, -9.81), (0.0, 9.81)])
def test_the_wall_takes_up_what_presses_a_film_into_it(gravity, device):
    """A row of gas below a liquid that presses on it: not accelerated into the floor, by the liquid or its weight."""
    gas, liquid = above(1), above(4)[above(4)[:, 1] > SPACING]
    every = np.concatenate([gas, liquid])
    phase = np.repeat([0, 1], [len(gas), len(liquid)])
    spec = dataclasses.replace(TWO, gravity=True)
    pressure = np.where(phase == 0, 0.0, 1.0e5)
    bench = Bench(
        spec, every, walls=floor(), spacing=SPACING, phase=phase, fluids=GAS_AND_LIQUID, gravity=gravity, pressure=pressure,
        device=device,
    )  # fmt: skip
    bench.prepare()
    inner = (phase == 0) & (np.abs(every[:, 0]) < 0.25)
    a = bench.acceleration()[inner, 1]
    assert (a >= -1e-9).all()
    if gravity[1] < 0:
        pressed = bench.get("wall_impact")[inner]
        assert (pressed > 0).all(), "the wall carries it"


def test_carried_velocity_knows_no_mirror(device):
    """A lone particle that slides along a no-slip wall is shifted off it, and keeps its velocity as it is."""
    spec = dataclasses.replace(SPEC, wall_no_slip=True, viscosity="morris")
    bench = Bench(
        spec, np.array([[0.05, 0.04]]), walls=floor(), spacing=SPACING, velocity=(3.0, 0.0), shifting=16.0,
        fluids=(Fluid(density=1.0, viscosity=1e-3),), device=device,
    )  # fmt: skip
    bench.prepare()
    bench.acceleration(dt=1e-3)
    assert np.linalg.norm(bench.get("shift")) > 0.0
    assert np.abs(bench.get("carried")).max() == 0.0


def closed(**changes):
    data = {
        "dimension": 2,
        "particle_spacing": 0.05,
        "end_time": 1.0e9,
        "precision": "float64",
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "phases": {"water": {"density": 1000, "sound_speed": 20}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "numerics": {"unlock": 0},
        "output": {"particles": "none", "checkpoint": "none"},
    }
    data.update(changes)
    return Case.from_dict(data)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("side", ["wall", "free_slip"])
def test_a_particle_fired_at_a_wall_stays_in_front_of_it(dimension, side):
    """Mach 0.1 (theory: riemann#a5): a splash of one particle stops 0.3 spacings before the floor, along its normal only."""
    last = dimension - 1
    names = "xyz"[:dimension]
    place = 0.525
    blob = {"box": {"lower": [0.5] * last + [0.3], "upper": [0.55] * last + [0.35]}}
    velocity = ["0.5" if k == 0 else "-2" if k == last else "0" for k in range(dimension)]
    case = closed(
        dimension=dimension,
        domain={"lower": [0] * dimension, "upper": [1] * dimension, "boundary": dict.fromkeys(names, side)},
        phases={"water": {"density": 1000, "sound_speed": 20, "viscosity": 1e-3 if side == "wall" else 0.0}},
        fluids=[{"phase": "water", "shape": blob}],
        start={"velocity": velocity},
        numerics={},
    )
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    nearest = np.inf
    for time in np.linspace(0.0, 0.4, 81)[1:]:
        model.stepper.run(float(time), 10**6)
        state = model.snapshot().fluid
        nearest = min(nearest, state.position[0, last])
    assert nearest > 0.3 * 0.05
    assert state.position[0, 0] == pytest.approx(place + 0.4 * 0.5, rel=0.02), "no friction along the wall to speak of"
    assert np.linalg.norm(state.velocity[0]) < np.hypot(2.0, 0.5), "it may bounce, and gains nothing"


def test_fluid_at_rest_in_the_corner_of_a_lid_is_not_drained(device):
    """What slides along a wall is no divergence, up to the edges, where the other wall begins."""
    boundary = {"x": {"lower": "wall", "upper": {"wall": "no_slip", "velocity": [0, -1]}}, "y": "wall"}
    case = closed(domain={"lower": [0, 0], "upper": [1, 1], "boundary": boundary})
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(1e9, 1)
    s = model.particles.get("density_excess")
    dt = model.snapshot().dt
    assert np.abs(s).max() < 1e-9 * dt / 0.05, "u dt / dx would be the wall that is sucked off"


def test_a_heavy_particle_among_light_ones_comes_to_balance_without_overshoot(device):
    """One of brine in hydrogen, 3-D: its pressure follows theirs at no more than STIFFEST a step."""
    every = lattice((7, 7, 7), SPACING)
    phase = (np.linalg.norm(every, axis=1) < 0.5 * SPACING).astype(int)
    assert phase.sum() == 1
    spec = Spec(dimension=3, precision="float64", multiphase=True, corrected=True, periodic=(False,) * 3)
    fluids = (Fluid(density=0.084, sound_speed=10.0), Fluid(density=1180.0, sound_speed=10.0))
    heavy = int(np.flatnonzero(phase)[0])
    pressure = np.where(phase == 1, 1.0, 0.0)
    bench = Bench(
        spec, every, spacing=SPACING, lower=-0.5, upper=0.5, phase=phase, fluids=fluids, pressure=pressure, device=device
    )  # fmt: skip
    step = 0.5 * bench.h / 10.0
    rate = bench.density_rate(step=step)[heavy]
    change = rate * step * fluids[1].density * fluids[1].sound_speed**2  # of the pressure, which is 1 Pa above the others
    assert -1.51 < change < -1.0
    slow = bench.density_rate(step=0.01 * step)[heavy]
    assert slow == pytest.approx(2.0 * rate, rel=0.05), "unbounded the Riemann problem of so unlike media is twice as stiff"


def test_pressure_of_a_pressed_gas_does_not_overshoot(device):
    """At three times its density a gas is stiffer by 3^gamma: its impedance follows."""
    every = lattice((9, 9), SPACING * 3 ** (-0.5))
    volume = SPACING**2 / 3
    excess = np.full(len(every), 2.0)
    heart = int(np.argmin(np.linalg.norm(every, axis=1)))
    gas = GAS_AND_LIQUID[0]
    stiffness = gas.density * gas.sound_speed**2 / gas.gamma
    pressure = np.full(len(every), stiffness * (3**gas.gamma - 1))
    pressure[heart] += 1.0
    spec = Spec(dimension=2, precision="float64", multiphase=True, corrected=True)
    bench = Bench(
        spec, every, spacing=SPACING, phase=0, volume=volume, excess=excess, pressure=pressure, fluids=(gas,), width=120,
        device=device,
    )  # fmt: skip
    step = 0.5 * bench.h / gas.sound_speed
    change = bench.density_rate(step=step)[heart] * step * gas.density * gas.sound_speed**2 * 3**gas.gamma
    assert -2.0 < change < -1.0, "with the impedance at rest it would be near -5 Pa of 1 Pa, and grow"


def test_phases_at_rest_in_three_dimensions_stay_at_rest():
    """Brine, oil and hydrogen without gravity or tension: rounding does not grow."""
    case = closed(
        dimension=3,
        precision="float32",
        particle_spacing=0.125,
        domain={"lower": [0, 0, 0], "upper": [1, 1, 1], "boundary": {"x": "wall", "y": "periodic", "z": "wall"}},
        phases={"brine": {"density": 1180}, "oil": {"density": 880, "viscosity": 0.02}, "hydrogen": {"density": 0.084}},
        fluids=[
            {"phase": "brine", "shape": {"box": {"lower": [0.25, 0.5, 0.5], "upper": [0.625, 0.875, 0.75]}}},
            {"phase": "oil", "shape": {"box": {"lower": [0, 0, 0], "upper": [1, 1, 0.375]}}},
            {"phase": "hydrogen", "shape": "rest"},
        ],
        numerics={},
        scales={"velocity": 0.1},
    )
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(1e9, 400)
    assert np.abs(model.snapshot().fluid.velocity).max() < 1e-9


def test_density_beyond_which_a_run_has_diverged():
    """A gas may be pressed as far as the hardest phase can press it, a liquid has 0.9 as before."""
    phases = {"gas": {"density": 1.2, "sound_speed": 50, "gamma": 1.4}, "liquid": {"density": 1000, "sound_speed": 10}}
    case = closed(
        phases=phases,
        fluids=[
            {"phase": "liquid", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}},
            {"phase": "gas", "shape": "rest"},
        ],
    )
    physics = derive(case, build(case, support_radius(case)))
    hardest = 1000 * 10.0**2
    assert physics.hardest_pressure == hardest
    expected = (1 + 1.4 * hardest / (1.2 * 50**2)) ** (1 / 1.4) - 1
    model = Model(case, threads=1)
    rows = model.particles.get("phase")
    assert model.most_excess(int(np.argmax(rows == 0))) == pytest.approx(expected) and expected > 10
    assert model.most_excess(int(np.argmax(rows == 1))) == pytest.approx(0.9)


def test_leaks_are_counted_by_phase_and_warned_of(tmp_path):
    """Beyond a side that is a wall and inside a body; not beyond an open side, not what grazes a face or an edge."""
    boundary = {"x": "wall", "y": {"lower": "wall", "upper": "open"}}
    case = closed(
        domain={"lower": [0, 0], "upper": [1, 1], "boundary": boundary},
        bodies={"block": {"shape": {"box": {"lower": [0.4, 0.4], "upper": [0.6, 0.6]}}}},
        fluids=[{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.3, 0.3]}}}],
        end_time=1e-4,
    )
    model = Model(case, threads=2)
    assert model.leaks() == ({"water": 0}, {"water": 0})
    start = model.particles.get("anchor")

    def put(places):
        position = model.particles.get("anchor")
        position[: len(places)] = places
        for name in ("anchor", "position"):
            model.particles.put(name, position)
        model.stepper.rebuild(moving=False)

    sunk = 0.4 + 1.1 * SUNK * case.spacing
    grazing = 0.4 + 0.9 * SUNK * case.spacing
    put([[-0.001, 0.2], [0.2, -0.1], [0.2, 1.3], [sunk, 0.5], [grazing, 0.5], [0.39, 0.41]])
    assert model.leaks() == ({"water": 3}, {"water": 3})
    put(start)
    assert model.leaks() == ({"water": 3}, {"water": 0})
    assert model.save_state()["leak_counts"].tolist() == [0, 3]

    simulation = Simulation(case, output=tmp_path / "run", threads=1)
    simulation.model.stepper.bindings["leak_counts"].assign([0, 2])
    simulation.run()
    assert simulation.summary["leaks"] == {"largest": {"water": 2}, "last": {"water": 0}}
    assert any("beyond a wall or inside a body: water 2 (at the end 0)" in text for text in simulation.summary["warnings"])
    assert "beyond a wall" in (tmp_path / "run" / "log.txt").read_text()


def test_what_is_lost_over_a_rim_is_stopped_and_nothing_else():
    """Twice as far beyond a wall as the kernel reaches; above an open side, in the wall and inside nothing is touched."""
    case = closed(
        domain={"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
        fluids=[{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.3, 0.3]}}}],
        gravity=[0, -9.81],
    )
    model = Simulation(case, threads=1).model
    particles, reach = model.particles, model.physics.support
    place = particles.get("anchor")
    lost = [[1 + 2.1 * reach, 0.5], [0.5, -2.1 * reach], [-2.1 * reach, 3.0]]
    kept = [[1 + 1.9 * reach, 0.5], [0.5, 5.0], [-0.01, 0.5], [0.6, 0.6]]
    place[:7] = [*lost, *kept]
    for name in ("anchor", "position"):
        particles.put(name, place)
    particles.put("velocity", np.full_like(particles.get("velocity"), 3.0))
    names = particles.get("particle_id")[:7].tolist()
    model.stepper.rebuild(moving=False)
    row = {int(name): k for k, name in enumerate(particles.get("particle_id"))}
    velocity = particles.get("velocity")
    assert (velocity[[row[name] for name in names[:3]]] == 0.0).all()
    assert (velocity == 0.0).all(axis=1).sum() == 3


def test_water_over_the_rim_of_an_open_side_is_warned_of(tmp_path):
    """Beyond a wall and above the rim, or deeper than the wall is thick; not above the open side, not within the wall."""
    case = closed(
        domain={"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
        fluids=[{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.3, 0.3]}}}],
        end_time=1e-4,
    )
    simulation = Simulation(case, output=tmp_path / "run", threads=1)
    position = simulation.model.particles.get("anchor")
    position[:5] = [[0.5, 1.3], [-0.01, 0.9], [-0.01, 1.2], [1.4, 0.5], [0.5, -3.0]]
    for name in ("anchor", "position"):
        simulation.model.particles.put(name, position)
    simulation.model.stepper.rebuild(moving=False)
    simulation.run()
    assert simulation.summary["spilled"] == {"water": 3}
    assert any("over the rim of an open side" in text and "water 3" in text for text in simulation.summary["warnings"])
    assert "stopped outside" in (tmp_path / "run" / "log.txt").read_text()


@pytest.mark.parametrize("numerics", [{}, {"scheme": "isph", "pressure_gradient": "conservative"}])
def test_leaks_into_bodies_of_cells_are_counted(numerics):
    """Several fluids leave a body of whole cells as cells; so does the conservative gradient of a scheme that mirrors."""
    phases = {"water": {"density": 1000, "viscosity": 0.1}, "oil": {"density": 900, "viscosity": 0.1}}
    fluids = [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.3, 0.3]}}}]
    several = not numerics
    if several:
        fluids.append({"phase": "oil", "shape": "rest"})
    case = closed(
        bodies={"block": {"shape": {"box": {"lower": [0.4, 0.4], "upper": [0.6, 0.6]}}}},
        phases=phases if several else {"water": phases["water"]},
        fluids=fluids,
        numerics=numerics,
        end_time=1e-4,
    )
    model = Model(case, threads=2)
    assert not model.physics.spec.bodies
    assert sum(model.leaks()[0].values()) == 0
    cell = 0.4 + 0.5 * case.spacing
    off = INSIDE * case.spacing
    position = model.particles.get("anchor")
    water = np.flatnonzero(model.particles.get("phase") == 0) if several else np.arange(10)
    position[water[:3]] = [[cell - 0.9 * off, cell], [cell - 1.1 * off, cell], [-0.01, 0.5]]
    for name in ("anchor", "position"):
        model.particles.put(name, position)
    model.stepper.rebuild(moving=False)
    assert model.leaks()[1]["water"] == 2
