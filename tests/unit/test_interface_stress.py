"""Friction at the interface of two fluids of other viscosities: flows whose viscous forces are known exactly."""

import math

import numpy as np
import pytest

from warpsph.simulation import Simulation

TWO_PI = 2 * math.pi


def forces(velocity, viscosity, spacings, pressure=0, noise=0.0):
    """Place (n, 2), viscous force (n, 2) and phase (n,) of the particles of a disc of radius 1 and of what is around it.

    The force is the momentum of three tiny steps less that of the same without viscosity and `pressure`, over their time:
    pressures that these steps make are nought. Jumps of the pressure that viscosity brings are in it, and what the
    pressure makes that the flow starts with.
    """
    found = []
    for on in (1, 0):
        names = ("drop", "matrix")
        phases = {
            name: {"density": 1, "viscosity": on * mu, "sound_speed": 20} for name, mu in zip(names, viscosity, strict=True)
        }
        case = {
            "dimension": 2,
            "particle_spacing": 1 / spacings,
            "end_time": 3e-7,
            "precision": "float64",
            "domain": {"lower": [-2.5, -2.5], "upper": [2.5, 2.5], "boundary": {"x": "free_slip", "y": "free_slip"}},
            "phases": phases,
            "fluids": [
                {"phase": "drop", "shape": {"sphere": {"center": [0, 0], "radius": 1}}},
                {"phase": "matrix", "shape": "rest"},
            ],
            "start": {"velocity": velocity, "pressure": pressure if on else 0, "noise": noise},
            "numerics": {"maximum_step": 1e-7, "acoustic_relaxation": 0},
            "output": {"particles": "none", "checkpoint": "none"},
        }
        state = Simulation(case, threads=1).run().state
        found.append((state.position, state.velocity / state.time, state.phase, state.mass))
    (place, push, phase, mass), (_, rest, _, _) = found
    near = np.linalg.norm(place, axis=1) < 2
    return place[near], (mass[:, None] * (push - rest))[near], phase[near]


def along(place, force):
    """Moment of the forces about the middle (n,)."""
    return place[:, 0] * force[:, 1] - place[:, 1] * force[:, 0]


@pytest.mark.parametrize("viscosity", [(10.0, 1.0), (1.0, 10.0)])
def test_fluids_that_turn_together_feel_no_friction(viscosity):
    """On any arrangement; shared evenly, what pairs lack would drive the two against each other by 0.4 of it."""
    place, force, phase = forces(["-y", "x"], viscosity, 16)
    for side in (0, 1):
        assert abs(along(place, force)[phase == side].sum()) < 1e-4 * 9 * TWO_PI


@pytest.mark.parametrize("viscosity", [(10.0, 1.0), (1.0, 10.0), (5.0, 5.0)])
def test_straining_pulls_with_twice_the_difference_of_viscosities(viscosity):
    """The work of the forces on v = (x, -y) is 2 (mu_outside - mu_inside) times that of n: of first order, 6 % at 12."""
    inside, outside = viscosity
    exact = 2 * (outside - inside) * TWO_PI
    errors = []
    for spacings in (12, 24):
        place, force, _ = forces(["x", "-y"], viscosity, spacings)
        work = (force * place * [1, -1]).sum()
        errors.append(abs(work - exact) / (2 * max(viscosity) * TWO_PI))
    assert errors[0] < 0.08 and errors[1] < 0.04


def drop_in_strain(ratio):
    """Flow of a round drop without tension in a straining one (2-D, no inertia): its velocity, pressure, and strain a.

    Inside v_r = a r cos 2t and p = 0, outside v_r = (r + b/r + c/r^3) cos 2t and p = 2 b cos 2t/r^2, with a = 2/(1 + ratio),
    b = 2 a - 2, c = 1 - a: tractions are the same on both sides, and there is no force anywhere.
    """
    a = 2 / (1 + ratio)
    b, c = 2 * a - 2, 1 - a
    r = "maximum(r, 0.5)"
    radial = f"where(r < 1, {a}*r, r + {b}/{r} + {c}/{r}**3)*(x*x - y*y)/maximum(r, 1e-9)**3"
    turning = f"-where(r < 1, {a}*r, r - {c}/{r}**3)*2*x*y/maximum(r, 1e-9)**3"
    velocity = [f"({radial})*x - ({turning})*y", f"({radial})*y + ({turning})*x"]
    return velocity, f"where(r < 1, 0, {2 * b}*(x*x - y*y)/{r}**4)", a


@pytest.mark.parametrize("ratio", [0.1, 10.0])
def test_a_drop_in_strain_has_the_traction_of_the_exact_flow(ratio):
    """Inside there is no force but at the interface, where the tangential ones of both fluids are balanced."""
    velocity, _, strain = drop_in_strain(ratio)
    place, force, phase = forces(velocity, (ratio, 1.0), 16)
    length = np.linalg.norm(place, axis=1)
    weight = -2 * place[:, 0] * place[:, 1] / length**3
    tangential = (weight * along(place, force))[phase == 0].sum()
    traction = max(ratio, 1.0) * strain * TWO_PI
    assert abs(tangential) < 0.1 * traction


def rows_that_see_across(ratio):
    """How many rows below a plane have what particles across it tell them of a slope along it, and nothing else.

    The sum over rows, half a spacing deep and so on, of the share of sum F t^2 V that lies across the plane, F of
    Wendland's C2 with h `ratio` spacings.
    """
    t, y = np.meshgrid(np.arange(-6, 7), np.arange(-6, 7))
    weight = np.maximum(1 - np.hypot(t, y) / (2 * ratio), 0) ** 3 * t**2
    return sum(weight[y > row + 0.5].sum() for row in range(6)) / weight.sum()


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_forces_do_no_work_on_the_strain_of_a_thick_drop(noise):
    """The jump 2 (mu - 1) a cos 2t of its pressure varies along the surface; in the exact flow there is no force at all.

    Pairs that have it of one place do not see that slope where they reach across, and lack 4 pi (mu - 1) a times the length
    that they reach, of first order. What is left must be less.
    """
    ratio, spacings = 10.0, 16
    velocity, pressure, strain = drop_in_strain(ratio)
    place, force, _ = forces(velocity, (ratio, 1.0), spacings, pressure, noise)
    near = np.linalg.norm(place, axis=1) < 1.5  # the sides of the domain are not in the exact flow
    work = (force * place * [1, -1])[near].sum()
    lacking = 2 * TWO_PI * (ratio - 1) * strain * rows_that_see_across(1.5) / spacings
    assert abs(work) < lacking
