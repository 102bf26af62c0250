"""Inlets and outlets measured: what comes back of a pulse, what a developed channel flow keeps, a uniform flow for long.

    python scripts/open_boundaries.py pulse      # share of a pressure pulse that comes back, by rate of relaxation and width
    python scripts/open_boundaries.py channel    # Poiseuille flow: errors by spacing, velocity or pressure given
    python scripts/open_boundaries.py uniform    # a disturbed uniform flow for 100 lengths of the domain
    python scripts/open_boundaries.py cylinder   # forces on a cylinder in a channel, Schaefer and Turek 1996, 2D-1

All take --scheme delta_plus; channel and uniform take --scheme isph, where there is no sound.
"""

import argparse
from typing import Any

import numpy as np

from warpsph.case.case import Case
from warpsph.running.model import Model

SOUND = 10.0


def through(spacing: float, upper: list[float], inlet: dict[str, Any], outlet: dict[str, Any], **more: Any) -> Case:
    """A case with an inlet at the lower and an outlet at the upper side of x."""
    sides = {"lower": {"inlet": inlet}, "upper": {"outlet": outlet}}
    data: dict[str, Any] = {
        "dimension": 2,
        "particle_spacing": spacing,
        "end_time": 1000.0,
        "domain": {"lower": [0, 0], "upper": upper, "boundary": {"x": sides, "y": "periodic"}},
        "phases": {"water": {"density": 1.0, "sound_speed": SOUND}},
        "fluids": [{"phase": "water", "shape": "rest"}],
    }
    return Case.from_dict(data).replace(more)


def by(scheme: str, case: Case) -> Case:
    """The same by another scheme; ISPH, which has no sound, lets none leave."""
    if scheme != "isph":
        return case.replace({"numerics.scheme": scheme})
    outlet = {"outlet": {"pressure": 0}}
    changes = {"numerics.scheme": "isph", "phases.water.sound_speed": "auto", "domain.boundary.x.upper": outlet}
    return case.replace(changes)


def made(case: Case, threads: int) -> Model:
    """A run, its list built."""
    model = Model(case, threads=threads)
    model.stepper.prepare(fresh=True)
    return model


def at(model: Model, time: float) -> Any:
    """The fluid at a time [s]."""
    model.stepper.run(time, 10**9)
    if model.stepper.read()[1][3]:
        raise SystemExit("the run diverged")
    return model.snapshot().fluid


def came_back(spacing: float, width: float, outlet: dict[str, Any], threads: int, scheme: str) -> float:
    """Share of a pulse exp(-x^2/w^2) that comes back from the outlet: against the same in a domain that is longer by 8 m."""
    height, length, mean = 0.5, 4.0, 0.5
    found = []
    for upper in (length, length + 8.0):
        shape = f"exp(-((x - 2)/{width})**2)"
        start = {"start.pressure": f"{height}*{shape}", "start.velocity": [f"{mean} + {height / SOUND}*{shape}", 0]}
        case = through(spacing, [upper, 12 * spacing], {"velocity": [mean, 0], "waves": "leave"}, outlet, **start)
        model, states = made(by(scheme, case), threads), []
        for time in (0.3, 0.35, 0.4):
            fluid = at(model, time)
            inside = fluid.position[:, 0] < length
            bins = (fluid.position[inside, 0] / 0.1).astype(int)
            states.append(np.bincount(bins, fluid.pressure[inside], 41)[:40] / np.bincount(bins, minlength=41)[:40])
        found.append(np.array(states))
    return float(np.nanmax(np.abs(found[0] - found[1])) / height)


def pulse(threads: int, scheme: str) -> None:
    """Print the table of pulses."""
    print("width/spacing  width/length  waves    relaxation  comes back  sqrt(pi) sigma w/L")
    for spacing, width in ((0.1, 0.5), (0.05, 0.5), (0.025, 0.5), (0.05, 0.25), (0.025, 0.25)):
        for waves, sigma in (*(("leave", sigma) for sigma in (1e-9, 0.08, 0.1, 0.25, 1.0)), ("reflect", 0.1)):
            share = came_back(spacing, width, {"waves": waves, "relaxation": sigma}, threads, scheme)
            expected = np.sqrt(np.pi) * sigma * width / 4.0 if waves == "leave" else 1.0
            row = f"{width / spacing:13.0f}  {width / 4.0:12.3f}  {waves:7s}  {sigma:10.2g}  {share:10.4f}  {expected:.4f}"
            print(row, flush=True)


def channel(threads: int, scheme: str) -> None:
    """Print the table of developed channel flows, Re = 20 and 100 of mean speed and height, from the exact flow on."""
    parabola = "6*y*(1 - y)"
    print("Re   given     spacings  l2 of u/peak  largest    flow in   mean pressure gradient over the exact one")
    for reynolds in (20, 100):
        drop = 12.0 / reynolds * 3.0
        for given, inlet in (("velocity", {"velocity": [parabola, 0]}), ("pressure", {"pressure": drop})):
            for cells in (10, 20, 40):
                water = {"density": 1.0, "viscosity": 1.0 / reynolds, "gamma": 1, "sound_speed": 15.0}
                more = {"domain.boundary.y": "wall", "start.velocity": [parabola, 0], "phases.water": water}
                outlet = {"waves": "leave" if given == "velocity" else "reflect"}
                case = through(1 / cells, [3.0, 1.0], inlet, outlet, **more)
                model, rows = made(by(scheme, case), threads), []
                for time in np.arange(6.0, 10.01, 0.5):
                    fluid = at(model, time)
                    x, y = fluid.position.T
                    error = (fluid.velocity[:, 0] - 6 * y * (1 - y)) / 1.5
                    slope = np.polyfit(x, fluid.pressure, 1)[0] / (-12.0 / reynolds)
                    rows.append((np.sqrt((error**2).mean()), np.abs(error).max(), model.flow_rates()["flow x_lower"], slope))
                mean = np.mean(rows, axis=0)
                errors = f"{mean[0]:12.4f}  {mean[1]:8.4f}  {mean[2]:8.4f}  {mean[3]:8.4f}"
                print(f"{reynolds:3d}  {given:8s}  {cells:8d}  {errors}", flush=True)


def uniform(threads: int, scheme: str) -> None:
    """Print what is left of a disturbance of a uniform flow, in units of U and rho U^2, for 100 lengths of the domain."""
    height = 1.0 if scheme == "delta_plus" else 0.8  # its smoothing length needs a longer period
    start = {"start.velocity": [f"1 + 0.1*sin(2*pi*y/{height})", 0], "start.noise": 0.1}
    model = made(by(scheme, through(0.1, [1.0, height], {"velocity": [1, 0]}, {}, **start)), threads)
    count = model.fluid_count
    for time in (0.5, 1.0, 2.0, 5.0, 20.0, 100.0):
        fluid = at(model, time)
        speed = np.abs(fluid.velocity - [1.0, 0.0]).max()
        pressure = np.abs(fluid.pressure).max()
        print(f"t U/L = {time:5.0f}: u {speed:.1e}, p {pressure:.1e}, particles {len(fluid)} of {count}", flush=True)


def pressure_before(model: Model, point: tuple[float, float]) -> float:
    """Pressure at the surface particle whose foot is nearest to a point, as the last measurement of forces has it [Pa]."""
    fields = model.particles
    normal, depth, area = (fields.get(name) for name in ("wall_normal", "wall_depth", "wall_area"))
    foot = fields.get("position")[-len(depth) :] + depth[:, None] * normal
    way = np.where(area > 0, np.linalg.norm(foot - np.array(point), axis=1), np.inf)
    return float(fields.get("surface_pressure")[way.argmin()])


def cylinder(threads: int, scheme: str) -> None:
    """Print drag, lift and difference of pressure of the benchmark 2D-1 of Schaefer and Turek, Re = 20; theirs in the head.

    The channel ends 11 diameters behind the cylinder instead of 20. Means over the last of 7 s, and the rms of what sound
    does to them; the flow starts from rest within 2 s.
    """
    height, diameter, mean = 0.41, 0.1, 0.2
    parabola = f"6*{mean}*y*({height} - y)/{height}**2"
    scale = 2.0 / (mean**2 * diameter)
    print("spacings a diameter  Cd (5.5795)        Cl (0.0106)        dp (0.1175 Pa)")
    for rows in (31, 41, 62, 82):
        more = {
            "domain.boundary.y": "wall",
            "phases.water": {"density": 1.0, "viscosity": 1e-3, "gamma": 1},
            "scales": {"velocity": 2.0 * mean, "length": diameter},
            "bodies": {"cylinder": {"shape": {"sphere": {"center": [0.2, 0.2], "radius": 0.5 * diameter}}}},
        }
        inlet = {"velocity": [parabola, 0], "ramp": "0.5*(1 - cos(pi*minimum(t/2, 1)))"}
        model, found = made(by(scheme, through(height / rows, [1.3, height], inlet, {}, **more)), threads), []
        for time in np.arange(6.0, 7.0, 0.01):
            at(model, time)
            force = model.wall_forces()
            drop = pressure_before(model, (0.15, 0.2)) - pressure_before(model, (0.25, 0.2))
            found.append((force["wall_force_x cylinder"] * scale, force["wall_force_y cylinder"] * scale, drop))
        columns = [f"{np.mean(c):8.4f} ({np.std(c):.4f})" for c in np.array(found).T]
        print(f"{diameter * rows / height:19.1f}  {'  '.join(columns)}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["pulse", "channel", "uniform", "cylinder"])
    parser.add_argument("--scheme", choices=["riemann", "delta_plus", "isph"], default="riemann")
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args()
    if given.scheme == "isph" and given.what in ("pulse", "cylinder"):
        parser.error(f"{given.what} needs a scheme with sound, riemann or delta_plus")
    measure = {"channel": channel, "uniform": uniform, "pulse": pulse, "cylinder": cylinder}[given.what]
    measure(given.threads, given.scheme)
