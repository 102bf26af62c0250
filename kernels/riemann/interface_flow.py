"""The flow on each side of an interface, for the Riemann problem between two phases (no source equation).

Next to an interface the neighbours of the own phase fill a part of the support alone. From them:
    grad v_i = [sum_own (v_j - v_i) (x) grad_i W V_j] [sum_own (x_j - x_i) (x) grad_i W V_j]^-1
    facing_i = sum_other grad_i W V_j / |.|, from the own phase to the others
The first carries the velocity of the denser particle of a pair to its middle, v_i + grad v_i.(x_j - x_i)/2. With constant
states the particles of a heavy phase would see no divergence towards a light one, and its rows would compress and expand in
turn. Of that only what the weights of u* leave out counts, (rho_i - rho_j)/(rho_i + rho_j): carried velocities have no
counterpart in p*, so the work of the pressures is not what the flow gains, and more of it than needed feeds short waves
(docs/records/tension.md).
The second tells a particle at an interface from one that is alone among the other phase: it is zero where no one side
faces the others.

Where on the way between two particles the interface lies follows from the depths a_i below it of both
(`make_density_between`), and a depth from the share of the others, as below a plane:
    share_i = sum_other w V_j / sum w V_j = int_a^R w1 / int w1,   w = (1 - r^2/R^2)^n,  w1 = (1 - a^2/R^2)^3
with n = 3, 5/2, 2 in 1 to 3 dimensions, which make the integral w1 of w over planes the same polynomial, and R the support.
A bent interface is kappa s^2/2 off its plane at a distance s along it, and the mean of s^2 along each axis of the plane at
the depth a is (R^2 - a^2)/8: the others have the share of a plane that is kappa (R^2 - a^2)/16 nearer. The curvature is
known with tension and where weights differ (`Spec.curved`); else interfaces count as plane.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import NEAR, list_access, look_ahead, make_at, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import KERNELS, make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, curvature_type, types, types_of

# Root 1/d of the determinant of the own phase's moment, 1 inside a fluid, 0.5 at a flat surface. Below the first the
# gradient fades, below the second it is zero: a drop of a few particles moves as one.
FULL, NONE = 0.3, 0.15
# |sum_other grad W V| over sum_other |grad W V|, 0.6 to 1 at a flat interface: below, no one side faces the other phases.
CLEAR = 0.3
# h times the gradient of the share of other phases, of order 1 beside an interface, below which it points nowhere.
FAINT = 1.0e-6
# Least depth over the spacing. Rows lie half a spacing deep, and less where a flow presses them: that changes how much of a
# way lies in each fluid, and so the pressure that weight makes. Friction counts half a spacing (`series_mean`).
LEAST_DEPTH = 0.25
# A curvature kappa takes BENT kappa (R^2 - a^2) off the depth that shares show: half of the mean square along an axis.
BENT = 1.0 / 16.0
NEWTON_STEPS = 5  # to 2e-8 of the support at 0.7 of it; what is deeper has no neighbours across that count


@functools.cache
def make_depth(dimension: int, precision: str) -> Any:
    """Return the `wp.func`s window(r^2/R^2), the weight of a neighbour, and depth(share) = a/R below a plane.

    The latter solves (35/32)(z - z^3 + 3/5 z^5 - z^7/7) = 1/2 - share by Newton's method, from below, where it does not
    overshoot.
    """
    real = types(dimension, precision).real

    @wp.func
    def window(q2: real):
        u = wp.max(real(1.0) - q2, real(0.0))
        w = u * u
        if wp.static(dimension == 1):
            w = w * u
        if wp.static(dimension == 2):
            w = w * wp.sqrt(u)
        return w

    @wp.func
    def depth(share: real):
        aim = real(35.0 / 32.0)
        aim = (real(0.5) - wp.min(share, real(0.5))) / aim
        z = aim
        for _ in range(wp.static(NEWTON_STEPS)):
            z2 = z * z
            u = wp.max(real(1.0) - z2, real(0.1))
            z += (aim - z * (real(1.0) - z2 * (real(1.0) - z2 * (real(0.6) - z2 / real(7.0))))) / (u * u * u)
        return z

    return window, depth


@functools.cache
def make_density_between(spec: Spec) -> Any:
    """Return the `wp.func` density_between(i, j, facing, depth, rho_i, rho_j): the mean density of the way from i to j.

    facing and depth are those of all particles: a_i/(a_i + a_j) of the way lie in the phase of i, and half of it where the
    two do not face each other, for there is no common interface.
    """
    real, vec, _, _ = types_of(spec)

    @wp.func
    def density_between(i: int, j: int, facing: wp.array(dtype=vec), depth: wp.array(dtype=real), rho_i: real, rho_j: real):
        part = real(0.5)
        if wp.dot(facing[i], facing[j]) < real(0.0):
            part = depth[i] / (depth[i] + depth[j])
        return part * rho_i + (real(1.0) - part) * rho_j

    return density_between


@functools.cache
def make_interface_flow(spec: Spec) -> Any:
    """Return the kernel over fluid particles; those without another phase in their list are left alone."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    at_vec, at_pair = make_at(vec), make_at(pair)
    look, taken, onward = look_ahead(spec)
    full, none = FULL**spec.dimension, NONE**spec.dimension
    window, depth = make_depth(spec.dimension, spec.precision)
    particle_of, lane_of, part_of, added, added_vec, added_mat = lanes_of(spec, real, vec, mat)
    support, curved = KERNELS[spec.kernel].support, curvature_type(spec)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def interface_flow(
        first: int,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        mirror_velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        velocity_gradient: wp.array(dtype=mat),
        facing: wp.array(dtype=vec),
        curvature: wp.array(dtype=curved),
        interface_depth: wp.array(dtype=real),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if (int(flags[i]) & NEAR) == 0:
            return
        xi = position[i]
        vi = velocity[i]
        own = phase[i]
        flow = mat()
        moment = mat()
        others = vec()
        all_others = real(0.0)
        own_room, other_room = state[i][1], real(0.0)  # sums of w V
        if wp.static(spec.lanes > 1):
            own_room = wp.where(lane == 0, own_room, real(0.0))  # its own place counts once
        fluid_count = particle_count - slip.shape[0]
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        ahead = look(neighbours, i, k, end)
        while k < end:
            j = taken(ahead, neighbours, i, k)
            k, ahead = onward(neighbours, i, k, step, end)
            d = separation(xi, at_vec(position, j), True, params)
            q = wp.sqrt(wp.dot(d, d)) * params.inv_h
            fd = (slope(q) * at_pair(state, j)[1]) * d
            room = window(q * q * real(wp.static(1.0 / support**2))) * at_pair(state, j)[1]
            own_room += wp.where(phase[j] == own, room, real(0.0))
            other_room += wp.where(phase[j] == own, real(0.0), room)
            if phase[j] == own:
                moment -= wp.outer(d, fd)
                flow += wp.outer(at_vec(velocity, j) - vi, fd)
            else:
                others += fd
                all_others += wp.length(fd)
        if wp.static(spec.lanes > 1):
            own_room, other_room, all_others = added(own_room), added(other_room), added(all_others)
            others, flow, moment = added_vec(others), added_mat(flow), added_mat(moment)
            if lane > 0:
                return
        k, step = end, stride
        if wp.static(spec.wall_no_slip):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                if slip[j - fluid_count] == wp.uint8(0):
                    d = separation(xi, at_vec(position, j), True, params)
                    fd = (slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * params.wall_volume) * d
                    moment -= wp.outer(d, fd)
                    flow += wp.outer(mirror_velocity[j - fluid_count] - vi, fd)
        gradient = mat()
        m = moment * params.g_norm
        determinant = wp.determinant(m)
        if determinant > real(none):
            gradient = (flow * params.g_norm) * wp.inverse(m)
            if determinant < real(full):
                gradient = gradient * ((determinant - real(none)) / real(full - none))
        velocity_gradient[i] = gradient
        a = depth(other_room / (own_room + other_room)) * real(wp.static(support))
        if wp.static(spec.curved):
            kappa = real(0.0)
            if wp.static(spec.triple):
                kappa = curvature[i][int(own)]
            else:
                kappa = curvature[i]
            a += kappa * params.h * (real(wp.static(support**2)) - a * a) * real(wp.static(BENT))
        interface_depth[i] = wp.max(a, real(LEAST_DEPTH) * params.spacing * params.inv_h)
        strength = wp.length(others)
        # what the edge of the support sees of another phase is no direction, and its reciprocal may be infinite
        if strength > real(CLEAR) * all_others and strength * (params.g_norm * params.h) > real(FAINT):
            facing[i] = others / strength
        else:
            facing[i] = vec()

    return shared(interface_flow, spec)
