"""Interfaces of three and more phases, each seen by all particles: with two in reach as `interface` has them."""

import dataclasses

import numpy as np
import pytest

from tests.helpers import Bench, Fluid, lattice
from warpsph.kernels.core.spec import Spec
from warpsph.schemes.riemann_physics import has_triple_points

SPEC = Spec(dimension=2, precision="float64", multiphase=True, tension="pressure_jump", interface=True)
FLUIDS = (Fluid(density=1.0), Fluid(density=1000.0), Fluid())


def ball_and_slab(dimension, triple, device):
    """Return (bench, places): a ball of phase 0 in phase 1, and phase 2 behind a flat interface out of its reach."""
    counts = (24, 48) if dimension == 2 else (16, 16, 36)
    radius, surface, middle = (6.0, 13.0, -10.0) if dimension == 2 else (4.0, 10.0, -10.0)
    x = lattice(counts, 1.0, 0.15)
    centre = np.zeros(dimension)
    centre[-1] = middle
    phase = np.where(np.linalg.norm(x - centre, axis=1) < radius, 0, np.where(x[:, -1] > surface, 2, 1))
    spec = dataclasses.replace(SPEC, dimension=dimension, periodic=(False,) * dimension, triple=3 if triple else 0)
    bench = Bench(spec, x, spacing=1.0, ratio=1.5, phase=phase, fluids=FLUIDS, device=device)
    bench.prepare()
    return bench, x


@pytest.mark.parametrize("dimension", [2, 3])
def test_two_phases_in_reach_are_as_those_of_two(dimension, device):
    """Shares, normals and curvatures of the own phase are the same, those of the other one the opposite."""
    three, _ = ball_and_slab(dimension, True, device)
    two, _ = ball_and_slab(dimension, False, device)
    phase, kappa, weight = three.get("phase").astype(int), three.get("curvature"), three.get("interface_weight")
    rows = np.arange(len(phase))
    for name in ("fraction", "normal"):
        np.testing.assert_allclose(three.get(name), two.get(name), atol=1e-9, err_msg=name)
    np.testing.assert_allclose(kappa[rows, phase], two.get("curvature"), atol=1e-9)
    np.testing.assert_allclose(weight[rows, phase], two.get("interface_weight"), atol=1e-9)
    near = two.get("interface_weight") > 0
    assert near.sum() > 100
    beside = np.where(phase == 1, np.where(kappa[:, 0] != 0, 0, 2), 1)
    np.testing.assert_allclose(kappa[rows, beside][near], -two.get("curvature")[near], atol=1e-9)
    np.testing.assert_allclose(weight[rows, beside][near], two.get("interface_weight")[near], atol=1e-9)
    assert (weight > 0).sum(axis=1).max() == 2


def test_columns_give_the_same(device):
    """The layout for GPUs, which does without the compact list of the band, at a point where three sectors meet."""
    x = lattice((24, 24), 1.0, 0.1)
    phase = np.floor((np.arctan2(x[:, 1], x[:, 0]) + np.pi) / (2 * np.pi / 3) - 1e-12).astype(int)
    found = []
    for row_list in (True, False):
        spec = dataclasses.replace(SPEC, triple=3, row_list=row_list)
        found.append(Bench(spec, x, spacing=1.0, phase=phase, fluids=FLUIDS, device=device))
        found[-1].prepare()
    for name in ("share", "phase_normal", "interface_weight", "curvature"):
        np.testing.assert_allclose(found[1].get(name), found[0].get(name), rtol=1e-9, atol=1e-9, err_msg=name)
    assert np.abs(found[0].get("curvature")).max() > 0.1


def test_shares_add_up_to_one_and_normals_to_nothing(device):
    """At a point where three sectors meet."""
    x = lattice((30, 30), 1.0, 0.1)
    phase = np.floor((np.arctan2(x[:, 1], x[:, 0]) + np.pi) / (2 * np.pi / 3) - 1e-12).astype(int)
    bench = Bench(dataclasses.replace(SPEC, triple=3), x, spacing=1.0, phase=phase, fluids=FLUIDS, device=device)
    bench.prepare()
    middle = np.linalg.norm(x, axis=1) < 3
    assert (bench.get("share")[middle] > 0.02).all(axis=1).any()
    np.testing.assert_allclose(bench.get("share").sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(bench.get("phase_normal").sum(axis=1)[middle], 0.0, atol=1e-12)
    assert np.isfinite(bench.get("curvature")).all()


def test_a_fourth_phase_out_of_reach_changes_nothing(device):
    """At a point where three sectors meet, beside a fourth phase that begins a spacing beyond the support."""
    x = lattice((40, 24), 1.0, 0.1)
    sector = np.floor((np.arctan2(x[:, 1], x[:, 0]) + np.pi) / (2 * np.pi / 3) - 1e-12).astype(int)
    near = np.abs(x[:, 0]) < 6
    found = []
    for count, phase in ((3, sector), (4, np.where(x[:, 0] > 16, 3, sector))):
        spec = dataclasses.replace(SPEC, triple=count)
        bench = Bench(spec, x, spacing=1.0, phase=phase, fluids=FLUIDS + (Fluid(),) * (count - 3), device=device)
        bench.prepare()
        found.append(bench)
    for name in ("share", "phase_normal", "interface_weight", "curvature"):
        three, four = (bench.get(name)[near] for bench in found)
        np.testing.assert_allclose(four[:, :3], three, rtol=1e-12, atol=1e-12, err_msg=name)
        assert (four[:, 3] == 0).all()


@pytest.mark.parametrize(
    ("tensions", "expected"),
    [((1, 0.8, 0.6), True), ((1, 0.8, 0), True), ((1, 0, 0), False), ((1,), False), ((1, 0, 0, 0, 0, 1), True)],
)
def test_three_phases_with_two_tensions_may_meet(tensions, expected):
    """Two phases, or one pair alone with a tension, are left to the curvature of a pair."""
    matrix = np.zeros((2, 2) if len(tensions) == 1 else (3, 3) if len(tensions) == 3 else (4, 4))
    matrix[np.triu_indices(len(matrix), 1)] = tensions
    assert has_triple_points(matrix + matrix.T) is expected
