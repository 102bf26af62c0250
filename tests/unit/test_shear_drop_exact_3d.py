"""The boundary integrals of scripts/shear_drop_exact_3d.py against what is known exactly of drops in Stokes flow."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from warpsph.case.case import Case

ROOT = Path(__file__).parents[2]
loaded = importlib.util.spec_from_file_location("shear_drop_exact_3d", ROOT / "scripts" / "shear_drop_exact_3d.py")
exact = importlib.util.module_from_spec(loaded)
sys.modules[loaded.name] = exact  # its dataclasses look themselves up there
loaded.loader.exec_module(exact)
SPHERE = exact.Sphere(10)
ONE = SPHERE.series(np.ones(len(SPHERE.weight)))
AXES = np.array([1.3, 1.0, 0.8])
TURN = np.array([[np.cos(0.4), -np.sin(0.4), 0], [np.sin(0.4), np.cos(0.4), 0], [0, 0, 1]])  # from +x to +y


def ellipsoid(way):
    """The ellipsoid of `AXES`, turned about the z axis: by its matrix alone, or by the series alone."""
    matrix = TURN @ np.diag(AXES) @ TURN.T
    if way == "matrix":
        return exact.Interface(SPHERE, matrix, ONE)
    s = np.sqrt(np.sum((np.linalg.inv(matrix) @ SPHERE.frame[:, 0]) ** 2, axis=0))
    return exact.Interface(SPHERE, np.eye(3), SPHERE.series(s))


def curvature_of_an_ellipsoid(place):
    """h^3 (a^2 + b^2 + c^2 - x^2)/(a b c)^2 with h the distance from the centre to the tangent plane; (p,) at (p, 3)."""
    height = np.sum(place**2 / AXES**4, axis=1) ** -0.5
    return height**3 * (np.sum(AXES**2) - np.sum(place**2, axis=1)) / np.prod(AXES) ** 2


@pytest.mark.parametrize("way", ["matrix", "series"])
def test_an_ellipsoid_has_its_volume_curvature_and_axes(way):
    surface = ellipsoid(way)
    assert surface.volume == pytest.approx(4 * np.pi / 3 * np.prod(AXES), rel=1e-6)
    np.testing.assert_allclose(surface.curvature, curvature_of_an_ellipsoid((TURN.T @ surface.position).T), rtol=2e-3)
    assert surface.shape() == pytest.approx((0.5 / 2.1, np.degrees(0.4)), rel=1e-5)
    assert surface.radii() == pytest.approx((0.3 / 2.3, np.degrees(0.4)), rel=1e-4)


def test_the_ellipsoid_of_a_drop_is_that_of_the_gauge():
    """The second moments of small cubes that fill the drop, as `warpsph.measure.drop_gauges.ellipsoid` takes them."""
    from warpsph.measure.drop_gauges import ellipsoid as of_particles

    bent = ONE.copy()
    bent[(SPHERE.n == 4) & (SPHERE.m == 2)] += 0.1 - 0.05j
    bent[(SPHERE.n == 2) & (SPHERE.m == 2)] += 0.1j
    surface = exact.Interface(SPHERE, np.diag(AXES), bent)
    cells = (np.indices((48, 48, 48)).reshape(3, -1) + 0.5) / 16 - 1.5
    inside = surface.inverse @ cells
    values = exact.harmonics(10, *exact.polar_angles(inside))[0]
    cells = cells[:, (values @ bent).real * np.linalg.norm(inside, axis=0) < 1].T
    found = of_particles(cells, np.full(len(cells), 16.0**-3))
    deformation, angle = surface.shape()
    assert deformation == pytest.approx(found.deformation, rel=1e-2)  # the cubes are off by that
    assert angle == pytest.approx(np.degrees(np.arctan2(*found.directions[0, 1::-1])), abs=0.2)


def test_the_flow_of_the_tension_is_that_of_a_plain_sum_over_a_fine_grid():
    """With the exact curvature of an ellipsoid, and nothing of the coordinates about each node."""
    surface = ellipsoid("matrix")
    velocity = exact.Drop(3.0, shear=0.0).velocity(surface)
    nodes, weights = np.polynomial.legendre.leggauss(160)
    azimuth = 2 * np.pi * (np.arange(320) + 0.3) / 320
    angles = np.repeat(np.arccos(nodes), 320), np.tile(azimuth, 160)
    out = exact.frame(*angles)[:, 0].T
    own, area = out * AXES, out / AXES * np.prod(AXES)
    area *= np.repeat(weights, 320)[:, None] * (np.pi / 160)
    curvature = curvature_of_an_ellipsoid(own)
    for node in (0, 45, 100):
        offset = own - TURN.T @ surface.position[:, node]
        distance = np.linalg.norm(offset, axis=1)[:, None]
        force = area * (curvature - surface.curvature[node])[:, None]
        flow = np.sum(force / distance + offset * np.sum(offset * force, axis=1)[:, None] / distance**3, axis=0)
        np.testing.assert_allclose(velocity[:, node], TURN @ flow * (-3.0 / 8 / np.pi), atol=2e-3 * np.abs(velocity).max())


def test_a_sphere_at_rest_stays_at_rest():
    assert np.abs(exact.Drop(10.0, shear=0.0).velocity(exact.Interface(SPHERE, np.eye(3), ONE))).max() < 1e-12


@pytest.mark.parametrize(("n", "m"), [(2, 0), (2, 2), (4, 2), (6, 4), (10, 0)])
def test_a_harmonic_on_a_sphere_falls_at_its_rate(n, m):
    """To first order in its amplitude: 40 (l + 1)/((2 l + 3)(19 l + 16)) for n = 2 and a ratio l of viscosities, here 1."""
    amplitude = 1e-6 * (1 + (0.3j if m else 0))
    series = ONE + amplitude * ((SPHERE.n == n) & (SPHERE.m == m))
    rate = exact.Drop(3.0, shear=0.0).motion(exact.Interface(SPHERE, np.eye(3), series))[0]
    assert exact.relaxation(2) == pytest.approx(40 * 2 / (5 * 35))
    np.testing.assert_allclose(rate, -3.0 * exact.relaxation(n) * (series - ONE), atol=5e-5 * abs(amplitude))


def test_a_drop_without_tension_is_sheared_with_the_fluid():
    """At a strain of 1 the axes of the ellipsoid are the golden ratio and its inverse."""
    *_, (t, surface, _) = exact.Drop(0.0).run(6, 1.0)
    assert t == pytest.approx(1.0)
    assert surface.shape() == pytest.approx((5**-0.5, np.degrees(np.arctan2(2, 1)) / 2), rel=1e-6)
    assert surface.radii()[0] == pytest.approx(5**-0.5, rel=1e-6)


def test_a_barely_deformed_drop_is_that_of_theory():
    """D goes to 35/32 Ca (Taylor 1934, Cox 1969) with the square of Ca, the angle to 45 degrees - 35/32 Ca in radians.

    For a harmonic of n = 2 that falls at a rate 16/35/Ca while the vorticity turns it lags by 35/16 Ca/2.
    """
    off = []
    for capillary in (0.02, 0.04):
        *_, (_, surface, _) = exact.Drop(1 / capillary).run(6, 1.05)
        deformation, angle = surface.shape()
        off.append(deformation / exact.cox(capillary)[0] - 1)
        assert angle == pytest.approx(45 - np.degrees(35 / 32 * capillary), abs=20 * capillary**2)
        assert surface.radii()[0] == pytest.approx(deformation, rel=capillary**2)
    assert abs(off[0]) < 5e-4 and off[1] == pytest.approx(4 * off[0], rel=0.1)


def test_the_volume_stays_and_a_higher_degree_gives_the_same(monkeypatch):
    volumes, shapes = [], []
    spread = exact.Interface.spread

    def noted(surface, volume):
        volumes.append(surface.volume / volume)
        return spread(surface, volume)

    monkeypatch.setattr(exact.Interface, "spread", noted)
    for degree in (6, 8):
        *_, (_, surface, _) = exact.Drop(5.0).run(degree, 0.5)
        shapes.append(surface.shape())
    np.testing.assert_allclose(volumes, 1, atol=1e-6)
    assert shapes[0] == pytest.approx(shapes[1], rel=1e-4)


def test_the_script_writes_its_table_and_curves(tmp_path, capsys, monkeypatch):
    table, curves = tmp_path / "table.json", tmp_path / "curves.csv"
    arguments = ["--capillary", "0.1", "0.2", "--degree", "4", "--end-time", "0.1"]
    monkeypatch.setattr(sys, "argv", ["x", *arguments, "--json", str(table), "--curve", str(curves)])
    exact.main()
    assert len(capsys.readouterr().out.splitlines()) == 4
    assert [row["capillary"] for row in json.loads(table.read_text())] == [0.1, 0.2]
    lines = curves.read_text().splitlines()
    assert lines[0].split(",")[:3] == ["G_t", "D_Ca0.1", "angle_Ca0.1"] and lines[1] == "0,0,45,0,45" and len(lines) == 4


@pytest.mark.parametrize(
    "arguments",
    [
        ["--capillary", "0"],
        ["--capillary", "nan"],
        ["--degree", "7"],
        ["--degree", "2"],
        ["--end-time", "0"],
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


def table_of(name):
    return np.genfromtxt(ROOT / "cases" / "reference" / name, delimiter=",", names=True, deletechars="")


def test_the_tables_of_the_references_are_what_the_script_makes():
    curves = table_of("i_drop_shear_3D_stokes_transient.csv")
    *_, (t, surface, _) = exact.Drop(1 / 0.3).run(8, 1.0)
    row = curves[np.isclose(curves["G_t"], t)][0]
    assert surface.shape() == pytest.approx((row["D_Ca0.3"], row["angle_Ca0.3"]), rel=1e-4)
    steady = table_of("i_drop_shear_3D_stokes.csv")
    *_, (t, surface, _) = exact.Drop(20.0).run(6, 10.0)
    row = steady[steady["Ca"] == 0.05][0]
    assert surface.shape() == pytest.approx((row["D_second_moments"], row["orientation_deg"]), rel=1e-4)
    assert surface.radii() == pytest.approx((row["D_radii"], row["orientation_radii_deg"]), rel=1e-4)
    assert t == pytest.approx(row["t_end_G"])


def test_the_case_compares_with_the_table_at_its_end():
    from warpsph.study.validation import runs_of

    curves = table_of("i_drop_shear_3D_stokes_transient.csv")
    found = 0
    for run in runs_of(Case.load(ROOT / "cases" / "shear_drop_3d.yaml"), "shear_drop_3d"):
        case = run.case
        if "deformation" not in case.reference:
            continue
        capillary = 10 / case.surface_tension[0].coefficient  # the viscosity is 10
        row = curves[np.isclose(curves["G_t"], case.end_time)][0]
        assert case.reference["deformation"].value == pytest.approx(row[f"D_Ca{capillary:.3g}"], abs=1e-5)
        assert case.reference["angle"].column.endswith(f" - {row[f'angle_Ca{capillary:.3g}']:.2f}")
        found += 1
    assert found == 10
