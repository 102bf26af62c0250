"""What a run of the compressible gas executes, in order."""

from __future__ import annotations

from warpsph.engine import integrators
from warpsph.engine.program import Absent, BuildList, KeepList, Node, Program, Stage
from warpsph.kernels.core.clock import make_advance
from warpsph.kernels.core.spec import Spec
from warpsph.kernels.gas.gas_density import make_gas_density
from warpsph.kernels.gas.gas_ends import make_gas_release
from warpsph.kernels.gas.gas_fields import ADVANCED
from warpsph.kernels.gas.gas_forces import make_gas_forces
from warpsph.kernels.gas.gas_gradient import make_gas_gradient
from warpsph.kernels.gas.gas_steps import make_gas_correct, make_gas_predict, make_gas_signal, make_gas_watch
from warpsph.kernels.gas.gas_walls import make_gas_reflect

FIRST_LISTS = 3  # a smoothing length that a jump changes at the start may reach beyond the list that was made for it


def program(spec: Spec, integrator: str) -> Program:
    """Return what runs for a `Spec` and the name of an integrator."""
    step = kick_drift_kick(spec) if not spec.runge_kutta else runge_kutta(spec, integrator)
    return Program(step=step, start=start(spec), advance=advance(spec))


def kick_drift_kick(spec: Spec) -> list[Node]:
    """Return the nodes of a step with one evaluation of the rates."""
    return [
        Stage("predict", make_gas_predict(spec), "fluid", "half a kick, drift, velocity and energy of the end"),
        *rates(spec),
        Stage("correct", make_gas_correct(spec), "fluid", "second half of the kick"),
        *closing(spec),
    ]


def runge_kutta(spec: Spec, integrator: str) -> list[Node]:
    """Return the nodes of a step of Runge and Kutta; its end has rates of its own, for the state and the next step."""
    method = {"rk2": integrators.rk2, "rk4": integrators.rk4}[integrator]
    offset, velocity, total_energy = ADVANCED
    advanced = {"velocity": offset, "acceleration": velocity, "power": total_energy}
    return [*method(spec, advanced, rates(spec)), density(spec), *closing(spec)]


def rates(spec: Spec) -> list[Node]:
    """Return the stages that write acceleration and power."""
    gradient = Stage("gradient", make_gas_gradient(spec), "fluid", "gradients of density, velocity, pressure; stretching")
    reason = "pairs of Riemann problems" if spec.star else "pressure and artificial viscosity"
    forces = Stage("forces", make_gas_forces(spec), "fluid", f"acceleration and power: {reason}")
    return [density(spec), *([gradient] if spec.limited else []), forces]


def density(spec: Spec, beginning: int = 0) -> Stage:
    """Return the stage of density, smoothing length and pressure."""
    reason = "energy from the pressure of the start" if beginning else "smoothing length, pressure"
    return Stage("density", make_gas_density(spec), "fluid", f"density and {reason}", {"beginning": beginning})


def closing(spec: Spec) -> list[Node]:
    """Return what ends a step: watch, the next step, the list."""
    reflect = Stage("reflect", make_gas_reflect(spec), "fluid", "particles beyond a mirror become their images")
    release = Stage("release", make_gas_release(spec), "fluid", "held particles that a wave has met are let go")
    return [
        *([reflect] if spec.mirror else []),
        Stage("watch", make_gas_watch(spec), "fluid", "speeds, ways, faults"),
        *([release] if spec.held else []),
        Stage("signal", make_gas_signal(spec), "one", "largest signal rate"),
        advance(spec),
        KeepList(),
    ]


def start(spec: Spec) -> list[Node]:
    """Return the nodes that complete a start: smoothing lengths and the lists that they need, energies, the first rates."""
    nodes: list[Node] = []
    for _ in range(FIRST_LISTS):
        nodes += [BuildList("the first lists"), density(spec, beginning=1)]
    return [
        *nodes,
        BuildList("the first lists"),
        *rates(spec),
        Stage("signal", make_gas_signal(spec), "one", "largest signal rate"),
    ]


def advance(spec: Spec) -> Stage:
    """Return the stage that ends a step; without advancing it also prepares the first one."""
    return Stage("advance", make_advance(spec.precision), "one", "time, next step length, list check")


def absent(spec: Spec) -> list[Absent]:
    """Return what a step leaves out for a `Spec`, and why."""
    rows = []
    if not spec.star:
        rows.append(Absent("Riemann problems", "numerics.dissipation is artificial"))
    elif not spec.limited:
        rows.append(Absent("gradient", "numerics.reconstruction is none"))
    if not spec.conduction:
        rows.append(Absent("artificial conduction", "numerics.conductivity is 0, or the dissipation is not artificial"))
    if not spec.mirror:
        rows.append(Absent("mirror images", "no side is a wall"))
    if not spec.held:
        rows.append(Absent("held particles", "no open side, or numerics.hold_open_sides is false"))
    if not (spec.gravity or spec.body_force):
        rows.append(Absent("gravity", "gravity and body_force are zero"))
    if not any(spec.periodic):
        rows.append(Absent("periodic images", "no periodic axis"))
    return rows
