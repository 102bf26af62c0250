"""Walls with a surface of their own: pressure and velocity continued through it along fits (theory: riemann#bodies).

At the foot x_s of each particle of the first layer, with weights w_f = W(x_f - x_s) V_f over the fluid and r = x_f - x_s,
which is y along the normal n and s at right angles to it:

    pressure: the least-squares fit p_s + G.r of p_f - rho_f b.r, b = g + f - a_w the acceleration it balances
    velocity: the least-squares fit v_w + S r + q y^2 + c s^2 of v_f, which is that of the wall at the surface

A wall particle x behind that foot, z behind its own, has p = p_s + (G + rho b).(x - x_s) and mirrors
v = v_w - S n z + q z^2: both are exact where the fluid has a linear pressure and a linear velocity, whatever the arrangement
of particles. The quadratic terms make the viscous term beside the surface one of second order; s^2 is there for surfaces
that are not plane.

A wall without friction has a velocity along it from the fit of the fluid alone, and a slope that makes no shear stress; the
viscous term takes the slope alone (`friction_slide`).
A divergence has such a velocity too (`sliding`) where the layer on a wall that the fluid sticks to is thinner than a fit
sees: there -S n z turns round what runs along the wall, and so the sign of its divergence (theory: delta#layers). Where the
fit sees the layer, q has the part along n that a flow of growing shear has in a divergence: d2u_n/dn2 = -d(du_t/dn)/dt;
with the corrected gradient `shear_growth` has it from the velocity along the wall.
Where the fluid is too thin for a fit, G = 0, and the velocity changes along the normal alone. A wall that it has not come to
has no volume (`dry_walls`).

G.n is what friction and a curved path of the fluid need, which change with the flow. In sound it is zero at a wall, but not
in a straight line through half a wave, and what is between them feeds sound that runs to and fro between two walls. So with
the corrected gradient, whose dissipation spares what is linear, G.n follows the fit at the rate FOLLOW c/dx + nu/dx^2: where
the second is the larger, friction damps that sound and changes the flow as fast.
"""

import functools
from typing import Any

import warp as wp

from .clock import STEP
from .dry_walls import make_wetted
from .fields import slipping
from .pair import list_access, separation_of
from .params import make_params, make_phase
from .poses import make_pose, make_velocity_at
from .quadratic import LEAST_PIVOT
from .shear_growth import make_inflow
from .smoothing import make_smoothing
from .spec import SWEEP_OPTIONS, Spec, types, types_of
from .time_signals import GRAVITY_NEXT, make_forcing

HALF_SPACE = {1: 0.069, 2: 0.055, 3: 0.044}  # 1/tr(spread^-1) of an even half space, h^2 (Wendland C2, h = 1.5 spacings)
# Shares of it between which the fit is faded out: the fluid before the foot is too thin to say how its fields change through
# it. Two rows have 0.97, a right-angled corner 0.62 (three sides: 0.49); a row that is 0.6 spacings thick 0.27, one row 0.
THIN, WHOLE = 0.25, 0.45
THICK = 0.5  # of its slope over h: velocity that the fluid has at a wall by a fit of its own, half way to one it sticks to
SEEN = 4.0  # a layer so much thicker has half of its bend across the wall: a thinner one is no parabola there either
MOST_BEND = 0.5  # what the quadratic term may be of the linear one at a support: an unresolved layer is no parabola
NEAREST = 0.25  # spacings: fluid nearer than that to the surface counts as at that distance, for the slope of its velocity
# Rate over c/dx at which the slope of the pressure along the normal follows the fit. Eigenvalues of sound between two walls
# 10 to 80 spacings apart: all are damped up to 0.02, the longest waves grow from 0.03 on. It lags by 5 dx/U, at Mach 0.1.
FOLLOW = 0.02

HERE = {"midway": "position"}  # fields of a stage of `make_wall_fit` at the end of a step


@functools.cache
def make_wall_rows() -> Any:
    """Return the kernel that finds the row of each wall particle by its number, which the list build changes."""

    @wp.kernel(module="unique", enable_backward=False)
    def wall_rows(
        first: int,
        fluid_count: int,
        first_wall_id: int,
        particle_id: wp.array(dtype=int),
        row_of_wall: wp.array(dtype=int),
    ):
        w = wp.tid() + first
        row_of_wall[particle_id[w + fluid_count] - first_wall_id] = w

    return wall_rows


@functools.cache
def make_bent(dimension: int, precision: str, across: bool) -> Any:
    """Return the `wp.func` that solves for the velocity S r + q y^2 + c s^2 of a fit: (S, q, c), from its weighted sums.

    bent(sum v (x) r, sum v y^2, sum v s^2, sum r (x) r, sum r y^2, sum r s^2, sum y^4, sum y^2 s^2, sum s^4, normal, reach):
    v is the velocity less that of the wall, `reach` the support of the kernel. q = 0 where the particles do not tell it
    from a slope. across: q has a part along the normal. With sums about the means it is a fit that does not know the wall.
    """
    real, vec, mat, _ = types(dimension, precision)

    @wp.func
    def bent(
        shear: mat,
        bend: vec,
        bow: vec,
        square: mat,
        line_y: vec,
        line_s: vec,
        yyyy: real,
        yyss: real,
        ssss: real,
        normal: vec,
        reach: real,
    ):
        inverse = wp.inverse(square)
        slope = shear * inverse
        q = bend - shear * (inverse * line_y)
        c = bow - shear * (inverse * line_s)
        left_y = yyyy - wp.dot(line_y, inverse * line_y)  # of the sums beside the slopes
        left_ys = yyss - wp.dot(line_y, inverse * line_s)
        left_s = ssss - wp.dot(line_s, inverse * line_s)
        pivot = real(0.0)  # what is left of y^2 beside s^2 too
        if left_s > real(LEAST_PIVOT) * ssss:
            pivot = left_y - left_ys * left_ys / left_s
        if pivot > real(LEAST_PIVOT) * yyyy:
            q = (q - (left_ys / left_s) * c) / pivot
            if wp.static(not across):
                # of a compressed fluid a bend across the wall is sound, which its mirror makes louder in each step
                q -= normal * wp.dot(q, normal)
            most = real(MOST_BEND) * wp.length(slope * normal)
            if wp.length(q) * reach > most:
                q = q * (most / (wp.length(q) * reach))
            c = (c - left_ys * q) / left_s
            slope -= wp.outer(q, inverse * line_y) + wp.outer(c, inverse * line_s)
        else:
            q = vec()
            c = vec()
        return slope, q, c

    return bent


@functools.cache
def make_sliding(dimension: int, precision: str) -> tuple[Any, Any]:
    """Return the `wp.func`s of the velocity along a wall that a divergence has there (theory: delta#layers).

    own_fit(the sums of `bent` and their means, trust, normal, reach): velocity at the foot less that of the wall, slope and
    bend of a fit that does not know the wall.
    slid(these three, slope and bend of the fit that knows it, lift, hollow, normal, h): what is added to the velocity of the
    wall, slope and bend, and the share of the fit that knows the wall. Across it all is as that fit has it, and where it
    sees the layer well it bends there too: by `hollow` along the normal, which changes the slope of that part by `lift`.
    """
    real, vec, mat, _ = types(dimension, precision)
    bent = make_bent(dimension, precision, False)

    @wp.func
    def own_fit(
        flow: vec,
        shear: mat,
        bend: vec,
        bow: vec,
        mean: vec,
        square: mat,
        line_y: vec,
        line_s: vec,
        yyyy: real,
        yyss: real,
        ssss: real,
        trust: real,
        normal: vec,
        reach: real,
    ):
        y2 = wp.dot(normal, square * normal)
        s2 = wp.trace(square) - y2
        slope, q, c = bent(
            shear - wp.outer(flow, mean),
            bend - y2 * flow,
            bow - s2 * flow,
            square - wp.outer(mean, mean),
            line_y - y2 * mean,
            line_s - s2 * mean,
            yyyy - y2 * y2,
            yyss - y2 * s2,
            ssss - s2 * s2,
            normal,
            reach,
        )
        return flow - trust * (slope * mean + y2 * q + s2 * c), trust * slope, trust * q

    @wp.func
    def slid(value: vec, slope: mat, q: vec, shear: mat, bend: vec, lift: vec, hollow: real, normal: vec, h: real):
        along = value - normal * wp.dot(value, normal)
        rise = slope * normal
        rise -= normal * wp.dot(rise, normal)
        # large where the fit sees the layer
        layer = real(THICK * THICK) * h * h * wp.dot(rise, rise) / (wp.dot(along, along) + real(1.0e-30))
        part = real(1.0) / (real(1.0) + layer * layer)
        change = slope - shear
        change -= wp.outer(normal, wp.transpose(change) * normal)
        thin = (wp.dot(along, along) + real(1.0e-30)) / (real(THICK * THICK) * h * h * wp.dot(rise, rise) + real(1.0e-37))
        seen = real(1.0) / (real(1.0) + real(wp.static(SEEN**4)) * thin * thin)
        return (
            part * along,
            shear + part * change + seen * wp.outer(normal, lift),
            bend + part * (q - bend) + (seen * hollow) * normal,
            real(1.0) - part,
        )

    return own_fit, slid


@functools.cache
def make_unstressed(dimension: int, precision: str) -> Any:
    """Return the `wp.func` unstressed(value, free, shear, normal) of a wall without friction: velocity along it, and slope.

    Along it the fluid has the velocity of a fit that does not know the wall, `value` and the slope `free`; across it that of
    one that knows it, `shear`. There is no shear stress: (S + S^T) n is along n.
    """
    _, vec, mat, _ = types(dimension, precision)

    @wp.func
    def unstressed(value: vec, free: mat, shear: mat, normal: vec):
        slope = free - wp.outer(free * normal, normal)
        slope -= wp.outer(normal, wp.transpose(slope) * normal)
        out_of = wp.transpose(shear) * normal
        twist = out_of - normal * wp.dot(out_of, normal)
        return value - normal * wp.dot(value, normal), slope + wp.outer(normal, out_of) - wp.outer(twist, normal)

    return unstressed


@functools.cache
def make_wall_fit(
    spec: Spec, across: bool = False, followed: bool = False, sliding: bool = False, grown: bool = False
) -> Any:
    """Return the kernel over wall particles that fits pressure and velocity of the fluid before the first layer.

    across: the velocity bends across the wall too; else q has no part along the normal.
    followed: the slope of the pressure along the normal follows the fit, by the time of one step; else it is that of it.
    sliding: for a divergence; through a layer thinner than a fit sees the velocity along walls is that of the fluid.
    grown: `shear_growth` says how the velocity bends across the wall; it is told how far the fit that knows the wall counts.
    Its argument `midway` is where the fluid is at the time of the walls, in the middle of a step or at its end.
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    gravity_of, body_force_of = make_forcing(spec)
    velocity_at = make_velocity_at(spec)
    Pose = make_pose()
    half_space = HALF_SPACE[spec.dimension]
    bent = make_bent(spec.dimension, spec.precision, across)
    own_fit, slid = make_sliding(spec.dimension, spec.precision)
    bent_across = make_bent(spec.dimension, spec.precision, True)
    unstressed = make_unstressed(spec.dimension, spec.precision)
    wetted = make_wetted(spec.precision)

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def wall_fit(
        first: int,
        fluid_count: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        body_motion: wp.array(dtype=int),
        poses: wp.array(dtype=Pose),
        wall_body: wp.array(dtype=int),
        wall_acceleration: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        midway: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        state: wp.array(dtype=pair),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_area: wp.array(dtype=real),
        slip: wp.array(dtype=wp.uint8),
        surface_pressure: wp.array(dtype=real),
        covered: wp.array(dtype=wp.uint8),
        surface_wet: wp.array(dtype=real),
        surface_gradient: wp.array(dtype=vec),
        surface_slope: wp.array(dtype=real),
        surface_velocity: wp.array(dtype=vec),
        surface_shear: wp.array(dtype=mat),
        surface_bend: wp.array(dtype=vec),
        surface_growth: wp.array(dtype=pair),
    ):
        w = wp.tid() + first
        if wall_area[w] == real(0.0):
            return
        i = w + fluid_count
        normal = wall_normal[w]
        foot = position[i] + normal * wall_depth[w]
        balanced = gravity_of(params, forcing, GRAVITY_NEXT) + body_force_of(params, forcing)
        own_velocity = velocity[i]
        if wp.static(spec.moving):
            balanced -= wall_acceleration[w]
            own_velocity = velocity_at(own_velocity, normal * wall_depth[w], wall_body[w], body_motion, poses)
        weight, density, p = real(0.0), real(0.0), real(0.0)
        mean = vec()  # of r
        slope_p = vec()  # sum w p r
        square = mat()  # sum w r (x) r
        flow = vec()  # sum w (v - v_w)
        shear = mat()  # sum w (v - v_w) (x) r
        # the quadratic terms: y along the normal, s at right angles to it
        line_y = vec()  # sum w y^2 r
        line_s = vec()  # sum w s^2 r
        yyyy = real(0.0)  # sum w y^4
        yyss = real(0.0)
        ssss = real(0.0)
        bend = vec()  # sum w (v - v_w) y^2
        bow = vec()  # sum w (v - v_w) s^2
        nearest2 = real(1.0e30)  # square of the distance to the nearest fluid particle
        slips = bool(True)
        if wp.static(spec.wall_no_slip):
            slips = slip[w] != wp.uint8(0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            r = -separation(foot, midway[j], True, params)
            state_j = state[j]
            w_j = shape(wp.length(r) * params.inv_h) * state_j[1]
            own = int(0)
            if wp.static(spec.multiphase):
                own = int(phase[j])
            rho = phases[own].density * rest_volume[j] / state_j[1]
            p_j = state_j[0] - rho * wp.dot(balanced, r)
            weight += w_j
            density += w_j * rho
            p += w_j * p_j
            mean += w_j * r
            slope_p += (w_j * p_j) * r
            square += wp.outer(r, w_j * r)
            flow += w_j * (velocity[j] - own_velocity)
            shear += wp.outer(velocity[j] - own_velocity, w_j * r)
            y2 = wp.dot(r, normal) * wp.dot(r, normal)
            s2 = wp.dot(r, r) - y2
            nearest2 = wp.min(nearest2, wp.dot(r, r))
            line_y += (w_j * y2) * r
            line_s += (w_j * s2) * r
            yyyy += w_j * y2 * y2
            yyss += w_j * y2 * s2
            ssss += w_j * s2 * s2
            bend += (w_j * y2) * (velocity[j] - own_velocity)
            bow += (w_j * s2) * (velocity[j] - own_velocity)
        gradient = vec()
        if weight > real(1.0e-20):
            inv_weight = real(1.0) / weight
            p, mean, square = p * inv_weight, mean * inv_weight, square * inv_weight
            shear, flow, bend, bow = shear * inv_weight, flow * inv_weight, bend * inv_weight, bow * inv_weight
            line_y, line_s = line_y * inv_weight, line_s * inv_weight
            yyyy, yyss, ssss = yyyy * inv_weight, yyss * inv_weight, ssss * inv_weight
            spread = square - wp.outer(mean, mean)
            even = real(half_space) * params.h * params.h
            smallest = real(THIN) * even  # of a determinant: the spread is even * THIN at least along each direction
            for _axis in range(wp.static(spec.dimension - 1)):
                smallest = smallest * real(THIN) * even
            trust = real(0.0)  # 1: a fit; 0: values and slopes along the normal alone
            inverse = mat()
            if wp.determinant(spread) > smallest:
                inverse = wp.inverse(spread)
                share = real(1.0) / (wp.trace(inverse) * even)
                trust = wp.clamp((share - real(THIN)) / real(wp.static(WHOLE - THIN)), real(0.0), real(1.0))
            inverse = inverse * trust
            gradient = inverse * (slope_p * inv_weight - p * mean)
            if wp.static(followed):
                rate = real(FOLLOW) * phases[0].sound_speed / params.spacing
                rate += phases[0].viscosity / (phases[0].density * params.spacing * params.spacing)
                fitted = wp.dot(gradient, normal)
                slope = fitted + (surface_slope[w] - fitted) * wp.exp(-rate * real(clock[STEP]))
                surface_slope[w] = slope
                gradient += (slope - fitted) * normal
            p = p - wp.dot(gradient, mean)
            free = (shear - wp.outer(flow, mean)) * inverse  # of a fit that does not know the wall
            nearest = real(NEAREST) * params.spacing
            out = wp.max(wp.dot(normal, square * normal), nearest * nearest)
            straight = wp.outer(shear * normal / out, normal)
            if wp.static(sliding):
                # of a fit with quadratic terms that does not know the wall: its velocity at the foot, slope and bend
                own_value, own_shear, own_bend = vec(flow), mat(), vec()
                lift, hollow, held = vec(), real(0.0), real(0.0)
            if trust > real(0.0):
                reach = real(2.0) * params.h
                if wp.static(sliding):
                    own_value, own_shear, own_bend = own_fit(
                        flow, shear, bend, bow, mean, square, line_y, line_s, yyyy, yyss, ssss, trust, normal, reach
                    )
                if wp.static(sliding and not grown):
                    over, arch, _ = bent_across(shear, bend, bow, square, line_y, line_s, yyyy, yyss, ssss, normal, reach)
                shear, bend, _bow = bent(shear, bend, bow, square, line_y, line_s, yyyy, yyss, ssss, normal, reach)
                if wp.static(sliding and not grown):
                    lift, hollow = trust * (wp.transpose(over - shear) * normal), trust * wp.dot(arch, normal)
            bend = bend * trust
            shear = straight + (shear - straight) * trust
            if wp.static(sliding):
                if not slips:
                    h = params.h
                    along, shear, bend, held = slid(own_value, own_shear, own_bend, shear, bend, lift, hollow, normal, h)
                    own_velocity += along
                if wp.static(grown):
                    surface_growth[w] = pair(held * trust, real(0.0))
            if slips:
                along, shear = unstressed(flow - free * mean, free, shear, normal)
                own_velocity += along
                bend = vec()
            gradient += balanced * (density * inv_weight)
        else:
            shear = mat()
            bend = vec()
            if wp.static(grown):
                surface_growth[w] = pair()
        surface_pressure[w] = p
        if wp.static(spec.dry_walls):
            surface_wet[w] = wp.where(covered[w] != wp.uint8(0), real(1.0), wetted(nearest2, params.spacing))
        surface_gradient[w] = gradient
        surface_velocity[w] = own_velocity
        surface_shear[w] = shear
        surface_bend[w] = bend

    return wall_fit


@functools.cache
def make_wall_values(spec: Spec, sliding: bool = False, grown: bool = False) -> Any:
    """Return the kernel that gives every wall particle the pressure and mirrored velocity of the fit of its leader.

    sliding, grown: the fit is one of that name.
    """
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    velocity_at = make_velocity_at(spec)
    Pose = make_pose()
    turns = slipping(spec) and not sliding
    inflow = make_inflow(spec.precision)

    @wp.kernel(module="unique", enable_backward=False)
    def wall_values(
        first: int,
        fluid_count: int,
        params: Params,
        row_of_wall: wp.array(dtype=int),
        leader: wp.array(dtype=int),
        body_motion: wp.array(dtype=int),
        poses: wp.array(dtype=Pose),
        wall_body: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        boundary_volume: wp.array(dtype=real),
        slip: wp.array(dtype=wp.uint8),
        surface_pressure: wp.array(dtype=real),
        surface_wet: wp.array(dtype=real),
        surface_gradient: wp.array(dtype=vec),
        surface_velocity: wp.array(dtype=vec),
        surface_shear: wp.array(dtype=mat),
        surface_bend: wp.array(dtype=vec),
        surface_growth: wp.array(dtype=pair),
        state: wp.array(dtype=pair),
        slip_slope: wp.array(dtype=vec),
        mirror_velocity: wp.array(dtype=vec),
    ):
        w = wp.tid() + first
        i = w + fluid_count
        lead = row_of_wall[leader[w]]
        foot = position[lead + fluid_count] + wall_normal[lead] * wall_depth[lead]
        way = separation(position[i], foot, True, params)
        p = surface_pressure[lead] + wp.dot(surface_gradient[lead], way)
        if wp.static(spec.free_surface):
            p = wp.max(p, real(0.0))  # a wall does not pull on a fluid that may leave it
        volume = boundary_volume[w]
        if wp.static(spec.dry_walls):
            volume = volume * surface_wet[lead]
        state[i] = pair(p, volume)
        mirror = surface_velocity[lead] + surface_shear[lead] * way
        if wp.static(turns):
            across = surface_shear[lead] * wall_normal[w]
            slip_slope[w] = across - wall_normal[w] * wp.dot(across, wall_normal[w])
        if wp.static(sliding):
            mirror += surface_bend[lead] * (wall_depth[w] * wall_depth[w])
            if wp.static(grown):
                mirror += inflow(surface_growth[lead], -wall_depth[w]) * wall_normal[w]
        elif wp.static(spec.wall_no_slip):
            if slip[w] == wp.uint8(0):
                depth = wall_depth[w]
                arm = wall_normal[w] * depth
                own_velocity = velocity[i]
                if wp.static(spec.moving):
                    own_velocity = velocity_at(own_velocity, arm, wall_body[w], body_motion, poses)
                mirror = own_velocity - surface_shear[lead] * arm + surface_bend[lead] * (depth * depth)
        mirror_velocity[w] = mirror

    return wall_values
