"""A case brought to a device: geometry, physics, particles and stepper, with host snapshots of the state."""

from __future__ import annotations

import dataclasses
import gc
import math
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpsph.case.signals import vector_at
from warpsph.engine.device_clock import DeviceClock
from warpsph.engine.launch import Launcher
from warpsph.engine.level import Level
from warpsph.engine.neighbours import default_width
from warpsph.engine.population import Population
from warpsph.engine.stepper import Stepper
from warpsph.errors import WarpsphError
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core.fields import FLUID as IN_FLUID
from warpsph.kernels.core.lanes import lanes_for
from warpsph.kernels.core.leaks import EVERYWHERE, LARGEST, LAST
from warpsph.kernels.core.mirror import FREE_SLIP, NO_SLIP, NO_WALL, make_sides
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.poses import make_pose
from warpsph.kernels.core.smoothing import KERNELS, window_integral
from warpsph.kernels.core.spec import few_particles, types_of
from warpsph.kernels.core.time_signals import FORCING_SIZE, depends_on_time
from warpsph.measure.totals import Scene, eos_of_run
from warpsph.running import memory
from warpsph.running.device_sums import DeviceSums
from warpsph.running.exponents import KEPT, window_values
from warpsph.running.flow_fields import FlowFields
from warpsph.running.restarts import reached
from warpsph.running.state_copy import copy_state
from warpsph.running.surface_stress import SurfaceStress
from warpsph.running.wall_loads import WallLoads
from warpsph.scene.forcing import forcing_of
from warpsph.scene.geometry import Geometry, build
from warpsph.scene.open_faces import buffer_layers
from warpsph.scene.packing import Packer
from warpsph.scene.physics import Physics, contact_matrix, derive, support_radius
from warpsph.scene.start_values import nominal_pressure
from warpsph.snapshot import Snapshot, Stations
from warpsph.start import start_warp

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.wall_cells import Surroundings

FALL = 0.25  # time step over sqrt(h/a), a the largest acceleration


def quiet_warp(device: str = "cpu") -> None:
    """Start Warp without its banner and compile lines; a missing CUDA driver is told if the device needs one."""
    start_warp(cuda=device.startswith("cuda"))


def default_threads() -> int:
    """Return the number of processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Model:
    """The state of a run on its device.

    Args:
        case: validated case.
        device: Warp device name, "cpu" or "cuda:0".
        threads: threads of a CPU device (default: all processors).
        geometry: particles of the case, if they are known already.
        fresh: False if `load_state` follows: the start is then made no better than it takes to know the particles.
        preparing: called while kernels are compiled or loaded, with the number of those that are ready.

    Raises:
        CapacityError: the case does not fit the memory of the device or of the machine.

    Attributes:
        physics: numbers derived from the case.
        nominal_pressure: (phases,), Pa, at which each phase has the density of the case.
        particles: fields on the device.
        stepper: runs steps.
    """

    def __init__(
        self,
        case: Case,
        device: str = "cpu",
        threads: int | None = None,
        geometry: Geometry | None = None,
        fresh: bool = True,
        preparing: Callable[[int], None] | None = None,
    ) -> None:
        quiet_warp(device)
        self.case, self.scheme = case, case.scheme
        self.device = wp.get_device(device)
        self.launcher = Launcher(self.device, threads or default_threads(), preparing)
        if geometry is None:
            refused = memory.shortage(case, self.device)
            if refused is not None:
                gc.collect()  # an earlier run in this process may only wait for that
                refused = memory.shortage(case, self.device)
            if refused is not None:
                raise refused
        self.geometry = geometry if geometry is not None else build(case, support_radius(case))
        self.forcing = forcing_of(case)
        self.physics: Physics = derive(case, self.geometry, row_list=self.launcher.is_cpu)
        if not self.launcher.is_cpu:
            spec, count = self.physics.spec, (self.geometry.fluid_count, self.device.sm_count)
            spec = dataclasses.replace(spec, few=few_particles(spec, *count), lanes=lanes_for(spec, *count))
            self.physics = dataclasses.replace(self.physics, spec=spec)
        unlock = float(self.physics.choices["unlock"])
        fitted = self.geometry.arrangement == "fitted"
        if geometry is None and fresh and (fitted or unlock > case.start.noise):
            arrange = Packer(self.launcher) if fitted else None
            del self.geometry  # of millions of particles there is no room for two
            self.geometry = build(case, self.physics.support, unlock, arrange)
        self.nominal_pressure = nominal_pressure(case, self.geometry, self.physics)
        counts = self.geometry.fluid_count, self.geometry.wall_count
        room = self.scheme.room(case, self.geometry, self.physics)
        self._loads: WallLoads | None = None
        self._stress: SurfaceStress | None = None
        self._flow: FlowFields | None = None
        self._sums: DeviceSums | None = None
        self._grown = 0
        self._calm = False  # the sound of the start has died, and steps are as long as without it
        self.particles = Population(self.physics.spec, self.scheme.fields(), *counts, self.device, room)
        self._fill()
        self.stepper = self._make_stepper()

    # start ---------------------------------------------------------------------------------------------------------

    def _fill(self) -> None:
        """Put the start values into the fields."""
        geometry, particles, case = self.geometry, self.particles, self.case
        nf = geometry.fluid_count
        position = geometry.lattice.within(geometry.position, case.periodic)  # bodies may reach beyond a periodic side
        particles.put("anchor", position)
        particles.put("position", position)
        particles.put("velocity", np.where((geometry.kind == 1)[:, None], geometry.boundary_velocity, geometry.velocity))
        particles.put("particle_id", np.arange(geometry.count))
        if "phase" in particles.arrays:
            particles.put("phase", geometry.phase[:nf])
        if "wall_body" in particles.arrays:
            particles.put("wall_body", geometry.body[nf:])
        if "wall_depth" in particles.arrays:
            lattice, wall = geometry.lattice, position[nf:]
            beyond = np.maximum(np.maximum(np.array(lattice.lower) - wall, wall - np.array(lattice.upper)), 0.0)
            particles.put("wall_depth", np.linalg.norm(beyond, axis=1))
        if "wall_sides" in particles.arrays:
            particles.put("wall_sides", geometry.wall_sides[nf:])
        if geometry.surface is not None and self.physics.spec.bodies:
            self._fill_surface(geometry.surface)
        if "slip" in particles.arrays:
            particles.put("slip", geometry.wall_slip[nf:])
        if "origin" in particles.arrays:
            particles.put("origin", np.tile(geometry.position[:nf], (1, self.physics.spec.windows)))
        self.scheme.fill(particles, case, geometry, self.physics)

    def _fill_surface(self, surface: Surroundings) -> None:
        """Put where the surface of the walls is."""
        particles = self.particles
        particles.put("wall_depth", surface.depth)
        particles.put("wall_normal", surface.normal)
        if "home" in particles.arrays:
            particles.put("home", self.geometry.position[self.geometry.fluid_count :])
            particles.put("home_normal", surface.normal)
        particles.put("wall_area", surface.area)
        particles.put("boundary_volume", surface.volume)
        particles.put("leader", surface.leader)
        if self.physics.spec.tails:
            particles.put("sheet", surface.sheet)
            particles.put("frame", surface.frame)
            if self.physics.spec.moving:
                particles.put("frame_carried", surface.carried)

    def _make_stepper(self) -> Stepper:
        """Return the step loop: one clock, and one level of a uniform resolution."""
        spec = self.physics.spec
        clock = DeviceClock(spec, self.launcher, *self._clock_start())
        systems = self.scheme.systems(self.case, self.geometry, self.physics)
        declared = self.scheme.work
        level = Level(self.particles, self.launcher, clock, self._values(), self._list_keywords(), systems, declared)
        return Stepper(self.scheme, [level], clock, self.physics.choices)

    def _values(self) -> dict[str, Any]:
        """Return the run-time numbers by kernel argument name."""
        case, physics, spec = self.case, self.physics, self.physics.spec
        real = types_of(spec).real
        params = self._params()
        own = self.scheme.values(params, case, self.geometry, physics, self.device)
        return {
            "params": params,
            "sides": self._sides(),
            **self._signals(),
            **window_values(case, spec, self.device),
            "phases": self._materials(),
            "tension": wp.array(physics.tension.ravel(), dtype=real, device=self.device),
            "phase_count": len(case.phases),
            "side_walls": len(self.geometry.body_names) - len(case.bodies),
            "first_wall_id": self.geometry.fluid_count,
            # with an open side fluid may come to lie beyond a wall over its rim, else nowhere
            "wall_thickness": real(physics.support if case.has_open_sides else EVERYWHERE),
            **self._frames(),
            "contact_angles": wp.array(contact_matrix(case).ravel(), dtype=real, device=self.device),
            **own,
        }

    def _frames(self) -> dict[str, Any]:
        """Return the frames of lines of sight at thin tails of bodies, by kernel argument name; see `visibility`."""
        surface = self.geometry.surface
        if surface is None or not self.physics.spec.tails:
            return {}
        vec, frames = types_of(self.physics.spec).vec, surface.frames
        across = np.stack([-frames.along[:, 1], frames.along[:, 0]], axis=1)
        columns = {"point": frames.point, "edge": frames.edge, "along": frames.along, "across": across}
        if self.physics.spec.moving:
            columns |= {f"home_{name}": columns[name] for name in ("point", "edge", "along")}
        extent: Any = wp.array(np.minimum(frames.extent, 1.0e30), dtype=types_of(self.physics.spec).real, device=self.device)
        arrays: dict[str, Any] = {name: wp.array(c, dtype=vec, device=self.device) for name, c in columns.items()}
        return {f"frame_{name}": array for name, array in {**arrays, "extent": extent}.items()}

    def _params(self) -> Any:
        """Return `Params` with the members that follow from case and kernel; the scheme sets its own."""
        case, physics, spec, geometry = self.case, self.physics, self.physics.spec, self.geometry
        vec = types_of(spec).vec
        d, h = spec.dimension, physics.h
        lower, upper = geometry.lattice.lower, geometry.lattice.upper
        box = [u - low if p else 0.0 for low, u, p in zip(lower, upper, spec.periodic, strict=True)]
        params = make_params(d, spec.precision)()
        params.h = h
        params.inv_window = 1.0 / physics.support**2
        params.window_norm = 1.0 / window_integral(d, physics.support)
        params.inv_h = 1.0 / h
        params.g_norm = KERNELS[spec.kernel].alpha[d - 1] / h ** (d + 2)
        params.spacing = case.spacing
        params.wall_volume = geometry.lattice.cell_volume
        params.box = vec(*box)
        # an axis without period never wraps: its half period is out of reach
        params.half_box = vec(*(0.5 * b if b > 0 else 1.0e30 for b in box))
        balanced, driving = self.forcing.start()
        params.gravity = vec(*map(float, balanced))
        params.body_force = vec(*map(float, driving))
        params.tiny = (1.0e-6 * h) ** 2
        params.center = vec(*map(float, case.central_force.center if case.central_force else [0.0] * d))
        params.pull = case.central_force.rate ** 2 if case.central_force else 0.0
        return params

    def _materials(self) -> wp.array:
        """Return the `Phase` of each phase of the case, on the device."""
        return wp.array(self._phases(), dtype=make_phase(self.physics.spec.precision), device=self.device)

    def _phases(self) -> list[Any]:
        """Return a `Phase` of each phase of the case."""
        case, physics = self.case, self.physics
        Phase = make_phase(physics.spec.precision)
        # sound in a fluid whose pressure relaxes: what limits a step and what pairs exchange
        frozen = 1.0 if self._calm else math.sqrt(1.0 + float(physics.choices.get("acoustic_relaxation", 0.0)))
        rows = []
        for name, c, nominal in zip(case.phase_names, physics.sound_speed, self.nominal_pressure, strict=True):
            given = case.phases[name]
            row = Phase()
            row.density = given.density
            row.sound_speed = c * frozen
            row.gamma = given.gamma
            row.stiffness = given.density * c**2 / given.gamma
            row.background = given.background_pressure + nominal
            row.viscosity = given.viscosity
            row.impedance = given.density * row.sound_speed
            row.compressibility = 1.0 / (given.density * c**2)
            row.most_excess = physics.most_excess(given.gamma, given.density, c)
            # friction of half a cell, mu/(dx/2), beside that of sound; the printed states know none (riemann#viscous-star)
            printed = physics.choices.get("star_states") == "arithmetic"
            friction = 0.0 if printed else 2.0 * given.viscosity / case.spacing
            row.resistance = row.impedance + friction
            row.mobility = float(physics.choices.get("velocity_dissipation", 0.0)) / row.resistance
            rows.append(row)
        return rows

    def _list_keywords(self) -> dict[str, Any]:
        """Return the keywords of the neighbour list."""
        case, physics, spec, geometry = self.case, self.physics, self.physics.spec, self.geometry
        skin = float(physics.choices["skin"])
        width = case.numerics.neighbour_capacity
        if width == "auto":
            width = default_width(spec, physics.support, case.spacing, skin)
        margin = physics.support if geometry.wall_count else 0.0
        open_room = 4 * physics.support if case.has_open_sides else 0.0
        room = [0.0 if p else margin + open_room for p in spec.periodic]
        if spec.open_axis >= 0:
            layers = buffer_layers(physics.support, skin, geometry.lattice.spacing[spec.open_axis])
            room[spec.open_axis] = max(room[spec.open_axis], (layers + 1) * geometry.lattice.spacing[spec.open_axis])
        return {
            "lower": [low - r for low, r in zip(geometry.lattice.lower, room, strict=True)],
            "upper": [u + r for u, r in zip(geometry.lattice.upper, room, strict=True)],
            "periodic": spec.periodic,
            "support": physics.support,
            "skin": skin,
            "width": int(width),
            "cell_bodies": bool(case.bodies) and not spec.bodies,
        }

    def _clock_start(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (clock, counters) of the start; the scheme sets its own entries."""
        physics, geometry, d = self.physics, self.geometry, self.physics.spec.dimension
        skin = float(physics.choices["skin"])
        clock = np.zeros(ck.CLOCK_SIZE)
        clock[ck.STEP_CAP] = min(physics.step_cap.values(), default=math.inf)
        clock[ck.COURANT] = float(physics.choices["courant"]) * physics.h
        clock[ck.FORCE] = FALL * math.sqrt(physics.h)
        clock[ck.SKIN] = skin * physics.support
        clock[ck.FARTHEST] = 0.25 * (1.0 + skin) * physics.support
        clock[ck.CHECK_LASTS] = -1.0
        clock[ck.BOX_VOLUME] = float(geometry.volume[: geometry.fluid_count].sum())
        clock[ck.RUNAWAY] = physics.runaway
        clock[ck.RARE_LIMIT] = clock[ck.RARE_CAP] = math.inf
        clock[ck.MOMENTUM : ck.MOMENTUM + d] = self._mean_velocity()
        counters = np.zeros(ck.COUNTERS_SIZE, dtype=np.int32)
        counters[ck.FAULT_PARTICLE] = ck.NO_PARTICLE
        counters[ck.RARE_STEPS] = ck.RARE_INTERVAL
        counters[ck.LIVE] = geometry.fluid_count
        counters[ck.NEXT_ID] = geometry.count
        self.scheme.set_clock(clock, counters, physics)
        return clock, counters

    def _sides(self) -> Any:
        """Return where the mirrors of the domain's sides stand."""
        spec, case, lattice = self.physics.spec, self.case, self.geometry.lattice
        vec = types_of(spec).vec
        sides = make_sides(spec.dimension, spec.precision)()
        sides.lower, sides.upper = vec(*map(float, lattice.lower)), vec(*map(float, lattice.upper))
        kinds, speeds = [], []
        for axis in case.sides:
            for side in (axis.lower, axis.upper):
                wall = side.kind == "wall"
                kinds.append((FREE_SLIP if side.wall == "free_slip" else NO_SLIP) if wall else NO_WALL)
                speeds.append(vector_at(side.velocity) if wall and side.velocity else [0.0] * spec.dimension)
        sides.kind = wp.array(kinds, dtype=int, device=self.device)
        sides.velocity = wp.array(np.array(speeds), dtype=vec, device=self.device)
        self._kept_sides = sides  # the arrays in it live as long as this
        return sides

    def _signals(self) -> dict[str, Any]:
        """Return what the stage `signals` reads and writes, by kernel argument; nothing where nothing depends on time."""
        spec, device = self.physics.spec, self.device
        if not depends_on_time(spec):
            return {}
        vec = types_of(spec).vec
        first, begin, terms = self.forcing.arrays()
        return {
            "held": vec(*map(float, self.forcing.held)),
            "signal_first": wp.array(first, dtype=int, device=device),
            "signal_begin": wp.array(begin, dtype=wp.float64, device=device),
            "signal_terms": wp.array(terms, dtype=wp.float64, device=device),
            "forcing": wp.zeros(FORCING_SIZE, dtype=vec, device=device),
            "impulse": wp.zeros(spec.dimension, dtype=wp.float64, device=device),
            "side_velocity": self._kept_sides.velocity,  # the mirrors of a scheme that has some move at once
            **self._motions(),
        }

    def _motions(self) -> dict[str, Any]:
        """Return what the motions of bodies are made of, by kernel argument."""
        tracks, device = self.forcing.tracks, self.device
        number = {track.name: k for k, track in enumerate(tracks)}
        of_body = [-1, *(number.get(name, -1) for name in self.geometry.body_names)]
        pivots = [[*track.pivot, 0.0][:3] for track in tracks]
        return {
            "body_pivot": wp.array(np.reshape(pivots, (-1, 3)), dtype=wp.vec3d, device=device),
            "body_axis": wp.array(np.reshape([track.axis for track in tracks], (-1, 3)), dtype=wp.vec3d, device=device),
            "body_motion": wp.array(of_body, dtype=int, device=device),
            "poses": wp.zeros(2 * len(tracks), dtype=make_pose(), device=device),
        }

    def leaks(self) -> tuple[dict[str, int], dict[str, int]]:
        """Return (most, now): fluid particles beyond a wall of the domain or inside a body, by phase.

        `most` is the largest number that a build of the neighbour list has found so far, or the present one.
        """
        for task in self.stepper.list.leak_tasks("position"):  # of the arrays as they are: they grow with the particles
            task.run()
        counts = self.stepper.bindings["leak_counts"].numpy().reshape(-1, 2)
        names = self.case.phase_names
        return (
            {name: int(counts[k, LARGEST]) for k, name in enumerate(names)},
            {name: int(counts[k, LAST]) for k, name in enumerate(names)},
        )

    def most_excess(self, row: int) -> float:
        """Return the density excess beyond which the particle in that row of the fields has diverged [-]."""
        index = int(self.particles.get("phase")[row]) if self.physics.spec.multiphase else 0
        given = self.case.phases[self.case.phase_names[index]]
        return self.physics.most_excess(given.gamma, given.density, self.physics.sound_speed[index])

    def _mean_velocity(self) -> np.ndarray:
        """Return the velocity of the centre of mass of the fluid, (d,) [m/s]."""
        nf = self.geometry.fluid_count
        if "rest_volume" not in self.particles.arrays:
            return np.zeros(self.physics.spec.dimension)
        densities = np.array([phase.density for phase in self.case.phases.values()])
        mass = densities[self.geometry.phase[:nf]] * self.particles.get("rest_volume").astype(np.float64)
        momentum = mass @ self.particles.get("velocity")[:nf].astype(np.float64)
        return np.asarray(momentum / mass.sum())

    # state ---------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.stepper.read()[0][ck.TIME])

    @property
    def steps(self) -> int:
        """Steps done."""
        return int(self.stepper.read()[1][ck.STEPS])

    def snapshot(self) -> Snapshot:
        """Return a host copy of the state, rows in the order of the particle ids, velocity at the time of the positions."""
        return copy_state(self).snapshot()

    @property
    def sums(self) -> DeviceSums:
        """Sums of the state over phases, walls and interfaces.

        Raises:
            WarpsphError: the number of particles changes, which these sums do not follow.
        """
        if self._sums is not None and self._grown == self.particles.grown:
            return self._sums
        if self.particles.changing and "zone" not in self.particles.arrays:
            raise WarpsphError(
                f"gauges: those that add up particles do not follow the births and deaths of scheme {self.scheme.name}; "
                "take a gauge that reads the particles themselves"
            )
        scene = Scene(self.case, eos_of_run(self.case, self.physics.sound_speed, self.nominal_pressure))
        staggered = self.scheme.staggered(self.physics.spec)
        self._sums = DeviceSums(self.particles, self.launcher, self.stepper.clock, scene, self.case.spacing, staggered)
        self._grown = self.particles.grown
        return self._sums

    @property
    def fluid_count(self) -> int:
        """Fluid particles in the domain, without those in the buffers of open sides."""
        if "zone" not in self.particles.arrays:
            return self.particles.fluid_count
        return int(np.count_nonzero(self.particles.get("zone") == IN_FLUID))

    def flow_rates(self) -> dict[str, float]:
        """Return what goes through inlets and outlets, see `warpsph.measure.flow_gauges`."""
        return self.scheme.flow_rates(self.case, self.geometry, self.physics, self.stepper.bindings)

    def interface_length(self) -> float:
        """Return the length (3-D: area) of all interfaces: the volume integral of |grad C| [m^(d-1)]."""
        self.stepper.measure("interface")
        return self.sums.interface_length()

    def flow_fields(self) -> dict[str, Any]:
        """Return vorticity and Q of the fluid particles, see `FlowFields.measure`."""
        if self._flow is None or self._flow.particles is not self.particles:
            staggered = self.scheme.staggered(self.physics.spec)
            self._flow = FlowFields(self.particles, self.launcher, self.stepper, staggered)
        return self._flow.measure()

    def wall_load(self) -> Any:
        """Return the force of the fluid on each wall particle, a Warp array of (walls,) vectors [N]."""
        return self._wall_loads.measure()

    def wall_forces(self) -> dict[str, float]:
        """Return what the fluid does to each wall body, see `WallLoads.forces`."""
        return self._wall_loads.forces()

    def surface_stress(self, body: str) -> Stations:
        """Return what the fluid does along the surface of a body."""
        loads = self._wall_loads
        if self._stress is None or self._stress.loads is not loads:
            self._stress = SurfaceStress(self.case, self.geometry, self.particles, self.stepper, loads)
        return self._stress.measure(body)

    @property
    def _wall_loads(self) -> WallLoads:
        if self._loads is None or self._loads.sums is not self.sums:  # both anew where the particles got more room
            self._loads = WallLoads(self.case, self.geometry, self.particles, self.launcher, self.stepper, self.sums)
        return self._loads

    def save_state(self) -> dict[str, np.ndarray]:
        """Return everything a restart needs, by name."""
        clock, counters = self.stepper.read()
        return {
            **self.particles.kept(),
            "clock": np.array(clock),
            "counters": np.array(counters),
            "maxima": self.stepper.maxima.numpy().reshape(-1, ck.MAXIMA).max(axis=0),
            "leak_counts": np.array(self.stepper.bindings["leak_counts"].numpy()),
            "nominal_pressure": self.nominal_pressure,
            # copies: on a CPU these are the arrays themselves, which go on changing while a checkpoint is written
            **{name: np.array(self.stepper.bindings[name].numpy()) for name in self._kept_arrays()},
        }

    def _kept_arrays(self) -> list[str]:
        """Return the names of the arrays beside the fields that a restart goes on from."""
        return [name for name in (*self.scheme.kept, *KEPT) if name in self.stepper.bindings]

    def _make_room(self, state: dict[str, np.ndarray]) -> None:
        """Make room for the particles of a saved state, of which there may be more than at the start, or fewer."""
        live = int(state["counters"][ck.LIVE])
        self.stepper.write(counters={ck.LIVE: live})
        if live > self.particles.fluid_capacity:
            self.stepper.grow(live)

    @property
    def calm_from(self) -> float:
        """Time [s] from which the pressure has no part that fades any more, inf once that is so or where it has none."""
        end = self.physics.choices.get("relaxation_end")
        return math.inf if end is None or self._calm or not self.physics.spec.relaxation else float(end)

    def calm_down(self) -> None:
        """Leave out the part of the pressure that fades: the sound of the start has died (theory: riemann#relaxation)."""
        self._calm = True
        self.stepper.bindings["phases"].assign(self._materials())
        self.stepper.write(clock={ck.RELAXATION: 0.0, ck.SOUND: max(self.physics.sound_speed)})

    def load_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a saved state of the same case, bit by bit.

        Raises:
            ValueError: the state does not fit the particles of this case.
        """
        if self.particles.changing:
            self._make_room(state)
        for name, field in self.particles.fields.items():
            if field.kept:
                if name not in state:
                    raise ValueError(f"the saved state has no field {name}")
                self.particles.put(name, state[name])
        self.stepper.maxima.assign(np.tile(state["maxima"], self.launcher.threads))
        # The start that this model knows may be a coarser one. Checkpoints of older versions have densities at no pressure.
        self.nominal_pressure = state.get("nominal_pressure", np.zeros_like(self.nominal_pressure))
        self.stepper.bindings["phases"].assign(self._materials())
        if "leak_counts" in state:  # checkpoints from before did not count
            self.stepper.bindings["leak_counts"].assign(state["leak_counts"])
        for name in self._kept_arrays():
            if name not in state:
                raise ValueError(f"the saved state has no {name}")
            self.stepper.bindings[name].assign(state[name])
        clock = np.array(self.stepper.read()[0])
        saved = state["clock"]
        there = [k for k in ck.CLOCK.kept if k < len(saved)]  # checkpoints of older versions have fewer entries
        clock[there] = saved[there]
        self.stepper.write(
            clock=dict(enumerate(clock)),
            # checkpoints of older versions have fewer counters
            counters={k: int(state["counters"][k]) for k in ck.COUNTERS.kept if k < len(state["counters"])},
        )
        if reached(self.time, self.calm_from):
            self.calm_down()
