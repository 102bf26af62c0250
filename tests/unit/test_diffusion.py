"""Implicit viscosity of projection ISPH: its operator, stability at any step, walls, order in time, when it is chosen."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.helpers import Fluid, lattice
from tests.isph_scenes import COUETTE, TANK, VORTICES, start
from tests.projection import Stages, channel_spec, digits, open_spec, periodic_spec
from tests.scenes import case_of
from tests.unit.test_clock import Clock
from tests.unit.test_isph_case import assert_same, deep, in_three, kept
from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.errors import CaseError
from warpsph.files import checkpoint
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.mirror import FREE_SLIP, NO_SLIP, NO_WALL
from warpsph.kernels.core.viscosity import FRICTION_SHAPE, friction_scale
from warpsph.kernels.isph.diffusion import STABILISER
from warpsph.running.preview import describe, estimate
from warpsph.scene import physics
from warpsph.scene.geometry import build
from warpsph.scene.physics import derive, support_radius
from warpsph.schemes import isph_physics as incompressible

CASES = Path(__file__).resolve().parents[2] / "cases"

SPACING = 0.1
WATER = Fluid(density=4.0, viscosity=0.3)
NU = 0.3 / 4.0
BOTH = pytest.mark.parametrize("precision", ["float64", "float32"])
DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3])
CLOSE = {"float64": 1e-11, "float32": 1e-5}
STEP = {"dt": 0.6, "last": 0.48}  # omega = 1.25; dt nu/h^2 = 2
BETA = 2.25 / 3.5 * STEP["dt"]
EXPLICIT = 0.15  # limit of explicit viscosity that the operator is told


def block(dimension, seed=1, jitter=0.2):
    """Return a disordered block in the first quadrant (octant), (n, d)."""
    return lattice((9, 8) if dimension == 2 else (7, 6, 6), SPACING, jitter, seed, centre=False)


def size(dimension):
    return np.array([0.9, 0.8] if dimension == 2 else [0.7, 0.6, 0.6])


def scene(place, dimension, precision="float64", **options):
    """Return a bench with volumes that differ: periodic, a drop, between walls, in a tank, or at a body."""
    x = block(dimension)
    options = {"fluids": (WATER,), "lower": 0.0, "upper": size(dimension), "width": 300, **STEP, **options}
    options["spacing"] = SPACING
    options.setdefault("volume", SPACING**dimension * np.random.default_rng(3).uniform(0.9, 1.1, len(x)))
    on = {"implicit_viscosity": True}
    if place == "periodic":
        spec, x = periodic_spec(dimension, precision, **on), np.mod(x, size(dimension))
    elif place == "drop":
        spec = open_spec(dimension, precision, **on)
        del options["lower"], options["upper"]
    elif place == "channel":
        spec = channel_spec(dimension, precision, **on)
        options["kinds"] = [NO_WALL] * 2 + [NO_SLIP, FREE_SLIP] * (dimension - 1)
    elif place == "tank":
        spec = open_spec(dimension, precision, **on)
        options["kinds"] = [FREE_SLIP, NO_SLIP] * (dimension - 1) + [NO_SLIP, NO_WALL]
    else:
        spec = open_spec(dimension, precision, walls=True, wall_no_slip=True, **on)
        walls = block(dimension, seed=5)
        options["walls"] = walls - np.eye(dimension)[0] * (walls.max(axis=0) + 0.5 * SPACING)
        options["slip"] = (np.arange(len(walls)) % 3 == 0).astype(int)
        del options["lower"], options["upper"]
    bench = Stages(spec, x, **options)
    bench.set_clock(VISCOUS_STEP=EXPLICIT)
    return bench


PLACES = pytest.mark.parametrize("place", ["periodic", "drop", "channel", "tank", "body"])


def reference(bench, component):
    """Return the matrix of a component from sums over explicit images."""
    spec = bench.spec
    d = spec.dimension
    volume = bench.get("rest_volume")
    n = len(volume)
    factor = BETA * NU * STABILISER[spec.viscosity][d - 1] * (1.0 - EXPLICIT / STEP["dt"])
    matrix = np.eye(n)

    def coefficient(x):
        return 2.0 if spec.viscosity == "morris" else 2.0 * (d + 2) * x[..., component] ** 2 / (x**2).sum(axis=-1)

    def weights(f, x):
        """F of Wendland's C2, -80 (1 - s)^3, or -K (1 - s)^1.5 sum a_k s^k in its place, s = r/R."""
        if spec.viscosity != "isotropic":
            return f
        s = np.linalg.norm(x, axis=-1) / (2 * bench.h)
        u = np.clip(1.0 - s, 1e-9, None)
        shape = np.polynomial.Polynomial(FRICTION_SHAPE[d])(s)
        return np.where(f != 0.0, f * friction_scale("wendland_c2", d) / 80.0 * u**-1.5 * shape, 0.0)

    for code, x, f in bench.pairs():
        sides = [(axis, 2 * axis + digit - 1) for axis, digit in enumerate(digits(code, d)) if digit]
        turned = any(axis == component or bench.kinds[side] == NO_SLIP for axis, side in sides)
        with np.errstate(invalid="ignore"):
            w = np.where(f != 0.0, -factor * weights(f, x) * coefficient(x), 0.0)
        matrix += np.diag(w.sum(axis=1)) - (-w if turned else w)
    if spec.walls:
        walls = bench.get("position")[n:]
        x = bench.get("position")[:n, None] - walls[None]
        r = np.linalg.norm(x, axis=-1)
        f = bench.params.g_norm * -10.0 * np.clip(2.0 - r / bench.h, 0, None) ** 3 * SPACING**d
        w = np.where(bench.get("slip") == 0, -factor * weights(f, x) * coefficient(x), 0.0)
        matrix += 2.0 * np.diag(w.sum(axis=1))
    return matrix * (volume / SPACING**d)[:, None]


# operator -------------------------------------------------------------------------------------------------------------


@BOTH
@DIMENSIONS
@PLACES
def test_the_operator_is_that_of_the_images(place, dimension, precision, device):
    """Every entry against explicit images: symmetric; rows without a wall near sum up to their volume share."""
    bench = scene(place, dimension, precision, device=device)
    bench.look()
    share = bench.get("rest_volume") / SPACING**dimension
    for component in range(dimension):
        found, _ = bench.diffusion(component)
        expected = reference(bench, component)
        np.testing.assert_allclose(found, expected, rtol=0, atol=CLOSE[precision] * np.abs(expected).max())
        np.testing.assert_allclose(found, found.T, rtol=0, atol=CLOSE[precision] * np.abs(expected).max())
        if place in ("periodic", "drop"):
            np.testing.assert_allclose(found.sum(axis=1), share, rtol=100 * CLOSE[precision])
        else:
            assert (found.sum(axis=1) > 1.5 * share).sum() > 5
            assert (found.sum(axis=1) > 0.99 * share).all()
        assert np.abs(found - np.diag(np.diag(found))).max() > 0.1


@DIMENSIONS
def test_components_share_a_matrix_where_they_can(dimension, device):
    """Morris between no-slip walls; radial forms and free-slip sides make one a component."""
    bench = scene("periodic", dimension, device=device)
    bench.look()
    np.testing.assert_array_equal(bench.diffusion(0)[0], bench.diffusion(dimension - 1)[0])
    bench = scene("channel", dimension, device=device)
    bench.look()
    assert np.abs(bench.diffusion(0)[0] - bench.diffusion(1)[0]).max() > 0.1


@DIMENSIONS
@PLACES
def test_what_a_step_adds_is_damped(place, dimension, device):
    """u* = u*_x - r + (matrix)^-1 r with r = u*_x - u_e - beta dt/rho grad p, component by component."""
    random = np.random.default_rng(8)
    x = block(dimension)
    u, old, gradient = random.normal(size=(3, len(x), dimension))
    bench = scene(place, dimension, velocity=u, velocity_old=old, device=device)
    star = bench.look().copy()
    bench.put("lasting_gradient", gradient)
    share = bench.get("rest_volume") / SPACING**dimension
    extrapolated = u + 1.25 * (u - old)
    expected = star.copy()
    for component in range(dimension):
        r = (star - extrapolated - BETA / WATER.density * gradient)[:, component]
        matrix, source = bench.diffusion(component)
        np.testing.assert_allclose(source, share * r, atol=1e-12)
        expected[:, component] += np.linalg.solve(matrix, share * r) - r
    found = bench.diffuse(1e-11)
    np.testing.assert_allclose(found, expected, atol=1e-8)
    assert np.abs(found - star).max() > 0.1


@pytest.mark.parametrize("place", ["periodic", "drop"])
def test_a_short_step_is_explicit(place, device):
    """Up to the limit of explicit viscosity u* stays what it is."""
    u, old = np.random.default_rng(8).normal(size=(2, 72, 2))
    bench = scene(place, 2, velocity=u, velocity_old=old, device=device)
    for limit, same in ((STEP["dt"], True), (0.9 * STEP["dt"], False)):
        bench.set_clock(VISCOUS_STEP=limit)
        star = bench.look().copy()
        assert bool(np.abs(bench.diffuse() - star).max() < 1e-12) is same


def test_a_fluid_that_stays_as_it_is_feels_nothing(device):
    """At rest under its weight, balanced by the pressure: the last gradient is part of what is solved for."""
    bench = scene("tank", 2, gravity=(0.0, -9.81), device=device)
    bench.look()
    bench.put("lasting_gradient", (0.0, -9.81 * WATER.density))
    np.testing.assert_allclose(bench.diffuse(), np.tile([0.0, -9.81 * BETA], (72, 1)), atol=1e-12)


# stability ------------------------------------------------------------------------------------------------------------


@DIMENSIONS
@pytest.mark.parametrize("place", ["periodic", "channel"])
def test_no_step_is_too_long(place, dimension, device):
    """Steps of up to 10^4 h^2/nu let noise die down; explicit friction blows it up at one.

    With a free surface friction has its pressure: tests/unit/test_surface_friction.py.
    """
    random = np.random.default_rng(9)
    count = len(block(dimension))

    def steps(number, implicit, many):
        dt = number * (1.5 * SPACING) ** 2 / NU
        u = random.normal(size=(count, dimension))
        bench = scene(place, dimension, dt=dt, last=dt, velocity=u, velocity_old=u, device=device)
        limit = physics.VISCOUS_LIMIT[bench.spec.viscosity] * incompressible.EXTRAPOLATED
        bench.set_clock(VISCOUS_STEP=limit * bench.h**2 / NU)
        sizes = []
        for _ in range(many):
            star = bench.look()
            star = bench.diffuse() if implicit else star
            old = bench.get("velocity")
            bench.put("velocity", star)
            bench.put("velocity_old", old)
            sizes.append(np.abs(star).max())
        return np.array(sizes)

    for number in (0.1, 0.5, 10.0, 1e4):
        sizes = steps(number, True, 60)
        assert sizes[-1] < (1.0 if place == "periodic" else 0.15)
        assert sizes[-1] <= sizes[-20:].max()
    sizes = steps(1.0, False, 12)
    assert sizes[-1] > 1e3


# whole runs -----------------------------------------------------------------------------------------------------------

HONEY = {"phases__water__viscosity": 1.0, "numerics__implicit_viscosity": True}


def long_steps(simulation):
    """Let a run take steps of numerics.maximum_step from the first one on, stabilised in full at any of them."""
    simulation.model.stepper.write(clock={ck.CHANGE: 0.0, ck.VISCOUS_STEP: 0.0})


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_couette_flow_is_steady(dimension, precision, device):
    """The linear profile between a moving and a standing no-slip side, at 20 times the step of explicit viscosity."""
    scene = COUETTE
    if dimension == 3:
        scene = in_three(COUETTE, start={"velocity": ["y", 0, 0], "noise": 0.1})
        scene["domain"]["boundary"]["y"]["upper"]["velocity"] = [1, 0, 0]
    step = 20 * 0.083 * 0.15**2
    simulation = start(
        scene, device=device, precision=precision, end_time=1.0, numerics__maximum_step=step, numerics__volume_feedback=0,
        **HONEY,
    )  # fmt: skip
    long_steps(simulation)
    simulation.model.stepper.run(20 * step, 4)  # steps are even up to the target
    state = simulation.state
    assert state.dt == pytest.approx(step)
    np.testing.assert_allclose(state.velocity[:, 0], state.position[:, 1], atol=5e-3)
    assert np.abs(state.velocity[:, 1]).max() < 5e-3


def test_a_tank_of_honey_is_at_rest(monkeypatch, device):
    """No-slip walls hold no spurious flow: the weight is no source of friction."""
    monkeypatch.setattr(incompressible, "CHANGE", 1e30)
    changes = {"phases__water__viscosity": 2000.0, "numerics__implicit_viscosity": True, "numerics__tolerance": 1e-8}
    simulation = start(TANK, device=device, end_time=1.0, numerics__maximum_step=0.02, **changes)
    pressure, speed = deep(TANK)
    simulation.model.stepper.run(1.0, 15)
    state = simulation.state
    assert 0.95 * 0.02 < state.dt <= 0.02 * (1 + 1e-6) and simulation.physics.viscous_step < 0.001
    assert np.linalg.norm(state.velocity, axis=1).max() < 1e-4 * speed
    np.testing.assert_allclose(state.pressure, pressure * (1 - state.position[:, 1] / 0.8), rtol=0, atol=1e-3 * pressure)


# The floor is a body.
SLAB = {
    **VORTICES,
    "domain": {**VORTICES["domain"], "boundary": {"x": "periodic", "y": "wall"}},
    "bodies": {"slab": {"shape": {"box": {"lower": [0, 0], "upper": [1, 0.25]}}}},
    "start": {"velocity": ["where(y > 0.25, sin(pi*(y - 0.25)/0.75), 0)", 0]},
}
WALLED = {
    **VORTICES,
    "domain": {**VORTICES["domain"], "boundary": {"x": "periodic", "y": {"lower": "wall", "upper": "free_slip"}}},
    "start": {"velocity": ["sin(2*pi*y)*(1 + 0.5*cos(2*pi*x))", "sin(pi*y)**2*sin(2*pi*x)"]},
}


@pytest.mark.parametrize("scene", ["vortices", "walled", "slab"])
def test_order_in_time(scene, device):
    """Differences between runs with steps h, h/2 and h/4 fall by 4, the steps beyond the limit of explicit viscosity."""
    found = []
    for step in (0.004, 0.002, 0.001):
        simulation = start(
            {"vortices": VORTICES, "walled": WALLED, "slab": SLAB}[scene],
            device=device,
            end_time=0.032,
            numerics__maximum_step=step,
            numerics__shifting=1e-15,
            numerics__volume_feedback=0,
            numerics__pressure_gradient="corrected",
            numerics__tolerance=1e-11,
            **HONEY,
        )
        long_steps(simulation)
        simulation.run()
        found.append(np.concatenate([simulation.state.position, simulation.state.velocity], axis=1))
    wrapped = [(b - a + 0.5) % 1.0 - 0.5 for a, b in zip(found, found[1:], strict=False)]
    coarse, fine = (np.sqrt((d**2).mean()) for d in wrapped)
    assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.35)


@pytest.mark.parametrize("scene, matrices", [(VORTICES, 1), (WALLED, 2)])
def test_the_matrix_is_filled_as_often_as_it_differs(scene, matrices, device):
    simulation = start(scene, device=device, **HONEY)
    names = [task.name for task in simulation.model.stepper.step_tasks]
    assert names.count("diffusion_matrix") == matrices
    assert names.count("diffusion_source") == names.count("diffusion_solve") == names.count("diffusion_take") == 2


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_restart_continues_bit_by_bit(precision, monkeypatch, device, tmp_path):
    monkeypatch.setattr(incompressible, "CHANGE", 0.3)
    changes = {"precision": precision, "output__checkpoint": {"interval": 0.01, "keep": 9}, "end_time": 0.05}
    case = case_of(VORTICES, **changes, **HONEY)
    whole = Simulation(case, output=tmp_path / "whole", threads=1, device=device).run()
    told = whole.summary["solver"]["viscosity"]
    assert told["solves"] >= 2 * whole.model.steps and told["iterations"] > whole.model.steps
    files = sorted((tmp_path / "whole" / "checkpoint").glob("*.h5"))
    assert len(files) == 5 and whole.model.steps > 8
    for file in files[:-1]:
        again = Simulation(case, restart=file, threads=1, device=device)
        assert_same(checkpoint.load(file)[0], kept(again))
        again.run()
        assert_same(kept(whole), kept(again))


# choice and step ------------------------------------------------------------------------------------------------------


def derived(scene, **changes):
    case = case_of(scene, **changes)
    return derive(case, build(case, support_radius(case)))


def test_when_viscosity_is_implicit():
    """Where explicit steps are WORTH times shorter; not in the printed scheme, and not without viscosity."""
    h, courant = 1.5 / 12, 0.4
    equal = 0.125 * 2 / 3 * h**2 / (courant * h)  # kinematic viscosity whose explicit step is that of the Courant number
    for share, implicit in ((0.9, False), (1.1, True)):
        found = derived(VORTICES, phases__water__viscosity=share * incompressible.WORTH * equal, end_time=1.0)
        assert found.spec.implicit_viscosity is implicit and found.choices["implicit_viscosity"] is implicit
        assert ("viscosity" in found.step_cap) is not implicit
        limit = found.viscous_step if implicit else found.step_cap["viscosity"]
        assert limit == pytest.approx(courant * h / (share * incompressible.WORTH), rel=0.01)
        assert "s, all else of" in found.reasons["implicit_viscosity"]
    assert not derived(VORTICES, phases__water__viscosity=10.0, numerics__formulation="paper").spec.implicit_viscosity
    assert not derived(VORTICES, phases__water__viscosity=0.0, numerics__implicit_viscosity=True).spec.implicit_viscosity
    for given in (True, False):
        assert derived(VORTICES, numerics__implicit_viscosity=given).spec.implicit_viscosity is given


def test_what_is_told_before_a_run():
    """The stages, the reason, and steps of the order of those done: 126 from rest, explicit viscosity takes 8 500."""
    case = load_case(CASES / "poiseuille.yaml", ["numerics.scheme=isph"])
    plan = describe(case)
    assert {"diffusion_matrix", "diffusion_source", "diffusion_take"} <= {stage["name"] for stage in plan["stages"]}
    assert "explicit friction allows steps of 0.000117 s" in plan["reasons"]["implicit_viscosity"]
    assert "viscosity" not in plan["structure"]["step limits"]
    assert 100 < estimate(case)["steps"] < 400
    explicit = load_case(CASES / "poiseuille.yaml", ["numerics.scheme=isph", "numerics.implicit_viscosity=false"])
    assert "implicit viscosity" in {row["name"] for row in describe(explicit)["absent"]}
    assert estimate(explicit)["steps"] > 8000


@pytest.mark.parametrize("scheme", ["isph", "riemann"])
def test_the_key_is_of_one_scheme(scheme):
    scene = {**VORTICES, "numerics": {"scheme": scheme, "implicit_viscosity": True}}
    if scheme == "isph":
        Case.from_dict(scene)
        return
    with pytest.raises(CaseError) as caught:
        Case.from_dict(scene)
    assert "is a choice of scheme: isph" in str(caught.value) and "numerics.implicit_viscosity" in str(caught.value)


def test_a_viscous_solve_that_fails_is_told(monkeypatch, device):
    monkeypatch.setattr(incompressible, "CHANGE", 0.3)
    simulation = start(VORTICES, device=device, numerics__maximum_iterations=1, start__noise=0.2, **HONEY)
    simulation.run()
    told = simulation.summary["solver"]["viscosity"]
    assert told["failures"] > 0 and told["worst_residual"] > told["tolerance"]
    assert any("solves of implicit viscosity" in text for text in simulation.summary["warnings"])


def test_a_step_follows_the_change_of_the_flow():
    """CHANGE u/a, at least the limit of explicit viscosity, and at most GROWTH times the step before."""
    values = {"SOUND": 0.0, "COURANT": 1e9, "FORCE": 1e9, "SKIN": 1e30, "FARTHEST": 1e30}
    values.update(VISCOUS_STEP=0.01, CHANGE=0.05, TARGET=1e9)  # so far away that even steps are whole ones
    assert Clock(**values).advance(advancing=0).STEP == pytest.approx(0.01)
    assert Clock(**values, STEP=1.0).advance(speed=8.0, acceleration=2.0).STEP == pytest.approx(0.2)
    assert Clock(**values, STEP=1.0).advance(speed=8.0, acceleration=1e9).STEP == pytest.approx(0.01)
    assert Clock(**values, STEP=0.02).advance(speed=8.0, acceleration=2.0).STEP == pytest.approx(0.02 * ck.GROWTH)
    capped = Clock(**{**values, "CHANGE": 0.0}, STEP=0.02, STEP_CAP=3.0)
    assert capped.advance(speed=8.0, acceleration=2.0).STEP == pytest.approx(3.0)
