"""Sensors with a face: means over it against integrals, the plane of the face, and what a case may not say."""

import math

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.case.sensors import NoPlane, face_spots, wall_normal
from warpsph.errors import CaseError
from warpsph.measure.gauges import GaugeSet
from warpsph.measure.probes import sample
from warpsph.snapshot import Snapshot

SPACING = 0.05


def make_case(dimension=2, bodies=None, boundary=None, spacing=SPACING, **gauge) -> Case:
    sides = {axis: "wall" for axis in "xyz"[:dimension]}
    gauge = {"type": "points", "fields": ["pressure"], "interval": 0.1, **gauge}
    return Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": spacing,
            "end_time": 1.0,
            "domain": {"lower": [0.0] * dimension, "upper": [1.0] * dimension, "boundary": boundary or sides},
            "phases": {"water": {"density": 1000.0}},
            "fluids": [{"phase": "water", "shape": "rest"}],
            "bodies": bodies or {},
            "gauges": {"sensor": gauge},
        }
    )


def fluid(dimension, pressure, top=1.0, spacing=SPACING, noise=0.2) -> Snapshot:
    """A disordered box of fluid up to a height, with a pressure that is a function of the positions (n, dimension)."""
    axes = [np.arange(spacing / 2, top if axis == 1 else 1.0, spacing) for axis in range(dimension)]
    position = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dimension)
    position += np.random.default_rng(3).uniform(-noise * spacing, noise * spacing, position.shape)
    n = len(position)
    return Snapshot(
        time=0.0, step=0, dt=0.0, dimension=dimension, position=position, velocity=np.ones((n, dimension)),
        density=np.ones(n), pressure=pressure(position), mass=np.ones(n), volume=np.full(n, spacing**dimension),
        phase=np.zeros(n, np.int32), particle_id=np.arange(n), kind=np.zeros(n, np.uint8), particle_spacing=spacing,
    )  # fmt: skip


def read(case, snapshot) -> dict[str, np.ndarray]:
    """The columns of the gauge, its samples interpolated as a run does."""
    spacing = snapshot.particle_spacing
    with GaugeSet(case) as gauges:
        places, fields = gauges.sample_points["sensor"], gauges.sample_fields["sensor"]
        degree, box = gauges.sample_degrees["sensor"], [0.0] * case.dimension
        snapshot.samples["sensor"] = sample(snapshot, places, fields, 3 * spacing, box, degree)
        gauges.record(snapshot)
        return gauges.series("sensor")


@pytest.mark.parametrize("area", [0.003, 0.05, 0.31])
def test_a_constant_and_a_linear_pressure_are_exact(area):
    case = make_case(points=[[1.0, 0.4], [1.0, 0.6]], area=area)
    assert read(case, fluid(2, lambda x: np.full(len(x), 7.0)))["pressure"] == pytest.approx([7.0, 7.0], rel=1e-9)
    linear = read(case, fluid(2, lambda x: 3.0 + 2.0 * x[:, 0] - 5.0 * x[:, 1]))
    assert linear["pressure"] == pytest.approx([3.0, 2.0], rel=1e-9)
    assert list(linear) == ["time", "x", "y", "pressure"]
    assert linear["y"].tolist() == [0.4, 0.6]


def exact_mean(case, pressure) -> float:
    """What the gauge makes of a pressure, a function of places (n, dimension), that is known exactly at its places."""
    snapshot = fluid(case.dimension, lambda x: x[:, 0], spacing=0.2)
    with GaugeSet(case) as gauges:
        snapshot.samples["sensor"] = {"pressure": pressure(gauges.sample_points["sensor"])}
        gauges.record(snapshot)
        (value,) = gauges.series("sensor")["pressure"]
    return float(value)


def test_a_curved_pressure_gives_its_mean_and_not_the_value_in_the_middle():
    """Mean of y^2 over a length L about y0: y0^2 + L^2/12."""
    face, point = make_case(points=[[1.0, 0.5]], area=0.6), make_case(points=[[1.0, 0.5]])
    assert exact_mean(face, lambda x: x[:, 1] ** 2) == pytest.approx(0.25 + 0.03, rel=1e-3)
    assert exact_mean(point, lambda x: x[:, 1] ** 2) == pytest.approx(0.25)
    assert read(point, fluid(2, lambda x: x[:, 1] ** 2))["pressure"] == pytest.approx([0.25], rel=1e-6)


def test_a_face_has_less_noise_than_a_point_at_the_wall():
    """Standard deviation over 200 random pressures; the face is so small that its area takes nothing from the noise."""
    place = [[1.0, 0.5]]
    found: dict[float, list[float]] = {1e-4: [], 0.0: []}
    cases = {1e-4: make_case(points=place, area=1e-4), 0.0: make_case(points=place)}
    for seed in range(200):
        pressure = np.random.default_rng(seed).normal(size=400)
        for area, case in cases.items():
            found[area].append(read(case, fluid(2, lambda x: pressure))["pressure"][0])  # noqa: B023
    assert np.std(found[1e-4]) < 0.7 * np.std(found[0.0])


def test_the_face_of_a_3d_sensor_is_a_disc_in_the_wall():
    """Linear exactly; of y^2 + 3 z^2 the mean over a disc of radius r is (1 + 3) r^2/4 more than in its middle."""
    spacing, radius = 0.1, 0.25
    case = make_case(3, points=[[1.0, 0.5, 0.5]], area=math.pi * radius**2, spacing=spacing)
    linear = fluid(3, lambda x: 1.0 + x @ [1.0, 2.0, -4.0], spacing=spacing)
    assert read(case, linear)["pressure"] == pytest.approx([1.0], abs=1e-9)
    squared = exact_mean(case, lambda x: (x[:, 1] - 0.5) ** 2 + 3 * (x[:, 2] - 0.5) ** 2 + 100 * (x[:, 0] - 1.0))
    assert squared == pytest.approx(radius**2, rel=0.05)


@pytest.mark.parametrize(("dimension", "normal"), [(2, [1, 0]), (2, [3, 4]), (3, [0, 0, 2]), (3, [1, -2, 0.5])])
@pytest.mark.parametrize("area", [1e-4, 0.02, 0.2])
def test_spots_lie_in_the_plane_close_enough_and_evenly(dimension, normal, area):
    spots = face_spots(area, normal, SPACING)
    assert np.abs(spots @ normal).max() < 1e-12
    assert np.abs(spots.mean(axis=0)).max() < 1e-12
    reach = area / 2 if dimension == 2 else math.sqrt(area / math.pi)
    assert 0.4 * reach < np.linalg.norm(spots, axis=1).max() <= reach * (1 + 1e-9)
    apart = np.linalg.norm(spots[:, None] - spots[None], axis=2) + 9 * np.eye(len(spots))
    assert apart.min(axis=1).max() <= SPACING / 2 * (1 + 1e-9)


def test_a_dry_part_adds_no_pressure_and_other_fields_leave_it_out():
    """A face from 0.2 to 0.8 with water up to 0.5, of which the support radius (0.15) above the water counts as wet too."""
    half = fluid(2, lambda x: np.full(len(x), 8.0), top=0.5)
    row = read(make_case(points=[[1.0, 0.5], [1.0, 0.9]], area=0.2, fields=["pressure", "velocity"]), half)
    assert row["pressure"][0] == pytest.approx(8.0) and math.isnan(row["pressure"][1])
    row = read(make_case(points=[[1.0, 0.5]], area=0.6, fields=["pressure", "velocity"]), half)
    assert 8.0 * 0.5 < row["pressure"][0] < 8.0 * 0.76
    assert row["velocity_x"] == pytest.approx([1.0])


def test_the_plane_is_that_of_the_nearest_wall():
    box = {"shape": {"box": {"lower": [0.4, 0.0], "upper": [0.6, 0.3]}}}
    slope = {"shape": {"polygon": {"points": [[0.0, 0.0], [0.4, 0.0], [0.0, 0.3]]}}}
    ball = {"shape": {"sphere": {"center": [0.5, 0.7], "radius": 0.1}}}
    case = make_case(bodies={"box": box, "slope": slope, "ball": ball}, points=[[1.0, 0.5]])
    for point, expected in [
        ([1.0, 0.5], [1, 0]), ([0.3, 1.0], [0, 1]), ([0.4, 0.2], [1, 0]), ([0.5, 0.3], [0, 1]),
        ([0.2, 0.15], [0.6, 0.8]), ([0.5 + 0.06, 0.7 + 0.08], [0.6, 0.8]),
    ]:  # fmt: skip
        assert abs(wall_normal(case, point) @ np.array(expected, float)) == pytest.approx(1.0, abs=1e-9), point
    for point in ([1.0, 1.0], [0.4, 0.3]):
        with pytest.raises(NoPlane, match="as near to one wall as to another"):
            wall_normal(case, point)
    with pytest.raises(NoPlane, match="no wall within a particle_spacing"):
        wall_normal(case, [0.8, 0.5])


@pytest.mark.parametrize(
    ("gauge", "expected"),
    [
        ({"area": 0.0}, "gauges.sensor.area: 0.0 -> .*> 0"),
        ({"area": 0.01, "points": [[0.5, 0.5]]}, r"gauges.sensor.points.0.*no wall within.*move it to .*, or give normal"),
        ({"area": 0.01, "points": [[0.0, 0.0]]}, r"gauges.sensor.points.0.*as near to one wall.*or give normal"),
        ({"area": 0.01, "normal": [0, 0]}, r"gauges.sensor.normal: \[0, 0\] -> has no direction"),
        ({"area": 0.01, "normal": [1]}, r"gauges.sensor.normal: \[1\] -> needs 2 numbers"),
        ({"normal": [1, 0]}, "gauges.sensor.normal.*is that of an area, and there is none; add area"),
        ({"area": 0.3, "points": [[1.0, 0.1]]}, r"gauges.sensor.points.0.*y = -0.05 to 0.25 m.*from 0 to 1 m; .*lower area"),
    ],
)
def test_what_a_case_may_not_say(gauge, expected):
    with pytest.raises(CaseError, match=expected):
        make_case(**{"points": [[1.0, 0.5]], **gauge})


def test_an_area_can_be_taken_out_again():
    case = make_case(points=[[1.0, 0.5]], area=0.1)
    assert case.replace({"gauges.sensor.area": "none"}).gauges["sensor"].area is None
    assert Case.from_dict(case.to_dict(defaults=True)).gauges["sensor"].area == 0.1


def test_a_given_normal_needs_no_wall_and_a_periodic_side_no_room():
    case = make_case(points=[[0.5, 0.5]], area=0.2, normal=[0, 3])
    assert exact_mean(case, lambda x: x[:, 0] ** 2) == pytest.approx(0.25 + 0.04 / 12, rel=1e-3)
    make_case(points=[[0.98, 1.0]], area=0.2, boundary={"x": "periodic", "y": "wall"})


def test_a_body_of_another_dimension_is_reported_and_no_crash():
    for shape in (
        {"sphere": {"center": [0.5, 0.5, 0.5], "radius": 0.1}}, {"box": {"lower": [0, 0, 0], "upper": [0.2, 0.2, 0.2]}},
        {"polygon": {"points": [[0, 0], [0.1, 0], [0, 0.1, 3]]}},
    ):  # fmt: skip
        with pytest.raises(CaseError, match="bodies.pin.shape.*needs 2 numbers"):
            make_case(bodies={"pin": {"shape": shape}}, points=[[1.0, 0.5]], area=0.01)
