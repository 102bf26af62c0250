"""How even particles stand at bodies: sums of weights at the first rows of fluid, and what the constants of the sampling do.

    python scripts/bodies_study.py [--spacing 1/48] [--constants]

For each shape in a periodic box of one metre: the least and the largest S = sum_j V_j W of the fluid nearer than two
spacings to the body, less the S of a lattice, its root mean square, and h |sum_j V_j grad W|, root mean square; the sums
go over the neighbour list, so that thin tails hide what they hide. `lattice`: cells nearer than half a spacing left out;
`fitted`: rows along the body; `relaxed`: the same with boundary particles that repel each other along the layers instead
of equal pieces of parallel lines. `--constants`: fitted, with each constant of the sampling halved and doubled.
"""

import argparse
import math
from contextlib import contextmanager
from fractions import Fraction

import numpy as np

from warpsph.case.case import Case
from warpsph.kernels.core.smoothing import KERNELS
from warpsph.running.model import Model
from warpsph.scene import body_sampling, body_surfaces, rings
from warpsph.scene.shells import relaxed_shells


def corners(count, radius, inner=1.0, turn=0.2):
    """Corners of a regular polygon, or of a star with other corners at a share `inner` of the radius."""
    n = count if inner == 1.0 else 2 * count
    angle = turn + 2 * math.pi * np.arange(n) / n
    r = radius * np.where(np.arange(n) % 2, inner, 1.0)
    return {"polygon": {"points": np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1).tolist()}}


SHAPES = {
    "circle": {"sphere": {"center": [0.003, 0.007], "radius": 0.25}},
    "pentagon": corners(5, 0.3),
    "turned square": corners(4, 0.35),
    "star": corners(5, 0.35, 0.45),
    "triangle": corners(3, 0.35),
    "NACA 0012, 8 degrees": {"airfoil": {"naca": "0012", "chord": 0.7, "angle": 8, "position": [-0.15, 0.0]}},
    "hollow star": corners(5, 0.45, 0.45),
}


def sums(shape, hollow, spacing, arrangement):
    """S less that of a lattice, and h |sum V grad W|, of the fluid nearer than two spacings to the body; lengths of the
    rows."""
    body = {"shape": shape} | ({"hollow": True} if hollow else {})
    sides = "open" if hollow else "periodic"
    case = Case.from_dict(
        {
            "dimension": 2,
            "particle_spacing": spacing,
            "end_time": 1.0,
            "domain": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5], "boundary": {"x": sides, "y": sides}},
            "phases": {"water": {"density": 1000, "viscosity": 1}},
            "fluids": [{"phase": "water", "shape": "rest"}],
            "bodies": {"thing": body},
            "start": {"arrangement": arrangement},
        }
    )
    model = Model(case, "cpu")
    model.stepper.prepare(fresh=True)
    geometry, particles = model.geometry, model.particles
    n, width = geometry.fluid_count, model.stepper.list.width
    # the list build has put the particles in another order
    order = particles.get("particle_id")[: geometry.count]
    position, volume = geometry.position[order], geometry.volume[order]
    counts = particles.get("fluid_neighbours")[:n].astype(int) + particles.get("wall_neighbours").astype(int)
    entries = model.stepper.list.neighbours.numpy().reshape(-1, width)
    surface = body_surfaces.surface_of(case, case.bodies["thing"], np.full(2, -0.5), np.full(2, 0.5))
    h = model.physics.h
    alpha = KERNELS["wendland_c2"].alpha[1]
    near = np.flatnonzero(surface.signed_distance(position[:n]) < 2 * spacing)
    result, uneven = [], []
    for i in near:
        j = entries[i, : counts[i]]
        d = position[i] - position[j]
        d -= np.round(d) * (not hollow)
        q = np.minimum(np.linalg.norm(d, axis=1) / h, 2.0)
        result.append(alpha / h**2 * (16 * volume[i] + ((2 - q) ** 4 * (1 + 2 * q) * volume[j]).sum()))
        uneven.append(alpha / h**3 * np.linalg.norm((-10 * (2 - q) ** 3 * volume[j]) @ d))
    return np.array(result) - lattice_sum(1.5), np.array(uneven), geometry


def lattice_sum(ratio):
    """S of a square lattice with h over spacing."""
    grid = np.stack(np.meshgrid(*[np.arange(-9, 10)] * 2), axis=-1).reshape(-1, 2)
    q = np.minimum(np.linalg.norm(grid, axis=1) / ratio, 2.0)
    return KERNELS["wendland_c2"].alpha[1] / ratio**2 * ((2 - q) ** 4 * (1 + 2 * q)).sum()


def line(what, shape, hollow, spacing, arrangement):
    s, g, geometry = sums(shape, hollow, spacing, arrangement)
    rms = math.sqrt((s**2).mean())
    gradient = math.sqrt((g**2).mean())
    print(f"| {what} | {s.min():+.3f} to {s.max():+.3f} | {rms:.4f} | {gradient:.3f} | {geometry.wall_count} |")


@contextmanager
def changed(module, name, value):
    """A constant of a module with another value."""
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)




def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacing", type=lambda text: float(Fraction(text)), default=1 / 48, help="particle spacing, m")
    parser.add_argument("--constants", action="store_true", help="halve and double the constants of the sampling")
    arguments = parser.parse_args()
    dx = arguments.spacing
    print("| body | S - S of a lattice | rms | h sum V grad W, rms | boundary particles |\n|---|---|---|---|---|")
    for name, shape in SHAPES.items():
        hollow = name.startswith("hollow")
        if arguments.constants:
            line(name, shape, hollow, dx, "fitted")
            for module, constant, values in (
                (rings, "CORNER", (0.5, 2.0)), (rings, "MITRE", (2 / 3, 2.0)), (rings, "NEAREST", (0.5, 4 / 3)),
                (rings, "SMALLEST", (0.5, 2.0)),
            ):  # fmt: skip
                for factor in values:
                    value = getattr(module, constant) * factor
                    with changed(module, constant, value):
                        line(f"{name}, {constant} {value:.3g}", shape, hollow, dx, "fitted")
            continue
        line(f"{name}, lattice", shape, hollow, dx, "lattice")
        line(f"{name}, fitted", shape, hollow, dx, "fitted")
        if "NACA" not in name:
            with changed(body_sampling, "layers_of", relaxed_shells):
                line(f"{name}, relaxed", shape, hollow, dx, "fitted")


if __name__ == "__main__":
    main()
