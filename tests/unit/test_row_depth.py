"""Depth of rows at a free surface of ISPH: water at rest stays so, small waves have their frequency (theory: isph#b4)."""

import numpy as np
import pytest
import warp as wp
from scipy.optimize import curve_fit

from warpsph.case.case import Case
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.isph.regularise import EVENING, make_followed
from warpsph.schemes.isph_physics import row_strain
from warpsph.simulation import Simulation

GRAVITY = 9.81


def water(spacings, depth, end_time, sides="periodic", **more):
    """A basin of 1 m with so many spacings along it."""
    return Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": 1 / spacings,
            "end_time": end_time,
            "gravity": [0, -GRAVITY],
            "domain": {
                "lower": [0, 0],
                "upper": [1, 1.5 * depth],
                "boundary": {"x": sides, "y": {"lower": {"wall": "free_slip"}, "upper": "open"}},
            },
            "phases": {"water": {"density": 1000}},
            "fluids": [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, depth]}}}],
        }
        | more
    )


@pytest.mark.parametrize("noise, still", [(0.0, 1e-4), (0.1, 0.03)])
def test_water_at_rest_stays_at_rest(noise, still):
    """For 3 s, ten of its swings; by the depth of the spread waves of three spacings grow to 0.02 and 0.4 m/s."""
    case = water(16, 1.0, 3.0, "wall", numerics={"scheme": "isph"}, start={"noise": noise})
    fluid = Simulation(case, threads=1).run().state.fluid
    assert np.linalg.norm(fluid.velocity, axis=1).max() < still


def test_a_small_wave_has_its_frequency():
    """24 spacings a wave, 5 mm high: 1.0 % slow, 4.8 % by the depth of the spread, second order."""
    k, depth, height = 2 * np.pi, 0.5, 0.005
    rate = np.sqrt(GRAVITY * k * np.tanh(k * depth))
    share = f"{height * rate / np.sinh(k * depth)}"
    start = {"velocity": [f"-{share}*cosh({k}*y)*sin({k}*x)", f"{share}*sinh({k}*y)*cos({k}*x)"]}
    period = 2 * np.pi / rate
    gauges = {"energy": {"type": "energy", "interval": period / 50}}
    numerics = {"scheme": "isph", "maximum_step": period / 200}
    energy = (
        Simulation(water(24, depth, 1.5 * period, start=start, gauges=gauges, numerics=numerics), threads=1)
        .run()
        .gauge("energy")
    )

    def swing(t, high, frequency, loss, low):
        return high * np.exp(-loss * t) * np.cos(2 * np.pi * frequency * t) ** 2 + low

    kinetic = energy["kinetic"] / energy["kinetic"][0]
    (_, frequency, loss, _), _ = curve_fit(swing, energy["time"] / period, kinetic, [1, 1, 0, 0])
    assert frequency == pytest.approx(1.0, abs=0.02)
    assert abs(loss) < 0.06


@pytest.mark.parametrize("ratio", [1.25, 1.5, 2.0])
def test_row_strain_is_the_lag_of_the_gradient_of_a_row(ratio):
    """Of the wave exp(kz) cos kx a gradient that is exact for linear fields has k (1 - ck) at the first row of a lattice."""
    h, k = ratio, 1e-4
    x, z = (a.ravel().astype(float) for a in np.meshgrid(np.arange(-9, 10), np.arange(-9, 1)))
    q = np.hypot(x, z) / h
    near = (q > 0) & (q < 2)
    weight = np.zeros_like(q)
    weight[near] = (1 - q[near] / 2) ** 3  # -W'/r of Wendland C2 but for a factor
    wave = np.exp(k * z) * np.cos(k * x) - 1
    gradient = (weight * z * wave).sum() / (weight * z * z).sum()
    lag = (1 - gradient / k) / k
    spec = Spec(dimension=2, precision="float64", kernel="wendland_c2")
    assert row_strain(spec, ratio, 0.5) == pytest.approx(1 + lag / 0.5, rel=1e-3)
    assert row_strain(spec, ratio, 0.0) == 1.0


def test_depth_is_stretched_with_the_fluid_and_goes_to_that_of_the_spread():
    followed = make_followed(2, "float64")

    @wp.kernel(module="unique")
    def follow(across: wp.array(dtype=wp.float64), dt: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        i = wp.tid()
        zero = wp.float64(0.0)
        up = wp.vec2d(zero, wp.float64(1.0))
        gradient = wp.mat22d(-across[i], zero, zero, across[i])
        out[i] = followed(wp.float64(1.2), wp.float64(0.7), up, gradient, wp.float64(1.5), dt[i])

    across, dt = np.array([0.0, 1e-3, 1e9, -1e9]), np.array([1.0, 1.0, 1.0, 1.0])
    out = wp.zeros(4, dtype=wp.float64, device="cpu")
    wp.launch(follow, 4, inputs=[wp.array(across, device="cpu"), wp.array(dt, device="cpu"), out], device="cpu")
    stretched = 1.2 * np.exp(1.5e-3)
    slow = stretched + EVENING * np.sqrt(2) * 1e-3 * (0.7 - stretched)
    rest, soft, up, down = out.numpy()
    assert rest == 1.2  # no flow, no change, whatever the spread
    assert soft == pytest.approx(slow, rel=1e-12)
    assert [up, down] == pytest.approx([0.7, 0.7])  # spray
