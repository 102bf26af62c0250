"""Momentum sweep: pressure from the star states, viscosity, tension, gravity, shift (theory: riemann#a3 to riemann#a7).

    conservative ("plus"):  a_i = -(2/rho_i) sum_j p*_ij grad_i W V_j
    corrected ("minus"):    a_i = -(2/rho_i) B_i sum_j (p*_ij - p_i) grad_i W V_j,  B_i = [sum_j |W'| r e(x)e V_j]^-1

Between two fluids 2 (p*_ij - p_i) is that of an interface in the middle of the pair; the corrected form has it where it is,
rho_i/rho_ij (p_j + J - p_i), with the mean density of the way from i to j (riemann#way).

The corrected form balances a uniform pressure, a linear one and a Laplace jump exactly for any arrangement; it gives
up pairwise conservation of momentum and needs the shift to keep particles apart.

With it the density of a filled domain is held to the room that its particles take (no source equation):
    d ln rho_i/dt += G:M - tr(G) tr(M)/d + b |grad v| E_i,   E_i = sum_j V_j (1 - r^2/R^2)^4 / integral - 1
The first two take out what the moment M = -sum grad W (x) x V makes of a strain G in the continuity sweep; E_i sees what is
left: unlike sum W V it has hardly a bias or noise taken at particles (1e-4 and 2.5e-3 on shifted ones at R = 3 spacings, and
2e-5 on a square lattice, where the second power has 2e-3).

Walls: the one-sided Riemann problem between a fluid that moves at u_n into a wall and its mirror image has
    p*_i = p_i + Z_i max(u_n, 0)
A fluid that is whole up to the wall makes that pressure by itself, in the continuity sweep, within the time that sound takes
for a spacing. A particle without its own phase behind it does not: spray, or gas between a liquid and a wall. So the impact
term counts as far as the own phase is missing (`lone`), along the normal of all wall particles in reach. Nor has such a
particle a pressure gradient of its own that would hold it against what pushes it on: so far as it is lone and in the first
row, the wall takes up what accelerates or shifts it into the wall. Any particle that has lost half of the place of its row
touches the wall: each cell straight ahead takes up what drives it there, along its own axis; corners have two normals.
"""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.clock import MAXIMA, STEP
from warpsph.kernels.core.fields import FLUID
from warpsph.kernels.core.friction_slide import make_friction_slide
from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.pair import BAND, NEAR, WRAPPED, list_access, look_ahead, make_at, make_part, separation_of, way_of
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.planes import make_along_plane, make_cell_faces, make_planes
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, curvature_type, pair_sweep, types_of
from warpsph.kernels.core.time_signals import GRAVITY_NEXT, make_forcing
from warpsph.kernels.core.viscosity import (
    make_friction_slope,
    make_interface_stress,
    make_series_mean,
    make_viscosity,
    make_viscous_parts,
)
from warpsph.kernels.core.wall_share import PARALLEL

from .disorder import UNKNOWN, make_disorder_due, make_disorder_speed, make_own_gradient
from .interface_flow import make_density_between
from .meeting_phases import make_parts_jump
from .room import make_window
from .star import make_jump, make_one_sided, make_star
from .touch import make_touch

# Share of the acoustic impact pressure Z_i Z_j/(Z_i + Z_j) (u_i - u_j): all of it is stable up to dt = 1.05 h/c alone
# (theory: riemann#a9), and the light particle of a pair takes it twice over.
IMPACT_SHARE = 0.25
# How much more than its volume a particle of another phase counts for the shift. At rest nothing else holds two phases
# apart: pressure and jump are in balance for any arrangement, and noise would mix them. It opens every interface by a tenth
# of a spacing; drops at rest are whole without it too, late interfaces are worse (docs/records/formulation.md#room).
APART = 0.1
SMALLEST_MOMENT = 0.1  # determinant below which a neighbourhood is too thin to correct


@functools.cache
def make_momentum(spec: Spec) -> Any:
    """Return the momentum sweep of a `Spec`: writes acceleration, and shift with its change of density if asked."""
    real, vec, mat, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation, at_vec, at_pair = separation_of(spec), make_at(vec), make_at(pair)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    look, taken, onward = look_ahead(spec)
    _, star_pressure = make_star(spec.precision, spec.paper_star)
    density_between = make_density_between(spec)
    laplace_jump, parts_jump = make_jump(spec.precision), make_parts_jump(spec)
    curved = curvature_type(spec)
    alone_at_wall, wall_reaction = make_one_sided(spec.dimension, spec.precision)
    touching, held_off = make_touch(spec.dimension, spec.precision)
    no_planes, noted = make_planes(spec.dimension, spec.precision)
    cell_faces = make_cell_faces(spec.dimension, spec.precision)
    before_cell, along_cells = cell_faces.before, cell_faces.along
    along_plane = make_along_plane(spec.dimension, spec.precision, not spec.bodies)
    viscous = spec.viscosity != "none"
    viscous_term = make_viscosity(spec.viscosity if viscous else "morris", spec.dimension, spec.precision)
    share, with_way = make_viscous_parts(spec.viscosity if viscous else "morris", spec.dimension, spec.precision)
    friction_slope = make_friction_slope(spec.viscosity, spec.kernel, spec.dimension, spec.precision)
    with_velocity = real(share)
    gravity_of, body_force_of = make_forcing(spec)
    periodic = any(spec.periodic)
    jumps = spec.tension == "pressure_jump" and not spec.triple
    body_tension = spec.tension == "body_force"
    dimension = float(spec.dimension)
    sided = spec.multiphase and not spec.paper_star
    kinked = sided and spec.corrected  # its gradients see where the interface cuts a pair
    (_, due_next), speed_of_disorder = make_disorder_due(spec), make_disorder_speed(spec)
    own_gradient = make_own_gradient(spec)
    friction_slide = make_friction_slide(spec)
    way, part, part_of_pair = way_of(spec), make_part(vec), make_part(pair)
    window = make_window(spec.precision)
    series_mean = make_series_mean(spec.precision)
    stress_traction, stress_jump = make_interface_stress(spec.dimension, spec.precision)
    particle_of, lane_of, part_of, added, added_vec, added_mat = lanes_of(spec, real, vec, mat)

    # of what it sums, vectors and matrices in 3-D and numbers in float64 take more registers
    @wp.kernel(**pair_sweep(spec, 4 - (spec.dimension > 2) - (spec.precision == "float64")))
    def momentum(
        first: int,
        slot: int,
        particle_count: int,
        list_width: int,
        params: Params,
        phases: wp.array(dtype=Phase),
        tension: wp.array(dtype=real),
        clock: wp.array(dtype=wp.float64),
        forcing: wp.array(dtype=vec),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        phase: wp.array(dtype=wp.int8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        state: wp.array(dtype=pair),
        rest_volume: wp.array(dtype=real),
        curvature: wp.array(dtype=curved),
        interface_weight: wp.array(dtype=curved),
        normal: wp.array(dtype=vec),
        mirror_velocity: wp.array(dtype=vec),
        slip_slope: wp.array(dtype=vec),
        slip: wp.array(dtype=wp.uint8),
        boundary_volume: wp.array(dtype=real),
        wall_depth: wp.array(dtype=real),
        wall_normal: wp.array(dtype=vec),
        wall_acceleration: wp.array(dtype=vec),
        wall_body: wp.array(dtype=int),
        side_walls: int,
        density_excess: wp.array(dtype=real),
        settled: wp.array(dtype=real),
        wall_impact: wp.array(dtype=real),
        wall_plane: wp.array(dtype=vec),
        acceleration: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
        carried: wp.array(dtype=vec),
        facing: wp.array(dtype=vec),
        interface_depth: wp.array(dtype=real),
        velocity_gradient: wp.array(dtype=mat),
        gradient_at_interface: wp.array(dtype=mat),
        pressure_gradient: wp.array(dtype=vec),
        maxima: wp.array(dtype=real),
        zone: wp.array(dtype=wp.int8),
        flow_gradient: wp.array(dtype=mat),
        disorder_speed: wp.array(dtype=real),
        disorder_force: wp.array(dtype=vec),
        counters: wp.array(dtype=int),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        if wp.static(spec.open_axis >= 0):
            if int(zone[i]) != FLUID:
                # nothing pushes a buffer: `open_flow` says how it moves
                acceleration[i] = vec()
                if wp.static(spec.disorder):
                    disorder_speed[i] = real(UNKNOWN)
                    disorder_force[i] = vec()
                if wp.static(spec.shifting):
                    shift[i] = vec()
                    carried[i] = vec()
                return
        xi = position[i]
        vi = velocity[i]
        state_i = state[i]
        p_i = state_i[0]
        own = phases[0]
        own_phase = int(0)
        if wp.static(spec.multiphase):
            own_phase = int(phase[i])
            own = phases[own_phase]
        wrapped = bool(False)
        near = bool(False)
        beside = bool(False)  # another phase is within the support, and not just in the list
        band = bool(False)
        if wp.static(periodic or spec.multiphase):
            flag = int(flags[i])
            wrapped = (flag & WRAPPED) != 0
            near = (flag & NEAR) != 0
            band = (flag & BAND) != 0
        rho_i = own.density * rest_volume[i] / state_i[1]

        pressure_sum = vec()  # sum of 2 p* or of r.grad p, times F V x_ij
        own_sum = vec()  # the same over the own phase alone: its pressure gradient carries the density in a shift
        viscous_sum = vec()
        even = vec()  # sum of F V x_ij, zero on an even arrangement
        apart = vec()  # the extra weight of other phases in it, for the shift
        flow = mat()  # sum of (v_j - v_i) (x) F V x_ij over the own phase: its velocity gradient
        wall_flow = mat()  # the same over no-slip walls and the velocities mirrored in them
        clings = bool(False)  # a no-slip wall is within the support
        d = vec()
        own_even = vec()  # sum of F V x_ij over the own phase
        into_wall = vec()  # the same over walls: their normal, away from the fluid
        gap2 = params.spacing * params.spacing  # square of the distance to the nearest wall cell [m^2]
        face_gap = vec(params.spacing)  # clearance along each axis to the wall cell straight ahead [m]
        face_side = vec()  # whether that cell is above (1) or below (-1)
        face_speed = vec()  # speed of that cell along the axis [m/s]
        # bodies: planes of their surfaces, and of the sides of the domain: a slope may lie nearest to the axis of its floor
        faces, sides = no_planes(params.spacing), no_planes(params.spacing)
        nearest2 = real(4.0) * params.h * params.h  # bodies: square of the distance to the nearest foot of all [m^2]
        touch = vec()  # share of what drives the particle along each axis that such a cell takes up
        first_row = real(0.0)  # 1 in the first row before a wall, 0 from the second on
        approach = real(0.0)  # sum of F V x_ij.(v_i - v_w): speed into the wall times |into_wall|
        repulsion = vec()
        moment = mat()
        washboard = vec()  # sum of 2 p_i F V x_ij over walls that push
        before, low, high = vec(), vec(), vec()  # the faces of cells and how far they go, see `planes`
        plane_normal, plane = vec(), bool(True)  # of the first wall particle, and that of all others
        half_cell = vec(real(0.5) * params.spacing)
        half_row = real(0.5) * params.spacing * params.inv_h  # least depth that friction counts
        lone = real(0.0)
        room = state_i[1]  # sum of (1 - r^2/R^2)^4 V, its own place included
        if wp.static(spec.lanes > 1):
            room = wp.where(lane == 0, room, real(0.0))  # its own place counts once
        fluid_count = particle_count - slip.shape[0]
        if wp.static(spec.bodies):
            fluid_count = particle_count - boundary_volume.shape[0]
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        k, step = part_of(begin, stride, lane)
        ahead = look(neighbours, i, k, end)
        if wp.static(spec.multiphase):
            if near:
                kappa_i = real(0.0)
                w_i = real(0.0)
                if wp.static(jumps):
                    kappa_i = curvature[i]
                    w_i = interface_weight[i]
                while k < end:
                    j = taken(ahead, neighbours, i, k)
                    k, ahead = onward(neighbours, i, k, step, end)
                    d = separation(xi, at_vec(position, j), wrapped, params)
                    r2 = wp.dot(d, d)
                    state_j = at_pair(state, j)
                    f = slope(wp.sqrt(r2) * params.inv_h) * state_j[1]
                    fd = f * d
                    if wp.static(spec.corrected):
                        moment -= wp.outer(d, fd)
                    if wp.static(spec.shifting):
                        even += fd
                    if wp.static(spec.room):
                        room += window(r2, params.inv_window) * state_j[1]
                    other_phase = int(phase[j])
                    mu = own.viscosity
                    if other_phase == own_phase:
                        if wp.static(spec.walls):
                            own_even += fd
                        if wp.static(spec.shifting):
                            flow += wp.outer(at_vec(velocity, j) - vi, fd)
                        if wp.static(spec.corrected):
                            own_sum += (state_j[0] - p_i) * fd
                        else:
                            pressure_sum += (state_j[0] + p_i) * fd
                            if wp.static(spec.shifting):
                                own_sum += (state_j[0] - p_i) * fd
                    else:
                        if wp.static(spec.shifting):
                            apart += real(APART) * fd
                        other = phases[other_phase]
                        beside = beside or f != real(0.0)
                        if wp.static(spec.unlike_viscosity):
                            a_i, a_j = interface_depth[i], interface_depth[j]
                            mu = series_mean(own.viscosity, other.viscosity, a_i, a_j, half_row)
                        elif wp.static(viscous):
                            mu = series_mean(own.viscosity, other.viscosity, real(1.0), real(1.0), real(0.0))
                        jump = real(0.0)
                        if wp.static(spec.triple):
                            jump = parts_jump(tension, own_phase, other_phase, curvature, interface_weight, i, j)
                        elif wp.static(jumps):
                            sigma = tension[own_phase * phases.shape[0] + other_phase]
                            jump = laplace_jump(sigma, kappa_i, curvature[j], w_i, interface_weight[j])
                        if wp.static(spec.viscous_jump):
                            thick = wp.where(own.viscosity > other.viscosity, i, j)
                            grad = gradient_at_interface[thick]
                            here = stress_jump(own.viscosity, other.viscosity, grad, facing[thick])
                            jump += here
                            viscous_sum += stress_traction(own.viscosity, mu, grad, facing[i], fd)
                        if wp.static(kinked):
                            # fluids that touch have one acceleration: that is r.grad p of the own phase
                            rho_ij = density_between(i, j, facing, interface_depth, own.density, other.density)
                            if wp.static(spec.viscous_jump):
                                # Along the interface the jump is that at the place of the neighbour. That of a thinner
                                # particle is: its normal is the neighbour's.
                                if thick == i and wp.dot(facing[i], facing[j]) < real(0.0):
                                    there = stress_jump(own.viscosity, other.viscosity, grad, facing[j])
                                    along = fd - wp.dot(facing[i], fd) * facing[i]
                                    pressure_sum += (own.density / rho_ij * (there - here)) * along
                            rise = own.density / rho_ij * (state_j[0] + jump - p_i)
                        else:
                            rise = real(2.0) * star_pressure(p_i, state_j[0], own.density, other.density, jump)
                            if wp.static(spec.corrected):
                                rise -= real(2.0) * p_i
                        if wp.static(sided):
                            # Directions that do not oppose: no common interface, one of the two is a splinter of a few
                            # particles in the other phase, or a film of one row. Its own phase does not hold it, and the
                            # weighted p* is all but its own pressure: without the impact term of the Riemann problem it
                            # would fly through the other phase like a bullet.
                            alone = wp.clamp(real(1.0) + real(2.0) * wp.dot(facing[i], facing[j]), real(0.0), real(2.0))
                            z = own.impedance * other.impedance / (own.impedance + other.impedance)
                            impact = wp.dot(vi - at_vec(velocity, j), d) / wp.sqrt(r2 + params.tiny)
                            rise -= (real(2.0 * IMPACT_SHARE) * alone) * z * impact
                        pressure_sum += rise * fd
                        if wp.static(spec.interface_force):
                            repulsion += (wp.abs(p_i) + wp.abs(state_j[0])) * fd
                    if wp.static(viscous):
                        rub = mu * (friction_slope(wp.sqrt(r2) * params.inv_h) * state_j[1])
                        viscous_sum += rub * viscous_term(vi - at_vec(velocity, j), d, r2 + params.tiny, params.inv_h)
        # sums of their own: what leaves the loop as a vector is one in it, see `make_part`
        p_own, p_pair, e_own, e_all, drag_sum, m_sum, f_sum = vec(), vec(), vec(), vec(), vec(), mat(), mat()
        while k < end:
            j = taken(ahead, neighbours, i, k)
            k, ahead = onward(neighbours, i, k, step, end)
            r2, closing = real(0.0), real(0.0)
            for axis in range(wp.static(spec.dimension)):
                d[axis] = way(xi[axis], part(position, j, axis), axis, wrapped, params)
                r2 += d[axis] * d[axis]
                if wp.static(viscous):
                    closing += (vi[axis] - part(velocity, j, axis)) * d[axis]
            p_j, volume = part_of_pair(state, j, 0), part_of_pair(state, j, 1)
            q = wp.sqrt(r2) * params.inv_h
            f, rub = slope(q) * volume, own.viscosity * (friction_slope(q) * volume)
            drag = rub * with_way(closing, r2 + params.tiny, params.inv_h)
            for axis in range(wp.static(spec.dimension)):
                fd_axis = f * d[axis]
                if wp.static(spec.corrected or spec.shifting):
                    p_own[axis] += (p_j - p_i) * fd_axis
                if wp.static(not spec.corrected):
                    p_pair[axis] += (p_j + p_i) * fd_axis
                if wp.static(spec.walls):
                    e_own[axis] += fd_axis
                if wp.static(spec.shifting):
                    e_all[axis] += fd_axis
                if wp.static(viscous):
                    drag_sum[axis] += rub * with_velocity * (vi[axis] - part(velocity, j, axis))
                    drag_sum[axis] += drag * d[axis]
                for row in range(wp.static(spec.dimension)):
                    if wp.static(spec.corrected):
                        m_sum[axis, row] -= fd_axis * d[row]
                    if wp.static(spec.shifting):
                        f_sum[row, axis] += (part(velocity, j, row) - vi[row]) * fd_axis
            if wp.static(spec.room):
                room += window(r2, params.inv_window) * volume
        for axis in range(wp.static(spec.dimension)):
            own_sum[axis] += p_own[axis]
            pressure_sum[axis] += p_pair[axis]
            own_even[axis] += e_own[axis]
            even[axis] += e_all[axis]
            viscous_sum[axis] += drag_sum[axis]
            for row in range(wp.static(spec.dimension)):
                moment[axis, row] += m_sum[axis, row]
                flow[axis, row] += f_sum[axis, row]
        if wp.static(spec.lanes > 1):
            pressure_sum, own_sum = added_vec(pressure_sum), added_vec(own_sum)
            if wp.static(viscous):
                viscous_sum = added_vec(viscous_sum)
            if wp.static(spec.shifting):
                even, apart, flow = added_vec(even), added_vec(apart), added_mat(flow)
            if wp.static(spec.walls):
                own_even = added_vec(own_even)
            if wp.static(spec.corrected):
                moment = added_mat(moment)
            if wp.static(spec.room):
                room = added(room)
            if wp.static(spec.interface_force):
                repulsion = added_vec(repulsion)
            if wp.static(spec.multiphase):
                beside = added(wp.where(beside, real(1.0), real(0.0))) > real(0.0)
            inner, known = mat(), bool(False)
            if wp.static(spec.disorder):
                if due_next(counters):
                    inner, known = own_gradient(
                        i, lane, list_width, particle_count, wrapped, params, neighbours, fluid_neighbours, phase, position,
                        velocity, state)  # fmt: skip
            if lane > 0:
                return
            k, step = end, stride
        if wp.static(spec.walls):
            end += int(wall_neighbours[i]) * step
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                d = separation(xi, at_vec(position, j), wrapped, params)
                r2 = wp.dot(d, d)
                wall_volume = params.wall_volume
                if wp.static(spec.bodies):
                    wall_volume = at_pair(state, j)[1]
                q = wp.sqrt(r2) * params.inv_h
                f, rub = slope(q) * wall_volume, own.viscosity * (friction_slope(q) * wall_volume)
                fd = f * d
                into_wall += fd
                if wp.static(spec.disorder and spec.wall_no_slip):
                    clings = clings or (slip[j - fluid_count] == wp.uint8(0) and f != real(0.0))
                if wp.static(not spec.bodies):
                    beyond = wp.max(wp.abs(d) - half_cell, vec())
                    gap2 = wp.min(gap2, wp.dot(beyond, beyond))
                    for axis in range(wp.static(spec.dimension)):
                        across = beyond
                        across[axis] = real(0.0)
                        if wp.dot(across, across) == real(0.0):
                            # this cell is straight ahead along the axis
                            clear = wp.abs(d[axis]) - half_cell[axis]
                            if clear < face_gap[axis]:
                                face_gap[axis] = clear
                                face_side[axis] = -wp.sign(d[axis])
                                face_speed[axis] = at_vec(velocity, j)[axis]
                if wp.static(spec.bodies):
                    # the surface as the plane at the nearest foot: one for each axis that a normal may lie nearest to. A
                    # foot that is farther than a spacing is not that of a plane which the particle is about to touch.
                    w = j - fluid_count
                    n_w = wall_normal[w]
                    clear = wp.dot(d, n_w) - wall_depth[w]
                    foot2 = r2 - wall_depth[w] * (real(2.0) * clear + wall_depth[w])
                    if foot2 < nearest2:
                        nearest2 = foot2
                        gap2 = wp.clamp(clear, real(0.0), params.spacing)
                        gap2 = gap2 * gap2
                    if foot2 < params.spacing * params.spacing:
                        if wall_body[w] > side_walls:
                            faces = noted(faces, n_w, clear, foot2, wp.dot(at_vec(velocity, j), n_w))
                        elif wp.max(wp.abs(n_w)) > real(0.99):
                            # an edge of the domain is no plane: its cells are behind two sides at once
                            sides = noted(sides, n_w, clear, foot2, wp.dot(at_vec(velocity, j), n_w))
                approach += wp.dot(vi - at_vec(velocity, j), fd)
                p_wall = at_pair(state, j)[0]
                if wp.static(spec.multiphase and not spec.bodies):
                    # the one-sided state of this particle's own fluid: extrapolated from several fluids at a contact
                    # line, the wall would pull the light one with the weight of the heavy one
                    p_wall = p_i
                    if wp.static(spec.gravity):
                        p_wall -= rho_i * wp.dot(gravity_of(params, forcing, GRAVITY_NEXT), d)
                if wp.static(spec.bodies):
                    mirror = mirror_velocity[j - fluid_count]
                if wp.static(spec.multiphase and spec.bodies):
                    # one-sided too: a fit over several fluids is that of none
                    borne = gravity_of(params, forcing, GRAVITY_NEXT) + body_force_of(params, forcing)
                    if wp.static(spec.moving):
                        borne -= wall_acceleration[j - fluid_count]
                    p_wall = p_i - rho_i * wp.dot(borne, d)
                    mirror = real(2.0) * at_vec(velocity, j) - vi
                    slips = bool(True)
                    if wp.static(spec.wall_no_slip):
                        slips = slip[j - fluid_count] != wp.uint8(0)
                    if slips:
                        n_w = wall_normal[j - fluid_count]
                        mirror = vi + (real(2.0) * wp.dot(at_vec(velocity, j) - vi, n_w)) * n_w
                if wp.static(spec.corrected):
                    moment -= wp.outer(d, fd)
                    own_sum += (p_wall - p_i) * fd
                else:
                    p_both = p_wall + p_i
                    if wp.static(spec.free_surface):
                        p_both = wp.max(p_both, real(0.0))  # a wall does not hold back a fluid that leaves it
                    pressure_sum += p_both * fd
                    # of the own pressure: along a plane it is how the wall's particles lie (theory: riemann#smooth)
                    if p_both > real(0.0):
                        washboard += (real(2.0) * p_i) * fd
                    if f != real(0.0):
                        if wp.static(spec.bodies):
                            if wp.dot(plane_normal, plane_normal) == real(0.0):
                                plane_normal = wall_normal[j - fluid_count]
                            plane = plane and wp.dot(wall_normal[j - fluid_count], plane_normal) > real(PARALLEL)
                        else:
                            before = wp.max(before, before_cell(d, half_cell[0]))
                            low, high = wp.min(low, d), wp.max(high, d)
                    if wp.static(spec.shifting):
                        own_sum += (p_wall - p_i) * fd
                if wp.static(spec.shifting):
                    even += fd
                if wp.static(spec.room):
                    room += window(r2, params.inv_window) * wall_volume
                if wp.static(spec.bodies and spec.shifting):
                    wall_flow += wp.outer(mirror - vi, fd)
                if wp.static(spec.bodies and viscous):
                    # along a wall without friction its own velocity and a slope that bears no stress, not the mirrored one
                    slide = friction_slide(j - fluid_count, vi, mirror, d, slip, wall_normal, slip_slope)
                    viscous_sum += rub * viscous_term(slide, d, r2 + params.tiny, params.inv_h)
                if wp.static(spec.wall_no_slip and not spec.bodies):
                    if slip[j - fluid_count] == wp.uint8(0):
                        mirror = mirror_velocity[j - fluid_count]
                        if wp.static(spec.shifting):
                            wall_flow += wp.outer(mirror - vi, fd)
                        viscous_sum += rub * viscous_term(vi - mirror, d, r2 + params.tiny, params.inv_h)

        if wp.static(spec.walls and not spec.corrected):
            if wp.static(not spec.bodies):
                plane_normal = along_cells(before, low, high, params.spacing)
            elif not plane:
                plane_normal = vec()
            wall_plane[i] = plane_normal
            pressure_sum -= along_plane(plane_normal, washboard)
        wall_push = real(0.0)
        if wp.static(spec.walls):
            gap = wp.sqrt(gap2) / params.spacing
            first_row = wp.clamp(real(2.0) - real(2.0) * gap, real(0.0), real(1.0))
            lone = alone_at_wall(into_wall, own_even, params.g_norm * params.h)
            if lone > real(0.0) and approach > real(0.0):
                # A gas that is pressed has the impedance rho c of the density that it has. Twice: the state in the mirror
                # has the pressure p* too.
                impedance = own.impedance * wp.pow(rho_i / own.density, real(0.5) * (own.gamma + real(1.0)))
                wall_push = real(2.0) * lone * impedance * approach / wp.length(into_wall)
                # backward Euler: however near the wall is, it stops a particle and does not throw it back
                damping = real(2.0) * lone * impedance * wp.length(into_wall) * params.g_norm / rho_i
                wall_push /= real(1.0) + damping * real(clock[STEP])

        g_norm = params.g_norm
        a = vec()
        gradient = own_sum * g_norm  # of the pressure, from the own phase [Pa/m]
        inner_shear = flow * g_norm  # velocity gradient of the fluid alone [1/s]
        shear = inner_shear  # with what no-slip walls make of it, shear[a, b] = d v_a / d x_b [1/s]
        if wp.static((spec.wall_no_slip or spec.bodies) and spec.shifting):
            shear = (flow + wall_flow) * g_norm
        if wp.static(spec.corrected):
            total = (pressure_sum + own_sum) * g_norm
            m = moment * g_norm
            usable = bool(False)
            if wp.determinant(m) > real(SMALLEST_MOMENT):
                usable = bool(True)
                inverse = wp.inverse(m)
                total = inverse * total
                gradient = inverse * gradient
                if wp.static(spec.shifting):
                    shear = shear * inverse
                    if wp.static(spec.wall_no_slip or spec.bodies):
                        inner_shear = inner_shear * inverse
                    if wp.static(spec.viscosity == "morris" or spec.viscosity == "radial"):
                        # Both forms are exact for a quadratic field on an even arrangement: take out what an uneven one
                        # makes of a linear field, and divide by the second moment (theory: common#lattice, column L).
                        if not near:
                            linear = shear * even
                            if wp.static(spec.viscosity == "radial"):
                                # exact for rotation and dilation; a strain leaves the traceless part of a third moment
                                linear = linear + wp.transpose(shear) * even + wp.trace(shear) * even
                            viscous_sum -= (real(2.0) * own.viscosity) * linear
                            viscous_sum = viscous_sum * (real(dimension) / wp.trace(m))
                        elif wp.static(sided and spec.viscosity == "morris"):
                            # the same with the gradient of the own phase: fluids that turn together feel nothing
                            viscous_sum -= (real(2.0) * own.viscosity) * (velocity_gradient[i] * even)
            a = total * (real(-1.0) / rho_i)
        else:
            a = pressure_sum * (-g_norm / rho_i)
        if wp.static(viscous):
            a += viscous_sum * (g_norm / rho_i)
        if wp.static(spec.disorder):
            a += disorder_force[i]
        if wp.static(spec.interface_force):
            a -= repulsion * (params.zeta * g_norm / rho_i)
        if wp.static(body_tension):
            # F = sigma kappa grad(own fraction): inward where the own phase is convex. One coefficient per own phase.
            if band:
                a += normal[i] * (tension[own_phase * phases.shape[0] + own_phase] * curvature[i] / rho_i)
        if wp.static(spec.gravity):
            a += gravity_of(params, forcing, GRAVITY_NEXT)
        if wp.static(spec.body_force):
            a += body_force_of(params, forcing)
        if wp.static(spec.central_force):
            a -= params.pull * (xi - params.center)
        if wp.static(spec.walls):
            # without the correction, which would take what is missing behind the particle for an uneven arrangement
            a -= into_wall * (wall_push * g_norm / rho_i)
            if lone * first_row > real(0.0):
                reaction = wall_reaction(a, into_wall, lone * first_row)
                a += reaction
                wall_push += rho_i * wp.length(reaction) / (wp.length(into_wall) * g_norm)
            touch, side_touch = touching(face_gap, params.spacing), vec()
            if wp.static(spec.bodies):
                touch, side_touch = touching(faces.gap, params.spacing), touching(sides.gap, params.spacing)
                damping = real(2.0) * own.sound_speed * wp.length(into_wall) * g_norm
                damping = damping / (real(1.0) + damping * real(clock[STEP]))  # backward Euler
                unheld = a
                a = held_off(a, vi, side_touch, sides.speed, sides.normal, damping)
                a = held_off(a, vi, touch, faces.speed, faces.normal, damping)
                wall_push += rho_i * wp.length(a - unheld) / wp.max(wp.length(into_wall) * g_norm, real(1.0e-6) / params.h)
            for axis in range(wp.static(0 if spec.bodies else spec.dimension)):
                if touch[axis] > real(0.0):
                    side = face_side[axis]
                    drive = wp.max(a[axis] * side, real(0.0))
                    speed = wp.max((vi[axis] - face_speed[axis]) * side, real(0.0))
                    damping = real(2.0) * own.sound_speed * wp.abs(into_wall[axis]) * g_norm
                    drive += speed * damping / (real(1.0) + damping * real(clock[STEP]))
                    a[axis] -= touch[axis] * drive * side
                    wall_push += rho_i * touch[axis] * drive / (wp.length(into_wall) * g_norm)
            wall_impact[i] = wall_push
        acceleration[i] = a
        if wp.static(spec.bodies and spec.corrected):
            pressure_gradient[i] = gradient

        if wp.static(spec.disorder):
            if due_next(counters):
                # of the fluid alone: mirrored velocities of no-slip walls are no part of the flow between particles
                if wp.static(spec.lanes == 1):  # else known before the lanes part
                    inner, known = own_gradient(
                        i, lane, list_width, particle_count, wrapped, params, neighbours, fluid_neighbours, phase, position,
                        velocity, state)  # fmt: skip
                speed = real(UNKNOWN)
                if known:
                    speed = speed_of_disorder(inner, clings, params, own)
                flow_gradient[i] = inner
                disorder_speed[i] = speed

        if wp.static(spec.shifting):
            # The flow disorders particles at the rate of its velocity gradient, so the shift works at that rate: a resting
            # or a uniformly moving fluid is not stirred.
            dt = real(clock[STEP])
            strength = wp.sqrt(wp.ddot(shear, shear)) * dt
            dx = (even + apart) * (-params.shifting * strength * params.h * params.h * g_norm)
            length = wp.length(dx)
            cap = params.shift_cap * params.h
            if length > cap:
                dx = dx * (cap / length)
            if wp.static(spec.walls):
                dx += wall_reaction(dx, into_wall, lone * first_row)
                for axis in range(wp.static(spec.dimension)):
                    if wp.static(spec.bodies):
                        dx -= (touch[axis] * wp.min(wp.dot(dx, faces.normal[axis]), real(0.0))) * faces.normal[axis]
                        dx -= (side_touch[axis] * wp.min(wp.dot(dx, sides.normal[axis]), real(0.0))) * sides.normal[axis]
                    elif dx[axis] * face_side[axis] > real(0.0):
                        dx[axis] -= touch[axis] * dx[axis]
            shift[i] = dx
            # What the particle carries is that of its new place: dv = grad v dx, ds = dx.grad p / (rho0 c^2). The mirrored
            # velocities take no part: the shift keeps a particle off a wall that the flow holds it against, step by step,
            # and would pump up its velocity each time, up to 14-fold with what is mirrored far behind the wall.
            if wp.static(spec.wall_no_slip or spec.bodies):
                carried[i] = inner_shear * dx
            else:
                carried[i] = shear * dx
            s = density_excess[i] + wp.dot(dx, gradient) * own.compressibility
            if wp.static(spec.relaxation):
                settled[i] += wp.dot(dx, gradient)
            if wp.static(spec.room):
                # E: how far the place that the particles take falls short of what their densities say
                change = params.room * strength * (room * params.window_norm - real(1.0))
                whole = usable
                if wp.static(spec.walls):
                    whole = whole and wall_neighbours[i] == wp.int16(0)
                strain = shear
                if wp.static(spec.multiphase):
                    if beside:
                        if wp.static(sided):
                            strain = velocity_gradient[i]
                        else:
                            whole = False
                if whole:
                    # The continuity sweep has tr(G M) instead of tr(G). A strain draws the arrangement out along itself, so
                    # that the moment M is not isotropic in just the directions that count: the error has one sign.
                    change += dt * (wp.ddot(strain, m) - wp.trace(strain) * wp.trace(m) / real(dimension))
                s += (real(1.0) + s) * change
            density_excess[i] = s
            s2 = wp.dot(dx, dx)
            if s2 > maxima[slot * MAXIMA + 3]:
                wp.atomic_max(maxima, slot * MAXIMA + 3, s2)
        if wp.static(spec.viscous_stages == 1):
            a2 = wp.dot(a, a)
            if a2 > maxima[slot * MAXIMA + 1]:
                wp.atomic_max(maxima, slot * MAXIMA + 1, a2)

    return shared(momentum, spec)
