"""Damping of sound: the rate at which a standing wave dies out, and a flow without divergence that it leaves alone."""

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.running.model import Model

SOUND = 10.0
BOX = {
    "dimension": 2,
    "particle_spacing": 1 / 24,
    "end_time": 1.0,
    "domain": {"lower": [0, 0], "upper": [1, 0.5], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {"water": {"density": 2.0, "sound_speed": SOUND, "gamma": 1}},
    "fluids": [{"phase": "water", "shape": "rest"}],
}


def run(start, time, damping, scheme="riemann", **more):
    """The fluid at a time [s]."""
    case = Case.from_dict(BOX | {"start": start, "numerics": {"scheme": scheme}, **more})
    case = case.replace({"numerics.acoustic_damping": damping})
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(time, 10**9)
    return model.snapshot().fluid, model


def amplitude(damping, time, scheme):
    """What is left of the kinetic and elastic energy of a standing wave of the length of the box, a root of it."""
    fluid, model = run({"pressure": "0.2*cos(2*pi*x)"}, time, damping, scheme)
    volume = fluid.mass / fluid.density
    mode = np.cos(2 * np.pi * fluid.position[:, 0])
    excess = (volume * (fluid.density / 2.0 - 1.0) * mode).sum()
    moved = (volume * fluid.velocity[:, 0] * np.sin(2 * np.pi * fluid.position[:, 0])).sum()
    return float(np.hypot(SOUND * excess, moved)), model.physics.h


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus"])
@pytest.mark.parametrize("damping", [0.125, 0.25, 0.5])
def test_a_standing_wave_dies_out_at_the_rate_of_its_bulk_viscosity(damping, scheme):
    """zeta k^2/(2 rho) with zeta = alpha rho c h: the mode is left with exp(-rate t) of what it has without."""
    time = 0.3
    free, h = amplitude(0.0, time, scheme)
    damped, _ = amplitude(damping, time, scheme)
    rate = 0.5 * damping * SOUND * h * (2 * np.pi) ** 2
    # the slope of the kernel sees a wave of 16 smoothing lengths 4 % short, and so its rate 4 to 8 %
    assert -np.log(damped / free) / (rate * time) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("scheme", ["riemann", "delta_plus"])
def test_vortices_lose_nothing_to_it(scheme):
    square = BOX["domain"] | {"upper": [1, 1]}
    swirl = ["sin(2*pi*x)*cos(2*pi*y)", "-cos(2*pi*x)*sin(2*pi*y)"]
    start = {"velocity": swirl, "pressure": "0.5*(cos(4*pi*x) + cos(4*pi*y))"}
    energies = []
    for damping in (0.0, 0.5):
        fluid, _ = run(start, 0.2, damping, scheme, domain=square)
        energies.append((fluid.mass * (fluid.velocity**2).sum(axis=1)).sum())
    # a shear viscosity as large as this bulk viscosity would have taken all of it
    assert energies[1] == pytest.approx(energies[0], rel=2e-3)


def test_two_fluids_have_none():
    drop = {"phase": "oil", "shape": {"sphere": {"center": [0.5, 0.25], "radius": 0.1}}}
    phases = {"water": {"density": 2.0}, "oil": {"density": 1.0}}
    with pytest.raises(CaseError, match="acoustic_damping"):
        Case.from_dict(BOX | {"phases": phases, "fluids": [drop, *BOX["fluids"]], "numerics": {"acoustic_damping": 0.1}})


def test_bodies_before_a_free_surface_have_none():
    """Pressure differences of bodies drive the density with the conservative gradient, which the damping would feed."""
    tank = BOX["domain"] | {"upper": [1, 1], "boundary": {"x": "wall", "y": {"lower": "wall", "upper": "open"}}}
    pool = {"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}}
    bodies = {"ball": {"shape": {"sphere": {"center": [0.5, 0.25], "radius": 0.13}}}}
    case = Case.from_dict(BOX | {"domain": tank, "fluids": [pool], "gravity": [0, -1.0], "bodies": bodies})
    assert Model(case, threads=1).physics.choices["acoustic_damping"] == 0
    with pytest.raises(CaseError, match="corrected pressure gradient"):
        Model(case.replace({"numerics.acoustic_damping": 0.25}), threads=1)


def test_runge_kutta_and_the_printed_form_have_none():
    """A damper takes the divergence of the step before, of which the stages of Runge and Kutta have none."""

    def choice(changes):
        case = Case.from_dict(BOX | {"numerics": {"scheme": "delta_plus"}}).replace(changes)
        return Model(case, threads=1).physics.choices["acoustic_damping"]

    assert choice({}) == 0.25
    assert choice({"numerics.integrator": "rk4"}) == choice({"numerics.formulation": "paper"}) == 0.0
    with pytest.raises(CaseError, match="rk4"):
        choice({"numerics.integrator": "rk4", "numerics.acoustic_damping": 0.25})


@pytest.mark.parametrize(("damping", "bears", "fails"), [(0.0, 1.7, 1.8), (0.25, 1.5, 1.6), (0.5, 1.3, 1.4)])
def test_what_courant_number_damping_leaves(damping, bears, fails):
    """(1.136 C)^2 + 2.6 alpha C = 4 at 1.76, 1.53, 1.33: sound of the shortest waves on even rows (theory: delta#d1)."""

    def largest(courant):
        start = {"pressure": "1e-3*cos(24*pi*x) + 1e-3*cos(12*pi*y)"}
        numerics = {"scheme": "delta_plus", "courant": courant, "acoustic_damping": damping}
        numerics |= {"density_diffusion": 0, "shifting": 0}
        model = Model(Case.from_dict(BOX | {"start": start, "numerics": numerics, "precision": "float64"}), threads=1)
        model.stepper.prepare(fresh=True)
        model.stepper.run(1e9, 300)
        return float(np.abs(model.particles.get("density_excess")[: model.particles.fluid_count]).max())

    assert largest(bears) < 1e-4 < 1e-3 < largest(fails)
