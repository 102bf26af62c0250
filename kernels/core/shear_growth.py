"""How a shear that grows along a wall moves the fluid across it: without divergence (theory: riemann#growth).

Before the foot x_s of a particle of the first layer the velocity along a wall that the fluid sticks to is, beside what the
fit of `wall_fit` has, (m y + p y^2)/(d - 1) times the way t along the wall, with y along the normal. Its divergence along
the wall, m y + p y^2, is that of the velocity across it with the other sign, which so is

    u_n(y) = -(m y^2/2 + p y^3/3)

behind the wall too. m and p are the least-squares fit to what the fit of `wall_fit` leaves of the velocities of the fluid.
They are of the velocity along the wall alone, so that sound, which moves the fluid across it, has no part in them.
"""

import functools
from typing import Any

import warp as wp

from .pair import list_access, separation_of
from .params import make_params
from .quadratic import LEAST_PIVOT
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types, types_of

MOST_CUBE = 1.0  # what the cubic term may be of the quadratic one at a support


@functools.cache
def make_inflow(precision: str) -> Any:
    """Return the `wp.func` inflow((m, p), y): the velocity across a wall [m/s] at the distance y [m], behind it -z."""
    real, _, _, pair = types(1, precision)

    @wp.func
    def inflow(growth: pair, y: real):
        return -y * y * (real(0.5) * growth[0] + growth[1] * y / real(3.0))

    return inflow


@functools.cache
def make_shear_growth(spec: Spec) -> Any:
    """Return the kernel over wall particles, after `wall_fit`, of which `surface_growth` has the trust in its first part.

    It leaves (m, p) [1/(m s), 1/(m^2 s)] there, and in the fit the slope of the velocity across the wall less that of u_n.
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def shear_growth(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        position: wp.array(dtype=vec),
        midway: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_area: wp.array(dtype=real),
        surface_velocity: wp.array(dtype=vec),
        surface_bend: wp.array(dtype=vec),
        surface_shear: wp.array(dtype=mat),
        surface_growth: wp.array(dtype=pair),
    ):
        w = wp.tid() + first
        if wall_area[w] == real(0.0):
            return
        trust = surface_growth[w][0]
        surface_growth[w] = pair()
        if trust == real(0.0):
            return
        i = w + fluid_count
        normal = wall_normal[w]
        foot = position[i] + normal * wall_depth[w]
        h = params.h
        value, rise, bow = surface_velocity[w], h * (surface_shear[w] * normal), (h * h) * surface_bend[w]
        along_y = real(0.0)  # sum w y t.v, of what the fit leaves
        along_yy = real(0.0)  # sum w y^2 t.v
        yyss, yyyss, yyyyss = real(0.0), real(0.0), real(0.0)
        yy, yyy, yyyy = real(0.0), real(0.0), real(0.0)
        yss, ssss = real(0.0), real(0.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            # in units of h: powers of metres would be too small for a float
            r = -separation(foot, midway[j], True, params) * params.inv_h
            weight = shape(wp.length(r)) * state[j][1]
            y = wp.dot(r, normal)
            t = r - y * normal
            wy2 = weight * y * y
            s2 = wp.dot(t, t)
            left = velocity[j] - value - y * rise - (y * y) * bow
            moved = weight * y * wp.dot(left, t)
            along_y += moved
            along_yy += moved * y
            yyss += wy2 * s2
            yyyss += wy2 * y * s2
            yyyyss += wy2 * y * y * s2
            yy += wy2
            yyy += wy2 * y
            yyyy += wy2 * y * y
            yss += weight * y * s2
            ssss += weight * s2 * s2
        if yy == real(0.0):
            return
        inverse = real(1.0) / yy  # of sums over sum w y^2 products are numbers too
        yyss, yyyss, yyyyss, yss, ssss = yyss * inverse, yyyss * inverse, yyyyss * inverse, yss * inverse, ssss * inverse
        pivot = yyss * yyyyss - yyyss * yyyss
        spread = ssss - yss * yss
        if pivot <= real(LEAST_PIVOT) * yyss * yyyyss or spread <= real(LEAST_PIVOT) * ssss:
            return
        scale = real(wp.static(spec.dimension - 1)) * trust * inverse / pivot
        m = (along_y * yyyyss - along_yy * yyyss) * scale
        p = (along_yy * yyss - along_y * yyyss) * scale
        most = real(wp.static(0.75 * MOST_CUBE)) * wp.abs(m)
        p = wp.clamp(p, -most, most)
        surface_growth[w] = pair(m / (h * h), p / (h * h * h))
        # the fit across the wall, of y and s^2, took u_n for a slope too: what it has of it
        line = (real(0.5) * m * yyy + p * yyyy / real(3.0)) * inverse
        lift = (line * ssss - (real(0.5) * m * yyss + p * yyyss / real(3.0)) * yss) / spread
        surface_shear[w] += (lift / h) * wp.outer(normal, normal)

    return shear_growth
