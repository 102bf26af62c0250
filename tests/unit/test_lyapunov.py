"""Lyapunov exponents: exact flows, the double gyre on a grid, shifts that must change nothing, windows, births, files."""

import copy

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.drifting import BOTH, VORTICES, along, at, back, case_of, double_gyre, exponent, prepared, vortices
from tests.unit.test_open_sides import THROUGH
from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.engine.program import walk
from warpsph.errors import CaseError
from warpsph.files.vtp import read_vtp
from warpsph.kernels.core import clock as ck
from warpsph.running.memory import count as count_particles
from warpsph.running.memory import expected_on_device
from warpsph.running.model import Model
from warpsph.scene.physics import support_radius
from warpsph.schemes import registry


@pytest.fixture(autouse=True)
def known():
    """The scheme of given flows is forgotten after each test."""
    yield
    if "drifting" in registry.names():
        registry.unregister("drifting")


# flows whose exponent is known --------------------------------------------------------------------------------


@pytest.mark.parametrize("chance", [0.0, 0.01])
def test_a_strain_has_its_rate(device, chance):
    """u = (x, -y): 1/s whatever the window, with shifts and without. Shifts change nothing: X is linear in x.

    Looked at where no rim of the cloud is in reach, three spacings beyond the support.
    """
    model = along("strain", [-1, -1], [1, 1], 1 / 16, "open", window=0.5, device=device, chance=chance)
    for time, age in ((0.25, 0.25), (0.5, 0.5), (0.75, 0.5)):
        fluid = at(model, time)
        inside = (np.abs(fluid.position) < [0.4, 0.15]).all(axis=1)
        assert inside.sum() > 50
        np.testing.assert_allclose(fluid.ftle_age, age, rtol=1e-9)
        assert np.abs(fluid.ftle_backward[inside] - 1).max() < 1e-3
        assert np.abs(fluid.ftle_forward[inside] - 1).max() < 1e-3


def test_a_strain_in_space_has_its_rate(device):
    """u = (x, -y, 0)."""
    model = along("strain", [-0.75] * 3, [0.75] * 3, 1 / 8, "open", window=0.25, device=device, chance=0.01)
    fluid = at(model, 0.25)
    inside = (np.abs(fluid.position) < 0.2).all(axis=1)
    assert inside.sum() > 20
    assert np.abs(fluid.ftle_backward[inside] - 1).max() < 1e-3
    assert np.abs(fluid.ftle_forward[inside] - 1).max() < 1e-3


def test_a_rotation_has_none(device):
    model = along("rotation", [-1, -1], [1, 1], 1 / 16, "open", window=1.0, device=device, chance=0.01)
    fluid = at(model, 0.9)
    inside = np.linalg.norm(fluid.position, axis=1) < 0.5
    assert max(np.abs(fluid.ftle_backward[inside]).max(), np.abs(fluid.ftle_forward[inside]).max()) < 1e-3


@pytest.mark.parametrize("threads", [1, 2])
def test_ways_go_on_across_periodic_sides(device, threads):
    """u = (1 + 0.2 sin 2 pi y, 1/2): after 2 s all fluid is (2, 1) on, twice and once around the box, and not strained.

    On the way, at 1 s, it is strained: the exponent of a shear.
    """
    keys = {"device": device, "threads": threads, "chance": 0.01}
    model = along("stream", [0, 0], [1, 1], 1 / 16, "periodic", window=2.0, **keys)
    halfway = at(model, 1.0)
    # y is by half a period further: all of x follows from sin over that half, (0.4/pi) (cos 2 pi y - cos 2 pi y_0)/2
    shear = 0.8 * np.abs(np.sin(2 * np.pi * halfway.position[:, 1]))
    exact = np.log(shear / 2 + np.sqrt(shear**2 / 4 + 1))
    assert np.abs(halfway.ftle_backward - exact).max() < 0.05 * exact.max()
    assert np.abs(halfway.ftle_forward - exact).max() < 0.05 * exact.max()
    for time in (2.0, 3.0):
        fluid = at(model, time)
        np.testing.assert_allclose(fluid.ftle_age, 2.0, rtol=1e-9)
        assert np.abs(fluid.ftle_way - [2.0, 1.0]).max() < 0.01 / 16
        assert max(fluid.ftle_backward.max(), fluid.ftle_forward.max()) < 0.01


def test_ridges_of_the_double_gyre(device):
    """Against the exact flow map on a grid, with differences over a spacing: the field, and where its ridges are.

    Ridges are the tenth of the plane where the exponent is highest, away from the walls by the support: those along
    the walls are seen from one side.
    """
    spacing, time = 1 / 32, 10.0
    keys = {"time_step": 0.1, "even": 0.05}
    model = along("double_gyre", [0, 0], [2, 1], spacing, "wall", window=time, starts=1, device=device, **keys)
    fluid = at(model, time)
    exact = exponent(double_gyre, fluid.position, time, 0.0, spacing)
    assert np.corrcoef(fluid.ftle_backward, exact)[0, 1] > 0.9
    start = fluid.position - fluid.ftle_way
    assert np.corrcoef(fluid.ftle_forward, exponent(double_gyre, start, 0.0, time, spacing))[0, 1] > 0.8
    fine = [(np.arange(n) + 0.5) * spacing / 3 for n in (192, 96)]
    grid = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1).reshape(-1, 2)
    sets = []
    for place, values in ((grid, exponent(double_gyre, grid, time, 0.0, spacing)), (fluid.position, fluid.ftle_backward)):
        inside = (np.abs(place - [1.0, 0.5]) < np.array([1.0, 0.5]) - model.physics.support).all(axis=1)
        sets.append(place[inside & (values > np.quantile(values[inside], 0.9))])
    ridge, found = sets
    to_ridge, to_found = cKDTree(ridge).query(found)[0], cKDTree(found).query(ridge)[0]
    assert np.quantile(to_ridge, 0.9) < spacing and np.quantile(to_found, 0.9) < spacing


# schemes --------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("numerics", [
    {"scheme": "riemann"}, {"scheme": "delta_plus"}, {"scheme": "delta_plus", "integrator": "rk4"}, {"scheme": "isph"},
])  # fmt: skip
def test_places_are_those_of_the_fluid_whatever_the_shift(device, numerics):
    """Taylor-Green vortices: X against the exact flow map, and against where the particle itself began.

    What a shift moves is no longer the fluid that it was. The particle is off by the shifts of its way; X must be off by
    less than half of that, or it would not follow them.
    """
    model = prepared(case_of(VORTICES, numerics=numerics), device)
    begun = model.snapshot().fluid.position
    assert model.physics.spec.shifting
    fluid = at(model, 0.2)
    exact = back(vortices, fluid.position, 0.2, 0.0)
    error = np.linalg.norm(fluid.position - fluid.ftle_way - exact, axis=1)
    off = begun[fluid.particle_id] - exact
    off = np.linalg.norm(off - np.round(off), axis=1)
    assert np.median(error) < 0.5 * np.median(off), (np.median(error) * 32, np.median(off) * 32)
    assert np.corrcoef(fluid.ftle_backward, exponent(vortices, fluid.position, 0.2, 0.0, 1 / 32))[0, 1] > 0.95


def test_without_shift_places_are_where_particles_began(device):
    changes = {"numerics": {"scheme": "riemann", "shifting": 0, "pressure_gradient": "conservative"}}
    model = prepared(case_of(VORTICES, **changes, precision="float64"), device)
    begun = model.snapshot().fluid.position
    fluid = at(model, 0.1)
    assert "origin_change" not in model.particles.arrays
    off = (fluid.position - fluid.ftle_way) - begun[fluid.particle_id]
    np.testing.assert_allclose(off, np.round(off), atol=1e-12)


@pytest.mark.parametrize("scheme", ["riemann", "isph"])
def test_a_restart_goes_on_bit_by_bit(device, scheme):
    case = case_of(VORTICES, **{"particle_spacing": 1 / 16, "numerics": {"scheme": scheme}})
    model = prepared(case, device)
    before = at(model, 0.12)
    state = model.save_state()
    first = at(model, 0.25)
    again = Model(case, device=device, threads=1, fresh=False)
    again.load_state(state)
    again.stepper.prepare(fresh=False)
    here, second = again.snapshot().fluid, at(again, 0.25)
    for name in ("ftle_backward", "ftle_forward", "ftle_age", "ftle_way", "position"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
        np.testing.assert_array_equal(getattr(before, name), getattr(here, name))
    assert np.array_equal(model.particles.get("origin"), again.particles.get("origin"))


def test_windows_follow_each_other(device):
    """Three windows of 0.3 s: the oldest is complete at multiples of 0.1 s, and a third of it shorter right after."""
    model = along("rotation", [-1, -1], [1, 1], 1 / 8, "open", window=0.3, starts=3, device=device, time_step=0.01)
    for time, age in ((0.15, 0.15), (0.3, 0.3), (0.35, 0.25), (0.4, 0.3), (0.7, 0.3), (1.25, 0.25)):
        np.testing.assert_allclose(at(model, time).ftle_age, age, rtol=1e-9)


@pytest.mark.parametrize("scheme", ["riemann", "isph"])
def test_what_enters_is_followed_from_its_birth(device, scheme):
    """Uniform flow through an inlet: nothing is strained, and the way is the velocity times the age of each particle.

    But for those that fill the buffers at first, which do not move in the first step of ISPH.
    """
    changes = {"numerics": {"scheme": scheme}, "output": {"lyapunov": {"window": 9.0, "direction": BOTH}}}
    model = prepared(case_of(THROUGH, **changes), device)
    filled = range(model.geometry.count, int(model.stepper.read()[1][ck.NEXT_ID]))
    fluid = at(model, 1.1)
    born = fluid.ftle_age < 1.05
    assert fluid.ftle_age.max() == pytest.approx(1.1, rel=1e-6) and 20 < born.sum() < len(born) - 20
    off = fluid.ftle_way - np.outer(fluid.ftle_age, [1.0, 0.0])
    assert np.abs(off[~np.isin(fluid.particle_id, filled)]).max() < 0.1 * 0.1
    assert np.abs(fluid.ftle_backward).max() < 0.1
    assert np.abs(fluid.ftle_forward).max() < 0.1 and not fluid.ftle_forward[born].any()


# what a run is made of --------------------------------------------------------------------------------------


def test_nothing_is_there_where_nobody_asks(device):
    case = case_of(VORTICES, **{"output.lyapunov": "none"})
    model = Model(case, device=device, threads=1)
    names = {node.name for node in walk(model.stepper.program.step)}
    assert not model.particles.arrays.keys() & {"origin", "origin_change", "born", "ftle_backward", "ftle_way"}
    assert not names & {"turn_windows", "carry_origins", "follow_shift"}
    assert model.snapshot().ftle_backward is None


def test_memory_is_told(device):
    """A window takes two places a particle, and copies of both to sort them: 32 bytes in a plane in single precision.

    Of large scenes fewer fields are copied at once.
    """

    def bytes_of(starts):
        case = case_of(VORTICES, **{"output.lyapunov": {"window": 0.2, "starts": starts}})
        found = count_particles(case, support_radius(case))
        return expected_on_device(case, found) / found.fluid

    assert bytes_of(5) - bytes_of(1) == pytest.approx(4 * 32)


def test_exponents_are_written(device, tmp_path):
    run = Simulation(case_of(VORTICES, particle_spacing=1 / 16), output=tmp_path / "run", device=device, threads=1).run()
    written = read_vtp(sorted((tmp_path / "run" / "particles").glob("fluid_*.vtp"))[-1], 2)
    for name in ("ftle_backward", "ftle_forward", "ftle_age", "ftle_way"):
        np.testing.assert_allclose(getattr(written, name), getattr(run.state, name), rtol=1e-6, atol=1e-6)
    assert written.ftle_backward.max() > 1.0


@pytest.mark.parametrize(("keys", "path"), [
    ({"output": {"lyapunov": {"window": 1.0, "starts": 0}}}, "output.lyapunov.starts"),
    ({"output": {"lyapunov": {"window": 1.0, "direction": ["up"]}}}, "output.lyapunov.direction"),
    ({"output": {"particles": "none", "lyapunov": {"window": 1.0}}}, "output.lyapunov"),
])  # fmt: skip
def test_what_cannot_be_is_refused(keys, path):
    with pytest.raises(CaseError) as caught:
        Case.from_dict({**copy.deepcopy(VORTICES), **keys})
    assert [problem.path for problem in caught.value.problems] == [path]


def test_a_scheme_that_does_not_follow_is_refused(monkeypatch):
    monkeypatch.setattr(type(registry.find("riemann")), "follows_origins", False)
    with pytest.raises(CaseError, match="does not follow where particles were"):
        Case.from_dict(copy.deepcopy(VORTICES))
