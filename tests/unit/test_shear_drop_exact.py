"""The boundary integrals of scripts/shear_drop_exact.py against what is known exactly of drops in Stokes flow."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

PATH = Path(__file__).parents[2] / "scripts" / "shear_drop_exact.py"
loaded = importlib.util.spec_from_file_location("shear_drop_exact", PATH)
exact = importlib.util.module_from_spec(loaded)
sys.modules[loaded.name] = exact  # its dataclasses look themselves up there
loaded.loader.exec_module(exact)
PLANE = exact.Channel(200.0, 400.0)  # as good as without walls: they make 7e-5 at 100 R
ANGLE = 2 * np.pi * np.arange(64) / 64
CIRCLE = np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_a_circle_at_rest_stays_at_rest(ratio):
    drop = exact.Drop(ratio, 10.0, shear=0.0)
    assert np.abs(drop.velocity(exact.Interface(CIRCLE))).max() < 1e-12


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("mode", [2, 3, 5])
def test_a_wave_on_a_circle_falls_at_its_rate(ratio, mode):
    """r = 1 + e cos(m theta) falls at the rate m tension/(2 (1 + ratio)), to first order in e."""
    amplitude = 1e-5
    curve = exact.Interface(CIRCLE * (1 + amplitude * np.cos(mode * ANGLE))[:, None])
    normal = np.sum(exact.Drop(ratio, 3.0, PLANE, shear=0.0).velocity(curve) * curve.normal, axis=1)
    rate = -2 * np.mean(normal * np.cos(mode * ANGLE)) / amplitude
    assert rate == pytest.approx(3.0 * mode / 2 / (1 + ratio), rel=2e-4)


@pytest.mark.parametrize("ratio", [0.1, 10.0])
@pytest.mark.parametrize("aspect", [1.5, 3.0])
def test_an_ellipse_without_tension_is_strained_evenly(ratio, aspect):
    """Bilby and Kolbuszewski 1977: along its axes at (a + b)^2/(a^2 + b^2 + 2 ratio a b) times the rate of the matrix."""
    ellipse = CIRCLE * [aspect**0.5, aspect**-0.5]
    turn = np.array([[1, 1], [-1, 1]]) / 2**0.5  # from 45 degrees, where shear strains along the axes at 1/2
    velocity = exact.Drop(ratio, 0.0, PLANE).velocity(exact.Interface(ellipse @ turn)) @ turn.T
    gradient = np.linalg.lstsq(ellipse, velocity, rcond=None)[0].T
    np.testing.assert_allclose(ellipse @ gradient.T, velocity, atol=2e-5)
    strain = (1 + aspect) ** 2 / (1 + aspect**2 + 2 * ratio * aspect) / 2
    np.testing.assert_allclose(gradient, [[strain, 0.5], [-0.5, -strain]], atol=1e-4)


def test_an_ellipse_next_to_rigid_turns_as_jeffery_has_it():
    """With the long axis along the flow it turns at -b^2/(a^2 + b^2) times the shear rate (Jeffery 1922, in 2-D)."""
    ellipse = CIRCLE * [2**0.5, 0.5**0.5]
    velocity = exact.Drop(1e6, 0.0, PLANE).velocity(exact.Interface(ellipse))
    np.testing.assert_allclose(velocity, 0.2 * ellipse[:, ::-1] * [1, -1], atol=5e-5)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_a_small_deformation_without_walls_is_that_of_theory(ratio):
    drop = exact.Drop(ratio, 100.0, PLANE)
    *_, (_, curve, _) = drop.run(32, 2.0)
    deformation, angle = exact.unbounded(ratio, 0.01)
    assert curve.shape()[0] == pytest.approx(deformation, rel=2e-3)
    assert curve.shape()[1] == pytest.approx(angle, abs=0.05)
    assert curve.area == pytest.approx(np.pi, rel=1e-12)


def test_the_flow_of_a_point_force_is_reciprocal_and_0_at_the_walls():
    """G_ij from x to y is G_ji from y to x, as for any no-slip walls (Lorentz)."""
    channel = exact.Channel(2.0, 5.0)
    curve = exact.Interface(0.5 * CIRCLE + [0.2, 0.4])

    def flow(source, target):
        """Return G_ij (force, velocity) between two points."""
        one = object.__new__(exact.Interface)
        one.position, one.normal = source[None], np.array([[1.0, 0.0]])
        free = exact.stokeslets(one, target[None], channel.period)
        walls = exact.stokeslets(one, channel.walls, channel.period)
        answers = (free.flow(f[None]) - channel.inner_flow(target[None], walls.flow(f[None])) for f in np.eye(2))
        return np.stack([answer[:, 0] for answer in answers])

    x, y = curve.position[3], curve.position[40]
    np.testing.assert_allclose(flow(x, y), flow(y, x).T, atol=1e-12)
    np.testing.assert_allclose(flow(x, np.array([1.3, 2.0])), 0, atol=1e-9)


def test_twice_the_points_give_the_same_between_walls():
    shapes = []
    for points in (32, 64):
        *_, (_, curve, _) = exact.Drop(0.1, 5.0).run(points, 1.0)
        shapes.append(curve.shape())
    assert shapes[0] == pytest.approx(shapes[1], rel=1e-4)


def test_the_script_writes_its_table_and_curves(tmp_path, capsys, monkeypatch):
    table, curves = tmp_path / "table.json", tmp_path / "curves.csv"
    arguments = ["--viscosity", "1", "--capillary", "0.1", "0.2", "--points", "32", "--end-time", "0.1"]
    monkeypatch.setattr(sys, "argv", ["x", *arguments, "--json", str(table), "--curve", str(curves)])
    exact.main()
    assert len(capsys.readouterr().out.splitlines()) == 4
    assert [row["capillary"] for row in json.loads(table.read_text())] == [0.1, 0.2]
    lines = curves.read_text().splitlines()
    assert lines[0].split(",")[:3] == ["t", "D_lambda1_Ca0.1", "angle_lambda1_Ca0.1"] and len(lines) == 4


@pytest.mark.parametrize(
    "arguments",
    [
        ["--viscosity", "-1"],
        ["--capillary", "0"],
        ["--capillary", "nan"],
        ["--points", "31"],
        ["--half-height", "1"],
        ["--period", "2"],
        ["--end-time", "-1"],
        ["--json", "missing/table.json"],
    ],
)
def test_what_has_no_meaning_is_refused_before_anything_runs(arguments, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["x", *arguments])
    with pytest.raises(SystemExit) as ended:
        exact.main()
    told = capsys.readouterr()
    assert ended.value.code == 2 and arguments[1] in told.err and not told.out


def test_the_table_of_the_references_is_what_the_script_makes():
    table = np.genfromtxt(PATH.parents[1] / "cases" / "reference" / "i_drop_shear_2D_stokes.csv", delimiter=",", names=True)
    for row in table[(table["Ca"] == 0.1) & (table["lambda"] <= 1)]:
        *_, (_, curve, _) = exact.Drop(row["lambda"], 1 / row["Ca"]).run(32, 10.0)
        assert curve.shape()[0] == pytest.approx(row["D_second_moments"], rel=1e-3)
        assert curve.shape()[1] == pytest.approx(row["orientation_deg"], abs=0.05)
