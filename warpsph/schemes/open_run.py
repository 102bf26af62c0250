"""Inlets and outlets of a run of any scheme: kernel arguments, and room for the particles that come."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.errors import MISSING, CaseError, Problem
from warpsph.scene.open_faces import Face, factors_of, fill_sites, make_faces, signal_samples

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.geometry import Geometry
    from warpsph.scene.physics import Physics

ROOM = 1.1
"""Room for particles over those of the start: what flows in takes about the place of what flows out."""

OFF = 0.02
"""Share by which flows may differ that are meant to be the same: a parabola on five sites has 2 % too much."""

ROUNDING = 1.0e-9
"""Of the largest flow, what two that are the same may differ by."""

FINER = 10.0
"""Samples of a signal in a step that sound does not limit: a kink of a ramp is rounded by less than a tenth of a step."""


@dataclasses.dataclass(frozen=True)
class OpenRun:
    """The open sides of a run.

    faces: inlets and outlets
    position: (n, d) places of the particles that fill their buffers, m
    number: (n,) which face each belongs to
    """

    faces: list[Face]
    position: np.ndarray
    number: np.ndarray

    @property
    def sites(self) -> int:
        """Sites of all faces."""
        return sum(len(face.position) for face in self.faces)


def open_run(case: Case, geometry: Geometry, physics: Physics) -> OpenRun:
    """Return the open sides of a case whose particles are known. Raises CaseError as `make_faces` and `balance`."""
    faces = make_faces(case, geometry, physics.support, float(physics.choices["skin"]))
    if physics.acoustic == 0 and all(face.gives_velocity for face in faces):
        balance(faces, case.end_time)
    return OpenRun(faces, *fill_sites(faces, geometry.lattice))


def balance(faces: list[Face], end_time: float) -> None:
    """Make what goes out of sides that all give a velocity what comes in, by a factor on that of the last one.

    An incompressible fluid that fills the domain has no other flow. The factor makes up for profiles that are sampled at the
    sites; with it the right-hand side of the pressure equation adds up to nothing, but for what particles that are not even
    leave, and the solver takes its mean out.

    Raises CaseError: the sides differ by more than OFF, or not by the same factor at all times.
    """
    times = np.linspace(0.0, end_time, 1001)
    flows = [float(face.outward * face.velocity[face.free, face.axis].sum()) * factors_of(face, times) for face in faces]
    out, last = np.sum(flows, axis=0), flows[-1]
    most = max(float(np.abs(flow).max()) for flow in flows)
    if most == 0.0:
        return
    at = int(np.abs(last).argmax())
    share = 1.0 - float(out[at]) / float(last[at]) if last[at] != 0.0 else np.inf
    if abs(share - 1.0) > OFF or float(np.abs(out + (share - 1.0) * last).max()) > ROUNDING * most:
        worst = int(np.abs(out).argmax())
        path = f"domain.boundary.{'xyz'[faces[-1].axis]}.{('lower', 'upper')[faces[-1].end]}.inlet.velocity"
        rule = (
            f"lets out {100.0 * float(out[worst]) / most:+.3g} % more than comes in at t = {times[worst]:.4g} s, where an "
            "incompressible fluid fills the domain"
        )
        raise CaseError([Problem(path, MISSING, rule, "give both sides the same flow and ramp, or make one outlet: {}")])
    faces[-1].velocity *= share


def room(found: OpenRun, fluid_count: int) -> int:
    """Return for how many particles there is room at first."""
    return int(ROOM * (fluid_count + len(found.position))) + 1


def arguments(found: OpenRun, case: Case, geometry: Geometry, physics: Physics, device: Any) -> dict[str, Any]:
    """Return the kernel arguments of the open sides by name, arrays on the device."""
    import warp as wp

    from warpsph.kernels.core.crossing import BLOCKS, MOST_SIDES, make_open_side
    from warpsph.kernels.core.fields import BUFFER
    from warpsph.kernels.core.spec import types_of

    spec, faces = physics.spec, found.faces
    real, vec, _, pair = types_of(spec)
    fine = 1.0 if physics.acoustic > 0 else FINER
    samples, step = signal_samples(faces, case.end_time, physics.estimated_step() / fine)
    blocks = BLOCKS[spec.row_list]
    # one after another on a CPU; on a GPU as many stretches as sites in each, so that no thread has many to add
    stretches = 1 if spec.row_list else math.ceil(math.sqrt(max(len(face.position) for face in faces)))

    def array(values: Any, dtype: Any) -> Any:
        return wp.array(values, dtype=dtype, device=device)

    def sites(name: str) -> np.ndarray:
        return np.concatenate([getattr(face, name) for face in faces])

    row = geometry.lattice.spacing[spec.open_axis]
    rows = _sides(faces, case, geometry, samples, physics)
    return {
        "open_sides": array(rows, make_open_side(spec.precision)),
        "signals": array(np.concatenate(samples), wp.float64),
        "signal_step": wp.float64(step),
        "site_side": array(np.repeat(np.arange(len(faces)), [len(face.position) for face in faces]), int),
        "site_position": array(sites("position"), vec),
        "site_velocity": array(sites("velocity"), vec),
        "site_pressure": array(sites("pressure"), real),
        "site_open": array(sites("free"), wp.uint8),
        "sponge_velocity": array(sites("sponge_velocity"), vec),
        "given_velocity": wp.zeros(found.sites, dtype=vec, device=device),
        "site_arrival": wp.zeros(found.sites, dtype=wp.vec3d, device=device),
        "side_stretches": stretches,
        "site_sums": wp.zeros(len(faces) * stretches, dtype=wp.vec4d, device=device),
        "side_memory": wp.zeros(len(faces), dtype=wp.vec2d, device=device),
        "side_excess": wp.zeros(len(faces), dtype=wp.float64, device=device),
        "site_ahead": wp.full(found.sites, -0.5 * row, dtype=wp.float64, device=device),
        "row_spacing": wp.float64(row),
        "face_pressure": wp.zeros(found.sites, dtype=pair, device=device),
        "face_stretch": wp.zeros(found.sites, dtype=real, device=device),
        "face_velocity": wp.zeros(found.sites, dtype=vec, device=device),
        "face_before": wp.zeros(found.sites, dtype=vec, device=device),
        "site_speed": wp.zeros(found.sites, dtype=real, device=device),
        "fill_position": array(found.position, vec),
        "fill_zone": array(found.number + BUFFER, wp.int8),
        "cell_volume": real(geometry.lattice.cell_volume),
        "rest_mass": wp.float64(physics.densities[0]),
        "crossing_blocks": blocks,
        "births": wp.zeros(blocks + 1, dtype=int, device=device),
        "crossed": wp.zeros(2 * MOST_SIDES * blocks, dtype=wp.float64, device=device),
        "through": wp.zeros(2 * MOST_SIDES, dtype=wp.float64, device=device),
    }


def _sides(
    faces: list[Face], case: Case, geometry: Geometry, samples: list[np.ndarray], physics: Physics
) -> list[Any]:
    """Return an `OpenSide` of each face."""
    from warpsph.kernels.core.crossing import make_open_side

    spec, sound = physics.spec, max(physics.sound_speed)
    lattice, rows, site, signal = geometry.lattice, [], 0, 0
    for face, factors in zip(faces, samples, strict=True):
        row = make_open_side(spec.precision)()
        low, high = lattice.lower[face.axis], lattice.upper[face.axis]
        row.face = high if face.end else low
        row.outward = float(face.outward)
        row.depth = face.layers * lattice.spacing[face.axis]
        row.reach = physics.support
        row.gives_velocity = int(face.gives_velocity)
        leaves = physics.acoustic > 0 and face.flow.waves == "leave"
        row.relaxation = face.flow.relaxation * sound / (high - low) if leaves else 0.0
        first, second = face.across
        row.first_site, row.first_axis, row.second_axis = site, first, second
        row.first_count, row.second_count = face.count
        row.first_origin = lattice.lower[first] + 0.5 * lattice.spacing[first]
        row.second_origin = lattice.lower[second] + 0.5 * lattice.spacing[second]
        row.first_spacing, row.second_spacing = lattice.spacing[first], lattice.spacing[second]
        row.first_wraps, row.second_wraps = int(case.periodic[first]), int(case.periodic[second])
        sponge = face.flow.sponge
        if sponge is not None:
            row.sponge_length, row.sponge_rate = sponge.length, sponge.strength * sound / sponge.length
            row.sponge_moves = int(sponge.velocity is not None or face.gives_velocity)
        row.signal_begin, row.signal_count = signal, len(factors)
        rows.append(row)
        site += len(face.position)
        signal += len(factors)
    return rows


def flow_rates(case: Case, geometry: Geometry, physics: Physics, bindings: Any) -> dict[str, float]:
    """Return `flow <side>` [kg/s], `through <side>` [kg], `face_pressure <side>` [Pa]; 2-D: per metre of depth.

    Flow and mass count positive where they go into the domain. The flow is the sum over the sites of a side; the mass is
    that of the particles that have crossed it since the start, counted whenever a neighbour list is made.
    """
    phase = case.phases[case.phase_names[0]]
    pressure = bindings["face_pressure"].numpy()[:, 0].astype(np.float64)
    velocity = bindings["face_velocity"].numpy().astype(np.float64)
    through = bindings["through"].numpy().reshape(-1, 2)
    density = np.full(len(pressure), phase.density)
    if physics.acoustic > 0:
        stiffness = phase.density * physics.sound_speed[0] ** 2 / phase.gamma
        density *= np.power(1.0 + (pressure - phase.background_pressure) / stiffness, 1.0 / phase.gamma)
    rates, site = {}, 0
    for number, face in enumerate(make_faces(case, geometry, physics.support, float(physics.choices["skin"]))):
        here = np.arange(site, site + len(face.position))[face.free]
        site += len(face.position)
        area = geometry.lattice.cell_volume / geometry.lattice.spacing[face.axis]
        rates[f"flow {face.name}"] = float(-face.outward * area * (density[here] * velocity[here, face.axis]).sum())
        rates[f"through {face.name}"] = float(through[number, 0] - through[number, 1])
        rates[f"face_pressure {face.name}"] = float(pressure[here].mean())
    return rates
