r"""Linear waves of a flat interface between two fluids: the exact dispersion relation, and that of the program.

    python scripts/dispersion.py --density 1 --viscosity 0.1265

prints, for waves of 48 spacings and less, the exact rate s of e^{ikx + st}, that of the program's wave, and the fastest
growth of all modes of this length (docs/records/tension.md). Exactly, nothing grows. The spacing and the lighter density
are 1, and the tension by default.

The program's rates are eigenvalues of one time step, linearised about rest on the lattice: each row of particles is
displaced, set in motion, or compressed at one place, in double precision, and what a step makes of that is summed over the
columns with the phase of the wave. All modes are there, not just the fastest, and no run has to be waited for.

    python scripts/dispersion.py --density 1000 --viscosity 0.003 --columns 32 --rows 44 --fields
    python scripts/dispersion.py --density 1.2 --viscosity 0.003 --columns 32 --rows 44 --gravity 0.05 --tension 1e-3 \
        --step 0.02

--fields prints, row by row, what the sweeps make of the exact wave of ideal fluids: the acceleration along and across over
the exact one, and the divergence, which should be zero, over k times the velocity across. So an error of the rate is traced
to a row, a fluid and a sweep. --gravity adds internal waves; the step has to be shorter, as fluids that weigh are stiffer.
"""

import argparse
from typing import Any

import numpy as np

EPSILON = 1e-6  # of a displacement, speed and density excess: differences are good to 1e-10


def boundary_conditions(s: complex, k: float, density: tuple, viscosity: tuple, sigma: float) -> np.ndarray:
    """Return the conditions at y = 0, (4, 4), on v = A e^{ky} + B e^{q1 y} below and C e^{-ky} + D e^{-q2 y} above.

    All fields go with e^{ikx + st}, q^2 = k^2 + s/nu. Rows: v, u and shear stress continuous; normal stress against tension.
    """
    (r1, r2), (m1, m2) = density, viscosity
    q1, q2 = np.sqrt(k * k + s * r1 / m1 + 0j), np.sqrt(k * k + s * r2 / m2 + 0j)
    pull = sigma * k * k / s
    return np.array(
        [
            [1, 1, -1, -1],
            [k, q1, k, q2],
            [2 * m1 * k * k, m1 * (q1 * q1 + k * k), -2 * m2 * k * k, -m2 * (q2 * q2 + k * k)],
            [-r1 * s / k - 2 * m1 * k - pull, -2 * m1 * q1 - pull, -r2 * s / k - 2 * m2 * k, -2 * m2 * q2],
        ]
    )


def exact_rate(k: float, density: tuple, viscosity: tuple, sigma: float) -> complex:
    """Return s [1/s] of the wave number k [1/m]: minus the damping, plus i times the frequency.

    Args:
        k: wave number [1/m].
        density: of both fluids [kg/m^3].
        viscosity: dynamic, of both fluids [Pa s], above 0.
        sigma: tension [N/m].

    Raises:
        ValueError: if the wave is so damped that it does not swing.
    """
    s = 1j * np.sqrt(sigma * k**3 / sum(density))
    for part in np.geomspace(1e-4, 1.0, 60):  # the root is followed from the wave without friction
        friction = (part * viscosity[0], part * viscosity[1])

        def residual(z: complex, friction: tuple = friction) -> complex:
            return complex(np.linalg.det(boundary_conditions(z, k, density, friction, sigma)))

        with np.errstate(all="ignore"):  # without a root to follow the secants may end anywhere, nowhere included
            last, value = s * (1 + 1e-4), residual(s * (1 + 1e-4))
            for _ in range(60):
                new = residual(s)
                if new == value or abs(s - last) < 1e-13 * abs(s):
                    break
                s, last, value = s - new * (s - last) / (new - value), s, new
    if not s.imag >= 1e-6 * abs(s):
        raise ValueError(f"a wave of k = {k} 1/m does not swing at viscosities {viscosity} Pa s")
    return s


def stiffness(k: float, density: tuple, sigma: float, gravity: float) -> float:
    """Return the tension [N/m] that would pull a wave back as tension and weight do together."""
    return sigma + (density[0] - density[1]) * gravity / k**2


def scene(
    columns: int,
    rows: int,
    ratio: float,
    viscosity: tuple[float, float],
    step: float,
    numerics: dict,
    tension: float = 1.0,
    gravity: float = 0.0,
) -> dict[str, Any]:
    """Return the case: `columns` x `rows` particles, the interface in the middle.

    viscosity: kinematic, of the lower and the upper fluid [spacing^2/s].
    """
    # a tenth of the speed and pressure of the shortest wave at an amplitude of a spacing
    scales, start = {"velocity": 0.05, "pressure": 0.05}, {}
    if gravity:
        deep = 0.5 * rows
        scales = {"velocity": 0.1 * np.sqrt(gravity * deep), "pressure": ratio * gravity * deep}
        above = f"{gravity}*({rows} - y)"
        start = {"pressure": f"where(y < {deep}, {gravity * deep} + {ratio * gravity}*({deep} - y), {above})"}
    return {
        "dimension": 2,
        "particle_spacing": 1.0,
        "end_time": 1e9,
        "precision": "float64",
        "domain": {"lower": [0, 0], "upper": [columns, rows], "boundary": {"x": "periodic", "y": "free_slip"}},
        "phases": {
            "lower": {"density": ratio, "viscosity": viscosity[0] * ratio},
            "upper": {"density": 1.0, "viscosity": viscosity[1]},
        },
        "surface_tension": [{"between": ["lower", "upper"], "coefficient": tension}],
        "gravity": [0, -gravity],
        "start": start,
        "fluids": [
            {"phase": "lower", "shape": {"box": {"lower": [0, 0], "upper": [columns, rows / 2]}}},
            {"phase": "upper", "shape": "rest"},
        ],
        "scales": scales,
        "numerics": {"unlock": 0, "maximum_step": step, "acoustic_relaxation": 0, **numerics},
    }


class LinearStep:
    """One time step of the program, linearised about the fluids at rest.

    The state of a particle are five numbers: displacement, velocity (half a step behind), density excess.

    Args:
        ratio: density of the lower fluid over that of the upper.
        viscosity: kinematic, of both or of the lower and the upper fluid [spacing^2/s].
        columns: of particles; more than twice the way that a step carries anything (20 spacings).
        rows: of particles; both fluids are half of it deep.
        step: time step [s].
        tension: [N/m].
        gravity: downwards [spacing/s^2].
        numerics: further keys of the case.
    """

    def __init__(
        self,
        ratio: float,
        viscosity: float | tuple[float, float],
        columns: int = 48,
        rows: int = 32,
        step: float = 0.05,
        tension: float = 1.0,
        gravity: float = 0.0,
        **numerics: Any,
    ) -> None:
        from warpsph.case.case import Case
        from warpsph.simulation import Simulation

        self.columns, self.rows, self.step = columns, rows, step
        self.ratio, self.tension, self.gravity = ratio, tension, gravity
        both = viscosity if isinstance(viscosity, tuple) else (viscosity, viscosity)
        case = Case.from_dict(scene(columns, rows, ratio, both, step, numerics, tension, gravity))
        self.stepper = Simulation(case, device="cpu").model.stepper
        self.stepper.prepare(fresh=True)
        rest = self._get("position")
        column, row = np.floor(rest).astype(int).T
        self.at = np.empty((columns, rows), dtype=int)  # particle at a column and row
        self.at[column, row] = np.arange(len(rest))
        self.rest = np.column_stack([rest, np.zeros_like(rest), self._get("density_excess")])
        self.response = self._response()

    def _get(self, name: str) -> np.ndarray:
        particles = self.stepper.particles
        ids = particles.get("particle_id")[: particles.fluid_count]
        values = particles.get(name)[: particles.fluid_count].astype(float)
        result = np.empty_like(values)
        result[ids] = values
        return result

    def _put(self, name: str, values: np.ndarray) -> None:
        particles = self.stepper.particles
        ids = particles.get("particle_id")[: particles.fluid_count]
        host = particles.get(name).copy()
        host[: particles.fluid_count] = values[ids]
        particles.put(name, host)

    def advance(self, state: np.ndarray) -> np.ndarray:
        """Return the state (n, 5) one step later."""
        from warpsph.kernels.core import clock as ck

        self._put("position", state[:, :2])
        self._put("anchor", state[:, :2])
        self._put("offset", np.zeros_like(state[:, :2]))
        self._put("velocity", state[:, 2:4])
        self._put("density_excess", state[:, 4])
        self.stepper.write(counters={ck.REBUILD: 1})
        for _ in range(2):  # depths below the interface are of the curvature that the last run of the stages found
            self.stepper.start_nodes.run()
        self.stepper.write(clock={ck.LAST_STEP: self.step, ck.STEP: self.step})
        for task in self.stepper.step_tasks:
            task.run()
            if task.name == "continuity":  # what comes after belongs to the next step
                break
        return np.column_stack([self._get("position"), self._get("velocity"), self._get("density_excess")])

    def _response(self) -> np.ndarray:
        """Return what a step makes of a change in column 0: (5, rows, columns) of each of (5, rows)."""
        result = np.zeros((5, self.rows, self.columns, 5, self.rows))
        for row in range(self.rows):
            for part in range(5):
                change = np.zeros_like(self.rest)
                change[self.at[0, row], part] = EPSILON
                difference = self.advance(self.rest + change) - self.advance(self.rest - change)
                difference[:, 0] -= self.columns * np.rint(difference[:, 0] / self.columns)  # across the periodic side
                result[:, :, :, part, row] = np.moveaxis(difference[self.at], (0, 1, 2), (2, 1, 0)) / (2 * EPSILON)
        return result

    def rates(self, waves: int) -> np.ndarray:
        """Return the rates s [1/s] of all modes of so many waves in the box."""
        phase = np.exp(-2j * np.pi * waves * np.arange(self.columns) / self.columns)
        step = np.einsum("arcbs,c->arbs", self.response, phase).reshape(5 * self.rows, 5 * self.rows)
        factors = np.linalg.eigvals(step).astype(complex)
        return np.log(factors[factors != 0]) / self.step


    def _stiffness(self) -> np.ndarray:
        """Return dp/ds [Pa] of each row, s the density excess."""
        pressures = []
        for sign in (1, -1):
            self._put("density_excess", self.rest[:, 4] + sign * EPSILON)
            self.stepper.start_nodes.run()
            pressures.append(self._get("state")[self.at[0], 0])
        return (pressures[0] - pressures[1]) / (2 * EPSILON)

    def fields(self, waves: int) -> np.ndarray:
        """Return what the sweeps make of the exact wave of ideal fluids, (rows, 4).

        Height over the interface [spacings], acceleration along the interface and across it, both over the exact one, and
        divergence over k times the velocity across.
        """
        k = 2 * np.pi * waves / self.columns
        height = np.arange(self.rows) + 0.5 - 0.5 * self.rows
        below, decay = height < 0, np.exp(-k * abs(height))
        density = np.where(below, self.ratio, 1.0)
        rate2 = stiffness(k, (self.ratio, 1.0), self.tension, self.gravity) * k**3 / (self.ratio + 1)  # omega^2
        moved = np.stack([np.where(below, 1j, -1j) * decay, decay.astype(complex)])
        # a particle has the pressure of its new place, less what it has at rest: -rho g of the way
        pressure = np.where(below, 1, -1) * density * rate2 * decay / k - density * self.gravity * decay
        phase = np.exp(-2j * np.pi * waves * np.arange(self.columns) / self.columns)
        step = np.einsum("arcbs,c->arbs", self.response, phase)
        gained = np.einsum("arbs,bs->ar", step[2:4, :, :2], moved) + step[2:4, :, 4] @ (pressure / self._stiffness())
        divergence = np.einsum("rbs,bs->r", step[4][:, 2:4], moved) / self.step
        along, across = (gained / self.step / (-rate2 * moved)).real
        return np.column_stack([height, along, across, divergence.real / (k * decay)])


def print_fields(linear: LinearStep) -> None:
    """Print what the sweeps make of the exact wave of the length of the box."""
    print("| height | acceleration along / exact | across / exact | divergence / k v |\n|---|---|---|---|")
    near = abs(np.arange(linear.rows) + 0.5 - 0.5 * linear.rows) < 6
    for row in linear.fields(1)[near][::-1]:
        print("| {:+.1f} | {:.4f} | {:.4f} | {:+.4f} |".format(*row))


def main() -> None:
    """Print the rates of waves of the length of the box and less."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--density", type=float, default=1.0, help="of the lower fluid over that of the upper")
    parser.add_argument("--viscosity", type=float, default=0.1265, help="kinematic, in spacings^2/s")
    parser.add_argument("--upper-viscosity", type=float, help="that of the upper fluid, if it has another one")
    parser.add_argument("--columns", type=int, default=48, help="of particles: the longest wave [spacings]")
    parser.add_argument("--rows", type=int, default=32, help="of particles, half of them in each fluid")
    parser.add_argument("--step", type=float, default=0.05, help="time step [s]")
    parser.add_argument("--tension", type=float, default=1.0, help="[N/m]")
    parser.add_argument("--gravity", type=float, default=0.0, help="[spacing/s^2]")
    parser.add_argument("--fields", action="store_true", help="print what the sweeps make of the exact wave")
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="further keys of numerics")
    options = parser.parse_args()
    numerics = dict(text.split("=", 1) for text in options.set)
    lower, upper = options.viscosity, options.upper_viscosity or options.viscosity
    if not stiffness(1.0, (options.density, 1.0), options.tension, options.gravity):
        parser.error("nothing pulls the wave back: --tension or --gravity, this with --density, has to be other than 0")
    pull = {"tension": options.tension, "gravity": options.gravity}
    linear = LinearStep(options.density, (lower, upper), options.columns, options.rows, options.step, **pull, **numerics)
    if options.fields:
        print_fields(linear)
        return
    print("| spacings a wave | exact [1/s] | program [1/s] | fastest growth [1/s] |\n|---|---|---|---|")
    for waves in range(1, linear.columns // 2):
        k, rates = 2 * np.pi * waves / linear.columns, linear.rates(waves)
        fastest = rates[np.argmax(rates.real)]
        try:
            tension = stiffness(k, (options.density, 1.0), options.tension, options.gravity)
            exact = exact_rate(k, (options.density, 1.0), (options.density * lower, upper), tension)
            nearest = rates[np.argmin(abs(rates - exact))]
            texts = [f"{z.real:+.7f} {z.imag:+.7f}i" for z in (exact, nearest)]
        except ValueError:
            texts = ["does not swing", "-"]
        print(f"| {linear.columns / waves:.2f} | {texts[0]} | {texts[1]} | {fastest.real:+.5f} {fastest.imag:+.5f}i |")


if __name__ == "__main__":
    main()
