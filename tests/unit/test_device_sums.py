"""Sums that the device forms against the same sums of a snapshot, and what a record copies."""

import numpy as np
import pytest

from tests.scenes import FULL, PERIODIC, case_of
from warpsph import Simulation
from warpsph.measure.gauges import GaugeSet
from warpsph.measure.probes import sample
from warpsph.measure.totals import Energies, Motion, Places, Pressures, Scene, cut_of, eos_of_run, sums_of
from warpsph.running.device_sums import Nearby
from warpsph.running.model import Model
from warpsph.running.recorder import Recorder
from warpsph.running.state_copy import copy_state

KINDS = (Motion, Energies, Pressures, Places)

# A drop of liquid across a corner of a periodic box, in a gas that fills it.
CORNER = {
    **FULL,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
    "gravity": [0, 0],
    "fluids": [
        {"phase": "liquid", "shape": {"box": {"lower": [0.9, 0.8], "upper": [1.0, 1.0]}}},
        {"phase": "liquid", "shape": {"box": {"lower": [0.0, 0.8], "upper": [0.3, 1.0]}}},
        {"phase": "gas", "shape": "rest"},
    ],
    "start": {"velocity": ["0.3 + 0.1*sin(2*pi*y)", "0.2"]},
    "gauges": {},
}


def run_of(scene, device="cpu", threads=1, **changes):
    return Simulation(case_of(scene, **changes), device=device, threads=threads).run()


@pytest.fixture(scope="module", params=["walls", "periodic"])
def run(request, device):
    if request.param == "walls":
        return run_of(FULL, device, end_time=0.05, central_force={"rate": 2.0, "center": [0.3, 0.6]})
    return run_of(CORNER, device, end_time=0.05)


@pytest.mark.parametrize("kind", KINDS)
def test_sums_are_those_of_the_snapshot(run, kind):
    model = run.model
    scene = Scene(model.case, eos_of_run(model.case, model.physics.sound_speed, model.nominal_pressure))
    (found,) = model.sums.form([kind]).values()
    expected = sums_of(model.snapshot(), kind, scene)
    for name, values in vars(expected).items():
        size = np.nanmax(np.abs(values), initial=0.0)
        np.testing.assert_allclose(vars(found)[name], values, rtol=1e-11, atol=1e-11 * size, err_msg=name)
    assert any(np.abs(values[np.isfinite(values)]).max(initial=0.0) > 0.0 for values in vars(found).values())


def test_a_drop_across_the_corner_is_put_together():
    run = run_of(CORNER, end_time=1e-6)
    places = run.model.sums.form([Places])[Places]
    assert np.isnan(places.cuts[0]).all()  # the gas goes all the way round
    reach = places.highest[1] - places.lowest[1]
    assert reach == pytest.approx([0.4 - 1 / 16, 0.2 - 1 / 16], abs=1 / 16 + 1e-6)
    assert ((places.centroid[1] >= 0.0) & (places.centroid[1] < 1.0)).all()


def test_cut_is_in_the_widest_gap():
    occupied = np.zeros(10, bool)
    occupied[[0, 1, 8, 9]] = True
    assert cut_of(occupied, 2.0, 5.0) == pytest.approx(2.0 + 7.5 * 0.5)
    assert np.isnan(cut_of(np.ones(10, bool), 2.0, 5.0)) and np.isnan(cut_of(np.zeros(10, bool), 2.0, 5.0))


def test_no_number_of_threads_changes_a_digit():
    case = case_of(FULL)
    sums = []
    for threads in (1, 3):
        model = Model(case, threads=threads)
        model.stepper.prepare(fresh=True)
        sums.append(model.sums.form(KINDS))
    for kind in KINDS:
        for one, other in zip(vars(sums[0][kind]).values(), vars(sums[1][kind]).values(), strict=True):
            np.testing.assert_array_equal(one, other)


def test_forces_on_bodies_are_those_on_their_particles(device):
    run = run_of(FULL, device, end_time=0.02)
    load, body = run.model.wall_load(), run.model.particles.get("wall_body")
    bodies = len(run.model.geometry.body_names)
    found = run.model.sums.body_forces(load, bodies)
    expected = [load.numpy()[body == k + 1].astype(float).sum(axis=0) for k in range(bodies)]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    assert np.abs(found).max() > 0


@pytest.mark.parametrize("reach", [0.11, 0.6])
def test_nearby_rows_hold_all_within_reach(run, reach):
    model = run.model
    particles = model.particles
    points = np.array([[0.02, 0.5], [0.97, 0.98], [1.2, 0.5]])
    rows = Nearby(particles, model.launcher, Scene(model.case), reach).rows(points)
    position = particles.get("anchor")[: particles.fluid_count].astype(float) + particles.get("offset")
    way = position[:, None, :] - points
    way -= np.where(model.case.periodic, np.round(way), 0.0)  # the box is of size 1
    within = np.flatnonzero((np.linalg.norm(way, axis=2) < reach).any(axis=1))
    assert set(within) <= set(rows)
    assert len(rows) < len(position) or reach > 0.3


def test_samples_of_the_fluid_around_are_those_of_all(device):
    """A record copies the particles near the points alone, in any order of their rows."""
    run = run_of(PERIODIC, device, end_time=0.05)
    gauges = GaugeSet(run.case, eos=eos_of_run(run.case, run.physics.sound_speed, run.model.nominal_pressure))
    recorder = Recorder(run.model, gauges)
    record = recorder.take(["probe"])
    assert 0 < record.around.fluid_count < run.model.particles.fluid_count and not record.state.arrays
    recorder.write(record)
    snapshot = run.state
    box = [1.0, 1.0]
    expected = sample(snapshot, [[0.5, 0.5]], ["pressure", "velocity"], run.physics.support, box)
    row = gauges.series("probe")
    assert row["pressure"] == pytest.approx(expected["pressure"], rel=1e-9)
    assert row["velocity_x"] == pytest.approx(expected["velocity"][:, 0], rel=1e-9, abs=1e-12)


def test_copies_hold_the_wanted_fields_alone(run):
    everything = run.state
    part = copy_state(run.model, ["position", "volume", "particle_id"])
    assert part.arrays.keys() <= {"anchor", "offset", "rest_volume", "density_excess", "phase", "particle_id"}
    snapshot = part.snapshot()
    for name in ("position", "volume", "phase", "kind", "particle_id"):
        np.testing.assert_array_equal(getattr(snapshot, name), getattr(everything, name))
    assert np.isnan(snapshot.velocity).all() and np.isnan(snapshot.mass).all() and snapshot.normal is None
    assert len(copy_state(run.model, []).snapshot(ordered=False)) == 0


@pytest.mark.parametrize("name", ["energy", "momentum", "pressure", "extents", "rise", "strays", "contour"])
def test_needs_of_a_gauge_are_all_that_it_looks_at(name):
    """The row of a record, which has nothing but what the gauge needs, is that of a whole snapshot."""
    types = {"pressure": "phase_pressure", "rise": "phase_velocity"}
    run = run_of(FULL, end_time=0.02, gauges={name: {"type": types.get(name, name), "interval": 0.01}})
    rows = run.gauge(name)
    again = GaugeSet(run.case, eos=eos_of_run(run.case, run.physics.sound_speed, run.model.nominal_pressure))
    again.record(run.state)
    for column, values in again.series(name).items():
        assert rows[column][-1] == pytest.approx(values[-1], rel=1e-9, abs=1e-12, nan_ok=True), column
