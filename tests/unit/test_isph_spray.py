"""Drops of few particles that burst on a floor (theory: isph#b6)."""

import importlib.util
from pathlib import Path

import pytest

loaded = importlib.util.spec_from_file_location("random_scenes", Path(__file__).parents[2] / "scripts/random_scenes.py")
random_scenes = importlib.util.module_from_spec(loaded)
loaded.loader.exec_module(random_scenes)


@pytest.mark.parametrize("seed", [1203, 1317])
def test_no_energy_comes_from_shifts_of_spray(seed):
    """Particles with neighbours to one side: grad u dx without a bound doubled their speed within a few steps."""
    row = random_scenes.run(seed, 2000, "cpu", 1)
    assert not row["fault"]
    assert all(entry["ok"] for entry in row["criteria"].values()), row["criteria"]
