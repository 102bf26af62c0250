"""Water that has splashed keeps its volume: thin fluid has no pressure, and density follows the room of the particles."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.eigenvalue import WHOLE
from warpsph.running.model import Model

ROOT = Path(__file__).resolve().parents[2]
SPACING = 0.05
PRESSED = 0.002  # density excess of what is looked at


def script(name):
    """The module of a script."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def sloshing():
    return script("sloshing_volume")


@pytest.mark.parametrize(("scheme", "most", "worth"), [("riemann", 1.04, 0.015), ("delta_plus", 1.15, 0.03)])
def test_water_that_has_splashed_keeps_its_volume(sloshing, scheme, most, worth):
    """With 20 spacings a height; a row of disordered particles more or less is 5 %. Without: 1.044 and 1.29.

    A mean of three Courant numbers: single runs of the Riemann scheme have 1.014 to 1.021, without 1.039 to 1.050, so that
    one run is enough to see that it is the room that keeps the volume.
    """

    def volume(courant, key):
        row = sloshing.run((scheme, 20, (20.0,), (f"numerics.courant={courant}", key), 2))
        assert row["diverged"] is None
        return row["samples"][0]["volume"]

    mean = np.mean([volume(courant, "precision=float32") for courant in (0.35, 0.4, 0.45)])
    assert 0.95 < mean < most
    assert volume(0.4, "numerics.room_rate=0") > mean + worth


def block(scheme, dimension, rows, floor=False, room_rate=None, across=12):
    """Water `rows` spacings high and `across` wide without gravity, alone or on a floor."""
    axes = "xyz"[:dimension]
    width, height = across * SPACING, rows * SPACING
    up = {"lower": "free_slip", "upper": "open"} if floor else "open"
    lower = [0.0] * dimension
    upper = [width] * (dimension - 1) + [height]
    numerics = {"scheme": scheme} | ({} if room_rate is None else {"room_rate": room_rate})
    case = Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": SPACING,
            "end_time": 1e9,
            "domain": {
                "lower": [-1.0] * (dimension - 1) + [0.0 if floor else -1.0],
                "upper": [2.0] * dimension,
                "boundary": dict.fromkeys(axes[:-1], "open") | {axes[-1]: up},
            },
            "phases": {"water": {"density": 1000, "sound_speed": 20}},
            "fluids": [{"phase": "water", "shape": {"box": {"lower": lower, "upper": upper}}}],
            "numerics": numerics,
            "output": {"particles": "none", "checkpoint": "none"},
        }
    )
    return Model(case, threads=1)


def excess_after_a_step(model, excess=PRESSED, apart=1.0):
    """Density excess of all particles after one step, from the same of all, at distances `apart` times those at rest."""
    particles = model.particles
    for name in ("anchor", "position"):
        particles.put(name, particles.get(name) * apart)
    particles.put("density_excess", np.full(particles.fluid_count, excess))
    model.stepper.rebuild(moving=False)
    model.stepper.prepare(fresh=True)
    model.stepper.run(1e9, 1)
    assert not model.stepper.read()[1][ck.FAULT]
    return particles.get("density_excess")[: particles.fluid_count]


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_thin_fluid_has_no_pressure(scheme, dimension):
    """A sheet of two rows in the open, pressed, lets go at once; without room_rate it does not."""
    assert (excess_after_a_step(block(scheme, dimension, 2)) <= 0).all()
    assert (excess_after_a_step(block(scheme, dimension, 2, room_rate=0)) > 0.5 * PRESSED).any()


@pytest.mark.parametrize("dimension", [2, 3])
def test_thin_fluid_has_no_tension_either(dimension):
    """A density below rest would draw the sheet together: it is forgotten at once, where room is looked at."""
    assert (excess_after_a_step(block("riemann", dimension, 2), excess=-PRESSED) == 0).all()
    assert (excess_after_a_step(block("riemann", dimension, 2, room_rate=0), excess=-PRESSED) < -0.5 * PRESSED).any()


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus"])
def test_spray_far_apart_has_no_pressure(scheme):
    """Twelve rows at 1.7 spacings from each other are a third of the fluid that their densities say."""
    assert (excess_after_a_step(block(scheme, 2, 12), apart=1.7) <= 0).all()


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus"])
@pytest.mark.parametrize(("rows", "floor"), [(12, False), (2, True), (12, True)])
def test_bodies_of_fluid_and_films_on_walls_keep_theirs(scheme, rows, floor):
    """A pressed block keeps its pressure where a whole particle is in reach, a film on a floor all over."""
    excess = excess_after_a_step(block(scheme, 2, rows, floor=floor))
    assert (excess > 0.2 * PRESSED).mean() > 0.5


@pytest.mark.parametrize(("height", "kept"), [(0.9, True), (1.1, False), (2.0, False)])
def test_single_particles_are_held_by_walls_that_they_touch(height, kept):
    """Above them what they were pressed to is memory: it held some over a beach, at the pressure of five times its depth."""
    model = block("delta_plus", 2, 1, floor=True)
    fluid = slice(model.particles.fluid_count)
    for name in ("anchor", "position"):
        place = model.particles.get(name)
        place[fluid] *= (3.0, 2.0 * height)  # a row half a spacing high, whose particles are alone then
        model.particles.put(name, place)
    excess = excess_after_a_step(model)
    assert (excess > 0.5 * PRESSED).all() if kept else (excess <= 0.0).all()


def test_density_follows_the_room_of_strained_fluid():
    """Distances 2 % too wide: where fluid is sheared its density falls, at the rate of the theory, and only there."""
    change, expected = [], []
    sparse = 1.02**-2  # of the volume; the sums of the strain miss as much
    for rate, shear in ((0.0, 5.0), (8.0, 5.0), (8.0, 0.0)):
        model = block("riemann", 2, 24, room_rate=rate, across=24)
        place = model.particles.get("position")[:, :]
        velocity = np.zeros_like(place)
        velocity[:, 0] = shear * place[:, 1]
        model.particles.put("velocity", velocity)
        excess = excess_after_a_step(model, excess=0.0, apart=1.02)
        inside = np.abs(place[:, 1] - 12 * SPACING) < 2 * SPACING
        inside &= np.abs(place[:, 0] - 12 * SPACING) < 2 * SPACING
        change.append(float(excess[inside].mean()))
        expected.append(rate * shear * sparse * (sparse - 1.0) * float(model.stepper.read()[0][ck.LAST_STEP]))
    assert change[0] == pytest.approx(0.0, abs=1e-6)
    assert change[1] == pytest.approx(expected[1], rel=0.02)
    assert change[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("apart", [0.85, 1.05])
def test_a_crowd_is_one_whatever_its_neighbourhood_lacks(apart):
    """What is missing beside a surface lowers the sum of the room: one too large is a crowd, one too small says nothing."""
    model = block("riemann", 2, 12)
    place = model.particles.get("position")[:, :]
    model.particles.put("velocity", np.stack([5.0 * place[:, 1], np.zeros(len(place))], axis=1))
    excess_after_a_step(model, excess=0.0, apart=apart)
    place, rate = model.particles.get("position"), model.particles.get("room_part")
    near = np.linalg.norm(place[:, None] - place[None], axis=2)
    reach = model.physics.support
    full = ((near >= reach) | (model.particles.get("wholeness") >= WHOLE)[None]).all(axis=1)
    window = np.maximum(1.0 - (near / reach) ** 2, 0.0) ** 4
    room = (window @ model.particles.get("state")[:, 1]) / (np.pi * reach**2 / 5) - 1.0  # the integral of the window in 2-D
    assert full.any() and (room[~full] < -0.1).any() and (apart > 1 or (room[~full] > 0.1).any())
    assert (rate[~full & (room < -0.02)] == 0).all()
    assert (rate[full] * np.sign(room[full]) > 0).all()
    assert (rate[room > 0.02] > 0).all()


@pytest.mark.slow
def test_a_splash_in_three_dimensions_leaves_no_crowds():
    """With 11 spacings a height, to 1.5 s: no particle has 1.3 times the neighbours of a lattice; two had before."""
    crowds = script("crowds")
    row = crowds.run(ROOT / "cases" / "dam_break_block.yaml", ["particle_spacing=0.55/11"], 1.5, "cpu", 1)
    assert row["diverged"] is None and row["crowded"] == [0, 0, 0]
