"""The budget gauge: what it adds up is what momentum and energy do, and each term is what its name says."""

import numpy as np
import pytest

from tests.scenes import PERIODIC
from warpsph import Simulation
from warpsph.case.budget_terms import KICKS, MOVING, TERMS
from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.kernels.delta import budget_sums

GAUGES = ("energy", "momentum", "budget")
BOX = {
    **PERIODIC,
    "precision": "float64",
    "particle_spacing": 1 / 16,
    "end_time": 0.1,
    "phases": {"water": {"density": 1.0, "viscosity": 0.01, "sound_speed": 10, "gamma": 1}},
    "start": {"velocity": ["-cos(2*pi*x)*sin(2*pi*y)", "sin(2*pi*x)*cos(2*pi*y)"], "noise": 0.2},
    "numerics": {"scheme": "delta_plus"},
    "output": {"particles": "none", "checkpoint": "none"},
    "gauges": {name: {"type": name, "interval": 0.01} for name in GAUGES},
}
RELAXED = {**BOX, "numerics": {"scheme": "delta_plus", "acoustic_relaxation": 1}}
DAM = {
    **BOX,
    "particle_spacing": 1 / 12,
    "end_time": 0.3,
    "domain": {"lower": [0, 0], "upper": [2, 1.5], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}},
    "gravity": [0, -9.81],
    "phases": {"water": {"density": 1000, "viscosity": 0.5}},
    "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 1]}}}],
    "start": {"pressure": "hydrostatic"},
    "gauges": {**BOX["gauges"], "load": {"type": "wall_force", "interval": 0.01}},
}
HILL = {"hill": {"shape": {"polygon": {"points": [[1.2, -0.3], [1.4, 0.2], [1.9, -0.3]]}}}}


def tense(**numerics):
    """Return the box with pressures below zero all over, which act by their differences alone."""
    start = {**BOX["start"], "pressure": "-2 + 0.1*cos(2*pi*x)"}
    return {**BOX, "start": start, "numerics": {"scheme": "delta_plus", "tension_control": True, **numerics}}


def run_of(case, **changes):
    return Simulation(Case.from_dict({**case, **changes}), device="cpu", threads=1).run()


def misses(run):
    """Return by how much the budget misses energy, and momentum: largest difference over the largest change of a term."""
    found, energy, momentum = (run.gauge(name) for name in ("budget", "energy", "momentum"))
    held = energy["kinetic"] + energy["elastic"]
    scale = max(np.abs(found[f"work {term}"]).max() for term in TERMS)
    result = [np.abs(held - held[0] - found["work total"]).max() / scale]
    for axis in "xy":
        moved = momentum[f"momentum_{axis}"]
        scale = max(momentum["scale"].max(), *(np.abs(found[f"impulse_{axis} {term}"]).max() for term in MOVING))
        result.append(np.abs(moved - moved[0] - found[f"impulse_{axis} total"]).max() / scale)
    return np.array(result)


@pytest.fixture(scope="module")
def dam():
    return run_of(DAM)


@pytest.mark.parametrize(
    "case",
    [BOX, tense(), RELAXED, {**DAM, "precision": "float32"}, {**DAM, "bodies": HILL, "end_time": 0.2}],
    ids=["box", "tension", "relaxation", "dam", "hill"],
)
def test_the_budget_closes(case):
    """Energy within a millionth, but for the time step; momentum within rounding."""
    energy, *momentum = misses(run_of(case))
    assert energy < 1e-6
    assert max(momentum) < (1e-12 if case["precision"] == "float64" else 1e-6)


DRUM = {  # full of water that slides around a core
    **{key: value for key, value in BOX.items() if key not in ("fluids", "start")},
    "particle_spacing": 0.02,
    "domain": {"lower": [-0.6, -0.6], "upper": [0.6, 0.6], "boundary": {"x": "open", "y": "open"}},
    "phases": {"water": {"density": 1000, "viscosity": 0}},
    "fluids": [{"phase": "water", "shape": {"where": {"condition": "x**2 + y**2 < 0.25 and x**2 + y**2 > 0.04"}}}],
    "bodies": {
        "drum": {"shape": {"sphere": {"center": [0, 0], "radius": 0.5}}, "hollow": True},
        "core": {"shape": {"sphere": {"center": [0, 0], "radius": 0.2}}},
    },
    "start": {"velocity": ["-2*pi*y", "2*pi*x"]},
    "end_time": 0.05,
}


@pytest.mark.parametrize("case", [{**DAM, "bodies": HILL, "end_time": 0.2}, DRUM], ids=["free surface", "full"])
def test_nothing_is_left_beside_bodies(case):
    """Before water splashes `spray`, what the parts leave of the rate, is next to nothing: walls are those of the sweep."""
    found = run_of(case).gauge("budget")
    assert np.abs(found["work spray"]).max() < 1e-3 * np.abs(found["work wall_pressure"]).max()


def test_the_error_falls_with_the_time_step():
    """The work of a change of the density is that of the pressure in its middle: of second order."""
    runs = [run_of({**BOX, "numerics": {"scheme": "delta_plus", "courant": c}}) for c in (0.4, 0.2)]
    coarse, fine = (misses(run)[0] for run in runs)
    # steps are even up to each time of the gauge, so that their number is not quite doubled
    few, many = (run.summary["steps"] for run in runs)
    assert many > 1.5 * few
    assert fine < (few / many) ** 1.5 * coarse


def test_terms_of_a_full_box():
    """Pairs exchange momentum; friction and diffusion take energy; what was not asked for has nothing."""
    found = run_of(BOX, start={**BOX["start"], "noise": 0.1}).gauge("budget")  # so even that it has no gap
    for axis in "xy":
        for term in ("pressure", "viscosity"):
            assert np.abs(found[f"force_{axis} {term}"]).max() < 1e-12
    assert (np.diff(found["work viscosity"]) < 0).all() and found["work density_diffusion"][-1] < 0
    for term in ("tension_control", "artificial_viscosity", "wall_pressure", "contact", "gravity", "body_force", "lift"):
        assert not found[f"work {term}"].any()
    quiet = {"shifting": 0, "density_diffusion": 0, "exact_divergence": False, "volume_constraint": False}
    found = run_of({**BOX, "numerics": {"scheme": "delta_plus", **quiet}}).gauge("budget")
    for term in ("shift", "density_diffusion", "exact_divergence", "volume_constraint"):
        assert np.abs(found[f"work {term}"]).max() < 1e-15


def test_friction_of_vortices():
    """Power of the viscosity of the start: -2 nu k^2 of the kinetic energy, k^2 = 8 pi^2, within that of 16 spacings."""
    run = run_of({**BOX, "start": {"velocity": BOX["start"]["velocity"]}, "end_time": 0.01})
    exact = -2 * 0.01 * 8 * np.pi**2 * run.gauge("energy")["kinetic"][0]
    assert run.gauge("budget")["power viscosity"][0] == pytest.approx(exact, rel=0.1)


def test_momentum_is_lost_in_tension():
    """Where pressures below zero act by their differences, pairs exchange no momentum: the gauge has what is lost."""
    found = run_of(tense()).gauge("budget")
    assert np.abs(found["force_x tension_control"]).max() > 1e-3
    assert np.abs(found["force_x pressure"]).max() < 1e-12


def test_walls_and_weight(dam):
    found, load, energy = (dam.gauge(name) for name in ("budget", "load", "energy"))
    for axis in "xy":
        on_walls = found[f"force_{axis} wall_pressure"] + found[f"force_{axis} wall_friction"]
        np.testing.assert_allclose(on_walls, -load[f"force_{axis}"], rtol=1e-9, atol=1e-9 * np.abs(on_walls).max())
    weight = 9.81 * (dam.state.fluid.density * dam.state.fluid.volume).sum()
    np.testing.assert_allclose(found["force_y gravity"], -weight, rtol=1e-6)
    np.testing.assert_allclose(found["impulse_y gravity"], -weight * found["time"], rtol=1e-6)
    fallen = energy["potential"] - energy["potential"][0]
    np.testing.assert_allclose(fallen, found["work lift"] - found["work gravity"], atol=1e-4 * np.abs(fallen).max())
    assert found["work artificial_viscosity"][-1] < 0


def test_a_body_force_drives():
    case = {**BOX, "body_force": [0.5, 0.0], "start": {"velocity": [1.0, 0.0]}}
    found = run_of(case).gauge("budget")
    np.testing.assert_allclose(found["force_x body_force"], 0.5, rtol=1e-9)  # of a mass of 1 kg/m
    np.testing.assert_allclose(found["power body_force"], 0.5 * (1 + 0.5 * found["time"]), rtol=1e-6)
    np.testing.assert_allclose(found["work body_force"], 0.5 * found["time"] + 0.125 * found["time"] ** 2, rtol=1e-6)


def test_a_run_goes_its_way_whether_or_not_it_is_watched(dam):
    other = run_of(DAM, gauges={"load": DAM["gauges"]["load"]})
    np.testing.assert_array_equal(other.state.position, dam.state.position)
    np.testing.assert_array_equal(other.state.velocity, dam.state.velocity)


def test_the_terms_of_the_case_are_those_of_the_device():
    assert budget_sums.TERMS == TERMS and budget_sums.KICKS == KICKS


def test_a_restart_goes_on_adding(tmp_path):
    case = Case.from_dict({**DAM, "end_time": 0.1, "output": {"particles": "none", "checkpoint": {"interval": 0.05}}})
    whole = Simulation(case, output=tmp_path / "whole", device="cpu", threads=1).run()
    point = sorted((tmp_path / "whole" / "checkpoint").glob("*.h5"))[0]
    rest = Simulation(case, output=tmp_path / "rest", device="cpu", threads=1, restart=point).run()
    for column in ("work total", "impulse_x shift", "power wall_pressure"):
        assert rest.gauge("budget")[column][-1] == whole.gauge("budget")[column][-1]


@pytest.mark.parametrize(
    "numerics, told",
    [({"scheme": "riemann"}, "delta_plus"), ({"scheme": "delta_plus", "integrator": "rk4"}, "leapfrog")],
)
def test_what_has_no_budget_says_so(numerics, told):
    with pytest.raises(CaseError, match=told):
        Case.from_dict({**BOX, "numerics": numerics})
