"""What can go wrong with projection ISPH: told before the run, or reported after it; no hang, no crash."""

import copy

import numpy as np
import pytest

from tests.isph_scenes import DROP, TANK, rows, start
from tests.scenes import case_of
from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.errors import CaseError, DivergenceError
from warpsph.running.preview import describe

# A closed box, full to the lid: no free surface, the pressure is known but for a constant.
CLOSED = {
    **TANK,
    "title": "closed",
    "domain": {"lower": [0, 0], "upper": [0.9, 0.8], "boundary": {"x": "wall", "y": "wall"}},
    "fluids": [{"phase": "water", "shape": "rest"}],
}
TWO = {
    "phases": {"water": {"density": 1000.0, "viscosity": 0.001}, "oil": {"density": 900}},
    "fluids": [
        {"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.9, 0.4]}}},
        {"phase": "oil", "shape": {"box": {"lower": [0, 0.4], "upper": [0.9, 0.8]}}},
    ],
}


def problems(scene):
    """Return key -> problem of a scene that must be refused."""
    with pytest.raises(CaseError) as caught:
        Case.from_dict(copy.deepcopy(scene))
    return {problem.path: problem for problem in caught.value.problems}


# refused before the run -------------------------------------------------------------------------------------------------

REFUSED = {
    "two phases": ({**TWO}, "numerics.scheme", "isph", "one phase, the case has 2", "scheme: riemann"),
    "surface tension": (
        {**TWO, "surface_tension": [{"between": ["water", "oil"], "coefficient": 0.1}]},
        "surface_tension",
        "",
        "scheme: isph",
        "delete it",
    ),
    "wall force": (
        {"gauges": {"load": {"type": "wall_force", "interval": 0.1}}},
        "gauges.load.type",
        "wall_force",
        "bodies alone",
        "points",
    ),
    "volume constraint": (
        {**CLOSED, "numerics": {"scheme": "isph", "volume_constraint": True}},
        "numerics.volume_constraint",
        "true",
        "riemann",
        "delete",
    ),
    "tolerance": (
        {"precision": "float32", "numerics": {"scheme": "isph", "tolerance": 1e-11}},
        "numerics.tolerance",
        "1e-11",
        "float32",
        "float64",
    ),
    "tolerance in double": (
        {"numerics": {"scheme": "isph", "tolerance": 1e-13}},
        "numerics.tolerance",
        "1e-13",
        "float64",
        "1e-12",
    ),
    "inconsistent walls": (
        {
            **CLOSED,
            "domain": {
                "lower": [0, 0],
                "upper": [0.9, 0.8],
                "boundary": {"x": "wall", "y": {"lower": "wall", "upper": {"wall": "no_slip", "velocity": [0, -1]}}},
            },
        },
        "domain.boundary.y.upper.velocity",
        "",
        "out of its plane",
        "slide",
    ),
    "key of the other scheme": (
        {"numerics": {"scheme": "isph", "interface_force": 0.1}}, "numerics.interface_force", "0.1", "riemann", "delete",
    ),
    "key of this scheme": (
        {"numerics": {"scheme": "riemann", "time_order": 1}}, "numerics.time_order", "1", "isph", "delete",
    ),
    "time order": ({"numerics": {"scheme": "isph", "time_order": 3}}, "numerics.time_order", "3", "", ""),
    "solver": ({"numerics": {"scheme": "isph", "solver": "gauss"}}, "numerics.solver", "gauss", "", "cg"),
    "unknown scheme": ({"numerics": {"scheme": "sph"}}, "numerics.scheme", "sph", "", "riemann"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_a_remedy(name):
    """Key, value, rule and remedy of each."""
    changes, key, value, rule, remedy = REFUSED[name]
    found = problems({**TANK, **changes})
    assert key in found, list(found)
    text = str(found[key])
    assert text.startswith(key) and value in text and rule in text and remedy in text


@pytest.mark.parametrize(
    "precision, tolerance", [("float32", 1e-10), ("float64", 1e-12)], ids=["float32", "float64"]
)
def test_the_tightest_tolerance_is_accepted(precision, tolerance, device):
    simulation = start(TANK, device=device, precision=precision, numerics__tolerance=tolerance).run()
    assert simulation.summary["status"] == "finished"
    assert simulation.summary["solver"]["worst_residual"] <= tolerance or simulation.summary["warnings"]


def test_a_sound_speed_has_no_meaning():
    told = describe(case_of(TANK, phases__water__sound_speed=50.0))["warnings"]
    assert any("phases.water.sound_speed" in line and "isph" in line for line in told)
    assert not any("sound_speed" in line for line in describe(case_of(TANK))["warnings"])


def test_show_says_what_a_step_does_and_what_not():
    found = describe(case_of(TANK))
    stages = [stage["name"] for stage in found["stages"]]
    begin = ["advect", "list", "predict", "surface_friction", "surface", "fragments"]
    assert stages == [*begin, "assemble", "solve", "accept", "correct", "regularise", "smooth_velocity", "advance"]
    found = describe(case_of(CLOSED, numerics__formulation="paper"))
    assert "settle" in [stage["name"] for stage in found["stages"]]
    assert "surface, fragments" in [row["name"] for row in found["absent"]]


# solver -----------------------------------------------------------------------------------------------------------------


def test_a_solver_that_does_not_converge_is_reported(device, tmp_path):
    """The run goes on, and says at its end how often, how far off, and what to do."""
    case = case_of(TANK, numerics__maximum_iterations=1, numerics__preconditioner="none", output=dict(TANK["output"]))
    simulation = Simulation(case, output=tmp_path / "run", device=device, threads=1).run()
    solver = simulation.summary["solver"]
    assert solver["failures"] == solver["solves"] >= simulation.model.steps > 1
    assert solver["worst_residual"] > 1e-6 and solver["worst_iterations"] == 1
    told = [line for line in simulation.summary["warnings"] if "numerics.tolerance" in line]
    assert len(told) == 1 and "numerics.maximum_iterations" in told[0] and str(solver["failures"]) in told[0]
    assert "numerics.maximum_iterations" in (tmp_path / "run" / "log.txt").read_text()
    # nothing is said where nothing is wrong
    fine = start(TANK, device=device).run().summary
    assert fine["solver"]["failures"] == 0 and not fine["warnings"]
    assert fine["solver"]["worst_residual"] <= 1e-6


@pytest.mark.parametrize("solver", ["cg", "bicgstab"])
def test_solvers_and_preconditioners_agree(solver, device):
    """A splash in the corner of a tank by all combinations."""
    scene = {**TANK, "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.4, 0.8]}}}]}
    states = [
        start(
            scene, device=device, numerics__solver=solver, numerics__preconditioner=preconditioner, numerics__tolerance=1e-11
        )
        .run()
        .state
        for preconditioner in ("multigrid", "jacobi", "none")
    ]
    assert np.abs(states[0].velocity).max() > 0.3
    for state in states[1:]:
        np.testing.assert_allclose(state.position, states[0].position, atol=1e-8)
        np.testing.assert_allclose(state.pressure, states[0].pressure, atol=1e-5 * np.abs(states[0].pressure).max())


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_closed_box_without_a_surface(precision, device):
    """The system is singular: the pressure has zero mean, is hydrostatic, and the fluid stays at rest."""
    simulation = start(CLOSED, device=device, precision=precision, start__noise=0.1)
    simulation.run()
    state = simulation.state
    assert simulation.summary["solver"]["failures"] == 0
    height = state.position[:, 1]
    # the top and bottom rows are half a spacing off the walls, whatever the noise
    expected = 1000.0 * 9.81 * (height.mean() - height)
    scale = 1000.0 * 9.81 * 0.8
    assert abs(state.pressure.mean()) < 1e-4 * scale
    assert np.abs(state.pressure - expected).max() < 1e-3 * scale
    assert np.linalg.norm(state.velocity, axis=1).max() < 1e-4 * np.sqrt(9.81 * 0.8)
    assert not simulation.physics.spec.free_surface


def test_a_box_that_is_not_full_and_has_no_surface(device):
    """One site is empty, in the middle: too small a hole for a surface, so that nothing holds the pressure."""
    boxes = [([0, 0], [0.9, 0.4]), ([0, 0.4], [0.4, 0.5]), ([0.5, 0.4], [0.9, 0.5]), ([0, 0.5], [0.9, 0.8])]
    fluids = [{"phase": "water", "shape": {"box": {"lower": lower, "upper": upper}}} for lower, upper in boxes]
    simulation = start({**CLOSED, "fluids": fluids}, device=device, numerics__maximum_step=1e-3, end_time=0.01)
    assert simulation.physics.spec.free_surface
    simulation.run()
    assert not simulation.model.particles.get("surface").any()
    solver = simulation.summary["solver"]
    assert solver["failures"] == 0 and solver["solves"] > 5 and solver["worst_iterations"] <= 10


# runs that go wrong -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", ["nan", "runaway"])
def test_a_state_that_goes_wrong_stops_the_run(bad, device):
    """The particle is named, the run does not hang."""
    simulation = start(DROP, device=device, numerics__maximum_step=0.01)
    particles = simulation.model.particles
    velocity = particles.get("velocity")
    row = 20
    velocity[row] = {"nan": np.nan, "runaway": 1e6}[bad]
    identity = int(particles.get("particle_id")[row])
    particles.put("velocity", velocity)
    with pytest.raises(DivergenceError, match=f"particle {identity} ") as caught:
        simulation.run()
    assert caught.value.particle == identity
    assert simulation.summary["status"] == "diverged"
    text = str(caught.value)
    assert "numerics.maximum_iterations" in text and "sound" not in text, "causes are those of a scheme without sound"


def test_a_pile_of_particles_at_one_place(device):
    """Two particles at one point: finite numbers, and the run ends."""
    simulation = start(DROP, device=device, numerics__maximum_step=0.01)
    particles = simulation.model.particles
    for name in ("anchor", "position"):
        x = particles.get(name)
        x[21] = x[20]
        particles.put(name, x)
    simulation.model.stepper.prepare(fresh=True)
    simulation.run()
    state = simulation.state
    assert np.isfinite(state.position).all() and np.isfinite(state.pressure).all()
    assert np.linalg.norm(state.velocity, axis=1).max() < 2.0


def test_a_narrow_slit(device):
    """Two particles between walls, fewer than a support: images of images are not made, the run ends all the same."""
    scene = {
        **TANK,
        "domain": {"lower": [0, 0], "upper": [0.2, 0.8], "boundary": TANK["domain"]["boundary"]},
        "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [0.2, 0.5]}}}],
    }
    simulation = start(scene, device=device).run()
    state = simulation.state
    assert state.position[:, 0].min() > 0 and state.position[:, 0].max() < 0.2
    assert np.isfinite(state.pressure).all() and np.linalg.norm(state.velocity, axis=1).max() < np.sqrt(2 * 9.81 * 0.5)


def test_a_body_in_a_tank(device):
    """Its particles bear the fluid beside and above, in balance with the weight: all is at rest."""
    scene = {
        **TANK,
        "bodies": {"block": {"shape": {"box": {"lower": [0.3, 0.0], "upper": [0.6, 0.3]}}, "wall": "no_slip"}},
        "fluids": [{"phase": "water", "shape": {"where": {"condition": "y < 0.8 and (y > 0.3 or x < 0.3 or x > 0.6)"}}}],
    }
    simulation = start(scene, device=device, end_time=0.3).run()
    state = simulation.state
    fluid = state.kind == 0
    x = state.position[fluid]
    inside = (np.abs(x[:, 0] - 0.45) < 0.12) & (x[:, 1] < 0.27)
    assert not inside.any() and (~fluid).sum() == 9
    assert np.linalg.norm(state.velocity[fluid], axis=1).max() < 1e-4 * np.sqrt(9.81 * 0.8)
    assert (rows(simulation, "surface")[x[:, 1] < 0.6] == 0).all()


def test_a_key_of_an_older_name_is_told_its_new_one():
    with pytest.raises(CaseError, match="surface_filter: 1 -> is called velocity_filter now; write velocity_filter"):
        Case.from_dict({"numerics": {"scheme": "isph", "surface_filter": 1}})
