"""Stability of whole runs under combinations of physics, resolution, disorder and precision.

    python scripts/stress.py [--quick] [--device cpu|cuda:0] [--threads N] [--processes N] [--only SCENE ...]
                             [--steps 2000] [--random 4] [--seed 1] [--point KEY=VALUE ...] [--json FILE]
    python scripts/stress.py --scenes N [--seed S] [--set KEY=VALUE] [--gpu-share K] ...

The second form runs N random scenes of 20 000 steps, seeds S and following, and judges them: `random_scenes.py`. Those in
three dimensions are a third as many spacings across, so that they see as much in a third of the steps.

The first: seven scenes in a unit box, radius or layer R = 0.25: a static drop (periodic, tension), a layered tank at rest
(walls, gravity), a drop stirred by Taylor-Green vortices (periodic, tension), a rising bubble (walls, gravity, tension), a
standing capillary wave, a lens of a third phase between the two (tensions 5 : 4 : 3), a drop that hits a floor (walls,
tension). Each runs at a base point, with one axis of AXES changed at a time, and at random points (`--random`,
`--seed`). `--point` runs one point alone, e.g. `--only bubble --point density_ratio=10000 noise=0.3`. All numerics are
`auto` but for what an axis sets.

Measured and judged, with the limits below; the state is read back 20 times a run:

* survives: no fault, everything finite;
* speed: largest speed of a phase over what the scene's forces give that phase, at all 20 times;
* energy: total (kinetic, potential, elastic, surface) at the end above that at the start, over the scene's energy. No
  scene is fed with energy: it may fall, and grow by 1 %. Surface: tension times the length of the contour, which does
  not mind disorder as |grad C| does;
* strays: particles with fewer than 2 others of their phase within 1.5 spacings at the end; no more than at the start;
* drift: change of the mean velocity over the scene's speed, where no wall takes momentum; 1 %.

The column `times` is the time reached over R / speed of the heavy phase: stiff points get less far in the same number of
steps. Exit code 1 if any run misses any of them. `--quick` (24 particles across instead of 40) takes a few minutes on two
cores.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import multiprocessing
import random
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.study.provenance import provenance

sys.path.insert(0, str(Path(__file__).parent))  # when imported instead of run
import random_scenes  # noqa: E402

SCENE_STEPS = {1: 20_000, 2: 20_000, 3: 6_700}  # of a random scene, by its dimension
RADIUS = 0.25  # of drop and bubble; a quarter of the box
SAMPLES = 20
ENERGY_LIMIT = 0.01
DRIFT_LIMIT = 0.01
CRITERIA = ("survives", "speed", "energy", "strays", "drift")
STRAY_REACH, STRAY_COMPANY = 1.5, 2
AXES: dict[str, tuple[Any, ...]] = {
    "density_ratio": (1.0, 10.0, 1000.0, 10000.0),
    "viscosity_ratio": (1.0, 100.0, 1000.0),
    "resolution": (5, 10, 20, 40),
    "noise": (0.0, 0.1, 0.2, 0.3),
    "precision": ("float32", "float64"),
    "smoothing_ratio": ("auto", 1.25, 1.5, 2.0),
}
GPU_ALONE = {"resolution": (40,)}  # too slow elsewhere
QUICK = {"resolution": (5, 6, 12)}
STEPS = 2000
LABELS = {
    "density_ratio": "rho {:g}", "viscosity_ratio": "mu {:g}", "resolution": "R/dx {}", "noise": "noise {:g}",
    "precision": "{}", "smoothing_ratio": "h/dx {}",
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Point:
    """Where in the matrix a run is.

    density_ratio, viscosity_ratio: heavy phase over light phase (the heavy one has density 1)
    resolution: R over particle spacing
    noise: displacement of the start in particle spacings
    precision: float32 or float64
    smoothing_ratio: h over particle spacing, or auto
    """

    density_ratio: float = 1000.0
    viscosity_ratio: float = 100.0
    resolution: int = 10
    noise: float = 0.0
    precision: str = "float32"
    smoothing_ratio: float | str = "auto"


@dataclasses.dataclass(frozen=True)
class Scene:
    """A scene, with what its numbers are measured against.

    case: point -> case as plain data
    speed: point -> speed that its forces can give each phase, the heavy one and the light one first [m/s]
    speed_limit: largest share of it
    energy: point -> energy that is at play [J/m]
    drift: speed that the mean velocity is compared with [m/s]; None where walls take momentum
    """

    case: Callable[[Point], dict[str, Any]]
    speed: Callable[[Point], tuple[float, ...]]
    speed_limit: float
    energy: Callable[[Point], float]
    drift: float | None


# ---- scenes ----------------------------------------------------------------------------------------------


def common(point: Point, viscosity: float, boundary: str) -> dict[str, Any]:
    """What all scenes share; `viscosity` is that of the heavy phase [Pa s]."""
    numerics = {} if point.smoothing_ratio == "auto" else {"smoothing_ratio": point.smoothing_ratio}
    return {
        "dimension": 2,
        "particle_spacing": RADIUS / point.resolution,
        "end_time": 1.0e9,  # runs are counted in steps
        "precision": point.precision,
        "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": boundary, "y": boundary}},
        "phases": {
            "heavy": {"density": 1.0, "viscosity": viscosity},
            "light": {"density": 1.0 / point.density_ratio, "viscosity": viscosity / point.viscosity_ratio},
        },
        "start": {"noise": point.noise} if point.noise else {},
        "numerics": numerics,
        "output": {"particles": "none", "checkpoint": "none"},
    }


def disc(inside: str, outside: str, center: list[float]) -> list[dict[str, Any]]:
    """Fluids: a disc of the radius RADIUS in the rest."""
    return [
        {"phase": inside, "shape": {"sphere": {"center": center, "radius": RADIUS}}},
        {"phase": outside, "shape": "rest"},
    ]


def tension(coefficient: float) -> list[dict[str, Any]]:
    return [{"between": ["heavy", "light"], "coefficient": coefficient}]


def capillary(coefficient: float, point: Point) -> tuple[float, float]:
    """Speeds that a Laplace jump can give the heavy and the light phase, sqrt(sigma/(rho R)) [m/s]."""
    heavy = math.sqrt(coefficient / RADIUS)
    return heavy, heavy * math.sqrt(point.density_ratio)


def drop(point: Point) -> dict[str, Any]:
    """Static drop of the heavy phase, sigma = 1, Ohnesorge number mu/sqrt(rho sigma 2R) = 0.1 of the heavy phase."""
    case = common(point, 0.1 * math.sqrt(2 * RADIUS), "periodic")
    return {**case, "surface_tension": tension(1.0), "fluids": disc("heavy", "light", [0.5, 0.5])}


def tank(point: Point) -> dict[str, Any]:
    """Two layers at rest, g = H = 1, Reynolds number H sqrt(gH)/nu = 100 of the heavy phase."""
    lower = {"box": {"lower": [0, 0], "upper": [1, 0.5]}}
    case = common(point, 0.01, "wall")
    case["start"]["pressure"] = "hydrostatic"
    return {
        **case,
        "gravity": [0, -1.0],
        "fluids": [{"phase": "heavy", "shape": lower}, {"phase": "light", "shape": "rest"}],
    }


def stirred(point: Point) -> dict[str, Any]:
    """Drop of the heavy phase between Taylor-Green vortices of speed 1, where it is torn most.

    Weber number rho U^2 2R/sigma = 1, Reynolds number U L/nu = 100 of the heavy phase.
    """
    case = common(point, 0.01, "periodic")
    case["start"]["velocity"] = ["-cos(2*pi*x)*sin(2*pi*y)", "sin(2*pi*x)*cos(2*pi*y)"]
    return {**case, "surface_tension": tension(2 * RADIUS), "fluids": disc("heavy", "light", [0.5, 0.25])}


BUBBLE_TENSION = 0.1 * (2 * RADIUS) ** 2
BUBBLE_HEIGHT = 0.375  # in the middle of cells or on their border, so that the lattice cuts a symmetric disc


def bubble(point: Point) -> dict[str, Any]:
    """Bubble of the light phase, g = 1: Bond number rho g (2R)^2/sigma = 10, Re = sqrt(g 2R) 2R/nu = 35 of the heavy phase.

    The start pressure is that of the first acceleration of a cylinder in an ideal fluid at rest: weight, dipole and
    Laplace jump.
    """
    case = common(point, (2 * RADIUS) ** 1.5 / 35, "wall")
    share = (point.density_ratio - 1) / (point.density_ratio + 1)
    square = f"((x - 0.5)**2 + (y - {BUBBLE_HEIGHT})**2)"
    dipole = f"{share}*(y - {BUBBLE_HEIGHT})*minimum(1, {RADIUS**2}/{square})"
    jump = f"where({square} < {RADIUS**2}, {BUBBLE_TENSION / RADIUS}, 0)"
    case["start"]["pressure"] = f"1 - y + {dipole} + {jump}"
    return {
        **case,
        "gravity": [0, -1.0],
        "surface_tension": tension(BUBBLE_TENSION),
        "fluids": disc("light", "heavy", [0.5, BUBBLE_HEIGHT]),
    }


def layers(point: Point, viscosity: float) -> dict[str, Any]:
    """Periodic along x with a floor and a ceiling; the rest as in `common`."""
    case = common(point, viscosity, "wall")
    case["domain"]["boundary"]["x"] = "periodic"
    return case


def wave(point: Point) -> dict[str, Any]:
    """Capillary wave of the height 0.05 on the heavy phase, sigma = wavelength = 1, mu/sqrt(rho sigma 2R) = 0.01 of it."""
    shape = {"where": {"condition": "y < 0.5 + 0.05*cos(2*pi*x)"}}
    case = layers(point, 0.01 * math.sqrt(2 * RADIUS))
    return {
        **case,
        "surface_tension": tension(1.0),
        "fluids": [{"phase": "heavy", "shape": shape}, {"phase": "light", "shape": "rest"}],
    }


LENS_TENSIONS = {("heavy", "light"): 1.0, ("heavy", "oil"): 0.8, ("light", "oil"): 0.6}


def lens(point: Point) -> dict[str, Any]:
    """Disc of oil, as dense and viscous as the heavy phase, half in it and half in the light one: it becomes a lens.

    The largest tension is 1, mu/sqrt(rho sigma 2R) = 0.1 of the heavy phase.
    """
    case = layers(point, 0.1 * math.sqrt(2 * RADIUS))
    case["phases"]["oil"] = dict(case["phases"]["heavy"])
    below = {"where": {"condition": f"y < 0.5 and (x - 0.5)**2 + (y - 0.5)**2 > {RADIUS**2}"}}
    return {
        **case,
        "surface_tension": [{"between": list(pair), "coefficient": value} for pair, value in LENS_TENSIONS.items()],
        "fluids": [{"phase": "heavy", "shape": below}, *disc("oil", "light", [0.5, 0.5])],
    }


IMPACT_TENSION = 2 * RADIUS / 80
IMPACT_HEIGHT = 0.375  # of the middle: half a radius above the floor


def impact(point: Point) -> dict[str, Any]:
    """Drop of the heavy phase that hits the floor at the speed 1.

    Weber number rho U^2 2R/sigma = 80, Reynolds number U 2R/nu = 500 of the heavy phase.
    """
    case = common(point, 2 * RADIUS / 500, "wall")
    square = f"(x - 0.5)**2 + (y - {IMPACT_HEIGHT})**2"
    case["start"]["velocity"] = ["0", f"where({square} < {RADIUS**2}, -1, 0)"]
    return {
        **case,
        "surface_tension": tension(IMPACT_TENSION),
        "fluids": disc("heavy", "light", [0.5, IMPACT_HEIGHT]),
    }


def plus(speed: float, more: tuple[float, float]) -> tuple[float, float]:
    return speed + more[0], speed + more[1]


PERIMETER = 2 * math.pi * RADIUS
AREA = math.pi * RADIUS**2
SCENES = {
    # at rest: half of what the whole Laplace jump would give, a fifth of free fall
    "drop": Scene(drop, lambda point: capillary(1.0, point), 0.5, lambda point: PERIMETER, math.sqrt(1.0 / RADIUS)),
    "tank": Scene(tank, lambda point: (1.0, 1.0), 0.2, lambda point: 0.125, None),
    # kinetic energy of the vortices, 1/4 of the density, where the heavy drop is, and of the light rest
    "stirred": Scene(
        stirred,
        lambda point: plus(1.0, capillary(2 * RADIUS, point)),
        2.0,
        lambda point: 0.25 * (AREA + (1 - AREA) / point.density_ratio) + 2 * RADIUS * PERIMETER,
        1.0,
    ),
    # what lifting the bubble's volume of heavy fluid to the top takes, and its surface
    "bubble": Scene(
        bubble,
        lambda point: plus(math.sqrt(2 * RADIUS), capillary(BUBBLE_TENSION, point)),
        2.0,
        lambda point: AREA * (1 - RADIUS - BUBBLE_HEIGHT) + BUBBLE_TENSION * PERIMETER,
        None,
    ),
    # at rest and in small waves half of what the whole Laplace jump would give, as for the drop
    "wave": Scene(wave, lambda point: capillary(1.0, point), 0.5, lambda point: 1.0, None),
    "lens": Scene(
        lens,
        lambda point: (*capillary(1.0, point), capillary(1.0, point)[0]),
        0.5,
        lambda point: 1 - 2 * RADIUS + 0.7 * PERIMETER,
        None,
    ),
    # The edge of the wetted floor runs at U sqrt(R/(U t)) after the touch, and the sheet that it throws out at twice that
    # (Wagner 1932): the fastest that a spacing resolves is at U t = dx. The light phase leaves a film of one spacing.
    "impact": Scene(
        impact,
        lambda point: (math.sqrt(point.resolution), point.resolution + capillary(IMPACT_TENSION, point)[1]),
        2.0,
        lambda point: 0.5 * AREA + IMPACT_TENSION * PERIMETER,
        None,
    ),
}


# ---- which points ----------------------------------------------------------------------------------------


def axes_for(gpu: bool, quick: bool) -> dict[str, tuple[Any, ...]]:
    """The values of each axis."""
    axes = {name: QUICK.get(name, values) if quick else values for name, values in AXES.items()}
    if not gpu:
        axes = {name: tuple(v for v in values if v not in GPU_ALONE.get(name, ())) for name, values in axes.items()}
    return axes


def base_point(quick: bool) -> Point:
    return Point(resolution=6) if quick else Point()


def differences(point: Point, base: Point) -> str:
    """What of a point is not as at the base, as text."""
    changed = [name for name in LABELS if getattr(point, name) != getattr(base, name)]
    return ", ".join(LABELS[name].format(getattr(point, name)) for name in changed) or "base"


def one_at_a_time(base: Point, axes: dict[str, tuple[Any, ...]], automatic: float) -> list[Point]:
    """The base, and the base with one axis changed; what `auto` comes to (`automatic`) is not run twice."""
    points = [base]
    for name, values in axes.items():
        for value in values:
            if value != getattr(base, name) and not (name == "smoothing_ratio" and value == automatic):
                points.append(dataclasses.replace(base, **{name: value}))
    return points


def random_points(count: int, seed: int, axes: dict[str, tuple[Any, ...]], scene: str) -> list[Point]:
    """Points with every axis drawn; the same for the same seed and scene, whatever else is run."""
    draw = random.Random(f"{seed} {scene}")
    return [Point(**{name: draw.choice(values) for name, values in axes.items()}) for _ in range(count)]


def parse_point(settings: Iterable[str], base: Point) -> Point:
    """The base with `KEY=VALUE` settings; raises ValueError."""
    changes: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if name not in AXES or not equals:
            raise ValueError(f"--point: {setting} is not KEY=VALUE with a key of {', '.join(AXES)}")
        like = getattr(base, name)
        if isinstance(like, str) and name != "smoothing_ratio":
            if text not in AXES[name]:
                raise ValueError(f"--point: {name} is one of {', '.join(AXES[name])}, not {text}")
            changes[name] = text
        elif text == "auto" and name == "smoothing_ratio":
            changes[name] = text
        else:
            try:
                changes[name] = int(text) if isinstance(like, int) else float(text)
            except ValueError:
                raise ValueError(f"--point: {name} needs a number, not {text}") from None
    return dataclasses.replace(base, **changes)


# ---- one run ---------------------------------------------------------------------------------------------


def sample(model: Any, energy_of: Any, contour_of: Any) -> dict[str, Any]:
    """Numbers of one moment: largest speed of each phase, energy, momentum, strays, whether all is finite."""
    from warpsph.measure.shape_gauges import isolated

    everything = model.snapshot()
    snapshot = everything.fluid
    finite = all(np.isfinite(a).all() for a in (snapshot.position, snapshot.velocity, snapshot.density))
    if not finite:
        return {"finite": False, "time": snapshot.time, "step": snapshot.step}
    speed = np.linalg.norm(snapshot.velocity, axis=1)
    domain, tensions = model.case.domain, model.case.surface_tension
    strays = 0
    for phase in range(len(model.case.phases)):
        strays += int(
            isolated(
                snapshot.position[snapshot.phase == phase],
                STRAY_REACH * snapshot.particle_spacing,
                STRAY_COMPANY,
                np.array(domain.lower),
                np.array(domain.upper),
                model.case.periodic,
            ).sum()
        )
    energies = measure(energy_of, snapshot)
    surface = surface_energy(tensions, measure(contour_of, everything)) if tensions else 0.0
    mass = np.asarray(snapshot.mass, np.float64)
    return {
        "finite": True,
        "time": snapshot.time,
        "step": snapshot.step,
        "speed": [
            float(speed[snapshot.phase == phase].max(initial=0.0)) for phase in range(len(model.case.phases))
        ],
        "energy": {name: energies[name] for name in ("kinetic", "potential", "elastic")} | {"surface": surface},
        "mean_velocity": (mass @ np.asarray(snapshot.velocity, np.float64) / mass.sum()).tolist(),
        "strays": strays,
    }


def surface_energy(tensions: Any, lines: dict[str, float]) -> float:
    """Tension times length of all interfaces, from the perimeters of the phases [J/m].

    Of three phases with the pairs ij, jk and ki the perimeter of i is L_ij + L_ki, so that
    sum over pairs of sigma_ij L_ij = sum over phases of (sigma_ij + sigma_ki - sigma_jk)/2 times perimeter of i.
    """
    if len(tensions) == 1:
        return float(tensions[0].coefficient * lines["perimeter heavy"])
    every = sum(pair.coefficient for pair in tensions)
    energy = 0.0
    for name in {name for pair in tensions for name in pair.between}:
        own = sum(pair.coefficient for pair in tensions if name in pair.between)
        energy += (own - 0.5 * every) * lines[f"perimeter {name}"]
    return energy


def measure(gauge: Any, snapshot: Any) -> dict[str, float]:
    """What a gauge measures, by column."""
    return dict(zip((column.name for column in gauge.columns), gauge.row(snapshot), strict=True))


def total(moment: dict[str, Any]) -> float:
    """Total energy of a sample [J/m]."""
    return float(sum(moment["energy"].values()))


def judge(scene: Scene, point: Point, samples: list[dict[str, Any]], fault: str) -> dict[str, dict[str, Any]]:
    """The criteria: name -> value, limit (None: not judged), ok. After a fault the others are of the last good state."""
    good = [moment for moment in samples if moment["finite"]]
    if not good:  # not even a start
        return {name: {"value": None, "limit": None, "ok": False} for name in CRITERIA}
    start, end = good[0], good[-1]
    scale = scene.speed(point)
    speed = max(value / scale[phase] for moment in good for phase, value in enumerate(moment["speed"]))
    drift = None
    if scene.drift is not None:
        change = np.subtract(end["mean_velocity"], start["mean_velocity"])
        drift = float(np.linalg.norm(change)) / scene.drift
    survives = not fault and len(good) == len(samples)
    values: dict[str, tuple[Any, float | None]] = {
        "speed": (speed, scene.speed_limit),
        "energy": ((total(end) - total(start)) / scene.energy(point), ENERGY_LIMIT),
        "strays": (end["strays"], start["strays"]),
        "drift": (drift, None if drift is None else DRIFT_LIMIT),
    }
    result: dict[str, dict[str, Any]] = {"survives": {"value": survives, "limit": True, "ok": survives}}
    for name, (value, limit) in values.items():
        # nan is within no limit
        result[name] = {"value": value, "limit": limit, "ok": limit is None or bool(value <= limit)}
    return result


def run(scene_name: str, point: Point, steps: int, device: str, threads: int | None) -> dict[str, Any]:
    """Run a point of a scene and return its row."""
    from warpsph.case.case import Case
    from warpsph.case.gauge_models import as_gauge
    from warpsph.errors import WarpsphError
    from warpsph.kernels.core import clock as ck
    from warpsph.measure.phase_gauges import EnergyGauge
    from warpsph.measure.shape_gauges import ContourGauge
    from warpsph.measure.totals import PhaseEos
    from warpsph.running.model import Model

    scene = SCENES[scene_name]
    data = scene.case(point)
    begin = time.perf_counter()
    case = Case.from_dict(data)
    model = Model(case, device=device, threads=threads)
    eos = {
        name: PhaseEos(phase.density, c, phase.gamma, phase.background_pressure)
        for (name, phase), c in zip(case.phases.items(), model.physics.sound_speed, strict=True)
    }
    sections = [as_gauge({"type": name, "interval": case.end_time}) for name in ("energy", "contour")]
    gauges = EnergyGauge("energy", sections[0], case, eos), ContourGauge("contour", sections[1], case)
    stepper = model.stepper
    fault = ""
    samples: list[dict[str, Any]] = []
    setup = seconds = 0.0
    try:
        stepper.prepare(fresh=True)
        samples.append(sample(model, *gauges))
        setup = time.perf_counter() - begin
        for number in range(SAMPLES):
            portion = (number + 1) * steps // SAMPLES - number * steps // SAMPLES
            since = time.perf_counter()
            stepper.run(case.end_time, portion)
            _, counters = stepper.read()
            seconds += time.perf_counter() - since
            if counters[ck.FAULT]:
                fault = random_scenes.describe_fault(model, int(counters[ck.FAULT_PARTICLE]))
                break
            samples.append(sample(model, *gauges))
            if not samples[-1]["finite"]:
                fault = f"not finite at step {samples[-1]['step']}"
                break
    except WarpsphError as error:
        fault = str(error)
    done = model.steps
    return {
        "scene": scene_name,
        "point": dataclasses.asdict(point),
        "criteria": judge(scene, point, samples, fault),
        "fault": fault,
        "steps": done,
        "time": model.time,
        "scene_times": model.time * max(scene.speed(point)[0], 1e-300) / RADIUS,
        "particles": model.particles.count,
        "sound_speed": list(model.physics.sound_speed),
        "setup_seconds": setup,
        "seconds": seconds,
        "mups": model.particles.count * done / max(seconds, 1e-9) / 1e6,
        "samples": samples,
        "case": data,
    }


def run_all(
    run: Callable[..., Any], jobs: list[tuple[Any, ...]], processes: int, ordered: bool = True
) -> Iterator[dict[str, Any]]:
    """Yield the rows of `run(*job)` from that many processes at a time, in the order of the jobs or as they are done."""
    if processes == 1:
        for job in jobs:
            yield run(*job)
        return
    # Warp does not survive a fork
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn"), initializer=quiet) as pool:
        futures = [pool.submit(run, *job) for job in jobs]
        for future in futures if ordered else as_completed(futures):
            yield future.result()


def quiet() -> None:
    """Settings of a process."""
    from warpsph.running.model import quiet_warp

    np.seterr(all="ignore")
    quiet_warp()


# ---- output ----------------------------------------------------------------------------------------------

HEAD = (
    f"{'scene':8} {'point':44} {'speed':>8} {'energy %':>9} {'strays':>7} {'drift':>9} "
    f"{'times':>7} {'steps':>7} {'seconds':>8}  verdict"
)


def line(row: dict[str, Any], change: str) -> str:
    """The row of the table; what misses its limit has a ! before it."""
    criteria = row["criteria"]

    def cell(name: str, form: str, factor: float = 1) -> str:
        value = criteria[name]["value"]
        text = "-" if value is None else format(factor * value, form)
        return text if criteria[name]["ok"] else f"!{text}"

    cells = [
        f"{cell('speed', '.3g'):>8} {cell('energy', '.3g', 100):>9} {cell('strays', 'd'):>7} {cell('drift', '.2e'):>9}",
        f"{row['scene_times']:7.3g} {row['steps']:7d} {row['seconds']:8.1f}",
    ]
    missed = [name for name, entry in criteria.items() if not entry["ok"]]
    verdict = "ok" if not missed else f"FAULT: {row['fault']}" if "survives" in missed else "missed " + ", ".join(missed)
    return f"{row['scene']:8} {change:44} " + " ".join(cells) + f"  {verdict}"


def plain(value: Any) -> Any:
    """`value` for JSON, which has no nan and no infinity."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def run_scenes(chosen: argparse.Namespace) -> int:
    """Run random scenes, seeds `--seed` and following, print their table and return the exit code."""
    changes = dict(text.split("=", 1) for text in chosen.set)
    jobs = []
    for number, seed in enumerate(range(chosen.seed, chosen.seed + chosen.scenes)):
        device = "cuda:0" if chosen.gpu_share and number % chosen.gpu_share == 0 else chosen.device
        steps = chosen.steps or SCENE_STEPS[random_scenes.scene(seed)["dimension"]]
        jobs.append((seed, steps, device, chosen.threads, changes))
    print(random_scenes.HEAD)
    rows, failed = [], 0
    begin = time.perf_counter()
    for row in run_all(random_scenes.run, jobs, chosen.processes, ordered=False):
        rows.append(row)
        failed += not all(entry["ok"] for entry in row["criteria"].values())
        print(random_scenes.line(row), flush=True)
    rows.sort(key=lambda row: row["seed"])
    missed = {name: sum(not row["criteria"][name]["ok"] for row in rows) for name in random_scenes.CRITERIA}
    counts = ", ".join(f"{name} {count}" for name, count in missed.items())
    print(f"{len(rows)} scenes, {failed} missed a limit ({counts}), {time.perf_counter() - begin:.0f} s")
    if chosen.json:
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        head = {key: getattr(chosen, key) for key in ("device", "gpu_share", "scenes", "seed")}
        head |= {"command": "python " + " ".join(sys.argv), "steps": chosen.steps or SCENE_STEPS, "missed": missed}
        chosen.json.write_text(json.dumps(plain({**provenance(), **head, "rows": rows}), indent=1))
    return 1 if failed else 0


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="24 particles across instead of 40")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--processes", type=int, default=1, metavar="N", help="runs at the same time (default: 1)")
    parser.add_argument("--only", nargs="+", default=list(SCENES), choices=list(SCENES), metavar="SCENE")
    parser.add_argument("--steps", type=int, help=f"steps of each run (default: {STEPS})")
    parser.add_argument("--random", type=int, default=4, metavar="N", help="random points of each scene (default: 4)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--point", nargs="+", metavar="KEY=VALUE", help="run this point alone")
    parser.add_argument("--scenes", type=int, metavar="N", help="random scenes instead, see random_scenes.py (`--seed S`)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change random scenes, for a look")
    parser.add_argument("--gpu-share", type=int, default=0, metavar="K", help="every K-th random scene on cuda:0")
    parser.add_argument("--json", type=Path, help="write the rows to a file")
    chosen = parser.parse_args(arguments)
    if chosen.steps is not None and chosen.steps < 1:
        parser.error("--steps: needs at least 1")
    if chosen.processes < 1:
        parser.error("--processes: needs at least 1")
    if chosen.scenes is not None:
        return run_scenes(chosen)
    steps = chosen.steps or STEPS

    from warpsph.case.case import Case
    from warpsph.running.model import quiet_warp
    from warpsph.scene.physics import smoothing_ratio

    quiet_warp()
    base = base_point(chosen.quick)
    axes = axes_for(chosen.device.startswith("cuda"), chosen.quick)
    automatic = smoothing_ratio(Case.from_dict(SCENES[chosen.only[0]].case(base)))
    try:
        single = None if chosen.point is None else parse_point(chosen.point, base)
    except ValueError as error:
        parser.error(str(error))
    print(HEAD)
    rows, failed = [], 0
    begin = time.perf_counter()
    jobs = []
    for name in chosen.only:
        points = [single]
        if single is None:
            points = one_at_a_time(base, axes, automatic) + random_points(chosen.random, chosen.seed, axes, name)
        jobs += [(name, point, steps, chosen.device, chosen.threads) for point in points]
    for (_, point, *_), row in zip(jobs, run_all(run, jobs, chosen.processes), strict=True):
        rows.append(row)
        failed += not all(entry["ok"] for entry in row["criteria"].values())
        print(line(row, differences(point, base)), flush=True)
    missed = {name: sum(not row["criteria"][name]["ok"] for row in rows) for name in CRITERIA}
    print(
        f"{len(rows)} runs, {failed} missed a limit ("
        + ", ".join(f"{name} {count}" for name, count in missed.items())
        + f"), {time.perf_counter() - begin:.0f} s"
    )
    if chosen.json:
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        head = {"device": chosen.device, "threads": chosen.threads, "steps": steps, "seed": chosen.seed, "missed": missed}
        chosen.json.write_text(json.dumps(plain({**provenance(), **head, "rows": rows}), indent=1))
    return 1 if failed else 0


if __name__ == "__main__":
    np.seterr(all="ignore")
    sys.exit(main())
