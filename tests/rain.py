"""A scheme of particles that fall freely, leave through the lower side and enter at the upper one; for tests of births."""

import functools
from typing import Any

import numpy as np
import warp as wp

from warpsph.case.numerics import NumericsBase
from warpsph.engine.integrators import kick_drift_kick
from warpsph.engine.program import Births, BuildList, KeepList, Program, Stage
from warpsph.kernels.core.changes import make_due, make_exit
from warpsph.kernels.core.clock import LIVE, NEXT_ID, TIME, make_advance
from warpsph.kernels.core.fields import COMMON, FLOW, Field, always
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.core.updates import make_watch
from warpsph.scene.physics import Physics, smoothing_ratio, support_radius
from warpsph.schemes.base import Scheme

FALL = Field("fall", "vec", "fluid", False, always, "m/s^2", "acceleration of the fall")
OWN = {field.name: field for field in (*COMMON, *FLOW, FALL)}
FIELDS = [*COMMON, OWN["rest_volume"], FALL]


@functools.cache
def make_fall(spec: Spec) -> Any:
    """Return the kernel that writes the acceleration."""
    vec = types_of(spec).vec

    @wp.kernel(module="unique", enable_backward=False)
    def free_fall(first: int, weight: wp.array(dtype=vec), fall: wp.array(dtype=vec)):
        i = wp.tid() + first
        fall[i] = weight[0]

    return free_fall


@functools.cache
def make_entry(spec: Spec) -> Any:
    """Return the kernel over the particles of a layer that writes all layers that are due, each where it has fallen to."""
    real, vec, _, _ = types_of(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def enter(
        first: int,
        layer_size: int,
        layer_period: wp.float64,
        first_id: int,
        clock: wp.array(dtype=wp.float64),
        counters: wp.array(dtype=int),
        layers_due: wp.array(dtype=int),
        drop_volume: real,
        weight: wp.array(dtype=vec),
        sites: wp.array(dtype=vec),
        entry_velocity: wp.array(dtype=vec),
        anchor: wp.array(dtype=vec),
        offset: wp.array(dtype=vec),
        position: wp.array(dtype=vec),
        velocity: wp.array(dtype=vec),
        fall: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        particle_id: wp.array(dtype=int),
        alive: wp.array(dtype=wp.uint8),
    ):
        k = wp.tid() + first
        for layer in range(layers_due[0]):
            i = counters[LIVE] + layer * layer_size + k
            identity = counters[NEXT_ID] + layer * layer_size + k
            born = wp.float64((identity - first_id) / layer_size + 1) * layer_period
            age = real(clock[TIME] - born)
            x = sites[k] + entry_velocity[0] * age + weight[0] * (real(0.5) * age * age)
            anchor[i] = x
            offset[i] = vec()
            position[i] = x
            velocity[i] = entry_velocity[0] + weight[0] * age
            fall[i] = weight[0]
            rest_volume[i] = drop_volume
            particle_id[i] = identity
            alive[i] = wp.uint8(1)

    return enter


class RainNumerics(NumericsBase):
    """No keys beside those of every scheme."""


class Rain(Scheme):
    """Layers of drops enter at the upper side in even times with a downward speed."""

    name = "rain"
    summary = "drops that fall freely"
    numerics = RainNumerics
    period, speed, time_step = 0.0507, 1.0, 0.0005
    first_room = 0

    def fields(self):
        """Places, a volume, an acceleration."""
        return FIELDS

    def derive(self, case, geometry, row_list):
        """A fixed time step."""
        spec = Spec(
            dimension=case.dimension, precision=case.precision, periodic=tuple(case.periodic), scheme="rain",
            changing=True, row_list=row_list,
        )  # fmt: skip
        return Physics(
            spec=spec, choices={"courant": 1.0, "skin": 0.5, "unlock": 0.0}, reasons={},
            h=smoothing_ratio(case) * case.spacing, support=support_radius(case), sound_speed=(1.0,),
            scales={"velocity": 1.0}, step_cap={"fixed": self.time_step}, densities=(1000.0,), tension=np.zeros((1, 1)),
        )  # fmt: skip

    def room(self, case, geometry, physics):
        """Room for so many drops at first."""
        return self.first_room

    def fill(self, population, case, geometry, physics):
        """Volumes."""
        population.put("rest_volume", geometry.volume[: geometry.fluid_count])

    def values(self, params, case, geometry, physics, device):
        """The layer: its places, the velocity that it enters with, and its weight."""
        vec = types_of(physics.spec).vec
        count = round((case.domain.upper[0] - case.domain.lower[0]) / case.spacing)
        across = case.domain.lower[0] + (np.arange(count) + 0.5) * case.spacing
        self.layer = count
        sites = np.zeros((count, case.dimension))
        sites[:, 0], sites[:, 1] = across, case.domain.upper[1]
        return {
            "layer_size": count,
            "layer_period": wp.float64(self.period),
            "first_id": geometry.count,
            "weight": wp.array([list(case.gravity)], dtype=vec, device=device),
            "sites": wp.array(sites, dtype=vec, device=device),
            "entry_velocity": wp.array([[0.0, -self.speed, 0.0][: case.dimension]], dtype=vec, device=device),
            "layers_due": wp.zeros(1, dtype=int, device=device),
            "drop_volume": types_of(physics.spec).real(case.spacing**case.dimension),
        }

    def program(self, spec, choices):
        """Fall, leave, enter."""
        due, count = make_due()
        fall = Stage("fall", make_fall(spec), "fluid", "weight")
        step = [
            *kick_drift_kick(spec, {"fall": OWN["velocity"]}, {"velocity": OWN["offset"]}, [fall]),
            Stage("leave", make_exit(spec), "fluid", "drops that have fallen out of the domain"),
            Stage("watch", make_watch(spec), "fluid", "speeds and ways"),
            self.advance(spec),
            Births(
                [
                    Stage("due", due, "one", "layers that are due"),
                    Stage("enter", make_entry(spec), self.layer, "the layers"),
                    Stage("count", count, "one", "how many there are"),
                ]
            ),
            KeepList(),
        ]
        return Program(step=step, start=[BuildList("the first list"), fall], advance=self.advance(spec))

    def advance(self, spec):
        """Time and step."""
        return Stage("advance", make_advance(spec.precision), "one", "time")
