"""The distance of a fluid particle from a body, at which it stops (theory: isph#bodies)."""

import functools
import math
from typing import Any

import warp as wp

from warpsph.kernels.core.pair import list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.poses import make_pose, make_velocity_at
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of

ROUNDING = 0.01  # distance of a foot from a plane that counts as none, in spacings
SMOOTH = 0.866  # cosine of 30 degrees: from face to face, and from a face to an edge, normals turn by more
ALONG = 0.01  # what decides between planes at the same distance: share of the way to the foot along the surface


@functools.cache
def make_contact(spec: Spec) -> Any:
    """Return the `wp.func` contact(i, x_i, ...) that writes normal, distance and speed of the surface before a particle.

    A plane goes through the foot of each boundary particle with an area, at right angles to its normal. That of the closest
    one is not enough: a particle at an edge of a body has the normal of one face, and its plane says nothing of a fluid
    particle before the other. A convex body is behind all of its planes, and the largest distance to one of them is that
    to it. So the plane is the one farthest from x_i, of those that bound a convex body together with that of the closest:
    each of both feet is behind the plane of the other. Of equal ones it is that whose foot is nearest along the surface. At
    the rim of the support planes may be missing, but what of a surface has its foot at a particle is no farther from it than
    the diagonal of a cell.

    In a hollow edge, as between the top of one body and the face of another, a particle has a second plane: that of the
    nearest foot before the first one, less than a cell aside, if it has another direction.

    Particles without an area, deeper or past the edge of a thin tail, where there is no surface, do not count.
    The speed is that of the plane at x_i: as a body turns its planes do. The normal is a mean of those of the surface around
    x_i: that of the foot of one boundary particle would take a share of what slides along a hollow wall at each stop.
    """
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    separation = separation_of(spec)
    shape, _ = make_smoothing(spec.kernel, spec.precision)
    list_begin, list_step, neighbour, Listed = list_access(spec)
    velocity_at = make_velocity_at(spec)
    Pose = make_pose()
    diagonal = math.sqrt(spec.dimension)

    @wp.func
    def contact(
        i: int,
        xi: vec,
        particle_count: int,
        list_width: int,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        wall_normal: wp.array(dtype=vec),
        wall_depth: wp.array(dtype=real),
        wall_area: wp.array(dtype=real),
        wall_body: wp.array(dtype=int),
        body_motion: wp.array(dtype=int),
        poses: wp.array(dtype=Pose),
        beside: wp.array(dtype=vec),
        wall_gap: wp.array(dtype=real),
        wall_pace: wp.array(dtype=real),
        beside_2: wp.array(dtype=vec),
        wall_gap_2: wp.array(dtype=real),
        wall_pace_2: wp.array(dtype=real),
    ):
        beside[i] = vec()
        beside_2[i] = vec()
        walls_begin = particle_count - wall_depth.shape[0]
        step = list_step(particle_count)
        begin = list_begin(i, list_width) + int(fluid_neighbours[i]) * step
        end = begin + int(wall_neighbours[i]) * step
        n_c = vec()
        to_c = vec()  # from the foot of the closest to the particle
        nearest = real(1.0e30)
        k = begin
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            b = j - walls_begin
            d = separation(xi, position[j], True, params)
            if wall_area[b] > real(0.0) and wp.length(d) < nearest:
                nearest = wp.length(d)
                n_c = wall_normal[b]
                to_c = d - wall_depth[b] * n_c
        pace_i = vec()
        to_i = vec()  # from the foot of the plane to the particle
        rounding = real(ROUNDING) * params.spacing
        most = real(-1.0e30)
        k = begin
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            b = j - walls_begin
            if wall_area[b] > real(0.0):
                n = wall_normal[b]
                d = separation(xi, position[j], True, params)
                to_j = d - wall_depth[b] * n
                between = to_c - to_j  # from the foot of the closest to that of j
                gap = wp.dot(n, to_j)
                score = gap - real(ALONG) * wp.length(to_j - gap * n)
                if score > most and wp.dot(n_c, between) <= rounding and wp.dot(n, between) >= -rounding:
                    most = score
                    beside[i] = n
                    wall_gap[i] = wp.max(gap, wp.length(to_c) - real(diagonal) * params.spacing)
                    pace = velocity[j]
                    if wp.static(spec.moving):
                        pace = velocity_at(pace, d, wall_body[b], body_motion, poses)
                    pace_i = pace
                    to_i = to_j
        # The surface turns from one boundary particle to the next: the normal at x_i is a mean of theirs.
        chosen = vec() + beside[i]
        mean = vec()
        nearest = real(diagonal) * params.spacing
        nearest = nearest * nearest
        k = begin
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            b = j - walls_begin
            n = wall_normal[b]
            if wall_area[b] > real(0.0):
                d = separation(xi, position[j], True, params)
                to_j = d - wall_depth[b] * n
                gap = wp.dot(n, to_j)
                aside = to_j - gap * n
                if wp.dot(n, chosen) > real(SMOOTH):
                    mean += n * (shape(wp.length(d) * params.inv_h) / shape(real(0.0)))
                elif (
                    wp.dot(chosen, to_i - to_j) > rounding
                    and wp.dot(aside, aside) < params.spacing * params.spacing
                    and wp.dot(to_j, to_j) < nearest
                ):
                    nearest = wp.dot(to_j, to_j)
                    pace = velocity[j]
                    if wp.static(spec.moving):
                        pace = velocity_at(pace, d, wall_body[b], body_motion, poses)
                    beside_2[i] = n
                    wall_gap_2[i] = gap
                    wall_pace_2[i] = wp.dot(n, pace)
        if wp.length(mean) > real(1.0e-6):
            beside[i] = wp.normalize(mean)
        wall_pace[i] = wp.dot(beside[i], pace_i)

    return contact
