"""What `check` foretells of a run."""

from pathlib import Path

import pytest

from warpsph.case.case_file import load_case
from warpsph.running.preview import describe, estimate

CASES = Path(__file__).parents[2] / "cases"
NARROW = ["domain.lower=[-4, -5]", "domain.upper=[10, 5]", "particle_spacing=1/8", "phases.water.sound_speed=15"]


@pytest.mark.parametrize(
    ("changes", "frequency"),
    [
        ([], 15 / 20),  # half a wave fits between walls 10 apart
        (["domain.boundary.y=periodic"], 15 / 10),  # a whole one in a period
        (["numerics.scheme=riemann", "phases.water.sound_speed=30"], 30 / 20),
    ],
)
def test_the_lowest_sound_across_a_stream(changes, frequency):
    case = load_case(CASES / "cylinder_periodic.yaml", overrides=[*NARROW, *changes])
    assert estimate(case)["sound_across"] == pytest.approx(frequency)


@pytest.mark.parametrize(
    ("name", "changes"), [("taylor_green", []), ("backward_step", ["numerics.scheme=isph", "particle_spacing=1/5"])]
)
def test_nothing_sounds_without_a_stream_or_without_sound(name, changes):
    assert estimate(load_case(CASES / f"{name}.yaml", overrides=changes))["sound_across"] is None


@pytest.mark.parametrize(
    ("changes", "came_to"),
    [([], "hydrostatic"), (["gravity=[0, 0]"], "none"), (["start.pressure=none"], ""), (["numerics.scheme=isph"], "none")],
)
def test_what_an_automatic_start_pressure_came_to_is_told(changes, came_to):
    tank = {
        "dimension": 2,
        "particle_spacing": 0.1,
        "end_time": 1,
        "gravity": [0, -9.81],
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "phases": {"water": {"density": 1000, "viscosity": 0.01, "sound_speed": 20}},
        "fluids": [{"phase": "water", "shape": "rest"}],
    }
    case = load_case(tank, overrides=changes)
    assert estimate(case)["start_pressure"] == came_to
    assert describe(case)["resolved"]["start"]["pressure"] == (came_to or "none")


@pytest.mark.parametrize(("scheme", "least"), [("riemann", 1e-4), ("isph", 1e-3)])
def test_a_step_of_a_few_particles_takes_the_time_of_its_stages(scheme, least):
    """36 particles in a tank take 0.26 (Riemann) and 3 ms (ISPH) a step on a core; by particles alone it was 0.07 ms."""
    tank = {
        "dimension": 2,
        "particle_spacing": 1 / 6,
        "end_time": 1,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wall", "y": "wall"}},
        "gravity": [0, -1],
        "phases": {"water": {"density": 1000, "viscosity": 0.1}},
        "fluids": [{"phase": "water", "shape": "rest"}],
        "numerics": {"scheme": scheme},
    }
    found = estimate(tank)
    assert least < found["seconds"] / found["steps"] < 10 * least


def test_a_step_takes_the_time_of_its_pairs():
    """A particle has 113 neighbours within three spacings, in a plane 28: measured 0.67 and 2.7 million a second (speed)."""

    def rate(dimension: int, count: int) -> float:
        sides = dict.fromkeys("xyz"[:dimension], "periodic")
        box = {
            "dimension": dimension,
            "particle_spacing": 1 / count,
            "end_time": 1,
            "domain": {"lower": [0] * dimension, "upper": [1] * dimension, "boundary": sides},
            "phases": {"water": {"density": 1, "viscosity": 0.01}},
            "fluids": [{"phase": "water", "shape": "rest"}],
        }
        found = estimate(box)
        return float(found["particles"] * found["steps"] / found["seconds"] / 1e6)

    assert rate(2, 200) == pytest.approx(2.0, rel=0.1)
    assert rate(3, 34) == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize(
    ("changes", "microseconds"),
    [([], 2.9), (["numerics.riemann_solver=acoustic"], 1.84), (["numerics.dissipation=artificial"], 0.9)],
)
def test_a_step_of_a_gas_takes_the_time_of_its_riemann_problems(changes, microseconds):
    """Measured with 64 x 64 particles, a particle and step, on a core that others shared (4.3, 2.8 and 1.35, over 1.5).

    It was guessed at 0.4, so that a run of 27 s was expected to take 0.7 s.
    """
    found = estimate(load_case(CASES / "kelvin_helmholtz_gas.yaml", overrides=changes))
    assert 1e6 * found["seconds"] / found["steps"] / found["particles"] == pytest.approx(microseconds, rel=0.3)


def test_steps_are_longer_once_the_sound_of_the_start_has_died():
    """Taylor-Green 50 relaxes to 0.59 s of 2: between the steps of the faster sound throughout and of none."""
    changes = ["numerics.acoustic_relaxation=0", "numerics.relaxation_end=auto", "numerics.relaxation_end=none"]
    without, now, throughout = (
        estimate(load_case(CASES / "taylor_green.yaml", overrides=[change]))["steps"] for change in changes
    )
    share = (now - without) / (throughout - without)
    assert share == pytest.approx(0.59 / 2, abs=0.01)
