"""Flows whose maps are known: a scheme of particles along one, which shifts them on the way, and vortices that decay."""

import copy
import functools
from typing import Any

import numpy as np
import warp as wp

from warpsph.case.case import Case
from warpsph.case.numerics import NumericsBase
from warpsph.engine.program import BuildList, KeepList, Program, Stage
from warpsph.kernels.core.clock import FAULT, STEP, STEPS, TIME, make_advance
from warpsph.kernels.core.fields import COMMON, FLOW
from warpsph.kernels.core.pair import WRAPPED, list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.core.updates import make_watch
from warpsph.running.model import Model
from warpsph.scene.physics import Physics, smoothing_ratio, support_radius
from warpsph.schemes import map_stages, registry
from warpsph.schemes.base import Scheme

WANTED = ("rest_volume", "shift", "origin", "origin_change", "ftle_backward", "ftle_forward", "ftle_age", "ftle_way", "slip",
          "wall_depth", "wall_sides", "born")  # fmt: skip
FIELDS = [*COMMON, *(field for field in FLOW if field.name in WANTED)]
AMPLITUDE, SWAY = 0.1, 0.25  # of the double gyre, as usual; its period is 10


def double_gyre(x, t):
    """Velocity of the double gyre at places (n, 2), as NumPy has it."""
    a = SWAY * np.sin(0.2 * np.pi * t)
    f, slope = a * x[:, 0] ** 2 + (1 - 2 * a) * x[:, 0], 2 * a * x[:, 0] + 1 - 2 * a
    u = -np.pi * AMPLITUDE * np.sin(np.pi * f) * np.cos(np.pi * x[:, 1])
    return np.stack([u, np.pi * AMPLITUDE * np.cos(np.pi * f) * np.sin(np.pi * x[:, 1]) * slope], axis=1)


@functools.cache
def make_flow(name: str, spec: Spec) -> Any:
    """Return the `wp.func` flow(x, t) of a name: strain; in a plane rotation, stream or double_gyre too."""
    real, vec, _, _ = types_of(spec)
    pi, amplitude, sway = real(np.pi), real(AMPLITUDE), real(SWAY)

    if spec.dimension == 3 or name == "strain":

        @wp.func
        def flow(x: vec, t: real):
            v = vec()
            v[0] = x[0]
            v[1] = -x[1]
            return v

    elif name == "rotation":

        @wp.func
        def flow(x: vec, t: real):
            return vec(-x[1], x[0])

    elif name == "stream":

        @wp.func
        def flow(x: vec, t: real):
            return vec(real(1.0) + real(0.2) * wp.sin(real(2.0) * pi * x[1]), real(0.5))

    else:

        @wp.func
        def flow(x: vec, t: real):
            a = sway * wp.sin(real(0.2) * pi * t)
            f = a * x[0] * x[0] + (real(1.0) - real(2.0) * a) * x[0]
            slope = real(2.0) * a * x[0] + real(1.0) - real(2.0) * a
            u = -pi * amplitude * wp.sin(pi * f) * wp.cos(pi * x[1])
            return vec(u, pi * amplitude * wp.cos(pi * f) * wp.sin(pi * x[1]) * slope)

    return flow


@functools.cache
def make_drift_along(name: str, spec: Spec) -> Any:
    """Return the kernel that moves particles with the flow, by Runge and Kutta, and by the shift of the step before."""
    real, vec, _, _ = types_of(spec)
    flow = make_flow(name, spec)
    half, sixth = real(0.5), real(1.0 / 6.0)

    @wp.kernel(module="unique", enable_backward=False)
    def drift_along(
        first: int,
        clock: wp.array(dtype=wp.float64),
        shift: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        x = position[i] + shift[i]  # first, so that what follows it can be exact
        t = real(clock[TIME])
        dt = real(clock[STEP])
        k1 = flow(x, t)
        k2 = flow(x + k1 * (half * dt), t + half * dt)
        k3 = flow(x + k2 * (half * dt), t + half * dt)
        k4 = flow(x + k3 * dt, t + dt)
        way = offset[i] + (k1 + real(2.0) * (k2 + k3) + k4) * (sixth * dt) + shift[i]
        offset[i] = way
        position[i] = anchor[i] + way
        velocity[i] = k4

    return drift_along


@functools.cache
def make_some_shift(spec: Spec) -> Any:
    """Return the kernel that finds a shift: towards an even arrangement, and by chance, each in spacings a step at most."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def some_shift(
        first: int,
        particle_count: int,
        list_width: int,
        even_part: real,
        chance_part: real,
        params: Params,
        counters: wp.array(dtype=int),
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        wall_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        particle_id: wp.array(dtype=int),
        position: wp.array(dtype=vec),
        shift: wp.array(dtype=vec),
    ):
        i = wp.tid() + first
        wrapped = bool(False)
        if wp.static(any(spec.periodic)):
            wrapped = (int(flags[i]) & WRAPPED) != 0
        even = vec()
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        count = int(fluid_neighbours[i])
        if wp.static(spec.walls):
            count += int(wall_neighbours[i])
        end = k + count * step
        while k < end:
            d = separation(position[i], position[neighbour(neighbours, i, k)], wrapped, params)
            k += step
            even += slope(wp.length(d) * params.inv_h) * d
        dx = even * (params.g_norm * params.spacing * params.spacing * params.h * params.h * real(-0.1))
        most = even_part * params.spacing
        if wp.length(dx) > most:
            dx = dx * (most / wp.length(dx))
        state = wp.rand_init(particle_id[i], counters[STEPS])
        for axis in range(wp.static(spec.dimension)):
            dx[axis] += chance_part * params.spacing * real(wp.randf(state, -1.0, 1.0))
        shift[i] = dx

    return some_shift


class DriftingNumerics(NumericsBase):
    """No keys beside those of every scheme."""


class Drifting(Scheme):
    """Particles along a given flow."""

    name = "drifting"
    summary = "particles that go along a given flow"
    numerics = DriftingNumerics
    follows_origins = True

    def __init__(self, flow="strain", time_step=0.02, even=0.0, chance=0.0):
        self.flow, self.time_step, self.even, self.chance = flow, time_step, even, chance

    def fields(self):
        """Places, a volume, a shift."""
        return FIELDS

    def derive(self, case, geometry, row_list):
        """A fixed time step."""
        spec = Spec(
            dimension=case.dimension, precision=case.precision, periodic=tuple(case.periodic), scheme="drifting",
            walls=geometry.wall_count > 0, shifting=True, row_list=row_list,
        )  # fmt: skip
        return Physics(
            spec=spec, choices={"courant": 1.0, "skin": 0.3, "unlock": 0.0}, reasons={},
            h=smoothing_ratio(case) * case.spacing, support=support_radius(case), sound_speed=(1.0,),
            scales={"velocity": 1.0}, step_cap={"fixed": self.time_step}, densities=(1.0,), tension=np.zeros((1, 1)),
        )  # fmt: skip

    def fill(self, population, case, geometry, physics):
        """Volumes."""
        population.put("rest_volume", geometry.volume[: geometry.fluid_count])

    def values(self, params, case, geometry, physics, device):
        """How much is shifted."""
        return {"even_part": float(self.even), "chance_part": float(self.chance)}

    def program(self, spec, choices):
        """Move, find a shift, follow it."""
        advance = Stage("advance", make_advance(spec.precision), "one", "time")
        shift = [Stage("some_shift", make_some_shift(spec), "fluid", "shift"), *map_stages.follow_shift(spec)]
        step = [
            *map_stages.windows(spec),
            Stage("drift_along", make_drift_along(self.flow, spec), "fluid", "the given flow"),
            *shift,
            Stage("watch", make_watch(spec), "fluid", "speeds and ways"),
            advance,
            KeepList(),
        ]
        measures = map_stages.exponents(spec)
        return Program(step=step, start=[BuildList("the first list"), *shift], advance=advance, measures=measures)


# scenes ---------------------------------------------------------------------------------------------------------

BOTH = ["backward", "forward"]
WAVE = 2 * np.pi
NU = 0.001
VORTICES = {
    "dimension": 2,
    "particle_spacing": 1 / 32,
    "end_time": 0.25,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {"water": {"density": 1.0, "viscosity": NU}},
    "fluids": [{"phase": "water", "shape": "rest"}],
    "start": {"velocity": ["sin(2*pi*x)*cos(2*pi*y)", "-cos(2*pi*x)*sin(2*pi*y)"], "arrangement": "lattice"},
    "output": {"lyapunov": {"window": 0.2, "starts": 2, "direction": BOTH}},
}


def vortices(x, t):
    """Velocity of the decaying vortices at (n, 2)."""
    a, b = WAVE * x[:, 0], WAVE * x[:, 1]
    decay = np.exp(-2 * NU * WAVE**2 * t)
    return decay * np.stack([np.sin(a) * np.cos(b), -np.cos(a) * np.sin(b)], axis=1)


def case_of(data, **changes):
    """A case with changes by dotted path."""
    return Case.from_dict(copy.deepcopy(data)).replace(changes)


def along(flow, lower, upper, spacing, boundary, window, starts=2, device="cpu", threads=1, **keys):
    """A model of particles that go along a flow, ready for its first step."""
    if "drifting" in registry.names():
        registry.unregister("drifting")
    registry.register(Drifting(flow, **keys))
    case = Case.from_dict(
        {
            "dimension": len(lower),
            "precision": "float64",
            "particle_spacing": spacing,
            "end_time": 100.0,
            "domain": {"lower": lower, "upper": upper, "boundary": dict.fromkeys("xyz"[: len(lower)], boundary)},
            "phases": {"fluid": {"density": 1.0}},
            "fluids": [{"phase": "fluid", "shape": "rest"}],
            "start": {"arrangement": "lattice"},
            "numerics": {"scheme": "drifting"},
            "output": {"lyapunov": {"window": window, "starts": starts, "direction": BOTH}},
        }
    )
    return prepared(case, device, threads)


def prepared(case, device="cpu", threads=1):
    """A model ready for its first step."""
    model = Model(case, device=device, threads=threads)
    model.stepper.prepare(fresh=True)
    return model


def at(model, time):
    """The fluid at a later time."""
    model.stepper.run(time, 10**6)
    assert model.stepper.read()[1][FAULT] == 0
    return model.snapshot().fluid


def back(flow, x, end, start, steps=100):
    """Where what is at x (n, 2) at one time was at an earlier one, or will be at a later one; Runge and Kutta."""
    dt = (start - end) / steps
    for k in range(steps):
        t = end + k * dt
        k1 = flow(x, t)
        k2 = flow(x + dt / 2 * k1, t + dt / 2)
        k3 = flow(x + dt / 2 * k2, t + dt / 2)
        x = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + flow(x + dt * k3, t + dt))
    return x


def exponent(flow, x, end, start, apart):
    """The exponent of the exact flow map at x (n, 2), from points that are `apart` [1/s]."""
    sides = [np.array(e) * apart for e in ((1.0, 0.0), (0.0, 1.0))]
    columns = [(back(flow, x + e, end, start) - back(flow, x - e, end, start)) / (2 * apart) for e in sides]
    return np.log(np.linalg.svd(np.stack(columns, axis=2), compute_uv=False)[:, 0]) / abs(end - start)
