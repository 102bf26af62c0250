"""Gauges against numbers that follow by hand, and their CSV files through restarts, kills and full disks."""

import errno
import math
import os

import numpy as np
import pytest

from tests.scenes import FULL, case_of
from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.case.columns import wall_bodies
from warpsph.errors import CaseError, OutputError, WarpsphError
from warpsph.measure.gauge import Needs
from warpsph.measure.gauge_files import parse_heading, read_gauge
from warpsph.measure.gauges import GaugeSet
from warpsph.measure.shape_gauges import isolated, outline
from warpsph.measure.totals import Energies, PhaseEos, Pressures
from warpsph.snapshot import FLUID, WALL, Snapshot


def make_case(gauges, dimension=2, **changes) -> Case:
    zeros, ones = [-1.0] * dimension, [1.0] * dimension
    return Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": 0.05,
            "end_time": 1.0,
            "domain": {"lower": zeros, "upper": ones, "boundary": {"x": "wall", "y": "wall"}},
            "phases": {"gas": {"density": 1.0, "gamma": 1.4}, "liquid": {"density": 1000.0}},
            "fluids": [
                {"phase": "gas", "shape": {"sphere": {"center": [0.0] * dimension, "radius": 0.5}}},
                {"phase": "liquid", "shape": "rest"},
            ],
            "gauges": gauges,
            **changes,
        }
    )


def make_snapshot(position, at=0.0, spacing=0.05, **changes) -> Snapshot:
    position = np.asarray(position, float)
    n, dimension = position.shape
    values = dict(
        time=at,
        step=0,
        dt=0.0,
        dimension=dimension,
        position=position,
        velocity=np.zeros((n, dimension)),
        density=np.ones(n),
        pressure=np.zeros(n),
        mass=np.ones(n),
        volume=np.full(n, spacing**dimension),
        phase=np.zeros(n, np.int32),
        particle_id=np.arange(n),
        kind=np.full(n, FLUID, np.uint8),
        particle_spacing=spacing,
    )
    return Snapshot(**{**values, **changes})


def measure(case, snapshot, **options) -> dict[str, float]:
    """The row of the case's only gauge."""
    with GaugeSet(case, **options) as gauges:
        (name,) = gauges.record(snapshot)
        return {column: values[0] for column, values in gauges.series(name).items()}


def lattice(spacing, extent=1.0):
    axis = np.arange(-extent + spacing / 2, extent, spacing)
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


# -- energy ------------------------------------------------------------------------------------------------


def test_energies_of_three_particles():
    case = make_case({"energy": {"type": "energy", "interval": 0.1}}, gravity=[0, -10.0])
    particles = make_snapshot(
        [[0, 1], [0, 2], [5, 0.5], [9, 9]],
        velocity=np.array([[3, 4], [0, 0], [1, 0], [100, 100]], np.float32),
        mass=np.array([2.0, 1.0, 4.0, 50.0]),
        phase=np.array([0, 0, 1, -1], np.int32),
        kind=np.array([FLUID, FLUID, FLUID, WALL], np.uint8),
        density=np.array([1.0, 1.0, 1000.0, 7.0]),
    )
    row = measure(case, particles)
    assert "elastic" not in row  # the sound speeds are auto
    assert row["kinetic"] == pytest.approx(25.0 + 2.0)
    assert row["potential"] == pytest.approx(20 + 20 + 20)
    assert row["total"] == pytest.approx(87.0)
    assert row["kinetic gas"] == pytest.approx(25.0)
    assert row["total gas"] == pytest.approx(65.0)
    assert row["kinetic liquid"] == pytest.approx(2.0)
    assert row["total liquid"] == pytest.approx(22.0)
    eos = {"gas": PhaseEos(1.0, 10.0, 1.4), "liquid": PhaseEos(1000.0, 10.0, 7.0)}
    still = measure(case, particles, eos=eos)
    assert still["elastic"] == 0.0
    particles.density[0] = 1.1
    pressed = measure(case, particles, eos=eos)
    assert pressed["elastic"] == pytest.approx(2.0 * float(eos["gas"].elastic_energy(np.array([1.1]))[0]))
    assert pressed["total"] == pytest.approx(87.0 + pressed["elastic"])
    assert pressed["total gas"] == pytest.approx(65.0 + pressed["elastic"])


def test_energy_in_a_central_force():
    """m B^2 |x - c|^2/2 beside gravity."""
    force = {"rate": 3.0, "center": [1.0, 0.0]}
    case = make_case({"energy": {"type": "energy", "interval": 0.1}}, gravity=[0, -10.0], central_force=force)
    row = measure(case, make_snapshot([[0, 1], [3, 4]], mass=np.array([2.0, 1.0])))
    assert row["potential"] == pytest.approx(2 * (10 * 1 + 4.5 * 2) + (10 * 4 + 4.5 * 20))


@pytest.mark.parametrize("gamma", [1.0, 1.4, 7.0])
@pytest.mark.parametrize("background", [0.0, 5.0])
@pytest.mark.parametrize("end", [0.5, 0.97, 1.02, 1.5])
def test_elastic_energy_is_the_integral_of_pressure(gamma, background, end):
    density, speed = 3.0, 20.0
    eos = PhaseEos(density, speed, gamma, background)
    stiffness = density * speed**2 / gamma
    rho = np.linspace(density, end * density, 20001)
    pressure = stiffness * ((rho / density) ** gamma - 1) + background
    integral = np.trapezoid(pressure / rho**2, rho)
    assert float(eos.elastic_energy(np.array(end * density))) == pytest.approx(integral, rel=1e-7)


def test_elastic_energy_keeps_its_digits_for_tiny_compressions():
    s = 1e-7
    for gamma in (1.0, 1.4, 7.0):
        energy = float(PhaseEos(1.0, 10.0, gamma).elastic_energy(np.float64(1.0 + s)))
        assert energy == pytest.approx(0.5 * 100.0 * s**2, rel=1e-5, abs=0)


def test_energy_takes_the_sound_speeds_of_the_case():
    phases = {"gas": {"density": 2.0, "sound_speed": 10.0, "gamma": 1.4}}
    fluids = [{"phase": "gas", "shape": "rest"}]
    case = make_case({"e": {"type": "energy", "interval": 0.1}}, phases=phases, fluids=fluids)
    row = measure(case, make_snapshot([[0, 0]], density=np.array([2.2])))
    assert row["elastic"] == pytest.approx(float(PhaseEos(2.0, 10.0, 1.4).elastic_energy(np.array(2.2))))
    assert row["total"] == row["elastic"] > 0


# -- surface energy ----------------------------------------------------------------------------------------

SIGMA = 0.3
TENSION = [{"between": ["liquid", "gas"], "coefficient": SIGMA}]
ENERGY = {"energy": {"type": "energy", "interval": 0.1}}


def stirred(spacing, dimension=2, noise=0.3):
    """Places of a disordered lattice in the box from -1 to 1."""
    axes = [np.arange(-1 + spacing / 2, 1, spacing)] * dimension
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dimension)
    return x + np.random.default_rng(1).uniform(-noise, noise, x.shape) * spacing


@pytest.mark.parametrize(
    ("dimension", "spacing", "exact", "error"),
    [(2, 0.05, math.pi, 0.015), (2, 0.02, math.pi, 0.01), (3, 0.1, math.pi, 0.05), (3, 0.05, math.pi, 0.015)],
)
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_surface_energy_of_a_round_drop(dimension, spacing, exact, error, noise):
    """sigma 2 pi R, in 3-D sigma 4 pi R^2, beside gas and walls; a wall particle is no phase."""
    sides = dict.fromkeys("xyz"[:dimension], "wall")
    domain = {"lower": [-1.0] * dimension, "upper": [1.0] * dimension, "boundary": sides}
    case = make_case(ENERGY, dimension, surface_tension=TENSION, particle_spacing=spacing, domain=domain)
    x = stirred(spacing, dimension, noise)
    x = np.concatenate([x, np.full((1, dimension), 1 + spacing / 2)])
    phase = (np.linalg.norm(x, axis=1) > 0.5).astype(np.int32)
    phase[-1] = -1
    kind = np.where(phase < 0, WALL, FLUID).astype(np.uint8)
    row = measure(case, make_snapshot(x, spacing=spacing, phase=phase, kind=kind))
    assert row["surface"] == pytest.approx(SIGMA * exact, rel=error)
    assert row["total"] == row["surface"]
    assert row["total gas"] == row["total liquid"] == 0.0


def test_surface_energy_of_three_phases():
    """Two halves of a disc and what is around them: each pair has its own interface and its own tension."""
    phases = {"a": {"density": 1}, "b": {"density": 1}, "c": {"density": 1}}
    halves = {name: {"where": {"condition": f"x**2 + y**2 < 0.36 and x {sign} 0"}} for name, sign in ("a<", "b>")}
    fluids = [{"phase": name, "shape": shape} for name, shape in {**halves, "c": "rest"}.items()]
    tensions = {("a", "b"): 1.0, ("c", "a"): 2.0, ("b", "c"): 4.0}
    spacing = 0.02
    x = stirred(spacing)
    phase = np.where(np.hypot(*x.T) > 0.6, 2, np.where(x[:, 0] < 0, 0, 1)).astype(np.int32)
    particles = make_snapshot(x, spacing=spacing, phase=phase)
    exact = {("a", "b"): 1.2, ("c", "a"): math.pi * 0.6, ("b", "c"): math.pi * 0.6}
    pairs = [{"between": list(pair), "coefficient": value} for pair, value in tensions.items()]
    for chosen in (pairs, *([pair] for pair in pairs)):
        case = make_case(ENERGY, phases=phases, fluids=fluids, surface_tension=chosen, particle_spacing=spacing)
        expected = sum(pair["coefficient"] * exact[tuple(pair["between"])] for pair in chosen)
        assert measure(case, particles)["surface"] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("x_sides", ["wall", "periodic"])
@pytest.mark.parametrize("y_sides", ["wall", "periodic"])
def test_surface_energy_of_a_layer_from_wall_to_wall(x_sides, y_sides):
    """The interface goes on straight to the wall, and across a periodic side there is one more, or none."""
    spacing = 0.05
    domain = {"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": x_sides, "y": y_sides}}
    case = make_case(ENERGY, surface_tension=TENSION, domain=domain)
    x = lattice(spacing)
    row = measure(case, make_snapshot(x, spacing=spacing, phase=(x[:, 1] > 0.25).astype(np.int32)))
    lines = 2 if y_sides == "periodic" else 1
    assert row["surface"] == pytest.approx(SIGMA * 2.0 * lines, rel=1e-6)


def test_a_free_surface_has_no_surface_energy():
    """A liquid alone in a part of the domain; and an interface ends where it meets empty space."""
    spacing = 0.05
    case = make_case(ENERGY, surface_tension=TENSION)
    x = lattice(spacing)
    x = x[x[:, 0] < 0.3]
    liquid = make_snapshot(x, spacing=spacing, phase=np.ones(len(x), np.int32))
    assert measure(case, liquid)["surface"] == 0.0
    both = make_snapshot(x, spacing=spacing, phase=(x[:, 1] > 0).astype(np.int32))
    assert measure(case, both)["surface"] == pytest.approx(SIGMA * 1.3, rel=0.02)


def test_surface_energy_only_with_surface_tension():
    for tension in ([], [{"between": ["gas", "liquid"], "coefficient": 0}]):
        case = make_case(ENERGY, surface_tension=tension)
        assert "surface" not in measure(case, make_snapshot([[0, 0]]))
    lost = make_snapshot([[0, 0], [math.nan, 0]])
    assert math.isnan(measure(make_case(ENERGY, surface_tension=TENSION), lost)["surface"])


def test_total_energy_of_an_oscillating_drop_is_steadier_than_its_parts():
    """What the drop's surface gives away while it rounds becomes motion; friction takes a little of it."""
    case = case_of(
        FULL,
        particle_spacing=1 / 24,
        gravity=[0, 0],
        end_time=1.2,
        gauges={"energy": {"type": "energy", "interval": 0.02}},
        output={"particles": "none", "checkpoint": "none"},
        fluids=[
            {"phase": "liquid", "shape": {"where": {"condition": "((x - 0.5)/0.34)**2 + ((y - 0.5)/0.24)**2 < 1"}}},
            {"phase": "gas", "shape": "rest"},
        ],
        phases={"gas": {"density": 1.0, "viscosity": 0.001}, "liquid": {"density": 1.0, "viscosity": 0.001}},
    )
    energy = Simulation(case, threads=1).run().gauge("energy")
    swing = {name: np.ptp(energy[name]) for name in ("kinetic", "surface", "total")}
    assert energy["surface"][0] == pytest.approx(0.5 * 2 * math.pi * 0.2925, rel=0.02)
    assert swing["kinetic"] > 0.01
    assert swing["total"] < 0.5 * swing["kinetic"] and swing["total"] < 0.5 * swing["surface"], swing


# -- momentum ----------------------------------------------------------------------------------------------


def test_momentum_in_2d_and_3d():
    case = make_case({"m": {"type": "momentum", "interval": 0.1}})
    particles = make_snapshot(
        [[1, 2], [0, 1], [3, 3]],
        velocity=np.array([[3.0, -4.0], [2.0, 0.0], [9.0, 9.0]]),
        mass=np.array([2.0, 1.0, 1.0]),
        phase=np.array([0, 1, -1], np.int32),
    )
    row = measure(case, particles)
    assert row == {
        "time": 0.0,
        "momentum_x": 8.0,
        "momentum_y": -8.0,
        "angular_z": 2 * (1 * -4 - 2 * 3) - 1 * 2.0,
        "scale": 12.0,
        "max_speed": 5.0,
    }
    case = make_case({"m": {"type": "momentum", "interval": 0.1}}, 3, particle_spacing=0.2)
    row = measure(case, make_snapshot([[1, 2, 3]], velocity=np.array([[4.0, 5.0, 6.0]])))
    assert [row[f"angular_{axis}"] for axis in "xyz"] == [-3.0, 6.0, -3.0]


# -- pressure ----------------------------------------------------------------------------------------------


def test_phase_pressure_is_weighted_with_the_volume():
    case = make_case({"jump": {"type": "phase_pressure", "interval": 0.1}})
    particles = make_snapshot(
        np.zeros((5, 2)),
        pressure=np.array([1.0, 4.0, -2.0, 6.0, 99.0]),
        volume=np.array([2.0, 1.0, 1.0, 1.0, 1.0]),
        phase=np.array([0, 0, 1, 1, -1], np.int32),
    )
    row = measure(case, particles)
    expected = {"time": 0.0, "gas": 2.0, "liquid": 2.0, "gas - liquid": 0.0, "max": 6.0, "min": -2.0}
    assert row == expected
    row = measure(case, particles.select(np.array([0, 1])))
    assert row["gas"] == 2.0
    assert math.isnan(row["liquid"])
    assert math.isnan(row["gas - liquid"])


def test_every_pair_of_phases_has_a_column():
    phases = {name: {"density": 1.0} for name in ("a", "b", "c")}
    fluids = [
        {"phase": name, "shape": {"box": {"lower": [k / 4, 0], "upper": [(k + 1) / 4, 1]}}}
        for k, name in enumerate(phases)
    ]
    case = make_case({"p": {"type": "phase_pressure", "interval": 0.1}}, phases=phases, fluids=fluids)
    columns = [column.name for column in GaugeSet(case).gauges["p"].columns]
    assert columns == ["a", "b", "c", "a - b", "a - c", "b - c", "max", "min"]


# -- extents -----------------------------------------------------------------------------------------------


def test_extents_of_a_rectangle():
    case = make_case({"size": {"type": "extents", "interval": 0.1}})
    spacing = 0.05
    points = lattice(spacing)
    inside = (np.abs(points[:, 0] - 0.2) < 0.3) & (np.abs(points[:, 1] + 0.1) < 0.2)
    row = measure(case, make_snapshot(points[inside]))
    assert row["lowest_x gas"] == pytest.approx(-0.1 + spacing / 2)
    assert row["highest_x gas"] == row["front gas"] == pytest.approx(0.5 - spacing / 2)
    assert row["highest_y gas"] == pytest.approx(0.1 - spacing / 2)
    assert (row["centroid_x gas"], row["centroid_y gas"]) == (pytest.approx(0.2), pytest.approx(-0.1))
    assert row["area gas"] == pytest.approx(0.6 * 0.4)
    assert row["area liquid"] == 0.0
    assert math.isnan(row["centroid_x liquid"])
    assert math.isnan(row["circularity liquid"])


def test_semi_axes_of_a_rectangle_of_cells_are_those_of_the_rectangle():
    """An ellipse with the second moment W^2/12 of a rectangle of width W has the semi-axis 2 W/sqrt(12)."""
    case = make_case({"size": {"type": "extents", "interval": 0.1}})
    points = lattice(0.05)
    inside = (np.abs(points[:, 0] - 0.2) < 0.3) & (np.abs(points[:, 1] + 0.1) < 0.2)
    row = measure(case, make_snapshot(points[inside]))
    assert row["semi_axis_x gas"] == pytest.approx(2 * 0.6 / math.sqrt(12))
    assert row["semi_axis_y gas"] == pytest.approx(2 * 0.4 / math.sqrt(12))
    assert math.isnan(row["semi_axis_x liquid"])


def test_semi_axes_of_an_ellipse():
    case = make_case({"size": {"type": "extents", "interval": 0.1}}, particle_spacing=0.01)
    points = lattice(0.01)
    points = points[np.hypot(points[:, 0] / 0.7, points[:, 1] / 0.4) < 1.0]
    row = measure(case, make_snapshot(points, spacing=0.01))
    assert row["semi_axis_x gas"] == pytest.approx(0.7, rel=2e-3)
    assert row["semi_axis_y gas"] == pytest.approx(0.4, rel=2e-3)


def test_semi_axes_of_a_box_of_cells_in_3d():
    case = make_case({"size": {"type": "extents", "interval": 0.1}}, 3, particle_spacing=0.2)
    axis = 0.2 * (np.arange(4) + 0.5)
    points = np.stack(np.meshgrid(axis, axis[:3], axis[:2], indexing="ij"), axis=-1).reshape(-1, 3)
    row = measure(case, make_snapshot(points, spacing=0.2))
    for name, cells in zip("xyz", (4, 3, 2), strict=True):
        assert row[f"semi_axis_{name} gas"] == pytest.approx(math.sqrt(5 / 12) * 0.2 * cells)


def test_extents_of_a_broken_state_are_nan():
    case = make_case({"size": {"type": "extents", "interval": 0.1}})
    points = lattice(0.05)
    points[7] = np.nan
    row = measure(case, make_snapshot(points))
    assert math.isnan(row["front gas"]) and math.isnan(row["circularity gas"])
    assert row["area gas"] == pytest.approx(4.0)
    assert math.isnan(row["semi_axis_y gas"])


def test_extents_in_3d_have_a_volume_and_no_outline():
    case = make_case({"size": {"type": "extents", "interval": 0.1}}, 3, particle_spacing=0.2)
    row = measure(case, make_snapshot([[0, 0, 0], [0, 0, 1]], spacing=0.2))
    assert row["volume gas"] == pytest.approx(2 * 0.2**3)
    assert row["centroid_z gas"] == 0.5
    assert not any("circularity" in name or "area" in name for name in row)


@pytest.mark.parametrize("center", [0.0, 0.9, 1.0, -0.97])
def test_extents_of_a_drop_across_a_periodic_boundary(center):
    boundary = {"x": "periodic", "y": "periodic"}
    domain = {"lower": [-1, -1], "upper": [1, 1], "boundary": boundary}
    case = make_case({"size": {"type": "extents", "interval": 0.1}}, domain=domain)
    points = lattice(0.05)
    points = points[np.hypot(points[:, 0], points[:, 1]) < 0.4]
    wrapped = np.mod(points + center + 1.0, 2.0) - 1.0
    row = measure(case, make_snapshot(wrapped))
    expected = center - 2.0 if center >= 1.0 else center
    for axis in "xy":
        # 1.0 and -1.0 are the same place, and rounding decides
        assert row[f"centroid_{axis} gas"] == pytest.approx(expected, abs=1e-12) or (
            center == 1.0 and row[f"centroid_{axis} gas"] == pytest.approx(1.0)
        )
        width = row[f"highest_{axis} gas"] - row[f"lowest_{axis} gas"]
        assert width == pytest.approx(points[:, 0].max() - points[:, 0].min())
    assert row["circularity gas"] > 0.99


def test_a_phase_that_goes_all_the_way_round_stays_as_it_is():
    domain = {"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": "periodic", "y": "wall"}}
    case = make_case({"size": {"type": "extents", "interval": 0.1}}, domain=domain)
    points = np.random.default_rng(2).uniform(-1, 1, (5000, 2))
    row = measure(case, make_snapshot(points))
    assert (row["lowest_x gas"], row["highest_x gas"]) == (points[:, 0].min(), points[:, 0].max())
    assert row["centroid_x gas"] == pytest.approx(points[:, 0].mean(), abs=1e-12)


# -- outline -----------------------------------------------------------------------------------------------


def disc(spacing, radius=0.5, squeeze=1.0, shift=(0.013, 0.007)):
    points = lattice(spacing, 1.0) + np.array(shift) * spacing / 0.05
    points = points[np.hypot(points[:, 0] * squeeze, points[:, 1] / squeeze) < radius]
    return points - points.mean(axis=0)


@pytest.mark.parametrize(("spacing", "missing"), [(1 / 26, 3e-3), (1 / 50, 1e-3), (1 / 100, 5e-4)])
def test_outline_of_a_disc_on_a_lattice(spacing, missing):
    shape = outline(disc(spacing), spacing)
    assert 1 - missing < shape.circularity <= 1.0
    assert shape.roundness < 0.2 * spacing / 0.5
    assert shape.radius.mean() == pytest.approx(0.5, abs=0.25 * spacing)
    assert shape.area == pytest.approx(math.pi / 4, rel=1.1 * spacing)


def test_outline_of_a_disc_in_rings_is_a_circle():
    spacing = 0.02
    radii = np.arange(spacing / 2, 0.5, spacing)
    rings = []
    for radius in radii:
        angle = np.arange(round(2 * math.pi * radius / spacing)) * spacing / radius
        rings.append(radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    shape = outline(np.concatenate(rings), spacing)
    assert shape.circularity == pytest.approx(1.0, abs=1e-5)
    assert shape.radius.mean() == pytest.approx(0.5, abs=1e-3)


def test_outline_of_an_ellipse():
    squeeze = 1.2
    shape = outline(disc(0.01, squeeze=squeeze), 0.01)
    angle = np.linspace(0, 2 * math.pi, 100001)
    a, b = 0.5 / squeeze, 0.5 * squeeze
    perimeter = np.trapezoid(np.hypot(a * np.sin(angle), b * np.cos(angle)), angle)
    assert shape.circularity == pytest.approx(2 * math.pi * math.sqrt(a * b) / perimeter, abs=3e-3)
    theta = np.radians(np.arange(360))
    exact = 1 / np.hypot(np.cos(theta) / a, np.sin(theta) / b)
    assert shape.roundness == pytest.approx(exact.std() / exact.mean(), rel=0.02)


def test_outline_of_a_tilted_peanut():
    """Sine and cosine terms together, in a shape whose length depends on their signs."""

    def radius(angle):
        return 0.5 * (1 + 0.3 * np.cos(2 * angle + math.pi / 4))

    points = lattice(0.004)
    inside = np.hypot(points[:, 0], points[:, 1]) < radius(np.arctan2(points[:, 1], points[:, 0]))
    shape = outline(points[inside] - points[inside].mean(axis=0), 0.004)
    angle = np.linspace(0, 2 * math.pi, 100001)
    r, slope = radius(angle), -0.3 * np.sin(2 * angle + math.pi / 4)
    exact = 2 * math.sqrt(math.pi * np.trapezoid(r**2 / 2, angle)) / np.trapezoid(np.hypot(r, slope), angle)
    assert shape.circularity == pytest.approx(exact, abs=1e-3)


def test_outline_of_a_square_is_less_than_one():
    points = lattice(0.02, 0.5)
    # Exactly sqrt(pi) / 2 = 0.886; eight modes round the corners off.
    assert outline(points, 0.02).circularity == pytest.approx(0.91, abs=0.01)
    assert outline(points, 0.02, modes=40).circularity == pytest.approx(math.sqrt(math.pi) / 2, abs=0.01)


def test_outline_does_not_see_a_stray_particle():
    points = disc(0.02)
    stray = np.vstack([points, [[0.0, 0.9]], [[0.8, 0.1]]])
    with_strays, without = outline(stray, 0.02), outline(points, 0.02)
    assert with_strays.circularity == pytest.approx(without.circularity, abs=1e-4)
    assert with_strays.area == pytest.approx(without.area, rel=1e-3)


@pytest.mark.parametrize("count", [0, 1, 5, 15])
def test_outline_of_too_few_particles_is_nan(count):
    assert math.isnan(outline(np.random.default_rng(1).uniform(size=(count, 2)), 0.1).circularity)


# -- contour, velocities, strays -----------------------------------------------------------------------------


CONTOUR = {"surface": {"type": "contour", "interval": 0.1, "mirror": "x"}}


def in_a_box(spacing, inside, extent=1.0, walls=5):
    """Snapshot of a closed box, wall particles included, with phase 0 where `inside` says so and 1 elsewhere."""
    every = lattice(spacing, extent + walls * spacing)
    fluid = (np.abs(every) < extent).all(axis=1)
    phase = np.where(fluid, np.where(inside(*every.T), 0, 1), -1).astype(np.int32)
    return make_snapshot(every, spacing=spacing, phase=phase, kind=np.where(fluid, FLUID, WALL).astype(np.uint8))


def test_contour_of_a_disc_off_the_axis():
    spacing = 0.02
    row = measure(make_case(CONTOUR), in_a_box(spacing, lambda x, y: np.hypot(x - 0.02, y) < 0.5))
    assert row["perimeter gas"] == pytest.approx(np.pi, rel=0.006)
    assert row["perimeter liquid"] == pytest.approx(row["perimeter gas"])
    assert 0.994 < row["circularity gas"] < 1.0
    assert row["filling gas"] == pytest.approx(1.0, abs=1e-3)
    ends = [row[f"{end}_{axis} gas"] for end in ("lowest", "highest") for axis in "xy"]
    assert ends == pytest.approx([-0.48, -0.5, 0.52, 0.5], abs=0.2 * spacing)
    assert row["highest_x liquid"] == 1.0
    assert row["asymmetry gas"] == pytest.approx(4 * 0.02 / np.pi, rel=0.05)
    assert "asymmetry gas" not in measure(
        make_case({"surface": {"type": "contour", "interval": 0.1}}), in_a_box(0.1, lambda x, y: y < 0)
    )


def test_filling_is_room_over_density():
    """Twice the density says half the room; the places of the particles do not know."""
    particles = in_a_box(0.04, lambda x, y: np.hypot(x, y) < 0.5)
    before = measure(make_case(CONTOUR), particles)
    particles.volume[particles.phase == 0] *= 0.98
    after = measure(make_case(CONTOUR), particles)
    assert after["filling gas"] == pytest.approx(before["filling gas"] / 0.98, rel=2e-3)


def test_contour_of_a_broken_state_or_a_missing_phase_is_nan():
    particles = in_a_box(0.1, lambda x, y: x > 9)
    row = measure(make_case(CONTOUR), particles)
    assert all(math.isnan(row[name]) for name in row if name.endswith("gas"))
    assert row["filling liquid"] == pytest.approx(1.0)
    particles.position[3, 0] = math.nan
    assert all(math.isnan(value) for name, value in measure(make_case(CONTOUR), particles).items() if name != "time")


@pytest.mark.parametrize("scheme", ["isph", "riemann"])
@pytest.mark.parametrize("side", ["wall", "free_slip"])
def test_contour_of_water_in_a_tank_has_no_length_along_its_walls(scheme, side):
    """Also where walls are mirrors, of which a snapshot has no particles: the line is the free surface alone."""
    spacing = 0.05
    case = make_case(
        {"surface": {"type": "contour", "interval": 0.1}},
        domain={"lower": [-1, -1], "upper": [1, 1], "boundary": {"x": side, "y": {"lower": side, "upper": "open"}}},
        phases={"water": {"density": 1000.0}},
        fluids=[{"phase": "water", "shape": {"box": {"lower": [-1, -1], "upper": [1, 0]}}}],
        numerics={"scheme": scheme},
    )
    every = lattice(spacing, 1 + 5 * spacing)
    fluid = (np.abs(every) < 1).all(axis=1)
    kept = np.where(fluid, every[:, 1] < 0, (scheme == "riemann") & (every[:, 1] < 1))
    every, fluid = every[kept], fluid[kept]
    kind, phase = np.where(fluid, FLUID, WALL).astype(np.uint8), np.where(fluid, 0, -1).astype(np.int32)
    row = measure(case, make_snapshot(every, spacing=spacing, phase=phase, kind=kind))
    assert row["perimeter water"] == pytest.approx(2.0, rel=0.002)
    assert row["filling water"] == pytest.approx(1.0, abs=0.01)
    ends = [row[f"{end}_{axis} water"] for end in ("lowest", "highest") for axis in "xy"]
    assert ends == pytest.approx([-1, -1, 1, 0], abs=0.15 * spacing)


def test_velocity_of_a_phase_is_weighted_with_the_volume():
    particles = make_snapshot(
        [[0, 0], [1, 0], [2, 0], [3, 0]],
        velocity=np.array([[0.0, 3.0], [4.0, -3.0], [0.0, 7.0], [90.0, 0.0]]),
        volume=np.array([1.0, 3.0, 1.0, 1.0]),
        phase=np.array([0, 0, 1, -1], np.int32),
    )
    row = measure(make_case({"rise": {"type": "phase_velocity", "interval": 0.1}}), particles)
    assert row["velocity_x gas"] == pytest.approx(3.0)
    assert row["velocity_y gas"] == pytest.approx(-1.5)
    assert row["max_speed gas"] == pytest.approx(5.0)
    assert (row["velocity_y liquid"], row["max_speed liquid"]) == (7.0, 7.0)
    empty = measure(make_case({"rise": {"type": "phase_velocity", "interval": 0.1}}), particles.select([2]))
    assert math.isnan(empty["velocity_x gas"]) and math.isnan(empty["max_speed gas"])


def test_strays_have_fewer_than_three_of_their_own_near():
    case = make_case({"strays": {"type": "strays", "interval": 0.1}})
    particles = in_a_box(0.1, lambda x, y: (np.hypot(x - 0.05, y - 0.05) < 0.01) | (np.hypot(x + 0.5, y + 0.5) < 0.1))
    # one alone; four in a square keep company
    assert (particles.phase == 0).sum() == 5
    assert measure(case, particles) == {"time": 0.0, "gas": 1.0, "liquid": 0.0}
    # a corner of a lattice has five within two spacings; walls and the other phase are no company
    assert measure(case, make_snapshot(lattice(0.1), spacing=0.1))["gas"] == 0.0
    particles.phase[particles.phase == 1] = -1
    assert measure(case, particles)["gas"] == 1.0


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("count", [9, 150])
def test_isolated_agrees_with_all_pairs(dimension, periodic, count):
    rng = np.random.default_rng(4)
    lower, upper = np.full(dimension, -1.0), np.full(dimension, 1.0)
    position = rng.uniform(-1, 1, (count, dimension))
    if not periodic:
        position[:7] *= 1.6  # some have left the domain
    offset = position[:, None] - position
    if periodic:
        offset -= 2 * np.round(offset / 2)
    distance = np.sqrt((offset**2).sum(axis=2))
    for radius in (0.05, 0.17, 0.4, 0.9, 1.9):
        if periodic and radius > 1:
            continue
        company = np.count_nonzero(distance <= radius, axis=1) - 1
        found = isolated(position, radius, 3, lower, upper, [periodic] * dimension)
        assert found.tolist() == (company < 3).tolist()
    assert isolated(position[:0], 0.1, 3, lower, upper, [periodic] * dimension).shape == (0,)


# -- what the device measures ------------------------------------------------------------------------------


def test_interface_length():
    case = make_case({"surface": {"type": "interface_length", "interval": 0.1}})
    particles = make_snapshot([[0, 0]], extra={"interface_length": 3.25})
    assert measure(case, particles) == {"time": 0.0, "interface_length": 3.25}
    with pytest.raises(WarpsphError, match="gauges.surface.*does not measure 'interface_length'"):
        measure(case, make_snapshot([[0, 0]]))


def test_amplitudes_of_a_wave_by_moments():
    """Columns of any height, filled evenly: two waves of two lengths, of which the gauge sees one."""
    wave = {"type": "interface_wave", "phase": "gas", "wavelength": 1.0, "interval": 0.1}
    case = make_case({"wave": wave})
    x = np.linspace(-1, 1, 400, endpoint=False)
    top = 0.2 + 0.3 * np.cos(2 * np.pi * x) - 0.1 * np.sin(2 * np.pi * x) + 0.2 * np.cos(np.pi * x)
    below = np.column_stack([x, 0.5 * (top - 1)])  # a particle for each column, with its volume
    above = np.column_stack([x, 0.5 * (top + 1)])
    volume = 0.005 * np.concatenate([top + 1, 1 - top])
    phase = np.repeat([0, 1], len(x)).astype(np.int32)
    found = measure(case, make_snapshot(np.vstack([below, above]), volume=volume, phase=phase))
    assert found["cosine"] == pytest.approx(0.3, abs=1e-12) and found["sine"] == pytest.approx(-0.1, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"phase": "oil"}, "phase"),
        ({"wavelength": 0.7}, "wavelength"),
        ({"axis": "y"}, "axis"),
        ({"wavelength": -1}, "wavelength"),
    ],
)
def test_wave_that_does_not_fit(change, key):
    wave = {"type": "interface_wave", "phase": "gas", "wavelength": 1.0, "interval": 0.1}
    with pytest.raises(CaseError) as error:
        make_case({"wave": wave | change})
    assert f"gauges.wave.{key}" in str(error.value)


def test_wall_force_of_each_body_and_of_all():
    bodies = {
        "step": {"shape": {"box": {"lower": [0.6, 0.6], "upper": [0.8, 0.8]}}},
        "block": {"shape": {"box": {"lower": [-0.8, 0.6], "upper": [-0.6, 0.8]}}},
    }
    case = make_case({"load": {"type": "wall_force", "interval": 0.1}}, bodies=bodies)
    assert wall_bodies(case) == ["domain", "step", "block"]
    force = {}
    for k, body in enumerate(wall_bodies(case)):
        force |= {f"wall_force_x {body}": 1.0 + k, f"wall_force_y {body}": -10.0 * k}
        parts = ("wall_friction_x", "wall_friction_y", "wall_torque_z", "wall_centre_x", "wall_centre_y")
        force |= {f"{part} {body}": 0.0 for part in parts}
    row = measure(case, make_snapshot([[0, 0]], extra=force))
    assert (row["force_x"], row["force_y"]) == (6.0, -30.0)
    assert (row["force_x block"], row["force_y block"]) == (3.0, -20.0)
    assert row["force_x domain"] == 1.0


@pytest.mark.parametrize(("pivot", "torque"), [(None, 7.0), ([0.0, 0.0], 7.0 + 0.5 * 20.0 - 0.25 * 3.0)])
def test_a_body_has_parts_of_its_force_and_a_torque_about_a_pivot(pivot, torque):
    gauge = {"type": "wall_force", "interval": 0.1} | ({"pivot": pivot} if pivot else {})
    bodies = {"fin": {"shape": {"sphere": {"center": [0.5, 0.25], "radius": 0.2}}}}
    case = make_case({"load": gauge}, bodies=bodies)
    extra = {f"wall_force_{axis} domain": 0.0 for axis in "xy"}
    extra |= {"wall_force_x fin": 3.0, "wall_force_y fin": 20.0, "wall_friction_x fin": 1.0, "wall_friction_y fin": 5.0}
    extra |= {"wall_torque_z fin": 7.0, "wall_centre_x fin": 0.5, "wall_centre_y fin": 0.25}
    row = measure(case, make_snapshot([[0, 0]], extra=extra))
    assert (row["pressure_x fin"], row["pressure_y fin"]) == (2.0, 15.0)
    assert (row["friction_x fin"], row["friction_y fin"]) == (1.0, 5.0)
    assert row["torque_z fin"] == pytest.approx(torque)


def test_a_pivot_needs_a_body():
    with pytest.raises(CaseError, match="gauges.load.pivot.*needs bodies"):
        make_case({"load": {"type": "wall_force", "interval": 0.1, "pivot": [0, 0]}})


def test_two_columns_of_one_name_are_refused():
    phases = {"max": {"density": 1.0}}
    fluids = [{"phase": "max", "shape": "rest"}]
    case = make_case({"p": {"type": "phase_pressure", "interval": 0.1}}, phases=phases, fluids=fluids)
    with pytest.raises(CaseError, match="gauges.p.*two columns called 'max'"):
        GaugeSet(case)


SAMPLERS = {
    "probe": {"type": "points", "points": [[0, 0], [0.5, 0.25]], "fields": ["pressure"], "interval": 0.1},
    "profile": {
        "type": "line",
        "from": [0, -1],
        "to": [0, 1],
        "count": 5,
        "fields": ["velocity", "density"],
        "times": [0.0, 0.5],
    },
}


def test_samples_give_a_row_a_point(tmp_path):
    case = make_case(SAMPLERS)
    with GaugeSet(case, tmp_path) as gauges:
        np.testing.assert_array_equal(gauges.sample_points["probe"], [[0, 0], [0.5, 0.25]])
        np.testing.assert_allclose(gauges.sample_points["profile"][:, 1], [-1, -0.5, 0, 0.5, 1])
        assert gauges.sample_fields == {"probe": ["pressure"], "profile": ["velocity", "density"]}
        for moment in (0.0, 0.1):
            samples = {
                "probe": {"pressure": np.array([1.0, 2.0]) + moment},
                "profile": {"velocity": np.arange(10.0).reshape(5, 2), "density": np.arange(5.0)},
            }
            gauges.record(make_snapshot([[0, 0]], at=moment, samples=samples))
        with pytest.raises(WarpsphError, match="gauges.probe.*does not sample 'pressure'"):
            gauges.record(make_snapshot([[0, 0]], at=0.2))
    assert (tmp_path / "probe.csv").read_text() == (
        "time [s],x [m],y [m],pressure [Pa]\n"
        "0.0,0.0,0.0,1.0\n0.0,0.5,0.25,2.0\n"
        "0.1,0.0,0.0,1.1\n0.1,0.5,0.25,2.1\n"
    )
    columns, units = read_gauge(tmp_path / "profile.csv")
    assert list(columns) == ["time", "x", "y", "velocity_x", "velocity_y", "density"]
    assert units["velocity_y"] == "m/s"
    assert len(columns["time"]) == 5  # 0.1 was not one of its times
    np.testing.assert_array_equal(columns["velocity_y"], [1, 3, 5, 7, 9])


# -- schedules, files, memory ------------------------------------------------------------------------------

TWO = {
    "energy": {"type": "energy", "interval": 0.1},
    "jump": {"type": "phase_pressure", "times": [0.15, 0.3]},
}


def run(gauges: GaugeSet, start: float, end: float) -> None:
    """What a run does with its gauges: measure whatever is due, then go on to the next moment."""
    time = start
    while True:
        gauges.record(make_snapshot([[0, 0], [1, 1]], at=time, velocity=np.full((2, 2), time)))
        if gauges.next_time > end * (1 + 1e-9):
            return
        time = gauges.next_time


def test_due_times_and_memory():
    gauges = GaugeSet(make_case(TWO))
    assert gauges.due(0.0) == ["energy"]
    assert gauges.needs(["energy", "jump"]) == Needs.of(Energies, Pressures)
    run(gauges, 0.0, 0.5)
    np.testing.assert_allclose(gauges.series("energy")["time"], np.arange(6) * 0.1)
    np.testing.assert_allclose(gauges.series("energy")["kinetic"], 2 * (np.arange(6) * 0.1) ** 2)
    np.testing.assert_allclose(gauges.series("jump")["time"], [0.15, 0.3])
    assert gauges.units("jump")["gas - liquid"] == "Pa"
    with pytest.raises(KeyError, match="no gauge 'nothing'; there are energy, jump"):
        gauges.series("nothing")
    assert GaugeSet(make_case({})).next_time == math.inf


def test_rows_are_in_the_file_at_once_with_all_digits(tmp_path):
    gauges = GaugeSet(make_case(TWO), tmp_path)
    value = 0.1 + 0.2
    gauges.record(make_snapshot([[0, 0]], velocity=np.array([[value, 0.0]])))
    head, row = (tmp_path / "energy.csv").read_text().splitlines()
    assert head.startswith("time [s],kinetic [J/m],potential [J/m],total [J/m],kinetic gas [J/m]")
    assert float(row.split(",")[1]) == 0.5 * value * value
    assert (tmp_path / "jump.csv").read_text().count("\n") == 1
    columns, units = read_gauge(tmp_path / "energy.csv")
    assert columns["kinetic"][0] == gauges.series("energy")["kinetic"][0]
    assert units["time"] == "s"
    gauges.close()


@pytest.mark.parametrize("restart", [0.0, 0.2, 0.25, 0.4])
@pytest.mark.parametrize("cut_off", ["", "0.5,1.", "0.5"])
def test_restart_gives_the_file_of_an_unbroken_run(tmp_path, restart, cut_off):
    case = make_case(TWO)
    for name in ("broken", "whole"):
        (tmp_path / name).mkdir()
        with GaugeSet(case, tmp_path / name) as gauges:
            run(gauges, 0.0, 1.0)
    with open(tmp_path / "broken" / "energy.csv", "a") as file:
        file.write(cut_off)  # a row of a process that was killed
    with GaugeSet(case, tmp_path / "broken", restart_time=restart) as gauges:
        assert gauges.next_time > restart
        assert gauges.series("energy")["time"][-1] <= restart
        run(gauges, restart, 1.0)
        series = gauges.series("energy")
    for name in TWO:
        whole = (tmp_path / "whole" / f"{name}.csv").read_text()
        assert (tmp_path / "broken" / f"{name}.csv").read_text() == whole
    np.testing.assert_allclose(series["time"], np.arange(11) * 0.1)


def test_restart_measures_what_the_checkpoint_was_faster_than(tmp_path):
    """Killed between the checkpoint of t = 0.4 and the row of t = 0.4."""
    case = make_case(TWO)
    with GaugeSet(case, tmp_path) as gauges:
        run(gauges, 0.0, 0.3)
    with GaugeSet(case, tmp_path, restart_time=0.4) as gauges:
        assert gauges.due(0.4) == ["energy"]
        run(gauges, 0.4, 0.6)
        np.testing.assert_allclose(gauges.series("energy")["time"], np.arange(7) * 0.1)


def test_restart_drops_a_last_row_without_its_end(tmp_path):
    """The last number of the row of t = 0.4 lost its last digits; it must not pass for a number."""
    case = make_case(TWO)
    with GaugeSet(case, tmp_path) as gauges:
        run(gauges, 0.0, 0.4)
    whole = (tmp_path / "energy.csv").read_text()
    (tmp_path / "energy.csv").write_text(whole[:-3])
    with GaugeSet(case, tmp_path, restart_time=0.4) as gauges:
        run(gauges, 0.4, 0.4)
    assert (tmp_path / "energy.csv").read_text() == whole


def test_restart_refuses_other_columns_and_makes_missing_files(tmp_path):
    with GaugeSet(make_case(TWO), tmp_path) as gauges:
        run(gauges, 0.0, 0.3)
    (tmp_path / "jump.csv").unlink()
    with GaugeSet(make_case(TWO), tmp_path, restart_time=0.2) as gauges:
        assert gauges.due(0.3) == ["energy", "jump"]
        assert gauges.due(0.2) == []
    eos = {name: PhaseEos(1.0, 1.0, 7.0) for name in ("gas", "liquid")}
    before = (tmp_path / "energy.csv").read_text()
    with pytest.raises(OutputError, match="energy.csv: cannot be continued: its columns"):
        GaugeSet(make_case(TWO), tmp_path, eos=eos, restart_time=0.2)
    assert (tmp_path / "energy.csv").read_text() == before


def test_full_disk_leaves_whole_rows(tmp_path):
    gauges = GaugeSet(make_case(TWO), tmp_path)
    gauges.record(make_snapshot([[0, 0]]))
    before = (tmp_path / "energy.csv").read_text()
    table = gauges._tables["energy"]
    real = table._file

    class Full:
        """The file on a disk with room for three more bytes."""

        room = 3

        def __getattr__(self, name):
            return getattr(real, name)

        def write(self, data):
            if not self.room:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            written, self.room = real.write(data[: self.room]), 0
            return written

    table._file = Full()
    with pytest.raises(OutputError, match="energy.csv: the disk is full"):
        gauges.record(make_snapshot([[0, 0]], at=0.1))
    assert (tmp_path / "energy.csv").read_text() == before
    gauges.close()


def test_headings_and_broken_files(tmp_path):
    assert parse_heading("gas - liquid [Pa]") == ("gas - liquid", "Pa")
    assert parse_heading("t_s") == ("t_s", "")
    with pytest.raises(OutputError, match=r"none.csv: cannot be read"):
        read_gauge(tmp_path / "none.csv")
    (tmp_path / "a.csv").write_text("time [s],x [m]\n0.0,1.0\n0.1\n")
    with pytest.raises(OutputError, match="does not fit"):
        read_gauge(tmp_path / "a.csv")
    (tmp_path / "b.csv").write_text("")
    with pytest.raises(OutputError, match="is empty"):
        read_gauge(tmp_path / "b.csv")
