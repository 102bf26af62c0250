"""scripts/peer_errors.py: an exact field has no error, a known disturbance the known one; exact fields are exact."""

import csv
import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
spec = importlib.util.spec_from_file_location("peer_errors", ROOT / "scripts" / "peer_errors.py")
errors = importlib.util.module_from_spec(spec)
spec.loader.exec_module(errors)

POINTS = np.random.default_rng(0).random((500, 2))
ROUNDING = 1e-12
CHANNEL = {"force": 1e-5, "viscosity": 0.01, "height": 1.0}


def columns(name, *wanted):
    with (ROOT / "cases" / "reference" / name).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return np.array([[float(row[key]) for key in wanted] for row in rows]).T


def test_vortices_that_are_exact_have_no_error():
    exact = errors.taylor_green(POINTS, 2.0, 100.0)
    assert errors.taylor_green_l1(POINTS, exact, 2.0, 100.0) == 0.0
    assert errors.taylor_green_l2(POINTS, exact, 2.0, 100.0) == 0.0


def test_vortices_too_fast_by_a_share_are_off_by_that_share():
    fast = 1.02 * errors.taylor_green(POINTS, 2.0, 100.0)
    assert errors.taylor_green_l1(POINTS, fast, 2.0, 100.0) == pytest.approx(0.02, rel=ROUNDING / 0.02)
    assert errors.taylor_green_l2(POINTS, fast, 2.0, 100.0) == pytest.approx(0.02, rel=ROUNDING / 0.02)


def test_vortices_that_turn_backwards_are_seen_by_the_vector_error_alone():
    back = -errors.taylor_green(POINTS, 0.5, 100.0)
    assert errors.taylor_green_l1(POINTS, back, 0.5, 100.0) == pytest.approx(0.0, abs=ROUNDING)
    assert errors.taylor_green_l2(POINTS, back, 0.5, 100.0) == pytest.approx(2.0, rel=ROUNDING)


def test_vortices_decay_as_the_reference_says():
    time, largest = columns("m_taylor_green_decay.csv", "t_U_over_L", "umax_over_U_Re100")
    found = [np.abs(errors.taylor_green(np.array([[0.0, 0.25]]), t, 100.0)).max() for t in time]
    assert found == pytest.approx(largest, rel=1e-5)  # figures that the file has


def test_the_drop_is_as_long_as_the_reference_says():
    time, tip = columns("a_elliptic_drop_exact.csv", "t_s", "b_semiaxis_y_m")
    assert [errors.stretched(t) for t in time[::40]] == pytest.approx(tip[::40], rel=1e-10)


def test_a_drop_is_measured_at_its_topmost_particle():
    tip = errors.stretched(0.0076)
    position = np.array([[0.0, tip - 0.05], [0.1, 0.0], [0.0, -tip]])
    assert errors.elliptic_drop(position, 0.0076) == pytest.approx(-0.05 / tip, rel=1e-10)
    assert errors.elliptic_drop(position, 0.0076, beyond=0.05) == pytest.approx(0.0, abs=ROUNDING)


def test_the_flow_of_a_channel_rests_at_first_and_is_a_parabola_at_last():
    y = np.linspace(0.0, 1.0, 41)
    peak = 1e-5 / (8 * 0.01)
    # what the series leaves out at the start is less than its tail, sum of 1/(2n + 1)^3 from SERIES on
    tail = 32 / math.pi**3 / (4 * (2 * errors.SERIES - 1) ** 2)
    assert errors.poiseuille_profile(y, 0.0, **CHANNEL) == pytest.approx(0.0, abs=tail * peak)
    assert errors.poiseuille_profile(y, 1e4, **CHANNEL) == pytest.approx(4 * peak * y * (1 - y), abs=ROUNDING * peak)


def test_the_flow_of_a_channel_solves_its_equation():
    y, time, d = np.array([0.1, 0.3, 0.5]), 5.0, 1e-3

    def u(shift_y, shift_t):
        return errors.poiseuille_profile(y + shift_y, time + shift_t, **CHANNEL)

    rate = (u(0, d) - u(0, -d)) / (2 * d)
    bend = (u(d, 0) - 2 * u(0, 0) + u(-d, 0)) / d**2
    assert rate == pytest.approx(1e-5 + 0.01 * bend, rel=1e-3)  # differences of second order, rounding 1e-16/d^2


def test_a_channel_too_fast_by_a_share_is_off_by_that_share():
    y = POINTS[:, 1]
    exact = errors.poiseuille_profile(y, 10.0, **CHANNEL)
    assert errors.poiseuille(y, exact, 10.0, **CHANNEL) == 0.0
    assert errors.poiseuille(y, 0.997 * exact, 10.0, **CHANNEL) == pytest.approx(0.003, rel=1e-9)


def test_a_tube_is_weighed_by_volume():
    # far left and right of all waves: the states of the start
    x, volume = np.array([-0.45, 0.45]), np.array([1.0, 3.0])
    assert errors.sod(x, np.array([1.0, 0.125]), volume, 0.15) == 0.0
    assert errors.sod(x, np.array([1.0, 0.225]), volume, 0.15) == pytest.approx(0.075, rel=ROUNDING)


def test_a_tube_between_its_waves_has_the_densities_of_the_star_state():
    # both sides of the contact at 0.927 t; the densities stand in cases/sod.yaml too
    x = np.array([0.2, 0.1])
    exact = np.array([0.2655737, 0.4263194])
    assert errors.sod(x, exact, np.ones(2), 0.15) == pytest.approx(0.0, abs=1e-7)


def test_the_jump_of_a_drop_leaves_out_the_layer_around_it():
    centre, radius, tension = np.array([0.5, 0.5]), 0.15, 2.0
    distance = np.linalg.norm(POINTS - centre, axis=1)
    jump = tension / radius
    pressure = np.where(distance < 0.5 * radius, 7.0 + jump, np.where(distance > 1.7 * radius, 7.0, 1e6))
    assert errors.laplace_jump(POINTS, pressure, centre, radius, tension) == pytest.approx(0.0, abs=1e-12)
    pressure[distance < 0.5 * radius] -= 0.05 * jump
    assert errors.laplace_jump(POINTS, pressure, centre, radius, tension) == pytest.approx(-0.05, abs=1e-12)
    with pytest.raises(ValueError, match="no particle within"):
        errors.laplace_jump(POINTS + 10.0, pressure, centre, radius, tension)
