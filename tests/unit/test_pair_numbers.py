"""What pair loops read and compute number by number is what they would as vectors."""

import itertools

import numpy as np
import pytest
import warp as wp

from warpsph.kernels.core.pair import make_at, make_element, make_part, make_separation, make_way
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.spec import types
from warpsph.kernels.core.viscosity import make_viscosity, make_viscous_parts

COUNT = 400


def run(kernel, count, *arguments):
    wp.launch(kernel, dim=count, inputs=arguments, device="cpu")


SIDES = [(2, (True, False)), (2, (False, False)), (3, (True, False, True)), (3, (True, True, True))]


@pytest.mark.parametrize(("dimension", "periodic"), SIDES)
@pytest.mark.parametrize("wrapped", [False, True])
def test_ways_are_separations(dimension, periodic, wrapped):
    real, vec, _, _ = types(dimension, "float64")
    Params = make_params(dimension, "float64")
    separation, way = make_separation(dimension, "float64", periodic), make_way(dimension, "float64", periodic)
    part = make_part(vec)

    @wp.kernel(module="unique", enable_backward=False)
    def both(x: wp.array(dtype=vec), params: Params, whole: wp.array(dtype=vec), parts: wp.array(dtype=vec)):
        i = wp.tid()
        j = (i * 7 + 3) % x.shape[0]
        whole[i] = separation(x[i], x[j], wrapped, params)
        d = vec()
        for axis in range(wp.static(dimension)):
            d[axis] = way(x[i][axis], part(x, j, axis), axis, wrapped, params)
        parts[i] = d

    params = Params()
    params.box, params.half_box = vec(*[1.0] * dimension), vec(*[0.5] * dimension)
    places = np.random.default_rng(5).uniform(0, 1, (COUNT, dimension))
    x = wp.array(places, dtype=vec, device="cpu")
    whole, parts = wp.zeros_like(x), wp.zeros_like(x)
    run(both, COUNT, x, params, whole, parts)
    np.testing.assert_array_equal(whole.numpy(), parts.numpy())
    other = places[(np.arange(COUNT) * 7 + 3) % COUNT]
    expected = places - other
    for axis in range(dimension):
        if wrapped and periodic[axis]:
            expected[:, axis] -= np.round(expected[:, axis])
    np.testing.assert_allclose(parts.numpy(), expected, atol=1e-15)


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_entries_are_what_warp_reads(dimension, precision):
    real, vec, mat, _ = types(dimension, precision)
    at, part, element = make_at(vec), make_part(vec), make_element(mat)

    @wp.kernel(module="unique", enable_backward=False)
    def read(
        v: wp.array(dtype=vec),
        m: wp.array(dtype=mat),
        v_out: wp.array(dtype=vec),
        p: wp.array(dtype=vec),
        e: wp.array(dtype=mat),
    ):
        i = wp.tid()
        v_out[i] = at(v, i)
        vector, matrix = vec(), mat()
        for row in range(wp.static(dimension)):
            vector[row] = part(v, i, row)
            for column in range(wp.static(dimension)):
                matrix[row, column] = element(m, i, row, column)
        p[i] = vector
        e[i] = matrix

    rng = np.random.default_rng(1)
    v = wp.array(rng.normal(size=(COUNT, dimension)), dtype=vec, device="cpu")
    m = wp.array(rng.normal(size=(COUNT, dimension, dimension)), dtype=mat, device="cpu")
    v_out, p, e = wp.zeros_like(v), wp.zeros_like(v), wp.zeros_like(m)
    run(read, COUNT, v, m, v_out, p, e)
    for found, given in ((v_out, v), (p, v), (e, m)):
        np.testing.assert_array_equal(found.numpy(), given.numpy())


@pytest.mark.parametrize(("form", "dimension"), list(itertools.product(["morris", "radial", "isotropic", "paper"], [2, 3])))
def test_parts_of_friction_are_its_term(form, dimension):
    real, vec, _, _ = types(dimension, "float64")
    viscous_term = make_viscosity(form, dimension, "float64")
    share, with_way = make_viscous_parts(form, dimension, "float64")

    @wp.kernel(module="unique", enable_backward=False)
    def both(v: wp.array(dtype=vec), d: wp.array(dtype=vec), whole: wp.array(dtype=vec), parts: wp.array(dtype=vec)):
        i = wp.tid()
        r2, inv_h = wp.dot(d[i], d[i]), real(3.0)
        whole[i] = viscous_term(v[i], d[i], r2, inv_h)
        parts[i] = real(share) * v[i] + with_way(wp.dot(v[i], d[i]), r2, inv_h) * d[i]

    rng = np.random.default_rng(2)
    v, d = (wp.array(rng.normal(size=(COUNT, dimension)), dtype=vec, device="cpu") for _ in range(2))
    whole, parts = wp.zeros_like(v), wp.zeros_like(v)
    run(both, COUNT, v, d, whole, parts)
    assert np.abs(whole.numpy()).max() > 1.0
    np.testing.assert_allclose(parts.numpy(), whole.numpy(), rtol=1e-12, atol=1e-12)
