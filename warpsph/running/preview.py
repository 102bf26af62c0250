"""What a run would be, before it: its structure, and what it takes of memory and time."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpsph.case.case_file import as_case
from warpsph.engine import free_memory
from warpsph.engine.program import lines
from warpsph.running import memory
from warpsph.running.doubts import doubts
from warpsph.scene.geometry import build
from warpsph.scene.open_faces import open_axis
from warpsph.scene.physics import derive, support_radius

if TYPE_CHECKING:
    from warpsph.case.case import Case
    from warpsph.scene.physics import Physics

    CaseLike = Case | Path | str | Mapping[str, Any]

# For the estimate of `check`, where nothing was measured yet: million particle-steps per second of a plane whose supports
# reach three spacings, the neighbours that a particle has there, seconds that a stage takes however few particles there are,
# and how many stages the iterations of a pressure solve are worth.
GUESSED_RATE = 2.0
GUESSED_NEIGHBOURS = math.pi * 3.0**2
GUESSED_STAGE = 2.0e-5
SOLVE_STAGES = 100

OF_DEVICES = ("row_list", "wide_list", "few")  # of a structure, what the device decides and not the scene


def describe(case: CaseLike) -> dict[str, Any]:
    """Return what a run of the case would be: resolved case, structure, stages, and what is absent and why.

    Compiles and allocates nothing on a device.

    Raises:
        CapacityError: the particles do not fit the memory of this machine.
    """
    case = as_case(case)
    refused = memory.shortage(case)
    if refused is not None:
        raise refused
    geometry = build(case, support_radius(case))
    physics = derive(case, geometry)
    known: dict[str, Any] = {
        f"numerics.{key}": value for key, value in physics.choices.items() if value is not None
    }
    for name, c in zip(case.phase_names, physics.sound_speed, strict=True):
        known[f"phases.{name}.sound_speed"] = c
    known |= {f"scales.{name}": value for name, value in physics.scales.items() if value > 0}  # 0: nothing is known
    known["start.arrangement"] = geometry.arrangement
    if geometry.loaded:
        known["start.pressure"] = geometry.loaded
    spec = physics.spec
    program = case.scheme.program(spec, physics.choices)
    shown = lines(program.step, changes=program.changes)
    return {
        "resolved": case.resolved(known),
        "structure": {
            **{name: value for name, value in dataclasses.asdict(spec).items() if name not in OF_DEVICES},
            "smoothing length": f"{physics.h:.6g} m",
            "support radius": f"{physics.support:.6g} m",
            "start arrangement": f"{geometry.arrangement}: {geometry.arrangement_reason}",
            "step limits": {name: f"{value:.4g} s" for name, value in physics.step_cap.items()},
            "fields": [field.name for field in case.scheme.fields() if field.exists(spec)],
        },
        "reasons": {**physics.reasons, "start.arrangement": geometry.arrangement_reason},
        "stages": [{"name": name, "reason": reason, "depth": depth} for depth, name, reason in shown],
        "absent": [{"name": row.name, "reason": row.reason} for row in case.scheme.absent(spec)],
        "warnings": [*doubts(case, geometry), *geometry.warnings, *physics.warnings],
    }


def estimate(case: CaseLike) -> dict[str, Any]:
    """Return particle counts, memory of the device and of the host [bytes], time step [s], steps, seconds, and warnings.

    `start_pressure` is what `start.pressure` came to where it is auto, else empty, `sound_across` the frequency of the
    lowest sound across a stream [1/s], see `lowest_sound_across`.
    Where the particles do not even fit the memory that building them takes, there are the first four alone, from
    arithmetic, and `refused`, the CapacityError to raise.
    """

    case = as_case(case)
    found = memory.count(case, support_radius(case))
    refused = memory.shortage(case, found=found)
    if refused is not None:
        return {
            "particles": found.fluid,
            "walls": found.walls,
            "memory_bytes": memory.expected_on_device(case, found),
            "host_bytes": memory.building(case, found),
            "refused": refused,
        }
    geometry = build(case, support_radius(case))
    physics = derive(case, geometry)
    spec = physics.spec
    skin = float(physics.choices["skin"])
    fluid, walls = geometry.fluid_count, geometry.wall_count
    taken = memory.on_device(case, spec, fluid, walls, physics.support, skin, geometry.lattice)
    warnings = [*doubts(case, geometry), *geometry.warnings, *physics.warnings]
    free, host = free_memory.host_free(), memory.running_on_host(case, found)
    if free is not None and host + taken > free:
        warnings.append(
            f"memory: a run on the CPU takes {(host + taken) / 1e9:.3g} GB, but {free / 1e9:.3g} GB are free here; it needs "
            f"a device with {taken / 1e9:.3g} GB, or a larger particle_spacing"
        )
    program = case.scheme.program(spec, physics.choices)
    dt = physics.estimated_step()
    steps = physics.estimated_steps(case.end_time)
    reach = physics.support / case.spacing
    neighbours = {1: 2.0 * reach, 2: math.pi * reach**2, 3: 4.0 / 3.0 * math.pi * reach**3}[case.dimension]
    return {
        "particles": fluid,
        "walls": walls,
        "memory_bytes": taken,
        "host_bytes": host,
        "dt": dt,
        "steps": steps,
        "seconds": steps * guessed_step(
            geometry.count, neighbours * case.scheme.pair_cost(spec), [name for _, name, _ in lines(program.step)]
        ),
        "start_pressure": geometry.loaded,
        "sound_across": lowest_sound_across(case, physics),
        "warnings": warnings,
    }


def guessed_step(particles: int, neighbours: float, stages: list[str]) -> float:
    """Return the seconds to expect of a step of so many particles, walls included, on one thread.

    neighbours: of a particle; those of a scheme whose pairs take longer count for more
    """
    pace = GUESSED_RATE * 1e6 * GUESSED_NEIGHBOURS / neighbours
    return particles / pace + GUESSED_STAGE * sum(SOLVE_STAGES if name == "solve" else 1 for name in stages)


def lowest_sound_across(case: Case, physics: Physics) -> float | None:
    """Return the frequency of the lowest sound across a stream between open sides [1/s]; None without a stream or sound.

    c/(2 L) between walls L apart, c/L where the domain is periodic. Sound of this frequency does not travel along the
    stream and finds no way out: a body that sheds vortices near it rings with its own box (theory: riemann#sound-across).
    """
    axis = open_axis(case)
    if axis < 0 or physics.acoustic <= 0.0:
        return None
    lengths = [upper - lower for lower, upper in zip(case.domain.lower, case.domain.upper, strict=True)]
    waves = [
        length if periodic else 2.0 * length
        for other, (length, periodic) in enumerate(zip(lengths, case.periodic, strict=True))
        if other != axis
    ]
    # slow sound, where the pressure relaxes too: not the one that limits the step
    return min(max(physics.sound_speed) / wave for wave in waves) if waves else None
