"""Random plausible scenes, and what a run of one must not do: `stress.py --scenes N --seed S`.

A scene is drawn whole from its seed: one to three real liquids and gases, from millimetres to metres, two or three
dimensions, sides that are walls, free-slip walls, periodic or a moving lid, gravity or none, tension and contact angles
or none; columns, layers, drops, bubbles, drops that are thrown at a floor or a pool, thin films, fixed bodies. All
numerics are `auto`. One scene in six is of one liquid; a part of those runs with projection ISPH.

A run is judged by what the scene itself allows, with no number taken from a run:

* lives: no fault, everything finite;
* leaks: no particle was ever outside of the domain or inside a body (`Model.leaks`);
* speed: of phase k at most SPEED_MARGIN sqrt(2 p/rho_k), p the largest pressure that weight, start speed, moving walls
  and tension can make (Bernoulli), QUIET c at least; a light phase that a heavy one squeezes out may be as fast as that;
* energy: kinetic + potential + elastic energy at no sample more than ENERGY_LIMIT of the scene's energy above what the
  start has, its surfaces included. The scene's energy is kinetic + surface energy of the start + the potential energy
  above that of the same fluids sorted by density + what lifts all fluid by LIFT spacings, since no arrangement of
  particles knows its height better; where all move at QUIET c, nothing is asked of their energy. Not judged where a
  moving wall feeds the scene.
"""

from __future__ import annotations

import math
import random
import time
from typing import Any

import numpy as np

SAMPLES = 20
ENERGY_LIMIT = 0.02
LIFT = 10.0  # with ENERGY_LIMIT a fifth of a spacing: the disorder that a scene may start with (`start.noise`)
SPEED_MARGIN = 2.0
QUIET = 1.0e-3  # of the lowest sound speed: what a scene without any energy may move at
CRITERIA = ("lives", "leaks", "speed", "energy")

# density [kg/m^3], viscosity [Pa s], surface tension against a gas [N/m]
LIQUIDS = {
    "water": (998.0, 1.0e-3, 0.0728),
    "oil": (880.0, 0.02, 0.030),
    "glycerol": (1260.0, 1.4, 0.063),
    "ethanol": (789.0, 1.2e-3, 0.022),
    "mercury": (13534.0, 1.5e-3, 0.485),
    "silicone": (965.0, 0.1, 0.021),
    "brine": (1180.0, 1.8e-3, 0.080),
}
# density [kg/m^3], viscosity [Pa s], ratio of specific heats
GASES = {
    "air": (1.2, 1.8e-5, 1.4),
    "helium": (0.166, 2.0e-5, 1.66),
    "hydrogen": (0.084, 0.9e-5, 1.41),
    "sulphur_hexafluoride": (6.1, 1.5e-5, 1.09),
    "steam": (0.6, 1.2e-5, 1.3),
}
GRAVITY = 9.81


class Draw:
    """What a seed says; every method is one decision."""

    def __init__(self, seed: int, attempt: int) -> None:
        self.random = random.Random(f"warpsph scene {seed} {attempt}")

    def chance(self, share: float) -> bool:
        return self.random.random() < share

    def choice(self, values: Any) -> Any:
        return self.random.choice(list(values))

    def uniform(self, low: float, high: float) -> float:
        return self.random.uniform(low, high)

    def log(self, low: float, high: float) -> float:
        return math.exp(self.random.uniform(math.log(low), math.log(high)))


# ---- the scene ---------------------------------------------------------------------------------------------


def scene(seed: int) -> dict[str, Any]:
    """Return the case of a seed as plain data, as a case file holds it: the first drawn whose regions all hold particles."""
    from warpsph.case.case import Case
    from warpsph.errors import CaseError
    from warpsph.scene.geometry import build
    from warpsph.scene.physics import support_radius

    for attempt in range(100):
        data = _scene(Draw(seed, attempt), f"random scene {seed}")
        try:
            case = Case.from_dict(data)
            build(case, support_radius(case))
        except CaseError as error:
            if "no particle lies in it" in str(error):
                continue
        return data
    raise RuntimeError(f"seed {seed}: no scene in 100 attempts")


def _scene(draw: Draw, title: str) -> dict[str, Any]:
    """Return what one draw says."""
    dimension = 3 if draw.chance(0.12) else 2
    length = draw.log(2e-3, 2.0)
    across = draw.choice((7, 8) if dimension == 3 else (16, 20, 24, 28))
    spacing = length / across
    aspect = draw.choice((0.75, 1.0) if dimension == 3 else (0.75, 1.0, 1.0, 1.5))
    high = max(round(across * aspect), 8)
    counts = [across] * (dimension - 1) + [high]
    upper = [n * spacing for n in counts]
    phases, tension, single = _phases(draw)
    gravity = single or draw.chance(0.8)
    case: dict[str, Any] = {
        "title": title,
        "dimension": dimension,
        "particle_spacing": spacing,
        "end_time": 1.0e6,  # runs are counted in steps
        "precision": "float64" if draw.chance(0.12) else "float32",
        "gravity": [0.0] * (dimension - 1) + [-GRAVITY if gravity else 0.0],
        "phases": phases,
        "surface_tension": tension,
        "output": {"particles": "none", "checkpoint": "none"},
        "start": {"noise": draw.choice((0.1, 0.2))} if draw.chance(0.25) else {},
    }
    pace = math.sqrt(GRAVITY * upper[-1]) if gravity else _capillary_pace(phases, tension, length)
    case["domain"] = {
        "lower": [0.0] * dimension,
        "upper": upper,
        "boundary": _boundary(draw, dimension, pace, open_top=single and draw.chance(0.4), gravity=gravity),
    }
    case["fluids"], moving = _fluids(draw, list(phases), spacing, counts, single)
    if moving:
        _throw(draw, case, moving, pace)
    if draw.chance(0.3):
        case["bodies"] = {"block": _body(draw, spacing, counts)}
    if gravity and draw.chance(0.6):
        case["start"]["pressure"] = "hydrostatic"
    if single and draw.chance(0.35) and "bodies" not in case:
        case["numerics"] = {"scheme": "isph"}
        case["surface_tension"] = []
    return case


def _phases(draw: Draw) -> tuple[dict[str, Any], list[dict[str, Any]], bool]:
    """Return phases, surface tensions, and whether there is one phase alone (with a free surface)."""
    count = draw.choice((1, 2, 2, 2, 3, 3))
    liquids = draw.random.sample(list(LIQUIDS), 2)
    names = liquids[:1]
    if count == 2:
        names.append(draw.choice(GASES) if draw.chance(0.8) else liquids[1])
    if count == 3:
        names = [*liquids, draw.choice(GASES)]
    phases: dict[str, Any] = {}
    for name in names:
        if name in LIQUIDS:
            phases[name] = {"density": LIQUIDS[name][0], "viscosity": LIQUIDS[name][1]}
        else:
            phases[name] = {"density": GASES[name][0], "viscosity": GASES[name][1], "gamma": GASES[name][2]}
    if count == 1 and draw.chance(0.3):
        phases[names[0]]["viscosity"] = 0.0
    tension = []
    if count > 1 and draw.chance(0.65):
        angle = draw.uniform(40, 140) if draw.chance(0.3) and count == 2 else None
        for a in range(count):
            for b in range(a + 1, count):
                pair: dict[str, Any] = {"between": [names[a], names[b]], "coefficient": _coefficient(names[a], names[b])}
                if angle is not None:
                    pair["contact_angle"] = angle
                tension.append(pair)
    return phases, tension, count == 1


def _coefficient(a: str, b: str) -> float:
    """Surface tension between two fluids [N/m]; of two liquids half the difference to a gas, and no less than 5 mN/m."""
    if a in LIQUIDS and b in LIQUIDS:
        return max(0.5 * abs(LIQUIDS[a][2] - LIQUIDS[b][2]), 0.005)
    return LIQUIDS[a if a in LIQUIDS else b][2]


def _capillary_pace(phases: dict[str, Any], tension: list[dict[str, Any]], length: float) -> float:
    """Return a speed for scenes without gravity [m/s]."""
    densest = max(phase["density"] for phase in phases.values())
    largest = max((pair["coefficient"] for pair in tension), default=0.02)
    return math.sqrt(largest / (densest * 0.2 * length))


def _boundary(draw: Draw, dimension: int, pace: float, open_top: bool, gravity: bool) -> dict[str, Any]:
    """Return the sides; the last axis is the one of gravity, which is never periodic under gravity."""
    sides: dict[str, Any] = {}
    for axis in "xyz"[:dimension]:
        last = axis == "xyz"[dimension - 1]
        kinds = ["wall", "wall", "free_slip"] if last and gravity else ["wall", "wall", "free_slip", "periodic"]
        kind = draw.choice(kinds)
        if kind == "periodic":
            sides[axis] = kind
            continue
        other = draw.choice(("wall", "free_slip")) if draw.chance(0.3) else kind
        sides[axis] = {"lower": kind, "upper": "open" if last and open_top else other}
        if draw.chance(0.12) and sides[axis]["upper"] == "wall":
            along = draw.random.randrange(dimension - 1)
            velocity = [0.0] * dimension
            velocity[along if along < "xyz".index(axis) else along + 1] = draw.uniform(-1, 1) * pace
            sides[axis]["upper"] = {"wall": "no_slip", "velocity": velocity}
    return sides


def _box(low: list[float], high: list[float]) -> dict[str, Any]:
    return {"box": {"lower": low, "upper": high}}


def _fluids(
    draw: Draw, names: list[str], spacing: float, counts: list[int], single: bool
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the regions in order, and the shapes that are thrown. The last phase fills the rest."""
    size = [n * spacing for n in counts]
    d = len(size)

    def column(phase: str) -> dict[str, Any]:
        width, height = draw.uniform(0.25, 0.5) * size[0], draw.uniform(0.4, 0.9) * size[-1]
        return {"phase": phase, "shape": _box([0.0] * d, [width, *size[1:-1], height])}

    def layer(phase: str, top: float) -> dict[str, Any]:
        return {"phase": phase, "shape": _box([0.0] * d, [*size[:-1], top])}

    def disc(phase: str, height: float | None = None) -> dict[str, Any]:
        radius = draw.uniform(0.12, 0.25) * min(size)
        center = [draw.uniform(0.3, 0.7) * s for s in size]
        if height is not None:
            center[-1] = min(height * size[-1], size[-1] - radius - spacing)
        return {"phase": phase, "shape": {"sphere": {"center": center, "radius": radius}}}

    def hanging(phase: str) -> dict[str, Any]:
        low, high = [], []
        for s in size:
            width = draw.uniform(0.2, 0.4) * s
            start = draw.uniform(0.1, 0.9) * (s - width)
            low.append(start)
            high.append(start + width)
        return {"phase": phase, "shape": _box(low, high)}

    first = names[0]
    film = draw.choice((2, 3, 4)) * spacing
    kinds = ["column", "layer", "drop", "block", "impact", "pool", "film"]
    kind = draw.choice(kinds)
    thrown: list[dict[str, Any]] = []
    regions: list[dict[str, Any]] = []
    if kind == "column":
        regions.append(column(first))
    elif kind == "layer":
        regions.append(layer(first, draw.uniform(0.3, 0.7) * size[-1]))
    elif kind == "drop":
        regions.append(disc(first))
    elif kind == "block":
        regions.append(hanging(first))
    elif kind == "impact":
        regions.append(disc(first, height=0.6))
        thrown.append(regions[-1]["shape"])
    elif kind == "pool":
        pool = names[1] if len(names) == 3 and draw.chance(0.5) else first
        regions.append(disc(first, height=0.75))
        thrown.append(regions[-1]["shape"])
        regions.append(layer(pool, draw.uniform(0.2, 0.4) * size[-1]))
    else:
        regions.append(layer(first, film))
        if draw.chance(0.5):
            regions.append(disc(first, height=0.6))
    if len(names) == 3:
        second = names[1]
        more = draw.choice(("layer", "drop", "block"))
        if more == "layer":
            regions.append(layer(second, draw.uniform(0.4, 0.8) * size[-1]))
        else:
            regions.append(disc(second) if more == "drop" else hanging(second))
    if not single:
        rest = names[-1]
        # a bubble of the light phase in what else is there
        if draw.chance(0.15) and kind in ("layer", "column"):
            regions.insert(0, disc(rest, height=0.25))
        regions.append({"phase": rest, "shape": "rest"})
    _separate(regions)
    return regions, thrown


def _separate(regions: list[dict[str, Any]]) -> None:
    """Cut what earlier regions hold out of later ones: regions of a case may not overlap."""
    taken: list[str] = []
    for region in regions:
        if region["shape"] == "rest":
            continue
        condition = _inside(region["shape"])
        if taken:
            region["shape"] = {"where": {"condition": " and ".join([condition, *(f"not ({other})" for other in taken)])}}
        taken.append(condition)


def _inside(shape: dict[str, Any]) -> str:
    """Return the condition that a point is in a sphere or box, as a formula."""
    if "box" in shape:
        rows = zip("xyz", shape["box"]["lower"], shape["box"]["upper"], strict=False)
        return " and ".join(f"{low!r} <= {axis} < {high!r}" for axis, low, high in rows)
    sphere = shape["sphere"]
    terms = [f"({axis} - {c!r})**2" for axis, c in zip("xyz", sphere["center"], strict=False)]
    return f"{' + '.join(terms)} < {sphere['radius']**2!r}"


def _throw(draw: Draw, case: dict[str, Any], shapes: list[dict[str, Any]], pace: float) -> None:
    """Give the shapes a velocity of up to three times the pace, mostly downwards."""
    speed = draw.uniform(0.3, 3.0) * pace
    angle = draw.uniform(-0.6, 0.6)
    inside = _inside(shapes[0])
    velocity = ["0"] * case["dimension"]
    velocity[0] = f"where({inside}, {speed * math.sin(angle)!r}, 0)"
    velocity[-1] = f"where({inside}, {-speed * math.cos(angle)!r}, 0)"
    case["start"]["velocity"] = velocity


def _body(draw: Draw, spacing: float, counts: list[int]) -> dict[str, Any]:
    """Return a fixed body of at least four spacings, clear of the sides or standing on the floor."""
    size = [n * spacing for n in counts]
    wall = draw.choice(("no_slip", "no_slip", "free_slip"))
    center = [draw.uniform(0.3, 0.7) * s for s in size]
    half = [max(draw.uniform(0.08, 0.15) * s, 2 * spacing) for s in size]
    if draw.chance(0.5):
        return {"shape": {"sphere": {"center": center, "radius": max(half)}}, "wall": wall}
    low = [round((c - h) / spacing) * spacing for c, h in zip(center, half, strict=True)]
    high = [round((c + h) / spacing) * spacing for c, h in zip(center, half, strict=True)]
    if draw.chance(0.5):
        low[-1] = 0.0
    return {"shape": _box(low, high), "wall": wall}


# ---- what the scene allows ---------------------------------------------------------------------------------


def _lattice_surface(model: Any) -> float:
    """Return the surface energy of the start, from faces between lattice cells of different phases: an upper bound [J]."""
    tension, lattice = model.physics.tension, model.geometry.lattice
    fluid = model.geometry.kind == 0
    spacing = np.array(lattice.spacing)
    index = np.floor((model.geometry.position[fluid] - np.array(lattice.lower)) / spacing).astype(int)
    index = np.clip(index, 0, np.array(lattice.count) - 1)
    cells = np.full(lattice.count, -1)
    cells[tuple(index.T)] = model.geometry.phase[fluid]
    energy = 0.0
    for axis in range(len(lattice.count)):
        a, b = np.moveaxis(cells, axis, 0)[:-1], np.moveaxis(cells, axis, 0)[1:]
        face = math.prod(lattice.spacing) / lattice.spacing[axis]
        meets = (a >= 0) & (b >= 0) & (a != b)
        energy += float(tension[a[meets], b[meets]].sum()) * face
    return energy


def _lowest_potential(mass: np.ndarray, volume: np.ndarray, area: float, g: float, bottom: float) -> float:
    """Return the potential energy of the fluids sorted by density from the bottom up [J]."""
    order = np.argsort(-mass / volume)
    filled = np.cumsum(volume[order])
    height = bottom + (filled - 0.5 * volume[order]) / area
    return float((mass[order] * height).sum() * g)


class Allowed:
    """Speeds and energies that a scene allows, from its start.

    speed: per phase [m/s]; scale: the scene's energy [J]; start: energy of the start, its surfaces included [J];
    fed: whether a moving wall feeds the scene.
    """

    def __init__(self, model: Any, snapshot: Any) -> None:
        case, physics = model.case, model.physics
        g = float(np.linalg.norm(case.gravity))
        size = np.array(case.domain.upper) - np.array(case.domain.lower)
        height = float(size[-1])
        density = np.array([case.phases[name].density for name in case.phase_names])
        speeds = np.linalg.norm(snapshot.velocity, axis=1)
        wall = float(np.linalg.norm(model.geometry.boundary_velocity, axis=1).max(initial=0.0))
        for axis in case.sides:
            for side in (axis.lower, axis.upper):
                wall = max(wall, float(np.linalg.norm(side.velocity or 0.0)))
        self.fed = wall > 0
        curved = float(physics.tension.max(initial=0.0)) / case.spacing
        fastest = max(float(speeds.max(initial=0.0)), wall)
        pressure = float(density.max()) * (g * height + 0.5 * fastest**2) + (case.dimension - 1) * curved
        pressure += float(density.max()) * (QUIET * min(physics.sound_speed)) ** 2
        self.speed = SPEED_MARGIN * np.sqrt(2.0 * pressure / density)
        self.gravity, self.axis = g, case.dimension - 1
        area = float(np.prod(size[:-1]))
        parts = self.parts(model, snapshot)
        surface = _lattice_surface(model)
        lowest = _lowest_potential(snapshot.mass, snapshot.volume, area, g, float(case.domain.lower[-1]))
        weight = float(snapshot.mass.sum()) * g
        self.start = sum(parts) + surface
        self.scale = parts[0] + max(parts[1] - lowest, 0.0) + surface + LIFT * case.spacing * weight
        quiet = 0.5 * float(snapshot.mass.sum()) * (QUIET * min(physics.sound_speed)) ** 2
        self.scale = max(self.scale, quiet / ENERGY_LIMIT)

    def parts(self, model: Any, snapshot: Any) -> tuple[float, float, float]:
        """Return kinetic, potential and elastic energy [J]."""
        mass = np.asarray(snapshot.mass, np.float64)
        kinetic = 0.5 * float((mass * (np.asarray(snapshot.velocity, np.float64) ** 2).sum(axis=1)).sum())
        potential = float((mass * snapshot.position[:, self.axis]).sum()) * self.gravity
        elastic = 0.0
        if model.physics.spec.scheme != "isph":
            from warpsph.measure.totals import PhaseEos

            rows = zip(model.case.phase_names, model.physics.sound_speed, strict=True)
            for k, (name, c) in enumerate(rows):
                phase = model.case.phases[name]
                eos = PhaseEos(phase.density, c, phase.gamma, phase.background_pressure)
                own = snapshot.phase == k
                elastic += float((mass[own] * eos.elastic_energy(snapshot.density[own])).sum())
        return kinetic, potential, elastic


def run(seed: int, steps: int, device: str, threads: int | None, changes: dict[str, Any] | None = None) -> dict[str, Any]:
    """Run the scene of a seed and return its row: criteria, fault, numbers of its samples.

    Args:
        changes: of the case, by dotted key, to look into a seed.
    """
    from warpsph.case.case import Case
    from warpsph.errors import WarpsphError
    from warpsph.running.model import Model

    data = scene(seed)
    begin = time.perf_counter()
    row: dict[str, Any] = {"seed": seed, "device": device, "fault": "", "steps": 0, "samples": []}
    try:
        case = Case.from_dict(data)
        if changes:
            case = case.replace(changes)
        model = Model(case, device=device, threads=threads)
        model.stepper.prepare(fresh=True)
        _march(model, row, steps)
    except WarpsphError as error:
        row["fault"] = f"{type(error).__name__}: {error}"
        row["criteria"] = {name: {"value": None, "ok": False} for name in CRITERIA}
    row["seconds"] = time.perf_counter() - begin
    row["case"] = data
    return row


def _march(model: Any, row: dict[str, Any], steps: int) -> None:
    """Run the steps in SAMPLES parts, sampling after each, and judge."""
    from warpsph.kernels.core import clock as ck

    begin = time.perf_counter()
    allowed = Allowed(model, model.snapshot().fluid)
    worst = {"speed": 0.0, "energy": -math.inf}
    for number in range(SAMPLES):
        portion = (number + 1) * steps // SAMPLES - number * steps // SAMPLES
        model.stepper.run(model.case.end_time, portion)
        _, counters = model.stepper.read()
        if counters[ck.FAULT]:
            row["fault"] = describe_fault(model, int(counters[ck.FAULT_PARTICLE]))
            break
        snapshot = model.snapshot().fluid
        speed = np.linalg.norm(snapshot.velocity, axis=1)
        if not (np.isfinite(speed).all() and np.isfinite(snapshot.density).all()):
            row["fault"] = f"not finite at step {snapshot.step}"
            break
        # what has left through an open side falls for ever
        low, high = np.array(model.case.domain.lower), np.array(model.case.domain.upper)
        there = ((snapshot.position >= low) & (snapshot.position <= high)).all(axis=1)
        fastest = [float(speed[there & (snapshot.phase == k)].max(initial=0.0)) for k in range(len(allowed.speed))]
        parts = allowed.parts(model, snapshot)
        worst["speed"] = max(worst["speed"], *(s / a for s, a in zip(fastest, allowed.speed, strict=True)))
        worst["energy"] = max(worst["energy"], (sum(parts) - allowed.start) / allowed.scale)
        row["samples"].append({"time": snapshot.time, "step": snapshot.step, "speed": fastest, "energy": parts})
    most, last = model.leaks()
    row.update(
        steps=model.steps,
        time=model.time,
        particles=model.particles.count,
        leaks={"largest": most, "last": last},
        run_seconds=time.perf_counter() - begin,
    )
    row["criteria"] = {
        "lives": {"value": not row["fault"], "ok": not row["fault"]},
        "leaks": {"value": sum(most.values()), "ok": sum(most.values()) == 0},
        "speed": {"value": worst["speed"], "ok": worst["speed"] <= 1.0},
        "energy": {"value": worst["energy"], "ok": allowed.fed or worst["energy"] <= ENERGY_LIMIT},
    }


def describe_fault(model: Any, row: int) -> str:
    """What is wrong with the particle that stopped a run."""
    if not 0 <= row < model.particles.fluid_count:
        return f"fault at step {model.steps}"
    position = ", ".join(f"{x:.3g}" for x in model.particles.get("position")[row])
    speed = float(np.linalg.norm(model.particles.get("velocity")[row].astype(np.float64)))
    excess = float(model.particles.get("density_excess")[row])
    name = model.case.phase_names[int(model.particles.get("phase")[row]) if "phase" in model.particles.arrays else 0]
    return (
        f"step {model.steps}: {name} at ({position}) has speed {speed:.3g} (limit {model.physics.runaway:.3g}), "
        f"rho/rho0 - 1 = {excess:.3g}"
    )


HEAD = f"{'seed':>6} {'scene':58} {'leaks':>6} {'speed':>8} {'energy %':>9} {'steps':>7} {'seconds':>8}  verdict"


def describe(data: dict[str, Any]) -> str:
    """One line of what a scene is."""
    sides = []
    for axis in data["domain"]["boundary"].values():
        if isinstance(axis, str):
            sides.append(axis[:3])
            continue
        ends = [end if isinstance(end, str) else "lid" for end in axis.values()]
        sides.append("/".join(dict.fromkeys(end[:4] for end in ends)))
    extra = [word for word, there in (
        ("tension", data["surface_tension"]), ("body", data.get("bodies")), ("thrown", data["start"].get("velocity")),
        ("isph", data.get("numerics")), ("no gravity", not any(data["gravity"])), ("f64", data["precision"] == "float64"),
    ) if there]  # fmt: skip
    length = data["domain"]["upper"][0]
    return f"{data['dimension']}-D {length:.2g} m {'+'.join(data['phases'])} {' '.join(sides)} {' '.join(extra)}"


def line(row: dict[str, Any]) -> str:
    """The row of the table; what misses its limit has a ! before it."""

    def cell(name: str, form: str, factor: float = 1.0) -> str:
        entry = row["criteria"][name]
        text = "-" if entry["value"] is None else format(factor * entry["value"], form)
        return text if entry["ok"] else f"!{text}"

    missed = [name for name, entry in row["criteria"].items() if not entry["ok"]]
    verdict = "ok" if not missed else f"FAULT: {row['fault']}" if "lives" in missed else "missed " + ", ".join(missed)
    return (
        f"{row['seed']:6d} {describe(row['case']):58} {cell('leaks', '.0f'):>6} {cell('speed', '.3g'):>8} "
        f"{cell('energy', '.3g', 100):>9} {row['steps']:7d} {row['seconds']:8.1f}  {verdict}"
    )
