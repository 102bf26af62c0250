"""Relaxation of the pressure: standing waves die out at the rate of the dispersion relation, flow without sound does not."""

import numpy as np
import pytest
import warp as wp

from tests.open_scenes import THROUGH, scene
from warpsph.case.case import Case
from warpsph.errors import CaseError
from warpsph.kernels.riemann.relaxation import make_late
from warpsph.running.model import Model

SOUND, LENGTH = 10.0, 1.0
BOX = {
    "dimension": 2,
    "particle_spacing": 1 / 40,
    "end_time": 1.0,
    "domain": {"lower": [0, 0], "upper": [LENGTH, 0.3], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {"water": {"density": 2.0, "sound_speed": SOUND, "gamma": 1}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "numerics": {"velocity_dissipation": 0},
}


def run(start, time, relaxation, **more):
    """The model of the fluid at a time [s]."""
    case = Case.from_dict(BOX | {"start": start, **more}).replace({"numerics.acoustic_relaxation": relaxation})
    model = Model(case, threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(time, 10**9)
    return model


def mode(model):
    """Share of a wave of the length of the box in density, velocity and settled pressure: the first two as speeds [m/s]."""
    fluid = model.snapshot().fluid
    volume = fluid.mass / fluid.density
    wave = 2 * np.pi * fluid.position[:, 0] / LENGTH
    excess = 2 * (volume * (fluid.density / 2.0 - 1.0) * np.cos(wave)).sum() / volume.sum()
    moved = 2 * (volume * fluid.velocity[:, 0] * np.sin(wave)).sum() / volume.sum()
    return SOUND * excess, moved


def exact(start, time, relaxation, tau):
    """The same of the linear equations: c s, u and c P/(rho c^2) of one wave."""
    k = 2 * np.pi / LENGTH
    rates = np.array(
        [[0.0, -SOUND * k, 0.0], [SOUND * k * (1 + relaxation), 0.0, -SOUND * k * relaxation], [1 / tau, 0.0, -1 / tau]]
    )
    values, vectors = np.linalg.eig(rates)
    return np.real(vectors @ (np.exp(values * time) * np.linalg.solve(vectors, [start, 0.0, start])))[:2]


@pytest.mark.parametrize("relaxation, tau", [(0.25, 0.03), (1.0, 0.015), (1.0, 0.06)])
def test_a_standing_wave_dies_out_as_the_linear_equations_say(relaxation, tau):
    """0.12 s, nearly two periods: both parts of the wave within 5 % of the start, of which up to 88 % have gone.

    The slope of the kernel sees this wave 2 % short; at half the spacing the errors are half as large.
    """
    model = run({"pressure": "0.2*cos(2*pi*x)"}, 0.12, relaxation, numerics=BOX["numerics"] | {"relaxation_time": tau})
    start = 0.2 / (2.0 * SOUND**2) * SOUND
    assert mode(model) == pytest.approx(exact(start, model.time, relaxation, tau), abs=0.05 * start)
    assert abs(np.hypot(*exact(start, model.time, relaxation, tau))) < 0.8 * start


def test_late_follows_and_does_not_overshoot():
    late = make_late("float64")

    @wp.kernel(module="unique")
    def follow(dt: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        i = wp.tid()
        out[i] = late(wp.float64(3.0), wp.float64(1.0), dt[i], wp.float64(0.5))

    out = wp.zeros(3, dtype=wp.float64, device="cpu")
    wp.launch(follow, 3, inputs=[wp.array([0.0, 0.5, 1e9], dtype=wp.float64, device="cpu"), out], device="cpu")
    assert out.numpy() == pytest.approx([1.0, 2.0, 3.0])


def test_vortices_lose_nothing_to_it():
    """A fluid without viscosity; a shear viscosity m rho c^2 tau would have taken all of it at once."""
    square = BOX["domain"] | {"upper": [1, 1]}
    swirl = ["sin(2*pi*x)*cos(2*pi*y)", "-cos(2*pi*x)*sin(2*pi*y)"]
    start = {"velocity": swirl, "pressure": "0.5*(cos(4*pi*x) + cos(4*pi*y))"}
    energies = []
    for relaxation in (0.0, 1.0):
        fluid = run(start, 0.2, relaxation, domain=square, numerics={}).snapshot().fluid
        energies.append((fluid.mass * (fluid.velocity**2).sum(axis=1)).sum())
    assert energies[0] * 0.999 < energies[1] < 1.0


def test_between_inlets_and_outlets_it_is_refused():
    with pytest.raises(CaseError, match="acoustic_relaxation.*inlets and outlets"):
        scene(THROUGH, numerics__acoustic_relaxation=0.5)
