"""Flow past a cylinder or an airfoil in an unbounded stream from a start at once, in stream function and vorticity.

    python scripts/stream_reference.py cylinder --reynolds 100 --end-time 100 --window 25 --swirl 1
    python scripts/stream_reference.py naca0012 --reynolds 1000 --angle 8 --end-time 13.75 --csv forces.csv

prints the drag and lift with their parts of pressure and friction as means over the last --window, or over the whole periods
in it where vortices are shed; then also the amplitude of the lift and the Strouhal number, and of a cylinder that sheds none
the length of its wake.

Units: speed of the stream 1, density 1, and the diameter or chord 1. The trailing edge of the NACA 0012 is closed.

The plane outside the body is the image of w = xi + i theta, xi > 0, periodic in theta, by z(e^w): a scaled circle, or the
series of Theodorsen (NACA report 411, 1931) and then the map of Karman and Trefftz, which makes the corner of the trailing
edge. With J = |dz/dw|^2, u = psi_y, v = -psi_x the equations are

    J omega_t + psi_theta omega_xi - psi_xi omega_theta = nu (omega_xi_xi + omega_theta_theta)
    psi_xi_xi + psi_theta_theta = -J omega

Space: second-order differences, rings equally divided in theta and crowded at the wall in xi; advection as the mean of its
convective and its conservative form, which makes no enstrophy. Poisson's equation is solved exactly by the modes of theta;
beyond the outer ring psi less that of the potential flow decays mode by mode. Far behind the body the viscosity grows with
the size of the cells, as they cannot carry the vortices there.

Time: the backward differentiation formula of second order with diffusion implicit, factored into one sweep along theta and
one along xi, and with advection extrapolated.

Wall: the new vorticity at the wall is that with which the flow does not slip, mode by mode (L. Quartapelle, Numerical
Solution of the Incompressible Navier-Stokes Equations, 1993): the discrete psi is 0 at the wall, and so is the slope of psi
that the half cell at the wall has by its balance (the formula of Thom). For the mode 0 this says that the total circulation
stays 0 (Kelvin), and so that the pressure comes back to itself around the body. The run has to end before the vorticity
reaches the outer ring.

Forces: at the wall p_theta = nu omega_xi and the friction is nu omega along the wall, so that with the trailing edge z_0

    F_x + i F_y = nu int omega dz - i nu int (z - z_0) omega_xi dtheta

which an independent formula has to meet: F_x + i F_y = i d/dt of the integral of z omega over the plane.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

CROWDING = 0.2, 0.3  # spacing of the rings at the wall over that far out; part of the rings within which it grows e-fold
FAR = 10.0, 30.0  # distances [lengths] between which the viscosity of the far wake sets in
CELL_REYNOLDS = 4.0  # of the far wake: speed 1, spacing along a ring
LEVELS, PER_LEVEL = 8, 16  # the first steps are --step/2^8; after each 16 they are doubled
SWIRL_PLACE, SWIRL_RADIUS = 1.0 + 0.2j, 0.3  # of the disturbance behind a cylinder [lengths]
LARGEST = 1e5  # coefficient of force beyond which a flow has blown up
STEADY = 1e-3  # amplitude of the lift up to which the flow does not shed vortices
RIM = 1e-5  # largest vorticity next to the outer ring for which the stream counts as unbounded
PARTS = "Cd,Cl,Cd_pressure,Cd_friction,Cl_pressure,Cl_friction"


class Map(Protocol):
    """A conformal map from outside the unit circle to outside the body, z = scale e^w far away."""

    scale: float
    edge: complex
    """the trailing edge, or the point farthest back"""

    def __call__(self, xi: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return z and dz/dw (len(xi), count) at theta = (j + 1/2) 2 pi/count, both (rings, around)."""
        ...


def angles(count: int) -> np.ndarray:
    """Return the angles theta of the points of a ring: the trailing edge lies between the first and the last."""
    return (np.arange(count) + 0.5) * (2 * np.pi / count)


class Cylinder:
    """The circle of diameter 1."""

    scale = 0.5
    edge = 0.5 + 0j

    def __call__(self, xi: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return z = e^w/2 and dz/dw."""
        z = self.scale * np.exp(xi[:, None] + 1j * angles(count))
        return z, z.copy()


def naca0012(x: np.ndarray) -> np.ndarray:
    """Return the ordinates of the upper side with a closed trailing edge."""
    return 0.6 * (0.2969 * np.sqrt(x) + x * (-0.1260 + x * (-0.3516 + x * (0.2843 - 0.1036 * x))))


class Airfoil:
    """The NACA 0012 of chord 1 by the maps of Karman-Trefftz and Theodorsen.

    (z - 1)/(z - nose) = ((y - b)/(y + b))^power makes a curve y without corner, y - centre = e^w exp(sum c_k e^(-k w)) makes
    it a circle. On the circle ln|y - centre| is a known function of arg(y - centre), and the series ties the two together.

    Args:
        modes: of the series; a power of 2 for speed.
    """

    edge = 1.0 + 0j
    nose = 0.5 * 1.1019 * 0.12**2 + 0j  # half the radius of the leading edge

    def __init__(self, modes: int = 8192) -> None:
        slope = 0.6 * (0.2969 / 2 - 0.1260 - 2 * 0.3516 + 3 * 0.2843 - 4 * 0.1036)
        self.power = 2 + 2 * np.arctan(slope) / np.pi
        self.half = (1 - self.nose.real) / (2 * self.power)
        near_circle = self._unfold(8 * modes)
        self.centre = near_circle[len(near_circle) // 2].real / 2 + near_circle[0].real / 2
        self.coefficients = self._theodorsen(near_circle - self.centre, modes)
        self.scale = float(np.exp(self.coefficients[0].real))

    def _unfold(self, count: int) -> np.ndarray:
        """Return points y of the curve without corner, counter-clockwise from the trailing edge and back to it."""
        x = (1 + np.cos(np.pi * np.arange(1, count + 1) / count)) / 2
        z = x + 1j * naca0012(x)
        ratio = ((z - self.edge) / (z - self.nose)) ** (1 / self.power)
        upper = np.concatenate([[self.half + 0j], self.half * (1 + ratio) / (1 - ratio)])
        upper[-1] = upper[-1].real
        return np.concatenate([upper, upper[-2::-1].conj()])

    @staticmethod
    def _theodorsen(curve: np.ndarray, modes: int) -> np.ndarray:
        """Return the coefficients c_k (modes,) of the series by iteration: they are real for a symmetric airfoil."""
        count = 2 * modes
        theta = 2 * np.pi * np.arange(count) / count
        argument = np.unwrap(np.angle(curve))
        turned = theta
        for _ in range(60):
            logarithm = np.interp(turned, argument, np.log(np.abs(curve)))
            series = np.fft.rfft(logarithm).real[:-1] * 2 / count
            series[0] /= 2
            sine = np.zeros(modes + 1, dtype=complex)
            sine[:-1] = series * (0.5j * count)  # the imaginary part of the series is -sum c_k sin(k theta)
            sine[0] = 0
            turned = theta + np.fft.irfft(sine, count)
        return series.astype(complex)

    def _series(self, coefficients: np.ndarray, xi: np.ndarray, count: int) -> np.ndarray:
        """Return sum over k of coefficients_k e^(-k w) at the points of the rings (rings, count)."""
        order = np.arange(len(coefficients))
        half_turn = coefficients * np.exp(-1j * order * np.pi / count)
        padded = np.zeros(-(-len(order) // count) * count, dtype=complex)
        rings = []
        for radius in xi:
            padded[: len(order)] = half_turn * np.exp(-order * radius)
            rings.append(np.fft.fft(padded.reshape(-1, count).sum(axis=0)))
        return np.array(rings)

    def __call__(self, xi: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return z and dz/dw; dz/dy = (z - 1)(z - nose)/(y^2 - b^2)."""
        order = np.arange(len(self.coefficients))
        away = np.exp(xi[:, None] + 1j * angles(count) + self._series(self.coefficients, xi, count))
        stretch = 1 - self._series(order * self.coefficients, xi, count)
        y = self.centre + away
        ratio = ((y - self.half) / (y + self.half)) ** self.power
        z = (self.edge - self.nose * ratio) / (1 - ratio)
        return z, (z - self.edge) * (z - self.nose) / (y**2 - self.half**2) * away * stretch


class Lines:
    """Tridiagonal systems along the first axis, one for each entry of the others, factored once.

    Args:
        lower, diagonal, upper: (n, m) coefficients of the row before, this row, the row after.
    """

    def __init__(self, lower: np.ndarray, diagonal: np.ndarray, upper: np.ndarray) -> None:
        self.inverse, self.upper = np.empty_like(diagonal), np.zeros_like(diagonal)
        self.inverse[0] = 1 / diagonal[0]
        for row in range(1, len(diagonal)):
            self.upper[row - 1] = upper[row - 1] * self.inverse[row - 1]
            self.inverse[row] = 1 / (diagonal[row] - lower[row] * self.upper[row - 1])
        self.lower = lower * self.inverse

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solutions (n, m) for right sides (n, m)."""
        answer = right * self.inverse
        work = np.empty_like(answer[0])
        for row in range(1, len(answer)):
            np.multiply(self.lower[row], answer[row - 1], out=work)
            answer[row] -= work
        for row in range(len(answer) - 2, -1, -1):
            np.multiply(self.upper[row], answer[row + 1], out=work)
            answer[row] -= work
        return answer


class Rings:
    """Periodic tridiagonal systems along the first axis by the formula of Sherman and Morrison.

    Args:
        diagonal: (n, m).
        beside: (m,) coefficient of both neighbours.
    """

    def __init__(self, diagonal: np.ndarray, beside: np.ndarray) -> None:
        cut = diagonal.copy()
        cut[0] += diagonal[0]
        cut[-1] += beside**2 / diagonal[0]
        off = np.broadcast_to(beside, diagonal.shape)
        self.lines = Lines(off, cut, off)
        self.last = -beside / diagonal[0]
        ends = np.zeros_like(diagonal)
        ends[0], ends[-1] = -diagonal[0], beside
        self.reach = self.lines.solve(ends)
        self.reach /= 1 + self.reach[0] + self.last * self.reach[-1]

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the solutions (n, m) for right sides (n, m)."""
        answer = self.lines.solve(right)
        answer -= self.reach * (answer[0] + self.last * answer[-1])
        return answer


class Grid:
    """Rings around a body, from its wall out to a circle of `outer` lengths.

    Args:
        body: the map.
        radial: number of the outermost ring; the wall is ring 0.
        around: points of a ring, even.
        outer: radius of the outermost ring [lengths].
    """

    def __init__(self, body: Map, radial: int, around: int, outer: float) -> None:
        part = np.arange(radial + 1) / radial
        wall, growth = CROWDING
        xi = part - (1 - wall) * growth * (1 - np.exp(-part / growth))
        self.xi = xi / xi[-1] * np.log(outer / body.scale)
        self.around, self.body = around, body
        self.turn = 2 * np.pi / around
        self.theta = angles(around)
        self.z, self.slope = body(self.xi, around)
        self.jacobian = np.abs(self.slope) ** 2
        self.gap = np.diff(self.xi)
        """(radial,) between a ring and the next"""
        self.width = np.zeros(radial + 1)
        self.width[:-1] += self.gap / 2
        self.width[1:] += self.gap / 2
        self.cells = self.width[:, None] * self.jacobian
        """(rings, around) area per turn in theta"""

    def along(self, values: np.ndarray) -> np.ndarray:
        """Return the central derivative to theta along the last axis."""
        slope = np.empty_like(values)
        slope[..., 1:-1] = values[..., 2:] - values[..., :-2]
        slope[..., 0] = values[..., 1] - values[..., -1]
        slope[..., -1] = values[..., 0] - values[..., -2]
        slope /= 2 * self.turn
        return slope

    def across(self, values: np.ndarray) -> np.ndarray:
        """Return the central derivative to xi at all rings but the first and the last."""
        return (values[2:] - values[:-2]) / (2 * self.width[1:-1, None])

    def integral(self, values: np.ndarray) -> complex:
        """Return the integral over the plane of values (rings, around)."""
        return np.sum(self.cells * values) * self.turn

    def potential(self, angle: float) -> np.ndarray:
        """Return the stream function of the potential flow without circulation, the stream at an angle [rad]."""
        return 2 * self.body.scale * np.sinh(self.xi)[:, None] * np.sin(self.theta - angle)


class Poisson:
    """The stream function 0 at the wall that decays outwards, and what its slope at the wall sums from the vorticity.

    For each mode of theta the equation times the widths of the rings is symmetric. With the answer `reach` to 1 at the wall
    and 0 elsewhere, the slope of psi at the wall is the sum over all rings of reach times cells times vorticity.
    """

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        order = np.arange(grid.around // 2 + 1)
        square = (2 - 2 * np.cos(order * grid.turn)) / grid.turn**2
        inverse = np.broadcast_to(1 / grid.gap[:, None], (len(grid.gap), len(order)))
        diagonal = inverse + grid.width[1:, None] * square
        diagonal[:-1] += inverse[1:]
        diagonal[-1] += np.sqrt(square)
        lower = -inverse
        upper = np.zeros_like(diagonal)
        upper[:-1] = -inverse[1:]
        self.lines = Lines(lower, diagonal, upper)
        source = np.zeros_like(diagonal)
        source[0] = inverse[0]
        self.reach = np.concatenate([np.ones((1, len(order))), self.lines.solve(source)])
        """(rings, modes)"""

    def slope(self, vorticity: np.ndarray) -> np.ndarray:
        """Return the slope psi_xi at the wall that vorticity (rings, around) makes with psi = 0 there."""
        modes = np.fft.rfft(self.grid.cells * vorticity, axis=1)
        return np.fft.irfft(np.einsum("ik,ik->k", self.reach, modes), self.grid.around)

    def solve(self, vorticity: np.ndarray) -> np.ndarray:
        """Return psi (rings, around)."""
        psi = np.zeros_like(vorticity)
        modes = np.fft.rfft(self.grid.cells[1:] * vorticity[1:], axis=1)
        psi[1:] = np.fft.irfft(self.lines.solve(modes), self.grid.around, axis=1)
        return psi


class Wall:
    """The vorticity at the wall with which the flow does not slip.

    Args:
        poisson: of the grid.
        response: (rings, around) vorticity where there is 1 at the point of the wall on the same line.
    """

    def __init__(self, poisson: Poisson, response: np.ndarray) -> None:
        self.poisson, self.response = poisson, response
        count = poisson.grid.around
        kernels = np.fft.irfft(poisson.reach.T @ (poisson.grid.cells * response), count, axis=0)
        index = np.arange(count)
        slopes = kernels[(index[:, None] - index) % count, index]  # of psi at the wall, from vorticity at the wall
        self.influence = np.linalg.inv(slopes)

    def enforce(self, vorticity: np.ndarray, slope: np.ndarray) -> None:
        """Add the vorticity from the wall with which psi has the wanted slope (around,) there."""
        vorticity += self.response * (self.influence @ (slope - self.poisson.slope(vorticity)))


class Diffusion:
    """The implicit part of a step: (J - c D_theta) J^-1 (J - c D_xi) change = right, and what it spreads from the wall.

    Args:
        poisson: of the grid.
        viscosity: (rings,).
        time: c, the step over the coefficient of the new time.
    """

    def __init__(self, poisson: Poisson, viscosity: np.ndarray, time: float) -> None:
        grid = poisson.grid
        self.jacobian = grid.jacobian[1:-1]
        beside = time * viscosity[1:-1] / grid.turn**2
        self.rings = Rings((self.jacobian + 2 * beside[:, None]).T.copy(), -beside)
        flux = time * (viscosity[1:] + viscosity[:-1]) / (2 * grid.gap)
        lower, upper = (-side[:, None] / grid.width[1:-1, None] for side in (flux[:-1], flux[1:]))
        shape = self.jacobian.shape
        self.lines = Lines(np.broadcast_to(lower, shape), self.jacobian - lower - upper, np.broadcast_to(upper, shape))
        source = np.zeros(shape)
        source[0] = -lower[0]
        response = np.zeros_like(grid.jacobian)
        response[0] = 1
        response[1:-1] = self.lines.solve(source)
        self.wall = Wall(poisson, response)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the change (rings - 2, around) with none at the wall."""
        return self.lines.solve(self.jacobian * self.rings.solve(right.T.copy()).T)


@dataclass(frozen=True)
class Force:
    """Coefficients at a time, drag + i lift."""

    time: float
    pressure: complex
    friction: complex

    @property
    def total(self) -> complex:
        """Both parts."""
        return self.pressure + self.friction

    @property
    def row(self) -> list[float]:
        """Time, drag, lift, drag by pressure and by friction, lift by pressure and by friction."""
        total, pressure, friction = self.total, self.pressure, self.friction
        return [self.time, total.real, total.imag, pressure.real, friction.real, pressure.imag, friction.imag]


class Flow:
    """The flow from a start at once: at time 0 all vorticity is a sheet on the wall, and the swirl if there is one.

    Args:
        grid: the rings.
        reynolds: number with the length 1.
        angle: of the stream [rad].
        swirl: vorticity of a disturbance behind the body at the start.
    """

    def __init__(self, grid: Grid, reynolds: float, angle: float = 0.0, swirl: float = 0.0) -> None:
        self.grid, self.poisson = grid, Poisson(grid)
        self.viscosity = 1 / reynolds
        self.spread = self._spread()
        """(rings,) the viscosity, which grows far out"""
        self.direction = complex(np.exp(1j * angle))
        self.potential = grid.potential(angle)
        self.wanted = -2 * grid.body.scale * np.sin(grid.theta - angle)
        """(around,) slope at the wall that takes the slip of the potential flow away"""
        self.time = 0.0
        self.wall_rate = np.zeros(grid.around)
        """(around,) of the vorticity, as the last step has it"""
        self.vorticity = swirl * np.exp(-(np.abs(grid.z - SWIRL_PLACE) ** 2) / SWIRL_RADIUS**2)
        self.vorticity[[0, -1]] = 0
        sheet = np.zeros_like(self.vorticity)
        sheet[0] = 1
        Wall(self.poisson, sheet).enforce(self.vorticity, self.wanted)
        self.former: tuple[np.ndarray, np.ndarray, float] | None = None
        """vorticity and advection a step before, and that step"""
        self._solvers: dict[float, Diffusion] = {}

    def _spread(self) -> np.ndarray:
        radius = self.grid.body.scale * np.exp(self.grid.xi)
        part = np.clip((radius - FAR[0]) / (FAR[1] - FAR[0]), 0, 1)
        return np.maximum(self.viscosity, part**2 * (3 - 2 * part) * radius * self.grid.turn / CELL_REYNOLDS)

    @property
    def stream(self) -> np.ndarray:
        """The stream function (rings, around)."""
        return self.poisson.solve(self.vorticity) + self.potential

    def advection(self) -> np.ndarray:
        """Return psi_theta omega_xi - psi_xi omega_theta at the inner rings (rings - 2, around)."""
        grid, vorticity, psi = self.grid, self.vorticity, self.stream
        outward, onward = grid.along(psi), -grid.across(psi)
        inner = vorticity[1:-1]
        flux = grid.along(onward * inner) + grid.across(outward * vorticity)
        return (flux + outward[1:-1] * grid.across(vorticity) + onward * grid.along(inner)) / 2

    def diffusion(self, vorticity: np.ndarray) -> np.ndarray:
        """Return the sum of the second derivatives times the viscosity at the inner rings (rings - 2, around)."""
        grid, spread = self.grid, self.spread
        flux = np.diff(vorticity, axis=0) * ((spread[1:] + spread[:-1]) / (2 * grid.gap))[:, None]
        inner = vorticity[1:-1]
        bend = np.roll(inner, 1, axis=1) + np.roll(inner, -1, axis=1) - 2 * inner
        return np.diff(flux, axis=0) / grid.width[1:-1, None] + (spread[1:-1] / grid.turn**2)[:, None] * bend

    def step(self, step: float) -> None:
        """Go on by a step, of the first order if it is the first."""
        advection, old = self.advection(), self.vorticity
        if self.former is None:
            leading, past, forward, pushed = 1.0, old, old, advection
        else:
            before, its_advection, its_step = self.former
            ratio = step / its_step
            leading = (1 + 2 * ratio) / (1 + ratio)
            past = ((1 + ratio) * old - ratio**2 / (1 + ratio) * before) / leading
            forward = (1 + ratio) * old - ratio * before
            pushed = (1 + ratio) * advection - ratio * its_advection
        time = step / leading
        right = self.grid.jacobian[1:-1] * (past - forward)[1:-1] + time * (self.diffusion(forward) - pushed)
        new = forward.copy()
        solver = self._solver(time)
        new[1:-1] += solver.solve(right)
        solver.wall.enforce(new, self.wanted)
        self.wall_rate = (new[0] - past[0]) / time
        self.former = (old, advection, step)
        self.vorticity = new
        self.time += step

    def _solver(self, time: float) -> Diffusion:
        """Return the implicit part; the last two are kept, as the first step of a new length has its own."""
        if time not in self._solvers:
            while len(self._solvers) > 1:
                del self._solvers[next(iter(self._solvers))]
            self._solvers[time] = Diffusion(self.poisson, self.spread, time)
        return self._solvers[time]

    def wall_slope(self) -> np.ndarray:
        """Return omega_xi (around,) at the wall: the slope from there to the first ring less what the transport bends it.

        The mean is taken off, as the pressure comes back to itself around the body.
        """
        grid, (wall, one) = self.grid, self.vorticity[:2]
        along = (np.roll(wall, 1) + np.roll(wall, -1) - 2 * wall) / grid.turn**2
        bend = grid.jacobian[0] * self.wall_rate / self.viscosity - along
        slope = (one - wall) / grid.gap[0] - bend * grid.gap[0] / 2
        return slope - slope.mean()

    def force(self) -> Force:
        """Return the coefficients of the force on the body from the vorticity at the wall and its slope."""
        grid = self.grid
        scale = 2 * self.viscosity * grid.turn / self.direction
        friction = scale * np.sum(self.vorticity[0] * 1j * grid.slope[0])
        pressure = -1j * scale * np.sum((grid.z[0] - grid.body.edge) * self.wall_slope())
        return Force(self.time, complex(pressure), complex(friction))

    def impulse(self) -> complex:
        """Return 2 i times the integral of z omega: its rate is the coefficient of the force, drag + i lift."""
        return 2j * self.grid.integral(self.grid.z * self.vorticity) / self.direction

    def run(self, step: float, end_time: float) -> Iterator[Force]:
        """Yield the force after each step, from fine steps at the start to the end.

        Raises:
            ArithmeticError: if the flow blows up.
        """
        fine = [step / 2**level for level in (LEVELS, *range(LEVELS, 0, -1)) for _ in range(PER_LEVEL)]
        while self.time < end_time - 1e-6 * step:
            self.step(fine.pop(0) if fine else step)
            force = self.force()
            if not abs(force.total) < LARGEST:
                raise ArithmeticError(f"the flow blew up at t = {self.time:g}")
            yield force

    @property
    def rim(self) -> float:
        """The largest vorticity next to the outermost ring."""
        return float(np.abs(self.vorticity[-2]).max())

    def wake_length(self) -> float:
        """Return the distance [lengths] from the body to where the flow along the axis turns around; 0 if it does not.

        It is for a symmetric flow along x: next to the axis psi has the sign of the speed along it.
        """
        reverse = np.flatnonzero(self.stream[1:, 0] < 0) + 1
        if not len(reverse):
            return 0.0
        ring = reverse[-1]
        inner, outer = self.stream[ring : ring + 2, 0]
        x = self.grid.z[ring : ring + 2, 0].real
        return float(x[0] + (x[1] - x[0]) * inner / (inner - outer) - self.grid.body.edge.real)


BODIES: dict[str, type[Cylinder] | type[Airfoil]] = {"cylinder": Cylinder, "naca0012": Airfoil}
CASE = {"cylinder": "Re,t_U_over_D", "naca0012": "alpha_deg,t_U_over_c"}  # the first columns of a series
STEP = 0.5  # times the points of a ring; twice that blew up at Re 3000 (cylinder) and 1000 (airfoil, 8 degrees)


def means(series: np.ndarray, window: float) -> np.ndarray:
    """Return the means of the columns of a series, the first of which is the time, over the last part of it."""
    last = series[series[:, 0] >= series[-1, 0] - window * (1 + 1e-9)]
    return np.trapezoid(last, last[:, 0], axis=0) / np.ptp(last[:, 0])


def shedding(series: np.ndarray, window: float) -> tuple[float, float]:
    """Return half the range of the lift over the last part of a series, and its frequency: nan for less than two periods."""
    last = series[series[:, 0] >= series[-1, 0] - window * (1 + 1e-9)]
    time, lift = last[:, 0], last[:, 2] - means(series, window)[2]
    amplitude = float(np.ptp(lift)) / 2
    up = np.flatnonzero((lift[:-1] < 0) & (lift[1:] >= 0))
    if amplitude < STEADY or len(up) < 3:
        return amplitude, np.nan
    crossing = time[up] - lift[up] * (time[up + 1] - time[up]) / (lift[up + 1] - lift[up])
    return amplitude, float((len(up) - 1) / (crossing[-1] - crossing[0]))


def sampled(series: np.ndarray, interval: float) -> np.ndarray:
    """Return the series at multiples of an interval, from the first of them to the end."""
    time = interval * np.arange(1, int(series[-1, 0] / interval * (1 + 1e-9)) + 1)
    return np.column_stack([time, *(np.interp(time, series[:, 0], column) for column in series[:, 1:].T)])


def default_step(around: int) -> float:
    """Return a step that was stable with a cylinder to Re = 9500 and the airfoil at 1000, and that divides 0.1."""
    return 0.1 / np.ceil(0.1 * around / STEP)


def refuse(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """End with a message and exit code 2 if a value has no meaning or a result could not be written."""
    for key in ("reynolds", "end_time", "step", "interval", "window"):
        value = getattr(options, key)
        if not 0 < value < np.inf:
            parser.error(f"--{key.replace('_', '-')} {value:g}: has to be above 0 and finite; give such a number")
    for key in ("step", "interval", "window"):
        if getattr(options, key) > options.end_time:
            parser.error(
                f"--{key} {getattr(options, key):g}: has to be at most --end-time {options.end_time:g}; make it less"
            )
    if options.window < options.step:
        parser.error(f"--window {options.window:g}: has to be at least --step {options.step:g}; make it longer")
    for angle in options.angle:
        if not -45 <= angle <= 45:
            parser.error(f"--angle {angle:g}: has to be from -45 to 45 degrees; give such a number")
    if not -np.inf < options.swirl < np.inf:
        parser.error(f"--swirl {options.swirl:g}: has to be finite; give such a number")
    if options.swirl and options.body != "cylinder":
        parser.error(f"--swirl {options.swirl:g}: has to be 0 with {options.body}, whose tail it would lie on; leave it out")
    if options.radial < 16:
        parser.error(f"--radial {options.radial}: has to be at least 16; take more rings")
    if options.around % 2 or options.around < 16:
        parser.error(f"--around {options.around}: has to be even and at least 16; take {max(options.around + 1, 16)}")
    least = 10 + 1.1 * options.end_time
    if not least <= options.outer < np.inf:
        rule = f"has to be finite and at least {least:g}, or the wake arrives there by the end"
        parser.error(f"--outer {options.outer:g}: {rule}; make it larger or --end-time shorter")
    if options.csv and (Path(options.csv).is_dir() or not Path(options.csv).absolute().parent.is_dir()):
        parser.error(f"--csv {options.csv}: has to be a file in a folder that exists; make the folder first")


def options_of(arguments: list[str] | None) -> argparse.Namespace:
    """Return the options with all defaults filled in, or end with a message and exit code 2."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("body", choices=BODIES, help="a circle of diameter 1 or an airfoil of chord 1")
    parser.add_argument("--reynolds", type=float, help="number with the length 1 (cylinder 100, airfoil 1000)")
    parser.add_argument("--angle", type=float, nargs="+", default=[0.0], help="of the stream [degrees]; each makes a run")
    parser.add_argument("--end-time", type=float, default=10.0, help="times the speed over the length (10)")
    parser.add_argument("--window", type=float, help="of the means, up to the end (1, or the whole run if that is shorter)")
    parser.add_argument(
        "--swirl", type=float, default=0.0, help="vorticity of a disturbance behind a cylinder; 1 starts shedding"
    )
    parser.add_argument("--radial", type=int, default=192, help="number of rings (192)")
    parser.add_argument("--around", type=int, default=384, help="points of a ring, even (384)")
    parser.add_argument("--step", type=float, help="of time (0.5/around)")
    parser.add_argument("--outer", type=float, help="radius of the outermost ring [lengths] (50, and more for long runs)")
    parser.add_argument("--csv", metavar="FILE", help="the series of all forces as comma-separated values")
    parser.add_argument("--interval", type=float, default=0.1, help="between the times of the series (0.1)")
    options = parser.parse_args(arguments)
    defaults = {
        "reynolds": 100.0 if options.body == "cylinder" else 1000.0,
        "window": min(1.0, options.end_time),
        "step": min(default_step(max(options.around, 1)), options.end_time),
        "outer": max(50.0, 20 + 1.5 * options.end_time),
    }
    for key, value in defaults.items():
        if getattr(options, key) is None:
            setattr(options, key, value)
    refuse(parser, options)
    return options


def describe(flow: Flow, series: np.ndarray, window: float) -> str:
    """Return the columns of the table from the drag on, means over whole periods if vortices are shed."""
    amplitude, strouhal = shedding(series, window)
    periods = window if np.isnan(strouhal) else np.floor(window * strouhal) / strouhal
    cells = [f"{round(value, 4) + 0.0:.4f}" for value in means(series, periods)[1:]]  # + 0: no minus before a 0
    steady = amplitude < STEADY and isinstance(flow.grid.body, Cylinder)
    cells += [f"{amplitude:.4f}", "-" if np.isnan(strouhal) else f"{strouhal:.4f}"]
    return " | ".join([*cells, f"{flow.wake_length():.3f}" if steady else "-"])


def part_of(path: Path) -> Path:
    """Return the file beside a file in which that is written until it is whole."""
    return path.with_name(path.name + ".part")


def written(path: Path, body: str, table: list[list[float]]) -> None:
    """Write the series as comma-separated values: a whole file, or that of before.

    Raises:
        OSError: if it cannot be written.
    """
    lines = (",".join(f"{round(value, 6) + 0.0:g}" for value in row) for row in table)  # + 0: no minus before a 0
    part = part_of(path)
    try:
        part.write_text("\n".join([f"{CASE[body]},{PARTS}", *lines]) + "\n")
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def run_all(options: argparse.Namespace) -> None:
    """Print a row for each angle, and write the series of all that have ended.

    Raises:
        ArithmeticError: if a flow blows up.
        OSError: if the series cannot be written.
    """
    if options.csv:
        # What cannot be written is known before the first run, and a file of before stays until there is a new one.
        probe = part_of(Path(options.csv))
        probe.write_text("")
        probe.unlink()
    grid = Grid(BODIES[options.body](), options.radial, options.around, options.outer)
    names = ["Re", "angle", *PARTS.split(","), "amplitude of Cl", "St", "wake length"]
    print("| " + " | ".join(names) + " |\n" + "|---" * len(names) + "|")
    table: list[list[float]] = []
    for angle in options.angle:
        flow = Flow(grid, options.reynolds, np.radians(angle), options.swirl)
        series = np.array([force.row for force in flow.run(options.step, options.end_time)])
        print(f"| {options.reynolds:g} | {angle:g} | {describe(flow, series, options.window)} |", flush=True)
        if flow.rim > RIM:
            print(f"vorticity {flow.rim:.1e} is at the outermost ring; choose a larger --outer", file=sys.stderr)
        case = options.reynolds if options.body == "cylinder" else angle
        table += [[case, *row] for row in sampled(series, options.interval)]
        if options.csv:
            written(Path(options.csv), options.body, table)


def main(arguments: list[str] | None = None) -> int:
    """Run; return 1 if a flow blew up, 3 if the series could not be written, 130 for Ctrl-C. Angles that ended are kept."""
    options = options_of(arguments)
    try:
        run_all(options)
    except ArithmeticError as error:
        print(f"{error}; choose a --step less than {options.step:g}", file=sys.stderr)
        return 1
    except OSError as error:
        print(
            f"--csv {options.csv}: could not be written: {error.strerror}; make room or choose another file", file=sys.stderr
        )
        return 3
    except KeyboardInterrupt:
        print("stopped; angles that had ended are kept", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
