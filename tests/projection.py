"""A bench for the stages of projection ISPH, and what they should do written with explicit mirror images in NumPy."""

import dataclasses
import itertools

import numpy as np
import warp as wp

from tests.helpers import Bench, full
from warpsph.kernels.core.mirror import NO_WALL, code_shift, make_sides
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.isph import surface as sf
from warpsph.schemes import isph_program as isph
from warpsph.schemes.isph_physics import full_share, row_shares, row_strain
from warpsph.solvers.linear_solver import EllMatrix, LinearSolver

INSIDE, SURFACE, ISOLATED = sf.INSIDE, sf.SURFACE, sf.ISOLATED


def open_spec(dimension=2, precision="float64", **changes):
    """Return the structure of the scenes of `isph_scenes` with a free surface: they share every kernel."""
    spec = Spec(
        dimension=dimension,
        precision=precision,
        periodic=(False,) * dimension,
        viscosity="isotropic",
        corrected=True,
        gravity=True,
        shifting=True,
        free_surface=True,
        scheme="isph",
        mirror=True,
        second_order=True,
    )
    return dataclasses.replace(spec, **changes)


def periodic_spec(dimension=2, precision="float64", **changes):
    """Return the structure of a periodic box of viscous fluid."""
    spec = Spec(
        dimension=dimension,
        precision=precision,
        periodic=(True,) * dimension,
        viscosity="morris",
        corrected=True,
        shifting=True,
        scheme="isph",
        second_order=True,
    )
    return dataclasses.replace(spec, **changes)


def channel_spec(dimension=2, precision="float64", **changes):
    """Return the structure of a channel between mirrors, periodic along x, without room for a free surface."""
    periodic = (True,) + (False,) * (dimension - 1)
    return periodic_spec(dimension, precision, periodic=periodic, mirror=True, **changes)


def digits(code, dimension):
    """Return for each axis 0, 1 (lower side) or 2 (upper side)."""
    return [(code >> (2 * axis)) & 3 for axis in range(dimension)]


def reflect(x, code, lower, upper):
    """Return points (n, d) mirrored across the sides of a code."""
    x = np.array(x, dtype=float)
    for axis, digit in enumerate(digits(code, x.shape[-1])):
        if digit == 1:
            x[..., axis] = 2 * lower[axis] - x[..., axis]
        elif digit == 2:
            x[..., axis] = 2 * upper[axis] - x[..., axis]
    return x


def codes_of(kinds):
    """Return the codes of all images that sides of these kinds make, 0 (none) first."""
    per_axis = [
        [0] + [side + 1 for side in (0, 1) if kinds[2 * axis + side] != NO_WALL] for axis in range(len(kinds) // 2)
    ]
    return sorted(sum(digit << (2 * axis) for axis, digit in enumerate(choice)) for choice in itertools.product(*per_axis))


class Stages(Bench):
    """A scene of projection ISPH with its list built; arguments as for `helpers.Setup`, and

    Args:
        kinds: of the 2 d sides (default: no wall anywhere); the sides stand at `lower` and `upper`.
        side_velocity: (2 d, d) [m/s].
        dt: length of the step [s]; last: of the step before, 0 at the start.
        deferred, relaxed, surface_depth: numbers of the stages.
        velocity_old: (n, d) velocity of the step before [m/s] (default: the same).
    """

    def __init__(
        self,
        spec,
        position,
        *,
        kinds=None,
        side_velocity=0.0,
        dt=1.0,
        last=0.0,
        deferred=1.0,
        relaxed=0,
        surface_depth=0.0,
        velocity_old=None,
        device="cpu",
        **options,
    ):
        d = spec.dimension
        real, vec, mat, _ = types_of(spec)
        where = wp.get_device(device)
        self.kinds = [NO_WALL] * (2 * d) if kinds is None else list(kinds)
        position = np.asarray(position, dtype=float)
        margin = 10 * options["spacing"]
        options.setdefault("lower", position.min(axis=0) - margin)
        options.setdefault("upper", position.max(axis=0) + margin)
        sides = make_sides(d, spec.precision)()
        sides.lower, sides.upper = vec(*full(options["lower"], d)), vec(*full(options["upper"], d))
        sides.kind = wp.array(self.kinds, dtype=int, device=where)
        sides.velocity = wp.array(full(side_velocity, 2 * d, d), dtype=vec, device=where)
        self.sides = sides
        values = {"sides": sides, "deferred": deferred, "relaxed": relaxed, "surface_depth": surface_depth}
        options.setdefault("skin", 0.001)
        super().__init__(spec, position, device=device, values=values, **options)
        n = self.particles.fluid_count
        self.dt = dt
        self.set_clock(STEP=dt, LAST_STEP=last)
        old = self.get("velocity")[:n] if velocity_old is None else velocity_old
        self.put("velocity_old", full(old, n, d))
        self.put("pressure", full(options.get("pressure", 0.0), n))
        self.matrix = EllMatrix(n, self.list.width, self.launcher, spec.precision, self.spec.row_list)
        self.moment = wp.zeros(n, dtype=mat, device=where)
        first_row, second_row = row_shares(spec, self.h / options["spacing"])
        self.bindings.update(
            first_row=first_row,
            second_row=second_row,
            full_spread=full_share(spec, self.h / options["spacing"]) * spec.dimension,
            row_strain=row_strain(spec, self.h / options["spacing"], surface_depth / options["spacing"]),
            advancing=1,
            component=0,
            matrix_width=self.matrix.width,
            matrix_columns=self.matrix.columns,
            matrix_values=self.matrix.values,
            matrix_counts=self.matrix.counts,
            matrix_diagonal=self.matrix.diagonal,
            matrix_moment=self.moment,
        )

    # stages --------------------------------------------------------------------------------------------------------

    def move(self):
        """Move the particles and build their list."""
        self.run(*isph.move(self.spec))
        self.rebuild()

    def look(self):
        """Run the stages that look at the arrangement; return u* in the order of the ids."""
        self.run(*isph.look(self.spec))
        return self.get("velocity_star")

    def assemble(self):
        """Write the pressure equation down; return (matrix, right-hand side), dense, in the order of the ids."""
        self.run(*isph.equation(self.spec))
        return self.dense(), self.get("source")

    def diffusion(self, component):
        """Write the viscous equation of a component down; return as `assemble`."""
        self.bindings["component"] = component
        self.run(*isph.diffuse(self.spec)[:2])
        return self.dense(), self.get("source")

    def diffuse(self, tolerance=1e-9):
        """Replace u*, in every component, by what implicit viscosity makes of it; return it in the order of the ids."""
        solver = LinearSolver(self.matrix, self.launcher, tolerance=tolerance)
        solver.bind(self.particles.arrays["source"], self.particles.arrays["unknown"])
        for component in range(self.spec.dimension):
            self.bindings["component"] = component
            fill, source, take = isph.diffuse(self.spec)
            self.run(fill, source)
            solver.record()
            assert solver.result().converged
            self.run(take)
        return self.get("velocity_star")

    def dense(self):
        """Return the matrix, dense, in the order of the ids."""
        n, width = self.particles.fluid_count, self.matrix.width
        columns, values = (
            a.numpy().reshape(n, width) if self.spec.row_list else a.numpy().reshape(width, n).T
            for a in (self.matrix.columns, self.matrix.values)
        )
        counts, ids = self.matrix.counts.numpy(), self.rows_of("source")
        dense = np.zeros((n, n))
        dense[ids, ids] = self.matrix.diagonal.numpy()
        for i in range(n):
            for j, value in zip(columns[i, : counts[i]], values[i, : counts[i]], strict=True):
                dense[ids[i], ids[j]] += value
        return dense

    def gradient(self, pressure):
        """Return the pressure gradient that the correction of the velocity would take off."""
        self.put("pressure", pressure)
        self.bindings["advancing"] = 0
        self.run(isph.take(self.spec)[1])
        self.bindings["advancing"] = 1
        return self.get("pressure_gradient")

    def regularise(self):
        """Run the stages after the correction of the velocity: shift, collisions, smoothing of the velocity."""
        self.run(*(stage for stage in isph.finish(self.spec) if stage.name in ("regularise", "smooth_velocity")))

    # reference -----------------------------------------------------------------------------------------------------

    def entries(self):
        """Return the list as a set of (i, j, code), by ids."""
        n, width = self.particles.count, self.list.width
        bit = code_shift(self.spec.dimension)
        table = self.list.neighbours.numpy()
        table = table.reshape(n, width) if self.spec.row_list else table.reshape(width, n).T
        ids, counts = self.particles.get("particle_id"), self.particles.get("fluid_neighbours")
        found = []
        for i in range(n):
            row = table[i, : counts[i]]
            found += [(int(ids[i]), int(ids[j & ((1 << bit) - 1)]), int(j >> bit)) for j in row]
        assert len(found) == len(set(found)), "an entry is there twice"
        return set(found)

    def apart(self, code):
        """Return x_i - R x_j of the nearest periodic images, (n, n, d), for the images of a code."""
        x = self.get("position")[: self.particles.fluid_count]
        d = x[:, None] - reflect(x, code, self.lower, self.upper)[None]
        for axis, period in enumerate(self.box):
            if period > 0:
                d[..., axis] -= period * np.round(d[..., axis] / period)
        return d

    def pairs(self):
        """Yield (code, x_i - R x_j, W'/r V_j) of all images; W'/r is 0 for a particle with itself."""
        alpha = KERNELS[self.spec.kernel].alpha[self.spec.dimension - 1]
        assert self.spec.kernel == "wendland_c2"
        volume = self.get("rest_volume")
        for code in codes_of(self.kinds):
            d = self.apart(code)
            q = np.linalg.norm(d, axis=-1) / self.h
            f = alpha / self.h ** (self.spec.dimension + 2) * -10.0 * np.clip(2.0 - q, 0, None) ** 3 * volume[None]
            if code == 0:
                np.fill_diagonal(f, 0.0)
            yield code, d, f

    def moments(self):
        """Return the moment sum (x_j - x_i) (x) grad W V of each particle, (n, d, d)."""
        return sum(-np.einsum("ij,ija,ijb->iab", f, d, d) for _, d, f in self.pairs())
