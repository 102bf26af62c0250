"""The solver of scripts/stream_reference.py against exact maps, solutions of Poisson's equation, limits and balances."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

PATH = Path(__file__).parents[2] / "scripts" / "stream_reference.py"
REFERENCE = PATH.parents[1] / "cases" / "reference"
loaded = importlib.util.spec_from_file_location("stream_reference", PATH)
stream = importlib.util.module_from_spec(loaded)
sys.modules[loaded.name] = stream  # its dataclasses look themselves up there
loaded.loader.exec_module(stream)
WALL = np.array([0.0])


@pytest.fixture(scope="module")
def airfoil():
    return stream.Airfoil()


def test_the_map_takes_the_circle_to_the_airfoil(airfoil):
    z = airfoil(WALL, 1000)[0][0]
    assert np.abs(np.abs(z.imag) - stream.naca0012(z.real)).max() < 1e-8
    assert z.real.min() < 1e-5 and z.real.max() > 1 - 1e-4
    table = np.genfromtxt(REFERENCE / "k_naca0012_coordinates_closed_TE.csv", delimiter=",", names=True)
    # the corner is that of the trailing edge: what is left of it would make the series go on
    assert np.abs(airfoil.coefficients[1000:]).max() < 1e-10
    upper = z[:500][::-1]
    # the first stations are on the nose, which stands upright: there the points of the map make a polygon
    ordinate = np.interp(table["x_upper_over_c"], upper.real, upper.imag)[5:-1]
    np.testing.assert_allclose(ordinate, table["y_upper_over_c"][5:-1], atol=1e-5)


def test_the_map_is_conformal_and_becomes_a_scale_far_away(airfoil):
    gap = 1e-5
    z, slope = airfoil(np.array([0.3 - gap, 0.3, 0.3 + gap]), 64)
    np.testing.assert_allclose((z[2] - z[0]) / (2 * gap), slope[1], atol=1e-8)
    along = np.fft.ifft(1j * np.fft.fftfreq(64, 1 / 64) * np.fft.fft(airfoil(np.array([1.0]), 64)[0][0]))
    np.testing.assert_allclose(along, 1j * airfoil(np.array([1.0]), 64)[1][0], atol=1e-8)
    far, slope = airfoil(np.array([8.0]), 16)
    np.testing.assert_allclose(slope, airfoil.scale * np.exp(8 + 1j * stream.angles(16))[None], rtol=1e-4)


def poisson_error(body, count):
    """Return the largest errors of a stream function with two modes that is 0 at the wall, and of its slope there over 9.

    The first decays as it does without vorticity from the outer ring on, which is near.
    """
    grid = stream.Grid(body, count, count, 6.0)
    xi, theta = grid.xi[:, None], grid.theta
    psi = (np.exp(-xi) - np.exp(-10 * xi)) * np.sin(theta) + xi**2 * np.exp(-10 * xi) * np.cos(3 * theta)
    # minus the sum of the second derivatives of both terms
    vorticity = 99 * np.exp(-10 * xi) * np.sin(theta) - (91 * xi**2 - 40 * xi + 2) * np.exp(-10 * xi) * np.cos(3 * theta)
    solver = stream.Poisson(grid)
    vorticity = vorticity / grid.jacobian
    return np.abs(solver.solve(vorticity) - psi).max(), np.abs(solver.slope(vorticity) / 9 - np.sin(theta)).max()


def test_the_stream_function_and_its_slope_at_the_wall_are_of_second_order(airfoil):
    for body in (stream.Cylinder(), airfoil):
        coarse, fine = np.array(poisson_error(body, 48)), np.array(poisson_error(body, 96))
        assert (fine < [2e-3, 1e-2]).all()
        assert np.all((coarse / fine > 3.5) & (coarse / fine < 4.5))


def test_periodic_and_other_tridiagonal_systems_are_solved():
    rng = np.random.default_rng(1)
    diagonal, beside, right = 3 + rng.random((7, 4)), -rng.random(4), rng.random((7, 4))
    answer = stream.Rings(diagonal, beside).solve(right)
    both = np.roll(answer, 1, axis=0) + np.roll(answer, -1, axis=0)
    np.testing.assert_allclose(diagonal * answer + beside * both, right, atol=1e-13)
    lower, upper = rng.random((2, 7, 4))
    answer = stream.Lines(lower, diagonal, upper).solve(right)
    product = diagonal * answer
    product[1:] += lower[1:] * answer[:-1]
    product[:-1] += upper[:-1] * answer[1:]
    np.testing.assert_allclose(product, right, atol=1e-13)


def started(body, reynolds, angle, size, step, end_time, outer=12.0):
    """Return the flow and its forces."""
    flow = stream.Flow(stream.Grid(body, *size, outer), reynolds, np.radians(angle))
    return flow, list(flow.run(step, end_time))


def test_a_start_at_once_has_the_drag_of_the_layer_half_of_it_friction():
    """Cd = 4 sqrt(2 pi/(Re T)), T = 2 t, to leading order."""
    _, forces = started(stream.Cylinder(), 1000.0, 0.0, (192, 64), 2e-3, 0.05)
    for force in forces:
        if force.time > 0.02:
            layer = 4 * np.sqrt(2 * np.pi / (1000 * 2 * force.time))
            assert force.total.real == pytest.approx(layer, rel=0.03)
            assert force.friction.real == pytest.approx(layer / 2, rel=0.03)
            assert abs(force.total.imag) < 1e-9


@pytest.mark.parametrize(("name", "reynolds", "angle", "size"), [("cylinder", 100, 0, 40), ("naca0012", 1000, 8, 40)])
def test_the_force_at_the_wall_becomes_the_rate_of_the_impulse(name, reynolds, angle, size):
    """What both differ by falls by 4 with half the spacing and step; the total circulation stays 0."""
    differences = []
    for part in (1, 2):
        step = 5e-3 / part
        flow, forces = started(stream.BODIES[name](), float(reynolds), angle, (part * size, 2 * part * size), step, 0.5)
        before = flow.impulse()
        flow.step(step)
        force = (forces[-1].total + flow.force().total) / 2
        differences.append(abs((flow.impulse() - before) / step - force) / abs(force))
        assert abs(flow.grid.integral(flow.vorticity)) < 1e-10
    assert 3 < differences[0] / differences[1] < 5.5
    assert differences[1] < 0.02


def test_the_wall_is_at_rest():
    flow, _ = started(stream.Cylinder(), 100.0, 0.0, (64, 64), 5e-3, 0.2)
    np.testing.assert_allclose(flow.poisson.slope(flow.vorticity), flow.wanted, atol=1e-12)
    gap = flow.grid.xi[1]
    # next to the wall psi is -J omega xi^2/2, that of the balance of its half cell
    wall = -flow.grid.jacobian[0] * flow.vorticity[0] * gap**2 / 2
    np.testing.assert_allclose(flow.stream[1], wall, atol=1e-3 * np.abs(wall).max())


def test_the_drag_converges_at_second_order():
    """Grids and steps of a ratio 2: the differences of the drag fall by 4."""
    drag = []
    for count in (32, 64, 128):
        _, forces = started(stream.Cylinder(), 40.0, 0.0, (count, count), 0.64 / count, 0.6)
        drag.append(np.interp(0.5, [force.time for force in forces], [force.total.real for force in forces]))
    first, second = np.diff(drag)
    assert 3 < first / second < 5.5
    assert abs(second) < 0.01 * drag[-1]


def test_a_turned_stream_makes_a_turned_flow(airfoil):
    """Along the lines of the grid of a cylinder exactly; the airfoil seen from below has the opposite lift."""
    straight = started(stream.Cylinder(), 100.0, 0.0, (32, 48), 5e-3, 0.1)[1][-1]
    turned = started(stream.Cylinder(), 100.0, 30.0, (32, 48), 5e-3, 0.1)[1][-1]
    assert turned.total == pytest.approx(straight.total, abs=1e-9)
    up, down = (started(airfoil, 1000.0, angle, (32, 64), 5e-3, 0.1)[1][-1] for angle in (5, -5))
    assert up.total == pytest.approx(down.total.conjugate(), abs=1e-9)
    assert up.total.imag > 0.1


def test_shedding_is_measured_on_a_known_wave():
    time = np.arange(0, 40, 0.01)
    series = np.column_stack([time, *[np.full_like(time, 1.3), 0.1 + 0.33 * np.sin(2 * np.pi * 0.165 * time)], *[time] * 4])
    amplitude, frequency = stream.shedding(series, 30.0)
    assert amplitude == pytest.approx(0.33, rel=1e-4) and frequency == pytest.approx(0.165, rel=1e-4)
    assert np.isnan(stream.shedding(series, 8.0)[1])
    assert stream.means(series, 10.0)[1] == pytest.approx(1.3)


def test_the_series_of_the_airfoil_in_the_references_is_that_of_a_coarser_grid(airfoil):
    table = np.genfromtxt(REFERENCE / "k_naca0012_Re1000_stream_function.csv", delimiter=",", names=True)
    row = table[(table["alpha_deg"] == 8) & np.isclose(table["t_U_over_c"], 0.5)][0]
    force = started(airfoil, 1000.0, 8.0, (80, 160), 2.5e-3, 0.5)[1][-1]
    assert force.pressure == pytest.approx(row["Cd_pressure"] + 1j * row["Cl_pressure"], rel=0.03)
    assert force.friction == pytest.approx(row["Cd_friction"] + 1j * row["Cl_friction"], rel=0.03)


def test_the_steady_drag_of_a_cylinder_and_its_wake_are_among_those_of_the_papers():
    """Re = 40; beyond what the papers differ by, 2 % for a coarse grid at t = 20."""
    path = REFERENCE / "j_cylinder_steady_periodic_table.csv"
    table = np.genfromtxt(path, delimiter=",", names=True, usecols=(0, 2, 6))
    papers = table[table["Re"] == 40]
    drag, length = papers["Cd_mean"], papers["wake_length_over_D"]
    flow, forces = started(stream.Cylinder(), 40.0, 0.0, (48, 64), 1 / 64, 20.0, outer=40.0)
    assert 0.98 * np.nanmin(drag) < forces[-1].total.real < 1.02 * np.nanmax(drag)
    assert 0.98 * np.nanmin(length) < flow.wake_length() < 1.02 * np.nanmax(length)


def test_the_script_writes_its_table_and_series(tmp_path, capsys):
    path = tmp_path / "series.csv"
    size = ["--radial", "32", "--around", "32", "--end-time", "0.3", "--csv", str(path)]
    assert stream.main(["naca0012", "--angle", "0", "4", *size]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 4
    table = np.genfromtxt(path, delimiter=",", names=True)
    np.testing.assert_allclose(table["t_U_over_c"], [0.1, 0.2, 0.3] * 2)
    np.testing.assert_allclose(table["Cl"], table["Cl_pressure"] + table["Cl_friction"], atol=1e-5)
    assert (table["Cl"][:3] < 1e-6).all() and (table["Cl"][3:] > 0.05).all()


def test_the_drag_of_a_start_is_that_of_a_grid_that_follows_the_layer():
    """Re = 1000, T = 0.4 to 1, against Basilisk (D/455): within 3 %, as fine rings differ from it by up to 2.6 %."""
    name = "j_cylinder_Cd_Re1000_Basilisk_level13.csv"
    time, _, pressure, friction = np.genfromtxt(REFERENCE / name, delimiter=",", skip_header=1).T
    own = np.array([force.row for force in started(stream.Cylinder(), 1000.0, 0.0, (96, 128), 0.5 / 128, 0.5)[1]])
    seen = (time >= 0.4) & (time <= 1)
    for column, reference in ((3, pressure), (4, friction)):
        np.testing.assert_allclose(np.interp(time[seen] / 2, own[:, 0], own[:, column]), reference[seen], rtol=0.03)


def test_what_ended_is_kept_where_a_later_run_fails(tmp_path, capsys, monkeypatch):
    path = tmp_path / "series.csv"
    size = ["--radial", "32", "--around", "32", "--end-time", "0.2", "--csv", str(path)]
    run = stream.Flow.run
    for fault, code in ((ArithmeticError("the flow blew up"), 1), (KeyboardInterrupt(), 130)):

        def fail_at_an_angle(flow, *given, fault=fault):
            if flow.direction.imag:
                raise fault
            return run(flow, *given)

        monkeypatch.setattr(stream.Flow, "run", fail_at_an_angle)
        assert stream.main(["naca0012", "--angle", "0", "4", *size]) == code
        assert len(path.read_text().splitlines()) == 3 and capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["series.csv"]


def test_a_series_that_cannot_be_written_is_said_and_leaves_the_file_of_before(tmp_path, capsys, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    path = tmp_path / "series.csv"
    path.write_text("of before")
    monkeypatch.setattr(Path, "replace", full)  # the disk fills up while it runs
    small = ["--radial", "32", "--around", "32", "--end-time", "0.2", "--csv", str(path)]
    assert stream.main(["cylinder", *small]) == 3
    assert "| 100 | 0 |" in capsys.readouterr().out
    monkeypatch.setattr(Path, "write_text", full)  # or is full
    assert stream.main(["cylinder", *small]) == 3
    told = capsys.readouterr()
    assert "--csv" in told.err and "No space left" in told.err and not told.out
    monkeypatch.undo()
    assert path.read_text() == "of before" and len(list(tmp_path.iterdir())) == 1


def test_a_flow_that_blows_up_is_said_to(capsys):
    arguments = ["cylinder", "--reynolds", "1e4", "--radial", "64", "--around", "64", "--step", "0.2", "--end-time", "40"]
    assert stream.main(arguments) == 1
    assert "--step less than 0.2" in capsys.readouterr().err


def test_a_swirl_behind_an_airfoil_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        stream.main(["naca0012", "--swirl", "1"])
    assert ended.value.code == 2 and "--swirl 1" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["--reynolds", "0"],
        ["--reynolds", "nan"],
        ["--angle", "60"],
        ["--end-time", "-1"],
        ["--window", "11"],
        ["--window", "1e-05"],
        ["--swirl", "inf"],
        ["--radial", "8"],
        ["--around", "33"],
        ["--step", "0"],
        ["--step", "20"],
        ["--outer", "5"],
        ["--interval", "0"],
        ["--csv", "missing/forces.csv"],
        ["--csv", "."],
    ],
)
def test_what_has_no_meaning_is_refused_before_anything_runs(arguments, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        stream.main(["cylinder", *arguments])
    told = capsys.readouterr()
    assert ended.value.code == 2 and " ".join(arguments) in told.err and not told.out
    assert "has to be" in told.err and ";" in told.err
