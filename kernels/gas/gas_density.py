"""Density, smoothing length and pressure of the gas (theory: compressible#c1-density)."""

import functools
from typing import Any

import warp as wp

from warpsph.kernels.core.lanes import lanes_of, shared
from warpsph.kernels.core.mirror import code_shift, make_images, make_sides
from warpsph.kernels.core.pair import WRAPPED, list_access
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import SWEEP_OPTIONS, Spec, types_of
from warpsph.kernels.core.varying_list import GROWTH

from .gas_fields import HELD

LEAST_OMEGA = 0.05  # of the factor Omega; it is near 1 wherever a gas has neighbours
SWEEPS = 20  # of Newton; from the length of the last step it takes two or three
TOLERANCE = {"float32": 1.0e-5, "float64": 1.0e-11}  # relative change of h after which it stops: rounding of the sum


@functools.cache
def make_gas_density(spec: Spec) -> Any:
    """Return the kernel that solves rho = sum m W(h), h = eta (m/rho)^(1/d) for each particle, and evaluates its state.

    With `beginning` the energy follows from the pressure that is in `state`, else the pressure from the energy, and no
    smoothing length grows beyond what the list was made for: the step is one in which `gas_watch` asks for a new list.
    """
    real, vec, _, pair = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    Phase = make_phase(spec.precision)
    Sides = make_sides(spec.dimension, spec.precision)
    shape, slope = make_smoothing(spec.kernel, spec.precision)
    apart = make_images(spec).apart
    list_begin, list_step, neighbour, Listed = list_access(spec)
    particle_of, lane_of, part_of, added = lanes_of(spec, real)
    image_bit = code_shift(spec.dimension)
    index_mask = (1 << image_bit) - 1
    tolerance = TOLERANCE[spec.precision]
    d = float(spec.dimension)

    @wp.func
    def volume_of(h: real):
        result = h
        for _axis in range(wp.static(spec.dimension - 1)):
            result = result * h
        return result

    @wp.kernel(module="unique", enable_backward=False, module_options=SWEEP_OPTIONS)
    def gas_density(
        first: int,
        particle_count: int,
        list_width: int,
        beginning: int,
        w_norm: real,
        crowding: real,
        params: Params,
        sides: Sides,
        phases: wp.array(dtype=Phase),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        held: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        mass: wp.array(dtype=real),
        smoothing: wp.array(dtype=real),
        listed_smoothing: wp.array(dtype=real),
        density: wp.array(dtype=real),
        stiffening: wp.array(dtype=real),
        total_energy: wp.array(dtype=real),
        energy: wp.array(dtype=real),
        density_excess: wp.array(dtype=real),
        state: wp.array(dtype=pair),
    ):
        t = wp.tid()
        i, lane = particle_of(t) + first, lane_of(t)
        xi = position[i]
        h = smoothing[i]
        mi = mass[i]
        rho = density[i]
        omega = real(1.0)
        solving = bool(True)
        if wp.static(spec.held):
            solving = held[i] != wp.uint8(HELD)
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        begin, stride = list_begin(i, list_width), list_step(particle_count)
        end = begin + int(fluid_neighbours[i]) * stride
        own_begin, step = part_of(begin, stride, lane)
        sweep = int(0)
        longest = real(1.0 + GROWTH) * listed_smoothing[i]
        if beginning == 1:
            longest = real(1.0e30)
        while solving:
            inverse = real(1.0) / h
            norm = w_norm / volume_of(h)
            total = mi * shape(real(0.0))
            if wp.static(spec.lanes > 1):
                total = wp.where(lane == 0, total, real(0.0))  # its own place counts once
            change = real(wp.static(d)) * total  # -h dW/dh without the norm
            k = int(own_begin)
            while k < end:
                j = neighbour(neighbours, i, k)
                k += step
                code = int(0)
                if wp.static(spec.mirror):
                    code = j >> image_bit
                    j = j & index_mask
                x = apart(xi, position[j], code, wrapped, params, sides)
                q = wp.sqrt(wp.dot(x, x)) * inverse
                w = mass[j] * shape(q)
                total += w
                change += real(wp.static(d)) * w + mass[j] * slope(q) * q * q
            if wp.static(spec.lanes > 1):
                total, change = added(total), added(change)
            rho = norm * total
            wanted = mi * crowding / volume_of(h)  # m (eta/h)^d
            ratio = norm * change / (real(wp.static(d)) * wanted)
            omega = real(1.0) - norm * change / (real(wp.static(d)) * rho)
            # f(h) = wanted - rho falls with the slope -(d/h) wanted (1 - ratio); steps are bounded until it is near
            factor = real(1.0) + (wanted - rho) / (real(wp.static(d)) * wanted * wp.max(real(1.0) - ratio, real(0.1)))
            if wp.static(spec.constant_h):
                factor = real(1.0)
                omega = real(1.0)
            sweep += 1
            full = h >= longest and factor > real(1.0)
            if wp.abs(factor - real(1.0)) < real(tolerance) or sweep == wp.static(SWEEPS) or full:
                solving = False
            else:
                h = wp.min(h * wp.clamp(factor, real(0.8), real(1.25)), longest)
            if lane == 0 and not solving:
                smoothing[i] = h
                density[i] = rho
                # of a particle without company it would be 0
                stiffening[i] = real(1.0) / (wp.max(omega, real(LEAST_OMEGA)) * rho * rho)
        if wp.static(spec.lanes > 1):
            if lane > 0:
                return
        heats = phases[0].gamma - real(1.0)
        kinetic = real(0.5) * wp.dot(velocity[i], velocity[i])
        pressure = state[i][0]
        if beginning == 1:
            energy[i] = pressure / (heats * rho)
            if wp.static(spec.runge_kutta):
                total_energy[i] = energy[i] + kinetic
        else:
            e = energy[i]
            if wp.static(spec.runge_kutta):
                e = total_energy[i] - kinetic
                energy[i] = e
            pressure = heats * rho * wp.max(e, real(0.0))
        state[i] = pair(pressure, mi / rho)
        density_excess[i] = rho / phases[0].density - real(1.0)

    return shared(gas_density, spec)
