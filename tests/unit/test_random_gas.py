"""Random scenes of compressible gas (scripts/random_gas.py)."""

import importlib.util
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "random_gas.py"


@pytest.fixture(scope="module")
def random_gas():
    """scripts/random_gas.py"""
    spec = importlib.util.spec_from_file_location("random_gas", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_random_scene_lives_within_its_walls(random_gas):
    """A wave of density, 300 to 1, that falls on a floor: 126 of its particles went through, with mirrors alone."""
    found = random_gas.judge(22, 300)
    assert found["stopped"] == "" and found["steps"] == 300 and found["beyond"] == 0


def test_a_seed_is_a_scene(random_gas):
    """The same one each time, and another one for another seed."""
    assert random_gas.scene(3) == random_gas.scene(3)
    assert random_gas.scene(3) != random_gas.scene(4)
