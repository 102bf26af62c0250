"""Small builders for tests of kernels: particle clouds, and a bench on which single sweeps run."""

import dataclasses
import math

import numpy as np
import warp as wp

from warpsph.engine.device_clock import DeviceClock
from warpsph.engine.launch import Bindings, Launcher
from warpsph.engine.level import Level
from warpsph.engine.neighbours import NeighbourList, default_width
from warpsph.engine.population import Population
from warpsph.engine.stepper import Stepper
from warpsph.kernels.core import clock as ck
from warpsph.kernels.core import time_signals
from warpsph.kernels.core.params import make_params, make_phase
from warpsph.kernels.core.smoothing import KERNELS, lattice_slope, window_integral
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.riemann.density import make_continuity
from warpsph.kernels.riemann.printed_sweeps import make_printed_continuity
from warpsph.running.model import quiet_warp
from warpsph.schemes import registry
from warpsph.schemes import riemann_program as riemann

quiet_warp()


@dataclasses.dataclass(frozen=True)
class Fluid:
    """Properties of one phase, SI units."""

    density: float = 1.0
    viscosity: float = 0.0
    sound_speed: float = 10.0
    gamma: float = 7.0
    background: float = 0.0


def lattice(counts, spacing, jitter=0.0, seed=1, centre=True):
    """Return the cell centres of a lattice, (n, d), about the origin or from it, moved by jitter."""
    axes = [(np.arange(n) + 0.5) * spacing for n in counts]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(counts))
    if centre:
        x -= 0.5 * spacing * np.asarray(counts)
    return x + np.random.default_rng(seed).uniform(-jitter, jitter, x.shape) * spacing


def evaluate(function, precision, *columns, device="cpu"):
    """Return a `wp.func` of reals, evaluated for each row of equally long columns, as float64 (n,)."""
    real = {"float32": wp.float32, "float64": wp.float64}[precision]
    count = len(columns)
    table = wp.array(np.stack([np.asarray(c, dtype=float) for c in columns], axis=1), dtype=real, device=device)
    out = wp.zeros(table.shape[0], dtype=real, device=device)

    if count == 1:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(table: wp.array2d(dtype=real), out: wp.array(dtype=real)):
            i = wp.tid()
            out[i] = function(table[i, 0])

    elif count == 3:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(table: wp.array2d(dtype=real), out: wp.array(dtype=real)):
            i = wp.tid()
            out[i] = function(table[i, 0], table[i, 1], table[i, 2])

    elif count == 6:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(table: wp.array2d(dtype=real), out: wp.array(dtype=real)):
            i = wp.tid()
            t = table[i]
            out[i] = function(t[0], t[1], t[2], t[3], t[4], t[5])

    elif count == 5:

        @wp.kernel(module="unique", enable_backward=False)
        def apply(table: wp.array2d(dtype=real), out: wp.array(dtype=real)):
            i = wp.tid()
            out[i] = function(table[i, 0], table[i, 1], table[i, 2], table[i, 3], table[i, 4])

    else:
        assert count == 7

        @wp.kernel(module="unique", enable_backward=False)
        def apply(table: wp.array2d(dtype=real), out: wp.array(dtype=real)):
            i = wp.tid()
            t = table[i]
            out[i] = function(t[0], t[1], t[2], t[3], t[4], t[5], t[6])

    wp.launch(apply, dim=table.shape[0], inputs=[table, out], device=device)
    return out.numpy().astype(float)


def full(values, rows, width=None):
    """Return `values` (a number, a vector or rows of them) as float64 (rows,) or (rows, width)."""
    shape = (rows,) if width is None else (rows, width)
    return np.ascontiguousarray(np.broadcast_to(np.asarray(values, dtype=float), shape))


class Setup:
    """Particles and numbers of a small scene, in the order given; fluid first, then walls.

    Args:
        spec: structure; its list layout is set to that of the device.
        position: (n, d) fluid positions [m].
        spacing: particle spacing [m]; ratio: h / spacing.
        lower, upper: domain [m], needed for periodic axes (default: the box around all particles).
        velocity, pressure, excess: per fluid particle; pressure in Pa, excess = rho/rho0 - 1.
        volume: of a fluid particle [m^d] (default spacing^d).
        phase: index into `fluids`.
        walls: (m, d) wall positions; wall_velocity, slip: theirs.
        tension: surface tension between any two phases [N/m].
        cosines: (phases, phases) cosine of the contact angle of the row's phase against the column's.
        dissipation, shifting, zeta, room: numbers of `Params`.
        values: further kernel arguments by name.
    """

    def __init__(
        self,
        spec: Spec,
        position,
        *,
        spacing,
        ratio=1.5,
        lower=None,
        upper=None,
        velocity=0.0,
        pressure=0.0,
        excess=0.0,
        volume=None,
        phase=0,
        fluids=(Fluid(),),
        walls=None,
        wall_velocity=0.0,
        slip=0,
        gravity=0.0,
        body_force=0.0,
        tension=0.0,
        cosines=None,
        dissipation=1.0,
        shifting=0.02,
        shift_cap=0.01,
        zeta=0.0,
        room=0.0,
        skin=0.12,
        width=None,
        values=None,
        device="cpu",
    ):
        self.device = wp.get_device(device)
        spec = dataclasses.replace(spec, row_list=spec.row_list and self.device.is_cpu)
        self.spec = spec
        d = spec.dimension
        nf = len(position)
        walls = np.zeros((0, d)) if walls is None else np.asarray(walls, dtype=float)
        nw = len(walls)
        every = np.concatenate([position, walls])
        self.lower = np.min(every, axis=0) if lower is None else full(lower, d)
        self.upper = np.max(every, axis=0) if upper is None else full(upper, d)
        self.box = [float(u - low) if p else 0.0 for low, u, p in zip(self.lower, self.upper, spec.periodic, strict=True)]
        self.h = ratio * spacing
        self.support = self.h * KERNELS[spec.kernel].support
        self.half_skin = 0.5 * skin * self.support
        self.particles = Population(spec, registry.find(spec.scheme).fields(), nf, nw, self.device)
        put = self.particles.put
        put("anchor", every)
        put("position", every)
        put("velocity", np.concatenate([full(velocity, nf, d), full(wall_velocity, nw, d)]))
        put("particle_id", np.arange(nf + nw))
        volume = full(spacing**d if volume is None else volume, nf)
        excess = full(excess, nf)
        put("density_excess", excess)
        put("rest_volume", volume * (1.0 + excess))
        state = np.zeros((nf + nw, 2))
        state[:nf, 0], state[:nf, 1] = full(pressure, nf), volume
        state[nf:, 1] = spacing**d
        put("state", state)
        if "phase" in self.particles.arrays:
            put("phase", full(phase, nf))
        if "slip" in self.particles.arrays:
            put("slip", full(slip, nw))
        real, vec, _, _ = types_of(spec)
        params = make_params(d, spec.precision)()
        alpha = KERNELS[spec.kernel].alpha[d - 1]
        params.h = self.h
        params.inv_h = 1.0 / self.h
        params.g_norm = alpha / self.h ** (d + 2)
        params.spacing = spacing
        params.wall_volume = spacing**d
        params.box = vec(*self.box)
        params.half_box = vec(*(0.5 * b if b > 0 else 1.0e30 for b in self.box))
        params.gravity = vec(*full(gravity, d))
        params.body_force = vec(*full(body_force, d))
        params.dissipation = dissipation
        params.even_slope = lattice_slope(spec.kernel, ratio, d) / self.h
        params.shifting = shifting
        params.shift_cap = shift_cap
        params.zeta = zeta
        params.room = room
        params.inv_window = 1.0 / self.support**2
        params.window_norm = 1.0 / window_integral(d, self.support, 4 if spec.scheme == "riemann" else 2)
        params.tiny = (1.0e-6 * self.h) ** 2
        self.params = params
        Phase = make_phase(spec.precision)
        rows = []
        for fluid in fluids:
            row = Phase()
            row.density = fluid.density
            row.viscosity = fluid.viscosity
            row.sound_speed = fluid.sound_speed
            row.gamma = fluid.gamma
            row.background = fluid.background
            row.most_excess = 0.9
            row.stiffness = fluid.density * fluid.sound_speed**2 / fluid.gamma
            row.impedance = fluid.density * fluid.sound_speed
            row.compressibility = 1.0 / (fluid.density * fluid.sound_speed**2)
            row.resistance = row.impedance + (0.0 if spec.paper_star else 2.0 * fluid.viscosity / spacing)
            row.mobility = dissipation / row.resistance
            rows.append(row)
        matrix = np.full((len(fluids), len(fluids)), float(tension))
        self.values = {
            "params": params,
            "phases": wp.array(rows, dtype=Phase, device=self.device),
            "tension": wp.array(matrix.ravel(), dtype=real, device=self.device),
            "contact_angles": wp.array(
                np.ravel(0.0 * matrix if cosines is None else cosines), dtype=real, device=self.device
            ),
            "side_walls": 0,
            **(values or {}),
        }
        # cells are made for finite boxes; an axis on which all particles lie needs some width too
        room = [0.0 if p else 1e-9 + 0.5 * spacing for p in spec.periodic]
        self.list_keywords = {
            "lower": [float(low - r) for low, r in zip(self.lower, room, strict=True)],
            "upper": [float(u + r) for u, r in zip(self.upper, room, strict=True)],
            "periodic": spec.periodic,
            "support": self.support,
            "skin": skin,
            "width": default_width(spec, self.support, spacing, skin) if width is None else width,
        }
        clock = np.zeros(ck.CLOCK_SIZE)
        clock[ck.STEP] = 1.0
        clock[ck.STEP_CAP] = math.inf
        clock[ck.COURANT] = 0.5 * self.h
        clock[ck.SOUND] = max(fluid.sound_speed for fluid in fluids)
        clock[ck.FORCE] = 0.25 * math.sqrt(self.h)
        clock[ck.SKIN] = skin * self.support
        clock[ck.FARTHEST] = 0.25 * (1.0 + skin) * self.support
        clock[ck.CHECK_LASTS] = -1.0
        clock[ck.BOX_VOLUME] = float(volume.sum())
        clock[ck.RUNAWAY] = 10.0 * clock[ck.SOUND]
        clock[ck.RARE_LIMIT] = 0.05 * self.h
        clock[ck.RARE_CAP] = math.inf
        self.clock = clock
        self.counters = np.zeros(ck.COUNTERS_SIZE, dtype=np.int32)
        self.counters[ck.RARE_STEPS] = ck.RARE_INTERVAL
        self.counters[ck.FAULT_PARTICLE] = ck.NO_PARTICLE

    def stepper(self, threads=1):
        """Return a `Stepper` of the scene; it compiles every kernel of a step."""
        launcher = Launcher(self.device, threads)
        clock = DeviceClock(self.spec, launcher, self.clock, self.counters)
        scheme = registry.find(self.spec.scheme)
        level = Level(self.particles, launcher, clock, self.values, self.list_keywords, None, scheme.work)
        return Stepper(scheme, [level], clock)


class Bench(Setup):
    """A scene with its neighbour list built; sweeps run one at a time and only those used are compiled.

    Values go in and come out in the order of the particle ids, whatever the list did to their order.
    """

    def __init__(self, spec: Spec, position, **options):
        super().__init__(spec, position, **options)
        device = self.device
        self.clock_array = wp.array(self.clock, dtype=wp.float64, device=device)
        self.counters_array = wp.array(self.counters, dtype=int, device=device)
        self.launcher = Launcher(device, 1)
        declared = self.particles.declared | registry.find(spec.scheme).work | time_signals.ARRAYS
        self.bindings = Bindings(device, self.values, declared)
        self.bindings.update(self.particles.arrays)
        self.bindings.update(
            clock=self.clock_array,
            counters=self.counters_array,
            maxima=wp.zeros(ck.MAXIMA, dtype=types_of(self.spec).real, device=device),
            faults=wp.full(1, ck.NO_PARTICLE, dtype=int, device=device),
            particle_count=self.particles.count,
            fluid_count=self.particles.fluid_count,
        )
        self.list = NeighbourList(self.particles, self.launcher, self.bindings, **self.list_keywords)
        self.rebuild()
        assert self.counter(ck.FAULT) == 0, "the list is too narrow: give a width"

    def rebuild(self, moving=True):
        """Build the list from the present positions."""
        for task in self.list.tasks if moving else self.list.tasks_again:
            task.run()

    def counter(self, index):
        """Return one of the device's counters."""
        return int(self.counters_array.numpy()[index])

    def set_clock(self, **entries):
        """Set entries of the clock by the names of `kernels/core/clock.py`."""
        host = self.clock_array.numpy().copy()
        for name, value in entries.items():
            host[getattr(ck, name)] = value
        self.clock_array.assign(host)

    def rows_of(self, name):
        """Return, for each row of a field, the index of its particle among those that have the field."""
        ids = self.particles.get("particle_id")
        nf = self.particles.fluid_count
        return {"fluid": ids[:nf], "wall": ids[nf:] - nf, "all": ids}[self.particles.fields[name].rows]

    def get(self, name):
        """Return a field as float64 in the order of the ids."""
        raw = self.particles.get(name).astype(float)
        result = np.empty_like(raw)
        result[self.rows_of(name)] = raw
        return result

    def put(self, name, values):
        """Set a field from values in the order of the ids."""
        array = self.particles.get(name)
        host = np.broadcast_to(np.asarray(values, dtype=float), array.shape)
        self.particles.put(name, host[self.rows_of(name)])

    def put_state(self, pressure=None, volume=None):
        """Set pressure and volume of the fluid, in the order of the ids."""
        state = self.get("state")
        nf = self.particles.fluid_count
        if pressure is not None:
            state[:nf, 0] = pressure
        if volume is not None:
            state[:nf, 1] = volume
        self.put("state", state)

    def neighbours(self):
        """Return the ids of each particle's (fluid neighbours, wall neighbours), in the order of the ids."""
        ids = self.particles.get("particle_id")
        n, width = self.particles.count, self.list.width
        table = self.list.neighbours.numpy()
        table = table.reshape(n, width) if self.spec.row_list else table.reshape(width, n).T
        fluid = self.particles.get("fluid_neighbours")
        wall = np.zeros(n, dtype=int)
        if "wall_neighbours" in self.particles.arrays:
            wall[: self.particles.fluid_count] = self.particles.get("wall_neighbours")
        fluid_ids: list = [None] * n
        wall_ids: list = [None] * n
        for i in range(n):
            entries = ids[table[i, : fluid[i] + wall[i]]]
            fluid_ids[ids[i]] = entries[: fluid[i]].tolist()
            wall_ids[ids[i]] = entries[fluid[i] :].tolist()
        return fluid_ids, wall_ids

    def run(self, *stages):
        """Run stages of a scheme."""
        rows = {
            "fluid": (self.particles.fluid_count, 0),
            "wall": (self.particles.wall_count, 0),
            "band": (self.particles.fluid_count, 0),
            "one": (1, 0),
        }
        for stage in stages:
            kernel, (count, start) = stage.kernel, rows[stage.rows]
            self.launcher.task(stage.name, kernel, count, self.bindings, start, single=True).run()

    def prepare(self):
        """Run what a momentum sweep needs: flow beside interfaces, wall state, interface geometry."""
        self.run(*riemann.start(self.spec)[2:-1])

    def acceleration(self, dt=1.0):
        """Run the momentum sweep; return the acceleration, (fluid, d) [m/s^2]."""
        self.set_clock(STEP=dt)
        self.launcher.task("momentum", riemann.momentum(self.spec), self.particles.fluid_count, self.bindings).run()
        return self.get("acceleration")

    def density_rate(self, step=1.0e-6):
        """Run the continuity sweep with a step [s]; return (1/rho) drho/dt of the fluid [1/s] and restore what it wrote."""
        before = {name: self.particles.get(name) for name in ("density_excess", "state")}
        excess = self.get("density_excess")
        self.particles.put("state_old", before["state"][: self.particles.fluid_count])
        # the sweep of a step is centred: here nothing moves, so its middle is where the particles are
        self.particles.put("midway", self.particles.get("position")[: self.particles.fluid_count])
        self.set_clock(STEP=step)
        make = make_printed_continuity if self.spec.printed else make_continuity
        task = self.launcher.task("continuity", make(self.spec), self.particles.fluid_count, self.bindings)
        task.run()
        rate = (self.get("density_excess") - excess) / (1.0 + excess) / step
        for name, values in before.items():
            self.particles.put(name, values)
        return rate
