"""What keeps the particles of ISPH even: shift, push and collisions next to free surfaces; the divergence left over."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import MAXIMA, SPEED, STEP
from warpsph.kernels.core.fields import FLUID, NOBODY
from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access, natural
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types, types_of

from .projection import CLOSEST
from .surface import DEEPEST, INSIDE, ISOLATED, SHALLOWEST, SURFACE

CONTACT = 0.5  # distance of a collision, in spacings: shifted particles of a flow stay farther apart
CROWDED = 0.85  # distance below which particles next to a free surface are pushed apart, in spacings
PUSH = 0.25  # of A |grad u| dt, times the spacing
MOST_PUSH = 0.1  # of |grad u| dt: beyond it a push overshoots
MOST_FILTER = 0.5  # share of a velocity's deviation that one step may take out; with 1 two particles would swap theirs
MOST_SHIFT = 0.5  # of A |D| dt
# Rate over |grad u| at which the depth of a row at the surface goes to that of its spread: none at rest, where the spread
# would make waves of a few spacings grow (0.5 to 20 on record, docs/records/isph.md#depth).
EVENING = 8.0


@functools.cache
def make_followed(dimension: int, precision: str) -> Any:
    """Return the `wp.func` that gives the depth of a particle of the surface a step later, over that of an even row [-].

    It is stretched with the fluid across the surface, `row_strain` times as fast, and drawn to the depth that the spread
    has at the rate EVENING |grad u| (theory: isph#b4).
    """
    real, vec, mat, _ = types(dimension, precision)

    @wp.func
    def followed(rows: real, even: real, n: vec, gradient: mat, row_strain: real, dt: real):
        grown = rows * wp.exp(row_strain * wp.dot(n, gradient * n) * dt)
        stretched = wp.clamp(grown, real(SHALLOWEST), real(DEEPEST))  # of spray it may be beyond all numbers
        share = wp.min(real(EVENING) * wp.sqrt(wp.ddot(gradient, gradient)) * dt, real(1.0))
        return stretched + share * (even - stretched)

    return followed


@functools.cache
def make_no_faster(spec: Spec) -> Any:
    """Return the `wp.func` that shortens a change of velocity [m/s]: no faster along it than the fastest fluid neighbour.

    Images across sides count; a change below `smallest` stays.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    images = make_images(spec)
    apart, image_velocity = images.apart, images.image_velocity
    list_begin, list_step, neighbour, Listed = list_access(spec)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.func
    def no_faster(
        i: int,
        change: vec,
        smallest: real,
        count: int,
        wrapped: bool,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        neighbours: Listed,
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
    ):
        size = wp.length(change)
        if size <= smallest:
            return change
        way = change / size
        most = real(0.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + count * step
        while k < end:
            j = natural(neighbour(neighbours, i, k))
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            d = apart(position[i], position[j], code, wrapped, params, sides)
            vj = velocity[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj, code, sides)
            if slope(wp.length(d) * params.inv_h) < real(0.0):
                most = wp.max(most, wp.dot(vj - velocity[i], way))
        return way * wp.min(size, most)

    return no_faster


@functools.cache
def make_stopped(dimension: int, precision: str) -> Any:
    """Return the `wp.func` that ends a shift where a particle has to stop before a body, CLOSEST spacings off.

    What the particle carries changes on the way that it goes. `n` is the body's normal before the particle, 0 without one.
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def stopped(dx: vec, n: vec, gap: real, spacing: real):
        inward = wp.min(real(CLOSEST) * spacing - gap, real(0.0))
        return dx + n * wp.max(inward - wp.dot(dx, n), real(0.0))

    return stopped


@functools.cache
def make_pushed(dimension: int, precision: str) -> Any:
    """Return the `wp.func` that puts a push in the place of a shift's part across a surface with the normal n."""
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def pushed(dx: vec, n: vec, push: vec):
        return dx + n * (real(PUSH) * wp.dot(push, n) - wp.dot(dx, n))

    return pushed


@functools.cache
def make_meetings(dimension: int, precision: str) -> tuple[Any, Any]:
    """Return two `wp.func`s of a pair that is the vector d apart, with r2 = d.d.

    crowd(d, r2, crowded): (1/r - 1/crowded) d below the distance `crowded`, else 0.
    collision(dv, d, r2, contact2, tiny): half the speed of approach taken out, below the distance sqrt(contact2) [m/s].
    """
    real, vec, _, _ = types(dimension, precision)

    @wp.func
    def crowd(d: vec, r2: real, crowded: real):
        result = vec()
        if r2 < crowded * crowded and r2 > real(0.0):
            result = d * (real(1.0) / wp.sqrt(r2) - real(1.0) / crowded)
        return result

    @wp.func
    def collision(dv: vec, d: vec, r2: real, contact2: real, tiny: real):
        result = vec()
        approach = wp.dot(dv, d)
        if r2 < contact2 and approach < real(0.0):
            result = d * (real(-0.5) * approach / (r2 + tiny))
        return result

    return crowd, collision


@functools.cache
def make_smoothing_share(precision: str) -> Any:
    """Return the `wp.func` that gives the share of a velocity's deviation that a step takes out [-] (theory: isph#b6).

    It is f |grad u| dt = `factor` `strength`, less what friction takes out itself of a particle that is alone in its
    velocity: 2 nu dt sum V |dW/dr|/r, with the sum without its norm in `pairs` and the viscosity over the density in `nu`.
    Next to a surface (`near`), across which no friction is felt, nothing is taken off.
    """
    real = types(2, precision).real

    @wp.func
    def smoothing_share(factor: real, strength: real, near: bool, nu: real, pairs: real, dt: real):
        friction = wp.where(near, real(0.0), real(2.0) * nu * pairs * dt)
        return wp.clamp(factor * strength - friction, real(0.0), real(MOST_FILTER))

    return smoothing_share


@functools.cache
def make_regularise(spec: Spec) -> Any:
    """Return the sweep that measures the divergence left over and finds the shift towards an even arrangement.

    dx = -A |D| dt h^2 grad C, D the rate of strain; what the particle carries changes by grad u dx. Next to a free surface
    that is done along it alone, with |grad u| for |D|; across it particles nearer than CROWDED spacings are pushed apart by
    0.25 A |grad u| dt dx sum (1 - r/r_0) e, which is zero on an even arrangement with or without neighbours outside. There
    grad u dx may be an extrapolation: it makes a particle no faster along its change than its neighbours are. How much the
    velocity is smoothed and its gradient, without what walls that hold the fluid add along them, are left to
    `velocity_smoothing`. With a free surface two particles nearer than CONTACT spacings lose their speed of approach, half
    of it each, as in a plastic collision: in a splash no pressure acts between them.
    """
    real, vec, mat, _ = types_of(spec)
    Params, Phase = make_params(spec.dimension, spec.precision), make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    followed, no_faster = make_followed(spec.dimension, spec.precision), make_no_faster(spec)
    crowd, collision = make_meetings(spec.dimension, spec.precision)
    stopped, pushed = make_stopped(spec.dimension, spec.precision), make_pushed(spec.dimension, spec.precision)
    smoothing_share, sticky = make_smoothing_share(spec.precision), spec.wall_no_slip and spec.viscosity != "none"
    images = make_images(spec)
    apart, image_velocity = images.apart, images.image_velocity
    list_begin, list_step, neighbour, Listed = list_access(spec)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def regularise(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        surface: wp.array(dtype=wp.uint8),
        surface_normal: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        correction: wp.array(dtype=mat),
        crowding: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        beside: wp.array(dtype=vec),
        wall_gap: wp.array(dtype=real),
        beside_2: wp.array(dtype=vec),
        wall_gap_2: wp.array(dtype=real),
        mirror_velocity: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        wall_normal: wp.array(dtype=vec),
        dilation: wp.array(dtype=real),
        dilation_old: wp.array(dtype=real),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        velocity_gradient: wp.array(dtype=mat),
        smoothing: wp.array(dtype=real),
        row_depth: wp.array(dtype=real),
        spread_depth: wp.array(dtype=real),
        row_strain: real,
        maxima: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
    ):
        i = wp.tid() + first
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) == NOBODY:
                return
        xi = position[i]
        vi = velocity[i]
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        flow = mat()
        along = mat()  # what of it bodies that the fluid sticks to add along their surface
        pairs = real(0.0)  # sum of V |dW/dr|/r
        impact = vec()  # change of velocity by collisions
        apart_sum = vec()
        crowded = real(CROWDED) * params.spacing
        contact2 = real(CONTACT * CONTACT) * params.spacing * params.spacing
        outward = vec()  # normals of the surface near by
        if wp.static(spec.free_surface):
            if surface[i] != wp.uint8(INSIDE):
                outward = surface_normal[i] * shape(real(0.0))
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = natural(neighbour(neighbours, i, k))
            k += step
            code = int(0)
            if wp.static(spec.mirror):
                code = j >> image_bit
                j = j & index_mask
            d = apart(xi, position[j], code, wrapped, params, sides)
            r2 = wp.dot(d, d)
            q = wp.sqrt(r2) * params.inv_h
            f = slope(q) * rest_volume[j]
            pairs -= f
            vj = velocity[j]
            if wp.static(spec.mirror):
                if code != 0:
                    vj = image_velocity(vj, code, sides)
            if wp.static(spec.free_surface):
                apart_sum += crowd(d, r2, crowded)
                impact += collision(vi - vj, d, r2, contact2, params.tiny)
            flow += wp.outer(vj - vi, f * d)
            if wp.static(spec.free_surface):
                if surface[j] != wp.uint8(INSIDE) and code == 0:
                    outward += surface_normal[j] * shape(q)
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = apart(xi, position[j], 0, wrapped, params, sides)
                if wp.static(spec.bodies):
                    b = j - (particle_count - boundary_volume.shape[0])
                    f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * boundary_volume[b]
                    pairs -= f
                    dv = mirror_velocity[b] - vi
                    flow += wp.outer(dv, f * d)
                    if wp.static(sticky):
                        if slip[b] == wp.uint8(0):
                            along += wp.outer(dv - wall_normal[b] * wp.dot(wall_normal[b], dv), f * d)
                else:
                    f = slope(wp.sqrt(wp.dot(d, d)) * params.inv_h) * params.wall_volume
                    pairs -= f
                    flow += wp.outer(real(2.0) * (velocity[j] - vi), f * d)
                    if wp.static(sticky):
                        along += wp.outer(real(2.0) * (velocity[j] - vi), f * d)  # cells have no normal
        shear = (flow * correction[i]) * params.g_norm
        # a lone particle must not bring a divergence of any size into the next step
        most = real(clock[SPEED]) * params.inv_h
        dilation_old[i] = dilation[i]
        dilation[i] = wp.clamp(wp.trace(shear), -most, most)
        shear -= (along * correction[i]) * params.g_norm  # a layer thinner than the rows has a jump there, and no slope
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                if wp.static(spec.shifting):
                    shift[i] = vec()
                    carried[i] = vec()
                    velocity_gradient[i] = shear
                    smoothing[i] = real(0.0)
                return  # rows stay as they are
        if wp.static(spec.free_surface):
            rows = real(0.0)
            if surface[i] == wp.uint8(SURFACE) and spread_depth[i] > real(0.0):
                rows = followed(row_depth[i], spread_depth[i], surface_normal[i], shear, row_strain, real(clock[STEP]))
            row_depth[i] = rows
        if wp.static(spec.shifting):
            dt = real(clock[STEP])
            strength = wp.sqrt(wp.ddot(shear, shear)) * dt
            strain = real(0.5) * (shear + wp.transpose(shear))
            pace = wp.sqrt(wp.ddot(strain, strain)) * dt  # a fluid that turns as a whole stays as even as it is
            near = bool(False)
            if wp.static(spec.free_surface):
                # at the rim of the support the weight is tiny, and its square zero
                near = wp.length(outward) > real(1.0e-6) * shape(real(0.0))
                if near:
                    pace = strength
            # beyond half of h^2 grad C a shift overshoots what is even
            dx = crowding[i] * (-wp.min(params.shifting * pace, real(MOST_SHIFT)) * params.h * params.h)
            if wp.static(spec.free_surface):
                if near:
                    push = params.shifting * wp.min(strength, real(MOST_PUSH)) * params.spacing
                    dx = pushed(dx, wp.normalize(outward), apart_sum * push)
                if surface[i] == wp.uint8(ISOLATED):
                    dx = vec()
            length = wp.length(dx)
            cap = params.shift_cap * params.h
            if length > cap:
                dx = dx * (cap / length)
            if wp.static(spec.bodies):
                dx = stopped(stopped(dx, beside[i], wall_gap[i], params.spacing), beside_2[i], wall_gap_2[i], params.spacing)
            shift[i] = dx
            change = shear * dx
            if wp.static(spec.free_surface):
                if near:
                    smallest = real(1.0e-9) * real(clock[SPEED])
                    change = no_faster(
                        i, change, smallest, int(fluid_neighbours[i]), wrapped, particle_count, list_width, params, sides,
                        neighbours, position, velocity)  # fmt: skip
                change += impact
            velocity_gradient[i] = shear
            nu = phases[0].viscosity / phases[0].density
            share = smoothing_share(params.filter, strength, near, nu, pairs * params.g_norm, dt)
            if wp.static(spec.walls and spec.free_surface):
                if wall_neighbours[i] > wp.int16(0) and not near:
                    share = real(0.0)  # the pairs of fluid beside a body are not all around
            smoothing[i] = share
            carried[i] = change
            s2 = wp.dot(dx, dx)
            if s2 > maxima[slot * MAXIMA + 3]:
                wp.atomic_max(maxima, slot * MAXIMA + 3, s2)

    return regularise
