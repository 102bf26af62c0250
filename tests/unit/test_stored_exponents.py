"""The command `ftle`: exponents between stored frames, against exact flows."""

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.drifting import VORTICES, case_of, exponent, vortices
from tests.helpers import lattice
from warpsph import Simulation
from warpsph.cli import app
from warpsph.errors import CaseError
from warpsph.files.vtp import read_vtp
from warpsph.study.stored_exponents import exponents, nearest, write_exponents


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_linear_way_has_its_stretching(dimension):
    """x = diag(2, 1/2, 1) X over 1 s: ln 2 both ways, on an uneven cloud up to its rim."""
    place = lattice([9] * dimension, 0.1, jitter=0.2)
    strain = np.array([2.0, 0.5, 1.0])[:dimension]
    none = np.zeros(dimension)
    forward = exponents(place, place * strain - place, 1.0, 0.3, none)
    np.testing.assert_allclose(forward, np.log(2.0), rtol=1e-9)
    now = place * strain
    np.testing.assert_allclose(exponents(now, place - now, 1.0, 0.6, none), np.log(2.0), rtol=1e-9)


def test_neighbours_across_periodic_sides_count():
    """A periodic shear, largest at the sides of the box, where half of the neighbours are beyond."""
    place = lattice([20, 20], 0.05, centre=False)
    way = np.stack([np.zeros(400), 0.1 * np.sin(2 * np.pi * place[:, 0])], axis=1)
    box = np.array([1.0, 1.0])
    found = exponents(place, way, 1.0, 0.125, box).reshape(20, 20)
    np.testing.assert_allclose(found, np.roll(found, 10, axis=0), atol=1e-9)  # half a period on: the other sign
    shear = 0.2 * np.pi
    np.testing.assert_allclose(found[[0, -1]].max(), np.log(shear / 2 + np.sqrt(shear**2 / 4 + 1)), rtol=0.05)
    assert nearest(np.array([[0.9, -0.2]]), box).tolist() == [[pytest.approx(-0.1), pytest.approx(-0.2)]]


def test_particles_in_a_line_have_none():
    place = np.stack([np.arange(9) * 0.1, np.zeros(9)], axis=1)
    assert not exponents(place, place, 1.0, 0.3, np.zeros(2)).any()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of vortices with frames every 0.05 s."""
    folder = tmp_path_factory.mktemp("vortices") / "run"
    changes = {"output": {"particles": {"interval": 0.05}}, "numerics": {"scheme": "isph"}, "particle_spacing": 1 / 24}
    Simulation(case_of(VORTICES, **changes), output=folder, threads=1).run()
    return folder


def test_exponents_of_a_run(run):
    """Against the exact flow map over a spacing, from files: both directions, a file and a picture each."""
    done = CliRunner().invoke(app, ["ftle", str(run), "--from", "0.05", "--to", "0.25"])
    assert done.exit_code == 0, done.output
    assert sorted(path.name for path in (run / "ftle").iterdir()) == [
        "backward.png", "backward.vtp", "forward.png", "forward.vtp",
    ]  # fmt: skip
    for direction, here, there in (("backward", 0.25, 0.05), ("forward", 0.05, 0.25)):
        found = read_vtp(run / "ftle" / f"{direction}.vtp", 2)
        assert found.time == pytest.approx(here) and len(found) == 24 * 24
        np.testing.assert_allclose(found.ftle_age, 0.2)
        exact = exponent(vortices, found.position, here, there, 1 / 24)
        assert np.corrcoef(getattr(found, f"ftle_{direction}"), exact)[0, 1] > 0.95


def test_what_came_in_since_is_left_out(run, tmp_path):
    """Particles that the earlier frame does not have."""
    frame = run / "particles" / "fluid_000001.vtp"
    kept = frame.read_bytes()
    try:
        from warpsph.files.vtp import write_vtp

        early = read_vtp(frame, 2)
        write_vtp(frame, early.select(np.arange(100, len(early))))
        paths = write_exponents(run, 0.05, 0.25, output=tmp_path, pictures=False)
    finally:
        frame.write_bytes(kept)
    assert [path.name for path in paths] == ["backward.vtp", "forward.vtp"]
    for path in paths:
        assert sorted(read_vtp(path, 2).particle_id.tolist()) == list(range(100, 576))


@pytest.mark.parametrize(("start", "end"), [(0.1, 0.1), (0.2, 0.1), (0.0, 9.0)])
def test_times_that_are_no_two_frames_are_refused(run, tmp_path, start, end):
    with pytest.raises(CaseError, match="the run has .*frames from 0 to 0.25 s"):
        write_exponents(run, start, end, output=tmp_path)


def test_a_folder_that_cannot_be_made(run, tmp_path):
    """A file is in its place: a message and nothing else, as of all commands."""
    (tmp_path / "taken").write_text("")
    done = CliRunner().invoke(app, ["ftle", str(run), "--output", str(tmp_path / "taken")])
    assert done.exit_code == 4 and "cannot be written" in done.stderr and "unexpected" not in done.stderr
