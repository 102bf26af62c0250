"""What `auto` comes to: sound speeds, formulation, time-step limits."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.scenes import PERIODIC, case_of
from warpsph.case.case import Case
from warpsph.case.case_file import load_case
from warpsph.errors import CaseError
from warpsph.running.model import Model
from warpsph.scene.geometry import build
from warpsph.scene.physics import derive, support_radius

CASES = Path(__file__).resolve().parents[2] / "cases"
LAPLACE = 1.0 / math.sqrt(1 / math.pi)  # sigma/R of the droplet below, of its area [Pa]


def physics_of(case):
    return derive(case, build(case, support_radius(case)))


def droplet(**changes):
    return Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": 2 / 26,
            "end_time": 1.0,
            "domain": {"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
            "phases": {
                "gas": {"density": 1.0, "viscosity": 0.005, "gamma": 1.4},
                "liquid": {"density": 1000.0, "viscosity": 0.5},
            },
            "surface_tension": [{"between": ["gas", "liquid"], "coefficient": 1.0}],
            "fluids": [
                {"phase": "gas", "shape": {"box": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5]}}},
                {"phase": "liquid", "shape": "rest"},
            ],
        }
    ).replace(changes)


# so little that it adds nothing to the pressures
WEIGHT = {"gravity": [0, -1e-12]}


@pytest.mark.parametrize("density, share", [(199.0, 25), (201.0, 100)])
def test_a_light_phase_may_be_compressed_more(density, share):
    """Below a fifth of the largest density. The dense phase is no faster than the light one, which costs no time step."""
    case = droplet(**{"phases.gas.density": density, "scales.velocity": 1e-3, **WEIGHT})
    light, dense = physics_of(case).sound_speed
    assert density * light**2 == pytest.approx(share * LAPLACE)
    assert dense == pytest.approx(light)


def test_a_light_phase_that_nothing_holds_is_as_stiff_as_any():
    """Beside an open side its volume follows the pressure itself, not its change, unless it starts with that pressure."""
    sides = {"x": "wall", "y": {"lower": "wall", "upper": "open"}}
    for changes, share in ({"domain.boundary": sides}, 100), ({"domain.boundary": sides, "start.pressure": 2.0}, 25):
        light, _ = physics_of(droplet(**changes, **WEIGHT)).sound_speed
        assert light**2 == pytest.approx(share * LAPLACE)


def test_a_box_with_a_free_surface_holds_no_volume():
    """Closed on all sides, but the liquid fills a part of it: the gas may give way like beside an open side."""
    half = [
        {"phase": "gas", "shape": {"box": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5]}}},
        {"phase": "liquid", "shape": {"where": {"condition": "where(abs(x) > abs(y), abs(x), abs(y)) > 0.5 and y < 0.8"}}},
    ]
    light, _ = physics_of(droplet(fluids=half, **WEIGHT)).sound_speed
    assert light**2 >= 99 * LAPLACE


# rate of the oscillation of a round drop of that area with two waves around it, a tension of 1 [1/s]
TURNING = math.sqrt(6 / 1001 / (1 / math.pi) ** 1.5)


@pytest.mark.parametrize("gravity", [{}, WEIGHT])
def test_turning_flow_bears_the_laplace_jump(gravity):
    """rho c^2 of a light phase in a closed box is 25 times sigma/R; the dense one is as fast, sound crosses it often."""
    light, dense = physics_of(droplet(**gravity)).sound_speed
    assert light**2 == pytest.approx(25 * LAPLACE)
    assert dense == pytest.approx(min(light, 4 * math.log(100) / (math.pi * 0.25) * 2 * TURNING))
    # a start that has the jump makes no sound
    _, dense = physics_of(droplet(**gravity, **{"start.pressure": LAPLACE})).sound_speed
    assert dense == pytest.approx(10 * 2 * TURNING)


def test_stiffness_of_turning_goes_from_that_of_a_drop_to_that_of_a_bubble_without_a_step():
    """From no gravity to a strong one: a third more of it changes no speed by more than its root, 1.155."""
    pulls = [0.0, *(10.0 ** (k / 8) for k in range(-40, 17))]
    found = [physics_of(droplet(gravity=[0, -g])).sound_speed for g in pulls]
    for one, other in zip(found, found[1:], strict=False):
        for slower, faster in zip(one, other, strict=True):
            assert abs(math.log(faster / slower)) < math.log(1.17)
    # gravity alone: ten times the speed at which a wave of the bubble would cross the box
    light, dense = found[-1]
    rate = math.sqrt(999 / 1001 * 100.0 * 2 / (1 / math.pi) ** 0.5)
    assert dense == pytest.approx(10 * 2 * rate, rel=1e-4)  # a share of 1e-5 of the pressure is tension
    assert 30 < 1000 * dense**2 / light**2 < 300


def test_sound_is_damped_by_the_share_of_the_pressure_that_tension_makes():
    assert physics_of(droplet(**WEIGHT)).choices["acoustic_relaxation"] == pytest.approx(1)
    # the weight over the floor, of 2 m of liquid of which a quarter is gas, as large as the jump, and three times as large
    for weight, share in (1, 0.5), (3, 0.25):
        pulled = physics_of(droplet(gravity=[0, -weight * LAPLACE / (0.75 * 2 * 1000)]))
        assert pulled.choices["acoustic_relaxation"] == pytest.approx(share, rel=1e-3)
    heavy = physics_of(droplet(gravity=[0, -1.0]))
    assert heavy.choices["acoustic_relaxation"] == 0 and not heavy.spec.relaxation
    damped = physics_of(droplet())
    assert damped.spec.relaxation
    # the slower of the two longest waves; its fastest sound is what the step follows
    light, dense = damped.sound_speed
    assert damped.choices["relaxation_time"] == pytest.approx(max(2 / dense, 1 / light) / math.pi)
    assert damped.acoustic == pytest.approx(math.sqrt(2) * max(damped.sound_speed))
    for changes in {"surface_tension": []}, {"start.pressure": 2.0}, {"numerics.formulation": "paper"}:
        assert physics_of(droplet(**changes)).choices["acoustic_relaxation"] == 0


@pytest.mark.parametrize("density", [5.5, 20.0])
def test_a_dense_phase_in_slow_flow_is_stiff_against_the_light_one(density):
    """Ten times at least, as far as it is no faster, where nothing turns fast."""
    case = droplet(**{"phases.liquid.density": density, "surface_tension.0.coefficient": 1e-9, "scales.pressure": 1.0})
    light, dense = physics_of(case).sound_speed
    assert density * dense**2 == pytest.approx(min(10.0, density) * light**2)


def test_low_sound_speed_is_warned_of_with_the_value_needed():
    found = physics_of(droplet(**{"phases.gas.sound_speed": 2.0, **WEIGHT}))
    (line,) = found.warnings
    assert "phases.gas.sound_speed" in line and "at least 6.657 m/s" in line
    # the dense phase sees a thousandth of that stress
    assert not physics_of(droplet(**{"phases.liquid.sound_speed": 2.0})).warnings


def test_formulation_follows_from_the_scene():
    closed = physics_of(droplet())
    assert closed.spec.corrected and closed.spec.volume_constraint and closed.spec.shifting
    assert closed.spec.viscosity == "morris" and not closed.spec.free_surface
    # the same box with a layer of it empty has a free surface
    around = "where(abs(x) > abs(y), abs(x), abs(y)) > 0.5 and y < 0.8"
    half = droplet(**{"fluids.1.shape": {"where": {"condition": around}}})
    assert not physics_of(half).spec.corrected and physics_of(half).spec.free_surface
    assert physics_of(half).spec.viscosity == "isotropic"
    paper = physics_of(droplet(**{"numerics.formulation": "paper"}))
    assert not paper.spec.corrected and paper.spec.tension == "body_force" and paper.spec.paper_star
    assert paper.choices["interface_force"] == 0.08 and paper.choices["smoothing_ratio"] == 1.25


def test_step_limits():
    """0.125 rho h^2/mu of the Morris form with the harmonic mean at the interface; capillary waves of both densities:
    0.25 sqrt(rho h^3/(2 pi sigma)), rho their mean."""
    found = physics_of(droplet())
    h = 1.5 * 2 / 26
    nu = 2 * 0.005 * 0.5 / 0.505 / 1.0
    assert found.step_cap["viscosity"] == pytest.approx(0.125 * h**2 / nu)
    assert found.step_cap["surface tension"] == pytest.approx(0.25 * math.sqrt(500.5 * h**3 / (2 * math.pi)))
    assert physics_of(droplet(**{"numerics.maximum_step": 1e-5})).step_cap["maximum_step"] == 1e-5


def test_period_shorter_than_two_list_radii_is_refused():
    with pytest.raises(CaseError, match="domain.boundary"):
        physics_of(case_of(PERIODIC).replace({"numerics.smoothing_ratio": 4.0, "numerics.skin": 1.0}))


def test_walls_of_a_layered_tank_carry_its_weight():
    """Two fluids, 1000:1, at rest: the force on the walls is the weight of both, and no side force is left."""
    case = Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": 0.05,
            "end_time": 1e-4,
            "precision": "float64",
            "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
            "gravity": [0, -9.81],
            "phases": {"water": {"density": 1000.0}, "air": {"density": 1.0, "gamma": 1.4}},
            "fluids": [
                {"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}},
                {"phase": "air", "shape": "rest"},
            ],
            "start": {"pressure": "hydrostatic"},
            "numerics": {"unlock": 0},
        }
    )
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    force = model.wall_forces()
    weight = 9.81 * 500.5
    assert force["wall_force_y domain"] == pytest.approx(-weight, rel=0.03)  # kernel sums on a lattice, h = 1.5 dx
    assert abs(force["wall_force_x domain"]) < 1e-9 * weight


def test_sound_speed_bears_what_a_body_force_builds_up():
    """Where a body or walls stand in its way the pressure differs by rho f L; along an open channel it does not."""
    scene = {
        "dimension": 2,
        "particle_spacing": 0.05,
        "end_time": 1.0,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
        "phases": {"water": {"density": 1000, "viscosity": 1000}},
        "body_force": [2.0, 0.0],
        "fluids": [{"phase": "water", "shape": "rest"}],
        "scales": {"velocity": 1e-6},
    }
    cylinder = {"cylinder": {"shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.2}}}}
    walls = {**scene["domain"], "boundary": {"x": "wall", "y": "periodic"}}
    needed = math.sqrt(2.0 * 1.0 / 0.01)
    assert physics_of(Case.from_dict({**scene, "bodies": cylinder})).sound_speed[0] == pytest.approx(needed, rel=1e-6)
    assert physics_of(Case.from_dict({**scene, "domain": walls})).sound_speed[0] == pytest.approx(needed, rel=1e-6)
    assert physics_of(Case.from_dict(scene)).sound_speed[0] < 0.1 * needed


@pytest.mark.parametrize("gas_gamma", [1.0, 1.4])
def test_fluids_that_fill_a_domain_have_their_density_where_they_meet(gas_gamma):
    """A bubble below 1.5 m of water is no denser than the case says, and the pressure is that of the start all the same."""
    case = Case.from_dict({
        "dimension": 2, "particle_spacing": 1 / 16, "end_time": 1.0, "gravity": [0, -0.98],
        "output": {"particles": "none", "checkpoint": "none"},
        "domain": {"lower": [0, 0], "upper": [1, 2], "boundary": {"x": "free_slip", "y": "wall"}},
        "phases": {"water": {"density": 1000, "viscosity": 10},
                   "gas": {"density": 100, "viscosity": 1, "gamma": gas_gamma, "background_pressure": 10.0}},
        "fluids": [{"phase": "gas", "shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.25}}},
                   {"phase": "water", "shape": "rest"}],
        "start": {"pressure": "980*(2 - y)"}, "scales": {"velocity": 0.25},
    })  # fmt: skip
    model = Model(case, threads=1)
    model.stepper.prepare(True)
    fluid = model.snapshot().fluid
    position, density = np.asarray(fluid.position, float), np.asarray(fluid.density, float)
    meeting = abs(np.hypot(position[:, 0] - 0.5, position[:, 1] - 0.5) - 0.25) < 2 / 16
    for number, given in enumerate((1000.0, 100.0)):
        assert density[meeting & (np.asarray(fluid.phase) == number)].mean() == pytest.approx(given, rel=5e-4)
    background = np.where(np.asarray(fluid.phase) == 1, 10.0, 0.0)
    expected = 980 * (2 - position[:, 1]) + background
    assert np.abs(np.asarray(fluid.pressure, float) - expected).max() < 2.0


@pytest.mark.parametrize("height", [0.5, 0.53, 0.5625, 0.625, 0.6875])
def test_the_pressure_at_which_two_layers_have_their_density_is_that_of_their_interface(height):
    """Wherever the interface lies among the cells in which fluids are looked for."""
    case = Case.from_dict({
        "dimension": 2, "particle_spacing": 1 / 16, "end_time": 1.0, "gravity": [0, -1.0],
        "domain": {"lower": [0, 0], "upper": [1, 1.5], "boundary": {"x": "periodic", "y": "free_slip"}},
        "phases": {"light": {"density": 1.0, "viscosity": 0.1}, "heavy": {"density": 1.8, "viscosity": 0.1}},
        "fluids": [{"phase": "light", "shape": {"box": {"lower": [0, 0], "upper": [1, height]}}},
                   {"phase": "heavy", "shape": "rest"}],
        "start": {"pressure": "hydrostatic"}, "scales": {"velocity": 1.0},
    })  # fmt: skip
    nominal = Model(case, threads=1).nominal_pressure
    assert nominal == pytest.approx(1.8 * (1.5 - height), abs=1.8 * 2 / 16)
    assert abs(nominal[0] - nominal[1]) < 1.8 * 4 / 16


def test_one_fluid_and_one_with_a_surface_have_their_density_without_pressure():
    case = Case.from_dict({
        "dimension": 2, "particle_spacing": 1 / 16, "end_time": 1.0, "gravity": [0, -1.0],
        "domain": {"lower": [0, 0], "upper": [1, 1.5], "boundary": {"x": "periodic", "y": "free_slip"}},
        "phases": {"light": {"density": 1.0, "viscosity": 0.1}, "heavy": {"density": 1.8, "viscosity": 0.1}},
        "fluids": [{"phase": "heavy", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}},
                   {"phase": "light", "shape": {"box": {"lower": [0, 0.5], "upper": [1, 1]}}}],
        "start": {"pressure": "hydrostatic"}, "scales": {"velocity": 1.0},
    })  # fmt: skip
    assert not Model(case, threads=1).nominal_pressure.any()


@pytest.mark.parametrize(("sides", "share"), [("wall", 100.0), ("periodic", 0.0)])
def test_sound_is_fast_enough_for_the_corners_of_a_lid(sides: str, share: float) -> None:
    """Where a side slides into a corner friction makes a pressure of mu U/h there: c^2 = 100 mu U/(rho h)."""
    case = load_case(CASES / "creeping_cavity.yaml").replace({"domain.boundary.x": sides})
    physics = derive(case, build(case, support_radius(case)))
    lid = 1.0 - np.exp(-40.0 * 0.6)
    corner = share * 10.0 * lid / physics.h
    assert physics.sound_speed[0] ** 2 == pytest.approx(max(corner, 100.0 * 10.0 * 1.0), rel=1e-6)
