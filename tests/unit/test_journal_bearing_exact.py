"""The series of scripts/journal_bearing_exact.py against what is known exactly of Stokes flow between cylinders."""

import numpy as np
import pytest

from tests.scripts import load_script

exact = load_script("journal_bearing_exact")
RING = np.exp(2j * np.pi * (np.arange(97) + 0.3) / 97)


@pytest.mark.parametrize("offset", [0.0, 0.25, 0.4])
def test_the_fluid_sticks_to_both_cylinders(offset):
    bearing = exact.Bearing(offset=offset)
    assert np.abs(bearing.velocity(offset + 0.5 * RING) - 0.5j * RING).max() < 1e-8
    assert np.abs(bearing.velocity(RING)).max() < 1e-8


def test_concentric_cylinders_have_the_flow_of_couette():
    bearing = exact.Bearing(offset=0.0)
    for r in (0.6, 0.75, 0.9):
        speed = (1 / r - r) / 3  # omega a^2/(b^2 - a^2) (b^2/r - r)
        assert np.abs(bearing.velocity(r * RING) - 1j * speed * RING).max() < 1e-9
    force, torque = bearing.load(0.5, 0.0)
    assert abs(force) < 1e-9
    assert torque == pytest.approx(-4 * np.pi / 3, rel=1e-9)


def test_what_acts_on_one_cylinder_acts_back_on_the_other():
    bearing = exact.Bearing()
    force, torque = bearing.load(0.5, 0.25)
    through, moment = bearing.load(1.0, 0.0)
    assert through == pytest.approx(force, abs=1e-8)
    assert moment == pytest.approx(torque + 0.25 * force.imag, abs=1e-8)


def test_the_stress_is_that_of_the_velocity():
    """On a circle between both the friction along it, from differences of the velocity, makes the moment."""
    bearing, r, step = exact.Bearing(), 0.6, 1e-4

    def along(radius):
        return (np.conj(RING) * bearing.velocity(0.25 + radius * RING)).imag

    def across(angle):
        turned = RING * np.exp(1j * angle)
        return (np.conj(turned) * bearing.velocity(0.25 + r * turned)).real

    slope = (along(r + step) - along(r - step)) / (2 * step) - along(r) / r + (across(step) - across(-step)) / (2 * step * r)
    assert slope.mean() * 2 * np.pi * r**2 == pytest.approx(bearing.load(r, 0.25)[1], rel=1e-6)


@pytest.mark.parametrize(
    ("name", "options", "key"),
    [
        ("journal_bearing_exact", ["--profile", "nowhere/profile.csv"], "--profile nowhere/profile.csv"),
        ("cavity_reference", ["--folder", "nowhere", "--creeping"], "--folder nowhere"),
    ],
)
def test_a_missing_folder_is_named_before_anything_is_computed(name, options, key, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [name, *options])
    with pytest.raises(SystemExit) as ended:
        load_script(name).main()
    assert ended.value.code == 2
    assert key in capsys.readouterr().err
