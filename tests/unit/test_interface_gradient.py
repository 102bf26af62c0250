"""Velocity gradient at an interface from its more viscous side, and what it makes of friction there (theory: riemann#a4)."""

import dataclasses

import numpy as np
import pytest

from tests.helpers import Fluid
from tests.unit.test_interface_flow import FLAT, SHEAR, SOLID, SPACING, STRAIN, TURN, flat, middle, near
from warpsph.case.case import Case
from warpsph.kernels.riemann.riemann_fields import RIEMANN_FIELDS
from warpsph.running.model import Model
from warpsph.schemes import riemann_program as riemann

VISCOUS = {"viscosity": "morris", "unlike_viscosity": True}
PLANE, SPACE = dataclasses.replace(FLAT, **VISCOUS), dataclasses.replace(SOLID, **VISCOUS)
WIDTH = {2: 160, 3: 260}


def layers(spec, device, velocity=None, jitter=0.0, thick=0, **options):
    """Return (bench, place (n, d), rows of the more viscous phase beside the interface), after both stages have run."""
    viscosity = (10.0, 1.0) if thick == 0 else (1.0, 10.0)
    fluids = tuple(Fluid(density=1.0, viscosity=mu) for mu in viscosity)
    bench, x = flat(spec, jitter, device=device, fluids=fluids, width=WIDTH[spec.dimension], **options)
    if velocity is not None:
        bench.put("velocity", velocity(x))
    bench.put("gradient_at_interface", 7.0)
    bench.run(*riemann.sides(bench.spec))
    beside = near(bench) & middle(bench, x, 0.8) & (np.abs(x[:, -1]) < 2.5 * SPACING)
    faces = np.linalg.norm(bench.get("facing"), axis=1) > 0  # not at the edge of the support, where no side is to be seen
    return bench, x, beside & faces & (bench.get("phase") == thick)


@pytest.mark.parametrize("spec", [PLANE, SPACE])
def test_a_linear_flow_has_its_gradient(spec, device):
    """On a disordered cloud, to rounding: it varies with no depth."""
    flow = STRAIN[spec.dimension] + SHEAR[spec.dimension] + TURN[spec.dimension]
    bench, _, chosen = layers(spec, device, lambda x: x @ flow.T, jitter=0.3)
    assert chosen.sum() >= 20
    exact = np.broadcast_to(flow, (chosen.sum(), *flow.shape))
    np.testing.assert_allclose(bench.get("gradient_at_interface")[chosen], exact, atol=1e-9)


@pytest.mark.parametrize("spec", [PLANE, SPACE])
@pytest.mark.parametrize("thick", [0, 1])
def test_a_flow_that_varies_with_the_depth_has_its_gradient_at_the_interface(spec, thick, device):
    """v = (x y, -y^2/2) and its like in space: no strain at y = 0; the own phase sees that of 1 to 2.5 spacings."""

    def velocity(x):
        axes_along = x.shape[1] - 1
        return np.column_stack([x[:, :-1] * x[:, -1:], -0.5 * axes_along * x[:, -1] ** 2])

    bench, _, chosen = layers(spec, device, velocity, thick=thick)
    assert chosen.sum() >= 20
    names = ("gradient_at_interface", "velocity_gradient")
    strain, inside = (np.einsum("ndd->nd", bench.get(name)[chosen]) for name in names)
    assert np.abs(strain[:, -1]).max() < 0.15 * SPACING * (spec.dimension - 1)
    assert np.abs(strain[:, :-1]).max() < 0.15 * SPACING
    assert np.abs(inside).min() > 0.8 * SPACING


def test_a_block_of_glycerol_in_steam_stays_at_rest():
    """Viscosities 1 to 100 000, rounding alone: no mode may grow; without the dilatation in the strain one did."""
    size, spacing = 0.002337039213005561, 0.00011685196065027806
    block = [0.0011031029362792706, 0.0014693118030027217]
    case = {
        "dimension": 2,
        "particle_spacing": spacing,
        "end_time": 1.0e6,
        "gravity": [0, 0],
        "domain": {"lower": [0, 0], "upper": [size, size], "boundary": {"x": "periodic", "y": "periodic"}},
        "phases": {
            "glycerol": {"density": 1260, "viscosity": 1.4},
            "steam": {"density": 0.6, "viscosity": 1.2e-5, "gamma": 1.3},
        },
        "fluids": [
            {"phase": "glycerol", "shape": {"box": {"lower": [0, 0], "upper": block}}},
            {"phase": "steam", "shape": "rest"},
        ],
        "output": {"particles": "none", "checkpoint": "none"},
    }
    model = Model(Case.from_dict(case), device="cpu", threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(case["end_time"], 4000)
    assert model.steps == 4000
    assert np.abs(model.snapshot().velocity).max() < 1e-6


def test_the_thinner_side_and_what_is_far_are_left_alone(device):
    bench, x, chosen = layers(PLANE, device, lambda x: x)
    found = bench.get("gradient_at_interface")
    assert (found[bench.get("phase") == 1] == 7.0).all() and (found[~near(bench)] == 7.0).all()
    assert (np.abs(found[chosen]).max(axis=(1, 2)) < 7.0).all()


def test_equal_viscosities_and_the_radial_form_have_none():
    alike = (
        dataclasses.replace(PLANE, unlike_viscosity=False),
        dataclasses.replace(PLANE, viscosity="radial"),
        dataclasses.replace(PLANE, multiphase=False, unlike_viscosity=False),
    )
    for spec in alike:
        assert "gradient_at_interface" not in {field.name for field in RIEMANN_FIELDS if field.exists(spec)}
        assert "interface_gradient" not in {stage.name for stage in [*riemann.step(spec), *riemann.start(spec)]}
    names = [stage.name for stage in riemann.step(PLANE)]
    assert names.index("interface_flow") < names.index("interface_gradient") < names.index("continuity")
